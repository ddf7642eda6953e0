//! What brackets along any constraint are made of: velocities and momenta on the state, the bracket of the frame.
//!
//! Does not know: how the sections along a constraint are found, which coordinates a state has.

use std::collections::BTreeMap;

use crate::mechanics::equations::Equations;
use crate::reduction::{AccelerationSource, KinematicConstraint};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, SectionWriter, SymbolId};

/// The bracket in coordinates `(x, pi)`, by place of the unknown, and what takes it to velocities.
pub(super) struct MomentumForm {
    /// `rho(W_b)^i`, by `i` and `b`.
    pub(super) anchor: Vec<Vec<ExprId>>,
    /// `{pi_a, pi_b}`.
    pub(super) momenta: Vec<Vec<ExprId>>,
    /// `rho(W_a)` of `pi_b` at fixed velocities, by `a` and `b`.
    pub(super) turning: Vec<Vec<ExprId>>,
    /// `R` along `x` and `pi`, before the term of the energy that is linear in `psi0`.
    pub(super) remainder: [Vec<ExprId>; 2],
    /// `d pi/dx^i` at fixed velocities along `R_x`, plus `d pi/dt`.
    pub(super) lag: Vec<ExprId>,
    /// `<p, psi0>`, by which the energy differs from that of the velocities `Psi u`.
    pub(super) moving_energy: ExprId,
}

/// Writes the definitions of a bracket.
pub(super) struct Builder<'a> {
    pub(super) g: &'a mut Graph,
    pub(super) equations: &'a Equations,
    pub(super) writer: SectionWriter,
    /// What stands for velocities that are no part of the state.
    pub(super) values: BTreeMap<SymbolId, ExprId>,
    /// Momenta `p_alpha` before replacement, and after.
    pub(super) raw_momentum: Vec<ExprId>,
    pub(super) momentum: Vec<ExprId>,
    /// `L_yy`, or `h_pp`.
    pub(super) hessian: Vec<Vec<ExprId>>,
}

fn no_bracket(reason: &str) -> Error {
    Error::NoBracket { reason: reason.to_owned() }
}

impl<'a> Builder<'a> {
    pub(super) fn new(g: &'a mut Graph, equations: &'a Equations) -> Result<Builder<'a>, Error> {
        let system = &equations.system;
        if system.accelerations.is_some() {
            return Err(no_bracket("the motion is given, and has no energy"));
        }
        if system.degeneracy.is_some() {
            return Err(no_bracket(
                "the Lagrangian is degenerate, and momenta do not determine the velocities",
            ));
        }
        let writer = SectionWriter::new(g, equations.varying.clone(), &[]);
        let mut b = Builder {
            g,
            equations,
            writer,
            values: BTreeMap::new(),
            raw_momentum: Vec::new(),
            momentum: Vec::new(),
            hessian: Vec::new(),
        };
        b.check_constraint()?;
        b.velocities()?;
        b.momenta()?;
        Ok(b)
    }

    /// Refuses constraints on accelerations, and displacements other than the allowed velocities:
    /// Chetaev's, where constraints are nonlinear.
    fn check_constraint(&mut self) -> Result<(), Error> {
        let displaced = "virtual displacements are not the velocities that the constraints allow, and the energy is no \
                         Hamilton function of the motion";
        let system = &self.equations.system;
        match &system.constraint {
            KinematicConstraint::Solved(solved) => {
                let pairs = solved.psi.iter().flatten().zip(solved.virtual_displacements.iter().flatten());
                for (psi, w) in pairs {
                    if !self.g.is_equal(*psi, *w) {
                        return Err(no_bracket(displaced));
                    }
                }
            }
            KinematicConstraint::Multipliers { rows, reactions } => {
                if rows.iter().any(|row| row.mode.is_some()) {
                    return Err(no_bracket("constraints of modes hold at some times and not at others"));
                }
                for (row, reaction) in rows.iter().zip(reactions) {
                    if matches!(row.source, AccelerationSource::Servo(_)) {
                        let reason = format!("{} is a constraint on accelerations", row.text);
                        return Err(no_bracket(&reason));
                    }
                    for (a, b) in row.one_form.iter().zip(reaction) {
                        if !self.g.is_equal(*a, *b) {
                            return Err(no_bracket(displaced));
                        }
                    }
                }
            }
        }
        Ok(())
    }

    pub(super) fn replace(&mut self, e: ExprId) -> Result<ExprId, Error> {
        let replaced = self.g.subs(e, &self.values);
        let replaced =
            replaced.map_err(|_| Error::DivisionByZero { place: "the nonholonomic bracket".into() })?;
        Ok(self.g.cancel_zero(replaced))
    }

    pub(super) fn define(&mut self, name: &str, value: ExprId) -> ExprId {
        self.writer.define(self.g, name, value)
    }

    /// Velocities that the state does not carry: those of momenta, and those that a constraint determines.
    fn velocities(&mut self) -> Result<(), Error> {
        let system = &self.equations.system;
        self.writer.begin("velocities");
        self.values.extend(self.equations.velocities_of_momenta());
        for unknown in &system.unknowns {
            let Some(alpha) = unknown.frame_idx else { continue };
            if system.velocities[alpha] != unknown.symbol {
                let own = self.g.sym(unknown.symbol);
                let value = self.values.get(&unknown.symbol).copied().unwrap_or(own);
                self.values.insert(system.velocities[alpha], value);
            }
        }
        if let KinematicConstraint::Solved(solved) = &system.constraint {
            for &alpha in &solved.dependent {
                let value = solved.velocity(self.g, alpha);
                let value = self.replace(value)?;
                let name = self.equations.system.algebroid.frame()[alpha].clone();
                let named = self.define(&name, value);
                self.values.insert(system.velocities[alpha], named);
            }
        }
        Ok(())
    }

    fn momenta(&mut self) -> Result<(), Error> {
        let system = &self.equations.system;
        if let Some(hamiltonian) = &system.hamiltonian {
            for p in &hamiltonian.momenta {
                let row: Vec<ExprId> = {
                    let y = self.g.diff(hamiltonian.h, *p);
                    hamiltonian.momenta.iter().map(|q| self.g.diff(y, *q)).collect()
                };
                self.hessian.push(row);
            }
            for momentum in &system.momenta {
                self.values.insert(hamiltonian.momenta[momentum.unknown], momentum.value);
                self.momentum.push(momentum.value);
            }
            for (alpha, p) in hamiltonian.momenta.iter().enumerate() {
                let y = self.g.diff(hamiltonian.h, *p);
                let y = self.replace(y)?;
                let named = self.define(&system.algebroid.frame()[alpha], y);
                self.values.insert(system.velocities[alpha], named);
            }
            return Ok(());
        }
        self.writer.begin("momenta p = dL/dy");
        let velocities = system.velocities.clone();
        self.raw_momentum = velocities.iter().map(|y| self.g.diff(system.lagrangian, *y)).collect();
        for alpha in 0..velocities.len() {
            let value = self.replace(self.raw_momentum[alpha])?;
            let name = format!("p_{}", system.algebroid.frame()[alpha]);
            let named = self.define(&name, value);
            self.momentum.push(named);
            let row: Vec<ExprId> =
                velocities.iter().map(|y| self.g.diff(self.raw_momentum[alpha], *y)).collect();
            self.hessian.push(row);
        }
        for alpha in 0..velocities.len() {
            for beta in 0..velocities.len() {
                self.hessian[alpha][beta] = self.replace(self.hessian[alpha][beta])?;
            }
        }
        Ok(())
    }

    pub(super) fn bilinear(&mut self, matrix: &[Vec<ExprId>], a: &[ExprId], b: &[ExprId]) -> ExprId {
        let mut terms = Vec::new();
        for (row, x) in matrix.iter().zip(a) {
            if *x != self.g.zero() {
                let sum = self.g.dot(row, b);
                terms.push(self.g.mul(*x, sum));
            }
        }
        self.g.sum(&terms)
    }

    /// `<p, [e_alpha, e_beta]>`.
    pub(super) fn lie_poisson(&mut self) -> Vec<Vec<ExprId>> {
        let algebroid = &self.equations.system.algebroid;
        let m = algebroid.rank();
        let mut matrix = vec![vec![self.g.zero(); m]; m];
        for alpha in 0..m {
            for beta in alpha + 1..m {
                let terms: Vec<ExprId> = (algebroid.bracket(self.g, alpha, beta).into_iter())
                    .map(|(gamma, c)| self.g.mul(c, self.momentum[gamma]))
                    .collect();
                let sum = self.g.sum(&terms);
                matrix[alpha][beta] = self.g.cancel_zero(sum);
                matrix[beta][alpha] = self.g.neg(matrix[alpha][beta]);
            }
        }
        matrix
    }

    /// `rho(W)^i` of a section.
    pub(super) fn anchor_of(&mut self, section: &[ExprId]) -> Vec<ExprId> {
        let algebroid = &self.equations.system.algebroid;
        let rows = 0..algebroid.n_base();
        rows.map(|i| {
            let row: Vec<ExprId> = (0..algebroid.rank()).map(|alpha| algebroid.anchor(i, alpha)).collect();
            self.g.dot(&row, section)
        })
        .collect()
    }

    /// Adds the rates of base coordinates that no velocity moves to a vector of the base.
    pub(super) fn add_own_rates(&mut self, vector: &mut [ExprId]) -> Result<(), Error> {
        for (e, own) in vector.iter_mut().zip(self.equations.system.own_rates_of_base()) {
            let own = self.replace(own)?;
            *e = self.g.add(*e, own);
        }
        Ok(())
    }

    /// The derivative of an expression in raw velocities along a vector of the base, at fixed velocities.
    pub(super) fn along(&mut self, e: ExprId, direction: &[ExprId]) -> Result<ExprId, Error> {
        let mut terms = Vec::new();
        let base = self.equations.system.algebroid.base().to_vec();
        for (x, v) in base.into_iter().zip(direction) {
            if *v == self.g.zero() {
                continue;
            }
            let slope = self.g.diff(e, x);
            let slope = self.replace(slope)?;
            terms.push(self.g.mul(slope, *v));
        }
        Ok(self.g.sum(&terms))
    }

    /// The derivative by time, at fixed velocities.
    pub(super) fn by_time(&mut self, e: ExprId) -> Result<ExprId, Error> {
        let slope = self.g.diff(e, self.equations.system.time);
        self.replace(slope)
    }

    /// `F + N p`: forces, and the drift of the frame.
    pub(super) fn forces(&mut self) -> Result<Vec<ExprId>, Error> {
        let system = &self.equations.system;
        let mut forces = Vec::new();
        for (alpha, force) in system.forces.iter().enumerate() {
            let mut terms = vec![self.replace(*force)?];
            for (gamma, n) in system.algebroid.drift(alpha) {
                terms.push(self.g.mul(*n, self.momentum[*gamma]));
            }
            forces.push(self.g.sum(&terms));
        }
        Ok(forces)
    }
}
