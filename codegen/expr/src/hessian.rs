//! Second derivatives of polynomials of degree two, by values at a point of the [field](super::field).
//!
//! The matrix of second derivatives of an energy of `n` velocities has `n^2` entries, and as expressions these take
//! more than everything else that is made of a chain of bodies. Its rank and its zeros follow from its values: a minor
//! that is not zero at one point does not vanish. Deliberately does not know: Lagrangians.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::ToPrimitive;
use rustc_hash::{FxHashMap, FxHashSet};

use super::field;
use super::graph::Graph;
use super::knowledge::{Doubts, POINTS};
use super::node::{ExprId, Node, SymbolId};
use super::rational::Rational;
use super::zero::independent;

/// A matrix by its values at one point and their rates along a motion: entries that are not zero there do not vanish,
/// and those whose rates are not zero are not constant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValueMatrix {
    rows: Vec<Vec<Rated>>,
}

/// A value and its rate.
type Rated = (u64, u64);

const ZERO: Rated = (0, 0);

fn plus(a: Rated, b: Rated) -> Rated {
    (field::add(a.0, b.0), field::add(a.1, b.1))
}

fn times(a: Rated, b: Rated) -> Rated {
    (field::mul(a.0, b.0), field::add(field::mul(a.0, b.1), field::mul(a.1, b.0)))
}

fn minus(a: Rated) -> Rated {
    (field::negate(a.0), field::negate(a.1))
}

impl ValueMatrix {
    /// The largest number of independent rows. It is proved to be no smaller; that it is no larger has the chance of a
    /// false zero.
    pub fn rank(&self) -> usize {
        independent(self.rows.iter().map(|row| row.iter().map(|e| e.0).collect())).len()
    }

    /// Number of rows.
    pub fn n_rows(&self) -> usize {
        self.rows.len()
    }

    /// Whether an entry has the value zero.
    pub fn is_zero(&self, row: usize, column: usize) -> bool {
        self.rows[row][column].0 == 0
    }

    /// Whether an entry is seen to change.
    pub fn varies(&self, row: usize, column: usize) -> bool {
        self.rows[row][column].1 != 0
    }
}

/// A part of a polynomial that depends on the symbols, by the places of such parts before it. What does not depend on
/// them is a factor, or no part of a second derivative.
enum Step {
    /// A symbol.
    Variable(usize),
    Sum(Vec<(usize, Rated)>),
    /// `factor a`.
    Multiple(Rated, usize),
    /// `factor a b`.
    Product(Rated, usize, usize),
}

/// Values of what does not depend on the symbols, by expressions.
type Fixed = FxHashMap<ExprId, Rated>;

impl Graph {
    /// `left^T e_yy right` for a polynomial `e` in the `symbols` y of degree two at most, as it is written, with its
    /// derivative along the `rates` of other symbols. `None` where it is no such polynomial, where factors of second
    /// derivatives, `left` or `right` have no value or one that proves nothing, and where they depend on `y`.
    ///
    /// # Shapes
    /// symbols: `[m]`, left: `[m][k]`, right: `[m][l]` -> `[k][l]`.
    ///
    /// # Source
    /// Griewank and Walther 2008, Evaluating Derivatives, section 3.2 (reverse mode): a column of `e_yy right` is the
    /// gradient of `e` there less that at zero.
    pub fn second_derivatives(
        &mut self,
        e: ExprId,
        symbols: &[SymbolId],
        (left, right): (&[Vec<ExprId>], &[Vec<ExprId>]),
        rates: &BTreeMap<SymbolId, ExprId>,
    ) -> Option<ValueMatrix> {
        // Most entries are zeros and ones.
        let mut fixed: BTreeSet<ExprId> = left.iter().chain(right).flatten().copied().collect();
        let of_sides: Vec<ExprId> = fixed.iter().copied().collect();
        let is_one = |e: &ExprId| matches!(self.node(*e), Node::Symbol(s) if symbols.contains(s));
        if self.reachable(&of_sides).iter().any(is_one) {
            return None;
        }
        let behind = self.reachable(&[e]);
        self.add_fixed_factors(&behind, symbols, &mut fixed);
        let fixed = self.values_with_rates(fixed.into_iter().collect(), rates)?;
        let steps = self.polynomial_steps(&behind, symbols, &fixed)?;
        let columns = |rows: &[Vec<ExprId>]| -> Vec<Vec<(usize, Rated)>> {
            let n = rows.first().map_or(0, Vec::len);
            let column = |a: usize| {
                let entries = rows.iter().map(|row| fixed[&row[a]]).enumerate();
                entries.filter(|(_, value)| *value != ZERO).collect()
            };
            (0..n).map(column).collect()
        };
        let (left, right) = (columns(left), columns(right));
        self.charge((right.len() + 1) * 2 * steps.len() + left.len() * right.len());
        let at_zero = gradient(&steps, symbols.len(), &[]);
        let mut rows = vec![vec![ZERO; right.len()]; left.len()];
        for (l, direction) in right.iter().enumerate() {
            let there = gradient(&steps, symbols.len(), direction);
            for (row, weights) in rows.iter_mut().zip(&left) {
                for (alpha, weight) in weights {
                    let along = plus(there[*alpha], minus(at_zero[*alpha]));
                    row[l] = plus(row[l], times(*weight, along));
                }
            }
        }
        Some(ValueMatrix { rows })
    }

    /// Factors without the symbols of what depends on them.
    fn add_fixed_factors(&self, behind: &[ExprId], symbols: &[SymbolId], fixed: &mut BTreeSet<ExprId>) {
        let symbols: FxHashSet<SymbolId> = symbols.iter().copied().collect();
        let mut moving: FxHashSet<ExprId> = FxHashSet::default();
        for e in behind {
            let mut moves = matches!(self.node(*e), Node::Symbol(s) if symbols.contains(s));
            self.node(*e).for_each_operand(|operand| moves |= moving.contains(&operand));
            if !moves {
                continue;
            }
            moving.insert(*e);
            if let Node::Product { factors, .. } = self.node(*e) {
                fixed.extend(factors.iter().map(|(base, _)| *base).filter(|base| !moving.contains(base)));
            }
        }
    }

    /// Values and rates at one point. `None` where there is no point at which all have values that are not zero only
    /// where the expression does not vanish.
    fn values_with_rates(&mut self, list: Vec<ExprId>, rates: &BTreeMap<SymbolId, ExprId>) -> Option<Fixed> {
        let slopes = self.derivatives(&list, rates);
        let value = |e: ExprId, point: usize| {
            let is_sure = self.arena.doubts(e) == Doubts::default();
            self.arena.fingerprint(e)[point].filter(|_| is_sure)
        };
        let values = |point: usize| -> Option<Fixed> {
            let pairs = list.iter().zip(&slopes);
            pairs.map(|(e, slope)| Some((*e, (value(*e, point)?, value(*slope, point)?)))).collect()
        };
        (0..POINTS).find_map(values)
    }

    /// The parts of a polynomial of degree two at most that depend on the symbols, itself last, by all that is `behind`
    /// it.
    fn polynomial_steps(&self, behind: &[ExprId], symbols: &[SymbolId], fixed: &Fixed) -> Option<Vec<Step>> {
        let variables: FxHashMap<SymbolId, usize> = symbols.iter().copied().zip(0..).collect();
        let mut steps: Vec<Step> = Vec::new();
        // Places and degrees.
        let mut moving: FxHashMap<ExprId, (usize, usize)> = FxHashMap::default();
        for e in behind {
            let (step, degree) = match self.node(*e) {
                Node::Symbol(s) => match variables.get(s) {
                    Some(variable) => (Step::Variable(*variable), 1),
                    None => continue,
                },
                Node::Sum { terms, .. } => {
                    let (mut parts, mut degree) = (Vec::new(), 0);
                    for (term, q) in terms {
                        if let Some((place, of_term)) = moving.get(term) {
                            parts.push((*place, (field::rational(q)?, 0)));
                            degree = degree.max(*of_term);
                        }
                    }
                    if parts.is_empty() {
                        continue;
                    }
                    (Step::Sum(parts), degree)
                }
                Node::Product { coefficient, factors } => {
                    if !factors.iter().any(|(base, _)| moving.contains_key(base)) {
                        continue;
                    }
                    product_step(coefficient, factors, &moving, fixed)?
                }
                node => {
                    let mut is_fixed = true;
                    node.for_each_operand(|operand| is_fixed &= !moving.contains_key(&operand));
                    if !is_fixed {
                        return None;
                    }
                    continue;
                }
            };
            moving.insert(*e, (steps.len(), degree));
            steps.push(step);
        }
        // What does not depend on the symbols has no derivatives.
        if behind.last().is_none_or(|e| !moving.contains_key(e)) {
            steps.clear();
        }
        Some(steps)
    }
}

/// A product with its degree. `None` where that is above two, and where a factor has no value.
fn product_step(
    coefficient: &Rational,
    factors: &[(ExprId, Rational)],
    moving: &FxHashMap<ExprId, (usize, usize)>,
    fixed: &Fixed,
) -> Option<(Step, usize)> {
    let mut factor = (field::rational(coefficient)?, 0);
    let (mut places, mut degree) = (Vec::new(), 0);
    for (base, q) in factors {
        // Roots prove nothing unless their bases are known to be squares.
        let n = q.is_integer().then(|| q.to_integer().to_i32()).flatten()?;
        let Some((place, of_base)) = moving.get(base) else {
            let (value, rate) = *fixed.get(base)?;
            // (b^n)' = n b^(n - 1) b'
            let lower = field::power(value, &Rational::from_integer((n - 1).into()))?;
            let slope = field::mul(field::rational(q)?, lower);
            factor = times(factor, (field::mul(lower, value), field::mul(slope, rate)));
            continue;
        };
        let n = usize::try_from(n).ok().filter(|n| *n <= 2)?;
        degree += n * of_base;
        places.extend(std::iter::repeat_n(*place, n));
    }
    match places.as_slice() {
        [a] => Some((Step::Multiple(factor, *a), degree)),
        [a, b] if degree <= 2 => Some((Step::Product(factor, *a, *b), degree)),
        _ => None,
    }
}

/// The gradient of the last step, of which what does not depend on the symbols is left out in sums, at a point with
/// these values of symbols and zeros.
fn gradient(steps: &[Step], n: usize, point: &[(usize, Rated)]) -> Vec<Rated> {
    let mut at = vec![ZERO; n];
    point.iter().for_each(|(k, value)| at[*k] = *value);
    let mut values: Vec<Rated> = Vec::with_capacity(steps.len());
    for step in steps {
        values.push(match step {
            Step::Variable(k) => at[*k],
            Step::Sum(terms) => terms.iter().fold(ZERO, |sum, (a, q)| plus(sum, times(*q, values[*a]))),
            Step::Multiple(factor, a) => times(*factor, values[*a]),
            Step::Product(factor, a, b) => times(*factor, times(values[*a], values[*b])),
        });
    }
    let mut behind = vec![ZERO; steps.len()];
    behind.last_mut().into_iter().for_each(|last| *last = (field::ONE, 0));
    let mut gradient = vec![ZERO; n];
    let raise = |entry: &mut Rated, by: Rated| *entry = plus(*entry, by);
    for (place, step) in steps.iter().enumerate().rev() {
        let slope = behind[place];
        match step {
            _ if slope == ZERO => {}
            Step::Variable(k) => raise(&mut gradient[*k], slope),
            Step::Sum(terms) => {
                terms.iter().for_each(|(a, q)| raise(&mut behind[*a], times(*q, slope)));
            }
            Step::Multiple(factor, a) => raise(&mut behind[*a], times(*factor, slope)),
            Step::Product(factor, a, b) => {
                let along = times(*factor, slope);
                raise(&mut behind[*a], times(along, values[*b]));
                raise(&mut behind[*b], times(along, values[*a]));
            }
        }
    }
    gradient
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x`, two velocities, and the unit matrix.
    fn setting() -> (Graph, SymbolId, [SymbolId; 2], Vec<Vec<ExprId>>) {
        let mut g = Graph::new();
        let [x, u, v] = ["x", "u", "v"].map(|name| g.symbol(name));
        let (zero, one) = (g.zero(), g.one());
        (g, x, [u, v], vec![vec![one, zero], vec![zero, one]])
    }

    /// `(a u + b v + c)^2 + k v`.
    fn square(g: &mut Graph, [u, v]: [SymbolId; 2], [a, b, c, k]: [ExprId; 4]) -> ExprId {
        let [u, v] = [u, v].map(|s| g.sym(s));
        let (au, bv, kv) = (g.mul(a, u), g.mul(b, v), g.mul(k, v));
        let sum = g.sum(&[au, bv, c]);
        let square = g.powi(sum, 2);
        g.add(square, kv)
    }

    #[test]
    fn values_are_those_of_the_second_derivatives() {
        let (mut g, coordinate, [u, v], unit) = setting();
        let x = g.sym(coordinate);
        let cosine = g.func(crate::Func::Cos, x);
        let (one, two) = (g.one(), g.int(2));
        let first = square(&mut g, [u, v], [cosine, x, one, x]);
        let second = square(&mut g, [u, v], [two, cosine, x, one]);
        let e = g.add(first, second);
        // At twice the rate of x.
        let rates = BTreeMap::from([(coordinate, two)]);
        let found = g.second_derivatives(e, &[u, v], (&unit, &unit), &rates).expect("a polynomial");
        for (i, a) in [u, v].into_iter().enumerate() {
            for (j, b) in [u, v].into_iter().enumerate() {
                let slope = g.diff(e, a);
                let second = g.diff(slope, b);
                let rate = g.derivative_along(second, &rates);
                let expected = [second, rate].map(|e| g.fingerprint(e)[0]);
                assert_eq!([Some(found.rows[i][j].0), Some(found.rows[i][j].1)], expected);
            }
        }
        assert_eq!(found.rank(), 2);
        assert!(found.varies(0, 0) && !found.is_zero(1, 1));
        // Of one square it is of rank one, and along vectors it is a product.
        let alone =
            g.second_derivatives(first, &[u, v], (&unit, &unit), &BTreeMap::new()).expect("a polynomial");
        assert_eq!(alone.rank(), 1);
        assert!(!alone.is_zero(0, 1));
        let minus = g.neg(cosine);
        let kernel = vec![vec![x], vec![minus]];
        let along =
            g.second_derivatives(first, &[u, v], (&unit, &kernel), &BTreeMap::new()).expect("a polynomial");
        assert_eq!((along.rank(), along.is_zero(0, 0), along.is_zero(1, 0)), (0, true, true));
    }

    #[test]
    fn other_functions_have_none() {
        let (mut g, x, [u, v], unit) = setting();
        let x = g.sym(x);
        let [of_u, of_v] = [u, v].map(|s| g.sym(s));
        let cube = g.powi(of_u, 3);
        let sine = g.func(crate::Func::Sin, of_v);
        let quotient = g.div(of_u, of_v).expect("no zero");
        let square = g.powi(of_u, 2);
        let product = g.product(&[square, of_v]);
        for e in [cube, sine, quotient, product] {
            assert_eq!(g.second_derivatives(e, &[u, v], (&unit, &unit), &BTreeMap::new()), None);
        }
        // An opaque factor proves nothing; as a term it is none of the second derivatives.
        let angle = g.func(crate::Func::Atan, x);
        let (weighed, beside) = (g.mul(angle, square), g.add(angle, square));
        assert_eq!(g.second_derivatives(weighed, &[u, v], (&unit, &unit), &BTreeMap::new()), None);
        let found =
            g.second_derivatives(beside, &[u, v], (&unit, &unit), &BTreeMap::new()).expect("a polynomial");
        assert_eq!(found.rank(), 1);
        let found =
            g.second_derivatives(angle, &[u, v], (&unit, &unit), &BTreeMap::new()).expect("a polynomial");
        assert_eq!(found.rank(), 0);
        let moved = vec![vec![of_u], vec![of_v]];
        assert_eq!(g.second_derivatives(square, &[u, v], (&unit, &moved), &BTreeMap::new()), None);
    }
}
