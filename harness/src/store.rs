//! Where expected images come from: the repository, a cache, or the reference renderer.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, bail, ensure};
use basecode::exr_io::{ExrLayers, Precision, read_exr_layers, write_exr_layers};
use basecode::{Image, Scene, Vec3};
use sha2::{Digest, Sha256};

use crate::assignment::{Assignment, SceneEntry};
use crate::expected::{Expected, load_scene, region_table, regions};
use crate::files::{feed, hex, library_name};
use crate::imaging::reference::{ReferenceImage, RegionMask};
use crate::process::ProcessLimits;
use crate::worker::{
    Adapter, AdapterKind, CameraValue, Job, Outcome, Request, SceneRef, Supervisor,
};

/// Batches that an expected image is the mean of; their spread is its variance.
const BATCHES: u32 = 64;
/// Samples per pixel of one batch for images kept in the repository: 512 in all.
const STORED_SPP: u32 = 8;
/// Samples per pixel of one batch for images that are made when needed: 256 in all.
const CACHED_SPP: u32 = 4;
/// Batches asked of one worker at a time, so that its memory stays small.
const BATCHES_PER_JOB: u32 = 8;
/// The seed of the first batch. Not a student id.
const FIRST_SEED: u64 = 0x5EED_0000_0000_0000;

/// The reference renderer's library: where cargo builds it below the assignment's root, else beside the
/// program `umbra`. A student's kit has none.
pub fn reference_library(root: &Path, umbra: &Path) -> Option<PathBuf> {
    let name = library_name("reference_impl");
    let built = root.join("target/release").join(&name);
    [built, umbra.with_file_name(&name)].into_iter().find(|library| library.is_file())
}

/// Finds, makes and keeps expected images.
pub struct Store<'a> {
    /// The assignment.
    pub assignment: &'a Assignment,
    /// The reference renderer's library; absent in a student's kit.
    pub reference: Option<PathBuf>,
    /// Starts its workers.
    pub supervisor: &'a Supervisor,
    /// Threads to render with.
    pub threads: u32,
    /// Told what long work is being done.
    pub progress: &'a (dyn Fn(&str) + Sync),
}

/// What a blessing changed.
#[derive(Clone, Debug)]
pub struct Blessing {
    /// The file.
    pub file: PathBuf,
    /// Mean radiance of the image before, when there was one.
    pub old_mean: Option<f64>,
    /// Mean radiance of the new image.
    pub new_mean: f64,
    /// RMSE between old and new means, when both have one size.
    pub rmse: Option<f64>,
    /// Provenance of the new image.
    pub attributes: BTreeMap<String, String>,
}

impl Store<'_> {
    /// What is expected of a scene on the film it is judged on.
    ///
    /// # Errors
    /// When the scene cannot be loaded, a stored image is missing, broken or stale, or what is
    /// needed is neither stored nor cached and there is no reference renderer.
    pub fn expected(&self, entry: &SceneEntry) -> anyhow::Result<Expected> {
        let toml = self.assignment.root.join(&entry.offline);
        let scene = load_scene(&toml)?;
        let own = [scene.config().width as u32, scene.config().height as u32];
        let [width, height] = entry.film.unwrap_or(own);
        let stored = entry.stored && [width, height] == own;
        let (mean, variance, n, center) = if stored {
            self.stored(entry, &toml, width, height)?
        } else {
            let file = self.cached(&toml, width, height, "offline")?;
            let layers = self.layers(&file, &["mean", "variance", "centre"], || {
                self.render_offline(&toml, width, height, CACHED_SPP)
            })?;
            let [mean, variance, center] = layers;
            (mean, variance, BATCHES * CACHED_SPP, center)
        };
        let unshadowed = self.unshadowed(&toml, width, height)?;
        let [mask, unshadowed_mask] = self.masks(&toml, &scene, width, height)?;
        let offline = ReferenceImage::new(mean, variance, n, center, mask)
            .with_context(|| format!("scene \"{}\"", entry.name))?;
        let realtime = self.assignment.root.join(&entry.realtime);
        let interpolated_normals = self.interpolated_normals(&realtime, width, height)?;
        Ok(Expected { scene, offline, unshadowed, unshadowed_mask, interpolated_normals })
    }

    /// The regions of a scene, as [`regions`].
    ///
    /// # Errors
    /// When the scene's camera has no frame, or the cache cannot be used.
    pub fn masks(
        &self,
        toml: &Path,
        scene: &Scene,
        width: u32,
        height: u32,
    ) -> anyhow::Result<[RegionMask; 2]> {
        let file = self.cached(toml, width, height, "masks")?;
        let masks = self.layers(&file, &["shadowed", "unshadowed"], || {
            let [with, without] = regions(scene, width as usize, height as usize)?;
            let layers =
                [("shadowed".into(), with.to_image()), ("unshadowed".into(), without.to_image())];
            Ok(ExrLayers { layers: layers.into(), ..Default::default() })
        })?;
        Ok(masks.map(|image| RegionMask::of_image(region_table(scene), &image)))
    }

    /// The pixel-center image of a scene without shadows.
    ///
    /// # Errors
    /// As [`Store::expected`].
    pub fn unshadowed(&self, toml: &Path, width: u32, height: u32) -> anyhow::Result<Image> {
        let file = self.cached(toml, width, height, "realtime")?;
        let [image] = self.layers(&file, &["unshadowed"], || {
            let mut request = self.request(toml, width, height, 1, 0, false);
            request.scene_mut().options = "materials=realtime".into();
            let image = self.render(request)?;
            Ok(ExrLayers { layers: [("unshadowed".into(), image)].into(), ..Default::default() })
        })?;
        Ok(image)
    }

    /// What the reference draws of a realtime scene without shadows when its fragment stages do not
    /// renormalize the interpolated normal; nothing when it is not kept and cannot be drawn here.
    ///
    /// # Errors
    /// When the scene or the cache cannot be used.
    pub fn interpolated_normals(
        &self,
        toml: &Path,
        width: u32,
        height: u32,
    ) -> anyhow::Result<Option<Image>> {
        let file = self.cached(toml, width, height, "raw-normals")?;
        let camera = basecode::scene::SceneConfig::load(toml)?.camera;
        let draw_with = |kind| {
            let request = Request::RenderRealtime {
                scene: SceneRef { path: toml.to_owned(), options: "mistake=normals-raw".into() },
                width,
                height,
                shadow_map: false,
                adapter: Adapter { kind, name: String::new() },
                stages: Vec::new(),
                cameras: vec![CameraValue::from(camera)],
            };
            let image = self.render(request)?;
            Ok(ExrLayers { layers: [("raw".into(), image)].into(), ..Default::default() })
        };
        // The same on every machine, where it can be.
        let draw = || draw_with(AdapterKind::Software).or_else(|_| draw_with(AdapterKind::Any));
        // Without an adapter nothing realtime is judged, so that nobody misses it.
        Ok(self.layers(&file, &["raw"], draw).ok().map(|[image]| image))
    }

    /// Renders the expected image of a stored scene again and replaces the file.
    ///
    /// # Errors
    /// When there is no reference renderer, it fails, or the file cannot be written.
    pub fn bless(&self, entry: &SceneEntry) -> anyhow::Result<Blessing> {
        let toml = self.assignment.root.join(&entry.offline);
        let scene = load_scene(&toml)?;
        let (width, height) = (scene.config().width as u32, scene.config().height as u32);
        let mut layers = self.render_offline(&toml, width, height, STORED_SPP)?;
        layers.attributes = self.provenance(&toml, STORED_SPP)?;
        let file = self.assignment.expected_file(entry);
        let old = read_exr_layers(&file).ok().and_then(|mut old| old.layers.remove("mean"));
        let new = &layers.layers["mean"];
        let blessing = Blessing {
            old_mean: old.as_ref().map(mean_radiance),
            new_mean: mean_radiance(new),
            rmse: old
                .filter(|old| (old.width, old.height) == (new.width, new.height))
                .map(|old| crate::imaging::metrics::mse(new, &old).sqrt()),
            attributes: layers.attributes.clone(),
            file: file.clone(),
        };
        std::fs::create_dir_all(file.parent().unwrap_or(Path::new("")))?;
        write_exr_layers(&file, &layers, Precision::Float)?;
        Ok(blessing)
    }

    fn provenance(&self, toml: &Path, spp: u32) -> anyhow::Result<BTreeMap<String, String>> {
        let attribute = |key: &str, value: String| (key.to_owned(), value);
        Ok([
            attribute("scene_sha256", scene_digest(toml)?),
            attribute("umbra_version", env!("CARGO_PKG_VERSION").to_owned()),
            attribute("samples_per_pixel", (BATCHES * spp).to_string()),
            attribute("first_seed", FIRST_SEED.to_string()),
        ]
        .into())
    }

    fn stored(
        &self,
        entry: &SceneEntry,
        toml: &Path,
        width: u32,
        height: u32,
    ) -> anyhow::Result<(Image, Image, u32, Image)> {
        let file = self.assignment.expected_file(entry);
        let hint = "hint: `umbra bless` renders expected images";
        let mut content = read_exr_layers(&file)
            .with_context(|| format!("scene \"{}\" has no expected image; {hint}", entry.name))?;
        let attribute = |key: &str| content.attributes.get(key).map_or("", String::as_str);
        ensure!(
            attribute("scene_sha256") == scene_digest(toml)?,
            "{}: made from another version of the scene; {hint}",
            file.display()
        );
        let n = attribute("samples_per_pixel").parse().with_context(|| {
            format!(
                "{}: samples_per_pixel is \"{}\"",
                file.display(),
                attribute("samples_per_pixel")
            )
        })?;
        let mut take = |name: &str| {
            let image = content.layers.remove(name);
            let image = image.with_context(|| format!("{}: no layer {name}", file.display()))?;
            ensure!(
                (image.width, image.height) == (width as usize, height as usize),
                "{}: {}x{} pixels, expected {width}x{height}",
                file.display(),
                image.width,
                image.height
            );
            Ok(image)
        };
        Ok((take("mean")?, take("variance")?, n, take("centre")?))
    }

    /// The files of what is made for a scene on a film.
    ///
    /// # Errors
    /// When the scene cannot be read.
    pub(crate) fn made_files(
        &self,
        offline: &Path,
        realtime: &Path,
        [width, height]: [u32; 2],
    ) -> anyhow::Result<Vec<PathBuf>> {
        let own = ["offline", "realtime", "masks"].map(|what| (offline, what));
        let files = own.into_iter().chain([(realtime, "raw-normals")]);
        files.map(|(toml, what)| self.cached(toml, width, height, what)).collect()
    }

    /// The file of something made from a scene, in a kit or in the cache; its name holds all that it
    /// depends on.
    fn cached(&self, toml: &Path, width: u32, height: u32, what: &str) -> anyhow::Result<PathBuf> {
        let mut hash = Sha256::new();
        hash.update(scene_digest(toml)?);
        hash.update(format!(
            "{width} {height} {what} {BATCHES} {CACHED_SPP} {}",
            env!("CARGO_PKG_VERSION")
        ));
        let name = format!("{what}-{}.exr", &hex(&hash.finalize())[..24]);
        let made = self.assignment.made().join(&name);
        Ok(if made.is_file() { made } else { self.assignment.cache().join("expected").join(name) })
    }

    /// Whether the reference renderer was built after a file of the cache was made.
    fn outdated(&self, file: &Path) -> bool {
        let changed = |path: &Path| path.metadata().and_then(|metadata| metadata.modified()).ok();
        let ours = file.starts_with(self.assignment.cache());
        ours && self.reference.as_deref().and_then(changed) > changed(file)
    }

    /// Reads layers of a cache file, or makes and keeps them.
    fn layers<const N: usize>(
        &self,
        file: &Path,
        names: &[&str; N],
        make: impl FnOnce() -> anyhow::Result<ExrLayers>,
    ) -> anyhow::Result<[Image; N]> {
        let mut content = match read_exr_layers(file) {
            Ok(content) if !self.outdated(file) => content,
            _ => {
                let content = make()?;
                let folder = file.parent().unwrap_or(Path::new(""));
                std::fs::create_dir_all(folder)?;
                // Another process may make the same file: whoever is last renames a whole one.
                let draft = tempfile::Builder::new().suffix(".exr").tempfile_in(folder)?;
                write_exr_layers(draft.path(), &content, Precision::Float)?;
                draft.persist(file)?;
                content
            }
        };
        let mut images = Vec::new();
        for name in names {
            let image = content.layers.remove(*name);
            images.push(image.with_context(|| format!("{}: no layer {name}", file.display()))?);
        }
        images.try_into().map_err(|_| anyhow::anyhow!("as many layers as names"))
    }

    fn render_offline(
        &self,
        toml: &Path,
        width: u32,
        height: u32,
        spp: u32,
    ) -> anyhow::Result<ExrLayers> {
        let count = (width * height) as usize;
        let (mut sum, mut square) =
            (vec![glam::DVec3::ZERO; count], vec![glam::DVec3::ZERO; count]);
        for first in (0..BATCHES).step_by(BATCHES_PER_JOB as usize) {
            (self.progress)(&format!(
                "reference: {} at {width}x{height}, {} of {} spp",
                toml.file_stem().unwrap_or_default().display(),
                first * spp,
                BATCHES * spp
            ));
            let seeds = first..(first + BATCHES_PER_JOB).min(BATCHES);
            let requests = seeds
                .map(|batch| self.request(toml, width, height, spp, u64::from(batch) << 32, true))
                .collect();
            for image in self.ask(requests)? {
                for (index, value) in image.as_chunks::<3>().0.iter().enumerate() {
                    let value = Vec3::from(*value).as_dvec3();
                    sum[index] += value;
                    square[index] += value * value;
                }
            }
        }
        let batches = f64::from(BATCHES);
        let image = |of: &dyn Fn(usize) -> glam::DVec3| Image {
            width: width as usize,
            height: height as usize,
            pixels: (0..count).map(|index| of(index).as_vec3()).collect(),
        };
        let mean = image(&|index| sum[index] / batches);
        // The variance of one sample is spp times that of a batch's mean.
        let variance = image(&|index| {
            let spread = (square[index] - sum[index] * sum[index] / batches) / (batches - 1.0);
            (f64::from(spp) * spread).max(glam::DVec3::ZERO)
        });
        let center = self.render(self.request(toml, width, height, 1, 0, true))?;
        let layers = [("mean", mean), ("variance", variance), ("centre", center)];
        let layers = layers.map(|(name, image)| (name.to_owned(), image)).into();
        Ok(ExrLayers { layers, ..Default::default() })
    }

    fn render(&self, request: Request) -> anyhow::Result<Image> {
        let (Request::RenderOffline { width, height, .. }
        | Request::RenderRealtime { width, height, .. }) = request
        else {
            bail!("only images are made here");
        };
        let answers = self.ask(vec![request])?;
        let pixels = answers[0].as_chunks::<3>().0.iter().map(|&value| Vec3::from(value)).collect();
        Ok(Image { width: width as usize, height: height as usize, pixels })
    }

    fn request(
        &self,
        toml: &Path,
        width: u32,
        height: u32,
        spp: u32,
        seed: u64,
        shadows: bool,
    ) -> Request {
        Request::RenderOffline {
            scene: SceneRef { path: toml.to_owned(), options: String::new() },
            width,
            height,
            spp,
            seed: FIRST_SEED + seed,
            threads: self.threads,
            shadows,
        }
    }

    fn ask(&self, requests: Vec<Request>) -> anyhow::Result<Vec<Vec<f32>>> {
        let Some(reference) = &self.reference else {
            bail!(
                "an expected image is not stored and there is no reference renderer to make it; \
                 hint: the scene is not one of the public scenes of this kit"
            );
        };
        let job = Job { plugin: Some(reference.clone()), requests };
        let limits = ProcessLimits {
            wall_s: 600.0,
            cpu_s: 1200,
            file_size_mib: 1024,
            ..ProcessLimits::default()
        };
        let report = self.supervisor.run_job(&job, &limits, &AtomicBool::new(false), &mut |_| ());
        let answers = report.outcomes.into_iter().map(|outcome| match outcome {
            Outcome::Done(answer) if answer.values.iter().all(|v| v.is_finite()) => {
                Ok(answer.values)
            }
            Outcome::Done(_) => bail!("the reference renderer drew a value that is not finite"),
            other => bail!("the reference renderer failed: {other}"),
        });
        answers.collect()
    }
}

fn mean_radiance(image: &Image) -> f64 {
    let sum: f64 = image.pixels.iter().map(|p| f64::from(p.element_sum()) / 3.0).sum();
    sum / image.pixels.len() as f64
}

/// SHA-256 over all that an image of a scene depends on: the TOML file and the files beside its mesh.
pub(crate) fn scene_digest(toml: &Path) -> anyhow::Result<String> {
    let config = basecode::scene::SceneConfig::load(toml)?;
    let mut hash = Sha256::new();
    feed(&mut hash, toml)?;
    let folder = config.mesh.parent().unwrap_or(Path::new(""));
    let mut files = Vec::new();
    for entry in folder.read_dir().with_context(|| format!("{}", folder.display()))? {
        let entry = entry?;
        if entry.file_type()?.is_file() {
            files.push(entry.path());
        }
    }
    files.sort();
    for file in files {
        hash.update(file.file_name().unwrap_or_default().as_encoded_bytes());
        feed(&mut hash, &file)?;
    }
    Ok(hex(&hash.finalize()))
}
