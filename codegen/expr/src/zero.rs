//! The zero test: from values at random points, enclosures at real points, and exact expansion.
//!
//! Deliberately does not know: where the values come from.

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::arena::Arena;
use super::field::{self, Point};
use super::fingerprint::{has_even_denominator, is_character};
use super::graph::Graph;
use super::knowledge::{Base, Doubts, FURTHER, POINTS, Signs, UnknownSign, Vanishing};
use super::node::{ExprId, Func, Node, SymbolId};
use super::rational::Rational;

/// Expressions with more unknown signs are not evaluated for all patterns of signs.
const MAX_SIGNS: usize = 4;

/// Valid points that a verdict of zero needs.
const ENOUGH: usize = 4;

impl Graph {
    /// Whether the expression is known to vanish identically; `false` where it does not, and where nothing is known.
    ///
    /// `true` is structural, or from values at random points, with a chance of error below `1e-28` (of numbers:
    /// `5e-19`), or, where there are none, the outcome of exact expansion. Who would conclude something from `false`
    /// asks for [`Graph::vanishing`].
    pub fn is_zero(&mut self, e: ExprId) -> bool {
        self.verdict(e) == Vanishing::Zero
    }

    /// Whether the expression vanishes identically, does not, or whether that could not be found out.
    ///
    /// [`Vanishing::NonZero`] is proved: by a value in the prime field that no opaque value stands behind, or by an
    /// enclosure of a value at a real point.
    pub fn vanishing(&mut self, e: ExprId) -> Vanishing {
        match self.verdict(e) {
            Vanishing::Unknown if self.differs_at_a_real_point(e) => {
                self.verdicts.insert(e, Vanishing::NonZero);
                Vanishing::NonZero
            }
            verdict => verdict,
        }
    }

    /// As [`Graph::vanishing`], from the prime field and exact expansion alone.
    fn verdict(&mut self, e: ExprId) -> Vanishing {
        if e == Arena::ZERO {
            return Vanishing::Zero;
        }
        let first = self.first_verdict(e);
        if first != Vanishing::Unknown {
            return first;
        }
        if let Some(known) = self.verdicts.get(&e) {
            return *known;
        }
        let mut verdict = self.further_verdict(e);
        let differs = self.arena.fingerprint(e).iter().flatten().any(|v| *v != 0);
        if verdict == Vanishing::Unknown && !differs && self.expand(e) == Arena::ZERO {
            verdict = Vanishing::Zero;
        }
        self.verdicts.insert(e, verdict);
        verdict
    }

    /// The expression itself, or zero when it vanishes identically.
    pub fn cancel_zero(&mut self, e: ExprId) -> ExprId {
        if self.is_zero(e) { Arena::ZERO } else { e }
    }

    /// The same value without those `among` its symbols, all where none are given, that it does not depend on:
    /// `cos(x)^2 + sin(x)^2` is one.
    pub fn without_idle_symbols(&mut self, e: ExprId, among: Option<&[SymbolId]>) -> ExprId {
        let mut value = self.cancel_zero(e);
        let free = self.free_symbols(value);
        let symbols = among.map_or_else(|| free.iter().copied().collect(), <[SymbolId]>::to_vec);
        for symbol in symbols {
            if !self.free_symbols(value).contains(&symbol) {
                continue;
            }
            let slope = self.diff(value, symbol);
            if self.is_zero(slope) {
                let zero = self.zero();
                value = self.subs(value, &BTreeMap::from([(symbol, zero)])).unwrap_or(value);
            }
        }
        value
    }

    /// Whether two expressions are equal as functions.
    pub fn is_equal(&mut self, a: ExprId, b: ExprId) -> bool {
        a == b || {
            let difference = self.sub(a, b);
            self.is_zero(difference)
        }
    }

    /// Whether an expression is `sum +-a b` over some `(is_negative, a, b)`, as [`Graph::is_equal`]; the sum is made
    /// only where values at the first points do not decide.
    pub fn is_sum_of_products(&mut self, e: ExprId, products: &[(bool, ExprId, ExprId)]) -> bool {
        let parts = || products.iter().flat_map(|(_, a, b)| [*a, *b]).chain([e]);
        let doubts = parts().fold(Doubts::default(), |all, part| all.and(self.arena.doubts(part)));
        let values = (0..POINTS).filter_map(|point| {
            let at = |e: ExprId| self.arena.fingerprint(e)[point];
            products.iter().try_fold(at(e)?, |rest, (is_negative, a, b)| {
                let product = field::mul(at(*a)?, at(*b)?);
                Some(field::add(rest, if *is_negative { product } else { field::negate(product) }))
            })
        });
        let (mut n_valid, mut differs) = (0, false);
        for rest in values {
            n_valid += 1;
            differs |= rest != 0;
        }
        if differs && doubts == Doubts::default() {
            return false;
        }
        if !differs && n_valid >= ENOUGH {
            return true;
        }
        let mut terms = Vec::with_capacity(products.len());
        for (is_negative, a, b) in products {
            let product = self.mul(*a, *b);
            terms.push(if *is_negative { self.neg(product) } else { product });
        }
        let sum = self.sum(&terms);
        self.is_equal(e, sum)
    }

    /// As [`Graph::is_equal`], from values alone without multiplying out: false where these say nothing. Two valid
    /// points are enough here, with a chance of error below `1e-18`; where signs are unknown, the difference is looked
    /// into for all of them.
    pub fn fingerprints_agree(&mut self, a: ExprId, b: ExprId) -> bool {
        if a == b {
            return true;
        }
        match agreement(self.arena.fingerprint(a), self.arena.fingerprint(b)) {
            Some(true) => true,
            // An unknown sign has a value that says nothing about its square.
            Some(false) if self.arena.doubts(a).signed || self.arena.doubts(b).signed => {
                let difference = self.sub(a, b);
                self.further_verdict(difference) == Vanishing::Zero
            }
            Some(false) => false,
            // Behind roots few points are valid.
            None => match (self.arena.further_values(a), self.arena.further_values(b)) {
                (Some(x), Some(y)) => agreement(&x, &y).unwrap_or_else(|| {
                    let [a, b] = [a, b].map(|e| self.arena.extended_values(e).unwrap_or_default());
                    agreement(&a, &b) == Some(true)
                }),
                _ => false,
            },
        }
    }

    /// What the values at the first points tell, before anything is looked into.
    pub(super) fn first_verdict(&self, e: ExprId) -> Vanishing {
        let (fingerprint, doubts) = (self.arena.fingerprint(e), self.arena.doubts(e));
        let differs = fingerprint.iter().flatten().any(|v| *v != 0);
        let valid = fingerprint.iter().flatten().count();
        match (differs, doubts == Doubts::default()) {
            (true, true) => Vanishing::NonZero,
            (true, false) => Vanishing::Unknown,
            (false, _) if valid >= ENOUGH => Vanishing::Zero,
            (false, _) => Vanishing::Unknown,
        }
    }

    /// What more points and all signs tell.
    pub(super) fn further_verdict(&mut self, e: ExprId) -> Vanishing {
        let doubts = self.arena.doubts(e);
        if !doubts.signed {
            if doubts.opaque && self.arena.fingerprint(e).iter().flatten().any(|v| *v != 0) {
                return Vanishing::Unknown;
            }
            let Some(values) = self.arena.further_values(e) else { return Vanishing::Unknown };
            let first = self.arena.fingerprint(e).iter().flatten();
            let all = first.copied().chain(values.into_iter().flatten());
            let mut all: Vec<Point> = all.map(|value| (value, 0)).collect();
            // Behind many roots few points are valid.
            if all.len() < ENOUGH && all.iter().all(|value| *value == (0, 0)) {
                all.extend(self.arena.extended_values(e).into_iter().flatten().flatten());
            }
            return match (all.iter().any(|value| *value != (0, 0)), doubts.opaque) {
                (true, false) => Vanishing::NonZero,
                (true, true) => Vanishing::Unknown,
                (false, _) if all.len() >= ENOUGH => Vanishing::Zero,
                (false, _) => Vanishing::Unknown,
            };
        }
        let Some(all) = self.arena.all_behind(e, |_| false) else { return Vanishing::Unknown };
        let unknown = self.unknown_signs(&all);
        // Signs of what is equal, however it is written, are one.
        let mut distinct: Vec<UnknownSign> = Vec::new();
        let mut place = Vec::with_capacity(unknown.len());
        for sign in &unknown {
            let known = distinct.iter().position(|other| self.is_same_sign(*sign, *other));
            place.push(known.unwrap_or(distinct.len()));
            if known.is_none() {
                distinct.push(*sign);
            }
        }
        if distinct.len() > MAX_SIGNS {
            return Vanishing::Unknown;
        }
        // The sign of the field's root changes from point to point, so that every point is to be seen with all signs.
        let patterns: Vec<Signs> = (0_usize..1 << distinct.len())
            .map(|p| unknown.iter().zip(&place).map(|(sign, k)| (*sign, p >> k & 1 == 1)).collect())
            .collect();
        let (mut n_zero, mut n_mixed) = (0_usize, 0_usize);
        for point in 0..POINTS + FURTHER {
            let values = patterns.iter().map(|signs| self.value_for(e, &all, point, signs));
            let Some(values) = values.collect::<Option<Vec<u64>>>() else { continue };
            match values.iter().filter(|v| **v == 0).count() {
                0 if doubts.opaque => return Vanishing::Unknown,
                0 => return Vanishing::NonZero,
                n if n == values.len() => n_zero += 1,
                _ => n_mixed += 1,
            }
            if n_zero + n_mixed >= ENOUGH {
                break;
            }
        }
        match (n_zero, n_mixed) {
            (ENOUGH.., 0) => Vanishing::Zero,
            // Of a number some sign is the right one.
            (_, 1..) if !doubts.opaque && self.is_a_number_next_to_zero(e) => Vanishing::Zero,
            _ => Vanishing::Unknown,
        }
    }

    fn is_same_sign(&self, a: UnknownSign, b: UnknownSign) -> bool {
        match (a, b) {
            (UnknownSign::OfFactor(a), UnknownSign::OfFactor(b))
            | (UnknownSign::OfRoot(a), UnknownSign::OfRoot(b)) => {
                agreement(self.arena.fingerprint(a), self.arena.fingerprint(b)) == Some(true)
            }
            _ => false,
        }
    }

    /// The signs that the values of expressions depend on.
    fn unknown_signs(&self, all: &[ExprId]) -> Vec<UnknownSign> {
        let mut unknown: Vec<UnknownSign> = Vec::new();
        let mut add = |sign: UnknownSign| {
            if !unknown.contains(&sign) {
                unknown.push(sign);
            }
        };
        let of_power = |base: ExprId, q: &Rational, add: &mut dyn FnMut(UnknownSign)| {
            if has_even_denominator(q) && self.arena.knowledge().base(base) == Base::UpToSign {
                add(UnknownSign::OfRoot(base));
            }
        };
        for e in all {
            match self.node(*e) {
                Node::Product { factors, .. } => {
                    factors.iter().for_each(|(base, q)| of_power(*base, q, &mut add));
                }
                Node::Function(Func::Abs, a) => {
                    self.arena
                        .factors_with_signs(*a)
                        .1
                        .into_iter()
                        .for_each(|e| add(UnknownSign::OfFactor(e)));
                }
                Node::Function(f, a) if is_character(*f) => {
                    for (k, q) in self.arena.knowledge().argument(*a).into_iter().flatten() {
                        if let Some(base) = self.arena.knowledge().logarithm_term(*k) {
                            of_power(base, q, &mut add);
                        }
                        self.arena
                            .knowledge()
                            .factors_of_term(*k)
                            .for_each(|(base, q)| of_power(*base, q, &mut add));
                    }
                }
                _ => {}
            }
        }
        unknown
    }

    /// The value at a point for given signs, `all` being what is behind it.
    fn value_for(&self, e: ExprId, all: &[ExprId], point: usize, signs: &Signs) -> Option<u64> {
        let mut values: FxHashMap<ExprId, Option<u64>> = FxHashMap::default();
        for node in all {
            let at = |e: ExprId| values.get(&e).copied().flatten();
            let value = self.arena.value_of(self.node(*node), point, &at, Some(signs));
            values.insert(*node, value);
        }
        values.get(&e).copied().flatten()
    }
}

/// Rows that are no combinations of those before them, over functions: by elimination at a random point.
///
/// Rows depend on each other at a point where they do not as functions with the chance of a false zero, and where
/// opaque values stand behind them they may be told apart although they depend on each other. Where no point is valid
/// for all entries, every row that does not vanish counts.
pub fn independent_rows(g: &Graph, rows: &[Vec<ExprId>]) -> Vec<usize> {
    let value = |e: &ExprId, point: usize| g.fingerprint(*e)[point];
    let valid = |point: &usize| rows.iter().flatten().all(|e| value(e, *point).is_some());
    let Some(point) = (0..POINTS).find(valid) else {
        return (0..rows.len()).filter(|k| rows[*k].iter().any(|e| *e != g.zero())).collect();
    };
    independent(rows.iter().map(|row| row.iter().filter_map(|e| value(e, point)).collect()))
}

/// Rows of values that are no combinations of those before them.
pub(super) fn independent(rows: impl Iterator<Item = Vec<u64>>) -> Vec<usize> {
    // Reduced rows with a one at their pivot.
    let mut basis: Vec<(usize, Vec<u64>)> = Vec::new();
    let mut kept = Vec::new();
    for (k, mut rest) in rows.enumerate() {
        for (pivot, known) in &basis {
            let factor = field::negate(rest[*pivot]);
            if factor != 0 {
                rest.iter_mut().zip(known).for_each(|(x, y)| *x = field::add(*x, field::mul(factor, *y)));
            }
        }
        let pivot = rest.iter().position(|x| *x != 0);
        if let Some((pivot, scale)) = pivot.and_then(|pivot| Some((pivot, field::inverse(rest[pivot])?))) {
            rest.iter_mut().for_each(|x| *x = field::mul(*x, scale));
            basis.push((pivot, rest));
            kept.push(k);
        }
    }
    kept
}

/// Whether values are equal wherever both exist; none where that is at one point at most and they are.
fn agreement<T: Copy + PartialEq>(a: &[Option<T>], b: &[Option<T>]) -> Option<bool> {
    let equal: Vec<bool> = a.iter().zip(b).filter_map(|(x, y)| Some((*x)? == (*y)?)).collect();
    match equal.iter().all(|equal| *equal) {
        false => Some(false),
        true => (equal.len() >= 2).then_some(true),
    }
}
