//! A connection and its curvature by names, for those who read: each name is told once and used from then on.
//!
//! A mechanical connection is the quotient of cofactors of the locked inertia and its determinant. Its curvature comes
//! from `K (d_i A_j - d_j A_i) = d_i L_vj - d_j L_vi - d_i K A_j + d_j K A_i`: no quotient is differentiated. Every
//! bracket is compared with the algebroid. Deliberately does not know: equations of motion, how anything is printed.

use hamel_expr::{Definition, ExprId, Graph, SymbolId};
use hamel_lang::algebra::tableau::{MAX_COFACTORS, adjugate, determinant};

use crate::reduction::{Lift, ReducedSystem};

/// The connection of the velocities `v = xi + A(x, t) xdot`, the brackets of its horizontal lifts `D_i` and what both
/// are made of.
#[derive(Clone, Debug)]
pub struct NamedConnection {
    /// Owner of the expressions: the graph of the equations and more.
    pub graph: Graph,
    /// Locked inertia `K`, coupling `L_vx`, and its cofactors and determinant where it has few rows.
    pub inertia: Vec<Definition>,
    /// `A^a_i`.
    pub coefficients: Vec<ConnectionName>,
    /// `K A_i = L_vi`, where `K` has more rows than its cofactors are written for.
    pub conditions: Vec<(ExprId, ExprId)>,
    /// Derivatives of `K`, and `R_ij`, which is `K (d_i A_j - d_j A_i)`.
    pub rates: Vec<Definition>,
    /// `B^a_ij = d_i A^a_j - d_j A^a_i - [A_i, A_j]^a`.
    pub curvature: Vec<ConnectionName>,
    /// `xi^a = v^a - A^a_i xdot^i`, by the velocities of the model.
    pub group_velocity: Vec<ExprId>,
    /// The brackets `[D_i, .]` that do not vanish.
    pub brackets: Vec<LiftBracket>,
}

/// A component of a connection, of its curvature or of what they are made of, with its name and value.
#[derive(Clone, Debug)]
pub struct ConnectionName {
    /// The name and what it is equal to.
    pub definition: Definition,
    /// The letter before its indices.
    pub stem: &'static str,
    /// The component along the algebra.
    pub component: usize,
    /// The coordinates along which it is taken.
    pub coordinates: Vec<SymbolId>,
}

impl ConnectionName {
    /// A component by its name where it is worth one, which joins the list.
    pub(super) fn of(
        g: &mut Graph,
        list: &mut Vec<ConnectionName>,
        (stem, component): (&'static str, usize),
        (coordinates, expr): (&[SymbolId], ExprId),
    ) -> ExprId {
        let expr = g.cancel_zero(expr);
        if g.is_trivial(expr) {
            return expr;
        }
        let along: Vec<&str> = coordinates.iter().map(|x| g.name(*x)).collect();
        let name = format!("{stem}{}_{}", component + 1, along.join("_"));
        let symbol = g.define(&name, expr);
        let definition = Definition { symbol, expr };
        list.push(ConnectionName { definition, stem, component, coordinates: coordinates.to_vec() });
        g.sym(symbol)
    }
}

/// `[D_i, e]` for the section `e` of the frame at a place behind `i`.
#[derive(Clone, Debug)]
pub struct LiftBracket {
    /// The coordinate that is lifted.
    pub coordinate: usize,
    /// The other section: coordinates first, then elements of the algebra.
    pub other: usize,
    /// Components along the algebra.
    pub value: Vec<(usize, ExprId)>,
}

/// `K` and its derivatives by names.
struct Inertia {
    matrix: Vec<Vec<ExprId>>,
    /// Cofactors and determinant, where they are written down.
    quotient: Option<(Vec<Vec<ExprId>>, ExprId)>,
}

struct Writer<'a> {
    system: &'a ReducedSystem,
    g: Graph,
    n: usize,
    dim: usize,
    coordinates: Vec<(SymbolId, String)>,
    found: NamedConnection,
}

impl NamedConnection {
    /// The connection of a system that has one. There is nothing where a value is not seen to have its name.
    pub fn new(system: &ReducedSystem) -> Option<NamedConnection> {
        let rows = system.connection.as_ref()?;
        // In a frame that is adapted to stages its components are others.
        if system.frame.is_some() && system.lift.is_none() || system.quasi_frame.is_some() {
            return None;
        }
        let dim = rows.len();
        let n = system.velocities.len() - dim;
        let mut writer = Writer::new(system, (n, dim));
        let (coefficients, inertia) = match &system.lift {
            Some(lift) => {
                let inertia = writer.inertia(lift);
                (writer.quotients(lift, &inertia)?, Some((lift, inertia)))
            }
            None => (writer.named_rows("A", rows), None),
        };
        for (row, expected) in coefficients.iter().zip(rows) {
            if !row.iter().zip(expected).all(|(e, f)| writer.g.is_equal(*e, *f)) {
                return None;
            }
        }
        writer.velocities(&coefficients);
        let turning = match &inertia {
            Some((lift, inertia)) => writer.turning_of(lift, inertia, &coefficients)?,
            None => writer.turning(rows),
        };
        writer.brackets(&coefficients, &turning)?;
        let Writer { g, mut found, .. } = writer;
        found.graph = g;
        Some(found)
    }
}

/// `d_i A_j - d_j A_i` by pairs `i < j`, with the vertical components.
type Turning = Vec<((usize, usize), Vec<ExprId>)>;

impl<'a> Writer<'a> {
    fn new(system: &'a ReducedSystem, (n, dim): (usize, usize)) -> Writer<'a> {
        let g = system.graph.clone();
        let base = system.algebroid.base()[..n].iter();
        let coordinates = base.map(|x| (*x, g.name(*x).to_owned())).collect();
        let found = NamedConnection {
            graph: Graph::new(),
            inertia: Vec::new(),
            coefficients: Vec::new(),
            conditions: Vec::new(),
            rates: Vec::new(),
            curvature: Vec::new(),
            group_velocity: Vec::new(),
            brackets: Vec::new(),
        };
        Writer { system, g, n, dim, coordinates, found }
    }

    /// A name for a value that is worth one.
    fn named(
        &mut self,
        list: fn(&mut NamedConnection) -> &mut Vec<Definition>,
        name: &str,
        e: ExprId,
    ) -> ExprId {
        let e = self.g.cancel_zero(e);
        if self.g.is_trivial(e) {
            return e;
        }
        let symbol = self.g.define(name, e);
        list(&mut self.found).push(Definition { symbol, expr: e });
        self.g.sym(symbol)
    }

    fn named_rows(&mut self, stem: &'static str, rows: &[Vec<ExprId>]) -> Vec<Vec<ExprId>> {
        let mut named = rows.to_vec();
        for i in 0..self.n {
            for (a, row) in named.iter_mut().enumerate() {
                let of = ([self.coordinates[i].0], row[i]);
                let list = &mut self.found.coefficients;
                row[i] = ConnectionName::of(&mut self.g, list, (stem, a), (&of.0, of.1));
            }
        }
        named
    }

    fn inertia(&mut self, lift: &Lift) -> Inertia {
        let dim = self.dim;
        let mut matrix = lift.inertia.clone();
        for a in 0..dim {
            for b in a..dim {
                let name = format!("K_{}_{}", a + 1, b + 1);
                matrix[a][b] = self.named(|found| &mut found.inertia, &name, lift.inertia[a][b]);
                matrix[b][a] = matrix[a][b];
            }
        }
        let quotient = (dim <= MAX_COFACTORS).then(|| {
            let mut cofactors = adjugate(&mut self.g, &matrix);
            for a in 0..dim {
                for b in a..dim {
                    let name = format!("C_{}_{}", a + 1, b + 1);
                    cofactors[a][b] = self.named(|found| &mut found.inertia, &name, cofactors[a][b]);
                    cofactors[b][a] = cofactors[a][b];
                }
            }
            let value = match cofactors.first().zip(matrix.first()) {
                Some((cofactors, row)) => self.g.dot(row, cofactors),
                None => determinant(&mut self.g, &matrix),
            };
            let determinant = self.named(|found| &mut found.inertia, "det_K", value);
            (cofactors, determinant)
        });
        Inertia { matrix, quotient }
    }

    /// `K^-1 right`, over the determinant, where cofactors are written.
    fn quotient(&mut self, inertia: &Inertia, right: &[ExprId]) -> Option<Vec<ExprId>> {
        let (cofactors, determinant) = inertia.quotient.as_ref()?;
        let inverse = self.g.powi(*determinant, -1);
        let mut solved = Vec::with_capacity(right.len());
        for row in cofactors {
            let numerator = self.g.dot(row, right);
            solved.push(self.g.mul(numerator, inverse));
        }
        Some(solved)
    }

    /// `A = K^-1 L_vx`, beside the connection that the model writes down.
    fn quotients(&mut self, lift: &Lift, inertia: &Inertia) -> Option<Vec<Vec<ExprId>>> {
        let total = self.system.connection.as_ref()?;
        let mut rows = total.clone();
        for i in 0..self.n {
            let coordinate = self.coordinates[i].1.clone();
            let mut coupling = Vec::with_capacity(self.dim);
            for a in 0..self.dim {
                let name = format!("L{}_{coordinate}", a + 1);
                coupling.push(self.named(|found| &mut found.inertia, &name, lift.coupling[a][i]));
            }
            let solved = self.quotient(inertia, &coupling);
            for a in 0..self.dim {
                let name = format!("A{}_{coordinate}", a + 1);
                let own = self.g.sub(total[a][i], lift.connection[a][i]);
                let own = self.g.cancel_zero(own);
                rows[a][i] = match &solved {
                    Some(solved) => {
                        let sum = self.g.add(own, solved[a]);
                        let list = &mut self.found.coefficients;
                        ConnectionName::of(&mut self.g, list, ("A", a), (&[self.coordinates[i].0], sum))
                    }
                    None => {
                        let symbol = self.g.define(&name, total[a][i]);
                        self.g.sym(symbol)
                    }
                };
            }
            if solved.is_none() {
                self.condition(&inertia.matrix, (&rows, i), (&coupling, (total, lift)))?;
            }
        }
        Some(rows)
    }

    /// `K A_i = L_vi + K A_i` of the connection that the model writes down.
    fn condition(
        &mut self,
        inertia: &[Vec<ExprId>],
        (rows, i): (&[Vec<ExprId>], usize),
        (coupling, (total, lift)): (&[ExprId], (&[Vec<ExprId>], &Lift)),
    ) -> Option<()> {
        let column: Vec<ExprId> = rows.iter().map(|row| row[i]).collect();
        let mut given = Vec::with_capacity(self.dim);
        for (total, own) in total.iter().zip(&lift.connection) {
            let difference = self.g.sub(total[i], own[i]);
            given.push(self.g.cancel_zero(difference));
        }
        for (row, coupling) in inertia.iter().zip(coupling) {
            let left = self.g.dot(row, &column);
            let own = self.g.dot(row, &given);
            let right = self.g.add(*coupling, own);
            self.g.is_equal(left, right).then_some(())?;
            self.found.conditions.push((left, right));
        }
        Some(())
    }

    fn velocities(&mut self, coefficients: &[Vec<ExprId>]) {
        let symbols = match &self.system.frame {
            Some(frame) => frame.original.iter().map(|u| u.symbol).collect(),
            None => self.system.velocities.clone(),
        };
        let y: Vec<ExprId> = symbols.into_iter().map(|s| self.g.sym(s)).collect();
        for (v, row) in y[self.n..].iter().zip(coefficients) {
            let along = self.g.dot(row, &y[..self.n]);
            let xi = self.g.sub(*v, along);
            self.found.group_velocity.push(xi);
        }
    }

    fn turning(&mut self, rows: &[Vec<ExprId>]) -> Turning {
        let mut found = Vec::new();
        for i in 0..self.n {
            for j in i + 1..self.n {
                let mut value = Vec::with_capacity(self.dim);
                for row in rows {
                    let forward = self.g.diff(row[j], self.coordinates[i].0);
                    let backward = self.g.diff(row[i], self.coordinates[j].0);
                    let difference = self.g.sub(forward, backward);
                    value.push(self.g.cancel_zero(difference));
                }
                found.push(((i, j), value));
            }
        }
        found
    }

    /// `d_i A_j - d_j A_i` from what `K` times that is, beside the connection that the model writes down.
    fn turning_of(&mut self, lift: &Lift, inertia: &Inertia, named: &[Vec<ExprId>]) -> Option<Turning> {
        let total = self.system.connection.clone()?;
        let mut given = total.clone();
        for (row, own) in given.iter_mut().zip(&lift.connection) {
            for (e, own) in row.iter_mut().zip(own) {
                let difference = self.g.sub(*e, *own);
                *e = self.g.cancel_zero(difference);
            }
        }
        let has_given = given.iter().flatten().any(|e| *e != self.g.zero());
        let slopes: Vec<Vec<Vec<ExprId>>> = match self.n {
            0 | 1 => Vec::new(),
            _ => (0..self.n).map(|i| self.slopes_of(lift, i)).collect(),
        };
        let mut found = self.turning(&given);
        for ((i, j), value) in &mut found {
            let (i, j) = (*i, *j);
            let mut right = Vec::with_capacity(self.dim);
            for b in 0..self.dim {
                let forward = self.g.diff(lift.coupling[b][j], self.coordinates[i].0);
                let backward = self.g.diff(lift.coupling[b][i], self.coordinates[j].0);
                let mut terms = vec![forward, self.g.neg(backward)];
                for (c, (named, given)) in named.iter().zip(&given).enumerate() {
                    let own = |g: &mut Graph, k: usize| {
                        if has_given { g.sub(named[k], given[k]) } else { named[k] }
                    };
                    let (first, second) = (own(&mut self.g, j), own(&mut self.g, i));
                    let forward = self.g.mul(slopes[i][b][c], first);
                    terms.push(self.g.neg(forward));
                    terms.push(self.g.mul(slopes[j][b][c], second));
                }
                let sum = self.g.sum(&terms);
                let name = format!("R{}_{}_{}", b + 1, self.coordinates[i].1, self.coordinates[j].1);
                right.push(self.named(|found| &mut found.rates, &name, sum));
            }
            let solved = match self.quotient(inertia, &right) {
                Some(solved) => solved,
                None => self.solved_by_name(lift, (inertia, &right), (i, j))?,
            };
            for (value, solved) in value.iter_mut().zip(solved) {
                *value = self.g.add(*value, solved);
            }
        }
        Some(found)
    }

    /// The derivatives of `K` by a coordinate.
    fn slopes_of(&mut self, lift: &Lift, i: usize) -> Vec<Vec<ExprId>> {
        let (x, name) = self.coordinates[i].clone();
        let mut slopes = lift.inertia.clone();
        for a in 0..self.dim {
            for b in a..self.dim {
                let slope = self.g.diff(lift.inertia[a][b], x);
                let name = format!("K_{}_{}_{name}", a + 1, b + 1);
                slopes[a][b] = self.named(|found| &mut found.rates, &name, slope);
                slopes[b][a] = slopes[a][b];
            }
        }
        slopes
    }

    /// `S` with `K S = R` by names alone, and that equation.
    fn solved_by_name(
        &mut self,
        lift: &Lift,
        (inertia, right): (&Inertia, &[ExprId]),
        (i, j): (usize, usize),
    ) -> Option<Vec<ExprId>> {
        let [(x, first), (y, second)] = [i, j].map(|k| self.coordinates[k].clone());
        let mut solved = Vec::with_capacity(self.dim);
        for (a, row) in lift.connection.iter().enumerate() {
            let (forward, backward) = (self.g.diff(row[j], x), self.g.diff(row[i], y));
            let value = self.g.sub(forward, backward);
            let symbol = self.g.define(&format!("S{}_{first}_{second}", a + 1), value);
            solved.push(self.g.sym(symbol));
        }
        for (row, right) in inertia.matrix.iter().zip(right) {
            let left = self.g.dot(row, &solved);
            self.g.is_equal(left, *right).then_some(())?;
            self.found.conditions.push((left, *right));
        }
        Some(solved)
    }

    /// `[x, e_b]` by components along the algebra, with the sign of the side.
    fn bracket_with(&mut self, x: &[ExprId], b: usize) -> Vec<ExprId> {
        let mut terms: Vec<Vec<ExprId>> = vec![Vec::new(); self.dim];
        for (a, x) in x.iter().enumerate() {
            for (c, value) in self.system.algebroid.bracket(&mut self.g, self.n + a, self.n + b) {
                terms[c - self.n].push(self.g.mul(value, *x));
            }
        }
        terms.iter().map(|list| self.g.sum(list)).collect()
    }

    /// The curvature by names, and the brackets of the lifts, each of them compared with that of the algebroid.
    fn brackets(&mut self, coefficients: &[Vec<ExprId>], turning: &Turning) -> Option<()> {
        let connected = self.system.with_lifts(&mut self.g);
        let column = |i: usize| -> Vec<ExprId> { coefficients.iter().map(|row| row[i]).collect() };
        let mut curvature = turning.iter();
        for i in 0..self.n {
            for other in i + 1..self.n + self.dim {
                let value = if other < self.n {
                    let (_, turning) = curvature.next()?;
                    let inner = self.bracket_of(&column(i), &column(other));
                    self.curvature((i, other), (turning, &inner))
                } else {
                    self.bracket_with(&column(i), other - self.n)
                };
                let value: Vec<ExprId> = value.into_iter().map(|e| self.g.neg(e)).collect();
                let expected = connected.bracket(&mut self.g, i, other);
                for (c, e) in value.iter().enumerate() {
                    let known = expected.iter().find(|(k, _)| *k == self.n + c);
                    let known = known.map_or(self.g.zero(), |(_, e)| *e);
                    self.g.is_equal(*e, known).then_some(())?;
                }
                let value: Vec<(usize, ExprId)> =
                    value.into_iter().enumerate().filter(|(_, e)| *e != self.g.zero()).collect();
                if !value.is_empty() {
                    self.found.brackets.push(LiftBracket { coordinate: i, other, value });
                }
            }
        }
        Some(())
    }

    fn bracket_of(&mut self, x: &[ExprId], y: &[ExprId]) -> Vec<ExprId> {
        let mut total = vec![self.g.zero(); self.dim];
        for (b, y) in y.iter().enumerate() {
            for (total, e) in total.iter_mut().zip(self.bracket_with(x, b)) {
                let term = self.g.mul(e, *y);
                *total = self.g.add(*total, term);
            }
        }
        total
    }

    /// `B_ij`, as the difference by names, or as what it is where that is shorter.
    fn curvature(&mut self, (i, j): (usize, usize), (turning, inner): (&[ExprId], &[ExprId])) -> Vec<ExprId> {
        let mut components = Vec::with_capacity(self.dim);
        for (a, (turning, inner)) in turning.iter().zip(inner).enumerate() {
            let mut value = self.g.sub(*turning, *inner);
            if self.system.lift.is_none() {
                let known = self.system.algebroid.bracket(&mut self.g, i, j);
                let known =
                    known.into_iter().find(|(c, _)| *c == self.n + a).map_or(self.g.zero(), |(_, e)| e);
                let known = self.g.neg(known);
                let size = |g: &Graph, e: ExprId| g.reachable(&[e]).len();
                if self.g.is_equal(known, value) && size(&self.g, known) <= size(&self.g, value) {
                    value = known;
                }
            }
            let along = [i, j].map(|k| self.coordinates[k].0);
            let list = &mut self.found.curvature;
            components.push(ConnectionName::of(&mut self.g, list, ("B", a), (&along, value)));
        }
        components
    }
}
