use basecode::Vec3;

use super::shadows::judge_shadows;
use super::*;
use crate::convention::Convention;
use crate::expected::Visibility;
use crate::price::PriceClass;
use crate::{Check, CheckId, Measure, RuleId, Verdict, changes};

/// Forty lit and twenty dark rays at various distances and angles.
pub(super) fn batch() -> RayBatch {
    let point = |index: usize| {
        let cos = 0.1 + 0.9 * (index as f32 * 0.37).fract();
        let wi = Vec3::new((1.0 - cos * cos).sqrt(), 0.0, cos);
        SurfacePoint {
            ray: Ray::new(Vec3::ZERO, Vec3::Z),
            shape: 0,
            primitive: 0,
            position: Vec3::new(index as f32, 0.0, 0.0),
            normal: Vec3::Z,
            wo: Vec3::Z,
            wi,
            distance: 1.0 + (index as f32 * 0.71).fract(),
            visibility: if index < 40 { Visibility::Clear } else { Visibility::Blocked },
        }
    };
    let points: Vec<SurfacePoint> = (0..60).map(point).collect();
    RayBatch {
        scene: "s".into(),
        rays: points.iter().map(|p| p.ray).collect(),
        pixels: (0..60).collect(),
        points,
        lit: 40,
        contacts: 0,
        intensity: Vec3::new(1.0, 2.0, 3.0),
        light: Vec3::Z,
    }
}

fn witness(_: &SurfacePoint) -> [f64; 3] {
    [1.0, 0.5, 0.25]
}

/// Right answers times `factor`.
fn answers(batch: &RayBatch, factor: impl Fn(usize, &SurfacePoint) -> f64) -> Vec<[f32; 3]> {
    (0..batch.points.len())
        .map(|index| {
            let point = &batch.points[index];
            let factor = factor(index, point);
            batch.unshadowed(index, witness(point)).map(|v| (v * factor) as f32)
        })
        .collect()
}

fn unshadowed(factor: impl Fn(usize, &SurfacePoint) -> f64) -> Check {
    let batch = batch();
    let values = answers(&batch, factor);
    let of =
        |index: usize, shading: &Shading| batch.witnessed(index, shading, &|_, _| [1.0, 0.5, 0.25]);
    let answer = Unshadowed { witness: "constant", of: &of, values: &values, black_below: true };
    judge_unshadowed(&batch, &[answer], &Convention::default(), &changes::integrator_changes())
}

#[test]
fn unshadowed_radiance_is_judged_on_lit_rays_only() {
    let right = unshadowed(|index, _| if index < 40 { 1.0 } else { 0.0 });
    assert_eq!((right.verdict, right.error), (Verdict::Pass, 0.0));
    // A gain of 8 % is one slip, and costs what a slip costs.
    for (factor, error) in [(0.0, 1.0), (1.01, 0.01), (1.08, 0.02), (f64::NAN, 1.0)] {
        let wrong = unshadowed(|_, _| factor);
        assert_eq!(wrong.verdict, Verdict::Fail, "{factor}");
        assert!((wrong.error - error).abs() < 1e-4, "{factor}: {}", wrong.error);
    }
}

#[test]
fn known_factors_are_named() {
    for varying in [|p: &SurfacePoint| p.wi.z, |p: &SurfacePoint| p.distance.powi(2).min(1.3)] {
        assert_eq!(unshadowed(|_, p| f64::from(varying(p))).hint, "");
    }
    assert_eq!(unshadowed(|index, _| if index < 3 { 0.9 } else { 1.0 }).hint, "");
    assert!(unshadowed(|_, _| 4.0 * std::f64::consts::PI).hint.contains("4 pi"));
    assert!(unshadowed(|_, _| 0.0).hint.contains("is 0"));
}

#[test]
fn a_constant_beside_the_distance_or_on_top_is_a_slip() {
    let squared = |p: &SurfacePoint| f64::from(p.distance).powi(2);
    let softened = unshadowed(|_, p| squared(p) / (1.0 + squared(p)));
    assert_eq!((softened.error, softened.mistake.as_str()), (0.02, "1 + r^2 in place of r^2"));
    // 0.05 on top of each channel, whatever the light.
    let batch = batch();
    let values: Vec<[f32; 3]> =
        answers(&batch, |_, _| 1.0).into_iter().map(|v| v.map(|v| v + 0.05)).collect();
    let of =
        |index: usize, shading: &Shading| batch.witnessed(index, shading, &|_, _| [1.0, 0.5, 0.25]);
    let answer = Unshadowed { witness: "constant", of: &of, values: &values, black_below: true };
    let (handout, changes) = (Convention::default(), changes::integrator_changes());
    let added = judge_unshadowed(&batch, &[answer], &handout, &changes);
    assert_eq!(added.mistake, "a constant is added");
    assert!((added.error - 0.02).abs() < 1e-3, "{}", added.error);
}

#[test]
fn a_shadow_ray_that_starts_or_ends_by_another_constant_is_a_slip() {
    let batch = batch();
    // What is in shadow has an occluder just before a tenth of its way, or just after; what is lit has one behind the
    // light, beyond 5 or before.
    let occluder = |index: usize| match index {
        index if index < 40 => 2.5 + (index % 7) as f32,
        index if index.is_multiple_of(2) => 0.105 * batch.points[index].distance,
        index => 0.095 * batch.points[index].distance,
    };
    let blocker = |ray: &Ray| {
        let t = occluder(ray.origin.x.round() as usize);
        (ray.min_t..ray.max_t).contains(&t).then_some(1)
    };
    let occluders = Occluders { blocker: &blocker, is_phong: &|_| false };
    let without = answers(&batch, |_, _| 1.0);
    let judge = |is_dark: &dyn Fn(usize, f32) -> bool| {
        let seen =
            |index: usize, p: &SurfacePoint| f64::from(u8::from(!is_dark(index, p.distance)));
        let with = answers(&batch, seen);
        let shaded = (without.as_slice(), without.as_slice());
        judge_shadows(&batch, &witness, (&with, &without), shaded, &occluders)
    };
    let late = judge(&|index, r| occluder(index) > 0.1 * r && index >= 40);
    assert_eq!((late.error, late.mistake.as_str()), (0.02, "the shadow ray starts at .1 r"));
    let fixed = judge(&|index, _| occluder(index) < 5.0);
    assert_eq!((fixed.error, fixed.mistake.as_str()), (0.02, "the shadow ray ends at 5"));
}

const NOTHING: Occluders = Occluders { blocker: &|_| None, is_phong: &|_| false };

fn shadows(with: impl Fn(usize) -> f64, without: impl Fn(usize) -> f64) -> Check {
    let batch = batch();
    let with = answers(&batch, |index, _| with(index));
    let without = answers(&batch, |index, _| without(index));
    let check = judge_shadows(&batch, &witness, (&with, &without), (&without, &without), &NOTHING);
    let mut checks = [check];
    leave_unjudged(&mut checks);
    let [check] = checks;
    check
}

#[test]
fn a_shadow_query_that_moves_what_is_shaded_is_seen() {
    let batch = batch();
    let right = answers(&batch, |index, _| if index < 40 { 1.0 } else { 0.0 });
    let without = answers(&batch, |_, _| 1.0);
    let judge = |on: f64, off: f64| {
        let (on, off) = (answers(&batch, |_, _| on), answers(&batch, |_, _| off));
        judge_shadows(&batch, &witness, (&right, &without), (&on, &off), &NOTHING).verdict
    };
    assert_eq!(judge(0.0, 0.7), Verdict::Fail);
    assert_eq!(judge(0.71, 0.7), Verdict::Fail);
    for wrong_in_both in [0.7, 0.0, f64::NAN] {
        assert_eq!(judge(wrong_in_both, wrong_in_both), Verdict::Pass, "{wrong_in_both}");
    }
}

#[test]
fn an_inverted_switch_and_a_color_of_shadows_are_slips() {
    let right = |index| if index < 40 { 1.0 } else { 0.0 };
    let inverted = shadows(|_| 1.0, right);
    assert_eq!(inverted.mistake, INVERTED);
    assert_eq!(inverted.error, PriceClass::Slip.price());
    assert!(inverted.hint.contains("inverted"), "{}", inverted.hint);
    let batch = batch();
    let without = answers(&batch, |_, _| 1.0);
    let judge = |dark: &dyn Fn(usize) -> f32| {
        let mut with = answers(&batch, |index, _| right(index));
        (40..60).for_each(|index| with[index] = [dark(index), 0.5 * dark(index), 0.0]);
        let shaded = (without.as_slice(), without.as_slice());
        let mut checks = [judge_shadows(&batch, &witness, (&with, &without), shaded, &NOTHING)];
        leave_unjudged(&mut checks);
        checks[0].error
    };
    for color in [0.01, 0.1, 7.0] {
        assert!((0.02..0.04).contains(&judge(&|_| color)), "{color}: {}", judge(&|_| color));
    }
    // A color for each point is not one.
    assert!(judge(&|index| 0.1 * (index % 7) as f32) > 0.3);
}

#[test]
fn visibility_is_judged_apart_from_radiance() {
    let right = |index| if index < 40 { 1.0 } else { 0.0 };
    assert_eq!(shadows(right, |_| 1.0).verdict, Verdict::Pass);
    // A wrong factor is not paid twice, nor is a switch that is ignored.
    assert_eq!(shadows(|i| 7.0 * right(i), |_| 7.0).verdict, Verdict::Pass);
    assert_eq!(shadows(right, right).verdict, Verdict::Pass);
    for (name, with) in [("all lit", 1.0), ("all dark", 0.0), ("half", 0.5), ("nan", f64::NAN)] {
        let check = shadows(|_| with, |_| 1.0);
        assert!(check.verdict == Verdict::Fail && check.error >= 1.0, "{name}: {}", check.error);
    }
    let black = shadows(|_| 0.0, |_| 0.0);
    assert!(black.verdict == Verdict::Fail && black.error >= 1.0);
    // Rays that are black without shadows too are no matter of shadows, unless all are.
    let faced = |index: usize| if index.is_multiple_of(2) { 1.0 } else { 0.0 };
    assert_eq!(shadows(|i| right(i) * faced(i), faced).verdict, Verdict::Pass);
    assert_eq!(shadows(faced, faced).verdict, Verdict::Fail);
    let acne = shadows(|i| right(i) * faced(i), |i| right(i) * faced(i));
    assert_eq!(acne.verdict, Verdict::Fail);
    let few = |index: usize| if index.is_multiple_of(10) { 1.0 } else { 0.0 };
    assert_eq!(shadows(|i| right(i) * few(i), few).verdict, Verdict::NotJudged);
    assert_eq!(shadows(|_| 0.0, |i| 1.0 - right(i)).verdict, Verdict::Fail);
    let some = shadows(|index| if index < 45 { 1.0 } else { 0.0 }, |_| 1.0);
    assert!((some.error - 0.026_25).abs() < 1e-9 && some.hint.contains("occluders"));
    let hint = |with: &dyn Fn(usize) -> f64| shadows(with, |_| 1.0).hint;
    assert!(hint(&|_| 1.0).contains("visibility tested"));
    assert!(hint(&|_| 0.0).contains("nothing is lit"));
    assert_eq!(hint(&|i| right(i).max(0.1)), "shadows leave 10 % of the light");
    assert_eq!(hint(&|i| 0.8 * right(i)), "with shadows on, lit points keep 80 % of their light");
    assert_eq!(hint(&|i| right(i).max(0.02 * (i % 30) as f64)), "");
}

#[test]
fn shadows_are_judged_where_radiance_is_right() {
    let check = |id: CheckId, scene: &str, verdict| Check::new(id, scene, verdict, "");
    let verdicts = |checks: &[Check]| {
        let mut checks = checks.to_vec();
        leave_unjudged(&mut checks);
        checks.iter().map(|check| check.verdict).collect::<Vec<_>>()
    };
    let (pass, fail) = (Verdict::Pass, Verdict::Fail);
    let wrong = |fraction| {
        let measures = vec![Measure::at_most(
            RuleId::RaysLit,
            "rays wrong (fraction)",
            fraction,
            STRAY_FRACTION,
        )];
        Check { measures, ..check(CheckId::RadianceLit, "emitter", fail) }
    };
    let emitter = [wrong(0.99), check(CheckId::ShadowRays, "emitter", fail)];
    // Wrong everywhere: shadows are judged all the same.
    assert_eq!(verdicts(&emitter), [fail, fail]);
    let right =
        [check(CheckId::RadianceLit, "cbox", pass), check(CheckId::ShadowRays, "cbox", fail)];
    let both = [emitter.as_slice(), right.as_slice()].concat();
    assert_eq!(verdicts(&both), [fail, Verdict::NotJudged, pass, fail]);
    // One mistake explains it to the end, with the light where it belongs; or leaves some.
    let explained = |error| {
        let lit = Check { error, mistake: "red and blue exchanged".into(), ..wrong(0.99) };
        [&[lit], &emitter[1..], right.as_slice()].concat()
    };
    assert_eq!(verdicts(&explained(0.02)), [fail, fail, pass, fail]);
    assert_eq!(verdicts(&explained(0.05)), [fail, Verdict::NotJudged, pass, fail]);
    // Where the switch changes nothing, what is black without shadows too is judged elsewhere; what is lit is not.
    let switched = |changed, dark: f64| {
        let measures = vec![
            Measure::at_most(RuleId::ShadowDark, "shadowed rays that are not dark", dark, 0.1),
            Measure::at_most(None, shadows::SWITCHED, changed, 1.0),
        ];
        Check { measures, ..check(CheckId::ShadowRays, "cbox", fail) }
    };
    assert_eq!(verdicts(&[switched(0.5, 0.5), switched(0.0, 0.0)]), [fail, Verdict::NotJudged]);
    assert_eq!(verdicts(&[switched(0.5, 0.5), switched(0.0, 1.0)]), [fail, fail]);
    // A scene without shadows is no other scene to judge them on.
    let open = [emitter.as_slice(), &[check(CheckId::RadianceLit, "open", pass)]].concat();
    assert_eq!(verdicts(&open), [fail, fail, pass]);
    // Wrong on some surfaces alone: the light stands where it should.
    let some = [&[wrong(0.3)], &emitter[1..], right.as_slice()].concat();
    assert_eq!(verdicts(&some), [fail, fail, pass, fail]);
}

#[test]
fn black_rays_are_no_shadows_when_the_switch_is_obeyed_elsewhere() {
    let right = |index: usize| if index < 40 { 1.0 } else { 0.0 };
    let half_black = |index: usize| if index < 20 { 1.0 } else { 0.0 };
    let here = Check { scene: "here".into(), ..shadows(half_black, half_black) };
    assert_eq!(here.verdict, Verdict::Fail);
    let settle = |other: Check| {
        let mut checks = vec![here.clone(), other];
        leave_unjudged(&mut checks);
        checks[0].verdict
    };
    assert_eq!(settle(shadows(right, |_| 1.0)), Verdict::NotJudged);
    // A renderer that ignores the switch everywhere has only its own shadows to show.
    assert_eq!(settle(shadows(right, right)), Verdict::Fail);
}

#[test]
fn shadows_that_leave_a_tenth_of_the_light_cost_little_and_half_of_it_much() {
    let left = |light: f64| shadows(move |i| if i < 40 { 1.0 } else { light }, |_| 1.0).error;
    assert!((left(0.1) - 0.0203).abs() < 1e-6, "{}", left(0.1));
    assert!(left(0.1) < left(0.5) && left(0.5) < left(0.9) && left(1.0) == 1.0, "{}", left(1.0));
}

#[test]
fn rays_that_no_light_reaches_must_be_black() {
    let mut batch = batch();
    batch.rays.extend([Ray::new(Vec3::ZERO, Vec3::Y); 5]);
    let judge = |background: f32| {
        let mut values = answers(&batch, |_, _| 1.0);
        values.extend([[background; 3]; 5]);
        let of = |index: usize, shading: &Shading| {
            batch.witnessed(index, shading, &|_, _| [1.0, 0.5, 0.25])
        };
        let answer =
            Unshadowed { witness: "constant", of: &of, values: &values, black_below: true };
        judge_unshadowed(&batch, &[answer], &Convention::default(), &[])
    };
    assert_eq!(judge(0.0).verdict, Verdict::Pass);
    let blue = judge(0.3);
    assert_eq!((blue.verdict, blue.error), (Verdict::Fail, 0.02));
    assert!(blue.summary.contains("5 of 5 rays"), "{}", blue.summary);
}

/// Lit points of a hilly floor, seen from above.
fn floor(light: Vec3) -> RayBatch {
    let eye = Vec3::new(0.5, 1.0, 9.0);
    let point = |index: usize| {
        let (x, y) = ((index % 9) as f32 - 4.0, (index / 9) as f32 - 4.0);
        let position = Vec3::new(x, y, 0.4 * (1.3 * x).sin() + 0.3 * (0.9 * y).cos());
        let normal = Vec3::new(0.7 * x.sin(), 0.6 * y.cos(), 1.0).normalize();
        let frame = Frame::from_normal(normal);
        let (to_light, to_eye) = (light - position, (eye - position).normalize());
        SurfacePoint {
            ray: Ray::new(eye, -to_eye),
            shape: 0,
            primitive: 0,
            position,
            normal,
            wo: frame.to_local(to_eye),
            wi: frame.to_local(to_light.normalize()),
            distance: to_light.length(),
            visibility: Visibility::Clear,
        }
    };
    let points: Vec<SurfacePoint> = (0..81).map(point).collect();
    RayBatch {
        rays: points.iter().map(|p| p.ray).collect(),
        pixels: (0..81).collect(),
        lit: points.len(),
        points,
        light,
        ..batch()
    }
}

#[test]
fn a_slip_with_frames_distances_or_the_lights_place_is_one() {
    let batch = floor(Vec3::new(1.0, -1.5, 4.0));
    let witnesses: [&dyn Fn(Vec3, Vec3) -> [f64; 3]; 3] = [
        &|_, _| [1.0, 0.5, 0.25],
        &|wi, wo| {
            [wi.x + 2.0 * wi.y + 4.0 * wi.z, wo.x + 2.0 * wo.y, 1.0].map(|v| f64::from(v) + 3.0)
        },
        &|wi, wo| [f64::from(wi.dot(wo)) + 2.0; 3],
    ];
    let judge = |shading: &Shading| {
        let values = witnesses.map(|witness| -> Vec<[f32; 3]> {
            let value = |ray| batch.witnessed(ray, shading, witness).map(|v| v as f32);
            (0..batch.lit).map(value).collect()
        });
        let of = witnesses
            .map(|witness| move |ray: usize, shading: &Shading| batch_of(ray, shading, witness));
        let answers: Vec<Unshadowed> = (0..witnesses.len())
            .map(|at| Unshadowed {
                witness: "",
                of: &of[at],
                values: &values[at],
                black_below: true,
            })
            .collect();
        judge_unshadowed(&batch, &answers, &Convention::default(), &changes::integrator_changes())
    };
    fn batch_of(
        ray: usize,
        shading: &Shading,
        witness: &dyn Fn(Vec3, Vec3) -> [f64; 3],
    ) -> [f64; 3] {
        floor(Vec3::new(1.0, -1.5, 4.0)).witnessed(ray, shading, witness)
    }
    let right = Shading::default();
    assert_eq!(judge(&right).verdict, Verdict::Pass);
    let directions = |directions| Shading { directions, ..right };
    for (slip, name) in [
        (Shading { light_offset: [0.0, 0.8, 0.0], ..right }, "the light stands elsewhere"),
        (Shading { without_axis: Some(2), ..right }, "z is left out of r^2"),
        (directions(Directions::WiToWorld), "wi is brought to world space"),
        (directions(Directions::WoLocalTwice), "wo is brought to the local frame twice"),
        (directions(Directions::WiTurned([1, 0, 2])), "x and y of wi are exchanged"),
    ] {
        let check = judge(&slip);
        assert_eq!(check.mistake, name);
        assert!((check.error - PriceClass::Slip.price()).abs() < 2e-3, "{name}: {}", check.error);
    }
}

#[test]
fn shadows_are_those_of_the_light_where_the_integrator_has_it() {
    // A wall whose edge is at x = 0, half way up.
    let blocker = |ray: &Ray| {
        let t = (2.0 - ray.origin.z) / ray.direction.z;
        (t < ray.max_t && ray.at(t).x < 0.0).then_some(1)
    };
    let occluders = Occluders { blocker: &blocker, is_phong: &|_| false };
    let light = Vec3::new(1.0, -1.5, 4.0);
    let batch = |light: Vec3| {
        let mut batch = floor(light);
        let blocked = |p: &SurfacePoint| {
            let toward = (light - p.position) / p.distance;
            blocker(&Ray::segment(p.position, toward, 1e-4, p.distance)).is_some()
        };
        let (dark, lit): (Vec<_>, Vec<_>) = batch.points.iter().copied().partition(blocked);
        batch.lit = lit.len();
        batch.points = lit.into_iter().chain(dark).collect();
        batch
    };
    let right = batch(light);
    // What is seen of a light in another place, along the rays of the right one.
    let seen = |light: Vec3, shadows_of: Vec3| {
        let radiance = |p: &SurfacePoint| {
            let squared = f64::from((light - p.position).length_squared());
            witness(p).map(|v| v / squared)
        };
        let without: Vec<[f32; 3]> = right
            .points
            .iter()
            .map(|p| std::array::from_fn(|c| (radiance(p)[c] * [1.0, 2.0, 3.0][c]) as f32))
            .collect();
        let with: Vec<[f32; 3]> = right
            .points
            .iter()
            .zip(&without)
            .map(|(p, lit)| {
                let way = shadows_of - p.position;
                let ray = Ray::segment(p.position, way.normalize(), 1e-4, way.length());
                if blocker(&ray).is_some() { [0.0; 3] } else { *lit }
            })
            .collect();
        judge_shadows(&right, &witness, (&with, &without), (&without, &without), &occluders)
    };
    let elsewhere = light + Vec3::X;
    assert_eq!(seen(light, light).verdict, Verdict::Pass);
    assert_eq!(seen(elsewhere, elsewhere).verdict, Verdict::Pass);
    // Of a light that is where it belongs, shadows are too.
    assert_eq!(seen(light, elsewhere).verdict, Verdict::Fail);
    assert_eq!(seen(elsewhere, light).verdict, Verdict::Pass);
}
