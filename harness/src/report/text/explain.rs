//! `umbra explain`: what a check, a rule or a part of the assignment is about.

use super::page::{Look, Page, Style};
use crate::evidence::{CheckId, RuleId};
use crate::rubric::{Part, Rules};

/// Explains what has this name: a check, a rule, or a part of the assignment.
///
/// # Errors
/// When nothing has the name; the message names what is most alike.
pub fn explain(rules: &Rules, name: &str, look: Look) -> Result<String, String> {
    let mut page = Page::new(look.width, look.colors);
    let name = &*name.trim().to_lowercase();
    // `shadow_rays` is near enough.
    let plain = |name: &str| name.replace('_', ".");
    let checks = CheckId::ALL.iter().map(|check| check.name());
    let known = checks.chain(RuleId::ALL.iter().map(|rule| rule.name()));
    let name = known.into_iter().find(|known| plain(known) == plain(name)).unwrap_or(name);
    if let Some(part) = rules.parts.iter().find(|part| part.id == name) {
        explain_part(&mut page, rules, part);
        return Ok(page.finish());
    }
    match (name.parse::<CheckId>(), name.parse::<RuleId>()) {
        (Ok(check), _) => explain_check(&mut page, rules, check),
        (Err(_), Ok(rule)) => {
            page.line(&[(Style::Heading, rule.name())]);
            page.wrapped(
                &[],
                Style::Plain,
                "A rule bounds one measured value. It can fail these checks:",
            );
            for &check in CheckId::ALL.iter().filter(|check| check.info().rules.contains(&rule)) {
                page.gap();
                explain_check(&mut page, rules, check);
            }
        }
        (Err(check), Err(rule)) => return Err(not_found(rules, name, [check, rule])),
    }
    Ok(page.finish())
}

/// What to say of a name that is none: the parts where it looks like one, or the checks that it is a piece of.
fn not_found(rules: &Rules, name: &str, errors: [String; 2]) -> String {
    if name.starts_with(|c: char| c.is_ascii_digit()) {
        let parts: Vec<&str> = rules.parts.iter().map(|part| part.id.as_str()).collect();
        return format!("there is no part {name}; expected one of {}", parts.join(", "));
    }
    let checks = CheckId::ALL.iter().map(|check| check.name());
    let pieces: Vec<&str> = checks.filter(|check| check.split('.').any(|p| p == name)).collect();
    let named = pieces.join(", ");
    if !pieces.is_empty() {
        return format!("there is no check \"{name}\"; names that contain it: {named}");
    }
    let suggests = errors.into_iter().find(|error| error.contains("did you mean"));
    suggests.unwrap_or_else(|| {
        format!(
            "there is no check, rule or part \"{name}\"; hint: `umbra explain` without a name lists the checks"
        )
    })
}

/// All checks, a line each.
pub fn explain_all(rules: &Rules, look: Look) -> String {
    let mut page = Page::new(look.width, look.colors);
    page.wrapped(
        &[],
        Style::Plain,
        "`umbra explain NAME` says more about a check, a rule or a part.",
    );
    page.gap();
    for &check in CheckId::ALL {
        let name = format!("{:<28}", check.name());
        let question = check.info().question;
        let end = [". ", "? "].into_iter().filter_map(|end| question.find(end)).min();
        let first = end.map_or(question, |end| &question[..=end]);
        let role = rules.role(check);
        let text = format!("[{}] {first}", if role.is_empty() { "no points" } else { &role });
        page.wrapped(&[(Style::Heading, &name)], Style::Plain, &text);
    }
    page.finish()
}

fn explain_part(page: &mut Page, rules: &Rules, part: &Part) {
    let worth = if part.bonus { "points on top" } else { "points" };
    page.line(&[(Style::Heading, &format!("{} {}", part.id, part.title))]);
    page.wrapped(&[], Style::Plain, &format!("{} {worth}.", part.points));
    if let Some(path) = rules.paths.get(&part.path) {
        let text = format!(
            "Earned in full when `{}` passes on every scene. Otherwise these checks decide:",
            path.proof
        );
        page.wrapped(&[], Style::Plain, &text);
    }
    for &check in part.evidence.iter().chain(&part.fallback) {
        page.gap();
        explain_check(page, rules, check);
    }
    if !part.images_only.is_empty() {
        let names: Vec<_> = part.images_only.iter().map(|check| check.name()).collect();
        page.gap();
        let text = format!("For a submission without code: {}.", names.join(", "));
        page.wrapped(&[], Style::Plain, &text);
    }
}

fn explain_check(page: &mut Page, rules: &Rules, check: CheckId) {
    let info = check.info();
    let role = rules.role(check);
    let role = if role.is_empty() { String::new() } else { format!(" ({role})") };
    page.line(&[(Style::Heading, check.name()), (Style::Plain, &role)]);
    let plain = |text: &str| text.replace(['`', '*'], "");
    page.wrapped(&[(Style::Plain, "  ")], Style::Plain, &plain(info.question));
    let names: Vec<_> = info.rules.iter().map(|rule| rule.name()).collect();
    let rules = names.join(", ");
    let sources = check.sources();
    let mut code = format!("harness/{}", sources.judged);
    if sources.asked != sources.judged {
        code += &format!("; asked in harness/{}", sources.asked);
    }
    let texts =
        [("error", info.error), ("bound", info.bound), ("rules", &rules), ("judged in", &code)];
    for (title, text) in texts {
        if !text.is_empty() {
            page.wrapped(&[(Style::Open, &format!("  {title}  "))], Style::Plain, &plain(text));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assignment::Assignment;

    fn rules() -> Rules {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
        Assignment::load(root).unwrap().rules
    }

    const LOOK: Look = Look { width: 80, colors: false };

    #[test]
    fn checks_rules_and_parts_are_explained_and_a_slip_is_told() {
        let of = |name| explain(&rules(), name, LOOK);
        let check = of("shadow.rays").unwrap();
        assert!(check.starts_with("shadow.rays (1.4)\n  Asks for radiance"), "{check}");
        assert!(check.contains("  rules  shadow.lit, shadow.dark"), "{check}");
        assert!(
            check.contains("  judged in  harness/evidence/src/rays/shadows.rs; asked in"),
            "{check}"
        );
        // Every check that the rule can fail.
        let rule = of("image.blob").unwrap();
        assert!(rule.contains("image.offline (") && rule.contains("stage.phong (2.4)"), "{rule}");
        let part = of("1.3").unwrap();
        assert!(part.contains("20 points.") && part.contains("\nloop.samples (1.3)"), "{part}");
        assert_eq!(
            of("shadow.ray").unwrap_err(),
            "there is no check \"shadow.ray\"; did you mean \"shadow.rays\"?"
        );
        let slip = of("image.blobs").unwrap_err();
        assert_eq!(slip, "there is no rule \"image.blobs\"; did you mean \"image.blob\"?");
        for name in ["nonsense", "nope", "", "x"] {
            let error = of(name).unwrap_err();
            assert!(error.contains("hint: `umbra explain`"), "{name}: {error}");
        }
        assert!(of(" Shadow_Rays ").is_ok());
        let error = of("9.9").unwrap_err();
        assert!(error.starts_with("there is no part 9.9; expected one of 1.1, 1.2"), "{error}");
        let error = of("phong").unwrap_err();
        assert!(
            error.contains("names that contain it: ") && error.contains("bsdf.phong"),
            "{error}"
        );
    }

    #[test]
    fn all_checks_are_listed_once() {
        let list = explain_all(&rules(), LOOK);
        for check in CheckId::ALL {
            let own = list.lines().filter(|line| line.starts_with(&format!("{check} "))).count();
            assert_eq!(own, 1, "{check}");
        }
        assert!(list.lines().all(|line| line.len() <= 80), "{list}");
    }
}
