//! Submissions that are right, nearly right and wrong in the usual ways: copies, validation as a
//! student reads it, packing and fixing.

use std::fs;
use std::path::{Path, PathBuf};

use crate::support::scratch::{
    Scratch, assert_accepted, assert_folder_refused, listing, with_decoder,
};
use crate::support::tar_bytes::{self, gz, tar};
use crate::support::zip_bytes::{Entry, Zip, crc32, extra};
use similar_asserts::assert_eq;
use umbra::intake::{
    Finding, Format, IntakeError, Limits, Severity, Submission, TreeSpec, Validation, fix, pack,
    scan_source, unpack, unpack_bytes, validate_refusal, validate_submission,
};

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
    let (tree, limits) = (TreeSpec::default(), Limits::default());
    match with_decoder(|decoder| decoder.receive(source, copy.path(), &tree, &limits)) {
        Ok(received) => Ok(received.validation),
        Err(IntakeError::Refused(refusal)) => Ok(validate_refusal(&refusal)),
        Err(error) => Err(error),
    }
}

fn validate_files(files: &[(String, Vec<u8>)]) -> Validation {
    validate_bytes(&zip_of(files), "a2_ada_lampglow.zip")
}

// --- copies ---

#[test]
fn every_format_gives_the_same_copy() {
    let files = perfect();
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("a2_ada_lampglow");
    write_folder(&source, &files);
    let scratch = Scratch::new();
    let from_folder =
        unpack(&source, &scratch.dest, &TreeSpec::default(), &Limits::default()).unwrap();
    assert_eq!(from_folder.format, Format::Folder);
    assert_eq!(from_folder.name, "a2_ada_lampglow");
    assert_eq!(from_folder.findings, []);
    let wrapped = moved(|path| Some(format!("a2_ada_lampglow/{path}")));
    for (bytes, name, format) in [
        (zip_of(&files), "a.zip", Format::Zip),
        (tar_of(&files), "a.tar", Format::Tar),
        (gz(&tar_of(&files)), "a.tar.gz", Format::TarGz),
        (gz(&tar_of(&files)), "a.tgz", Format::TarGz),
        (zip_of(&wrapped), "a.zip", Format::Zip),
        (gz(&tar_of(&wrapped)), "a.tar.gz", Format::TarGz),
    ] {
        let scratch = Scratch::new();
        let submission =
            unpack_bytes(&bytes, name, &scratch.dest, &TreeSpec::default(), &Limits::default())
                .unwrap();
        assert_eq!(submission.format, format);
        assert_eq!(submission.files, from_folder.files);
        assert_eq!(submission.digest, from_folder.digest);
        for (path, content) in &files {
            assert_eq!(&fs::read(submission.root.join(path)).unwrap(), content);
        }
        assert_eq!(listing(&scratch.dest).len(), files.len());
    }
}

#[test]
fn hash_is_sha256_of_the_content() {
    let (submission, _scratch) =
        assert_accepted(&Zip::of([Entry::stored("abc", b"abc")]).bytes(), "a.zip", "");
    // FIPS 180-2, appendix B.1.
    assert_eq!(
        submission.files[0].sha256,
        "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    );
}

#[test]
fn digest_depends_on_paths_and_contents() {
    let digest = |entries: &[(&str, &str)]| {
        let zip =
            Zip::of(entries.iter().map(|(name, content)| Entry::stored(name, content.as_bytes())));
        assert_accepted(&zip.bytes(), "a.zip", "").0.digest
    };
    let base = digest(&[("a", "1"), ("b", "2")]);
    assert_eq!(digest(&[("b", "2"), ("a", "1")]), base);
    for other in [
        digest(&[("a", "2"), ("b", "1")]),
        digest(&[("a", "1"), ("c", "2")]),
        digest(&[("a", "1")]),
    ] {
        assert_ne!(other, base);
    }
}

#[test]
fn one_wrapping_folder_is_noted() {
    let wrapped = moved(|path| Some(format!("a2 Ada/{path}")));
    let (submission, _scratch) = assert_accepted(&zip_of(&wrapped), "a.zip", "wrapped");
    assert_eq!(submission.wrapped_in.as_deref(), Some("a2 Ada"));
    assert!(
        submission.root.ends_with("dest/a2 Ada") && submission.root.join("config.json").is_file()
    );
    assert_eq!(codes(&submission.findings), ["wrapped a2 Ada/"]);
}

#[test]
fn junk_of_macos_and_windows_is_ignored() {
    let mut files = moved(|path| Some(format!("a2/{path}")));
    for junk in [
        "__MACOSX/a2/._config.json",
        "__MACOSX/._a2",
        "a2/.DS_Store",
        "a2/src/._lib.rs",
        "a2/Thumbs.db",
        "a2/offline/desktop.ini",
        "a2/Icon\r",
    ] {
        files.push((junk.to_owned(), b"junk".to_vec()));
    }
    let (from_zip, _a) = assert_accepted(&zip_of(&files), "a.zip", "ignored");
    let (from_tar, _b) = assert_accepted(&tar_of(&files), "a.tar", "ignored");
    assert_eq!(from_zip.files.len(), perfect().len());
    assert_eq!(from_zip.wrapped_in.as_deref(), Some("a2"));
    assert_eq!(from_zip.digest, from_tar.digest);
    assert!(validate_files(&files).conforms);
}

#[test]
fn streamed_zip_of_macos_is_fine() {
    let entries =
        perfect().into_iter().map(|(name, content)| Entry::deflated(&name, &content).streamed());
    assert_accepted(&Zip::of(entries).bytes(), "a.zip", "");
}

#[test]
fn descriptor_without_signature_and_small_zip64_header_are_fine() {
    let mut unsigned = Entry::deflated("config.json", b"{}").streamed();
    unsigned.descriptor.drain(..4);
    let mut large = Entry::stored("a", b"xyz");
    (large.local.packed, large.local.unpacked) = (u32::MAX, u32::MAX);
    large.local.extra = extra(1, &[3, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0, 0]);
    assert_accepted(&Zip::of([unsigned, large]).bytes(), "a.zip", "");
}

#[test]
fn zip_with_folders_comment_and_unicode_names_is_fine() {
    let mut field = vec![1];
    field.extend(crc32(b"src/\x82t\x82.rs").to_le_bytes());
    field.extend("src/été.rs".as_bytes());
    let zip = Zip {
        entries: vec![
            Entry::stored("src/", b"").mode(0o040755),
            Entry::with(b"src/\x82t\x82.rs", 0, b"x".to_vec(), b"x")
                .both(|h| h.extra = extra(0x7075, &field)),
            Entry::stored("été.txt", b"x"),
        ],
        comment: b"made by hand".to_vec(),
        ..Zip::default()
    };
    let (submission, _scratch) = assert_accepted(&zip.bytes(), "a.zip", "");
    let paths: Vec<&str> = submission.files.iter().map(|f| f.path.as_str()).collect();
    assert_eq!(paths, ["src/été.rs", "été.txt"]);
}

#[test]
fn tar_long_names_and_pax_paths_are_fine() {
    use tar_bytes::Entry as Tar;
    let long = format!("src/{}.rs", "n".repeat(105));
    let other = format!("src/{}.rs", "m".repeat(105));
    let entries = [
        Tar::pax(b'g', &[("comment", "0123456789abcdef")]),
        Tar::of(b"./", b'5', b""),
        Tar::of(b"./src/", b'5', b""),
        Tar::long_name(&long),
        Tar::file("truncated", b"x"),
        Tar::pax(b'x', &[("mtime", "1.5"), ("path", &other), ("size", "1")]),
        Tar::file("truncated", b"y"),
        Tar::file("./config.json", b"{}"),
    ];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "");
    let paths: Vec<&str> = submission.files.iter().map(|f| f.path.as_str()).collect();
    assert_eq!(paths, ["config.json", other.as_str(), long.as_str()]);
}

#[test]
fn tar_of_the_tar_crate_is_fine() {
    let mut builder = ::tar::Builder::new(Vec::new());
    for (name, content) in perfect() {
        let mut header = ::tar::Header::new_gnu();
        header.set_size(content.len() as u64);
        header.set_mode(0o644);
        builder.append_data(&mut header, &name, content.as_slice()).unwrap();
    }
    let bytes = builder.into_inner().unwrap();
    let (submission, _scratch) = assert_accepted(&bytes, "a.tar", "");
    assert_eq!(submission.files.len(), perfect().len());
}

#[test]
fn black_images_pack_well_and_are_no_bomb() {
    let mut files = perfect();
    for (name, content) in &mut files {
        if name.ends_with(".exr") {
            *content = vec![0; 800 * 600 * 6];
        }
    }
    let scratch = Scratch::new();
    let tree = TreeSpec::default();
    unpack_bytes(&zip_of(&files), "a.zip", &scratch.dest, &tree, &Limits::default()).unwrap();
    let scratch = Scratch::new();
    unpack_bytes(&gz(&tar_of(&files)), "a.tgz", &scratch.dest, &tree, &Limits::default()).unwrap();
}

#[test]
fn destination_must_be_empty() {
    let scratch = Scratch::new();
    fs::write(scratch.dest.join("mine"), "x").unwrap();
    let result = scratch.unpack(&zip_of(&perfect()), "a.zip", &Limits::default());
    assert!(matches!(result, Err(IntakeError::DestinationNotEmpty { .. })));
    assert_eq!(fs::read_to_string(scratch.dest.join("mine")).unwrap(), "x");
}

#[test]
fn missing_source_is_an_error_of_the_machine() {
    let result = validate(Path::new("/nowhere/a.zip"));
    let message = result.unwrap_err().to_string();
    assert!(message.starts_with("cannot read '/nowhere/a.zip': "), "{message}");
}

// --- folders ---

#[cfg(unix)]
#[test]
fn links_in_a_folder_are_refused() {
    use std::os::unix::fs::symlink;
    let file = |folder: &Path| {
        fs::create_dir(folder.join("src")).unwrap();
        symlink("/etc/passwd", folder.join("src/lib.rs")).unwrap();
    };
    assert_folder_refused(file, "link", "src/lib.rs");
    assert_folder_refused(|folder| symlink("/", folder.join("src")).unwrap(), "link", "src");
    assert_folder_refused(|folder| symlink("nowhere", folder.join("x")).unwrap(), "link", "x");
}

#[cfg(unix)]
#[test]
fn special_files_in_a_folder_are_refused() {
    let socket = |folder: &Path| {
        std::os::unix::net::UnixListener::bind(folder.join("socket")).unwrap();
    };
    assert_folder_refused(socket, "special_file", "socket");
    let fifo = |folder: &Path| {
        nix::unistd::mkfifo(&folder.join("pipe"), nix::sys::stat::Mode::S_IRWXU).unwrap();
    };
    assert_folder_refused(fifo, "special_file", "pipe");
}

#[test]
fn limits_hold_for_folders() {
    let many = |folder: &Path| {
        for i in 0..41 {
            fs::write(folder.join(format!("{i}")), "x").unwrap();
        }
    };
    assert_folder_refused(many, "limit_entries", "");
    assert_folder_refused(
        |folder| fs::create_dir_all(folder.join("1/2/3/4/5/6/7")).unwrap(),
        "limit_depth",
        "1/2/3/4/5/6/7",
    );
    assert_folder_refused(
        |folder| fs::write(folder.join("big"), vec![1; 3 << 20]).unwrap(),
        "limit_file",
        "big",
    );
    assert_folder_refused(|_| (), "empty", "");
}

#[cfg(unix)]
#[test]
fn what_is_no_part_of_the_tree_refuses_no_working_folder() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("work");
    write_folder(&source, &working_folder());
    fs::File::create(source.join("scene.blend")).unwrap().set_len(100 << 20).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("/usr/bin/python3", source.join("python")).unwrap();
    let scratch = Scratch::new();
    let (tree, limits) = (TreeSpec::default(), Limits::default());
    let submission = unpack(&source, &scratch.dest, &tree, &limits).unwrap();
    assert!(submission.file("src/lib.rs").is_some() && submission.file("config.json").is_some());
    let warned = |code: &str, path: &str| {
        let mut found = submission.findings.iter().filter(|finding| finding.code == code);
        let found = found.find(|finding| finding.path.as_deref() == Some(path)).unwrap();
        assert_eq!(found.severity, Severity::Warning);
        assert!(found.message.ends_with("; only what belongs to the tree is read"), "{found}");
    };
    warned("limit_file", "scene.blend");
    // In the tree itself it refuses.
    let large = source.join("src/large.rs");
    fs::File::create(&large).unwrap().set_len(100 << 20).unwrap();
    let scratch = Scratch::new();
    assert!(unpack(&source, &scratch.dest, &tree, &limits).is_err());
}

#[test]
fn fix_chooses_between_neither_images_nor_people() {
    let refused = |more: &[(&str, &[u8])]| {
        let folder = tempfile::tempdir().unwrap();
        let mut files = perfect();
        files.extend(more.iter().map(|(path, content)| ((*path).to_owned(), content.to_vec())));
        let source = folder.path().join("work");
        write_folder(&source, &files);
        let (tree, limits) = (TreeSpec::default(), Limits::default());
        let scratch = Scratch::new();
        let submission = unpack(&source, &scratch.dest, &tree, &limits).unwrap();
        match fix(&submission, &folder.path().join("out.zip"), &tree, &limits) {
            Ok(_) => String::new(),
            Err(IntakeError::Refused(refusal)) => {
                refusal.findings.iter().map(|f| format!("{}: {f}", f.code)).collect()
            }
            Err(other) => panic!("{other}"),
        }
    };
    let bonus = ["renders/teapot_bonus.exr", "realtime/teapot_simple_realtime_bonus.exr"];
    let said = refused(&[(bonus[0], b"one"), (bonus[1], b"two")]);
    assert!(
        said.starts_with("tree_two_images") && bonus.iter().all(|b| said.contains(b)),
        "{said}"
    );
    assert_eq!(refused(&[(bonus[0], b"one"), (bonus[1], b"one")]), "");
    let eve =
        br#"{"firstName": "Eve", "lastName": "Other", "studentID": "260999999", "renders": []}"#;
    for path in ["Config.json", "old/config.json", "config.json.txt"] {
        let said = refused(&[(path, eve)]);
        assert!(said.starts_with("config_other_person"), "{path}: {said}");
        assert!(said.contains(path) && said.contains("names Eve Other 260999999"), "{said}");
    }
    // A template's names nobody.
    assert_eq!(refused(&[("old/config.json", br#"{"firstName": "First"}"#)]), "");
}

#[test]
fn source_that_the_compiler_cannot_read_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let mut files = working_folder();
    let latin = |path: &str| (path.to_owned(), b"x\n// r\xe9sum\xe9\n".to_vec());
    files.extend(["src/a.wgsl", "src/b.rs", "src/notes.txt"].map(latin));
    let packed = pack_in(folder.path(), &files).unwrap();
    let findings = packed.validation.findings.iter();
    let warned = findings.filter(|finding| finding.code == "source_not_utf8");
    let places: Vec<_> = warned.map(|f| (f.path.clone().unwrap(), f.line)).collect();
    assert_eq!(places, [("src/a.wgsl".to_owned(), Some(2)), ("src/b.rs".to_owned(), Some(2))]);
}

#[test]
fn sparse_file_in_a_folder_counts_its_apparent_size() {
    let sparse =
        |folder: &Path| fs::File::create(folder.join("sparse")).unwrap().set_len(3 << 20).unwrap();
    assert_folder_refused(sparse, "limit_file", "sparse");
}

// --- validation as text ---

#[test]
fn text_of_a_perfect_submission() {
    assert_eq!(
        validate_files(&perfect()).to_text(),
        "\
a2_ada_lampglow.zip: conforms (0 errors, 0 warnings)

  expected                             found
  config.json                          config.json                          ok
  src/lib.rs                           src/lib.rs                           ok
  offline/teapot_simple_offline.exr    offline/teapot_simple_offline.exr    ok
  offline/cbox_simple_offline.exr      offline/cbox_simple_offline.exr      ok
  realtime/teapot_simple_realtime.exr  realtime/teapot_simple_realtime.exr  ok
  realtime/cbox_simple_realtime.exr    realtime/cbox_simple_realtime.exr    ok
  realtime/teapot_bonus.exr            -                                    ok: optional
  realtime/cbox_bonus.exr              -                                    ok: optional
  src/                                 src/                                 ok: 2 further files
"
    );
}

#[test]
fn text_of_a_wrong_tree() {
    let mut files = moved(|path| match path {
        "offline/cbox_simple_offline.exr" => None,
        "offline/teapot_simple_offline.exr" => Some("teapot_simple_offline.exr".to_owned()),
        "realtime/cbox_simple_realtime.exr" => Some("Realtime/cbox_simple_realtime.exr".to_owned()),
        path => Some(path.to_owned()),
    });
    files.push(("Text.txt".to_owned(), b"hello".to_vec()));
    files.push(("renders/teapot_bonus.exr".to_owned(), b"x".to_vec()));
    files.push((".DS_Store".to_owned(), b"x".to_vec()));
    assert_eq!(
        validate_files(&files).to_text(),
        "\
a2_ada_lampglow.zip: does not conform (3 errors, 3 warnings)

  expected                             found
  config.json                          config.json                          ok
  src/lib.rs                           src/lib.rs                           ok
  offline/teapot_simple_offline.exr    teapot_simple_offline.exr            wrong place: move it to offline/teapot_simple_offline.exr
  offline/cbox_simple_offline.exr      -                                    missing: add it
  realtime/teapot_simple_realtime.exr  realtime/teapot_simple_realtime.exr  ok
  realtime/cbox_simple_realtime.exr    Realtime/cbox_simple_realtime.exr    wrong place: move it to realtime/cbox_simple_realtime.exr
  realtime/teapot_bonus.exr            renders/teapot_bonus.exr             ok: accepted under this name too
  realtime/cbox_bonus.exr              -                                    ok: optional
  src/                                 src/                                 ok: 2 further files
  -                                    Text.txt                             unexpected: leave it out; it is not looked at

error: teapot_simple_offline.exr: expected at 'offline/teapot_simple_offline.exr'
  hint: move it there, or let umbra validate --fix do it

error: offline/cbox_simple_offline.exr: expected in the submission, found nothing like it
  hint: add it, then pack again

error: Realtime/cbox_simple_realtime.exr: expected at 'realtime/cbox_simple_realtime.exr'
  hint: move it there, or let umbra validate --fix do it

warning: realtime: differs only in case from 'Realtime'
  hint: use one spelling; both are the same file on Windows and macOS

warning: Text.txt: not part of the expected tree
  hint: leave it out; it is not looked at

warning: config.json:1: 'renders/teapot_bonus.exr' is submitted, but not listed
  hint: add { \"scene\": ..., \"render\": \"renders/teapot_bonus.exr\" } to \"renders\"

note: 1 ignored: .DS_Store
"
    );
}

#[test]
fn text_of_a_broken_config() {
    let mut files = perfect();
    files[0].1 =
        CONFIG.replace("\"Ada\"", "\"\"").replace("exr\" }\n  ]", "exr\" },\n  ]").into_bytes();
    let text = validate_files(&files).to_text();
    let (_, said) = text.split_once("further files\n").unwrap();
    assert_eq!(
        said,
        "
warning: config.json:9: a comma before ']'
  9 |     { \"scene\": \"Cornell box, realtime\", \"render\": \"realtime/cbox_simple_realtime.exr\" },
    |                                                                                        ^
  hint: remove the comma

warning: config.json:2: \"firstName\" is empty
  2 |   \"firstName\": \"\",
    |    ^
  hint: write your name: \"firstName\": \"Ada\"
"
    );
}

#[test]
fn text_of_a_refused_archive() {
    let mut entries: Vec<Entry> =
        perfect().iter().map(|(name, content)| Entry::deflated(name, content)).collect();
    entries.push(Entry::stored("../x", b"x"));
    entries.push(Entry::stored("link", b"x").mode(0o120777));
    assert_eq!(
        validate_bytes(&Zip::of(entries).bytes(), "a.zip").to_text(),
        "\
a.zip: does not conform (2 errors, 0 warnings)

error: link: expected a file or folder, found a symbolic link
  hint: put the file itself there

error: ../x: entry name refused: expected a plain relative path, found '..'
  hint: archive the folder itself, without '..'
"
    );
}

#[test]
fn wrong_levels_are_told_apart() {
    // Two wrapping folders: one is accepted, everything in the second is in the wrong place.
    let deep = validate_files(&moved(|path| Some(format!("a/b/{path}"))));
    assert!(!deep.conforms);
    assert!(
        deep.findings.iter().filter(|f| f.code == "tree_wrong_place").count() == 8,
        "{}",
        deep.to_text()
    );
    // The content of src/ at the root.
    let flat =
        validate_files(&moved(|path| Some(path.strip_prefix("src/").unwrap_or(path).to_owned())));
    assert!(
        flat.findings
            .iter()
            .any(|f| f.code == "tree_wrong_place" && f.path.as_deref() == Some("lib.rs")),
        "{}",
        flat.to_text()
    );
    // Only the source.
    let bare = validate_files(&moved(|path| path.starts_with("src/").then(|| path.to_owned())));
    assert_eq!(bare.findings.iter().filter(|f| f.code == "tree_missing").count(), 5);
}

#[test]
fn what_systems_add_to_a_name_is_known_and_two_of_a_kind_are_none() {
    for (name, seen) in [
        ("config.json", "config.json.txt"),
        ("config.json", "config (1).json"),
        ("config.json", "Config - Copy.json"),
        ("config.json", "Config.JSON"),
        ("config.json", "src/config.json"),
        ("config.json", "config"),
        ("config.json", "conifg.json"),
        ("config.json", "my_config.jsonc"),
        ("config.json", ".config.json"),
        ("src/lib.rs", "src/lib.rs.txt"),
        ("offline/cbox_simple_offline.exr", "offline/cbox_simple_offline(2).exr"),
    ] {
        let renamed = |path: &str| if path == name { seen } else { path }.to_owned();
        let found = validate_files(&moved(|path| Some(renamed(path))));
        let wrong: Vec<_> =
            found.findings.iter().filter(|f| f.code == "tree_wrong_place").collect();
        // Wherever config.json lies, it is read.
        let weight = if name == "config.json" { Severity::Warning } else { Severity::Error };
        assert!(
            matches!(wrong.as_slice(), [f] if f.severity == weight && f.path.as_deref() == Some(seen)),
            "{}",
            found.to_text()
        );
        assert_eq!(found.conforms, weight == Severity::Warning, "{seen}");
        assert_eq!(found.follows_tree(), found.conforms, "{seen}");
        let student = found.config.unwrap();
        assert_eq!(student.sampler_seed(), Some(260_123_456), "{seen}");
    }
    // One that is there is the one.
    let mut files = perfect();
    files.push(("config (1).json".into(), b"{}".to_vec()));
    assert!(validate_files(&files).conforms);
    // Of two configurations that name one person the first counts, of two sources none.
    let mut files = moved(|path| (path != "config.json").then(|| path.to_owned()));
    for name in ["config (1).json", "config (2).json"] {
        files.push((name.into(), CONFIG.into()));
    }
    let found = validate_files(&files);
    assert!(found.conforms && found.config.is_some(), "{}", found.to_text());
    let mut files = moved(|path| (path != "src/lib.rs").then(|| path.to_owned()));
    for name in ["v1/lib.rs", "v2/lib.rs"] {
        files.push((name.into(), b"x".to_vec()));
    }
    let found = validate_files(&files);
    let said = found.findings.iter().find(|f| f.code == "tree_ambiguous").unwrap();
    assert_eq!(
        said.message,
        "expected once in the submission, found 2 files that may be it: v1/lib.rs, v2/lib.rs"
    );
    assert!(!found.follows_tree());
}

/// Each has one name that a person, a system or a program makes of an image's.
#[test]
fn an_image_is_known_by_its_words() {
    let own = "offline/cbox_simple_offline.exr";
    for seen in [
        "cbox simple offline.exr",
        "cbox-simple-offline.exr",
        " cbox_simple_offline.exr",
        "cbox_simple_offline.exr.exr",
        "cbox_simple_offline - copie.exr",
        "Copy of cbox_simple_offline.exr",
        "Kopie von cbox_simple_offline.exr",
        "cbox_simple_offline-1.exr",
        "cbox_simple_offline.exr ",
        "cbox_simple_offline .EXR",
        "CboxSimpleOffline.exr",
        "cbox_simple_ofline.exr",
        "cbox_simple_offline",
        "offline/cbox_simple_offline (2).exr.txt",
        "offline/cbox_simple_offline \u{526f}\u{672c}.exr",
    ] {
        let files = moved(|path| Some(if path == own { seen } else { path }.to_owned()));
        let found = validate_files(&files);
        let errors = found.findings.iter().filter(|f| f.severity == Severity::Error);
        let said: Vec<String> = errors.map(ToString::to_string).collect();
        assert!(
            matches!(&said[..], [one] if one.contains(&format!("expected at '{own}'"))),
            "{seen}: {said:?}"
        );
        assert_eq!(fix_files(&files).unwrap().digest, fix_files(&perfect()).unwrap().digest);
    }
    // Another picture, another kind of file, and two that may be it.
    let without = || moved(|path| (path != own).then(|| path.to_owned()));
    for other in ["cbox_simple_offline.png", "offline/mirror.exr", "realtime/cbox_bonus.exr"] {
        let mut files = without();
        files.push((other.to_owned(), b"x".to_vec()));
        let found = validate_files(&files);
        assert!(found.findings.iter().any(|f| f.code == "tree_missing"), "{}", found.to_text());
    }
    let mut files = without();
    for (name, content) in [("cbox_simple_offline 1.exr", "1"), ("cbox_simple_offline 2.exr", "2")]
    {
        files.push((name.to_owned(), content.into()));
    }
    let text = validate_files(&files).to_text();
    assert!(text.contains("cbox_simple_offline 1.exr, cbox_simple_offline 2.exr"), "{text}");
    // Copies of one image are one.
    files.iter_mut().rev().take(2).for_each(|(_, content)| *content = b"same".to_vec());
    assert!(fix_files(&files).is_ok());
}

#[test]
fn copies_of_a_source_and_a_configuration_are_known_in_many_languages() {
    for mark in ["Copy of X", "X - Kopie", "X - Copia", "Copie de X", "X-1", "X \u{526f}\u{672c}"] {
        for (own, end) in [("src/lib", "rs"), ("config", "json")] {
            let seen = mark.replace('X', own.rsplit('/').next().unwrap());
            let seen = format!("{}{seen}.{end}", own.strip_suffix("lib").unwrap_or_default());
            let own = format!("{own}.{end}");
            let files = moved(|path| Some(if path == own { &seen } else { path }.to_owned()));
            assert_eq!(
                fix_files(&files).unwrap().digest,
                fix_files(&perfect()).unwrap().digest,
                "{seen}"
            );
        }
    }
}

/// A configuration of another person.
fn config_of(first: &str, last: &str, number: &str) -> Vec<u8> {
    let config = CONFIG.replace("Ada", first).replace("Lampglow", last);
    config.replace("260123456", number).into_bytes()
}

#[test]
fn nobody_is_taken_where_two_people_are_named() {
    let bob = || config_of("Bob", "Dimlight", "260000009");
    let without = || moved(|path| (path != "config.json").then(|| path.to_owned()));
    for [ada, other] in [
        ["v1/config.json", "v2/config.json"],
        ["config (1).json", "config (2).json"],
        ["x/config.json", "x/old/config.json"],
        ["CONFIG.JSON", "Config.json"],
        ["config - Copy.json", "v1/config.json"],
        ["my_config.json", "config.txt"],
    ] {
        let mut files = without();
        files.push((ada.to_owned(), CONFIG.into()));
        files.push((other.to_owned(), bob()));
        let found = validate_files(&files);
        let text = found.to_text();
        assert!(!found.conforms && found.config.is_none(), "{text}");
        let said = found.findings.iter().find(|f| f.code == "tree_ambiguous").unwrap();
        assert!(said.message.contains(ada) && said.message.contains(other), "{text}");
        assert!(fix_files(&files).is_err() && !text.contains("not looked at"), "{text}");
    }
    // Two whole submissions in one archive.
    let mut files = moved(|path| Some(format!("a1/{path}")));
    files.extend(moved(|path| Some(format!("a2/{path}"))));
    for (name, content) in &mut files {
        if name == "a2/config.json" {
            *content = bob();
        }
    }
    let found = validate_files(&files);
    assert!(
        found.config.is_none() && !found.to_text().contains("write \"a1"),
        "{}",
        found.to_text()
    );
    // In one file.
    let both = [b"[".as_slice(), CONFIG.as_bytes(), b",", &bob(), b"]"].concat();
    let mut files = perfect();
    files[0].1 = both;
    let found = validate_files(&files);
    let text = found.to_text();
    assert!(text.contains("found 2: Ada Lampglow 260123456 and Bob Dimlight 260000009"), "{text}");
    let config = found.config.unwrap();
    assert!(!found.conforms && config.sampler_seed().is_none() && config.first_name.is_none());
    // One who is named twice is one, and what names nobody says nothing.
    let mut files = without();
    files.push(("v1/config.json".into(), CONFIG.into()));
    files.push(("v2/config.json".into(), CONFIG.replace("renders", "images").into()));
    files.push(("v3/config.json".into(), b"{\"studentID\": \"\"}".to_vec()));
    let found = validate_files(&files);
    assert_eq!(found.config.unwrap().sampler_seed(), Some(260_123_456));
}

#[test]
fn no_hand_in_is_taken_where_one_person_has_two() {
    let two = |places: [&str; 2], second: &dyn Fn(&str, &mut Vec<u8>)| {
        let mut files = Vec::new();
        for (number, place) in places.iter().enumerate() {
            files.extend(perfect().into_iter().map(|(path, mut content)| {
                if number == 1 {
                    second(&path, &mut content);
                }
                (format!("{place}{path}"), content)
            }));
        }
        files
    };
    let newer = |path: &str, content: &mut Vec<u8>| {
        if path == "src/lib.rs" {
            content.extend(b"// newer");
        }
    };
    let more = |path: &str, content: &mut Vec<u8>| {
        if path == "config.json" {
            content.extend(b"\n");
        } else {
            newer(path, content);
        }
    };
    for places in [["backup/", "work/"], ["v1/", "v2/"], ["a/old/", "a/new/"], ["x/", "y/z/"]] {
        for change in [&newer as &dyn Fn(&str, &mut Vec<u8>), &more] {
            let files = two(places, change);
            let found = validate_files(&files);
            let text = found.to_text();
            let said = found.findings.iter().find(|f| f.code == "tree_ambiguous").expect(&text);
            for place in places {
                // One wrapping folder is the root.
                let place = place.strip_prefix("a/").unwrap_or(place);
                assert!(said.message.contains(&format!("{place}src/lib.rs")), "{said}");
            }
            assert!(fix_files(&files).is_err(), "{text}");
            assert!(found.config.is_some(), "who it is is known: {text}");
        }
    }
    // Copies of one submission are one, and so is a folder with an older one in it.
    let same = |_: &str, _: &mut Vec<u8>| {};
    let digest = fix_files(&perfect()).unwrap().digest;
    assert_eq!(fix_files(&two(["v1/", "v2/"], &same)).unwrap().digest, digest);
    assert_eq!(fix_files(&two(["x/", "x/old/"], &newer)).unwrap().digest, digest);
    // Hand-ins that differ in an image alone: that one is open, the others are not.
    let image = |path: &str, content: &mut Vec<u8>| {
        if path == "realtime/teapot_simple_realtime.exr" {
            content.push(0);
        }
    };
    let files = two(["v1/", "v2/"], &image);
    let found = validate_files(&files);
    let open: Vec<&Finding> =
        found.findings.iter().filter(|found| found.code == "tree_ambiguous").collect();
    let [only] = open[..] else { panic!("{}", found.to_text()) };
    for place in ["v1/", "v2/"] {
        let path = format!("{place}realtime/teapot_simple_realtime.exr");
        assert!(only.message.contains(&path), "{only}");
    }
    assert!(fix_files(&files).is_err());
    assert_eq!(fix_files(&two(["x/", "x/old/"], &image)).unwrap().digest, digest);
}

/// Where files are missing, the cause comes before what it causes.
#[test]
fn what_may_hide_missing_files_is_said_first() {
    let without_images = moved(|path| (!path.ends_with(".exr")).then(|| path.to_owned()));
    let mut files = without_images.clone();
    files.push(("images.7z".to_owned(), b"7z\xbc\xaf\x27\x1cxxxx".to_vec()));
    let found = validate_files(&files);
    let first = &found.findings[0];
    assert!(first.code == "nested_archive" && first.severity == Severity::Error, "{first}");
    let mut whole = perfect();
    whole.push(("more.7z".to_owned(), b"7z\xbc\xaf\x27\x1cxxxx".to_vec()));
    assert!(validate_files(&whole).conforms);
}

#[test]
fn a_source_without_code_is_noticed() {
    for source in ["", " \n", "\u{feff}", "// nothing\n/* yet */"] {
        let mut files = perfect();
        let lib = files.iter_mut().find(|(path, _)| path == "src/lib.rs").unwrap();
        lib.1 = source.into();
        let found = validate_files(&files);
        assert!(found.findings.iter().any(|f| f.code == "source_empty"), "{}", found.to_text());
    }
    assert!(!validate_files(&perfect()).to_text().contains("no code"));
}

#[test]
fn what_is_said_of_many_entries_is_said_a_few_times() {
    let entries = (0..24).map(|i| Entry::with(format!("\u{fc}_{i}.rs").as_bytes(), 0, vec![], b""));
    let bad = entries.map(|entry| entry.both(|h| h.name[0] = 0xff));
    let (submission, _scratch) = assert_accepted(&Zip::of(bad).bytes(), "a.zip", "name_not_utf8");
    let said: Vec<_> = submission.findings.iter().filter(|f| f.code == "name_not_utf8").collect();
    assert_eq!(said.len(), 4);
    assert!(said[3].message.starts_with("the same of 21 more: the name is not"));
}

// --- pack and fix ---

fn pack_in(
    folder: &Path,
    files: &[(String, Vec<u8>)],
) -> Result<umbra::intake::Packed, IntakeError> {
    let source = folder.join("work");
    write_folder(&source, files);
    pack(&source, folder, &TreeSpec::default(), &Limits::default())
}

/// The working folder of a student: everything that does not belong into a submission, too.
fn working_folder() -> Vec<(String, Vec<u8>)> {
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

fn fix_files(files: &[(String, Vec<u8>)]) -> Result<Submission, IntakeError> {
    let folder = tempfile::tempdir().unwrap();
    let (source, out) = (folder.path().join("in.zip"), folder.path().join("out.zip"));
    fs::write(&source, zip_of(files)).unwrap();
    let copy = Scratch::new();
    let source = unpack(&source, &copy.dest, &TreeSpec::default(), &Limits::default())?;
    let result = fix(&source, &out, &TreeSpec::default(), &Limits::default());
    assert_eq!(result.is_ok(), out.exists());
    result?;
    let scratch = Scratch::new();
    let submission = unpack(&out, &scratch.dest, &TreeSpec::default(), &Limits::default())?;
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
    let (tree, limits) = (TreeSpec::default(), Limits::default());
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
            let (tree, limits) = (TreeSpec::default(), Limits::default());
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

/// A copy, whatever is to be said of it.
fn accepted(files: &[(String, Vec<u8>)]) -> (Submission, Scratch) {
    let scratch = Scratch::new();
    let (tree, limits) = (TreeSpec::default(), Limits::default());
    (unpack_bytes(&zip_of(files), "a.zip", &scratch.dest, &tree, &limits).unwrap(), scratch)
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

// --- the rest ---

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
