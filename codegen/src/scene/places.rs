//! The functions of a program that an interpreter calls at every step, and space for their results.
//!
//! Does not know: how a function runs.

use hamel_runtime::Real;

use hamel_program::program::{Program, Role};

/// The functions that are called at every step, by their places in the program: there are many, and they are looked up
/// once.
#[derive(Clone, Copy, Debug)]
pub(super) struct Places {
    pub(super) rate: Option<usize>,
    pub(super) energy: Option<usize>,
    pub(super) signature: Option<usize>,
    pub(super) pivots: Option<usize>,
    pub(super) domain: Option<usize>,
}

impl Places {
    pub(super) fn of(program: &Program) -> Places {
        Places {
            rate: program.function_idx(&Role::Rate),
            energy: program.function_idx(&Role::Energy),
            signature: program.function_idx(&Role::Signature),
            pivots: program.function_idx(&Role::Pivots),
            domain: program.function_idx(&Role::Domain),
        }
    }
}

/// Results of a function with fewer are on the stack.
const N_ON_STACK: usize = 16;

/// Space for the results of a function.
pub(super) fn with_space<R: Real, T>(n: usize, use_it: impl FnOnce(&mut [R]) -> T) -> T {
    if n <= N_ON_STACK { use_it(&mut [R::ZERO; N_ON_STACK][..n]) } else { use_it(&mut vec![R::ZERO; n]) }
}
