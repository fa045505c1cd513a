//! Where the errors of a class lie in each scene: pictures for its page.

use std::collections::BTreeMap;
use std::path::Path;

use super::{ReportError, put};
use crate::evidence::{CheckId, Verdict};
use crate::grading::{Record, SceneErrors};
use crate::imaging::error_map::MeanError;

/// The folder of the pictures, in the instructor's folder.
pub const ERRORS: &str = "errors";

/// The images that a submission's code draws.
const IMAGES: [CheckId; 3] = [CheckId::ImageOffline, CheckId::ImageRealtime, CheckId::BonusImage];

/// The mean error of all images of a scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ErrorPicture {
    /// The scene.
    pub scene: String,
    /// Whether it is held back from students.
    pub held_back: bool,
    /// Which image of it.
    pub check: CheckId,
    /// The picture's file, in [`ERRORS`].
    pub file: String,
    /// Its width in pixels.
    pub width: usize,
    /// Its height in pixels.
    pub height: usize,
    /// What its colors mean.
    pub caption: String,
}

/// The errors of a class, added up record by record.
#[derive(Default)]
pub struct ClassErrors(BTreeMap<(bool, String, CheckId), (MeanError, usize)>);

impl ClassErrors {
    /// Adds what was found out about a submission.
    pub fn add(&mut self, record: &Record) {
        for check in &record.evidence.checks {
            let of = |own: &&SceneErrors| {
                (own.check, own.held_back, &own.scene) == (check.id, check.held_back, &check.scene)
            };
            let map = record.error_maps.iter().find(of);
            // A wrong image without a map was not drawn, or shows nothing yet: its errors lie nowhere.
            if IMAGES.contains(&check.id) && (check.verdict == Verdict::Pass || map.is_some()) {
                let key = (check.held_back, check.scene.clone(), check.id);
                let (mean, count) = self.0.entry(key).or_default();
                *count += 1;
                map.into_iter().for_each(|own| mean.add(&own.map));
            }
        }
    }

    /// Writes the pictures into a folder, and answers what they are.
    ///
    /// # Errors
    /// When one cannot be written.
    pub fn write(&self, folder: &Path) -> Result<Vec<ErrorPicture>, ReportError> {
        let mut written = Vec::new();
        for ((held_back, scene, check), (mean, count)) in &self.0 {
            let Some(picture) = mean.picture(*count) else { continue };
            let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
            let file = format!("{scene}-{}", check.name()).chars().map(plain).collect::<String>();
            let file = format!("{file}.png");
            let png = picture.png().map_err(|error| ReportError::Entry {
                slug: file.clone(),
                reason: error.to_string(),
            })?;
            put(folder, &file, &png)?;
            written.push(ErrorPicture {
                scene: scene.clone(),
                held_back: *held_back,
                check: *check,
                file,
                width: picture.width,
                height: picture.height,
                caption: format!("{}; {count} images", picture.caption),
            });
        }
        Ok(written)
    }
}

#[cfg(test)]
mod tests {
    use basecode::{Image, Vec3};

    use super::super::sample;
    use super::*;
    use crate::evidence::Check;
    use crate::imaging::error_map::ErrorMap;
    use crate::imaging::reference::RegionMask;

    #[test]
    fn the_mean_is_over_all_that_were_drawn() {
        let expected = Image { width: 2, height: 1, pixels: vec![Vec3::ONE; 2] };
        let actual = Image { pixels: vec![Vec3::splat(0.5), Vec3::ONE], ..expected.clone() };
        let mask = RegionMask { width: 2, height: 1, regions: Vec::new(), pixels: vec![0; 2] };
        let map = ErrorMap::of(&actual, &expected, &mask, 1.0).unwrap();
        let mut wrong = sample::report().entries.remove(1).record;
        let of = |verdict| Check::new(CheckId::ImageOffline, "cbox", verdict, "");
        wrong.evidence.checks = vec![of(Verdict::Fail)];
        let mut right = wrong.clone();
        right.evidence.checks = vec![of(Verdict::Pass)];
        let (scene, check) = ("cbox".to_owned(), CheckId::ImageOffline);
        wrong.error_maps = vec![SceneErrors { check, scene, held_back: false, map }];
        let mut errors = ClassErrors::default();
        // One that panicked or hung drew nothing that could be near or far off.
        let not_drawn = Record { error_maps: Vec::new(), ..wrong.clone() };
        for record in [&wrong, &right, &not_drawn, &right, &right, &right] {
            errors.add(record);
        }
        let folder = tempfile::tempdir().unwrap();
        let [picture] = errors.write(folder.path()).unwrap().try_into().unwrap();
        assert_eq!(picture.file, "cbox-image-offline.png");
        assert!(picture.caption.ends_with("light yellow 10.0 %; 5 images"), "{}", picture.caption);
        assert!(folder.path().join(picture.file).is_file());
        // Nothing is drawn of a class in which all is right.
        let mut errors = ClassErrors::default();
        errors.add(&right);
        assert_eq!(errors.write(folder.path()).unwrap(), []);
    }
}
