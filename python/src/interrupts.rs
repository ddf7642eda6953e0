//! Interrupts of the keyboard while Python is not held.
//!
//! Deliberately does not know: what is interrupted.

use std::ops::ControlFlow;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use hamel_run::ensemble::Cancel;
use hamel_run::error::Error;
use pyo3::prelude::*;

use crate::errors::OrRaise as _;

/// How long an interrupt waits at most, beyond one step.
const PATIENCE: Duration = Duration::from_millis(50);

/// Does work on a thread of its own, and calls it off once a handler of Python has raised.
///
/// # Errors
/// What was raised, or else the error of the work.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    cancel: &Cancel,
    work: impl FnOnce() -> Result<T, Error> + Send,
) -> PyResult<T> {
    let mut interrupts = Interrupts::new();
    let done = py.detach(|| {
        std::thread::scope(|scope| {
            let (to_here, done) = channel();
            // Nobody listens only where this thread has failed.
            scope.spawn(move || _ = to_here.send(work()));
            loop {
                match done.recv_timeout(PATIENCE) {
                    Ok(result) => return Some(result),
                    Err(RecvTimeoutError::Timeout) if interrupts.raised.is_some() => {}
                    Err(RecvTimeoutError::Timeout) => {
                        if interrupts.look().is_break() {
                            cancel.call_off();
                        }
                    }
                    // The work has failed, and so does the scope.
                    Err(RecvTimeoutError::Disconnected) => return None,
                }
            }
        })
    });
    interrupts.raised()?;
    let done = done.unwrap_or_else(|| Err(Error::Options { reason: "the ensemble was called off".into() }));
    done.or_raise(py)
}

/// Looks for signals now and then.
pub(crate) struct Interrupts {
    next: Instant,
    raised: Option<PyErr>,
}

impl Interrupts {
    /// Looks from now on.
    pub(crate) fn new() -> Interrupts {
        Interrupts { next: Instant::now() + PATIENCE, raised: None }
    }

    /// Breaks once a handler of Python has raised, as that of an interrupt does.
    pub(crate) fn look(&mut self) -> ControlFlow<()> {
        if Instant::now() < self.next {
            return ControlFlow::Continue(());
        }
        self.raised = Python::attach(|py| py.check_signals()).err();
        self.next = Instant::now() + PATIENCE;
        if self.raised.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Calls something of Python; breaks where it raises.
    pub(crate) fn call(&mut self, f: impl FnOnce(Python<'_>) -> PyResult<()>) -> ControlFlow<()> {
        self.raised = Python::attach(f).err();
        if self.raised.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// What was raised.
    ///
    /// # Errors
    /// That exception.
    pub(crate) fn raised(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}
