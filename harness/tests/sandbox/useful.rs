//! What a grader needs works inside: the compiler, its linker, and the library that they made.

use std::path::Path;
use std::process::{Command, Output, Stdio};

use umbra::sandbox::policy::{PLUGIN, SRC, TOOLCHAIN};
use umbra::sandbox::{Bind, ChildKind, Isolation, Layers, Policy, command, doctor};

use super::fixture::{Fixture, UMBRA, Who, as_user, everyone, open_to_all};

fn sysroot() -> String {
    let output = Command::new("rustc").args(["--print", "sysroot"]).output().expect("rustc");
    String::from_utf8(output.stdout).expect("a path").trim().to_owned()
}

/// Compiles a library in a confined child, as root: its toolchain may lie in a home of mode 0700.
fn compile(fixture: &Fixture, source: &str) -> (Output, Vec<u8>) {
    let at = |name: &str| fixture.path(name);
    std::fs::create_dir_all(at("src")).expect("a folder");
    std::fs::write(at("src/lib.rs"), source).expect("a file");
    std::fs::write(at("lib.so"), "").expect("a file");
    let mut policy = fixture.policy(ChildKind::Build, Layers::full());
    policy.read_only.push(Bind::new(sysroot(), TOOLCHAIN));
    policy.read_only.push(Bind::new(at("src"), SRC));
    policy.collect.push(Bind::new(at("lib.so"), "/scratch/lib.so"));
    policy.scratch.quota_mib = 64;
    let output = confined(
        fixture,
        &policy,
        "/toolchain/bin/rustc",
        &[
            "--edition=2024",
            "--crate-type=cdylib",
            "--crate-name=student",
            "-Copt-level=3",
            "-o/scratch/lib.so",
            "/src/lib.rs",
        ],
    );
    (output, std::fs::read(at("lib.so")).expect("a file"))
}

fn confined(fixture: &Fixture, policy: &Policy, program: &str, args: &[&str]) -> Output {
    let mut command = command(Path::new(UMBRA), policy, Path::new(program), args).expect("orders");
    as_user(&mut command, fixture.who);
    command.env("PATH", "/usr/bin:/bin").env("TMPDIR", "/scratch").env("HOME", "/scratch");
    command.stdout(Stdio::piped()).stderr(Stdio::piped()).output().expect("the binary under test")
}

/// The user who runs the tests: another could not reach the toolchain.
fn owner() -> Who {
    everyone()[0]
}

#[test]
fn rustc_compiles_what_a_worker_then_loads() {
    let fixture = Fixture::new(owner());
    let source = r#"
        #[unsafe(no_mangle)]
        pub extern "C" fn attack(_: i32, _: *const *const std::ffi::c_char) -> i32 {
            let threads: Vec<_> = (0..4).map(|i| std::thread::spawn(move || i * 7)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).sum()
        }"#;
    let (output, library) = compile(&fixture, source);
    assert!(output.status.success(), "{output:?}");
    assert!(library.starts_with(b"\x7fELF"));
    std::fs::write(fixture.path("attack.so"), library).expect("a file");
    let policy = fixture.policy(ChildKind::Worker, Layers::full());
    let outcome = fixture.attack(&policy, &["any"]);
    assert_eq!(outcome.status.code(), Some(42), "{outcome:?}");
}

#[test]
fn rustc_cannot_include_what_is_not_there() {
    let fixture = Fixture::new(owner());
    let secret = fixture.path("secret");
    for path in [&*secret, "/etc/passwd", "/etc/shadow", "/proc/self/environ"] {
        let text = format!("pub static S: &[u8] = include_bytes!({path:?});");
        let (output, library) = compile(&fixture, &text);
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(library.is_empty());
        let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(stderr.contains("couldn't read"), "{stderr}");
        let assembly = format!(".incbin \"{path}\"");
        let text = format!("core::arch::global_asm!({assembly:?});");
        let (output, library) = compile(&fixture, &text);
        assert!(!output.status.success() && library.is_empty(), "{output:?}");
    }
    // The same source compiles where the file is to be seen.
    let text = "pub static S: &[u8] = include_bytes!(\"lib.rs\");";
    assert!(compile(&fixture, text).0.status.success());
}

#[test]
fn the_linker_works_for_everyone() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        std::fs::create_dir(fixture.path("src")).expect("a folder");
        std::fs::write(fixture.path("src/a.c"), "int two(void) { return 2; }").expect("a file");
        let mut policy = fixture.policy(ChildKind::Build, Layers::full());
        policy.read_only.push(Bind::new(fixture.path("src"), SRC));
        std::fs::write(fixture.path("lib.so"), "").expect("a file");
        open_to_all(Path::new(&fixture.path("lib.so")), 0o666);
        policy.collect.push(Bind::new(fixture.path("lib.so"), "/scratch/lib.so"));
        let args = ["-shared", "-fPIC", "-o", "/scratch/lib.so", "/src/a.c"];
        let output = confined(&fixture, &policy, "/usr/bin/cc", &args);
        assert!(output.status.success(), "{who:?}: {output:?}");
        assert!(std::fs::read(fixture.path("lib.so")).expect("a file").starts_with(b"\x7fELF"));
    }
}

#[test]
fn without_namespaces_there_is_reduced_isolation() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let (source, result) = (fixture.path("a.s"), fixture.path("scratch/lib.so"));
        std::fs::write(&source, ".globl two\ntwo: ret\n").expect("a file");
        let layers = Layers {
            drop_privileges: true,
            landlock: true,
            seccomp: true,
            rlimits: true,
            ..Layers::NONE
        };
        let mut policy = fixture.policy(ChildKind::Build, layers);
        // Counted with every process of the same user.
        policy.limits.tasks = 1000;
        policy.read_only.push(Bind::new(&source, "/src/a.s"));
        let args = |source| ["-shared", "-fPIC", "-o", &*result, source].map(str::to_owned);
        let cc = |args: [String; 5]| {
            let mut command =
                command(Path::new(UMBRA), &policy, Path::new("/usr/bin/cc"), args).expect("orders");
            as_user(&mut command, who);
            command.env("PATH", "/usr/bin:/bin").env("TMPDIR", policy.scratch_path());
            command.output().expect("the binary under test")
        };
        let output = cc(args(&source));
        assert!(output.status.success(), "{who:?}: {output:?}");
        assert!(std::fs::read(&result).expect("a file").starts_with(b"\x7fELF"));
        assert!(!cc(args(&fixture.path("secret"))).status.success());
        let missing = ["user_ns", "mount_ns", "pid_ns", "net_ns"].map(str::to_owned).to_vec();
        for (attack, errno) in [("read", "EACCES"), ("change", "EACCES")] {
            let outcome = fixture.attack(&policy, &[attack, &fixture.path("secret")]);
            assert_eq!(outcome.verdict(), errno, "{outcome:?}");
            let isolation = outcome.report.expect("a report").isolation;
            assert_eq!(isolation, Isolation::Reduced { missing: missing.clone() });
        }
    }
}

#[test]
fn a_given_file_is_changed_in_place() {
    for who in everyone() {
        let fixture = Fixture::new(who);
        let table = fixture.path("secret");
        let mut policy = fixture.policy(ChildKind::Worker, Layers::full());
        let inside = format!("{PLUGIN}/table");
        assert_eq!(fixture.attack(&policy, &["change", &inside]).verdict(), "ENOENT");
        if who == Who::User {
            // What a user gives away is the user's own.
            std::fs::remove_file(&table).expect("a file");
            let mut make = Command::new("touch");
            as_user(&mut make, who);
            assert!(make.arg(&table).status().expect("`touch`").success());
        } else {
            open_to_all(Path::new(&table), 0o600);
        }
        policy.read_write.push(Bind::new(&table, &inside));
        let outcome = fixture.attack(&policy, &["change", &inside]);
        assert_eq!(outcome.verdict(), "ok", "{who:?}: {outcome:?}");
    }
}

#[test]
fn the_doctor_finds_what_there_is() {
    let examination = doctor::examine(Path::new(UMBRA));
    let names: Vec<_> = examination.findings.iter().map(|finding| &*finding.layer).collect();
    assert_eq!(names, Layers::NONE.named().map(|(name, _)| name));
    for finding in &examination.findings {
        assert_eq!(finding.available, finding.remedy.is_empty(), "{finding:?}");
    }
    // The tests of this file need full isolation anyway.
    assert_eq!(examination.isolation, Isolation::Full);
    assert_eq!(doctor::available(Path::new(UMBRA)), examination.usable());
    // A binary that is not Umbra proves nothing.
    let liar = Path::new("/bin/true");
    assert_eq!(doctor::examine(liar).isolation, Isolation::None);
    assert_eq!(doctor::available(liar), Layers::NONE);
}
