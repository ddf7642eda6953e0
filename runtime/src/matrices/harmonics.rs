//! Eigenvectors of the Laplacian of Hoppe and Yau, which take the place of the spherical harmonics: those along one
//! diagonal of a matrix are the eigenvectors of a symmetric tridiagonal matrix.
//!
//! The recurrence goes from one end, where an eigenvector grows, to the middle; the rest is the same but for a sign. It
//! grows by `2^N` and more, so that elements are made smaller on the way.
//!
//! Does not know: matrices.

use super::panels::{LANES, Row};
use crate::math::{mul_add, sqrt};

/// Elements that have grown beyond this are made smaller by [`SMALLER`], and those before them.
const GROWN: f64 = f64::from_bits((1023 + 300) << 52);
/// `2^-300`.
const SMALLER: f64 = f64::from_bits((1023 - 300) << 52);

/// `2 s (s + 1) - 2 m_i m_j`.
pub(super) fn on_diagonal(n: usize, i: usize, j: usize) -> f64 {
    let spin = |k: usize| 0.5 * (n as f64 - 1.0) - k as f64;
    // s (s + 1) = (n^2 - 1)/4
    0.5 * ((n * n) as f64 - 1.0) - 2.0 * spin(i) * spin(j)
}

/// `c_i c_j`, which couples the element `(i, j)` to the next one of the diagonal.
pub(super) fn beside_diagonal(n: usize, i: usize, j: usize) -> f64 {
    let square = |k: usize| ((k + 1) * (n - 1 - k)) as f64;
    sqrt(square(i) * square(j))
}

/// The eigenvalue of a degree.
fn eigenvalue(l: usize) -> f64 {
    (l * (l + 1)) as f64
}

/// Calls `visit` with the places along the diagonal `m` and the elements of the eigenvector of the degree `l` whose
/// sum of squares is `norm`; the first element is positive.
pub(super) fn harmonic(n: usize, (l, m): (usize, usize), norm: f64, mut visit: impl FnMut(usize, f64)) {
    let length = n - m;
    let parity = if (l - m).is_multiple_of(2) { 1.0 } else { -1.0 };
    // Place, element, how many places have it, and how often elements were made smaller.
    let walk = |visit: &mut dyn FnMut(usize, f64, f64, i32)| {
        let (mut before, mut value, mut n_smaller) = (0.0, 1.0, 0);
        for i in 0..length.div_ceil(2) {
            if i > 0 {
                let past = if i > 1 { beside_diagonal(n, i - 2, i - 2 + m) } else { 0.0 };
                let here = on_diagonal(n, i - 1, i - 1 + m) - eigenvalue(l);
                let next = (here * value - past * before) / beside_diagonal(n, i - 1, i - 1 + m);
                (before, value) = (value, next);
                if value.abs() > GROWN {
                    (before, value, n_smaller) = (before * SMALLER, value * SMALLER, n_smaller + 1);
                }
            }
            // An odd vector vanishes in its middle.
            let is_middle = 2 * i + 1 == length;
            let rounded = if is_middle && parity < 0.0 { 0.0 } else { value };
            visit(i, rounded, if is_middle { 1.0 } else { 2.0 }, n_smaller);
        }
    };
    let (mut square, mut n_all) = (0.0, 0);
    walk(&mut |_, value, weight, n_smaller| {
        if n_smaller > n_all {
            (square, n_all) = (square * SMALLER * SMALLER, n_smaller);
        }
        square += weight * value * value;
    });
    let scale = sqrt(norm / square);
    walk(&mut |i, value, weight, n_smaller| {
        let value = (n_smaller..n_all).fold(scale * value, |value, _| value * SMALLER);
        visit(i, value);
        if weight == 2.0 {
            visit(length - 1 - i, parity * value);
        }
    });
}

/// Numbers that [`filter`] needs room for.
pub(super) const fn n_filter_work(n: usize) -> usize {
    (N_LINES + 3 * LANES) * n.div_ceil(2)
}

/// Lines of half a diagonal that [`filter`] has: of the recurrence, even and odd parts, and their changes.
const N_LINES: usize = 11;

/// The recurrence of the eigenvectors along a diagonal.
struct Recurrence<'a> {
    /// Elements of the Laplacian on the diagonal, and the coupling to the next one with its reciprocal.
    on: &'a [f64],
    beside: &'a [f64],
    by_beside: &'a [f64],
    /// Number of elements up to the middle, and whether there is one in the middle.
    half: usize,
    has_middle: bool,
}

impl Recurrence<'_> {
    /// Writes the elements up to the middle of the eigenvectors of eight degrees, with the sums of squares of all
    /// elements; the first has any positive value.
    fn vectors(&self, eigenvalues: &[f64; LANES], vectors: &mut [[f64; LANES]]) -> [f64; LANES] {
        vectors[0] = [1.0; LANES];
        for i in 1..self.half {
            let past = if i > 1 { self.beside[i - 2] } else { 0.0 };
            let (here, by_beside) = (self.on[i - 1], self.by_beside[i - 1]);
            let (value, before) = (vectors[i - 1], if i > 1 { vectors[i - 2] } else { [0.0; LANES] });
            let mut next = [0.0; LANES];
            for l in 0..LANES {
                next[l] = ((here - eigenvalues[l]) * value[l] - past * before[l]) * by_beside;
            }
            vectors[i] = next;
            // A step grows by 2^24 at most.
            if i % 8 == 0 {
                for l in (0..LANES).filter(|l| next[*l].abs() > GROWN) {
                    vectors[..=i].iter_mut().for_each(|row| row[l] *= SMALLER);
                }
            }
        }
        let mut squares = [0.0; LANES];
        for (i, row) in vectors[..self.half].iter().enumerate() {
            let weight = if self.has_middle && i + 1 == self.half { 1.0 } else { 2.0 };
            for l in 0..LANES {
                squares[l] = mul_add(weight * row[l], row[l], squares[l]);
            }
        }
        squares
    }
}

/// Multiplies the harmonics of the diagonal `m` by the factors of their degrees; the diagonal is a lane of `rows`.
pub(super) fn filter(n: usize, m: usize, factors: &[f64], rows: &mut [Row], work: &mut [f64]) {
    let length = n - m;
    let lanes = [m % LANES, LANES + m % LANES];
    let half = length.div_ceil(2);
    let has_middle = !length.is_multiple_of(2);
    let (lines, vectors) = work[..n_filter_work(n)].split_at_mut(N_LINES * n.div_ceil(2));
    let (vectors, sums_of_lanes) = vectors.as_chunks_mut::<LANES>().0.split_at_mut(n.div_ceil(2));
    let mut sums_of_lanes = sums_of_lanes.chunks_mut(n.div_ceil(2)).map(|line| &mut line[..half]);
    let mut of_lanes = [(); 2].map(|()| sums_of_lanes.next().expect("a line"));
    let mut lines = lines.chunks_mut(n.div_ceil(2)).map(|line| &mut line[..half]);
    let mut line = || lines.next().expect("a line");
    let (on, beside, by_beside) = (line(), line(), line());
    // Even and odd parts, and their changes: real and imaginary parts.
    let mut parts = [[line(), line()], [line(), line()]];
    let mut changes = [[line(), line()], [line(), line()]];
    for i in 0..half {
        on[i] = on_diagonal(n, i, i + m);
        let is_last = i + 1 == length;
        beside[i] = if is_last { 0.0 } else { beside_diagonal(n, i, i + m) };
        by_beside[i] = if is_last { 0.0 } else { beside[i].recip() };
        let mirror = length - 1 - i;
        for (part, lane) in lanes.into_iter().enumerate() {
            let (x, y) = (rows[i][lane], rows[mirror][lane]);
            // An odd vector vanishes in its middle.
            (parts[0][part][i], parts[1][part][i]) = if mirror == i { (x, 0.0) } else { (x + y, x - y) };
        }
    }
    let recurrence = Recurrence { on, beside, by_beside, half, has_middle };
    for parity in 0..2 {
        let (parts, changes) = (&mut parts[parity], &mut changes[parity]);
        of_lanes.iter_mut().for_each(|line| line.fill([0.0; LANES]));
        let mut first = m + parity;
        while first < n {
            // Degrees beyond the last one are the last one again, and change nothing.
            let degree = |lane: usize| Some(first + 2 * lane).filter(|l| *l < n);
            let change: [f64; LANES] =
                core::array::from_fn(|lane| degree(lane).map_or(0.0, |l| factors[l] - 1.0));
            let eigenvalues: [f64; LANES] =
                core::array::from_fn(|lane| eigenvalue(degree(lane).unwrap_or(first)));
            first += 2 * LANES;
            if change.iter().all(|x| *x == 0.0) {
                continue;
            }
            let squares = recurrence.vectors(&eigenvalues, vectors);
            let mut sums = [[0.0; LANES]; 2];
            for (i, row) in vectors[..half].iter().enumerate() {
                for part in 0..2 {
                    for l in 0..LANES {
                        sums[part][l] = mul_add(row[l], parts[part][i], sums[part][l]);
                    }
                }
            }
            for sum in &mut sums {
                for l in 0..LANES {
                    sum[l] *= change[l] / squares[l];
                }
            }
            for (part, line) in of_lanes.iter_mut().enumerate() {
                for (of_element, row) in line.iter_mut().zip(vectors.iter()) {
                    for l in 0..LANES {
                        of_element[l] = mul_add(sums[part][l], row[l], of_element[l]);
                    }
                }
            }
        }
        for (change, line) in changes.iter_mut().zip(&of_lanes) {
            for (x, of_element) in change.iter_mut().zip(line.iter()) {
                *x = of_element.iter().sum();
            }
        }
    }
    for i in 0..half {
        let mirror = length - 1 - i;
        for (part, lane) in lanes.into_iter().enumerate() {
            let (even, odd) = (changes[0][part][i], changes[1][part][i]);
            if mirror == i {
                rows[i][lane] += even;
            } else {
                rows[i][lane] += even + odd;
                rows[mirror][lane] += even - odd;
            }
        }
    }
}
