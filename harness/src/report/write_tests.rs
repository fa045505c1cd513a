//! Tests of what lies on the disk afterwards.

use std::fs;

use super::*;

#[test]
fn every_file_is_there_and_no_temporary_one() {
    let out = tempfile::tempdir().unwrap();
    let report = sample::report();
    // Twice: a second run replaces what the first one wrote.
    for _ in 0..2 {
        write(out.path(), &report).unwrap();
    }
    let mut names: Vec<String> = Vec::new();
    let slugs = ["a2_ada", "two_cosines", "hand_in_3"];
    let own = slugs.iter().map(|slug| format!("instructor/{slug}"));
    for folder in [String::new()].into_iter().chain(slugs.map(String::from)).chain(own) {
        for file in fs::read_dir(out.path().join(&folder)).unwrap() {
            names.push(format!("{folder}/{}", file.unwrap().file_name().display()));
        }
    }
    names.sort();
    assert_eq!(
        names,
        [
            "/a2_ada",
            "/grades.csv",
            "/hand_in_3",
            "/instructor",
            "/report.html",
            "/report.json",
            "/two_cosines",
            "a2_ada/report.html",
            "hand_in_3/report.html",
            "instructor/a2_ada/report.html",
            "instructor/hand_in_3/report.html",
            "instructor/two_cosines/report.html",
            "two_cosines/report.html",
        ]
    );
    let json = fs::read_to_string(out.path().join(JSON_FILE)).unwrap();
    assert_eq!(json, report_json(&report).unwrap());
}

#[test]
fn an_empty_batch_writes_nothing() {
    let out = tempfile::tempdir().unwrap();
    let report = BatchReport { entries: Vec::new(), ..sample::report() };
    assert!(matches!(write(out.path(), &report), Err(ReportError::Empty)));
    assert_eq!(fs::read_dir(out.path()).unwrap().count(), 0);
}

#[test]
fn a_slug_cannot_leave_the_folder_or_meet_another() {
    let out = tempfile::tempdir().unwrap();
    for slug in ["", "..", ".", "a/b", "/etc", "a/", "two_cosines", "report.html", "instructor"] {
        let mut report = sample::report();
        report.entries[0].record.slug = slug.into();
        let error = write(&out.path().join("out"), &report).unwrap_err();
        assert!(matches!(error, ReportError::Slug { .. }), "{slug:?}: {error}");
    }
    assert_eq!(fs::read_dir(out.path()).unwrap().count(), 0);
}

#[test]
fn what_cannot_be_written_names_its_file() {
    let out = tempfile::tempdir().unwrap();
    fs::write(out.path().join("a2_ada"), "a file where a folder must be").unwrap();
    let error = write(out.path(), &sample::report()).unwrap_err().to_string();
    assert!(error.contains("a2_ada") && error.contains("cannot write the report"), "{error}");
}

/// All bytes of all files below a folder, their paths included.
fn all_bytes(folder: &Path) -> Vec<u8> {
    let files = crate::files::files_below(folder).unwrap();
    let read = |path: &PathBuf| {
        let name = path.strip_prefix(folder).unwrap().as_os_str().as_encoded_bytes().to_vec();
        [name, fs::read(path).unwrap()].concat()
    };
    files.iter().flat_map(read).collect()
}

#[test]
fn a_student_folder_names_nobody_else_has_no_note_for_instructors_and_leads_nowhere() {
    let mut report = sample::report();
    let mut records: Vec<Record> =
        report.entries.iter().map(|entry| entry.record.clone()).collect();
    let number = records[0].student.id.clone();
    for record in &mut records {
        // All submit one image; two go by one number.
        record.images = vec![crate::grading::ImageDigest {
            scene: "teapot".into(),
            path: "offline/a.exr".into(),
            sha256: "same".into(),
        }];
    }
    records[1].student.id = number;
    crate::grading::judge_shared(&mut records);
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let gates = Assignment::load(root).unwrap().rules.gates;
    for (entry, record) in report.entries.iter_mut().zip(records) {
        let failed = |check: &&Check| check.verdict == crate::evidence::Verdict::Fail;
        let failed = record.evidence.checks.iter().filter(failed);
        let closed = failed.flat_map(|check| gates.iter().filter(|gate| gate.check == check.id));
        let remarks = closed.map(|gate| gate.reason.clone()).collect::<Vec<_>>();
        assert!(!remarks.is_empty());
        entry.grade.remarks.extend(remarks);
        entry.record = record;
    }
    report.rules.gates = gates;
    let out = tempfile::tempdir().unwrap();
    // Images for the viewer, each with values and words of its own.
    for (index, entry) in report.entries.iter_mut().enumerate() {
        let slug = &entry.record.slug;
        for (held_back, scene) in [(false, "cbox"), (true, "SECRET-scene")] {
            let folder =
                if held_back { out.path().join(INSTRUCTOR) } else { out.path().to_owned() };
            let mut image = basecode::Image::new(8, 6);
            image
                .pixels
                .fill(basecode::Vec3::splat(0.1 + index as f32 + f32::from(u8::from(held_back))));
            let file = crate::viewer::write_image(&folder.join(slug), &image).unwrap();
            entry.record.views.push(crate::viewer::ViewedCase {
                id: format!("image.offline @ {scene}"),
                title: format!("{scene} of {slug}"),
                held_back,
                layers: vec![crate::viewer::Layer::image("actual", &file)],
                regions: vec![format!("floor of {scene}")],
                ..Default::default()
            });
        }
    }
    write(out.path(), &report).unwrap();
    for entry in &report.entries {
        let folder = out.path().join(&entry.record.slug);
        let bytes = all_bytes(&folder);
        let has =
            |needle: &str| bytes.windows(needle.len()).any(|window| window == needle.as_bytes());
        assert!(has(&entry.record.name));
        for suspicion in ["another submission", "same image", "two names", "submitted.shared"] {
            assert!(!has(suspicion), "{suspicion} is for the instructor alone");
        }
        assert!(!has("or the instructor:"), "a note for the instructor");
        assert!(
            !has("SECRET") && has("image.offline @ cbox"),
            "the viewer shows what is held back"
        );
        let [public, held_back] = [false, true].map(|held_back| {
            let own = entry.record.views.iter().filter(move |view| view.held_back == held_back);
            own.flat_map(|view| view.files()).collect::<Vec<_>>()
        });
        let data = crate::files::files_below(&folder.join(crate::viewer::DATA_FOLDER)).unwrap();
        let data: Vec<_> = data.iter().map(|file| file.strip_prefix(&folder).unwrap()).collect();
        assert_eq!(data, public.iter().map(Path::new).collect::<Vec<_>>());
        for file in held_back {
            assert!(!has(file), "data of a held-back scene");
            assert!(out.path().join(INSTRUCTOR).join(&entry.record.slug).join(file).is_file());
        }
        for SubmissionReport { record: other, .. } in
            report.entries.iter().filter(|other| *other != entry)
        {
            let student = &other.student;
            for name in [&other.name, &other.slug, &student.full_name(), &student.last_name] {
                assert!(!has(name), "{name} is in the folder of {}", entry.record.name);
            }
            assert!(student.id == entry.record.student.id || !has(&student.id));
        }
        let page = fs::read_to_string(folder.join(HTML_FILE)).unwrap();
        for quoted in
            ["href=\"", "src=\""].iter().flat_map(|attribute| page.split(attribute).skip(1))
        {
            let target = quoted.split('"').next().unwrap();
            let there = match target.strip_prefix('#') {
                Some(id) => page.contains(&format!("id=\"{id}\"")),
                None => {
                    let file = target.split('#').next().unwrap();
                    !target.contains("..") && folder.join(file).is_file()
                }
            };
            assert!(there, "{target} on the page of {}", entry.record.name);
        }
        // What the student's page leaves out stands on the instructor's.
        let page = out.path().join(INSTRUCTOR).join(&entry.record.slug).join(HTML_FILE);
        let page = fs::read_to_string(page).unwrap();
        assert!(page.contains("For the instructor: the same image is in"));
        assert!(page.contains("for the instructor: another submission holds the same image"));
    }
}

#[test]
fn released_scenes_come_to_the_student_with_their_pictures_and_nothing_private() {
    let out = tempfile::tempdir().unwrap();
    let mut report = sample::report();
    let check = &mut report.entries[1].record.evidence.checks[2];
    check.held_back = true;
    check.private = "SECRET".into();
    check.summary = "too dark".into();
    check.pictures.truncate(1);
    check.pictures[0].file = "held-back-1.png".into();
    let instructor = out.path().join("instructor/two_cosines");
    fs::create_dir_all(&instructor).unwrap();
    fs::write(instructor.join("held-back-1.png"), "png").unwrap();
    let page = |report: &BatchReport| {
        write(out.path(), report).unwrap();
        fs::read_to_string(out.path().join("two_cosines/report.html")).unwrap()
    };
    let picture = out.path().join("two_cosines/held-back-1.png");
    let before = page(&report);
    assert!(!before.contains("too dark") && !before.contains("held-back-1") && !picture.exists());
    report.released = true;
    let after = page(&report);
    assert!(after.contains("are released, each a changed copy: held-back-1 (cbox)"), "{after}");
    assert!(after.contains("too dark") && after.contains("src=\"./held-back-1.png\""));
    assert!(!after.contains("SECRET"));
    assert_eq!(fs::read(&picture).unwrap(), b"png");
}
