//! Oddities that are reported, not refused.

use super::{good, tar_refused, zip_refused};
use crate::support::scratch::{assert_accepted, assert_refused};
use crate::support::tar_bytes::{self, Entry as Tar, gz, tar};
use crate::support::zip_bytes::{Entry, Zip};
use umbra::intake::Submission;

#[test]
fn nested_archive_is_reported() {
    let inner = Zip::of([Entry::stored("x", b"x")]).bytes();
    let (submission, _scratch) = assert_accepted(
        &Zip::of([good(), Entry::stored("src/lib.rs", b"x"), Entry::stored("src.zip", &inner)])
            .bytes(),
        "a.zip",
        "nested_archive",
    );
    assert_eq!(submission.findings[0].path.as_deref(), Some("src.zip"));
}

/// Nobody has seen what was submitted: it is no submission without a source.
#[test]
fn a_source_that_may_be_in_an_archive_which_is_not_opened_is_not_missing() {
    let zip = Zip::of([Entry::stored("lib.rs", b"x")]).bytes();
    for (inner, archive) in [
        ("i.7z", b"7z\xbc\xaf\x27\x1cxxxx".as_slice()),
        ("a2/i.rar", b"Rar!\x1a\x07\0xxxx"),
        ("i.tar.xz", b"\xfd7zXZ\0xxxx"),
        ("src.zip", &zip),
        // What its bytes do not tell, its name does.
        ("a2.iso", b"\0\0\0\0"),
        ("a2.7z.002", b"xxxx"),
        ("a2.Z01", b"xxxx"),
    ] {
        let archive = Entry::stored(inner, archive);
        let others = ["readme.txt", "notes.rs", "main.cpp", "old/phong.fs.wgsl"];
        let beside = others.map(|name| vec![archive.clone(), Entry::stored(name, b"x")]);
        for entries in beside.into_iter().chain([vec![good(), archive.clone()]]) {
            let bytes = Zip::of(entries).bytes();
            let first = assert_refused(&bytes, "a.zip", "nested_archive", inner).to_string();
            assert!(first.contains("no source is there besides"), "{first}");
        }
    }
    for entry in ["src/lib.rs", "a2/lib.rs"] {
        let bytes = Zip::of([Entry::stored(entry, b"x"), Entry::stored("x.zip", &zip)]).bytes();
        assert_accepted(&bytes, "a.zip", "nested_archive");
    }
}

/// Paths and contents of a copy.
fn contents(submission: &Submission) -> Vec<(String, Vec<u8>)> {
    let read = |path: &String| std::fs::read(submission.root.join(path)).unwrap();
    submission.files.iter().map(|file| (file.path.clone(), read(&file.path))).collect()
}

/// The tar that GNU tar makes of a file with holes in its own format.
fn gnu_sparse(pieces: &[(u64, &[u8])], size: u64) -> Vec<u8> {
    let stored: Vec<u8> = pieces.iter().flat_map(|(_, data)| data.to_vec()).collect();
    let mut header = tar::Header::new_gnu();
    header.set_path("src/lib.rs").unwrap();
    header.set_entry_type(tar::EntryType::GNUSparse);
    header.set_size(stored.len() as u64);
    let (first, more) = pieces.split_at(pieces.len().min(4));
    let set = |entry: &mut tar::GnuSparseHeader, (offset, data): &(u64, &[u8])| {
        entry.set_offset(*offset);
        entry.set_length(data.len() as u64);
    };
    let gnu = header.as_gnu_mut().unwrap();
    gnu.set_real_size(size);
    gnu.set_is_extended(!more.is_empty());
    gnu.sparse.iter_mut().zip(first).for_each(|(entry, piece)| set(entry, piece));
    header.set_cksum();
    let mut bytes = header.as_bytes().to_vec();
    if !more.is_empty() {
        let mut block = tar::GnuExtSparseHeader::new();
        block.sparse_mut().iter_mut().zip(more).for_each(|(entry, piece)| set(entry, piece));
        bytes.extend(block.as_bytes());
    }
    bytes.extend(&stored);
    bytes.resize(bytes.len().next_multiple_of(512) + 1024, 0);
    bytes
}

#[test]
fn files_with_holes_are_whole() {
    let whole = b"ab\0\0\0c\0\0".to_vec();
    let expected = vec![("src/lib.rs".to_owned(), whole.clone())];
    let pax = |records: &[(&str, &str)], name: &str, stored: &[u8]| {
        tar_bytes::tar(&[Tar::pax(b'x', records), Tar::file(name, stored)])
    };
    let mut block = b"2\n0\n2\n5\n1\n".to_vec();
    block.resize(512, 0);
    block.extend(b"abc");
    let forms = [
        gnu_sparse(&[(0, b"ab"), (5, b"c")], 8),
        // More pieces than one header holds; the last says that a hole ends the file.
        gnu_sparse(&[(0, b"a"), (1, b"b"), (2, b"\0"), (3, b"\0"), (5, b"c"), (8, b"")], 8),
        pax(
            &[
                ("GNU.sparse.size", "8"),
                ("GNU.sparse.numblocks", "2"),
                ("GNU.sparse.offset", "0"),
                ("GNU.sparse.numbytes", "2"),
                ("GNU.sparse.offset", "5"),
                ("GNU.sparse.numbytes", "1"),
            ],
            "src/lib.rs",
            b"abc",
        ),
        pax(
            &[
                ("GNU.sparse.name", "src/lib.rs"),
                ("GNU.sparse.size", "8"),
                ("GNU.sparse.numblocks", "2"),
                ("GNU.sparse.map", "0,2,5,1"),
            ],
            "src/GNUSparseFile.7/lib.rs",
            b"abc",
        ),
        pax(
            &[
                ("GNU.sparse.major", "1"),
                ("GNU.sparse.minor", "0"),
                ("GNU.sparse.name", "src/lib.rs"),
                ("GNU.sparse.realsize", "8"),
            ],
            "src/GNUSparseFile.7/lib.rs",
            &block,
        ),
    ];
    for (form, bytes) in forms.iter().enumerate() {
        let (submission, _scratch) = assert_accepted(bytes, "a.tar", "");
        assert_eq!(contents(&submission), expected, "form {form}");
        let (packed, _scratch) = assert_accepted(&gz(bytes), "a.tar.gz", "");
        assert_eq!(packed.digest, submission.digest, "form {form}");
        // Cut off in its data.
        let mut cut = bytes.clone();
        cut.truncate(bytes.len() - 1024 - 510);
        assert_refused(&cut, "a.tar", "tar_truncated", "src/lib.rs");
    }
}

#[test]
fn a_hard_link_is_the_file_that_came_before() {
    let entries = [
        Tar::file("offline/a.exr", b"image"),
        Tar::link("offline/b.exr", b'1', "./offline/a.exr"),
        Tar::link("offline/c.exr", b'1', "offline/b.exr"),
    ];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "");
    let same = |(_, content): &(String, Vec<u8>)| content == b"image";
    let found = contents(&submission);
    assert!(found.len() == 3 && found.iter().all(same), "{found:?}");
}

#[test]
fn labels_and_backups_are_read() {
    let mut label = Tar::of(b"backup of ada", b'V', b"");
    label.size_field = Some(vec![0; 12]);
    let entries = [label, Tar::of(b"src/", b'D', b"Ylib.rs\0\0"), Tar::file("src/lib.rs", b"x")];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "tar_label");
    assert_eq!(contents(&submission), [("src/lib.rs".to_owned(), b"x".to_vec())]);
}

#[test]
fn bytes_after_a_tar_are_reported() {
    let plain = tar(&[Tar::file("config.json", b"{}")]);
    for tail in [&b"--boundary--\r\n"[..], &[7; 2000]] {
        assert_accepted(&[&plain, tail].concat(), "a.tar", "tar_data_after");
        assert_accepted(&[&gz(&plain), tail].concat(), "a.tar.gz", "gz_data_after");
    }
    let tail = [vec![0; 700], b"x".to_vec()].concat();
    assert_accepted(&[gz(&plain), tail].concat(), "a.tar.gz", "gz_data_after");
}

#[test]
fn two_entries_of_one_name_and_content_are_one() {
    let zip = Zip::of([good(), Entry::stored("a", b"1"), Entry::deflated("./a", b"1")]);
    let (submission, _scratch) = assert_accepted(&zip.bytes(), "a.zip", "duplicate_entry");
    assert_eq!(submission.files.len(), 2);
    let entries = [Tar::file("a", b"1"), Tar::file("b", b"2"), Tar::file("a", b"1")];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "duplicate_entry");
    let expected = [("a".to_owned(), b"1".to_vec()), ("b".to_owned(), b"2".to_vec())];
    assert_eq!(contents(&submission), expected);
}

#[test]
fn an_archive_in_nothing_but_another_is_opened() {
    let files = [Tar::file("config.json", b"{}"), Tar::file("src/lib.rs", b"x")];
    let (tar, zip) = (tar(&files), Zip::of([good(), Entry::stored("src/lib.rs", b"x")]).bytes());
    let digest = assert_accepted(&zip, "a.zip", "").0.digest;
    let junk = || Entry::stored("__MACOSX/x", b"x");
    for (what, bytes) in [
        ("zip in zip", Zip::of([Entry::stored("a2/a2_ada.zip", &zip), junk()]).bytes()),
        ("tar.gz in zip", Zip::of([Entry::stored("a2.tar.gz", &gz(&tar))]).bytes()),
        ("tar in zip", Zip::of([Entry::stored("a2.tar", &tar)]).bytes()),
        ("zip in tar", tar_bytes::tar(&[Tar::file("a2.zip", &zip)])),
        ("tar.gz gzipped", gz(&gz(&tar))),
        ("zip gzipped", gz(&zip)),
    ] {
        let (submission, _scratch) = assert_accepted(&bytes, "a", "packed_twice");
        assert_eq!(submission.digest, digest, "{what}");
    }
    // What is wrong with the inner one is said of it.
    let escaping = Zip::of([good(), Entry::stored("../x", b"x")]).bytes();
    let outer = Zip::of([Entry::stored("inner.zip", &escaping)]).bytes();
    assert_refused(&outer, "a.zip", "path_escape", "../x");
    let bomb = Zip::of([Entry::deflated("x", &vec![0; 1536 * 1024])]).bytes();
    assert_refused(&Zip::of([Entry::stored("x.zip", &bomb)]).bytes(), "a.zip", "limit_ratio", "x");
    // Once is enough.
    let deep = Zip::of([Entry::stored("b.zip", &outer)]).bytes();
    assert_refused(&deep, "a.zip", "nested_archive", "inner.zip");
}

#[test]
fn backslashes_of_windows_are_folders_beside_slashes_too() {
    let mixed = Zip::of([
        Entry::stored("a2/", b"").mode(0o40755),
        Entry::stored("a2/config.json", b"{}"),
        Entry::stored("a2\\src\\lib.rs", b"x"),
    ]);
    let mut bytes = mixed.bytes();
    assert_refused(&bytes, "a.zip", "name_backslash", "a2\\src\\lib.rs");
    let made_by: Vec<usize> =
        (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"PK\x01\x02")).collect();
    for host in [0, 10, 11] {
        made_by.iter().for_each(|at| bytes[at + 5] = host);
        let (submission, _scratch) = assert_accepted(&bytes, "a.zip", "zip_backslash");
        let paths: Vec<&str> = submission.files.iter().map(|file| file.path.as_str()).collect();
        assert_eq!(paths, ["config.json", "src/lib.rs"], "{host}");
    }
}

/// A zip of files below a folder, whose names are made of both, as made on a host.
fn zip_below(folder: &[u8], slash: &[u8], host: u8) -> Vec<u8> {
    let entry = |name: &[u8], data: &[u8]| {
        Entry::with(&[folder, slash, name].concat(), 0, data.to_vec(), data)
    };
    let lib = [b"src", slash, b"lib.rs"].concat();
    let mut bytes = Zip::of([entry(b"config.json", b"{}"), entry(&lib, b"x")]).bytes();
    let made_by: Vec<usize> =
        (0..bytes.len() - 4).filter(|&at| bytes[at..].starts_with(b"PK\x01\x02")).collect();
    made_by.iter().for_each(|at| bytes[at + 5] = host);
    bytes
}

#[test]
fn a_backslash_that_is_half_a_letter_separates_nothing() {
    let paths = ["config.json", "src/lib.rs"].map(str::to_owned);
    let listed = |bytes: &[u8], code: &str| {
        let (submission, _scratch) = assert_accepted(bytes, "a.zip", code);
        let backslash = submission.findings.iter().any(|finding| finding.code == "zip_backslash");
        let found = submission.files.iter().map(|file| file.path.clone()).collect::<Vec<_>>();
        assert_eq!(found, paths);
        (submission.wrapped_in.unwrap(), backslash)
    };
    // Folders called "source" in Shift-JIS, "homework Hsu" in Big5, a name in GBK, and one in EUC-KR.
    for (folder, shown) in [
        (&b"\x83\x5c\x81\x5b\x83\x58"[..], "_x83_x5C_x81[_x83X"),
        (b"\xa5\x5c\xbd\xd2\xb3\x5c", "_xA5_x5C_xBD\u{4b3}_x5C"),
        (b"\xd5\x5c", "_xD5_x5C"),
        (b"\xc7\xd1\xb1\xdb", "_xC7\u{471}_xDB"),
    ] {
        for host in [0, 3, 10, 11] {
            let bytes = zip_below(folder, b"/", host);
            assert_eq!(listed(&bytes, "name_not_utf8"), (shown.to_owned(), false), "{host}");
            // Where no name holds a slash, the others separate.
            let bytes = zip_below(folder, b"\\", host);
            assert_eq!(listed(&bytes, "zip_backslash"), (shown.to_owned(), true), "{host}");
        }
    }
    // In a code page of one byte a letter, one behind an accent separates: no file were config.json else.
    let bytes = zip_below(b"Ren\x82", b"\\", 0);
    assert_eq!(listed(&bytes, "zip_backslash"), ("Ren_x82".to_owned(), true));
}

#[test]
fn backslashes_in_a_tar_are_folders_where_no_name_holds_a_slash() {
    let entries = [
        Tar::of(b"src\\", b'5', b""),
        Tar::file("config.json", b"{}"),
        Tar::file("src\\lib.rs", b"x"),
        Tar::link("src\\mod.rs", b'1', "src\\lib.rs"),
    ];
    for (bytes, name) in [(tar(&entries), "a.tar"), (gz(&tar(&entries)), "a.tar.gz")] {
        let (submission, _scratch) = assert_accepted(&bytes, name, "tar_backslash");
        let paths: Vec<&str> = submission.files.iter().map(|file| file.path.as_str()).collect();
        assert_eq!(paths, ["config.json", "src/lib.rs", "src/mod.rs"]);
    }
    let beside = Tar::file("src/a.rs", b"x");
    tar_refused(&[beside, Tar::file("src\\lib.rs", b"x")], "name_backslash", "src\\lib.rs");
    tar_refused(&[Tar::file("..\\x", b"x")], "path_escape", "../x");
}

#[test]
fn names_that_our_own_signs_make_equal_are_told_apart() {
    let entry = |name: &[u8]| Entry::with(name, 0, b"x".to_vec(), b"x");
    for names in [[&b"src/\x81.rs"[..], b"src/_x81.rs"], [b"src/_x81.rs", b"src/\x81.rs"]] {
        let message = zip_refused(names.map(entry), "name_written_alike", "src/_x81.rs");
        assert!(message.contains("not UTF-8"), "{message}");
    }
    // The same name twice is that.
    let twice = [entry(b"src/\x81.rs"), entry(b"./src//\x81.rs")];
    let bytes = Zip::of([good()].into_iter().chain(twice)).bytes();
    assert_accepted(&bytes, "a.zip", "duplicate_entry");
}

#[test]
fn case_collisions_are_reported() {
    let entries = [good(), Entry::stored("src/lib.rs", b"a"), Entry::stored("Src/lib.rs", b"b")];
    let (submission, _scratch) =
        assert_accepted(&Zip::of(entries).bytes(), "a.zip", "case_collision");
    assert_eq!(submission.findings[0].path.as_deref(), Some("Src"));
    assert_eq!(submission.files.len(), 3);
    let entries = [good(), Entry::stored("src/A.rs", b"a"), Entry::stored("src/a.rs", b"b")];
    assert_accepted(&Zip::of(entries).bytes(), "a.zip", "case_collision");
}

#[test]
fn names_that_are_not_utf8_are_kept_readable() {
    let entry = Entry::with(b"src/caf\xe9.rs", 0, b"x".to_vec(), b"x");
    let (submission, _scratch) =
        assert_accepted(&Zip::of([good(), entry]).bytes(), "a.zip", "name_not_utf8");
    assert!(submission.file("src/caf_xE9.rs").is_some());
    let bytes = tar(&[Tar::file("config.json", b"{}"), Tar::of(b"src/caf\xe9.rs", b'0', b"x")]);
    let (submission, _scratch) = assert_accepted(&bytes, "a.tar", "name_not_utf8");
    assert!(submission.file("src/caf_xE9.rs").is_some());
}

#[test]
fn gap_between_entries_is_reported() {
    let zip = Zip { entries: vec![good()], gap: vec![0; 10], ..Zip::default() };
    assert_accepted(&zip.bytes(), "a.zip", "zip_gap");
}

#[test]
fn bytes_around_a_zip_are_reported() {
    let zip = Zip { prefix: b"#!/bin/sh\n".to_vec(), entries: vec![good()], ..Zip::default() };
    assert_accepted(&zip.bytes(), "a.zip", "zip_data_before");
    let mut bytes = b"MZ self-extracting".to_vec();
    bytes.extend(Zip::of([good()]).bytes());
    assert_accepted(&bytes, "a.zip", "zip_data_before");
    let zip = |suffix: &[u8]| {
        Zip { entries: vec![good()], suffix: suffix.to_vec(), ..Zip::default() }.bytes()
    };
    assert_accepted(&zip(b"tail"), "a.zip", "zip_data_after");
    assert_accepted(&zip(&[0; 9000]), "a.zip", "zip_padding");
    assert_accepted(&zip(&vec![b'x'; 100_000]), "a.zip", "zip_data_after");
    let cut = Zip { entries: vec![good()], comment_length: Some(9), ..Zip::default() };
    assert_accepted(&cut.bytes(), "a.zip", "zip_comment_cut");
}

#[test]
fn zeros_after_gzip_are_reported() {
    let bytes = [gz(&tar(&[Tar::file("config.json", b"{}")])), vec![0; 600]].concat();
    assert_accepted(&bytes, "a.tar.gz", "gz_padding");
}

#[test]
fn links_where_all_is_ignored_are_no_matter() {
    let entries = [
        Tar::file("config.json", b"{}"),
        Tar::link("target/release/libx.so", b'1', "target/release/deps/libx.so"),
        Tar::link("__MACOSX", b'2', "/etc"),
        Tar::file("__MACOSX/passwd", b"x"),
    ];
    let (submission, _scratch) = assert_accepted(&tar(&entries), "a.tar", "ignored");
    assert_eq!(submission.files.len(), 1);
}

#[test]
fn tar_without_an_end_is_reported() {
    let config = || Tar::file("config.json", b"{}");
    let mut files = vec![config(), Tar::file("src/lib.rs", b"x")];
    for scene in ["teapot", "cbox"] {
        for path in ["offline", "realtime"] {
            files.push(Tar::file(&format!("{path}/{scene}_simple_{path}.exr"), b"x"));
        }
    }
    assert_accepted(&tar_bytes::open(&files), "a.tar", "tar_no_end");
    // What is missing may have been behind the cut.
    for number in 1..files.len() {
        assert_refused(&tar_bytes::open(&files[..number]), "a.tar", "tar_no_end", "");
    }
    // So may a file that the source names.
    for (text, named) in [
        ("mod renderer;", "src/renderer.rs"),
        ("pub mod bsdfs;", "src/bsdfs/mod.rs"),
        ("const A: &str = include_str!(\"a.wgsl\");", "src/a.wgsl"),
    ] {
        files[1] = Tar::file("src/lib.rs", text.as_bytes());
        assert_refused(&tar_bytes::open(&files), "a.tar", "tar_no_end", "");
        let mut whole = files.clone();
        whole.push(Tar::file(named, b"x"));
        assert_accepted(&tar_bytes::open(&whole), "a.tar", "tar_no_end");
    }
}

#[test]
fn wrong_extension_is_reported() {
    assert_accepted(&Zip::of([good()]).bytes(), "a.rar", "wrong_extension");
    assert_accepted(&gz(&tar(&[Tar::file("config.json", b"{}")])), "a.zip", "wrong_extension");
}
