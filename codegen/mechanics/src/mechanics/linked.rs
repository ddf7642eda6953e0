//! Accelerations of linked bodies in the order of elimination that takes the fewest operations.
//!
//! Deliberately does not know: what an order does ([`super::kane`], [`super::gauss`]), how parts are found.

use num_traits::Zero;

use crate::reduction::SolvedConstraint;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Rational, Trials};

use super::constrained::inertias;
use super::derive::{Derivation, Motion};
use super::equations::LinearSystem;
use super::gauss::Order;
use super::kane::{Accelerated, Kane};
use super::limits::{CLOSE, MAX_PARTIAL};
use super::order::{work_by_values, work_of_factors};
use super::recursion::Recursion;
use super::solve::{Pivot, PivotMatrix};
use super::written::mass_matrix_by_values;

/// How accelerations of linked bodies are found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Way {
    /// From the first body to the last, once for every rate: few rates for many bodies.
    PartialVelocities,
    /// From the last body to the first.
    Eliminated(Order),
}

/// Accelerations found in some way.
struct Found {
    motion: Motion,
    /// The mass matrix along the rates of the recursion; empty where the rates alone are asked for.
    matrix: Vec<Vec<ExprId>>,
    /// Their rates of change.
    wdot: Vec<ExprId>,
}

const COMPOSITE: Way = Way::Eliminated(Order::Composite);
const ARTICULATED: Way = Way::Eliminated(Order::Articulated);

impl Derivation<'_> {
    /// The motion along the rates of a recursion, in the way that takes the fewest operations.
    pub(super) fn solve_linked(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
    ) -> Result<Motion, Error> {
        let rest = self.at_rest(recursion)?;
        let mut trials = Trials::new(self);
        let mut margin = 0;
        let mut failure = None;
        let n_rates = solved.unknowns.len();
        // Among many rates the factors of a dense matrix take longer to write than everything else does.
        let ways: &[Way] = match n_rates > MAX_PARTIAL {
            true => &[ARTICULATED, COMPOSITE],
            false => &[Way::PartialVelocities, COMPOSITE, ARTICULATED],
        };
        for way in ways.iter().copied() {
            let is_first = way == Way::PartialVelocities;
            let least = trials.cost().filter(|_| n_rates > MAX_PARTIAL).map(|cost| cost / 2);
            let is_kept = trials.attempt(self, margin, |d| {
                let found = match d.solve_in(way, (recursion, solved), &rest, least) {
                    Ok(found) => found?,
                    Err(e) => {
                        failure = Some(e);
                        return None;
                    }
                };
                let Motion { acceleration, unknown_rates, .. } = &found.motion;
                let roots: Vec<ExprId> = acceleration.iter().chain(unknown_rates).copied().collect();
                // Of two ways with as many operations, composite bodies are kept.
                Some((2 * d.n_operations(&roots) + u64::from(way == ARTICULATED), found))
            });
            self.g.within_budget()?;
            if is_kept {
                margin = trials.cost().filter(|_| is_first).map_or(0, |cost| 2 * (cost / 2 / CLOSE));
            }
        }
        let nothing = || failure.unwrap_or(Error::SingularMassMatrix { direction: "every rate".into() });
        let Found { mut motion, matrix, wdot } = trials.finish(self).ok_or_else(nothing)?;
        if let Some(system) = &mut motion.system {
            let balance = self.balance_of_linked(recursion, solved, &matrix, &wdot)?;
            system.balance = Some(Box::new(balance));
        }
        Ok(motion)
    }

    /// None where a pivot could vanish, and where a mass matrix takes more operations to factor than the `least` of
    /// another way.
    fn solve_in(
        &mut self,
        way: Way,
        (recursion, solved): (&Recursion, &SolvedConstraint),
        rest: &Accelerated,
        least: Option<u64>,
    ) -> Result<Option<Found>, Error> {
        let order = match way {
            Way::PartialVelocities => {
                let Kane { mass_matrix, force, partial } = self.kane(recursion, solved, rest)?;
                let (wdot, pivots) = self.solve_assembled(solved, &mass_matrix, &force)?;
                let psi: Vec<Vec<ExprId>> = (0..self.y.len())
                    .map(|alpha| partial.iter().map(|of_rate| of_rate[alpha]).collect())
                    .collect();
                let added = self.along(&psi, &wdot);
                let system = self.along_unknowns(recursion, solved, (&mass_matrix, &force));
                let motion = self.moved(recursion, solved, system, (&wdot, pivots), (&added, rest))?;
                return Ok(Some(Found { motion, matrix: mass_matrix, wdot }));
            }
            Way::Eliminated(order) => order,
        };
        if order == Order::Composite
            && !self.is_whole()
            && let Some(least) = least
            && self.work_along_rates(recursion, solved) > least
        {
            return Ok(None);
        }
        let composite = match order == Order::Composite || self.is_whole() {
            true => self.eliminate(recursion, solved, rest, Order::Composite)?,
            false => None,
        };
        let (mass_matrix, force) = composite.as_ref().map(|c| self.composite(c)).unwrap_or_default();
        let system = self.along_unknowns(recursion, solved, (&mass_matrix, &force));
        let names: Vec<String> = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        let labels: Vec<String> = names.iter().map(|name| format!("dot_{name}")).collect();
        let (wdot, pivots, added) = match order {
            Order::Composite => {
                let Some(composite) = composite else { return Ok(None) };
                if least.is_some_and(|least| work_of_factors(&self.g, &self.writer, &mass_matrix) > least) {
                    return Ok(None);
                }
                let (wdot, pivots) = self.solve_assembled(solved, &mass_matrix, &force)?;
                let (_, _, added) = self.rates_of(&composite, &labels, Some(&wdot));
                (wdot, pivots, added)
            }
            Order::Articulated => {
                if composite.is_none() && self.is_whole() {
                    return Ok(None);
                }
                let Some(articulated) = self.eliminate(recursion, solved, rest, order)? else {
                    return Ok(None);
                };
                let (wdot, found, added) = self.rates_of(&articulated, &labels, None);
                let names = inertias(&names);
                let matrix = PivotMatrix { name: "A".into(), is_symmetric: true, follows_hessian: true };
                let of_rates = found.into_iter().map(|(a, expr)| Pivot {
                    name: names[a].clone(),
                    expr,
                    matrix: matrix.clone(),
                    origin: None,
                });
                let of_constraints =
                    solved.pivots.iter().map(|(name, expr)| Pivot::of_coefficients(name, *expr));
                (wdot, of_rates.chain(of_constraints).collect(), added)
            }
        };
        let motion = self.moved(recursion, solved, system, (&wdot, pivots), (&added, rest))?;
        Ok(Some(Found { motion, matrix: mass_matrix, wdot }))
    }

    /// Operations of the factors of the mass matrix along the rates `w` with `u = B w`, before it is made; zero where
    /// its values say nothing.
    fn work_along_rates(&self, recursion: &Recursion, solved: &SolvedConstraint) -> u64 {
        let inverse = &recursion.directions.inverse;
        // In a copy: nothing of it is left over.
        let mut g = self.g.clone();
        let zero = g.zero();
        let mut along = Vec::with_capacity(solved.psi.len());
        for row in &solved.psi {
            let mut terms: Vec<Vec<(ExprId, Rational)>> = vec![Vec::new(); inverse.len()];
            for (entry, weights) in row.iter().zip(inverse).filter(|(entry, _)| **entry != zero) {
                for (terms, q) in terms.iter_mut().zip(weights).filter(|(_, q)| !q.is_zero()) {
                    terms.push((*entry, q.clone()));
                }
            }
            along.push(terms.iter().map(|terms| g.linear_combination(terms)).collect());
        }
        let sides = (along.as_slice(), along.as_slice());
        let matrix = mass_matrix_by_values(&mut g, self.system, sides);
        matrix.map_or(0, |matrix| work_by_values(&matrix))
    }

    /// The motion by the rates `wdot`: `udot = B wdot`.
    fn moved(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        system: Option<LinearSystem>,
        (wdot, pivots): (&[ExprId], Vec<Pivot>),
        (added, rest): (&[ExprId], &Accelerated),
    ) -> Result<Motion, Error> {
        let inverse = &recursion.directions.inverse;
        let udot = inverse.iter().map(|row| self.combined(row, wdot)).collect();
        self.motion_of(solved, system, (udot, pivots), (added, &rest.velocities))
    }

    /// `T^T A T udot = T^T f`, where somebody asks for them.
    fn along_unknowns(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        (mass_matrix, force): (&[Vec<ExprId>], &[ExprId]),
    ) -> Option<LinearSystem> {
        if !self.is_whole() {
            return None;
        }
        let rates = &recursion.directions.rates;
        let columns: Vec<Vec<Rational>> =
            (0..rates.len()).map(|a| rates.iter().map(|row| row[a].clone()).collect()).collect();
        let half: Vec<Vec<ExprId>> = (mass_matrix.iter())
            .map(|row| columns.iter().map(|column| self.combined(column, row)).collect())
            .collect();
        let rows = columns.iter().map(|column| {
            (0..columns.len())
                .map(|b| {
                    let of_column: Vec<ExprId> = half.iter().map(|row| row[b]).collect();
                    self.combined(column, &of_column)
                })
                .collect()
        });
        let mass_matrix: Vec<Vec<ExprId>> = rows.collect();
        let force = columns.iter().map(|column| self.combined(column, force)).collect();
        let unknowns = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        Some(LinearSystem { mass_matrix, force, unknowns, balance: None })
    }

    fn combined(&mut self, weights: &[Rational], values: &[ExprId]) -> ExprId {
        let terms: Vec<(ExprId, Rational)> = values.iter().copied().zip(weights.iter().cloned()).collect();
        self.g.linear_combination(&terms)
    }
}
