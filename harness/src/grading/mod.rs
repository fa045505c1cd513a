//! The way of one hand-in through all stages, and of many.

mod ask;
mod case;
mod contain;
mod control;
mod conventions;
mod costs;
mod draw;
pub mod handed_in;
mod isolate;
mod kept;
mod look;
pub mod mend;
mod offline;
mod pictures;
mod pipeline;
mod realtime;
mod record;
mod sampler;
mod seen;
mod shared;
mod stages;
mod uploads;

pub use case::{Case, Small};
pub use contain::INTERNAL_ERROR;
pub use costs::Cost;
pub use kept::{Earlier, Kept};
pub use offline::Drawn;
pub use pipeline::{Folders, Grading, Purpose, RenderPath, TREE};
pub use record::{Conditions, Record, StageCost, Student};
pub use sampler::{CORRELATED, row_correlation};
pub use shared::{ImageDigest, judge_shared};
pub use stages::Stages;
