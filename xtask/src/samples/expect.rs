//! What a sample is worth: the `[expect]` table of its recipe, and its comparison with a report.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde_json::Value;
use umbra::evidence::{Check, Evidence};
use umbra::rubric::{self, Rules};

/// What a total and the parts are worth; a part that is not named may have any points.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expect {
    total: Option<Range>,
    /// What its images alone are worth once the instructor confirms.
    unconfirmed: Option<Range>,
    /// The total on the public scenes alone.
    public: Option<Range>,
    #[serde(default)]
    parts: BTreeMap<String, Range>,
    /// The known mistake that each part looks like, by part; no other part looks like any.
    diagnosis: Option<BTreeMap<String, String>>,
}

/// Points: a number, or bounds with either left out.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum Range {
    Exactly(f64),
    Between { min: Option<f64>, max: Option<f64> },
}

impl Range {
    fn bounds(self) -> (f64, f64) {
        match self {
            Self::Exactly(points) => (points, points),
            Self::Between { min, max } => (min.unwrap_or(0.0), max.unwrap_or(f64::INFINITY)),
        }
    }
}

impl Expect {
    /// Whether some part of it must look like a known mistake.
    pub fn is_known_mistake(&self) -> bool {
        self.diagnosis.iter().flatten().any(|(part, _)| !part.is_empty())
    }

    /// What differs in a submission's entry of `report.json`; empty when nothing does.
    pub fn complaint(&self, submission: &Value, rules: &Rules) -> String {
        if self.total.is_none() && self.parts.is_empty() {
            return "its recipe expects nothing".into();
        }
        let mut complaints = Vec::new();
        if let Some(range) = self.total {
            complaints.extend(compare("total", submission, range));
        }
        if let Some(range) = self.unconfirmed {
            let points = &submission["unconfirmed"];
            let earned = serde_json::json!({ "points": points, "points_max": points });
            complaints.extend(compare("unconfirmed", &earned, range));
        }
        if let Some(range) = self.public {
            match serde_json::from_value::<Vec<Check>>(submission["checks"].clone()) {
                Ok(mut checks) => {
                    checks.retain(|check| !check.held_back);
                    let grade = rubric::grade(rules, &Evidence { checks });
                    let public = serde_json::json!({
                        "points": grade.points, "points_max": grade.points_max
                    });
                    complaints.extend(compare("total on the public scenes", &public, range));
                }
                Err(error) => complaints.push(format!("the report's checks: {error}")),
            }
        }
        for (id, range) in &self.parts {
            let parts = submission["parts"].as_array();
            match parts.and_then(|parts| parts.iter().find(|part| part["id"] == id.as_str())) {
                Some(part) => complaints.extend(compare(id, part, *range)),
                None => complaints.push(format!("the report has no part {id}")),
            }
        }
        if let Some(expected) = &self.diagnosis {
            complaints.extend(compare_diagnoses(expected, submission));
        }
        complaints.join("; ")
    }
}

/// What is wrong with the points of a part or a total, if anything.
fn compare(what: &str, earned: &Value, range: Range) -> Option<String> {
    let (min, max) = range.bounds();
    let points = |key: &str| earned[key].as_f64().unwrap_or(f64::NAN);
    let (least, most) = (points("points"), points("points_max"));
    let fits = least >= min - 5e-3 && most <= max + 5e-3;
    let reason = earned["reason"].as_str().unwrap_or_default();
    (!fits).then(|| format!("{what}: expected {min} to {max}, found {least} to {most} ({reason})"))
}

/// What is wrong with what a submission is said to look like, if anything.
fn compare_diagnoses(expected: &BTreeMap<String, String>, submission: &Value) -> Option<String> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let found = submission["diagnoses"].as_array().map_or(&[][..], Vec::as_slice);
    let names = |found: &Value| found["mistakes"].as_array().cloned().unwrap_or_default();
    let fits = |found: &Value| match (expected.get(&text(&found["part"])), &names(found)[..]) {
        // Names that cannot be told apart stand together.
        (Some(known), [Value::Array(alike)]) => alike.iter().any(|name| name == known),
        _ => false,
    };
    let said =
        found.iter().map(|found| format!("{}: {}", text(&found["part"]), text(&found["words"])));
    (found.len() != expected.len() || !found.iter().all(fits)).then(|| {
        let said = said.collect::<Vec<_>>().join("; ");
        format!("expected to look like {expected:?}, found to look like {{{said}}}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rules() -> Rules {
        let text = r#"{"curve": [[0, 0.9], [1, 0]], "images_only_ceiling": 0.5, "gates": [], "paths": {},
            "parts": [{"id": "1.1", "title": "", "points": 5, "evidence": ["bsdf.diffuse"]}]}"#;
        serde_json::from_str(text).unwrap()
    }

    #[test]
    fn the_public_total_leaves_held_back_scenes_out() {
        let check = |held_back: bool, verdict: &str| {
            serde_json::json!({
                "id": "bsdf.diffuse", "scene": "s", "verdict": verdict, "error": 1.0, "summary": "",
                "held_back": held_back, "hint": "", "measures": [], "pictures": []
            })
        };
        let build = serde_json::json!({
            "id": "submission.build", "scene": "", "held_back": false, "verdict": "pass", "error": 0.0, "summary": "",
            "hint": "", "measures": [], "pictures": []
        });
        let checks = [build, check(false, "pass"), check(true, "fail")];
        let report = serde_json::json!({ "points": 0.0, "points_max": 0.0, "checks": checks });
        let expect = |text: &str| toml::from_str::<Expect>(text).unwrap();
        assert_eq!(expect("total = 0\npublic = 5").complaint(&report, &rules()), "");
        let wrong = expect("total = 0\npublic = 0").complaint(&report, &rules());
        assert!(
            wrong.starts_with("total on the public scenes: expected 0 to 0, found 5"),
            "{wrong}"
        );
    }

    #[test]
    fn points_outside_of_what_is_expected_are_a_complaint() {
        let rules = rules();
        let text = r#"
            total = 55
            parts = { "1.1" = 5, "2.4" = { max = 24.9 }, "2.5" = { min = 1, max = 2 } }
        "#;
        let expect: Expect = toml::from_str(text).unwrap();
        let report = |total: f64, phong: f64, least: f64| {
            serde_json::json!({
                "points": total, "points_max": total,
                "parts": [
                    { "id": "1.1", "points": 5.0, "points_max": 5.0, "reason": "" },
                    { "id": "2.4", "points": phong, "points_max": phong, "reason": "" },
                    { "id": "2.5", "points": least, "points_max": 2.0, "reason": "a range" },
                ],
            })
        };
        assert_eq!(expect.complaint(&report(55.0, 24.0, 1.5), &rules), "");
        assert!(
            expect
                .complaint(&report(54.9, 24.0, 1.5), &rules)
                .starts_with("total: expected 55 to 55")
        );
        assert!(
            expect
                .complaint(&report(55.0, 25.0, 1.5), &rules)
                .starts_with("2.4: expected 0 to 24.9")
        );
        assert!(
            expect.complaint(&report(55.0, 24.0, 0.5), &rules).contains("found 0.5 to 2 (a range)")
        );
        let images: Expect = toml::from_str("total = 55\nunconfirmed = 12.5").unwrap();
        let mut alone = report(55.0, 24.0, 1.5);
        assert!(images.complaint(&alone, &rules).contains("unconfirmed: expected 12.5"));
        alone["unconfirmed"] = 12.5.into();
        assert_eq!(images.complaint(&alone, &rules), "");
        let nothing = serde_json::json!({ "points": 55.0, "points_max": 55.0, "parts": [] });
        assert!(expect.complaint(&nothing, &rules).contains("no part 1.1"));
        assert!(expect.complaint(&Value::Null, &rules).contains("NaN"));
    }

    #[test]
    fn what_it_looks_like_is_expected_exactly() {
        let text = "total = 1\ndiagnosis = { \"1.3\" = \"a\" }";
        let expect: Expect = toml::from_str(text).unwrap();
        let silent: Expect = toml::from_str("total = 1\ndiagnosis = {}").unwrap();
        let said = |diagnoses: Value| {
            let report =
                serde_json::json!({ "points": 1.0, "points_max": 1.0, "diagnoses": diagnoses });
            [&expect, &silent].map(|expect| expect.complaint(&report, &rules()).is_empty())
        };
        let one = |part: &str, mistakes: Value| serde_json::json!({ "part": part, "mistakes": mistakes, "words": "w" });
        let right = one("1.3", serde_json::json!([["b", "a"]]));
        assert_eq!(said(serde_json::json!([right])), [true, false]);
        assert_eq!(said(serde_json::json!([])), [false, true]);
        assert_eq!(said(serde_json::json!([right, right])), [false, false]);
        for wrong in [
            one("1.3", serde_json::json!([["b"]])),
            one("1.4", serde_json::json!([["a"]])),
            one("1.3", serde_json::json!([["a"], ["b"]])),
        ] {
            assert_eq!(said(serde_json::json!([wrong])), [false, false]);
        }
    }

    #[test]
    fn an_expectation_says_something_and_nothing_unknown() {
        let empty: Expect = toml::from_str("").unwrap();
        assert!(!empty.complaint(&Value::Null, &rules()).is_empty());
        for wrong in ["totl = 3", "total = \"3\"", "total = { least = 3 }"] {
            assert!(toml::from_str::<Expect>(wrong).is_err(), "{wrong}");
        }
    }
}
