use basecode::Sampler;

use super::*;

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;

#[test]
fn an_image_that_is_not_its_rays_is_found() {
    let mask = RegionMask::background(4, 3);
    let rays: Vec<[f32; 3]> = (0..12).map(|i| [i as f32; 3]).collect();
    assert_eq!(judge_agreement("s", &mask, &rays, &rays).verdict, Verdict::Pass);
    let flipped: Vec<[f32; 3]> =
        (0..3).rev().flat_map(|y| rays[4 * y..4 * y + 4].to_vec()).collect();
    let check = judge_agreement("s", &mask, &flipped, &rays);
    assert_eq!(check.verdict, Verdict::Fail);
    assert!(check.summary.contains("first at (0, 0)"), "{}", check.summary);
    assert_eq!(check.error, PriceClass::Slip.price(), "rows from bottom to top are one slip");
    let doubled: Vec<[f32; 3]> = rays.iter().map(|v| v.map(|v| 2.0 * v)).collect();
    assert_eq!(judge_agreement("s", &mask, &doubled, &rays).error, PriceClass::Slip.price());
    let black = [[0.0; 3]; 12];
    let nothing = judge_agreement("s", &mask, &black, &rays);
    assert_eq!((nothing.verdict, nothing.error), (Verdict::Fail, 1.0));
    assert_eq!(judge_agreement("s", &mask, &black, &black).verdict, Verdict::NotJudged);
}

/// Rings on a gradient, with nothing behind them on the right.
fn radiance(x: f32, y: f32) -> f32 {
    let r = ((x - 30.3) * (x - 30.3) + (y - 23.1) * (y - 23.1)).sqrt();
    if x > 58.3 || (r > 22.0 && r < 24.0) {
        0.0
    } else if ((r / 5.0) as u32).is_multiple_of(2) {
        2.0
    } else {
        0.5 + 0.01 * x
    }
}

fn own(film: &SampledFilm) -> Vec<[f32; 3]> {
    let rays = film.offsets.iter().enumerate();
    rays.map(|(index, [jx, jy])| {
        let pixel = index as u32 / RAYS;
        [radiance((pixel % WIDTH) as f32 + jx, (pixel / WIDTH) as f32 + jy); 3]
    })
    .collect()
}

/// A render whose samples of a pixel lie where `samples` says.
fn render(
    samples: impl Fn(&Sampler) -> Vec<[f32; 2]>,
    average: impl Fn(&[f32]) -> f32,
) -> Vec<[f32; 3]> {
    let sampler = Sampler::new(3);
    (0..WIDTH * HEIGHT)
        .map(|pixel| {
            let (x, y) = ((pixel % WIDTH) as f32, (pixel / WIDTH) as f32);
            let values = samples(&sampler).into_iter().map(|[jx, jy]| radiance(x + jx, y + jy));
            [average(&values.collect::<Vec<_>>()); 3]
        })
        .collect()
}

fn mean(values: &[f32]) -> f32 {
    values.iter().sum::<f32>() / values.len() as f32
}

fn independent(sampler: &Sampler) -> Vec<[f32; 2]> {
    (0..SAMPLES).map(|_| sampler.next_2d().into()).collect()
}

/// The van der Corput radical inverse in base 2.
fn inverse(mut i: u32) -> f32 {
    let (mut value, mut digit) = (0.0, 0.5);
    while i > 0 {
        value += digit * (i % 2) as f32;
        (i, digit) = (i / 2, digit / 2.0);
    }
    value
}

fn judge(image: &[[f32; 3]]) -> Check {
    let film = SampledFilm::new(WIDTH, HEIGHT);
    judge_samples("s", &film, image, &own(&film)).0
}

fn edges(image: &[[f32; 3]]) -> Edges {
    let film = SampledFilm::new(WIDTH, HEIGHT);
    judge_samples("s", &film, image, &own(&film)).1
}

#[test]
fn every_way_to_spread_samples_over_a_pixel_is_right() {
    let grid = |_: &Sampler| {
        (0..SAMPLES).map(|i| [i % 4, i / 4].map(|c| (c as f32 + 0.5) / 4.0)).collect()
    };
    let strata = |sampler: &Sampler| {
        let at = |c: u32| (c as f32 + sampler.next_1d()) / 4.0;
        (0..SAMPLES).map(|i| [at(i % 4), at(i / 4)]).collect()
    };
    // The first points of the Hammersley set and of a rank-1 lattice.
    let hammersley =
        |_: &Sampler| (0..SAMPLES).map(|i| [i as f32 / SAMPLES as f32, inverse(i)]).collect();
    let lattice = |_: &Sampler| {
        (0..SAMPLES).map(|i| [0.618_034, 0.754_878].map(|a: f32| (a * i as f32).fract())).collect()
    };
    type Samples<'a> = &'a dyn Fn(&Sampler) -> Vec<[f32; 2]>;
    let all: [(&str, Samples); 5] = [
        ("independent", &independent),
        ("grid", &grid),
        ("strata", &strata),
        ("Hammersley", &hammersley),
        ("lattice", &lattice),
    ];
    for (name, samples) in all {
        let check = judge(&render(samples, mean));
        assert_eq!(check.verdict, Verdict::Pass, "{name}: {check:?}");
        let edges = judge_edges(&edges(&render(samples, mean)));
        assert_eq!(edges.verdict, Verdict::Pass, "{name}: {edges:?}");
    }
}

/// On slanted edges alone, such samples are hardly farther off than independent ones.
#[test]
fn samples_on_one_line_of_their_pixels_are_found_by_what_the_line_sees() {
    let row = |sampler: &Sampler| (0..SAMPLES).map(|_| [sampler.next_1d(), 0.5]).collect();
    let column = |sampler: &Sampler| (0..SAMPLES).map(|_| [0.5, sampler.next_1d()]).collect();
    let nearly = |sampler: &Sampler| {
        let at = |sampler: &Sampler| 0.4 + 0.2 * sampler.next_1d();
        (0..SAMPLES).map(|_| [sampler.next_1d(), at(sampler)]).collect()
    };
    type Samples<'a> = &'a dyn Fn(&Sampler) -> Vec<[f32; 2]>;
    let all: [(&str, Samples); 3] = [("row", &row), ("column", &column), ("nearly", &nearly)];
    for (name, samples) in all {
        let check = judge_edges(&edges(&render(samples, mean)));
        let line = &check.measures[1];
        assert!(!line.passed && line.value > 0.6, "{name}: {line:?}");
        assert_eq!((check.verdict, check.error), (Verdict::Fail, PriceClass::Slip.price()));
    }
}

#[test]
fn samples_that_do_not_cover_their_pixels_are_found() {
    let repeat = |point: [f32; 2]| vec![point; SAMPLES as usize];
    type Samples<'a> = &'a dyn Fn(&Sampler) -> Vec<[f32; 2]>;
    let same = |sampler: &Sampler| (0..SAMPLES).map(|_| [sampler.next_1d(); 2]).collect();
    let one_axis = |sampler: &Sampler| (0..SAMPLES).map(|_| [sampler.next_1d(), 0.5]).collect();
    let shifted = |sampler: &Sampler| {
        (0..SAMPLES).map(|_| [sampler.next_1d() - 0.5, sampler.next_1d() - 0.5]).collect()
    };
    let quarter = |sampler: &Sampler| independent(sampler)[..4].to_vec();
    let all: [(&str, Samples); 5] = [
        ("none", &|_| repeat([0.5; 2])),
        ("the same number on both axes", &same),
        ("one axis", &one_axis),
        ("shifted by half a pixel", &shifted),
        ("a quarter of the samples", &quarter),
    ];
    for (name, samples) in all {
        let check = judge(&render(samples, mean));
        assert_eq!(check.verdict, Verdict::Fail, "{name}: {check:?}");
        assert!(check.error <= PriceClass::Slip.price(), "{name}: {check:?}");
    }
}

/// A BSDF that is not a number is paid in its own part.
#[test]
fn a_sample_that_is_not_a_number_beside_rays_that_are_none_is_not_the_loops() {
    let film = SampledFilm::new(WIDTH, HEIGHT);
    let mut rays = own(&film);
    let mut image = render(independent, mean);
    let pixel = |x: usize, y: usize| y * WIDTH as usize + x;
    rays[pixel(2, 23) * RAYS as usize] = [f32::NAN; 3];
    image[pixel(2, 23)] = [f32::NAN; 3];
    image[pixel(3, 24)] = [f32::NAN; 3];
    assert_eq!(judge_samples("s", &film, &image, &rays).0.verdict, Verdict::Pass);
    image[pixel(2, 26)] = [f32::NAN; 3];
    assert_eq!(judge_samples("s", &film, &image, &rays).0.verdict, Verdict::Fail);
    // In every other column, no pixel is left that tells anything.
    for pixel in rays.chunks_mut(RAYS as usize).step_by(2) {
        pixel[0] = [f32::INFINITY; 3];
    }
    assert_eq!(judge_samples("s", &film, &image, &rays).0.verdict, Verdict::NotJudged);
}

#[test]
fn single_pixels_that_are_never_written_or_written_over_are_a_slip() {
    let right = render(independent, mean);
    // Away from edges: where the gradient is, and on a ring.
    for index in [WIDTH as usize + 6, 23 * WIDTH as usize + 30] {
        for value in [0.0, 10.0, f32::NAN] {
            let mut image = right.clone();
            image[index] = [value; 3];
            let check = judge(&image);
            assert_eq!(
                (check.verdict, check.error),
                (Verdict::Fail, PriceClass::Slip.price()),
                "{check:?}"
            );
            assert!(check.summary.starts_with("1 of 3072"), "{}", check.summary);
        }
        let mut image = right.clone();
        image[index] = image[index].map(|v| 1.005 * v);
        assert_eq!(judge(&image).verdict, Verdict::Pass);
    }
    // The last pixel, with nothing behind it: 0 / 0 samples.
    let mut image = right;
    image[(WIDTH * HEIGHT) as usize - 1] = [f32::NAN; 3];
    let check = judge(&image);
    assert_eq!((check.verdict, check.error), (Verdict::Fail, PriceClass::Slip.price()));
}

#[test]
fn averages_are_judged_whatever_is_shaded() {
    let sum = |values: &[f32]| values.iter().sum();
    let one_more = |values: &[f32]| values.iter().sum::<f32>() / (values.len() + 1) as f32;
    for average in [&sum as &dyn Fn(&[f32]) -> f32, &one_more] {
        let check = judge(&render(independent, average));
        assert_eq!(check.verdict, Verdict::Fail);
        assert!(check.error < 1.2 * PriceClass::Slip.price(), "{check:?}");
    }
    let lit_only = |values: &[f32]| {
        let lit: Vec<f32> = values.iter().copied().filter(|v| *v > 0.0).collect();
        if lit.is_empty() { 0.0 } else { mean(&lit) }
    };
    let film = SampledFilm::new(WIDTH, HEIGHT);
    let (edge, _) = judge_samples("s", &film, &render(independent, lit_only), &own(&film));
    assert_eq!(edge.verdict, Verdict::Fail, "{edge:?}");
    let background = |values: &[f32]| mean(values) + if mean(values) == 0.0 { 0.2 } else { 0.0 };
    assert_eq!(judge(&render(independent, background)).verdict, Verdict::Fail);
    let black = judge(&render(independent, |_| 0.0));
    assert_eq!((black.verdict, black.error), (Verdict::Fail, 1.0));
    let broken = judge(&render(independent, |_| f32::NAN));
    assert!(broken.verdict == Verdict::Fail && broken.error > 0.9, "{broken:?}");
}

#[test]
fn slips_with_the_film_are_priced_and_other_pictures_are_not() {
    let (width, height) = (24, 16);
    let at = |x: usize, y: usize| {
        let (x, y) = (x as f32, y as f32);
        [0.2 + 0.03 * x, 0.5 + 0.01 * x * y, 1.0 + 0.05 * y]
    };
    let film = |value: &dyn Fn(usize, usize) -> [f32; 3]| -> Vec<[f32; 3]> {
        (0..width * height).map(|i| value(i % width, i / width)).collect()
    };
    let right = film(&at);
    let error =
        |image: &[[f32; 3]]| film_price((width, height), image, &right, &|_| Some(0.0), 1.0).error;
    let slips: [&dyn Fn(usize, usize) -> [f32; 3]; 5] = [
        &|x, y| at(x, height - 1 - y),
        &|x, y| at(x.saturating_sub(1), y),
        &|x, y| at(x, y).map(|v| 2.5 * v),
        &|x, y| at(x, y).map(|v| v.min(1.0)),
        &|x, y| {
            let [r, g, b] = at(x, y);
            [b, g, r]
        },
    ];
    for (index, slip) in slips.into_iter().enumerate() {
        let error = error(&film(slip));
        assert!((0.0199..0.03).contains(&error), "{index}: {error}");
    }
    // One color, and stripes that have nothing to do with the picture.
    let stripes = film(&|x, y| [0.5 + 0.5 * ((x * 7 + y * 13) % 5) as f32; 3]);
    assert!(error(&stripes) > 0.4, "{}", error(&stripes));
    assert_eq!(error(&film(&|_, _| [0.0; 3])), 1.0);
}

#[test]
fn edges_of_one_direction_are_seen_on_all_scenes_together() {
    let mut all = Edges::default();
    let mut one = Edges::default();
    one.spread[6] = (20, 36.0);
    assert_eq!(judge_edges(&one).verdict, Verdict::Pass, "too few to tell");
    (0..3).for_each(|_| all.add(&one));
    let check = judge_edges(&all);
    assert_eq!((check.verdict, check.error), (Verdict::Fail, PriceClass::Slip.price()));
    assert!((check.measures[0].value - 1.8).abs() < 1e-9, "{check:?}");
}
