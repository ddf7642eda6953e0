//! Increments of Wiener processes, by counters.
//!
//! Deliberately does not know: what a noise moves, how a step is made.

use crate::inputs::Signal;
use crate::math;

/// White noise on a grid of times: in each step of the grid the rate `dW/dt` is constant, `DW_n / step` with
/// independent normal increments `DW_n` of variance `step`.
///
/// ```text
/// dy = f(t, y) dt + sum_k g_k(t, y) o dW_k
/// ```
///
/// in the sense of Stratonovich is what a system becomes whose inputs are these rates, as the grid becomes finer (Wong
/// and Zakai). [`Midpoint`](crate::Midpoint) and its relatives evaluate the system inside of a step alone, so that a
/// step of theirs that is one of the grid, or a whole part of one, meets no jump; with one step of the grid each the
/// midpoint rule is of strong order one where the fields `g_k` commute, and one half elsewhere. It keeps quadratic
/// invariants of every path, Casimirs among them, to rounding.
///
/// An increment is a function of seed, path, noise and number of the step alone: no order of evaluation, no number of
/// threads and no other path changes one of its bits.
///
/// ```
/// use hamel_runtime::{Controlled, Integrator, Midpoint, Options, ParamInfo, System, Wiener, WithInput};
///
/// /// Kubo's oscillator: `dz = i (1 + W') z dt`.
/// #[derive(Clone, Copy)]
/// struct Kubo([f64; 1]);
///
/// impl System<f64> for Kubo {
///     type State = [f64; 2];
///     fn rhs(&self, t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
///         self.rhs_with(t, y, &self.0, dy);
///     }
/// }
///
/// impl Controlled<f64, 1> for Kubo {
///     const INPUTS: [ParamInfo; 1] = [ParamInfo::new("W", 0.0, "white noise")];
///     fn held_inputs(&self) -> &[f64; 1] {
///         &self.0
///     }
///     fn hold_inputs(&mut self, u: &[f64; 1]) {
///         self.0 = *u;
///     }
///     fn rhs_with(&self, _t: f64, y: &[f64; 2], u: &[f64; 1], dy: &mut [f64; 2]) {
///         *dy = [-(1.0 + u[0]) * y[1], (1.0 + u[0]) * y[0]];
///     }
/// }
///
/// let noisy = WithInput::new(Kubo([0.0]), Wiener::new(7, 0.01));
/// let mut solver = Integrator::new(&noisy, Midpoint::fixed_point(), 0.0, [1.0, 0.0], Options::fixed(0.01))?;
/// solver.integrate_to(10.0)?;
/// let [x, y] = *solver.state();
/// assert!((x * x + y * y - 1.0).abs() < 1e-14);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
///
/// # Source
/// Wong and Zakai 1965; Salmon, Moraes, Dror, Shaw 2011, Parallel random numbers: as easy as 1, 2, 3 (Philox4x32-10);
/// Box and Muller 1958; Milstein and Tretyakov 2004, Stochastic numerics for
/// mathematical physics.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wiener {
    seed: u64,
    path: u32,
    step: f64,
    merged: u32,
}

impl Wiener {
    /// The path number zero of a seed, on a grid of that step.
    ///
    /// # Panics
    /// Where the step is not positive and finite.
    #[must_use]
    pub const fn new(seed: u64, step: f64) -> Wiener {
        assert!(step > 0.0 && step < f64::INFINITY, "a step above zero");
        Wiener { seed, path: 0, step, merged: 1 }
    }

    /// Another path, independent of all others.
    #[must_use]
    pub const fn with_path(self, path: u32) -> Wiener {
        Wiener { path, ..self }
    }

    /// The same path on a coarser grid, of which each step is so many steps of the fine one: its increments are sums.
    ///
    /// # Panics
    /// Where the number is zero.
    #[must_use]
    pub const fn merged(self, n: u32) -> Wiener {
        assert!(n > 0, "a coarser grid has steps of one fine step or more");
        Wiener { merged: n, ..self }
    }

    /// The step of the grid on which rates are constant.
    #[must_use]
    pub fn grid(&self) -> f64 {
        self.step * f64::from(self.merged)
    }

    /// `W_k((n + 1) step) - W_k(n step)` of a noise over a step of the coarse grid.
    #[must_use]
    pub fn increment(&self, k: u32, n: i64) -> f64 {
        let fine = (0..i64::from(self.merged)).map(|j| {
            let n = n.wrapping_mul(i64::from(self.merged)).wrapping_add(j);
            normal(self.seed, [n as u64 as u32, ((n as u64) >> 32) as u32, self.path, k])
        });
        math::sqrt(self.step) * fine.sum::<f64>()
    }

    /// `dW_k/dt` at a time: that of the step of the grid which begins there or before.
    #[must_use]
    pub fn rate(&self, k: u32, t: f64) -> f64 {
        let x = t / self.grid();
        let whole = x as i64;
        let n = if whole as f64 > x { whole - 1 } else { whole };
        self.increment(k, n) / self.grid()
    }
}

impl<S, const M: usize> Signal<f64, S, M> for Wiener {
    fn at(&self, t: f64, _y: &S) -> [f64; M] {
        core::array::from_fn(|k| self.rate(k as u32, t))
    }
}

/// A normal number of a counter.
fn normal(seed: u64, counter: [u32; 4]) -> f64 {
    let [a, b, c, d] = philox(counter, [seed as u32, (seed >> 32) as u32]);
    // 53 bits each; the first number is above zero, where the logarithm has a value.
    let unit = |high: u32, low: u32| ((u64::from(high) << 32 | u64::from(low)) >> 11) as f64;
    let scale = 1.0 / (1u64 << 53) as f64;
    let (u, v) = ((unit(a, b) + 1.0) * scale, unit(c, d) * scale);
    math::sqrt(-2.0 * math::ln(u)) * math::cos(core::f64::consts::TAU * v)
}

/// Philox4x32 with ten rounds.
fn philox(mut counter: [u32; 4], mut key: [u32; 2]) -> [u32; 4] {
    let multiplied = |factor: u32, x: u32| {
        let product = u64::from(factor) * u64::from(x);
        ((product >> 32) as u32, product as u32)
    };
    for _ in 0..10 {
        let [a, b, c, d] = counter;
        let (high_a, low_a) = multiplied(0xD251_1F53, a);
        let (high_c, low_c) = multiplied(0xCD9E_8D57, c);
        counter = [high_c ^ b ^ key[0], low_c, high_a ^ d ^ key[1], low_a];
        key = [key[0].wrapping_add(0x9E37_79B9), key[1].wrapping_add(0xBB67_AE85)];
    }
    counter
}

#[cfg(test)]
mod tests {
    use super::{Wiener, philox};

    /// The vectors that the authors of Philox publish with it.
    #[test]
    fn philox_has_its_published_values() {
        let all = u32::MAX;
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(philox([all; 4], [all; 2]), [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]);
        let pi = [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344];
        let key = [0xa409_3822, 0x299f_31d0];
        assert_eq!(philox(pi, key), [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]);
    }

    /// Moments of 40,000 increments, each within five of its standard deviations; and correlations with the next
    /// step, another noise and another path.
    #[test]
    fn increments_are_normal_and_independent() {
        let n: i64 = 40_000;
        let step = 0.01;
        let wiener = Wiener::new(3, step);
        let of = |w: Wiener, k, shift| {
            (0..n).map(move |i| w.increment(k, i + shift) / step.sqrt()).collect::<std::vec::Vec<f64>>()
        };
        let x = of(wiener, 0, -n / 2);
        let mean = |f: &dyn Fn(usize) -> f64| (0..n as usize).map(f).sum::<f64>() / n as f64;
        let bound = |variance: f64| 5.0 * (variance / n as f64).sqrt();
        assert!(mean(&|i| x[i]).abs() < bound(1.0));
        assert!((mean(&|i| x[i].powi(2)) - 1.0).abs() < bound(2.0));
        assert!(mean(&|i| x[i].powi(3)).abs() < bound(15.0));
        assert!((mean(&|i| x[i].powi(4)) - 3.0).abs() < bound(96.0));
        let others = [of(wiener, 0, 1 - n / 2), of(wiener, 1, -n / 2), of(wiener.with_path(1), 0, -n / 2)];
        for other in others {
            assert!(mean(&|i| x[i] * other[i]).abs() < bound(1.0));
            assert!(mean(&|i| (x[i].powi(2) - 1.0) * (other[i].powi(2) - 1.0)).abs() < bound(4.0));
        }
    }

    #[test]
    fn a_coarser_grid_has_the_same_path() {
        let (fine, coarse) = (Wiener::new(5, 0.1), Wiener::new(5, 0.1).merged(4));
        for n in -3..3 {
            let sum: f64 = (0..4).map(|j| fine.increment(2, 4 * n + j)).sum();
            assert!((coarse.increment(2, n) - sum).abs() < 1e-15);
            let t = (n as f64 + 0.5) * coarse.grid();
            assert!((coarse.rate(2, t) * coarse.grid() - sum).abs() < 1e-15);
        }
    }
}
