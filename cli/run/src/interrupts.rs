//! Interrupts: of the keyboard, of a terminal that closes, of a system that ends its programs.
//!
//! An interrupt removes files that have not taken their place and ends the program. Work that can stop in order is
//! shielded: the first interrupt is only noted, the work looks for it, and a second one ends the program.
//!
//! Does not know: what is interrupted.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Mutex, PoisonError};

use crate::error::INTERRUPTED;
use crate::signs;
use crate::streams::tell;
use crate::temporary;

/// An interrupt ends the program.
const OPEN: u8 = 0;
/// An interrupt is noted.
const SHIELDED: u8 = 1;
/// An interrupt was noted; the next one ends the program.
const NOTED: u8 = 2;

static STATE: AtomicU8 = AtomicU8::new(OPEN);
/// What is told when an interrupt ends the program.
static MESSAGE: Mutex<String> = Mutex::new(String::new());

/// Looks out for interrupts from now on. Without this, or with another handler, the system ends the program.
pub fn watch() {
    let interrupted = || {
        if STATE.compare_exchange(SHIELDED, NOTED, Ordering::Relaxed, Ordering::Relaxed).is_ok() {
            return;
        }
        signs::rest();
        temporary::remove_all();
        let message = MESSAGE.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if !message.is_empty() {
            tell(format_args!("\ninterrupted: {message}"));
        }
        std::process::exit(i32::from(INTERRUPTED));
    };
    // Another handler is as good.
    #[cfg(not(target_family = "wasm"))]
    let _ = ctrlc::set_handler(interrupted);
    // What runs WebAssembly ends it at once.
    #[cfg(target_family = "wasm")]
    let _ = interrupted;
}

/// Has something told when an interrupt ends the program.
pub fn tell_at_end(message: String) {
    *MESSAGE.lock().unwrap_or_else(PoisonError::into_inner) = message;
}

/// Work that [`look`]s for interrupts, as long as this value lives.
#[derive(Debug)]
pub struct Shield(());

impl Shield {
    /// From now on the first interrupt is noted.
    pub fn raise() -> Shield {
        STATE.store(SHIELDED, Ordering::Relaxed);
        Shield(())
    }
}

impl Drop for Shield {
    fn drop(&mut self) {
        STATE.store(OPEN, Ordering::Relaxed);
    }
}

/// Breaks once an interrupt was noted.
pub fn look() -> ControlFlow<()> {
    if STATE.load(Ordering::Relaxed) == NOTED { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}
