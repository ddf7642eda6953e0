//! The nonholonomic bracket: an antisymmetric matrix `Pi` of functions on the state and a vector `R` with
//! `z' = Pi dE + R` along the motion.
//!
//! With sections `W_a` that span the allowed velocities, and momenta `pi_a = <p, W_a>` at `p = L_y`,
//!
//! ```text
//! {x^i, x^j} = 0,   {x^i, pi_b} = rho(W_b)^i,   {pi_a, pi_b} = -<p, [W_a, W_b]>
//! ```
//!
//! The motion stays on momenta of allowed velocities, which annihilate what is orthogonal to these in the metric `L_yy`:
//! `<p, [W_a, W_b]>` asks for no complement. Where velocities are eliminated, `W = Psi`; where multipliers keep the
//! constraint, `W_a` is the frame projected along the metric, and the bracket is that of `p o P` with the projection `P`
//! of momenta. Momenta and velocities `u` are related by `d pi = A du + ..`, which takes the bracket to the coordinates
//! of the state.
//!
//! Does not know: which coordinates a scene leaves out, what is found out about a bracket.
//!
//! # Source
//! van der Schaft, Maschke 1994; de Leon, Marrero, Martin de Diego 2010; Garcia-Naranjo, Sansonetto and others for
//! affine constraints.

use std::collections::{BTreeMap, BTreeSet};

use crate::differentiate::Linearisation;
use crate::error::Error;
use crate::expr::{ExprId, Graph, Section, SectionWriter, SymbolId, Vanishing, needed_sections};
use crate::reduction::{AccelerationSource, KinematicConstraint, SolvedConstraint, StateKind};
use crate::spec::Want;

use super::chart::Chart;
use super::equations::{Equations, OutputKind};
use super::solve::Factorisation;

/// The bracket of the state variables of [`Equations`], in their order.
#[derive(Clone, Debug)]
pub struct Bracket {
    /// `{z_i, z_j}` for `i < j`, without those that vanish identically; row by row.
    pub entries: Vec<(usize, usize, ExprId)>,
    /// `R`, one number for each state variable: zero unless the constraint is affine, something depends on time, or a
    /// force acts.
    pub remainder: Vec<ExprId>,
    /// Definitions that the entries use, to come after those of the equations.
    pub sections: Vec<Section>,
}

impl Bracket {
    /// The bracket of a system, with `z' = Pi dE + R` proved: where multipliers keep a constraint, on it.
    ///
    /// # Errors
    /// [`Error::NoBracket`] for a system that has none of this kind, [`Error::Unverified`] where the identity is not
    /// proved.
    pub fn new(g: &mut Graph, equations: &Equations) -> Result<Bracket, Error> {
        let mut b = Builder::new(g, equations)?;
        let momentum_form = b.momentum_form()?;
        let bracket = b.on_state(&momentum_form)?;
        bracket.prove(g, equations)?;
        Ok(bracket)
    }

    /// Whether `R` vanishes.
    pub fn has_remainder(&self, g: &Graph) -> bool {
        self.remainder.iter().any(|e| *e != g.zero())
    }

    /// `{z_i, z_j}` for all pairs.
    pub fn matrix(&self, g: &mut Graph) -> Vec<Vec<ExprId>> {
        let n = self.remainder.len();
        let mut matrix = vec![vec![g.zero(); n]; n];
        for &(i, j, e) in &self.entries {
            matrix[i][j] = e;
            matrix[j][i] = g.neg(e);
        }
        matrix
    }

    /// `z' = Pi dE + R` by values of both sides.
    fn prove(&self, g: &mut Graph, equations: &Equations) -> Result<(), Error> {
        let chart = Chart::new(g, equations)?;
        let (slopes, scratch) = gradient(g, equations, &self.sections, equations.energy);
        let own = [self.sections.as_slice(), scratch.as_slice()].concat();
        let matrix = self.matrix(g);
        for (i, state) in equations.state.iter().enumerate() {
            let mut terms = vec![state.derivative];
            for (j, slope) in slopes.iter().enumerate() {
                let product = g.mul(matrix[i][j], *slope);
                terms.push(g.neg(product));
            }
            terms.push(g.neg(self.remainder[i]));
            let difference = g.sum(&terms);
            let difference = chart.restricted(g, &own, difference)?;
            if g.vanishing(difference) != Vanishing::Zero {
                return Err(Error::Unverified {
                    claim: format!("{}' = Pi dE + R of the nonholonomic bracket", state.name),
                    residual: "the difference of both sides".into(),
                    component: None,
                });
            }
        }
        Ok(())
    }
}

/// Derivatives of a value by the state variables, and definitions that they use.
fn gradient(g: &mut Graph, equations: &Equations, own: &[Section], e: ExprId) -> (Vec<ExprId>, Vec<Section>) {
    let by: Vec<SymbolId> = equations.state.iter().map(|s| s.symbol).collect();
    let all: Vec<Section> = equations.sections.iter().chain(own).cloned().collect();
    let sections = needed_sections(g, &all, &[e]);
    let linear = Linearisation::new(g, &sections, &[e], &by);
    let mut writer = SectionWriter::new(g, BTreeSet::new(), &[]);
    let slopes = linear.jacobian(g, &mut writer, |v, x| format!("d_{v}_d_{x}"), str::to_owned).remove(0);
    (slopes, writer.finish().0)
}

/// The bracket in coordinates `(x, pi)`, by place of the unknown, and what takes it to velocities.
struct MomentumForm {
    /// `rho(W_b)^i`, by `i` and `b`.
    anchor: Vec<Vec<ExprId>>,
    /// `{pi_a, pi_b}`.
    momenta: Vec<Vec<ExprId>>,
    /// `rho(W_a)` of `pi_b` at fixed velocities, by `a` and `b`.
    turning: Vec<Vec<ExprId>>,
    /// `R` along `x` and `pi`, before the term of the energy that is linear in `psi0`.
    remainder: [Vec<ExprId>; 2],
    /// `d pi/dx^i` at fixed velocities along `R_x`, plus `d pi/dt`.
    lag: Vec<ExprId>,
    /// `<p, psi0>`, by which the energy differs from that of the velocities `Psi u`.
    moving_energy: ExprId,
}

struct Builder<'a> {
    g: &'a mut Graph,
    equations: &'a Equations,
    writer: SectionWriter,
    /// What stands for velocities that are no part of the state.
    values: BTreeMap<SymbolId, ExprId>,
    /// Momenta `p_alpha` before replacement, and after.
    raw_momentum: Vec<ExprId>,
    momentum: Vec<ExprId>,
    /// `L_yy`, or `h_pp`.
    hessian: Vec<Vec<ExprId>>,
}

fn no_bracket(reason: &str) -> Error {
    Error::NoBracket { reason: reason.to_owned() }
}

impl<'a> Builder<'a> {
    fn new(g: &'a mut Graph, equations: &'a Equations) -> Result<Builder<'a>, Error> {
        let system = &equations.system;
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

    /// Refuses constraints that are not linear, and displacements that are not those which they allow.
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
                let velocities: BTreeSet<SymbolId> = system.velocities.iter().copied().collect();
                for (row, reaction) in rows.iter().zip(reactions) {
                    if matches!(row.source, AccelerationSource::Servo(_)) {
                        let reason = format!("{} is a constraint on accelerations", row.text);
                        return Err(no_bracket(&reason));
                    }
                    if row.one_form.iter().any(|e| self.g.depends_on(*e, &velocities)) {
                        let reason = format!("{} is not linear in the velocities", row.text);
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

    fn replace(&mut self, e: ExprId) -> Result<ExprId, Error> {
        let replaced = self.g.subs(e, &self.values);
        let replaced =
            replaced.map_err(|_| Error::DivisionByZero { place: "the nonholonomic bracket".into() })?;
        Ok(self.g.cancel_zero(replaced))
    }

    fn define(&mut self, name: &str, value: ExprId) -> ExprId {
        self.writer.define(self.g, name, value)
    }

    /// Velocities that the state does not carry: those of momenta, and those that a constraint determines.
    fn velocities(&mut self) -> Result<(), Error> {
        let system = &self.equations.system;
        let outputs = &self.equations.outputs;
        let given = outputs.iter().find(|o| o.kind == OutputKind::Group(Want::Velocities));
        let given = given.map_or(&[][..], |output| output.components.as_slice());
        self.writer.begin("velocities");
        for momentum in &system.momenta {
            let unknown = &system.unknowns[momentum.unknown];
            if let Some((_, value)) = given.iter().find(|(name, _)| *name == unknown.name) {
                self.values.insert(unknown.symbol, *value);
            }
        }
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

    fn dot(&mut self, a: &[ExprId], b: &[ExprId]) -> ExprId {
        let terms: Vec<ExprId> = a.iter().zip(b).map(|(x, y)| self.g.mul(*x, *y)).collect();
        self.g.sum(&terms)
    }

    /// `<p, [e_alpha, e_beta]>`.
    fn lie_poisson(&mut self) -> Vec<Vec<ExprId>> {
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
    fn anchor_of(&mut self, section: &[ExprId]) -> Vec<ExprId> {
        let algebroid = &self.equations.system.algebroid;
        let rows = 0..algebroid.n_base();
        rows.map(|i| {
            let row: Vec<ExprId> = (0..algebroid.rank()).map(|alpha| algebroid.anchor(i, alpha)).collect();
            self.dot(&row, section)
        })
        .collect()
    }

    /// The derivative of an expression in raw velocities along a vector of the base, at fixed velocities.
    fn along(&mut self, e: ExprId, direction: &[ExprId]) -> Result<ExprId, Error> {
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
    fn by_time(&mut self, e: ExprId) -> Result<ExprId, Error> {
        let slope = self.g.diff(e, self.equations.system.time);
        self.replace(slope)
    }

    /// `F + N p`: forces, and the drift of the frame.
    fn forces(&mut self) -> Result<Vec<ExprId>, Error> {
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

    fn momentum_form(&mut self) -> Result<MomentumForm, Error> {
        match &self.equations.system.constraint {
            KinematicConstraint::Solved(solved) => self.of_solved(solved),
            KinematicConstraint::Multipliers { .. } => self.of_projection(),
        }
    }

    /// The bracket along the columns of `Psi`:
    ///
    /// ```text
    /// R_x = rho psi0,   R_b = W_b F + <p, dW_b/dt + N W_b> - <p, [W_b, psi0]>
    /// ```
    fn of_solved(&mut self, solved: &SolvedConstraint) -> Result<MomentumForm, Error> {
        let (m, k) = (self.momentum.len(), solved.unknowns.len());
        let is_hamiltonian = self.equations.system.hamiltonian.is_some();
        let sections: Vec<Vec<ExprId>> =
            (0..k).map(|a| solved.psi.iter().map(|row| row[a]).collect()).collect();
        let velocities: Vec<ExprId> = (0..m).map(|alpha| solved.velocity(self.g, alpha)).collect();
        let structure = self.lie_poisson();
        self.writer.begin("brackets {x, pi} = rho W");
        let anchors: Vec<Vec<ExprId>> = sections.iter().map(|w| self.anchor_of(w)).collect();
        let mut momenta = vec![vec![self.g.zero(); k]; k];
        let mut turning = vec![vec![self.g.zero(); k]; k];
        // <p, rho(W_a) W_b>, and rho(W_a) p_alpha with the velocities that the constraint determines.
        let mut turned_sections = momenta.clone();
        let along_p = |b: &mut Self, direction: &[ExprId]| -> Result<Vec<ExprId>, Error> {
            let mut changes = Vec::new();
            for y in &velocities {
                changes.push(b.along(*y, direction)?);
            }
            let mut slopes = Vec::new();
            for alpha in 0..m {
                let explicit = b.along(b.raw_momentum[alpha], direction)?;
                let row = b.hessian[alpha].clone();
                let implicit = b.dot(&row, &changes);
                slopes.push(b.g.add(explicit, implicit));
            }
            Ok(slopes)
        };
        let on_p = |b: &mut Self, section: &[ExprId]| {
            let momentum = b.momentum.clone();
            b.dot(section, &momentum)
        };
        for a in 0..k {
            let slopes = if is_hamiltonian { Vec::new() } else { along_p(self, &anchors[a])? };
            for b in 0..k {
                let mut turned = Vec::new();
                for e in &sections[b] {
                    turned.push(self.along(*e, &anchors[a])?);
                }
                turned_sections[a][b] = on_p(self, &turned);
                let change = self.dot(&sections[b], &slopes);
                turning[a][b] = self.g.add(turned_sections[a][b], change);
            }
        }
        self.writer.begin("brackets {pi_a, pi_b} = -<p, [W_a, W_b]>");
        for a in 0..k {
            for b in a + 1..k {
                let algebraic = self.bilinear(&structure, &sections[a], &sections[b]);
                let plus = self.g.neg(algebraic);
                let minus = self.g.neg(turned_sections[a][b]);
                let sum = self.g.sum(&[plus, minus, turned_sections[b][a]]);
                let [first, second] = [a, b].map(|a| &solved.unknowns[a].name);
                let named = self.writer.define(self.g, &format!("c_{first}_{second}"), sum);
                momenta[a][b] = named;
                momenta[b][a] = self.g.neg(named);
            }
        }
        let forces = self.forces()?;
        let psi0 = &solved.psi0;
        let along_x = self.anchor_of(psi0);
        let is_affine = psi0.iter().any(|e| *e != self.g.zero());
        let (mut along_pi, mut lag) = (Vec::new(), Vec::new());
        let drift_of_p = if is_hamiltonian { Vec::new() } else { along_p(self, &along_x)? };
        for b in 0..k {
            let w = &sections[b];
            let mut by_time = Vec::new();
            let mut turned = Vec::new();
            for e in w {
                by_time.push(self.by_time(*e)?);
                turned.push(self.along(*e, &along_x)?);
            }
            let by_time = on_p(self, &by_time);
            let turned = on_p(self, &turned);
            let mut terms = vec![self.dot(w, &forces), by_time, turned];
            if is_affine {
                let algebraic = self.bilinear(&structure, w, psi0);
                terms.push(self.g.neg(algebraic));
                let mut along_psi0 = Vec::new();
                for e in psi0 {
                    along_psi0.push(self.along(*e, &anchors[b])?);
                }
                let along_psi0 = on_p(self, &along_psi0);
                terms.push(self.g.neg(along_psi0));
            }
            along_pi.push(self.g.sum(&terms));
            // d pi_b at fixed u, along R_x and time.
            let mut terms = vec![by_time, turned, self.dot(w, &drift_of_p)];
            if !is_hamiltonian {
                for (alpha, w) in w.iter().enumerate() {
                    let explicit = self.by_time(self.raw_momentum[alpha])?;
                    terms.push(self.g.mul(*w, explicit));
                    for (beta, y) in velocities.iter().enumerate() {
                        let change = self.by_time(*y)?;
                        terms.push(self.g.product(&[*w, self.hessian[alpha][beta], change]));
                    }
                }
            }
            lag.push(self.g.sum(&terms));
        }
        let moving_energy = on_p(self, psi0);
        let anchor = (0..along_x.len()).map(|i| anchors.iter().map(|v| v[i]).collect()).collect();
        Ok(MomentumForm { anchor, momenta, turning, remainder: [along_x, along_pi], lag, moving_energy })
    }

    fn bilinear(&mut self, matrix: &[Vec<ExprId>], a: &[ExprId], b: &[ExprId]) -> ExprId {
        let mut terms = Vec::new();
        for (row, x) in matrix.iter().zip(a) {
            if *x != self.g.zero() {
                let sum = self.dot(row, b);
                terms.push(self.g.mul(*x, sum));
            }
        }
        self.g.sum(&terms)
    }

    /// The bracket of `p o P`, `P(x, p) = p - a^T S^-1 psi` with `psi_A = a_A y + b_A`, `S = a L_yy^-1 a^T`:
    ///
    /// ```text
    /// W_a = e_a - a_Aa S^AB n_B,   n_A = L_yy^-1 a_A,   {p_a, p_b} = -<p, [W_a, W_b]_0> + a_Bb G_B(W_a) - a_Ba G_B(W_b)
    /// R_x = -kappa_B rho(n_B),   R_p = W (F + N p + kappa_B (<p, [., n_B]_0> + rho dpsi_B))
    ///       - a^T S^-1 (dpsi(R_x) + dpsi/dt),   kappa = S^-1 b
    /// ```
    ///
    /// with `G(W) = S^-1 dpsi(rho W)` at fixed `p`, and `[,]_0` the bracket of the frame with constant coefficients.
    fn of_projection(&mut self) -> Result<MomentumForm, Error> {
        let system = &self.equations.system;
        let KinematicConstraint::Multipliers { rows, .. } = &system.constraint else {
            return Err(no_bracket("it has no constraint"));
        };
        let (m, n_rows) = (self.momentum.len(), rows.len());
        let names: Vec<String> = system.algebroid.frame().to_vec();
        let mut residuals = Vec::new();
        let mut forms = Vec::new();
        for row in rows {
            let AccelerationSource::Differentiated(residual) = row.source else { continue };
            residuals.push(residual);
            let form = row.one_form.iter().map(|e| self.replace(*e)).collect::<Result<Vec<_>, _>>()?;
            forms.push(form);
        }
        let normals = self.normals(&forms, &names)?;
        self.writer.begin("response S = a n to multipliers");
        let mut response = vec![vec![self.g.zero(); n_rows]; n_rows];
        for a in 0..n_rows {
            for b in a..n_rows {
                let sum = self.dot(&forms[a], &normals[b]);
                let named = self.define(&format!("S_{}_{}", a + 1, b + 1), sum);
                (response[a][b], response[b][a]) = (named, named);
            }
        }
        let labels: Vec<String> = rows.iter().map(|r| format!("lambda_{}", r.name)).collect();
        self.writer.begin("factors of S");
        let (g, writer) = (&mut *self.g, &mut self.writer);
        let factors = Factorisation::new(g, writer, "S", &response, &labels, &system.signs, &[])?;
        // S^-1 of a vector that is indexed by the constraints.
        let solved = |b: &mut Self, stem: &str, right: &[ExprId]| -> Vec<ExprId> {
            let labels: Vec<String> = rows.iter().map(|r| format!("{stem}_{}", r.name)).collect();
            factors.solve(b.g, &mut b.writer, &labels, right)
        };
        self.writer.begin("sections W = e - a S^-1 n");
        let mut raised = vec![vec![self.g.zero(); m]; n_rows];
        for alpha in 0..m {
            let column: Vec<ExprId> = normals.iter().map(|n| n[alpha]).collect();
            for (a, e) in solved(self, &format!("n_{}", names[alpha]), &column).into_iter().enumerate() {
                raised[a][alpha] = e;
            }
        }
        let mut sections = vec![vec![self.g.zero(); m]; m];
        for a in 0..m {
            for alpha in 0..m {
                let mut terms = if a == alpha { vec![self.g.one()] } else { Vec::new() };
                for (form, raised) in forms.iter().zip(&raised) {
                    let product = self.g.mul(form[a], raised[alpha]);
                    terms.push(self.g.neg(product));
                }
                let sum = self.g.sum(&terms);
                sections[a][alpha] = self.define(&format!("W_{}_{}", names[a], names[alpha]), sum);
            }
        }
        let structure = self.lie_poisson();
        self.writer.begin("brackets {x, p} = rho W");
        let mut anchors = Vec::new();
        for a in 0..m {
            let section = sections[a].clone();
            let anchor = self.anchor_of(&section);
            let base = system.algebroid.base().to_vec();
            let named = anchor.into_iter().zip(base).map(|(e, x)| {
                let name = format!("rho_{}_{}", self.g.name(x), names[a]);
                self.define(&name, e)
            });
            anchors.push(named.collect::<Vec<_>>());
        }
        let mut turning = vec![vec![self.g.zero(); m]; m];
        let mut slopes = Vec::new();
        self.writer.begin("brackets {p_a, p_b}");
        for a in 0..m {
            for b in 0..m {
                if system.hamiltonian.is_none() {
                    let turned = self.along(self.raw_momentum[b], &anchors[a])?;
                    turning[a][b] = self.define(&format!("d_{}_p_{}", names[a], names[b]), turned);
                }
            }
            let changes = self.changes(&residuals, &normals, &forms, &anchors[a], &turning[a])?;
            slopes.push(solved(self, &format!("g_{}", names[a]), &changes));
        }
        let mut momenta = vec![vec![self.g.zero(); m]; m];
        for a in 0..m {
            for b in a + 1..m {
                let algebraic = self.bilinear(&structure, &sections[a], &sections[b]);
                let mut terms = vec![self.g.neg(algebraic)];
                for (form, k) in forms.iter().zip(0..) {
                    terms.push(self.g.mul(form[b], slopes[a][k]));
                    let product = self.g.mul(form[a], slopes[b][k]);
                    terms.push(self.g.neg(product));
                }
                let sum = self.g.sum(&terms);
                let named = self.define(&format!("c_{}_{}", names[a], names[b]), sum);
                momenta[a][b] = named;
                momenta[b][a] = self.g.neg(named);
            }
        }
        let [along_x, along_pi, lag] =
            self.remainder_of_projection(&residuals, &forms, &normals, &sections, &structure, &solved)?;
        let anchor = (0..system.algebroid.n_base()).map(|i| anchors.iter().map(|v| v[i]).collect()).collect();
        let moving_energy = self.g.zero();
        Ok(MomentumForm { anchor, momenta, turning, remainder: [along_x, along_pi], lag, moving_energy })
    }

    /// `n_A = L_yy^-1 a_A`.
    fn normals(&mut self, forms: &[Vec<ExprId>], names: &[String]) -> Result<Vec<Vec<ExprId>>, Error> {
        let hessian = self.hessian.clone();
        if self.equations.system.hamiltonian.is_some() {
            let mut normals = Vec::new();
            for form in forms {
                let mut normal = Vec::new();
                for row in &hessian {
                    let row = row.iter().map(|e| self.replace(*e)).collect::<Result<Vec<_>, _>>()?;
                    normal.push(self.dot(&row, form));
                }
                normals.push(normal);
            }
            return Ok(normals);
        }
        self.writer.begin("factors of M = L_yy");
        let (g, writer) = (&mut *self.g, &mut self.writer);
        let signs = &self.equations.system.signs;
        let factors = Factorisation::new(g, writer, "M", &hessian, names, signs, &[])?;
        self.writer.begin("normals n = M^-1 a");
        let solve = |(k, form): (usize, &Vec<ExprId>)| {
            let labels: Vec<String> = names.iter().map(|n| format!("n{}_{n}", k + 1)).collect();
            factors.solve(self.g, &mut self.writer, &labels, form)
        };
        Ok(forms.iter().enumerate().map(solve).collect())
    }

    /// `dpsi_A` along a vector of the base at fixed momenta, of which `turned` are the changes at fixed velocities.
    fn changes(
        &mut self,
        residuals: &[ExprId],
        normals: &[Vec<ExprId>],
        forms: &[Vec<ExprId>],
        direction: &[ExprId],
        turned: &[ExprId],
    ) -> Result<Vec<ExprId>, Error> {
        let mut changes = Vec::new();
        for (k, residual) in residuals.iter().enumerate() {
            let explicit = self.along(*residual, direction)?;
            let implicit = match &self.equations.system.hamiltonian {
                Some(hamiltonian) => {
                    let mut terms = Vec::new();
                    for (p, form) in hamiltonian.momenta.iter().zip(&forms[k]) {
                        let y = self.g.diff(hamiltonian.h, *p);
                        let change = self.along(y, direction)?;
                        terms.push(self.g.mul(*form, change));
                    }
                    self.g.sum(&terms)
                }
                None => {
                    let sum = self.dot(&normals[k], turned);
                    self.g.neg(sum)
                }
            };
            changes.push(self.g.add(explicit, implicit));
        }
        Ok(changes)
    }

    /// `R_x`, `R_p` and the lag.
    fn remainder_of_projection(
        &mut self,
        residuals: &[ExprId],
        forms: &[Vec<ExprId>],
        normals: &[Vec<ExprId>],
        sections: &[Vec<ExprId>],
        structure: &[Vec<ExprId>],
        solved: &dyn Fn(&mut Self, &str, &[ExprId]) -> Vec<ExprId>,
    ) -> Result<[Vec<ExprId>; 3], Error> {
        let system = &self.equations.system;
        let is_hamiltonian = system.hamiltonian.is_some();
        let m = self.momentum.len();
        self.writer.begin("remainder R");
        let at_rest: BTreeMap<SymbolId, ExprId> =
            system.velocities.iter().map(|y| (*y, self.g.zero())).collect();
        let mut offsets = Vec::new();
        for residual in residuals {
            let offset = self.g.subs(*residual, &at_rest);
            offsets
                .push(offset.map_err(|_| Error::DivisionByZero { place: "the constraint at rest".into() })?);
        }
        let kappa = solved(self, "kappa", &offsets);
        let is_affine = offsets.iter().any(|e| *e != self.g.zero());
        let mut along_x = vec![self.g.zero(); system.algebroid.n_base()];
        for (normal, kappa) in normals.iter().zip(&kappa) {
            for (sum, e) in along_x.iter_mut().zip(self.anchor_of(normal)) {
                let product = self.g.mul(*kappa, e);
                *sum = self.g.sub(*sum, product);
            }
        }
        let mut pushed = self.forces()?;
        for alpha in (0..m).filter(|_| is_affine) {
            let direction: Vec<ExprId> =
                (0..along_x.len()).map(|i| system.algebroid.anchor(i, alpha)).collect();
            let mut turned = vec![self.g.zero(); m];
            if !is_hamiltonian {
                for (b, e) in turned.iter_mut().enumerate() {
                    *e = self.along(self.raw_momentum[b], &direction)?;
                }
            }
            let changes = self.changes(residuals, normals, forms, &direction, &turned)?;
            for ((normal, kappa), change) in normals.iter().zip(&kappa).zip(changes) {
                let algebraic = self.dot(&structure[alpha], normal);
                let sum = self.g.add(algebraic, change);
                let term = self.g.mul(*kappa, sum);
                pushed[alpha] = self.g.add(pushed[alpha], term);
            }
        }
        // Changes of p at fixed velocities, along R_x and with time.
        let (mut turned, mut lag) = (vec![self.g.zero(); m], vec![self.g.zero(); m]);
        let mut by_time = turned.clone();
        if !is_hamiltonian {
            for b in 0..m {
                turned[b] = self.along(self.raw_momentum[b], &along_x)?;
                by_time[b] = self.by_time(self.raw_momentum[b])?;
                lag[b] = self.g.add(turned[b], by_time[b]);
            }
        }
        let mut changes = self.changes(residuals, normals, forms, &along_x, &turned)?;
        for (k, residual) in residuals.iter().enumerate() {
            let explicit = self.by_time(*residual)?;
            let implicit = match &system.hamiltonian {
                Some(hamiltonian) => {
                    let mut terms = Vec::new();
                    for (p, form) in hamiltonian.momenta.iter().zip(&forms[k]) {
                        let y = self.g.diff(hamiltonian.h, *p);
                        let change = self.by_time(y)?;
                        terms.push(self.g.mul(*form, change));
                    }
                    self.g.sum(&terms)
                }
                None => {
                    let sum = self.dot(&normals[k], &by_time);
                    self.g.neg(sum)
                }
            };
            changes[k] = self.g.sum(&[changes[k], explicit, implicit]);
        }
        let reaction = solved(self, "nu", &changes);
        let mut along_p = Vec::new();
        for a in 0..m {
            let mut terms = vec![self.dot(&sections[a], &pushed)];
            for (form, reaction) in forms.iter().zip(&reaction) {
                let product = self.g.mul(form[a], *reaction);
                terms.push(self.g.neg(product));
            }
            along_p.push(self.g.sum(&terms));
        }
        Ok([along_x, along_p, lag])
    }

    /// `d pi/du`: `A = W^T L_yy Psi`, or `L_yy`.
    fn mass_matrix(&mut self) -> Vec<Vec<ExprId>> {
        let hessian = self.hessian.clone();
        let KinematicConstraint::Solved(solved) = &self.equations.system.constraint else { return hessian };
        let k = solved.unknowns.len();
        self.writer.begin("mass matrix A = W^T L_yy Psi");
        let columns: Vec<Vec<ExprId>> =
            (0..k).map(|a| solved.psi.iter().map(|row| row[a]).collect()).collect();
        let mut matrix = vec![vec![self.g.zero(); k]; k];
        for b in 0..k {
            for a in b..k {
                let value = self.bilinear(&hessian, &columns[b], &columns[a]);
                let [first, second] = [b, a].map(|a| &solved.unknowns[a].name);
                let named = self.writer.define(self.g, &format!("A_{first}_{second}"), value);
                (matrix[b][a], matrix[a][b]) = (named, named);
            }
        }
        matrix
    }

    /// From momenta to the coordinates of the state:
    ///
    /// ```text
    /// A {u, x} = {pi, x},   A {u, pi_b} = {pi, pi_b} - rho(W_b) pi,
    /// A {u, u} A^T = {pi_a, pi_b} + rho(W_a) pi_b - rho(W_b) pi_a,   A R_u = R_pi - d pi(R_x) - d pi/dt
    /// ```
    fn on_state(&mut self, form: &MomentumForm) -> Result<Bracket, Error> {
        let system = &self.equations.system;
        let k = system.unknowns.len();
        let (n, zero) = (self.equations.state.len(), self.g.zero());
        let kinds: Vec<StateKind> = system.state.iter().map(|(kind, _)| *kind).collect();
        let carries_velocities = kinds.iter().any(|kind| matches!(kind, StateKind::Unknown(_)));
        let mut of_velocities = Vec::new();
        let mut mixed = Vec::new();
        let mut by_x = Vec::new();
        let mut rates = Vec::new();
        if carries_velocities {
            let matrix = self.mass_matrix();
            let names: Vec<String> = system.unknowns.iter().map(|u| u.name.clone()).collect();
            self.writer.begin("factors of A");
            let (g, writer) = (&mut *self.g, &mut self.writer);
            let factors = Factorisation::new(g, writer, "A", &matrix, &names, &system.signs, &[])?;
            let solve = |b: &mut Self, stem: &str, right: &[ExprId]| -> Vec<ExprId> {
                let labels: Vec<String> = names.iter().map(|name| format!("{stem}_{name}")).collect();
                factors.solve(b.g, &mut b.writer, &labels, right)
            };
            self.writer.begin("brackets {u, x} = A^-1 {pi, x}");
            let base = system.algebroid.base().to_vec();
            for (row, x) in form.anchor.iter().zip(base) {
                let right: Vec<ExprId> = row.iter().map(|e| self.g.neg(*e)).collect();
                let name = format!("u_{}", self.g.name(x));
                by_x.push(solve(self, &name, &right));
            }
            if kinds.iter().any(|kind| matches!(kind, StateKind::Momentum { .. })) {
                self.writer.begin("brackets {u, pi}");
                for b in 0..k {
                    let right: Vec<ExprId> =
                        (0..k).map(|c| self.g.sub(form.momenta[c][b], form.turning[b][c])).collect();
                    mixed.push(solve(self, &format!("u_pi_{}", names[b]), &right));
                }
            }
            self.writer.begin("brackets {u, u} = A^-1 ({pi_a, pi_b} + rho(W_a) pi_b - rho(W_b) pi_a) A^-T");
            let mut columns = Vec::new();
            for b in 0..k {
                let mut right = Vec::new();
                for a in 0..k {
                    let back = self.g.neg(form.turning[b][a]);
                    let sum = self.g.sum(&[form.momenta[a][b], form.turning[a][b], back]);
                    let (first, second) = (&names[a.min(b)], &names[a.max(b)]);
                    right.push(match a.cmp(&b) {
                        std::cmp::Ordering::Equal => zero,
                        std::cmp::Ordering::Less => self.define(&format!("k_{first}_{second}"), sum),
                        std::cmp::Ordering::Greater => {
                            let back = self.g.neg(sum);
                            let named = self.define(&format!("k_{first}_{second}"), back);
                            self.g.neg(named)
                        }
                    });
                }
                columns.push(solve(self, &format!("k_{}", names[b]), &right));
            }
            // A^-1 on row a of A^-1 K gives row a of A^-1 K A^-T.
            for a in 0..k {
                let row: Vec<ExprId> = columns.iter().map(|column| column[a]).collect();
                of_velocities.push(solve(self, &format!("u_{}", names[a]), &row));
            }
            self.writer.begin("remainder R along velocities");
            let right: Vec<ExprId> =
                form.remainder[1].iter().zip(&form.lag).map(|(r, lag)| self.g.sub(*r, *lag)).collect();
            rates = solve(self, "r", &right);
        }
        let unknown_of = |place: usize| system.momenta[place].unknown;
        let mut entries = Vec::new();
        for i in 0..n {
            for j in i + 1..n {
                use StateKind::{Base, Momentum, Unknown};
                let value = match (kinds[i], kinds[j]) {
                    (Base(_), Base(_)) => zero,
                    (Base(x), Momentum { place, .. }) => form.anchor[x][unknown_of(place)],
                    (Momentum { place, .. }, Base(x)) => self.g.neg(form.anchor[x][unknown_of(place)]),
                    (Base(x), Unknown(a)) => self.g.neg(by_x[x][a]),
                    (Unknown(a), Base(x)) => by_x[x][a],
                    (Momentum { place: a, .. }, Momentum { place: b, .. }) => {
                        form.momenta[unknown_of(a)][unknown_of(b)]
                    }
                    (Unknown(a), Momentum { place, .. }) => mixed[unknown_of(place)][a],
                    (Momentum { place, .. }, Unknown(a)) => self.g.neg(mixed[unknown_of(place)][a]),
                    (Unknown(a), Unknown(b)) => of_velocities[a][b],
                };
                let value = self.g.cancel_zero(value);
                if value != zero {
                    entries.push((i, j, value));
                }
            }
        }
        let remainder = kinds.iter().map(|kind| match *kind {
            StateKind::Base(x) => form.remainder[0][x],
            StateKind::Unknown(a) => rates[a],
            StateKind::Momentum { place, .. } => form.remainder[1][unknown_of(place)],
        });
        let remainder: Vec<ExprId> = remainder.collect();
        let mut bracket = Bracket { entries, remainder, sections: Vec::new() };
        if form.moving_energy != zero {
            self.take_moving_energy(form.moving_energy, &mut bracket);
        }
        bracket.remainder = bracket.remainder.iter().map(|e| self.g.cancel_zero(*e)).collect();
        self.g.within_budget()?;
        bracket.sections = std::mem::take(&mut self.writer).finish().0;
        Ok(bracket)
    }

    /// `R - Pi d<p, psi0>`: the energy is that of the velocities `Psi u` and `<p, psi0>`.
    fn take_moving_energy(&mut self, moving_energy: ExprId, bracket: &mut Bracket) {
        let by: Vec<SymbolId> = self.equations.state.iter().map(|s| s.symbol).collect();
        let own = self.writer.clone().finish().0;
        let all: Vec<Section> = self.equations.sections.iter().cloned().chain(own).collect();
        let sections = needed_sections(self.g, &all, &[moving_energy]);
        let linear = Linearisation::new(self.g, &sections, &[moving_energy], &by);
        let name = |v: &str, x: &str| format!("d_{v}_d_{x}");
        let title = |section: &str| format!("derivatives of: {section}");
        let slopes = linear.jacobian(self.g, &mut self.writer, name, title).remove(0);
        let matrix = bracket.matrix(self.g);
        for (r, row) in bracket.remainder.iter_mut().zip(&matrix) {
            let terms: Vec<ExprId> =
                row.iter().zip(&slopes).map(|(e, slope)| self.g.mul(*e, *slope)).collect();
            let sum = self.g.sum(&terms);
            *r = self.g.sub(*r, sum);
        }
    }
}
