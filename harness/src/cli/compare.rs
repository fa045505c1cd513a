//! `umbra compare`: two images, without a scene.
//!
//! One pass over both files: bands of rows are decoded on every core and compared at once, so that
//! neither image is ever whole in memory unless a picture or a metric asks for it.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::bail;
use basecode::exr_io::{ExrLayers, REC_709, read_exr_layers};
use basecode::{Image, Vec3};
use serde::Serialize;

use crate::imaging::metrics::Metrics;
use crate::imaging::pictures::{signed_error, tone_mapped};
use crate::imaging::reference::RegionMask;

/// The relative error that the difference picture shows in full colour.
const FULL_SCALE: f32 = 0.1;
/// Chromaticities closer than this are the same (they are written with four digits).
const SAME_PRIMARIES: f32 = 1e-3;

/// Options of `umbra compare`.
#[derive(clap::Args)]
pub struct CompareArguments {
    /// The actual image
    actual: PathBuf,
    /// The expected image
    expected: PathBuf,
    /// The layer to compare, such as `mean` of a stored expected image; a file with only plain R, G
    /// and B is used as it is [default: plain R, G and B, or the only layer]
    #[arg(long, value_name = "NAME")]
    layer: Option<String>,
    /// Count a pixel with a NaN as different, even where both images have one
    #[arg(long)]
    nan_is_error: bool,
    /// Leave out the metrics, FLIP and SSIM among them, which take most of the time of large images
    #[arg(long)]
    no_metrics: bool,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
    /// Write actual, expected and difference as PNG files into this folder
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Write a page with a viewer of both images and their difference into this folder
    #[arg(long, value_name = "DIR")]
    html: Option<PathBuf>,
}

/// One of the two images.
#[derive(Serialize)]
struct Side {
    file: PathBuf,
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
    #[serde(skip)]
    image: Image,
    #[serde(skip)]
    primaries: [[f32; 2]; 4],
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
    difference: Option<f32>,
}

/// Everything that is said of two images.
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
    pictures: BTreeMap<PathBuf, String>,
    /// The viewer's page.
    #[serde(skip_serializing_if = "Option::is_none")]
    page: Option<PathBuf>,
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
    metrics: Option<Metrics>,
}

/// Prints where two images differ; exit 0 when they are equal, 1 when not. Without the scene's
/// variance nothing more can be decided: `check` and `grade` decide, this only measures.
pub fn run(arguments: &CompareArguments) -> anyhow::Result<u8> {
    let layers = [&arguments.actual, &arguments.expected].map(read_exr_layers);
    let [actual, expected] = layers;
    let (actual, expected) = (actual?, expected?);
    let wanted = arguments.layer.as_deref();
    if let Some(name) = wanted
        && ![&actual, &expected].iter().any(|file| file.layers.contains_key(name))
    {
        let [a, b] = [&actual, &expected].map(names);
        let (first, second) = (arguments.actual.display(), arguments.expected.display());
        bail!("no layer \"{name}\" in {first} (it has: {a}) nor in {second} (it has: {b})");
    }
    let actual = Side::new(&arguments.actual, actual, wanted)?;
    let expected = Side::new(&arguments.expected, expected, wanted)?;
    let mut comparison = compare(actual, expected, arguments);
    if let (Some(folder), Some(_)) = (&arguments.pictures, &comparison.values) {
        comparison.pictures = pictures(folder, &comparison)?;
    }
    if let Some(folder) = &arguments.html {
        let sides = [("actual", &comparison.actual), ("expected", &comparison.expected)];
        let images = sides.map(|(name, side)| (name.to_owned(), side.image.clone()));
        comparison.page = Some(super::view::write_page(folder, &images)?);
    }
    if arguments.json {
        println!("{}", serde_json::to_string_pretty(&comparison)?);
    } else {
        print!("{}", text(&comparison)?);
    }
    Ok(if comparison.equal { super::EXIT_OK } else { super::EXIT_NOT_IN_ORDER })
}

/// The names of a file's layers, for messages.
fn names(file: &ExrLayers) -> String {
    let name = |name: &String| if name.is_empty() { "plain R, G, B".into() } else { name.clone() };
    file.layers.keys().map(name).collect::<Vec<_>>().join(", ")
}

impl Side {
    /// Takes the layer out of a file: the one wanted, if it is there; else plain R, G and B, or the
    /// only one.
    fn new(path: &Path, mut file: ExrLayers, wanted: Option<&str>) -> anyhow::Result<Self> {
        let all = names(&file);
        let only = file.layers.keys().next().filter(|_| file.layers.len() == 1).cloned();
        let choices = [wanted.map(str::to_owned), Some(String::new()), only];
        let layer = choices.into_iter().flatten().find(|name| file.layers.contains_key(name));
        let found = layer.and_then(|name| file.layers.remove_entry(&name));
        let Some((layer, image)) = found else {
            bail!("{}: which layer? hint: --layer NAME, one of {all}", path.display());
        };
        let mut notes = file.notes;
        if !file.layers.is_empty() {
            let others = file.layers.keys().map(|name| match name.as_str() {
                "" => "plain R, G, B",
                name => name,
            });
            let others = others.collect::<Vec<_>>().join(", ");
            notes.push(format!("other layers are not compared: {others} (--layer NAME)"));
        }
        let pixels = |wanted: fn(&Vec3) -> bool| {
            let first = image.pixels.iter().position(wanted)?;
            let count = image.pixels.iter().filter(|pixel| wanted(pixel)).count();
            Some(Pixels { count, first: [first % image.width, first / image.width] })
        };
        Ok(Self {
            file: path.to_owned(),
            layer,
            width: image.width,
            height: image.height,
            notes,
            not_finite: pixels(|p| !p.is_finite()),
            negative: pixels(|p| p.to_array().iter().any(|&v| v < 0.0)),
            primaries: file.chromaticities.unwrap_or(REC_709),
            image,
        })
    }
}

fn compare(actual: Side, expected: Side, arguments: &CompareArguments) -> Comparison {
    let mut notes = Vec::new();
    let apart = actual.primaries.iter().flatten().zip(expected.primaries.iter().flatten());
    if apart.into_iter().any(|(a, b)| (a - b).is_nan() || (a - b).abs() > SAME_PRIMARIES) {
        notes.push(format!(
            "chromaticities differ, and values are compared as they are: actual {}, expected {}",
            primaries(&actual.primaries),
            primaries(&expected.primaries)
        ));
    }
    let same_size = (actual.width, actual.height) == (expected.width, expected.height);
    let mut values =
        same_size.then(|| Values::new(&actual.image, &expected.image, arguments.nan_is_error));
    if let Some(values) = values.as_mut().filter(|_| !arguments.no_metrics) {
        values.metrics = Metrics::measure(&actual.image, &expected.image);
    }
    let equal = values.as_ref().is_some_and(|values| values.differing == 0);
    Comparison { equal, actual, expected, notes, values, pictures: BTreeMap::new(), page: None }
}

fn primaries([red, green, blue, white]: &[[f32; 2]; 4]) -> String {
    let xy = |[x, y]: &[f32; 2]| format!("({x}, {y})");
    let (red, green, blue, white) = (xy(red), xy(green), xy(blue), xy(white));
    format!("red {red} green {green} blue {blue} white {white}")
}

impl Values {
    fn new(actual: &Image, expected: &Image, nan_is_error: bool) -> Self {
        let mut differing = 0;
        // Index and size of the largest difference, and of the largest finite one.
        let (mut largest, mut largest_finite) = (None, None);
        for (index, (a, b)) in actual.pixels.iter().zip(&expected.pixels).enumerate() {
            let Some(difference) = difference(*a, *b, nan_is_error) else { continue };
            differing += 1;
            let keep = |largest: &mut Option<(usize, f32)>| {
                if largest.is_none_or(|(_, size)| difference > size) {
                    *largest = Some((index, difference));
                }
            };
            keep(&mut largest);
            if difference.is_finite() {
                keep(&mut largest_finite);
            }
        }
        let told = |(index, size): (usize, f32)| Difference {
            x: index % actual.width,
            y: index / actual.width,
            actual: actual.pixels[index].to_array(),
            expected: expected.pixels[index].to_array(),
            difference: Some(size).filter(|size| size.is_finite()),
        };
        Self {
            pixels: actual.pixels.len(),
            differing,
            largest: largest.map(told),
            largest_finite: largest_finite.map(told),
            metrics: None,
        }
    }
}

/// The largest difference of a channel, infinite where only one value is finite or both are infinite
/// apart; none when all are equal. NaN equals NaN, unless `nan_is_error`.
fn difference(a: Vec3, b: Vec3, nan_is_error: bool) -> Option<f32> {
    let channels = a.to_array().into_iter().zip(b.to_array());
    let differ =
        channels.filter(|(a, b)| if a.is_nan() && b.is_nan() { nan_is_error } else { a != b });
    let size = |(a, b): (f32, f32)| {
        let size = (a - b).abs();
        if size.is_nan() { f32::INFINITY } else { size }
    };
    differ.map(size).max_by(f32::total_cmp)
}

fn text(comparison: &Comparison) -> anyhow::Result<String> {
    use std::fmt::Write;
    let mut out = String::new();
    for (name, side) in [("actual", &comparison.actual), ("expected", &comparison.expected)] {
        if !side.layer.is_empty() {
            writeln!(out, "{name}: layer {}", side.layer)?;
        }
        for note in &side.notes {
            writeln!(out, "{name}: {note}")?;
        }
        for (pixels, what) in [(&side.not_finite, "not finite"), (&side.negative, "negative")] {
            if let Some(Pixels { count, first: [x, y] }) = pixels {
                let are = if *count == 1 { "pixel is" } else { "pixels are" };
                writeln!(out, "{name}: {count} {are} {what}; first at ({x}, {y})")?;
            }
        }
    }
    for note in &comparison.notes {
        writeln!(out, "{note}")?;
    }
    let Some(values) = &comparison.values else {
        let [a, b] =
            [&comparison.actual, &comparison.expected].map(|side| (side.width, side.height));
        writeln!(out, "actual is {}x{} but expected is {}x{}", a.0, a.1, b.0, b.1)?;
        if let Some(page) = &comparison.page {
            writeln!(out, "{}", page.display())?;
        }
        return Ok(out);
    };
    writeln!(out, "{} of {} pixels differ", values.differing, values.pixels)?;
    let mut tell = |what: &str, found: &Difference| {
        let (a, b) = (Vec3::from(found.actual), Vec3::from(found.expected));
        let by = found.difference.map_or(String::new(), |size| format!(", difference {size}"));
        writeln!(out, "{what} at ({}, {}): actual {a}, expected {b}{by}", found.x, found.y)
    };
    if let Some(largest) = &values.largest {
        tell("largest", largest)?;
    }
    match (&values.largest, &values.largest_finite) {
        (Some(Difference { difference: None, .. }), Some(finite)) => {
            tell("largest finite difference", finite)?;
        }
        (Some(Difference { difference: None, .. }), None) => {
            writeln!(out, "no pixel with finite values differs")?;
        }
        _ => {}
    }
    if let Some(metrics) = &values.metrics {
        writeln!(out, "{}", serde_json::to_string_pretty(metrics)?)?;
    }
    for (file, caption) in &comparison.pictures {
        writeln!(out, "{}: {caption}", file.display())?;
    }
    if let Some(page) = &comparison.page {
        writeln!(out, "{}", page.display())?;
    }
    Ok(out)
}

/// Writes the pictures and answers their files and captions.
fn pictures(folder: &Path, comparison: &Comparison) -> anyhow::Result<BTreeMap<PathBuf, String>> {
    std::fs::create_dir_all(folder)?;
    let (actual, expected) = (&comparison.actual.image, &comparison.expected.image);
    let scale = median(expected);
    let mask = RegionMask::background(actual.width, actual.height);
    let mut written = BTreeMap::new();
    for (name, picture) in [
        ("actual", Some(tone_mapped(actual, scale))),
        ("expected", Some(tone_mapped(expected, scale))),
        ("difference", signed_error(actual, expected, &mask, scale, FULL_SCALE)),
    ] {
        let Some(picture) = picture else { continue };
        let file = folder.join(format!("{name}.png"));
        std::fs::write(&file, picture.png()?)?;
        written.insert(file, picture.caption);
    }
    Ok(written)
}

/// The median of what is not black, for exposure.
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

/// Values in JSON; those that are not finite become text.
fn any_float<S: serde::Serializer>(values: &[f32; 3], serializer: S) -> Result<S::Ok, S::Error> {
    let value = |v: f32| match v.is_finite() {
        true => serde_json::Value::from(v),
        false => serde_json::Value::from(v.to_string()),
    };
    values.map(value).serialize(serializer)
}
