//! The live view of `umbra watch`: a scene that the mouse turns, drawn by the student's own code.
//!
//! ```text
//! browser -- GET frame?path=realtime&scene=..&camera=.. --> LiveView --> one worker that stays (worker::LiveWorker)
//! browser -- GET frame?path=offline&spp=1, 4, 16 .. ------> LiveView --> one worker per picture (Supervisor::run_job)
//! ```
//! **Who draws.** The library of the last save that compiled. The check compiles it anyway and leaves it for the watch
//! (`umbra check --keep-plugin`, a hidden option). This process never loads it: a confined worker does.
//!
//! **Realtime.** One worker loads library and scene once, opens the pass, and draws a frame for each camera it is sent.
//! Another scene, shadow map or library means another worker. Frames are not pushed: the browser asks for the next
//! picture when it is ready for one, with the camera of that moment, so a slow renderer skips frames and never lags.
//! A newer library, or another scene of the same page, ends the worker that still draws: it may hang.
//!
//! **Offline.** A renderer takes its camera from a scene file. So each picture is a job with a scene file of its own:
//! the scene's, with the camera replaced, beside a link to the folder of its mesh. A camera that moved ends the job of
//! its own page; other pages wait for theirs.
//!
//! **Pixels** reach the browser as 16-bit floats; exposure is applied there, without asking anybody.
//!
//! **Errors** come back as text, which is shown in place of the picture. The page asks again after the next save. A
//! frame has limits on CPU time and on standing still; beyond them, its worker is ended.
//!
//! **Idle.** A worker without requests for a while ends, so an idle watch has no other process.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;
use std::{fs, io};

use anyhow::Context as _;
use basecode::scene::SceneConfig;
use basecode::{Matrices, ShadingKind};
use serde::Serialize;
use tempfile::TempDir;

use crate::assignment::{Assignment, SceneEntry};
use crate::cli::context::cores;
use crate::grading::RenderPath;
use crate::imaging::halves;
use crate::process::ProcessLimits;
use crate::worker::{
    Adapter, AdapterKind, Answer, CameraValue, Job, LiveWorker, Outcome, Request, SceneRef,
    Supervisor,
};

/// The most samples per pixel that a picture is asked for.
const MAX_SPP: u32 = 256;
/// CPU seconds of an offline picture, and how many more for each sample per pixel.
const OFFLINE_CPU_S: [u64; 2] = [10, 2];

/// What the browser asks for.
#[derive(Clone, Debug, PartialEq)]
pub struct FrameQuestion {
    path: RenderPath,
    /// Name of the scene.
    scene: String,
    shadows: bool,
    /// Samples per pixel, offline.
    spp: u32,
    camera: CameraValue,
    /// Which page asks: several may be open.
    viewer: u64,
}

impl FrameQuestion {
    /// Reads `path=realtime&scene=NAME&shadows=1&spp=4&viewer=7&camera=` with ten numbers: eye, at, up, and the
    /// vertical field of view in degrees. None for anything else.
    pub fn parse(query: &str) -> Option<Self> {
        let value =
            |key: &str| query.split('&').find_map(|pair| pair.strip_prefix(key)?.strip_prefix('='));
        let numbers: Vec<f32> =
            value("camera")?.split(',').map(str::parse).collect::<Result<_, _>>().ok()?;
        let &[ex, ey, ez, ax, ay, az, ux, uy, uz, fov_y_deg] = &*numbers else { return None };
        let camera = CameraValue {
            eye: [ex, ey, ez],
            at: [ax, ay, az],
            up: [ux, uy, uz],
            fov_y_deg,
            matrices: Matrices::Usual,
        };
        let spp = value("spp")?.parse().ok().filter(|spp| (1..=MAX_SPP).contains(spp))?;
        numbers.iter().all(|number| number.is_finite()).then_some(Self {
            path: match value("path")? {
                "realtime" => RenderPath::Realtime,
                "offline" => RenderPath::Offline,
                _ => return None,
            },
            scene: value("scene")?.to_owned(),
            shadows: value("shadows")? == "1",
            spp,
            camera,
            viewer: value("viewer")?.parse().ok()?,
        })
    }
}

/// A scene as the browser is told of it.
#[derive(Serialize)]
struct Scene {
    name: String,
    width: u32,
    height: u32,
    camera: CameraValue,
    #[serde(skip)]
    entry: SceneEntry,
}

/// What a live worker was started for: another question needs another one.
#[derive(Clone, PartialEq)]
struct Purpose {
    library: SystemTime,
    scene: String,
    shadow_map: bool,
}

/// The frame that is being drawn.
struct Drawing {
    /// The page that asked for it.
    viewer: u64,
    purpose: Purpose,
    /// Ends its worker.
    cancel: Arc<AtomicBool>,
}

/// Draws what the browser asks for.
pub struct LiveView {
    scenes: Vec<Scene>,
    root: PathBuf,
    supervisor: Supervisor,
    limits: ProcessLimits,
    /// The library of the last save that compiled, and when it was last seen to change.
    library: PathBuf,
    seen: Mutex<Option<SystemTime>>,
    realtime: Mutex<Option<(Purpose, LiveWorker)>>,
    /// What that worker is busy with; who takes it out ends the worker.
    drawing: Mutex<Option<Drawing>>,
    /// What each page asked to be drawn in real time last.
    wanted: Mutex<HashMap<u64, Purpose>>,
    /// The folder for scene files; held by who draws offline.
    offline: Mutex<TempDir>,
    /// Of each page, what ends the offline picture that it asked for last; by which camera that is.
    newest: Mutex<HashMap<u64, (Arc<AtomicBool>, CameraValue)>>,
    ended: AtomicBool,
}

impl LiveView {
    /// A view of the assignment's scenes, but for those that `only` does not name unless it is empty. Its files lie in
    /// the supervisor's scratch folder.
    ///
    /// # Errors
    /// When a scene cannot be read or a folder not be made.
    pub fn new(
        assignment: &Assignment,
        supervisor: &Supervisor,
        only: &[String],
    ) -> anyhow::Result<Self> {
        let Assignment { root, scenes, limits, .. } = assignment;
        let chosen = scenes.iter().filter(|entry| only.is_empty() || only.contains(&entry.name));
        let scene = |entry: &SceneEntry| {
            let config = SceneConfig::load(&root.join(&entry.realtime))?;
            let [width, height] = entry.film.unwrap_or([config.width as u32, config.height as u32]);
            let (name, camera) = (entry.name.clone(), config.camera.into());
            Ok::<_, basecode::Error>(Scene { name, width, height, camera, entry: entry.clone() })
        };
        let builder = tempfile::Builder::new().prefix("live-").tempdir_in(&supervisor.scratch);
        let folder = builder?;
        Ok(Self {
            scenes: chosen.map(scene).collect::<Result<_, _>>()?,
            root: root.clone(),
            supervisor: supervisor.clone(),
            limits: ProcessLimits { threads: cores(), ..limits.run.clone() },
            library: folder.path().join(crate::files::library_name("live")),
            seen: Mutex::default(),
            realtime: Mutex::default(),
            drawing: Mutex::default(),
            wanted: Mutex::default(),
            offline: Mutex::new(folder),
            newest: Mutex::default(),
            ended: AtomicBool::new(false),
        })
    }

    /// Where a check leaves the library.
    pub fn library(&self) -> &Path {
        &self.library
    }

    /// Whether there is another library than when this was asked last.
    pub fn has_new_library(&self) -> bool {
        let now = self.library_time().ok();
        now.is_some() && now != std::mem::replace(&mut lock(&self.seen), now)
    }

    fn library_time(&self) -> io::Result<SystemTime> {
        fs::metadata(&self.library)?.modified()
    }

    /// The scenes, as JSON.
    pub fn scenes(&self) -> String {
        serde_json::to_string(&self.scenes).unwrap_or_default()
    }

    /// Draws a picture: width, height, seconds, then red, green and blue of each pixel from the top, as 16-bit floats,
    /// all little-endian.
    ///
    /// None when the same page asked for another picture meanwhile.
    ///
    /// # Errors
    /// With the words for the browser when there is none.
    pub fn picture(&self, question: &FrameQuestion) -> Result<Option<Vec<u8>>, String> {
        let scene = self.scenes.iter().find(|scene| scene.name == question.scene);
        let scene = scene.ok_or("there is no such scene")?;
        let library = self.library_time().map_err(|_| "nothing has compiled yet".to_owned())?;
        let outcome = match question.path {
            RenderPath::Realtime => self.draw(scene, question, library).transpose(),
            RenderPath::Offline => self.render(scene, question),
        };
        match outcome {
            None => Ok(None),
            Some(Ok(Outcome::Done(answer))) => Ok(Some(bytes(scene, &answer))),
            Some(Ok(Outcome::TimedOut(late))) => Err(format!("{}: {late}", late.what())),
            Some(Ok(outcome)) => Err(outcome.to_string()),
            Some(Err(error)) => Err(format!("not drawn here: {error:#}")),
        }
    }

    /// None when it was given up for a newer library, or for another question of the same page.
    fn draw(
        &self,
        scene: &Scene,
        question: &FrameQuestion,
        library: SystemTime,
    ) -> anyhow::Result<Option<Outcome>> {
        // A camera that moves on needs no picture of where it was.
        if let Some((cancel, camera)) = lock(&self.newest).get(&question.viewer)
            && *camera != question.camera
        {
            cancel.store(true, Ordering::Release);
        }
        let viewer = question.viewer;
        let purpose = Purpose { library, scene: scene.name.clone(), shadow_map: question.shadows };
        lock(&self.wanted).insert(viewer, purpose.clone());
        self.give_up(|older| {
            older.purpose.library != library || older.viewer == viewer && older.purpose != purpose
        });
        let is_wanted = || {
            !self.ended.load(Ordering::Acquire)
                && self.library_time().is_ok_and(|newest| newest == library)
                && lock(&self.wanted).get(&viewer) == Some(&purpose)
        };
        let mut current = lock(&self.realtime);
        let bonus = scene.entry.bonus.as_ref().filter(|_| question.shadows);
        // One that had just ended, for nobody asked it, is started again.
        for _ in 0..2 {
            anyhow::ensure!(!self.ended.load(Ordering::Acquire), "the watch has ended");
            let fitting = current.take().filter(|(its, _)| *its == purpose);
            let mut worker = match fitting {
                Some((_, worker)) => worker,
                None => {
                    let toml = self.root.join(bonus.unwrap_or(&scene.entry.realtime));
                    let request = Request::RenderRealtime {
                        scene: SceneRef { path: toml, options: String::new() },
                        width: scene.width,
                        height: scene.height,
                        shadow_map: question.shadows,
                        adapter: Adapter { kind: AdapterKind::Any, name: String::new() },
                        stages: Vec::new(),
                        cameras: vec![question.camera],
                    };
                    let library = self.library.clone();
                    LiveWorker::start(&self.supervisor, library, request, &self.limits)?
                }
            };
            let (purpose, cancel) = (purpose.clone(), worker.canceller());
            *lock(&self.drawing) = Some(Drawing { viewer, purpose: purpose.clone(), cancel });
            // What is asked for from here on sees what is being drawn.
            let drawn =
                if is_wanted() { worker.frame(&question.camera)? } else { return Ok(None) };
            if lock(&self.drawing).take().is_none() {
                return Ok(None);
            }
            match drawn {
                Some(outcome @ Outcome::Done(_)) => {
                    *current = Some((purpose, worker));
                    return Ok(Some(outcome));
                }
                Some(outcome) => return Ok(Some(outcome)),
                None => {}
            }
        }
        anyhow::bail!("the worker ended at once")
    }

    /// Ends what is being drawn in real time, if it is so.
    fn give_up(&self, is_given_up: impl FnOnce(&Drawing) -> bool) {
        if let Some(older) = lock(&self.drawing).take_if(|older| is_given_up(older)) {
            older.cancel.store(true, Ordering::Release);
        }
    }

    /// None when it was given up for another question.
    fn render(&self, scene: &Scene, question: &FrameQuestion) -> Option<anyhow::Result<Outcome>> {
        let cancel = Arc::<AtomicBool>::default();
        let new = (Arc::clone(&cancel), question.camera);
        if let Some((older, _)) = lock(&self.newest).insert(question.viewer, new) {
            older.store(true, Ordering::Release);
        }
        let outcome = self.render_until(scene, question, &cancel);
        let mut newest = lock(&self.newest);
        if newest.get(&question.viewer).is_some_and(|(own, _)| Arc::ptr_eq(own, &cancel)) {
            newest.remove(&question.viewer);
        }
        let given_up = cancel.load(Ordering::Acquire);
        (!given_up || matches!(outcome, Ok(Outcome::Done(_)))).then_some(outcome)
    }

    fn render_until(
        &self,
        scene: &Scene,
        question: &FrameQuestion,
        cancel: &Arc<AtomicBool>,
    ) -> anyhow::Result<Outcome> {
        // Other pages wait their turn.
        let folder = lock(&self.offline);
        if self.ended.load(Ordering::Acquire) {
            cancel.store(true, Ordering::Release);
        }
        let config = SceneConfig::load(&self.root.join(&scene.entry.offline))?;
        let path = moved(folder.path(), scene, &config, &question.camera)
            .context("cannot write a scene file")?;
        let request = Request::RenderOffline {
            scene: SceneRef { path, options: String::new() },
            width: scene.width,
            height: scene.height,
            spp: question.spp,
            seed: 0,
            threads: cores(),
            shadows: question.shadows,
        };
        let job = Job { plugin: Some(self.library.clone()), requests: vec![request] };
        let [fixed, each] = OFFLINE_CPU_S;
        let limits =
            ProcessLimits { cpu_s: fixed + each * u64::from(question.spp), ..self.limits.clone() };
        let mut report = self.supervisor.run_job(&job, &limits, cancel, &mut |_| ());
        report.outcomes.pop().context("the worker gave no answer")
    }

    /// Ends what is drawn, for good.
    pub fn end(&self) {
        self.ended.store(true, Ordering::Release);
        for (cancel, _) in lock(&self.newest).values() {
            cancel.store(true, Ordering::Release);
        }
        self.give_up(|_| true);
        drop(lock(&self.offline));
        lock(&self.realtime).take();
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Writes the file of a scene that is looked at by another camera, beside a link to the folder of its mesh.
fn moved(
    folder: &Path,
    scene: &Scene,
    config: &SceneConfig,
    camera: &CameraValue,
) -> io::Result<PathBuf> {
    let own = folder.join(&scene.name);
    if !own.is_dir() {
        fs::create_dir(&own)?;
        let mesh = config.mesh.parent().unwrap_or(Path::new(".")).canonicalize()?;
        link(&mesh, &own.join("mesh"))?;
    }
    let mesh = Path::new("mesh").join(config.mesh.file_name().unwrap_or_default());
    let mesh = toml::Value::String(mesh.to_string_lossy().into_owned());
    let CameraValue { eye, at, up, fov_y_deg, .. } = camera;
    let kind = match config.kind {
        ShadingKind::Simple => "simple",
        ShadingKind::Normal => "normal",
    };
    let text = format!(
        "[input]\nobjfile = {mesh}\n\n[camera]\neye = {eye:?}\nat = {at:?}\nup = {up:?}\nfov = {fov_y_deg:?}\n\n\
         [film]\nwidth = {}\nheight = {}\n\n[renderer]\nrealtime = false\ntype = \"{kind}\"\nspp = {}\n",
        config.width, config.height, config.spp
    );
    let path = own.join("view.toml");
    fs::write(&path, text)?;
    Ok(path)
}

#[cfg(unix)]
fn link(folder: &Path, at: &Path) -> io::Result<()> {
    std::os::unix::fs::symlink(folder, at)
}

#[cfg(not(unix))]
fn link(_folder: &Path, _at: &Path) -> io::Result<()> {
    Err(io::Error::other("no offline pictures by another camera on this system"))
}

fn bytes(scene: &Scene, answer: &Answer) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(12 + 2 * answer.values.len());
    bytes.extend(scene.width.to_le_bytes());
    bytes.extend(scene.height.to_le_bytes());
    bytes.extend((answer.seconds as f32).to_le_bytes());
    bytes.extend_from_slice(bytemuck::cast_slice(&halves::of(&answer.values)));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_question_says_all_or_is_none() {
        let whole =
            "path=offline&scene=cbox&shadows=1&spp=4&viewer=7&camera=1,2,3,4,5,6,0,1,0,30.5";
        let question = FrameQuestion::parse(whole).unwrap();
        assert_eq!((question.path, question.spp, question.shadows), (RenderPath::Offline, 4, true));
        assert_eq!((question.camera.at, question.camera.fov_y_deg), ([4.0, 5.0, 6.0], 30.5));
        for (part, other) in [
            ("path=offline", "path=both"),
            ("path=offline&", ""),
            ("spp=4", "spp=0"),
            ("spp=4", "spp=100000"),
            ("spp=4", "spp=-1"),
            (",30.5", ""),
            (",30.5", ",30.5,1"),
            ("30.5", "NaN"),
            ("=1,2", "=inf,2"),
            ("&camera", "&kamera"),
            ("viewer=7&", ""),
        ] {
            assert_eq!(FrameQuestion::parse(&whole.replace(part, other)), None, "{part} {other}");
        }
    }

    #[test]
    fn a_moved_camera_is_all_that_changes() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let assignment = Assignment::load(&root).unwrap();
        let folder = tempfile::tempdir().unwrap();
        for entry in assignment.scenes {
            let config = SceneConfig::load(&root.join(&entry.offline)).unwrap();
            let mut camera = CameraValue::from(config.camera);
            camera.eye[0] += 1e-7;
            let (name, width, height) = (entry.name.clone(), 1, 1);
            let scene = Scene { name, width, height, camera, entry };
            let path = moved(folder.path(), &scene, &config, &camera).unwrap();
            let read = SceneConfig::load(&path).unwrap();
            assert_eq!(CameraValue::from(read.camera), camera);
            let [a, b] = [&read.mesh, &config.mesh].map(|mesh| mesh.canonicalize().unwrap());
            assert_eq!(a, b);
            let expected = SceneConfig {
                path: read.path.clone(),
                mesh: read.mesh.clone(),
                camera: read.camera,
                ..config
            };
            assert_eq!(read, expected);
        }
    }
}
