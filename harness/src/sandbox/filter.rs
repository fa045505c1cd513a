//! The system call filter.
//!
//! It lists the allowed calls. Every other call answers ENOSYS, "this kernel has no such call": libraries then fall
//! back, and a call that a future kernel adds is closed from the start (a list of denied calls would let it in). A
//! second list answers EPERM to calls that programs expect to exist; it changes the error code, not what is allowed.
//! The kernel answers plain entries from a bitmap, so that the length of the list costs nothing per call.

use std::collections::BTreeMap;

use nix::libc;
use seccompiler::{
    BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
    SeccompRule, apply_filter,
};

use super::{ChildKind, Policy, SandboxError};

type Rules = BTreeMap<i64, Vec<SeccompRule>>;

/// Installs the filter on this thread and all that it starts. Needs `no_new_privs`.
///
/// # Errors
/// When a filter does not compile, or the kernel refuses it.
pub fn install(policy: &Policy) -> Result<(), SandboxError> {
    let error = |step: &str, cause: &dyn ToString| {
        SandboxError::new("seccomp", step.to_owned(), cause.to_string())
    };
    let own_pid = std::process::id().into();
    let absent = SeccompAction::Errno(libc::ENOSYS as u32);
    let refused = SeccompAction::Errno(libc::EPERM as u32);
    let compile = |rules: Rules, otherwise, matched| -> Result<BpfProgram, String> {
        let target = std::env::consts::ARCH.try_into().map_err(text)?;
        let filter = SeccompFilter::new(rules, otherwise, matched, target).map_err(text)?;
        filter.try_into().map_err(text)
    };
    let allowed = allowed(policy.kind, policy.gpu.is_some(), own_pid)
        .and_then(|rules| compile(rules, absent, SeccompAction::Allow));
    let refused = refusals(policy.kind, own_pid)
        .and_then(|rules| compile(rules, SeccompAction::Allow, refused));
    let allowed = allowed.map_err(|cause| error("compile the list of calls", &cause))?;
    let refused = refused.map_err(|cause| error("compile the list of refusals", &cause))?;
    // Of two filters that both refuse, the answer of the later one counts.
    for program in [allowed, refused] {
        apply_filter(&program).map_err(|cause| error("install a filter", &cause))?;
    }
    Ok(())
}

fn text(error: impl ToString) -> String {
    error.to_string()
}

/// Argument `index`, its lower 32 bits: the kernel reads no more of what is compared here.
fn argument(index: u8, op: SeccompCmpOp, value: u64) -> Result<SeccompCondition, String> {
    SeccompCondition::new(index, SeccompCmpArgLen::Dword, op, value).map_err(text)
}

fn rule(conditions: Vec<SeccompCondition>) -> Result<SeccompRule, String> {
    SeccompRule::new(conditions).map_err(text)
}

/// One rule for each value that an argument may have.
fn one_of(index: u8, values: &[u64]) -> Result<Vec<SeccompRule>, String> {
    values.iter().map(|&value| rule(vec![argument(index, SeccompCmpOp::Eq, value)?])).collect()
}

fn allowed(kind: ChildKind, gpu: bool, own_pid: u64) -> Result<Rules, String> {
    use SeccompCmpOp::{Eq, MaskedEq};
    let mut rules: Rules = PLAIN.iter().chain(LEGACY).map(|&call| (call, Vec::new())).collect();
    let thread = libc::CLONE_THREAD as u64;
    // Reading a limit; setting one is refused.
    let no_new_limit = SeccompCondition::new(2, SeccompCmpArgLen::Qword, Eq, 0).map_err(text)?;
    rules.insert(libc::SYS_prlimit64, vec![rule(vec![no_new_limit])?]);
    rules.insert(libc::SYS_prctl, one_of(0, PRCTL)?);
    rules.insert(libc::SYS_fcntl, one_of(1, FCNTL)?);
    rules.insert(libc::SYS_ioctl, if gpu { Vec::new() } else { one_of(1, IOCTL)? });
    if kind.may_execute() {
        rules.insert(libc::SYS_flock, Vec::new());
        rules.insert(libc::SYS_fcntl, one_of(1, &[FCNTL, LOCKS].concat())?);
        rules.extend(PROCESSES.iter().map(|&call| (call, Vec::new())));
        rules.insert(libc::SYS_clone, vec![rule(vec![argument(0, MaskedEq(NAMESPACES), 0)?])?]);
        // The standard library's `Command` hears of a failed exec through a pair of sockets.
        rules.extend(PAIR.iter().map(|&call| (call, Vec::new())));
        rules.insert(libc::SYS_socketpair, one_of(0, &[libc::AF_UNIX as u64])?);
        // `abort`; the process namespace keeps it inside.
        rules.insert(libc::SYS_tgkill, Vec::new());
    } else {
        rules.insert(libc::SYS_clone, vec![rule(vec![argument(0, MaskedEq(thread), thread)?])?]);
        rules.insert(libc::SYS_kill, one_of(0, &[own_pid])?);
        rules.insert(libc::SYS_tgkill, one_of(0, &[own_pid])?);
    }
    Ok(rules)
}

fn refusals(kind: ChildKind, own_pid: u64) -> Result<Rules, String> {
    use SeccompCmpOp::{MaskedEq, Ne};
    let mut rules: Rules =
        REFUSED.iter().chain(REFUSED_LEGACY).map(|&call| (call, Vec::new())).collect();
    let new_limit = SeccompCondition::new(2, SeccompCmpArgLen::Qword, Ne, 0).map_err(text)?;
    rules.insert(libc::SYS_prlimit64, vec![rule(vec![new_limit])?]);
    if kind.may_execute() {
        let other = argument(0, Ne, libc::AF_UNIX as u64)?;
        rules.insert(libc::SYS_socketpair, vec![rule(vec![other])?]);
        rules.insert(libc::SYS_kill, Vec::new());
    } else {
        rules.insert(libc::SYS_flock, Vec::new());
        rules.insert(libc::SYS_fcntl, one_of(1, LOCKS)?);
        let processes = PROCESSES.iter().chain(PAIR).chain(&[libc::SYS_socketpair]);
        rules.extend(processes.map(|&call| (call, Vec::new())));
        let no_thread = argument(0, MaskedEq(libc::CLONE_THREAD as u64), 0)?;
        rules.insert(libc::SYS_clone, vec![rule(vec![no_thread])?]);
        for call in [libc::SYS_kill, libc::SYS_tgkill] {
            rules.insert(call, vec![rule(vec![argument(0, Ne, own_pid)?])?]);
        }
    }
    Ok(rules)
}

/// The flags of `clone` that make namespaces.
const NAMESPACES: u64 = (libc::CLONE_NEWNS
    | libc::CLONE_NEWCGROUP
    | libc::CLONE_NEWUTS
    | libc::CLONE_NEWIPC
    | libc::CLONE_NEWUSER
    | libc::CLONE_NEWPID
    | libc::CLONE_NEWNET) as u64;

/// Names for threads and mappings, as allocators and drivers give them; `no_new_privs`, which is
/// set already, for the second filter.
const PRCTL: &[u64] = &[
    libc::PR_SET_NAME as u64,
    libc::PR_GET_NAME as u64,
    libc::PR_SET_VMA as u64,
    libc::PR_SET_NO_NEW_PRIVS as u64,
];

/// Flags, copies and sizes; not the ones that send signals.
const FCNTL: &[u64] = &[
    libc::F_DUPFD as u64,
    libc::F_DUPFD_CLOEXEC as u64,
    libc::F_GETFD as u64,
    libc::F_SETFD as u64,
    libc::F_GETFL as u64,
    libc::F_SETFL as u64,
    libc::F_GETPIPE_SZ as u64,
];

/// Locks of files: a compiler's alone. Others share files with whoever runs beside them, and could stop
/// them there, or talk to them.
const LOCKS: &[u64] = &[
    libc::F_GETLK as u64,
    libc::F_SETLK as u64,
    libc::F_SETLKW as u64,
    libc::F_OFD_GETLK as u64,
    libc::F_OFD_SETLK as u64,
    libc::F_OFD_SETLKW as u64,
];

/// Whether it is a terminal, how much there is to read, flags; nothing that types.
const IOCTL: &[u64] =
    &[libc::TCGETS, libc::TIOCGWINSZ, libc::FIONREAD, libc::FIONBIO, libc::FIOCLEX, libc::FIONCLEX];

/// Allowed whatever the arguments.
const PLAIN: &[i64] = &[
    // Files, by descriptor and by path: sight is the mount namespace's and Landlock's matter.
    libc::SYS_read,
    libc::SYS_write,
    libc::SYS_readv,
    libc::SYS_writev,
    libc::SYS_pread64,
    libc::SYS_pwrite64,
    libc::SYS_preadv,
    libc::SYS_pwritev,
    libc::SYS_preadv2,
    libc::SYS_pwritev2,
    libc::SYS_lseek,
    libc::SYS_openat,
    libc::SYS_openat2,
    libc::SYS_close,
    libc::SYS_close_range,
    libc::SYS_fstat,
    libc::SYS_newfstatat,
    libc::SYS_statx,
    libc::SYS_statfs,
    libc::SYS_fstatfs,
    libc::SYS_faccessat,
    libc::SYS_faccessat2,
    libc::SYS_readlinkat,
    libc::SYS_getdents64,
    libc::SYS_getcwd,
    libc::SYS_chdir,
    libc::SYS_fchdir,
    libc::SYS_dup,
    libc::SYS_dup3,
    libc::SYS_pipe2,
    libc::SYS_fsync,
    libc::SYS_fdatasync,
    libc::SYS_truncate,
    libc::SYS_ftruncate,
    libc::SYS_fallocate,
    libc::SYS_fadvise64,
    libc::SYS_readahead,
    libc::SYS_copy_file_range,
    libc::SYS_sendfile,
    libc::SYS_mkdirat,
    libc::SYS_unlinkat,
    libc::SYS_renameat,
    libc::SYS_renameat2,
    libc::SYS_linkat,
    libc::SYS_symlinkat,
    libc::SYS_fchmod,
    libc::SYS_fchmodat,
    libc::SYS_fchmodat2,
    libc::SYS_utimensat,
    libc::SYS_umask,
    // Memory. Writable code is lavapipe's just-in-time compiler.
    libc::SYS_mmap,
    libc::SYS_munmap,
    libc::SYS_mremap,
    libc::SYS_mprotect,
    libc::SYS_madvise,
    libc::SYS_brk,
    libc::SYS_msync,
    libc::SYS_mincore,
    libc::SYS_mlock,
    libc::SYS_mlock2,
    libc::SYS_munlock,
    libc::SYS_membarrier,
    // Threads and time.
    libc::SYS_futex,
    libc::SYS_futex_waitv,
    libc::SYS_set_robust_list,
    libc::SYS_get_robust_list,
    libc::SYS_rseq,
    libc::SYS_set_tid_address,
    libc::SYS_gettid,
    libc::SYS_exit,
    libc::SYS_exit_group,
    libc::SYS_sched_yield,
    libc::SYS_sched_getaffinity,
    libc::SYS_sched_setaffinity,
    libc::SYS_sched_getparam,
    libc::SYS_sched_getscheduler,
    libc::SYS_sched_setscheduler,
    libc::SYS_sched_get_priority_max,
    libc::SYS_sched_get_priority_min,
    libc::SYS_getpriority,
    libc::SYS_getcpu,
    libc::SYS_clock_gettime,
    libc::SYS_clock_getres,
    libc::SYS_clock_nanosleep,
    libc::SYS_nanosleep,
    libc::SYS_gettimeofday,
    libc::SYS_times,
    libc::SYS_getitimer,
    libc::SYS_setitimer,
    libc::SYS_timerfd_create,
    libc::SYS_timerfd_settime,
    libc::SYS_timerfd_gettime,
    // Its own signals.
    libc::SYS_rt_sigaction,
    libc::SYS_rt_sigprocmask,
    libc::SYS_rt_sigreturn,
    libc::SYS_rt_sigpending,
    libc::SYS_rt_sigtimedwait,
    libc::SYS_rt_sigsuspend,
    libc::SYS_sigaltstack,
    libc::SYS_restart_syscall,
    libc::SYS_signalfd4,
    // Waiting.
    libc::SYS_ppoll,
    libc::SYS_pselect6,
    libc::SYS_epoll_create1,
    libc::SYS_epoll_ctl,
    libc::SYS_epoll_pwait,
    libc::SYS_eventfd2,
    // Who and where it is.
    libc::SYS_getpid,
    libc::SYS_getppid,
    libc::SYS_getuid,
    libc::SYS_geteuid,
    libc::SYS_getgid,
    libc::SYS_getegid,
    libc::SYS_getresuid,
    libc::SYS_getresgid,
    libc::SYS_getgroups,
    libc::SYS_getpgid,
    libc::SYS_getsid,
    libc::SYS_getrusage,
    libc::SYS_capget,
    libc::SYS_uname,
    libc::SYS_sysinfo,
    libc::SYS_getrandom,
    // For the second filter, which refuses it.
    libc::SYS_seccomp,
];

/// Old calls that newer architectures do without.
#[cfg(target_arch = "x86_64")]
const LEGACY: &[i64] = &[
    libc::SYS_open,
    libc::SYS_creat,
    libc::SYS_stat,
    libc::SYS_lstat,
    libc::SYS_access,
    libc::SYS_readlink,
    libc::SYS_dup2,
    libc::SYS_pipe,
    libc::SYS_mkdir,
    libc::SYS_rmdir,
    libc::SYS_unlink,
    libc::SYS_rename,
    libc::SYS_link,
    libc::SYS_symlink,
    libc::SYS_chmod,
    libc::SYS_utime,
    libc::SYS_utimes,
    libc::SYS_poll,
    libc::SYS_select,
    libc::SYS_epoll_create,
    libc::SYS_epoll_wait,
    libc::SYS_eventfd,
    libc::SYS_alarm,
    libc::SYS_pause,
    libc::SYS_time,
    libc::SYS_arch_prctl,
    libc::SYS_getrlimit,
    libc::SYS_getpgrp,
];
#[cfg(not(target_arch = "x86_64"))]
const LEGACY: &[i64] = &[];

/// New processes and programs: a compiler's, refused to others.
#[cfg(target_arch = "x86_64")]
const PROCESSES: &[i64] = &[
    libc::SYS_execve,
    libc::SYS_fork,
    libc::SYS_vfork,
    libc::SYS_wait4,
    libc::SYS_waitid,
    libc::SYS_setsid,
    libc::SYS_setpgid,
];
#[cfg(not(target_arch = "x86_64"))]
const PROCESSES: &[i64] =
    &[libc::SYS_execve, libc::SYS_wait4, libc::SYS_waitid, libc::SYS_setsid, libc::SYS_setpgid];

/// What is done with the one kind of socket that a compiler may have.
const PAIR: &[i64] = &[libc::SYS_recvfrom, libc::SYS_recvmsg, libc::SYS_sendto, libc::SYS_sendmsg];

/// Not allowed to anyone, and answered EPERM rather than ENOSYS. `clone3` and `memfd_create` are
/// left to ENOSYS: libraries then fall back on what is filtered and counted.
const REFUSED: &[i64] = &[
    libc::SYS_socket,
    libc::SYS_connect,
    libc::SYS_bind,
    libc::SYS_listen,
    libc::SYS_accept,
    libc::SYS_accept4,
    libc::SYS_sendmmsg,
    libc::SYS_recvmmsg,
    libc::SYS_setsockopt,
    libc::SYS_execveat,
    libc::SYS_ptrace,
    libc::SYS_process_vm_readv,
    libc::SYS_process_vm_writev,
    libc::SYS_process_madvise,
    libc::SYS_kcmp,
    libc::SYS_pidfd_getfd,
    libc::SYS_pidfd_send_signal,
    libc::SYS_tkill,
    libc::SYS_rt_sigqueueinfo,
    libc::SYS_rt_tgsigqueueinfo,
    libc::SYS_mount,
    libc::SYS_umount2,
    libc::SYS_pivot_root,
    libc::SYS_chroot,
    libc::SYS_fsopen,
    libc::SYS_fsmount,
    libc::SYS_open_tree,
    libc::SYS_move_mount,
    libc::SYS_mount_setattr,
    libc::SYS_unshare,
    libc::SYS_setns,
    libc::SYS_add_key,
    libc::SYS_request_key,
    libc::SYS_keyctl,
    libc::SYS_bpf,
    libc::SYS_perf_event_open,
    libc::SYS_userfaultfd,
    libc::SYS_io_uring_setup,
    libc::SYS_io_uring_enter,
    libc::SYS_io_uring_register,
    libc::SYS_personality,
    libc::SYS_setrlimit,
    libc::SYS_setpriority,
    libc::SYS_setuid,
    libc::SYS_setgid,
    libc::SYS_setreuid,
    libc::SYS_setregid,
    libc::SYS_setresuid,
    libc::SYS_setresgid,
    libc::SYS_setgroups,
    libc::SYS_capset,
    libc::SYS_mknodat,
    libc::SYS_fchown,
    libc::SYS_fchownat,
    libc::SYS_name_to_handle_at,
    libc::SYS_open_by_handle_at,
    libc::SYS_sethostname,
    libc::SYS_setdomainname,
    libc::SYS_seccomp,
    libc::SYS_shmget,
    libc::SYS_shmat,
    libc::SYS_semget,
    libc::SYS_msgget,
    libc::SYS_mq_open,
    libc::SYS_reboot,
    libc::SYS_swapon,
    libc::SYS_clock_settime,
    libc::SYS_settimeofday,
    libc::SYS_adjtimex,
    libc::SYS_init_module,
    libc::SYS_finit_module,
    libc::SYS_delete_module,
    libc::SYS_kexec_load,
    libc::SYS_syslog,
    libc::SYS_acct,
    libc::SYS_quotactl,
];
#[cfg(target_arch = "x86_64")]
const REFUSED_LEGACY: &[i64] =
    &[libc::SYS_mknod, libc::SYS_chown, libc::SYS_lchown, libc::SYS_ioperm, libc::SYS_iopl];
#[cfg(not(target_arch = "x86_64"))]
const REFUSED_LEGACY: &[i64] = &[];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_both_allowed_and_refused_but_the_filter_itself() {
        for kind in [ChildKind::Worker, ChildKind::Build, ChildKind::Decode] {
            let allowed = allowed(kind, false, 2).expect("rules");
            let refused = refusals(kind, 2).expect("rules");
            let plain = |rules: &Rules, call: &i64| rules.get(call).is_some_and(Vec::is_empty);
            let both: Vec<_> = allowed.keys().filter(|call| plain(&refused, call)).collect();
            assert_eq!(both, [&libc::SYS_seccomp], "{kind:?}");
        }
    }
}
