//! Time derivatives along the motion.
//!
//! Does not know: what they are of, how the motion was derived.

use std::collections::BTreeSet;

use hamel_expr::differentiate::Linearisation;
use hamel_expr::{ExprId, Graph, SectionWriter, SymbolId, needed_sections};

use super::equations::{Equations, StateEquation};

/// Time derivatives along the motion of expressions in the state and the definitions of the equations.
pub fn rates(g: &mut Graph, equations: &Equations, state: &[StateEquation], of: &[ExprId]) -> Vec<ExprId> {
    let sections = needed_sections(g, &equations.sections, of);
    let mut by: Vec<SymbolId> = state.iter().map(|s| s.symbol).collect();
    let mut motion: Vec<ExprId> = state.iter().map(|s| s.derivative).collect();
    by.push(equations.system.time);
    motion.push(g.one());
    let linear = Linearisation::new(g, &sections, of, &by);
    // Nobody computes these rates.
    let mut scratch = SectionWriter::new(g, BTreeSet::new(), &[]);
    let name = |value: &str, _: usize| format!("rate_{value}");
    let found = linear.forward(g, &mut scratch, &[motion], name, str::to_owned);
    found.into_iter().map(|rate| rate[0]).collect()
}
