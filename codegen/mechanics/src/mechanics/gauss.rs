//! Gauss's function of the accelerations of linked bodies, from which they are eliminated from the last part of a
//! recursion to the first.
//!
//! `1/2 H_ij d_i d_j + g_i d_i`, of what the rates `wdot` add to the rates of change of parts and velocities, is least
//! for the motion. A part is substituted by those that it is computed from once no other part is computed from it, so
//! that `H` has masses and moments of everything behind it: composite bodies. A rate of which no part is left is
//! eliminated by the minimum itself, at once (articulated bodies), or with all others (the mass matrix). Deliberately
//! does not know: how parts are found, which order is cheaper.
//!
//! # Source
//! Gauss 1829, the principle of least constraint; Featherstone 2008, Rigid Body Dynamics Algorithms, chapters 6 and 7.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::Zero;

use crate::reduction::SolvedConstraint;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId, Vanishing};

use super::derive::Derivation;
use super::kane::AtRest;
use super::recursion::{Recursion, Step};

/// Forces of more terms are not multiplied out.
const MAX_TERMS: usize = 1000;

/// A rate of change, relative to its value at `udot = 0`.
struct Variable {
    name: String,
    /// The variables before it that it follows from, with their factors; none for the rates `wdot`.
    slopes: Option<Vec<(usize, ExprId)>>,
}

/// `1/2 H_ij d_i d_j + g_i d_i`.
pub(super) struct Gauss {
    /// First the rates `wdot`, then each after those that it follows from.
    variables: Vec<Variable>,
    n_rates: usize,
    /// The rates, and the unknowns by these.
    n_by_rates: usize,
    of_symbol: BTreeMap<SymbolId, usize>,
    /// `H_ij` for `i <= j`; others vanish.
    h: BTreeMap<(usize, usize), ExprId>,
    g: Vec<ExprId>,
}

/// How a variable was eliminated.
enum Eliminated {
    /// By its slopes.
    Substituted(usize),
    /// `d = -z - u_j d_j`.
    Least { rate: usize, pivot: ExprId, z: ExprId, u: Vec<(usize, ExprId)> },
}

/// When rates are eliminated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// After all parts, by the factors of the mass matrix.
    Composite,
    /// As soon as no part follows from them.
    Articulated,
}

fn key(i: usize, j: usize) -> (usize, usize) {
    (i.min(j), i.max(j))
}

impl Gauss {
    /// The variables whose entry with `i` is not zero, but for `i`.
    fn beside(&self, i: usize) -> Vec<usize> {
        let others = self.h.keys().filter_map(|(a, b)| match (*a == i, *b == i) {
            (true, false) => Some(*b),
            (false, true) => Some(*a),
            _ => None,
        });
        others.collect()
    }

    fn slopes(&self, i: usize) -> &[(usize, ExprId)] {
        self.variables[i].slopes.as_deref().unwrap_or_default()
    }

    fn take(&mut self, i: usize, j: usize) -> Option<ExprId> {
        self.h.remove(&key(i, j))
    }
}

/// The equations along the rates of a recursion, eliminated in some order.
pub(super) struct Elimination {
    gauss: Gauss,
    eliminated: Vec<Eliminated>,
}

impl Derivation<'_> {
    /// Gauss's function, with what there is at `rest`.
    fn gauss(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        rest: &AtRest,
    ) -> Result<Gauss, Error> {
        let directions = &recursion.directions;
        let mut gauss = Gauss {
            variables: Vec::new(),
            n_rates: solved.unknowns.len(),
            n_by_rates: 0,
            of_symbol: BTreeMap::new(),
            h: BTreeMap::new(),
            g: Vec::new(),
        };
        for (unknown, part) in solved.unknowns.iter().zip(&directions.parts) {
            let symbol = part.unwrap_or(unknown.symbol);
            gauss.of_symbol.insert(symbol, gauss.variables.len());
            let name = self.g.name(symbol).to_owned();
            gauss.variables.push(Variable { name, slopes: None });
        }
        for (unknown, row) in solved.unknowns.iter().zip(&directions.inverse) {
            if gauss.of_symbol.contains_key(&unknown.symbol) {
                continue;
            }
            let row = row.iter().enumerate().filter(|(_, q)| !q.is_zero());
            let slopes = row.map(|(b, q)| (b, self.g.rational(q.clone()))).collect();
            gauss.of_symbol.insert(unknown.symbol, gauss.variables.len());
            gauss.variables.push(Variable { name: unknown.name.clone(), slopes: Some(slopes) });
        }
        gauss.n_by_rates = gauss.variables.len();
        for step in &recursion.steps {
            let (symbol, value, coefficient) = match step {
                Step::Part(symbol, value) => (*symbol, *value, None),
                Step::Solved { alpha, coefficient, rest } => {
                    (self.system.velocities[*alpha], *rest, Some(*coefficient))
                }
            };
            if gauss.of_symbol.contains_key(&symbol) {
                continue;
            }
            let mut slopes = self.slopes(recursion, &gauss, value)?;
            if let Some(coefficient) = coefficient {
                for (_, slope) in &mut slopes {
                    *slope = self.solved_for(*slope, coefficient);
                }
            }
            gauss.of_symbol.insert(symbol, gauss.variables.len());
            let name = self.g.name(symbol).to_owned();
            gauss.variables.push(Variable { name, slopes: Some(slopes) });
        }
        gauss.g = vec![self.g.zero(); gauss.variables.len()];
        self.writer.begin("masses and forces of the parts");
        for (k, square) in recursion.squares.iter().enumerate() {
            let mut slopes = Vec::with_capacity(square.components.len());
            for (i, e) in recursion.components[k].iter().enumerate() {
                let force = self.define(&format!("ma{}_{}", k + 1, i + 1), rest.forces[k][i]);
                let own = self.slopes(recursion, &gauss, *e)?;
                for (a, slope) in &own {
                    let along = self.g.mul(*slope, force);
                    gauss.g[*a] = self.g.add(gauss.g[*a], along);
                }
                slopes.push(own);
            }
            for (i, j, weight) in &square.masses {
                for (a, slope) in &slopes[*i] {
                    for (b, other) in slopes[*j].iter().filter(|(b, _)| b <= a) {
                        let term = self.g.product(&[*weight, *slope, *other]);
                        self.increase(&mut gauss, *a, *b, term);
                    }
                }
            }
        }
        let rest_hessian = self.hessian_of(recursion.rest)?;
        let net = self.net_of_rest(&rest_hessian, rest);
        let places: Vec<Option<usize>> =
            self.system.velocities.iter().map(|s| gauss.of_symbol.get(s).copied()).collect();
        for (alpha, a) in places.iter().enumerate() {
            let Some(a) = *a else { continue };
            gauss.g[a] = self.g.sub(gauss.g[a], net[alpha]);
            for (beta, b) in places.iter().enumerate().take(alpha + 1) {
                if let Some(b) = *b {
                    self.increase(&mut gauss, a, b, rest_hessian[alpha][beta]);
                }
            }
        }
        // Forces along unknowns as they are written: along rates most of neighbouring ones cancels.
        for a in gauss.n_rates..gauss.n_by_rates {
            let force = std::mem::replace(&mut gauss.g[a], self.g.zero());
            for (b, slope) in gauss.slopes(a).to_vec() {
                let along = self.g.mul(slope, force);
                gauss.g[b] = self.g.add(gauss.g[b], along);
            }
        }
        for b in 0..gauss.n_rates {
            gauss.g[b] = self.shorter(gauss.g[b]);
        }
        Ok(gauss)
    }

    /// Multiplied out where that is shorter: terms of products cancel each other then.
    fn shorter(&mut self, e: ExprId) -> ExprId {
        if self.g.n_terms_expanded(e) > MAX_TERMS {
            return e;
        }
        let expanded = self.g.expand(e);
        let size = |g: &Graph, e: ExprId| g.reachable(&[e]).len();
        if size(&self.g, expanded) < size(&self.g, e) { expanded } else { e }
    }

    fn increase(&mut self, gauss: &mut Gauss, i: usize, j: usize, term: ExprId) {
        if term != self.g.zero() {
            let zero = self.g.zero();
            let entry = gauss.h.entry(key(i, j)).or_insert(zero);
            *entry = self.g.add(*entry, term);
        }
    }

    /// The derivatives of an expression by the variables.
    fn slopes(
        &mut self,
        recursion: &Recursion,
        gauss: &Gauss,
        e: ExprId,
    ) -> Result<Vec<(usize, ExprId)>, Error> {
        let mut slopes = Vec::new();
        for symbol in self.g.free_symbols(e) {
            let Some(i) = gauss.of_symbol.get(&symbol) else { continue };
            let slope = self.g.diff(e, symbol);
            let slope = self.in_recursion(recursion, slope)?;
            let slope = self.define(&format!("{}_of", gauss.variables[*i].name), slope);
            if slope != self.g.zero() {
                slopes.push((*i, slope));
            }
        }
        Ok(slopes)
    }

    /// Eliminates the parts, and in the order of articulated bodies the rates as well; none where a rate has a pivot
    /// that could vanish.
    pub(super) fn eliminate(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        rest: &AtRest,
        order: Order,
    ) -> Result<Option<Elimination>, Error> {
        let gauss = self.gauss(recursion, solved, rest)?;
        self.writer.begin(match order {
            Order::Composite => "composite bodies, from the last to the first",
            Order::Articulated => "articulated bodies, from the last to the first",
        });
        let mut elimination = Elimination { gauss, eliminated: Vec::new() };
        let gauss = &mut elimination.gauss;
        let mut left: BTreeSet<usize> = (0..gauss.variables.len()).collect();
        // How many of those left follow from each.
        let mut followers = vec![0_usize; gauss.variables.len()];
        for i in 0..gauss.variables.len() {
            gauss.slopes(i).iter().for_each(|(j, _)| followers[*j] += 1);
        }
        // The last rate that each follows from.
        let mut last_rate: Vec<usize> = Vec::with_capacity(gauss.variables.len());
        for i in 0..gauss.variables.len() {
            let of_parents = gauss.slopes(i).iter().map(|(j, _)| last_rate[*j]).max();
            last_rate.push(of_parents.unwrap_or(i));
        }
        while let Some(block) = self.next(gauss, &left, (&followers, &last_rate), order) {
            self.g.within_budget()?;
            for i in &block {
                left.remove(i);
                gauss.slopes(*i).iter().for_each(|(j, _)| followers[*j] -= 1);
            }
            match block[..] {
                [rate] if gauss.variables[rate].slopes.is_none() => {
                    let Some(found) = self.least(gauss, rate) else { return Ok(None) };
                    elimination.eliminated.push(found);
                }
                _ => {
                    self.substitute(gauss, &block);
                    elimination.eliminated.extend(block.into_iter().map(Eliminated::Substituted));
                }
            }
        }
        Ok(Some(elimination))
    }

    /// What is eliminated next: first parts of numbers alone, then rates, then other parts, those of the last rate
    /// first; parts that follow from the same one together.
    ///
    /// So a body is done with before the next one is begun. A chain of which some parts run ahead, such as heights that
    /// need no turning angles, has entries between these and everything behind: operations of pendulums in space then
    /// grow with the square of their number.
    fn next(
        &mut self,
        gauss: &Gauss,
        left: &BTreeSet<usize>,
        (followers, last_rate): (&[usize], &[usize]),
        order: Order,
    ) -> Option<Vec<usize>> {
        let ripe: Vec<usize> = left.iter().copied().filter(|i| followers[*i] == 0).collect();
        let (rates, parts): (Vec<usize>, Vec<usize>) =
            ripe.into_iter().partition(|i| gauss.variables[*i].slopes.is_none());
        let plain: Vec<usize> = parts
            .iter()
            .copied()
            .filter(|i| {
                let row = gauss.beside(*i).into_iter().chain([*i]);
                row.filter_map(|j| gauss.h.get(&key(*i, j))).all(|e| !self.writer.varies(&self.g, *e))
            })
            .collect();
        let together = |list: &[usize]| {
            let last = *list.iter().max_by_key(|i| (last_rate[**i], **i))?;
            let from: BTreeSet<usize> = gauss.slopes(last).iter().map(|(j, _)| *j).collect();
            let is_beside = |i: &usize| *i == last || gauss.slopes(*i).iter().any(|(j, _)| from.contains(j));
            Some(list.iter().copied().filter(is_beside).collect::<Vec<_>>())
        };
        if let Some(block) = together(&plain) {
            return Some(block);
        }
        if order == Order::Articulated
            && let Some(rate) = rates.last()
        {
            return Some(vec![*rate]);
        }
        together(&parts)
    }

    /// `d_p = c_pi d_i`: `H_ij + c_pi H_pq c_qj + c_pi H_pj + H_ip c_pj` and `g_i + c_pi g_p`.
    fn substitute(&mut self, gauss: &mut Gauss, block: &[usize]) {
        let is_in_block: BTreeSet<usize> = block.iter().copied().collect();
        let mut cross: BTreeMap<(usize, usize), ExprId> = BTreeMap::new();
        let mut own: BTreeMap<(usize, usize), ExprId> = BTreeMap::new();
        for p in block {
            for j in gauss.beside(*p) {
                if !is_in_block.contains(&j)
                    && let Some(e) = gauss.take(*p, j)
                {
                    cross.insert((*p, j), e);
                }
            }
        }
        for (n, p) in block.iter().enumerate() {
            for q in &block[n..] {
                if let Some(e) = gauss.take(*p, *q) {
                    own.insert((*p, *q), e);
                    own.insert((*q, *p), e);
                }
            }
        }
        let parents: Vec<usize> = {
            let all: BTreeSet<usize> =
                block.iter().flat_map(|p| gauss.slopes(*p).iter().map(|(i, _)| *i)).collect();
            all.into_iter().collect()
        };
        // `H_pq c_qj + H_pj`
        let mut whole: BTreeMap<(usize, usize), ExprId> = BTreeMap::new();
        for p in block {
            for j in &parents {
                let mut terms = Vec::new();
                for q in block {
                    let slope = gauss.slopes(*q).iter().find(|(i, _)| i == j);
                    if let (Some((_, slope)), Some(h)) = (slope, own.get(&(*p, *q))) {
                        terms.push(self.g.mul(*h, *slope));
                    }
                }
                terms.extend(cross.get(&(*p, *j)));
                let sum = self.g.sum(&terms);
                let name = format!("H_{}_{}", gauss.variables[*p].name, gauss.variables[*j].name);
                let named = self.define(&name, sum);
                whole.insert((*p, *j), named);
            }
        }
        let mut terms: BTreeMap<(usize, usize), Vec<ExprId>> = BTreeMap::new();
        for p in block {
            for (i, slope) in gauss.slopes(*p) {
                for j in parents.iter().filter(|j| *j >= i) {
                    terms.entry((*i, *j)).or_default().push(self.g.mul(*slope, whole[&(*p, *j)]));
                }
                for ((_, j), e) in cross.range((*p, 0)..=(*p, usize::MAX)) {
                    // Those beside a parent are in `whole` on one side of the diagonal.
                    if !parents.contains(j) || j <= i {
                        terms.entry(key(*i, *j)).or_default().push(self.g.mul(*slope, *e));
                    }
                }
            }
        }
        for ((i, j), list) in terms {
            let sum = self.g.sum(&list);
            self.increase(gauss, i, j, sum);
            self.settle(gauss, i, j);
        }
        for i in &parents {
            let mut terms = vec![gauss.g[*i]];
            for p in block {
                if let Some((_, slope)) = gauss.slopes(*p).iter().find(|(j, _)| j == i) {
                    terms.push(self.g.mul(*slope, gauss.g[*p]));
                }
            }
            let sum = self.g.sum(&terms);
            gauss.g[*i] = self.define(&format!("g_{}", gauss.variables[*i].name), sum);
        }
    }

    /// Gives an entry its name.
    fn settle(&mut self, gauss: &mut Gauss, i: usize, j: usize) {
        if let Some(e) = gauss.h.get(&key(i, j)).copied() {
            let name = format!("H_{}_{}", gauss.variables[i].name, gauss.variables[j].name);
            let named = self.define(&name, e);
            if named == self.g.zero() {
                gauss.h.remove(&key(i, j));
            } else {
                gauss.h.insert(key(i, j), named);
            }
        }
    }

    /// The minimum over a rate.
    fn least(&mut self, gauss: &mut Gauss, rate: usize) -> Option<Eliminated> {
        let name = gauss.variables[rate].name.clone();
        let pivot = gauss.take(rate, rate)?;
        let pivot = self.define(&format!("D_{name}"), pivot);
        if self.g.vanishing(pivot) != Vanishing::NonZero {
            return None;
        }
        let inverse = self.g.powi(pivot, -1);
        let mut row = Vec::new();
        for j in gauss.beside(rate) {
            let Some(e) = gauss.take(rate, j) else { continue };
            let u = self.g.mul(e, inverse);
            let u = self.define(&format!("U_{name}_{}", gauss.variables[j].name), u);
            row.push((j, e, u));
        }
        for (n, (i, e, _)) in row.iter().enumerate() {
            for (j, _, u) in &row[..=n] {
                let product = self.g.mul(*u, *e);
                let product = self.g.neg(product);
                self.increase(gauss, *i, *j, product);
                self.settle(gauss, *i, *j);
            }
        }
        let force = self.define(&format!("g_{name}"), gauss.g[rate]);
        let z = self.g.mul(force, inverse);
        let z = self.define(&format!("z_{name}"), z);
        for (i, e, _) in &row {
            let product = self.g.mul(*e, z);
            let left = self.g.sub(gauss.g[*i], product);
            gauss.g[*i] = self.define(&format!("g_{}", gauss.variables[*i].name), left);
        }
        let u = row.into_iter().map(|(j, _, u)| (j, u)).collect();
        Some(Eliminated::Least { rate, pivot, z, u })
    }

    /// `A` and `f` of `A wdot = f`, where parts alone have been eliminated.
    pub(super) fn composite(&mut self, elimination: &Elimination) -> (Vec<Vec<ExprId>>, Vec<ExprId>) {
        let gauss = &elimination.gauss;
        let zero = self.g.zero();
        let entry = |i: usize, j: usize| gauss.h.get(&key(i, j)).copied().unwrap_or(zero);
        let k = gauss.n_rates;
        let matrix = (0..k).map(|i| (0..k).map(|j| entry(i, j)).collect()).collect();
        let force = gauss.g[..k].iter().map(|g| self.g.neg(*g)).collect();
        (matrix, force)
    }

    /// The rates `wdot` called `labels` that are not `known`, with their pivots by position, and what they add to the
    /// rates of the velocities of the frame.
    pub(super) fn rates_of(
        &mut self,
        elimination: &Elimination,
        labels: &[String],
        known: Option<&[ExprId]>,
    ) -> (Vec<ExprId>, Vec<(usize, ExprId)>, Vec<ExprId>) {
        self.writer.begin("accelerations from the first part to the last");
        let gauss = &elimination.gauss;
        let mut values = vec![self.g.zero(); gauss.variables.len()];
        if let Some(known) = known {
            values[..known.len()].copy_from_slice(known);
        }
        let mut pivots = Vec::new();
        for step in elimination.eliminated.iter().rev() {
            match step {
                Eliminated::Substituted(p) => {
                    let slopes = gauss.slopes(*p);
                    let terms: Vec<ExprId> = slopes.iter().map(|(i, c)| self.g.mul(*c, values[*i])).collect();
                    let sum = self.g.sum(&terms);
                    values[*p] = self.define(&format!("add_{}", gauss.variables[*p].name), sum);
                }
                Eliminated::Least { rate, pivot, z, u } => {
                    let mut terms = vec![*z];
                    terms.extend(u.iter().map(|(j, u)| self.g.mul(*u, values[*j])));
                    let sum = self.g.sum(&terms);
                    let value = self.g.neg(sum);
                    values[*rate] = self.define(&labels[*rate], value);
                    pivots.push((*rate, *pivot));
                }
            }
        }
        let zero = self.g.zero();
        let velocities = self.system.velocities.iter();
        let added = velocities.map(|s| gauss.of_symbol.get(s).map_or(zero, |i| values[*i])).collect();
        pivots.reverse();
        (values[..gauss.n_rates].to_vec(), pivots, added)
    }
}
