//! Pictures of two images and of their difference.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context;
use basecode::Image;

use crate::imaging::pictures::{signed_error, tone_mapped};
use crate::imaging::reference::RegionMask;

/// The relative error that the difference picture shows in full color.
const FULL_SCALE: f32 = 0.1;

/// Names of the pictures.
pub(super) const NAMES: [&str; 3] = ["actual", "expected", "difference"];

/// Writes the pictures, that of the difference when the sizes are the same, and answers their files and captions.
pub(super) fn write(
    folder: &Path,
    [actual, expected]: &[Image; 2],
) -> anyhow::Result<BTreeMap<String, String>> {
    let cannot = |path: &Path| format!("cannot write to {}", path.display());
    std::fs::create_dir_all(folder).with_context(|| cannot(folder))?;
    let scale = median(expected);
    let mask = RegionMask::background(actual.width, actual.height);
    let mut written = BTreeMap::new();
    for (name, picture) in NAMES.into_iter().zip([
        Some(tone_mapped(actual, scale)),
        Some(tone_mapped(expected, scale)),
        signed_error(actual, expected, &mask, scale, FULL_SCALE),
    ]) {
        let Some(picture) = picture else { continue };
        let file = folder.join(format!("{name}.png"));
        std::fs::write(&file, picture.png()?).with_context(|| cannot(&file))?;
        written.insert(file.display().to_string(), picture.caption);
    }
    Ok(written)
}

/// The median of the values that are not black, for exposure.
fn median(image: &Image) -> f32 {
    let mut lit: Vec<f32> = image
        .pixels
        .iter()
        .map(|p| p.element_sum() / 3.0)
        .filter(|v| v.is_finite() && *v > 0.0)
        .collect();
    lit.sort_by(f32::total_cmp);
    lit.get(lit.len() / 2).copied().unwrap_or(1.0)
}
