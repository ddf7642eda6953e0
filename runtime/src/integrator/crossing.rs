//! Cubics between the ends of a step, which cost no evaluation: they see functions that change their sign twice within
//! it, and give brackets of events where the inside of a step is computed by steps of their own, so that few are taken.
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

/// Parts of a step at which functions are looked at along the cubic.
pub(super) const PROBES: [f64; 3] = [0.25, 0.5, 0.75];

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
    /// Whether a function that has the values `before` and `after` at the ends of the last step seems to change its
    /// sign more than once within it: the cubic between the ends, or the series of the step, is looked at in
    /// [`PROBES`].
    pub(super) fn turns<const K: usize>(
        &mut self,
        before: [R; K],
        after: [R; K],
        mut functions: impl FnMut(R, &S::State) -> [R; K],
    ) -> Result<bool, Error> {
        let (mut signs, mut n_changes) = (before.map(sign), [0; K]);
        let mut note = |values: [R; K]| {
            for ((own, n), value) in signs.iter_mut().zip(&mut n_changes).zip(values) {
                // What is zero or not finite says nothing.
                if let Some(new) = sign(value) {
                    *n += u8::from(*own == Some(!new));
                    *own = Some(new);
                }
            }
        };
        let (from, length) = (self.t_previous, self.t - self.t_previous);
        for part in PROBES {
            let t = from + R::from_f64(part) * length;
            if const { M::TABLEAU.is_series() } {
                self.evaluate_dense(t)?;
            } else {
                let [first, last] =
                    [usize::from(!self.current), usize::from(self.current)].map(|k| &self.points[k]);
                let ends = [(&first.state, &first.slope), (&last.state, &last.slope)];
                cubic(ends, length, R::from_f64(part), &mut self.work);
            }
            note(functions(t, &self.work));
        }
        note(after);
        Ok(n_changes.iter().any(|n| *n > 1))
    }

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
                let ends = [(&a.state, &a.slope), (&b.state, &b.slope)];
                cubic(ends, (b.x - a.x) * length, x, &mut self.work);
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

/// The state at the part `x` of an interval of size `h`, from states and slopes at its ends.
fn cubic<R: Real, V: StateVector<R>>([a, b]: [(&V, &V); 2], h: R, x: R, out: &mut V) {
    let rest = R::ONE - x;
    let states = a.0.as_slice().iter().zip(b.0.as_slice());
    let slopes = a.1.as_slice().iter().zip(b.1.as_slice());
    for ((out, (&start, &end)), (&first, &last)) in out.as_mut_slice().iter_mut().zip(states).zip(slopes) {
        let (difference, first, last) = (end - start, h * first, h * last);
        let bend = difference + difference - first - last;
        *out = start + x * (difference + rest * (first - difference + x * bend));
    }
}

/// Whether a number is positive, rather than negative; none where it is neither.
fn sign<R: Real>(value: R) -> Option<bool> {
    let (is_positive, is_negative) = (value.all_gt(R::ZERO), R::ZERO.all_gt(value));
    (is_positive || is_negative).then_some(is_positive)
}
