//! The known single mistakes that answers are compared with, each with what a teacher takes it for.

use super::answers::{Change, Fitted};
use super::price::PriceClass;
use super::shading::{Angle, Clamp, Directions, Shading, Terms, Tests};
use imaging::srgb;

/// What can be wrong in a diffuse BSDF.
pub fn diffuse_changes() -> Vec<Change> {
    let right = Shading::default();
    let mut changes = vec![
        fit("a constant factor", Fitted::All),
        fit("a factor by channel", Fitted::Channels),
        fit("a factor by material", Fitted::Groups),
        fit("another colour", Fitted::Colors),
    ];
    let of =
        |class| move |name, shading| Change { name, class, shading: Some(shading), fitted: None };
    let (slip, concept) = (of(PriceClass::Slip), of(PriceClass::Concept));
    changes.extend([
        concept("cos theta_i is missing", Shading { cos_i: [0.0; 2], ..right }),
        concept("the diffuse reflectance is missing", Shading { albedo: |_| 1.0, ..right }),
        slip("the diffuse reflectance is squared", Shading { albedo: |a| a * a, ..right }),
        slip("the diffuse reflectance is its square root", Shading { albedo: f64::sqrt, ..right }),
        slip(
            "the diffuse reflectance is raised to 2.2",
            Shading { albedo: |a| a.max(0.0).powf(2.2), ..right },
        ),
        slip(
            "the diffuse reflectance is raised to 1 / 2.2",
            Shading { albedo: |a| a.max(0.0).powf(1.0 / 2.2), ..right },
        ),
        slip("cos theta_i is there twice", Shading { cos_i: [2.0; 2], ..right }),
        slip("cos theta_i is there three times", Shading { cos_i: [3.0; 2], ..right }),
        slip(
            "cos theta_o in place of cos theta_i",
            Shading { cos_i: [0.0; 2], cos_o: [1.0; 2], ..right },
        ),
        slip("cos theta_o beside cos theta_i", Shading { cos_o: [1.0; 2], ..right }),
        slip("divided by cos theta_o", Shading { cos_o: [-1.0; 2], ..right }),
        slip("wo is not tested", Shading { tests: Tests::Wi, ..right }),
        slip("wi is not tested", Shading { tests: Tests::Wo, ..right }),
        slip("neither wo nor wi is tested", Shading { tests: Tests::Neither, ..right }),
        slip("abs() around cos theta_i", Shading { absolute: true, ..right }),
        slip("abs() around both cosines", Shading { absolute: true, tests: Tests::Wi, ..right }),
        slip(
            "black only where both wo and wi lie below",
            Shading { tests: Tests::AtOnce, ..right },
        ),
        slip(
            "not black where both wo and wi lie below",
            Shading { tests: Tests::SameSide, ..right },
        ),
        slip("sin theta_i in place of cos theta_i", Shading { sine: true, ..right }),
        slip("cos theta_i is wrapped", Shading { wrapped: true, ..right }),
        slip(
            "cos theta_i is wrapped, wi is not tested",
            Shading { wrapped: true, tests: Tests::Wo, ..right },
        ),
        slip(
            "cos theta_i is wrapped, nothing is tested",
            Shading { wrapped: true, tests: Tests::Neither, ..right },
        ),
        slip(
            "cos theta_i is wrapped and squared",
            Shading { wrapped: true, cos_i: [2.0; 2], tests: Tests::Wo, ..right },
        ),
        slip("x of wi in place of its cosine", Shading { axis: 0, ..right }),
        slip("y of wi in place of its cosine", Shading { axis: 1, ..right }),
        slip("red and blue exchanged", Shading { channels: [2, 1, 0], ..right }),
        slip("channels turned", Shading { channels: [1, 2, 0], ..right }),
        slip("channels turned the other way", Shading { channels: [2, 0, 1], ..right }),
        slip("the first channel stands for all", Shading { channels: [0; 3], ..right }),
    ]);
    changes
}

/// What can be wrong in a Phong BSDF: all that can in a diffuse one, the lobe and the energy scale.
pub fn phong_changes() -> Vec<Change> {
    let right = Shading::default();
    let of =
        |class| move |name, shading| Change { name, class, shading: Some(shading), fitted: None };
    let (slip, concept) = (of(PriceClass::Slip), of(PriceClass::Concept));
    let lobe = |normalization| Shading { normalization, ..right };
    let exponent = |a, b| Shading { exponent: [a, b], ..right };
    let mut changes = diffuse_changes();
    changes.extend([
        fit("a factor of the diffuse term", Fitted::Diffuse),
        fit("a factor of the specular term", Fitted::Specular),
        slip("the energy scale is missing", Shading { scaled: [false; 2], ..right }),
        slip(
            "the energy scale is missing from the specular term",
            Shading { scaled: [true, false], ..right },
        ),
        slip(
            "the energy scale is missing from the diffuse term",
            Shading { scaled: [false, true], ..right },
        ),
        slip("each channel has an energy scale", Shading { scale_by_channel: true, ..right }),
        slip("the magnitude of cos alpha", Shading { clamp: Clamp::Magnitude, ..right }),
        slip("n + 1 for n + 2", lobe(|n| (n + 1.0) / std::f64::consts::TAU)),
        slip("n for n + 2", lobe(|n| n / std::f64::consts::TAU)),
        slip("n + 3 for n + 2", lobe(|n| (n + 3.0) / std::f64::consts::TAU)),
        slip("n + 8 over 8 pi", lobe(|n| (n + 8.0) / (8.0 * std::f64::consts::PI))),
        slip("n + 2 without 2 pi", lobe(|n| n + 2.0)),
        slip("n + 2 / (2 pi): parentheses are missing", lobe(|n| n + 2.0 / std::f64::consts::TAU)),
        slip("n / (2 pi) + 2: parentheses are missing", lobe(|n| n / std::f64::consts::TAU + 2.0)),
        slip(
            "(n + 2) / 2 pi: parentheses are missing",
            lobe(|n| (n + 2.0) / 2.0 * std::f64::consts::PI),
        ),
        slip("2 pi over n + 2", lobe(|n| std::f64::consts::TAU / (n + 2.0))),
        slip(
            "the diffuse term is normalized as the lobe is",
            Shading { diffuse_normalized: true, ..right },
        ),
        slip(
            "the diffuse term is multiplied by 1 - Ks",
            Shading { diffuse_less_specular: Some(0), ..right },
        ),
        slip(
            "the diffuse term is multiplied by 1 - Ks, scaled",
            Shading { diffuse_less_specular: Some(1), ..right },
        ),
        slip("Ks is raised to n, too", Shading { raised_ks: true, ..right }),
        slip("n is raised to cos alpha", Shading { swapped_power: true, ..right }),
        slip(
            "the specular term is multiplied by Kd",
            Shading { specular_times_diffuse: Some(0), ..right },
        ),
        slip(
            "the specular term is multiplied by Kd, scaled once more",
            Shading { specular_times_diffuse: Some(1), ..right },
        ),
        slip("no power of a negative cos alpha", Shading { clamp: Clamp::NotANumber, ..right }),
        slip(
            "the mirror direction lacks its factor 2",
            Shading { angle: Angle::Sum(1.0, -1.0), ..right },
        ),
        slip(
            "the mirror direction is the negated wo",
            Shading { angle: Angle::Sum(0.0, -1.0), ..right },
        ),
        concept("the lobe is not normalized", lobe(|_| 1.0)),
        concept("the lobe is divided by pi alone", lobe(|_| std::f64::consts::FRAC_1_PI)),
        concept("the lobe is divided by 2 pi alone", lobe(|_| 1.0 / std::f64::consts::TAU)),
        slip("exponent 0 in place of n", exponent(0.0, 0.0)),
        // As where 0 to the power of 0 is 0.
        slip("exponent 0 in place of n", exponent(0.0, 1e-9)),
        slip("cos alpha is not raised to n", exponent(0.0, 1.0)),
        slip("exponent n + 1", exponent(1.0, 1.0)),
        slip("exponent n - 1", exponent(1.0, -1.0)),
        slip("exponent n + 2", exponent(1.0, 2.0)),
        slip("exponent 2 n", exponent(2.0, 0.0)),
        slip("exponent n / 2", exponent(0.5, 0.0)),
        slip("exponent 4 n", exponent(4.0, 0.0)),
        slip("exponent truncated", Shading { round: f64::trunc, ..right }),
        slip("exponent rounded", Shading { round: f64::round, ..right }),
        slip("exponent rounded up", Shading { round: f64::ceil, ..right }),
        slip("cos alpha is not clamped", Shading { clamp: Clamp::Nothing, ..right }),
        slip("cos alpha is raised before it is clamped", Shading { clamp: Clamp::Power, ..right }),
        slip("the mirror direction is negated", Shading { angle: Angle::Sum(-2.0, 1.0), ..right }),
        slip("the mirror direction adds wo", Shading { angle: Angle::Sum(2.0, 1.0), ..right }),
        slip(
            "wo is mirrored with the cosine of wi",
            Shading { angle: Angle::Cosines(2, 0), ..right },
        ),
        slip(
            "wi is mirrored with the cosine of wo",
            Shading { angle: Angle::Cosines(0, 2), ..right },
        ),
        slip("wo is mirrored without its cosine", Shading { angle: Angle::Cosines(1, 0), ..right }),
        slip("wi is mirrored without its cosine", Shading { angle: Angle::Cosines(0, 1), ..right }),
        slip("wo is mirrored on x alone", Shading { angle: Angle::OneAxis(0), ..right }),
        slip("wo is mirrored on y alone", Shading { angle: Angle::OneAxis(1), ..right }),
        concept("wo is not mirrored", Shading { angle: Angle::Sum(0.0, 1.0), ..right }),
        concept("alpha is taken from the normal", Shading { angle: Angle::Normal, ..right }),
        slip("Ks is grey", Shading { specular_channels: [0; 3], ..right }),
        slip("red and blue of Ks exchanged", Shading { specular_channels: [2, 1, 0], ..right }),
        concept(
            "the half vector in place of the mirror direction",
            Shading { angle: Angle::Half, ..right },
        ),
        slip("the specular term lacks cos theta_i", Shading { cos_i: [1.0, 0.0], ..right }),
        slip("the specular term has cos theta_i twice", Shading { cos_i: [1.0, 2.0], ..right }),
        slip("the diffuse term lacks cos theta_i", Shading { cos_i: [0.0, 1.0], ..right }),
        slip("the diffuse term has cos theta_i twice", Shading { cos_i: [2.0, 1.0], ..right }),
        slip("Kd and Ks are exchanged", Shading { colors: [1, 0], ..right }),
        slip("Kd stands for Ks", Shading { colors: [0, 0], ..right }),
        slip("Ks stands for Kd", Shading { colors: [1, 1], ..right }),
        slip("the terms are multiplied", Shading { terms: Terms::Product, ..right }),
        slip("the larger term stands for the sum", Shading { terms: Terms::Larger, ..right }),
    ]);
    changes
}

/// Attenuation by 1 + a r + b r^2, as tables of game engines have it for lights that reach so far.
const GAME_7: fn(f64) -> f64 = |squared| 1.0 + 0.7 * squared.sqrt() + 1.8 * squared;
const GAME_13: fn(f64) -> f64 = |squared| 1.0 + 0.35 * squared.sqrt() + 0.44 * squared;
const GAME_20: fn(f64) -> f64 = |squared| 1.0 + 0.22 * squared.sqrt() + 0.2 * squared;
const GAME_32: fn(f64) -> f64 = |squared| 1.0 + 0.14 * squared.sqrt() + 0.07 * squared;
const GAME_50: fn(f64) -> f64 = |squared| 1.0 + 0.09 * squared.sqrt() + 0.032 * squared;
const GAME_100: fn(f64) -> f64 = |squared| 1.0 + 0.045 * squared.sqrt() + 0.0075 * squared;

/// What can be wrong in the light that reaches a surface.
pub fn light_changes() -> Vec<Change> {
    let right = Shading::default();
    let of =
        |class| move |name, shading| Change { name, class, shading: Some(shading), fitted: None };
    let (slip, concept) = (of(PriceClass::Slip), of(PriceClass::Concept));
    vec![
        fit("a constant factor", Fitted::All),
        fit("a factor by channel", Fitted::Channels),
        concept("the light does not fall off with the distance", Shading { falloff: 0.0, ..right }),
        slip("r in place of r^2", Shading { falloff: 1.0, ..right }),
        slip("the root of r in place of r^2", Shading { falloff: 0.5, ..right }),
        slip("multiplied by r^2 in place of divided", Shading { falloff: -2.0, ..right }),
        slip("multiplied by r in place of divided by r^2", Shading { falloff: -1.0, ..right }),
        slip("r^3 in place of r^2", Shading { falloff: 3.0, ..right }),
        slip("r^4 in place of r^2", Shading { falloff: 4.0, ..right }),
        slip("1 + r^2 in place of r^2", Shading { divisor: |squared| 1.0 + squared, ..right }),
        concept("the light fades as in a game", Shading { divisor: GAME_7, ..right }),
        concept("the light fades as in a game", Shading { divisor: GAME_13, ..right }),
        concept("the light fades as in a game", Shading { divisor: GAME_20, ..right }),
        concept("the light fades as in a game", Shading { divisor: GAME_32, ..right }),
        concept("the light fades as in a game", Shading { divisor: GAME_50, ..right }),
        concept("the light fades as in a game", Shading { divisor: GAME_100, ..right }),
        slip("r^2 is at least 1", Shading { divisor: |squared| squared.max(1.0), ..right }),
        slip(
            "incident light is clamped to 1",
            Shading { incident: |incident| incident.clamp(0.0, 1.0), ..right },
        ),
        slip("wi is not of unit length", Shading { long_wi: true, ..right }),
    ]
}

/// What can be wrong in an integrator that asks the scene for its BSDFs.
pub fn integrator_changes() -> Vec<Change> {
    let right = Shading::default();
    let of =
        |class| move |name, shading| Change { name, class, shading: Some(shading), fitted: None };
    let (slip, concept) = (of(PriceClass::Slip), of(PriceClass::Concept));
    let cosines =
        |cos_i: f64, cos_o: f64| Shading { cos_i: [cos_i; 2], cos_o: [cos_o; 2], ..right };
    let mut changes = light_changes();
    changes.push(fit("a constant is added", Fitted::Ambient));
    changes.extend([
        slip("cos theta_i is multiplied once more", cosines(2.0, 0.0)),
        slip("cos theta_i is multiplied twice more", cosines(3.0, 0.0)),
        slip("divided by cos theta_i", cosines(0.0, 0.0)),
        slip("cos theta_o is multiplied", cosines(1.0, 1.0)),
        slip("divided by cos theta_o", cosines(1.0, -1.0)),
        concept("no BSDF is asked", Shading { asks: false, ..right }),
    ]);
    let directions = |directions| Shading { directions, ..right };
    changes.extend([
        concept("wi reaches the BSDF in world space", directions(Directions::WorldWi)),
        slip("wo reaches the BSDF in world space", directions(Directions::WorldWo)),
        concept("wi and wo reach the BSDF in world space", directions(Directions::World)),
        slip("the frame's normal is negated", directions(Directions::NegatedNormal)),
        slip("wi is negated", directions(Directions::NegatedWi)),
        slip("wo is negated", directions(Directions::NegatedWo)),
        slip("wi and wo are exchanged", directions(Directions::Exchanged)),
        slip("wo stands for wi", directions(Directions::WoTwice)),
        slip("wi stands for wo", directions(Directions::WiTwice)),
        concept("wi is the light's position", directions(Directions::LightFromOrigin)),
        concept("wi leads from the viewer to the light", directions(Directions::LightFromViewer)),
        slip("wi is brought to world space", directions(Directions::WiToWorld)),
        slip("wi and wo are brought to world space", directions(Directions::BothToWorld)),
        slip("wo is brought to the local frame twice", directions(Directions::WoLocalTwice)),
        slip("wi is brought to the local frame twice", directions(Directions::WiLocalTwice)),
        slip("x and y of wi are exchanged", directions(Directions::WiTurned([1, 0, 2]))),
        slip("y and z of wi are exchanged", directions(Directions::WiTurned([0, 2, 1]))),
        slip("x and z of wi are exchanged", directions(Directions::WiTurned([2, 1, 0]))),
        slip("x and y of wo are exchanged", directions(Directions::WoTurned([1, 0, 2]))),
        slip("y and z of wo are exchanged", directions(Directions::WoTurned([0, 2, 1]))),
        slip("x and z of wo are exchanged", directions(Directions::WoTurned([2, 1, 0]))),
        slip("x is left out of r^2", Shading { without_axis: Some(0), ..right }),
        slip("y is left out of r^2", Shading { without_axis: Some(1), ..right }),
        slip("z is left out of r^2", Shading { without_axis: Some(2), ..right }),
        slip("r is the distance along the ray", Shading { along_ray: true, ..right }),
        slip("r is the light's distance from the origin", Shading { from_origin: true, ..right }),
        slip("wi is the sum of light and point", directions(Directions::LightPlusPoint)),
    ]);
    changes
}

/// What can be wrong in a shader: its BSDF or its light.
pub fn shader_changes(phong: bool) -> Vec<Change> {
    let mut bsdf = if phong { phong_changes() } else { diffuse_changes() };
    let output = |name, output| Change {
        name,
        class: PriceClass::Slip,
        shading: Some(Shading { output, ..Shading::default() }),
        fitted: None,
    };
    bsdf.extend([
        output("tone mapped radiance", |v| v / (1.0 + v.max(0.0))),
        output("gamma baked into radiance", |v| v.max(0.0).powf(1.0 / 2.2)),
        output("sRGB baked into radiance", |v| srgb::encode(v.max(0.0))),
        output("radiance clamped to 1", |v| v.clamp(0.0, 1.0)),
    ]);
    bsdf.push(fit("an ambient term", Fitted::Ambient));
    let fitted = |change: &Change| change.fitted.is_none();
    bsdf.into_iter().chain(light_changes().into_iter().filter(fitted)).collect()
}

fn fit(name: &'static str, fitted: Fitted) -> Change {
    Change { name, class: PriceClass::Slip, shading: None, fitted: Some(fitted) }
}
