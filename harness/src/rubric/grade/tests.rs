use proptest::prelude::*;

use super::*;
use crate::rubric::Curve;
use crate::rubric::rules::{Gate, PathRule, Trust};

/// Two parts on one path, a bonus of its own, one gate.
fn rules() -> Rules {
    let part = |id: &str, points, path: &str, evidence, fallback: &[CheckId], images| Part {
        id: id.into(),
        title: format!("part {id}"),
        points,
        bonus: path.is_empty(),
        proof: None,
        any_scene: path.is_empty(),
        path: path.into(),
        evidence: vec![evidence],
        files: Vec::new(),
        fallback: fallback.to_vec(),
        images_only: vec![images, NOISE],
    };
    let rules = Rules {
        curve: Curve::try_from(vec![[0.0, 0.9], [0.1, 0.5], [1.0, 0.0]]).unwrap(),
        images_only_ceiling: 0.25,
        images_only_trust: Some(Trust { check: NOISE, ceiling: 0.4 }),
        gates: vec![Gate {
            check: TREE,
            ceiling: 0.0,
            reason: "wrong tree".into(),
            private: false,
        }],
        paths: [(
            "offline".into(),
            PathRule { proof: IMAGE, unseen: vec![UNSEEN], residual_part: "2".into() },
        )]
        .into(),
        parts: vec![
            part("1", 10.0, "offline", BSDF, &[PIXELS], IMAGES_1),
            Part {
                evidence: vec![RAYS, UNSEEN],
                ..part("2", 30.0, "offline", RAYS, &[], IMAGES_2)
            },
            part("3", 20.0, "", BONUS, &[], CheckId::SubmittedRealtimeAll),
        ],
    };
    assert_eq!(rules.problem(), None);
    rules
}

fn check(id: CheckId, verdict: Verdict, error: f64) -> Check {
    Check { error, ..Check::new(id, "", verdict, format!("{id} said so")) }
}

fn points(checks: &[Check]) -> Vec<f64> {
    let grade = grade(&rules(), &Evidence { checks: checks.to_vec() });
    grade.parts.iter().map(|part| part.points).collect()
}

/// The same check on a held-back scene.
fn hidden(check: Check) -> Check {
    Check { scene: "held-back-1".into(), held_back: true, ..check }
}

const BSDF: CheckId = CheckId::BsdfDiffuse;
const RAYS: CheckId = CheckId::RadianceLit;
const UNSEEN: CheckId = CheckId::LoopSamples;
const IMAGE: CheckId = CheckId::ImageOffline;
const PIXELS: CheckId = CheckId::ImageRealtimeDiffuse;
const BONUS: CheckId = CheckId::BonusImage;
const TREE: CheckId = CheckId::SubmissionTree;
const NOISE: CheckId = CheckId::SubmittedSeed;
const IMAGES_1: CheckId = CheckId::SubmittedOfflineDiffuse;
const IMAGES_2: CheckId = CheckId::SubmittedOfflineLit;

use Verdict::{Fail, NotImplemented, NotJudged, NotRun, Pass};

#[test]
fn right_end_to_end_is_enough_on_every_scene_only() {
    let wrong_part = check(BSDF, Fail, 1.0);
    let all = [check(IMAGE, Pass, 0.0), wrong_part.clone(), check(BONUS, NotImplemented, 1.0)];
    assert_eq!(points(&all), [10.0, 30.0, 0.0]);
    let one_wrong = [all.as_slice(), &[check(IMAGE, Fail, 0.2), check(RAYS, Pass, 0.0)]].concat();
    assert_eq!(points(&one_wrong), [0.0, 30.0, 0.0]);
}

#[test]
fn a_part_that_is_right_end_to_end_is_worth_all_whatever_else_is_wrong() {
    let mut rules = rules();
    rules.parts[0].proof = Some(PIXELS);
    let points = |pixels: &[Verdict]| {
        let mut checks =
            vec![check(IMAGE, Fail, 0.5), check(BSDF, Fail, 1.0), check(RAYS, Fail, 0.1)];
        checks.extend(pixels.iter().map(|verdict| check(PIXELS, *verdict, 0.3)));
        let grade = grade(&rules, &Evidence { checks });
        grade.parts.iter().map(|part| part.points).take(2).collect::<Vec<_>>()
    };
    assert_eq!(points(&[Pass, Pass]), [10.0, 15.0]);
    assert_eq!(points(&[Pass, NotJudged]), [10.0, 15.0]);
    for unproven in [&[][..], &[Pass, Fail], &[NotJudged], &[Pass, NotRun], &[Pass, NotImplemented]]
    {
        assert_eq!(points(unproven), [0.0, 15.0], "{unproven:?}");
    }
}

#[test]
fn the_worst_scene_counts_and_the_curve_gives_partial_points() {
    let base = [check(IMAGE, Fail, 0.5), check(RAYS, Pass, 0.0), check(BONUS, Pass, 0.0)];
    for (error, expected) in [(0.0, 9.0), (0.05, 7.0), (0.1, 5.0), (1.0, 0.0)] {
        let mut checks = base.to_vec();
        checks.extend([check(BSDF, Pass, 0.0), check(BSDF, Fail, error)]);
        assert_eq!(points(&checks), [expected, 30.0, 20.0], "error {error}");
    }
}

#[test]
fn one_right_scene_is_enough_where_the_student_may_choose() {
    let at =
        |scene: &str, verdict, error| Check { scene: scene.into(), ..check(BONUS, verdict, error) };
    let checks = [at("teapot", Fail, 1.0), at("cbox", Pass, 0.0)];
    assert_eq!(points(&checks)[2], 20.0);
    let checks = [at("teapot", NotImplemented, 1.0), at("cbox", Fail, 0.1)];
    assert_eq!(points(&checks)[2], 10.0);
}

#[test]
fn an_unexplained_wrong_image_is_paid_by_the_residual_part() {
    let checks = [check(IMAGE, Fail, 0.1), check(BSDF, Pass, 0.0), check(RAYS, Pass, 0.0)];
    let grade = grade(&rules(), &Evidence { checks: checks.to_vec() });
    assert_eq!(grade.parts[0].points, 10.0);
    assert_eq!(grade.parts[1].points, 15.0);
    assert!(grade.parts[1].reason.contains("every part alone is right"));
}

#[test]
fn what_cannot_be_judged_is_a_range_with_its_reason() {
    let checks = [check(IMAGE, Fail, 0.5), check(BSDF, NotRun, 0.0), check(RAYS, Fail, 1.0)];
    let graded = grade(&rules(), &Evidence { checks: checks.to_vec() });
    let part = &graded.parts[0];
    assert_eq!((part.points, part.points_max), (0.0, 10.0));
    assert_eq!(part.reason, "could not be judged: bsdf.diffuse said so");
    assert_eq!((graded.parts[2].points, graded.parts[2].points_max), (0.0, 20.0));
    assert_eq!((graded.points, graded.points_max), (0.0, 30.0));
    assert_eq!(graded.out_of, 40.0, "the bonus comes on top");
}

#[test]
fn evidence_that_does_not_apply_gives_way_to_the_fallback() {
    let checks = [
        check(IMAGE, Fail, 0.5),
        check(BSDF, NotJudged, 0.0),
        check(PIXELS, Fail, 0.1),
        check(RAYS, NotImplemented, 1.0),
    ];
    assert_eq!(points(&checks)[..2], [5.0, 0.0]);
}

#[test]
fn images_alone_earn_nothing_until_the_instructor_confirms() {
    let without_code = |more: &[Check]| {
        let base = [check(BUILD, Fail, 1.0), check(IMAGES_1, Pass, 0.0), check(IMAGE, Pass, 0.0)];
        let images = [check(IMAGES_2, Fail, 0.1)];
        let grade = grade(&rules(), &Evidence { checks: [&base, &images[..], more].concat() });
        assert_eq!((grade.points, grade.points_max), (0.0, 0.0));
        let parts = grade.parts.iter();
        assert!(parts.clone().all(|part| (part.points, part.points_max) == (0.0, 0.0)));
        let unconfirmed: Vec<f64> = parts.map(|part| part.unconfirmed).collect();
        assert_eq!(grade.unconfirmed, unconfirmed.iter().sum::<f64>());
        (unconfirmed, grade.remarks[0].clone(), grade.parts[0].reason.clone())
    };
    let (unconfirmed, remark, reason) = without_code(&[]);
    assert_eq!(unconfirmed, [2.5, 3.75, 0.0]);
    assert_eq!(
        remark,
        "submission.build said so; the images alone earn 6.25 points once the instructor confirms"
    );
    assert!(reason.starts_with("2.5 once the instructor confirms: ") && reason.contains("anybody"));
    // With noise that only the student's number explains they are worth more; not with half of it.
    let (unconfirmed, _, reason) = without_code(&[check(NOISE, Pass, 0.0)]);
    assert_eq!(unconfirmed, [4.0, 6.0, 8.0]);
    assert!(reason.contains("the noise of the student's number"), "{reason}");
    let half = [check(NOISE, Pass, 0.0), check(NOISE, NotJudged, 0.0)];
    assert_eq!(without_code(&half).0[..2], [2.5, 3.75]);

    // A suspicion is for the instructor: the student's reason does not name it.
    let mut suspects = rules();
    suspects.gates.push(Gate {
        check: IMAGES_2,
        ceiling: 1.0,
        reason: "for the instructor: x".into(),
        private: true,
    });
    let checks = vec![check(BUILD, Fail, 1.0), check(IMAGES_2, Fail, 1.0)];
    let suspected = grade(&suspects, &Evidence { checks });
    assert_eq!(suspected.parts[1].reason, FOR_THE_INSTRUCTOR);

    let nothing = grade(&rules(), &Evidence { checks: vec![check(BUILD, Fail, 1.0)] });
    assert_eq!(
        (nothing.unconfirmed, &nothing.remarks[..]),
        (0.0, &["submission.build said so".to_owned()][..])
    );
    let closed = [check(BUILD, Fail, 1.0), check(IMAGES_1, Pass, 0.0), check(TREE, Fail, 1.0)];
    assert_eq!(grade(&rules(), &Evidence { checks: closed.to_vec() }).unconfirmed, 0.0);
    // Where there is code, images are worth nothing by themselves.
    let built = [check(BUILD, Pass, 0.0), check(IMAGES_1, Pass, 0.0), check(IMAGE, Fail, 1.0)];
    assert_eq!(grade(&rules(), &Evidence { checks: built.to_vec() }).unconfirmed, 0.0);
}

#[test]
fn a_part_is_worth_the_lower_of_public_and_held_back_scenes() {
    let public = [check(IMAGE, Pass, 0.0), check(BONUS, Pass, 0.0)];
    let held_back = [
        hidden(check(IMAGE, Fail, 0.5)),
        hidden(check(RAYS, Fail, 0.1)),
        hidden(check(BONUS, Pass, 0.0)),
        check(BSDF, Pass, 0.0),
    ];
    assert_eq!(points(&public), [10.0, 30.0, 20.0]);
    let both = [&public[..], &held_back[..]].concat();
    assert_eq!(points(&both), [10.0, 15.0, 20.0]);
    // The other way round: what is right on held-back scenes rescues nothing.
    let other = [
        hidden(check(IMAGE, Pass, 0.0)),
        hidden(check(BONUS, Pass, 0.0)),
        check(IMAGE, Fail, 0.5),
        check(RAYS, Fail, 0.1),
        check(BSDF, Pass, 0.0),
        check(BONUS, Pass, 0.0),
    ];
    assert_eq!(points(&other), [10.0, 15.0, 20.0]);
}

#[test]
fn the_best_scene_counts_among_public_and_among_held_back_ones_apart() {
    let at =
        |scene: &str, verdict, error| Check { scene: scene.into(), ..check(BONUS, verdict, error) };
    let held_back = |scene, verdict, error| Check { scene, ..hidden(check(BONUS, verdict, error)) };
    let mut checks = vec![at("teapot", Pass, 0.0), at("cbox", Fail, 1.0)];
    checks.push(held_back("held-back-1".into(), Fail, 0.1));
    checks.push(held_back("held-back-2".into(), Fail, 1.0));
    assert_eq!(points(&checks)[2], 10.0);
    checks.push(held_back("held-back-3".into(), Pass, 0.0));
    assert_eq!(points(&checks)[2], 20.0);
}

#[test]
fn reasons_tell_nothing_of_held_back_scenes() {
    let secret = Check {
        summary: "worst at (0.120, 1.200, -0.400)".into(),
        ..hidden(check(RAYS, Fail, 0.123_456))
    };
    let image = |verdict| hidden(check(IMAGE, verdict, 0.5));
    let base = vec![check(IMAGE, Pass, 0.0), check(BSDF, Pass, 0.0)];
    let reason = |checks: &[Check]| {
        let evidence = Evidence { checks: [base.as_slice(), checks].concat() };
        grade(&rules(), &evidence).parts[1].reason.clone()
    };
    assert_eq!(reason(&[image(Fail), secret.clone()]), "wrong on a held-back scene (error 0.12)");
    let residual = reason(&[image(Fail), hidden(check(RAYS, Pass, 0.0))]);
    assert_eq!(residual, "every part alone is right, but wrong on a held-back scene (error 0.5)");
    let silent = Check { verdict: NotRun, ..secret };
    assert_eq!(
        reason(&[image(Fail), silent]),
        "could not be judged: not judged on a held-back scene"
    );
}

#[test]
fn who_dodges_the_held_back_scenes_gets_nothing() {
    // Public evidence alone would be worth all points.
    let public =
        [IMAGE, RAYS, BSDF].map(|id| Check { scene: "public".into(), ..check(id, Pass, 0.0) });
    let dodged = [hidden(check(IMAGE, Fail, 1.0)), hidden(check(RAYS, NotJudged, 0.0))];
    let evidence = Evidence { checks: [&public[..], &dodged[..]].concat() };
    let part = &grade(&rules(), &evidence).parts[1];
    assert_eq!((part.points, part.points_max), (0.0, 0.0));
}

fn any_check() -> impl Strategy<Value = Check> {
    let id = prop::sample::select(vec![IMAGE, BSDF, PIXELS, RAYS, BONUS, TREE, BUILD]);
    let verdict = prop::sample::select(vec![Pass, Fail, NotImplemented, NotJudged, NotRun]);
    (id, verdict, 0.0..2.0f64, 0..6u8).prop_map(|(id, verdict, error, scene)| Check {
        scene: if scene == 0 { String::new() } else { format!("scene{scene}") },
        held_back: scene > 3,
        ..check(id, verdict, error)
    })
}

/// The checks of a path under two conventions.
fn under(convention: &str, bsdf: f64, rays: f64) -> Vec<Check> {
    let of = |id: CheckId, error: f64| Check {
        convention: convention.into(),
        ..check(id, if error == 0.0 { Pass } else { Fail }, error)
    };
    vec![of(BSDF, bsdf), of(RAYS, rays)]
}

#[test]
fn settled_evidence_stays_as_it_is() {
    for (own, other) in [(1.0, 0.0), (0.0, 1.0)] {
        let checks = [under("", own, 0.5), under("other", other, 0.5)].concat();
        let once = settle(&rules(), &Evidence { checks });
        assert_eq!(settle(&rules(), &once), once);
        assert_eq!(grade(&rules(), &once).points, grade_settled(&rules(), &once).points);
    }
}

#[test]
fn what_no_image_shows_counts_beside_right_images() {
    let image = check(IMAGE, Pass, 0.0);
    assert_eq!(points(&[image.clone(), check(UNSEEN, Fail, 0.1)])[..2], [10.0, 15.0]);
    assert_eq!(
        points(&[image, check(UNSEEN, Pass, 0.0), check(RAYS, Fail, 1.0)])[..2],
        [10.0, 30.0]
    );
}

#[test]
fn the_convention_that_is_worth_most_holds_for_all_parts_of_a_path() {
    let wrong = check(IMAGE, Fail, 0.5);
    let own = under("", 0.1, 0.1);
    let other = under("the integrator multiplies by pi", 0.0, 0.1);
    let both = [vec![wrong.clone()], own.clone(), other.clone()].concat();
    assert_eq!(points(&both)[..2], [10.0, 15.0]);
    // PartScore no more: the handout's own.
    let worse = under("another", 0.1, 0.1);
    let settled = settle(&rules(), &Evidence { checks: [own.clone(), worse].concat() });
    assert_eq!(settled.checks, own);
    // What it does not judge anew stands.
    let bsdf_alone = vec![other[0].clone()];
    let some = [vec![wrong], own.clone(), bsdf_alone].concat();
    assert_eq!(points(&some)[..2], [10.0, 15.0]);
}

#[test]
fn a_scene_costs_no_more_than_its_weight() {
    let hidden = |weight| Check { weight, scene: "backfaces".into(), ..check(BSDF, Fail, 1.0) };
    let checks = |weight| [check(IMAGE, Fail, 0.5), check(RAYS, Pass, 0.0), hidden(weight)];
    assert_eq!(points(&checks(0.2))[0], 8.0);
    assert_eq!(points(&checks(1.0))[0], 0.0);
    // The largest loss counts, not their sum.
    let two = [&checks(0.2)[..], &[check(BSDF, Fail, 0.05)]].concat();
    assert_eq!(points(&two)[0], 7.0);
}

/// Under two conventions, whatever is made wrong in addition.
fn mistakes() -> impl Strategy<Value = [f64; 4]> {
    let error = || prop_oneof![Just(0.0), 0.001..1.0f64];
    [error(), error(), error(), error()]
}

proptest! {
    #[test]
    fn a_second_mistake_never_adds_points(first in mistakes(), second in mistakes()) {
        let total = |errors: [f64; 4]| {
            let [a, b, c, d] = errors;
            // Nothing is right end to end, and every part says why.
            let image = check(IMAGE, Fail, 1.0);
            points(&[vec![image], under("", a, b.max(0.001)), under("pi", c, d.max(0.001))].concat())
        };
        let both = std::array::from_fn(|i| first[i].max(second[i]));
        let (one, other, both) = (total(first), total(second), total(both));
        let sum = |points: &[f64]| points.iter().sum::<f64>();
        prop_assert!(sum(&both) <= sum(&one).min(sum(&other)) + 1e-9);
    }

    #[test]
    fn points_are_bounded_and_independent_of_the_order(
        checks in prop::collection::vec(any_check(), 0..12), turn in 0..12usize
    ) {
        let before = grade(&rules(), &Evidence { checks: checks.clone() });
        for part in &before.parts {
            prop_assert!(0.0 <= part.points && part.points <= part.points_max);
            prop_assert!(part.points_max + part.unconfirmed <= part.out_of);
        }
        let mut turned = checks;
        if !turned.is_empty() {
            let middle = turn % turned.len();
            turned.rotate_left(middle);
            turned.reverse();
        }
        prop_assert_eq!(before, grade(&rules(), &Evidence { checks: turned }));
    }

    #[test]
    fn held_back_scenes_never_add_points(
        checks in prop::collection::vec(any_check(), 0..16)
    ) {
        let all = grade(&rules(), &Evidence { checks: checks.clone() });
        let apart = |wanted: &dyn Fn(&Check) -> bool| {
            let checks = checks.iter().filter(|check| wanted(check)).cloned().collect();
            grade(&rules(), &Evidence { checks })
        };
        let public = apart(&|check| !check.held_back);
        // The same scenes, were they public.
        let mut held_back: Vec<Check> =
            checks.iter().filter(|c| c.held_back || c.scene.is_empty()).cloned().collect();
        let any = held_back.iter().any(|check| check.held_back);
        held_back.iter_mut().for_each(|check| check.held_back = false);
        let held_back = grade(&rules(), &Evidence { checks: held_back });
        for ((all, public), held_back) in all.parts.iter().zip(&public.parts).zip(&held_back.parts) {
            let lower = |a: f64, b: f64| if any { a.min(b) } else { a };
            prop_assert_eq!(all.points, lower(public.points, held_back.points));
            prop_assert_eq!(all.points_max, lower(public.points_max, held_back.points_max));
        }
    }

    #[test]
    fn a_larger_error_never_earns_more(
        mut checks in prop::collection::vec(any_check(), 1..12), at in 0..12usize, more in 0.0..1.0f64
    ) {
        let before = grade(&rules(), &Evidence { checks: checks.clone() });
        let at = at % checks.len();
        checks[at].error += more;
        let after = grade(&rules(), &Evidence { checks: checks.clone() });
        prop_assert!(after.points <= before.points);
        if checks[at].verdict == Pass && checks[at].id != BUILD && checks[at].id != TREE {
            checks[at].verdict = Fail;
            // Failing may unlock isolation, which never gives a part more than in full. What a part
            // paid only because no other explained the image, it gets back when one does.
            let failed = grade(&rules(), &Evidence { checks });
            for (failed, after) in failed.parts.iter().zip(&after.parts) {
                let residual = after.reason.starts_with("every part alone is right");
                prop_assert!(residual || failed.points <= after.points, "{failed:?} {after:?}");
            }
        }
    }
}
