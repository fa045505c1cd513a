//! Which file is the configuration. It says whose submission it is, so that no guess is made between two people.

use std::fs;

use super::check_config::is_template_value;
use super::submission::{IntakeError, Submission};
use super::submitted_config::{Field, SubmittedConfig};
use super::tree::CONFIG_FILE;
use super::tree_lost::{Lost, base, is_named_after, is_source};
use crate::harmless::printable;

/// Largest `config.json` that is read [bytes].
pub(super) const MAX_CONFIG: u64 = 64 << 10;

/// Whom a configuration names.
struct Person {
    number: Option<String>,
    name: String,
    /// Both, as they are written.
    shown: String,
}

impl Person {
    /// None where it names nobody, as a template does.
    fn of(config: &SubmittedConfig) -> Option<Self> {
        let said = |field: &Option<Field>| {
            let text = field.as_ref().map(|field| field.text.to_lowercase());
            text.filter(|text| !text.is_empty() && !is_template_value(text))
        };
        let number = said(&config.student_id);
        let name = [said(&config.first_name), said(&config.last_name)];
        let is_known = number.is_some() || name.iter().all(Option::is_some);
        let name = name.into_iter().flatten().collect::<Vec<_>>().join(" ");
        let fields = [&config.first_name, &config.last_name, &config.student_id];
        let shown: Vec<&str> =
            fields.into_iter().flatten().map(|field| field.text.trim()).collect();
        is_known.then(|| Self { number, name, shown: printable(&shown.join(" ")) })
    }

    fn is(&self, other: &Self) -> bool {
        match (&self.number, &other.number) {
            (Some(own), Some(other)) => own == other,
            _ => self.name == other.name,
        }
    }
}

/// The configuration, and other files of its name that name another person: what to say of each.
pub(super) struct Config<'a> {
    pub(super) found: Lost<'a>,
    /// Whether the source beside it is another than that beside another one of the same person.
    pub(super) has_rival: bool,
    /// The folders of other ones of the same person that do not lie within its own; they end with `/`.
    pub(super) beside: Vec<&'a str>,
    pub(super) others: Vec<(&'a str, String)>,
}

impl<'a> From<Lost<'a>> for Config<'a> {
    fn from(found: Lost<'a>) -> Self {
        Self { found, has_rival: false, beside: Vec::new(), others: Vec::new() }
    }
}

/// The configuration: `config.json` at the root, unless it names nobody and another names somebody; else the one file
/// that may be it. Several that name the same person are one.
pub(super) fn find_config(submission: &Submission) -> Result<Config<'_>, IntakeError> {
    let paths = || submission.files.iter().map(|file| file.path.as_str());
    let own = paths().find(|path| *path == CONFIG_FILE);
    let others = paths().filter(|path| Some(*path) != own);
    let mut found: Vec<&str> = others.filter(|path| is_named_after(path, CONFIG_FILE)).collect();
    if found.is_empty() && own.is_none() {
        found = paths().filter(|path| may_be_config(path)).collect();
    }
    found.sort_by_key(|path| path.matches('/').count());
    match (own, &found[..]) {
        (Some(own), []) => return Ok(Lost::One(own).into()),
        (None, []) => return Ok(Lost::None.into()),
        (None, [only]) => return Ok(Lost::One(only).into()),
        _ => {}
    }
    let mut named: Vec<(&str, Person)> = Vec::new();
    for path in &found {
        named.extend(person(submission, path)?.map(|person| (*path, person)));
    }
    if let Some(own) = own
        && let Some(owner) = person(submission, own)?
    {
        let others = named.iter().filter(|(_, other)| !other.is(&owner));
        let others = others.map(|(path, other)| {
            (*path, format!("names {}, and {own} names {}: {own} counts", other.shown, owner.shown))
        });
        return Ok(Config { others: others.collect(), ..Lost::One(own).into() });
    }
    let [(first, someone), others @ ..] = &named[..] else {
        return Ok(Lost::One(own.unwrap_or(found[0])).into());
    };
    if others.iter().all(|(_, other)| other.is(someone)) {
        let own = folder(first);
        let beside = others.iter().map(|(other, _)| folder(other));
        let beside: Vec<&str> = beside.filter(|other| !other.starts_with(own)).collect();
        let has_rival = beside.iter().any(|other| is_rival(submission, own, other));
        return Ok(Config { has_rival, beside, ..Lost::One(first).into() });
    }
    Ok(Lost::Several(named.iter().map(|(path, _)| *path).collect()).into())
}

/// The folder of a file, with `/` at its end.
fn folder(path: &str) -> &str {
    path.rfind('/').map_or("", |at| &path[..=at])
}

/// Whether two folders have different sources.
fn is_rival(submission: &Submission, own: &str, other: &str) -> bool {
    let sources = |folder: &str| {
        let all = submission.files.iter().filter(|file| is_source(&file.path));
        all.filter_map(|file| Some((file.path.strip_prefix(folder)?, file.sha256.as_str())))
            .collect::<Vec<_>>()
    };
    let [ours, theirs] = [sources(own), sources(other)];
    !ours.is_empty() && !theirs.is_empty() && ours != theirs
}

/// Whom the configuration at a path names.
fn person(submission: &Submission, path: &str) -> Result<Option<Person>, IntakeError> {
    if submission.file(path).is_none_or(|file| file.bytes > MAX_CONFIG) {
        return Ok(None);
    }
    let path = submission.root.join(path);
    let bytes = fs::read(&path).map_err(|e| IntakeError::io("read", &path, e))?;
    Ok(Person::of(&SubmittedConfig::parse(&bytes).0))
}

/// Whether a file is probably the configuration under a name of its own: `my_config.json`, `conifg.json`. A hidden
/// folder holds a tool's.
fn may_be_config(path: &str) -> bool {
    let name = base(path);
    let (stem, end) = name.rsplit_once('.').unwrap_or((&name, ""));
    let is_text = ["", "json", "jsonc", "json5", "txt", "yaml", "yml", "toml"].contains(&end);
    let near = strsim::osa_distance(stem.trim_start_matches('.'), "config") <= 2;
    let is_hidden = path.starts_with('.') && path.contains('/') || path.contains("/.");
    !is_hidden && is_text && (near || stem.contains("config")) || name == ".config"
}
