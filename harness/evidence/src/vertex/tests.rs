use std::path::Path;

use super::*;
use crate::expected::{SurfaceBuffer, load_scene, regions};
use crate::price::PriceClass;

const FILM: (usize, usize) = (64, 48);

/// What a right vertex stage forwards on a scene of several objects, and what is done to it.
struct Fixture {
    scene: Scene,
    surface: SurfaceBuffer,
    mask: RegionMask,
    positions: Image,
    normals: Image,
}

impl Fixture {
    fn new() -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let scene = load_scene(&root.join("scenes/a2/cbox/tinyrender/cbox_simple_offline.toml"));
        let scene = scene.unwrap();
        let (width, height) = FILM;
        let surface = SurfaceBuffer::new(&scene, width, height).unwrap();
        let [_, mask] = regions(&scene, width, height).unwrap();
        let image = |value: &dyn Fn(&SurfacePoint) -> Vec3| {
            let of =
                |(_, point): &(Ray, Option<SurfacePoint>)| point.as_ref().map_or(Vec3::ZERO, value);
            Image { width, height, pixels: surface.pixels.iter().map(of).collect() }
        };
        let (positions, normals) = (image(&|p| p.position), image(&|p| p.normal));
        Self { scene, surface, mask, positions, normals }
    }

    fn judge(&self, frames: [Frames; MATRICES]) -> Check {
        let (width, height) = FILM;
        let camera = self.scene.camera(width, height).unwrap();
        let (scene, surface, mask) = (&self.scene, &self.surface, &self.mask);
        judge_vertex("s", &StageFilm { scene, camera, surface, mask }, frames)
    }

    /// The same frames whatever the matrices.
    fn judge_all(&self, positions: &Image, normals: &Image) -> Check {
        self.judge([[positions, normals]; MATRICES])
    }
}

fn changed(image: &Image, change: impl Fn(Vec3) -> Vec3) -> Image {
    Image { pixels: image.pixels.iter().map(|v| change(*v)).collect(), ..image.clone() }
}

fn black(image: &Image) -> Image {
    changed(image, |_| Vec3::ZERO)
}

fn upside_down(image: &Image) -> Image {
    let rows = image.pixels.chunks(image.width).rev();
    Image { pixels: rows.flatten().copied().collect(), ..image.clone() }
}

#[track_caller]
fn fails(check: &Check, classes: &[PriceClass], mistake: &str) {
    let error: f64 = classes.iter().map(|class| class.price()).sum();
    assert_eq!(check.verdict, Verdict::Fail, "{}", check.summary);
    assert!(
        (check.error - error).abs() < 1e-9,
        "{} is not {error}: {}",
        check.error,
        check.summary
    );
    assert!(check.mistake.contains(mistake), "{:?}", check.mistake);
}

#[test]
fn right_attributes_pass_whatever_the_matrices() {
    let fixture = Fixture::new();
    let check = fixture.judge_all(&fixture.positions, &fixture.normals);
    assert_eq!(check.verdict, Verdict::Pass, "{}", check.summary);
    assert!(check.measures.iter().all(|measure| measure.passed));
}

#[test]
fn a_slip_with_one_attribute_costs_a_slip() {
    let fixture = Fixture::new();
    let (positions, normals) = (&fixture.positions, &fixture.normals);
    let normal =
        |change: &dyn Fn(Vec3) -> Vec3| fixture.judge_all(positions, &changed(normals, change));
    fails(&normal(&|n| -n), &[PriceClass::Slip], "negated");
    fails(
        &normal(&|n| Vec3::new(n.x, -n.y, n.z)),
        &[PriceClass::Slip],
        "y of the normal is negated",
    );
    fails(&normal(&|n| Vec3::new(n.z, n.y, n.x)), &[PriceClass::Slip], "axes exchanged");
    let position = changed(positions, |p| p / 2.0);
    fails(&fixture.judge_all(&position, normals), &[PriceClass::Slip], "multiplied by a constant");
    // Few of the positions are right then, by chance: their place tells nothing.
    let [exchanged, mirrored] = [Vec3::new(1.0, 1.0, 1.0), Vec3::new(-1.0, 1.0, 1.0)]
        .map(|signs| changed(positions, |p| signs * Vec3::new(p.x, p.z, p.y)));
    fails(&fixture.judge_all(&exchanged, normals), &[PriceClass::Slip], "position has its axes");
    fails(&fixture.judge_all(&mirrored, normals), &[PriceClass::Concept], "another world position");
    let negated = changed(positions, |p| Vec3::new(p.x, -p.y, p.z));
    fails(
        &fixture.judge_all(&negated, normals),
        &[PriceClass::Slip],
        "y of the position is negated",
    );
    let direction = changed(positions, Vec3::normalize_or_zero);
    fails(
        &fixture.judge_all(positions, &direction),
        &[PriceClass::Slip],
        "position stands for the normal",
    );
    let (positions, normals) = (upside_down(positions), upside_down(normals));
    fails(&fixture.judge_all(&positions, &normals), &[PriceClass::Slip], "upside down");
}

#[test]
fn what_is_no_slip_costs_a_concept_and_two_things_cost_both() {
    let fixture = Fixture::new();
    let (positions, normals) = (&fixture.positions, &fixture.normals);
    let up = changed(normals, |_| Vec3::Y);
    fails(&fixture.judge_all(positions, &up), &[PriceClass::Concept], "another world normal");
    let bent = changed(positions, |p| p + 0.3 * Vec3::new(p.y.sin(), p.z.cos(), p.x));
    fails(&fixture.judge_all(&bent, normals), &[PriceClass::Concept], "another world position");
    let negated = changed(normals, |n| -n);
    fails(&fixture.judge_all(&bent, &negated), &[PriceClass::Concept, PriceClass::Slip], "several");
    let none = changed(positions, |_| Vec3::splat(f32::NAN));
    assert_eq!(fixture.judge_all(&none, normals).verdict, Verdict::Fail);
}

#[test]
fn matrices_tell_which_of_them_is_missing() {
    let fixture = Fixture::new();
    let right = [&fixture.positions, &fixture.normals];
    let nothing = black(&fixture.positions);
    let nothing: Frames = [&nothing, &nothing];
    let judge = |frames| fixture.judge(frames);
    fails(
        &judge([nothing, right, nothing, nothing, nothing]),
        &[PriceClass::Concept],
        "projection is missing",
    );
    fails(
        &judge([nothing, nothing, right, nothing, nothing]),
        &[PriceClass::Concept],
        "view matrix is missing",
    );
    fails(&judge([nothing, right, right, nothing, nothing]), &[PriceClass::Slip], "exchanged");
    fails(&judge([nothing, nothing, nothing, right, nothing]), &[PriceClass::Slip], "on the left");
    // Frames that show nothing at all tell nothing of what is forwarded.
    let all = judge([nothing; MATRICES]);
    assert_eq!((all.verdict, all.error), (Verdict::Fail, 1.0), "{}", all.summary);
}

#[test]
fn a_translation_or_perspective_that_is_lost_is_a_slip() {
    let fixture = Fixture::new();
    let (width, height) = FILM;
    let (scene, nothing) = (&fixture.scene, black(&fixture.positions));
    let camera = scene.camera(width, height).unwrap();
    let config = crate::stage_film::from_origin(scene);
    let from_origin = basecode::Camera::new(config, width, height).unwrap();
    let seen = |index: usize| {
        let (x, y) = ((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
        // The origin lies on the floor.
        SurfacePoint::cast(scene, Ray { min_t: 0.05, ..from_origin.ray(x, y) })
    };
    let seen: Vec<Option<SurfacePoint>> = (0..width * height).map(seen).collect();
    let image = |of: &dyn Fn(&SurfacePoint) -> Vec3| {
        let pixels = seen.iter().map(|point| point.as_ref().map_or(Vec3::ZERO, of)).collect();
        Image { width, height, pixels }
    };
    let (positions, normals) = (image(&|p| p.position), image(&|p| p.normal));
    let (nothing, moved): (Frames, Frames) = ([&nothing, &nothing], [&positions, &normals]);
    let all = [nothing, nothing, nothing, nothing, moved];
    fails(&fixture.judge(all), &[PriceClass::Slip], "translation");
    let right: Frames = [&fixture.positions, &fixture.normals];
    let all = [nothing, nothing, nothing, nothing, right];
    assert_eq!(fixture.judge(all).error, 1.0, "elsewhere than these matrices put it");
    let to_clip = camera.projection() * camera.view();
    let flat = |point: &SurfacePoint| point.without_perspective(scene, to_clip).unwrap_or(*point);
    let shown = |of: &dyn Fn(SurfacePoint) -> Vec3| {
        let value = |(_, point): &(Ray, Option<SurfacePoint>)| {
            point.as_ref().map_or(Vec3::ZERO, |point| of(flat(point)))
        };
        Image { width, height, pixels: fixture.surface.pixels.iter().map(value).collect() }
    };
    let check = fixture.judge_all(&shown(&|p| p.position), &shown(&|p| p.normal));
    fails(&check, &[PriceClass::Slip], "perspective");
}
