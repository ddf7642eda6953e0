//! Functions that lose digits which their inputs have carry their rounding errors along.
//!
//! The search for the cheapest form removes cancellations where another form has fewer. Where none was found, values
//! whose rounding shows in a result are pairs: `sampling` draws states and parameters of the scene, `loss` measures the
//! digits that each function loses there and which operations lose them, `pairs` writes these with their errors. A
//! function that loses nothing stays as it is. The errors are zero as formulas, so that a comparison of formulas does
//! not see a wrong one: each function is measured again, and one that did not gain stays as it was. Does not know:
//! expressions, mechanics.

mod loss;
mod pairs;
mod sampling;

pub use sampling::{Sampling, VariableKind};

use hamel_runtime::Pivot;

use loss::Tape;
use pairs::{Kept, compensated, without_dead};
use sampling::{Draw, Place};

use crate::program::{Program, Role};

/// Places at which a function is measured, and operations at all of them together.
const PLACES: usize = 4096;
const FEWEST_PLACES: usize = 64;
const OPERATIONS: usize = 1_000_000;
/// Places drawn for each that the program has to accept.
const DRAWN: usize = 4;
/// A function that loses more than so many units of the machine epsilon at one place of a thousand is mended ..
const WORTH_MENDING: f64 = 32.0;
/// .. and stays as it is unless it loses so many times less then.
const GAIN: f64 = 4.0;
/// Errors are kept from so many units of the roundoff on, of the result or of what rounding the inputs does to it;
/// smaller ones where that does not do.
const THRESHOLDS: [f64; 2] = [1.0, 0.125];

fn is_measured(role: &Role) -> bool {
    match role {
        Role::Rate | Role::Energy | Role::Output(_) | Role::Product(_) => true,
        // What is divided by is watched by the scale of its rounding errors; flows and series have programs of their
        // own.
        Role::Pivots
        | Role::Signature
        | Role::Domain
        | Role::OfVariables(_)
        | Role::Flow(_)
        | Role::Points
        | Role::SeriesStart
        | Role::SeriesStep => false,
    }
}

/// Whether the program accepts the parameters, and the state as one at which the rates have a value.
fn is_allowed(program: &Program, place: &Place) -> bool {
    let Ok(prepared) = program.prepare(&place.params) else { return false };
    let of = |role: &Role| {
        let k = program.function_idx(role)?;
        let mut out = vec![0.0; program.functions[k].results.len()];
        program.run(k, &place.params, &prepared, place.t, &place.state, &mut out);
        Some(out)
    };
    let pivots = of(&Role::Pivots).unwrap_or_default();
    let (values, scales) = pivots.split_at(pivots.len() / 2);
    let is_clear = |(value, scale): (&f64, &f64)| {
        Pivot { name: "", value: *value, scale: *scale }.verify(place.t).is_ok()
    };
    let inside = of(&Role::Domain).unwrap_or_default();
    values.iter().zip(scales).all(is_clear) && inside.iter().all(|value| *value > 0.0)
}

/// The loss of a function at the first of the places, and what makes it; of a large function at fewer places.
fn measured(program: &Program, k: usize, places: &[Place]) -> Option<loss::Losses> {
    let tape = Tape::new(program, &program.functions[k])?;
    Some(tape.losses(&places[..n_places(&tape).min(places.len())]))
}

fn n_places(tape: &Tape<'_>) -> usize {
    (OPERATIONS / tape.n_needed().max(1)).clamp(FEWEST_PLACES, PLACES)
}

/// Places that the program accepts, as many as a function is measured at.
fn places(program: &Program, functions: &[usize], sampling: &Sampling) -> Vec<Place> {
    let tapes = functions.iter().filter_map(|k| Tape::new(program, &program.functions[*k]));
    let n = tapes.map(|tape| n_places(&tape)).max().unwrap_or(0);
    let n_others = program.functions.iter().map(|f| f.argument.len()).max().unwrap_or(0);
    let n_others = n_others.max(program.inputs.len());
    let mut draw = Draw(0x5eed);
    let drawn = (0..DRAWN * n).map(|k| draw.place(k, sampling, n_others));
    drawn.filter(|place| is_allowed(program, place)).take(n).collect()
}

/// Writes the functions that lose digits with their rounding errors.
pub(super) fn compensate(program: &mut Program, sampling: &Sampling) {
    let functions: Vec<usize> =
        (0..program.functions.len()).filter(|k| is_measured(&program.functions[*k].role)).collect();
    let drawn = places(program, &functions, sampling);
    let mut open: Vec<(usize, loss::Losses)> = Vec::new();
    for k in functions {
        let losses = measured(program, k, &drawn);
        open.extend(losses.filter(|losses| losses.most > WORTH_MENDING).map(|losses| (k, losses)));
    }
    if open.is_empty() {
        return;
    }
    let mut thresholds = vec![0; open.len()];
    let mut best: Option<Program> = None;
    for _ in THRESHOLDS {
        let mut kept = Kept::new(program.prepare.instructions.len());
        for ((k, losses), threshold) in open.iter().zip(&thresholds) {
            kept.add(*k, &losses.weights, THRESHOLDS[*threshold]);
        }
        let mut new = compensated(program, &kept);
        let mut is_done = true;
        for ((k, before), threshold) in open.iter().zip(&mut thresholds) {
            let after = measured(&new, *k, &drawn);
            let is_better = after.as_ref().is_some_and(|after| after.largest * GAIN <= before.largest);
            if !is_better {
                new.functions[*k] = program.functions[*k].clone();
            }
            let is_enough = after.is_some_and(|after| after.most <= WORTH_MENDING);
            if !is_enough && *threshold + 1 < THRESHOLDS.len() {
                *threshold += 1;
                is_done = false;
            }
        }
        best = Some(new);
        if is_done {
            break;
        }
    }
    if let Some(mut new) = best {
        without_dead(&mut new);
        *program = new;
    }
}

#[cfg(test)]
mod tests {
    use super::{Draw, Sampling, VariableKind, compensate, measured};
    use crate::program::{Function, Instruction, Op, Operand, Prepare, Program, Report, Role, verify};

    const SAMPLING: fn() -> Sampling =
        || Sampling { params: Vec::new(), state: vec![VariableKind::Velocity; 3] };

    fn program(ops: &[Op]) -> Program {
        let instructions = ops.iter().map(|op| Instruction { op: *op, section: 0, name: None }).collect();
        let result = Operand::Value(u32::try_from(ops.len() - 1).unwrap());
        let function = Function {
            role: Role::Output("f".into()),
            instructions,
            results: vec![("f".into(), result)],
            ..Function::default()
        };
        Program {
            params: Vec::new(),
            time: "t".into(),
            inputs: Vec::new(),
            state: ["a", "b", "c"].map(String::from).to_vec(),
            constants: Vec::new(),
            tables: Vec::new(),
            sections: vec!["results".into()],
            prepare: Prepare::default(),
            functions: vec![function],
            report: Report::default(),
        }
    }

    /// `(a + b) c - a c = b c`, which loses the digits of `b` beside a large `a`.
    fn cancelling() -> Program {
        let [a, b, c] = [0, 1, 2].map(Operand::State);
        let [sum, first, second] = [0, 1, 2].map(Operand::Value);
        program(&[Op::Add(a, b), Op::Mul(sum, c), Op::Mul(a, c), Op::Sub(first, second)])
    }

    fn loss(program: &Program) -> f64 {
        let mut draw = Draw(7);
        let places: Vec<_> = (0..400).map(|k| draw.place(k, &SAMPLING(), 0)).collect();
        measured(program, 0, &places).unwrap().largest
    }

    #[test]
    fn a_difference_of_products_keeps_the_digits_of_its_inputs() {
        let mut kept = cancelling();
        assert!(loss(&kept) > 1e6, "{}", loss(&kept));
        compensate(&mut kept, &SAMPLING());
        verify(&kept).unwrap();
        assert!(kept.functions[0].carries_errors());
        assert!(loss(&kept) < 8.0, "{}", loss(&kept));
    }

    #[test]
    fn a_rest_that_is_wrong_is_measured() {
        let mut kept = cancelling();
        compensate(&mut kept, &SAMPLING());
        let mut n = 0;
        for k in 0..kept.functions[0].instructions.len() {
            let mut faulty = kept.clone();
            let op = &mut faulty.functions[0].instructions[k].op;
            *op = match *op {
                Op::SumError(a, b) => Op::ProductError(a, b),
                Op::ProductError(a, b) => Op::SumError(a, b),
                _ => continue,
            };
            n += 1;
            assert!(loss(&faulty) > 1e3, "value {k}: {}", loss(&faulty));
        }
        assert!(n >= 3, "{n}");
    }

    #[test]
    fn a_function_that_keeps_its_digits_stays_as_it_is() {
        let [a, b, c] = [0, 1, 2].map(Operand::State);
        let mut healthy = program(&[Op::Mul(a, b), Op::Add(Operand::Value(0), c)]);
        let before = healthy.clone();
        compensate(&mut healthy, &SAMPLING());
        assert_eq!(healthy, before);
    }
}
