//! The `config.json` of a submission: credentials and the list of renders, read tolerantly.

mod keys;
mod numbers;
mod said;
mod salvage;

use serde::{Deserialize, Serialize};

use super::finding::Finding;
use super::json_lines::{Node, Read, Value, parse};
use super::tree::CONFIG_FILE;
use crate::harmless::printable;

use keys::{Key, known_key};
pub(super) use numbers::why_no_number;
use numbers::{is_digits, number_in};
use said::{Said, Word};

/// What the submission's `config.json` says; absent where it does not say it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SubmittedConfig {
    /// First name.
    pub first_name: Option<Field>,
    /// Last name.
    pub last_name: Option<Field>,
    /// Student number as written.
    pub student_id: Option<Field>,
    /// Address of the student.
    pub email: Option<Field>,
    /// The renders, in the order of the file.
    pub renders: Vec<ListedRender>,
    /// Whether a list of renders is there at all.
    pub has_renders: bool,
    /// Keys that are absent because the file says several different things of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub disputed: Vec<String>,
}

/// A text and its line.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Field {
    /// The text, trimmed.
    pub text: String,
    /// Its line in the file, from 1.
    pub line: u32,
}

/// One entry of the list of renders.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ListedRender {
    /// Title of the scene, free text.
    pub scene: String,
    /// Path of the image as written.
    pub render: String,
    /// Line of the path, from 1.
    pub line: u32,
}

impl SubmittedConfig {
    /// Reads a `config.json`, whatever it is: what can be made out of it counts. The findings are warnings and
    /// name `config.json`, line and hint. The last answer is whether all was read: what is
    /// absent may else be in the rest.
    pub fn parse(bytes: &[u8]) -> (Self, Vec<Finding>, bool) {
        let Read { node, stopped, rest, text, mut findings } = parse(bytes);
        let mut config = Self::default();
        let mut said = Said::default();
        let is_object = matches!(node, Some(Node { value: Value::Object(_) | Value::List(_), .. }));
        match node {
            Some(Node { value: Value::Object(members), .. }) => {
                config.take_members(&members, true, &mut said, &mut findings);
            }
            Some(node) => {
                let message = format!("expected an object {{ ... }}, found {}", node.value.kind());
                findings.push(
                    Finding::warning("config_shape", message)
                        .on_line(node.line)
                        .hint("start from the template's config.json"),
                );
                if let Value::List(items) = &node.value {
                    config.take_one_of(items, true, &mut said, &mut findings);
                }
            }
            None => {}
        }
        if !findings.is_empty() {
            said.append(salvage::beside(&text, &said));
        }
        let (rest, line) = if is_object { rest } else { (text.clone(), 1) };
        let rest = salvage::read(&rest, line, stopped && config.has_renders, &said);
        said.append(rest);
        if said.id.is_empty() {
            said.fill_from(salvage::read(&text, 1, false, &said));
        }
        said.settle(&mut config, &mut findings);
        config.tidy_number(&mut findings);
        for finding in &mut findings {
            finding.path = Some(CONFIG_FILE.to_owned());
        }
        (config, findings, !stopped)
    }

    /// The seed of every sampler that draws the submission's own images.
    pub fn sampler_seed(&self) -> Option<u64> {
        self.student_id.as_ref()?.text.parse().ok()
    }

    fn take_members(
        &mut self,
        members: &[(String, u32, Node)],
        is_top: bool,
        said: &mut Said,
        findings: &mut Vec<Finding>,
    ) {
        for (key, line, node) in members {
            let Some((known, is_slip)) = known_key(key) else { continue };
            if is_slip {
                let message = format!("'{}' is taken for \"{}\"", printable(key), known.written());
                let hint = format!("write \"{}\"", known.written());
                let finding = Finding::warning("config_key", message).on_line(*line);
                findings.push(finding.hint(hint));
            }
            // `"student": 260123456` is no name.
            let is_number = plain_text(node).is_some_and(|text| is_digits(&text));
            match known {
                Key::First => take(&mut said.first, key, *line, node, findings),
                Key::Last => take(&mut said.last, key, *line, node, findings),
                Key::Full if is_number => take_number(&mut said.id, key, *line, node, findings),
                Key::Id => take_number(&mut said.id, key, *line, node, findings),
                Key::Email => take(&mut said.email, key, *line, node, findings),
                Key::Full => match (&node.value, members_of(node)) {
                    (_, Some(members)) if is_top => {
                        self.take_members(members, false, said, findings)
                    }
                    (Value::List(items), _) => self.take_names(key, *line, items, said, findings),
                    _ => take(&mut said.full, key, *line, node, findings),
                },
                Key::Renders if is_top => {
                    self.has_renders = true;
                    self.take_renders(node, findings);
                }
                Key::Renders => {}
            }
        }
        // Whatever else an object is called, it may hold what is still missing.
        let mut inner = Said::default();
        for (key, _, node) in members.iter().filter(|_| is_top) {
            if let Some(members) = members_of(node).filter(|_| known_key(key).is_none()) {
                self.take_members(members, false, &mut inner, findings);
            }
        }
        said.fill_from(inner);
    }

    /// A student number with other signs around or between its digits, without them.
    fn tidy_number(&mut self, findings: &mut Vec<Finding>) {
        let Some(field) = &mut self.student_id else { return };
        let Some(digits) = number_in(&field.text).filter(|digits| *digits != field.text) else {
            return;
        };
        let message = format!(
            "\"studentID\": expected digits only, found '{}': read as {digits}",
            printable(&field.text)
        );
        findings.push(
            Finding::warning("config_student_id", message)
                .on_line(field.line)
                .hint(format!("write \"studentID\": \"{digits}\"")),
        );
        field.text = digits;
    }

    /// The student of a list. Of several nobody is taken: which of them submits is not for us to guess.
    fn take_one_of(
        &mut self,
        items: &[Node],
        is_top: bool,
        said: &mut Said,
        findings: &mut Vec<Finding>,
    ) {
        let mut students: Vec<Self> = Vec::new();
        for members in items.iter().filter_map(members_of) {
            let (mut student, mut own) = (Self::default(), Said::default());
            student.take_members(members, is_top, &mut own, findings);
            own.settle(&mut student, &mut Vec::new());
            let is_known = students.iter().any(|other| other.names_same(&student));
            if !is_known && student.names_somebody() {
                students.push(student);
            }
        }
        match &students[..] {
            [] | [_] => {
                for members in items.iter().filter_map(members_of) {
                    self.take_members(members, is_top, said, &mut Vec::new());
                }
            }
            [first, second, ..] => {
                let text = |field: &Option<Field>| field.as_ref().map(|field| field.text.clone());
                let who = |one: &Self| {
                    let said = [&one.first_name, &one.last_name, &one.student_id];
                    printable(&said.into_iter().filter_map(text).collect::<Vec<_>>().join(" "))
                };
                let message = format!(
                    "expected one student, found {}: {} and {}",
                    students.len(),
                    who(first),
                    who(second)
                );
                let mut numbers: Vec<String> =
                    students.iter().filter_map(|one| text(&one.student_id)).collect();
                numbers.dedup();
                let line = first.student_id.as_ref().map_or(1, |field| field.line);
                if !numbers.is_empty() {
                    let key = Key::Id.written().to_owned();
                    said.id.push(Word { key, text: numbers.join(", "), line });
                }
                let finding = Finding::warning("config_two_students", message).on_line(line);
                findings.push(finding.hint("keep the one who submits"));
            }
        }
    }

    fn names_somebody(&self) -> bool {
        self.first_name.is_some() || self.last_name.is_some() || self.student_id.is_some()
    }

    fn names_same(&self, other: &Self) -> bool {
        let text = |field: &Option<Field>| field.as_ref().map(|field| field.text.clone());
        let all = |one: &Self| [&one.first_name, &one.last_name, &one.student_id].map(text);
        all(self) == all(other)
    }

    /// `["Ada", "Lampglow"]`, or a list of students.
    fn take_names(
        &mut self,
        key: &str,
        line: u32,
        items: &[Node],
        said: &mut Said,
        findings: &mut Vec<Finding>,
    ) {
        let message = format!("'{}': expected text, found a list", printable(key));
        let finding = Finding::warning("config_type", message).on_line(line);
        findings.push(finding.hint("write one name in double quotes"));
        if items.first().and_then(members_of).is_some() {
            return self.take_one_of(items, false, said, findings);
        }
        let names: Vec<String> = items.iter().filter_map(plain_text).collect();
        let is_word = |name: &String| !name.contains(char::is_whitespace);
        // Words are the parts of one name; of two texts, one word is a first or a last name.
        let is_one = names.iter().all(is_word) || (names.len() == 2 && names.iter().any(is_word));
        let mut add = |text: String| said.full.push(Word { key: key.to_owned(), text, line });
        match (is_one, &names[..]) {
            (_, []) => {}
            (true, [first, last]) => add(format!("{last}, {first}")),
            (true, words) => add(words.join(" ")),
            (false, several) => several.iter().cloned().for_each(add),
        }
    }

    fn take_renders(&mut self, list: &Node, findings: &mut Vec<Finding>) {
        if !matches!(list.value, Value::List(_)) {
            let message =
                format!("expected a list of renders [ ... ], found {}", list.value.kind());
            findings.push(
                Finding::warning("config_renders", message).on_line(list.line).hint(RENDER_HINT),
            );
        }
        let named;
        let items: &[Node] = match &list.value {
            Value::List(items) => items,
            Value::Object(members) if path_of(members).is_none() => {
                // Scenes as keys, paths as values.
                named = members.iter().map(|(.., node)| node.clone()).collect::<Vec<_>>();
                &named
            }
            Value::Text(_) | Value::Object(_) => std::slice::from_ref(list),
            _ => return,
        };
        if items.len() > MAX_RENDERS {
            let message = format!("expected a few renders, found {}", items.len());
            findings.push(
                Finding::warning("config_renders", message)
                    .on_line(list.line)
                    .hint("list each image once"),
            );
        }
        for item in items.iter().take(MAX_RENDERS) {
            let (scene, render) = match &item.value {
                Value::Text(path) => (String::new(), Some((path.clone(), item.line))),
                Value::Object(members) => {
                    let scene = text_of(members, &["scene", "name", "title"]);
                    (scene.map(|(text, _)| text).unwrap_or_default(), path_of(members))
                }
                // `["Teapot", "offline/teapot.exr"]`
                Value::List(pair) => {
                    let mut texts = pair.iter().filter_map(|node| match &node.value {
                        Value::Text(text) => Some((text.clone(), node.line)),
                        _ => None,
                    });
                    let is_path = |(text, _): &(String, u32)| text.to_lowercase().ends_with(".exr");
                    (String::new(), texts.rfind(is_path))
                }
                _ => (String::new(), None),
            };
            match render {
                Some((render, line)) => self.renders.push(ListedRender { scene, render, line }),
                None => findings.push(
                    Finding::warning("config_renders", "a render without a path")
                        .on_line(item.line)
                        .hint(RENDER_HINT),
                ),
            }
        }
    }
}

/// The text of a member with one of these names, and its line.
fn text_of(members: &[(String, u32, Node)], names: &[&str]) -> Option<(String, u32)> {
    members.iter().find_map(|(key, _, node)| match &node.value {
        Value::Text(text) if names.contains(&key.to_lowercase().as_str()) => {
            Some((text.clone(), node.line))
        }
        _ => None,
    })
}

/// The path in an entry of the list of renders.
fn path_of(members: &[(String, u32, Node)]) -> Option<(String, u32)> {
    text_of(members, &["render", "path", "file", "image", "filename", "exr"])
}

/// The members of an object, also of one that is alone in a list.
fn members_of(node: &Node) -> Option<&[(String, u32, Node)]> {
    match &node.value {
        Value::Object(members) => Some(members),
        Value::List(items) => match &items[..] {
            [only] => members_of(only),
            _ => None,
        },
        _ => None,
    }
}

/// A text or number, also one that is alone in a list or an object; empty for null.
fn plain_text(node: &Node) -> Option<String> {
    match &node.value {
        Value::Text(text) | Value::Number(text) => Some(text.trim().to_owned()),
        Value::Null => Some(String::new()),
        Value::List(items) => match &items[..] {
            [only] => plain_text(only),
            _ => None,
        },
        Value::Object(members) => match &members[..] {
            [(.., only)] => plain_text(only),
            _ => None,
        },
        Value::Bool(_) => None,
    }
}

/// Renders that are read; an assignment has under ten.
const MAX_RENDERS: usize = 100;

const RENDER_HINT: &str =
    r#"write { "scene": "Teapot, offline", "render": "offline/teapot_simple_offline.exr" }"#;

/// Takes a student number. Several are kept together, so that none of them counts.
fn take_number(
    said: &mut Vec<Word>,
    key: &str,
    line: u32,
    node: &Node,
    findings: &mut Vec<Finding>,
) {
    let before = said.len();
    take(said, key, line, node, findings);
    let items: Vec<&Node> = match &node.value {
        Value::List(items) if said.len() == before => items.iter().collect(),
        Value::Object(members) if said.len() == before => {
            members.iter().map(|(.., node)| node).collect()
        }
        _ => return,
    };
    let mut texts: Vec<String> = items.into_iter().filter_map(plain_text).collect();
    texts.dedup();
    if !texts.is_empty() {
        said.push(Word { key: key.to_owned(), text: texts.join(", "), line });
    }
}

/// Takes a text or a number.
fn take(said: &mut Vec<Word>, key: &str, line: u32, node: &Node, findings: &mut Vec<Finding>) {
    if !matches!(node.value, Value::Text(_) | Value::Number(_) | Value::Null) {
        let message = format!("'{}': expected text, found {}", printable(key), node.value.kind());
        findings.push(
            Finding::warning("config_type", message)
                .on_line(node.line)
                .hint("write it in double quotes"),
        );
    }
    if let Some(text) = plain_text(node) {
        said.push(Word { key: key.to_owned(), text, line });
    }
}

#[cfg(test)]
mod tests;
