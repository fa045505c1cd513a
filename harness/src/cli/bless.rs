//! `umbra bless`: renders the stored expected images again, on purpose.

use std::path::Path;

use anyhow::{Context as _, bail, ensure};

use super::context::{Context, INTERRUPTED};
use crate::diagnosis::Catalogue;
use crate::grading::Grading;
use crate::worker::{Adapter, AdapterKind};

/// The film of scenes that a submission holds images of: what mistakes do there shows on a small one.
const SMALL_FILM: [u32; 2] = [128, 96];

/// Options of `umbra bless`.
#[derive(clap::Args)]
pub struct BlessArguments {
    /// Scenes to render [default: all that are stored]
    scenes: Vec<String>,
    /// Render what known mistakes look like instead; the reference renderer makes each of them
    #[arg(long, conflicts_with = "scenes")]
    mistakes: bool,
}

/// Renders and replaces, printing old and new.
///
/// # Errors
/// When a name is no stored scene, or an image cannot be rendered or written.
pub fn run(arguments: &BlessArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let mut context = Context::new(root)?;
    if arguments.mistakes {
        return mistakes(&mut context);
    }
    let stored: Vec<_> = context.assignment.scenes.iter().filter(|scene| scene.stored).collect();
    for name in &arguments.scenes {
        let known = stored.iter().any(|scene| scene.name == *name);
        let names: Vec<&str> = stored.iter().map(|scene| scene.name.as_str()).collect();
        ensure!(known, "no stored scene \"{name}\"; expected one of {}", names.join(", "));
    }
    for scene in stored {
        if !arguments.scenes.is_empty() && !arguments.scenes.contains(&scene.name) {
            continue;
        }
        let blessing = context.with_store(|store| store.bless(scene))?;
        context.progress.end();
        println!("{}", blessing.file.display());
        match blessing.old_mean {
            Some(old) => println!("  old mean {old:.6}"),
            None => println!("  new file"),
        }
        println!("  new mean {:.6}", blessing.new_mean);
        if let Some(rmse) = blessing.rmse {
            println!("  rmse between them {rmse:.6}");
        }
        for (key, value) in &blessing.attributes {
            println!("  {key} {value}");
        }
    }
    Ok(super::EXIT_OK)
}

/// Renders every known mistake again and replaces the stored answers.
fn mistakes(context: &mut Context) -> anyhow::Result<u8> {
    for scene in context.assignment.scenes.iter_mut().filter(|scene| scene.submitted.is_some()) {
        scene.film = Some(SMALL_FILM);
    }
    let context = &*context;
    let reference = context
        .reference()
        .context("there is no reference renderer here; hint: cargo build --release --workspace")?;
    let catalogue = Catalogue::known()?;
    let mistakes: Vec<_> = catalogue.mistakes.iter().filter(|m| m.is_stored()).collect();
    let (folder, stored) = context.with_store(|store| {
        let adapter = Adapter { kind: AdapterKind::Software, name: String::new() };
        let grading = Grading::prepare(store, adapter, None, &INTERRUPTED)?;
        if let Err(why) = &grading.adapter {
            bail!("cannot draw realtime here: {why}");
        }
        let say = |message: &str| context.say(message);
        Ok((grading.stored_folder(), grading.look_at_mistakes(&reference, &mistakes, &say)?))
    })?;
    stored.save(&folder)?;
    context.progress.end();
    for (view, content) in &stored.views {
        println!(
            "{}: {} mistakes",
            folder.join(format!("{view}.exr")).display(),
            content.mistakes.len()
        );
    }
    Ok(super::EXIT_OK)
}
