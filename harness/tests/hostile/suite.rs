//! Runs the cases, several at a time, and counts.

use std::collections::BTreeMap;
use std::io::Read;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use nix::sys::signal::{Signal, kill, killpg};
use nix::sys::wait::{WaitPidFlag, WaitStatus, waitpid};
use nix::unistd::Pid;
use serde::{Deserialize, Serialize};
use umbra::sandbox::{self, Isolation, Layers};

use crate::fixture::{self, Fixture};
use crate::{archives, plugins, points, sources};

/// No case lives longer, whatever it does.
const OUTER_LIMIT: Duration = Duration::from_secs(60);
/// All plugins together, when they are graded.
const OUTER_LIMIT_OF_POINTS: Duration = Duration::from_secs(900);
/// An ordinary user; neither root nor the user that root becomes.
const USER: u32 = 65533;
/// Carries the stage's folder and the layers to a case.
const STAGE: &str = "UMBRA_HOSTILE_STAGE";
const LAYERS: &str = "UMBRA_HOSTILE_LAYERS";

const HELP: &str = "hostile [--without LAYER] [NAME]: runs the cases whose name holds NAME";

/// What a case has to say, on its standard output's last line.
#[derive(Serialize, Deserialize)]
struct Said {
    /// What came of it, or what was wrong.
    result: Result<String, String>,
    /// Processes, files and sockets that were left.
    survivors: Vec<String>,
    /// Secrets that came out.
    leaks: usize,
    /// Points by plugin; none where they are a range.
    points: Vec<(String, Option<f64>)>,
}

pub fn main() -> ExitCode {
    let mut words = std::env::args().skip(1);
    let (mut layers, mut only) = (Layers::full(), String::new());
    while let Some(word) = words.next() {
        match word.as_str() {
            "--case" => return case(&words.next().unwrap_or_default()),
            "--without" => match layers.switch(&words.next().unwrap_or_default()) {
                Some(switch) => *switch = false,
                None => {
                    eprintln!("{HELP}; the layers are those of `umbra doctor`");
                    return ExitCode::from(2);
                }
            },
            name if !name.starts_with('-') => only = name.to_owned(),
            _ => {
                eprintln!("{HELP}");
                return ExitCode::from(2);
            }
        }
    }
    // Without a root of its own, a child that is no longer root could not reach root's toolchain.
    layers.drop_privileges &= layers.mount_ns || !nix::unistd::geteuid().is_root();
    match all(layers, &only) {
        Ok(good) => ExitCode::from(u8::from(!good)),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Figures of one kind of case.
#[derive(Default)]
struct Count {
    good: usize,
    all: usize,
}

/// Runs everything whose name holds `only`; whether all was as it should be.
fn all(layers: Layers, only: &str) -> Result<bool, String> {
    let found = sandbox::available(Path::new(env!("CARGO_BIN_EXE_umbra")));
    if layers == Layers::full() && found.isolation() != Isolation::Full {
        return Err(format!("isolation would be {}; see `umbra doctor`", found.isolation()));
    }
    let begin = Instant::now();
    let stage = tempfile::Builder::new().prefix("umbra_stage").tempdir();
    let stage = stage.map_err(|error| error.to_string())?;
    fixture::set_up(stage.path(), layers)?;
    let root = nix::unistd::geteuid().is_root();
    let mut cases = Vec::new();
    if only.is_empty() || only == "points" {
        cases.push(("points".to_owned(), false));
    }
    for plugin in plugins::all() {
        let name = format!("plugin {}", plugin.name);
        cases.push((name.clone(), false));
        if root {
            cases.push((name, true));
        }
    }
    cases.extend(sources::all().iter().map(|source| (format!("source {}", source.name), false)));
    cases.retain(|(name, _)| name.contains(only));

    let (next, results) = (AtomicUsize::new(0), Mutex::new(BTreeMap::new()));
    std::thread::scope(|scope| {
        // Most wait for a limit: more than there are cores.
        let threads = std::thread::available_parallelism().map_or(2, |n| 2 * n.get()) + 1;
        for _ in 0..threads.min(8) {
            scope.spawn(|| {
                while let Some((name, as_user)) = cases.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let since = Instant::now();
                    let said = run_case(stage.path(), layers, name, *as_user);
                    print(name, *as_user, &said, since.elapsed());
                    if let Ok(mut results) = results.lock() {
                        results.insert((name.clone(), *as_user), said);
                    }
                }
            });
        }
    });
    let results = results.into_inner().unwrap_or_default();
    let mut good = BTreeMap::new();
    let (mut survivors, mut leaks) = (0, 0);
    let mut points = BTreeMap::new();
    for ((name, _), said) in &results {
        *good.entry(name.as_str()).or_insert(true) &= said.result.is_ok();
        survivors += said.survivors.len();
        leaks += said.leaks;
        points.extend(said.points.iter().cloned());
    }
    let earned = |name: &str| points.get(name).copied();
    let (mut plugin, mut source) = (Count::default(), Count::default());
    for (name, good) in &good {
        match name.split_once(' ') {
            Some(("plugin", name)) => {
                plugin.all += 1;
                let nothing = earned(name).is_none_or(|points| points == Some(0.0));
                plugin.good += usize::from(*good && nothing);
            }
            Some(_) => {
                source.all += 1;
                source.good += usize::from(*good);
            }
            // When they could not be graded, they are not all as they should be.
            None => plugin.all += usize::from(!good),
        }
    }
    let worth: f64 = points.values().map(|points| points.unwrap_or(f64::NAN)).sum();
    if !points.is_empty() {
        println!("points of {} hostile plugins together: {worth}", points.len());
    }
    let (passed, archives) = match only {
        "" => {
            let (passed, all, failed) = archives::run()?;
            if passed < all {
                println!("FAILED archives: {failed}");
            }
            (passed, all)
        }
        _ => (0, 0),
    };
    println!("all together {:.0} s", begin.elapsed().as_secs_f64());
    println!(
        "hostile: plugins={}/{} sources={}/{} archives={passed}/{archives} \
         survivors={survivors} leaks={leaks} isolation={}",
        plugin.good,
        plugin.all,
        source.good,
        source.all,
        layers.isolation()
    );
    let whole = plugin.good == plugin.all && source.good == source.all && passed == archives;
    Ok(whole && survivors == 0 && leaks == 0)
}

fn print(name: &str, as_user: bool, said: &Said, took: Duration) {
    let who = if as_user { " (as a user)" } else { "" };
    let (mark, text) = match &said.result {
        Ok(text) => ("ok    ", text),
        Err(text) => ("FAILED", text),
    };
    println!("{mark} {name}{who}: {} [{:.1} s]", text.escape_debug(), took.as_secs_f64());
    if let Err(text) = &said.result {
        println!("{text}");
    }
    for (name, points) in said.points.iter().filter(|(_, points)| *points != Some(0.0)) {
        println!("FAILED {name}: worth {points:?} points, expected 0");
    }
    for survivor in &said.survivors {
        println!("FAILED {name}: left behind: {survivor}");
    }
    if said.leaks > 0 {
        println!("FAILED {name}: {} secrets came out", said.leaks);
    }
}

/// Runs one case in a process of its own, to its end or the outer limit's.
fn run_case(stage: &Path, layers: Layers, name: &str, as_user: bool) -> Said {
    let failed = |text: String| Said {
        result: Err(text),
        survivors: Vec::new(),
        leaks: 0,
        points: Vec::new(),
    };
    let program = if as_user { Ok(stage.join("hostile")) } else { std::env::current_exe() };
    let layers = serde_json::to_string(&layers).unwrap_or_default();
    let mut command = Command::new(program.unwrap_or_default());
    command.args(["--case", name]).env(STAGE, stage).env(LAYERS, layers).process_group(0);
    if as_user {
        command.uid(USER).gid(USER);
    }
    let child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = match child {
        Ok(child) => child,
        Err(error) => return failed(format!("cannot be started: {error}")),
    };
    let limit = if name == "points" { OUTER_LIMIT_OF_POINTS } else { OUTER_LIMIT };
    let (mut stdout, mut stderr) = (child.stdout.take(), child.stderr.take());
    let (mut said, mut complaints) = (String::new(), String::new());
    let (result, timely) = std::thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let _ = stdout.as_mut().map(|pipe| pipe.read_to_string(&mut said));
        });
        let other = scope.spawn(|| {
            let _ = stderr.as_mut().map(|pipe| pipe.read_to_string(&mut complaints));
        });
        let begin = Instant::now();
        let mut timely = true;
        loop {
            match child.try_wait() {
                Ok(Some(status)) => {
                    let _ = (reader.join(), other.join());
                    return (Ok(status), timely);
                }
                Err(error) => return (Err(error), timely),
                Ok(None) => {}
            }
            if begin.elapsed() > limit {
                timely = false;
                // Its workers die with the thread that started them.
                let _ = killpg(Pid::from_raw(child.id() as i32), Signal::SIGKILL);
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    });
    if !timely {
        return failed(format!("the case outlived {limit:?}"));
    }
    let last = said.lines().next_back().unwrap_or_default();
    match serde_json::from_str(last) {
        Ok(said) => {
            // Why it is worth something.
            if name == "points" {
                eprint!("{complaints}");
            }
            said
        }
        Err(_) => failed(format!("{result:?}\n{complaints}")),
    }
}

/// The case itself.
fn case(name: &str) -> ExitCode {
    let (Some(stage), Ok(layers)) = (std::env::var_os(STAGE), std::env::var(LAYERS)) else {
        eprintln!("{HELP}");
        return ExitCode::from(2);
    };
    let layers: Layers = serde_json::from_str(&layers).expect("layers of ours");
    // What a case leaves behind becomes its child, wherever it was.
    nix::sys::prctl::set_child_subreaper(true).expect("Linux 3.4");
    let mut fixture = Fixture::new(&PathBuf::from(stage), layers);
    let mut earned = Vec::new();
    let plugin = plugins::all().into_iter().find(|p| Some(p.name) == name.strip_prefix("plugin "));
    let result = match name.split_once(' ') {
        Some(("plugin", _)) => plugin.as_ref().expect("a plugin of this name").run(&mut fixture),
        Some((_, name)) => {
            let source = sources::all().into_iter().find(|source| source.name == name);
            source.expect("a source of this name").run(&mut fixture)
        }
        None => match points::all(&fixture) {
            Ok(points) => {
                earned = points.into_iter().map(|(name, p)| (name.to_owned(), p)).collect();
                Ok(format!("{} plugins graded", earned.len()))
            }
            Err(error) => Err(format!("{error:#}")),
        },
    };
    let mut survivors = processes_left();
    survivors.extend(fixture.left_over());
    let free = plugin.map_or(Ok(()), |plugin| plugin.control(&fixture));
    processes_left();
    let result = result.and_then(|said| free.map(|()| said));
    let said = Said { result, survivors, leaks: fixture.leaks, points: earned };
    println!("{}", serde_json::to_string(&said).expect("plain data"));
    ExitCode::SUCCESS
}

/// Children of this process, orphans of its workers among them, that live on after a moment; they
/// are ended.
fn processes_left() -> Vec<String> {
    let until = Instant::now() + Duration::from_millis(500);
    let mut left = Vec::new();
    loop {
        match waitpid(None, Some(WaitPidFlag::WNOHANG)) {
            Ok(WaitStatus::StillAlive) if Instant::now() < until => {
                std::thread::sleep(Duration::from_millis(5));
            }
            Ok(WaitStatus::StillAlive) => {
                let own = std::process::id();
                let children = format!("/proc/self/task/{own}/children");
                let children = std::fs::read_to_string(children).unwrap_or_default();
                for pid in children.split_whitespace().filter_map(|pid| pid.parse().ok()) {
                    left.push(format!("process {pid}"));
                    let _ = kill(Pid::from_raw(pid), Signal::SIGKILL);
                }
                return left;
            }
            Ok(_) => {}
            Err(_) => return left,
        }
    }
}
