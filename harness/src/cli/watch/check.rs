//! One check of what was saved: `umbra check` as a program of its own, and what its report comes to.

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::Sender;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context as _;

use super::WatchArguments;
use super::live::LiveView;
use super::saves::{Change, Happened};
use super::server::{Board, CheckState};
use crate::cli::earlier::{ReportRow, StoredReport};
use crate::columns::count;
use crate::grading::{REFUSED, SO_FAR};
use crate::intake::Severity;
use crate::report;
use crate::rubric::PartGrade;

/// Time that a check has to end once it is told to.
const GRACE: Duration = Duration::from_secs(10);

/// A check that runs.
pub(super) struct Running {
    /// Tells it from others.
    pub number: usize,
    pub child: Child,
    /// Whether it was told to end: nobody needs to read that it did.
    ended: Arc<AtomicBool>,
    /// Puts what it says on the board.
    said: Option<JoinHandle<()>>,
}

impl Running {
    /// Lets a check clean up after itself, and ends it if it does not.
    pub fn end(mut self) {
        self.ended.store(true, Ordering::Release);
        #[cfg(unix)]
        if let Ok(id) = i32::try_from(self.child.id()) {
            use nix::sys::signal::{Signal, kill};
            let _ = kill(nix::unistd::Pid::from_raw(id), Signal::SIGTERM);
            let begun = Instant::now();
            while begun.elapsed() < GRACE && !self.child.try_wait().is_ok_and(|end| end.is_some()) {
                std::thread::sleep(Duration::from_millis(20));
            }
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.hear_out();
    }

    /// Waits until everything that it said is on the board, so that nothing old follows what is new.
    pub fn hear_out(&mut self) {
        if let Some(said) = self.said.take() {
            let _ = said.join();
        }
    }
}

/// How a folder is checked.
pub(super) struct Checker<'a> {
    pub folder: &'a Path,
    /// Where the report goes.
    pub output: &'a Path,
    pub arguments: &'a WatchArguments,
    pub root: Option<&'a Path>,
    pub board: &'a Arc<Board>,
    pub live: &'a Arc<LiveView>,
    /// Where the end of a check is reported.
    pub happened: Sender<Happened>,
}

/// Whether a check came to a report.
pub(super) fn is_judged(status: ExitStatus) -> bool {
    matches!(status.code(), Some(0 | 1))
}

/// What a report comes to: in a few words, and in a sentence with what is to be mended first. Where everything was
/// asked (`is_whole`), that is what keeps it from being submitted, too.
pub(super) fn verdict(row: &ReportRow, is_whole: bool) -> (CheckState, String, String) {
    let points = report::earned(&row.parts);
    if let Some(first) = row.diagnostics.lines().find(|line| !line.trim().is_empty()) {
        // rustc says the place on the next line.
        let place = row.diagnostics.lines().skip_while(|line| *line != first).nth(1);
        let place = place.and_then(|line| line.trim_start().strip_prefix("--> "));
        let place = place.map_or(String::new(), |place| format!("{place}: "));
        let message = format!("{place}{first} ({points})");
        return (CheckState::Refused, "does not compile".to_owned(), message);
    }
    // Where no code decided anything, the last remark tells why there is none.
    let by_code = |part: &PartGrade| part.evidence.iter().any(|id| !id.starts_with("submitted."));
    let is_bare = is_whole && row.points_max == 0.0 && !row.parts.iter().any(by_code);
    if let Some(cause) = row.remarks.last().filter(|_| is_bare) {
        return (CheckState::Lost, points.clone(), format!("{points}. {cause}"));
    }
    let mut errors = row.findings.iter().filter(|found| found.severity == Severity::Error);
    let lost: Vec<&PartGrade> = row.parts.iter().filter(|part| part.is_lost()).collect();
    match lost.split_first() {
        None => match errors.next().filter(|_| is_whole) {
            Some(error) => {
                let error = error.to_string();
                let error = error.trim_start_matches("error: ");
                let short = format!("{points}, not ready to submit");
                (CheckState::Unready, short, format!("{points}. {error}"))
            }
            None => (CheckState::Done, points.clone(), points),
        },
        Some((first, others)) => {
            let others = match others.len() {
                0 => String::new(),
                more => format!(", and {} lost points too", count(more, "other part")),
            };
            let message = format!("{points}. {}: {}{others}", first.id, first.reason);
            (CheckState::Lost, points, message)
        }
    }
}

impl Checker<'_> {
    /// Shows how a check ended.
    pub fn show(&self, status: ExitStatus) {
        let row = is_judged(status).then(|| StoredReport::read(self.output).ok()).flatten();
        match row.and_then(|report| report.submissions.into_iter().next()) {
            Some(row) => {
                let is_whole = self.arguments.part.is_empty() && self.arguments.scene.is_empty();
                let (stage, verdict, message) = verdict(&row, is_whole);
                self.board.report(stage, &verdict, &message);
            }
            // The last line said why.
            None => self.board.show(CheckState::Failed, ""),
        }
    }

    /// Checks what was saved.
    ///
    /// # Errors
    /// When the child cannot be started.
    pub fn start(&self, change: Change, begun: &mut usize) -> anyhow::Result<Running> {
        self.board.saved(change == Change::Shader);
        *begun += 1;
        let number = *begun;
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("check").arg(self.folder).arg("--report").arg(self.output);
        command.arg("--keep-plugin").arg(self.live.library());
        if change == Change::Shader {
            command.arg("--realtime-first");
        }
        for part in &self.arguments.part {
            command.arg("--part").arg(part);
        }
        for scene in &self.arguments.scene {
            command.arg("--scene").arg(scene);
        }
        if let Some(root) = self.root {
            command.arg("--root").arg(root);
        }
        // A group of its own: Ctrl-C reaches it through this program, once.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command.stdin(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().context("cannot start umbra check")?;
        let ended = Arc::<AtomicBool>::default();
        let quiet = Arc::clone(&ended);
        let said = child.stderr.take().map(|said| {
            let (board, live) = (Arc::clone(self.board), Arc::clone(self.live));
            let happened = self.happened.clone();
            std::thread::spawn(move || {
                let mut known: Vec<String> = Vec::new();
                for line in BufReader::new(said).lines().map_while(Result::ok) {
                    if quiet.load(Ordering::Acquire) {
                        continue;
                    }
                    let line = line.strip_prefix("umbra: ").unwrap_or(&line);
                    // What the author waits for stays to be read while the rest is checked.
                    let is_result = [REFUSED, SO_FAR].iter().any(|start| line.starts_with(start));
                    if is_result {
                        known.push(line.to_owned());
                    }
                    let doing = if is_result { None } else { Some(line.to_owned()) };
                    let words: Vec<String> = known.iter().cloned().chain(doing).collect();
                    board.show(CheckState::Running, &words.join("; "));
                    if live.has_new_library() {
                        board.compiled();
                    }
                    // The terminal may be gone.
                    let _ = writeln!(std::io::stderr(), "umbra: {line}");
                }
                // It says nothing more: it has ended, or is about to.
                let _ = happened.send(Happened::Ended(number));
            })
        });
        Ok(Running { number, child, ended, said })
    }
}

#[cfg(test)]
mod tests;
