//! The list of checks in `docs/evidence.md` and the table of their code in `ARCHITECTURE.md`, made from the registry.

use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use umbra::assignment::Assignment;
use umbra::evidence::{CheckId, IMAGE_RULES};
use umbra::rubric::Rules;

/// What begins a part of a page that is made here.
const BEGIN: &str = "<!-- Made by `xtask checks` from harness/evidence/src/registry/ -->\n";
const END: &str = "<!-- end of what `xtask checks` made -->\n";
/// Columns of a line.
const COLUMNS: usize = 120;

/// Writes list and table into their pages, or with `check` compares them with what the pages hold.
///
/// # Errors
/// When a page cannot be used, or differs.
pub fn run(root: &Path, check: bool) -> Result<String> {
    let list = list(&Assignment::load(root)?.rules);
    for (name, made) in [("docs/evidence.md", list), ("ARCHITECTURE.md", sources())] {
        let path = root.join(name);
        let page = std::fs::read_to_string(&path).context(name)?;
        let parts = page.split_once(BEGIN).zip(page.split_once(END));
        let Some(((before, _), (_, after))) = parts else {
            bail!("{name}: the marks of what `xtask checks` makes are gone")
        };
        let made = format!("{before}{BEGIN}{made}{END}{after}");
        if check {
            ensure!(made == page, "{name} differs from the registry; `xtask checks` writes it");
        } else {
            std::fs::write(&path, made).context(name)?;
        }
    }
    Ok(format!("{} checks written", CheckId::ALL.len()))
}

/// A table of the files that ask and judge the checks of each family, the first word of their names.
fn sources() -> String {
    let family = |check: &CheckId| check.name().split('.').next().unwrap_or_default();
    let mut table =
        "| checks | asked in `src/grading/` | judged in `evidence/src/`, or there |\n|---|---|---|\n"
            .to_owned();
    for name in unique(CheckId::ALL.iter().map(family)) {
        let sources: Vec<_> = CheckId::ALL
            .iter()
            .filter(|check| family(check) == name)
            .map(|check| check.sources())
            .collect();
        let asked = sources.iter().map(|files| module(files.asked));
        let judged = sources
            .iter()
            .map(|files| if files.judged == files.asked { "there" } else { module(files.judged) });
        let [asked, judged] = [unique(asked), unique(judged)].map(|files| files.join(", "));
        table.push_str(&format!("| `{name}.*` | {asked} | {judged} |\n"));
    }
    table
}

/// The path of a file without its first two folders and extension.
fn module(file: &str) -> &str {
    file.splitn(3, '/').last().unwrap_or(file).trim_end_matches(".rs")
}

/// Each item once, in the order in which they first appear.
fn unique<'a>(items: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for item in items {
        if !seen.contains(&item) {
            seen.push(item);
        }
    }
    seen
}

/// Every check as an item of a list.
fn list(rules: &Rules) -> String {
    let mut list = String::new();
    for &check in CheckId::ALL {
        let info = check.info();
        let role = Some(rules.role(check)).filter(|role| !role.is_empty());
        let role = role.map_or_else(String::new, |role| format!(" ({role})"));
        wrap(&mut list, "- ", &format!("**`{check}`**{role}: {}", info.question));
        let (images, rest) = match info.rules.strip_prefix(IMAGE_RULES) {
            Some(rest) => (Some("those of *Images*".to_owned()), rest),
            None => (None, info.rules),
        };
        let rest = rest.iter().map(|rule| format!("`{rule}`"));
        let rules: Vec<String> = images.into_iter().chain(rest).collect();
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
    fn the_pages_hold_what_the_registry_says() {
        super::run(crate::root(), true).unwrap();
    }
}
