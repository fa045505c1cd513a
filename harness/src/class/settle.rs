//! From graded submissions to the standing of students: whose each is, which attempt counts, what lateness costs, who
//! is missing.

use std::collections::{BTreeMap, BTreeSet};

use super::attempts::{choose, stamp};
use super::claim::{Claim, address};
use super::late::Lateness;
use super::layout::{Label, Platform};
use super::matches::Matches;
use super::matching::{Match, find};
use super::standing::{Attempt, Class, Deciding, Missing, Standing, Undecided};
use super::{names, owners};
use crate::columns;
use crate::rubric::Grade;

/// What is added where the instructor names several attempts as one student's.
const BOTH: &str = "; matches.toml names several of them: keep the entry of the one that counts, and say \"none\" of the others";

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
    kind: Platform,
    deciding: &Deciding,
) -> anyhow::Result<(Vec<(usize, Standing)>, Class)> {
    let matches = &deciding.matches.among(claims);
    matches.check(claims)?;
    if let Some(roster) = deciding.roster {
        matches.check_list(roster)?;
    }
    let deciding = &Deciding { matches, ..*deciding };
    let mut settling = Settling::new(claims, kind, deciding);
    for (index, grade) in grades.iter_mut().enumerate() {
        settling.add(index, grade)?;
    }
    let mut counts = settling.choose(grades);
    if deciding.roster.is_none() {
        settling.class.undecided.extend(doubles(claims, &settling.own_person, matches));
    }
    settling.find_missing(absent)?;
    counts.sort_unstable();
    let standings = settling.standings.into_iter().enumerate();
    Ok((standings.filter(|(at, _)| counts.contains(at)).collect(), settling.class))
}

/// What is settled so far.
struct Settling<'a> {
    claims: &'a [Claim],
    deciding: &'a Deciding<'a>,
    /// Whose each submission is by what it says itself.
    persons: Vec<String>,
    class: Class,
    standings: Vec<Standing>,
    /// The submissions of each person.
    people: BTreeMap<String, Vec<usize>>,
    /// Whose each submission is that may count.
    own_person: Vec<(usize, String)>,
    /// Why nothing of a student of the list counts; empty where something does.
    reasons: BTreeMap<usize, String>,
    /// What may be a student's of the list.
    perhaps: BTreeMap<usize, Vec<String>>,
}

impl<'a> Settling<'a> {
    fn new(claims: &'a [Claim], kind: Platform, deciding: &'a Deciding<'a>) -> Self {
        let list = deciding.roster.and_then(|roster| roster.path.file_name());
        let list = list.map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        Self {
            claims,
            deciding,
            persons: owners::people(claims),
            class: Class { kind, list, ..Class::default() },
            standings: Vec::new(),
            people: BTreeMap::new(),
            own_person: Vec::new(),
            reasons: BTreeMap::new(),
            perhaps: BTreeMap::new(),
        }
    }

    /// What reports call a submission.
    fn called(&self, at: usize) -> String {
        address(&self.claims[at], self.claims)
    }

    /// Settles whose the next submission is and how late it is.
    fn add(&mut self, index: usize, grade: &mut Grade) -> anyhow::Result<()> {
        let claim = &self.claims[index];
        let mut standing = Standing { label: claim.label.clone(), ..Standing::default() };
        if self.deciding.matches.is_nobody(claim) {
            self.class.not_counted.push(self.called(index));
            self.standings.push(standing);
            return Ok(());
        }
        let person = self.person(index, &mut standing)?;
        if let Some(roster) = self.deciding.roster.filter(|_| standing.is_draft()) {
            let platform = roster.kind.title();
            grade
                .remarks
                .push(format!("{platform} says that it is a draft, which was not submitted"));
        }
        self.own_person.push((index, person.clone()));
        standing.late = charge(claim, &standing, grade, self.deciding);
        standing.time_unknown = standing.late.is_none()
            && self.deciding.policy.is_some()
            && claim
                .label
                .as_ref()
                .is_none_or(|own| own.marked_late || own.kind != Platform::Canvas);
        self.people.entry(person).or_default().push(index);
        self.standings.push(standing);
        Ok(())
    }

    /// Whose a submission is, in a word that is the same for all of one person.
    fn person(&mut self, index: usize, standing: &mut Standing) -> anyhow::Result<String> {
        let own = self.persons[index].clone();
        let Some(roster) = self.deciding.roster else {
            return Ok(self.named(index).map_or(own, |number| format!("number {number}")));
        };
        match find(&self.claims[index], roster, self.deciding.matches)? {
            Match::Student(at, by) => {
                standing.student = Some(roster.students[at].clone());
                by.clone_into(&mut standing.matched_by);
                self.reasons.insert(at, String::new());
                Ok(format!("on the list {at}"))
            }
            Match::Undecided(reason, candidates) => {
                let submission = self.called(index);
                for at in &candidates {
                    self.perhaps.entry(*at).or_default().push(submission.clone());
                }
                let candidates =
                    candidates.into_iter().map(|at| roster.students[at].clone()).collect();
                self.class.undecided.push(Undecided { submission, reason, candidates });
                Ok(format!("undecided {index}"))
            }
            Match::Nobody => Ok(own),
        }
    }

    /// Whose the instructor says that a submission is, where there is no list. What is said of one attempt is said of
    /// the person, unless it says two things.
    fn named(&self, index: usize) -> Option<String> {
        let Deciding { matches, .. } = self.deciding;
        let word = |at: usize| matches.word(&self.claims[at]).map(names::number);
        let own = word(index).map(|own| BTreeSet::from([own]));
        let is_of_person = |at: &usize| {
            self.persons[*at] == self.persons[index] && !matches.is_nobody(&self.claims[*at])
        };
        let of_person = || {
            (0..self.claims.len()).filter(is_of_person).filter_map(word).collect::<BTreeSet<_>>()
        };
        let mut words = own.unwrap_or_else(of_person).into_iter();
        words.next().filter(|_| words.next().is_none())
    }

    /// Chooses the attempts that count, and says where that is not certain, or where another one is worth more.
    fn choose(&mut self, grades: &[Grade]) -> Vec<usize> {
        let mut counts: Vec<usize> = Vec::new();
        for attempts in std::mem::take(&mut self.people).into_values() {
            let chosen = choose(&attempts, self.claims, &self.standings, grades, self.deciding);
            let others = |own: usize| -> Vec<String> {
                attempts.iter().filter(|at| **at != own).map(|at| self.called(*at)).collect()
            };
            let Some(own) = chosen else {
                let undecided: Vec<Undecided> =
                    attempts.iter().map(|own| self.uncertain(*own, &others(*own))).collect();
                self.class.undecided.extend(undecided);
                counts.extend(attempts);
                continue;
            };
            let set_aside = others(own);
            self.class.worse.extend(self.worse(own, &attempts, grades));
            self.standings[own].set_aside = set_aside;
            counts.push(own);
        }
        counts
    }

    /// The question whether one of several attempts counts.
    fn uncertain(&self, own: usize, others: &[String]) -> Undecided {
        let is_named = self.deciding.matches.word(&self.claims[own]).is_some();
        Undecided {
            submission: self.called(own),
            reason: format!(
                "which of the attempts counts is not certain, there is also {}{}",
                others.join(", "),
                if is_named { BOTH } else { "" }
            ),
            candidates: self.standings[own].student.clone().into_iter().collect(),
        }
    }

    /// What to say where another attempt would have more points than the one that counts.
    fn worse(&self, own: usize, attempts: &[usize], grades: &[Grade]) -> Option<String> {
        let worth = |at: usize| grades[at].points_max;
        let better = *attempts.iter().max_by(|a, b| worth(**a).total_cmp(&worth(**b)))?;
        if worth(better) <= worth(own) {
            return None;
        }
        let is_named = self.deciding.matches.word(&self.claims[own]).is_some();
        let why = match self.deciding.attempt {
            Attempt::Best if is_named => "matches.toml names the first",
            _ => "`umbra grade --attempt best` counts the better one",
        };
        Some(format!(
            "{}: {}, {} would have {}; {why}",
            self.called(own),
            columns::points(worth(own)),
            self.called(better),
            worth(better)
        ))
    }

    /// Lists the students without a submission that counts.
    fn find_missing(&mut self, absent: &[(Label, String)]) -> anyhow::Result<()> {
        let Some(roster) = self.deciding.roster else { return Ok(()) };
        for (at, may_be) in &self.perhaps {
            let words = || format!("perhaps {}: decide in matches.toml", may_be.join(" or "));
            self.reasons.entry(*at).or_insert_with(words);
        }
        for (label, reason) in absent {
            let claim = Claim { label: Some(label.clone()), ..Claim::default() };
            if let Match::Student(at, _) = find(&claim, roster, self.deciding.matches)? {
                self.reasons.entry(at).or_insert_with(|| reason.clone());
            }
        }
        for (at, student) in roster.students.iter().enumerate() {
            let reason = self.reasons.get(&at).cloned();
            if reason.as_deref() != Some("") {
                let reason = reason.unwrap_or_default();
                self.class.missing.push(Missing { student: student.clone(), reason });
            }
        }
        Ok(())
    }
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

/// Charges a submission for being late, or notes that nobody knows.
fn charge(
    claim: &Claim,
    standing: &Standing,
    grade: &mut Grade,
    deciding: &Deciding,
) -> Option<Lateness> {
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
        Some(label) if label.kind == Platform::Canvas => {}
        _ => grade
            .remarks
            .push("when it was submitted is not known: no points are taken for lateness".into()),
    }
    None
}

#[cfg(test)]
mod tests;
