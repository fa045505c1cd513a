use super::*;

fn read(text: &str) -> Roster {
    Roster::parse(text.as_bytes(), Path::new("list.csv")).unwrap()
}

fn said(student: &ListedStudent) -> [&str; 5] {
    [&student.number, &student.id, &student.username, &student.first_name, &student.last_name]
        .map(String::as_str)
}

#[test]
fn lists_of_all_platforms() {
    let list = read(
        "\u{feff}OrgDefinedId,Username,Last Name,First Name,Email,A2 Points Grade <Numeric MaxPoints:100>,End-of-Line Indicator\r\n\
         #0260000001,#zoneil,\"O'Neil, Jr\",Zoë,z@example.org,,#\r\n",
    );
    assert_eq!(list.kind, Platform::Brightspace);
    assert_eq!(said(&list.students[0]), ["0260000001", "", "zoneil", "Zoë", "O'Neil, Jr"]);
    assert_eq!((list.students[0].line, list.rows[0][0].as_str()), (2, "#0260000001"));

    let list = read(
        "Student,ID,SIS User ID,SIS Login ID,Section,A2 (77),Final Score\n,,,,,Manual Posting,\n\
         \"    Points Possible\",,,,,100,(read only)\n\"Lee, Ann\",101,260000001,alee,1,,\n\"Student, Test\",9,,x,1,,\n",
    );
    assert_eq!(list.kind, Platform::Canvas);
    assert_eq!(list.students.len(), 1);
    assert_eq!(said(&list.students[0]), ["260000001", "101", "alee", "Ann", "Lee"]);
    assert_eq!((list.students[0].row, list.students[0].line), (2, 4));

    let list = read(
        "Identifier,Full name,ID number,Email address,Status,Grade,Maximum Grade,Last modified (submission),Last modified (grade)\n\
         Participant 7,Ann Lee,260000001,a@example.org,Submitted,,100,\"Sunday, 6 October 2019, 11:59 PM\",-\n",
    );
    assert_eq!((list.kind, list.students[0].id.as_str()), (Platform::Moodle, "7"));
    assert_eq!(list.students[0].submitted, "2019-10-06T23:59:00");

    let list = read("Name;SID;Email\nAnn Lee;260000001;a@example.org\n");
    assert_eq!(list.kind, Platform::Gradescope);
    assert_eq!(said(&list.students[0]), ["260000001", "", "", "Ann Lee", ""]);

    let list = read("identifier,github_username,github_id,name\n260000001,ann-l,5,\n");
    assert_eq!(
        (list.kind, said(&list.students[0])[..3].to_vec()),
        (Platform::Github, vec!["260000001", "", "ann-l"])
    );

    let list = read("student_id\tname\n00123\tAnn Lee\n");
    assert_eq!((list.kind, said(&list.students[0])[0]), (Platform::Plain, "00123"));
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
    let names: Vec<String> = list.students.iter().map(ListedStudent::full_name).collect();
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
    for headless in ["Ash,Ann,260000001\nNo,On,260000002\n", "No,On,on@x.ca\nAsh,Ann,ann@x.ca\n"] {
        let error = Roster::parse(headless.as_bytes(), Path::new("list.csv")).unwrap_err();
        let error = error.to_string();
        assert!(error.starts_with("list.csv:1: expected a header"), "{error}");
        assert!(!error.contains("looks like the header"), "{error}");
    }
    let titled = "ECSE 446,,\nFall 2019,,\nName,ID,x\nAnn Ash,1,\n";
    let error = Roster::parse(titled.as_bytes(), Path::new("list.csv")).unwrap_err().to_string();
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
        (b"SID,Name\n3,\"Li\n4,Ann Lee\n", "list.csv:2: the quote that opens here is not closed"),
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
        let error = Roster::parse(text.as_bytes(), Path::new("list.csv")).unwrap_err().to_string();
        assert!(error.starts_with(expected), "{error}");
    }
}
