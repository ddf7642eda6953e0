//! The vertical equations of motion in the adapted basis of a chain of stages, as expressions that can be shown and
//! checked.
//!
//! They are written from the stage forms, and then compared with the motion that was derived without them.
//!
//! Deliberately does not know: how stage forms come about, how anything is printed.

use std::collections::{BTreeMap, BTreeSet};

use crate::expr::{Definition, ExprId, Graph, SymbolId};
use crate::reduction::{KinematicConstraint, ReducedSystem, Stages};
use crate::spec::Side;

use super::equations::Equations;

/// The equations of motion along the vertical displacements that the constraint allows, by stages.
///
/// With `f_k` the adapted basis, `eta` the components of the group velocity `xi = v - A(x) xdot` in it and
/// `beta_k = <dL/dv, f_k>`, the equation along `s = s^k f_k` is
///
/// `s^k (betadot_k - right_k(eta, beta) - tau_k) = 0`, `tau_k = <rho(f_k), dL/da> + <F, f_k>`,
///
/// where `right_k` is [`Stages::vertical_equations`], with the other sign for a right action. Where multipliers keep
/// the constraint there is one equation for each `f_k`, with the reactions `lambda_A <a_A, f_k>` on its right side.
///
/// # Source
/// Cendra, Diaz, equations (32) and (43), every slot's momentum differentiated and summed over; section 4 for
/// `eta - A`.
#[derive(Clone, Debug)]
pub struct VerticalEquations {
    /// Owner of the expressions here: the graph of the equations and more.
    pub graph: Graph,
    /// `eta_k`, by the velocities of the model.
    pub velocities: Vec<Definition>,
    /// `beta_k`, by the momenta `p`.
    pub momenta: Vec<Definition>,
    /// `tau_k`, where it does not vanish.
    pub applied: Vec<Definition>,
    /// One for each element of a basis of the allowed vertical displacements, none where there are no such.
    pub rows: Vec<VerticalEquation>,
    /// Whether reactions of the constraint are in the equations.
    pub has_multipliers: bool,
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
        let velocities = writer.velocities();
        let (momenta, rates) = writer.momenta()?;
        let right = writer.right_sides(&velocities, &momenta);
        let (applied, mut right) = writer.applied(right)?;
        let (displacements, has_multipliers) = match &system.constraint {
            KinematicConstraint::Solved(_) => (writer.allowed()?, false),
            KinematicConstraint::Multipliers { reactions, .. } => {
                writer.react(reactions, &mut right)?;
                (unit_vectors(&writer.g, right.len()), !reactions.is_empty())
            }
        };
        let mut g = writer.g;
        let mut rows = Vec::new();
        for displacement in displacements {
            let contract = |g: &mut Graph, with: &[ExprId]| {
                let terms: Vec<ExprId> = displacement.iter().zip(with).map(|(s, e)| g.mul(*s, *e)).collect();
                g.sum(&terms)
            };
            let (left, right) = (contract(&mut g, &rates), contract(&mut g, &right));
            if !g.is_equal(left, right) {
                return None;
            }
            rows.push(VerticalEquation { displacement, left, right });
        }
        Some(VerticalEquations { graph: g, velocities, momenta, applied, rows, has_multipliers })
    }
}

/// `stem` followed by underscores and `stage` until no name is that with digits behind it.
pub(crate) fn unused_stem(equations: &Equations, stem: &str) -> String {
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

fn unit_vectors(g: &Graph, n: usize) -> Vec<Vec<ExprId>> {
    (0..n).map(|i| (0..n).map(|j| if i == j { g.one() } else { g.zero() }).collect()).collect()
}

struct Writer<'a> {
    equations: &'a Equations,
    system: &'a ReducedSystem,
    stages: &'a Stages,
    g: Graph,
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
        Writer { equations, system, stages, g, n, named, solved }
    }

    fn symbols(&mut self, stem: &str, values: &[ExprId]) -> Vec<SymbolId> {
        let stem = unused_stem(self.equations, stem);
        values.iter().enumerate().map(|(k, e)| self.g.define(&format!("{stem}{}", k + 1), *e)).collect()
    }

    /// `eta_k = inverse[a][k] (v^a - A^a_i xdot^i)`.
    fn velocities(&mut self) -> Vec<Definition> {
        let g = &mut self.g;
        let xi = self.system.group_velocity(g, self.n);
        let eta: Vec<ExprId> = (0..xi.len())
            .map(|k| {
                let rows = xi.iter().zip(&self.stages.inverse);
                let terms: Vec<ExprId> = rows.map(|(v, row)| g.mul(*v, row[k])).collect();
                g.sum(&terms)
            })
            .collect();
        // A linear change of variables divides by nothing that the constraint could make zero.
        let values: Vec<ExprId> = eta.iter().map(|e| g.subs(*e, &self.named).unwrap_or(*e)).collect();
        let symbols = self.symbols("eta", &values);
        symbols.into_iter().zip(eta).map(|(symbol, expr)| Definition { symbol, expr }).collect()
    }

    /// `beta_k = basis[k][a] p_a` with `p_a = dL/dv^a`, and the symbols of their rates.
    fn momenta(&mut self) -> Option<(Vec<Definition>, Vec<ExprId>)> {
        let fibre = &self.system.velocities[self.n..];
        let (mut p, mut slopes) = (Vec::new(), Vec::new());
        for (v, name) in fibre.iter().zip(&self.system.algebroid.frame()[self.n..]) {
            let raw = self.g.diff(self.system.lagrangian, *v);
            let value = self.g.subs(raw, &self.named).ok()?;
            let symbol = self.g.define(&format!("p_{name}"), value);
            p.push(self.g.sym(symbol));
            let free = self.g.subs(raw, &self.solved).ok()?;
            slopes.push(self.rate(free));
        }
        let g = &mut self.g;
        let combine = |g: &mut Graph, row: &[ExprId], of: &[ExprId]| {
            let terms: Vec<ExprId> = row.iter().zip(of).map(|(e, p)| g.mul(*e, *p)).collect();
            g.sum(&terms)
        };
        let beta: Vec<ExprId> = self.stages.basis.iter().map(|row| combine(g, row, &p)).collect();
        let turned: Vec<ExprId> = self.stages.basis.iter().map(|row| combine(g, row, &slopes)).collect();
        let symbols = self.symbols("beta", &beta);
        let names: Vec<String> = symbols.iter().map(|s| format!("dot_{}", self.g.name(*s))).collect();
        let g = &mut self.g;
        let rates = names.iter().zip(turned).map(|(name, rate)| {
            let symbol = g.define(name, rate);
            g.sym(symbol)
        });
        let rates = rates.collect();
        Some((
            symbols.into_iter().zip(beta).map(|(symbol, expr)| Definition { symbol, expr }).collect(),
            rates,
        ))
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

    fn right_sides(&mut self, velocities: &[Definition], momenta: &[Definition]) -> Vec<ExprId> {
        let g = &mut self.g;
        let [eta, beta] = [velocities, momenta]
            .map(|list| -> Vec<ExprId> { list.iter().map(|d| g.sym(d.symbol)).collect() });
        let right = self.stages.vertical_equations(g, &eta, &beta);
        match self.system.side {
            Side::Left => right,
            Side::Right => right.into_iter().map(|e| g.neg(e)).collect(),
        }
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
        for row in &self.stages.basis {
            let terms: Vec<ExprId> = row.iter().zip(&generalised).map(|(e, f)| self.g.mul(*e, *f)).collect();
            let sum = self.g.sum(&terms);
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

    /// Adds `lambda_A basis[k][a] form_A,a`.
    fn react(&mut self, reactions: &[Vec<ExprId>], right: &mut [ExprId]) -> Option<()> {
        let multipliers = self.equations.outputs.iter().find(|o| o.name == "multipliers");
        let multipliers = multipliers.map_or(&[][..], |o| &o.components);
        if multipliers.len() != reactions.len() {
            return None;
        }
        for ((name, value), form) in multipliers.iter().zip(reactions) {
            let symbol = self.g.define(name, *value);
            let lambda = self.g.sym(symbol);
            for (right, row) in right.iter_mut().zip(&self.stages.basis) {
                let pairs = row.iter().zip(&form[self.n..]);
                let terms: Vec<ExprId> = pairs.map(|(e, a)| self.g.mul(*e, *a)).collect();
                let along = self.g.sum(&terms);
                let along = self.g.cancel_zero(along);
                let reaction = self.g.mul(lambda, along);
                *right = self.g.add(*right, reaction);
            }
        }
        Some(())
    }

    /// A basis of the virtual displacements without a part along the base, in the adapted basis.
    fn allowed(&mut self) -> Option<Vec<Vec<ExprId>>> {
        let KinematicConstraint::Solved(constraint) = &self.system.constraint else { return None };
        let mut w = Vec::new();
        for row in &constraint.virtual_displacements {
            w.push(row.iter().map(|e| self.g.subs(*e, &self.named)).collect::<Result<Vec<_>, _>>().ok()?);
        }
        let (base, fibre) = w.split_at(self.n);
        let g = &mut self.g;
        let mut vectors = Vec::new();
        for combination in kernel(g, base, constraint.unknowns.len()) {
            let contract = |g: &mut Graph, a: &[ExprId], b: &[ExprId]| {
                let terms: Vec<ExprId> = a.iter().zip(b).map(|(x, y)| g.mul(*x, *y)).collect();
                let sum = g.sum(&terms);
                g.cancel_zero(sum)
            };
            let s: Vec<ExprId> = fibre.iter().map(|row| contract(g, row, &combination)).collect();
            let column = |k: usize| self.stages.inverse.iter().map(|row| row[k]).collect::<Vec<_>>();
            vectors.push((0..s.len()).map(|k| contract(g, &s, &column(k))).collect());
        }
        tidy(g, &mut vectors);
        Some(vectors)
    }
}

/// Makes an entry one, and all others of its column zero, by row operations.
fn eliminate(g: &mut Graph, rows: &mut [Vec<ExprId>], (row, column): (usize, usize)) {
    let inverse = g.powi(rows[row][column], -1);
    for entry in &mut rows[row] {
        *entry = g.mul(*entry, inverse);
    }
    let own = rows[row].clone();
    for (i, other) in rows.iter_mut().enumerate() {
        let factor = other[column];
        if i == row || factor == g.zero() {
            continue;
        }
        for (entry, own) in other.iter_mut().zip(&own) {
            let product = g.mul(factor, *own);
            let difference = g.sub(*entry, product);
            *entry = g.cancel_zero(difference);
        }
    }
}

/// The same span, with a one alone in its column in as many rows as that takes no division by what is not a number.
fn tidy(g: &mut Graph, rows: &mut [Vec<ExprId>]) {
    let width = rows.first().map_or(0, Vec::len);
    let mut done = BTreeSet::new();
    for column in 0..width {
        let is_number = |i: &usize| rows[*i][column] != g.zero() && g.as_rational(rows[*i][column]).is_some();
        if let Some(row) = (0..rows.len()).filter(|i| !done.contains(i)).find(is_number) {
            eliminate(g, rows, (row, column));
            done.insert(row);
        }
    }
    rows.sort_by_key(|row| row.iter().position(|e| *e != g.zero()));
}

/// A basis of the vectors `c` with `rows c = 0`.
fn kernel(g: &mut Graph, rows: &[Vec<ExprId>], width: usize) -> Vec<Vec<ExprId>> {
    let mut rows = rows.to_vec();
    for entry in rows.iter_mut().flatten() {
        *entry = g.cancel_zero(*entry);
    }
    let mut pivots = Vec::new();
    for row in 0..rows.len() {
        // Numbers first: they vanish nowhere.
        let grade = |e: ExprId| (g.as_rational(e).is_none(), g.reachable(&[e]).len());
        let entries = rows[row].iter().enumerate().filter(|(_, e)| **e != g.zero());
        let Some((column, _)) = entries.min_by_key(|(_, e)| grade(**e)) else { continue };
        eliminate(g, &mut rows, (row, column));
        pivots.push((row, column));
    }
    let mut vectors = Vec::new();
    for free in (0..width).filter(|k| pivots.iter().all(|(_, column)| column != k)) {
        let mut vector = vec![g.zero(); width];
        vector[free] = g.one();
        for &(row, column) in &pivots {
            vector[column] = g.neg(rows[row][free]);
        }
        vectors.push(vector);
    }
    vectors
}
