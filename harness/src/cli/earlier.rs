//! `report.json` of an earlier run, as far as commands need it.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Context as _;
use serde::Deserialize;

use crate::class::{Class, Standing};
use crate::grading::StageCost;
use crate::report;
use crate::rubric::{PartGrade, Rules};

/// A report.
#[derive(Deserialize)]
pub struct Report {
    pub assignment: About,
    pub submissions: Vec<Row>,
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
pub struct Row {
    pub name: String,
    pub slug: String,
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
}

impl Report {
    /// Reads the report in a folder.
    ///
    /// # Errors
    /// When there is none, or it is another version's.
    pub fn read(output: &Path) -> anyhow::Result<Self> {
        let file = output.join(report::JSON_FILE);
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
