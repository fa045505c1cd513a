//! Where a graded submission lies now: by itself, or in the download that it was graded from.

use std::path::{Path, PathBuf};

use anyhow::Context as _;

use super::class;
use super::context::Context;
use super::outputs::shell_path;
use crate::class::{CollectOptions, Platform, collect};

/// Where a submission lies.
pub enum Location {
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

impl Location {
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
            Self::Here(path) => shell_path(path),
            Self::Packed { download, inside } => {
                format!("{} --only {}", shell_path(download), shell_path(inside))
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
    location: &Location,
    kind: Platform,
    context: &Context,
    scratch: &Path,
) -> anyhow::Result<PathBuf> {
    match location {
        Location::Here(path) => Ok(path.clone()),
        Location::Packed { download, inside } => {
            let wanted = CollectOptions {
                tree: &context.assignment.tree,
                limits: &context.assignment.limits.archive,
                from: Some(kind).filter(|kind| *kind != Platform::Plain),
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
        Location::Gone(place) => {
            anyhow::bail!("{} is not there any more", place.display())
        }
    }
}
