//! The `config.json` of a submission against its files.

use std::collections::HashMap;

use super::finding::Finding;
use super::limits::ArchiveLimits;
use super::name::safe_path;
use super::submitted_config::{Field, SubmittedConfig, why_no_number};
use super::tree::{CONFIG_FILE, TreeSpec};
use crate::harmless::printable;

/// Checks what `config.json` says against the submission. Every finding has a line and a hint; what is
/// missing altogether is put on line 1. A slip is a warning; only a student number that cannot be read is an
/// error.
///
/// `present` are the paths that are there once misplaced files are moved, `missing` those of the
/// tree whose absence is reported already. `is_whole` is false where reading stopped: then nothing is said of
/// what is absent, but the number. The findings are in the order of lines.
pub fn check_config(
    config: &SubmittedConfig,
    is_whole: bool,
    present: &[&str],
    missing: &[&str],
    tree: &TreeSpec,
) -> Vec<Finding> {
    let mut findings = Vec::new();
    if is_whole || config.first_name.is_some() {
        for (field, key) in [(&config.first_name, "firstName"), (&config.last_name, "lastName")] {
            // What is said twice is remarked on already.
            if !config.disputed.iter().any(|own| own == key) {
                check_name(field, key, &mut findings);
            }
        }
    }
    check_id(&config.student_id, &mut findings);
    if is_whole {
        check_renders(config, present, missing, tree, &mut findings);
    }
    findings.sort_by_key(|finding| finding.line);
    findings
}

fn error(code: &str, line: u32, message: String, hint: impl Into<String>) -> Finding {
    Finding::error(code, message).at(CONFIG_FILE).on_line(line).hint(hint)
}

fn warning(code: &str, line: u32, message: String, hint: impl Into<String>) -> Finding {
    Finding::warning(code, message).at(CONFIG_FILE).on_line(line).hint(hint)
}

/// Whether a value is one that templates ship with.
pub(super) fn is_template_value(text: &str) -> bool {
    let plain: String =
        text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    const TEMPLATE: [&str; 15] = [
        "first",
        "last",
        "firstname",
        "lastname",
        "yourfirstname",
        "yourlastname",
        "yourname",
        "name",
        "studentid",
        "yourstudentid",
        "youremail",
        "todo",
        "xxx",
        "123456789",
        "260000000",
    ];
    // `<first name>`: a place to be filled in, and not a sign in a name.
    let is_place = text.trim().starts_with('<') && text.trim().ends_with('>');
    TEMPLATE.contains(&plain.as_str()) || is_place
}

fn check_name(field: &Option<Field>, key: &str, findings: &mut Vec<Finding>) {
    let hint = format!("write your name: \"{key}\": \"Ada\"");
    match field {
        None => {
            findings.push(warning("config_credentials", 1, format!("\"{key}\" is missing"), hint))
        }
        Some(field) if field.text.is_empty() => {
            findings.push(warning(
                "config_credentials",
                field.line,
                format!("\"{key}\" is empty"),
                hint,
            ));
        }
        Some(field) if is_template_value(&field.text) => {
            let message = format!("\"{key}\" is still the template's: {}", printable(&field.text));
            findings.push(warning("config_credentials", field.line, message, hint));
        }
        Some(_) => {}
    }
}

fn check_id(field: &Option<Field>, findings: &mut Vec<Finding>) {
    let hint = "write your student number: \"studentID\": \"260123456\"; it seeds your sampler";
    match field {
        None => findings.push(error(
            "config_credentials",
            1,
            "\"studentID\" is missing".to_owned(),
            hint,
        )),
        Some(field) if field.text.is_empty() => {
            findings.push(error(
                "config_credentials",
                field.line,
                "\"studentID\" is empty".to_owned(),
                hint,
            ));
        }
        Some(field) if is_template_value(&field.text) => {
            let message =
                format!("\"studentID\" is still the template's: {}", printable(&field.text));
            findings.push(error("config_credentials", field.line, message, hint));
        }
        // A sign would pass `parse`, so digits are asked for first.
        Some(field)
            if !field.text.bytes().all(|b| b.is_ascii_digit())
                || field.text.parse::<u64>().is_err() =>
        {
            let why = why_no_number(&field.text).map_or(String::new(), |why| format!(": {why}"));
            let found = printable(&field.text);
            let message = format!("\"studentID\": expected digits only, found '{found}'{why}");
            findings.push(error("config_student_id", field.line, message, hint));
        }
        Some(field) if field.text.bytes().all(|b| b == b'0') => {
            findings.push(error(
                "config_student_id",
                field.line,
                "\"studentID\" is zero".to_owned(),
                hint,
            ));
        }
        Some(_) => {}
    }
}

fn check_renders(
    config: &SubmittedConfig,
    paths: &[&str],
    missing: &[&str],
    tree: &TreeSpec,
    findings: &mut Vec<Finding>,
) {
    if !config.has_renders {
        findings.push(warning(
            "config_renders",
            1,
            "the list \"renders\" is missing".to_owned(),
            "list your images: \"renders\": [ { \"scene\": ..., \"render\": ... } ]",
        ));
        return;
    }
    // Line on which each image was listed first, by the canonical path of the tree.
    let mut listed: HashMap<String, u32> = HashMap::new();
    for render in &config.renders {
        let written = printable(&render.render);
        let (path, slip) = match resolve(&render.render, paths, tree) {
            Ok(found) => found,
            Err(finding) => {
                findings.push(finding.at(CONFIG_FILE).on_line(render.line));
                continue;
            }
        };
        findings.extend(slip.map(|finding| finding.at(CONFIG_FILE).on_line(render.line)));
        let name = canonical(&path, tree);
        if let Some(line) = listed.get(&name) {
            let message = format!("'{written}' is listed twice, first on line {line}");
            findings.push(warning(
                "config_listed_twice",
                render.line,
                message,
                "keep one of the two entries",
            ));
            continue;
        }
        listed.insert(name.clone(), render.line);
        if missing.contains(&name.as_str())
            || paths.iter().any(|found| canonical(found, tree) == name)
        {
            continue;
        }
        findings.push(not_found(&written, &name, paths, tree).at(CONFIG_FILE).on_line(render.line));
    }
    for path in paths.iter().filter(|path| path.to_lowercase().ends_with(".exr")) {
        let is_listed =
            listed.keys().any(|name| name.to_lowercase() == canonical(path, tree).to_lowercase());
        if tree.file_at(path).is_some() && !is_listed {
            findings.push(
                Finding::warning(
                    "config_not_listed",
                    format!("'{path}' is submitted, but not listed"),
                )
                .at(CONFIG_FILE)
                .on_line(1)
                .hint(format!("add {{ \"scene\": ..., \"render\": \"{path}\" }} to \"renders\"")),
            );
        }
    }
}

/// What to say about a listed path at which nothing lies.
fn not_found(written: &str, name: &str, paths: &[&str], tree: &TreeSpec) -> Finding {
    let lower = name.to_lowercase();
    let base = |path: &str| path.rsplit('/').next().unwrap_or(path).to_lowercase();
    let same_path = paths.iter().find(|found| canonical(found, tree).to_lowercase() == lower);
    // Another place of the tree, not one that is no part of it.
    let in_tree = |found: &&&str| tree.file_at(found).is_some() && base(found) == base(name);
    let same_name = || paths.iter().find(in_tree);
    if let Some(found) = same_path {
        Finding::warning(
            "config_wrong_case",
            format!("'{written}' is listed, but its name is '{found}'"),
        )
        .hint(format!("write \"{found}\": upper and lower case count"))
    } else if let Some(found) = same_name() {
        Finding::warning(
            "config_wrong_place",
            format!("'{written}' is listed, but its place is '{found}'"),
        )
        .hint(format!("write \"{found}\""))
    } else {
        Finding::warning(
            "config_render_missing",
            format!("'{written}' is listed, but not submitted"),
        )
        .hint("add the image or remove the entry")
    }
}

/// The tree's own path of a file that may stand at an alias.
fn canonical(path: &str, tree: &TreeSpec) -> String {
    tree.file_at(path).map_or(path, |file| &file.path).to_owned()
}

/// A listed path as a plain relative path, and the finding on its spelling.
fn resolve(
    written: &str,
    paths: &[&str],
    tree: &TreeSpec,
) -> Result<(String, Option<Finding>), Finding> {
    const FROM_ROOT: &str = "write the image's path from the root of the submission, such as \
        offline/cbox_simple_offline.exr";
    let shown = printable(written.trim());
    let slip = |code: &str, message: String| Finding::warning(code, message);
    if written.trim().is_empty() {
        return Err(
            slip("config_render_missing", "a render with an empty path".to_owned()).hint(FROM_ROOT)
        );
    }
    // In JSON `\t` is a tab: `offline\teapot.exr`.
    let unescaped = written.trim().replace('\t', "\\t").replace('\r', "\\r").replace('\n', "\\n");
    let unescaped = unescaped.replace('\u{8}', "\\b").replace('\u{c}', "\\f");
    let slashed = unescaped.replace('\\', "/");
    let plain = safe_path(slashed.as_bytes(), &ArchiveLimits::default());
    // What a path from elsewhere ends with may be the submission's own: `/home/ada/a2/offline/cbox.exr`.
    let end_of = |path: &&&str| {
        slashed
            .strip_suffix(**path)
            .is_some_and(|before| before.is_empty() || before.ends_with('/'))
    };
    let own = paths.iter().filter(|path| path.contains('/')).find(end_of);
    match (plain, own) {
        (Ok(safe), _) if slashed == written.trim() => Ok((safe.path, None)),
        (Ok(safe), _) => {
            let finding = slip("config_backslash", format!("'{shown}' holds a backslash"));
            Ok((safe.path, Some(finding.hint(format!("write \"{}\"", printable(&slashed))))))
        }
        (Err(_), Some(own)) => {
            let what = if slashed.starts_with('/') {
                "begins with a slash"
            } else {
                "is no path from the root"
            };
            let finding = slip("config_path", format!("'{shown}' {what}"));
            let own = canonical(own, tree);
            Ok((own.clone(), Some(finding.hint(format!("write \"{}\"", printable(&own))))))
        }
        (Err(_), None) => {
            let message = format!("'{shown}' leaves the submission");
            Err(slip("config_path_escape", message).hint(FROM_ROOT))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes and lines of the findings on a config with this list of renders.
    fn check(renders: &str, paths: &[&str]) -> Vec<String> {
        let text = format!(
            "{{\"firstName\": \"Ada\", \"lastName\": \"Lampglow\",\n\"studentID\": \"42\", \"renders\": [\n{renders}\n]}}"
        );
        codes(&text, paths)
    }

    fn codes(text: &str, paths: &[&str]) -> Vec<String> {
        let (config, mut findings, is_whole) = SubmittedConfig::parse(text.as_bytes());
        findings.extend(check_config(&config, is_whole, paths, &[], &TreeSpec::default()));
        for finding in &findings {
            assert!(finding.hint.is_some() && finding.line.is_some(), "{finding}");
            // Only a number that cannot be read is an error.
            let is_number = finding.message.contains("studentID");
            assert_eq!(finding.severity == crate::intake::Severity::Error, is_number, "{finding}");
        }
        findings.iter().map(|f| format!("{}@{}", f.code, f.line.unwrap_or(0))).collect()
    }

    const CBOX: &str = "offline/cbox_simple_offline.exr";

    #[test]
    fn a_right_list_is_silent() {
        assert_eq!(
            check(r#"{"scene": "c", "render": "offline/cbox_simple_offline.exr"}"#, &[CBOX]),
            [""; 0]
        );
    }

    #[test]
    fn any_name_of_the_bonus_is_the_bonus() {
        for submitted in ["realtime/teapot_bonus.exr", "realtime/teapot_simple_realtime_bonus.exr"]
        {
            assert_eq!(check(r#""renders/teapot_bonus.exr""#, &[submitted]), [""; 0]);
        }
    }

    #[test]
    fn each_mistake_has_its_code() {
        assert_eq!(check("\"offline/nothing.exr\"", &[]), ["config_render_missing@3"]);
        assert_eq!(check("\"../../etc/passwd\"", &[]), ["config_path_escape@3"]);
        assert_eq!(check("\"/etc/passwd\"", &[]), ["config_path_escape@3"]);
        for (written, code) in [
            ("offline\\\\cbox_simple_offline.exr", "config_backslash@3"),
            ("/offline/cbox_simple_offline.exr", "config_path@3"),
            ("/home/ada/a2/offline/cbox_simple_offline.exr", "config_path@3"),
            ("C:\\\\a2\\\\offline\\\\cbox_simple_offline.exr", "config_path@3"),
            ("../offline/cbox_simple_offline.exr", "config_path@3"),
        ] {
            // It is listed all the same.
            assert_eq!(check(&format!("\"{written}\""), &[CBOX]), [code], "{written}");
        }
        let tab = "realtime\\teapot_simple_realtime.exr";
        let found = check(&format!("\"{tab}\""), &["realtime/teapot_simple_realtime.exr"]);
        assert_eq!(found, ["config_backslash@3"], "\\t is a tab");
        assert_eq!(check("\"Offline/cbox_simple_offline.exr\"", &[CBOX]), ["config_wrong_case@3"]);
        assert_eq!(
            check(&format!("\"{CBOX}\",\n\"./{CBOX}\""), &[CBOX]),
            ["config_listed_twice@4"]
        );
        assert_eq!(check("", &[CBOX]), ["config_not_listed@1"]);
        assert_eq!(check("\"\"", &[]), ["config_render_missing@3"]);
        assert_eq!(
            check("\"cbox_simple_offline.exr\"", &[CBOX]),
            ["config_not_listed@1", "config_wrong_place@3"]
        );
    }

    #[test]
    fn credentials_are_checked() {
        let with = |first: &str, id: &str| {
            codes(
                &format!(
                    "{{\"firstName\": \"{first}\",\n\"lastName\": \"L\",\n\"studentID\": \"{id}\", \"renders\": []}}"
                ),
                &[],
            )
        };
        assert_eq!(with("Ada", "260123456"), [""; 0]);
        assert_eq!(with("", "260123456"), ["config_credentials@1"]);
        assert_eq!(with("First", "260123456"), ["config_credentials@1"]);
        assert_eq!(with("<your name>", "260123456"), ["config_credentials@1"]);
        for bad in ["26012345x", "-1", "+1", "1.5", "18446744073709551616", "000"] {
            assert_eq!(with("Ada", bad), ["config_student_id@3"], "{bad}");
        }
        assert_eq!(with("Ada", ""), ["config_credentials@3"]);
        assert_eq!(codes("{}", &[]).len(), 4);
    }

    #[test]
    fn a_place_to_be_filled_in_is_no_name_and_a_sign_in_a_name_is() {
        for text in ["<first name>", " <your name> ", "First", "TODO"] {
            assert!(is_template_value(text), "{text}");
        }
        for text in ["Bob\"<b>", "<3 Ann", "Ann > Bo", "Ada"] {
            assert!(!is_template_value(text), "{text}");
        }
    }
}
