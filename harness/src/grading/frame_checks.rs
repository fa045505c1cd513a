//! What both frames of a scene, with and without shadows, are judged by.

use basecode::Image;

use super::offline::Drawn;
use super::prepared_scene::PreparedScene;
use super::session::{self, Session};
use crate::evidence::images::{self, ImageKind};
use crate::evidence::shadow_map::Shadows;
use crate::evidence::{Check, CheckId};
use crate::expected::Expected;
use crate::imaging::reference::Region;
use crate::imaging::tolerances::Tolerances;
use crate::worker::Outcome;

/// A check of those regions of an image that are wanted.
pub type RegionCheck = (CheckId, &'static dyn Fn(&Region) -> bool);

/// Judges regions of a scene's image.
pub fn judge_regions(
    case: &PreparedScene,
    kind: ImageKind,
    image: &Image,
    (id, wanted): RegionCheck,
    tolerances: &Tolerances,
) -> Check {
    images::judge(id, &case.entry.name, kind, image, &case.expected, wanted, tolerances)
}

/// An outcome as an image, or else the check that says why there is none.
pub fn drawn(
    session: &Session,
    case: &PreparedScene,
    kind: ImageKind,
    id: CheckId,
    outcome: &Outcome,
) -> Result<Drawn, Box<Check>> {
    let parts = ["2.1", "2.2", "2.3", "2.4", "2.5"];
    let scene = &case.entry.name;
    let Outcome::Done(answer) = outcome else {
        if let Outcome::Failed(said) = outcome {
            session.keep_compiler_message(case.held_back, said);
        }
        return Err(Box::new(session::unanswered(id, scene, &parts, outcome)));
    };
    let (width, height) = case.film();
    let image = session::image(&answer.values, width, height);
    Ok(Drawn { scene: scene.clone(), kind, image })
}

/// The masks that tell where shadows fall.
pub fn shadows(case: &PreparedScene) -> Shadows<'_> {
    let Expected { offline, unshadowed_mask, .. } = &case.expected;
    Shadows { mask: &offline.mask, unshadowed: unshadowed_mask, median_lit: offline.median_lit }
}
