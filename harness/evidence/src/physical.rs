//! Whether a BSDF is physically plausible: it is reciprocal and never reflects more light than it receives. The result
//! is a finding and decides nothing, since a BSDF is right or wrong by its formula.

use std::f64::consts::{FRAC_PI_2, TAU};

use renderer_api as api;

use super::bsdf::{BsdfKind, materials};
use super::{Check, CheckId, Measure, Verdict};

/// Largest relative difference between f(wo, wi) and f(wi, wo): f32 arithmetic, steep powers.
const ASYMMETRY: f64 = 1e-2;
/// Largest part of the light that is reflected; the quadrature is good to a thousandth.
const ALBEDO: f64 = 1.0 + 2e-3;
/// Nodes of the quadrature for each standard deviation 1/sqrt(n) of a lobe.
const NODES: f64 = 1.7;

/// Queries to a BSDF given by value, and what to make of the answers.
pub struct Probes {
    /// The questions.
    pub queries: Vec<api::BsdfQuery>,
    /// Number of pairs of queries that come first: a pair of directions, then the same exchanged.
    pairs: usize,
    /// Then the nodes of one integral after another: their solid angles [sr].
    integrals: Vec<Vec<f64>>,
}

impl Probes {
    /// The probes of a kind of BSDF, both directions always above the surface.
    pub fn new(kind: BsdfKind) -> Self {
        let mut probes = Self { queries: Vec::new(), pairs: 0, integrals: Vec::new() };
        let all = materials(kind);
        for material in &all {
            for cos_o in [0.95, 0.7, 0.4, 0.15] {
                for cos_i in [0.9, 0.5, 0.2] {
                    for azimuth in [0.3, 1.8, 3.1] {
                        let (wo, wi) = (direction(cos_o, 0.4), direction(cos_i, 0.4 + azimuth));
                        probes.pairs += 1;
                        probes.queries.extend([query(material, wo, wi), query(material, wi, wo)]);
                    }
                }
            }
        }
        // One material for each exponent: the last, whose Kd + Ks exceeds 1 if any does.
        let last = |i: &usize| all.get(i + 1).is_none_or(|next| next.exponent != all[*i].exponent);
        for material in (0..all.len()).filter(last).map(|i| &all[i]) {
            let n = if kind == BsdfKind::Phong { f64::from(material.exponent) } else { 0.0 };
            for cos_o in [1.0, 0.5] {
                probes.integrate(material, direction(cos_o, 0.4), n);
            }
        }
        probes
    }

    /// Adds the midpoint rule in polar angle and azimuth, fine enough for a lobe of exponent `n`.
    /// At the pole the integrand f sin(theta) is as steep as the lobe is high: the first ring takes
    /// the Euler-Maclaurin term -h^2/24 f for it.
    fn integrate(&mut self, material: &api::MaterialValue, wo: [f32; 3], n: f64) {
        let rows = (NODES * FRAC_PI_2 * n.sqrt()).ceil().max(24.0);
        let columns = (NODES * TAU * n.sqrt()).ceil().max(32.0);
        let mut solid_angles = Vec::new();
        for row in 0..rows as usize {
            let step = FRAC_PI_2 / rows;
            let theta = (row as f64 + 0.5) * step;
            let at_pole = if row == 0 { step * step / 24.0 } else { 0.0 };
            for column in 0..columns as usize {
                let wi = direction(theta.cos(), (column as f64 + 0.5) / columns * TAU);
                self.queries.push(query(material, wo, wi));
                solid_angles.push((theta.sin() * step - at_pole) * TAU / columns);
            }
        }
        self.integrals.push(solid_angles);
    }

    /// Judges the answers, three floats each. `None` if their number is not that of the questions.
    pub fn judge(&self, kind: BsdfKind, values: &[[f32; 3]]) -> Option<Check> {
        if values.len() != self.queries.len() {
            return None;
        }
        let (pairs, mut nodes) = values.split_at(2 * self.pairs);
        let mut asymmetry = 0.0f64;
        let exchanged = self.queries.as_chunks::<2>().0;
        for ([one, other], [q, r]) in pairs.as_chunks::<2>().0.iter().zip(exchanged) {
            for (a, b) in one.iter().zip(other) {
                let (a, b) = (f64::from(a / q.wi[2]), f64::from(b / r.wi[2]));
                let apart = (a - b).abs() / a.abs().max(b.abs()).max(1e-6);
                // Compared this way, a NaN counts as fully asymmetric.
                asymmetry = asymmetry.max(if apart <= 1.0 { apart } else { 1.0 });
            }
        }
        let mut albedo = 0.0f64;
        for solid_angles in &self.integrals {
            let (own, rest) = nodes.split_at(solid_angles.len());
            nodes = rest;
            for c in 0..3 {
                let sum: f64 = own.iter().zip(solid_angles).map(|(v, s)| f64::from(v[c]) * s).sum();
                albedo = albedo.max(if sum.is_finite() { sum } else { f64::MAX });
            }
        }
        let id = match kind {
            BsdfKind::Diffuse => CheckId::BsdfDiffusePhysical,
            BsdfKind::Phong => CheckId::BsdfPhongPhysical,
        };
        let measures = vec![
            Measure::at_most(
                None,
                "|f(wo, wi) - f(wi, wo)|, relative, at most",
                asymmetry,
                ASYMMETRY,
            ),
            Measure::at_most(None, "directional albedo, at most", albedo, ALBEDO),
        ];
        let possible = measures.iter().all(|measure| measure.passed);
        let verdict = if possible { Verdict::Pass } else { Verdict::Fail };
        let summary = format!(
            "swapping wi and wo changes f by up to {:.2} %; up to {:.1} % of the light is reflected",
            100.0 * asymmetry,
            100.0 * albedo
        );
        let hint = "no real surface does that: see what bsdf.* says of the formula";
        let check = Check::new(id, "", verdict, summary);
        Some(Check { measures, ..check.with_hint(if possible { "" } else { hint }) })
    }
}

fn direction(cos: f64, azimuth: f64) -> [f32; 3] {
    let sin = (1.0 - cos * cos).max(0.0).sqrt();
    [sin * azimuth.cos(), sin * azimuth.sin(), cos].map(|v| v as f32)
}

fn query(material: &api::MaterialValue, wo: [f32; 3], wi: [f32; 3]) -> api::BsdfQuery {
    let (source, material) = (api::BSDF_OF_VALUE, *material);
    api::BsdfQuery { source, material, shape: 0, primitive: 0, uv: [0.5, 0.5], wo, wi }
}

#[cfg(test)]
mod tests {
    use super::super::bsdf::value;
    use super::super::shading::energy_scale;
    use super::*;

    fn judge(kind: BsdfKind, change: impl Fn(&api::BsdfQuery, f64) -> f64) -> Check {
        let probes = Probes::new(kind);
        let answer = |q: &api::BsdfQuery| {
            value(&q.material, energy_scale(&q.material), q.wo, q.wi).map(|v| change(q, v) as f32)
        };
        let values: Vec<[f32; 3]> = probes.queries.iter().map(answer).collect();
        probes.judge(kind, &values).unwrap()
    }

    #[test]
    fn right_models_are_reciprocal_and_reflect_what_they_should() {
        // At normal incidence a lobe reflects Ks exactly, a Lambertian surface its albedo.
        for (kind, albedo) in [(BsdfKind::Diffuse, 0.97), (BsdfKind::Phong, 0.99)] {
            let check = judge(kind, |_, v| v);
            assert_eq!(check.verdict, Verdict::Pass, "{check:?}");
            assert!(check.measures[0].value < 1e-3, "{check:?}");
            assert!((check.measures[1].value - albedo).abs() < 2e-3, "{check:?}");
        }
        assert!(Probes::new(BsdfKind::Phong).queries.len() < 60_000);
    }

    #[test]
    fn what_no_surface_does_is_told() {
        let twice = judge(BsdfKind::Diffuse, |q, v| v * f64::from(q.wi[2]));
        assert!(!twice.measures[0].passed && twice.measures[1].passed, "{twice:?}");
        let bright = judge(BsdfKind::Phong, |_, v| 1.1 * v);
        assert!(bright.measures[0].passed && !bright.measures[1].passed, "{bright:?}");
        let nan = judge(BsdfKind::Phong, |_, _| f64::NAN);
        assert!(nan.measures.iter().all(|measure| !measure.passed), "{nan:?}");
    }
}
