//! Part 2.5: whether realtime shadows fall where they should, apart from how surfaces are shaded.

use std::collections::BTreeMap;

use basecode::Image;

use super::light_levels::{Levels, what_lit_get};
use super::price::{self, Price, PriceClass};
use super::{Check, CheckId, Measure, RuleId, Verdict};
use imaging::reference::RegionMask;
use imaging::tolerances::Tolerances;

/// A pixel is lit when it differs from the image without shadows by less than this fraction, dark
/// when less than this fraction is left.
const HALF_LIGHT: f32 = 0.02;
/// Pixels dimmer than this fraction of the scene's median tell nothing about shadows.
const DIM: f32 = 1e-5;
/// Fraction of the lit and of the shadowed surface that must tell something.
const LEAST_KNOWN: f64 = 0.25;
/// An image may have shadows when so much of what lies in shadow is black: not all of it where
/// mirrors are, which are drawn plain.
const MOSTLY: f64 = 0.02;

/// The measure of a check that was judged by visibility.
const VISIBILITY: &str = "lit pixels that are not lit (fraction)";

/// An image that is wrong and so dark that it tells nothing of its shadows leaves the verdict to
/// another scene that does, if there is one. Only the checks from `begin` on are changed. Where none of these tells,
/// what they count for is decided before them: what is drawn and dark passes.
pub fn leave_unjudged(checks: &mut [Check], begin: usize) {
    let is_bonus =
        |check: &Check| check.id == CheckId::BonusImage || check.id == CheckId::BonusProbe;
    let tells = |check: &Check| {
        let visibility = check.measures.iter().any(|measure| measure.name == VISIBILITY);
        is_bonus(check) && (check.verdict == Verdict::Pass || visibility)
    };
    if !checks.iter().any(tells) {
        return;
    }
    // What fails although the picture is right is not too dark.
    let is_right = |check: &Check| {
        !check.measures.is_empty() && check.measures.iter().all(|measure| measure.passed)
    };
    let told_before = !checks[begin..].iter().any(tells);
    for check in &mut checks[begin..] {
        let is_drawn = !check.measures.is_empty();
        let dark = !tells(check) && !is_right(check) && (is_drawn || !told_before);
        if is_bonus(check) && check.verdict == Verdict::Fail && dark {
            check.verdict = if told_before { Verdict::Pass } else { Verdict::NotJudged };
            check.summary = format!(
                "too dark to tell where shadows fall; another scene does ({})",
                check.summary
            );
        }
    }
}

/// The masks of one film: which pixels lie in shadow.
#[derive(Clone, Copy)]
pub struct Shadows<'a> {
    /// With shadows.
    pub mask: &'a RegionMask,
    /// Without.
    pub unshadowed: &'a RegionMask,
    /// Median lit value of the scene.
    pub median_lit: f32,
}

impl Shadows<'_> {
    /// Pixels that face light and viewer, away from edges: index, and whether they are in the light.
    fn pixels(&self) -> impl Iterator<Item = (usize, bool)> {
        let clear = |value: u16| value & (RegionMask::EDGE | RegionMask::EMITTER) == 0;
        let both = self.mask.pixels.iter().zip(&self.unshadowed.pixels).enumerate();
        both.filter(move |(_, (with, without))| {
            clear(**with) && self.unshadowed.is_lit_interior(**without)
        })
        .map(|(index, (with, _))| (index, self.mask.region(*with).lit))
    }

    /// Whether a frame that should be without shadows has them: what lies in shadow is black.
    pub fn are_in(&self, frame: &Image) -> bool {
        let (mut dark, mut black) = (0usize, 0usize);
        for (index, _) in self.pixels().filter(|(_, lit)| !lit) {
            dark += 1;
            black += usize::from(frame.pixels[index].abs().max_element() <= DIM * self.median_lit);
        }
        dark > 0 && black as f64 > MOSTLY * dark as f64
    }

    /// The mask without shadows, in which nothing that lies in shadow is compared.
    pub fn lit_alone(&self) -> RegionMask {
        let mut mask = self.unshadowed.clone();
        for (value, with) in mask.pixels.iter_mut().zip(&self.mask.pixels) {
            let in_light = self.mask.region(*with).lit && with & RegionMask::EDGE == 0;
            let faces = self.unshadowed.region(*value).lit;
            if faces && !in_light {
                *value |= RegionMask::EMITTER;
            }
        }
        mask
    }

    /// Judges visibility from the renderer's own frames with and without shadows, so that a fault
    /// in shading is not paid twice. Nothing when too little of the frame without shadows is lit.
    pub fn judge(
        &self,
        scene: &str,
        with: &Image,
        without: &Image,
        tolerances: &Tolerances,
    ) -> Option<Check> {
        // For shadowed and for lit pixels: all, those that tell something, those that are wrong.
        let mut counts = [[0usize; 3]; 2];
        let mut first = None;
        let mut known_pixels = Vec::new();
        for (index, lit) in self.pixels() {
            let (a, b) = (with.pixels[index], without.pixels[index]);
            let [all, known, wrong] = &mut counts[usize::from(lit)];
            *all += 1;
            if !(b.is_finite() && b.abs().max_element() > DIM * self.median_lit) {
                continue;
            }
            *known += 1;
            let phong = self.unshadowed.region(self.unshadowed.pixels[index]).exponent > 0.0;
            let visibility = f64::from(a.element_sum()) / f64::from(b.element_sum());
            let (region, left) =
                (self.mask.pixels[index] & RegionMask::INDEX, f64::from(a.element_sum()));
            known_pixels.push(Known { lit, phong, visibility, region, left });
            let off = if lit { (a - b).abs() } else { a.abs() };
            // Compared this way, a NaN counts as wrong.
            let right = off.max_element() <= HALF_LIGHT * b.abs().max_element();
            if !right {
                *wrong += 1;
                first = first.or(Some(index));
            }
        }
        let told =
            |[all, known, _]: [usize; 3]| all > 0 && known as f64 >= LEAST_KNOWN * all as f64;
        if !counts.iter().all(|count| told(*count)) {
            return None;
        }
        let fraction = |[_, known, wrong]: [usize; 3]| wrong as f64 / known as f64;
        let bound = |[_, known, _]: [usize; 3]| {
            tolerances.interior_fraction + f64::from(tolerances.spare_pixels) / known as f64
        };
        let [dark, lit] = counts;
        let mut measures = vec![
            Measure::at_most(RuleId::BonusLit, VISIBILITY, fraction(lit), bound(lit)),
            Measure::at_most(
                RuleId::BonusDark,
                "shadowed pixels that are not dark (fraction)",
                fraction(dark),
                bound(dark),
            ),
        ];
        let id = CheckId::BonusImage;
        let mut check = match first.filter(|_| measures.iter().any(|measure| !measure.passed)) {
            None => {
                let summary =
                    "shadows fall where they should; how surfaces are shaded is judged elsewhere";
                Check::new(id, scene, Verdict::Pass, summary)
            }
            Some(index) => {
                let lit_ones = known_pixels.iter().filter(|pixel| pixel.lit);
                let off = |light: &f64| (light - 1.0).abs() > f64::from(HALF_LIGHT);
                let get = what_lit_get(lit_ones.map(|pixel| pixel.visibility).filter(off));
                let summary = format!(
                    "{} of {} pixels that see the light get {get}, {} of {} in shadow get light; first at ({}, {})",
                    lit[2],
                    lit[1],
                    dark[2],
                    dark[1],
                    index % self.mask.width,
                    index / self.mask.width
                );
                let hint = match (measures[0].passed, measures[1].passed) {
                    (true, _) if fraction(dark) > 0.99 => "no point is in shadow",
                    (true, _) => {
                        "shadows are missing or come loose from what casts them: too much bias?"
                    }
                    (_, true) if get == "none" => {
                        "lit points are in shadow: too little bias, or the light's frustum is too small"
                    }
                    _ => "",
                };
                let unknown = |[all, known, _]: [usize; 3]| 1.0 - known as f64 / all as f64;
                let unknown = unknown(lit).max(unknown(dark));
                let price = price(&known_pixels, fraction(lit), fraction(dark), unknown);
                measures.extend(price.measure());
                let check = Check::new(id, scene, Verdict::Fail, summary);
                Check { error: price.error, mistake: price.name(), ..check }.with_hint(hint)
            }
        };
        check.measures = measures;
        Some(check)
    }
}

/// What a pixel says of shadows.
#[derive(Clone, Copy)]
struct Known {
    /// Whether the light reaches it.
    lit: bool,
    /// Whether its material is Phong.
    phong: bool,
    /// What is left of the light, as the frames have it: a fraction.
    visibility: f64,
    /// The number of its region.
    region: u16,
    /// Radiance with shadows, summed over channels.
    left: f64,
}

/// Judges shadowed pixels that have one radiance in each region, as an ambient term leaves them. Returns the largest
/// fraction of light left to half of a region, and the fraction of dark pixels with another radiance.
fn ambient(pixels: &[Known]) -> (f64, f64) {
    let mut of_region: BTreeMap<u16, Vec<&Known>> = BTreeMap::new();
    for pixel in pixels.iter().filter(|pixel| !pixel.lit) {
        of_region.entry(pixel.region).or_default().push(pixel);
    }
    let (mut largest, mut off, mut all) = (0.0, 0usize, 0usize);
    for own in of_region.values_mut() {
        own.sort_by(|a, b| a.left.total_cmp(&b.left));
        let median = own[own.len() / 2].left;
        // Compared this way, a NaN counts as off.
        let same = own.iter().filter(|p| (p.left - median).abs() <= f64::from(HALF_LIGHT) * median);
        (off, all) = (off + own.len() - same.count(), all + own.len());
        own.sort_by(|a, b| a.visibility.total_cmp(&b.visibility));
        largest = f64::max(largest, own[own.len() / 2].visibility);
    }
    (largest, off as f64 / all.max(1) as f64)
}

/// An ambient term leaves no more of the light than this to half of a region: beyond it, a dim corner without any
/// shadow has about the same radiance everywhere too.
const AMBIENT: f64 = 0.5;

/// The fraction of lit pixels that are lit, if most are dark: they may lie outside of the shadow map.
fn outside(pixels: &[Known]) -> f64 {
    let lit = || pixels.iter().filter(|pixel| pixel.lit);
    let right = lit().filter(|p| (p.visibility - 1.0).abs() <= f64::from(HALF_LIGHT)).count();
    let fraction = right as f64 / lit().count().max(1) as f64;
    if fraction < 0.5 { fraction } else { 0.0 }
}

/// The mistake of shadows where light belongs, and the reverse.
pub const EXCHANGED: &str = "lit and dark are exchanged";

/// What unknown pixels cost where some shadows are wrong: at most what known ones would.
const UNKNOWN: f64 = 0.025;

/// The price of wrong shadows, with the fractions of lit and of shadowed pixels that are wrong. The two errors add up.
/// The fraction of pixels that are `unknown`, because another mistake leaves them dark, may be wrong as well.
fn price(pixels: &[Known], lit_wrong: f64, dark_wrong: f64, unknown: f64) -> Price {
    // Without a shadow anywhere, or light, nothing is there.
    let dark = pixels.iter().filter(|pixel| pixel.visibility < f64::from(HALF_LIGHT)).count();
    let [least, most] = [0.01, 0.99].map(|fraction| fraction * pixels.len() as f64);
    let price = Price::of_raw(lit_wrong + dark_wrong);
    let price = match dark as f64 > least && (dark as f64) < most {
        true => price.or(price::UNKNOWN, PriceClass::Unknown, 0.0),
        false => price,
    };
    let residual = |light: &dyn Fn(&Known) -> f64| {
        let wrong = |lit: bool| {
            let own = pixels.iter().filter(|pixel| pixel.lit == lit);
            let (mut all, mut wrong) = (0usize, 0usize);
            for pixel in own {
                all += 1;
                // Compared this way, a NaN counts as wrong.
                let right = (pixel.visibility - light(pixel)).abs() <= f64::from(HALF_LIGHT);
                wrong += usize::from(!right);
            }
            wrong as f64 / all.max(1) as f64
        };
        wrong(true) + wrong(false)
    };
    let mut price = price;
    // Mistakes that leave some shadow here, which is there: without any they look like none at all.
    let some_dark = |light: &dyn Fn(&Known) -> f64| {
        let dark = pixels.iter().filter(|pixel| !pixel.lit);
        let left = dark.clone().filter(|pixel| light(pixel) == 0.0);
        let seen = left.clone().filter(|pixel| pixel.visibility < 0.5).count();
        left.clone().count() as f64 > 0.05 * dark.count() as f64 && 2 * seen > left.count()
    };
    for (name, class, light) in [
        (
            EXCHANGED,
            PriceClass::Slip,
            (|p: &Known| f64::from(u8::from(!p.lit))) as fn(&Known) -> f64,
        ),
        ("no shadow falls on Phong materials", PriceClass::Concept, |p| {
            f64::from(u8::from(p.lit || p.phong))
        }),
        ("no shadow falls on diffuse materials", PriceClass::Concept, |p| {
            f64::from(u8::from(p.lit || !p.phong))
        }),
    ] {
        // Outside of the map all is lit, either way.
        let outside = if name == EXCHANGED { outside(pixels) } else { 0.0 };
        if name == EXCHANGED || some_dark(&light) {
            price = price.or(name, class, residual(&light) - outside);
        }
    }
    let price = match price::partly(price, lit_wrong, dark_wrong) {
        partly if partly.error < price.error => {
            let error = (partly.error + UNKNOWN * unknown).min(price.error);
            Price { error, ..partly }
        }
        _ => price,
    };
    let price = match ambient(pixels) {
        (left, off) if left > 0.0 && left <= AMBIENT => {
            let residual = price::fading(left) + off + lit_wrong;
            price.or("an ambient term is left in shadow", PriceClass::Slip, residual)
        }
        _ => price,
    };
    let seen = pixels.iter().map(|pixel| (pixel.lit, pixel.visibility));
    Levels::of(seen)
        .priced(price, |lit, dark| residual(&|pixel: &Known| if pixel.lit { lit } else { dark }))
}

#[cfg(test)]
mod tests {
    use basecode::Vec3;

    use super::*;
    use imaging::reference::Region;

    /// 20 pixels in a row, the last 10 in shadow.
    fn masks() -> (RegionMask, RegionMask) {
        let mut unshadowed = RegionMask::background(20, 1);
        for lit in [true, false] {
            unshadowed.regions.push(Region { name: "floor".into(), lit, exponent: 0.0 });
        }
        unshadowed.pixels = vec![1; 20];
        let mut mask = unshadowed.clone();
        mask.pixels[10..].fill(2);
        (mask, unshadowed)
    }

    fn image(value: impl Fn(usize) -> f32) -> Image {
        Image { width: 20, height: 1, pixels: (0..20).map(|i| Vec3::splat(value(i))).collect() }
    }

    fn judge(with: &Image, without: &Image) -> Option<Verdict> {
        let (mask, unshadowed) = masks();
        let shadows = Shadows { mask: &mask, unshadowed: &unshadowed, median_lit: 1.0 };
        let tolerances = Tolerances { spare_pixels: 0, ..Tolerances::default() };
        shadows.judge("s", with, without, &tolerances).map(|check| check.verdict)
    }

    #[test]
    fn visibility_is_judged_apart_from_shading() {
        let shading = |i: usize| 3.0 + i as f32;
        let without = image(shading);
        let right = image(|i| if i < 10 { shading(i) } else { 0.0 });
        assert_eq!(judge(&right, &without), Some(Verdict::Pass));
        assert_eq!(judge(&without, &without), Some(Verdict::Fail));
        assert_eq!(judge(&image(|_| 0.0), &without), Some(Verdict::Fail));
        let acne = image(|i| if i < 9 { shading(i) } else { 0.0 });
        assert_eq!(judge(&acne, &without), Some(Verdict::Fail));
        let not_a_number = image(|i| if i < 10 { f32::NAN } else { 0.0 });
        assert_eq!(judge(&not_a_number, &without), Some(Verdict::Fail));
        // A black renderer shows nothing and earns nothing.
        assert_eq!(judge(&right, &image(|_| 0.0)), None);
    }

    #[test]
    fn a_comparison_that_is_reversed_is_a_slip_whatever_lies_outside_of_the_map() {
        let (mask, unshadowed) = masks();
        let shadows = Shadows { mask: &mask, unshadowed: &unshadowed, median_lit: 1.0 };
        let tolerances = Tolerances { spare_pixels: 0, ..Tolerances::default() };
        let error = |dark: &[usize]| {
            let without = image(|i| 2.0 + i as f32);
            let with = image(|i| if dark.contains(&i) { 0.0 } else { 2.0 + i as f32 });
            let check = shadows.judge("s", &with, &without, &tolerances).unwrap();
            (check.error, check.mistake)
        };
        let slip = (PriceClass::Slip.price(), EXCHANGED.to_owned());
        let within: Vec<usize> = (0..7).collect();
        assert_eq!(error(&within), slip);
        assert_eq!(error(&(0..10).collect::<Vec<_>>()), slip);
        // No shadow where one belongs, and some where none does.
        assert_ne!(error(&[0, 1, 2]).1, EXCHANGED);
    }

    #[test]
    fn an_ambient_term_in_shadow_costs_a_slip_and_no_shadow_all() {
        let (mask, unshadowed) = masks();
        let shadows = Shadows { mask: &mask, unshadowed: &unshadowed, median_lit: 1.0 };
        let tolerances = Tolerances { spare_pixels: 0, ..Tolerances::default() };
        let error = |left: &dyn Fn(usize) -> f32| {
            // In the light, and without shadows, each pixel has its own radiance beside what is left.
            let without = image(|i| 2.0 + i as f32 + left(i));
            let with = image(|i| if i < 10 { 2.0 + i as f32 + left(i) } else { left(i) });
            shadows.judge("s", &with, &without, &tolerances).unwrap().error
        };
        let ambient = error(&|_| 0.5);
        assert!((0.02..0.03).contains(&ambient), "{ambient}");
        // Another value in every pixel is no ambient term.
        let other = error(&|i| 0.5 + 2.0 * (i % 3) as f32);
        assert!(other > 0.1, "{other}");
        // All the same without any shadow: nothing was drawn.
        let flat = image(|_| 3.0);
        let none = shadows.judge("s", &flat, &flat, &tolerances).unwrap();
        assert_eq!(none.error, 1.0);
    }

    #[test]
    fn what_another_mistake_leaves_dark_does_not_mend_shadows() {
        let (mask, unshadowed) = masks();
        let shadows = Shadows { mask: &mask, unshadowed: &unshadowed, median_lit: 1.0 };
        let tolerances = Tolerances { spare_pixels: 0, ..Tolerances::default() };
        // Four of ten shadowed pixels are lit. Black ones hide two of these.
        let error = |black: usize| {
            let shown = |i: usize, light: f32| if (12..black).contains(&i) { 0.0 } else { light };
            let without = image(|i| shown(i, 1.0));
            let with =
                image(|i| shown(i, f32::from(u8::from(i < 10 || [12, 13, 18, 19].contains(&i)))));
            shadows.judge("s", &with, &without, &tolerances).unwrap().error
        };
        let (all, some) = (error(0), error(16));
        assert!((0.02..0.05).contains(&all) && all <= some && some < 0.05, "{all} {some}");
    }

    #[test]
    fn what_is_too_dark_leaves_the_verdict_to_another_scene() {
        let (mask, unshadowed) = masks();
        let shadows = Shadows { mask: &mask, unshadowed: &unshadowed, median_lit: 1.0 };
        let lit = image(|_| 1.0);
        let wrong = shadows.judge("teapot", &lit, &lit, &Tolerances::default()).unwrap();
        let dark = Check::new(CheckId::BonusImage, "cbox", Verdict::Fail, "black");
        let verdicts = |checks: &[Check]| {
            let mut checks = checks.to_vec();
            leave_unjudged(&mut checks, 0);
            checks.iter().map(|check| check.verdict).collect::<Vec<_>>()
        };
        assert_eq!(verdicts(&[wrong.clone(), dark.clone()]), [Verdict::Fail, Verdict::NotJudged]);
        let probe = Check { id: CheckId::BonusProbe.to_owned(), ..dark.clone() };
        assert_eq!(verdicts(&[wrong, probe.clone()]), [Verdict::Fail, Verdict::NotJudged]);
        let right = Check::new(CheckId::BonusImage, "teapot", Verdict::Pass, "");
        let no_map = Check {
            measures: vec![Measure::at_most(RuleId::ImageInterior, "pixels that differ", 0.0, 1.0)],
            ..probe
        };
        assert_eq!(verdicts(&[right, no_map]), [Verdict::Pass, Verdict::Fail]);
        assert_eq!(verdicts(&[dark.clone(), dark.clone()]), [Verdict::Fail, Verdict::Fail]);

        // A held-back scene, which comes later, leaves it to a public one, and not the other way round.
        let right = Check::new(CheckId::BonusProbe, "both_shadows", Verdict::Pass, "");
        let measures =
            vec![Measure::at_most(RuleId::ImageInterior, "pixels that differ", 1.0, 0.0)];
        let drawn_dark = Check { measures, ..dark.clone() };
        let mut public_is_right = [right.clone(), drawn_dark, dark.clone()];
        leave_unjudged(&mut public_is_right, 1);
        let verdicts = public_is_right.map(|check| check.verdict);
        assert_eq!(verdicts, [Verdict::Pass, Verdict::Pass, Verdict::Fail]);
        let mut public_is_dark = [dark, right];
        leave_unjudged(&mut public_is_dark, 1);
        assert_eq!(public_is_dark.map(|check| check.verdict), [Verdict::Fail, Verdict::Pass]);
    }

    #[test]
    fn shadows_where_none_belong_are_seen() {
        let (mask, unshadowed) = masks();
        let shadows = Shadows { mask: &mask, unshadowed: &unshadowed, median_lit: 1.0 };
        assert!(shadows.are_in(&image(|i| if i < 10 { 1.0 } else { 0.0 })));
        assert!(!shadows.are_in(&image(|_| 1.0)));
        let lit = shadows.lit_alone();
        let compared = |value: &&u16| **value & RegionMask::EMITTER == 0;
        assert_eq!(lit.pixels.iter().filter(compared).count(), 10);
    }
}
