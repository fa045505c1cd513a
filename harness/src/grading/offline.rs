//! The offline path: BSDFs, integrator, shadows, loop and images of a plugin.

use std::path::Path;

use basecode::{Image, MaterialModel, Sampler, Vec3};
use renderer_api as api;

use super::ask::{self, Asker};
use super::case::Case;
use super::seen;
use crate::diagnosis::{self, LoopSeen, Tile, View};
use crate::evidence::bsdf::{self, BsdfKind, BsdfProbe};
use crate::evidence::images::{self, Kind};
use crate::evidence::physical::Probes;
use crate::evidence::rays::{self, Unshadowed};
use crate::evidence::{Check, Verdict};
use crate::expected::SurfacePoint;
use crate::imaging::evidence::Tolerances;
use crate::plugin::{Witness, WitnessQuery};
use crate::worker::{Outcome, Request};

/// The witnesses that an integrator is judged under, with their names for reports.
const WITNESSES: [(Witness, &str); 4] = [
    (Witness::Constant([0.3, 0.2, 0.1]), "constant"),
    (Witness::OfWi, "a function of wi"),
    (Witness::OfWo, "a function of wo"),
    (Witness::OfAngle, "a function of the angle between wi and wo"),
];

/// The witness that visibility is judged under: a wrong frame must not look like a shadow.
const FLAT: Witness = Witness::Flat([0.3, 0.2, 0.1]);

/// An image that was drawn, kept for pictures and for the comparison with what was handed in.
pub struct Drawn {
    /// Name of the scene.
    pub scene: String,
    /// How it came about.
    pub kind: Kind,
    /// The image.
    pub image: Image,
}

/// Probes both BSDFs: given by value, as a textured scene hands them out, and as any held-back one
/// does, whose materials nobody has seen.
pub fn probe_bsdfs(asker: &Asker, plugin: &Path, cases: &[Case]) -> Vec<Check> {
    let Some(case) = cases.first() else { return Vec::new() };
    let request = |scene: &Path, probes: &[BsdfProbe]| Request::EvalBsdf {
        scene: asker.scene(scene),
        queries: probes.iter().map(|probe| ask::query(&probe.query)).collect(),
    };
    let mut asked = Vec::new();
    for kind in [BsdfKind::Diffuse, BsdfKind::Phong] {
        if !case.held_back {
            asked.push((kind, String::new(), &case.offline, bsdf::probes(kind)));
        }
        for case in cases {
            let probes = shape_probes(kind, case);
            if !probes.is_empty() {
                asked.push((kind, case.entry.name.clone(), &case.offline, probes));
            }
        }
    }
    let mut requests: Vec<Request> =
        asked.iter().map(|(_, _, scene, probes)| request(scene, probes)).collect();
    // Asked of no scene's materials, so but once.
    let kinds: &[_] = if case.held_back { &[] } else { &[BsdfKind::Diffuse, BsdfKind::Phong] };
    let physical: Vec<_> = kinds.iter().map(|&kind| (kind, Probes::new(kind))).collect();
    requests.extend(physical.iter().map(|(_, probes)| Request::EvalBsdf {
        scene: asker.scene(&case.offline),
        queries: probes.queries.iter().map(ask::query).collect(),
    }));
    let outcomes = asker.ask(Some(plugin), requests);
    let judged =
        asked.iter().zip(&outcomes).map(|((kind, scene, _, probes), outcome)| match outcome {
            Outcome::Done(answer) => {
                let mut check = bsdf::judge(*kind, probes, ask::colours(&answer.values));
                check.scene.clone_from(scene);
                let view = match kind {
                    BsdfKind::Diffuse => diagnosis::Kind::Diffuse,
                    BsdfKind::Phong => diagnosis::Kind::Phong,
                };
                asker.see(View::new(view, scene), Tile::of_list(ask::colours(&answer.values)));
                if scene.is_empty() {
                    seen::bsdf(asker, *kind, probes, ask::colours(&answer.values));
                }
                check
            }
            other => match kind {
                BsdfKind::Diffuse => ask::unanswered("bsdf.diffuse", scene, &["1.1"], other),
                BsdfKind::Phong => ask::unanswered("bsdf.phong", scene, &["1.2"], other),
            },
        });
    let answered = physical.iter().zip(outcomes.iter().skip(asked.len()));
    let physical = answered.filter_map(|((kind, probes), outcome)| {
        probes.judge(*kind, ask::colours(&outcome.answer()?.values))
    });
    judged.chain(physical).collect()
}

/// Directions and texture coordinates for each shape of a kind: of a public scene the textured ones.
fn shape_probes(kind: BsdfKind, case: &Case) -> Vec<BsdfProbe> {
    let scene = &case.expected.scene;
    let sampler = Sampler::new(0x7E87);
    let mut probes = Vec::new();
    for (index, shape) in scene.shapes().iter().enumerate() {
        let material = scene.material_of(index);
        let model = match (kind, material.model) {
            (BsdfKind::Diffuse, MaterialModel::Diffuse) => api::MATERIAL_DIFFUSE,
            (BsdfKind::Phong, MaterialModel::Phong) => api::MATERIAL_PHONG,
            _ => continue,
        };
        let bitmap = |texture| matches!(texture, &basecode::Texture::Bitmap(_));
        let textured = bitmap(&material.diffuse) || bitmap(&material.specular);
        if material.is_emitter() || !(textured || case.held_back) {
            continue;
        }
        for _ in 0..200 {
            let uv = [sampler.next_1d() * 3.0 - 1.0, sampler.next_1d() * 3.0 - 1.0];
            let primitive = (sampler.next_1d() * shape.triangles.len() as f32) as usize;
            let direction = || {
                let z = 0.05 + 0.95 * sampler.next_1d();
                let (sin, cos) = (std::f32::consts::TAU * sampler.next_1d()).sin_cos();
                let r = (1.0 - z * z).sqrt();
                Vec3::new(r * cos, r * sin, z)
            };
            let pair = (direction(), direction());
            let scale = material.energy_scale();
            let value = api::MaterialValue {
                model,
                diffuse: (scale * material.diffuse.lookup(uv.into())).into(),
                specular: (scale * material.specular.lookup(uv.into())).into(),
                exponent: material.exponent,
            };
            probes.push(bsdf::textured_probe((index as u32, primitive as u32, uv), pair, &value));
        }
    }
    probes
}

/// Judges integrator, shadows, loop and image on one scene.
pub fn judge_scene(
    asker: &Asker,
    plugin: &Path,
    case: &Case,
    seed: u64,
    threads: u32,
    tolerances: &Tolerances,
) -> (Vec<Check>, Option<Drawn>) {
    let name = &case.entry.name;
    let small = &case.small;
    let scene = asker.scene(&case.offline);
    let chosen: Vec<_> = small.batch.rays.iter().map(ask::ray).collect();
    let radiance = |rays: &[_], witness, shadows| Request::Radiance {
        scene: scene.clone(),
        rays: rays.to_vec(),
        shadows,
        witness,
        seed: 1,
    };
    let render = |width, height, spp, seed, threads| Request::RenderOffline {
        scene: scene.clone(),
        width,
        height,
        spp,
        seed,
        threads,
        shadows: true,
    };
    let centres: Vec<_> = small.surface.pixels.iter().map(|(centre, _)| ask::ray(centre)).collect();
    let mut requests: Vec<Request> =
        WITNESSES.iter().map(|(witness, _)| radiance(&chosen, *witness, false)).collect();
    requests.push(radiance(&chosen, FLAT, false));
    requests.push(radiance(&chosen, FLAT, true));
    requests.push(radiance(&chosen, Witness::True, false));
    requests.push(radiance(&chosen, Witness::True, true));
    requests.push(radiance(&centres, Witness::True, true));
    requests.push(render(small.width, small.height, 1, 1, 1));
    let (width, height) = case.film();
    requests.push(render(width, height, case.spp, seed, threads));
    let outcomes = asker.ask(Some(plugin), requests);
    let [w0, w1, w2, w3, flat_off, flat_on, true_off, true_on, at_centres, one_spp, full] =
        outcomes.as_slice()
    else {
        let summary = "the worker gave no outcomes: a bug of Umbra's";
        return (vec![Check::new("image.offline", name, Verdict::NotRun, summary)], None);
    };
    let witnessed = [w0, w1, w2, w3];
    let bypassed = witnessed.iter().all(|outcome| {
        matches!(outcome, Outcome::Done(answer) if answer.witness.is_some_and(|seen| seen.calls == 0))
    });
    let mut checks = Vec::new();
    let own = |point: &SurfacePoint| own_bsdf(case, point);
    if bypassed {
        checks.push(judge_unshadowed(
            case,
            &[(true_off, "the scene's own: the integrator asks for none", &own)],
        ));
        checks.push(judge_shadows(case, &own, (true_on, true_off), (true_on, true_off)));
    } else {
        let values =
            WITNESSES.map(|(witness, _)| move |point: &SurfacePoint| witness_value(witness, point));
        let asked: Vec<Asked> = (0..WITNESSES.len())
            .map(|i| {
                (witnessed[i], WITNESSES[i].1, &values[i] as &dyn Fn(&SurfacePoint) -> [f64; 3])
            })
            .collect();
        checks.push(judge_unshadowed(case, &asked));
        let flat = |point: &SurfacePoint| witness_value(FLAT, point);
        let shadows = judge_shadows(case, &flat, (flat_on, flat_off), (true_on, true_off));
        for ((witness, _), outcome) in WITNESSES.iter().zip(witnessed) {
            if let Some(values) = seen::colours(outcome) {
                seen::radiance(asker, case, *witness, values);
            }
        }
        let both = seen::colours(flat_on).zip(seen::colours(flat_off));
        if let (Verdict::Fail, Some((with, without))) = (shadows.verdict, both) {
            seen::shadows(asker, case, with, without);
        }
        checks.push(shadows);
        see_rays(asker, case, w1, (flat_on, flat_off));
    }
    checks.push(match (one_spp, at_centres) {
        (Outcome::Done(image), Outcome::Done(along)) => {
            see_loop(asker, case, (&image.values, &along.values));
            let (image, along) = (ask::colours(&image.values), ask::colours(&along.values));
            rays::judge_agreement(name, &small.mask, image, along)
        }
        (Outcome::Done(_), missing) => Check {
            verdict: Verdict::NotJudged,
            ..ask::unanswered("loop.agreement", name, &[], missing)
        },
        // Where the rays fail in the same way, it is not the loop's fault.
        (missing, Outcome::Done(_)) => ask::unanswered("loop.agreement", name, &[], missing),
        (missing, _) => Check {
            verdict: Verdict::NotJudged,
            ..ask::unanswered("loop.agreement", name, &[], missing)
        },
    });
    match full {
        Outcome::Done(answer) => {
            let image = ask::image(&answer.values, width, height);
            let kind = Kind::Offline { spp: case.spp };
            let (id, expected) = ("image.offline", &case.expected);
            checks.push(images::judge(id, name, kind, &image, expected, &|_| true, tolerances));
            (checks, Some(Drawn { scene: name.clone(), kind, image }))
        }
        other => {
            let parts = ["1.1", "1.2", "1.3", "1.4"];
            checks.push(ask::unanswered("image.offline", name, &parts, other));
            (checks, None)
        }
    }
}

/// Keeps for the diagnosis what witnesses say of light and visibility.
fn see_rays(asker: &Asker, case: &Case, lit: &Outcome, (with, without): (&Outcome, &Outcome)) {
    let (name, small) = (&case.entry.name, &case.small);
    let size = (small.width as usize, small.height as usize);
    if let Outcome::Done(lit) = lit {
        let values = ask::colours(&lit.values).iter().copied();
        let tile = Tile::of_pixels(size, small.batch.pixels.iter().copied().zip(values));
        asker.see(View::new(diagnosis::Kind::Lit, name), tile);
    }
    if let (Outcome::Done(with), Outcome::Done(without)) = (with, without) {
        let pairs = ask::colours(&with.values).iter().zip(ask::colours(&without.values));
        let sums = pairs.map(|(a, b)| (a.iter().sum::<f32>(), b.iter().sum::<f32>()));
        // What is black without shadows tells nothing.
        let told = small.batch.pixels.iter().zip(sums).filter(|(_, (_, without))| *without != 0.0);
        let visibility = told.map(|(&pixel, (with, without))| (pixel, [with / without; 3]));
        asker.see(View::new(diagnosis::Kind::Shadow, name), Tile::of_pixels(size, visibility));
    }
}

/// Keeps for the diagnosis what the loop makes of the radiance along the centres of all pixels.
fn see_loop(asker: &Asker, case: &Case, (image, along): (&[f32], &[f32])) {
    if case.held_back {
        return;
    }
    let (name, small) = (&case.entry.name, &case.small);
    let [image, rays] = [image, along].map(|values| ask::image(values, small.width, small.height));
    asker.see(View::new(diagnosis::Kind::Offline, name), Tile::of_image(&image));
    if let Ok(mut sightings) = asker.sightings.lock() {
        sightings.loops.insert(name.clone(), LoopSeen { rays, image });
    }
}

/// A question's outcome, the witness' name and its value.
type Asked<'a> = (&'a Outcome, &'a str, &'a dyn Fn(&SurfacePoint) -> [f64; 3]);

fn judge_unshadowed(case: &Case, asked: &[Asked]) -> Check {
    let mut answers = Vec::new();
    for (outcome, witness, bsdf) in asked {
        match outcome {
            Outcome::Done(answer) => {
                answers.push(Unshadowed { witness, bsdf, values: ask::colours(&answer.values) });
            }
            other => return ask::unanswered("radiance.lit", &case.entry.name, &["1.3"], other),
        }
    }
    rays::judge_unshadowed(&case.small.batch, &answers)
}

fn judge_shadows(
    case: &Case,
    bsdf: &dyn Fn(&SurfacePoint) -> [f64; 3],
    (with, without): (&Outcome, &Outcome),
    shaded: (&Outcome, &Outcome),
) -> Check {
    let (id, name) = ("shadow.rays", &case.entry.name);
    match (with, without) {
        (Outcome::Done(with), Outcome::Done(without)) => {
            let (with, without) = (ask::colours(&with.values), ask::colours(&without.values));
            // Where there is no BSDF yet, nothing is told of what it would shade.
            let shaded = match shaded {
                (Outcome::Done(on), Outcome::Done(off)) => {
                    (ask::colours(&on.values), ask::colours(&off.values))
                }
                _ => (without, without),
            };
            rays::judge_shadows(&case.small.batch, bsdf, with, without, shaded)
        }
        (Outcome::Done(_), missing) => {
            Check { verdict: Verdict::NotJudged, ..ask::unanswered(id, name, &[], missing) }
        }
        (missing, _) => ask::unanswered(id, name, &["1.4"], missing),
    }
}

fn witness_value(witness: Witness, point: &SurfacePoint) -> [f64; 3] {
    let query = WitnessQuery { wi: point.wi.into(), wo: point.wo.into() };
    witness.value(&query).unwrap_or_default().map(f64::from)
}

/// The right BSDF at a point, for integrators that ask the scene for none.
fn own_bsdf(case: &Case, point: &SurfacePoint) -> [f64; 3] {
    let scene = &case.expected.scene;
    let material = scene.material_of(point.shape);
    let uv = scene.intersect(&point.ray).map_or(basecode::Vec2::ZERO, |hit| hit.uv);
    let model = match material.model {
        MaterialModel::Diffuse => api::MATERIAL_DIFFUSE,
        MaterialModel::Phong => api::MATERIAL_PHONG,
        MaterialModel::Mirror => return [0.0; 3],
    };
    let value = api::MaterialValue {
        model,
        diffuse: material.diffuse.lookup(uv).into(),
        specular: material.specular.lookup(uv).into(),
        exponent: material.exponent,
    };
    bsdf::value(&value, f64::from(material.energy_scale()), point.wo.into(), point.wi.into())
}
