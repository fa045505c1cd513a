//! Umbra grades renderers: this library holds every stage, `main.rs` only calls it.

pub mod build;
pub mod plugin;
pub mod process;
pub mod worker;
