//! Metrics against published implementations. The numbers come from `golden/metrics.txt`, which `golden/metrics.py`
//! printed; both make the same small images by whole-number arithmetic.

use std::collections::HashMap;
use std::time::Instant;

use basecode::image::Image;
use glam::{Vec3, vec3};
use umbra::imaging::flip::{PIXELS_PER_DEGREE, flip_hdr, flip_ldr};
use umbra::imaging::metrics::{Metrics, mae, mse, psnr_db, rel_mse, ssim};
use umbra::imaging::srgb;

fn image(width: usize, height: usize, value: impl Fn(i64, i64, i64) -> f64) -> Image {
    let mut image = Image::new(width, height);
    for (i, p) in image.pixels.iter_mut().enumerate() {
        let (x, y) = ((i % width) as i64, (i / width) as i64);
        *p = vec3(value(x, y, 0) as f32, value(x, y, 1) as f32, value(x, y, 2) as f32);
    }
    image
}

fn base(x: i64, y: i64, c: i64) -> f64 {
    (x * (3 + c) + y * (5 - c)).rem_euclid(32) as f64 / 40.0 + ((x / 8 + y / 8) % 2) as f64 * 0.15
}

/// (actual, expected) with values in [0, 1].
fn ldr(width: usize, height: usize) -> (Image, Image) {
    let actual = |x: i64, y: i64, c: i64| {
        (base(x, y, c) * 0.93 + ((x * x + 7 * y + 11 * c) % 13) as f64 / 130.0).clamp(0.0, 1.0)
    };
    (image(width, height, actual), image(width, height, base))
}

/// (actual, expected) with values up to 32.
fn hdr(width: usize, height: usize) -> (Image, Image) {
    let expected = |x: i64, y: i64, c: i64| {
        let r = f64::from(base(x, y, c) as f32);
        let spot = 30.0 / (1.0 + ((x - 20).pow(2) + (y - 15).pow(2)) as f64 / 4.0);
        0.02 + 2.0 * r * r + spot
    };
    let actual = |x: i64, y: i64, c: i64| {
        expected(x, y, c) * if x > 40 { 1.1 } else { 0.97 } + ((x * y) % 7) as f64 / 70.0
    };
    (image(width, height, actual), image(width, height, expected))
}

/// The same image, its values taken as sRGB-encoded.
fn linear(encoded: &Image) -> Image {
    let mut image = encoded.clone();
    for p in &mut image.pixels {
        *p = p.map(|v| srgb::decode(f64::from(v)) as f32);
    }
    image
}

fn golden() -> HashMap<(String, String), f64> {
    let mut section = String::new();
    let mut found = HashMap::new();
    for line in include_str!("golden/metrics.txt").lines() {
        if let Some(name) = line.strip_prefix('[') {
            section = name.trim_end_matches(']').into();
        } else if let Some((key, value)) = line.split_once(" = ") {
            found.insert((section.clone(), key.into()), value.parse().unwrap());
        }
    }
    found
}

/// MAE to SSIM agree to nine digits but for f32 inputs; FLIP, which the published tool computes in f32, to 1e-5.
#[test]
fn agrees_with_published_implementations() {
    let golden = golden();
    for (width, height) in [(61, 47), (60, 46)] {
        for (kind, (actual, expected)) in [("ldr", ldr(width, height)), ("hdr", hdr(width, height))]
        {
            let section = format!("{kind} {width}x{height}");
            let check = |key: &str, found: f64, relative: f64| {
                let wanted = golden[&(section.clone(), key.to_owned())];
                let off = (found / wanted - 1.0).abs();
                println!("{section} {key}: {found:.9} expected {wanted:.9}, {off:.1e} off");
                assert!(off < relative, "{section} {key}: {found} expected {wanted}");
            };
            let peak = expected.pixels.iter().map(|p| p.max_element()).fold(0.0, f32::max).into();
            check("mae", mae(&actual, &expected), 1e-8);
            check("mse", mse(&actual, &expected), 1e-8);
            check("rel_mse", rel_mse(&actual, &expected), 1e-8);
            check("psnr", psnr_db(mse(&actual, &expected), peak), 1e-8);
            check("ssim", ssim(&actual, &expected, peak).unwrap(), 1e-8);
            let map = if kind == "ldr" {
                flip_ldr(&linear(&actual), &linear(&expected), PIXELS_PER_DEGREE).unwrap()
            } else {
                flip_hdr(&actual, &expected, PIXELS_PER_DEGREE).unwrap()
            };
            let largest = map.errors.iter().copied().fold(0.0, f32::max);
            check(&format!("flip_{kind}"), map.mean(), 1e-5);
            check(&format!("flip_{kind}_max"), largest.into(), 1e-4);
        }
    }
}

#[test]
fn known_answers() {
    let mut expected = Image::new(2, 2);
    expected.pixels.fill(Vec3::ONE);
    let mut actual = expected.clone();
    actual.pixels[0] = vec3(1.5, 0.0, 1.0);
    assert_eq!(mae(&actual, &expected), 1.5 / 12.0);
    assert_eq!(mse(&actual, &expected), 1.25 / 12.0);
    assert!((rel_mse(&actual, &expected) - 1.25 / 12.0 / 1.01).abs() < 1e-15);
    assert_eq!(psnr_db(0.01, 1.0), 20.0);

    let (image, _) = hdr(32, 24);
    let same = Metrics::measure(&image, &image).unwrap();
    assert_eq!(
        (same.mae, same.rmse, same.rel_mse, same.psnr_db),
        (Some(0.0), Some(0.0), Some(0.0), None)
    );
    assert_eq!((same.flip_ldr, same.flip_hdr), (Some(0.0), Some(0.0)));
    assert!((same.ssim.unwrap() - 1.0).abs() < 1e-12);
    // Black against white is as far apart as FLIP goes.
    let black = Image::new(32, 24);
    let white = self::image(32, 24, |_, _, _| 1.0);
    let far = flip_ldr(&white, &black, PIXELS_PER_DEGREE).unwrap().mean();
    assert!((0.9..=1.0).contains(&far), "{far}");
}

#[test]
fn what_has_no_value_has_none() {
    let (mut actual, expected) = hdr(16, 16);
    actual.pixels[5].y = f32::NAN;
    let metrics = Metrics::measure(&actual, &expected).unwrap();
    assert_eq!(metrics, Metrics { peak: metrics.peak, ..Metrics::default() });
    assert_eq!(Metrics::measure(&Image::new(16, 15), &expected), None);
    let (small, tiny) = hdr(10, 20);
    assert_eq!(ssim(&small, &tiny, 1.0), None);
    let black = Image::new(16, 16);
    assert_eq!(
        Metrics::measure(&black, &black).unwrap().flip_hdr,
        None,
        "a black reference has no exposure"
    );
    // Half of the image black: the published tool still finds a range.
    let half = self::image(16, 16, |_, y, _| if y < 10 { 0.0 } else { 1.0 });
    assert!(flip_hdr(&black, &half, PIXELS_PER_DEGREE).unwrap().mean() > 0.1);
}

/// Prints, asserts nothing about clocks.
#[test]
fn cost_at_768x576() {
    let (actual, expected) = hdr(768, 576);
    let start = Instant::now();
    let metrics = Metrics::measure(&actual, &expected).unwrap();
    println!("all metrics: {:.2} s, {metrics:?}", start.elapsed().as_secs_f64());
}
