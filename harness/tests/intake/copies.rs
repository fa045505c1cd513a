//! Copies of archives and folders.

use std::fs;
use std::path::Path;

use similar_asserts::assert_eq;
use umbra::intake::{
    ArchiveLimits, Format, IntakeError, Severity, TreeSpec, fix, unpack, unpack_bytes,
};

use super::packing::{pack_in, working_folder};
use super::{codes, moved, perfect, tar_of, validate, validate_files, write_folder, zip_of};
use crate::support::scratch::{Scratch, assert_accepted, assert_folder_refused, listing};
use crate::support::tar_bytes::{self, gz, tar};
use crate::support::zip_bytes::{Entry, Zip, crc32, extra};

#[test]
fn every_format_gives_the_same_copy() {
    let files = perfect();
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("a2_ada_lampglow");
    write_folder(&source, &files);
    let scratch = Scratch::new();
    let from_folder =
        unpack(&source, &scratch.dest, &TreeSpec::default(), &ArchiveLimits::default()).unwrap();
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
        let submission = unpack_bytes(
            &bytes,
            name,
            &scratch.dest,
            &TreeSpec::default(),
            &ArchiveLimits::default(),
        )
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
    unpack_bytes(&zip_of(&files), "a.zip", &scratch.dest, &tree, &ArchiveLimits::default())
        .unwrap();
    let scratch = Scratch::new();
    unpack_bytes(&gz(&tar_of(&files)), "a.tgz", &scratch.dest, &tree, &ArchiveLimits::default())
        .unwrap();
}

#[test]
fn destination_must_be_empty() {
    let scratch = Scratch::new();
    fs::write(scratch.dest.join("mine"), "x").unwrap();
    let result = scratch.unpack(&zip_of(&perfect()), "a.zip", &ArchiveLimits::default());
    assert!(matches!(result, Err(IntakeError::DestinationNotEmpty { .. })));
    assert_eq!(fs::read_to_string(scratch.dest.join("mine")).unwrap(), "x");
}

#[test]
fn missing_source_is_an_error_of_the_machine() {
    let result = validate(Path::new("/nowhere/a.zip"));
    let message = result.unwrap_err().to_string();
    assert!(message.starts_with("cannot read '/nowhere/a.zip': "), "{message}");
}

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
    let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
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
        let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
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
