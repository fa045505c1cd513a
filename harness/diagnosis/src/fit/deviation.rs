//! The result of a fit: which quantity of which term has which value.

use std::f64::consts::PI;

use super::formula::{After, ExponentForm, Formula, Gate, Incident, Lobe, Power, ScaleForm, Term};
use imaging::ratio::ratio_name;

/// Which part of an answer differs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Of {
    /// The whole value.
    All,
    /// The diffuse term.
    Diffuse,
    /// The specular term.
    Specular,
    /// Visibility.
    Shadow,
    /// A uniform, by its name in the contract.
    Uniform(&'static str),
    /// The position that a vertex stage forwards.
    Position,
    /// The normal that a vertex stage forwards.
    Normal,
    /// The position in clip space.
    Clip,
}

impl Of {
    /// Its name in data.
    pub fn name(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Diffuse => "diffuse",
            Self::Specular => "specular",
            Self::Shadow => "shadow",
            Self::Uniform(name) => name,
            Self::Position => "position",
            Self::Normal => "normal",
            Self::Clip => "clip",
        }
    }
}

/// The value of a quantity.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A power, a factor, a length.
    Number(f64),
    /// One for each channel or axis.
    Three([f64; 3]),
    /// One of several forms.
    Form(&'static str),
}

/// One thing that is not as it should be. Powers are those of the whole formula: 1 is right for
/// `cos_i` of a BSDF, -2 for `r`.
#[derive(Clone, Debug, PartialEq)]
pub struct Deviation {
    /// Of what.
    pub of: Of,
    /// Which quantity.
    pub quantity: &'static str,
    /// Its value.
    pub value: Value,
    /// For the student, after the words "looks like:".
    pub words: String,
}

/// What the formula is of: it names the subject, and which powers are right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// A BSDF, its cosine included.
    Bsdf,
    /// Radiance under a witness.
    Radiance,
    /// The color that a fragment stage writes.
    Color,
}

impl Subject {
    fn words(self, of: Of) -> &'static str {
        match (self, of) {
            (_, Of::Diffuse) => "the diffuse term",
            (_, Of::Specular) => "the specular term",
            (Self::Bsdf, _) => "the value of eval()",
            (Self::Radiance, _) => "radiance",
            (Self::Color, _) => "the color",
        }
    }

    /// The right powers of cos theta_i and pi.
    fn right(self) -> (f64, f64) {
        if self == Self::Radiance { (0.0, 0.0) } else { (1.0, -1.0) }
    }
}

/// How a formula differs from the right one.
pub fn deviations(formula: &Formula, subject: Subject, phong: bool) -> Vec<Deviation> {
    let mut found = Vec::new();
    let mut say = |of, quantity, value, words: String| {
        found.push(Deviation { of, quantity, value, words });
    };
    if !phong || formula.diffuse == formula.specular {
        of_term(&formula.diffuse, Of::All, subject, &mut say);
    } else {
        of_term(&formula.diffuse, Of::Diffuse, subject, &mut say);
        of_term(&formula.specular, Of::Specular, subject, &mut say);
    }
    of_lobe(formula, &mut say);
    of_light(formula, &mut say);
    found
}

type Say<'a> = &'a mut dyn FnMut(Of, &'static str, Value, String);

fn of_term(term: &Term, of: Of, subject: Subject, say: Say) {
    let who = subject.words(of);
    let (cosine, pi) = subject.right();
    let extra = |power: Power| term.powers[power as usize];
    let number = Value::Number;
    if extra(Power::CosI) != 0.0 {
        let total = cosine + extra(Power::CosI);
        let words = match (subject, total) {
            (Subject::Radiance, 1.0) => {
                format!("{who} is multiplied by cos theta_i: eval() holds it already")
            }
            (Subject::Radiance, _) => format!("{who} is {}", times("cos theta_i", total)),
            (_, 0.0) => format!("{who} lacks the cosine of wi"),
            (_, 2.0) => format!("{who} carries cos theta_i twice"),
            (_, 3.0) => format!("{who} carries cos theta_i three times"),
            _ => format!("{who} carries cos theta_i to the power {total} where 1 belongs"),
        };
        say(of, "cos_i", number(total), words);
    }
    if extra(Power::CosO) != 0.0 {
        let power = extra(Power::CosO);
        say(of, "cos_o", number(power), format!("{who} is {}", times("cos theta_o", power)));
    }
    if extra(Power::R) != 0.0 {
        let total = extra(Power::R) - 2.0;
        let words = match total {
            0.0 => format!("{who} is not divided by r^2"),
            _ => format!("{who} is {} where it is to be divided by r^2", times("r", total)),
        };
        say(of, "r", number(total), words);
    }
    if extra(Power::Reflectance) != 0.0 {
        let total = 1.0 + extra(Power::Reflectance);
        let words = match total {
            0.0 => format!("{who} ignores the reflectance"),
            2.0 => format!("{who} carries the reflectance twice"),
            _ => format!("{who} raises the reflectance to the power {total}"),
        };
        say(of, "reflectance", number(total), words);
    }
    if extra(Power::Scale) != 0.0 {
        let total = 1.0 + extra(Power::Scale);
        let words = match total {
            0.0 => format!("{who} is not multiplied by scale"),
            2.0 => format!("{who} is multiplied by scale twice"),
            _ => format!("{who} carries scale to the power {total} where 1 belongs"),
        };
        say(of, "scale", number(total), words);
    }
    let factor = term.factor;
    if factor == [1.0; 3] {
    } else if factor[0] != factor[1] || factor[1] != factor[2] {
        let [r, g, b] = factor;
        let words = format!("{who} has a factor by channel: {r:.3} red, {g:.3} green, {b:.3} blue");
        say(of, "channels", Value::Three(factor), words);
    } else if let Some(power) = pi_power(factor[0]) {
        let total = pi + power;
        let words = match (subject, total) {
            (Subject::Radiance, _) => format!("{who} is {}", times("pi", total)),
            (_, 0.0) => format!("{who} is not divided by pi"),
            (_, -2.0) => format!("{who} is divided by pi twice"),
            _ => format!("{who} is {} where it is to be divided by pi", times("pi", total)),
        };
        say(of, "pi", number(total), words);
    } else {
        say(of, "factor", number(factor[0]), format!("{who} is {}", off_by(factor[0])));
    }
}

/// "off by a constant factor of 6.2832 (2 pi)".
pub fn off_by(factor: f64) -> String {
    let name = ratio_name(factor).map(|name| format!(" ({name})")).unwrap_or_default();
    format!("off by a constant factor of {factor:.4}{name}")
}

/// The power of pi that a factor is, if it is one.
pub fn pi_power(factor: f64) -> Option<f64> {
    let powers = [-2.0, -1.0, 1.0, 2.0];
    powers.into_iter().find(|&power| (factor / PI.powf(power) - 1.0).abs() < 1e-3)
}

/// "multiplied by x^2", "divided by x".
fn times(what: &str, power: f64) -> String {
    let verb = if power < 0.0 { "divided" } else { "multiplied" };
    match power.abs() {
        1.0 => format!("{verb} by {what}"),
        power => format!("{verb} by {what}^{power}"),
    }
}

fn of_lobe(formula: &Formula, say: Say) {
    let of = Of::Specular;
    let number = Value::Number;
    let lobe = match formula.lobe {
        Lobe::Mirror => None,
        Lobe::AbsoluteMirror => {
            Some(("absolute", "cos alpha is made positive by abs(), not clamped"))
        }
        Lobe::Half => {
            Some(("half", "alpha is the angle between the half vector and the normal (Blinn)"))
        }
        Lobe::Unmirrored => {
            Some(("unmirrored", "alpha is the angle between wi and wo: wo is not mirrored"))
        }
        Lobe::Light => Some(("light", "alpha is the angle between wi and the normal")),
        Lobe::Viewer => Some(("viewer", "alpha is the angle between wo and the normal")),
    };
    if let Some((form, words)) = lobe {
        say(of, "lobe", Value::Form(form), words.to_owned());
    }
    let form = match formula.exponent {
        ExponentForm::Whole => None,
        ExponentForm::Truncated => Some(("truncated", "the exponent is truncated to an integer")),
        ExponentForm::Rounded => Some(("rounded", "the exponent is rounded to an integer")),
        ExponentForm::Ceiled => Some(("ceiled", "the exponent is rounded up to an integer")),
    };
    if let Some((form, words)) = form {
        say(of, "exponent_form", Value::Form(form), words.to_owned());
    }
    let also = if formula.follows { ", in the normalization too" } else { "" };
    let (a, b) = (formula.times, formula.plus);
    if a != 1.0 {
        let words = format!("the exponent of the specular lobe is {a} n where n belongs{also}");
        say(of, "exponent_times", number(a), words);
    }
    if b != 0.0 {
        let sign = if b < 0.0 { "-" } else { "+" };
        let words = format!(
            "the exponent of the specular lobe is n {sign} {} where n belongs{also}",
            b.abs()
        );
        say(of, "exponent_plus", number(b), words);
    }
    let k = formula.normalization_plus;
    if k != 2.0 {
        let sum = match k {
            0.0 => "n".to_owned(),
            k if k < 0.0 => format!("n - {}", -k),
            k => format!("n + {k}"),
        };
        let words = format!("the specular term has {sum} where n + 2 belongs");
        say(of, "normalisation_plus", number(k), words);
    }
    let scale = match formula.scale {
        ScaleForm::Largest => None,
        ScaleForm::Mean => {
            Some(("mean", "scale is made from the mean of Kd + Ks, not its largest component"))
        }
        ScaleForm::Channel => Some((
            "channel",
            "every channel has a scale of its own: one is made from the largest component of Kd + Ks",
        )),
        ScaleForm::One => {
            Some(("one", "scale is 1 over the largest component of Kd + Ks: 0.99 belongs"))
        }
        ScaleForm::Always => {
            Some(("always", "scale is applied where Kd + Ks does not exceed 1 too"))
        }
        ScaleForm::Sum => {
            Some(("sum", "scale is made from the sum of the channels of Kd + Ks, not the largest"))
        }
        ScaleForm::Smallest => {
            Some(("smallest", "scale is made from the smallest component of Kd + Ks"))
        }
    };
    if let Some((form, words)) = scale {
        say(Of::All, "scale_form", Value::Form(form), words.to_owned());
    }
}

fn of_light(formula: &Formula, say: Say) {
    let number = Value::Number;
    if formula.order != [0, 1, 2] {
        let name: &'static str =
            ORDERS.iter().find(|(order, _)| *order == formula.order).map_or("", |o| o.1);
        let words = format!("red, green and blue come in the order {name}");
        say(Of::All, "channel_order", Value::Form(name), words);
    }
    match formula.incident {
        Incident::Right => {}
        Incident::Unit => {
            let words = "the light's intensity is missing".to_owned();
            say(Of::All, "intensity", number(0.0), words);
        }
        Incident::Softened(k) => {
            let words = format!("the light falls off with 1 / (r^2 + {k:.3}), not 1 / r^2");
            say(Of::All, "r2_plus", number(k), words);
        }
        Incident::Clamp(most) => {
            let words = format!("I / r^2 is clamped to {most:.3}");
            say(Of::All, "clamp", number(most), words);
        }
    }
    if formula.wi_length != 0.0 {
        let words = match formula.wi_length {
            1.0 => {
                "wi is not a unit vector when it reaches the BSDF: it is as long as r".to_owned()
            }
            power => format!(
                "wi is not a unit vector when it reaches the BSDF: it is {} long",
                times_r(power)
            ),
        };
        say(Of::All, "wi_length", number(formula.wi_length), words);
    }
    match formula.after {
        After::Nothing => {}
        After::Offset([r, g, b]) if r == g && g == b => {
            say(Of::All, "offset", number(r), format!("{r:.4} is added to every value"));
        }
        After::Offset([r, g, b]) => {
            let words = format!("({r:.4}, {g:.4}, {b:.4}) is added to every value");
            say(Of::All, "offset", Value::Three([r, g, b]), words);
        }
        After::Clamp(most) => {
            say(Of::All, "clamp", number(most), format!("values are clamped to {most:.3}"));
        }
        After::Power(power) => {
            say(
                Of::All,
                "power",
                number(power),
                format!("values are raised to the power {power:.4}"),
            );
        }
    }
    let gate = match formula.gate {
        Gate::Both => None,
        Gate::NoWi => Some(("no wi", "wi is not tested: light from below the surface counts")),
        Gate::AbsoluteWi => Some((
            "absolute wi",
            "abs() around the cosine of wi: light from below the surface shines through it",
        )),
        Gate::NoWo => Some(("no wo", "wo is not tested: a surface seen from behind is lit")),
        Gate::Neither => Some(("neither", "neither wi nor wo is tested")),
    };
    if let Some((form, words)) = gate {
        say(Of::All, "gate", Value::Form(form), words.to_owned());
    }
}

fn times_r(power: f64) -> String {
    if power < 0.0 { format!("1 / r^{}", -power) } else { format!("r^{power}") }
}

/// The orders that channels may be in, but for the right one.
pub const ORDERS: [([usize; 3], &str); 5] = [
    ([2, 1, 0], "bgr"),
    ([1, 2, 0], "gbr"),
    ([2, 0, 1], "brg"),
    ([1, 0, 2], "grb"),
    ([0, 2, 1], "rbg"),
];
