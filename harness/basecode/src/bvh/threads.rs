//! Work on all cores, for what is done once per scene.

use std::sync::{Mutex, PoisonError};
use std::thread::{Builder, available_parallelism, scope};

/// How many threads may work at once.
pub fn available() -> usize {
    available_parallelism().map_or(1, usize::from)
}

/// Gives each task to one of up to `threads` threads. If the system refuses a thread, the others do its work.
///
/// These are not rayon's threads. Those wait for the hierarchy while it is built; one of them would start another row
/// in the meantime, and wait for the hierarchy there.
pub fn share<T: Send>(tasks: Vec<T>, threads: usize, work: impl Fn(T) + Sync) {
    let helpers = threads.min(tasks.len()).saturating_sub(1);
    let tasks = Mutex::new(tasks);
    let next = || tasks.lock().unwrap_or_else(PoisonError::into_inner).pop();
    let run = || {
        while let Some(task) = next() {
            work(task);
        }
    };
    scope(|scope| {
        for _ in 0..helpers {
            let _ = Builder::new().spawn_scoped(scope, run);
        }
        run();
    });
}
