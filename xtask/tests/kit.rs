//! The student's kit: it gives nothing away, and lacks nothing that checking one's own work needs.

#![allow(clippy::unwrap_used)] // its helpers are tests too

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;
use umbra::assignment::Assignment;
use umbra::grading::PreparedScene;
use umbra::store::Store;
use umbra::worker::Supervisor;

/// So many lines in a row that the reference has too, most of them not the template's, are no chance.
const BLOCK: usize = 5;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// The kit, made anew in a folder of its own.
fn make(name: &str) -> PathBuf {
    let kit = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    if kit.exists() {
        std::fs::remove_dir_all(&kit).unwrap();
    }
    let mut xtask = Command::new(env!("CARGO_BIN_EXE_xtask"));
    run(xtask.args(["dist", "student"]).arg(&kit).current_dir(root()));
    kit
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{command:?}: {}\n{said}", output.status);
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// All files below a folder that hold text, with it.
fn texts(folder: &Path) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in folder.read_dir().unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else if let Ok(text) = std::fs::read_to_string(&path) {
                found.push((path, text));
            }
        }
    }
    found
}

/// The lines that say something: no comments, imports or lone brackets.
fn lines(text: &str) -> Vec<&str> {
    let says = |line: &&str| {
        let letters = line.chars().filter(|c| c.is_alphanumeric()).count();
        letters > 5 && !line.starts_with("//") && !line.starts_with("use ")
    };
    text.lines().map(str::trim).filter(says).collect()
}

/// Every run of [`BLOCK`] lines most of which `given` lacks.
fn blocks(text: &str, given: &HashSet<&str>) -> Vec<String> {
    let lines = lines(text);
    let own =
        |block: &&[&str]| 2 * block.iter().filter(|line| !given.contains(*line)).count() > BLOCK;
    lines.windows(BLOCK).filter(own).map(|block| block.join("\n")).collect()
}

#[test]
#[ignore = "some seconds, after the expected images are made: `./run test` asks for it"]
fn the_kit_is_whole_and_holds_nothing_of_the_reference() {
    let kit = make("kit");

    // What students start from shows much of the reference: it was made from it.
    let template = texts(&root().join("student_template"));
    let given: HashSet<&str> = template.iter().flat_map(|(_, text)| lines(text)).collect();
    let reference = texts(&root().join("reference_impl/src"));
    let own: HashSet<String> =
        reference.iter().flat_map(|(_, text)| blocks(text, &given)).collect();
    assert!(own.len() > 300, "only {} blocks tell the reference", own.len());
    let files = texts(&kit);
    assert!(files.len() > 80, "only {} files", files.len());
    for (path, text) in &files {
        let shared = blocks(text, &given).into_iter().find(|block| own.contains(block));
        assert!(shared.is_none(), "{}:\n{}", path.display(), shared.unwrap());
        let name = path.strip_prefix(&kit).unwrap().display().to_string();
        assert!(!name.contains("reference_impl") && !name.contains("xtask"), "{name}");
    }

    let umbra = std::fs::read(kit.join("umbra")).unwrap();
    let holds = |bytes: &[u8]| umbra.windows(bytes.len()).any(|window| window == bytes);
    assert!(holds(b"Samples per pixel, offline"), "the program's texts are not found at all");
    assert!(!holds(b"14reference_impl"), "a symbol of the reference");
    for (path, text) in reference.iter().filter(|(path, _)| path.extension().unwrap() == "wgsl") {
        if lines(text).iter().any(|line| !given.contains(line)) {
            assert!(!holds(text.trim().as_bytes()), "the shader {}", path.display());
        }
    }

    // The lock file fits, and holds only what the repository's holds.
    let mut tree = Command::new("cargo");
    run(tree.args(["tree", "--locked", "--offline", "--workspace"]).current_dir(&kit));
    let lock = |folder: &Path| {
        let text = std::fs::read_to_string(folder.join("Cargo.lock")).unwrap();
        let packages = text.split("[[package]]").skip(1).map(|package| {
            let lines = package.trim().lines().take_while(|line| !line.starts_with("dependencies"));
            lines.collect::<Vec<_>>().join("\n")
        });
        packages.collect::<HashSet<String>>()
    };
    let (ours, theirs) = (lock(root()), lock(&kit));
    assert!(theirs.is_subset(&ours) && theirs.len() > 50, "{:?}", theirs.difference(&ours));
    for package in ["reference_impl", "xtask"] {
        let name = format!("name = \"{package}\"");
        assert!(!theirs.iter().any(|other| other.contains(&name)), "{package} is locked");
    }

    // Everything that is expected is there, and is what the grader expects.
    let scratch = tempfile::tempdir().unwrap();
    let supervisor =
        Supervisor::available(root().join("target/release/umbra"), scratch.path().to_owned());
    let assignments = [&kit, root()].map(|folder| Assignment::load(folder).unwrap());
    let [here, there] = assignments.each_ref().map(|assignment| Store {
        assignment,
        reference: None,
        supervisor: &supervisor,
        threads: 1,
        progress: &|_| (),
    });
    for entry in &assignments[0].scenes {
        let [a, b] = [&here, &there].map(|store| PreparedScene::new(store, entry).unwrap());
        let name = &entry.name;
        assert!(a.expected.offline.mean == b.expected.offline.mean, "{name}: mean");
        assert!(a.expected.offline.variance == b.expected.offline.variance, "{name}: variance");
        assert!(a.expected.offline.center == b.expected.offline.center, "{name}: centre");
        assert!(a.expected.offline.mask == b.expected.offline.mask, "{name}: mask");
        assert!(a.expected.unshadowed == b.expected.unshadowed, "{name}: unshadowed");
        assert!(
            a.expected.interpolated_normals == b.expected.interpolated_normals,
            "{name}: raw normals"
        );
        assert!(a.probe_film.unshadowed == b.probe_film.unshadowed, "{name}: small film");
        assert!(
            a.probe_film.interpolated_normals == b.probe_film.interpolated_normals,
            "{name}: small film, raw normals"
        );
    }
}

/// The kit after its first build.
#[cfg(unix)]
fn make_built(name: &str) -> PathBuf {
    let kit = make(name);
    // Dependencies need not be compiled once more; all else of `target` is the kit's own.
    let (built, release) = (root().join("target/release"), kit.join("target/release"));
    std::fs::create_dir_all(&release).unwrap();
    for folder in ["deps", "build", ".fingerprint"] {
        std::os::unix::fs::symlink(built.join(folder), release.join(folder)).unwrap();
    }
    run(Command::new("cargo").args(["build", "--release"]).current_dir(&kit));
    kit
}

/// What a student does: part after part, in place, each checked when it is done.
#[cfg(unix)]
#[test]
#[ignore = "minutes: compiles the kit, and checks it ten times"]
fn parts_that_are_solved_in_place_one_by_one_count_at_once() {
    let kit = make_built("kit-solved");
    let own = kit.join("student_template/src");
    let solved = |file: &str| {
        std::fs::read_to_string(root().join("samples/perfect/src").join(file)).unwrap()
    };
    let put = |file: &str, text: &str| std::fs::write(own.join(file), text).unwrap();
    // The first task has no points: the README says what to write.
    let readme = std::fs::read_to_string(kit.join("student_template/README.md")).unwrap();
    let line = "let sampler = Sampler::new(job.seed + y as u64);";
    assert!(readme.contains(line), "the README lacks `{line}`");
    let renderer = std::fs::read_to_string(own.join("renderer.rs")).unwrap();
    let shared = "    let sampler = Sampler::new(job.seed);\n";
    let (rows, each) = ("film, &|y, row| {\n", format!("film, &|y, row| {{\n        {line}\n"));
    assert!(renderer.contains(shared) && renderer.contains(rows), "{renderer}");
    put("renderer.rs", &renderer.replace(shared, "").replace(rows, &each));

    // Both halves of one file, the second not done yet.
    let integrator = solved("integrators/simple.rs");
    let visible =
        integrator.find("    let to_light = scene.first_light_position() - i.p;\n    let distance");
    let half = format!("{}    todo!(\"1.4 hard shadows\")\n}}\n", &integrator[..visible.unwrap()]);
    let steps: [(&str, &[(&str, String)]); 10] = [
        ("none", &[]),
        ("1.1", &[("bsdfs/diffuse.rs", solved("bsdfs/diffuse.rs"))]),
        ("1.2", &[("bsdfs/phong.rs", solved("bsdfs/phong.rs"))]),
        ("1.3", &[("integrators/simple.rs", half)]),
        ("1.4", &[("integrators/simple.rs", integrator.clone())]),
        ("2.1", &[("renderpasses/simple.rs", solved("renderpasses/simple.rs"))]),
        ("2.2", &[("shaders/simple.vs.wgsl", solved("shaders/simple.vs.wgsl"))]),
        ("2.3", &[("shaders/diffuse.fs.wgsl", solved("shaders/diffuse.fs.wgsl"))]),
        ("2.4", &[("shaders/phong.fs.wgsl", solved("shaders/phong.fs.wgsl"))]),
        (
            "2.5",
            &[
                ("renderpasses/shadow.rs", solved("renderpasses/shadow.rs")),
                ("shaders/shadow.vs.wgsl", solved("shaders/shadow.vs.wgsl")),
            ],
        ),
    ];
    for (index, (part, files)) in steps.iter().enumerate() {
        files.iter().for_each(|(file, text)| put(file, text));
        if let Some(failed) = [7, 5, 0].get(index) {
            assert_eq!(failed_unit_tests(&kit), *failed, "after {part}");
        }
        let mut check = Command::new(kit.join("umbra"));
        check.args(["check", "student_template"]).current_dir(&kit);
        let (report, said) = report_and_words(&mut check, &kit.join("report"));
        // The last lines say what changed, what it is worth and what is next; and all of it in the
        // words of the handout.
        let jargon = ["witness", "swap", "probe"];
        let found = jargon.iter().find(|word| said.to_lowercase().contains(*word));
        assert!(found.is_none(), "after {part}: {found:?} in\n{said}");
        let lines: Vec<&str> = said.lines().collect();
        let own = report["submissions"][0]["parts"].as_array().unwrap();
        if let Some(worth) = own.iter().find(|own| own["id"] == *part) {
            let change = format!("since last time: {part} 0 -> {}", worth["out_of"]);
            let told = lines.iter().any(|line| format!("{line}.0").starts_with(&change));
            assert!(told, "{change}: {said}");
        }
        assert!(lines.iter().any(|line| line.starts_with("verdict: ")), "{said}");
        let next = match steps.get(index + 1) {
            Some((part, _)) if *part == "2.5" => "next: make it ready to submit: ".to_owned(),
            Some((part, _)) => format!("next: {part} "),
            None => "next: make it ready to submit: ".to_owned(),
        };
        let last = lines.iter().rposition(|line| line.starts_with("next: ")).unwrap();
        assert!(lines[last].starts_with(&next), "{next}: {said}");
        for own in report["submissions"][0]["parts"].as_array().unwrap() {
            let id = own["id"].as_str().unwrap();
            let done = steps[..=index].iter().any(|(part, _)| *part == id);
            let right = if done { &own["out_of"] } else { &Value::from(0.0) };
            let (points, most) = (own["points"].as_f64(), own["points_max"].as_f64());
            assert!(points == right.as_f64() && most == points, "after {part}: {own:#}");
            let says = own["reason"].as_str().unwrap();
            assert_eq!(says.contains("not implemented yet"), !done, "after {part}: {own:#}");
        }
    }
}

/// How many of the template's own seven tests fail.
#[cfg(unix)]
fn failed_unit_tests(kit: &Path) -> usize {
    let test = ["test", "--release", "--package", "student_template", "--no-fail-fast"];
    let output = Command::new("cargo").args(test).current_dir(kit).output().unwrap();
    let said = String::from_utf8_lossy(&output.stdout);
    let line = said
        .lines()
        .find(|line| line.starts_with("test result: ") && !line.contains(" 0 passed; 0 failed"));
    let counts = line.and_then(|line| line.split_once(" passed; ")?.1.split_once(" failed"));
    counts.unwrap_or_else(|| panic!("{said}")).0.parse().unwrap()
}

/// `./run kit` asks for it.
#[cfg(unix)]
#[test]
#[ignore = "a minute or two: compiles the kit"]
fn a_check_in_the_kit_says_what_the_grader_says() {
    let kit = make_built("kit-built");
    let umbra = kit.join("umbra");

    let packed = run(Command::new(env!("CARGO_BIN_EXE_xtask")).arg("samples").current_dir(root()));
    for name in ["perfect.zip", "two-cosines.zip", "no-shadows.zip", "reflect-sign.zip"] {
        let archive = packed.lines().find(|line| line.ends_with(&format!("/{name}"))).unwrap();
        let mut student = Command::new(&umbra);
        let theirs =
            report(student.args(["check", archive]).current_dir(&kit), &kit.join("report"));
        let out = kit.join("graded");
        let mut grader = Command::new(root().join("target/release/umbra"));
        grader.args(["grade", archive, "--isolation", "reduced", "--held-back", "off"]);
        grader.arg("--root").arg(root());
        let ours = report(&mut grader, &out);
        let parts = |report: &Value| report["submissions"][0]["parts"].clone();
        assert_eq!(parts(&theirs), parts(&ours), "{name}");
        assert_eq!(verdicts(&theirs), verdicts(&ours), "{name}");
    }

    let output =
        Command::new(&umbra).args(["grade", "student_template"]).current_dir(&kit).output();
    let output = output.unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("student's kit") && said.contains("umbra check DIR"), "{said}");
}

/// Runs umbra and answers its `report.json`.
fn report(umbra: &mut Command, out: &Path) -> Value {
    report_and_words(umbra, out).0
}

/// Runs umbra and answers its `report.json`, and what it says on standard output.
fn report_and_words(umbra: &mut Command, out: &Path) -> (Value, String) {
    let output = umbra.arg("--output").arg(out).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(matches!(output.status.code(), Some(0 | 1)), "{umbra:?}: {said}");
    let report = std::fs::read(out.join("report.json")).unwrap();
    let words = String::from_utf8_lossy(&output.stdout).into_owned();
    (serde_json::from_slice(&report).unwrap(), words)
}

/// Which check said what of which scene, in the order they were made.
fn verdicts(report: &Value) -> Vec<String> {
    let checks = report["submissions"][0]["checks"].as_array().unwrap().iter();
    checks.map(|check| format!("{} {} {}", check["id"], check["scene"], check["verdict"])).collect()
}

/// A slip is no success: a script that calls it goes on otherwise.
#[cfg(unix)]
#[test]
fn the_kit_s_run_knows_its_commands() {
    let run = root().join("xtask/kit/run");
    let call = |arguments: &[&str]| {
        let output = Command::new("bash").arg(&run).args(arguments).output().unwrap();
        (output.status.code(), output.stdout.len(), output.stderr.len())
    };
    for arguments in [&[][..], &["help"], &["--help"]] {
        let (code, out, err) = call(arguments);
        assert!(code == Some(0) && out > 0 && err == 0, "{arguments:?}");
    }
    let (code, out, err) = call(&["wach"]);
    assert!(code == Some(2) && out == 0 && err > 0);
}
