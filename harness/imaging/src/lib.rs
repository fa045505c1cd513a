//! Images: the comparison that decides, the error metrics that only inform, and the pictures that explain.
//!
//! Everything here is a pure function of images in memory. *Actual* is what a renderer drew, *expected* what the
//! reference says, and every place is (column, row) with row 0 on top.

pub mod blob;
pub mod compare;
pub mod comparison;
pub mod correlation;
pub mod difference;
pub mod error_map;
pub mod flip;
pub mod halves;
pub mod likeness;
pub mod metrics;
pub mod noise;
pub mod origin;
pub mod packing;
pub mod pictures;
pub mod ratio;
pub mod reference;
pub mod rows;
pub mod srgb;
mod stats;
pub mod thresholds;
pub mod tolerances;
