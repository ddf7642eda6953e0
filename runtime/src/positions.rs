//! Coordinates that equations give: initial values that satisfy the equations.
//!
//! The module deliberately does not know what the coordinates are, or how a motion keeps the equations
//! ([`Projected::onto_positions`](crate::Projected::onto_positions)).

use crate::directions::Directions;
use crate::error::Error;
use crate::options::signed;
use crate::real::Real;
use crate::system::{StateVector, System};

/// Most steps of Newton's method.
const MAX_ROUNDS: usize = 60;
/// Least part of a step that is tried.
const LEAST_PART: f64 = 1e-6;
/// Residual, by the size of its terms, up to which an equation is met, and slope up to which it has none, in units of
/// round-off.
const MET: f64 = 4.5e3;
/// Residual, by the size of its terms, below which an end that does not meet its equation is a singular position and no
/// distance that cannot be bridged.
const TOUCHED: f64 = 1e-9;

/// Equations between the coordinates of a system, as generated code has them for a scene that wants `positions`.
///
/// ```text
/// f_k(t, y) = 0 for k < n_equations,    f_k(t, y) = const for the others
/// ```
///
/// What follows the equations is what the coordinates in them keep: `c^2 + s^2` of an angle that is carried as a point
/// of the circle, the square of an advected vector.
pub trait Positions<R: Real, const K: usize>: System<R> {
    /// How many of the functions have to vanish: the first ones.
    fn n_equations(&self) -> usize;

    /// The components of the state that the equations give; where nothing says which these are, all in the equations.
    fn moved(&self) -> &[usize];

    /// The values of the functions.
    fn residuals(&self, t: R, y: &Self::State) -> [R; K];

    /// Writes the derivatives of function `k` by the components of the state to `gradients[k]`, every component.
    fn residual_gradients(&self, t: R, y: &Self::State, gradients: &mut [Self::State; K]);

    /// What the functions are kept at for a motion through a state.
    #[inline]
    fn levels(&self, t: R, y: &Self::State) -> [R; K] {
        let mut levels = self.residuals(t, y);
        levels.iter_mut().take(self.n_equations()).for_each(|level| *level = R::ZERO);
        levels
    }
}

impl<R: Real, const K: usize, S: Positions<R, K> + ?Sized> Positions<R, K> for &S {
    #[inline]
    fn n_equations(&self) -> usize {
        (**self).n_equations()
    }

    #[inline]
    fn moved(&self) -> &[usize] {
        (**self).moved()
    }

    #[inline]
    fn residuals(&self, t: R, y: &Self::State) -> [R; K] {
        (**self).residuals(t, y)
    }

    #[inline]
    fn residual_gradients(&self, t: R, y: &Self::State, gradients: &mut [Self::State; K]) {
        (**self).residual_gradients(t, y, gradients);
    }
}

/// Moves the coordinates that equations give until they satisfy these: Newton's method from `y`, which so chooses the
/// branch.
///
/// ```text
/// d = -J^T (J J^T)^-1 f,    y <- y + d/2^k    with the least k >= 0 that brings f down
/// ```
///
/// with the derivatives `J` of the residuals by the components that [`Positions::moved`] names, so that with more of
/// them than equations the change is the least. Ends with residuals that are rounding.
///
/// ```
/// use hamel_runtime::{Positions, System, consistent};
///
/// /// The angle `phi` of the rod of a slider-crank by that of the crank: `0.3 sin(theta) + 0.9 sin(phi) = 0`.
/// struct SliderCrank;
///
/// impl System<f64> for SliderCrank {
///     type State = [f64; 2];
///
///     fn rhs(&self, _t: f64, [theta, phi]: &[f64; 2], dy: &mut [f64; 2]) {
///         *dy = [1.0, -theta.cos() / (3.0 * phi.cos())];
///     }
/// }
///
/// // As generated code has it.
/// impl Positions<f64, 1> for SliderCrank {
///     fn n_equations(&self) -> usize {
///         1
///     }
///
///     fn moved(&self) -> &[usize] {
///         &[1]
///     }
///
///     fn residuals(&self, _t: f64, [theta, phi]: &[f64; 2]) -> [f64; 1] {
///         [0.3 * theta.sin() + 0.9 * phi.sin()]
///     }
///
///     fn residual_gradients(&self, _t: f64, [theta, phi]: &[f64; 2], gradients: &mut [[f64; 2]; 1]) {
///         *gradients = [[0.3 * theta.cos(), 0.9 * phi.cos()]];
///     }
/// }
///
/// let mut y = [0.4, 0.0];
/// consistent(&SliderCrank, 0.0, &mut y)?;
/// assert!((y[1] + (0.4_f64.sin() / 3.0).asin()).abs() < 1e-15);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
///
/// # Errors
///
/// [`Error::PositionMissed`] and [`Error::PositionSingular`], with `y` as it was.
pub fn consistent<R: Real, const K: usize, S: Positions<R, K>>(
    system: &S,
    t: R,
    y: &mut S::State,
) -> Result<(), Error> {
    consistent_by(system, t, y, system.moved())
}

/// The same by moving the components at `free`: what is known of a state is left as it is.
///
/// # Errors
///
/// As [`consistent`].
pub fn consistent_by<R: Real, const K: usize, S: Positions<R, K>>(
    system: &S,
    t: R,
    y: &mut S::State,
    free: &[usize],
) -> Result<(), Error> {
    let levels = system.levels(t, y);
    let defects_at = |y: &S::State| -> [R; K] {
        let values = system.residuals(t, y);
        core::array::from_fn(|k| levels[k] - values[k])
    };
    let mut point = y.clone();
    let mut defects = defects_at(&point);
    let mut directions = Directions::new(y);
    let (mut has_moved, mut is_met) = (false, false);
    // Sizes of the terms of each function.
    let mut sizes = [0.0_f64; K];
    for _ in 0..MAX_ROUNDS {
        system.residual_gradients(t, &point, &mut directions.gradients);
        for (gradient, size) in directions.gradients.iter_mut().zip(&mut sizes) {
            let mut free_size = 0.0;
            *size = 0.0;
            for (c, (slope, y)) in gradient.as_mut_slice().iter_mut().zip(point.as_slice()).enumerate() {
                let own = slope.magnitude() * y.magnitude().max(1.0);
                *size += own;
                if free.contains(&c) {
                    free_size += own;
                } else {
                    *slope = R::ZERO;
                }
            }
            // What is left of a slope that vanishes is no direction.
            if free_size <= MET * R::EPSILON * *size {
                gradient.as_mut_slice().fill(R::ZERO);
            }
        }
        is_met = is_within(&defects, &sizes, MET * R::EPSILON);
        let factors = directions.orthogonalise(|_| true).factors(&defects);
        let mut part = 1.0;
        let better = loop {
            let mut moved = point.clone();
            for &c in free {
                if let Some(y) = moved.as_mut_slice().get_mut(c) {
                    *y += R::from_f64(part) * directions.change(&factors, c);
                }
            }
            let found = defects_at(&moved);
            if largest(&found).1 < largest(&defects).1 {
                break Some((moved, found));
            }
            part /= 2.0;
            // Rounding ends the progress.
            if is_met || part < LEAST_PART {
                break None;
            }
        };
        let Some((moved, found)) = better else { break };
        (point, defects, has_moved) = (moved, found, true);
    }
    if is_met {
        *y = point;
        return Ok(());
    }
    let (index, residual) = largest(&defects);
    let t = signed(t);
    // What no step changes, and what is a double zero.
    if !has_moved || is_within(&defects, &sizes, TOUCHED) {
        return Err(Error::PositionSingular { t, index, residual });
    }
    Err(Error::PositionMissed { t, index, residual })
}

/// Whether every defect is at most a part of the size of its terms.
fn is_within<R: Real, const K: usize>(defects: &[R; K], sizes: &[f64; K], part: f64) -> bool {
    defects.iter().zip(sizes).all(|(defect, size)| defect.magnitude() <= part * size)
}

/// The largest defect and where it is; infinite where one is not a number.
fn largest<R: Real, const K: usize>(defects: &[R; K]) -> (usize, f64) {
    let sizes =
        defects.iter().map(|defect| if defect.all_finite() { defect.magnitude() } else { f64::INFINITY });
    sizes.enumerate().fold((0, 0.0), |(at, most), (k, size)| if size > most { (k, size) } else { (at, most) })
}

#[cfg(test)]
mod tests {
    use super::{Positions, consistent, consistent_by};
    use crate::error::Error;
    use crate::system::System;

    /// `x^2 + y^2 = 1`, which gives `y`, and `z = x y`, which gives `z`.
    struct Curve;

    impl System<f64> for Curve {
        type State = [f64; 3];

        fn rhs(&self, _t: f64, _y: &[f64; 3], dy: &mut [f64; 3]) {
            *dy = [0.0; 3];
        }
    }

    impl Positions<f64, 2> for Curve {
        fn n_equations(&self) -> usize {
            2
        }

        fn moved(&self) -> &[usize] {
            &[1, 2]
        }

        fn residuals(&self, _t: f64, [x, y, z]: &[f64; 3]) -> [f64; 2] {
            [x * x + y * y - 1.0, z - x * y]
        }

        fn residual_gradients(&self, _t: f64, [x, y, _]: &[f64; 3], gradients: &mut [[f64; 3]; 2]) {
            *gradients = [[2.0 * x, 2.0 * y, 0.0], [-y, -x, 1.0]];
        }
    }

    #[test]
    fn coordinates_meet_their_equations() {
        let mut y = [0.6, 0.5, 0.0];
        consistent(&Curve, 0.0, &mut y).unwrap();
        assert!((y[1] - 0.8).abs() < 1e-15 && (y[2] - 0.48).abs() < 1e-15, "{y:?}");
        assert_eq!(y[0], 0.6);
        // The other branch.
        let mut y = [0.6, -0.1, 0.0];
        consistent(&Curve, 0.0, &mut y).unwrap();
        assert!((y[1] + 0.8).abs() < 1e-15 && (y[2] + 0.48).abs() < 1e-15, "{y:?}");
        // What is known stays.
        let mut y = [0.1, 0.8, 0.0];
        consistent_by(&Curve, 0.0, &mut y, &[0, 2]).unwrap();
        assert!((y[0] - 0.6).abs() < 1e-15 && y[1] == 0.8, "{y:?}");
    }

    #[test]
    fn what_cannot_be_met_says_by_how_much_and_leaves_the_state() {
        let mut y = [2.0, 0.3, 0.0];
        let Err(Error::PositionMissed { index: 0, residual, .. }) = consistent(&Curve, 0.0, &mut y) else {
            panic!("{y:?}");
        };
        assert!((residual - 3.0).abs() < 1e-6, "{residual}");
        assert_eq!(y, [2.0, 0.3, 0.0]);
    }

    #[test]
    fn a_singular_position_is_told() {
        // No slope to go along.
        let mut y = [0.5, 0.0, 0.0];
        let found = consistent(&Curve, 0.0, &mut y);
        let expected = Error::PositionSingular { t: 0.0, index: 0, residual: 0.75 };
        assert_eq!(found, Err(expected));
        // Where the two branches meet.
        let mut y = [1.0, 0.3, 0.0];
        match consistent(&Curve, 0.0, &mut y) {
            Ok(()) => assert!(y[1].abs() < 1e-7, "{y:?}"),
            Err(error) => assert!(matches!(error, Error::PositionSingular { .. }), "{error}"),
        }
    }
}
