//! The list of checks in `docs/evidence.md`, made from their registry.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use umbra::assignment::Assignment;
use umbra::evidence::CheckId;
use umbra::rubric::Rules;

/// The page, in the repository.
const PAGE: &str = "docs/evidence.md";
const BEGIN: &str =
    "<!-- Made by `xtask checks`; the words stand in harness/src/evidence/registry/info.rs -->\n";
const END: &str = "<!-- end of what `xtask checks` made -->\n";
/// Columns of a line.
const COLUMNS: usize = 120;

/// Writes the list into the page, or with `check` compares it with what the page holds.
///
/// # Errors
/// When the page cannot be used, or differs.
pub fn run(root: &Path, check: bool) -> Result<String> {
    let path = root.join(PAGE);
    let page = std::fs::read_to_string(&path).context(PAGE)?;
    let parts = page.split_once(BEGIN).zip(page.split_once(END));
    let Some(((before, _), (_, after))) = parts else {
        bail!("{PAGE}: the marks of the list are gone")
    };
    let made = format!("{before}{BEGIN}{}{END}{after}", list(&Assignment::load(root)?.rules));
    if check {
        ensure!(
            made == page,
            "{PAGE}: the list of checks is not the registry's; `xtask checks` writes it"
        );
    } else {
        std::fs::write(&path, made).context(PAGE)?;
    }
    Ok(format!("{PAGE}: {} checks", CheckId::ALL.len()))
}

/// Every check as an item of a list.
fn list(rules: &Rules) -> String {
    let mut list = String::new();
    for &check in CheckId::ALL {
        let info = check.info();
        let role = Some(rules.role(check)).filter(|role| !role.is_empty());
        let role = role.map_or_else(String::new, |role| format!(" ({role})"));
        wrap(&mut list, "- ", &format!("**`{check}`**{role}: {}", info.question));
        let rules: Vec<String> = info.rules.iter().map(|rule| format!("`{rule}`")).collect();
        let rules = if rules.is_empty() { String::new() } else { rules.join(", ") + "." };
        for (title, text) in [("Error", info.error), ("Bound", info.bound), ("Rules", &rules)] {
            if !text.is_empty() {
                wrap(&mut list, "  - ", &format!("{title}: {text}"));
            }
        }
    }
    list
}

/// Adds a text in lines of at most [`COLUMNS`], the first after `lead`, the others as deep.
fn wrap(list: &mut String, lead: &str, text: &str) {
    let (mut line, indent) = (lead.to_owned(), " ".repeat(lead.len()));
    for word in text.split(' ') {
        if line.chars().count() + word.chars().count() > COLUMNS {
            list.push_str(line.trim_end());
            list.push('\n');
            line.clone_from(&indent);
        }
        line.push_str(word);
        line.push(' ');
    }
    list.push_str(line.trim_end());
    list.push('\n');
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_page_holds_what_the_registry_says() {
        super::run(crate::root(), true).unwrap();
    }
}
