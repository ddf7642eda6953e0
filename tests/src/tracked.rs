//! Right-hand sides run on tracked numbers, and their distance from the reference.

use hamel_program::program::{Program, Role};

use crate::reference;

pub use hamel_measure::tracked::{Tracked, unit_in_the_last_place};

/// Runs one function of a program on tracked numbers, at time zero.
///
/// # Panics
/// When the program has no such function or refuses the parameters.
pub fn tracked(program: &Program, role: &Role, params: &[f64], state: &[f64]) -> Vec<Tracked> {
    let lift = |values: &[f64]| values.iter().map(|x| Tracked::input(*x)).collect::<Vec<_>>();
    let (params, state) = (lift(params), lift(state));
    let prepared = program.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let k = program.function_idx(role).unwrap_or_else(|| panic!("the program has no {role}"));
    let mut out = vec![Tracked::default(); program.functions[k].results.len()];
    program.run(k, &params, &prepared, Tracked::input(0.0), &state, &mut out);
    out
}

/// How many units in the last place of the larger of component and largest term a value is off.
///
/// # Panics
/// When the value is not finite.
pub fn units_off(computed: Tracked, expected: &str) -> f64 {
    let scale = computed.term.max(reference::number(expected).abs());
    reference::distance(computed.value, expected) / unit_in_the_last_place(scale)
}
