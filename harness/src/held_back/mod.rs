//! Held-back scenes: copies of the assignment's scenes, changed by a secret seed, that no student
//! has seen. A renderer that is right is right on them too; one that knows the public scenes is not.
//!
//! Light, camera, materials, exponents and film are drawn from the seed and previewed without any renderer; a draw that
//! shows too little is repeated. The same seed and the same scenes give the same files, byte for byte.

mod files;
#[cfg(test)]
mod tests;

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::assignment::{Assignment, SceneEntry};
use crate::evidence::changed_scene::{ChangedScene, ScenePreview};
use crate::expected::load_scene;
use crate::files::{hex, write_new};
use files::NewFile;

/// Number of draws that are previewed before a scene is given up. Over 200 seeds about every fourth draw is accepted,
/// and none needed half of these.
const TRIES: u32 = 100;

/// What a batch has held back. The seed tells all of it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct HeldBack {
    /// The seed; a string in files, because many programs read numbers as doubles.
    #[serde(with = "as_text")]
    #[schemars(with = "String")]
    pub seed: u64,
    /// Names of the scenes, each with that of the scene that it is a copy of.
    pub scenes: Vec<(String, String)>,
}

/// A seed from the operating system.
///
/// # Errors
/// When the system has none to give.
pub fn secret_seed() -> anyhow::Result<u64> {
    let mut bytes = [0; 8];
    getrandom::fill(&mut bytes).context("the system gives no random numbers")?;
    Ok(u64::from_le_bytes(bytes))
}

/// What a file holds of a report without held-back scenes.
const OFF: &str = "off";

/// The seed of held-back scenes that is recorded in `file`, if it is not that there are none. Where nothing is recorded
/// yet, `chosen` is, else a new secret seed. Processes that ask at the same time get the same.
///
/// # Errors
/// When the file holds no seed or cannot be written, or [`secret_seed`] fails.
pub fn recorded_seed(file: &Path, chosen: Option<Option<u64>>) -> anyhow::Result<Option<u64>> {
    if !file.exists() {
        let seed = chosen.map_or_else(|| secret_seed().map(Some), Ok)?;
        match write_new(file, format!("{}\n", in_words(seed)).as_bytes()) {
            // Another process was faster.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            written => written.with_context(|| format!("cannot write {}", file.display()))?,
        }
    }
    let text =
        std::fs::read_to_string(file).with_context(|| format!("cannot read {}", file.display()))?;
    let text = text.trim();
    if text == OFF {
        return Ok(None);
    }
    text.parse().map(Some).with_context(|| {
        format!(
            "{}: expected the seed of held-back scenes or {OFF}, found \"{text}\"",
            file.display()
        )
    })
}

/// The seed as `--held-back` takes it.
pub fn in_words(seed: Option<u64>) -> String {
    seed.map_or_else(|| OFF.to_owned(), |seed| seed.to_string())
}

/// Makes the held-back scenes of a batch below the assignment's cache, if they are not there yet.
///
/// # Errors
/// When a scene cannot be read or written, or no draw of it is worth anything.
pub fn make(assignment: &Assignment, seed: u64) -> anyhow::Result<(HeldBack, Vec<SceneEntry>)> {
    let mut held_back = HeldBack { seed, scenes: Vec::new() };
    let mut entries = Vec::new();
    for original in assignment.scenes.iter().filter(|scene| scene.held_back_copies) {
        let files = scene_files(&assignment.root, original, seed)
            .with_context(|| format!("scene \"{}\" cannot be changed", original.name))?;
        let folder = write(&assignment.cache().join("held_back"), &files)?;
        let at = |path: &PathBuf| Ok::<_, anyhow::Error>(folder.join(files::below(path)?));
        let name = format!("held-back-{}", entries.len() + 1);
        entries.push(SceneEntry {
            offline: at(&original.offline)?,
            realtime: at(&original.realtime)?,
            bonus: original.bonus.as_ref().map(at).transpose()?,
            name: name.clone(),
            bonus_required: false,
            weight: original.weight,
            film: None,
            stored: false,
            held_back_copies: false,
            submitted: None,
        });
        held_back.scenes.push((name, original.name.clone()));
    }
    Ok((held_back, entries))
}

/// The files of the first draw of a scene that is worth something.
fn scene_files(root: &Path, entry: &SceneEntry, seed: u64) -> anyhow::Result<Vec<NewFile>> {
    let scene = load_scene(&root.join(&entry.offline))?;
    let original = ScenePreview::new(&scene, &ChangedScene::original(&scene))?;
    let mut why = "";
    for attempt in 0..TRIES {
        let draw = ChangedScene::new(&scene, sub_seed(seed, &entry.name, attempt));
        match ScenePreview::new(&scene, &draw)?.problem(&original, entry.bonus.is_some()) {
            None => return files::changed(root, entry, &scene, &draw),
            Some(problem) => why = problem,
        }
    }
    bail!("none of {TRIES} draws from seed {seed} is worth anything; the last one: {why}")
}

/// Unrelated for other seeds, scenes and attempts.
fn sub_seed(seed: u64, scene: &str, attempt: u32) -> u64 {
    let mut hash = Sha256::new();
    hash.update(seed.to_le_bytes());
    hash.update(attempt.to_le_bytes());
    hash.update(scene);
    let digest = hash.finalize();
    u64::from_le_bytes(std::array::from_fn(|byte| digest[byte]))
}

/// Writes a scene into a folder of its own, named by what is in it, in a folder for the owner alone.
fn write(parent: &Path, files: &[NewFile]) -> anyhow::Result<PathBuf> {
    let mut hash = Sha256::new();
    for (path, bytes) in files {
        hash.update(path.as_os_str().as_encoded_bytes());
        hash.update((bytes.len() as u64).to_le_bytes());
        hash.update(bytes);
    }
    let folder = parent.join(hex(&hash.finalize()[..12]));
    if folder.is_dir() {
        return Ok(folder);
    }
    let failed = || format!("cannot write {}", folder.display());
    make_private(parent).with_context(failed)?;
    let draft = tempfile::Builder::new().prefix(".draft-").tempdir_in(parent)?;
    let inside = draft.path().join("scene");
    for (path, bytes) in files {
        let file = inside.join(path);
        std::fs::create_dir_all(file.parent().unwrap_or(&inside)).with_context(failed)?;
        std::fs::write(&file, bytes).with_context(failed)?;
    }
    match std::fs::rename(&inside, &folder) {
        // Another process made the same: the names say that it is.
        Err(_) if folder.is_dir() => Ok(folder),
        renamed => renamed.with_context(failed).map(|()| folder),
    }
}

/// A folder that its owner alone can enter.
fn make_private(folder: &Path) -> std::io::Result<()> {
    let mut builder = std::fs::DirBuilder::new();
    builder.recursive(true);
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(folder)
}

/// A number as a string.
mod as_text {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    pub fn serialize<S: Serializer>(number: &u64, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(number)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u64, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(D::Error::custom)
    }
}
