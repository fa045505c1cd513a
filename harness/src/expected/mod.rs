//! What a right renderer draws: references, and the geometry that tells where they can be trusted.

mod regions;
mod store;
mod surface;

pub use regions::regions;
pub(crate) use store::scene_digest;
pub use store::{Blessing, Expected, Store, load_scene, reference_library};
pub use surface::{FARTHEST_START, SurfaceBuffer, SurfacePoint, Visibility};
