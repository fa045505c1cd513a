//! `umbra explain`: prints entries of the registry of checks.

use std::path::Path;

use clap::Args;

use super::context::Context;
use super::{EXIT_OK, terminal};
use crate::report::{self, Look};

/// What is explained.
#[derive(Args)]
pub struct ExplainArguments {
    /// A check such as shadow.rays, a rule such as image.blob, or a part such as 1.3 [default: lists all checks]
    name: Option<String>,
}

/// Prints the explanation.
///
/// # Errors
/// When there is no assignment, or nothing has this name.
pub fn run(arguments: &ExplainArguments, root: Option<&Path>) -> anyhow::Result<u8> {
    let rules = Context::assignment(root)?.rules;
    let look = Look { width: terminal::width(), colors: terminal::colors() };
    let text = match &arguments.name {
        Some(name) => report::explain(&rules, name, look).map_err(anyhow::Error::msg)?,
        None => report::explain_all(&rules, look),
    };
    print!("{text}");
    Ok(EXIT_OK)
}
