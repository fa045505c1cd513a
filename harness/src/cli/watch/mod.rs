//! `umbra watch`: checks a working folder on every save, and shows the report in the browser.
//!
//! A first look asks one small scene and is there soon; then everything is asked. Each check is a program of its own, `umbra check`, so that nothing that a renderer does ends the watch. A newer save
//! ends the check that runs. The page is served on this machine alone, under an address that nobody can guess.

mod live;
mod page;
mod server;

use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context as _;
use notify::{EventKind, RecursiveMode, Watcher as _};

use self::live::LiveView;
use self::server::{Board, Look, Server, Stage};
use super::context::{Context, INTERRUPTED};
use crate::assignment::SceneEntry;

/// An editor writes several files, and one in several steps: a save is over after so long without another change.
const QUIET: Duration = Duration::from_millis(150);
/// Ctrl-C is looked for so often.
const TICK: Duration = Duration::from_millis(500);
/// A check that was told to end has so long to do so.
const GRACE: Duration = Duration::from_secs(10);

/// The folder of first looks, in the report's.
const FIRST_LOOK: &str = "first-look";

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
    #[arg(long, short, value_name = "DIR", default_value = "umbra-report")]
    output: PathBuf,
}

/// Watches until Ctrl-C.
pub fn run(arguments: &WatchArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let name = || format!("cannot watch {}", arguments.folder.display());
    let folder = arguments.folder.canonicalize().with_context(name)?;
    anyhow::ensure!(folder.is_dir(), "{}: expected a folder", arguments.folder.display());
    std::fs::create_dir_all(&arguments.output)?;
    let output = arguments.output.canonicalize()?;
    let context = Context::new(root)?;
    let live = Arc::new(LiveView::new(&context.assignment, &context.supervisor, &arguments.scene)?);

    let (changed, changes) = channel();
    let (watched, written) = (folder.clone(), output.clone());
    let mut watcher = notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
        // What cannot be told counts as a change.
        let paths = match event {
            Ok(event) if matches!(event.kind, EventKind::Access(_)) => return,
            Ok(event) => event.paths,
            Err(_) => vec![watched.clone()],
        };
        for path in paths.iter().filter(|path| is_source(path, &watched, &written)) {
            let _ = changed.send(if is_shader(path) { Change::Shader } else { Change::Other });
        }
    })?;
    watcher.watch(&folder, RecursiveMode::Recursive).with_context(name)?;

    let board = Arc::new(Board::default());
    let [first, whole] = [output.join(FIRST_LOOK), output.clone()].map(|output| {
        let given = [crate::class::Source::given(&folder)];
        let slug = super::class::sources(&given, &output).remove(0).slug;
        (output.join(slug), output)
    });
    let server = Server::start([first.0, whole.0], Arc::clone(&board), Arc::clone(&live))?;
    let door = server.door()?;
    println!("{}", door.path().display());
    eprintln!(
        "umbra: watching {}; open the page above in a browser. Ctrl-C ends this",
        folder.display()
    );
    super::view::open_page(&door.path());

    let smallest = || smallest_scene(&context.assignment.scenes);
    let scene = if arguments.scene.is_empty() { smallest() } else { None };
    let parts = context.assignment.rules.parts.iter().filter(|part| part.path == "realtime");
    let check = Check {
        folder: &folder,
        outputs: [first.1, whole.1],
        arguments,
        root,
        board: &board,
        live: &live,
        scene,
        realtime: parts.map(|part| part.id.clone()).collect(),
    };
    let mut running = Some(check.start(Change::Other)?);
    // Whether the last whole report tells how the offline half of the source is now.
    let mut offline_holds = false;
    loop {
        match wait(&changes, running.as_mut()) {
            Happened::Saved(change) => {
                if let Some(older) = running.take() {
                    older.end();
                }
                offline_holds &= change == Change::Shader;
                running = Some(check.start(if offline_holds {
                    Change::Shader
                } else {
                    Change::Other
                })?);
            }
            Happened::Ended(status) => {
                if let Some(ended) = running.take() {
                    offline_holds |= ended.look == Look::Whole && is_judged(status);
                    running = check.go_on(ended, status)?;
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

/// The scene with the smallest film, for a first look; none where they are all of one size.
fn smallest_scene(scenes: &[SceneEntry]) -> Option<String> {
    let small = scenes.iter().filter_map(|scene| Some((scene.film?, &scene.name)));
    let smallest = small.min_by_key(|([width, height], _)| width * height);
    smallest.filter(|_| scenes.len() > 1).map(|(_, name)| name.clone())
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
enum Happened {
    Saved(Change),
    Ended(ExitStatus),
    Interrupted,
}

fn wait(changes: &Receiver<Change>, mut running: Option<&mut Running>) -> Happened {
    // While a check runs its end is looked for, else only Ctrl-C.
    let tick = if running.is_some() { QUIET } else { TICK };
    loop {
        if INTERRUPTED.load(Ordering::Relaxed) {
            return Happened::Interrupted;
        }
        match changes.recv_timeout(tick) {
            Ok(mut all) => {
                while let Ok(next) = changes.recv_timeout(QUIET) {
                    if next == Change::Other {
                        all = next;
                    }
                }
                return Happened::Saved(all);
            }
            Err(RecvTimeoutError::Disconnected) => return Happened::Interrupted,
            Err(RecvTimeoutError::Timeout) => {}
        }
        if let Some(status) = running.as_mut().and_then(|run| run.child.try_wait().ok().flatten()) {
            return Happened::Ended(status);
        }
    }
}

/// A check that runs.
struct Running {
    child: Child,
    /// Puts what it says on the board.
    said: Option<JoinHandle<()>>,
    look: Look,
}

impl Running {
    /// Lets a check clean up after itself, and ends it if it does not.
    fn end(mut self) {
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
    /// Where the report of a first look goes, and that of everything.
    outputs: [PathBuf; 2],
    arguments: &'a WatchArguments,
    root: Option<&'a Path>,
    board: &'a Arc<Board>,
    live: &'a Arc<LiveView>,
    /// The scene of the first look.
    scene: Option<String>,
    /// The parts of the realtime half.
    realtime: Vec<String>,
}

/// Whether a check came to a report.
fn is_judged(status: ExitStatus) -> bool {
    matches!(status.code(), Some(0 | 1))
}

impl Check<'_> {
    /// Checks what was saved: one small scene first, where there is one.
    fn start(&self, change: Change) -> anyhow::Result<Running> {
        self.board.saved(change == Change::Shader);
        self.run(if self.scene.is_some() { Look::First } else { Look::Whole }, change)
    }

    /// Whether a look is the first at a save.
    fn is_first(&self, look: Look) -> bool {
        look == Look::First || self.scene.is_none()
    }

    /// Shows how a check ended, and starts the next one, if any.
    fn go_on(&self, mut ended: Running, status: ExitStatus) -> anyhow::Result<Option<Running>> {
        ended.hear_out();
        let judged = is_judged(status);
        match (ended.look, &self.scene) {
            (Look::First, Some(scene)) if judged => {
                let words = format!("first look, on {scene} alone; the rest is being checked");
                self.board.report(Look::First, Stage::Running, &words);
                return self.run(Look::Whole, Change::Other).map(Some);
            }
            _ if judged => {
                self.board.report(
                    Look::Whole,
                    Stage::Done,
                    "everything that was asked is on the page",
                );
            }
            // The last line said why.
            _ => self.board.show(Stage::Failed, ""),
        }
        Ok(None)
    }

    fn run(&self, look: Look, change: Change) -> anyhow::Result<Running> {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("check").arg(self.folder).arg("--output").arg(&self.outputs[look as usize]);
        let parts = &self.arguments.part;
        // A first look at a shader asks what can have changed.
        let realtime = self
            .realtime
            .iter()
            .filter(|_| parts.is_empty() && look == Look::First && change == Change::Shader);
        for part in parts.iter().chain(realtime) {
            command.arg("--part").arg(part);
        }
        let first = self.scene.iter().filter(|_| look == Look::First);
        for scene in self.arguments.scene.iter().chain(first) {
            command.arg("--scene").arg(scene);
        }
        if let Some(root) = self.root {
            command.arg("--root").arg(root);
        }
        // A group of its own: Ctrl-C reaches it through this program, once.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        command.stdin(Stdio::null()).stderr(Stdio::piped());
        if look == Look::First {
            command.stdout(Stdio::null());
        }
        if self.is_first(look) {
            command.arg("--keep-plugin").arg(self.live.library());
        }
        let mut child = command.spawn().context("cannot start umbra check")?;
        let said = child.stderr.take().map(|said| {
            let (board, live) = (Arc::clone(self.board), Arc::clone(self.live));
            std::thread::spawn(move || {
                for line in BufReader::new(said).lines().map_while(Result::ok) {
                    let line = line.strip_prefix("umbra: ").unwrap_or(&line);
                    board.show(Stage::Running, line);
                    if live.has_new_library() {
                        board.compiled();
                    }
                    let _ = writeln!(std::io::stderr(), "umbra: {line}");
                }
            })
        });
        Ok(Running { child, said, look })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_look_is_at_the_smallest_film() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let scenes = crate::assignment::Assignment::load(&root).unwrap().scenes;
        let name = smallest_scene(&scenes).unwrap();
        let area = |[width, height]: [u32; 2]| width * height;
        let own = scenes.iter().find(|scene| scene.name == name).unwrap().film.map(area).unwrap();
        assert!(scenes.iter().all(|scene| scene.film.is_none_or(|film| area(film) >= own)));
    }

    #[test]
    fn only_what_a_check_reads_starts_one() {
        let [watched, written] =
            [Path::new("/home/a/work"), Path::new("/home/a/work/umbra-report")];
        for (path, counts) in [
            ("/home/a/work/src/bsdfs/phong.rs", true),
            ("/home/a/work/config.json", true),
            ("/home/a/work/umbra-report/work/report.html", false),
            ("/home/a/work/.git/index", false),
            ("/home/a/work/src/.phong.rs.swp", false),
            ("/home/a/work/src/phong.rs~", false),
            ("/home/a/work/target/release/x", false),
            ("/home/a/other/src/lib.rs", false),
        ] {
            assert_eq!(is_source(Path::new(path), watched, written), counts, "{path}");
        }
        assert!(is_shader(Path::new("/home/a/work/src/shaders/phong.fs.wgsl")));
        assert!(!is_shader(Path::new("/home/a/work/src/shaders/phong.rs")));
    }

    #[test]
    fn a_save_of_shaders_alone_is_told_from_others() {
        for (saved, told) in [
            (vec![Change::Shader], Change::Shader),
            (vec![Change::Shader, Change::Shader], Change::Shader),
            (vec![Change::Shader, Change::Other, Change::Shader], Change::Other),
            (vec![Change::Other, Change::Shader], Change::Other),
        ] {
            let (changed, changes) = channel();
            saved.iter().for_each(|&change| changed.send(change).unwrap());
            assert!(
                matches!(wait(&changes, None), Happened::Saved(all) if all == told),
                "{saved:?}"
            );
        }
    }
}
