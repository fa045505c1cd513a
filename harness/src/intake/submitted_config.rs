//! The `config.json` of a submission: credentials and the list of renders, read tolerantly.

use serde::{Deserialize, Serialize};

use super::finding::Finding;
use super::json_lines::{Node, Read, Value, parse};
use super::tree::CONFIG_FILE;
use crate::harmless::printable;

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
                if let Value::List(items) = &node.value
                    && let Some(Value::Object(members)) = items.first().map(|item| &item.value)
                {
                    config.take_members(members, true, &mut findings);
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
            match known {
                Key::First => take(&mut self.first_name, key, *line, node, findings),
                Key::Last => take(&mut self.last_name, key, *line, node, findings),
                Key::Id => take(&mut self.student_id, key, *line, node, findings),
                Key::Email => take(&mut self.email, key, *line, node, findings),
                Key::Full => match &node.value {
                    Value::Object(members) if is_top => {
                        self.take_members(members, false, findings);
                    }
                    _ => self.take_full_name(key, *line, node, findings),
                },
                Key::Renders if is_top => {
                    self.has_renders = true;
                    self.take_renders(node, findings);
                }
                Key::Renders => {}
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

    /// A student number in groups, such as `260 123-456`, without what is between them.
    fn tidy_number(&mut self, findings: &mut Vec<Finding>) {
        let Some(field) = &mut self.student_id else { return };
        let between = |c: char| {
            c.is_whitespace()
                || "-_,'".contains(c)
                || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2060}' | '\u{feff}')
        };
        let text =
            field.text.trim_start_matches('#').trim_matches(|c: char| between(c) && c != '-');
        let digits: String = text.chars().filter(|c| !between(*c)).collect();
        let is_number = !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit());
        if !is_number || digits == field.text || text.starts_with('-') {
            return;
        }
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
        let sign = |c: char| c.is_whitespace() || (c == '_' && !text.contains(char::is_whitespace));
        let (first, last) = match text.split_once(',') {
            Some((last, first)) => (first, last),
            None => text.rsplit_once(sign).unwrap_or((text.as_str(), "")),
        };
        let field = |text: &str| Field { text: text.trim().to_owned(), line: *line };
        self.first_name.get_or_insert(field(first));
        if !last.is_empty() {
            self.last_name.get_or_insert(field(last));
        }
    }

    fn take_renders(&mut self, list: &Node, findings: &mut Vec<Finding>) {
        let Value::List(items) = &list.value else {
            let message =
                format!("expected a list of renders [ ... ], found {}", list.value.kind());
            findings.push(
                Finding::warning("config_renders", message).on_line(list.line).hint(RENDER_HINT),
            );
            return;
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
                    let text = |names: &[&str]| {
                        members.iter().find_map(|(key, _, node)| match &node.value {
                            Value::Text(text) if names.contains(&key.to_lowercase().as_str()) => {
                                Some((text.clone(), node.line))
                            }
                            _ => None,
                        })
                    };
                    let scene =
                        text(&["scene", "name", "title"]).map(|(text, _)| text).unwrap_or_default();
                    (scene, text(&["render", "path", "file", "image"]))
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

/// A key that means something here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    First,
    Last,
    Full,
    Id,
    Email,
    Renders,
}

impl Key {
    /// As the template writes it.
    fn written(self) -> &'static str {
        match self {
            Self::First => "firstName",
            Self::Last => "lastName",
            Self::Full => "firstlast",
            Self::Id => "studentID",
            Self::Email => "email",
            Self::Renders => "renders",
        }
    }
}

/// What keys are called, in lower case without signs: the template's names, those of other years (`firstlast`)
/// and what students write.
const KEYS: [(Key, &[&str]); 6] = [
    (Key::First, &["firstname", "first", "givenname", "forename", "fname", "prenom"]),
    (Key::Last, &["lastname", "last", "surname", "familyname", "lname", "nom"]),
    (
        Key::Full,
        &[
            "firstlast",
            "name",
            "fullname",
            "studentname",
            "yourname",
            "firstlastname",
            "student",
            "credentials",
            "author",
            "user",
        ],
    ),
    (
        Key::Id,
        &[
            "studentid",
            "id",
            "studentnumber",
            "mcgillid",
            "studentno",
            "studentnr",
            "number",
            "sid",
            "idnumber",
            "studentidnumber",
            "matricule",
        ],
    ),
    (Key::Email, &["email", "mail", "emailaddress"]),
    (Key::Renders, &["renders", "render", "images"]),
];

/// What a key means, and whether it is a slip of the pen: `studentID`, `student_id` and `Student-Id` are one
/// key, `studnetID` is one that nearly is.
fn known_key(key: &str) -> Option<(Key, bool)> {
    /// Shorter names are too near to each other.
    const LONG: usize = 7;
    let plain: String =
        key.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    let names = || KEYS.iter().flat_map(|(key, names)| names.iter().map(move |name| (*key, *name)));
    if let Some((key, _)) = names().find(|(_, name)| *name == plain) {
        return Some((key, false));
    }
    // Distances of endless keys are endless work.
    if !(LONG - 1..=24).contains(&plain.len()) {
        return None;
    }
    let long = names().filter(|(_, name)| name.len() >= LONG);
    let near = long.map(|(key, name)| (strsim::osa_distance(&plain, name), key));
    let (distance, key) = near.min_by_key(|(distance, _)| *distance)?;
    // `username` is two letters from `surname`.
    (distance <= 1 || distance == 2 && plain.len() > LONG + 1).then_some((key, true))
}

/// Renders that are read; an assignment has under ten.
const MAX_RENDERS: usize = 100;

const RENDER_HINT: &str =
    r#"write { "scene": "Teapot, offline", "render": "offline/teapot_simple_offline.exr" }"#;

/// Takes a text or a number.
fn take(slot: &mut Option<Field>, key: &str, line: u32, node: &Node, findings: &mut Vec<Finding>) {
    let text = match &node.value {
        Value::Text(text) | Value::Number(text) => text.trim().to_owned(),
        Value::Null => String::new(),
        other => {
            let message = format!("'{}': expected text, found {}", printable(key), other.kind());
            findings.push(
                Finding::warning("config_type", message)
                    .on_line(node.line)
                    .hint("write it in double quotes"),
            );
            return;
        }
    };
    if let Some(first) = slot
        && first.text != text
    {
        let message = format!("'{}' says something else than line {}", printable(key), first.line);
        findings
            .push(Finding::warning("config_twice", message).on_line(line).hint("keep one of them"));
        return;
    }
    *slot = Some(Field { text, line });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> (String, String, Option<u64>) {
        let (config, findings, _) = SubmittedConfig::parse(text.as_bytes());
        for finding in findings {
            assert_eq!(finding.severity, crate::intake::Severity::Warning, "{finding}");
        }
        let text = |f: &Option<Field>| f.as_ref().map(|f| f.text.clone()).unwrap_or_default();
        (text(&config.first_name), text(&config.last_name), config.sampler_seed())
    }

    fn codes(text: &str) -> Vec<String> {
        let code = |f: &Finding| format!("{}@{}", f.code, f.line.unwrap_or(0));
        SubmittedConfig::parse(text.as_bytes()).1.iter().map(code).collect()
    }

    #[test]
    fn reads_every_common_form() {
        let ada = ("Ada".to_owned(), "Lampglow".to_owned(), Some(260_123_456));
        for text in [
            r#"{"firstName": "Ada", "lastName": "Lampglow", "studentID": "260123456"}"#,
            r#"{"first_name": " Ada ", "last_name": "Lampglow", "student_id": 260123456}"#,
            r#"{"name": "Ada Lampglow", "id": 260123456, "email": "a@b.c"}"#,
            r#"{"firstlast": "Ada Lampglow", "studentID": 260123456}"#,
            r#"{"firstlast": "Ada_Lampglow", "studentID": 260123456}"#,
            r#"{"fullName": "Lampglow, Ada", "Student Number": "260123456"}"#,
            r#"{"student": {"firstName": "Ada", "lastName": "Lampglow", "id": "260123456"}, "renders": []}"#,
        ] {
            assert_eq!(names(text), ada, "{text}");
            assert_eq!(codes(text), [""; 0], "{text}");
        }
        assert_eq!(names(r#"{"id": "18446744073709551615"}"#).2, Some(u64::MAX));
        assert_eq!(names(r#"{"id": "18446744073709551616"}"#).2, None);
    }

    #[test]
    fn slips_are_warnings_and_who_it_is_is_known() {
        let ada = ("Ada".to_owned(), "Lampglow".to_owned(), Some(260_123_456));
        let config = |id: &str| {
            format!(
                "{{\n\"firstName\": \"Ada\",\n\"lastName\": \"Lampglow\",\n\"studentID\": {id}\n}}"
            )
        };
        for id in [
            "\"260 123 456\"",
            "\"260-123-456\"",
            "\" 260\u{a0}123\u{a0}456\"",
            "260 123 456",
            "260-123-456",
            "\"#260123456\"",
            "\"260,123,456\"",
            "\"260_123_456 \"",
        ] {
            assert_eq!(names(&config(id)), ada, "{id}");
            assert!(codes(&config(id)).contains(&"config_student_id@4".to_owned()), "{id}");
        }
        for (text, code) in [
            (
                r#"{"fristName": "Ada", "lastNmae": "Lampglow", "studnetID": 260123456}"#,
                "config_key@1",
            ),
            (
                r#"[{"firstName": "Ada", "lastName": "Lampglow", "id": 260123456}]"#,
                "config_shape@1",
            ),
            ("firstName: Ada\nlastName: Lampglow\nstudentID: 260123456\n", "json_syntax@1"),
            (
                "firstName = \"Ada\"\nlastName = \"Lampglow\"\nstudentID = 260123456\n",
                "json_syntax@1",
            ),
            (
                "{\"firstName\": \"Ada\", \"lastName\": \"Lampglow\"\n*\"studentID\": \"260123456\"",
                "json_syntax@2",
            ),
            ("{\"firstlast\": \"Ada Lampglow\",\n* \"studentID\": \"260123456\"}", "json_syntax@2"),
        ] {
            assert_eq!(names(text), ada, "{text}");
            assert!(codes(text).contains(&code.to_owned()), "{text}: {:?}", codes(text));
        }
        // Other keys are nobody's name.
        assert_eq!(
            codes(r#"{"scenes": 1, "comment": "x", "username": 2, "lastImage": 3}"#),
            [""; 0]
        );
    }

    #[test]
    fn reads_renders_with_lines() {
        let (config, findings, _) = SubmittedConfig::parse(
            b"{\"renders\": [\n{\"scene\": \"T\", \"render\": \"a.exr\"},\n\"b.exr\",\n{\"scene\": \"x\"}\n]}",
        );
        let listed: Vec<_> = config.renders.iter().map(|r| (r.render.as_str(), r.line)).collect();
        assert_eq!(listed, [("a.exr", 2), ("b.exr", 3)]);
        assert_eq!((findings[0].code.as_str(), findings[0].line), ("config_renders", Some(4)));
        assert_eq!(findings[0].path.as_deref(), Some("config.json"));
    }

    #[test]
    fn endless_lists_are_cut() {
        let text = format!("{{\"renders\": [{}\"a\"]}}", "\"a\",".repeat(5000));
        let (config, findings, _) = SubmittedConfig::parse(text.as_bytes());
        assert_eq!((config.renders.len(), findings.len()), (100, 1));
    }

    #[test]
    fn two_answers_are_not_one() {
        let (_, findings, _) = SubmittedConfig::parse(b"{\"id\": 1,\n\"studentID\": 2}");
        assert_eq!((findings[0].code.as_str(), findings[0].line), ("config_twice", Some(2)));
    }
}
