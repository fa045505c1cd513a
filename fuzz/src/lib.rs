//! What must hold of every reader of foreign bytes, whatever it is given. Each function is a fuzz
//! target; `corpus.rs` calls them with the corpus and what is near it.

#[cfg(test)]
mod corpus;
mod judge;

use std::fs;
use std::path::Path;

use basecode::exr_io::{MAX_PIXELS, MAX_SIDE, decode_exr};
use basecode::scene::{Scene, SceneConfig};
use umbra::decode::read_answer;
use umbra::intake::{
    ArchiveLimits, Finding, IntakeError, SubmittedConfig, TreeSpec, scan_source, unpack_bytes,
    validate_submission,
};
use umbra::worker::{SLOT_BYTES, SlotState};

pub use judge::judge;

/// Small, so that bombs are small.
const LIMITS: ArchiveLimits = ArchiveLimits {
    max_entries: 64,
    max_total_mib: 4,
    max_file_mib: 2,
    max_ratio: 100,
    ratio_from_mib: 1,
    max_depth: 6,
    max_path_bytes: 120,
};

/// What is said names a line of the text, and acts on no terminal.
fn check_findings(findings: &[Finding], text: &[u8]) {
    let lines = text.iter().filter(|byte| **byte == b'\n').count() as u32 + 1;
    for finding in findings {
        assert!(finding.line.is_none_or(|line| (1..=lines).contains(&line)), "{finding:?}");
        assert!(!finding.to_string().chars().any(char::is_control), "{finding:?}");
    }
}

/// An archive: what is unpacked is what is listed, and a refused one leaves nothing.
pub fn archive(bytes: &[u8]) {
    let place = tempfile::tempdir().expect("a folder");
    let (dest, tree) = (place.path().join("dest"), TreeSpec::default());
    fs::create_dir(&dest).expect("a folder");
    match unpack_bytes(bytes, "a.zip", &dest, &tree, &LIMITS) {
        Ok(submission) => {
            let mut total = 0;
            for file in &submission.files {
                let path = submission.root.join(&file.path);
                assert!(path.starts_with(&dest) && !file.path.contains(".."), "{file:?}");
                let found = path.symlink_metadata().expect("a listed file is there");
                assert!(found.is_file() && found.len() == file.bytes, "{file:?}");
                total += file.bytes;
            }
            assert!(total <= LIMITS.max_total_mib << 20);
            assert!(submission.files.len() as u64 <= LIMITS.max_entries);
            validate_submission(&submission, &tree).expect("the copy can be read");
            scan_source(&submission).expect("the copy can be read");
        }
        Err(IntakeError::Refused(refusal)) => {
            assert!(!refusal.findings.is_empty());
            check_findings(&refusal.findings, b"");
            assert_eq!(fs::read_dir(&dest).expect("a folder").count(), 0);
        }
        Err(error) => panic!("{error}"),
    }
    let around = fs::read_dir(place.path()).expect("a folder").count();
    assert_eq!(around, 1, "something beside the destination");
}

/// The `config.json` of a submission.
pub fn config(bytes: &[u8]) {
    let (config, findings, _) = SubmittedConfig::parse(bytes);
    check_findings(&findings, bytes);
    let _ = config.sampler_seed();
}

/// An EXR image: its size is within the limits and its pixels are all there.
pub fn exr(bytes: &[u8]) {
    let Ok(content) = decode_exr(bytes, Path::new("a.exr")) else { return };
    for image in content.layers.values() {
        assert!(image.width.max(image.height) <= MAX_SIDE);
        assert!(image.width * image.height <= MAX_PIXELS);
        assert_eq!(image.pixels.len(), image.width * image.height);
    }
}

/// The TOML file of a scene.
pub fn toml(bytes: &[u8]) {
    if let Ok(config) = SceneConfig::parse(Path::new("a.toml"), bytes) {
        assert!(config.width > 0 && config.height > 0 && config.spp > 0);
    }
}

/// The mesh of a scene, with the materials of `MTL`.
pub fn obj(bytes: &[u8]) {
    scene(bytes, MTL);
}

/// The materials of a scene, with the mesh of `OBJ`.
pub fn mtl(bytes: &[u8]) {
    scene(OBJ, bytes);
}

const TOML: &[u8] = b"[input]\nobjfile = \"a.obj\"\n";
const OBJ: &[u8] = b"mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\no one\nusemtl a\n\
    f 1/1/1 2/1/1 3/1/1\no two\nusemtl b\nf 1 2 3\n";
const MTL: &[u8] = b"newmtl a\nKd 0.5 0.5 0.5\nillum 7\nnewmtl b\nKe 1 1 1\nKd 0 0 0\nillum 7\n";

/// Every triangle of a scene that loads has corners and a material, and rays find their way.
fn scene(obj: &[u8], mtl: &[u8]) {
    let folder = tempfile::tempdir().expect("a folder");
    for (name, bytes) in [("a.toml", TOML), ("a.obj", obj), ("a.mtl", mtl)] {
        fs::write(folder.path().join(name), bytes).expect("our own folder");
    }
    struct Black;
    impl basecode::Bsdf for Black {
        fn eval(&self, _: &basecode::SurfaceInteraction) -> basecode::Vec3 {
            basecode::Vec3::ZERO
        }
    }
    let Ok(scene) = Scene::load(&folder.path().join("a.toml"), &|_| Box::new(Black)) else {
        return;
    };
    for (index, shape) in scene.shapes().iter().enumerate() {
        scene.material_of(index);
        for primitive in 0..shape.triangles.len() {
            shape.corners(primitive);
        }
    }
    let camera = scene.camera(4, 3).expect("the camera of an empty file");
    for pixel in 0..12 {
        let ray = camera.ray((pixel % 4) as f32 + 0.5, (pixel / 4) as f32 + 0.5);
        if let Some(hit) = scene.intersect(&ray) {
            scene.bsdf(&hit);
        }
    }
}

/// What workers and decoders leave for their parent.
pub fn worker(bytes: &[u8]) {
    let mut record = [0; SLOT_BYTES];
    for chunk in bytes.chunks(SLOT_BYTES) {
        record[..chunk.len()].copy_from_slice(chunk);
        if let SlotState::Answered { message, seconds, .. } = SlotState::parse(&record) {
            assert!(message.chars().count() <= SLOT_BYTES && seconds >= 0.0 && seconds.is_finite());
        }
    }
    if let Some((_, content)) = read_answer(bytes.to_vec()) {
        assert!(content.len() < bytes.len());
    }
}
