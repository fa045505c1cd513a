//! Umbra's own realtime pass, which draws a scene with given stage texts and no foreign code.

use super::job::Request;
use crate::plugin::{CallError, CallErrorKind};

/// Draws a [`Request::RenderRealtime`] into `values`, frame after frame.
///
/// # Errors
/// Always, for now. When it draws: [`CallErrorKind::NoAdapter`] without an adapter,
/// [`CallErrorKind::Failed`] for stages that the graphics library refuses.
pub fn render(request: &Request, values: &mut [f32]) -> Result<(), CallError> {
    let _ = (request, values);
    let message = "umbra's neutral render pass is not written yet".to_owned();
    Err(CallError { kind: CallErrorKind::Ours, message })
}
