//! What a right renderer draws: references, and the geometry that tells where they can be trusted.

mod regions;
mod surface;

pub use regions::regions;
pub use surface::{Sight, SurfaceBuffer, SurfacePoint};
