//! The nonholonomic bracket of the components of a scene's state, as outputs of the scene, and the time in which a
//! motion is Hamiltonian.
//!
//! Does not know: how the bracket is derived, or what is found out about it.

use std::collections::{BTreeMap, BTreeSet};

use super::dependence::left_out;
use super::derivatives::Matrix;
use hamel_expr::error::Error;
use hamel_expr::{Definition, ExprId, Func, Graph, Rational, Section, SymbolId, needed_sections};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{
    Bracket, BracketFacts, Density, Equations, Jacobi, Output, OutputKind, StateEquation,
};

/// Name of the output with `R` of `y' = Pi dE + R`.
pub(super) const REMAINDER: &str = "bracket_remainder";

/// The bracket of a scene, and what has to be lowered for it.
pub(super) struct SceneBracket {
    /// The entries above the diagonal that do not vanish identically; the remainder where there is one.
    pub(super) outputs: Vec<Output>,
    pub(super) matrix: Matrix,
    /// To come after the sections of the equations.
    pub(super) sections: Vec<Section>,
}

/// The bracket of those components of `state` that are no coordinates of the group, in the time `tau` with
/// `dt/dtau = factor`.
///
/// # Errors
/// [`Error::NoBracket`] for a system without, or whose bracket depends on a coordinate that the scene leaves out;
/// [`Error::Unverified`].
pub(super) fn find(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    factor: ExprId,
) -> Result<SceneBracket, Error> {
    let bracket = Bracket::new(g, equations)?;
    let places: BTreeMap<SymbolId, usize> = state.iter().enumerate().map(|(k, s)| (s.symbol, k)).collect();
    let place = |k: usize| places.get(&equations.state[k].symbol).copied();
    let kept: Vec<usize> = (0..equations.state.len()).filter(|k| place(*k).is_some()).collect();
    let name = |k: usize| equations.state[k].name.as_str();
    let (mut values, mut pattern, mut names) = (Vec::new(), Vec::new(), Vec::new());
    for &(i, j, e) in &bracket.entries {
        if let (Some(row), Some(column)) = (place(i), place(j)) {
            pattern.push((row, column));
            names.push(format!("bracket_{}_{}", name(i), name(j)));
            values.push(g.mul(factor, e));
        }
    }
    let n_entries = values.len();
    let has_remainder = bracket.has_remainder(g);
    if has_remainder {
        values.extend(kept.iter().map(|k| g.mul(factor, bracket.remainder[*k])));
        names.extend(kept.iter().map(|k| format!("{REMAINDER}_{}", name(*k))));
    }
    let left_out: BTreeSet<SymbolId> = left_out(equations, state);
    let mut sections = bracket.sections;
    if !left_out.is_empty() {
        let all: Vec<Section> = equations.sections.iter().chain(&sections).cloned().collect();
        sections = without(g, equations, &all, &left_out, &mut values).map_err(|at| Error::NoBracket {
            reason: format!("{} depends on a coordinate that the scene leaves out", names[at]),
        })?;
    }
    let mut components: Vec<(String, ExprId)> = names.into_iter().zip(values).collect();
    let remainder = components.split_off(n_entries);
    let doc = "entries `{y_i, y_j}`, `i < j`, of the nonholonomic bracket that do not vanish identically, row by row";
    let mut outputs = vec![Output::group(Want::Bracket, components, doc)];
    if has_remainder {
        let doc =
            "`R` of `y' = Pi dE + R`: what an affine constraint, explicit time and forces add to the motion";
        let (kind, name) = (OutputKind::Remainder, REMAINDER.to_owned());
        outputs.push(Output { kind, name, components: remainder, doc: doc.to_owned() });
    }
    let doc = if has_remainder {
        "antisymmetric matrix `Pi_ij = {y_i, y_j}` of the nonholonomic bracket, `y' = Pi dE + R`"
    } else {
        "antisymmetric matrix `Pi_ij = {y_i, y_j}` of the nonholonomic bracket, `y' = Pi dE`"
    };
    let shape = (kept.len(), kept.len());
    let matrix = Matrix { name: Want::Bracket.name(), shape, pattern, is_antisymmetric: true, doc };
    Ok(SceneBracket { outputs, matrix, sections })
}

/// `dt/dtau` of the time `tau` in which the motion is Hamiltonian, and the output that it is.
///
/// # Errors
/// [`Error::NoHamiltonianTime`]; what is wrong with the bracket.
pub(super) fn hamiltonian_time(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
) -> Result<(ExprId, Output), Error> {
    let refused = |reason: String| Error::NoHamiltonianTime { reason };
    let facts = BracketFacts::new(equations, &left_out(equations, state))?;
    g.take_over(&facts.graph);
    if !facts.remainder.is_empty() {
        return Err(refused("an affine constraint, explicit time or a force acts".into()));
    }
    let mut known = facts.graph.clone();
    let factor = match (&facts.jacobi, &facts.multiplier) {
        (Jacobi::Holds, _) => known.one(),
        (_, Some(Density::Found { factors, exponent })) => {
            let mut parts: Vec<(ExprId, Rational)> =
                factors.iter().map(|f| (f.base, f.exponent.clone())).collect();
            if let Some(exponent) = exponent {
                parts.push((known.func(Func::Exp, *exponent), Rational::from_integer(1.into())));
            }
            let place = |_| Error::DivisionByZero { place: "the multiplier of the bracket".into() };
            known.power_product(&parts).map_err(place)?
        }
        (_, Some(Density::Impossible { reason, .. } | Density::NotFound { reason })) => {
            return Err(refused(reason.clone()));
        }
        (_, None) => return Err(refused("whether Jacobi holds is not known".into())),
    };
    let symbols = known.free_symbols(factor);
    if let Some(x) = left_out(equations, state).iter().find(|x| symbols.contains(x)) {
        return Err(refused(format!("dt/dtau depends on {}, which the scene leaves out", g.name(*x))));
    }
    let place = |_| Error::DivisionByZero { place: "the multiplier of the bracket".into() };
    let factor = g.import(&known, &[factor]).map_err(place)?[0];
    let doc = "`dt/dtau` of the time `tau` in which the motion is Hamiltonian, that of this scene";
    let name = Want::HamiltonianTime.name().to_owned();
    Ok((factor, Output::group(Want::HamiltonianTime, vec![(name, factor)], doc)))
}

/// Takes values at an origin of coordinates on which they do not depend, the angle zero of a point of the circle; all
/// definitions that they then need. The position of the first value that depends on them otherwise.
fn without(
    g: &mut Graph,
    equations: &Equations,
    sections: &[Section],
    left_out: &BTreeSet<SymbolId>,
    values: &mut [ExprId],
) -> Result<Vec<Section>, usize> {
    let cosines: BTreeSet<SymbolId> = equations.system.circles.iter().map(|c| c.cosine).collect();
    let origin = |s: &SymbolId| (*s, if cosines.contains(s) { g.one() } else { g.zero() });
    let mut image: BTreeMap<SymbolId, ExprId> = left_out.iter().map(origin).collect();
    let mut moved = Vec::new();
    for section in needed_sections(g, sections, values) {
        let mut definitions = Vec::new();
        for definition in &section.definitions {
            // A definition without a value there is left alone; what needs it will not come out equal.
            let Ok(value) = g.subs(definition.expr, &image) else { continue };
            if value == definition.expr {
                continue;
            }
            let value = g.cancel_zero(value);
            let name = g.name(definition.symbol).to_owned();
            let replacement = if g.is_trivial(value) {
                value
            } else {
                let symbol = g.define(&name, value);
                definitions.push(Definition { symbol, expr: value });
                g.sym(symbol)
            };
            image.insert(definition.symbol, replacement);
        }
        moved.push(Section { title: section.title.clone(), definitions });
    }
    let mut all = sections.to_vec();
    all.extend(moved);
    for (at, e) in values.iter_mut().enumerate() {
        match g.subs(*e, &image) {
            Ok(value) if g.is_equal(value, *e) => *e = g.cancel_zero(value),
            _ => {
                let needed = needed_sections(g, &all, &[*e]);
                let used = needed.iter().flat_map(|s| &s.definitions).map(|d| d.expr).chain([*e]);
                if used.into_iter().any(|e| g.depends_on(e, left_out)) {
                    return Err(at);
                }
            }
        }
    }
    Ok(all.split_off(equations.sections.len()))
}
