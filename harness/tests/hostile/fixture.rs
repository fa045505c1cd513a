//! Where a case runs: the stage that all cases share, and a place of its own.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;

use umbra::build::{BuildOutcome, Recording, compile, default_limits};
use umbra::process::ProcessLimits;
use umbra::sandbox::{Isolation, Layers};
use umbra::worker::{
    Adapter, AdapterKind, CameraValue, Job, JobReport, Request, SceneRef, StageText, Supervisor,
};

use crate::secrets::{Secret, leaks};

const SCENE: [(&str, &str); 3] = [
    ("s.toml", "[input]\nobjfile = \"s.obj\"\n"),
    (
        "s.obj",
        "mtllib s.mtl\nv -9 0 -9\nv 9 0 -9\nv 9 0 9\nv 0 3 0\nv 1 3 0\nv 0 3 1\n\
         o floor\nusemtl grey\nf 3 2 1\no lamp\nusemtl lamp\nf 4 5 6\n",
    ),
    ("s.mtl", "newmtl grey\nKd 0.5 0.5 0.5\nillum 7\nnewmtl lamp\nKd 0 0 0\nKe 9 9 9\nillum 7\n"),
];

pub fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the harness lies in the repository")
}

/// Makes what all cases share in `stage`: programs, plugins, a scene, secrets.
pub fn set_up(stage: &Path, layers: Layers) -> Result<(), String> {
    let at = |name: &str| stage.join(name);
    let fail = |what: &str, error: &dyn ToString| format!("{what}: {}", error.to_string());
    for folder in ["other", "home", "scene", "submission/src", "scratch"] {
        std::fs::create_dir_all(at(folder)).map_err(|e| fail(folder, &e))?;
    }
    let own = std::env::current_exe().map_err(|e| fail("this program", &e))?;
    let worker = Path::new(env!("CARGO_BIN_EXE_umbra-worker"));
    let umbra = Path::new(env!("CARGO_BIN_EXE_umbra"));
    for (from, to) in [(umbra, "umbra"), (worker, "umbra-worker"), (&own, "hostile")] {
        std::fs::copy(from, at(to)).map_err(|e| fail(to, &e))?;
    }
    for (name, text) in SCENE {
        std::fs::write(at("scene").join(name), text).map_err(|e| fail(name, &e))?;
    }
    std::fs::write(at("text.so"), "no library").map_err(|e| fail("text.so", &e))?;
    let token = token();
    for secret in ["other/lib.rs", "home/notes"] {
        Secret::write(&at(secret), &token);
    }

    let exec = "-DATTACK_AT_LOAD=\"exec /bin/sh\"";
    let attack = ["fault.c", "actions.c", "attack.c"];
    for (library, flags, sources) in [
        ("fault.so", vec![], &attack[..]),
        ("exit_at_load.so", vec!["-DFAULT_AT_LOAD"], &attack),
        ("exec_at_load.so", vec![exec], &attack),
        ("WRONG_SIZE.so", vec!["-DWRONG_SIZE"], &attack),
        ("WRONG_VERSION.so", vec!["-DWRONG_VERSION"], &attack),
        ("WRONG_MAGIC.so", vec!["-DWRONG_MAGIC"], &attack),
        ("NULL_ENTRY.so", vec!["-DNULL_ENTRY"], &attack),
    ] {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut cc = Command::new("cc");
        cc.args(["-shared", "-fPIC", "-O1", "-std=gnu11", "-D_GNU_SOURCE", "-w", "-pthread"]);
        cc.args(["-DATTACKS", "-DACTIONS"]).args(flags).arg("-I").arg(root.join("api/include"));
        for source in sources {
            let folders = ["tests/c_plugin", "tests/hostile"].map(|f| root.join(f).join(source));
            cc.args(folders.iter().find(|path| path.is_file()));
        }
        let output =
            cc.args(["-lm", "-o"]).arg(at(library)).output().map_err(|e| fail("cc", &e))?;
        if !output.status.success() {
            return Err(fail(library, &String::from_utf8_lossy(&output.stderr)));
        }
    }

    // The submission in Rust, as any other is built.
    let source = include_str!("renderer.rs");
    std::fs::write(at("submission/src/lib.rs"), source).map_err(|e| fail("lib.rs", &e))?;
    let recording = recording()?;
    let supervisor = Supervisor { isolation: layers, ..supervisor(stage, stage) };
    let (src, limits) = (at("submission/src"), default_limits());
    let never = AtomicBool::new(false);
    let report = compile(&recording, &supervisor, &src, stage, &limits, &never);
    match report.map_err(|e| fail("the compiler", &e))?.outcome {
        BuildOutcome::Built { library } => {
            std::fs::rename(library, at("hostile.so")).map_err(|e| fail("hostile.so", &e))?;
        }
        other => return Err(format!("the hostile renderer does not build: {other:#?}")),
    }
    // Nothing but the sandbox is to keep a case, whoever runs it, from reading and writing here.
    let all = Command::new("chmod").args(["-R", "a+rwX"]).arg(stage).status();
    all.map(drop).map_err(|e| fail("chmod", &e))
}

pub fn recording() -> Result<Recording, String> {
    Recording::obtain(workspace(), Path::new(env!("CARGO_BIN_EXE_umbra")))
        .map_err(|error| error.to_string())
}

pub fn supervisor(stage: &Path, scratch: &Path) -> Supervisor {
    Supervisor::new(stage.join("umbra"), scratch.to_owned())
}

/// A word that is nowhere else.
fn token() -> String {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    format!("canary{:x}{:x}", std::process::id(), now.map_or(0, |now| now.as_nanos()))
}

/// How a question is put.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Asked {
    Offline,
    Realtime,
    RealtimeWithStages,
}

/// The place of one case.
pub struct Fixture {
    stage: PathBuf,
    own: tempfile::TempDir,
    pub supervisor: Supervisor,
    pub secrets: Vec<Secret>,
    /// Secrets that came out so far, where they must not.
    pub leaks: usize,
    _listeners: [std::os::unix::net::UnixListener; 2],
}

impl Fixture {
    pub fn new(stage: &Path, layers: Layers) -> Self {
        use std::os::linux::net::SocketAddrExt;
        use std::os::unix::net::{SocketAddr, UnixListener};
        let own = tempfile::Builder::new().prefix("umbra_hostile").tempdir().expect("a folder");
        for folder in ["scratch", "results"] {
            std::fs::create_dir(own.path().join(folder)).expect("a folder");
        }
        Secret::write(&own.path().join("results/report.json"), &token());
        let supervisor =
            Supervisor { isolation: layers, ..supervisor(stage, &own.path().join("scratch")) };
        let name = own.path().display().to_string();
        let address = SocketAddr::from_abstract_name(&name).expect("a short name");
        let listeners = [
            UnixListener::bind(own.path().join("listener")).expect("a socket"),
            UnixListener::bind_addr(&address).expect("a socket"),
        ];
        let mut fixture = Self {
            stage: stage.to_owned(),
            own,
            supervisor,
            secrets: Vec::new(),
            leaks: 0,
            _listeners: listeners,
        };
        let results = vec![fixture.own("results/report.json")];
        let paths = [fixture.references(), fixture.home(), fixture.others(), results].concat();
        fixture.secrets = paths.iter().map(Secret::of).collect();
        fixture.secrets.extend(["/etc/shadow", "/etc/passwd"].map(Secret::of));
        fixture
    }

    /// A path in the stage.
    pub fn path(&self, name: &str) -> String {
        self.stage.join(name).display().to_string()
    }

    /// A path in this case's own folder; the folder's is the name of the abstract listener.
    pub fn own(&self, name: &str) -> String {
        self.own.path().join(name).display().to_string().trim_end_matches('/').to_owned()
    }

    pub fn steal(&self, paths: &[String]) -> String {
        format!("steal {}", paths.join(" "))
    }

    /// Wherever a reference could lie.
    pub fn references(&self) -> Vec<String> {
        let mut paths = self.reference();
        for file in ["expected/a2/cbox.exr", "expected/a2/teapot.exr", "reference_impl/src/lib.rs"]
        {
            paths.push(workspace().join(file).display().to_string());
        }
        paths
    }

    /// Wherever the reference's library could lie.
    pub fn reference(&self) -> Vec<String> {
        let library = "libreference_impl.so";
        let own = workspace().join("target/release").join(library).display().to_string();
        let guesses = ["/plugin", "/job", "/scene/0", "/usr/lib", ".", "..", "/closure"];
        let guesses = guesses.map(|folder| format!("{folder}/{library}"));
        [own].into_iter().chain(guesses).collect()
    }

    pub fn home(&self) -> Vec<String> {
        let home = std::env::var("HOME").unwrap_or_default();
        vec![self.path("home/notes"), format!("{home}/.bashrc"), "/root/.profile".into()]
    }

    pub fn others(&self) -> Vec<String> {
        vec![self.path("other/lib.rs"), self.path("submission/src/lib.rs")]
    }

    /// Files of `/proc` that tell of this very process.
    pub fn proc_of_others(&self) -> Vec<String> {
        let files =
            ["environ", "maps", "cmdline", "mountinfo", "root/etc/passwd", "cwd/Cargo.toml"];
        let processes = [std::process::id().to_string(), "self".into(), "1".into(), "2".into()];
        let path = |process: &String| files.map(|file| format!("/proc/{process}/{file}"));
        processes.iter().flat_map(path).collect()
    }

    /// A line of the reference's Phong stage that no other has.
    pub fn shader_line(&self) -> String {
        let file = workspace().join("reference_impl/src/shaders/phong.fs.wgsl");
        let text = std::fs::read_to_string(file).unwrap_or_default();
        let line = text.lines().find(|line| line.contains("pow(")).unwrap_or("pow(cos_alpha");
        line.trim().to_owned()
    }

    /// Lines of what the grader draws with and knows, none of which a student is given.
    pub fn graders_lines(&self) -> Vec<String> {
        let text = |file: &str| std::fs::read_to_string(workspace().join(file)).unwrap_or_default();
        let vertex = text("harness/evidence/src/shaders/vertex.wgsl");
        let mut lines: Vec<String> =
            vertex.lines().filter(|line| line.contains("world")).map(str::to_owned).collect();
        lines.extend([
            "right end to end".to_owned(),
            "radiance.lit".to_owned(),
            "held-back".to_owned(),
            "the inverse square of the distance".to_owned(),
        ]);
        lines.push(self.shader_line());
        lines.iter().map(|line| line.trim().to_owned()).collect()
    }

    /// Limits of about a second, for actions that wait for them.
    pub fn limits(&self, waits: bool) -> ProcessLimits {
        ProcessLimits {
            wall_s: if waits { 1.0 } else { 20.0 },
            cpu_s: if waits { 1 } else { 10 },
            memory_mib: 1024,
            output_kib: 256,
            ..ProcessLimits::default()
        }
    }

    /// Asks a plugin of the stage; counts what leaks.
    pub fn ask(
        &mut self,
        library: &str,
        asked: &[(Asked, &str)],
        limits: &ProcessLimits,
    ) -> JobReport {
        let report = self.ask_without(self.supervisor.isolation, library, asked, limits);
        self.leaks += leaks(&self.secrets, &report);
        report
    }

    /// The same with other layers, where leaks do not count.
    pub fn ask_without(
        &self,
        layers: Layers,
        library: &str,
        asked: &[(Asked, &str)],
        limits: &ProcessLimits,
    ) -> JobReport {
        let requests = asked.iter().map(|(asked, options)| self.request(*asked, options));
        let job = Job { plugin: Some(self.stage.join(library)), requests: requests.collect() };
        let supervisor = Supervisor { isolation: layers, ..self.supervisor.clone() };
        let report = supervisor.run_job(&job, limits, &AtomicBool::new(false), &mut |_| {});
        for run in &report.runs {
            let in_force = run.ended.in_force.as_ref().map(|in_force| in_force.isolation.clone());
            assert_eq!(in_force.unwrap_or(Isolation::None), layers.isolation());
        }
        report
    }

    fn request(&self, asked: Asked, options: &str) -> Request {
        let path = self.stage.join("scene/s.toml");
        let scene = SceneRef { path, options: options.to_owned() };
        if asked == Asked::Offline {
            let (width, height, spp, seed, threads, shadows) = (9, 5, 1, 1, 1, true);
            return Request::RenderOffline { scene, width, height, spp, seed, threads, shadows };
        }
        let text = StageText { name: "simple.vs".into(), text: "// given".into() };
        Request::RenderRealtime {
            scene,
            width: 9,
            height: 5,
            shadow_map: false,
            adapter: Adapter { kind: AdapterKind::Software, name: String::new() },
            stages: if asked == Asked::RealtimeWithStages { vec![text] } else { Vec::new() },
            cameras: vec![CameraValue {
                eye: [0.0, 3.0, 0.0],
                at: [0.0; 3],
                up: [0.0, 0.0, 1.0],
                fov_y_deg: 40.0,
                matrices: basecode::Matrices::Usual,
            }],
        }
    }

    /// Everything of this case that is still there and should not be: files, sockets.
    pub fn left_over(&self) -> Vec<String> {
        let mut left = Vec::new();
        for folder in ["", "scratch", "results"] {
            let entries = std::fs::read_dir(self.own.path().join(folder)).expect("our own folder");
            left.extend(entries.flatten().map(|entry| entry.path().display().to_string()));
        }
        let ours = ["scratch", "results", "results/report.json", "listener"].map(|n| self.own(n));
        left.retain(|path| !ours.contains(path));
        let sockets = std::fs::read_to_string("/proc/net/unix").unwrap_or_default();
        let of_plugin = |line: &&str| line.contains(&self.own("socket"));
        left.extend(sockets.lines().filter(of_plugin).map(str::to_owned));
        left
    }
}
