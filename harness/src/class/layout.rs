//! Reads from the path of a submission in a learning platform's download who submitted it, and when.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{names, stamps};

/// Where a download comes from.
#[derive(
    Clone,
    Copy,
    Debug,
    Default,
    PartialEq,
    Eq,
    Hash,
    Serialize,
    Deserialize,
    JsonSchema,
    clap::ValueEnum,
)]
#[serde(rename_all = "lowercase")]
#[schemars(rename = "Kind")]
pub enum Platform {
    /// Brightspace (D2L): `12345-67890 - First Last - Oct 5, 2019 1159 PM/`
    Brightspace,
    /// Canvas: `lastfirst_123_456_name.zip`
    Canvas,
    /// Moodle: `First Last_123_assignsubmission_file/`
    Moodle,
    /// Gradescope: `submission_123/` and `submission_metadata.yml`
    Gradescope,
    /// Clones that GitHub Classroom made: `assignment-username/`
    Github,
    /// Archives and folders whose names say nothing
    #[default]
    Plain,
}

impl Platform {
    /// Those with names that say something.
    pub const PLATFORMS: [Self; 5] =
        [Self::Brightspace, Self::Canvas, Self::Moodle, Self::Gradescope, Self::Github];

    /// Its name in a sentence.
    pub fn title(self) -> &'static str {
        match self {
            Self::Brightspace => "Brightspace",
            Self::Canvas => "Canvas",
            Self::Moodle => "Moodle",
            Self::Gradescope => "Gradescope",
            Self::Github => "GitHub Classroom",
            Self::Plain => "plain files",
        }
    }

    /// Names of its submissions, for a message.
    pub fn pattern(self) -> &'static str {
        match self {
            Self::Brightspace => "\"12345-67890 - First Last - Oct 5, 2019 1159 PM/\"",
            Self::Canvas => "\"lastfirst_123_456_name.zip\"",
            Self::Moodle => "\"First Last_123_assignsubmission_file/\"",
            Self::Gradescope => "\"submission_123/\"",
            Self::Github => "clones, \"assignment-username/\" with .git/",
            Self::Plain => "archives (.zip, .tar, .tar.gz) or folders with src/ or config.json",
        }
    }
}

/// What a platform says of one submission. A text is empty where it does not say it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct Label {
    /// The platform.
    pub kind: Platform,
    /// What it calls the submission: a folder, or the beginning of a file's name.
    pub submission: String,
    /// The student's name. Canvas runs last and first name together.
    pub name: String,
    /// The platform's own number of the student. Brightspace's are its own, and on no class list.
    pub id: String,
    /// The student number.
    pub number: String,
    /// Name of the account.
    pub username: String,
    /// Address.
    pub email: String,
    /// When it was submitted, as [`stamps::parse`] writes it.
    pub submitted: String,
    /// Whether the platform marks it as late.
    pub marked_late: bool,
    /// Others who submitted it too.
    pub others: Vec<String>,
}

impl Label {
    /// Whose it is, as far as the platform tells people apart.
    pub fn person(&self) -> String {
        let own = match self.kind {
            Platform::Brightspace => format!("{} {}", self.id, names::words(&self.name)),
            Platform::Canvas | Platform::Moodle => self.id.clone(),
            Platform::Github => self.username.to_lowercase(),
            Platform::Gradescope if !self.number.is_empty() => names::number(&self.number),
            Platform::Gradescope if !self.email.is_empty() => self.email.to_lowercase(),
            Platform::Gradescope | Platform::Plain => self.submission.clone(),
        };
        format!("{} {own}", self.kind.title())
    }

    /// The person in words, for a message.
    pub fn who(&self) -> String {
        let named = [&self.name, &self.username, &self.email, &self.id, &self.submission];
        named.into_iter().find(|text| !text.is_empty()).cloned().unwrap_or_default()
    }
}

/// What one component of a path says, as a platform of this kind names folders and files; none of GitHub's clones,
/// which only their `.git/` tells.
pub fn label_of(kind: Platform, component: &str) -> Option<Label> {
    match kind {
        Platform::Brightspace => brightspace(component),
        Platform::Canvas => canvas(component),
        Platform::Moodle => moodle(component),
        Platform::Gradescope => gradescope(component),
        Platform::Github | Platform::Plain => None,
    }
}

/// Whether a component is named as some platform names a student's folder or file.
pub fn is_labeled(component: &str) -> bool {
    Platform::PLATFORMS.into_iter().any(|kind| label_of(kind, component).is_some())
}

/// A clone: `a2-ada`, where `prefix` is `a2-`.
pub fn clone(component: &str, prefix: &str) -> Label {
    let username = component.strip_prefix(prefix).filter(|rest| !rest.is_empty());
    Label {
        kind: Platform::Github,
        submission: component.to_owned(),
        username: username.unwrap_or(component).to_owned(),
        ..Label::default()
    }
}

/// What the names of clones begin with: of the beginnings that end with `-`, the one that most names have, if that is
/// more than half of them; of several such, the longest. Other clones lie among students' ones, such as a solution.
pub fn prefix_of_clones(names: &[&str]) -> String {
    let shared = |prefix: &str| names.iter().filter(|name| name.starts_with(prefix)).count();
    let ends = |name: &str| name.match_indices('-').map(|(at, _)| at + 1).collect::<Vec<_>>();
    let all = names.iter().flat_map(|name| ends(name).into_iter().map(move |end| &name[..end]));
    // What ends with it is no account.
    let all = all.filter(|prefix| !names.contains(prefix));
    let best = all.map(|prefix| (shared(prefix), prefix.len(), prefix)).max();
    let best = best.filter(|(number, ..)| 2 * number > names.len());
    best.map_or(String::new(), |(.., prefix)| prefix.to_owned())
}

/// `12345-67890 - First Last - Oct 5, 2019 1159 PM`, and more after it where files lie flat.
fn brightspace(component: &str) -> Option<Label> {
    let (id, rest) = digits(component)?;
    let (_, rest) = digits(rest.strip_prefix('-')?)?;
    let rest = rest.trim_start().strip_prefix('-')?;
    // A name may hold hyphens: the stamp says where it ends.
    for (at, _) in rest.match_indices('-') {
        let Some((when, after)) = stamps::leading(rest[at + 1..].trim_start()) else { continue };
        let after = after.trim_start();
        if !after.is_empty() && !after.starts_with(['-', '.']) {
            continue;
        }
        let name = rest[..at].trim();
        let end = component.len() - after.len();
        return (!name.is_empty()).then(|| Label {
            kind: Platform::Brightspace,
            submission: component[..end].trim_end().to_owned(),
            name: name.to_owned(),
            id: id.to_owned(),
            submitted: when.to_string(),
            ..Label::default()
        });
    }
    None
}

/// `doejane_LATE_123_456_a2.zip`, `anon_x7Yz_456_a2.zip`.
fn canvas(component: &str) -> Option<Label> {
    let tokens: Vec<&str> = component.split('_').collect();
    let is_number = |token: &&str| !token.is_empty() && token.bytes().all(|b| b.is_ascii_digit());
    let label = |name: String, id: &str, used: usize, late: bool| Label {
        kind: Platform::Canvas,
        submission: tokens[..used].join("_"),
        name,
        id: id.to_owned(),
        marked_late: late,
        ..Label::default()
    };
    let late = usize::from(tokens[0] == "LATE");
    if tokens.get(late) == Some(&"anon") {
        let id = tokens.get(late + 1).filter(|id| id.chars().all(|c| c.is_ascii_alphanumeric()))?;
        tokens.get(late + 2).filter(|token| is_number(token))?;
        tokens.get(late + 3)?;
        return Some(label(String::new(), id, late + 2, late == 1));
    }
    let at = (1..tokens.len().checked_sub(2)?)
        .find(|at| is_number(&tokens[*at]) && is_number(&tokens[at + 1]))?;
    let late = at > 1 && tokens[at - 1] == "LATE";
    let name = tokens[..at - usize::from(late)].join("_");
    (!name.is_empty()).then(|| label(name, tokens[at], at + 1, late))
}

/// Of a file that Canvas names: its number there, which grows from upload to upload, and what the student called it.
/// Canvas puts `-1`, `-2` and so on behind the name of a file that was submitted before; that is left out.
pub fn canvas_upload(component: &str) -> Option<(u64, String)> {
    let own = canvas(component)?;
    let rest = component.strip_prefix(&own.submission)?.strip_prefix('_')?;
    let (number, file) = rest.split_once('_')?;
    let (stem, end) = file.split_once('.').unwrap_or((file, ""));
    let again = stem.rsplit_once('-').filter(|(stem, again)| {
        !stem.is_empty() && !again.is_empty() && again.bytes().all(|byte| byte.is_ascii_digit())
    });
    Some((number.parse().ok()?, format!("{}.{end}", again.map_or(stem, |(stem, _)| stem))))
}

/// `First Last_123_assignsubmission_file`, and more after it where files lie flat.
fn moodle(component: &str) -> Option<Label> {
    let at = component.rfind("_assignsubmission_")?;
    let (name, id) = component[..at].rsplit_once('_')?;
    let is_number = !id.is_empty() && id.bytes().all(|b| b.is_ascii_digit());
    // A blind download says no names.
    let name = if names::plain(name) == "participant" { "" } else { name };
    is_number.then(|| Label {
        kind: Platform::Moodle,
        submission: component[..at].to_owned(),
        name: name.replace('_', " ").trim().to_owned(),
        id: id.to_owned(),
        ..Label::default()
    })
}

/// `submission_123`
fn gradescope(component: &str) -> Option<Label> {
    let id = component.strip_prefix("submission_")?;
    let is_number = !id.is_empty() && id.bytes().all(|b| b.is_ascii_digit());
    is_number.then(|| Label {
        kind: Platform::Gradescope,
        submission: component.to_owned(),
        ..Label::default()
    })
}

fn digits(text: &str) -> Option<(&str, &str)> {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    (end > 0).then(|| text.split_at(end))
}

/// What `submission_metadata.yml` of a Gradescope export says, by its folders: who submitted, and when. Only the
/// few keys that are needed are read, as Ruby writes them; anything else is passed over.
pub fn gradescope_metadata(text: &str) -> Vec<Label> {
    let mut labels: Vec<Label> = Vec::new();
    let mut people = 0;
    let mut section = String::new();
    for line in text.lines() {
        let indent = line.len() - line.trim_start().len();
        let (is_item, entry) = match line.trim().strip_prefix("- ") {
            Some(entry) => (true, entry),
            None => (false, line.trim()),
        };
        let Some((key, value)) = entry.split_once(':').map(|(key, value)| match key {
            // Ruby's symbols begin with a colon.
            "" => value.split_once(':').unwrap_or((value, "")),
            key => (key, value),
        }) else {
            continue;
        };
        let value = scalar(value.trim());
        if indent == 0 && !is_item {
            labels.extend(gradescope(key.trim_matches(['"', '\''])));
            (people, section) = (0, String::new());
            continue;
        }
        let Some(label) = labels.last_mut() else { continue };
        if indent == 2 && !is_item {
            section = key.to_owned();
            if key == "created_at" {
                label.submitted = stamps::parse(&value).unwrap_or_default();
            }
            continue;
        }
        if section != "submitters" {
            continue;
        }
        people += usize::from(is_item);
        match (people, key) {
            (1, "name") => label.name = value,
            (1, "sid") => label.number = value,
            (1, "email") => label.email = value,
            (2.., "name") => label.others.push(value),
            _ => {}
        }
    }
    labels
}

/// A plain or quoted value of YAML.
fn scalar(text: &str) -> String {
    if let Some(inner) = text.strip_prefix('\'').and_then(|rest| rest.strip_suffix('\'')) {
        return inner.replace("''", "'");
    }
    if text.starts_with('"')
        && let Ok(inner) = serde_json::from_str(text)
    {
        return inner;
    }
    if ["null", "~"].contains(&text) { String::new() } else { text.to_owned() }
}

/// Ends of names of archives, also of those that are refused with a reason.
pub(super) const ARCHIVES: [&str; 11] =
    ["zip", "tar", "gz", "tgz", "rar", "7z", "bz2", "tbz", "xz", "txz", "zst"];

/// What follows the last dot of a name, in lower case.
pub(super) fn end_of(name: &str) -> String {
    name.rsplit_once('.').map(|(_, end)| end.to_lowercase()).unwrap_or_default()
}

/// Whether a file is named like an archive.
pub(super) fn has_end_of_archive(name: &str) -> bool {
    ARCHIVES.contains(&end_of(name).as_str())
}

#[cfg(test)]
mod tests;
