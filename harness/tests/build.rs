//! Compiling submissions by the recorded call.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use umbra::build::{BuildOutcome, BuildReport, Recording, compile, default_limits};
use umbra::grading::template_fallback;
use umbra::process::ProcessLimits;
use umbra::worker::{BsdfQuery, BsdfSource, Job, Request, SceneRef, Supervisor};

fn workspace() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn umbra() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_umbra"))
}

fn recording() -> &'static Recording {
    static RECORDING: OnceLock<Recording> = OnceLock::new();
    RECORDING.get_or_init(|| Recording::obtain(workspace(), umbra()).unwrap())
}

fn build(src: &Path, out: &Path, limits: &ProcessLimits) -> BuildReport {
    let supervisor = Supervisor::new(umbra().to_owned(), out.to_owned());
    compile(recording(), &supervisor, src, out, limits, &AtomicBool::new(false)).unwrap()
}

/// Compiles a crate of one file.
fn build_text(text: &str, limits: &ProcessLimits) -> BuildReport {
    let dir = tempfile::tempdir().unwrap();
    let (src, out) = (dir.path().join("handin/src"), dir.path().join("out"));
    std::fs::create_dir_all(&src).unwrap();
    std::fs::create_dir(&out).unwrap();
    std::fs::write(src.join("lib.rs"), text).unwrap();
    build(&src, &out, limits)
}

#[test]
fn a_recording_is_made_once_and_stages_nothing_but_the_closure() {
    let again = Recording::obtain(workspace(), umbra()).unwrap();
    assert_eq!(&again, recording());
    let names: Vec<String> = std::fs::read_dir(&again.closure)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    let has = |name: &str| names.iter().any(|file| file.starts_with(&format!("lib{name}-")));
    for inside in ["basecode", "renderer_api", "glam", "wgpu"] {
        assert!(has(inside), "{inside} is missing in {names:?}");
    }
    for outside in ["umbra", "clap", "reference_impl", "student_template", "nix"] {
        assert!(!has(outside), "{outside} is staged");
    }
}

#[test]
#[cfg(unix)]
fn an_assignment_of_links_is_built_where_the_template_is() {
    let dir = tempfile::tempdir().unwrap();
    let own = crate::support::one_scene(&dir.path().join("own"), |_| ());
    assert_eq!(Recording::obtain(&own, umbra()).unwrap(), *recording());
}

#[test]
fn cargo_and_the_replay_build_renderers_that_draw_the_same() {
    let cargo: PathBuf = workspace().join("target/release/libreference_impl.so");
    assert!(cargo.is_file(), "run `cargo build --release --workspace` first");
    let dir = tempfile::tempdir().unwrap();
    let report = build(&workspace().join("reference_impl/src"), dir.path(), &default_limits());
    let BuildOutcome::Built { library } = report.outcome else { panic!("{:#?}", report.outcome) };
    eprintln!("replay: {:.2} s wall, {:.2} s cpu", report.wall_s, report.cpu_s);
    assert!(report.warnings.is_empty(), "{:#?}", report.warnings);

    std::fs::write(dir.path().join("s.toml"), "[input]\nobjfile = \"s.obj\"\n").unwrap();
    let obj = "mtllib s.mtl\nv -9 0 -9\nv 9 0 -9\nv 9 0 9\nv -9 0 9\nv 0 3 0\nv 1 3 0\nv 0 3 1\n\
               o floor\nusemtl shiny\nf 4 3 2 1\no lamp\nusemtl lamp\nf 5 6 7\n";
    std::fs::write(dir.path().join("s.obj"), obj).unwrap();
    let mtl = "newmtl shiny\nKd 0.5 0.4 0.3\nKs 0.2 0.3 0.4\nNs 9.8\nillum 4\n\
               newmtl lamp\nKd 0 0 0\nKe 10 20 30\nillum 7\n";
    std::fs::write(dir.path().join("s.mtl"), mtl).unwrap();
    let scene = SceneRef { path: dir.path().join("s.toml"), options: String::new() };
    let source = BsdfSource::Phong { diffuse: [0.3; 3], specular: [0.6; 3], exponent: 7.5 };
    let (wo, wi) = ([0.6, 0.0, 0.8], [-0.48, 0.36, 0.8]);
    let query = BsdfQuery { source, uv: [0.0; 2], wo, wi };
    let requests = vec![
        Request::RenderOffline {
            scene: scene.clone(),
            width: 64,
            height: 48,
            spp: 4,
            seed: 260_123_456,
            threads: 2,
            shadows: true,
        },
        Request::EvalBsdf { scene, queries: vec![query] },
    ];
    let supervisor = Supervisor::new(umbra().to_owned(), dir.path().to_owned());
    let draw = |plugin: &Path| {
        let job = Job { plugin: Some(plugin.to_owned()), requests: requests.clone() };
        let cancel = AtomicBool::new(false);
        let report = supervisor.run_job(&job, &ProcessLimits::default(), &cancel, &mut |_| {});
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        let answers = report.outcomes.iter().map(|outcome| match outcome.answer() {
            Some(answer) => bits(&answer.values),
            None => panic!("{outcome:?}"),
        });
        answers.collect::<Vec<_>>()
    };
    let (by_cargo, by_replay) = (draw(&cargo), draw(&library));
    assert_eq!(by_cargo[0].len(), 64 * 48 * 3);
    assert!(by_cargo[0].iter().any(|bits| f32::from_bits(*bits) > 0.05), "something is lit");
    assert!(by_cargo == by_replay, "the two builds draw differently");
}

#[test]
fn compile_errors_name_file_and_line() {
    let report =
        build_text("\n\npub fn f() -> u32 { \"one\" }\nfn g() { h() }\n", &default_limits());
    let BuildOutcome::CompileError { errors } = &report.outcome else { panic!("{report:#?}") };
    assert_eq!(errors.len(), 2, "{errors:#?}");
    for error in errors {
        let place = error.place.as_ref().unwrap();
        assert_eq!(place.file, "src/lib.rs");
        assert!(error.rendered.contains(&format!("src/lib.rs:{}", place.line)));
        assert!(!error.rendered.contains('\u{1b}'), "colours are off");
    }
    let lines: Vec<_> = errors.iter().map(|error| error.place.as_ref().unwrap().line).collect();
    assert!(lines.contains(&3) && lines.contains(&4), "{lines:?}");
}

/// What an allocator says when it gets nothing may stand in a source, too.
#[test]
fn a_source_that_quotes_an_allocator_is_refused_for_its_own_errors() {
    for words in
        ["memory allocation of 8 bytes failed", "std::bad_alloc", "LLVM ERROR: out of memory"]
    {
        for text in
            [format!("compile_error!(\"{words}\");\n"), format!("const A: u8 = \"{words}\";\n")]
        {
            let report = build_text(&text, &default_limits());
            let refused = matches!(&report.outcome, BuildOutcome::CompileError { .. });
            assert!(refused, "{text}: {:#?}", report.outcome);
        }
    }
}

#[test]
fn warnings_are_kept_and_umbras_own_crates_are_out_of_reach() {
    let report = build_text("fn unused() {}\n", &default_limits());
    assert!(matches!(report.outcome, BuildOutcome::Built { .. }), "{report:#?}");
    assert_eq!(report.warnings.len(), 1);
    for foreign in ["clap", "umbra", "libc"] {
        let text = format!("extern crate {foreign};\n");
        let report = build_text(&text, &default_limits());
        let refused = matches!(&report.outcome, BuildOutcome::CompileError { .. });
        assert!(refused, "{foreign}: {:#?}", report.outcome);
    }
    // The submission's folder besides `src`, and cargo's view of it, are not told.
    let report = build_text("const _: &str = env!(\"CARGO_HOME\");\n", &default_limits());
    assert!(matches!(report.outcome, BuildOutcome::CompileError { .. }));
}

#[test]
fn a_compiler_that_does_not_end_is_ended() {
    let text = "#![allow(long_running_const_eval)]\n\
                pub const N: u64 = { let mut i = 0u64; while i < u64::MAX { i += 1; } i };\n";
    let limits = ProcessLimits { cpu_s: 1, ..default_limits() };
    let report = build_text(text, &limits);
    assert!(
        matches!(report.outcome, BuildOutcome::Ended(exit) if exit.is_out_of_time()),
        "{:#?}",
        report.outcome
    );
    assert!(report.cpu_s < 3.0, "{report:#?}");
}

#[test]
fn what_tutorials_use_for_shadow_mapping_is_there() {
    let text = r#"
use basecode::bytemuck::{Pod, Zeroable};
use basecode::gpu::{Gpu, look_at, orthographic, perspective};
use basecode::wgpu::util::DeviceExt;
use basecode::{Mat4, Vec3, glam, wgpu};

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
#[bytemuck(crate = "basecode::bytemuck")]
pub struct Light {
    pub view_projection: [[f32; 4]; 4],
}

pub fn light(gpu: &Gpu, position: Vec3) -> wgpu::Buffer {
    let view = look_at(position, Vec3::ZERO, Vec3::Y);
    let turned = glam::Quat::from_rotation_y(1.0) * Vec3::X;
    let projection = perspective(90f32.to_radians(), 1.0, 0.1, 100.0);
    let sun: Mat4 = orthographic(-10.0, 10.0, -10.0, 10.0, 0.1, 100.0) * look_at(turned, Vec3::ZERO, Vec3::Z);
    let light = Light { view_projection: (projection * view * sun).to_cols_array_2d() };
    gpu.device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("light"),
        contents: basecode::bytemuck::cast_slice(&[light]),
        usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
    })
}
"#;
    let report = build_text(text, &default_limits());
    assert!(matches!(report.outcome, BuildOutcome::Built { .. }), "{:#?}", report.outcome);
}

/// A file, and what it has instead of a text.
type Change<'a> = (&'a str, &'a str, &'a str);

/// A right renderer in which a file has a text instead of another; an empty file is not there.
fn mend_with(changes: &[Change]) -> template_fallback::Built {
    let dir = tempfile::tempdir().unwrap();
    let [src, out, copy] = ["src", "out", "copy"].map(|name| dir.path().join(name));
    std::fs::create_dir(&out).unwrap();
    let template = workspace().join("expected/a2/template");
    for from in [&template, &workspace().join("samples/perfect/src")] {
        for file in umbra::files::files_below(from).unwrap() {
            let to = src.join(file.strip_prefix(from).unwrap());
            std::fs::create_dir_all(to.parent().unwrap()).unwrap();
            std::fs::copy(file, to).unwrap();
        }
    }
    for (file, from, to) in changes {
        let path = src.join(file);
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains(from), "{file} holds no {from:?}");
        let text = if from.is_empty() { String::new() } else { text.replacen(from, to, 1) };
        if text.is_empty() {
            std::fs::remove_file(path).unwrap();
        } else {
            std::fs::write(path, text).unwrap();
        }
    }
    let supervisor = Supervisor::new(umbra().to_owned(), out.clone());
    let cancel = AtomicBool::new(false);
    let compile =
        |src: &Path| compile(recording(), &supervisor, src, &out, &default_limits(), &cancel);
    template_fallback::build(&compile, &src, &template, &copy).unwrap()
}

#[test]
fn what_the_compiler_refuses_is_the_templates_and_the_rest_is_built() {
    let new =
        ("bsdfs/phong.rs", "pub fn new(material: &Material)", "pub fn new(m: &Material, n: f32)");
    let kinds: [(&[Change], &[&str]); 14] = [
        // A type error, a file that is missing, one that does not parse.
        (&[("bsdfs/phong.rs", "f * cos_i", "f + 1")], &["bsdfs/phong.rs"]),
        (&[("bsdfs/phong.rs", "", "")], &["bsdfs/phong.rs"]),
        (&[("integrators/simple.rs", "{", "(")], &["integrators/simple.rs"]),
        (&[("renderpasses/simple.rs", "&self.frame.bind_group", "")], &["renderpasses/simple.rs"]),
        // A stage that is included and missing.
        (&[("shaders/phong.fs.wgsl", "", "")], &["shaders/phong.fs.wgsl"]),
        // No `mod`; an error in lib.rs.
        (&[("bsdfs/mod.rs", "mod phong;", "")], &["bsdfs/mod.rs"]),
        (&[("lib.rs", "Ok(Self)", "Ok(1)")], &["lib.rs"]),
        // A method that the trait does not have, and one that it wants.
        (&[("bsdfs/phong.rs", "fn eval(", "fn pdf(")], &["bsdfs/phong.rs"]),
        (&[("renderpasses/simple.rs", "fn draw(", "fn paint(")], &["renderpasses/simple.rs"]),
        // Right in itself, but no longer what the template's own lines use.
        (&[new], &["bsdfs/phong.rs"]),
        (
            &[(
                "integrators/simple.rs",
                "pub shadows: bool,",
                "pub shadows: bool,\n    pub bias: f32,",
            )],
            &["integrators/simple.rs"],
        ),
        // A name that the template's own line does not find either.
        (&[("bsdfs/mod.rs", "phong::PhongBsdf", "phong::PhongBSDF")], &["bsdfs/mod.rs"]),
        (&[("bsdfs/mod.rs", "pub use diffuse::DiffuseBsdf;\n", "")], &["bsdfs/mod.rs"]),
        // Two at once.
        (
            &[("bsdfs/diffuse.rs", "impl Bsdf", "imp Bsdf"), ("renderer.rs", "use", "us")],
            &["bsdfs/diffuse.rs", "renderer.rs"],
        ),
    ];
    for (changes, expected) in kinds {
        let built = mend_with(changes);
        let replaced: Vec<&str> = built.replaced.keys().map(String::as_str).collect();
        let is_built = matches!(built.report.outcome, BuildOutcome::Built { .. });
        assert!(is_built && replaced == expected, "{changes:?}: {replaced:?} {:#?}", built.errors);
        let rendered: Vec<&str> = built.errors.iter().map(|error| &*error.rendered).collect();
        let rendered = rendered.concat();
        assert!(rendered.contains("--> src/") && rendered.contains('^'), "{rendered}");
        assert!(!rendered.contains(workspace().to_str().unwrap()), "{rendered}");
    }
}

/// Ends the next `count` compilers below this process, as a scheduler or a machine out of memory would.
#[cfg(target_os = "linux")]
fn end_compilers(count: usize) -> std::thread::JoinHandle<()> {
    use nix::sys::signal::{Signal, kill};
    use nix::unistd::Pid;
    // The name and the parent of a process.
    let stat = |pid: i32| {
        let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
        let (name, rest) = stat.split_once('(')?.1.rsplit_once(')')?;
        Some((name.to_owned(), rest.split_whitespace().nth(1)?.parse::<i32>().ok()?))
    };
    let is_below = move |pid: i32| {
        let mut above =
            std::iter::successors(Some(pid), |&pid| stat(pid).map(|(_, parent)| parent));
        above.any(|pid| pid == std::process::id() as i32)
    };
    std::thread::spawn(move || {
        let mut ended = Vec::new();
        while ended.len() < count {
            for entry in std::fs::read_dir("/proc").unwrap() {
                let Ok(pid) = entry.unwrap().file_name().to_str().unwrap_or("").parse() else {
                    continue;
                };
                let is_compiler = stat(pid).is_some_and(|(name, _)| name == "rustc");
                if ended.len() < count && !ended.contains(&pid) && is_compiler && is_below(pid) {
                    kill(Pid::from_raw(pid), Signal::SIGKILL).unwrap();
                    ended.push(pid);
                }
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    })
}

#[test]
#[cfg(target_os = "linux")]
fn a_compiler_that_is_ended_from_outside_is_nobodys_fault() {
    let src = workspace().join("student_template/src");
    let dir = tempfile::tempdir().unwrap();
    recording();
    let compile = || {
        let supervisor = Supervisor::new(umbra().to_owned(), dir.path().to_owned());
        let cancel = AtomicBool::new(false);
        compile(recording(), &supervisor, &src, dir.path(), &default_limits(), &cancel)
    };
    let killer = end_compilers(1);
    let again = compile().unwrap().outcome;
    killer.join().unwrap();
    assert!(matches!(again, BuildOutcome::Built { .. }), "{again:?}");

    let killer = end_compilers(2);
    let error = compile().unwrap_err().to_string();
    killer.join().unwrap();
    assert_eq!(error, "the compiler was ended by SIGKILL");
}
