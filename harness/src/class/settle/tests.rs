use std::path::Path;

use super::*;
use crate::class::late::LatePolicy;
use crate::class::layout::label_of;
use crate::class::roster::Roster;
use crate::class::set_aside;

fn grade(points: f64) -> Grade {
    Grade {
        parts: Vec::new(),
        points,
        points_max: points,
        out_of: 100.0,
        unconfirmed: 0.0,
        remarks: Vec::new(),
    }
}

fn claim(folder: &str, number: &str) -> Claim {
    Claim {
        name: format!("{folder}/a2.zip"),
        slug: folder.to_owned(),
        label: Platform::PLATFORMS.into_iter().find_map(|kind| label_of(kind, folder)),
        number: number.to_owned(),
        full_name: String::new(),
        digest: String::new(),
    }
}

fn roster() -> Roster {
    let text = "OrgDefinedId,Last Name,First Name\n#1,Lee,Ann\n#2,Lee,Ann\n#3,Ode,Bo\n#4,Poe,Cy\n";
    Roster::parse(text.as_bytes(), Path::new("class/list.csv")).unwrap()
}

struct Settled {
    names: Vec<String>,
    standings: Vec<Standing>,
    class: Class,
    grades: Vec<Grade>,
}

fn run(
    claims: &[Claim],
    points: &[f64],
    with_list: bool,
    attempt: Attempt,
    matches: &str,
) -> Settled {
    let matches = Matches::parse(matches, Path::new("matches.toml")).unwrap();
    let roster = roster();
    let policy: LatePolicy =
        serde_json::from_str(r#"{"penalty": 10, "unit": "points", "per": "day"}"#).unwrap();
    let deciding = Deciding {
        roster: with_list.then_some(&roster),
        matches: &matches,
        policy: Some(&policy),
        due: "2019-10-05T23:59:00-04:00",
        attempt,
    };
    let mut grades: Vec<Grade> = points.iter().map(|points| grade(*points)).collect();
    let (standings, class) =
        settle(claims, &mut grades, &[], Platform::Brightspace, &deciding).unwrap();
    let names = standings.iter().map(|(at, _)| claims[*at].slug.clone()).collect();
    Settled { names, standings: standings.into_iter().map(|(_, own)| own).collect(), class, grades }
}

const FIRST: &str = "11-9 - Bo Ode - Oct 5, 2019 1000 PM";
const SECOND: &str = "11-9 - Bo Ode - Oct 6, 2019 1000 PM";

#[test]
fn one_attempt_counts_by_the_policy() {
    let claims = [claim(FIRST, "3"), claim(SECOND, "3")];
    for (attempt, points, counts, after) in [
        (Attempt::Latest, [90.0, 50.0], SECOND, 40.0),
        (Attempt::First, [90.0, 50.0], FIRST, 90.0),
        // The second one is better before what lateness costs.
        (Attempt::Best, [90.0, 95.0], FIRST, 90.0),
        (Attempt::Best, [80.0, 95.0], SECOND, 85.0),
    ] {
        for with_list in [false, true] {
            let settled = run(&claims, &points, with_list, attempt, "");
            assert_eq!(settled.names, [counts], "{attempt:?}");
            assert_eq!(settled.standings[0].set_aside.len(), 1);
            let own = claims.iter().position(|claim| claim.slug == counts).unwrap();
            assert_eq!(settled.grades[own].points, after);
            assert_eq!(settled.class.undecided, []);
        }
    }
    // Attempts with numbers of their own, and one configuration that says nothing.
    let third = claim("12-9 - Bo Ode - Oct 4, 2019 1000 PM", "3");
    let several = [claim(FIRST, ""), claims[1].clone(), third];
    assert_eq!(run(&several, &[1.0; 3], false, Attempt::Latest, "").names, [SECOND]);
    let labels: Vec<Option<&Label>> = claims.iter().map(|claim| claim.label.as_ref()).collect();
    let aside = |attempt, late: &str| {
        let late = late.to_owned();
        let aside = set_aside(&labels, attempt, |stamp| !late.is_empty() && stamp >= &late[..]);
        aside.into_iter().collect::<Vec<_>>()
    };
    assert_eq!(aside(Attempt::Latest, ""), [0]);
    assert_eq!(aside(Attempt::First, ""), [1]);
    assert_eq!(aside(Attempt::Best, ""), [0usize; 0]);
    // The last one is late: the other may be worth more, which is said.
    assert_eq!(aside(Attempt::Latest, "2019-10-06"), [0usize; 0]);
    assert_eq!(aside(Attempt::First, "2019-10-06"), [1]);
    assert_eq!(aside(Attempt::Latest, "2019-10-07"), [0]);
}

#[test]
fn two_students_of_one_name_are_two() {
    let at = |number: &str| format!("{number}-9 - Ann Lee - Oct 5, 2019 1000 PM");
    let claims = [claim(&at("11"), "1"), claim(&at("12"), "2")];
    for with_list in [false, true] {
        let settled = run(&claims, &[1.0, 2.0], with_list, Attempt::Latest, "");
        assert_eq!(settled.names.len(), 2);
        assert_eq!(settled.class.undecided, []);
    }
    // Without numbers nobody knows whose they are, and both may be missing.
    let claims = [claim(&at("11"), ""), claim(&at("12"), "")];
    let settled = run(&claims, &[1.0, 2.0], true, Attempt::Latest, "");
    assert_eq!((settled.names.len(), settled.class.undecided.len()), (2, 2));
    assert_eq!(settled.class.missing.len(), 4);
    assert!(
        settled.class.missing[0].reason.starts_with("perhaps 11-9 - Ann Lee"),
        "{:?}",
        settled.class
    );
    // The instructor decides.
    let decided = format!(
        "[[match]]\nsubmission = \"{}\"\nstudent = \"2\"\n[[match]]\nsubmission = \"{}\"\nstudent = \"none\"\n",
        at("11"),
        at("12")
    );
    let settled = run(&claims, &[1.0, 2.0], true, Attempt::Latest, &decided);
    assert_eq!(settled.names, [at("11")]);
    assert_eq!(settled.standings[0].student.as_ref().unwrap().number, "2");
    assert_eq!(settled.class.not_counted, [format!("{}/a2.zip", at("12"))]);
    let missing: Vec<&str> =
        settled.class.missing.iter().map(|missing| missing.student.number.as_str()).collect();
    assert_eq!(missing, ["1", "3", "4"]);
}

#[test]
fn one_number_twice_is_asked_where_no_platform_tells() {
    let plain = |slug: &str, number: &str, name: &str| Claim {
        name: format!("{slug}.zip"),
        slug: slug.to_owned(),
        label: None,
        number: number.to_owned(),
        full_name: name.to_owned(),
        digest: String::new(),
    };
    let reasons = |claims: &[Claim], attempt, matches: &str| -> Vec<String> {
        let settled = run(claims, &vec![1.0; claims.len()], false, attempt, matches);
        settled.class.undecided.into_iter().map(|own| own.reason).collect()
    };
    let ann = plain("ann", "1", "Ann Lee");
    for (other, reason) in [
        (
            plain("ann2", "#1", "lee ann"),
            "which of the attempts counts is not certain, there is also ann2.zip",
        ),
        (plain("mal", "1", "Mallory"), "the student number 1 is also in mal.zip"),
        (plain("x", "1", ""), "the student number 1 is also in x.zip"),
    ] {
        let said = reasons(&[ann.clone(), other.clone()], Attempt::Latest, "");
        assert_eq!((said.len(), said[0].as_str()), (2, reason));
    }
    let two = [plain("a", "", "Ann Lee"), plain("b", "", "Ann Lee")];
    let said = reasons(&two, Attempt::Best, "");
    assert_eq!(said[0], "the name Ann Lee, without a student number, is also in b.zip");
    // Two people, or one of them does not count; others do not matter.
    let is = |slug: &str, who: &str| {
        format!("[[match]]\nsubmission = \"{slug}\"\nstudent = \"{who}\"\n")
    };
    let both = is("a", "1") + &is("b", "2");
    assert_eq!(reasons(&two, Attempt::Latest, &both), [""; 0]);
    assert_eq!(reasons(&two, Attempt::Latest, &is("a.zip", "none")), [""; 0]);
    assert_eq!(reasons(&[ann, two[0].clone()], Attempt::Latest, ""), [""; 0]);
}

#[test]
fn the_attempt_that_the_instructor_names_counts() {
    let claims = [
        claim("Bo Ode_7_assignsubmission_file", "3"),
        claim("Bo Ode_7_assignsubmission_file_x", "3"),
    ];
    let is = |at: usize, who: &str| {
        let name = &claims[at].name;
        format!("[[match]]\nsubmission = \"{name}\"\nstudent = \"{who}\"\n")
    };
    for with_list in [true, false] {
        for (matches, counts, undecided) in [
            (is(0, "3"), vec![0], 0),
            (is(1, "3"), vec![1], 0),
            (is(0, "3") + &is(1, "none"), vec![0], 0),
            (is(1, "none"), vec![0], 0),
            (is(0, "3") + &is(1, "3"), vec![0, 1], 2),
        ] {
            let settled = run(&claims, &[1.0, 2.0], with_list, Attempt::Latest, &matches);
            let slugs: Vec<&str> = counts.iter().map(|at| claims[*at].slug.as_str()).collect();
            assert_eq!(settled.names, slugs, "{matches}");
            assert_eq!(settled.class.undecided.len(), undecided, "{matches}");
            let asks =
                |own: &Undecided| own.reason.contains("keep the entry of the one that counts");
            assert!(settled.class.undecided.iter().all(asks));
        }
    }
    // It goes before times and points; what is worth more is told.
    let timed = [claim(FIRST, "3"), claim(SECOND, "3")];
    let is = |name: &str| format!("[[match]]\nsubmission = \"{name}\"\nstudent = \"3\"\n");
    for attempt in [Attempt::Latest, Attempt::First, Attempt::Best] {
        for (named, points) in [(FIRST, [1.0, 90.0]), (SECOND, [2.0, 1.0])] {
            let settled = run(&timed, &points, true, attempt, &is(named));
            assert_eq!((settled.names, settled.class.worse.len()), (vec![named.into()], 1));
        }
        // Of several that are named, and of none, the policy tells.
        let both = run(&timed, &[1.0, 90.0], true, attempt, &(is(FIRST) + &is(SECOND)));
        let policy = if attempt == Attempt::First { FIRST } else { SECOND };
        assert_eq!(both.names, [policy]);
    }
    // The same content twice is no question.
    let same = claims.clone().map(|own| Claim { digest: "d".into(), ..own });
    let settled = run(&same, &[1.0, 1.0], true, Attempt::Latest, "");
    assert_eq!((settled.names.len(), settled.class.undecided.len()), (1, 0));
}

#[test]
fn attempts_that_no_time_tells_apart_are_the_instructors() {
    let claims = [
        claim("Bo Ode_7_assignsubmission_file", "3"),
        claim("Bo Ode_7_assignsubmission_file_x", "3"),
    ];
    let settled = run(&claims, &[1.0, 2.0], true, Attempt::Latest, "");
    assert_eq!(settled.names.len(), 2);
    assert!(settled.class.undecided[0].reason.starts_with("which of the attempts counts"));
    assert!(settled.grades[0].remarks[0].starts_with("when it was submitted is not known"));
    let text = settled.class.questions();
    assert!(
        text.contains(
            "# submission = \"Bo Ode_7_assignsubmission_file/a2.zip\"\n# student = \"3\"\n"
        ),
        "{text}"
    );
    // Between several, nothing is filled in.
    let at = "11-9 - Ann Lee - Oct 5, 2019 1000 PM";
    let open = run(&[claim(at, "")], &[1.0], true, Attempt::Latest, "").class.questions();
    assert!(open.contains("# student = \"\"    # Ann Lee (1) or Ann Lee (2)\n"), "{open}");
    // As a comment it is empty, and without the signs it is read.
    let open: String = text
        .lines()
        .filter_map(|line| line.strip_prefix("# "))
        .filter(|line| line.starts_with("[[") || line.contains(" = \""))
        .map(|line| format!("{line}\n"))
        .collect();
    for text in [&text, &open] {
        run(&claims, &[1.0, 2.0], true, Attempt::Latest, text);
    }
}
