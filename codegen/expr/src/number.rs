//! Real numbers in closed form: sums of rational multiples of `pi^a sqrt(n) sin(q pi)`.
//!
//! They are what structure constants are made of. Sums and products stay of this form, and whether one is zero is
//! decided in the [field](super::field), where `sqrt(n)` and `sin(q pi)` are the elements that they are among the
//! reals, and powers of `pi`, which no algebraic number ties, are looked at one by one.
//!
//! Deliberately does not know: variables, algebras.

use std::collections::BTreeMap;
use std::fmt;

use num_bigint::BigInt;
use num_integer::Integer;
use num_rational::Rational64;
use num_traits::{One, Signed, ToPrimitive, Zero};

use super::field;
use super::graph::Graph;
use super::node::{ExprId, Func, Node};
use super::rational::Rational;

/// A commutative ring with exact zeros: what entries of matrices and structure constants are taken from.
pub trait Scalar: Clone + fmt::Debug + PartialEq {
    /// Zero.
    fn zero() -> Self;
    /// One.
    fn one() -> Self;
    /// Whether it is zero.
    fn is_zero(&self) -> bool;
    /// `self + other`.
    fn plus(&self, other: &Self) -> Self;
    /// `self * other`.
    fn times(&self, other: &Self) -> Self;
    /// `-self`.
    fn negated(&self) -> Self;
    /// How it is written, and whether a minus leads.
    fn spelled(&self) -> (bool, String);

    /// `self - other`.
    fn minus(&self, other: &Self) -> Self {
        self.plus(&other.negated())
    }

    /// The element of the field of fingerprints that stands for it where zeros are looked for; none where there is no
    /// need of one, or no such element.
    fn residue(&self) -> Option<Residue>;
}

impl Scalar for Rational {
    fn zero() -> Rational {
        Zero::zero()
    }

    fn one() -> Rational {
        One::one()
    }

    fn is_zero(&self) -> bool {
        Zero::is_zero(self)
    }

    fn plus(&self, other: &Rational) -> Rational {
        self + other
    }

    fn times(&self, other: &Rational) -> Rational {
        self * other
    }

    fn negated(&self) -> Rational {
        -self
    }

    fn spelled(&self) -> (bool, String) {
        (self.is_negative(), self.abs().to_string())
    }

    fn residue(&self) -> Option<Residue> {
        // Rational numbers are compared as they are.
        None
    }
}

/// An element of the field of fingerprints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Residue(u64);

impl Scalar for Residue {
    fn zero() -> Residue {
        Residue(0)
    }

    fn one() -> Residue {
        Residue(field::ONE)
    }

    fn is_zero(&self) -> bool {
        self.0 == 0
    }

    fn plus(&self, other: &Residue) -> Residue {
        Residue(field::add(self.0, other.0))
    }

    fn times(&self, other: &Residue) -> Residue {
        Residue(field::mul(self.0, other.0))
    }

    fn negated(&self) -> Residue {
        Residue(field::negate(self.0))
    }

    fn spelled(&self) -> (bool, String) {
        (false, format!("{} (mod p)", self.0))
    }

    fn residue(&self) -> Option<Residue> {
        Some(*self)
    }
}

/// `pi^a sqrt(n) sin(q pi)` with `n` free of squares and `0 < q <= 1/2`; values of the sine that are roots of numbers
/// are written as these.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Term {
    pi: i32,
    root: u64,
    angle: Rational64,
}

impl Term {
    fn unit() -> Term {
        Term { pi: 0, root: 1, angle: half() }
    }
}

fn half() -> Rational64 {
    Rational64::new(1, 2)
}

/// A summand of a number without its rational factor: `pi^a sqrt(n) sin(angle pi)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Summand {
    pub(super) pi: i32,
    pub(super) root: u64,
    /// Numerator and denominator.
    pub(super) angle: [i64; 2],
}

/// A real number in closed form, a sum of rational multiples of `pi^a sqrt(n) sin(q pi)`.
///
/// ```
/// use hamel_expr::{Number, Scalar};
/// // 1 + 2 cos(2 pi/5) + 2 cos(4 pi/5) = 0, though no two of these are multiples of each other.
/// let cosine = |k: i64| Number::cos_pi(2 * k, 5).unwrap();
/// let sum = cosine(1).plus(&cosine(2));
/// assert!(sum.plus(&sum).plus(&Number::one()).is_zero());
/// assert!(!sum.is_zero());
/// ```
#[derive(Clone, Debug, Default)]
pub struct Number {
    terms: BTreeMap<Term, Rational>,
}

impl PartialEq for Number {
    fn eq(&self, other: &Number) -> bool {
        self.terms == other.terms || self.minus(other).is_zero()
    }
}

impl Eq for Number {}

impl From<Rational> for Number {
    fn from(q: Rational) -> Number {
        let mut number = Number::default();
        number.add_term(Term::unit(), q);
        number
    }
}

impl Number {
    /// `sin(n pi/d)`; none for angles whose sines the field of fingerprints does not have.
    pub fn sin_pi(n: i64, d: i64) -> Option<Number> {
        if d == 0 || !field::is_angle(&Rational::new(n.into(), d.into())) {
            return None;
        }
        let mut number = Number::default();
        number.add_sine(&Term::unit(), Rational64::new(n, d), One::one());
        Some(number)
    }

    /// `cos(n pi/d)`; none for angles whose cosines the field of fingerprints does not have.
    pub fn cos_pi(n: i64, d: i64) -> Option<Number> {
        Number::sin_pi(d.checked_sub(n.checked_mul(2)?)?, d.checked_mul(2)?)
    }

    /// `pi^n`.
    pub fn power_of_pi(n: i32) -> Number {
        Number { terms: BTreeMap::from([(Term { pi: n, ..Term::unit() }, One::one())]) }
    }

    /// `sqrt(q)`; none for negative numbers and those whose roots the field of fingerprints does not have.
    pub fn sqrt(q: &Rational) -> Option<Number> {
        if Zero::is_zero(q) {
            return Some(Number::default());
        }
        if !field::has_consistent_root(q) {
            return None;
        }
        // sqrt(a/b) = sqrt(a b)/b
        let mut rest = q.numer() * q.denom();
        let (mut root, mut coefficient) = (1_u64, Rational::new(BigInt::one(), q.denom().clone()));
        for prime in field::RATIONAL_SQUARES {
            let big = BigInt::from(prime);
            while rest.is_multiple_of(&big) {
                rest /= &big;
                if rest.is_multiple_of(&big) {
                    rest /= &big;
                    coefficient *= Rational::from(big.clone());
                } else {
                    root = root.checked_mul(prime)?;
                }
            }
        }
        let mut number = Number::default();
        number.add_term(Term { root, ..Term::unit() }, coefficient);
        Some(number)
    }

    /// The rational number that it is written as.
    pub fn as_rational(&self) -> Option<Rational> {
        let mut terms = self.terms.iter();
        match (terms.next(), terms.next()) {
            (None, _) => Some(Zero::zero()),
            (Some((term, q)), None) if *term == Term::unit() => Some(q.clone()),
            _ => None,
        }
    }

    /// What is added up, each with its rational factor.
    pub(super) fn summands(&self) -> impl Iterator<Item = (Summand, &Rational)> {
        self.terms.iter().map(|(term, q)| {
            let angle = [*term.angle.numer(), *term.angle.denom()];
            (Summand { pi: term.pi, root: term.root, angle }, q)
        })
    }

    /// The number that these add up to; none for an angle with the denominator zero.
    #[cfg(feature = "serde")]
    pub(super) fn of_summands(summands: Vec<(Summand, Rational)>) -> Option<Number> {
        let mut number = Number::default();
        for (Summand { pi, root, angle: [n, d] }, q) in summands {
            let angle = (d != 0).then(|| Rational64::new(n, d))?;
            number.add_sine(&Term { pi, root, ..Term::unit() }, angle, q);
        }
        Some(number)
    }

    /// `1/self` of a number with one term that is not zero.
    ///
    /// `1/sin(x) = -(2/n) sum_{j=0}^{n-1} j sin((2 j + 1) x)` where `n` is the order of `e^{2 i x}`: the sum of
    /// `j z^j` over `j < n` is `n/(z - 1)`.
    fn reciprocal(&self) -> Option<Number> {
        const MAX_ORDER: i64 = 1000;
        let (term, q) = self.terms.iter().next().filter(|_| self.terms.len() == 1)?;
        let root = Rational::from(BigInt::from(term.root));
        let outer = Term { pi: term.pi.checked_neg()?, root: term.root, angle: half() };
        let scale = (q * root).recip();
        let mut number = Number::default();
        if term.angle == half() {
            number.add_term(outer, scale);
            return Some(number);
        }
        let order = *term.angle.denom();
        if order > MAX_ORDER {
            return None;
        }
        for j in 1..order {
            let weight = &scale * Rational::new((-2 * j).into(), order.into());
            number.add_sine(&outer, term.angle * (2 * j + 1), weight);
        }
        Some(number)
    }

    /// `self^n`; none for negative powers of sums.
    fn power(&self, n: i64) -> Option<Number> {
        const MAX_POWER: u64 = 64;
        if n.unsigned_abs() > MAX_POWER {
            return None;
        }
        let base = if n < 0 { self.reciprocal()? } else { self.clone() };
        Some((0..n.unsigned_abs()).fold(<Number as Scalar>::one(), |power, _| power.times(&base)))
    }

    fn add_term(&mut self, term: Term, q: Rational) {
        if Zero::is_zero(&q) {
            return;
        }
        let entry = self.terms.entry(term.clone()).or_insert_with(<Rational as Zero>::zero);
        *entry += q;
        if Zero::is_zero(entry) {
            self.terms.remove(&term);
        }
    }

    /// Adds `q * outer * sin(angle pi)`, `outer` being without a sine.
    fn add_sine(&mut self, outer: &Term, angle: Rational64, q: Rational) {
        let two = Rational64::from_integer(2);
        let mut angle = angle - two * (angle / two).floor();
        let mut q = q;
        let half_turn = Rational64::from_integer(1);
        if angle >= half_turn {
            angle -= half_turn;
            q = -q;
        }
        if angle > half() {
            angle = half_turn - angle;
        }
        if Zero::is_zero(&angle) {
            return;
        }
        let halved = || &q / Rational::from(BigInt::from(2));
        // sin(pi/6), sin(pi/4), sin(pi/3) = sqrt(1)/2, sqrt(2)/2, sqrt(3)/2
        match (angle.numer(), angle.denom()) {
            (1, 6) => self.add_term(outer.clone(), halved()),
            (1, 4) => self.add_root(outer, 2, halved()),
            (1, 3) => self.add_root(outer, 3, halved()),
            _ => self.add_term(Term { angle, ..outer.clone() }, q),
        }
    }

    /// Adds `q * term * sqrt(n)`.
    fn add_root(&mut self, term: &Term, n: u64, q: Rational) {
        let common = term.root.gcd(&n);
        let root = (term.root / common) * (n / common);
        self.add_term(Term { root, ..term.clone() }, q * Rational::from(BigInt::from(common)));
    }

    /// Adds `q * a * b`.
    fn add_product(&mut self, a: &Term, b: &Term, q: Rational) {
        let common = a.root.gcd(&b.root);
        let q = q * Rational::from(BigInt::from(common));
        let root = (a.root / common) * (b.root / common);
        let outer = Term { pi: a.pi + b.pi, root, angle: half() };
        if a.angle == half() || b.angle == half() {
            let angle = if a.angle == half() { b.angle } else { a.angle };
            self.add_term(Term { angle, ..outer }, q);
            return;
        }
        // sin(x) sin(y) = (cos(x - y) - cos(x + y))/2, cos(x) = sin(pi/2 - x)
        let q = q / Rational::from(BigInt::from(2));
        self.add_sine(&outer, half() - (a.angle - b.angle), q.clone());
        self.add_sine(&outer, half() - (a.angle + b.angle), -q);
    }

    /// Values in the field of what stands before each power of `pi`; none where a coefficient has none.
    fn residues(&self) -> Option<BTreeMap<i32, u64>> {
        let mut residues: BTreeMap<i32, u64> = BTreeMap::new();
        for (term, q) in &self.terms {
            let root = field::power(field::integer(&term.root.into())?, &Rational::new(1.into(), 2.into()))?;
            let angle = Rational::new((*term.angle.numer()).into(), (*term.angle.denom()).into());
            let (_, sine) = field::multiple_of_pi(&angle)?;
            let value = field::mul(field::rational(q)?, field::mul(root, sine));
            let sum = residues.entry(term.pi).or_insert(0);
            *sum = field::add(*sum, value);
        }
        Some(residues)
    }
}

impl Scalar for Number {
    fn zero() -> Number {
        Number::default()
    }

    fn one() -> Number {
        <Rational as One>::one().into()
    }

    fn is_zero(&self) -> bool {
        match self.terms.len() {
            0 => true,
            1 => false,
            // A coefficient that the field tells lies about is no zero that could be relied on.
            _ => self.residues().is_some_and(|residues| residues.values().all(|value| *value == 0)),
        }
    }

    fn plus(&self, other: &Number) -> Number {
        let mut sum = self.clone();
        other.terms.iter().for_each(|(term, q)| sum.add_term(term.clone(), q.clone()));
        sum
    }

    fn times(&self, other: &Number) -> Number {
        let mut product = Number::default();
        for (a, p) in &self.terms {
            other.terms.iter().for_each(|(b, q)| product.add_product(a, b, p * q));
        }
        product
    }

    fn negated(&self) -> Number {
        Number { terms: self.terms.iter().map(|(term, q)| (term.clone(), -q)).collect() }
    }

    fn spelled(&self) -> (bool, String) {
        let leads_negative = self.terms.values().next().is_some_and(Signed::is_negative);
        let magnitude = if leads_negative { self.negated() } else { self.clone() };
        let text = magnitude.to_string();
        (leads_negative, if magnitude.terms.len() > 1 { format!("({text})") } else { text })
    }

    fn residue(&self) -> Option<Residue> {
        // Powers of pi get the powers of one element, as any number that nothing ties to the others.
        let pi = field::hash(u64::from(u32::MAX));
        let mut total = 0;
        for (n, value) in self.residues()? {
            let power = field::pow(pi, u64::from(n.unsigned_abs()));
            let power = if n < 0 { field::inverse(power)? } else { power };
            total = field::add(total, field::mul(value, power));
        }
        Some(Residue(total))
    }
}

impl fmt::Display for Number {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.terms.is_empty() {
            return f.write_str("0");
        }
        for (k, (term, q)) in self.terms.iter().enumerate() {
            f.write_str(match (k, q.is_negative()) {
                (0, false) => "",
                (0, true) => "-",
                (_, false) => " + ",
                (_, true) => " - ",
            })?;
            let mut factors = Vec::new();
            let power = |n: i32| if n == 1 { "pi".to_owned() } else { format!("pi^{n}") };
            if term.pi > 0 {
                factors.push(power(term.pi));
            }
            if term.root != 1 {
                factors.push(format!("sqrt({})", term.root));
            }
            if term.angle != half() {
                let (n, d) = (term.angle.numer(), term.angle.denom());
                let n = if *n == 1 { String::new() } else { format!("{n} ") };
                factors.push(format!("sin({n}pi/{d})"));
            }
            let size = q.abs();
            if !size.numer().is_one() || factors.is_empty() {
                factors.insert(0, size.numer().to_string());
            }
            f.write_str(&factors.join(" "))?;
            let mut below: Vec<String> = Vec::new();
            if !size.denom().is_one() {
                below.push(size.denom().to_string());
            }
            if term.pi < 0 {
                below.push(power(-term.pi));
            }
            match below.as_slice() {
                [] => {}
                [one] => write!(f, "/{one}")?,
                several => write!(f, "/({})", several.join(" "))?,
            }
        }
        Ok(())
    }
}

impl Graph {
    /// A number in closed form as an expression.
    pub fn number(&mut self, number: &Number) -> ExprId {
        let mut summands = Vec::with_capacity(number.terms.len());
        for (term, q) in &number.terms {
            let mut factors = Vec::new();
            if term.pi != 0 {
                let pi = self.pi();
                factors.push(self.powi(pi, term.pi.into()));
            }
            if term.root != 1 {
                let n = self.rational(Rational::from(BigInt::from(term.root)));
                factors.push(self.sqrt(n));
            }
            if term.angle != half() {
                let pi = self.pi();
                let (n, d) = (BigInt::from(*term.angle.numer()), BigInt::from(*term.angle.denom()));
                let angle = self.scale(pi, &Rational::new(n, d));
                factors.push(self.func(Func::Sin, angle));
            }
            summands.push((self.product(&factors), q.clone()));
        }
        self.linear_combination(&summands)
    }

    /// `number * e` as a summand of a linear combination.
    pub fn weighted(&mut self, e: ExprId, number: &Number) -> (ExprId, Rational) {
        match number.as_rational() {
            Some(q) => (e, q),
            None => {
                let weight = self.number(number);
                (self.mul(weight, e), One::one())
            }
        }
    }

    /// The number in closed form that an expression is; none for others, such as `exp(1)`, and for roots and angles
    /// that the field of fingerprints does not have.
    pub fn as_number(&self, e: ExprId) -> Option<Number> {
        // Operands precede what is made of them.
        let mut known: BTreeMap<ExprId, Number> = BTreeMap::new();
        for e in self.reachable(&[e]) {
            let value = self.number_of_node(e, &known);
            if let Some(value) = value {
                known.insert(e, value);
            }
        }
        known.remove(&e)
    }

    fn number_of_node(&self, e: ExprId, known: &BTreeMap<ExprId, Number>) -> Option<Number> {
        match self.node(e) {
            Node::Constant(c) => Some(c.clone().into()),
            Node::Pi => Some(Number::power_of_pi(1)),
            Node::Sum { constant, terms } => {
                let mut sum = Number::from(constant.clone());
                for (e, q) in terms {
                    sum = sum.plus(&known.get(e)?.times(&q.clone().into()));
                }
                Some(sum)
            }
            Node::Product { coefficient, factors } => {
                let mut product = Number::from(coefficient.clone());
                for (base, q) in factors {
                    let base = known.get(base)?;
                    let factor = if q.is_integer() {
                        base.power(q.numer().to_i64()?)?
                    } else if *q.denom() == BigInt::from(2) {
                        Number::sqrt(&base.as_rational()?)?.power(q.numer().to_i64()?)?
                    } else {
                        return None;
                    };
                    product = product.times(&factor);
                }
                Some(product)
            }
            Node::Function(f @ (Func::Sin | Func::Cos), a) => {
                let angle = known.get(a)?;
                let quotient = angle.times(&Number::power_of_pi(-1)).as_rational()?;
                let (n, d) = (quotient.numer().to_i64()?, quotient.denom().to_i64()?);
                if *f == Func::Sin { Number::sin_pi(n, d) } else { Number::cos_pi(n, d) }
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn q(n: i64, d: i64) -> Rational {
        Rational::new(n.into(), d.into())
    }

    #[test]
    fn sums_over_roots_of_unity_vanish_and_parts_of_them_do_not() {
        for n in [3, 5, 7, 9, 11, 13, 15, 21] {
            for power in 1..n {
                let terms = (0..n).map(|k| Number::cos_pi(2 * k * power, n).unwrap());
                let sum = terms.fold(Number::zero(), |sum, x| sum.plus(&x));
                assert!(sum.is_zero(), "{n}: {sum}");
                assert!(!sum.minus(&Number::one()).is_zero());
            }
            let product = (1..n).map(|k| Number::sin_pi(k, n).unwrap()).reduce(|a, b| a.times(&b)).unwrap();
            // prod sin(k pi/n) = n/2^(n - 1)
            assert_eq!(product, q(n, 1 << (n - 1)).into(), "{n}");
        }
    }

    #[test]
    fn arithmetic_agrees_with_the_graph() {
        let mut g = Graph::new();
        let numbers = [
            Number::sin_pi(2, 7).unwrap(),
            Number::cos_pi(1, 5).unwrap().times(&Number::power_of_pi(-1)),
            Number::sqrt(&q(8, 27)).unwrap(),
            Number::sin_pi(-5, 12).unwrap().plus(&q(3, 4).into()),
        ];
        for a in &numbers {
            let e = g.number(a);
            assert_eq!(g.as_number(e).as_ref(), Some(a), "{a}");
            for b in &numbers {
                let (x, y) = (g.number(a), g.number(b));
                let (product, sum) = (g.mul(x, y), g.add(x, y));
                let (own_product, own_sum) = (g.number(&a.times(b)), g.number(&a.plus(b)));
                let differences = [g.sub(product, own_product), g.sub(sum, own_sum)];
                assert!(differences.iter().all(|e| g.is_zero(*e)), "{a}, {b}");
            }
        }
    }

    #[test]
    fn what_has_one_term_has_a_reciprocal() {
        for (n, d) in [(1, 5), (2, 5), (3, 7), (1, 8), (5, 12), (4, 9), (10, 21)] {
            let sine = Number::sin_pi(n, d).unwrap();
            let inverse = sine.reciprocal().unwrap();
            assert_eq!(sine.times(&inverse), Number::one(), "{sine}: {inverse}");
        }
        let number = Number::sqrt(&q(6, 1)).unwrap().times(&Number::power_of_pi(2));
        assert_eq!(number.times(&number.reciprocal().unwrap()), Number::one());
    }

    #[test]
    fn what_is_not_in_the_field_is_no_number() {
        assert!(Number::sin_pi(1, 19).is_none());
        assert!(Number::sqrt(&q(53, 1)).is_none());
        assert!(Number::sqrt(&q(-2, 1)).is_none());
        let mut g = Graph::new();
        let one = g.one();
        let e = g.func(Func::Exp, one);
        assert!(g.as_number(e).is_none());
    }

    #[test]
    fn spelled_as_one_writes_them() {
        let number = Number::sin_pi(2, 5).unwrap().times(&Number::power_of_pi(-1)).times(&q(-5, 2).into());
        assert_eq!(number.to_string(), "-5 sin(2 pi/5)/(2 pi)");
        assert_eq!(number.spelled(), (true, "5 sin(2 pi/5)/(2 pi)".into()));
        assert_eq!(Number::cos_pi(1, 3).unwrap().to_string(), "1/2");
        assert_eq!(Number::cos_pi(1, 6).unwrap().to_string(), "sqrt(3)/2");
    }
}
