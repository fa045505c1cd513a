//! A made-up batch for the tests: one perfect submission, one that multiplies by the cosine twice and
//! whose bonus could not be judged, one that does not build.

use super::{BatchReport, SubmissionReport};
use crate::class::Standing;
use crate::diagnosis::Diagnosis;
use crate::evidence::{Check, CheckId, Evidence, Measure, Picture, Verdict};
use crate::grading::{Conditions, Record, StageCost, Student};
use crate::held_back::HeldBack;
use crate::intake::Finding;
use crate::rubric::{Grade, PartGrade, Rules};

/// The batch.
pub(crate) fn report() -> BatchReport {
    BatchReport {
        assignment: "a2".into(),
        title: "Assignment 2: Point Lights & Shadows".into(),
        course: "ECSE 446/546: Realistic/Advanced Image Synthesis".into(),
        due: "2019-10-06T23:59:00-04:00".into(),
        rules: rules(),
        held_back: Some(HeldBack {
            seed: 18_446_744_073_709_551_557,
            scenes: vec![("held-back-1".into(), "cbox".into())],
        }),
        entries: vec![perfect(), two_cosines(), does_not_build()],
        class: None,
        released: false,
        has_similarity: false,
    }
}

fn rules() -> Rules {
    let part = |id: &str, title: &str, points: f64, bonus: bool, evidence: CheckId| {
        format!(
            r#"{{"id": "{id}", "title": "{title}", "points": {points}, "bonus": {bonus}, "evidence": ["{evidence}"]}}"#
        )
    };
    let parts = [
        part("1.1", "Diffuse reflectance model", 5.0, false, CheckId::BsdfDiffuse),
        part("1.2", "Phong reflectance model", 10.0, false, CheckId::BsdfPhong),
        part("1.3", "Unshadowed direct illumination", 20.0, false, CheckId::RadianceLit),
        part("1.4", "Direct illumination with hard shadows", 15.0, false, CheckId::ShadowRays),
        part("2.4", "Phong fragment shader", 25.0, false, CheckId::StagePhong),
        part("2.5", "Shadow mapping (bonus)", 20.0, true, CheckId::BonusImage),
    ]
    .join(",");
    let curve = "[[0, 0.9], [0.01, 0.85], [0.1, 0.5], [0.5, 0.1], [1, 0]]";
    let text = format!(
        r#"{{"curve": {curve}, "images_only_ceiling": 0.5, "gates": [], "paths": {{}}, "parts": [{parts}]}}"#
    );
    serde_json::from_str(&text).unwrap()
}

fn entry(name: &str, slug: &str, student: [&str; 3], conditions: Conditions) -> SubmissionReport {
    let [first_name, last_name, id] = student.map(str::to_owned);
    let record = Record {
        name: name.into(),
        slug: slug.into(),
        digest: "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08".into(),
        student: Student { first_name, last_name, id },
        findings: Vec::new(),
        diagnostics: String::new(),
        evidence: Evidence::default(),
        diagnoses: Vec::new(),
        views: Vec::new(),
        error_maps: Vec::new(),
        images: Vec::new(),
        sources: Vec::new(),
        stages: vec![
            StageCost { name: "intake".into(), wall_s: 0.021, cpu_s: 0.0 },
            StageCost { name: "build".into(), wall_s: 1.534, cpu_s: 1.49 },
            StageCost { name: "offline".into(), wall_s: 2.25, cpu_s: 4.1 },
        ],
        conditions,
    };
    let grade = Grade {
        parts: Vec::new(),
        points: 0.0,
        points_max: 0.0,
        unconfirmed: 0.0,
        out_of: 75.0,
        remarks: Vec::new(),
    };
    SubmissionReport { record, grade, standing: Standing::default() }
}

fn conditions(adapter: &str) -> Conditions {
    Conditions {
        umbra: "0.1.0".into(),
        isolation: "full: namespaces, landlock, seccomp, limits".into(),
        adapter: adapter.into(),
        compiler: "rustc 1.95.0".into(),
    }
}

/// Fills the parts; each is (least, most, reason, evidence).
fn grade(entry: &mut SubmissionReport, parts: [(f64, f64, &str, &str); 6]) {
    let rules = rules();
    entry.grade.parts = rules
        .parts
        .iter()
        .zip(parts)
        .map(|(part, (points, points_max, reason, evidence))| PartGrade {
            id: part.id.clone(),
            title: part.title.clone(),
            out_of: part.points,
            bonus: part.bonus,
            points,
            points_max,
            unconfirmed: 0.0,
            reason: reason.into(),
            evidence: evidence.split(", ").filter(|e| !e.is_empty()).map(str::to_owned).collect(),
        })
        .collect();
    let sum = |of: fn(&PartGrade) -> f64| {
        (entry.grade.parts.iter().map(of).sum::<f64>() * 100.0).round() / 100.0
    };
    (entry.grade.points, entry.grade.points_max) = (sum(|p| p.points), sum(|p| p.points_max));
}

fn check(
    id: CheckId,
    scene: &str,
    verdict: Verdict,
    summary: &str,
    measures: &[(&str, f64, f64)],
) -> Check {
    let measures =
        measures.iter().map(|&(name, value, bound)| Measure::at_most(None, name, value, bound));
    Check { measures: measures.collect(), ..Check::new(id, scene, verdict, summary) }
}

fn perfect() -> SubmissionReport {
    let student = ["Ada", "Lampglow", "260000001"];
    let mut entry = entry("a2_ada.zip", "a2_ada", student, conditions("llvmpipe (LLVM 15)"));
    let right = "the offline images are right on every scene";
    let drawn = "the realtime images are right on every scene";
    grade(
        &mut entry,
        [
            (5.0, 5.0, right, "image.offline"),
            (10.0, 10.0, right, "image.offline"),
            (20.0, 20.0, right, "image.offline"),
            (15.0, 15.0, right, "image.offline"),
            (25.0, 25.0, drawn, "image.realtime"),
            (20.0, 20.0, "shadows are right", "bonus.image @ cbox"),
        ],
    );
    entry.record.evidence.checks = vec![
        check(CheckId::SubmissionBuild, "", Verdict::Pass, "the source builds", &[]),
        check(
            CheckId::ImageOffline,
            "cbox",
            Verdict::Pass,
            "right",
            &[("pixels off (fraction)", 2e-5, 1e-3), ("bias (fraction)", 1.2e-4, 3e-3)],
        ),
        check(
            CheckId::BonusImage,
            "cbox",
            Verdict::Pass,
            "shadows are right",
            &[("acne", 0.0, 0.01)],
        ),
    ];
    entry
}

fn two_cosines() -> SubmissionReport {
    let student = ["Jörg", "Müller", "0260000002"];
    let mut entry =
        entry("two_cosines.tar.gz", "two_cosines", student, conditions("llvmpipe (LLVM 15)"));
    let lit = "unshadowed radiance is wrong along 496 of 512 rays with a test BSDF in place of yours, \"constant\"; worst at \
               (0.120, 1.200, -0.400): expected (0.5310, 0.5310, 0.5310), found (0.2104, 0.2104, 0.2104)";
    grade(
        &mut entry,
        [
            (5.0, 5.0, "the diffuse BSDF is right for 4096 queries", "bsdf.diffuse"),
            (10.0, 10.0, "the Phong BSDF is right for 4096 queries", "bsdf.phong"),
            (9.85, 9.85, lit, "radiance.lit @ cbox"),
            (15.0, 15.0, "visibility is right along 812 rays", "shadow.rays"),
            (25.0, 25.0, "the realtime images are right on every scene", "image.realtime"),
            (
                0.0,
                20.0,
                "could not be judged: no graphics adapter: install mesa-vulkan-drivers",
                "",
            ),
        ],
    );
    let mut radiance = check(
        CheckId::RadianceLit,
        "cbox",
        Verdict::Fail,
        lit,
        &[
            ("rays wrong with the test BSDF \"constant\" (fraction)", 0.96875, 2e-3),
            ("rays wrong with the test BSDF \"function of wo\" (fraction)", 0.0, 2e-3),
        ],
    )
    .with_hint("cos theta_i is multiplied twice: eval() holds it already");
    radiance.error = 0.1025;
    radiance.held_back = true;
    entry.record.diagnoses = vec![Diagnosis {
        part: "1.3".into(),
        mistakes: vec![vec!["light-two-cosines".into()]],
        factor: None,
        words: "the cosine is multiplied twice: eval() holds it already".into(),
        unexplained: 0.0125,
        runner_up: 0.75,
        pictures: Vec::new(),
    }];
    let pictures = [
        ("actual", "actual"),
        ("expected", "expected"),
        ("difference: relative, grey is 0", "difference"),
    ];
    radiance.pictures = pictures
        .map(|(title, file)| Picture {
            title: title.into(),
            file: format!("radiance_lit_cbox_{file}.png"),
            ..Default::default()
        })
        .into();
    entry.record.evidence.checks = vec![
        check(CheckId::SubmissionBuild, "", Verdict::Pass, "the source builds", &[]),
        check(
            CheckId::BsdfDiffuse,
            "",
            Verdict::Pass,
            "the diffuse BSDF is right for 4096 queries",
            &[("queries wrong (fraction)", 0.0, 0.0)],
        ),
        radiance,
        check(
            CheckId::StagePhong,
            "",
            Verdict::NotJudged,
            "the stages do not fit the shader contract",
            &[],
        ),
        check(
            CheckId::BonusImage,
            "teapot",
            Verdict::NotRun,
            "no graphics adapter: install mesa-vulkan-drivers",
            &[],
        ),
    ];
    entry.record.findings = vec![
        Finding::warning("unsafe_code", "the source uses unsafe").at("src/lib.rs").on_line(12),
        Finding::note(
            crate::intake::INCLUDE_INSIDE,
            "include_str! of \"../shaders/phong.fs.wgsl\"",
        ),
        Finding::note("wrapped", "one wrapping folder was taken off: \"a2\""),
    ];
    entry
}

fn does_not_build() -> SubmissionReport {
    let student = ["花子", "山田", "260000003"];
    let mut entry =
        entry("山田_花子.zip", "hand_in_3", student, conditions("none: no Vulkan driver"));
    let lost = "there is no code to judge, and no image shows this part";
    grade(
        &mut entry,
        [
            (
                0.0,
                0.0,
                "1.13 once the instructor confirms: pixels of diffuse materials are off by 0.5 %",
                "submitted.offline.diffuse",
            ),
            (0.0, 0.0, lost, ""),
            (
                0.0,
                0.0,
                "4.06 once the instructor confirms: lit pixels are off by 2 %",
                "submitted.offline.lit",
            ),
            (0.0, 0.0, lost, ""),
            (
                0.0,
                0.0,
                "6.25 once the instructor confirms: pixels of Phong materials are right",
                "submitted.realtime.phong",
            ),
            (0.0, 0.0, lost, ""),
        ],
    );
    for (part, unconfirmed) in [(0, 1.13), (2, 4.06), (4, 6.25)] {
        entry.grade.parts[part].unconfirmed = unconfirmed;
    }
    entry.grade.unconfirmed = 11.44;
    entry.grade.remarks = vec![
        "the source does not build; the images alone earn 11.44 points once the instructor confirms".into(),
    ];
    entry.record.diagnostics = "error[E0308]: mismatched types\n  --> src/bsdfs/phong.rs:21:9\n   |\n21 |         \
                                scale * kd\n   |         ^^^^^^^^^^ expected `Vec3`, found `f32`\n\nerror: aborting \
                                due to 1 previous error\n"
        .into();
    entry.record.evidence.checks =
        vec![check(CheckId::SubmissionBuild, "", Verdict::Fail, "the source does not build", &[])];
    entry.record.findings = vec![
        Finding::error("config_empty", "studentID is empty")
            .at("config.json")
            .on_line(3)
            .hint("write your student number"),
    ];
    entry
}
