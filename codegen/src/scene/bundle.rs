//! Functions of a principal bundle that a scene can want: phases, the local form of the connection, the Dirac
//! structure.
//!
//! Does not know: how connections are derived, programs.

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph};
use hamel_lang::spec::Want;
use hamel_mechanics::mechanics::{
    DiracKernel, Equations, LocalConnection, Output, Phase, StateEquation, of_attitudes, phases,
};

use super::dependence::{left_out, needs};

/// Rates of the phases of the coordinates that an abelian group moves, and of attitudes with a constant momentum.
pub(super) fn phases_of(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
) -> Result<Output, Error> {
    let mut found = phases(g, equations)?;
    let (is_abelian, n) = (!found.is_empty(), found.len());
    found.extend(of_attitudes(g, equations)?);
    let has_attitude = found.len() > n;
    let left_out = left_out(equations, state);
    let mut components = Vec::new();
    for Phase { name, geometric, dynamic } in found {
        for (part, e) in [("geometric", geometric), ("dynamic", dynamic)] {
            if needs(g, equations, e, &left_out) {
                return Err(Error::NoPhases {
                    reason: format!("that of {name} depends on a coordinate that the scene leaves out"),
                });
            }
            components.push((format!("{name}_{part}"), e));
        }
    }
    if components.is_empty() {
        let reason = "no coordinate of an abelian group is moved through a connection, and no angular momentum of a \
                      quaternion is constant in space";
        return Err(Error::NoPhases { reason: reason.into() });
    }
    let abelian = "rates of the geometric phases, `-A(x) xdot`, and of the dynamic ones, the rest, of the coordinates of \
                   abelian groups";
    let attitudes = "rates of the phases of attitudes, turns about the angular momentum `Pi` that is constant in space: \
                     the geometric one is minus the solid angle that `Pi` sweeps in the body about the third axis, the \
                     dynamic one `Omega . Pi/|Pi|`";
    let doc = match (is_abelian, has_attitude) {
        (true, true) => format!("{abelian}; {attitudes}"),
        (false, true) => attitudes.to_owned(),
        _ => abelian.to_owned(),
    };
    Ok(Output::group(Want::Phases, components, &doc))
}

/// The local form of the connection, and its curvature.
pub(super) fn connection_of(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
    dim: usize,
) -> Result<Output, Error> {
    let LocalConnection { coefficients, curvature } = LocalConnection::new(g, equations, dim)?;
    let components: Vec<(String, ExprId)> = coefficients.into_iter().chain(curvature).collect();
    let left_out = left_out(equations, state);
    if let Some((name, _)) = components.iter().find(|(_, e)| needs(g, equations, *e, &left_out)) {
        let reason = format!("{name} depends on a coordinate that the scene leaves out");
        return Err(Error::NoConnection { reason });
    }
    let doc = "local connection `A(x)` by components, with `xi = -A(x) xdot` along horizontal curves, and its curvature \
               `d_i A_j - d_j A_i - [A_i, A_j]`";
    Ok(Output::group(Want::Connection, components, doc))
}

/// The matrices of the reduced Dirac structure.
pub(super) fn dirac_of(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
) -> Result<Output, Error> {
    let DiracKernel { flows, efforts } = DiracKernel::new(g, equations)?;
    let components: Vec<(String, ExprId)> = flows.into_iter().chain(efforts).collect();
    let left_out = left_out(equations, state);
    if let Some((name, _)) = components.iter().find(|(_, e)| needs(g, equations, *e, &left_out)) {
        return Err(Error::NoDirac {
            reason: format!("{name} depends on a coordinate that the scene leaves out"),
        });
    }
    let doc = "matrices `F`, then `E`, row by row, of the reduced Dirac structure `F f + E e = 0`: flows are velocities and \
               rates of momenta, efforts pair with them";
    Ok(Output::group(Want::Dirac, components, doc))
}
