//! Coordinates of the states that satisfy the constraints: all of the state where velocities are eliminated, without as
//! many velocities or momenta as there are constraints where multipliers keep them.
//!
//! Does not know: what is computed in the coordinates.

use std::collections::BTreeMap;

use crate::reduction::StateKind;
use hamel_expr::error::Error;
use hamel_expr::{
    Definition, ExprId, Graph, Rational, Section, SymbolId, Vanishing, independent_rows, inlined,
};
use hamel_lang::algebra::tableau::{determinant_of, solve_symbolic};
use hamel_lang::spec::Want;

use super::equations::{Equations, OutputKind};

/// Coordinates of the states that satisfy the constraints.
#[derive(Clone, Debug)]
pub(super) struct Chart {
    /// Positions in the state of the components that are coordinates.
    pub(super) coordinates: Vec<usize>,
    /// `d residual/d z` by the components that are none: what a density by all components is divided by.
    pub(super) determinant: ExprId,
    /// Whether a component that is none is a root of a quadratic equation.
    pub(super) has_root: bool,
    /// The components that are none.
    values: BTreeMap<SymbolId, ExprId>,
    /// The definitions of the equations without names of others in them.
    definitions: BTreeMap<SymbolId, ExprId>,
}

impl Chart {
    /// The coordinates of a system.
    ///
    /// # Errors
    /// [`Error::NoBracket`] for residuals that depend on each other, and for ones that are neither affine in velocities
    /// or momenta together, nor one after the other affine or quadratic in one of them.
    pub(super) fn new(g: &mut Graph, equations: &Equations) -> Result<Chart, Error> {
        let definitions = inlined(g, equations.sections.iter().flat_map(|s| &s.definitions));
        let n = equations.state.len();
        let determinant = g.one();
        let mut chart = Chart {
            coordinates: (0..n).collect(),
            determinant,
            has_root: false,
            values: BTreeMap::new(),
            definitions,
        };
        let residuals = equations.outputs.iter().filter(|o| o.kind == OutputKind::Group(Want::Constraint));
        // The equations of motion are what they are beside equations between coordinates as well.
        let positions: Vec<ExprId> = equations.system.positions.iter().map(|p| p.residual).collect();
        let residuals = residuals.flat_map(|o| o.components.iter().map(|(_, e)| *e));
        let residuals: Vec<ExprId> = residuals.filter(|e| !positions.contains(e)).collect();
        if residuals.is_empty() {
            return Ok(chart);
        }
        let singular = || Error::NoBracket { reason: "the constraints are not solved for velocities".into() };
        let kinds = equations.system.state.iter().map(|(kind, _)| *kind);
        let moving: Vec<usize> = kinds
            .enumerate()
            .filter(|(_, kind)| !matches!(kind, StateKind::Base(_)))
            .map(|(place, _)| place)
            .collect();
        let symbols: Vec<SymbolId> = moving.iter().map(|place| equations.state[*place].symbol).collect();
        let whole = g.subs_all(&residuals, &chart.definitions).map_err(|_| singular())?;
        let parts: Option<Vec<_>> = whole.iter().map(|e| g.affine_parts(*e, &symbols)).collect();
        let Some(parts) = parts else {
            let reason = "the constraints are not solved for one velocity after the other, each without factors, \
                          affine in the velocity, or one of them quadratic, so that nothing is proved where they hold";
            let unsolved = || Error::NoBracket { reason: reason.into() };
            chart.one_by_one(g, whole, &moving, &symbols).ok_or_else(unsolved)?;
            return Ok(chart);
        };
        let (slopes, offsets): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
        // Columns on which the residuals can be solved, the last ones where there is a choice.
        let columns: Vec<Vec<ExprId>> =
            (0..moving.len()).rev().map(|k| slopes.iter().map(|row| row[k]).collect()).collect();
        let mut chosen: Vec<usize> =
            independent_rows(g, &columns).into_iter().map(|k| moving.len() - 1 - k).collect();
        chosen.sort_unstable();
        if chosen.len() != slopes.len() {
            return Err(singular());
        }
        let matrix: Vec<Vec<ExprId>> =
            slopes.iter().map(|row| chosen.iter().map(|k| row[*k]).collect()).collect();
        let mut right = Vec::new();
        for (row, offset) in slopes.iter().zip(&offsets) {
            let mut terms = vec![g.neg(*offset)];
            for k in (0..moving.len()).filter(|k| !chosen.contains(k)) {
                let z = g.sym(symbols[k]);
                let product = g.mul(row[k], z);
                terms.push(g.neg(product));
            }
            right.push(vec![g.sum(&terms)]);
        }
        let solution = solve_symbolic(g, &matrix, &right).map_err(|_| singular())?;
        chart.values =
            chosen.iter().map(|k| symbols[*k]).zip(solution.into_iter().map(|row| row[0])).collect();
        chart.coordinates.retain(|place| !chosen.iter().any(|k| moving[*k] == *place));
        chart.determinant = determinant_of(g, &matrix);
        Ok(chart)
    }

    /// Solves residuals for one component after the other, an affine one where there is one. A residual that may have
    /// a factor is not solved: it would be zero for one of the factors only. Of a quadratic equation the solution with
    /// the positive root is taken. An identity between algebraic functions that holds on it holds on the other one
    /// too: the two are conjugate, or the root is an absolute value, which meets both. Two roots may depend on each
    /// other, so that only one equation may be quadratic.
    fn one_by_one(
        &mut self,
        g: &mut Graph,
        residuals: Vec<ExprId>,
        moving: &[usize],
        symbols: &[SymbolId],
    ) -> Option<()> {
        let mut slopes = Vec::new();
        for residual in residuals {
            let residual = g.subs(residual, &self.values).ok()?;
            let mentioned = g.free_symbols(residual);
            let open = symbols.iter().rev().copied().filter(|s| mentioned.contains(s));
            let open: Vec<SymbolId> = open.filter(|s| !self.values.contains_key(s)).collect();
            let affine = open.iter().find_map(|s| Some((*s, root_of_affine(g, residual, *s, &open)?)));
            let (symbol, root) = match affine {
                Some(found) => found,
                None if self.has_root => return None,
                None => {
                    self.has_root = true;
                    open.iter().find_map(|s| Some((*s, root_of_quadratic(g, residual, *s, &open)?)))?
                }
            };
            slopes.push(g.diff(residual, symbol));
            let step = BTreeMap::from([(symbol, root)]);
            for value in self.values.values_mut() {
                *value = g.subs(*value, &step).ok()?;
            }
            self.values.insert(symbol, root);
        }
        let determinant = g.product(&slopes);
        self.determinant = g.subs(determinant, &self.values).ok()?;
        let is_chosen = |place: &usize| {
            let at = moving.iter().position(|k| k == place);
            at.is_some_and(|k| self.values.contains_key(&symbols[k]))
        };
        self.coordinates.retain(|place| !is_chosen(place));
        Some(())
    }

    /// An expression where the constraints hold; the expression itself where every state satisfies them.
    ///
    /// # Errors
    /// [`Error::DivisionByZero`] for what has no value there.
    pub(super) fn restricted(&self, g: &mut Graph, own: &[Section], e: ExprId) -> Result<ExprId, Error> {
        if self.values.is_empty() { Ok(e) } else { Ok(self.whole(g, own, &[e])?[0]) }
    }

    /// Expressions in the coordinates alone, without names of definitions of the equations or `own` ones.
    ///
    /// # Errors
    /// [`Error::DivisionByZero`] for what has no value there.
    pub(super) fn whole(
        &self,
        g: &mut Graph,
        own: &[Section],
        list: &[ExprId],
    ) -> Result<Vec<ExprId>, Error> {
        let mut values = self.definitions.clone();
        for Definition { symbol, expr } in own.iter().flat_map(|s| &s.definitions) {
            let value = g.subs(*expr, &values).unwrap_or(*expr);
            values.insert(*symbol, value);
        }
        let place = |_| Error::DivisionByZero { place: "the constraint surface".into() };
        let inlined = g.subs_all(list, &values).map_err(place)?;
        g.subs_all(&inlined, &self.values).map_err(place)
    }
}

/// `x` with `a x + b = 0`; `None` for an equation that is not affine in `x`, does not contain it, or may be a product.
fn root_of_affine(g: &mut Graph, equation: ExprId, x: SymbolId, open: &[SymbolId]) -> Option<ExprId> {
    let (slope, offset) = g.affine_parts(equation, &[x])?;
    if g.vanishing(slope[0]) != Vanishing::NonZero || !has_no_factor_of(g, offset, slope[0], open) {
        return None;
    }
    let root = g.div(offset, slope[0]).ok()?;
    Some(g.neg(root))
}

/// `x = (sqrt(b^2 - a c) - b)/a` with `a x^2 + 2 b x + c = 0`; `None` for an equation that is not quadratic in `x`, or
/// may be a product with a factor without `x`.
fn root_of_quadratic(g: &mut Graph, equation: ExprId, x: SymbolId, open: &[SymbolId]) -> Option<ExprId> {
    let half = g.rational(Rational::new(1.into(), 2.into()));
    let slope = g.diff(equation, x);
    let slope = g.mul(half, slope);
    let (a, b) = g.affine_parts(slope, &[x])?;
    if g.vanishing(a[0]) != Vanishing::NonZero {
        return None;
    }
    let c = g.subs(equation, &BTreeMap::from([(x, g.zero())])).ok()?;
    if ![b, c].into_iter().any(|e| has_no_factor_of(g, e, a[0], open)) {
        return None;
    }
    let square = g.mul(b, b);
    let product = g.mul(a[0], c);
    let discriminant = g.sub(square, product);
    let root = g.sqrt(discriminant);
    let difference = g.sub(root, b);
    g.div(difference, a[0]).ok()
}

/// Whether `e` and `divisor` are known to have no factor with an open symbol in common. The divisor has none, or is
/// `a x + b` with `a`, `b` without a common factor, hence irreducible, and `e` differs from zero at its root.
fn has_no_factor_of(g: &mut Graph, e: ExprId, divisor: ExprId, open: &[SymbolId]) -> bool {
    let mentioned = g.free_symbols(divisor);
    let open: Vec<SymbolId> = open.iter().copied().filter(|s| mentioned.contains(s)).collect();
    if open.is_empty() {
        return true;
    }
    let root = open.iter().find_map(|x| Some((*x, root_of_affine(g, divisor, *x, &open)?)));
    let at_root = root.and_then(|step| g.subs(e, &BTreeMap::from([step])).ok());
    at_root.is_some_and(|e| g.vanishing(e) == Vanishing::NonZero)
}
