use super::*;

fn said(kind: Platform, component: &str) -> Option<[String; 4]> {
    let label = label_of(kind, component)?;
    Some([label.submission, label.name, label.id, label.submitted])
}

fn of(parts: [&str; 4]) -> Option<[String; 4]> {
    Some(parts.map(str::to_owned))
}

#[test]
fn brightspace_folders_and_flat_files() {
    let own = |component: &str| said(Platform::Brightspace, component);
    let folder = "12345-67890 - Ann Lee - Oct 5, 2019 1159 PM";
    assert_eq!(own(folder), of([folder, "Ann Lee", "12345", "2019-10-05T23:59:00"]));
    for flat in [" - a2_ann_lee.zip", "- a2.zip"] {
        assert_eq!(own(&format!("{folder}{flat}")), own(folder), "{flat}");
    }
    let name = |component: &str| own(component).map(|said| said[1].clone());
    for (component, expected) in [
        ("1-2 - Zoë Smith-O'Neil - May 14, 2020 11:29 AM", "Zoë Smith-O'Neil"),
        ("1-2- Lee, Ann - oct. 5, 2019 905 AM", "Lee, Ann"),
        ("1-2 - Ann - Marie Lee - 5 octobre 2019 23 h 59", "Ann - Marie Lee"),
        ("1-2 - 花子 山田 - Oct 5, 2019 1159 PM.zip", "花子 山田"),
    ] {
        assert_eq!(name(component).as_deref(), Some(expected), "{component}");
    }
    for other in ["Lab 01 Download May 14, 2020 1129 PM", "12345-67890 - Ann Lee", "a2.zip", "1-2"]
    {
        assert_eq!(own(other), None, "{other}");
    }
}

#[test]
fn canvas_files() {
    let own = |component: &str| said(Platform::Canvas, component);
    assert_eq!(own("leeann_101_2001_a2.zip"), of(["leeann_101", "leeann", "101", ""]));
    let late = label_of(Platform::Canvas, "müllerjörg_LATE_102_2002_a2_1_2.zip").unwrap();
    assert_eq!(
        (late.name.as_str(), late.id.as_str(), late.marked_late),
        ("müllerjörg", "102", true)
    );
    // A name of a file with numbers, a name of a person with an underscore.
    assert_eq!(own("doe_x_103_2003_7_8_a2-1.zip").unwrap()[2], "103");
    let anonymous = label_of(Platform::Canvas, "LATE_anon_x7Yz_2004_a2.zip").unwrap();
    assert_eq!((anonymous.id.as_str(), anonymous.marked_late), ("x7Yz", true));
    assert_eq!(own("anon_x7Yz_2004_a2.zip").unwrap()[1], "");
    let upload = |component: &str| canvas_upload(component).unwrap();
    assert_eq!(upload("leeann_101_2001_a2.zip"), (2001, "a2.zip".to_owned()));
    assert_eq!(upload("leeann_LATE_101_2051_a2-1.zip"), (2051, "a2.zip".to_owned()));
    assert_eq!(upload("LATE_anon_x7Yz_2004_a2-x.tar.gz"), (2004, "a2-x.tar.gz".to_owned()));
    assert_eq!(canvas_upload("a2_ann_lee.zip"), None);
    for other in ["a2_ann_lee.zip", "_101_2001_a2.zip", "101_2001_a2.zip", "ann_101_a2.zip"] {
        assert_eq!(own(other), None, "{other}");
    }
}

#[test]
fn moodle_folders_and_flat_files() {
    let own = |component: &str| said(Platform::Moodle, component);
    for component in [
        "Ann Lee_7_assignsubmission_file",
        "Ann Lee_7_assignsubmission_file_",
        "Ann Lee_7_assignsubmission_file_a2.zip",
        "Ann Lee_7_assignsubmission_onlinetext",
    ] {
        assert_eq!(own(component), of(["Ann Lee_7", "Ann Lee", "7", ""]), "{component}");
    }
    assert_eq!(own("Participant_7_assignsubmission_file").unwrap()[1], "");
    for other in ["Ann Lee_7", "assignsubmission_file", "Ann_x_assignsubmission_file"] {
        assert_eq!(own(other), None, "{other}");
    }
}

#[test]
fn gradescope_with_its_metadata() {
    assert_eq!(said(Platform::Gradescope, "submission_12").unwrap()[0], "submission_12");
    assert_eq!(said(Platform::Gradescope, "submission_metadata.yml"), None);
    let text = "---\nsubmission_12:\n  :submitters:\n  - :name: Zoë O'Neil\n    :sid: '0260000001'\n    \
                :email: z@example.org\n  :created_at: 2019-10-06 03:59:01.123 Z\n  :score: 3.0\n  :results:\n    \
                tests:\n    - name: x\n      sid: 9\n  :history:\n  - :id: 9\n    :created_at: 2019-01-01 00:00:00 Z\n\
                submission_13:\n  :submitters:\n  - :name: 'Lee, Ann'\n    :sid:\n    :email: a@example.org\n  \
                - :name: Bo\n    :email: b@example.org\n  :created_at: 2019-10-07 00:00:00 -0400\n";
    let [first, second] = &gradescope_metadata(text)[..] else { panic!("expected two") };
    assert_eq!((first.name.as_str(), first.number.as_str()), ("Zoë O'Neil", "0260000001"));
    assert_eq!(first.submitted, "2019-10-06T03:59:01.123Z");
    assert_eq!((second.name.as_str(), second.number.as_str()), ("Lee, Ann", ""));
    assert_eq!(second.others, ["Bo"]);
    assert_eq!(second.submitted, "2019-10-07T04:00:00Z");
}

#[test]
fn clones_share_a_beginning() {
    assert_eq!(
        prefix_of_clones(&["a2-lights-ada", "a2-lights-ann", "a2-lights-bob-x"]),
        "a2-lights-"
    );
    let with_others = ["a2-ada", "a2-ann", "solution", "a2-bob-x", "a-submodule"];
    assert_eq!(prefix_of_clones(&with_others), "a2-");
    assert_eq!(prefix_of_clones(&["a2-ada"]), "a2-");
    assert_eq!(prefix_of_clones(&["a2-ada", "solution"]), "");
    assert_eq!(prefix_of_clones(&[]), "");
    assert_eq!(prefix_of_clones(&["ada", "bob"]), "");
    assert_eq!(clone("a2-ada-l", "a2-").username, "ada-l");
}
