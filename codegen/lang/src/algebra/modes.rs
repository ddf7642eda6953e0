//! Fourier modes of two-dimensional flows: their brackets and products.
//!
//! Brackets are `[L_a, L_b] = S(a, b) L_{a+b}` of waves `L_m = exp(i m.x)`, which sums of waves leave (Galerkin) or
//! come back to (modulo `N`). Elements are real: their coefficients have `f_{-m} = conj f_m`, so that the waves of half
//! of the plane determine them.
//!
//! Deliberately does not know: algebras made of them, velocities, energies.

use std::collections::{BTreeMap, BTreeSet};

use super::skew::Bracket;
use hamel_expr::{ExprId, Graph, Number, Rational, Scalar};

/// A wave vector.
pub(super) type Wave = (i64, i64);

/// What the components of an element are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Normal {
    /// Pairings: basis elements are dual to the coefficients of functions (on the torus to their real and imaginary
    /// parts, in the pairing `sum over all m of f_m conj(g_m)`), so that momenta are coefficients.
    Dual,
    /// Coefficients of minus the Laplacian of a function: basis elements are functions by the eigenvalue of each.
    Vorticity,
}

/// The Fourier modes of a basis: for each wave of the half set `{m1 > 0, or m1 = 0 and m2 > 0}`, in lexicographic
/// order, an element for the real part and one for the imaginary part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Modes {
    waves: Vec<Wave>,
    /// Sums of waves are taken modulo this number; none: what leaves the set is dropped.
    modulus: Option<i64>,
    normal: Normal,
}

/// A real combination of `A_m = L_m + L_{-m}` (for `false`) and `B_m = i (L_m - L_{-m})` (for `true`), `m` in the half
/// set.
pub(super) type Combination = BTreeMap<(Wave, bool), Number>;

/// Real and imaginary parts of the coefficients of all waves and of the identity.
type Coefficients = BTreeMap<Wave, (ExprId, ExprId)>;

impl Modes {
    pub(super) fn new(largest: i64, modulus: Option<i64>) -> Modes {
        let all = (0..=largest).flat_map(|a| (-largest..=largest).map(move |b| (a, b)));
        Modes { waves: all.filter(|m| *m > (0, 0)).collect(), modulus, normal: Normal::Dual }
    }

    /// The modes of a basis of which components have another meaning.
    pub(super) fn normalised(self, normal: Normal) -> Modes {
        Modes { normal, ..self }
    }

    /// The waves of the half set, in order; the basis has two elements for each.
    pub fn waves(&self) -> &[(i64, i64)] {
        &self.waves
    }

    /// `N` where waves are taken modulo `N`.
    pub fn modulus(&self) -> Option<i64> {
        self.modulus
    }

    /// `|m|^2` of each basis element.
    pub fn squares(&self) -> Vec<i64> {
        self.waves.iter().flat_map(|(a, b)| [a * a + b * b; 2]).collect()
    }

    /// Names of the basis elements: `re_1_m2` is the real part of the wave `(1, -2)`.
    pub(super) fn labels(&self) -> Vec<String> {
        let number = |n: i64| if n < 0 { format!("m{}", -n) } else { n.to_string() };
        let of_part = |part: &str, (a, b): Wave| format!("{part}_{}_{}", number(a), number(b));
        self.waves.iter().flat_map(|m| [of_part("re", *m), of_part("im", *m)]).collect()
    }

    /// A wave as one of the set, none for waves outside and for zero.
    fn reduced(&self, (a, b): Wave) -> Option<Wave> {
        let wave = match self.modulus {
            Some(n) => {
                let centred = |x: i64| (x + n / 2).rem_euclid(n) - n / 2;
                (centred(a), centred(b))
            }
            None => (a, b),
        };
        let half = if wave < (0, 0) { (-wave.0, -wave.1) } else { wave };
        self.waves.binary_search(&half).is_ok().then_some(wave)
    }

    /// `S(a, b)`: `(N/2 pi) sin(2 pi (a x b)/N)`, and `-(a x b)` on the torus, where `[f, g] = f_x g_y - f_y g_x`; the
    /// first is Zeitlin's and tends to `[f, g] = f_y g_x - f_x g_y`.
    fn constant(&self, (a1, a2): Wave, (b1, b2): Wave) -> Number {
        let product = a1 * b2 - a2 * b1;
        let rational = |n: i64, d: i64| Number::from(Rational::new(n.into(), d.into()));
        match self.modulus {
            Some(n) => {
                let sine = Number::sin_pi(2 * product, n).unwrap_or_default();
                sine.times(&Number::power_of_pi(-1)).times(&rational(n, 2))
            }
            None => rational(-product, 1),
        }
    }

    /// Adds `q` times `A_m` or `B_m` of any wave `m`.
    fn add(&self, to: &mut Combination, m: Wave, is_imaginary: bool, q: &Number) {
        let Some(m) = self.reduced(m) else { return };
        let (m, q) = match m < (0, 0) {
            true => ((-m.0, -m.1), if is_imaginary { q.negated() } else { q.clone() }),
            false => (m, q.clone()),
        };
        let entry = to.entry((m, is_imaginary)).or_default();
        *entry = entry.plus(&q);
    }

    /// The bracket of two of the `A_m` and `B_m`: with `s = S(m, n)`, `[A_m, A_n] = s (A_{m+n} - A_{m-n})`,
    /// `[A_m, B_n] = s (B_{m+n} + B_{m-n})`, `[B_m, A_n] = s (B_{m+n} - B_{m-n})`,
    /// `[B_m, B_n] = -s (A_{m+n} + A_{m-n})`.
    pub(super) fn bracket(&self, (m, p): (Wave, bool), (n, q): (Wave, bool)) -> Combination {
        let s = self.constant(m, n);
        let minus = s.negated();
        let (of_sum, of_difference) = match (p, q) {
            (false, false) | (true, false) => (&s, &minus),
            (false, true) => (&s, &s),
            (true, true) => (&minus, &minus),
        };
        let mut value = Combination::new();
        self.add(&mut value, (m.0 + n.0, m.1 + n.1), p != q, of_sum);
        self.add(&mut value, (m.0 - n.0, m.1 - n.1), p != q, of_difference);
        value.retain(|_, q| !q.is_zero());
        value
    }

    /// The basis element is this number times `A_m` or `B_m`.
    pub(super) fn scale(&self, (a, b): Wave) -> Rational {
        match self.normal {
            Normal::Dual => Rational::new(1.into(), 2.into()),
            Normal::Vorticity => Rational::new(1.into(), (a * a + b * b).into()),
        }
    }

    /// The `A_m` and `B_m` of the basis, in its order.
    pub(super) fn elements(&self) -> Vec<(Wave, bool)> {
        self.waves.iter().flat_map(|m| [(*m, false), (*m, true)]).collect()
    }

    /// Brackets of the basis.
    pub(super) fn brackets(&self) -> Vec<Bracket<Number>> {
        let elements = self.elements();
        let mut brackets = Vec::new();
        for (a, x) in elements.iter().enumerate() {
            for (b, y) in elements.iter().enumerate().skip(a + 1) {
                let outer = self.scale(x.0) * self.scale(y.0);
                let value = self.bracket(*x, *y);
                let along = value.into_iter().map(|((m, part), q)| {
                    let scale = &outer / self.scale(m);
                    (self.place(m, part), q.times(&scale.into()))
                });
                let mut value: Vec<(usize, Number)> = along.collect();
                value.sort_by_key(|(c, _)| *c);
                brackets.push((a, b, value));
            }
        }
        brackets
    }

    /// The bracket of two functions, by real and imaginary parts of their coefficients.
    pub fn poisson(&self, g: &mut Graph, x: &[ExprId], y: &[ExprId]) -> Vec<ExprId> {
        let elements = self.elements();
        let mut terms = vec![Vec::new(); elements.len()];
        let zero = g.zero();
        for (a, p) in elements.iter().enumerate().filter(|(a, _)| x[*a] != zero) {
            for (b, q) in elements.iter().enumerate().filter(|(b, _)| y[*b] != zero) {
                let product = g.mul(x[a], y[b]);
                for ((m, part), weight) in self.bracket(*p, *q) {
                    terms[self.place(m, part)].push(g.weighted(product, &weight));
                }
            }
        }
        terms.iter().map(|list| g.linear_combination(list)).collect()
    }

    /// Coefficients `(x^k)_m` of the `k`-th power of the matrix whose coefficients are given by their real and
    /// imaginary parts, without its multiple of the identity. None where waves are not taken modulo `N`.
    pub fn star_power(&self, g: &mut Graph, x: &[ExprId], k: usize) -> Option<Vec<ExprId>> {
        let power = self.powers(g, x, &[k])?.remove(&k)?;
        let parts = self.waves.iter().map(|m| power.get(m).map(|(re, im)| [*re, *im]));
        Some(parts.collect::<Option<Vec<_>>>()?.concat())
    }

    /// `tr(x^k)/N` of the matrix whose coefficients are given by their real and imaginary parts. None where waves are
    /// not taken modulo `N`.
    pub fn trace_power(&self, g: &mut Graph, x: &[ExprId], k: usize) -> Option<ExprId> {
        if k == 1 {
            return self.modulus.map(|_| g.zero());
        }
        let powers = self.powers(g, x, &[k / 2, k.div_ceil(2)])?;
        let (left, right) = (powers.get(&(k / 2))?, powers.get(&k.div_ceil(2))?);
        // tr(J_a J_b)/N = 1 where a + b = 0
        let mut terms = Vec::new();
        for (m, (re, im)) in left.iter().filter(|(m, _)| **m >= (0, 0)) {
            let weight = Rational::from_integer(if *m == (0, 0) { 1 } else { 2 }.into());
            let (other_re, other_im) = right.get(m)?;
            let products = [g.mul(*re, *other_re), g.mul(*im, *other_im)];
            terms.extend(products.map(|product| (product, weight.clone())));
        }
        Some(g.linear_combination(&terms))
    }

    /// Powers of a matrix by the coefficients of all waves and of the identity: `x^k` for the exponents `k`, and those
    /// by which they are computed, each the product of two halves.
    ///
    /// Matrices of different waves multiply as `J_a J_b = exp(-2 pi i (a x b)/N) J_{a+b}`. The powers of one matrix
    /// commute, so that `(x y)_m = sum over a + b = m of cos(2 pi (a x b)/N) x_a y_b` for them.
    fn powers(
        &self,
        g: &mut Graph,
        x: &[ExprId],
        exponents: &[usize],
    ) -> Option<BTreeMap<usize, Coefficients>> {
        let n = self.modulus?;
        let mut first = Coefficients::from([((0, 0), (g.zero(), g.zero()))]);
        for (at, m) in self.waves.iter().enumerate() {
            let (re, im) = (x[2 * at], x[2 * at + 1]);
            let minus = g.neg(im);
            first.insert(*m, (re, im));
            first.insert((-m.0, -m.1), (re, minus));
        }
        let cosines: Vec<Number> = (0..n).map(|j| Number::cos_pi(2 * j, n)).collect::<Option<_>>()?;
        let (mut wanted, mut open) = (BTreeSet::new(), exponents.to_vec());
        while let Some(k) = open.pop() {
            if k > 1 && wanted.insert(k) {
                open.extend([k / 2, k.div_ceil(2)]);
            }
        }
        let mut powers = BTreeMap::from([(1, first)]);
        for k in wanted {
            let product = self.product(g, &powers[&(k / 2)], &powers[&k.div_ceil(2)], &cosines)?;
            powers.insert(k, product);
        }
        Some(powers)
    }

    fn product(
        &self,
        g: &mut Graph,
        left: &Coefficients,
        right: &Coefficients,
        cosines: &[Number],
    ) -> Option<Coefficients> {
        let n = self.modulus?;
        let mut product = Coefficients::new();
        for m in self.waves.iter().copied().chain([(0, 0)]) {
            let (mut re, mut im) = (Vec::new(), Vec::new());
            for (a, (p, q)) in left {
                let rest = (m.0 - a.0, m.1 - a.1);
                let b = self.reduced(rest).unwrap_or((0, 0));
                let (r, s) = right.get(&b)?;
                let turn = usize::try_from((a.0 * b.1 - a.1 * b.0).rem_euclid(n)).ok()?;
                let [pr, qs, ps, qr] = [(p, r), (q, s), (p, s), (q, r)].map(|(x, y)| g.mul(*x, *y));
                let (x, y) = (g.sub(pr, qs), g.add(ps, qr));
                re.push(g.weighted(x, &cosines[turn]));
                im.push(g.weighted(y, &cosines[turn]));
            }
            let (re, im) = (g.linear_combination(&re), g.linear_combination(&im));
            let minus = g.neg(im);
            product.insert((-m.0, -m.1), (re, minus));
            product.insert(m, (re, im));
        }
        Some(product)
    }

    pub(super) fn place(&self, m: Wave, is_imaginary: bool) -> usize {
        2 * self.waves.partition_point(|other| *other < m) + usize::from(is_imaginary)
    }
}
