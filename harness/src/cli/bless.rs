//! `umbra bless`: the stored expected images, rendered anew on purpose.

use std::path::Path;

use anyhow::ensure;

use super::context::Context;

/// What `umbra bless` is told.
#[derive(clap::Args)]
pub struct BlessArguments {
    /// Names of the scenes [default: all that are stored]
    scenes: Vec<String>,
}

/// Renders and replaces, printing old and new.
pub fn run(arguments: &BlessArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let context = Context::new(root)?;
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
        context.line.finish_and_clear();
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
