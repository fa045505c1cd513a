//! `umbra compare --idiff`: the options, the words and the exit codes of OpenImageIO's `idiff`, for
//! scripts that call it.
//!
//! It follows what idiff 2.4 does, with these exceptions, all towards "different":
//! - A pixel where only one image has NaN or infinity, or both have infinity of opposite signs, is
//!   over every threshold. idiff lets it pass.
//! - Channels are compared by name. idiff compares them by place, whatever they are called.
//! - A difference image is not written over an image that is compared.
//! - Images of two sizes end with 3, as its documentation says, and images at two places fail. idiff
//!   compares them with black.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use basecode::exr_io::{ExrRows, write_exr_channels};

use crate::cli::outputs::ensure_not_read;
use crate::harmless::harmless;
use crate::imaging::rows::{Channels, Row, visit_rows};
use crate::imaging::thresholds::{Tally, Thresholds};

/// The images match within all thresholds.
const MATCH: u8 = 0;
/// They differ by more than the warning threshold.
const WARNING: u8 = 1;
/// They differ by more than the failure threshold.
const FAILURE: u8 = 2;
/// They are not of one size.
const OTHER_SIZE: u8 = 3;
/// A file, the command line or standard output cannot be used.
pub(super) const CANNOT: u8 = 4;

const HELP: &str = "\
Usage: umbra compare --idiff [options] image1 image2

As OpenImageIO's idiff, for EXR images (without -p, which is perceptual):
    -v, -q                     Say more; say only FAILURE, on standard error
    -fail VAL                  Failure threshold of |a - b| (default: 1e-06)
    -failrelative VAL          The same, as a fraction of the mean of |a| and |b| (default: 0)
    -failpercent PERCENT       Allow so many pixels above both (default: 0)
    -hardfail VAL              Fail if any pixel is above (default: inf)
    -allowfailures N           Match if at most so many pixels fail, whatever else is asked (default: 0)
    -warn, -warnrelative, -warnpercent, -hardwarn
                               The same for a warning, if more pixels fail than -allowfailures has
    -o FILENAME                Write the difference image, an EXR file
    -od                        ... only if there is a difference
    -abs, -scale FACTOR        ... of absolute values; multiplied
    -a                         Compare all parts: files have one
Exit codes: 0 match, 1 warning, 2 failure, 3 other size, 4 a file cannot be used or written.
";

/// The command line.
#[derive(Debug)]
struct Options {
    images: Vec<PathBuf>,
    verbose: bool,
    quiet: bool,
    all: bool,
    fail: Thresholds,
    warn: Thresholds,
    /// With at most so many failing pixels, nothing else counts.
    allowed: usize,
    output: Option<PathBuf>,
    only_different: bool,
    absolute: bool,
    scale: f32,
    help: bool,
}

/// Compares as idiff does and answers its exit code.
pub(super) fn run(arguments: &[OsString]) -> u8 {
    match Options::parse(arguments).and_then(|options| compare(&options)) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("umbra: {error}");
            CANNOT
        }
    }
}

impl Options {
    fn parse(arguments: &[OsString]) -> anyhow::Result<Self> {
        let limits =
            Thresholds { absolute: 1e-6, relative: 0.0, percent: 0.0, hard: f32::INFINITY };
        let mut options = Self {
            images: Vec::new(),
            verbose: false,
            quiet: false,
            all: false,
            fail: limits,
            warn: limits,
            allowed: 0,
            output: None,
            only_different: false,
            absolute: false,
            scale: 1.0,
            help: false,
        };
        let mut rest = arguments.iter();
        while let Some(argument) = rest.next() {
            let text = argument.to_string_lossy();
            let Some(name) = text.strip_prefix('-').filter(|name| !name.is_empty()) else {
                options.images.push(argument.into());
                continue;
            };
            // idiff takes one dash or two.
            let name = name.strip_prefix('-').unwrap_or(name);
            let mut value = || rest.next().with_context(|| format!("-{name} has no value"));
            let mut number = || -> anyhow::Result<f32> {
                let value = value()?.to_string_lossy().into_owned();
                let number = value.parse().ok().or_else(|| hexadecimal(&value));
                let number = number.filter(|number: &f32| !number.is_nan());
                number.with_context(|| format!("-{name} has \"{value}\", expected a number"))
            };
            match name {
                "help" => options.help = true,
                "v" => options.verbose = true,
                "q" => options.quiet = true,
                "a" => options.all = true,
                "fail" => options.fail.absolute = number()?,
                "failrelative" => options.fail.relative = number()?,
                "failpercent" => options.fail.percent = number()?,
                "hardfail" => options.fail.hard = number()?,
                "warn" => options.warn.absolute = number()?,
                "warnrelative" => options.warn.relative = number()?,
                "warnpercent" => options.warn.percent = number()?,
                "hardwarn" => options.warn.hard = number()?,
                // A number below 0 is a very large one to idiff.
                "allowfailures" => {
                    let count = number()?;
                    if count.fract() != 0.0 {
                        bail!("-{name} has \"{count}\", expected a whole number");
                    }
                    options.allowed = usize::try_from(count as i64).unwrap_or(usize::MAX);
                }
                "o" => options.output = Some(value()?.into()),
                "od" => options.only_different = true,
                "abs" => options.absolute = true,
                "scale" => options.scale = number()?,
                "p" => bail!("-p is not known here; hint: umbra compare --metrics measures FLIP"),
                _ => bail!("unknown option -{name}\n{HELP}"),
            }
        }
        if options.images.len() != 2 && !options.help {
            bail!("expected two images, found {}\n{HELP}", options.images.len());
        }
        let output = options.output.as_deref();
        let is_exr =
            |path: &Path| path.extension().is_some_and(|end| end.eq_ignore_ascii_case("exr"));
        if let Some(path) = output.filter(|path| !is_exr(path)) {
            bail!("{}: the difference image can only be an EXR file", path.display());
        }
        Ok(options)
    }
}

fn compare(options: &Options) -> anyhow::Result<u8> {
    if options.help {
        print!("{HELP}");
        return Ok(MATCH);
    }
    let [a, b] = [&options.images[0], &options.images[1]];
    if let Some(output) = &options.output {
        ensure_not_read(output, [a.as_path(), b])?;
    }
    if !options.quiet {
        println!("Comparing \"{}\" and \"{}\"", a.display(), b.display());
    }
    let [a, b] = [ExrRows::open(a)?, ExrRows::open(b)?];
    let different = |code: u8, why: String| {
        if options.quiet {
            eprintln!("FAILURE");
        } else {
            println!("{why}\nFAILURE");
        }
        Ok(code)
    };
    if (a.width(), a.height()) != (b.width(), b.height()) {
        let [a, b] = [&a, &b].map(|image| format!("{}x{}", image.width(), image.height()));
        return different(OTHER_SIZE, format!("  sizes differ: {a} vs {b}"));
    }
    if a.origin() != b.origin() {
        let [a, b] = [&a, &b].map(|image| image.origin()).map(|[x, y]| format!("({x}, {y})"));
        return different(FAILURE, format!("  places differ: {a} vs {b}"));
    }
    let [named_a, named_b] = [&a, &b].map(in_idiff_order);
    let names = |named: &[(String, usize)]| -> Vec<String> {
        named.iter().map(|(name, _)| name.clone()).collect()
    };
    let (names, names_b) = (names(&named_a), names(&named_b));
    if names != names_b {
        let [names, names_b] = [names, names_b].map(|names| harmless(&names.join(", ")));
        return different(FAILURE, format!("  channels differ: {names} vs {names_b}"));
    }
    let indices = [named_a, named_b].map(|named| named.iter().map(|(_, i)| *i).collect::<Vec<_>>());
    let images = [
        Channels { file: &a, channels: &indices[0] },
        Channels { file: &b, channels: &indices[1] },
    ];
    let visit = |tally: &mut Tally, row: Row| {
        for channel in 0..names.len() {
            tally.add(&row, channel, &options.fail, &options.warn);
        }
        tally.end_row();
    };
    let mut tally = Tally::default();
    for band in visit_rows(&images, visit)? {
        tally.append(&band);
    }
    let pixels = a.width() * a.height();
    let code = verdict(options, &tally, pixels);
    if options.verbose || (code != MATCH && !options.quiet) {
        let values = tally.largest.map(|largest| values(&images, largest.at)).transpose()?;
        if options.all {
            println!("{} x {}, {} channels", a.width(), a.height(), names.len());
        }
        report(options, &tally, (a.origin(), pixels), &names, values);
    }
    if let Some(path) = &options.output
        && (tally.largest.is_some() || !options.only_different)
    {
        write_difference(path, &images, &names, options)?;
    }
    match (code, options.quiet) {
        (MATCH, false) => println!("PASS"),
        (WARNING, false) => println!("WARNING"),
        (FAILURE, false) => println!("FAILURE"),
        (FAILURE, true) => eprintln!("FAILURE"),
        _ => {}
    }
    Ok(code)
}

/// Which exit code the differences have. As to idiff, nothing but `-fail` and `-failrelative` counts
/// unless more than the allowed pixels are above both.
fn verdict(options: &Options, tally: &Tally, pixels: usize) -> u8 {
    let Options { fail, warn, .. } = options;
    let largest = tally.largest.map_or(0.0, |largest| largest.size);
    let above = |limits: &Thresholds, count: usize| {
        count as f64 > f64::from(limits.percent) / 100.0 * pixels as f64 || largest > limits.hard
    };
    if tally.failing <= options.allowed {
        MATCH
    } else if above(fail, tally.failing) {
        FAILURE
    } else if above(warn, tally.warned) {
        WARNING
    } else {
        MATCH
    }
}

fn report(
    options: &Options,
    tally: &Tally,
    (origin, pixels): ([i32; 2], usize),
    names: &[String],
    values: Option<[Vec<f32>; 2]>,
) {
    let count = (pixels * names.len()) as f64;
    let rms = (tally.squared / count).sqrt();
    println!("  Mean error = {}", general(tally.absolute / count, 6));
    println!("  RMS error = {}", general(rms, 6));
    println!("  Peak SNR = {}", general(20.0 * (f64::from(tally.peak) / rms).log10(), 6));
    match (tally.largest, values) {
        (Some(largest), Some(values)) => {
            let [x, y] = [0, 1].map(|axis| i64::from(origin[axis]) + largest.at[axis] as i64);
            let [a, b] = values.map(|values| {
                values.iter().map(|value| shortest(*value)).collect::<Vec<_>>().join(", ")
            });
            println!(
                "  Max error  = {} @ ({x}, {y}, {})  values are {a} vs {b}",
                general(f64::from(largest.size), 6),
                harmless(&names[largest.channel])
            );
        }
        _ => println!("  Max error  = 0"),
    }
    for (count, limits) in [(tally.warned, &options.warn), (tally.failing, &options.fail)] {
        let percent = general(100.0 * count as f64 / pixels as f64, 3);
        println!("  {count} pixels ({percent}%) over {}", general(limits.absolute.into(), 6));
    }
    if tally.not_finite > 0 {
        println!(
            "  {} pixels have NaN or infinity in one image only, or infinities of two signs",
            tally.not_finite
        );
    }
}

/// The values of a pixel in both images.
fn values(images: &[Channels; 2], [x, y]: [usize; 2]) -> anyhow::Result<[Vec<f32>; 2]> {
    let mut found = [Vec::new(), Vec::new()];
    for (image, values) in images.iter().zip(&mut found) {
        let mut band = basecode::exr_io::Band::default();
        image.file.read(y..y + 1, image.channels, &mut band)?;
        values.extend((0..image.channels.len()).map(|channel| band.row(channel, 0)[x]));
    }
    Ok(found)
}

fn write_difference(
    path: &Path,
    images: &[Channels; 2],
    names: &[String],
    options: &Options,
) -> anyhow::Result<()> {
    let visit = |planes: &mut Vec<Vec<f32>>, row: Row| {
        planes.resize(names.len(), Vec::new());
        for (channel, plane) in planes.iter_mut().enumerate() {
            let pairs = row.values(0, channel).iter().zip(row.values(1, channel));
            let difference = pairs.map(|(a, b)| a - b);
            let shown = difference.map(|d| if options.absolute { d.abs() } else { d });
            plane.extend(shown.map(|d| d * options.scale));
        }
    };
    let mut planes: Vec<Vec<f32>> = vec![Vec::new(); names.len()];
    for band in visit_rows(images, visit)? {
        for (plane, part) in planes.iter_mut().zip(band) {
            plane.extend(part);
        }
    }
    let channels: Vec<_> = names.iter().map(String::as_str).zip(planes).collect();
    let file = images[0].file;
    Ok(write_exr_channels(path, file.origin(), file.width(), &channels)?)
}

/// The channels of a file and their indices, as idiff orders them: layer by layer, R, G, B and A first.
fn in_idiff_order(file: &ExrRows) -> Vec<(String, usize)> {
    let mut named: Vec<(String, usize)> =
        file.channels().into_iter().enumerate().map(|(index, name)| (name, index)).collect();
    named.sort_by_cached_key(|(name, _)| {
        let (layer, component) = name.rsplit_once('.').unwrap_or(("", name));
        let place = ["R", "G", "B", "A"].iter().position(|own| *own == component);
        (layer.to_owned(), place.unwrap_or(4), component.to_owned())
    });
    named
}

/// A number as C's `%a` writes it: `0x1.8p-3`.
fn hexadecimal(text: &str) -> Option<f32> {
    let lower = text.to_ascii_lowercase();
    let (sign, digits) = match lower.strip_prefix('-') {
        Some(rest) => (-1.0, rest),
        None => (1.0, lower.strip_prefix('+').unwrap_or(&lower)),
    };
    let digits = digits.strip_prefix("0x")?;
    let (mantissa, exponent) = digits.split_once('p').unwrap_or((digits, "0"));
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let all = [whole, fraction].concat();
    // More digits than 64 bits hold make no other number of 24.
    let value = u64::from_str_radix(&all, 16).ok().filter(|_| !all.starts_with('+'))? as f64;
    let exponent = exponent.parse::<i32>().ok()? - 4 * i32::try_from(fraction.len()).ok()?;
    Some((sign * value * f64::from(exponent).exp2()) as f32)
}

/// A number with so many significant digits, as C's `%g` writes it.
fn general(value: f64, digits: usize) -> String {
    if !value.is_finite() {
        return value.to_string().to_lowercase();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let scientific = format!("{value:.*e}", digits - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or_default();
    let trimmed = |text: &str| match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text.to_owned(),
    };
    if exponent < -4 || exponent >= digits as i32 {
        return with_exponent(trimmed(mantissa), exponent);
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    trimmed(&format!("{value:.decimals$}"))
}

/// A number with as few digits as tell it from others, as C++'s `{fmt}` writes it.
fn shortest(value: f32) -> String {
    let scientific = format!("{value:e}");
    let parts = scientific.split_once('e');
    let parts = parts.and_then(|(mantissa, exponent)| Some((mantissa, exponent.parse().ok()?)));
    match parts {
        Some((mantissa, exponent)) if !(-4..16).contains(&exponent) => {
            with_exponent(mantissa.to_owned(), exponent)
        }
        _ => value.to_string().to_lowercase(),
    }
}

/// `1.5e-07`, as C writes it.
fn with_exponent(mantissa: String, exponent: i32) -> String {
    let sign = if exponent < 0 { '-' } else { '+' };
    format!("{mantissa}e{sign}{:02}", exponent.abs())
}

#[cfg(test)]
mod tests {
    use super::{general, hexadecimal, shortest};

    #[test]
    fn values_are_written_as_idiff_writes_them() {
        // The first four by idiff of OpenImageIO 2.4.
        for (value, text) in [
            (4.326_4e-41, "4.3264e-41"),
            (2.999_373_5e38, "2.9993735e+38"),
            (1e-8, "1e-08"),
            (9.604_056e-5, "9.604056e-05"),
            (1e-4, "0.0001"),
            (0.5, "0.5"),
            (-1.0, "-1"),
            (0.0, "0"),
            (1e15, "1000000000000000"),
            (1e16, "1e+16"),
            (f32::INFINITY, "inf"),
            (f32::NAN, "nan"),
        ] {
            assert_eq!(shortest(value), text);
        }
    }

    #[test]
    fn hexadecimal_numbers_are_read_as_c_reads_them() {
        for (text, value) in
            [("0x1p-3", 0.125), ("-0x1.8P1", -3.0), ("0xff", 255.0), ("+0x.8p0", 0.5)]
        {
            assert_eq!(hexadecimal(text), Some(value), "{text}");
        }
        for text in ["", "0x", "1p3", "0xg", "0x+1", "0x1p", "0x1pz", "0x1.2.3"] {
            assert_eq!(hexadecimal(text), None, "{text}");
        }
    }

    #[test]
    fn numbers_are_written_as_c_writes_them() {
        for (value, digits, text) in [
            (0.0, 6, "0"),
            (1e-6, 6, "1e-06"),
            (0.333_333_333, 6, "0.333333"),
            (26.848_454, 6, "26.8485"),
            (843_621_000.0, 6, "8.43621e+08"),
            (100.0, 3, "100"),
            (82.14, 3, "82.1"),
            (999_999.7, 6, "1e+06"),
            (0.000_123_45, 6, "0.00012345"),
            (f64::INFINITY, 6, "inf"),
            (f64::NAN, 6, "nan"),
        ] {
            assert_eq!(general(value, digits), text);
        }
    }
}
