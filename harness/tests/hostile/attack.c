/* Attacks on the sandbox, one per call. Each prints one word: "ok" when it worked, or the name of
 * the errno that stopped it. A program (the sandbox's `Build`) and a library (its `Worker`).
 * They aim at nothing but what the test made. */
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/shm.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

static int say(int result) {
    dprintf(1, "%s\n", result >= 0 ? "ok" : strerrorname_np(errno));
    return result < 0;
}

static int attempt_open(const char *path, int flags) {
    int fd = open(path, flags, 0600);
    char byte;
    if (fd < 0 || (flags & O_ACCMODE) != O_RDONLY || (flags & O_DIRECTORY)) return fd;
    return read(fd, &byte, 1) < 0 ? -1 : fd;
}

static int internet(int type, int port) {
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(port)};
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int fd = socket(AF_INET, type, 0);
    if (fd < 0) return -1;
    return connect(fd, (struct sockaddr *)&to, sizeof to) < 0 ? -1 : (int)send(fd, "x", 1, 0);
}

static int local(const char *name, int abstract) {
    struct sockaddr_un to = {.sun_family = AF_UNIX};
    size_t length = strlen(name);
    memcpy(to.sun_path + abstract, name, length);
    int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    if (fd < 0) return -1;
    return connect(fd, (struct sockaddr *)&to,
                   offsetof(struct sockaddr_un, sun_path) + abstract + length + !abstract);
}

static int fill(const char *folder) {
    char path[512];
    static char block[1 << 16];
    snprintf(path, sizeof path, "%s/filled", folder);
    for (int file = 0; file < 8; file++) {
        snprintf(path, sizeof path, "%s/filled%d", folder, file);
        int fd = open(path, O_WRONLY | O_CREAT, 0600);
        if (fd < 0) return -1;
        for (int i = 0; i < 32; i++)
            if (write(fd, block, sizeof block) < 0) return -1;
        close(fd);
    }
    return 0;
}

static int many(const char *folder) {
    char path[512];
    for (int file = 0; file < 20000; file++) {
        snprintf(path, sizeof path, "%s/many%d", folder, file);
        int fd = open(path, O_WRONLY | O_CREAT, 0600);
        if (fd < 0) return -1;
        close(fd);
    }
    return 0;
}

/* The pipe's other end hears when the daemon is gone. */
static int daemonise(void) {
    pid_t child = fork();
    if (child < 0) return -1;
    if (child > 0) return 0;
    setsid();
    if (fork() > 0) _exit(0);
    signal(SIGTERM, SIG_IGN);
    signal(SIGHUP, SIG_IGN);
    dprintf(1, "%d\n", getpid());
    for (int i = 0; i < 30; i++) sleep(1);
    _exit(0);
}

static void *idle(void *seconds) {
    sleep((unsigned)(size_t)seconds);
    return NULL;
}

static int threads(int count) {
    pthread_attr_t attributes;
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, 1 << 16);
    for (int i = 0; i < count; i++) {
        pthread_t thread;
        errno = pthread_create(&thread, &attributes, idle, (void *)(size_t)(count > 1 ? 2 : 0));
        if (errno) return -1;
        if (count == 1) pthread_join(thread, NULL);
    }
    return 0;
}

static int descriptors(void) {
    for (int i = 0; i < 5000; i++)
        if (open("/dev/null", O_RDONLY) < 0) return -1;
    return 0;
}

/* As a just-in-time compiler does. */
static int jit(void) {
    unsigned char *code =
        mmap(NULL, 4096, PROT_READ | PROT_WRITE | PROT_EXEC, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (code == MAP_FAILED) return -1;
#ifdef __x86_64__
    memcpy(code, "\xb8\x07\x00\x00\x00\xc3", 6);
    return ((int (*)(void))code)() == 7 ? 0 : -1;
#else
    return 0;
#endif
}

int attack(int argc, char **argv) {
    const char *what = argv[0], *arg = argc > 1 ? argv[1] : "";
    int number = atoi(arg);
    if (!strcmp(what, "read")) return say(attempt_open(arg, O_RDONLY));
    if (!strcmp(what, "list")) return say(attempt_open(arg, O_RDONLY | O_DIRECTORY));
    if (!strcmp(what, "write")) return say(attempt_open(arg, O_WRONLY | O_CREAT));
    if (!strcmp(what, "change")) return say(attempt_open(arg, O_WRONLY));
    if (!strcmp(what, "chmod")) return say(chmod(arg, 0666));
    if (!strcmp(what, "exec")) {
        /* Says "ok" itself when it runs. */
        execl(arg, arg, "-c", "echo ok", NULL);
        return say(-1);
    }
    if (!strcmp(what, "fork")) {
        pid_t child = fork();
        if (child == 0) _exit(0);
        return say(child);
    }
    if (!strcmp(what, "clone3")) {
        unsigned long long arguments[8] = {0};
        arguments[4] = SIGCHLD;
        long child = syscall(SYS_clone3, arguments, sizeof arguments);
        if (child == 0) _exit(0);
        return say((int)child);
    }
    if (!strcmp(what, "tcp")) return say(internet(SOCK_STREAM, number));
    if (!strcmp(what, "udp")) return say(internet(SOCK_DGRAM, number));
    if (!strcmp(what, "unix")) return say(local(arg, 0));
    if (!strcmp(what, "abstract")) return say(local(arg, 1));
    if (!strcmp(what, "ptrace")) return say((int)ptrace(PTRACE_ATTACH, number, 0, 0));
    if (!strcmp(what, "memory")) {
        char byte;
        struct iovec here = {&byte, 1}, there = {(void *)strtoul(argv[2], NULL, 0), 1};
        return say((int)process_vm_readv(number, &here, 1, &there, 1, 0));
    }
    if (!strcmp(what, "kill")) return say(kill(number, SIGTERM));
    /* Signal 0 is sent to nobody: the answer tells whether there is someone to hit. */
    if (!strcmp(what, "reach")) return say(kill(number, 0));
    if (!strcmp(what, "raise_limit")) {
        struct rlimit limit;
        getrlimit(RLIMIT_NOFILE, &limit);
        limit.rlim_max += 1;
        return say(setrlimit(RLIMIT_NOFILE, &limit));
    }
    if (!strcmp(what, "lower_limit")) {
        struct rlimit limit = {0, 0};
        return say(setrlimit(RLIMIT_CORE, &limit));
    }
    if (!strcmp(what, "fill")) return say(fill(arg));
    if (!strcmp(what, "many")) return say(many(arg));
    if (!strcmp(what, "daemon")) return say(daemonise());
    if (!strcmp(what, "mount")) return say(mount("x", arg, "tmpfs", 0, NULL));
    if (!strcmp(what, "chroot")) return say(chroot(arg));
    if (!strcmp(what, "unshare")) return say(unshare(CLONE_NEWUSER));
    if (!strcmp(what, "traceable")) return say(prctl(PR_SET_DUMPABLE, 1));
    /* As what `exec` above becomes. */
    if (!strcmp(what, "-c")) return say(0);
    if (!strcmp(what, "mknod")) {
        int made = mknod(arg, S_IFCHR | 0600, 0x103);
        if (made == 0) unlink(arg);
        return say(made);
    }
    if (!strcmp(what, "become_root")) return say(setuid(0));
    if (!strcmp(what, "shm")) {
        int id = shmget(IPC_PRIVATE, 4096, 0600 | IPC_CREAT);
        int kept = errno;
        if (id >= 0) shmctl(id, IPC_RMID, NULL);
        errno = kept;
        return say(id);
    }
    if (!strcmp(what, "call")) return say((int)syscall(number, 0, 0, 0, 0, 0, 0));
    if (!strcmp(what, "threads")) return say(threads(number));
    if (!strcmp(what, "descriptors")) return say(descriptors());
    if (!strcmp(what, "inherited")) return say(fcntl(number, F_GETFD));
    if (!strcmp(what, "allocate")) {
        void *memory = mmap(NULL, (size_t)number << 20, PROT_READ | PROT_WRITE,
                            MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
        return say(memory == MAP_FAILED ? -1 : 0);
    }
    if (!strcmp(what, "touch")) {
        size_t size = (size_t)number << 20;
        char *memory = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
        if (memory == MAP_FAILED) return say(-1);
        for (size_t i = 0; i < size; i += 4096) memory[i] = 1;
        return say(0);
    }
    if (!strcmp(what, "jit")) return say(jit());
    if (!strcmp(what, "spin")) for (;;) {}
    if (!strcmp(what, "sleep")) return say((int)sleep(number));
    if (!strcmp(what, "abort")) abort();
    if (!strcmp(what, "segv")) return *(volatile int *)8;
    if (!strcmp(what, "exit")) _exit(number);
    if (!strcmp(what, "pid")) { dprintf(1, "%d\n", getpid()); return 0; }
    if (!strcmp(what, "fork_forever")) {
        /* Bounded, so that a hole hurts nobody. */
        for (int i = 0; i < 200; i++) {
            pid_t child = fork();
            if (child < 0) {
                int kept = errno;
                sleep(number);
                errno = kept;
                return say(-1);
            }
            if (child == 0) { sleep(2 + number); _exit(0); }
        }
        return say(0);
    }
    dprintf(1, "no such attack: %s\n", what);
    return 99;
}

int main(int argc, char **argv) { return attack(argc - 1, argv + 1); }
