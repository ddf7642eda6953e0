//! The Taylor method of any order.
//!
//! The module deliberately does not know how the coefficients are computed.

use super::{Estimate, Method, Start, Step, Tableau, square_of_norm, two_sum};
use crate::controller::{exp2, log2};
use crate::error::Error;
use crate::jet::{Jet, MAX_ORDER};
use crate::math;
use crate::options::{Options, StepSize};
use crate::real::Real;
use crate::system::StateVector;

/// The method of the Taylor polynomials of the solution, of any order, for systems that know their series, [`Jet`].
///
/// ```text
/// y(t + h) = sum_{k=0}^{p} c_k h^k
/// ```
///
/// The step is the largest for which each of the last two terms is within the tolerances: the norm of
/// `c_k h^k / (atol + rtol |y|)` is at most one for `k = p - 1` and `k = p`. What is left out is smaller than the
/// last term by about `e^2`. No step is rejected for its error. Dense output is the polynomial itself, as accurate
/// as the steps. Where a system says that its series ends ([`Jet::series_towards`]), as that of one whose inputs are
/// pieces of polynomials does, a step ends at that very time, a fixed one as well.
/// [`Stats::rhs_evals`](crate::Stats::rhs_evals) counts expansions and the derivative at the start.
///
/// ```
/// # use hamel_runtime::{Convolutions, Integrator, Jet, Options, System, Taylor};
/// struct Logistic;
///
/// impl System<f64> for Logistic {
///     type State = [f64; 1];
///     fn rhs(&self, _t: f64, [y]: &[f64; 1], dy: &mut [f64; 1]) {
///         *dy = [y - y * y];
///     }
/// }
///
/// // Generated code implements this trait; by hand it is `(k + 1) y_{k+1} = y_k - sum_j y_j y_{k-j}`.
/// impl Jet<f64> for Logistic {
///     type Workspace = Convolutions<f64, 1>;
///     fn workspace(&self) -> Self::Workspace {
///         Convolutions::default()
///     }
///     fn series(&self, _t: f64, y: &[f64; 1], work: &mut Self::Workspace, out: &mut [[f64; 1]]) {
///         work.clear();
///         let [mut coefficient] = *y;
///         for (k, next) in out.iter_mut().enumerate() {
///             *next = [coefficient];
///             if k == 0 {
///                 coefficient -= coefficient * coefficient;
///             } else {
///                 let [sum] = work.sums();
///                 work.push([coefficient], [coefficient]);
///                 coefficient = (coefficient - 2.0 * y[0] * coefficient - sum) / (k + 1) as f64;
///             }
///         }
///     }
/// }
///
/// let mut solver = Integrator::new(&Logistic, Taylor::new(), 0.0, [0.5], Options::adaptive(1e-14, 1e-14))?;
/// solver.integrate_to(3.0)?;
/// assert!((solver.state()[0] - 1.0 / (1.0 + (-3.0_f64).exp())).abs() < 1e-14);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
///
/// # Source
///
/// Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods
/// (2005), section 3; Biscani and Izzo, Revisiting high-order Taylor methods for astrodynamics and celestial mechanics
/// (2021).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Taylor {
    order: Option<usize>,
}

impl Taylor {
    /// Two orders more than `1 - ln(tolerance)/2`, the order of least work where work grows with its square: part of
    /// the work grows more slowly. Measured on rigid bodies, the two orders save up to a quarter of the time.
    const EXTRA_ORDERS: f64 = 3.0;
    /// Least order: the step size is read off the last two coefficients.
    const LEAST_ORDER: usize = 2;

    /// The order that suits the tolerances: `3 - ln(max(rtol, atol))/2`, rounded up; with fixed steps that of the
    /// precision of the scalar.
    ///
    /// # Source
    ///
    /// Jorba and Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods
    /// (2005), section 3.1.
    #[must_use]
    pub const fn new() -> Self {
        Self { order: None }
    }

    /// The given order, from 2 to [`MAX_ORDER`].
    #[must_use]
    pub const fn of_order(order: usize) -> Self {
        Self { order: Some(order) }
    }

    /// The order of an integration with these options.
    ///
    /// # Errors
    ///
    /// [`Error::Order`].
    pub fn order<R: Real>(self, options: &Options<R>) -> Result<usize, Error> {
        if let Some(order) = self.order {
            return if (Self::LEAST_ORDER..=MAX_ORDER).contains(&order) {
                Ok(order)
            } else {
                Err(Error::Order { order, least: Self::LEAST_ORDER, most: MAX_ORDER })
            };
        }
        let tolerance = match options.step {
            StepSize::Fixed(_) => R::EPSILON,
            StepSize::Adaptive { .. } => options.rtol.magnitude().max(options.atol.magnitude()),
        };
        // Conversions saturate.
        let order = (Self::EXTRA_ORDERS - 0.5 * math::ln(tolerance)) as usize + 1;
        Ok(order.clamp(Self::LEAST_ORDER, MAX_ORDER))
    }
}

/// What the method keeps: the coefficients of the solution at the start of a step.
#[derive(Clone, Debug)]
pub struct Expansion<R, V, W> {
    order: usize,
    coefficients: [V; MAX_ORDER + 1],
    workspace: W,
    /// Time of the coefficients and the one on the way to which they were asked for, once there are any.
    way: Option<(R, R)>,
    /// Time up to which they hold.
    until: R,
    /// Step size that the coefficients before allowed; zero at first.
    previous_step: f64,
}

impl<R: Real, V: StateVector<R>, W> Expansion<R, V, W> {
    /// The coefficients at a point on the way to another time.
    #[inline]
    fn expand<S: Jet<R, State = V, Workspace = W>>(
        &mut self,
        system: &S,
        way: (R, R),
        y: &V,
        n_evals: &mut u64,
    ) {
        let coefficients = &mut self.coefficients[..=self.order];
        self.until = system.series_towards(way, y, &mut self.workspace, coefficients);
        self.way = Some(way);
        *n_evals += 1;
    }
}

impl<R: Real, V: StateVector<R>, W> Expansion<R, V, W> {
    fn size(&self, k: usize, c: usize) -> f64 {
        self.coefficients[k].as_slice()[c].magnitude()
    }

    /// Whether the last terms of a component have fallen out of the range of the scalar, as those of small states do.
    #[inline]
    fn has_lost_digits(&self, c: usize) -> bool {
        let p = self.order;
        let is_small = |k: usize| self.size(k, c) < R::MIN_POSITIVE;
        is_small(p) && is_small(p - 1) && (1..=p).any(|k| is_small(k) && self.size(k, c) > 0.0)
    }

    /// Half of the step that the terms of a component with all their digits allow, where the state is `size` times its
    /// tolerance; infinity where it is below.
    #[cold]
    fn step_of_terms_with_digits(&self, c: usize, size: f64) -> f64 {
        if size <= 1.0 {
            return f64::INFINITY;
        }
        let (state, least) = (log2(self.size(0, c)), log2(R::MIN_POSITIVE));
        // `c_1` is below the least number where it has lost its digits itself.
        let mut log = state - least.max(log2(self.size(1, c)));
        for k in (2..=self.order).filter(|k| self.size(*k, c) >= R::MIN_POSITIVE) {
            log = log.min((state - log2(self.size(k, c))) / k as f64);
        }
        exp2(log - (log2(size) / self.order as f64).max(1.0))
    }
}

const LOG2_OF_3: f64 = 1.585;

impl<R: Real, S: Jet<R>> Method<R, S> for Taylor {
    const TABLEAU: &'static Tableau = &Tableau {
        name: "taylor",
        order: Self::LEAST_ORDER as u32,
        nodes: &[],
        stages: &[],
        weights: &[],
        estimate: Estimate::Series,
        dense_nodes: &[],
        dense_stages: &[],
        dense: &[],
    };

    type Storage = Expansion<R, S::State, S::Workspace>;

    fn validate(&self, options: &Options<R>) -> Result<(), Error> {
        self.order(options).map(|_| ())
    }

    #[inline]
    fn storage(&self, system: &S, _t0: R, y0: &S::State, options: &Options<R>) -> Self::Storage {
        Expansion {
            order: self.order(options).unwrap_or(Self::LEAST_ORDER),
            coefficients: core::array::from_fn(|_| y0.zeros_like()),
            workspace: system.workspace(),
            way: None,
            until: R::ZERO,
            previous_step: 0.0,
        }
    }

    #[inline]
    fn stages(storage: &Self::Storage) -> &[S::State] {
        &storage.coefficients[..=storage.order]
    }

    #[inline]
    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        &mut storage.coefficients[..=storage.order]
    }

    #[inline]
    fn last_time(&self, storage: &mut Self::Storage, start: Start<'_, R, S>, t_end: R) -> R {
        let way = (start.t, t_end);
        if storage.way != Some(way) {
            storage.expand(start.system, way, &start.point.state, start.rhs_evals);
        }
        storage.until
    }

    #[inline]
    fn longest_step(&self, storage: &mut Self::Storage, start: Start<'_, R, S>) -> f64 {
        let Start { point, tolerances, norm, work, .. } = start;
        let (coefficients, p) = (&storage.coefficients, storage.order);
        // Square of the norm of a coefficient, in units of the tolerances.
        let mut square = |k: usize| {
            for (c, (out, &term)) in
                work.as_mut_slice().iter_mut().zip(coefficients[k].as_slice()).enumerate()
            {
                *out = tolerances.scaled(c, term);
            }
            square_of_norm(norm, work.as_slice())
        };
        let mut allowed = |k: usize| -0.5 / k as f64 * log2(square(k));
        let mut log = allowed(p).min(allowed(p - 1));
        let mut step = exp2(log);
        // The last two terms can vanish by symmetry where others do not, at the start or where the step would jump.
        if step > 2.0 * storage.previous_step {
            // With `c_k = a / rho^k` in units of the tolerance, `c_p h^p = 1` at `h = rho a^(-1/p)`.
            let size = 0.5 * log2(square(0).max(1.0));
            for k in p / 2..p - 1 {
                let rho = (size - 0.5 * log2(square(k.max(1)))) / k.max(1) as f64;
                log = log.min(rho - size / p as f64);
            }
            step = exp2(log);
        }
        // Where a component is `a` times its tolerance the terms allow `a^(-1/p)` of the radius of convergence, and
        // up to twice that near a square root: below `a = 3^p` a step could pass a singularity unseen. The root test
        // gives the radius of a pole, and 1.4 to 1.8 times that of a square root for the orders 15 to 7: half of it
        // is inside either.
        let size = R::from_f64(exp2(2.0 * LOG2_OF_3 * p as f64));
        let mut components = coefficients[0].as_slice().iter().enumerate();
        let is_small = |(c, &y): (usize, &R)| {
            let scaled = tolerances.scaled(c, y);
            !(scaled * scaled).all_gt(size)
        };
        if components.any(is_small) {
            let slope = square(1);
            if slope > 0.0 {
                for k in [p - 1, p].into_iter().filter(|k| *k > 1) {
                    step = step.min(0.5 * exp2(0.5 * log2(slope / square(k)) / (k - 1) as f64));
                }
            }
        }
        for c in 0..point.state.as_slice().len() {
            if storage.has_lost_digits(c) {
                let size = tolerances.scaled(c, point.state.as_slice()[c]).magnitude();
                step = step.min(storage.step_of_terms_with_digits(c, size));
            }
        }
        storage.previous_step = step;
        step
    }

    #[inline]
    fn restart(&self, storage: &mut Self::Storage, _system: &S, _t: R, _y: &S::State) {
        (storage.way, storage.previous_step) = (None, 0.0);
    }

    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        if storage.way.is_none_or(|(t, _)| t != step.t) {
            storage.expand(step.system, (step.t, step.t + step.h), &step.from.state, step.rhs_evals);
        }
        let (y, residue) = (step.from.state.as_slice(), step.from.residue.as_slice());
        let (out, out_residue) = (step.to.state.as_mut_slice(), step.to.residue.as_mut_slice());
        increments(&storage.coefficients[1..=storage.order], step.h, y.len(), |c, increment| {
            (out[c], out_residue[c]) = two_sum(y[c], increment + residue[c]);
        });
        Ok(())
    }
}

/// Calls `put(c, sum_k terms_k h^(k+1))` for the components `c < n` in order.
///
/// Horner's rule in `h^2`, for terms of even and of odd order side by side: half the latency of the plain rule.
#[inline]
pub(crate) fn increments<R: Real, V: StateVector<R>>(
    terms: &[V],
    h: R,
    n: usize,
    mut put: impl FnMut(usize, R),
) {
    let mut c = 0;
    blocks::<R, V, 4>(terms, h, n, &mut c, &mut put);
    blocks::<R, V, 2>(terms, h, n, &mut c, &mut put);
    blocks::<R, V, 1>(terms, h, n, &mut c, &mut put);
}

#[inline(always)]
fn blocks<R: Real, V: StateVector<R>, const WIDTH: usize>(
    terms: &[V],
    h: R,
    n: usize,
    start: &mut usize,
    put: &mut impl FnMut(usize, R),
) {
    let square = h * h;
    while n - *start >= WIDTH {
        let (mut even, mut odd) = ([R::ZERO; WIDTH], [R::ZERO; WIDTH]);
        let horner = |sum: &mut [R; WIDTH], term: &V| {
            for (sum, &term) in sum.iter_mut().zip(&term.as_slice()[*start..*start + WIDTH]) {
                *sum = sum.mul_add(square, term);
            }
        };
        let (pairs, last) = terms.split_at(terms.len() & !1);
        last.iter().for_each(|term| horner(&mut odd, term));
        for pair in pairs.rchunks_exact(2) {
            horner(&mut odd, &pair[0]);
            horner(&mut even, &pair[1]);
        }
        for (lane, (even, odd)) in even.into_iter().zip(odd).enumerate() {
            put(*start + lane, h * even.mul_add(h, odd));
        }
        *start += WIDTH;
    }
}
