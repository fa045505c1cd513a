//! Pictures of what is wrong: actual, expected, difference, and the worst spot enlarged.

use std::path::Path;

use basecode::Image;

use super::offline::Drawn;
use super::pipeline::Folders;
use super::prepared_scene::PreparedScene;
use super::submitted::SubmittedImage;
use crate::evidence::images::Kind;
use crate::evidence::{Check, CheckId, Picture, Verdict};
use crate::imaging::pictures::{signed_error, tone_mapped};

/// The relative error that the difference picture shows in full colour.
const FULL_SCALE: f32 = 0.1;

/// Draws the pictures of every failed image check into one of the folders and notes them in the checks.
///
/// # Errors
/// When a file cannot be written.
pub fn draw(
    checks: &mut [Check],
    cases: &[PreparedScene],
    drawn: &[Drawn],
    submitted: &[SubmittedImage],
    out: &Folders,
) -> anyhow::Result<()> {
    for check in checks.iter_mut().filter(|check| check.verdict == Verdict::Fail) {
        let Some(case) = cases.iter().find(|case| case.entry.name == check.scene) else { continue };
        let own = |kind: Kind| {
            drawn.iter().find(|d| d.scene == check.scene && d.kind == kind).map(|d| &d.image)
        };
        let actual = match check.id {
            CheckId::ImageOffline => own(Kind::Offline { spp: case.spp }),
            CheckId::ImageRealtime => own(Kind::Realtime),
            CheckId::BonusImage | CheckId::BonusProbe => own(Kind::RealtimeShadows),
            _ => submitted.iter().find_map(|image| image.shown_by(check)),
        };
        if let Some(actual) = actual {
            let out = if check.held_back { &out.instructor } else { &out.student };
            check.pictures = triple(check.id, case, actual, out)?;
        }
    }
    Ok(())
}

fn triple(
    id: CheckId,
    case: &PreparedScene,
    actual: &Image,
    out: &Path,
) -> anyhow::Result<Vec<Picture>> {
    let expected = &case.expected;
    let (reference, mask) = match id {
        CheckId::ImageRealtime | CheckId::SubmittedRealtimeAll => {
            (&expected.unshadowed, &expected.unshadowed_mask)
        }
        CheckId::BonusImage | CheckId::BonusProbe => {
            (&expected.offline.centre, &expected.offline.mask)
        }
        _ => (&expected.offline.mean, &expected.offline.mask),
    };
    std::fs::create_dir_all(out)?;
    let scale = expected.offline.median_lit;
    let mut pictures = Vec::new();
    for (title, picture) in [
        ("actual", Some(tone_mapped(actual, scale))),
        ("expected", Some(tone_mapped(reference, scale))),
        ("difference", signed_error(actual, reference, mask, scale, FULL_SCALE)),
    ] {
        let Some(picture) = picture else { continue };
        let file = format!("{}-{}-{title}.png", case.entry.name, id.name().replace('.', "-"));
        std::fs::write(out.join(&file), picture.png()?)?;
        pictures.push(Picture { title: format!("{title} ({})", picture.caption), file });
    }
    Ok(pictures)
}
