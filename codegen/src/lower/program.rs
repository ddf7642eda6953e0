//! The intermediate form: straight-line static single assignment, one operation an instruction.

use std::fmt;
use std::ops::AddAssign;

use num_traits::{One, Signed, ToPrimitive, Zero};

use crate::expr::{Func, Rational, rational_to_f64};

/// A constant of a program.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Constant {
    /// An exact rational.
    Rational(Rational),
    /// The ratio of a circle's circumference to its diameter.
    Pi,
}

/// How a constant is made from doubles, in the interpreter and in emitted code alike.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Literal {
    /// `Real::ZERO`.
    Zero,
    /// `Real::ONE`.
    One,
    /// `Real::from_f64`.
    Number(f64),
    /// `Real::ratio`: a quotient that no double holds exactly.
    Ratio(f64, f64),
    /// `Real::from_f64` of the nearest double to pi.
    Pi,
}

/// Numerators and denominators up to this size are written as a quotient; beyond it the digits say more.
const LARGEST_RATIO: u32 = 1000;

impl Constant {
    /// The form in which the constant is computed.
    pub fn literal(&self) -> Literal {
        let q = match self {
            Constant::Pi => return Literal::Pi,
            Constant::Rational(q) => q,
        };
        if q.is_zero() {
            return Literal::Zero;
        }
        if q.is_one() {
            return Literal::One;
        }
        let limit = num_bigint::BigInt::from(LARGEST_RATIO);
        let dyadic = q.denom().magnitude().count_ones() == 1;
        if !dyadic
            && q.numer().abs() <= limit
            && *q.denom() <= limit
            && let (Some(p), Some(d)) = (q.numer().to_f64(), q.denom().to_f64())
        {
            return Literal::Ratio(p, d);
        }
        Literal::Number(rational_to_f64(q))
    }

    /// The nearest double.
    pub fn to_f64(&self) -> f64 {
        match self {
            Constant::Pi => std::f64::consts::PI,
            Constant::Rational(q) => rational_to_f64(q),
        }
    }
}

/// An operand of an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Operand {
    /// Result of an earlier instruction of the same list.
    Value(u32),
    /// Entry of [`Program::constants`].
    Constant(u32),
    /// A parameter.
    Param(u32),
    /// A prepared slot; not in the prepare part itself.
    Slot(u32),
    /// Time; not in the prepare part.
    Time,
    /// A component of the state; not in the prepare part.
    State(u32),
}

/// An operation on operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Op {
    /// `a + b`.
    Add(Operand, Operand),
    /// `a - b`.
    Sub(Operand, Operand),
    /// `a * b`.
    Mul(Operand, Operand),
    /// `a / b`.
    Div(Operand, Operand),
    /// `-a`.
    Neg(Operand),
    /// `1 / a`.
    Recip(Operand),
    /// Square root.
    Sqrt(Operand),
    /// `a^q = exp(q ln a)` with a constant `q` whose denominator is no small power of two, and `a > 0`.
    Power(Operand, Operand),
    /// An elementary function.
    Function(Func, Operand),
}

impl Op {
    /// Operands in order.
    pub fn operands(&self) -> impl Iterator<Item = Operand> + use<> {
        let (a, b) = match *self {
            Op::Add(a, b) | Op::Sub(a, b) | Op::Mul(a, b) | Op::Div(a, b) | Op::Power(a, b) => (a, Some(b)),
            Op::Neg(a) | Op::Recip(a) | Op::Sqrt(a) | Op::Function(_, a) => (a, None),
        };
        std::iter::once(a).chain(b)
    }

    /// The same operation on other operands.
    pub(super) fn map(self, mut f: impl FnMut(Operand) -> Operand) -> Op {
        match self {
            Op::Add(a, b) => Op::Add(f(a), f(b)),
            Op::Sub(a, b) => Op::Sub(f(a), f(b)),
            Op::Mul(a, b) => Op::Mul(f(a), f(b)),
            Op::Div(a, b) => Op::Div(f(a), f(b)),
            Op::Power(a, b) => Op::Power(f(a), f(b)),
            Op::Neg(a) => Op::Neg(f(a)),
            Op::Recip(a) => Op::Recip(f(a)),
            Op::Sqrt(a) => Op::Sqrt(f(a)),
            Op::Function(g, a) => Op::Function(g, f(a)),
        }
    }
}

/// One operation, with its place and name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// The operation.
    pub op: Op,
    /// Position in [`Program::sections`] of the section that first needs it; always 0 in the prepare part.
    pub section: u32,
    /// Name of the definition whose value this is.
    pub name: Option<String>,
}

/// A value that depends on parameters alone and that some function reads.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Slot {
    /// The instruction of the prepare part that computes it.
    pub value: u32,
    /// Name of the definition whose value it is.
    pub name: Option<String>,
}

/// Relation of a [`Condition`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Relation {
    /// `greater > less`.
    Greater,
    /// `greater >= less`.
    GreaterEqual,
    /// `greater != less`.
    NotEqual,
}

/// A condition on parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Condition {
    /// As the model words it.
    pub text: String,
    /// Left-hand side.
    pub greater: Operand,
    /// Right-hand side.
    pub less: Operand,
    /// How they compare.
    pub relation: Relation,
}

/// The part that depends on parameters alone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Prepare {
    /// Straight-line code over parameters and constants.
    pub instructions: Vec<Instruction>,
    /// The values kept for the functions.
    pub slots: Vec<Slot>,
    /// What has to hold, besides every parameter being finite.
    pub conditions: Vec<Condition>,
}

/// A function of parameters, time and state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// Its name.
    pub name: String,
    /// Straight-line code; sections ascend.
    pub instructions: Vec<Instruction>,
    /// Names and values of the results.
    pub results: Vec<(String, Operand)>,
}

/// Everything one scene computes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    /// Names of the parameters.
    pub params: Vec<String>,
    /// Name of the time.
    pub time: String,
    /// Names of the state's components.
    pub state: Vec<String>,
    /// Distinct constants.
    pub constants: Vec<Constant>,
    /// Titles of the sections; the last one, `results`, holds what no definition needs.
    pub sections: Vec<String>,
    /// The part that depends on parameters alone.
    pub prepare: Prepare,
    /// The functions in the order they were requested.
    pub functions: Vec<Function>,
}

/// Numbers of operations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Additions and subtractions.
    pub add: usize,
    /// Multiplications.
    pub mul: usize,
    /// Divisions and reciprocals.
    pub div: usize,
    /// Negations.
    pub neg: usize,
    /// Square roots.
    pub sqrt: usize,
    /// Sines, cosines, exponentials, powers and so on.
    pub transcendental: usize,
}

impl Counts {
    fn of<'a>(instructions: impl IntoIterator<Item = &'a Instruction>) -> Counts {
        let mut counts = Counts::default();
        for instruction in instructions {
            *match instruction.op {
                Op::Add(..) | Op::Sub(..) => &mut counts.add,
                Op::Mul(..) => &mut counts.mul,
                Op::Div(..) | Op::Recip(_) => &mut counts.div,
                Op::Neg(_) | Op::Function(Func::Abs, _) => &mut counts.neg,
                Op::Sqrt(_) => &mut counts.sqrt,
                Op::Power(..) | Op::Function(..) => &mut counts.transcendental,
            } += 1;
        }
        counts
    }

    /// All operations.
    pub fn total(&self) -> usize {
        self.add + self.mul + self.div + self.neg + self.sqrt + self.transcendental
    }

    /// Rough cost: additions and multiplications count 2, signs 1, divisions and roots 8, functions 40.
    pub fn cost(&self) -> u64 {
        (2 * (self.add + self.mul) + self.neg + 8 * (self.div + self.sqrt) + 40 * self.transcendental) as u64
    }
}

impl AddAssign for Counts {
    fn add_assign(&mut self, other: Counts) {
        self.add += other.add;
        self.mul += other.mul;
        self.div += other.div;
        self.neg += other.neg;
        self.sqrt += other.sqrt;
        self.transcendental += other.transcendental;
    }
}

impl fmt::Display for Counts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let parts = [
            (self.add, "additions", "addition"),
            (self.mul, "multiplications", "multiplication"),
            (self.div, "divisions", "division"),
            (self.neg, "sign changes", "sign change"),
            (self.sqrt, "square roots", "square root"),
            (self.transcendental, "elementary functions", "elementary function"),
        ];
        let mut first = true;
        for (n, many, one) in parts {
            if n > 0 {
                write!(f, "{}{n} {}", if first { "" } else { ", " }, if n == 1 { one } else { many })?;
                first = false;
            }
        }
        if first { f.write_str("no operations") } else { Ok(()) }
    }
}

impl Prepare {
    /// Operations of the part that runs once.
    pub fn counts(&self) -> Counts {
        Counts::of(&self.instructions)
    }
}

impl Function {
    /// Operations of one call.
    pub fn counts(&self) -> Counts {
        Counts::of(&self.instructions)
    }

    /// Operations of one call that belong to a section.
    pub fn counts_of_section(&self, section_idx: usize) -> Counts {
        Counts::of(self.instructions.iter().filter(|i| i.section as usize == section_idx))
    }
}

impl Program {
    /// Rough cost of calling every function once.
    pub fn cost(&self) -> u64 {
        self.functions.iter().map(|f| f.counts().cost()).sum()
    }

    /// Position of the function of that name.
    pub fn function_idx(&self, name: &str) -> Option<usize> {
        self.functions.iter().position(|f| f.name == name)
    }
}
