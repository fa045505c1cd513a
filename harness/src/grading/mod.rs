//! The way of one submission through all stages, and of many.

mod attribution;
mod cache;
mod contain;
mod conventions;
mod costs;
mod diagnose;
mod draw;
mod isolate;
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
pub use offline::Drawn;
pub use pipeline::{Folders, Grading, Mode, RenderPath, TREE};
pub use prepared_scene::{PreparedScene, ProbeFilm};
pub use record::{Conditions, Record, StageCost, Student};
pub use sampler::{CORRELATED, row_correlation};
pub use shared::{ImageDigest, judge_shared};
pub use stages::Stages;
