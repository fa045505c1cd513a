//! Slips in what reaches a fragment stage, such as a wrong normal or a uniform that is not set: how far each explains
//! an unshadowed realtime image. They are slips of the render pass or of the vertex stage.

mod missing;
mod slips;

use basecode::{Image, Scene};
use renderer_api as api;

use super::CheckId;
use super::answers::{Answers, few_of, surely_more_than};
use super::pixels::{LEAST_LEFT, Looked, Places, RELATIVE};
use super::price::SURFACES_MISSING;
use super::shading::{ShadedPoint, Shading};
use crate::expected::SurfacePoint;
use imaging::reference::RegionMask;
use missing::Missing;
use slips::{Slip, materials_of_others, pass_slips, vertex_slips};

/// A frame beside what each slip makes of its scene.
pub struct FrameSlips<'a> {
    scene: &'a Scene,
    places: Places,
    looked: Looked,
    /// The mean of what is right, over pixels and channels.
    mean: f64,
    /// What is right leaves so much of the frame unexplained.
    left_by_right: f64,
    slips: Vec<Slip<'a>>,
}

/// What a slip leaves of an image unexplained.
pub struct LeftBySlip {
    /// Sum of differences from what it draws over the sum of that, at most 1.
    pub left: f64,
    /// The same of what is right.
    pub left_by_right: f64,
    /// Whether it draws any light: one black image is as good as another.
    pub lights: bool,
    /// What is left on diffuse and on Phong surfaces alone, where it draws light on them.
    pub left_of_lit: [Option<f64>; 2],
}

impl<'a> FrameSlips<'a> {
    /// An unshadowed realtime image of a scene, whose regions are in `mask`; `None` if the scene has no camera.
    pub fn new(scene: &'a Scene, image: &Image, mask: &RegionMask) -> Option<Self> {
        let camera = scene.camera(image.width, image.height).ok()?;
        let looked = Looked::at(scene, &camera, image, mask, &|_| true);
        let places = Places { light: scene.first_light_position(), eye: camera.eye() };
        let right = |point: &SurfacePoint| radiance(&places.shaded_point(scene, point));
        let right: Vec<[f64; 3]> = looked.surfaces.iter().map(right).collect();
        let sum: f64 = right.iter().flatten().sum();
        let mean = (sum / (3 * right.len()).max(1) as f64).max(f64::MIN_POSITIVE);
        let mut slips = pass_slips(scene, places);
        slips.extend(vertex_slips(scene, &camera, places));
        slips.push(Slip {
            of: CheckId::PassUniforms,
            name: "surfaces are drawn with the material of others",
            shaded: materials_of_others(scene, places, &looked),
        });
        let left_by_right = left(&right, &looked.found, mean);
        Some(Self { scene, places, looked, mean, left_by_right, slips })
    }

    /// What each slip belongs to, and its name. The last one is [`SURFACES_MISSING`].
    pub fn names(&self) -> Vec<(CheckId, &'static str)> {
        let missing = (CheckId::PassUniforms, SURFACES_MISSING);
        self.slips.iter().map(|slip| (slip.of, slip.name)).chain([missing]).collect()
    }

    /// Whether a few pixels tell that the slip at `index` leaves more than `most` unexplained.
    pub fn surely_leaves_more(&self, index: usize, most: f64) -> bool {
        let few = few_of(&Vec::from_iter(0..self.looked.surfaces.len()));
        self.left_on(index, &few).left > surely_more_than(most)
    }

    /// What the slip at `index` leaves unexplained.
    pub fn left(&self, index: usize) -> LeftBySlip {
        self.left_on(index, &Vec::from_iter(0..self.looked.surfaces.len()))
    }

    fn left_on(&self, index: usize, pixels: &[usize]) -> LeftBySlip {
        match self.slips.get(index) {
            Some(slip) => self.left_by(slip, pixels),
            None => self.left_by_missing(pixels),
        }
    }

    fn left_by(&self, slip: &Slip, pixels: &[usize]) -> LeftBySlip {
        let Self { looked, mean, left_by_right, .. } = self;
        let told = pixels.iter().filter_map(|&pixel| {
            Some(((slip.shaded)(&looked.surfaces[pixel])?, looked.found[pixel]))
        });
        let grazes = |p: &ShadedPoint| p.wo[2].abs() < GRAZING || p.wi[2].abs() < GRAZING;
        let told = told.filter(|(shaded, _)| !grazes(shaded));
        let told: Vec<Told> = told
            .map(|(shaded, found)| Told {
                model: shaded.material.model,
                changed: radiance(&shaded),
                found,
            })
            .collect();
        let left_of = |wanted: &dyn Fn(&Told) -> bool| {
            let own = told.iter().filter(|told| wanted(told));
            let (changed, found): (Vec<_>, Vec<_>) =
                own.map(|told| (told.changed, told.found)).unzip();
            (found.len(), left(&changed, &found, *mean))
        };
        let left_of_lit = [api::MATERIAL_DIFFUSE, api::MATERIAL_PHONG].map(|model| {
            let (shown, left) = left_of(&|told| told.model == model && told.changed != [0.0; 3]);
            (shown >= LEAST_SHOWN).then_some(left)
        });
        // A scene of which little is left tells nothing of this slip.
        let tells = 4 * told.len() >= pixels.len();
        let total: f64 = told.iter().flat_map(|told| told.changed).filter(|v| v.is_finite()).sum();
        let lights = tells && total >= LEAST_LEFT * 3.0 * mean * told.len() as f64;
        let left = if tells { left_of(&|_| true).1 } else { 0.0 };
        LeftBySlip { left, left_by_right: *left_by_right, lights, left_of_lit }
    }

    fn left_by_missing(&self, pixels: &[usize]) -> LeftBySlip {
        let missing = Missing::of(self, pixels);
        LeftBySlip {
            left: missing.left,
            left_by_right: self.left_by_right,
            lights: missing.shown.iter().sum::<usize>() >= LEAST_SHOWN,
            left_of_lit: missing.shown.map(|shown| (shown >= LEAST_SHOWN).then_some(missing.left)),
        }
    }
}

/// A pixel of which a slip tells what it draws.
struct Told {
    model: u32,
    changed: [f64; 3],
    found: [f32; 3],
}

/// What a right stage draws of a point.
fn radiance(shaded: &ShadedPoint) -> [f64; 3] {
    Shading::default().radiance(shaded)
}

/// What `changed` leaves unexplained of what was found, at most 1.
fn left(changed: &[[f64; 3]], found: &[[f32; 3]], mean: f64) -> f64 {
    let (of, unit) = (|index: usize, _: &Shading| changed[index], |_| mean);
    let group = |_| 0;
    let answers =
        Answers { found, of: &of, unit: &unit, group: &group, relative: RELATIVE, changes: &[] };
    answers.residual_of_right().min(1.0)
}

/// Number of points that tell something of surfaces.
const LEAST_SHOWN: usize = 10;

/// Where a direction lies in the surface, as from the origin on a floor through it, rounding decides what is black.
const GRAZING: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use std::path::Path;

    use basecode::Vec3;

    use super::*;
    use crate::expected::{load_scene, regions};

    /// The names that explain what a right stage draws of a scene with its points changed so.
    fn explained(change: &dyn Fn(&mut ShadedPoint), at: &dyn Fn(&mut Places)) -> Vec<&'static str> {
        explained_of(EXPONENTS, &|scene, places, point| {
            let mut places = *places;
            at(&mut places);
            let mut shaded = places.shaded_point(scene, point);
            change(&mut shaded);
            shaded
        })
    }

    const EXPONENTS: &str = "probes/exponents/tinyrender/exponents_realtime.toml";
    const BOX: &str = "cbox/tinyrender/cbox_simple_realtime.toml";

    /// The names that explain what a right stage draws of such points of a scene.
    fn explained_of(
        scene: &str,
        of: &dyn Fn(&Scene, &Places, &SurfacePoint) -> ShadedPoint,
    ) -> Vec<&'static str> {
        let (width, height) = (64, 48);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let scene = root.join("scenes/a2").join(scene);
        let scene = load_scene(&scene).unwrap();
        let [_, mask] = regions(&scene, width, height).unwrap();
        let camera = scene.camera(width, height).unwrap();
        let places = Places { light: scene.first_light_position(), eye: camera.eye() };
        let pixel = |index: usize| {
            let ray = camera.ray((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let Some(point) = SurfacePoint::cast(&scene, ray) else { return Vec3::ZERO };
            let shaded = of(&scene, &places, &point);
            Vec3::from(Shading::default().radiance(&shaded).map(|value| value as f32))
        };
        let pixels = (0..width * height).map(pixel).collect();
        let slips = FrameSlips::new(&scene, &Image { width, height, pixels }, &mask).unwrap();
        let explains = |index: usize| {
            let left = slips.left(index);
            let explains = left.left < 1e-3 && left.lights;
            assert!(!explains || !slips.surely_leaves_more(index, 1e-3));
            explains
        };
        // What is dark may be missing as well: where there are holes, nobody's pixels tell.
        let names = slips.names().into_iter().map(|(_, name)| name).enumerate();
        let names = names.filter(|(index, name)| *name != SURFACES_MISSING && explains(*index));
        names.map(|(_, name)| name).collect()
    }

    /// What the slip that surfaces are missing leaves of right pictures that are changed so, by pixel; and whether
    /// diffuse and Phong surfaces are shown.
    fn left_by_missing(change: &dyn Fn(usize, Vec3) -> Vec3) -> (f64, [bool; 2]) {
        let (width, height) = (64, 48);
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        let scene = load_scene(&root.join("scenes/a2").join(EXPONENTS)).unwrap();
        let [_, mask] = regions(&scene, width, height).unwrap();
        let camera = scene.camera(width, height).unwrap();
        let places = Places { light: scene.first_light_position(), eye: camera.eye() };
        let pixel = |index: usize| {
            let ray = camera.ray((index % width) as f32 + 0.5, (index / width) as f32 + 0.5);
            let point = SurfacePoint::cast(&scene, ray);
            let right = point.map_or([0.0; 3], |point| {
                Shading::default().radiance(&places.shaded_point(&scene, &point))
            });
            change(index, Vec3::from(right.map(|value| value as f32)))
        };
        let pixels = (0..width * height).map(pixel).collect();
        let slips = FrameSlips::new(&scene, &Image { width, height, pixels }, &mask).unwrap();
        let own = slips.left(slips.names().len() - 1);
        (own.left, own.left_of_lit.map(|left| left.is_some()))
    }

    #[test]
    fn surfaces_that_are_missing_leave_the_others_right() {
        let some = left_by_missing(&|index, right| if index % 3 == 0 { Vec3::ZERO } else { right });
        assert_eq!(some.0, 0.0);
        assert!(some.1.contains(&true));
        // Nothing that is drawn shows of a black picture that it is right, and what is drawn darker is not.
        assert_eq!(left_by_missing(&|_, _| Vec3::ZERO).1, [false; 2]);
        assert!(left_by_missing(&|_, right| 0.5 * right).0 > 0.5);
    }

    #[test]
    fn a_slip_in_the_values_of_a_pass_is_told_by_its_pictures() {
        let exchanged = |point: &mut ShadedPoint| {
            std::mem::swap(&mut point.material.diffuse, &mut point.material.specular);
        };
        assert_eq!(explained(&exchanged, &|_| ()), ["rho_d and rho_s are exchanged"]);
        let light = |places: &mut Places| places.light = places.eye;
        let at_viewer = "the light stands where the viewer does";
        assert_eq!(explained(&|_| (), &light), [at_viewer]);
        // What is right, black or a shader's own needs no pass.
        let none: [&str; 0] = [];
        assert_eq!(explained(&|point| point.intensity = [0.0; 3], &|_| ()), none);
        assert_eq!(explained(&|point| point.material.specular = [0.0; 3], &|_| ()), none);
    }

    #[test]
    fn a_slip_with_positions_normals_or_materials_is_told_by_its_pictures() {
        let moved = |change: &dyn Fn(&Scene, Vec3) -> Vec3| {
            explained_of(EXPONENTS, &|scene, places, point| {
                let position = change(scene, point.position);
                places.shaded_point(scene, &SurfacePoint { position, ..*point })
            })
        };
        let to_clip = |scene: &Scene| {
            let camera = scene.camera(64, 48).unwrap();
            camera.projection() * camera.view()
        };
        let undivided = moved(&|scene, p| p / (to_clip(scene) * p.extend(1.0)).w);
        assert_eq!(undivided, ["the position is not divided by its w"]);
        let upside_down = moved(&|scene, p| {
            let to_clip = to_clip(scene);
            let ndc = to_clip.project_point3(p);
            to_clip.inverse().project_point3(Vec3::new(ndc.x, -ndc.y, ndc.z))
        });
        assert_eq!(upside_down, ["positions are upside down"]);
        let turned = explained_of(BOX, &|scene, places, point| {
            let normal = Vec3::new(point.normal.x, point.normal.y, -point.normal.z);
            places.shaded_point(scene, &SurfacePoint { normal, ..*point })
        });
        assert_eq!(turned, ["z of the normal is negated"]);
        let material = |of: &dyn Fn(usize, usize) -> usize| {
            explained_of(EXPONENTS, &|scene, places, point| {
                places.with_material(scene, of(point.shape, scene.shapes().len()), point)
            })
        };
        let others = "surfaces are drawn with the material of others";
        let next = material(&|shape, count| (shape + 1) % count);
        assert_eq!(next, ["every surface is drawn with the material of the next one"]);
        let first = material(&|_, _| 0);
        assert_eq!(first, [others]);
        // All of it at once is no slip.
        let none: [&str; 0] = [];
        assert_eq!(moved(&|_, p| 0.5 * p + Vec3::splat(0.3)), none);
    }
}
