//! Submissions that are right, nearly right and wrong in the usual ways: copies, validation as a
//! student reads it, packing and fixing.

mod copies;
mod packing;
mod validation;

use std::fs;
use std::path::Path;

use umbra::intake::{
    ArchiveLimits, Finding, IntakeError, Submission, TreeSpec, Validation, unpack_bytes,
    validate_refusal,
};

use crate::support::scratch::{Scratch, with_decoder};
use crate::support::tar_bytes::{self, tar};
use crate::support::zip_bytes::{Entry, Zip};

const CONFIG: &str = r#"{
  "firstName": "Ada",
  "lastName": "Lampglow",
  "studentID": "260123456",
  "renders": [
    { "scene": "Teapot", "render": "offline/teapot_simple_offline.exr" },
    { "scene": "Cornell box", "render": "offline/cbox_simple_offline.exr" },
    { "scene": "Teapot, realtime", "render": "realtime/teapot_simple_realtime.exr" },
    { "scene": "Cornell box, realtime", "render": "realtime/cbox_simple_realtime.exr" }
  ]
}
"#;

/// The files of a perfect submission; the images are no EXRs, which intake does not look at.
fn perfect() -> Vec<(String, Vec<u8>)> {
    let image = |path: &str| (path.to_owned(), path.as_bytes().to_vec());
    vec![
        ("config.json".to_owned(), CONFIG.as_bytes().to_vec()),
        image("offline/cbox_simple_offline.exr"),
        image("offline/teapot_simple_offline.exr"),
        image("realtime/cbox_simple_realtime.exr"),
        image("realtime/teapot_simple_realtime.exr"),
        ("src/bsdfs/phong.rs".to_owned(), b"pub struct Phong;\n".to_vec()),
        ("src/lib.rs".to_owned(), b"mod bsdfs;\n".to_vec()),
        ("src/shaders/phong.wgsl".to_owned(), b"// phong\n".to_vec()),
    ]
}

fn zip_of(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    Zip::of(files.iter().map(|(name, content)| Entry::deflated(name, content))).bytes()
}

fn tar_of(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    let entries: Vec<_> =
        files.iter().map(|(name, content)| tar_bytes::Entry::file(name, content)).collect();
    tar(&entries)
}

fn write_folder(folder: &Path, files: &[(String, Vec<u8>)]) {
    for (name, content) in files {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, content).unwrap();
    }
}

/// Each path moved by `change`; `None` drops the file.
fn moved(change: impl Fn(&str) -> Option<String>) -> Vec<(String, Vec<u8>)> {
    perfect().into_iter().filter_map(|(name, content)| Some((change(&name)?, content))).collect()
}

fn codes(findings: &[Finding]) -> Vec<String> {
    findings.iter().map(|f| format!("{} {}", f.code, f.path.as_deref().unwrap_or("-"))).collect()
}

fn validate_bytes(bytes: &[u8], name: &str) -> Validation {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    validate(&path).unwrap()
}

/// As `umbra validate` does.
fn validate(source: &Path) -> Result<Validation, IntakeError> {
    let copy = tempfile::tempdir().unwrap();
    let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
    match with_decoder(|decoder| decoder.receive(source, copy.path(), &tree, &limits)) {
        Ok(received) => Ok(received.validation),
        Err(IntakeError::Refused(refusal)) => Ok(validate_refusal(&refusal)),
        Err(error) => Err(error),
    }
}

fn validate_files(files: &[(String, Vec<u8>)]) -> Validation {
    validate_bytes(&zip_of(files), "a2_ada_lampglow.zip")
}

/// A copy, whatever is to be said of it.
fn accepted(files: &[(String, Vec<u8>)]) -> (Submission, Scratch) {
    let scratch = Scratch::new();
    let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
    (unpack_bytes(&zip_of(files), "a.zip", &scratch.dest, &tree, &limits).unwrap(), scratch)
}
