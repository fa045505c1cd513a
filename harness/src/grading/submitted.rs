//! The images in a submission: against what is expected, against what its code draws, and as evidence of
//! who drew them.

use std::path::Path;

use basecode::Image;

use super::image_digest::ImageDigest;
use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use crate::decode::{Decoder, image_finding};
use crate::evidence::images::{self, ImageKind};
use crate::evidence::submitted::{
    has_own_noise, judge_copied, judge_noise, judge_scene, judge_seed,
};
use crate::evidence::{Check, CheckId, Verdict};
use crate::imaging::noise::NoisyPixels;
use crate::imaging::reference::Region;
use crate::imaging::tolerances::Tolerances;
use crate::intake::{Finding, TreeSpec};
use crate::worker::Request;

type RegionCheck = (CheckId, fn(&Region) -> bool);

const OFFLINE: [RegionCheck; 5] = [
    (CheckId::SubmittedOffline, |_| true),
    (CheckId::SubmittedOfflineDiffuse, |region| region.exponent == 0.0 && region.lit),
    (CheckId::SubmittedOfflinePhong, |region| region.exponent > 0.0 && region.lit),
    (CheckId::SubmittedOfflineLit, |region| region.lit),
    (CheckId::SubmittedOfflineShadowed, |region| !region.lit),
];
const REALTIME: [RegionCheck; 3] = [
    (CheckId::SubmittedRealtimeAll, |_| true),
    (CheckId::SubmittedRealtimeDiffuse, |region| region.exponent == 0.0),
    (CheckId::SubmittedRealtimePhong, |region| region.exponent > 0.0),
];

/// An image in a submission.
pub struct SubmittedImage<'a> {
    case: &'a PreparedScene,
    /// Its path in the submission.
    path: String,
    kind: ImageKind,
    /// Its pixels, or why there are none.
    image: Result<Image, String>,
}

impl<'a> SubmittedImage<'a> {
    /// An image of a scene, with its path in the submission, or why there are no pixels.
    pub fn new(
        case: &'a PreparedScene,
        path: &str,
        kind: ImageKind,
        image: Result<Image, String>,
    ) -> Self {
        Self { case, path: path.to_owned(), kind, image }
    }

    /// What is to be said of it when it was not decoded.
    pub fn finding(&self, root: &Path) -> Option<Finding> {
        image_finding(root, &self.path, &self.image)
    }

    /// The image and how it came about, when it is the one that a check of this id is about.
    pub fn shown_by(&self, check: &Check) -> Option<(ImageKind, &Image)> {
        let first = views(self.kind).first().is_some_and(|(id, _)| *id == check.id);
        let own = first && self.case.entry.name == check.scene;
        own.then_some((self.kind, self.image.as_ref().ok()?))
    }
}

/// What is judged of an image by itself. The code alone earns the bonus.
fn views(kind: ImageKind) -> &'static [RegionCheck] {
    match kind {
        ImageKind::Offline { .. } => &OFFLINE,
        ImageKind::SubmittedRealtime => &REALTIME,
        _ => &[],
    }
}

/// Decodes all images below the root of a submission. The tree says what is missing; here there is
/// nothing to judge.
///
/// # Errors
/// The machine's matters and Ctrl-C.
pub fn read<'a>(
    decoder: &Decoder,
    root: &Path,
    tree: &TreeSpec,
    cases: &'a [PreparedScene],
) -> anyhow::Result<Vec<SubmittedImage<'a>>> {
    let mut found = Vec::new();
    for case in cases {
        let Some(paths) = &case.entry.submitted else { continue };
        for (path, kind) in [
            (&paths.offline, ImageKind::Offline { spp: case.spp }),
            (&paths.realtime, ImageKind::SubmittedRealtime),
            (&paths.bonus, ImageKind::SubmittedShadows),
        ] {
            if let Some(path) = tree.found_in(root, path) {
                let image = decoder.image(&root.join(path), path)?;
                found.push(SubmittedImage::new(case, path, kind, image));
            }
        }
    }
    Ok(found)
}

/// Judges an image. `drawn` holds what the submission's code drew, nothing when it does not build; `right`
/// names the scenes whose offline images it draws right, perhaps on a small film alone. Answers its digest
/// when it has noise of its own.
pub fn judge(
    submitted: &SubmittedImage,
    drawn: &[Drawn],
    right: &[String],
    tolerances: &Tolerances,
) -> (Vec<Check>, Option<ImageDigest>) {
    let SubmittedImage { case, path, kind, image } = submitted;
    let (name, kind, expected) = (&case.entry.name, *kind, &case.expected);
    let mut checks = Vec::new();
    let image = match image {
        Ok(image) => image,
        Err(error) => {
            let failed =
                |(id, _): &RegionCheck| Check::new(*id, name, Verdict::Fail, error.clone());
            return (views(kind).iter().map(failed).collect(), None);
        }
    };
    for (id, wanted) in views(kind) {
        checks.push(images::judge(*id, name, kind, image, expected, wanted, tolerances));
    }
    let is_right = checks.first().is_some_and(|check| check.verdict == Verdict::Pass);
    let drawn_as = match kind {
        ImageKind::SubmittedRealtime => ImageKind::Realtime,
        ImageKind::SubmittedShadows => ImageKind::RealtimeShadows,
        offline => offline,
    };
    let own = drawn.iter().find(|drawn| drawn.scene == *name && drawn.kind == drawn_as);
    let same = match own {
        Some(own) => Some(images::same_origin(kind, image, &own.image, expected, tolerances)),
        // What the code draws is right: so is the image, or it is another.
        None if matches!(kind, ImageKind::Offline { .. }) && right.contains(name) => Some(is_right),
        None => None,
    };
    let origin = same.map(|same| judge_origin(path, name, same));
    let own = origin.as_ref().is_some_and(|check| check.verdict == Verdict::Pass);
    checks.extend(origin);
    let mask = match kind {
        ImageKind::SubmittedRealtime => &expected.unshadowed_mask,
        _ => &expected.offline.mask,
    };
    checks.push(if is_right || own {
        let summary = format!("{path} is right, or what the code draws of the scene");
        Check::new(CheckId::SubmittedScene, name, Verdict::Pass, summary)
    } else {
        judge_scene(name, path, image, &[&expected.offline.mean, &expected.unshadowed], mask)
    });
    // Realtime images have no noise: two right ones may be equal, and nothing is proved by it.
    if !matches!(kind, ImageKind::Offline { .. }) {
        return (checks, None);
    }
    let reference = &expected.offline;
    let published = [
        ("the published mean of many samples", &reference.mean),
        ("the published image at pixel centers", &reference.center),
        ("the published image without shadows", &expected.unshadowed),
    ];
    let noisy = NoisyPixels::new(reference);
    let noise = noisy.as_ref().and_then(|noisy| noisy.measure(image));
    checks.push(judge_copied(name, path, image, noisy.as_ref(), &published));
    checks.push(judge_noise(name, path, noise, case.spp));
    (checks, has_own_noise(noise).then(|| ImageDigest::new(name, path, image)))
}

/// Whether offline images have the noise that the student's number predicts: what the reference draws with
/// that seed, in the order of the base code. Asked only where images are all there is.
pub fn judge_seeds(
    session: &Session,
    reference: &Path,
    submitted: &[SubmittedImage],
    seed: u64,
) -> Vec<Check> {
    let mut checks = Vec::new();
    for SubmittedImage { case, path, kind, image } in submitted {
        let (ImageKind::Offline { spp }, Ok(image)) = (kind, image) else { continue };
        let noisy = NoisyPixels::new(&case.expected.offline);
        let noise = noisy.as_ref().and_then(|noisy| noisy.measure(image));
        let (Some(noisy), true) = (noisy, has_own_noise(noise)) else { continue };
        let (width, height) = case.film();
        let request = Request::RenderOffline {
            scene: session.scene(&case.offline),
            width,
            height,
            spp: *spp,
            seed,
            threads: session.limits.threads,
            shadows: true,
        };
        let outcomes = session.run(Some(reference), vec![request]);
        let drawn = outcomes.first().and_then(|outcome| outcome.answer());
        let drawn = drawn.map(|answer| session::image(&answer.values, width, height));
        let alike = drawn.and_then(|drawn| noisy.correlation(image, &drawn));
        checks.push(judge_seed(&case.entry.name, path, alike));
    }
    checks
}

/// Whether an image that was submitted is what the code draws. A finding: it costs nothing.
fn judge_origin(path: &str, scene: &str, same: bool) -> Check {
    let id = CheckId::SubmittedOrigin;
    if same {
        return Check::new(id, scene, Verdict::Pass, format!("{path} is what the code draws"));
    }
    let summary = format!("{path} is not what the code draws: it is stale, or another renderer's");
    Check::new(id, scene, Verdict::Fail, summary)
        .with_hint("it costs nothing; render it again with this code before you submit it")
}
