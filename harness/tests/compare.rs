//! The deciding comparison: known answers by hand, and a small Monte Carlo renderer whose truth is known.

use std::f32::consts::TAU;

use basecode::image::Image;
use glam::{Vec3, vec3};
use umbra::imaging::compare::{compare_offline, compare_realtime_linear, compare_srgb8};
use umbra::imaging::comparison::{CompareError, ComparedWith, ImageEvidence};
use umbra::imaging::reference::{ReferenceError, ReferenceImage, Region, RegionMask};
use umbra::imaging::srgb;
use umbra::imaging::tolerances::Tolerances;

/// Sebastiano Vigna's splitmix64: enough for tests.
struct Rng(u64);

impl Rng {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    fn uniform(&mut self) -> f32 {
        (self.next() >> 40) as f32 / (1u64 << 24) as f32
    }

    fn gaussian(&mut self) -> f32 {
        let (u, v) = (1.0 - self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (TAU * v).cos()
    }
}

fn lit(name: &str) -> Region {
    Region { name: name.into(), lit: true, exponent: 0.0 }
}

/// One lit region everywhere, a constant color, the given variance of one sample.
fn flat(width: usize, height: usize, value: Vec3, variance: f32) -> ReferenceImage {
    let mut mask = RegionMask::background(width, height);
    mask.regions.push(lit("wall"));
    mask.pixels.fill(1);
    let mut mean = Image::new(width, height);
    mean.pixels.fill(value);
    let mut v = Image::new(width, height);
    v.pixels.fill(Vec3::splat(variance));
    ReferenceImage::new(mean.clone(), v, 256, mean, mask).unwrap()
}

fn offline(actual: &Image, reference: &ReferenceImage, spp: u32) -> ImageEvidence {
    compare_offline(actual, reference, spp, &Tolerances::default()).unwrap()
}

/// The names of the checks that failed.
fn failed(evidence: &ImageEvidence) -> Vec<&str> {
    evidence.checks.iter().filter(|c| !c.passed).map(|c| c.id.as_str()).collect()
}

/// A disc on a background: lit, but for the right part that lies in shadow, with a bright spot. 96x64 pixels.
struct Disc;

impl Disc {
    const WIDTH: usize = 96;
    const HEIGHT: usize = 64;
    const CENTER: (f32, f32) = (44.3, 31.6);
    const RADIUS: f32 = 25.2;
    const SHADOW: f32 = 55.37;
    const SPOT: (f32, f32) = (36.0, 24.0);

    fn distance(x: f32, y: f32, to: (f32, f32)) -> f32 {
        (x - to.0).hypot(y - to.1)
    }

    fn radiance(x: f32, y: f32) -> Vec3 {
        if Self::distance(x, y, Self::CENTER) > Self::RADIUS || x > Self::SHADOW {
            return Vec3::ZERO;
        }
        let diffuse = 0.2 + 0.004 * x + 0.1 * (y * 0.21).sin();
        let spot = 9.0 * (-0.5 * (Self::distance(x, y, Self::SPOT) / 1.5).powi(2)).exp();
        diffuse * vec3(1.0, 0.7, 0.4) + spot
    }

    /// Sum and sum of squares of `n` samples per pixel.
    fn sample(n: u32, seed: u64) -> (Image, Image) {
        let mut sum = Image::new(Self::WIDTH, Self::HEIGHT);
        let mut squares = sum.clone();
        let mut rng = Rng(seed);
        for i in 0..sum.pixels.len() {
            let (x, y) = ((i % Self::WIDTH) as f32, (i / Self::WIDTH) as f32);
            for _ in 0..n {
                let l = Self::radiance(x + rng.uniform(), y + rng.uniform());
                sum.pixels[i] += l;
                squares.pixels[i] += l * l;
            }
        }
        (sum, squares)
    }

    fn render(n: u32, seed: u64) -> Image {
        let (mut image, _) = Self::sample(n, seed);
        image.pixels.iter_mut().for_each(|p| *p /= n as f32);
        image
    }

    /// One sample per pixel, `offset` from its corner.
    fn fixed(offset: f32) -> Image {
        let mut image = Image::new(Self::WIDTH, Self::HEIGHT);
        for (i, p) in image.pixels.iter_mut().enumerate() {
            let (x, y) = ((i % Self::WIDTH) as f32, (i / Self::WIDTH) as f32);
            *p = Self::radiance(x + offset, y + offset);
        }
        image
    }

    fn reference() -> ReferenceImage {
        let n = 256;
        let (mut mean, squares) = Self::sample(n, 0xface);
        let mut variance = squares.clone();
        for (i, v) in variance.pixels.iter_mut().enumerate() {
            let m = mean.pixels[i] / n as f32;
            *v = ((squares.pixels[i] - n as f32 * m * m) / (n - 1) as f32).max(Vec3::ZERO);
            mean.pixels[i] = m;
        }
        let mut mask = RegionMask::background(Self::WIDTH, Self::HEIGHT);
        mask.regions.push(lit("disc, lit"));
        mask.regions.push(Region { name: "disc, shadowed".into(), lit: false, exponent: 0.0 });
        for (i, m) in mask.pixels.iter_mut().enumerate() {
            let (x, y) = ((i % Self::WIDTH) as f32 + 0.5, (i / Self::WIDTH) as f32 + 0.5);
            let rim = Self::distance(x, y, Self::CENTER) - Self::RADIUS;
            *m = match (rim > 0.0, x > Self::SHADOW) {
                (true, _) => 0,
                (_, true) => 2,
                _ => 1,
            };
            if rim.abs() < 1.8 || (rim < 0.0 && (x - Self::SHADOW).abs() < 1.5) {
                *m |= RegionMask::EDGE;
            }
            if Self::distance(x, y, Self::SPOT) < 4.5 {
                *m |= RegionMask::HIGHLIGHT;
            }
        }
        ReferenceImage::new(mean, variance, n, Self::fixed(0.5), mask).unwrap()
    }
}

#[test]
fn four_pixels_by_hand() {
    let reference = flat(2, 2, Vec3::splat(0.5), 0.0);
    let mut actual = reference.mean.clone();
    let evidence = offline(&actual, &reference, 16);
    assert!(evidence.passed(), "{evidence:?}");
    assert_eq!(evidence.worst, None);
    assert_eq!(evidence.compared_with, ComparedWith::Mean);

    actual.pixels[3].y = f32::NAN;
    actual.pixels[2].x = f32::INFINITY;
    let evidence = offline(&actual, &reference, 16);
    let check = evidence.check("non_finite").unwrap();
    assert_eq!(check.value, 2.0);
    assert_eq!(check.detail, "2 pixels are not finite; first at (0, 1)");
    assert_eq!(evidence.check("interior").unwrap().value, 0.5);
    let worst = evidence.worst.as_ref().unwrap();
    assert_eq!((worst.x, worst.y, worst.actual[0]), (0, 1, f32::INFINITY));
    assert!(!evidence.passed());

    actual = reference.mean.clone();
    actual.pixels[1] = vec3(0.5, -2e-6, 0.5);
    let evidence = offline(&actual, &reference, 16);
    let negative = evidence.check("negative").unwrap();
    assert_eq!(negative.detail, "1 pixel is negative; first at (1, 0)");
    assert!(!negative.passed);
    actual.pixels[1].y = -0.9e-6;
    assert!(offline(&actual, &reference, 16).check("negative").unwrap().passed);
}

/// On an edge every other rule is lenient: a single NaN there must still fail, alone.
#[test]
fn one_value_that_is_not_finite_is_enough() {
    let mut reference = flat(8, 8, Vec3::splat(0.5), 0.0);
    reference.mask.pixels[9] |= RegionMask::EDGE;
    let mut actual = reference.mean.clone();
    actual.pixels[9].x = f32::NAN;
    assert_eq!(failed(&offline(&actual, &reference, 16)), ["non_finite"]);
}

/// Three pixels, each within its noise, have a mean that proves nothing; sixteen of them do.
#[test]
fn a_tiny_region_has_no_bias() {
    for (pixels, judged) in [(15, false), (16, true)] {
        let mut reference = flat(8, 8, Vec3::splat(0.5), 0.0);
        reference.mask.regions.push(lit("speck"));
        reference.mask.pixels[..pixels].fill(2);
        let mut actual = reference.mean.clone();
        actual.pixels[..pixels].fill(Vec3::splat(0.503));
        let evidence = offline(&actual, &reference, 16);
        assert_eq!(failed(&evidence).contains(&"bias: speck"), judged, "{pixels} pixels");
        let said = evidence.check("bias: speck").unwrap().detail.contains("too few");
        assert_eq!(said, !judged);
    }
}

#[test]
fn z_is_what_the_formula_says() {
    let v = 0.04;
    let reference = flat(5, 5, Vec3::splat(0.5), v);
    let floor: f32 = 5e-4 * 0.5 + 2e-3 * 0.5;
    let standard_error = (v / 16.0 + v / 256.0 + floor * floor).sqrt();
    for (z, fails) in [(3.99, false), (4.01, true)] {
        let mut actual = reference.mean.clone();
        actual.pixels[12].z += z * standard_error;
        let evidence = offline(&actual, &reference, 16);
        let found = evidence.check("interior").unwrap().value;
        assert_eq!(found, if fails { 0.04 } else { 0.0 }, "z {z}");
        let excess = evidence.worst.unwrap().excess;
        assert!((excess - f64::from(z / 4.0)).abs() < 1e-4, "{excess}");
    }
    // The variance is that of the noisiest of the nine pixels around (2, 2), and of no other.
    for noisy in 0..25 {
        let mut quiet = reference.clone();
        quiet.variance.pixels.fill(Vec3::ZERO);
        quiet.variance.pixels[noisy] = Vec3::splat(v);
        let mut actual = reference.mean.clone();
        actual.pixels[12].x += 3.99 * standard_error;
        let near = (1..4).contains(&(noisy % 5)) && (1..4).contains(&(noisy / 5));
        let failing = offline(&actual, &quiet, 16).check("interior").unwrap().value > 0.0;
        assert_eq!(failing, !near, "noise at {noisy}");
    }
}

#[test]
fn another_size_is_an_outcome() {
    let reference = flat(4, 2, Vec3::ONE, 0.0);
    let t = Tolerances::default();
    let error = compare_offline(&Image::new(2, 4), &reference, 16, &t).unwrap_err();
    assert_eq!(error, CompareError::Size { actual: (2, 4), expected: (4, 2) });
    assert_eq!(error.to_string(), "image is 2x4 but 4x2 is expected; hint: width comes first");
    let none = compare_offline(&Image::new(4, 2), &reference, 0, &t);
    assert_eq!(none.unwrap_err(), CompareError::NoSamples);
}

#[test]
fn a_reference_that_proves_nothing_is_refused() {
    let parts = |value: Vec3, mask: RegionMask| {
        let mut image = Image::new(2, 2);
        image.pixels.fill(value);
        ReferenceImage::new(image.clone(), image.clone(), 16, image, mask).map(|r| r.median_lit)
    };
    let mut mask = RegionMask::background(2, 2);
    assert_eq!(parts(Vec3::ONE, mask.clone()), Err(ReferenceError::NothingLit));
    mask.regions.push(lit("wall"));
    mask.pixels.fill(1);
    assert_eq!(parts(Vec3::ONE, mask.clone()), Ok(1.0));
    assert_eq!(parts(Vec3::ZERO, mask.clone()), Err(ReferenceError::NothingLit));
    assert!(matches!(parts(Vec3::NAN, mask.clone()), Err(ReferenceError::Value { .. })));
    mask.pixels[2] = 5;
    assert!(matches!(parts(Vec3::ONE, mask.clone()), Err(ReferenceError::Region { index: 5, .. })));
    mask.pixels.fill(1 | RegionMask::EDGE);
    assert_eq!(parts(Vec3::ONE, mask.clone()), Err(ReferenceError::NothingLit));
    mask.width = 3;
    assert!(matches!(parts(Vec3::ONE, mask), Err(ReferenceError::Size { .. })));
}

#[test]
fn emitters_are_never_compared() {
    let mut reference = flat(8, 8, Vec3::splat(0.5), 0.0);
    reference.mask.pixels[9] |= RegionMask::EMITTER;
    let mut actual = reference.mean.clone();
    actual.pixels[9] = Vec3::NAN;
    assert!(offline(&actual, &reference, 16).passed());
    let t = Tolerances::default();
    let realtime = compare_realtime_linear(&actual, &reference.center, &reference.mask, &t);
    assert!(realtime.unwrap().passed());
}

/// Gaussian noise of exactly the stored variance, every channel on its own: three chances for a pixel to fail, so
/// harder than any render. The fraction above z = 4 is 3 * 6.3e-5.
#[test]
fn known_variance_gives_the_known_fraction() {
    let v = 0.09f32;
    let (width, height, n, big_n) = (96, 64, 16.0f32, 256.0f32);
    let mut rng = Rng(7);
    let (mut failing, mut pixels, mut rejected) = (0.0, 0.0, 0);
    let seeds = 150;
    for _ in 0..seeds {
        let mut reference = flat(width, height, Vec3::splat(1.0), v);
        let mut noise = |p: &mut Vec3, sigma: f32| {
            *p += sigma * vec3(rng.gaussian(), rng.gaussian(), rng.gaussian());
        };
        reference.mean.pixels.iter_mut().for_each(|p| noise(p, (v / big_n).sqrt()));
        let mut actual = Image::new(width, height);
        actual.pixels.fill(Vec3::ONE);
        actual.pixels.iter_mut().for_each(|p| noise(p, (v / n).sqrt()));
        let evidence = offline(&actual, &reference, 16);
        failing += evidence.check("interior").unwrap().value * (width * height) as f64;
        pixels += (width * height) as f64;
        rejected += u32::from(!evidence.check("interior").unwrap().passed);
        let ratio = evidence.noise_ratio.unwrap();
        assert!((ratio - 1.0).abs() < 0.03, "{ratio}");
    }
    let fraction = failing / pixels;
    println!("above z = 4: {fraction:.2e}, expected 1.9e-4; {rejected} of {seeds} images rejected");
    assert!((1.2e-4..2.6e-4).contains(&fraction), "{fraction}");
    assert!(rejected <= 1, "{rejected}");
}

#[test]
fn correct_renders_pass_at_every_seed_and_spp() {
    let reference = Disc::reference();
    let (mut worst_interior, mut worst_edge, mut worst_bias) = (0.0f64, 0.0f64, 0.0f64);
    for spp in [4, 16, 64] {
        for seed in 0..200 {
            let evidence = offline(&Disc::render(spp, seed), &reference, spp);
            assert!(evidence.passed(), "spp {spp}, seed {seed}: {:?}", evidence.checks);
            for check in &evidence.checks {
                let used = check.value.abs() / check.bound.max(1e-300);
                match check.id.as_str() {
                    "interior" => worst_interior = worst_interior.max(used),
                    "edge" => worst_edge = worst_edge.max(used),
                    id if id.starts_with("bias") => worst_bias = worst_bias.max(used),
                    _ => (),
                }
            }
            let ratio = evidence.noise_ratio.unwrap();
            assert!((0.7..1.5).contains(&ratio), "spp {spp}, seed {seed}: {ratio}");
        }
    }
    println!(
        "600 correct images, part of the bound used at most: interior {worst_interior:.2}, \
         edge {worst_edge:.2}, bias {worst_bias:.2}"
    );
    let evidence = offline(&Disc::fixed(0.5), &reference, 1);
    assert!(evidence.passed());
    assert_eq!(evidence.compared_with, ComparedWith::Center);
}

#[test]
fn one_percent_of_gain_is_caught_by_the_bias() {
    let reference = Disc::reference();
    for seed in 0..50 {
        for gain in [0.99, 1.01] {
            let mut image = Disc::render(16, seed);
            image.pixels.iter_mut().for_each(|p| *p *= gain);
            let evidence = offline(&image, &reference, 16);
            assert!(failed(&evidence).contains(&"bias: disc, lit"), "{:?}", failed(&evidence));
            assert!(!failed(&evidence).contains(&"bias: background"));
            let bias = evidence.check("bias: disc, lit").unwrap();
            assert!((bias.value - f64::from(gain - 1.0)).abs() < 2e-3, "{bias:?}");
        }
    }
    let mut blue = Disc::render(16, 1);
    blue.pixels.iter_mut().for_each(|p| p.z *= 0.98);
    let evidence = offline(&blue, &reference, 16);
    assert!(failed(&evidence).contains(&"bias: disc, lit"), "one channel is enough");
}

#[test]
fn a_wrong_highlight_is_only_the_highlights_fault() {
    let reference = Disc::reference();
    let mut image = Disc::render(16, 3);
    for (p, m) in image.pixels.iter_mut().zip(&reference.mask.pixels) {
        if m & RegionMask::HIGHLIGHT != 0 {
            *p *= 1.1;
        }
    }
    let evidence = offline(&image, &reference, 16);
    assert!(failed(&evidence).contains(&"bias: disc, lit, highlight"), "{:?}", failed(&evidence));
    assert!(!failed(&evidence).contains(&"bias: disc, lit"));
}

#[test]
fn black_nan_and_constant_images_never_pass() {
    let reference = Disc::reference();
    let fill = |value: Vec3| {
        let mut image = Image::new(Disc::WIDTH, Disc::HEIGHT);
        image.pixels.fill(value);
        image
    };
    for value in [Vec3::ZERO, Vec3::NAN, Vec3::INFINITY, Vec3::splat(0.4), Vec3::splat(-1.0)] {
        for spp in [1, 16, 1_000_000] {
            let evidence = offline(&fill(value), &reference, spp);
            for rule in ["interior", "blob", "bias: disc, lit"] {
                let failed = failed(&evidence);
                assert!(failed.contains(&rule), "{value} at {spp} spp: {failed:?}");
            }
        }
        let (center, mask, t) = (&reference.center, &reference.mask, Tolerances::default());
        assert!(!compare_realtime_linear(&fill(value), center, mask, &t).unwrap().passed());
        assert!(!compare_srgb8(&fill(value), center, mask, &t).unwrap().passed());
    }
    // A copy of the reference passes every rule, and its missing noise shows.
    let copy = offline(&reference.mean, &reference, 16);
    assert!(copy.passed());
    assert_eq!(copy.noise_ratio, Some(0.0));
}

#[test]
fn a_silhouette_may_move_inside_its_mask_but_a_blob_may_not_appear() {
    let reference = Disc::reference();
    let mut moved = reference.center.clone();
    let edges: Vec<usize> = (0..moved.pixels.len())
        .filter(|&i| reference.mask.pixels[i] & RegionMask::EDGE != 0)
        .collect();
    // One of 25 edge pixels changes sides.
    for &i in edges.iter().step_by(25) {
        moved.pixels[i] = Vec3::splat(0.4) - moved.pixels[i].min(Vec3::splat(0.4));
    }
    let evidence = offline(&moved, &reference, 1);
    assert!(evidence.passed(), "{:?}", failed(&evidence));
    assert!(evidence.check("edge").unwrap().value > 0.03);

    let mut blob = reference.center.clone();
    for (x, y) in [(30, 40), (31, 40), (30, 41), (31, 41)] {
        blob.pixels[y * Disc::WIDTH + x] *= 0.8;
    }
    let evidence = offline(&blob, &reference, 1);
    assert_eq!(failed(&evidence), ["blob"], "four pixels are too few for any other rule");
    let area = evidence.largest_failing.as_ref().unwrap();
    assert_eq!((area.x, area.y, area.width, area.height, area.pixels), (30, 40, 2, 2, 4));
    assert_eq!(
        evidence.check("blob").unwrap().detail,
        "1 block of 2x2 differing pixels; the largest area has 4 pixels, in columns 30 to 31 and rows 40 to 41"
    );

    // Half a pixel off, the whole rim moves.
    let evidence = offline(&Disc::fixed(0.0), &reference, 1);
    assert!(failed(&evidence).contains(&"edge"), "{:?}", failed(&evidence));
}

#[test]
fn realtime_floats_allow_for_pow_only() {
    let mut reference = flat(8, 8, Vec3::splat(0.5), 0.0);
    let mut judge = |factor: f32, exponent: f32| {
        reference.mask.regions[1].exponent = exponent;
        let mut actual = reference.center.clone();
        actual.pixels.iter_mut().for_each(|p| *p *= factor);
        let t = Tolerances::default();
        compare_realtime_linear(&actual, &reference.center, &reference.mask, &t).unwrap()
    };
    assert!(judge(1.002, 0.0).passed());
    assert_eq!(failed(&judge(1.0028, 0.0)), ["interior", "blob"]);
    assert!(judge(1.0028, 500.0).passed());
    assert!(!judge(1.006, 500.0).passed());
    assert!(!judge(0.98, 30.0).passed(), "2 % of gain");
    assert!(!judge(1.006, 0.0).check("bias: wall").unwrap().passed);
}

/// Hardware snaps vertices to 1/256 of a pixel: what it draws is that far off in both directions at most.
#[test]
fn realtime_floats_allow_for_the_rasterizers_grid() {
    let mut reference = flat(48, 48, Vec3::splat(0.4), 0.0);
    // A highlight 1.5 pixels wide on a dim wall, as a ray tracer and a shifted rasterizer see it.
    let draw = |shift: f32| {
        let mut image = Image::new(48, 48);
        for (i, pixel) in image.pixels.iter_mut().enumerate() {
            let (x, y) = ((i % 48) as f32 - 20.3 + shift, (i / 48) as f32 - 25.8 + shift);
            *pixel = Vec3::splat(0.4 + 6.0 * (-(x * x + y * y) / 4.5).exp());
        }
        image
    };
    reference.center = draw(0.0);
    let judge = |shift: f32| {
        let t = Tolerances::default();
        compare_realtime_linear(&draw(shift), &reference.center, &reference.mask, &t).unwrap()
    };
    assert!(judge(1.0 / 256.0).passed());
    assert!(judge(-1.0 / 256.0).passed());
    let off = judge(1.0 / 16.0);
    assert_eq!(failed(&off)[..2], ["interior", "blob"], "a sixteenth of a pixel");
    let without = Tolerances { realtime_snap_px: 0.0, ..Tolerances::default() };
    let strict =
        compare_realtime_linear(&draw(1.0 / 256.0), &reference.center, &reference.mask, &without);
    assert!(!strict.unwrap().passed(), "the allowance is what lets it pass");
}

#[test]
fn levels_of_submitted_realtime_images() {
    let width = 64;
    let mut mask = RegionMask::background(width, width);
    mask.regions.push(lit("wall"));
    mask.pixels.fill(1);
    let mut center = Image::new(width, width);
    for (i, p) in center.pixels.iter_mut().enumerate() {
        *p = Vec3::splat(i as f32 / 2000.0); // from 0 to 2: beyond what 8 bits hold
    }
    let t = Tolerances::default();
    let judge = |image: &Image| compare_srgb8(image, &center, &mask, &t).unwrap();
    assert!(judge(&center).passed(), "linear and not clamped");

    let shift = |levels: i32| {
        let mut image = center.clone();
        for p in &mut image.pixels {
            let l = (i32::from(srgb::level(p.x)) + levels).clamp(0, 255);
            *p = Vec3::splat(srgb::decode(f64::from(l) / 255.0) as f32);
        }
        image
    };
    assert!(judge(&shift(0)).passed(), "as the original stored it");
    assert!(judge(&shift(1)).passed(), "one level is rounding");
    assert!(judge(&shift(-1)).passed());
    assert_eq!(failed(&judge(&shift(2))), ["interior", "blob"]);

    // 4096 pixels: a quarter of a percent is 10, and 4 to spare.
    for (count, passes) in [(14, true), (15, false)] {
        let mut few = center.clone();
        for i in 0..count {
            few.pixels[i * 97] = Vec3::splat(0.9);
        }
        assert_eq!(judge(&few).passed(), passes, "{count}");
    }
}

#[test]
fn evidence_survives_json_with_nan_in_it() {
    let reference = flat(4, 4, Vec3::splat(0.5), 0.1);
    let mut actual = reference.mean.clone();
    actual.pixels[5] = vec3(f32::NAN, f32::NEG_INFINITY, 1.0);
    let evidence = offline(&actual, &reference, 16);
    let text = serde_json::to_string(&evidence).unwrap();
    assert!(!text.contains("null"), "{text}");
    let back: ImageEvidence = serde_json::from_str(&text).unwrap();
    assert_eq!(serde_json::to_string(&back).unwrap(), text);
    assert!(back.worst.unwrap().actual[0].is_nan());

    let tolerances: Tolerances = serde_json::from_str(r#"{"z_limit": 5.0}"#).unwrap();
    assert_eq!(tolerances, Tolerances { z_limit: 5.0, ..Tolerances::default() });
    assert!(serde_json::from_str::<Tolerances>(r#"{"z_limt": 5.0}"#).is_err());
}
