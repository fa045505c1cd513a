//! The way of one hand-in through all stages, and of many.

mod record;

pub use record::{Conditions, Record, StageCost, Student};
