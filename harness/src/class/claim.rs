//! What a submission says of whose it is, and what it is called among others.

use super::layout::Label;

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

/// What a submission is called among others: its name, or its folder in the report where another has that name.
pub fn address(claim: &Claim, claims: &[Claim]) -> String {
    let alone = |word: &&String| meant(word, claims).len() == 1;
    let own = [&claim.name, &claim.slug].into_iter().find(alone).cloned();
    own.unwrap_or_else(|| format!("{}/", claim.slug))
}

/// The submissions that a word in `matches.toml` may mean: by folder or name; where there is none, by what the platform
/// calls all that is in a folder.
pub(super) fn meant<'a>(word: &str, claims: &'a [Claim]) -> Vec<&'a Claim> {
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
