//! Packing and fixing.

use std::fs;
use std::path::{Path, PathBuf};

use similar_asserts::assert_eq;
use umbra::intake::{
    ArchiveLimits, IntakeError, Submission, TreeSpec, Validation, fix, pack, scan_source, unpack,
    unpack_bytes, validate_submission,
};

use super::{
    CONFIG, accepted, codes, moved, perfect, tar_of, validate, validate_bytes, validate_files,
    write_folder, zip_of,
};
use crate::support::scratch::{Scratch, assert_accepted, listing};
use crate::support::tar_bytes::gz;

pub(super) fn pack_in(
    folder: &Path,
    files: &[(String, Vec<u8>)],
) -> Result<umbra::intake::Packed, IntakeError> {
    let source = folder.join("work");
    write_folder(&source, files);
    pack(&source, folder, &TreeSpec::default(), &ArchiveLimits::default())
}

/// The working folder of a student: everything that does not belong into a submission, too.
pub(super) fn working_folder() -> Vec<(String, Vec<u8>)> {
    let mut files = perfect();
    for extra in [
        "Cargo.toml",
        "README.md",
        "target/release/libstudent.so",
        "src/.DS_Store",
        "src/target/release/x.o",
        "data/a2/teapot.toml",
        "offline/old.exr",
        ".git/HEAD",
        "node/deep/er/than/the/limit/of/a/path/a/b/c/d/e/f/g/h/i/j",
    ] {
        files.push((extra.to_owned(), b"not part of it".to_vec()));
    }
    files.push(("renders/teapot_bonus.exr".to_owned(), b"bonus".to_vec()));
    files
}

#[test]
fn packed_archives_conform_and_hold_only_what_is_needed() {
    let folder = tempfile::tempdir().unwrap();
    let packed = pack_in(folder.path(), &working_folder()).unwrap();
    assert_eq!(packed.archive, folder.path().join("a2_ada_lampglow.zip"));
    let mut want: Vec<String> = perfect().into_iter().map(|(name, _)| name).collect();
    want.push("realtime/teapot_bonus.exr".to_owned());
    want.sort();
    let names: Vec<String> = packed.files.iter().map(|(_, to)| to.clone()).collect();
    assert_eq!(names, want);
    let validation = validate(&packed.archive).unwrap();
    assert!(validation.conforms);
    assert_eq!(validation, packed.validation);
    // A second reader of zip sees the same.
    let mut archive = zip::ZipArchive::new(fs::File::open(&packed.archive).unwrap()).unwrap();
    let mut theirs: Vec<String> =
        archive.file_names().map(|name| name.unwrap().into_owned()).collect();
    theirs.sort();
    assert_eq!(theirs, want);
    let mut content = String::new();
    std::io::Read::read_to_string(&mut archive.by_name("config.json").unwrap(), &mut content)
        .unwrap();
    assert_eq!(content, CONFIG);
    // Nothing else was written.
    let beside: Vec<PathBuf> =
        listing(folder.path()).into_keys().filter(|p| p.parent() == Some(folder.path())).collect();
    assert_eq!(beside, [packed.archive]);
}

#[test]
fn packing_twice_gives_the_same_bytes() {
    let archives = [0, 1].map(|_| {
        let folder = tempfile::tempdir().unwrap();
        fs::read(pack_in(folder.path(), &working_folder()).unwrap().archive).unwrap()
    });
    assert!(archives[0] == archives[1]);
}

fn refusal_codes(result: Result<umbra::intake::Packed, IntakeError>) -> Vec<String> {
    match result {
        Err(IntakeError::Refused(refusal)) => codes(&refusal.findings),
        other => panic!("expected a refusal, found {other:?}"),
    }
}

#[test]
fn pack_refuses_what_would_not_conform() {
    let folder = tempfile::tempdir().unwrap();
    let files = moved(|path| (path != "offline/cbox_simple_offline.exr").then(|| path.to_owned()));
    let result = pack_in(folder.path(), &files);
    assert_eq!(refusal_codes(result), ["tree_missing offline/cbox_simple_offline.exr"]);
    let folder = tempfile::tempdir().unwrap();
    let mut files = perfect();
    files[0].1 = CONFIG.replace("260123456", "not yet").into_bytes();
    assert_eq!(refusal_codes(pack_in(folder.path(), &files)), ["config_student_id config.json"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "only the working folder");
}

pub(super) fn fix_files(files: &[(String, Vec<u8>)]) -> Result<Submission, IntakeError> {
    let folder = tempfile::tempdir().unwrap();
    let (source, out) = (folder.path().join("in.zip"), folder.path().join("out.zip"));
    fs::write(&source, zip_of(files)).unwrap();
    let copy = Scratch::new();
    let source = unpack(&source, &copy.dest, &TreeSpec::default(), &ArchiveLimits::default())?;
    let result = fix(&source, &out, &TreeSpec::default(), &ArchiveLimits::default());
    assert_eq!(result.is_ok(), out.exists());
    result?;
    let scratch = Scratch::new();
    let submission = unpack(&out, &scratch.dest, &TreeSpec::default(), &ArchiveLimits::default())?;
    assert!(validate_submission(&submission, &TreeSpec::default())?.follows_tree());
    Ok(submission)
}

#[test]
fn fix_mends_levels_folders_aliases_and_junk() {
    let digest = fix_files(&perfect()).unwrap().digest;
    let stray = |mut files: Vec<(String, Vec<u8>)>| {
        files.push(("Text.txt".to_owned(), b"x".to_vec()));
        files.push(("__MACOSX/._x".to_owned(), b"x".to_vec()));
        files
    };
    for (what, files) in [
        ("two folders around it", moved(|path| Some(format!("a/b/{path}")))),
        ("a stray file beside the wrapping folder", stray(moved(|path| Some(format!("a/{path}"))))),
        (
            "the source flat",
            moved(|path| Some(path.strip_prefix("src/").unwrap_or(path).to_owned())),
        ),
        ("the source elsewhere", moved(|path| Some(path.replace("src/", "code/rust/")))),
        (
            "other case",
            moved(|path| Some(path.replace("src/", "Src/").replace("offline/", "Offline/"))),
        ),
        (
            "images at the root",
            moved(|path| Some(path.replace("offline/", "").replace("realtime/", ""))),
        ),
        ("inside a folder named src", moved(|path| Some(format!("src/{path}")))),
        ("src/src", moved(|path| Some(path.replace("src/", "src/src/")))),
        ("src/src/src", moved(|path| Some(path.replace("src/", "src/src/src/")))),
        ("a crate in src", moved(|path| Some(path.replace("src/", "src/student_template/src/")))),
        ("capitals", moved(|path| Some(path.to_uppercase()))),
        ("capitals in a folder", moved(|path| Some(format!("A/B/{path}").to_uppercase()))),
        ("shaders in Src", moved(|path| Some(path.replace("src/shaders", "Src/shaders")))),
        ("shaders in SRC", moved(|path| Some(path.replace("src/shaders", "SRC/shaders")))),
        ("half in Src", moved(|path| Some(path.replace("src/lib", "Src/lib")))),
        (
            "half in Src, in a folder",
            stray(moved(|path| Some(format!("a/{}", path.replace("src/bsdfs", "Src/bsdfs"))))),
        ),
        ("lib.rs beside src", moved(|path| Some(path.replace("src/lib.rs", "lib.rs")))),
        (
            "lib.rs beside src, in a folder",
            stray(moved(|path| Some(format!("a/{}", path.replace("src/lib.rs", "lib.rs"))))),
        ),
        (
            "a copy of lib.rs elsewhere",
            moved(|path| {
                Some(path.replace("src/lib.rs", "code/lib (1).rs").replace("src/", "code/"))
            }),
        ),
        ("the whole kit", kit(true)),
        ("half the kit", kit(false)),
    ] {
        match fix_files(&files) {
            Ok(submission) => assert_eq!(submission.digest, digest, "{what}"),
            Err(error) => panic!("{what}: {error}"),
        }
    }
    let mut files = perfect();
    files.push(("renders/cbox_bonus.exr".to_owned(), b"bonus".to_vec()));
    let submission = fix_files(&files).unwrap();
    assert!(submission.file("realtime/cbox_bonus.exr").is_some());
}

/// A submission in the kit that students get, with the kit's own configuration at the root or not.
fn kit(whole: bool) -> Vec<(String, Vec<u8>)> {
    let mut files = moved(|path| Some(format!("student_template/{path}")));
    for own in ["harness/basecode/src/lib.rs", "harness/api/src/lib.rs", "harness/api/src/x.rs"] {
        files.push((own.to_owned(), b"// not the student's".to_vec()));
    }
    if whole {
        files.push(("config.json".to_owned(), br#"{"name": "a2", "title": "A"}"#.to_vec()));
    }
    files
}

#[test]
fn no_source_is_lost_quietly() {
    let mut files = moved(|path| Some(path.replace("offline/cbox", "cbox")));
    files.push(("shaders/x.wgsl".to_owned(), b"// x".to_vec()));
    let text = validate_files(&files).to_text();
    assert!(text.contains("shaders/x.wgsl: a source file outside src/"), "{text}");
    let (submission, scratch) = accepted(&files);
    let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
    let validation = validate_submission(&submission, &tree).unwrap();
    let said = umbra::intake::mends(&submission, &validation, &tree).unwrap();
    assert!(said.ends_with("; leaves out 1 source file outside src/"), "{said}");
    let out = scratch.root.path().join("out.zip");
    let packed = fix(&submission, &out, &tree, &limits).unwrap();
    assert_eq!(packed.left_out, ["shaders/x.wgsl"]);
    // A second time it would be written over.
    let written = fs::read(&out).unwrap();
    let again = fix(&submission, &out, &tree, &limits).unwrap_err().to_string();
    assert!(again.contains("cannot write") && fs::read(&out).unwrap() == written, "{again}");
    // Two files for one place.
    let mut files = perfect();
    files.push(("Src/shaders/phong.wgsl".to_owned(), b"// another".to_vec()));
    let said = fix_files(&files).unwrap_err().to_string();
    assert!(said.contains("'Src/shaders/phong.wgsl'") && said.contains("'src/shaders/phong.wgsl'"));
}

#[test]
fn a_build_folder_in_an_archive_does_not_count() {
    let mut files = perfect();
    for i in 0..5000 {
        files.push((format!("target/debug/deps/{i}.o"), Vec::new()));
        files.push((format!(".git/objects/{i}"), Vec::new()));
    }
    for bytes in [zip_of(&files), gz(&tar_of(&files))] {
        let (submission, _scratch) = {
            let scratch = Scratch::new();
            let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
            (unpack_bytes(&bytes, "a.zip", &scratch.dest, &tree, &limits).unwrap(), scratch)
        };
        assert_eq!(submission.files.len(), perfect().len());
    }
    assert!(fix_files(&files).is_ok());
    // The limit on what counts stands.
    files.extend((0..4000).map(|i| (format!("src/{i}.rs"), Vec::new())));
    let said = fix_files(&files).unwrap_err().to_string();
    assert!(said.contains("more than 4000 entries"), "{said}");
}

#[test]
fn what_is_no_archive_is_called_what_it_is() {
    for (bytes, said) in [
        (vec![0; 5000], "the file holds only zeros (5000 bytes)"),
        (vec![0; 10240], "the file holds only zeros (10240 bytes)"),
        ([vec![0; 600], b"x".to_vec()].concat(), "found something else"),
        ("\u{feff}<!DOCTYPE html>".into(), "found a web page"),
        ("\n  <html>".into(), "found a web page"),
        ("<!-- x --><html>".into(), "found a web page"),
        ("\u{feff}<html>".encode_utf16().flat_map(u16::to_le_bytes).collect(), "found a web page"),
        (b"%PDF-1.7".to_vec(), "found a PDF"),
    ] {
        let text = validate_bytes(&bytes, "z.zip").to_text();
        assert!(text.contains(said) && !text.contains("tar archive,"), "{text}");
    }
}

#[test]
fn fix_refuses_what_moving_cannot_mend() {
    let codes_of = |files: &[(String, Vec<u8>)]| match fix_files(files) {
        Err(IntakeError::Refused(refusal)) => codes(&refusal.findings),
        other => panic!("expected a refusal, found {other:?}"),
    };
    let no_source = moved(|path| (!path.starts_with("src/")).then(|| path.to_owned()));
    assert_eq!(codes_of(&no_source), ["tree_missing src/lib.rs"]);
    // Somebody else's words are not for us to mend, but the tree is.
    let mut nobody = moved(|path| Some(format!("a/b/{path}")));
    nobody[0].1 = CONFIG.replace("260123456", "not yet").into_bytes();
    assert_eq!(fix_files(&nobody).unwrap().digest.len(), 64);
}

#[test]
fn what_fixing_would_do_is_said_in_words() {
    let said = |files: &[(String, Vec<u8>)]| {
        let (submission, _scratch) = accepted(files);
        let validation = validate_submission(&submission, &TreeSpec::default()).unwrap();
        umbra::intake::mends(&submission, &validation, &TreeSpec::default())
    };
    assert_eq!(said(&perfect()), None);
    let elsewhere = moved(|path| Some(path.replace("src/", "code/")));
    assert_eq!(
        said(&elsewhere).unwrap(),
        "moves code/bsdfs/phong.rs to src/bsdfs/phong.rs, and 2 more"
    );
    let one = moved(|path| Some(path.replace("offline/cbox", "cbox")));
    let one = said(&one).unwrap();
    assert_eq!(one, "moves cbox_simple_offline.exr to offline/cbox_simple_offline.exr");
    let lost = moved(|path| (!path.starts_with("src/")).then(|| path.to_owned()));
    assert_eq!(said(&lost), None);
}

#[test]
fn a_slip_in_the_config_is_a_warning_and_the_tree_is_as_it_is() {
    let bom = format!("\u{feff}{CONFIG}");
    let utf16: Vec<u8> = bom.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let swapped = |from: &str, to: &str| CONFIG.replace(from, to).into_bytes();
    let mut names = Vec::new();
    for (what, config) in [
        ("bom", bom.clone().into_bytes()),
        ("UTF-16", utf16),
        ("Latin-1", [b"{ // \xe9t\xe9\n".as_slice(), &CONFIG.as_bytes()[1..]].concat()),
        ("comma at the end", swapped("exr\" }\n  ]", "exr\" },\n  ],")),
        ("no comma", swapped("\"Lampglow\",", "\"Lampglow\"")),
        ("single quotes", swapped("\"", "'")),
        ("curly quotes", swapped("\"Ada\"", "\u{201c}Ada\u{201d}")),
        ("comment", swapped("\"Ada\",", "\"Ada\", // my name")),
        ("spaces in the number", swapped("260123456", "260 123 456")),
        ("a number", swapped("\"260123456\"", "260 123 456")),
        ("slips of the pen", swapped("firstName", "fristName")),
        ("a missing brace", swapped("]\n}", "]")),
        ("no name", swapped("\"Ada\"", "\"\"")),
        ("the template's name", swapped("\"Ada\"", "\"First\"")),
        ("an image that is not there", swapped("teapot_simple_offline.exr\"", "teapot.exr\"")),
        ("a backslash", swapped("offline/cbox", "offline\\\\cbox")),
        ("no list", swapped("\"renders\"", "\"x\"")),
        ("dots in the number", swapped("260123456", "260.123.456")),
        ("a letter before the number", swapped("260123456", "A260123456")),
        ("words around the number", swapped("260123456", "ID: 260123456 (McGill)")),
        ("a spreadsheet's number", swapped("\"260123456\"", "2.60123456e8")),
        ("a list", swapped("\"260123456\"", "[\"260123456\"]")),
        ("an object", swapped("\"260123456\"", "{\"number\": 260123456}")),
        ("wide digits", swapped("260123456", "\u{ff12}60123456")),
        ("UTF-32", CONFIG.chars().flat_map(|c| u32::from(c).to_le_bytes()).collect()),
        ("a slash before", swapped("offline/cbox", "/offline/cbox")),
        ("a tab for a backslash", swapped("offline/teapot", "offline\\teapot")),
        ("another machine's path", swapped("offline/cbox", "C:/Users/ada/a2/offline/cbox")),
    ] {
        let mut files = perfect();
        files[0].1 = config;
        let validation = validate_files(&files);
        let text = validation.to_text();
        assert!(validation.conforms && validation.follows_tree(), "{what}: {text}");
        assert!(
            text.contains("0 errors") && text.contains("warning: config.json:"),
            "{what}: {text}"
        );
        let config = validation.config.unwrap();
        assert_eq!(config.sampler_seed(), Some(260_123_456), "{what}");
        names.push(config.last_name.map(|field| field.text));
    }
    assert!(names.iter().all(|name| name.as_deref() == Some("Lampglow")), "{names:?}");
    // Without a number nobody knows whose it is; the tree is right all the same.
    for config in ["", "nothing of the kind", "{}", "\0\0\0", "{\"studentID\": \"260000000\"}"] {
        let mut files = perfect();
        files[0].1 = config.as_bytes().to_vec();
        let validation = validate_files(&files);
        assert!(
            !validation.conforms && validation.follows_tree(),
            "{config}: {}",
            validation.to_text()
        );
    }
}

#[test]
fn source_rules_name_file_and_line() {
    let mut files = perfect();
    files.push(("src/build.rs".to_owned(), b"fn main() {}".to_vec()));
    files.push((
        "src/evil.rs".to_owned(),
        b"// unsafe\nfn f() {\n  unsafe { std::process::exit(0) }\n}\n".to_vec(),
    ));
    let (submission, _scratch) = assert_accepted(&zip_of(&files), "a.zip", "");
    let found: Vec<String> =
        scan_source(&submission).unwrap().iter().map(ToString::to_string).collect();
    assert_eq!(
        found,
        [
            "warning: src/evil.rs:3: unsafe code",
            "warning: src/evil.rs:3: std::process",
            "note: src/build.rs: build.rs is submitted, but ours is used",
        ]
    );
}

#[test]
fn submission_and_validation_survive_json() {
    let (submission, _scratch) = assert_accepted(&zip_of(&perfect()), "a.zip", "");
    let text = serde_json::to_string(&submission).unwrap();
    assert_eq!(serde_json::from_str::<Submission>(&text).unwrap(), submission);
    let validation = validate_files(&perfect());
    let text = serde_json::to_string(&validation).unwrap();
    assert_eq!(serde_json::from_str::<Validation>(&text).unwrap(), validation);
}
