//! The diagonals of a Hermitian matrix side by side, so that what is done along each is done to vectors of them.
//!
//! The row `j` of the diagonals has the elements `(j, j)`, `(j, j + 1)`, .. of the matrix: of all columns up to the
//! last one (sphere), or of half of them, going on at the first one (torus). The others follow from the symmetry.
//!
//! Does not know: what is done along a diagonal.

use super::panels::{LANES, Row, adjoint, block, block_mut, n_panels, padded};

/// Which elements diagonals have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shape {
    /// The diagonal `d` ends at the last column: it has `n - d` elements.
    Open,
    /// Columns are counted modulo `n`: `(n + 1)/2` diagonals of `n` elements.
    Cyclic,
}

impl Shape {
    /// Number of diagonals.
    pub(super) const fn n_diagonals(self, n: usize) -> usize {
        match self {
            Shape::Open => n,
            Shape::Cyclic => n.div_ceil(2),
        }
    }

    /// Panels of the row `j` of the diagonals in which there are elements.
    const fn n_panels_of_row(self, n: usize, j: usize) -> usize {
        match self {
            Shape::Open => n_panels(n - j),
            Shape::Cyclic => n_panels(n.div_ceil(2)),
        }
    }
}

/// Rows that [`gather`] and [`scatter`] need room for.
pub(super) const fn n_work(n: usize) -> usize {
    line_length(n).div_ceil(LANES)
}

/// Real or imaginary parts of a row of the matrix, twice.
const fn line_length(n: usize) -> usize {
    // Reading begins at n at most, and goes on for the row with its padding.
    LANES * (2 * n + LANES).div_ceil(LANES)
}

/// Two lines of zeros.
fn lines(n: usize, work: &mut [Row]) -> (&mut [f64], &mut [f64]) {
    let lines = &mut work.as_flattened_mut()[..2 * line_length(n)];
    lines.fill(0.0);
    lines.split_at_mut(line_length(n))
}

/// Eight numbers of a line, or of a row. The length is constant, so that they are copied without a call.
#[inline(always)]
fn eight(line: &[f64], at: usize) -> &[f64; LANES] {
    line[at..].first_chunk().expect("eight numbers")
}

#[inline(always)]
fn set_eight(line: &mut [f64], at: usize, numbers: &[f64; LANES]) {
    *line[at..].first_chunk_mut().expect("eight numbers") = *numbers;
}

/// Reads the diagonals of a matrix. What lies beyond the end of a diagonal is zero (open), or any element (cyclic).
pub(super) fn gather(n: usize, shape: Shape, matrix: &[Row], diagonals: &mut [Row], work: &mut [Row]) {
    let (re, im) = lines(n, work);
    for j in 0..n {
        let first = if shape == Shape::Open { j / LANES } else { 0 };
        for b in first..n_panels(n) {
            let row = &matrix[b * padded(n) + j];
            set_eight(re, LANES * b, eight(row, 0));
            set_eight(im, LANES * b, eight(row, LANES));
        }
        if shape == Shape::Cyclic {
            for b in 0..n_panels(shape.n_diagonals(n)) {
                let row = &matrix[b * padded(n) + j];
                set_eight(re, n + LANES * b, eight(row, 0));
                set_eight(im, n + LANES * b, eight(row, LANES));
            }
        }
        for b in 0..shape.n_panels_of_row(n, j) {
            let row = &mut diagonals[b * padded(n) + j];
            set_eight(row, 0, eight(re, j + LANES * b));
            set_eight(row, LANES, eight(im, j + LANES * b));
        }
    }
}

/// Writes the Hermitian matrix whose diagonals are given, the first one by the halves of its elements; what lies beyond
/// the end of a diagonal has to be zero.
pub(super) fn scatter(n: usize, shape: Shape, diagonals: &[Row], matrix: &mut [Row], work: &mut [Row]) {
    let (re, im) = lines(n, work);
    // Columns of the last panel that there are.
    let is_column: [f64; LANES] =
        core::array::from_fn(|l| if LANES * (n_panels(n) - 1) + l < n { 1.0 } else { 0.0 });
    for j in 0..n {
        // The element (j, j + d) at n + d, and at d where columns go on at the first one.
        for b in 0..shape.n_panels_of_row(n, j) {
            let row = &diagonals[b * padded(n) + j];
            if shape == Shape::Cyclic {
                set_eight(re, LANES * b, eight(row, 0));
                set_eight(im, LANES * b, eight(row, LANES));
            }
        }
        for b in 0..shape.n_panels_of_row(n, j) {
            let row = &diagonals[b * padded(n) + j];
            set_eight(re, n + LANES * b, eight(row, 0));
            set_eight(im, n + LANES * b, eight(row, LANES));
        }
        for b in 0..n_panels(n) {
            let row = &mut matrix[b * padded(n) + j];
            set_eight(row, 0, eight(re, n - j + LANES * b));
            set_eight(row, LANES, eight(im, n - j + LANES * b));
        }
        let row = &mut matrix[(n_panels(n) - 1) * padded(n) + j];
        for l in 0..LANES {
            row[l] *= is_column[l];
            row[LANES + l] *= is_column[l];
        }
    }
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            let other = adjoint(block(n, matrix, b, a));
            let sum = block_mut(n, matrix, a, b);
            for i in 0..LANES {
                for l in 0..2 * LANES {
                    sum[i][l] += other[i][l];
                }
            }
            if a != b {
                let sum = *sum;
                *block_mut(n, matrix, b, a) = adjoint(&sum);
            }
        }
    }
}
