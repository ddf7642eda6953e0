//! Momenta as state: velocities from momenta (the Legendre transform of a Lagrangian that is quadratic in the
//! velocities), and the momentum equation.
//!
//! Does not know: which velocities have momenta in their place, and why.

use std::collections::{BTreeMap, BTreeSet};

use crate::error::Error;
use crate::expr::{ExprId, SymbolId};
use crate::reduction::KinematicConstraint;
use crate::spec::Want;

use super::derive::{Derivation, Motion};
use super::equations::{Legendre, Output};
use super::solve::Factorisation;

impl Derivation<'_> {
    /// The velocities whose momenta are carried: of the unknowns `u = (u_M, u_V)` those of `u_M` solve
    /// `A_MM u_M = pi_M - A_MV u_V - W_M^T dL/dy(psi0)`, `A = W^T L_yy Psi`.
    ///
    /// # Errors
    /// [`Error::Unsupported`] for a Lagrangian that is not quadratic in the velocities, and for virtual displacements
    /// that depend on them.
    pub(super) fn legendre(&mut self) -> Result<(), Error> {
        let system = self.system;
        if system.momenta.is_empty() {
            return Ok(());
        }
        let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
        self.hessian()?;
        if self.hessian.iter().flatten().any(|e| self.g.depends_on(*e, &velocities)) {
            return Err(Error::Unsupported {
                what: "momenta as state for a Lagrangian that is not quadratic in the velocities".into(),
                possible: "velocities as state; remove `carry` and `routh`".into(),
            });
        }
        let carried: Vec<usize> = system.momenta.iter().map(|m| m.unknown).collect();
        let unknowns: Vec<String> = system.unknowns.iter().map(|u| u.name.clone()).collect();
        let (matrix, name) = match &system.constraint {
            KinematicConstraint::Multipliers { .. } => (self.hessian.clone(), "M"),
            KinematicConstraint::Solved(solved) => {
                let displacements = solved.virtual_displacements.iter().flatten();
                if displacements.into_iter().any(|e| self.g.depends_on(*e, &velocities)) {
                    return Err(Error::Unsupported {
                        what: "momenta along virtual displacements that depend on velocities".into(),
                        possible: "velocities as state; remove `carry`".into(),
                    });
                }
                (self.mass_matrix(solved)?, "A")
            }
        };
        self.writer.begin(&format!("factors of {name}"));
        let (g, writer, signs) = (&mut self.g, &mut self.writer, &system.signs);
        let factors = Factorisation::new(g, writer, name, &matrix, &unknowns, signs, &carried)?;
        self.writer.begin("velocities of the momenta pi = W^T dL/dy");
        let mut right = vec![self.g.zero(); unknowns.len()];
        for (momentum, b) in system.momenta.iter().zip(&carried) {
            let mut terms = vec![momentum.value];
            for (a, unknown) in system.unknowns.iter().enumerate() {
                if !carried.contains(&a) {
                    let u = self.g.sym(unknown.symbol);
                    let product = self.g.mul(matrix[*b][a], u);
                    terms.push(self.g.neg(product));
                }
            }
            let at_rest = self.momentum_at_rest(*b)?;
            terms.push(self.g.neg(at_rest));
            let sum = self.g.sum(&terms);
            right[*b] = self.define(&format!("q_{}", unknowns[*b]), sum);
        }
        let (g, writer) = (&mut self.g, &mut self.writer);
        let u = factors.solve_leading(g, writer, carried.len(), &unknowns, &right);
        for b in carried {
            let unknown = &system.unknowns[b];
            self.replacement.insert(unknown.symbol, u[b]);
            if let Some(alpha) = unknown.frame_idx {
                self.y[alpha] = u[b];
            }
        }
        self.factors = Some(factors);
        Ok(())
    }

    /// `W^a_b dL/dy^a` at `y = psi0`.
    fn momentum_at_rest(&mut self, b: usize) -> Result<ExprId, Error> {
        let system = self.system;
        let mut at_rest = BTreeMap::new();
        for (alpha, velocity) in system.velocities.iter().enumerate() {
            let value = match &system.constraint {
                KinematicConstraint::Multipliers { .. } => self.g.zero(),
                KinematicConstraint::Solved(solved) => solved.psi0[alpha],
            };
            at_rest.insert(*velocity, value);
        }
        let place = || Error::DivisionByZero { place: "the momenta at rest".into() };
        let momentum = self.raw_momentum(b);
        let value = self.g.subs(momentum, &at_rest).map_err(|_| place())?;
        Ok(self.g.cancel_zero(value))
    }

    /// `W^a_b dL/dy^a` in the velocities of the frame.
    fn raw_momentum(&mut self, b: usize) -> ExprId {
        let system = self.system;
        crate::reduction::momentum_of(
            &mut self.g,
            system.lagrangian,
            &system.velocities,
            &system.constraint,
            b,
        )
    }

    /// The state variable or parameter that `dL/dy^alpha` is, where there is one: `W_b` has no other component.
    pub(super) fn carried_momentum(&self, alpha: usize) -> Option<ExprId> {
        let momentum = self.system.momenta.iter().find(|m| {
            let unknown = &self.system.unknowns[m.unknown];
            unknown.frame_idx == Some(alpha)
                && match &self.system.constraint {
                    KinematicConstraint::Multipliers { .. } => true,
                    KinematicConstraint::Solved(solved) => {
                        let column = solved.virtual_displacements.iter().map(|row| row[m.unknown]);
                        column
                            .enumerate()
                            .all(|(beta, e)| e == if beta == alpha { self.g.one() } else { self.g.zero() })
                    }
                }
        })?;
        Some(momentum.value)
    }

    /// Both ways between what the state carries and the velocities that it stands for: these as an output, the momenta by
    /// them.
    pub(super) fn conversions(&mut self) -> Result<(Legendre, Option<Output>), Error> {
        let system = self.system;
        let solved = match &system.constraint {
            KinematicConstraint::Solved(solved) => Some(solved),
            KinematicConstraint::Multipliers { .. } => None,
        };
        let mut dependent = BTreeMap::new();
        for &alpha in solved.iter().flat_map(|solved| &solved.dependent) {
            let value = solved.map_or(self.g.zero(), |solved| solved.velocity(&mut self.g, alpha));
            dependent.insert(system.velocities[alpha], value);
        }
        let mut legendre = Legendre::default();
        let mut velocities = Vec::new();
        for carried in system.momenta.iter().filter(|m| m.symbol.is_some()) {
            let unknown = &system.unknowns[carried.unknown];
            let raw = self.raw_momentum(carried.unknown);
            let place = || Error::DivisionByZero { place: "the momenta by velocities".into() };
            let momentum = self.g.subs(raw, &dependent).map_err(|_| place())?;
            let momentum = self.g.cancel_zero(momentum);
            legendre.velocities.push((unknown.name.clone(), unknown.symbol));
            legendre.momenta.push((carried.name.clone(), momentum));
            let velocity = self.g.sym(unknown.symbol);
            velocities.push((unknown.name.clone(), self.replace(velocity)?));
        }
        // The momenta at a level are numbers: a velocity that stands for one is no argument.
        for carried in system.momenta.iter().filter(|m| m.symbol.is_none()) {
            let unknown = &system.unknowns[carried.unknown];
            let velocity = self.g.sym(unknown.symbol);
            velocities.push((unknown.name.clone(), self.replace(velocity)?));
        }
        // Velocities along the levels of stages, for which those of the model are the arguments.
        if let Some(frame) = system.frame.as_ref().filter(|_| !system.changes.is_empty()) {
            legendre.momenta.extend(system.changes.iter().map(|c| (c.name.clone(), c.value)));
            let values = frame.velocities(&mut self.g, &self.y);
            let is_carried = |symbol: SymbolId| system.unknowns.iter().any(|u| u.symbol == symbol);
            for (own, value) in frame.original.iter().zip(values).filter(|(own, _)| !is_carried(own.symbol)) {
                legendre.velocities.push((own.name.clone(), own.symbol));
                velocities.push((own.name.clone(), value));
            }
        }
        let doc = match system.changes.is_empty() {
            true => {
                "velocities in the place of which the state carries momenta, or that cyclic coordinates have"
            }
            false => "velocities of the model",
        };
        let output = (!velocities.is_empty()).then(|| Output::group(Want::Velocities, velocities, doc));
        Ok((legendre, output))
    }

    /// The momentum equation of everything that is carried:
    /// `d/dt pi_b = W^a_b ((N - C y) p + rho dL/dx + F + sum_A lambda_A form_A)_a + (dW^a_b/dt) p_a`.
    ///
    /// # Errors
    /// [`Error::NotCyclic`] for a momentum that is a parameter and moves.
    ///
    /// # Source
    /// Cortes, de Leon, Marrero, Martinez 2009, equation (5.6); Bloch, Krishnaprasad, Marsden, Murray 1996.
    pub(super) fn momentum_rates(&mut self, motion: &Motion) -> Result<Vec<ExprId>, Error> {
        let system = self.system;
        if system.momenta.is_empty() {
            return Ok(Vec::new());
        }
        self.writer.begin("momentum equation");
        let mut slopes = Vec::new();
        for x in system.algebroid.base() {
            let slope = self.g.diff(system.lagrangian, *x);
            slopes.push(self.replace(slope)?);
        }
        let momentum = self.momentum.clone();
        let mut net: Vec<Option<ExprId>> = vec![None; self.y.len()];
        let mut rates = Vec::new();
        for carried in &system.momenta {
            let mut terms = Vec::new();
            for alpha in 0..self.y.len() {
                let w = match &system.constraint {
                    KinematicConstraint::Multipliers { .. } if alpha == carried.unknown => self.g.one(),
                    KinematicConstraint::Multipliers { .. } => continue,
                    KinematicConstraint::Solved(solved) => {
                        solved.virtual_displacements[alpha][carried.unknown]
                    }
                };
                if w == self.g.zero() {
                    continue;
                }
                let force = match net[alpha] {
                    Some(known) => known,
                    None => {
                        let applied = self.applied_force(alpha, &momentum, &slopes)?;
                        let name = format!("net_{}", self.names[alpha]);
                        let named = self.define(&name, applied);
                        net[alpha] = Some(named);
                        named
                    }
                };
                terms.push(self.g.mul(w, force));
                let turning = self.drift(w)?;
                terms.push(self.g.mul(turning, momentum[alpha]));
                if let KinematicConstraint::Multipliers { .. } = &system.constraint {
                    for (form, (_, lambda)) in motion.reactions.iter().zip(&motion.multipliers) {
                        terms.push(self.g.mul(form[alpha], *lambda));
                    }
                }
            }
            let sum = self.g.sum(&terms);
            let rate = self.g.cancel_zero(sum);
            if carried.symbol.is_none() && !self.g.is_zero(rate) {
                let velocity = system.unknowns[carried.unknown].name.clone();
                let rate = self.spelled_out(rate);
                return Err(Error::NotCyclic { velocity, parameter: carried.name.clone(), rate });
            }
            rates.push(self.define(&format!("dot_{}", carried.name), rate));
        }
        Ok(rates)
    }
}
