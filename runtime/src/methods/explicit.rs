//! Stages of explicit methods, unrolled.
//!
//! The module deliberately does not know any tableau: each is a constant of the method that it is compiled for.

use super::{Derivatives, Method, Step, c, compensated_advance};
use crate::real::Real;
use crate::system::{StateVector, System};

/// A unit type that is an explicit method: its name, its tableau and the number of stored stages.
macro_rules! explicit_method {
    ($(#[$attribute:meta])* $name:ident, $tableau:ident, $n_stored:literal) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct $name;

        impl<R: crate::real::Real, S: crate::system::System<R>> super::ExplicitMethod<R, S> for $name {}

        impl<R: crate::real::Real, S: crate::system::System<R>> super::Method<R, S> for $name {
            const TABLEAU: &'static Tableau = &$tableau;

            type Storage = [S::State; $n_stored];

            fn storage(
                &self,
                _system: &S,
                _t0: R,
                y0: &S::State,
                _options: &crate::options::Options<R>,
            ) -> Self::Storage {
                const { assert!($n_stored == $tableau.n_stored()) }
                core::array::from_fn(|_| crate::system::StateVector::zeros_like(y0))
            }

            fn renew(
                &self,
                _storage: &mut Self::Storage,
                _system: &S,
                _t0: R,
                _y0: &S::State,
                _options: &crate::options::Options<R>,
            ) {
                // Every stage of a step is computed before it is read.
            }

            #[inline]
            fn stages(storage: &Self::Storage) -> &[S::State] {
                storage
            }

            #[inline]
            fn stages_mut(storage: &mut Self::Storage) -> &mut [S::State] {
                storage
            }

            #[inline]
            fn advance(
                &self,
                storage: &mut Self::Storage,
                step: &mut super::Step<'_, R, S>,
            ) -> Result<(), crate::error::Error> {
                super::explicit::advance::<R, S, Self, $n_stored>(storage, step);
                Ok(())
            }
        }
    };
}
pub(super) use explicit_method;

/// A method that is its tableau: every stage is an evaluation of the right-hand side at what the rows before say, and
/// the end of a step is the sum of the weights, so that a step is differentiated by the tableau alone.
pub trait ExplicitMethod<R: Real, S: System<R>>: Method<R, S> {}

/// Computes all stages but the first, and the new state.
///
/// Every stage is compiled apart with its row of the tableau as a constant, so that the sums are straight-line code
/// without the coefficients that vanish.
#[inline(always)]
pub(super) fn advance<R: Real, S: System<R>, M: Method<R, S>, const N_STORED: usize>(
    stages: &mut [S::State; N_STORED],
    step: &mut Step<'_, R, S>,
) {
    macro_rules! in_order {
        ($($index:literal)*) => {$(
            if const { $index < M::TABLEAU.n_stages() } {
                stage::<R, S, M, $index>(stages, step);
            }
        )*};
    }
    const { assert!(M::TABLEAU.n_stages() <= 16) }
    in_order!(1 2 3 4 5 6 7 8 9 10 11 12 13 14 15);
    let (from, h) = (step.from, step.h);
    // The weights do not refer to the derivative at the end, which is not known yet.
    let k = Derivatives {
        n_stages: M::TABLEAU.n_stages(),
        first: &from.slope,
        stored: stages,
        last: &from.slope,
    };
    compensated_advance((from, step.to), h, const { M::TABLEAU.weights }, &k);
    *step.rhs_evals += const { M::TABLEAU.n_stages() as u64 - 1 };
}

/// Computes the stage `I`.
#[inline(always)]
fn stage<R: Real, S: System<R>, M: Method<R, S>, const I: usize>(
    stages: &mut [S::State],
    step: &mut Step<'_, R, S>,
) {
    let (row, node) = const {
        // The branch keeps stages that a shorter tableau lacks from being looked up.
        if I < M::TABLEAU.n_stages() {
            (M::TABLEAU.stages[I], M::TABLEAU.nodes[I])
        } else {
            (&[] as _, c(0.0, 0.0))
        }
    };
    let (known, next) = stages.split_at_mut(I - 1);
    let first = &step.from.slope;
    let k = Derivatives { n_stages: M::TABLEAU.n_stages(), first, stored: known, last: first };
    let y = step.from.state.as_slice();
    let (h, out) = (step.h, step.work.as_mut_slice());
    k.for_each_sum(row, y.len(), |c, slope| out[c] = h.mul_add(slope, y[c]));
    step.system.rhs(step.t + node.get::<R>() * step.h, step.work, &mut next[0]);
}
