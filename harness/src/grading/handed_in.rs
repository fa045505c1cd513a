//! The images in a hand-in: against what is expected, against what its code draws, and as evidence of
//! who drew them.

use std::path::Path;

use basecode::Image;
use basecode::exr_io::read_exr;

use super::case::Case;
use super::offline::Drawn;
use super::shared::ImageDigest;
use crate::evidence::handed_in::{has_own_noise, judge_copied, judge_noise, judge_scene};
use crate::evidence::images::{self, Kind};
use crate::evidence::{Check, Verdict};
use crate::imaging::evidence::Tolerances;
use crate::imaging::noise::NoisyPixels;
use crate::imaging::reference::Region;
use crate::intake::TreeSpec;

type View = (&'static str, &'static dyn Fn(&Region) -> bool);

const OFFLINE: [View; 5] = [
    ("handed_in.offline", &|_| true),
    ("handed_in.offline.diffuse", &|region| region.exponent == 0.0 && region.lit),
    ("handed_in.offline.phong", &|region| region.exponent > 0.0 && region.lit),
    ("handed_in.offline.lit", &|region| region.lit),
    ("handed_in.offline.shadowed", &|region| !region.lit),
];
const REALTIME: [View; 3] = [
    ("handed_in.realtime.all", &|_| true),
    ("handed_in.realtime.diffuse", &|region| region.exponent == 0.0),
    ("handed_in.realtime.phong", &|region| region.exponent > 0.0),
];

/// Judges the images of one scene below the root of a hand-in. `drawn` holds what its code drew,
/// nothing when it does not build. Answers the digests of the images that have noise of their own.
pub fn judge(
    root: &Path,
    tree: &TreeSpec,
    case: &Case,
    drawn: &[Drawn],
    tolerances: &Tolerances,
) -> (Vec<Check>, Vec<ImageDigest>) {
    let (mut checks, mut digests) = (Vec::new(), Vec::new());
    let Some(paths) = &case.entry.hand_in else { return (checks, digests) };
    let name = &case.entry.name;
    let offline = Kind::Offline { spp: case.spp };
    for (path, kind, drawn_as, views) in [
        (&paths.offline, offline, offline, OFFLINE.as_slice()),
        (&paths.realtime, Kind::HandedInRealtime, Kind::Realtime, REALTIME.as_slice()),
        // The code alone earns the bonus.
        (&paths.bonus, Kind::HandedInShadows, Kind::RealtimeShadows, &[]),
    ] {
        // The tree says what is missing; here there is nothing to judge.
        let Some(path) = tree.found_in(root, path) else { continue };
        let image = match read_exr(root.join(path)) {
            Ok(image) => image,
            Err(error) => {
                let summary = without_folder(&error.to_string(), root);
                for (id, _) in views {
                    checks.push(Check::new(id, name, Verdict::Fail, summary.clone()));
                }
                continue;
            }
        };
        let first = checks.len();
        for (id, wanted) in views {
            checks.push(images::judge(id, name, kind, &image, &case.expected, wanted, tolerances));
        }
        let right = checks.get(first).is_some_and(|check| check.verdict == Verdict::Pass);
        let own = drawn.iter().find(|drawn| drawn.scene == *name && drawn.kind == drawn_as);
        let origin = own.map(|own| judge_origin(path, case, kind, &image, &own.image, tolerances));
        let own = origin.as_ref().is_some_and(|check| check.verdict == Verdict::Pass);
        checks.extend(origin);
        let mask = match kind {
            Kind::HandedInRealtime => &case.expected.unshadowed_mask,
            _ => &case.expected.offline.mask,
        };
        checks.push(if right || own {
            let summary = format!("{path} is right, or what the code draws of the scene");
            Check::new("handed_in.scene", name, Verdict::Pass, summary)
        } else {
            let right = [&case.expected.offline.mean, &case.expected.unshadowed];
            judge_scene(name, path, &image, &right, mask)
        });
        // Realtime images have no noise: two right ones may be equal, and nothing is proved by it.
        if kind == offline {
            let reference = &case.expected.offline;
            let published = [
                ("the published mean of many samples", &reference.mean),
                ("the published image at pixel centres", &reference.centre),
                ("the published image without shadows", &case.expected.unshadowed),
            ];
            let noisy = NoisyPixels::new(reference);
            let noise = noisy.as_ref().and_then(|noisy| noisy.measure(&image));
            checks.push(judge_copied(name, path, &image, noisy.as_ref(), &published));
            checks.push(judge_noise(name, path, noise, case.spp));
            if has_own_noise(noise) {
                digests.push(ImageDigest::new(name, path, &image));
            }
        }
    }
    (checks, digests)
}

/// Whether an image that was handed in is what the code draws. A finding: it costs nothing.
fn judge_origin(
    path: &str,
    case: &Case,
    kind: Kind,
    handed_in: &Image,
    drawn: &Image,
    tolerances: &Tolerances,
) -> Check {
    let (id, name) = ("handed_in.origin", &case.entry.name);
    if images::same_origin(kind, handed_in, drawn, &case.expected, tolerances) {
        return Check::new(id, name, Verdict::Pass, format!("{path} is what the code draws"));
    }
    let summary = format!("{path} is not what the code draws: it is stale, or another renderer's");
    Check::new(id, name, Verdict::Fail, summary)
        .with_hint("it costs nothing; render it again with this code before handing in")
}

/// Hides where the private copy lies.
fn without_folder(message: &str, root: &Path) -> String {
    message.replace(&format!("{}/", root.display()), "")
}
