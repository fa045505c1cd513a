//! A scene made ready for judging: its files, its expected images, its rays.

use std::path::PathBuf;
use std::sync::OnceLock;

use anyhow::Context;
use basecode::scene::SceneConfig;
use basecode::{Image, MaterialModel, Scene};
use rayon::prelude::*;

use crate::assignment::SceneEntry;
use crate::evidence::loops::{RAYS, SAMPLED_WIDTH, SampledFilm};
use crate::evidence::rays::RayBatch;
use crate::expected::{Expected, SurfaceBuffer};
use crate::imaging::reference::RegionMask;
use crate::store::Store;
use crate::worker::{CameraValue, RayQuery};

/// The widest film on which rays and stages are judged: enough to show every surface.
const SMALL_WIDTH: u32 = 96;
/// Width of the film on which an offline image of a large scene is judged first.
const FIRST_WIDTH: u32 = 128;
/// A scene is large when its film has so many times the pixels of that one.
const LARGE: u32 = 4;
/// A film so many times as wide is searched for points close to what shadows them.
const FINE: usize = 3;

/// A scene made ready for judging. Made once, used for every submission.
pub struct PreparedScene {
    /// What the assignment says of it.
    pub entry: SceneEntry,
    /// Whether students never see it.
    pub held_back: bool,
    /// The offline TOML file, absolute.
    pub offline: PathBuf,
    /// The realtime TOML file, absolute.
    pub realtime: PathBuf,
    /// The realtime TOML file with shadows, absolute.
    pub bonus: Option<PathBuf>,
    /// Samples per pixel of the offline image.
    pub spp: u32,
    /// The camera.
    pub camera: CameraValue,
    /// What is expected on the film it is judged on.
    pub expected: Expected,
    /// The same on a small film, where that one is large. An offline image that is right there is right: it
    /// is drawn on the scene's own film to be shown and compared where it is wrong, and on one scene always.
    pub first: Option<Expected>,
    /// The small film.
    pub probe_film: ProbeFilm,
    /// The unambiguous rays of the small film, once somebody asks: see [`PreparedScene::batch`].
    pub batch: OnceLock<RayBatch>,
}

/// A small film of a scene, on which single rays are judged.
pub struct ProbeFilm {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// What each pixel's center sees.
    pub surface: SurfaceBuffer,
    /// Regions with shadows.
    pub mask: RegionMask,
    /// Regions without shadows.
    pub unshadowed_mask: RegionMask,
    /// What several samples a pixel are judged on; of scenes with stored images alone.
    pub sampled: Option<Sampled>,
    /// What a stage that shades is compared with: centers, without shadows.
    pub unshadowed: Image,
    /// The same without renormalized normals; see [`Expected::interpolated_normals`].
    pub interpolated_normals: Option<Image>,
}

/// A film on which a render of several samples per pixel is judged.
pub struct Sampled {
    /// Its size, and where in their pixels its rays go through.
    pub film: SampledFilm,
    /// The rays, pixel by pixel.
    pub rays: Vec<RayQuery>,
}

impl Sampled {
    fn new(scene: &Scene, [full_width, full_height]: [u32; 2]) -> anyhow::Result<Self> {
        let width = full_width.min(SAMPLED_WIDTH);
        let film = SampledFilm::new(width, (full_height * width / full_width).max(1));
        let camera = scene.camera(film.width as usize, film.height as usize)?;
        let rays = film.offsets.iter().enumerate().map(|(index, [jx, jy])| {
            let pixel = index as u32 / RAYS;
            let (x, y) = ((pixel % film.width) as f32, (pixel / film.width) as f32);
            super::session::ray(&camera.ray(x + jx, y + jy))
        });
        Ok(Self { rays: rays.collect(), film })
    }
}

/// The small film of a film, width and height in pixels.
fn probe_film_size([full_width, full_height]: [u32; 2]) -> [u32; 2] {
    let width = full_width.min(SMALL_WIDTH);
    [width, (full_height * width / full_width).max(1)]
}

/// The film that an offline image is judged on first, if the scene's own film is large.
fn first_film([width, height]: [u32; 2]) -> Option<[u32; 2]> {
    let first = [FIRST_WIDTH, (height * FIRST_WIDTH / width.max(1)).max(1)];
    (width * height >= LARGE * first[0] * first[1]).then_some(first)
}

/// The mask with mirrors left out: they have no BSDF that light and shadow could be told by.
fn without_mirrors(scene: &Scene, surface: &SurfaceBuffer, mask: &RegionMask) -> RegionMask {
    let mut mask = mask.clone();
    for (value, (_, point)) in mask.pixels.iter_mut().zip(&surface.pixels) {
        let model = point.as_ref().map(|point| scene.material_of(point.shape).model);
        if model == Some(MaterialModel::Mirror) {
            *value |= RegionMask::EMITTER;
        }
    }
    mask
}

impl PreparedScene {
    /// Makes scenes ready, several at once.
    ///
    /// # Errors
    /// Of the first that cannot be loaded, or whose expected images cannot be had.
    pub fn all(store: &Store, entries: &[SceneEntry]) -> anyhow::Result<Vec<Self>> {
        let prepare = |entry: &SceneEntry| {
            (store.progress)(&format!("preparing scene {}", entry.name));
            Self::new(store, entry)
        };
        let ready: Vec<_> = entries.par_iter().map(prepare).collect();
        let cannot = |entry: &SceneEntry| format!("scene \"{}\" cannot be used", entry.name);
        ready.into_iter().zip(entries).map(|(case, of)| case.with_context(|| cannot(of))).collect()
    }

    /// Makes a scene ready.
    ///
    /// # Errors
    /// When the scene cannot be loaded or its expected images cannot be had.
    pub fn new(store: &Store, entry: &SceneEntry) -> anyhow::Result<Self> {
        let at = |path: &PathBuf| std::path::absolute(store.assignment.root.join(path));
        let (offline, realtime) = (at(&entry.offline)?, at(&entry.realtime)?);
        let config = SceneConfig::load(&offline)?;
        let expected = store.expected(entry)?;
        let film = [expected.unshadowed.width as u32, expected.unshadowed.height as u32];
        let first = first_film(film)
            .map(|film| store.expected(&SceneEntry { film: Some(film), ..entry.clone() }))
            .transpose()?;
        let [width, height] = probe_film_size(film);
        let (w, h) = (width as usize, height as usize);
        let scene = &expected.scene;
        let surface = SurfaceBuffer::new(scene, w, h)?;
        let [mask, unshadowed_mask] = store.masks(&offline, scene, width, height)?;
        let probe_film = ProbeFilm {
            width,
            height,
            unshadowed_mask,
            unshadowed: store.unshadowed(&offline, width, height)?,
            interpolated_normals: store.interpolated_normals(&realtime, width, height)?,
            sampled: None,
            surface,
            mask,
        };
        let case = Self {
            offline,
            realtime,
            bonus: entry.bonus.as_ref().map(at).transpose()?,
            spp: config.spp as u32,
            camera: CameraValue::from(config.camera),
            expected,
            first,
            probe_film,
            batch: OnceLock::new(),
            entry: entry.clone(),
            held_back: false,
        };
        // The loop is the same on every scene: those that have most to show are enough.
        if entry.stored { case.with_samples() } else { Ok(case) }
    }

    /// The unambiguous rays of the small film: casting them takes as long as all else that makes a scene ready, and
    /// what does not build needs none.
    pub fn batch(&self) -> &RayBatch {
        self.batch.get_or_init(|| {
            let (scene, film) = (&self.expected.scene, &self.probe_film);
            let asked = without_mirrors(scene, &film.surface, &film.mask);
            let batch = RayBatch::new(&self.entry.name, scene, &film.surface, &asked);
            let (width, height) = (film.width as usize, film.height as usize);
            match SurfaceBuffer::new(scene, FINE * width, FINE * height) {
                Ok(fine) => batch.with_contacts(scene, &fine, width),
                // A camera has a frame on any film, or on none.
                Err(_) => batch,
            }
        })
    }

    /// Casts the rays of scenes, several at once.
    pub fn cast_rays(cases: &[Self]) {
        cases.par_iter().for_each(|case| {
            case.batch();
        });
    }

    /// The scene with what the render loop is asked at several samples per pixel.
    ///
    /// # Errors
    /// When its camera has no rays.
    pub(super) fn with_samples(mut self) -> anyhow::Result<Self> {
        let film = [self.expected.unshadowed.width as u32, self.expected.unshadowed.height as u32];
        self.probe_film.sampled = Some(Sampled::new(&self.expected.scene, film)?);
        Ok(self)
    }

    /// The files that the reference renderer makes for a scene, on all its films; some may be
    /// stored elsewhere or not needed, and do not exist.
    ///
    /// # Errors
    /// When the scene cannot be read.
    pub fn made_files(store: &Store, entry: &SceneEntry) -> anyhow::Result<Vec<PathBuf>> {
        let at = |path: &PathBuf| std::path::absolute(store.assignment.root.join(path));
        let (offline, realtime) = (at(&entry.offline)?, at(&entry.realtime)?);
        let config = SceneConfig::load(&offline)?;
        let film = entry.film.unwrap_or([config.width as u32, config.height as u32]);
        let mut files = store.made_files(&offline, &realtime, film)?;
        for film in [Some(probe_film_size(film)), first_film(film)].into_iter().flatten() {
            files.extend(store.made_files(&offline, &realtime, film)?);
        }
        Ok(files)
    }

    /// Whether it only shows what others do not: no submission holds an image of it.
    pub fn is_probe(&self) -> bool {
        self.entry.submitted.is_none() && self.bonus.is_none()
    }

    /// Width and height of the film that the scene is judged on, in pixels.
    pub fn film(&self) -> (u32, u32) {
        (self.expected.unshadowed.width as u32, self.expected.unshadowed.height as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_large_film_is_tried_on_a_small_one_of_its_shape() {
        assert_eq!(first_film([640, 480]), Some([128, 96]));
        assert_eq!(first_film([600, 450]), Some([128, 96]));
        assert_eq!(first_film([4000, 10]), Some([128, 1]));
        assert_eq!(first_film([256, 192]), Some([128, 96]));
        for small in [[255, 192], [128, 96], [96, 64], [1, 1]] {
            assert_eq!(first_film(small), None, "{small:?}");
        }
    }
}
