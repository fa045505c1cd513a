//! The way of one hand-in through all stages, and of many.

mod ask;
mod case;
mod handed_in;
mod offline;
mod pictures;
mod pipeline;
mod realtime;
mod record;
mod sampler;

pub use case::Case;
pub use pipeline::{Grading, Purpose, TREE};
pub use realtime::Stages;
pub use record::{Conditions, Record, StageCost, Student};
