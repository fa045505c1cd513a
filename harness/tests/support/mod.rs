//! Archives made byte by byte, able to lie in every field; and a scratch place that shows whether
//! anything was written where it should not be.

// Each test file uses its part.
#![allow(dead_code)]

pub mod scratch;
pub mod tar_bytes;
pub mod zip_bytes;
