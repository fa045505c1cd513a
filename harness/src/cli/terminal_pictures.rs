//! Pictures in terminals that can show them: `umbra check --pictures`.
//!
//! Three ways are in use. kitty and iTerm2 take a PNG as it is; a sixel terminal takes colors from a palette. The crate
//! viuer supports all of them but depends on an LGPL crate. The newest icy_sixel adds twenty crates for a color
//! quantizer.

use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use image::imageops::{FilterType, overlay, resize};
use image::{ImageFormat, Rgb, RgbImage};

use crate::evidence::{Check, Verdict};
use crate::report::{SubmissionReport, harmless};
use crate::rubric::{PartGrade, Rules};

/// How a terminal is given a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Protocol {
    Kitty,
    Iterm,
    Sixel,
}

/// Columns of pixels of one picture in a row of three.
const WIDTH: u32 = 288;
/// Pixels between two.
const GAP: u32 = 8;
/// Bytes of one command, as kitty wants it.
const CHUNK: usize = 4096;

/// The pictures of what was lost, for standard output; or why there are none. `folder` is the report's of the
/// submission.
pub fn pictures(entry: &SubmissionReport, rules: &Rules, folder: &Path) -> String {
    let env = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    let protocol = protocol_of(env).filter(|_| std::io::stdout().is_terminal());
    let Some(protocol) = protocol else {
        return "no pictures: this is no terminal that is known to show them (kitty, Ghostty, WezTerm, iTerm2, foot, \
                mlterm, Konsole, Windows Terminal)\n"
            .to_owned();
    };
    let mut out = String::new();
    for (part, check) in pictured(entry, rules) {
        let files = check.pictures.iter().map(|picture| folder.join(&picture.file));
        // What cannot be read is on the page.
        let found: Vec<RgbImage> =
            files.filter_map(|file| Some(image::open(file).ok()?.to_rgb8())).collect();
        if found.is_empty() {
            continue;
        }
        let titles: Vec<&str> = check
            .pictures
            .iter()
            .map(|picture| picture.title.split(" (").next().unwrap_or_default())
            .collect();
        let line = format!("{} on {}: {}", part.id, check.scene, titles.join(", "));
        let _ = writeln!(out, "{}", harmless(&line));
        out += &shown(&row(&found), protocol);
        out.push('\n');
    }
    out
}

/// Of each part that lost points the worst check with pictures, each check once.
fn pictured<'a>(entry: &'a SubmissionReport, rules: &Rules) -> Vec<(&'a PartGrade, &'a Check)> {
    let failed = |check: &&Check| {
        matches!(check.verdict, Verdict::Fail | Verdict::NotImplemented)
            && !check.pictures.is_empty()
            && !check.held_back
    };
    let failed: Vec<&Check> = entry.record.evidence.checks.iter().filter(failed).collect();
    let mut found: Vec<(&PartGrade, &Check)> = Vec::new();
    for part in entry.grade.parts.iter().filter(|part| part.points < part.out_of) {
        let Some(rule) = rules.parts.iter().find(|rule| rule.id == part.id) else { continue };
        let worst = |about: &dyn Fn(&Check) -> bool| {
            let own = failed.iter().copied().filter(|check| about(check));
            own.max_by(|a, b| a.error.total_cmp(&b.error))
        };
        let proof = rules.paths.get(&rule.path).map(|path| path.proof);
        let check = worst(&|check| rule.evidence.contains(&check.id))
            .or_else(|| worst(&|check| Some(check.id) == proof));
        if let Some(check) = check
            && !found.iter().any(|(_, shown)| std::ptr::eq(*shown, check))
        {
            found.push((part, check));
        }
    }
    found
}

/// How the terminal that the environment tells of takes pictures. A multiplexer passes none on.
fn protocol_of(env: impl Fn(&str) -> Option<String>) -> Option<Protocol> {
    let term = env("TERM").unwrap_or_default();
    let program = env("TERM_PROGRAM").unwrap_or_default();
    let is = |names: &[&str]| names.iter().any(|name| term.starts_with(name) || program == *name);
    if is(&["screen", "tmux", "dumb"]) || env("TMUX").is_some() {
        None
    } else if is(&["xterm-kitty", "xterm-ghostty", "ghostty"]) || env("KITTY_WINDOW_ID").is_some() {
        Some(Protocol::Kitty)
    } else if is(&["WezTerm", "iTerm.app"]) {
        Some(Protocol::Iterm)
    } else if is(&["foot", "mlterm", "yaft", "contour"])
        || term.contains("sixel")
        || ["KONSOLE_VERSION", "WT_SESSION"].iter().any(|name| env(name).is_some())
    {
        Some(Protocol::Sixel)
    } else {
        None
    }
}

/// Pictures side by side, as wide as each other. Small ones are enlarged by whole pixels.
fn row(pictures: &[RgbImage]) -> RgbImage {
    let scaled: Vec<RgbImage> = pictures
        .iter()
        .map(|picture| {
            let (width, height) = picture.dimensions();
            let filter = if width <= WIDTH { FilterType::Nearest } else { FilterType::Triangle };
            resize(picture, WIDTH, (height * WIDTH / width.max(1)).clamp(1, 4 * WIDTH), filter)
        })
        .collect();
    let height = scaled.iter().map(RgbImage::height).max().unwrap_or(1);
    let count = scaled.len() as u32;
    let mut row = RgbImage::from_pixel(count * (WIDTH + GAP) - GAP, height, Rgb([127; 3]));
    for (index, picture) in scaled.iter().enumerate() {
        overlay(&mut row, picture, index as i64 * i64::from(WIDTH + GAP), 0);
    }
    row
}

/// A picture as a terminal takes it; none when it cannot be encoded.
fn shown(picture: &RgbImage, protocol: Protocol) -> String {
    if protocol == Protocol::Sixel {
        return sixel(picture);
    }
    let mut png = Vec::new();
    if picture.write_to(&mut std::io::Cursor::new(&mut png), ImageFormat::Png).is_err() {
        return String::new();
    }
    let text = STANDARD.encode(&png);
    if protocol == Protocol::Iterm {
        let size = png.len();
        return format!(
            "\x1b]1337;File=inline=1;size={size};width={}px:{text}\x07",
            picture.width()
        );
    }
    let chunks: Vec<&[u8]> = text.as_bytes().chunks(CHUNK).collect();
    let mut out = String::new();
    for (index, chunk) in chunks.iter().enumerate() {
        let what = if index == 0 { "f=100,a=T," } else { "" };
        let more = u8::from(index + 1 < chunks.len());
        let _ = write!(out, "\x1b_G{what}m={more};{}\x1b\\", String::from_utf8_lossy(chunk));
    }
    out
}

/// Levels of each channel in the palette of a sixel picture.
const LEVELS: usize = 6;
/// Thresholds of ordered dithering, in sixteenths (Bayer 1973).
const BAYER: [[u8; 4]; 4] = [[0, 8, 2, 10], [12, 4, 14, 6], [3, 11, 1, 9], [15, 7, 13, 5]];

/// The index in the palette of a pixel.
fn palette_index(picture: &RgbImage, x: u32, y: u32) -> usize {
    let threshold = (f32::from(BAYER[(y % 4) as usize][(x % 4) as usize]) + 0.5) / 16.0;
    let channels = picture.get_pixel(x, y).0;
    channels.iter().fold(0, |index, &value| {
        let level = f32::from(value) / 255.0 * (LEVELS - 1) as f32;
        index * LEVELS + ((level + threshold).floor() as usize).min(LEVELS - 1)
    })
}

/// A picture in bands of six rows; in each, a line for each color that says in which of them it is.
fn sixel(picture: &RgbImage) -> String {
    let (width, height) = picture.dimensions();
    let mut out = format!("\x1bPq\"1;1;{width};{height}");
    for index in 0..LEVELS.pow(3) {
        let percent = |channel: usize| channel % LEVELS * 100 / (LEVELS - 1);
        let [r, g, b] = [index / LEVELS / LEVELS, index / LEVELS, index].map(percent);
        let _ = write!(out, "#{index};2;{r};{g};{b}");
    }
    for top in (0..height).step_by(6) {
        let mut lines = vec![Vec::new(); LEVELS.pow(3)];
        for x in 0..width {
            for y in top..(top + 6).min(height) {
                let line = &mut lines[palette_index(picture, x, y)];
                line.resize(width as usize, 0_u8);
                line[x as usize] |= 1 << (y - top);
            }
        }
        for (index, line) in lines.iter().enumerate().filter(|(_, line)| !line.is_empty()) {
            let _ = write!(out, "#{index}");
            for run in line.chunk_by(|a, b| a == b) {
                let _ = write!(out, "!{}{}", run.len(), char::from(b'?' + run[0]));
            }
            out.push('$');
        }
        out.push('-');
    }
    out + "\x1b\\"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::sample;

    #[test]
    fn a_terminal_is_known_by_what_it_says_of_itself() {
        for (said, protocol) in [
            (vec![("TERM", "xterm-kitty")], Some(Protocol::Kitty)),
            (vec![("TERM", "xterm-256color"), ("KITTY_WINDOW_ID", "1")], Some(Protocol::Kitty)),
            (vec![("TERM", "xterm-256color"), ("TERM_PROGRAM", "WezTerm")], Some(Protocol::Iterm)),
            (vec![("TERM", "foot")], Some(Protocol::Sixel)),
            (
                vec![("TERM", "xterm-256color"), ("KONSOLE_VERSION", "230800")],
                Some(Protocol::Sixel),
            ),
            (vec![("TERM", "xterm-256color")], None),
            (vec![("TERM", "tmux-256color"), ("KITTY_WINDOW_ID", "1")], None),
            (vec![("TERM", "xterm-kitty"), ("TMUX", "/tmp/x")], None),
            (vec![], None),
        ] {
            let env = |name: &str| {
                said.iter().find(|(own, _)| *own == name).map(|(_, value)| (*value).to_owned())
            };
            assert_eq!(protocol_of(env), protocol, "{said:?}");
        }
    }

    /// Colors of the palette alone, so that nothing is dithered.
    fn picture() -> RgbImage {
        RgbImage::from_fn(7, 9, |x, y| Rgb([51 * (x % 6) as u8, 51 * (y % 6) as u8, 255]))
    }

    #[test]
    fn kitty_and_iterm_get_the_png() {
        let noise =
            RgbImage::from_fn(90, 90, |x, y| Rgb([(x * 97 + y * 31) as u8, (x * y) as u8, 7]));
        let kitty = shown(&noise, Protocol::Kitty);
        let commands: Vec<&str> =
            kitty.split("\x1b\\").filter(|command| !command.is_empty()).collect();
        assert!(commands.len() > 1, "in parts");
        let mut text = String::new();
        for (index, command) in commands.iter().enumerate() {
            let (keys, data) = command.strip_prefix("\x1b_G").unwrap().split_once(';').unwrap();
            assert!(data.len() <= CHUNK);
            assert_eq!(keys.contains("a=T"), index == 0);
            assert_eq!(keys.ends_with("m=0"), index + 1 == commands.len());
            text += data;
        }
        let png = |text: &str| {
            image::load_from_memory(&STANDARD.decode(text).unwrap()).unwrap().to_rgb8()
        };
        assert_eq!(png(&text), noise);
        let iterm = shown(&picture(), Protocol::Iterm);
        let text = iterm.split_once(':').unwrap().1.strip_suffix('\x07').unwrap();
        assert_eq!(png(text), picture());
    }

    /// What a terminal makes of a sixel picture.
    fn drawn(text: &str, width: u32, height: u32) -> RgbImage {
        let body = text.strip_prefix("\x1bPq").unwrap().strip_suffix("\x1b\\").unwrap();
        let mut image = RgbImage::from_pixel(width, height, Rgb([1, 2, 3]));
        let (mut palette, mut color, mut x, mut top) = (vec![Rgb([0; 3]); 256], 0, 0, 0);
        let mut rest = body.chars().peekable();
        let numbers = |rest: &mut std::iter::Peekable<std::str::Chars>| -> Vec<u32> {
            let mut text = String::new();
            while let Some(c) = rest.next_if(|c| c.is_ascii_digit() || *c == ';') {
                text.push(c);
            }
            text.split(';').map(|number| number.parse().unwrap()).collect()
        };
        while let Some(c) = rest.next() {
            match c {
                '"' => assert_eq!(numbers(&mut rest), [1, 1, width, height]),
                '#' => match numbers(&mut rest)[..] {
                    [index] => color = index as usize,
                    [index, 2, r, g, b] => {
                        palette[index as usize] = Rgb([r, g, b].map(|p| (p * 255 / 100) as u8));
                    }
                    _ => panic!("a color"),
                },
                '!' => {
                    let count = numbers(&mut rest)[0];
                    let bits = rest.next().unwrap() as u32 - u32::from(b'?');
                    for _ in 0..count {
                        for bit in (0..6).filter(|bit| bits >> bit & 1 == 1) {
                            image.put_pixel(x, top + bit, palette[color]);
                        }
                        x += 1;
                    }
                }
                '$' => x = 0,
                '-' => (x, top) = (0, top + 6),
                other => panic!("{other:?}"),
            }
        }
        image
    }

    #[test]
    fn a_sixel_terminal_draws_every_pixel() {
        let (width, height) = picture().dimensions();
        assert_eq!(drawn(&sixel(&picture()), width, height), picture());
        // Gray between two levels is so on the mean.
        let gray = RgbImage::from_pixel(64, 64, Rgb([70; 3]));
        let drawn = drawn(&sixel(&gray), 64, 64);
        let mean = drawn.pixels().map(|pixel| f64::from(pixel.0[1])).sum::<f64>() / 4096.0;
        assert!((mean - 70.0).abs() < 3.0, "{mean}");
    }

    #[test]
    fn each_lost_part_has_its_worst_picture_once() {
        let mut report = sample::report();
        for entry in &report.entries {
            assert!(pictured(entry, &report.rules).is_empty(), "of held-back scenes");
        }
        for entry in &mut report.entries {
            entry.record.evidence.checks.iter_mut().for_each(|check| check.held_back = false);
            let worse = entry.record.evidence.checks.iter().filter(|check| check.error > 0.0);
            let worse =
                worse.map(|check| Check { error: 0.9, scene: "worse".into(), ..check.clone() });
            let worse: Vec<Check> = worse.collect();
            entry.record.evidence.checks.extend(worse);
        }
        let found: Vec<(&str, &str)> = report
            .entries
            .iter()
            .flat_map(|entry| pictured(entry, &report.rules))
            .map(|(part, check)| (&*part.id, &*check.scene))
            .collect();
        assert_eq!(found, [("1.3", "worse")]);
    }
}
