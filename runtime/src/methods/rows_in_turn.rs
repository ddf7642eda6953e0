//! Extrapolation of order 14 for scalars whose lanes are trajectories: the rows are computed one after the other.
//!
//! Does not know how steps are chosen, or what the system is beyond its right-hand side.

use super::gbs14::{Gbs14, TABLEAU, WEIGHTS, validate};
use super::{Method, Step, Tableau, two_sum};
use crate::error::Error;
use crate::lanes::{F64x4, F64x8};
use crate::options::Options;
use crate::real::Real;
use crate::system::{StateVector, System};

/// What [`Gbs14`] keeps where the lanes of a scalar are trajectories.
#[derive(Clone, Debug)]
pub struct Turns<V> {
    /// The estimate of the error, divided by the step.
    estimate: [V; 1],
    zeros: V,
}

impl<V> Turns<V> {
    #[inline(always)]
    fn advance<R: Real, S: System<R, State = V>>(&mut self, step: &mut Step<'_, R, S>)
    where
        V: StateVector<R>,
    {
        let (y, f) = (step.from.state.as_slice(), step.from.slope.as_slice());
        // Copies, which stay in registers as far as there are any.
        let [mut even, mut odd, mut point, mut slope, mut sum, mut error] =
            core::array::from_fn(|_| self.zeros.clone());
        for (half, weights) in WEIGHTS.iter().enumerate().skip(1) {
            let eta = step.h * R::from_f64(1.0 / (2 * half) as f64);
            let (mut t, twice) = (step.t + eta, eta + eta);
            for (even, (odd, f)) in even.as_mut_slice().iter_mut().zip(odd.as_mut_slice().iter_mut().zip(f)) {
                (*even, *odd) = (R::ZERO, eta * *f);
            }
            let mut substep = |at: &V, to: &mut V| {
                for ((point, at), y) in point.as_mut_slice().iter_mut().zip(at.as_slice()).zip(y) {
                    *point = *y + *at;
                }
                step.system.rhs(t, &point, &mut slope);
                for (to, slope) in to.as_mut_slice().iter_mut().zip(slope.as_slice()) {
                    *to = twice.mul_add(*slope, *to);
                }
                t += eta;
            };
            substep(&odd, &mut even);
            for _ in 1..half {
                substep(&even, &mut odd);
                substep(&odd, &mut even);
            }
            let weights = weights.map(R::from_f64);
            let sums = sum.as_mut_slice().iter_mut().zip(error.as_mut_slice());
            for ((sum, error), even) in sums.zip(even.as_slice()) {
                *sum = weights[0].mul_add(*even, *sum);
                *error = weights[1].mul_add(*even, *error);
            }
        }
        let ends = step.to.state.as_mut_slice().iter_mut().zip(step.to.residue.as_mut_slice());
        let starts = y.iter().zip(step.from.residue.as_slice()).zip(sum.as_slice());
        for ((state, residue), ((y, lacks), sum)) in ends.zip(starts) {
            (*state, *residue) = two_sum(*y, *sum + *lacks);
        }
        let per_h = step.h.recip();
        for (estimate, error) in self.estimate[0].as_mut_slice().iter_mut().zip(error.as_slice()) {
            *estimate = *error * per_h;
        }
    }
}

macro_rules! in_turn {
    ($($scalar:ident)*) => {$(
        impl<S: System<$scalar>> Method<$scalar, S> for Gbs14 {
            const TABLEAU: &'static Tableau = &TABLEAU;

            const DENSE_BY_STEPS: bool = true;

            type Storage = Turns<S::State>;

            fn validate(&self, options: &Options<$scalar>) -> Result<(), Error> {
                validate(options)
            }

            fn storage(
                &self,
                _system: &S,
                _t0: $scalar,
                y0: &S::State,
                _options: &Options<$scalar>,
            ) -> Self::Storage {
                Turns { estimate: [y0.zeros_like()], zeros: y0.zeros_like() }
            }

            #[inline]
            fn stages(storage: &Self::Storage) -> &[S::State] {
                &storage.estimate
            }

            #[inline]
            fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
                &mut storage.estimate
            }

            #[inline]
            fn advance(
                &self,
                storage: &mut Self::Storage,
                step: &mut Step<'_, $scalar, S>,
            ) -> Result<(), Error> {
                storage.advance(step);
                *step.rhs_evals += 49;
                Ok(())
            }
        }
    )*};
}

in_turn! { F64x4 F64x8 }
