//! Collocation at Gauss points, and the iterations for its stages.
//!
//! The module deliberately does not know step sizes or tolerances: stages are solved to round-off.

#[cfg(feature = "lanes")]
mod loops;
mod newton;
#[cfg(feature = "lanes")]
mod sixteen;
mod tableaux;

#[cfg(feature = "lanes")]
pub use self::loops::{Moved, OwnLoops, StageLoops, StageRow};
#[cfg(feature = "lanes")]
pub use self::sixteen::{Gauss16, Gauss16With, Halves};
use self::tableaux::{GAUSS4, GAUSS6, GAUSS8, MIDPOINT};
use super::iteration::{Change, iterate};
use super::{Constant, Derivatives, Method, Step, Tableau, c, compensated_advance};
use crate::error::Error;
use crate::options::Options;
use crate::real::Real;
use crate::system::{StateVector, System};

/// The implicit method of order `2 STAGES` that collocates at the `STAGES` Gauss points, for fixed steps.
///
/// It is symmetric and symplectic and keeps quadratic invariants; rounding of its coefficients does not spoil that,
/// because they are stored such that `b_i a_ij + b_j a_ji = b_i b_j` holds exactly. There is no error estimate: steps
/// that vary would lose these properties. Dense output is of order `STAGES + 2`, for one more evaluation in steps
/// where it is asked for; that of the midpoint rule is Hermite's cubic, of order 2.
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
/// polynomial through the others: of the rooted trees of order `STAGES + 2`, all but the bush on a stem are
/// quadratures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gauss<const STAGES: usize, I = FixedPoint> {
    iteration: I,
}

/// The implicit midpoint rule, collocation at one Gauss point, of order 2: the method for [noise](crate::Wiener).
pub type Midpoint<I = FixedPoint> = Gauss<1, I>;
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
/// It needs a [`Differentiable`](crate::Differentiable) system; a state that is no array brings
/// [`SquareStorage`](crate::SquareStorage).
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
        1 => &MIDPOINT,
        2 => &GAUSS4,
        3 => &GAUSS6,
        4 => &GAUSS8,
        _ => panic!("Gauss methods have 1, 2, 3 or 4 stages"),
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
        both::<1>();
        both::<2>();
        both::<3>();
        both::<4>();
    }
}
