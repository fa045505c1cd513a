//! Reports: console text, `report.json`, `grades.csv` and HTML pages.
//!
//! A student gets the folder `<slug>/` of their submission and nothing else. For held-back scenes it says only whether
//! an answer is right and how wrong it is. It names no other submission and links nowhere else. Everything else is for
//! the instructor: the files of the batch, and `instructor/<slug>/` with all evidence.
//!
//! This module decides nothing. Every format passes a submission's text through `harmless`, and adds the escaping that
//! the format itself needs.

#[cfg(test)]
mod browser_tests;
#[cfg(test)]
#[allow(dead_code)] // the viewer's tests use the rest
#[path = "../../tests/support/chromium.rs"]
mod chromium;
mod csv;
mod errors;
mod html;
mod json;
mod number;
mod outline;
#[cfg(test)]
pub(crate) mod sample;
mod schema;
mod text;
#[cfg(test)]
mod write_tests;

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::{Component, Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use self::csv::grades as csv_grades;
pub use self::errors::{ClassErrors, ERRORS, ErrorPicture};
pub use self::html::{
    Reader, SIMILARITY, SimilarPair, SimilarityPage, batch as html_batch, mark_superseded,
    submission as html_submission, viewer as html_viewer, write_similarity,
};
pub use self::json::{SCHEMA, VERSION, report_json};
pub use self::number::earned;
pub use self::outline::outline;
pub use self::schema::report_schema;
pub use self::text::{
    Closing, Look, checked_only, closing as text_closing, defend, detail as text_detail, explain,
    explain_all, in_a_line, table as text_table,
};
pub use crate::harmless::csv_cell;
pub use crate::harmless::harmless;

use crate::assignment::Assignment;
use crate::class::{Class, Standing, Stated};
use crate::evidence::Check;
use crate::files::{write_whole, write_whole_by};
use crate::grading::{Record, Student};
use crate::held_back::HeldBack;
use crate::rubric::{Grade, Rules};

/// The file for programs, in the batch's folder.
pub const JSON_FILE: &str = "report.json";
/// The file for the grade book, in the batch's folder.
pub const CSV_FILE: &str = "grades.csv";
/// The page for readers, in the batch's folder and in the folder of each submission.
pub const HTML_FILE: &str = "report.html";
/// The page of the viewer, beside a submission's page.
pub const VIEW_FILE: &str = "view.html";
/// The folder of a mended submission: a report of its own, in the instructor's folder of the submission.
pub const MENDED: &str = "mended";
/// The mended submission itself, in that folder.
pub const MENDED_SOURCE: &str = "submission";
/// The folder in the batch's folder that holds what students must not see.
pub const INSTRUCTOR: &str = "instructor";

/// One submission with its points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SubmissionReport {
    /// What was found out.
    pub record: Record,
    /// What it is worth, after what lateness costs.
    pub grade: Grade,
    /// Whose it is, and when it came.
    #[serde(default)]
    pub standing: Standing,
}

impl SubmissionReport {
    /// Whose it is: as the class list says where it tells, else as the submission itself does.
    pub fn student(&self) -> Student {
        let own = &self.record.student;
        self.standing.student.as_ref().map_or_else(
            || own.clone(),
            |listed| {
                // A list may hold accounts or numbers alone.
                let is_named = !(listed.first_name.is_empty() && listed.last_name.is_empty());
                let names = match is_named {
                    true => [&listed.first_name, &listed.last_name],
                    false => [&own.first_name, &own.last_name],
                };
                let [first_name, last_name] = names.map(String::clone);
                let id = if listed.number.is_empty() { &own.id } else { &listed.number }.clone();
                Student { first_name, last_name, id }
            },
        )
    }
}

/// Whether an archive could not be opened, and the instructor has not decided on it. Its digest is empty.
pub fn is_unread(digest: &str, [least, most]: [f64; 2], standing: &Standing) -> bool {
    digest.is_empty() && least == most && standing.decisions.iter().all(|own| own.stale)
}

/// Everything that a report of a batch is made from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BatchReport {
    /// The assignment's short name: `a2`.
    pub assignment: String,
    /// The assignment's title.
    pub title: String,
    /// The course's title.
    pub course: String,
    /// When it was due, RFC 3339 with offset.
    pub due: String,
    /// The rules that made the points.
    pub rules: Rules,
    /// What was held back from students, if anything.
    pub held_back: Option<HeldBack>,
    /// The submissions, in the order to be shown.
    pub entries: Vec<SubmissionReport>,
    /// What is known of the class as a whole; nothing where one submission is checked.
    #[serde(default)]
    pub class: Option<Class>,
    /// Whether students may see what was held back.
    #[serde(default)]
    pub released: bool,
    /// Whether there are pages that show pairs of submissions which are alike.
    #[serde(default)]
    pub has_similarity: bool,
}

impl SubmissionReport {
    /// Name and folder, for a message.
    pub fn who(&self) -> String {
        let (name, slug) = (self.student().full_name(), &self.record.slug);
        if name.is_empty() { slug.clone() } else { format!("{name} ({slug})") }
    }

    /// Whether there is more to know than the student may.
    pub fn has_private(&self, rules: &Rules) -> bool {
        let private = |check: &Check| check.held_back || !check.private.is_empty();
        self.record.evidence.checks.iter().any(private)
            || self.grade.remarks.iter().any(|remark| is_private(remark, rules))
    }

    /// Whether the instructor has a page of their own about it: among others it always leads to them.
    pub fn has_instructor_page(&self, report: &BatchReport) -> bool {
        report.entries.len() > 1 || self.has_private(&report.rules)
    }

    /// The entry as its student may read it; `released` where that includes held-back scenes.
    pub fn for_student(&self, rules: &Rules, released: bool) -> Self {
        let mut entry = self.clone();
        // Similar code or a copied image is for the instructor to look at, and no verdict. Ones that passed would tell
        // which did not.
        let private = |check: &Check| rules.is_private(check.id);
        let hidden: Vec<String> = entry
            .record
            .evidence
            .checks
            .iter()
            .filter(|own| private(own))
            .map(Check::name)
            .collect();
        entry.record.evidence.checks.retain(|check| !private(check));
        for part in &mut entry.grade.parts {
            part.evidence.retain(|name| !hidden.contains(name));
        }
        for check in &mut entry.record.evidence.checks {
            *check = if released {
                Check { private: String::new(), ..check.clone() }
            } else {
                check.for_student()
            };
        }
        entry.grade.remarks.retain(|remark| !is_private(remark, rules));
        entry.record.views.retain(|view| !view.held_back);
        entry
    }
}

/// Whether a remark is the reason of a gate that only instructors read.
pub(crate) fn is_private(remark: &str, rules: &Rules) -> bool {
    rules.gates.iter().any(|gate| gate.private && gate.reason == remark)
}

/// Why there is no report.
#[derive(Debug, Error)]
pub enum ReportError {
    /// An empty report would look like a successful batch.
    #[error(
        "no submission to report: expected at least one (hint: name an archive, a folder, or a folder of them)"
    )]
    Empty,
    /// The folder of a submission's page has no usable name.
    #[error(
        "submission \"{name}\": expected a plain and unique folder name for its report, found \"{slug}\""
    )]
    Slug {
        /// The submission.
        name: String,
        /// The name.
        slug: String,
    },
    /// A file cannot be written.
    #[error("{}: cannot write the report: {source}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The evidence about a submission is not available.
    #[error("{slug}: {reason}")]
    Entry {
        /// Its folder in the report.
        slug: String,
        /// Why.
        reason: String,
    },
    /// A value has no place in the format.
    #[error("{file}: cannot be made: {reason}")]
    Format {
        /// The file.
        file: &'static str,
        /// Why.
        reason: String,
    },
}

impl BatchReport {
    /// A report for submissions of an assignment.
    pub fn new(
        assignment: &Assignment,
        held_back: Option<HeldBack>,
        entries: Vec<SubmissionReport>,
    ) -> Self {
        Self {
            assignment: assignment.name.clone(),
            title: assignment.title.clone(),
            course: assignment.course.clone(),
            due: assignment.due.clone(),
            rules: assignment.rules.clone(),
            held_back,
            entries,
            class: None,
            released: false,
            has_similarity: false,
        }
    }

    /// The report of a class by what is pinned.
    pub fn settled(
        stated: Stated,
        held_back: Option<HeldBack>,
        entries: Vec<SubmissionReport>,
        class: Class,
    ) -> Self {
        let Stated { name: assignment, title, course, due, rules, .. } = stated;
        let class = Some(class);
        Self {
            assignment,
            title,
            course,
            due,
            rules,
            held_back,
            entries,
            class,
            released: false,
            has_similarity: false,
        }
    }

    fn check(&self) -> Result<(), ReportError> {
        if self.entries.is_empty() {
            return Err(ReportError::Empty);
        }
        let mut seen = HashSet::new();
        for SubmissionReport { record, .. } in &self.entries {
            let mut components = Path::new(&record.slug).components();
            let plain = matches!(
                (components.next(), components.next()),
                (Some(Component::Normal(name)), None) if name == record.slug.as_str()
            );
            let taken =
                [JSON_FILE, CSV_FILE, HTML_FILE, INSTRUCTOR].contains(&record.slug.as_str());
            if !plain || taken || !seen.insert(&record.slug) {
                let (name, slug) = (record.name.clone(), record.slug.clone());
                return Err(ReportError::Slug { name, slug });
            }
        }
        Ok(())
    }
}

/// Writes `report.json`, `grades.csv`, `report.html`, and `<slug>/report.html` with `<slug>/view.html` for each
/// submission, into the folder `out`, which is made when missing, and `instructor/<slug>/report.html` where
/// there is more to know than the student may. The pictures are expected to lie in `<slug>/`, those of held-back scenes
/// in `instructor/<slug>/` already.
///
/// Each file appears whole or not at all; the pages of the submissions come first, so that
/// `report.html` never leads nowhere.
///
/// # Errors
/// When there is no submission, a slug is no plain unique name, or a file cannot be written.
pub fn write(out: &Path, report: &BatchReport) -> Result<(), ReportError> {
    write_outlined(out, report, &|entry| Ok(Cow::Borrowed(entry)))
}

/// Gives the whole of an entry of which a report holds the outline alone.
pub type Whole<'a> =
    dyn for<'b> Fn(&'b SubmissionReport) -> Result<Cow<'b, SubmissionReport>, ReportError> + 'a;

/// The same for a class whose entries are outlines: one at a time is whole.
///
/// # Errors
/// As [`write`], and when an entry cannot be had.
pub fn write_outlined(out: &Path, report: &BatchReport, whole: &Whole) -> Result<(), ReportError> {
    report.check()?;
    let mut errors = ClassErrors::default();
    for outlined in &report.entries {
        let entry = &*whole(outlined)?;
        errors.add(&entry.record);
        let slug = &entry.record.slug;
        let page = html_submission(report, entry, Reader::Student);
        if report.released {
            release_pictures(entry, &out.join(INSTRUCTOR).join(slug), &out.join(slug))?;
        }
        put(&out.join(slug), HTML_FILE, page.as_bytes())?;
        view(&out.join(slug), report, entry, false)?;
        if entry.has_instructor_page(report) {
            let page = html_submission(report, entry, Reader::Instructor);
            let folder = out.join(INSTRUCTOR).join(slug);
            put(&folder, HTML_FILE, page.as_bytes())?;
            view(&folder, report, entry, true)?;
        }
    }
    put(out, CSV_FILE, csv_grades(report)?.as_bytes())?;
    let path = out.join(JSON_FILE);
    write_whole_by(&path, |file| json::write(report, whole, file))
        .map_err(|source| ReportError::Write { path, source })?;
    // A class of one has its own page for that.
    let errors = match report.entries.len() {
        1 => Vec::new(),
        _ => errors.write(&out.join(INSTRUCTOR).join(ERRORS))?,
    };
    put(out, HTML_FILE, html_batch(report, &errors)?.as_bytes())
}

/// Copies the pictures of held-back scenes from the instructor's folder to the student's.
fn release_pictures(
    entry: &SubmissionReport,
    instructor: &Path,
    student: &Path,
) -> Result<(), ReportError> {
    let held_back = entry.record.evidence.checks.iter().filter(|check| check.held_back);
    for picture in held_back.flat_map(|check| &check.pictures) {
        let path = instructor.join(&picture.file);
        let bytes = std::fs::read(&path).map_err(|source| ReportError::Write { path, source })?;
        put(student, &picture.file, &bytes)?;
    }
    Ok(())
}

/// Writes the viewer's page of a submission's public or held-back scenes, if there is something to see.
fn view(
    folder: &Path,
    report: &BatchReport,
    entry: &SubmissionReport,
    held_back: bool,
) -> Result<(), ReportError> {
    let views = entry.record.views.iter().filter(|view| view.held_back == held_back);
    let views: Vec<_> = views.cloned().collect();
    if views.is_empty() {
        // An earlier page would show images that are gone.
        let path = folder.join(VIEW_FILE);
        return match std::fs::remove_file(&path) {
            Err(source) if source.kind() != std::io::ErrorKind::NotFound => {
                Err(ReportError::Write { path, source })
            }
            _ => Ok(()),
        };
    }
    let title = format!("{} - {}", entry.student().full_name(), report.title);
    put(folder, VIEW_FILE, html_viewer(&title, Some(HTML_FILE), &views).as_bytes())
}

/// Writes one file, unless it is there so: of a class, a decision changes few.
fn put(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), ReportError> {
    let path = folder.join(name);
    if std::fs::read(&path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    write_whole(&path, bytes).map_err(|source| ReportError::Write { path, source })
}
