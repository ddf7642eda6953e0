//! Events: changes of sign of functions of time and state, located within a step, and what follows them.
//!
//! The module deliberately does not know how states are interpolated: to locate, it sees values of one function.

use core::ops::ControlFlow;

use crate::options::signed;
use crate::real::Real;
use crate::system::System;

/// Which changes of sign are events.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Direction {
    /// From negative to zero or positive, in the direction of integration.
    Rising,
    /// From positive to zero or negative.
    Falling,
    /// Both.
    #[default]
    Either,
}

impl Direction {
    /// Whether a change of sign of this direction may lead to a value.
    pub(crate) fn may_end<R: Real>(self, after: R) -> bool {
        let after = signed(after);
        match self {
            Self::Rising => after >= 0.0,
            Self::Falling => after <= 0.0,
            Self::Either => true,
        }
    }

    /// Whether the values at both ends of a step are a change of sign of this direction.
    pub(crate) fn is_change<R: Real>(self, before: R, after: R) -> bool {
        let (before, after) = (signed(before), signed(after));
        let rising = before < 0.0 && after >= 0.0;
        let falling = before > 0.0 && after <= 0.0;
        match self {
            Self::Rising => rising,
            Self::Falling => falling,
            Self::Either => rising || falling,
        }
    }
}

/// An event that was found.
///
/// ```
/// use core::ops::ControlFlow;
/// use hamel_runtime::{Direction, Dop853, Event, Integrator, Options, System};
///
/// struct Clock;
///
/// impl System<f64> for Clock {
///     type State = [f64; 2];
///     fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
///         *dy = [y[1], -y[0]];
///     }
/// }
///
/// let mut solver = Integrator::new(&Clock, Dop853, 0.0, [1.0, 0.0], Options::adaptive(1e-12, 1e-12))?;
/// let stop = |event: Event<'_, f64, [f64; 2]>| {
///     assert_eq!(event.index, 0);
///     assert!((event.t - core::f64::consts::FRAC_PI_2).abs() < 1e-10);
///     ControlFlow::Break(())
/// };
/// solver.integrate_with_events(10.0, [Direction::Falling], |_, y| [y[0]], stop)?;
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
#[derive(Debug)]
#[non_exhaustive]
pub struct Event<'a, R, V> {
    /// Position of its function.
    pub index: usize,
    /// Its time, just after the change of sign.
    pub t: R,
    /// The state then.
    pub state: &'a V,
}

/// What follows an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Action {
    /// Nothing: the motion goes on as if nothing had happened.
    Continue,
    /// The motion goes on from the state as it has been changed.
    Restart,
    /// The integration stops there.
    Stop,
    /// It stops there with the state as it has been changed.
    ChangeAndStop,
}

/// What is told on the way of an integration, and what it asks for: see
/// [`Integrator::observe`](crate::Integrator::observe).
///
/// ```
/// use hamel_runtime::{Action, Direction, Integrator, Observer, Options, System, Vern9};
///
/// /// A ball: height and speed.
/// struct Ball;
///
/// impl System<f64> for Ball {
///     type State = [f64; 2];
///     fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
///         *dy = [y[1], -9.81];
///     }
/// }
///
/// /// It keeps four fifths of its speed at every impact; the fifth ends the motion.
/// struct Impacts(u32);
///
/// impl Observer<f64, [f64; 2], 1> for Impacts {
///     fn values(&mut self, _t: f64, y: &[f64; 2]) -> [f64; 1] {
///         [y[0]]
///     }
///
///     fn event(&mut self, _index: usize, _t: f64, y: &mut [f64; 2]) -> Action {
///         self.0 += 1;
///         y[1] *= -0.8;
///         if self.0 == 5 { Action::ChangeAndStop } else { Action::Restart }
///     }
/// }
///
/// let mut solver = Integrator::new(&Ball, Vern9, 0.0, [0.0, 9.81], Options::adaptive(1e-12, 1e-12))?;
/// solver.observe(100.0, [], [Direction::Falling], &mut Impacts(0))?;
/// let flights = 2.0 * (1.0 + 0.8 + 0.8_f64.powi(2) + 0.8_f64.powi(3) + 0.8_f64.powi(4));
/// assert!((solver.t() - flights).abs() < 1e-12);
/// assert!((solver.state()[1] - 9.81 * 0.8_f64.powi(5)).abs() < 1e-11);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
pub trait Observer<R: Real, V, const K: usize> {
    /// The state at a time that was asked for.
    fn sample(&mut self, t: R, state: &V) {
        let _ = (t, state);
    }

    /// The end of a step, unless an event has ended it before; where the answer is to break, the integration stops.
    fn step(&mut self, t: R, state: &V) -> ControlFlow<()> {
        let _ = (t, state);
        ControlFlow::Continue(())
    }

    /// The values of the functions whose changes of sign are events.
    fn values(&mut self, t: R, state: &V) -> [R; K];

    /// An event: position of its function, its time, and the state just after the change of sign, which it may change.
    fn event(&mut self, index: usize, t: R, state: &mut V) -> Action;
}

/// A system that says itself what its events are and what they do, as generated scenes with events do.
///
/// [`Integrator::integrate_through_events`](crate::Integrator::integrate_through_events) carries them out.
pub trait Events<R: Real, const K: usize>: System<R> {
    /// The changes of sign that are events.
    const DIRECTIONS: [Direction; K];

    /// The values of the functions whose changes of sign are events.
    fn event_values(&self, t: R, y: &Self::State) -> [R; K];

    /// Changes the state as the event of function `index` does, all components from the state before, and says whether
    /// the motion goes on.
    fn event_apply(&self, index: usize, t: R, y: &mut Self::State) -> Action;
}

impl<R: Real, const K: usize, S: Events<R, K> + ?Sized> Events<R, K> for &S {
    const DIRECTIONS: [Direction; K] = S::DIRECTIONS;

    #[inline]
    fn event_values(&self, t: R, y: &Self::State) -> [R; K] {
        (**self).event_values(t, y)
    }

    #[inline]
    fn event_apply(&self, index: usize, t: R, y: &mut Self::State) -> Action {
        (**self).event_apply(index, t, y)
    }
}

/// Carries out an event, by its position, and behind it every event that is a condition and that the one before has
/// made true: whose function was zero or positive and is negative now. Each happens once. Gives what follows from all.
///
/// ```
/// use hamel_runtime::{Action, cascade};
///
/// // The first event takes two off, the second, a condition, makes a negative number zero.
/// let mut y = 1.5;
/// let effect = |event: usize, y: &mut f64| {
///     *y = if event == 0 { *y - 2.0 } else { 0.0 };
///     Action::Restart
/// };
/// let action = cascade(0, [false, true], &mut y, |y| [1.0, *y], effect);
/// assert_eq!((action, y), (Action::Restart, 0.0));
/// ```
pub fn cascade<R: Real, V, const K: usize>(
    index: usize,
    is_condition: [bool; K],
    y: &mut V,
    values: impl Fn(&V) -> [R; K],
    mut effect: impl FnMut(usize, &mut V) -> Action,
) -> Action {
    let (mut changes, mut stops, mut done) = (false, false, [false; K]);
    let mut next = Some(index);
    while let Some(event) = next {
        if let Some(done) = done.get_mut(event) {
            *done = true;
        }
        let before = values(y);
        let action = effect(event, y);
        changes |= matches!(action, Action::Restart | Action::ChangeAndStop);
        stops |= matches!(action, Action::Stop | Action::ChangeAndStop);
        let after = values(y);
        next = (0..K)
            .find(|&k| is_condition[k] && !done[k] && signed(before[k]) >= 0.0 && signed(after[k]) < 0.0);
    }
    match (changes, stops) {
        (false, false) => Action::Continue,
        (false, true) => Action::Stop,
        (true, false) => Action::Restart,
        (true, true) => Action::ChangeAndStop,
    }
}

/// Whether a value is on the side of `after`, or zero, of a change of sign from `before` to `after`.
pub(crate) fn is_after(value: f64, (before, after): (f64, f64)) -> bool {
    if after > before { value >= 0.0 } else { value <= 0.0 }
}

/// The end of a bracket of at most the width `resolution` around a change of sign of `f` in `[0, 1]`, by the
/// method ITP.
///
/// `before` and `after` are `f(0)` and `f(1)`. The sign at the answer is that of `after`, or zero; just before it the
/// sign is that of `before`, so that a stretch of zeros is found by its start.
///
/// # Source
///
/// Oliveira and Takahashi, An enhancement of the bisection method average performance preserving minmax optimality
/// (2020), with `k1 = 0.2`, `k2 = 2`, `n0 = 1`.
pub(crate) fn locate<R: Real, E>(
    mut f: impl FnMut(R) -> Result<f64, E>,
    (before, after): (f64, f64),
    resolution: f64,
) -> Result<R, E> {
    let number = R::from_f64;
    let (mut a, mut b) = (R::ZERO, R::ONE);
    let sign = if after > before { 1.0 } else { -1.0 };
    let (mut f_a, mut f_b) = (sign * before, sign * after);
    // The width that bisection would have reached, with one halving to spare.
    let mut width = resolution;
    while width < 2.0 {
        width *= 2.0;
    }
    while (b - a).magnitude() > resolution {
        let size = (b - a).magnitude();
        let middle = number(0.5) * (a + b);
        let secant = (number(f_b) * a - number(f_a) * b) / (number(f_b) - number(f_a));
        let towards = if middle.all_ge(secant) { R::ONE } else { -R::ONE };
        // Not below the resolution, so that the bracket closes from both sides.
        let shift = (0.2 * size * size).max(0.5 * resolution);
        let is_apart = shift <= (middle - secant).magnitude();
        let truncated = if is_apart { secant + towards * number(shift) } else { middle };
        let radius = 0.5 * (width - size).max(0.0);
        let is_near = (truncated - middle).magnitude() <= radius;
        let x = if is_near { truncated } else { middle - towards * number(radius) };
        // Between adjacent numbers there is nothing left to find.
        if a.all_ge(x) || x.all_ge(b) {
            break;
        }
        let value = sign * f(x)?;
        if value < 0.0 {
            (a, f_a) = (x, value);
        } else {
            (b, f_b) = (x, value);
        }
        width *= 0.5;
    }
    Ok(b)
}

#[cfg(test)]
mod tests {
    use core::convert::Infallible;

    use super::{Direction, locate};
    use crate::{DoubleDouble, Real};

    #[test]
    fn roots_are_located_to_the_resolution_in_few_evaluations() {
        let functions: [fn(f64) -> f64; 4] =
            [|x| x - 0.3, |x| x * x * x - 0.001, |x| 0.7_f64.exp() - x.exp(), |x| (x - 0.9).powi(9)];
        for (index, (f, root)) in functions.into_iter().zip([0.3, 0.1, 0.7, 0.9]).enumerate() {
            let mut n_evals = 0;
            let counted = |x: f64| {
                n_evals += 1;
                Ok::<_, Infallible>(f(x))
            };
            let Ok(found) = locate(counted, (f(0.0), f(1.0)), 1e-14);
            // A root of order nine is known only up to the ninth root of the smallest numbers, which is fine.
            assert!((found - root).abs() < 2e-14, "function {index}: {found}");
            assert!(f(found) * f(1.0) >= 0.0, "function {index}: before the change of sign");
            assert!(n_evals <= 49, "function {index}: {n_evals} evaluations");
            assert!(index == 3 || n_evals <= 14, "function {index}: {n_evals} evaluations");
        }
    }

    #[test]
    fn a_step_function_is_bisected() {
        let f = |x: f64| Ok::<_, Infallible>(if x < 0.123 { -1.0 } else { 1e9 });
        let Ok(found) = locate(f, (-1.0, 1e9), 1e-12);
        assert!((0.123..0.123 + 1e-12).contains(&found), "{found}");
    }

    #[test]
    fn a_stretch_of_zeros_is_found_by_its_start() {
        for (from, sign) in [(0.123, 1.0), (0.5, -1.0), (1.0, 1.0), (1e-9, -1.0)] {
            let mut n_evals = 0;
            // Positive before the stretch and zero within, up to the end and beyond.
            let f = |x: f64| {
                n_evals += 1;
                Ok::<_, Infallible>(sign * (from - x).max(0.0))
            };
            let Ok(found) = locate(f, (sign * from, 0.0), 1e-14);
            assert!((from..=from + 1e-14).contains(&found), "{found} instead of {from}");
            assert!(n_evals <= 49, "{n_evals} evaluations");
        }
    }

    #[test]
    fn wide_scalars_are_located_to_their_resolution() {
        let third = DoubleDouble::ratio(1.0, 3.0);
        let f = |x: DoubleDouble| Ok::<_, Infallible>((x - third).hi());
        let Ok(found) = locate(f, (-1.0 / 3.0, 2.0 / 3.0), 1e-31);
        assert!((0.0..=1e-31).contains(&(found - third).hi()), "{found}");
    }

    #[test]
    fn directions_are_told_apart() {
        use Direction::{Either, Falling, Rising};
        for (before, after, rising, falling) in [
            (-1.0, 2.0, true, false),
            (1.0, 0.0, false, true),
            (0.0, 1.0, false, false),
            (1.0, 2.0, false, false),
        ] {
            assert_eq!(Rising.is_change(before, after), rising);
            assert_eq!(Falling.is_change(before, after), falling);
            assert_eq!(Either.is_change(before, after), rising || falling);
        }
    }
}
