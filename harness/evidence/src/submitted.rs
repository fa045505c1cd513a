//! The images in a submission as evidence of who drew them, and from what.

use basecode::Image;

use super::{Check, CheckId, Measure, Verdict};
use imaging::likeness::{Likeness, likeness};
use imaging::noise::{Noise, NoisyPixels};
use imaging::reference::RegionMask;

/// An image is noisier, or less noisy, than its scene asks for when it looks like this many times
/// fewer, or more, samples. The statistic itself knows them to 3 % on the films of the assignment.
const OFF: f64 = 1.5;
/// Or when it is so many standard errors off, if that is more.
const STANDARD_ERRORS: f64 = 5.0;
/// From this many times the scene's samples on, an image is converged. A good sampler (stratified)
/// makes 16 samples look like 60.
const CONVERGED: f64 = 8.0;
/// What looks like noise may be wrong edges where more than this fraction of all other pixels is wrong.
const RIGHT: f64 = 5e-4;
/// An image that looks like fewer samples than this has no noise of its own. Right renderers agree where they draw one
/// sample in the middle of each pixel. An image rounded to the nearer side of each edge has half the variance of
/// chance, so it looks like two samples.
const OWN_NOISE: f64 = 3.0;
/// From this correlation on two images have one noise. Other seeds stay below 0.3 on a film a tenth as large
/// as the assignment's; rounding to 8 bits leaves more than 0.9.
const SAME_NOISE: f64 = 0.5;
/// A picture below both likenesses shows something else: images of another scene reach 0.16 and
/// 0.06 (240 wrong ones: 0.4 and 0.19), wrong images of the scene itself lie above one of them nearly always.
const UNLIKE: Likeness = Likeness { brightness: 0.25, edges: 0.1 };

/// Whether an offline image has the noise of the scene's `spp` samples per pixel; `noise` is what was
/// measured, if it could be.
pub fn judge_noise(scene: &str, path: &str, noise: Option<Noise>, spp: u32) -> Check {
    let check =
        |verdict, summary: String| Check::new(CheckId::SubmittedNoise, scene, verdict, summary);
    let Some(noise) = noise.filter(|_| spp > 1) else {
        return check(
            Verdict::NotJudged,
            format!("{path}: too few of its noisy pixels are right to tell its noise"),
        );
    };
    let ratio = noise.spp / f64::from(spp);
    let off = OFF.max(1.0 + STANDARD_ERRORS * noise.relative_error);
    let measures = vec![
        Measure::at_most(None, "samples per pixel that it looks like over the scene's", ratio, off),
        Measure::at_most(None, "the scene's over those", 1.0 / ratio, off),
    ];
    let looks = match noise.spp {
        spp if spp >= 1e4 => "no noise at all".to_owned(),
        spp if spp >= 10.0 => format!("the noise of {spp:.0} samples per pixel"),
        spp => format!("the noise of {spp:.1} samples per pixel"),
    };
    let said = format!("{path} has {looks}, its scene asks for {spp}");
    let found = if ratio > CONVERGED {
        let hint = "a converged image or a copy of one: an instructor decides";
        check(Verdict::Fail, said).with_hint(hint)
    } else if ratio > off {
        let hint =
            "render it with the scene's samples per pixel; a stratified sampler looks so too";
        // It costs little: only what is converged shows nothing of who drew it.
        Check { error: 0.0, ..check(Verdict::Fail, said).with_hint(hint) }
    } else if 1.0 / ratio <= off {
        check(Verdict::Pass, said)
    } else if noise.wrong <= RIGHT {
        let hint = "render it with the scene's samples per pixel";
        Check { error: 0.0, ..check(Verdict::Fail, said).with_hint(hint) }
    } else {
        check(Verdict::NotJudged, format!("{path} is wrong: its noise cannot be told from that"))
    };
    Check { measures, ..found }
}

/// Whether an image has the noise that the student's number predicts; `alike` is its correlation with
/// what a right renderer draws with that seed, in the order of the base code. Seeding by row is only advice
/// and a sampler may be used in any order, so that another noise is no fault.
pub fn judge_seed(scene: &str, path: &str, alike: Option<f64>) -> Check {
    let check =
        |verdict, summary: String| Check::new(CheckId::SubmittedSeed, scene, verdict, summary);
    let Some(alike) = alike else {
        let why = "too few of its noisy pixels are right to compare its noise";
        return check(Verdict::NotJudged, format!("{path}: {why}"));
    };
    let name = "1 - correlation with the noise that the student's number predicts";
    let measures = vec![Measure::at_most(None, name, 1.0 - alike, 1.0 - SAME_NOISE)];
    let found = if alike >= SAME_NOISE {
        let said = "has the noise that the base code draws with the student's number";
        check(Verdict::Pass, format!("{path} {said}"))
    } else {
        let said = "has another noise than the base code draws with the student's number, which costs nothing";
        check(Verdict::NotJudged, format!("{path} {said}"))
    };
    Check { measures, ..found }
}

/// Whether an image has noise by which it can be told from anybody else's.
pub fn has_own_noise(noise: Option<Noise>) -> bool {
    noise.is_some_and(|noise| noise.spp >= OWN_NOISE)
}

/// Whether an offline image is one of the published ones (each with its name), as it is or rounded.
pub fn judge_copied(
    scene: &str,
    path: &str,
    image: &Image,
    noisy: Option<&NoisyPixels>,
    published: &[(&str, &Image)],
) -> Check {
    let check =
        |verdict, summary: String| Check::new(CheckId::SubmittedCopied, scene, verdict, summary);
    let Some(noisy) = noisy else {
        return check(Verdict::NotJudged, format!("{path}: the scene has too few noisy pixels"));
    };
    match published.iter().find(|(_, own)| noisy.same_draw(image, own)) {
        Some((name, _)) => check(
            Verdict::Fail,
            format!("{path} equals {name}, which shows nothing of who drew it"),
        )
        .with_hint("an instructor decides; one's own image has the noise of one's own seed"),
        None => check(Verdict::Pass, format!("{path} is none of the published images")),
    }
}

/// Whether a picture shows the scene at all, as some of the `right` images do; `mask` tells its
/// emitters.
pub fn judge_scene(
    scene: &str,
    path: &str,
    image: &Image,
    right: &[&Image],
    mask: &RegionMask,
) -> Check {
    let check =
        |verdict, summary: String| Check::new(CheckId::SubmittedScene, scene, verdict, summary);
    let found = likeness(image, right, mask);
    let unlike = |name: &str, found: f64, least: f64| {
        let name = format!("1 - correlation of {name} (one of the two must be within its bound)");
        Measure::at_most(None, name, 1.0 - found, 1.0 - least)
    };
    let measures = vec![
        unlike("brightness", found.brightness, UNLIKE.brightness),
        unlike("edges", found.edges, UNLIKE.edges),
    ];
    let like = measures.iter().any(|measure| measure.passed);
    let judged = if like {
        check(Verdict::Pass, format!("{path} shows the scene"))
    } else if image.pixels.iter().all(|p| *p == image.pixels[0]) {
        check(Verdict::Fail, format!("{path} has one color all over"))
    } else {
        check(Verdict::Fail, format!("{path} shows something else than the scene"))
    };
    let hint = if like { "" } else { "the file of another scene? Render it again" };
    Check { measures, ..judged.with_hint(hint) }
}
