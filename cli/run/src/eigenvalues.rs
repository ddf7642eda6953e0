//! Eigenvalues of a square matrix.
//!
//! Does not know: where a matrix comes from.

use nalgebra::DMatrix;
use nalgebra::linalg::Schur;

/// Most steps of an attempt for each row; two or three suffice for nearly all matrices.
const STEPS: usize = 60;
/// Shifts of further attempts, beside the size of the matrix.
const SHIFTS: [f64; 4] = [0.0, 0.73, -1.19, 2.41];

/// Eigenvalues, real and imaginary part, by double steps of QR (Francis 1961). None where they do not converge.
///
/// Steps are the same again and again on some matrices, and what couples two blocks next to zeros on the diagonal is
/// never small beside these: such a matrix is tried with another one added, a multiple of the identity.
pub(crate) fn eigenvalues(matrix: &DMatrix<f64>) -> Option<Vec<[f64; 2]>> {
    let n = matrix.nrows();
    if n == 0 {
        return Some(Vec::new());
    }
    let size = matrix.amax();
    SHIFTS.iter().find_map(|by| {
        let shift = by * size;
        let schur = Schur::try_new(matrix + DMatrix::identity(n, n) * shift, f64::EPSILON, STEPS * n)?;
        Some(schur.complex_eigenvalues().iter().map(|z| [z.re - shift, z.im]).collect())
    })
}

/// The largest real part first.
pub(crate) fn sort(eigenvalues: &mut [[f64; 2]]) {
    eigenvalues.sort_by(|x, y| y[0].total_cmp(&x[0]).then(y[1].total_cmp(&x[1])));
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(matrix: &DMatrix<f64>) -> Vec<[f64; 2]> {
        let mut all = eigenvalues(matrix).expect("eigenvalues");
        sort(&mut all);
        all
    }

    fn assert_close(found: &[[f64; 2]], expected: &[[f64; 2]], tolerance: f64) {
        assert_eq!(found.len(), expected.len());
        for (z, w) in found.iter().zip(expected) {
            assert!((z[0] - w[0]).hypot(z[1] - w[1]) < tolerance, "{found:?} beside {expected:?}");
        }
    }

    #[test]
    fn eigenvalues_of_blocks_are_those_of_each() {
        let matrix = DMatrix::from_row_slice(3, 3, &[1.0, 2.0, 7.0, -2.0, 1.0, 5.0, 0.0, 0.0, -3.0]);
        assert_close(&found(&matrix), &[[1.0, 2.0], [1.0, -2.0], [-3.0, 0.0]], 1e-14);
        assert!(found(&DMatrix::zeros(0, 0)).is_empty());
        assert_close(&found(&DMatrix::zeros(4, 4)), &[[0.0; 2]; 4], 1e-300);
    }

    /// A step of QR maps a permutation in a circle to itself; six and eight places do not converge without a shift.
    #[test]
    fn matrices_that_steps_do_not_change_have_eigenvalues() {
        for n in 3..9 {
            let circle = DMatrix::from_fn(n, n, |i, j| if i == (j + 1) % n { 1.0 } else { 0.0 });
            let found = found(&circle);
            for k in 0..n {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / n as f64).sin_cos();
                // A rounding for each of some two hundred products.
                let is_root = |z: &&[f64; 2]| (z[0] - cos).hypot(z[1] - sin) < 200.0 * f64::EPSILON;
                assert_eq!(found.iter().filter(is_root).count(), 1, "{n}: {found:?}");
            }
        }
    }
}
