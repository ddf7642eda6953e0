//! Derivatives along a motion: a system together with its linearisation, and Lyapunov exponents.
//!
//! The module deliberately does not know where a system over dual numbers comes from.

use core::marker::PhantomData;

use crate::dual::Dual;
use crate::error::{Error, Failure};
use crate::integrator::Integrator;
use crate::methods::Method;
use crate::options::{Options, signed};
use crate::real::Real;
use crate::system::{Pivot, StateVector, System};

/// A system with the derivatives of its motion along directions of initial state and parameters:
///
/// ```text
/// y' = f(t, y; p),    s_k' = (df/dy) s_k + (df/dp) q_k        k = 1, .., K
/// ```
///
/// Each direction has the system over dual numbers, whose parameters have the derivatives `q_k`: generated scenes are
/// prepared with such parameters. Derivatives are exact but for rounding, no step being taken, and no scene has to be
/// generated with its Jacobian; each direction costs a right-hand side of dual numbers. The
/// tolerances of an integration hold for the derivatives as for the state.
///
/// # Shapes
///
/// The state `V` has `n (K + 1)` components, `n` being the dimension of the system: first `y`, then `s_1`, .., `s_K`.
///
/// ```
/// use hamel_runtime::{Dual, Integrator, Options, Real, System, Variational, Vern9};
///
/// struct Oscillator<R> {
///     omega: R,
/// }
///
/// impl<R: Real> System<R> for Oscillator<R> {
///     type State = [R; 2];
///     fn rhs(&self, _t: R, y: &[R; 2], dy: &mut [R; 2]) {
///         *dy = [y[1], -(self.omega * self.omega * y[0])];
///     }
/// }
///
/// // The derivatives by the frequency and by the initial velocity, of the motion x = cos(2 t).
/// let systems = [Dual::variable(2.0), Dual::constant(2.0)].map(|omega| Oscillator { omega });
/// let variational = Variational::<_, _, [f64; 6]>::new(&systems, [Dual::ZERO; 2]);
/// let start = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
/// let mut solver = Integrator::new(&variational, Vern9, 0.0, start, Options::adaptive(1e-12, 1e-12))?;
/// solver.integrate_to(3.0)?;
/// let end = solver.state();
/// assert!((variational.tangent(end, 0)[0] + 3.0 * 6.0_f64.sin()).abs() < 1e-10);
/// assert!((variational.tangent(end, 1)[0] - 6.0_f64.sin() / 2.0).abs() < 1e-10);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
///
/// # Source
///
/// Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I (1993), section I.14.
#[derive(Clone, Debug)]
pub struct Variational<'s, R: Real, T: System<Dual<R>>, V> {
    systems: &'s [T],
    zeros: T::State,
    state: PhantomData<fn() -> (R, V)>,
}

impl<'s, R: Real, T: System<Dual<R>>, V: StateVector<R>> Variational<'s, R, T, V> {
    /// The system over dual numbers once for each direction, and its state of zeros.
    ///
    /// # Panics
    ///
    /// Without a direction.
    #[must_use]
    pub fn new(systems: &'s [T], zeros: T::State) -> Self {
        assert!(!systems.is_empty(), "the derivatives of a motion are along at least one direction");
        Self { systems, zeros, state: PhantomData }
    }

    /// Dimension of the system, without derivatives.
    #[must_use]
    pub fn n(&self) -> usize {
        self.zeros.as_slice().len()
    }

    /// Number of directions.
    #[must_use]
    pub fn n_directions(&self) -> usize {
        self.systems.len()
    }

    /// The derivative along a direction, counted from zero, in a state.
    ///
    /// # Panics
    ///
    /// If there is no such direction.
    #[must_use]
    pub fn tangent<'z>(&self, z: &'z V, direction: usize) -> &'z [R] {
        let n = self.n();
        &z.as_slice()[(direction + 1) * n..][..n]
    }

    /// The state of the system over dual numbers with the derivative along a direction.
    fn dual(&self, z: &V, direction: usize) -> T::State {
        let mut y = self.zeros.clone();
        let values = z.as_slice().iter().zip(self.tangent(z, direction));
        for (y, (value, derivative)) in y.as_mut_slice().iter_mut().zip(values) {
            *y = Dual::new(*value, *derivative);
        }
        y
    }
}

impl<R: Real, T: System<Dual<R>>, V: StateVector<R>> System<R> for Variational<'_, R, T, V> {
    type State = V;

    fn rhs(&self, t: R, z: &V, dz: &mut V) {
        let n = self.n();
        let mut dy = self.zeros.clone();
        for (k, system) in self.systems.iter().enumerate() {
            system.rhs(Dual::constant(t), &self.dual(z, k), &mut dy);
            let (values, tangents) = dz.as_mut_slice().split_at_mut(n);
            let pairs = values.iter_mut().zip(&mut tangents[k * n..]);
            for ((value, derivative), dy) in pairs.zip(dy.as_slice()) {
                (*value, *derivative) = (dy.value, dy.derivative);
            }
        }
    }

    fn check(&self, t: R, z: &V) -> Result<(), Failure> {
        let t = Dual::constant(t);
        self.systems.iter().enumerate().try_for_each(|(k, system)| system.check(t, &self.dual(z, k)))
    }

    fn domain(&self, t: R, z: &V) -> Result<(), Failure> {
        self.systems[0].domain(Dual::constant(t), &self.dual(z, 0))
    }

    fn signature(&self, t: R, z: &V) -> R {
        self.systems[0].signature(Dual::constant(t), &self.dual(z, 0)).value
    }

    fn keeps_rank(&self, from: (R, &V), to: (R, &V)) -> bool {
        let [(t0, from), (t1, to)] = [from, to].map(|(t, z)| (Dual::constant(t), self.dual(z, 0)));
        self.systems[0].keeps_rank((t0, &from), (t1, &to))
    }

    fn pivots(&self, t: R, z: &V, visit: &mut dyn FnMut(Pivot<R>)) {
        self.systems[0].pivots(Dual::constant(t), &self.dual(z, 0), &mut |Pivot { name, value, scale }| {
            visit(Pivot { name, value: value.value, scale: scale.value });
        });
    }
}

impl<R: Real, T: System<Dual<R>>, V: StateVector<R>> Variational<'_, R, T, V> {
    /// The mean rates at which the derivatives along the directions grow over `n_intervals` times `interval`, from `z`
    /// at `t`, which become those at the end: Lyapunov exponents, the largest first, where time is long.
    ///
    /// After each interval the derivatives are made orthonormal (Gram and Schmidt, twice), so that each direction sees
    /// what the ones before it do not: an interval is to be so short that they do not become parallel within it, `e` to
    /// the difference of the extreme exponents times the interval small against 1e16. What moves on its way to an
    /// attractor is not to be averaged: call it once for that, and again from where it ends.
    ///
    /// # Shapes
    ///
    /// exponents: one per direction.
    ///
    /// # Errors
    ///
    /// [`Error::StepSize`] for an interval that is zero or not finite; [`Error::Failure`] where derivatives are
    /// linearly dependent; those of [`Integrator`]. The exponents are of no use then, `t` and `z` are those at the end
    /// of the last whole interval.
    ///
    /// # Panics
    ///
    /// If there are fewer exponents than directions, or no intervals.
    ///
    /// # Source
    ///
    /// Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980), 9-20 and 21-30.
    pub fn lyapunov_exponents<M: Method<R, Self>>(
        &self,
        method: M,
        (t, z): (&mut R, &mut V),
        options: Options<R>,
        (interval, n_intervals): (R, usize),
        exponents: &mut [R],
    ) -> Result<(), Error> {
        assert!(n_intervals > 0, "growth is over at least one interval");
        if !(interval.all_finite() && interval.all_ne(R::ZERO)) {
            return Err(Error::StepSize { value: signed(interval) });
        }
        let exponents = &mut exponents[..self.n_directions()];
        exponents.fill(R::ZERO);
        let start = *t;
        for k in 1..=n_intervals {
            let mut next = z.clone();
            self.orthonormalise(*t, &mut next, |_, _| ())?;
            let mut solver = Integrator::new(self, method, *t, next, options)?;
            let end = R::from_f64(k as f64).mul_add(interval, start);
            solver.integrate_to(end)?;
            let mut next = solver.state().clone();
            self.orthonormalise(end, &mut next, |k, growth| exponents[k] += growth)?;
            (*t, *z) = (end, next);
        }
        let time = *t - start;
        exponents.iter_mut().for_each(|exponent| *exponent /= time);
        Ok(())
    }

    /// Makes the derivatives orthonormal, and tells the logarithm of the length of what of each is new.
    fn orthonormalise(&self, t: R, z: &mut V, mut tell: impl FnMut(usize, R)) -> Result<(), Error> {
        let n = self.n();
        let z = &mut z.as_mut_slice()[n..];
        let dot = |a: &[R], b: &[R]| a.iter().zip(b).fold(R::ZERO, |sum, (x, y)| x.mul_add(*y, sum));
        for k in 0..self.n_directions() {
            let (before, own) = z.split_at_mut(k * n);
            let own = &mut own[..n];
            for _ in 0..2 {
                for unit in before.chunks_exact(n) {
                    let along = dot(unit, own);
                    own.iter_mut().zip(unit).for_each(|(x, e)| *x -= along * *e);
                }
            }
            let length = dot(own, own).sqrt();
            if !(length.all_gt(R::ZERO) && length.recip().all_finite()) {
                return Err(Failure::NonFinite { t: signed(t), index: (k + 1) * n }.into());
            }
            own.iter_mut().for_each(|x| *x /= length);
            tell(k, length.ln());
        }
        Ok(())
    }
}
