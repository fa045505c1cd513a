//! Panics of Umbra's own: each is caught where it can do no more harm, and reported with its place in the source.

use std::any::Any;
use std::fmt;
use std::panic::{AssertUnwindSafe, PanicHookInfo, catch_unwind};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};

/// Panics that nobody has asked for yet; a thread pool's are met in another thread than they happened in.
static MET: Mutex<Vec<Bug>> = Mutex::new(Vec::new());
/// Number of panics that are kept.
const KEPT: usize = 64;

/// A panic of Umbra's own.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Bug {
    /// What the panic said.
    pub message: String,
    /// `file:line:column` in Umbra's source; empty when it is not known.
    pub place: String,
}

impl fmt::Display for Bug {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(&self.message)?;
        if self.place.is_empty() { Ok(()) } else { write!(f, " (at {})", self.place) }
    }
}

impl std::error::Error for Bug {}

impl Bug {
    /// What kept `print!` from writing to standard output, if that is what panicked: no bug, but a full disk.
    pub fn unprintable(&self) -> Option<&str> {
        self.message.strip_prefix("failed printing to stdout: ")
    }
}

/// From now on panics are told on standard error in one line (with a backtrace when `RUST_BACKTRACE`
/// asks for it), and [`contain`] knows their places.
pub fn note() {
    std::panic::set_hook(Box::new(|info: &PanicHookInfo| {
        let place = info.location().map(ToString::to_string).unwrap_or_default();
        let bug = Bug { message: text(info.payload()), place };
        if bug.unprintable().is_some() {
            return;
        }
        eprintln!("umbra: internal error: {bug}");
        let trace = std::backtrace::Backtrace::capture();
        if trace.status() == std::backtrace::BacktraceStatus::Captured {
            eprintln!("{trace}");
        }
        let mut met = MET.lock().unwrap_or_else(PoisonError::into_inner);
        if met.len() < KEPT {
            met.push(bug);
        }
    }));
}

/// Runs `body`; a panic in it, or in a thread that it waits for, ends it alone.
///
/// # Errors
/// The panic. What `body` was changing may be half changed.
pub fn contain<T>(body: impl FnOnce() -> T) -> Result<T, Bug> {
    catch_unwind(AssertUnwindSafe(body)).map_err(|payload| {
        let message = text(&*payload);
        let mut met = MET.lock().unwrap_or_else(PoisonError::into_inner);
        let own = met.iter().position(|bug| bug.message == message);
        match own {
            Some(index) => met.swap_remove(index),
            None => Bug { message, place: String::new() },
        }
    })
}

/// What a panic said.
fn text(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
    text.unwrap_or_else(|| "a panic without words".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_ends_nothing_but_its_body_and_tells_where() {
        note();
        let index = std::hint::black_box(9);
        let bug = contain(|| [0u8; 3][index]).unwrap_err();
        assert_eq!(bug.message, "index out of bounds: the len is 3 but the index is 9");
        assert!(bug.place.contains("panics.rs:"), "{bug}");
        assert_eq!(contain(|| 5), Ok(5));
        // A pool's thread panics; who waits for it is told.
        let bug = contain(|| {
            rayon::join(|| std::hint::black_box(1), || panic!("in the pool: {}", 7));
        });
        let bug = bug.unwrap_err();
        assert_eq!(bug.message, "in the pool: 7");
        assert!(bug.place.contains("panics.rs:"), "{bug}");
    }
}
