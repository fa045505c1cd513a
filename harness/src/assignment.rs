//! The assignment as data: what `config.json` at the top of the repository says.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::class::mending::Mend;
use crate::class::{LatePolicy, Stated, late};
use crate::files::Scratch;
use crate::imaging::tolerances::Tolerances;
use crate::intake::Finding;
use crate::plain_errors::plain;
use crate::rubric::Rules;
use crate::worker::Budget;
use crate::{intake, process};

/// An assignment: its scenes, its parts, what each is worth and how it is judged.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Assignment {
    /// Short name, also that of its folders: `a2`.
    pub name: String,
    /// Title in the handout.
    pub title: String,
    /// Course in the handout.
    pub course: String,
    /// When it is due, RFC 3339 with offset.
    pub due: String,
    /// What a late submission costs; nothing when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub late: Option<LatePolicy>,
    /// What an instructor may mend in a submission; nothing when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mend: Option<Mend>,
    /// The scenes, the submission's own first.
    pub scenes: Vec<SceneEntry>,
    /// The offline TOML file of a scene that does not vary over rows, for findings on samplers.
    pub sampler_scene: PathBuf,
    /// The tree that a submission must have.
    pub tree: intake::TreeSpec,
    /// How evidence becomes points.
    pub rules: Rules,
    /// Where "different" begins for images.
    pub tolerances: Tolerances,
    /// What a submission may use.
    pub limits: AssignmentLimits,
    /// The folder that all paths are relative to, absolute; not in the file.
    #[serde(skip)]
    pub root: PathBuf,
}

/// What a submission may use, at each stage.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AssignmentLimits {
    /// The archive.
    pub archive: intake::ArchiveLimits,
    /// Each child that decodes a file of it.
    pub decode: process::ProcessLimits,
    /// The compiler.
    pub build: process::ProcessLimits,
    /// Each worker.
    pub run: process::ProcessLimits,
    /// All workers of a submission, on each path.
    pub budget: Budget,
}

/// One scene of the assignment, with its files relative to the assignment's root.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneEntry {
    /// Name for reports and for the file of its expected images.
    pub name: String,
    /// The offline TOML file.
    pub offline: PathBuf,
    /// The realtime TOML file.
    pub realtime: PathBuf,
    /// The realtime TOML file with shadows, when the scene can be chosen for the bonus.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bonus: Option<PathBuf>,
    /// Whether its image with shadows must be right whichever bonus scene the student chose. The best
    /// of the others is `bonus.image`; this one is a check of its own, `bonus.probe`.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub bonus_required: bool,
    /// The largest share of a part, in (0, 1], that a mistake can cost if only this scene shows it. It is 1 for the
    /// assignment's scenes and for probes of what these demand. It is less for probes of what no image of the
    /// assignment shows.
    #[serde(default = "full_weight", skip_serializing_if = "is_full_weight")]
    pub weight: f64,
    /// Film to judge it on, width and height in pixels; the scene's own when absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub film: Option<[u32; 2]>,
    /// Whether its expected images are kept in the repository.
    #[serde(default)]
    pub stored: bool,
    /// Whether changed copies of it are held back from students.
    #[serde(default)]
    #[serde(rename = "perturb")]
    pub held_back_copies: bool,
    /// Images that a submission holds of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub submitted: Option<SubmittedPaths>,
}

fn full_weight() -> f64 {
    1.0
}

#[allow(clippy::trivially_copy_pass_by_ref)] // serde wants a reference
fn is_full_weight(weight: &f64) -> bool {
    *weight == 1.0
}

/// The images of one scene in a submission, as paths in its tree.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SubmittedPaths {
    /// The offline image.
    pub offline: String,
    /// The realtime image.
    pub realtime: String,
    /// The realtime image with shadows (the bonus), if any.
    pub bonus: String,
}

/// Why the assignment cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AssignmentError {
    /// The file cannot be read.
    #[error("{}: cannot read the assignment: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is not an assignment.
    #[error("{}:{line}: {message}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// What was expected and found.
        message: String,
    },
    /// The file contradicts itself.
    #[error("{}: {message}", path.display())]
    Contradiction {
        /// The file.
        path: PathBuf,
        /// How.
        message: String,
    },
    /// There is none.
    #[error("no assignment: expected a config.json with \"rules\" in {} or a folder above it", from.display())]
    Missing {
        /// Where the search began.
        from: PathBuf,
    },
}

impl Assignment {
    /// Loads `config.json` in the folder `root`.
    ///
    /// # Errors
    /// When it cannot be read, holds an unknown key or a value of another kind, or contradicts
    /// itself; names file and line.
    pub fn load(root: &Path) -> Result<Self, AssignmentError> {
        let path = root.join("config.json");
        let bytes = std::fs::read(&path)
            .map_err(|source| AssignmentError::Read { path: path.clone(), source })?;
        let text = intake::text_of(&bytes);
        let mut assignment: Self =
            serde_json::from_str(&text).map_err(|error| wrong_json(&path, &text, &error))?;
        if let Some(message) = assignment.problem() {
            return Err(AssignmentError::Contradiction { path, message });
        }
        if let Some(late::Problem { at, message, other }) = assignment.problem_of_dates() {
            let line = |at: &[String]| intake::line_of(&text, at).unwrap_or(1);
            let there = other.map(|other| format!(", on line {}", line(&other)));
            let message = message + &there.unwrap_or_default();
            return Err(AssignmentError::Parse { path, line: line(&at) as usize, message });
        }
        // Children are told paths from it, and have other folders than this process is in.
        assignment.root = std::path::absolute(root)
            .map_err(|source| AssignmentError::Read { path: path.clone(), source })?;
        Ok(assignment)
    }

    /// Loads the assignment of the folder `from` or the nearest one above it.
    ///
    /// # Errors
    /// As [`Assignment::load`], and when there is none.
    pub fn find(from: &Path) -> Result<Self, AssignmentError> {
        for folder in from.ancestors() {
            // A submission has a config.json too; the assignment's stands beside its scenes.
            if folder.join("config.json").is_file() && folder.join("scenes").is_dir() {
                return Self::load(folder);
            }
        }
        Err(AssignmentError::Missing { from: from.to_owned() })
    }

    fn problem(&self) -> Option<String> {
        if let Some(problem) = self.rules.problem() {
            return Some(problem);
        }
        if let Some(problem) = self.mend.as_ref().and_then(Mend::problem) {
            return Some(problem);
        }
        for (index, scene) in self.scenes.iter().enumerate() {
            if self.scenes[..index].iter().any(|other| other.name == scene.name) {
                return Some(format!("scene \"{}\" is there twice", scene.name));
            }
            if scene.film.is_some_and(|[width, height]| width == 0 || height == 0) {
                return Some(format!("scene \"{}\": its film is empty", scene.name));
            }
            if !(scene.weight > 0.0 && scene.weight <= 1.0) {
                return Some(format!(
                    "scene \"{}\": its weight is {} but must lie above 0 and be at most 1",
                    scene.name, scene.weight
                ));
            }
            if scene.bonus_required && scene.bonus.is_none() {
                return Some(format!(
                    "scene \"{}\": its bonus is required, but no bonus file is named",
                    scene.name
                ));
            }
        }
        self.scenes.is_empty().then(|| "no scene is named".into())
    }

    /// What is wrong with the due date or the late policy, if anything.
    fn problem_of_dates(&self) -> Option<late::Problem> {
        if let Err(error) = self.due.parse::<jiff::Timestamp>() {
            let message = format!("due: {}", late::expected_date(&self.due, &error));
            return Some(late::Problem { at: vec!["due".into()], message, other: None });
        }
        self.late.as_ref().and_then(|late| late.problem(&self.due))
    }

    /// Width and height of the image at this place of a submission; nothing where it is no scene's, or the scene's file
    /// cannot be read.
    pub fn film_of(&self, image: &str) -> Option<[usize; 2]> {
        self.scenes.iter().find_map(|scene| {
            let paths = scene.submitted.as_ref()?;
            let toml = match image {
                image if image == paths.offline => &scene.offline,
                image if image == paths.realtime => &scene.realtime,
                image if image == paths.bonus => scene.bonus.as_ref()?,
                _ => return None,
            };
            if let Some([width, height]) = scene.film {
                return Some([width as usize, height as usize]);
            }
            let config = basecode::scene::SceneConfig::load(&self.root.join(toml)).ok()?;
            Some([config.width, config.height])
        })
    }

    /// Where the expected images of a stored scene lie.
    pub fn expected_file(&self, scene: &SceneEntry) -> PathBuf {
        self.root.join("expected").join(&self.name).join(format!("{}.exr", scene.name))
    }

    /// The template's `src` as it was handed out: what a stage that nobody touched equals. Nobody
    /// works in it, while a student edits `student_template` in place.
    pub fn template(&self) -> PathBuf {
        self.root.join("expected").join(&self.name).join("template")
    }

    /// Where a student's kit keeps the expected images that only the reference renderer can make.
    pub fn made(&self) -> PathBuf {
        self.root.join("expected").join(&self.name).join("made")
    }

    /// A place for what nobody needs afterwards.
    ///
    /// # Errors
    /// When it cannot be made; names the folder.
    pub fn scratch(&self) -> std::io::Result<Scratch> {
        let parent = self.cache().join("scratch");
        let named = |error: std::io::Error| {
            std::io::Error::new(error.kind(), format!("cannot use {}: {error}", parent.display()))
        };
        Scratch::new(&parent).map_err(named)
    }

    /// Where Umbra keeps what it can make again.
    pub fn cache(&self) -> PathBuf {
        self.root.join("target").join("umbra")
    }
}

impl From<&Assignment> for Stated {
    fn from(assignment: &Assignment) -> Self {
        let Assignment { name, title, course, due, late, rules, .. } = assignment.clone();
        Self { name, title, course, due, late, rules }
    }
}

impl Assignment {
    /// Puts what is pinned in the place of what the assignment says.
    pub fn pin(&mut self, pinned: &Stated) {
        let Stated { name: _, title, course, due, late, rules } = pinned.clone();
        (self.title, self.course, self.due) = (title, course, due);
        (self.late, self.rules) = (late, rules);
    }
}

/// What is wrong with the text of `config.json`: a usual slip in the words that students read, too.
fn wrong_json(path: &Path, text: &str, error: &serde_json::Error) -> AssignmentError {
    // The place stands before the message already.
    let own = || plain(error.to_string().split(" at line ").next().unwrap_or_default());
    let slip = intake::first_slip(text).filter(|_| !error.is_data());
    let (line, message) = match slip {
        Some(Finding { line: Some(line), message, hint, .. }) => {
            let hint = hint.map_or_else(String::new, |hint| format!("; hint: {hint}"));
            (line as usize, message + &hint)
        }
        _ => (error.line(), own()),
    };
    AssignmentError::Parse { path: path.to_owned(), line, message }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_slips_in_the_file_are_told_and_encodings_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let load = |bytes: &[u8]| {
            std::fs::write(folder.path().join("config.json"), bytes).unwrap();
            let error = Assignment::load(folder.path()).unwrap_err().to_string();
            error.split_once("config.json:").unwrap().1.to_owned()
        };
        let text = "{\n\"name\": \"a2\",\n\"titel\": 1}";
        let wide: Vec<u8> = text.encode_utf16().flat_map(u16::to_le_bytes).collect();
        let bom = [b"\xef\xbb\xbf", text.as_bytes()].concat();
        for bytes in [text.as_bytes(), &bom, &[&[0xff, 0xfe][..], &wide].concat()] {
            let error = load(bytes);
            assert!(error.starts_with("3: unknown field `titel`"), "{error}");
        }
        for (slip, expected) in [
            ("// mine\n\"name\"", "2: "),
            ("\u{201c}name\u{201d}", "2: "),
            ("\"title\": \"x\",,\n\"name\"", "2: "),
        ] {
            let error = load(text.replace("\"name\"", slip).as_bytes());
            assert!(error.starts_with(expected) && error.contains("; hint: "), "{error}");
            assert!(!error.contains("key must be a string"), "{error}");
        }
    }
}
