//! Limits: of each process, of the scratch, of all together.

use std::path::Path;

use umbra::sandbox::{ChildKind, KernelLimits, Layers};

use super::fixture::{Fixture, Who, everyone, piped};

fn small() -> KernelLimits {
    KernelLimits { cpu_s: 1, memory_mib: 1024, file_size_mib: 1, open_files: 64, tasks: 16 }
}

#[test]
fn each_limit_of_a_process_holds() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let scratch = fixture.path("scratch");
        // As root the count of processes needs another user, in a namespace of its own.
        let mut layers = Layers { rlimits: true, drop_privileges: true, ..Layers::NONE };
        layers.user_ns = true;
        let attacks: [(&[&str], &str); 5] = [
            (&["allocate", "2000"], "ENOMEM"),
            (&["threads", "100"], "EAGAIN"),
            (&["descriptors"], "EMFILE"),
            (&["fill", &scratch], "SIGXFSZ"),
            (&["spin"], "SIGXCPU"),
        ];
        for (args, verdict) in attacks {
            let mut policy = fixture.policy(ChildKind::Worker, layers);
            policy.limits = small();
            let outcome = fixture.attack(&policy, args);
            assert_eq!(outcome.verdict(), verdict, "{who:?} {args:?}: {outcome:?}");
            if !matches!(args[0], "spin" | "descriptors") {
                policy.layers = Layers::NONE;
                let outcome = fixture.attack(&policy, args);
                assert_eq!(outcome.verdict(), "ok", "{who:?} {args:?}, free: {outcome:?}");
            }
        }
    }
}

#[test]
fn processes_are_counted_per_child() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let mut policy = fixture.policy(ChildKind::Build, Layers::full());
        policy.limits.tasks = 16;
        // One at its limit does not keep another from starting.
        let mut hog = fixture.command(&policy, &["fork_forever", "10"]);
        let mut hog = hog.stdout(std::process::Stdio::null()).spawn().expect("the binary");
        std::thread::sleep(std::time::Duration::from_millis(100));
        assert_eq!(fixture.attack_beside(&policy, &["fork"]).verdict(), "ok", "{who:?}");
        hog.kill().expect("our child");
        hog.wait().expect("our child");
        assert_eq!(fixture.attack(&policy, &["fork_forever"]).verdict(), "EAGAIN");
    }
}

#[test]
fn the_scratch_has_a_quota() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let layers = Layers { mount_ns: true, user_ns: who == Who::User, ..Layers::NONE };
        for attack in ["fill", "many"] {
            let mut policy = fixture.policy(ChildKind::Worker, layers);
            assert_eq!(fixture.attack(&policy, &[attack, "/scratch"]).verdict(), "ENOSPC");
            // To the kernel, 0 would mean without limit.
            match attack {
                "fill" => policy.scratch.quota_mib = 0,
                _ => policy.scratch.files = 0,
            }
            assert_eq!(fixture.attack(&policy, &[attack, "/scratch"]).verdict(), "ENOSPC");
            policy.scratch.quota_mib = 32;
            policy.scratch.files = 30_000;
            assert_eq!(fixture.attack(&policy, &[attack, "/scratch"]).verdict(), "ok");
        }
    }
}

#[test]
fn a_control_group_counts_all_together() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let mut policy = fixture.policy(ChildKind::Build, Layers { cgroup: true, ..Layers::NONE });
        policy.limits = KernelLimits { memory_mib: 64, ..small() };
        let outcome = fixture.attack(&policy, &["touch", "200"]);
        if let Err(error) = &outcome.report {
            // Optional: not every machine has it. Then it says so, and nothing ran.
            assert_eq!((&*error.layer, &*outcome.word), ("cgroup", ""), "{outcome:?}");
            println!("no control groups here: {error}");
            continue;
        }
        assert_eq!(outcome.verdict(), "SIGKILL", "{outcome:?}");
        assert_eq!(fixture.attack(&policy, &["touch", "20"]).verdict(), "ok");
        policy.layers.pid_ns = true;
        assert_eq!(fixture.attack(&policy, &["fork_forever"]).verdict(), "EAGAIN");
        let full = Layers { cgroup: true, ..Layers::full() };
        let mut child =
            piped(&mut fixture.command(&fixture.policy(ChildKind::Build, full), &["fork"]));
        assert!(child.wait().expect("our child").success());
        for controller in ["", "memory", "pids"] {
            let group = format!("/sys/fs/cgroup/{controller}/umbra-{}", child.id());
            assert!(!Path::new(&group).exists(), "{group} is left");
        }
        policy.layers.cgroup = false;
        assert_eq!(fixture.attack(&policy, &["touch", "200"]).verdict(), "ok");
    }
}
