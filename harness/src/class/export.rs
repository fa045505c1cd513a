//! Grades as a learning platform imports them: its own class list or grade book back, with one column filled.

use super::layout::Kind;
use super::names;
use super::roster::{Roster, Student};
use crate::harmless::csv_cell;

/// The points of one student of a class list.
#[derive(Clone, Debug, PartialEq)]
pub struct Points<'a> {
    /// The student.
    pub student: &'a Student,
    /// What they earned.
    pub points: f64,
}

/// A grade book of `roster`'s platform with the points of some students in the column `item`; everybody else is left
/// out, so that an import does not touch them.
///
/// # Errors
/// When the list is no export of a platform that imports grades, or has no such column.
pub fn grade_book(roster: &Roster, item: &str, graded: &[Points]) -> Result<String, String> {
    let list = roster.path.display();
    let named = |wanted: &[&str]| -> Vec<usize> {
        let of = |name: &String| wanted.contains(&names::letters(name).as_str());
        roster.header.iter().enumerate().filter(|(_, name)| of(name)).map(|(at, _)| at).collect()
    };
    // Columns that are copied, and the names of those that are not there yet.
    let (copied, filled) = match roster.kind {
        Kind::Brightspace => {
            let points = format!("{item} Points Grade");
            let own = roster.header.iter().find(|name| {
                let rest = name.strip_prefix(&points);
                rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(" <"))
            });
            (named(&["orgdefinedid", "username"]), own.cloned().unwrap_or(points))
        }
        Kind::Canvas => {
            let title = format!("{item} (");
            let own = |name: &&String| *name == item || name.starts_with(&title);
            let found: Vec<&String> = roster.header.iter().filter(own).collect();
            let [column] = found[..] else {
                return Err(format!(
                    "{list}:1: expected one column of the assignment \"{item}\", found {}; hint: export the grade \
                     book after the assignment is made, and name it with --item",
                    found.len()
                ));
            };
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
            (named(&known), column.clone())
        }
        Kind::Moodle => {
            let Some(at) = roster.header.iter().position(|name| names::letters(name) == "grade")
            else {
                return Err(format!(
                    "{list}:1: expected a column Grade; hint: download the grading worksheet of the assignment"
                ));
            };
            ((0..roster.header.len()).filter(|own| *own != at).collect(), roster.header[at].clone())
        }
        _ => {
            return Err(format!(
                "{list}: expected the grade book of Brightspace or Canvas or the grading worksheet of Moodle; hint: \
                 grade with --class and the file that your platform exports"
            ));
        }
    };
    let mut rows = Vec::new();
    let pick = |cells: &[String]| -> Vec<String> {
        copied.iter().map(|at| cells.get(*at).cloned().unwrap_or_default()).collect()
    };
    let end = |row: &mut Vec<String>, cell: &str| {
        if roster.kind == Kind::Brightspace {
            row.push(cell.to_owned());
        }
    };
    let mut head = pick(&roster.header);
    head.push(filled);
    end(&mut head, "End-of-Line Indicator");
    rows.push(head);
    for Points { student, points } in graded {
        let mut row = pick(&roster.rows[student.row]);
        row.push(format!("{points:.2}"));
        end(&mut row, "#");
        rows.push(row);
    }
    let mut writer = csv::Writer::from_writer(Vec::new());
    for row in rows {
        // A dash alone stands for nothing, and is no formula.
        let cells = row.iter().map(|cell| if cell == "-" { cell.clone() } else { csv_cell(cell) });
        writer.write_record(cells).map_err(|error| error.to_string())?;
    }
    let bytes = writer.into_inner().map_err(|error| error.to_string())?;
    String::from_utf8(bytes).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use similar_asserts::assert_eq;

    use super::*;

    fn book(list: &str, item: &str) -> Result<String, String> {
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
}
