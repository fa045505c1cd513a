//! Real submissions: every sample is packed as a student would pack it, built and graded by the real binary, and must
//! earn what its recipe says.

use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, Result, ensure};
use clap::ValueEnum as _;
use memchr::memmem;
use serde_json::Value;
use umbra::rubric::Rules;

use super::Arguments;
use super::figures::Figure;
use crate::samples::{self, Recipe};

/// Seed of the held-back scenes: the same in every run.
const HELD_BACK_SEED: &str = "20191006";
/// `--quick` grades every so many of the samples: tests and the matrix show most of their kinds.
const QUICK_STEP: usize = 6;

/// Grades the samples whose names are wanted, none if there are none. Those that wait for time limits are graded only
/// with `--full`. With `--quick`, none is graded whose mistake is one of the matrix, and every third of the others.
///
/// # Errors
/// When a sample cannot be packed, or `umbra` not be run to a good end.
pub fn grade(
    root: &Path,
    umbra: &Path,
    rules: &Rules,
    arguments: &Arguments,
) -> Result<Option<Figure>> {
    let own = AtomicUsize::new(0);
    let wanted = |name: &str, recipe: &Recipe| {
        if !arguments.names(name) || (recipe.slow && !arguments.full) {
            return false;
        }
        let is_one = || own.fetch_add(1, Ordering::Relaxed).is_multiple_of(QUICK_STEP);
        !arguments.quick || (!recipe.expect.is_known_mistake() && is_one())
    };
    let samples = samples::pack(root, &wanted)?;
    if samples.is_empty() {
        return Ok(None);
    }
    let out = root.join("target/umbra/samples-report");
    if out.exists() {
        // What an earlier run found out is not asked for: all are to be graded.
        std::fs::remove_dir_all(&out).with_context(|| out.display().to_string())?;
    }
    let mut command = Command::new(umbra);
    command.arg("grade").args(samples.iter().map(|sample| &sample.archive));
    command.arg("--report").arg(&out).arg("--root").arg(root);
    command.args(["--held-back", HELD_BACK_SEED]);
    if let Some(adapter) = arguments.adapter.to_possible_value() {
        command.args(["--adapter", adapter.get_name()]);
    }
    let output = command.output().with_context(|| umbra.display().to_string())?;
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "umbra grade: {}\n{said}", output.status);
    print!("{}", String::from_utf8_lossy(&output.stdout));
    let file = out.join("report.json");
    let report = std::fs::read(&file).with_context(|| file.display().to_string())?;
    let report: Value = serde_json::from_slice(&report)?;
    ensure!(
        report["held_back"]["seed"] == HELD_BACK_SEED,
        "the report has another seed than {HELD_BACK_SEED}"
    );
    let submissions =
        report["submissions"].as_array().context("the report lists no submissions")?;
    let complaint = |sample: &samples::Sample| {
        let file = sample.archive.file_name().unwrap_or_default().to_string_lossy();
        let own = submissions.iter().find(|submission| submission["name"] == *file);
        let complaint = match own {
            Some(submission) => {
                let complaint = sample.expect.complaint(submission, rules);
                if complaint.is_empty() {
                    names_another(&out, submission, submissions)
                } else {
                    complaint
                }
            }
            None => "it is not in the report".into(),
        };
        (!complaint.is_empty()).then(|| format!("source {}: {complaint}", sample.name))
    };
    let complaints = samples.iter().filter_map(complaint).collect();
    Ok(Some(Figure::right("sources", samples.len(), complaints)))
}

/// What a student's folder tells of any other student, if anything: every byte of it is searched for the
/// names, numbers and archives of all others.
fn names_another(out: &Path, own: &Value, all: &[Value]) -> String {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let folder = out.join(text(&own["slug"]));
    let files = umbra::files::files_below(&folder);
    let read = files
        .and_then(|files| files.iter().map(std::fs::read).collect::<std::io::Result<Vec<_>>>());
    let bytes = match read {
        Ok(files) if !files.is_empty() => files.concat(),
        Ok(_) => return "it has no folder for its student".into(),
        Err(error) => return format!("{}: {error}", folder.display()),
    };
    let others = all.iter().filter(|other| other["slug"] != own["slug"]);
    let names = others.flat_map(|other| {
        let student = &other["student"];
        let full = format!("{} {}", text(&student["first_name"]), text(&student["last_name"]));
        [full.trim().to_owned(), text(&student["id"]), text(&other["name"])]
    });
    let found: Vec<String> = names
        .filter(|name| !name.is_empty())
        .filter(|name| memmem::find(&bytes, name.as_bytes()).is_some())
        .collect();
    if found.is_empty() {
        String::new()
    } else {
        format!("its student's folder names {}", found.join(", "))
    }
}
