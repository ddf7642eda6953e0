//! Runs the functions of a program over any scalar, with constants to as many digits as the scalar holds.
//!
//! Does not know: what functions are for.

use hamel_runtime::Real;

use hamel_expr::Relation;
use hamel_program::program::{Constant, Instruction, Op, Operand, Point, Program};

use super::tape;

/// A program, beside its constants to 31 digits.
pub(super) struct Runner<'a> {
    pub(super) program: &'a Program,
    constants: Vec<[f64; 2]>,
}

/// Where a function is evaluated.
pub(super) struct At<'a, R> {
    pub(super) params: &'a [R],
    /// Values of the prepare part.
    pub(super) slots: &'a [R],
    pub(super) inputs: &'a [R],
    pub(super) t: R,
    pub(super) state: &'a [R],
}

impl<'a> Runner<'a> {
    pub(super) fn new(program: &'a Program) -> Runner<'a> {
        let parts = |constant: &Constant| match constant {
            Constant::Rational(q) => tape::parts(q),
            Constant::Pi => tape::PI,
        };
        Runner { program, constants: program.constants.iter().map(parts).collect() }
    }

    fn constants<R: Real>(&self) -> Vec<R> {
        self.constants.iter().map(|[hi, lo]| R::from_parts(*hi, *lo)).collect()
    }

    /// The prepared slots.
    pub(super) fn slots<R: Real>(&self, params: &[R]) -> Vec<R> {
        let constants = self.constants();
        let values = run(&self.program.prepare.instructions, |operand| match operand {
            Operand::Constant(i) => constants[i as usize],
            Operand::Param(i) => params[i as usize],
            // The verifier of programs lets nothing else into the prepare part.
            _ => R::ZERO,
        });
        self.program.prepare.slots.iter().map(|slot| values[slot.value as usize]).collect()
    }

    /// The conditions on parameters, with both sides.
    pub(super) fn conditions<R: Real>(&self, params: &[R]) -> Vec<(Relation, R, R)> {
        let constants = self.constants();
        let read = |operand: Operand| match operand {
            Operand::Constant(i) => constants[i as usize],
            Operand::Param(i) => params[i as usize],
            _ => R::ZERO,
        };
        let values = run(&self.program.prepare.instructions, read);
        let of = |operand: Operand| match operand {
            Operand::Value(i) => values[i as usize],
            operand => read(operand),
        };
        self.program.prepare.conditions.iter().map(|c| (c.relation, of(c.greater), of(c.less))).collect()
    }

    /// The results of a function.
    pub(super) fn call<R: Real>(&self, function_idx: usize, at: &At<'_, R>, argument: &[R]) -> Vec<R> {
        let function = &self.program.functions[function_idx];
        let constants = self.constants();
        let read = |operand: Operand| match operand {
            Operand::Constant(i) => constants[i as usize],
            Operand::Param(i) => at.params[i as usize],
            Operand::Slot(i) => at.slots[i as usize],
            Operand::Time => at.t,
            Operand::Input(i) => at.inputs[i as usize],
            Operand::State(i) => at.state[i as usize],
            Operand::Argument(i) => argument[i as usize],
            // Values are read below; contracted results are written by `run_tables`.
            Operand::Value(_) | Operand::Contracted(_) => R::ZERO,
        };
        let values = run(&function.instructions, read);
        let of = |operand: Operand| match operand {
            Operand::Value(i) => values[i as usize],
            operand => read(operand),
        };
        let mut out: Vec<R> = function.results.iter().map(|(_, o)| of(*o)).collect();
        if !function.contractions.is_empty() {
            let scalars: Vec<R> = function.scalars.iter().map(|o| of(*o)).collect();
            let point = Point { t: at.t, state: at.state, argument };
            self.program.run_tables(function, point, &scalars, &mut out);
        }
        out
    }
}

fn run<R: Real>(instructions: &[Instruction], read: impl Fn(Operand) -> R) -> Vec<R> {
    let mut values: Vec<R> = Vec::with_capacity(instructions.len());
    for instruction in instructions {
        let of = |operand: Operand| match operand {
            Operand::Value(i) => values[i as usize],
            operand => read(operand),
        };
        let value = match instruction.op {
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
            Op::SumError(a, b) => of(a).sum_error(of(b)),
            Op::ProductError(a, b) => of(a).product_error(of(b)),
            Op::CircleError(a, b) => of(a).circle_error(of(b)),
            Op::MulAdd(signs, a, b, c) => {
                let product = of(a) * of(b);
                let product = if signs.product { -product } else { product };
                if signs.addend { product - of(c) } else { product + of(c) }
            }
        };
        values.push(value);
    }
    values
}
