//! Projection onto invariants after every step, for any method.
//!
//! The module deliberately does not know what an invariant means: energy, Casimir, constraint, or the equations of a
//! group in its coordinates.

use core::marker::PhantomData;

use super::{Method, Point, Start, Step, Tableau, two_sum};
use crate::directions::Directions;
use crate::error::Error;
use crate::options::{Options, signed};
use crate::positions::Positions;
use crate::real::Real;
use crate::system::{StateVector, System};

/// Functions of time and state that are constant along solutions, `K` of them.
///
/// Such are an energy, Casimirs and the residuals of constraints, and the equations that make coordinates elements of
/// a group: `|q|^2` of a quaternion, `R^T R` of a rotation matrix.
pub trait Invariants<R: Real, const K: usize>: System<R> {
    /// The values.
    fn values(&self, t: R, y: &Self::State) -> [R; K];

    /// Writes the derivatives of value `k` by the components of the state to `gradients[k]`, every component.
    fn gradients(&self, t: R, y: &Self::State, gradients: &mut [Self::State; K]);
}

impl<R: Real, const K: usize, S: Invariants<R, K> + ?Sized> Invariants<R, K> for &S {
    #[inline]
    fn values(&self, t: R, y: &Self::State) -> [R; K] {
        (**self).values(t, y)
    }

    #[inline]
    fn gradients(&self, t: R, y: &Self::State, gradients: &mut [Self::State; K]) {
        (**self).gradients(t, y, gradients);
    }
}

/// Functions that a projection keeps at their levels.
pub trait Levels<R: Real, S: System<R>, const K: usize> {
    /// What the functions are kept at along the motion through a state.
    fn levels(system: &S, t: R, y: &S::State) -> [R; K];

    /// Their values.
    fn values(system: &S, t: R, y: &S::State) -> [R; K];

    /// Writes their gradients.
    fn gradients(system: &S, t: R, y: &S::State, gradients: &mut [S::State; K]);
}

/// Projection onto the [`Invariants`] of the motion, at their values at the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OfMotion;

impl<R: Real, S: Invariants<R, K>, const K: usize> Levels<R, S, K> for OfMotion {
    #[inline]
    fn levels(system: &S, t: R, y: &S::State) -> [R; K] {
        system.values(t, y)
    }

    #[inline]
    fn values(system: &S, t: R, y: &S::State) -> [R; K] {
        system.values(t, y)
    }

    #[inline]
    fn gradients(system: &S, t: R, y: &S::State, gradients: &mut [S::State; K]) {
        system.gradients(t, y, gradients);
    }
}

/// Projection onto the equations between coordinates alone: residuals are kept at zero, whatever they are at the start,
/// which [`consistent`](crate::consistent) makes zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OfPositions;

impl<R: Real, S: Positions<R, K>, const K: usize> Levels<R, S, K> for OfPositions {
    #[inline]
    fn levels(system: &S, t: R, y: &S::State) -> [R; K] {
        system.levels(t, y)
    }

    #[inline]
    fn values(system: &S, t: R, y: &S::State) -> [R; K] {
        system.residuals(t, y)
    }

    #[inline]
    fn gradients(system: &S, t: R, y: &S::State, gradients: &mut [S::State; K]) {
        system.residual_gradients(t, y, gradients);
    }
}

/// A method whose every step ends with a projection onto the `K` invariants of the system.
///
/// ```text
/// y1 <- y1 + W sum_k alpha_k q_k     until     I_k(y1) = I_k(y0),     W = diag(1/(s^2 + y1_c^2))
/// ```
///
/// with the gradients `q_k` at the unprojected state, orthogonalised in the product `a.W b`, and `s` the size of a
/// number whose rounding, `epsilon s`, is the distance to the levels `max_k |I_k(y1) - I_k(y0)| / |q_k|`: the nearest
/// state, where a component that is rounded by more than that distance counts by its rounding. An angle that has
/// grown to thousands of turns is rounded by more than an energy needs to be corrected by; it is left alone, and the
/// velocities are moved. The order of the method is kept, and the invariants stay within round-off of their values at
/// the start, however many steps are taken. The price of a step is one evaluation of the gradients and two or three
/// of the values. An invariant whose gradient depends on those before it is left out at such a state; so is one that
/// rounding of the state changes by less than the smallest number, as an energy of velocities below 1e-154. An
/// invariant that is infinite or NaN ends the integration: [`Error::InvariantNotFinite`].
///
/// It is also how coordinates of a group stay in the group: to project a quaternion or a rotation matrix onto its
/// equations costs less than exponentials in every stage, works in any method and with its dense output and error
/// control, and the distance to the group does not grow.
///
/// With [`OfPositions`] it is a projection onto the equations between coordinates of a system with [`Positions`].
///
/// # Source
///
/// Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), algorithm IV.4.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Projected<M, const K: usize, L = OfMotion> {
    method: M,
    /// The first so many of the invariants are kept.
    kept: usize,
    levels: PhantomData<L>,
}

impl<M, const K: usize> Projected<M, K> {
    /// The method with projection onto all invariants.
    #[must_use]
    pub const fn new(method: M) -> Self {
        Self { method, kept: K, levels: PhantomData }
    }

    /// The method with projection onto the first `kept` of the invariants, all of them if there are fewer.
    ///
    /// For methods that conserve some invariants but for rounding and are better left alone with others: a
    /// [`Splitting`](super::Splitting) moves along the levels of all Casimirs, and has a nearby energy of its own. The
    /// invariants of a generated scene are Casimirs first, then the energy.
    #[must_use]
    pub const fn onto_first(method: M, kept: usize) -> Self {
        Self { method, kept: if kept < K { kept } else { K }, levels: PhantomData }
    }
}

impl<M, const K: usize> Projected<M, K, OfPositions> {
    /// The method with projection onto the equations between coordinates.
    #[must_use]
    pub const fn onto_positions(method: M) -> Self {
        Self { method, kept: K, levels: PhantomData }
    }
}

impl<M: Default, const K: usize> Default for Projected<M, K> {
    fn default() -> Self {
        Self::new(M::default())
    }
}

/// What a projected method keeps: the storage of the method, the invariants at the start and space for gradients.
#[derive(Clone, Debug)]
pub struct Projection<R, V, T, const K: usize> {
    inner: T,
    levels: [R; K],
    directions: Directions<V, K>,
}

impl<R, M, const K: usize, L, S> Method<R, S> for Projected<M, K, L>
where
    R: Real,
    M: Method<R, S>,
    L: Levels<R, S, K> + Copy,
    S: System<R>,
{
    const TABLEAU: &'static Tableau = M::TABLEAU;

    const DENSE_BY_STEPS: bool = M::DENSE_BY_STEPS;

    #[inline(always)]
    fn tableau(&self) -> &'static Tableau {
        self.method.tableau()
    }

    #[inline(always)]
    fn dense_by_steps(&self) -> bool {
        self.method.dense_by_steps()
    }

    type Storage = Projection<R, S::State, M::Storage, K>;

    fn validate(&self, options: &Options<R>) -> Result<(), Error> {
        self.method.validate(options)
    }

    fn storage(&self, system: &S, t0: R, y0: &S::State, options: &Options<R>) -> Self::Storage {
        Projection {
            inner: self.method.storage(system, t0, y0, options),
            levels: L::levels(system, t0, y0),
            directions: Directions::new(y0),
        }
    }

    #[inline]
    fn stages(storage: &Self::Storage) -> &[S::State] {
        M::stages(&storage.inner)
    }

    #[inline]
    fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
        M::stages_mut(&mut storage.inner)
    }

    #[inline]
    fn last_time(&self, storage: &mut Self::Storage, start: Start<'_, R, S>, t_end: R) -> R {
        self.method.last_time(&mut storage.inner, start, t_end)
    }

    #[inline]
    fn longest_step(&self, storage: &mut Self::Storage, start: Start<'_, R, S>) -> f64 {
        self.method.longest_step(&mut storage.inner, start)
    }

    /// The levels are those of the state that the motion goes on from.
    fn restart(&self, storage: &mut Self::Storage, system: &S, t: R, y: &S::State) {
        self.method.restart(&mut storage.inner, system, t, y);
        storage.levels = L::levels(system, t, y);
    }

    #[inline]
    fn first_step(&self, storage: &mut Self::Storage, start: Start<'_, R, S>, trial: R) -> Option<f64> {
        self.method.first_step(&mut storage.inner, start, trial)
    }

    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        self.method.advance(&mut storage.inner, step)?;
        storage.project::<L, S>(step, self.kept)
    }

    #[inline]
    fn slope(&self, storage: &mut Self::Storage, system: &S, t: R, end: &mut Point<S::State>) {
        self.method.slope(&mut storage.inner, system, t, end);
    }

    #[inline]
    fn mean_square_error(
        storage: &Self::Storage,
        h: R,
        rtol: &S::State,
        atol: &S::State,
        ends: [&S::State; 2],
    ) -> Option<f64> {
        M::mean_square_error(&storage.inner, h, rtol, atol, ends)
    }
}

impl<R: Real, V: StateVector<R>, T, const K: usize> Projection<R, V, T, K> {
    /// Moves the end of a step onto the levels of the first `kept` invariants.
    fn project<L: Levels<R, S, K>, S: System<R, State = V>>(
        &mut self,
        step: &mut Step<'_, R, S>,
        kept: usize,
    ) -> Result<(), Error> {
        const MAX_ITERATIONS: usize = 4;
        let t = step.t + step.h;
        // What is not finite is found, and explained, by the integrator.
        if !step.to.state.as_slice().iter().all(|y| y.all_finite()) {
            return Ok(());
        }
        let Some(mut defects) = self.defects(t, L::values(step.system, t, &step.to.state), kept)? else {
            return Ok(());
        };
        L::gradients(step.system, t, &step.to.state, &mut self.directions.gradients);
        // What has no gradient is no direction to move in.
        for gradient in &mut self.directions.gradients[kept..] {
            gradient.as_mut_slice().fill(R::ZERO);
        }
        let size = R::from_f64(self.size_rounded_by_distance(&defects, &step.to.state));
        let weights = self.directions.weights.as_mut_slice();
        for (weight, &y) in weights.iter_mut().zip(step.to.state.as_slice()) {
            let y = y / size;
            *weight = y.mul_add(y, R::ONE).recip();
        }
        let independent = self.directions.orthogonalise(|gradient| is_resolved(gradient, &step.to.state));
        for _ in 0..MAX_ITERATIONS {
            let factors = independent.factors(&defects);
            let state = step.to.state.as_mut_slice().iter_mut().zip(step.to.residue.as_mut_slice());
            for (c, (state, residue)) in state.enumerate() {
                // The residue stays out of it: next to half a place it would be tipped over by the smallest
                // correction, and the state moved by a whole place.
                let (moved, lost) = two_sum(*state, self.directions.change(&factors, c));
                (*state, *residue) = (moved, *residue + lost);
            }
            let Some(left) = self.defects(t, L::values(step.system, t, &step.to.state), kept)? else {
                return Ok(());
            };
            // Round-off ends the progress.
            let size = |defects: &[R; K]| defects.iter().fold(0.0_f64, |max, x| max.max(x.magnitude()));
            if size(&left) >= 0.5 * size(&defects) {
                return Ok(());
            }
            defects = left;
        }
        Ok(())
    }

    /// The size of a number that is rounded by the distance to the levels, for which invariants need defects and
    /// gradients.
    fn size_rounded_by_distance(&self, defects: &[R; K], state: &V) -> f64 {
        let mut distance = 0.0_f64;
        for (gradient, defect) in self.directions.gradients.iter().zip(defects) {
            if is_resolved(gradient, state) {
                let steepest = gradient.as_slice().iter().fold(0.0_f64, |max, q| max.max(q.magnitude()));
                distance = distance.max(defect.magnitude() / steepest);
            }
        }
        (distance / R::EPSILON).max(R::MIN_POSITIVE)
    }

    /// Levels less values, of the first `kept` invariants; none if all are met.
    fn defects(&self, t: R, values: [R; K], kept: usize) -> Result<Option<[R; K]>, Error> {
        let defects: [R; K] =
            core::array::from_fn(|k| if k < kept { self.levels[k] - values[k] } else { R::ZERO });
        if let Some(index) = defects.iter().position(|defect| !defect.all_finite()) {
            return Err(Error::InvariantNotFinite { t: signed(t), index });
        }
        Ok(defects.iter().any(|defect| *defect != R::ZERO).then_some(defects))
    }
}

/// Whether an invariant changes by a number where the state is rounded; its gradient is given.
fn is_resolved<R: Real, V: StateVector<R>>(gradient: &V, state: &V) -> bool {
    let pairs = gradient.as_slice().iter().zip(state.as_slice());
    let change = pairs.fold(0.0_f64, |sum, (&q, &y)| sum + q.magnitude() * y.magnitude());
    change > R::MIN_POSITIVE
}
