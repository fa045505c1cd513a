//! The sandbox as workers and builds use it: what a submission must not reach it does not reach, and
//! what it draws is the same as without. Each attack is run without isolation, too, and succeeds
//! there: a test that passes without a sandbox proves nothing.

#![cfg(target_os = "linux")]

use std::net::TcpListener;
use std::os::unix::net::UnixListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, MutexGuard};
use std::time::Duration;

use umbra::build::{BuildOutcome, Recording, compile, default_limits};
use umbra::process::ProcessLimits;
use umbra::sandbox::{Isolation, Layers};
use umbra::worker::{
    Adapter, AdapterKind, CameraValue, Fault, Job, JobReport, Outcome, Request, SceneRef,
    Supervisor,
};

const UMBRA: &str = env!("CARGO_BIN_EXE_umbra");

/// One test at a time: they look for survivors among all workers of this binary.
static ONE: Mutex<()> = Mutex::new(());

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the harness lies in the repository")
}

fn reference() -> PathBuf {
    let path = workspace().join("target/release/libreference_impl.so");
    assert!(path.is_file(), "run `cargo build --release --workspace` first");
    path
}

struct TestEnv {
    dir: tempfile::TempDir,
    supervisor: Supervisor,
    victim: Child,
    tcp: TcpListener,
    _unix: UnixListener,
    _one: MutexGuard<'static, ()>,
}

impl Drop for TestEnv {
    fn drop(&mut self) {
        let _ = self.victim.kill();
        let _ = self.victim.wait();
    }
}

impl TestEnv {
    fn new() -> Self {
        let one = ONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        let dir = tempfile::tempdir().unwrap();
        for folder in ["scratch", "scene", "other"] {
            std::fs::create_dir(dir.path().join(folder)).unwrap();
        }
        let toml = "[input]\nobjfile = \"s.obj\"\n";
        std::fs::write(dir.path().join("scene/s.toml"), toml).unwrap();
        std::fs::write(dir.path().join("other/secret"), "another submission's").unwrap();
        let unix = UnixListener::bind(dir.path().join("other/socket")).unwrap();
        let supervisor = Supervisor::new(UMBRA.into(), dir.path().join("scratch"));
        let victim = Command::new("sleep").arg("60").spawn().unwrap();
        let tcp = TcpListener::bind("127.0.0.1:0").unwrap();
        Self { dir, supervisor, victim, tcp, _unix: unix, _one: one }
    }

    fn path(&self, name: &str) -> String {
        self.dir.path().join(name).display().to_string()
    }

    fn isolated(&self, isolation: Layers) -> Supervisor {
        Supervisor { isolation, ..self.supervisor.clone() }
    }

    fn plugin(&self, name: &str, flags: &[&str]) -> PathBuf {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let library = self.dir.path().join(name);
        let mut cc = Command::new("cc");
        cc.args([
            "-shared",
            "-fPIC",
            "-O1",
            "-std=gnu11",
            "-D_GNU_SOURCE",
            "-DATTACKS",
            "-w",
            "-I",
        ])
        .arg(root.join("api/include"))
        .args(flags)
        .args(["tests/c_plugin/fault.c", "tests/hostile/attack.c"].map(|file| root.join(file)))
        .args(["-pthread", "-o"])
        .arg(&library);
        assert!(cc.status().expect("a C compiler").success());
        library
    }

    fn offline(&self, options: &str) -> Request {
        let path = self.dir.path().join("scene/s.toml");
        let scene = SceneRef { path, options: options.to_owned() };
        let (width, height, spp, seed, threads, shadows) = (9, 5, 1, 1, 1, true);
        Request::RenderOffline { scene, width, height, spp, seed, threads, shadows }
    }
}

fn run(supervisor: &Supervisor, plugin: &Path, requests: Vec<Request>) -> JobReport {
    let job = Job { plugin: Some(plugin.to_owned()), requests };
    let limits = ProcessLimits { wall_s: 20.0, ..ProcessLimits::default() };
    let report = supervisor.run_job(&job, &limits, &AtomicBool::new(false), &mut |_| {});
    let wanted = supervisor.isolation.isolation();
    for run in &report.runs {
        let in_force = run.ended.in_force.as_ref().map(|in_force| in_force.isolation.clone());
        assert_eq!(in_force.unwrap_or(Isolation::None), wanted);
    }
    if wanted == Isolation::Full {
        assert_eq!(workers(), Vec::<String>::new(), "survivors");
    }
    report
}

/// Command lines of processes of this very binary that nobody waits for any more: other tests may
/// run workers of their own at the same time, whose parents live.
fn workers() -> Vec<String> {
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    let lines = entries.filter_map(|entry| {
        let status = std::fs::read_to_string(entry.path().join("status")).ok()?;
        let orphaned = status.lines().any(|line| line == "PPid:\t1");
        let line = std::fs::read(entry.path().join("cmdline")).ok().filter(|_| orphaned)?;
        Some(String::from_utf8_lossy(&line).replace('\0', " "))
    });
    lines.filter(|line| line.contains(UMBRA)).collect()
}

/// The last word that an attack printed: "ok" or an errno.
fn word(report: &JobReport) -> String {
    let stdout = report.runs.iter().map(|run| &*run.ended.stdout.head);
    let stdout: String = stdout.collect();
    stdout.split_whitespace().next_back().unwrap_or("nothing").to_owned()
}

#[test]
fn a_plugin_reaches_nothing_of_the_host() {
    let house = TestEnv::new();
    let plugin = house.plugin("attack.so", &[]);
    let expected = workspace().join("expected/a2/cbox.exr").display().to_string();
    assert!(Path::new(&expected).is_file());
    let reference = reference().display().to_string();
    let port = house.tcp.local_addr().unwrap().port().to_string();
    let (own, victim) = (std::process::id().to_string(), house.victim.id().to_string());
    let root = nix::unistd::geteuid().is_root();
    // The attack, what stops it, and whether it is tried without isolation.
    let attacks = [
        (format!("read {expected}"), "ENOENT", true),
        (format!("read {reference}"), "ENOENT", true),
        ("read /etc/shadow".into(), "ENOENT", root),
        (format!("read {}", house.path("other/secret")), "ENOENT", true),
        (format!("list {}", house.path("scratch")), "ENOENT", true),
        (format!("write {}", house.path("other/new")), "ENOENT", true),
        (format!("change {}", house.path("other/secret")), "ENOENT", true),
        ("write /job/new".into(), "EROFS", false),
        ("change /job/job.json".into(), "EROFS or EACCES", false),
        ("change /scene/0/s.toml".into(), "EROFS or EACCES", false),
        ("change /plugin/attack.so".into(), "EROFS or EACCES", false),
        ("read /job/report".into(), "ENOENT", false),
        ("exec /bin/sh".into(), "EPERM", true),
        ("fork now".into(), "EPERM", true),
        (format!("tcp {port}"), "EPERM", true),
        (format!("unix {}", house.path("other/socket")), "EPERM", true),
        (format!("reach {own}"), "EPERM", true),
        ("reach 1".into(), "EPERM", root),
        ("kill -1".into(), "EPERM", false),
        (format!("kill {victim}"), "EPERM", true),
        // Its success would outlive the test; see `daemon` in worker.rs.
        ("daemon now".into(), "EPERM", false),
        // What is useful stays possible.
        ("write /scratch/mine".into(), "ok", false),
        ("read /scene/0/s.toml".into(), "ok", false),
    ];
    for (attack, errno, control) in attacks {
        let requests = ["", &*attack, ""].map(|options| house.offline(options)).to_vec();
        let report = run(&house.supervisor, &plugin, requests.clone());
        let said = word(&report);
        assert!(errno.split(" or ").any(|errno| said == errno), "{attack}: {said} {report:#?}");
        for outcome in &report.outcomes {
            let answer = outcome.answer().unwrap_or_else(|| panic!("{attack}: {outcome:?}"));
            assert_eq!(answer.values, [0.0; 135], "{attack}");
        }
        if control {
            let report = run(&house.isolated(Layers::NONE), &plugin, requests);
            let said = word(&report);
            assert_eq!(said, "ok", "without isolation, {attack}");
        }
    }
}

#[test]
fn without_any_one_layer_the_others_still_hold() {
    let house = TestEnv::new();
    let plugin = house.plugin("attack.so", &[]);
    let root = nix::unistd::geteuid().is_root();
    let port = house.tcp.local_addr().unwrap().port().to_string();
    let (own, victim) = (std::process::id().to_string(), house.victim.id().to_string());
    let attacks = [
        format!("read {}", workspace().join("expected/a2/cbox.exr").display()),
        format!("read {}", reference().display()),
        "read /etc/shadow".into(),
        format!("read {}", house.path("other/secret")),
        format!("list {}", house.path("scratch")),
        format!("write {}", house.path("other/new")),
        format!("change {}", house.path("other/secret")),
        "exec /bin/sh".into(),
        format!("tcp {port}"),
        format!("unix {}", house.path("other/socket")),
        format!("reach {own}"),
        format!("kill {victim}"),
    ];
    for (name, on) in Layers::full().named() {
        // Without root, all namespaces hang on the first.
        if !on || (name == "user_ns" && !root) {
            continue;
        }
        let mut layers = Layers::full();
        *layers.switch(name).unwrap() = false;
        // Another user could not reach the test's own folder then.
        layers.drop_privileges &= layers.mount_ns || !root;
        for attack in &attacks {
            let report = run(&house.isolated(layers), &plugin, vec![house.offline(attack)]);
            let answer = report.outcomes[0].answer();
            let answer = answer.unwrap_or_else(|| panic!("no {name}, {attack}: {report:#?}"));
            assert_eq!(answer.values, [0.0; 135]);
            let said = word(&report);
            assert!(said.starts_with('E'), "no {name}, {attack}: {said}");
        }
    }
}

/// All the other tests, where these run as root.
#[test]
fn an_ordinary_user_is_isolated_as_well() {
    use std::os::unix::process::CommandExt;
    if !nix::unistd::geteuid().is_root() {
        return;
    }
    let mut tests = Command::new(std::env::current_exe().unwrap());
    tests.args(["isolation::", "--test-threads=1", "--skip", "an_ordinary_user"]);
    // Root's toolchain may be out of reach.
    let output = tests.args(["--skip", "a_build"]).uid(65533).gid(65533).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("test result: ok. 8 passed"), "{said}");
}

#[test]
fn attacks_while_a_plugin_is_loaded_fail_as_well() {
    let house = TestEnv::new();
    let secret = format!("-DATTACK_AT_LOAD=\"read {}\"", house.path("other/secret"));
    for (index, flag) in ["-DATTACK_AT_LOAD=\"exec /bin/sh\"", &secret].iter().enumerate() {
        let plugin = house.plugin(&format!("load{index}.so"), &[flag]);
        let report = run(&house.supervisor, &plugin, vec![house.offline("")]);
        assert_eq!(word(&report), ["EPERM", "ENOENT"][index], "{report:#?}");
        assert_eq!(report.outcomes[0].answer().expect("an answer").values, [0.0; 135]);
        let report = run(&house.isolated(Layers::NONE), &plugin, vec![house.offline("")]);
        assert_eq!(word(&report), "ok", "{report:#?}");
    }
}

#[test]
fn nothing_is_left_of_a_worker_that_is_ended() {
    let house = TestEnv::new();
    let plugin = house.plugin("attack.so", &[]);
    let job = Job { plugin: Some(plugin), requests: vec![house.offline("sleep 60")] };
    let limits = ProcessLimits { wall_s: 0.5, cpu_s: 1, ..ProcessLimits::default() };
    let late = |report: &JobReport, computing| matches!(&report.outcomes[..], [Outcome::TimedOut(late)] if late.computing == computing);
    let never = AtomicBool::new(false);
    let report = house.supervisor.run_job(&job, &limits, &never, &mut |_| {});
    assert!(late(&report, false), "{report:#?}");
    assert_eq!(workers(), Vec::<String>::new());
    let job = Job { requests: vec![house.offline("loop")], ..job };
    let report = house.supervisor.run_job(&job, &limits, &never, &mut |_| {});
    assert!(late(&report, true), "{report:#?}");
    // The usage of what ran inside is known although it was killed.
    assert!(report.runs[0].ended.cpu_s > 0.2, "{:?}", report.runs[0].ended);
    assert!(report.runs[0].ended.peak_address_mib > 0);
    std::thread::sleep(Duration::from_millis(20));
    assert_eq!(workers(), Vec::<String>::new());
}

#[test]
fn a_layer_that_cannot_be_had_is_the_machines_matter() {
    let house = TestEnv::new();
    let plugin = house.plugin("attack.so", &[]);
    // Not this program: it ends well and has confined nothing.
    let liar = Supervisor { umbra: "/bin/true".into(), ..house.supervisor.clone() };
    let job = Job { plugin: Some(plugin), requests: vec![house.offline("")] };
    let never = AtomicBool::new(false);
    let report = liar.run_job(&job, &ProcessLimits::default(), &never, &mut |_| {});
    assert!(
        matches!(&report.outcomes[0], Outcome::NotRun { fault: Fault::Environment, .. }),
        "{report:?}"
    );
}

#[test]
fn messages_name_no_path_of_the_host() {
    let house = TestEnv::new();
    let missing = Request::EvalBsdf {
        scene: SceneRef { path: house.path("scene/missing.toml").into(), options: String::new() },
        queries: Vec::new(),
    };
    let report = run(&house.supervisor, &reference(), vec![missing, house.offline("")]);
    for outcome in &report.outcomes {
        let Outcome::Failed(message) = outcome else { panic!("{outcome:?}") };
        assert!(message.contains("/scene/0/"), "{message}");
        assert!(!message.contains(&house.path("")), "{message}");
    }
}

/// A scene file of the Cornell box.
fn cornell_box(name: &str) -> SceneRef {
    let path = workspace().join("scenes/a2/cbox/tinyrender").join(name);
    assert!(path.is_file(), "{}", path.display());
    SceneRef { path, options: String::new() }
}

/// A small frame of it.
fn realtime(kind: AdapterKind) -> Request {
    Request::RenderRealtime {
        scene: cornell_box("cbox_simple_realtime.toml"),
        width: 40,
        height: 30,
        shadow_map: false,
        adapter: Adapter { kind, name: String::new() },
        stages: Vec::new(),
        cameras: vec![CameraValue {
            eye: [0.0, 1.0, 6.8],
            at: [0.0, 1.0, 0.0],
            up: [0.0, 1.0, 0.0],
            fov_y_deg: 20.0,
            matrices: basecode::Matrices::Usual,
        }],
    }
}

#[test]
fn shaders_of_a_trusted_worker_serve_others_and_nobody_changes_them() {
    let house = TestEnv::new();
    let left = house.dir.path().join("shaders");
    std::fs::create_dir(&left).unwrap();
    let contents = || {
        let mut files = umbra::files::files_below(&left).unwrap();
        files.sort();
        let content = |file: &PathBuf| (file.clone(), std::fs::read(file).unwrap());
        files.iter().map(content).collect::<Vec<_>>()
    };
    let draw = |supervisor: &Supervisor| {
        let report = run(supervisor, &reference(), vec![realtime(AdapterKind::Software)]);
        match &report.outcomes[0] {
            Outcome::Done(answer) => answer.values.clone(),
            other => panic!("{other:?}"),
        }
    };
    let full = house.isolated(Layers::full());
    let first = draw(&Supervisor { leaves_shaders: Some(left.clone()), ..full.clone() });
    let compiled = contents();
    assert!(!compiled.is_empty(), "nothing was left");
    // A worker that is given them compiles none again, and leaves those alone that it was given.
    let again = house.dir.path().join("again");
    std::fs::create_dir(&again).unwrap();
    let given = Supervisor { shaders: vec![left.clone()], ..full };
    let second = draw(&Supervisor { leaves_shaders: Some(again.clone()), ..given });
    assert!(first == second, "compiled shaders change a picture");
    assert!(contents() == compiled, "a worker changed what it was given");
    let names = |folder: &Path| umbra::files::files_below(folder).unwrap().len();
    assert_eq!(names(&again), names(&left), "some were compiled again, under other names");
}

#[test]
fn the_reference_draws_the_same_bits_inside_and_outside() {
    let house = TestEnv::new();
    let offline = Request::RenderOffline {
        scene: cornell_box("cbox_simple_offline.toml"),
        width: 40,
        height: 30,
        spp: 2,
        seed: 7,
        threads: 2,
        shadows: true,
    };
    let requests = [
        ("cores", offline),
        ("a software adapter", realtime(AdapterKind::Software)),
        ("a hardware adapter", realtime(AdapterKind::Hardware)),
    ];
    for (what, request) in requests {
        let draw = |isolation| {
            let report = run(&house.isolated(isolation), &reference(), vec![request.clone()]);
            match &report.outcomes[0] {
                Outcome::Done(answer) => Some(answer.values.clone()),
                Outcome::NoAdapter(_) => None,
                other => panic!("{what}: {other:?}"),
            }
        };
        let Some(outside) = draw(Layers::NONE) else {
            eprintln!("not compared: there is not {what} here");
            continue;
        };
        let inside = draw(Layers::full()).unwrap_or_else(|| panic!("{what} cannot be seen"));
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert!(bits(&inside) == bits(&outside), "{what}: isolation changes a picture");
        assert!(inside.iter().any(|value| *value > 0.05), "{what}: nothing is lit");
    }
}

#[test]
fn a_build_reads_nothing_but_its_own_source() {
    let house = TestEnv::new();
    let recording = Recording::obtain(workspace(), Path::new(UMBRA)).unwrap();
    let secret = house.path("other/secret");
    let foreign = workspace().join("reference_impl/src/lib.rs").display().to_string();
    for path in ["/etc/passwd", &secret, &foreign] {
        let (src, out) = (house.dir.path().join("src"), house.dir.path().join("out"));
        let _ = std::fs::remove_dir_all(&out);
        std::fs::create_dir_all(&src).unwrap();
        std::fs::create_dir_all(&out).unwrap();
        let text = format!("pub static STOLEN: &[u8] = include_bytes!({path:?});\n");
        std::fs::write(src.join("lib.rs"), text).unwrap();
        let build = |supervisor: &Supervisor| {
            let never = AtomicBool::new(false);
            let report =
                compile(&recording, supervisor, &src, &out, &default_limits(), &never).unwrap();
            report.outcome
        };
        let outcome = build(&house.supervisor);
        let BuildOutcome::CompileError { errors } = outcome else { panic!("{path}: {outcome:?}") };
        assert!(errors[0].message.contains("couldn't read"), "{errors:#?}");
        assert_eq!(errors[0].place.as_ref().expect("a place").file, "src/lib.rs");
        let outcome = build(&house.isolated(Layers::NONE));
        assert!(matches!(outcome, BuildOutcome::Built { .. }), "{path}: {outcome:?}");
    }
}
