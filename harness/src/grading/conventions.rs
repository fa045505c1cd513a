//! The answers of a plugin's BSDFs and integrator whose verdicts depend on a convention: asked once, judged under each.

use std::path::Path;

use basecode::{MaterialModel, Sampler, Vec2, Vec3};
use renderer_api as api;

use super::observe;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use crate::diagnosis::{self, Thumbnail, View};
use crate::evidence::bsdf::{self, BsdfKind, BsdfProbe};
use crate::evidence::changes;
use crate::evidence::convention::{self, Convention, Conventional, Party};
use crate::evidence::loops::Edges;
use crate::evidence::physical::Probes;
use crate::evidence::rays::{self, OwnValue, RayBatch, Unshadowed};
use crate::evidence::shading::{ShadedPoint, Shading};
use crate::evidence::{Check, CheckId, Measure, RuleId, Verdict, Witness};
use crate::expected::SurfacePoint;
use crate::worker::{Outcome, Request};

/// What was answered on a group of scenes.
#[derive(Default)]
pub struct Answers<'a> {
    bsdfs: Vec<BsdfAnswer>,
    lights: Vec<LightAnswer<'a>>,
    together: Vec<TogetherAnswer>,
    /// The edges of all films of several samples per pixel.
    pub edges: Edges,
}

/// A BSDF's values at probes, or the check that says why there are none.
struct BsdfAnswer {
    kind: BsdfKind,
    scene: String,
    probes: Vec<BsdfProbe>,
    values: Result<Vec<[f32; 3]>, Check>,
}

/// Radiance along a scene's rays without shadows, or the check that says why there is none.
struct LightAnswer<'a> {
    case: &'a PreparedScene,
    values: Result<Vec<WitnessAnswer>, Box<Check>>,
    /// What the lit points look like to an integrator that asks the scene for no BSDF; empty for
    /// one that does.
    own: Vec<ShadedPoint>,
    /// What its BSDFs answer where such an integrator's lit rays end.
    bsdfs: Vec<OwnValue>,
}

/// Radiance without shadows of the renderer's own integrator and BSDFs, where rays meet surfaces of one kind.
struct TogetherAnswer {
    kind: BsdfKind,
    batch: RayBatch,
    points: Vec<ShadedPoint>,
    values: Vec<[f32; 3]>,
}

/// Radiance under one witness.
struct WitnessAnswer {
    witness: Witness,
    name: &'static str,
    values: Vec<[f32; 3]>,
}

impl<'a> Answers<'a> {
    /// Probes both BSDFs: given by value, as a textured scene hands them out, and as any held-back
    /// one does, whose materials nobody has seen. Returns the checks that depend on no convention.
    pub fn probe_bsdfs(
        &mut self,
        session: &Session,
        plugin: &Path,
        cases: &[PreparedScene],
    ) -> Vec<Check> {
        let Some(case) = cases.first() else { return Vec::new() };
        let request = |scene: &Path, queries: &mut dyn Iterator<Item = &api::BsdfQuery>| {
            let queries = queries.map(session::query).collect();
            Request::EvalBsdf { scene: session.scene(scene), queries }
        };
        let kinds = [BsdfKind::Diffuse, BsdfKind::Phong];
        let mut asked = Vec::new();
        for kind in kinds {
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
        let mut requests: Vec<Request> = asked
            .iter()
            .map(|(_, _, scene, probes)| request(scene, &mut probes.iter().map(|p| &p.query)))
            .collect();
        // Asked of no scene's materials, so but once.
        let kinds: &[_] = if case.held_back { &[] } else { &kinds };
        let physical: Vec<_> = kinds.iter().map(|&kind| (kind, Probes::new(kind))).collect();
        let long: Vec<_> = kinds.iter().map(|&kind| (kind, bsdf::long_probes(kind))).collect();
        requests.extend(
            physical.iter().map(|(_, probes)| request(&case.offline, &mut probes.queries.iter())),
        );
        requests.extend(long.iter().map(|(_, probes)| {
            request(&case.offline, &mut probes.iter().map(|probe| &probe.query))
        }));
        let outcomes = session.run(Some(plugin), requests);
        let (own, rest) = outcomes.split_at(asked.len().min(outcomes.len()));
        let (of_physical, of_long) = rest.split_at(physical.len().min(rest.len()));
        for ((kind, scene, _, probes), outcome) in asked.into_iter().zip(own) {
            self.push_bsdf(session, kind, scene, probes, outcome);
        }
        for ((kind, probes), outcome) in long.into_iter().zip(of_long) {
            let by_value =
                |answer: &&mut BsdfAnswer| answer.kind == kind && answer.scene.is_empty();
            let known = self.bsdfs.iter_mut().find(by_value);
            // A renderer that does not answer them keeps no such convention.
            let (Some(known), Some(answer)) = (known, outcome.answer()) else { continue };
            if let Ok(values) = &mut known.values {
                values.extend(session::colors(&answer.values));
                known.probes.extend(probes);
            }
        }
        let physical = physical.iter().zip(of_physical);
        let judge = |((kind, probes), outcome): (&(BsdfKind, Probes), &Outcome)| {
            probes.judge(*kind, session::colors(&outcome.answer()?.values))
        };
        physical.filter_map(judge).collect()
    }

    /// What is known of both BSDFs before any ray is cast, in words.
    pub fn first_verdict(&self) -> String {
        let handout = Convention::default();
        let passes = |own: &BsdfAnswer| {
            own.values.as_ref().is_ok_and(|values| bsdf::passes(&own.probes, values, &handout))
        };
        let words =
            [(BsdfKind::Diffuse, "diffuse"), (BsdfKind::Phong, "Phong")].map(|(kind, name)| {
                let own = || self.bsdfs.iter().filter(|own| own.kind == kind);
                let verdict = match own().all(passes) {
                    true => "as in the handout",
                    false if own().all(|own| own.values.is_err()) => "without an answer",
                    false => "not as in the handout",
                };
                format!("{name} BSDF {verdict}")
            });
        format!("first verdict: {}", words.join(", "))
    }

    fn push_bsdf(
        &mut self,
        session: &Session,
        kind: BsdfKind,
        scene: String,
        probes: Vec<BsdfProbe>,
        outcome: &Outcome,
    ) {
        let (id, part, view) = match kind {
            BsdfKind::Diffuse => (CheckId::BsdfDiffuse, "1.1", diagnosis::ViewKind::Diffuse),
            BsdfKind::Phong => (CheckId::BsdfPhong, "1.2", diagnosis::ViewKind::Phong),
        };
        let values = match outcome {
            Outcome::Done(answer) => {
                let values = session::colors(&answer.values);
                session.record(View::new(view, &scene), Thumbnail::of_list(values));
                if scene.is_empty() {
                    observe::bsdf(session, kind, &probes, values);
                }
                Ok(values.to_vec())
            }
            other => Err(session::unanswered(id, &scene, &[part], other)),
        };
        self.bsdfs.push(BsdfAnswer { kind, scene, probes, values });
    }

    /// Keeps the radiance of an integrator along a scene's rays, under each witness. `bsdfs` is for one that asks for
    /// none: what those of the scene answer where its rays end.
    pub fn push_light(
        &mut self,
        case: &'a PreparedScene,
        asked: &[(&Outcome, Witness, &'static str)],
        bsdfs: Vec<OwnValue>,
    ) {
        let own = asked.iter().any(|(_, witness, _)| *witness == Witness::True);
        let points = case.batch().points.iter().take(case.batch().lit);
        let own =
            if own { points.map(|point| shaded_point(case, point)).collect() } else { Vec::new() };
        let values = asked.iter().map(|(outcome, witness, name)| match outcome {
            Outcome::Done(answer) => {
                let values = session::colors(&answer.values).to_vec();
                Ok(WitnessAnswer { witness: *witness, name, values })
            }
            other => {
                let unanswered =
                    session::unanswered(CheckId::RadianceLit, &case.entry.name, &["1.3"], other);
                Err(Box::new(unanswered))
            }
        });
        let values = values.collect();
        self.lights.push(LightAnswer { case, values, own, bsdfs });
    }

    /// Keeps what the renderer's own integrator and BSDFs make of each other along a scene's rays, without shadows.
    pub fn push_together(&mut self, case: &PreparedScene, radiance: &Outcome) {
        let Some(answer) = radiance.answer() else { return };
        let (scene, batch) = (&case.expected.scene, case.batch());
        let values = session::colors(&answer.values);
        for (kind, model) in
            [(BsdfKind::Diffuse, MaterialModel::Diffuse), (BsdfKind::Phong, MaterialModel::Phong)]
        {
            let is_own = |shape| scene.material_of(shape).model == model;
            let wanted = |index: usize| match batch.points.get(index) {
                Some(point) => is_own(point.shape),
                None => scene.intersect(&batch.rays[index]).is_none_or(|hit| is_own(hit.shape)),
            };
            let (batch, chosen) = batch.without_shadows(&wanted);
            if batch.lit > 0 {
                let points = batch.points.iter().map(|point| shaded_point(case, point)).collect();
                let values = chosen.iter().map(|index| values[*index]).collect();
                self.together.push(TogetherAnswer { kind, batch, points, values });
            }
        }
    }

    /// The kinds of BSDFs that are wrong alone, and that an integrator holds the same ones of without asking for them.
    fn paid_by_bsdfs(&self) -> Vec<MaterialModel> {
        if self.lights.iter().all(|light| light.own.is_empty()) {
            return Vec::new();
        }
        let handout = Convention::default();
        let is_wrong = |kind: BsdfKind| {
            let own = self.bsdfs.iter().filter(|own| own.kind == kind);
            own.filter_map(|own| Some((own, own.values.as_ref().ok()?)))
                .any(|(own, values)| !bsdf::passes(&own.probes, values, &handout))
        };
        let held = |model| {
            let of = |light: &LightAnswer| (light.is_of_own_bsdfs(model), light.shines(model));
            self.lights.iter().map(of).collect::<Vec<_>>()
        };
        let kinds =
            [(BsdfKind::Diffuse, MaterialModel::Diffuse), (BsdfKind::Phong, MaterialModel::Phong)];
        let paid =
            kinds.into_iter().filter(|&(kind, model)| is_wrong(kind) && is_held(&held(model)));
        paid.map(|(_, model)| model).collect()
    }

    /// The checks under the handout's convention, and under others that the plugin keeps.
    pub fn judge(&self) -> Vec<Check> {
        let bsdfs = self.bsdfs.iter().map(BsdfAnswer::question);
        let paid = self.paid_by_bsdfs();
        let lights = self.lights.iter().map(|light| light.question(&paid));
        let together = || self.together.iter().map(TogetherAnswer::judge).collect();
        convention::judge(&bsdfs.chain(lights).collect::<Vec<_>>(), &together)
    }
}

/// Whether an integrator holds the BSDFs of a kind: of each scene, whether its radiance is what they answer, and
/// whether any of that is light. Black beside black tells nothing.
fn is_held(scenes: &[(bool, bool)]) -> bool {
    scenes.iter().all(|(same, _)| *same) && scenes.iter().any(|(_, shines)| *shines)
}

impl TogetherAnswer {
    fn judge(&self) -> (Party, Check) {
        let (party, id, changes) = match self.kind {
            BsdfKind::Diffuse => (Party::Diffuse, CheckId::BsdfDiffuse, changes::diffuse_changes()),
            BsdfKind::Phong => (Party::Phong, CheckId::BsdfPhong, changes::phong_changes()),
        };
        let answer = Unshadowed {
            witness: "the renderer's own",
            of: &|index, shading| shading.radiance(&self.points[index]),
            values: &self.values,
            black_below: true,
        };
        let handout = Convention::default();
        let mut check = rays::judge_unshadowed(&self.batch, &[answer], &handout, &changes);
        // The rules are those of another check.
        check.measures.iter_mut().for_each(|measure| measure.rule = None);
        (party, Check { id, ..check })
    }
}

impl BsdfAnswer {
    fn question(&self) -> Conventional<'_> {
        let party = match self.kind {
            BsdfKind::Diffuse => Party::Diffuse,
            BsdfKind::Phong => Party::Phong,
        };
        Conventional {
            party,
            passes: Box::new(|convention: &Convention| {
                let values = self.values.as_ref();
                values.is_ok_and(|values| bsdf::passes(&self.probes, values, convention))
            }),
            judge: Box::new(|convention: &Convention| match &self.values {
                Ok(values) => Check {
                    scene: self.scene.clone(),
                    ..bsdf::judge(self.kind, &self.probes, values, convention)
                },
                Err(unanswered) => unanswered.clone(),
            }),
        }
    }
}

impl LightAnswer<'_> {
    /// Radiance along lit ray `index` of an integrator that lights so.
    fn of(&self, witness: Witness, index: usize, shading: &Shading) -> [f64; 3] {
        match self.own.get(index) {
            Some(point) => shading.radiance(point),
            None => self.case.batch().under(index, shading, witness),
        }
    }

    /// What its BSDFs of this kind answer, by ray.
    fn own_bsdfs(&self, model: MaterialModel) -> Vec<OwnValue> {
        let batch = self.case.batch();
        let is_own = |(ray, _): &&OwnValue| {
            self.case.expected.scene.material_of(batch.points[*ray].shape).model == model
        };
        self.bsdfs.iter().filter(is_own).copied().collect()
    }

    /// Whether one of these is light.
    fn shines(&self, model: MaterialModel) -> bool {
        let shines = |(_, value): &OwnValue| value.iter().any(|v| v.is_finite() && *v > 0.0);
        self.own_bsdfs(model).iter().any(shines)
    }

    /// Whether its radiance is what the BSDFs of this kind answer, on all surfaces that tell.
    fn is_of_own_bsdfs(&self, model: MaterialModel) -> bool {
        let (batch, own) = (self.case.batch(), self.own_bsdfs(model));
        self.values.as_ref().is_ok_and(|answers| {
            answers.iter().all(|answer| rays::is_of_own_bsdfs(batch, &own, &answer.values))
        })
    }

    fn under<R>(&self, answers: &[WitnessAnswer], then: impl FnOnce(&[Unshadowed]) -> R) -> R {
        let of: Vec<_> = answers
            .iter()
            .map(|answer| {
                move |index: usize, shading: &Shading| self.of(answer.witness, index, shading)
            })
            .collect();
        let answers: Vec<Unshadowed> = answers
            .iter()
            .zip(&of)
            .map(|(answer, of)| Unshadowed {
                witness: answer.name,
                of,
                values: &answer.values,
                black_below: !matches!(answer.witness, Witness::Flat(_)),
            })
            .collect();
        then(&answers)
    }

    /// The check of an integrator that asks the scene for no BSDF. Its BSDFs are its own: a mistake may be in one of
    /// them alone, and then costs no more than on surfaces of that kind. What the BSDFs themselves do wrong is paid
    /// there.
    fn judge_own(&self, answers: &[Unshadowed], paid: &[MaterialModel]) -> Check {
        let (case, handout) = (self.case, Convention::default());
        let batch = case.batch();
        let changes = changes::shader_changes(true);
        let whole = rays::judge_unshadowed(batch, answers, &handout, &changes);
        let of_kind = |model: MaterialModel| {
            let is_own =
                |point: &SurfacePoint| case.expected.scene.material_of(point.shape).model == model;
            let (part, chosen) =
                batch.without_shadows(&|index| batch.points.get(index).is_some_and(is_own));
            let points: Vec<ShadedPoint> =
                part.points.iter().map(|point| shaded_point(case, point)).collect();
            let of = |index: usize, shading: &Shading| shading.radiance(&points[index]);
            let chosen = |answer: &Unshadowed| -> Vec<[f32; 3]> {
                chosen.iter().map(|index| answer.values[*index]).collect()
            };
            let values: Vec<_> = answers.iter().map(chosen).collect();
            let answers = answers.iter().zip(&values);
            let answers = answers.map(|(answer, values)| Unshadowed { of: &of, values, ..*answer });
            let answers: Vec<Unshadowed> = answers.collect();
            (model, rays::judge_unshadowed(&part, &answers, &handout, &changes))
        };
        let kinds = [MaterialModel::Diffuse, MaterialModel::Phong].map(of_kind);
        let failed = kinds.into_iter().filter(|(_, check)| check.verdict == Verdict::Fail);
        let (of_bsdfs, own): (Vec<_>, Vec<_>) = failed.partition(|(model, _)| paid.contains(model));
        let black = |measure: &Measure| measure.rule == Some(RuleId::RaysBlack) && !measure.passed;
        if own.is_empty() && !of_bsdfs.is_empty() && !whole.measures.iter().any(black) {
            let summary = "right but for its BSDFs, which are judged alone";
            return Check::new(CheckId::RadianceLit, &batch.scene, Verdict::Pass, summary);
        }
        let own = own.into_iter().map(|(_, check)| check);
        let worst = own.max_by(|a, b| a.error.total_cmp(&b.error));
        worst.filter(|worst| worst.error < whole.error).unwrap_or(whole)
    }

    fn question<'b>(&'b self, paid: &'b [MaterialModel]) -> Conventional<'b> {
        let batch = self.case.batch();
        Conventional {
            party: Party::Integrator,
            passes: Box::new(move |convention: &Convention| {
                // Without BSDFs to leave anything to, an integrator keeps no convention.
                self.own.is_empty()
                    && self.values.as_ref().is_ok_and(|values| {
                        self.under(values, |answers| {
                            rays::passes_unshadowed(batch, answers, convention)
                        })
                    })
            }),
            judge: Box::new(move |convention: &Convention| match &self.values {
                Ok(values) => self.under(values, |answers| {
                    if self.own.is_empty() {
                        let changes = changes::integrator_changes();
                        return rays::judge_unshadowed(batch, answers, convention, &changes);
                    }
                    self.judge_own(answers, paid)
                }),
                Err(unanswered) => (**unanswered).clone(),
            }),
        }
    }
}

/// A lit point as its right BSDF sees it. A mirror is black.
pub fn shaded_point(case: &PreparedScene, point: &SurfacePoint) -> ShadedPoint {
    let scene = &case.expected.scene;
    let material = scene.material_of(point.shape);
    let uv = scene.intersect(&point.ray).map_or(Vec2::ZERO, |hit| hit.uv);
    let (model, colors) = match material.model {
        MaterialModel::Diffuse => (api::MATERIAL_DIFFUSE, 1.0),
        MaterialModel::Phong => (api::MATERIAL_PHONG, 1.0),
        MaterialModel::Mirror => (api::MATERIAL_DIFFUSE, 0.0),
    };
    ShadedPoint {
        material: api::MaterialValue {
            model,
            diffuse: (colors * material.diffuse.lookup(uv)).into(),
            specular: (colors * material.specular.lookup(uv)).into(),
            exponent: material.exponent,
        },
        scale: f64::from(material.energy_scale()),
        wo: point.wo.to_array().map(f64::from),
        wi: point.wi.to_array().map(f64::from),
        intensity: case.batch().intensity.to_array().map(f64::from),
        distance: f64::from(point.distance),
    }
}

/// Directions and texture coordinates for each shape of a kind: of a public scene the textured ones.
fn shape_probes(kind: BsdfKind, case: &PreparedScene) -> Vec<BsdfProbe> {
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
            let value = api::MaterialValue {
                model,
                diffuse: material.diffuse.lookup(uv.into()).into(),
                specular: material.specular.lookup(uv.into()).into(),
                exponent: material.exponent,
            };
            let scale = f64::from(material.energy_scale());
            let at = (index as u32, primitive as u32, uv);
            probes.push(bsdf::textured_probe(at, pair, (&value, scale)));
        }
    }
    probes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bsdfs_are_held_where_every_scene_shows_them_and_one_shows_light() {
        assert!(is_held(&[(true, true), (true, true)]));
        // A scene without such surfaces shows the same nothing.
        assert!(is_held(&[(true, true), (true, false)]));
        assert!(!is_held(&[(true, true), (false, true)]), "one scene shows another BSDF");
        assert!(!is_held(&[(true, false), (true, false)]), "black beside black");
        assert!(!is_held(&[]));
    }
}
