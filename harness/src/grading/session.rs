//! Runs requests on a submission's plugin, and handles those that get no answer.

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use basecode::{Image, Ray};
use renderer_api as api;

use crate::diagnosis::{Observations, Thumbnail, View};
use crate::evidence::{Check, CheckId, Verdict};
use crate::process::ProcessLimits;
use crate::worker::{
    Adapter, BsdfQuery, BsdfSource, Fault, Job, JobReport, Outcome, RayQuery, RetryBudget,
    SceneRef, Supervisor,
};

/// The check that fails when a submission used up its time on a path: the rest was not asked.
pub const BUDGET: CheckId = CheckId::SubmissionBudget;
/// The check that fails, and costs nothing, when a renderer prints more than is kept.
const OUTPUT: CheckId = CheckId::SubmissionOutput;

/// The error of a question that was not asked any more: it leaves no point that could be seen.
const NOT_ASKED: f64 = 0.9999;

/// Where frames of Umbra's own pass are kept, and what draws them.
pub struct KeptFrames {
    pub(super) folder: PathBuf,
    /// The program.
    pub(super) worker: PathBuf,
    /// Adapter and driver, in their own words.
    pub(super) drawn_with: String,
}

/// What it takes to run one submission.
pub struct Session<'a> {
    /// Starts workers.
    pub supervisor: Supervisor,
    /// What each may use.
    pub limits: ProcessLimits,
    /// Ctrl-C.
    pub cancel: &'a AtomicBool,
    /// What realtime is drawn with, or why nothing can be.
    pub adapter: Result<Adapter, String>,
    /// What scenes are loaded with: empty for every submission; the reference knows some.
    pub options: String,
    /// CPU seconds of all workers so far.
    pub cpu_s: Mutex<f64>,
    /// The most that one worker printed so far, in bytes.
    pub printed: Mutex<u64>,
    /// What is left of it for this path.
    pub retries: RetryBudget<'a>,
    /// The reference renderer's library, absent in a student's kit: what it can draw, the machine
    /// is not to blame for.
    pub reference: Option<&'a Path>,
    /// Whether a scene was drawn otherwise after another than alone.
    pub scenes_interfere: AtomicBool,
    /// Where frames of Umbra's own pass are kept, if anywhere.
    pub kept_frames: Option<&'a KeptFrames>,
    /// What was answered, for the diagnosis.
    pub observations: Mutex<Observations>,
    /// What compilers said in several lines, each text once: to be shown line by line.
    pub compiler_messages: Mutex<Vec<String>>,
}

impl Session<'_> {
    /// Runs a job, with retries while any are left.
    pub fn run_job(&self, job: &Job) -> Vec<Outcome> {
        let JobReport { outcomes, runs, .. } = self.supervisor.run_job_with_retries(
            job,
            &self.limits,
            &self.retries,
            self.cancel,
            &mut |_| (),
        );
        if let Ok(mut cpu_s) = self.cpu_s.lock() {
            *cpu_s += runs.iter().map(|run| run.ended.cpu_s).sum::<f64>();
        }
        if let Ok(mut printed) = self.printed.lock() {
            *printed = runs.iter().map(|run| run.ended.printed()).fold(*printed, u64::max);
        }
        outcomes
    }

    /// The check that fails if the submission used up its time on this path.
    pub fn used_up(&self) -> Option<Check> {
        let used = self.retries.used_up()?;
        let said = format!("the submission used {used}; what was not asked earns nothing");
        let hint = "an instructor grades it fully with --only STUDENT --budget none";
        Some(Check::new(BUDGET, "", Verdict::Fail, said).with_hint(hint))
    }

    /// The check that fails, at no cost, if the renderer printed more than is kept.
    pub fn printed_much(&self) -> Option<Check> {
        let printed = self.printed.lock().map_or(0, |printed| *printed);
        (printed > self.limits.output_kib << 10).then(|| {
            let mib = printed as f64 / f64::from(1 << 20);
            let said = format!("the renderer printed {mib:.1} MiB in one go; most of it was cut");
            let hint = "it costs no points, only time: print less before you submit it";
            Check { error: 0.0, ..Check::new(OUTPUT, "", Verdict::Fail, said).with_hint(hint) }
        })
    }

    /// Keeps what was answered, for the diagnosis.
    pub fn record(&self, view: View, tile: Thumbnail) {
        if let Ok(mut observations) = self.observations.lock() {
            observations.record(view, tile);
        }
    }

    /// Keeps what a compiler said about a scene, unless it is held back, where it is more than its first line.
    pub fn keep_compiler_message(&self, held_back: bool, said: &str) {
        if held_back || said.lines().nth(1).is_none() {
            return;
        }
        if let Ok(mut compiler_messages) = self.compiler_messages.lock()
            && !compiler_messages.iter().any(|kept| kept == said)
        {
            compiler_messages.push(said.to_owned());
        }
    }

    /// All kept compiler messages, one after the other.
    pub fn compiler_messages(&self) -> String {
        self.compiler_messages
            .lock()
            .map_or(String::new(), |compiler_messages| compiler_messages.join("\n\n"))
    }

    /// A scene file for a request.
    pub fn scene(&self, path: &Path) -> SceneRef {
        SceneRef { path: path.to_owned(), options: self.options.clone() }
    }

    /// Whether Ctrl-C came.
    pub fn is_cancelled(&self) -> bool {
        self.cancel.load(Ordering::Relaxed)
    }

    /// Ends a path: returns the CPU seconds of its workers and resets the retries.
    pub fn end_path(&self) -> f64 {
        self.retries.renew();
        self.cpu_s.lock().map_or(0.0, |mut cpu_s| std::mem::take(&mut *cpu_s))
    }
}

/// A ray for a request.
pub fn ray(ray: &Ray) -> RayQuery {
    RayQuery {
        origin: ray.origin.into(),
        min_t: ray.min_t,
        direction: ray.direction.into(),
        max_t: ray.max_t,
    }
}

/// A BSDF query for a request.
pub fn query(query: &api::BsdfQuery) -> BsdfQuery {
    let material = &query.material;
    let source = match (query.source, material.model) {
        (api::BSDF_OF_SHAPE, _) => {
            BsdfSource::Shape { shape: query.shape, primitive: query.primitive }
        }
        (_, api::MATERIAL_PHONG) => BsdfSource::Phong {
            diffuse: material.diffuse,
            specular: material.specular,
            exponent: material.exponent,
        },
        _ => BsdfSource::Diffuse(material.diffuse),
    };
    BsdfQuery { source, uv: query.uv, wo: query.wo, wi: query.wi }
}

/// An answer as colors.
pub fn colors(values: &[f32]) -> &[[f32; 3]] {
    values.as_chunks::<3>().0
}

/// An answer as an image.
pub fn image(values: &[f32], width: u32, height: u32) -> Image {
    let pixels = bytemuck::pod_collect_to_vec(colors(values));
    Image { width: width as usize, height: height as usize, pixels }
}

/// The first line of what a compiler said, which says it all in short.
pub fn headline(said: &str) -> &str {
    said.lines().next().unwrap_or_default()
}

/// The check for a question without an answer. `parts` are the parts whose lack is this check's
/// own fault: what is not implemented elsewhere only hides the answer.
pub fn unanswered(id: CheckId, scene: &str, parts: &[&str], outcome: &Outcome) -> Check {
    let check = |verdict, summary: String| Check::new(id, scene, verdict, summary);
    match outcome {
        Outcome::Done(_) => check(Verdict::NotJudged, "answered".into()),
        Outcome::NotImplemented(task) => {
            // A task without a part's number is the asked one's: it cannot hide others.
            let numbered = task.starts_with(|c: char| c.is_ascii_digit());
            let verdict = if !numbered || parts.iter().any(|part| task.starts_with(part)) {
                Verdict::NotImplemented
            } else {
                Verdict::NotJudged
            };
            check(verdict, format!("not implemented yet: {task}"))
        }
        Outcome::Failed(message) => {
            check(Verdict::Fail, format!("the renderer reports an error: {}", headline(message)))
        }
        Outcome::StageRefused(message) => check(Verdict::Fail, headline(message).to_owned()),
        Outcome::Panicked(message) => {
            check(Verdict::Fail, format!("the renderer panicked: {message}"))
        }
        Outcome::Rejected(message) => {
            check(Verdict::Fail, format!("the plugin was rejected: {message}"))
        }
        Outcome::CrashedBySignal(signal) => {
            check(Verdict::Fail, format!("the renderer crashed: {signal}"))
        }
        Outcome::ExitedEarly(code) => check(
            Verdict::Fail,
            format!("the renderer exited early, with code {code} and no answer"),
        ),
        Outcome::TimedOut(late) => {
            let place = match (parts, scene) {
                ([], "") => String::new(),
                ([], scene) => format!(" on scene \"{scene}\""),
                (parts, "") => format!(" in {}", parts.join(", ")),
                (parts, scene) => format!(" in {} on scene \"{scene}\"", parts.join(", ")),
            };
            check(Verdict::Fail, format!("{}{place}: {late}", late.what()))
        }
        Outcome::OutOfMemory => check(Verdict::Fail, "the renderer ran out of memory".into()),
        Outcome::FileTooLarge => {
            check(Verdict::Fail, "the renderer wrote a larger file than is allowed".into())
        }
        Outcome::NoAdapter(message) => check(Verdict::NotRun, format!("not run here: {message}")),
        // What was not asked is said only where nothing that was asked failed as badly.
        Outcome::NotRun { reason, fault: Fault::Submission } => {
            Check { error: NOT_ASKED, ..check(Verdict::Fail, reason.clone()) }
        }
        Outcome::NotRun { reason, .. } => check(Verdict::NotRun, format!("not run here: {reason}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::worker::Timeout;

    #[test]
    fn an_endless_loop_is_named_with_scene_part_and_limit() {
        let late = Timeout { computing: true, limit_s: 3.0, reference_s: Some(0.041) };
        let said = |late: Timeout, scene: &str, parts: &[&str]| {
            unanswered(CheckId::RadianceLit, scene, parts, &Outcome::TimedOut(late)).summary
        };
        assert_eq!(
            said(late, "teapot", &["1.3"]),
            "endless loop in 1.3 on scene \"teapot\": no answer within 3 s of CPU time (the reference \
             renderer takes 0.04 s)"
        );
        let idle = Timeout { computing: false, limit_s: 10.0, reference_s: None };
        assert_eq!(
            said(idle, "", &[]),
            "stuck: no answer, and nothing done for 10 s: a deadlock or a sleep"
        );
    }

    #[test]
    fn what_was_not_asked_costs_the_part_and_is_not_its_first_reason() {
        let not_asked = Outcome::NotRun { reason: "not asked".into(), fault: Fault::Submission };
        let not_asked = unanswered(CheckId::RadianceLit, "s", &["1.3"], &not_asked);
        let late = Timeout { computing: true, limit_s: 3.0, reference_s: None };
        let hangs = unanswered(CheckId::RadianceLit, "s", &["1.3"], &Outcome::TimedOut(late));
        assert_eq!((not_asked.verdict, hangs.verdict), (Verdict::Fail, Verdict::Fail));
        assert!(not_asked.error < hangs.error && 25.0 * (1.0 - not_asked.error) < 0.005);
    }
}
