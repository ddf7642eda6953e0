//! The implicit form of the equations of motion: `M z' = f(t, z)` with a constant diagonal `M` of ones and zeros.
//!
//! The variables `z` are the coordinates `x`, all velocities `y` and what changes by a differential equation besides:
//!
//! ```text
//! constraint solved      z = (x, y, pi)          x' = rho y
//!                                                pi_b' = W^a_b (net force)_a + (dW^a_b/dt) p_a,  p = dL/dy
//!                                                0 = pi_b - W^a_b p_a
//!                                                0 = phi_A(t, x, y)
//! kept by multipliers    z = (x, y, a, lambda)   x' = rho y,  y' = a
//!                                                0 = r + Lambda^T lambda - L_yy a
//!                                                0 = w a + w_0
//! Hamiltonian            z = (x, p, lambda)      x' = rho dh/dp,  p' = (net force) + Lambda^T lambda
//!                                                0 = w d/dt(dh/dp) + w_0
//! ```
//!
//! The first is the Pontryagin form on `D + D*`: the momentum equation is paired with virtual displacements, which
//! eliminates `lambda`. Its rows `phi_A` are the constraints and, of a degenerate Lagrangian, the equations without
//! accelerations. `A = W^T L_yy Psi` is regular, hence so is the derivative of the algebraic equations by `y`, and the
//! index is one. Where virtual displacements depend on velocities, so that `dW/dt` contains accelerations, these are
//! variables as with multipliers, and the equations are paired with `W`.
//!
//! Does not know: how explicit equations were solved, programs.
//!
//! # Source
//! Yoshimura, Marsden 2006 (Dirac structures in Lagrangian mechanics I, II); Gay-Balmaz, Yoshimura 2015.

use std::collections::{BTreeMap, BTreeSet};

use crate::reduction::{
    AccelerationRow, AccelerationSource, Hamiltonian, KinematicConstraint, ReducedSystem, SolvedConstraint,
};
use hamel_expr::differentiate::Linearisation;
use hamel_expr::error::Error;
use hamel_expr::{
    Definition, ExprId, Graph, Section, SectionWriter, Style, SymbolId, Vanishing, inlined, needed_sections,
};
use hamel_lang::spec::Want;

use super::equations::{Equations, OutputKind, StateEquation};
use super::rates::rates;

/// The implicit form of a system.
#[derive(Clone, Debug)]
pub struct ImplicitForm {
    /// The variables in order, each with the row of the equations that has its place.
    pub variables: Vec<ImplicitVariable>,
    /// The definitions that the rows mention.
    pub sections: Vec<Section>,
    /// The differential index: how often equations have to be differentiated to give all rates. One where there are
    /// algebraic equations, zero otherwise.
    pub index: usize,
    /// The index of the equations in `(x, y, p, lambda)` with all momenta and multipliers, of which this form is a
    /// reduction.
    pub pontryagin_index: usize,
}

/// A variable `z_k` of the implicit form and the row `M_k z_k' = f_k`.
#[derive(Clone, Debug)]
pub struct ImplicitVariable {
    /// Its name.
    pub name: String,
    /// What it is.
    pub doc: String,
    /// Its symbol, which is no symbol of the state.
    pub symbol: SymbolId,
    /// Whether `M_k` is one; the row is an algebraic equation otherwise.
    pub is_differential: bool,
    /// `f_k`, by variables, parameters, time and definitions.
    pub right: ExprId,
    /// Its value by the state, with which all rows hold along the motion.
    pub value: ExprId,
    /// The place of the component of the state that it is.
    pub state: Option<usize>,
}

/// The implicit form of the equations of a scene that carries `state`, proved to hold along their motion.
///
/// # Errors
/// [`Error::Unsupported`] for what has none, [`Error::Unverified`] where the motion is not seen to satisfy a row.
pub fn implicit_form(
    g: &mut Graph,
    equations: &Equations,
    state: &[StateEquation],
) -> Result<ImplicitForm, Error> {
    let system = &equations.system;
    let mut form = Form {
        system,
        equations,
        state,
        y: system.velocities.iter().map(|s| g.sym(*s)).collect(),
        rates: Vec::new(),
        writer: SectionWriter::new(g, BTreeSet::new(), &[]),
        drafts: Vec::new(),
        algebraic: Vec::new(),
        g,
    };
    match (&system.hamiltonian, &system.constraint) {
        (Some(hamiltonian), _) => form.on_dual(hamiltonian)?,
        (None, KinematicConstraint::Solved(solved)) => match form.is_turned_by_velocities(solved) {
            false => form.with_momenta(solved)?,
            true => form.paired_with_accelerations(solved)?,
        },
        (None, KinematicConstraint::Multipliers { rows, reactions }) => {
            form.with_multipliers(rows, reactions)?
        }
    }
    form.g.within_budget()?;
    let form = form.finish()?;
    g.within_budget()?;
    Ok(form)
}

/// A variable and its row in the symbols of the system.
struct Draft {
    name: String,
    doc: String,
    symbol: SymbolId,
    value: ExprId,
    /// The right-hand side of its differential equation.
    rate: Option<ExprId>,
    state: Option<usize>,
}

struct Form<'a> {
    g: &'a mut Graph,
    system: &'a ReducedSystem,
    equations: &'a Equations,
    state: &'a [StateEquation],
    /// All velocities as variables; `dh/dp` of a Hamiltonian.
    y: Vec<ExprId>,
    /// `xdot`.
    rates: Vec<ExprId>,
    writer: SectionWriter,
    drafts: Vec<Draft>,
    /// What vanishes.
    algebraic: Vec<ExprId>,
}

impl Form<'_> {
    fn define(&mut self, name: &str, e: ExprId) -> ExprId {
        self.writer.define(self.g, name, e)
    }

    /// A name that no other variable and no component of the state has.
    fn unused(&self, name: String) -> String {
        let mut name = name;
        while self.drafts.iter().any(|d| d.name == name) || self.state.iter().any(|s| s.name == name) {
            name.push('_');
        }
        name
    }

    /// A variable that is a component of the state.
    fn carried(&mut self, place: usize, rate: Option<ExprId>) {
        let StateEquation { symbol, name, doc, .. } = &self.state[place];
        let (symbol, name, doc) = (*symbol, name.clone(), doc.clone());
        let value = self.g.sym(symbol);
        self.drafts.push(Draft { name, doc, symbol, value, rate, state: Some(place) });
    }

    fn place_of(&self, symbol: SymbolId) -> Option<usize> {
        self.state.iter().position(|s| s.symbol == symbol)
    }

    /// The coordinates that the state carries, with `xdot = rho y`, and those of the group.
    fn coordinates(&mut self) {
        let system = self.system;
        self.writer.begin("kinematics xdot = rho y");
        let along_y = system.velocities.iter().copied().zip(self.y.iter().copied()).collect();
        for (i, (x, own)) in system.algebroid.base().iter().zip(system.own_rates_of_base()).enumerate() {
            let anchors = (0..self.y.len()).map(|a| system.algebroid.anchor(i, a)).collect::<Vec<_>>();
            let own = self.g.subs(own, &along_y).unwrap_or(own);
            let moved = self.g.dot(&anchors, &self.y);
            let sum = self.g.add(moved, own);
            let rate = self.define(&format!("dot_{}", self.g.name(*x)), sum);
            self.rates.push(rate);
        }
        for (i, x) in system.algebroid.base().iter().enumerate() {
            if let Some(place) = self.place_of(*x) {
                self.carried(place, Some(self.rates[i]));
            }
        }
        for coordinate in &system.reconstruction {
            if let Some(place) = self.place_of(coordinate.symbol) {
                self.carried(place, Some(coordinate.rate));
            }
        }
    }

    /// All velocities, by their places in the frame, with the given rates.
    fn velocities(&mut self, rates: Option<&[ExprId]>) {
        let system = self.system;
        for (alpha, symbol) in system.velocities.iter().enumerate() {
            let rate = rates.map(|rates| rates[alpha]);
            if let Some(place) = self.place_of(*symbol) {
                self.carried(place, rate);
                continue;
            }
            let name = self.unused(system.algebroid.frame()[alpha].clone());
            let doc = "Velocity that is no part of the state.".to_owned();
            let value = self.equations.velocities[alpha];
            self.drafts.push(Draft { name, doc, symbol: *symbol, value, rate, state: None });
        }
    }

    /// `rho dL/dx` and `p = dL/dy` by the variables.
    fn slopes_and_momenta(&mut self) -> (Vec<ExprId>, Vec<ExprId>) {
        let system = self.system;
        self.writer.begin("momenta p = dL/dy");
        let mut momenta = Vec::new();
        for (symbol, name) in system.velocities.iter().zip(system.algebroid.frame()) {
            let p = self.g.diff(system.lagrangian, *symbol);
            momenta.push(self.define(&format!("L_{name}"), p));
        }
        self.writer.begin("slopes dL/dx");
        let mut slopes = Vec::new();
        for x in system.algebroid.base() {
            let slope = self.g.diff(system.lagrangian, *x);
            let name = format!("dL_d{}", self.g.name(*x));
            slopes.push(self.define(&name, slope));
        }
        (slopes, momenta)
    }

    /// `rho dL/dx + F + (N - C y) p` along every section.
    fn net_forces(&mut self, momenta: &[ExprId], slopes: &[ExprId]) -> Vec<ExprId> {
        let system = self.system;
        self.writer.begin("net force rho dL/dx + F + (N - C y) p");
        let mut net = Vec::new();
        for (alpha, force) in system.forces.iter().enumerate() {
            let value = system.algebroid.net_force(self.g, (alpha, *force), &self.y, momenta, slopes);
            net.push(self.define(&format!("n_{}", system.algebroid.frame()[alpha]), value));
        }
        net
    }

    /// `de/dx xdot + de/dt` at fixed velocities.
    fn drift(&mut self, e: ExprId) -> ExprId {
        let mut terms = vec![self.g.diff(e, self.system.time)];
        for (x, rate) in self.system.algebroid.base().iter().zip(&self.rates) {
            let slope = self.g.diff(e, *x);
            terms.push(self.g.mul(slope, *rate));
        }
        self.g.sum(&terms)
    }

    /// Whether virtual displacements depend on velocities.
    fn is_turned_by_velocities(&self, solved: &SolvedConstraint) -> bool {
        let velocities: BTreeSet<SymbolId> = self.system.velocities.iter().copied().collect();
        solved.virtual_displacements.iter().flatten().any(|e| self.g.depends_on(*e, &velocities))
    }

    /// What vanishes by the constraint: its rows where they are independent, and the solved form otherwise.
    fn constraint_rows(&mut self, solved: &SolvedConstraint) -> Vec<ExprId> {
        let is_whole = solved.unknowns.iter().all(|u| u.frame_idx.is_some());
        if is_whole && solved.rows.len() == solved.dependent.len() {
            let rows = solved.rows.iter().map(|row| {
                let sum = self.g.dot(&row.one_form, &self.y);
                self.g.add(sum, row.offset)
            });
            return rows.collect();
        }
        let mut rows = Vec::new();
        for &alpha in &solved.dependent {
            let value = solved.velocity(self.g, alpha);
            rows.push(self.g.sub(self.y[alpha], value));
        }
        rows
    }

    /// `z = (x, y, pi)`.
    fn with_momenta(&mut self, solved: &SolvedConstraint) -> Result<(), Error> {
        let system = self.system;
        self.coordinates();
        self.velocities(None);
        for unknown in solved.unknowns.iter().filter(|u| u.frame_idx.is_none()) {
            let place = self.place_of(unknown.symbol).ok_or_else(|| Error::Unsupported {
                what: format!("the implicit form without the velocity {}", unknown.name),
                possible: "velocities as state; remove `carry`".into(),
            })?;
            self.carried(place, None);
        }
        let (slopes, momenta) = self.slopes_and_momenta();
        let net = self.net_forces(&momenta, &slopes);
        // Momenta by the state, for the values.
        let known: BTreeMap<SymbolId, ExprId> =
            system.velocities.iter().copied().zip(self.equations.velocities.iter().copied()).collect();
        self.writer.begin("rates of the momenta pi_b = W^a_b p_a");
        for (b, unknown) in solved.unknowns.iter().enumerate() {
            let column: Vec<ExprId> = solved.virtual_displacements.iter().map(|row| row[b]).collect();
            let along = self.g.dot(&column, &momenta);
            let held = system.momenta.iter().find(|m| system.unknowns[m.unknown].symbol == unknown.symbol);
            let mut terms = vec![self.g.dot(&column, &net)];
            for (w, p) in column.iter().zip(&momenta) {
                let turning = self.drift(*w);
                terms.push(self.g.mul(turning, *p));
            }
            let momentum = match held {
                // A parameter is the momentum, which nothing changes.
                Some(carried) if carried.symbol.is_none() => carried.value,
                _ => {
                    let sum = self.g.sum(&terms);
                    let rate = self.define(&format!("dot_p_{}", unknown.name), sum);
                    let place = held.and_then(|carried| carried.symbol).and_then(|s| self.place_of(s));
                    match place {
                        Some(place) => self.carried(place, Some(rate)),
                        None => {
                            let raw: Vec<ExprId> = system
                                .velocities
                                .iter()
                                .map(|s| self.g.diff(system.lagrangian, *s))
                                .collect();
                            let raw = self.g.dot(&column, &raw);
                            let value = self.g.subs(raw, &known).map_err(|_| undefined())?;
                            let name = self.unused(format!("p_{}", unknown.name));
                            let symbol = self.g.symbol(&name);
                            let doc = format!("Momentum along {}.", unknown.name);
                            self.drafts.push(Draft {
                                name,
                                doc,
                                symbol,
                                value,
                                rate: Some(rate),
                                state: None,
                            });
                        }
                    }
                    let last = self.drafts.last().map(|d| d.symbol);
                    last.map_or(self.g.zero(), |s| self.g.sym(s))
                }
            };
            let row = self.g.sub(momentum, along);
            self.algebraic.push(row);
        }
        let rows = self.constraint_rows(solved);
        self.algebraic.extend(rows);
        Ok(())
    }

    /// Accelerations as variables, with their values, after the velocities whose rates they are.
    fn accelerations(&mut self) -> Result<Vec<ExprId>, Error> {
        let system = self.system;
        if !system.momenta.is_empty() {
            return Err(Error::Unsupported {
                what: "the implicit form with multipliers and momenta".into(),
                possible: "velocities as state; remove `carry`".into(),
            });
        }
        let names: Vec<String> =
            system.algebroid.frame().iter().map(|n| self.unused(format!("a_{n}"))).collect();
        let symbols: Vec<SymbolId> = names.iter().map(|name| self.g.symbol(name)).collect();
        let accelerations: Vec<ExprId> = symbols.iter().map(|s| self.g.sym(*s)).collect();
        self.coordinates();
        self.velocities(Some(&accelerations));
        for (alpha, (name, symbol)) in names.into_iter().zip(symbols).enumerate() {
            let (value, doc) =
                (self.rate_of_velocity(alpha), format!("Rate of {}.", system.algebroid.frame()[alpha]));
            self.drafts.push(Draft { name, doc, symbol, value, rate: None, state: None });
        }
        Ok(accelerations)
    }

    /// `ydot` by the state, along the motion.
    fn rate_of_velocity(&mut self, alpha: usize) -> ExprId {
        let system = self.system;
        match self.place_of(system.velocities[alpha]) {
            Some(place) => self.state[place].derivative,
            None => rates(self.g, self.equations, self.state, &[self.equations.velocities[alpha]])[0],
        }
    }

    /// `rho dL/dx + F + (N - C y) p - dp/dx xdot - dp/dt - L_yy a` along every section.
    fn residuals(&mut self, accelerations: &[ExprId]) -> Vec<ExprId> {
        let system = self.system;
        let (slopes, momenta) = self.slopes_and_momenta();
        let net = self.net_forces(&momenta, &slopes);
        let mut residuals = Vec::new();
        for (alpha, net) in net.into_iter().enumerate() {
            let p = self.g.diff(system.lagrangian, system.velocities[alpha]);
            let drift = self.drift(p);
            let row: Vec<ExprId> = system.velocities.iter().map(|s| self.g.diff(p, *s)).collect();
            let inertia = self.g.dot(&row, accelerations);
            let lost = self.g.add(drift, inertia);
            residuals.push(self.g.sub(net, lost));
        }
        residuals
    }

    /// `z = (x, y, a)`, the equations paired with `W`.
    fn paired_with_accelerations(&mut self, solved: &SolvedConstraint) -> Result<(), Error> {
        if let Some(quasi) = solved.unknowns.iter().find(|u| u.frame_idx.is_none()) {
            return Err(Error::Unsupported {
                what: format!(
                    "the implicit form with the velocity {} and virtual displacements that depend on velocities",
                    quasi.name
                ),
                possible: "independent velocities of the frame".into(),
            });
        }
        let accelerations = self.accelerations()?;
        let residuals = self.residuals(&accelerations);
        for b in 0..solved.unknowns.len() {
            let column: Vec<ExprId> = solved.virtual_displacements.iter().map(|row| row[b]).collect();
            let row = self.g.dot(&column, &residuals);
            self.algebraic.push(row);
        }
        for row in self.constraint_rows(solved) {
            let velocities = self.system.velocities.iter();
            let slopes: Vec<ExprId> = velocities.map(|s| self.g.diff(row, *s)).collect();
            let along = self.g.dot(&slopes, &accelerations);
            let drift = self.drift(row);
            let rate = self.g.add(along, drift);
            self.algebraic.push(rate);
        }
        Ok(())
    }

    /// The multipliers as variables, with their values.
    fn multipliers(&mut self, rows: &[AccelerationRow]) -> Vec<ExprId> {
        let outputs = self.equations.outputs.iter();
        let known = outputs.filter(|o| o.kind == OutputKind::Group(Want::Multipliers));
        let known: Vec<(String, ExprId)> = known.flat_map(|o| o.components.clone()).collect();
        let mut multipliers = Vec::new();
        for (row, (name, value)) in rows.iter().zip(known) {
            let name = self.unused(name);
            let symbol = self.g.symbol(&name);
            let doc = format!("Multiplier of {}.", row.text);
            self.drafts.push(Draft { name, doc, symbol, value, rate: None, state: None });
            multipliers.push(self.g.sym(symbol));
        }
        multipliers
    }

    /// `w0` of a condition on accelerations.
    fn remainder(&mut self, row: &AccelerationRow) -> ExprId {
        match row.source {
            AccelerationSource::Differentiated(residual) => self.drift(residual),
            AccelerationSource::Servo(remainder) => remainder,
        }
    }

    /// The rates of accelerations along constraints of third order, by accelerations and what else stands for symbols.
    fn carried_accelerations(
        &mut self,
        accelerations: &[ExprId],
        known: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<(), Error> {
        let higher = &self.system.higher;
        let mut values = known.clone();
        values.extend(higher.accelerations.iter().copied().zip(accelerations.iter().copied()));
        for carried in &higher.carried {
            let rate = self.g.subs(carried.rate, &values);
            let rate = rate.map_err(|_| Error::DivisionByZero { place: "the implicit form".into() })?;
            self.drafts.iter_mut().filter(|d| d.symbol == carried.symbol).for_each(|d| d.rate = Some(rate));
        }
        Ok(())
    }

    /// `z = (x, y, a, lambda)`.
    fn with_multipliers(&mut self, rows: &[AccelerationRow], reactions: &[Vec<ExprId>]) -> Result<(), Error> {
        let accelerations = self.accelerations()?;
        self.carried_accelerations(&accelerations, &BTreeMap::new())?;
        let multipliers = self.multipliers(rows);
        let residuals = self.residuals(&accelerations);
        for (alpha, residual) in residuals.into_iter().enumerate() {
            let column: Vec<ExprId> = reactions.iter().map(|form| form[alpha]).collect();
            let reaction = self.g.dot(&column, &multipliers);
            let row = self.g.add(residual, reaction);
            self.algebraic.push(row);
        }
        for row in rows {
            let along = self.g.dot(&row.one_form, &accelerations);
            let remainder = self.remainder(row);
            let condition = self.g.add(along, remainder);
            self.algebraic.push(condition);
        }
        Ok(())
    }

    /// `z = (x, p, lambda)`.
    fn on_dual(&mut self, hamiltonian: &Hamiltonian) -> Result<(), Error> {
        let system = self.system;
        // Momenta that are parameters, and velocities by momenta.
        let mut known = BTreeMap::new();
        for momentum in system.momenta.iter().filter(|m| m.symbol.is_none()) {
            known.insert(hamiltonian.momenta[momentum.unknown], momentum.value);
        }
        let place = || Error::DivisionByZero { place: "the implicit form".into() };
        self.writer.begin("velocities y = dh/dp");
        let mut by_momenta = known.clone();
        for (alpha, p) in hamiltonian.momenta.iter().enumerate() {
            let slope = self.g.diff(hamiltonian.h, *p);
            let slope = self.g.subs(slope, &known).map_err(|_| place())?;
            self.y[alpha] = self.define(&system.algebroid.frame()[alpha].clone(), slope);
            by_momenta.insert(system.velocities[alpha], self.y[alpha]);
        }
        self.coordinates();
        for rate in self.drafts.iter_mut().filter_map(|draft| draft.rate.as_mut()) {
            *rate = self.g.subs(*rate, &by_momenta).map_err(|_| place())?;
        }
        self.writer.begin("slopes -dh/dx");
        let mut slopes = Vec::new();
        for x in system.algebroid.base() {
            let slope = self.g.diff(hamiltonian.h, *x);
            let slope = self.g.neg(slope);
            slopes.push(self.g.subs(slope, &known).map_err(|_| place())?);
        }
        let momenta: Vec<ExprId> = system.momenta.iter().map(|m| m.value).collect();
        let mut net = Vec::new();
        for value in self.net_forces(&momenta, &slopes) {
            net.push(self.g.subs(value, &by_momenta).map_err(|_| place())?);
        }
        let mut rates = net;
        let conditions = match &system.constraint {
            KinematicConstraint::Solved(_) => Vec::new(),
            KinematicConstraint::Multipliers { rows, reactions } => {
                let n_before = self.drafts.len();
                let multipliers = self.multipliers(rows);
                let held = self.drafts.split_off(n_before);
                for (alpha, rate) in rates.iter_mut().enumerate() {
                    let column: Vec<ExprId> = reactions.iter().map(|form| form[alpha]).collect();
                    let reaction = self.g.dot(&column, &multipliers);
                    let reaction = self.g.subs(reaction, &by_momenta).map_err(|_| place())?;
                    *rate = self.g.add(*rate, reaction);
                }
                let mut accelerations = Vec::new();
                for p in &hamiltonian.momenta {
                    let y = self.g.diff(hamiltonian.h, *p);
                    let row: Vec<ExprId> = hamiltonian.momenta.iter().map(|q| self.g.diff(y, *q)).collect();
                    let along = self.g.dot(&row, &rates);
                    let drift = self.drift(y);
                    accelerations.push(self.g.add(along, drift));
                }
                self.carried_accelerations(&accelerations, &by_momenta)?;
                let mut conditions = Vec::new();
                for row in rows {
                    let along = self.g.dot(&row.one_form, &accelerations);
                    let remainder = self.remainder(row);
                    let condition = self.g.add(along, remainder);
                    conditions.push(self.g.subs(condition, &by_momenta).map_err(|_| place())?);
                }
                self.algebraic = conditions;
                held
            }
        };
        for (momentum, rate) in system.momenta.iter().zip(rates) {
            if let Some(place) = momentum.symbol.and_then(|s| self.place_of(s)) {
                self.carried(place, Some(rate));
            }
        }
        self.drafts.extend(conditions);
        Ok(())
    }

    /// New symbols for the variables, and the proof that the motion satisfies every row.
    fn finish(self) -> Result<ImplicitForm, Error> {
        let Form { g, system, equations, state, writer, drafts, mut algebraic, .. } = self;
        let (found, expected) = (algebraic.len(), drafts.iter().filter(|d| d.rate.is_none()).count());
        if found != expected {
            return Err(Error::ShapeMismatch { what: "implicit form".to_owned(), found, expected });
        }
        let own: BTreeMap<SymbolId, SymbolId> =
            drafts.iter().map(|d| (d.symbol, g.symbol(&d.name))).collect();
        let mut rewritten: BTreeMap<SymbolId, ExprId> =
            own.iter().map(|(old, new)| (*old, g.sym(*new))).collect();
        let place = || Error::DivisionByZero { place: "the implicit form".into() };
        let mut sections = Vec::new();
        for section in writer.finish().0 {
            let mut definitions = Vec::new();
            for Definition { symbol, expr } in section.definitions {
                let expr = g.subs(expr, &rewritten).map_err(|_| place())?;
                let name = g.name(symbol).to_owned();
                let own = g.define(&name, expr);
                rewritten.insert(symbol, g.sym(own));
                definitions.push(Definition { symbol: own, expr });
            }
            sections.push(Section { title: section.title, definitions });
        }
        algebraic.reverse();
        let mut variables = Vec::new();
        for draft in drafts {
            let Draft { name, doc, symbol, value, rate, state } = draft;
            let is_differential = rate.is_some();
            let right = rate.or_else(|| algebraic.pop()).unwrap_or(g.zero());
            let right = g.subs(right, &rewritten).map_err(|_| place())?;
            let right = g.cancel_zero(right);
            let symbol = own[&symbol];
            variables.push(ImplicitVariable { name, doc, symbol, is_differential, right, value, state });
        }
        let rights: Vec<ExprId> = variables.iter().map(|v| v.right).collect();
        let sections = needed_sections(g, &sections, &rights);
        let form = ImplicitForm {
            index: usize::from(variables.iter().any(|v| !v.is_differential)),
            pontryagin_index: pontryagin_index(system),
            variables,
            sections,
        };
        form.require_closed(g, system)?;
        form.require_motion(g, equations, state)?;
        Ok(form)
    }
}

impl ImplicitForm {
    /// Row and column of the entries of `df/dz` that do not vanish identically, with their names and values.
    pub fn jacobian(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
    ) -> Vec<((usize, usize), String, ExprId)> {
        let rights: Vec<ExprId> = self.variables.iter().map(|v| v.right).collect();
        let symbols: Vec<SymbolId> = self.variables.iter().map(|v| v.symbol).collect();
        let linear = Linearisation::new(g, &self.sections, &rights, &symbols);
        let name = |value: &str, input: &str| format!("d_{value}_d_{input}");
        let rows = linear.jacobian(g, writer, name, |section| format!("derivatives of: {section}"));
        let mut entries = Vec::new();
        for (i, row) in rows.into_iter().enumerate() {
            for (j, e) in row.into_iter().enumerate().filter(|(_, e)| *e != g.zero()) {
                let [of, by] = [i, j].map(|k| self.variables[k].name.as_str());
                entries.push(((i, j), name(&format!("f_{of}"), by), e));
            }
        }
        entries
    }

    /// Refuses rows that mention what is no variable: a coordinate that a scene leaves out.
    fn require_closed(&self, g: &Graph, system: &ReducedSystem) -> Result<(), Error> {
        let given = system.params.iter().chain(&system.inputs).map(|p| p.symbol);
        let inputs = self.variables.iter().map(|v| v.symbol).chain(given);
        let definitions = self.sections.iter().flat_map(|s| &s.definitions);
        let known: BTreeSet<SymbolId> =
            inputs.chain([system.time]).chain(definitions.clone().map(|d| d.symbol)).collect();
        let all = self.variables.iter().map(|v| v.right).chain(definitions.map(|d| d.expr));
        let foreign = all.flat_map(|e| g.free_symbols(e)).find(|s| !known.contains(s));
        foreign.map_or(Ok(()), |symbol| {
            Err(Error::Unsupported {
                what: format!("the implicit form without {}", g.name(symbol)),
                possible: format!("a scene whose state has {}", g.name(symbol)),
            })
        })
    }

    /// Refuses a form that the motion does not satisfy: `z'` along it less `f`, and the algebraic equations, vanish.
    fn require_motion(
        &self,
        g: &mut Graph,
        equations: &Equations,
        state: &[StateEquation],
    ) -> Result<(), Error> {
        let values: BTreeMap<SymbolId, ExprId> = self.variables.iter().map(|v| (v.symbol, v.value)).collect();
        let by_variables = inlined(g, self.sections.iter().flat_map(|s| &s.definitions));
        let along: Vec<ExprId> = self.variables.iter().map(|v| v.value).collect();
        let along = rates(g, equations, state, &along);
        // What follows from a condition on positions holds where that holds.
        let conditions = equations.system.degeneracy.as_ref().filter(|found| !found.positions.is_empty());
        let places = conditions.and_then(|found| found.places(g, equations.system.algebroid.base()));
        let places = places.map(|p| (p, inlined(g, equations.sections.iter().flat_map(|s| &s.definitions))));
        for (variable, rate) in self.variables.iter().zip(along) {
            let right = g.subs(variable.right, &by_variables).and_then(|e| g.subs(e, &values));
            let right = right.map_err(|_| undefined())?;
            let mut residual = if variable.is_differential { g.sub(rate, right) } else { right };
            if let (Some((places, by_state)), true) = (&places, g.vanishing(residual) != Vanishing::Zero) {
                let on_them = g.subs(residual, by_state).and_then(|e| g.subs(e, places));
                residual = on_them.map_err(|_| undefined())?;
            }
            if g.vanishing(residual) != Vanishing::Zero {
                return Err(Error::Unverified {
                    claim: format!("that the motion satisfies the implicit equation of {}", variable.name),
                    residual: g.display(residual, Style::Plain).chars().take(MAX_SHOWN).collect(),
                    component: None,
                });
            }
        }
        Ok(())
    }
}

/// Characters of an equation that are shown in an error.
const MAX_SHOWN: usize = 120;

fn undefined() -> Error {
    Error::DivisionByZero { place: "the variables of the implicit form by the state".into() }
}

/// The index of the equations in `(x, y, p, lambda)`: one more than the number of times `p = L_y` is differentiated
/// for the last velocity, which is none where `L_yy` is regular; the multipliers of constraints are of index two.
fn pontryagin_index(system: &ReducedSystem) -> usize {
    let steps = system.degeneracy.iter().flat_map(|found| &found.steps);
    let of_velocities = 1 + steps.map(|step| step.n_derivatives).max().unwrap_or(0);
    let has_multipliers = match &system.constraint {
        KinematicConstraint::Solved(solved) => !solved.reactions.names.is_empty(),
        KinematicConstraint::Multipliers { .. } => true,
    };
    match (has_multipliers, &system.hamiltonian) {
        (true, _) => of_velocities.max(2),
        (false, None) => of_velocities,
        (false, Some(_)) => 0,
    }
}
