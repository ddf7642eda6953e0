//! The local form of a connection and its curvature, by components.
//!
//! `xi = -A(x) xdot` along horizontal curves, and `B = dA - [A, A]` with the bracket of the side of the action: minus
//! the vertical part of the brackets of the horizontal lifts. Does not know: where a connection came from, which scene
//! wants it.
//!
//! # Source
//! Bloch, Krishnaprasad, Marsden, Murray 1996, Nonholonomic mechanical systems with symmetry, sections 2 and 6.

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph};

use super::equations::Equations;

/// The components of a connection and of its curvature, with names.
#[derive(Clone, Debug)]
pub struct LocalConnection {
    /// `A^a_i`, by rows: `connection_v_x` along the velocity `v` of the algebra and the coordinate `x`.
    pub coefficients: Vec<(String, ExprId)>,
    /// `B^a_ij = d_i A^a_j - d_j A^a_i - [A_i, A_j]^a` for `i < j`, pair after pair: `curvature_v_x_y`.
    pub curvature: Vec<(String, ExprId)>,
}

impl LocalConnection {
    /// That of the formulation of the equations, whose last `dim` velocities are along the algebra.
    ///
    /// # Errors
    /// [`Error::NoConnection`] without a base or an algebra, and in frames that are none of lifts.
    pub fn new(g: &mut Graph, equations: &Equations, dim: usize) -> Result<LocalConnection, Error> {
        let system = &equations.system;
        let n = system.velocities.len().saturating_sub(dim);
        let refused = |reason: &str| Error::NoConnection { reason: reason.into() };
        if n == 0 || dim == 0 {
            return Err(refused("it takes coordinates of the base and velocities of an algebra"));
        }
        if system.quasi_frame.is_some() || system.frame.is_some() && system.lift.is_none() {
            return Err(refused("velocities are along a frame of their own"));
        }
        let lifts = system.with_lifts(g);
        let names = lifts.frame().to_vec();
        let coordinate = |i: usize| names[i].strip_suffix("_dot").unwrap_or(&names[i]).to_owned();
        let mut coefficients = Vec::new();
        for a in 0..dim {
            for i in 0..n {
                let value = system.connection.as_ref().map_or(g.zero(), |rows| rows[a][i]);
                coefficients.push((format!("connection_{}_{}", names[n + a], coordinate(i)), value));
            }
        }
        let mut curvature = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                let bracket = lifts.bracket(g, i, j);
                for a in 0..dim {
                    let along = bracket.iter().find(|(c, _)| *c == n + a).map_or(g.zero(), |(_, e)| *e);
                    let value = g.neg(along);
                    let (x, y) = (coordinate(i), coordinate(j));
                    curvature.push((format!("curvature_{}_{x}_{y}", names[n + a]), value));
                }
            }
        }
        Ok(LocalConnection { coefficients, curvature })
    }
}
