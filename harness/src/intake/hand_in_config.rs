//! The `config.json` of a hand-in: credentials and the list of renders, read tolerantly.

use serde::{Deserialize, Serialize};

use super::finding::{Finding, printable};
use super::json_lines::{Node, Value, parse};
use super::tree::CONFIG_FILE;

/// What the hand-in's `config.json` says; absent where it does not say it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct HandInConfig {
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

impl HandInConfig {
    /// Reads a `config.json`. The findings name `config.json`, line and hint.
    pub fn parse(bytes: &[u8]) -> (Self, Vec<Finding>) {
        let (node, mut findings) = parse(bytes);
        let mut config = Self::default();
        if let Some(node) = node {
            if matches!(node.value, Value::Object(_)) {
                config.take_members(&node, true, &mut findings);
            } else {
                let message = format!("expected an object {{ ... }}, found {}", node.value.kind());
                findings.push(
                    Finding::error("config_shape", message)
                        .on_line(node.line)
                        .hint("start from the template's config.json"),
                );
            }
        }
        for finding in &mut findings {
            finding.path = Some(CONFIG_FILE.to_owned());
        }
        (config, findings)
    }

    /// The seed of every sampler that draws the hand-in's own images.
    pub fn sampler_seed(&self) -> Option<u64> {
        self.student_id.as_ref()?.text.parse().ok()
    }

    fn take_members(&mut self, object: &Node, is_top: bool, findings: &mut Vec<Finding>) {
        let Value::Object(members) = &object.value else {
            return;
        };
        for (key, line, node) in members {
            // `studentID`, `student_id` and `Student-Id` are one key.
            let plain: String =
                key.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
            match plain.as_str() {
                "firstname" | "first" | "givenname" => {
                    take(&mut self.first_name, key, *line, node, findings)
                }
                "lastname" | "last" | "surname" | "familyname" => {
                    take(&mut self.last_name, key, *line, node, findings)
                }
                "studentid" | "id" | "studentnumber" | "mcgillid" => {
                    take(&mut self.student_id, key, *line, node, findings)
                }
                "email" | "mail" => take(&mut self.email, key, *line, node, findings),
                "name" | "fullname" => self.take_full_name(key, *line, node, findings),
                "student" | "credentials" | "author" if is_top => match &node.value {
                    Value::Object(_) => self.take_members(node, false, findings),
                    _ => self.take_full_name(key, *line, node, findings),
                },
                "renders" | "render" | "images" if is_top => {
                    self.has_renders = true;
                    self.take_renders(node, findings);
                }
                _ => {}
            }
        }
    }

    /// `"name": "Ada King Lovelace"`: the last word is the last name.
    fn take_full_name(&mut self, key: &str, line: u32, node: &Node, findings: &mut Vec<Finding>) {
        let mut full = None;
        take(&mut full, key, line, node, findings);
        let Some(Field { text, line }) = full else {
            return;
        };
        let (first, last) = text.rsplit_once(char::is_whitespace).unwrap_or((&text, ""));
        let field = |text: &str| Field { text: text.trim().to_owned(), line };
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
                Finding::error("config_renders", message).on_line(list.line).hint(RENDER_HINT),
            );
            return;
        };
        if items.len() > MAX_RENDERS {
            let message = format!("expected a few renders, found {}", items.len());
            findings.push(
                Finding::error("config_renders", message)
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
                    Finding::error("config_renders", "a render without a path")
                        .on_line(item.line)
                        .hint(RENDER_HINT),
                ),
            }
        }
    }
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
                Finding::error("config_type", message)
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
            .push(Finding::error("config_twice", message).on_line(line).hint("keep one of them"));
        return;
    }
    *slot = Some(Field { text, line });
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str) -> (String, String, Option<u64>) {
        let (config, findings) = HandInConfig::parse(text.as_bytes());
        assert_eq!(findings, [], "{text}");
        let text = |f: &Option<Field>| f.as_ref().map(|f| f.text.clone()).unwrap_or_default();
        (text(&config.first_name), text(&config.last_name), config.sampler_seed())
    }

    #[test]
    fn reads_every_common_form() {
        let ada = ("Ada".to_owned(), "Lovelace".to_owned(), Some(260_123_456));
        for text in [
            r#"{"firstName": "Ada", "lastName": "Lovelace", "studentID": "260123456"}"#,
            r#"{"first_name": " Ada ", "last_name": "Lovelace", "student_id": 260123456}"#,
            r#"{"name": "Ada Lovelace", "id": 260123456, "email": "a@b.c"}"#,
            r#"{"student": {"firstName": "Ada", "lastName": "Lovelace", "id": "260123456"}, "renders": []}"#,
        ] {
            assert_eq!(names(text), ada, "{text}");
        }
        assert_eq!(names(r#"{"id": "18446744073709551615"}"#).2, Some(u64::MAX));
        assert_eq!(names(r#"{"id": "18446744073709551616"}"#).2, None);
    }

    #[test]
    fn reads_renders_with_lines() {
        let (config, findings) = HandInConfig::parse(
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
        let (config, findings) = HandInConfig::parse(text.as_bytes());
        assert_eq!((config.renders.len(), findings.len()), (100, 1));
    }

    #[test]
    fn two_answers_are_not_one() {
        let (_, findings) = HandInConfig::parse(b"{\"id\": 1,\n\"studentID\": 2}");
        assert_eq!((findings[0].code.as_str(), findings[0].line), ("config_twice", Some(2)));
    }
}
