//! Everything that a `config.json` says of whose it is, and what of it counts.

use super::super::finding::Finding;
use super::numbers::number_in;
use super::{Field, SubmittedConfig};
use crate::harmless::printable;

/// Something that the file says, with the key it stands behind.
#[derive(Clone, Debug)]
pub(super) struct Word {
    pub(super) key: String,
    pub(super) text: String,
    /// From 1.
    pub(super) line: u32,
}

/// All that the file says, in its order.
#[derive(Clone, Debug, Default)]
pub(super) struct Said {
    pub(super) first: Vec<Word>,
    pub(super) last: Vec<Word>,
    /// Names in one text. First and last names by themselves count before them.
    pub(super) full: Vec<Word>,
    pub(super) id: Vec<Word>,
    pub(super) email: Vec<Word>,
}

impl Said {
    /// Takes from another what is not said here.
    pub(super) fn fill_from(&mut self, other: Self) {
        if self.first.is_empty() && self.last.is_empty() && self.full.is_empty() {
            (self.first, self.last, self.full) = (other.first, other.last, other.full);
        }
        let pairs = [(&mut self.id, other.id), (&mut self.email, other.email)];
        for (own, other) in pairs.into_iter().filter(|(own, _)| own.is_empty()) {
            *own = other;
        }
    }

    pub(super) fn append(&mut self, other: Self) {
        self.first.extend(other.first);
        self.last.extend(other.last);
        self.full.extend(other.full);
        self.id.extend(other.id);
        self.email.extend(other.email);
    }

    /// Settles what counts. Of names or numbers that differ none does: which is right is not for us to guess.
    pub(super) fn settle(self, config: &mut SubmittedConfig, findings: &mut Vec<Finding>) {
        let mut disputed = Vec::new();
        let mut name = |words: &[Word], key: &str| {
            let different = different(words, same_name);
            if different.len() > 1 {
                findings.push(contradiction(&different));
                disputed.push(key.to_owned());
                return None;
            }
            different.first().map(|word| Field { text: word.text.clone(), line: word.line })
        };
        config.first_name = name(&self.first, "firstName");
        config.last_name = name(&self.last, "lastName");
        if self.first.is_empty() || self.last.is_empty() {
            let is_disputed = different(&self.full, same_name).len() > 1;
            if let Some(full) = name(&self.full, "firstName") {
                let (first, last) = parts_of(&full);
                if self.first.is_empty() {
                    config.first_name = Some(first);
                }
                if self.last.is_empty() {
                    config.last_name = last;
                }
            } else if is_disputed {
                disputed.push("lastName".to_owned());
            }
        }
        let email = self.email.into_iter().next();
        config.email = email.map(|word| Field { text: word.text, line: word.line });
        let numbers = different(&self.id, is_same_number);
        if numbers.len() > 1 {
            findings.push(contradiction(&numbers));
        }
        let texts: Vec<&str> = numbers.iter().map(|word| word.text.as_str()).collect();
        config.student_id =
            numbers.first().map(|word| Field { text: texts.join(", "), line: word.line });
        config.disputed = disputed;
    }
}

/// The words that differ from all before them. An empty one says nothing where there is another.
fn different(words: &[Word], is_same: impl Fn(&str, &str) -> bool) -> Vec<&Word> {
    let mut found: Vec<&Word> = Vec::new();
    for word in words.iter().filter(|word| !word.text.is_empty()) {
        if !found.iter().any(|other| is_same(&other.text, &word.text)) {
            found.push(word);
        }
    }
    if found.is_empty() {
        found.extend(words.first());
    }
    found
}

fn contradiction(different: &[&Word]) -> Finding {
    let [first, .., last] = different else { unreachable!("two words or more") };
    let said = |word: &Word| printable(&word.text);
    let message = if first.line == last.line {
        format!(
            "'{}' is '{}' and also '{}': neither counts",
            printable(&last.key),
            said(first),
            said(last)
        )
    } else {
        format!(
            "'{}' is '{}', but '{}' on line {}: neither counts",
            printable(&last.key),
            said(last),
            said(first),
            first.line
        )
    };
    Finding::warning("config_twice", message).on_line(last.line).hint("keep one of them")
}

fn same_name(one: &str, other: &str) -> bool {
    let words = |text: &str| {
        let words = text.split_whitespace().map(str::to_lowercase);
        words.collect::<Vec<_>>()
    };
    words(one) == words(other)
}

pub(super) fn is_same_number(one: &str, other: &str) -> bool {
    one == other || number_in(one).is_some_and(|number| number_in(other) == Some(number))
}

/// `Ada King Lampglow`: the last word is the last name; `Lampglow, Ada` says so itself. `ada_lampglow` is
/// how archives are named.
fn parts_of(Field { text, line }: &Field) -> (Field, Option<Field>) {
    // `Ada Lampglow <ada@example.org>`
    let text = text.split_once('<').map_or(text.as_str(), |(name, _)| name.trim());
    let sign = |c: char| c.is_whitespace() || (c == '_' && !text.contains(char::is_whitespace));
    let (first, last) = match text.split_once(',') {
        Some((last, first)) => (first, last),
        None => text.rsplit_once(sign).unwrap_or((text, "")),
    };
    let field = |text: &str| Field { text: text.trim().to_owned(), line: *line };
    (field(first), (!last.is_empty()).then(|| field(last)))
}
