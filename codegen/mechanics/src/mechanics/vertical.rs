//! The vertical and horizontal equations of motion in the adapted basis of a chain of stages, as expressions that can
//! be shown and checked.
//!
//! They are written from the stage forms, and then compared with the motion that was derived without them.
//!
//! Deliberately does not know: how stage forms come about, how anything is printed.

use std::collections::BTreeMap;

use crate::reduction::{KinematicConstraint, ReducedSystem, Stages};
use hamel_expr::{Definition, ExprId, Graph, SymbolId};
use hamel_lang::algebra::tableau::{Judge, Tableau};
use hamel_lang::spec::Side;

use super::curvature::ConnectionName;
use super::equations::Equations;
use super::pairings::{Pairing, PairingKind, Pairings};

/// The equations of motion along the vertical displacements that the constraint allows, by stages.
///
/// With `f_k` the adapted basis, `eta` the components of the group velocity `xi = v - A(x) xdot` in it and
/// `beta_k = <dL/dv, f_k>`, the equation along `s = s^k f_k` is
///
/// `s^k (betadot_k - right_k(eta, beta) - tau_k) = 0`, `tau_k = <rho(f_k), dL/da> + <F, f_k>`,
///
/// where `right_k` is [`Stages::vertical_equations`], with the other sign for a right action, and `<beta, df_k/dt>`
/// where the adapted basis turns with shape or time. Where multipliers keep the constraint there is one equation for
/// each `f_k`, with the reactions `lambda_A <a_A, f_k>` on its right side.
///
/// The other displacements that the constraint allows have a part `d^i` along the shape. With `D_i` the horizontal
/// lifts and `p_i = dL/dxdot^i`, the equation along `d + s` has, beside the terms of `s`,
///
/// `d^i (pdot_i - <beta, [y, D_i] + [d/dt, D_i]> - tau_i)`, `tau_i = <rho(D_i), dL> + <F, D_i>`,
///
/// in which `[D_i, D_j]` is minus the curvature of the connection.
///
/// # Source
/// Cendra, Diaz, equations (32) and (43), every slot's momentum differentiated and summed over; section 4 for
/// `eta - A`.
#[derive(Clone, Debug)]
pub struct VerticalEquations {
    /// Owner of the expressions here: the graph of the equations and more.
    pub graph: Graph,
    /// The connection along the adapted basis, where the model has one and the frame is its own.
    pub along_shape: ShapeConnection,
    /// The parts of the equations that have names.
    pub pairings: Vec<Pairing>,
    /// `eta_k`, by the velocities of the model.
    pub velocities: Vec<Definition>,
    /// `beta_k`, by the momenta `p`.
    pub momenta: Vec<Definition>,
    /// `tau_k`, where it does not vanish.
    pub applied: Vec<Definition>,
    /// One for each element of a basis of the allowed vertical displacements, none where there are no such.
    pub rows: Vec<VerticalEquation>,
    /// `p_i`, by the velocities.
    pub shape_momenta: Vec<Definition>,
    /// `tau_i`, where it does not vanish.
    pub shape_applied: Vec<Definition>,
    /// One for each element of a basis of the allowed displacements modulo the vertical ones.
    pub horizontal: Vec<HorizontalEquation>,
    /// Whether reactions of the constraint are in the equations.
    pub has_multipliers: bool,
    /// The velocities of the system; velocities that the constraint determines have names that zero tests see
    /// through.
    pub frame_velocities: Vec<ExprId>,
}

/// A connection and its curvature along the adapted basis, by names; nothing without one.
#[derive(Clone, Debug, Default)]
pub struct ShapeConnection {
    /// The names of `A^k_i`, where they are worth one.
    pub connection: Vec<ConnectionName>,
    /// The names of `B^k_ij`.
    pub curvature: Vec<ConnectionName>,
    /// `A_i`, by coordinate.
    pub coefficients: Vec<Vec<ExprId>>,
    /// `B_ij`, by pairs `i < j`.
    pub curved: Vec<((usize, usize), Vec<ExprId>)>,
}

/// One equation `left = right`.
#[derive(Clone, Debug)]
pub struct VerticalEquation {
    /// Components `s^k` of the displacement in the adapted basis.
    pub displacement: Vec<ExprId>,
    /// `s^k betadot_k`, in symbols that stand for the rates of the momenta.
    pub left: ExprId,
    /// What it is equal to.
    pub right: ExprId,
}

/// One equation along a displacement that moves the shape.
#[derive(Clone, Debug)]
pub struct HorizontalEquation {
    /// Components `d^i` along the horizontal lifts.
    pub shape: Vec<ExprId>,
    /// The rest of it, and the equation with its terms.
    pub equation: VerticalEquation,
}

impl VerticalEquations {
    /// The equations of a system with stages; none without stages, and where some equation is not seen to be that of
    /// the motion.
    ///
    /// Every symbol stands for its value along the motion, so that `left - right` vanishes identically.
    pub fn new(equations: &Equations) -> Option<VerticalEquations> {
        let system = &equations.system;
        // Written in velocities of a Lagrangian.
        if system.hamiltonian.is_some() || !system.momenta.is_empty() {
            return None;
        }
        let stages = system.stages.as_ref()?;
        let mut writer = Writer::new(equations, stages);
        let mut pairings = Pairings::default();
        let shape = writer.shape_of_connection();
        let velocities = writer.velocities(&shape);
        let p = writer.frame_momenta()?;
        let (momenta, rates) = writer.momenta(&p);
        let (shape_momenta, shape_rates) = writer.shape_momenta(&p);
        let right = writer.right_sides(&velocities, &momenta, &mut pairings);
        let shape_right = writer.horizontal_sides((&velocities, &momenta), &shape, &mut pairings);
        let (applied, mut right) = writer.applied(right)?;
        let (shape_applied, mut shape_right) = writer.shape_applied(shape_right)?;
        let n = writer.n;
        let ((vertical, others), has_multipliers) = match &system.constraint {
            KinematicConstraint::Solved(_) => (writer.allowed()?, false),
            KinematicConstraint::Multipliers { reactions, .. } => {
                writer.react(reactions, [&mut shape_right, &mut right])?;
                let (g, r) = (&writer.g, right.len());
                let zeros = vec![g.zero(); r];
                let others = unit_vectors(g, n).into_iter().map(|shape| (shape, zeros.clone()));
                ((unit_vectors(g, r), others.collect()), !reactions.is_empty())
            }
        };
        let frame_velocities = writer.frame_velocities();
        let mut g = writer.g;
        let zeros = vec![g.zero(); n];
        let along = |g: &mut Graph, shape: &[ExprId], displacement: Vec<ExprId>| {
            let contract = |g: &mut Graph, of_shape: &[ExprId], with: &[ExprId]| {
                let pairs = shape.iter().zip(of_shape).chain(displacement.iter().zip(with));
                let terms: Vec<ExprId> = pairs.map(|(s, e)| g.mul(*s, *e)).collect();
                g.sum(&terms)
            };
            let (left, right) = (contract(g, &shape_rates, &rates), contract(g, &shape_right, &right));
            g.is_equal(left, right).then_some(VerticalEquation { displacement, left, right })
        };
        let mut rows = Vec::new();
        for displacement in vertical {
            rows.push(along(&mut g, &zeros, displacement)?);
        }
        let mut horizontal = Vec::new();
        for (shape, displacement) in others {
            let equation = along(&mut g, &shape, displacement)?;
            horizontal.push(HorizontalEquation { shape, equation });
        }
        Some(VerticalEquations {
            graph: g,
            along_shape: shape,
            pairings: pairings.list,
            velocities,
            momenta,
            applied,
            rows,
            shape_momenta,
            shape_applied,
            horizontal,
            has_multipliers,
            frame_velocities,
        })
    }
}

/// `stem` followed by underscores and `stage` until no name is that with digits behind it.
pub fn unused_stem(equations: &Equations, stem: &str) -> String {
    let mut stem = stem.to_owned();
    while is_taken(equations, &stem) {
        stem.push_str("_stage");
    }
    stem
}

fn is_taken(equations: &Equations, stem: &str) -> bool {
    let g = &equations.system.graph;
    let params = equations.system.params.iter().map(|p| p.name.as_str());
    let definitions = equations.sections.iter().flat_map(|s| &s.definitions).map(|d| g.name(d.symbol));
    let state = equations.state.iter().chain(&equations.reconstruction).map(|s| s.name.as_str());
    let frame = equations.system.algebroid.frame().iter().map(String::as_str);
    let mut names = params.chain(definitions).chain(state).chain(frame);
    names.any(|name| name.strip_prefix(stem).is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit())))
}

pub(super) fn unit_vectors(g: &Graph, n: usize) -> Vec<Vec<ExprId>> {
    (0..n).map(|i| (0..n).map(|j| if i == j { g.one() } else { g.zero() }).collect()).collect()
}

/// The parts of a virtual displacement along the base and in the adapted basis.
type Displacement = (Vec<ExprId>, Vec<ExprId>);

struct Writer<'a> {
    equations: &'a Equations,
    system: &'a ReducedSystem,
    stages: &'a Stages,
    g: Graph,
    /// The adapted basis and its inverse in the frame of the system, of which they are the sections themselves where
    /// that frame is the adapted one.
    basis: Vec<Vec<ExprId>>,
    inverse: Vec<Vec<ExprId>>,
    /// Number of base velocities in front of those of the algebra.
    n: usize,
    /// Velocities that the constraint determines, as symbols of the same names that zero tests see through.
    named: BTreeMap<SymbolId, ExprId>,
    /// The same, written in the unknowns.
    solved: BTreeMap<SymbolId, ExprId>,
}

impl<'a> Writer<'a> {
    fn new(equations: &'a Equations, stages: &'a Stages) -> Writer<'a> {
        let system = &equations.system;
        let mut g = system.graph.clone();
        let (mut named, mut solved) = (BTreeMap::new(), BTreeMap::new());
        if let KinematicConstraint::Solved(constraint) = &system.constraint {
            for &k in &constraint.dependent {
                let value = constraint.velocity(&mut g, k);
                let symbol = g.define(&system.algebroid.frame()[k], value);
                named.insert(system.velocities[k], g.sym(symbol));
                solved.insert(system.velocities[k], value);
            }
        }
        let n = system.velocities.len() - stages.basis.len();
        let (basis, inverse) = match system.frame {
            Some(_) => (unit_vectors(&g, stages.basis.len()), unit_vectors(&g, stages.basis.len())),
            None => (stages.basis.clone(), stages.inverse.clone()),
        };
        Writer { equations, system, stages, g, basis, inverse, n, named, solved }
    }

    fn symbols(&mut self, stem: &str, values: &[ExprId]) -> Vec<SymbolId> {
        let stem = unused_stem(self.equations, stem);
        values.iter().enumerate().map(|(k, e)| self.g.define(&format!("{stem}{}", k + 1), *e)).collect()
    }

    fn frame_velocities(&mut self) -> Vec<ExprId> {
        let own = self.system.velocities.iter();
        own.map(|s| self.named.get(s).copied().unwrap_or_else(|| self.g.sym(*s))).collect()
    }

    /// The connection and its curvature along the adapted basis, by names; nothing in another frame.
    fn shape_of_connection(&mut self) -> ShapeConnection {
        let mut shape = ShapeConnection::default();
        let is_own = self.system.frame.is_none() && self.system.quasi_frame.is_none();
        let Some(rows) = self.system.connection.as_ref().filter(|_| is_own) else { return shape };
        let base: Vec<SymbolId> = self.system.algebroid.base()[..self.n].to_vec();
        let is_standard = self.basis == unit_vectors(&self.g, self.basis.len());
        let stems = if is_standard { ["A", "B"] } else { ["Af", "Bf"] };
        for (i, x) in base.iter().enumerate() {
            let column: Vec<ExprId> = rows.iter().map(|row| row[i]).collect();
            let of = (stems[0], &[*x][..]);
            shape.coefficients.push(self.adapted(&column, &mut shape.connection, of));
        }
        for i in 0..self.n {
            for j in i + 1..self.n {
                let mut column = vec![self.g.zero(); rows.len()];
                for (c, value) in self.system.algebroid.bracket(&mut self.g, i, j) {
                    column[c - self.n] = self.g.neg(value);
                }
                let of = (stems[1], &[base[i], base[j]][..]);
                let value = self.adapted(&column, &mut shape.curvature, of);
                shape.curved.push(((i, j), value));
            }
        }
        shape
    }

    /// A vector of the algebra along the adapted basis, by names where they are worth it.
    fn adapted(
        &mut self,
        vector: &[ExprId],
        list: &mut Vec<ConnectionName>,
        (stem, coordinates): (&'static str, &[SymbolId]),
    ) -> Vec<ExprId> {
        let mut components = Vec::with_capacity(vector.len());
        for k in 0..vector.len() {
            let column: Vec<ExprId> = self.inverse.iter().map(|row| row[k]).collect();
            let sum = self.g.dot(vector, &column);
            let expr = self.g.cancel_zero(sum);
            components.push(ConnectionName::of(&mut self.g, list, (stem, k), (coordinates, expr)));
        }
        components
    }

    /// `eta_k = inverse[a][k] (v^a - A^a_i xdot^i)`.
    fn velocities(&mut self, shape: &ShapeConnection) -> Vec<Definition> {
        let xi = self.system.group_velocity(&mut self.g, self.n);
        let g = &mut self.g;
        let along = |g: &mut Graph, vector: &[ExprId], k: usize| {
            let column: Vec<ExprId> = self.stages.inverse.iter().map(|row| row[k]).collect();
            g.dot(vector, &column)
        };
        let eta: Vec<ExprId> = (0..xi.len()).map(|k| along(g, &xi, k)).collect();
        // By the names of the connection, which read the same.
        let mut shown = eta.clone();
        if !shape.coefficients.is_empty() {
            let y: Vec<ExprId> = self.system.velocities.iter().map(|s| g.sym(*s)).collect();
            for (k, shown) in shown.iter_mut().enumerate() {
                let mut terms = vec![along(g, &y[self.n..], k)];
                for (column, xdot) in shape.coefficients.iter().zip(&y) {
                    let product = g.mul(column[k], *xdot);
                    terms.push(g.neg(product));
                }
                *shown = g.sum(&terms);
            }
        }
        // A linear change of variables divides by nothing that the constraint could make zero.
        let values: Vec<ExprId> = eta.iter().map(|e| g.subs(*e, &self.named).unwrap_or(*e)).collect();
        let symbols = self.symbols("eta", &values);
        symbols.into_iter().zip(shown).map(|(symbol, expr)| Definition { symbol, expr }).collect()
    }

    /// Momenta `dL/dy` along the frame of the system, and their rates.
    fn frame_momenta(&mut self) -> Option<Vec<(ExprId, ExprId)>> {
        let mut momenta = Vec::new();
        for (v, name) in self.system.velocities.iter().zip(self.system.algebroid.frame()) {
            let raw = self.g.diff(self.system.lagrangian, *v);
            let value = self.g.subs(raw, &self.named).ok()?;
            let symbol = self.g.define(&format!("p_{name}"), value);
            let free = self.g.subs(raw, &self.solved).ok()?;
            momenta.push((self.g.sym(symbol), self.rate(free)));
        }
        Some(momenta)
    }

    /// `beta_k = basis[k][a] p_a`, and the symbols of their rates.
    fn momenta(&mut self, p: &[(ExprId, ExprId)]) -> (Vec<Definition>, Vec<ExprId>) {
        let (p, slopes): (Vec<ExprId>, Vec<ExprId>) = p[self.n..].iter().copied().unzip();
        let beta: Vec<ExprId> = self.basis.iter().map(|row| self.g.dot(row, &p)).collect();
        let mut turned = Vec::new();
        for row in self.basis.clone() {
            let moved: Vec<ExprId> = row.iter().map(|e| self.rate(*e)).collect();
            let parts = [self.g.dot(&row, &slopes), self.g.dot(&moved, &p)];
            turned.push(self.g.sum(&parts));
        }
        let symbols = self.symbols("beta", &beta);
        let rates = self.rate_symbols(&symbols, turned);
        (symbols.into_iter().zip(beta).map(|(symbol, expr)| Definition { symbol, expr }).collect(), rates)
    }

    /// `p_i`, and the symbols of their rates.
    fn shape_momenta(&mut self, p: &[(ExprId, ExprId)]) -> (Vec<Definition>, Vec<ExprId>) {
        let (p, slopes): (Vec<ExprId>, Vec<ExprId>) = p[..self.n].iter().copied().unzip();
        let symbols: Vec<SymbolId> = (self.system.algebroid.frame()[..self.n].iter().zip(&p))
            .map(|(name, p)| self.g.define(&format!("p_{name}"), *p))
            .collect();
        let rates = self.rate_symbols(&symbols, slopes);
        let values = self.system.velocities[..self.n].iter().map(|v| self.g.diff(self.system.lagrangian, *v));
        let values: Vec<ExprId> = values.collect();
        let values = values.into_iter().map(|e| self.g.subs(e, &self.named).unwrap_or(e));
        (symbols.into_iter().zip(values).map(|(symbol, expr)| Definition { symbol, expr }).collect(), rates)
    }

    fn rate_symbols(&mut self, symbols: &[SymbolId], rates: Vec<ExprId>) -> Vec<ExprId> {
        let names: Vec<String> = symbols.iter().map(|s| format!("dot_{}", self.g.name(*s))).collect();
        let g = &mut self.g;
        let named = names.iter().zip(rates).map(|(name, rate)| {
            let symbol = g.define(name, rate);
            g.sym(symbol)
        });
        named.collect()
    }

    /// The derivative along the motion of a function of time and state.
    fn rate(&mut self, e: ExprId) -> ExprId {
        let mut terms = vec![self.g.diff(e, self.system.time)];
        for variable in &self.equations.state {
            let slope = self.g.diff(e, variable.symbol);
            terms.push(self.g.mul(slope, variable.derivative));
        }
        self.g.sum(&terms)
    }

    /// The stage equations, with `<beta, df_k/dt>` where the basis turns.
    fn right_sides(
        &mut self,
        velocities: &[Definition],
        momenta: &[Definition],
        pairings: &mut Pairings,
    ) -> Vec<ExprId> {
        let g = &mut self.g;
        let [eta, beta] = [velocities, momenta]
            .map(|list| -> Vec<ExprId> { list.iter().map(|d| g.sym(d.symbol)).collect() });
        let right = pairings.of_levels(g, self.stages, (&eta, &beta));
        let right = match self.system.side {
            Side::Left => right,
            Side::Right => right.into_iter().map(|e| g.neg(e)).collect(),
        };
        let mut turned = Vec::new();
        for (k, (element, right)) in self.stages.basis.clone().iter().zip(right).enumerate() {
            let moved: Vec<ExprId> = element.iter().map(|e| self.rate_of_shape(*e)).collect();
            let g = &mut self.g;
            let mut terms = Vec::new();
            for (c, beta) in beta.iter().enumerate() {
                let column: Vec<ExprId> = self.stages.inverse.iter().map(|row| row[c]).collect();
                let along = g.dot(&moved, &column);
                let along = g.cancel_zero(along);
                terms.push(g.mul(along, *beta));
            }
            let turning = pairings.named(g, PairingKind::Turning { element: k }, &terms);
            turned.push(g.add(right, turning));
        }
        turned
    }

    /// The rate of a function of shape and time, by the velocities.
    fn rate_of_shape(&mut self, e: ExprId) -> ExprId {
        let g = &mut self.g;
        let mut terms = vec![g.diff(e, self.system.time)];
        for (i, velocity) in self.system.velocities[..self.n].iter().enumerate() {
            let along = self.system.algebroid.derivative_along(g, i, e);
            let rate = self.named.get(velocity).copied().unwrap_or_else(|| g.sym(*velocity));
            terms.push(g.mul(along, rate));
        }
        g.sum(&terms)
    }

    /// `<beta, [y, D_i] + [d/dt, D_i]>`, the coefficients of the frame in the adapted basis.
    fn horizontal_sides(
        &mut self,
        (velocities, momenta): (&[Definition], &[Definition]),
        shape: &ShapeConnection,
        pairings: &mut Pairings,
    ) -> Vec<ExprId> {
        let y = self.frame_velocities();
        let (g, n, algebroid) = (&mut self.g, self.n, &self.system.algebroid);
        let [eta, beta] = [velocities, momenta]
            .map(|list| -> Vec<ExprId> { list.iter().map(|d| g.sym(d.symbol)).collect() });
        // p_c = inverse[c][k] beta_k.
        let p: Vec<ExprId> = self.inverse.iter().map(|row| g.dot(row, &beta)).collect();
        let mut sides = Vec::new();
        for i in 0..n {
            let (mut curved, mut turned) = (Vec::new(), Vec::new());
            match shape.coefficients.get(i) {
                Some(own) => {
                    for ((j, k), value) in &shape.curved {
                        let along = g.dot(value, &beta);
                        if *j == i {
                            curved.push(g.mul(along, y[*k]));
                        } else if *k == i {
                            let product = g.mul(along, y[*j]);
                            curved.push(g.neg(product));
                        }
                    }
                    let v: Vec<ExprId> = (0..eta.len())
                        .map(|k| {
                            let column: Vec<ExprId> = shape.coefficients.iter().map(|a| a[k]).collect();
                            let along = g.dot(&column, &y[..n]);
                            g.add(eta[k], along)
                        })
                        .collect();
                    let bracket = self.stages.rebuilt_bracket(g, own, &v);
                    let along = g.dot(&bracket, &beta);
                    turned.push(if self.system.side == Side::Right { g.neg(along) } else { along });
                }
                None => {
                    for (k, y) in y.iter().enumerate() {
                        for (c, value) in algebroid.bracket(g, k, i) {
                            let term = g.product(&[value, p[c - n], *y]);
                            if k < n { curved.push(term) } else { turned.push(term) }
                        }
                    }
                }
            }
            let drift = algebroid.drift(i).iter().map(|(c, value)| g.mul(*value, p[*c - n]));
            let drift: Vec<ExprId> = drift.collect();
            let parts = [
                pairings.named(g, PairingKind::ShapeCurvature { coordinate: i }, &curved),
                pairings.named(g, PairingKind::ShapeBracket { coordinate: i }, &turned),
                pairings.named(g, PairingKind::ShapeDrift { coordinate: i }, &drift),
            ];
            sides.push(g.sum(&parts));
        }
        sides
    }

    /// Adds `tau_i = rho^j_i dL/dx^j + F_i`.
    fn shape_applied(&mut self, right: Vec<ExprId>) -> Option<(Vec<Definition>, Vec<ExprId>)> {
        let (mut definitions, mut total) = (Vec::new(), Vec::new());
        for (i, right) in right.into_iter().enumerate() {
            let along = self.system.algebroid.derivative_along(&mut self.g, i, self.system.lagrangian);
            let sum = self.g.add(along, self.system.forces[i]);
            let sum = self.g.subs(sum, &self.named).ok()?;
            let expr = self.g.cancel_zero(sum);
            if expr == self.g.zero() {
                total.push(right);
                continue;
            }
            let name = unused_stem(self.equations, "tau");
            let symbol = self.g.define(&format!("{name}_{}", self.system.algebroid.frame()[i]), expr);
            let named = self.g.sym(symbol);
            total.push(self.g.add(right, named));
            definitions.push(Definition { symbol, expr });
        }
        Some((definitions, total))
    }

    /// Adds `tau_k = basis[k][a] (rho^i_a dL/dx^i + F_a)`.
    fn applied(&mut self, right: Vec<ExprId>) -> Option<(Vec<Definition>, Vec<ExprId>)> {
        let mut generalised = Vec::new();
        for alpha in self.n..self.system.velocities.len() {
            let along = self.system.algebroid.derivative_along(&mut self.g, alpha, self.system.lagrangian);
            let sum = self.g.add(along, self.system.forces[alpha]);
            generalised.push(self.g.subs(sum, &self.named).ok()?);
        }
        let mut tau = Vec::new();
        for row in &self.basis {
            let sum = self.g.dot(row, &generalised);
            tau.push(self.g.cancel_zero(sum));
        }
        let symbols = self.symbols("tau", &tau);
        let (mut definitions, mut total) = (Vec::new(), Vec::new());
        for ((symbol, expr), right) in symbols.into_iter().zip(tau).zip(right) {
            if expr == self.g.zero() {
                total.push(right);
                continue;
            }
            let named = self.g.sym(symbol);
            total.push(self.g.add(right, named));
            definitions.push(Definition { symbol, expr });
        }
        Some((definitions, total))
    }

    /// Adds `lambda_A form_A,i` along the shape and `lambda_A basis[k][a] form_A,a`.
    fn react(&mut self, reactions: &[Vec<ExprId>], [shape, right]: [&mut [ExprId]; 2]) -> Option<()> {
        let multipliers = self.equations.outputs.iter().find(|o| o.name == "multipliers");
        let multipliers = multipliers.map_or(&[][..], |o| &o.components);
        if multipliers.len() != reactions.len() {
            return None;
        }
        for ((name, value), form) in multipliers.iter().zip(reactions) {
            let symbol = self.g.define(name, *value);
            let lambda = self.g.sym(symbol);
            let (along_shape, along_algebra) = form.split_at(self.n);
            for (right, a) in shape.iter_mut().zip(along_shape) {
                let reaction = self.g.mul(lambda, *a);
                *right = self.g.add(*right, reaction);
            }
            for (right, row) in right.iter_mut().zip(&self.basis) {
                let along = self.g.dot(row, along_algebra);
                let along = self.g.cancel_zero(along);
                let reaction = self.g.mul(lambda, along);
                *right = self.g.add(*right, reaction);
            }
        }
        Some(())
    }

    /// A basis of the virtual displacements without a part along the base, in the adapted basis, and what completes it
    /// to all of them: its parts along the base and in the adapted basis.
    fn allowed(&mut self) -> Option<(Vec<Vec<ExprId>>, Vec<Displacement>)> {
        let KinematicConstraint::Solved(constraint) = &self.system.constraint else { return None };
        let mut w = Vec::new();
        for row in &constraint.virtual_displacements {
            w.push(row.iter().map(|e| self.g.subs(*e, &self.named)).collect::<Result<Vec<_>, _>>().ok()?);
        }
        let (base, fibre) = w.split_at(self.n);
        let g = &mut self.g;
        let tidied = |g: &mut Graph, a: &[ExprId], b: &[ExprId]| {
            let sum = g.dot(a, b);
            g.cancel_zero(sum)
        };
        let width = constraint.unknowns.len();
        let (combinations, others) = Tableau::new(base.to_vec()).kernel(g, &Judge::BLIND, width);
        let (unit, inverse) = (unit_vectors(g, width), &self.inverse);
        let adapted = |g: &mut Graph, combination: &[ExprId]| -> Vec<ExprId> {
            let s: Vec<ExprId> = fibre.iter().map(|row| tidied(g, row, combination)).collect();
            let column = |k: usize| inverse.iter().map(|row| row[k]).collect::<Vec<_>>();
            (0..s.len()).map(|k| tidied(g, &s, &column(k))).collect()
        };
        let vectors: Vec<Vec<ExprId>> = combinations.iter().map(|c| adapted(g, c)).collect();
        let lifts = others.into_iter().map(|k| {
            let shape: Vec<ExprId> = base.iter().map(|row| row[k]).collect();
            (shape, adapted(g, &unit[k]))
        });
        let lifts = lifts.collect();
        Some((Tableau::new(vectors).tidied(g), lifts))
    }
}
