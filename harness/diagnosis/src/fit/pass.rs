//! Wrong values that a render pass binds.

use basecode::Vec3;

use super::deviation::{Deviation, ORDERS, Of, Value, off_by};
use super::search::Fitted;

/// What a pass bound for one object.
#[derive(Clone, Debug)]
pub struct Bound {
    /// Name of the uniform.
    pub uniform: &'static str,
    /// Name of the scene.
    pub scene: String,
    /// The object's place in the scene.
    pub object: usize,
    /// What belongs there.
    pub expected: Vec3,
    /// What is there.
    pub found: Vec3,
    /// The energy scale of the object's material: rho_d and rho_s are multiplied by it.
    pub scale: f64,
}

/// Values that differ by less, relatively, are the same.
const SAME: f32 = 1e-3;
/// The uniforms whose values are multiplied by the energy scale.
const SCALED: [&str; 2] = ["material.rho_d", "material.rho_s"];

fn same(a: Vec3, b: Vec3) -> bool {
    // NaN equals nothing.
    (a - b).abs().max_element() <= SAME * a.abs().max_element().max(b.abs().max_element()).max(1e-4)
}

/// What is wrong with the bound values, if every wrong one is explained.
pub fn explain_pass(bound: &[Bound]) -> Option<Fitted> {
    // Where nothing is drawn, nothing is told of what was bound.
    if bound.iter().all(|bound| bound.found == Vec3::ZERO) {
        return None;
    }
    let mut names: Vec<&'static str> = Vec::new();
    for wrong in bound.iter().filter(|bound| !same(bound.found, bound.expected)) {
        if !names.contains(&wrong.uniform) {
            names.push(wrong.uniform);
        }
    }
    // One object's values in place of all others' are one mistake.
    if let Some(deviation) = of_another_object(bound, &names) {
        return Some(Fitted { deviations: vec![deviation], unexplained: 0.0 });
    }
    if names.is_empty() || names.len() > 2 {
        return None;
    }
    let explained: Option<Vec<Deviation>> =
        names.into_iter().map(|name| of_uniform(bound, name)).collect();
    explained.map(|deviations| Fitted { deviations, unexplained: 0.0 })
}

/// Materials that are all one object's.
fn of_another_object(bound: &[Bound], wrong: &[&'static str]) -> Option<Deviation> {
    if wrong.len() < 2 || wrong.iter().any(|name| !name.starts_with("material.")) {
        return None;
    }
    let all: Vec<Deviation> =
        wrong.iter().map(|name| by_object(bound, name)).collect::<Option<_>>()?;
    let first = all.first()?.clone();
    let alike = all.iter().all(|other| other.value == first.value);
    let Value::Form(form) = first.value else { return None };
    alike.then(|| Deviation {
        of: Of::All,
        words: format!("the material of the {form} object is bound for others too"),
        ..first
    })
}

/// What one uniform has in common with what belongs elsewhere.
fn of_uniform(bound: &[Bound], name: &'static str) -> Option<Deviation> {
    let own: Vec<&Bound> = bound.iter().filter(|bound| bound.uniform == name).collect();
    let say = |quantity, value, words: String| Deviation {
        of: Of::Uniform(name),
        quantity,
        value,
        words,
    };
    // The exponent's other channels are ours.
    let is_zero = |bound: &&Bound| match name {
        "material.exponent" => bound.found.x == 0.0,
        _ => bound.found == Vec3::ZERO,
    };
    if own.iter().all(is_zero) {
        return Some(say(
            "factor",
            Value::Number(0.0),
            format!("{name} never reaches the shaders"),
        ));
    }
    let holds =
        |make: &dyn Fn(&Bound) -> Vec3| own.iter().all(|bound| same(bound.found, make(bound)));
    let mut all = Vec::new();
    for (power, words) in [
        (0.0, "is not multiplied by the energy scale"),
        (2.0, "is multiplied by the energy scale twice"),
    ] {
        if SCALED.contains(&name) && holds(&|b| b.expected * b.scale.powf(power - 1.0) as f32) {
            all.push(say("scale", Value::Number(power), format!("{name} {words}")));
        }
    }
    let brightest =
        own.iter().max_by(|a, b| a.expected.length().total_cmp(&b.expected.length()))?;
    let factor = brightest.found.length() / brightest.expected.length();
    let times = |b: &Bound, factor: f32| match name {
        "material.exponent" => Vec3::new(b.expected.x * factor, b.expected.y, b.expected.z),
        _ => b.expected * factor,
    };
    let factor =
        if name == "material.exponent" { brightest.found.x / brightest.expected.x } else { factor };
    if holds(&|b| times(b, factor)) {
        all.push(say(
            "factor",
            Value::Number(f64::from(factor)),
            format!("{name} is {}", off_by(f64::from(factor))),
        ));
    } else if holds(&|b| times(b, -factor)) {
        all.push(say("factor", Value::Number(-f64::from(factor)), format!("{name} is negated")));
    }
    for (order, form) in ORDERS {
        if name != "material.exponent" && holds(&|b| Vec3::from(order.map(|c| b.expected[c]))) {
            all.push(say(
                "channel_order",
                Value::Form(form),
                format!("the channels of {name} come in the order {form}"),
            ));
        }
    }
    for power in [0.5, 2.0, 2.2, 1.0 / 2.2] {
        let raise = |b: &Bound| match name {
            "material.exponent" => Vec3::new(b.expected.x.powf(power), b.expected.y, b.expected.z),
            _ => b.expected.powf(power),
        };
        if holds(&raise) {
            let words = format!("{name} is raised to the power {power:.3}");
            all.push(say("power", Value::Number(f64::from(power)), words));
        }
    }
    type Form = (&'static str, &'static str, fn(f32) -> f32);
    let forms: [Form; 3] = [
        ("truncated", "is truncated to an integer", f32::trunc),
        ("rounded", "is rounded to an integer", f32::round),
        ("ceiled", "is rounded up to an integer", f32::ceil),
    ];
    for (form, words, make) in forms {
        if name == "material.exponent"
            && holds(&|b| Vec3::new(make(b.expected.x), b.expected.y, b.expected.z))
        {
            all.push(say("exponent_form", Value::Form(form), format!("{name} {words}")));
        }
    }
    for other in [
        "frame.camera_position",
        "frame.light_position",
        "frame.light_intensity",
        "material.rho_d",
        "material.rho_s",
    ] {
        let of = |b: &Bound| {
            let there =
                |o: &&Bound| o.uniform == other && o.scene == b.scene && o.object == b.object;
            bound.iter().find(there).map_or(Vec3::NAN, |o| o.expected)
        };
        if other != name && holds(&of) {
            all.push(say("is", Value::Form(other), format!("{name} holds the value of {other}")));
        }
    }
    all.extend(by_object(bound, name));
    // Which of several it is cannot be told.
    if all.len() == 1 { all.pop() } else { None }
}

/// A uniform that holds another object's value.
fn by_object(bound: &[Bound], name: &'static str) -> Option<Deviation> {
    let own: Vec<&Bound> = bound.iter().filter(|bound| bound.uniform == name).collect();
    let in_scene = |b: &Bound| {
        let mut all: Vec<&Bound> = own.iter().copied().filter(|o| o.scene == b.scene).collect();
        all.sort_by_key(|o| o.object);
        all
    };
    type Which = fn(&[&Bound], &Bound) -> Option<Vec3>;
    let which: [(&'static str, Which); 3] = [
        ("first", |all, _| all.first().map(|o| o.expected)),
        ("last", |all, _| all.last().map(|o| o.expected)),
        ("previous", |all, b| {
            let at = all.iter().position(|o| o.object == b.object)?;
            all.get(at.checked_sub(1).unwrap_or(all.len() - 1)).map(|o| o.expected)
        }),
    ];
    let mut fits = which.into_iter().filter(|(_, make)| {
        own.iter().all(|b| make(&in_scene(b), b).is_some_and(|value| same(b.found, value)))
    });
    let (form, _) = fits.next()?;
    if fits.next().is_some() {
        return None;
    }
    Some(Deviation {
        of: Of::Uniform(name),
        quantity: "of_object",
        value: Value::Form(form),
        words: format!("{name} is that of the {form} object"),
    })
}
