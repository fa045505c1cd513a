//! Archives as students make them.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result, bail};

use super::Recipe;

/// Writes the files of a sample, by their paths in its tree, in the format that its recipe names.
///
/// # Errors
/// When the format is none, or the archive cannot be written.
pub fn write_archive(
    archive: &Path,
    recipe: &Recipe,
    files: &BTreeMap<String, Vec<u8>>,
) -> Result<()> {
    let inside = |path: &str| match &recipe.wrap {
        Some(folder) => format!("{folder}/{path}"),
        None => path.to_owned(),
    };
    let mut bytes = Vec::new();
    match recipe.format.as_str() {
        "zip" => {
            let mut zip = zip::ZipWriter::new(std::io::Cursor::new(&mut bytes));
            let options = zip::write::SimpleFileOptions::default();
            for (path, content) in files {
                zip.start_file(inside(path), options)?;
                zip.write_all(content)?;
            }
            zip.finish()?;
        }
        "tar" => write_tar(&mut bytes, files, &inside)?,
        "tar.gz" => {
            let mut gz = flate2::write::GzEncoder::new(&mut bytes, flate2::Compression::fast());
            write_tar(&mut gz, files, &inside)?;
            gz.finish()?;
        }
        other => bail!("format is \"{other}\" but must be zip, tar or tar.gz"),
    }
    fs::write(archive, bytes).with_context(|| archive.display().to_string())
}

fn write_tar(
    out: &mut impl Write,
    files: &BTreeMap<String, Vec<u8>>,
    inside: &dyn Fn(&str) -> String,
) -> Result<()> {
    let mut tar = tar::Builder::new(out);
    for (path, content) in files {
        let mut header = tar::Header::new_gnu();
        header.set_size(content.len() as u64);
        header.set_mode(0o644);
        tar.append_data(&mut header, inside(path), content.as_slice())?;
    }
    tar.finish()?;
    Ok(())
}
