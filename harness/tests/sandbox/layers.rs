//! Each layer by itself stops what is its to stop.

use std::path::Path;

use umbra::sandbox::{Bind, ChildKind, Layers};

use super::fixture::{Fixture, Who, everyone, open_to_all};

/// Only this layer, with what it needs to work at all.
fn only(name: &str, who: Who) -> Layers {
    let mut layers = Layers::NONE;
    *layers.switch(name).expect("a layer of this name") = true;
    layers.user_ns |= who == Who::User && name.ends_with("_ns");
    layers
}

type Attacks = Vec<(Vec<String>, &'static str)>;

fn words(words: &[&str]) -> Vec<String> {
    words.iter().map(ToString::to_string).collect()
}

/// Runs attacks with only one layer, expecting an errno, and without any, expecting success.
fn expect(
    layer: &str,
    who: Who,
    kind: ChildKind,
    attacks: &[(Vec<String>, &str)],
    fixture: &Fixture,
) {
    for (args, errno) in attacks {
        let args = &args.iter().map(String::as_str).collect::<Vec<_>>()[..];
        let free = fixture.attack(&fixture.policy(kind, Layers::NONE), args);
        assert_eq!(free.verdict(), "ok", "{who:?}, no layer, {args:?}: {free:?}");
        let confined = fixture.attack(&fixture.policy(kind, only(layer, who)), args);
        assert_eq!(confined.verdict(), *errno, "{who:?}, {layer}, {args:?}: {confined:?}");
        let in_force = confined.report.as_ref().expect("a report");
        assert_eq!(in_force.layers, only(layer, who));
    }
}

#[test]
fn mount_namespace_hides_files() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let environ = format!("/proc/{}/environ", fixture.victim.id());
        let mut attacks: Attacks = Vec::new();
        let (secret, expected) = (fixture.path("secret"), fixture.path("expected"));
        let (new, socket) = (fixture.path("new"), fixture.path("socket"));
        let all: [[&str; 2]; 6] = [
            ["read", &secret],
            ["list", &expected],
            ["change", &secret],
            ["write", &new],
            ["unix", &socket],
            ["read", &environ],
        ];
        attacks.extend(all.iter().map(|args| (words(args), "ENOENT")));
        if who == Who::Root {
            attacks.push((words(&["read", "/etc/shadow"]), "ENOENT"));
            attacks.push((words(&["list", "/root"]), "ENOENT"));
        }
        expect("mount_ns", who, ChildKind::Worker, &attacks, &fixture);
        // Writable outside, read-only inside; and a root that is nobody's to change.
        open_to_all(Path::new(&fixture.path("jail")), 0o777);
        let mut policy = fixture.policy(ChildKind::Worker, only("mount_ns", who));
        policy.read_only.push(Bind::new(fixture.path("jail"), "/src"));
        for place in ["/new", "/src/new", "/plugin/new"] {
            assert_eq!(fixture.attack(&policy, &["write", place]).verdict(), "EROFS", "{place}");
        }
        let free = fixture.policy(ChildKind::Worker, Layers::NONE);
        assert_eq!(fixture.attack(&free, &["write", &fixture.path("jail/new")]).verdict(), "ok");
    }
}

#[test]
fn process_namespace_hides_processes() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let victim = fixture.victim.id().to_string();
        let address = address_of(&victim);
        let mut attacks: Attacks =
            vec![(words(&["reach", "-1"]), "ESRCH"), (words(&["reach", &victim]), "ESRCH")];
        let memory = ["memory", &*victim, &*address];
        if who == Who::Root {
            attacks.push((words(&memory), "ESRCH"));
        }
        expect("pid_ns", who, ChildKind::Worker, &attacks, &fixture);
    }
}

#[test]
fn network_namespace_reaches_nobody() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let tcp = fixture.tcp.local_addr().expect("bound").port().to_string();
        let udp = fixture.udp.local_addr().expect("bound").port().to_string();
        let attacks: Attacks = vec![
            (words(&["tcp", &tcp]), "ENETUNREACH"),
            (words(&["udp", &udp]), "ENETUNREACH"),
            (words(&["abstract", &fixture.abstract_name]), "ECONNREFUSED"),
        ];
        expect("net_ns", who, ChildKind::Worker, &attacks, &fixture);
    }
}

#[test]
fn root_becomes_nobody() {
    if everyone().contains(&Who::Root) {
        let fixture = Fixture::new(Who::Root);
        let victim = fixture.victim.id().to_string();
        let (private, jail, node) =
            (fixture.path("private"), fixture.path("jail"), fixture.path("node"));
        let attacks: Attacks = vec![
            (words(&["read", &private]), "EACCES"),
            (words(&["read", "/etc/shadow"]), "EACCES"),
            (words(&["list", "/root"]), "EACCES"),
            (words(&["reach", &victim]), "EPERM"),
            (words(&["become_root"]), "EPERM"),
            (words(&["chroot", &jail]), "EPERM"),
            (words(&["mknod", &node]), "EPERM"),
        ];
        expect("drop_privileges", Who::Root, ChildKind::Worker, &attacks, &fixture);
        // With a mount namespace there is something to mount over, and nobody else notices.
        let mut layers = only("mount_ns", Who::Root);
        let mounts = ["mount", "/plugin"];
        assert_eq!(
            fixture.attack(&fixture.policy(ChildKind::Worker, layers), &mounts).verdict(),
            "ok"
        );
        layers.drop_privileges = true;
        assert_eq!(
            fixture.attack(&fixture.policy(ChildKind::Worker, layers), &mounts).verdict(),
            "EPERM"
        );
    }
}

#[test]
fn landlock_guards_files_ports_and_signals() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let tcp = fixture.tcp.local_addr().expect("bound").port().to_string();
        let victim = fixture.victim.id().to_string();
        let environ = format!("/proc/{victim}/environ");
        let (secret, expected) = (fixture.path("secret"), fixture.path("expected"));
        let (new, program) = (fixture.path("new"), fixture.path("attack"));
        let version = fixture
            .attack(&fixture.policy(ChildKind::Worker, only("landlock", who)), &["pid"])
            .report
            .expect("landlock")
            .landlock_abi;
        let mut attacks: Attacks = vec![
            (words(&["read", &secret]), "EACCES"),
            (words(&["read", &environ]), "EACCES"),
            (words(&["list", &expected]), "EACCES"),
            (words(&["change", &secret]), "EACCES"),
            (words(&["write", &new]), "EACCES"),
            (words(&["exec", "/bin/sh"]), "EACCES"),
            // One that it may read.
            (words(&["exec", &program]), "EACCES"),
            (words(&["ptrace", &victim]), "EPERM"),
        ];
        if version >= 4 {
            attacks.push((words(&["tcp", &tcp]), "EACCES"));
        }
        if version >= 6 {
            attacks.push((words(&["abstract", &fixture.abstract_name]), "EPERM"));
            attacks.push((words(&["reach", &victim]), "EPERM"));
        }
        expect("landlock", who, ChildKind::Worker, &attacks, &fixture);
    }
}

#[test]
fn filter_refuses_calls() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let tcp = fixture.tcp.local_addr().expect("bound").port().to_string();
        let udp = fixture.udp.local_addr().expect("bound").port().to_string();
        let victim = fixture.victim.id().to_string();
        let socket = fixture.path("socket");
        let network: Attacks = vec![
            (words(&["tcp", &tcp]), "EPERM"),
            (words(&["udp", &udp]), "EPERM"),
            (words(&["unix", &socket]), "EPERM"),
            (words(&["abstract", &fixture.abstract_name]), "EPERM"),
        ];
        let personality = nix::libc::SYS_personality.to_string();
        let common: Attacks = vec![
            (words(&["clone3"]), "ENOSYS"),
            (words(&["ptrace", &victim]), "EPERM"),
            (words(&["reach", &victim]), "EPERM"),
            (words(&["reach", "-1"]), "EPERM"),
            (words(&["lower_limit"]), "EPERM"),
            (words(&["traceable"]), "ENOSYS"),
            (words(&["unshare"]), "EPERM"),
            (words(&["shm"]), "EPERM"),
            (words(&["call", &personality]), "EPERM"),
        ];
        let worker: Attacks =
            vec![(words(&["exec", "/bin/sh"]), "EPERM"), (words(&["fork"]), "EPERM")];
        for kind in [ChildKind::Worker, ChildKind::Build] {
            expect("seccomp", who, kind, &network, &fixture);
            expect("seccomp", who, kind, &common, &fixture);
        }
        for kind in [ChildKind::Worker, ChildKind::Decode] {
            expect("seccomp", who, kind, &worker, &fixture);
        }
    }
}

/// Some readable address of a process.
fn address_of(pid: &str) -> String {
    let maps = std::fs::read_to_string(format!("/proc/{pid}/maps")).expect("a live process");
    format!("0x{}", maps.split('-').next().expect("an address"))
}
