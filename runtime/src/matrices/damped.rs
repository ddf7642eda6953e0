//! Friction and constant forces beside the motion of an ideal fluid, by steps of Strang's splitting whose parts are
//! exact for the one and isospectral for the other.
//!
//! Does not know: surfaces, how the ideal fluid is moved.

use super::midpoint::IsospectralMidpoint;
use super::panels::{LANES, Row, add, n_rows};
use super::{Laplacian, MatrixMut, MatrixRef};
use crate::error::Error;
use crate::math::{exp, mul_add, sinh};

/// Highest power of the Laplacian in a friction.
const MAX_POWER: usize = 4;

/// A friction that is a polynomial of minus the Laplacian, with the eigenvalue `lambda` of a mode (`|m|^2` on the
/// torus, `l (l + 1)` on the sphere):
///
/// ```text
/// omega' = .. - d(lambda) omega,   d = sum over k of c_k lambda^k
/// ```
///
/// `c_0` is that of a bottom (Ekman, Rayleigh), `c_1` the viscosity, the others are hyperviscosities. On the sphere
/// `c_0 = -2 c_1` is a viscosity that keeps the angular momentum.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Friction {
    coefficients: [f64; 1 + MAX_POWER],
}

impl Friction {
    /// No friction.
    #[must_use]
    pub const fn none() -> Self {
        Self { coefficients: [0.0; 1 + MAX_POWER] }
    }

    /// Sets the coefficient of the power `k` of minus the Laplacian, from 0 to 4.
    ///
    /// # Panics
    ///
    /// Where `k` is larger.
    #[must_use]
    pub const fn with(mut self, k: usize, coefficient: f64) -> Self {
        self.coefficients[k] = coefficient;
        self
    }

    /// The rate `d` of a mode.
    #[must_use]
    pub fn rate(&self, eigenvalue: f64) -> f64 {
        self.coefficients.iter().rev().fold(0.0, |sum, c| mul_add(sum, eigenvalue, *c))
    }
}

/// A fluid with friction and a constant force:
///
/// ```text
/// W' = i kappa [P, W] - d(-Delta) W + F
/// ```
///
/// A step is half a step of friction and force alone, whose solution is known, a step of the ideal fluid, and the other
/// half: of order 2, symmetric. Without the ideal motion every mode decays exactly as it should, however long the step.
/// Both act on the vorticity; fields that the flow carries are moved by the ideal fluid alone.
/// Casimirs and energy change by friction and force alone.
///
/// # Source
///
/// Strang, On the construction and comparison of difference schemes (1968); Modin and Viviani, A Casimir preserving
/// scheme for long-time simulation of spherical ideal hydrodynamics (2020).
#[derive(Debug)]
pub struct Damped<'s, L, S> {
    fluid: IsospectralMidpoint<'s, L, S>,
    friction: Friction,
    storage: S,
    /// The half step that factors and impulse belong to, from the first step on.
    prepared: Option<f64>,
}

/// The matrices of a solver.
struct Matrices<'a> {
    /// `F`.
    force: &'a mut [Row],
    /// What the force adds in half a step.
    impulse: &'a mut [Row],
    /// `W` before a step.
    before: &'a mut [Row],
    work: &'a mut [Row],
    /// What modes are multiplied by in half a step.
    factors: &'a mut [f64],
}

impl<'a> Matrices<'a> {
    fn new(n: usize, n_work: usize, storage: &'a mut [f64]) -> Self {
        let size = n_rows(n, n);
        let (rows, factors) = storage.split_at_mut(2 * LANES * (3 * size + n_work));
        let rows = rows.as_chunks_mut().0;
        let (force, rows) = rows.split_at_mut(size);
        let (impulse, rows) = rows.split_at_mut(size);
        let (before, work) = rows.split_at_mut(size);
        Self { force, impulse, before, work, factors }
    }
}

impl<'s, L: Laplacian, S: AsRef<[f64]> + AsMut<[f64]>> Damped<'s, L, S> {
    /// Numbers that a solver takes in addition to the ideal fluid's.
    #[must_use]
    pub fn storage(n: usize) -> usize {
        2 * LANES * (3 * n_rows(n, n) + L::n_filter_work(n)) + L::n_factors(n)
    }

    /// Adds a friction to the motion of a fluid, and no force; `storage` has room for [`storage`](Self::storage)
    /// numbers.
    ///
    /// # Errors
    ///
    /// [`Error::Number`] for a coefficient that is not finite; [`Error::Storage`].
    pub fn new(
        fluid: IsospectralMidpoint<'s, L, S>,
        friction: Friction,
        mut storage: S,
    ) -> Result<Self, Error> {
        if let Some(value) = friction.coefficients.into_iter().find(|c| !c.is_finite()) {
            return Err(Error::Number { value, needs: "coefficient of a friction: that is finite" });
        }
        let (given, needed) = (storage.as_ref().len(), Self::storage(fluid.surface().n()));
        match storage.as_mut().get_mut(..needed) {
            Some(numbers) => numbers.fill(0.0),
            None => return Err(Error::Storage { given, needed }),
        }
        Ok(Self { fluid, friction, storage, prepared: None })
    }

    /// The fluid.
    #[must_use]
    pub const fn fluid(&self) -> &IsospectralMidpoint<'s, L, S> {
        &self.fluid
    }

    /// The fluid, to write its vorticity and its background, and to ask for energy, Casimirs and stream function.
    pub const fn fluid_mut(&mut self) -> &mut IsospectralMidpoint<'s, L, S> {
        &mut self.fluid
    }

    /// The force to write: what it adds to the vorticity in a unit of time.
    pub fn force_mut(&mut self) -> MatrixMut<'_> {
        self.prepared = None;
        let n = self.fluid.surface().n();
        MatrixMut { n, rows: self.matrices().force }
    }

    /// Computes the derivative of the vorticity, with friction and force.
    pub fn derivative(&mut self) -> MatrixRef<'_> {
        self.prepared = None;
        let (surface, friction) = (self.fluid.surface(), self.friction);
        let n = surface.n();
        let needed = Self::storage(n);
        let m = Matrices::new(n, L::n_filter_work(n), &mut self.storage.as_mut()[..needed]);
        m.before.copy_from_slice(self.fluid.vorticity().rows);
        surface.write_factors(&mut |eigenvalue| -friction.rate(eigenvalue), m.factors);
        surface.filter(m.factors, m.before, m.work);
        add(m.before, m.force);
        add(m.before, self.fluid.derivative().rows);
        MatrixRef { n, rows: m.before }
    }

    /// Takes a step of the size of the options, forwards in time.
    ///
    /// # Errors
    ///
    /// As [`IsospectralMidpoint::step`]. The vorticity before is kept.
    pub fn step(&mut self) -> Result<(), Error> {
        self.step_by(self.fluid.options().step)
    }

    /// Takes steps, forwards or backwards, until the time is exactly `t_end`; the last one is shortened.
    ///
    /// # Errors
    ///
    /// [`Error::TimeNotFinite`] for `t_end`, and the errors of [`step`](Self::step).
    pub fn integrate_to(&mut self, t_end: f64) -> Result<(), Error> {
        while let Some((h, is_last)) = self.fluid.step_towards(t_end)? {
            self.step_by(h)?;
            if is_last {
                self.fluid.set_clock((t_end, 0.0));
            }
        }
        Ok(())
    }

    fn matrices(&mut self) -> Matrices<'_> {
        let n = self.fluid.surface().n();
        Matrices::new(n, L::n_filter_work(n), &mut self.storage.as_mut()[..Self::storage(n)])
    }

    fn step_by(&mut self, h: f64) -> Result<(), Error> {
        let (surface, friction, half) = (self.fluid.surface(), self.friction, 0.5 * h);
        let is_prepared = self.prepared == Some(half);
        let n = surface.n();
        let needed = Self::storage(n);
        let m = Matrices::new(n, L::n_filter_work(n), &mut self.storage.as_mut()[..needed]);
        if !is_prepared {
            m.impulse.copy_from_slice(m.force);
            surface.write_factors(&mut |eigenvalue| impulse(friction.rate(eigenvalue), half), m.factors);
            surface.filter(m.factors, m.impulse, m.work);
            surface.write_factors(&mut |eigenvalue| exp(-friction.rate(eigenvalue) * half), m.factors);
            self.prepared = Some(half);
        }
        m.before.copy_from_slice(self.fluid.vorticity().rows);
        let mut relax = |vorticity: &mut [Row]| {
            surface.filter(m.factors, vorticity, m.work);
            add(vorticity, m.impulse);
        };
        let start = self.fluid.clock();
        self.fluid.change_vorticity(&mut relax);
        let mut outcome = self.fluid.step_by(h);
        if outcome.is_ok() {
            self.fluid.change_vorticity(relax);
            // A friction that is negative makes modes grow.
            outcome = self.fluid.finite();
            if outcome.is_err() {
                self.fluid.restore_carried();
            }
        }
        if outcome.is_err() {
            self.fluid.change_vorticity(|vorticity| vorticity.copy_from_slice(m.before));
            self.fluid.set_clock(start);
        }
        outcome
    }
}

/// `(1 - exp(-d h))/d`: what a unit force adds to a mode with the rate `d` in the time `h`.
fn impulse(d: f64, h: f64) -> f64 {
    let z = 0.5 * d * h;
    if z.abs() > 1.0 {
        // The sine would overflow, and there is nothing to cancel.
        return (1.0 - exp(-2.0 * z)) / d;
    }
    // sinh(z)/z is one to round-off below.
    let by_length = if z.abs() < 1e-8 { 1.0 } else { sinh(z) / z };
    h * exp(-z) * by_length
}
