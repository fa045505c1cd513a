//! Archives that real programs made of one small submission: each is read as that program meant it, and
//! `--fix` makes a plain one of it. How they were made stands in `fixtures/README.md`.

use std::path::{Path, PathBuf};

use crate::support::scratch::{Scratch, with_decoder};
use umbra::intake::{ArchiveLimits, Severity, TreeSpec, fix, unpack};

/// What is to be said of an archive besides that it is right.
const SAID: [(&str, &str); 6] = [
    ("backslashes.zip", "zip_backslash"),
    ("bsdtar-padded.zip", "zip_padding"),
    ("gzip-zeros.tar.gz", "gz_padding"),
    ("prefixed.zip", "zip_data_before"),
    ("self-extracting.zip", "zip_data_before"),
    ("trailing.zip", "zip_data_after"),
];

fn fixtures() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/archives");
    let mut files: Vec<PathBuf> =
        folder.read_dir().unwrap().map(|file| file.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 25, "{}", files.len());
    files
}

#[test]
fn every_archive_is_read_as_it_was_meant_and_mended_to_a_plain_one() {
    let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
    let mut digests = Vec::new();
    for path in fixtures() {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let scratch = Scratch::new();
        let received =
            with_decoder(|decoder| decoder.receive(&path, &scratch.dest, &tree, &limits));
        let received = received.unwrap_or_else(|error| panic!("{name}: {error}"));
        assert!(received.validation.conforms, "{}", received.validation.to_text());
        let said = received.validation.findings.iter().map(|finding| finding.code.as_str());
        let said: Vec<&str> = said.filter(|code| *code != "wrapped").collect();
        let expected = SAID.iter().filter(|(file, _)| *file == name).map(|(_, code)| *code);
        assert_eq!(said, expected.collect::<Vec<_>>(), "{name}");
        assert_eq!(received.submission.files.len(), 6, "{name}");
        digests.push(received.submission.digest.clone());

        let out = scratch.root.path().join("out.zip");
        fix(&received.submission, &out, &tree, &limits).unwrap();
        let plain = Scratch::new();
        let mended = unpack(&out, &plain.dest, &tree, &limits).unwrap();
        assert_eq!(mended.findings, [], "{name}");
        assert_eq!(mended.digest, received.submission.digest, "{name}");
    }
    assert!(digests.iter().all(|digest| *digest == digests[0]), "{digests:?}");
}

/// A submission of 2019: the course's renderer in C++ and its config.json.
#[test]
fn a_submission_of_2019_lacks_nothing_but_the_language() {
    let path =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/a2_fern_gleamton_2019.zip");
    let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
    let scratch = Scratch::new();
    let (validation, images) = with_decoder(|decoder| {
        let received = decoder.receive(&path, &scratch.dest, &tree, &limits).unwrap();
        let images = decoder.image_findings(&received.submission, &tree, &|_| None).unwrap();
        (received.validation, images)
    });
    let validation = validation.with(images);
    let findings: Vec<_> =
        validation.findings.iter().filter(|f| f.severity != Severity::Note).collect();
    assert_eq!(findings.len(), 1, "{}", validation.to_text());
    assert_eq!(
        findings[0].to_string(),
        "error: src/lib.rs: expected a renderer in Rust, found none; 6 files look like C++ (hint: the renderer \
         must be written in Rust: start from the template)"
    );
    let config = validation.config.unwrap();
    assert_eq!(config.sampler_seed(), Some(260_019_061));
    assert_eq!(config.first_name.unwrap().text, "Fern");
    assert_eq!(config.last_name.unwrap().text, "Gleamton");
    assert_eq!(config.renders.len(), 5);
}
