//! Refuses rays while a render pass exists: the pixels of a realtime frame come from its shaders.

use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::{Error, Result};

/// Passes that are being made or are open.
static OPEN: AtomicUsize = AtomicUsize::new(0);
/// Whether a ray was refused since the first of them began.
static REFUSED: AtomicBool = AtomicBool::new(false);

const MESSAGE: &str = "a render pass asked for a ray (Scene::intersect or Scene::occluded), and there are \
                       none in a realtime frame: its pixels come from the shaders";

/// The panic payload of a refused ray, since no caller could go on without an answer.
pub struct RayRefused;

/// The lifetime of one pass, from before it is made until it is closed.
pub struct Realtime(());

impl Realtime {
    /// From here on rays are refused, from every thread.
    pub fn begin() -> Self {
        if OPEN.fetch_add(1, Ordering::SeqCst) == 0 {
            REFUSED.store(false, Ordering::SeqCst);
        }
        Self(())
    }

    /// Whether no ray was refused so far, not even one whose panic was caught.
    ///
    /// # Errors
    /// [`RayRefused::error`] otherwise.
    pub fn without_rays(&self) -> Result<()> {
        if REFUSED.load(Ordering::SeqCst) { Err(RayRefused::error()) } else { Ok(()) }
    }
}

impl Drop for Realtime {
    fn drop(&mut self) {
        OPEN.fetch_sub(1, Ordering::SeqCst);
    }
}

impl RayRefused {
    /// The same as an error.
    pub fn error() -> Error {
        Error::Argument(MESSAGE.into())
    }
}

/// Call this before any work that only rays need.
///
/// # Panics
/// With [`RayRefused`] while a pass lives.
#[inline]
pub fn refuse_rays() {
    if OPEN.load(Ordering::Relaxed) > 0 {
        REFUSED.store(true, Ordering::SeqCst);
        std::panic::panic_any(RayRefused);
    }
}
