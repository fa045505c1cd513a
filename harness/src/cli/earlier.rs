//! `report.json` of an earlier run, as far as commands need it.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context as _;
use serde::Deserialize;

use super::found::{BatchIndex, ensure_merged};
use crate::class::{Class, Standing};
use crate::columns;
use crate::grading::StageCost;
use crate::intake::Finding;
use crate::report;
use crate::rubric::{PartGrade, Rules};

/// A report.
#[derive(Deserialize)]
pub struct StoredReport {
    pub assignment: About,
    pub submissions: Vec<ReportRow>,
    pub class: Option<Class>,
    pub timings: BTreeMap<String, Vec<StageCost>>,
}

/// What it is a report of.
#[derive(Deserialize)]
pub struct About {
    pub name: String,
    pub title: String,
    pub rules: Rules,
}

/// A submission.
#[derive(Deserialize)]
pub struct ReportRow {
    pub name: String,
    pub slug: String,
    /// Of what was submitted; empty where nobody could open it.
    pub digest: String,
    pub points: f64,
    pub points_max: f64,
    pub unconfirmed: f64,
    pub out_of: f64,
    pub remarks: Vec<String>,
    pub parts: Vec<PartGrade>,
    pub standing: Standing,
    /// What the compiler of the code and that of the shaders said.
    #[serde(default)]
    pub diagnostics: String,
    /// What intake found.
    #[serde(default)]
    pub findings: Vec<Finding>,
}

impl ReportRow {
    /// Whether the archive could not be opened, and the instructor has not decided on it.
    pub fn is_unread(&self) -> bool {
        report::is_unread(&self.digest, [self.points, self.points_max], &self.standing)
    }
}

impl ReportRow {
    /// What waits for the instructor, though the points are a number: nothing that a grade book shows.
    pub fn open(&self, rules: &Rules) -> Vec<String> {
        let mut open = Vec::new();
        if !self.standing.is_confirmed() {
            if self.unconfirmed > 0.0 {
                open.push(format!(
                    "not confirmed: {} for its images",
                    columns::points(self.unconfirmed)
                ));
            }
            let private = self.remarks.iter().filter(|remark| report::is_private(remark, rules));
            open.extend(private.cloned());
            open.extend(self.standing.is_draft().then(|| "a draft, not submitted".to_owned()));
        }
        if self.standing.time_unknown {
            open.push("no penalty, since nobody knows when it was submitted".to_owned());
        }
        open
    }
}

impl StoredReport {
    /// Reads the report in a folder.
    ///
    /// # Errors
    /// When there is none, or it is another version's.
    pub fn read(output: &Path) -> anyhow::Result<Self> {
        let file = output.join(report::JSON_FILE);
        ensure_merged(output)?;
        if let Some(found) = BatchIndex::read(output)? {
            found.say_since(output);
        }
        let opened = std::fs::File::open(&file).with_context(|| {
            format!(
                "cannot read {}: expected the --report of an earlier `umbra grade`",
                file.display()
            )
        })?;
        serde_json::from_reader(std::io::BufReader::new(opened)).with_context(|| {
            format!("{}: not a report of this version of Umbra; grade again", file.display())
        })
    }
}
