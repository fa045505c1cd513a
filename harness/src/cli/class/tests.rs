use super::*;

fn source(path: &str, slug: &str) -> Source {
    Source {
        path: path.into(),
        name: path.into(),
        slug: slug.into(),
        place: path.into(),
        label: None,
        moved: None,
    }
}

#[test]
fn a_submission_keeps_its_folder_and_takes_nobody_else_s() {
    let place = tempfile::tempdir().unwrap();
    let (output, class) = (place.path().join("out"), place.path().join("class"));
    let path = |folder: &str| {
        fs::create_dir_all(class.join(folder)).unwrap();
        let path = class.join(folder).join("a2.zip");
        fs::write(&path, folder).unwrap();
        path
    };
    let note = |sources: &[Source]| {
        for source in sources {
            let at = |name: &str| output.join(name).join(&source.slug);
            let out = Folders { student: at("."), instructor: at(report::INSTRUCTOR) };
            note_source(&out, source).unwrap();
        }
    };
    let sources = |paths: &[PathBuf], output: &Path| {
        let given: Vec<_> = paths.iter().map(|path| class::Source::given(path)).collect();
        super::sources(Mode::Grade, &given, output, &HashMap::new())
    };
    let slugs = |sources: &[Source]| -> Vec<String> {
        sources.iter().map(|source| source.slug.clone()).collect()
    };
    let first = sources(&[path("bob"), path("eve")], &output);
    assert_eq!(slugs(&first), ["a2", "a2-2"]);
    note(&first);
    // One more, and the others in another order, by another way.
    let again = class.join("eve/../eve/a2.zip");
    let second = sources(&[path("ann"), again, path("bob")], &output);
    assert_eq!(slugs(&second), ["a2-3", "a2-2", "a2"]);
    note(&second);
    // The same one twice is two, each time.
    let twice = sources(&[path("bob"), path("bob")], &output);
    assert_eq!(slugs(&twice), ["a2", "a2-4"]);
    note(&twice);
    assert_eq!(slugs(&sources(&[path("bob"), path("bob")], &output)), ["a2", "a2-4"]);
    let odd = ["instructor", "work.zip", "settled", "???", "A2.tar.gz"].map(PathBuf::from);
    assert_eq!(
        slugs(&sources(&odd, &output)),
        ["instructor-2", "work-2", "settled-2", "submission", "A2-5"]
    );
    // The folder of a check is called as the student's.
    for (name, folder) in [("work", "work"), ("errors", "errors"), ("viewer", "viewer-2")] {
        let given = [class::Source::given(Path::new(name))];
        let own = super::sources(Mode::Check, &given, &output, &HashMap::new());
        assert_eq!(slugs(&own), [folder]);
    }
}

#[test]
fn a_submission_is_called_by_its_file() {
    let source = source("class/a2_ada.tar.gz", "a2_ada-2");
    for name in ["a2_ada", "a2_ada.tar.gz", "a2_ada-2", "class/a2_ada.tar.gz"] {
        assert!(is_file(&source, name), "{name}");
    }
    for name in ["", "ada", "a2", "class"] {
        assert!(!is_file(&source, name), "{name}");
    }
}
