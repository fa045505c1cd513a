//! Hostile sources through the real build.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use umbra::build::{BuildOutcome, BuildReport, Recording, compile, default_limits};
use umbra::process::{Exit, ProcessLimits};
use umbra::worker::Supervisor;

use crate::fixture::{Fixture, recording, workspace};
use crate::secrets::{Secret, leaks_of_build};

/// One hostile source.
pub struct Source {
    pub name: &'static str,
    /// The text of `lib.rs`.
    text: fn(&Fixture) -> String,
    /// A link in `src/`, to where it leads.
    link: Option<(&'static str, &'static str)>,
    expect: Expect,
}

/// What must become of the compiler call.
enum Expect {
    /// An error with this text, somewhere in `src/`.
    Refused(&'static str),
    /// An error of compiler or linker with this text, at no place.
    NoPlugin(&'static str),
    TimedOut,
    FileTooLarge,
    /// Nothing is wrong with it.
    Built,
}

impl Source {
    pub fn run(&self, fixture: &mut Fixture) -> Result<String, String> {
        let recording = recording()?;
        let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
        let begin = std::time::Instant::now();
        let report = self.build(&recording, &fixture.supervisor, folder.path(), fixture);
        let mut secrets = vec![Secret::of("/etc/passwd"), Secret::of(fixture.path("other/lib.rs"))];
        secrets.push(Secret::of(workspace().join("reference_impl/src/lib.rs")));
        fixture.leaks += leaks_of_build(&secrets, &report);
        if begin.elapsed().as_secs_f64() > 15.0 {
            return Err(format!("it took {:?}", begin.elapsed()));
        }
        let left = fs::read_dir(folder.path().join("out")).map_err(|error| error.to_string())?;
        let library = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "so");
        let left: Vec<_> = left.flatten().map(|entry| entry.path()).collect();
        if left.iter().any(|path| !library(path)) {
            return Err(format!("left behind: {left:?}"));
        }
        let said = match &report.outcome {
            BuildOutcome::CompileError { errors } => errors[0].message.clone(),
            BuildOutcome::Built { .. } => "built".to_owned(),
            other => format!("{other:?}"),
        };
        let short: String = said.chars().take(100).collect();
        if self.expect.holds(&report.outcome) { Ok(short) } else { Err(format!("{report:#?}")) }
    }

    fn build(
        &self,
        recording: &Recording,
        supervisor: &Supervisor,
        folder: &Path,
        fixture: &Fixture,
    ) -> BuildReport {
        let (src, out) = (folder.join("src"), folder.join("out"));
        for folder in [&src, &out] {
            fs::create_dir(folder).expect("our own folder");
        }
        fs::write(src.join("lib.rs"), (self.text)(fixture)).expect("our own folder");
        if let Some((name, target)) = self.link {
            std::os::unix::fs::symlink(target, src.join(name)).expect("our own folder");
        }
        let limits = ProcessLimits {
            wall_s: if matches!(self.expect, Expect::TimedOut) { 1.5 } else { 30.0 },
            cpu_s: if matches!(self.expect, Expect::TimedOut) { 1 } else { 30 },
            memory_mib: 2048,
            output_kib: 1024,
            file_size_mib: 64,
            ..default_limits()
        };
        let never = AtomicBool::new(false);
        compile(recording, supervisor, &src, &out, &limits, &never).expect("a compiler that starts")
    }
}

impl Expect {
    fn holds(&self, outcome: &BuildOutcome) -> bool {
        match (self, outcome) {
            (Self::Refused(text), BuildOutcome::CompileError { errors }) => {
                let here = |place: &umbra::build::SourcePlace| place.file.starts_with("src/");
                errors[0].message.contains(text) && errors[0].place.as_ref().is_some_and(here)
            }
            (Self::NoPlugin(text), BuildOutcome::CompileError { errors }) => {
                errors[0].rendered.contains(text)
            }
            (Self::TimedOut, BuildOutcome::Ended(Exit::OutOfCpu | Exit::TimedOut))
            | (Self::FileTooLarge, BuildOutcome::Ended(Exit::FileTooLarge))
            | (Self::Built, BuildOutcome::Built { .. }) => true,
            _ => false,
        }
    }
}

fn include(path: &str) -> String {
    format!("pub static STOLEN: &[u8] = include_bytes!({path:?});\n")
}

fn assemble(path: &str) -> String {
    let directive = format!(".globl stolen\nstolen: .incbin \"{path}\"");
    format!("core::arch::global_asm!({directive:?});\n")
}

fn in_workspace(path: &str) -> String {
    workspace().join(path).display().to_string()
}

const EXPECTED: &str = "expected/a2/cbox.exr";
const LIBRARY: &str = "target/release/libreference_impl.so";

/// All of them.
pub fn all() -> Vec<Source> {
    use Expect::*;
    let source = |name, text, expect| Source { name, text, link: None, expect };
    vec![
        source(
            "include_of_a_reference",
            |_| include(&in_workspace(EXPECTED)),
            Refused("couldn't read"),
        ),
        source(
            "include_of_the_reference_renderer",
            |_| include(&in_workspace(LIBRARY)),
            Refused("couldn't read"),
        ),
        source("include_of_etc_passwd", |_| include("/etc/passwd"), Refused("couldn't read")),
        source(
            "include_of_another_submission",
            |g| include(&g.path("other/lib.rs")),
            Refused("couldn't read"),
        ),
        source(
            "include_of_what_is_above",
            |_| include("../../other/lib.rs"),
            Refused("couldn't read"),
        ),
        source(
            "include_of_the_environment",
            |_| include("/proc/self/environ"),
            Refused("couldn't read"),
        ),
        source(
            "incbin_of_a_reference",
            |_| assemble(&in_workspace(EXPECTED)),
            NoPlugin("Could not find incbin file"),
        ),
        source(
            "incbin_of_the_reference_renderer",
            |_| assemble(&in_workspace(LIBRARY)),
            NoPlugin("Could not find incbin file"),
        ),
        source(
            "incbin_of_etc_passwd",
            |_| assemble("/etc/passwd"),
            NoPlugin("Could not find incbin file"),
        ),
        source(
            "incbin_of_another_submission",
            |g| assemble(&g.path("other/lib.rs")),
            NoPlugin("Could not find incbin file"),
        ),
        source(
            "module_of_etc_passwd",
            |_| "#[path = \"/etc/passwd\"]\nmod stolen;\n".into(),
            Refused("couldn't read"),
        ),
        source(
            "extern_crate_of_umbra",
            |_| "extern crate umbra;\n".into(),
            Refused("can't find crate"),
        ),
        source(
            "extern_crate_of_the_reference",
            |_| "extern crate reference_impl;\n".into(),
            Refused("can't find crate"),
        ),
        source(
            "extern_crate_of_the_compiler",
            |_| "#![feature(rustc_private)]\nextern crate rustc_driver;\n".into(),
            Refused(""),
        ),
        source(
            "macro_that_never_ends",
            |_| {
                "#![recursion_limit = \"4000000000\"]\nmacro_rules! more { ($($t:tt)*) => { more!($($t)* $($t)* 1) } }\nmore!(1);\n".into()
            },
            TimedOut,
        ),
        source(
            "constant_that_never_ends",
            |_| {
                "#![allow(long_running_const_eval)]\npub const N: u64 = { let mut i = 0u64; while i < u64::MAX { i += 1; } i };\n".into()
            },
            TimedOut,
        ),
        source(
            "type_that_never_ends",
            |_| {
                "pub struct S<T>(T);\npub fn f<T>(n: u32) -> u32 { if n == 0 { 0 } else { f::<S<T>>(n - 1) } }\n#[unsafe(no_mangle)]\npub extern \"C\" fn g() -> u32 { f::<u8>(9) }\n".into()
            },
            Refused("recursion limit"),
        ),
        source(
            "trait_that_never_ends",
            |_| {
                "#![recursion_limit = \"4000000000\"]\npub struct S<T>(T);\npub trait D { fn d(&self); }\nimpl<T> D for T where (S<T>, S<S<T>>): D { fn d(&self) {} }\npub fn f() { 1u8.d() }\n".into()
            },
            TimedOut,
        ),
        source(
            "a_million_lines",
            |_| (0..1_000_000).map(|i| format!("pub fn f{i}() -> u32 {{ {i} }}\n")).collect(),
            TimedOut,
        ),
        source(
            "a_constant_of_a_gigabyte",
            |_| "pub static BIG: [u8; 1 << 30] = [1; 1 << 30];\n".into(),
            Refused("tried to allocate more memory"),
        ),
        source(
            "a_constant_larger_than_a_file_may_be",
            |_| "#[unsafe(no_mangle)]\npub static BIG: [u8; 1 << 28] = [1; 1 << 28];\n".into(),
            FileTooLarge,
        ),
        source(
            "link_arguments_by_attribute",
            |_| {
                "#![feature(link_args)]\n#![link_args = \"-Wl,--version-script=/etc/passwd\"]\n"
                    .into()
            },
            Refused(""),
        ),
        source(
            "links_the_reference",
            |_| {
                "#[link(name = \"reference_impl\")]\nunsafe extern \"C\" { static umbra_renderer_plugin: u8; }\npub fn f() -> *const u8 { &raw const umbra_renderer_plugin }\n".into()
            },
            NoPlugin("reference_impl"),
        ),
        source(
            "symbols_that_collide",
            |_| {
                "#[unsafe(no_mangle)]\npub static umbra_renderer_plugin: u8 = 1;\nmod other { #[unsafe(no_mangle)] pub static umbra_renderer_plugin: u8 = 2; }\n".into()
            },
            Refused("already defined"),
        ),
        source(
            "symbols_of_the_c_library",
            |_| {
                "#[unsafe(no_mangle)]\npub extern \"C\" fn write(_: i32, _: *const u8, n: usize) -> isize { n as isize }\n#[unsafe(no_mangle)]\npub extern \"C\" fn openat(_: i32, _: *const u8, _: i32) -> i32 { -1 }\n".into()
            },
            Built,
        ),
        Source {
            link: Some(("stolen.rs", "/etc/passwd")),
            ..source("a_link_inside_src", |_| include("stolen.rs"), Refused("couldn't read"))
        },
        Source {
            link: Some(("up", "../..")),
            ..source("a_link_out_of_src", |_| include("up/other/lib.rs"), Refused("couldn't read"))
        },
        source(
            "another_kind_of_crate",
            |_| {
                "#![crate_type = \"bin\"]\nfn main() { std::fs::write(\"/tmp/hostile\", \"x\").unwrap(); }\n".into()
            },
            Built,
        ),
    ]
}
