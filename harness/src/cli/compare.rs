//! `umbra compare`: two images, without a scene.
//!
//! One pass over both files: bands of rows are decoded on every core and compared at once, so that
//! neither image is ever whole in memory unless a picture, a page or SSIM and FLIP ask for it.

mod idiff;
mod pictures;
mod text;

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::bail;
use basecode::exr_io::{ExrRows, REC_709};
use basecode::{Image, Vec3};
use serde::Serialize;

use super::outputs::ensure_not_read;
use super::view;
use crate::harmless::{harmless, harmless_json};
use crate::imaging::difference::{Count, Differences, Different, Odd};
use crate::imaging::metrics::{Errors, Metrics};
use crate::imaging::rows::{Channels, Row, visit_rows};

/// Chromaticities closer than this are the same (they are written with four digits).
const SAME_PRIMARIES: f32 = 1e-3;

/// Options of `umbra compare`.
#[derive(clap::Args)]
pub struct CompareArguments {
    /// The actual image
    #[arg(required_unless_present = "idiff")]
    actual: Option<PathBuf>,
    /// The expected image
    #[arg(required_unless_present = "idiff")]
    expected: Option<PathBuf>,
    /// The layer to compare, such as `mean` of a stored expected image; the other file may have only
    /// plain channels instead, such as R, G and B [default: plain R, G and B, or the only layer]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Count a pixel with a NaN as different, even where both images have one
    #[arg(long)]
    nan_is_error: bool,
    /// Measure SSIM and FLIP too, which take most of the time
    #[arg(long)]
    metrics: bool,
    /// Leave out all metrics, the mean errors too
    #[arg(long, conflicts_with = "metrics")]
    no_metrics: bool,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    /// Write actual, expected and, of one size, their difference as PNG files into this folder
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Write a page with a viewer of both images and their difference into this folder
    #[arg(long, value_name = "DIR")]
    html: Option<PathBuf>,
    /// Take all that follows as the arguments of OpenImageIO's idiff, and end with its exit codes
    /// (`umbra compare --idiff -help` lists them)
    #[arg(
        long, num_args = 0.., allow_hyphen_values = true, value_name = "ARGUMENTS",
        conflicts_with_all = ["layer", "nan_is_error", "metrics", "no_metrics", "json", "pictures", "html"]
    )]
    idiff: Option<Vec<OsString>>,
}

/// One of the two images.
#[derive(Serialize)]
struct Side {
    /// The path; a name that is not Unicode has U+FFFD in its place.
    file: String,
    /// The layer; "" is plain R, G and B.
    layer: String,
    width: usize,
    height: usize,
    /// What the file holds that is not compared.
    notes: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    not_finite: Option<Pixels>,
    #[serde(skip_serializing_if = "Option::is_none")]
    negative: Option<Pixels>,
}

/// Some pixels of an image.
#[derive(Serialize)]
struct Pixels {
    count: usize,
    /// Column and row of the first.
    first: [usize; 2],
}

/// A pixel that differs.
#[derive(Serialize)]
struct Difference {
    x: usize,
    y: usize,
    #[serde(serialize_with = "any_float")]
    actual: [f32; 3],
    #[serde(serialize_with = "any_float")]
    expected: [f32; 3],
    /// Of the channel that differs most; none where a value is not finite.
    difference: Option<f64>,
}

/// The report on two images.
#[derive(Serialize)]
struct Comparison {
    equal: bool,
    actual: Side,
    expected: Side,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    notes: Vec<String>,
    /// Nothing more is compared when the sizes differ.
    #[serde(flatten)]
    values: Option<Values>,
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pictures: BTreeMap<String, String>,
    /// The viewer's page.
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<String>,
}

/// How the pixels of two images of one size differ.
#[derive(Serialize)]
struct Values {
    pixels: usize,
    differing: usize,
    /// The largest difference; one with a value that is not finite comes first.
    largest: Option<Difference>,
    /// The largest among pixels with finite values.
    largest_finite: Option<Difference>,
    #[serde(skip_serializing_if = "Option::is_none")]
    metrics: Option<Measured>,
}

/// The error metrics that were asked for.
#[derive(Serialize)]
#[serde(untagged)]
enum Measured {
    Errors(Errors),
    All(Metrics),
}

/// What is learned of a band of rows.
#[derive(Default)]
struct Found {
    odd: [Odd; 2],
    differences: Differences,
    /// The pixels, where they are wanted.
    pixels: [Vec<Vec3>; 2],
    sizes: Vec<i32>,
}

/// The layers of a file, and the indices of their R, G and B.
type Layers = Vec<(String, [usize; 3])>;

/// An image that is open, and the layer that is compared.
struct Open {
    file: ExrRows<'static>,
    layer: String,
    channels: [usize; 3],
    notes: Vec<String>,
}

/// The exit code of `--idiff` when a file, the command line or standard output cannot be used.
pub const IDIFF_CANNOT: u8 = idiff::CANNOT;

/// Whether the program's arguments ask for `umbra compare --idiff`.
pub fn is_idiff(arguments: &[OsString]) -> bool {
    let mut names = arguments.iter().map(|argument| argument.to_string_lossy());
    names.any(|name| name == "compare")
        && names.any(|name| name == "--idiff" || name.starts_with("--idiff="))
}

/// Prints where two images differ; exit 0 when they are equal, 1 when not. Without the scene's
/// variance nothing more can be decided: `check` and `grade` decide, this only measures.
///
/// # Errors
/// When two images are not given or cannot be read, or a page or picture cannot be written.
pub fn run(arguments: &CompareArguments) -> anyhow::Result<u8> {
    let images = [&arguments.actual, &arguments.expected];
    if let Some(theirs) = &arguments.idiff {
        let before = images.into_iter().flatten().map(|path| path.clone().into_os_string());
        return Ok(idiff::run(&before.chain(theirs.iter().cloned()).collect::<Vec<_>>()));
    }
    let [Some(actual), Some(expected)] = images else {
        bail!("expected two images");
    };
    let read = [actual.as_path(), expected];
    if let Some(folder) = &arguments.html {
        ensure_not_read(&folder.join(view::PAGE), read)?;
    }
    if let Some(folder) = &arguments.pictures {
        for name in pictures::NAMES {
            ensure_not_read(&folder.join(format!("{name}.png")), read)?;
        }
    }
    let [actual, expected] = open([actual, expected], arguments.layer.as_deref())?;
    let mut notes = Vec::new();
    notes.extend(different_primaries(&actual.file, &expected.file));
    notes.extend(different_aspects(&actual.file, &expected.file));
    let keep = arguments.metrics || arguments.pictures.is_some() || arguments.html.is_some();
    let same_size = actual.size() == expected.size();
    let mut found = if same_size {
        survey(&[&actual, &expected], arguments.nan_is_error, keep)?
    } else {
        let mut found = survey(&[&actual], false, keep)?;
        let other = survey(&[&expected], false, keep)?;
        let [odd, _] = other.odd;
        let [pixels, _] = other.pixels;
        (found.odd[1], found.pixels[1]) = (odd, pixels);
        found
    };
    let [actual_pixels, expected_pixels] = std::mem::take(&mut found.pixels);
    let images = keep.then(|| [actual.image(actual_pixels), expected.image(expected_pixels)]);
    let values = same_size.then(|| {
        let count = actual.file.width() * actual.file.height();
        let metrics = match &images {
            Some([a, b]) if arguments.metrics => Metrics::measure(a, b).map(Measured::All),
            _ if arguments.no_metrics => None,
            _ => Some(Measured::Errors(Errors::of_sums(&found.differences.sums, count))),
        };
        Values {
            pixels: count,
            differing: found.differences.differing,
            largest: found.differences.largest.map(Difference::from),
            largest_finite: found.differences.largest_finite.map(Difference::from),
            metrics,
        }
    });
    let [odd_actual, odd_expected] = found.odd;
    let mut comparison = Comparison {
        equal: values.as_ref().is_some_and(|values| values.differing == 0),
        actual: actual.side(&odd_actual),
        expected: expected.side(&odd_expected),
        notes,
        values,
        pictures: BTreeMap::new(),
        page: None,
    };
    if let (Some(folder), Some(images)) = (&arguments.pictures, &images) {
        comparison.pictures = pictures::write(folder, images)?;
    }
    if let (Some(folder), Some([actual, expected])) = (&arguments.html, images) {
        let names = view::names_of(&read);
        let names = [format!("actual {}", names[0]), format!("expected {}", names[1])];
        let page = view::compared_page(folder, names, [&actual, &expected])?;
        comparison.page = Some(page.display().to_string());
    }
    if arguments.json {
        println!("{}", harmless_json(&comparison)?);
    } else {
        print!("{}", text::text(&comparison)?);
    }
    Ok(if comparison.equal { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER })
}

/// A file that is open, and all that could be compared of it.
struct Choices {
    path: PathBuf,
    parts: Vec<ExrRows<'static>>,
    /// Each layer, and which of the parts it is in.
    layers: Layers,
    part_of: Vec<usize>,
    /// What is to know of each part.
    notes: Vec<Vec<String>>,
    left_out: Vec<String>,
}

/// Opens both images and finds the layer to compare.
fn open(paths: [&PathBuf; 2], wanted: Option<&str>) -> anyhow::Result<[Open; 2]> {
    let [actual, expected] = paths.map(|path| Choices::of(path));
    let (actual, expected) = (actual?, expected?);
    if let Some(wanted) = wanted {
        let lacks = |file: &Choices| {
            let has = file.layers.iter().any(|(name, _)| name == wanted);
            let all = || format!("{} (it has: {})", file.path.display(), names(&file.layers));
            (!has).then(|| (all(), file.is_plain()))
        };
        match (lacks(&actual), lacks(&expected)) {
            (Some((a, _)), Some((b, _))) => bail!("no layer \"{wanted}\" in {a} nor in {b}"),
            (Some((file, false)), None) | (None, Some((file, false))) => {
                bail!("no layer \"{wanted}\" in {file}")
            }
            _ => {}
        }
    }
    Ok([actual.choose(wanted)?, expected.choose(wanted)?])
}

impl Choices {
    /// Opens a file; an error where nothing in it can be compared.
    fn of(path: &Path) -> anyhow::Result<Self> {
        let (parts, left_out) = ExrRows::open_parts(path)?;
        let (mut layers, mut part_of) = (Layers::new(), Vec::new());
        let (mut notes, mut first) = (Vec::new(), None);
        for (index, part) in parts.iter().enumerate() {
            match part.layers() {
                Ok((own, noted)) => {
                    part_of.resize(part_of.len() + own.len(), index);
                    let named = |(name, found): (String, _)| (part.name_in_file(&name), found);
                    layers.extend(own.into_iter().map(named));
                    notes.push(noted);
                }
                Err(error) => {
                    notes.push(Vec::new());
                    first.get_or_insert(error);
                }
            }
        }
        match first {
            Some(error) if layers.is_empty() => Err(error.into()),
            _ => Ok(Self { path: path.into(), parts, layers, part_of, notes, left_out }),
        }
    }

    /// Whether there are no layers, but only channels without one.
    fn is_plain(&self) -> bool {
        let plain = |part: &ExrRows| part.channels().iter().all(|name| !name.contains('.'));
        self.parts.len() == 1 && self.parts.iter().all(plain)
    }

    /// Takes a layer out of the file: the one wanted, if it is there; else plain R, G and B, or the only one.
    fn choose(mut self, wanted: Option<&str>) -> anyhow::Result<Open> {
        let at = |name: &str| self.layers.iter().position(|(own, _)| own == name);
        let only = (self.layers.len() == 1).then_some(0);
        let Some(index) = wanted.and_then(at).or_else(|| at("")).or(only) else {
            let all = names(&self.layers);
            bail!("{}: which layer? hint: --layer NAME, one of {all}", self.path.display());
        };
        let (layer, channels) = self.layers.remove(index);
        let part = self.part_of[index];
        let mut notes = self.left_out;
        notes.append(&mut self.notes[part]);
        if !self.layers.is_empty() {
            let others = names(&self.layers);
            notes.push(format!("other layers are not compared: {others} (--layer NAME)"));
        }
        let without = |index: &usize| !self.part_of.contains(index);
        for index in (0..self.parts.len()).filter(without) {
            let name = harmless(self.parts[index].part());
            notes.push(format!("part {name} is not compared: it has no colors"));
        }
        Ok(Open { file: self.parts.swap_remove(part), layer, channels, notes })
    }
}

/// The names of a file's layers, for messages.
fn names(layers: &[(String, [usize; 3])]) -> String {
    layers.iter().map(|(name, _)| shown(name)).collect::<Vec<_>>().join(", ")
}

fn shown(layer: &str) -> String {
    if layer.is_empty() { "plain R, G, B".to_owned() } else { harmless(layer) }
}

impl Open {
    fn size(&self) -> [usize; 2] {
        [self.file.width(), self.file.height()]
    }

    fn image(&self, pixels: Vec<Vec3>) -> Image {
        Image { width: self.file.width(), height: self.file.height(), pixels }
    }

    fn side(&self, odd: &Odd) -> Side {
        let pixels = |Count { count, first }| (count > 0).then_some(Pixels { count, first });
        let [width, height] = self.size();
        Side {
            file: self.file.path().display().to_string(),
            layer: self.layer.clone(),
            width,
            height,
            notes: self.notes.clone(),
            not_finite: pixels(odd.not_finite),
            negative: pixels(odd.negative),
        }
    }
}

/// Goes through all rows of one image or of two of one size; `keep` the pixels too.
fn survey(images: &[&Open], nan_is_error: bool, keep: bool) -> anyhow::Result<Found> {
    let channels: Vec<Channels> = images
        .iter()
        .map(|image| Channels { file: &image.file, channels: &image.channels })
        .collect();
    let visit = |found: &mut Found, row: Row| {
        let mut finite = true;
        for (image, odd) in found.odd.iter_mut().enumerate().take(images.len()) {
            let colors = row.colors(image);
            finite &= odd.add(row.y, colors);
            if keep {
                let [red, green, blue] = colors;
                let colors = red.iter().zip(green).zip(blue);
                found.pixels[image].extend(colors.map(|((&r, &g), &b)| Vec3::new(r, g, b)));
            }
        }
        if images.len() == 2 {
            found.differences.add(&row, nan_is_error, finite, &mut found.sizes);
        }
    };
    let mut all = Found::default();
    for mut band in visit_rows(&channels, visit)? {
        for i in 0..2 {
            all.odd[i].append(&band.odd[i]);
            all.pixels[i].append(&mut band.pixels[i]);
        }
        all.differences.append(&band.differences);
    }
    Ok(all)
}

/// The remark on files with different primaries.
fn different_primaries(actual: &ExrRows, expected: &ExrRows) -> Option<String> {
    let [actual, expected] =
        [actual, expected].map(|file| file.chromaticities().unwrap_or(REC_709));
    let apart = |(a, b): (&f32, &f32)| (a - b).is_nan() || (a - b).abs() > SAME_PRIMARIES;
    actual.iter().flatten().zip(expected.iter().flatten()).any(apart).then(|| {
        format!(
            "chromaticities differ, and values are compared as they are: actual {}, expected {}",
            primaries(&actual),
            primaries(&expected)
        )
    })
}

/// The remark on files whose pixels are shown at different widths.
fn different_aspects(actual: &ExrRows, expected: &ExrRows) -> Option<String> {
    let [actual, expected] = [actual, expected].map(ExrRows::pixel_aspect);
    // As not equal counts what is no number.
    let differ = (actual - expected).abs() > 1e-6 || actual.is_nan() != expected.is_nan();
    differ.then(|| {
        format!(
            "pixel aspect ratios differ, and values are compared as they are: actual {actual}, expected {expected}"
        )
    })
}

fn primaries([red, green, blue, white]: &[[f32; 2]; 4]) -> String {
    let xy = |[x, y]: &[f32; 2]| format!("({x}, {y})");
    let (red, green, blue, white) = (xy(red), xy(green), xy(blue), xy(white));
    format!("red {red} green {green} blue {blue} white {white}")
}

impl From<Different> for Difference {
    fn from(found: Different) -> Self {
        let Different { at: [x, y], size, actual, expected } = found;
        // As short as the values are, where 32 bits hold it.
        let short = (size as f32).to_string().parse().ok().filter(|short: &f64| short.is_finite());
        let difference = Some(short.unwrap_or(size)).filter(|size| size.is_finite());
        Self { x, y, actual, expected, difference }
    }
}

/// Values in JSON; those that are not finite become text.
fn any_float<S: serde::Serializer>(values: &[f32; 3], serializer: S) -> Result<S::Ok, S::Error> {
    let value = |v: f32| match v.is_finite() {
        true => serde_json::Value::from(v),
        false => serde_json::Value::from(v.to_string()),
    };
    values.map(value).serialize(serializer)
}
