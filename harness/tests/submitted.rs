//! Images of a submission as evidence: their noise, copies of them, pictures of something else. The
//! scene is a small Monte Carlo renderer whose truth is known.

use basecode::Image;
use glam::{Vec3, vec3};
use umbra::evidence::submitted::{
    has_own_noise, judge_copied, judge_noise, judge_scene, judge_seed,
};
use umbra::evidence::{Check, Verdict};
use umbra::grading::ImageDigest;
use umbra::imaging::noise::NoisyPixels;
use umbra::imaging::origin::{same_draws, same_levels};
use umbra::imaging::reference::{ReferenceImage, Region, RegionMask};
use umbra::imaging::srgb;
use umbra::imaging::tolerances::Tolerances;

const WIDTH: usize = 240;
const HEIGHT: usize = 180;
const SPP: u32 = 16;

/// Two discs on a floor, the shadow of the larger one on it, and darkness above.
fn radiance(x: f32, y: f32) -> (u16, Vec3) {
    let disc = |cx: f32, cy: f32, r: f32| (x - cx).hypot(y - cy) < r;
    let (floor, red, blue) =
        (vec3(0.31, 0.28, 0.22), vec3(0.62, 0.11, 0.07), vec3(0.05, 0.21, 1.7));
    if disc(90.3, 81.7, 48.2) {
        (2, red)
    } else if disc(171.4, 110.9, 30.6) {
        (3, blue)
    } else if y < 60.0 + 0.07 * x {
        (0, Vec3::ZERO)
    } else if (x - 150.0).hypot(2.0 * (y - 140.0)) < 60.0 {
        (4, Vec3::ZERO)
    } else {
        (1, floor)
    }
}

/// A linear congruential generator, its high bits; enough for tests.
struct Rng(u64);

impl Rng {
    fn uniform(&mut self) -> f32 {
        let factor = 6_364_136_223_846_793_005;
        self.0 = self.0.wrapping_mul(factor).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }
}

struct Scene {
    reference: ReferenceImage,
}

impl Scene {
    fn new() -> Self {
        let mut mask = RegionMask::background(WIDTH, HEIGHT);
        for (name, lit) in [("floor", true), ("red", true), ("blue", true), ("shadow", false)] {
            mask.regions.push(Region { name: name.into(), lit, exponent: 0.0 });
        }
        let seen = |x: f32, y: f32| radiance(x, y).0;
        for i in 0..WIDTH * HEIGHT {
            let (x, y) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
            mask.pixels[i] = seen(x + 0.5, y + 0.5);
            let around = (-1..=2).flat_map(|dy| (-1..=2).map(move |dx| (dx as f32, dy as f32)));
            let mut around = around.map(|(dx, dy)| seen(x + dx, y + dy));
            if around.any(|other| other != mask.pixels[i]) {
                mask.pixels[i] |= RegionMask::EDGE;
            }
        }
        let n = 256;
        let (mut mean, mut variance) = (Image::new(WIDTH, HEIGHT), Image::new(WIDTH, HEIGHT));
        let mut rng = Rng(0xbeef);
        for i in 0..WIDTH * HEIGHT {
            let (mut sum, mut squares) = (Vec3::ZERO, Vec3::ZERO);
            for _ in 0..n {
                let l = sample(i, &mut rng);
                (sum, squares) = (sum + l, squares + l * l);
            }
            mean.pixels[i] = sum / n as f32;
            let spread = squares - sum * sum / n as f32;
            variance.pixels[i] = (spread / (n - 1) as f32).max(Vec3::ZERO);
        }
        let center = fixed(|x, y| radiance(x + 0.5, y + 0.5).1);
        Self { reference: ReferenceImage::new(mean, variance, n, center, mask).unwrap() }
    }

    fn noisy(&self) -> NoisyPixels<'_> {
        NoisyPixels::new(&self.reference).unwrap()
    }

    /// A right image; away from edges nothing is left to chance.
    fn render(&self, spp: u32, seed: u64) -> Image {
        let mut rng = Rng(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ seed << 7);
        rng.uniform();
        let mut image = self.reference.center.clone();
        for i in 0..image.pixels.len() {
            if self.reference.mask.pixels[i] & RegionMask::EDGE != 0 {
                let sum: Vec3 = (0..spp).map(|_| sample(i, &mut rng)).sum();
                image.pixels[i] = sum / spp as f32;
            }
        }
        image
    }

    fn noise(&self, image: &Image) -> Check {
        judge_noise("scene", "a.exr", self.noisy().measure(image), SPP)
    }

    fn copied(&self, image: &Image) -> Verdict {
        let published =
            [("the mean", &self.reference.mean), ("the centres", &self.reference.center)];
        judge_copied("scene", "a.exr", image, Some(&self.noisy()), &published).verdict
    }

    fn shows(&self, image: &Image) -> Verdict {
        judge_scene("scene", "a.exr", image, &[&self.reference.mean], &self.reference.mask).verdict
    }
}

fn sample(i: usize, rng: &mut Rng) -> Vec3 {
    let (x, y) = ((i % WIDTH) as f32, (i / WIDTH) as f32);
    radiance(x + rng.uniform(), y + rng.uniform()).1
}

fn fixed(value: impl Fn(f32, f32) -> Vec3) -> Image {
    let at = |i: usize| value((i % WIDTH) as f32, (i / WIDTH) as f32);
    Image { width: WIDTH, height: HEIGHT, pixels: (0..WIDTH * HEIGHT).map(at).collect() }
}

fn map(image: &Image, of: impl Fn(Vec3) -> Vec3) -> Image {
    Image { pixels: image.pixels.iter().map(|&p| of(p)).collect(), ..*image }
}

/// As an EXR file with half precision holds it.
fn half(image: &Image) -> Image {
    let round = |v: f32| f32::from_bits((v.to_bits() + 0x1000) & !0x1fff);
    map(image, |p| p.map(round))
}

/// Clamped and rounded to 8-bit sRGB levels, stored as linear values.
fn eight_bits(image: &Image) -> Image {
    let round = |v: f32| srgb::decode(f64::from(srgb::level(v)) / 255.0) as f32;
    half(&map(image, |p| p.map(round)))
}

#[test]
fn four_hundred_seeds_have_the_noise_of_their_samples_and_are_nobodys_copy() {
    let scene = Scene::new();
    let first = scene.render(SPP, 1_000_000);
    let mut furthest = 1.0f64;
    for seed in 0..400 {
        let image = half(&scene.render(SPP, seed));
        let check = scene.noise(&image);
        assert_eq!(check.verdict, Verdict::Pass, "seed {seed}: {}", check.summary);
        furthest = check.measures.iter().map(|measure| measure.value).fold(furthest, f64::max);
        assert_eq!(scene.copied(&image), Verdict::Pass, "seed {seed}");
        assert!(!scene.noisy().same_draw(&image, &first), "seed {seed}");
        let own = same_draws(&image, &first, SPP, 0.3, &Tolerances::default());
        assert!(own, "seed {seed} is taken for another renderer's");
    }
    // Half of the way to the bound of 1.5, on a film a tenth as large as the assignment's.
    assert!(furthest < 1.25, "a right image looks like {furthest} times its samples");
}

#[test]
fn other_samples_per_pixel_are_told() {
    let scene = Scene::new();
    for (spp, verdict, error) in [
        (1, Verdict::Fail, 0.0),
        (4, Verdict::Fail, 0.0),
        (8, Verdict::Fail, 0.0),
        (16, Verdict::Pass, 0.0),
        (32, Verdict::Fail, 0.0),
        (64, Verdict::Fail, 0.0),
        (256, Verdict::Fail, 1.0),
        (2000, Verdict::Fail, 1.0),
    ] {
        let image = scene.render(spp, 5);
        let check = scene.noise(&image);
        assert_eq!((check.verdict, check.error), (verdict, error), "{spp}: {}", check.summary);
        let noise = scene.noisy().measure(&image).unwrap();
        let ratio = noise.spp / f64::from(spp);
        assert!(spp > 100 || (0.8..1.25).contains(&ratio), "{spp} looks like {}", noise.spp);
    }
    let check = scene.noise(&scene.render(4, 6));
    assert!(check.summary.contains("its scene asks for 16"), "{}", check.summary);
}

#[test]
fn of_a_wrong_image_too_much_noise_is_not_said_but_too_little_is() {
    let scene = Scene::new();
    // The shadow is missing: its edges are wrong, which is no noise; all else has 16 spp.
    let shadow = |image: Image| {
        let lit = |i: usize| scene.reference.mask.pixels[i] & RegionMask::INDEX == 4;
        let floor = vec3(0.31, 0.28, 0.22);
        let pixels = image.pixels.iter().enumerate();
        let pixels = pixels.map(|(i, p)| if lit(i) { floor } else { *p }).collect();
        Image { pixels, ..image }
    };
    let noise = |spp| scene.noise(&shadow(scene.render(spp, 5)));
    assert_ne!(noise(16).verdict, Verdict::Fail, "{}", noise(16).summary);
    assert_eq!(noise(4).verdict, Verdict::NotJudged);
    let black = Image::new(WIDTH, HEIGHT);
    let broken = map(&black, |_| Vec3::NAN);
    let huge = map(&black, |_| Vec3::splat(3e38));
    for image in [&black, &broken, &huge, &Image::new(9, 9)] {
        assert_eq!(scene.noise(image).verdict, Verdict::NotJudged);
        assert_eq!(scene.copied(image), Verdict::Pass);
    }
}

#[test]
fn a_copy_is_found_whatever_it_was_rounded_to() {
    let scene = Scene::new();
    let ReferenceImage { mean, center, .. } = &scene.reference;
    for published in [mean, center] {
        let mut touched = half(published);
        touched.pixels[WIDTH * 90 + 40] = Vec3::splat(0.5);
        for copy in [published.clone(), half(published), eight_bits(published), touched] {
            assert_eq!(scene.copied(&copy), Verdict::Fail);
        }
    }
    // An image that converged by itself is no copy; its noise gives it away.
    assert_eq!(scene.copied(&scene.render(1000, 3)), Verdict::Pass);
    // One sample in the middle of each pixel: everybody's are equal and tell nobody from another.
    let noise = |image: &Image| has_own_noise(scene.noisy().measure(image));
    assert!(noise(&scene.render(16, 3)) && noise(&scene.render(4, 3)));
    assert!(!noise(center) && !noise(&Image::new(WIDTH, HEIGHT)));
}

#[test]
fn a_digest_survives_rounding_and_nothing_else() {
    let scene = Scene::new();
    let image = half(&scene.render(SPP, 8));
    let digest = |image: &Image| ImageDigest::new("scene", "a.exr", image).sha256;
    assert_eq!(digest(&image), digest(&half(&image)));
    assert_eq!(digest(&image), digest(&eight_bits(&image)));
    let full = scene.render(SPP, 8);
    assert_eq!(digest(&full), digest(&half(&full)));
    assert_ne!(digest(&image), digest(&half(&scene.render(SPP, 9))));
    assert_ne!(digest(&Image::new(4, 2)), digest(&Image::new(2, 4)));
}

#[test]
fn a_stale_image_is_not_what_the_code_draws() {
    let scene = Scene::new();
    let tolerances = Tolerances::default();
    let (a, b) = (scene.render(SPP, 1), scene.render(SPP, 2));
    let same = |a: &Image, b: &Image| same_draws(a, b, SPP, 0.3, &tolerances);
    assert!(same(&a, &b));
    assert!(!same(&a, &map(&b, |p| 1.02 * p)), "a gain of 2 %");
    let mut highlight = b.clone();
    for i in 0..9 {
        highlight.pixels[WIDTH * (70 + i / 3) + 80 + i % 3] *= 1.5;
    }
    assert!(!same(&a, &highlight), "a highlight of nine pixels");
    // A wrong renderer's images are its own all the same: with values that are negative, not finite,
    // or a hundred times as bright.
    for wrong in [|p| -0.3 * p, |p: Vec3| if p.x > 0.6 { Vec3::NAN } else { p }, |p| 100.0 * p] {
        assert!(same(&map(&a, wrong), &map(&b, wrong)));
        assert!(!same(&map(&a, wrong), &b));
    }
    assert!(!same(&a, &Image::new(WIDTH, WIDTH)));

    let center = &scene.reference.center;
    let same = |a: &Image, b: &Image| same_levels(a, b, &scene.reference.mask, &tolerances);
    assert!(same(&eight_bits(center), center) && same(&half(center), center));
    assert!(same(&Image::new(WIDTH, HEIGHT), &Image::new(WIDTH, HEIGHT)), "black draws black");
    assert!(!same(&map(center, |p| 1.04 * p), center));
}

#[test]
fn wrong_images_show_the_scene_and_other_pictures_do_not() {
    let scene = Scene::new();
    let right = scene.render(SPP, 1);
    let center = &scene.reference.center;
    let flipped = fixed(|x, y| center.pixels[(HEIGHT - 1 - y as usize) * WIDTH + x as usize]);
    let mirrored = fixed(|x, y| center.pixels[y as usize * WIDTH + WIDTH - 1 - x as usize]);
    let silhouettes = map(&right, |p| Vec3::splat(if p == Vec3::ZERO { 1.0 } else { 0.2 }));
    let small = fixed(|x, y| radiance(2.0 * x, 2.0 * y).1);
    let mut half_size = Image::new(WIDTH / 2, HEIGHT / 2);
    for i in 0..half_size.pixels.len() {
        let (x, y) = (i % half_size.width, i / half_size.width);
        half_size.pixels[i] = small.pixels[y * WIDTH + x];
    }
    for image in [
        &right,
        &map(&right, |p| 40.0 * p),
        &map(&right, |p| p.powf(0.45)),
        &map(&right, |p| vec3(p.z, p.y, p.x)),
        &flipped,
        &mirrored,
        &silhouettes,
        &half_size,
    ] {
        assert_eq!(scene.shows(image), Verdict::Pass);
    }
    let mut rng = Rng(4);
    let noise = map(&right, |_| Vec3::ZERO);
    let noise = Image {
        pixels: noise.pixels.iter().map(|_| Vec3::splat(rng.uniform())).collect(),
        ..noise
    };
    let other = fixed(|x, y| {
        let ring = (x - 60.0).hypot(y - 130.0);
        Vec3::splat(if ring > 25.0 && ring < 40.0 || x > 205.0 { 0.8 } else { 0.1 })
    });
    for image in [&noise, &other, &Image::new(WIDTH, HEIGHT), &map(&right, |_| Vec3::NAN)] {
        assert_eq!(scene.shows(image), Verdict::Fail);
    }
}

#[test]
fn noise_is_known_again_and_that_of_other_seeds_is_not() {
    let scene = Scene::new();
    let noisy = scene.noisy();
    let own = scene.render(SPP, 1_000_000);
    let mut alike = 0.0f64;
    for seed in 0..400 {
        let other = scene.render(SPP, seed);
        alike = alike.max(noisy.correlation(&own, &other).unwrap().abs());
    }
    assert!(alike < 0.3, "another seed's noise looks like it by {alike}");
    // A gain and a wrong shadow leave the noise what it is; rounding does too.
    let gain = map(&own, |p| p * 1.01);
    for image in [half(&own), eight_bits(&own), gain] {
        let found = noisy.correlation(&image, &own).unwrap();
        assert!(found > 0.9, "{found}");
        assert_eq!(judge_seed("scene", "a.exr", Some(found)).verdict, Verdict::Pass);
    }
    let other = noisy.correlation(&scene.render(SPP, 7), &own);
    let check = judge_seed("scene", "a.exr", other);
    assert_eq!(check.verdict, Verdict::NotJudged, "{}", check.summary);
    for image in [Image::new(9, 9), map(&own, |_| Vec3::NAN), scene.reference.mean.clone()] {
        let found = noisy.correlation(&image, &own);
        assert_eq!(judge_seed("scene", "a.exr", found).verdict, Verdict::NotJudged, "{found:?}");
    }
}
