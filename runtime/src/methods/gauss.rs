//! Collocation at Gauss points, and the iterations for its stages.
//!
//! The module deliberately does not know step sizes or tolerances: stages are solved to round-off.

use core::ops::Range;

use super::{Constant, Derivatives, Estimate, Method, Step, Tableau, c, compensated_advance};
use crate::error::Error;
use crate::options::{Options, signed};
use crate::real::Real;
use crate::system::{Differentiable, SquareStorage, StateVector, System};

/// The implicit method of order `2 STAGES` that collocates at the `STAGES` Gauss points, for fixed steps.
///
/// It is symmetric and symplectic and keeps quadratic invariants; rounding of its coefficients does not spoil
/// that, because they are stored such that `b_i a_ij + b_j a_ji = b_i b_j` holds exactly. There is no error
/// estimate: steps that vary would lose these properties. Dense output is of order `STAGES + 2`, for one more evaluation in
/// steps where it is asked for.
///
/// The stages are iterated from extrapolated starting values until round-off stops the progress.
///
/// ```
/// use hamel_runtime::{Gauss6, Integrator, Options, System};
///
/// struct Oscillator;
///
/// impl System<f64> for Oscillator {
///     type State = [f64; 2];
///     fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
///         *dy = [y[1], -y[0]];
///     }
/// }
///
/// let method = Gauss6::fixed_point();
/// let mut solver = Integrator::new(&Oscillator, method, 0.0, [1.0, 0.0], Options::fixed(0.1))?;
/// solver.integrate_to(1000.0)?;
/// let [q, p] = *solver.state();
/// assert!((q * q + p * p - 1.0).abs() < 1e-14);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
///
/// # Source
///
/// Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), sections II.1.3, VI.4, VIII.6; the exact
/// symplecticity after Antonana, Makazaga and Murua, Reducing and monitoring round-off error propagation for
/// symplectic implicit Runge-Kutta schemes (2017), equation 12. Dense output is the one polynomial that meets the
/// conditions up to its order with the derivatives at both ends, at the stages, and at one more point, taken from the
/// polynomial through the others: of the rooted trees of order `STAGES + 2`, all but the bush on a stem are quadratures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gauss<const STAGES: usize, I = FixedPoint> {
    iteration: I,
}

/// Collocation at two Gauss points, of order 4.
pub type Gauss4<I = FixedPoint> = Gauss<2, I>;
/// Collocation at three Gauss points, of order 6.
pub type Gauss6<I = FixedPoint> = Gauss<3, I>;
/// Collocation at four Gauss points, of order 8.
pub type Gauss8<I = FixedPoint> = Gauss<4, I>;

/// Fixed-point iteration: for steps well below the time scales of the system.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FixedPoint;

/// Newton's iteration with the Jacobian at the start of the step, for stiff systems and long steps.
///
/// It needs a [`Differentiable`] system; a state that is no array brings [`SquareStorage`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Newton;

impl<const STAGES: usize> Gauss<STAGES> {
    /// The method with stages from fixed-point iteration.
    #[must_use]
    pub const fn fixed_point() -> Self {
        Self { iteration: FixedPoint }
    }
}

impl<const STAGES: usize> Gauss<STAGES, Newton> {
    /// The method with stages from Newton's iteration.
    #[must_use]
    pub const fn newton() -> Self {
        Self { iteration: Newton }
    }
}

impl<const STAGES: usize, I> Gauss<STAGES, I> {
    const TABLEAU: &'static Tableau = match STAGES {
        2 => &GAUSS4,
        3 => &GAUSS6,
        4 => &GAUSS8,
        _ => panic!("Gauss methods have 2, 3 or 4 stages"),
    };

    /// Weights `b_j`.
    const B: [Constant; STAGES] = {
        let mut b = [c(0.0, 0.0); STAGES];
        let mut j = 0;
        while j < STAGES {
            b[j] = Self::TABLEAU.weights[j].1;
            j += 1;
        }
        b
    };

    /// Rows `(j + 1, mu_ij)` of coefficients `mu_ij = a_ij / b_j` with `mu_ij + mu_ji = 1` exactly, in both parts.
    const MU: [[(usize, Constant); STAGES]; STAGES] = {
        let mut mu = [[(0, c(0.5, 0.0)); STAGES]; STAGES];
        let mut i = 0;
        while i < STAGES {
            let mut j = 0;
            while j < STAGES {
                mu[i][j].0 = j + 1;
                j += 1;
            }
            j = i + 1;
            while j < STAGES {
                let (a, b) = (Self::TABLEAU.stages[i + 1][j].1, Self::B[j]);
                // The sum lies between one and two, and rounds to a multiple of 2^-52: so do both coefficients.
                let above = (a.hi / b.hi + 1.5) - 1.5;
                let (product, error) = exact_product(above, b.hi);
                let rest = (((a.hi - product) - error) + (a.lo - above * b.lo)) / b.hi;
                // Likewise a multiple of 2^-104, so that the parts of a number and of its complement to one have
                // room in 106 bits.
                let below = (rest + 1.5 * f64::EPSILON) - 1.5 * f64::EPSILON;
                (mu[i][j].1, mu[j][i].1) = (c(above, below), c(1.0 - above, -below));
                j += 1;
            }
            i += 1;
        }
        mu
    };

    /// Weights `1 / prod_m (x_j - x_m)` of interpolation at the nodes `x_j`: zero, the Gauss points, one.
    const BARYCENTRIC: ([f64; STAGES], [f64; 2]) = {
        let (mut inner, mut ends) = ([0.0; STAGES], [0.0; 2]);
        let nodes = Self::TABLEAU.nodes;
        let mut j = 0;
        while j <= STAGES + 1 {
            let x = if j <= STAGES { nodes[j].hi } else { 1.0 };
            let mut product = 1.0;
            let mut m = 0;
            while m <= STAGES + 1 {
                if m != j {
                    product *= x - if m <= STAGES { nodes[m].hi } else { 1.0 };
                }
                m += 1;
            }
            if j == 0 || j == STAGES + 1 {
                ends[if j == 0 { 0 } else { 1 }] = 1.0 / product;
            } else {
                inner[j - 1] = 1.0 / product;
            }
            j += 1;
        }
        (inner, ends)
    };
}

/// `x y = product + error` exactly, after Dekker and Veltkamp, for constants.
const fn exact_product(x: f64, y: f64) -> (f64, f64) {
    const fn split(x: f64) -> (f64, f64) {
        let t = 134_217_729.0 * x; // 2^27 + 1
        let upper = t - (t - x);
        (upper, x - upper)
    }
    let product = x * y;
    let ((a, b), (c, d)) = (split(x), split(y));
    (product, ((a * c - product) + a * d + b * c) + b * d)
}

/// Derivatives kept at most: the stages, and one for dense output.
const MAX_STORED: usize = 5;

/// What a Gauss method keeps between steps: the stages, and weights that extrapolate them.
#[derive(Clone, Debug)]
pub struct GaussStorage<R, V, W, const STAGES: usize> {
    /// The stages, the derivative for dense output, and room.
    stages: [V; MAX_STORED],
    /// The stages times their weights.
    increments: [V; STAGES],
    /// Ratio of step sizes that `inner` and `ends` belong to.
    ratio: R,
    /// Weights of the old stages in each starting value.
    inner: [[R; STAGES]; STAGES],
    /// Weights of the derivatives at both ends of the old step.
    ends: [[R; 2]; STAGES],
    workspace: W,
}

impl<R: Real, V: StateVector<R>, W, const STAGES: usize> GaussStorage<R, V, W, STAGES> {
    fn new(y0: &V, workspace: W) -> Self {
        Self {
            stages: core::array::from_fn(|_| y0.zeros_like()),
            increments: core::array::from_fn(|_| y0.zeros_like()),
            ratio: R::ZERO,
            inner: [[R::ZERO; STAGES]; STAGES],
            ends: [[R::ZERO; 2]; STAGES],
            workspace,
        }
    }

    /// Starting values: the polynomial through all derivatives of the last step, or the derivative at the start.
    fn predict<S: System<R, State = V>, I>(&mut self, step: &Step<'_, R, S>) {
        self.predict_stages::<S, I>(step);
        for (i, (stage, increment)) in self.stages.iter().zip(&mut self.increments).enumerate() {
            weigh::<R, V, STAGES, I>(i, stage, increment);
        }
    }

    fn predict_stages<S: System<R, State = V>, I>(&mut self, step: &Step<'_, R, S>) {
        let slope = step.from.slope.as_slice();
        let ratio = step.last_h.map_or(R::ZERO, |last| step.h / last);
        if !(ratio.all_gt(R::ZERO) && R::from_f64(1.5).all_gt(ratio)) {
            for stage in &mut self.stages {
                stage.as_mut_slice().copy_from_slice(slope);
            }
            return;
        }
        if ratio != self.ratio {
            self.ratio = ratio;
            let (inner, ends) = Gauss::<STAGES, I>::BARYCENTRIC;
            let nodes = Gauss::<STAGES, I>::TABLEAU.nodes;
            for i in 0..STAGES {
                let beyond = ratio * nodes[i + 1].get();
                let x = R::ONE + beyond;
                let product = nodes[1..].iter().fold(x * beyond, |product, node| product * (x - node.get()));
                self.inner[i] =
                    core::array::from_fn(|j| product * R::from_f64(inner[j]) / (x - nodes[j + 1].get()));
                self.ends[i] = [product * R::from_f64(ends[0]) / x, product * R::from_f64(ends[1]) / beyond];
            }
        }
        let before = step.to.slope.as_slice();
        for c in 0..slope.len() {
            let old: [R; STAGES] = core::array::from_fn(|j| self.stages[j].as_slice()[c]);
            for (i, stage) in self.stages.iter_mut().take(STAGES).enumerate() {
                let start = self.ends[i][0] * before[c] + self.ends[i][1] * slope[c];
                let terms = self.inner[i].iter().zip(&old);
                stage.as_mut_slice()[c] = terms.fold(start, |sum, (&weight, &k)| weight.mul_add(k, sum));
            }
        }
    }
}

/// Evaluates the right-hand side at stage `i` into `out`.
///
/// `increments` are `b_j k_j`.
#[inline(always)]
fn evaluate_stage<R: Real, S: System<R>, const STAGES: usize, I>(
    increments: &[S::State; STAGES],
    i: usize,
    step: &mut Step<'_, R, S>,
    out: &mut S::State,
) {
    let first = &step.from.slope;
    let k = Derivatives { n_stages: STAGES + 1, first, stored: increments, last: first };
    let (y, h, work) = (step.from.state.as_slice(), step.h, step.work.as_mut_slice());
    k.for_each_sum(&Gauss::<STAGES, I>::MU[i], y.len(), |c, slope| work[c] = h.mul_add(slope, y[c]));
    let node: R = Gauss::<STAGES, I>::TABLEAU.nodes[i + 1].get();
    step.system.rhs(step.t + node * h, step.work, out);
    *step.rhs_evals += 1;
}

/// `increment = b_i k_i`.
#[inline(always)]
fn weigh<R: Real, V: StateVector<R>, const STAGES: usize, I>(i: usize, stage: &V, increment: &mut V) {
    let weight: R = Gauss::<STAGES, I>::B[i].get();
    for (increment, &k) in increment.as_mut_slice().iter_mut().zip(stage.as_slice()) {
        *increment = weight * k;
    }
}

/// Size of a change of the stage derivatives, and of what it changes: both of the order of a state.
#[derive(Clone, Copy, Default)]
struct Change {
    change: f64,
    size: f64,
}

impl Change {
    #[inline(always)]
    fn add<R: Real>(&mut self, h: f64, y: R, k: R, difference: R) {
        let change = h * difference.magnitude();
        let size = y.magnitude() + h * k.magnitude();
        // A NaN is kept, since nothing is above it.
        self.change = if change.is_nan() || change > self.change { change } else { self.change };
        self.size = if size > self.size { size } else { self.size };
    }
}

/// Repeats `sweep` until the stages do not change, or until the changes stop to decrease in round-off.
///
/// # Source
///
/// Hairer, McLachlan and Razakarivony, Achieving Brouwer's law with implicit Runge-Kutta methods (2008), section 4.
fn iterate<R: Real, S: System<R>>(
    method: &'static str,
    step: &mut Step<'_, R, S>,
    mut sweep: impl FnMut(&mut Step<'_, R, S>) -> Change,
) -> Result<(), Error> {
    const MAX_ITERATIONS: u32 = 100;
    /// Changes that stop to decrease above this many units of round-off are no round-off.
    const ROUND_OFF: f64 = 1e3;
    /// Changes may grow at first.
    const PATIENCE: u32 = 10;
    let mut previous = f64::INFINITY;
    for iterations in 1..=MAX_ITERATIONS {
        let Change { change, size } = sweep(step);
        // What is not finite is found, and explained, by the integrator.
        if change == 0.0 || !change.is_finite() {
            return Ok(());
        }
        if change >= previous {
            if change <= ROUND_OFF * R::EPSILON * size {
                return Ok(());
            }
            if iterations > PATIENCE {
                return Err(not_converged(method, step, iterations));
            }
        }
        previous = change;
    }
    Err(not_converged(method, step, MAX_ITERATIONS))
}

#[cold]
fn not_converged<R: Real, S: System<R>>(
    method: &'static str,
    step: &Step<'_, R, S>,
    iterations: u32,
) -> Error {
    Error::NotConverged { method, t: signed(step.t), h: signed(step.h), iterations }
}

/// The new state from the stages.
fn finish<R: Real, S: System<R>>(tableau: &Tableau, stages: &[S::State], step: &mut Step<'_, R, S>) {
    let (from, h) = (step.from, step.h);
    let first = &from.slope;
    let k = Derivatives { n_stages: tableau.n_stages(), first, stored: stages, last: first };
    compensated_advance((from, step.to), h, tableau.weights, &k);
}

impl<R: Real, S: System<R>, const STAGES: usize> Method<R, S> for Gauss<STAGES, FixedPoint> {
    const TABLEAU: &'static Tableau = Self::TABLEAU;

    type Storage = GaussStorage<R, S::State, S::State, STAGES>;

    fn storage(&self, _system: &S, _t0: R, y0: &S::State, _options: &Options<R>) -> Self::Storage {
        GaussStorage::new(y0, y0.zeros_like())
    }

    fn stages(storage: &Self::Storage) -> &[S::State] {
        &storage.stages[..STAGES + 1]
    }

    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        &mut storage.stages[..STAGES + 1]
    }

    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        storage.predict::<S, FixedPoint>(step);
        let GaussStorage { stages, increments, workspace: fresh, .. } = storage;
        let h = step.h.magnitude();
        iterate(Self::TABLEAU.name, step, |step| {
            let mut sum = Change::default();
            for i in 0..STAGES {
                evaluate_stage::<R, S, STAGES, FixedPoint>(increments, i, step, fresh);
                let y = step.from.state.as_slice();
                let values = stages[i].as_mut_slice().iter_mut().zip(fresh.as_slice());
                for ((stage, &value), &y) in values.zip(y) {
                    sum.add(h, y, value, value - *stage);
                    *stage = value;
                }
                weigh::<R, _, STAGES, FixedPoint>(i, fresh, &mut increments[i]);
            }
            sum
        })?;
        finish(Self::TABLEAU, stages, step);
        Ok(())
    }
}

/// What Newton's iteration needs: the Jacobian, the matrix `1 - h A x J` and its factors, and residuals.
#[derive(Clone, Debug)]
pub struct NewtonWorkspace<R: Real, V: SquareStorage<R>, const STAGES: usize> {
    jacobian: V::Rows,
    /// Blocks of the rows of a stage and the columns of another.
    factors: [[V::Rows; STAGES]; STAGES],
    /// Row that was exchanged with each row.
    pivots: [V::Positions; STAGES],
    /// The row of the pivot.
    pivot_row: [V; STAGES],
    residuals: [V; STAGES],
}

impl<R: Real, V: SquareStorage<R>, const STAGES: usize> NewtonWorkspace<R, V, STAGES> {
    fn new(y0: &V) -> Self {
        let states = || core::array::from_fn(|_| y0.zeros_like());
        Self {
            jacobian: y0.rows_like(),
            factors: core::array::from_fn(|_| core::array::from_fn(|_| y0.rows_like())),
            pivots: core::array::from_fn(|_| y0.positions_like()),
            pivot_row: states(),
            residuals: states(),
        }
    }

    /// Number of components of a state.
    fn n(&self) -> usize {
        self.residuals[0].as_slice().len()
    }

    /// The columns of a row that belong to a stage.
    fn row(&mut self, (i, row): (usize, usize), j: usize) -> &mut [R] {
        self.factors[i][j].as_mut()[row].as_mut_slice()
    }

    /// Writes `1 - h A x J` and factors it by elimination with the largest pivots; false if one vanishes.
    fn factor(&mut self, h: R, tableau: &Tableau) -> bool {
        let n = self.n();
        for i in 0..STAGES {
            for j in 0..STAGES {
                let a = h * tableau.stages[i + 1][j].1.get();
                let rows = self.factors[i][j].as_mut().iter_mut().zip(self.jacobian.as_ref());
                for (row, (factors, jacobian)) in rows.enumerate() {
                    let entries = factors.as_mut_slice().iter_mut().zip(jacobian.as_slice());
                    for (column, (factor, &entry)) in entries.enumerate() {
                        let one = if i == j && row == column { R::ONE } else { R::ZERO };
                        *factor = one - a * entry;
                    }
                }
            }
        }
        let split = |index: usize| (index / n, index % n);
        for p in 0..STAGES * n {
            let (i, row) = split(p);
            let mut size = |q: usize| self.row(split(q), i)[row].magnitude();
            let largest = (p + 1..STAGES * n).fold(p, |best, q| if size(q) > size(best) { q } else { best });
            self.pivots[i].as_mut()[row] = largest;
            if largest != p {
                for j in 0..STAGES {
                    for column in 0..n {
                        let saved = self.row((i, row), j)[column];
                        let other = core::mem::replace(&mut self.row(split(largest), j)[column], saved);
                        self.row((i, row), j)[column] = other;
                    }
                }
            }
            for j in 0..STAGES {
                self.pivot_row[j].as_mut_slice().copy_from_slice(self.factors[i][j].as_ref()[row].as_slice());
            }
            let pivot = self.pivot_row[i].as_slice()[row];
            if !pivot.all_ne(R::ZERO) || !pivot.all_finite() {
                return false;
            }
            for q in p + 1..STAGES * n {
                let (target, target_row) = split(q);
                let entry = &mut self.factors[target][i].as_mut()[target_row].as_mut_slice()[row];
                let ratio = *entry / pivot;
                *entry = ratio;
                for j in i..STAGES {
                    let first = if j == i { row + 1 } else { 0 };
                    let out = &mut self.factors[target][j].as_mut()[target_row].as_mut_slice()[first..];
                    for (out, &entry) in out.iter_mut().zip(&self.pivot_row[j].as_slice()[first..]) {
                        *out -= ratio * entry;
                    }
                }
            }
        }
        true
    }

    /// Replaces the residuals by the solution.
    fn solve(&mut self) {
        let n = self.n();
        let split = |index: usize| (index / n, index % n);
        for p in 0..STAGES * n {
            let (i, row) = split(p);
            let (other, other_row) = split(self.pivots[i].as_ref()[row]);
            let saved = self.residuals[i].as_slice()[row];
            let exchanged = core::mem::replace(&mut self.residuals[other].as_mut_slice()[other_row], saved);
            self.residuals[i].as_mut_slice()[row] = exchanged;
            // Exchanges before elimination: later exchanges have permuted the multipliers too.
        }
        for p in 0..STAGES * n {
            let (i, row) = split(p);
            let known = self.known((i, row), 0..i, 0..row);
            self.residuals[i].as_mut_slice()[row] -= known;
        }
        for p in (0..STAGES * n).rev() {
            let (i, row) = split(p);
            let known = self.known((i, row), i + 1..STAGES, row + 1..n);
            let pivot = self.factors[i][i].as_ref()[row].as_slice()[row];
            let residual = &mut self.residuals[i].as_mut_slice()[row];
            *residual = (*residual - known) / pivot;
        }
    }

    /// The sum of a row over the residuals of other stages and of components of its own, in the order of components.
    fn known(&self, (i, row): (usize, usize), stages: Range<usize>, own: Range<usize>) -> R {
        let n = self.n();
        let add = |sum: R, j: usize, columns: Range<usize>| {
            let factors = &self.factors[i][j].as_ref()[row].as_slice()[columns.clone()];
            let terms = factors.iter().zip(&self.residuals[j].as_slice()[columns]);
            terms.fold(sum, |sum, (&factor, &residual)| sum + factor * residual)
        };
        if stages.start <= i {
            let sum = stages.fold(R::ZERO, |sum, j| add(sum, j, 0..n));
            add(sum, i, own)
        } else {
            stages.fold(add(R::ZERO, i, own), |sum, j| add(sum, j, 0..n))
        }
    }
}

impl<R: Real, S: Differentiable<R>, const STAGES: usize> Method<R, S> for Gauss<STAGES, Newton>
where
    S::State: SquareStorage<R>,
{
    const TABLEAU: &'static Tableau = match STAGES {
        2 => &Tableau { name: "gauss4-newton", ..GAUSS4 },
        3 => &Tableau { name: "gauss6-newton", ..GAUSS6 },
        _ => &Tableau { name: "gauss8-newton", ..GAUSS8 },
    };

    type Storage = GaussStorage<R, S::State, NewtonWorkspace<R, S::State, STAGES>, STAGES>;

    fn storage(&self, _system: &S, _t0: R, y0: &S::State, _options: &Options<R>) -> Self::Storage {
        GaussStorage::new(y0, NewtonWorkspace::new(y0))
    }

    fn stages(storage: &Self::Storage) -> &[S::State] {
        &storage.stages[..STAGES + 1]
    }

    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        &mut storage.stages[..STAGES + 1]
    }

    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        storage.predict::<S, Newton>(step);
        let GaussStorage { stages, increments, workspace, .. } = storage;
        let method = <Self as Method<R, S>>::TABLEAU.name;
        step.system.jacobian(step.t, &step.from.state, workspace.jacobian.as_mut());
        *step.jacobian_evals += 1;
        if !workspace.factor(step.h, Self::TABLEAU) {
            return Err(not_converged(method, step, 0));
        }
        let h = step.h.magnitude();
        iterate(method, step, |step| {
            let mut sum = Change::default();
            for (i, (residual, stage)) in workspace.residuals.iter_mut().zip(&*stages).enumerate() {
                evaluate_stage::<R, S, STAGES, Newton>(increments, i, step, residual);
                for (residual, &stage) in residual.as_mut_slice().iter_mut().zip(stage.as_slice()) {
                    *residual -= stage;
                }
            }
            workspace.solve();
            for (i, (stage, correction)) in stages.iter_mut().zip(&workspace.residuals).enumerate() {
                let corrections = correction.as_slice().iter().zip(step.from.state.as_slice());
                for (k, (&correction, &y)) in stage.as_mut_slice().iter_mut().zip(corrections) {
                    *k += correction;
                    sum.add(h, y, *k, correction);
                }
                weigh::<R, _, STAGES, Newton>(i, stage, &mut increments[i]);
            }
            sum
        })?;
        finish(Self::TABLEAU, stages, step);
        Ok(())
    }
}

/// The method of order 4.
const GAUSS4: Tableau = Tableau {
    name: "gauss4",
    order: 4,
    nodes: &[
        c(0.0, 0.0),
        c(0.2113248654051871, 1.1030435245950743e-17),
        c(0.7886751345948129, 1.6725140369678172e-17),
    ],
    stages: &[
        &[],
        &[(1, c(0.25, 0.0)), (2, c(-0.03867513459481288, -2.8473525618637145e-18))],
        &[(1, c(0.5386751345948129, 1.6725140369678172e-17)), (2, c(0.25, 0.0))],
    ],
    weights: &[(1, c(0.5, 0.0)), (2, c(0.5, 0.0))],
    estimate: Estimate::None,
    dense_nodes: &[c(0.3333333333333333, 1.850371707708594e-17)],
    dense_stages: &[&[
        (0, c(0.07407407407407407, 4.11193712824132e-18)),
        (1, c(0.2579296894495465, -6.958384228987656e-18)),
        (2, c(0.0013295698097127932, -1.170388373807091e-19)),
    ]],
    dense: &[(1, &[c(-4.5, 0.0)]), (2, &[c(-4.5, 0.0)]), (3, &[c(2.25, 0.0)]), (4, &[c(6.75, 0.0)])],
};

/// The method of order 6.
const GAUSS6: Tableau = Tableau {
    name: "gauss6",
    order: 6,
    nodes: &[
        c(0.0, 0.0),
        c(0.11270166537925831, -2.5675694035077516e-19),
        c(0.5, 0.0),
        c(0.8872983346207417, -1.3621030867463682e-17),
    ],
    stages: &[
        &[],
        &[
            (1, c(0.1388888888888889, -6.1679056923619804e-18)),
            (2, c(-0.0359766675249389, -1.7131477166576787e-18)),
            (3, c(0.009789444015308325, 6.854025647616559e-19)),
        ],
        &[
            (1, c(0.30026319498086457, 2.5164098933700036e-17)),
            (2, c(0.2222222222222222, 1.2335811384723961e-17)),
            (3, c(-0.022485417203086815, 6.64006153065758e-19)),
        ],
        &[
            (1, c(0.26798833376246944, 7.795467762236068e-18)),
            (2, c(0.48042111196938336, -1.5248592937337767e-17)),
            (3, c(0.1388888888888889, -6.1679056923619804e-18)),
        ],
    ],
    weights: &[
        (1, c(0.2777777777777778, -1.2335811384723961e-17)),
        (2, c(0.4444444444444444, 2.4671622769447922e-17)),
        (3, c(0.2777777777777778, -1.2335811384723961e-17)),
    ],
    estimate: Estimate::None,
    dense_nodes: &[c(0.5, 0.0)],
    dense_stages: &[&[
        (0, c(-0.03125, 0.0)),
        (1, c(0.3406067715038585, 3.299710009021554e-17)),
        (2, c(0.2222222222222222, 1.2335811384723961e-17)),
        (3, c(-0.06282899372608074, -3.6995480514961326e-18)),
        (4, c(0.03125, 0.0)),
    ]],
    dense: &[
        (0, &[c(-4.5, 0.0), c(4.0, 0.0)]),
        (1, &[c(6.560819455172847, 3.4521146054490194e-17), c(-6.666666666666667, 2.9605947323337506e-16)]),
        (2, &[c(5.333333333333333, 2.9605947323337506e-16), c(-10.666666666666666, -5.921189464667501e-16)]),
        (3, &[c(0.10584721149381926, 2.4862880996816924e-18), c(-6.666666666666667, 2.9605947323337506e-16)]),
        (4, &[c(0.5, 0.0), c(4.0, 0.0)]),
        (5, &[c(-8.0, 0.0), c(16.0, 0.0)]),
    ],
};

/// The method of order 8.
const GAUSS8: Tableau = Tableau {
    name: "gauss8",
    order: 8,
    nodes: &[
        c(0.0, 0.0),
        c(0.06943184420297371, -1.3430706493351195e-18),
        c(0.33000947820757187, -3.745660853481089e-18),
        c(0.6699905217924281, 3.745660853481089e-18),
        c(0.9305681557970263, -5.416808058192271e-17),
    ],
    stages: &[
        &[],
        &[
            (1, c(0.08696371128436346, 1.9150840971873604e-18)),
            (2, c(-0.026604180084998794, 9.900118323689559e-19)),
            (3, c(0.012627462689404725, -5.202235051507822e-19)),
            (4, c(-0.0035551496857956833, 1.7518474720716254e-19)),
        ],
        &[
            (1, c(0.18811811749986806, 6.682758305892193e-18)),
            (2, c(0.16303628871563652, 1.1962703710627097e-17)),
            (3, c(-0.027880428602470895, -3.686704410770683e-19)),
            (4, c(0.006735500594538156, -3.3840897921322164e-19)),
        ],
        &[
            (1, c(0.16719192197418878, -5.372401944284497e-18)),
            (2, c(0.35395300603374397, 7.949198655961897e-21)),
            (3, c(0.16303628871563652, 1.1962703710627097e-17)),
            (4, c(-0.014190694931141144, 6.168568404361416e-19)),
        ],
        &[
            (1, c(0.1774825722545226, 9.29283474409218e-18)),
            (2, c(0.31344511474186837, -2.2391902924968816e-17)),
            (3, c(0.35267675751627187, -1.3507330747900623e-18)),
            (4, c(0.08696371128436346, 1.9150840971873604e-18)),
        ],
    ],
    weights: &[
        (1, c(0.17392742256872692, 3.830168194374721e-18)),
        (2, c(0.32607257743127305, 2.3925407421254193e-17)),
        (3, c(0.32607257743127305, 2.3925407421254193e-17)),
        (4, c(0.17392742256872692, 3.830168194374721e-18)),
    ],
    estimate: Estimate::None,
    dense_nodes: &[c(0.7, 4.4408920985006264e-17)],
    dense_stages: &[&[
        (0, c(0.012285, -7.80486786311485e-19)),
        (1, c(0.15182251083265905, 5.776024440872862e-18)),
        (2, c(0.3517867077179952, -2.005123656876771e-17)),
        (3, c(0.2104763960288042, -4.3974219668978405e-18)),
        (4, c(-0.053565614579458416, 1.8349917033275627e-18)),
        (5, c(0.027195, -4.2299497238218464e-19)),
    ]],
    dense: &[
        (
            0,
            &[
                c(-8.070668693009118, -4.967320037228664e-16),
                c(7.0, 0.0),
                c(9.663120567375886, 5.417258446397927e-16),
            ],
        ),
        (
            1,
            &[
                c(10.511471538573442, 1.2233694334462944e-16),
                c(-9.890096504226937, -6.774665938351644e-16),
                c(-15.492376662567317, -3.061084197473471e-16),
            ],
        ),
        (
            2,
            &[
                c(-1.8317408988837236, -1.4206590925807033e-16),
                c(2.890096504226938, -2.1071182586496088e-16),
                c(9.56466034609202, -4.2075187105453924e-16),
            ],
        ),
        (
            3,
            &[
                c(-12.233569912784626, 2.357854437838745e-16),
                c(2.890096504226938, -2.1071182586496088e-16),
                c(42.58633975530123, 5.226266874538746e-16),
            ],
        ),
        (
            4,
            &[
                c(-3.5419054077561567, -2.2357992723065883e-17),
                c(-9.890096504226937, -6.774665938351644e-16),
                c(29.121518405145697, -1.1437818705231003e-15),
            ],
        ),
        (
            5,
            &[
                c(2.50177304964539, 2.519655091347873e-17),
                c(7.0, 0.0),
                c(-16.34160756501182, -1.1758390426290074e-16),
            ],
        ),
        (
            6,
            &[
                c(12.664640324214792, 5.579236273698862e-17),
                c(0.0, 0.0),
                c(-59.1016548463357, 9.2387353349422e-16),
            ],
        ),
    ],
};

#[cfg(test)]
mod tests {
    use super::{FixedPoint, Gauss};
    use crate::{DoubleDouble, Real};

    /// `mu_ij + mu_ji = 1` exactly in both scalars, and `b_j mu_ij` is the coefficient to the digits of the scalar.
    fn check<R: Real, const STAGES: usize>() {
        let (mu, b) = (Gauss::<STAGES, FixedPoint>::MU, Gauss::<STAGES, FixedPoint>::B);
        for (i, row) in mu.iter().enumerate() {
            for j in 0..STAGES {
                let (above, below) = (row[j].1.get::<R>(), mu[j][i].1.get::<R>());
                assert_eq!(above + below, R::ONE, "{STAGES} stages: {i}, {j}");
                let a = Gauss::<STAGES, FixedPoint>::TABLEAU.stages[i + 1][j].1.get::<R>();
                let defect = (b[j].get::<R>() * above - a).magnitude();
                assert!(defect <= 2.0 * R::EPSILON, "{STAGES} stages: {i}, {j}: {defect:e}");
            }
        }
    }

    #[test]
    fn stages_are_exactly_symplectic_in_every_scalar() {
        fn both<const STAGES: usize>() {
            check::<f64, STAGES>();
            check::<DoubleDouble, STAGES>();
        }
        both::<2>();
        both::<3>();
        both::<4>();
    }
}
