//! The place that a submission has in the download of a class, and keeps in a newer one; and whether two are the same.

use std::io;
use std::path::Path;

use sha2::{Digest as _, Sha256};

use super::layout::{Label, Platform, label_of};
use crate::files::{feed, files_below, hex};

/// Folders that are no part of a submission, and may be large.
const LEFT_OUT: [&str; 2] = ["target", ".git"];

/// The place in a download, whatever zip or folder that lies in: the platform's name of the submission with the path
/// below it; where no platform names it, its own name.
pub fn slot(label: Option<&Label>, name: &str) -> String {
    let Some(label) = label else { return name.to_owned() };
    let parts: Vec<&str> = name.split('/').collect();
    let is = |part: &&str| match label.kind {
        Platform::Github => **part == label.submission,
        kind => label_of(kind, part).is_some_and(|own| own.submission == label.submission),
    };
    let below = match parts.iter().rposition(is) {
        Some(at) if at + 1 < parts.len() => parts[at + 1..].join("/"),
        Some(at) => flat(label, parts[at]).to_owned(),
        None => name.to_owned(),
    };
    format!("{}: {}/{below}", label.kind.title(), label.submission)
}

/// What a file is called below the platform's name of the submission, where files lie flat beside each other: the same
/// as in a folder of that name.
fn flat<'a>(label: &Label, part: &'a str) -> &'a str {
    let rest = part.strip_prefix(&label.submission).unwrap_or_default();
    let file = match label.kind {
        Platform::Brightspace => Some(rest.trim_start_matches([' ', '-'])),
        Platform::Moodle => {
            let rest = rest.strip_prefix("_assignsubmission_");
            rest.and_then(|rest| rest.split_once('_')).map(|(_, file)| file)
        }
        _ => None,
    };
    file.filter(|file| !file.is_empty()).unwrap_or(part)
}

/// Digest of the bytes of an archive, or of the files of a folder with their paths.
///
/// # Errors
/// When something cannot be read.
pub fn content(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    if path.is_file() {
        feed(&mut hash, path)?;
        return Ok(hex(&hash.finalize()));
    }
    let mut files = files_below(path)?;
    files.sort();
    for file in files {
        let inside = file.strip_prefix(path).unwrap_or(&file);
        let is_left_out =
            |part: std::path::Component| LEFT_OUT.iter().any(|name| part.as_os_str() == *name);
        if inside.components().any(is_left_out) {
            continue;
        }
        let size = file.metadata()?.len();
        hash.update(format!("\n{} {size}\n", inside.display()));
        feed(&mut hash, &file)?;
    }
    Ok(hex(&hash.finalize()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slot_is_the_same_in_every_download() {
        let slot = |kind: Platform, component: &str, name: &str| {
            super::slot(label_of(kind, component).as_ref(), name)
        };
        let own = "102-902 - Ann Lee - Oct 5, 2019 1159 PM";
        let expected = format!("Brightspace: {own}/a2.zip");
        for name in [format!("{own}/a2.zip"), format!("tue.zip/Lab/{own}/a2.zip"), "a2.zip".into()]
        {
            assert_eq!(slot(Platform::Brightspace, own, &name), expected, "{name}");
        }
        let canvas = "leeann_101_2001_a2.zip";
        for name in [canvas.to_owned(), format!("mon/{canvas}")] {
            assert_eq!(
                slot(Platform::Canvas, canvas, &name),
                format!("Canvas: leeann_101/{canvas}")
            );
        }
        let moodle = "Ann Lee_7_assignsubmission_file";
        assert_eq!(
            slot(Platform::Moodle, moodle, &format!("x/{moodle}/a2.zip")),
            "Moodle: Ann Lee_7/a2.zip"
        );
        // Flat files, as the platforms also name them.
        let flat = format!("{moodle}_a2.zip");
        assert_eq!(slot(Platform::Moodle, &flat, &flat), "Moodle: Ann Lee_7/a2.zip");
        let flat = format!("{own} - a2.zip");
        assert_eq!(slot(Platform::Brightspace, &flat, &format!("x/{flat}")), expected);
        assert_eq!(super::slot(None, "ann/a2.zip"), "ann/a2.zip");
    }

    #[test]
    fn content_is_bytes_and_paths() {
        let place = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| {
            let path = place.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        let of = |name: &str| content(&place.path().join(name)).unwrap();
        for (name, text) in
            [("a/x", "1"), ("b/x", "1"), ("b/target/y", "2"), ("c/z", "1"), ("d/x", "2")]
        {
            put(name, text);
        }
        assert_eq!(of("a"), of("b"));
        assert_ne!(of("a"), of("c"));
        assert_ne!(of("a"), of("d"));
        assert_eq!(of("a/x"), of("c/z"));
    }
}
