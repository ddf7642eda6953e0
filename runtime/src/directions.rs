//! Steps of Newton's method towards levels of several functions along their gradients.
//!
//! The module deliberately does not know what the functions are, or when to stop.

use crate::real::Real;
use crate::system::StateVector;

/// Gradients of `K` functions, in the product `a.W b` with a diagonal `W`.
#[derive(Clone, Debug)]
pub(crate) struct Directions<V, const K: usize> {
    /// Gradients, then what is left of each after those before it.
    pub(crate) gradients: [V; K],
    /// Diagonal of `W`.
    pub(crate) weights: V,
}

/// What [`Directions::orthogonalise`] has found.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Independent<R, const K: usize> {
    /// Components along those before, relative to the squares of what is left.
    slants: [[R; K]; K],
    /// Squares of what is left; zero where nothing is.
    pub(crate) squares: [R; K],
}

impl<R: Real, const K: usize> Independent<R, K> {
    /// Multiples of what is left of each gradient that change every function by its defect, as far as they are linear.
    pub(crate) fn factors(&self, defects: &[R; K]) -> [R; K] {
        let mut factors = [R::ZERO; K];
        for k in 0..K {
            if self.squares[k] == R::ZERO {
                continue;
            }
            let met = (0..k).fold(R::ZERO, |sum, j| sum + self.slants[k][j] * factors[j] * self.squares[j]);
            factors[k] = (defects[k] - met) / self.squares[k];
        }
        factors
    }
}

impl<V, const K: usize> Directions<V, K> {
    /// With all gradients zero and `W = 1`, for states like this one.
    pub(crate) fn new<R: Real>(y: &V) -> Self
    where
        V: StateVector<R>,
    {
        let mut weights = y.zeros_like();
        weights.as_mut_slice().fill(R::ONE);
        Self { gradients: core::array::from_fn(|_| y.zeros_like()), weights }
    }

    /// Subtracts from each gradient its components along those before it; those that are not resolved are left out.
    pub(crate) fn orthogonalise<R: Real>(&mut self, is_resolved: impl Fn(&V) -> bool) -> Independent<R, K>
    where
        V: StateVector<R>,
    {
        /// Below this part of its size, in units of round-off, what is left of a gradient is round-off.
        const DEPENDENT: f64 = 4.5e5;
        let dependent = DEPENDENT * R::EPSILON;
        let weights = self.weights.as_slice();
        let dot = |a: &V, b: &V| {
            let both = a.as_slice().iter().zip(b.as_slice()).zip(weights);
            both.fold(R::ZERO, |sum, ((&a, &b), &weight)| (weight * a).mul_add(b, sum))
        };
        let (mut slants, mut squares) = ([[R::ZERO; K]; K], [R::ZERO; K]);
        for k in 0..K {
            let (before, from) = self.gradients.split_at_mut(k);
            let gradient = &mut from[0];
            if !is_resolved(gradient) {
                continue;
            }
            let whole = dot(gradient, gradient);
            for (j, direction) in before.iter().enumerate() {
                if squares[j] == R::ZERO {
                    continue;
                }
                slants[k][j] = dot(gradient, direction) / squares[j];
                for (out, &along) in gradient.as_mut_slice().iter_mut().zip(direction.as_slice()) {
                    *out -= slants[k][j] * along;
                }
            }
            let left = dot(gradient, gradient);
            if left.all_gt(R::from_f64(dependent * dependent) * whole) && left.all_finite() {
                squares[k] = left;
            }
        }
        Independent { slants, squares }
    }

    /// The change of component `c` of the state by multiples of what is left of the gradients.
    pub(crate) fn change<R: Real>(&self, factors: &[R; K], c: usize) -> R
    where
        V: StateVector<R>,
    {
        let sum = (0..K).fold(R::ZERO, |sum, k| sum + factors[k] * self.gradients[k].as_slice()[c]);
        self.weights.as_slice()[c] * sum
    }
}
