//! What is known about the values of expressions: the data behind fingerprints, independence and the zero test.
//!
//! Deliberately does not know: how any of it is found out, zero tests.

use num_traits::One;
use rustc_hash::FxHashMap;

use super::field::{self, Point};
use super::node::{ExprId, Node};
use super::rational::Rational;

/// Number of the points at which every expression gets a value when it is made.
pub(crate) const POINTS: usize = 8;

/// Number of further points, for verdicts that the first points leave open.
pub(super) const FURTHER: usize = 64;

/// Values at the random points; `None` where the expression has none.
pub type Fingerprint = [Option<u64>; POINTS];

/// Why a value other than zero may prove nothing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Doubts {
    /// A value behind the expression does not respect the relations of its function.
    pub(super) opaque: bool,
    /// The sign of a value behind the expression is not known, and stood for by an opaque value.
    pub(super) signed: bool,
}

impl Doubts {
    pub(super) fn and(self, other: Doubts) -> Doubts {
        Doubts { opaque: self.opaque || other.opaque, signed: self.signed || other.signed }
    }
}

/// What is known about "is this zero everywhere".
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vanishing {
    /// It vanishes identically: structurally, by exact expansion, or by its values, with a chance of error below
    /// `1e-28` for functions and `5e-19` for numbers.
    Zero,
    /// Proved: it does not vanish identically.
    NonZero,
    /// Neither could be proved.
    Unknown,
}

/// What has an unknown sign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum UnknownSign {
    /// A factor of the argument of an absolute value.
    OfFactor(ExprId),
    /// The root of a base.
    OfRoot(ExprId),
}

/// Signs, `true` for minus.
pub(super) type Signs = FxHashMap<UnknownSign, bool>;

/// Coefficients of the terms of arguments may carry denominators dividing this; other arguments are opaque. Small
/// fractions, and decimal numbers of four digits behind the point.
pub(super) const DENOMINATOR: i64 = 16 * 9 * 625 * 7 * 11 * 13;

/// The terms that every graph knows.
pub(super) const UNIT: u32 = 0;

pub(super) const PI: u32 = 1;

/// Number of expressions whose values at the further points are remembered.
pub(super) const MAX_REMEMBERED: usize = 20_000;

/// What is known about a base of roots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Base {
    /// The field's root respects all relations that the function's root has.
    Free,
    /// It does, or its opposite.
    UpToSign,
    /// The field's root is not to be used.
    Opaque,
}

/// A logarithm's argument: `prod_k prime_k^n_k prod_k (base_k/c_k)^q_k exp(sum_k q_k exponent_k)`.
#[derive(Clone, Debug, Default)]
pub(super) struct Parts {
    pub(super) primes: Vec<(u64, i64)>,
    /// Each with the number that it is a multiple of.
    pub(super) bases: Vec<(ExprId, Rational, Rational)>,
    pub(super) exponents: Vec<(ExprId, Rational)>,
    /// Whether nothing ties the logarithms of the bases.
    pub(super) are_free: bool,
}

/// What stands for a term `a` at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Scale {
    /// Cosine and sine of `a/DENOMINATOR`.
    pub(super) point: Point,
    /// `exp(a/DENOMINATOR)`.
    pub(super) growth: u64,
    /// Cosine and sine of `a`.
    pub(super) whole_point: Point,
    /// `exp(a)`.
    pub(super) whole_growth: u64,
}

/// Something that arguments are combinations of.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) enum Term {
    /// An expression; [`UNIT`] and [`PI`] are also kept so, and never looked at.
    Expr(ExprId),
    /// A product with the coefficient one, which need not be in the arena.
    Product(Box<[(ExprId, Rational)]>),
}

impl Term {
    pub(super) fn node(&self) -> Option<Node> {
        match self {
            Term::Expr(_) => None,
            Term::Product(factors) => {
                Some(Node::Product { coefficient: Rational::one(), factors: factors.clone() })
            }
        }
    }
}

#[derive(Clone, Debug)]
pub(super) struct Generator {
    pub(super) term: Term,
    /// What determines the value of a product.
    pub(super) behind: Vec<ExprId>,
    /// Of a term `ln base`.
    pub(super) logarithm_of: Option<ExprId>,
    /// A product of symbols: all of them are independent.
    pub(super) is_monomial: bool,
    /// Whether its values show that nothing ties it; those that hide a sign do not.
    pub(super) is_proved: bool,
    /// At the first points; none where the values depend on signs that are not known.
    pub(super) scales: Option<Box<[Option<Scale>; POINTS]>>,
}

/// A combination of terms.
pub(super) type Terms = Vec<(u32, Rational)>;

/// A base that nothing ties to others.
#[derive(Clone, Debug)]
pub(super) struct FreeBase {
    pub(super) values: Vec<Option<u64>>,
    /// Where the value is no square, of the points where there is one.
    pub(super) is_no_square: u64,
    pub(super) is_valid: u64,
}

/// Everything learnt about the functions of a graph.
#[derive(Clone, Debug)]
pub(super) struct Knowledge {
    pub(super) generators: Vec<Generator>,
    pub(super) terms: FxHashMap<Term, Option<Terms>>,
    pub(super) arguments: FxHashMap<ExprId, Option<Terms>>,
    /// Of arguments of Stumpff's functions that are squares the roots, as combinations of terms.
    pub(super) roots: FxHashMap<ExprId, Option<Terms>>,
    pub(super) bases: FxHashMap<ExprId, Base>,
    pub(super) free_bases: Vec<FreeBase>,
    pub(super) logarithms: FxHashMap<ExprId, Option<Parts>>,
    pub(super) free_logarithms: Vec<FreeBase>,
    pub(super) further: FxHashMap<ExprId, Box<[Option<u64>]>>,
}

impl Knowledge {
    /// `unit` and `pi` are expressions of the graph.
    pub(super) fn new() -> Knowledge {
        Knowledge {
            generators: Vec::new(),
            terms: FxHashMap::default(),
            arguments: FxHashMap::default(),
            roots: FxHashMap::default(),
            bases: FxHashMap::default(),
            free_bases: Vec::new(),
            logarithms: FxHashMap::default(),
            free_logarithms: Vec::new(),
            further: FxHashMap::default(),
        }
    }

    /// An argument as a combination of terms; none of one that is opaque.
    pub(super) fn argument(&self, a: ExprId) -> Option<&Terms> {
        self.arguments.get(&a)?.as_ref()
    }

    /// The root of a square as a combination of terms; none of what is no square, or of which that is not known.
    pub(super) fn root(&self, square: ExprId) -> Option<&Terms> {
        self.roots.get(&square)?.as_ref().filter(|terms| self.is_angle(terms))
    }

    /// Whether sine and cosine of a combination of terms have values: its multiple of pi is an angle of the field.
    pub(super) fn is_angle(&self, terms: &Terms) -> bool {
        terms.iter().all(|(k, q)| *k != PI || field::is_angle(q))
    }

    /// Whether nothing ties a term to those before it.
    pub(super) fn is_proved(&self, k: u32) -> bool {
        k == UNIT || k == PI || self.generators.get(k as usize).is_some_and(|g| g.is_proved)
    }

    pub(super) fn logarithm(&self, a: ExprId) -> Option<&Parts> {
        self.logarithms.get(&a)?.as_ref()
    }

    /// What is known about a base that has a power of even denominator in the graph.
    pub(super) fn base(&self, base: ExprId) -> Base {
        self.bases.get(&base).copied().unwrap_or(Base::Opaque)
    }

    /// The base of a term that is a logarithm.
    pub(super) fn logarithm_term(&self, k: u32) -> Option<ExprId> {
        self.generators.get(k as usize)?.logarithm_of
    }

    /// What stands for a term at a point, if that is remembered.
    pub(super) fn scale(&self, k: u32, point: usize) -> Option<Option<Scale>> {
        self.generators.get(k as usize)?.scales.as_ref()?.get(point).copied()
    }

    /// Visits what determines the value of a term.
    pub(super) fn behind_term(&self, k: u32, visit: &mut impl FnMut(ExprId)) {
        if k == UNIT || k == PI {
            return;
        }
        let generator = &self.generators[k as usize];
        match (&generator.term, generator.logarithm_of) {
            // The exponential of a logarithm is a power of its argument.
            (Term::Expr(e), base) => {
                visit(*e);
                base.into_iter().for_each(visit);
            }
            // Also of roots of products.
            (Term::Product(_), _) => generator.behind.iter().for_each(|e| visit(*e)),
        }
    }

    /// The factors of a term that is a product.
    pub(super) fn factors_of_term(&self, k: u32) -> impl Iterator<Item = &(ExprId, Rational)> {
        let factors: &[(ExprId, Rational)] = match self.generators.get(k as usize).map(|g| &g.term) {
            Some(Term::Product(factors)) => factors,
            _ => &[],
        };
        factors.iter()
    }

    /// The value of a term, given those of expressions and of a node.
    pub(super) fn term_value(
        &self,
        k: u32,
        at: impl Fn(ExprId) -> Option<u64>,
        of_node: impl Fn(&Node) -> Option<u64>,
    ) -> Option<u64> {
        match &self.generators.get(k as usize)?.term {
            Term::Expr(e) => at(*e),
            term @ Term::Product(_) => of_node(&term.node()?),
        }
    }

    /// Values at the further points.
    pub(super) fn further(&self, e: ExprId) -> Option<&[Option<u64>]> {
        self.further.get(&e).map(|values| &**values)
    }

    /// Whether there was room for them.
    pub(super) fn remember_further(&mut self, e: ExprId, values: Vec<Option<u64>>) -> bool {
        let has_room = self.further.len() < MAX_REMEMBERED;
        if has_room {
            self.further.insert(e, values.into());
        }
        has_room
    }
}
