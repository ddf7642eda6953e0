//! Independent work on all cores, and work on a thread of its own.
//!
//! Does not know: what the work is.

use std::panic::resume_unwind;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Does work with tokens on a thread of its own.
///
/// `proc_macro2` keeps every text that it has lexed for the life of the thread, for the sake of its spans. An editor
/// lexes a text after every key, and spans of whoever uses this crate have to stay valid: so the thread ends, not they.
pub fn with_own_tokens<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let mut work = Some(work);
    let done = std::thread::scope(|scope| {
        let own = || work.take().map(|work| work());
        let thread = std::thread::Builder::new().spawn_scoped(scope, own).ok()?;
        thread.join().unwrap_or_else(|panic| resume_unwind(panic))
    });
    match (done, work) {
        (Some(done), _) => done,
        // WebAssembly has no threads; its programs end after one command.
        (None, Some(work)) => work(),
        (None, None) => unreachable!("work that was not done is still there"),
    }
}

/// Does independent work on all cores; the results are in the order of `items`.
pub fn side_by_side<T: Sync, U: Send>(items: &[T], work: impl Fn(&T) -> U + Sync) -> Vec<U> {
    let n_workers = std::thread::available_parallelism().map_or(1, usize::from).min(items.len());
    if n_workers < 2 {
        // Nothing is gained by a thread, and WebAssembly has none.
        return items.iter().map(work).collect();
    }
    let next = AtomicUsize::new(0);
    let done: Mutex<Vec<(usize, U)>> = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..n_workers {
            scope.spawn(|| {
                while let Some((at, item)) = {
                    let at = next.fetch_add(1, Ordering::Relaxed);
                    items.get(at).map(|item| (at, item))
                } {
                    let result = work(item);
                    done.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push((at, result));
                }
            });
        }
    });
    let mut done = done.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner);
    done.sort_by_key(|(at, _)| *at);
    done.into_iter().map(|(_, result)| result).collect()
}
