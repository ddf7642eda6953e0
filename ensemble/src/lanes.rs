//! One scene on any scalar, and the scalars that hold several trajectories.
//!
//! The module deliberately does not know how anything is integrated.

use std::marker::PhantomData;

use hamel_runtime::{F64x4, F64x8, ParamError, Real, Scene, StateVector, System};

/// A scene with a state of `N` components on every scalar, as hamel generates it; made by [`family!`](crate::family).
pub trait Family<const N: usize> {
    /// The scene on the scalar `R`.
    type Of<R: Real>: Scene<R> + System<R, State = [R; N]>;
}

/// Makes systems on the scalar `R` from parameters; for scenes that are known at run time only, as any [`Family`] is
/// one.
pub trait Source<R: Real>: Sync {
    /// Storage of a state.
    type State: StateVector<R>;
    /// The system.
    type System: System<R, State = Self::State>;
    /// Why parameters are not allowed.
    type Error: Send;

    /// Makes a system from parameter values; on several lanes the values differ from lane to lane.
    ///
    /// # Errors
    /// Why the values are not allowed, on any lane.
    fn prepare(&self, params: &[R]) -> Result<Self::System, Self::Error>;

    /// Makes a system of this source the one with other parameter values; without allocation where it can be.
    ///
    /// # Errors
    /// As [`prepare`](Self::prepare); the system is then to be prepared again before it is used.
    fn prepare_again(&self, system: &mut Self::System, params: &[R]) -> Result<(), Self::Error> {
        *system = self.prepare(params)?;
        Ok(())
    }

    /// The state with these components.
    fn state(&self, components: &[R]) -> Self::State;

    /// A number that is recorded beside each sample, such as the energy, if the source has one.
    fn measure(&self, system: &Self::System, t: R, y: &Self::State) -> Option<R> {
        let _ = (system, t, y);
        None
    }
}

/// A family as a [`Source`].
pub(crate) struct Generated<F, const N: usize>(pub(crate) PhantomData<fn() -> F>);

impl<F: Family<N>, R: Real, const N: usize> Source<R> for Generated<F, N> {
    type State = [R; N];
    type System = F::Of<R>;
    type Error = ParamError;

    fn prepare(&self, params: &[R]) -> Result<F::Of<R>, ParamError> {
        F::Of::<R>::prepare(params)
    }

    fn state(&self, components: &[R]) -> [R; N] {
        std::array::from_fn(|k| components[k])
    }
}

/// Declares a type that stands for a generated scene on every scalar: its name, the number of components of its state,
/// and the path of the generated `Prepared`.
///
/// ```
/// hamel_ensemble::family! {
///     /// Euler's disk.
///     pub EulerDisk, 5 = hamel_models::generated::euler_disk::Prepared
/// }
/// ```
#[macro_export]
macro_rules! family {
    ($(#[$attribute:meta])* $visibility:vis $name:ident, $n:literal = $($prepared:ident)::+) => {
        $(#[$attribute])*
        #[derive(Clone, Copy, Debug)]
        $visibility enum $name {}

        impl $crate::Family<$n> for $name {
            type Of<R: $crate::__runtime::Real> = $($prepared)::+<R>;
        }
    };
}

/// A scalar that holds one trajectory or several: `f64`, [`F64x4`], [`F64x8`].
pub trait Lanes: Real + sealed::Sealed {
    /// How many.
    const LANES: usize;

    /// The number whose lane `k` is `lane(k)`.
    #[must_use]
    fn gather(lane: impl FnMut(usize) -> f64) -> Self;

    /// Lane `k`.
    ///
    /// # Panics
    /// When there is no such lane.
    #[must_use]
    fn lane(self, k: usize) -> f64;
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for f64 {}
    impl Sealed for hamel_runtime::F64x4 {}
    impl Sealed for hamel_runtime::F64x8 {}
}

impl Lanes for f64 {
    const LANES: usize = 1;

    fn gather(mut lane: impl FnMut(usize) -> f64) -> Self {
        lane(0)
    }

    fn lane(self, k: usize) -> f64 {
        [self][k]
    }
}

macro_rules! lanes {
    ($($name:ident)*) => {$(
        impl Lanes for $name {
            const LANES: usize = $name::LANES;

            fn gather(lane: impl FnMut(usize) -> f64) -> Self {
                $name::new(std::array::from_fn(lane))
            }

            fn lane(self, k: usize) -> f64 {
                $name::lane(self, k)
            }
        }
    )*};
}

lanes! { F64x4 F64x8 }
