//! The evidence about a submission: pure functions from values to checks.
//!
//! Nothing here depends on processes, GPUs or libraries.

pub mod answers;
pub mod bsdf;
pub mod changed_scene;
pub mod changes;
mod check;
pub mod convention;
pub mod expected;
mod film_slips;
pub mod frame_slips;
pub mod images;
mod light_levels;
mod lobe;
pub mod loops;
pub mod physical;
pub mod pixels;
pub mod premultiplied;
pub mod price;
pub mod rays;
mod registry;
pub mod shading;
pub mod shadow_map;
pub mod stage_film;
pub mod stages;
pub mod submitted;
pub mod varyings;
pub mod vertex;
mod witness;

pub use check::{Check, Evidence, Lobe, Measure, Picture, Verdict};
pub use registry::{CheckId, CheckInfo, CheckSources, IMAGE_RULES, RuleId};
pub use witness::{Witness, WitnessQuery};
