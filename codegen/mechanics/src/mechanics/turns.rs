//! Phases of an attitude whose angular momentum is constant in space: the isotropy group of the momentum is the turns
//! about it, so that these are the phases of one angle.
//!
//! The momentum `Pi` in the frame of the body stays on a sphere. With the shortest turn `Q` that takes its direction
//! `u = Pi/|Pi|` to the third axis of the body, and a fixed turn `N` of this axis to the momentum in space,
//!
//! ```text
//! q = N R(theta) Q(u),   R a turn about the third axis,
//! theta' = Omega . u - Lambda',   Lambda' = e3 . (Pi x Pi')/(|Pi| (|Pi| + Pi_3)),   Pi' = Pi x Omega
//! ```
//!
//! `Lambda` is the solid angle that `Pi` sweeps about the third axis, counted in the sense of turns about it. After a
//! period `T` of `Pi` the attitude has turned about the momentum by `theta(T) - theta(0)`, which is `2 E T/|Pi| -
//! Lambda` for a free rigid body. `Lambda'` has no value where `Pi` is opposite to the third axis.
//!
//! Does not know: which scene wants phases.
//!
//! # Source
//! Montgomery 1991, How much does the rigid body rotate? A Berry's phase from the 18th century, Am. J. Phys. 59, 394;
//! Cabrera 2007, A generalized Montgomery phase formula for rotating self-deforming bodies, J. Geom. Phys. 57, 1405,
//! for bodies whose shape changes.

use std::collections::BTreeMap;

use crate::reduction::MomentumInSpace;
use hamel_expr::error::Error;
use hamel_expr::{Definition, ExprId, Graph, SymbolId, inlined};
use hamel_lang::spec::{Side, Want};

use super::equations::{Equations, OutputKind};
use super::phases::Phase;

/// The phases of all attitudes whose angular momenta are constant in space. None for actions from the right, whose
/// momenta are those in space.
///
/// # Errors
/// [`Error::DivisionByZero`] of an angular momentum that vanishes, or of velocities without a value.
pub fn of_attitudes(g: &mut Graph, equations: &Equations) -> Result<Vec<Phase>, Error> {
    let system = &equations.system;
    let momenta = equations.outputs.iter().find(|o| o.kind == OutputKind::Group(Want::Momentum));
    let momenta: Vec<ExprId> = momenta.iter().flat_map(|o| o.components.iter().map(|(_, e)| *e)).collect();
    if system.side == Side::Right || system.quasi_frame.is_some() || momenta.len() != system.velocities.len()
    {
        return Ok(Vec::new());
    }
    let n_shape = system.connection.as_ref().map_or(0, |rows| system.velocities.len() - rows.len());
    let raw = system.group_velocity(g, n_shape);
    let values: BTreeMap<SymbolId, ExprId> =
        system.velocities.iter().copied().zip(equations.velocities.iter().copied()).collect();
    let no_value = |_| Error::DivisionByZero { place: "the phases of an attitude".into() };
    let group = g.subs_all(&raw, &values).map_err(no_value)?;
    let mut found = Vec::new();
    for own in &system.momenta_in_space {
        let (Some((name, _)), true) = (&own.attitude, is_angular(g, equations, own)) else { continue };
        let [Some(pi), Some(omega)] = [(&momenta, 0), (&group, n_shape)].map(|(list, from)| {
            let entries: Option<Vec<ExprId>> =
                own.velocities.iter().map(|k| list.get(k.checked_sub(from)?).copied()).collect();
            <[ExprId; 3]>::try_from(entries?).ok()
        }) else {
            continue;
        };
        if !is_constant_in_space(g, equations, &pi, &omega) {
            continue;
        }
        let square = g.dot(&pi, &pi);
        let norm = g.sqrt(square);
        let along = g.dot(&pi, &omega);
        let dynamic = g.div(along, norm).map_err(no_value)?;
        // `|Pi|^2 Omega_3 - Pi_3 Pi.Omega` without what cancels.
        let squares = [g.powi(pi[0], 2), g.powi(pi[1], 2)];
        let across = g.add(squares[0], squares[1]);
        let first = g.mul(omega[2], across);
        let turned = g.dot(&pi[..2], &omega[..2]);
        let second = g.mul(pi[2], turned);
        let swept = g.sub(first, second);
        let height = g.add(norm, pi[2]);
        let below = g.mul(norm, height);
        let geometric = g.div(swept, below).map_err(no_value)?;
        found.push(Phase { name: name.clone(), geometric, dynamic });
    }
    Ok(found)
}

/// Whether these are the angular velocity of their attitude, `[e_1, e_2] = e_3` in turn.
fn is_angular(g: &mut Graph, equations: &Equations, own: &MomentumInSpace) -> bool {
    let system = &equations.system;
    let Some((_, scalar)) = &own.attitude else { return false };
    let Some(part) = system.reconstruction.iter().find(|c| c.symbol == *scalar) else { return false };
    let free = g.free_symbols(part.rate);
    let [a, b, c] = own.velocities[..] else { return false };
    [[a, b, c], [b, c, a], [c, a, b]].into_iter().all(|[a, b, c]| {
        let bracket = system.algebroid.bracket(g, a, b);
        matches!(bracket[..], [(k, e)] if k == c && e == g.one()) && free.contains(&system.velocities[a])
    })
}

/// `Pi' = Pi x Omega` along the motion.
fn is_constant_in_space(g: &mut Graph, equations: &Equations, pi: &[ExprId; 3], omega: &[ExprId; 3]) -> bool {
    let definitions: Vec<Definition> =
        equations.sections.iter().flat_map(|s| s.definitions.iter().copied()).collect();
    let values = inlined(g, &definitions);
    let rates = equations.state.iter().map(|s| s.derivative);
    let roots: Vec<ExprId> = pi.iter().chain(omega).copied().chain(rates).collect();
    let Ok(roots) = g.subs_all(&roots, &values) else { return false };
    let (pi, omega) = (&roots[..3], &roots[3..6]);
    let state = equations.state.iter().map(|s| s.symbol);
    let moving: BTreeMap<SymbolId, ExprId> =
        state.zip(roots[6..].iter().copied()).chain([(equations.system.time, g.one())]).collect();
    (0..3).all(|k| {
        let (a, b) = ((k + 1) % 3, (k + 2) % 3);
        let rate = g.derivative_along(pi[k], &moving);
        let [forward, backward] = [g.mul(pi[a], omega[b]), g.mul(pi[b], omega[a])];
        let turning = g.sub(forward, backward);
        g.is_equal(rate, turning)
    })
}
