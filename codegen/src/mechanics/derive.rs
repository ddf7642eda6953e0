//! From a system on a Lie algebroid to explicit equations.

use std::collections::{BTreeMap, BTreeSet};

use crate::error::Error;
use crate::expr::{
    Definition, ExprId, Graph, Node, Rational, Section, SectionWriter, Sign, Stage, Style, SymbolId,
    Vanishing, sign_of,
};
use crate::reduction::{
    AccelerationRow, AccelerationSource, KinematicConstraint, ReducedSystem, SolvedConstraint, StateKind,
};
use crate::spec::Want;

use super::solve::{Factorisation, Pivot, PivotMatrix, is_symmetric};
use super::squares::{Square, take_squares};

/// A state variable and its time derivative.
#[derive(Clone, Debug)]
pub struct StateEquation {
    /// Its symbol.
    pub symbol: SymbolId,
    /// Its name.
    pub name: String,
    /// What it is.
    pub doc: String,
    /// Its derivative, in terms of inputs and definitions; literally zero when the variable is constant.
    pub derivative: ExprId,
}

/// What an [`Output`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OutputKind {
    /// What a scene wants by a word of the language.
    Group(Want),
    /// An output of the model, or an angle that is carried as a point of the circle.
    OfModel,
    /// A component of another output, which a scene wants by its own name.
    Component,
    /// The gradients of the invariants.
    Gradients,
}

/// A group of numbers that a scene may ask for.
#[derive(Clone, Debug)]
pub struct Output {
    /// What it is.
    pub kind: OutputKind,
    /// Name of the group.
    pub name: String,
    /// Names and values of the components.
    pub components: Vec<(String, ExprId)>,
    /// What it is, with its formula.
    pub doc: String,
}

impl Output {
    /// The output that is wanted by a word of the language, which is its name.
    pub fn group(want: Want, components: Vec<(String, ExprId)>, doc: &str) -> Output {
        Output { kind: OutputKind::Group(want), name: want.name().into(), components, doc: doc.into() }
    }
}

/// What the derivation found out exactly.
#[derive(Clone, Debug, Default)]
pub struct Facts {
    /// State variables whose derivative vanishes identically.
    pub constants: Vec<String>,
    /// Whether the energy rate vanishes identically.
    pub energy_is_conserved: bool,
    /// Whether the rate of the energy could not be shown to vanish, nor not to.
    pub energy_is_unverified: bool,
    /// Base coordinates that the derivation mentions and no rate depends on: the state equations are taken where they are
    /// zero (a point of the circle: at the angle zero).
    pub ignorable: Vec<String>,
    /// In the multiplier form: whether it vanishes once the constraint holds.
    pub energy_is_conserved_on_constraint: bool,
    /// For linear constraints: whether they are integrable, i.e. the allowed velocities form a subalgebroid at all times, and
    /// the same one.
    pub holonomic: Option<bool>,
    /// Casimirs, all verified to be conserved.
    pub casimirs: Vec<String>,
    /// Whether the matrix `A` of `A udot = f` depends on parameters alone.
    pub mass_matrix_is_constant: bool,
    /// Whether `A` (the Hessian `L_yy` in the multiplier form) is symmetric.
    pub mass_matrix_is_symmetric: bool,
}

/// Explicit equations of motion: definitions in order, and what they are for.
#[derive(Clone, Debug)]
pub struct Equations {
    /// The system they belong to; its graph owns all expressions here.
    pub system: ReducedSystem,
    /// Definitions in order.
    pub sections: Vec<Section>,
    /// State equations in state order.
    pub state: Vec<StateEquation>,
    /// Equations of the reconstructed coordinates.
    pub reconstruction: Vec<StateEquation>,
    /// Definitions that differ from the one of the same name, being its value at a place such as `phi=0`, the origin of an
    /// ignorable coordinate.
    pub taken_at: BTreeMap<SymbolId, String>,
    /// `A` of `A udot = f`.
    pub mass_matrix: Vec<Vec<ExprId>>,
    /// `f` of `A udot = f`.
    pub force: Vec<ExprId>,
    /// Names of the unknowns `u`.
    pub unknowns: Vec<String>,
    /// `E = p.y - L`.
    pub energy: ExprId,
    /// `dE/dt` along the motion.
    pub energy_rate: ExprId,
    /// Momenta, multipliers, casimirs, constraint residuals, outputs of the model.
    pub outputs: Vec<Output>,
    /// Everything that is divided by in a linear solve, and what to call it.
    pub pivots: Vec<Pivot>,
    /// What was found.
    pub facts: Facts,
    /// Every symbol that changes along a motion: inputs and definitions.
    pub(super) varying: BTreeSet<SymbolId>,
}

/// Derives `W^alpha_b E_alpha = 0` with
/// `E_alpha = d/dt p_alpha + C^gamma_{alpha beta} y^beta p_gamma - N^gamma_alpha p_gamma - rho^i_alpha dL/dx^i - F_alpha`,
/// solved for the accelerations; `N` is the drift of the frame, zero unless the frame depends on time.
///
/// # Errors
/// [`Error::SingularMassMatrix`] with the direction, [`Error::NotConserved`] for a claimed Casimir,
/// [`Error::DivisionByZero`], [`Error::OverBudget`].
///
/// # Source
/// Cortes, de Leon, Marrero, Martinez 2009, equations (3.5) and (3.7); Cendra, Marsden, Ratiu 2001.
pub fn derive(system: &ReducedSystem) -> Result<Equations, Error> {
    system.graph.within_budget()?;
    let mut d = Derivation::new(system);
    let equations = d.run();
    // Beside a graph that is past its budget, whatever else seems wrong says nothing.
    d.g.within_budget()?;
    let equations = equations?;
    equations.system.graph.within_budget()?;
    Ok(equations)
}

/// The accelerations and what else the solve gives.
struct Motion {
    /// `ydot`, one per velocity.
    acceleration: Vec<ExprId>,
    /// `udot`, one per unknown.
    unknown_rates: Vec<ExprId>,
    /// `lambda_A`, one per constraint.
    multipliers: Vec<(String, ExprId)>,
    /// The one-forms that they act along.
    reactions: Vec<Vec<ExprId>>,
    mass_matrix: Vec<Vec<ExprId>>,
    force: Vec<ExprId>,
    unknowns: Vec<String>,
    pivots: Vec<Pivot>,
}

struct Derivation<'a> {
    system: &'a ReducedSystem,
    g: Graph,
    writer: SectionWriter,
    names: Vec<String>,
    /// Dependent velocities and what replaces them: `y = Psi u + psi0`.
    replacement: BTreeMap<SymbolId, ExprId>,
    /// `y^alpha` after replacement.
    y: Vec<ExprId>,
    /// `xdot^i`.
    rates: Vec<ExprId>,
    /// `p_alpha`.
    momentum: Vec<ExprId>,
    /// `d^2 L / dy dy`.
    hessian: Vec<Vec<ExprId>>,
    /// `(N^gamma_alpha - C^gamma_{alpha beta} y^beta) p_gamma + rho^i_alpha dL/dx^i + F_alpha - (dp_alpha/dx^i xdot^i + dp_alpha/dt)`:
    /// everything in `-E_alpha` except the Hessian times `ydot`.
    drive: Vec<ExprId>,
}

impl<'a> Derivation<'a> {
    fn run(&mut self) -> Result<Equations, Error> {
        self.g.enter(Stage::Derivation);
        self.velocities()?;
        self.kinematics();
        self.momenta()?;
        self.g.within_budget()?;
        self.g.enter(Stage::Elimination);
        let motion = match self.system.constraint.clone() {
            KinematicConstraint::Solved(solved) => self.solve_reduced(&solved)?,
            KinematicConstraint::Multipliers { rows, reactions } => {
                self.solve_with_multipliers(&rows, &reactions)?
            }
        };
        self.g.within_budget()?;
        self.g.enter(Stage::Results);
        self.finish(motion)
    }

    fn new(system: &'a ReducedSystem) -> Derivation<'a> {
        let mut g = system.graph.clone();
        let y = system.velocities.iter().map(|s| g.sym(*s)).collect();
        let varying =
            system.velocities.iter().chain(system.algebroid.base()).chain([&system.time]).copied().collect();
        // Points of circles and advected vectors are not zero: functions divide by their lengths.
        let cosines = system.circles.iter().map(|c| c.cosine);
        let first = system.vectors_of_fixed_length().filter_map(|block| block.components.first().copied());
        let units: Vec<SymbolId> = cosines.chain(first).collect();
        let writer = SectionWriter::new(&g, varying, &units);
        Derivation {
            system,
            g,
            writer,
            names: system.algebroid.frame().to_vec(),
            replacement: BTreeMap::new(),
            y,
            rates: Vec::new(),
            momentum: Vec::new(),
            hessian: Vec::new(),
            drive: Vec::new(),
        }
    }

    fn replace(&mut self, e: ExprId) -> Result<ExprId, Error> {
        let replaced = self.g.subs(e, &self.replacement);
        let replaced = replaced
            .map_err(|_| Error::DivisionByZero { place: "the Lagrangian on the constraint".into() })?;
        Ok(self.g.cancel_zero(replaced))
    }

    /// `y = Psi u + psi0` for the dependent velocities.
    fn velocities(&mut self) -> Result<(), Error> {
        let KinematicConstraint::Solved(solved) = &self.system.constraint else { return Ok(()) };
        self.writer.begin("velocities y = Psi u + psi0");
        for &k in &solved.dependent {
            let value = solved_velocity(&mut self.g, solved, k);
            let named = self.writer.define(&mut self.g, &self.names[k], value);
            self.replacement.insert(self.system.velocities[k], named);
            self.y[k] = named;
        }
        Ok(())
    }

    fn define(&mut self, name: &str, value: ExprId) -> ExprId {
        self.writer.define(&mut self.g, name, value)
    }

    /// `xdot^i = rho^i_alpha y^alpha`.
    fn kinematics(&mut self) {
        self.writer.begin("kinematics xdot = rho y");
        for i in 0..self.system.algebroid.n_base() {
            let mut terms = Vec::new();
            for alpha in 0..self.y.len() {
                let anchor = self.system.algebroid.anchor(i, alpha);
                terms.push(self.g.mul(anchor, self.y[alpha]));
            }
            let sum = self.g.sum(&terms);
            let name = format!("dot_{}", self.g.name(self.system.algebroid.base()[i]));
            let rate = self.define(&name, sum);
            self.rates.push(rate);
        }
    }

    /// `p = dL/dy`, its Hessian, and the part of `-E` without accelerations.
    fn momenta(&mut self) -> Result<(), Error> {
        let system = self.system;
        let raw: Vec<ExprId> = system.velocities.iter().map(|s| self.g.diff(system.lagrangian, *s)).collect();
        self.writer.begin("momenta p = dL/dy");
        for (alpha, p) in raw.iter().enumerate() {
            let value = self.replace(*p)?;
            let name = format!("p_{}", self.names[alpha]);
            let named = self.define(&name, value);
            self.momentum.push(named);
        }
        for p in &raw {
            let row = self.system.velocities.iter().map(|s| self.g.diff(*p, *s)).collect::<Vec<_>>();
            let row = row.into_iter().map(|e| self.replace(e)).collect::<Result<_, _>>()?;
            self.hessian.push(row);
        }
        let (squares, l) = match system.formulation.squares {
            true => take_squares(&mut self.g, system),
            false => (Vec::new(), system.lagrangian),
        };
        let inertia_forces = self.inertia_forces(&squares)?;
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
        let forces = format!("forces rho dL/dx + F {sign} {turning} - (dp/dx xdot + dp/dt)");
        let inertia = if squares.is_empty() { "" } else { " of the rest, and -m dv/dy . a" };
        self.writer.begin(&format!("{forces}{inertia}"));
        let mut slopes = Vec::new();
        for x in system.algebroid.base() {
            let slope = self.g.diff(l, *x);
            let slope = self.replace(slope)?;
            let name = format!("dL_d{}", self.g.name(*x));
            slopes.push(self.define(&name, slope));
        }
        for (alpha, p) in raw.iter().enumerate() {
            let value = self.drive_of(alpha, *p, &momentum, &slopes)?;
            let value = self.g.sub(value, inertia_forces[alpha]);
            let name = format!("r_{}", self.names[alpha]);
            let named = self.define(&name, value);
            self.drive.push(named);
        }
        Ok(())
    }

    /// `weight v_alpha . (dv/dx xdot + omega x v)` of all squares, by `alpha`.
    fn inertia_forces(&mut self, squares: &[Square]) -> Result<Vec<ExprId>, Error> {
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
        self.writer.begin("accelerations of the velocities a = dv/dx xdot + omega x v at ydot = 0");
        let mut forces = vec![Vec::new(); self.y.len()];
        for (k, (square, v)) in squares.iter().zip(velocities).enumerate() {
            let turned = square.turned(&mut self.g, &self.y, &v);
            for (i, (component, turned)) in square.components.iter().zip(turned).enumerate() {
                let drift = self.drift(component.value)?;
                let value = self.g.add(drift, turned);
                let acceleration = self.define(&format!("a{}_{}", k + 1, i + 1), value);
                for (terms, slope) in forces.iter_mut().zip(&component.slopes) {
                    let slope = self.replace(*slope)?;
                    terms.push(self.g.product(&[square.weight, slope, acceleration]));
                }
            }
        }
        Ok(forces.iter().map(|terms| self.g.sum(terms)).collect())
    }

    /// `rho dL/dx + F + (N - C y) p - (dp/dx xdot + dp/dt)` along one section, of the part of the Lagrangian that `p`, `momentum`
    /// and `slopes` are derivatives of.
    fn drive_of(
        &mut self,
        alpha: usize,
        p: ExprId,
        momentum: &[ExprId],
        slopes: &[ExprId],
    ) -> Result<ExprId, Error> {
        let system = self.system;
        let force = self.replace(system.forces[alpha])?;
        let mut terms = vec![force];
        for (i, slope) in slopes.iter().enumerate() {
            terms.push(self.g.mul(system.algebroid.anchor(i, alpha), *slope));
        }
        for beta in 0..self.y.len() {
            for (gamma, c) in system.algebroid.bracket(&mut self.g, alpha, beta) {
                let term = self.g.product(&[c, self.y[beta], momentum[gamma]]);
                terms.push(self.g.neg(term));
            }
        }
        for (gamma, n) in system.algebroid.drift(alpha) {
            terms.push(self.g.mul(*n, momentum[*gamma]));
        }
        let drift = self.drift(p)?;
        terms.push(self.g.neg(drift));
        Ok(self.g.sum(&terms))
    }

    /// `de/dx^i xdot^i + de/dt` at fixed velocities, for an expression in the raw velocity symbols.
    fn drift(&mut self, e: ExprId) -> Result<ExprId, Error> {
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

    /// `A udot = f` with `A = W^T L_yy Psi`, `f = W^T (drive - L_yy (dPsi u + dpsi0))`.
    fn solve_reduced(&mut self, solved: &SolvedConstraint) -> Result<Motion, Error> {
        let m = self.y.len();
        let k = solved.unknowns.len();
        let unknowns: Vec<String> = solved.unknowns.iter().map(|u| u.name.clone()).collect();
        self.writer.begin("accelerations of the dependent velocities at udot = 0");
        let mut lag = vec![self.g.zero(); m];
        for &alpha in &solved.dependent {
            let value = solved_velocity(&mut self.g, solved, alpha);
            let drift = self.drift(value)?;
            lag[alpha] = self.define(&format!("lag_{}", self.names[alpha]), drift);
        }
        self.writer.begin("mass matrix A = W^T L_yy Psi");
        let mut mass_matrix = vec![vec![self.g.zero(); k]; k];
        let mut force = Vec::new();
        let symmetric_form = solved.virtual_displacements == solved.psi;
        let mut displacements = Vec::new();
        for row in &solved.virtual_displacements {
            displacements.push(row.iter().map(|e| self.replace(*e)).collect::<Result<Vec<_>, _>>()?);
        }
        for b in 0..k {
            for a in 0..k {
                if symmetric_form && a < b {
                    mass_matrix[b][a] = mass_matrix[a][b];
                    continue;
                }
                let mut terms = Vec::new();
                for alpha in 0..m {
                    for beta in 0..m {
                        let (w, h) = (displacements[alpha][b], self.hessian[alpha][beta]);
                        if w != self.g.zero() && h != self.g.zero() {
                            terms.push(self.g.product(&[w, h, solved.psi[beta][a]]));
                        }
                    }
                }
                let sum = self.g.sum(&terms);
                mass_matrix[b][a] = self.define(&format!("A_{}_{}", unknowns[b], unknowns[a]), sum);
            }
        }
        self.writer.begin("right side f = W^T (r - L_yy lag)");
        let mut net = Vec::new();
        for alpha in 0..m {
            let mut terms = vec![self.drive[alpha]];
            for beta in 0..m {
                let product = self.g.mul(self.hessian[alpha][beta], lag[beta]);
                terms.push(self.g.neg(product));
            }
            let sum = self.g.sum(&terms);
            net.push(self.define(&format!("n_{}", self.names[alpha]), sum));
        }
        for b in 0..k {
            let mut terms = Vec::new();
            for alpha in 0..m {
                terms.push(self.g.mul(displacements[alpha][b], net[alpha]));
            }
            let sum = self.g.sum(&terms);
            force.push(self.define(&format!("f_{}", unknowns[b]), sum));
        }
        let labels: Vec<String> = unknowns.iter().map(|n| format!("dot_{n}")).collect();
        let names = inertias(&unknowns);
        let (udot, mut pivots) =
            self.solve_linear("A", &mass_matrix, &force, &unknowns, &labels, (&names, symmetric_form))?;
        let coefficients = PivotMatrix { name: "C".into(), is_symmetric: false, follows_hessian: false };
        pivots.extend(solved.pivots.iter().map(|(name, expr)| Pivot {
            name: name.clone(),
            expr: *expr,
            matrix: coefficients.clone(),
            origin: None,
        }));
        self.writer.begin("accelerations ydot = Psi udot + lag");
        let mut acceleration = vec![self.g.zero(); m];
        for alpha in 0..m {
            let mut terms = vec![lag[alpha]];
            for a in 0..k {
                terms.push(self.g.mul(solved.psi[alpha][a], udot[a]));
            }
            let sum = self.g.sum(&terms);
            acceleration[alpha] = self.define(&format!("dot_{}", self.names[alpha]), sum);
        }
        let multipliers = self.multipliers_of(solved, &acceleration)?;
        let reactions = solved.reactions.one_forms.clone();
        let unknown_rates = udot;
        Ok(Motion {
            acceleration,
            unknown_rates,
            multipliers,
            reactions,
            mass_matrix,
            force,
            unknowns,
            pivots,
        })
    }

    /// Factors and solves, writing both as sections. Solutions are called `labels`; of the pivots the names are given, and whether
    /// they follow the Hessian.
    fn solve_linear(
        &mut self,
        prefix: &str,
        matrix: &[Vec<ExprId>],
        right: &[ExprId],
        unknowns: &[String],
        labels: &[String],
        (pivot_names, follows_hessian): (&[String], bool),
    ) -> Result<(Vec<ExprId>, Vec<Pivot>), Error> {
        self.writer.begin(&format!("factors of {prefix}"));
        let factors =
            Factorisation::new(&mut self.g, &mut self.writer, prefix, matrix, unknowns, &self.system.signs)?;
        self.writer.begin(&format!("substitution through the factors of {prefix}"));
        let x = factors.solve(&mut self.g, &mut self.writer, labels, right);
        Ok((x, factors.pivots(pivot_names, follows_hessian)))
    }

    /// `E_alpha = sum_A lambda_A form_A,alpha`, solved on components that determine the multipliers.
    fn multipliers_of(
        &mut self,
        solved: &SolvedConstraint,
        acceleration: &[ExprId],
    ) -> Result<Vec<(String, ExprId)>, Error> {
        let reactions = &solved.reactions;
        if reactions.names.is_empty() {
            return Ok(Vec::new());
        }
        self.writer.begin("multipliers E = lambda a");
        let mut matrix = Vec::new();
        let mut right = Vec::new();
        for &alpha in &reactions.on {
            let mut row = Vec::new();
            for form in &reactions.one_forms {
                row.push(self.replace(form[alpha])?);
            }
            matrix.push(row);
            let mut terms = vec![self.g.neg(self.drive[alpha])];
            for (beta, ydot) in acceleration.iter().enumerate() {
                terms.push(self.g.mul(self.hessian[alpha][beta], *ydot));
            }
            right.push(vec![self.g.sum(&terms)]);
        }
        let solution = crate::algebra::solve_symbolic(&mut self.g, &matrix, &right)
            .map_err(|_| Error::DivisionByZero { place: "the multipliers".into() })?;
        let rows = reactions.names.iter().zip(solution);
        Ok(rows.map(|(name, value)| (format!("lambda_{name}"), self.g.cancel_zero(value[0]))).collect())
    }

    /// `L_yy ydot = drive + Lambda^T lambda`, `w ydot + w0 = 0`, by `S = w L_yy^-1 Lambda^T`: the multipliers act along the
    /// one-forms `Lambda` that vanish on virtual displacements and keep the conditions on accelerations.
    fn solve_with_multipliers(
        &mut self,
        rows: &[AccelerationRow],
        reactions: &[Vec<ExprId>],
    ) -> Result<Motion, Error> {
        let m = self.y.len();
        let names = self.names.clone();
        let hessian = self.hessian.clone();
        self.writer.begin("factors of L_yy");
        let factors =
            Factorisation::new(&mut self.g, &mut self.writer, "M", &hessian, &names, &self.system.signs)?;
        self.writer.begin("free acceleration L_yy^-1 r");
        let drive = self.drive.clone();
        let prefixed = |prefix: &str| names.iter().map(|n| format!("{prefix}_{n}")).collect::<Vec<_>>();
        let free = factors.solve(&mut self.g, &mut self.writer, &prefixed("free"), &drive);
        self.writer.begin("response to the multipliers L_yy^-1 Lambda^T");
        let mut response = Vec::new();
        for (c, form) in reactions.iter().enumerate() {
            let labels = prefixed(&format!("Z{}", c + 1));
            response.push(factors.solve(&mut self.g, &mut self.writer, &labels, form));
        }
        self.writer.begin("multipliers S lambda = -(w L_yy^-1 r + w0), S = w L_yy^-1 Lambda^T");
        let dot = |g: &mut Graph, a: &[ExprId], b: &[ExprId]| {
            let terms: Vec<ExprId> = a.iter().zip(b).map(|(x, y)| g.mul(*x, *y)).collect();
            g.sum(&terms)
        };
        let mut matrix = Vec::new();
        let mut right = Vec::new();
        for (c, row) in rows.iter().enumerate() {
            let mut entries = Vec::new();
            for (other, z) in response.iter().enumerate() {
                let product = dot(&mut self.g, &row.one_form, z);
                entries.push(self.define(&format!("S_{}_{}", c + 1, other + 1), product));
            }
            matrix.push(entries);
            let rate = match row.source {
                AccelerationSource::Differentiated(residual) => self.drift(residual)?,
                AccelerationSource::Servo(remainder) => remainder,
            };
            let product = dot(&mut self.g, &row.one_form, &free);
            let sum = self.g.add(product, rate);
            let value = self.g.neg(sum);
            right.push(self.define(&format!("g_{}", c + 1), value));
        }
        let labels: Vec<String> = rows.iter().map(|r| format!("lambda_{}", r.name)).collect();
        let pivot_names: Vec<String> =
            rows.iter().map(|r| format!("response to constraint {}", r.text)).collect();
        // S = Lambda L_yy^-1 Lambda^T where the reactions act along the constraints.
        let is_congruent = rows.iter().zip(reactions).all(|(row, form)| row.one_form == *form);
        let (lambda, constraint_pivots) =
            self.solve_linear("S", &matrix, &right, &labels, &labels, (&pivot_names, is_congruent))?;
        self.writer.begin("accelerations ydot = L_yy^-1 (r + Lambda^T lambda)");
        let mut acceleration = Vec::new();
        for alpha in 0..m {
            let mut terms = vec![free[alpha]];
            for (c, z) in response.iter().enumerate() {
                terms.push(self.g.mul(z[alpha], lambda[c]));
            }
            let sum = self.g.sum(&terms);
            acceleration.push(self.define(&format!("dot_{}", names[alpha]), sum));
        }
        let mut pivots = factors.pivots(&inertias(&names), true);
        pivots.extend(constraint_pivots);
        Ok(Motion {
            unknown_rates: acceleration.clone(),
            acceleration,
            multipliers: labels.into_iter().zip(lambda).collect(),
            reactions: reactions.to_vec(),
            mass_matrix: hessian,
            force: drive,
            unknowns: names,
            pivots,
        })
    }

    /// `E = p.y - L`. For `L` quadratic in the velocities, `E = L - L_1 - 2 L_0` needs no products of momenta.
    fn energy(&mut self) -> Result<ExprId, Error> {
        let system = self.system;
        let g = &mut self.g;
        let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
        let zeros: BTreeMap<SymbolId, ExprId> = velocities.iter().map(|s| (*s, g.zero())).collect();
        let raw: Vec<ExprId> = system.velocities.iter().map(|s| g.diff(system.lagrangian, *s)).collect();
        let mut quadratic = true;
        for p in &raw {
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

    /// Time derivative along the motion of an expression in coordinates, raw velocities, quasi-velocities and time:
    /// `de/dt + de/dx^i xdot^i + de/dy^alpha ydot^alpha + de/ds sdot`.
    fn rate_of(&mut self, e: ExprId, motion: &Motion) -> Result<ExprId, Error> {
        let system = self.system;
        let frame = system.velocities.iter().copied().zip(motion.acceleration.iter().copied());
        // A quasi-velocity is no velocity of the frame, and moves all the same.
        let unknowns = system.unknowns.iter().zip(motion.unknown_rates.iter().copied());
        let quasi = unknowns.filter(|(u, _)| u.frame_idx.is_none()).map(|(u, rate)| (u.symbol, rate));
        let mut terms = vec![self.drift(e)?];
        for (s, rate) in frame.chain(quasi) {
            let slope = self.g.diff(e, s);
            let slope = self.replace(slope)?;
            terms.push(self.g.mul(slope, rate));
        }
        let sum = self.g.sum(&terms);
        Ok(self.g.cancel_zero(sum))
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
    fn spelled_out(&mut self, e: ExprId) -> String {
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
            let (mut momentum, mut rate) = (Vec::new(), Vec::new());
            for alpha in 0..self.y.len() {
                let w = solved.virtual_displacements[alpha][b];
                if w == self.g.zero() {
                    continue;
                }
                momentum.push(self.g.mul(w, self.momentum[alpha]));
                // drive = forces - dp/dx xdot - dp/dt; the momentum equation wants the forces alone.
                let p = self.g.diff(system.lagrangian, system.velocities[alpha]);
                let drift = self.drift(p)?;
                let force = self.g.add(self.drive[alpha], drift);
                rate.push(self.g.mul(w, force));
                let turning = self.drift(w)?;
                rate.push(self.g.mul(turning, self.momentum[alpha]));
            }
            let (momentum, rate) = (self.g.sum(&momentum), self.g.sum(&rate));
            momenta.push((format!("J_{}", unknown.name), self.g.cancel_zero(momentum)));
            rates.push((format!("dot_J_{}", unknown.name), self.g.cancel_zero(rate)));
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

    /// Power of forces, explicit time, the drift of the frame and constraint reactions:
    /// `F.y - dL/dt + N^gamma_alpha y^alpha p_gamma + sum_A lambda_A form_A.y`.
    fn power(&mut self, motion: &Motion) -> Result<ExprId, Error> {
        let explicit = self.g.diff(self.system.lagrangian, self.system.time);
        let explicit = self.replace(explicit)?;
        let mut terms = vec![self.g.neg(explicit)];
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
            let work: Vec<ExprId> =
                form.iter().zip(self.y.clone()).map(|(coefficient, y)| self.g.mul(*coefficient, y)).collect();
            let work = self.g.sum(&work);
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

    fn finish(&mut self, motion: Motion) -> Result<Equations, Error> {
        let system = self.system;
        let raw_energy = self.energy()?;
        let mut energy_rate = self.rate_of(raw_energy, &motion)?;
        let energy = self.replace(raw_energy)?;
        let mut facts = Facts {
            energy_is_conserved: energy_rate == self.g.zero(),
            energy_is_unverified: self.g.vanishing(energy_rate) == Vanishing::Unknown,
            mass_matrix_is_symmetric: is_symmetric(&mut self.g, &motion.mass_matrix),
            ..Facts::default()
        };
        facts.mass_matrix_is_constant =
            motion.mass_matrix.iter().flatten().all(|e| !self.writer.varies(&self.g, *e));
        let mut outputs = Vec::new();
        let momenta = self.names.iter().zip(&self.momentum).map(|(n, p)| (format!("p_{n}"), *p)).collect();
        outputs.push(Output::group(Want::Momentum, momenta, "momenta p = dL/dy"));
        if !motion.multipliers.is_empty() {
            let doc = "multipliers lambda_A of E = lambda_A a_A, the constraint forces along the constraint one-forms";
            outputs.push(Output::group(Want::Multipliers, motion.multipliers.clone(), doc));
        }
        let power = self.power(&motion)?;
        if self.g.is_equal(energy_rate, power) {
            energy_rate = power;
        }
        if let KinematicConstraint::Multipliers { rows, .. } = &system.constraint {
            let residuals = rows.iter().filter_map(|row| match row.source {
                AccelerationSource::Differentiated(residual) => {
                    Some((format!("residual_{}", row.name), residual))
                }
                AccelerationSource::Servo(_) => None,
            });
            let components: Vec<(String, ExprId)> = residuals.collect();
            facts.energy_is_conserved_on_constraint =
                !facts.energy_is_conserved && self.vanishes_with(energy_rate, &motion, &components);
            if !components.is_empty() {
                let doc = "residual of the constraints, zero along the motion";
                outputs.push(Output::group(Want::Constraint, components, doc));
            }
        }
        if let KinematicConstraint::Solved(solved) = &system.constraint
            && !solved.rows.is_empty()
        {
            facts.holonomic =
                super::sections::is_subalgebroid(&mut self.g, &system.algebroid, system.time, solved);
            outputs.extend(self.momentum_equation(solved)?);
        }
        if !system.casimirs.is_empty() {
            let mut components = Vec::new();
            for casimir in &system.casimirs {
                let rate = self.rate_of(casimir.expr, &motion)?;
                self.require_conserved(&casimir.name, rate)?;
                facts.casimirs.push(casimir.name.clone());
                let value = self.replace(casimir.expr)?;
                components.push((casimir.name.clone(), value));
            }
            outputs.push(Output::group(Want::Casimirs, components, "conserved quantities"));
        }
        for output in &system.outputs {
            let mut components = Vec::new();
            for (name, e) in &output.components {
                components.push((name.clone(), self.replace(*e)?));
            }
            let (name, doc) = (output.name.clone(), output.doc.clone());
            outputs.push(Output { kind: OutputKind::OfModel, name, components, doc });
        }
        let mut state = Vec::new();
        for (kind, doc) in &system.state {
            let (symbol, derivative) = match *kind {
                StateKind::Base(i) => (system.algebroid.base()[i], self.rates[i]),
                StateKind::Unknown(a) => (system.unknowns[a].symbol, motion.unknown_rates[a]),
            };
            let name = self.g.name(symbol).to_owned();
            if derivative == self.g.zero() {
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
        let circles = self.circles(&motion, &mut facts)?;
        let pivots = motion.pivots.into_iter().filter(|p| self.g.as_rational(p.expr).is_none()).collect();
        let mut system = self.system.clone();
        system.graph = std::mem::take(&mut self.g);
        let (sections, varying) = std::mem::take(&mut self.writer).finish();
        let mut equations = Equations {
            system,
            sections,
            state,
            reconstruction,
            taken_at: BTreeMap::new(),
            mass_matrix: motion.mass_matrix,
            force: motion.force,
            unknowns: motion.unknowns,
            energy,
            energy_rate,
            outputs,
            pivots,
            facts,
            varying,
        };
        super::ignorable::settle(&mut equations);
        // Equal to one on the circle, hence not to be settled.
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

fn inertias(names: &[String]) -> Vec<String> {
    names.iter().map(|n| format!("inertia along {n}")).collect()
}

/// `y^alpha = Psi^alpha_a u^a + psi0^alpha` of a dependent velocity.
pub(crate) fn solved_velocity(g: &mut Graph, solved: &SolvedConstraint, alpha: usize) -> ExprId {
    let mut terms = vec![solved.psi0[alpha]];
    for (a, unknown) in solved.unknowns.iter().enumerate() {
        let u = g.sym(unknown.symbol);
        terms.push(g.mul(solved.psi[alpha][a], u));
    }
    g.sum(&terms)
}

impl Equations {
    /// Every result: what a scene can ask for, and what `explain` shows.
    pub(super) fn roots(&self) -> Vec<&ExprId> {
        let state = self.state.iter().chain(&self.reconstruction).map(|s| &s.derivative);
        let outputs = self.outputs.iter().flat_map(|o| o.components.iter().map(|(_, e)| e));
        let matrix = self.mass_matrix.iter().flatten().chain(&self.force);
        let pivots = self.pivots.iter().flat_map(|p| {
            let origin = p.origin.iter();
            let origin = origin.flat_map(|o| o.updates.iter().flatten().chain(&o.entries).chain([&o.entry]));
            [&p.expr].into_iter().chain(origin)
        });
        state.chain(outputs).chain(matrix).chain(pivots).chain([&self.energy, &self.energy_rate]).collect()
    }

    /// [`Equations::roots`] in the same order, to be replaced by equal ones.
    pub(super) fn roots_mut(&mut self) -> Vec<&mut ExprId> {
        let state = self.state.iter_mut().chain(&mut self.reconstruction).map(|s| &mut s.derivative);
        let outputs = self.outputs.iter_mut().flat_map(|o| o.components.iter_mut().map(|(_, e)| e));
        let matrix = self.mass_matrix.iter_mut().flatten().chain(&mut self.force);
        let pivots = self.pivots.iter_mut().flat_map(|p| {
            let origin = p
                .origin
                .iter_mut()
                .flat_map(|o| o.updates.iter_mut().flatten().chain(&mut o.entries).chain([&mut o.entry]));
            [&mut p.expr].into_iter().chain(origin)
        });
        state
            .chain(outputs)
            .chain(matrix)
            .chain(pivots)
            .chain([&mut self.energy, &mut self.energy_rate])
            .collect()
    }

    /// Whether the Hessian `L_yy` is seen to have no negative eigenvalue at any state: the terms of the Lagrangian that are not
    /// linear in the velocities are quadratic polynomials in them that are never negative, such as squares.
    pub fn hessian_is_a_sum_of_squares(&self) -> bool {
        let system = &self.system;
        // Nodes made for the proof are no part of the equations.
        let mut g = system.graph.clone();
        let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
        g.summands(system.lagrangian).into_iter().all(|(term, weight)| {
            let mut second = Vec::new();
            for y in &velocities {
                let slope = g.diff(term, *y);
                second.extend(velocities.iter().map(|z| g.diff(slope, *z)));
            }
            if second.iter().all(|e| *e == g.zero()) {
                return true;
            }
            let term = g.scale(term, &weight);
            let sign = sign_of(&g, term, &system.signs);
            second.iter().all(|e| !g.depends_on(*e, &velocities))
                && matches!(sign, Sign::Positive | Sign::NonNegative)
        })
    }

    /// Whether an expression depends on parameters alone, also through definitions.
    pub fn is_parameter_only(&self, e: ExprId) -> bool {
        !self.system.graph.depends_on(e, &self.varying)
    }

    /// An expression of these equations as text.
    pub fn display(&self, e: ExprId, style: Style) -> String {
        self.system.graph.display(e, style)
    }
}

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
