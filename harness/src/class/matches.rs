//! `matches.toml`: the instructor's decisions on whose submissions are, and when they were submitted.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Context as _, bail};
use serde::Deserialize;
use toml::Spanned;

use super::claim::{Claim, meant};
use super::roster::Roster;
use super::stamps;
use crate::harmless::printable;
use crate::plain_errors::toml_error;

/// The file of the instructor's decisions on whose submissions are, in the report's folder.
pub const MATCHES: &str = "matches.toml";

/// What `matches.toml` calls a submission that is nobody's and does not count.
const NOBODY: &str = "none";

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
struct MatchesFile {
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
        let file: MatchesFile =
            toml::from_str(text).map_err(|error| toml_error(&error, text, path))?;
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
    pub(super) fn student(&self, claim: &Claim, roster: &Roster) -> anyhow::Result<Option<usize>> {
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

/// The line of a place in a text, from 1.
pub(super) fn line_of(text: &str, at: usize) -> usize {
    1 + text.bytes().take(at).filter(|byte| *byte == b'\n').count()
}
