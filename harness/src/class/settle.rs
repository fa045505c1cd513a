//! From graded submissions to the standing of students: whose each is, which attempt counts, what lateness costs, who
//! is missing.

use std::collections::{BTreeMap, BTreeSet};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::late::{Late, Policy};
use super::layout::{Kind, Label, canvas_upload};
use super::matching::{Claim, Match, Matches, address, find};
use super::mending::Mended;
use super::overrides::Applied;
use super::roster::{Roster, Student};
use super::{names, owners, stamps};
use crate::columns;
use crate::rubric::Grade;

/// What is added where the instructor names several attempts as one student's.
const BOTH: &str = "; matches.toml names several of them: keep the entry of the one that counts, and say \"none\" of the others";

/// Which of a student's attempts counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Attempt {
    /// The last one
    #[default]
    Latest,
    /// The one with most points, after what lateness costs
    Best,
    /// The first one
    First,
}

impl std::fmt::Display for Attempt {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        let value = clap::ValueEnum::to_possible_value(self);
        f.write_str(value.as_ref().map_or("", |value| value.get_name()))
    }
}

/// By what the standing of students is settled.
pub struct Deciding<'a> {
    /// The class list, if there is one.
    pub roster: Option<&'a Roster>,
    /// The instructor's decisions.
    pub matches: &'a Matches,
    /// What lateness costs, if anything.
    pub policy: Option<&'a Policy>,
    /// When it was due, RFC 3339 with offset.
    pub due: &'a str,
    /// Which attempt counts.
    pub attempt: Attempt,
}

/// What is known of a submission beside what is in it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Standing {
    /// What the platform says.
    pub label: Option<Label>,
    /// Whose it is, by the class list.
    pub student: Option<Student>,
    /// What told so.
    pub matched_by: String,
    /// The student's other attempts, which do not count.
    pub set_aside: Vec<String>,
    /// What the instructor decided on its points.
    pub decisions: Vec<Applied>,
    /// What the instructor mended, if anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mended: Option<Mended>,
    /// Whether there is a policy on lateness, and no time stamp to judge by.
    pub time_unknown: bool,
    /// How late it is; absent without a policy or a time stamp.
    pub late: Option<Late>,
}

impl Standing {
    /// Whether the instructor looked at what is left to them, and confirmed it.
    pub fn is_confirmed(&self) -> bool {
        self.decisions.iter().any(|own| own.decision.part.is_none() && !own.stale)
    }

    /// Whether the class list says that the student has not submitted it.
    pub fn is_draft(&self) -> bool {
        self.student.as_ref().is_some_and(|student| student.draft)
    }
}

/// What is known of the class as a whole.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Class {
    /// Where the submissions come from.
    pub kind: Kind,
    /// File name of the class list; empty without one.
    pub list: String,
    /// Students of the list without a submission that counts.
    pub missing: Vec<Missing>,
    /// What the instructor must decide.
    pub undecided: Vec<Undecided>,
    /// Submissions that the instructor decided not to count.
    pub not_counted: Vec<String>,
    /// Zips that look like the download of a class, among other archives: neither opened nor graded.
    pub unopened: Vec<String>,
    /// Submissions that were graded with other scenes, limits or another version of Umbra than in the last run.
    pub incomparable: Vec<String>,
    /// Decisions on points whose evidence has changed since.
    pub stale: Vec<String>,
    /// Decisions on submissions that are not in this report or do not count.
    pub unused: Vec<String>,
    /// Counting attempts that earn less than another attempt of the student, such as one after the cut-off.
    pub worse: Vec<String>,
}

/// Why submissions of one report are not comparable, for a list of them.
pub const INCOMPARABLE: &str = "graded with other scenes, limits or another version of Umbra than the last run, so \
                                not comparable: grade them again";

/// A student without a submission that counts.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Missing {
    /// Who.
    pub student: Student,
    /// What is known of it; mostly nothing.
    pub reason: String,
}

/// A submission that the instructor must decide on, in `matches.toml`.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Undecided {
    /// What reports call it.
    pub submission: String,
    /// Why it is not certain.
    pub reason: String,
    /// Between whom.
    pub candidates: Vec<Student>,
}

/// Which attempts of a student need not be graded, by index: those that the platform's names alone tell do not
/// count. The best attempt is known only when all are graded; so is whether a late one costs points that another has,
/// as `is_late` says of a time stamp.
pub fn set_aside(
    labels: &[Option<&Label>],
    attempt: Attempt,
    is_late: impl Fn(&str) -> bool,
) -> BTreeSet<usize> {
    let mut people: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (index, label) in labels.iter().enumerate() {
        if let Some(label) = label {
            people.entry(label.person()).or_default().push(index);
        }
    }
    let mut aside = BTreeSet::new();
    for attempts in people.into_values() {
        let stamps: Vec<&str> = attempts
            .iter()
            .map(|&at| labels[at].map_or("", |label| label.submitted.as_str()))
            .collect();
        let counts = by_time(&stamps, attempt).filter(|_| attempt != Attempt::Best);
        if let Some(counts) = counts.filter(|at| !is_late(stamps[*at])) {
            aside.extend(
                attempts.iter().enumerate().filter(|(at, _)| *at != counts).map(|(_, own)| *own),
            );
        }
    }
    aside
}

/// The first or last of some time stamps; `None` if that is not certain.
fn by_time(stamps: &[&str], attempt: Attempt) -> Option<usize> {
    let zone = jiff::tz::TimeZone::UTC;
    let mut times = stamps
        .iter()
        .enumerate()
        .map(|(at, stamp)| Some((stamps::instant(stamp, &zone)?, at)))
        .collect::<Option<Vec<_>>>()?;
    times.sort();
    if attempt != Attempt::First {
        times.reverse();
    }
    match times[..] {
        [(_, only)] => Some(only),
        [(first, at), (second, _), ..] if first != second => Some(at),
        _ => None,
    }
}

/// Settles the standing of graded submissions, charges late ones, and answers which count, by index in order, with
/// what is known of the class. `absent` are those of whom the platform has something that is not graded, with the
/// reason.
///
/// # Errors
/// When the instructor decided for somebody who is not on the list.
pub fn settle(
    claims: &[Claim],
    grades: &mut [Grade],
    absent: &[(Label, String)],
    kind: Kind,
    deciding: &Deciding,
) -> anyhow::Result<(Vec<(usize, Standing)>, Class)> {
    let matches = &deciding.matches.among(claims);
    matches.check(claims)?;
    if let Some(roster) = deciding.roster {
        matches.check_list(roster)?;
    }
    let deciding = &Deciding { matches, ..*deciding };
    let called = |at: usize| address(&claims[at], claims);
    let list = deciding.roster.and_then(|roster| roster.path.file_name());
    let list = list.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
    let mut class = Class { kind, list, ..Class::default() };
    let mut standings = Vec::new();
    let persons = owners::people(claims);
    // Without a list: what the instructor says of one attempt is said of the person, unless it says two things.
    let named = |index: usize| -> Option<String> {
        let word = |at: usize| matches.word(&claims[at]).map(names::number);
        let own = word(index).map(|own| BTreeSet::from([own]));
        let of_person = || -> BTreeSet<String> {
            (0..claims.len())
                .filter(|at| persons[*at] == persons[index] && !matches.is_nobody(&claims[*at]))
                .filter_map(word)
                .collect()
        };
        let mut words = own.unwrap_or_else(of_person).into_iter();
        words.next().filter(|_| words.next().is_none())
    };
    let mut people: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    let mut own_person = Vec::new();
    let mut expected: BTreeMap<usize, String> = BTreeMap::new();
    let mut perhaps: BTreeMap<usize, Vec<String>> = BTreeMap::new();
    for (index, (claim, grade)) in claims.iter().zip(grades.iter_mut()).enumerate() {
        let mut standing = Standing { label: claim.label.clone(), ..Standing::default() };
        let mut person = persons[index].clone();
        if deciding.matches.is_nobody(claim) {
            class.not_counted.push(called(index));
            standings.push(standing);
            continue;
        }
        if let Some(roster) = deciding.roster {
            match find(claim, roster, deciding.matches)? {
                Match::Student(at, by) => {
                    standing.student = Some(roster.students[at].clone());
                    by.clone_into(&mut standing.matched_by);
                    if standing.is_draft() {
                        let platform = roster.kind.title();
                        grade.remarks.push(format!(
                            "{platform} says that it is a draft, which was not submitted"
                        ));
                    }
                    person = format!("on the list {at}");
                    expected.insert(at, String::new());
                }
                Match::Undecided(reason, candidates) => {
                    for at in &candidates {
                        perhaps.entry(*at).or_default().push(called(index));
                    }
                    let candidates =
                        candidates.into_iter().map(|at| roster.students[at].clone()).collect();
                    let submission = called(index);
                    class.undecided.push(Undecided { submission, reason, candidates });
                    person = format!("undecided {index}");
                }
                Match::Nobody => {}
            }
        } else if let Some(number) = named(index) {
            person = format!("number {number}");
        }
        own_person.push((index, person.clone()));
        standing.late = charge(claim, &standing, grade, deciding);
        standing.time_unknown = standing.late.is_none()
            && deciding.policy.is_some()
            && claim.label.as_ref().is_none_or(|own| own.marked_late || own.kind != Kind::Canvas);
        people.entry(person).or_default().push(index);
        standings.push(standing);
    }
    let mut counts: Vec<usize> = Vec::new();
    for attempts in people.into_values() {
        match choose(&attempts, claims, &standings, grades, deciding) {
            Some(own) => {
                let worth = |at: usize| grades[at].points_max;
                let better = attempts.iter().max_by(|a, b| worth(**a).total_cmp(&worth(**b)));
                if let Some(better) = better.filter(|at| worth(**at) > worth(own)) {
                    let why = match matches.word(&claims[own]) {
                        Some(_) if deciding.attempt == Attempt::Best => {
                            "matches.toml names the first"
                        }
                        _ => "`umbra grade --attempt best` counts the better one",
                    };
                    class.worse.push(format!(
                        "{}: {}, {} would have {}; {why}",
                        called(own),
                        columns::points(worth(own)),
                        called(*better),
                        worth(*better)
                    ));
                }
                let others = attempts.iter().filter(|at| **at != own);
                standings[own].set_aside = others.map(|at| called(*at)).collect();
                counts.push(own);
            }
            None => {
                for &own in &attempts {
                    let others: Vec<String> =
                        attempts.iter().filter(|at| **at != own).map(|at| called(*at)).collect();
                    class.undecided.push(Undecided {
                        submission: called(own),
                        reason: format!(
                            "which of the attempts counts is not certain, there is also {}{}",
                            others.join(", "),
                            if matches.word(&claims[own]).is_some() { BOTH } else { "" }
                        ),
                        candidates: standings[own].student.clone().into_iter().collect(),
                    });
                }
                counts.extend(attempts);
            }
        }
    }
    if deciding.roster.is_none() {
        class.undecided.extend(doubles(claims, &own_person, matches));
    }
    for (at, may_be) in perhaps {
        let words = || format!("perhaps {}: decide in matches.toml", may_be.join(" or "));
        expected.entry(at).or_insert_with(words);
    }
    if let Some(roster) = deciding.roster {
        for (label, reason) in absent {
            let claim = Claim { label: Some(label.clone()), ..Claim::default() };
            if let Match::Student(at, _) = find(&claim, roster, deciding.matches)? {
                expected.entry(at).or_insert_with(|| reason.clone());
            }
        }
        for (at, student) in roster.students.iter().enumerate() {
            let reason = expected.get(&at).cloned();
            if reason.as_deref() != Some("") {
                let reason = reason.unwrap_or_default();
                class.missing.push(Missing { student: student.clone(), reason });
            }
        }
    }
    counts.sort_unstable();
    let standings = standings.into_iter().enumerate().filter(|(at, _)| counts.contains(at));
    Ok((standings.collect(), class))
}

/// Submissions that may be one student's, though nothing says that they are attempts: no platform names both, and they
/// have one number under several names, or one name without a number.
fn doubles(claims: &[Claim], persons: &[(usize, String)], matches: &Matches) -> Vec<Undecided> {
    let mut known: BTreeMap<String, Vec<(usize, &str)>> = BTreeMap::new();
    for (at, person) in persons {
        let (number, name) = (owners::number(&claims[*at]), owners::name(&claims[*at]));
        let key = match (names::number(number), names::words(name)) {
            (number, name) if number.is_empty() && name.is_empty() => continue,
            (number, _) if !number.is_empty() => format!("the student number {number}"),
            _ => format!("the name {name}, without a student number,"),
        };
        known.entry(key).or_default().push((*at, person.as_str()));
    }
    let mut found = Vec::new();
    for (key, all) in known {
        let may_be = |(a, own): (usize, &str), (b, other): (usize, &str)| {
            own != other && (claims[a].label.is_none() || claims[b].label.is_none())
        };
        for own in all.iter().filter(|own| matches.word(&claims[own.0]).is_none()) {
            let others = all.iter().filter(|other| may_be(*own, **other));
            let others: Vec<String> = others.map(|own| address(&claims[own.0], claims)).collect();
            if !others.is_empty() {
                found.push(Undecided {
                    submission: address(&claims[own.0], claims),
                    reason: format!("{key} is also in {}", others.join(", ")),
                    candidates: Vec::new(),
                });
            }
        }
    }
    found
}

/// The attempt that counts; `None` if that is not certain.
fn choose(
    attempts: &[usize],
    claims: &[Claim],
    standings: &[Standing],
    grades: &[Grade],
    deciding: &Deciding,
) -> Option<usize> {
    if let [only] = attempts {
        return Some(*only);
    }
    // The one that the instructor names as the student's.
    let mut named =
        attempts.iter().copied().filter(|at| deciding.matches.word(&claims[*at]).is_some());
    let (named, is_alone) = (named.next(), named.next().is_none());
    if named.is_some() && is_alone {
        return named;
    }
    if deciding.attempt == Attempt::Best {
        let most = |at: &&usize| grades[**at].points_max;
        return attempts.iter().rev().max_by(|a, b| most(a).total_cmp(&most(b))).copied();
    }
    let stamps: Vec<&str> =
        attempts.iter().map(|at| stamp(&claims[*at], &standings[*at], deciding)).collect();
    let digest = |at: &usize| claims[*at].digest.as_str();
    let first = &attempts[0];
    let alike = !digest(first).is_empty()
        && attempts.iter().all(|at| digest(at) == digest(first))
        && stamps.iter().all(|stamp| *stamp == stamps[0]);
    by_time(&stamps, deciding.attempt).map(|at| attempts[at]).or_else(|| {
        let uploads: Option<Vec<(u64, String)>> =
            attempts.iter().map(|at| upload(&claims[*at])).collect();
        let by_upload = |uploads: &[(u64, String)]| {
            let all = uploads.iter().zip(attempts);
            let chosen = match deciding.attempt {
                Attempt::First => all.min_by_key(|(own, _)| own.0),
                _ => all.max_by_key(|(own, _)| own.0),
            };
            chosen.map(|(_, at)| *at)
        };
        // Which of two that are the same counts does not matter; Canvas takes feedback on the newer one.
        if alike {
            return uploads.as_deref().and_then(by_upload).or(Some(*first));
        }
        if named.is_some() {
            return None;
        }
        // One file of Canvas, submitted again: its numbers there tell. Others may be files of one attempt.
        let uploads = uploads?;
        let one_file = uploads.iter().all(|own| own.1 == uploads[0].1);
        one_file.then(|| by_upload(&uploads)).flatten()
    })
}

/// Of a file from Canvas, its number there and its name.
fn upload(claim: &Claim) -> Option<(u64, String)> {
    claim.label.as_ref().filter(|label| label.kind == Kind::Canvas)?;
    canvas_upload(claim.name.rsplit('/').next()?)
}

/// When a submission was submitted: as the instructor says, else the platform's names, else the class list.
fn stamp<'a>(claim: &'a Claim, standing: &'a Standing, deciding: &'a Deciding) -> &'a str {
    let label = claim.label.as_ref().map(|label| label.submitted.as_str());
    let listed = standing.student.as_ref().map(|student| student.submitted.as_str());
    let said = deciding.matches.submitted(claim).into_iter().chain(label).chain(listed);
    said.into_iter().find(|stamp| !stamp.is_empty()).unwrap_or_default()
}

/// Charges a submission for being late, or notes that nobody knows.
fn charge(
    claim: &Claim,
    standing: &Standing,
    grade: &mut Grade,
    deciding: &Deciding,
) -> Option<Late> {
    let policy = deciding.policy?;
    let number = match &standing.student {
        Some(student) => &student.number,
        None if deciding.roster.is_none() => owners::number(claim),
        // Whose it is must be decided first: the number that it says may be another's.
        None => claim.label.as_ref().map_or("", |label| &label.number),
    };
    let own = |word: &str| !number.is_empty() && names::number(word) == names::number(number);
    let stamp = stamp(claim, standing, deciding);
    if let Some(mut late) = policy.judge(deciding.due, stamp, own) {
        policy.charge(&mut late, grade);
        return Some(late);
    }
    match &claim.label {
        Some(label) if label.marked_late => grade.remarks.push(format!(
            "late, says {}, but not by how much: no points are taken until the time is known",
            label.kind.title()
        )),
        // Canvas marks those that are late.
        Some(label) if label.kind == Kind::Canvas => {}
        _ => grade
            .remarks
            .push("when it was submitted is not known: no points are taken for lateness".into()),
    }
    None
}

impl Class {
    /// Whether there is anything to say.
    pub fn is_quiet(&self) -> bool {
        let decisions = [
            &self.not_counted,
            &self.unopened,
            &self.incomparable,
            &self.stale,
            &self.unused,
            &self.worse,
        ];
        self.missing.is_empty()
            && self.undecided.is_empty()
            && decisions.iter().all(|lines| lines.is_empty())
    }

    /// What `matches.toml` may begin with: all that is undecided, to be filled in.
    pub fn questions(&self) -> String {
        let mut text = String::from(
            "# Whose submissions are, where the class list and the submissions do not tell. Umbra reads this file on\n\
             # every run and never changes it. `submission` is its name or its folder in the report. `student` is a\n\
             # student number, or \"none\" for a submission that does not count; `submitted` is a time stamp.\n\
             # Of several attempts of a student, name the one that counts, and it alone.\n",
        );
        for Undecided { submission, reason, candidates } in &self.undecided {
            let quoted = toml::Value::String(submission.clone());
            text += &format!("\n# {}\n# [[match]]\n# submission = {quoted}\n", one_line(reason));
            // Between several nothing is filled in, so that nobody takes it by mistake.
            let who = match &candidates[..] {
                [] => "none",
                [only] => only.number.as_str(),
                _ => "",
            };
            text += &format!("# student = {}", toml::Value::String(who.to_owned()));
            let all: Vec<String> =
                candidates.iter().map(|student| one_line(&student.who())).collect();
            text += &match all.len() {
                0 | 1 => "\n".to_owned(),
                _ => format!("    # {}\n", all.join(" or ")),
            };
        }
        text
    }
}

fn one_line(text: &str) -> String {
    crate::harmless::printable(text)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::class::layout::label_of;

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
            label: Kind::PLATFORMS.into_iter().find_map(|kind| label_of(kind, folder)),
            number: number.to_owned(),
            full_name: String::new(),
            digest: String::new(),
        }
    }

    fn roster() -> Roster {
        let text =
            "OrgDefinedId,Last Name,First Name\n#1,Lee,Ann\n#2,Lee,Ann\n#3,Ode,Bo\n#4,Poe,Cy\n";
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
        let policy: Policy =
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
            settle(claims, &mut grades, &[], Kind::Brightspace, &deciding).unwrap();
        let names = standings.iter().map(|(at, _)| claims[*at].slug.clone()).collect();
        Settled {
            names,
            standings: standings.into_iter().map(|(_, own)| own).collect(),
            class,
            grades,
        }
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
}
