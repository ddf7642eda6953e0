//! Momenta `p = dL/dy`, their Hessian, and everything in the equations that has no accelerations.
//!
//! Does not know: constraints beyond what replaces the dependent velocities.

use std::collections::{BTreeMap, BTreeSet};

use crate::reduction::KinematicConstraint;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Node, SymbolId};

use super::derive::{Derivation, Forces};
use super::squares::{Square, take_squares};

impl Derivation<'_> {
    /// `p = dL/dy`, its Hessian, and the part of `-E` without accelerations.
    pub(super) fn momenta(&mut self) -> Result<Forces, Error> {
        let system = self.system;
        self.momentum = vec![self.g.zero(); self.y.len()];
        if self.is_whole() {
            self.momenta_of_velocities()?;
            self.hessian()?;
        }
        let recursion = self.way.recursion();
        let (squares, l) = match (&recursion, system.formulation.squares) {
            (Some(recursion), _) => (recursion.squares.clone(), recursion.rest),
            (None, true) => take_squares(&mut self.g, system, false),
            (None, false) => (Vec::new(), system.lagrangian),
        };
        let lag = self.lag_of_rows()?;
        let inertia_forces = if recursion.is_some() && !(self.is_whole() && self.has_reactions()) {
            vec![self.g.zero(); self.y.len()]
        } else {
            self.inertia_forces(&squares, lag.as_deref())?
        };
        let raw: Vec<ExprId> = system.velocities.iter().map(|s| self.g.diff(l, *s)).collect();
        let mut momentum = self.momentum.clone();
        if !squares.is_empty() {
            self.writer.begin("momenta p = dL/dy of the rest");
            for (alpha, p) in raw.iter().enumerate() {
                let value = self.replace(*p)?;
                momentum[alpha] = self.define(&format!("rest_p_{}", self.names[alpha]), value);
            }
        }
        let turning = if system.algebroid.has_drift() { "(N - C y) p" } else { "C y p" };
        let sign = if system.algebroid.has_drift() { "+" } else { "-" };
        let title = format!("forces rho dL/dx + F {sign} {turning} - (dp/dx xdot + dp/dt)");
        let inertia = if squares.is_empty() { "" } else { " of the rest, and -m dv/dy . a" };
        self.writer.begin(&format!("{title}{inertia}"));
        let mut forces = Forces::default();
        let mut slopes = Vec::new();
        if recursion.is_some() {
            slopes = self.slopes_behind(l)?;
        } else {
            for x in system.algebroid.base() {
                let slope = self.g.diff(l, *x);
                let slope = self.replace(slope)?;
                let name = format!("dL_d{}", self.g.name(*x));
                slopes.push(self.define(&name, slope));
            }
        }
        for (alpha, p) in raw.iter().enumerate() {
            let value = self.drive_of(alpha, *p, &momentum, &slopes)?;
            if recursion.is_some() {
                forces.of_rest.push(value);
            }
            let value = self.g.sub(value, inertia_forces[alpha]);
            let name = format!("r_{}", self.names[alpha]);
            let named = self.define(&name, value);
            forces.drive.push(named);
        }
        if let Some(lag) = lag {
            self.writer.begin("right side r - L_yy lag");
            let rest_hessian = self.hessian_of(l)?;
            let net = self.net(&forces.drive, &rest_hessian, &lag);
            for (alpha, net) in net.iter().enumerate() {
                let along = self.g.dot(&self.hessian[alpha].clone(), &lag);
                forces.drive[alpha] = self.g.add(*net, along);
            }
            forces.at_rest = Some((lag, net));
        }
        Ok(forces)
    }

    /// `p = dL/dy`.
    fn momenta_of_velocities(&mut self) -> Result<(), Error> {
        let system = self.system;
        let raw: Vec<ExprId> = system.velocities.iter().map(|s| self.g.diff(system.lagrangian, *s)).collect();
        self.writer.begin("momenta p = dL/dy");
        let carried: Vec<Option<usize>> = (0..raw.len()).map(|alpha| self.carried_along(alpha)).collect();
        for (alpha, p) in raw.iter().enumerate().filter(|(alpha, _)| carried[*alpha].is_none()) {
            let value = self.replace(*p)?;
            let name = format!("p_{}", self.names[alpha]);
            self.momentum[alpha] = self.define(&name, value);
        }
        for (alpha, place) in carried.iter().enumerate() {
            let Some(place) = *place else { continue };
            let value = self.momentum_along(alpha, place);
            let name = format!("p_{}", self.names[alpha]);
            self.momentum[alpha] = self.define(&name, value);
        }
        Ok(())
    }

    /// `dl/dx` for all coordinates at once, from the last value that others are computed from to the first: what linked
    /// bodies share is differentiated once. Along rates most of neighbouring slopes cancels, so that they get no names.
    ///
    /// # Source
    /// Griewank and Walther 2008, Evaluating Derivatives, section 3.2 (reverse mode).
    fn slopes_behind(&mut self, l: ExprId) -> Result<Vec<ExprId>, Error> {
        let base: Vec<ExprId> = self.system.algebroid.base().iter().map(|x| self.g.sym(*x)).collect();
        let symbols: BTreeSet<SymbolId> = self.system.algebroid.base().iter().copied().collect();
        let mut behind: BTreeMap<ExprId, Vec<ExprId>> = BTreeMap::from([(l, vec![self.g.one()])]);
        let reachable = self.g.reachable(&[l]);
        // Found in one pass: a part depends on the coordinates where an operand does.
        let mut depends: BTreeSet<ExprId> = BTreeSet::new();
        for e in &reachable {
            let node = self.g.node(*e);
            let mut is_one = matches!(node, Node::Symbol(s) if symbols.contains(s));
            node.for_each_operand(|operand| is_one |= depends.contains(&operand));
            if is_one {
                depends.insert(*e);
            }
        }
        for e in reachable.into_iter().rev() {
            if matches!(self.g.node(e), Node::Symbol(_)) || !depends.contains(&e) {
                continue;
            }
            let Some(terms) = behind.remove(&e) else { continue };
            let sum = self.g.sum(&terms);
            let is_shared = terms.len() > 1 && !matches!(self.g.node(e), Node::Function(..));
            let slope = if is_shared { self.define("slope", sum) } else { sum };
            for (operand, partial) in self.g.partials(e, e) {
                let partial = self.replace(partial)?;
                let along = self.g.mul(slope, partial);
                behind.entry(operand).or_default().push(along);
            }
        }
        Ok(base.iter().map(|x| behind.get(x).map_or(self.g.zero(), |terms| self.g.sum(terms))).collect())
    }

    /// Whether anybody asks for multipliers of a solved constraint.
    fn has_reactions(&self) -> bool {
        match &self.system.constraint {
            KinematicConstraint::Solved(solved) => !solved.reactions.names.is_empty(),
            KinematicConstraint::Multipliers { .. } => true,
        }
    }

    /// `d^2 L / dy dy`, made once.
    pub(super) fn hessian(&mut self) -> Result<(), Error> {
        if !self.hessian.is_empty() {
            return Ok(());
        }
        self.hessian = self.hessian_of(self.system.lagrangian)?;
        Ok(())
    }

    /// `d^2 l / dy dy`.
    pub(super) fn hessian_of(&mut self, l: ExprId) -> Result<Vec<Vec<ExprId>>, Error> {
        let system = self.system;
        let mut hessian = Vec::with_capacity(system.velocities.len());
        for y in &system.velocities {
            let p = self.g.diff(l, *y);
            if p == self.g.zero() {
                hessian.push(vec![p; system.velocities.len()]);
                continue;
            }
            let row = system.velocities.iter().map(|s| self.g.diff(p, *s)).collect::<Vec<_>>();
            hessian.push(row.into_iter().map(|e| self.replace(e)).collect::<Result<Vec<_>, _>>()?);
        }
        Ok(hessian)
    }

    /// `weight v_alpha . (v lag + dv/dx xdot + omega x v)` of all squares, by `alpha`; with the accelerations `lag` of
    /// the velocities at `udot = 0`, or zero.
    fn inertia_forces(
        &mut self,
        squares: &[Square],
        accelerations: Option<&[ExprId]>,
    ) -> Result<Vec<ExprId>, Error> {
        self.writer.begin("velocities v in squares m/2 |v|^2");
        let mut velocities = Vec::new();
        for (k, square) in squares.iter().enumerate() {
            let mut v = Vec::new();
            for (i, component) in square.components.iter().enumerate() {
                let value = self.replace(component.value)?;
                v.push(self.define(&format!("v{}_{}", k + 1, i + 1), value));
            }
            velocities.push(v);
        }
        self.writer.begin(match accelerations {
            Some(_) => "accelerations of the velocities a = v lag + dv/dx xdot + omega x v at udot = 0",
            None => "accelerations of the velocities a = dv/dx xdot + omega x v at ydot = 0",
        });
        let mut forces = vec![Vec::new(); self.y.len()];
        for (k, (square, v)) in squares.iter().zip(velocities).enumerate() {
            let mut lag = Vec::with_capacity(v.len());
            for component in &square.components {
                let mut rate = self.drift(component.value)?;
                for (slope, known) in component.slopes.iter().zip(accelerations.unwrap_or_default()) {
                    let slope = self.replace(*slope)?;
                    let along = self.g.mul(slope, *known);
                    rate = self.g.add(rate, along);
                }
                lag.push(rate);
            }
            let mut frame = square.frame();
            for e in frame.iter_mut().flatten() {
                *e = self.replace(*e)?;
            }
            self.turned_by_noise(square, &v, &mut forces)?;
            let force = self.inertia_force(square, k, (&v, frame), &lag);
            for (component, force) in square.components.iter().zip(force) {
                for (terms, slope) in forces.iter_mut().zip(&component.slopes) {
                    let slope = self.replace(*slope)?;
                    terms.push(self.g.mul(slope, force));
                }
            }
        }
        Ok(forces.iter().map(|terms| self.g.sum(terms)).collect())
    }

    /// `weight v . dv_alpha/dx xi` of a square, by `alpha`, where noise moves base coordinates by `xi`: what the other
    /// terms of the equation leave of this along the velocity, they do not leave along the noise.
    fn turned_by_noise(
        &mut self,
        square: &Square,
        v: &[ExprId],
        forces: &mut [Vec<ExprId>],
    ) -> Result<(), Error> {
        let system = self.system;
        let momentum = square.momentum(&mut self.g, v);
        for (x, rate) in &system.noise_rates {
            let rate = self.replace(*rate)?;
            for (component, p) in square.components.iter().zip(&momentum) {
                for (terms, slope) in forces.iter_mut().zip(&component.slopes) {
                    let turning = self.g.diff(*slope, *x);
                    let turning = self.replace(turning)?;
                    terms.push(self.g.product(&[*p, turning, rate]));
                }
            }
        }
        Ok(())
    }

    /// `rho dL/dx + F + (N - C y) p - (dp/dx xdot + dp/dt)` along one section, of the part of the Lagrangian that `p`,
    /// `momentum` and `slopes` are derivatives of.
    fn drive_of(
        &mut self,
        alpha: usize,
        p: ExprId,
        momentum: &[ExprId],
        slopes: &[ExprId],
    ) -> Result<ExprId, Error> {
        let applied = self.applied_force(alpha, momentum, slopes)?;
        let drift = self.drift(p)?;
        Ok(self.g.sub(applied, drift))
    }

    /// `rho dL/dx + F + (N - C y) p` along one section.
    pub(super) fn applied_force(
        &mut self,
        alpha: usize,
        momentum: &[ExprId],
        slopes: &[ExprId],
    ) -> Result<ExprId, Error> {
        let system = self.system;
        let force = self.replace(system.forces[alpha])?;
        Ok(system.algebroid.net_force(&mut self.g, (alpha, force), &self.y, momentum, slopes))
    }

    /// `de/dx^i xdot^i + de/dt` at fixed velocities, for an expression in the raw velocity symbols.
    pub(super) fn drift(&mut self, e: ExprId) -> Result<ExprId, Error> {
        if self.way.recursion().is_some() {
            // In one pass over what the bodies share, and not from a slope for each coordinate.
            let base = self.system.algebroid.base().iter().copied().zip(self.rates.iter().copied());
            let moving = base.chain([(self.system.time, self.g.one())]);
            let moving = moving.filter(|(_, rate)| *rate != self.g.zero()).collect();
            let rate = self.g.derivative_along(e, &moving);
            return self.replace(rate);
        }
        let mut terms = Vec::new();
        for (i, x) in self.system.algebroid.base().iter().enumerate() {
            let slope = self.g.diff(e, *x);
            if slope == self.g.zero() || self.rates[i] == self.g.zero() {
                continue;
            }
            let slope = self.replace(slope)?;
            terms.push(self.g.mul(slope, self.rates[i]));
        }
        let explicit = self.g.diff(e, self.system.time);
        terms.push(self.replace(explicit)?);
        let sum = self.g.sum(&terms);
        Ok(self.g.cancel_zero(sum))
    }
}
