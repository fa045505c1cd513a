//! The parts and scenes that a student asks for: `--part`, `--scene`.

use anyhow::ensure;

use super::context::Context;
use crate::assignment::Assignment;
use crate::evidence::{CheckId, Evidence, Verdict};
use crate::grading::RenderPath;
use crate::rubric::{Grade, Part, PartGrade, Rules};

/// What of an assignment is asked.
pub struct Selection {
    /// The parts; empty for all.
    pub parts: Vec<String>,
    /// The scenes; empty for all.
    pub scenes: Vec<String>,
}

impl Selection {
    /// Whether nothing is left out.
    pub fn is_all(&self) -> bool {
        self.parts.is_empty() && self.scenes.is_empty()
    }

    /// Removes from an assignment the parts and scenes that are not asked for.
    ///
    /// # Errors
    /// When there is no such part or scene.
    pub fn restrict(&self, assignment: &mut Assignment) -> anyhow::Result<()> {
        let ids: Vec<&str> = assignment.rules.parts.iter().map(|part| part.id.as_str()).collect();
        for part in &self.parts {
            ensure!(
                ids.contains(&part.as_str()),
                "there is no part {part}; expected one of {}",
                ids.join(", ")
            );
        }
        let names: Vec<&str> = assignment.scenes.iter().map(|scene| scene.name.as_str()).collect();
        for scene in &self.scenes {
            ensure!(
                names.contains(&scene.as_str()),
                "there is no scene {scene}; expected one of {}",
                names.join(", ")
            );
        }
        if !self.scenes.is_empty() {
            assignment.scenes.retain(|scene| self.scenes.contains(&scene.name));
            // Images of a few scenes stand for no part: what is wrong may not show on them.
            let rules = &mut assignment.rules;
            for (name, path) in &mut rules.paths {
                let own = rules.parts.iter().filter(|part| part.path == *name);
                path.unseen = own.flat_map(|part| part.evidence.clone()).collect();
            }
            rules.parts.iter_mut().for_each(|part| part.proof = None);
        }
        let bonus = assignment.rules.parts.iter().any(|part| part.bonus && self.asks(&part.id));
        if !bonus {
            assignment.scenes.iter_mut().for_each(|scene| scene.bonus = None);
        }
        Ok(())
    }

    /// The halves of the assignment that the parts belong to. The bonus is drawn.
    pub fn paths(&self, context: &Context) -> Vec<RenderPath> {
        let path = |part: &Part| match part.path.as_str() {
            "offline" => RenderPath::Offline,
            _ => RenderPath::Realtime,
        };
        let parts = &context.assignment.rules.parts;
        let asked =
            |path_asked| parts.iter().any(|part| self.asks(&part.id) && path(part) == path_asked);
        RenderPath::ALL.into_iter().filter(|&path| asked(path)).collect()
    }

    /// The checks that the parts hang on.
    pub fn checks(&self, context: &Context) -> Vec<CheckId> {
        let parts = context.assignment.rules.parts.iter();
        let asked = parts.filter(|part| self.asks(&part.id));
        asked.flat_map(|part| part.evidence.iter().chain(&part.fallback).copied()).collect()
    }

    /// Takes out of a grade what was not asked, and what the chosen scenes say nothing of.
    pub fn only_of(&self, grade: &mut Grade, rules: &Rules, evidence: &Evidence) {
        if self.is_all() {
            return;
        }
        grade.parts.retain(|part| self.asks(&part.id));
        if !self.scenes.is_empty() {
            let told =
                |id: &CheckId| evidence.named(*id).any(|check| check.verdict != Verdict::NotJudged);
            let silent = |part: &&Part| !part.evidence.iter().chain(&part.fallback).any(told);
            let silent: Vec<&str> =
                rules.parts.iter().filter(silent).map(|part| part.id.as_str()).collect();
            let is_silent = |part: &PartGrade| silent.contains(&part.id.as_str());
            // What was asked for by its number is not passed over.
            grade.parts.retain(|part| !self.parts.is_empty() || !is_silent(part));
            for part in grade.parts.iter_mut().filter(|part| is_silent(part)) {
                (part.points, part.points_max) = (0.0, part.out_of);
                part.reason = "could not be judged: the chosen scenes say nothing of it".into();
            }
            if self.parts.is_empty() && !silent.is_empty() {
                grade.remarks.push(format!("nothing of {} shows there", silent.join(", ")));
            }
        }
        grade.points = grade.parts.iter().map(|part| part.points).sum();
        grade.points_max = grade.parts.iter().map(|part| part.points_max).sum();
        // A bonus makes no points missing, unless nothing else was asked.
        let is_bonus = grade.parts.iter().all(|part| part.bonus);
        let required = grade.parts.iter().filter(|part| is_bonus || !part.bonus);
        grade.out_of = required.map(|part| part.out_of).sum();
        grade.remarks.push(crate::report::checked_only(&self.in_words()));
    }

    pub fn asks(&self, part: &str) -> bool {
        self.parts.is_empty() || self.parts.iter().any(|asked| asked == part)
    }

    /// `part 2.3 on scene cbox`; empty for all.
    pub fn in_words(&self) -> String {
        let list = |noun: &str, names: &[String]| match names {
            [] => None,
            [one] => Some(format!("{noun} {one}")),
            many => Some(format!("{noun}s {}", many.join(", "))),
        };
        match (list("part", &self.parts), list("scene", &self.scenes)) {
            (Some(parts), Some(scenes)) => format!("{parts} on {scenes}"),
            (parts, scenes) => parts.or(scenes).unwrap_or_default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::evidence::Check;

    fn asked(parts: &[&str], scenes: &[&str]) -> Selection {
        let owned = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
        Selection { parts: owned(parts), scenes: owned(scenes) }
    }

    #[test]
    fn what_is_not_asked_is_taken_out() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let load = || Assignment::load(&root).unwrap();
        let restricted = |asked: Selection| {
            let mut assignment = load();
            asked.restrict(&mut assignment).map(|()| assignment)
        };
        let whole = restricted(asked(&[], &[])).unwrap();
        assert_eq!(whole.scenes, load().scenes);
        let pixels = restricted(asked(&["2.3"], &["cbox", "scale"])).unwrap();
        let names: Vec<&str> = pixels.scenes.iter().map(|scene| scene.name.as_str()).collect();
        assert_eq!(names, ["cbox", "scale"]);
        assert!(pixels.scenes.iter().all(|scene| scene.bonus.is_none()));
        assert!(restricted(asked(&["2.5"], &["cbox"])).unwrap().scenes[0].bonus.is_some());
        let error = restricted(asked(&["2.9"], &[])).unwrap_err().to_string();
        assert_eq!(
            error,
            "there is no part 2.9; expected one of 1.1, 1.2, 1.3, 1.4, 2.1, 2.2, 2.3, 2.4, 2.5"
        );
        let error = restricted(asked(&[], &["teepot"])).unwrap_err().to_string();
        assert!(
            error.starts_with("there is no scene teepot; expected one of teapot, cbox"),
            "{error}"
        );
    }

    #[test]
    fn a_bonus_is_no_part_of_what_can_be_missing() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let rules = Assignment::load(&root).unwrap().rules;
        let out_of = |parts: &[&str], scenes: &[&str]| {
            // Every check of every part was asked on one scene.
            let ids = rules.parts.iter().flat_map(|part| part.evidence.clone());
            let checks = ids.map(|id| Check::new(id, "cbox", Verdict::Pass, "")).collect();
            let evidence = Evidence { checks };
            let mut grade = crate::rubric::grade(&rules, &evidence);
            asked(parts, scenes).only_of(&mut grade, &rules, &evidence);
            (grade.out_of, grade.remarks.last().cloned().unwrap_or_default())
        };
        assert_eq!(out_of(&[], &[]).0, 100.0);
        assert_eq!(out_of(&[], &["cbox"]), (100.0, "only scene cbox was checked".into()));
        assert_eq!(out_of(&["2.4", "2.5"], &[]), (25.0, "only parts 2.4, 2.5 were checked".into()));
        assert_eq!(
            out_of(&["2.4"], &["cbox", "scale"]),
            (25.0, "only part 2.4 on scenes cbox, scale was checked".into())
        );
        assert_eq!(out_of(&["2.5"], &["cbox"]).0, 20.0, "the bonus alone");
    }

    #[test]
    fn what_is_asked_has_words() {
        assert_eq!(asked(&[], &[]).in_words(), "");
        assert_eq!(asked(&["1.1"], &[]).in_words(), "part 1.1");
        assert_eq!(asked(&["1.1", "2.5"], &["cbox"]).in_words(), "parts 1.1, 2.5 on scene cbox");
        assert_eq!(asked(&[], &["a", "b"]).in_words(), "scenes a, b");
    }
}
