//! What isolation costs, start to exit: medians of a plain start, of a locked one, and of a whole
//! worker under supervision (its files, its table, its end), taken in turn so that the machine's
//! mood touches all. `cargo run --release --example sandbox_overhead`.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use umbra::process::Limits;
use umbra::sandbox::{Bind, Kind, Policy, command, doctor};
use umbra::worker::{Fault, Job, Outcome, Request, SceneRef, Supervisor};

const RUNS: usize = 200;

fn main() -> anyhow::Result<()> {
    let own = std::env::current_exe()?;
    let umbra = own.ancestors().nth(2).unwrap_or(Path::new(".")).join("umbra");
    let examination = doctor::examine(&umbra);
    for finding in &examination.findings {
        let mark = if finding.available { "yes" } else { "no " };
        println!("{mark} {:16} {} {}", finding.layer, finding.detail, finding.remedy);
    }
    println!("isolation: {:?}", examination.isolation);

    let mut kinds: Vec<(String, Option<Policy>)> = vec![("plain".to_owned(), None)];
    for off in ["", "user_ns", "pid_ns", "net_ns", "landlock", "seccomp"] {
        let mut policy = Policy::new(Kind::Build);
        policy.read_only.push(Bind::new(&umbra, "/umbra"));
        // As root each of them can be left out; otherwise all namespaces hang on the first.
        match policy.layers.switch(off) {
            Some(_) if off == "user_ns" && !nix::unistd::geteuid().is_root() => continue,
            Some(switch) => *switch = false,
            None => {}
        }
        let name = if off.is_empty() { "full".to_owned() } else { format!("full without {off}") };
        kinds.push((name, Some(policy)));
    }
    let mut times = vec![Vec::new(); kinds.len()];
    let scratch = tempfile::tempdir()?;
    let supervisor = Supervisor::new(umbra.clone(), scratch.path().to_owned());
    let mut supervised = Vec::new();
    for _ in 0..RUNS {
        for ((_, policy), times) in kinds.iter().zip(&mut times) {
            times.push(time(&umbra, policy.as_ref())?);
        }
        supervised.push(worker(&supervisor)?);
    }
    let plain = median(&mut times[0]);
    kinds.push(("a supervised worker".to_owned(), None));
    times.push(supervised);
    for ((name, _), times) in kinds.iter().zip(&mut times) {
        let median = median(times);
        let added = median.as_secs_f64() - plain.as_secs_f64();
        println!(
            "{name:28} median {:6.2} ms, added {:6.2} ms, ratio {:.2}",
            median.as_secs_f64() * 1e3,
            added * 1e3,
            median.as_secs_f64() / plain.as_secs_f64()
        );
    }
    Ok(())
}

fn time(umbra: &PathBuf, policy: Option<&Policy>) -> anyhow::Result<Duration> {
    let begin = Instant::now();
    let status = match policy {
        None => {
            std::process::Command::new(umbra).arg(doctor::PROBE_COMMAND).env_clear().status()?
        }
        Some(policy) => {
            let program = policy.seen(umbra);
            command(umbra, policy, &program, [doctor::PROBE_COMMAND])?.status()?
        }
    };
    anyhow::ensure!(status.success(), "the child ended with {status}");
    Ok(begin.elapsed())
}

/// One worker that has nothing to load and refuses its one question: what is left is supervision.
fn worker(supervisor: &Supervisor) -> anyhow::Result<Duration> {
    let scene = SceneRef { path: "none.toml".into(), options: String::new() };
    let requests = vec![Request::EvalBsdf { scene, queries: Vec::new() }];
    let begin = Instant::now();
    let (job, never) = (Job { plugin: None, requests }, AtomicBool::new(false));
    let report = supervisor.run_job(&job, &Limits::default(), &never, &mut |_| ());
    let time = begin.elapsed();
    let began = matches!(&report.outcomes[..], [Outcome::NotRun { fault: Fault::Internal, .. }]);
    anyhow::ensure!(began && report.runs.len() == 1, "no worker ran: {report:?}");
    Ok(time)
}

fn median(times: &mut [Duration]) -> Duration {
    times.sort();
    times[times.len() / 2]
}
