//! The main job from outside: the real binary grades the real archives, and every sample is worth
//! what its recipe says.
//!
//! Slow samples, which wait for time limits, are left out; `umbra grade` on them says the same.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

/// What a total or a part may be worth: a number, or bounds.
#[derive(Clone, Copy, Debug)]
struct Range {
    min: f64,
    max: f64,
}

/// The `[expect]` table of a recipe.
#[derive(Debug, Default)]
struct Expect {
    total: Option<Range>,
    parts: BTreeMap<String, Range>,
}

#[test]
#[ignore = "a minute or two: `./run test` asks for it"]
fn every_sample_is_worth_what_its_recipe_says() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap();
    let xtask = Path::new(env!("CARGO_BIN_EXE_xtask"));
    let umbra = xtask.with_file_name(format!("umbra{}", std::env::consts::EXE_SUFFIX));
    let packed = run(Command::new(xtask).arg("samples").current_dir(root));
    let archives: Vec<PathBuf> =
        String::from_utf8(packed.stdout).unwrap().lines().map(PathBuf::from).collect();

    let (mut expected, mut graded) = (BTreeMap::new(), Vec::new());
    for archive in archives {
        let file = archive.file_name().unwrap().to_str().unwrap().to_owned();
        let name = file.split('.').next().unwrap();
        let recipe = std::fs::read_to_string(root.join("samples").join(name).join("recipe.toml"));
        let recipe: toml::Table = recipe.unwrap().parse().unwrap();
        if recipe.get("slow").and_then(toml::Value::as_bool) == Some(true) {
            println!("{name}: left out, it waits for time limits");
            continue;
        }
        expected.insert(file, expect(&recipe));
        graded.push(archive);
    }
    assert!(graded.len() >= 8, "only {} samples are graded", graded.len());

    let out = Path::new(env!("CARGO_TARGET_TMPDIR")).join("samples-report");
    let mut grade = Command::new(&umbra);
    grade.arg("grade").args(&graded).arg("--output").arg(&out).arg("--root").arg(root);
    let printed = run(&mut grade);
    let report = std::fs::read(out.join("report.json")).unwrap();
    let report: Value = serde_json::from_slice(&report).unwrap();
    let hand_ins = report["hand_ins"].as_array().unwrap();
    assert_eq!(hand_ins.len(), graded.len());

    let mut wrong = Vec::new();
    for hand_in in hand_ins {
        let name = hand_in["name"].as_str().unwrap();
        let expect = expected.remove(name).unwrap_or_else(|| panic!("{name} was never handed in"));
        assert!(expect.total.is_some() || !expect.parts.is_empty(), "{name}: nothing is expected");
        if let Some(range) = expect.total {
            wrong.extend(compare(name, "total", hand_in, range));
        }
        for (id, range) in expect.parts {
            let parts = hand_in["parts"].as_array().unwrap();
            let part = parts.iter().find(|part| part["id"] == id.as_str());
            let part = part.unwrap_or_else(|| panic!("{name}: there is no part {id}"));
            wrong.extend(compare(name, &id, part, range));
        }
    }
    let table = String::from_utf8_lossy(&printed.stdout);
    assert!(wrong.is_empty(), "{}\n{table}\nreport: {}", wrong.join("\n"), out.display());
}

/// What is wrong with the points of a part or a total, if anything.
fn compare(name: &str, what: &str, earned: &Value, Range { min, max }: Range) -> Option<String> {
    let (least, most) =
        (earned["points"].as_f64().unwrap(), earned["points_max"].as_f64().unwrap());
    let fits = least >= min - 5e-3 && most <= max + 5e-3;
    let reason = earned["reason"].as_str().unwrap_or_default();
    (!fits).then(|| {
        format!("{name}: {what}: expected {min} to {max}, found {least} to {most}: {reason}")
    })
}

fn expect(recipe: &toml::Table) -> Expect {
    let table = recipe["expect"].as_table().unwrap();
    let mut expect = Expect::default();
    for (key, value) in table {
        match key.as_str() {
            "total" => expect.total = Some(range(value)),
            "parts" => {
                let parts = value.as_table().unwrap().iter();
                expect.parts = parts.map(|(id, value)| (id.clone(), range(value))).collect();
            }
            other => panic!("[expect]: unknown key {other}"),
        }
    }
    expect
}

fn range(value: &toml::Value) -> Range {
    let number = |value: &toml::Value| {
        let integer = value.as_integer().map(|points| points as f64);
        integer.or(value.as_float()).unwrap_or_else(|| panic!("[expect]: {value} is no number"))
    };
    match value {
        toml::Value::Table(bounds) => {
            assert!(bounds.keys().all(|key| key == "min" || key == "max"), "[expect]: {bounds}");
            Range {
                min: bounds.get("min").map_or(0.0, number),
                max: bounds.get("max").map_or(f64::INFINITY, number),
            }
        }
        exact => Range { min: number(exact), max: number(exact) },
    }
}

/// Runs a program to its end, which must be a good one.
fn run(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {}\n{said}", output.status);
    output
}
