//! `umbra release`: gives students the held-back scenes once nobody can submit any more.

use std::io::{Cursor, Write as _};
use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::assemble::{self, KeptReport};
use super::context::Context;
use super::report_folder::ReportFolder;
use super::settled::RELEASED;
use crate::class::late;
use crate::files::{files_below, write_whole};
use crate::held_back;
use crate::report;

/// The scenes, in the report's folder.
const SCENES: &str = "held-back-scenes.zip";

/// Options of `umbra release`.
#[derive(clap::Args)]
pub struct ReleaseArguments {
    #[command(flatten)]
    report: ReportFolder,
}

/// Writes the scenes and the students' pages with them.
///
/// # Errors
/// Before the last due date, when nothing is held back, or when files cannot be written.
pub fn run(arguments: &ReleaseArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let output = &arguments.report.path;
    let assignment = Context::assignment(root)?;
    let kept = KeptReport::read(output)?;
    let decided = kept.decided()?;
    let stated = &decided.assignment;
    let end = late::end(&stated.due, stated.late.as_ref())
        .with_context(|| format!("the due date {} says no time", stated.due))?;
    let now = jiff::Timestamp::now();
    ensure!(
        now >= end,
        "nothing is released before {}: the due date, the cut-off, late days and the last extension come first",
        late::shown(end, &stated.due, stated.late.as_ref())
    );
    let mut settled = kept.report(output, decided)?;
    let report = &mut settled.report;
    let Some(seed) = report.held_back.as_ref().map(|held_back| held_back.seed) else {
        bail!("{} holds nothing back: it was graded with --held-back off", output.display());
    };
    let (made, entries) = held_back::make(&assignment, seed)?;
    ensure!(
        report.held_back.as_ref() == Some(&made),
        "the scenes in {} have changed since {} was graded; hint: --root with the assignment of then",
        assignment.root.join("scenes").display(),
        output.display()
    );
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for entry in &entries {
        // SCENE/tinyrender/NAME.toml, beside SCENE/mesh.
        let folder = entry.offline.ancestors().nth(2).unwrap_or(&entry.offline);
        for file in files_below(folder)? {
            let below = file.strip_prefix(folder).unwrap_or(&file).iter();
            let below: Vec<_> = below.map(|name| name.to_string_lossy()).collect();
            zip.start_file(
                format!("{}/{}", entry.name, below.join("/")),
                SimpleFileOptions::default().last_modified_time(zip::DateTime::default()),
            )?;
            zip.write_all(&std::fs::read(&file)?)?;
        }
    }
    let scenes = output.join(SCENES);
    write_whole(&scenes, &zip.finish()?.into_inner())
        .with_context(|| format!("cannot write {}", scenes.display()))?;
    let flag = output.join(report::INSTRUCTOR).join(RELEASED);
    write_whole(&flag, format!("{now}\n").as_bytes())
        .with_context(|| format!("cannot write {}", flag.display()))?;
    report.released = true;
    assemble::write(output, &settled)?;
    println!(
        "{}: the {} that were held back, for all students; the page of each shows now what went wrong on them",
        scenes.display(),
        crate::columns::count(entries.len(), "scene")
    );
    Ok(super::EXIT_OK)
}
