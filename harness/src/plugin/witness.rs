//! A witness BSDF as a plugin's integrator calls it.

use std::ffi::c_void;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use renderer_api as api;

use crate::evidence::{Witness, WitnessQuery};

/// A witness in use, with what was seen of its calls.
#[derive(Debug)]
pub struct WitnessState {
    witness: Witness,
    calls: AtomicU64,
    /// Bits of the largest | |w| - 1 |: non-negative floats are ordered as their bits are.
    worst: AtomicU32,
}

impl WitnessState {
    /// A witness that was not called yet.
    pub fn new(witness: Witness) -> Self {
        Self { witness, calls: AtomicU64::new(0), worst: AtomicU32::new(0) }
    }

    /// How often it was called.
    pub fn calls(&self) -> u64 {
        self.calls.load(Ordering::Relaxed)
    }

    /// The largest | |w| - 1 | of all directions so far; infinite when one was not finite.
    pub fn worst_norm_error(&self) -> f32 {
        f32::from_bits(self.worst.load(Ordering::Relaxed))
    }

    /// The callback for the plugin; it borrows this state, which must outlive its use.
    pub(super) fn table(&self) -> api::WitnessBsdf {
        api::WitnessBsdf { user: std::ptr::from_ref(self).cast_mut().cast(), eval: Some(eval) }
    }

    fn eval(&self, query: &WitnessQuery) -> [f32; 3] {
        self.calls.fetch_add(1, Ordering::Relaxed);
        self.worst.fetch_max(query.norm_error().to_bits(), Ordering::Relaxed);
        self.witness.value(query).unwrap_or_default()
    }
}

unsafe extern "C" fn eval(user: *mut c_void, query: *const api::WitnessQuery, value: *mut f32) {
    // SAFETY: `user` is the state that `LoadedScene::radiance` keeps alive during the call; the
    // plugin promises a valid query and room for three floats.
    unsafe {
        let state = &*user.cast::<WitnessState>();
        let query = &*query;
        let seen = WitnessQuery { wi: query.wi, wo: query.wo };
        value.cast::<[f32; 3]>().write_unaligned(state.eval(&seen));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: [f32; 3] = [0.0, 0.0, 1.0];

    #[test]
    fn calls_and_lengths_are_recorded() {
        let state = WitnessState::new(Witness::OfWi);
        state.eval(&WitnessQuery { wi: UP, wo: UP });
        assert_eq!((state.calls(), state.worst_norm_error()), (1, 0.0));
        state.eval(&WitnessQuery { wi: [0.0, 0.0, 3.0], wo: UP });
        state.eval(&WitnessQuery { wi: UP, wo: [0.0, 0.0, 0.5] });
        assert_eq!((state.calls(), state.worst_norm_error()), (3, 2.0));
        state.eval(&WitnessQuery { wi: [f32::NAN; 3], wo: UP });
        assert_eq!(state.worst_norm_error(), f32::INFINITY);
    }
}
