//! All layers together: nothing gets through, and what is useful does.

use nix::libc;
use umbra::sandbox::{ChildKind, Isolation, Layers};

use super::fixture::{Fixture, Who, everyone};

#[test]
fn nothing_gets_through() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        for kind in [ChildKind::Worker, ChildKind::Build] {
            let policy = fixture.policy(kind, Layers::full());
            let in_force = fixture.attack(&policy, &["pid"]).report.expect("full isolation");
            assert_eq!(in_force.isolation, Isolation::Full);
            assert_eq!(in_force.started_as_root, who == Who::Root);
            assert_ne!(in_force.host_uid, 0);
            for (args, errno) in attacks(&fixture, kind) {
                let args: Vec<&str> = args.iter().map(String::as_str).collect();
                let outcome = fixture.attack(&policy, &args);
                assert_eq!(outcome.verdict(), errno, "{who:?} {kind:?} {args:?}: {outcome:?}");
            }
        }
    }
}

fn attacks(fixture: &Fixture, kind: ChildKind) -> Vec<(Vec<String>, &'static str)> {
    let victim = fixture.victim.id().to_string();
    let port = fixture.tcp.local_addr().expect("bound").port().to_string();
    let umbra = std::process::id().to_string();
    let executes = kind.may_execute();
    let path = |name: &str| fixture.path(name);
    let mut all: Vec<(Vec<String>, &str)> = Vec::new();
    let mut add = |args: &[&str], errno| {
        all.push((args.iter().map(ToString::to_string).collect(), errno));
    };
    for file in ["secret", "private", "expected/reference.exr"] {
        add(&["read", &path(file)], "ENOENT");
    }
    for file in ["/etc/shadow", "/etc/passwd"] {
        add(&["read", file], "ENOENT");
    }
    // A compiler has a /proc, but of its links only.
    let hidden = if executes { "EACCES" } else { "ENOENT" };
    for file in ["environ", "mountinfo", "maps", "task/2/mountinfo"] {
        for process in ["self", "1", "2"] {
            let there = process != "1" || !file.starts_with("task");
            add(
                &["read", &format!("/proc/{process}/{file}")],
                if there { hidden } else { "ENOENT" },
            );
        }
    }
    add(&["list", "/proc"], hidden);
    for folder in ["/root", "/home", "/tmp", "/work", "/sys/kernel"] {
        add(&["list", folder], "ENOENT");
    }
    for folder in ["/", "/dev", "/scratch/.."] {
        add(&["list", folder], "EACCES");
    }
    for file in ["/new", "/dev/new", "/plugin/attack.so/../new"] {
        add(&["write", file], if file.contains("..") { "ENOTDIR" } else { "EROFS" });
    }
    add(&["change", "/plugin/attack.so"], "EROFS");
    add(&["chmod", "/plugin/attack.so"], "EROFS");
    add(&["exec", "/bin/bash"], if executes { "ok" } else { "EPERM" });
    add(&["exec", "/plugin/attack"], if executes { "ok" } else { "EPERM" });
    add(&["fork"], if executes { "ok" } else { "EPERM" });
    add(&["clone3"], "ENOSYS");
    add(&["tcp", &port], "EPERM");
    add(&["udp", &port], "EPERM");
    add(&["unix", &path("socket")], "EPERM");
    add(&["abstract", &fixture.abstract_name], "EPERM");
    for pid in [&*victim, &*umbra, "1", "-1", "0"] {
        add(&["reach", pid], "EPERM");
        add(&["ptrace", pid], "EPERM");
    }
    // Signal 0 above hurts nobody even through a hole.
    add(&["kill", &victim], "EPERM");
    add(&["memory", "1", "0x1000"], "EPERM");
    add(&["raise_limit"], "EPERM");
    add(&["lower_limit"], "EPERM");
    add(&["traceable"], "ENOSYS");
    add(&["mount", "/scratch"], "EPERM");
    add(&["chroot", "/scratch"], "EPERM");
    add(&["unshare"], "EPERM");
    add(&["mknod", "/scratch/device"], "EPERM");
    add(&["become_root"], "EPERM");
    add(&["shm"], "EPERM");
    add(&["fill", "/scratch"], "ENOSPC");
    add(&["many", "/scratch"], "ENOSPC");
    for call in [
        libc::SYS_bpf,
        libc::SYS_perf_event_open,
        libc::SYS_keyctl,
        libc::SYS_add_key,
        libc::SYS_userfaultfd,
        libc::SYS_io_uring_setup,
        libc::SYS_personality,
        libc::SYS_setns,
        libc::SYS_pivot_root,
        libc::SYS_umount2,
        libc::SYS_process_vm_writev,
        libc::SYS_pidfd_getfd,
        libc::SYS_open_by_handle_at,
        libc::SYS_seccomp,
        libc::SYS_reboot,
    ] {
        add(&["call", &call.to_string()], "EPERM");
    }
    // Not known to this filter, as a call of a future kernel; and one of the other ABI.
    for call in [libc::SYS_memfd_create, 1_000, 0x4000_0000 + libc::SYS_getpid] {
        add(&["call", &call.to_string()], "ENOSYS");
    }
    // What is useful.
    add(&["write", "/scratch/mine"], "ok");
    add(&["read", "/dev/urandom"], "ok");
    add(&["read", "/plugin/attack.so"], "ok");
    add(&["list", "/usr/lib"], "ok");
    add(&["change", "/dev/null"], "ok");
    add(&["threads", "1"], "ok");
    add(&["jit"], "ok");
    all
}
