//! Grades as a learning platform imports them: its own class list or grade book back, with one column filled.

use super::layout::Platform;
use super::names;
use super::roster::{ListedStudent, Roster};
use crate::harmless::{csv_cell, printable};

/// The points of one student of a class list.
#[derive(Clone, Debug, PartialEq)]
pub struct Points<'a> {
    /// The student.
    pub student: &'a ListedStudent,
    /// What they earned.
    pub points: f64,
}

/// A grade book to be imported.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Book {
    /// The file.
    pub text: String,
    /// The column that is filled.
    pub column: String,
    /// The most that the platform takes in it, where the list says so.
    pub maximum: Option<f64>,
    /// The items that the list has instead, where it lacks that column.
    pub others: Option<Vec<String>>,
    /// Students whom the platform excuses; they are left out.
    pub excused: Vec<String>,
    /// Students of whom no column says by what the platform knows them; they are left out.
    pub unknown: Vec<String>,
}

/// A grade book of `roster`'s platform with the points of some students in the column `item`; everybody else is left
/// out, so that an import does not touch them.
///
/// # Errors
/// When the list is no export of a platform that imports grades, or has no such column, or several, or one that takes
/// no points.
pub fn grade_book(roster: &Roster, item: &str, graded: &[Points]) -> Result<Book, String> {
    let own = column_of(roster, item)?;
    check_keys(roster)?;
    let key_columns = named(roster, keys(roster.kind));
    let is_unknown =
        |own: &&Points| key_columns.iter().all(|at| cell(roster, own.student.row, *at).is_empty());
    let unknown = graded.iter().filter(is_unknown).map(|own| own.student.who()).collect();
    let mut book = Book { unknown, ..Book::default() };
    let copied = match roster.kind {
        Platform::Brightspace => {
            book.brightspace(roster, item, own);
            key_columns
        }
        Platform::Canvas => book.canvas(roster, item, own, graded)?,
        Platform::Moodle => book.moodle(roster, graded)?,
        _ => {
            return Err(format!(
                "{}: expected the grade book of Brightspace or Canvas or the grading worksheet of Moodle; hint: \
                 grade with --class and the file that your platform exports",
                roster.path.display()
            ));
        }
    };
    book.fill(roster, &copied, graded)?;
    Ok(book)
}

/// The columns that hold points of an assignment.
fn items(roster: &Roster) -> Vec<usize> {
    let is_item = |at: &usize| !title(roster.kind, &roster.header[*at]).is_empty();
    (0..roster.header.len()).filter(is_item).collect()
}

/// The names of some columns, for a message.
fn called(roster: &Roster, columns: &[usize]) -> String {
    let names = columns.iter().map(|at| roster.header[*at].trim().to_owned());
    printable(&names.collect::<Vec<_>>().join(", "))
}

/// The column of an assignment, if there is one.
fn column_of(roster: &Roster, item: &str) -> Result<Option<usize>, String> {
    let items = items(roster);
    let is_item = |at: &usize| {
        names::plain(title(roster.kind, &roster.header[*at])) == names::plain(item.trim())
    };
    // The column as it is written goes before all that only read the same.
    let mut own: Vec<usize> =
        items.iter().copied().filter(|at| roster.header[*at] == item).collect();
    if own.is_empty() {
        own = items.into_iter().filter(is_item).collect();
    }
    if own.len() > 1 {
        return Err(format!(
            "{}:1: expected one column of the assignment \"{item}\", found {}: {}; hint: {}",
            roster.path.display(),
            own.len(),
            called(roster, &own),
            match roster.kind {
                Platform::Canvas => {
                    format!("name one as it is written, --item \"{}\"", roster.header[own[0]])
                }
                _ => "rename one on the platform and export again".to_owned(),
            }
        ));
    }
    Ok(own.first().copied())
}

fn cell(roster: &Roster, row: usize, column: usize) -> &str {
    let row: &[String] = roster.rows.get(row).map_or(&[], Vec::as_slice);
    row.get(column).map_or("", |text| text.trim())
}

impl Book {
    /// Names the column, which Brightspace makes where it is new.
    fn brightspace(&mut self, roster: &Roster, item: &str, own: Option<usize>) {
        self.column =
            own.map_or_else(|| format!("{item} Points Grade"), |at| roster.header[at].clone());
        self.maximum = own.and_then(|at| max_points(&roster.header[at]));
        let is_grade = |name: &&String| name.contains(" Grade");
        let others = || roster.header.iter().filter(is_grade).cloned().collect();
        self.others = own.is_none().then(others);
    }

    /// Names the column, and answers those that Canvas wants beside it.
    fn canvas(
        &mut self,
        roster: &Roster,
        item: &str,
        own: Option<usize>,
        graded: &[Points],
    ) -> Result<Vec<usize>, String> {
        let Some(at) = own else {
            return Err(format!(
                "{}:1: expected one column of the assignment \"{item}\", found none; the columns are: {}; hint: \
                 name one with --item, or export the grade book after the assignment is made",
                roster.path.display(),
                called(roster, &items(roster))
            ));
        };
        self.column.clone_from(&roster.header[at]);
        let possible =
            |row: &usize| names::plain(cell(roster, *row, 0)).trim() == "points possible";
        let possible = (0..roster.rows.len()).find(possible);
        self.maximum = possible.and_then(|row| number(cell(roster, row, at)));
        let is_excused =
            |own: &&Points| cell(roster, own.student.row, at).eq_ignore_ascii_case("EX");
        self.excused = graded.iter().filter(is_excused).map(|own| own.student.who()).collect();
        let known = [
            "student",
            "lastname",
            "firstname",
            "id",
            "sisuserid",
            "sisloginid",
            "integrationid",
            "rootaccount",
            "section",
        ];
        Ok(named(roster, &known))
    }

    /// Names the column, and answers the others, which Moodle wants back.
    fn moodle(&mut self, roster: &Roster, graded: &[Points]) -> Result<Vec<usize>, String> {
        let list = roster.path.display();
        let Some(&at) = named(roster, &["grade", "note"]).first() else {
            return Err(format!(
                "{list}:1: expected a column Grade; hint: download the grading worksheet of the assignment"
            ));
        };
        let has_points =
            |own: &usize| graded.iter().any(|row| !cell(roster, row.student.row, *own).is_empty());
        if named(roster, &["scale", "bareme"]).iter().any(has_points) {
            return Err(format!(
                "{list}:1: the assignment is graded on a scale of words, and points are no such word; hint: give it \
                 a maximum grade in Moodle, and download the worksheet again"
            ));
        }
        self.column.clone_from(&roster.header[at]);
        let most = named(roster, &["maximumgrade", "notemaximale"]);
        let most = most.first().into_iter().flat_map(|column| {
            graded.iter().map(move |row| cell(roster, row.student.row, *column))
        });
        self.maximum = most.filter_map(number).min_by(f64::total_cmp);
        Ok((0..roster.header.len()).filter(|own| *own != at).collect())
    }

    /// Writes the columns `copied` and the points, in the rows of those who are not left out.
    fn fill(&mut self, roster: &Roster, copied: &[usize], graded: &[Points]) -> Result<(), String> {
        let pick = |cells: &[String]| -> Vec<String> {
            copied.iter().map(|at| cells.get(*at).cloned().unwrap_or_default()).collect()
        };
        let end = |row: &mut Vec<String>, cell: &str| {
            if roster.kind == Platform::Brightspace {
                row.push(cell.to_owned());
            }
        };
        let mut head = pick(&roster.header);
        head.push(self.column.clone());
        end(&mut head, "End-of-Line Indicator");
        let mut rows = vec![head];
        for Points { student, points } in graded {
            if self.excused.contains(&student.who()) || self.unknown.contains(&student.who()) {
                continue;
            }
            let mut row = pick(&roster.rows[student.row]);
            row.push(format!("{points:.2}"));
            end(&mut row, "#");
            rows.push(row);
        }
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in rows {
            // A dash alone stands for nothing, and is no formula.
            let cells =
                row.iter().map(|cell| if cell == "-" { cell.clone() } else { csv_cell(cell) });
            writer.write_record(cells).map_err(|error| error.to_string())?;
        }
        let bytes = writer.into_inner().map_err(|error| error.to_string())?;
        self.text = String::from_utf8(bytes).map_err(|error| error.to_string())?;
        Ok(())
    }
}

/// The columns by which a platform that imports grades knows whose they are; any of them does.
fn keys(kind: Platform) -> &'static [&'static str] {
    match kind {
        Platform::Brightspace => &["OrgDefinedId", "Username"],
        Platform::Canvas => &["ID", "SIS User ID", "SIS Login ID"],
        Platform::Moodle => &["Identifier", "Identifiant"],
        _ => &[],
    }
}

/// Makes sure that a list has a column by which its platform knows whose a grade is.
///
/// # Errors
/// When it has none.
pub fn check_keys(roster: &Roster) -> Result<(), String> {
    let keys = keys(roster.kind);
    if keys.is_empty() || !named(roster, keys).is_empty() {
        return Ok(());
    }
    Err(format!(
        "{}:1: expected one of the columns {}, by which {} knows whose a grade is, found none; hint: export the list \
         with it, and grade with --class once more",
        roster.path.display(),
        keys.join(", "),
        roster.kind.title()
    ))
}

/// The columns of a list with some names.
fn named(roster: &Roster, wanted: &[&str]) -> Vec<usize> {
    let wanted: Vec<String> = wanted.iter().map(|name| names::letters(name)).collect();
    let of = |name: &String| wanted.contains(&names::letters(name));
    roster.header.iter().enumerate().filter(|(_, name)| of(name)).map(|(at, _)| at).collect()
}

/// The assignment that a column holds the points of; empty where it holds none.
fn title(kind: Platform, column: &str) -> &str {
    let column = column.trim();
    match kind {
        // `A2 Points Grade <Numeric MaxPoints:100>`
        Platform::Brightspace => {
            let name = column.split(" <").next().unwrap_or_default();
            name.strip_suffix(" Points Grade").unwrap_or_default()
        }
        // `A2 (55502)`
        Platform::Canvas => {
            let parts = column.strip_suffix(')').and_then(|rest| rest.rsplit_once(" ("));
            let is_number = |id: &str| !id.is_empty() && id.bytes().all(|b| b.is_ascii_digit());
            parts.filter(|(_, id)| is_number(id)).map_or("", |(name, _)| name)
        }
        _ => "",
    }
}

/// What Brightspace says in the heading of a column.
fn max_points(column: &str) -> Option<f64> {
    let (_, rest) = column.split_once("MaxPoints:")?;
    number(rest.split([' ', '>']).next()?)
}

/// A number with a point or a comma.
fn number(text: &str) -> Option<f64> {
    text.trim().replace(',', ".").parse().ok().filter(|number: &f64| number.is_finite())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use similar_asserts::assert_eq;

    use super::*;

    fn book(list: &str, item: &str) -> Result<String, String> {
        whole(list, item).map(|book| book.text)
    }

    fn whole(list: &str, item: &str) -> Result<Book, String> {
        let roster = Roster::parse(list.as_bytes(), Path::new("list.csv")).unwrap();
        // All but the last.
        let graded = &roster.students[..roster.students.len() - 1];
        let graded: Vec<Points> =
            graded.iter().map(|student| Points { student, points: 87.5 }).collect();
        grade_book(&roster, item, &graded)
    }

    #[test]
    fn the_platform_s_own_columns_come_back() {
        let list = "OrgDefinedId,Username,Last Name,First Name,\"A2, lights Points Grade <Numeric MaxPoints:100>\",End-of-Line Indicator\n\
                    #0260000001,#zo,\"O'Neil, Jr\",Zoë,,#\n#2,#b,B,B,,#\n";
        assert_eq!(
            book(list, "A2, lights").unwrap(),
            "OrgDefinedId,Username,\"A2, lights Points Grade <Numeric MaxPoints:100>\",End-of-Line Indicator\n\
             #0260000001,#zo,87.50,#\n"
        );
        assert_eq!(
            book(list, "A2").unwrap(),
            "OrgDefinedId,Username,A2 Points Grade,End-of-Line Indicator\n#0260000001,#zo,87.50,#\n"
        );
        let list = "Student,ID,SIS User ID,SIS Login ID,Section,A2 (77),A22 (78),Final Score\n    Points Possible,,,,,100,,(read only)\n\
                    \"=1+1, Zoë\",501,0260000001,zo,1,,,\n\"B, B\",502,2,b,1,,,\n";
        assert_eq!(
            book(list, "A2").unwrap(),
            "Student,ID,SIS User ID,SIS Login ID,Section,A2 (77)\n\"'=1+1, Zoë\",501,0260000001,zo,1,87.50\n"
        );
        assert!(book(list, "A3").unwrap_err().starts_with("list.csv:1: expected one column"));
        let list = "Identifier,Full name,Status,Grade,Maximum Grade,Last modified (grade)\n\
                    Participant 7,@Zoë,Submitted,,100,-\nParticipant 8,B,,,100,-\n";
        assert_eq!(
            book(list, "").unwrap(),
            "Identifier,Full name,Status,Maximum Grade,Last modified (grade),Grade\n\
             Participant 7,'@Zoë,Submitted,100,-,87.50\n"
        );
        assert!(book("Name,SID\nA,1\nB,2\n", "A2").unwrap_err().contains("grade with --class"));
    }

    #[test]
    fn no_grade_is_nobody_s() {
        let list = "Student ID,Last Name,First Name,A2 Points Grade,End-of-Line Indicator\n1,A,A,,#\n2,B,B,,#\n";
        let error = book(list, "A2").unwrap_err();
        assert!(
            error.starts_with("list.csv:1: expected one of the columns OrgDefinedId, Username,"),
            "{error}"
        );
        let list = "OrgDefinedId,Username,Last Name,First Name,End-of-Line Indicator\n#1,,A,A,#\n,#b,B,B,#\n\
                    ,,C,C,#\n4,,D,D,#\n";
        let own = whole(list, "A2").unwrap();
        assert_eq!(own.unknown, ["C C"]);
        let rows = own.text.lines().skip(1).collect::<Vec<_>>();
        assert_eq!(rows, ["#1,,87.50,#", ",#b,87.50,#"]);
    }

    #[test]
    fn the_column_says_what_it_takes() {
        let brightspace =
            |columns: &str| format!("OrgDefinedId,{columns},End-of-Line Indicator\n#1,,#\n#2,,#\n");
        let read = |columns: &str, item: &str| whole(&brightspace(columns), item);
        let own = read("A2 Points Grade <Numeric MaxPoints:50 Weight:10>", "a2").unwrap();
        assert_eq!((own.maximum, own.others), (Some(50.0), None));
        assert_eq!(own.column, "A2 Points Grade <Numeric MaxPoints:50 Weight:10>");
        let new =
            read("A1 Points Grade <Numeric MaxPoints:50>,A2 Text Grade <Text>", "a2").unwrap();
        assert_eq!((new.column.as_str(), new.maximum), ("a2 Points Grade", None));
        let others = ["A1 Points Grade <Numeric MaxPoints:50>", "A2 Text Grade <Text>"];
        assert_eq!(new.others.unwrap(), others);
        let twice =
            "a2 Points Grade <Numeric MaxPoints:100>,a2 Points Grade <Numeric MaxPoints:50>";
        let error = read(twice, "a2").unwrap_err();
        assert!(error.contains("found 2: a2 Points Grade <Numeric MaxPoints:100>, a2"), "{error}");

        let canvas = "Student,ID,SIS User ID,Section,A1 (76),a2 (77),a2 (78)\n    Points Possible,,,,10,50.00,100\n\
                      \"A, A\",1,1,s,,EX,\n\"B, B\",2,2,s,,,\n\"C, C\",3,3,s,,,\n";
        let error = whole(canvas, "A2").unwrap_err();
        assert!(error.contains("found 2: a2 (77), a2 (78); hint: name one as it is"), "{error}");
        let error = whole(canvas, "A3").unwrap_err();
        assert!(
            error.contains("found none; the columns are: A1 (76), a2 (77), a2 (78);"),
            "{error}"
        );
        let own = whole(canvas, "a2 (77)").unwrap();
        assert_eq!((own.maximum, own.excused), (Some(50.0), vec!["A A (1)".to_owned()]));
        assert_eq!(own.text.lines().skip(1).collect::<Vec<_>>(), ["\"B, B\",2,2,s,87.50"]);
        assert_eq!(whole(canvas, "a2 (78)").unwrap().maximum, Some(100.0));

        let moodle = "Identifier,Full name,Grade,LAST,Last modified (grade)\nParticipant 7,A,,VALUE,-\nParticipant 8,B,,VALUE,-\n";
        let moodle = |last: &str, value: &str| {
            whole(&moodle.replace("LAST", last).replace("VALUE", value), "")
        };
        assert_eq!(moodle("Maximum grade", "50.00").unwrap().maximum, Some(50.0));
        let error = moodle("Scale", "\"Bad, Good\"").unwrap_err();
        assert!(error.contains("graded on a scale of words"), "{error}");
    }

    #[test]
    fn a_worksheet_of_moodle_in_french() {
        let list = "Identifiant,\"Nom complet\",\"Num\u{e9}ro d\u{2019}identification\",Statut,Note,\"Note maximale\",\
                    \"Derni\u{e8}re modification (travail remis)\"\n\
                    \"Participant 701\",\"Ann Ash\",260000101,x,,\"100,00\",\"mardi 8 octobre 2019, 13:05\"\n\
                    \"Participant 702\",\"Bob Bay\",260000102,x,,\"100,00\",-\n";
        let roster = Roster::parse(list.as_bytes(), Path::new("list.csv")).unwrap();
        let ann = &roster.students[0];
        assert_eq!((roster.kind, ann.id.as_str()), (Platform::Moodle, "701"));
        assert_eq!(
            [ann.number.as_str(), ann.submitted.as_str()],
            ["260000101", "2019-10-08T13:05:00"]
        );
        let own = whole(list, "").unwrap();
        assert_eq!((own.column.as_str(), own.maximum), ("Note", Some(100.0)));
        assert!(own.text.ends_with("\"mardi 8 octobre 2019, 13:05\",87.50\n"), "{}", own.text);
    }
}
