//! A bracket of an event within a step whose inside is computed by steps of their own: found by cubics between states
//! that are known, so that few of these steps are taken.
//!
//! Does not know directions of events, or what is done where one is found.

use super::Integrator;
use super::norms::copy;
use crate::error::Error;
use crate::events::{is_after, locate};
use crate::methods::Method;
use crate::options::signed;
use crate::real::Real;
use crate::system::{StateVector, System};

/// Most cubics for one event; each takes the distance to the fourth power where the function is smooth.
const MAX_CUBICS: usize = 8;

/// An end of a bracket.
struct End<R, V> {
    /// Part of the step.
    x: R,
    /// Value of the function, infinite or NaN nowhere.
    value: f64,
    state: V,
    slope: V,
}

impl<R: Real, S: System<R>, M: Method<R, S>> Integrator<'_, R, S, M> {
    /// Parts of the last step, and values there, between which a function changes its sign: at most `resolution` apart
    /// where it is smooth.
    ///
    /// ```text
    /// y(a + x (b - a)) = y_a + x (d + (1 - x) (h y'_a - d + x (2 d - h y'_a - h y'_b))),  d = y_b - y_a
    /// ```
    ///
    /// The function along this cubic is zero near its zero along the motion; a step to that place is the next end.
    pub(super) fn bracket_by_cubics(
        &mut self,
        function: &mut impl FnMut(R, &S::State) -> Result<f64, Error>,
        (before, after): (f64, f64),
        resolution: f64,
    ) -> Result<[(R, f64); 2], Error> {
        let (from, length) = (self.t_previous, self.t - self.t_previous);
        let [first, last] = [usize::from(!self.current), usize::from(self.current)].map(|k| &self.points[k]);
        let mut a = End { x: R::ZERO, value: before, state: first.state.clone(), slope: first.slope.clone() };
        let mut b = End { x: R::ONE, value: after, state: last.state.clone(), slope: last.slope.clone() };
        for _ in 0..MAX_CUBICS {
            let width = (b.x - a.x).magnitude();
            if width <= resolution {
                break;
            }
            let along = |x: R| {
                cubic([&a, &b], (b.x - a.x) * length, x, &mut self.work);
                function(from + (a.x + x * (b.x - a.x)) * length, &self.work)
            };
            // Where the cubic leaves the domain of the function, steps alone have to find the place.
            let Ok(root) = locate(along, (a.value, b.value), (resolution / width).max(R::EPSILON)) else {
                break;
            };
            // Apart from both ends, so that the bracket closes where one of them is the place.
            let margin = (0.75 * resolution).min(0.5 * width);
            let distance = (signed(root) * width).clamp(margin, width - margin);
            let x = a.x + R::from_f64(distance);
            let t = from + x * length;
            self.evaluate_dense(t)?;
            let value = function(t, &self.work)?;
            let end = if is_after(value, (before, after)) { &mut b } else { &mut a };
            (end.x, end.value) = (x, value);
            copy(&self.work, &mut end.state);
            self.system.rhs(t, &end.state, &mut end.slope);
            self.stats.rhs_evals += 1;
        }
        Ok([(a.x, a.value), (b.x, b.value)])
    }
}

/// The state at the part `x` of an interval of size `h`.
fn cubic<R: Real, V: StateVector<R>>([a, b]: [&End<R, V>; 2], h: R, x: R, out: &mut V) {
    let rest = R::ONE - x;
    let states = a.state.as_slice().iter().zip(b.state.as_slice());
    let slopes = a.slope.as_slice().iter().zip(b.slope.as_slice());
    for ((out, (&start, &end)), (&first, &last)) in out.as_mut_slice().iter_mut().zip(states).zip(slopes) {
        let (difference, first, last) = (end - start, h * first, h * last);
        let bend = difference + difference - first - last;
        *out = start + x * (difference + rest * (first - difference + x * bend));
    }
}
