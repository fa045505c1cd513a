//! Matches submissions to students of the class list. The instructor decides uncertain cases in `matches.toml`.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, bail};
use serde::Deserialize;
use toml::Spanned;

use super::layout::{Kind, Label};
use super::roster::{Roster, Student};
use super::{names, stamps};
use crate::harmless::printable;
use crate::plain_errors::toml_error;

/// The file of the instructor's decisions on whose submissions are, in the report's folder.
pub const MATCHES: &str = "matches.toml";

/// What `matches.toml` calls a submission that is nobody's and does not count.
const NOBODY: &str = "none";

/// What a submission says of whose it is.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Claim {
    /// What reports call it.
    pub name: String,
    /// Its folder in the report.
    pub slug: String,
    /// What the platform says.
    pub label: Option<Label>,
    /// The student number in its `config.json`.
    pub number: String,
    /// The name in its `config.json`.
    pub full_name: String,
    /// Digest of what was submitted; empty where nobody could open it.
    pub digest: String,
}

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

/// The instructor's decisions.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Matches(Vec<Decision>);

/// What the instructor decided on one submission.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Decision {
    submission: String,
    student: Option<String>,
    submitted: Option<String>,
    place: String,
    on: On,
    /// Folders of submissions with another content than the one that the time was said of.
    outdated: Vec<String>,
}

/// The submissions that a decision is on, by their folders.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
enum On {
    /// Whatever is called so.
    #[default]
    Any,
    /// These.
    Folders(Vec<String>),
    /// None: which of these is not certain.
    Unclear(Vec<String>),
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(default, rename = "match")]
    matches: Vec<Spanned<Entry>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    submission: String,
    student: Option<String>,
    submitted: Option<Spanned<toml::Value>>,
}

impl Matches {
    /// Reads the text of a file of decisions.
    ///
    /// # Errors
    /// When it says what means nothing; names the file and line.
    pub fn parse(text: &str, path: &Path) -> anyhow::Result<Self> {
        let place = |at: usize| format!("{}:{}", path.display(), line_of(text, at));
        let file: File = toml::from_str(text).map_err(|error| toml_error(&error, text, path))?;
        let mut decisions: Vec<Decision> = Vec::new();
        for entry in file.matches {
            let place = place(entry.span().start);
            let Entry { submission, student, submitted } = entry.into_inner();
            let submitted = submitted
                .map(|said| {
                    let at = line_of(text, said.span().start);
                    // TOML has dates of its own, without quotes.
                    let said = match said.into_inner() {
                        toml::Value::String(text) => text,
                        toml::Value::Datetime(time) => time.to_string(),
                        other => other.to_string(),
                    };
                    stamps::parse(&said).with_context(|| {
                        format!(
                            "{}:{at}: expected a time such as \"2019-10-06T23:59:00-04:00\", found {}",
                            path.display(),
                            printable(&said)
                        )
                    })
                })
                .transpose()?;
            if student.is_none() && submitted.is_none() {
                bail!(
                    "{place}: expected student = \"NUMBER\" or \"{NOBODY}\", or submitted = \"TIME\""
                );
            }
            if student.as_ref().is_some_and(|word| word.trim().is_empty()) {
                bail!("{place}: student says nothing; expected a student number, or \"{NOBODY}\"");
            }
            let is_nobody = |word: &String| word.trim().eq_ignore_ascii_case(NOBODY);
            let student = match student {
                Some(word) if is_nobody(&word) => Some(NOBODY.to_owned()),
                other => other,
            };
            let (on, outdated) = (On::Any, Vec::new());
            let own = Decision { submission, student, submitted, place, on, outdated };
            if let Some(first) = decisions
                .iter()
                .find(|first| first.submission == own.submission && first.says_as_much(&own))
            {
                bail!("{}", own.is_there_already(first));
            }
            decisions.push(own);
        }
        Ok(Self(decisions))
    }

    /// What is decided, wherever in the file it stands: submission, student, time.
    pub fn says(&self) -> Vec<[Option<&str>; 3]> {
        let all = self.0.iter();
        all.map(|own| {
            [Some(own.submission.as_str()), own.student.as_deref(), own.submitted.as_deref()]
        })
        .collect()
    }

    /// The decisions on some submissions. The name of several is that of none: each has a folder.
    #[must_use]
    pub fn among(&self, claims: &[Claim]) -> Self {
        let on = |decision: &Decision| {
            let meant = meant(&decision.submission, claims);
            let slugs = meant.iter().map(|own| own.slug.clone()).collect::<Vec<_>>();
            let label = |own: &&Claim| {
                own.label.as_ref().is_some_and(|own| own.submission == decision.submission)
            };
            match meant.len() {
                0 => On::Any,
                1 => On::Folders(slugs),
                // A platform's own name of all that is in a folder.
                _ if meant.iter().all(label) => On::Folders(slugs),
                _ => On::Unclear(slugs),
            }
        };
        Self(self.0.iter().map(|own| Decision { on: on(own), ..own.clone() }).collect())
    }

    /// Makes sure that no two decisions are on one submission and say the same thing of it, by whatever names.
    ///
    /// # Errors
    /// When two are; names both lines. One submission has one student.
    pub fn check(&self, claims: &[Claim]) -> anyhow::Result<()> {
        for claim in claims {
            let own: Vec<&Decision> = self.of(claim).collect();
            for (at, later) in own.iter().enumerate() {
                // What is said of a folder of a platform holds where nothing is said of the one submission.
                let same = |first: &&&Decision| {
                    first.says_as_much(later) && first.is_on_one() == later.is_on_one()
                };
                if let Some(first) = own[..at].iter().find(same) {
                    bail!("{}", later.is_there_already(first));
                }
            }
        }
        Ok(())
    }

    /// Makes sure that all students who are named are on the list.
    ///
    /// # Errors
    /// When one is not; names the line.
    pub fn check_list(&self, roster: &Roster) -> anyhow::Result<()> {
        self.0.iter().try_for_each(|decision| decision.student_of(roster).map(|_| ()))
    }

    /// Whether a time is said of any.
    pub fn has_times(&self) -> bool {
        self.0.iter().any(|own| own.submitted.is_some())
    }

    /// Each decision on a time, with the folders of the submissions that it is on; see [`Matches::among`].
    pub fn times(&self) -> impl Iterator<Item = (String, &[String])> {
        self.0.iter().filter_map(|own| match &own.on {
            On::Folders(slugs) => Some((own.time()?, slugs.as_slice())),
            _ => None,
        })
    }

    /// Leaves out times that were said of other content: `known` is the digests of the submissions that each was first
    /// on, `digest` that of the submission in a folder now. Answers what was left out, with the lines.
    pub fn without_outdated(
        &mut self,
        known: &BTreeMap<String, Vec<String>>,
        digest: impl Fn(&str) -> String,
    ) -> Vec<String> {
        let mut lines = Vec::new();
        for own in &mut self.0 {
            let (On::Folders(slugs), Some(time)) = (&own.on, own.time()) else { continue };
            let Some(known) = known.get(&time) else { continue };
            own.outdated =
                slugs.iter().filter(|own| !known.contains(&digest(own))).cloned().collect();
            if !own.outdated.is_empty() {
                lines.push(format!(
                    "{}: the time was of an older submission and is not used for {}; say the new one's, or delete it",
                    own.place,
                    own.outdated.join(", ")
                ));
            }
        }
        lines
    }

    /// Decisions on nothing that is graded, with their lines; `is_seen` says what is there, graded or not, and
    /// `is_aside` which of that was not graded as another attempt counts.
    pub fn lost(
        &self,
        is_seen: impl Fn(&str) -> bool,
        is_aside: impl Fn(&str) -> bool,
    ) -> Vec<String> {
        let lost = self.0.iter().filter_map(|own| match (&own.on, &own.submission, &own.place) {
            (On::Any, submission, place) if !is_seen(submission) => {
                Some(format!("{place}: there is no submission \"{submission}\""))
            }
            (On::Any, submission, place)
                if own.student.as_deref() != Some(NOBODY) && is_aside(submission) =>
            {
                Some(format!(
                    "{place}: \"{submission}\" is not graded yet; the same `umbra grade` as before does that"
                ))
            }
            (On::Unclear(slugs), submission, place) => Some(format!(
                "{place}: \"{submission}\" may be more than one submission, so it is on none; name a folder: {}",
                slugs.join(", ")
            )),
            _ => None,
        });
        lost.collect()
    }

    /// Whose the instructor says that a submission is, where there is no class list.
    pub fn word<'a>(&'a self, claim: &'a Claim) -> Option<&'a str> {
        self.owner(claim)?.student.as_deref()
    }

    fn of<'a>(&'a self, claim: &'a Claim) -> impl Iterator<Item = &'a Decision> {
        let own = move |decision: &&Decision| {
            let label = claim.label.as_ref().map_or("", |label| &label.submission);
            match &decision.on {
                On::Any => [claim.name.as_str(), &claim.slug, label]
                    .contains(&decision.submission.as_str()),
                On::Folders(slugs) => slugs.contains(&claim.slug),
                On::Unclear(_) => false,
            }
        };
        self.0.iter().filter(own)
    }

    /// Whether the instructor decided anything on a submission.
    pub fn mention(&self, claim: &Claim) -> bool {
        self.of(claim).next().is_some()
    }

    /// When the instructor says that a submission was submitted.
    pub fn submitted<'a>(&'a self, claim: &'a Claim) -> Option<&'a str> {
        let own = self.of(claim).filter(|own| !own.outdated.contains(&claim.slug));
        own.filter_map(|own| Some((own.submitted.as_deref()?, own.is_on_one())))
            .max_by_key(|(_, is_on_one)| *is_on_one)
            .map(|(time, _)| time)
    }

    /// Whose the instructor says that a submission is; what is said of it alone goes before what is said of all in a
    /// platform's folder.
    fn owner<'a>(&'a self, claim: &'a Claim) -> Option<&'a Decision> {
        let own = self.of(claim).filter(|own| own.student.is_some());
        own.max_by_key(|own| own.is_on_one())
    }

    /// Whether the instructor says that a submission does not count.
    pub fn is_nobody(&self, claim: &Claim) -> bool {
        self.word(claim) == Some(NOBODY)
    }

    /// The student that the instructor names, by index.
    ///
    /// # Errors
    /// When nobody of the list is called so.
    fn student(&self, claim: &Claim, roster: &Roster) -> anyhow::Result<Option<usize>> {
        self.owner(claim).map_or(Ok(None), |decision| decision.student_of(roster))
    }
}

impl Decision {
    /// The student that it names, by index; `None` if it names nobody.
    fn student_of(&self, roster: &Roster) -> anyhow::Result<Option<usize>> {
        let Some(word) = self.student.as_ref().filter(|word| *word != NOBODY) else {
            return Ok(None);
        };
        let at = roster.students.iter().position(|student| student.is_called(word));
        at.map(Some).with_context(|| {
            format!(
                "{}: nobody on {} has the number or account \"{word}\"; expected one of the list, or \"{NOBODY}\"",
                self.place,
                roster.path.display()
            )
        })
    }

    /// Whether it is on one submission alone.
    fn is_on_one(&self) -> bool {
        !matches!(&self.on, On::Folders(slugs) if slugs.len() > 1)
    }

    /// Whether another one says something that it says, too.
    fn says_as_much(&self, other: &Self) -> bool {
        (self.student.is_some() && other.student.is_some())
            || (self.submitted.is_some() && other.submitted.is_some())
    }

    /// What is wrong where it follows another one on the same submission.
    fn is_there_already(&self, first: &Self) -> String {
        let line = first.place.rsplit(':').next().unwrap_or_default();
        let Self { submission, place, .. } = self;
        let students = self.student.is_some() && first.student.is_some();
        let what = if students { "a student" } else { "a time" };
        let hint = if students { "; one submission has one student" } else { "" };
        format!("{place}: submission \"{submission}\" has {what} already, on line {line}{hint}")
    }

    /// The time with the submission that it is said of; `None` if it says no time.
    fn time(&self) -> Option<String> {
        Some(format!("{} {}", self.submission, self.submitted.as_ref()?))
    }
}

/// The submissions that a word in `matches.toml` may mean: by folder or name; where there is none, by what the platform
/// calls all that is in a folder.
fn meant<'a>(word: &str, claims: &'a [Claim]) -> Vec<&'a Claim> {
    let of = |is: &dyn Fn(&Claim) -> bool| -> Vec<&'a Claim> {
        claims.iter().filter(|own| is(own)).collect()
    };
    if let Some(folder) = word.strip_suffix('/') {
        let found = of(&|own| own.slug == folder);
        if !found.is_empty() {
            return found;
        }
    }
    let found = of(&|own| own.slug == word || own.name == word);
    let label = |own: &Claim| own.label.as_ref().is_some_and(|own| own.submission == word);
    if found.is_empty() { of(&label) } else { found }
}

/// What a submission is called among others: its name, or its folder in the report where another has that name.
pub fn address(claim: &Claim, claims: &[Claim]) -> String {
    let alone = |word: &&String| meant(word, claims).len() == 1;
    let own = [&claim.name, &claim.slug].into_iter().find(alone).cloned();
    own.unwrap_or_else(|| format!("{}/", claim.slug))
}

/// The line of a place in a text, from 1.
pub(super) fn line_of(text: &str, at: usize) -> usize {
    1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count()
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
        return Ok(Match::Undecided(reason, members));
    }
    let of = |wanted: &dyn Fn(&Student) -> bool| -> Vec<usize> {
        let all = roster.students.iter().enumerate();
        all.filter(|(_, student)| wanted(student)).map(|(index, _)| index).collect()
    };
    let same = |a: &str, b: &str| !a.is_empty() && a.eq_ignore_ascii_case(b);
    let evidence = [
        ("the platform's student number", by_number(roster, &label.number)),
        ("student number", by_number(roster, &claim.number)),
        // Brightspace's numbers are on no list.
        (
            "the platform's own number",
            of(&|student| {
                label.kind != Kind::Brightspace
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
    ];
    let said: Vec<&(&str, Vec<usize>)> =
        evidence.iter().filter(|(_, found)| !found.is_empty()).collect();
    let Some((_, first)) = said.first() else {
        let known = [label.who(), claim.full_name.clone(), claim.number.clone()];
        let mut known: Vec<String> = known.into_iter().filter(|text| !text.is_empty()).collect();
        known.dedup();
        let said = if known.is_empty() {
            "it says neither name nor number".to_owned()
        } else {
            format!("nobody on the list is {}", known.join(", "))
        };
        return Ok(Match::Undecided(said, Vec::new()));
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

fn is_named(name: &str, student: &Student) -> bool {
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
