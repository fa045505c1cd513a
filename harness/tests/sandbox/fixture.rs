//! What the attacks aim at, and how they are started.

use std::fs;
use std::io::Read;
use std::net::{TcpListener, UdpSocket};
use std::os::linux::net::SocketAddrExt;
use std::os::unix::fs::PermissionsExt;
use std::os::unix::net::{SocketAddr, UnixListener};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use umbra::sandbox::{
    Bind, ChildKind, EXIT_NOT_CONFINED, InForce, Layers, Policy, SandboxError, confine_self,
    orders, read_report,
};

/// The binary under test.
pub const UMBRA: &str = env!("CARGO_BIN_EXE_umbra");
/// An ordinary user; neither root nor the user that root becomes.
const USER: u32 = 65533;
/// Carries an attack to `worker_child`.
const ATTACK: &str = "UMBRA_TEST_ATTACK";
/// No child lives longer.
const OUTER_LIMIT: Duration = Duration::from_secs(20);

/// The folder of the compiled attacks.
static ATTACKS: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/hostile/attack.c");
    for (name, flags) in [("attack.so", &["-shared", "-fPIC"][..]), ("attack", &[])] {
        // Another run of the tests may be reading the file.
        let new = folder.join(format!("{name}.{}", std::process::id()));
        let mut cc = Command::new("cc");
        cc.args(["-O1", "-o"]).arg(&new).arg(&source).arg("-pthread").args(flags);
        assert!(cc.status().expect("a C compiler").success());
        fs::rename(new, folder.join(name)).expect("one file system");
    }
    folder
});

/// Who starts the sandbox.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Who {
    Root,
    User,
}

/// Both, where the tests run as root; otherwise only the user who runs them.
pub fn everyone() -> Vec<Who> {
    if nix::unistd::geteuid().is_root() { vec![Who::Root, Who::User] } else { vec![Who::User] }
}

/// Targets that belong to one who starts, and the attacks, compiled.
pub struct Fixture {
    pub who: Who,
    pub folder: tempfile::TempDir,
    pub victim: Child,
    pub tcp: TcpListener,
    pub udp: UdpSocket,
    pub abstract_name: String,
    _listeners: [UnixListener; 2],
}

impl Drop for Fixture {
    fn drop(&mut self) {
        self.victim.kill().expect("the victim was started here");
        self.victim.wait().expect("the victim was started here");
    }
}

impl Fixture {
    pub fn new(who: Who) -> Self {
        let folder = tempfile::Builder::new().prefix("umbra_ground").tempdir().expect("a folder");
        let at = |name: &str| folder.path().join(name);
        open_to_all(folder.path(), 0o777);
        let compiled = ATTACKS.as_path();
        for name in ["attack.so", "attack"] {
            fs::copy(compiled.join(name), at(name)).expect("the compiled attacks");
        }
        // Only the sandbox is to keep it from being changed.
        open_to_all(&at("attack.so"), 0o777);
        fs::create_dir(at("expected")).expect("a folder");
        fs::write(at("expected/reference.exr"), "reference").expect("a file");
        fs::write(at("secret"), "readable by all").expect("a file");
        open_to_all(&at("secret"), 0o666);
        fs::write(at("private"), "root's").expect("a file");
        open_to_all(&at("private"), 0o600);
        fs::create_dir(at("scratch")).expect("a folder");
        open_to_all(&at("scratch"), 0o777);
        fs::create_dir(at("jail")).expect("a folder");
        let abstract_name = folder.path().display().to_string();
        let address = SocketAddr::from_abstract_name(&abstract_name).expect("a short name");
        let listeners = [
            UnixListener::bind(at("socket")).expect("a socket"),
            UnixListener::bind_addr(&address).expect("a socket"),
        ];
        open_to_all(&at("socket"), 0o777);
        let mut sleep = Command::new("sleep");
        as_user(&mut sleep, who);
        let victim = sleep.arg("120").env("SECRET", "1").spawn().expect("`sleep`");
        let tcp = TcpListener::bind("127.0.0.1:0").expect("a port");
        let udp = UdpSocket::bind("127.0.0.1:0").expect("a port");
        Self { who, folder, victim, tcp, udp, abstract_name, _listeners: listeners }
    }

    pub fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// A policy that sees the attacks and nothing else of the fixture.
    pub fn policy(&self, kind: ChildKind, layers: Layers) -> Policy {
        let mut policy = Policy::new(kind);
        policy.layers = layers;
        policy.read_only.push(Bind::new(self.path("attack"), "/plugin/attack"));
        policy.read_only.push(Bind::new(self.path("attack.so"), "/plugin/attack.so"));
        policy.scratch.quota_mib = 8;
        policy.scratch.files = 1000;
        if !layers.mount_ns {
            policy.scratch.without_mount = Some(self.path("scratch").into());
        }
        policy
    }

    /// Attacks in a child of its own, says how it ended and makes sure that nothing is left.
    pub fn attack(&self, policy: &Policy, args: &[&str]) -> Outcome {
        let outcome = self.attack_beside(policy, args);
        assert_eq!(survivors(&self.path("")), Vec::<String>::new(), "survivors of {args:?}");
        outcome
    }

    /// The same while another child is running.
    pub fn attack_beside(&self, policy: &Policy, args: &[&str]) -> Outcome {
        let mut policy = policy.clone();
        let report = tempfile::NamedTempFile::new().expect("a file");
        open_to_all(report.path(), 0o666);
        policy.report = Some(report.path().to_owned());
        let output = tempfile::NamedTempFile::new().expect("a file");
        let mut command = self.command(&policy, args);
        command.stdout(output.reopen().expect("a file"));
        let errors = tempfile::NamedTempFile::new().expect("a file");
        command.stderr(errors.reopen().expect("a file"));
        let status = wait(command.spawn().expect("the binary under test"));
        let text = |file: &Path| fs::read_to_string(file).expect("text");
        let stdout = text(output.path());
        let word = stdout.split_whitespace().next_back().unwrap_or("").to_owned();
        let report = read_report(report.path());
        Outcome { word, status, report, stderr: text(errors.path()) }
    }

    /// The command that locks a child and attacks in it.
    pub fn command(&self, policy: &Policy, args: &[&str]) -> Command {
        let mut command = if policy.kind.may_execute() {
            let program = policy.seen(Path::new(&self.path("attack")));
            let mut args: Vec<_> = args.iter().map(ToString::to_string).collect();
            args.push(self.path(""));
            umbra::sandbox::command(Path::new(UMBRA), policy, &program, args).expect("orders")
        } else {
            let library = policy.seen(Path::new(&self.path("attack.so")));
            let mut words = vec![library.display().to_string()];
            words.extend(args.iter().map(ToString::to_string));
            let own = std::env::current_exe().expect("this program's path");
            let mut command = Command::new(own);
            // A mark by which a survivor is found.
            command.arg(self.path(""));
            command.env_clear().env(ATTACK, words.join("\n"));
            command.stdin(orders(policy).expect("orders"));
            command
        };
        as_user(&mut command, self.who);
        command
    }
}

/// How an attack ended.
#[derive(Debug)]
pub struct Outcome {
    /// The last word of its output: "ok" or an errno.
    pub word: String,
    pub status: ExitStatus,
    pub report: Result<InForce, SandboxError>,
    pub stderr: String,
}

impl Outcome {
    /// The word, or the name of the signal that ended it.
    pub fn verdict(&self) -> String {
        match self.status.signal() {
            Some(signal) => umbra_signal(signal),
            None => self.word.clone(),
        }
    }
}

fn umbra_signal(number: i32) -> String {
    nix::sys::signal::Signal::try_from(number).expect("a known signal").to_string()
}

/// Waits within the outer limit.
pub fn wait(mut child: Child) -> ExitStatus {
    let begin = Instant::now();
    loop {
        if let Some(status) = child.try_wait().expect("a child of this process") {
            return status;
        }
        if begin.elapsed() > OUTER_LIMIT {
            child.kill().expect("a child of this process");
            panic!("the child outlived {OUTER_LIMIT:?}");
        }
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// Command lines of processes that carry a mark, shortly after their launcher is gone.
pub fn survivors(mark: &str) -> Vec<String> {
    let mut found = Vec::new();
    for _ in 0..100 {
        found.clear();
        for entry in fs::read_dir("/proc").expect("/proc").flatten() {
            let mut line = Vec::new();
            if entry.file_name().to_string_lossy().parse::<u32>().is_ok()
                && let Ok(mut file) = fs::File::open(entry.path().join("cmdline"))
                && file.read_to_end(&mut line).is_ok()
            {
                let line = String::from_utf8_lossy(&line).replace('\0', " ");
                if line.contains(mark) {
                    found.push(line);
                }
            }
        }
        if found.is_empty() {
            break;
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    found
}

/// Lets `who` be the one who starts a command.
pub fn as_user(command: &mut Command, who: Who) {
    if who == Who::User && nix::unistd::geteuid().is_root() {
        command.uid(USER).gid(USER);
    }
}

pub fn open_to_all(path: &Path, mode: u32) {
    fs::set_permissions(path, fs::Permissions::from_mode(mode)).expect("our own file");
}

/// Makes this test program a confined child of kind `Worker` when a test started it as one. A
/// constructor, because a process must confine itself before it has threads, and the test library
/// always makes one.
extern "C" fn worker_child() {
    let Ok(words) = std::env::var(ATTACK) else { return };
    let words: Vec<_> =
        words.lines().map(|word| std::ffi::CString::new(word).expect("no zero byte")).collect();
    if let Err(error) = confine_self() {
        eprintln!("umbra: {error}");
        std::process::exit(EXIT_NOT_CONFINED.into());
    }
    let mut pointers: Vec<_> = words[1..].iter().map(|word| word.as_ptr()).collect();
    let count = pointers.len() as i32;
    pointers.push(std::ptr::null());
    type Attack = unsafe extern "C" fn(i32, *const *const std::ffi::c_char) -> i32;
    // SAFETY: `attack` in tests/hostile/attack.c has this type and wants a terminated list.
    unsafe {
        let path = PathBuf::from(words[0].to_str().expect("an ASCII path"));
        let library = libloading::Library::new(path).expect("the library");
        let attack = library.get::<Attack>(b"attack").expect("the symbol");
        let code = attack(count, pointers.as_ptr());
        nix::libc::_exit(code);
    }
}

// SAFETY: the C library calls what stands in this section once, before `main`.
#[used]
#[unsafe(link_section = ".init_array")]
static WORKER_CHILD: extern "C" fn() = worker_child;

/// Standard output as a pipe, for tests of who holds it.
pub fn piped(command: &mut Command) -> Child {
    command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().expect("the binary under test")
}
