//! Proof that the standard library is not linked: its panic handler would clash with the one here.
//!
//! Runs on a hosted Linux target and exits with zero if the right-hand side is the pendulum's and its energy is kept,
//! with one if not, with two after an error.

#![no_std]
#![no_main]

use core::panic::PanicInfo;

use hamel_downstream_no_std::pendulum::{Params, Prepared};
use hamel_downstream_no_std::{energy_drift, rhs_error};

// The C library starts the process and stops it; nothing else of it is used.
#[link(name = "c")]
unsafe extern "C" {
    safe fn abort() -> !;
}

#[panic_handler]
fn panic(_info: &PanicInfo<'_>) -> ! {
    abort()
}

/// The hosted target's `core` is compiled for unwinding and names this function, which `std` would define.
/// Panics abort here, so that nobody calls it.
#[unsafe(no_mangle)]
pub extern "C" fn rust_eh_personality() -> ! {
    abort()
}

/// Entry point for the C start-up code.
#[unsafe(no_mangle)]
pub extern "C" fn main(n_arguments: i32, _arguments: *const *const u8) -> i32 {
    // From outside, so that nothing is computed at compile time.
    let k = 9.81 * f64::from(n_arguments);
    let Ok(system) = Prepared::new(&Params { k }) else { return 2 };
    match energy_drift(&system) {
        Ok(drift) if drift < 1e-9 && rhs_error(&system, k) < 1e-14 * k => 0,
        Ok(_) => 1,
        Err(_) => 2,
    }
}
