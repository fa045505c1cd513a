use super::*;

fn codes(text: &str) -> Vec<String> {
    let warning = |f: &Finding| {
        assert_eq!(f.severity, crate::intake::Severity::Warning, "{f}");
        format!("{}@{}", f.code, f.line.unwrap_or(0))
    };
    parse(text.as_bytes()).findings.iter().map(warning).collect()
}

/// The members of an object that are texts or numbers.
fn members(bytes: &[u8]) -> Vec<(String, String)> {
    let Some(Node { value: Value::Object(members), .. }) = parse(bytes).node else {
        panic!("an object in {bytes:?}")
    };
    let text = |(key, _, node): &(String, u32, Node)| match &node.value {
        Value::Text(text) | Value::Number(text) => Some((key.clone(), text.clone())),
        _ => None,
    };
    members.iter().filter_map(text).collect()
}

fn pairs(expected: &[(&str, &str)]) -> Vec<(String, String)> {
    expected.iter().map(|(a, b)| ((*a).to_owned(), (*b).to_owned())).collect()
}

#[test]
fn what_is_slightly_wrong_is_read_all_the_same() {
    let expected = pairs(&[("a", "x"), ("b", "26")]);
    for text in [
        "{'a': 'x', 'b': 26}",
        "{\u{201c}a\u{201d}: \u{201c}x\u{201d}, \u{201e}b\u{201c}: 26}",
        "{\u{2018}a\u{2019}: \u{ab}x\u{bb}, `b`: 26}",
        "{a: x, b: 26}",
        "{a\": \"x\", \"b\": 26}",
        "{\"a\" = \"x\"; \"b\" => 26}",
        "{\"a\" \"x\",, \"b\" 26,}",
        "{\"a\": \"x\" \"b\": 26",
        "{\"a\": \"x,\n\"b\": 26}",
        "{\"a\": \"x\", \"b\": 26,\n*** }",
        "{\"a\": \"x\", \"b\": 26} trailing",
        "{\"a\": \"x\", // one\n\"b\": 26 /* two */}",
        "// old Mac\r{\"a\": \"x\",\r\"b\": 26}",
    ] {
        assert_eq!(members(text.as_bytes()), expected, "{text}");
        assert!(!codes(text).is_empty(), "{text}");
    }
    assert_eq!(members(b"{\"b\": 260 123 456}"), pairs(&[("b", "260 123 456")]));
}

#[test]
fn other_encodings_are_read() {
    let text = "{\n\"a\": \"\u{e9}\"}";
    let wide = |unit: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(unit).collect::<Vec<u8>>();
    let [little, big] = [wide(u16::to_le_bytes), wide(u16::to_be_bytes)];
    let bom = |bom: &[u8], rest: &[u8]| [bom, rest].concat();
    for bytes in [
        bom(b"\xef\xbb\xbf", text.as_bytes()),
        bom(b"\xff\xfe", &little),
        bom(b"\xfe\xff", &big),
        little,
        big,
        b"{\n\"a\": \"\xe9\"}".to_vec(),
        b"{\n\x93a\x94: \x93\xe9\x94}".to_vec(),
    ] {
        assert_eq!(members(&bytes), pairs(&[("a", "\u{e9}")]), "{bytes:?}");
        assert!(!parse(&bytes).findings.is_empty());
    }
}

#[test]
fn good_json_has_no_findings_and_lines() {
    let Read { node, findings, .. } =
        parse(b"{\n \"a\": [1, -2.5e3, true, null],\n \"b\": \"x\\n\\u00e9\"\n}\n");
    assert_eq!(findings, []);
    let Some(Node { value: Value::Object(members), line: 1 }) = node else { panic!("an object") };
    assert_eq!((members[0].1, members[1].1), (2, 3));
    assert_eq!(members[1].2.value, Value::Text("x\n\u{e9}".to_owned()));
    let Value::List(items) = &members[0].2.value else { panic!("a list") };
    assert_eq!(items[1].value, Value::Number("-2.5e3".to_owned()));
}

#[test]
fn mistakes_have_code_and_line() {
    assert_eq!(codes("\u{feff}{}"), ["json_bom@1"]);
    assert_eq!(codes("{\n\"a\": 1,\n}"), ["json_trailing_comma@2"]);
    assert_eq!(codes("{\n// x\n\"a\": 1 /* y\n */ }"), ["json_comment@2", "json_comment@3"]);
    assert_eq!(codes("{\"a\": 1\n\"b\": 2}"), ["json_missing_comma@2"]);
    assert_eq!(codes("{'a': 1}"), ["json_quotes@1"]);
    assert_eq!(codes("{a: b}"), ["json_quotes@1", "json_quotes@1"]);
    assert_eq!(codes("{\n\"a\": \"b\n}"), ["json_open_text@2"]);
    assert_eq!(codes("{\"a\": 1} x"), ["json_syntax@1"]);
    assert_eq!(codes("{\"a\": \"r\\teapot\\x\"}"), ["json_escape@1"]);
    assert_eq!(codes(""), ["json_syntax@1"]);
    assert_eq!(codes(&"[".repeat(100_000)), ["json_depth@1"]);
    assert_eq!(parse(b"\xff\xfe{\0}\0").findings[0].code, "json_encoding");
    assert_eq!(parse(b"{\n\"a\": \"\xe9\"}").findings[0].line, Some(2));
}
