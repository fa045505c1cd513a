//! The record of one graded submission: everything that its report and its grade are made from.

use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::image_digest::ImageDigest;
use super::similarity::SourceDigest;
use crate::diagnosis::Diagnosis;
use crate::evidence::{CheckId, Evidence};
use crate::imaging::error_map::ErrorMap;
use crate::intake::{Field, Finding, SubmittedConfig};
use crate::viewer::ViewedCase;

/// Where the pictures of one submission go; the folders are made when there is something to show.
pub struct Folders {
    /// Those of public scenes.
    pub student: PathBuf,
    /// Those of held-back scenes.
    pub instructor: PathBuf,
}

/// One submission, after all evidence was collected. Rubric, dates and class list stay outside, so
/// that grades can be derived from it again without rendering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Name of the archive or folder as it was submitted.
    pub name: String,
    /// Unique among the submissions of a batch and safe as a folder name; its report's files lie there.
    pub slug: String,
    /// SHA-256 over the paths and contents of the private copy; empty when it was refused.
    pub digest: String,
    /// Whose it is, by its config.json.
    pub student: Student,
    /// What intake and the source rules have to say.
    pub findings: Vec<Finding>,
    /// What the compiler said when the source did not build; empty otherwise.
    pub diagnostics: String,
    /// What was found out.
    pub evidence: Evidence,
    /// What failing parts look like.
    #[serde(default)]
    pub diagnoses: Vec<Diagnosis>,
    /// The images that the viewer shows: of each check of images that failed, the worst scene.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub views: Vec<ViewedCase>,
    /// Where the errors of its images lie, for the page of the class.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub error_maps: Vec<SceneErrors>,
    /// The images submitted whose noise tells them from anybody else's.
    #[serde(default)]
    pub images: Vec<ImageDigest>,
    /// The files of the source that hold enough of the student's own to be found again.
    #[serde(default)]
    pub sources: Vec<SourceDigest>,
    /// What each stage cost, in order.
    pub stages: Vec<StageCost>,
    /// Under which conditions.
    pub conditions: Conditions,
}

/// Where the errors of an image lie.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SceneErrors {
    /// The check that it failed.
    pub check: CheckId,
    /// Its scene.
    pub scene: String,
    /// Whether that is held back from students.
    pub held_back: bool,
    /// The error.
    pub map: ErrorMap,
}

/// Credentials, as the submission states them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Student {
    /// First name; empty when it is not said.
    pub first_name: String,
    /// Last name; empty when it is not said.
    pub last_name: String,
    /// Student number as written; empty when it is not said.
    pub id: String,
}

/// What one stage cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StageCost {
    /// Which stage: `intake`, `build`, `offline`...
    pub name: String,
    /// Wall-clock seconds.
    pub wall_s: f64,
    /// CPU seconds of the child processes it ran; 0 when it ran none.
    pub cpu_s: f64,
}

/// Under which conditions a submission was graded: records made under others are not comparable.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Conditions {
    /// Version of Umbra.
    pub umbra: String,
    /// What isolation was in force, in words.
    pub isolation: String,
    /// The graphics adapter, or why there was none.
    pub adapter: String,
    /// The compiler.
    pub compiler: String,
}

impl Record {
    /// That of the submission at `source`, of which nothing is known yet.
    pub(super) fn begun(source: &Path, slug: &str) -> Self {
        Self {
            name: source.file_name().unwrap_or(source.as_os_str()).to_string_lossy().into_owned(),
            slug: slug.to_owned(),
            digest: String::new(),
            student: Student::default(),
            findings: Vec::new(),
            diagnostics: String::new(),
            evidence: Evidence::default(),
            diagnoses: Vec::new(),
            views: Vec::new(),
            error_maps: Vec::new(),
            images: Vec::new(),
            sources: Vec::new(),
            stages: Vec::new(),
            conditions: Conditions::default(),
        }
    }
}

impl Student {
    /// As a `config.json` states them.
    pub fn of(config: &SubmittedConfig) -> Self {
        let text = |field: &Option<Field>| field.as_ref().map_or(String::new(), |f| f.text.clone());
        Self {
            first_name: text(&config.first_name),
            last_name: text(&config.last_name),
            id: text(&config.student_id),
        }
    }

    /// `First Last`, or what there is of it.
    pub fn full_name(&self) -> String {
        format!("{} {}", self.first_name, self.last_name).trim().to_owned()
    }
}
