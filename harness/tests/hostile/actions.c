/* What a hostile plugin does, by name; see c_plugin/fault.c. Each action says in its message how far it
 * came. Everything is bounded, so that a hole in the sandbox hurts nobody, and aims at nothing but
 * what the test made. */
#include "umbra_renderer.h"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <fenv.h>
#include <link.h>
#include <locale.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/auxv.h>
#include <sys/mman.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

/* Bytes of a file that a thief takes, from its middle. */
#define LOOT 32
/* The worker's table of records, as harness/src/worker/table.rs has it. */
#define RECORD 4096
#define ANSWERED 2u
#define STATUS_OURS -2

static const char *name_of(int error)
{
    return error ? strerrorname_np(error) : "no error";
}

/* Ends an action with what there is to say. */
__attribute__((format(printf, 2, 3))) static UmbraStatus say(UmbraMessage *message,
                                                             const char *format, ...)
{
    va_list values;
    va_start(values, format);
    message->length = (size_t)vsnprintf((char *)message->data, message->capacity, format, values);
    va_end(values);
    return UMBRA_STATUS_ERROR;
}

static UmbraStatus tell(long result, UmbraMessage *message)
{
    return say(message, "%ld, %s", result, name_of(errno));
}

static UmbraStatus fork_bomb(UmbraMessage *message)
{
    int made = 0, error = 0;
    for (int i = 0; i < 200; i++) {
        pid_t child = fork();
        if (child == 0) {
            sleep(2);
            _exit(0);
        }
        made += child > 0;
        error = child < 0 ? errno : error;
    }
    return say(message, "%d of 200 processes, %s", made, name_of(error));
}

static void *rest(void *unused)
{
    sleep(2);
    return unused;
}

static UmbraStatus thread_bomb(UmbraMessage *message)
{
    pthread_attr_t attributes;
    pthread_t thread;
    int made = 0, error = 0;
    pthread_attr_init(&attributes);
    pthread_attr_setstacksize(&attributes, 1 << 16);
    while (made < 2000 && (error = pthread_create(&thread, &attributes, rest, NULL)) == 0)
        made++;
    return say(message, "%s threads, %s", made < 400 ? "fewer than 400" : "many", name_of(error));
}

static UmbraStatus memory_bomb(void)
{
    /* Two GiB at most. */
    for (int i = 0; i < 128; i++) {
        char *more = malloc(16 << 20);
        if (more == NULL)
            abort();
        memset(more, 1, 16 << 20);
    }
    return UMBRA_STATUS_OK;
}

static UmbraStatus many_files(UmbraMessage *message)
{
    char path[64];
    int made = 0, fd = 0;
    for (; made < 20000 && fd >= 0; made += fd >= 0) {
        snprintf(path, sizeof path, "many%d", made);
        fd = open(path, O_WRONLY | O_CREAT, 0600);
        if (fd >= 0)
            close(fd);
    }
    return say(message, "%s files, %s", made < 20000 ? "fewer than 20000" : "20000",
               fd < 0 ? name_of(errno) : "no error");
}

static UmbraStatus full_disk(UmbraMessage *message)
{
    static char block[1 << 20];
    char path[64];
    int mib = 0;
    for (int file = 0; file < 8; file++) {
        snprintf(path, sizeof path, "full%d", file);
        int fd = open(path, O_WRONLY | O_CREAT, 0600);
        for (int i = 0; fd >= 0 && i < 16; i++, mib++)
            if (write(fd, block, sizeof block) != sizeof block)
                return say(message, "%s, %s", mib < 65 ? "at most 64 MiB" : "more", name_of(errno));
        close(fd);
    }
    return say(message, "%d MiB and no error", mib);
}

static UmbraStatus one_large_file(UmbraMessage *message)
{
    int fd = open("large", O_WRONLY | O_CREAT, 0600);
    int grown = fd >= 0 && ftruncate(fd, (off_t)1 << 30) == 0;
    return say(message, "%s", grown ? "a gigabyte, no error" : name_of(errno));
}

static UmbraStatus flood(int fd)
{
    static char block[1 << 16];
    memset(block, '!', sizeof block);
    /* 64 MiB at most. */
    for (int i = 0; i < 1024; i++)
        if (write(fd, block, sizeof block) < 0)
            break;
    return UMBRA_STATUS_OK;
}

/* Waits to be talked to, in every way. */
static UmbraStatus serve(const char *token, UmbraMessage *message)
{
    struct sockaddr_in at = {.sin_family = AF_INET};
    struct sockaddr_un by = {.sun_family = AF_UNIX};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int open = 0, last = 0;
    for (int kind = 0; kind < 4; kind++) {
        socklen_t length = sizeof at;
        struct sockaddr *address = (struct sockaddr *)&at;
        int fd = socket(kind < 2 ? AF_INET : AF_UNIX, kind == 1 ? SOCK_DGRAM : SOCK_STREAM, 0);
        if (kind >= 2) {
            address = (struct sockaddr *)&by;
            snprintf(by.sun_path, sizeof by.sun_path, "%s%s", kind == 3 ? "@" : "", token);
            if (kind == 3)
                by.sun_path[0] = 0;
            length = offsetof(struct sockaddr_un, sun_path) + (kind == 3) + strlen(token);
        }
        if (fd >= 0 && bind(fd, address, length) == 0 && (kind == 1 || listen(fd, 1) == 0))
            open++;
        else
            last = errno;
    }
    return say(message, "%d of 4 sockets, %s", open, name_of(last));
}

/* Carries out what it can read of the named files: by standard output, pixels and message. */
static UmbraStatus steal(char *paths, float *values, size_t count, UmbraMessage *message)
{
    int stolen = 0, error = 0, at = 0;
    char text[2048] = "", *path;
    while ((path = strsep(&paths, " ")) != NULL) {
        unsigned char loot[LOOT];
        struct stat stat;
        int fd = open(path, O_RDONLY);
        if (fd < 0 || fstat(fd, &stat) != 0) {
            error = errno;
            continue;
        }
        /* Files of /proc have no size. */
        ssize_t length = pread(fd, loot, sizeof loot, stat.st_size / 2);
        close(fd);
        if (length <= 0) {
            error = errno;
            continue;
        }
        memcpy((char *)values + stolen * LOOT % (count * sizeof *values - LOOT), loot, length);
        stolen++;
        for (ssize_t i = 0; i < length && at < (int)sizeof text - 2; i++)
            at += sprintf(text + at, "%02x", loot[i]);
    }
    printf("%s\n", text);
    fflush(stdout);
    return stolen ? say(message, "%d stolen: %s", stolen, text) : say(message, "0 stolen, %s", name_of(error));
}

static UmbraStatus deface(char *paths, UmbraMessage *message)
{
    int written = 0, error = 0;
    char *path;
    while ((path = strsep(&paths, " ")) != NULL) {
        int fd = open(path, O_WRONLY | O_CREAT | O_APPEND, 0600);
        if (fd >= 0 && write(fd, "defaced", 7) == 7)
            written++;
        else
            error = errno;
        if (fd >= 0)
            close(fd);
    }
    return say(message, "%d written, %s", written, name_of(error));
}

extern const UmbraPlugin umbra_renderer_plugin;

static UmbraStatus load_libraries(char *paths, UmbraMessage *message)
{
    int loaded = 0;
    char *path;
    while ((path = strsep(&paths, " ")) != NULL)
        loaded += dlopen(path, RTLD_NOW) != NULL;
    const void *table = dlsym(RTLD_DEFAULT, "umbra_renderer_plugin");
    loaded += table != NULL && table != &umbra_renderer_plugin;
    return say(message, "%d loaded", loaded);
}

static int look(struct dl_phdr_info *object, size_t size, void *wanted)
{
    (void)size;
    const char *text = wanted;
    for (int i = 0; i < object->dlpi_phnum; i++) {
        const ElfW(Phdr) *part = &object->dlpi_phdr[i];
        if (part->p_type == PT_LOAD && part->p_flags & PF_R &&
            memmem((char *)object->dlpi_addr + part->p_vaddr, part->p_memsz, text, strlen(text)))
            return 1;
    }
    return 0;
}

/* How many of the texts, a line each, this program holds. It looks where programs and libraries lie; the
 * plugin itself, whose orders hold the texts, is left out. */
static int look_for_lines(char *lines)
{
    int found = 0;
    for (char *line = strtok(lines, "|"); line; line = strtok(NULL, "|"))
        found += dl_iterate_phdr(look, line) == 1;
    return found;
}

/* What a program is told of where it lies. */
static UmbraStatus own_names(UmbraMessage *message)
{
    const char *file = (const char *)getauxval(AT_EXECFN);
    return say(message, "file %s, called %s", file ? file : "", program_invocation_name);
}

/* Locks files that others may use: the program's own, a library, its orders. */
static UmbraStatus lock_files(UmbraMessage *message)
{
    const char *files[] = {"/job/job.json", "/scene/0/s.toml", "/plugin/fault.so", "/etc/ld.so.cache"};
    int locked = 0;
    for (int i = 0; i < 4; i++) {
        int file = open(files[i], O_RDONLY);
        struct flock whole = {.l_type = F_RDLCK, .l_whence = SEEK_SET};
        locked += file >= 0 && (flock(file, LOCK_EX | LOCK_NB) == 0 ||
                                fcntl(file, F_SETLK, &whole) == 0 ||
                                fcntl(file, F_OFD_SETLK, &whole) == 0);
    }
    return say(message, "%d locked, %s", locked, strerrorname_np(errno));
}

/* Pretends that every request was answered well, with ones everywhere. */
static UmbraStatus forge_answers(void)
{
    static char record[RECORD];
    memcpy(record, &(unsigned){ANSWERED}, 4);
    struct stat stat;
    int table = open("/job/table", O_RDWR), output = open("/job/output", O_RDWR);
    if (table < 0 || output < 0 || fstat(table, &stat) != 0)
        abort();
    for (off_t at = 0; at < stat.st_size; at += RECORD)
        if (pwrite(table, record, RECORD, at) != RECORD)
            abort();
    if (fstat(output, &stat) != 0)
        abort();
    float *all = mmap(NULL, stat.st_size, PROT_READ | PROT_WRITE, MAP_SHARED, output, 0);
    for (off_t i = 0; i < stat.st_size / 4; i++)
        if (all[i] == all[i])
            all[i] = 1;
    _exit(0);
}

/* Writes one 32-bit word of a record, 0 its state, 1 its status, and ends unless `code` is -1. */
static UmbraStatus forge_word(off_t record, off_t word, int value, int code)
{
    int table = open("/job/table", O_RDWR);
    if (table < 0 || pwrite(table, &value, 4, record * RECORD + word * 4) != 4)
        abort();
    if (code >= 0)
        _exit(code);
    return UMBRA_STATUS_OK;
}

/* Says in Umbra's name that the request at hand met a bug of Umbra's. */
static UmbraStatus forge_bug(void)
{
    int table = open("/job/table", O_RDWR);
    unsigned state = 0;
    for (off_t record = 0; pread(table, &state, 4, record * RECORD) == 4; record++)
        if (state != ANSWERED) {
            forge_word(record, 1, STATUS_OURS, -1);
            forge_word(record, 0, ANSWERED, 0);
        }
    abort();
}

struct region {
    float *values;
    size_t count;
};

static void *scribble(void *region)
{
    struct region to = *(struct region *)region;
    for (;;)
        for (size_t i = 0; i < to.count; i++)
            ((volatile float *)to.values)[i] = 1e9f;
    return NULL;
}

static UmbraStatus leave_a_writer(float *values, size_t count)
{
    static struct region region;
    pthread_t thread;
    region = (struct region){values, count};
    if (pthread_create(&thread, NULL, scribble, &region) != 0)
        abort();
    return UMBRA_STATUS_OK;
}

static UmbraStatus change_limits(UmbraMessage *message)
{
    struct rlimit all = {RLIM_INFINITY, RLIM_INFINITY}, none = {0, 0};
    int kinds[] = {RLIMIT_AS, RLIMIT_CPU, RLIMIT_FSIZE, RLIMIT_NPROC, RLIMIT_NOFILE}, changed = 0;
    for (int i = 0; i < 5; i++)
        changed += setrlimit(kinds[i], &all) == 0;
    int error = errno;
    changed += prlimit(getppid(), RLIMIT_NOFILE, &none, NULL) == 0;
    return say(message, "%d changed, %s", changed, name_of(error));
}

/* Deaf to every signal, then busy for ever. */
static UmbraStatus deafen(void)
{
    for (int number = 1; number < 65; number++)
        signal(number, SIG_IGN);
    for (volatile int i = 0;; i++)
        ;
    return UMBRA_STATUS_OK;
}

/* What a terminal, a browser, a spreadsheet or an XML parser would act on. */
static UmbraStatus inject(UmbraMessage *message)
{
    static const char *words =
        "=HYPERLINK(\"http://x\",\"y\")\n\033]0;owned\a\033[2J\033[31m<script>alert(1)</script>"
        "<img src=x onerror=alert(1)>\xe2\x80\xae\xe2\x81\xa6gpj.exe\n@SUM(A1)\r+1-800\t,;\"'"
        "]]>&amp;\x01\x0b\xef\xbf\xbe\xff\xfe</td></tr>";
    for (int fd = 1; fd <= 2; fd++)
        if (write(fd, words, strlen(words)) < 0)
            abort();
    return say(message, "%s", words);
}

void remember(const char *where, const UmbraText *text)
{
    setenv("KEPT", "1", 1);
    const char *places[] = {"kept", "/tmp/kept", "/dev/shm/kept", "/scratch/kept", where};
    for (int i = 0; i < 5; i++) {
        int fd = open(places[i], O_WRONLY | O_CREAT, 0600);
        if (fd >= 0 && write(fd, text->data, text->length) >= 0)
            close(fd);
    }
}

int recall(const char *where, UmbraMessage *message)
{
    const char *places[] = {"kept", "/tmp/kept", "/dev/shm/kept", "/scratch/kept", where};
    for (int i = 0; i < 5; i++)
        if (access(places[i], F_OK) == 0)
            return (void)say(message, "kept in %s", places[i]), 1;
    return getenv("KEPT") != NULL && ((void)say(message, "kept in the environment"), 1);
}

int action(const char *what, float *values, size_t count, UmbraMessage *message,
         UmbraStatus *status)
{
    char copy[4096], *words = copy;
    snprintf(copy, sizeof copy, "%s", what);
    const char *name = strsep(&words, " ");
#define DEED(called, does) if (strcmp(name, called) == 0) return *status = (does), 1;
    DEED("fork_bomb", fork_bomb(message))
    DEED("thread_bomb", thread_bomb(message))
    DEED("memory_bomb", memory_bomb())
    DEED("many_files", many_files(message))
    DEED("full_disk", full_disk(message))
    DEED("one_large_file", one_large_file(message))
    DEED("flood_stdout", flood(1))
    DEED("flood_stderr", flood(2))
    DEED("exit75", (_exit(75), 0))
    DEED("serve", serve(words, message))
    DEED("steal", steal(words, values, count, message))
    DEED("deface", deface(words, message))
    DEED("load", load_libraries(words, message))
    DEED("look_for", say(message, "%d found", dl_iterate_phdr(look, words)))
    DEED("look_for_lines", say(message, "%d found", look_for_lines(words)))
    DEED("own_names", own_names(message))
    DEED("lock_files", lock_files(message))
    DEED("kill_parent", tell(kill(getppid(), SIGKILL), message))
    DEED("trace", tell(ptrace(PTRACE_ATTACH, getppid(), 0, 0), message))
    DEED("limits", change_limits(message))
    DEED("close_all", (closefrom(0), UMBRA_STATUS_OK))
    DEED("forge_answers", forge_answers())
    DEED("forge_no_start", forge_word(0, 0, 0, 0))
    DEED("forge_not_confined", forge_word(0, 0, 0, 71))
    DEED("forge_bug", forge_bug())
    DEED("lost_device", (say(message, "the graphics device was lost"), UMBRA_STATUS_NO_ADAPTER))
    DEED("lost_in_words", say(message, "the graphics device \"llvmpipe\" was lost: device lost"))
    DEED("late_writer", leave_a_writer(values, count))
    DEED("deafen", deafen())
    DEED("inject", inject(message))
    DEED("locale", (setenv("LC_ALL", "tr_TR.UTF-8", 1), setlocale(LC_ALL, ""), UMBRA_STATUS_OK))
    DEED("rounding", (fesetround(FE_UPWARD), UMBRA_STATUS_OK))
    DEED("folder", chdir("/") == 0 ? UMBRA_STATUS_OK : UMBRA_STATUS_ERROR)
    if (strcmp(name, "nan") == 0 || strcmp(name, "infinite") == 0 || strcmp(name, "flat") == 0) {
        for (size_t i = 0; i < count; i++)
            values[i] = name[0] == 'n' ? NAN : name[0] == 'f' ? 0.5f : INFINITY;
        return *status = UMBRA_STATUS_OK, 1;
    }
    return 0;
}
