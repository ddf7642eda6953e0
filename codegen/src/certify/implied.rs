//! Equations between coordinates that a model leaves out, where the equations that are left hold.
//!
//! Coordinates next to a place that meets all equations are moved by Newton's method until the others hold; the
//! equation that was left out has to hold there. Parameters are next to their defaults, so that loops close. Entries of
//! rotations are coordinates with the equations `R^T R = 1`.
//! Does not know: by what an equation was left out, velocities.

use hamel_runtime::Real;

use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::spec::{Configuration, Implied};

use super::linear::Reduced;
use super::motion::RATES;
use super::point::Setting;
use super::random::Random;
use super::sheet::Sheet;
use super::tape::{Env, Tape, rational};
use super::wide::Wide;

/// How far coordinates begin from the place, and parameters from their defaults as a part of these.
const REACH: f64 = 0.03;
const SPREAD: f64 = 0.02;
const MAX_ITERATIONS: usize = 30;
/// Relative error of coordinates that were solved for.
const SOLVED: f64 = 1.0 / (1u128 << 96) as f64;

/// Holds everything that was left out to the equations that are left, at one place each; the reason where none is
/// found.
pub(super) fn check(setting: &Setting<'_>, sheet: &mut Sheet, random: &mut Random) -> Option<&'static str> {
    let model = setting.definition.model;
    let mut missing = None;
    for implied in &model.implied {
        let Some(env) = (0..8).find_map(|_| met(setting, implied, random)) else {
            missing = Some("no place next to the initial one meets the equations that imply another one");
            continue;
        };
        let tape = Tape::new(&model.graph, &[implied.residual]);
        let Ok(value) = tape.eval(&env) else { continue };
        let slopes = implied.at.iter().filter_map(|(symbol, _)| {
            let seeded = setting.seeded(&env, &[(*symbol, Wide::ONE)]);
            Some(tape.eval(&seeded).ok()?.roots[0].derivative.size())
        });
        let size = slopes.fold(0.0, f64::max);
        sheet.vanishes(RATES, format!("the implied equation `{}`", implied.text), value.roots[0], size);
    }
    missing
}

/// `R^T R - 1` of the matrix of a configuration, above the diagonal and on it.
fn orthogonality(graph: &mut Graph, configuration: &Configuration) -> Vec<ExprId> {
    let n = configuration.group.n();
    let entries: Vec<ExprId> = configuration.symbols[..n * n].iter().map(|s| graph.sym(*s)).collect();
    let column = |i: usize| (0..n).map(|k| entries[k * n + i]).collect::<Vec<ExprId>>();
    let mut equations = Vec::new();
    for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
        let product = graph.dot(&column(i), &column(j));
        let one = if i == j { graph.one() } else { graph.zero() };
        equations.push(graph.sub(product, one));
    }
    equations
}

/// Coordinates at which the equations that are left hold.
fn met(setting: &Setting<'_>, implied: &Implied, random: &mut Random) -> Option<Env<Wide>> {
    let model = setting.definition.model;
    let mut env: Env<Wide> = Env::new();
    env.set(model.time, Wide::exact(SPREAD * random.signed()));
    for param in &model.params {
        let default: Wide = rational(&param.default);
        env.set(param.symbol, default * Wide::exact(1.0 + SPREAD * random.symmetric()));
    }
    for (symbol, at) in &implied.at {
        env.set(*symbol, Wide::exact(at + REACH * random.symmetric()));
    }
    let coordinates: Vec<SymbolId> = implied.at.iter().map(|(symbol, _)| *symbol).collect();
    let mut graph = model.graph.clone();
    let known = |e: &ExprId| model.graph.free_symbols(*e).iter().all(|s| env.get(*s).is_some());
    let mut left: Vec<ExprId> =
        model.constraints.iter().filter_map(|c| Some(c.position?.residual)).filter(known).collect();
    for configuration in model.configurations.iter().filter(|c| env.get(c.symbols[0]).is_some()) {
        left.extend(orthogonality(&mut graph, configuration));
    }
    let tape = Tape::new(&graph, &left);
    for _ in 0..MAX_ITERATIONS {
        let values = tape.eval(&env).ok()?.roots;
        if values.iter().any(|r| !r.all_finite()) {
            return None;
        }
        if values.iter().all(|r| r.size() <= 4.0 * r.error()) {
            return Some(env);
        }
        // Slopes of sixteen digits, as each step of Newton's method gains.
        let rounded = env.map(Wide::to_f64);
        let mut columns: Vec<Vec<Wide>> = Vec::new();
        for symbol in &coordinates {
            let slopes = tape.eval(&setting.seeded(&rounded, &[(*symbol, 1.0)])).ok()?.roots;
            columns.push(slopes.into_iter().map(|slope| Wide::exact(slope.derivative)).collect());
        }
        // The shortest step, `G^T mu` with `G G^T mu = -r`, stays on the branch.
        let product = |i: usize, j: usize| columns.iter().fold(Wide::ZERO, |sum, c| sum + c[i] * c[j]);
        let n = left.len();
        let rows = (0..n).map(|i| (0..n).map(|j| product(i, j)).chain([-values[i]]).collect());
        let weights = Reduced::new(rows.collect(), n).solution(&vec![Wide::ZERO; n]);
        for (symbol, column) in coordinates.iter().zip(&columns) {
            let step = column.iter().zip(&weights).fold(Wide::ZERO, |sum, (a, b)| sum + *a * *b);
            let x = env.get(*symbol)? + step;
            env.set(*symbol, Wide::of(x).uncertain(SOLVED * x.size().max(1.0)));
        }
    }
    None
}
