use super::*;

#[test]
fn a_verdict_is_green_only_where_nothing_is_wrong() {
    use crate::intake::Finding;
    let part = |id: &str, bonus: bool, points: f64, reason: &str| PartGrade {
        id: id.into(),
        title: id.into(),
        out_of: 10.0,
        bonus,
        points,
        points_max: points,
        unconfirmed: 0.0,
        reason: reason.into(),
        evidence: Vec::new(),
    };
    let row = |parts: Vec<PartGrade>, diagnostics: &str| ReportRow {
        name: "work".into(),
        slug: "work".into(),
        digest: String::new(),
        points: parts.iter().map(|part| part.points).sum(),
        points_max: parts.iter().map(|part| part.points_max).sum(),
        unconfirmed: 0.0,
        out_of: 20.0,
        remarks: Vec::new(),
        parts,
        standing: crate::class::Standing::default(),
        diagnostics: diagnostics.into(),
        findings: Vec::new(),
    };
    let told = |parts, diagnostics| verdict(&row(parts, diagnostics), true);
    let full = || vec![part("1.1", false, 10.0, ""), part("1.2", false, 10.0, "")];
    let (stage, short, _) = told(full(), "");
    assert_eq!((stage, short.as_str()), (CheckState::Done, "20 of 20 points"));
    // A bonus that nobody tried for is nothing lost; one that was begun is.
    let bonus = |points| [full(), vec![part("2.5", true, points, "the map is black")]].concat();
    assert_eq!(told(bonus(0.0), "").0, CheckState::Done);
    let (stage, _, words) = told(bonus(4.0), "");
    assert_eq!(
        (stage, words.as_str()),
        (CheckState::Lost, "20 of 20 points, 4 of 10 bonus points. 2.5: the map is black")
    );
    let (stage, short, words) =
        told(full(), "\nerror[E0308]: mismatched types\n --> src/lib.rs:7:1\n  |");
    assert_eq!((stage, short.as_str()), (CheckState::Refused, "does not compile"));
    assert_eq!(words, "src/lib.rs:7:1: error[E0308]: mismatched types (20 of 20 points)");
    let (_, _, words) = told(full(), "phong.fs.wgsl:3:1: expected `;`\n3 | let x");
    assert!(words.starts_with("phong.fs.wgsl:3:1: expected"), "{words}");
    // What cannot be submitted is not right, whatever its points.
    let mut broken = row(full(), "");
    broken.findings = vec![
        Finding::warning("w", "a slip"),
        Finding::error("e", "the text has no closing quote").at("config.json").on_line(9),
    ];
    assert_eq!(verdict(&broken, false).0, CheckState::Done, "of a part alone");
    let (stage, short, words) = verdict(&broken, true);
    assert_eq!(
        (stage, short.as_str()),
        (CheckState::Unready, "20 of 20 points, not ready to submit")
    );
    assert_eq!(words, "20 of 20 points. config.json:9: the text has no closing quote");
    let lost = vec![part("1.1", false, 0.0, "it panics"), part("1.2", false, 1.0, "dark")];
    let (_, _, words) = told(lost, "");
    assert_eq!(words, "1 of 20 points. 1.1: it panics, and 1 other part lost points too");
    let nothing =
        || vec![part("1.1", false, 0.0, "there is no code"), part("1.2", false, 0.0, "no")];
    let mut bare = row(nothing(), "");
    bare.remarks = vec!["config.json has a slip".into(), "there is no src/lib.rs".into()];
    assert_eq!(verdict(&bare, true).2, "0 of 20 points. there is no src/lib.rs");
    assert_eq!(
        told(nothing(), "").2,
        "0 of 20 points. 1.1: there is no code, and 1 other part lost points too"
    );
}
