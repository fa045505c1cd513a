//! What it takes to start a worker that loads nothing, beside a plain process.

use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use umbra::process::ProcessLimits;
use umbra::worker::{Job, Request, SceneRef, Supervisor};

use super::Bench;
use super::figures::{Line, Samples};

/// Start to exit of a worker that refuses its one question, and of `true`.
///
/// # Errors
/// When a worker or `true` cannot be started.
pub fn run(bench: &Bench) -> anyhow::Result<Vec<Line>> {
    let scratch = tempfile::tempdir()?;
    let supervisor = Supervisor::new(bench.umbra.clone(), scratch.path().to_owned());
    let (mut ours, mut theirs) = (Samples::default(), Samples::default());
    for _ in 0..20 * bench.rounds {
        let begin = Instant::now();
        let scene = SceneRef { path: "none.toml".into(), options: String::new() };
        let requests = vec![Request::EvalBsdf { scene, queries: Vec::new() }];
        let (job, never) = (Job { plugin: None, requests }, AtomicBool::new(false));
        let report = supervisor.run_job(&job, &ProcessLimits::default(), &never, &mut |_| ());
        anyhow::ensure!(report.runs.len() == 1, "no worker ran: {report:?}");
        ours.push(begin.elapsed().as_secs_f64());
        let begin = Instant::now();
        Command::new("true").status()?;
        theirs.push(begin.elapsed().as_secs_f64());
    }
    let work = "worker start, confined, no plugin".to_owned();
    Ok(vec![Line::of_times(work, "plain start of `true`", &theirs, &ours)])
}
