//! The known mistakes, as `harness/data/mistakes.json` lists them.
//!
//! Each is a switch of the reference renderer (`mistake=NAME` in its options); that both know the
//! same names is tested in `reference_impl`.

use evidence::CheckId;
use serde::{Deserialize, Serialize};

/// The text that [`Catalogue::known`] reads.
const TEXT: &str = include_str!("../../data/mistakes.json");

/// All known mistakes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Catalogue {
    /// The mistakes, by family.
    pub mistakes: Vec<KnownMistake>,
    /// Right variants: they must cost nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub right: Vec<RightVariant>,
}

/// A right variant: code that differs from the reference and is right.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RightVariant {
    /// The reference's switch.
    pub name: String,
    /// The path that it is about: `offline` or `realtime`.
    pub path: String,
    /// What it does.
    pub does: String,
}

/// How much a fair teacher would take off for a mistake, decided from the handout before anything
/// was measured. `xtask verdicts` has the range of each.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum MistakeClass {
    /// One constant, sign, power, index or division is wrong.
    Slip,
    /// Something that the handout asks for is missing.
    Concept,
    /// Everything that the part is about is missing.
    Nothing,
    /// No image of the assignment shows it, probes do.
    Hidden,
    /// Worth a remark, no points.
    Finding,
}

/// One thing that students get wrong.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KnownMistake {
    /// The reference's switch.
    pub name: String,
    /// What it concerns: a BSDF, the frame, the light, a stage.
    pub family: String,
    /// The parts that it belongs to, such as `1.3`: what it must cost, and all that it may.
    pub parts: Vec<String>,
    /// How much it should cost.
    pub class: MistakeClass,
    /// The findings that it leads to although it costs nothing.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub findings: Vec<CheckId>,
    /// Other mistakes that look the same in everything that is asked: they are named together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub alike: Vec<String>,
    /// Whether the reference's answers with it are stored, for the diagnosis to compare with. The others only test the
    /// grader.
    #[serde(default = "yes", skip_serializing_if = "Clone::clone")]
    pub stored: bool,
    /// For the student, after the words "looks like:".
    pub looks_like: String,
}

fn yes() -> bool {
    true
}

impl KnownMistake {
    /// Whether it was made so that one rule alone sees it. No student makes it, no diagnosis names it.
    pub fn proves_a_rule(&self) -> bool {
        self.family == "seen by one rule"
    }

    /// Whether the diagnosis can name it.
    pub fn is_stored(&self) -> bool {
        self.stored && !self.proves_a_rule()
    }
}

/// Why a catalogue cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CatalogueError {
    /// It is not what it should be.
    #[error("catalogue of mistakes: {0}")]
    Parse(#[from] serde_json::Error),
    /// A name is there twice.
    #[error("catalogue of mistakes: \"{0}\" is there twice")]
    Twice(String),
    /// A mistake that nothing can show.
    #[error("catalogue of mistakes: \"{0}\" belongs to no part and leads to no finding")]
    Harmless(String),
    /// A mistake is like one that is not like it.
    #[error("catalogue of mistakes: \"{0}\" is like \"{1}\", which is not there or not like it")]
    OneSided(String, String),
}

impl Catalogue {
    /// The catalogue that this program was built with.
    ///
    /// # Errors
    /// When the file contradicts itself: a bug of Umbra's.
    pub fn known() -> Result<Self, CatalogueError> {
        Self::parse(TEXT)
    }

    fn parse(text: &str) -> Result<Self, CatalogueError> {
        let catalogue: Self = serde_json::from_str(text)?;
        for (index, mistake) in catalogue.mistakes.iter().enumerate() {
            let name = &mistake.name;
            if catalogue.mistakes[..index].iter().any(|other| other.name == *name) {
                return Err(CatalogueError::Twice(name.clone()));
            }
            if mistake.parts.is_empty() && mistake.findings.is_empty() {
                return Err(CatalogueError::Harmless(name.clone()));
            }
            for other in &mistake.alike {
                if !catalogue.named(other).is_some_and(|other| other.alike.contains(name)) {
                    return Err(CatalogueError::OneSided(name.clone(), other.clone()));
                }
            }
        }
        Ok(catalogue)
    }

    /// The mistake of this name.
    pub fn named(&self, name: &str) -> Option<&KnownMistake> {
        self.mistakes.iter().find(|mistake| mistake.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_catalogue_is_whole() {
        let catalogue = Catalogue::known().unwrap();
        assert!(catalogue.mistakes.len() >= 200, "{}", catalogue.mistakes.len());
        let families: std::collections::BTreeSet<_> =
            catalogue.mistakes.iter().map(|mistake| mistake.family.as_str()).collect();
        assert!(families.len() >= 10, "{families:?}");
        let parts = ["1.1", "1.2", "1.3", "1.4", "2.1", "2.2", "2.3", "2.4", "2.5"];
        for part in parts {
            let belongs = |mistake: &&KnownMistake| mistake.parts.iter().any(|own| own == part);
            let count = catalogue.mistakes.iter().filter(belongs).count();
            assert!(count >= 5, "{part}: {count}");
        }
        for mistake in &catalogue.mistakes {
            assert!(mistake.parts.iter().all(|part| parts.contains(&part.as_str())), "{mistake:?}");
            let free = mistake.class == MistakeClass::Finding;
            assert_eq!(free, mistake.parts.is_empty(), "{mistake:?}");
        }
    }

    #[test]
    fn contradictions_are_refused() {
        let entry = |parts: &str| {
            format!(
                r#"{{"name": "a", "family": "f", "parts": [{parts}], "class": "slip", "looks_like": "x"}}"#
            )
        };
        let list = |entries: &[String]| format!(r#"{{"mistakes": [{}]}}"#, entries.join(","));
        let right = entry(r#""1.1""#);
        assert!(Catalogue::parse(&list(std::slice::from_ref(&right))).is_ok());
        let twice = Catalogue::parse(&list(&[right.clone(), right.clone()]));
        assert!(matches!(twice, Err(CatalogueError::Twice(name)) if name == "a"));
        let harmless = Catalogue::parse(&list(&[entry("")]));
        assert!(matches!(harmless, Err(CatalogueError::Harmless(_))));
        let like_b = right.replace(r#""looks_like""#, r#""alike": ["b"], "looks_like""#);
        let b = right.replace(r#""name": "a""#, r#""name": "b""#);
        let one_sided = Catalogue::parse(&list(&[like_b.clone(), b.clone()]));
        assert!(
            matches!(one_sided, Err(CatalogueError::OneSided(a, b)) if (&*a, &*b) == ("a", "b"))
        );
        let like_a =
            like_b.replace(r#"["b"]"#, r#"["a"]"#).replace(r#""name": "a""#, r#""name": "b""#);
        assert!(Catalogue::parse(&list(&[like_b, like_a])).is_ok());
        assert!(Catalogue::parse("{").unwrap_err().to_string().contains("line 1"));
    }
}
