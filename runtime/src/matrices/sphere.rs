//! The sphere: su(N) with the Laplacian of Hoppe and Yau, which is tridiagonal along each diagonal.
//!
//! ```text
//! (Delta_N W) = sum over a of [S_a, [S_a, W]],   S_a the spin matrices of size N, s = (N - 1)/2
//! (Delta_N W)_(i, i+d) = (2 s (s + 1) - 2 m_i m_(i+d)) W_(i, i+d) - o_i W_(i+1, i+1+d) - o_(i-1) W_(i-1, i-1+d)
//! m_i = s - i,   o_i = c_i c_(i+d),   c_i^2 = (i + 1) (N - 1 - i)
//! ```
//!
//! Its eigenvalues along the diagonal `d` are `l (l + 1)` for `l = d, .., N - 1`, as those of minus the Laplacian of
//! the sphere, and its eigenvectors take the place of the spherical harmonics.
//!
//! Does not know: steps.

use super::Error;
use super::Laplacian;
use super::diagonals::{Shape, gather, n_work, scatter};
use super::harmonics::{beside_diagonal, filter, harmonic, n_filter_work, on_diagonal};
use super::panels::{LANES, LARGEST, Row, element, n_panels, n_rows, padded, set_element};
use super::sealed::Spectral;
use super::stream::Stream;
use crate::math::{mul_add, sqrt};

/// A fluid on the unit sphere in su(N).
///
/// ```text
/// W' = -i sqrt(N^2 - 1)/2 [P, W],   Delta_N P = W,   E = 2 pi/N tr(P W)
/// ```
///
/// With another [`Stream`], `(shift + Delta_N) P = scale W`.
///
/// Functions `sum over l, m of omega_lm Y_lm` of spherical harmonics (orthonormal, with the sign of Condon and
/// Shortley) become matrices `sum of omega_lm T_lm`, where `T_lm` has the diagonal `m` alone and the norm
/// `tr T_lm T_lm^+ = N/(4 pi)`. Coordinates become the spin matrices times `2/sqrt(N^2 - 1)`, and the motion is that of
/// `omega_t = {psi, omega}`, `psi` the function with `-Delta psi = omega`.
///
/// The state of models in `zeitlin_sphere(N)` of the model language are the coefficients of real harmonics whose square
/// has the mean one, without the sign of Condon and Shortley: `c_l0` and, for `m > 0`, `c_lm` of `cos(m phi)` and
/// `s_lm` of `sin(m phi)`, degree by degree from `l = 1` on. [`set_modes`](Self::set_modes) and
/// [`modes`](Self::modes) go to the matrix and back:
///
/// ```text
/// omega_l0 = sqrt(4 pi) c_l0,   omega_lm = (-1)^m sqrt(2 pi) (c_lm - i s_lm)
/// ```
///
/// # Source
///
/// Hoppe and Yau, Some properties of matrix harmonics on S^2 (1998); Modin and Viviani, A Casimir preserving scheme for
/// long-time simulation of spherical ideal hydrodynamics (2020).
#[derive(Clone, Copy, Debug)]
pub struct Sphere<S> {
    n: usize,
    /// Of each element on or above the diagonal: the factor of the element before it, and the reciprocal of the pivot.
    tables: S,
}

/// The number of the cosine of a degree and an order among the modes; the sine follows it.
fn place(l: usize, m: usize) -> usize {
    l * l - 1 + (2 * m).saturating_sub(1)
}

impl<S: AsRef<[f64]> + AsMut<[f64]>> Sphere<S> {
    /// Numbers that the tables of a size take.
    #[must_use]
    pub const fn storage(n: usize) -> usize {
        2 * LANES * n_rows(n, n)
    }

    /// The sphere with matrices of the size `n` for an ideal fluid; `tables` have room for [`storage`](Self::storage)
    /// numbers.
    ///
    /// # Errors
    ///
    /// [`Error::MatrixSize`], [`Error::Storage`].
    pub fn new(n: usize, tables: S) -> Result<Self, Error> {
        Self::with_stream(n, Stream::ideal(), tables)
    }

    /// The sphere with matrices of the size `n` for a fluid with that stream function; `tables` have room for
    /// [`storage`](Self::storage) numbers.
    ///
    /// # Errors
    ///
    /// [`Error::MatrixSize`], [`Error::Number`], [`Error::Storage`].
    pub fn with_stream(n: usize, stream: Stream, mut tables: S) -> Result<Self, Error> {
        if !(2..=LARGEST).contains(&n) {
            return Err(Error::MatrixSize { n, allowed: "a number from 2 to 4096" });
        }
        stream.validate()?;
        let (given, needed) = (tables.as_ref().len(), Self::storage(n));
        let Some(numbers) = tables.as_mut().get_mut(..needed) else {
            return Err(Error::Storage { given, needed });
        };
        numbers.fill(0.0);
        let rows = numbers.as_chunks_mut::<{ 2 * LANES }>().0;
        for d in 0..n {
            let (panel, lane) = (d / LANES, d % LANES);
            let mut before = 0.0;
            for i in 0..n - d {
                let row = &mut rows[panel * padded(n) + i];
                let beside = if i == 0 { 0.0 } else { beside_diagonal(n, i - 1, i - 1 + d) };
                let factor = beside * before;
                let pivot = stream.shift + on_diagonal(n, i, i + d) - beside * factor;
                // Constants have no stream function: without a shift the last pivot of the first diagonal vanishes.
                let is_constant = d == 0 && i == n - 1 && stream.shift == 0.0;
                before = if is_constant { 0.0 } else { pivot.recip() };
                row[lane] = factor;
                row[LANES + lane] = stream.scale * before;
            }
        }
        Ok(Self { n, tables })
    }

    /// Adds `omega Y_lm` and, for `m > 0`, its complex conjugate to the vorticity; of `omega` for `m = 0` the real
    /// part.
    ///
    /// # Panics
    ///
    /// Unless `m <= l < n`, and if the matrix does not have the size of the sphere.
    pub fn add_mode(&self, (l, m): (usize, usize), omega: [f64; 2], vorticity: super::MatrixMut<'_>) {
        let n = self.n;
        assert!(m <= l && l < n && vorticity.n() == n);
        let im = if m == 0 { 0.0 } else { omega[1] };
        self.harmonic(l, m, |i, value| {
            let old = element(n, vorticity.rows, i, i + m);
            let new = [mul_add(value, omega[0], old[0]), mul_add(value, im, old[1])];
            set_element(n, vorticity.rows, (i, i + m), new);
            set_element(n, vorticity.rows, (i + m, i), [new[0], -new[1]]);
        });
    }

    /// The coefficient `omega_lm` of a Hermitian matrix, `m >= 0`.
    ///
    /// # Panics
    ///
    /// As [`add_mode`](Self::add_mode).
    #[must_use]
    pub fn mode(&self, (l, m): (usize, usize), matrix: super::MatrixRef<'_>) -> [f64; 2] {
        let n = self.n;
        assert!(m <= l && l < n && matrix.n() == n);
        let mut sum = [0.0; 2];
        self.harmonic(l, m, |i, value| {
            let [re, im] = element(n, matrix.rows, i, i + m);
            sum = [mul_add(value, re, sum[0]), mul_add(value, im, sum[1])];
        });
        sum.map(|x| x * self.area() / n as f64)
    }

    /// Number of real numbers that a state has: `n^2 - 1`.
    #[must_use]
    pub const fn n_modes(&self) -> usize {
        self.n * self.n - 1
    }

    /// Writes the matrix of the vorticity with the coefficients `modes` of real harmonics, in the order of the algebra
    /// `zeitlin_sphere(N)`.
    ///
    /// # Panics
    ///
    /// If there are not `n^2 - 1` modes, or if the matrix does not have the size of the sphere.
    pub fn set_modes(&self, modes: &[f64], vorticity: super::MatrixMut<'_>) {
        assert_eq!((modes.len(), vorticity.n()), (self.n_modes(), self.n));
        vorticity.rows.fill([0.0; 2 * LANES]);
        for l in 1..self.n {
            for m in 0..=l {
                let at = place(l, m);
                let mode = [modes[at], if m == 0 { 0.0 } else { modes[at + 1] }];
                let matrix = super::MatrixMut { n: vorticity.n, rows: vorticity.rows };
                self.add_real_mode((l, m), mode, matrix);
            }
        }
    }

    /// Adds `c cos(m phi) + s sin(m phi)`, each times its real harmonic of the degree `l`, to the vorticity; of `m = 0`
    /// there is no sine.
    ///
    /// # Panics
    ///
    /// As [`add_mode`](Self::add_mode).
    pub fn add_real_mode(&self, (l, m): (usize, usize), [c, s]: [f64; 2], vorticity: super::MatrixMut<'_>) {
        let factor = self.of_real_harmonic(m);
        self.add_mode((l, m), [factor * c, -factor * s], vorticity);
    }

    /// The coefficients `c` and `s` of the real harmonics of a degree and an order in a Hermitian matrix.
    ///
    /// # Panics
    ///
    /// As [`add_mode`](Self::add_mode).
    #[must_use]
    pub fn real_mode(&self, (l, m): (usize, usize), matrix: super::MatrixRef<'_>) -> [f64; 2] {
        let factor = self.of_real_harmonic(m);
        let [re, im] = self.mode((l, m), matrix);
        [re / factor, if m == 0 { 0.0 } else { -im / factor }]
    }

    /// The coefficients of real harmonics of a Hermitian matrix, in the order of the algebra `zeitlin_sphere(N)`.
    ///
    /// # Panics
    ///
    /// If there is not room for `n^2 - 1` modes, or if the matrix does not have the size of the sphere.
    pub fn modes(&self, matrix: super::MatrixRef<'_>, modes: &mut [f64]) {
        assert_eq!((modes.len(), matrix.n()), (self.n_modes(), self.n));
        for l in 1..self.n {
            for m in 0..=l {
                let [c, s] = self.real_mode((l, m), matrix);
                let at = place(l, m);
                modes[at] = c;
                if m > 0 {
                    modes[at + 1] = s;
                }
            }
        }
    }

    /// `omega_lm` of the real harmonic `cos(m phi)` of that degree.
    fn of_real_harmonic(&self, m: usize) -> f64 {
        let sign = if m.is_multiple_of(2) { 1.0 } else { -1.0 };
        sign * sqrt(self.area() / if m == 0 { 1.0 } else { 2.0 })
    }

    /// Calls `visit` with the elements `(i, i + m)` of `T_lm`.
    fn harmonic(&self, l: usize, m: usize, mut visit: impl FnMut(usize, f64)) {
        let sign = if m.is_multiple_of(2) { 1.0 } else { -1.0 };
        harmonic(self.n, (l, m), self.n as f64 / self.area(), |i, value| visit(i, sign * value));
    }
}

impl<S: AsRef<[f64]> + AsMut<[f64]>> Laplacian for Sphere<S> {
    fn n(&self) -> usize {
        self.n
    }

    fn rate(&self) -> f64 {
        -0.5 * sqrt((self.n * self.n) as f64 - 1.0)
    }

    fn area(&self) -> f64 {
        4.0 * core::f64::consts::PI
    }
}

impl<S: AsRef<[f64]> + AsMut<[f64]>> Spectral for Sphere<S> {
    fn n_work(n: usize) -> usize {
        n_rows(n, n) + n_work(n)
    }

    fn invert(&self, vorticity: &[Row], stream: &mut [Row], work: &mut [Row]) {
        let n = self.n;
        let (diagonals, line) = work.split_at_mut(n_rows(n, n));
        gather(n, Shape::Open, vorticity, diagonals, line);
        without_mean(&mut diagonals[..n], 1.0);
        let tables = self.tables.as_ref()[..Self::storage(n)].as_chunks::<{ 2 * LANES }>().0;
        for b in 0..n_panels(n) {
            let length = n - LANES * b;
            let from = b * padded(n);
            solve(&mut diagonals[from..][..length], &tables[from..][..length]);
        }
        without_mean(&mut diagonals[..n], 0.5);
        scatter(n, Shape::Open, diagonals, stream, line);
    }

    fn n_apply_work(n: usize) -> usize {
        2 * n_rows(n, n) + n_work(n) + (n + LANES).div_ceil(2 * LANES)
    }

    fn apply(&self, coefficients: &[f64], matrix: &[Row], out: &mut [Row], work: &mut [Row]) {
        let n = self.n;
        let (diagonals, work) = work.split_at_mut(n_rows(n, n));
        let (sum, work) = work.split_at_mut(n_rows(n, n));
        let (line, roots) = work.split_at_mut(n_work(n));
        // c_i, and zeros beyond the last one, which couples to nothing.
        let roots = &mut roots.as_flattened_mut()[..n + LANES];
        for (i, root) in roots.iter_mut().enumerate() {
            *root = if i < n { sqrt(((i + 1) * (n - 1 - i)) as f64) } else { 0.0 };
        }
        gather(n, Shape::Open, matrix, diagonals, line);
        without_mean(&mut diagonals[..n], 1.0);
        // By Horner's rule.
        let (last, others) = coefficients.split_last().expect("a coefficient");
        for (sum, x) in sum.iter_mut().zip(diagonals.iter()) {
            *sum = x.map(|x| last * x);
        }
        for c in others.iter().rev() {
            for b in 0..n_panels(n) {
                let length = n - LANES * b;
                let from = b * padded(n);
                of_laplacian(n, LANES * b, roots, &mut sum[from..][..length]);
                for (sum, x) in sum[from..][..length].iter_mut().zip(&diagonals[from..]) {
                    for (sum, x) in sum.iter_mut().zip(x) {
                        *sum = mul_add(*c, *x, *sum);
                    }
                }
            }
        }
        without_mean(&mut sum[..n], 0.5);
        scatter(n, Shape::Open, sum, out, line);
    }

    fn n_factors(n: usize) -> usize {
        n
    }

    fn write_factors(&self, factor: &mut dyn FnMut(f64) -> f64, table: &mut [f64]) {
        for (l, of_degree) in table[..self.n].iter_mut().enumerate() {
            *of_degree = if l == 0 { 0.0 } else { factor((l * (l + 1)) as f64) };
        }
    }

    fn n_filter_work(n: usize) -> usize {
        n_rows(n, n) + n_work(n) + n_filter_work(n).div_ceil(2 * LANES)
    }

    fn filter(&self, table: &[f64], matrix: &mut [Row], work: &mut [Row]) {
        let n = self.n;
        let (diagonals, work) = work.split_at_mut(n_rows(n, n));
        let (line, work) = work.split_at_mut(n_work(n));
        gather(n, Shape::Open, matrix, diagonals, line);
        for m in 0..n {
            let from = m / LANES * padded(n);
            filter(n, m, table, &mut diagonals[from..][..n - m], work.as_flattened_mut());
        }
        // The first diagonal by the halves of its elements, which are real.
        for row in &mut diagonals[..n] {
            (row[0], row[LANES]) = (0.5 * row[0], 0.0);
        }
        scatter(n, Shape::Open, diagonals, matrix, line);
    }
}

/// Takes from the first diagonal its part along the identity, and multiplies it by a number.
fn without_mean(first_panel: &mut [Row], factor: f64) {
    let mean = first_panel.iter().map(|row| row[0]).sum::<f64>() / first_panel.len() as f64;
    for row in first_panel {
        row[0] = factor * (row[0] - mean);
        row[LANES] = 0.0;
    }
}

/// Minus the Laplacian of eight diagonals, of which the first has the number `d`.
#[inline(always)]
fn of_laplacian(n: usize, d: usize, roots: &[f64], x: &mut [Row]) {
    let mut before = [0.0; 2 * LANES];
    let mut coupled_before = [0.0; LANES];
    for i in 0..x.len() {
        let (here, after) = (x[i], x.get(i + 1).copied().unwrap_or([0.0; 2 * LANES]));
        for l in 0..LANES {
            let on = on_diagonal(n, i, i + d + l);
            let coupled = roots[i] * roots[i + d + l];
            for l_part in [l, LANES + l] {
                let sum = mul_add(coupled_before[l], before[l_part], coupled * after[l_part]);
                x[i][l_part] = mul_add(on, here[l_part], -sum);
            }
            coupled_before[l] = coupled;
        }
        before = here;
    }
}

/// Solves eight tridiagonal systems by their factors.
#[inline(always)]
fn solve(x: &mut [Row], factors: &[Row]) {
    let mut before = [0.0; 2 * LANES];
    for (x, factor) in x.iter_mut().zip(factors) {
        for l in 0..LANES {
            before[l] = mul_add(factor[l], before[l], x[l]);
            before[LANES + l] = mul_add(factor[l], before[LANES + l], x[LANES + l]);
        }
        *x = before;
    }
    let (mut after, mut factor_after) = ([0.0; 2 * LANES], [0.0; 2 * LANES]);
    for (x, factor) in x.iter_mut().zip(factors).rev() {
        for l in 0..LANES {
            let pivot = factor[LANES + l];
            after[l] = mul_add(factor_after[l], after[l], pivot * x[l]);
            after[LANES + l] = mul_add(factor_after[l], after[LANES + l], pivot * x[LANES + l]);
        }
        *x = after;
        factor_after = *factor;
    }
}
