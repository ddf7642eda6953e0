//! Equations between coordinates that follow from others where these hold, such as the third vector equation of a
//! parallelogram: every state that meets them is singular.
//!
//! Coordinates that meet all equations are found by Newton's method, from the model's initial ones and beside these.
//! Where the gradients depend on each other at each, and an equation holds wherever the others do, also for other
//! parameters, it follows from them and is left out, which is told. Certificates hold such equations to 31 digits at
//! places next to the same ones. Elements of groups of rotations are moved by their velocities, and gradients are those
//! along the velocities.
//!
//! Deliberately does not know: velocities, how constraints are solved.
//!
//! # Source
//! Nocedal and Wright 2006, Numerical optimization, section 10.3 (Levenberg and Marquardt).

use std::collections::{BTreeMap, BTreeSet};

use super::diagnostic::{Diagnostic, Diagnostics};
use super::displaced::Displaced;
use super::model::{Constraint, Domain, Implied, Model, PositionEquation};
use hamel_expr::{ExprId, Graph, SymbolId, rational_to_f64, uniform};

/// How many points say that gradients depend on each other, and how many are tried for each.
const N_POINTS: usize = 4;
const N_ATTEMPTS: u32 = 6;

/// How far coordinates are from the initial ones at most: next to these, as equations with several branches may
/// depend on each other on one alone.
const REACH: f64 = 0.1;

/// How far parameters are from their defaults, as a part of these.
const SPREAD: f64 = 0.3;

/// Where coordinates are that the model does not give, if zero is no answer: the first, and the distance of each to the
/// next.
const BESIDE: [f64; 2] = [0.4, 0.17];

const MAX_ITERATIONS: usize = 60;

/// Damping, as a part of the trace: equations that depend on each other have normal equations without inverse.
const DAMPING: f64 = 1e-11;

/// Residual, by the length of its gradient, that is met.
const MET: f64 = 1e-11;

/// The same of an equation that the others imply, where these are met.
const IMPLIED: f64 = 1e-8;

/// Distance of a gradient of length one from the span of others that is none, and length, beside that next to the
/// place, of a gradient that is zero: where equations touch each other they are met to the root of [`MET`].
const DEPENDENT: f64 = 1e-4;

/// Step of central differences.
const STEP: f64 = 1e-5;

/// Equations at values of everything but the positions: coordinates, and elements of groups by entries.
struct Loops<'a> {
    graph: &'a Graph,
    residuals: Vec<ExprId>,
    positions: Vec<SymbolId>,
    displaced: Displaced<'a>,
    others: BTreeMap<SymbolId, f64>,
}

/// A problem of the equations between coordinates, or one of them that the others imply.
enum Found {
    Wrong(Diagnostic),
    Implied { constraint: usize, n_others: usize, at: Vec<(SymbolId, f64)> },
}

/// Leaves out equations between coordinates that follow from the others, and tells each; the problem that is left, if
/// there is one.
pub(super) fn leave_out(model: &mut Model) -> Option<Diagnostic> {
    let mut texts = texts(model);
    let mut told: Vec<Diagnostic> = model.warnings.iter().cloned().collect();
    let problem = loop {
        match redundant(model, &texts) {
            None => break None,
            Some(Found::Wrong(problem)) => break Some(problem),
            Some(Found::Implied { constraint: k, n_others, at }) => {
                let (constraint, text) = (model.constraints.remove(k), texts.remove(k));
                let message = format!("`{text}` follows from the {n_others} other equations: it is left out");
                let help = "the motion keeps it, and it has no multiplier: reactions of the others are one choice of many \
                            that give this motion";
                told.push(Diagnostic::warning(constraint.span, message).with_help(help));
                if let Some(PositionEquation { residual, .. }) = constraint.position {
                    model.implied.push(Implied { text, residual, at, span: constraint.span });
                }
            }
        }
    };
    model.warnings = Diagnostics::new(None, told);
    problem
}

/// What constraints are called: as written, with the component of a vector equation.
fn texts(model: &Model) -> Vec<String> {
    let constraints = &model.constraints;
    let is_same = |a: &Constraint, b: &Constraint| a.span == b.span && a.text == b.text;
    let text = |own: &Constraint| match constraints.iter().filter(|other| is_same(own, other)).count() {
        0 | 1 => own.text.clone(),
        _ => format!("{}` of `{}", own.name, own.text),
    };
    constraints.iter().map(text).collect()
}

/// What the equations between the coordinates of a model are, where they depend on each other next to its start: at
/// zero where the model gives none, and where that is no answer, as linkages may be singular there, beside it.
fn redundant(model: &Model, texts: &[String]) -> Option<Found> {
    let found = redundant_at(model, texts, None)?;
    let is_given = |name: &String| model.initial.iter().any(|(given, _)| given == name);
    if matches!(found, Found::Implied { .. }) || model.base.iter().all(|c| is_given(&c.name)) {
        return Some(found);
    }
    match redundant_at(model, texts, Some(BESIDE)) {
        Some(beside @ Found::Implied { .. }) => Some(beside),
        _ => Some(found),
    }
}

/// As [`redundant`]; where coordinates that the model does not give are, the first of them and the distance of each to
/// the next.
fn redundant_at(model: &Model, texts: &[String], open: Option<[f64; 2]>) -> Option<Found> {
    let graph = &model.graph;
    let all = Displaced::new(model, true);
    let coordinates = || model.base.iter().map(|c| c.symbol);
    let params = || model.params.iter().map(|p| p.symbol);
    let entries = all.entries().iter().copied();
    let known: BTreeSet<SymbolId> =
        coordinates().chain(entries).chain(params()).chain([model.time]).collect();
    let residual = |k: &usize| model.constraints[*k].position.map(|p| p.residual);
    let places: Vec<usize> = (0..model.constraints.len())
        .filter(|k| residual(k).is_some_and(|e| graph.free_symbols(e).is_subset(&known)))
        .collect();
    let constraints: Vec<&Constraint> = places.iter().map(|k| &model.constraints[*k]).collect();
    let residuals: Vec<ExprId> = places.iter().filter_map(residual).collect();
    if residuals.len() < 2 {
        return None;
    }
    let own: BTreeSet<SymbolId> = all.entries().iter().copied().collect();
    let displaced = match residuals.iter().any(|e| graph.depends_on(*e, &own)) {
        true => all,
        false => Displaced::new(model, false),
    };
    let mut others: BTreeMap<SymbolId, f64> =
        model.params.iter().map(|p| (p.symbol, rational_to_f64(&p.default))).collect();
    others.insert(model.time, 0.0);
    let positions = coordinates().chain(displaced.entries().iter().copied()).collect();
    let mut loops = Loops { graph, residuals, positions, displaced, others };
    let mut random = 1;
    let start = loops.start(model, open)?;
    let kept: Vec<usize> = (0..constraints.len()).collect();
    let dependent = loops.dependent(&start, &kept, &mut random)?;
    // One that gives a coordinate says which ones are free: that is for the author to decide.
    let gives = |k: usize| constraints[k].position.and_then(|p| p.determines);
    let last_first = dependent.iter().rev().copied();
    let (alone, giving): (Vec<usize>, Vec<usize>) = last_first.partition(|k| gives(*k).is_none());
    let mut candidates = alone.into_iter().chain(giving);
    let follows = candidates.find(|k| loops.is_implied(&start, &kept, *k, &mut random));
    let defaults = loops.others.clone();
    let is_general = (0..2).all(|_| {
        for p in &model.params {
            let moved = 1.0 + SPREAD * (2.0 * uniform(&mut random) - 1.0);
            loops.others.insert(p.symbol, defaults[&p.symbol] * moved);
        }
        loops.dependent(&start, &kept, &mut random).is_some()
            && follows.is_none_or(|k| loops.is_implied(&start, &kept, k, &mut random))
    });
    loops.others = defaults;
    let n_others = kept.len() - 1;
    if let Some(k) = follows.filter(|k| is_general && gives(*k).is_none()) {
        let others = without(&kept, k);
        let met = (0..N_ATTEMPTS)
            .find_map(|i| loops.met(loops.beside(&start, REACH / f64::from(8 << i), &mut random)?, &others));
        if let Some((at, _)) = met {
            let at = loops.positions.iter().copied().zip(at).collect();
            return Some(Found::Implied { constraint: places[k], n_others, at });
        }
    }
    let at_values = if is_general { "" } else { " for the default values of the parameters" };
    let culprit = follows.or(dependent.last().copied())?;
    let text = &texts[places[culprit]];
    let message = match follows {
        Some(_) => format!("`{text}` follows from the {n_others} other equations{at_values}"),
        None => format!(
            "the {} equations between coordinates depend on each other wherever they hold{at_values}",
            kept.len()
        ),
    };
    let help = match (follows, gives(culprit).map(|k| &model.base[k].name)) {
        (None, _) => {
            "write equations with independent gradients: `f = 0` in the place of `f^2 = 0`".to_owned()
        }
        (Some(_), Some(name)) => format!("leave it out and declare `{name}` without `by`: it is free"),
        (Some(_), None) if is_general => "leave it out: a motion that keeps the others keeps it".to_owned(),
        (Some(_), None) => {
            "leave it out, and write one parameter in the place of several that have to be equal".to_owned()
        }
    };
    Some(Found::Wrong(Diagnostic::new(constraints[culprit].span, message).with_help(help)))
}

impl Loops<'_> {
    /// Positions as the model gives them; other coordinates as `open` says, or at zero, in the middle of their
    /// intervals where that is outside.
    fn start(&self, model: &Model, open: Option<[f64; 2]>) -> Option<Vec<f64>> {
        let neutral = |k: usize| match model.base[k].domain {
            Domain::Angle | Domain::Real => 0.0,
            Domain::Interval(from, to) => {
                let [from, to] = [from, to].map(|e| self.graph.eval_f64(e, &self.others).unwrap_or(0.0));
                if from < 0.0 && 0.0 < to { 0.0 } else { from + (to - from) / 2.0 }
            }
        };
        let other = |k: usize| open.map_or_else(|| neutral(k), |[first, apart]| first + apart * k as f64);
        let given = |k: usize| {
            let name = self.graph.name(self.positions[k]);
            let (_, e) = model.initial.iter().find(|(own, _)| own == name)?;
            self.graph.eval_f64(*e, &self.others)
        };
        let is_base = |k: usize| k < model.base.len();
        (0..self.positions.len()).map(|k| given(k).or_else(|| is_base(k).then(|| other(k)))).collect()
    }

    fn values(&self, x: &[f64]) -> Option<Vec<f64>> {
        let mut known = self.others.clone();
        known.extend(self.positions.iter().copied().zip(x.iter().copied()));
        let values = self.graph.eval_known(&self.residuals, &known);
        self.residuals.iter().map(|e| values.get(e).copied().filter(|x| x.is_finite())).collect()
    }

    /// Gradients along the directions, a row for each equation.
    fn gradients(&self, x: &[f64]) -> Option<Vec<Vec<f64>>> {
        let n = self.displaced.n_directions();
        let mut rows = vec![vec![0.0; n]; self.residuals.len()];
        for k in 0..n {
            let step =
                STEP * (1.0 + x.get(k).filter(|_| k < self.displaced.n_base()).map_or(0.0, |x| x.abs()));
            let at = |d: f64| {
                let mut along = vec![0.0; n];
                along[k] = d;
                self.values(&self.displaced.moved(x, &along, &self.others)?)
            };
            for (row, (a, b)) in rows.iter_mut().zip(at(step)?.iter().zip(&at(-step)?)) {
                row[k] = (a - b) / (2.0 * step);
            }
        }
        Some(rows)
    }

    /// Positions next to others that meet some equations, with the gradients there.
    fn met(&self, mut x: Vec<f64>, some: &[usize]) -> Option<(Vec<f64>, Vec<Vec<f64>>)> {
        for _ in 0..MAX_ITERATIONS {
            let (values, rows) = (self.values(&x)?, self.gradients(&x)?);
            let is_met = |k: &usize| values[*k].abs() <= MET * (1.0 + length(&rows[*k]));
            if some.iter().all(is_met) {
                return Some((x, rows));
            }
            let n = self.displaced.n_directions();
            let mut matrix = vec![vec![0.0; n + 1]; n];
            for k in some {
                for i in 0..n {
                    (0..n).for_each(|j| matrix[i][j] += rows[*k][i] * rows[*k][j]);
                    matrix[i][n] -= rows[*k][i] * values[*k];
                }
            }
            let trace: f64 = (0..n).map(|i| matrix[i][i]).sum();
            (0..n).for_each(|i| matrix[i][i] += DAMPING * trace);
            let step = solve(matrix)?;
            // Steps of half a radian stay on the branch.
            let part = (0.5 / length(&step)).min(1.0);
            let step: Vec<f64> = step.into_iter().map(|d| part * d).collect();
            x = self.displaced.moved(&x, &step, &self.others)?;
        }
        None
    }

    fn beside(&self, start: &[f64], reach: f64, random: &mut u64) -> Option<Vec<f64>> {
        let n = self.displaced.n_directions();
        let by: Vec<f64> = (0..n).map(|_| reach * (2.0 * uniform(random) - 1.0)).collect();
        self.displaced.moved(start, &by, &self.others)
    }

    /// The equations whose gradients depend on the gradients of the others wherever all are met, if any are.
    fn dependent(&self, start: &[f64], kept: &[usize], random: &mut u64) -> Option<Vec<usize>> {
        let mut found: Vec<usize> = kept.to_vec();
        let sizes: Vec<f64> =
            self.gradients(&self.beside(start, REACH, random)?)?.iter().map(|row| length(row)).collect();
        for _ in 0..N_POINTS {
            let (_, mut rows) = (0..N_ATTEMPTS)
                .find_map(|k| self.met(self.beside(start, REACH / f64::from(1 << k), random)?, kept))?;
            for (row, size) in rows.iter_mut().zip(&sizes) {
                if length(row) < DEPENDENT * size {
                    row.fill(0.0);
                }
            }
            found.retain(|k| depends(&rows, *k, &without(kept, *k)));
            if found.is_empty() {
                return None;
            }
        }
        Some(found)
    }

    /// Whether an equation is met wherever the others are, on the branch of the start: what an analytic function is
    /// next to it.
    fn is_implied(&self, start: &[f64], kept: &[usize], k: usize, random: &mut u64) -> bool {
        let others = without(kept, k);
        (0..N_POINTS).all(|_| {
            let found =
                (0..N_ATTEMPTS).find_map(|_| self.met(self.beside(start, REACH / 4.0, random)?, &others));
            found.is_some_and(|(x, rows)| {
                self.values(&x).is_some_and(|values| values[k].abs() <= IMPLIED * (1.0 + length(&rows[k])))
            })
        })
    }
}

fn without(kept: &[usize], k: usize) -> Vec<usize> {
    kept.iter().copied().filter(|other| *other != k).collect()
}

fn length(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Whether a row is a combination of others.
fn depends(rows: &[Vec<f64>], k: usize, others: &[usize]) -> bool {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let unit = |v: &[f64]| {
        let size = length(v);
        v.iter().map(|x| x / size).collect::<Vec<f64>>()
    };
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let rest = |row: &[f64], basis: &[Vec<f64>]| {
        let mut row = unit(row);
        // Twice, as one projection leaves rounding of the others.
        for e in basis.iter().chain(basis) {
            let part = dot(&row, e);
            row.iter_mut().zip(e).for_each(|(x, e)| *x -= part * e);
        }
        row
    };
    for other in others {
        let row = rest(&rows[*other], &basis);
        if length(&row) > DEPENDENT {
            basis.push(unit(&row));
        }
    }
    // A gradient of zeros has no direction: its equation is met twice over.
    let left = length(&rest(&rows[k], &basis));
    left.is_nan() || left <= DEPENDENT
}

/// The solution of `A x = b` by elimination with the largest pivot, `b` behind the columns of `A`.
fn solve(mut matrix: Vec<Vec<f64>>) -> Option<Vec<f64>> {
    let n = matrix.len();
    for k in 0..n {
        let best = (k..n).max_by(|i, j| matrix[*i][k].abs().total_cmp(&matrix[*j][k].abs()))?;
        matrix.swap(k, best);
        let pivot = matrix[k].clone();
        if pivot[k] == 0.0 || !pivot[k].is_finite() {
            return None;
        }
        for row in matrix.iter_mut().skip(k + 1) {
            let factor = row[k] / pivot[k];
            row.iter_mut().zip(&pivot).skip(k).for_each(|(x, p)| *x -= factor * p);
        }
    }
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| matrix[k][j] * x[j]).sum();
        x[k] = (matrix[k][n] - known) / matrix[k][k];
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}
