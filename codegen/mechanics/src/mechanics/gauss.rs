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
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::algebra::tableau::{Least, QuadraticForm, Slopes};

use super::derive::Derivation;
use super::kane::Accelerated;
use super::limits::MAX_EXPANDED;
use super::recursion::Recursion;

/// What entries of the function are called.
const STEMS: [&str; 2] = ["H", "g"];

/// A rate of change, relative to its value at `udot = 0`: the variables before it that it follows from, with their
/// factors; none for the rates `wdot`.
type Variable = Option<Vec<(usize, ExprId)>>;

/// `1/2 H_ij d_i d_j + g_i d_i`.
pub(super) struct Gauss {
    /// First the rates `wdot`, then each after those that it follows from.
    variables: Vec<Variable>,
    /// What entries are called after, by variable.
    names: Vec<String>,
    n_rates: usize,
    /// The rates, and the unknowns by these.
    n_by_rates: usize,
    of_symbol: BTreeMap<SymbolId, usize>,
    form: QuadraticForm,
}

/// How a variable was eliminated.
enum Eliminated {
    /// By its slopes.
    Substituted(usize),
    /// By the minimum over a rate.
    Least(usize, Least),
}

/// When rates are eliminated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    /// After all parts, by the factors of the mass matrix.
    Composite,
    /// As soon as no part follows from them.
    Articulated,
}

impl Gauss {
    fn slopes(&self, i: usize) -> &[(usize, ExprId)] {
        self.variables[i].as_deref().unwrap_or_default()
    }

    fn is_rate(&self, i: usize) -> bool {
        self.variables[i].is_none()
    }

    fn push(&mut self, symbol: SymbolId, name: &str, variable: Variable) {
        self.of_symbol.insert(symbol, self.variables.len());
        self.names.push(name.to_owned());
        self.variables.push(variable);
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
        rest: &Accelerated,
    ) -> Result<Gauss, Error> {
        let directions = &recursion.directions;
        let mut gauss = Gauss {
            variables: Vec::new(),
            names: Vec::new(),
            n_rates: solved.unknowns.len(),
            n_by_rates: 0,
            of_symbol: BTreeMap::new(),
            form: QuadraticForm::default(),
        };
        for (unknown, part) in solved.unknowns.iter().zip(&directions.parts) {
            let symbol = part.unwrap_or(unknown.symbol);
            gauss.push(symbol, self.g.name(symbol), None);
        }
        for (unknown, row) in solved.unknowns.iter().zip(&directions.inverse) {
            if gauss.of_symbol.contains_key(&unknown.symbol) {
                continue;
            }
            let row = row.iter().enumerate().filter(|(_, q)| !q.is_zero());
            let slopes = row.map(|(b, q)| (b, self.g.rational(q.clone()))).collect();
            gauss.push(unknown.symbol, &unknown.name, Some(slopes));
        }
        gauss.n_by_rates = gauss.variables.len();
        for step in &recursion.steps {
            let (symbol, value, coefficient) = step.value(self.system);
            if gauss.of_symbol.contains_key(&symbol) {
                continue;
            }
            let mut slopes = self.slopes(recursion, &gauss, value)?;
            if let Some(coefficient) = coefficient {
                for (_, slope) in &mut slopes {
                    *slope = self.solved_for(*slope, coefficient);
                }
            }
            gauss.push(symbol, self.g.name(symbol), Some(slopes));
        }
        gauss.form.g = vec![self.g.zero(); gauss.variables.len()];
        self.writer.begin("masses and forces of the parts");
        for (k, square) in recursion.squares.iter().enumerate() {
            let mut slopes = Vec::with_capacity(square.components.len());
            for (i, e) in recursion.components[k].iter().enumerate() {
                let force = self.define(&format!("ma{}_{}", k + 1, i + 1), rest.forces[k][i]);
                let own = self.slopes(recursion, &gauss, *e)?;
                for (a, slope) in &own {
                    let along = self.g.mul(*slope, force);
                    gauss.form.g[*a] = self.g.add(gauss.form.g[*a], along);
                }
                slopes.push(own);
            }
            for (i, j, weight) in &square.masses {
                for (a, slope) in &slopes[*i] {
                    for (b, other) in slopes[*j].iter().filter(|(b, _)| b <= a) {
                        let term = self.g.product(&[*weight, *slope, *other]);
                        gauss.form.increase(&mut self.g, *a, *b, term);
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
            gauss.form.g[a] = self.g.sub(gauss.form.g[a], net[alpha]);
            for (beta, b) in places.iter().enumerate().take(alpha + 1) {
                if let Some(b) = *b {
                    gauss.form.increase(&mut self.g, a, b, rest_hessian[alpha][beta]);
                }
            }
        }
        // Forces along unknowns as they are written: along rates most of neighbouring ones cancels.
        for a in gauss.n_rates..gauss.n_by_rates {
            let force = std::mem::replace(&mut gauss.form.g[a], self.g.zero());
            for (b, slope) in gauss.slopes(a).to_vec() {
                let along = self.g.mul(slope, force);
                gauss.form.g[b] = self.g.add(gauss.form.g[b], along);
            }
        }
        for b in 0..gauss.n_rates {
            gauss.form.g[b] = self.shorter(gauss.form.g[b]);
        }
        Ok(gauss)
    }

    /// Multiplied out where that is shorter: terms of products cancel each other then.
    fn shorter(&mut self, e: ExprId) -> ExprId {
        if self.g.n_terms_expanded(e) > MAX_EXPANDED {
            return e;
        }
        let expanded = self.g.expand(e);
        let size = |g: &Graph, e: ExprId| g.reachable(&[e]).len();
        if size(&self.g, expanded) < size(&self.g, e) { expanded } else { e }
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
            let slope = self.define(&format!("{}_of", gauss.names[*i]), slope);
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
        rest: &Accelerated,
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
                [rate] if gauss.is_rate(rate) => {
                    let Gauss { form, names, .. } = gauss;
                    let Some(found) = form.least(&mut self.pen(names, STEMS), rate) else { return Ok(None) };
                    elimination.eliminated.push(Eliminated::Least(rate, found));
                }
                _ => {
                    let Gauss { form, names, variables, .. } = gauss;
                    let slopes = |p: &usize| variables[*p].as_deref().unwrap_or_default();
                    let taken: Vec<(usize, &Slopes)> = block.iter().map(|p| (*p, slopes(p))).collect();
                    form.substitute(&mut self.pen(names, STEMS), &taken);
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
        let (rates, parts): (Vec<usize>, Vec<usize>) = ripe.into_iter().partition(|i| gauss.is_rate(*i));
        let plain: Vec<usize> = parts
            .iter()
            .copied()
            .filter(|i| {
                let row = gauss.form.beside(*i).into_iter().chain([*i]);
                row.filter_map(|j| gauss.form.entry(*i, j)).all(|e| !self.writer.varies(&self.g, e))
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

    /// `A` and `f` of `A wdot = f`, where parts alone have been eliminated.
    pub(super) fn composite(&mut self, elimination: &Elimination) -> (Vec<Vec<ExprId>>, Vec<ExprId>) {
        let gauss = &elimination.gauss;
        let zero = self.g.zero();
        let entry = |i: usize, j: usize| gauss.form.entry(i, j).unwrap_or(zero);
        let k = gauss.n_rates;
        let matrix = (0..k).map(|i| (0..k).map(|j| entry(i, j)).collect()).collect();
        let force = gauss.form.g[..k].iter().map(|g| self.g.neg(*g)).collect();
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
                    values[*p] = self.define(&format!("add_{}", gauss.names[*p]), sum);
                }
                Eliminated::Least(rate, Least { pivot, z, u }) => {
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
