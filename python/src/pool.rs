//! Threads that share the work of one call.
//!
//! Deliberately does not know: what the work is.

use std::sync::{Arc, Mutex, PoisonError};

use hamel_run::Error;
use rayon::ThreadPool;

/// The threads of this process, as many as there are cores.
///
/// A process that `os.fork` has made has none of its parent's threads, and gets its own.
///
/// # Errors
/// When the system refuses threads.
pub(crate) fn of_process() -> Result<Arc<ThreadPool>, Error> {
    static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);
    let mut kept = POOL.lock().unwrap_or_else(PoisonError::into_inner);
    let process = std::process::id();
    if let Some((of, pool)) = &*kept
        && *of == process
    {
        return Ok(Arc::clone(pool));
    }
    let pool = Arc::new(hamel_run::ensemble::pool(None)?);
    // Ending the threads of the parent would wait for them for ever.
    std::mem::forget(kept.replace((process, Arc::clone(&pool))));
    Ok(pool)
}
