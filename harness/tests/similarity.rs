//! Sources that are alike, through the real binary: equal files found by Umbra, near ones read from a result of
//! JPlag's, both side by side for the instructor and unseen by students.

#![cfg(unix)]

use std::fs;
use std::path::Path;

use serde_json::json;
use similar_asserts::assert_eq;

use crate::downloads::{LATE, Place, config, zip};

/// An integrator of somebody's own, long enough to be nobody else's by chance.
fn integrator(word: &str) -> String {
    let line = |n: usize| format!("    let {word}_{n} = scene.light({n}).intensity();\n");
    format!("fn radiance() {{\n{}}}\n", (0..30).map(line).collect::<String>())
}

fn submission(config: &str, source: &str) -> Vec<u8> {
    zip(&[
        ("config.json".to_owned(), config.as_bytes()),
        ("src/lib.rs".to_owned(), b"fn main() { not_rust }"),
        ("src/integrators/simple.rs".to_owned(), source.as_bytes()),
        ("src/shaders/diffuse.fs.wgsl".to_owned(), b"// <script>alert(1)</script>\n"),
    ])
}

/// A result as JPlag 6 lays it out.
fn jplag(first: &str, second: &str) -> Vec<u8> {
    let file = format!("{first}-{second}.json");
    let at = |line: usize| json!({"line": line, "column": 1, "tokenListIndex": 10 * line});
    let mappings = json!({
        "submissionIds": {first: first, second: second},
        "submissionIdsToComparisonFileName": {first: {second: file}, second: {first: file}},
    });
    let comparison = json!({
        "firstSubmissionId": first, "secondSubmissionId": second,
        "similarities": {"AVG": 0.91, "MAX": 0.93, "LONGEST_MATCH": 120, "MAXIMUM_LENGTH": 200},
        "matches": [{
            "firstFileName": format!("{first}/src/integrators/simple.rs"),
            "secondFileName": format!("{second}/src/integrators/simple.rs"),
            "startInFirst": at(5), "endInFirst": at(20), "startInSecond": at(6), "endInSecond": at(21),
            "lengthOfFirst": 120, "lengthOfSecond": 120,
        }],
        "firstSimilarity": 0.9, "secondSimilarity": 0.92,
    });
    zip(&[
        ("submissionMappings.json".to_owned(), mappings.to_string().as_bytes()),
        (format!("comparisons/{file}"), comparison.to_string().as_bytes()),
    ])
}

#[test]
fn what_is_alike_is_shown_side_by_side_to_the_instructor_alone() {
    let place = Place::new();
    let root = place.assignment(LATE);
    let copy = integrator("ann").replace(" = ", "=").replace("fn", "// mine\nfn");
    for (name, number, source) in [
        ("Ann", "0260000001", integrator("ann")),
        ("Bob", "0260000002", copy),
        ("Cy", "0260000003", integrator("cy")),
    ] {
        let bytes = submission(&config(name, "Lee", number), &source);
        place.put(&format!("class/{}.zip", name.to_lowercase()), &bytes);
    }
    place.grade(&root, &["class"]);
    let read = |name: &str| fs::read_to_string(place.at(name)).unwrap();
    let umbra = |arguments: &[&str]| {
        let fixed = ["--report", "out", "--root", root.to_str().unwrap()];
        let (code, said, errors) = place.run(&[&["likeness"], arguments, &fixed].concat());
        (code, said + &errors)
    };
    let own = Path::new("out/instructor/likeness");

    // A result before there are sources for it has nothing to be shown with.
    fs::write(place.at("result.jplag"), jplag("cy", "ann")).unwrap();
    let (code, said) = umbra(&["result.jplag"]);
    assert!(code == Some(2) && said.contains("no sources were written"), "{said}");

    let (code, said) = umbra(&[]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("java -jar jplag.jar -l rust -bc out/instructor/likeness/template "));
    assert!(said.contains("1 pair side by side, 1 of them to be looked at"), "{said}");
    let source = own.join("submissions/cy/src/integrators/simple.rs");
    assert_eq!(read(source.to_str().unwrap()), integrator("cy"));
    assert!(place.at("out/instructor/likeness/template/src/bsdfs/phong.rs").is_file());
    let page = read("out/instructor/likeness/ann--bob.html");
    assert!(page.contains("1 file the same but for comments"), "{page}");
    assert!(page.contains("// &lt;script&gt;alert(1)&lt;/script&gt;") && !page.contains("<script"));
    assert_eq!(page.matches("<mark>").count(), 32 + 33, "{page}");

    let (code, said) = umbra(&["result.jplag"]);
    assert_eq!(code, Some(0), "{said}");
    assert!(said.contains("2 pairs side by side, 2 of them to be looked at"), "{said}");
    let page = read("out/instructor/likeness/ann--cy.html");
    // The result names Cy first.
    assert!(page.contains("91 % of the tokens match (JPlag)"), "{page}");
    assert_eq!(page.matches("<mark>").count(), 16 + 16, "{page}");
    assert!(
        page.contains("<a class=\"passage\" id=\"a1\" href=\"#b1\">1</a><mark><i>   6 "),
        "{page}"
    );
    let list = read("out/instructor/likeness/report.html");
    assert!(list.contains("Ann Lee and Bob Lee") && list.contains("91 %"), "{list}");
    // The class page leads there, the instructor's page of each says it, and no student's does.
    assert!(read("out/report.html").contains("./instructor/likeness/report.html"));
    assert!(read("out/instructor/cy/report.html").contains("91 % of the tokens match ann (JPlag)"));
    for student in ["ann", "bob", "cy"] {
        let page = read(&format!("out/{student}/report.html"));
        assert!(!page.contains("JPlag") && !page.contains("another submission"), "{page}");
    }

    // It stays when the class is graded again, and goes when a source is another one.
    place.grade(&root, &["class"]);
    assert!(read("out/instructor/cy/report.html").contains("91 % of the tokens match ann"));
    let bytes = submission(&config("Cy", "Lee", "0260000003"), &integrator("own"));
    place.put("class/cy.zip", &bytes);
    place.grade(&root, &["class"]);
    assert!(!read("out/instructor/cy/report.html").contains("of the tokens match"));
    let (code, said) = umbra(&[]);
    assert!(code == Some(0) && said.contains("1 pair side by side"), "{said}");
    assert!(said.contains("1 pair of JPlag's is of sources that changed since"), "{said}");
    assert!(!place.at("out/instructor/likeness/ann--cy.html").exists());
    assert!(!read("out/instructor/cy/report.html").contains("of the tokens match"));

    // A result of other submissions is none of this class.
    fs::write(place.at("result.jplag"), jplag("eve", "ann")).unwrap();
    let (code, said) = umbra(&["result.jplag"]);
    assert!(code == Some(2) && said.contains("result.jplag: compares eve, expected"), "{said}");
    let (code, said) = umbra(&["class/ann.zip"]);
    assert!(code == Some(2) && said.contains("found neither"), "{said}");
}
