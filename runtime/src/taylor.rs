//! The Taylor method of any order: steps, step sizes and dense output from the coefficients of the solution.
//!
//! The module deliberately does not know how the coefficients are computed.

use core::fmt;

use crate::controller::{exp2, log2};
use crate::error::{Error, Failure};
use crate::integrator::{Progress, Stats, TINY, copy, non_finite};
use crate::jet::{Jet, MAX_ORDER};
use crate::math;
use crate::methods::two_sum;
use crate::options::{Norm, Options, StepSize, signed};
use crate::real::Real;
use crate::system::StateVector;

/// Choice of the order of a [`TaylorIntegrator`].
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
    pub fn new() -> Self {
        Self { order: None }
    }

    /// The given order, from 2 to [`MAX_ORDER`].
    #[must_use]
    pub fn of_order(order: usize) -> Self {
        Self { order: Some(order) }
    }

    fn order_for<R: Real>(self, options: &Options<R>) -> Result<usize, Error> {
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

/// Integrates a system by the Taylor polynomials of its solution, step by step in either direction of time.
///
/// ```text
/// y(t + h) = sum_{k=0}^{p} c_k h^k
/// ```
///
/// The step is the largest for which each of the last two terms is within the tolerances: the norm of
/// `c_k h^k / (atol + rtol |y|)` is at most one for `k = p - 1` and `k = p`. What is left out is smaller than the
/// last term by about `e^2`. There are no rejected steps. Dense output is the polynomial itself, as accurate as
/// the steps. Time and state are summed with compensation. After an error the last accepted time and state are
/// kept. [`Stats::rhs_evals`] counts expansions.
///
/// ```
/// # use hamel_runtime::{Convolutions, Jet, Options, System, Taylor, TaylorIntegrator};
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
/// let mut solver = TaylorIntegrator::new(&Logistic, Taylor::new(), 0.0, [0.5], Options::adaptive(1e-14, 1e-14))?;
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
pub struct TaylorIntegrator<'s, R: Real, S: Jet<R>> {
    system: &'s S,
    options: Options<R>,
    order: usize,
    t: R,
    t_previous: R,
    /// What the sum `t` lacks.
    t_residue: R,
    y: S::State,
    /// What the sum `y` lacks.
    y_residue: S::State,
    trial: S::State,
    /// Coefficients at the start of the last step, or at `t`.
    coefficients: [S::State; MAX_ORDER + 1],
    workspace: S::Workspace,
    expanded: Expanded,
    /// Step size that the coefficients of the last step allowed; zero before the first.
    natural_step: f64,
    stats: Stats,
}

/// Where the coefficients are those of the solution.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Expanded {
    /// At the current time, before a step.
    Here,
    /// At the previous time, after a step.
    Before,
    /// Nowhere: an expansion failed.
    Lost,
}

impl<'s, R: Real, S: Jet<R>> TaylorIntegrator<'s, R, S> {
    /// Places `system` at the state `y0` at time `t0`.
    ///
    /// # Errors
    ///
    /// Those of [`Options::validate`]; [`Error::Order`]; [`Error::TimeNotFinite`]; [`Error::Failure`] if the
    /// solution has no Taylor series at `y0`.
    pub fn new(
        system: &'s S,
        method: Taylor,
        t0: R,
        y0: S::State,
        options: Options<R>,
    ) -> Result<Self, Error> {
        options.validate()?;
        let order = method.order_for(&options)?;
        if !t0.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t0) });
        }
        if let Some(index) = non_finite(&y0) {
            return Err(Failure::NonFinite { t: signed(t0), index }.into());
        }
        system.check(t0, &y0)?;
        let zeros = y0.zeros_like();
        let mut solver = Self {
            system,
            options,
            order,
            t: t0,
            t_previous: t0,
            t_residue: R::ZERO,
            y: y0,
            y_residue: zeros.clone(),
            trial: zeros.clone(),
            coefficients: core::array::from_fn(|_| zeros.clone()),
            workspace: system.workspace(),
            expanded: Expanded::Lost,
            natural_step: 0.0,
            stats: Stats::default(),
        };
        solver.expand();
        if solver.coefficients.iter().any(|v| non_finite(v).is_some()) {
            return Err(solver.failure().into());
        }
        Ok(solver)
    }

    /// Order of the method.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Time of the last accepted state.
    pub fn t(&self) -> R {
        self.t
    }

    /// The last accepted state.
    pub fn state(&self) -> &S::State {
        &self.y
    }

    /// Time of the state before the last step; [`t`](Self::t) before the first.
    pub fn previous_t(&self) -> R {
        self.t_previous
    }

    /// The system that is integrated.
    pub fn system(&self) -> &'s S {
        self.system
    }

    /// Counts of the work done so far.
    pub fn stats(&self) -> Stats {
        self.stats
    }

    /// Takes one step towards `t_end`, and never beyond.
    ///
    /// At `t_end` nothing is done.
    ///
    /// # Errors
    ///
    /// [`Error::TimeNotFinite`] for `t_end`; [`Error::Failure`] where the solution has no Taylor series;
    /// [`Error::StepTooSmall`]; [`Error::TooManySteps`].
    pub fn step_towards(&mut self, t_end: R) -> Result<Progress, Error> {
        let mut budget = self.options.max_steps;
        self.step_within(t_end, &mut budget)
    }

    /// Takes steps until the time is exactly `t_end`.
    ///
    /// # Errors
    ///
    /// As [`step_towards`](Self::step_towards).
    pub fn integrate_to(&mut self, t_end: R) -> Result<(), Error> {
        let mut budget = self.options.max_steps;
        while !self.step_within(t_end, &mut budget)?.reached() {}
        Ok(())
    }

    /// Writes the state at a time within the last step to `out`.
    ///
    /// # Errors
    ///
    /// [`Error::OutsideInterval`] unless `t` lies between [`previous_t`](Self::previous_t) and [`t`](Self::t);
    /// [`Error::NoDenseOutput`] after a failed step.
    pub fn interpolate(&mut self, t: R, out: &mut S::State) -> Result<(), Error> {
        if t == self.t {
            copy(&self.y, out);
            return Ok(());
        }
        let (from, to) = (self.t_previous, self.t);
        let inside = (t.all_ge(from) && to.all_ge(t)) || (from.all_ge(t) && t.all_ge(to));
        if !inside {
            return Err(Error::OutsideInterval { t: signed(t), from: signed(from), to: signed(to) });
        }
        if self.expanded != Expanded::Before {
            return Err(Error::NoDenseOutput { t: signed(self.t) });
        }
        let out = out.as_mut_slice();
        let start = self.coefficients[0].as_slice();
        increments(self.terms(), t - from, start.len(), |c, increment| out[c] = start[c] + increment);
        Ok(())
    }

    /// The coefficients of orders one to the last.
    fn terms(&self) -> &[S::State] {
        &self.coefficients[1..=self.order]
    }

    /// Computes the coefficients at the current point. What is not finite among them shows in the next state.
    fn expand(&mut self) {
        let out = &mut self.coefficients[..=self.order];
        self.system.series(self.t, &self.y, &mut self.workspace, out);
        self.stats.rhs_evals += 1;
        self.expanded = Expanded::Here;
    }

    /// Why the series at the current point has no sum.
    #[cold]
    fn failure(&self) -> Failure {
        let t = signed(self.t);
        let states = self.coefficients[..=self.order].iter().chain([&self.trial]);
        let index = states.into_iter().find_map(non_finite).unwrap_or(0);
        self.system.check(self.t, &self.y).err().unwrap_or(Failure::NonFinite { t, index })
    }

    fn step_within(&mut self, t_end: R, budget: &mut u64) -> Result<Progress, Error> {
        if !t_end.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        if t_end == self.t {
            return Ok(Progress::Reached);
        }
        let backward = self.t.all_gt(t_end);
        if !backward && !t_end.all_gt(self.t) {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        let remaining = (t_end - self.t) - self.t_residue;
        if !remaining.all_finite() {
            return Err(Error::TimeNotFinite { value: signed(t_end) });
        }
        if *budget == 0 {
            return Err(Error::TooManySteps { t: signed(self.t), limit: self.options.max_steps });
        }
        *budget -= 1;
        if self.expanded != Expanded::Here {
            self.expand();
        }
        let step = self.step_size();
        let reach = match self.options.step {
            // Besides a sum of steps, the end itself is rounded.
            StepSize::Fixed(_) => step * (1.0 + 1e-9) + 2.0 * R::EPSILON * self.t.magnitude(),
            StepSize::Adaptive { .. } => step,
        };
        let landing = remaining.magnitude() <= reach;
        let h = if landing {
            remaining
        } else if backward {
            R::from_f64(-step)
        } else {
            R::from_f64(step)
        };
        let (t, t_residue) = if landing { (t_end, R::ZERO) } else { two_sum(self.t, h + self.t_residue) };
        let too_small = match self.options.step {
            StepSize::Fixed(_) => false,
            StepSize::Adaptive { .. } => step <= 10.0 * R::EPSILON * self.t.magnitude() || step < TINY,
        };
        if !landing && (too_small || !(self.t + h).all_ne(self.t)) {
            return Err(Error::StepTooSmall { t: signed(self.t), h: signed(h) });
        }
        let (y, residue) = (self.y.as_slice(), self.y_residue.as_mut_slice());
        let trial = self.trial.as_mut_slice();
        let terms = &self.coefficients[1..=self.order];
        increments(terms, h, y.len(), |c, increment| {
            (trial[c], residue[c]) = two_sum(y[c], increment + residue[c]);
        });
        if !self.trial.as_slice().iter().fold(true, |finite, x| finite & x.all_finite()) {
            self.expanded = Expanded::Lost;
            self.y_residue.as_mut_slice().fill(R::ZERO);
            return Err(self.failure().into());
        }
        copy(&self.trial, &mut self.y);
        (self.t_previous, self.t, self.t_residue) = (self.t, t, t_residue);
        self.expanded = Expanded::Before;
        self.stats.steps += 1;
        Ok(if landing { Progress::Reached } else { Progress::Running })
    }

    /// The size of the step from the current point, positive.
    fn step_size(&mut self) -> f64 {
        let max = match self.options.step {
            StepSize::Fixed(h) => return h.magnitude(),
            StepSize::Adaptive { max, .. } => max.map_or(f64::MAX, |max| max.magnitude()),
        };
        // Reciprocal scales stand in the trial state, which is free before a step.
        let (rtol, atol) = (self.options.rtol, self.options.atol + R::from_f64(TINY));
        for (scale, y) in self.trial.as_mut_slice().iter_mut().zip(self.y.as_slice()) {
            *scale = rtol.mul_add(y.abs(), atol).recip();
        }
        let p = self.order;
        let allowed = |k: usize| -0.5 / k as f64 * log2(self.square_norm(k));
        let mut log = allowed(p).min(allowed(p - 1));
        let mut step = exp2(log);
        // The last two terms can vanish by symmetry where others do not, at the start or where the step would jump.
        if step > 2.0 * self.natural_step {
            // With `c_k = a / rho^k` in units of the tolerance, `c_p h^p = 1` at `h = rho a^(-1/p)`.
            let size = 0.5 * log2(self.square_norm(0).max(1.0));
            for k in p / 2..p - 1 {
                let rho = (size - 0.5 * log2(self.square_norm(k.max(1)))) / k.max(1) as f64;
                log = log.min(rho - size / p as f64);
            }
            step = exp2(log);
        }
        self.natural_step = step;
        let first = match self.options.step {
            StepSize::Adaptive { initial: Some(initial), .. } if self.stats.steps == 0 => initial.magnitude(),
            _ => f64::MAX,
        };
        step.min(max).min(first)
    }

    /// Square of the norm of the coefficient of order `k`, in units of the tolerances.
    #[inline]
    fn square_norm(&self, k: usize) -> f64 {
        let components = self.coefficients[k].as_slice().iter().zip(self.trial.as_slice());
        let squares = components.map(|(&v, &scale)| {
            let ratio = (v * scale).magnitude();
            ratio * ratio
        });
        match self.options.norm {
            Norm::Rms => {
                let (sum, n) = squares.fold((0.0, 0u32), |(sum, n), square| (sum + square, n + 1));
                sum / f64::from(n.max(1))
            }
            Norm::Max => squares.fold(0.0, f64::max),
        }
    }
}

impl<R: Real, S: Jet<R>> fmt::Debug for TaylorIntegrator<'_, R, S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TaylorIntegrator")
            .field("order", &self.order)
            .field("t", &self.t)
            .field("state", &self.y.as_slice())
            .field("options", &self.options)
            .field("stats", &self.stats)
            .finish_non_exhaustive()
    }
}

/// Calls `put(c, sum_k terms_k h^(k+1))` for the components `c < n` in order.
///
/// Horner's rule in `h^2`, for terms of even and of odd order side by side: half the latency of the plain rule.
#[inline]
fn increments<R: Real, V: StateVector<R>>(terms: &[V], h: R, n: usize, mut put: impl FnMut(usize, R)) {
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
