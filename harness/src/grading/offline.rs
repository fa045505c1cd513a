//! The offline path: BSDFs, integrator, shadows, loop and images of a plugin.

use std::path::Path;

use basecode::{Camera, Image, MaterialModel, Ray, Scene, Texture, Vec3};

use super::conventions::{Answers, shaded_point};
use super::observe;
use super::prepared_scene::{PreparedScene, Sampled};
use super::questions::{Outcomes, Question, Questions};
use super::session::{self, Session};
use crate::diagnosis::{self, LoopSeen, Thumbnail, View};
use crate::evidence::Witness;
use crate::evidence::images::{self, ImageKind};
use crate::evidence::loops;
use crate::evidence::price::PriceClass;
use crate::evidence::rays::{self, OwnValue};
use crate::evidence::shading::{ShadedPoint, Shading};
use crate::evidence::{Check, CheckId, Verdict};
use crate::expected::{Expected, SurfacePoint};
use crate::imaging::tolerances::Tolerances;
use crate::worker::{BsdfQuery, BsdfSource, Outcome, RayQuery, Request, SceneRef};

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
    pub kind: ImageKind,
    /// The image.
    pub image: Image,
}

/// One in so many of a pixel's samples is drawn on the large film that shows what small ones cannot, such as rows
/// that are left out.
const LARGE_FILM_SHARE: u32 = 4;

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

/// What is asked about the offline path of one scene.
struct Asked<'s, 'a> {
    session: &'s Session<'s>,
    plugin: &'s Path,
    case: &'a PreparedScene,
    run: Run,
    scene: SceneRef,
}

/// A question without shadows, and with them.
#[derive(Clone, Copy)]
struct BothWays {
    without: Question,
    with: Question,
}

/// Radiance along rays, and a render whose samples follow the same rays.
#[derive(Clone, Copy)]
struct LoopQuestions {
    along: Question,
    image: Question,
}

/// What the light and the shadows are judged by.
struct RayQuestions {
    /// Under each of [`WITNESSES`], without shadows.
    witnessed: [Question; WITNESSES.len()],
    /// Under [`FLAT`].
    flat: BothWays,
    /// With the renderer's own BSDFs.
    own: BothWays,
    /// Its own BSDFs at the surfaces of `plain`.
    bsdfs: Question,
    /// Rays, by position, that end on plain surfaces.
    plain: Vec<usize>,
}

impl RayQuestions {
    /// What the renderer's own BSDFs answer at plain surfaces, by ray; nothing where there is no answer.
    fn own_values(&self, bsdfs: &Outcome) -> Vec<OwnValue> {
        let values = bsdfs.answer().map_or(&[][..], |answer| session::colors(&answer.values));
        self.plain.iter().copied().zip(values.iter().copied()).collect()
    }
}

/// Judges integrator, shadows, loop and image on one scene. Returns no image where only a small film was
/// drawn: it is right.
pub fn judge_scene<'a>(
    session: &Session,
    plugin: &Path,
    case: &'a PreparedScene,
    run: Run,
    tolerances: &Tolerances,
    answers: &mut Answers<'a>,
) -> (Vec<Check>, Option<Drawn>) {
    let asked = Asked { session, plugin, case, run, scene: session.scene(&case.offline) };
    let small = &case.probe_film;
    let mut questions = Questions::default();
    let rays = asked.rays(&mut questions);
    let at_centers = asked.at_centers(&mut questions, true);
    let (first, spp) = asked.first_film();
    let image = questions.ask(asked.film(first, spp));
    let at_samples = small.sampled.as_ref().map(|sampled| {
        let along = questions.ask(asked.radiance(&sampled.rays, Witness::True, false));
        let size = (sampled.film.width, sampled.film.height);
        let image = questions.ask(asked.render(size, loops::SAMPLES, run.seed, 1, false));
        (sampled, LoopQuestions { along, image })
    });
    let outcomes = questions.run(session, plugin);

    let mut checks = asked.judge_rays(&rays, &outcomes, answers);
    checks.push(asked.judge_agreement(at_centers, &outcomes));
    checks.extend(at_samples.map(|(sampled, samples)| {
        asked.judge_samples(
            sampled,
            [samples.along, samples.image].map(|of| &outcomes[of]),
            answers,
        )
    }));
    let small = at_samples.iter().flat_map(|(_, asked)| [asked.along, asked.image]);
    let draws_small = small.chain([at_centers.image]).all(|of| outcomes[of].answer().is_some());
    let (check, drawn) = asked.judge_image(&outcomes[image], draws_small, tolerances);
    checks.push(check);
    (checks, drawn)
}

impl<'a> Asked<'_, 'a> {
    fn radiance(&self, rays: &[RayQuery], witness: Witness, shadows: bool) -> Request {
        Request::Radiance {
            scene: self.scene.clone(),
            rays: rays.to_vec(),
            shadows,
            witness,
            seed: 1,
        }
    }

    fn render(
        &self,
        (width, height): (u32, u32),
        spp: u32,
        seed: u64,
        threads: u32,
        shadows: bool,
    ) -> Request {
        let scene = self.scene.clone();
        Request::RenderOffline { scene, width, height, spp, seed, threads, shadows }
    }

    /// The whole render, on the film of what is expected.
    fn film(&self, expected: &Expected, spp: u32) -> Request {
        let run = self.run;
        self.render(size_of(expected), spp, run.seed, run.threads, true)
    }

    /// The film that is drawn first, with its samples per pixel: the small one, if there is one. A large one has
    /// enough pixels with few samples each.
    fn first_film(&self) -> (&'a Expected, u32) {
        let Self { case, run, .. } = self;
        match &case.first {
            Some(first) if !run.whole => (first, case.spp),
            Some(_) => (&case.expected, case.spp.div_ceil(LARGE_FILM_SHARE)),
            None => (&case.expected, case.spp),
        }
    }

    fn rays(&self, questions: &mut Questions) -> RayQuestions {
        let chosen: Vec<_> = self.case.batch().rays.iter().map(session::ray).collect();
        let mut ask = |witness, shadows| questions.ask(self.radiance(&chosen, witness, shadows));
        let witnessed = WITNESSES.map(|(witness, _)| ask(witness, false));
        let flat = BothWays { without: ask(FLAT, false), with: ask(FLAT, true) };
        let own = BothWays { without: ask(Witness::True, false), with: ask(Witness::True, true) };
        let (plain, queries) = plain_surfaces(self.case).into_iter().unzip();
        let bsdfs = questions.ask(Request::EvalBsdf { scene: self.scene.clone(), queries });
        RayQuestions { witnessed, flat, own, bsdfs, plain }
    }

    /// One sample in the center of each pixel of the small film.
    fn at_centers(&self, questions: &mut Questions, shadows: bool) -> LoopQuestions {
        let small = &self.case.probe_film;
        let centers = centers(self.case);
        LoopQuestions {
            along: questions.ask(self.radiance(&centers, Witness::True, shadows)),
            image: questions.ask(self.render((small.width, small.height), 1, 1, 1, shadows)),
        }
    }

    /// Judges light and shadows along the chosen rays. An integrator that asks the scene for no BSDF is judged with
    /// its own.
    fn judge_rays(
        &self,
        asked: &RayQuestions,
        outcomes: &Outcomes,
        answers: &mut Answers<'a>,
    ) -> Vec<Check> {
        let case = self.case;
        let witnessed = asked.witnessed.map(|of| &outcomes[of]);
        let both = |of: BothWays| (&outcomes[of.with], &outcomes[of.without]);
        let own = both(asked.own);
        let asks_none = |outcome: &&Outcome| {
            let witness = outcome.answer().and_then(|answer| answer.witness);
            witness.is_some_and(|seen| seen.calls == 0)
        };
        if witnessed.iter().all(asks_none) {
            let name = "the scene's own: the integrator asks for none";
            let bsdfs = asked.own_values(&outcomes[asked.bsdfs]);
            answers.push_light(case, &[(own.1, Witness::True, name)], bsdfs);
            let bsdf = |point: &SurfacePoint| {
                let point =
                    ShadedPoint { intensity: [1.0; 3], distance: 1.0, ..shaded_point(case, point) };
                Shading::default().radiance(&point)
            };
            return vec![judge_shadows(case, &bsdf, own, own)];
        }
        let flat = both(asked.flat);
        let under = witnessed.into_iter().zip(WITNESSES);
        let mut under: Vec<_> =
            under.map(|(outcome, (witness, name))| (outcome, witness, name)).collect();
        under.push((flat.1, FLAT, "constant, below the surface too"));
        answers.push_light(case, &under, Vec::new());
        answers.push_together(case, own.1);
        let bsdf = |point: &SurfacePoint| FLAT.of_directions(point.wi, point.wo);
        let shadows = judge_shadows(case, &bsdf, flat, own);
        // Of a switch that does the opposite, visibility by its position says something else.
        let is_inverted = shadows.mistake == rays::INVERTED;
        self.observe_rays(witnessed, flat, shadows.verdict == Verdict::Fail && !is_inverted);
        record_rays(
            self.session,
            case,
            witnessed[1],
            if is_inverted { (flat.1, flat.0) } else { flat },
        );
        let mut checks = vec![shadows];
        if let (bsdfs @ Outcome::Done(_), Outcome::Done(radiance)) = (&outcomes[asked.bsdfs], own.1)
        {
            let values = asked.own_values(bsdfs);
            let radiance = session::colors(&radiance.values);
            checks.push(rays::judge_material(case.batch(), &values, radiance));
        }
        checks
    }

    /// Keeps what the diagnosis of light and, if `shadows`, of visibility fits to.
    fn observe_rays(
        &self,
        witnessed: [&Outcome; WITNESSES.len()],
        (with, without): (&Outcome, &Outcome),
        shadows: bool,
    ) {
        for ((witness, _), outcome) in WITNESSES.iter().zip(witnessed) {
            if let Some(values) = observe::colors(outcome) {
                observe::radiance(self.session, self.case, *witness, values);
            }
        }
        if let (true, Some(with), Some(without)) =
            (shadows, observe::colors(with), observe::colors(without))
        {
            observe::shadows(self.session, self.case, with, without);
        }
    }

    /// Judges whether a render is what the integrator answers along the rays through the pixels' centers.
    fn judge_agreement(&self, asked: LoopQuestions, outcomes: &Outcomes) -> Check {
        let (session, case) = (self.session, self.case);
        let (along, image) = (&outcomes[asked.along], &outcomes[asked.image]);
        if let (Outcome::Done(image), Outcome::Done(along)) = (image, along) {
            record_loop(session, case, (&image.values, &along.values));
        }
        if !is_black(along) {
            return self.judge_centers(along, image, true);
        }
        // Where shadows leave nothing to see, the loop shows without them.
        let mut questions = Questions::default();
        let asked = self.at_centers(&mut questions, false);
        let outcomes = questions.run(session, self.plugin);
        self.judge_centers(&outcomes[asked.along], &outcomes[asked.image], false)
    }

    fn judge_centers(&self, along: &Outcome, image: &Outcome, shadows: bool) -> Check {
        let (id, name) = (CheckId::LoopAgreement, &self.case.entry.name);
        let small = &self.case.probe_film;
        match (image, along) {
            (Outcome::Done(image), Outcome::Done(along)) => {
                let (image, along) =
                    (session::colors(&image.values), session::colors(&along.values));
                let judge = |along: &[_]| loops::judge_agreement(name, &small.mask, image, along);
                let size = (small.width, small.height);
                let centers = centers(self.case);
                let longer = self.along_longer(&centers, size, shadows);
                loops::priced_by_length(judge(along), image, longer, &judge)
            }
            // Where the rays fail in the same way, it is not the loop's fault.
            (missing, Outcome::Done(_)) => session::unanswered(id, name, &[], missing),
            (Outcome::Done(_), missing) | (missing, _) => {
                Check { verdict: Verdict::NotJudged, ..session::unanswered(id, name, &[], missing) }
            }
        }
    }

    /// Judges a render of several samples per pixel by the integrator's radiance along their rays.
    fn judge_samples(
        &self,
        sampled: &Sampled,
        [along, image]: [&Outcome; 2],
        answers: &mut Answers,
    ) -> Check {
        let (id, name) = (CheckId::LoopSamples, &self.case.entry.name);
        match (along, image) {
            (Outcome::Done(along), Outcome::Done(image)) => {
                let (image, along) =
                    (session::colors(&image.values), session::colors(&along.values));
                let judge = |along: &[_]| loops::judge_samples(name, &sampled.film, image, along);
                let (check, edges) = judge(along);
                let size = (sampled.film.width, sampled.film.height);
                let longer = self.along_longer(&sampled.rays, size, false);
                let check = loops::priced_by_length(check, image, longer, &|along| judge(along).0);
                // Where the samples are wrong already, edges are too.
                if check.verdict == Verdict::Pass {
                    answers.edges.add(&edges);
                }
                check
            }
            (Outcome::Done(_), missing) => session::unanswered(id, name, &[], missing),
            // Where the rays fail in the same way, it is not the loop's fault.
            (missing, _) => {
                Check { verdict: Verdict::NotJudged, ..session::unanswered(id, name, &[], missing) }
            }
        }
    }

    /// What the integrator answers along the same rays with directions that nobody normalized.
    fn along_longer(
        &self,
        rays: &[RayQuery],
        (width, height): (u32, u32),
        shadows: bool,
    ) -> impl Iterator<Item = Vec<[f32; 3]>> {
        let camera = self.case.expected.scene.camera(width as usize, height as usize);
        let longer = camera.map(|camera| longer_rays(&camera, rays)).unwrap_or_default();
        longer.into_iter().filter_map(move |rays| {
            let mut questions = Questions::default();
            let along = questions.ask(self.radiance(&rays, Witness::True, shadows));
            let outcomes = questions.run(self.session, self.plugin);
            outcomes[along].answer().map(|answer| session::colors(&answer.values).to_vec())
        })
    }

    /// Judges the image: on a small film first, and on the scene's own where that one is wrong. `draws_small` tells
    /// whether the renderer drew every small film in time.
    fn judge_image(
        &self,
        outcome: &Outcome,
        draws_small: bool,
        tolerances: &Tolerances,
    ) -> (Check, Option<Drawn>) {
        let (case, name) = (self.case, &self.case.entry.name);
        let judge = |outcome: &Outcome, expected: &Expected, spp: u32| {
            let kind = ImageKind::Offline { spp };
            let id = CheckId::ImageOffline;
            let Outcome::Done(answer) = outcome else {
                let parts = ["1.1", "1.2", "1.3", "1.4"];
                return (session::unanswered(id, name, &parts, outcome), None);
            };
            let (width, height) = size_of(expected);
            let image = session::image(&answer.values, width, height);
            let check = images::judge(id, name, kind, &image, expected, &|_| true, tolerances);
            (check, Some(Drawn { scene: name.clone(), kind, image }))
        };
        let (first, spp) = self.first_film();
        let (mut check, drawn) = judge(outcome, first, spp);
        let is_large = std::ptr::eq(first, &case.expected);
        if is_large && case.first.is_some() && draws_small {
            settle_slow(&mut check, outcome);
        }
        let is_whole = is_large && (spp == case.spp || drawn.is_none());
        if is_whole || check.verdict != Verdict::Fail {
            return (check, drawn.filter(|_| is_large));
        }
        let mut questions = Questions::default();
        let whole = questions.ask(self.film(&case.expected, case.spp));
        let outcomes = questions.run(self.session, self.plugin);
        let (whole, drawn) = judge(&outcomes[whole], &case.expected, case.spp);
        // An image that is wrong on any film is wrong; the one with all pixels and samples is shown.
        (if whole.verdict == Verdict::Fail { whole } else { check }, drawn)
    }
}

/// Columns and rows of what is expected.
fn size_of(expected: &Expected) -> (u32, u32) {
    (expected.unshadowed.width as u32, expected.unshadowed.height as u32)
}

/// The rays through the centers of the small film's pixels.
fn centers(case: &PreparedScene) -> Vec<RayQuery> {
    let pixels = case.probe_film.surface.pixels.iter();
    pixels.map(|(center, _)| session::ray(center)).collect()
}

/// A renderer that draws the small films in time is slow on a large one, no endless loop: a slip. Whether the loop is
/// right, the small ones show.
fn settle_slow(check: &mut Check, full: &Outcome) {
    if let Outcome::TimedOut(late) = full
        && late.computing
    {
        check.error = PriceClass::Slip.price();
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
    let batch = case.batch();
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

/// Camera rays with directions that nobody normalized.
fn longer_rays(camera: &Camera, rays: &[RayQuery]) -> [Vec<RayQuery>; 2] {
    let directions: Vec<Vec3> = rays.iter().map(|ray| ray.direction.into()).collect();
    rays::longer_directions(camera, &directions).map(|directions| {
        let pairs = rays.iter().zip(directions);
        pairs.map(|(ray, direction)| RayQuery { direction: direction.into(), ..*ray }).collect()
    })
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
        let values = session::colors(&lit.values).iter().copied();
        let tile = Thumbnail::of_pixels(size, case.batch().met().copied().zip(values));
        session.record(View::new(diagnosis::ViewKind::Lit, name), tile);
    }
    if let (Outcome::Done(with), Outcome::Done(without)) = (with, without)
        && observe::tells_visibility(case.batch().lit, session::colors(&without.values))
    {
        let pairs = session::colors(&with.values).iter().zip(session::colors(&without.values));
        let sums = pairs.map(|(a, b)| (a.iter().sum::<f32>(), b.iter().sum::<f32>()));
        // A ray that is black without shadows tells nothing.
        let told = case.batch().met().zip(sums).filter(|(_, (_, without))| *without != 0.0);
        let visibility = told.map(|(&pixel, (with, without))| (pixel, [with / without; 3]));
        session.record(
            View::new(diagnosis::ViewKind::Shadow, name),
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
    session.record(View::new(diagnosis::ViewKind::Offline, name), Thumbnail::of_image(&image));
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
            let (with, without) = (session::colors(&with.values), session::colors(&without.values));
            // Where there is no BSDF yet, nothing is told of what it would shade.
            let shaded = match shaded {
                (Outcome::Done(on), Outcome::Done(off)) => {
                    (session::colors(&on.values), session::colors(&off.values))
                }
                _ => (without, without),
            };
            let scene = &case.expected.scene;
            let occluders = rays::Occluders {
                blocker: &|ray| blocker(scene, ray),
                is_phong: &|shape| scene.material_of(shape).model == MaterialModel::Phong,
            };
            rays::judge_shadows(case.batch(), bsdf, (with, without), shaded, &occluders)
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
