//! The exact flows that a scene can want, as functions beside its right-hand side.
//!
//! Deliberately does not know: how flows are found, lowered or emitted, how they are composed.

use std::collections::BTreeMap;

use hamel_expr::error::Error;
use hamel_expr::{Graph, Section, Style, SymbolId};
use hamel_mechanics::mechanics::{Equations, SplitFlow, Splitting, StateEquation};
use hamel_program::lower::Request;
use hamel_program::program::Role;

/// The role of the flow at a position, from zero on.
pub(super) fn flow_role(index: usize) -> Role {
    Role::Flow(format!("flow{}", index + 1))
}

/// The flows of a scene, and what has to be lowered for them.
pub(super) struct Found {
    /// The forms, as text, that the part of the Hamiltonian behind each flow is a function of.
    pub(super) flows: Vec<Vec<String>>,
    pub(super) requests: Vec<Request>,
    pub(super) arguments: BTreeMap<Role, Vec<SymbolId>>,
    /// To come after the sections of the equations.
    pub(super) sections: Vec<Section>,
}

/// The flows of the motion of `state`.
///
/// # Errors
/// As [`Splitting::new`]; [`Error::NoSplitting`] where the state is not that of the bracket.
pub(super) fn find(g: &mut Graph, equations: &Equations, state: &[StateEquation]) -> Result<Found, Error> {
    let is_there = |s: &StateEquation, list: &[StateEquation]| list.iter().any(|own| own.symbol == s.symbol);
    if let Some(other) = state.iter().find(|s| !is_there(s, &equations.state)) {
        let reason = format!("{} is reconstructed, and no part of the bracket", other.name);
        return Err(Error::NoSplitting { reason });
    }
    if let Some(missing) = equations.state.iter().find(|s| !is_there(s, state)) {
        let reason = format!("the scene leaves {} out", missing.name);
        return Err(Error::NoSplitting { reason });
    }
    let splitting = Splitting::new(g, equations)?;
    let (mut requests, mut arguments) = (Vec::new(), BTreeMap::new());
    for (index, flow) in splitting.flows.iter().enumerate() {
        let role = flow_role(index);
        let names = state.iter().map(|s| s.name.clone());
        requests.push(Request {
            role: role.clone(),
            results: names.zip(flow.increment.iter().copied()).collect(),
        });
        arguments.insert(role, vec![splitting.tau]);
    }
    let forms =
        |flow: &SplitFlow| flow.forms.iter().map(|(form, _)| g.display(*form, Style::Plain)).collect();
    let flows = splitting.flows.iter().map(forms).collect();
    Ok(Found { flows, requests, arguments, sections: splitting.sections })
}
