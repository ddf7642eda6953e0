//! The kernel representation of the reduced Dirac structure, by functions of the state.
//!
//! Flows are `f = (eta, pdot)`, efforts `e = (gamma, w)`; `gamma` is all that pairs with the velocity `eta`, the
//! covector `rho^* alpha` along the rates of places included, and `w` pairs with `pdot`. With the one-forms `a` of the
//! reactions and a basis `W` of their annihilator, displacements,
//!
//! ```text
//! D = { (f, e) : F f + E e = 0 }:   a eta = 0,   w - eta = 0,   W^T (pdot + gamma + B eta) = 0,   B_bd = C^c_bd p_c
//! ```
//!
//! As many rows as there are flows, `E F^T + F E^T = 0`, and the rows are independent: `D` is its own annihilator. The
//! motion of a system whose velocities are displacements is in it with `gamma = -F - rho^* dL/dx` and `w = eta = y`.
//!
//! Does not know: which scene wants it, how the structure is written for people.
//!
//! # Source
//! Gay-Balmaz, Yoshimura 2015 (Dirac reduction for nonholonomic mechanical systems and semidirect products), equations
//! (2.11), (5.4); van der Schaft, Jeltsema 2014, Port-Hamiltonian systems theory, section 5.1, for the representation.

use std::collections::BTreeMap;

use crate::reduction::KinematicConstraint;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SymbolId};
use hamel_lang::spec::Want;

use super::dirac::annihilator;
use super::equations::{Equations, OutputKind};

/// The matrices `F` of flows and `E` of efforts, `[2 n][2 n]` for `n` velocities, row after row, with names.
#[derive(Clone, Debug)]
pub struct DiracKernel {
    /// `flow_1_Omega1`, .., along velocities, and `flow_1_p_Omega1`, .., along the rates of momenta.
    pub flows: Vec<(String, ExprId)>,
    /// `effort_1_Omega1`, .., of what pairs with velocities, and `effort_1_p_Omega1`, .., with rates of momenta.
    pub efforts: Vec<(String, ExprId)>,
}

impl DiracKernel {
    /// That of the frame of the equations.
    ///
    /// # Errors
    /// [`Error::NoDirac`] where constraints are kept by multipliers, in frames that move with the time, and without
    /// momenta; [`Error::DivisionByZero`] of velocities without a value.
    pub fn new(g: &mut Graph, equations: &Equations) -> Result<DiracKernel, Error> {
        let system = &equations.system;
        let refused = |reason: &str| Error::NoDirac { reason: reason.into() };
        let n = system.velocities.len();
        if system.algebroid.has_drift() {
            return Err(refused(
                "the frame of the velocities moves with the time, so that momenta change by themselves",
            ));
        }
        let identity: Vec<Vec<ExprId>> =
            (0..n).map(|i| (0..n).map(|j| if i == j { g.one() } else { g.zero() }).collect()).collect();
        let displacements = match &system.constraint {
            KinematicConstraint::Solved(solved) => solved.virtual_displacements.clone(),
            KinematicConstraint::Multipliers { reactions, .. } if reactions.is_empty() => identity.clone(),
            KinematicConstraint::Multipliers { .. } => {
                return Err(refused("multipliers keep constraints, and nothing spans the displacements"));
            }
        };
        let n_columns = displacements.first().map_or(0, Vec::len);
        if n_columns == 0 {
            return Err(refused(
                "the Lagrangian or the constraints give all velocities, and no displacement is left",
            ));
        }
        let forms = annihilator(g, system);
        if forms.len() + n_columns != n {
            let is_parametrised = system.unknowns.iter().any(|u| u.frame_idx.is_none());
            return Err(refused(match is_parametrised {
                true => "a velocity that parametrises constraints is in more than two of them",
                false => "the Lagrangian gives velocities that no constraint restricts",
            }));
        }
        let momenta = equations.outputs.iter().find(|o| o.kind == OutputKind::Group(Want::Momentum));
        let momenta: Vec<ExprId> =
            momenta.iter().flat_map(|o| o.components.iter().map(|(_, e)| *e)).collect();
        if momenta.len() != n {
            return Err(refused("there are not as many momenta as velocities"));
        }
        let values: BTreeMap<SymbolId, ExprId> =
            system.velocities.iter().copied().zip(equations.velocities.iter().copied()).collect();
        let no_value = |_| Error::DivisionByZero { place: "the Dirac structure".into() };
        // Forms of nonlinear constraints depend on velocities.
        let at_state = |g: &mut Graph, rows: Vec<Vec<ExprId>>| -> Result<Vec<Vec<ExprId>>, Error> {
            rows.iter().map(|row| g.subs_all(row, &values).map_err(no_value)).collect()
        };
        let forms = at_state(g, forms)?;
        let displacements = at_state(g, displacements)?;
        let mut twisted = vec![vec![g.zero(); n]; n];
        for (b, row) in twisted.iter_mut().enumerate() {
            for (d, entry) in row.iter_mut().enumerate() {
                let terms: Vec<ExprId> = system
                    .algebroid
                    .bracket(g, b, d)
                    .into_iter()
                    .map(|(c, e)| g.mul(e, momenta[c]))
                    .collect();
                *entry = g.sum(&terms);
            }
        }
        let zeros = vec![g.zero(); n];
        let (mut flows, mut efforts) = (Vec::new(), Vec::new());
        for form in forms {
            flows.push([form, zeros.clone()].concat());
            efforts.push([zeros.clone(), zeros.clone()].concat());
        }
        for unit in identity {
            let minus = unit.iter().map(|e| g.neg(*e)).collect();
            flows.push([minus, zeros.clone()].concat());
            efforts.push([zeros.clone(), unit].concat());
        }
        for column in 0..n_columns {
            let along: Vec<ExprId> = displacements.iter().map(|row| row[column]).collect();
            let mut rates = Vec::new();
            for d in 0..n {
                let own: Vec<ExprId> = twisted.iter().map(|row| row[d]).collect();
                rates.push(g.dot(&along, &own));
            }
            flows.push([rates, along.clone()].concat());
            efforts.push([along, zeros.clone()].concat());
        }
        let frame = system.algebroid.frame();
        let ports: Vec<String> =
            frame.iter().cloned().chain(frame.iter().map(|name| format!("p_{name}"))).collect();
        let named = |stem: &str, rows: Vec<Vec<ExprId>>| -> Vec<(String, ExprId)> {
            let rows = rows.into_iter().enumerate();
            rows.flat_map(|(k, row)| {
                let name = move |port: &String| format!("{stem}_{}_{port}", k + 1);
                ports.iter().map(name).zip(row).collect::<Vec<_>>()
            })
            .collect()
        };
        Ok(DiracKernel { flows: named("flow", flows), efforts: named("effort", efforts) })
    }
}
