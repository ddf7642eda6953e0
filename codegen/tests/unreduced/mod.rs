//! Lagrange-d'Alembert equations of a system on `X x G` in coordinates of the group, from matrices and numbers alone.
//!
//! Nothing here is reduced and nothing is shared with the generator: the group consists of matrices, its chart at a
//! point is a product of exponentials, the Lagrangian is a function of coordinates and their rates, its derivatives are
//! those of numbers with two infinitesimals, and multipliers are found with the accelerations by Gauss elimination.
//!
//! # Source
//! Cendra, Marsden, Ratiu 2001, section 3, for what `left` and `right` mean; the equations are those of any textbook.

pub(crate) mod expression;
pub(crate) mod number;

use expression::{Expr, Point};
use number::Dual;

/// A square matrix by its rows.
pub(crate) type Matrix = Vec<Vec<f64>>;

/// A matrix group by a basis of its algebra, and how it acts on parameters.
#[derive(Clone, Debug)]
pub(crate) struct Group {
    /// As the model language spells it.
    pub(crate) spelled: String,
    /// Basis of the algebra.
    pub(crate) basis: Vec<Matrix>,
    /// The same elements as matrices of the action on parameters; empty without parameters.
    pub(crate) action: Vec<Matrix>,
    /// Whether velocities are `gdot g^-1` instead of `g^-1 gdot`.
    pub(crate) right: bool,
}

/// What restricts the motion.
#[derive(Clone, Debug)]
pub(crate) enum Condition {
    /// `phi = 0`.
    Velocities(Expr),
    /// `form . (xddot, xidot) + rest = 0`.
    Accelerations { form: Vec<Expr>, rest: Expr },
}

/// A system with the state `x, xdot, xi, a`.
#[derive(Clone, Debug)]
pub(crate) struct System {
    /// Number of coordinates `x`.
    pub(crate) n: usize,
    /// The group.
    pub(crate) group: Group,
    /// `L(x, xdot, xi, a, t)`.
    pub(crate) lagrangian: Expr,
    /// Paired with `(dx, g^-1 dg)`, or `dg g^-1` for a right action.
    pub(crate) forces: Vec<Expr>,
    /// What restricts the motion.
    pub(crate) conditions: Vec<Condition>,
    /// Forms that vanish on virtual displacements; none where those of the conditions do.
    pub(crate) displacements: Option<Vec<Vec<Expr>>>,
}

/// What the equations say at a point.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    /// `xddot, xidot`.
    pub(crate) accelerations: Vec<f64>,
    /// `adot`.
    pub(crate) advected: Vec<f64>,
    /// `p . zdot - L`.
    pub(crate) energy: f64,
    /// Of `(x, g)` in the chart: how near the equations are to having no solution, one over the largest element of the
    /// inverse.
    pub(crate) definite: f64,
}

/// Coordinates `(x, q)` of a chart `g = exp(q_1 E_1) exp(q_2 E_2) ..` about the point, and their rates.
struct Chart {
    z: Vec<Dual>,
    rates: Vec<Dual>,
    t: Dual,
}

impl System {
    /// Number of coordinates.
    pub(crate) fn dim(&self) -> usize {
        self.n + self.group.basis.len()
    }

    /// The chart at its origin: there the rates of `q` are the group velocity.
    fn chart(&self, at: &Point<f64>) -> Chart {
        let zeros = vec![0.0; self.group.basis.len()];
        let list = |a: &[f64], b: &[f64]| a.iter().chain(b).map(|v| Dual::from(*v)).collect();
        Chart { z: list(&at.x, &zeros), rates: list(&at.x_dot, &at.xi), t: Dual::from(at.t) }
    }

    /// The point that a chart stands for, near the point `at`.
    fn point(&self, chart: &Chart, at: &Point<f64>) -> Point<Dual> {
        let (x, q) = chart.z.split_at(self.n);
        let (x_dot, q_dot) = chart.rates.split_at(self.n);
        let a: Vec<Dual> = at.a.iter().map(|v| Dual::from(*v)).collect();
        Point {
            x: x.to_vec(),
            x_dot: x_dot.to_vec(),
            xi: self.group.velocity(q, q_dot),
            a: self.group.moved(q, &a),
            t: chart.t,
        }
    }

    /// The value of an expression near `at`, by coordinates and rates that `change` moves infinitesimally.
    fn value(&self, e: &Expr, at: &Point<f64>, change: impl Fn(&mut Chart)) -> Dual {
        let mut chart = self.chart(at);
        change(&mut chart);
        e.value(&self.point(&chart, at))
    }

    /// `d/dz_i zdot_i + d/dt`, in the second infinitesimal.
    fn flow(&self, chart: &mut Chart, at: &Point<f64>) {
        let rates = at.x_dot.iter().chain(&at.xi);
        for (z, rate) in chart.z.iter_mut().zip(rates) {
            z.second += rate;
        }
        chart.t.second += 1.0;
    }

    /// The residual of a condition on velocities, with its slopes by `zdot`.
    pub(crate) fn residual(&self, phi: &Expr, at: &Point<f64>) -> (f64, Vec<f64>) {
        let slopes = (0..self.dim()).map(|j| self.value(phi, at, |c| c.rates[j].first += 1.0).first);
        (self.value(phi, at, |_| {}).value, slopes.collect())
    }

    /// The forms that vanish on virtual displacements.
    pub(crate) fn forms(&self, at: &Point<f64>) -> Matrix {
        let value = |e: &Expr| self.value(e, at, |_| {}).value;
        match &self.displacements {
            Some(forms) => forms.iter().map(|form| form.iter().map(value).collect()).collect(),
            None => (self.conditions.iter())
                .map(|condition| match condition {
                    Condition::Velocities(phi) => self.residual(phi, at).1,
                    Condition::Accelerations { form, .. } => form.iter().map(value).collect(),
                })
                .collect(),
        }
    }

    /// `d/dt dL/dzdot - dL/dz = Q + lambda F` with the conditions, solved for `zddot` and `lambda`; `None` where that
    /// is singular.
    pub(crate) fn motion(&self, at: &Point<f64>) -> Option<Motion> {
        let m = self.dim();
        let l = &self.lagrangian;
        let value = |e: &Expr| self.value(e, at, |_| {}).value;
        // d/dt of the group velocity at qddot = 0: the chart is not made of geodesics.
        let bent: Vec<f64> = {
            let mut chart = self.chart(at);
            self.flow(&mut chart, at);
            self.point(&chart, at).xi.iter().map(|xi| xi.second).collect()
        };
        let forms = self.forms(at);
        let size = m + self.conditions.len();
        let mut matrix = vec![vec![0.0; size]; size];
        let mut right = vec![0.0; size];
        let mut energy = -value(l);
        for i in 0..m {
            for j in 0..m {
                let second = self.value(l, at, |c| {
                    c.rates[i].first += 1.0;
                    c.rates[j].second += 1.0;
                });
                matrix[i][j] = second.both;
            }
            for (c, form) in forms.iter().enumerate() {
                matrix[i][m + c] = -form[i];
            }
            let slope = self.value(l, at, |c| c.z[i].first += 1.0).first;
            let momentum = self.value(l, at, |c| {
                c.rates[i].first += 1.0;
                self.flow(c, at);
            });
            right[i] = value(&self.forces[i]) + slope - momentum.both;
            energy += momentum.first * at.x_dot.iter().chain(&at.xi).nth(i)?;
        }
        for (c, condition) in self.conditions.iter().enumerate() {
            match condition {
                Condition::Velocities(phi) => {
                    matrix[m + c][..m].copy_from_slice(&self.residual(phi, at).1);
                    right[m + c] = -self.value(phi, at, |c| self.flow(c, at)).second;
                }
                Condition::Accelerations { form, rest } => {
                    let form: Vec<f64> = form.iter().map(value).collect();
                    let turning: f64 = form[self.n..].iter().zip(&bent).map(|(f, b)| f * b).sum();
                    matrix[m + c][..m].copy_from_slice(&form);
                    right[m + c] = -value(rest) - turning;
                }
            }
        }
        let inverse = inverse(&matrix)?;
        let mut accelerations: Vec<f64> = (0..m).map(|i| dot(&inverse[i], &right)).collect();
        accelerations[self.n..].iter_mut().zip(&bent).for_each(|(rate, bent)| *rate += bent);
        let largest = inverse.iter().flatten().fold(0.0, |a: f64, x| a.max(x.abs()));
        let mut chart = self.chart(at);
        self.flow(&mut chart, at);
        let advected = self.point(&chart, at).a.iter().map(|a| a.second).collect();
        Some(Motion { accelerations, advected, energy, definite: 1.0 / largest })
    }
}

impl Group {
    /// `g^-1 gdot` or `gdot g^-1` in the basis.
    fn velocity(&self, q: &[Dual], q_dot: &[Dual]) -> Vec<Dual> {
        let factors: Vec<_> = self.basis.iter().zip(q).map(|(e, q)| number::exponential(e, *q)).collect();
        let (g, inverse) = (number::product(&factors), self.element(&self.basis, q, true));
        let size = g.len();
        let mut rate = vec![vec![Dual::from(0.0); size]; size];
        for (k, (e, speed)) in self.basis.iter().zip(q_dot).enumerate() {
            let before = number::product(&factors[..k]);
            let after = number::product(&factors[k..]);
            let moved = number::times(&number::times_after(&before, e, size), &after);
            for (row, other) in rate.iter_mut().zip(&moved) {
                row.iter_mut().zip(other).for_each(|(r, m)| *r = *r + *m * *speed);
            }
        }
        let velocity = match self.right {
            true => number::times(&rate, &inverse),
            false => number::times(&inverse, &rate),
        };
        let flat: Vec<Dual> = velocity.into_iter().flatten().collect();
        coordinates(&self.basis).iter().map(|row| dual_dot(row, &flat)).collect()
    }

    /// `exp(q_1 E_1) exp(q_2 E_2) ..`, or its inverse.
    fn element(&self, basis: &[Matrix], q: &[Dual], inverse: bool) -> Vec<Vec<Dual>> {
        let mut factors: Vec<_> = (basis.iter().zip(q))
            .map(|(e, q)| number::exponential(e, if inverse { Dual::from(0.0) - *q } else { *q }))
            .collect();
        if inverse {
            factors.reverse();
        }
        number::product(&factors)
    }

    /// `g^-1 a` for a left action, `g a` for a right one.
    fn moved(&self, q: &[Dual], a: &[Dual]) -> Vec<Dual> {
        if a.is_empty() {
            return Vec::new();
        }
        let g = self.element(&self.action, q, !self.right);
        let row = |row: &Vec<Dual>| row.iter().zip(a).fold(Dual::from(0.0), |sum, (x, y)| sum + *x * *y);
        g.iter().map(row).collect()
    }

    /// The components of `[E_a, E_b]`.
    pub(crate) fn bracket(&self, a: usize, b: usize) -> Vec<f64> {
        let (forward, backward) =
            (plain_product(&self.basis[a], &self.basis[b]), plain_product(&self.basis[b], &self.basis[a]));
        let flat: Vec<f64> =
            forward.iter().flatten().zip(backward.iter().flatten()).map(|(x, y)| x - y).collect();
        coordinates(&self.basis).iter().map(|row| dot(row, &flat)).collect()
    }
}

/// `a b` of numbers.
pub(crate) fn plain_product(a: &Matrix, b: &Matrix) -> Matrix {
    let entry = |row: &Vec<f64>, j: usize| row.iter().zip(b).map(|(x, other)| x * other[j]).sum();
    a.iter().map(|row| (0..b[0].len()).map(|j| entry(row, j)).collect()).collect()
}

/// The matrix that takes the entries of a matrix of the algebra to its components, `(B B^T)^-1 B` for flattened `B`.
fn coordinates(basis: &[Matrix]) -> Matrix {
    let flat: Matrix = basis.iter().map(|e| e.concat()).collect();
    let gram: Matrix = flat.iter().map(|a| flat.iter().map(|b| dot(a, b)).collect()).collect();
    let gram = inverse(&gram).expect("the elements of a basis are independent");
    plain_product(&gram, &flat)
}

/// `a . b`.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

fn dual_dot(a: &[f64], b: &[Dual]) -> Dual {
    a.iter().zip(b).fold(Dual::from(0.0), |sum, (x, y)| sum + Dual::from(*x) * *y)
}

/// The inverse by Gauss elimination with partial pivoting; `None` where a pivot vanishes.
pub(crate) fn inverse(a: &Matrix) -> Option<Matrix> {
    let n = a.len();
    let unit = |i: usize| (0..n).map(move |j| f64::from(u8::from(i == j)));
    let mut rows: Matrix =
        a.iter().enumerate().map(|(i, row)| row.iter().copied().chain(unit(i)).collect()).collect();
    for k in 0..n {
        let best = (k..n).max_by(|i, j| rows[*i][k].abs().total_cmp(&rows[*j][k].abs()))?;
        rows.swap(k, best);
        let pivot = rows[k][k];
        if pivot == 0.0 || !pivot.is_finite() {
            return None;
        }
        rows[k].iter_mut().for_each(|x| *x /= pivot);
        let row = rows[k].clone();
        for (i, other) in rows.iter_mut().enumerate().filter(|(i, _)| *i != k) {
            let factor = other[k];
            debug_assert_ne!(i, k);
            other.iter_mut().zip(&row).for_each(|(x, y)| *x -= factor * y);
        }
    }
    Some(rows.into_iter().map(|row| row[n..].to_vec()).collect())
}
