//! The offline path: BSDFs, integrator, shadows, loop and images of a plugin.

use std::path::Path;

use basecode::{Camera, Image, MaterialModel, Ray, Scene, Texture, Vec3};

use super::conventions::{Answers, shaded_point, value};
use super::observe;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use crate::diagnosis::{self, LoopSeen, Thumbnail, View};
use crate::evidence::images::{self, Kind};
use crate::evidence::price::Class;
use crate::evidence::shading::{ShadedPoint, Shading};
use crate::evidence::{Check, CheckId, Verdict};
use crate::evidence::{loops, rays};
use crate::expected::{Expected, SurfacePoint};
use crate::imaging::evidence::Tolerances;
use crate::plugin::Witness;
use crate::worker::{BsdfQuery, BsdfSource, Outcome, RayQuery, Request};

/// The witnesses that an integrator is judged under, with their names for reports.
const WITNESSES: [(Witness, &str); 4] = [
    (Witness::Constant([0.3, 0.2, 0.1]), "constant"),
    (Witness::OfWi, "a function of wi"),
    (Witness::OfWo, "a function of wo"),
    (Witness::OfAngle, "a function of the angle between wi and wo"),
];

/// The witness that visibility is judged under: a wrong frame must not look like a shadow.
const FLAT: Witness = Witness::Flat([0.3, 0.2, 0.1]);

/// An image that was drawn, kept for pictures and for the comparison with what was submitted.
pub struct Drawn {
    /// Name of the scene.
    pub scene: String,
    /// How it came about.
    pub kind: Kind,
    /// The image.
    pub image: Image,
}

/// How a plugin's offline images are drawn.
#[derive(Clone, Copy)]
pub struct Run {
    /// The seed of its samplers.
    pub seed: u64,
    /// Its threads.
    pub threads: u32,
    /// Whether an image that is right on a small film is drawn on the scene's own film too.
    pub whole: bool,
}

/// Judges integrator, shadows, loop and image on one scene. Answers no image where only a small film was
/// drawn: it is right.
pub fn judge_scene<'a>(
    session: &Session,
    plugin: &Path,
    case: &'a PreparedScene,
    run: Run,
    tolerances: &Tolerances,
    answers: &mut Answers<'a>,
) -> (Vec<Check>, Option<Drawn>) {
    let name = &case.entry.name;
    let small = &case.probe_film;
    let scene = session.scene(&case.offline);
    let chosen: Vec<_> = small.batch.rays.iter().map(session::ray).collect();
    let radiance = |rays: &[_], witness, shadows| Request::Radiance {
        scene: scene.clone(),
        rays: rays.to_vec(),
        shadows,
        witness,
        seed: 1,
    };
    let render = |(width, height), spp, seed, threads, shadows| Request::RenderOffline {
        scene: scene.clone(),
        width,
        height,
        spp,
        seed,
        threads,
        shadows,
    };
    let centres: Vec<_> =
        small.surface.pixels.iter().map(|(centre, _)| session::ray(centre)).collect();
    let mut requests: Vec<Request> =
        WITNESSES.iter().map(|(witness, _)| radiance(&chosen, *witness, false)).collect();
    requests.push(radiance(&chosen, FLAT, false));
    requests.push(radiance(&chosen, FLAT, true));
    requests.push(radiance(&chosen, Witness::True, false));
    requests.push(radiance(&chosen, Witness::True, true));
    // What the loop is asked: a render, and radiance along its rays.
    let size = (small.width, small.height);
    let at_centres =
        |shadows| [radiance(&centres, Witness::True, shadows), render(size, 1, 1, 1, shadows)];
    let at_samples = small.sampled.iter().flat_map(|sampled| {
        let size = (sampled.film.width, sampled.film.height);
        let along = radiance(&sampled.rays, Witness::True, false);
        [along, render(size, loops::SAMPLES, run.seed, 1, false)]
    });
    requests.extend(at_centres(true));
    let plain = plain_surfaces(case);
    let queries = plain.iter().map(|(_, query)| *query).collect();
    requests.push(Request::EvalBsdf { scene: scene.clone(), queries });
    let first = case.first.as_ref().filter(|_| !run.whole);
    let film =
        |expected: &Expected| (expected.unshadowed.width as u32, expected.unshadowed.height as u32);
    let size = film(first.unwrap_or(&case.expected));
    requests.push(render(size, case.spp, run.seed, run.threads, true));
    requests.extend(at_samples);
    let outcomes = session.run(Some(plugin), requests);
    let [
        w0,
        w1,
        w2,
        w3,
        flat_off,
        flat_on,
        true_off,
        true_on,
        along_centres,
        one_spp,
        own,
        full,
        sampled @ ..,
    ] = outcomes.as_slice()
    else {
        let summary = "the worker gave no outcomes: a bug of Umbra's";
        return (vec![Check::new(CheckId::ImageOffline, name, Verdict::NotRun, summary)], None);
    };
    let witnessed = [w0, w1, w2, w3];
    let bypassed = witnessed.iter().all(|outcome| {
        matches!(outcome, Outcome::Done(answer) if answer.witness.is_some_and(|seen| seen.calls == 0))
    });
    let mut checks = Vec::new();
    if bypassed {
        let own = "the scene's own: the integrator asks for none";
        answers.push_light(case, &[(true_off, Witness::True, own)]);
        let own = |point: &SurfacePoint| {
            let point =
                ShadedPoint { intensity: [1.0; 3], distance: 1.0, ..shaded_point(case, point) };
            Shading::default().radiance(&point)
        };
        checks.push(judge_shadows(case, &own, (true_on, true_off), (true_on, true_off)));
    } else {
        let asked = witnessed.iter().zip(WITNESSES);
        let mut asked: Vec<_> =
            asked.map(|(outcome, (witness, name))| (*outcome, witness, name)).collect();
        asked.push((flat_off, FLAT, "constant, below the surface too"));
        answers.push_light(case, &asked);
        answers.push_together(case, true_off);
        let flat = |point: &SurfacePoint| value(FLAT, point.wi, point.wo);
        let shadows = judge_shadows(case, &flat, (flat_on, flat_off), (true_on, true_off));
        for ((witness, _), outcome) in WITNESSES.iter().zip(witnessed) {
            if let Some(values) = observe::colours(outcome) {
                observe::radiance(session, case, *witness, values);
            }
        }
        let both = observe::colours(flat_on).zip(observe::colours(flat_off));
        // Of a switch that does the opposite, visibility by its position says something else.
        let is_inverted = shadows.mistake == rays::INVERTED;
        if let (Verdict::Fail, Some((with, without)), false) = (shadows.verdict, both, is_inverted)
        {
            observe::shadows(session, case, with, without);
        }
        checks.push(shadows);
        if let (Outcome::Done(own), Outcome::Done(radiance)) = (own, true_off) {
            let rays = plain.iter().map(|(ray, _)| *ray);
            let own: Vec<_> = rays.zip(session::colours(&own.values).iter().copied()).collect();
            let radiance = session::colours(&radiance.values);
            checks.push(rays::judge_material(&small.batch, &own, radiance));
        }
        let flat = if is_inverted { (flat_off, flat_on) } else { (flat_on, flat_off) };
        record_rays(session, case, w1, flat);
    }
    if let (Outcome::Done(image), Outcome::Done(along)) = (one_spp, along_centres) {
        record_loop(session, case, (&image.values, &along.values));
    }
    // Where shadows leave nothing to see, the loop shows without them.
    let unshadowed =
        is_black(along_centres).then(|| session.run(Some(plugin), at_centres(false).into()));
    let (along_centres, one_spp) = match unshadowed.as_deref() {
        Some([along, image]) => (along, image),
        _ => (along_centres, one_spp),
    };
    // What the integrator answers along the same rays with directions that nobody normalized.
    let along_longer = |rays: &[RayQuery], (width, height): (u32, u32), shadows| {
        let camera = case.expected.scene.camera(width as usize, height as usize);
        let longer = camera.map(|camera| longer_rays(&camera, rays)).unwrap_or_default();
        longer.into_iter().filter_map(move |rays| {
            let outcomes = session.run(Some(plugin), vec![radiance(&rays, Witness::True, shadows)]);
            outcomes.first()?.answer().map(|answer| session::colours(&answer.values).to_vec())
        })
    };
    checks.push(match (one_spp, along_centres) {
        (Outcome::Done(image), Outcome::Done(along)) => {
            let (image, along) = (session::colours(&image.values), session::colours(&along.values));
            let judge = |along: &[_]| loops::judge_agreement(name, &small.mask, image, along);
            let with_shadows = unshadowed.is_none();
            let longer = along_longer(&centres, (small.width, small.height), with_shadows);
            loops::priced_by_length(judge(along), image, longer, &judge)
        }
        (Outcome::Done(_), missing) => Check {
            verdict: Verdict::NotJudged,
            ..session::unanswered(CheckId::LoopAgreement, name, &[], missing)
        },
        // Where the rays fail in the same way, it is not the loop's fault.
        (missing, Outcome::Done(_)) => {
            session::unanswered(CheckId::LoopAgreement, name, &[], missing)
        }
        (missing, _) => Check {
            verdict: Verdict::NotJudged,
            ..session::unanswered(CheckId::LoopAgreement, name, &[], missing)
        },
    });
    if let ([along, image], Some(sampled)) = (sampled, &small.sampled) {
        checks.push(match (along, image) {
            (Outcome::Done(along), Outcome::Done(image)) => {
                let (image, along) =
                    (session::colours(&image.values), session::colours(&along.values));
                let judge = |along: &[_]| loops::judge_samples(name, &sampled.film, image, along);
                let (check, edges) = judge(along);
                let film = (sampled.film.width, sampled.film.height);
                let longer = along_longer(&sampled.rays, film, false);
                let check = loops::priced_by_length(check, image, longer, &|along| judge(along).0);
                // Where the samples are wrong already, edges are too.
                if check.verdict == Verdict::Pass {
                    answers.edges.add(&edges);
                }
                check
            }
            (Outcome::Done(_), missing) => {
                session::unanswered(CheckId::LoopSamples, name, &[], missing)
            }
            // Where the rays fail in the same way, it is not the loop's fault.
            (missing, _) => Check {
                verdict: Verdict::NotJudged,
                ..session::unanswered(CheckId::LoopSamples, name, &[], missing)
            },
        });
    }
    let kind = Kind::Offline { spp: case.spp };
    let judge = |outcome: &Outcome, expected: &Expected| {
        let Outcome::Done(answer) = outcome else {
            let parts = ["1.1", "1.2", "1.3", "1.4"];
            return (session::unanswered(CheckId::ImageOffline, name, &parts, outcome), None);
        };
        let (width, height) = film(expected);
        let image = session::image(&answer.values, width, height);
        let id = CheckId::ImageOffline;
        let check = images::judge(id, name, kind, &image, expected, &|_| true, tolerances);
        (check, Some(Drawn { scene: name.clone(), kind, image }))
    };
    let Some(first) = first else {
        let (mut check, drawn) = judge(full, &case.expected);
        let mut small = sampled.iter().chain([one_spp]);
        if case.first.is_some() && small.all(|outcome| outcome.answer().is_some()) {
            settle_slow(&mut check, full);
        }
        checks.push(check);
        return (checks, drawn);
    };
    let (check, _) = judge(full, first);
    if check.verdict != Verdict::Fail {
        checks.push(check);
        return (checks, None);
    }
    let whole = render(film(&case.expected), case.spp, run.seed, run.threads, true);
    let outcomes = session.run(Some(plugin), vec![whole]);
    let (whole, drawn) = match outcomes.first() {
        Some(outcome) => judge(outcome, &case.expected),
        None => (check.clone(), None),
    };
    // An image that is wrong on any film is wrong; the larger one is shown.
    checks.push(if whole.verdict == Verdict::Fail { whole } else { check });
    (checks, drawn)
}

/// A renderer that draws the small films in time is slow on a large one, no endless loop: a slip. Whether the loop is
/// right, the small ones show.
fn settle_slow(check: &mut Check, full: &Outcome) {
    if let Outcome::TimedOut(late) = full
        && late.computing
    {
        check.error = Class::Slip.price();
        check.summary = format!("too slow on the whole film of scene \"{}\": {late}", check.scene);
    }
}

/// Whether an answer is there, and says that no light comes from anywhere.
fn is_black(outcome: &Outcome) -> bool {
    outcome.answer().is_some_and(|answer| answer.values.iter().all(|value| *value == 0.0))
}

/// What to ask a renderer about its own BSDF where lit rays end: the ray, and the question. Surfaces of
/// one color alone: beside a texel's edge a right renderer may take either.
fn plain_surfaces(case: &PreparedScene) -> Vec<(usize, BsdfQuery)> {
    let scene = &case.expected.scene;
    let batch = &case.probe_film.batch;
    let lit = batch.points.iter().take(batch.lit).enumerate();
    let asked = lit.filter_map(|(ray, point)| {
        let material = scene.material_of(point.shape);
        let bitmap = |texture| matches!(texture, &Texture::Bitmap(_));
        let plain = !bitmap(&material.diffuse) && !bitmap(&material.specular);
        let asked = plain && material.model != MaterialModel::Mirror;
        asked.then(|| {
            let (shape, primitive) = (point.shape as u32, point.primitive as u32);
            let query = BsdfQuery {
                source: BsdfSource::Shape { shape, primitive },
                uv: [0.5; 2],
                wo: point.wo.into(),
                wi: point.wi.into(),
            };
            (ray, query)
        })
    });
    asked.collect()
}

/// Camera rays with directions that nobody normalized: up to the plane at distance 1, or up to the far plane, as the
/// inverse of the matrices gives it.
fn longer_rays(camera: &Camera, rays: &[RayQuery]) -> [Vec<RayQuery>; 2] {
    let to_clip = camera.projection() * camera.view();
    let (back, axis) = (to_clip.inverse(), camera.view().row(2).truncate());
    let near = |direction: Vec3| direction / direction.dot(-axis);
    let far = |direction: Vec3| {
        let on_film = to_clip.project_point3(camera.eye() + direction);
        back.project_point3(on_film.with_z(1.0)) - camera.eye()
    };
    let changed = |change: &dyn Fn(Vec3) -> Vec3| {
        let longer =
            |ray: &RayQuery| RayQuery { direction: change(ray.direction.into()).into(), ..*ray };
        rays.iter().map(longer).collect()
    };
    [changed(&near), changed(&far)]
}

/// Keeps for the diagnosis what witnesses say of light and visibility.
fn record_rays(
    session: &Session,
    case: &PreparedScene,
    lit: &Outcome,
    (with, without): (&Outcome, &Outcome),
) {
    let (name, small) = (&case.entry.name, &case.probe_film);
    let size = (small.width as usize, small.height as usize);
    if let Outcome::Done(lit) = lit {
        let values = session::colours(&lit.values).iter().copied();
        let tile = Thumbnail::of_pixels(size, small.batch.met().copied().zip(values));
        session.record(View::new(diagnosis::Kind::Lit, name), tile);
    }
    if let (Outcome::Done(with), Outcome::Done(without)) = (with, without)
        && observe::tells_visibility(small.batch.lit, session::colours(&without.values))
    {
        let pairs = session::colours(&with.values).iter().zip(session::colours(&without.values));
        let sums = pairs.map(|(a, b)| (a.iter().sum::<f32>(), b.iter().sum::<f32>()));
        // A ray that is black without shadows tells nothing.
        let told = small.batch.met().zip(sums).filter(|(_, (_, without))| *without != 0.0);
        let visibility = told.map(|(&pixel, (with, without))| (pixel, [with / without; 3]));
        session.record(
            View::new(diagnosis::Kind::Shadow, name),
            Thumbnail::of_pixels(size, visibility),
        );
    }
}

/// Keeps for the diagnosis what the loop makes of the radiance along the centers of all pixels.
fn record_loop(session: &Session, case: &PreparedScene, (image, along): (&[f32], &[f32])) {
    if case.held_back {
        return;
    }
    let (name, small) = (&case.entry.name, &case.probe_film);
    let [image, rays] =
        [image, along].map(|values| session::image(values, small.width, small.height));
    session.record(View::new(diagnosis::Kind::Offline, name), Thumbnail::of_image(&image));
    if let Ok(mut observations) = session.observations.lock() {
        observations.loops.insert(name.clone(), LoopSeen { rays, image });
    }
}

fn judge_shadows(
    case: &PreparedScene,
    bsdf: &dyn Fn(&SurfacePoint) -> [f64; 3],
    (with, without): (&Outcome, &Outcome),
    shaded: (&Outcome, &Outcome),
) -> Check {
    let (id, name) = (CheckId::ShadowRays, &case.entry.name);
    match (with, without) {
        (Outcome::Done(with), Outcome::Done(without)) => {
            let (with, without) =
                (session::colours(&with.values), session::colours(&without.values));
            // Where there is no BSDF yet, nothing is told of what it would shade.
            let shaded = match shaded {
                (Outcome::Done(on), Outcome::Done(off)) => {
                    (session::colours(&on.values), session::colours(&off.values))
                }
                _ => (without, without),
            };
            let scene = &case.expected.scene;
            let occluders = rays::Occluders {
                blocker: &|ray| blocker(scene, ray),
                is_phong: &|shape| scene.material_of(shape).model == MaterialModel::Phong,
            };
            rays::judge_shadows(&case.probe_film.batch, bsdf, (with, without), shaded, &occluders)
        }
        (Outcome::Done(_), missing) => {
            Check { verdict: Verdict::NotJudged, ..session::unanswered(id, name, &[], missing) }
        }
        (missing, _) => session::unanswered(id, name, &["1.4"], missing),
    }
}

/// The first shape along a ray that blocks it: emitters do not.
fn blocker(scene: &Scene, ray: &Ray) -> Option<usize> {
    let mut rest = *ray;
    while scene.occluded(&rest) {
        let hit = scene.intersect(&rest)?;
        if !scene.material_of(hit.shape).is_emitter() {
            return Some(hit.shape);
        }
        rest.min_t = hit.t + hit.epsilon;
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn longer_rays_keep_their_directions() {
        let eye = Vec3::new(1.0, 2.0, 6.0);
        let config = basecode::CameraConfig { eye, ..basecode::CameraConfig::default() };
        let camera = Camera::new(config, 40, 30).unwrap();
        let rays = [session::ray(&camera.ray(20.0, 15.0)), session::ray(&camera.ray(0.5, 29.5))];
        let [near, far] = longer_rays(&camera, &rays);
        for (ray, (near, far)) in rays.iter().zip(near.iter().zip(&far)) {
            let [ray, near, far] = [ray, near, far].map(|ray| Vec3::from(ray.direction));
            assert!(
                (near.normalize() - ray).length() < 1e-5 && (far.normalize() - ray).length() < 1e-3
            );
            assert!((far.length() / near.length() / Camera::FAR - 1.0).abs() < 0.05);
        }
        assert!((Vec3::from(near[0].direction).length() - 1.0).abs() < 1e-5);
        assert!(Vec3::from(near[1].direction).length() > 1.01);
    }
}
