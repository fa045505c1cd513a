//! Work that is done side by side.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::Result;

/// Does `work` on every item and its index, `jobs` at a time, and returns the results in the items' order.
///
/// # Errors
/// The first error that came; nothing is begun after it.
pub fn each<T: Sync, R: Send>(
    items: &[T],
    jobs: usize,
    work: impl Fn(usize, &T) -> Result<R> + Sync,
) -> Result<Vec<R>> {
    let next = AtomicUsize::new(0);
    let done: Mutex<Result<Vec<(usize, R)>>> = Mutex::new(Ok(Vec::new()));
    let worker = || {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(index) else { return };
            let result = work(index, item);
            let Ok(mut done) = done.lock() else { return };
            match (result, done.as_mut()) {
                (Ok(result), Ok(results)) => results.push((index, result)),
                (Err(error), Ok(_)) => *done = Err(error),
                (_, Err(_)) => return,
            }
        }
    };
    std::thread::scope(|scope| {
        for _ in 0..jobs.min(items.len()) {
            scope.spawn(worker);
        }
    });
    let mut results = done.into_inner().unwrap_or_else(|_| Ok(Vec::new()))?;
    results.sort_by_key(|(index, _)| *index);
    Ok(results.into_iter().map(|(_, result)| result).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_come_in_order_and_an_error_ends_it() {
        let items: Vec<u32> = (0..100).collect();
        let squares = each(&items, 3, |index, item| Ok(index as u32 * item)).expect("no error");
        assert_eq!(squares, items.iter().map(|i| i * i).collect::<Vec<_>>());
        let begun = AtomicUsize::new(0);
        let failed = each(&items, 1, |_, item| {
            begun.fetch_add(1, Ordering::Relaxed);
            anyhow::ensure!(*item < 5, "five");
            Ok(())
        });
        assert_eq!(failed.expect_err("an error").to_string(), "five");
        assert!(begun.into_inner() <= 7, "work goes on after an error");
        assert!(each(&[0u8; 0], 2, |_, _| Ok(())).expect("no error").is_empty());
    }
}
