//! Compositions of exact flows: explicit steps that keep whatever every one of these flows keeps.
//!
//! The module deliberately does not know which flows a system has, or what they keep.

use super::{Constant, Estimate, Method, Step, Tableau, c, two_sum};
use crate::error::Error;
use crate::options::Options;
use crate::real::Real;
use crate::system::{StateVector, System};

/// A system whose right-hand side is a sum of vector fields with flows in closed form.
///
/// ```text
/// f = f_0 + f_1 + .. ,   d/dtau Phi_k(tau, y) = f_k(Phi_k(tau, y)),   Phi_k(0, y) = y
/// ```
///
/// Generated for scenes that want `splitting`: Lie-Poisson systems whose Hamiltonian is a sum of functions of commuting
/// momenta, where each flow is a motion along coadjoint orbits and keeps all Casimirs.
pub trait ExactFlows<R: Real>: System<R> {
    /// Number of the flows.
    fn n_flows(&self) -> usize;

    /// Writes `Phi_index(tau, y) - y` to `increment`, every component; `index` is less than the number of flows.
    ///
    /// The difference, because its rounding errors are as small as it is: states are summed with compensation.
    fn flow(&self, index: usize, tau: R, y: &Self::State, increment: &mut Self::State);
}

impl<R: Real, S: ExactFlows<R> + ?Sized> ExactFlows<R> for &S {
    #[inline]
    fn n_flows(&self) -> usize {
        (**self).n_flows()
    }

    #[inline]
    fn flow(&self, index: usize, tau: R, y: &Self::State, increment: &mut Self::State) {
        (**self).flow(index, tau, y, increment);
    }
}

/// The composition of exact flows that is of order `ORDER`, for fixed steps: [`Splitting2`], [`Splitting4`],
/// [`Splitting6`].
///
/// ```text
/// chi(h)  = Phi_n-1(h) o .. o Phi_0(h),     chi*(h) = Phi_0(h) o .. o Phi_n-1(h)
/// step(h) = chi*(a_1 h) o chi(a_2 h) o .. o chi*(a_m-1 h) o chi(a_m h),   a_m+1-i = a_i
/// ```
///
/// Two flows of one kind that meet are one. Where two coefficients are one half this is Strang's splitting; with more
/// the coefficients are such that what a step lacks of the motion is `O(h^(ORDER+1))`.
///
/// A step is explicit, reversible, and keeps to rounding everything that all flows keep: of Lie-Poisson systems
/// Casimirs and the Poisson structure, hence a nearby energy over very long times. There is no error estimate: steps
/// that vary would lose the nearby energy. The state within a step is the end of a shorter step.
///
/// ```
/// use hamel_runtime::{ExactFlows, Integrator, Options, Splitting4, System};
///
/// struct Pendulum;
///
/// impl System<f64> for Pendulum {
///     type State = [f64; 2];
///     fn rhs(&self, _t: f64, [q, p]: &[f64; 2], dy: &mut [f64; 2]) {
///         *dy = [*p, -q.sin()];
///     }
/// }
///
/// impl ExactFlows<f64> for Pendulum {
///     fn n_flows(&self) -> usize {
///         2
///     }
///     fn flow(&self, index: usize, tau: f64, [q, p]: &[f64; 2], increment: &mut [f64; 2]) {
///         *increment = if index == 0 { [tau * p, 0.0] } else { [0.0, -tau * q.sin()] };
///     }
/// }
///
/// let energy = |[q, p]: [f64; 2]| 0.5 * p * p - q.cos();
/// let mut solver = Integrator::new(&Pendulum, Splitting4::new(), 0.0, [1.0, 0.5], Options::fixed(0.1))?;
/// solver.integrate_to(1000.0)?;
/// assert!((energy(*solver.state()) - energy([1.0, 0.5])).abs() < 1e-7);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
///
/// # Source
///
/// Strang, On the construction and comparison of difference schemes (1968); Blanes and Moan, Practical symplectic
/// partitioned Runge-Kutta and Runge-Kutta-Nystrom methods (2002), the methods `S6` of order 4 and `S10` of order 6,
/// as compositions of a method with its adjoint after McLachlan, On the numerical integration of ordinary differential
/// equations by symmetric composition methods (1995).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Splitting<const ORDER: u32>;

/// Strang's splitting, of order 2.
pub type Splitting2 = Splitting<2>;
/// The composition of twelve first-order steps by Blanes and Moan, of order 4.
pub type Splitting4 = Splitting<4>;
/// The composition of twenty first-order steps by Blanes and Moan, of order 6.
pub type Splitting6 = Splitting<6>;

impl<const ORDER: u32> Splitting<ORDER> {
    /// The first half of the coefficients `a_i`; the others are these backwards.
    pub(super) const COEFFICIENTS: &'static [Constant] = match ORDER {
        2 => &[c(0.5, 0.0)],
        4 => &[
            c(0.07920369643119567, -6.0866533576831746e-18),
            c(0.13031141018216638, -4.253764990766946e-18),
            c(0.22286149586760767, 2.0399097355344034e-18),
            c(-0.36671326904742574, 2.4404660556685794e-17),
            c(0.3246481886897062, -2.51431014557376e-18),
            c(0.10968847787674982, 2.8794600961814124e-19),
        ],
        6 => &[
            c(0.05026276440039259, 2.5382919882483302e-20),
            c(0.09855368350065051, 4.437684532664829e-18),
            c(0.31496061692769417, 2.521042883188073e-17),
            c(-0.44734648269547755, -5.8895979287191875e-19),
            c(0.4924263724898755, 1.4486452138734804e-17),
            c(-0.42511876779769087, -8.441575363268374e-18),
            c(0.23706391397812118, -7.993097629652436e-18),
            c(0.1956024886000521, 1.0488912462535069e-17),
            c(0.34635818985072836, -2.0741481134357146e-17),
            c(-0.36276277925434597, -2.382264086945527e-17),
        ],
        _ => panic!("splittings have order 2, 4 or 6"),
    };

    const NAMED: Tableau = Tableau {
        name: match ORDER {
            2 => "splitting2",
            4 => "splitting4",
            _ => "splitting6",
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

impl<const ORDER: u32, R: Real, S: ExactFlows<R>> Method<R, S> for Splitting<ORDER> {
    const TABLEAU: &'static Tableau = &Self::NAMED;

    const DENSE_BY_STEPS: bool = true;

    type Storage = ();

    fn storage(&self, _system: &S, _t0: R, _y0: &S::State, _options: &Options<R>) {}

    fn stages(_storage: &()) -> &[S::State] {
        &[]
    }

    fn stages_mut(_storage: &mut ()) -> &mut [S::State] {
        &mut []
    }

    fn advance(&self, _storage: &mut (), step: &mut Step<'_, R, S>) -> Result<(), Error> {
        let half = Self::COEFFICIENTS;
        let (system, n_flows) = (step.system, step.system.n_flows());
        step.to.state.as_mut_slice().copy_from_slice(step.from.state.as_slice());
        step.to.residue.as_mut_slice().copy_from_slice(step.from.residue.as_slice());
        // The flow that is to be applied next, and for how long: until another one comes, which it need not commute
        // with.
        let mut pending: Option<(usize, R)> = None;
        let (state, residue, work) = (&mut step.to.state, &mut step.to.residue, &mut *step.work);
        let mut apply = |index: usize, tau: R| {
            system.flow(index, tau, state, work);
            let sums = state.as_mut_slice().iter_mut().zip(residue.as_mut_slice());
            for ((state, residue), &increment) in sums.zip(work.as_slice()) {
                (*state, *residue) = two_sum(*state, increment + *residue);
            }
        };
        for (place, coefficient) in half.iter().chain(half.iter().rev()).enumerate() {
            let tau = step.h * coefficient.get::<R>();
            for turn in 0..n_flows {
                let index = if place % 2 == 0 { turn } else { n_flows - 1 - turn };
                pending = match pending {
                    Some((last, sum)) if last == index => Some((index, sum + tau)),
                    Some((last, sum)) => {
                        apply(last, sum);
                        Some((index, tau))
                    }
                    None => Some((index, tau)),
                };
            }
        }
        if let Some((last, sum)) = pending {
            apply(last, sum);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::collections::BTreeMap;
    use std::vec::Vec;

    use super::{ExactFlows, Splitting, Splitting2, Splitting4, Splitting6};
    use crate::double_double::DoubleDouble;
    use crate::integrator::Integrator;
    use crate::options::Options;
    use crate::real::Real;
    use crate::system::System;

    /// Words in the letters 0 and 1 with their coefficients: an element of the free algebra, cut off at a length.
    type Words = BTreeMap<Vec<u8>, DoubleDouble>;

    /// The product of `exp(coefficient letter)` in the order in which they stand, up to words of a length.
    fn product(factors: &[(u8, DoubleDouble)], length: usize) -> Words {
        let mut sum = Words::from([(Vec::new(), DoubleDouble::ONE)]);
        for &(letter, coefficient) in factors {
            let mut next = Words::new();
            for (word, value) in sum {
                let (mut word, mut value) = (word, value);
                let mut power = 1.0;
                loop {
                    let entry = next.entry(word.clone()).or_insert(DoubleDouble::ZERO);
                    *entry += value;
                    if word.len() == length {
                        break;
                    }
                    word.push(letter);
                    value = value * coefficient / DoubleDouble::from_f64(power);
                    power += 1.0;
                }
            }
            sum = next;
        }
        sum
    }

    /// The largest difference between a composition of two flows and the flow of their sum, `1/n!` for each word.
    fn defect<const ORDER: u32>(length: usize) -> f64 {
        let half = Splitting::<ORDER>::COEFFICIENTS;
        let mut factors = Vec::new();
        for (place, a) in half.iter().chain(half.iter().rev()).enumerate() {
            let a: DoubleDouble = a.get();
            factors.extend(if place % 2 == 0 { [(0, a), (1, a)] } else { [(1, a), (0, a)] });
        }
        let words = product(&factors, length);
        let mut defect = 0.0_f64;
        for n in 1..=length {
            let exact = (1..=n).fold(DoubleDouble::ONE, |e, k| e / DoubleDouble::from_f64(k as f64));
            for code in 0..1_usize << n {
                let word: Vec<u8> = (0..n).map(|k| u8::from(code >> k & 1 == 1)).collect();
                let value = words.get(&word).copied().unwrap_or(DoubleDouble::ZERO);
                defect = defect.max((value - exact).magnitude());
            }
        }
        defect
    }

    #[test]
    fn coefficients_satisfy_all_conditions_up_to_their_order_and_no_further() {
        // Rounding of coefficients to 32 digits, summed over up to twenty of them.
        let rounded = 1e-30;
        assert!(defect::<2>(2) < rounded && defect::<2>(3) > 1e-3);
        assert!(defect::<4>(4) < rounded && defect::<4>(5) > 1e-6);
        assert!(defect::<6>(6) < rounded && defect::<6>(7) > 1e-7);
    }

    /// Three flows that do not commute: shears of the plane, and a rotation.
    struct Shears;

    impl System<f64> for Shears {
        type State = [f64; 2];
        fn rhs(&self, _t: f64, [x, y]: &[f64; 2], dy: &mut [f64; 2]) {
            *dy = [y.sin() - y, -x.cos() + x];
        }
    }

    impl ExactFlows<f64> for Shears {
        fn n_flows(&self) -> usize {
            3
        }
        fn flow(&self, index: usize, tau: f64, [x, y]: &[f64; 2], increment: &mut [f64; 2]) {
            let (s, c) = tau.sin_cos();
            *increment = match index {
                0 => [tau * y.sin(), 0.0],
                1 => [(c - 1.0) * x - s * y, s * x + (c - 1.0) * y],
                _ => [0.0, -tau * x.cos()],
            };
        }
    }

    fn end<M: super::Method<f64, Shears>>(method: M, h: f64) -> [f64; 2] {
        let mut solver = Integrator::new(&Shears, method, 0.0, [0.7, -0.4], Options::fixed(h)).unwrap();
        solver.integrate_to(2.0).unwrap();
        *solver.state()
    }

    #[test]
    fn errors_have_the_order_for_more_than_two_flows() {
        let reference = end(crate::Gauss8::fixed_point(), 1.0 / 64.0);
        let error = |y: [f64; 2]| (y[0] - reference[0]).hypot(y[1] - reference[1]);
        let ratio = |coarse: [f64; 2], fine: [f64; 2]| (error(coarse) / error(fine)).log2();
        // Halving steps changes an error by the order, up to the next term of its expansion.
        let second = ratio(end(Splitting2::new(), 0.1), end(Splitting2::new(), 0.05));
        let fourth = ratio(end(Splitting4::new(), 0.2), end(Splitting4::new(), 0.1));
        let sixth = ratio(end(Splitting6::new(), 0.2), end(Splitting6::new(), 0.1));
        assert!((second - 2.0).abs() < 0.2, "{second}");
        assert!((fourth - 4.0).abs() < 0.4, "{fourth}");
        assert!((sixth - 6.0).abs() < 0.6, "{sixth}");
    }

    #[test]
    fn a_step_back_leads_to_the_start() {
        let mut solver =
            Integrator::new(&Shears, Splitting6::new(), 0.0, [0.7, -0.4], Options::fixed(0.1)).unwrap();
        solver.integrate_to(5.0).unwrap();
        solver.integrate_to(0.0).unwrap();
        let [x, y] = *solver.state();
        // Rounding of six thousand increments of about a tenth, which the motion enlarges on its way.
        assert!((x - 0.7).abs() < 1e-13 && (y + 0.4).abs() < 1e-13, "{x} {y}");
    }

    #[test]
    fn the_state_within_a_step_is_that_of_a_shorter_one() {
        let options = Options::fixed(0.5);
        let mut solver = Integrator::new(&Shears, Splitting4::new(), 0.0, [0.7, -0.4], options).unwrap();
        let _ = solver.step_towards(2.0).unwrap();
        let mut inside = [0.0; 2];
        solver.interpolate(0.2, &mut inside).unwrap();
        let mut shorter =
            Integrator::new(&Shears, Splitting4::new(), 0.0, [0.7, -0.4], Options::fixed(0.2)).unwrap();
        let _ = shorter.step_towards(0.2).unwrap();
        assert_eq!(inside, *shorter.state());
    }
}
