//! Functions on the quantised sphere: spherical harmonics as matrices, their brackets and products.
//!
//! Coordinates become the spin matrices of size `N`, and harmonics of the degree `l` the tensor operators of that
//! degree. In a basis in which the raising matrix has ones beside the diagonal all of them are matrices of integers:
//!
//! ```text
//! S+_(i, i+1) = 1,   S-_(i+1, i) = p_i = (i + 1) (N - 1 - i)
//! U_ll = S+^l,   U_(l, m-1) = [U_lm, S-],   U_lm has the diagonal m alone
//! ```
//!
//! so that brackets are rational but for the normalisation, a root for each element. The change to the basis in which
//! adjoints are transposed, `W_ij = W~_ij d_i/d_j` with `(d_i/d_(i+1))^2 = p_i`, changes neither commutators nor
//! traces.
//!
//! Deliberately does not know: algebras made of them, velocities, energies, the torus.

use num_bigint::BigInt;

use super::modes::Normal;
use super::skew::Bracket;
use hamel_expr::{ExprId, Graph, Number, Rational, Scalar};

/// Real spherical harmonics up to the degree `N - 1` as Hermitian matrices of size `N`:
/// `c_1_0, c_1_1, s_1_1, c_2_0, c_2_1, s_2_1, ..`, degree by degree, cosine before sine of the order `m`.
///
/// ```text
/// c_l_m: K P_lm(cos theta) cos(m phi),   s_l_m: K P_lm(cos theta) sin(m phi),   P_lm > 0 next to the north pole
/// ```
///
/// The mean of the square of each is one: `tr R^2/N = 1`. There is no sign of Condon and Shortley, as in geodesy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Harmonics {
    n: usize,
    normal: Normal,
}

/// One element: degree, order, and whether it is a sine.
type Element = (usize, usize, bool);

/// The operators `U_lm`, `m >= 0`, and what normalises them.
struct Tensors {
    n: usize,
    /// `p_i p_(i+1) .. p_(i+m-1)`, by `m` and `i`.
    products: Vec<Vec<BigInt>>,
    /// The diagonal of `U_lm`, by `l` and `m`.
    diagonals: Vec<Vec<Vec<BigInt>>>,
    /// `tr U_lm U_lm^+`.
    squares: Vec<Vec<BigInt>>,
}

impl Tensors {
    fn new(n: usize) -> Tensors {
        // p_(i-1), so that the number before the first is zero.
        let before = |i: usize| BigInt::from(i * (n - i));
        let products: Vec<Vec<BigInt>> = (0..n)
            .map(|m| (0..n - m).map(|i| (i..i + m).map(|k| before(k + 1)).product()).collect())
            .collect();
        let mut diagonals = Vec::with_capacity(n);
        for l in 0..n {
            let mut of_degree = vec![Vec::new(); l + 1];
            let mut diagonal = vec![BigInt::from(1); n - l];
            for m in (1..=l).rev() {
                let next = (0..=n - m).map(|i| {
                    let here = diagonal.get(i).map_or_else(BigInt::default, |u| u * before(i + m));
                    let left = if i == 0 { BigInt::default() } else { &diagonal[i - 1] * before(i) };
                    here - left
                });
                let next = next.collect();
                of_degree[m] = std::mem::replace(&mut diagonal, next);
            }
            of_degree[0] = diagonal;
            diagonals.push(of_degree);
        }
        let square = |(m, diagonal): (usize, &Vec<BigInt>)| {
            diagonal.iter().zip(&products[m]).map(|(u, p)| u * u * p).sum::<BigInt>()
        };
        let squares = diagonals.iter().map(|list| list.iter().enumerate().map(square).collect()).collect();
        Tensors { n, products, diagonals, squares }
    }

    /// The diagonal `m` of `U_lm`, and of the adjoint of `U_(l, -m)` for `m < 0`.
    fn diagonal(&self, l: usize, m: isize) -> Vec<BigInt> {
        let order = m.unsigned_abs();
        let diagonal = &self.diagonals[l][order];
        if m >= 0 {
            return diagonal.clone();
        }
        diagonal.iter().zip(&self.products[order]).map(|(u, p)| u * p).collect()
    }

    /// The diagonal `a + b` of `A B - B A`, where `A` has the diagonal `a` alone and `B` the diagonal `b`; empty where
    /// there is no such diagonal.
    fn commutator(&self, (a, x): (isize, &[BigInt]), (b, y): (isize, &[BigInt])) -> Vec<BigInt> {
        let n = self.n as isize;
        // Element (i, i + d) of a matrix with the diagonal d.
        let element = |d: isize, diagonal: &[BigInt], i: isize| {
            let at = usize::try_from(i.min(i + d)).ok();
            at.and_then(|k| diagonal.get(k)).cloned().unwrap_or_default()
        };
        let sum = a + b;
        let rows = (-sum).max(0)..n.min(n - sum);
        let value =
            |i: isize| element(a, x, i) * element(b, y, i + a) - element(b, y, i) * element(a, x, i + b);
        rows.map(value).collect()
    }
}

impl Harmonics {
    /// The harmonics of matrices of the size `n`; `n` is from 2 to 17, so that the roots of all of their numbers exist.
    pub(super) fn new(n: usize) -> Harmonics {
        Harmonics { n, normal: Normal::Dual }
    }

    /// The harmonics of a basis of which components have another meaning.
    pub(super) fn normalised(self, normal: Normal) -> Harmonics {
        Harmonics { normal, ..self }
    }

    /// The basis element is this number times the function of the degree `l`.
    pub(super) fn scale(&self, l: usize) -> Rational {
        match self.normal {
            Normal::Dual => <Rational as Scalar>::one(),
            Normal::Vorticity => Rational::new(1.into(), (l * (l + 1)).into()),
        }
    }

    /// Size `N` of the matrices.
    pub fn n(&self) -> usize {
        self.n
    }

    /// Degree and order of each basis element, and whether it is a sine.
    pub fn elements(&self) -> Vec<(usize, usize, bool)> {
        let of_degree = |l: usize| (0..=2 * l).map(move |k| (l, k.div_ceil(2), k > 0 && k.is_multiple_of(2)));
        (1..self.n).flat_map(of_degree).collect()
    }

    /// `l (l + 1)` of each basis element.
    pub fn squares(&self) -> Vec<i64> {
        let square = |l: usize| i64::try_from(l * (l + 1)).unwrap_or(i64::MAX);
        self.elements().iter().map(|(l, ..)| square(*l)).collect()
    }

    pub(super) fn labels(&self) -> Vec<String> {
        let label = |(l, m, is_sine): &Element| format!("{}_{l}_{m}", if *is_sine { "s" } else { "c" });
        self.elements().iter().map(label).collect()
    }

    /// Number of the cosine of a degree and an order; the sine follows it.
    fn place(l: usize, m: usize) -> usize {
        l * l - 1 + (2 * m).saturating_sub(1)
    }

    /// The square of the factor `a` of `c_l_m = a (U_lm + U_lm^+)`, and of `c_l_0 = a U_l0`.
    fn factor_square(&self, tensors: &Tensors, l: usize, m: usize) -> Rational {
        let times = if m == 0 { 1 } else { 2 };
        Rational::new(self.n.into(), &tensors.squares[l][m] * BigInt::from(times))
    }

    /// The root of a rational number whose prime factors are small.
    fn root(q: &Rational) -> Number {
        // Factorials of 3 N - 2 at most, whose prime factors have roots in the field up to N = 17.
        Number::sqrt(q).expect("numbers of harmonics up to N = 17 have roots")
    }

    /// Brackets of the basis.
    pub(super) fn brackets(&self) -> Vec<Bracket<Number>> {
        let scales: Vec<Rational> = self.elements().iter().map(|(l, ..)| self.scale(*l)).collect();
        let mut brackets = self.of_functions();
        for (a, b, value) in &mut brackets {
            for (c, q) in value {
                let scale = &scales[*a] * &scales[*b] / &scales[*c];
                *q = q.times(&scale.into());
            }
        }
        brackets
    }

    /// The bracket of two functions by their coefficients.
    pub fn poisson(&self, g: &mut Graph, x: &[ExprId], y: &[ExprId]) -> Vec<ExprId> {
        let mut terms = vec![Vec::new(); x.len()];
        for (a, b, value) in self.of_functions() {
            let products = [g.mul(x[a], y[b]), g.mul(x[b], y[a])];
            let weight = g.sub(products[0], products[1]);
            for (c, q) in value {
                terms[c].push(g.weighted(weight, &q));
            }
        }
        terms.iter().map(|list| g.linear_combination(list)).collect()
    }

    /// Brackets `{f, g} = -i sqrt(N^2 - 1)/2 (F G - G F)` of the functions: `3 z` for `sqrt(3) x` and `sqrt(3) y`, as
    /// on the unit sphere, for `N = 2`, and nearly that of functions for every pair of low degrees.
    pub(super) fn of_functions(&self) -> Vec<Bracket<Number>> {
        let tensors = Tensors::new(self.n);
        let elements = self.elements();
        let rate = Harmonics::root(&Rational::new((self.n * self.n - 1).into(), 4.into()));
        let squares: Vec<Rational> =
            elements.iter().map(|(l, m, _)| self.factor_square(&tensors, *l, *m)).collect();
        let factors: Vec<Number> = squares.iter().map(Harmonics::root).collect();
        let reciprocals: Vec<Number> = squares.iter().map(|q| Harmonics::root(&q.recip())).collect();
        // As powers of i times operators with a signed order.
        let parts = |(l, m, is_sine): Element| -> Vec<(usize, isize, Vec<BigInt>)> {
            let signed = |m: isize, phase: usize| (phase, m, tensors.diagonal(l, m));
            match (m as isize, is_sine) {
                (0, _) => vec![signed(0, 0)],
                (m, false) => vec![signed(m, 0), signed(-m, 0)],
                (m, true) => vec![signed(m, 3), signed(-m, 1)],
            }
        };
        let parts: Vec<_> = elements.iter().map(|x| parts(*x)).collect();
        let mut brackets = Vec::new();
        for (a, x) in elements.iter().enumerate() {
            for (b, y) in elements.iter().enumerate().skip(a + 1) {
                let mut sums = vec![<Rational as Scalar>::zero(); elements.len()];
                for ((p, i, left), (q, j, right)) in
                    parts[a].iter().flat_map(|p| parts[b].iter().map(move |q| (p, q)))
                {
                    let Ok(order) = usize::try_from(i + j) else { continue };
                    if order >= self.n {
                        continue;
                    }
                    let product = tensors.commutator((*i, left), (*j, right));
                    // -i times the phase; of what is imaginary, the sine has the opposite.
                    let phase = (3 + p + q) % 4;
                    let (is_sine, is_minus) = (phase % 2 == 1, phase == 1 || phase == 2);
                    if is_sine && order == 0 {
                        continue;
                    }
                    // Brackets change the parity of the sum of degrees.
                    for l in (order.max(1)..self.n).filter(|l| (x.0 + y.0 + l) % 2 == 1) {
                        let weights = tensors.diagonals[l][order].iter().zip(&tensors.products[order]);
                        let sum: BigInt = product.iter().zip(weights).map(|(c, (u, p))| c * u * p).sum();
                        let sum = Rational::new(sum, tensors.squares[l][order].clone());
                        let at = Harmonics::place(l, order) + usize::from(is_sine);
                        sums[at] += if is_minus { -sum } else { sum };
                    }
                }
                if sums.iter().all(Scalar::is_zero) {
                    continue;
                }
                let outer = rate.times(&factors[a]).times(&factors[b]);
                let along = sums.into_iter().enumerate().filter(|(_, q)| !q.is_zero());
                let value = along.map(|(c, q)| (c, outer.times(&reciprocals[c]).times(&q.into()))).collect();
                brackets.push((a, b, value));
            }
        }
        brackets
    }

    /// The matrix of a function by its coefficients, real and imaginary parts by rows, in the basis of the module.
    fn matrix(&self, g: &mut Graph, tensors: &Tensors, x: &[ExprId]) -> [Vec<ExprId>; 2] {
        let n = self.n;
        let mut parts = [vec![g.zero(); n * n], vec![g.zero(); n * n]];
        for m in 0..n {
            let degrees: Vec<(usize, Number)> =
                (m.max(1)..n).map(|l| (l, Harmonics::root(&self.factor_square(tensors, l, m)))).collect();
            for i in 0..n - m {
                for (is_sine, part) in parts.iter_mut().enumerate().take(if m == 0 { 1 } else { 2 }) {
                    let terms: Vec<_> = degrees
                        .iter()
                        .map(|(l, factor)| {
                            let u = Rational::from(tensors.diagonals[*l][m][i].clone());
                            g.weighted(x[Harmonics::place(*l, m) + is_sine], &factor.times(&u.into()))
                        })
                        .collect();
                    let sum = g.linear_combination(&terms);
                    let product = Rational::from(tensors.products[m][i].clone());
                    let below = g.linear_combination(&[(sum, product)]);
                    // c - i s above the diagonal, c + i s below it.
                    let above = if is_sine == 1 { g.neg(sum) } else { sum };
                    part[i * n + i + m] = above;
                    part[(i + m) * n + i] = below;
                }
            }
        }
        parts
    }

    /// The power `k` of a matrix.
    fn power(&self, g: &mut Graph, w: &[Vec<ExprId>; 2], k: usize) -> [Vec<ExprId>; 2] {
        let n = self.n;
        let mut power = w.clone();
        for _ in 1..k {
            let mut next = [Vec::with_capacity(n * n), Vec::with_capacity(n * n)];
            for (i, j) in (0..n * n).map(|at| (at / n, at % n)) {
                let (mut re, mut im) = (Vec::new(), Vec::new());
                for k in 0..n {
                    let [a, b] = power.each_ref().map(|part| part[i * n + k]);
                    let [c, d] = w.each_ref().map(|part| part[k * n + j]);
                    let [ac, bd, ad, bc] = [(a, c), (b, d), (a, d), (b, c)].map(|(x, y)| g.mul(x, y));
                    re.extend([(ac, <Rational as Scalar>::one()), (bd, -<Rational as Scalar>::one())]);
                    im.extend([(ad, <Rational as Scalar>::one()), (bc, <Rational as Scalar>::one())]);
                }
                next[0].push(g.linear_combination(&re));
                next[1].push(g.linear_combination(&im));
            }
            power = next;
        }
        power
    }

    /// `tr W^k/N` of the matrix of a function by its coefficients, `k > 0`.
    pub fn trace_power(&self, g: &mut Graph, x: &[ExprId], k: usize) -> ExprId {
        let n = self.n;
        if k == 1 {
            return g.zero();
        }
        let w = self.matrix(g, &Tensors::new(n), x);
        let (left, right) = (self.power(g, &w, k / 2), self.power(g, &w, k.div_ceil(2)));
        let share = Rational::new(1.into(), n.into());
        let mut terms = Vec::with_capacity(2 * n * n);
        for (i, j) in (0..n * n).map(|at| (at / n, at % n)) {
            let re = g.mul(left[0][i * n + j], right[0][j * n + i]);
            let im = g.mul(left[1][i * n + j], right[1][j * n + i]);
            terms.extend([(re, share.clone()), (im, -share.clone())]);
        }
        g.linear_combination(&terms)
    }

    /// Coefficients of the power `k` of the matrix of a function, without its multiple of the identity.
    pub fn star_power(&self, g: &mut Graph, x: &[ExprId], k: usize) -> Vec<ExprId> {
        let n = self.n;
        let tensors = Tensors::new(n);
        let w = self.matrix(g, &tensors, x);
        let power = self.power(g, &w, k);
        let mut coefficients = Vec::with_capacity(x.len());
        for (l, m, is_sine) in self.elements() {
            // tr(W^k R)/N, the elements above and below the diagonal being conjugate.
            let factor = Harmonics::root(&self.factor_square(&tensors, l, m));
            let times = Rational::new(if m == 0 { 1.into() } else { 2.into() }, n.into());
            let terms: Vec<_> = (0..n - m)
                .map(|i| {
                    let u = Rational::from(tensors.diagonals[l][m][i].clone()) * &times;
                    let element = power[usize::from(is_sine)][(i + m) * n + i];
                    g.weighted(element, &factor.times(&u.into()))
                })
                .collect();
            coefficients.push(g.linear_combination(&terms));
        }
        coefficients
    }
}
