//! Matches submissions to students of the class list.

use super::claim::Claim;
use super::layout::{Label, Platform};
use super::matches::Matches;
use super::names;
use super::roster::{ListedStudent, Roster};

/// Whose a submission is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Match {
    /// A student of the list, by index, and what told so.
    Student(usize, &'static str),
    /// The instructor says that it does not count.
    Nobody,
    /// The instructor must decide: why, and between whom.
    Undecided(String, Vec<usize>),
}

/// Whose a submission is: as the instructor decided, else by student number, the platform's number or account, and
/// name, as long as these do not contradict each other.
///
/// # Errors
/// When the instructor decided for somebody who is not on the list.
pub fn find(claim: &Claim, roster: &Roster, matches: &Matches) -> anyhow::Result<Match> {
    if matches.is_nobody(claim) {
        return Ok(Match::Nobody);
    }
    if let Some(student) = matches.student(claim, roster)? {
        return Ok(Match::Student(student, "matches.toml"));
    }
    let label = claim.label.clone().unwrap_or_default();
    if !label.others.is_empty() {
        return Ok(group(&label, roster));
    }
    let evidence = evidence(claim, &label, roster);
    let said: Vec<&(&str, Vec<usize>)> =
        evidence.iter().filter(|(_, found)| !found.is_empty()).collect();
    let Some((_, first)) = said.first() else {
        return Ok(Match::Undecided(nobody(claim, &label), Vec::new()));
    };
    // Those that all agree on.
    let agreed = |index: &usize| said.iter().all(|(_, found)| found.contains(index));
    let candidates: Vec<usize> = first.iter().copied().filter(agreed).collect();
    if let [only] = candidates[..] {
        let single = said.iter().find(|(_, found)| found.len() == 1);
        return Ok(Match::Student(
            only,
            single.map_or("number and name together", |(what, _)| what),
        ));
    }
    let mut all: Vec<usize> = said.iter().flat_map(|(_, found)| found.clone()).collect();
    all.sort_unstable();
    all.dedup();
    let reason = if candidates.is_empty() {
        let each = said.iter().map(|(what, found)| {
            let names: Vec<String> = found.iter().map(|at| roster.students[*at].who()).collect();
            format!("{what} says {}", names.join(" or "))
        });
        each.collect::<Vec<_>>().join(", ")
    } else {
        all = candidates;
        let names: Vec<String> = all.iter().map(|at| roster.students[*at].who()).collect();
        format!("{} students fit: {}", all.len(), names.join(", "))
    };
    Ok(Match::Undecided(reason, all))
}

/// The decision on a group's submission: Umbra gives it to none of its members.
fn group(label: &Label, roster: &Roster) -> Match {
    let of = |name: &str| {
        let all = roster.students.iter().enumerate();
        all.filter(move |(_, own)| is_named(name, own)).map(|(at, _)| at).collect::<Vec<_>>()
    };
    let mut members = by_number(roster, &label.number);
    if members.is_empty() {
        members = of(&label.name);
    }
    members.extend(label.others.iter().flat_map(|name| of(name)));
    members.sort_unstable();
    members.dedup();
    let who = [std::slice::from_ref(&label.name), &label.others].concat().join(", ");
    let reason = format!(
        "it is a group's: {who}; one submission has one student, and the others' grades are yours to enter"
    );
    Match::Undecided(reason, members)
}

/// The students whom each thing that a submission says fits.
fn evidence(claim: &Claim, label: &Label, roster: &Roster) -> [(&'static str, Vec<usize>); 6] {
    let of = |wanted: &dyn Fn(&ListedStudent) -> bool| -> Vec<usize> {
        let all = roster.students.iter().enumerate();
        all.filter(|(_, student)| wanted(student)).map(|(index, _)| index).collect()
    };
    let same = |a: &str, b: &str| !a.is_empty() && a.eq_ignore_ascii_case(b);
    [
        ("the platform's student number", by_number(roster, &label.number)),
        ("student number", by_number(roster, &claim.number)),
        // Brightspace's numbers are on no list.
        (
            "the platform's own number",
            of(&|student| {
                label.kind != Platform::Brightspace
                    && roster.kind == label.kind
                    && same(&label.id, &student.id)
            }),
        ),
        (
            "account",
            of(&|student| {
                same(&label.username, &student.username) || same(&label.email, &student.email)
            }),
        ),
        ("the platform's name", of(&|student| is_named(&label.name, student))),
        ("name", of(&|student| is_named(&claim.full_name, student))),
    ]
}

/// What to say where nobody of the list fits.
fn nobody(claim: &Claim, label: &Label) -> String {
    let known = [label.who(), claim.full_name.clone(), claim.number.clone()];
    let mut known: Vec<String> = known.into_iter().filter(|text| !text.is_empty()).collect();
    known.dedup();
    if known.is_empty() {
        "it says neither name nor number".to_owned()
    } else {
        format!("nobody on the list is {}", known.join(", "))
    }
}

/// Those with a student number. Zeros that a spreadsheet took from the front are missed only where nobody has the
/// number as it is.
fn by_number(roster: &Roster, number: &str) -> Vec<usize> {
    let number = names::number(number);
    let of = |wanted: &dyn Fn(&str) -> bool| -> Vec<usize> {
        let all = roster.students.iter().enumerate();
        let own = all.filter(|(_, student)| wanted(&names::number(&student.number)));
        own.map(|(index, _)| index).collect()
    };
    if number.is_empty() {
        return Vec::new();
    }
    let exact = of(&|own| own == number);
    if !exact.is_empty() {
        return exact;
    }
    let bare = number.trim_start_matches('0');
    of(&|own| !bare.is_empty() && own.trim_start_matches('0') == bare)
}

fn is_named(name: &str, student: &ListedStudent) -> bool {
    let wanted = names::words(name);
    if wanted.is_empty() {
        return false;
    }
    let (first, last) = (&student.first_name, &student.last_name);
    wanted == names::words(&format!("{first} {last}"))
        // As Canvas runs them together.
        || names::letters(name) == names::letters(&format!("{last}{first}"))
}

#[cfg(test)]
mod tests;
