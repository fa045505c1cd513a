//! Judges both paths of one submission, in parallel if there are threads for it.

use std::panic::resume_unwind;
use std::path::Path;
use std::time::Instant;

use super::begun::{SO_FAR, Say};
use super::costs::Costs;
use super::offline::Drawn;
use super::pipeline::{Grading, RenderPath};
use super::session::Session;
use super::stages::Stages;
use crate::evidence::{Check, Evidence, Verdict};
use crate::harmless::harmless;
use crate::rubric::{self, BUILD, Part};

/// What was found out on one path.
pub(super) struct OnPath {
    pub checks: Vec<Check>,
    pub drawn: Vec<Drawn>,
    /// What compilers said in several lines.
    pub compiler_messages: String,
    /// Seconds since the first path began.
    wall_s: f64,
    cpu_s: f64,
}

/// What was found out on the paths that were asked about.
pub(super) struct BothPaths {
    pub offline: Option<OnPath>,
    pub realtime: Option<OnPath>,
}

impl Grading<'_> {
    /// What is found out on the paths that are asked about: on both at once where there are threads for it, unless
    /// realtime is wanted first.
    pub(super) fn both_paths(
        &self,
        session: &Session,
        plugin: &Path,
        stages: &Stages,
        seed: u64,
        say: Say,
        costs: &mut Costs,
    ) -> anyhow::Result<BothPaths> {
        let begun = Instant::now();
        let offline = || {
            let (mut checks, mut drawn) = (Vec::new(), Vec::new());
            self.offline(session, plugin, seed, say, &mut checks, &mut drawn)?;
            checks.extend(session.used_up());
            say(&self.so_far(RenderPath::Offline, &checks));
            let (wall_s, cpu_s) = (begun.elapsed().as_secs_f64(), session.end_path());
            anyhow::Ok(OnPath { checks, drawn, compiler_messages: String::new(), wall_s, cpu_s })
        };
        // With a budget of its own, and with what it is told later.
        let mut own = self.session("");
        let mut realtime = || {
            let (mut checks, mut drawn) = (Vec::new(), Vec::new());
            // Lives as long as the session names it.
            let _compiled = self.compile_own(&mut own, stages, say)?;
            self.realtime(&own, plugin, stages, &mut checks, &mut drawn)?;
            checks.extend(own.used_up());
            if let (Ok(mut all), Ok(printed)) = (session.printed.lock(), own.printed.lock()) {
                *all = (*all).max(*printed);
            }
            say(&self.so_far(RenderPath::Realtime, &checks));
            let (wall_s, cpu_s) = (begun.elapsed().as_secs_f64(), own.end_path());
            anyhow::Ok(OnPath {
                checks,
                drawn,
                compiler_messages: own.compiler_messages(),
                wall_s,
                cpu_s,
            })
        };
        let asks = |path| self.paths.contains(&path);
        let (offline, realtime) = match RenderPath::ALL.map(asks) {
            [true, true] if self.realtime_first => {
                say("drawing realtime");
                let second = realtime()?;
                say("rendering offline");
                (Some(offline()), Some(Ok(second)))
            }
            [true, true] if self.threads > 1 => {
                say("rendering offline, drawing realtime");
                std::thread::scope(|scope| {
                    let offline = scope.spawn(offline);
                    let realtime = realtime();
                    let offline = offline.join().unwrap_or_else(|panic| resume_unwind(panic));
                    (Some(offline), Some(realtime))
                })
            }
            [asks_offline, asks_realtime] => {
                let first = asks_offline.then(|| {
                    say("rendering offline");
                    offline()
                });
                if let Some(Err(error)) = first {
                    return Err(error);
                }
                let second = asks_realtime.then(|| {
                    say("drawing realtime");
                    realtime()
                });
                (first, second)
            }
        };
        let mut both = BothPaths { offline: offline.transpose()?, realtime: realtime.transpose()? };
        if let (Ok(mut all), Ok(mut later)) = (session.observations.lock(), own.observations.lock())
        {
            all.absorb(std::mem::take(&mut *later));
        }
        if let Some(realtime) = &mut both.realtime {
            realtime.checks.extend(session.printed_much());
        }
        // Each from the end of the other that ended before it, so that they add up to the whole.
        let ended = |path: &Option<OnPath>| path.as_ref().map_or(0.0, |path| path.wall_s);
        let [first, second] = [ended(&both.offline), ended(&both.realtime)];
        for (name, path, before) in [
            ("offline", &both.offline, if second < first { second } else { 0.0 }),
            ("realtime", &both.realtime, if first <= second { first } else { 0.0 }),
        ] {
            if let Some(path) = path {
                costs.push(name, path.wall_s - before, path.cpu_s);
            }
        }
        Ok(both)
    }

    /// What the parts of a path are worth, and why where one lost something.
    fn so_far(&self, path: RenderPath, checks: &[Check]) -> String {
        let built = Check::new(BUILD, "", Verdict::Pass, "");
        let evidence = Evidence { checks: checks.iter().cloned().chain([built]).collect() };
        let rules = &self.assignment.rules;
        let parts = rubric::grade(rules, &evidence).parts;
        // The bonus is drawn.
        let is_own = |rule: &Part| (rule.path == "offline") == (path == RenderPath::Offline);
        let own = rules.parts.iter().zip(&parts).filter(|(rule, _)| is_own(rule));
        let words = own.map(|(_, part)| {
            let why = if part.is_lost() { format!(" ({})", part.reason) } else { String::new() };
            format!("{} {} of {}{why}", part.id, part.points, part.out_of)
        });
        format!("{SO_FAR}{}", harmless(&words.collect::<Vec<_>>().join(", ")))
    }
}
