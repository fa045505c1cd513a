//! What is known of submissions and of the class beside what is in them, and by what that is settled.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::late::{LatePolicy, Lateness};
use super::layout::{Label, Platform};
use super::matches::Matches;
use super::mending::Mended;
use super::overrides::Applied;
use super::roster::{ListedStudent, Roster};

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
    pub policy: Option<&'a LatePolicy>,
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
    pub student: Option<ListedStudent>,
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
    pub late: Option<Lateness>,
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
    pub kind: Platform,
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
    pub student: ListedStudent,
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
    pub candidates: Vec<ListedStudent>,
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
