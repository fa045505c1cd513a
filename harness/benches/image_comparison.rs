//! What one comparison costs at the course's film of 768x576, beside reading the same bytes once:
//! `cargo bench --workspace --bench image_comparison`.

use std::sync::LazyLock;

use basecode::{Image, Sampler, Vec3};
use divan::black_box;
use umbra::imaging::compare::{compare_offline, compare_realtime_linear, compare_srgb8};
use umbra::imaging::reference::{ReferenceImage, Region, RegionMask};
use umbra::imaging::tolerances::Tolerances;

const WIDTH: usize = 768;
const HEIGHT: usize = 576;

struct Images {
    actual: Image,
    reference: ReferenceImage,
    tolerances: Tolerances,
}

static IMAGES: LazyLock<Images> = LazyLock::new(|| {
    let sampler = Sampler::new(1);
    let noise = |value: f32| {
        let mut image = Image::new(WIDTH, HEIGHT);
        image.pixels.fill_with(|| Vec3::splat(value + 0.01 * sampler.next_1d()));
        image
    };
    let mut mask = RegionMask::background(WIDTH, HEIGHT);
    mask.regions.push(Region { name: "wall".into(), lit: true, exponent: 20.0 });
    mask.pixels.fill(1);
    let (mean, variance, center) = (noise(0.5), noise(0.001), noise(0.5));
    let reference = ReferenceImage::new(mean, variance, 256, center, mask).expect("of one size");
    Images { actual: noise(0.5), reference, tolerances: Tolerances::default() }
});

fn main() {
    LazyLock::force(&IMAGES);
    divan::main();
}

#[divan::bench]
fn reading_three_images() -> Vec3 {
    let Images { actual, reference, .. } = &*IMAGES;
    let images = [actual, &reference.mean, &reference.variance];
    black_box(images).iter().flat_map(|image| &image.pixels).sum()
}

#[divan::bench]
fn offline_at_16_spp() {
    let Images { actual, reference, tolerances } = &*IMAGES;
    drop(black_box(compare_offline(black_box(actual), reference, 16, tolerances)));
}

#[divan::bench]
fn realtime_in_linear_floats() {
    let Images { actual, reference: right, tolerances } = &*IMAGES;
    let (center, mask) = (&right.center, &right.mask);
    drop(black_box(compare_realtime_linear(black_box(actual), center, mask, tolerances)));
}

#[divan::bench]
fn realtime_in_8_bit_levels() {
    let Images { actual, reference: right, tolerances } = &*IMAGES;
    let (center, mask) = (&right.center, &right.mask);
    drop(black_box(compare_srgb8(black_box(actual), center, mask, tolerances)));
}
