//! Images that two persons of a batch handed in alike.

use std::collections::{BTreeMap, BTreeSet};

use basecode::Image;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::record::Record;
use crate::evidence::{Check, Verdict};
use crate::files::hex;
use crate::imaging::srgb;

/// The check that this module makes.
const ID: &str = "handed_in.shared";

/// What is kept of an image that was handed in, to find it again in another hand-in.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ImageDigest {
    /// The scene.
    pub scene: String,
    /// Its path in the hand-in.
    pub path: String,
    /// SHA-256 over size and 8-bit sRGB levels, in hexadecimal: no rounding to half precision or to
    /// levels changes it.
    pub sha256: String,
}

impl ImageDigest {
    /// The digest of an image.
    pub fn new(scene: &str, path: &str, image: &Image) -> Self {
        let mut hash = Sha256::new();
        hash.update((image.width as u64).to_le_bytes());
        hash.update((image.height as u64).to_le_bytes());
        let channels = image.pixels.iter().flat_map(|pixel| pixel.to_array());
        hash.update(channels.map(|value| srgb::level(to_half(value))).collect::<Vec<u8>>());
        let sha256 = hex(&hash.finalize());
        Self { scene: scene.to_owned(), path: path.to_owned(), sha256 }
    }
}

/// The nearest value with the ten fraction bits of half precision, ties to even. What half
/// precision cannot hold (below 6e-5, above 65,504) has level 0 or 255 either way.
fn to_half(value: f32) -> f32 {
    let bits = value.to_bits();
    if !value.is_finite() {
        return value;
    }
    f32::from_bits((bits + 0x0fff + ((bits >> 13) & 1)) & !0x1fff)
}

/// Adds to every record which of its images another person of the batch handed in too. Depends on
/// nothing but the set of the records; doing it again changes nothing.
///
/// Only images with noise have digests, and every student's noise has the seed of the student's own
/// number: two persons' images are equal when one is a copy of the other, or when neither
/// was drawn with that seed.
pub fn judge_shared(records: &mut [Record]) {
    let mut owners: BTreeMap<String, BTreeSet<(String, String)>> = BTreeMap::new();
    for record in records.iter() {
        for image in &record.images {
            let owner = (person(record), record.slug.clone());
            owners.entry(image.sha256.clone()).or_default().insert(owner);
        }
    }
    for record in records {
        let person = person(record);
        let checks = &mut record.evidence.checks;
        checks.retain(|check| check.id != ID);
        for ImageDigest { scene, path, sha256 } in &record.images {
            let others: Vec<&str> = owners[sha256]
                .iter()
                .filter(|(owner, _)| *owner != person)
                .map(|(_, slug)| slug.as_str())
                .collect();
            checks.push(if others.is_empty() {
                let summary = format!("nobody else of this batch handed in {path}");
                Check::new(ID, scene, Verdict::Pass, summary)
            } else {
                let summary = format!("{path} is the same image as in {}", others.join(", "));
                Check::new(ID, scene, Verdict::Fail, summary).with_hint(
                    "a copy, unless both were drawn with one seed instead of the student numbers: \
                     an instructor decides",
                )
            });
        }
    }
}

/// Whose a hand-in is: the student number as it is written, or what else there is.
fn person(record: &Record) -> String {
    let student = &record.student;
    let known = [student.id.trim().to_owned(), student.full_name()];
    let known = known.into_iter().find(|name| !name.is_empty());
    known.unwrap_or_else(|| format!("the hand-in {}", record.slug))
}

#[cfg(test)]
mod tests {
    use super::super::record::{Conditions, Student};
    use super::*;
    use crate::evidence::Evidence;

    /// A hand-in of one image, whose content is a letter.
    fn record(slug: &str, id: &str, content: &str) -> Record {
        let image = ImageDigest {
            scene: "teapot".into(),
            path: "offline/a.exr".into(),
            sha256: content.into(),
        };
        Record {
            name: format!("{slug}.zip"),
            slug: slug.into(),
            digest: String::new(),
            student: Student { id: id.into(), ..Student::default() },
            findings: Vec::new(),
            diagnostics: String::new(),
            evidence: Evidence { checks: vec![Check::new("a", "", Verdict::Pass, "")] },
            diagnoses: Vec::new(),
            images: vec![image],
            stages: Vec::new(),
            conditions: Conditions::default(),
        }
    }

    /// Who shares with whom.
    fn shared(records: &[Record]) -> BTreeMap<&str, String> {
        let said = |record: &Record| {
            let own = record.evidence.checks.iter().filter(|check| check.id == ID);
            let failed = own.filter(|check| check.verdict == Verdict::Fail);
            failed.map(|check| check.summary.clone()).collect::<String>()
        };
        records.iter().map(|record| (record.slug.as_str(), said(record))).collect()
    }

    #[test]
    fn the_order_of_a_batch_does_not_matter_and_a_person_shares_with_others_only() {
        let batch = [
            record("ada", "1", "A"),
            record("ada-again", "1", "A"),
            record("bob", "2", "A"),
            record("eve", "3", "B"),
            record("nobody", "", "C"),
            record("noone", " ", "C"),
        ];
        let mut first = batch.to_vec();
        judge_shared(&mut first);
        let found = shared(&first);
        assert!(found["bob"].ends_with("in ada, ada-again"), "{found:?}");
        assert!(found["ada"].ends_with("in bob") && found["ada-again"].ends_with("in bob"));
        assert_eq!(found["eve"], "");
        // Without a number or a name, two hand-ins are two persons.
        assert!(found["nobody"].ends_with("in noone"), "{found:?}");
        for turn in 1..batch.len() {
            let mut other = batch.to_vec();
            other.rotate_left(turn);
            other.reverse();
            judge_shared(&mut other);
            assert_eq!(shared(&other), found);
        }
        let mut again = first.clone();
        judge_shared(&mut again);
        assert_eq!(again, first);
        // One alone shares with nobody, whatever was said of an earlier batch.
        let mut alone = vec![again.remove(2)];
        judge_shared(&mut alone);
        assert_eq!(shared(&alone)["bob"], "");
        assert_eq!(alone[0].evidence.checks.len(), 2);
    }
}
