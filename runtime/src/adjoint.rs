//! Gradients of a scalar of a motion by its initial state and all parameters: the discrete adjoint of explicit methods,
//! with as many checkpoints as there is memory for.
//!
//! The module deliberately does not know where the times of steps come from, nor the scalar.

use crate::error::{Error, Failure};
use crate::methods::{Derivatives, ExplicitMethod, Point, Step};
use crate::options::{Options, signed};
use crate::real::Real;
use crate::system::{StateVector, System};

/// A system that multiplies the transposed derivatives of its right-hand side with a covector, in reverse mode.
///
/// Generated scenes that `want vjp, sensitivity_vjp` implement it.
pub trait Adjoint<R: Real>: System<R> {
    /// Number of parameters.
    const N_PARAMS: usize;

    /// Writes `(df/dy)^T w` to `by_state`, and adds `(df/dp)^T w` to `by_params`.
    ///
    /// # Shapes
    ///
    /// w, by_state: \[n\]; by_params: \[[`N_PARAMS`](Self::N_PARAMS)\].
    fn pull_back(
        &self,
        t: R,
        y: &Self::State,
        w: &Self::State,
        by_state: &mut Self::State,
        by_params: &mut [R],
    );
}

impl<R: Real, S: Adjoint<R> + ?Sized> Adjoint<R> for &S {
    const N_PARAMS: usize = S::N_PARAMS;

    #[inline]
    fn pull_back(
        &self,
        t: R,
        y: &Self::State,
        w: &Self::State,
        by_state: &mut Self::State,
        by_params: &mut [R],
    ) {
        (**self).pull_back(t, y, w, by_state, by_params);
    }
}

/// A state on the way that is kept, with everything that it takes to go on from it with the same bits.
#[derive(Clone, Debug)]
pub struct Checkpoint<V> {
    /// The number of steps that lead to it.
    step: usize,
    state: V,
    /// What the sum `state` lacks.
    residue: V,
}

impl<V> Checkpoint<V> {
    /// Room for one, of the dimension of a state.
    pub fn new<R: Real>(like: &V) -> Self
    where
        V: StateVector<R>,
    {
        Self { step: 0, state: like.zeros_like(), residue: like.zeros_like() }
    }
}

/// What a gradient took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct AdjointStats {
    /// Steps forward, those of the way back not included: repeated ones count each time.
    pub advances: usize,
    /// Evaluations of the right-hand side.
    pub rhs_evals: u64,
    /// Products with transposed derivatives.
    pub pull_backs: u64,
}

/// The motion of a system on a grid of times, to be differentiated in reverse mode.
///
/// A step from `times[k]` to `times[k + 1]` has the stages of the method, and the gradient is that of the numbers which
/// these steps compute, to rounding: what forward differentiation along each direction gives, for all directions at
/// the cost of some evaluations of the system.
///
/// ```text
/// Y_i = y + h sum_j a_ij k_j,    k_i = f(t + c_i h, Y_i),    y' = y + h sum_i b_i k_i
/// w_i = h (b_i lambda' + sum_j a_ji mu_j),    mu_i = (df/dy)^T w_i at Y_i,    i = s - 1, .., 0
/// lambda = lambda' + sum_i mu_i,    dL/dp += sum_i (df/dp)^T w_i
/// ```
///
/// The way back needs the states in the opposite order. Those at `c` checkpoints are kept, and the ones between are
/// computed again, so that memory is bounded by what the caller provides: with `C(c + r, c)` steps each is repeated at
/// most `r` times, and no other choice of checkpoints repeats fewer. Checkpoints at equal distances would repeat each
/// step once for twice the root of the number of steps; binomial ones need no number of steps in the size of memory.
///
/// # Source
///
/// Hager, Runge-Kutta methods in optimal control and the transformed adjoint system, Numerische Mathematik 87 (2000),
/// for the adjoint; Griewank, Achieving logarithmic growth of temporal and spatial complexity in reverse automatic
/// differentiation (1992), and Griewank and Walther, Algorithm 799: revolve (2000), for the checkpoints.
///
/// ```
/// use hamel_runtime::{Adjoint, Checkpoint, DiscreteAdjoint, Rk4, System};
///
/// /// `x'' = -k x`.
/// struct Spring(f64);
///
/// impl System<f64> for Spring {
///     type State = [f64; 2];
///     fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
///         *dy = [y[1], -self.0 * y[0]];
///     }
/// }
///
/// impl Adjoint<f64> for Spring {
///     const N_PARAMS: usize = 1;
///     fn pull_back(&self, _t: f64, y: &[f64; 2], w: &[f64; 2], by_state: &mut [f64; 2], by_params: &mut [f64]) {
///         *by_state = [-self.0 * w[1], w[0]];
///         by_params[0] -= y[0] * w[1];
///     }
/// }
///
/// // The place at t = 1, by the initial state and the stiffness 4: cos 2, sin 2/2, -sin 2/4.
/// let times: [f64; 101] = core::array::from_fn(|k| k as f64 / 100.0);
/// let start = [1.0, 0.0];
/// let mut checkpoints: [_; 6] = core::array::from_fn(|_| Checkpoint::new(&start));
/// let place = |k: usize, _y: &[f64; 2], covector: &mut [f64; 2]| covector[0] += if k == 100 { 1.0 } else { 0.0 };
/// let (mut by_start, mut by_params) = ([0.0; 2], [0.0]);
/// DiscreteAdjoint::new(&Spring(4.0), Rk4, &times)
///     .gradient(&start, &mut checkpoints, place, (&mut by_start, &mut by_params))?;
/// assert!((by_start[0] - 2.0_f64.cos()).abs() < 1e-7 && (by_start[1] - 2.0_f64.sin() / 2.0).abs() < 1e-7);
/// assert!((by_params[0] + 2.0_f64.sin() / 4.0).abs() < 1e-7);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct DiscreteAdjoint<'a, R, S, M> {
    system: &'a S,
    method: M,
    times: &'a [R],
}

/// The end of a step that is to come, and room for its stages.
struct Room<R: Real, S: System<R>, M: ExplicitMethod<R, S>> {
    stages: M::Storage,
    from: Point<S::State>,
    to: Point<S::State>,
    work: S::State,
}

impl<'a, R: Real, S: Adjoint<R>, M: ExplicitMethod<R, S>> DiscreteAdjoint<'a, R, S, M> {
    /// The motion on the times of its steps, which have one direction: equal distances, or those at which an
    /// [`Integrator`](crate::Integrator) has been after each of its steps.
    pub const fn new(system: &'a S, method: M, times: &'a [R]) -> Self {
        Self { system, method, times }
    }

    /// The gradient of a scalar of the states at the times.
    ///
    /// `covector(k, y, c)` is called for the times in the opposite order and adds the derivatives of the scalar by the
    /// state `y` at `times[k]` to `c`: for a scalar of the end those at the last time alone, for a sum over samples
    /// those of each sample. What the scalar itself depends on parameters is for the caller to add.
    ///
    /// # Shapes
    ///
    /// start, by_start: \[n\]; by_params: \[[`Adjoint::N_PARAMS`]\]. Both are written anew.
    ///
    /// # Errors
    ///
    /// [`Error::Failure`] with [`Failure::NonFinite`] or the reason of the system, where a state or the gradient is not
    /// finite; the gradient is of no use then.
    ///
    /// # Panics
    ///
    /// Without a checkpoint, or if there are fewer `by_params` than parameters.
    pub fn gradient(
        &self,
        start: &S::State,
        checkpoints: &mut [Checkpoint<S::State>],
        mut covector: impl FnMut(usize, &S::State, &mut S::State),
        (by_start, by_params): (&mut S::State, &mut [R]),
    ) -> Result<AdjointStats, Error> {
        assert!(!checkpoints.is_empty(), "the way back needs at least the start");
        let mut stats = AdjointStats::default();
        let by_params = &mut by_params[..S::N_PARAMS];
        by_params.fill(R::ZERO);
        by_start.as_mut_slice().fill(R::ZERO);
        let n_steps = self.times.len().saturating_sub(1);
        if n_steps == 0 {
            covector(0, start, by_start);
            return Ok(stats);
        }
        let point = || Point { state: start.clone(), residue: start.zeros_like(), slope: start.zeros_like() };
        let options = Options::fixed(R::ONE);
        let storage = || self.method.storage(self.system, self.times[0], start, &options);
        let mut room: Room<R, S, M> =
            Room { stages: storage(), from: point(), to: point(), work: start.zeros_like() };
        let mut adjoint: Sums<R, S, M> =
            Sums { stages: storage(), first: start.zeros_like(), covector: start.zeros_like() };
        keep(&mut checkpoints[0], 0, &room.from);
        let mut used = 1;
        for end in (1..=n_steps).rev() {
            let last = &checkpoints[used - 1];
            let mut at = last.step;
            room.from.state.clone_from(&last.state);
            room.from.residue.clone_from(&last.residue);
            while end - at > 1 {
                let free = checkpoints.len() - used;
                let next = at + split(end - at, free + 1);
                while at < next {
                    self.advance(at, &mut room, &mut stats)?;
                    core::mem::swap(&mut room.from, &mut room.to);
                    stats.advances += 1;
                    at += 1;
                }
                // The state before the step back is at hand.
                if end - at > 1 {
                    keep(&mut checkpoints[used], at, &room.from);
                    used += 1;
                }
            }
            self.advance(at, &mut room, &mut stats)?;
            if end == n_steps {
                covector(end, &room.to.state, by_start);
            }
            self.reverse(at, &mut room, &mut adjoint, (by_start, by_params), &mut stats);
            covector(at, &room.from.state, by_start);
            if used > 1 && checkpoints[used - 1].step == at {
                used -= 1;
            }
        }
        let gradient = by_start.as_slice().iter().chain(by_params.iter());
        match gradient.enumerate().find(|(_, x)| !x.all_finite()) {
            Some((index, _)) => Err(Failure::NonFinite { t: signed(self.times[0]), index }.into()),
            None => Ok(stats),
        }
    }

    /// The step from the time `k`, with its stages.
    fn advance(&self, k: usize, room: &mut Room<R, S, M>, stats: &mut AdjointStats) -> Result<(), Error> {
        let (t, h) = (self.times[k], self.times[k + 1] - self.times[k]);
        let Room { stages, from, to, work } = room;
        self.system.rhs(t, &from.state, &mut from.slope);
        stats.rhs_evals += 1;
        let step = &mut Step {
            system: self.system,
            t,
            h,
            from,
            to,
            work,
            last_h: None,
            is_inside: false,
            rhs_evals: &mut stats.rhs_evals,
            jacobian_evals: &mut 0,
        };
        self.method.advance(stages, step)?;
        match to.state.as_slice().iter().position(|y| !y.all_finite()) {
            Some(index) => {
                self.system.check(t, &from.state)?;
                Err(Failure::NonFinite { t: signed(t), index }.into())
            }
            None => Ok(()),
        }
    }

    /// The step back to the time `k`: the covector at the end becomes that at the start.
    fn reverse(
        &self,
        k: usize,
        room: &mut Room<R, S, M>,
        sums: &mut Sums<R, S, M>,
        (by_state, by_params): (&mut S::State, &mut [R]),
        stats: &mut AdjointStats,
    ) {
        let tableau = M::TABLEAU;
        let (t, h) = (self.times[k], self.times[k + 1] - self.times[k]);
        let n_stages = tableau.n_stages();
        for stage in 0..n_stages {
            sums.stage(stage).as_mut_slice().fill(R::ZERO);
        }
        for &(stage, weight) in tableau.weights {
            add(sums.stage(stage), weight.get(), by_state);
        }
        for stage in (0..n_stages).rev() {
            let Room { stages, from, to, work } = room;
            // The state of the stage, as the step had it.
            let slopes =
                Derivatives { n_stages, first: &from.slope, stored: M::stages(stages), last: &from.slope };
            let (y, out) = (from.state.as_slice(), work.as_mut_slice());
            out.copy_from_slice(y);
            slopes.for_each_sum(tableau.stages[stage], y.len(), |c, slope| out[c] = h.mul_add(slope, y[c]));
            let covector = &mut sums.covector;
            covector.clone_from(&*stage_of::<R, S, M>(&mut sums.stages, &mut sums.first, stage));
            covector.as_mut_slice().iter_mut().for_each(|w| *w *= h);
            // The end of the step is no longer needed.
            let pulled = &mut to.state;
            let time = t + tableau.nodes[stage].get::<R>() * h;
            self.system.pull_back(time, work, covector, pulled, by_params);
            stats.pull_backs += 1;
            for &(earlier, weight) in tableau.stages[stage] {
                add(stage_of::<R, S, M>(&mut sums.stages, &mut sums.first, earlier), weight.get(), pulled);
            }
            add(by_state, R::ONE, pulled);
        }
    }
}

/// For each stage the sum of what depends on its slope: `b_i lambda' + sum_j a_ji mu_j`.
struct Sums<R: Real, S: System<R>, M: ExplicitMethod<R, S>> {
    stages: M::Storage,
    first: S::State,
    /// The sum of one stage times the step.
    covector: S::State,
}

impl<R: Real, S: System<R>, M: ExplicitMethod<R, S>> Sums<R, S, M> {
    fn stage(&mut self, stage: usize) -> &mut S::State {
        stage_of::<R, S, M>(&mut self.stages, &mut self.first, stage)
    }
}

/// The state kept for a stage, of which the first is apart.
fn stage_of<'s, R: Real, S: System<R>, M: ExplicitMethod<R, S>>(
    stages: &'s mut M::Storage,
    first: &'s mut S::State,
    stage: usize,
) -> &'s mut S::State {
    match stage.checked_sub(1) {
        None => first,
        Some(place) => &mut M::stages_mut(stages)[place],
    }
}

/// `sum += weight term`.
fn add<R: Real, V: StateVector<R>>(sum: &mut V, weight: R, term: &V) {
    for (sum, term) in sum.as_mut_slice().iter_mut().zip(term.as_slice()) {
        *sum = weight.mul_add(*term, *sum);
    }
}

fn keep<V: Clone>(checkpoint: &mut Checkpoint<V>, step: usize, point: &Point<V>) {
    checkpoint.step = step;
    checkpoint.state.clone_from(&point.state);
    checkpoint.residue.clone_from(&point.residue);
}

/// How many of `n` steps to go before the next checkpoint, with `c` of them, the one at the start included.
///
/// With `C(c + r, c)` steps each is repeated at most `r` times; the smallest such `r` is split into `c` checkpoints and
/// `r - 1` repetitions before, `c - 1` checkpoints and `r` repetitions behind.
fn split(n: usize, c: usize) -> usize {
    if c == 1 {
        return n - 1;
    }
    let (n, c) = (n as u128, c as u128);
    // C(c + r - 1, c) and C(c + r, c), whose product with c + r is far below the largest number.
    let (mut before, mut all, mut r) = (0, 1, 0);
    while all < n {
        r += 1;
        (before, all) = (all, all * (c + r) / r);
    }
    // C(c - 1 + r - 1, c - 1)
    let behind = before * c / (c + r - 1);
    before.min(n - behind) as usize
}

#[cfg(test)]
mod tests {
    use std::vec;
    use std::vec::Vec;

    use super::{Adjoint, Checkpoint, DiscreteAdjoint, split};
    use crate::{
        Dop853, Dopri5, Dual, Error, ExplicitMethod, Failure, Integrator, Options, Real, Rk4, System, Tsit5,
        Vern9,
    };

    /// A pendulum with friction and a force that depends on time; derivatives by hand.
    #[derive(Clone, Copy)]
    struct Pendulum<R> {
        params: [R; 3],
    }

    impl<R: Real> System<R> for Pendulum<R> {
        type State = [R; 2];

        fn rhs(&self, t: R, y: &[R; 2], dy: &mut [R; 2]) {
            let [k, c, a] = self.params;
            *dy = [y[1], -(k * y[0].sin()) - c * y[1] * y[1] * y[1] + a * t.sin()];
        }
    }

    impl Adjoint<f64> for Pendulum<f64> {
        const N_PARAMS: usize = 3;

        fn pull_back(
            &self,
            t: f64,
            y: &[f64; 2],
            w: &[f64; 2],
            by_state: &mut [f64; 2],
            by_params: &mut [f64],
        ) {
            let [k, c, _] = self.params;
            *by_state = [-k * y[0].cos() * w[1], w[0] - 3.0 * c * y[1] * y[1] * w[1]];
            by_params[0] -= y[0].sin() * w[1];
            by_params[1] -= y[1].powi(3) * w[1];
            by_params[2] += t.sin() * w[1];
        }
    }

    const PARAMS: [f64; 3] = [2.3, 0.05, 0.7];
    const START: [f64; 2] = [0.8, -0.4];

    /// The times of steps, and the derivatives of `sum_k y0(t_k)^2/2 + y1(end)` by dual numbers along the same steps.
    fn forward<M>(method: M, options: Options<f64>, dual_options: Options<Dual>) -> (Vec<f64>, [f64; 5])
    where
        M: ExplicitMethod<f64, Pendulum<f64>> + ExplicitMethod<Dual, Pendulum<Dual>>,
    {
        let system = Pendulum { params: PARAMS };
        let mut solver = Integrator::new(&system, method, 0.0, START, options).unwrap();
        let mut times = vec![0.0];
        while solver.t() < 3.0 {
            let _ = solver.step_towards(3.0).unwrap();
            times.push(solver.t());
        }
        let mut gradient = [0.0; 5];
        for (along, derivative) in gradient.iter_mut().enumerate() {
            let seed = |x: f64, at: usize| Dual::new(x, f64::from(u8::from(at == along)));
            let system = Pendulum { params: core::array::from_fn(|k| seed(PARAMS[k], k + 2)) };
            let start = core::array::from_fn(|k| seed(START[k], k));
            let mut solver = Integrator::new(&system, method, Dual::ZERO, start, dual_options).unwrap();
            let half = Dual::constant(0.5);
            let mut sum = half * start[0] * start[0];
            for t in &times[1..] {
                let _ = solver.step_towards(Dual::constant(3.0)).unwrap();
                // The steps are the same.
                assert_eq!(solver.t().value, *t);
                sum += half * solver.state()[0] * solver.state()[0];
            }
            sum += solver.state()[1];
            *derivative = sum.derivative;
        }
        (times, gradient)
    }

    fn backward<M>(method: M, times: &[f64], n_checkpoints: usize) -> ([f64; 5], super::AdjointStats)
    where
        M: ExplicitMethod<f64, Pendulum<f64>>,
    {
        let system = Pendulum { params: PARAMS };
        let mut checkpoints = vec![Checkpoint::new(&START); n_checkpoints];
        let n = times.len() - 1;
        let covector = |k: usize, y: &[f64; 2], c: &mut [f64; 2]| {
            c[0] += y[0];
            c[1] += f64::from(u8::from(k == n));
        };
        let (mut by_start, mut by_params) = ([0.0; 2], [0.0; 3]);
        let adjoint = DiscreteAdjoint::new(&system, method, times);
        let stats =
            adjoint.gradient(&START, &mut checkpoints, covector, (&mut by_start, &mut by_params)).unwrap();
        let mut gradient = [0.0; 5];
        gradient[..2].copy_from_slice(&by_start);
        gradient[2..].copy_from_slice(&by_params);
        (gradient, stats)
    }

    fn check<M>(method: M, options: Options<f64>, dual_options: Options<Dual>)
    where
        M: ExplicitMethod<f64, Pendulum<f64>> + ExplicitMethod<Dual, Pendulum<Dual>>,
    {
        let (times, expected) = forward(method, options, dual_options);
        let (found, _) = backward(method, &times, 4);
        let size = expected.iter().fold(0.0, |max: f64, x| max.max(x.abs()));
        for (found, expected) in found.iter().zip(expected) {
            // Rounding of some hundred stages.
            assert!((found - expected).abs() <= 1e-13 * size, "{found} {expected} of {size}");
        }
    }

    #[test]
    fn gradients_are_those_of_dual_numbers_along_the_same_steps() {
        let (adaptive, dual) = (Options::adaptive(1e-9, 1e-9), Options::adaptive(1e-9.into(), 1e-9.into()));
        check(Dop853, adaptive, dual);
        check(Vern9, adaptive, dual);
        check(Tsit5, adaptive, dual);
        check(Dopri5, adaptive, dual);
        check(Rk4, Options::fixed(0.03), Options::fixed(Dual::constant(0.03)));
    }

    #[test]
    fn gradients_have_the_same_bits_with_any_number_of_checkpoints() {
        let times: Vec<f64> = (0..=137).map(|k| f64::from(k) * 0.02).collect();
        let (expected, stats) = backward(Tsit5, &times, 138);
        // With room for all states each step is gone once on the way and once back, the last one back alone.
        assert_eq!(stats.advances, 136);
        assert_eq!((stats.rhs_evals, stats.pull_backs), (6 * (136 + 137), 6 * 137));
        for n in [1, 2, 3, 5, 8, 50] {
            assert_eq!(backward(Tsit5, &times, n).0.map(f64::to_bits), expected.map(f64::to_bits), "{n}");
        }
    }

    /// The least number of steps forward, over all choices of checkpoints.
    fn least_advances(n_max: usize, c_max: usize) -> Vec<Vec<usize>> {
        let mut least = vec![vec![0; n_max + 1]; c_max + 1];
        for c in 1..=c_max {
            for n in 2..=n_max {
                least[c][n] = match c {
                    1 => n * (n - 1) / 2,
                    _ => (1..n).map(|m| m + least[c - 1][n - m] + least[c][m]).min().unwrap_or(0),
                };
            }
        }
        least
    }

    #[test]
    fn no_schedule_repeats_fewer_steps() {
        let least = least_advances(60, 7);
        for (c, least) in least.iter().enumerate().skip(1) {
            for (n, least) in least.iter().enumerate().skip(1) {
                let times: Vec<f64> = (0..=n).map(|k| k as f64 * 0.01).collect();
                assert_eq!(backward(Rk4, &times, c).1.advances, *least, "{n} steps, {c} checkpoints");
            }
        }
    }

    #[test]
    fn large_numbers_are_split() {
        // C(40, 20) steps with 20 checkpoints are repeated 20 times, and split into C(39, 20) and C(39, 19).
        assert_eq!(split(137_846_528_820, 20), 68_923_264_410);
        assert_eq!(split(usize::MAX, 1), usize::MAX - 1);
        assert!((1..usize::MAX).contains(&split(usize::MAX, 3)));
        assert_eq!(split(7, usize::MAX), 1);
    }

    #[test]
    fn motions_without_steps_and_without_values() {
        let (found, stats) = backward(Rk4, &[0.0], 1);
        assert_eq!((found, stats.rhs_evals), ([0.8, 1.0, 0.0, 0.0, 0.0], 0));
        let system = Pendulum { params: [f64::MAX, 0.0, 0.0] };
        let mut checkpoints = [Checkpoint::new(&START)];
        let (mut by_start, mut by_params) = ([0.0; 2], [0.0; 3]);
        let gradient = (&mut by_start, &mut by_params[..]);
        let adjoint = DiscreteAdjoint::new(&system, Rk4, &[0.0, 10.0, 20.0]);
        let found = adjoint.gradient(&START, &mut checkpoints, |_, _, _| (), gradient);
        assert!(matches!(found, Err(Error::Failure(Failure::NonFinite { .. }))), "{found:?}");
    }
}
