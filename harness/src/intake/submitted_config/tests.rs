use super::*;

fn names(text: &str) -> (String, String, Option<u64>) {
    let (config, findings, _) = SubmittedConfig::parse(text.as_bytes());
    for finding in findings {
        assert_eq!(finding.severity, crate::intake::Severity::Warning, "{finding}");
    }
    let text = |f: &Option<Field>| f.as_ref().map(|f| f.text.clone()).unwrap_or_default();
    (text(&config.first_name), text(&config.last_name), config.sampler_seed())
}

#[test]
fn keys_of_other_languages_and_shapes_are_known() {
    let ada = ("Ada".to_owned(), "Lampglow".to_owned(), Some(260_123_456));
    for keys in [
        "given,family,matricola",
        "given names,surname,UID",
        "pr\u{e9}nom,nom,matricule",
        "Vorname,Nachname,Matrikelnummer",
        "nombre,apellidos,matr\u{ed}cula",
        "nome,cognome,no",
        "your first name,your last name,your student id",
        "fn,ln,student#",
        "first,last,studentNum",
        "preferredName,family name,Num\u{e9}ro d'\u{e9}tudiant",
        "\u{540d},\u{59d3},\u{5b66}\u{53f7}",
    ] {
        let [first, last, id] = keys.split(',').collect::<Vec<_>>().try_into().unwrap();
        let text = format!(r#"{{"{first}": "Ada", "{last}": "Lampglow", "{id}": 260123456}}"#);
        assert_eq!(names(&text), ada, "{text}");
    }
    for text in [
        r#"{"students": [{"firstName": "Ada", "lastName": "Lampglow", "id": 260123456}]}"#,
        r#"{"name": ["Ada", "Lampglow"], "id": [260123456]}"#,
        r#"{"info": {"firstName": "Ada", "lastName": "Lampglow", "number": "260123456"}}"#,
        r#"{"author": "Ada Lampglow <ada@example.org>", "student": 260123456}"#,
        r#"{"firstName": {"value": "Ada"}, "lastName": ["Lampglow"], "id": {"is": "260123456"}}"#,
        "{firstName: Ada, lastName: Lampglow, studentID: 260123456}",
        // What is said by its own name counts.
        r#"{"firstName": "Ada", "lastName": "Lampglow", "studentID": 260123456, "x": {"id": 7}}"#,
    ] {
        assert_eq!(names(text), ada, "{text}");
    }
    assert_eq!(names("{firstName: Ada Mary, lastName: van der Berg}").0, "Ada Mary");
    assert_eq!(names("{firstName: Ada lastName: Lampglow}").1, "Lampglow");
}

#[test]
fn numbers_are_found_among_other_signs_where_they_are_clear() {
    for text in [
        "260 123 456",
        "260.123.456",
        "260,123,456",
        "#260123456",
        "A260123456",
        "ID 260123456",
        "(260123456)",
        "no. 260123456",
        "<260123456>",
        "+260123456",
        "260123456.0",
        "2.60123456e8",
        "2.60123456E+08",
        "260123456L",
        "260123456 (McGill)",
        "s260123456@mail",
        "\u{ff12}60123456",
    ] {
        assert_eq!(number_in(text).as_deref(), Some("260123456"), "{text}");
    }
    for text in [
        "26012345x",
        "26O123456",
        "-260123456",
        "-1",
        "+1",
        "1.5",
        "0xF8",
        "260123456/260999999",
        "1e3",
        "two",
        "",
        "260.12.3456",
        "nan",
        "260181512, 260181513",
        "260181512,260181513",
        "260181512 260181513",
        "260181512-260181513",
        "260181512 2019-10-05",
        "2019-10-05 260181512",
        "260123456 1",
        "26018 26019",
        "2.6018E8",
        "2.6018e+08",
        "26E7",
        "inf",
        "1e300",
    ] {
        assert_eq!(number_in(text), None, "{text}");
    }
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
        format!("{{\n\"firstName\": \"Ada\",\n\"lastName\": \"Lampglow\",\n\"studentID\": {id}\n}}")
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
        (r#"{"fristName": "Ada", "lastNmae": "Lampglow", "studnetID": 260123456}"#, "config_key@1"),
        (r#"[{"firstName": "Ada", "lastName": "Lampglow", "id": 260123456}]"#, "config_shape@1"),
        ("firstName: Ada\nlastName: Lampglow\nstudentID: 260123456\n", "json_syntax@1"),
        ("firstName = \"Ada\"\nlastName = \"Lampglow\"\nstudentID = 260123456\n", "json_syntax@1"),
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
    assert_eq!(codes(r#"{"scenes": 1, "comment": "x", "username": 2, "lastImage": 3}"#), [""; 0]);
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
fn of_two_numbers_none_counts() {
    for text in [
        r#"{"studentID": ["260181512", "260181513"]}"#,
        r#"{"studentID": {"a": 260181512, "b": 260181513}}"#,
        r#"{"studentID": "260181512", "studentID": "260181513"}"#,
        r#"{"studentID": "260181512, 260181513"}"#,
        r#"{"id": 260181512, "student": 260181513}"#,
        r#"[{"id": 260181512}, {"id": 260181513}]"#,
        r#"{"students": [{"id": 260181512}, {"id": 260181513}]}"#,
    ] {
        let (config, _, is_whole) = SubmittedConfig::parse(text.as_bytes());
        assert_eq!(config.sampler_seed(), None, "{text}");
        let tree = crate::intake::TreeSpec::default();
        let said = crate::intake::check_config(&config, is_whole, &[], &[], &tree);
        let said: Vec<String> = said.iter().map(ToString::to_string).collect();
        assert!(
            said.iter().any(|said| said.contains("260181512, 260181513': these are several")),
            "{text}: {said:?}"
        );
    }
    // One that is written in two ways is one.
    for text in [
        r#"{"studentID": "260 181 512", "id": 260181512}"#,
        r#"{"studentID": ["260181512", "260181512"]}"#,
        r#"{"studentID": "", "id": 260181512}"#,
    ] {
        assert_eq!(names(text).2, Some(260_181_512), "{text}");
    }
    let (config, ..) = SubmittedConfig::parse(br#"{"studentID": 2.6018E8}"#);
    let said =
        crate::intake::check_config(&config, false, &[], &[], &crate::intake::TreeSpec::default());
    assert!(said[0].message.ends_with("digits are lost"), "{}", said[0]);
}

/// A `config.json` with something else in the place of the line of the name or number.
fn file(name: &str, id: &str) -> String {
    format!("{{\n  {name},\n  \"lastName\": \"Lampglow\",\n  {id},\n  \"renders\": []\n}}\n")
}

#[test]
fn of_two_numbers_or_names_none_counts_in_whatever_form() {
    let (first, id) = ("\"firstName\": \"Ada\"", "\"studentID\": \"260181512\"");
    let both = |one: &str, other: &str| {
        format!("<<<<<<< HEAD\n  {one},\n=======\n  {other},\n>>>>>>> main\n")
    };
    let other = id.replace("512", "513");
    let whole = file(first, id);
    for text in [
        file(first, &both(id, &other)),
        file(first, &both(id, &other).replace("=======", "||||||| 1a2b\n=======")),
        both(&whole, &whole.replace("512", "513")),
        format!("{whole}{{\"studentID\": \"260181513\"}}"),
        format!("{whole}\n{}", whole.replace("512", "513")),
        format!("{whole},\n{}", whole.replace("512", "513")),
        file(first, "\"studentID\": 260181512 260181513"),
        file(first, "\"studentID\": 260181512, 260181513"),
        file(first, "\"studentID\": 260181512; 260181513"),
        file(first, "\"studentID\": 260181512 / 260181513"),
        file(first, "\"studentID\": 260181512 or 260181513"),
        file(first, "\"studentID\": 260181512 (260181513)"),
        file(first, "\"studentID\": 260181512 \"260181513\""),
        file(first, "\"studentID\": \"260181512\", \"260181513\""),
        file(first, "\"studentID\": \"260181512\" or \"260181513\""),
        file(first, "\"studentID\": \"260181512\" / \"260181513\""),
        file(first, "\"studentID\": \"260181512\" /* or */ \"260181513\""),
        file(first, "\"studentID\": [\"260181512\" \"260181513\"]"),
        file(first, &format!("{id} {other}")),
        file(first, &format!("{id},\n  {other}")),
        "studentID: 260181512\nstudentID: 260181513\n".into(),
        "studentID: 260181512\nstudentID: 260181513\nfirstName: Ada\n".into(),
        "studentID = 260181512, 260181513\n".into(),
        r#"{"me": {"id": 260181512}, "partner": {"id": 260181513}}"#.into(),
    ] {
        let (config, findings, is_whole) = SubmittedConfig::parse(text.as_bytes());
        assert_eq!(config.sampler_seed(), None, "{text}: {config:?}");
        let tree = crate::intake::TreeSpec::default();
        let said = crate::intake::check_config(&config, is_whole, &[], &[], &tree);
        let said: Vec<String> = findings.iter().chain(&said).map(ToString::to_string).collect();
        let names = |number: &str| said.iter().any(|said| said.contains(number));
        assert!(names("260181512") && names("260181513"), "{text}: {said:?}");
    }
    let eve = first.replace("Ada", "Eve");
    for text in [
        file(&both(first, &eve), id),
        file(&format!("{first},\n  {eve}"), id),
        file(&format!("{first}, \"FirstName\": \"Eve\""), id),
        file("\"firstName\": \"Ada\" or \"Eve\"", id),
        file("\"firstName\": \"Ada\" / \"Eve\"", id),
        format!("{whole}{{\"firstName\": \"Eve\"}}"),
        both(&whole, &whole.replace("Ada", "Eve")),
        r#"{"name": "Ada Lampglow", "fullName": "Eve Dimlight", "id": 260181512}"#.into(),
        r#"{"group": ["Ada Lampglow", "Eve Dimlight"], "id": 260181512}"#.into(),
        "name: Ada Lampglow\nname: Eve Dimlight\nid: 260181512".into(),
    ] {
        let (config, findings, is_whole) = SubmittedConfig::parse(text.as_bytes());
        assert_eq!(config.first_name, None, "{text}");
        assert_eq!(config.sampler_seed(), Some(260_181_512), "{text}");
        let twice = findings.iter().find(|own| own.code == "config_twice").expect(&text);
        let said = twice.to_string();
        assert!(said.contains("Ada") && said.contains("Eve") && said.contains("neither"), "{said}");
        let tree = crate::intake::TreeSpec::default();
        let more = crate::intake::check_config(&config, is_whole, &[], &[], &tree);
        let is_missing = |own: &Finding| own.message.contains("firstName");
        assert!(!more.iter().any(is_missing), "{text}: {more:?}");
    }
}

#[test]
fn no_piece_of_a_number_counts() {
    for (id, expected) in [
        ("260,181,512", Some(260_181_512)),
        ("260'181'512", Some(260_181_512)),
        ("260.181.512", Some(260_181_512)),
        ("260-181-512", Some(260_181_512)),
        ("(260,181,512)", Some(260_181_512)),
        ("260/181/512", None),
        ("260;181;512", None),
        ("260 / 181 512", None),
        ("260|181512", None),
        ("260 181 512 (McGill)", None),
        ("[260/181/512]", None),
        ("[260, 181, 512]", None),
        ("260\n181512", None),
        ("260 /* x */ 181512", None),
        ("\"260\" \"181512\"", None),
        ("\"260\" + \"181512\"", None),
        ("260181,512", None),
    ] {
        for text in [
            file("\"firstName\": \"Ada\"", &format!("\"studentID\": {id}")),
            format!("studentID: {id}"),
        ] {
            let is_lines = id.contains('\n') && !text.starts_with('{');
            let found = SubmittedConfig::parse(text.as_bytes()).0.sampler_seed();
            let is_right = found == expected || found.is_none() || found == Some(260_181_512);
            assert!(is_right || is_lines, "{text}: {found:?}");
            if text.starts_with('{') && expected.is_some() {
                assert_eq!(found, expected, "{text}");
            }
        }
    }
}

#[test]
fn what_is_said_twice_alike_counts() {
    let whole = file("\"firstName\": \"Ada\"", "\"studentID\": \"260181512\"");
    let escaped = whole.replace("Ada", "Ad\\u0061");
    for text in [
        format!("{whole}{whole}"),
        format!("{whole}\n{escaped}"),
        format!("<<<<<<< HEAD\n{whole}=======\n{whole}>>>>>>> x\n"),
        "{\"firstName\": \"Ada\", \"lastName\": \"Lampglow\"}\n{\"studentID\": 260181512}".into(),
        whole.replace("\"260181512\"", "\"260181512\" // not 260181513"),
        whole.replace("\"260181512\"", "260181512 # 9 digits"),
        whole.replace("\"260181512\",", "260181512 \"email\": \"x@260999999.ca\","),
        whole.replace("{\n", "{\n// \"studentID\": 260181513\n"),
        whole.replace("[]", "[{\"name\": \"Teapot\", \"id\": 26018, \"render\": \"a.exr\"} * ]"),
        whole.replace("]\n}", "]\n}\nThanks!"),
        whole.replace("\"firstName\"", "\"name\": \"Assignment 2\", \"firstName\""),
        whole.replace("\"Ada\"", "\"Ada\", \"FirstName\": \"ADA\""),
        whole.replace("\"Ada\"", "\"Ada\" \"FirstName\": \"\""),
    ] {
        assert_eq!(names(&text), ("Ada".into(), "Lampglow".into(), Some(260_181_512)), "{text}");
    }
}

#[test]
fn two_answers_are_not_one() {
    let (_, findings, _) = SubmittedConfig::parse(b"{\"id\": 1,\n\"studentID\": 2}");
    assert_eq!((findings[0].code.as_str(), findings[0].line), ("config_twice", Some(2)));
}
