//! Motions in redundant coordinates.
//!
//! A system is a Lagrangian `L(q, v, t)` of coordinates that need not be independent (entries of rotation matrices,
//! positions of bodies), equations between coordinates `g(q) = 0`, equations between velocities `c(q, v, t) = 0`,
//! forces and the variables of a model as functions of `q` and `v`. All derivatives are those of dual numbers.
//! Accelerations and multipliers solve
//!
//! ```text
//! M a - Z^T lambda = dL/dq - (d^2L/dv dq) v - d^2L/dv dt + F,    C a = -(rate of C v at a = 0)
//! ```
//!
//! with `M = d^2L/dv^2`, the slopes `C` of the equations by `v`, and the directions `Z` of the reactions, which are `C`
//! unless a system has others. Rates of the model's variables along that motion are what the model has to say.
//!
//! Source: Lagrange, Mecanique analytique, for the multipliers; Haug 1989, Computer aided kinematics and dynamics of
//! mechanical systems, for the matrix.
//!
//! Deliberately does not know: the generator, any model, groups and their algebras.

use hamel_runtime::{Dual, Real};
use nalgebra::{DMatrix, DVector};

use super::parameters::Parameters;
use crate::random::Random;

/// Numbers with two infinitesimals.
type Second = Dual<Dual<f64>>;

/// A system in redundant coordinates.
pub trait Unreduced {
    /// Takes the numbers that it needs from the parameters of the model.
    fn new(parameters: &Parameters) -> Self;

    /// A configuration, which need not satisfy the equations between coordinates.
    fn place(&self, random: &mut Random) -> Vec<f64>;

    /// `L(q, v, t)`.
    fn lagrangian<R: Real>(&self, q: &[R], v: &[R], t: R) -> R;

    /// `g(q)`, zero along the motion; independent of each other.
    fn holonomic<R: Real>(&self, _q: &[R]) -> Vec<R> {
        Vec::new()
    }

    /// `c(q, v, t)`, zero along the motion; affine in `v`, independent of each other and of the holonomic ones.
    fn nonholonomic<R: Real>(&self, _q: &[R], _v: &[R], _t: R) -> Vec<R> {
        Vec::new()
    }

    /// Replaces directions of reactions, one row per equation, holonomic ones first.
    fn redirect(&self, _q: &[f64], _v: &[f64], _reactions: &mut [Vec<f64>]) {}

    /// `F(q, v, t)`, paired with `v`.
    fn force(&self, q: &[f64], _v: &[f64], _t: f64) -> Vec<f64> {
        vec![0.0; q.len()]
    }

    /// The model's state as a function of this one.
    fn state<R: Real>(&self, q: &[R], v: &[R], t: R) -> Variables<R>;

    /// Whether the model's energy is `v . dL/dv - L` up to a number.
    fn has_energy(&self) -> bool {
        true
    }
}

/// Values of a model's variables by name.
#[derive(Clone, Debug, Default)]
pub struct Variables<R>(Vec<(String, R)>);

impl<R: Real> Variables<R> {
    /// None.
    pub fn new() -> Variables<R> {
        Variables(Vec::new())
    }

    /// And a number.
    #[must_use]
    pub fn number(mut self, name: &str, value: R) -> Variables<R> {
        self.0.push((name.to_owned(), value));
        self
    }

    /// And a vector, with components `name1, name2, ..`.
    #[must_use]
    pub fn vector(mut self, name: &str, values: &[R]) -> Variables<R> {
        self.0.extend(values.iter().enumerate().map(|(k, value)| (format!("{name}{}", k + 1), *value)));
        self
    }

    /// Values in the order of names.
    ///
    /// # Panics
    /// When names differ.
    pub fn in_order(&self, names: &[String]) -> Vec<R> {
        assert_eq!(self.0.len(), names.len(), "as many variables as the model has: {names:?}");
        let value = |name: &String| {
            let found = self.0.iter().find(|(n, _)| n == name);
            found.unwrap_or_else(|| panic!("no value of {name}")).1
        };
        names.iter().map(value).collect()
    }
}

/// A configuration with velocities and accelerations, all of them as the equations want.
#[derive(Clone, Debug)]
pub struct Motion {
    /// Coordinates.
    pub q: Vec<f64>,
    /// Their rates.
    pub v: Vec<f64>,
    /// The rates of these.
    pub a: Vec<f64>,
    /// Time.
    pub t: f64,
    /// `v . dL/dv - L`.
    pub energy: f64,
    /// Multipliers, holonomic ones first: reactions along the slopes of the equations.
    pub multipliers: Vec<f64>,
}

fn second(x: f64, outer: f64, inner: f64) -> Second {
    Dual::new(Dual::new(x, inner), Dual::constant(outer))
}

/// Values with infinitesimals along two directions: zero but for the entry `at` of the first.
fn seeded(values: &[f64], at: Option<usize>, inner: &[f64]) -> Vec<Second> {
    let outer = |i: usize| f64::from(u8::from(at == Some(i)));
    values
        .iter()
        .enumerate()
        .map(|(i, x)| second(*x, outer(i), inner.get(i).copied().unwrap_or(0.0)))
        .collect()
}

/// The smallest correction of `x` that takes linear equations with this residual and these rows to zero.
fn corrected(x: &mut [f64], residual: &[f64], rows: &[Vec<f64>]) {
    if rows.is_empty() {
        return;
    }
    let matrix = DMatrix::from_fn(rows.len(), x.len(), |i, j| rows[i][j]);
    let gram = (&matrix * matrix.transpose()).full_piv_lu();
    let factors = gram.solve(&DVector::from_column_slice(residual)).expect("the equations are independent");
    let step = matrix.transpose() * factors;
    x.iter_mut().zip(step.iter()).for_each(|(x, s)| *x -= s);
}

/// Slopes of the holonomic equations, with the equations.
fn slopes_of_places<S: Unreduced>(system: &S, q: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut values = Vec::new();
    for j in 0..q.len() {
        let moved: Vec<Dual> =
            (q.iter().enumerate()).map(|(i, x)| Dual::new(*x, f64::from(u8::from(i == j)))).collect();
        let g = system.holonomic(&moved);
        rows.resize(g.len(), vec![0.0; q.len()]);
        values = g.iter().map(|g| g.value).collect();
        g.iter().zip(&mut rows).for_each(|(g, row)| row[j] = g.derivative);
    }
    (values, rows)
}

/// Slopes of the equations between velocities by velocities, with the equations.
fn slopes_of_rates<S: Unreduced>(system: &S, (q, v, t): (&[f64], &[f64], f64)) -> (Vec<f64>, Vec<Vec<f64>>) {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let mut values = Vec::new();
    let at: Vec<Dual> = q.iter().map(|x| Dual::constant(*x)).collect();
    for j in 0..v.len() {
        let moved: Vec<Dual> =
            (v.iter().enumerate()).map(|(i, x)| Dual::new(*x, f64::from(u8::from(i == j)))).collect();
        let c = system.nonholonomic(&at, &moved, Dual::constant(t));
        rows.resize(c.len(), vec![0.0; v.len()]);
        values = c.iter().map(|c| c.value).collect();
        c.iter().zip(&mut rows).for_each(|(c, row)| row[j] = c.derivative);
    }
    (values, rows)
}

/// A random state that satisfies all equations, and how it moves.
///
/// # Panics
/// When no such state is found, or when the equations do not determine the accelerations.
pub fn random_motion<S: Unreduced>(system: &S, random: &mut Random) -> Motion {
    let mut q = system.place(random);
    for _ in 0..30 {
        let (residual, rows) = slopes_of_places(system, &q);
        corrected(&mut q, &residual, &rows);
    }
    let mut v: Vec<f64> = q.iter().map(|_| random.number()).collect();
    let t = 1.0 + random.number();
    for _ in 0..3 {
        let (_, mut rows) = slopes_of_places(system, &q);
        let mut residual: Vec<f64> = rows.iter().map(|row| dot(row, &v)).collect();
        let (rest, others) = slopes_of_rates(system, (&q, &v, t));
        residual.extend(rest);
        rows.extend(others);
        corrected(&mut v, &residual, &rows);
    }
    let left = slopes_of_places(system, &q).0.into_iter().chain(slopes_of_rates(system, (&q, &v, t)).0);
    let left = left.fold(0.0, |worst: f64, r| worst.max(r.abs()));
    assert!(left < 1e-12, "no state was found: {left:e} is left of the equations");
    moved(system, q, v, t)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

/// The accelerations at a state that satisfies the equations.
fn moved<S: Unreduced>(system: &S, q: Vec<f64>, v: Vec<f64>, t: f64) -> Motion {
    let n = q.len();
    let still = Dual::constant(Dual::constant(t));
    let flowing = second(t, 0.0, 1.0);
    let along_v: Vec<Second> = q.iter().zip(&v).map(|(x, v)| second(*x, 0.0, *v)).collect();
    let fixed = seeded(&q, None, &[]);

    let (_, mut rows) = slopes_of_places(system, &q);
    // Twice along v: the second derivative in that direction.
    let bent: Vec<Second> = q.iter().zip(&v).map(|(x, v)| second(*x, *v, *v)).collect();
    let mut turned: Vec<f64> = system.holonomic(&bent).iter().map(|g| g.derivative.derivative).collect();
    let (_, others) = slopes_of_rates(system, (&q, &v, t));
    rows.extend(others);
    let c = system.nonholonomic(&along_v, &seeded(&v, None, &[]), flowing);
    turned.extend(c.iter().map(|c| c.value.derivative));
    let mut reactions = rows.clone();
    system.redirect(&q, &v, &mut reactions);

    let size = n + rows.len();
    let mut matrix = DMatrix::zeros(size, size);
    let mut right = DVector::zeros(size);
    let force = system.force(&q, &v, t);
    let mut energy = -system.lagrangian(&q, &v, t);
    for i in 0..n {
        for j in 0..n {
            let mut unit = vec![0.0; n];
            unit[j] = 1.0;
            let l = system.lagrangian(&fixed, &seeded(&v, Some(i), &unit), still);
            matrix[(i, j)] = l.derivative.derivative;
        }
        // d/dt of dL/dv_i with the velocities held.
        let momentum = system.lagrangian(&along_v, &seeded(&v, Some(i), &[]), flowing);
        let slope = system.lagrangian(&seeded(&q, Some(i), &[]), &seeded(&v, None, &[]), still);
        right[i] = slope.derivative.value - momentum.derivative.derivative + force[i];
        energy += momentum.derivative.value * v[i];
        for (k, (row, reaction)) in rows.iter().zip(&reactions).enumerate() {
            matrix[(n + k, i)] = row[i];
            matrix[(i, n + k)] = -reaction[i];
        }
    }
    for (k, turned) in turned.iter().enumerate() {
        right[n + k] = -turned;
    }
    let solution = matrix.full_piv_lu().solve(&right).expect("the equations determine the accelerations");
    let multipliers = solution.rows(n, rows.len()).iter().copied().collect();
    Motion { a: solution.rows(0, n).iter().copied().collect(), q, v, t, energy, multipliers }
}
