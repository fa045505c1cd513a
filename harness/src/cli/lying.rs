//! Where a graded submission lies now: by itself, or in the download that it was graded from.

use std::path::{Path, PathBuf};

use anyhow::Context as _;

use super::class;
use super::context::Context;
use crate::class::{Kind, Wanted, collect};

/// Where a submission lies.
pub enum Lying {
    /// At this path.
    Here(PathBuf),
    /// In this download, which is a file, below this path in it.
    Packed {
        /// The download.
        download: PathBuf,
        /// The path in it.
        inside: PathBuf,
    },
    /// Nowhere: it was graded from this path.
    Gone(PathBuf),
}

impl Lying {
    /// Where the submission in a folder of a report lies.
    pub fn of(output: &Path, slug: &str) -> Self {
        let place = class::place_of(output, slug).map(PathBuf::from).unwrap_or_default();
        if place.exists() {
            return Self::Here(place);
        }
        let download = place.ancestors().find(|above| above.exists());
        match download.filter(|above| above.is_file()) {
            Some(download) => Self::Packed {
                download: download.to_owned(),
                inside: place.strip_prefix(download).unwrap_or(&place).to_owned(),
            },
            None => Self::Gone(place),
        }
    }

    /// The arguments of `umbra grade` that grade this submission alone, for a shell.
    pub fn arguments(&self) -> String {
        match self {
            Self::Here(path) => quoted(path),
            Self::Packed { download, inside } => {
                format!("{} --only {}", quoted(download), quoted(inside))
            }
            Self::Gone(_) => "SUBMISSION".to_owned(),
        }
    }
}

/// The archive or folder of a graded submission; what lies in a download is unpacked below `scratch`, an empty folder.
///
/// # Errors
/// When it does not lie any more where it was graded from.
pub fn fetch(
    lying: &Lying,
    kind: Kind,
    context: &Context,
    scratch: &Path,
) -> anyhow::Result<PathBuf> {
    match lying {
        Lying::Here(path) => Ok(path.clone()),
        Lying::Packed { download, inside } => {
            let wanted = Wanted {
                tree: &context.assignment.tree,
                limits: &context.assignment.limits.archive,
                from: Some(kind).filter(|kind| *kind != Kind::Plain),
                output: None,
                scratch,
            };
            let collected = collect(std::slice::from_ref(download), &wanted)?;
            let place = download.join(inside);
            let found = collected.sources.into_iter().find(|source| source.place == place);
            found.map(|source| source.path).with_context(|| {
                format!("{} is not in {} any more", inside.display(), download.display())
            })
        }
        Lying::Gone(place) => {
            anyhow::bail!("{} is not there any more", place.display())
        }
    }
}

/// A path as a word of a shell's command line.
pub fn quoted(path: &Path) -> String {
    let text = path.to_string_lossy();
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./+,=:@%".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        return text.into_owned();
    }
    format!("'{}'", text.replace('\'', "'\\''"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shell_reads_a_path_as_one_word() {
        for (path, expected) in [
            ("/tmp/a2_ada.zip", "/tmp/a2_ada.zip"),
            ("A2 Download.zip", "'A2 Download.zip'"),
            ("Zo\u{eb} O'Neil/a2.zip", "'Zo\u{eb} O'\\''Neil/a2.zip'"),
            ("$(x)", "'$(x)'"),
            ("", "''"),
        ] {
            assert_eq!(quoted(Path::new(path)), expected);
        }
    }
}
