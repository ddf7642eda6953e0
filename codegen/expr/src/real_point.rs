//! Enclosures of expressions at real points: a proof of "not zero" that holds whatever functions stand behind them.
//!
//! A ball, midpoint and radius, encloses the value of every node; radii bound the propagated and the new rounding
//! errors. A ball of the whole expression that leaves zero out proves that it does not vanish identically.
//! Deliberately does not know: the prime field.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::ToPrimitive;
use rustc_hash::FxHashMap;

use super::graph::Graph;
use super::node::{ExprId, Func, Node, SymbolId};
use super::rational::{Rational, rational_to_f64};

/// Points that are tried.
const ATTEMPTS: u64 = 12;
/// Expressions with more nodes behind them get no enclosure.
const MAX_NODES: usize = 4000;
/// A bound on the relative error of the library's functions, with room to spare.
const FUNCTION_ERROR: f64 = 16.0 * f64::EPSILON;

/// A midpoint and a radius; finite.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ball {
    pub(super) middle: f64,
    pub(super) radius: f64,
}

impl Ball {
    fn new(middle: f64, radius: f64) -> Option<Ball> {
        (middle.is_finite() && radius.is_finite()).then_some(Ball { middle, radius })
    }

    fn number(x: f64) -> Option<Ball> {
        Ball::new(x, x.abs() * f64::EPSILON)
    }

    fn excludes_zero(self) -> bool {
        self.middle.abs() > self.radius
    }

    /// A function that rises or falls all over the ball, from the values at its ends.
    fn monotone(self, f: impl Fn(f64) -> f64) -> Option<Ball> {
        let [low, middle, high] = [self.middle - self.radius, self.middle, self.middle + self.radius].map(f);
        let radius = (high - middle).abs().max((middle - low).abs());
        Ball::new(middle, radius + FUNCTION_ERROR * (middle.abs() + radius))
    }

    /// A function whose slope is at most `slope` in the ball.
    fn gentle(self, f: impl Fn(f64) -> f64, slope: f64) -> Option<Ball> {
        let value = f(self.middle);
        Ball::new(value, slope * self.radius * (1.0 + FUNCTION_ERROR) + FUNCTION_ERROR * value.abs())
    }

    fn times(self, other: Ball) -> Option<Ball> {
        let middle = self.middle * other.middle;
        let radius =
            self.middle.abs() * other.radius + other.middle.abs() * self.radius + self.radius * other.radius;
        Ball::new(middle, radius * (1.0 + FUNCTION_ERROR) + FUNCTION_ERROR * middle.abs())
    }

    fn power(self, q: &Rational) -> Option<Ball> {
        let (low, exponent) = (self.middle.abs() - self.radius, rational_to_f64(q));
        if q.is_integer() {
            let n = q.numer().to_i32()?;
            if n > 0 && low <= 0.0 {
                return Ball::new(
                    0.0,
                    (self.middle.abs() + self.radius).powi(n) * (1.0 + FUNCTION_ERROR * f64::from(n)),
                );
            }
            if low <= 0.0 {
                return None;
            }
            let size = Ball { middle: self.middle.abs(), radius: self.radius };
            let raised = size.monotone(|x| x.powi(n))?;
            let sign = if n % 2 != 0 && self.middle < 0.0 { -1.0 } else { 1.0 };
            return Ball::new(
                sign * raised.middle,
                raised.radius * (1.0 + f64::from(n.abs()) * FUNCTION_ERROR),
            );
        }
        // The rounded exponent moves the power by its logarithm.
        let raised =
            (self.middle > 0.0 && low > 0.0).then(|| self.monotone(|x| x.powf(exponent))).flatten()?;
        let moved = FUNCTION_ERROR * exponent.abs() * (self.middle.ln().abs() + 1.0) * raised.middle.abs();
        Ball::new(raised.middle, raised.radius + moved)
    }

    fn function(self, f: Func) -> Option<Ball> {
        match f {
            Func::Sin | Func::Cos => self.gentle(|x| f.eval(x), 1.0),
            Func::Abs => Ball::new(self.middle.abs(), self.radius),
            Func::Tan => self
                .function(Func::Sin)?
                .times(self.function(Func::Cos)?.power(&-Rational::from_integer(1.into()))?),
            Func::Stumpff(k) => {
                // |c_k| <= 1/k! and |c_k'| <= 1/(k + 2)! from zero on, and less than twice that from -1 on.
                let inverse = |k: u8| 2.0 / (1..=k).map(f64::from).product::<f64>();
                let ball = self.gentle(|x| f.eval(x), inverse(k + 2))?;
                (k < 100 && self.middle - self.radius >= -1.0)
                    .then(|| Ball::new(ball.middle, ball.radius + FUNCTION_ERROR * inverse(k)))
                    .flatten()
            }
            Func::Cosh => self.gentle(f64::cosh, (self.middle.abs() + self.radius).sinh()),
            Func::Asin
            | Func::Acos
            | Func::Atan
            | Func::Exp
            | Func::Ln
            | Func::Sinh
            | Func::Tanh
            | Func::Turn(_) => self.monotone(|x| f.eval(x)),
        }
    }

    /// The angle of the point `(x, y)`, away from the cut along the negative axis.
    fn angle(y: Ball, x: Ball) -> Option<Ball> {
        let (distance, radius) = (y.middle.hypot(x.middle), y.radius + x.radius);
        let is_cut = x.middle - x.radius <= 0.0 && y.middle.abs() <= y.radius;
        if is_cut || distance <= 4.0 * radius {
            return None;
        }
        let value = y.middle.atan2(x.middle);
        Ball::new(value, 2.0 * radius / (distance - radius) + FUNCTION_ERROR * value.abs())
    }
}

impl Graph {
    /// Whether the expression was seen to have a value other than zero at a real point.
    pub(super) fn differs_at_a_real_point(&self, e: ExprId) -> bool {
        (0..ATTEMPTS).any(|attempt| self.ball(e, attempt).is_some_and(Ball::excludes_zero))
    }

    /// Whether the expression is a number, and zero to ten digits.
    pub(super) fn is_a_number_next_to_zero(&self, e: ExprId) -> bool {
        let Some(all) = self.all_behind_at_real_points(e) else { return false };
        let is_number =
            !all.iter().any(|e| matches!(self.node(*e), Node::Symbol(s) if self.definition(*s).is_none()));
        is_number && self.ball(e, 0).is_some_and(|ball| !ball.excludes_zero() && ball.radius < 1e-10)
    }

    /// The expression and all that it is made of, also behind names; none if that is too much.
    fn all_behind_at_real_points(&self, e: ExprId) -> Option<Vec<ExprId>> {
        let mut seen = rustc_hash::FxHashSet::default();
        let mut pending = vec![e];
        while let Some(e) = pending.pop() {
            if seen.insert(e) {
                if seen.len() > MAX_NODES {
                    return None;
                }
                match self.node(e) {
                    Node::Symbol(s) => pending.extend(self.definition(*s)),
                    node => node.for_each_operand(|operand| pending.push(operand)),
                }
            }
        }
        let mut all: Vec<ExprId> = seen.into_iter().collect();
        all.sort_unstable();
        Some(all)
    }

    /// The value at a pseudo-random point of rational coordinates: positive ones, as of parameters, at every other
    /// attempt.
    fn ball(&self, e: ExprId, attempt: u64) -> Option<Ball> {
        let mut balls: FxHashMap<ExprId, Ball> = FxHashMap::default();
        for e in self.all_behind_at_real_points(e)? {
            let ball = match self.node(e) {
                Node::Constant(c) => Ball::number(rational_to_f64(c))?,
                Node::Pi => Ball::number(std::f64::consts::PI)?,
                Node::Symbol(s) => match self.definition(*s) {
                    Some(definition) => balls[&definition],
                    None => {
                        let drawn = super::field::hash(s.index() as u64 * ATTEMPTS + attempt) % 1024;
                        let size = (drawn as f64 + 32.0) / 512.0;
                        Ball::new(if attempt % 2 == 1 { size - 1.0 } else { size }, 0.0)?
                    }
                },
                Node::Sum { constant, terms } => {
                    let mut total = Ball::number(rational_to_f64(constant))?;
                    for (t, q) in terms {
                        let term = balls[t].times(Ball::number(rational_to_f64(q))?)?;
                        let middle = total.middle + term.middle;
                        let radius = (total.radius + term.radius) * (1.0 + FUNCTION_ERROR);
                        total = Ball::new(
                            middle,
                            radius + f64::EPSILON * (total.middle.abs() + term.middle.abs()),
                        )?;
                    }
                    total
                }
                Node::Product { coefficient, factors } => {
                    let mut total = Ball::number(rational_to_f64(coefficient))?;
                    for (base, q) in factors {
                        total = total.times(balls[base].power(q)?)?;
                    }
                    total
                }
                Node::Function(f, a) => balls[a].function(*f)?,
                Node::Atan2(y, x) => Ball::angle(balls[y], balls[x])?,
            };
            balls.insert(e, ball);
        }
        balls.get(&e).copied()
    }
}

/// Values of expressions at a real point in doubles, without enclosures: where two of them are far apart, so are the
/// functions; where they are not, nothing is known.
#[derive(Clone, Debug)]
pub struct RealValues {
    /// What the values are computed from, operands first, also behind names.
    order: Vec<ExprId>,
    values: FxHashMap<ExprId, f64>,
}

/// Relative distance from which on two values are not one value with rounding errors.
const APART: f64 = 1e-6;

impl RealValues {
    /// The values of expressions and of all that they are made of.
    pub fn new(g: &mut Graph, roots: &[ExprId]) -> RealValues {
        let mut seen = rustc_hash::FxHashSet::default();
        let mut pending = roots.to_vec();
        while let Some(e) = pending.pop() {
            if seen.insert(e) {
                match g.node(e) {
                    Node::Symbol(s) => pending.extend(g.definition(*s)),
                    node => node.for_each_operand(|operand| pending.push(operand)),
                }
            }
        }
        let mut order: Vec<ExprId> = seen.into_iter().collect();
        order.sort_unstable();
        g.charge(order.len());
        let mut values = FxHashMap::default();
        for e in &order {
            let value = g.real_value(*e, &|operand| values[&operand]);
            values.insert(*e, value);
        }
        RealValues { order, values }
    }

    /// The `roots` that are seen to change with the symbols, when these get other values.
    pub fn seen_to_change(
        &self,
        g: &mut Graph,
        roots: &[ExprId],
        symbols: &BTreeMap<SymbolId, ExprId>,
    ) -> BTreeSet<ExprId> {
        let mut changed: FxHashMap<ExprId, f64> = FxHashMap::default();
        let mut n_visited = 0;
        for e in &self.order {
            let given = match g.node(*e) {
                Node::Symbol(s) => symbols.get(s),
                _ => None,
            };
            let mut is_touched = given.is_some();
            match g.node(*e) {
                Node::Symbol(s) => is_touched |= g.definition(*s).is_some_and(|d| changed.contains_key(&d)),
                node => node.for_each_operand(|operand| is_touched |= changed.contains_key(&operand)),
            }
            if !is_touched {
                continue;
            }
            n_visited += 1;
            let at = |operand: ExprId| changed.get(&operand).copied().unwrap_or(self.values[&operand]);
            let value = match given {
                Some(given) => g.as_rational(*given).map_or(f64::NAN, rational_to_f64),
                None => g.real_value(*e, &at),
            };
            changed.insert(*e, value);
        }
        g.charge(n_visited);
        let is_apart = |e: &ExprId| {
            changed.get(e).is_some_and(|value| {
                let own = self.values[e];
                (value - own).abs() > APART * (value.abs() + own.abs())
            })
        };
        roots.iter().copied().filter(is_apart).collect()
    }
}

impl Graph {
    /// The value of a node in doubles from the values of its operands; symbols are numbers between one half and two.
    fn real_value(&self, e: ExprId, at: &dyn Fn(ExprId) -> f64) -> f64 {
        let power = |base: f64, q: &Rational| match q.is_integer().then(|| q.numer().to_i32()).flatten() {
            Some(n) => base.powi(n),
            None => base.powf(rational_to_f64(q)),
        };
        match self.node(e) {
            Node::Constant(c) => rational_to_f64(c),
            Node::Pi => std::f64::consts::PI,
            Node::Symbol(s) => match self.definition(*s) {
                Some(definition) => at(definition),
                None => 0.5 + (super::field::hash(s.index() as u64) % 1024) as f64 / 683.0,
            },
            Node::Sum { constant, terms } => {
                terms.iter().fold(rational_to_f64(constant), |sum, (e, q)| sum + rational_to_f64(q) * at(*e))
            }
            Node::Product { coefficient, factors } => factors
                .iter()
                .fold(rational_to_f64(coefficient), |product, (base, q)| product * power(at(*base), q)),
            Node::Function(f, a) => f.eval(at(*a)),
            Node::Atan2(y, x) => at(*y).atan2(at(*x)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `y = x + 1` by a name, `x - x cos(0)` that cancels only in value, and what does not mention `x`.
    #[test]
    fn what_changes_with_a_symbol_is_seen_through_names_and_what_cancels_is_not() {
        let mut g = Graph::new();
        let [x, z] = ["x", "z"].map(|name| g.symbol(name));
        let (xe, ze, one) = (g.sym(x), g.sym(z), g.one());
        let sum = g.add(xe, one);
        let y = g.define("y", sum);
        let ye = g.sym(y);
        let moving = g.mul(ye, ze);
        // (x + 1) z - y z
        let product = g.mul(sum, ze);
        let still = g.sub(product, moving);
        let values = RealValues::new(&mut g, &[moving, still, ze]);
        let zero = g.zero();
        let found = values.seen_to_change(&mut g, &[moving, still, ze], &BTreeMap::from([(x, zero)]));
        assert_eq!(found, BTreeSet::from([moving]));
    }
}
