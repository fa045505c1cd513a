use std::collections::BTreeMap;
use std::path::Path;

use super::*;

fn roster() -> Roster {
    let text = "OrgDefinedId,Username,Last Name,First Name,Email,End-of-Line Indicator\n\
                #0260000001,#zo,O'Neil,Zoë,z@x,#\n#260000002,#al,Lee,Ann,a@x,#\n#260000003,#al2,Lee,Ann,b@x,#\n\
                #260000004,#jm,\"Müller, Dr\",Jörg,j@x,#\n#00123,#x,X,Y,y@x,#\n#123,#v,V,W,w@x,#\n";
    Roster::parse(text.as_bytes(), Path::new("list.csv")).unwrap()
}

fn claim(platform: &str, number: &str, full_name: &str) -> Claim {
    let label = Label {
        kind: Platform::Brightspace,
        id: "9".into(),
        name: platform.into(),
        ..Label::default()
    };
    Claim {
        name: "x/a2.zip".into(),
        slug: "a2".into(),
        label: (!platform.is_empty()).then_some(label),
        number: number.into(),
        full_name: full_name.into(),
        digest: String::new(),
    }
}

fn found(claim: &Claim) -> Match {
    find(claim, &roster(), &Matches::default()).unwrap()
}

#[test]
fn numbers_come_first_then_names_without_accents() {
    for (claim, index) in [
        (claim("", "0260000001", ""), 0),
        // A spreadsheet took the zero away.
        (claim("", "260000001", ""), 0),
        (claim("", "00123", ""), 4),
        (claim("", "123", ""), 5),
        (claim("ZOE O NEIL", "", ""), 0),
        (claim("", "", "dr jorg muller"), 3),
        // Two of one name, and the number tells.
        (claim("Ann Lee", "260000003", "Ann Lee"), 2),
        // A nickname contradicts nobody.
        (claim("", "260000003", "Annie"), 2),
    ] {
        assert!(matches!(found(&claim), Match::Student(at, _) if at == index), "{claim:?}");
    }
}

#[test]
fn nothing_is_guessed() {
    let undecided = |claim: &Claim| match found(claim) {
        Match::Undecided(reason, candidates) => (reason, candidates),
        other => panic!("{other:?}"),
    };
    let (reason, candidates) = undecided(&claim("Ann Lee", "", ""));
    assert_eq!(candidates, [1, 2]);
    assert_eq!(reason, "2 students fit: Ann Lee (260000002), Ann Lee (260000003)");
    let (reason, candidates) = undecided(&claim("Zoë O'Neil", "260000002", ""));
    assert_eq!(candidates, [0, 1]);
    assert!(
        reason.starts_with("student number says Ann Lee (260000002), the platform's name"),
        "{reason}"
    );
    let (reason, _) = undecided(&claim("Max Other", "999", "M Other"));
    assert_eq!(reason, "nobody on the list is Max Other, M Other, 999");
    assert_eq!(undecided(&claim("", "", "")).0, "it says neither name nor number");
}

#[test]
fn the_instructor_decides() {
    let path = Path::new("matches.toml");
    let read = |text: &str| Matches::parse(text, path);
    let own = claim("Ann Lee", "", "");
    let text = "# mine\n[[match]]\nsubmission = \"x/a2.zip\"\nstudent = \"#260000003\"\nsubmitted = \"2019-10-07 10:00\"\n";
    let matches = read(text).unwrap();
    let found = find(&own, &roster(), &matches).unwrap();
    assert_eq!(found, Match::Student(2, "matches.toml"));
    assert_eq!(matches.submitted(&own), Some("2019-10-07T10:00:00"));
    for word in ["none", "None", " NONE "] {
        let none = read(&text.replace("#260000003", word)).unwrap();
        assert_eq!(find(&own, &roster(), &none).unwrap(), Match::Nobody);
    }
    let wrong = read(&text.replace("#260000003", "9")).unwrap();
    let error = find(&own, &roster(), &wrong).unwrap_err().to_string();
    assert!(error.starts_with("matches.toml:2: nobody on list.csv has the number"), "{error}");
    for (text, expected) in [
        ("[[match]]\nsubmission = \"a\"\nstudnt = \"1\"", "matches.toml:3: unknown field"),
        ("\n[[match]]\nsubmission = \"a\"", "matches.toml:2: expected student"),
        ("[[match]]\nsubmission = \"a\"\nsubmitted = \"noon\"", "matches.toml:3: expected a time"),
        (
            "[[match]]\nsubmission = \"a\"\nstudent = \"1\"\nsubmitted = \"2019-10-07\"",
            "matches.toml:4: expected a time",
        ),
        ("[[match]]\nsubmission = \"a\"\nstudent = \"\"", "matches.toml:1: student says nothing"),
        (
            "[[match]]\nsubmission = \"a\"\nstudent = \"1\"\n[[match]]\nsubmission = \"a\"\nstudent = \"2\"",
            "matches.toml:4: submission \"a\" has a student already, on line 1; one submission has one student",
        ),
        (
            "[[match]]\nsubmission = \"a\"\nsubmitted = \"2019-10-07 10:00\"\n\
             [[match]]\nsubmission = \"a\"\nsubmitted = \"2019-10-07 11:00\"",
            "matches.toml:4: submission \"a\" has a time already, on line 1",
        ),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
    // Two that say different things are one decision, and TOML's own dates are read.
    let both = "[[match]]\nsubmission = \"x/a2.zip\"\nstudent = \"none\"\n\
                [[match]]\nsubmission = \"x/a2.zip\"\nsubmitted = 2019-10-07T10:00:00-04:00\n";
    let both = read(both).unwrap();
    assert!(both.is_nobody(&own));
    assert_eq!(both.submitted(&own), Some("2019-10-07T14:00:00Z"));
}

#[test]
fn one_submission_under_two_names_has_one_student() {
    let own = claim("Ann Lee", "", "");
    let check = |second: &str| {
        let text =
            format!("[[match]]\nsubmission = \"x/a2.zip\"\nstudent = \"260000002\"\n{second}");
        let matches = Matches::parse(&text, Path::new("matches.toml")).unwrap();
        let claims = [own.clone()];
        matches.among(&claims).check(&claims).map_err(|error| error.to_string())
    };
    let second = "[[match]]\nsubmission = \"a2\"\nstudent = \"none\"\n";
    let error = check(second).unwrap_err();
    assert!(
        error.starts_with("matches.toml:4: submission \"a2\" has a student already, on line 1")
    );
    check(&second.replace("a2", "b2")).unwrap();
    check("[[match]]\nsubmission = \"a2\"\nsubmitted = \"2019-10-07 11:00\"\n").unwrap();
}

#[test]
fn a_time_is_of_the_content_that_it_was_said_of() {
    let text = "[[match]]\nsubmission = \"x/a2.zip\"\nsubmitted = \"2019-10-07 10:00\"\n";
    let claims = [claim("Ann Lee", "", "")];
    let with = |known: &str| {
        let mut own = Matches::parse(text, Path::new("matches.toml")).unwrap().among(&claims);
        let time = own.times().next().unwrap().0;
        let known = BTreeMap::from([(time, vec![known.to_owned()])]);
        let lines = own.without_outdated(&known, |_| "new".to_owned());
        (own.submitted(&claims[0]).map(str::to_owned), lines)
    };
    assert_eq!(with("new"), (Some("2019-10-07T10:00:00".to_owned()), Vec::new()));
    let (time, lines) = with("old");
    assert_eq!(time, None);
    assert!(
        lines[0].starts_with("matches.toml:1: the time was of an older submission"),
        "{lines:?}"
    );
}

#[test]
fn a_group_is_decided_between_its_members() {
    let mut group = claim("Zo\u{eb} O'Neil", "", "");
    group.label.as_mut().unwrap().others = vec!["J\u{f6}rg M\u{fc}ller Dr".to_owned()];
    let Match::Undecided(reason, members) = found(&group) else { panic!("it is decided") };
    assert_eq!(members, [0, 3]);
    assert!(reason.contains("one submission has one student"), "{reason}");
}
