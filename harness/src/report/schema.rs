//! The JSON schema of `report.json`, from the types that it is written from.

use schemars::Schema;
use schemars::generate::SchemaSettings;
use schemars::transform::{RecursiveTransform, Transform};
use serde_json::json;

use super::ReportError;
use super::json::JsonReport;

/// The schema (draft 2020-12), ending with a newline. It is kept in `docs/reference/report.schema.json`.
///
/// # Errors
/// When it cannot be written as text, which no schema is.
pub fn report_schema() -> Result<String, ReportError> {
    let settings = SchemaSettings::draft2020_12().for_serialize();
    let mut schema = settings.into_generator().into_root_schema_for::<JsonReport>();
    schema.insert("title".to_owned(), json!("report.json of Umbra"));
    RecursiveTransform(perhaps_null).transform(&mut schema);
    let text = serde_json::to_string_pretty(&schema);
    let text = text.map_err(|error| ReportError::Format {
        file: "report.schema.json",
        reason: error.to_string(),
    })?;
    Ok(text + "\n")
}

/// A number that is not finite is written as `null`.
fn perhaps_null(schema: &mut Schema) {
    if schema.get("type") == Some(&json!("number")) {
        schema.insert("type".to_owned(), json!(["number", "null"]));
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use serde_json::Value;

    use super::super::{report_json, sample};
    use super::*;

    /// What a value breaks of a schema, for the words that the schema of a report uses.
    fn breaks(value: &Value, schema: &Value, root: &Value, at: &str) -> Vec<String> {
        if let Some(name) = schema["$ref"].as_str() {
            let own = root.pointer(name.trim_start_matches('#')).unwrap();
            return breaks(value, own, root, at);
        }
        for word in ["anyOf", "oneOf"] {
            if let Some(choices) = schema[word].as_array() {
                let all: Vec<_> =
                    choices.iter().map(|choice| breaks(value, choice, root, at)).collect();
                return if all.iter().any(Vec::is_empty) { Vec::new() } else { all.concat() };
            }
        }
        let mut wrong = Vec::new();
        let kind = match value {
            Value::Null => "null",
            Value::Bool(_) => "boolean",
            Value::Number(number) if number.is_u64() || number.is_i64() => "integer",
            Value::Number(_) => "number",
            Value::String(_) => "string",
            Value::Array(_) => "array",
            Value::Object(_) => "object",
        };
        let allows = |wanted: &Value| wanted == kind || (wanted == "number" && kind == "integer");
        let is_allowed = match &schema["type"] {
            Value::Array(all) => all.iter().any(allows),
            Value::Null => true,
            one => allows(one),
        };
        let is_listed = [&schema["enum"]].iter().all(|all| match all.as_array() {
            Some(all) => all.contains(value),
            None => true,
        });
        let is_const = schema.get("const").is_none_or(|only| only == value);
        if !is_allowed || !is_listed || !is_const {
            wrong.push(format!("{at}: {value} is not as {schema}"));
        }
        for name in schema["required"].as_array().into_iter().flatten() {
            if value.get(name.as_str().unwrap()).is_none() {
                wrong.push(format!("{at}: {name} is missing"));
            }
        }
        for (name, own) in value.as_object().into_iter().flatten() {
            let at = format!("{at}.{name}");
            match (schema["properties"].get(name), &schema["additionalProperties"]) {
                (Some(property), _) => wrong.extend(breaks(own, property, root, &at)),
                (None, Value::Object(rest)) => {
                    wrong.extend(breaks(own, &Value::Object(rest.clone()), root, &at));
                }
                (None, _) => wrong.push(format!("{at}: not in the schema")),
            }
        }
        for own in value.as_array().into_iter().flatten() {
            wrong.extend(breaks(own, &schema["items"], root, &format!("{at}[]")));
        }
        wrong
    }

    #[test]
    fn it_is_as_it_is_published() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let kept = folder.join("docs/reference/report.schema.json");
        let schema = report_schema().unwrap();
        if std::fs::read_to_string(&kept).ok().as_deref() != Some(&schema) {
            let new = folder.join("target/umbra/report.schema.json");
            std::fs::write(&new, schema).unwrap();
            panic!("the keys of report.json have changed; if that is wanted:\ncp {new:?} {kept:?}");
        }
    }

    #[test]
    fn reports_conform_and_others_do_not() {
        let schema: Value = serde_json::from_str(&report_schema().unwrap()).unwrap();
        let mut report = sample::report();
        report.entries[0].record.evidence.checks[0].error = f64::NAN;
        report.class = Some(crate::class::Class {
            missing: vec![crate::class::Missing {
                student: crate::class::ListedStudent::default(),
                reason: String::new(),
            }],
            ..crate::class::Class::default()
        });
        let mut report: Value = serde_json::from_str(&report_json(&report).unwrap()).unwrap();
        assert_eq!(breaks(&report, &schema, &schema, ""), [""; 0]);
        report["submissions"][0]["points"] = json!("many");
        report["submissions"][1]["parts"][0]["bonus"] = Value::Null;
        report["submissions"][2]["checks"][0]["verdict"] = json!("perhaps");
        report["class"]["kind"] = json!("Paper");
        report["class"]["more"] = json!(1);
        report["assignment"].as_object_mut().unwrap().remove("due");
        let wrong = breaks(&report, &schema, &schema, "").join("\n");
        for at in
            [".points: ", ".bonus: ", ".verdict: ", ".kind: ", ".more: ", "\"due\" is missing"]
        {
            assert!(wrong.contains(at), "{at}: {wrong}");
        }
    }
}
