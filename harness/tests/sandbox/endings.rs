//! How a child ends, and that nothing is left.

use std::io::Read;
use std::os::fd::{AsFd, AsRawFd, FromRawFd, OwnedFd};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::time::{Duration, Instant};

use nix::poll::{PollFd, PollFlags, PollTimeout, poll};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use umbra::sandbox::{Bind, ChildKind, EXIT_NOT_CONFINED, Layers, payload_pid};

use super::fixture::{Fixture, Who, everyone, open_to_all, piped, survivors, wait};

#[test]
fn endings_are_mirrored() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        for kind in [ChildKind::Worker, ChildKind::Build] {
            let policy = fixture.policy(kind, Layers::full());
            let status = |args: &[&str]| {
                let outcome = fixture.attack(&policy, args);
                assert!(outcome.report.is_ok(), "{outcome:?}");
                outcome.status
            };
            assert_eq!(status(&["exit", "0"]).code(), Some(0));
            assert_eq!(status(&["exit", "3"]).code(), Some(3));
            assert_eq!(status(&["abort"]).signal(), Some(6));
            assert_eq!(status(&["segv"]).signal(), Some(11));
            // The code of a failed confinement is no proof of one.
            let forged = fixture.attack(&policy, &["exit", &EXIT_NOT_CONFINED.to_string()]);
            assert_eq!(forged.status.code(), Some(EXIT_NOT_CONFINED.into()));
            assert!(forged.report.is_ok());
        }
    }
}

#[test]
fn a_daemon_dies_with_its_child_and_lets_go_of_the_pipe() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        for pid_ns in [true, false] {
            // Without the layer (and the limits that end the free one): it must survive here.
            let layers = Layers { pid_ns, ..Layers::full() };
            let policy = fixture.policy(ChildKind::Build, layers);
            let mut child = piped(&mut fixture.command(&policy, &["daemon"]));
            let mut pipe = child.stdout.take().expect("a pipe");
            let status = wait(child);
            assert!(status.success(), "{who:?}, pid_ns {pid_ns}: {status}");
            let (text, closed) = drain(&mut pipe, Duration::from_millis(500));
            assert_eq!(closed, pid_ns, "{who:?}, pid_ns {pid_ns}: {text}");
            let left = survivors(&fixture.path("")).len();
            assert_eq!(left, usize::from(!pid_ns), "{who:?}, pid_ns {pid_ns}");
            if !pid_ns {
                let daemon = text.lines().find_map(|line| line.parse().ok());
                kill(Pid::from_raw(daemon.expect("its id")), Signal::SIGKILL).expect("our daemon");
            }
        }
    }
}

/// Reads until the end or the deadline; whether the end came.
fn drain(pipe: &mut (impl Read + AsFd), limit: Duration) -> (String, bool) {
    let deadline = Instant::now() + limit;
    let mut text = String::new();
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let left = PollTimeout::try_from(left).expect("short");
        let readable = poll(&mut [PollFd::new(pipe.as_fd(), PollFlags::POLLIN)], left);
        if readable.expect("a pipe") == 0 {
            return (text, false);
        }
        let mut bytes = [0; 256];
        match pipe.read(&mut bytes).expect("a pipe") {
            0 => return (text, true),
            n => text.push_str(&String::from_utf8_lossy(&bytes[..n])),
        }
    }
}

#[test]
fn killing_the_launcher_ends_everything() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        for kind in [ChildKind::Worker, ChildKind::Build] {
            let policy = fixture.policy(kind, Layers::full());
            let mut child = piped(&mut fixture.command(&policy, &["sleep", "60"]));
            let payload = until(|| payload_pid(child.id())).expect("a payload");
            assert!(Path::new(&format!("/proc/{payload}")).exists());
            child.kill().expect("our child");
            child.wait().expect("our child");
            assert_eq!(survivors(&fixture.path("")), Vec::<String>::new());
            until(|| (!Path::new(&format!("/proc/{payload}")).exists()).then_some(()))
                .expect("the payload is gone");
        }
    }
}

#[test]
fn a_child_dies_with_the_thread_that_started_it() {
    let fixture = Fixture::new(everyone()[0]);
    let policy = fixture.policy(ChildKind::Build, Layers::full());
    let mut child = std::thread::scope(|scope| {
        let start = || {
            let child = piped(&mut fixture.command(&policy, &["sleep", "60"]));
            until(|| payload_pid(child.id())).expect("a payload");
            child
        };
        scope.spawn(start).join().expect("no panic")
    });
    let status = until(|| child.try_wait().expect("our child")).expect("it is gone");
    assert_eq!(status.signal(), Some(9));
    assert_eq!(survivors(&fixture.path("")), Vec::<String>::new());
}

/// Asks for up to two seconds.
fn until<T>(mut ask: impl FnMut() -> Option<T>) -> Option<T> {
    for _ in 0..1000 {
        if let Some(answer) = ask() {
            return Some(answer);
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    None
}

#[test]
fn inherited_files_are_closed() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let secret = std::fs::File::open(fixture.path("secret")).expect("a file");
        // SAFETY: a new descriptor, at 100 or above, without the flag that closes it on exec.
        let leaked = unsafe {
            let number = nix::libc::fcntl(secret.as_raw_fd(), nix::libc::F_DUPFD, 100);
            OwnedFd::from_raw_fd(number)
        };
        let number = leaked.as_raw_fd().to_string();
        let plain = std::process::Command::new(fixture.path("attack"))
            .args(["inherited", &number])
            .output()
            .expect("the attack");
        assert_eq!(plain.stdout, b"ok\n");
        for kind in [ChildKind::Worker, ChildKind::Build] {
            let policy = fixture.policy(kind, Layers::NONE);
            assert_eq!(fixture.attack(&policy, &["inherited", &number]).verdict(), "EBADF");
        }
    }
}

#[test]
fn results_are_collected_by_process_1() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let host = fixture.path("result");
        let collect = |file_size_mib, script: &str| {
            std::fs::write(&host, "old").expect("a file");
            open_to_all(Path::new(&host), 0o666);
            let mut policy = fixture.policy(ChildKind::Build, Layers::full());
            policy.limits.file_size_mib = file_size_mib;
            // Otherwise no file could be too long.
            policy.layers.rlimits = false;
            policy.collect.push(Bind::new(&host, "/scratch/out/result"));
            let mut command = umbra::sandbox::command(
                Path::new(super::fixture::UMBRA),
                &policy,
                Path::new("/bin/sh"),
                ["-c", script],
            )
            .expect("orders");
            super::fixture::as_user(&mut command, who);
            command.env("PATH", "/usr/bin");
            let status = wait(command.spawn().expect("the binary under test"));
            (status.code(), std::fs::read(&host).expect("a file"))
        };
        let make = "mkdir out; echo new > out/result";
        assert_eq!(collect(1, make), (Some(0), b"new\n".to_vec()), "{who:?}");
        assert_eq!(collect(1, &format!("{make}; exit 1")), (Some(1), Vec::new()));
        assert_eq!(collect(1, "mkdir out; ln -s /etc/ld.so.cache out/result").1, b"");
        assert_eq!(collect(1, "mkdir out; mkdir out/result").1, b"");
        assert_eq!(collect(1, "mkdir d; echo x > d/result; ln -s d out").1, b"");
        assert_eq!(collect(1, "true").1, b"");
        assert_eq!(collect(1, "mkdir out; truncate -s 2M out/result").1, b"");
        assert_eq!(collect(2, "mkdir out; truncate -s 2M out/result").1.len(), 2 << 20);
    }
}

#[test]
fn what_cannot_be_had_is_an_error() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let full = fixture.policy(ChildKind::Build, Layers::full());
        let mut broken = vec![];
        let mut policy = full.clone();
        policy.read_only.push(Bind::new(fixture.path("nowhere"), "/src"));
        broken.push(("mount_ns", policy));
        let mut policy = full.clone();
        policy.read_only.push(Bind::new(fixture.path("secret"), "/src/../secret"));
        broken.push(("mount_ns", policy));
        let mut policy = full.clone();
        policy.read_only.push(Bind::new(fixture.path("private"), "/src"));
        if who == Who::Root || nix::unistd::geteuid().is_root() {
            broken.push(("launcher", policy));
        }
        if who == Who::User {
            let mut policy = full.clone();
            policy.layers.user_ns = false;
            broken.push(("pid_ns", policy));
        }
        for (layer, policy) in broken {
            let outcome = fixture.attack(&policy, &["write", "/scratch/mine"]);
            assert_eq!(outcome.status.code(), Some(EXIT_NOT_CONFINED.into()), "{outcome:?}");
            assert_eq!(outcome.word, "", "nothing ran");
            let error = outcome.report.expect_err("it was not confined");
            assert_eq!(error.layer, layer, "{error}");
            assert_eq!(outcome.stderr.trim_end(), format!("umbra: {error}"));
        }
    }
}
