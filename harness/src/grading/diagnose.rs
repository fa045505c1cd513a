//! The input of the diagnosis: answers kept while a submission is judged, and the reference renderer's answers to the
//! same questions with each known mistake.

use std::path::{Path, PathBuf};

use anyhow::Context;
use rayon::prelude::*;

use super::conventions::Answers;
use super::draw::{FrameRequest, draw_each};
use super::offline::{self, Drawn, Run};
use super::pipeline::Grading;
use super::realtime;
use super::session::{self, Session};
use super::stages::Stages;
use crate::diagnosis::{
    Catalogue, Diagnosis, Input, KnownMistake, LENGTH, Material, Observations, Stored, StoredView,
    Thumbnail, View, ViewKind,
};
use crate::evidence::{self, Evidence, Picture};
use crate::imaging::pictures::tone_mapped;
use crate::rubric;
use crate::store::scene_digest;
use crate::viewer::{Layer, ViewedCase, write_image};

/// A tile whose mean difference from what is right is less than this is not stored.
const VISIBLE: f64 = 1e-5;

/// What students may read: nothing of the held-back scenes is in it.
fn public(evidence: &Evidence) -> Evidence {
    Evidence { checks: evidence.checks.iter().filter(|check| !check.held_back).cloned().collect() }
}

impl Grading<'_> {
    /// Where the answers of known mistakes are stored.
    pub fn stored_folder(&self) -> PathBuf {
        self.assignment.root.join("expected").join(&self.assignment.name).join("mistakes")
    }

    /// What the parts that lost points look like; small pictures of it go to `out`, for the viewer too.
    ///
    /// # Errors
    /// When the stored answers or the catalogue cannot be used, or a picture cannot be written.
    pub(super) fn diagnose(
        &self,
        session: &Session,
        evidence: &Evidence,
        drawn: &[Drawn],
        out: Option<&Path>,
    ) -> anyhow::Result<(Vec<Diagnosis>, Vec<ViewedCase>)> {
        let failing = self.failing(evidence);
        let evidence = rubric::settle(&self.assignment.rules, &public(evidence));
        self.record_drawn(session, drawn);
        let observations = match session.observations.lock() {
            Ok(mut observations) => std::mem::take(&mut *observations),
            Err(_) => Observations::default(),
        };
        let nothing = Stored::default();
        let stored = match self.stored.get() {
            // Nothing is compared with them.
            _ if failing.is_empty() || observations.tiles.is_empty() => &nothing,
            Some(stored) => stored,
            None => {
                let stored = Stored::load(&self.stored_folder())?;
                self.check_digests(&stored)?;
                self.stored.get_or_init(|| stored)
            }
        };
        let catalogue = Catalogue::known()?;
        let input = Input {
            evidence: &evidence,
            failing: &failing,
            observations: &observations,
            stored,
            catalogue: &catalogue,
        };
        let (mut diagnoses, mut views) = (input.diagnose(), Vec::new());
        for diagnosis in &mut diagnoses {
            if let Some(out) = out
                && let Some((pictures, view)) = pictures(diagnosis, &input, out)?
            {
                diagnosis.pictures = pictures;
                views.push(view);
            }
        }
        Ok((diagnoses, views))
    }

    /// The parts that are diagnosed: those that lost points on public scenes.
    pub(super) fn failing(&self, evidence: &Evidence) -> Vec<String> {
        let grade = rubric::grade(&self.assignment.rules, &public(evidence));
        let failing = grade.parts.into_iter().filter(|part| part.points_max < part.out_of);
        failing.map(|part| part.id).collect()
    }

    /// Stored answers must be those of the scenes as they are now.
    fn check_digests(&self, stored: &Stored) -> anyhow::Result<()> {
        for case in &self.cases {
            let digest = scene_digest(&case.offline)?;
            for (view, content) in &stored.views {
                anyhow::ensure!(
                    view.scene != case.entry.name || content.digest == digest,
                    "{}: made from another version of the scene; hint: `umbra bless --mistakes`",
                    self.stored_folder().join(format!("{view}.exr")).display()
                );
            }
        }
        Ok(())
    }

    /// Keeps the images that were drawn. Films of submissions may be large ones or small ones: what
    /// they show is told by probes, but for the bonus.
    fn record_drawn(&self, session: &Session, drawn: &[Drawn]) {
        for case in &self.cases {
            let name = &case.entry.name;
            let of = |kind| {
                let own = drawn.iter().find(|drawn| drawn.scene == *name && drawn.kind == kind);
                own.map(|drawn| &drawn.image)
            };
            let plain = of(evidence::images::ImageKind::Realtime);
            let shadows = of(evidence::images::ImageKind::RealtimeShadows);
            if let (Some(with), Some(without)) = (shadows, plain) {
                session
                    .record(View::new(ViewKind::Bonus, name), Thumbnail::of_ratio(with, without));
            }
            if case.is_probe() {
                // At one sample the film shows no more than the rays.
                let film = of(evidence::images::ImageKind::Offline { spp: case.spp });
                let film = film.filter(|_| case.spp > 1);
                for (kind, image) in [(ViewKind::Realtime, plain), (ViewKind::Film, film)] {
                    if let Some(image) = image {
                        session.record(View::new(kind, name), Thumbnail::of_image(image));
                    }
                }
            }
        }
    }

    /// The answers of the reference renderer, right and with each of some mistakes.
    ///
    /// # Errors
    /// The machine's matters, and a reference that does not answer.
    pub fn look_at_mistakes(
        &self,
        reference: &Path,
        mistakes: &[&KnownMistake],
        say: &(dyn Fn(&str) + Sync),
    ) -> anyhow::Result<Stored> {
        let right = self.look(reference, None)?;
        let mut stored = Stored::default();
        for (view, tile) in right.tiles {
            let case = self.cases.iter().find(|case| case.entry.name == view.scene);
            let materials = match (view.kind, case) {
                (ViewKind::Offline, Some(case)) => Material::of_mask(&case.probe_film.mask),
                (ViewKind::Fragment, Some(case)) => {
                    Material::of_mask(&case.probe_film.unshadowed_mask)
                }
                (ViewKind::Film, Some(case)) => Material::of_mask(&case.expected.offline.mask),
                (ViewKind::Realtime, Some(case)) => {
                    Material::of_mask(&case.expected.unshadowed_mask)
                }
                _ => vec![Material::None; LENGTH],
            };
            let digest = case.map(|case| scene_digest(&case.offline)).transpose()?;
            let digest = digest.unwrap_or_default();
            let mistakes = std::collections::BTreeMap::new();
            stored.views.insert(view, StoredView { right: tile, materials, mistakes, digest });
        }
        // One that belongs to no part is told by its findings.
        let shown = mistakes.par_iter().filter(|mistake| !mistake.parts.is_empty());
        let seen = shown.map(|mistake| {
            say(&format!("looking at {}", mistake.name));
            let seen = self.look(reference, Some(mistake)).with_context(|| mistake.name.clone())?;
            Ok::<_, anyhow::Error>((*mistake, seen))
        });
        for (mistake, seen) in seen.collect::<Result<Vec<_>, _>>()? {
            for (view, tile) in seen.tiles {
                let Some(stored) = stored.views.get_mut(&view) else { continue };
                if shows(view.kind, mistake) && stored.differs(&tile) > VISIBLE {
                    stored.mistakes.insert(mistake.name.clone(), tile);
                }
            }
        }
        stored.views.retain(|_, view| !view.mistakes.is_empty());
        Ok(stored)
    }

    /// All answers of the reference renderer, with a mistake or without.
    fn look(
        &self,
        reference: &Path,
        mistake: Option<&KnownMistake>,
    ) -> anyhow::Result<Observations> {
        let session = self
            .session(&mistake.map_or(String::new(), |mistake| format!("mistake={}", mistake.name)));
        let tolerances = &self.assignment.tolerances;
        let belongs = |path: &str| {
            mistake.is_none_or(|known| known.parts.iter().any(|part| part.starts_with(path)))
        };
        let mut drawn = Vec::new();
        if belongs("1.") {
            let mut answers = Answers::default();
            answers.probe_bsdfs(&session, reference, &self.cases);
            for case in &self.cases {
                let run = Run { seed: 1, threads: self.threads, whole: false };
                let judged =
                    offline::judge_scene(&session, reference, case, run, tolerances, &mut answers);
                drawn.extend(judged.1);
            }
        }
        if belongs("2.") {
            let judged = realtime::judge_images(
                &session,
                reference,
                &self.cases,
                &Stages::default(),
                tolerances,
            );
            drawn.extend(judged.into_iter().flat_map(|judged| judged.drawn));
            // Under the reference's own vertex stage, which is right where a fragment stage is not.
            let frames: Vec<FrameRequest> =
                self.cases.iter().map(|case| FrameRequest::probe(case, Vec::new())).collect();
            let outcomes = draw_each(&session, Some(reference), &frames);
            for (case, outcome) in self.cases.iter().zip(outcomes) {
                if let Some(answer) = outcome.answer() {
                    let (width, height) = (case.probe_film.width, case.probe_film.height);
                    let image = session::image(&answer.values, width, height);
                    session.record(
                        View::new(ViewKind::Fragment, &case.entry.name),
                        Thumbnail::of_image(&image),
                    );
                }
            }
        }
        self.record_drawn(&session, &drawn);
        let observations = session.observations.lock().map(|mut seen| std::mem::take(&mut *seen));
        let observations = observations.unwrap_or_default();
        anyhow::ensure!(!observations.tiles.is_empty(), "the reference renderer answers nothing");
        Ok(observations)
    }
}

/// Width and height of a tile's values in pictures, in pixels.
const ENLARGED: usize = 5;

/// Draws what was drawn, what is right and what the known mistake draws, where it shows best;
/// nothing of several mistakes together.
fn pictures(
    diagnosis: &Diagnosis,
    input: &Input,
    out: &Path,
) -> anyhow::Result<Option<(Vec<Picture>, ViewedCase)>> {
    let [alike] = diagnosis.mistakes.as_slice() else { return Ok(None) };
    let kind = if diagnosis.part.starts_with('1') { ViewKind::Offline } else { ViewKind::Realtime };
    let views = input.stored.views.iter().filter(|(view, _)| view.kind == kind);
    let shown = views.filter_map(|(view, stored)| {
        let known = stored.mistakes.get(alike.first()?)?;
        Some((stored.differs(known), view, input.observations.tiles.get(view)?, stored, known))
    });
    let best = shown.max_by(|a, b| a.0.total_cmp(&b.0));
    let Some((_, view, seen, stored, known)) = best else { return Ok(None) };
    let mut lit: Vec<f32> = stored.right.values().iter().map(|v| v.element_sum() / 3.0).collect();
    lit.retain(|value| *value > 0.0);
    lit.sort_by(f32::total_cmp);
    let median_lit = lit.get(lit.len() / 2).copied().unwrap_or(1.0);
    std::fs::create_dir_all(out)?;
    let (mut pictures, mut files) = (Vec::new(), Vec::new());
    for (title, tile) in [("yours", seen), ("right", &stored.right), ("known mistake", known)] {
        let file = format!("diagnosis-{}-{}.png", diagnosis.part, title.replace(' ', "-"));
        let picture = tone_mapped(&tile.enlarged(ENLARGED), median_lit);
        std::fs::write(out.join(&file), picture.png()?)?;
        files.push((title, write_image(out, &tile.enlarged(1))?));
        let (path, scene) = (view.kind.name(), &view.scene);
        let title = format!("{title} ({path}, {scene}, every few pixels)");
        pictures.push(Picture { title, file, width: picture.width, height: picture.height });
    }
    let mut layers: Vec<Layer> =
        files.iter().map(|(title, file)| Layer::image(*title, file)).collect();
    if let [(_, yours), (_, right), (_, known)] = files.as_slice() {
        layers.push(Layer::difference("yours - right", yours, right));
        layers.push(Layer::difference("yours - known mistake", yours, known));
    }
    let view = ViewedCase {
        id: Diagnosis::view_of(&diagnosis.part),
        title: format!("{}: what part {} looks like", view.scene, diagnosis.part),
        note: "every few pixels".to_owned(),
        reference: (layers.len() > 1).then_some(1),
        layers,
        ..ViewedCase::default()
    };
    Ok(Some((pictures, view)))
}

/// Whether a view is one of those that a mistake is looked for in.
fn shows(kind: ViewKind, mistake: &KnownMistake) -> bool {
    let any = |parts: &[&str]| mistake.parts.iter().any(|part| parts.contains(&part.as_str()));
    match kind {
        ViewKind::Diffuse => any(&["1.1"]),
        ViewKind::Phong => any(&["1.2"]),
        ViewKind::Lit => any(&["1.3"]),
        ViewKind::Shadow => any(&["1.4"]),
        ViewKind::Offline => any(&["1.1", "1.2", "1.3", "1.4"]),
        ViewKind::Film => mistake.family == "loop",
        ViewKind::Realtime => any(&["2.1", "2.2", "2.3", "2.4"]),
        ViewKind::Fragment => any(&["2.3", "2.4"]),
        ViewKind::Bonus => any(&["2.5"]),
    }
}
