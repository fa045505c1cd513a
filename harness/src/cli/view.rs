//! `umbra view`: EXR images in the browser.

use std::path::{Path, PathBuf};

use anyhow::Context;
use basecode::Image;
use basecode::exr_io::{Band, ExrRows};

use super::outputs::ensure_not_read;
use crate::files::{keep_newest_of, private_folder, write_whole};
use crate::harmless::harmless;
use crate::report::html_viewer;
use crate::viewer::{ImageFile, Layer, ViewedCase, write_channels, write_image};

/// The page's file.
pub(super) const PAGE: &str = "view.html";

/// Options of `umbra view`.
#[derive(clap::Args)]
pub struct ViewArguments {
    /// The images; all layers and channels of each are shown, and the difference of the first to each other image of
    /// its size
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// The folder for the page and its data [default: a new one in the system's temporary folder]
    #[arg(long, short, value_name = "DIR")]
    pub(super) output: Option<PathBuf>,
}

/// One image of a page.
struct Shown {
    name: String,
    /// The channel that it is, or empty where it is one of colors.
    channel: String,
    file: ImageFile,
}

/// Writes the page, opens it where there is a browser, and prints its path; exit 1 when a file could not be read.
///
/// # Errors
/// When no image can be read, or the page cannot be written.
pub fn run(arguments: &ViewArguments) -> anyhow::Result<u8> {
    let paths: Vec<&Path> = arguments.images.iter().map(PathBuf::as_path).collect();
    let folder = match &arguments.output {
        Some(folder) => folder.clone(),
        None => own_folder()?,
    };
    ensure_not_read(&folder.join(PAGE), paths.iter().copied())?;
    let mut shown = Vec::new();
    let mut failed = None;
    for (path, name) in paths.iter().zip(names_of(&paths)) {
        match unpack(path, &name, &folder) {
            Ok(images) => shown.extend(images),
            Err(error) => {
                if let Some(earlier) = failed.replace(error) {
                    eprintln!("umbra: {}", super::told_once(&earlier));
                }
            }
        }
    }
    match failed {
        Some(error) if shown.is_empty() => return Err(error),
        Some(ref error) => eprintln!("umbra: {}", super::told_once(error)),
        None => {}
    }
    let mut title = names_of(&paths[..paths.len().min(3)]).join(", ");
    if paths.len() > 3 {
        title.push_str(&format!(" and {} more", paths.len() - 3));
    }
    let page = write_page(&folder, &title, shown, None)?;
    println!("{}", page.display());
    open_page(&page);
    Ok(if failed.is_some() { super::EXIT_NOT_IN_ORDER } else { super::EXIT_OK })
}

/// What the folders of pages begin with that were given none.
const PREFIX: &str = "umbra-view-";
/// So many of them are kept: a page may be open still.
const KEPT: usize = 3;

/// A new folder of one's own in the system's temporary one; of earlier ones the oldest go.
fn own_folder() -> anyhow::Result<PathBuf> {
    let folder = private_folder(PREFIX)?.keep();
    let all = folder.parent().unwrap_or(Path::new("."));
    let is_own = |path: &Path| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with(PREFIX) && same_owner(path, &folder)
    };
    // What cannot be removed is left.
    let _ = keep_newest_of(all, KEPT, is_own);
    Ok(folder)
}

/// Whether two folders, neither of them a link, belong to one user.
fn same_owner(one: &Path, other: &Path) -> bool {
    let folder = |path: &Path| path.symlink_metadata().ok().filter(std::fs::Metadata::is_dir);
    let (Some(one), Some(other)) = (folder(one), folder(other)) else { return false };
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt as _;
        one.uid() == other.uid()
    }
    #[cfg(not(unix))]
    {
        let _ = (one, other);
        true
    }
}

/// Writes the images of a file into the page's folder, those of each part.
fn unpack(path: &Path, name: &str, folder: &Path) -> anyhow::Result<Vec<Shown>> {
    let (parts, left_out) = ExrRows::open_parts(path)?;
    for note in left_out {
        eprintln!("umbra: {}: {}", path.display(), harmless(&note));
    }
    let mut shown = Vec::new();
    for part in &parts {
        shown.extend(unpack_part(part, name, folder)?);
    }
    Ok(shown)
}

/// Writes the images of a part: each layer of colors, and every other channel by itself.
fn unpack_part(file: &ExrRows, name: &str, folder: &Path) -> anyhow::Result<Vec<Shown>> {
    for note in file.notes() {
        let part = file.part();
        let part = if part.is_empty() { String::new() } else { format!("part {part}: ") };
        eprintln!("umbra: {}: {}", file.path().display(), harmless(&format!("{part}{note}")));
    }
    // A file without colors is shown by its channels.
    let mut colors = file.layers().map(|(layers, _)| layers).unwrap_or_default();
    // Luminance alone is a channel.
    colors.retain(|(_, channels)| channels[0] != channels[1]);
    let mut images: Vec<(String, String, Vec<usize>)> = Vec::new();
    for (layer, channels) in &colors {
        let layer = file.name_in_file(layer);
        let name = if layer.is_empty() { name.to_owned() } else { format!("{name} {layer}") };
        images.push((name, String::new(), channels.to_vec()));
    }
    for (index, channel) in file.channels().iter().enumerate() {
        if !colors.iter().any(|(_, own)| own.contains(&index)) {
            let channel = file.name_in_file(channel);
            images.push((format!("{name} {channel}"), channel, vec![index]));
        }
    }
    let (width, height) = (file.width(), file.height());
    let mut shown = Vec::new();
    let mut band = Band::default();
    for (name, channel, own) in images {
        // The only copy of the pixels that is whole in memory.
        let mut values = vec![0.0; width * height * own.len()];
        for top in (0..height).step_by(file.band_height()) {
            let rows = top..height.min(top + file.band_height());
            file.read(rows.clone(), &own, &mut band)?;
            for at in 0..own.len() {
                for y in rows.clone() {
                    let start = (at * height + y) * width;
                    values[start..start + width].copy_from_slice(band.row(at, y - top));
                }
            }
        }
        for (&index, plane) in own.iter().zip(values.chunks_exact_mut(width * height)) {
            // An integer was read as a fraction of the largest.
            if file.is_integer(index) {
                let whole = |value: f32| (f64::from(value) * f64::from(u32::MAX)).round() as f32;
                plane.iter_mut().for_each(|value| *value = whole(*value));
            }
        }
        let size = (width, height, own.len());
        let file = write_channels(folder, size, &values).with_context(cannot(folder))?;
        shown.push(Shown { name, channel, file });
    }
    Ok(shown)
}

fn cannot(folder: &Path) -> impl Fn() -> String {
    move || format!("cannot write to {}", folder.display())
}

/// The names of files, without the folders that all share.
pub(super) fn names_of(files: &[&Path]) -> Vec<String> {
    let mut folders = files.first().into_iter().flat_map(|file| file.ancestors().skip(1));
    let shared = folders.find(|folder| files.iter().all(|file| file.starts_with(folder)));
    // Without the root, a path would look like another one.
    let shared = shared.filter(|folder| folder.parent().is_some()).unwrap_or(Path::new(""));
    let name = |file: &&Path| file.strip_prefix(shared).unwrap_or(file).display().to_string();
    files.iter().map(name).collect()
}

/// Writes the viewer's page of an image beside the expected one, and its data, into a folder; returns the page's
/// absolute path.
///
/// # Errors
/// When it cannot be written.
pub fn compared_page(
    folder: &Path,
    names: [String; 2],
    images: [&Image; 2],
) -> anyhow::Result<PathBuf> {
    let title = format!("{} and {}", names[0], names[1]);
    let shown = names.into_iter().zip(images).map(|(name, image)| {
        let file = write_image(folder, image).with_context(cannot(folder))?;
        Ok(Shown { name, channel: String::new(), file })
    });
    write_page(folder, &title, shown.collect::<anyhow::Result<_>>()?, Some(1))
}

/// Writes the page of images whose data lie in a folder. Images of one size make a case, those of each channel their
/// own, with the first of them less each other as differences.
fn write_page(
    folder: &Path,
    title: &str,
    mut images: Vec<Shown>,
    reference: Option<usize>,
) -> anyhow::Result<PathBuf> {
    // Colors come first.
    images.sort_by_key(|image| !image.channel.is_empty());
    let mut cases: Vec<(String, Vec<Shown>)> = Vec::new();
    for image in images {
        let id = format!("{}x{} {}", image.file.width, image.file.height, image.channel);
        let id = id.trim_end().to_owned();
        match cases.iter_mut().find(|(own, _)| *own == id) {
            Some((_, own)) => own.push(image),
            None => cases.push((id, vec![image])),
        }
    }
    let case = |(id, images): (String, Vec<Shown>)| {
        let layer = |image: &Shown| Layer::image(&image.name, &image.file);
        let mut layers: Vec<Layer> = images.iter().map(layer).collect();
        if let Some((first, others)) = images.split_first() {
            let less = |other: &Shown| {
                let name = format!("{} - {}", first.name, other.name);
                Layer::difference(name, &first.file, &other.file)
            };
            layers.extend(others.iter().map(less));
        }
        // Images of different sizes stand alone.
        let reference = reference.filter(|index| *index < images.len());
        ViewedCase { title: id.clone(), id, layers, reference, ..ViewedCase::default() }
    };
    let cases: Vec<ViewedCase> = cases.into_iter().map(case).collect();
    let page = folder.join(PAGE);
    let html = html_viewer(title, None, &cases);
    write_whole(&page, html.as_bytes()).with_context(cannot(folder))?;
    Ok(std::path::absolute(&page)?)
}

/// Opens a page in the browser, where a desktop is there to show it.
pub fn open_page(page: &Path) {
    let set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let desktop = cfg!(not(target_os = "linux")) || set("DISPLAY") || set("WAYLAND_DISPLAY");
    if desktop && let Err(error) = open::that_detached(page) {
        eprintln!("umbra: no browser could be started ({error}); open the page yourself");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_by_what_tells_them_apart() {
        let named = |files: &[&str]| {
            names_of(&files.iter().map(|file| Path::new(*file)).collect::<Vec<_>>())
        };
        assert_eq!(named(&["/home/me/a/x.exr", "/home/me/b/x.exr"]), ["a/x.exr", "b/x.exr"]);
        assert_eq!(named(&["out/x.exr", "out/old/x.exr"]), ["x.exr", "old/x.exr"]);
        assert_eq!(named(&["/a/x.exr", "/b/x.exr"]), ["/a/x.exr", "/b/x.exr"]);
        assert_eq!(named(&["../one/x.exr", "x.exr"]), ["../one/x.exr", "x.exr"]);
        assert_eq!(named(&["/home/me/x.exr"]), ["x.exr"]);
    }
}
