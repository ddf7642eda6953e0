//! Dense elimination on a handful of rows, over any scalar.
//!
//! Does not know: what rows and columns stand for.

use hamel_runtime::Real;

/// A pivot below this part of the largest entry of the matrix counts as zero: far above the rounding errors of 31
/// digits, far below any coefficient that means something.
const NOTHING: f64 = 1e-18;

/// Rows `a . x = b`, eliminated with complete pivoting.
pub(super) struct Reduced<R> {
    /// Row and column of each pivot.
    pivots: Vec<(usize, usize)>,
    rows: Vec<Vec<R>>,
    n: usize,
}

impl<R: Real> Reduced<R> {
    /// # Shapes
    /// rows: `[r][n + 1]`, the right side last.
    pub(super) fn new(mut rows: Vec<Vec<R>>, n: usize) -> Reduced<R> {
        let size = |rows: &[Vec<R>]| {
            rows.iter().flat_map(|row| row[..n].iter()).map(|x| x.magnitude()).fold(0.0, f64::max)
        };
        let largest = size(&rows);
        let mut pivots: Vec<(usize, usize)> = Vec::new();
        loop {
            let free_rows = (0..rows.len()).filter(|i| pivots.iter().all(|(row, _)| row != i));
            let mut best = (NOTHING * largest, None);
            for i in free_rows {
                for j in (0..n).filter(|j| pivots.iter().all(|(_, column)| column != j)) {
                    let size = rows[i][j].magnitude();
                    if size > best.0 {
                        best = (size, Some((i, j)));
                    }
                }
            }
            let (_, Some((i, j))) = best else { break };
            let scale = rows[i][j].recip();
            rows[i].iter_mut().for_each(|x| *x *= scale);
            rows[i][j] = R::ONE;
            let pivot = rows[i].clone();
            for (k, row) in rows.iter_mut().enumerate() {
                if k == i || row[j].magnitude() == 0.0 {
                    continue;
                }
                let factor = row[j];
                row.iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * *p);
                row[j] = R::ZERO;
            }
            pivots.push((i, j));
        }
        Reduced { pivots, rows, n }
    }

    /// Number of independent rows.
    pub(super) fn rank(&self) -> usize {
        self.pivots.len()
    }

    /// The solution whose other components are those of `free`.
    pub(super) fn solution(&self, free: &[R]) -> Vec<R> {
        let mut x = free.to_vec();
        for (row, column) in &self.pivots {
            let others = (0..self.n).filter(|j| self.pivots.iter().all(|(_, column)| column != j));
            x[*column] = others.fold(self.rows[*row][self.n], |sum, j| sum - self.rows[*row][j] * free[j]);
        }
        x
    }
}
