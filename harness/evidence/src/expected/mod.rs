//! Expected results: the images that a right renderer draws of a scene, and the geometry that tells where they can be
//! trusted. The grader's `store` provides the images.

mod regions;
mod scene_file;
mod surface;

use basecode::{Image, Scene};

use imaging::reference::{ReferenceImage, RegionMask};

pub use regions::{regions, regions_seen_by, table as region_table};
pub use scene_file::load_scene;
pub use surface::{FARTHEST_START, SurfaceBuffer, SurfacePoint, Visibility};

/// What a right renderer draws of one scene, on one film.
pub struct Expected {
    /// The scene as the base code loads it, without BSDFs.
    pub scene: Scene,
    /// Offline, with shadows.
    pub offline: ReferenceImage,
    /// At pixel centers, without shadows: what realtime draws.
    pub unshadowed: Image,
    /// The regions of `unshadowed`.
    pub unshadowed_mask: RegionMask,
    /// As `unshadowed`, by stages that do not renormalize the interpolated normal: as good. Absent
    /// where it was neither kept nor can be drawn.
    pub interpolated_normals: Option<Image>,
}
