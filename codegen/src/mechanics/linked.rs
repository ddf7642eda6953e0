//! Accelerations of linked bodies in the order of elimination that takes the fewest operations.
//!
//! Deliberately does not know: what an order does ([`super::kane`], [`super::gauss`]), how parts are found.

use crate::error::Error;
use crate::expr::{ExprId, Graph, Rational, SectionWriter};
use crate::reduction::SolvedConstraint;

use super::constrained::inertias;
use super::derive::{Derivation, Motion};
use super::equations::LinearSystem;
use super::gauss::Order;
use super::kane::{AtRest, Kane};
use super::recursion::Recursion;
use super::solve::{Pivot, PivotMatrix};

/// How accelerations of linked bodies are found.
#[derive(Clone, Copy, Debug)]
enum Way {
    /// From the first body to the last, once for every rate: few rates for many bodies.
    PartialVelocities,
    /// From the last body to the first.
    Eliminated(Order),
}

const WAYS: [Way; 3] =
    [Way::PartialVelocities, Way::Eliminated(Order::Composite), Way::Eliminated(Order::Articulated)];

/// Most rates along which partial velocities are tried: their number grows with the square of the bodies. Arms in the
/// plane take more operations that way from four rates on (`LINKAGES="arm:4" cargo test -p hamel-codegen --test
/// linkages measured`), and systems of more rates than this are taken for such.
const MAX_PARTIAL: usize = 6;

/// Another way than partial velocities has to take fewer operations by more than this part of them: lowering, which
/// finds common divisors, changes what is written by more than that. Of the ways of a snake of five links, which are
/// 342, 343 and 341 operations as written and 205, 197 and 209 lowered, the first is kept
/// (`LINKAGES="snake:5" cargo test -p hamel-codegen --test main linkages::measured`).
const CLOSE: usize = 50;

impl Derivation<'_> {
    /// The motion along the rates of a recursion, in the way that takes the fewest operations.
    pub(super) fn solve_linked(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
    ) -> Result<Motion, Error> {
        let rest = self.at_rest(recursion)?;
        let before = (self.g.clone(), self.writer.clone());
        let mut best: Option<(usize, Graph, SectionWriter, Motion)> = None;
        let mut margin = 0;
        let mut failure = None;
        for way in WAYS {
            if matches!(way, Way::PartialVelocities) && solved.unknowns.len() > MAX_PARTIAL {
                continue;
            }
            let spent = std::mem::replace(&mut self.g, before.0.clone());
            self.g.take_over(&spent);
            self.writer = before.1.clone();
            let motion = match self.solve_in(way, recursion, solved, &rest) {
                Ok(Some(motion)) => motion,
                Ok(None) => continue,
                Err(e) => {
                    self.g.within_budget()?;
                    failure = Some(e);
                    continue;
                }
            };
            let roots: Vec<ExprId> =
                motion.acceleration.iter().chain(&motion.unknown_rates).copied().collect();
            let n = self.n_operations(&roots);
            let is_first = matches!(way, Way::PartialVelocities);
            if best.as_ref().is_none_or(|(least, ..)| n + margin < *least) {
                margin = if is_first { n / CLOSE } else { 0 };
                best = Some((n, self.g.clone(), self.writer.clone(), motion));
            }
        }
        let Some((_, graph, writer, motion)) = best else {
            return Err(failure.unwrap_or(Error::SingularMassMatrix { direction: "every rate".into() }));
        };
        let spent = std::mem::replace(&mut self.g, graph);
        self.g.take_over(&spent);
        self.writer = writer;
        Ok(motion)
    }

    fn solve_in(
        &mut self,
        way: Way,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        rest: &AtRest,
    ) -> Result<Option<Motion>, Error> {
        let order = match way {
            Way::PartialVelocities => {
                let Kane { mass_matrix, force, partial } = self.kane(recursion, solved, rest)?;
                let (wdot, pivots) = self.solve_assembled(solved, &mass_matrix, &force)?;
                let psi: Vec<Vec<ExprId>> = (0..self.y.len())
                    .map(|alpha| partial.iter().map(|of_rate| of_rate[alpha]).collect())
                    .collect();
                let added = self.along(&psi, &wdot);
                let system = self.along_unknowns(recursion, solved, (&mass_matrix, &force));
                return self.moved(recursion, solved, system, (&wdot, pivots), (&added, rest)).map(Some);
            }
            Way::Eliminated(order) => order,
        };
        let Some(composite) = self.eliminate(recursion, solved, rest, Order::Composite)? else {
            return Ok(None);
        };
        let (mass_matrix, force) = self.composite(&composite);
        let system = self.along_unknowns(recursion, solved, (&mass_matrix, &force));
        let names: Vec<String> = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        let labels: Vec<String> = names.iter().map(|name| format!("dot_{name}")).collect();
        let (wdot, pivots, added) = match order {
            Order::Composite => {
                let (wdot, pivots) = self.solve_assembled(solved, &mass_matrix, &force)?;
                let (_, _, added) = self.rates_of(&composite, &labels, Some(&wdot));
                (wdot, pivots, added)
            }
            Order::Articulated => {
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
        self.moved(recursion, solved, system, (&wdot, pivots), (&added, rest)).map(Some)
    }

    /// The motion by the rates `wdot`: `udot = B wdot`.
    fn moved(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        system: LinearSystem,
        (wdot, pivots): (&[ExprId], Vec<Pivot>),
        (added, rest): (&[ExprId], &AtRest),
    ) -> Result<Motion, Error> {
        let inverse = &recursion.directions.inverse;
        let udot = inverse.iter().map(|row| self.combined(row, wdot)).collect();
        self.motion_of(solved, system, (udot, pivots), (added, &rest.velocities))
    }

    /// `T^T A T udot = T^T f`, for those who ask for them.
    fn along_unknowns(
        &mut self,
        recursion: &Recursion,
        solved: &SolvedConstraint,
        (mass_matrix, force): (&[Vec<ExprId>], &[ExprId]),
    ) -> LinearSystem {
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
        LinearSystem { mass_matrix, force, unknowns }
    }

    fn combined(&mut self, weights: &[Rational], values: &[ExprId]) -> ExprId {
        let terms: Vec<(ExprId, Rational)> = values.iter().copied().zip(weights.iter().cloned()).collect();
        self.g.linear_combination(&terms)
    }
}
