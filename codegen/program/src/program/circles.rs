//! A right-hand side `f(t, y)` that takes sines and cosines of angles from further components of the state.
//!
//! ```text
//! z = (y, cos x_1, sin x_1, cos x_2, ..)        dz/dt = (f(t, y), -x_1' sin x_1, x_1' cos x_1, ..)
//! ```
//!
//! for every angle `x_k` that is a component of the state or linear in them: `x_k'` is the same sum of the components
//! of `f`. An integrator that carries `z` within its steps calls no sine and no cosine there, and the components of `f`
//! have the bits that they have without, since the same operations run on the same numbers.
//!
//! Deliberately does not know: mechanics, integrators, Rust.

use super::cost::STEP_OF_A_COMPONENT;
use super::edit::{drop_dead, is_fixed, operand};
use super::ir::{Function, Instruction, Op, Operand, Program};
use super::role::Role;
use hamel_expr::Func;

/// The right-hand side of a program with its angles as points of circles.
///
/// Its program has the parameters, all prepared slots and all constants of the scene, read or not, the state `z`, and
/// two functions, [`Circles::RATE`] with the components of `dz/dt` as results and [`Circles::POINTS`] with cosine and
/// sine of every angle, which reads those components of `z` alone that are `y`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Circles {
    /// Both functions.
    pub program: Program,
    /// Dimension of the state `y`.
    pub n_state: usize,
    /// Number of angles.
    pub n_angles: usize,
}

impl Circles {
    /// Position of the right-hand side.
    pub const RATE: usize = 0;
    /// Position of the function of the points.
    pub const POINTS: usize = 1;

    /// The circles of a program whose [`Role::Rate`] costs less with them, the further components of the state
    /// included; none where there is no angle, where it does not pay, or where the right-hand side runs through tables.
    pub fn of(program: &Program) -> Option<Circles> {
        let rate = program.function(&Role::Rate)?;
        if rate.results.len() != program.state.len() || !rate.contractions.is_empty() {
            return None;
        }
        let circles = Builder::new(program, rate).finish()?;
        let carried = 2 * circles.n_angles as u64 * u64::from(STEP_OF_A_COMPONENT);
        let inside = circles.program.functions[Self::RATE].counts().cost() + carried;
        (inside < rate.counts().cost()).then_some(circles)
    }
}

/// The rate of change of a value that is linear in the state.
#[derive(Clone, Copy)]
enum Change {
    /// It does not change.
    None,
    By(Operand),
}

struct Builder<'p> {
    program: &'p Program,
    rate: &'p Function,
    /// The new right-hand side.
    instructions: Vec<Instruction>,
    /// What stands for each value of the old one.
    moved: Vec<Operand>,
    /// Which values of the old one are linear in the state, with factors that parameters determine.
    linear: Vec<bool>,
    /// Their rates of change.
    changes: Vec<Change>,
    /// Old operands that are angles.
    angles: Vec<Operand>,
}

impl<'p> Builder<'p> {
    fn new(program: &'p Program, rate: &'p Function) -> Builder<'p> {
        let mut builder = Builder {
            program,
            rate,
            instructions: Vec::new(),
            moved: Vec::new(),
            linear: Vec::new(),
            changes: Vec::new(),
            angles: Vec::new(),
        };
        for instruction in &rate.instructions {
            let moved = match instruction.op {
                Op::Function(Func::Cos, x) if builder.is_linear(x) => Operand::State(builder.point(x)),
                Op::Function(Func::Sin, x) if builder.is_linear(x) => Operand::State(builder.point(x) + 1),
                op => {
                    let op = op.map(|o| builder.moved(o));
                    builder.instructions.push(Instruction { op, ..instruction.clone() });
                    operand(builder.instructions.len() - 1)
                }
            };
            builder.moved.push(moved);
            let is_linear = builder.keeps_linear(instruction.op);
            builder.linear.push(is_linear);
        }
        builder
    }

    /// The place of the cosine of an angle in the state; the sine is behind it.
    fn point(&mut self, angle: Operand) -> u32 {
        let k = self.angles.iter().position(|known| *known == angle).unwrap_or_else(|| {
            self.angles.push(angle);
            self.angles.len() - 1
        });
        u32::try_from(self.program.state.len() + 2 * k).expect("fewer than 2^32 components fit in memory")
    }

    /// What stands for an operand of the old right-hand side.
    fn moved(&self, old: Operand) -> Operand {
        match old {
            Operand::Value(v) => self.moved[v as usize],
            other => other,
        }
    }

    /// Whether an operand of the old right-hand side is linear in the state.
    fn is_linear(&self, x: Operand) -> bool {
        match x {
            Operand::Value(v) => self.linear[v as usize],
            Operand::State(_) => true,
            other => is_fixed(other),
        }
    }

    /// Whether the result of an operation is linear in the state.
    fn keeps_linear(&self, op: Op) -> bool {
        let product = |a, b| is_fixed(a) && self.is_linear(b) || is_fixed(b) && self.is_linear(a);
        match op {
            Op::Add(a, b) | Op::Sub(a, b) => self.is_linear(a) && self.is_linear(b),
            Op::Neg(a) => self.is_linear(a),
            Op::Mul(a, b) => product(a, b),
            Op::Div(a, b) => is_fixed(b) && self.is_linear(a),
            Op::MulAdd(_, a, b, c) => product(a, b) && self.is_linear(c),
            Op::Recip(_)
            | Op::Sqrt(_)
            | Op::Power(..)
            | Op::Function(..)
            | Op::Atan2(..)
            | Op::SumError(..)
            | Op::ProductError(..)
            | Op::CircleError(..) => false,
        }
    }

    /// The rate of change of an operand that is linear in the state.
    fn change(&self, x: Operand) -> Change {
        match x {
            Operand::Value(v) => self.changes[v as usize],
            Operand::State(i) => Change::By(self.moved(self.rate.results[i as usize].1)),
            _ => Change::None,
        }
    }

    /// The rate of change of the result of an operation that is linear in the state.
    fn changed(&mut self, op: Op) -> Change {
        match op {
            Op::Neg(a) => self.applied(a, Op::Neg),
            Op::Div(a, b) => self.applied(a, |change| Op::Div(change, b)),
            Op::Mul(a, b) => self.multiple(a, b),
            Op::Add(a, b) => self.sum([self.change(a), self.change(b)]),
            Op::Sub(a, b) => {
                let less = self.applied(b, Op::Neg);
                self.sum([self.change(a), less])
            }
            Op::MulAdd(signs, a, b, c) => {
                let product = self.multiple(a, b);
                let terms = [(product, signs.product), (self.change(c), signs.addend)];
                let terms = terms.map(|(term, is_negative)| match term {
                    Change::By(change) if is_negative => Change::By(self.push(Op::Neg(change))),
                    term => term,
                });
                self.sum(terms)
            }
            Op::Recip(_)
            | Op::Sqrt(_)
            | Op::Power(..)
            | Op::Function(..)
            | Op::Atan2(..)
            | Op::SumError(..)
            | Op::ProductError(..)
            | Op::CircleError(..) => Change::None,
        }
    }

    fn applied(&mut self, a: Operand, op: impl Fn(Operand) -> Op) -> Change {
        match self.change(a) {
            Change::By(change) => Change::By(self.push(op(change))),
            Change::None => Change::None,
        }
    }

    fn multiple(&mut self, a: Operand, b: Operand) -> Change {
        let (factor, of) = if is_fixed(a) { (a, b) } else { (b, a) };
        self.applied(of, |change| Op::Mul(factor, change))
    }

    fn sum(&mut self, terms: [Change; 2]) -> Change {
        match terms {
            [Change::By(a), Change::By(b)] => Change::By(self.push(Op::Add(a, b))),
            [Change::By(a), Change::None] | [Change::None, Change::By(a)] => Change::By(a),
            [Change::None, Change::None] => Change::None,
        }
    }

    fn push(&mut self, op: Op) -> Operand {
        let section = self.last_section();
        self.instructions.push(Instruction { op, section, name: None });
        operand(self.instructions.len() - 1)
    }

    fn last_section(&self) -> u32 {
        u32::try_from(self.program.sections.len().saturating_sub(1)).unwrap_or(u32::MAX)
    }

    /// The names of cosine and sine of an angle.
    fn names(&self, k: usize) -> [String; 2] {
        let name = match self.angles[k] {
            Operand::State(i) => self.program.state[i as usize].clone(),
            _ => format!("angle{k}"),
        };
        [format!("cos_{name}"), format!("sin_{name}")]
    }

    fn finish(mut self) -> Option<Circles> {
        if self.angles.is_empty() {
            return None;
        }
        let mut state = self.program.state.clone();
        let mut results: Vec<Operand> = self.rate.results.iter().map(|(_, o)| self.moved(*o)).collect();
        for (k, instruction) in self.rate.instructions.iter().enumerate() {
            let change = if self.linear[k] { self.changed(instruction.op) } else { Change::None };
            self.changes.push(change);
        }
        for k in 0..self.angles.len() {
            let Change::By(change) = self.change(self.angles[k]) else { return None };
            let cosine = self.point(self.angles[k]);
            let turned = self.push(Op::Mul(Operand::State(cosine + 1), change));
            results.push(self.push(Op::Neg(turned)));
            results.push(self.push(Op::Mul(Operand::State(cosine), change)));
            state.extend(self.names(k));
        }
        let points = self.points();
        drop_dead(&mut self.instructions, &mut results);
        let rate = Function {
            role: Role::Rate,
            instructions: self.instructions,
            results: state.iter().cloned().zip(results).collect(),
            ..Function::default()
        };
        let n_state = self.program.state.len();
        let program = Program { state, functions: vec![rate, points], ..self.program.clone() };
        Some(Circles { program, n_state, n_angles: self.angles.len() })
    }

    /// Cosine and sine of every angle, the pairs side by side.
    fn points(&self) -> Function {
        let mut instructions = self.rate.instructions.clone();
        let (section, mut results) = (self.last_section(), Vec::new());
        for angle in &self.angles {
            for f in [Func::Sin, Func::Cos] {
                instructions.push(Instruction { op: Op::Function(f, *angle), section, name: None });
            }
            results.extend([1, 2].map(|back| operand(instructions.len() - back)));
        }
        drop_dead(&mut instructions, &mut results);
        let names = (0..self.angles.len()).flat_map(|k| self.names(k));
        let results = names.zip(results).collect();
        Function { role: Role::Points, instructions, results, ..Function::default() }
    }
}
