//! The images in a hand-in: against what is expected, and against what its code draws.

use std::path::Path;

use basecode::Image;
use basecode::exr_io::read_exr;

use super::case::Case;
use super::offline::Drawn;
use crate::evidence::images::{self, Kind};
use crate::evidence::{Check, Verdict};
use crate::imaging::evidence::Tolerances;
use crate::imaging::reference::Region;

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
/// nothing when it does not build.
pub fn judge(root: &Path, case: &Case, drawn: &[Drawn], tolerances: &Tolerances) -> Vec<Check> {
    let Some(paths) = &case.entry.hand_in else { return Vec::new() };
    let name = &case.entry.name;
    let mut checks = Vec::new();
    let offline = Kind::Offline { spp: case.spp };
    for (path, kind, drawn_as, views) in [
        (&paths.offline, offline, offline, OFFLINE.as_slice()),
        (&paths.realtime, Kind::HandedInRealtime, Kind::Realtime, REALTIME.as_slice()),
    ] {
        let image = match read_exr(root.join(path)) {
            Ok(image) => image,
            Err(error) => {
                // The tree says what is missing; here it only cannot be judged.
                let summary = format!("{path}: {}", without_folder(&error.to_string(), root));
                for (id, _) in views {
                    checks.push(Check::new(id, name, Verdict::Fail, summary.clone()));
                }
                continue;
            }
        };
        for (id, wanted) in views {
            checks.push(images::judge(id, name, kind, &image, &case.expected, wanted, tolerances));
        }
        let own = drawn.iter().find(|drawn| drawn.scene == *name && drawn.kind == drawn_as);
        if let Some(own) = own {
            checks.push(judge_origin(path, case, kind, &image, &own.image, tolerances));
        }
    }
    checks
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
    let summary = format!("{path} is not what the code draws");
    Check::new(id, name, Verdict::Fail, summary)
        .with_hint("render it again with this code before handing in")
}

/// Hides where the private copy lies.
fn without_folder(message: &str, root: &Path) -> String {
    message.replace(&format!("{}/", root.display()), "")
}
