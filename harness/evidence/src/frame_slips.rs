//! Slips in what reaches a fragment stage, such as a wrong normal or a uniform that is not set: how far each explains
//! an unshadowed realtime image. They are slips of the render pass or of the vertex stage.

use basecode::glam::{DMat4, DVec3};
use basecode::{Camera, Image, MaterialModel, Scene, Vec3};
use renderer_api as api;

use super::CheckId;
use super::pixels::{LEAST_LEFT, Looked, Places, RELATIVE};
use super::price::{self, Answers, SURFACES_MISSING, few_of, surely_more_than};
use super::shading::{ShadedPoint, Shading};
use super::vertex::other_normals;
use crate::expected::SurfacePoint;
use imaging::reference::RegionMask;

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

/// What an image shows of surfaces if some of them are not drawn.
struct Missing {
    /// Fraction of the points that show neither their surface, nor one behind it, nor nothing.
    left: f64,
    /// Lit points that show their own surface, diffuse and Phong ones.
    shown: [usize; 2],
}

/// So many surfaces behind another are looked at.
const BEHIND: usize = 8;

impl Missing {
    fn of(frame: &FrameSlips, pixels: &[usize]) -> Self {
        let FrameSlips { scene, places, looked, mean, .. } = frame;
        let shows = |point: &SurfacePoint, found: &[f32; 3]| {
            let right = radiance(&places.shaded_point(scene, point));
            let is_close = |c: usize| {
                let apart = (f64::from(found[c]) - right[c]).abs();
                apart <= RELATIVE * right[c].abs() + 1e-3 * mean
            };
            [0, 1, 2].into_iter().all(is_close)
        };
        let shows_behind = |point: &SurfacePoint, found: &[f32; 3]| {
            let mut ray = point.ray;
            for _ in 0..BEHIND {
                let Some(hit) = scene.intersect(&ray) else { return false };
                ray.min_t = hit.t + hit.epsilon;
                if SurfacePoint::cast(scene, ray).is_some_and(|next| shows(&next, found)) {
                    return true;
                }
            }
            false
        };
        let (mut left, mut shown) = (0usize, [0usize; 2]);
        for &pixel in pixels {
            let (point, found) = (&looked.surfaces[pixel], &looked.found[pixel]);
            if shows(point, found) {
                let lit = found.iter().any(|value| f64::from(*value) > 1e-2 * mean);
                let phong = scene.material_of(point.shape).model == MaterialModel::Phong;
                shown[usize::from(phong)] += usize::from(lit);
            } else if *found != [0.0; 3] && !shows_behind(point, found) {
                left += 1;
            }
        }
        Self { left: left as f64 / pixels.len().max(1) as f64, shown }
    }
}

/// Where a direction lies in the surface, as from the origin on a floor through it, rounding decides what is black.
const GRAZING: f64 = 1e-3;

/// What a right stage makes of a point after a slip; `None` if that is not known.
type Shaded<'a> = Box<dyn Fn(&SurfacePoint) -> Option<ShadedPoint> + 'a>;

/// What a slip makes of a point; `None` if that is not known.
type Moved<'a> = Box<dyn Fn(&SurfacePoint) -> Option<SurfacePoint> + 'a>;

/// A slip in what reaches a fragment stage.
struct Slip<'a> {
    of: CheckId,
    name: &'static str,
    shaded: Shaded<'a>,
}

/// Slips with the values that a pass binds.
fn pass_slips<'a>(scene: &'a Scene, right: Places) -> Vec<Slip<'a>> {
    let slip = |name, shaded: Shaded<'a>| Slip { of: CheckId::PassUniforms, name, shaded };
    let at = |name, places: Places| {
        slip(name, Box::new(move |point| Some(places.shaded_point(scene, point))))
    };
    let changed = |name, change: fn(&mut ShadedPoint)| {
        let shaded = move |point: &SurfacePoint| {
            let mut shaded = right.shaded_point(scene, point);
            change(&mut shaded);
            Some(shaded)
        };
        slip(name, Box::new(shaded))
    };
    let beside = |name, by: isize| {
        let shaded = move |point: &SurfacePoint| {
            let other =
                point.shape.checked_add_signed(by).filter(|at| *at < scene.shapes().len())?;
            let is_drawn = !scene.material_of(other).is_emitter();
            is_drawn.then(|| right.with_material(scene, other, point))
        };
        slip(name, Box::new(shaded))
    };
    vec![
        at(price::VIEWER_AT_ORIGIN, Places { eye: Vec3::ZERO, ..right }),
        at(price::LIGHT_AT_ORIGIN, Places { light: Vec3::ZERO, ..right }),
        at("the light stands where the viewer does", Places { light: right.eye, ..right }),
        changed("the intensity is missing", |p| p.intensity = [1.0; 3]),
        changed("the intensity is grey", |p| p.intensity = [p.intensity[0]; 3]),
        changed("the intensity is divided by 4 pi", |p| {
            p.intensity = p.intensity.map(|v| v / (2.0 * std::f64::consts::TAU));
        }),
        changed("rho_d and rho_s are exchanged", |p| {
            std::mem::swap(&mut p.material.diffuse, &mut p.material.specular);
        }),
        changed("albedos are grey", |p| {
            p.material.diffuse = [p.material.diffuse[0]; 3];
            p.material.specular = [p.material.specular[0]; 3];
        }),
        changed("albedos without the energy scale", |p| p.scale = 1.0),
        changed("the energy scale twice", |p| p.scale *= p.scale),
        beside("every surface is drawn with the material of the next one", 1),
        beside("every surface is drawn with the material of the one before", -1),
    ]
}

/// Slips with positions and normals. Positions may come from the depth of a pixel.
fn vertex_slips<'a>(scene: &'a Scene, camera: &Camera, right: Places) -> Vec<Slip<'a>> {
    let (view, projection) = (camera.view(), camera.projection());
    let to_clip = projection * view;
    let slip = |name, changed: Moved<'a>| Slip {
        of: CheckId::StageVertex,
        name,
        shaded: Box::new(move |point| Some(right.shaded_point(scene, &changed(point)?))),
    };
    let moved = |name, position: Box<dyn Fn(Vec3) -> Vec3>| {
        let changed = move |point: &SurfacePoint| {
            let position = position(point.position);
            position.is_finite().then_some(SurfacePoint { position, ..*point })
        };
        slip(name, Box::new(changed))
    };
    // Depth has few digits: in f64.
    let [precise, exchanged] =
        [projection.as_dmat4() * view.as_dmat4(), view.as_dmat4() * projection.as_dmat4()];
    let from_film = |name, back: DMat4, other: fn(DVec3) -> DVec3| {
        let there = move |p: Vec3| other(precise.project_point3(p.as_dvec3()));
        moved(name, Box::new(move |p| back.project_point3(there(p)).as_vec3()))
    };
    let back = precise.inverse();
    let mut slips = vec![
        moved(
            "the position is not divided by its w",
            Box::new(move |p| p / (to_clip * p.extend(1.0)).w),
        ),
        moved("positions are in view space", Box::new(move |p| view.transform_point3(p))),
        from_film("the inverse is that of view * projection", exchanged.inverse(), |ndc| ndc),
        from_film("positions are upside down", back, |ndc| DVec3::new(ndc.x, -ndc.y, ndc.z)),
        from_film("positions are mirrored", back, |ndc| DVec3::new(-ndc.x, ndc.y, ndc.z)),
        from_film("positions are turned by half", back, |ndc| DVec3::new(-ndc.x, -ndc.y, ndc.z)),
        from_film("depth is taken from -1 to 1", back, |ndc| ndc.with_z(2.0 * ndc.z - 1.0)),
        from_film("the place on the film is taken from 0 to 1", back, |ndc| {
            DVec3::new(0.5 + 0.5 * ndc.x, 0.5 - 0.5 * ndc.y, ndc.z)
        }),
        slip(
            "values lose their perspective",
            Box::new(move |point| point.without_perspective(scene, to_clip)),
        ),
    ];
    let mut normals = other_normals();
    normals.push(("the normal is not decoded", Box::new(|p| 0.5 * p.normal + 0.5)));
    normals.push(("the normal is decoded twice", Box::new(|p| 2.0 * p.normal - 1.0)));
    slips.extend(normals.into_iter().map(|(name, other)| {
        let changed = move |point: &SurfacePoint| {
            Some(SurfacePoint { normal: other(point).try_normalize()?, ..*point })
        };
        slip(name, Box::new(changed))
    }));
    slips
}

/// Number of points by which the material of a shape is known.
const POINTS_PER_SHAPE: usize = 100;

/// What a right stage makes of points if each shape has the material of whichever explains best what is found there.
fn materials_of_others<'a>(scene: &'a Scene, right: Places, looked: &Looked) -> Shaded<'a> {
    let count = scene.shapes().len();
    let apart = |shape: usize, other: usize| -> f64 {
        let own = looked.surfaces.iter().zip(&looked.found);
        let own: Vec<_> = own.filter(|(point, _)| point.shape == shape).collect();
        let few = own.iter().step_by(own.len().div_ceil(POINTS_PER_SHAPE).max(1));
        let differences = few.flat_map(|(point, found)| {
            let drawn = radiance(&right.with_material(scene, other, point));
            [0, 1, 2].map(|c| (drawn[c] - f64::from(found[c])).abs())
        });
        differences.sum()
    };
    let best = |shape: usize| {
        let by_fit = |a: &usize, b: &usize| apart(shape, *a).total_cmp(&apart(shape, *b));
        let drawn = (0..count).filter(|other| !scene.material_of(*other).is_emitter());
        drawn.min_by(by_fit).unwrap_or(shape)
    };
    let of: Vec<usize> = (0..count).map(best).collect();
    Box::new(move |point| Some(right.with_material(scene, of[point.shape], point)))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

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
