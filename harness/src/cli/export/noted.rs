//! What was exported from a report, so that a later export may replace it and nothing else.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, ensure};
use sha2::{Digest as _, Sha256};

use super::ExportFormat;
use crate::class::MATCHES;
use crate::class::overrides::OVERRIDES;
use crate::files::{hex, write_whole};
use crate::report;

/// The file that says what was exported, in the instructor's folder.
const EXPORTS: &str = "exports.json";

/// Digests of what was exported, each with its size [bytes]: an export is known wherever it lies by now.
type Exports = BTreeMap<String, u64>;

/// What was exported from a report; nothing where that cannot be read.
fn exports(output: &Path) -> Exports {
    let file = output.join(report::INSTRUCTOR).join(EXPORTS);
    let bytes = std::fs::read(file).unwrap_or_default();
    serde_json::from_slice(&bytes).unwrap_or_default()
}

/// The path of a file that may not be there yet, by the folder that it lies in.
fn whole_path(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    file.file_name().map_or_else(|| folder.clone(), |name| folder.join(name))
}

pub(super) fn is_same(a: &Path, b: &Path) -> bool {
    whole_path(a) == whole_path(b)
}

/// Makes sure that an export replaces nothing but an earlier export from this report, which nobody changed since.
///
/// # Errors
/// When it would.
pub(super) fn may_replace(file: &Path, format: ExportFormat, output: &Path) -> anyhow::Result<()> {
    if matches!(format, ExportFormat::Csv | ExportFormat::Json)
        && is_same(file, &output.join(format.file()))
    {
        return Ok(());
    }
    let whole = whole_path(file);
    let inside =
        output.canonicalize().ok().and_then(|own| whole.strip_prefix(own).ok().map(Path::to_owned));
    let own = [report::HTML_FILE, report::JSON_FILE, report::CSV_FILE, MATCHES, OVERRIDES];
    if let Some(inside) = inside {
        let is_own = own.iter().any(|name| inside == Path::new(name));
        ensure!(
            !is_own && inside.components().count() == 1,
            "{} belongs to the report, so nothing is exported there; hint: name a file beside {}",
            file.display(),
            output.display()
        );
    }
    if file.symlink_metadata().is_err() {
        return Ok(());
    }
    ensure!(
        is_export(file, output),
        "{} is there already, and is no export from this report, or was changed since; nothing is written; hint: \
         name another file, or remove that one",
        file.display()
    );
    Ok(())
}

/// Whether a file is an export from a report, which nobody changed since.
pub fn is_export(file: &Path, output: &Path) -> bool {
    let Ok(meta) = file.symlink_metadata() else { return false };
    let exports = exports(output);
    meta.is_file()
        && exports.values().any(|size| *size == meta.len())
        && std::fs::read(file).is_ok_and(|bytes| exports.contains_key(&hex(&Sha256::digest(bytes))))
}

/// Notes what was exported, so that a later export may replace it.
pub(super) fn note(bytes: &[u8], output: &Path) -> anyhow::Result<()> {
    let mut exports = exports(output);
    exports.insert(hex(&Sha256::digest(bytes)), bytes.len() as u64);
    let notes = output.join(report::INSTRUCTOR).join(EXPORTS);
    write_whole(&notes, &serde_json::to_vec_pretty(&exports)?)
        .with_context(|| format!("cannot write {}", notes.display()))
}
