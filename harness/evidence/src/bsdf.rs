//! Parts 1.1 and 1.2: a BSDF probed at a dense set of directions, against its formula in f64.

use basecode::Vec3;
use renderer_api as api;

use super::answers::Answers;
use super::changes;
use super::convention::Convention;
use super::lobe::{self, Answer};
use super::shading::{ShadedPoint, Shading, energy_scale};
use super::{Check, CheckId, Lobe, Measure, RuleId, Verdict};
use imaging::ratio::{ratio_name, triple};

/// Which BSDF is probed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BsdfKind {
    /// Lambertian reflection, part 1.1.
    Diffuse,
    /// Normalized Phong, part 1.2.
    Phong,
}

/// One question to a BSDF, with the right answer.
#[derive(Clone, Copy, Debug)]
pub struct BsdfProbe {
    /// The question.
    pub query: api::BsdfQuery,
    /// The BSDF's value, cosine included [sr^-1].
    pub expected: [f64; 3],
    /// The largest difference of a right answer, for each channel.
    pub tolerance: [f64; 3],
    /// The largest value of this material at any direction: the scale of a difference.
    pub peak: f64,
    /// What is asked about, `wi` with length 1.
    point: ShadedPoint,
    /// The length of `wi` in the question.
    length: f64,
}

/// Directions closer to the surface than this cosine are left out: a right answer may round
/// either way.
const MIN_COSINE: f32 = 1e-4;

/// The probes of a BSDF given by value: albedos, exponents whole and fractional, Kd + Ks below and
/// above 1, directions over both hemispheres, grazing ones included.
pub fn probes(kind: BsdfKind) -> Vec<BsdfProbe> {
    let mut probes = Vec::new();
    for material in materials(kind) {
        let exponent = if kind == BsdfKind::Phong { material.exponent } else { 1.0 };
        for (wo, wi) in directions(exponent) {
            let query = api::BsdfQuery {
                source: api::BSDF_OF_VALUE,
                material,
                shape: 0,
                primitive: 0,
                uv: [0.5, 0.5],
                wo: wo.into(),
                wi: wi.into(),
            };
            probes.push(BsdfProbe::new(query, energy_scale(&material)));
        }
    }
    probes
}

/// Probes with a `wi` that is not of unit length: some integrators leave that to the BSDF. A renderer need not answer
/// them correctly; see [`Convention`].
pub fn long_probes(kind: BsdfKind) -> Vec<BsdfProbe> {
    let lengths = [0.5f32, 2.0, 5.0];
    let some = probes(kind).into_iter().step_by(7).enumerate();
    some.map(|(index, mut probe)| {
        let length = lengths[index % lengths.len()];
        probe.length = f64::from(length);
        probe.query.wi = probe.query.wi.map(|w| length * w);
        probe
    })
    .collect()
}

/// A probe of the BSDF that a scene hands out for a textured shape; `material` holds the colors
/// that its textures have at `uv`, `scale` is the shape's energy scale.
pub fn textured_probe(
    (shape, primitive, uv): (u32, u32, [f32; 2]),
    (wo, wi): (Vec3, Vec3),
    (material, scale): (&api::MaterialValue, f64),
) -> BsdfProbe {
    let query = api::BsdfQuery {
        source: api::BSDF_OF_SHAPE,
        material: *material,
        shape,
        primitive,
        uv,
        wo: wo.into(),
        wi: wi.into(),
    };
    BsdfProbe::new(query, scale)
}

impl BsdfProbe {
    fn new(query: api::BsdfQuery, scale: f64) -> Self {
        let point = ShadedPoint::of_bsdf(&query.material, scale, query.wo, query.wi);
        let up = [0.0, 0.0, 1.0];
        let above = ShadedPoint { wo: up, wi: up, ..point };
        let peak = Shading::default().radiance(&above).into_iter().fold(0.0, f64::max);
        let expected = Shading::default().radiance(&point);
        let probe = Self { query, expected, tolerance: [0.0; 3], peak, point, length: 1.0 };
        Self { tolerance: probe.tolerance(expected), ..probe }
    }

    /// The right answer under a convention; nothing when the question is none under it.
    fn expected(&self, convention: &Convention) -> Option<[f64; 3]> {
        if self.length != 1.0 && convention.long_wi.is_none() {
            return None;
        }
        let growth = convention.growth(self.length);
        Some(convention.bsdf().radiance(&self.point).map(|value| growth * value))
    }

    /// The largest difference from a right answer: 1e-4 for f32 arithmetic in any order, 1e-6 n for
    /// what a power makes of its base's error.
    fn tolerance(&self, expected: [f64; 3]) -> [f64; 3] {
        let material = &self.query.material;
        let n =
            if material.model == api::MATERIAL_PHONG { f64::from(material.exponent) } else { 0.0 };
        expected.map(|b| (1e-4 + 1e-6 * n) * b.abs() + 1e-6 * self.peak)
    }
}

/// The BSDF of the handout, equation (1), times cos theta_i [sr^-1].
pub fn value(material: &api::MaterialValue, scale: f64, wo: [f32; 3], wi: [f32; 3]) -> [f64; 3] {
    Shading::default().radiance(&ShadedPoint::of_bsdf(material, scale, wo, wi))
}

pub(super) fn materials(kind: BsdfKind) -> Vec<api::MaterialValue> {
    let material = |model, diffuse, specular, exponent| api::MaterialValue {
        model,
        diffuse,
        specular,
        exponent,
    };
    match kind {
        BsdfKind::Diffuse => {
            [[0.8, 0.4, 0.1], [1.0, 1.0, 1.0], [0.0, 0.5, 0.02], [0.95, 0.9, 0.97]]
                .map(|albedo| material(api::MATERIAL_DIFFUSE, albedo, [0.3, 0.2, 0.1], 7.0))
                .to_vec()
        }
        BsdfKind::Phong => {
            let mut all = Vec::new();
            // The largest values of Kd and of Ks sum to more than 1, those of Kd + Ks do not.
            all.push(material(api::MATERIAL_PHONG, [0.7, 0.25, 0.1], [0.05, 0.2, 0.35], 2.0));
            for exponent in [1.0, 2.0, 9.8, 30.0, 50.0, 101.5, 500.0] {
                for (diffuse, specular) in [
                    ([0.5, 0.3, 0.1], [0.2, 0.3, 0.5]),
                    ([0.0, 0.0, 0.0], [0.9, 0.6, 0.3]),
                    ([0.9, 0.5, 0.2], [0.7, 0.2, 0.6]), // Kd + Ks above 1
                ] {
                    all.push(material(api::MATERIAL_PHONG, diffuse, specular, exponent));
                }
            }
            all
        }
    }
}

/// Pairs of unit directions (wo, wi) in the local frame: both hemispheres, every azimuth between
/// them, grazing, and around the mirror direction where a lobe of this exponent lives.
fn directions(exponent: f32) -> Vec<(Vec3, Vec3)> {
    const COSINES: [f32; 11] = [1.0, 0.94, 0.8, 0.6, 0.4, 0.2, 0.08, 0.02, 0.003, -0.03, -0.6];
    let direction = |cos: f32, azimuth: f32| {
        let sin = (1.0 - cos * cos).max(0.0).sqrt();
        Vec3::new(sin * azimuth.cos(), sin * azimuth.sin(), cos)
    };
    let mut pairs = Vec::new();
    for (i, &cos_o) in COSINES.iter().enumerate() {
        let turn = 0.7 * i as f32;
        let wo = direction(cos_o, turn);
        for &cos_i in &COSINES {
            for between in [0.0, 0.9, 2.0, std::f32::consts::PI, 4.4] {
                pairs.push((wo, direction(cos_i, turn + between)));
            }
        }
        let mirror = Vec3::new(-wo.x, -wo.y, wo.z);
        let (s, t) = mirror.any_orthonormal_pair();
        for level in [0.97f32, 0.7, 0.3, 0.05] {
            let cos_alpha = level.powf(1.0 / exponent.max(1.0));
            let sin_alpha = (1.0 - cos_alpha * cos_alpha).sqrt();
            for azimuth in [0.4f32, 2.5, 4.6] {
                let side = s * azimuth.cos() + t * azimuth.sin();
                pairs.push((wo, (mirror * cos_alpha + side * sin_alpha).normalize()));
            }
        }
    }
    pairs.retain(|(wo, wi)| wo.z.abs() >= MIN_COSINE && wi.z.abs() >= MIN_COSINE);
    pairs
}

/// Whether all answers to `probes` are right under a convention.
pub fn passes(probes: &[BsdfProbe], values: &[[f32; 3]], convention: &Convention) -> bool {
    probes.len() == values.len()
        && probes.iter().zip(values).all(|(probe, value)| {
            let Some(expected) = probe.expected(convention) else { return true };
            let tolerance = probe.tolerance(expected);
            (0..3).all(|c| (f64::from(value[c]) - expected[c]).abs() <= tolerance[c])
        })
}

/// Judges the answers to `probes`, three floats each, under a convention.
pub fn judge(
    kind: BsdfKind,
    probes: &[BsdfProbe],
    values: &[[f32; 3]],
    convention: &Convention,
) -> Check {
    let (id, name) = match kind {
        BsdfKind::Diffuse => (CheckId::BsdfDiffuse, "diffuse"),
        BsdfKind::Phong => (CheckId::BsdfPhong, "Phong"),
    };
    if values.len() != probes.len() {
        let summary = format!("{} answers to {} BSDF queries", values.len(), probes.len());
        return Check::new(id, "", Verdict::Fail, summary);
    }
    let asked = probes.iter().zip(values);
    let asked: Vec<(BsdfProbe, [f32; 3])> = asked
        .filter_map(|(probe, value)| {
            let expected = probe.expected(convention)?;
            Some((BsdfProbe { expected, tolerance: probe.tolerance(expected), ..*probe }, *value))
        })
        .collect();
    let (probes, values): (Vec<BsdfProbe>, Vec<[f32; 3]>) = asked.into_iter().unzip();
    let (probes, values) = (&probes[..], &values[..]);
    let (mut wrong, mut not_finite) = (0usize, 0usize);
    let mut worst: Option<(f64, usize)> = None;
    let mut ratios = Vec::new();
    for (index, (probe, value)) in probes.iter().zip(values).enumerate() {
        let mut excess = 0.0f64;
        for (c, &answer) in value.iter().enumerate() {
            let (a, b) = (f64::from(answer), probe.expected[c]);
            // NaN is never right.
            let difference = if a.is_finite() { (a - b).abs() } else { f64::INFINITY };
            not_finite += usize::from(!a.is_finite());
            excess = excess.max(difference / probe.tolerance[c].max(f64::MIN_POSITIVE));
            if b > 0.01 * probe.peak && a.is_finite() {
                ratios.push(a / b);
            }
        }
        if excess > 1.0 {
            wrong += 1;
            if worst.is_none_or(|(most, _)| excess > most) {
                worst = Some((excess, index));
            }
        }
    }
    let fraction = wrong as f64 / probes.len() as f64;
    let mut check = match worst {
        None => Check::new(
            id,
            "",
            Verdict::Pass,
            format!("the {name} BSDF is right at all {} directions", probes.len()),
        ),
        Some((_, index)) => {
            let summary = describe(name, wrong, probes, index, values[index]);
            Check::new(id, "", Verdict::Fail, summary).with_hint(hint(ratios, probes, values))
        }
    };
    let price = (wrong > 0).then(|| {
        // By material, or by shape where a scene hands them out.
        let fields = |m: &api::MaterialValue| (m.model, m.diffuse, m.specular, m.exponent);
        let mut known: Vec<(u32, api::MaterialValue)> = Vec::new();
        let groups: Vec<usize> = probes
            .iter()
            .map(|BsdfProbe { query, .. }| {
                let of_shape = query.source == api::BSDF_OF_SHAPE;
                let same = |(shape, material): &(u32, api::MaterialValue)| {
                    *shape == query.shape
                        && (of_shape || fields(material) == fields(&query.material))
                };
                known.iter().position(same).unwrap_or_else(|| {
                    known.push((query.shape, query.material));
                    known.len() - 1
                })
            })
            .collect();
        // A change is made to what is right under the convention.
        let under = convention.bsdf();
        let of = |index: usize, shading: &Shading| {
            let probe: &BsdfProbe = &probes[index];
            let shading = shading.over(&under);
            let growth = convention.growth(probe.length);
            shading.radiance(&probe.point).map(|value| growth * value)
        };
        let changes = match kind {
            BsdfKind::Diffuse => changes::diffuse_changes(),
            BsdfKind::Phong => changes::phong_changes(),
        };
        let unit = |index: usize| probes[index].peak;
        let group = |index: usize| groups[index];
        let answers = Answers {
            found: values,
            of: &of,
            unit: &unit,
            group: &group,
            relative: 2e-4,
            changes: &changes,
        };
        answers.price(None)
    });
    check.error = price.map_or(0.0, |price| price.error);
    check.mistake = price.map_or_else(String::new, |price| price.name());
    let of_shape = probes.iter().any(|probe| probe.query.source == api::BSDF_OF_SHAPE);
    let rule = if of_shape { RuleId::BsdfTextured } else { RuleId::BsdfValue };
    check.measures = vec![
        Measure::at_most(rule, "directions answered wrongly (fraction)", fraction, 0.0),
        Measure::at_most(rule, "values not finite (count)", not_finite as f64, 0.0),
    ];
    check.measures.extend(price.and_then(|price| price.measure()));
    if wrong > 0 && !of_shape {
        check.lobe = lobe_of(probes, values, convention);
    }
    check
}

/// The lobe that is furthest off.
fn lobe_of(probes: &[BsdfProbe], values: &[[f32; 3]], convention: &Convention) -> Option<Lobe> {
    let mean = |values: [f64; 3]| values.iter().sum::<f64>() / 3.0;
    let asked = probes.iter().zip(values).filter(|(probe, _)| probe.length == 1.0);
    let answers: Vec<Answer> = asked
        .map(|(BsdfProbe { query, expected, .. }, found)| Answer {
            material: query.material,
            wo: query.wo,
            wi: query.wi,
            expected: mean(*expected),
            found: mean(found.map(f64::from)),
        })
        .collect();
    let right = |material: &api::MaterialValue, wo: [f32; 3], wi: [f32; 3]| {
        let point = ShadedPoint::of_bsdf(material, energy_scale(material), wo, wi);
        mean(convention.bsdf().radiance(&point))
    };
    lobe::worst(&answers, &right)
}

fn describe(
    name: &str,
    wrong: usize,
    probes: &[BsdfProbe],
    worst: usize,
    found: [f32; 3],
) -> String {
    let BsdfProbe { query, expected, .. } = &probes[worst];
    let degrees = |w: [f32; 3]| w[2].clamp(-1.0, 1.0).acos().to_degrees();
    let material = match query.material.model {
        api::MATERIAL_PHONG => format!(
            "kd {}, ks {}, n {}",
            triple(query.material.diffuse),
            triple(query.material.specular),
            query.material.exponent
        ),
        _ => format!("kd {}", triple(query.material.diffuse)),
    };
    format!(
        "the {name} BSDF is wrong at {wrong} of {} directions; worst with {material}, wo {:.0} and wi {:.0} \
         degrees from the normal: expected {}, found {}",
        probes.len(),
        degrees(query.wo),
        degrees(query.wi),
        triple(expected.map(|v| v as f32)),
        triple(found),
    )
}

/// What a constant ratio, or the place of the wrong answers, gives away.
fn hint(mut ratios: Vec<f64>, probes: &[BsdfProbe], values: &[[f32; 3]]) -> String {
    if values.iter().flatten().any(|v| v.is_infinite()) {
        return "a value is infinite: is the mirror direction of length 1, and is nothing divided by 0?".into();
    }
    if values.iter().flatten().any(|v| v.is_nan()) {
        return "pow of a negative base is not a number: clamp cos alpha to 0 first".into();
    }
    let nonzero_where_black = |wanted: fn(&api::BsdfQuery) -> bool| {
        probes.iter().zip(values).any(|(probe, value)| {
            probe.expected == [0.0; 3]
                && wanted(&probe.query)
                && value.iter().any(|v| v.abs() > 1e-6)
        })
    };
    if nonzero_where_black(|q| q.wi[2] < 0.0 && q.wo[2] > 0.0) {
        return "light from below the surface must give 0: test cos theta of wi".into();
    }
    if nonzero_where_black(|q| q.wo[2] < 0.0 && q.wi[2] > 0.0) {
        return "a surface seen from behind must give 0: test cos theta of wo".into();
    }
    if ratios.is_empty() {
        return String::new();
    }
    ratios.sort_by(f64::total_cmp);
    let at = |fraction: f64| ratios[((ratios.len() - 1) as f64 * fraction) as usize];
    let (low, median, high) = (at(0.005), at(0.5), at(0.995));
    if median.abs() < 1e-6 && high.abs() < 1e-6 {
        return "the BSDF is black".into();
    }
    let factor = (median - 1.0).abs() > 0.005;
    if factor && (high - low).abs() < 0.002 * median.abs() {
        return match ratio_name(median) {
            Some(factor) => format!("off by a constant factor: {factor}"),
            None => format!("off by a constant factor of {median:.4}"),
        };
    }
    String::new()
}

#[cfg(test)]
mod tests {
    use super::super::price::PriceClass;
    use super::*;

    fn judge_plain(kind: BsdfKind, probes: &[BsdfProbe], values: &[[f32; 3]]) -> Check {
        judge(kind, probes, values, &Convention::default())
    }

    fn answers(probes: &[BsdfProbe], change: impl Fn(&BsdfProbe) -> [f64; 3]) -> Vec<[f32; 3]> {
        probes.iter().map(|probe| change(probe).map(|v| v as f32)).collect()
    }

    #[test]
    fn the_formula_has_its_closed_forms() {
        let material = materials(BsdfKind::Phong)[1];
        let up = [0.0, 0.0, 1.0];
        let expected = 0.5 / std::f64::consts::PI + 0.2 * 3.0 / std::f64::consts::TAU;
        assert!((value(&material, 1.0, up, up)[0] - expected).abs() < 1e-7);
        let down = [0.0, 0.0, -1.0];
        assert_eq!(value(&material, 1.0, down, up), [0.0; 3]);
        assert_eq!(value(&material, 1.0, up, down), [0.0; 3]);
        let scaled = materials(BsdfKind::Phong)[3];
        assert!((energy_scale(&scaled) - 0.99 / 1.6).abs() < 1e-7);
    }

    #[test]
    fn right_answers_pass_and_each_mistake_fails() {
        for kind in [BsdfKind::Diffuse, BsdfKind::Phong] {
            let probes = probes(kind);
            assert!(probes.len() > 1000);
            let right = judge_plain(kind, &probes, &answers(&probes, |p| p.expected));
            assert_eq!((right.verdict, right.error), (Verdict::Pass, 0.0), "{right:?}");
            let black = judge_plain(kind, &probes, &answers(&probes, |_| [0.0; 3]));
            assert_eq!(black.verdict, Verdict::Fail);
            assert!((black.error - 1.0).abs() < 1e-6, "{}", black.error);
            let gain =
                judge_plain(kind, &probes, &answers(&probes, |p| p.expected.map(|v| 1.01 * v)));
            assert_eq!(gain.verdict, Verdict::Fail);
            assert!((gain.error - 0.01).abs() < 1e-4, "{}", gain.error);
            for factor in [0.5, 3.0, std::f64::consts::PI] {
                let gain = answers(&probes, |p| p.expected.map(|v| factor * v));
                let gain = judge_plain(kind, &probes, &gain);
                assert!((gain.error - 0.02).abs() < 1e-3, "one slip: {}", gain.error);
            }
            let pi = judge_plain(
                kind,
                &probes,
                &answers(&probes, |p| p.expected.map(|v| v * std::f64::consts::PI)),
            );
            assert!(pi.hint.contains("pi"), "{}", pi.hint);
            let nan = judge_plain(kind, &probes, &answers(&probes, |_| [f64::NAN; 3]));
            assert!(nan.verdict == Verdict::Fail && nan.error >= 1.0, "{}", nan.error);
            let cosine = answers(&probes, |p| p.expected.map(|v| v * f64::from(p.query.wi[2])));
            assert_eq!(judge_plain(kind, &probes, &cosine).verdict, Verdict::Fail);
            let few = judge_plain(kind, &probes, &[[0.0; 3]]);
            assert_eq!(few.verdict, Verdict::Fail);
        }
    }

    #[test]
    fn a_convention_is_right_under_itself_alone() {
        let mut probes = probes(BsdfKind::Phong);
        probes.extend(long_probes(BsdfKind::Phong));
        let kept = Convention { cos_i: 1, pi: -1, long_wi: Some(0) };
        let values: Vec<[f32; 3]> =
            probes.iter().map(|p| p.expected(&kept).unwrap().map(|v| v as f32)).collect();
        for convention in Convention::all() {
            // Of unit length, wi tells nothing of what eval() would make of another.
            let same = (convention.cos_i, convention.pi) == (1, -1)
                && convention.long_wi.is_none_or(|growth| growth == 0);
            assert_eq!(passes(&probes, &values, &convention), same, "{convention:?}");
            let judged = judge(BsdfKind::Phong, &probes, &values, &convention).verdict;
            assert_eq!(judged == Verdict::Pass, same, "{convention:?}");
        }
    }

    /// cos alpha of a renderer, from wo, wi and the cosine between them.
    type CosAlpha = fn([f32; 3], [f32; 3], f32) -> f32;

    #[test]
    fn one_wrong_sign_power_or_cosine_of_the_mirror_direction_is_a_slip() {
        let probes = probes(BsdfKind::Phong);
        // In single precision, as a student's code: a direction that is too long overflows.
        let error = |cos_alpha: CosAlpha| {
            let values: Vec<[f32; 3]> = probes
                .iter()
                .map(|probe| {
                    let (wo, wi) = (probe.query.wo, probe.query.wi);
                    if wo[2] <= 0.0 || wi[2] <= 0.0 {
                        return [0.0; 3];
                    }
                    let (m, scale) = (&probe.point.material, probe.point.scale as f32);
                    let between = wo[0] * wi[0] + wo[1] * wi[1] + wo[2] * wi[2];
                    let base = cos_alpha(wo, wi, between).max(0.0);
                    let lobe = (m.exponent + 2.0) / std::f32::consts::TAU * base.powf(m.exponent);
                    let term =
                        |c: usize| m.diffuse[c] / std::f32::consts::PI + m.specular[c] * lobe;
                    [0, 1, 2].map(|c| scale * term(c) * wi[2])
                })
                .collect();
            judge_plain(BsdfKind::Phong, &probes, &values)
        };
        let right = error(|wo, wi, between| 2.0 * wo[2] * wi[2] - between);
        assert_eq!(right.verdict, Verdict::Pass, "{}", right.summary);
        let slips: [CosAlpha; 7] = [
            |wo, wi, between| 2.0 * wo[2] * wi[2] + between,
            |wo, wi, between| wo[2] * wi[2] - between,
            |wo, wi, between| between - 2.0 * wo[2] * wi[2],
            |_, wi, between| 2.0 * wi[2] * wi[2] - between,
            |wo, _, between| 2.0 * wo[2] * wo[2] - between,
            |_, wi, between| 2.0 * wi[2] - between,
            |wo, _, between| 2.0 * wo[2] - between,
        ];
        for (index, slip) in slips.into_iter().enumerate() {
            let check = error(slip);
            let off = check.error / PriceClass::Slip.price();
            assert!((0.9..1.2).contains(&off), "{index}: {} {}", check.error, check.mistake);
            assert!(!check.hint.contains("negative base"), "{index}: {}", check.hint);
        }
    }

    #[test]
    fn a_second_mistake_never_costs_less() {
        let probes = probes(BsdfKind::Phong);
        let right = Shading::default();
        let no_scale = Shading { scaled: [false; 2], ..right };
        let n_plus_1 = Shading { normalization: |n| (n + 1.0) / std::f64::consts::TAU, ..right };
        let both = Shading { scaled: [false; 2], ..n_plus_1 };
        let error = |shading: Shading| {
            let values = answers(&probes, |p| shading.radiance(&p.point));
            judge_plain(BsdfKind::Phong, &probes, &values).error
        };
        let (a, b, both) = (error(no_scale), error(n_plus_1), error(both));
        assert!((a - 0.02).abs() < 1e-3 && b <= 0.02 && both > a && both > b, "{a} {b} {both}");
        // All of the lobe is missing: that is no slip.
        let diffuse = error(Shading { factor: [1.0, 0.0], ..right });
        assert!((0.1..0.35).contains(&diffuse), "{diffuse}");
    }

    #[test]
    fn a_missing_test_of_either_direction_is_named() {
        let probes = probes(BsdfKind::Diffuse);
        let unguarded = |p: &BsdfProbe| {
            let cos = f64::from(p.query.wi[2]);
            p.query.material.diffuse.map(|kd| f64::from(kd) / std::f64::consts::PI * cos)
        };
        let no_wi = judge_plain(BsdfKind::Diffuse, &probes, &answers(&probes, unguarded));
        assert!(no_wi.hint.contains("wi"), "{}", no_wi.hint);
        let no_wo = answers(&probes, |p| unguarded(p).map(|v| v.max(0.0)));
        let no_wo = judge_plain(BsdfKind::Diffuse, &probes, &no_wo);
        assert!(no_wo.hint.contains("wo"), "{}", no_wo.hint);
    }
}
