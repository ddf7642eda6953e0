//! Exponentials of constant matrices in closed form, by a polynomial that the matrix satisfies.
//!
//! Deliberately does not know: where a matrix comes from, what is done with the flow.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{ExprId, Func, Graph, Rational, SectionWriter, Sign, SymbolId, sign_of};

/// The largest `p` of `x^p (x^2 - sigma w^2)^q` that is looked for.
const MAX_POWER: usize = 4;
/// The largest `q`.
const MAX_PAIRS: usize = 2;

/// What turns: the sign of the square of the eigenvalues.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// `-w^2`: sines and cosines.
    Circular,
    /// `w^2`: hyperbolic ones.
    Hyperbolic,
}

/// A polynomial `x^p (x^2 - sigma w^2)^q` that a matrix satisfies.
#[derive(Clone, Copy, Debug)]
struct Annihilator {
    power: usize,
    pairs: usize,
    /// `w^2` and `sigma`, where `q > 0`.
    square: ExprId,
    kind: Kind,
}

/// Components of a vector that a matrix mixes, and the polynomial of that block.
#[derive(Clone, Debug)]
struct Block {
    places: Vec<usize>,
    matrix: Vec<Vec<ExprId>>,
    annihilator: Annihilator,
}

/// The exponential of a constant matrix `B`, block by block:
///
/// ```text
/// exp(s B) - 1 = sum_k f_k(s) B^k,   k < p + 2 q
/// ```
///
/// with `f_k` from the polynomial of lowest degree that the block satisfies, which is proved, as is `d/ds exp(s B) = B
/// exp(s B)` for the `f_k`.
#[derive(Clone, Debug)]
pub(super) struct Exponential {
    blocks: Vec<Block>,
}

impl Exponential {
    /// The exponential of a matrix whose entries depend on parameters alone; none where no block has a polynomial of
    /// the form that is looked for.
    pub(super) fn new(
        g: &mut Graph,
        matrix: &[Vec<ExprId>],
        signs: &BTreeMap<ExprId, Sign>,
    ) -> Option<Exponential> {
        let mut blocks = Vec::new();
        for places in components(g, matrix) {
            let own: Vec<Vec<ExprId>> =
                places.iter().map(|i| places.iter().map(|k| matrix[*i][*k]).collect()).collect();
            let annihilator = Annihilator::of(g, &own, signs)?;
            blocks.push(Block { places, matrix: own, annihilator });
        }
        let mut proved = BTreeSet::new();
        for Block { annihilator: Annihilator { power, pairs, kind, .. }, .. } in &blocks {
            if proved.insert((*power, *pairs, *kind == Kind::Circular)) && !is_flow(g, *power, *pairs, *kind)
            {
                return None;
            }
        }
        Some(Exponential { blocks })
    }

    /// Whether sines, cosines or hyperbolic functions are computed.
    pub(super) fn has_functions(&self) -> bool {
        self.blocks.iter().any(|block| block.annihilator.pairs > 0)
    }

    /// `(exp(s B) - 1) y`; values that are used more than once get names that begin with `stem`.
    pub(super) fn increment(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        stem: &str,
        s: ExprId,
        y: &[ExprId],
    ) -> Option<Vec<ExprId>> {
        let mut increment = vec![g.zero(); y.len()];
        // Blocks with the same polynomial share its functions.
        let mut known: Vec<((usize, usize, ExprId), Vec<ExprId>)> = Vec::new();
        for Block { places, matrix, annihilator } in &self.blocks {
            let Annihilator { power, pairs, square, kind } = *annihilator;
            let key = (power, pairs, square);
            let functions = match known.iter().find(|(other, _)| *other == key) {
                Some((_, functions)) => functions.clone(),
                None => {
                    let w = g.sqrt(square);
                    let mut functions = Vec::new();
                    for (k, f) in coefficients(g, power, pairs, kind, s, w)?.into_iter().enumerate() {
                        functions.push(writer.define(g, &format!("{stem}_f{k}"), f));
                    }
                    known.push((key, functions.clone()));
                    functions
                }
            };
            let mut image: Vec<ExprId> = places.iter().map(|i| y[*i]).collect();
            let mut sums: Vec<Vec<ExprId>> = vec![Vec::new(); places.len()];
            for (k, f) in functions.into_iter().enumerate() {
                if k > 0 {
                    image = matrix.iter().map(|row| g.dot(row, &image)).collect();
                    let has_next = k + 1 < power + 2 * pairs;
                    if has_next {
                        for (row, e) in image.iter_mut().enumerate() {
                            *e = writer.define(g, &format!("{stem}_{k}_{}", places[row]), *e);
                        }
                    }
                }
                for (sum, e) in sums.iter_mut().zip(&image) {
                    sum.push(g.mul(f, *e));
                }
            }
            for (place, terms) in places.iter().zip(sums) {
                increment[*place] = g.sum(&terms);
            }
        }
        Some(increment)
    }
}

/// The sets of indices that a matrix connects; indices with empty rows and columns are left out.
fn components(g: &Graph, matrix: &[Vec<ExprId>]) -> Vec<Vec<usize>> {
    let n = matrix.len();
    let is_linked = |i: usize, k: usize| matrix[i][k] != g.zero() || matrix[k][i] != g.zero();
    let mut seen = vec![false; n];
    let mut found = Vec::new();
    for start in 0..n {
        if seen[start] || (0..n).all(|k| !is_linked(start, k)) {
            continue;
        }
        let (mut members, mut open) = (BTreeSet::from([start]), vec![start]);
        while let Some(i) = open.pop() {
            for k in (0..n).filter(|k| is_linked(i, *k)) {
                if members.insert(k) {
                    open.push(k);
                }
            }
        }
        members.iter().for_each(|i| seen[*i] = true);
        found.push(members.into_iter().collect());
    }
    found
}

/// The product of two square matrices, with zeros where sums vanish identically.
pub(super) fn product(g: &mut Graph, a: &[Vec<ExprId>], b: &[Vec<ExprId>]) -> Vec<Vec<ExprId>> {
    let n = b.first().map_or(0, Vec::len);
    let entry = |g: &mut Graph, row: &[ExprId], k: usize| {
        let column: Vec<ExprId> = b.iter().map(|row| row[k]).collect();
        let sum = g.dot(row, &column);
        g.cancel_zero(sum)
    };
    a.iter().map(|row| (0..n).map(|k| entry(g, row, k)).collect()).collect()
}

/// Whether all entries vanish identically.
pub(super) fn vanishes(g: &mut Graph, matrix: &[Vec<ExprId>]) -> bool {
    matrix.iter().flatten().all(|e| g.is_zero(*e))
}

impl Annihilator {
    /// The polynomial of lowest degree among those that are looked for, by the powers of a matrix.
    fn of(g: &mut Graph, matrix: &[Vec<ExprId>], signs: &BTreeMap<ExprId, Sign>) -> Option<Annihilator> {
        let n = matrix.len();
        let (one, zero) = (g.one(), g.zero());
        let identity: Vec<Vec<ExprId>> =
            (0..n).map(|i| (0..n).map(|k| if i == k { one } else { zero }).collect()).collect();
        let mut powers = vec![identity, matrix.to_vec()];
        let trace = |g: &mut Graph, m: &[Vec<ExprId>]| {
            let diagonal: Vec<ExprId> = (0..n).map(|i| m[i][i]).collect();
            g.sum(&diagonal)
        };
        // Each eigenvalue other than zero adds `sigma w^2` to the trace of the square.
        let squared = product(g, matrix, matrix);
        let whole = trace(g, &squared);
        powers.push(squared);
        let is_nilpotent = g.is_zero(whole);
        for degree in 1..=n.max(2) {
            while powers.len() <= degree {
                let next = product(g, matrix, powers.last()?);
                powers.push(next);
            }
            if is_nilpotent {
                if vanishes(g, &powers[degree]) {
                    return Some(Annihilator { power: degree, pairs: 0, square: one, kind: Kind::Circular });
                }
                continue;
            }
            for pairs in (1..=MAX_PAIRS).filter(|q| 2 * q <= degree && degree - 2 * q <= MAX_POWER) {
                let power = degree - 2 * pairs;
                for n_eigenvalues in 1..=n {
                    let share = Rational::new(1.into(), i64::try_from(n_eigenvalues).ok()?.into());
                    let eigenvalue = g.scale(whole, &share);
                    if !satisfies(g, &powers, power, pairs, eigenvalue) {
                        continue;
                    }
                    let negative = g.neg(eigenvalue);
                    let is_positive = |e: ExprId| sign_of(g, e, signs) == Sign::Positive;
                    return if is_positive(negative) {
                        Some(Annihilator { power, pairs, square: negative, kind: Kind::Circular })
                    } else if is_positive(eigenvalue) {
                        Some(Annihilator { power, pairs, square: eigenvalue, kind: Kind::Hyperbolic })
                    } else {
                        None
                    };
                }
            }
        }
        None
    }
}

/// Whether `B^p (B^2 - e)^q = 0`.
fn satisfies(g: &mut Graph, powers: &[Vec<Vec<ExprId>>], power: usize, pairs: usize, e: ExprId) -> bool {
    let n = powers[0].len();
    let mut weights = vec![(power, g.one())];
    for _ in 0..pairs {
        let mut next: BTreeMap<usize, Vec<ExprId>> = BTreeMap::new();
        for (k, weight) in weights {
            next.entry(k + 2).or_default().push(weight);
            let product = g.mul(weight, e);
            next.entry(k).or_default().push(g.neg(product));
        }
        weights = next.into_iter().map(|(k, terms)| (k, g.sum(&terms))).collect();
    }
    (0..n).all(|i| {
        (0..n).all(|k| {
            let terms: Vec<ExprId> =
                weights.iter().map(|(power, weight)| g.mul(*weight, powers[*power][i][k])).collect();
            let sum = g.sum(&terms);
            g.is_zero(sum)
        })
    })
}

/// `a + b u` with `u^2 = sigma`, a complex number or a split one.
#[derive(Clone, Copy, Debug)]
struct Pair {
    real: ExprId,
    unit: ExprId,
}

/// The arithmetic of pairs.
struct Pairs<'a> {
    g: &'a mut Graph,
    kind: Kind,
}

impl Pairs<'_> {
    fn signed(&mut self, e: ExprId) -> ExprId {
        match self.kind {
            Kind::Circular => self.g.neg(e),
            Kind::Hyperbolic => e,
        }
    }

    fn sub(&mut self, a: Pair, b: Pair) -> Pair {
        Pair { real: self.g.sub(a.real, b.real), unit: self.g.sub(a.unit, b.unit) }
    }

    fn scaled(&mut self, a: Pair, factor: ExprId) -> Pair {
        Pair { real: self.g.mul(a.real, factor), unit: self.g.mul(a.unit, factor) }
    }

    /// `a/(u w)`.
    fn over_root(&mut self, a: Pair, inverse: ExprId) -> Pair {
        let unit = self.signed(a.real);
        self.scaled(Pair { real: a.unit, unit }, inverse)
    }

    /// `(u theta)^k / k!`.
    fn term(&mut self, theta: ExprId, k: usize) -> Option<Pair> {
        let factorial = (1..=i64::try_from(k).ok()?).product::<i64>();
        let power = self.g.powi(theta, i64::try_from(k).ok()?);
        let mut value = self.g.scale(power, &Rational::new(1.into(), factorial.into()));
        for _ in 0..k / 2 {
            value = self.signed(value);
        }
        let zero = self.g.zero();
        Some(match k % 2 {
            0 => Pair { real: value, unit: zero },
            _ => Pair { real: zero, unit: value },
        })
    }
}

/// `f_k(s)` of `exp(s x) - 1 = sum_k f_k(s) x^k` modulo `x^p (x^2 - sigma w^2)^q`.
///
/// The polynomial that takes the values of the exponential at zero and at `u w`, with as many derivatives as the
/// modulus has zeros there (Hermite's interpolation). Half angles leave no `1 - cos` to cancel, and what rounding of
/// sine and cosine adds to a norm then is of second order in the angle.
fn coefficients(
    g: &mut Graph,
    power: usize,
    pairs: usize,
    kind: Kind,
    s: ExprId,
    w: ExprId,
) -> Option<Vec<ExprId>> {
    let mut f = vec![g.zero(); power + 2 * pairs];
    for (k, f) in f.iter_mut().enumerate().take(power).skip(1) {
        let factorial = (1..=i64::try_from(k).ok()?).product::<i64>();
        let monomial = g.powi(s, i64::try_from(k).ok()?);
        *f = g.scale(monomial, &Rational::new(1.into(), factorial.into()));
    }
    if pairs == 0 {
        return Some(f);
    }
    let theta = g.mul(w, s);
    let half = g.scale(theta, &Rational::new(1.into(), 2.into()));
    let (sine, cosine) = match kind {
        Kind::Circular => (g.func(Func::Sin, half), g.func(Func::Cos, half)),
        Kind::Hyperbolic => (g.func(Func::Sinh, half), g.func(Func::Cosh, half)),
    };
    let inverse = g.powi(w, -1);
    let mut p = Pairs { g, kind };
    // exp(u theta) - 1
    let two = p.g.int(2);
    let square = p.g.product(&[two, sine, sine]);
    let first = Pair { real: p.signed(square), unit: p.g.product(&[two, sine, cosine]) };
    let one = Pair { real: p.g.one(), unit: p.g.zero() };
    // exp(u theta) less the first `k` terms of its series, of which the constant is always the first.
    let rest = |p: &mut Pairs<'_>, k: usize| {
        let mut rest = first;
        for j in 1..k {
            let term = p.term(theta, j)?;
            rest = p.sub(rest, term);
        }
        Some(rest)
    };
    let mut value = rest(&mut p, power)?;
    for _ in 0..power {
        value = p.over_root(value, inverse);
    }
    // r(x) = a + b x at x = u w
    let b = p.g.mul(value.unit, inverse);
    let mut remainder = vec![value.real, b];
    if pairs == 2 {
        // The derivative of (exp(s x) - ..)/x^p by x is (s (exp(s x) - ..) - p (exp(s x) - ..)/x)/x^p.
        let before = match power {
            0 | 1 => {
                let negative = Pair { real: p.g.neg(one.real), unit: one.unit };
                p.sub(first, negative)
            }
            _ => rest(&mut p, power - 1)?,
        };
        let mut slope = p.scaled(before, s);
        for _ in 0..power {
            slope = p.over_root(slope, inverse);
        }
        let n = p.g.int(i64::try_from(power).ok()?);
        let lost = p.over_root(value, inverse);
        let lost = p.scaled(lost, n);
        slope = p.sub(slope, lost);
        // r(x) = a + b x + (x^2 - sigma w^2) (c + d x), r'(u w) = b + 2 u w (c + d u w)
        let slope = p.sub(slope, Pair { real: b, unit: one.unit });
        let bend = p.over_root(slope, inverse);
        let half = p.g.rational(Rational::new(1.into(), 2.into()));
        let bend = p.scaled(bend, half);
        let (c, d) = (bend.real, p.g.mul(bend.unit, inverse));
        let square = p.g.powi(w, 2);
        let square = p.signed(square);
        for (k, e) in [c, d].into_iter().enumerate() {
            let product = p.g.mul(square, e);
            remainder[k] = p.g.sub(remainder[k], product);
        }
        remainder.extend([c, d]);
    }
    for (k, e) in remainder.into_iter().enumerate() {
        f[power + k] = p.g.add(f[power + k], e);
    }
    Some(f)
}

/// Whether `f' = x (1 + f)` modulo the polynomial, and `f = 0` at `s = 0`, for all `s` and `w`.
fn is_flow(g: &mut Graph, power: usize, pairs: usize, kind: Kind) -> bool {
    let (time, root): (SymbolId, SymbolId) = (g.symbol("s"), g.symbol("w"));
    let (s, w) = (g.sym(time), g.sym(root));
    let Some(f) = coefficients(g, power, pairs, kind, s, w) else { return false };
    let degree = f.len();
    // x^degree = -sum_k m_k x^k
    let square = g.powi(w, 2);
    let square = if kind == Kind::Circular { g.neg(square) } else { square };
    let mut modulus = vec![g.zero(); degree];
    for k in 0..pairs {
        // (x^2 - e)^q: e^(q-k) (-1)^(q-k) binomial(q, k)
        let binomial = if pairs == 2 && k == 1 { 2 } else { 1 };
        let sign = if (pairs - k).is_multiple_of(2) { 1 } else { -1 };
        let Ok(exponent) = i64::try_from(pairs - k) else { return false };
        let e = g.powi(square, exponent);
        modulus[power + 2 * k] = g.scale(e, &Rational::from_integer((sign * binomial).into()));
    }
    let start = BTreeMap::from([(time, g.zero())]);
    let one = g.one();
    let Some(last) = f.last().copied() else { return true };
    // Of degree one the constant is the last.
    let last = if degree == 1 { g.add(one, last) } else { last };
    (0..degree).all(|k| {
        let before = match k {
            0 => g.zero(),
            1 => g.add(one, f[0]),
            _ => f[k - 1],
        };
        let product = g.mul(modulus[k], last);
        let right = g.sub(before, product);
        let slope = g.diff(f[k], time);
        let begins_at_zero = g.subs(f[k], &start).is_ok_and(|e| g.is_zero(e));
        begins_at_zero && g.is_equal(slope, right)
    })
}

#[cfg(test)]
mod tests {
    use super::{Kind, MAX_PAIRS, MAX_POWER, is_flow};
    use hamel_expr::Graph;

    #[test]
    fn all_polynomials_have_functions_that_are_proved() {
        let mut g = Graph::new();
        for power in 0..=MAX_POWER {
            for pairs in 0..=MAX_PAIRS {
                for kind in [Kind::Circular, Kind::Hyperbolic] {
                    if power + pairs > 0 {
                        assert!(is_flow(&mut g, power, pairs, kind), "{power} {pairs} {kind:?}");
                    }
                }
            }
        }
    }
}
