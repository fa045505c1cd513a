//! `umbra view`: EXR images in the browser.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use basecode::Image;
use basecode::exr_io::read_exr_layers;

use crate::files::write_whole;
use crate::report::html_viewer;
use crate::viewer::{ImageFile, Layer, ViewedCase, write_image};

/// The page's file.
const PAGE: &str = "view.html";

/// Options of `umbra view`.
#[derive(clap::Args)]
pub struct ViewArguments {
    /// The images; all layers of each are shown, and the first of a size less each other
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// The folder for the page and its data [default: a new one in the system's temporary folder]
    #[arg(long, short, value_name = "DIR")]
    pub(super) output: Option<PathBuf>,
}

/// Writes the page, opens it where there is a browser, and prints its path.
pub fn run(arguments: &ViewArguments) -> anyhow::Result<u8> {
    let mut images = Vec::new();
    for path in &arguments.images {
        let file = read_exr_layers(path)?;
        for note in &file.notes {
            eprintln!("umbra: {}: {note}", path.display());
        }
        for (layer, image) in file.layers {
            let name = path.display().to_string();
            images.push((if layer.is_empty() { name } else { format!("{name} {layer}") }, image));
        }
    }
    let names: Vec<&Path> = arguments.images.iter().map(PathBuf::as_path).collect();
    let named = |(name, image): &(String, Image)| (short(name, &names), image.clone());
    let images: Vec<_> = images.iter().map(named).collect();
    let folder = match &arguments.output {
        Some(folder) => folder.clone(),
        None => tempfile::Builder::new().prefix("umbra-view-").tempdir()?.keep(),
    };
    let page = write_page(&folder, &images)?;
    println!("{}", page.display());
    open_page(&page);
    Ok(super::EXIT_OK)
}

/// A name without the folder that all files share.
fn short(name: &str, files: &[&Path]) -> String {
    let parents: Vec<_> = files.iter().map(|file| file.parent()).collect();
    match parents.first() {
        Some(Some(folder)) if parents.iter().all(|parent| *parent == Some(folder)) => {
            let rest = Path::new(name).strip_prefix(folder);
            rest.map_or_else(|_| name.to_owned(), |rest| rest.display().to_string())
        }
        _ => name.to_owned(),
    }
}

/// Writes the viewer's page and its data into a folder; answers the page's absolute path. Images of one size make a
/// case, the first of them less each other shown as differences.
///
/// # Errors
/// When it cannot be written.
pub fn write_page(folder: &Path, images: &[(String, Image)]) -> anyhow::Result<PathBuf> {
    let cannot = || format!("cannot write to {}", folder.display());
    let mut sizes: Vec<(usize, usize)> = Vec::new();
    let mut cases: BTreeMap<(usize, usize), Vec<(&str, ImageFile)>> = BTreeMap::new();
    for (name, image) in images {
        let size = (image.width, image.height);
        if !sizes.contains(&size) {
            sizes.push(size);
        }
        let file = write_image(folder, image).with_context(cannot)?;
        cases.entry(size).or_default().push((name, file));
    }
    let case = |size: &(usize, usize)| {
        let files = cases.get(size).map(Vec::as_slice).unwrap_or_default();
        let mut layers: Vec<Layer> =
            files.iter().map(|(name, file)| Layer::image(*name, file)).collect();
        if let Some(((first, image), others)) = files.split_first() {
            let less = |(other, file): &(&str, ImageFile)| {
                Layer::difference(format!("{first} - {other}"), image, file)
            };
            layers.extend(others.iter().map(less));
        }
        let id = format!("{}x{}", size.0, size.1);
        ViewedCase { title: id.clone(), id, layers, ..ViewedCase::default() }
    };
    let cases: Vec<ViewedCase> = sizes.iter().map(case).collect();
    let title = images.first().map_or("Images", |(name, _)| name);
    let page = folder.join(PAGE);
    write_whole(&page, html_viewer(title, None, &cases).as_bytes()).with_context(cannot)?;
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
