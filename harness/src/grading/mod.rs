//! The way of one submission through all stages, and of many.

mod attribution;
mod cache;
mod cache_key;
mod contain;
mod conventions;
mod costs;
mod diagnose;
mod draw;
mod image_digest;
mod isolate;
mod measure_reference;
pub mod mend;
mod observe;
mod offline;
mod pictures;
mod pipeline;
mod prepared_scene;
mod realtime;
mod record;
mod sampler;
mod session;
mod shared;
mod stages;
pub mod submitted;
mod uploads;

pub use cache::{Earlier, RecordCache};
pub use contain::INTERNAL_ERROR;
pub use costs::Cost;
pub use image_digest::ImageDigest;
pub use offline::Drawn;
pub use pipeline::{Grading, Mode, RenderPath, TREE};
pub use prepared_scene::{PreparedScene, ProbeFilm};
pub use record::{Conditions, Folders, Record, StageCost, Student};
pub use sampler::{CORRELATED, row_correlation};
pub use shared::judge_shared;
pub use stages::Stages;
