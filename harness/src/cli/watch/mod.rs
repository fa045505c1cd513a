//! `umbra watch`: checks a working folder on every save, and shows the report in the browser.
//!
//! Each check runs `umbra check` as a separate program, so that no renderer can end the watch. A new save ends the
//! running check. The page is served only on this machine, under an address that nobody can guess.

mod live;
mod page;
mod server;

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use anyhow::Context as _;
use notify::{EventKind, RecursiveMode, Watcher as _};

use self::live::LiveView;
use self::server::{Board, Server, Stage};
use super::context::{Context, on_interrupt};
use super::earlier::{Report, Row};
use super::outputs::ensure_apart;
use super::selection::Selection;
use super::tree::ensure_working_folder;
use crate::columns::count;
use crate::grading::{Mode, REFUSED, SO_FAR};
use crate::intake::Severity;
use crate::rubric::PartGrade;

/// A save is over after this long without another change: an editor may write several files, and one file in several
/// steps.
const QUIET: Duration = Duration::from_millis(150);
/// How often it is looked whether a folder that is gone is back.
const LOOK: Duration = Duration::from_millis(500);
/// Time that a check has to end once it is told to.
const GRACE: Duration = Duration::from_secs(10);

/// Options of `umbra watch`.
#[derive(clap::Args)]
pub struct WatchArguments {
    /// Your working folder (config.json, src/, offline/, realtime/)
    folder: PathBuf,
    /// Check only this part, such as 2.3; may be repeated
    #[arg(long, value_name = "PART")]
    part: Vec<String>,
    /// Check only on this scene, such as teapot; may be repeated
    #[arg(long, value_name = "NAME")]
    scene: Vec<String>,
    /// Where to write the report with its pictures
    #[arg(
        long = "report",
        alias = "output",
        short_alias = 'o',
        value_name = "DIR",
        default_value = "umbra-report"
    )]
    output: PathBuf,
}

/// Watches until Ctrl-C.
pub fn run(arguments: &WatchArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let name = || format!("cannot watch {}", arguments.folder.display());
    let folder = arguments.folder.canonicalize().with_context(name)?;
    anyhow::ensure!(folder.is_dir(), "{}: expected a folder", arguments.folder.display());
    let context = Context::new(root)?;
    ensure_working_folder(&arguments.folder, &context.assignment.tree)?;
    let given = [crate::class::Source::given(&folder)];
    let slug = super::class::sources(
        Mode::Check,
        &given,
        &arguments.output,
        &std::collections::HashMap::new(),
    )
    .remove(0)
    .slug;
    // Errors come before anything opens.
    Selection { parts: arguments.part.clone(), scenes: arguments.scene.clone() }
        .restrict(&mut Context::assignment(root)?)?;
    ensure_apart(&arguments.output, &folder, &slug, &context.assignment.tree)?;
    super::writable(&arguments.output)?;
    let output = arguments.output.canonicalize()?;
    let live = Arc::new(LiveView::new(&context.assignment, &context.supervisor, &arguments.scene)?);

    let (happened, happens) = channel();
    let interrupted = happened.clone();
    on_interrupt(move || {
        let _ = interrupted.send(Happened::Interrupted);
    })?;
    let changed = happened.clone();
    let (watched, written) = (folder.clone(), output.clone());
    let mut watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
        // What cannot be told counts as a change.
        let paths = match event {
            Ok(event) if matches!(event.kind, EventKind::Access(_)) => return,
            Ok(event) => event.paths,
            Err(_) => vec![watched.clone()],
        };
        for path in paths.iter().filter(|path| is_source(path, &watched, &written)) {
            let change = if is_shader(path) { Change::Shader } else { Change::Other };
            let _ = changed.send(Happened::Saved(change));
        }
    })?;
    watcher.watch(&folder, RecursiveMode::Recursive).with_context(name)?;
    let mut watched = identity(&folder);

    let board = Arc::new(Board::default());
    let server = Server::start(output.join(slug), Arc::clone(&board), Arc::clone(&live))?;
    let door = server.door()?;
    println!("{}", door.path().display());
    eprintln!(
        "umbra: watching {}; open the page above in a browser. Ctrl-C ends this",
        folder.display()
    );
    super::view::open_page(&door.path());

    let check = Check {
        folder: &folder,
        output: &output,
        arguments,
        root,
        board: &board,
        live: &live,
        happened,
    };
    let mut begun = 0;
    let mut running = Some(check.start(Change::Other, &mut begun)?);
    // Whether the last whole report tells how the offline half of the source is now.
    let mut offline_holds = false;
    loop {
        match wait(&happens, watched.is_none()) {
            Happened::Saved(change) => {
                let (now, before) = (identity(&folder), watched);
                if now.is_none() && before.is_none() {
                    continue;
                }
                if let Some(older) = running.take() {
                    older.end();
                }
                if now != before {
                    // A folder that was replaced, or is back, is another one to the system.
                    let _ = watcher.unwatch(&folder);
                    watched =
                        now.filter(|_| watcher.watch(&folder, RecursiveMode::Recursive).is_ok());
                }
                if watched.is_none() {
                    let gone =
                        format!("{} is gone; it is checked when it is back", folder.display());
                    eprintln!("umbra: {gone}");
                    board.show(Stage::Failed, &gone);
                    continue;
                }
                offline_holds &= change == Change::Shader;
                let change = if offline_holds { Change::Shader } else { Change::Other };
                running = Some(check.start(change, &mut begun)?);
            }
            Happened::Ended(number) => {
                // An older one was ended by a save.
                if let Some(mut ended) = running.take_if(|running| running.number == number) {
                    let status = ended.child.wait()?;
                    ended.hear_out();
                    offline_holds |= is_judged(status);
                    check.show(status);
                }
            }
            Happened::Interrupted => {
                if let Some(last) = running.take() {
                    last.end();
                }
                live.end();
                return Ok(super::EXIT_OK);
            }
        }
    }
}

/// What tells a folder from another one of its name; none where there is no folder.
fn identity(folder: &Path) -> Option<Identity> {
    let about = folder.metadata().ok().filter(std::fs::Metadata::is_dir)?;
    #[cfg(unix)]
    let (device, number) = {
        use std::os::unix::fs::MetadataExt as _;
        (about.dev(), about.ino())
    };
    #[cfg(not(unix))]
    let (device, number) = (0, 0);
    Some(Identity { device, number, created: about.created().ok() })
}

/// See [`identity`]. The system gives the number of a folder that was removed to a new one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Identity {
    device: u64,
    number: u64,
    created: Option<SystemTime>,
}

/// Whether a change of a file can change what a check finds.
fn is_source(path: &Path, watched: &Path, written: &Path) -> bool {
    let Ok(inside) = path.strip_prefix(watched) else { return false };
    let hidden = |part: std::path::Component| {
        let name = part.as_os_str().to_string_lossy();
        name.starts_with('.') || name == "target" || name.ends_with('~')
    };
    !path.starts_with(written) && !inside.components().any(hidden)
}

/// Whether a file can change nothing but the realtime half of what a check finds.
fn is_shader(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension == "wgsl")
}

/// What was saved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Change {
    /// WGSL alone: what was found offline still holds.
    Shader,
    Other,
}

/// What a watch waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Happened {
    Saved(Change),
    /// The check with this number.
    Ended(usize),
    Interrupted,
}

/// What happens next; of a save, all that belongs to it. Nothing is looked at until then: an idle watch costs nothing.
/// Only a folder that is `gone` sends no word when it is back: then a while without any counts as a save.
fn wait(happens: &Receiver<Happened>, gone: bool) -> Happened {
    let first = match gone {
        true => happens.recv_timeout(LOOK),
        false => happens.recv().map_err(RecvTimeoutError::from),
    };
    let first = match first {
        Ok(first) => first,
        Err(RecvTimeoutError::Timeout) => return Happened::Saved(Change::Other),
        Err(RecvTimeoutError::Disconnected) => return Happened::Interrupted,
    };
    let Happened::Saved(mut all) = first else { return first };
    while let Ok(next) = happens.recv_timeout(QUIET) {
        match next {
            Happened::Saved(change) if change == Change::Other => all = change,
            // What ended is about the save before.
            Happened::Saved(_) | Happened::Ended(_) => {}
            Happened::Interrupted => return next,
        }
    }
    Happened::Saved(all)
}

/// A check that runs.
struct Running {
    /// Tells it from others.
    number: usize,
    child: Child,
    /// Whether it was told to end: nobody needs to read that it did.
    ended: Arc<AtomicBool>,
    /// Puts what it says on the board.
    said: Option<JoinHandle<()>>,
}

impl Running {
    /// Lets a check clean up after itself, and ends it if it does not.
    fn end(mut self) {
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
    fn hear_out(&mut self) {
        if let Some(said) = self.said.take() {
            let _ = said.join();
        }
    }
}

/// How a folder is checked.
struct Check<'a> {
    folder: &'a Path,
    /// Where the report goes.
    output: &'a Path,
    arguments: &'a WatchArguments,
    root: Option<&'a Path>,
    board: &'a Arc<Board>,
    live: &'a Arc<LiveView>,
    /// Where the end of a check is reported.
    happened: Sender<Happened>,
}

/// Whether a check came to a report.
fn is_judged(status: ExitStatus) -> bool {
    matches!(status.code(), Some(0 | 1))
}

/// What a report comes to: in a few words, and in a sentence with what is to be mended first. Where everything was
/// asked (`is_whole`), that is what keeps it from being submitted, too.
fn verdict(row: &Row, is_whole: bool) -> (Stage, String, String) {
    let points = format!("{} of {} points", row.points, row.out_of);
    if let Some(first) = row.diagnostics.lines().find(|line| !line.trim().is_empty()) {
        // rustc says the place on the next line.
        let place = row.diagnostics.lines().skip_while(|line| *line != first).nth(1);
        let place = place.and_then(|line| line.trim_start().strip_prefix("--> "));
        let place = place.map_or(String::new(), |place| format!("{place}: "));
        let message = format!("{place}{first} ({points})");
        return (Stage::Refused, "does not compile".to_owned(), message);
    }
    // Where no code decided anything, the last remark tells why there is none.
    let by_code = |part: &PartGrade| part.evidence.iter().any(|id| !id.starts_with("submitted."));
    let is_bare = is_whole && row.points_max == 0.0 && !row.parts.iter().any(by_code);
    if let Some(cause) = row.remarks.last().filter(|_| is_bare) {
        return (Stage::Lost, points.clone(), format!("{points}. {cause}"));
    }
    let mut errors = row.findings.iter().filter(|found| found.severity == Severity::Error);
    let lost: Vec<&PartGrade> = row.parts.iter().filter(|part| part.is_lost()).collect();
    match lost.split_first() {
        None => match errors.next().filter(|_| is_whole) {
            Some(error) => {
                let error = error.to_string();
                let error = error.trim_start_matches("error: ");
                let short = format!("{points}, not ready to submit");
                (Stage::Unready, short, format!("{points}. {error}"))
            }
            None => (Stage::Done, points.clone(), points),
        },
        Some((first, others)) => {
            let others = match others.len() {
                0 => String::new(),
                more => format!(", and {} lost points too", count(more, "other part")),
            };
            let message = format!("{points}. {}: {}{others}", first.id, first.reason);
            (Stage::Lost, points, message)
        }
    }
}

impl Check<'_> {
    /// Shows how a check ended.
    fn show(&self, status: ExitStatus) {
        let row = is_judged(status).then(|| Report::read(self.output).ok()).flatten();
        match row.and_then(|report| report.submissions.into_iter().next()) {
            Some(row) => {
                let is_whole = self.arguments.part.is_empty() && self.arguments.scene.is_empty();
                let (stage, verdict, message) = verdict(&row, is_whole);
                self.board.report(stage, &verdict, &message);
            }
            // The last line said why.
            None => self.board.show(Stage::Failed, ""),
        }
    }

    /// Checks what was saved.
    fn start(&self, change: Change, begun: &mut usize) -> anyhow::Result<Running> {
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
                    board.show(Stage::Running, &words.join("; "));
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
