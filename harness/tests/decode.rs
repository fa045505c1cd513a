//! Hostile files are decoded in confined children: the answer is what this process would have found,
//! and a child that dies takes nothing with it.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use crate::support::scratch::{Scratch, small_limits, with_decoder};
use crate::support::zip_bytes::{Entry, Zip};
use basecode::exr_io::{ExrLayers, Precision, read_exr, write_exr, write_exr_layers};
use basecode::{Image, Vec3};
use umbra::assignment::Assignment;
use umbra::decode::Decoder;
use umbra::intake::{IntakeError, TreeSpec, scan_source, unpack, validate_submission};
use umbra::process::ProcessLimits;
use umbra::sandbox::Isolation;
use umbra::worker::Supervisor;

fn image(width: usize, height: usize) -> Image {
    let pixel = |i: usize| Vec3::new(i as f32, -1.0 / (i as f32 + 1.0), 0.5);
    let mut pixels: Vec<Vec3> = (0..width * height).map(pixel).collect();
    pixels[0] = Vec3::new(f32::NAN, f32::INFINITY, f32::NEG_INFINITY);
    Image { width, height, pixels }
}

fn bits(image: &Image) -> Vec<[u32; 3]> {
    image.pixels.iter().map(|pixel| pixel.to_array().map(f32::to_bits)).collect()
}

/// A file of the repository's own limits, with some of them changed.
fn limits(change: impl FnOnce(&mut ProcessLimits)) -> ProcessLimits {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let mut limits = Assignment::load(root).unwrap().limits.decode;
    change(&mut limits);
    limits
}

/// A supervisor with full isolation, and the folder of its children.
fn supervisor() -> (tempfile::TempDir, Supervisor) {
    let scratch = tempfile::tempdir().unwrap();
    let supervisor = Supervisor::new(env!("CARGO_BIN_EXE_umbra").into(), scratch.path().into());
    if cfg!(target_os = "linux") {
        assert_eq!(supervisor.isolation.isolation(), Isolation::Full);
    }
    (scratch, supervisor)
}

#[test]
fn images_come_through_bit_by_bit_and_errors_word_by_word() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.exr");
    write_exr(&file, &image(31, 17), Precision::Float, &[]).unwrap();
    let whole = fs::read(&file).unwrap();
    let damaged = |name: &str, change: &dyn Fn(&mut Vec<u8>)| {
        let mut bytes = whole.clone();
        change(&mut bytes);
        let file = folder.path().join(name);
        fs::write(&file, bytes).unwrap();
        file
    };
    let layered = folder.path().join("layers.exr");
    let layers = [("other".to_owned(), image(4, 4))].into();
    let layers = ExrLayers { layers, ..ExrLayers::default() };
    write_exr_layers(&layered, &layers, Precision::Half).unwrap();
    let files: Vec<PathBuf> = vec![
        file,
        layered,
        damaged("empty.exr", &|bytes| bytes.clear()),
        damaged("cut.exr", &|bytes| bytes.truncate(bytes.len() / 2)),
        damaged("text.exr", &|bytes| *bytes = b"hello".to_vec()),
        damaged("noise.exr", &|bytes| bytes[40..300].fill(0xa5)),
        folder.path().join("missing.exr"),
    ];
    with_decoder(|decoder| {
        for file in &files {
            let name = format!("offline/{}", file.file_name().unwrap().to_string_lossy());
            match (decoder.image(file, &name), read_exr(file)) {
                (Ok(Ok(apart)), Ok(own)) => {
                    assert_eq!((apart.width, apart.height), (own.width, own.height));
                    assert_eq!(bits(&apart), bits(&own), "{name}");
                }
                (Ok(Err(apart)), Err(own)) => {
                    let own = own.to_string().replace(&file.display().to_string(), &name);
                    assert_eq!(apart, own);
                }
                // A file that is not there is nobody's to decode.
                (Err(_), Err(_)) => assert!(name.contains("missing")),
                (apart, own) => panic!("{name}: {apart:?}, {own:?}"),
            }
        }
    });
}

#[test]
fn a_submission_is_received_as_it_would_be_read_here() {
    let source = "fn f() { unsafe { std::process::abort() } }";
    let archive = Zip::of([
        Entry::deflated("a2/config.json", b"{ \"firstName\": 3, "),
        Entry::deflated("a2/src/lib.rs", source.as_bytes()),
        Entry::deflated("a2/.DS_Store", b"junk"),
    ]);
    let (place, tree) = (Scratch::new(), TreeSpec::default());
    let file = place.root.path().join("a2.zip");
    fs::write(&file, archive.bytes()).unwrap();
    let here = Scratch::new();
    let own = unpack(&file, &here.dest, &tree, &small_limits()).unwrap();
    let received =
        with_decoder(|decoder| decoder.receive(&file, &place.dest, &tree, &small_limits()));
    let received = received.ok().unwrap();
    assert_eq!(received.validation, validate_submission(&own, &tree).unwrap());
    assert_eq!(received.source, scan_source(&own).unwrap());
    assert!(!received.validation.conforms && !received.source.is_empty());
    assert_eq!(received.submission.files, own.files);
    assert_eq!(received.submission.findings, own.findings);
    assert_eq!(received.submission.root, place.dest.join("a2"));
    assert_eq!(fs::read_to_string(place.dest.join("a2/src/lib.rs")).unwrap(), source);
}

/// Each limit ends the child, is named, and the next file is decoded as if nothing had been.
#[test]
fn a_decoder_that_dies_refuses_its_file_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let (large, small) = (folder.path().join("large.exr"), folder.path().join("small.exr"));
    write_exr(&large, &image(2048, 2048), Precision::Half, &[]).unwrap();
    write_exr(&small, &image(3, 2), Precision::Half, &[]).unwrap();
    let archive = Zip::of([Entry::deflated("config.json", &vec![7; 3 << 20])]).bytes();
    let (scratch, supervisor) = supervisor();
    let never = AtomicBool::new(false);
    for (limits, how) in [
        (limits(|limits| limits.memory_mib = 48), "out of memory"),
        (limits(|limits| limits.file_size_mib = 1), "wrote a larger file than is allowed"),
        (limits(|limits| limits.wall_s = 0.0), "ran out of time"),
    ] {
        let decoder = Decoder::new(&supervisor, &limits, &never);
        let said = decoder.image(&large, "offline/large.exr").unwrap().unwrap_err();
        assert!(said.starts_with("offline/large.exr: "), "{said}");
        // Where memory ends, the decoder may still be able to say so itself.
        let died = said.starts_with("offline/large.exr: cannot be decoded: its decoder ");
        assert!(died || limits.memory_mib == 48, "{said}");
        assert!(said.contains(how), "{said}");
        if limits.wall_s > 0.0 {
            assert!(decoder.image(&small, "small.exr").unwrap().is_ok());
        }
        // An archive is unpacked before the clock says anything: it counts only while a child stands still.
        if limits.memory_mib > 48 && limits.wall_s > 0.0 {
            let place = Scratch::new();
            let tree = TreeSpec::default();
            let before = place.outside();
            let large = umbra::intake::ArchiveLimits::default();
            let result = decoder.unpack_bytes(&archive, "a.zip", &place.dest, &tree, &large);
            let Err(IntakeError::Refused(refusal)) = result else { panic!("{result:?}") };
            assert_eq!(refusal.findings[0].code, "decoder_ended");
            assert!(refusal.findings[0].message.contains(how), "{refusal:?}");
            assert_eq!(fs::read_dir(&place.dest).unwrap().count(), 0);
            assert_eq!(place.outside(), before);
        }
    }
    assert_eq!(fs::read_dir(scratch.path()).unwrap().count(), 0, "something was left behind");
}

#[test]
fn ctrl_c_is_no_fault_of_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.exr");
    write_exr(&file, &image(3, 2), Precision::Half, &[]).unwrap();
    let (_scratch, supervisor) = supervisor();
    let (limits, cancelled) = (limits(|_| ()), AtomicBool::new(true));
    let decoder = Decoder::new(&supervisor, &limits, &cancelled);
    // It may have ended before anybody looked.
    match decoder.image(&file, "a.exr") {
        Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::Interrupted),
        Ok(result) => assert!(result.is_ok()),
    }
}
