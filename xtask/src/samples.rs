//! The sample submissions: real archives, packed from `samples/`, with the images that their own code
//! draws. They lie under `target/umbra/samples/`.

mod archive;
mod expect;

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::{Context, Result, bail, ensure};
use basecode::exr_io::{Precision, read_exr_layers, write_exr};
use basecode::scene::SceneConfig;
use basecode::{Image, Vec3};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use umbra::assignment::{Assignment, SceneEntry};
use umbra::build::{self, BuildOutcome, Recording};
use umbra::files::Scratch;
use umbra::worker::{
    Adapter, AdapterKind, CameraValue, Job, Outcome, Request, SceneRef, Supervisor,
};

use archive::write_archive;
pub use expect::Expect;

use crate::parallel;

/// How one sample is made; `samples/README.md` explains the fields.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// What it is about.
    #[allow(dead_code)]
    title: String,
    /// Whose it claims to be.
    student: StudentEntry,
    /// Whose source it starts from: another sample, `template` or `nothing`.
    #[serde(default = "template")]
    base: String,
    /// Files of the base that it lacks.
    #[serde(default)]
    remove: Vec<PathBuf>,
    /// Files that are the template's again.
    #[serde(default)]
    restore: Vec<PathBuf>,
    /// Files that its archive lacks.
    #[serde(default)]
    omit: Vec<String>,
    /// Whether grading it takes longer than the others: it waits for time limits.
    #[serde(default)]
    pub slow: bool,
    /// Whose code draws its images: `own`, `none`, `from:<sample>`, or `of:<sample>` with that
    /// student's seed.
    images: String,
    /// Offline images that are copies of the published ones.
    #[serde(default)]
    published: Vec<String>,
    /// Where its bonus image lies, if it hands one in.
    bonus: Option<String>,
    /// `zip`, `tar` or `tar.gz`.
    format: String,
    /// A folder around everything.
    wrap: Option<String>,
    /// Files and folders that lie elsewhere than they should: from, to.
    #[serde(default)]
    moves: Vec<(String, String)>,
    /// What it is worth.
    pub expect: Expect,
}

/// A packed sample.
pub struct Sample {
    /// The name of its folder.
    pub name: String,
    /// Its archive.
    pub archive: PathBuf,
    /// What it is worth.
    pub expect: Expect,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct StudentEntry {
    first: String,
    last: String,
    id: String,
}

fn template() -> String {
    "template".to_owned()
}

/// Which samples are wanted, by name and recipe.
pub type Wanted<'a> = &'a (dyn Fn(&str, &Recipe) -> bool + Sync);

/// Packs the samples that are wanted where the archive is missing or older than its sources,
/// as many at a time as there are cores.
///
/// # Errors
/// When a sample contradicts itself or cannot be drawn; names it.
pub fn pack(root: &Path, wanted: Wanted) -> Result<Vec<Sample>> {
    let packer = Packer::new(root)?;
    let recipes = packer.recipes.iter().filter(|(name, recipe)| wanted(name, recipe));
    let names: Vec<&String> = recipes.map(|(name, _)| name).collect();
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    parallel::each(&names, cores, |_, name| {
        packer.pack(name).with_context(|| format!("sample {name}"))
    })
}

struct Packer {
    root: PathBuf,
    out: PathBuf,
    recipes: BTreeMap<String, Recipe>,
    assignment: Assignment,
    supervisor: Supervisor,
    recording: Recording,
    /// The supervisor's.
    _scratch: Scratch,
}

impl Packer {
    fn new(root: &Path) -> Result<Self> {
        let umbra = root.join(format!("target/release/umbra{}", std::env::consts::EXE_SUFFIX));
        ensure!(
            umbra.is_file(),
            "{} is missing; hint: cargo build --release --workspace",
            umbra.display()
        );
        let mut recipes = BTreeMap::new();
        for entry in root.join("samples").read_dir()? {
            let path = entry?.path();
            let file = path.join("recipe.toml");
            if file.is_file() {
                let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let text = fs::read_to_string(&file)?;
                let recipe = toml::from_str(&text).with_context(|| file.display().to_string())?;
                recipes.insert(name, recipe);
            }
        }
        ensure!(!recipes.is_empty(), "samples/ holds no recipe.toml");
        let assignment = Assignment::load(root)?;
        let scratch = assignment.scratch()?;
        let out = assignment.cache().join("samples");
        fs::create_dir_all(&out)?;
        let recording = Recording::obtain(root, &umbra)?;
        let supervisor = Supervisor::available(umbra, scratch.path().to_owned());
        let root = root.to_owned();
        Ok(Self { root, out, recipes, assignment, supervisor, recording, _scratch: scratch })
    }

    /// The source files of a sample, relative to `src/`, with their contents.
    fn source(&self, name: &str) -> Result<BTreeMap<PathBuf, Vec<u8>>> {
        let recipe =
            self.recipes.get(name).with_context(|| format!("there is no sample {name}"))?;
        let mut files = match recipe.base.as_str() {
            "nothing" => BTreeMap::new(),
            "template" => read_tree(&self.assignment.template())?,
            base => self.source(base)?,
        };
        for path in &recipe.remove {
            ensure!(files.remove(path).is_some(), "remove: {} is not in the base", path.display());
        }
        let template = self.assignment.template();
        for path in &recipe.restore {
            let bytes = fs::read(template.join(path))
                .with_context(|| format!("restore: {}", path.display()))?;
            files.insert(path.clone(), bytes);
        }
        files.extend(read_tree(&self.root.join("samples").join(name).join("src"))?);
        Ok(files)
    }

    fn pack(&self, name: &str) -> Result<Sample> {
        let recipe = &self.recipes[name];
        let archive = self.out.join(format!("{name}.{}", recipe.format));
        let sample = Sample { name: name.to_owned(), archive, expect: recipe.expect.clone() };
        let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
        let source = self.source(name)?;
        for (path, bytes) in &source {
            files.insert(format!("src/{}", path.display()).replace('\\', "/"), bytes.clone());
        }
        let id = &recipe.student.id;
        let artist = match (recipe.images.as_str(), recipe.images.split_once(':')) {
            ("own", _) => Some((source, id)),
            ("none", _) => None,
            (_, Some(("from", sample))) => Some((self.source(sample)?, id)),
            (_, Some(("of", sample))) => {
                Some((self.source(sample)?, &self.recipes[sample].student.id))
            }
            (other, _) => {
                bail!("images is \"{other}\" but must be own, none, from:<sample> or of:<sample>")
            }
        };
        let key = self.key(&files, recipe, artist.as_ref())?;
        let key_file = self.out.join(format!(".{name}.key"));
        if sample.archive.is_file() && fs::read_to_string(&key_file).is_ok_and(|old| old == key) {
            return Ok(sample);
        }
        eprintln!("packing sample {name}");
        let mut renders = Vec::new();
        if let Some((source, id)) = &artist {
            for (path, bytes) in self.draw(source, id, recipe)? {
                renders.push(path.clone());
                files.insert(path, bytes);
            }
        }
        for path in &recipe.published {
            ensure!(files.contains_key(path), "published: {path} is not in the archive");
            files.insert(path.clone(), self.published(path)?);
        }
        files.insert("config.json".into(), config(recipe, &renders)?);
        for (from, to) in &recipe.moves {
            let moved: Vec<String> =
                files.keys().filter(|path| path.starts_with(from.as_str())).cloned().collect();
            ensure!(!moved.is_empty(), "moves: nothing lies at {from}");
            for path in moved {
                let rest = path[from.len()..].to_owned();
                let bytes = files.remove(&path).unwrap_or_default();
                files.insert(format!("{to}{rest}").trim_start_matches('/').to_owned(), bytes);
            }
        }
        for path in &recipe.omit {
            ensure!(files.remove(path).is_some(), "omit: {path} is not in the archive");
        }
        write_archive(&sample.archive, recipe, &files)?;
        fs::write(key_file, key)?;
        Ok(sample)
    }

    /// All that an archive depends on.
    fn key(
        &self,
        files: &BTreeMap<String, Vec<u8>>,
        recipe: &Recipe,
        artist: Option<&(BTreeMap<PathBuf, Vec<u8>>, &String)>,
    ) -> Result<String> {
        let mut hash = Sha256::new();
        for (path, bytes) in files {
            hash.update(path);
            hash.update(bytes);
        }
        if let Some((source, id)) = artist {
            for (path, bytes) in source {
                hash.update(path.to_string_lossy().as_bytes());
                hash.update(bytes);
            }
            hash.update(id);
        }
        hash.update(format!("{recipe:?} {}", self.recording.key));
        for (path, bytes) in read_tree(&self.root.join("scenes"))? {
            hash.update(path.to_string_lossy().as_bytes());
            hash.update(bytes);
        }
        Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
    }

    /// The published image of the scene whose offline image lies at `path`, as an EXR file.
    fn published(&self, path: &str) -> Result<Vec<u8>> {
        let own = |scene: &&SceneEntry| {
            scene.submitted.as_ref().is_some_and(|images| images.offline == path)
        };
        let scene = self.assignment.scenes.iter().find(own);
        let scene = scene.with_context(|| format!("published: no scene's image is {path}"))?;
        let mut layers = read_exr_layers(self.assignment.expected_file(scene))?.layers;
        let mean = layers.remove("mean").context("the stored image has no mean")?;
        let file = tempfile::Builder::new().suffix(".exr").tempfile()?;
        write_exr(file.path(), &mean, Precision::Half, &[])?;
        Ok(fs::read(file.path())?)
    }

    /// Builds a source and draws the images that a submission must contain, seeded by a student's `id`.
    fn draw(
        &self,
        source: &BTreeMap<PathBuf, Vec<u8>>,
        id: &str,
        recipe: &Recipe,
    ) -> Result<Vec<(String, Vec<u8>)>> {
        let scratch = tempfile::tempdir_in(&self.supervisor.scratch)?;
        let (src, out) = (scratch.path().join("src"), scratch.path().join("out"));
        fs::create_dir(&out)?;
        for (path, bytes) in source {
            let file = src.join(path);
            fs::create_dir_all(file.parent().unwrap_or(&src))?;
            fs::write(file, bytes)?;
        }
        let cancel = AtomicBool::new(false);
        let limits = &self.assignment.limits;
        let report =
            build::compile(&self.recording, &self.supervisor, &src, &out, &limits.build, &cancel)?;
        let library = match report.outcome {
            BuildOutcome::Built { library } => library,
            BuildOutcome::CompileError { errors } => {
                let first = errors.first().map(|error| error.rendered.clone());
                bail!("its source does not build:\n{}", first.unwrap_or_default())
            }
            other => bail!("its source does not build: {other:?}"),
        };
        let seed = id.parse().context("the student's id seeds the sampler")?;
        let mut asked = Vec::new();
        for scene in &self.assignment.scenes {
            let Some(images) = &scene.submitted else { continue };
            asked.push((images.offline.clone(), self.request(&scene.offline, seed)?));
            asked.push((images.realtime.clone(), self.request(&scene.realtime, seed)?));
            let bonus = recipe.bonus.as_ref().filter(|path| path.contains(&scene.name));
            if let (Some(path), Some(toml)) = (bonus, &scene.bonus) {
                asked.push((path.clone(), self.request(toml, seed)?));
            }
        }
        let (paths, requests): (Vec<String>, Vec<Request>) = asked.into_iter().unzip();
        let job = Job { plugin: Some(library), requests };
        let report = self.supervisor.run_job(&job, &limits.run, &cancel, &mut |_| ());
        let mut images = Vec::new();
        for ((path, request), outcome) in paths.into_iter().zip(job.requests).zip(report.outcomes) {
            let (Request::RenderOffline { width, height, .. }
            | Request::RenderRealtime { width, height, .. }) = request
            else {
                bail!("only images are asked for");
            };
            let is_offline = matches!(request, Request::RenderOffline { .. });
            // What does not draw submits no image.
            let Outcome::Done(answer) = outcome else { continue };
            // Realtime images were clamped to [0, 1] by the original course's framebuffer.
            let pixel = |v: &[f32; 3]| {
                let v = Vec3::from(*v);
                if is_offline { v } else { v.clamp(Vec3::ZERO, Vec3::ONE) }
            };
            let pixels = answer.values.as_chunks::<3>().0.iter().map(pixel).collect();
            let image = Image { width: width as usize, height: height as usize, pixels };
            let file = scratch.path().join("image.exr");
            write_exr(&file, &image, Precision::Half, &[])?;
            images.push((path, fs::read(&file)?));
        }
        Ok(images)
    }

    fn request(&self, toml: &Path, seed: u64) -> Result<Request> {
        let path = self.root.join(toml);
        let config = SceneConfig::load(&path)?;
        let scene = SceneRef { path, options: String::new() };
        let (width, height) = (config.width as u32, config.height as u32);
        let camera = config.camera;
        Ok(if config.realtime {
            Request::RenderRealtime {
                scene,
                width,
                height,
                shadow_map: config.bonus,
                adapter: Adapter { kind: AdapterKind::Software, name: String::new() },
                stages: Vec::new(),
                cameras: vec![CameraValue::from(camera)],
            }
        } else {
            Request::RenderOffline {
                scene,
                width,
                height,
                spp: config.spp as u32,
                seed,
                // The other cores pack other samples.
                threads: 1,
                shadows: true,
            }
        })
    }
}

/// The submission's own config.json, in the handout's form.
fn config(recipe: &Recipe, renders: &[String]) -> Result<Vec<u8>> {
    let title = |path: &String| {
        let stem = Path::new(path).file_stem().unwrap_or_default().to_string_lossy().into_owned();
        serde_json::json!({ "scene": stem.replace('_', " "), "render": path })
    };
    let config = serde_json::json!({
        "firstName": recipe.student.first,
        "lastName": recipe.student.last,
        "studentID": recipe.student.id,
        "renders": renders.iter().map(title).collect::<Vec<_>>(),
    });
    Ok(serde_json::to_vec_pretty(&config)?)
}

/// All files below a folder, by their relative paths; nothing when there is no such folder.
pub(crate) fn read_tree(folder: &Path) -> Result<BTreeMap<PathBuf, Vec<u8>>> {
    let mut files = BTreeMap::new();
    let mut pending = vec![folder.to_owned()];
    while let Some(current) = pending.pop() {
        let Ok(entries) = current.read_dir() else { continue };
        for entry in entries {
            let path = entry?.path();
            if path.is_dir() {
                pending.push(path);
            } else {
                files.insert(path.strip_prefix(folder)?.to_owned(), fs::read(&path)?);
            }
        }
    }
    Ok(files)
}
