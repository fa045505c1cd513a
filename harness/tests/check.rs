//! `umbra check` on a part, on a scene, and on a folder that is none.

#![cfg(target_os = "linux")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::copy_folder;

/// A working folder that is right, in a folder of its own.
struct Work(tempfile::TempDir);

impl Work {
    fn new() -> Self {
        Self::of(&["student_template", "samples/perfect"])
    }

    /// One with these sources, of which later ones replace files of earlier ones.
    fn of(sources: &[&str]) -> Self {
        let work = Self(tempfile::tempdir().unwrap());
        for source in sources {
            copy_folder(&root().join(source).join("src"), &work.folder().join("src"));
        }
        fs::copy(root().join("student_template/config.json"), work.folder().join("config.json"))
            .unwrap();
        work
    }

    fn folder(&self) -> PathBuf {
        self.0.path().join("work")
    }

    /// Replaces a text of a source that stands there once.
    fn change(&self, file: &str, old: &str, new: &str) {
        let path = self.folder().join("src").join(file);
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(text.matches(old).count(), 1, "{file}");
        fs::write(path, text.replace(old, new)).unwrap();
    }

    /// Exit code, standard output and standard error of `umbra check` in the folder above.
    fn check(&self, arguments: &[&str]) -> (i32, String, String) {
        let mut umbra = Command::new(env!("CARGO_BIN_EXE_umbra"));
        umbra.current_dir(self.0.path()).arg("check").args(arguments);
        let run = umbra.args(["--report", "out", "--root"]).arg(root()).output().unwrap();
        let [out, err] = [run.stdout, run.stderr].map(|said| String::from_utf8(said).unwrap());
        (run.status.code().unwrap(), out, err)
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize().unwrap()
}

#[test]
fn a_scene_tells_of_what_it_shows_and_of_nothing_else() {
    let work = Work::new();
    // Phong materials are wrong on both paths, and the scene has none.
    work.change("shaders/phong.fs.wgsl", "incident * f * cos_i", "vec3f(1.0, 0.0, 0.0)");
    let (code, out, err) = work.check(&["work", "--scene", "sphere_diffuse", "--part", "2.4"]);
    assert_eq!(code, 1, "{out}{err}");
    assert!(out.contains("0..25/25") && !out.contains("that is right"), "{out}");

    let (code, out, err) = work.check(&["work", "--scene", "sphere_diffuse"]);
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("nothing of ") && out.contains("2.5"), "{out}");
    assert!(!out.contains("2.5  "), "the bonus does not show there: {out}");
}

#[test]
fn a_loop_elsewhere_costs_a_part_neither_points_nor_time() {
    let work = Work::new();
    work.change(
        "integrators/simple.rs",
        "fn light_is_visible(scene: &Scene, i: &SurfaceInteraction) -> bool {",
        "fn light_is_visible(scene: &Scene, i: &SurfaceInteraction) -> bool {\n    \
         while scene.shapes().len() < usize::MAX { std::hint::spin_loop(); }",
    );
    let (code, out, err) = work.check(&["work", "--part", "1.1"]);
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("5/5"), "{out}");
    // Nothing was asked that would loop.
    let report = fs::read(work.0.path().join("out/report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap();
    let checks = report["submissions"][0]["checks"].as_array().unwrap();
    let asked = |id: &str| checks.iter().any(|check| check["id"] == id);
    assert!(asked("bsdf.diffuse") && !asked("shadow.rays") && !asked("image.offline"));
}

#[test]
fn a_folder_above_working_folders_is_not_checked_but_told() {
    let work = Work::new();
    let (code, _, err) = work.check(&["."]);
    assert_eq!(code, 2, "{err}");
    assert!(err.contains("it holds neither config.json nor src/; did you mean ./work?"), "{err}");
    assert!(!err.contains("compil"), "{err}");
    copy_folder(&work.folder(), &work.0.path().join("other"));
    let (code, _, err) = work.check(&["."]);
    assert_eq!(code, 2, "{err}");
    assert!(err.contains(".: it holds 2 working folders, other and work among them"), "{err}");
}

/// What is said of the bonus: points and words, without its pictures.
fn bonus(out: &str) -> String {
    let (_, said) = out.split_once("\n  2.5 ").expect(out);
    let said = said.split("\n\n").next().unwrap();
    said.split("pictures:").next().unwrap().trim_end().to_owned()
}

#[test]
fn a_stage_that_does_not_compile_earns_no_more_of_the_bonus_than_one_without_shadows() {
    let said = |file: &str, old: &str, new: &str| {
        let work = Work::new();
        work.change(file, old, new);
        bonus(&work.check(&["work", "--part", "2.5"]).1)
    };
    let diffuse = "shaders/diffuse.fs.wgsl";
    let unshadowed = said(diffuse, "visibility(world_position, n) * incident", "incident");
    let broken = said(diffuse, "let f =", "let f: i32 =");
    assert!(!broken.contains("20/20") && broken == unshadowed, "{broken}\n{unshadowed}");
    // Umbra's own vertex stage stands in.
    let vertex = said("shaders/simple.vs.wgsl", "@vertex", "@vertex @vertex");
    assert!(vertex.contains("20/20"), "{vertex}");
}

#[test]
fn a_light_that_is_not_set_costs_the_pass_alone_in_bind_groups_of_its_own_too() {
    let said = |unset: &[&str]| {
        let sources = ["student_template", "samples/perfect", "samples/perfect-own-layout"];
        let work = Work::of(&sources);
        // The source of one shader file holds no other.
        for stage in ["simple.vs", "diffuse.fs", "phong.fs"] {
            fs::remove_file(work.folder().join(format!("src/shaders/{stage}.wgsl"))).unwrap();
        }
        for value in unset {
            work.change("renderpasses/simple.rs", value, "[0.0f32; 4]");
        }
        let parts = ["2.1", "2.2", "2.4"].map(|part| ["--part", part]);
        let arguments = [&["work", "--scene", "sphere_phong"][..], parts.as_flattened()].concat();
        work.check(&arguments).1
    };
    let (position, intensity) = ("(view * position).to_array()", "intensity.to_array()");
    for (unset, points, why) in [
        (&[][..], "2.1  5/5", ""),
        (&[intensity], "2.1  4.06/5", "the light's intensity is not set"),
        (&[position, intensity], "2.1  2/5", "the light is not set"),
    ] {
        let out = said(unset);
        assert!(out.contains(points) && out.contains(why), "{unset:?}: {out}");
        assert!(out.contains("2.2  5/5") && out.contains("2.4  25/25"), "{unset:?}: {out}");
    }
}
