//! What is found out about the realtime frames of a scene.

use basecode::gpu::Footprint;

use super::offline::Drawn;
use crate::evidence::Check;

/// What the frames of a scene show.
pub struct Judged {
    /// What was found.
    pub checks: Vec<Check>,
    /// What was drawn.
    pub drawn: Vec<Drawn>,
    /// Whether the frame without shadows got no answer, by the submission's own fault.
    pub fails: bool,
    /// What that frame took, where it was drawn and the plugin says so.
    pub footprint: Option<Footprint>,
    /// How its brightness follows the light within a surface, where that shows.
    pub shading: Option<f64>,
}
