//! The class list: a CSV file that a learning platform exports, or one with the same few columns.

mod cells;
mod columns;

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use self::cells::{
    decode, delimiter, is_rounded, no_text, open_quote, separator, unwrapped, whole,
};
use self::columns::{Column, columns, kind, tells_students};
use super::layout::Platform;
use super::{names, stamps};
use crate::harmless::printable;

/// A class list.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Roster {
    /// The file.
    pub path: PathBuf,
    /// The platform that exports such a file.
    pub kind: Platform,
    /// The columns' names, as they are written.
    pub header: Vec<String>,
    /// All rows below the header, as they are written.
    pub rows: Vec<Vec<String>>,
    /// The students, in the order of the file.
    pub students: Vec<ListedStudent>,
    /// Rows that are no student, with their lines.
    #[serde(default)]
    pub left_out: Vec<String>,
    /// Times of submission that cannot be read, with their lines.
    #[serde(default)]
    pub unread_times: Vec<String>,
}

/// A student of a class list. A text is empty where the list does not say it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct ListedStudent {
    /// Line in the file, from 1.
    pub line: usize,
    /// Index of the row below the header.
    pub row: usize,
    /// Student number, without the sign that Brightspace puts before it.
    pub number: String,
    /// The platform's own number.
    pub id: String,
    /// Name of the account.
    pub username: String,
    /// First name, or the whole name where the list has one column for it.
    pub first_name: String,
    /// Last name.
    pub last_name: String,
    /// Address.
    pub email: String,
    /// When the platform says that something was submitted, as [`stamps::parse`] writes it.
    pub submitted: String,
    /// Whether the platform says that it is a draft, which the student has not submitted.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub draft: bool,
}

impl ListedStudent {
    /// `First Last`, or what there is of it.
    pub fn full_name(&self) -> String {
        format!("{} {}", self.first_name, self.last_name).trim().to_owned()
    }

    /// Name and number, for a message.
    pub fn who(&self) -> String {
        let key = [&self.number, &self.username, &self.id].into_iter().find(|key| !key.is_empty());
        match (self.full_name(), key) {
            (name, Some(key)) if !name.is_empty() => format!("{name} ({key})"),
            (name, None) => name,
            (_, Some(key)) => key.clone(),
        }
    }

    /// Whether an instructor's word means this student: number, account, or the platform's number.
    pub fn is_called(&self, word: &str) -> bool {
        let key = names::number(word);
        (!key.is_empty() && (key == names::number(&self.number) || key == self.id))
            || (!self.username.is_empty() && self.username.eq_ignore_ascii_case(word.trim()))
            || (!self.email.is_empty() && self.email.eq_ignore_ascii_case(word.trim()))
    }

    /// Takes what a column for whole names says, beside what those for first and last names say; `has_last` tells
    /// whether there is one for last names.
    fn take_name(&mut self, full: String, has_last: bool) {
        if self.last_name.is_empty() && !has_last && !self.first_name.is_empty() {
            // `Name, First name`: the whole name, or the last one.
            let (own, first) = (names::words(&full), names::words(&self.first_name));
            let is_whole = first.split(' ').all(|word| own.split(' ').any(|other| other == word));
            if is_whole {
                self.first_name = String::new();
            } else {
                self.last_name.clone_from(&full);
            }
        }
        if self.last_name.is_empty() && self.first_name.is_empty() {
            match full.split_once(',') {
                Some((last, first)) => {
                    (self.last_name, self.first_name) =
                        (last.trim().to_owned(), first.trim().to_owned());
                }
                None => self.first_name = full,
            }
        }
    }
}

/// How Moodle begins the status of a draft, in plain letters.
const DRAFTS: [&str; 6] = ["draft", "brouillon", "entwurf", "borrador", "bozza", "rascunho"];
/// Names of rows that sum up a list.
const SUMS: [&str; 12] = [
    "total",
    "totals",
    "sum",
    "count",
    "average",
    "mean",
    "median",
    "maximum",
    "minimum",
    "moyenne",
    "somme",
    "points possible",
];

/// Number of lines above a header that are looked through for a hint.
const MAX_TITLES: usize = 10;

impl Roster {
    /// Reads a class list.
    ///
    /// # Errors
    /// When it cannot be read, or has no column that tells students apart; names the file and line.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let bytes = std::fs::read(path)
            .with_context(|| format!("cannot read the class list {}", path.display()))?;
        Self::parse(&bytes, path)
    }

    /// Reads the text of a class list; `path` is its file's name.
    ///
    /// # Errors
    /// As [`Roster::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> anyhow::Result<Self> {
        let mut records = records(bytes, path)?.into_iter();
        let Some((line, header)) = records.next() else {
            bail!("{}: the class list is empty", path.display());
        };
        if !tells_students(&header) {
            return Err(no_header(line, &header, records, path));
        }
        let kind = kind(&header);
        let columns = columns(&header, kind);
        let path = path.to_owned();
        let mut roster = Self { path, kind, header, ..Self::default() };
        for (line, cells) in records {
            roster.add(line, cells, &columns)?;
        }
        if roster.students.is_empty() {
            bail!("{}: the class list names no student", roster.path.display());
        }
        roster.refuse_doubles()?;
        Ok(roster)
    }

    /// Adds a row with the student in it, if it has one.
    fn add(
        &mut self,
        line: usize,
        cells: Vec<String>,
        columns: &[Option<Column>],
    ) -> anyhow::Result<()> {
        let at = |column: Column| columns.iter().position(|own| *own == Some(column));
        let cell = |column: Column| {
            let cell = at(column).and_then(|at| cells.get(at));
            cell.map(|text| unwrapped(text.trim()).to_owned()).unwrap_or_default()
        };
        let unsigned = |text: String| text.trim_start_matches('#').to_owned();
        let number = unsigned(cell(Column::Number));
        if is_rounded(&number) {
            bail!(
                "{}:{line}: the student number is {number}: a spreadsheet rounded it, and its digits are lost; hint: \
                 export the list again, and do not open it in a spreadsheet, or only with that column as text",
                self.path.display()
            );
        }
        let status = names::plain(&cell(Column::Status));
        let (submitted, full) = (cell(Column::Submitted), cell(Column::Full));
        let mut student = ListedStudent {
            line,
            row: self.rows.len(),
            number: whole(&number).to_owned(),
            id: cell(Column::Id),
            username: unsigned(cell(Column::Username)),
            first_name: cell(Column::First),
            last_name: cell(Column::Last),
            email: cell(Column::Email),
            submitted: stamps::parse(&submitted).unwrap_or_default(),
            draft: DRAFTS.iter().any(|word| status.starts_with(word)),
        };
        self.rows.push(cells);
        if student.submitted.is_empty() && submitted.contains(|c: char| c.is_ascii_digit()) {
            self.unread_times.push(format!("line {line}, \"{}\"", printable(&submitted)));
        }
        // Canvas's rows of points and its made-up student.
        if self.kind == Platform::Canvas && (student.id.is_empty() || full == "Student, Test") {
            return Ok(());
        }
        let is_sum = SUMS.contains(&names::plain(&full).trim())
            || SUMS.contains(&names::plain(&student.full_name()).trim());
        let keys = [&student.number, &student.username, &student.email];
        if is_sum && keys.iter().all(|key| key.is_empty()) {
            let name = printable(&(student.full_name() + &full));
            self.left_out.push(format!("line {line}, {name}"));
            return Ok(());
        }
        student.take_name(full, at(Column::Last).is_some());
        match self.kind {
            // `Participant 123`
            Platform::Moodle => {
                student.id = student.id.chars().filter(char::is_ascii_digit).collect();
            }
            // The instructor's own identifier may be the number.
            Platform::Github if student.number.is_empty() => {
                student.number = std::mem::take(&mut student.id);
            }
            _ => {}
        }
        if !student.who().is_empty() {
            self.students.push(student);
        }
        Ok(())
    }

    /// Which columns were read, and which were not, in a sentence.
    pub fn reading(&self) -> String {
        let columns = columns(&self.header, self.kind);
        let of = |wanted: &[Option<Column>]| -> Vec<String> {
            let own = self.header.iter().zip(&columns);
            let own =
                own.filter(|(name, column)| wanted.contains(column) && !name.trim().is_empty());
            own.map(|(name, _)| format!("\"{}\"", printable(name.trim()))).collect()
        };
        let from = |what: &str, names: &[String]| match names {
            [] => format!("no {what}"),
            names => format!("{what} from {}", names.join(" and ")),
        };
        let (first, full) =
            (of(&[Some(Column::First), Some(Column::Last)]), of(&[Some(Column::Full)]));
        let has_last = columns.contains(&Some(Column::Last));
        let name = match (first.is_empty(), has_last) {
            (true, _) => full,
            (false, true) => first,
            (false, false) => [first, full].concat(),
        };
        let mut said = format!(
            "{}: {}, {}",
            self.path.display(),
            from("student number", &of(&[Some(Column::Number)])),
            from("name", &name)
        );
        let unused = of(&[None]);
        if !unused.is_empty() {
            said += &format!("; not used: {}", unused.join(", "));
        }
        if !self.left_out.is_empty() {
            said += &format!("; no student: {}", self.left_out.join(", "));
        }
        if !self.unread_times.is_empty() {
            said += &format!(
                "; a time that cannot be read, so nothing is known of lateness: {}",
                self.unread_times.join("; ")
            );
        }
        said
    }

    fn refuse_doubles(&self) -> anyhow::Result<()> {
        let mut seen = std::collections::HashMap::new();
        for student in &self.students {
            let number = names::number(&student.number);
            if number.is_empty() {
                continue;
            }
            if let Some(line) = seen.insert(number, student.line) {
                bail!(
                    "{}:{}: student number {} is there already, on line {line}",
                    self.path.display(),
                    student.line,
                    student.number
                );
            }
        }
        Ok(())
    }
}

/// The rows of a list as they are written, each with its line.
fn records(bytes: &[u8], path: &Path) -> anyhow::Result<Vec<(usize, Vec<String>)>> {
    if let Some(what) = no_text(bytes) {
        bail!(
            "{}: expected a CSV file, found {what}; hint: save it as CSV (UTF-8)",
            path.display()
        );
    }
    // With one kind of line end, so that lines are counted rightly.
    let mut text = decode(bytes).replace("\r\n", "\n").replace('\r', "\n");
    let mut delimiter = delimiter(&text);
    if let Some(sign) = separator(&text) {
        delimiter = sign;
        // Lines are counted as before.
        text = text[text.find('\n').unwrap_or(text.len())..].to_owned();
    }
    if let Some((line, end)) = open_quote(&text, delimiter) {
        let end = end.map_or("is not closed".to_owned(), |end| {
            format!("ends in the middle of a cell on line {end}")
        });
        bail!(
            "{}:{line}: the quote that opens here {end}, and swallows the lines between; hint: remove or close it",
            path.display()
        );
    }
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(delimiter)
        .flexible(true)
        .has_headers(false)
        .from_reader(text.as_bytes());
    let mut records = Vec::new();
    for record in reader.records() {
        let record = record.with_context(|| path.display().to_string())?;
        let line = record.position().map_or(0, |position| position.line() as usize);
        records.push((line, record.iter().map(str::to_owned).collect::<Vec<String>>()));
    }
    Ok(records)
}

/// What is wrong with a list whose first row tells no students apart; `rest` is what follows it.
fn no_header(
    line: usize,
    header: &[String],
    rest: impl Iterator<Item = (usize, Vec<String>)>,
    path: &Path,
) -> anyhow::Error {
    let found = header.iter().take(6).cloned().collect::<Vec<_>>().join(", ");
    let hint = match rest.take(MAX_TITLES).find(|(_, cells)| tells_students(cells)) {
        Some((line, _)) => format!("line {line} looks like the header: delete what is above it"),
        None => "export the class list or the grade book from your learning platform".to_owned(),
    };
    anyhow!(
        "{}:{line}: expected a header with a column of student numbers or names, such as OrgDefinedId, \
         SIS User ID, ID number, SID, Student or Full name; found {}; hint: {hint}",
        path.display(),
        printable(&found)
    )
}

#[cfg(test)]
mod tests;
