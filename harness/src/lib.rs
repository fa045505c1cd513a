//! Umbra grades renderers. `docs/` and ARCHITECTURE.md tell how; the `umbra` binary is its face.
//!
//! Data flows one way: `intake` -> `build` -> `worker` -> `evidence` -> `rubric` -> `report`.

pub mod evidence;
pub mod rubric;
pub mod sandbox;
