//! The file of an image that `umbra render` writes.

use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use basecode::exr_io::{Precision, write_exr};
use basecode::scene::SceneConfig;
use basecode::{Image, Vec3};

use crate::imaging::pictures::clamped;

/// What a file's name asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ImageFormat {
    Exr,
    Png,
}

impl ImageFormat {
    /// The format of an output file, which must be possible to write.
    pub(super) fn of(output: &Path) -> anyhow::Result<Self> {
        let ending = output.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let format = match ending.as_str() {
            "exr" => Self::Exr,
            "png" => Self::Png,
            _ => bail!("{}: the name of an image ends in .exr or .png", output.display()),
        };
        let folder = output.parent().unwrap_or(Path::new(""));
        if !folder.as_os_str().is_empty() && !folder.is_dir() {
            bail!("{}: there is no folder {}", output.display(), folder.display());
        }
        try_to_write(output).with_context(|| output.display().to_string())?;
        Ok(format)
    }

    /// Writes an image as float for what is drawn offline, as half for realtime as the course's own files are.
    pub(super) fn save(
        self,
        values: &[f32],
        config: &SceneConfig,
        file: &Path,
    ) -> anyhow::Result<()> {
        let pixels = values.as_chunks::<3>().0.iter().map(|&v| Vec3::from(v)).collect();
        let image = Image { width: config.width, height: config.height, pixels };
        for said in looks_broken(&image) {
            eprintln!("umbra: warning: {}: {said}", file.display());
        }
        let precision = if config.realtime { Precision::Half } else { Precision::Float };
        match self {
            Self::Exr => write_exr(file, &image, precision, &[])?,
            Self::Png => {
                let picture = clamped(&image);
                let name = file.display();
                std::fs::write(file, picture.png()?).with_context(|| name.to_string())?;
                eprintln!("umbra: {name}: {}; write an .exr to compare it", picture.caption);
            }
        }
        Ok(())
    }
}

/// Opens a file to write it, so that no work is lost on one that cannot be; changes none.
fn try_to_write(output: &Path) -> anyhow::Result<()> {
    let is_new = output.symlink_metadata().is_err();
    // To open a pipe is to wait for its reader.
    ensure!(!output.exists() || output.is_file(), "expected a file, found {}", kind_of(output));
    std::fs::OpenOptions::new().write(true).create(true).truncate(false).open(output)?;
    if is_new {
        std::fs::remove_file(output)?;
    }
    Ok(())
}

/// What lies at a path that is no file.
pub(super) fn kind_of(path: &Path) -> &'static str {
    if path.is_dir() { "a folder" } else { "a pipe or device" }
}

/// Below this, a value is more than rounding.
const NEGATIVE: f32 = -1e-6;

/// What a viewer may not show of an image that no right renderer draws.
fn looks_broken(image: &Image) -> Vec<String> {
    type Trouble = (&'static str, fn(&Vec3) -> bool);
    let mut said = Vec::new();
    let kinds: [Trouble; 2] =
        [("not finite", |p| !p.is_finite()), ("negative", |p| p.min_element() < NEGATIVE)];
    for (what, is_it) in kinds {
        let count = image.pixels.iter().filter(|p| is_it(p)).count();
        if let Some(first) = image.pixels.iter().position(is_it) {
            let (x, y) = (first % image.width, first / image.width);
            let pixels = if count == 1 { "pixel is" } else { "pixels are" };
            said.push(format!("{count} {pixels} {what}; first at ({x}, {y})"));
        }
    }
    if image.pixels.iter().all(|p| *p == Vec3::ZERO) {
        said.push("the image is black all over".to_owned());
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_image_that_no_viewer_shows_is_warned_of() {
        let said = |pixels: [[f32; 3]; 4]| {
            let pixels = pixels.map(Vec3::from).to_vec();
            looks_broken(&Image { width: 2, height: 2, pixels }).join("; ")
        };
        let (gray, black) = ([0.5; 3], [0.0; 3]);
        assert_eq!(said([gray, black, black, black]), "");
        assert_eq!(said([[-1e-7; 3], gray, gray, gray]), "");
        assert_eq!(said([black; 4]), "the image is black all over");
        let (nan, negative) = ([f32::NAN, 0.5, 0.5], [-0.5, 0.5, 0.5]);
        assert_eq!(said([gray, black, nan, gray]), "1 pixel is not finite; first at (0, 1)");
        let infinite = [f32::INFINITY; 3];
        assert_eq!(said([infinite; 4]), "4 pixels are not finite; first at (0, 0)");
        assert_eq!(
            said([gray, negative, gray, negative]),
            "2 pixels are negative; first at (1, 0)"
        );
        assert_eq!(
            said([gray, negative, gray, nan]),
            "1 pixel is not finite; first at (1, 1); 1 pixel is negative; first at (1, 0)"
        );
    }
}
