use super::*;
use crate::class::{Claim, Matches};
use crate::report::{SubmissionReport, sample};

fn of(text: &str) -> Overrides {
    Overrides::parse(text, Path::new(OVERRIDES)).unwrap()
}

const SET: &str = "[[override]]\nstudent = \"#0260000002\"\npart = \"1.3\"\npoints = 15\nreason = \"typo\"\n\
                   by = \"Eve\"\nwhen = \"2019-10-20T10:00:00Z\"\n";

#[test]
fn a_part_is_set_and_images_are_confirmed() {
    let report = sample::report();
    let claim = |entry: &SubmissionReport| Claim {
        slug: entry.record.slug.clone(),
        number: entry.record.student.id.clone(),
        ..Claim::default()
    };
    let claims: Vec<Claim> = report.entries.iter().map(claim).collect();
    let owners = Owners::of(&claims, None, &Matches::default()).unwrap();
    let run = |index: usize, text: &str| {
        let entry = &report.entries[index];
        let mut grade = entry.grade.clone();
        let subject = Subject {
            slug: &entry.record.slug,
            digest: &entry.record.digest,
            evidence: &entry.record.evidence,
        };
        let applied = of(text).on(&owners).apply(&subject, &mut grade);
        (grade, applied, fingerprint(&subject, &entry.grade.parts[2..3]))
    };
    // It was 9.85 of 64.85..84.85.
    let (grade, applied, now) = run(1, SET);
    assert_eq!((grade.points, grade.points_max), (70.0, 90.0));
    assert_eq!(
        grade.remarks.last().unwrap(),
        "part 1.3 was set by the instructor to 15 points instead of 9.85: typo (Eve, 2019-10-20)"
    );
    assert!(grade.parts[2].reason.starts_with("set by the instructor: typo; before that: "));
    assert!(!applied[0].stale);
    // Evidence that has changed since.
    let with = |evidence: &str| format!("{SET}evidence = \"{evidence}\"\n");
    assert!(run(1, &with("0123456789abcdef")).1[0].stale);
    assert!(!run(1, &with(&now)).1[0].stale);
    // The last one counts; another student's is nobody else's.
    let (grade, applied, _) = run(1, &format!("{SET}{}", SET.replace("15", "0")));
    assert_eq!((grade.points, applied.len()), (55.0, 1));
    assert_eq!(run(0, SET).1, []);
    // 11.44 wait for the instructor, whoever it is by folder or number.
    let slug = &report.entries[2].record.slug;
    let confirm = format!("[[confirm]]\nstudent = \"{slug}\"\nreason = \"his noise\"\n");
    let (grade, applied, _) = run(2, &confirm);
    assert_eq!((grade.points, grade.points_max, grade.unconfirmed), (11.44, 11.44, 0.0));
    // What was said to wait is said no more.
    assert_eq!(grade.remarks[0], "the source does not build");
    let reasons: Vec<&str> = grade.parts.iter().map(|part| part.reason.as_str()).collect();
    assert!(!reasons.concat().contains("once the instructor confirms"), "{reasons:?}");
    assert!(
        applied[0].words().contains("confirms what the images show, 11.44 points instead of 0")
    );
    let (grade, applied, _) = run(0, &confirm.replace(slug.as_str(), "260000001"));
    assert_eq!(grade.points, report.entries[0].grade.points);
    assert!(applied[0].words().starts_with("the instructor looked at it"));
    let none = Owners::of(&[], None, &Matches::default()).unwrap();
    assert_eq!(
        of(SET).on(&none).unused(|_| true, &["1.3"]),
        ["overrides.toml:1: there is no submission of \"#0260000002\""]
    );
    let bound = of(SET).on(&owners);
    assert_eq!(bound.unused(|_| true, &["1.3"]), [""; 0]);
    assert_eq!(
        bound.unused(|_| true, &["1.1"]),
        ["overrides.toml:1: there is no part 1.3; it has 1.1"]
    );
    let slug = &claims[1].slug;
    let aside = format!("overrides.toml:1: {slug} does not count");
    assert_eq!(bound.unused(|own| own != slug, &["1.3"]), [aside]);
}

#[test]
fn what_is_written_is_read_again_and_slips_have_a_line() {
    let decision = of(SET).0.remove(0).decision;
    assert_eq!(of(&entry(&decision).unwrap()).0[0].decision, decision);
    for (text, expected) in [
        (
            "[[override]]\nstudent = \"1\"\nreason = \"x\"\n",
            "overrides.toml:1: an override needs part",
        ),
        (&SET.replace("15", "-1"), "overrides.toml:1: expected points of 0 or more"),
        (&SET.replace("typo", " "), "overrides.toml:1: expected a reason"),
        (&SET.replace("override", "confirm"), "overrides.toml:1: a confirmation has neither"),
        (&SET.replace("points", "pionts"), "overrides.toml:4: unknown field"),
    ] {
        let error = Overrides::parse(text, Path::new(OVERRIDES)).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
    for (slip, hint) in [
        (SET.replace("\"typo\"", "\u{201c}typo\u{201d}"), "; hint: write straight quotes: \""),
        (SET.replace("#0260000002", "sub\\a2"), "; hint: write / in a path"),
    ] {
        let error = Overrides::parse(&slip, Path::new(OVERRIDES)).unwrap_err().to_string();
        assert!(error.ends_with(hint), "{error}");
    }
}
