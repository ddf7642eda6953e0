//! Functions of time and state that are constant along every motion of a scene, with their gradients.
//!
//! Candidates are what mechanics knows: casimirs, norms and products of advected parameters and quaternions, residuals
//! of constraints, the energy, momenta of the frame and in space. One counts when its rate along the motion vanishes
//! identically, by the fingerprints of the graph; the energy of a system with multipliers, which is conserved on the
//! constraint alone, does not. Where the energy is not conserved a moving energy may be, and there may be momenta along
//! sections that nobody has named: both are looked for. Of those that are functions of others only the first are kept.
//! Components of the state that never change are parameters here: a projection leaves them alone.
//!
//! Deliberately does not know: how anything is differentiated, lowered or emitted, who projects.

use std::collections::BTreeSet;

use super::dependence::{left_out, needs};
use super::gradients::{WithGradients, Words, with_gradients};
use hamel_expr::differentiate::Linearisation;
use hamel_expr::{ExprId, Graph, SectionWriter, SymbolId, independent_rows, needed_sections};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{ConservedMomenta, Equations, OutputKind, StateEquation};
use hamel_mechanics::reduction::Block;
use hamel_program::lower::Inputs;

/// Name of the matrix of the gradients, a row for each invariant.
pub(super) const GRADIENTS: &str = "invariant_gradients";

/// Finds the invariants of the motion of `state`; none if nothing but components of it is conserved.
pub(super) fn find(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    inputs: &Inputs,
) -> Option<WithGradients> {
    let functions = conserved(g, equations, state, inputs);
    let moving: Vec<usize> = (0..state.len()).filter(|k| state[*k].derivative != g.zero()).collect();
    let words = Words {
        want: Want::Invariants,
        values: "functions of time and state that are constant along every motion",
        gradients: GRADIENTS,
        doc: "matrix of the derivatives of the invariants by the components of the state that move, a row for each \
              invariant",
    };
    let found = with_gradients(g, equations, state, (&functions, &moving), &words, |g, rows| {
        independent_rows(g, rows)
    });
    (found.gradients.shape.0 > 0).then_some(found)
}

/// The candidates whose rate vanishes identically.
fn conserved(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    inputs: &Inputs,
) -> Vec<(String, ExprId)> {
    let candidates = candidates(g, equations, state);
    let values: Vec<ExprId> = candidates.iter().map(|(_, e)| *e).collect();
    let sections = needed_sections(g, &equations.sections, &values);
    let mut by: Vec<SymbolId> = state.iter().map(|s| s.symbol).collect();
    let mut motion: Vec<ExprId> = state.iter().map(|s| s.derivative).collect();
    by.push(inputs.time);
    motion.push(g.one());
    let linear = Linearisation::new(g, &sections, &values, &by);
    // Nobody computes these rates.
    let mut scratch = SectionWriter::new(g, BTreeSet::new(), &[]);
    let rates = linear.forward(g, &mut scratch, &[motion], |value, _| format!("rate_{value}"), str::to_owned);
    // What multipliers keep is the derivative of an equation between coordinates: where it vanishes, the equation is
    // kept.
    let residuals = equations.outputs.iter().filter(|o| o.kind == OutputKind::Group(Want::Constraint));
    let residuals: Vec<ExprId> = residuals.flat_map(|o| o.components.iter().map(|(_, e)| *e)).collect();
    let positions: BTreeSet<ExprId> = equations.system.positions.iter().map(|p| p.residual).collect();
    let mut is_kept = |value: ExprId, rate: ExprId| {
        g.is_zero(rate)
            || (positions.contains(&value) && residuals.iter().any(|residual| g.is_equal(rate, *residual)))
    };
    candidates
        .into_iter()
        .zip(rates)
        .filter(|((_, value), rate)| is_kept(*value, rate[0]))
        .map(|(found, _)| found)
        .collect()
}

/// What may be conserved, in the order in which it is kept.
fn candidates(g: &mut Graph, equations: &Equations, state: &[StateEquation]) -> Vec<(String, ExprId)> {
    let group = |want: Want| {
        let found = equations.outputs.iter().filter(move |o| o.kind == OutputKind::Group(want));
        found.flat_map(|o| o.components.iter().cloned())
    };
    let mut candidates: Vec<(String, ExprId)> = group(Want::Circles).chain(group(Want::Casimirs)).collect();
    let vectors: Vec<&Block> = equations.system.carried_vectors().collect();
    for (k, Block { name, components: a, .. }) in vectors.iter().enumerate() {
        let others = vectors[k..].iter().filter(|b| b.components.len() == a.len());
        for Block { name: other, components: b, .. } in others {
            let terms: Vec<ExprId> = (a.iter().zip(b))
                .map(|(x, y)| {
                    let (x, y) = (g.sym(*x), g.sym(*y));
                    g.mul(x, y)
                })
                .collect();
            candidates.push((format!("{name}_dot_{other}"), g.sum(&terms)));
        }
    }
    candidates.extend(equations.system.group_equations.iter().cloned());
    candidates.extend(group(Want::Constraint));
    if equations.has_energy() {
        candidates.push(("energy".to_owned(), equations.energy));
    }
    let momenta: Vec<(String, ExprId)> = group(Want::Momentum).collect();
    candidates.extend(momenta.iter().cloned().chain(group(Want::NonholonomicMomentum)));
    candidates.extend(group(Want::Sections));
    // Fields and accelerations have no momenta.
    // A momentum that depends on a coordinate which no state has is missing.
    let is_whole = momenta.len() >= equations.system.velocities.len() && !momenta.is_empty();
    let in_space = if is_whole { &equations.system.momenta_in_space[..] } else { &[][..] };
    for (k, a) in in_space.iter().enumerate() {
        // What turns as one vector keeps its products: Casimirs of so(3) and se(3), also where a scene carries no
        // attitude.
        for b in in_space[k..].iter().filter(|b| b.rows == a.rows) {
            let [p, q] = [a, b].map(|of| of.velocities.iter().map(|k| &momenta[*k]).collect::<Vec<_>>());
            let terms: Vec<ExprId> = p.iter().zip(&q).map(|(p, q)| g.mul(p.1, q.1)).collect();
            let [p, q] = [&p[0].0, &q[0].0].map(|name| name.trim_end_matches(char::is_numeric));
            candidates.push((format!("{p}_dot_{q}"), g.sum(&terms)));
        }
    }
    for a in in_space {
        for (row, own) in a.rows.iter().zip(&a.velocities) {
            let terms: Vec<ExprId> =
                row.iter().zip(&a.velocities).map(|(m, k)| g.mul(*m, momenta[*k].1)).collect();
            candidates.push((format!("space_{}", momenta[*own].0), g.sum(&terms)));
        }
    }
    candidates.extend(found_by_search(g, equations));
    let left_out = left_out(equations, state);
    candidates.retain(|(_, e)| !needs(g, equations, *e, &left_out));
    candidates
}

/// Conserved momenta along sections with coefficients on the base, and the moving energy.
fn found_by_search(g: &mut Graph, equations: &Equations) -> Vec<(String, ExprId)> {
    let Ok(found) = ConservedMomenta::new(equations) else { return Vec::new() };
    g.take_over(&found.graph);
    let momenta = found.momenta.iter().enumerate();
    let momenta = momenta.map(|(k, m)| (format!("gauge_momentum{}", k + 1), m.value));
    let energy = found.moving_energy.iter().map(|m| ("moving_energy".to_owned(), m.value));
    let (names, values): (Vec<String>, Vec<ExprId>) = energy.chain(momenta).unzip();
    let values = g.import(&found.graph, &values).unwrap_or_default();
    names.into_iter().zip(values).collect()
}
