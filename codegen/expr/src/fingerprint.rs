//! Values of expressions at random points of a prime field: what they prove, and what they leave open.
//!
//! The map from expressions to the [field](super::field) sends every symbol to a random element, independently at each
//! of [`POINTS`] points, and sums, products and powers to those of the field. It respects the relations between
//! functions:
//!
//! * `exp`, `sin`, `cos` and hyperbolic functions are characters of their argument, written as a combination of terms
//!   that no combination with rational coefficients ties to each other or to a constant. Then their values are tied
//!   by nothing but the addition theorems (Ax, On Schanuel's conjectures, 1971), and each term is free to get a
//!   random point of the circle, and a random power. Multiples of pi are exact points of the circle.
//! * Stumpff's functions `c_k(x^2)` are made of sine and cosine of `x`, and get their values. Of what is not seen to be
//!   a square they are opaque, with all relations between the functions of one argument.
//! * `theta/sin(theta)` as a function of `sin(theta/2)^2` and its derivatives are opaque, with all relations between
//!   the functions of one argument.
//! * A root is the field's own root, a square. Roots of bases of which no product is a square are tied by
//!   nothing but their squares (Kummer).
//! * `ln` turns products into sums, and undoes `exp`; logarithms of bases of which no product is constant are free.
//!
//! That nothing ties them is [proved](super::independence), not presumed. Where all of this holds, an expression that
//! vanishes has the value zero, and **a value other than zero proves that it does not vanish**. (Between numbers such
//! as `e`, `pi` and `ln 2` no relations are presumed but those known: Schanuel's conjecture.) What it does not hold
//! for is marked: values of `asin`, `acos`, `atan`, `atan2` and of what could not be tied are
//! [opaque](Doubts::opaque), a function of their argument's values, and prove nothing; `abs`, and roots of what may
//! be a square already, are known [up to their sign](Doubts::signed), and are looked into for all signs when it
//! matters. A point at which a denominator vanishes or a root does not exist is void; where
//! roots leave too few, the [extension](super::extension) of the field has them.
//!
//! Two different functions of total degree `d` agree at one random point with probability at most `d/p` (Schwartz,
//! 1980; Zippel, 1979), provided that `p` divides no number that matters. A sine counts as `2 DENOMINATOR` here, as
//! angles are multiples of a fraction of their terms. With four valid points and a degree of 1000 in sines a false
//! zero has probability below `1e-28`. Between numbers alone points do not differ, and the chance is that of `p`,
//! `5e-19`.

use num_bigint::BigInt;
use num_traits::{Signed, ToPrimitive};
use rustc_hash::FxHashSet;

use super::arena::Arena;
use super::field;
use super::knowledge::{
    Base, DENOMINATOR, Doubts, FURTHER, Fingerprint, PI, POINTS, Scale, Signs, Terms, UNIT, UnknownSign,
};
use super::node::{ExprId, Func, Node};
use super::rational::Rational;

/// Expressions with more nodes behind them get no values at the further points.
const MAX_NODES: usize = 4000;

/// A value determined by `key` and the point.
fn random(key: u64, point: usize) -> u64 {
    field::hash(field::hash(key).wrapping_mul(2 * (POINTS + FURTHER) as u64 + 1).wrapping_add(point as u64))
}

/// An opaque function of values: equal arguments give equal values.
fn opaque(tag: u64, argument: u64) -> u64 {
    field::hash(field::hash(tag) ^ argument)
}

/// Tags of opaque functions, besides the functions of one argument, which have their numbers.
const ROOT: u64 = 100;

const CIRCLE: u64 = 101;

const GROWTH: u64 = 102;

const LOGARITHM: u64 = 103;

const ARCTANGENT: u64 = 104;

const CONIC: u64 = 105;

/// The point of the circle and the power that a term gets for an angle of `1/DENOMINATOR` of its value.
pub(super) fn scale(value: u64) -> Scale {
    let (point, root) = (field::point(opaque(CIRCLE, value)), opaque(GROWTH, value));
    let growth = field::mul(root, root);
    let steps = DENOMINATOR as u64;
    Scale {
        point,
        growth,
        whole_point: field::times(point, DENOMINATOR),
        whole_growth: field::pow(growth, steps),
    }
}

/// `n` of `1/DENOMINATOR`s that a coefficient has.
pub(super) fn steps(q: &Rational) -> Option<i64> {
    let scaled = q * Rational::from(BigInt::from(DENOMINATOR));
    scaled.is_integer().then(|| field::small_exponent(scaled.numer())).flatten()
}

/// Values of operands at a point.
pub(super) type Operands<'a> = dyn Fn(ExprId) -> Option<u64> + 'a;

impl Arena {
    /// The expressions whose values determine that of a node: those behind definitions and arguments.
    pub(super) fn behind(&self, node: &Node, mut visit: impl FnMut(ExprId)) {
        let knowledge = self.knowledge();
        match node {
            Node::Symbol(s) => self.definition(*s).into_iter().for_each(visit),
            Node::Function(Func::Ln, a) => match knowledge.logarithm(*a) {
                Some(parts) => {
                    parts.bases.iter().for_each(|(e, ..)| visit(*e));
                    parts.exponents.iter().for_each(|(e, _)| visit(*e));
                }
                None => visit(*a),
            },
            Node::Function(f, a) if is_character(*f) => match knowledge.argument(*a) {
                Some(terms) => terms.iter().for_each(|(k, _)| knowledge.behind_term(*k, &mut visit)),
                None => visit(*a),
            },
            Node::Function(Func::Stumpff(_), square) => {
                visit(*square);
                let root = knowledge.root(*square).into_iter().flatten();
                root.for_each(|(k, _)| knowledge.behind_term(*k, &mut visit));
            }
            Node::Product { factors, .. } => {
                for (base, q) in factors {
                    visit(*base);
                    if has_even_denominator(q) {
                        self.factors_of_base(*base).into_iter().flatten().for_each(|(e, _)| visit(*e));
                    }
                }
            }
            _ => node.for_each_operand(visit),
        }
    }

    /// The factors of a base of roots that is a product, also by the name of one.
    pub(super) fn factors_of_base(&self, base: ExprId) -> Option<&[(ExprId, Rational)]> {
        match self.node(self.named(base)) {
            Node::Product { factors, .. } => Some(factors),
            _ => None,
        }
    }

    /// What a name stands for; other expressions themselves.
    pub(super) fn named(&self, mut e: ExprId) -> ExprId {
        while let Node::Symbol(s) = self.node(e)
            && let Some(definition) = self.definition(*s)
        {
            e = definition;
        }
        e
    }

    /// The value of a node at a point, from those of what is [behind](Arena::behind) it.
    pub(super) fn value_of(
        &self,
        node: &Node,
        point: usize,
        at: &Operands<'_>,
        signs: Option<&Signs>,
    ) -> Option<u64> {
        match node {
            Node::Constant(c) => field::rational(c),
            Node::Pi => Some(random(u64::MAX, point)),
            Node::Symbol(s) => match self.definition(*s) {
                Some(definition) => at(definition),
                None => Some(random(s.index() as u64, point)),
            },
            Node::Sum { constant, terms } => {
                let mut total = field::rational(constant)?;
                for (e, q) in terms {
                    total = field::add(total, field::mul(field::rational(q)?, at(*e)?));
                }
                Some(total)
            }
            Node::Product { coefficient, factors } => {
                let mut total = field::rational(coefficient)?;
                for (e, q) in factors {
                    total = field::mul(total, self.power_at(*e, q, at, signs)?);
                }
                Some(total)
            }
            Node::Function(Func::Ln, a) => self.logarithm_at(*a, point, at),
            Node::Function(f, a) if is_character(*f) => self.character_at(*f, *a, point, at, signs),
            Node::Function(Func::Abs, a) => {
                let value = at(*a)?;
                match signs {
                    None => Some(opaque(Func::Abs.number(), field::mul(value, value))),
                    Some(signs) => {
                        let (mut negative, factors) = self.factors_with_signs(*a);
                        factors.iter().for_each(|e| negative ^= signs[&UnknownSign::OfFactor(*e)]);
                        Some(if negative { field::negate(value) } else { value })
                    }
                }
            }
            Node::Function(Func::Stumpff(k), square) => self.stumpff_at(*k, *square, point, at, signs),
            Node::Function(Func::Turn(k), w) => turn_at(*k, at(*w)?),
            Node::Function(f, a) => Some(opaque(f.number(), at(*a)?)),
            Node::Atan2(y, x) => Some(opaque(opaque(ARCTANGENT, at(*y)?), at(*x)?)),
        }
    }

    /// `base^q`.
    fn power_at(&self, base: ExprId, q: &Rational, at: &Operands<'_>, signs: Option<&Signs>) -> Option<u64> {
        let value = at(base)?;
        if !has_even_denominator(q) {
            return field::power(value, q);
        }
        match (self.knowledge().base(base), signs) {
            // All factors are positive: the root of a square is what is squared, which need not be a square in the
            // field.
            (Base::Free, _) => match self.node(self.named(base)) {
                Node::Product { coefficient, factors } => {
                    let mut total = field::power(field::rational(coefficient)?, q)?;
                    for (factor, n) in factors {
                        total = field::mul(total, field::power(at(*factor)?, &(n * q))?);
                    }
                    Some(total)
                }
                _ => field::power(value, q),
            },
            (Base::UpToSign, Some(signs)) => {
                let power = field::power(value, q)?;
                // The numerator is odd, as the denominator is even.
                Some(if signs[&UnknownSign::OfRoot(base)] { field::negate(power) } else { power })
            }
            (Base::UpToSign | Base::Opaque, _) => {
                let root = opaque(ROOT.wrapping_add(q.denom().to_u64()? << 8), value);
                field::power(root, &Rational::from(q.numer().clone()))
            }
        }
    }

    /// `sin`, `cos`, `tan`, `exp`, `sinh`, `cosh` or `tanh` of an argument.
    fn character_at(
        &self,
        f: Func,
        a: ExprId,
        point: usize,
        at: &Operands<'_>,
        signs: Option<&Signs>,
    ) -> Option<u64> {
        let knowledge = self.knowledge();
        let is_circular = matches!(f, Func::Sin | Func::Cos | Func::Tan);
        let terms = match knowledge.argument(a) {
            Some(terms) if !is_circular || knowledge.is_angle(terms) => terms,
            _ => return Some(opaque(f.number(), at(a)?)),
        };
        if is_circular {
            let z = self.turned(terms, point, at, signs)?;
            return match f {
                Func::Sin => Some(z.1),
                Func::Cos => Some(z.0),
                _ => Some(field::mul(z.1, field::inverse(z.0)?)),
            };
        }
        let scale_of = |k: u32| self.scale_at(k, point, at, signs);
        let mut product = field::ONE;
        for (k, q) in terms {
            let factor = if let Some(base) = knowledge.logarithm_term(*k) {
                self.power_at(base, q, at, signs)?
            } else {
                let scale = scale_of(*k)?;
                let (base, n) = match field::small_exponent(q.numer()).filter(|_| q.is_integer()) {
                    Some(n) => (scale.whole_growth, n),
                    None => (scale.growth, steps(q)?),
                };
                let raised = field::pow(base, n.unsigned_abs());
                if n < 0 { field::inverse(raised)? } else { raised }
            };
            product = field::mul(product, factor);
        }
        if f == Func::Exp {
            return Some(product);
        }
        let reciprocal = field::inverse(product)?;
        let sum = field::add(product, reciprocal);
        let difference = field::add(product, field::negate(reciprocal));
        let half = field::rational(&Rational::new(1.into(), 2.into()))?;
        match f {
            Func::Sinh => Some(field::mul(difference, half)),
            Func::Cosh => Some(field::mul(sum, half)),
            _ => Some(field::mul(difference, field::inverse(sum)?)),
        }
    }

    /// What stands for a term at a point.
    fn scale_at(&self, k: u32, point: usize, at: &Operands<'_>, signs: Option<&Signs>) -> Option<Scale> {
        match self.knowledge().scale(k, point) {
            Some(known) => known,
            None => self.term_at(k, point, at, signs).map(scale),
        }
    }

    /// Cosine and sine of a combination of terms.
    fn turned(
        &self,
        terms: &Terms,
        point: usize,
        at: &Operands<'_>,
        signs: Option<&Signs>,
    ) -> Option<field::Point> {
        let mut z = (field::ONE, 0);
        for (k, q) in terms {
            let factor = if *k == PI {
                field::multiple_of_pi(q)?
            } else {
                let scale = self.scale_at(*k, point, at, signs)?;
                match field::small_exponent(q.numer()).filter(|_| q.is_integer()) {
                    Some(n) => field::times(scale.whole_point, n),
                    None => field::times(scale.point, steps(q)?),
                }
            };
            z = field::turn_by(z, factor);
        }
        Some(z)
    }

    /// `c_k(z)`, by `c_0` and `c_1`, a point of the conic `c_0^2 + z c_1^2 = 1`: where `z` is known to be a square
    /// `x^2`, `cos x` and `sin(x)/x`. All relations of the family follow from these two values.
    fn stumpff_at(
        &self,
        k: u8,
        square: ExprId,
        point: usize,
        at: &Operands<'_>,
        signs: Option<&Signs>,
    ) -> Option<u64> {
        let z = at(square)?;
        let (cosine, sine) = match self.knowledge().root(square) {
            Some(terms) => {
                let mut x = 0;
                for (k, q) in terms {
                    let term = self.term_at(*k, point, at, signs)?;
                    x = field::add(x, field::mul(field::rational(q)?, term));
                }
                let (cosine, sine) = self.turned(terms, point, at, signs)?;
                (cosine, field::mul(sine, field::inverse(x)?))
            }
            None => {
                // ((1 - z m^2)/(1 + z m^2), 2 m/(1 + z m^2))
                let m = opaque(CONIC, z);
                let along = field::mul(z, field::mul(m, m));
                let norm = field::inverse(field::add(field::ONE, along))?;
                let cosine = field::mul(field::add(field::ONE, field::negate(along)), norm);
                (cosine, field::mul(field::add(m, m), norm))
            }
        };
        let inverse = field::inverse(z)?;
        let mut value = if k.is_multiple_of(2) { cosine } else { sine };
        let mut reciprocal = Rational::from(BigInt::from(1));
        for m in (k % 2..k).step_by(2) {
            // c_(m+2) = (1/m! - c_m)/z
            for n in [m.wrapping_sub(1), m].into_iter().filter(|n| *n > 1 && *n <= m) {
                reciprocal /= Rational::from(BigInt::from(n));
            }
            let rest = field::add(field::rational(&reciprocal)?, field::negate(value));
            value = field::mul(rest, inverse);
        }
        Some(value)
    }

    /// The value of a term of arguments.
    fn term_at(&self, k: u32, point: usize, at: &Operands<'_>, signs: Option<&Signs>) -> Option<u64> {
        match k {
            UNIT => Some(field::ONE),
            PI => Some(random(u64::MAX, point)),
            _ => self.knowledge().term_value(k, at, |node| self.value_of(node, point, at, signs)),
        }
    }

    fn logarithm_at(&self, a: ExprId, point: usize, at: &Operands<'_>) -> Option<u64> {
        let Some(parts) = self.knowledge().logarithm(a) else {
            return Some(opaque(LOGARITHM, at(a)?));
        };
        let mut total = 0;
        let mut add = |q: &Rational, value: u64| {
            total = field::add(total, field::mul(field::rational(q)?, value));
            Some(())
        };
        for (prime, n) in &parts.primes {
            add(&Rational::from(BigInt::from(*n)), opaque(LOGARITHM, random(*prime, point)))?;
        }
        for (base, q, content) in &parts.bases {
            let value = field::mul(at(*base)?, field::rational(&content.recip())?);
            add(q, opaque(LOGARITHM, value))?;
        }
        for (exponent, q) in &parts.exponents {
            add(q, at(*exponent)?)?;
        }
        Some(total)
    }

    /// The factors of the argument of an absolute value that have signs, and whether that of their coefficient is
    /// minus.
    pub(super) fn factors_with_signs(&self, a: ExprId) -> (bool, Vec<ExprId>) {
        let Node::Product { coefficient, factors } = self.node(a) else { return (false, vec![a]) };
        // Roots are not negative, nor are even powers.
        let odd = |q: &Rational| q.is_integer() && q.numer().bit(0);
        (coefficient.is_negative(), factors.iter().filter(|(_, q)| odd(q)).map(|(e, _)| *e).collect())
    }

    /// What a node itself adds to the doubts about what is behind it.
    pub(super) fn own_doubts(&self, node: &Node) -> Doubts {
        let opaque = Doubts { opaque: true, signed: false };
        let signed = Doubts { opaque: false, signed: true };
        let knowledge = self.knowledge();
        let of_power = |base: ExprId, q: &Rational| match knowledge.base(base) {
            Base::UpToSign if has_even_denominator(q) => signed,
            Base::Opaque if has_even_denominator(q) => opaque,
            _ => Doubts::default(),
        };
        match node {
            Node::Product { factors, .. } => {
                factors.iter().fold(Doubts::default(), |all, (e, q)| all.and(of_power(*e, q)))
            }
            Node::Function(Func::Abs, _) => signed,
            Node::Function(Func::Ln, a) => match knowledge.logarithm(*a) {
                Some(parts) if parts.are_free => Doubts::default(),
                _ => opaque,
            },
            Node::Function(f, a) if is_character(*f) => match knowledge.argument(*a) {
                Some(terms) if !terms.iter().all(|(k, _)| knowledge.is_proved(*k)) => opaque,
                Some(terms) if matches!(f, Func::Sin | Func::Cos | Func::Tan) => {
                    if knowledge.is_angle(terms) { Doubts::default() } else { opaque }
                }
                Some(terms) => terms
                    .iter()
                    .filter_map(|(k, q)| Some((knowledge.logarithm_term(*k)?, q)))
                    .fold(Doubts::default(), |all, (base, q)| all.and(of_power(base, q))),
                None => opaque,
            },
            Node::Function(Func::Stumpff(_), square) => match knowledge.root(*square) {
                Some(terms) if terms.iter().all(|(k, _)| knowledge.is_proved(*k)) => Doubts::default(),
                _ => opaque,
            },
            Node::Function(..) | Node::Atan2(..) => opaque,
            Node::Constant(_) | Node::Pi | Node::Symbol(_) | Node::Sum { .. } => Doubts::default(),
        }
    }

    /// Everything that determines the value of an expression, operands first; none if that is too much.
    pub(super) fn all_behind(&self, e: ExprId, known: impl Fn(ExprId) -> bool) -> Option<Vec<ExprId>> {
        let mut seen = FxHashSet::default();
        let mut pending = vec![e];
        while let Some(e) = pending.pop() {
            if !known(e) && seen.insert(e) {
                if seen.len() > MAX_NODES {
                    return None;
                }
                self.behind(self.node(e), |operand| pending.push(operand));
            }
        }
        let mut all: Vec<ExprId> = seen.into_iter().collect();
        all.sort_unstable();
        Some(all)
    }

    /// Values at the further points, remembered; none if they are too much work. Signs are stood for by opaque values.
    pub(super) fn further_values(&mut self, e: ExprId) -> Option<Vec<Option<u64>>> {
        let all = self.all_behind(e, |e| self.knowledge().further(e).is_some())?;
        for e in all {
            let values = self.further_values_of_node(self.node(e));
            if !self.knowledge_mut().remember_further(e, values) {
                return None;
            }
        }
        self.knowledge().further(e).map(<[Option<u64>]>::to_vec)
    }

    /// Values of a node at the further points, those of what is behind it being remembered.
    pub(super) fn further_values_of_node(&self, node: &Node) -> Vec<Option<u64>> {
        let knowledge = self.knowledge();
        let value = |k: usize| {
            let at = |e: ExprId| knowledge.further(e).and_then(|values| values[k]);
            self.value_of(node, POINTS + k, &at, None)
        };
        (0..FURTHER).map(value).collect()
    }
}

/// `tau_k(w)` by an opaque `tau_0(w)`, with the recurrence from which all relations of the family follow:
/// `2 w (1 - w) (k + 1) tau_(k+1) = 2k tau_(k-1) - (2k + 1) (1 - 2w) tau_k`, and one more for `k = 0`.
fn turn_at(k: u8, w: u64) -> Option<u64> {
    let rest = field::add(field::ONE, field::negate(w));
    let slope = field::add(rest, field::negate(w));
    let divisor = field::mul(field::add(w, w), rest);
    let number = |n: u64| field::rational(&Rational::from(BigInt::from(n)));
    let (mut before, mut own) = (0, opaque(Func::Turn(0).number(), w));
    for m in 0..u64::from(k) {
        let behind = if m == 0 { field::ONE } else { field::mul(number(2 * m)?, before) };
        let above = field::add(behind, field::negate(field::mul(field::mul(number(2 * m + 1)?, slope), own)));
        let next = field::mul(above, field::inverse(field::mul(number(m + 1)?, divisor))?);
        (before, own) = (own, next);
    }
    Some(own)
}

/// Whether a power is known up to a sign alone.
pub(super) fn has_even_denominator(q: &Rational) -> bool {
    !q.denom().bit(0)
}

/// Functions whose values are powers of values of the terms of their argument.
pub(super) fn is_character(f: Func) -> bool {
    matches!(f, Func::Sin | Func::Cos | Func::Tan | Func::Exp | Func::Sinh | Func::Cosh | Func::Tanh)
}

/// Values of a node at the first points, given those of other nodes: as [`Arena::value_of`] finds them, with everything
/// done once that is the same at all points.
pub(super) fn first_values(arena: &Arena, node: &Node) -> Fingerprint {
    match node {
        Node::Constant(q) => [field::rational(q); POINTS],
        Node::Sum { constant, terms } => sums(arena, constant, terms),
        Node::Product { coefficient, factors } if factors.iter().all(|(_, q)| q.is_integer()) => {
            products(arena, coefficient, factors)
        }
        _ => std::array::from_fn(|k| arena.value_of(node, k, &|e| arena.fingerprint(e)[k], None)),
    }
}

/// `constant + sum_k q_k e_k`.
fn sums(arena: &Arena, constant: &Rational, terms: &[(ExprId, Rational)]) -> Fingerprint {
    let mut totals = [field::rational(constant); POINTS];
    for (e, q) in terms {
        let Some(q) = field::rational(q) else { return [None; POINTS] };
        for (total, value) in totals.iter_mut().zip(arena.fingerprint(*e)) {
            *total = total.zip(*value).map(|(total, value)| field::add(total, field::mul(q, value)));
        }
    }
    totals
}

/// `coefficient prod_k e_k^(q_k)` with integers `q_k`: divided by all denominators at once.
fn products(arena: &Arena, coefficient: &Rational, factors: &[(ExprId, Rational)]) -> Fingerprint {
    let mut totals = [field::rational(coefficient); POINTS];
    let mut denominators = [field::ONE; POINTS];
    for (e, q) in factors {
        let Some(n) = field::small_exponent(q.numer()) else { return [None; POINTS] };
        for ((total, denominator), value) in
            totals.iter_mut().zip(&mut denominators).zip(arena.fingerprint(*e))
        {
            let power = value.map(|value| if n == 1 { value } else { field::pow(value, n.unsigned_abs()) });
            match power.filter(|power| n > 0 || *power != 0) {
                None => *total = None,
                Some(power) if n > 0 => *total = total.map(|total| field::mul(total, power)),
                Some(power) => *denominator = field::mul(*denominator, power),
            }
        }
    }
    if denominators != [field::ONE; POINTS] {
        for (total, inverse) in totals.iter_mut().zip(field::inverses(denominators)) {
            *total = total.map(|total| field::mul(total, inverse));
        }
    }
    totals
}
