//! Workers from outside: answers that are known in closed form, and crashes that hurt nobody.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use umbra::evidence::{Witness, WitnessQuery};
use umbra::process::{Exit, ProcessLimits};
use umbra::sandbox::Layers;
use umbra::worker::{
    Adapter, AdapterKind, BsdfQuery, BsdfSource, CameraValue, Fault, Job, JobReport, Outcome,
    RayQuery, Request, RetryBudget, SceneRef, StageText, Supervisor, Timeout,
};

/// A floor in y = 0 from -4 to 4, facing up, a small blocker over x > 2 at y = 1, and a light at
/// (0, 2, 0): an emitter whose index mean lies there.
const OBJ: &str = "mtllib s.mtl
v -4 0 -4
v 4 0 -4
v 4 0 4
v -4 0 4
vn 0 1 0
o floor
usemtl grey
f 4//1 3//1 2//1 1//1
v 1 1 -1
v 3 1 -1
v 3 1 1
v 1 1 1
o blocker
usemtl grey
f 8//1 7//1 6//1 5//1
v -0.1 2 -0.1
v 0.1 2 -0.1
v 0 2 0.2
o lamp
usemtl lamp
f 9 10 11
";
const MTL: &str = "newmtl grey
Kd 0.5 0.25 0.125
illum 7
newmtl lamp
Kd 0 0 0
Ke 10 20 30
illum 7
";
const TOML: &str = "[input]
objfile = \"s.obj\"
[camera]
eye = [0, 3, 0]
at = [0, 0, 0]
up = [0, 0, 1]
fov = 40
";
const LIGHT: [f32; 3] = [0.0, 2.0, 0.0];
const INTENSITY: [f32; 3] = [10.0, 20.0, 30.0];

/// A plugin that misbehaves.
const FAULT: &str = "tests/c_plugin/fault.c";

struct TestEnv {
    dir: tempfile::TempDir,
    supervisor: Supervisor,
    limits: ProcessLimits,
}

impl TestEnv {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        for (name, text) in [("s.toml", TOML), ("s.obj", OBJ), ("s.mtl", MTL)] {
            std::fs::write(dir.path().join(name), text).unwrap();
        }
        let scratch = dir.path().join("scratch");
        std::fs::create_dir(&scratch).unwrap();
        let umbra = PathBuf::from(env!("CARGO_BIN_EXE_umbra"));
        let limits = ProcessLimits {
            wall_s: 5.0,
            cpu_s: 5,
            memory_mib: 1024,
            output_kib: 256,
            ..ProcessLimits::default()
        };
        Self { dir, supervisor: Supervisor::new(umbra, scratch), limits }
    }

    fn scene(&self, options: &str) -> SceneRef {
        SceneRef { path: self.dir.path().join("s.toml"), options: options.to_owned() }
    }

    fn offline(&self, options: &str, seed: u64, threads: u32) -> Request {
        let scene = self.scene(options);
        let (width, height, spp, shadows) = (9, 5, 4, true);
        Request::RenderOffline { scene, width, height, spp, seed, threads, shadows }
    }

    fn run(&self, plugin: &Path, requests: Vec<Request>) -> JobReport {
        let job = Job { plugin: Some(plugin.to_owned()), requests };
        let report =
            self.supervisor.run_job(&job, &self.limits, &AtomicBool::new(false), &mut |_| {});
        for run in &report.runs {
            assert!(group_is_empty(run.ended.pid), "a process of the worker's group is left");
        }
        let left: Vec<_> = std::fs::read_dir(&self.supervisor.scratch).unwrap().collect();
        assert!(left.is_empty(), "files are left: {left:?}");
        report
    }

    /// Compiles a plugin in C, by its path below `harness`, with flags for the preprocessor.
    fn compile(&self, source: &str, flags: &[&str]) -> PathBuf {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let name = format!("{}{}.so", source.replace('/', "_"), flags.concat());
        let library = self.dir.path().join(name);
        let output = Command::new("cc")
            .args(["-shared", "-fPIC", "-Wall", "-Wextra", "-Werror", "-O1"])
            .args(["-std=c11", "-D_GNU_SOURCE", "-Wno-infinite-recursion", "-I"])
            .arg(root.join("api/include"))
            .args(flags)
            .arg(root.join(source))
            .arg("-o")
            .arg(&library)
            .output()
            .expect("a C compiler is installed as `cc`");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        library
    }
}

fn reference() -> PathBuf {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../target/release/libreference_impl.so");
    assert!(
        path.is_file(),
        "{} is missing: run `cargo build --release --workspace` first",
        path.display()
    );
    path
}

/// Whether no process of that group runs any more; those that were killed get a moment to go.
fn group_is_empty(group: u32) -> bool {
    (0..50).any(|_| {
        let empty = !std::fs::read_dir("/proc").unwrap().flatten().any(|entry| {
            let stat = std::fs::read_to_string(entry.path().join("stat")).unwrap_or_default();
            // "pid (name) state parent group ...", where the name may hold anything.
            let fields = stat.rsplit(')').next().unwrap_or_default();
            let mut fields = fields.split_whitespace();
            let (state, of) = (fields.next(), fields.nth(1));
            of == Some(&group.to_string()) && state != Some("Z")
        });
        if !empty {
            std::thread::sleep(Duration::from_millis(20));
        }
        empty
    })
}

fn values(outcome: &Outcome) -> &[f32] {
    &outcome.answer().unwrap_or_else(|| panic!("an answer, not {outcome:?}")).values
}

fn assert_close(found: &[f32], expected: &[f32], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
        let error = (found - expected).abs();
        assert!(
            error <= 1e-4 * expected.abs() + 1e-7,
            "{what}: value {index} is {found}, expected {expected}"
        );
    }
}

/// A ray straight down to the floor's point (x, 0, z).
fn down_to(x: f32, z: f32) -> RayQuery {
    let direction = [0.0, -1.0, 0.0];
    RayQuery { origin: [x, 0.5, z], min_t: 1e-3, direction, max_t: f32::INFINITY }
}

#[test]
fn the_reference_renders_offline_the_same_at_any_thread_count() {
    let house = TestEnv::new();
    let requests = [(7, 1), (7, 3), (8, 1)].map(|(seed, n)| house.offline("", seed, n)).to_vec();
    let report = house.run(&reference(), requests);
    assert_eq!(report.renderer.as_deref(), Some("reference 0.1.0"));
    assert_eq!(report.runs.len(), 1);
    assert_eq!(report.runs[0].ended.exit, Exit::Code(0));
    let [one, three, other] = &report.outcomes[..] else { panic!("three outcomes") };
    assert_eq!(values(one).len(), 9 * 5 * 3);
    assert!(values(one).iter().all(|value| value.is_finite()));
    assert!(values(one).iter().any(|value| *value > 0.1), "something is lit");
    assert_eq!(values(one), values(three));
    assert_ne!(values(one), values(other));
}

#[test]
fn bsdf_probes_of_the_reference_and_of_plain_c_match_the_closed_form() {
    let house = TestEnv::new();
    let albedo = [0.9, 0.5, 0.1];
    let (up, tilted, below) = ([0.0, 0.0, 1.0], [0.6, 0.0, 0.8], [0.6, 0.0, -0.8]);
    let pairs = [(up, up), (up, tilted), (tilted, up), (up, below), (below, up)];
    let query = |(wo, wi)| BsdfQuery { source: BsdfSource::Diffuse(albedo), uv: [0.0; 2], wo, wi };
    let diffuse = Request::EvalBsdf {
        scene: house.scene(""),
        queries: pairs.iter().copied().map(query).collect(),
    };
    let inv_pi = std::f32::consts::FRAC_1_PI;
    let expected: Vec<f32> = [1.0, 0.8, 1.0, 0.0, 0.0]
        .iter()
        .flat_map(|cosine| albedo.map(|kd| kd * inv_pi * cosine))
        .collect();
    let source = BsdfSource::Phong { diffuse: [0.2; 3], specular: [0.4; 3], exponent: 3.0 };
    let phong = BsdfQuery { source, uv: [0.0; 2], wo: tilted, wi: [-0.6, 0.0, 0.8] };
    let phong = Request::EvalBsdf { scene: house.scene(""), queries: vec![phong] };

    let report = house.run(&reference(), vec![diffuse.clone(), phong.clone()]);
    assert_close(values(&report.outcomes[0]), &expected, "reference, diffuse");
    let mirror = (0.2 * inv_pi + 0.4 * 5.0 * 0.5 * inv_pi) * 0.8;
    assert_close(values(&report.outcomes[1]), &[mirror; 3], "reference, phong");

    let c = house.compile("api/examples/renderer.c", &[]);
    let report = house.run(&c, vec![diffuse, phong, house.offline("", 1, 1)]);
    assert_eq!(report.renderer.as_deref(), Some("plain C 1.0"));
    assert_close(values(&report.outcomes[0]), &expected, "plain C, diffuse");
    let task = "other BSDFs than diffuse ones".to_owned();
    assert_eq!(report.outcomes[1], Outcome::NotImplemented(task));
    assert_close(values(&report.outcomes[2]), &[0.25, 0.5, 0.75].repeat(45), "plain C, image");
}

#[test]
fn radiance_under_a_witness_is_intensity_over_r_squared_times_its_value() {
    let house = TestEnv::new();
    let points = [(0.0, 0.0), (1.0, 0.0), (-2.0, 1.5), (0.5, -3.0)];
    let rays: Vec<_> = points.iter().map(|&(x, z)| down_to(x, z)).collect();
    let witnesses =
        [Witness::Constant([0.5, 1.0, 2.0]), Witness::OfWi, Witness::OfWo, Witness::OfAngle];
    let request = |witness| Request::Radiance {
        scene: house.scene(""),
        rays: rays.clone(),
        shadows: true,
        witness,
        seed: 1,
    };
    let mut requests: Vec<_> = witnesses.iter().copied().map(request).collect();
    requests.push(request(Witness::True));
    let report = house.run(&reference(), requests);
    for (witness, outcome) in witnesses.iter().zip(&report.outcomes) {
        let mut expected = Vec::new();
        for (x, z) in points {
            let r2 = x * x + z * z + LIGHT[1] * LIGHT[1];
            let cosine = LIGHT[1] / r2.sqrt();
            let sine = (1.0 - cosine * cosine).sqrt();
            let query = WitnessQuery { wi: [sine, 0.0, cosine], wo: [0.0, 0.0, 1.0] };
            let value = witness.value(&query).unwrap();
            expected.extend((0..3).map(|c| INTENSITY[c] / r2 * value[c]));
        }
        assert_close(values(outcome), &expected, &format!("{witness:?}"));
        let seen = outcome.answer().unwrap().witness.unwrap();
        assert_eq!(seen.calls, points.len() as u64);
        assert!(seen.worst_norm_error.unwrap() < 1e-5, "{seen:?}");
    }
    let own = report.outcomes[4].answer().unwrap();
    assert_eq!(own.witness, None, "the witness was taken away");
    let below_light = 0.5 * std::f32::consts::FRAC_1_PI * INTENSITY[0] / 4.0;
    assert_close(&own.values[..1], &[below_light], "diffuse floor below the light");
}

#[test]
fn a_shadow_is_seen_under_the_constant_witness_only_when_asked_for() {
    let house = TestEnv::new();
    let request = |shadows| Request::Radiance {
        scene: house.scene(""),
        rays: vec![down_to(3.0, 0.0), down_to(-3.0, 0.0)],
        shadows,
        witness: Witness::Constant([1.0; 3]),
        seed: 1,
    };
    let report = house.run(&reference(), vec![request(true), request(false)]);
    let lit = INTENSITY.map(|i| i / 13.0);
    assert_close(values(&report.outcomes[0]), &[[0.0; 3], lit].concat(), "shadowed");
    assert_close(values(&report.outcomes[1]), &[lit, lit].concat(), "unshadowed");
}

#[test]
fn tables_that_do_not_fit_are_refused_with_both_values_named() {
    let house = TestEnv::new();
    let version = renderer_api::INTERFACE_VERSION;
    for (flag, expected) in [
        ("-DWRONG_MAGIC", [format!("{:#018x}", renderer_api::MAGIC), "0x1122334455667788".into()]),
        ("-DWRONG_VERSION", [format!("expected version {version}"), "found 77".into()]),
        ("-DWRONG_SIZE", ["expected ".into(), "found 64".into()]),
        ("-DNULL_ENTRY", ["`radiance`".into(), "null".into()]),
    ] {
        let library = house.compile(FAULT, &[flag]);
        let report = house.run(&library, vec![house.offline("", 1, 1), house.offline("", 2, 1)]);
        assert_eq!(report.runs.len(), 1, "asked once");
        for outcome in &report.outcomes {
            let Outcome::Rejected(message) = outcome else { panic!("{flag}: {outcome:?}") };
            for expected in &expected {
                assert!(message.contains(expected), "{flag}: {message:?} lacks {expected:?}");
            }
        }
    }
    let text = house.dir.path().join("text.so");
    std::fs::write(&text, "no library").unwrap();
    let report = house.run(&text, vec![house.offline("", 1, 1)]);
    assert!(matches!(&report.outcomes[0], Outcome::Rejected(m) if m.contains("text.so")));
}

/// Out of time: of CPU time, or because nothing was done.
fn late(computing: bool, limit_s: f64) -> Outcome {
    Outcome::TimedOut(Timeout { computing, limit_s, reference_s: None })
}

#[test]
fn each_fault_has_its_outcome_and_the_requests_around_it_are_answered() {
    let mut house = TestEnv::new();
    house.limits.wall_s = 1.0;
    house.limits.memory_mib = 400;
    let plugin = house.compile(FAULT, &[]);
    let full = house.supervisor.isolation;
    let crashed = |name: &str| Outcome::CrashedBySignal(name.to_owned());
    let before_start = "the plugin wrote before the start of its output buffer, or cut the file \
                        short";
    for (mode, expected) in [
        ("abort", crashed("SIGABRT")),
        ("segv", crashed("SIGSEGV")),
        ("exit0", Outcome::ExitedEarly(0)),
        ("loop", late(true, 1.0)),
        ("sleep", late(false, 1.0)),
        ("stack", crashed("SIGABRT, stack overflow")),
        // Printing is no crime; never to stop is.
        ("flood", late(true, 1.0)),
        ("memory", Outcome::OutOfMemory),
        ("past_end", crashed("SIGSEGV")),
        ("before_start", Outcome::Rejected(before_start.to_owned())),
        ("status", Outcome::Failed("the plugin answered with the unknown status 77: ".into())),
        ("long_message", Outcome::Failed("\0".repeat(4000))),
        ("no_adapter", Outcome::NoAdapter(String::new())),
        ("fork", crashed("SIGABRT")),
        ("daemon", Outcome::ExitedEarly(0)),
        (
            "null_scene",
            Outcome::Failed(
                "the plugin answered that it made a scene, but the handle is null".into(),
            ),
        ),
    ] {
        // Only what never ends should meet this limit: a slow machine may take long to fill memory.
        house.limits.cpu_s = if expected == late(true, 1.0) { 1 } else { 30 };
        for isolation in [full, Layers::NONE] {
            house.supervisor.isolation = isolation;
            let requests = ["", mode, ""].map(|mode| house.offline(mode, 1, 1)).to_vec();
            let report = house.run(&plugin, requests);
            assert_eq!(report.outcomes[1], expected, "{mode}: {:#?}", report.runs);
            for index in [0, 2] {
                assert_eq!(values(&report.outcomes[index]), [0.0; 135], "{mode}, request {index}");
            }
            let daemon = report.runs.iter().any(|run| run.ended.left_process);
            // In the sandbox no process can be made at all.
            assert_eq!(daemon, mode == "daemon" && isolation == Layers::NONE, "{mode}");
            if mode == "flood" {
                let stdout = &report.runs[0].ended.stdout;
                assert!(stdout.head.starts_with("all work") && stdout.tail.contains("dull boy"));
                assert!(stdout.head.len() + stdout.tail.len() < 64 << 10);
            }
        }
    }
}

#[test]
fn a_request_is_blamed_only_for_what_it_does_first_in_a_worker() {
    let house = TestEnv::new();
    let plugin = house.compile(FAULT, &[]);
    let requests = ["first", "first", "abort", "first"].map(|mode| house.offline(mode, 1, 1));
    let report = house.run(&plugin, requests.to_vec());
    for index in [0, 1, 3] {
        assert_eq!(values(&report.outcomes[index]), [0.0; 135], "request {index}");
    }
    assert_eq!(report.outcomes[2], Outcome::CrashedBySignal("SIGABRT".into()));
    let asked: Vec<&[usize]> = report.runs.iter().map(|run| run.requests.as_slice()).collect();
    assert_eq!(asked, [&[0, 1, 2, 3][..], &[1, 2, 3], &[2, 3], &[3]]);
}

#[test]
fn files_cut_short_by_a_plugin_are_its_own_loss() {
    let house = TestEnv::new();
    let plugin = house.compile(FAULT, &[]);
    let report = house.run(&plugin, vec![house.offline("truncate", 1, 1)]);
    assert!(matches!(&report.outcomes[0], Outcome::Rejected(_)), "{:?}", report.outcomes);
}

#[test]
fn a_plugin_that_ends_the_worker_while_it_is_loaded_is_asked_once() {
    let house = TestEnv::new();
    let plugin = house.compile(FAULT, &["-DFAULT_AT_LOAD"]);
    let report = house.run(&plugin, vec![house.offline("", 1, 1), house.offline("", 2, 1)]);
    assert_eq!(report.outcomes, [Outcome::ExitedEarly(3), Outcome::ExitedEarly(3)]);
    assert_eq!((report.runs.len(), report.renderer), (1, None));
}

#[test]
fn cpu_time_is_limited_apart_from_wall_clock_time() {
    let mut house = TestEnv::new();
    house.limits.wall_s = 20.0;
    house.limits.cpu_s = 1;
    let plugin = house.compile(FAULT, &[]);
    let report = house.run(&plugin, vec![house.offline("loop", 1, 1)]);
    assert_eq!(report.outcomes, [late(true, 1.0)]);
}

#[test]
fn a_busy_machine_makes_nobody_late() {
    let mut house = TestEnv::new();
    // Far less than a starved render takes by the clock.
    house.limits.wall_s = 0.3;
    let plugin = house.compile(FAULT, &[]);
    let cores = std::thread::available_parallelism().map_or(2, |cores| cores.get());
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        for _ in 0..4 * cores {
            scope.spawn(|| {
                while !done.load(std::sync::atomic::Ordering::Relaxed) {
                    std::hint::spin_loop();
                }
            });
        }
        let report = house.run(&plugin, vec![house.offline("busy", 1, 1)]);
        done.store(true, std::sync::atomic::Ordering::Relaxed);
        assert_eq!(values(&report.outcomes[0]), [0.0; 135]);
        let ended = &report.runs[0].ended;
        assert!(ended.wall_s > 0.45 && ended.still_s < 0.3, "{ended:?}");
    });
}

#[test]
fn questions_of_one_worker_have_limits_of_their_own() {
    let house = TestEnv::new();
    let plugin = house.compile(FAULT, &[]);
    let ask = |modes: &[&str]| {
        let requests = modes.iter().map(|mode| house.offline(mode, 1, 1)).collect();
        let job = Job { plugin: Some(plugin.clone()), requests };
        let (never, patience) = (AtomicBool::new(false), RetryBudget::with(None, None));
        let limits = ProcessLimits { wall_s: 1.0, cpu_s: 20, ..house.limits.clone() };
        house.supervisor.run_job_with_retries(&job, &limits, &patience, &never, &mut |_| {})
    };
    // On a machine so busy that a plain render is late too, nothing is decided: asked again.
    let busy = |report: &JobReport| {
        let machine = |outcome: &Outcome| {
            matches!(outcome, Outcome::NotRun { fault: Fault::Environment, .. })
        };
        report.outcomes.iter().any(machine)
    };
    let report = std::iter::repeat_with(|| ask(&["", "", "loop", "", ""]))
        .find(|report| !busy(report))
        .unwrap();
    let ran: Vec<_> = report.runs.iter().map(|run| run.requests.as_slice()).collect();
    // Three seconds, then six alone; the other renders are asked all the same.
    assert_eq!(ran, [&[0, 1, 2, 3, 4][..], &[2], &[3, 4]]);
    for index in [0, 1, 3, 4] {
        assert_eq!(values(&report.outcomes[index]), [0.0; 135], "request {index}");
    }
    let Outcome::TimedOut(late) = &report.outcomes[2] else { panic!("{:?}", report.outcomes[2]) };
    assert!(late.computing && late.limit_s > 6.0 && late.limit_s < 6.1, "{late:?}");
}

#[test]
fn a_timeout_counts_when_it_is_confirmed_alone_on_the_machine() {
    let mut house = TestEnv::new();
    house.limits.wall_s = 1.0;
    // What a worker did before is known to the next only without isolation.
    house.supervisor.isolation = Layers::NONE;
    let plugin = house.compile(FAULT, &[]);
    let ask = |modes: &[&str], patience: &RetryBudget| {
        let requests = modes.iter().map(|mode| house.offline(mode, 1, 1)).collect();
        let job = Job { plugin: Some(plugin.clone()), requests };
        let (limits, never) = (&house.limits, AtomicBool::new(false));
        house.supervisor.run_job_with_retries(&job, limits, patience, &never, &mut |_| {})
    };
    // Late once, while another worker runs for two seconds: it is asked again when that one is gone.
    let once = format!("once {}", house.dir.path().join("late").display());
    let begin = Instant::now();
    let report = std::thread::scope(|scope| {
        let (told, tell) = std::sync::mpsc::channel();
        let other = house.supervisor.clone();
        scope.spawn(move || {
            let _beside = other.beside_others();
            told.send(()).unwrap();
            std::thread::sleep(Duration::from_secs(2));
        });
        tell.recv().unwrap();
        ask(&["", &once, ""], &RetryBudget::default())
    });
    assert!(begin.elapsed() >= Duration::from_secs(2), "{:?}", begin.elapsed());
    for outcome in &report.outcomes {
        assert_eq!(values(outcome), [0.0; 135]);
    }
    let asked: Vec<_> = report.runs.iter().map(|run| run.requests.as_slice()).collect();
    assert_eq!(asked, [&[0, 1, 2][..], &[1], &[2]]);

    // One that hangs is confirmed once, and not again in the next job of the same path.
    let patience = RetryBudget::default();
    let report = ask(&["sleep", "sleep", ""], &patience);
    let not_asked = Outcome::NotRun {
        reason: "not asked: the renderer ran out of time before (stuck: no answer, and nothing done for 1 s: a \
                 deadlock or a sleep)"
            .into(),
        fault: Fault::Submission,
    };
    assert_eq!(report.outcomes, [late(false, 1.0), late(false, 1.0), not_asked.clone()]);
    assert_eq!(report.runs.len(), 3);
    let report = ask(&[""], &patience);
    assert_eq!((report.outcomes, report.runs.len()), (vec![not_asked], 0));
}

#[test]
fn a_cancelled_job_ends_at_once_and_says_so() {
    let house = TestEnv::new();
    let plugin = house.compile(FAULT, &[]);
    let cancel = AtomicBool::new(false);
    let requests = ["", "sleep", ""].map(|mode| house.offline(mode, 1, 1)).to_vec();
    let job = Job { plugin: Some(plugin), requests };
    let mut last = 0;
    let report = house.supervisor.run_job(&job, &house.limits, &cancel, &mut |progress| {
        assert_eq!(progress.requests, 3);
        last = progress.answered;
        // The second one hangs: on a busy machine progress may be told before the first is answered.
        cancel.store(last == 1, std::sync::atomic::Ordering::Relaxed);
    });
    assert_eq!(last, 1, "the first request was answered when the job was cancelled");
    let stopped = Outcome::NotRun { reason: "cancelled".into(), fault: Fault::Environment };
    assert_eq!(values(&report.outcomes[0]), [0.0; 135]);
    assert_eq!(report.outcomes[1..], [stopped.clone(), stopped]);
}

/// Stages that fit the contract as far as they go.
const VERTEX: &str = "struct V { @builtin(position) clip: vec4f, @location(0) p: vec3f, @location(1) n: vec3f }
@vertex fn vs_main(@location(0) p: vec3f, @location(1) n: vec3f) -> V { return V(vec4f(p, 1.0), p, n); }";
const FRAGMENT: &str = "@fragment fn fs_main() -> @location(0) vec4f {
    let red = 0.5;
    return vec4f(red, 0.0, 0.0, 1.0);
}";

#[test]
fn a_stage_that_is_no_wgsl_is_refused_with_its_line_and_others_are_drawn() {
    let house = TestEnv::new();
    let with = |vertex: &str, phong: &str| {
        let stage = |(name, text): (&str, &str)| StageText { name: name.into(), text: text.into() };
        let stages = [("simple.vs", vertex), ("diffuse.fs", FRAGMENT), ("phong.fs", phong)];
        Request::RenderRealtime {
            scene: house.scene(""),
            width: 4,
            height: 4,
            shadow_map: false,
            adapter: Adapter { kind: AdapterKind::Software, name: String::new() },
            stages: stages.map(stage).into(),
            cameras: vec![CameraValue {
                eye: [0.0, 3.0, 0.0],
                at: [0.0; 3],
                up: [0.0, 0.0, 1.0],
                fov_y_deg: 40.0,
                matrices: basecode::Matrices::Usual,
            }],
        }
    };
    let no_semicolon = FRAGMENT.replacen(';', "", 1);
    let undefined = FRAGMENT.replace("vec4f(red", "vec4f(reed");
    let another_type = VERTEX.replace("vec4f(p, 1.0)", "vec3f(p)");
    let layout = FRAGMENT.replace("fs_main", "main");
    let requests = vec![
        with(VERTEX, FRAGMENT),
        with(VERTEX, &no_semicolon),
        with(VERTEX, &no_semicolon),
        with(VERTEX, &undefined),
        with(&another_type, FRAGMENT),
        with(VERTEX, &layout),
        with(VERTEX, &format!("\u{feff}{FRAGMENT}")),
    ];
    let job = Job { plugin: None, requests };
    let run = AtomicBool::new(false);
    let report = house.supervisor.run_job(&job, &house.limits, &run, &mut |_| {});
    let [right, first, again, name, vertex, unfit, marked] = report.outcomes.try_into().unwrap();
    assert!(right.answer().is_some(), "{right:?}");
    let file = "src/shaders/phong.fs.wgsl";
    let said = format!(
        "{file}:3:5: expected `;`, found \"return\"\n  ┌─ {file}:3:5\n  │\n3 │     return vec4f(red, 0.0, 0.0, 1.0);\n  \
         │     ^^^^^^ expected `;`"
    );
    assert_eq!(first, Outcome::StageRefused(said));
    assert_eq!(again, first, "its text is known by then");
    let begins = |outcome: &Outcome, place: &str| match outcome {
        Outcome::StageRefused(said) => said.starts_with(place),
        _ => false,
    };
    assert!(begins(&name, &format!("{file}:3:18: no definition in scope for identifier: `reed`")));
    assert!(begins(&vertex, "src/shaders/simple.vs.wgsl:2:"), "{vertex:?}");
    assert!(matches!(&unfit, Outcome::Failed(said) if said.contains("fs_main")), "{unfit:?}");
    assert_eq!(values(&marked), values(&right), "a byte-order mark is no part of a stage");
}

#[test]
fn scenes_and_passes_that_fail_say_why() {
    let house = TestEnv::new();
    let mut missing = house.scene("");
    missing.path = house.dir.path().join("missing.toml");
    let realtime = |kind| Request::RenderRealtime {
        scene: house.scene(""),
        width: 4,
        height: 4,
        shadow_map: false,
        adapter: Adapter { kind, name: "no such adapter".into() },
        stages: Vec::new(),
        cameras: vec![CameraValue {
            eye: [0.0, 3.0, 0.0],
            at: [0.0; 3],
            up: [0.0, 0.0, 1.0],
            fov_y_deg: 40.0,
            matrices: basecode::Matrices::Usual,
        }],
    };
    let bsdf = Request::EvalBsdf { scene: missing, queries: Vec::new() };
    let report = house.run(&reference(), vec![bsdf, realtime(AdapterKind::Software)]);
    assert!(matches!(&report.outcomes[0], Outcome::Failed(m) if m.contains("missing.toml")));
    assert!(matches!(&report.outcomes[1], Outcome::NoAdapter(_)), "{:?}", report.outcomes[1]);
    assert_eq!(report.outcomes[1].fault(), Some(Fault::Environment));

    let job = Job { plugin: None, requests: vec![realtime(AdapterKind::Any)] };
    let run = AtomicBool::new(false);
    let report = house.supervisor.run_job(&job, &house.limits, &run, &mut |_| {});
    assert_ne!(report.outcomes[0].fault(), Some(Fault::Submission), "{:?}", report.outcomes);
}

#[test]
fn the_hidden_commands_refuse_to_run_unconfined() {
    let (umbra, worker) = (env!("CARGO_BIN_EXE_umbra"), env!("CARGO_BIN_EXE_umbra-worker"));
    for (program, args) in
        [(worker, &["/tmp"][..]), (umbra, &["__decode", "/tmp"]), (umbra, &["__exec", "/bin/true"])]
    {
        let output = Command::new(program).args(args).output().unwrap();
        assert_eq!(output.status.code(), Some(71), "{args:?}");
        assert!(String::from_utf8_lossy(&output.stderr).contains("own use"), "{output:?}");
    }
}

/// Lines of a text that say something.
fn telling(text: &str) -> impl Iterator<Item = &str> {
    text.lines().map(str::trim).filter(|line| line.len() > 24 && !line.starts_with("//"))
}

#[test]
fn the_program_that_loads_plugins_holds_nothing_that_judges() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap();
    let [umbra, worker] = [env!("CARGO_BIN_EXE_umbra"), env!("CARGO_BIN_EXE_umbra-worker")]
        .map(|p| std::fs::read(p).unwrap());
    let holds =
        |program: &[u8], text: &str| memchr::memmem::find(program, text.as_bytes()).is_some();
    let vertex = read("harness/evidence/src/shaders/vertex.wgsl");
    let mistakes = read("harness/data/mistakes.json");
    let names = ["radiance.lit", "loop.agreement", "held-back scene", "right end to end"];
    let secrets: Vec<&str> =
        telling(&vertex).chain(telling(&mistakes).take(40)).chain(names).collect();
    assert!(secrets.len() > 30, "{secrets:?}");
    let found: Vec<_> = secrets.iter().filter(|text| holds(&worker, text)).collect();
    assert!(found.is_empty(), "{found:?}");
    let judged = secrets.iter().filter(|text| holds(&umbra, text)).count();
    assert!(judged > 20, "the texts are not found in umbra itself: {judged}");
    for symbol in ["umbra7grading", "umbra6rubric", "ZN8evidence5rays", "ZN9diagnosis"] {
        assert!(!holds(&worker, symbol), "{symbol}");
    }
}
