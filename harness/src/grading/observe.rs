//! Keeps answers together with the geometry that they depend on, for the fits of the diagnosis. It keeps those of
//! public scenes only, since students read the diagnosis.

use basecode::{Image, MaterialModel, Ray, Scene, Vec3};

use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use crate::diagnosis::fit::{Bound, Reflector, Sample, ShadowRay, VertexSeen};
use crate::evidence::Witness;
use crate::evidence::bsdf::{BsdfKind, BsdfProbe};
use crate::evidence::stages::BoundValue;
use crate::expected::SurfacePoint;
use crate::imaging::reference::RegionMask;

/// Number of answers of each kind that are kept of a scene.
const KEPT: usize = 300;
/// How far behind the light occluders are looked for, in distances to it.
const REACH: f32 = 4.0;
/// Number of occluders of one ray that are looked for.
const MOST_OCCLUDERS: usize = 16;
/// Distance from the surface at which shadow rays start, relative to the light's distance: nearer hits are the surface
/// itself.
const START: f32 = 1e-4;
/// Fraction of a shape's pixels that must show the same value.
const SAME: f64 = 0.9;

/// Answers to the probes of a BSDF given by value.
pub fn bsdf(session: &Session, kind: BsdfKind, probes: &[BsdfProbe], values: &[[f32; 3]]) {
    let samples = probes.iter().zip(values).map(|(probe, value)| {
        let material = &probe.query.material;
        Sample {
            reflector: Reflector::Surface {
                phong: kind == BsdfKind::Phong,
                diffuse: material.diffuse.map(f64::from),
                specular: material.specular.map(f64::from),
                exponent: f64::from(material.exponent),
                unscaled: true,
            },
            wo: probe.query.wo.map(f64::from),
            wi: probe.query.wi.map(f64::from),
            distance: 1.0,
            intensity: [1.0; 3],
            found: value.map(f64::from),
        }
    });
    keep(session, if kind == BsdfKind::Phong { "1.2" } else { "1.1" }, samples);
}

/// Unshadowed radiance along lit rays under a witness.
pub fn radiance(session: &Session, case: &PreparedScene, witness: Witness, values: &[[f32; 3]]) {
    let batch = case.batch();
    let lit = batch.points[..batch.lit].iter().zip(values);
    let samples = few(lit, batch.lit).map(|(point, value)| {
        sample(Reflector::Witness(witness), point, batch.intensity, value.map(f64::from))
    });
    if !case.held_back {
        keep(session, "1.3", samples);
    }
}

/// Radiance with and without shadows under a witness.
pub fn shadows(session: &Session, case: &PreparedScene, with: &[[f32; 3]], without: &[[f32; 3]]) {
    let (batch, scene) = (case.batch(), &case.expected.scene);
    if case.held_back || !tells_visibility(batch.lit, without) {
        return;
    }
    let sum = |value: &[f32; 3]| value.iter().map(|&v| f64::from(v)).sum::<f64>();
    let asked: Vec<_> = batch.points.iter().zip(with.iter().zip(without)).collect();
    // Of a large lit floor and a small shadow, as many of either.
    let (lit, dark) = asked.split_at(batch.lit.min(asked.len()));
    let chosen = few(lit.iter(), lit.len()).chain(few(dark.iter(), dark.len()));
    let rays = chosen.filter_map(|&(point, (with, without))| {
        let found = sum(with) / sum(without);
        found.is_finite().then(|| ShadowRay {
            distance: f64::from(point.distance),
            occluders: occluders(scene, point),
            found,
        })
    });
    if let Ok(mut observations) = session.observations.lock() {
        observations.shadow_rays.extend(rays);
    }
}

/// Whether radiance without shadows tells of visibility: of the `lit` rays that come first most show light. What a
/// renderer shows of the others may be anything else's.
pub fn tells_visibility(lit: usize, without: &[[f32; 3]]) -> bool {
    let dark = without.iter().take(lit).filter(|value| **value == [0.0; 3]).count();
    2 * dark <= lit
}

/// How far off everything is that blocks light, from a point toward the light and beyond.
fn occluders(scene: &Scene, point: &SurfacePoint) -> Vec<f64> {
    let direction = (scene.first_light_position() - point.position) / point.distance;
    let step = START * point.distance.max(1.0);
    let (mut from, mut found) = (step, Vec::new());
    while found.len() < MOST_OCCLUDERS {
        let ray = Ray::segment(point.position, direction, from, REACH * point.distance);
        let Some(hit) = scene.intersect(&ray) else { break };
        let t = (hit.p - point.position).length();
        if !scene.material_of(hit.shape).is_emitter() {
            found.push(f64::from(t));
        }
        from = t.max(from) + step;
    }
    found
}

/// What one of the two fragment stages draws under a pass and a vertex stage of ours.
pub fn fragment(session: &Session, case: &PreparedScene, image: &Image, phong: bool) {
    let scene = &case.expected.scene;
    if case.held_back {
        return;
    }
    let own: Vec<(&SurfacePoint, &Vec3)> = interior(case)
        .filter(|(_, point)| {
            let model = scene.material_of(point.shape).model;
            model != MaterialModel::Mirror && (model == MaterialModel::Phong) == phong
        })
        .filter_map(|(index, point)| Some((point, image.pixels.get(index)?)))
        .collect();
    let count = own.len();
    let samples = few(own.into_iter(), count).map(|(point, pixel)| {
        let material = scene.material_of(point.shape);
        let color = |color: Vec3| (material.energy_scale() * color).to_array().map(f64::from);
        let reflector = Reflector::Surface {
            phong,
            diffuse: color(material.diffuse.average()),
            specular: color(material.specular.average()),
            exponent: f64::from(material.exponent),
            unscaled: false,
        };
        sample(reflector, point, scene.first_light_intensity(), pixel.to_array().map(f64::from))
    });
    keep(session, if phong { "2.4" } else { "2.3" }, samples);
}

/// The values that a student's pass bound, each shown by a frame.
pub fn pass(session: &Session, case: &PreparedScene, frames: &[(BoundValue, Image)]) {
    let (small, scene) = (&case.probe_film, &case.expected.scene);
    let Ok(camera) = scene.camera(small.surface.width, small.surface.height) else { return };
    let mut seen = Vec::new();
    for (bound, image) in frames {
        for (object, _) in scene.shapes().iter().enumerate() {
            let Some(expected) = bound.expected(scene, &camera, object) else { continue };
            let own = interior(case).filter(|(_, point)| point.shape == object);
            let values: Vec<Vec3> =
                own.filter_map(|(index, _)| image.pixels.get(index).copied()).collect();
            let Some(&first) = values.get(values.len() / 2) else { continue };
            let alike = values.iter().filter(|value| value.abs_diff_eq(first, 1e-4)).count();
            // Several values on one object are explained by none.
            let found = if alike as f64 >= SAME * values.len() as f64 { first } else { Vec3::NAN };
            seen.push(Bound {
                uniform: bound.name(),
                scene: case.entry.name.clone(),
                object,
                expected,
                found,
                scale: f64::from(scene.material_of(object).energy_scale()),
            });
        }
    }
    if let (Ok(mut observations), false) = (session.observations.lock(), case.held_back) {
        observations.bound.extend(seen);
    }
}

/// What a student's vertex stage forwards.
pub fn vertex(session: &Session, case: &PreparedScene, positions: &Image, normals: &Image) {
    let surface = &case.probe_film.surface;
    let (width, height) = (surface.width, surface.height);
    let Ok(camera) = case.expected.scene.camera(width, height) else { return };
    let (view, projection) = (camera.view(), camera.projection());
    let pixels = surface.pixels.iter().zip(&case.probe_film.unshadowed_mask.pixels).enumerate();
    let seen = pixels.filter_map(|(index, ((_, point), value))| {
        if value & (RegionMask::EDGE | RegionMask::EMITTER) != 0 {
            return None;
        }
        let (found_position, found_normal) = (positions.pixels[index], normals.pixels[index]);
        let ndc = |i: usize, of: usize| (2 * i + 1) as f64 / of as f64 - 1.0;
        let clip = projection * view * found_position.extend(1.0);
        Some(VertexSeen {
            position: point.as_ref().map_or(Vec3::NAN, |point| point.position),
            normal: point.as_ref().map_or(Vec3::NAN, |point| point.normal),
            found_position,
            found_normal,
            at: [ndc(index % width, width), -ndc(index / width, height)],
            belongs: [clip.x / clip.w, clip.y / clip.w].map(f64::from),
            view,
            projection,
        })
    });
    if let (Ok(mut observations), false) = (session.observations.lock(), case.held_back) {
        observations.vertices.extend(seen);
    }
}

/// Pixels of the small film away from edges and emitters, with what they show.
fn interior(case: &PreparedScene) -> impl Iterator<Item = (usize, &SurfacePoint)> {
    let small = &case.probe_film;
    let pixels = small.surface.pixels.iter().zip(&small.unshadowed_mask.pixels).enumerate();
    pixels.filter_map(|(index, ((_, point), value))| {
        let clear = value & (RegionMask::EDGE | RegionMask::EMITTER) == 0;
        point.as_ref().filter(|_| clear).map(|point| (index, point))
    })
}

fn sample(reflector: Reflector, point: &SurfacePoint, light: Vec3, found: [f64; 3]) -> Sample {
    let three = |v: Vec3| v.to_array().map(f64::from);
    Sample {
        reflector,
        wo: three(point.wo),
        wi: three(point.wi),
        distance: f64::from(point.distance),
        intensity: three(light),
        found,
    }
}

/// Every n-th of `count`, so that about [`KEPT`] are left.
fn few<T>(all: impl Iterator<Item = T>, count: usize) -> impl Iterator<Item = T> {
    all.step_by(count.div_ceil(KEPT).max(1))
}

fn keep(session: &Session, part: &'static str, samples: impl Iterator<Item = Sample>) {
    if let Ok(mut observations) = session.observations.lock() {
        observations.shaded.entry(part).or_default().extend(samples);
    }
}

/// Answers under a witness as colors, where there are any.
pub fn colors(outcome: &crate::worker::Outcome) -> Option<&[[f32; 3]]> {
    outcome.answer().map(|answer| session::colors(&answer.values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_rays_tell_nothing_of_visibility() {
        let of = |dark: usize| {
            let value = |ray| if ray < dark { [0.0; 3] } else { [0.0, 0.1, 0.0] };
            let mut without: Vec<[f32; 3]> = (0..100).map(value).collect();
            // Behind them those in shadow.
            without.extend([[1.0; 3]; 100]);
            tells_visibility(100, &without)
        };
        assert_eq!([0, 40, 60, 100].map(of), [true, true, false, false]);
    }
}
