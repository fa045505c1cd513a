//! Downloads of each platform, zipped and unpacked.

use std::fs;

use serde_json::Value;
use similar_asserts::assert_eq;

use super::{
    LATE, LIST, Place, brightspace, config, root_of_repository, rows, submission, text, zip,
};

#[test]
fn a_class_of_brightspace_zipped_and_unpacked() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let files = brightspace();
    let entries: Vec<(String, &[u8])> =
        files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    let name = "Lab 02 Download Oct 9, 2019 905 AM";
    place.put(&format!("{name}.zip"), &zip(&entries));
    for (file, bytes) in &files {
        if file.ends_with('/') {
            fs::create_dir_all(place.at(&format!("{name}/{file}"))).unwrap();
        } else {
            place.put(&format!("{name}/{file}"), bytes);
        }
    }
    place.put("list.csv", LIST.as_bytes());
    let mut reports = Vec::new();
    for given in [format!("{name}.zip"), name.to_owned()] {
        let _ = fs::remove_dir_all(place.at("out"));
        let (said, report) = place.grade(&root, &[&given, "--class", "list.csv"]);
        assert!(said.contains("recognized as a download of Brightspace"), "{said}");
        assert!(said.contains("skipped, not submissions: 105-5150 - Cy Poe"), "{said}");
        assert!(said.contains("index.html"), "{said}");
        let rows = rows(&report);
        let of = |who: &str| rows.iter().find(|(name, ..)| name.contains(who)).unwrap().clone();
        let numbers: Vec<(String, String)> =
            rows.iter().map(|(name, number, _)| (name[..3].to_owned(), number.clone())).collect();
        let expected = [
            ("101", "0260000001"),
            ("102", "260000002"),
            ("103", "260000004"),
            ("104", "260000003"),
            ("107", ""),
            ("108", "260000008"),
        ];
        assert_eq!(numbers, expected.map(|(id, number)| (id.to_owned(), number.to_owned())));
        let (name, _, remarks) = of("Bo Ode");
        assert!(name.contains("Oct 8, 2019 110 AM"), "{name}");
        assert!(
            remarks.contains(
                "1 d 1 h 11 min after it was due (2019-10-06 23:59 -04:00): 2 started days; it earned nothing"
            ),
            "{remarks}"
        );
        assert!(!of("Zoë").2.contains("due"), "{}", of("Zoë").2);
        // Names and numbers of the grade book are the class list's, whatever config.json says.
        let book = fs::read_to_string(place.at("out/grades.csv")).unwrap();
        assert!(book.contains("\n260000002,Ode,Bo,"), "{book}");
        let bo = report["submissions"]
            .as_array()
            .unwrap()
            .iter()
            .find(|row| row["slug"] == "102-5150---Bo-Ode---Oct-8--2019-110-AM-a2")
            .unwrap();
        assert_eq!(
            bo["standing"]["set_aside"][0],
            "102-5150 - Bo Ode - Oct 6, 2019 1000 PM/a2.zip"
        );
        let missing: Vec<(&str, &str)> = report["class"]["missing"]
            .as_array()
            .unwrap()
            .iter()
            .map(|own| (text(&own["student"]["number"]), text(&own["reason"])))
            .collect();
        let expected = [
            ("260000005", "an empty submission: it holds only notes.txt"),
            ("260000006", "an empty submission: it holds no file"),
            ("260000007", ""),
        ];
        assert_eq!(missing, expected);
        let undecided = report["class"]["undecided"].as_array().unwrap();
        assert_eq!(undecided.len(), 1);
        assert_eq!(text(&undecided[0]["reason"]), "nobody on the list is Max Other");
        assert!(said.contains("decide in out/matches.toml"), "{said}");
        reports.push(text(&report["submissions"].to_string().into()).to_owned());
    }
    assert_eq!(reports[0], reports[1]);

    // The instructor decides; the class list was kept, and nothing is graded again.
    let questions = fs::read_to_string(place.at("out/matches.toml")).unwrap();
    let own = "submission = \"107-5150 - Max Other - Oct 6, 2019 600 PM/cs101_hw3.zip\"";
    assert!(questions.contains(&format!("# {own}\n# student = \"none\"")), "{questions}");
    place
        .put("out/matches.toml", format!("[[match]]\n{own}\nstudent = \"260000007\"\n").as_bytes());
    let (said, report) = place.grade(&root, &[name]);
    // An empty archive costs nothing to look at again. Beside a late attempt the one in time is graded, too.
    assert!(said.contains("6 of 7 submissions keep their earlier grades"), "{said}");
    assert_eq!(report["class"]["undecided"].as_array().unwrap().len(), 0);
    assert!(
        rows(&report)
            .iter()
            .any(|(name, number, _)| name.starts_with("107") && number == "260000007")
    );
    // What students get names no other and no platform's number.
    let page =
        fs::read_to_string(place.at("out/104-5150---Ann-Lee---Oct-6--2019-900-PM-a2/report.html"))
            .unwrap();
    assert!(!page.contains("260000004") && !page.contains("Bo Ode"), "{page}");
}

#[test]
fn the_best_and_the_first_attempt() {
    let place = Place::new();
    let root = place.assignment(LATE);
    for (file, bytes) in brightspace().iter().filter(|(name, _)| name.contains("Bo Ode")) {
        place.put(&format!("class/{file}"), bytes);
    }
    for (attempt, day) in [("first", "Oct 6"), ("best", "Oct 6"), ("latest", "Oct 8")] {
        let (said, report) = place.grade(&root, &["class", "--attempt", attempt]);
        let rows = rows(&report);
        assert_eq!(rows.len(), 1, "{said}");
        assert!(rows[0].0.contains(day), "{attempt}: {said}");
    }
}

#[test]
fn downloads_of_other_platforms() {
    let zoe = submission(&config("Zoë", "O'Neil", "0260000001"));
    let ann = submission(&config("Ann", "Lee", "260000003"));
    let metadata = "---\nsubmission_11:\n  :submitters:\n  - :name: Zoë O'Neil\n    :sid: '0260000001'\n    \
                    :email: z@example.org\n  :created_at: 2019-10-07 03:00:00.5 Z\nsubmission_12:\n  :submitters:\n  \
                    - :name: Ann Lee\n    :sid: '260000003'\n  :created_at: 2019-10-08 03:59:30 Z\n";
    let unpacked = |folder: &str, number: &str| {
        vec![
            (format!("{folder}/config.json"), config("X", "Y", number).into_bytes()),
            (format!("{folder}/src/lib.rs"), b"fn main() { not_rust }".to_vec()),
        ]
    };
    let gradescope = [
        unpacked("assignment_9_export/submission_11", ""),
        unpacked("assignment_9_export/submission_12", ""),
        vec![(
            "assignment_9_export/submission_metadata.yml".to_owned(),
            metadata.as_bytes().to_vec(),
        )],
    ];
    let moodle = "Identifier,Full name,ID number,Status,Grade,Maximum Grade,Last modified (submission),Last modified (grade)\n\
                  Participant 7,Zoë O'Neil,0260000001,Draft (not submitted),,100,\"Sunday, 6 October 2019, 11:58 PM\",-\n\
                  Participant 8,Ann Lee,260000003,Submitted for grading - 1 day late,,100,\"Tuesday, 8 October 2019, 12:30 AM\",-\n\
                  Participant 9,Gil Tam,260000007,No submission,,100,-,-\n";
    let canvas = "Student,ID,SIS User ID,SIS Login ID,Section,A2 (77)\n    Points Possible,,,,,100\n\
                  \"O'Neil, Zoë\",501,0260000001,zo,1,\n\"Lee, Ann\",502,260000003,al,1,\n\"Tam, Gil\",503,260000007,gt,1,\n";
    let github = "identifier,github_username,github_id,name\n0260000001,zo,1,\n260000003,ann-l,2,\n260000007,gt,3,\n";
    let git = |folder: &str, number: &str| {
        let mut files = unpacked(folder, number);
        files.push((format!("{folder}/.git/HEAD"), b"ref: refs/heads/main\n".to_vec()));
        files
    };
    let unknown = "when it was submitted is not known";
    for (title, files, zipped, list, late) in [
        (
            "Moodle",
            vec![
                ("Zoë O'Neil_7_assignsubmission_file/a2.zip".to_owned(), zoe.clone()),
                ("Ann Lee_8_assignsubmission_file/a2.zip".to_owned(), ann.clone()),
                (
                    "Ann Lee_8_assignsubmission_onlinetext/onlinetext.html".to_owned(),
                    b"hi".to_vec(),
                ),
            ],
            true,
            moodle,
            "2 started days",
        ),
        (
            "Canvas",
            vec![
                ("oneilzoë_501_9001_a2.zip".to_owned(), submission("{}")),
                ("leeann_LATE_502_9002_a2_7_8-1.zip".to_owned(), submission("{}")),
            ],
            true,
            canvas,
            "late, says Canvas, but not by how much",
        ),
        ("Gradescope", gradescope.concat(), true, LIST, "2 started days"),
        (
            "GitHub Classroom",
            [git("a2-submissions/a2-zo", ""), git("a2-submissions/a2-ann-l", "")].concat(),
            false,
            github,
            unknown,
        ),
    ] {
        let place = Place::new();
        let root = place.assignment(LATE);
        place.put("list.csv", list.as_bytes());
        let entries: Vec<(String, &[u8])> =
            files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
        place.put("download.zip", &zip(&entries));
        files.iter().for_each(|(name, bytes)| place.put(&format!("download/{name}"), bytes));
        for given in ["download", "download.zip"].into_iter().take(1 + usize::from(zipped)) {
            let (said, report) = place.grade(&root, &[given, "--class", "list.csv"]);
            assert!(said.contains(&format!("recognized as a download of {title}")), "{said}");
            let mut rows = rows(&report);
            rows.sort_by_key(|(_, number, _)| number.clone());
            let numbers: Vec<&str> = rows.iter().map(|(_, number, _)| number.as_str()).collect();
            assert_eq!(numbers, ["0260000001", "260000003"], "{title} {given}: {said}");
            assert!(rows[1].2.contains(late), "{title} {given}: {}", rows[1].2);
            assert_eq!(rows[0].2.contains(unknown), late == unknown, "{title}: {}", rows[0].2);
            let drafts = [0, 1]
                .map(|at| rows[at].2.contains("says that it is a draft, which was not submitted"));
            assert_eq!(drafts, [title == "Moodle", false], "{title}: {}", rows[0].2);
            let (_, status, _) = place.run(&["status", "--output", "out"]);
            let line = "drafts, not submitted: ask, then `umbra confirm`: 1\n";
            assert_eq!(status.contains(line), drafts[0], "{status}");
            let missing = report["class"]["missing"].as_array().unwrap();
            assert!(missing.iter().any(|own| own["student"]["number"] == "260000007"), "{title}");
            fs::remove_dir_all(place.at("out")).unwrap();
        }
    }
}

#[test]
fn one_who_dresses_up_an_archive_as_a_download_is_one_student() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let own = submission(&config("Ann", "Lee", "260000003"));
    place.put("class/a2_ann.zip", &own);
    let name = "1-2 - Bo Ode - Oct 5, 2019 1159 PM/a2.zip".to_owned();
    place.put("class/a2_eve.zip", &zip(&[(name.clone(), &own)]));
    let folder = "7-5150 - Eve Sol - Oct 5, 2019 1159 PM";
    let (said, report) = place.grade_to(Some(1), &root, &["class"]);
    let names: Vec<String> = rows(&report).into_iter().map(|(name, ..)| name).collect();
    assert_eq!(names, ["a2_ann.zip"], "{said}");
    assert!(said.contains("a2_eve.zip: it looks like a download of Brightspace"), "{said}");
    fs::remove_dir_all(place.at("out")).unwrap();
    place.put("download.zip", &zip(&[(format!("{folder}/a2.zip"), &zip(&[(name, &own)]))]));
    let (said, report) = place.grade(&root, &["download.zip"]);
    assert_eq!(rows(&report).len(), 1, "{said}");
    assert_eq!(rows(&report)[0].0, format!("{folder}/a2.zip"));
}

#[test]
fn what_holds_no_submission_is_said_and_nothing_is_written() {
    let place = Place::new();
    place.put("class/notes.txt", b"x");
    place.put("class.zip", &zip(&[("index.html".to_owned(), b"".as_slice())]));
    let root = root_of_repository();
    for (given, said) in [
        (&["class"][..], "it holds notes.txt"),
        (
            &["class", "--from", "moodle"],
            "in Moodle named like \"First Last_123_assignsubmission_file/\"",
        ),
        (&["nowhere"], "nowhere does not exist"),
    ] {
        let mut all = vec!["grade", "--output", "out", "--root", root.to_str().unwrap()];
        all.extend(given);
        let (code, _, errors) = place.run(&all);
        assert_eq!(code, Some(2), "{errors}");
        assert!(errors.contains(said), "{errors}");
        assert!(!place.at("out").exists());
    }
    // A list that is none, a policy that says too little: the user's own file and line.
    place.put("list.csv", b"a,b\n1,2\n");
    place.put("class/a2.zip", &submission("{}"));
    let mut all = vec!["grade", "class", "--class", "list.csv", "--root", root.to_str().unwrap()];
    all.extend(["--isolation", "reduced", "--held-back", "off", "--output", "out"]);
    let (code, _, errors) = place.run(&all);
    assert_eq!(code, Some(2), "{errors}");
    assert!(
        errors.contains("list.csv:1: expected a header with a column of student numbers"),
        "{errors}"
    );
    let late = place.assignment(r#"{"penalty": 10, "unit": "percent", "per": "day"}"#);
    let (code, _, errors) = place.run(&["grade", "class", "--root", late.to_str().unwrap()]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("config.json:1: late: percent of what?"), "{errors}");
}

#[test]
fn validate_takes_what_grade_takes() {
    let place = Place::new();
    let files = brightspace();
    let entries: Vec<(String, &[u8])> =
        files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    place.put("download.zip", &zip(&entries));
    let (code, said) = place.validate(&["download.zip"]);
    assert_eq!(code, Some(1), "{said}");
    let line = |who: &str| said.lines().find(|line| line.contains(who)).unwrap();
    assert!(line("101-5150 - Zoë").contains("a2_zoë_o'neil.zip"), "{said}");
    assert!(line("107-5150").contains("error: "), "{said}");
    assert!(line("108-5150").contains("error: "), "{said}");
    assert!(said.contains("recognized as a download of Brightspace\n7 submissions: "), "{said}");
    assert!(said.contains("Cy Poe: an empty submission: it holds only notes.txt"), "{said}");
    let (code, json) = place.validate(&["download.zip", "--json"]);
    assert_eq!(code, Some(1));
    let json: Value = serde_json::from_str(&json[..=json.rfind(']').unwrap()]).unwrap();
    assert_eq!(json.as_array().unwrap().len(), 7);

    // Several that are named, all in order but for their images, which are warnings.
    let renders = [
        "offline/cbox_simple_offline",
        "offline/teapot_simple_offline",
        "realtime/cbox_simple_realtime",
        "realtime/teapot_simple_realtime",
    ]
    .map(|path| format!(r#"{{"scene": "", "render": "{path}.exr"}}"#));
    let good = config("Ann", "Lee", "260000003").replace("[]", &format!("[{}]", renders.join(",")));
    place.put("a2_ann_lee.zip", &submission(&good));
    place.put("b/a2_ann_lee.zip", &submission(&good));
    let (code, said) = place.validate(&["a2_ann_lee.zip", "b/a2_ann_lee.zip"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("a2_ann_lee.zip  conforms, 4 warnings\n"), "{said}");
    assert!(said.contains("2 submissions: 2 conforming, 0 not"), "{said}");
    let (code, said) = place.validate(&["a2_ann_lee.zip", "b", "--fix", "out.zip"]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("--fix repacks one submission, found 2"), "{said}");
    // One alone shows its tree as before.
    let (code, said) = place.validate(&["a2_ann_lee.zip"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.starts_with("a2_ann_lee.zip: conforms (0 errors, 4 warnings)"), "{said}");
}
