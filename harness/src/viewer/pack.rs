//! Images as scripts that hand their bits to the viewer. `docs/decisions/0024-viewer-data.md` says why.

use std::collections::HashSet;
use std::io::{self, Write};
use std::path::Path;

use base64::Engine as _;
use basecode::Image;
use sha2::{Digest as _, Sha256};

use super::{DATA_FOLDER, ImageFile, Samples, ViewedCase};
use crate::files::{files_below, hex, write_whole_by};
use crate::imaging::halves;
use crate::imaging::packing::{Packing, Values};
use crate::imaging::reference::RegionMask;

/// What the path of a shared file begins with.
const ABOVE: &str = "../";
/// Hexadecimal digits of a digest in a file's name.
const DIGITS: usize = 20;

/// Writes an image below `folder`: as halves where these hold its very bits, else as 32-bit floats. A file with the
/// same content is the same file.
///
/// # Errors
/// When it cannot be written.
pub fn write_image(folder: &Path, image: &Image) -> io::Result<ImageFile> {
    write(folder, (image.width, image.height, 3), Values::Image(image), Samples::Float)
}

/// Writes channels below `folder` one after the other, as [`write_image`] does three.
///
/// # Errors
/// When they cannot be written.
pub fn write_channels(
    folder: &Path,
    (width, height, channels): (usize, usize, usize),
    values: &[f32],
) -> io::Result<ImageFile> {
    write(folder, (width, height, channels), Values::Floats(values), Samples::Float)
}

/// Writes what `write` does into the folder above, which the pages in several folders share: of a class, each image
/// that all are compared with is there once.
///
/// # Errors
/// When it cannot be written.
pub fn write_shared(
    folder: &Path,
    write: impl FnOnce(&Path) -> io::Result<ImageFile>,
) -> io::Result<ImageFile> {
    let above = folder.parent().ok_or(io::ErrorKind::NotFound)?;
    let image = write(above)?;
    Ok(ImageFile { file: format!("{ABOVE}{}", image.file), ..image })
}

/// Writes how far each pixel lies off, over what is allowed there: above 1 it fails. Rounded to halves, but never
/// across 1.
///
/// # Errors
/// When it cannot be written.
pub fn write_excess(
    folder: &Path,
    (width, height): (usize, usize),
    excess: &[f32],
) -> io::Result<ImageFile> {
    let halves = halves::of_excess(excess);
    write(folder, (width, height, 1), Values::Words(&halves), Samples::Half)
}

/// Writes a mask of regions.
///
/// # Errors
/// When it cannot be written.
pub fn write_mask(folder: &Path, mask: &RegionMask) -> io::Result<ImageFile> {
    let size = (mask.width, mask.height, 1);
    write(folder, size, Values::Words(&mask.pixels), Samples::Uint16)
}

/// Removes the data files below `folder` that none of the cases needs: those of an earlier submission.
///
/// # Errors
/// When one cannot be removed.
pub fn remove_others(folder: &Path, cases: &[&ViewedCase]) -> io::Result<()> {
    let needed: HashSet<&str> = cases.iter().flat_map(|case| case.files()).collect();
    let data = folder.join(DATA_FOLDER);
    if !data.is_dir() {
        return Ok(());
    }
    for file in files_below(&data)? {
        let name = file.strip_prefix(folder).ok().and_then(Path::to_str).unwrap_or_default();
        if !needed.contains(name) {
            std::fs::remove_file(&file)?;
        }
    }
    Ok(())
}

/// Writes samples; floats as halves where that loses nothing.
fn write(
    folder: &Path,
    (width, height, channels): (usize, usize, usize),
    values: Values,
    samples: Samples,
) -> io::Result<ImageFile> {
    let packing = Packing::new(values);
    let samples = if packing.halves() { Samples::Half } else { samples };
    let mut digest = Sha256::new();
    digest.update(format!("{width} {height} {channels} {samples:?} "));
    packing.each_piece(&mut |bytes: &[u8]| digest.update(bytes));
    let digest = hex(&digest.finalize());
    let file = format!("{DATA_FOLDER}/{}.js", &digest[..DIGITS]);
    let path = folder.join(&file);
    if !path.is_file() {
        write_whole_by(&path, |out| {
            write!(out, "umbraImage(\"{file}\",\"")?;
            let mut text = Base64 { out, rest: Vec::new() };
            packing.pack(&mut |bytes| text.write(bytes))?;
            text.end()?.write_all(b"\");\n")
        })?;
    }
    Ok(ImageFile { file, width, height, channels, samples })
}

/// Turns bytes into text as they come.
struct Base64<'a> {
    out: &'a mut dyn Write,
    /// Bytes that are no whole group of three yet.
    rest: Vec<u8>,
}

impl<'a> Base64<'a> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.rest.extend_from_slice(bytes);
        let whole = self.rest.len() / 3 * 3;
        let text = base64::engine::general_purpose::STANDARD.encode(&self.rest[..whole]);
        self.rest.drain(..whole);
        self.out.write_all(text.as_bytes())
    }

    /// Writes what is left.
    fn end(self) -> io::Result<&'a mut dyn Write> {
        let text = base64::engine::general_purpose::STANDARD.encode(&self.rest);
        self.out.write_all(text.as_bytes())?;
        Ok(self.out)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use basecode::Vec3;
    use flate2::read::ZlibDecoder;
    use half::f16;

    use super::super::Layer;
    use super::*;

    /// The samples of a data file, as data.js reads them.
    fn samples(folder: &Path, image: &ImageFile) -> Vec<u32> {
        let text = std::fs::read_to_string(folder.join(&image.file)).unwrap();
        let packed = text.split('"').nth(3).unwrap();
        let packed = base64::engine::general_purpose::STANDARD.decode(packed).unwrap();
        let mut planes = Vec::new();
        ZlibDecoder::new(packed.as_slice()).read_to_end(&mut planes).unwrap();
        let count = image.width * image.height * image.channels;
        let bytes = planes.len() / count;
        let mask = if bytes == 2 { 0xffff } else { u32::MAX };
        let mut last = 0u32;
        let sample = |index| {
            let step = (0..bytes)
                .fold(0u32, |step, plane| step << 8 | u32::from(planes[plane * count + index]));
            last = last.wrapping_add(step) & mask;
            last
        };
        (0..count).map(sample).collect()
    }

    #[test]
    fn every_bit_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let odd = [
            0.1,
            -0.0,
            f32::NAN,
            f32::INFINITY,
            f32::from_bits(0x7fa0_0001),
            f32::MIN_POSITIVE,
            39.0,
            -1e-45,
        ];
        let image = |values: &[f32]| Image {
            width: 4,
            height: values.len() / 4,
            pixels: values.iter().map(|&v| Vec3::new(v, -v, 0.5)).collect(),
        };
        let floats = image(&odd);
        let file = write_image(folder.path(), &floats).unwrap();
        assert_eq!((file.samples, file.width, file.height), (Samples::Float, 4, 2));
        let expected = (0..3).flat_map(|c| floats.pixels.iter().map(move |p| p[c].to_bits()));
        assert_eq!(samples(folder.path(), &file), expected.collect::<Vec<_>>());

        let halves = image(&[0.5, 65504.0, f32::NEG_INFINITY, 6e-8]);
        assert_eq!(write_image(folder.path(), &halves).unwrap().samples, Samples::Float);
        let halves = image(&[0.5, 65504.0, f32::NEG_INFINITY, f16::from_bits(1).to_f32()]);
        let file = write_image(folder.path(), &halves).unwrap();
        assert_eq!(file.samples, Samples::Half);
        assert_eq!(samples(folder.path(), &file)[..4], [0x3800, 0x7bff, 0xfc00, 1]);
    }

    #[test]
    fn one_image_is_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let mut image = Image::new(5, 3);
        let file = write_image(folder.path(), &image).unwrap();
        assert_eq!(write_image(folder.path(), &image).unwrap(), file);
        image.pixels[7].y = 1.0;
        assert_ne!(write_image(folder.path(), &image).unwrap().file, file.file);
        // The same zeros in another shape are another image.
        assert_ne!(write_image(folder.path(), &Image::new(3, 5)).unwrap().file, file.file);
    }

    #[test]
    fn a_shared_image_is_one_file_for_all_folders_beside_it() {
        let place = tempfile::tempdir().unwrap();
        let [ann, bob] = ["ann", "bob"].map(|name| {
            let folder = place.path().join(name);
            let file =
                write_shared(&folder, |above| write_image(above, &Image::new(5, 3))).unwrap();
            assert!(folder.join("x").parent().is_some() && !folder.join(DATA_FOLDER).exists());
            file
        });
        assert_eq!(ann, bob);
        let name = ann.file.strip_prefix("../viewer/").unwrap();
        let files = files_below(place.path()).unwrap();
        assert_eq!(files, [place.path().join(DATA_FOLDER).join(name)]);
        // A folder of one's own takes away none of them.
        std::fs::create_dir_all(place.path().join("ann").join(DATA_FOLDER)).unwrap();
        remove_others(&place.path().join("ann"), &[]).unwrap();
        assert!(files[0].is_file());
    }

    #[test]
    fn what_nobody_needs_any_more_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let [old, new] =
            [3, 4].map(|side| write_image(folder.path(), &Image::new(side, side)).unwrap());
        let case = ViewedCase { layers: vec![Layer::image("a", &new)], ..Default::default() };
        remove_others(folder.path(), &[&case]).unwrap();
        assert!(!folder.path().join(old.file).exists() && folder.path().join(new.file).exists());
        remove_others(folder.path(), &[]).unwrap();
        assert_eq!(folder.path().join(DATA_FOLDER).read_dir().unwrap().count(), 0);
        remove_others(&folder.path().join("none"), &[]).unwrap();
    }

    #[test]
    fn rounding_turns_no_verdict() {
        let folder = tempfile::tempdir().unwrap();
        let excess = [0.0, 1.0, 1.000_01, 0.999_99, 1e9, f32::INFINITY, f32::NAN, 2.5];
        let file = write_excess(folder.path(), (8, 1), &excess).unwrap();
        let found = samples(folder.path(), &file);
        let found: Vec<f32> = found.iter().map(|&s| f16::from_bits(s as u16).to_f32()).collect();
        for (value, found) in excess.iter().zip(&found) {
            assert_eq!(*value <= 1.0, *found <= 1.0, "{value} became {found}");
        }
        assert_eq!(found[7], 2.5);
    }
}
