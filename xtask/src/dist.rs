//! Makes the student's kit: everything that checking one's own work needs, and nothing that gives the solution away.
//!
//! Umbra goes in as a program: its source holds closed forms of the BSDFs, a render pass and a vertex
//! stage, which are right answers to tasks.

use std::env::consts::EXE_SUFFIX;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, ensure};
use umbra::assignment::Assignment;
use umbra::files::library_name;
use umbra::grading::PreparedScene;
use umbra::intake::text_of;
use umbra::store::Store;
use umbra::worker::Supervisor;

/// What goes into the kit as it is: files, and folders with all below.
const CONTENT: [&str; 13] = [
    "config.json",
    "Cargo.lock",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "rust-toolchain.toml",
    "docs/evidence.md",
    "docs/shader_contract.md",
    "docs/students.md",
    "expected",
    "harness/api",
    "harness/basecode",
    "scenes",
    "xtask/kit",
];
/// The template, beside the kit's own text.
const TEMPLATE: &str = "student_template";
/// The kit's workspace.
const MEMBERS: &str = r#"members = ["harness/api", "harness/basecode", "student_template"]"#;
const DEFAULT_MEMBERS: &str = r#"default-members = ["student_template"]"#;

/// Options of `xtask dist`.
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    what: What,
}

#[derive(clap::Subcommand)]
enum What {
    /// What a student starts from: umbra as a program, the base code, the template, the public scenes
    /// and their expected images, without the reference renderer
    Student {
        /// A new or empty folder, or a new .zip
        #[arg(default_value = "target/umbra/a2-student.zip")]
        out: PathBuf,
        /// Programs to give out, built elsewhere for other systems: umbra and umbra-worker of each
        /// [default: this system's]
        #[arg(long, value_name = "PATH")]
        umbra: Vec<PathBuf>,
    },
}

/// Makes the kit and answers where it is.
///
/// # Errors
/// When a file of the kit is missing or cannot be written, or the folder is not empty.
pub fn run(root: &Path, arguments: &Arguments) -> Result<String> {
    let What::Student { out, umbra } = &arguments.what;
    if out.extension().is_some_and(|extension| extension == "zip") {
        let scratch = tempfile::tempdir()?;
        let name = out.file_stem().unwrap_or_default();
        student(root, &scratch.path().join(name), umbra)?;
        write_zip(scratch.path(), out)?;
    } else {
        student(root, out, umbra)?;
    }
    Ok(out.display().to_string())
}

/// Makes the student's kit in the folder `kit`.
fn student(root: &Path, kit: &Path, programs: &[PathBuf]) -> Result<()> {
    let empty = kit.read_dir().map_or(true, |mut entries| entries.next().is_none());
    ensure!(empty, "{} is not empty; hint: name a new folder", kit.display());
    for path in CONTENT {
        // What the kit alone holds lies at its top.
        let to = if path == "xtask/kit" { kit.to_owned() } else { kit.join(path) };
        copy(&root.join(path), &to)?;
    }
    leave_out_extensions(&kit.join("config.json"))?;
    copy(&root.join(TEMPLATE), &kit.join(TEMPLATE))?;
    let own = ["umbra", "umbra-worker"].map(|name| built(root, &format!("{name}{EXE_SUFFIX}")));
    let own = own.into_iter().collect::<Result<Vec<_>>>()?;
    for program in if programs.is_empty() { &own } else { programs } {
        copy(program, &kit.join(program.file_name().context("a program's path")?))?;
    }
    let manifest = fs::read_to_string(root.join("Cargo.toml"))?;
    let manifest = lines(&manifest, |line| match line.split(" = ").next() {
        Some("members") => Some(MEMBERS.to_owned()),
        Some("default-members") => Some(DEFAULT_MEMBERS.to_owned()),
        _ => Some(line.to_owned()),
    });
    ensure!(manifest.contains(MEMBERS), "Cargo.toml: expected a line of members");
    fs::write(kit.join("Cargo.toml"), manifest)?;
    let guide = kit.join(TEMPLATE).join("README.md");
    let text = lines(&fs::read_to_string(&guide)?, |line| {
        let builds_umbra = line.starts_with("cargo build") && line.contains("# umbra");
        (!builds_umbra).then(|| line.replace("target/release/umbra", "./umbra"))
    });
    fs::write(guide, text)?;
    prune_lock(kit)?;
    add_expected(root, kit)
}

/// Extensions are private to the students who have them.
fn leave_out_extensions(config: &Path) -> Result<()> {
    let mut assignment: serde_json::Value = serde_json::from_str(&text_of(&fs::read(config)?))?;
    let late = assignment.get_mut("late").and_then(serde_json::Value::as_object_mut);
    if late.and_then(|late| late.remove("extensions")).is_some() {
        fs::write(config, serde_json::to_vec_pretty(&assignment)?)?;
    }
    Ok(())
}

/// A text, line by line, without those that `of` drops.
fn lines(text: &str, of: impl Fn(&str) -> Option<String>) -> String {
    text.lines().filter_map(of).map(|line| line + "\n").collect()
}

/// Something that cargo has built here.
fn built(root: &Path, name: &str) -> Result<PathBuf> {
    let file = root.join("target/release").join(name);
    let hint = "hint: cargo build --release --workspace";
    ensure!(file.is_file(), "{} is missing; {hint}", file.display());
    Ok(file)
}

/// Lets cargo drop from the lock file what only the packages need that are left out.
fn prune_lock(kit: &Path) -> Result<()> {
    let mut cargo = Command::new("cargo");
    cargo.args(["update", "--workspace", "--offline", "--quiet"]).current_dir(kit);
    let output = cargo.output().context("cargo")?;
    let said = String::from_utf8_lossy(&output.stderr);
    ensure!(output.status.success(), "the kit's lock file cannot be made: {said}");
    Ok(())
}

/// The expected images that are made with the reference renderer when they are needed: in the kit
/// they are needed, and it is not there.
fn add_expected(root: &Path, kit: &Path) -> Result<()> {
    let assignment = Assignment::load(root)?;
    let umbra = built(root, &format!("umbra{EXE_SUFFIX}"))?;
    let reference = built(root, &library_name("reference_impl"))?;
    let scratch = assignment.scratch()?;
    let supervisor = Supervisor::available(umbra, scratch.path().to_owned());
    let store = Store {
        assignment: &assignment,
        reference: Some(reference),
        supervisor: &supervisor,
        threads: std::thread::available_parallelism().map_or(1, |n| n.get() as u32),
        progress: &|_| (),
    };
    let to = Assignment { root: kit.to_owned(), ..assignment.clone() }.made();
    fs::create_dir_all(&to)?;
    for entry in &assignment.scenes {
        let scene = || format!("scene \"{}\"", entry.name);
        PreparedScene::new(&store, entry).with_context(scene)?;
        for file in PreparedScene::made_files(&store, entry).with_context(scene)? {
            // Realtime ones cannot be made without a graphics adapter, and are then done without.
            if file.is_file() {
                fs::copy(&file, to.join(file.file_name().unwrap_or_default()))?;
            }
        }
    }
    Ok(())
}

/// Copies a file, or a folder with all below but our own tests, which want what the kit lacks.
fn copy(from: &Path, to: &Path) -> Result<()> {
    if !from.is_dir() {
        fs::create_dir_all(to.parent().unwrap_or(Path::new("")))?;
        fs::copy(from, to).with_context(|| from.display().to_string())?;
        return Ok(());
    }
    fs::create_dir_all(to)?;
    for entry in from.read_dir()? {
        let entry = entry?;
        let name = entry.file_name();
        let is_package = from.join("Cargo.toml").is_file() && !from.ends_with(TEMPLATE);
        let left_out = name == "tests" && is_package;
        if !left_out && name != "target" && !name.as_encoded_bytes().starts_with(b".") {
            copy(&entry.path(), &to.join(name))?;
        }
    }
    Ok(())
}

/// Packs all below `folder`.
fn write_zip(folder: &Path, out: &Path) -> Result<()> {
    ensure!(!out.exists(), "{} exists already", out.display());
    let mut files: Vec<PathBuf> = crate::samples::read_tree(folder)?.into_keys().collect();
    files.sort();
    let draft = out.with_extension("zip.new");
    let file = fs::File::create(&draft).with_context(|| draft.display().to_string())?;
    let mut zip = zip::ZipWriter::new(file);
    for path in files {
        // Programs lie at the kit's top.
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let starts = name == "run" || name.starts_with("umbra");
        let mode = if starts && path.iter().count() == 2 { 0o755 } else { 0o644 };
        let options = zip::write::SimpleFileOptions::default().unix_permissions(mode);
        let name: Vec<_> = path.iter().map(|part| part.to_string_lossy()).collect();
        zip.start_file(name.join("/"), options)?;
        zip.write_all(&fs::read(folder.join(&path))?)?;
    }
    zip.finish()?;
    fs::rename(draft, out)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kit_does_not_say_who_has_an_extension() {
        let folder = tempfile::tempdir().expect("a folder");
        let config = folder.path().join("config.json");
        let late =
            r#"{"name": "a2", "late": {"penalty": 1, "extensions": [{"student": "260000001"}]}}"#;
        fs::write(&config, late).expect("written");
        leave_out_extensions(&config).expect("left out");
        let text = fs::read_to_string(&config).expect("read");
        assert!(text.contains("penalty") && !text.contains("260000001"), "{text}");
        // What has none stays as it is written.
        let plain = r#"{"name":   "a2"}"#;
        fs::write(&config, plain).expect("written");
        leave_out_extensions(&config).expect("left out");
        assert_eq!(fs::read_to_string(&config).expect("read"), plain);
    }
}
