//! What rounding does to the results of a function, and which of its operations do it.
//!
//! A function is evaluated in `f64` and, by the same operations, in double-double numbers. Where a result has lost
//! digits that its inputs have, one sweep back through the operations weighs what each of them rounds.
//!
//! Source: Higham 2002, Accuracy and stability of numerical algorithms, section 3.3 (running error analysis); the
//! derivatives of a result by what it was computed from are the weights of rounding errors. Does not know: how places
//! are drawn, what is done about a loss.

use hamel_runtime::{DoubleDouble, Dual, Real};

use super::sampling::Place;
use crate::program::edit::{operand, position};
use crate::program::{Constant, Function, Op, Operand, Program};
use hamel_expr::Func;

/// Errors of this many units of the machine epsilon, of the result itself, are not looked at: they are left alone.
pub(super) const CLEAR: f64 = 32.0;
/// Results below so much of the largest term that enters them have no digits in double-double numbers that `f64` could
/// be held to: `2^-105` is their roundoff, and `2^-53` that of `f64`.
const UNKNOWN: f64 = 1.0 / (1u64 << 46) as f64;
/// Results below are next to underflow, where double-double numbers have lost digits too.
const TINY: f64 = 1e-250;

/// The operations behind a function: those of the prepare part, and its own.
pub(super) struct Tape<'a> {
    program: &'a Program,
    /// With the values of the prepare part first; slots are values.
    ops: Vec<Op>,
    results: Vec<Operand>,
    is_needed: Vec<bool>,
}

/// Values of all operations at a place.
struct Values<R> {
    params: Vec<R>,
    t: R,
    state: Vec<R>,
    others: Vec<R>,
    constants: Vec<R>,
    values: Vec<R>,
}

/// The largest weights of what each operation rounds, over all places, in units of the roundoff of the result and of
/// what rounding the inputs does to it.
pub(super) struct Weights {
    /// The rounding of the operation itself.
    pub(super) own: Vec<f64>,
    /// That of each operand, on the way through the operation.
    pub(super) operands: Vec<[f64; 3]>,
}

/// What was found at some places.
pub(super) struct Losses {
    /// The largest loss of a result at a place, in multiples of the machine epsilon; infinite where a result is finite
    /// in double-double numbers alone.
    pub(super) largest: f64,
    /// The loss that 999 of 1000 places do not exceed, with parameters near their defaults, and moved by decades.
    pub(super) most: [f64; 2],
    pub(super) weights: Weights,
}

impl<R: Real> Values<R> {
    fn read(&self, operand: Operand) -> R {
        match operand {
            Operand::Value(v) => self.values[v as usize],
            Operand::Constant(i) => self.constants[i as usize],
            Operand::Param(i) => self.params[i as usize],
            Operand::Time => self.t,
            Operand::State(i) => self.state[i as usize],
            Operand::Input(i) | Operand::Argument(i) => self.others[i as usize],
            // Slots are values of the tape, and functions with contractions have no tape.
            Operand::Slot(_) | Operand::Contracted(_) => R::ZERO,
        }
    }
}

fn applied<R: Real>(op: Op, of: impl Fn(Operand) -> R) -> R {
    let signed = |negative: bool, x: R| if negative { -x } else { x };
    match op {
        Op::Add(a, b) => of(a) + of(b),
        Op::Sub(a, b) => of(a) - of(b),
        Op::Mul(a, b) => of(a) * of(b),
        Op::Div(a, b) => of(a) / of(b),
        Op::Neg(a) => -of(a),
        Op::Recip(a) => of(a).recip(),
        Op::Sqrt(a) => of(a).sqrt(),
        Op::Power(a, q) => (of(q) * of(a).ln()).exp(),
        Op::Function(f, a) => f.of(of(a)),
        Op::Atan2(y, x) => of(y).atan2(of(x)),
        Op::MulAdd(s, a, b, c) => signed(s.product, of(a)).mul_add(of(b), signed(s.addend, of(c))),
        Op::SumError(a, b) => of(a).sum_error(of(b)),
        Op::ProductError(a, b) => of(a).product_error(of(b)),
        Op::CircleError(a, b) => of(a).circle_error(of(b)),
    }
}

impl<'a> Tape<'a> {
    /// None of a function whose results come from tables.
    pub(super) fn new(program: &'a Program, function: &Function) -> Option<Tape<'a>> {
        if !function.contractions.is_empty() {
            return None;
        }
        let n_prepared = program.prepare.instructions.len();
        let moved = |o: Operand| match o {
            Operand::Value(v) => operand(n_prepared + v as usize),
            Operand::Slot(i) => Operand::Value(program.prepare.slots[i as usize].value),
            other => other,
        };
        let prepared = program.prepare.instructions.iter().map(|i| i.op);
        let ops: Vec<Op> = prepared.chain(function.instructions.iter().map(|i| i.op.map(moved))).collect();
        let results: Vec<Operand> = function.results.iter().map(|(_, o)| moved(*o)).collect();
        let mut is_needed = vec![false; ops.len()];
        results.iter().filter_map(|o| position(*o)).for_each(|v| is_needed[v] = true);
        for v in (0..ops.len()).rev() {
            if is_needed[v] {
                ops[v].operands().filter_map(position).for_each(|v| is_needed[v] = true);
            }
        }
        Some(Tape { program, ops, results, is_needed })
    }

    /// Operations that a result needs.
    pub(super) fn n_needed(&self) -> usize {
        self.is_needed.iter().filter(|x| **x).count()
    }

    fn run<R: Real>(&self, place: &Place) -> Values<R> {
        let lifted = |x: &[f64]| x.iter().map(|x| R::from_f64(*x)).collect::<Vec<R>>();
        let mut at = Values {
            params: lifted(&place.params),
            t: R::from_f64(place.t),
            state: lifted(&place.state),
            others: lifted(&place.others),
            constants: self.program.constants.iter().map(Constant::value).collect(),
            values: Vec::with_capacity(self.ops.len()),
        };
        for (op, is_needed) in self.ops.iter().zip(&self.is_needed) {
            let value = if *is_needed { applied(*op, |o| at.read(o)) } else { R::ZERO };
            at.values.push(value);
        }
        at
    }

    /// The losses at places, and what makes them at those where they are of some size.
    pub(super) fn losses(&self, places: &[Place]) -> Losses {
        let n = self.ops.len();
        let mut weights = Weights { own: vec![0.0; n], operands: vec![[0.0; 3]; n] };
        let mut losses = [Vec::new(), Vec::new()];
        for place in places {
            losses[usize::from(place.is_machine)].push(self.loss(place, &mut weights));
        }
        losses.iter_mut().for_each(|of| of.sort_by(f64::total_cmp));
        let last = |of: &Vec<f64>| of.len().saturating_sub(1);
        let largest = losses.iter().filter_map(|of| of.last()).fold(0.0, |max: f64, x| max.max(*x));
        let most = losses.map(|of| of.get(last(&of) * 999 / 1000).copied().unwrap_or(0.0));
        Losses { largest, most, weights }
    }

    fn loss(&self, place: &Place, weights: &mut Weights) -> f64 {
        let (plain, exact) = (self.run::<f64>(place), self.run::<DoubleDouble>(place));
        let errors: Vec<(f64, f64)> = (self.results.iter())
            .map(|r| {
                let value = exact.read(*r);
                ((value - DoubleDouble::from(plain.read(*r))).hi().abs(), value.hi().abs())
            })
            .collect();
        if errors.iter().any(|(_, value)| !value.is_finite()) {
            return 0.0;
        }
        if errors.iter().any(|(error, _)| !error.is_finite()) {
            return f64::INFINITY;
        }
        let mut worst: f64 = 0.0;
        for (result, (error, value)) in self.results.iter().zip(errors) {
            if error <= CLEAR * f64::EPSILON * value || error <= TINY {
                continue;
            }
            let slopes = self.slopes(&exact, *result);
            let terms = (0..self.ops.len()).filter(|v| self.is_needed[*v]);
            let terms = terms.map(|v| slopes.of_values[v].hi().abs() * exact.values[v].hi().abs());
            let largest = terms.filter(|x| x.is_finite()).fold(0.0, f64::max);
            // Below that double-double numbers do not know the result, either: it is zero for all they tell.
            let scale = (value + slopes.of_inputs).max(largest * UNKNOWN);
            let loss = error / (f64::EPSILON * scale);
            if !loss.is_finite() {
                continue;
            }
            worst = worst.max(loss);
            for (v, op) in self.ops.iter().enumerate().filter(|(v, _)| self.is_needed[*v]) {
                let slope = slopes.of_values[v].hi().abs();
                let add = |to: &mut f64, x: f64| *to = if x.is_finite() { to.max(x / scale) } else { *to };
                add(&mut weights.own[v], slope * size_of_rounding(*op, &exact, v));
                for (k, (o, partial)) in partials(*op, &exact, v).into_iter().flatten().enumerate() {
                    let weight = (slopes.of_values[v] * partial).hi().abs() * exact.read(o).hi().abs();
                    add(&mut weights.operands[v][k], weight);
                }
            }
        }
        worst
    }

    /// Derivatives of a result by all values, and what rounding the inputs does to it.
    fn slopes(&self, exact: &Values<DoubleDouble>, result: Operand) -> Slopes {
        let mut of_values = vec![DoubleDouble::ZERO; self.ops.len()];
        let mut of_leaves: Vec<(Operand, DoubleDouble)> = Vec::new();
        let mut add = |of_values: &mut Vec<DoubleDouble>, o: Operand, slope: DoubleDouble| match o {
            Operand::Value(v) => of_values[v as usize] += slope,
            Operand::Constant(_) => {}
            leaf => match of_leaves.iter_mut().find(|(known, _)| *known == leaf) {
                Some((_, sum)) => *sum += slope,
                None => of_leaves.push((leaf, slope)),
            },
        };
        add(&mut of_values, result, DoubleDouble::ONE);
        for v in (0..self.ops.len()).rev() {
            let slope = of_values[v];
            if slope == DoubleDouble::ZERO || !self.is_needed[v] {
                continue;
            }
            for (o, partial) in partials(self.ops[v], exact, v).into_iter().flatten() {
                add(&mut of_values, o, slope * partial);
            }
        }
        let effect = |(leaf, slope): &(Operand, DoubleDouble)| (*slope * exact.read(*leaf)).hi().abs();
        let of_inputs = of_leaves.iter().map(effect).filter(|x| x.is_finite()).sum();
        Slopes { of_values, of_inputs }
    }
}

struct Slopes {
    of_values: Vec<DoubleDouble>,
    of_inputs: f64,
}

/// What the rounding errors of an operation are relative to.
fn size_of_rounding(op: Op, exact: &Values<DoubleDouble>, v: usize) -> f64 {
    let value = exact.values[v].hi().abs();
    match op {
        Op::Neg(_)
        | Op::Function(Func::Abs, _)
        | Op::SumError(..)
        | Op::ProductError(..)
        | Op::CircleError(..) => 0.0,
        Op::MulAdd(_, a, b, _) => value.max((exact.read(a) * exact.read(b)).hi().abs()),
        _ => value,
    }
}

/// Operands with the derivatives of the operation by them.
fn partials(op: Op, exact: &Values<DoubleDouble>, v: usize) -> [Option<(Operand, DoubleDouble)>; 3] {
    let (of, one) = (|o: Operand| exact.read(o), DoubleDouble::ONE);
    let signed = |negative: bool, x: DoubleDouble| if negative { -x } else { x };
    let one_of = |a, x| [Some((a, x)), None, None];
    let two_of = |a, x, b, y| [Some((a, x)), Some((b, y)), None];
    let value = exact.values[v];
    match op {
        Op::Add(a, b) => two_of(a, one, b, one),
        Op::Sub(a, b) => two_of(a, one, b, -one),
        Op::Mul(a, b) => two_of(a, of(b), b, of(a)),
        Op::Div(a, b) => two_of(a, of(b).recip(), b, -value / of(b)),
        Op::Neg(a) => one_of(a, -one),
        Op::Recip(a) => one_of(a, -value * value),
        Op::Sqrt(a) => one_of(a, (value + value).recip()),
        Op::Power(a, q) => one_of(a, of(q) * value / of(a)),
        Op::Function(f, a) => one_of(a, f.of(Dual::variable(of(a))).derivative),
        Op::Atan2(y, x) => {
            let square = of(x) * of(x) + of(y) * of(y);
            two_of(y, of(x) / square, x, -of(y) / square)
        }
        Op::MulAdd(s, a, b, c) => [
            Some((a, signed(s.product, of(b)))),
            Some((b, signed(s.product, of(a)))),
            Some((c, signed(s.addend, one))),
        ],
        Op::SumError(..) | Op::ProductError(..) | Op::CircleError(..) => [None; 3],
    }
}
