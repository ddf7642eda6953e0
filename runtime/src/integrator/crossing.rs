//! Cubics between the ends of a step: they tell cheaply where functions are far from zero, and give brackets of events
//! where the inside of a step is computed by steps of their own, so that few are taken.
//!
//! Does not know directions of events, or what is done where one is found.

use super::Integrator;
use super::norms::copy;
use crate::error::Error;
use crate::events::{is_after, locate};
use crate::methods::{Method, Point};
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
    /// Writes the state at a time of the last step along the cubic between its ends to `work`.
    pub(super) fn evaluate_cubic(&mut self, t: R) {
        let (from, length) = (self.t_previous, self.t - self.t_previous);
        let ends = ends_of(&self.points, self.current);
        cubic(ends, length, (t - from) / length, &mut self.work);
    }

    /// Whether the cubic between the ends of the last step is close to the motion: its slope in the middle is that of
    /// the equations there, but for a twentieth. One evaluation.
    ///
    /// ```text
    /// y'(h/2) = 3/2 (y_b - y_a)/h - (y'_a + y'_b)/4
    /// ```
    pub(super) fn is_cubic_close(&mut self) -> bool {
        const CLOSE: f64 = 0.05;
        let length = self.t - self.t_previous;
        let middle = self.t_previous + R::from_f64(0.5) * length;
        self.evaluate_cubic(middle);
        // Scales of errors are computed anew for every step.
        self.system.rhs(middle, &self.work, &mut self.scales);
        self.stats.rhs_evals += 1;
        let [a, b] = ends_of(&self.points, self.current);
        let states = a.0.as_slice().iter().zip(b.0.as_slice());
        let slopes = a.1.as_slice().iter().zip(b.1.as_slice());
        states.zip(slopes).zip(self.scales.as_slice()).all(|(((&y_a, &y_b), (&first, &last)), &slope)| {
            let along = R::from_f64(1.5) * (y_b - y_a) / length - R::from_f64(0.25) * (first + last);
            let size = first.magnitude().max(last.magnitude()).max(slope.magnitude());
            (along - slope).magnitude() <= CLOSE * size
        })
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

/// States and slopes at the ends of the last step.
fn ends_of<V>(points: &[Point<V>; 2], current: bool) -> [(&V, &V); 2] {
    let [first, last] = [usize::from(!current), usize::from(current)].map(|k| &points[k]);
    [(&first.state, &first.slope), (&last.state, &last.slope)]
}
