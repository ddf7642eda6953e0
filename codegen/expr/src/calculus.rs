//! Differentiation, substitution, and the parts of affine functions.
//!
//! Deliberately does not know: what is a state, a velocity, a parameter.

use std::collections::{BTreeMap, BTreeSet};

use num_bigint::BigInt;
use num_traits::{One, Signed};
use rustc_hash::FxHashMap;

use super::arena::Arena;
use super::graph::{DivisionByZero, Graph};
use super::node::{ExprId, Func, Node, SymbolId};
use super::rational::Rational;

/// Partial derivatives of expressions that are made of each other, in one graph: each by the derivatives of its parts,
/// where these are known.
#[derive(Clone, Debug, Default)]
pub struct Partials {
    by_symbol: FxHashMap<SymbolId, FxHashMap<ExprId, ExprId>>,
}

impl Partials {
    /// The partial derivative of `e` by `x`, as [`Graph::diff`] has it. The graph is the same one at every call.
    pub fn diff(&mut self, g: &mut Graph, e: ExprId, x: SymbolId) -> ExprId {
        let known = self.by_symbol.entry(x).or_default();
        g.differentiate(&[e], &BTreeMap::from([(x, Arena::ONE)]), known);
        known[&e]
    }
}

impl Graph {
    /// The partial derivative of `e` by `x`.
    pub fn diff(&mut self, e: ExprId, x: SymbolId) -> ExprId {
        self.diff_all(&[e], x)[0]
    }

    /// Partial derivatives of several expressions by one symbol, sharing the work.
    pub fn diff_all(&mut self, roots: &[ExprId], x: SymbolId) -> Vec<ExprId> {
        self.derivatives(roots, &BTreeMap::from([(x, Arena::ONE)]))
    }

    /// The derivative of `e` along a motion, `sum over symbols s of de/ds s'`, with the rates of the symbols that move.
    ///
    /// Every part of `e` gets one rate, while there are as many partial derivatives of it as symbols.
    pub fn derivative_along(&mut self, e: ExprId, rates: &BTreeMap<SymbolId, ExprId>) -> ExprId {
        self.derivatives(&[e], rates)[0]
    }

    pub(super) fn derivatives(
        &mut self,
        roots: &[ExprId],
        rates: &BTreeMap<SymbolId, ExprId>,
    ) -> Vec<ExprId> {
        let mut derivative: FxHashMap<ExprId, ExprId> = FxHashMap::default();
        self.differentiate(roots, rates, &mut derivative);
        roots.iter().map(|e| derivative[e]).collect()
    }

    /// Adds the derivatives of expressions and of their parts that are not known yet.
    fn differentiate(
        &mut self,
        roots: &[ExprId],
        rates: &BTreeMap<SymbolId, ExprId>,
        derivative: &mut FxHashMap<ExprId, ExprId>,
    ) {
        let order = self.reachable_beside(roots, |e| derivative.contains_key(&e));
        self.charge(order.len());
        for e in order {
            let d = self.diff_node(e, rates, derivative);
            derivative.insert(e, d);
        }
    }

    fn diff_node(
        &mut self,
        e: ExprId,
        rates: &BTreeMap<SymbolId, ExprId>,
        derivative: &FxHashMap<ExprId, ExprId>,
    ) -> ExprId {
        // Most parts do not move: nothing of them is copied.
        let mut moves = false;
        self.node(e).for_each_operand(|operand| moves |= derivative[&operand] != Arena::ZERO);
        if !moves && !matches!(self.node(e), Node::Symbol(_)) {
            return Arena::ZERO;
        }
        match self.node(e).clone() {
            Node::Constant(_) | Node::Pi => Arena::ZERO,
            Node::Symbol(s) => rates.get(&s).copied().unwrap_or(Arena::ZERO),
            Node::Sum { terms, .. } => {
                let terms: Vec<_> = terms
                    .iter()
                    .filter(|(t, _)| derivative[t] != Arena::ZERO)
                    .map(|(t, q)| (derivative[t], q.clone()))
                    .collect();
                self.linear_combination(&terms)
            }
            Node::Product { coefficient, factors } => {
                // d(c prod b_k^q_k) = sum_k c q_k b_k^(q_k - 1) b_k' prod_{j != k} b_j^q_j
                let mut summands = Vec::new();
                for (k, (base, q)) in factors.iter().enumerate() {
                    let inner = derivative[base];
                    if inner == Arena::ZERO {
                        continue;
                    }
                    let mut rest: Vec<_> = factors.to_vec();
                    rest[k].1 -= Rational::one();
                    rest.push((inner, Rational::one()));
                    let term = self.power_product(&rest).expect("bases of a canonical product are not zero");
                    summands.push((term, &coefficient * q));
                }
                self.linear_combination(&summands)
            }
            Node::Function(f, a) => {
                let inner = derivative[&a];
                if inner == Arena::ZERO {
                    return Arena::ZERO;
                }
                // Where there is no derivative, the argument is locally constant: `asin(|x|/x)`.
                let Some(outer) = self.func_derivative(f, a, e) else { return Arena::ZERO };
                self.mul(outer, inner)
            }
            Node::Atan2(y, x) => {
                let (dy, dx) = (derivative[&y], derivative[&x]);
                if dy == Arena::ZERO && dx == Arena::ZERO {
                    return Arena::ZERO;
                }
                let Some([by_y, by_x]) = self.atan2_derivatives(y, x) else { return Arena::ZERO };
                let (along_y, along_x) = (self.mul(by_y, dy), self.mul(by_x, dx));
                self.add(along_y, along_x)
            }
        }
    }

    /// `f'(a)`, given `value = f(a)`; none where that divides by zero whatever the symbols are, as at `asin(1)` and
    /// `ln(0)`.
    pub fn func_derivative(&mut self, f: Func, a: ExprId, value: ExprId) -> Option<ExprId> {
        let one = Arena::ONE;
        let inverse = -Rational::one();
        Some(match f {
            Func::Sin => self.func(Func::Cos, a),
            Func::Cos => {
                let s = self.func(Func::Sin, a);
                self.neg(s)
            }
            Func::Tan => {
                let square = self.powi(value, 2);
                self.add(one, square)
            }
            Func::Asin | Func::Acos => {
                let square = self.powi(a, 2);
                let base = self.sub(one, square);
                let minus_half = Rational::new(BigInt::from(-1), BigInt::from(2));
                let d = self.power_product(&[(base, minus_half)]).ok()?;
                if f == Func::Asin { d } else { self.neg(d) }
            }
            Func::Atan => {
                let square = self.powi(a, 2);
                let base = self.add(one, square);
                self.power_product(&[(base, inverse)]).ok()?
            }
            Func::Exp => value,
            Func::Ln => self.power_product(&[(a, inverse)]).ok()?,
            Func::Sinh => self.func(Func::Cosh, a),
            Func::Cosh => self.func(Func::Sinh, a),
            Func::Tanh => {
                let square = self.powi(value, 2);
                self.sub(one, square)
            }
            Func::Stumpff(k) => {
                // c_k' = (k c_(k+2) - c_(k+1))/2: a function of the family, also where a vanishes.
                let half = |n: i64| Rational::new(BigInt::from(n), BigInt::from(2));
                let one = self.func(Func::Stumpff(k.saturating_add(1)), a);
                let two = self.func(Func::Stumpff(k.saturating_add(2)), a);
                self.linear_combination(&[(two, half(k.into())), (one, half(-1))])
            }
            Func::Turn(k) => {
                // tau_k' = (k + 1) tau_(k+1): a function of the family, also at the identity.
                let next = self.func(Func::Turn(k.saturating_add(1)), a);
                self.scale(next, &Rational::from(BigInt::from(i32::from(k) + 1)))
            }
            // |a|' = |a| / a, wrong only at a = 0 where there is no derivative.
            Func::Abs => self.power_product(&[(value, Rational::one()), (a, inverse)]).ok()?,
        })
    }

    /// The partial derivatives of `atan2(y, x)`, `x/(x^2 + y^2)` by `y` and `-y/(x^2 + y^2)` by `x`; none at the
    /// origin.
    pub fn atan2_derivatives(&mut self, y: ExprId, x: ExprId) -> Option<[ExprId; 2]> {
        let (squared_y, squared_x) = (self.powi(y, 2), self.powi(x, 2));
        let square = self.add(squared_x, squared_y);
        let minus = self.neg(y);
        let inverse = self.power_product(&[(square, -Rational::one())]).ok()?;
        Some([x, minus].map(|numerator| self.mul(numerator, inverse)))
    }

    /// Replaces symbols by expressions, all at once.
    ///
    /// # Errors
    /// [`DivisionByZero`] when a substituted denominator vanishes identically.
    pub fn subs(
        &mut self,
        e: ExprId,
        replacements: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<ExprId, DivisionByZero> {
        Ok(self.subs_all(&[e], replacements)?[0])
    }

    /// [`Graph::subs`] on several expressions, sharing the work.
    ///
    /// # Errors
    /// [`DivisionByZero`] when a substituted denominator vanishes identically.
    pub fn subs_all(
        &mut self,
        roots: &[ExprId],
        replacements: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<Vec<ExprId>, DivisionByZero> {
        self.rebuild_all(roots, replacements, Graph::func)
    }

    /// The expression with every function of it, innermost first, made by `function` from its new argument.
    ///
    /// # Errors
    /// [`DivisionByZero`] when a new denominator vanishes identically.
    pub fn rebuild(
        &mut self,
        e: ExprId,
        function: impl FnMut(&mut Graph, Func, ExprId) -> ExprId,
    ) -> Result<ExprId, DivisionByZero> {
        Ok(self.rebuild_all(&[e], &BTreeMap::new(), function)?[0])
    }

    fn rebuild_all(
        &mut self,
        roots: &[ExprId],
        replacements: &BTreeMap<SymbolId, ExprId>,
        mut function: impl FnMut(&mut Graph, Func, ExprId) -> ExprId,
    ) -> Result<Vec<ExprId>, DivisionByZero> {
        let mut image: FxHashMap<ExprId, ExprId> = FxHashMap::default();
        let order = self.reachable(roots);
        self.charge(order.len());
        for e in order {
            let is_combined = matches!(self.node(e), Node::Sum { .. } | Node::Product { .. });
            let mut is_same = is_combined;
            self.node(e).for_each_operand(|operand| is_same &= image[&operand] == operand);
            if is_same {
                image.insert(e, e);
                continue;
            }
            let replaced = match self.node(e).clone() {
                Node::Constant(_) | Node::Pi => e,
                Node::Symbol(s) => replacements.get(&s).copied().unwrap_or(e),
                Node::Sum { constant, terms } => {
                    let mut list: Vec<_> = terms.iter().map(|(t, q)| (image[t], q.clone())).collect();
                    list.push((Arena::ONE, constant));
                    self.linear_combination(&list)
                }
                Node::Product { coefficient, factors } => {
                    let list: Vec<_> = factors.iter().map(|(b, q)| (image[b], q.clone())).collect();
                    if list.iter().any(|(b, q)| q.is_negative() && self.is_zero(*b)) {
                        return Err(DivisionByZero);
                    }
                    let product = self.power_product(&list)?;
                    self.scale(product, &coefficient)
                }
                Node::Function(f, a) => function(self, f, image[&a]),
                Node::Atan2(y, x) => self.atan2(image[&y], image[&x]),
            };
            image.insert(e, replaced);
        }
        Ok(roots.iter().map(|e| image[e]).collect())
    }

    /// Coefficients of `e` as an affine function of `unknowns`: `e = sum_k a_k unknown_k + b`.
    ///
    /// Returns `None` when `e` is not affine in them.
    pub fn affine_parts(&mut self, e: ExprId, unknowns: &[SymbolId]) -> Option<(Vec<ExprId>, ExprId)> {
        self.affine_parts_by(&mut Partials::default(), e, unknowns)
    }

    /// The same, by partial derivatives that are known.
    pub fn affine_parts_by(
        &mut self,
        partials: &mut Partials,
        e: ExprId,
        unknowns: &[SymbolId],
    ) -> Option<(Vec<ExprId>, ExprId)> {
        let all: BTreeSet<SymbolId> = unknowns.iter().copied().collect();
        let mut slopes = Vec::with_capacity(unknowns.len());
        let mentioned = self.free_symbols(e);
        for x in unknowns {
            if !mentioned.contains(x) {
                slopes.push(Arena::ZERO);
                continue;
            }
            let slope = partials.diff(self, e, *x);
            // A slope may mention the unknowns structurally and still not depend on them.
            let mut constant = true;
            let of_slope = self.free_symbols(slope);
            for y in all.intersection(&of_slope) {
                let second = partials.diff(self, slope, *y);
                constant &= self.is_zero(second);
            }
            if !constant {
                return None;
            }
            slopes.push(slope);
        }
        let zeros: BTreeMap<SymbolId, ExprId> = unknowns.iter().map(|s| (*s, Arena::ZERO)).collect();
        let mut parts = slopes;
        parts.push(e);
        let mut parts = self.subs_all(&parts, &zeros).ok()?;
        let offset = parts.pop()?;
        let parts = parts.into_iter().map(|a| self.cancel_zero(a)).collect();
        let offset = self.cancel_zero(offset);
        Some((parts, offset))
    }
}
