//! The student's template beside the reference: the same files, the same stages.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use basecode::gpu::{AdapterKind, EMITTER_FS, Gpu, Stage};

fn source(package: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(package).join("src")
}

/// All files under a folder, by their path in it.
fn files(root: &Path) -> BTreeSet<PathBuf> {
    let mut found = BTreeSet::new();
    let mut folders = vec![root.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(root).unwrap().to_owned());
            }
        }
    }
    found
}

#[test]
fn the_template_has_the_files_of_the_reference() {
    let mut reference = files(&source("reference_impl"));
    let own = ["tests", "mistakes", "mistakes.rs"];
    reference.retain(|path| !own.iter().any(|own| path.starts_with(own)));
    assert_eq!(files(&source("student_template")), reference);
}

#[test]
fn the_template_is_kept_as_it_was_handed_out() {
    let own = source("student_template");
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("../expected/a2/template");
    let hint =
        "hint: after a change of the template, `cp -r student_template/src/. expected/a2/template`";
    assert_eq!(files(&own), files(&kept), "{hint}");
    for file in files(&own) {
        let text = |folder: &Path| std::fs::read_to_string(folder.join(&file)).unwrap();
        assert_eq!(text(&own), text(&kept), "{}: {hint}", file.display());
    }
}

#[test]
fn the_previous_assignment_is_solved_alike() {
    for file in [
        "integrators/normal.rs",
        "renderpasses/normal.rs",
        "shaders/normal.vs.wgsl",
        "shaders/normal.fs.wgsl",
    ] {
        let text = |package| std::fs::read_to_string(source(package).join(file)).unwrap();
        assert_eq!(text("student_template"), text("reference_impl"), "{file}");
    }
}

#[test]
fn every_task_is_marked_in_the_template() {
    for (file, task, stub) in [
        ("renderer.rs", "before you start", "Sampler::new(job.seed)"),
        ("bsdfs/diffuse.rs", "1.1", "todo!(\"1.1 "),
        ("bsdfs/phong.rs", "1.2", "todo!(\"1.2 "),
        ("integrators/simple.rs", "1.3", "todo!(\"1.3 "),
        ("integrators/simple.rs", "1.4", "todo!(\"1.4 "),
        ("renderpasses/simple.rs", "2.1", "todo!(\"2.1 "),
        ("shaders/simple.vs.wgsl", "2.2", "return out;"),
        ("shaders/diffuse.fs.wgsl", "2.3", "return vec4f(0.0, 0.0, 0.0, 1.0);"),
        ("shaders/phong.fs.wgsl", "2.4", "return vec4f(0.0, 0.0, 0.0, 1.0);"),
        ("renderpasses/shadow.rs", "2.5", "Error::NotImplemented(\"2.5 "),
    ] {
        let text = std::fs::read_to_string(source("student_template").join(file)).unwrap();
        assert!(text.contains(&format!("TODO(A2) {task}")), "{file} lacks TODO(A2) {task}");
        assert!(text.contains(stub), "{file} lacks {stub}");
    }
}

#[test]
fn the_stages_of_reference_and_template_fit_the_contract() {
    let gpu = Gpu::open(AdapterKind::Any, "").expect("these tests need a graphics adapter");
    for package in ["reference_impl", "student_template"] {
        let folder = source(package).join("shaders");
        let mut vertex = Vec::new();
        let mut fragment = vec![(EMITTER_FS.name.to_owned(), EMITTER_FS.text.to_owned())];
        for file in files(&folder) {
            let name = file.to_str().unwrap().strip_suffix(".wgsl").unwrap().to_owned();
            let text = std::fs::read_to_string(folder.join(&file)).unwrap();
            if name.ends_with(".vs") {
                vertex.push((name, text));
            } else {
                fragment.push((name, text));
            }
        }
        assert_eq!((vertex.len(), fragment.len()), (3, 4), "{package}");
        for (name, text) in &vertex {
            let vertex = Stage { name, text };
            gpu.checked(&mut || Ok(gpu.depth_pipeline(vertex))).unwrap();
            for (name, text) in fragment.iter().filter(|_| vertex.name != "shadow.vs") {
                gpu.checked(&mut || Ok(gpu.pipeline(vertex, Stage { name, text }))).unwrap();
            }
        }
    }
}
