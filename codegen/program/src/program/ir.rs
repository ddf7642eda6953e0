//! The data of a program: straight-line static single assignment, one operation an instruction, and loops after it.
//!
//! Does not know: what a program is for, how its operations are executed or written.

use num_traits::{One, Signed, ToPrimitive, Zero};

use super::report::Report;
use super::role::Role;
use super::table::{Contraction, Table};
use hamel_expr::{Func, Rational, Relation, rational_to_f64};

/// A constant of a program.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Constant {
    /// An exact rational.
    Rational(#[cfg_attr(feature = "serde", serde(with = "super::text"))] Rational),
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    /// An input; not in the prepare part.
    Input(u32),
    /// A component of the state; not in the prepare part.
    State(u32),
    /// A component of the function's own vector besides time and state; see [`Function::argument`].
    Argument(u32),
    /// A result of a contraction, counted through all of [`Function::contractions`]; in results alone.
    Contracted(u32),
}

/// An operation on operands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
    /// The angle of the point `(b, a)` in `(-pi, pi]`.
    Atan2(Operand, Operand),
    /// `a * b + c` with signs: rounded once where the target has the instruction, twice elsewhere.
    MulAdd(Signs, Operand, Operand, Operand),
    /// What rounding leaves out of `a + b`; zero as a formula.
    SumError(Operand, Operand),
    /// What rounding leaves out of `a * b`; zero as a formula.
    ProductError(Operand, Operand),
    /// Half of what rounding leaves out of `1 - a^2 - b^2`, of a sine and the cosine of the same angle; zero as a
    /// formula.
    CircleError(Operand, Operand),
}

/// Which terms of [`Op::MulAdd`] are negated; hardware does it for nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Signs {
    /// `-(a * b)`.
    pub product: bool,
    /// `-c`.
    pub addend: bool,
}

impl Op {
    /// Operands in order.
    pub fn operands(&self) -> impl Iterator<Item = Operand> + use<> {
        let (a, b, c) = match *self {
            Op::Add(a, b)
            | Op::Sub(a, b)
            | Op::Mul(a, b)
            | Op::Div(a, b)
            | Op::Power(a, b)
            | Op::Atan2(a, b)
            | Op::SumError(a, b)
            | Op::ProductError(a, b)
            | Op::CircleError(a, b) => (a, Some(b), None),
            Op::Neg(a) | Op::Recip(a) | Op::Sqrt(a) | Op::Function(_, a) => (a, None, None),
            Op::MulAdd(_, a, b, c) => (a, Some(b), Some(c)),
        };
        std::iter::once(a).chain(b).chain(c)
    }

    /// The same operation on other operands.
    pub fn map(self, mut f: impl FnMut(Operand) -> Operand) -> Op {
        match self {
            Op::Add(a, b) => Op::Add(f(a), f(b)),
            Op::Sub(a, b) => Op::Sub(f(a), f(b)),
            Op::Mul(a, b) => Op::Mul(f(a), f(b)),
            Op::Div(a, b) => Op::Div(f(a), f(b)),
            Op::Power(a, b) => Op::Power(f(a), f(b)),
            Op::Atan2(a, b) => Op::Atan2(f(a), f(b)),
            Op::SumError(a, b) => Op::SumError(f(a), f(b)),
            Op::ProductError(a, b) => Op::ProductError(f(a), f(b)),
            Op::CircleError(a, b) => Op::CircleError(f(a), f(b)),
            Op::Neg(a) => Op::Neg(f(a)),
            Op::Recip(a) => Op::Recip(f(a)),
            Op::Sqrt(a) => Op::Sqrt(f(a)),
            Op::Function(g, a) => Op::Function(g, f(a)),
            Op::MulAdd(signs, a, b, c) => Op::MulAdd(signs, f(a), f(b), f(c)),
        }
    }
}

/// One operation, with its place and name.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Slot {
    /// The instruction of the prepare part that computes it.
    pub value: u32,
    /// Name of the definition whose value it is.
    pub name: Option<String>,
}

/// A condition on parameters.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Condition {
    /// As the model words it.
    pub text: String,
    /// What it means; may be empty.
    pub meaning: String,
    /// Left-hand side.
    pub greater: Operand,
    /// Right-hand side.
    pub less: Operand,
    /// How they compare.
    pub relation: Relation,
}

/// The part that depends on parameters alone.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Prepare {
    /// Straight-line code over parameters and constants.
    pub instructions: Vec<Instruction>,
    /// The values kept for the functions.
    pub slots: Vec<Slot>,
    /// What has to hold, besides every parameter being finite.
    pub conditions: Vec<Condition>,
}

/// A function of parameters, time and state.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Function {
    /// What the function is for.
    pub role: Role,
    /// Names of the components of the vector that it takes besides time and state; mostly none.
    pub argument: Vec<String>,
    /// Straight-line code; sections ascend.
    pub instructions: Vec<Instruction>,
    /// Values that contractions take as factors, besides the vectors that there are anyway.
    pub scalars: Vec<Operand>,
    /// Sums of products over tables, in order, after the straight-line code.
    pub contractions: Vec<Contraction>,
    /// Names and values of the results.
    pub results: Vec<(String, Operand)>,
}

impl Function {
    /// What is read of the straight-line code and of what does not change in a call: the results, then the scalars.
    pub fn outputs(&self) -> impl Iterator<Item = Operand> + Clone + '_ {
        self.results.iter().map(|(_, o)| *o).chain(self.scalars.iter().copied())
    }

    /// The number among all results of contractions of the first result of one.
    pub fn start_of_contraction(&self, k: usize) -> usize {
        self.contractions.iter().take(k).map(|c| c.n_results).sum()
    }

    /// The contraction and the place among its results of a number among all results of contractions.
    pub fn contracted(&self, i: u32) -> (usize, usize) {
        let (mut k, mut i) = (0, i as usize);
        while let Some(contraction) = self.contractions.get(k).filter(|c| c.n_results <= i) {
            i -= contraction.n_results;
            k += 1;
        }
        (k, i)
    }

    /// The contraction whose results are the first `n` of the function, all of them in order.
    pub fn contraction_of_first_results(&self, n: usize) -> Option<usize> {
        let is_whole = |k: &usize| {
            let start = self.start_of_contraction(*k);
            let numbers = (start..start + n).map(|i| Operand::Contracted(i as u32));
            self.contractions[*k].n_results == n && self.results.iter().take(n).map(|(_, o)| *o).eq(numbers)
        };
        (0..self.contractions.len()).find(is_whole)
    }

    /// Whether a result reads the time; that of a contraction where anything in the function does.
    pub fn reads_time(&self, result: usize) -> bool {
        let mut reads: Vec<bool> = Vec::with_capacity(self.instructions.len());
        let is_of = |reads: &[bool], operand: Operand| match operand {
            Operand::Time => true,
            Operand::Value(k) => reads[k as usize],
            Operand::Contracted(_) => reads.contains(&true) || self.scalars.contains(&Operand::Time),
            _ => false,
        };
        for instruction in &self.instructions {
            let is_read = instruction.op.operands().into_iter().any(|operand| is_of(&reads, operand));
            reads.push(is_read);
        }
        is_of(&reads, self.results[result].1)
    }

    /// Whether some of its values are pairs, each with what rounding left out of it.
    pub fn carries_errors(&self) -> bool {
        let is_error = |op: Op| matches!(op, Op::SumError(..) | Op::ProductError(..) | Op::CircleError(..));
        self.instructions.iter().any(|instruction| is_error(instruction.op))
    }

    /// Puts another operand in the place of each of [`Function::outputs`].
    pub fn map_outputs(&mut self, mut f: impl FnMut(Operand) -> Operand) {
        self.results.iter_mut().map(|(_, o)| o).chain(&mut self.scalars).for_each(|o| *o = f(*o));
    }
}

/// Everything one scene computes.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Program {
    /// Names of the parameters.
    pub params: Vec<String>,
    /// Name of the time.
    pub time: String,
    /// Names of the inputs, and the values that they are held at where none are given.
    pub inputs: Vec<(String, Constant)>,
    /// Names of the state's components.
    pub state: Vec<String>,
    /// Distinct constants.
    pub constants: Vec<Constant>,
    /// Tables of products that contractions of functions run through.
    pub tables: Vec<Table>,
    /// Titles of the sections; the last one, `results`, holds what no definition needs.
    pub sections: Vec<String>,
    /// The part that depends on parameters alone.
    pub prepare: Prepare,
    /// The functions in the order they were requested.
    pub functions: Vec<Function>,
    /// What became of the searches for the cheapest form of the functions.
    pub report: Report,
}

/// Whether the instruction at `k` is the cosine of the angle whose sine the one before it computes.
///
/// Such a pair is one call: it is emitted as `x.sin_cos()`, which equals the sine and the cosine bit for bit.
pub fn completes_pair(instructions: &[Instruction], k: usize) -> bool {
    match instructions[k].op {
        Op::Function(Func::Cos, x) => k > 0 && instructions[k - 1].op == Op::Function(Func::Sin, x),
        _ => false,
    }
}

/// Which of two neighbouring pairs of sine and cosine the one whose sine is at `k` is: 0 or 1; none where it has no
/// neighbour.
///
/// Such neighbours are one call: they are emitted as `x.sin_cos_of_two(y)`, which has the bits of `x.sin_cos()` and of
/// `y.sin_cos()`.
pub fn place_of_two(instructions: &[Instruction], k: usize) -> Option<usize> {
    let is_pair = |k: usize| k + 1 < instructions.len() && completes_pair(instructions, k + 1);
    let is_two = |first: usize| {
        let second = first + 2;
        let angle = instructions.get(second).map(|i| i.op.operands().next());
        is_pair(first)
            && is_pair(second)
            && instructions[first].section == instructions[second].section
            && !matches!(angle, Some(Some(Operand::Value(v))) if v as usize >= first)
    };
    // Neighbours are taken from the start of a run of pairs.
    let mut first = k;
    while first >= 2 && is_pair(first - 2) {
        first -= 2;
    }
    while first <= k {
        match is_two(first) {
            true if k <= first + 2 => return Some((k - first) / 2),
            true => first += 4,
            false => first += 2,
        }
    }
    None
}

impl Program {
    /// Position of the function in that role.
    pub fn function_idx(&self, role: &Role) -> Option<usize> {
        self.functions.iter().position(|f| f.role == *role)
    }

    /// The function in that role.
    pub fn function(&self, role: &Role) -> Option<&Function> {
        self.functions.iter().find(|f| f.role == *role)
    }
}
