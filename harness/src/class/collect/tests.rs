use std::fs;

use super::*;

fn class(files: &[&str]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for file in files {
        let path = folder.path().join(file);
        if file.ends_with('/') {
            fs::create_dir_all(path).unwrap();
            continue;
        }
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "x").unwrap();
    }
    folder
}

fn find(paths: &[PathBuf], output: &Path) -> anyhow::Result<Collected> {
    let scratch = tempfile::tempdir().unwrap();
    let (tree, limits) = (TreeSpec::default(), ArchiveLimits::default());
    let (from, output) = (None, Some(output));
    collect(
        paths,
        &CollectOptions { tree: &tree, limits: &limits, from, output, scratch: scratch.path() },
    )
}

fn found(folder: &tempfile::TempDir) -> (Vec<String>, Vec<String>) {
    let paths = [folder.path().to_owned()];
    let found = find(&paths, &folder.path().join("out")).unwrap();
    (found.sources.into_iter().map(|source| source.name).collect(), found.skipped)
}

#[test]
fn submissions_are_found_however_deep_and_junk_is_named() {
    let class = class(&[
        "Ann_1_assignsubmission_file/a2.zip",
        "Bob_2_assignsubmission_file/a2/src/lib.rs",
        "Bob_2_assignsubmission_onlinetext/onlinetext.html",
        "Cem_3/config.json",
        "Dan_4/config.json",
        "Dan_4/a2_dan.tar.gz",
        "Eve_5/",
        "Fay_6/code/lib.rs",
        "group/of/Gil_7.rar",
        "Hal_8/Src/lib.rs",
        "Hal_8/old.zip",
        "__MACOSX/a2.zip",
        "out/Ann/report.html",
        ".DS_Store",
        "index.html",
        "notes.txt",
        "rules.docx",
    ]);
    fs::write(class.path().join("no-extension"), [b"\x1f\x8b".as_slice(), &[0; 9]].concat())
        .unwrap();
    let (sources, skipped) = found(&class);
    let expected = [
        "Ann_1_assignsubmission_file/a2.zip",
        "Bob_2_assignsubmission_file/a2",
        "Cem_3",
        "Dan_4/a2_dan.tar.gz",
        "Fay_6/code",
        "Hal_8",
        "group/of/Gil_7.rar",
        "no-extension",
    ];
    assert_eq!(sources, expected);
    let expected = [
        ".DS_Store",
        "Bob_2_assignsubmission_onlinetext/onlinetext.html",
        "Dan_4/config.json",
        "Eve_5/ (nothing in it)",
        "__MACOSX",
        "index.html",
        "notes.txt",
        "rules.docx",
    ];
    assert_eq!(skipped, expected);
}

#[test]
fn what_is_named_itself_is_a_submission_whatever_it_is() {
    let class = class(&["notes.txt", "a/config.json"]);
    let paths = ["notes.txt", "a"].map(|name| class.path().join(name));
    let found = find(&paths, Path::new("out")).unwrap();
    assert_eq!(found.sources, paths.map(|path| Source::given(&path)));
}

#[test]
fn a_folder_without_any_says_what_was_looked_for() {
    for (files, said) in
        [(&["a.txt", "b/"][..], "it holds a.txt, b/ (nothing in it)"), (&[][..], "it is empty")]
    {
        let class = class(files);
        let paths = [class.path().to_owned()];
        let error = find(&paths, Path::new("out")).unwrap_err().to_string();
        assert!(error.contains("there is no submission: expected archives (.zip"), "{error}");
        assert!(error.ends_with(said), "{error}");
    }
}

#[test]
fn many_skipped_files_are_counted() {
    let skipped = (0..20).map(|i| format!("{i}.txt")).collect();
    let collected = Collected { skipped, ..Collected::default() };
    assert!(collected.skipped().unwrap().ends_with("11.txt and 8 more"));
}

#[cfg(unix)]
#[test]
fn a_link_among_submissions_is_one_and_a_link_to_a_class_is_followed() {
    let class = class(&["class/ann.zip", "secret/src/lib.rs"]);
    std::os::unix::fs::symlink(class.path().join("secret"), class.path().join("class/eve"))
        .unwrap();
    std::os::unix::fs::symlink(class.path().join("class"), class.path().join("link")).unwrap();
    let paths = [class.path().join("link")];
    let found = find(&paths, Path::new("out")).unwrap();
    let names: Vec<&str> = found.sources.iter().map(|source| source.name.as_str()).collect();
    assert_eq!(names, ["ann.zip", "eve"]);
}
