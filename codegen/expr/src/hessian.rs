//! Second derivatives of polynomials of degree two, by values at a point of the [field](super::field).
//!
//! The matrix of second derivatives of a Lagrangian of `n` velocities has `n^2` entries, and as expressions these take
//! more than everything else that is made of a chain of bodies. Its rank and its zeros follow from its values: a minor
//! that is not zero at one point does not vanish. Deliberately does not know: what is differentiated.

use std::collections::BTreeSet;

use num_traits::One;
use rustc_hash::FxHashMap;

use super::field;
use super::graph::Graph;
use super::knowledge::{Doubts, POINTS};
use super::node::{ExprId, Node, SymbolId};
use super::rational::Rational;
use super::zero::independent;

/// A matrix by its values at one point: entries that are not zero there do not vanish.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ValueMatrix {
    rows: Vec<Vec<u64>>,
}

impl ValueMatrix {
    /// The largest number of independent rows. It is proved to be no smaller; that it is no larger has the chance of a
    /// false zero.
    pub fn rank(&self) -> usize {
        independent(self.rows.iter().cloned()).len()
    }

    /// Whether an entry has the value zero.
    pub fn is_zero(&self, row: usize, column: usize) -> bool {
        self.rows[row][column] == 0
    }
}

/// A part of a polynomial that depends on the symbols, by the places of such parts before it. What does not depend on
/// them is a factor, or no part of a second derivative.
enum Step {
    /// A symbol.
    Variable(usize),
    Sum(Vec<(usize, u64)>),
    /// `factor a`.
    Multiple(u64, usize),
    /// `factor a b`.
    Product(u64, usize, usize),
}

impl Graph {
    /// `left^T e_yy right` for a polynomial `e` in the `symbols` y of degree two at most, as it is written; none where
    /// it is no such polynomial, where factors of second derivatives, `left` or `right` have no value or one that
    /// proves nothing, and where they depend on `y`.
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
    ) -> Option<ValueMatrix> {
        // Most of them are zeros and ones.
        let entries: BTreeSet<ExprId> = left.iter().chain(right).flatten().copied().collect();
        let entries: Vec<ExprId> = entries.into_iter().collect();
        let is_one = |e: &ExprId| matches!(self.node(*e), Node::Symbol(s) if symbols.contains(s));
        if self.reachable(&entries).iter().any(is_one) {
            return None;
        }
        let has_values = |point: &usize| entries.iter().all(|e| self.value_that_proves(*e, *point).is_some());
        let point = (0..POINTS).find(has_values)?;
        let steps = self.polynomial_steps(e, symbols, point)?;
        let value = |e: &ExprId| self.value_that_proves(*e, point);
        let columns = |rows: &[Vec<ExprId>]| -> Option<Vec<Vec<(usize, u64)>>> {
            let n = rows.first().map_or(0, Vec::len);
            let column = |a: usize| {
                let entries = rows.iter().enumerate().map(|(alpha, row)| Some((alpha, value(&row[a])?)));
                Some(entries.collect::<Option<Vec<_>>>()?.into_iter().filter(|(_, v)| *v != 0).collect())
            };
            (0..n).map(column).collect()
        };
        let (left, right) = (columns(left)?, columns(right)?);
        self.charge((right.len() + 1) * 2 * steps.len() + left.len() * right.len());
        let at_zero = gradient(&steps, symbols.len(), &[]);
        let mut rows = vec![vec![0; right.len()]; left.len()];
        for (l, direction) in right.iter().enumerate() {
            let there = gradient(&steps, symbols.len(), direction);
            for (row, weights) in rows.iter_mut().zip(&left) {
                for (alpha, weight) in weights {
                    let along = field::add(there[*alpha], field::negate(at_zero[*alpha]));
                    row[l] = field::add(row[l], field::mul(*weight, along));
                }
            }
        }
        Some(ValueMatrix { rows })
    }

    /// A value that is not zero only where the expression does not vanish.
    fn value_that_proves(&self, e: ExprId, point: usize) -> Option<u64> {
        let is_sure = self.arena.doubts(e) == Doubts::default();
        self.arena.fingerprint(e)[point].filter(|_| is_sure)
    }

    /// The parts of a polynomial of degree two at most that depend on the symbols, `e` last.
    fn polynomial_steps(&self, e: ExprId, symbols: &[SymbolId], point: usize) -> Option<Vec<Step>> {
        let variables: FxHashMap<SymbolId, usize> = symbols.iter().copied().zip(0..).collect();
        let mut steps: Vec<Step> = Vec::new();
        // Places and degrees.
        let mut moving: FxHashMap<ExprId, (usize, usize)> = FxHashMap::default();
        for e in self.reachable(&[e]) {
            let (step, degree) = match self.node(e) {
                Node::Symbol(s) => match variables.get(s) {
                    Some(variable) => (Step::Variable(*variable), 1),
                    None => continue,
                },
                Node::Sum { terms, .. } => {
                    let (mut parts, mut degree) = (Vec::new(), 0);
                    for (term, q) in terms {
                        if let Some((place, of_term)) = moving.get(term) {
                            parts.push((*place, field::rational(q)?));
                            degree = degree.max(*of_term);
                        }
                    }
                    if parts.is_empty() {
                        continue;
                    }
                    (Step::Sum(parts), degree)
                }
                Node::Product { coefficient, factors } => {
                    match self.product_step(coefficient, factors, &moving, point)? {
                        Some(found) => found,
                        None => continue,
                    }
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
            moving.insert(e, (steps.len(), degree));
            steps.push(step);
        }
        // What does not depend on the symbols has no derivatives.
        if !moving.contains_key(&e) {
            steps.clear();
        }
        Some(steps)
    }

    /// A product with its degree, nothing where it does not depend on the symbols; none where its degree is above two.
    #[expect(clippy::option_option, reason = "no polynomial, or no part that moves")]
    fn product_step(
        &self,
        coefficient: &Rational,
        factors: &[(ExprId, Rational)],
        moving: &FxHashMap<ExprId, (usize, usize)>,
        point: usize,
    ) -> Option<Option<(Step, usize)>> {
        if !factors.iter().any(|(base, _)| moving.contains_key(base)) {
            return Some(None);
        }
        let mut factor = field::rational(coefficient)?;
        let (mut places, mut degree) = (Vec::new(), 0);
        let two = Rational::from_integer(2.into());
        for (base, q) in factors {
            match moving.get(base) {
                Some((place, of_base)) => {
                    let n = if q.is_one() { 1 } else { 2 };
                    if n == 2 && *q != two {
                        return None;
                    }
                    degree += n * of_base;
                    places.extend(std::iter::repeat_n(*place, n));
                }
                None => {
                    let power = match q.is_one() {
                        true => self.value_that_proves(*base, point)?,
                        false => field::power(self.value_that_proves(*base, point)?, q)?,
                    };
                    // A root of what is not known to be a square proves nothing.
                    if !q.is_integer() {
                        return None;
                    }
                    factor = field::mul(factor, power);
                }
            }
        }
        match places.as_slice() {
            [a] => Some(Some((Step::Multiple(factor, *a), degree))),
            [a, b] if degree <= 2 => Some(Some((Step::Product(factor, *a, *b), degree))),
            _ => None,
        }
    }
}

/// The gradient of the last step, of which what does not depend on the symbols is left out in sums, at a point with
/// these values of symbols and zeros.
fn gradient(steps: &[Step], n: usize, point: &[(usize, u64)]) -> Vec<u64> {
    let mut at = vec![0; n];
    point.iter().for_each(|(k, value)| at[*k] = *value);
    let mut values: Vec<u64> = Vec::with_capacity(steps.len());
    for step in steps {
        values.push(match step {
            Step::Variable(k) => at[*k],
            Step::Sum(terms) => {
                terms.iter().fold(0, |sum, (a, q)| field::add(sum, field::mul(*q, values[*a])))
            }
            Step::Multiple(factor, a) => field::mul(*factor, values[*a]),
            Step::Product(factor, a, b) => field::mul(*factor, field::mul(values[*a], values[*b])),
        });
    }
    let mut behind = vec![0; steps.len()];
    behind.last_mut().into_iter().for_each(|last| *last = field::ONE);
    let mut gradient = vec![0; n];
    let raise = |entry: &mut u64, by: u64| *entry = field::add(*entry, by);
    for (place, step) in steps.iter().enumerate().rev() {
        let slope = behind[place];
        match step {
            _ if slope == 0 => {}
            Step::Variable(k) => raise(&mut gradient[*k], slope),
            Step::Sum(terms) => {
                terms.iter().for_each(|(a, q)| raise(&mut behind[*a], field::mul(*q, slope)));
            }
            Step::Multiple(factor, a) => raise(&mut behind[*a], field::mul(*factor, slope)),
            Step::Product(factor, a, b) => {
                let along = field::mul(*factor, slope);
                raise(&mut behind[*a], field::mul(along, values[*b]));
                raise(&mut behind[*b], field::mul(along, values[*a]));
            }
        }
    }
    gradient
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `x`, two velocities, and the unit matrix.
    fn setting() -> (Graph, ExprId, [SymbolId; 2], Vec<Vec<ExprId>>) {
        let mut g = Graph::new();
        let [x, u, v] = ["x", "u", "v"].map(|name| g.symbol(name));
        let (zero, one) = (g.zero(), g.one());
        let x = g.sym(x);
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
        let (mut g, x, [u, v], unit) = setting();
        let cosine = g.func(crate::Func::Cos, x);
        let (one, two) = (g.one(), g.int(2));
        let first = square(&mut g, [u, v], [cosine, x, one, x]);
        let second = square(&mut g, [u, v], [two, cosine, x, one]);
        let e = g.add(first, second);
        let found = g.second_derivatives(e, &[u, v], (&unit, &unit)).expect("a polynomial");
        for (i, a) in [u, v].into_iter().enumerate() {
            for (j, b) in [u, v].into_iter().enumerate() {
                let slope = g.diff(e, a);
                let second = g.diff(slope, b);
                assert_eq!(Some(found.rows[i][j]), g.fingerprint(second)[0]);
            }
        }
        assert_eq!(found.rank(), 2);
        // Of one square it is of rank one, and along vectors it is a product.
        let alone = g.second_derivatives(first, &[u, v], (&unit, &unit)).expect("a polynomial");
        assert_eq!(alone.rank(), 1);
        assert!(!alone.is_zero(0, 1));
        let minus = g.neg(cosine);
        let kernel = vec![vec![x], vec![minus]];
        let along = g.second_derivatives(first, &[u, v], (&unit, &kernel)).expect("a polynomial");
        assert_eq!((along.rank(), along.is_zero(0, 0), along.is_zero(1, 0)), (0, true, true));
    }

    #[test]
    fn other_functions_have_none() {
        let (mut g, x, [u, v], unit) = setting();
        let [of_u, of_v] = [u, v].map(|s| g.sym(s));
        let cube = g.powi(of_u, 3);
        let sine = g.func(crate::Func::Sin, of_v);
        let quotient = g.div(of_u, of_v).expect("no zero");
        let square = g.powi(of_u, 2);
        let product = g.product(&[square, of_v]);
        for e in [cube, sine, quotient, product] {
            assert_eq!(g.second_derivatives(e, &[u, v], (&unit, &unit)), None);
        }
        // An opaque factor proves nothing; as a term it is none of the second derivatives.
        let angle = g.func(crate::Func::Atan, x);
        let (weighed, beside) = (g.mul(angle, square), g.add(angle, square));
        assert_eq!(g.second_derivatives(weighed, &[u, v], (&unit, &unit)), None);
        let found = g.second_derivatives(beside, &[u, v], (&unit, &unit)).expect("a polynomial");
        assert_eq!(found.rank(), 1);
        let found = g.second_derivatives(angle, &[u, v], (&unit, &unit)).expect("a polynomial");
        assert_eq!(found.rank(), 0);
        let moved = vec![vec![of_u], vec![of_v]];
        assert_eq!(g.second_derivatives(square, &[u, v], (&unit, &moved)), None);
    }
}
