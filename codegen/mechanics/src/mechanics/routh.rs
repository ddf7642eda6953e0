//! The Routhian of a system that carries the momenta of its group or of cyclic coordinates, as expressions that can be
//! shown and checked.
//!
//! Does not know: how the equations of motion were derived, how anything is printed.

use std::collections::BTreeMap;

use crate::reduction::{KinematicConstraint, ReducedSystem};
use hamel_expr::{DivisionByZero, ExprId, Graph, SymbolId};
use hamel_lang::algebra::solve_symmetric;

use super::equations::Equations;

/// Routh's function of base coordinates and velocities and of the momenta `Pi` of the other velocities,
/// `R = L - Pi . w` with the velocities `w = v + A(x) xdot` that are orthogonal to the mechanical connection `A`:
///
/// ```text
/// w = K^-1 (Pi - b),   A = K^-1 L_vx,   K = L_vv,   b = L_v at rest,   V = -R at xdot = 0
/// d/dt dR/dxdot^i - dR/dx^i = Pi_a B^a_ij xdot^j - <Pi, [w, A_i]>,   B = dA - [A, A]
/// ```
///
/// `[w, A_i]` vanishes for cyclic coordinates. Brackets of a right action have the other sign.
///
/// # Source
/// Marsden, Ratiu, Scheurle 2000, Reduction theory and the Lagrange-Routh equations, sections III and IV.
#[derive(Clone, Debug)]
pub struct Routhian {
    /// Owner of the expressions: the graph of the equations and more.
    pub graph: Graph,
    /// `A^a_i` that do not vanish, and `w_a`, by names that the others use.
    pub names: Vec<(String, ExprId)>,
    /// `R`.
    pub routhian: ExprId,
    /// The effective (amended) potential `V`.
    pub potential: ExprId,
    /// The force on each base coordinate that the state carries, by its name.
    pub forces: Vec<(String, ExprId)>,
}

impl Routhian {
    /// The Routhian of a system without constraints, forces and advected parameters whose state has velocities of the
    /// base and momenta of everything else; none of other systems, and none where its equation is not proved to be that
    /// of the motion.
    pub fn new(equations: &Equations) -> Option<Routhian> {
        Writer::new(equations)?.routhian().ok().flatten()
    }
}

struct Writer<'a> {
    equations: &'a Equations,
    system: &'a ReducedSystem,
    g: Graph,
    /// Positions in the frame of the velocities in the state, which are base velocities, and of the others.
    base: Vec<usize>,
    fibre: Vec<usize>,
    /// The momenta of the others.
    momenta: Vec<ExprId>,
}

impl<'a> Writer<'a> {
    fn new(equations: &'a Equations) -> Option<Writer<'a>> {
        let system = &equations.system;
        let KinematicConstraint::Solved(solved) = &system.constraint else { return None };
        let is_anchored = |alpha: &usize| {
            (0..system.algebroid.n_base()).any(|i| system.algebroid.anchor(i, *alpha) != system.graph.zero())
        };
        // Base velocities come first.
        let n = (0..system.velocities.len()).take_while(is_anchored).count();
        let zero = system.graph.zero();
        let is_plain = system.hamiltonian.is_none()
            && solved.rows.is_empty()
            && system.frame.is_none()
            && system.circles.is_empty()
            && system.algebroid.n_base() == n
            && !system.algebroid.has_drift()
            && system.forces.iter().all(|e| *e == zero);
        let is_carried = |k: &usize| system.momenta.iter().any(|m| m.unknown == *k);
        let (fibre, base): (Vec<usize>, Vec<usize>) = (0..system.velocities.len()).partition(is_carried);
        let is_of_base = |k: &usize| *k < n;
        if !is_plain || fibre.is_empty() || base.is_empty() || !base.iter().all(is_of_base) {
            return None;
        }
        let momenta = system.momenta.iter().map(|m| m.value).collect();
        Some(Writer { equations, system, g: system.graph.clone(), base, fibre, momenta })
    }

    fn routhian(mut self) -> Result<Option<Routhian>, DivisionByZero> {
        let system = self.system;
        let slopes: Vec<ExprId> =
            system.velocities.iter().map(|v| self.g.diff(system.lagrangian, *v)).collect();
        let second = |g: &mut Graph, a: usize, b: usize| {
            let e = g.diff(slopes[a], system.velocities[b]);
            g.cancel_zero(e)
        };
        let (fibre, base) = (self.fibre.clone(), self.base.clone());
        let g = &mut self.g;
        let inertia: Vec<Vec<ExprId>> =
            fibre.iter().map(|a| fibre.iter().map(|b| second(g, *a, *b)).collect()).collect();
        let at_rest: BTreeMap<SymbolId, ExprId> = system.velocities.iter().map(|v| (*v, g.zero())).collect();
        let mut right: Vec<Vec<ExprId>> =
            fibre.iter().map(|a| base.iter().map(|i| second(g, *a, *i)).collect()).collect();
        for ((row, a), momentum) in right.iter_mut().zip(&fibre).zip(&self.momenta) {
            let b = g.subs(slopes[*a], &at_rest)?;
            let difference = g.sub(*momentum, b);
            row.push(g.cancel_zero(difference));
        }
        let Ok(solution) = solve_symmetric(g, &inertia, &right) else { return Ok(None) };
        let solution: Vec<Vec<ExprId>> =
            solution.into_iter().map(|row| row.into_iter().map(|e| g.cancel_zero(e)).collect()).collect();
        // The same by names, for people.
        let mut names = Vec::new();
        let mut shown = solution.clone();
        for (row, a) in shown.iter_mut().zip(&fibre) {
            let velocity = system.algebroid.frame()[*a].clone();
            let labels = base.iter().map(|i| format!("A_{velocity}_{}", g.name(system.algebroid.base()[*i])));
            let labels: Vec<String> = labels.chain([format!("w_{velocity}")]).collect();
            for (e, label) in row.iter_mut().zip(labels) {
                if !g.is_trivial(*e) {
                    let symbol = g.define(&label, *e);
                    names.push((label, *e));
                    *e = g.sym(symbol);
                }
            }
        }
        let (whole, _) = self.of(&solution)?;
        let (routhian, potential) = self.of(&shown)?;
        let (forces, proved) = (self.forces(&shown, &solution), self.forces(&solution, &solution));
        if !self.are_equations(whole, &proved) {
            return Ok(None);
        }
        let names_of = base.iter().map(|i| self.g.name(system.algebroid.base()[*i]).to_owned());
        let forces = names_of.zip(forces).collect();
        Ok(Some(Routhian { names, routhian, potential, forces, graph: self.g }))
    }

    /// `R` and `V`, from rows `(A_i, w)`.
    fn of(&mut self, rows: &[Vec<ExprId>]) -> Result<(ExprId, ExprId), DivisionByZero> {
        let (system, g) = (self.system, &mut self.g);
        let mut values = BTreeMap::new();
        let mut terms = vec![system.lagrangian];
        for ((a, row), momentum) in self.fibre.iter().zip(rows).zip(&self.momenta) {
            let w = row[self.base.len()];
            let mut velocity = vec![w];
            for (e, i) in row.iter().zip(&self.base) {
                let rate = g.sym(system.velocities[*i]);
                let along = g.mul(*e, rate);
                velocity.push(g.neg(along));
            }
            let velocity = g.sum(&velocity);
            values.insert(system.velocities[*a], velocity);
            let product = g.mul(*momentum, w);
            terms.push(g.neg(product));
        }
        let whole = g.sum(&terms);
        let routhian = g.subs(whole, &values)?;
        let at_rest: BTreeMap<SymbolId, ExprId> =
            self.base.iter().map(|i| (system.velocities[*i], g.zero())).collect();
        let still = g.subs(routhian, &at_rest)?;
        Ok((routhian, g.neg(still)))
    }

    /// `Pi_a B^a_ij xdot^j - <Pi, [w, A_i]>`, with `A` and `w` as they are to be written; derivatives are taken of
    /// `whole`.
    fn forces(&mut self, rows: &[Vec<ExprId>], whole: &[Vec<ExprId>]) -> Vec<ExprId> {
        let (system, g) = (self.system, &mut self.g);
        let n = self.base.len();
        // The connection of the model counts as well; cyclic coordinates have none.
        let given = |g: &Graph, a: usize, i: usize| match &system.connection {
            Some(connection) => {
                let shape = system.velocities.len() - connection.len();
                if a < shape { g.zero() } else { connection[a - shape][i] }
            }
            None => g.zero(),
        };
        let total = |g: &mut Graph, rows: &[Vec<ExprId>], a: usize, i: usize| {
            let own = given(g, self.fibre[a], self.base[i]);
            g.add(rows[a][i], own)
        };
        let mut forces = Vec::new();
        for i in 0..n {
            // Minus the force.
            let mut terms = Vec::new();
            let x_i = system.algebroid.base()[self.base[i]];
            for j in 0..n {
                let x_j = system.algebroid.base()[self.base[j]];
                let rate = g.sym(system.velocities[self.base[j]]);
                for (a, momentum) in self.momenta.iter().enumerate() {
                    let (forward, backward) = (total(g, whole, a, j), total(g, whole, a, i));
                    let (forward, backward) = (g.diff(forward, x_i), g.diff(backward, x_j));
                    let curl = g.sub(backward, forward);
                    let curl = g.cancel_zero(curl);
                    terms.push(g.product(&[*momentum, curl, rate]));
                }
            }
            // <Pi, [xi, A_i]> with xi = w - A xdot.
            for (b, place) in self.fibre.iter().enumerate() {
                let mut xi = vec![rows[b][n]];
                for (j, base) in self.base.iter().enumerate() {
                    let rate = g.sym(system.velocities[*base]);
                    let connection = total(g, rows, b, j);
                    let along = g.mul(connection, rate);
                    xi.push(g.neg(along));
                }
                let xi = g.sum(&xi);
                for (c, other) in self.fibre.iter().enumerate() {
                    let along = total(g, rows, c, i);
                    for (target, value) in system.algebroid.bracket(g, *place, *other) {
                        let Some(at) = self.fibre.iter().position(|k| *k == target) else { continue };
                        terms.push(g.product(&[self.momenta[at], value, xi, along]));
                    }
                }
            }
            let sum = g.sum(&terms);
            let force = g.neg(sum);
            forces.push(g.cancel_zero(force));
        }
        forces
    }

    /// Whether `d/dt dR/dxdot^i - dR/dx^i` is the force along the motion.
    fn are_equations(&mut self, routhian: ExprId, forces: &[ExprId]) -> bool {
        let (system, g) = (self.system, &mut self.g);
        let field: Vec<(SymbolId, ExprId)> =
            self.equations.state.iter().map(|s| (s.symbol, s.derivative)).collect();
        self.base.iter().zip(forces).all(|(i, force)| {
            let momentum = g.diff(routhian, system.velocities[*i]);
            let mut terms = vec![g.neg(*force)];
            for (x, rate) in &field {
                let slope = g.diff(momentum, *x);
                terms.push(g.mul(slope, *rate));
            }
            let slope = g.diff(routhian, system.algebroid.base()[*i]);
            terms.push(g.neg(slope));
            let residual = g.sum(&terms);
            g.is_zero(residual)
        })
    }
}
