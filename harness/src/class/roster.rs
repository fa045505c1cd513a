//! The class list: a CSV file that a learning platform exports, or one with the same few columns.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::layout::Kind;
use super::{names, stamps};

/// A class list.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Roster {
    /// The file.
    pub path: PathBuf,
    /// The platform that exports such a file.
    pub kind: Kind,
    /// The columns' names, as they are written.
    pub header: Vec<String>,
    /// All rows below the header, as they are written.
    pub rows: Vec<Vec<String>>,
    /// The students, in the order of the file.
    pub students: Vec<Student>,
}

/// A student of a class list. A text is empty where the list does not say it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
#[schemars(rename = "ListedStudent")]
pub struct Student {
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
}

impl Student {
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
}

/// What columns are called, without accents, signs and case, and what they hold.
const COLUMNS: [(Column, &[&str]); 8] = [
    (
        Column::Number,
        &[
            "orgdefinedid",
            "sisuserid",
            "idnumber",
            "sid",
            "studentid",
            "studentnumber",
            "number",
            "numero",
            "matricule",
        ],
    ),
    (Column::Id, &["id", "identifier", "githubid", "userid"]),
    (Column::Username, &["username", "sisloginid", "githubusername", "login", "user"]),
    (Column::First, &["firstname", "first", "givenname", "prenom"]),
    (Column::Last, &["lastname", "last", "surname", "familyname", "nom"]),
    (Column::Full, &["student", "fullname", "name", "studentname", "nomcomplet"]),
    (Column::Email, &["email", "emailaddress", "mail", "courriel"]),
    (Column::Submitted, &["lastmodifiedsubmission"]),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Column {
    Number,
    Id,
    Username,
    First,
    Last,
    Full,
    Email,
    Submitted,
}

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
        // As one line end, or lines would be counted wrongly.
        let text = decode(bytes).replace("\r\n", "\n").replace('\r', "\n");
        let delimiter = delimiter(&text);
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
        let mut records = records.into_iter();
        let Some((line, header)) = records.next() else {
            bail!("{}: the class list is empty", path.display());
        };
        let columns: Vec<Option<Column>> = header.iter().map(|name| column(name)).collect();
        let at = |column: Column| columns.iter().position(|own| *own == Some(column));
        let has = |column: Column| at(column).is_some();
        let named = has(Column::Full) || has(Column::Last);
        if !has(Column::Number) && !has(Column::Username) && !has(Column::Email) && !named {
            bail!(
                "{}:{line}: expected a header with a column of student numbers or names, such as OrgDefinedId, \
                 SIS User ID, ID number, SID, Student or Full name; found {}; hint: export the class list or the \
                 grade book from your learning platform",
                path.display(),
                header.iter().take(6).cloned().collect::<Vec<_>>().join(", ")
            );
        }
        let kind = kind(&header);
        let mut roster = Self {
            path: path.to_owned(),
            kind,
            header: header.clone(),
            rows: Vec::new(),
            students: Vec::new(),
        };
        for (line, cells) in records {
            let cell = |column: Column| {
                let cell = at(column).and_then(|at| cells.get(at));
                cell.map(|text| text.trim().to_owned()).unwrap_or_default()
            };
            let row = roster.rows.len();
            roster.rows.push(cells.clone());
            let unsigned = |text: String| text.trim_start_matches('#').to_owned();
            let mut student = Student {
                line,
                row,
                number: unsigned(cell(Column::Number)),
                id: cell(Column::Id),
                username: unsigned(cell(Column::Username)),
                first_name: cell(Column::First),
                last_name: cell(Column::Last),
                email: cell(Column::Email),
                submitted: stamps::parse(&cell(Column::Submitted)).unwrap_or_default(),
            };
            let full = cell(Column::Full);
            // Canvas's rows of points and its made-up student.
            if kind == Kind::Canvas && (student.id.is_empty() || full == "Student, Test") {
                continue;
            }
            if student.last_name.is_empty() && student.first_name.is_empty() {
                match full.split_once(',') {
                    Some((last, first)) => {
                        (student.last_name, student.first_name) =
                            (last.trim().to_owned(), first.trim().to_owned());
                    }
                    None => student.first_name = full,
                }
            }
            match kind {
                // `Participant 123`
                Kind::Moodle => {
                    student.id = student.id.chars().filter(char::is_ascii_digit).collect();
                }
                // The instructor's own identifier may be the number.
                Kind::Github if student.number.is_empty() => {
                    student.number = std::mem::take(&mut student.id);
                }
                _ => {}
            }
            if student.who().is_empty() {
                continue;
            }
            roster.students.push(student);
        }
        if roster.students.is_empty() {
            bail!("{}: the class list names no student", path.display());
        }
        roster.refuse_doubles()?;
        Ok(roster)
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

/// UTF-8 with or without its mark, UTF-16 with it, else Latin-1: as spreadsheets save.
fn decode(bytes: &[u8]) -> String {
    let wide = |read: fn([u8; 2]) -> u16| {
        let units: Vec<u16> =
            bytes[2..].as_chunks::<2>().0.iter().map(|pair| read(*pair)).collect();
        String::from_utf16_lossy(&units)
    };
    match bytes {
        [0xff, 0xfe, ..] => wide(u16::from_le_bytes),
        [0xfe, 0xff, ..] => wide(u16::from_be_bytes),
        _ => match std::str::from_utf8(bytes) {
            Ok(text) => text.trim_start_matches('\u{feff}').to_owned(),
            Err(_) => bytes.iter().map(|byte| char::from(*byte)).collect(),
        },
    }
}

/// The sign that stands between the columns of the first line.
fn delimiter(text: &str) -> u8 {
    let head = text.lines().next().unwrap_or_default();
    let count = |sign: &u8| head.bytes().filter(|byte| byte == sign).count();
    [b',', b';', b'\t'].into_iter().rev().max_by_key(count).unwrap_or(b',')
}

fn column(name: &str) -> Option<Column> {
    let name = names::letters(name);
    COLUMNS.iter().find(|(_, known)| known.contains(&name.as_str())).map(|(column, _)| *column)
}

/// Whose export has such a header.
fn kind(header: &[String]) -> Kind {
    let names: Vec<String> = header.iter().map(|name| names::letters(name)).collect();
    let has = |name: &str| names.iter().any(|own| own == name);
    if has("orgdefinedid") || has("endoflineindicator") {
        Kind::Brightspace
    } else if has("section") && (has("student") || has("lastname")) && has("id") {
        Kind::Canvas
    } else if has("githubusername") {
        Kind::Github
    } else if has("identifier") && (has("fullname") || has("grade")) {
        Kind::Moodle
    } else if has("sid") {
        Kind::Gradescope
    } else {
        Kind::Plain
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Roster {
        Roster::parse(text.as_bytes(), Path::new("list.csv")).unwrap()
    }

    fn said(student: &Student) -> [&str; 5] {
        [&student.number, &student.id, &student.username, &student.first_name, &student.last_name]
            .map(String::as_str)
    }

    #[test]
    fn lists_of_all_platforms() {
        let list = read(
            "\u{feff}OrgDefinedId,Username,Last Name,First Name,Email,A2 Points Grade <Numeric MaxPoints:100>,End-of-Line Indicator\r\n\
             #0260000001,#zoneil,\"O'Neil, Jr\",Zoë,z@example.org,,#\r\n",
        );
        assert_eq!(list.kind, Kind::Brightspace);
        assert_eq!(said(&list.students[0]), ["0260000001", "", "zoneil", "Zoë", "O'Neil, Jr"]);
        assert_eq!((list.students[0].line, list.rows[0][0].as_str()), (2, "#0260000001"));

        let list = read(
            "Student,ID,SIS User ID,SIS Login ID,Section,A2 (77),Final Score\n,,,,,Manual Posting,\n\
             \"    Points Possible\",,,,,100,(read only)\n\"Lee, Ann\",101,260000001,alee,1,,\n\"Student, Test\",9,,x,1,,\n",
        );
        assert_eq!(list.kind, Kind::Canvas);
        assert_eq!(list.students.len(), 1);
        assert_eq!(said(&list.students[0]), ["260000001", "101", "alee", "Ann", "Lee"]);
        assert_eq!((list.students[0].row, list.students[0].line), (2, 4));

        let list = read(
            "Identifier,Full name,ID number,Email address,Status,Grade,Maximum Grade,Last modified (submission),Last modified (grade)\n\
             Participant 7,Ann Lee,260000001,a@example.org,Submitted,,100,\"Sunday, 6 October 2019, 11:59 PM\",-\n",
        );
        assert_eq!((list.kind, list.students[0].id.as_str()), (Kind::Moodle, "7"));
        assert_eq!(list.students[0].submitted, "2019-10-06T23:59:00");

        let list = read("Name;SID;Email\nAnn Lee;260000001;a@example.org\n");
        assert_eq!(list.kind, Kind::Gradescope);
        assert_eq!(said(&list.students[0]), ["260000001", "", "", "Ann Lee", ""]);

        let list = read("identifier,github_username,github_id,name\n260000001,ann-l,5,\n");
        assert_eq!(
            (list.kind, said(&list.students[0])[..3].to_vec()),
            (Kind::Github, vec!["260000001", "", "ann-l"])
        );

        let list = read("student_id\tname\n00123\tAnn Lee\n");
        assert_eq!((list.kind, said(&list.students[0])[0]), (Kind::Plain, "00123"));
    }

    #[test]
    fn a_list_saved_by_a_spreadsheet() {
        let wide: Vec<u8> =
            "\u{feff}Name\tSID\nZoë\t7\n".encode_utf16().flat_map(u16::to_le_bytes).collect();
        let list = Roster::parse(&wide, Path::new("l.csv")).unwrap();
        assert_eq!(list.students[0].first_name, "Zoë");
        let list = Roster::parse(b"Name,SID\nZo\xeb,7\n", Path::new("l.csv")).unwrap();
        assert_eq!(list.students[0].first_name, "Zoë");
    }

    #[test]
    fn what_is_no_list_is_refused_with_its_line() {
        for (text, expected) in [
            ("", "list.csv: the class list is empty"),
            ("a,b\n1,2\n", "list.csv:1: expected a header"),
            ("Name,SID\n", "list.csv: the class list names no student"),
            ("Name,SID\nA,7\nB,#7\n", "list.csv:3: student number 7 is there already, on line 2"),
        ] {
            let error =
                Roster::parse(text.as_bytes(), Path::new("list.csv")).unwrap_err().to_string();
            assert!(error.starts_with(expected), "{error}");
        }
    }
}
