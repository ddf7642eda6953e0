//! Functions, vector fields and densities on the circle by their Fourier coefficients, cut off beyond a wave.
//!
//! Coefficients are those of `f(x) = c_0 + sum over k of c_k cos(k x) + s_k sin(k x)`; products lose what goes beyond
//! the last wave, so that the bracket does not satisfy Jacobi.
//!
//! Deliberately does not know: algebras made of them, energies, functions of two coordinates.

use num_traits::{One, Zero};

use super::skew::Bracket;
use hamel_expr::{ExprId, Graph, Number, Rational};

/// The Fourier modes of functions on the circle up to a wave `K`: `c_0, c_1, s_1, .., c_K, s_K`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CircleModes {
    pub(super) largest: usize,
}

/// A combination of modes.
pub(super) type Combination = Vec<(usize, Rational)>;

impl CircleModes {
    pub(super) fn len(self) -> usize {
        2 * self.largest + 1
    }

    /// Wave of a mode, and whether it is a sine.
    fn mode(self, a: usize) -> (i64, bool) {
        let wave = a.div_ceil(2);
        (i64::try_from(wave).unwrap_or(i64::MAX), a > 0 && a.is_multiple_of(2))
    }

    pub(super) fn labels(self) -> Vec<String> {
        let label = |a: usize| match self.mode(a) {
            (k, false) => format!("c_{k}"),
            (k, true) => format!("s_{k}"),
        };
        (0..self.len()).map(label).collect()
    }

    /// `k^2` of each mode.
    pub fn squares(self) -> Vec<i64> {
        (0..self.len()).map(|a| self.mode(a).0.pow(2)).collect()
    }

    /// Adds `q cos(k x)` or `q sin(k x)` where it is within the truncation.
    fn add(self, to: &mut Combination, (k, is_sine): (i64, bool), q: Rational) {
        let q = if k < 0 && is_sine { -q } else { q };
        let Ok(k) = usize::try_from(k.abs()) else { return };
        if k > self.largest || (k == 0 && is_sine) {
            return;
        }
        let at = if k == 0 { 0 } else { 2 * k - usize::from(!is_sine) };
        match to.iter_mut().find(|(b, _)| *b == at) {
            Some((_, sum)) => *sum += q,
            None => to.push((at, q)),
        }
    }

    /// The product of two modes, half of each: of the sum and of the difference of their waves.
    fn product(self, a: usize, b: usize, factor: &Rational, to: &mut Combination) {
        let ((m, p), (n, q)) = (self.mode(a), self.mode(b));
        let half = factor / Rational::from_integer(2.into());
        let minus = -half.clone();
        let (of_sum, of_difference, is_sine) = match (p, q) {
            (false, false) => (half.clone(), half, false),
            (true, true) => (minus, half, false),
            // sin(m x) cos(n x) = (sin((m + n) x) + sin((m - n) x))/2
            (true, false) => (half.clone(), half, true),
            (false, true) => (half, minus, true),
        };
        self.add(to, (m + n, is_sine), of_sum);
        self.add(to, (m - n, is_sine), of_difference);
    }

    /// The derivative of a mode: another one, with a factor.
    fn slope(self, a: usize) -> (usize, Rational) {
        let (k, is_sine) = self.mode(a);
        match (k, is_sine) {
            (0, _) => (0, Rational::from_integer(0.into())),
            (k, false) => (a + 1, Rational::from_integer((-k).into())),
            (k, true) => (a - 1, Rational::from_integer(k.into())),
        }
    }

    /// `f g'` of two modes.
    fn times_slope(self, f: usize, g: usize, factor: i64) -> Combination {
        let mut value = Combination::new();
        let (slope, k) = self.slope(g);
        self.product(f, slope, &(k * Rational::from_integer(factor.into())), &mut value);
        value.retain(|(_, q)| !q.is_zero());
        value
    }

    /// The pointwise product of two functions, without the waves beyond the last.
    pub fn pointwise(self, g: &mut Graph, x: &[ExprId], y: &[ExprId]) -> Vec<ExprId> {
        let mut terms = vec![Vec::new(); self.len()];
        for (a, x) in x.iter().enumerate() {
            for (b, y) in y.iter().enumerate() {
                let product = g.mul(*x, *y);
                let mut value = Combination::new();
                self.product(a, b, &Rational::one(), &mut value);
                for (c, q) in value {
                    terms[c].push((product, q));
                }
            }
        }
        terms.iter().map(|list| g.linear_combination(list)).collect()
    }

    /// What a field makes of a function that it carries, `-u f'`.
    pub(super) fn carried(self, u: usize, f: usize) -> Combination {
        self.times_slope(u, f, -1)
    }

    /// What a field makes of a density that it carries, `-(u rho)'`.
    pub(super) fn dragged(self, u: usize, rho: usize) -> Combination {
        sum(self.times_slope(u, rho, -1), self.times_slope(rho, u, -1))
    }

    /// `[u, v] = u' v - u v'` of all modes.
    pub(super) fn brackets(self) -> Vec<Bracket<Number>> {
        let mut brackets = Vec::new();
        for a in 0..self.len() {
            for b in a + 1..self.len() {
                let mut value = sum(self.times_slope(b, a, 1), self.times_slope(a, b, -1));
                value.sort_by_key(|(c, _)| *c);
                brackets.push((a, b, value.into_iter().map(|(c, q)| (c, q.into())).collect()));
            }
        }
        brackets
    }
}

/// The sum of two combinations.
fn sum(mut value: Combination, other: Combination) -> Combination {
    for (c, q) in other {
        match value.iter_mut().find(|(b, _)| *b == c) {
            Some((_, sum)) => *sum += q,
            None => value.push((c, q)),
        }
    }
    value.retain(|(_, q)| !q.is_zero());
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use hamel_expr::rational_to_f64;

    fn value(modes: CircleModes, f: &[(usize, Rational)], x: f64) -> f64 {
        let at = |a: usize| match modes.mode(a) {
            (k, false) => (k as f64 * x).cos(),
            (k, true) => (k as f64 * x).sin(),
        };
        f.iter().map(|(a, q)| rational_to_f64(q) * at(*a)).sum()
    }

    /// Modes of the truncation of which no product leaves it: all is as on paper.
    #[test]
    fn products_and_slopes_are_those_of_functions() {
        let modes = CircleModes { largest: 8 };
        for a in 0..9 {
            for b in 0..9 {
                let one = |a: usize, x: f64| value(modes, &[(a, Rational::one())], x);
                let (slope, q) = modes.slope(b);
                let mut product = Combination::new();
                modes.product(a, b, &Rational::one(), &mut product);
                for x in [0.3, 1.9, -2.2] {
                    assert!((value(modes, &product, x) - one(a, x) * one(b, x)).abs() < 1e-14);
                    let step = 1e-6;
                    let difference = (one(b, x + step) - one(b, x - step)) / (2.0 * step);
                    assert!((value(modes, &[(slope, q.clone())], x) - difference).abs() < 1e-8);
                }
            }
        }
    }
}
