//! A fix of a few lines by the instructor: its limits, and how it is applied to a source.

use std::fs;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use diffy::patch_set::{FileOperation, FilePatch, ParseOptions, PatchSet};
use diffy::{Line, Patch};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::overrides::Decision;
use crate::columns::{count, point_range, points, range};
use crate::rubric::Grade;

/// What a mend may be, as `config.json` says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mend {
    /// So many lines may be changed, added or removed.
    pub lines: usize,
    /// What it costs, in points of the assignment.
    pub penalty: f64,
}

/// A mend of a submission, as both reports show it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Mended {
    /// The diff.
    pub patch: String,
    /// Lines that it changes, adds or removes.
    pub lines: usize,
    /// What it costs, in points.
    pub penalty: f64,
    /// Points without it, least and most.
    pub before: [f64; 2],
    /// Points with it, after the penalty.
    pub after: [f64; 2],
    /// Whether it counts: never where that would be less.
    pub counts: bool,
    /// Why, by whom and when.
    pub words: String,
}

impl Mend {
    /// What is wrong with it, if anything.
    pub fn problem(&self) -> Option<String> {
        if self.lines == 0 {
            return Some("mend.lines is 0; expected 1 or more, or no \"mend\"".into());
        }
        (!(self.penalty.is_finite() && self.penalty >= 0.0))
            .then(|| format!("mend.penalty is {} but must be 0 or more", self.penalty))
    }
}

/// Puts a mended submission's grade, less what the fix costs, in the place of the unmended one's, unless that is worth
/// more. Returns `None` if the decision holds no fix.
pub fn choose(decision: &Decision, grade: &mut Grade, mended: Grade) -> Option<Mended> {
    let (patch, penalty) = (decision.patch.clone()?, decision.penalty?);
    let less = |points: f64| ((points - penalty).max(0.0) * 100.0).round() / 100.0;
    let before = [grade.points, grade.points_max];
    let after = [mended.points, mended.points_max].map(less);
    let counts = after[0] >= before[0] && after[1] > before[1];
    let lines = lines_of(&patch).unwrap_or_default();
    let (fix, less) = (count(lines, "line"), points(penalty));
    let what = if counts {
        format!(
            "mended by the instructor, {fix}, less {less}: {} instead of {}",
            range(after),
            point_range(before)
        )
    } else {
        format!(
            "mended by the instructor, {fix}; less {less} that would be {}, no more than the {} without it, which count",
            range(after),
            point_range(before)
        )
    };
    let words = format!("{what}: {}{}", decision.reason, decision.who());
    if counts {
        *grade = mended;
        [grade.points, grade.points_max] = after;
    }
    grade.remarks.push(words.clone());
    Some(Mended { patch, lines, penalty, before, after, counts, words })
}

/// The remark on a fix whose submission has changed since.
pub fn stale(decision: &Decision) -> String {
    format!(
        "the fix{} was of another submission and does not count; mend it again: {}",
        decision.who(),
        decision.reason
    )
}

/// The files that a unified diff changes.
fn files_of(patch: &str) -> anyhow::Result<Vec<FilePatch<'_, str>>> {
    let files = PatchSet::parse(patch, ParseOptions::unidiff()).collect::<Result<Vec<_>, _>>();
    let files = files.context("expected a unified diff, as `diff -u` and `git diff` write it")?;
    ensure!(!files.is_empty(), "expected a unified diff, found no file in it");
    Ok(files)
}

fn text_of<'a, 'b>(file: &'b FilePatch<'a, str>) -> anyhow::Result<&'b Patch<'a, str>> {
    file.patch().as_text().context("expected a diff of text files")
}

/// How many lines a unified diff changes: one that is replaced counts once.
///
/// # Errors
/// When it is no diff.
pub fn lines_of(patch: &str) -> anyhow::Result<usize> {
    let mut lines = 0;
    for file in &files_of(patch)? {
        for hunk in text_of(file)?.hunks() {
            let number = |wanted: fn(&Line<str>) -> bool| {
                hunk.lines().iter().filter(|line| wanted(line)).count()
            };
            let added = number(|line| matches!(line, Line::Insert(_)));
            lines += added.max(number(|line| matches!(line, Line::Delete(_))));
        }
    }
    ensure!(lines > 0, "expected a diff that changes something");
    Ok(lines)
}

/// Puts a unified diff into the source below `root`. Paths are those of the submission, `src/x.rs`; folders above
/// are left out.
///
/// # Errors
/// When it is no diff, changes something else than a file of `src/` that is there, or does not fit.
pub fn apply(patch: &str, root: &Path) -> anyhow::Result<()> {
    for file in &files_of(patch)? {
        let own = text_of(file)?;
        let FileOperation::Modify { modified, .. } = file.operation() else {
            bail!(
                "the diff makes, renames or removes a file; expected changes to files of src/ alone"
            );
        };
        // `b/src/x.rs` of git, `new/src/x.rs` and a time of diff.
        let named = modified.split('\t').next().unwrap_or_default();
        let above = |part: &Component| *part != Component::Normal("src".as_ref());
        let parts = Path::new(named).components().skip_while(above);
        let parts: Vec<Component> = parts.collect();
        let is_plain = parts.iter().all(|part| matches!(part, Component::Normal(_)));
        ensure!(
            is_plain && parts.len() > 1,
            "the diff changes {named}; expected files of src/ alone, named src/x.rs"
        );
        let own_path: PathBuf = parts.iter().collect();
        let name = own_path.display();
        let path = root.join(&own_path);
        let is_file = path.symlink_metadata().is_ok_and(|meta| meta.is_file());
        ensure!(is_file, "the diff changes {name}, which the submission does not have");
        let before = fs::read_to_string(&path).with_context(|| format!("cannot read {name}"))?;
        let after = diffy::apply(&before, own)
            .with_context(|| format!("{name}: the diff does not fit the submission"))?;
        fs::write(&path, after).with_context(|| format!("cannot write {name}"))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    const DIFF: &str = "diff --git a/src/a.rs b/src/a.rs\nindex 1..2 100644\n--- a/src/a.rs\n+++ b/src/a.rs\n\
        @@ -1,3 +1,3 @@\n fn f() {\n-    1\n+    2\n }\n\
        diff --git a/src/b/c.wgsl b/src/b/c.wgsl\n--- a/src/b/c.wgsl\n+++ b/src/b/c.wgsl\n@@ -1 +1,2 @@\n x\n+y\n";

    #[test]
    fn a_few_lines_of_several_files() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::create_dir_all(at("src/b")).unwrap();
        fs::write(at("src/a.rs"), "fn f() {\n    1\n}\n").unwrap();
        fs::write(at("src/b/c.wgsl"), "x\n").unwrap();
        assert_eq!(lines_of(DIFF).unwrap(), 2);
        apply(DIFF, place.path()).unwrap();
        assert_eq!(fs::read_to_string(at("src/a.rs")).unwrap(), "fn f() {\n    2\n}\n");
        assert_eq!(fs::read_to_string(at("src/b/c.wgsl")).unwrap(), "x\ny\n");
        let plain = "--- old/src/a.rs\t2019-10-20 10:00:00\n+++ new/src/a.rs\t2019-10-20 10:01:00\n@@ -2 +2 @@\n-    2\n+    3\n";
        apply(plain, place.path()).unwrap();
        assert_eq!(fs::read_to_string(at("src/a.rs")).unwrap(), "fn f() {\n    3\n}\n");
        // A second time it does not fit.
        let error = format!("{:#}", apply(DIFF, place.path()).unwrap_err());
        assert!(error.contains("src/a.rs: the diff does not fit"), "{error}");
    }

    #[test]
    fn a_fix_never_costs_more_than_it_earns() {
        let grade = |points: f64| Grade {
            parts: Vec::new(),
            points,
            points_max: points,
            out_of: 100.0,
            unconfirmed: 0.0,
            remarks: Vec::new(),
        };
        let decision = Decision {
            student: "1".into(),
            part: None,
            points: None,
            patch: Some(DIFF.into()),
            penalty: Some(10.0),
            reason: "a sign".into(),
            by: "Eve".into(),
            when: "2019-10-20T10:00:00Z".into(),
            evidence: String::new(),
        };
        let with = |before: f64, after: f64| {
            let mut own = grade(before);
            let mended = choose(&decision, &mut own, grade(after)).unwrap();
            (own.points, mended.counts, own.remarks.concat())
        };
        assert_eq!(
            with(20.0, 95.0),
            (
                85.0,
                true,
                "mended by the instructor, 2 lines, less 10 points: 85 instead of 20 points: a sign (Eve, 2019-10-20)"
                    .to_owned()
            )
        );
        let (points, counts, words) = with(90.0, 95.0);
        assert_eq!((points, counts), (90.0, false));
        assert!(words.contains("that would be 85, no more than the 90 points"), "{words}");
        assert_eq!(with(0.0, 5.0).0, 0.0);
    }

    #[test]
    fn nothing_but_files_of_src() {
        let place = tempfile::tempdir().unwrap();
        fs::create_dir_all(place.path().join("src")).unwrap();
        fs::write(place.path().join("config.json"), "{}\n").unwrap();
        for (path, expected) in [
            ("config.json", "expected files of src/ alone"),
            ("../../src/a.rs", "which the submission does not have"),
            ("src/../config.json", "expected files of src/ alone"),
            ("/etc/passwd", "expected files of src/ alone"),
            ("src/none.rs", "which the submission does not have"),
        ] {
            let diff = format!("--- a/x\n+++ b/{path}\n@@ -1 +1 @@\n-{{}}\n+x\n");
            let error = format!("{:#}", apply(&diff, place.path()).unwrap_err());
            assert!(error.contains(expected), "{path}: {error}");
        }
        for text in ["", "hello\n", "--- a\n+++ b\nhello\n"] {
            lines_of(text).unwrap_err();
        }
    }
}
