//! Steps by discrete equations of motion, and symmetric compositions of them.
//!
//! The module deliberately does not know which principle the equations follow from.

use super::elimination::solve;
use super::iteration::{Change, iterate, not_converged};
use super::{Constant, Estimate, Method, Step, Tableau, c};
use crate::error::Error;
use crate::options::Options;
use crate::real::Real;
use crate::system::{SquareStorage, StateVector, System};

/// A system that also has discrete equations of motion: rows `f(t, h, y, z)` that vanish for the unknowns `z` of a step
/// from `y`, among which are all components of the state at its end.
///
/// Generated for scenes with `discrete midpoint`: the reduced discrete equations of Hamilton's principle, or of that of
/// Lagrange and d'Alembert, whose steps keep momenta along symmetries.
pub trait Discrete<R: Real>: System<R> {
    /// Storage of the unknowns.
    type Unknowns: SquareStorage<R>;

    /// Zeros, as many as there are unknowns.
    fn discrete_unknowns(&self) -> Self::Unknowns;

    /// Writes the unknowns of a step of no length from a state, every component: first values for any step.
    fn discrete_start(&self, t: R, h: R, y: &Self::State, z: &mut Self::Unknowns);

    /// Writes the rows, one for each unknown.
    fn discrete_residual(
        &self,
        t: R,
        h: R,
        y: &Self::State,
        z: &Self::Unknowns,
        residual: &mut Self::Unknowns,
    );

    /// Writes the derivatives of row `i` by the unknowns to row `i` of `jacobian`, every component.
    ///
    /// # Shapes
    ///
    /// jacobian: as many rows as there are unknowns.
    fn discrete_jacobian(
        &self,
        t: R,
        h: R,
        y: &Self::State,
        z: &Self::Unknowns,
        jacobian: &mut [Self::Unknowns],
    );

    /// Writes the state at the end of the step to `y`, every component.
    fn discrete_end(&self, z: &Self::Unknowns, y: &mut Self::State);
}

impl<R: Real, S: Discrete<R>> Discrete<R> for &S {
    type Unknowns = S::Unknowns;

    #[inline]
    fn discrete_unknowns(&self) -> Self::Unknowns {
        (**self).discrete_unknowns()
    }

    #[inline]
    fn discrete_start(&self, t: R, h: R, y: &Self::State, z: &mut Self::Unknowns) {
        (**self).discrete_start(t, h, y, z);
    }

    #[inline]
    fn discrete_residual(
        &self,
        t: R,
        h: R,
        y: &Self::State,
        z: &Self::Unknowns,
        residual: &mut Self::Unknowns,
    ) {
        (**self).discrete_residual(t, h, y, z, residual);
    }

    #[inline]
    fn discrete_jacobian(
        &self,
        t: R,
        h: R,
        y: &Self::State,
        z: &Self::Unknowns,
        jacobian: &mut [Self::Unknowns],
    ) {
        (**self).discrete_jacobian(t, h, y, z, jacobian);
    }

    #[inline]
    fn discrete_end(&self, z: &Self::Unknowns, y: &mut Self::State) {
        (**self).discrete_end(z, y);
    }
}

/// Steps by the discrete equations of a system, composed to order `ORDER`, for fixed steps: [`Discrete2`],
/// [`Discrete4`], [`Discrete6`].
///
/// ```text
/// f(t, h, y_0, z) = 0,   y_1 = y(z)                    step(h), symmetric: step(-h) leads back
/// step(c_1 h) o .. o step(c_s h),   c_s+1-i = c_i      of order 4 with s = 5, of order 6 with s = 9
/// ```
///
/// Newton's iteration with the exact Jacobian goes on until round-off stops it. What every step keeps, the composition
/// keeps: of discrete Hamilton equations the momenta of symmetries, Casimirs and the symplectic structure, hence a
/// nearby energy. There is no error estimate. The state within a step is the end of a shorter step.
///
/// # Errors
///
/// [`Error::NotConverged`] where the iteration does not end: the step is too long for the motion.
///
/// # Source
///
/// Bou-Rabee and Marsden, Hamilton-Pontryagin integrators on Lie groups, part I (2009), for the equations; Suzuki,
/// Fractal decomposition of exponential operators (1990), and Kahan and Li, Composition constants for raising the
/// orders of unconventional schemes (1997), for the compositions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DiscreteSteps<const ORDER: u32>;

/// One step of the discrete equations, of order 2.
pub type Discrete2 = DiscreteSteps<2>;
/// Suzuki's composition of five steps, of order 4.
pub type Discrete4 = DiscreteSteps<4>;
/// The composition of nine steps by Kahan and Li, of order 6.
pub type Discrete6 = DiscreteSteps<6>;

impl<const ORDER: u32> DiscreteSteps<ORDER> {
    /// The coefficients `c_i`.
    const COEFFICIENTS: &'static [Constant] = {
        // 1/(4 - 4^(1/3)), and 1 less four of them.
        const S: Constant = c(0.414_490_771_794_375_7, 2.519_737_415_085_597_7e-17);
        const M: Constant = c(-0.657_963_087_177_503, 1.023_280_585_909_174e-17);
        const K: [Constant; 5] = [
            c(0.392_161_444_007_314_1, 1.982_609_470_601_07e-17),
            c(0.332_599_136_789_359_43, 9.998_816_861_580_819e-18),
            c(-0.706_246_172_557_639_3, -3.081_725_796_915_952_5e-17),
            c(0.082_213_596_293_550_8, 5.551_218_884_915_305e-18),
            c(0.798_543_990_934_83, -9.117_744_956_694_601e-18),
        ];
        match ORDER {
            2 => &[c(1.0, 0.0)],
            4 => &[S, S, M, S, S],
            6 => &[K[0], K[1], K[2], K[3], K[4], K[3], K[2], K[1], K[0]],
            _ => panic!("compositions have order 2, 4 or 6"),
        }
    };

    const NAMED: Tableau = Tableau {
        name: match ORDER {
            2 => "discrete",
            4 => "discrete4",
            _ => "discrete6",
        },
        order: ORDER,
        nodes: &[],
        stages: &[],
        weights: &[],
        estimate: Estimate::None,
        dense_nodes: &[],
        dense_stages: &[],
        dense: &[],
    };

    /// The method.
    #[must_use]
    pub const fn new() -> Self {
        Self
    }
}

/// What the method keeps: unknowns, rows and their derivatives, and a state between two steps.
#[derive(Clone, Debug)]
pub struct DiscreteStorage<R: Real, V, Z: SquareStorage<R>> {
    unknowns: Z,
    residual: Z,
    jacobian: Z::Rows,
    between: V,
}

impl<const ORDER: u32, R: Real, S: Discrete<R>> Method<R, S> for DiscreteSteps<ORDER> {
    const TABLEAU: &'static Tableau = &Self::NAMED;

    const DENSE_BY_STEPS: bool = true;

    type Storage = DiscreteStorage<R, S::State, S::Unknowns>;

    fn storage(&self, system: &S, _t0: R, y0: &S::State, _options: &Options<R>) -> Self::Storage {
        let unknowns = system.discrete_unknowns();
        DiscreteStorage {
            residual: unknowns.zeros_like(),
            jacobian: unknowns.rows_like(),
            unknowns,
            between: y0.clone(),
        }
    }

    fn stages(_storage: &Self::Storage) -> &[S::State] {
        &[]
    }

    fn stages_mut(_storage: &mut Self::Storage) -> &mut [S::State] {
        &mut []
    }

    fn advance(&self, storage: &mut Self::Storage, step: &mut Step<'_, R, S>) -> Result<(), Error> {
        let DiscreteStorage { unknowns, residual, jacobian, between } = storage;
        let name = Self::NAMED.name;
        between.as_mut_slice().copy_from_slice(step.from.state.as_slice());
        let mut t = step.t;
        for coefficient in Self::COEFFICIENTS {
            let h = step.h * coefficient.get::<R>();
            let mut is_singular = false;
            step.system.discrete_start(t, h, between, unknowns);
            iterate(name, step, |step| {
                step.system.discrete_residual(t, h, between, unknowns, residual);
                step.system.discrete_jacobian(t, h, between, unknowns, jacobian.as_mut());
                *step.rhs_evals += 1;
                *step.jacobian_evals += 1;
                let n = residual.as_slice().len();
                if !solve(jacobian.as_mut(), residual.as_mut_slice(), n) {
                    is_singular = true;
                    return Change::default();
                }
                let mut change = Change::default();
                for (unknown, &correction) in unknowns.as_mut_slice().iter_mut().zip(residual.as_slice()) {
                    let before = *unknown;
                    *unknown -= correction;
                    // Rounding takes the rest away.
                    change.add(1.0, R::ZERO, *unknown, *unknown - before);
                }
                // Changes below a digit of the largest unknown can go on in one direction for long.
                if change.is_rounding::<R>() { Change::default() } else { change }
            })?;
            if is_singular {
                return Err(not_converged(name, step, 0));
            }
            step.system.discrete_end(unknowns, between);
            t += h;
        }
        step.to.state.as_mut_slice().copy_from_slice(between.as_slice());
        step.to.residue.as_mut_slice().fill(R::ZERO);
        Ok(())
    }
}
