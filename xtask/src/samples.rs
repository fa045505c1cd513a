//! The sample submissions: real archives, packed from `samples/`, with the images that their own code
//! draws. They lie under `target/umbra/samples/`.
//!
//! Samples whose images the same source draws are packed one after the other, so that it is compiled once and draws
//! nothing twice.

mod archive;
mod expect;

use std::cmp::Reverse;
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
use tempfile::TempDir;
use umbra::assignment::{Assignment, SceneEntry};
use umbra::build::{BuildOutcome, KeptLibraries, Recording};
use umbra::files::{Scratch, hex};
use umbra::worker::{
    Adapter, AdapterKind, Answer, CameraValue, Job, Outcome, Request, SceneRef, Supervisor,
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
/// side by side.
///
/// # Errors
/// When a sample contradicts itself or cannot be drawn; names it.
pub fn pack(root: &Path, wanted: Wanted) -> Result<Vec<Sample>> {
    let packer = Packer::new(root)?;
    let (mut samples, mut by_source) = (Vec::new(), BTreeMap::<_, Vec<_>>::new());
    for (name, recipe) in packer.recipes.iter().filter(|(name, recipe)| wanted(name, recipe)) {
        let draft = packer.draft(name, recipe).with_context(|| format!("sample {name}"))?;
        let (archive, expect) = (draft.archive.clone(), recipe.expect.clone());
        samples.push(Sample { name: name.clone(), archive, expect });
        if !draft.is_packed() {
            by_source.entry(draft.artist.clone()).or_default().push(draft);
        }
    }
    let mut groups: Vec<_> = by_source.into_iter().collect();
    groups.sort_by_key(|(_, drafts)| Reverse(drafts.len()));
    let cores = std::thread::available_parallelism().map_or(1, |n| n.get());
    parallel::each(&groups, cores, |_, (source, drafts)| packer.pack(source.as_ref(), drafts))?;
    Ok(samples)
}

/// Packs the samples of these names, or all.
///
/// # Errors
/// When there is no sample of a name; as [`pack`] otherwise.
pub fn pack_named(root: &Path, names: &[String]) -> Result<Vec<Sample>> {
    for name in names {
        let recipe = root.join("samples").join(name).join("recipe.toml");
        ensure!(recipe.is_file(), "there is no sample {name}");
    }
    pack(root, &|name, _| names.is_empty() || names.iter().any(|wanted| wanted == name))
}

/// The files below `src/`.
type Source = BTreeMap<PathBuf, Vec<u8>>;

/// A sample before its images are drawn.
struct Draft<'a> {
    name: &'a str,
    recipe: &'a Recipe,
    archive: PathBuf,
    /// Its own source, by paths in the archive.
    files: BTreeMap<String, Vec<u8>>,
    /// Whose code draws its images, if any does.
    artist: Option<Source>,
    /// The student number that seeds them.
    seed: &'a str,
    /// All that the archive depends on.
    key: String,
    key_file: PathBuf,
}

impl Draft<'_> {
    fn is_packed(&self) -> bool {
        let old = fs::read_to_string(&self.key_file);
        self.archive.is_file() && old.is_ok_and(|old| old == self.key)
    }
}

/// A library that draws, and what it has drawn: EXR files, if it did, by scene and seed.
struct Artist {
    scratch: TempDir,
    library: PathBuf,
    drawn: BTreeMap<(PathBuf, u64), Option<Vec<u8>>>,
}

struct Packer {
    root: PathBuf,
    out: PathBuf,
    recipes: BTreeMap<String, Recipe>,
    assignment: Assignment,
    supervisor: Supervisor,
    recording: Recording,
    kept: KeptLibraries,
    /// What all archives depend on.
    key: String,
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
        let kept = KeptLibraries::within(&assignment.cache(), supervisor.isolation.isolation());
        let mut hash = Sha256::new();
        hash.update(&recording.key);
        for (path, bytes) in read_tree(&root.join("scenes"))? {
            hash.update(path.to_string_lossy().as_bytes());
            hash.update(bytes);
        }
        let (root, key) = (root.to_owned(), hex(&hash.finalize()));
        Ok(Self {
            root,
            out,
            recipes,
            assignment,
            supervisor,
            recording,
            kept,
            key,
            _scratch: scratch,
        })
    }

    /// The source files of a sample, relative to `src/`, with their contents.
    fn source(&self, name: &str) -> Result<Source> {
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

    fn draft<'a>(&'a self, name: &'a str, recipe: &'a Recipe) -> Result<Draft<'a>> {
        let mut files = BTreeMap::new();
        let source = self.source(name)?;
        for (path, bytes) in &source {
            files.insert(format!("src/{}", path.display()).replace('\\', "/"), bytes.clone());
        }
        let mut seed = recipe.student.id.as_str();
        let artist = match (recipe.images.as_str(), recipe.images.split_once(':')) {
            ("own", _) => Some(source),
            ("none", _) => None,
            (_, Some(("from", sample))) => Some(self.source(sample)?),
            (_, Some(("of", sample))) => {
                seed = &self.recipes[sample].student.id;
                Some(self.source(sample)?)
            }
            (other, _) => {
                bail!("images is \"{other}\" but must be own, none, from:<sample> or of:<sample>")
            }
        };
        let mut hash = Sha256::new();
        for (path, bytes) in &files {
            hash.update(path);
            hash.update(bytes);
        }
        for (path, bytes) in artist.iter().flatten() {
            hash.update(path.to_string_lossy().as_bytes());
            hash.update(bytes);
        }
        hash.update(format!("{seed} {recipe:?} {}", self.key));
        let archive = self.out.join(format!("{name}.{}", recipe.format));
        let key_file = self.out.join(format!(".{name}.key"));
        Ok(Draft {
            name,
            recipe,
            archive,
            files,
            artist,
            seed,
            key: hex(&hash.finalize()),
            key_file,
        })
    }

    /// Packs samples whose images the same source draws.
    fn pack(&self, source: Option<&Source>, drafts: &[Draft]) -> Result<()> {
        let of = |draft: &Draft| format!("sample {}", draft.name);
        let mut artist = match source {
            Some(source) => Some(self.artist(source).with_context(|| of(&drafts[0]))?),
            None => None,
        };
        for draft in drafts {
            eprintln!("packing {}", of(draft));
            self.finish(draft, artist.as_mut()).with_context(|| of(draft))?;
        }
        Ok(())
    }

    fn finish(&self, draft: &Draft, artist: Option<&mut Artist>) -> Result<()> {
        let (recipe, mut files) = (draft.recipe, draft.files.clone());
        let mut renders = Vec::new();
        if let Some(artist) = artist {
            for (path, bytes) in self.draw(artist, draft)? {
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
        write_archive(&draft.archive, recipe, &files)?;
        Ok(fs::write(&draft.key_file, &draft.key)?)
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

    /// Builds the source of an artist.
    fn artist(&self, source: &Source) -> Result<Artist> {
        let scratch = tempfile::tempdir_in(&self.supervisor.scratch)?;
        let (src, out) = (scratch.path().join("src"), scratch.path().join("out"));
        fs::create_dir(&out)?;
        for (path, bytes) in source {
            let file = src.join(path);
            fs::create_dir_all(file.parent().unwrap_or(&src))?;
            fs::write(file, bytes)?;
        }
        let limits = &self.assignment.limits.build;
        let never = AtomicBool::new(false);
        let report =
            self.kept.compile(&self.recording, &self.supervisor, &src, &out, limits, &never)?;
        match report.outcome {
            BuildOutcome::Built { library } => {
                Ok(Artist { scratch, library, drawn: BTreeMap::new() })
            }
            BuildOutcome::CompileError { errors } => {
                let first = errors.first().map(|error| error.rendered.clone());
                bail!("its source does not build:\n{}", first.unwrap_or_default())
            }
            other => bail!("its source does not build: {other:?}"),
        }
    }

    /// The images that a submission must contain, and their paths in it; what does not draw is left out.
    fn draw(&self, artist: &mut Artist, draft: &Draft) -> Result<Vec<(String, Vec<u8>)>> {
        let seed = draft.seed.parse().context("the student's id seeds the sampler")?;
        let mut wanted = Vec::new();
        for scene in &self.assignment.scenes {
            let Some(images) = &scene.submitted else { continue };
            wanted.push((images.offline.clone(), (scene.offline.clone(), seed)));
            wanted.push((images.realtime.clone(), (scene.realtime.clone(), 0)));
            let bonus = draft.recipe.bonus.as_ref().filter(|path| path.contains(&scene.name));
            if let (Some(path), Some(toml)) = (bonus, &scene.bonus) {
                wanted.push((path.clone(), (toml.clone(), 0)));
            }
        }
        let missing = wanted.iter().map(|(_, key)| key);
        let missing: Vec<_> =
            missing.filter(|key| !artist.drawn.contains_key(key)).cloned().collect();
        let requests = missing.iter().map(|(toml, seed)| self.request(toml, *seed));
        let job = Job {
            plugin: Some(artist.library.clone()),
            requests: requests.collect::<Result<_>>()?,
        };
        let limits = &self.assignment.limits.run;
        let report = self.supervisor.run_job(&job, limits, &AtomicBool::new(false), &mut |_| ());
        for ((key, request), outcome) in missing.into_iter().zip(job.requests).zip(report.outcomes)
        {
            let image = match outcome {
                Outcome::Done(answer) => Some(exr(&request, &answer, artist.scratch.path())?),
                _ => None,
            };
            artist.drawn.insert(key, image);
        }
        let drawn = wanted.into_iter().map(|(path, key)| (path, artist.drawn[&key].clone()));
        Ok(drawn.filter_map(|(path, image)| Some((path, image?))).collect())
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

/// An answer as a submitted image.
fn exr(request: &Request, answer: &Answer, scratch: &Path) -> Result<Vec<u8>> {
    let (Request::RenderOffline { width, height, .. }
    | Request::RenderRealtime { width, height, .. }) = request
    else {
        bail!("only images are asked for");
    };
    let is_offline = matches!(request, Request::RenderOffline { .. });
    // Realtime images were clamped to [0, 1] by the original course's framebuffer.
    let pixel = |v: &[f32; 3]| {
        let v = Vec3::from(*v);
        if is_offline { v } else { v.clamp(Vec3::ZERO, Vec3::ONE) }
    };
    let pixels = answer.values.as_chunks::<3>().0.iter().map(pixel).collect();
    let image = Image { width: *width as usize, height: *height as usize, pixels };
    let file = scratch.join("image.exr");
    write_exr(&file, &image, Precision::Half, &[])?;
    Ok(fs::read(&file)?)
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
