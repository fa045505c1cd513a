//! The class list: a CSV file that a learning platform exports, or one with the same few columns.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::layout::Kind;
use super::{names, stamps};
use crate::harmless::printable;

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
    /// Whether the platform says that it is a draft, which the student has not submitted.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub draft: bool,
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

/// What columns are called, without accents, signs and case, and what they hold. Numbers and names also as students
/// call them in `config.json`.
const COLUMNS: [(Column, &[&str]); 9] = [
    (
        Column::Number,
        &[
            "orgdefinedid",
            "sisuserid",
            "idnumber",
            "idnum",
            "sid",
            "studentid",
            "studentidnumber",
            "studentnumber",
            "studentno",
            "studentnr",
            "studentnum",
            "studentnummer",
            "number",
            "numero",
            "numerodetudiant",
            "numeroetudiant",
            "numerodidentification",
            "matricule",
            "codepermanent",
            "matricola",
            "matricula",
            "matrikelnummer",
            "matrikelnr",
            "mcgillid",
            "emplid",
            "uin",
            "\u{5b66}\u{53f7}",
        ],
    ),
    (Column::Id, &["id", "identifier", "identifiant", "githubid", "userid"]),
    (
        Column::Username,
        &[
            "username",
            "sisloginid",
            "githubusername",
            "login",
            "loginid",
            "user",
            "netid",
            "nomdutilisateur",
        ],
    ),
    (
        Column::First,
        &[
            "firstname",
            "first",
            "givenname",
            "givennames",
            "given",
            "forename",
            "fname",
            "prenom",
            "prenoms",
            "vorname",
            "nombre",
            "nombres",
            "nome",
            "\u{540d}",
        ],
    ),
    (
        Column::Last,
        &[
            "lastname",
            "last",
            "surname",
            "familyname",
            "familynames",
            "family",
            "lname",
            "nom",
            "nomdefamille",
            "nomfamille",
            "nachname",
            "apellido",
            "apellidos",
            "cognome",
            "\u{59d3}",
        ],
    ),
    (
        Column::Full,
        &[
            "student",
            "fullname",
            "name",
            "names",
            "studentname",
            "nomcomplet",
            "nomprenom",
            "prenomnom",
            "nometprenom",
            "prenometnom",
            "lastnamefirstname",
            "firstnamelastname",
            "firstlast",
            "nomdeletudiant",
            "etudiant",
            "\u{59d3}\u{540d}",
        ],
    ),
    (
        Column::Email,
        &[
            "email",
            "emailaddress",
            "mail",
            "courriel",
            "adressecourriel",
            "adressedecourriel",
            "adresseelectronique",
        ],
    ),
    (Column::Submitted, &["lastmodifiedsubmission", "dernieremodificationtravailremis"]),
    (Column::Status, &["status", "statut", "estado", "stato"]),
];

/// How Moodle begins the status of a draft, in plain letters.
const DRAFTS: [&str; 6] = ["draft", "brouillon", "entwurf", "borrador", "bozza", "rascunho"];

/// Words of a heading for a number of a person, such as `Banner ID`, `Student #` or `N\u{b0} de dossier`.
const NUMBER: [&str; 9] = ["id", "number", "no", "nr", "num", "numero", "n", "nummer", "code"];
/// Words of a heading for a number of something else.
const NO_PERSON: [&str; 23] = [
    "phone",
    "telephone",
    "tel",
    "mobile",
    "section",
    "course",
    "cours",
    "group",
    "groupe",
    "team",
    "class",
    "assignment",
    "submission",
    "attempt",
    "term",
    "room",
    "postal",
    "zip",
    "crn",
    "seat",
    "program",
    "programme",
    "project",
];
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
    Status,
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
        if let Some(what) = no_text(bytes) {
            bail!(
                "{}: expected a CSV file, found {what}; hint: save it as CSV (UTF-8)",
                path.display()
            );
        }
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
        let mut records = records.into_iter();
        let Some((line, header)) = records.next() else {
            bail!("{}: the class list is empty", path.display());
        };
        let kind = kind(&header);
        let columns = columns(&header, kind);
        let at = |column: Column| columns.iter().position(|own| *own == Some(column));
        let has = |column: Column| at(column).is_some();
        if !tells_students(&header) {
            bail!(
                "{}:{line}: expected a header with a column of student numbers or names, such as OrgDefinedId, \
                 SIS User ID, ID number, SID, Student or Full name; found {}; hint: {}",
                path.display(),
                printable(&header.iter().take(6).cloned().collect::<Vec<_>>().join(", ")),
                match records.take(MAX_TITLES).find(|(_, cells)| tells_students(cells)) {
                    Some((line, _)) =>
                        format!("line {line} looks like the header: delete what is above it"),
                    None => "export the class list or the grade book from your learning platform"
                        .to_owned(),
                }
            );
        }
        let mut roster = Self {
            path: path.to_owned(),
            kind,
            header: header.clone(),
            rows: Vec::new(),
            students: Vec::new(),
            left_out: Vec::new(),
            unread_times: Vec::new(),
        };
        for (line, cells) in records {
            let cell = |column: Column| {
                let cell = at(column).and_then(|at| cells.get(at));
                cell.map(|text| unwrapped(text.trim()).to_owned()).unwrap_or_default()
            };
            let row = roster.rows.len();
            roster.rows.push(cells.clone());
            let unsigned = |text: String| text.trim_start_matches('#').to_owned();
            let number = unsigned(cell(Column::Number));
            if is_rounded(&number) {
                bail!(
                    "{}:{line}: the student number is {number}: a spreadsheet rounded it, and its digits are lost; hint: \
                     export the list again, and do not open it in a spreadsheet, or only with that column as text",
                    path.display()
                );
            }
            let submitted = cell(Column::Submitted);
            let mut student = Student {
                line,
                row,
                number: whole(&number).to_owned(),
                id: cell(Column::Id),
                username: unsigned(cell(Column::Username)),
                first_name: cell(Column::First),
                last_name: cell(Column::Last),
                email: cell(Column::Email),
                submitted: stamps::parse(&submitted).unwrap_or_default(),
                draft: DRAFTS
                    .iter()
                    .any(|word| names::plain(&cell(Column::Status)).starts_with(word)),
            };
            if student.submitted.is_empty() && submitted.contains(|c: char| c.is_ascii_digit()) {
                roster.unread_times.push(format!("line {line}, \"{}\"", printable(&submitted)));
            }
            let full = cell(Column::Full);
            // Canvas's rows of points and its made-up student.
            if kind == Kind::Canvas && (student.id.is_empty() || full == "Student, Test") {
                continue;
            }
            let is_sum = SUMS.contains(&names::plain(&full).trim())
                || SUMS.contains(&names::plain(&student.full_name()).trim());
            let keys = [&student.number, &student.username, &student.email];
            if is_sum && keys.iter().all(|key| key.is_empty()) {
                roster
                    .left_out
                    .push(format!("line {line}, {}", printable(&(student.full_name() + &full))));
                continue;
            }
            if student.last_name.is_empty() && !has(Column::Last) && !student.first_name.is_empty()
            {
                // `Name, First name`: the whole name, or the last one.
                let (own, first) = (names::words(&full), names::words(&student.first_name));
                let is_whole =
                    first.split(' ').all(|word| own.split(' ').any(|other| other == word));
                if is_whole {
                    student.first_name = String::new();
                } else {
                    student.last_name.clone_from(&full);
                }
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

/// What each column holds; the first of those that hold the same. A list of no platform has other headings for the
/// student number: where one column alone is called like a number of a person, that is the one.
fn columns(header: &[String], kind: Kind) -> Vec<Option<Column>> {
    let mut columns: Vec<Option<Column>> = Vec::new();
    for name in header {
        let own = column(name).filter(|own| !columns.contains(&Some(*own)));
        // Elsewhere it is that of a person.
        let own = own.filter(|own| *own != Column::Status || kind == Kind::Moodle);
        columns.push(own);
    }
    if kind == Kind::Plain && !columns.contains(&Some(Column::Number)) {
        let is_number = |at: &usize| {
            columns[*at] == Some(Column::Id) || (columns[*at].is_none() && is_number(&header[*at]))
        };
        let may_be: Vec<usize> = (0..header.len()).filter(is_number).collect();
        if let [only] = may_be[..] {
            columns[only] = Some(Column::Number);
        }
    }
    columns
}

/// Whether a header has a column that tells students apart.
fn tells_students(header: &[String]) -> bool {
    // A student called "No", say, has a number or an address beside the name.
    let is_datum = |cell: &String| {
        let digits = unwrapped(cell.trim()).trim_start_matches('#');
        let is_number = digits.len() >= 5 && digits.bytes().all(|byte| byte.is_ascii_digit());
        is_number || cell.contains('@')
    };
    if header.iter().any(is_datum) {
        return false;
    }
    let columns = columns(header, kind(header));
    let telling =
        [Column::Number, Column::Username, Column::Email, Column::Full, Column::Last].map(Some);
    columns.iter().any(|own| telling.contains(own))
}

/// What is in `="0260"`, by which spreadsheets keep zeros.
fn unwrapped(cell: &str) -> &str {
    cell.strip_prefix("=\"").and_then(|rest| rest.strip_suffix('"')).unwrap_or(cell)
}

/// `260000101` of `260000101.0`, as programs write numbers that they read as fractions.
fn whole(number: &str) -> &str {
    let is = |part: &str, wanted: fn(&u8) -> bool| {
        !part.is_empty() && part.as_bytes().iter().all(wanted)
    };
    match number.split_once('.') {
        Some((digits, zeros)) if is(digits, u8::is_ascii_digit) && is(zeros, |b| *b == b'0') => {
            digits
        }
        _ => number,
    }
}

/// Whether a number is written as spreadsheets write large ones: `2.60000E+08`.
fn is_rounded(number: &str) -> bool {
    let digits = |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
    let parts = number
        .split_once(['E', 'e'])
        .and_then(|(digits, power)| Some((digits.replace(',', "."), power.strip_prefix('+')?)));
    parts.is_some_and(|(number, power)| digits(&number.replacen('.', "", 1)) && digits(power))
}

fn column(name: &str) -> Option<Column> {
    let name = names::letters(name);
    COLUMNS.iter().find(|(_, known)| known.contains(&name.as_str())).map(|(column, _)| *column)
}

/// Whether a heading is like one for a number of a person.
fn is_number(name: &str) -> bool {
    let plain = names::plain(name);
    let has = |known: &[&str]| {
        plain.split(|c: char| !c.is_alphanumeric()).any(|word| known.contains(&word))
    };
    (has(&NUMBER) || plain.contains(['#', '\u{2116}'])) && !has(&NO_PERSON)
}

/// What a file is that is no text, if it is none.
fn no_text(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [b'P', b'K', 3 | 5, 4 | 6, ..] => Some("an Excel workbook or another zip"),
        [0xd0, 0xcf, 0x11, 0xe0, ..] => Some("an old Excel workbook"),
        [b'%', b'P', b'D', b'F', ..] => Some("a PDF"),
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => None,
        bytes if bytes.contains(&0) => Some("a file that is no text"),
        _ => None,
    }
}

/// The sign of Excel's line `sep=;`, if there is one.
fn separator(text: &str) -> Option<u8> {
    let line = text.lines().next()?.trim_matches('"');
    let sign = line.get(..4).filter(|key| key.eq_ignore_ascii_case("sep=")).map(|_| &line[4..])?;
    match sign.as_bytes() {
        [sign @ (b',' | b';' | b'\t' | b'|')] => Some(*sign),
        _ => None,
    }
}

/// A quoted cell over several lines that is not closed, or closed where no cell ends: the line where it begins, and
/// that where it ends, if it does.
fn open_quote(text: &str, delimiter: u8) -> Option<(usize, Option<usize>)> {
    let bytes = text.as_bytes();
    let (mut at, mut line, mut begins) = (0, 1, true);
    while at < bytes.len() {
        if !(begins && bytes[at] == b'"') {
            line += usize::from(bytes[at] == b'\n');
            begins = bytes[at] == delimiter || bytes[at] == b'\n';
            at += 1;
            continue;
        }
        let first = line;
        at += 1;
        loop {
            match (bytes.get(at), bytes.get(at + 1)) {
                (None, _) => return Some((first, None)),
                (Some(b'"'), Some(b'"')) => at += 2,
                (Some(b'"'), after) => {
                    let ends = after.is_none_or(|own| *own == delimiter || *own == b'\n');
                    if !ends && line != first {
                        return Some((first, Some(line)));
                    }
                    at += 1;
                    break;
                }
                (Some(byte), _) => {
                    line += usize::from(*byte == b'\n');
                    at += 1;
                }
            }
        }
        begins = false;
    }
    None
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
    } else if (has("identifier") && (has("fullname") || has("grade")))
        || (has("identifiant") && (has("nomcomplet") || has("note")))
    {
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
    fn headings_of_registrars_in_several_languages() {
        for heading in [
            "ID",
            "McGill ID",
            "Student #",
            "Student no",
            "Student No.",
            "Banner ID",
            "EMPLID",
            "Num\u{e9}ro d'\u{e9}tudiant",
            "Student Number",
            "N\u{b0} \u{e9}tudiant",
            "Matricule",
            "Matrikel-Nr.",
            "UBC Student Number",
            "No",
        ] {
            let list = read(&format!("Name,{heading},Phone number\n\"Lee, Ann\",260000104,1\n"));
            assert_eq!(said(&list.students[0]), ["260000104", "", "", "Ann", "Lee"], "{heading}");
            let expected = format!(
                "list.csv: student number from \"{heading}\", name from \"Name\"; not used: \"Phone number\""
            );
            assert_eq!(list.reading(), expected);
        }
        for names in [
            "Nom de famille,Pr\u{e9}nom",
            "Family Name,Given Names",
            "Nom,Pr\u{e9}nom",
            "Nachname,Vorname",
            "Name,First name",
            "Surname,Forename",
        ] {
            let list = read(&format!("{names},Student ID\nLee,Ann,1\n"));
            assert_eq!(list.students[0].full_name(), "Ann Lee", "{names}");
            assert!(!list.reading().contains("not used"), "{}", list.reading());
        }
        let list = read("Name,First name,SID\nAnn Lee,Ann,1\n");
        assert_eq!(list.students[0].full_name(), "Ann Lee");
        // Two that may be the number: neither is guessed, and both are named.
        let list = read("Name,Banner ID,Card no\nAnn Lee,1,2\n");
        assert_eq!(said(&list.students[0])[0], "");
        assert_eq!(
            list.reading(),
            "list.csv: no student number, name from \"Name\"; not used: \"Banner ID\", \"Card no\""
        );
    }

    #[test]
    fn a_list_of_excel() {
        for text in ["sep=;\nName;SID\nA;7\n", "\"sep=;\"\r\nName;SID\r\nA;7\r\n"] {
            let list = read(text);
            assert_eq!((said(&list.students[0])[0], list.students[0].line), ("7", 3), "{text}");
        }
        let list = read("SID,Name\n7,Ann Lee\n,Total\n,Bo\n");
        let names: Vec<String> = list.students.iter().map(Student::full_name).collect();
        assert_eq!(names, ["Ann Lee", "Bo"]);
        assert!(list.reading().ends_with("; no student: line 3, Total"), "{}", list.reading());
        let list = read("SID,Name\n\"=\"\"0260\"\"\",A\n26.0,B\n27.50,C\n12E5,D\n");
        let numbers: Vec<&str> = list.students.iter().map(|own| own.number.as_str()).collect();
        assert_eq!(numbers, ["0260", "26", "27.50", "12E5"]);
        let moodle = "Full name,ID number,Last modified (submission)\nAnn Lee,17,\"4/11/2019, 09:00\"\n\
                      Bo Ode,18,-\nCy Ash,19,\"Montag, 4. November 2019, 09:00\"\n";
        let list = read(moodle);
        let times: Vec<&str> = list.students.iter().map(|own| own.submitted.as_str()).collect();
        assert_eq!(times, ["", "", "2019-11-04T09:00:00"]);
        let said = list.reading();
        assert!(said.ends_with("of lateness: line 2, \"4/11/2019, 09:00\""), "{said}");
        // A list without a header is told as such, whoever is on it.
        for headless in
            ["Ash,Ann,260000001\nNo,On,260000002\n", "No,On,on@x.ca\nAsh,Ann,ann@x.ca\n"]
        {
            let error = Roster::parse(headless.as_bytes(), Path::new("list.csv")).unwrap_err();
            let error = error.to_string();
            assert!(error.starts_with("list.csv:1: expected a header"), "{error}");
            assert!(!error.contains("looks like the header"), "{error}");
        }
        let titled = "ECSE 446,,\nFall 2019,,\nName,ID,x\nAnn Ash,1,\n";
        let error =
            Roster::parse(titled.as_bytes(), Path::new("list.csv")).unwrap_err().to_string();
        assert!(
            error.ends_with("; hint: line 3 looks like the header: delete what is above it"),
            "{error}"
        );
        // A cell of several lines is none of its business.
        let list = read("SID,Name,Note\n7,Ann Lee,\"a\n\"\"b\"\" c\"\n8,\"Bo \"\"B\"\" Ode\",\n");
        assert_eq!((list.students.len(), list.students[1].line), (2, 4));
        for (bytes, expected) in [
            (
                &b"PK\x03\x04\x14\x00\x1b[31m\x01\n"[..],
                "list.csv: expected a CSV file, found an Excel workbook",
            ),
            (b"\xd0\xcf\x11\xe0\xa1", "list.csv: expected a CSV file, found an old Excel workbook"),
            (b"Name,SID\nA\0,1\n", "list.csv: expected a CSV file, found a file that is no text"),
            (b"\x1b[31m,b\n1,2\n", "list.csv:1: expected a header"),
            (
                b"SID,Name\n2.60000E+08,A\n",
                "list.csv:2: the student number is 2.60000E+08: a spreadsheet",
            ),
            (
                b"SID,Name\n1,A\n\"2,6E+8\",B\n",
                "list.csv:3: the student number is 2,6E+8: a spreadsheet",
            ),
            (
                b"SID,Name\n3,\"Li\n4,Ann Lee\n",
                "list.csv:2: the quote that opens here is not closed",
            ),
            (
                b"SID,Name\n3,\"Li\n4,Ann Lee\n5,\"Wu\n",
                "list.csv:2: the quote that opens here ends in the middle of a cell on line 4",
            ),
        ] {
            let error = Roster::parse(bytes, Path::new("list.csv")).unwrap_err().to_string();
            assert!(error.starts_with(expected) && !error.contains('\x1b'), "{error:?}");
        }
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
