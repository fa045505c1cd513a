//! Umbra grades renderers. `docs/` and ARCHITECTURE.md tell how; the `umbra` binary is its face.
//!
//! Data flows one way: `intake` -> `build` -> `worker` -> `evidence` -> `rubric` -> `report`.

pub mod assignment;
pub mod build;
pub mod class;
pub mod cli;
pub mod decode;
pub mod diagnosis;
pub mod evidence;
pub mod expected;
pub mod files;
pub mod grading;
pub mod held_back;
pub mod imaging;
pub mod intake;
pub mod panics;
pub mod plugin;
pub mod process;
pub mod report;
pub mod rubric;
pub mod sandbox;
pub mod worker;
