//! The columns of class lists: what they are called, and which platform's list has such ones.

use super::cells::unwrapped;
use crate::class::layout::Platform;
use crate::class::names;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Column {
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

/// What each column holds; the first of those that hold the same. A list of no platform has other headings for the
/// student number: where one column alone is called like a number of a person, that is the one.
pub(super) fn columns(header: &[String], kind: Platform) -> Vec<Option<Column>> {
    let mut columns: Vec<Option<Column>> = Vec::new();
    for name in header {
        let own = column(name).filter(|own| !columns.contains(&Some(*own)));
        // Elsewhere it is that of a person.
        let own = own.filter(|own| *own != Column::Status || kind == Platform::Moodle);
        columns.push(own);
    }
    if kind == Platform::Plain && !columns.contains(&Some(Column::Number)) {
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

/// Whether a header has a column that tells students apart.
pub(super) fn tells_students(header: &[String]) -> bool {
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

/// Whose export has such a header.
pub(super) fn kind(header: &[String]) -> Platform {
    let names: Vec<String> = header.iter().map(|name| names::letters(name)).collect();
    let has = |name: &str| names.iter().any(|own| own == name);
    if has("orgdefinedid") || has("endoflineindicator") {
        Platform::Brightspace
    } else if has("section") && (has("student") || has("lastname")) && has("id") {
        Platform::Canvas
    } else if has("githubusername") {
        Platform::Github
    } else if (has("identifier") && (has("fullname") || has("grade")))
        || (has("identifiant") && (has("nomcomplet") || has("note")))
    {
        Platform::Moodle
    } else if has("sid") {
        Platform::Gradescope
    } else {
        Platform::Plain
    }
}
