//! Validation as a student reads it.

use similar_asserts::assert_eq;
use umbra::intake::{Finding, Severity};

use super::packing::fix_files;
use super::{CONFIG, moved, perfect, validate_bytes, validate_files};
use crate::support::scratch::assert_accepted;
use crate::support::zip_bytes::{Entry, Zip};

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
