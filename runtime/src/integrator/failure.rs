//! Why a trial step fails: the point that is not finite, the pivot that vanishes.
//!
//! Nothing here runs along a motion that goes well. Does not know how steps are chosen.

use super::Integrator;
use super::dense::Dense;
use super::norms::{non_finite, stage_point};
use crate::error::{Error, Failure};
use crate::methods::{Derivatives, Method};
use crate::options::signed;
use crate::real::Real;
use crate::system::{StateVector, System};

impl<R: Real, S: System<R>, M: Method<R, S>> Integrator<'_, R, S, M> {
    /// Which pivot has passed through zero on the way to the trial state, or has no value there.
    #[cold]
    pub(super) fn crossed(&self, t_new: R) -> Failure {
        let to = &self.points[usize::from(!self.current)].state;
        if let Err(failure) = self.system.check(t_new, to) {
            return failure;
        }
        // The signature has changed, and with it the sign of a pivot.
        let pivot = self.first_pivot((t_new, to), changes_sign).unwrap_or("of a linear system");
        Failure::ChangedSign { t: signed(t_new), pivot }
    }

    /// The name of the first pivot whose values at the last accepted state and at another one are as `is_such` says.
    fn first_pivot(&self, (t, y): (R, &S::State), is_such: impl Fn(R, R) -> bool) -> Option<&'static str> {
        let (mut found, mut index) = (None, 0_usize);
        self.system.pivots(self.t, &self.here().state, &mut |here| {
            let mut other = 0;
            // As there is no storage for the values, they are computed again for each.
            self.system.pivots(t, y, &mut |there| {
                if other == index && found.is_none() && is_such(here.value, there.value) {
                    found = Some(here.name);
                }
                other += 1;
            });
            index += 1;
        });
        found
    }

    /// Whether the slope has a pole where a pivot changes its sign on the way to the trial state.
    ///
    /// On the chord between the states, a slope that is regular changes less on the last tenth of the way to the zero
    /// of the pivot than before it, `0.09` and `0.4` for one that is linear, and next to a pole of first order ten
    /// times as much, `90` and `8`. Rounding errors of quotients that have a value there are small at these distances
    /// still.
    #[cold]
    pub(super) fn has_pole(&self, t_new: R) -> bool {
        const DISTANCES: [f64; 3] = [0.5, 0.1, 0.01];
        const GROWTH: f64 = 3.0;
        // Changes of a slope that are no larger part of it say nothing.
        const NOISE: f64 = 1e-6;
        let mut chord = self.work.clone();
        let pivot = |chord: &mut S::State, index: usize, part: f64| {
            let t = self.on_chord(t_new, part, chord);
            let (mut value, mut k) = (None, 0);
            self.system.pivots(t, chord, &mut |pivot| {
                if k == index {
                    value = Some(pivot.value);
                }
                k += 1;
            });
            value
        };
        let mut index = 0;
        while let (Some(here), Some(there)) = (pivot(&mut chord, index, 0.0), pivot(&mut chord, index, 1.0)) {
            let (mut low, mut high) = (0.0, 1.0);
            if changes_sign(here, there) {
                for _ in 0..40 {
                    let middle = 0.5 * (low + high);
                    match pivot(&mut chord, index, middle) {
                        Some(value) if changes_sign(here, value) => high = middle,
                        _ => low = middle,
                    }
                }
                // Lanes that cross at places of their own are to be taken one by one.
                let beyond = pivot(&mut chord, index, high);
                if !beyond.is_some_and(|beyond| R::ZERO.all_gt(sign(here) * sign(beyond))) {
                    return true;
                }
                // From the side that is farther away.
                let side = if low < 0.5 { 1.0 - low } else { -low };
                let slopes = DISTANCES.map(|distance| {
                    let t = self.on_chord(t_new, low + side * distance, &mut chord);
                    let mut slope = self.work.zeros_like();
                    self.system.rhs(t, &chord, &mut slope);
                    slope
                });
                let [far, middle, near] = slopes.each_ref().map(StateVector::as_slice);
                let is_regular = far.iter().zip(middle).zip(near).all(|((&far, &middle), &near)| {
                    let change = (near - middle).abs();
                    let noise = (far.abs() + middle.abs()) * R::from_f64(NOISE);
                    ((middle - far).abs().mul_add(R::from_f64(GROWTH), noise)).all_ge(change)
                });
                if !is_regular {
                    return true;
                }
            }
            index += 1;
        }
        false
    }

    /// The state at a part of the way from the last accepted state to the trial state, and its time.
    fn on_chord(&self, t_new: R, part: f64, chord: &mut S::State) -> R {
        let part = R::from_f64(part);
        let (from, to) = (self.here(), &self.points[usize::from(!self.current)]);
        let ends = from.state.as_slice().iter().zip(to.state.as_slice());
        for (out, (&here, &there)) in chord.as_mut_slice().iter_mut().zip(ends) {
            *out = (there - here).mul_add(part, here);
        }
        (t_new - self.t).mul_add(part, self.t)
    }

    /// The first pivot that is as `is_such` says somewhere on the tangent of the solution: at one of the distances
    /// `h, 2 h, 4 h, ..`.
    #[cold]
    fn pivot_ahead(
        &mut self,
        h: R,
        n_distances: u32,
        is_such: impl Fn(R, R) -> bool,
    ) -> Option<&'static str> {
        // The trial point is free.
        self.dense = Dense::Lost;
        let [one, two] = &mut self.points;
        let (here, free) = if self.current { (two, one) } else { (one, two) };
        self.system.rhs(self.t, &here.state, &mut free.slope);
        self.stats.rhs_evals += 1;
        let mut distance = h;
        for _ in 0..n_distances {
            let (here, free) =
                (&self.points[usize::from(self.current)], &self.points[usize::from(!self.current)]);
            let components = self.work.as_mut_slice().iter_mut().zip(here.state.as_slice());
            for ((out, &y), &slope) in components.zip(free.slope.as_slice()) {
                *out = slope.mul_add(distance, y);
            }
            let found = self.first_pivot((self.t + distance, &self.work), &is_such);
            if found.is_some() {
                return found;
            }
            distance += distance;
        }
        None
    }

    /// Why steps became too small: a pivot that is about to vanish where there is one.
    #[cold]
    pub(super) fn too_small(&mut self, h: R, failure: Option<Error>) -> Error {
        let unnamed =
            |e: &Error| matches!(e, Error::Failure(Failure::NonFinite { .. }) | Error::NotConverged { .. });
        if let Some(named) = failure.filter(|e| !unnamed(e)) {
            return named;
        }
        // Next to a singular point steps are a small fraction of the distance to it.
        const DOUBLINGS: u32 = 20;
        let half = R::from_f64(0.5);
        let is_vanishing = |here: R, there: R| {
            let ratio = there / here;
            ratio.all_finite() && !ratio.all_gt(half)
        };
        match self.pivot_ahead(h, DOUBLINGS, is_vanishing) {
            Some(pivot) => Failure::Singular { t: signed(self.t), pivot }.into(),
            None => failure.unwrap_or(Error::StepTooSmall { t: signed(self.t), h: signed(h) }),
        }
    }

    /// Why a fixed step failed: a pivot that passes through zero on it where there is one, and the system has not
    /// said so.
    #[cold]
    pub(super) fn named(&mut self, h: R, reason: Error) -> Error {
        if !matches!(reason, Error::Failure(Failure::NonFinite { .. }) | Error::NotConverged { .. }) {
            return reason;
        }
        let t = signed(self.t + h);
        // The motion runs ahead of its tangent there.
        self.pivot_ahead(h, 2, changes_sign).map_or(reason, |pivot| Failure::ChangedSign { t, pivot }.into())
    }

    /// Finds the first point of a trial step where something is not finite, and asks the system why.
    #[cold]
    pub(super) fn diagnose(&mut self, h: R, t_new: R) -> Failure {
        let tableau = self.method.tableau();
        let (from, to) = (&self.points[usize::from(self.current)], &self.points[usize::from(!self.current)]);
        let stored = M::stages(&self.storage);
        if tableau.is_series() {
            let coefficients = stored.iter().find(|coefficient| non_finite(*coefficient).is_some());
            let failure = self.point_failure(self.t, &from.state, coefficients);
            return failure
                .or_else(|| self.point_failure(t_new, &to.state, None))
                .unwrap_or(Failure::NonFinite { t: signed(t_new), index: 0 });
        }
        let k = Derivatives { n_stages: tableau.n_stages(), first: &from.slope, stored, last: &to.slope };
        for (index, (row, node)) in tableau.stages.iter().zip(tableau.nodes).enumerate() {
            stage_point(&k, row, &from.state, h, &mut self.work);
            let t = self.t + node.get::<R>() * h;
            if let Some(failure) = self.point_failure(t, &self.work, Some(k.get(index))) {
                return failure;
            }
        }
        self.point_failure(t_new, &to.state, Some(&to.slope))
            .unwrap_or(Failure::NonFinite { t: signed(t_new), index: 0 })
    }

    /// Why a point, or the derivative there, is not finite; none if both are.
    pub(super) fn point_failure(&self, t: R, y: &S::State, derivative: Option<&S::State>) -> Option<Failure> {
        if let Some(index) = non_finite(y) {
            return Some(Failure::NonFinite { t: signed(t), index });
        }
        let index = non_finite(derivative?)?;
        let named = self.system.check(t, y).and_then(|()| self.system.domain(t, y));
        Some(named.err().unwrap_or(Failure::NonFinite { t: signed(t), index }))
    }
}

/// Whether a pivot has another sign on some lane.
fn changes_sign<R: Real>(here: R, there: R) -> bool {
    let signs = sign(here) * sign(there);
    signs.all_finite() && !signs.all_gt(R::ZERO)
}

/// One with the sign of a number on every lane.
fn sign<R: Real>(x: R) -> R {
    x / x.abs()
}
