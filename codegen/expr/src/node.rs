//! Nodes of expressions and their handles.
//!
//! Deliberately does not know: the arena, values, budgets.

use std::hash::{Hash as _, Hasher as _};

use hamel_runtime::Real;
use num_integer::Integer as _;
use num_traits::{Signed, ToPrimitive};
use rustc_hash::FxHasher;

use super::rational::{MAX_BITS, Rational};

/// Handle of an expression; equal handles are equal expressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ExprId(pub(super) u32);

impl ExprId {
    /// Position in the arena; operands have smaller positions than the nodes that use them.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Handle of a symbol. Symbols are distinct even when their names are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SymbolId(pub(super) u32);

impl SymbolId {
    /// Position in the graph's symbol table.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Elementary functions of one argument. Square roots are powers with exponent 1/2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[expect(missing_docs, reason = "the variants are the functions they are named after")]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Func {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Exp,
    Ln,
    Sinh,
    Cosh,
    Tanh,
    Abs,
    /// Stumpff's function `c_k(z) = sum_j (-z)^j/(2 j + k)!`.
    Stumpff(u8),
    /// Coefficient `k` of the power series about `w` of `theta/sin(theta)`, `w = sin(theta/2)^2`.
    Turn(u8),
}

impl Func {
    /// All functions but the families `Stumpff` and `Turn`, in a fixed order.
    pub const ALL: [Func; 12] = [
        Func::Sin,
        Func::Cos,
        Func::Tan,
        Func::Asin,
        Func::Acos,
        Func::Atan,
        Func::Exp,
        Func::Ln,
        Func::Sinh,
        Func::Cosh,
        Func::Tanh,
        Func::Abs,
    ];

    /// The name in the model language and in emitted code.
    pub fn name(self) -> &'static str {
        match self {
            Func::Sin => "sin",
            Func::Cos => "cos",
            Func::Tan => "tan",
            Func::Asin => "asin",
            Func::Acos => "acos",
            Func::Atan => "atan",
            Func::Exp => "exp",
            Func::Ln => "ln",
            Func::Sinh => "sinh",
            Func::Cosh => "cosh",
            Func::Tanh => "tanh",
            Func::Abs => "abs",
            Func::Stumpff(_) => "stumpff",
            Func::Turn(_) => "turn",
        }
    }

    /// A number of its own, below 100 for all but the families, which are above 1000.
    pub(super) fn number(self) -> u64 {
        match self {
            Func::Stumpff(k) => 1000 + u64::from(k),
            Func::Turn(k) => 2000 + u64::from(k),
            other => Func::ALL.iter().position(|f| *f == other).unwrap_or_default() as u64,
        }
    }

    /// The function of that name.
    pub fn from_name(name: &str) -> Option<Func> {
        Func::ALL.into_iter().find(|f| f.name() == name)
    }

    /// The value, through the functions that emitted code calls.
    pub fn eval(self, x: f64) -> f64 {
        self.of(x)
    }

    /// The value for any scalar.
    pub fn of<R: Real>(self, x: R) -> R {
        match self {
            Func::Sin => x.sin(),
            Func::Cos => x.cos(),
            Func::Tan => x.tan(),
            Func::Asin => x.asin(),
            Func::Acos => x.acos(),
            Func::Atan => x.atan(),
            Func::Exp => x.exp(),
            Func::Ln => x.ln(),
            Func::Sinh => x.sinh(),
            Func::Cosh => x.cosh(),
            Func::Tanh => x.tanh(),
            Func::Abs => x.abs(),
            Func::Stumpff(k) => x.stumpff(k.into()),
            Func::Turn(k) => x.turn(k.into()),
        }
    }
}

/// A canonical node.
///
/// Invariants: a sum has at least two entries counting a non-zero constant, its terms are distinct, sorted, not
/// constants, not sums and have unit coefficient; a product's factors are distinct, sorted, with non-zero exponents and
/// its coefficient is non-zero; `1 * x^1` is `x` itself.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// An exact rational.
    Constant(Rational),
    /// The ratio of a circle's circumference to its diameter.
    Pi,
    /// A named unknown.
    Symbol(SymbolId),
    /// `constant + sum_k coefficient_k * term_k`.
    Sum {
        /// The constant summand, often zero.
        constant: Rational,
        /// Terms and their non-zero coefficients.
        terms: Box<[(ExprId, Rational)]>,
    },
    /// `coefficient * prod_k base_k ^ exponent_k`.
    Product {
        /// The non-zero rational factor.
        coefficient: Rational,
        /// Bases and their non-zero exponents.
        factors: Box<[(ExprId, Rational)]>,
    },
    /// An elementary function of an expression.
    Function(Func, ExprId),
    /// The angle of the point `(x, y)` in `(-pi, pi]`, given `y` and `x` in that order.
    Atan2(ExprId, ExprId),
}

impl Node {
    /// Calls `visit` on every operand.
    pub fn for_each_operand(&self, mut visit: impl FnMut(ExprId)) {
        match self {
            Node::Constant(_) | Node::Pi | Node::Symbol(_) => {}
            Node::Sum { terms: list, .. } | Node::Product { factors: list, .. } => {
                list.iter().for_each(|(e, _)| visit(*e));
            }
            Node::Function(_, argument) => visit(*argument),
            Node::Atan2(y, x) => {
                visit(*y);
                visit(*x);
            }
        }
    }

    /// How many terms or factors it has.
    pub fn n_operands(&self) -> usize {
        match self {
            Node::Constant(_) | Node::Pi | Node::Symbol(_) => 0,
            Node::Sum { terms: list, .. } | Node::Product { factors: list, .. } => list.len(),
            Node::Function(..) => 1,
            Node::Atan2(..) => 2,
        }
    }

    /// A hash of the node. That of a ratio divides like Euclid, as its terms need not be coprime; here they are.
    pub(super) fn short_hash(&self) -> u64 {
        let mut hasher = FxHasher::default();
        std::mem::discriminant(self).hash(&mut hasher);
        let rational = |q: &Rational, hasher: &mut FxHasher| {
            q.numer().hash(hasher);
            if !q.is_integer() {
                q.denom().hash(hasher);
            }
        };
        match self {
            Node::Constant(q) => rational(q, &mut hasher),
            Node::Pi => {}
            Node::Symbol(s) => s.hash(&mut hasher),
            Node::Sum { constant: q, terms: list } | Node::Product { coefficient: q, factors: list } => {
                rational(q, &mut hasher);
                for (e, q) in list {
                    e.hash(&mut hasher);
                    rational(q, &mut hasher);
                }
            }
            Node::Function(f, argument) => (f, argument).hash(&mut hasher),
            Node::Atan2(y, x) => (y, x).hash(&mut hasher),
        }
        hasher.finish()
    }
}

/// The largest number that divides all of these with whole quotients, with the sign of the first; none where it is too
/// long.
pub(super) fn content(constant: &Rational, terms: &[(ExprId, Rational)]) -> Option<Rational> {
    let magnitude = match content_of_short(constant, terms) {
        Some(magnitude) => magnitude,
        None => content_of_long(constant, terms)?,
    };
    Some(if terms.first().is_some_and(|(_, q)| q.is_negative()) { -magnitude } else { magnitude })
}

/// Their content without its sign, where all of them are short.
fn content_of_short(constant: &Rational, terms: &[(ExprId, Rational)]) -> Option<Rational> {
    let numerator = |q: &Rational| Some(q.numer().to_i64()?.unsigned_abs());
    let denominator = |q: &Rational| q.denom().to_u64();
    let (mut above, mut below) = (numerator(constant)?, denominator(constant)?);
    for (_, q) in terms {
        let (n, d) = (numerator(q)?, denominator(q)?);
        if above != 1 {
            above = above.gcd(&n);
        }
        if below != d {
            below = (below / below.gcd(&d)).checked_mul(d)?;
        }
    }
    Some(Rational::new(above.into(), below.into()))
}

/// Their content without its sign.
fn content_of_long(constant: &Rational, terms: &[(ExprId, Rational)]) -> Option<Rational> {
    let mut numerator = constant.numer().clone();
    let mut denominator = constant.denom().clone();
    for (_, q) in terms {
        numerator = numerator.gcd(q.numer());
        denominator = denominator.lcm(q.denom());
        if denominator.bits() > MAX_BITS {
            return None;
        }
    }
    Some(Rational::new(numerator, denominator))
}
