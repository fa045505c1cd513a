//! Whose download each submission is from, and what the names of its platform say of it.

use std::collections::{BTreeMap, HashMap};

use super::{CollectOptions, Collected, Empty, Source};
use crate::class::layout::{self, Label, Platform, label_of};

/// What stands in place of the files of an empty folder.
pub(super) const NOTHING: &str = " (nothing in it)";

/// What a search has found so far.
#[derive(Default)]
pub(super) struct SearchResult {
    pub(super) sources: Vec<Source>,
    pub(super) skipped: Vec<String>,
    /// Names with the reason.
    pub(super) unopened: Vec<(String, String)>,
    /// Of clones: their names below the given path.
    pub(super) clones: Vec<String>,
    /// What Gradescope says of its folders.
    pub(super) metadata: Vec<Label>,
}

impl SearchResult {
    /// Recognizes the kinds and reads all names by them. Each download has its own, and so has each of the `groups`,
    /// which are of the submissions in their order.
    pub(super) fn labeled(mut self, wanted: &CollectOptions, groups: &[usize]) -> Collected {
        let platform_names = PlatformNames::of(&mut self);
        let names: Vec<String> = self.sources.iter().map(full_name).collect();
        let kinds = platform_names.kinds(&self.sources, &names, wanted, groups);
        let number = |kind: &Platform| kinds.iter().filter(|own| *own == kind).count();
        let found =
            Platform::PLATFORMS.into_iter().filter(|kind| number(kind) > 0).collect::<Vec<_>>();
        let most = found.iter().rev().max_by_key(|kind| number(kind)).copied();
        let kind = wanted.from.or(most).unwrap_or_default();
        let found = if found.is_empty() { vec![kind] } else { found };
        let any_label =
            |name: &str| found.iter().find_map(|kind| platform_names.label(*kind, name));
        let labels = names.iter().zip(&kinds).map(|(name, kind)| platform_names.label(*kind, name));
        for (source, label) in self.sources.iter_mut().zip(labels) {
            source.label = label;
        }
        let empty = self.empty(any_label);
        let unopened = self.unopened.into_iter().map(|(_, why)| why).collect();
        let copies = Vec::new();
        Collected { kind, sources: self.sources, skipped: self.skipped, empty, copies, unopened }
    }

    /// Students who have something there, but nothing to grade.
    fn empty(&self, label: impl Fn(&str) -> Option<Label>) -> Vec<Empty> {
        let unopened: Vec<Label> =
            self.unopened.iter().filter_map(|(name, _)| label(name)).collect();
        let sources = || self.sources.iter().filter_map(|source| source.label.as_ref());
        let is_known = |own: &Label| {
            sources().chain(&unopened).any(|label| label.submission == own.submission)
        };
        let mut empty: BTreeMap<String, Empty> = BTreeMap::new();
        for name in &self.skipped {
            if let Some(label) = label(name).filter(|label| !is_known(label)) {
                let entry = empty.entry(label.submission.clone());
                let files = &mut entry.or_insert(Empty { label, files: Vec::new() }).files;
                files.extend(Some(last(name)).filter(|file| file != NOTHING));
            }
        }
        empty.into_values().collect()
    }
}

/// What the names of platforms say, and what is known of them beside.
struct PlatformNames {
    /// The folders of clones of GitHub, and what the names of all begin with.
    clones: Vec<String>,
    prefix: String,
    /// What Gradescope says of its folders.
    metadata: HashMap<String, Label>,
}

impl PlatformNames {
    fn of(found: &mut SearchResult) -> Self {
        let clones: Vec<String> = found.clones.iter().map(|name| last(name)).collect();
        let prefix =
            layout::prefix_of_clones(&clones.iter().map(String::as_str).collect::<Vec<_>>());
        let metadata =
            found.metadata.drain(..).map(|label| (label.submission.clone(), label)).collect();
        Self { clones, prefix, metadata }
    }

    /// What a platform's name says, if it is one.
    fn label(&self, kind: Platform, name: &str) -> Option<Label> {
        match kind {
            Platform::Github => self
                .clones
                .iter()
                .find(|clone| name.split('/').any(|part| part == *clone))
                .map(|clone| layout::clone(clone, &self.prefix)),
            // Canvas names files alone.
            Platform::Canvas => label_of(kind, &last(name)),
            Platform::Gradescope => name
                .split('/')
                .find_map(|part| label_of(kind, part))
                .map(|label| self.metadata.get(&label.submission).cloned().unwrap_or(label)),
            kind => name.split('/').find_map(|part| label_of(kind, part)),
        }
    }

    /// The platform that most of some names are of.
    fn recognized(&self, names: &[&str]) -> Platform {
        let votes =
            |kind: &Platform| names.iter().filter(|name| self.label(*kind, name).is_some()).count();
        // The first of those with most.
        let best = Platform::PLATFORMS.into_iter().rev().max_by_key(votes);
        let most_are = |kind: &Platform| votes(kind) > 0 && 2 * votes(kind) >= names.len();
        best.filter(most_are).unwrap_or_default()
    }

    /// The platform of each submission.
    fn kinds(
        &self,
        sources: &[Source],
        names: &[String],
        wanted: &CollectOptions,
        groups: &[usize],
    ) -> Vec<Platform> {
        // What is unpacked lies below the scratch folder, each download in one of its own.
        let download = |source: &Source| {
            let below = source.path.strip_prefix(wanted.scratch).ok()?;
            Some(below.iter().next()?.to_owned())
        };
        let together: Vec<_> = sources.iter().map(download).zip(groups).collect();
        let mut kinds: BTreeMap<_, Platform> = BTreeMap::new();
        for own in &together {
            if !kinds.contains_key(own) {
                let all = together.iter().zip(names).filter(|(other, _)| *other == own);
                let all: Vec<&str> = all.map(|(_, name)| name.as_str()).collect();
                kinds.insert(own, wanted.from.unwrap_or_else(|| self.recognized(&all)));
            }
        }
        together.iter().map(|own| kinds[own]).collect()
    }
}

/// The name of a submission below the folder that was given, which may itself be a student's.
fn full_name(source: &Source) -> String {
    match source.place.to_string_lossy() {
        place if place.ends_with(&source.name) => {
            let above = place[..place.len() - source.name.len()].trim_end_matches('/');
            let above = above.rsplit('/').next().unwrap_or_default();
            format!("{above}/{}", source.name)
        }
        _ => source.name.clone(),
    }
}

fn last(name: &str) -> String {
    name.rsplit('/').next().unwrap_or_default().to_owned()
}
