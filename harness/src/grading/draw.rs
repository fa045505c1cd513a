//! Draws frames of scenes with given stages, by a plugin or by Umbra's neutral pass.

use std::path::Path;
use std::sync::atomic::Ordering;

use basecode::{Image, Matrices};

use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use super::stages::named;
use crate::evidence::stage_film::from_origin;
use crate::evidence::stages::{SHOW_NORMAL, VERTEX};
use crate::worker::{Adapter, CameraValue, Outcome, Request, SceneRef, StageText};

/// A frame to be drawn.
#[derive(Clone)]
pub struct FrameRequest<'a> {
    /// The scene, whose camera looks.
    pub case: &'a PreparedScene,
    /// Which of its TOML files.
    pub toml: &'a Path,
    /// Width and height in pixels.
    pub size: (u32, u32),
    /// Whether to draw shadows.
    pub shadow_map: bool,
    /// How often it is drawn, one after the other; the last one is looked at.
    pub times: usize,
    /// Whether it is drawn once for each of [`Matrices::ALL`] instead, and each is looked at.
    pub each_matrices: bool,
    /// Stages to replace; all three where there is no plugin.
    pub stages: Vec<StageText>,
}

impl<'a> FrameRequest<'a> {
    /// The realtime image of a scene, on the film that it is judged on.
    pub fn plain(case: &'a PreparedScene) -> Self {
        let toml = case.realtime.as_path();
        let (size, stages) = (case.film(), Vec::new());
        Self { case, toml, size, shadow_map: false, times: 1, each_matrices: false, stages }
    }

    /// The realtime image with shadows, if the scene has one.
    pub fn bonus(case: &'a PreparedScene) -> Option<Self> {
        let toml = case.bonus.as_deref()?;
        Some(Self { toml, shadow_map: true, ..Self::plain(case) })
    }

    /// A scene's small film under other stages.
    pub fn probe(case: &'a PreparedScene, stages: Vec<StageText>) -> Self {
        Self { size: (case.probe_film.width, case.probe_film.height), stages, ..Self::plain(case) }
    }

    /// A scene's small film with shadows under other stages, if it has them.
    pub fn small_bonus(case: &'a PreparedScene, stages: Vec<StageText>) -> Option<Self> {
        let size = (case.probe_film.width, case.probe_film.height);
        Some(Self { size, stages, ..Self::bonus(case)? })
    }

    /// The request that asks a renderer for it, or Umbra's own pass, which takes no options.
    pub fn request(
        &self,
        session: &Session,
        renderer: Option<&Path>,
        adapter: &Adapter,
    ) -> Request {
        let path = self.toml.to_owned();
        let options = renderer.map_or(String::new(), |_| session.options.clone());
        Request::RenderRealtime {
            scene: SceneRef { path, options },
            width: self.size.0,
            height: self.size.1,
            shadow_map: self.shadow_map,
            adapter: adapter.clone(),
            stages: self.stages.clone(),
            cameras: match self.each_matrices {
                true => Matrices::ALL.map(|matrices| self.camera_of(matrices)).into(),
                false => vec![self.case.camera; self.times],
            },
        }
    }
}

impl FrameRequest<'_> {
    /// What an answer shows, if there is one.
    pub fn picture(&self, outcome: &Outcome) -> Option<Image> {
        Some(session::image(&outcome.answer()?.values, self.size.0, self.size.1))
    }

    /// The camera of a frame under other matrices: where they leave it at the origin, it looks at the scene from there.
    fn camera_of(&self, matrices: Matrices) -> CameraValue {
        let camera = match matrices {
            Matrices::WithoutTranslation => from_origin(&self.case.expected.scene).into(),
            _ => self.case.camera,
        };
        CameraValue { matrices, ..camera }
    }
}

/// Draws one frame in a worker of its own.
pub fn draw(session: &Session, plugin: Option<&Path>, frame: &FrameRequest) -> Outcome {
    let mut outcomes = draw_each(session, plugin, std::slice::from_ref(frame));
    outcomes.pop().unwrap_or_else(|| unreachable!("each frame has an outcome"))
}

/// Draws frames, all in one worker while it lives.
pub fn draw_each(
    session: &Session,
    plugin: Option<&Path>,
    frames: &[FrameRequest],
) -> Vec<Outcome> {
    let adapter = match &session.adapter {
        Ok(adapter) => adapter,
        Err(reason) => return vec![Outcome::NoAdapter(reason.clone()); frames.len()],
    };
    let requests = frames.iter().map(|frame| frame.request(session, plugin, adapter)).collect();
    let mut outcomes = session.run(plugin, requests);
    for (outcome, frame) in outcomes.iter_mut().zip(frames) {
        if let Outcome::Done(answer) = outcome {
            let floats = answer.values.len() / frame.times;
            answer.values.drain(..floats * (frame.times - 1));
        }
    }
    outcomes
}

/// The pictures of frames that a plugin draws; none where it draws none.
pub fn pictures(session: &Session, plugin: &Path, frames: &[FrameRequest]) -> Vec<Option<Image>> {
    let outcomes = draw_each(session, Some(plugin), frames);
    frames.iter().zip(&outcomes).map(|(frame, outcome)| frame.picture(outcome)).collect()
}

/// The same for the frames of several scenes: all in one worker, unless [`draw_scenes`] saw that one left something
/// behind for another.
pub fn pictures_of_scenes(
    session: &Session,
    plugin: &Path,
    scenes: &[Vec<FrameRequest>],
) -> Vec<Vec<Option<Image>>> {
    if session.scenes_interfere.load(Ordering::Relaxed) {
        return scenes.iter().map(|frames| pictures(session, plugin, frames)).collect();
    }
    let mut pictures = pictures(session, plugin, &scenes.concat()).into_iter();
    scenes.iter().map(|frames| pictures.by_ref().take(frames.len()).collect()).collect()
}

/// Draws the frames of several scenes with a plugin, all in one worker while it lives, where
/// drawing costs less. `is_right` says of a scene's outcomes, by its index, that they need no
/// second look.
pub fn draw_scenes(
    session: &Session,
    plugin: &Path,
    scenes: &[Vec<FrameRequest>],
    is_right: &dyn Fn(usize, &[Outcome]) -> bool,
) -> Vec<Vec<Outcome>> {
    let mut outcomes = draw_each(session, Some(plugin), &scenes.concat()).into_iter();
    let of_scene = |frames: &Vec<FrameRequest>| outcomes.by_ref().take(frames.len()).collect();
    let mut drawn: Vec<Vec<Outcome>> = scenes.iter().map(of_scene).collect();
    // A renderer may rely on a process of its own for each scene, as a command line gives it. So
    // what is wrong must be wrong alone. Where that is so for the last, nothing was left behind.
    let wrong: Vec<usize> = (0..scenes.len()).filter(|&i| !is_right(i, &drawn[i])).collect();
    let alone = |index: usize| draw_each(session, Some(plugin), &scenes[index]);
    if let Some((&last, others)) = wrong.split_last().filter(|(last, _)| **last > 0) {
        let own = alone(last);
        if !drawn[last].iter().zip(&own).all(|(shared, own)| same(shared, own)) {
            session.scenes_interfere.store(true, Ordering::Relaxed);
            drawn[last] = own;
            others.iter().for_each(|&index| drawn[index] = alone(index));
        }
    }
    drawn
}

/// Draws one frame of each scene, as [`draw_scenes`] does.
pub fn draw_one_each(
    session: &Session,
    plugin: &Path,
    frames: &[FrameRequest],
    is_right: &dyn Fn(&PreparedScene, &Outcome) -> bool,
) -> Vec<Outcome> {
    let scenes: Vec<Vec<FrameRequest>> = frames.iter().map(|frame| vec![frame.clone()]).collect();
    let all_right = |index: usize, outcomes: &[Outcome]| {
        outcomes.iter().all(|outcome| is_right(frames[index].case, outcome))
    };
    draw_scenes(session, plugin, &scenes, &all_right).into_iter().flatten().collect()
}

/// Whether two outcomes are the same, bit by bit; NaN equals itself.
fn same(a: &Outcome, b: &Outcome) -> bool {
    match (a.answer(), b.answer()) {
        (Some(a), Some(b)) => {
            let bits = |values: &[f32]| values.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            bits(&a.values) == bits(&b.values)
        }
        _ => a == b,
    }
}

/// Whether this machine can draw at all: asks Umbra's own pass for one small frame, and returns the adapter.
///
/// # Errors
/// Why not, in words.
pub fn probe_adapter(session: &Session, case: &PreparedScene) -> Result<String, String> {
    let stages = named([VERTEX, SHOW_NORMAL, SHOW_NORMAL].map(str::to_owned));
    match draw(session, None, &FrameRequest { size: (16, 16), ..FrameRequest::probe(case, stages) })
    {
        Outcome::Done(answer) => Ok(answer.adapter),
        Outcome::NoAdapter(message) | Outcome::Failed(message) => Err(message),
        Outcome::NotRun { reason, .. } => Err(reason),
        other => Err(other.to_string()),
    }
}
