//! A source that does not build: the files with errors are replaced by the template's, so that all
//! else is graded as code.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Component, Path, PathBuf};

use crate::build::{BuildOutcome, BuildReport, Diagnostic, SourcePlace};
use crate::evidence::{Check, CheckId, Verdict};
use crate::files::{copy_tree, files_below};
use crate::intake::Finding;
use crate::process::Exit;
use crate::rubric::Rules;

/// Number of rounds in which files are replaced: first the wrong files, then files that needed their content.
const ROUNDS: usize = 3;

/// The check that says which files were replaced; it costs nothing by itself.
const REPLACED: CheckId = CheckId::SubmissionReplaced;

/// Remarks on the render loop, which is the template's where a file of its part was replaced.
const SAMPLER: [CheckId; 3] = [CheckId::SamplerThreads, CheckId::SamplerRows, CheckId::SamplerSeed];

/// A source as it was built.
pub struct Built {
    /// The last compiler call.
    pub report: BuildReport,
    /// What the compiler refused in the source as it was submitted.
    pub errors: Vec<Diagnostic>,
    /// The source that `report` is about: the submitted one, or the copy with files of the template.
    pub src: PathBuf,
    /// The files of the template in it, by their path below `src`, and why each is there.
    pub replaced: BTreeMap<String, String>,
    /// CPU seconds of all compiler calls.
    pub cpu_s: f64,
}

/// Builds the source in `src` with `compile`. Where that fails, once more with a copy in `copy` (a
/// folder that is not there yet), in which files of `template` take the place of broken ones. When
/// that fails too, the answer is that for the source as it was.
///
/// # Errors
/// Those of `compile`, and when the copy cannot be made.
pub fn build(
    compile: &dyn Fn(&Path) -> io::Result<BuildReport>,
    src: &Path,
    template: &Path,
    copy: &Path,
) -> io::Result<Built> {
    let first = compile(src)?;
    let mut cpu_s = first.cpu_s;
    let as_it_is = |report, errors, cpu_s| Built {
        report,
        errors,
        src: src.to_owned(),
        replaced: BTreeMap::new(),
        cpu_s,
    };
    let BuildOutcome::CompileError { errors } = &first.outcome else {
        return Ok(as_it_is(first, Vec::new(), cpu_s));
    };
    let submitted = located(errors, src);
    let mut errors = submitted.clone();
    copy_tree(src, copy)?;
    let mut replaced = BTreeMap::new();
    for _ in 0..ROUNDS {
        let known = replaced.len();
        // What is wrong in a file of the template's may only follow from what is wrong elsewhere.
        for of_error in [to_replace, culprits] {
            for error in &errors {
                for file in of_error(error, template, copy) {
                    replaced.entry(file).or_insert_with(|| error.headline());
                }
            }
            if replaced.len() > known {
                break;
            }
        }
        if replaced.len() == known {
            break;
        }
        for file in replaced.keys() {
            put(&template.join(file), copy, file)?;
        }
        let report = compile(copy)?;
        cpu_s += report.cpu_s;
        errors = match report.outcome {
            BuildOutcome::Built { .. } => {
                let src = copy.to_owned();
                return Ok(Built { report, errors: submitted, src, replaced, cpu_s });
            }
            BuildOutcome::CompileError { errors } => located(&errors, copy),
            BuildOutcome::Ended(Exit::Cancelled) => return Ok(as_it_is(report, submitted, cpu_s)),
            _ => break,
        };
    }
    Ok(as_it_is(first, submitted, cpu_s))
}

/// Copies a file of the template to its place below `copy`, whatever stands there or above it.
fn put(from: &Path, copy: &Path, file: &str) -> io::Result<()> {
    let to = copy.join(file);
    for above in to.ancestors().skip(1).take_while(|above| *above != copy) {
        if above.is_file() {
            fs::remove_file(above)?;
        }
    }
    if to.is_dir() {
        fs::remove_dir_all(&to)?;
    }
    fs::create_dir_all(to.parent().unwrap_or(copy))?;
    fs::copy(from, to).map(drop)
}

/// The errors with the files that they are about. Of an included file that is not UTF-8, the compiler repeats the path
/// as the macro names it, and does not say where the macro stands.
fn located(errors: &[Diagnostic], src: &Path) -> Vec<Diagnostic> {
    let located = |error: &Diagnostic| {
        let mut error = error.clone();
        let Some(path) = error.message.strip_suffix(" wasn't a utf-8 file") else { return error };
        let named =
            path.trim_matches('`').split('/').filter(|part| !matches!(*part, "" | "." | ".."));
        let named: PathBuf = named.collect();
        let files = files_below(src).unwrap_or_default();
        let unreadable = |file: &PathBuf| {
            let bytes = fs::read(src.join(file)).ok()?;
            let end = std::str::from_utf8(&bytes).err()?.valid_up_to();
            Some(1 + bytes[..end].iter().filter(|byte| **byte == b'\n').count() as u32)
        };
        let files = files.iter().filter_map(|file| Some(file.strip_prefix(src).ok()?.to_owned()));
        let mut files = files.filter(|file| named.ends_with(file) || file.ends_with(&named));
        let found = files.find_map(|file| Some((below(&file)?, unreadable(&file)?)));
        if let Some((file, line)) = found {
            error.place = Some(SourcePlace { file: seen(&file), line });
            error.message = "the file is not UTF-8; save it as UTF-8".to_owned();
        }
        error
    };
    errors.iter().map(located).collect()
}

impl Built {
    /// What the files that were replaced mean for what was found out: who is to be told, and why a
    /// part is not implemented.
    pub fn explain(&self, rules: &Rules, checks: &mut Vec<Check>, findings: &mut Vec<Finding>) {
        for (file, why) in &self.replaced {
            let of = |part: &&crate::rubric::Part| part.files.contains(file);
            let parts: Vec<_> = rules.parts.iter().filter(of).collect();
            for part in &parts {
                // What the template does there is no work of the student's, be it right or wrong.
                for check in checks.iter_mut().filter(|check| part.evidence.contains(&check.id)) {
                    let (held_back, weight) = (check.held_back, check.weight);
                    let own = Check::new(check.id, &check.scene, Verdict::NotImplemented, why);
                    *check = Check { held_back, weight, ..own };
                }
                if part.evidence.contains(&CheckId::LoopAgreement) {
                    checks.retain(|check| !SAMPLER.contains(&check.id));
                }
                let images = checks.iter().filter(|check| part.images_only.contains(&check.id));
                let verdicts: Vec<Verdict> = images.map(|check| check.verdict).collect();
                if verdicts.contains(&Verdict::Pass) && !verdicts.contains(&Verdict::Fail) {
                    let message = format!(
                        "does not build, so part {} earns nothing by code, although its submitted images are right",
                        part.id
                    );
                    findings.push(Finding::warning("replaced_image_right", message).at(seen(file)));
                }
            }
            let ids: Vec<&str> = parts.iter().map(|part| part.id.as_str()).collect();
            let lost = match ids.as_slice() {
                [] => "no part is lost by it".to_owned(),
                ids => format!("nothing is earned by code for {}", ids.join(", ")),
            };
            let message =
                format!("does not build, and is replaced by the template's: {lost} ({why})");
            findings.push(Finding::error("replaced", message).at(seen(file)));
        }
        if !self.replaced.is_empty() {
            let files: Vec<String> = self.replaced.keys().map(|file| seen(file)).collect();
            let summary = format!("replaced by the template's: {}", files.join(", "));
            checks.push(Check::new(REPLACED, "", Verdict::Fail, summary));
        }
    }
}

/// A path below `src` as the student knows it.
fn seen(file: &str) -> String {
    format!("src/{file}")
}

/// The files below `src` that an error is about, as far as the template has them too and they differ. What is wrong
/// with a file of the student's own is the matter of those that use it.
fn to_replace(error: &Diagnostic, template: &Path, copy: &Path) -> Vec<String> {
    let known =
        |file: &String| template.join(file).is_file() && may_be_replaced(file, template, copy);
    let missing: Vec<String> = missing_files(error).into_iter().filter(known).collect();
    if !missing.is_empty() {
        return missing;
    }
    let Some(file) = error.place.as_ref().and_then(|place| below_src(&place.file)) else {
        return Vec::new();
    };
    if template.join(&file).is_file() {
        return if differs(&file, template, copy) && known(&file) {
            vec![file]
        } else {
            Vec::new()
        };
    }
    let users = users(&file, copy);
    let direct: Vec<String> = users.iter().filter(|file| known(file)).cloned().collect();
    if !direct.is_empty() {
        return direct;
    }
    users.iter().flat_map(|file| self::users(file, copy)).filter(known).collect()
}

/// The files that name a module, or the file itself.
fn users(file: &str, copy: &Path) -> Vec<String> {
    let path = Path::new(file);
    let [stem, name] = [path.file_stem(), path.file_name()]
        .map(|name| name.unwrap_or_default().to_string_lossy().into_owned());
    let uses = |other: &String| {
        let text = fs::read_to_string(copy.join(other)).unwrap_or_default();
        other != file && (text.contains(&name) || words(&text).any(|word| word == stem))
    };
    let files = files_below(copy).unwrap_or_default();
    let files = files.iter().filter_map(|path| below(path.strip_prefix(copy).ok()?));
    files.filter(uses).collect()
}

/// Whether a file is another than the template's of that name.
fn differs(file: &str, template: &Path, copy: &Path) -> bool {
    fs::read(copy.join(file)).ok() != fs::read(template.join(file)).ok()
}

/// The submission's files that cause an error in one of the template's lines. Such a line is right as long as what it
/// uses is. The first of these that yields any file counts: modules that no longer re-export the name, other files that
/// the error points at, files that define the name or are called so.
fn culprits(error: &Diagnostic, template: &Path, copy: &Path) -> Vec<String> {
    let at = error.place.as_ref().and_then(|place| below_src(&place.file));
    if !at.is_some_and(|file| template.join(file).is_file()) {
        return Vec::new();
    }
    let is_other = |file: &String| {
        template.join(file).is_file()
            && differs(file, template, copy)
            && may_be_replaced(file, template, copy)
    };
    let files = files_below(template).unwrap_or_default();
    let files = files.iter().filter_map(|path| below(path.strip_prefix(template).ok()?));
    let others: Vec<String> = files.filter(is_other).collect();
    let quoted = error.rendered.split('`').skip(1).step_by(2);
    let named: BTreeSet<&str> = quoted.flat_map(words).collect();
    let text = |at: &Path, file: &str| fs::read_to_string(at.join(file)).unwrap_or_default();
    let passes_on = |at: &Path, file: &str, name: &str| words(&text(at, file)).any(|w| w == name);
    let lacks_a_name = |file: &&String| {
        let lost = |name: &&str| passes_on(template, file, name) && !passes_on(copy, file, name);
        is_module(file) && named.iter().any(lost)
    };
    let modules: Vec<String> = others.iter().filter(lacks_a_name).cloned().collect();
    if !modules.is_empty() {
        return modules;
    }
    let lines = error.rendered.lines().map(str::trim_start);
    let places = lines.filter_map(|line| {
        let place = line.strip_prefix("--> ").or_else(|| line.strip_prefix("::: "))?;
        below_src(place.split(':').next()?)
    });
    let pointed: Vec<String> = places.filter(is_other).collect();
    if !pointed.is_empty() {
        return pointed;
    }
    let is_named = |file: &String| {
        let stem = Path::new(file).file_stem().unwrap_or_default().to_string_lossy();
        let text = text(copy, file);
        let words: Vec<&str> = words(&text).collect();
        let defines = |pair: &[&str]| DEFINING.contains(&pair[0]) && named.contains(pair[1]);
        named.contains(&*stem) || words.windows(2).any(defines)
    };
    others.into_iter().filter(is_named).collect()
}

/// The identifiers, keywords and numbers in a text.
fn words(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| !(c.is_alphanumeric() || c == '_')).filter(|word| !word.is_empty())
}

/// Whether a file says what is in a folder's module.
fn is_module(file: &str) -> bool {
    Path::new(file).file_name().is_some_and(|name| name == "mod.rs")
}

/// What stands before a name that is defined.
const DEFINING: [&str; 8] = ["struct", "enum", "trait", "fn", "type", "const", "static", "mod"];

/// `lib.rs` says which modules there are: the template's is of use only where they are the same.
fn may_be_replaced(file: &str, template: &Path, copy: &Path) -> bool {
    let modules = |folder: &Path| {
        let text = fs::read_to_string(folder.join("lib.rs")).unwrap_or_default();
        let lines = text.lines().filter_map(|line| {
            let line = line.trim().trim_start_matches("pub ");
            Some(line.strip_prefix("mod ")?.strip_suffix(';')?.trim().to_owned())
        });
        lines.collect::<BTreeSet<String>>()
    };
    file != "lib.rs" || modules(template) == modules(copy)
}

/// The files that the compiler could not read: included ones, and those of modules.
fn missing_files(error: &Diagnostic) -> Vec<String> {
    let said = &error.message;
    if said.starts_with("couldn't read") || said.contains("utf-8") || said.contains("UTF-8") {
        return said.split('`').nth(1).and_then(below_src).into_iter().collect();
    }
    if !said.starts_with("file not found for module") {
        return Vec::new();
    }
    let help = error.rendered.split("create file ").nth(1).unwrap_or_default();
    help.lines().next().unwrap_or_default().split('"').filter_map(below_src).collect()
}

/// A path as the compiler names it, below `src`: `renderpasses/../shaders/a.wgsl` is `shaders/a.wgsl`.
fn below_src(path: &str) -> Option<String> {
    let path = path.trim_start_matches('/');
    below(Path::new(path.strip_prefix("src/")?))
}

/// A relative path with slashes, without `..`; nothing when it leads out.
fn below(path: &Path) -> Option<String> {
    let mut parts: Vec<String> = Vec::new();
    for component in path.components() {
        match component {
            Component::Normal(name) => parts.push(name.to_str()?.to_owned()),
            Component::CurDir => {}
            Component::ParentDir => {
                parts.pop()?;
            }
            _ => return None,
        }
    }
    (!parts.is_empty()).then(|| parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(message: &str, file: &str, rendered: &str) -> Diagnostic {
        let place = (!file.is_empty()).then(|| SourcePlace { file: file.into(), line: 7 });
        Diagnostic { message: message.into(), place, rendered: rendered.into() }
    }

    fn write(folder: &Path, files: &[(&str, &str)]) {
        for (file, text) in files {
            let path = folder.join(file);
            fs::create_dir_all(path.parent().expect("a folder")).expect("scratch");
            fs::write(path, text).expect("scratch");
        }
    }

    /// A compiler for which a source is right when no file holds `!`.
    fn compile(src: &Path) -> io::Result<BuildReport> {
        let mut errors = Vec::new();
        for file in files_below(src)? {
            let name = seen(&below(file.strip_prefix(src).expect("below")).expect("a path"));
            if fs::read_to_string(&file)?.contains('!') {
                errors.push(error("unexpected `!`", &name, ""));
            }
        }
        let library = src.join("lib.so");
        let outcome = match errors.as_slice() {
            [] => BuildOutcome::Built { library },
            _ => BuildOutcome::CompileError { errors },
        };
        Ok(BuildReport { outcome, warnings: Vec::new(), wall_s: 0.0, cpu_s: 1.0 })
    }

    const TEMPLATE: [(&str, &str); 4] = [
        ("lib.rs", "mod bsdfs;\nmod renderer;\n"),
        ("bsdfs/mod.rs", "mod phong;"),
        ("bsdfs/phong.rs", "todo"),
        ("renderer.rs", "todo"),
    ];

    fn built(source: &[(&str, &str)]) -> (Built, Option<String>) {
        let folder = tempfile::tempdir().expect("scratch");
        let [src, template, copy] =
            ["src", "template", "copy"].map(|name| folder.path().join(name));
        write(&template, &TEMPLATE);
        write(&src, &TEMPLATE);
        write(&src, source);
        let built = build(&compile, &src, &template, &copy).expect("scratch");
        let phong = fs::read_to_string(built.src.join("bsdfs/phong.rs")).ok();
        assert_eq!(fs::read_to_string(src.join("lib.rs")).ok(), {
            let own = source.iter().find(|(file, _)| *file == "lib.rs");
            Some(own.map_or(TEMPLATE[0].1, |(_, text)| text).to_owned())
        });
        (built, phong)
    }

    fn files(built: &Built) -> Vec<&str> {
        built.replaced.keys().map(String::as_str).collect()
    }

    #[test]
    fn files_with_errors_are_the_templates_and_nothing_else_is() {
        let (right, phong) = built(&[("bsdfs/phong.rs", "mine")]);
        assert_eq!((files(&right), phong.as_deref()), (vec![], Some("mine")));
        let (broken, phong) = built(&[("bsdfs/phong.rs", "!"), ("renderer.rs", "mine")]);
        assert_eq!((files(&broken), phong.as_deref()), (vec!["bsdfs/phong.rs"], Some("todo")));
        assert_eq!(broken.replaced["bsdfs/phong.rs"], "src/bsdfs/phong.rs:7: unexpected `!`");
        assert_eq!((broken.errors.len(), broken.cpu_s), (1, 2.0));
        // `lib.rs` where its modules are the template's, and only there.
        assert_eq!(files(&built(&[("lib.rs", "pub mod bsdfs;\nmod renderer; !")]).0), [""; 0]);
        assert_eq!(files(&built(&[("lib.rs", "mod bsdfs;\nmod renderer;\n!")]).0), ["lib.rs"]);
        // A file of one's own that stays broken whatever is replaced.
        let own = [("bsdfs/lobe.rs", "!"), ("bsdfs/mod.rs", "mod phong;\nmod lobe;")];
        let (given_up, phong) = built(&own);
        assert!(matches!(given_up.report.outcome, BuildOutcome::CompileError { .. }));
        assert_eq!((files(&given_up), phong.as_deref()), (vec![], Some("todo")));
        assert!(given_up.src.ends_with("src"), "the source as it was");
    }

    #[test]
    fn an_included_file_that_is_no_text_costs_itself_or_those_that_include_it() {
        let folder = tempfile::tempdir().expect("scratch");
        let [template, copy] = ["template", "copy"].map(|name| folder.path().join(name));
        for place in [&template, &copy] {
            write(place, &TEMPLATE);
            write(place, &[("shaders/a.wgsl", "x"), ("renderpasses/a.rs", "x")]);
        }
        write(&copy, &[("renderpasses/a.rs", "include_str!(\"own.wgsl\")")]);
        write(
            &copy,
            &[
                ("renderpasses/b.rs", "mod c; include_str!(\"other.txt\")"),
                ("renderer.rs", "mod b;"),
            ],
        );
        for file in ["shaders/a.wgsl", "renderpasses/own.wgsl", "renderpasses/other.txt"] {
            fs::write(copy.join(file), b"x\n// r\xe9sum\xe9\n").expect("scratch");
        }
        let of = |included: &str| {
            let said = error(&format!("`{included}` wasn't a utf-8 file"), included, "");
            let [error] = &located(&[said], &copy)[..] else { panic!("one") };
            let line = error.place.as_ref().map(|place| place.line);
            (to_replace(error, &template, &copy), line, error.headline())
        };
        let own = vec!["shaders/a.wgsl".to_owned()];
        for path in ["../shaders/a.wgsl", "./../shaders/a.wgsl", "/src/shaders/a.wgsl", "a.wgsl"] {
            let said = "src/shaders/a.wgsl:2: the file is not UTF-8; save it as UTF-8".to_owned();
            assert_eq!(of(path), (own.clone(), Some(2), said), "{path}");
        }
        assert_eq!(of("own.wgsl").0, ["renderpasses/a.rs"]);
        // Of a file of one's own that another of one's own includes.
        assert_eq!(of("other.txt").0, ["renderer.rs"]);
        // Nothing such is there.
        assert_eq!(of("../../config.json").0, [""; 0]);
        // A folder in the file's place, and a file in its folder's.
        let taken = folder.path().join("taken");
        write(&taken, &[("shaders/a.wgsl/x", ""), ("bsdfs", "")]);
        for file in ["shaders/a.wgsl", "bsdfs/phong.rs"] {
            put(&template.join(file), &taken, file).expect("scratch");
            assert!(taken.join(file).is_file(), "{file}");
        }
    }

    #[test]
    fn files_that_are_missing_are_named_by_the_compiler() {
        let folder = tempfile::tempdir().expect("scratch");
        let template = folder.path();
        write(template, &TEMPLATE);
        write(template, &[("shaders/a.wgsl", "")]);
        let of = |error: Diagnostic| to_replace(&error, template, template);
        let include =
            "couldn't read `src/renderpasses/../shaders/a.wgsl`: No such file or directory";
        assert_eq!(of(error(include, "src/renderer.rs", "")), ["shaders/a.wgsl"]);
        let include = include.replace("`src/", "`/src/");
        assert_eq!(of(error(&include, "src/renderer.rs", "")), ["shaders/a.wgsl"]);
        let module = "file not found for module `phong`";
        let help = "help: to create the module `phong`, create file \"src/bsdfs/phong.rs\" or \
                    \"src/bsdfs/phong/mod.rs\"\n";
        assert_eq!(of(error(module, "src/bsdfs/mod.rs", help)), ["bsdfs/phong.rs"]);
        // Only the template's files are replaced, wherever a path leads.
        for file in ["", "src/../../etc/passwd", "/rustc/library/core.rs", "src/mine.rs"] {
            assert_eq!(of(error("wrong", file, "")), [""; 0]);
        }
        // The template's own line is right: wrong is what it points at, or what it names.
        let copy = tempfile::tempdir().expect("scratch");
        let copy = copy.path();
        write(copy, &TEMPLATE);
        write(copy, &[("bsdfs/phong.rs", "pub struct Phong { n: f32 }")]);
        let of = |rendered: &str| {
            let error = error("wrong", "src/lib.rs", rendered);
            assert_eq!(to_replace(&error, template, copy), [""; 0]);
            culprits(&error, template, copy)
        };
        assert_eq!(
            of("error: wrong\n --> src/lib.rs:7:1\nnote: here\n ::: src/bsdfs/phong.rs:1:2\n"),
            ["bsdfs/phong.rs"]
        );
        assert_eq!(of("error: missing field `n` in initializer of `Phong`\n"), ["bsdfs/phong.rs"]);
        assert_eq!(of("error: no `Lobe` in `bsdfs::phong`\n"), ["bsdfs/phong.rs"]);
        assert_eq!(of("error: missing field `n` in initializer of `Lobe`\n"), [""; 0]);
        let of = |error: Diagnostic| to_replace(&error, template, template);
        // One that the template lacks is the matter of those that name it.
        assert_eq!(of(error("wrong", "src/bsdfs/phong/lobe.rs", "")), [""; 0]);
        write(template, &[("bsdfs/phong.rs", "use lobe::peak;")]);
        assert_eq!(of(error("wrong", "src/bsdfs/lobe.rs", "")), ["bsdfs/phong.rs"]);
    }

    #[test]
    fn what_the_template_does_in_place_of_a_broken_file_earns_nothing() {
        let config: serde_json::Value =
            serde_json::from_str(include_str!("../../../config.json")).expect("JSON");
        let rules: Rules = serde_json::from_value(config["rules"].clone()).expect("rules");
        let (broken, _) = built(&[("renderer.rs", "!")]);
        let (id, shadows) = (CheckId::LoopAgreement, CheckId::ShadowRays);
        let mut checks = vec![
            Check { held_back: true, ..Check::new(id, "cbox", Verdict::Pass, "the loop is right") },
            Check::new(shadows, "cbox", Verdict::Pass, "shadows are right"),
            Check::new(CheckId::SamplerThreads, "", Verdict::Fail, "threads share a sampler"),
        ];
        broken.explain(&rules, &mut checks, &mut Vec::new());
        let found: Vec<_> = checks.iter().map(|c| (c.id, c.verdict, c.held_back)).collect();
        assert_eq!(
            found,
            [
                (id, Verdict::NotImplemented, true),
                (shadows, Verdict::Pass, false),
                (CheckId::SubmissionReplaced, Verdict::Fail, false),
            ]
        );
        assert_eq!(checks[0].summary, "src/renderer.rs:7: unexpected `!`");
    }
}
