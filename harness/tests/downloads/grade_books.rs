//! Grades go back to the platform, and no export is lost or taken for a submission.

use std::fs;

use serde_json::Value;
use similar_asserts::assert_eq;

use super::{LATE, LIST, Place, brightspace, config, submission, text, zip};

#[test]
fn grades_go_back_where_the_class_list_came_from() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let files = brightspace();
    let entries: Vec<(String, &[u8])> =
        files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
    place.put("Lab 02 Download Oct 9, 2019 905 AM.zip", &zip(&entries));
    place.put("list.csv", LIST.as_bytes());
    let download = "Lab 02 Download Oct 9, 2019 905 AM.zip";
    let also = ["--class", "list.csv", "--export", "feedback", "--export", "brightspace"];
    place.grade(&root, &[&[download][..], &also].concat());
    let book = fs::read_to_string(place.at("out/brightspace.csv")).unwrap();
    assert!(book.starts_with("OrgDefinedId,Username,a2 Points Grade,End-of-Line"), "{book}");
    let root = root.to_str().unwrap().to_owned();
    // What cannot be exported is said before any work.
    let other = ["grade", download, "--root", &root, "--class", "list.csv", "--export", "canvas"];
    let (code, _, errors) = place.run(&[&other[..], &["--output", "other"]].concat());
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("expected the export of Canvas"), "{errors}");
    assert!(!place.at("other").exists());
    // Feedback in the folders of the download: each student's own page, and nothing else.
    let open = |bytes: Vec<u8>| zip::ZipArchive::new(std::io::Cursor::new(bytes)).unwrap();
    let mut feedback = open(fs::read(place.at("out/feedback.zip")).unwrap());
    let names: Vec<String> = feedback.file_names().map(|name| name.unwrap().into_owned()).collect();
    assert_eq!(names.len(), 5, "{names:?}");
    let own = "101-5150 - Zoë O'Neil - Oct 6, 2019 1158 PM/feedback.zip";
    assert!(names.iter().any(|name| name == own), "{names:?}");
    assert!(!names.iter().any(|name| name.contains("Max Other")), "{names:?}");
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(&mut feedback.by_name(own).unwrap(), &mut bytes).unwrap();
    let inner = open(bytes);
    let names: Vec<String> = inner.file_names().map(|name| name.unwrap().into_owned()).collect();
    assert_eq!(names, ["report.html"]);
    let export = |format: &str, more: &[&str]| {
        let mut all =
            vec!["export", "grades", "--output", "out", "--root", &root, "--format", format];
        all.extend(more);
        let (code, said, errors) = place.run(&all);
        (code, said + &errors, fs::read_to_string(place.at("grades")).unwrap_or_default())
    };
    let (code, said, book) = export("brightspace", &["--item", "A2, lights"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("grades: 4 grades for Brightspace"), "{said}");
    assert!(
        said.contains("107-5150 - Max Other - Oct 6, 2019 600 PM/cs101_hw3.zip: not decided yet"),
        "{said}"
    );
    // The platform's own columns and keys, zeros in front too; nobody who is missing.
    assert_eq!(
        book,
        "OrgDefinedId,Username,\"A2, lights Points Grade\",End-of-Line Indicator\n\
         #0260000001,#zoneil,0.00,#\n#260000002,#bode,0.00,#\n#260000004,#alee2,0.00,#\n\
         #260000003,#alee,0.00,#\n"
    );
    let (code, said, _) = export("canvas", &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("expected the export of Canvas, found that of Brightspace"), "{said}");

    let (code, said, _) = export("gradescope", &[]);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("takes one submission at a time, and there are 6"), "{said}");
    let report: Value =
        serde_json::from_slice(&fs::read(place.at("out/report.json")).unwrap()).unwrap();
    let slug = text(&report["submissions"][0]["slug"]).to_owned();
    let (_, _, results) = export("gradescope", &["--only", &slug]);
    let results: Value = serde_json::from_str(&results).unwrap();
    assert_eq!(results["score"], 0.0);
    assert_eq!(results["tests"].as_array().unwrap().len(), 9);
    assert_eq!(results["tests"][0]["number"], "1.1");
    assert_eq!(results["tests"][0]["status"], "failed");

    let (_, _, xml) = export("junit", &[]);
    assert_eq!(xml.matches("<testsuite name=").count(), 6, "{xml}");
    assert_eq!(xml.matches("<testcase ").count(), 6 * 9);
    assert!(xml.contains("tests=\"9\" failures=\"8\" errors=\"0\""), "{xml}");
}

/// Names that break a naive import or grade book: signs of other scripts, a comma, an apostrophe, two of one name,
/// zeros in front. Also an empty archive, and a submission to another course by somebody who is not on the list.
#[test]
fn odd_names_come_back_in_the_grade_books_of_canvas_and_moodle() {
    let own = |first: &str, last: &str, number: &str| submission(&config(first, last, number));
    let other = zip(&[("main.py".to_owned(), b"print()".as_slice())]);
    let moodle =
        |name: &str, bytes: Vec<u8>| (format!("{name}_assignsubmission_file/a2.zip"), bytes);
    let canvas = |name: &str, bytes: Vec<u8>| (format!("{name}_a2.zip"), bytes);
    let (hanako, jr) = (own("花子", "山田", "007"), own("Bo", "Smith, Jr", "260000002"));
    let (ann, ann2) = (own("Ann", "Lee", "260000003"), own("Ann", "Lee", "260000004"));
    let moodle_list = "Identifier,Full name,ID number,Grade,Maximum Grade,Last modified (grade)\n\
                       Participant 1,花子 山田,007,,100,-\nParticipant 2,\"Bo Smith, Jr\",260000002,,100,-\n\
                       Participant 3,Ann Lee,260000003,,100,-\nParticipant 4,Ann Lee,260000004,,100,-\n\
                       Participant 5,Eve Sol,260000005,,100,-\nParticipant 6,Gil Tam,260000006,,100,-\n";
    let canvas_list = "Student,ID,SIS User ID,SIS Login ID,Section,a2 (77)\n    Points Possible,,,,,100\n\
                       \"山田, 花子\",1,007,hanako,1,\n\"Smith, Jr, Bo\",2,260000002,bo,1,\n\
                       \"Lee, Ann\",3,260000003,al,1,\n\"Lee, Ann\",4,260000004,al2,1,\n\
                       \"Sol, Eve\",5,260000005,es,1,\n\"Tam, Gil\",6,260000006,gt,1,\n";
    for (format, list, files, book) in [
        (
            "moodle",
            moodle_list,
            [
                moodle("花子 山田_1", hanako.clone()),
                moodle("Bo Smith, Jr_2", jr.clone()),
                moodle("Ann Lee_3", ann.clone()),
                moodle("Ann Lee_4", ann2.clone()),
                moodle("Eve Sol_5", Vec::new()),
                moodle("Max Other_9", other.clone()),
            ],
            "Identifier,Full name,ID number,Maximum Grade,Last modified (grade),Grade\n\
             Participant 1,花子 山田,007,100,-,0.00\nParticipant 2,\"Bo Smith, Jr\",260000002,100,-,0.00\n\
             Participant 3,Ann Lee,260000003,100,-,0.00\nParticipant 4,Ann Lee,260000004,100,-,0.00\n",
        ),
        (
            "canvas",
            canvas_list,
            [
                canvas("山田花子_1_901", hanako),
                canvas("smithjrbo_2_902", jr),
                canvas("leeann_3_903", ann),
                canvas("leeann_4_904", ann2),
                canvas("soleve_5_905", Vec::new()),
                canvas("othermax_9_909", other),
            ],
            "Student,ID,SIS User ID,SIS Login ID,Section,a2 (77)\n\"山田, 花子\",1,007,hanako,1,0.00\n\
             \"Smith, Jr, Bo\",2,260000002,bo,1,0.00\n\"Lee, Ann\",3,260000003,al,1,0.00\n\
             \"Lee, Ann\",4,260000004,al2,1,0.00\n",
        ),
    ] {
        let place = Place::new();
        let root = place.assignment(LATE);
        place.put("list.csv", list.as_bytes());
        let entries: Vec<(String, &[u8])> =
            files.iter().map(|(name, bytes)| (name.clone(), bytes.as_slice())).collect();
        place.put("download.zip", &zip(&entries));
        let (said, report) = place.grade(
            &root,
            &["download.zip", "--class", "list.csv", "--export", format, "--export", "feedback"],
        );
        let exported = fs::read_to_string(place.at(&format!("out/{format}.csv"))).unwrap();
        let sorted = |text: &str| {
            let (head, rows) = text.split_once('\n').unwrap();
            let mut rows: Vec<String> = rows.lines().map(str::to_owned).collect();
            rows.sort();
            (head.to_owned(), rows)
        };
        assert_eq!(sorted(&exported), sorted(book), "{said}");
        // Nobody could open Eve's, and nobody knows whose Max's is.
        assert!(said.contains("a2.zip: nobody could open it"), "{said}");
        assert!(said.contains("a2.zip: not decided yet"), "{said}");
        let missing = report["class"]["missing"].as_array().unwrap();
        assert_eq!(missing.len(), 1, "{missing:?}");
        assert_eq!(missing[0]["student"]["number"], "260000006");
        // Feedback goes back under the names that the platform gave.
        let feedback = fs::File::open(place.at("out/feedback.zip")).unwrap();
        let feedback = zip::ZipArchive::new(feedback).unwrap();
        let names: Vec<String> =
            feedback.file_names().map(|name| name.unwrap().into_owned()).collect();
        for (name, _) in &files {
            let own = name.split("_a").next().unwrap();
            let is_there = names.iter().any(|name| name.starts_with(own));
            assert_eq!(is_there, !own.to_lowercase().contains("other"), "{own}: {names:?}");
        }
    }
}

#[test]
fn an_export_among_the_submissions_is_none() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("class/a2_ann.zip", &submission(&config("Ann", "Lee", "0260000003")));
    let (_, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"].as_array().unwrap().len(), 1);
    let export = ["export", "class/fb.zip", "--format", "feedback", "--output", "out"];
    let (code, said, errors) = place.run(&export);
    assert_eq!(code, Some(0), "{said}{errors}");
    // A copy that a browser made of it is one, too.
    place.put("class/sub/fb (1).zip", &fs::read(place.at("class/fb.zip")).unwrap());
    let (said, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"].as_array().unwrap().len(), 1, "{said}");
    for file in ["fb.zip", "fb (1).zip"] {
        assert!(said.contains(&format!("{file} (an export of this report)")), "{said}");
    }
    fs::remove_dir_all(place.at("class/sub")).unwrap();
    // Another file of that name is somebody's.
    place.put("class/fb.zip", &submission(&config("Bo", "Ode", "260000002")));
    let (said, report) = place.grade(&root, &["class"]);
    assert_eq!(report["submissions"].as_array().unwrap().len(), 2, "{said}");
}

#[test]
fn no_report_is_lost_when_nobody_reads_what_is_printed() {
    let place = Place::new();
    let root = place.assignment(LATE);
    place.put("class/a2.zip", &submission(&config("Ann", "Lee", "0260000003")));
    let root = root.to_str().unwrap();
    let grade =
        ["grade", "class", "--held-back", "off", "--isolation", "reduced", "--output", "out"];
    let pipe = Some(nix::sys::signal::Signal::SIGPIPE as i32);
    assert_eq!(place.run_unread(&[&grade[..], &["--root", root]].concat()), pipe);
    for file in ["report.json", "grades.csv", "report.html", "a2/report.html"] {
        assert!(place.at("out").join(file).is_file(), "{file}");
    }
    let check = ["check", "class/a2.zip", "--output", "own", "--root", root];
    assert_eq!(place.run_unread(&check), pipe);
    for file in ["report.html", "a2/report.html", "a2/last-check.json"] {
        assert!(place.at("own").join(file).is_file(), "{file}");
    }
    assert_eq!(place.run_unread(&["status", "--output", "out"]), pipe);
}
