//! Digits that functions lose which their inputs have: they are told, or kept by carrying rounding errors along.
//!
//! The search for the cheapest form removes cancellations where another form has fewer. What is lost all the same is
//! measured here: `sampling` draws states and parameters of the scene, `loss` measures the digits that each function
//! loses there and which operations lose them. The report tells the losses, unless the scene keeps digits at a cost:
//! then values whose rounding shows in a result are pairs, and `pairs` writes these with their errors. A function that
//! loses nothing stays as it is. The errors are zero as formulas, so that a comparison of formulas does not see a wrong
//! one: each function is measured again, and one that did not gain stays as it was. Does not know: expressions,
//! mechanics.

mod loss;
mod pairs;
mod sampling;

pub use sampling::{Sampling, VariableKind};

use hamel_runtime::Pivot;

use loss::Tape;
use pairs::{Kept, compensated, without_dead};
use sampling::{Draw, Place};

use crate::program::{Loss, Program, Role};

/// At how many places functions are measured: those, the fewest of a large function, and operations at all of them
/// together.
#[derive(Clone, Copy)]
struct Extent {
    places: usize,
    fewest: usize,
    operations: usize,
}

/// Where functions carry errors: the weights of these are the largest of all places.
const WHOLE: Extent = Extent { places: 4096, fewest: 64, operations: 1_000_000 };
/// Where losses are told alone: 3.5 % of the time in which the shipped scenes are generated (profile `dev`).
const SCREEN: Extent = Extent { places: 256, fewest: 32, operations: 25_000 };
/// Places drawn for each that the program has to accept.
const DRAWN: usize = 4;
/// A function that loses more than so many units of the machine epsilon at one place of a thousand is mended ..
const WORTH_MENDING: f64 = loss::CLEAR;
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

/// The losses of a function at the first of the places, of a large function at fewer of them.
fn measured(program: &Program, k: usize, (extent, places): (Extent, &[Place])) -> Option<loss::Losses> {
    let tape = Tape::new(program, &program.functions[k])?;
    Some(tape.losses(&places[..n_places(&tape, extent).min(places.len())]))
}

fn n_places(tape: &Tape<'_>, extent: Extent) -> usize {
    (extent.operations / tape.n_needed().max(1)).clamp(extent.fewest, extent.places)
}

/// Places that the program accepts, as many as a function is measured at.
fn places(program: &Program, functions: &[usize], sampling: &Sampling, extent: Extent) -> Vec<Place> {
    let tapes = functions.iter().filter_map(|k| Tape::new(program, &program.functions[*k]));
    let n = tapes.map(|tape| n_places(&tape, extent)).max().unwrap_or(0);
    let n_others = program.functions.iter().map(|f| f.argument.len()).max().unwrap_or(0);
    let n_others = n_others.max(program.inputs.len());
    let mut draw = Draw(0x5eed);
    let drawn = (0..DRAWN * n).map(|k| draw.place(k, sampling, n_others));
    drawn.filter(|place| is_allowed(program, place)).take(n).collect()
}

/// What a function loses, where that is more than is left alone.
fn told(role: &Role, losses: &loss::Losses, was_tried: bool) -> Option<Loss> {
    // Saturating.
    let [near, moved] = losses.most.map(|most| (most > WORTH_MENDING).then(|| most.ceil() as u64));
    (near.is_some() || moved.is_some()).then(|| Loss { role: role.clone(), near, moved, was_tried })
}

/// Measures the digits that functions lose, writes these functions with their rounding errors where the scene asks for
/// it, and reports the losses that are left.
pub(super) fn compensate(program: &mut Program, sampling: &Sampling) {
    let functions: Vec<usize> =
        (0..program.functions.len()).filter(|k| is_measured(&program.functions[*k].role)).collect();
    let extent = if sampling.carries_errors { WHOLE } else { SCREEN };
    let drawn = places(program, &functions, sampling, extent);
    let mut open: Vec<Open> = Vec::new();
    for k in functions {
        let Some(losses) = measured(program, k, (extent, &drawn)) else { continue };
        if let Some(loss) = told(&program.functions[k].role, &losses, false) {
            open.push(Open { k, losses, loss, attempt: 0 });
        }
    }
    program.report.losses = match open.is_empty() || !sampling.carries_errors {
        true => open.into_iter().map(|open| open.loss).collect(),
        false => mend(program, &mut open, (extent, &drawn)),
    };
}

/// A function that loses digits.
struct Open {
    k: usize,
    losses: loss::Losses,
    loss: Loss,
    /// Which of the thresholds is tried.
    attempt: usize,
}

/// Writes the functions that lose digits with their rounding errors, and tells what they lose all the same.
fn mend(program: &mut Program, open: &mut [Open], places: (Extent, &[Place])) -> Vec<Loss> {
    let mut left = Vec::new();
    let mut best: Option<Program> = None;
    for _ in THRESHOLDS {
        let mut kept = Kept::new(program.prepare.instructions.len());
        for of in open.iter() {
            kept.add(of.k, &of.losses.weights, THRESHOLDS[of.attempt]);
        }
        let mut new = compensated(program, &kept);
        let mut is_done = true;
        left.clear();
        for of in open.iter_mut() {
            let after = measured(&new, of.k, places);
            let after = after.filter(|after| after.largest * GAIN <= of.losses.largest);
            if after.is_none() {
                new.functions[of.k] = program.functions[of.k].clone();
            }
            let still = told(&of.loss.role, after.as_ref().unwrap_or(&of.losses), true);
            if still.is_some() && of.attempt + 1 < THRESHOLDS.len() {
                of.attempt += 1;
                is_done = false;
            }
            left.extend(still);
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
    left
}

#[cfg(test)]
mod tests {
    use super::{Draw, Sampling, VariableKind, WHOLE, compensate, measured};
    use crate::program::{Function, Instruction, Op, Operand, Prepare, Program, Report, Role, verify};

    const SAMPLING: fn(bool) -> Sampling = |carries_errors| Sampling {
        carries_errors,
        params: Vec::new(),
        state: vec![VariableKind::Velocity; 3],
    };

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
        let places: Vec<_> = (0..400).map(|k| draw.place(k, &SAMPLING(true), 0)).collect();
        measured(program, 0, (WHOLE, &places)).unwrap().largest
    }

    #[test]
    fn a_difference_of_products_keeps_the_digits_of_its_inputs() {
        let mut kept = cancelling();
        assert!(loss(&kept) > 1e6, "{}", loss(&kept));
        compensate(&mut kept, &SAMPLING(true));
        verify(&kept).unwrap();
        assert!(kept.functions[0].carries_errors());
        assert!(loss(&kept) < 8.0, "{}", loss(&kept));
    }

    #[test]
    fn a_loss_is_told_and_costs_nothing_unless_the_scene_keeps_digits() {
        for role in [Role::Rate, Role::Energy, Role::Output("f".into())] {
            let mut told = cancelling();
            told.functions[0].role = role.clone();
            let before = told.functions.clone();
            compensate(&mut told, &SAMPLING(false));
            assert_eq!(told.functions, before);
            let [loss] = told.report.losses.as_slice() else { panic!("{:?}", told.report) };
            assert!(loss.role == role && loss.near > Some(1_000) && loss.moved > Some(1_000), "{loss:?}");
            assert!(told.report.to_string().contains("a scene that wants `digits`"), "{}", told.report);
            compensate(&mut told, &SAMPLING(true));
            assert!(told.functions[0].carries_errors());
            assert_eq!(told.report.losses, []);
        }
    }

    #[test]
    fn a_rest_that_is_wrong_is_measured() {
        let mut kept = cancelling();
        compensate(&mut kept, &SAMPLING(true));
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
        for carries_errors in [false, true] {
            compensate(&mut healthy, &SAMPLING(carries_errors));
            assert_eq!(healthy, before);
        }
    }
}
