//! Feedback as a learning platform takes it back: one file or folder for each student, named as in its download.

use std::io::{self, Cursor, Write};
use std::path::Path;

use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, ZipWriter};

use super::layout::{Label, Platform};
use crate::files::files_below;

/// The feedback on one submission.
#[derive(Clone, Copy, Debug)]
pub struct Feedback<'a> {
    /// What the platform says of the submission, if it is from one.
    pub label: Option<&'a Label>,
    /// What reports call the submission: its path in the download.
    pub name: &'a str,
    /// Its folder in the report.
    pub slug: &'a str,
    /// The folder that its student may read.
    pub folder: &'a Path,
}

/// Where feedback goes in an archive.
#[derive(Debug, PartialEq, Eq)]
enum Place {
    /// All files packed into one, at this path.
    Packed(String),
    /// The files themselves, in this folder.
    Folder(String),
}

impl Feedback<'_> {
    /// As the platform names what it takes back. Those that take files of one student at a time get one zip for each,
    /// since a page needs its pictures beside it.
    fn place(&self) -> Place {
        const FILE: &str = "feedback.zip";
        let Some(label) = self.label else { return Place::Folder(self.slug.to_owned()) };
        let own = &label.submission;
        match label.kind {
            Platform::Brightspace => Place::Packed(format!("{own}/{FILE}")),
            Platform::Moodle => Place::Packed(format!("{own}_assignfeedback_file_{FILE}")),
            Platform::Canvas => {
                // The file's own name, which holds the numbers of the student and of the file.
                let file = self.name.rsplit('/').next().unwrap_or(self.name);
                let ending = if file.to_lowercase().ends_with(".zip") { "" } else { ".zip" };
                Place::Packed(format!("{file}{ending}"))
            }
            Platform::Gradescope | Platform::Github => Place::Folder(own.clone()),
            Platform::Plain => Place::Folder(self.slug.to_owned()),
        }
    }
}

/// One archive of all feedback. The same files give the same bytes.
///
/// # Errors
/// When a file cannot be read, or the archive would be too large for its format.
pub fn archive(all: &[Feedback]) -> io::Result<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for feedback in all {
        match feedback.place() {
            Place::Packed(path) => {
                let mut own = ZipWriter::new(Cursor::new(Vec::new()));
                add(&mut own, "", feedback.folder)?;
                let bytes = own.finish().map_err(io::Error::other)?.into_inner();
                write(&mut zip, &path, &bytes, CompressionMethod::Stored)?;
            }
            Place::Folder(path) => add(&mut zip, &format!("{path}/"), feedback.folder)?,
        }
    }
    Ok(zip.finish().map_err(io::Error::other)?.into_inner())
}

type Zip = ZipWriter<Cursor<Vec<u8>>>;

/// Adds the files of a folder.
fn add(zip: &mut Zip, above: &str, folder: &Path) -> io::Result<()> {
    for file in files_below(folder)? {
        let below = file.strip_prefix(folder).unwrap_or(&file);
        let below: Vec<_> = below.iter().map(|part| part.to_string_lossy()).collect();
        let bytes = std::fs::read(&file)?;
        write(zip, &format!("{above}{}", below.join("/")), &bytes, CompressionMethod::Deflated)?;
    }
    Ok(())
}

fn write(zip: &mut Zip, path: &str, bytes: &[u8], method: CompressionMethod) -> io::Result<()> {
    let options = SimpleFileOptions::default().last_modified_time(DateTime::default());
    let options = options.compression_method(method);
    zip.start_file(path, options).map_err(io::Error::other)?;
    zip.write_all(bytes)
}

#[cfg(test)]
mod tests {
    use super::super::layout::label_of;
    use super::*;

    #[test]
    fn each_platform_finds_its_own_names() {
        let packed = |kind: Platform, component: &str, name: &str| {
            let label = label_of(kind, component).unwrap();
            let feedback =
                Feedback { label: Some(&label), name, slug: "slug", folder: Path::new(".") };
            match feedback.place() {
                Place::Packed(path) => path,
                Place::Folder(path) => format!("{path}/"),
            }
        };
        for (kind, component, name, expected) in [
            (
                Platform::Brightspace,
                "12-3 - Zoë O'Neil-Ode - Oct 5, 2019 1159 PM",
                "12-3 - Zoë O'Neil-Ode - Oct 5, 2019 1159 PM/a2.zip",
                "12-3 - Zoë O'Neil-Ode - Oct 5, 2019 1159 PM/feedback.zip",
            ),
            // Flat.
            (
                Platform::Brightspace,
                "12-3 - Ann Lee - Oct 5, 2019 1159 PM - a2_ann.zip",
                "12-3 - Ann Lee - Oct 5, 2019 1159 PM - a2_ann.zip",
                "12-3 - Ann Lee - Oct 5, 2019 1159 PM/feedback.zip",
            ),
            (
                Platform::Canvas,
                "leeann_LATE_502_9002_a2_7_8-1.zip",
                "leeann_LATE_502_9002_a2_7_8-1.zip",
                "leeann_LATE_502_9002_a2_7_8-1.zip",
            ),
            (
                Platform::Canvas,
                "anon_x7Yz_456_a2.tar.gz",
                "anon_x7Yz_456_a2.tar.gz",
                "anon_x7Yz_456_a2.tar.gz.zip",
            ),
            (
                Platform::Moodle,
                "Zoë O'Neil_7_assignsubmission_file",
                "Zoë O'Neil_7_assignsubmission_file/a2.zip",
                "Zoë O'Neil_7_assignfeedback_file_feedback.zip",
            ),
            (
                Platform::Moodle,
                "Participant_12_assignsubmission_file_a2.zip",
                "Participant_12_assignsubmission_file_a2.zip",
                "Participant_12_assignfeedback_file_feedback.zip",
            ),
            (Platform::Gradescope, "submission_11", "submission_11", "submission_11/"),
        ] {
            assert_eq!(packed(kind, component, name), expected, "{component}");
        }
    }
}
