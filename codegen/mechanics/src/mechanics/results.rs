//! Everything that follows from the accelerations: energy and its rate, claims of the model, outputs, facts.
//!
//! Does not know: how the accelerations were found.

use std::collections::{BTreeMap, BTreeSet};

use crate::reduction::{AccelerationSource, KinematicConstraint, ReducedSystem, SolvedConstraint, StateKind};
use hamel_expr::error::Error;
use hamel_expr::{Definition, ExprId, Graph, Node, Rational, Style, SymbolId, Vanishing};
use hamel_lang::spec::{OutputPart, Want};

use super::derive::{Derivation, Motion};
use super::entropies::productions;
use super::equations::{Equations, Facts, Form, LinearSystem, Output, OutputKind, StateEquation, degree_in};
use super::solve::{Pivot, is_symmetric};
use super::{integrable, legendre, origin};

impl Derivation<'_> {
    /// `E = p.y - L`. For `L` quadratic in the velocities, `E = L - L_1 - 2 L_0` needs no products of momenta; where it
    /// is degenerate, `E = L_2 - L_0` does not bring in velocities that cancel.
    fn energy(&mut self) -> Result<ExprId, Error> {
        let system = self.system;
        if let Some(hamiltonian) = &system.hamiltonian {
            return Ok(hamiltonian.h);
        }
        let g = &mut self.g;
        let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
        let zeros: BTreeMap<SymbolId, ExprId> = velocities.iter().map(|s| (*s, g.zero())).collect();
        let raw: Vec<ExprId> = system.velocities.iter().map(|s| g.diff(system.lagrangian, *s)).collect();
        let mut quadratic = true;
        // Where the degree shows it, nothing is differentiated.
        let is_seen = degree_in(g, &velocities, system.lagrangian).is_some_and(|degree| degree <= 2);
        for p in raw.iter().filter(|_| !is_seen) {
            for s in &velocities {
                let h = g.diff(*p, *s);
                if !g.depends_on(h, &velocities) {
                    continue;
                }
                for r in &velocities {
                    let third = g.diff(h, *r);
                    quadratic &= g.is_zero(third);
                }
            }
        }
        let at_rest = g.subs(system.lagrangian, &zeros);
        let slopes_at_rest = g.subs_all(&raw, &zeros);
        if let (true, Some(_), Ok(at_rest)) = (quadratic, &system.degeneracy, &at_rest) {
            let half = Rational::new(1.into(), 2.into());
            let mut terms = vec![g.neg(*at_rest)];
            for (p, s) in raw.iter().zip(&system.velocities) {
                for r in &system.velocities {
                    let [a, b] = [s, r].map(|y| g.sym(*y));
                    let h = g.diff(*p, *r);
                    let h = g.cancel_zero(h);
                    let term = g.product(&[h, a, b]);
                    terms.push(g.scale(term, &half));
                }
            }
            return Ok(g.sum(&terms));
        }
        if let (true, Ok(at_rest), Ok(slopes)) = (quadratic, at_rest, slopes_at_rest) {
            let mut terms = vec![
                (system.lagrangian, Rational::from_integer(1.into())),
                (at_rest, Rational::from_integer((-2).into())),
            ];
            for (slope, s) in slopes.iter().zip(&system.velocities) {
                let y = g.sym(*s);
                terms.push((g.mul(*slope, y), Rational::from_integer((-1).into())));
            }
            return Ok(g.linear_combination(&terms));
        }
        let mut terms = vec![g.neg(system.lagrangian)];
        for (p, s) in raw.iter().zip(&system.velocities) {
            let y = g.sym(*s);
            terms.push(g.mul(*p, y));
        }
        Ok(g.sum(&terms))
    }

    /// Momenta along the velocities of the model, whatever the frame.
    fn momenta_of_model(&mut self) -> Vec<(String, ExprId)> {
        let named = |name: &String, p: &ExprId| (format!("p_{name}"), *p);
        let Some(frame) = &self.system.frame else {
            return self.names.iter().zip(&self.momentum).map(|(name, p)| named(name, p)).collect();
        };
        let momenta = match self.way.lifted() {
            Some(lifted) => self.momenta_over_lift(&lifted),
            None => frame.momenta(&mut self.g, &self.momentum),
        };
        frame.original.iter().zip(&momenta).map(|(u, p)| named(&u.name, p)).collect()
    }

    /// Momenta of the model that a state tells: where the rate of a function was subtracted from its Lagrangian, those
    /// along some velocities depend on a coordinate that no state has.
    fn momenta_by_state(&mut self) -> Result<Vec<(String, ExprId)>, Error> {
        let system = self.system;
        let momenta = self.momenta_of_model();
        let velocities: Vec<SymbolId> = match &system.frame {
            Some(frame) => frame.original.iter().map(|u| u.symbol).collect(),
            None => system.velocities.clone(),
        };
        let absent: BTreeSet<SymbolId> = system.momenta.iter().filter_map(|m| m.cyclic).collect();
        let mut told = Vec::new();
        for ((name, mut p), velocity) in momenta.into_iter().zip(velocities) {
            for (_, more) in system.gauge.iter().filter(|(y, _)| *y == velocity) {
                let more = self.replace(*more)?;
                p = self.g.add(p, more);
            }
            if !self.g.depends_on(p, &absent) {
                told.push((name, p));
            }
        }
        Ok(told)
    }

    /// Time derivative along the motion of an expression in coordinates, raw velocities, quasi-velocities and time:
    /// `de/dt + de/dx^i xdot^i + de/dy^alpha ydot^alpha + de/ds sdot`.
    ///
    /// Rates of large expressions are made part by part, in one pass, and not from a slope for each variable.
    pub(super) fn rate_of(&mut self, e: ExprId, motion: &Motion) -> Result<ExprId, Error> {
        let system = self.system;
        if self.way.recursion().is_some() || self.g.reachable(&[e]).len() > MAX_PARTS {
            let rates = self.rates_of_variables(motion);
            let rate = self.g.derivative_along(e, &rates);
            return self.replace(rate);
        }
        let frame = system.velocities.iter().copied().zip(motion.acceleration.iter().copied());
        let others = self.rates_beside_the_frame(motion);
        let mut terms = vec![self.drift(e)?];
        for (s, rate) in frame.chain(others) {
            let slope = self.g.diff(e, s);
            let slope = self.replace(slope)?;
            terms.push(self.g.mul(slope, rate));
        }
        for (momentum, rate) in system.momenta.iter().zip(&motion.momentum_rates) {
            if let Some(symbol) = momentum.symbol {
                let slope = self.g.diff(e, symbol);
                let slope = self.replace(slope)?;
                terms.push(self.g.mul(slope, *rate));
            }
        }
        let sum = self.g.sum(&terms);
        Ok(self.g.cancel_zero(sum))
    }

    /// Unknowns that are no velocities of the frame, with their rates: quasi-velocities, and the velocities of the
    /// model where the frame is an internal one.
    fn rates_beside_the_frame(&self, motion: &Motion) -> Vec<(SymbolId, ExprId)> {
        let unknowns = self.system.unknowns.iter().zip(&motion.unknown_rates);
        let others = unknowns.filter(|(u, _)| !self.system.velocities.contains(&u.symbol));
        others.map(|(u, rate)| (u.symbol, *rate)).collect()
    }

    /// What changes along the motion: time, coordinates, velocities, quasi-velocities and momenta, with their rates.
    fn rates_of_variables(&mut self, motion: &Motion) -> BTreeMap<SymbolId, ExprId> {
        let system = self.system;
        let mut rates = BTreeMap::from([(system.time, self.g.one())]);
        rates.extend(system.algebroid.base().iter().copied().zip(self.rates.iter().copied()));
        rates.extend(system.velocities.iter().copied().zip(motion.acceleration.iter().copied()));
        rates.extend(self.rates_beside_the_frame(motion));
        let momenta = system.momenta.iter().zip(motion.momentum_rates.iter().copied());
        rates.extend(momenta.filter_map(|(momentum, rate)| Some((momentum.symbol?, rate))));
        rates
    }

    /// Refuses a claim of conservation with what is known about the rate.
    fn require_conserved(&mut self, name: &str, rate: ExprId) -> Result<(), Error> {
        let verdict = self.g.vanishing(rate);
        let name = name.to_owned();
        match verdict {
            Vanishing::Zero => Ok(()),
            Vanishing::NonZero => Err(Error::NotConserved { name, rate: self.spelled_out(rate) }),
            Vanishing::Unknown => Err(Error::ConservationUnverified { name, rate: self.spelled_out(rate) }),
        }
    }

    /// An expression for people, in as few names of definitions as there is room for.
    pub(super) fn spelled_out(&mut self, e: ExprId) -> String {
        let definitions: Vec<Definition> = self.writer.definitions().copied().collect();
        let (mut e, mut text) = (e, self.g.display(e, Style::Plain));
        for Definition { symbol, expr } in definitions.into_iter().rev() {
            // A name alone says nothing, whatever its value looks like.
            let is_alone = *self.g.node(e) == Node::Symbol(symbol);
            let Ok(expanded) = self.g.subs(e, &BTreeMap::from([(symbol, expr)])) else { continue };
            if expanded == e {
                continue;
            }
            let spelled = self.g.display(expanded, Style::Plain);
            if is_alone || spelled.len() <= MAX_SPELLED {
                (e, text) = (expanded, spelled);
            }
        }
        shortened(&text)
    }

    /// The nonholonomic momenta along the sections `W_b` of virtual displacements and the momentum equation
    /// `d/dt <p, W_b> = W^alpha_b (rho^i_alpha dL/dx^i + F_alpha + (N^gamma_alpha - C^gamma_{alpha beta} y^beta) p_gamma) + <p, dW_b/dt>`.
    ///
    /// # Source
    /// Cortes, de Leon, Marrero, Martinez 2009, equation (5.6); Bloch, Krishnaprasad, Marsden, Murray 1996.
    fn momentum_equation(&mut self, solved: &SolvedConstraint) -> Result<Vec<Output>, Error> {
        let depends_on_velocity = |g: &Graph, system: &ReducedSystem, e: ExprId| {
            let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
            g.depends_on(e, &velocities)
        };
        let system = self.system;
        if solved.virtual_displacements.iter().flatten().any(|e| depends_on_velocity(&self.g, system, *e)) {
            return Ok(Vec::new());
        }
        let (mut momenta, mut rates) = (Vec::new(), Vec::new());
        for (b, unknown) in solved.unknowns.iter().enumerate() {
            let section: Vec<ExprId> = solved.virtual_displacements.iter().map(|row| row[b]).collect();
            let (momentum, rate) = self.momentum_and_rate(&section)?;
            momenta.push((format!("J_{}", unknown.name), momentum));
            rates.push((format!("dot_J_{}", unknown.name), rate));
        }
        Ok(vec![
            Output::group(
                Want::NonholonomicMomentum,
                momenta,
                "momenta <p, W_b> along the sections of virtual displacements",
            ),
            Output::group(Want::MomentumEquation, rates, "their rates by the nonholonomic momentum equation"),
        ])
    }

    /// `<p, s>` of a section of virtual displacements, and its rate without accelerations,
    /// `s^a (rho^i_a dL/dx^i + F_a + (N^c_a - C^c_ab y^b) p_c) + <p, ds/dt>`.
    pub(super) fn momentum_and_rate(&mut self, section: &[ExprId]) -> Result<(ExprId, ExprId), Error> {
        let system = self.system;
        let (mut momentum, mut rate) = (Vec::new(), Vec::new());
        for (alpha, &s) in section.iter().enumerate() {
            if s == self.g.zero() {
                continue;
            }
            momentum.push(self.g.mul(s, self.momentum[alpha]));
            // drive = forces - dp/dx xdot - dp/dt; the momentum equation wants the forces alone.
            let p = self.g.diff(system.lagrangian, system.velocities[alpha]);
            let drift = self.drift(p)?;
            let force = self.g.add(self.forces.drive[alpha], drift);
            rate.push(self.g.mul(s, force));
            let turning = self.drift(s)?;
            rate.push(self.g.mul(turning, self.momentum[alpha]));
        }
        let (momentum, rate) = (self.g.sum(&momentum), self.g.sum(&rate));
        Ok((self.g.cancel_zero(momentum), self.g.cancel_zero(rate)))
    }

    /// Power of forces, explicit time, states of first order, the drift of the frame and constraint reactions:
    /// `F.y - dL/dt - dL/dz zdot + N^gamma_alpha y^alpha p_gamma + sum_A lambda_A form_A.y`.
    fn power(&mut self, motion: &Motion) -> Result<ExprId, Error> {
        let system = self.system;
        let of_rates = |(x, rate): (&SymbolId, &ExprId)| {
            system.own_rates.iter().any(|own| own.symbol == *x).then_some((*x, *rate))
        };
        let mut moving: Vec<(SymbolId, ExprId)> =
            system.algebroid.base().iter().zip(&self.rates).filter_map(of_rates).collect();
        moving.push((system.time, self.g.one()));
        for (symbol, rate) in &system.noise_rates {
            moving.push((*symbol, self.replace(*rate)?));
        }
        let mut terms = Vec::new();
        for (symbol, rate) in moving {
            let slope = match &system.hamiltonian {
                Some(hamiltonian) => self.g.diff(hamiltonian.h, symbol),
                None => {
                    let slope = self.g.diff(system.lagrangian, symbol);
                    self.g.neg(slope)
                }
            };
            let slope = self.replace(slope)?;
            terms.push(self.g.mul(slope, rate));
        }
        for (force, y) in self.system.forces.iter().zip(self.y.clone()) {
            let force = self.replace(*force)?;
            terms.push(self.g.mul(force, y));
        }
        for alpha in 0..self.y.len() {
            for (gamma, n) in self.system.algebroid.drift(alpha) {
                terms.push(self.g.product(&[*n, self.y[alpha], self.momentum[*gamma]]));
            }
        }
        for (form, (_, lambda)) in motion.reactions.iter().zip(&motion.multipliers) {
            let mut work = Vec::new();
            for (coefficient, y) in form.iter().zip(self.y.clone()) {
                let coefficient = self.replace(*coefficient)?;
                work.push(self.g.mul(coefficient, y));
            }
            let work = self.g.sum(&work);
            let work = self.g.cancel_zero(work);
            terms.push(self.g.mul(*lambda, work));
        }
        Ok(self.g.sum(&terms))
    }

    /// Whether the energy rate is `sum_A lambda_A k_A phi_A` with integers `k_A`, hence zero once the constraint holds:
    /// `form_A.y = k_A phi_A` for a constraint that is homogeneous of degree `k_A` in the velocities.
    fn vanishes_with(&mut self, rate: ExprId, motion: &Motion, residuals: &[(String, ExprId)]) -> bool {
        if residuals.len() != motion.multipliers.len() {
            return false;
        }
        let mut products = Vec::new();
        for (((_, residual), (_, lambda)), form) in
            residuals.iter().zip(&motion.multipliers).zip(&motion.reactions)
        {
            let work = self.g.dot(form, &self.y);
            let homogeneous = (1..=8).any(|degree| {
                let multiple = self.g.scale(*residual, &Rational::from_integer(degree.into()));
                self.g.is_equal(work, multiple)
            });
            if !homogeneous {
                return false;
            }
            products.push(self.g.mul(*lambda, work));
        }
        let sum = self.g.sum(&products);
        self.g.is_equal(rate, sum)
    }

    pub(super) fn finish(&mut self, motion: Motion) -> Result<Equations, Error> {
        let system = self.system;
        let is_whole = self.is_whole();
        let has_energy = system.accelerations.is_none() && is_whole;
        let mut facts = Facts { bracket_is_almost: system.algebroid.is_almost(), ..Facts::default() };
        let (mut energy, mut energy_rate) = (self.g.zero(), self.g.zero());
        if is_whole {
            let raw_energy = self.energy()?;
            energy_rate = self.rate_of(raw_energy, &motion)?;
            energy = self.replace(raw_energy)?;
            facts.energy_is_conserved = has_energy && energy_rate == self.g.zero();
            facts.energy_is_unverified = self.g.vanishing(energy_rate) == Vanishing::Unknown;
        }
        if let Some(LinearSystem { mass_matrix, .. }) = &motion.system {
            facts.mass_matrix_is_symmetric = is_symmetric(&mut self.g, mass_matrix);
            facts.mass_matrix_is_constant =
                mass_matrix.iter().flatten().all(|e| !self.writer.varies(&self.g, *e));
        }
        let mut outputs = Vec::new();
        if has_energy {
            let momenta = self.momenta_by_state()?;
            outputs.push(Output::group(Want::Momentum, momenta, "momenta p = dL/dy"));
        }
        if !motion.multipliers.is_empty() {
            let doc = "multipliers lambda_A of E = lambda_A a_A, the constraint forces along the constraint one-forms";
            outputs.push(Output::group(Want::Multipliers, motion.multipliers.clone(), doc));
        }
        if has_energy {
            let power = self.power(&motion)?;
            if self.g.is_equal(energy_rate, power) {
                energy_rate = power;
            }
        }
        let mut kept: Vec<(String, ExprId)> = Vec::new();
        if let KinematicConstraint::Multipliers { rows, .. } = &system.constraint {
            let residuals = rows.iter().filter_map(|row| match row.source {
                AccelerationSource::Differentiated(residual) => {
                    Some((format!("residual_{}", row.name), residual))
                }
                AccelerationSource::Servo(_) => None,
            });
            let mut components: Vec<(String, ExprId)> = residuals.collect();
            if !system.momenta.is_empty() {
                for (_, residual) in &mut components {
                    *residual = self.replace(*residual)?;
                }
            }
            facts.energy_is_conserved_on_constraint =
                !facts.energy_is_conserved && self.vanishes_with(energy_rate, &motion, &components);
            kept = components;
        }
        kept.extend(system.positions.iter().map(|p| (p.name.clone(), p.residual)));
        if !kept.is_empty() {
            let doc = "residual of the constraints, zero along the motion";
            outputs.push(Output::group(Want::Constraint, kept, doc));
        }
        let positions = system.degeneracy.iter().flat_map(|found| found.positions.clone());
        let positions: Vec<(String, ExprId)> = positions.collect();
        if !positions.is_empty() {
            let doc = "residual of the conditions on positions that follow from a degenerate Lagrangian";
            outputs.push(Output::group(Want::Constraint, positions, doc));
        }
        let is_derived = system.hamiltonian.is_none() && system.accelerations.is_none();
        if is_whole && system.degeneracy.is_none() && is_derived {
            facts.holonomic = integrable::is_holonomic(&mut self.g, system);
        }
        if let KinematicConstraint::Solved(solved) = &system.constraint
            && is_whole
            && !solved.rows.is_empty()
            && system.degeneracy.is_none()
            && system.hamiltonian.is_none()
        {
            outputs.extend(self.momentum_equation(solved)?);
        }
        facts.entropies = productions(system);
        facts.decrease = system.feedback.as_ref().map(|own| self.decrease(own));
        // Claims that do not hold at every state, each with its error unless it holds on the constraint.
        let mut claims = Vec::new();
        if !system.casimirs.is_empty() {
            let mut components = Vec::new();
            for casimir in &system.casimirs {
                let rate = self.rate_of(casimir.expr, &motion)?;
                match self.require_conserved(&casimir.name, rate) {
                    Ok(()) => facts.casimirs.push(casimir.name.clone()),
                    Err(error) => claims.push((casimir.name.clone(), rate, error)),
                }
                let value = self.replace(casimir.expr)?;
                components.push((casimir.name.clone(), value));
            }
            outputs.push(Output::group(Want::Casimirs, components, "conserved quantities"));
        }
        let mut solved: BTreeMap<SymbolId, ExprId> = motion.after.iter().copied().collect();
        for (name, symbol) in &system.multipliers {
            let label = format!("lambda_{name}");
            let own = motion.multipliers.iter().find(|(own, _)| *own == label);
            solved.extend(own.map(|(_, lambda)| (*symbol, *lambda)));
        }
        solved.extend(system.feedback.iter().zip(self.response).map(|(own, value)| (own.response, value)));
        for output in &system.outputs {
            let kind = match output.part {
                OutputPart::Own => OutputKind::OfModel,
                OutputPart::Events => OutputKind::Group(Want::Events),
                OutputPart::After => OutputKind::After,
                OutputPart::Poses => OutputKind::Group(Want::FramePoses),
                OutputPart::Twists => OutputKind::Group(Want::FrameTwists),
                OutputPart::CenterOfMass => OutputKind::Group(Want::CenterOfMass),
                OutputPart::CentroidalMomentum => OutputKind::Group(Want::CentroidalMomentum),
                OutputPart::Bodies => continue,
            };
            let mut components = Vec::new();
            for (name, e) in &output.components {
                let place = || Error::DivisionByZero { place: format!("output `{}`", output.name) };
                let e = self.g.subs(*e, &solved).map_err(|_| place())?;
                components.push((name.clone(), self.replace(e)?));
            }
            outputs.push(Output { kind, name: output.name.clone(), components, doc: output.doc.clone() });
        }
        let (along_sections, momenta_along) = self.along_sections(&motion)?;
        outputs.extend(momenta_along);
        let mut state = Vec::new();
        for (kind, doc) in &system.state {
            let symbol = system.state_symbol(*kind);
            let derivative = match *kind {
                StateKind::Base(i) => self.rates[i],
                StateKind::Unknown(a) => motion.unknown_rates[a],
                StateKind::Momentum { place, .. } => motion.momentum_rates[place],
            };
            let name = self.g.name(symbol).to_owned();
            let is_mode = system.own_rates.iter().any(|own| own.symbol == symbol && own.is_mode);
            if derivative == self.g.zero() && !is_mode {
                facts.constants.push(name.clone());
            }
            state.push(StateEquation { symbol, name, doc: doc.clone(), derivative });
        }
        let mut reconstruction = Vec::new();
        for coordinate in &system.reconstruction {
            let derivative = self.replace(coordinate.rate)?;
            let (symbol, name, doc) = (coordinate.symbol, coordinate.name.clone(), coordinate.doc.clone());
            reconstruction.push(StateEquation { symbol, name, doc, derivative });
        }
        let (legendre, velocities) = self.conversions()?;
        let carries_velocities = |kind: &StateKind| matches!(kind, StateKind::Unknown(_));
        let form = match motion.system.clone() {
            Some(linear)
                if system.state.iter().any(|(kind, _)| carries_velocities(kind))
                    || system.momenta.is_empty() =>
            {
                Form::Accelerations(linear)
            }
            _ if !is_whole => {
                Form::Rates { unknowns: system.unknowns.iter().map(|u| u.name.clone()).collect() }
            }
            _ if !has_energy => Form::Given,
            _ => Form::Momenta,
        };
        outputs.extend(velocities);
        let circles = self.circles(&motion, &mut facts)?;
        let of_frame = system.pivots.iter().map(|(name, expr)| Pivot::of_coefficients(name, *expr));
        let pivots: Vec<Pivot> = motion.pivots.into_iter().chain(of_frame).collect();
        let pivots = pivots.into_iter().filter(|p| self.g.as_rational(p.expr).is_none()).collect();
        let system = self.system_with_response()?;
        let (sections, varying) = std::mem::take(&mut self.writer).finish();
        let mut equations = Equations {
            system,
            sections,
            velocities: std::mem::take(&mut self.y),
            state,
            reconstruction,
            taken_at: BTreeMap::new(),
            form,
            energy,
            energy_rate,
            legendre,
            outputs,
            along_sections,
            pivots,
            facts,
            varying,
        };
        let is_kept = matches!(equations.system.constraint, KinematicConstraint::Multipliers { .. });
        for (name, rate, error) in claims {
            if !is_kept || !equations.vanishes_on_constraint(rate) {
                return Err(error);
            }
            equations.facts.casimirs_on_constraint.push(name);
        }
        origin::evaluate_at_origin(&mut equations);
        legendre::check_cyclic(&equations)?;
        // Equal to one on the circle, hence not to be evaluated at the origin.
        equations.outputs.extend(circles);
        Ok(equations)
    }

    /// `c^2 + s^2` of every angle that is carried as a point of the circle: conserved, on the circle and off it.
    fn circles(&mut self, motion: &Motion, facts: &mut Facts) -> Result<Option<Output>, Error> {
        let mut components = Vec::new();
        for circle in &self.system.circles {
            let squares = [circle.cosine, circle.sine].map(|s| {
                let x = self.g.sym(s);
                self.g.powi(x, 2)
            });
            let square = self.g.sum(&squares);
            let name = format!("{}_circle", circle.angle);
            let rate = self.rate_of(square, motion)?;
            self.require_conserved(&name, rate)?;
            facts.casimirs.push(name.clone());
            components.push((name, square));
        }
        let doc = "c^2 + s^2 of the angles carried as points (c, s) of the circle, 1 along the motion";
        Ok((!components.is_empty()).then(|| Output::group(Want::Circles, components, doc)))
    }
}

/// Parts of an expression up to which its rate is written by slopes: those of a page.
const MAX_PARTS: usize = 2000;
/// Characters of a rate that are shown.
const MAX_SHOWN: usize = 120;
/// Characters up to which a rate is written without the names of definitions before it is cut.
const MAX_SPELLED: usize = 2000;

/// Long rates say no more than their beginning.
fn shortened(text: &str) -> String {
    match text.char_indices().nth(MAX_SHOWN) {
        Some((at, _)) => format!("{} ..", &text[..at]),
        None => text.to_owned(),
    }
}
