//! Interrupts of the keyboard while Python is not held.
//!
//! Deliberately does not know: what is interrupted.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// How long an interrupt waits at most, beyond one step.
const PATIENCE: Duration = Duration::from_millis(50);

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

    /// What was raised.
    ///
    /// # Errors
    /// That exception.
    pub(crate) fn raised(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}
