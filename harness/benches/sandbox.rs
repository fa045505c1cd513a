//! What isolation costs, start to exit: a plain start, one confined by all layers and by all but one, and a whole
//! worker under supervision. `cargo bench --workspace --bench sandbox`, after a build.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;

use divan::Bencher;
use umbra::process::ProcessLimits;
use umbra::sandbox::{Bind, ChildKind, Policy, command, doctor};
use umbra::worker::{Fault, Job, Outcome, Request, SceneRef, Supervisor};

fn main() {
    divan::main();
}

fn umbra() -> PathBuf {
    Path::new(env!("CARGO_BIN_EXE_umbra")).to_owned()
}

#[divan::bench]
fn plain_start() {
    let status = Command::new(umbra()).arg(doctor::PROBE_COMMAND).env_clear().status();
    assert!(status.expect("umbra starts").success());
}

/// As root each layer can be left out; otherwise all namespaces hang on the first.
#[divan::bench(args = ["nothing", "pid_ns", "net_ns", "landlock", "seccomp"])]
fn locked_by_all_but(bencher: Bencher, layer: &str) {
    let umbra = umbra();
    let mut policy = Policy::new(ChildKind::Build);
    policy.read_only.push(Bind::new(&umbra, "/umbra"));
    if let Some(switch) = policy.layers.switch(layer) {
        *switch = false;
    }
    let program = policy.seen(&umbra);
    bencher.bench(|| {
        let started = command(&umbra, &policy, &program, [doctor::PROBE_COMMAND]);
        let status = started.and_then(|mut confined| confined.status());
        assert!(status.expect("umbra starts").success());
    });
}

/// One that has nothing to load and refuses its one question: what is left is supervision.
#[divan::bench]
fn supervised_worker(bencher: Bencher) {
    let scratch = tempfile::tempdir().expect("a temporary folder");
    let supervisor = Supervisor::new(umbra(), scratch.path().to_owned());
    bencher.bench(|| {
        let scene = SceneRef { path: "none.toml".into(), options: String::new() };
        let requests = vec![Request::EvalBsdf { scene, queries: Vec::new() }];
        let (job, never) = (Job { plugin: None, requests }, AtomicBool::new(false));
        let report = supervisor.run_job(&job, &ProcessLimits::default(), &never, &mut |_| ());
        let refused =
            matches!(&report.outcomes[..], [Outcome::NotRun { fault: Fault::Internal, .. }]);
        assert!(refused && report.runs.len() == 1, "no worker ran: {report:?}");
    });
}
