//! The `config.json` of a submission: credentials and the list of renders, read tolerantly.

mod keys;
mod numbers;

use serde::{Deserialize, Serialize};

use super::finding::Finding;
use super::json_lines::{Node, Read, Value, parse};
use super::tree::CONFIG_FILE;
use crate::harmless::printable;

use keys::{Key, known_key};
pub(super) use numbers::why_no_number;
use numbers::{is_digits, number_in};

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
        let Read { node, stopped, text, mut findings } = parse(bytes);
        let mut config = Self::default();
        match node {
            Some(Node { value: Value::Object(members), .. }) => {
                config.take_members(&members, true, &mut findings);
            }
            Some(node) => {
                let message = format!("expected an object {{ ... }}, found {}", node.value.kind());
                findings.push(
                    Finding::warning("config_shape", message)
                        .on_line(node.line)
                        .hint("start from the template's config.json"),
                );
                if let Value::List(items) = &node.value {
                    config.take_one_of(items, true, &mut findings);
                }
            }
            None => {}
        }
        if config.student_id.is_none() || (stopped && config.first_name.is_none()) {
            config.salvage(&text);
        }
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
                Key::First => take(&mut self.first_name, key, *line, node, findings),
                Key::Last => take(&mut self.last_name, key, *line, node, findings),
                Key::Full if is_number => {
                    take_number(&mut self.student_id, key, *line, node, findings)
                }
                Key::Id => take_number(&mut self.student_id, key, *line, node, findings),
                Key::Email => take(&mut self.email, key, *line, node, findings),
                Key::Full => match (&node.value, members_of(node)) {
                    (_, Some(members)) if is_top => self.take_members(members, false, findings),
                    (Value::List(items), _) => self.take_names(key, *line, items, findings),
                    _ => self.take_full_name(key, *line, node, findings),
                },
                Key::Renders if is_top => {
                    self.has_renders = true;
                    self.take_renders(node, findings);
                }
                Key::Renders => {}
            }
        }
        // Whatever else an object is called, it may hold what is still missing.
        for (key, _, node) in members.iter().filter(|_| is_top) {
            if let Some(members) = members_of(node).filter(|_| known_key(key).is_none()) {
                let mut inner = Self::default();
                inner.take_members(members, false, findings);
                let fill = |own: &mut Option<Field>, inner| *own = own.take().or(inner);
                fill(&mut self.first_name, inner.first_name);
                fill(&mut self.last_name, inner.last_name);
                fill(&mut self.student_id, inner.student_id);
                fill(&mut self.email, inner.email);
            }
        }
    }

    /// What lines say that no reader of JSON could make out: a known key, a sign and a value.
    fn salvage(&mut self, text: &str) {
        for (index, line) in text.lines().enumerate() {
            for pair in line.split([',', ';', '{', '}']) {
                let Some((key, value)) = pair.split_once([':', '=', '\t']) else { continue };
                let plain = |text: &str| {
                    let sign = |c: char| !c.is_alphanumeric();
                    text.trim_matches(sign).to_owned()
                };
                let (key, value) = (plain(key), plain(value));
                let slot = match known_key(&key) {
                    Some((Key::First, _)) => &mut self.first_name,
                    Some((Key::Last, _)) => &mut self.last_name,
                    Some((Key::Id, _)) => &mut self.student_id,
                    Some((Key::Full, _)) if self.first_name.is_none() => {
                        let line = index as u32 + 1;
                        self.set_full_name(&Field { text: value, line });
                        continue;
                    }
                    _ => continue,
                };
                if slot.is_none() && !value.is_empty() {
                    *slot = Some(Field { text: value, line: index as u32 + 1 });
                }
            }
        }
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
    fn take_one_of(&mut self, items: &[Node], is_top: bool, findings: &mut Vec<Finding>) {
        let mut students: Vec<Self> = Vec::new();
        for members in items.iter().filter_map(members_of) {
            let mut student = Self::default();
            student.take_members(members, is_top, findings);
            let is_known = students.iter().any(|other| other.names_same(&student));
            if !is_known && student.names_somebody() {
                students.push(student);
            }
        }
        match &students[..] {
            [] | [_] => {
                if let Some(members) = items.iter().filter_map(members_of).next() {
                    self.take_members(members, is_top, &mut Vec::new());
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
                let numbers = students.iter().filter_map(|one| text(&one.student_id));
                let line = first.student_id.as_ref().map_or(1, |field| field.line);
                self.student_id =
                    Some(Field { text: numbers.collect::<Vec<_>>().join(", "), line });
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
    fn take_names(&mut self, key: &str, line: u32, items: &[Node], findings: &mut Vec<Finding>) {
        let message = format!("'{}': expected text, found a list", printable(key));
        let finding = Finding::warning("config_type", message).on_line(line);
        findings.push(finding.hint("write one name in double quotes"));
        if items.first().and_then(members_of).is_some() {
            return self.take_one_of(items, false, findings);
        }
        let names: Vec<String> = items.iter().filter_map(plain_text).collect();
        let is_word = |name: &String| !name.contains(char::is_whitespace);
        let text = if names.iter().all(is_word) { names.join(" ") } else { names[0].clone() };
        if !text.is_empty() {
            self.set_full_name(&Field { text, line });
        }
    }

    fn take_full_name(&mut self, key: &str, line: u32, node: &Node, findings: &mut Vec<Finding>) {
        let mut full = None;
        take(&mut full, key, line, node, findings);
        if let Some(full) = full {
            self.set_full_name(&full);
        }
    }

    /// `Ada King Lampglow`: the last word is the last name; `Lampglow, Ada` says so itself. `ada_lampglow` is
    /// how archives are named.
    fn set_full_name(&mut self, Field { text, line }: &Field) {
        // `Ada Lampglow <ada@example.org>`
        let text = text.split_once('<').map_or(text.as_str(), |(name, _)| name.trim());
        let sign = |c: char| c.is_whitespace() || (c == '_' && !text.contains(char::is_whitespace));
        let (first, last) = match text.split_once(',') {
            Some((last, first)) => (first, last),
            None => text.rsplit_once(sign).unwrap_or((text, "")),
        };
        let field = |text: &str| Field { text: text.trim().to_owned(), line: *line };
        self.first_name.get_or_insert(field(first));
        if !last.is_empty() {
            self.last_name.get_or_insert(field(last));
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
    slot: &mut Option<Field>,
    key: &str,
    line: u32,
    node: &Node,
    findings: &mut Vec<Finding>,
) {
    let mut own = None;
    take(&mut own, key, line, node, findings);
    let several = |items: Vec<&Node>| {
        let mut texts: Vec<String> = items.into_iter().filter_map(plain_text).collect();
        texts.dedup();
        (!texts.is_empty()).then(|| Field { text: texts.join(", "), line })
    };
    let own = own.or_else(|| match &node.value {
        Value::List(items) => several(items.iter().collect()),
        Value::Object(members) => several(members.iter().map(|(.., node)| node).collect()),
        _ => None,
    });
    let Some(own) = own else { return };
    match slot {
        Some(first) if first.text.is_empty() => *slot = Some(own),
        Some(first) if own.text.is_empty() || is_same_number(&first.text, &own.text) => {}
        Some(first) => {
            let message = format!(
                "'{}' says something else than line {}: neither counts",
                printable(key),
                first.line
            );
            first.text = format!("{}, {}", first.text, own.text);
            let finding = Finding::warning("config_twice", message).on_line(line);
            findings.push(finding.hint("keep one of them"));
        }
        None => *slot = Some(own),
    }
}

fn is_same_number(one: &str, other: &str) -> bool {
    one == other || number_in(one).is_some_and(|number| number_in(other) == Some(number))
}

/// Takes a text or a number.
fn take(slot: &mut Option<Field>, key: &str, line: u32, node: &Node, findings: &mut Vec<Finding>) {
    if !matches!(node.value, Value::Text(_) | Value::Number(_) | Value::Null) {
        let message = format!("'{}': expected text, found {}", printable(key), node.value.kind());
        findings.push(
            Finding::warning("config_type", message)
                .on_line(node.line)
                .hint("write it in double quotes"),
        );
    }
    let Some(text) = plain_text(node) else { return };
    if let Some(first) = slot
        && first.text != text
    {
        let message = format!(
            "'{}' says something else than line {}, which counts",
            printable(key),
            first.line
        );
        findings
            .push(Finding::warning("config_twice", message).on_line(line).hint("keep one of them"));
        return;
    }
    *slot = Some(Field { text, line });
}

#[cfg(test)]
mod tests;
