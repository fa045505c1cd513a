//! Work on all cores, for what is done once per scene.

use std::sync::{Mutex, PoisonError};
use std::thread::{Builder, available_parallelism, scope};

/// How many threads may work at once.
pub fn available() -> usize {
    available_parallelism().map_or(1, usize::from)
}

/// Gives each task to one of up to `threads` threads. A thread that the system refuses is done without.
///
/// They are not rayon's: a hierarchy is built while rayon's threads wait for it, and one of them would take up another
/// row in the meantime, and wait for the hierarchy there.
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
