//! Umbra grades renderers.

pub mod intake;
