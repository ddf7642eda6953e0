//! The flat torus: Zeitlin's su(N) in the sine basis, in which the Laplacian is diagonal.
//!
//! ```text
//! W = sum over m of omega_m J_m,   J_m = exp(2 pi i m1 m2/N) g^m1 h^m2,
//! g = diag(1, e, .., e^(N-1)),   e = exp(4 pi i/N),   h_(k, k+1 mod N) = 1
//! ```
//!
//! A matrix `J_m` has one diagonal, the one number `m2`, and a wave of `m1` turns along it. The coefficients along a
//! diagonal are its discrete Fourier transform, but for phases that the Laplacian does not see.
//!
//! Does not know: steps, tables of structure constants.

use super::Error;
use super::Laplacian;
use super::dft::{Dft, roots_of_unity};
use super::diagonals::{Shape, gather, n_work, scatter};
use super::panels::{LANES, LARGEST, Row, element, n_panels, n_rows, padded, set_element};
use super::sealed::Spectral;
use super::stream::Stream;
use crate::math::mul_add;

/// A fluid on the torus in su(N), `N` odd: `zeitlin(N)` of the model language.
///
/// The state of the generated models `zeitlin_euler_N` are the coefficients `omega_m` of the half set
/// `m1 > 0, or m1 = 0 and m2 > 0` in lexicographic order, real part and imaginary part.
/// [`set_modes`](Self::set_modes) and [`modes`](Self::modes) go to the matrix and back.
///
/// ```text
/// W' = i N/(4 pi) [P, W],   psi_m = omega_m/|m|^2,   E = tr(P W)/(2 N)
/// ```
///
/// With another [`Stream`], `psi_m = scale omega_m/(shift + |m|^2)`.
///
/// # Source
///
/// Zeitlin, Finite-mode analogs of 2D ideal hydrodynamics (1991).
#[derive(Clone, Copy, Debug)]
pub struct Torus<S> {
    n: usize,
    dft: Dft,
    /// Factors of the coefficients, then roots of unity.
    tables: S,
}

impl<S: AsRef<[f64]> + AsMut<[f64]>> Torus<S> {
    /// Numbers that the tables of a size take.
    #[must_use]
    pub const fn storage(n: usize) -> usize {
        LANES * n_rows(n, Shape::Cyclic.n_diagonals(n)) + 2 * n
    }

    /// The torus with matrices of the odd size `n` for an ideal fluid; `tables` have room for
    /// [`storage`](Self::storage) numbers.
    ///
    /// # Errors
    ///
    /// [`Error::MatrixSize`], [`Error::Storage`].
    pub fn new(n: usize, tables: S) -> Result<Self, Error> {
        Self::with_stream(n, Stream::ideal(), tables)
    }

    /// The torus with matrices of the odd size `n` for a fluid with that stream function; `tables` have room for
    /// [`storage`](Self::storage) numbers.
    ///
    /// # Errors
    ///
    /// [`Error::MatrixSize`], [`Error::Number`], [`Error::Storage`].
    pub fn with_stream(n: usize, stream: Stream, mut tables: S) -> Result<Self, Error> {
        if !(3..=LARGEST).contains(&n) || n.is_multiple_of(2) {
            return Err(Error::MatrixSize { n, allowed: "an odd number from 3 to 4095" });
        }
        stream.validate()?;
        let (given, needed) = (tables.as_ref().len(), Self::storage(n));
        let Some(numbers) = tables.as_mut().get_mut(..needed) else {
            return Err(Error::Storage { given, needed });
        };
        let dft = Dft::new(n);
        let (factors, roots) = numbers.split_at_mut(needed - 2 * n);
        roots_of_unity(roots);
        write_factors(n, &dft, &mut |square| stream.scale / (stream.shift + square), factors);
        Ok(Self { n, dft, tables })
    }

    /// Number of real numbers that a state has: `n^2 - 1`.
    #[must_use]
    pub const fn n_modes(&self) -> usize {
        self.n * self.n - 1
    }

    /// Writes the matrix of the vorticity with the coefficients `modes`, in the order of the models `zeitlin_euler_N`.
    ///
    /// # Panics
    ///
    /// If there are not `n^2 - 1` modes, or if the matrix does not have the size of the torus.
    pub fn set_modes(&self, modes: &[f64], vorticity: super::MatrixMut<'_>) {
        let n = self.n;
        assert_eq!((modes.len(), vorticity.n()), (self.n_modes(), n));
        let largest = (n / 2) as isize;
        for m2 in 0..=largest {
            for k in 0..n {
                let mut sum = [0.0; 2];
                for m1 in -largest..=largest {
                    if (m1, m2) == (0, 0) {
                        continue;
                    }
                    let [re, im] = coefficient(n, modes, (m1, m2));
                    let [cosine, sine] = self.phase(m1, m2, k);
                    sum[0] += re * cosine - im * sine;
                    sum[1] += re * sine + im * cosine;
                }
                // The number m2 is not negative.
                let column = (k + m2 as usize) % n;
                if column == k {
                    sum[1] = 0.0;
                }
                set_element(n, vorticity.rows, (k, column), sum);
                set_element(n, vorticity.rows, (column, k), [sum[0], -sum[1]]);
            }
        }
    }

    /// The coefficients of a Hermitian matrix, in the order of the models `zeitlin_euler_N`.
    ///
    /// # Panics
    ///
    /// If there is not room for `n^2 - 1` modes, or if the matrix does not have the size of the torus.
    pub fn modes(&self, matrix: super::MatrixRef<'_>, modes: &mut [f64]) {
        let n = self.n;
        assert_eq!((modes.len(), matrix.n()), (self.n_modes(), n));
        let largest = (n / 2) as isize;
        for m1 in 0..=largest {
            for m2 in (if m1 == 0 { 1 } else { -largest })..=largest {
                let at = 2 * place(n, (m1, m2));
                modes[at..at + 2].copy_from_slice(&self.mode((m1, m2), matrix));
            }
        }
    }

    /// Adds to the vorticity the wave `m` of the half set with the coefficient `omega`, and its conjugate.
    ///
    /// # Panics
    ///
    /// Unless `m` is in the half set of the size `n`, and if the matrix does not have the size of the torus.
    pub fn add_mode(&self, (m1, m2): (isize, isize), omega: [f64; 2], vorticity: super::MatrixMut<'_>) {
        let n = self.n;
        assert!(self.is_mode((m1, m2)) && vorticity.n() == n);
        for k in 0..n {
            let column = (k as isize + m2).rem_euclid(n as isize) as usize;
            let [cosine, sine] = self.phase(m1, m2, k);
            let re = omega[0] * cosine - omega[1] * sine;
            let im = omega[0] * sine + omega[1] * cosine;
            let [old_re, old_im] = element(n, vorticity.rows, k, column);
            // On the diagonal the wave and its conjugate are in the same place.
            if column == k {
                set_element(n, vorticity.rows, (k, k), [old_re + 2.0 * re, 0.0]);
            } else {
                let new = [old_re + re, old_im + im];
                set_element(n, vorticity.rows, (k, column), new);
                set_element(n, vorticity.rows, (column, k), [new[0], -new[1]]);
            }
        }
    }

    /// The coefficient of a wave of the half set in a Hermitian matrix.
    ///
    /// # Panics
    ///
    /// As [`add_mode`](Self::add_mode).
    #[must_use]
    pub fn mode(&self, (m1, m2): (isize, isize), matrix: super::MatrixRef<'_>) -> [f64; 2] {
        let n = self.n;
        assert!(self.is_mode((m1, m2)) && matrix.n() == n);
        let mut sum = [0.0; 2];
        for k in 0..n {
            let column = (k as isize + m2).rem_euclid(n as isize) as usize;
            let [re, im] = element(n, matrix.rows, k, column);
            let [cosine, sine] = self.phase(m1, m2, k);
            sum[0] += re * cosine + im * sine;
            sum[1] += im * cosine - re * sine;
        }
        sum.map(|x| x / n as f64)
    }

    /// Whether a wave is in the half set.
    const fn is_mode(&self, (m1, m2): (isize, isize)) -> bool {
        let largest = (self.n / 2) as isize;
        (m1 > 0 || m1 == 0 && m2 > 0) && m1 <= largest && m2 <= largest && m2 >= -largest
    }

    /// The element `(k, k + m2)` of `J_m`: `exp(2 pi i m1 (m2 + 2 k)/N)`.
    fn phase(&self, m1: isize, m2: isize, k: usize) -> [f64; 2] {
        let n = self.n as isize;
        let turn = (m1 * (m2 + 2 * k as isize)).rem_euclid(n) as usize;
        let roots = &self.tables.as_ref()[Self::storage(self.n) - 2 * self.n..];
        [roots[2 * turn], roots[2 * turn + 1]]
    }
}

/// The number of a wave of the half set.
fn place(n: usize, (m1, m2): (isize, isize)) -> usize {
    let largest = (n / 2) as isize;
    let place = if m1 == 0 { m2 - 1 } else { largest + (m1 - 1) * (2 * largest + 1) + m2 + largest };
    place as usize
}

/// The coefficient of any wave but zero.
fn coefficient(n: usize, modes: &[f64], (m1, m2): (isize, isize)) -> [f64; 2] {
    let is_of_half_set = m1 > 0 || m1 == 0 && m2 > 0;
    let (wave, sign) = if is_of_half_set { ((m1, m2), 1.0) } else { ((-m1, -m2), -1.0) };
    let at = 2 * place(n, wave);
    [modes[at], sign * modes[at + 1]]
}

impl<S: AsRef<[f64]> + AsMut<[f64]>> Laplacian for Torus<S> {
    fn n(&self) -> usize {
        self.n
    }

    fn rate(&self) -> f64 {
        self.n as f64 / (4.0 * core::f64::consts::PI)
    }

    fn area(&self) -> f64 {
        1.0
    }
}

/// Writes what each wave is multiplied by, a function of `|m|^2`, in the layout of the diagonals; constants go.
fn write_factors(n: usize, dft: &Dft, factor: &mut dyn FnMut(f64) -> f64, table: &mut [f64]) {
    for (at, factors) in table.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        // e = exp(4 pi i/N): the frequency is 2 m1, the wave number the centred half of it.
        if at % padded(n) >= n {
            factors.fill(0.0);
            continue;
        }
        let frequency = dft.frequency(at % padded(n));
        let half = if frequency.is_multiple_of(2) { frequency / 2 } else { (frequency + n) / 2 };
        let m1 = if half > n / 2 { n - half } else { half };
        for (lane, of_wave) in factors.iter_mut().enumerate() {
            let m2 = at / padded(n) * LANES + lane;
            let square = (m1 * m1 + m2 * m2) as f64;
            // The first diagonal by halves, 1/n for the inverse transform.
            let share = if m2 == 0 { 0.5 } else { 1.0 };
            let is_wave = square > 0.0 && m2 <= n / 2;
            *of_wave = if is_wave { share * factor(square) / n as f64 } else { 0.0 };
        }
    }
}

impl<S: AsRef<[f64]> + AsMut<[f64]>> Torus<S> {
    /// Multiplies the waves of diagonals that were gathered, and writes their matrix.
    fn scale_waves(&self, factors: &[f64], diagonals: &mut [Row], matrix: &mut [Row], work: &mut [Row]) {
        let n = self.n;
        let (butterfly, line) = work.split_at_mut(n);
        let (factors, roots) = (factors.as_chunks::<LANES>().0, &self.tables.as_ref()[..Self::storage(n)]);
        let roots = &roots[roots.len() - 2 * n..];
        for b in 0..n_panels(Shape::Cyclic.n_diagonals(n)) {
            let panel = &mut diagonals[b * padded(n)..][..n];
            self.dft.forward(panel, roots, butterfly);
            for (row, factors) in panel.iter_mut().zip(&factors[b * padded(n)..]) {
                for lane in 0..LANES {
                    row[lane] *= factors[lane];
                    row[LANES + lane] *= factors[lane];
                }
            }
            self.dft.inverse(panel, roots, butterfly);
        }
        scatter(n, Shape::Cyclic, diagonals, matrix, line);
    }
}

impl<S: AsRef<[f64]> + AsMut<[f64]>> Spectral for Torus<S> {
    fn n_work(n: usize) -> usize {
        n_rows(n, Shape::Cyclic.n_diagonals(n)) + n + n_work(n)
    }

    fn invert(&self, vorticity: &[Row], stream: &mut [Row], work: &mut [Row]) {
        let n = self.n;
        let (diagonals, work) = work.split_at_mut(n_rows(n, Shape::Cyclic.n_diagonals(n)));
        gather(n, Shape::Cyclic, vorticity, diagonals, &mut work[n..]);
        let factors = &self.tables.as_ref()[..Self::n_factors(n)];
        self.scale_waves(factors, diagonals, stream, work);
    }

    fn n_apply_work(n: usize) -> usize {
        Self::n_work(n) + Self::n_factors(n).div_ceil(2 * LANES)
    }

    fn apply(&self, coefficients: &[f64], matrix: &[Row], out: &mut [Row], work: &mut [Row]) {
        let n = self.n;
        let (work, table) = work.split_at_mut(Self::n_work(n));
        let table = &mut table.as_flattened_mut()[..Self::n_factors(n)];
        let value = |square: f64| coefficients.iter().rev().fold(0.0, |sum, c| mul_add(sum, square, *c));
        write_factors(n, &self.dft, &mut { value }, table);
        let (diagonals, work) = work.split_at_mut(n_rows(n, Shape::Cyclic.n_diagonals(n)));
        gather(n, Shape::Cyclic, matrix, diagonals, &mut work[n..]);
        self.scale_waves(table, diagonals, out, work);
    }

    fn n_factors(n: usize) -> usize {
        LANES * n_rows(n, Shape::Cyclic.n_diagonals(n))
    }

    fn write_factors(&self, factor: &mut dyn FnMut(f64) -> f64, table: &mut [f64]) {
        write_factors(self.n, &self.dft, factor, table);
    }

    fn n_filter_work(n: usize) -> usize {
        Self::n_work(n)
    }

    fn filter(&self, table: &[f64], matrix: &mut [Row], work: &mut [Row]) {
        let n = self.n;
        let (diagonals, work) = work.split_at_mut(n_rows(n, Shape::Cyclic.n_diagonals(n)));
        gather(n, Shape::Cyclic, matrix, diagonals, &mut work[n..]);
        self.scale_waves(table, diagonals, matrix, work);
    }
}
