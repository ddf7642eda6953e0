//! Positive functions of the base coordinates that make a motion keep a volume, or a bracket one of Poisson: products
//! of powers of what the equations divide by.
//!
//! Both conditions are linear in `d ln N`. The ansatz `ln N = sum_j c_j ln f_j` with rational `c_j` has for `f_j` the
//! determinants of the matrices that are solved with and their leading minors, whatever else the motion divides by,
//! coordinates, and sines and cosines of angles. Numbers `c_j` are guessed from values and the result is proved. Where
//! there are none, `d ln N` on the base is solved for, which may show that no function does.
//!
//! Does not know: how the motion or the bracket was derived.
//!
//! # Source
//! Kozlov 1988; Fedorov, Garcia-Naranjo, Marrero 2015 (measures); Chaplygin 1911, Bolsinov, Borisov, Mamaev 2011
//! (multipliers).

use std::collections::{BTreeMap, BTreeSet};

use num_traits::{One, Signed, Zero};

use hamel_expr::{
    ExprId, Fractions, Func, Graph, Node, Rational, SymbolId, Vanishing, independent_rows, rational_relations,
};
use hamel_lang::algebra::solve_symbolic;

/// A factor `f^c` of a density.
#[derive(Clone, Debug, PartialEq)]
pub struct Factor {
    /// `f`, a function of the base coordinates and parameters.
    pub base: ExprId,
    /// `c`.
    pub exponent: Rational,
}

/// What is known about a function `N(x) > 0` with a property.
#[derive(Clone, Debug, PartialEq)]
pub enum Density {
    /// The product of these factors and `exp(exponent)` has the property: proved. One where there are none.
    Found {
        /// Powers of functions.
        factors: Vec<Factor>,
        /// A combination of base coordinates, of a single value only where none of these is an angle.
        exponent: Option<ExprId>,
    },
    /// No function of the base coordinates has the property: proved.
    Impossible {
        /// Why.
        reason: String,
        /// Functions of the parameters with which all could vanish that stands in the way, where that is known.
        conditions: Vec<ExprId>,
    },
    /// Nothing in the ansatz has it.
    NotFound {
        /// What is known otherwise.
        reason: String,
    },
}

/// More functions are not tried.
const MAX_FACTORS: usize = 24;
/// Functions with more nodes behind them are not tried.
const MAX_NODES: usize = 1500;

/// A motion in coordinates of the base and the fibre.
pub(super) struct Motion<'a> {
    /// Base coordinates, with their rates.
    pub(super) base: &'a [(SymbolId, ExprId)],
    /// Velocities or momenta, with their rates.
    pub(super) fibre: &'a [(SymbolId, ExprId)],
}

impl Motion<'_> {
    /// The derivative of a function of the base along the motion.
    fn along(&self, g: &mut Graph, f: ExprId) -> ExprId {
        let terms: Vec<ExprId> = (self.base.iter())
            .map(|(x, rate)| {
                let slope = g.diff(f, *x);
                g.mul(slope, *rate)
            })
            .collect();
        g.sum(&terms)
    }

    /// `div X`.
    pub(super) fn divergence(&self, g: &mut Graph) -> ExprId {
        let all = self.base.iter().chain(self.fibre);
        let terms: Vec<ExprId> = all.map(|(x, rate)| g.diff(*rate, *x)).collect();
        let sum = g.sum(&terms);
        g.cancel_zero(sum)
    }
}

/// Functions of the base coordinates that may be factors: those that are `known`, and what the expressions `list`
/// divide by, the simplest first.
pub(super) fn candidates(
    g: &mut Graph,
    motion: &Motion<'_>,
    known: &[ExprId],
    list: &[ExprId],
) -> Vec<ExprId> {
    let base: BTreeSet<SymbolId> = motion.base.iter().map(|(x, _)| *x).collect();
    let fibre: BTreeSet<SymbolId> = motion.fibre.iter().map(|(x, _)| *x).collect();
    let mut all: Vec<ExprId> = known.to_vec();
    for e in g.reachable(list) {
        match g.node(e) {
            Node::Product { factors, .. } => {
                all.extend(factors.iter().filter(|(_, q)| q.is_negative()).map(|(e, _)| *e));
            }
            Node::Function(Func::Sin | Func::Cos, _) => all.push(e),
            _ => {}
        }
    }
    all.extend(motion.base.iter().map(|(x, _)| *x).collect::<Vec<_>>().into_iter().map(|x| g.sym(x)));
    let mut kept: Vec<ExprId> = Vec::new();
    all.sort_by_key(|e| g.reachable(&[*e]).len());
    for e in all {
        let is_function = g.depends_on(e, &base) && !g.depends_on(e, &fibre);
        if !is_function || g.reachable(&[e]).len() > MAX_NODES || kept.len() == MAX_FACTORS {
            continue;
        }
        if !kept.iter().any(|other| g.fingerprints_agree(*other, e)) {
            kept.push(e);
        }
    }
    kept
}

/// Powers of functions with `given_r + sum_j c_j terms_jr = 0` for all `r`, where `terms_j` belongs to the function
/// `j`: proved. None where nothing is found.
pub(super) fn powers(
    g: &mut Graph,
    functions: &[ExprId],
    terms: &[Vec<ExprId>],
    given: &[ExprId],
) -> Option<Vec<Factor>> {
    let mut columns = terms.to_vec();
    columns.push(given.to_vec());
    let relation = rational_relations(g, &columns).into_iter().find(|c| c.last().is_some_and(One::is_one))?;
    for r in 0..given.len() {
        let parts: Vec<ExprId> =
            columns.iter().zip(&relation).map(|(column, c)| g.scale(column[r], c)).collect();
        let sum = g.sum(&parts);
        if g.vanishing(sum) != Vanishing::Zero {
            return None;
        }
    }
    let factors = functions.iter().zip(relation).filter(|(_, c)| !c.is_zero());
    let factors = factors.map(|(base, exponent)| Factor { base: *base, exponent }).collect();
    Some(gathered(g, factors))
}

/// Factors with one exponent as one factor, where that cancels: the pivots of a matrix are a determinant.
fn gathered(g: &mut Graph, factors: Vec<Factor>) -> Vec<Factor> {
    let mut fractions = Fractions::default();
    let mut all: Vec<Factor> = Vec::new();
    for Factor { base, exponent } in factors {
        let Some(other) = all.iter_mut().find(|other| other.exponent == exponent) else {
            all.push(Factor { base, exponent });
            continue;
        };
        other.base = g.mul(other.base, base);
    }
    for factor in &mut all {
        let normal = fractions.normal(g, factor.base);
        if g.fingerprints_agree(normal, factor.base) {
            factor.base = normal;
        }
    }
    all
}

/// A number as a quotient in which everything has cancelled that is seen to.
fn cancelled(g: &mut Graph, e: ExprId) -> ExprId {
    let normal = Fractions::default().normal(g, e);
    if g.fingerprints_agree(normal, e) { normal } else { e }
}

/// What vanishes where a number does: its numerator.
fn numerator(g: &mut Graph, e: ExprId) -> ExprId {
    let e = cancelled(g, e);
    let Node::Product { factors, .. } = g.node(e) else { return e };
    let factors: Vec<(ExprId, Rational)> = factors.iter().filter(|(_, q)| q.is_positive()).cloned().collect();
    g.power_product(&factors).unwrap_or(e)
}

/// `N(x)` with `div(N X) = 0`, where the volume is that of the coordinates divided by `weight`, a function of the base.
pub(super) fn invariant_measure(
    g: &mut Graph,
    motion: &Motion<'_>,
    functions: &[ExprId],
    weight: ExprId,
) -> Density {
    let divergence = motion.divergence(g);
    let change = motion.along(g, weight);
    let inverse = g.powi(weight, -1);
    let change = g.mul(change, inverse);
    let divergence = g.sub(divergence, change);
    if g.is_zero(divergence) {
        return Density::Found { factors: Vec::new(), exponent: None };
    }
    let mut terms = Vec::new();
    for f in functions {
        let along = motion.along(g, *f);
        let inverse = g.powi(*f, -1);
        terms.push(vec![g.mul(along, inverse)]);
    }
    if let Some(factors) = powers(g, functions, &terms, &[divergence]) {
        return Density::Found { factors, exponent: None };
    }
    // beta(X) = -div X, compared by powers of the velocities.
    let not_found = |reason: &str| Density::NotFound { reason: reason.to_owned() };
    let fibre: Vec<SymbolId> = motion.fibre.iter().map(|(u, _)| *u).collect();
    let Some((slopes, offset)) = g.affine_parts(divergence, &fibre) else {
        return not_found("the divergence is not affine in the velocities");
    };
    let right: Vec<ExprId> = slopes.iter().chain([&offset]).map(|e| g.neg(*e)).collect();
    if motion.base.is_empty() {
        let conditions = right.into_iter().filter(|e| *e != g.zero()).collect::<Vec<_>>();
        let conditions = conditions.into_iter().map(|e| numerator(g, e)).collect();
        let reason =
            "the divergence of the motion is not zero, and there is no coordinate on which N could depend";
        return Density::Impossible { reason: reason.to_owned(), conditions };
    }
    let mut columns = Vec::new();
    for (_, rate) in motion.base {
        let Some((slopes, offset)) = g.affine_parts(*rate, &fibre) else {
            return not_found("the rates of the coordinates are not affine in the velocities");
        };
        columns.push(slopes.into_iter().chain([offset]).collect::<Vec<_>>());
    }
    let rows: Vec<Vec<ExprId>> =
        (0..right.len()).map(|r| columns.iter().map(|column| column[r]).collect()).collect();
    one_form(g, motion, &rows, &right, "N")
}

/// What `beta = d ln N` with `rows_r . beta = right_r` for all `r` can be, `N` being called `name`.
pub(super) fn one_form(
    g: &mut Graph,
    motion: &Motion<'_>,
    rows: &[Vec<ExprId>],
    right: &[ExprId],
    name: &str,
) -> Density {
    let not_found = |reason: String| Density::NotFound { reason };
    let impossible = |reason: String| Density::Impossible { reason, conditions: Vec::new() };
    let n = motion.base.len();
    let chosen = independent_rows(g, rows);
    let with_right: Vec<Vec<ExprId>> =
        rows.iter().zip(right).map(|(row, e)| [row.as_slice(), &[*e]].concat()).collect();
    if independent_rows(g, &with_right).len() > chosen.len() {
        return impossible(format!("the linear equations for d ln {name} contradict each other"));
    }
    if chosen.len() < n {
        return not_found(format!("d ln {name} is not determined by the linear equations for it"));
    }
    let matrix: Vec<Vec<ExprId>> = chosen.iter().map(|r| rows[*r].clone()).collect();
    let values: Vec<Vec<ExprId>> = chosen.iter().map(|r| vec![right[*r]]).collect();
    let Ok(solution) = solve_symbolic(g, &matrix, &values) else {
        return not_found(format!("the linear equations for d ln {name} could not be solved"));
    };
    let beta: Vec<ExprId> = solution.into_iter().map(|row| g.cancel_zero(row[0])).collect();
    for (k, (x, _)) in motion.base.iter().enumerate() {
        for (u, _) in motion.fibre {
            let slope = g.diff(beta[k], *u);
            if g.vanishing(slope) == Vanishing::NonZero {
                return impossible(format!("d ln {name}/d{} would depend on velocities", g.name(*x)));
            }
        }
    }
    for i in 0..n {
        for j in i + 1..n {
            let (forward, backward) = (g.diff(beta[j], motion.base[i].0), g.diff(beta[i], motion.base[j].0));
            let curl = g.sub(forward, backward);
            let [x, y] = [i, j].map(|k| g.name(motion.base[k].0).to_owned());
            match g.vanishing(curl) {
                Vanishing::Zero => {}
                Vanishing::NonZero => {
                    let beta = format!("the one-form d ln {name} that the linear equations determine");
                    return impossible(format!("{beta} is not closed in {x} and {y}"));
                }
                Vanishing::Unknown => {
                    return not_found(format!("whether d ln {name} is closed in {x} and {y} is not decided"));
                }
            }
        }
    }
    let varying: BTreeSet<SymbolId> = motion.base.iter().chain(motion.fibre).map(|(x, _)| *x).collect();
    let at_one: BTreeMap<SymbolId, ExprId> = varying.iter().map(|x| (*x, g.one())).collect();
    let mut terms = Vec::new();
    let mut constants = Vec::new();
    for ((x, _), e) in motion.base.iter().zip(&beta) {
        // A constant may mention coordinates.
        let value = if g.depends_on(*e, &varying) { g.subs(*e, &at_one).ok() } else { Some(*e) };
        let Some(value) = value.filter(|value| g.fingerprints_agree(*value, *e)) else {
            let closed = format!("d ln {name} is closed");
            return not_found(format!("{closed}, but {name} is no product of powers in the ansatz"));
        };
        let value = cancelled(g, value);
        constants.push(value);
        let x = g.sym(*x);
        terms.push(g.mul(value, x));
    }
    for (row, e) in rows.iter().zip(right) {
        let mut sum: Vec<ExprId> = row.iter().zip(&constants).map(|(a, b)| g.mul(*a, *b)).collect();
        sum.push(g.neg(*e));
        let sum = g.sum(&sum);
        if g.vanishing(sum) != Vanishing::Zero {
            return not_found(format!("d ln {name} could not be proved"));
        }
    }
    Density::Found { factors: Vec::new(), exponent: Some(g.sum(&terms)) }
}
