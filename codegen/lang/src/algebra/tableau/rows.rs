//! Rows of linear equations over expressions, and the steps of their elimination.
//!
//! Deliberately does not know: in which order steps are taken, what rows and columns mean.

use std::cmp::Reverse;

use hamel_expr::{ExprId, Graph};

use super::cofactors::{adjugate, determinant};
use super::grade::{Grade, Judge};

/// An entry that is divided by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cell {
    /// Its row.
    pub row: usize,
    /// Its column.
    pub column: usize,
    /// How good it is to divide by.
    pub grade: Grade,
}

/// Which of equally graded cells is taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tie {
    /// That of the fewest nodes; of these the first, row by row.
    Smallest,
    /// The first, row by row.
    First,
    /// The first row of the last column.
    LastColumn,
}

/// Rows of expressions, all of one length: coefficients of unknowns, then right-hand sides.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tableau {
    rows: Vec<Vec<ExprId>>,
}

impl Tableau {
    /// A tableau of these rows.
    pub fn new(rows: Vec<Vec<ExprId>>) -> Tableau {
        Tableau { rows }
    }

    /// The rows.
    pub fn rows(&self) -> &[Vec<ExprId>] {
        &self.rows
    }

    /// The rows, taken out.
    pub fn into_rows(self) -> Vec<Vec<ExprId>> {
        self.rows
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.rows.first().map_or(0, Vec::len)
    }

    /// Exchanges two rows.
    pub fn swap_rows(&mut self, a: usize, b: usize) {
        self.rows.swap(a, b);
    }

    /// Replaces entries that are seen to vanish by zero.
    pub fn cancel_zeros(&mut self, g: &mut Graph) {
        for entry in self.rows.iter_mut().flatten() {
            *entry = g.cancel_zero(*entry);
        }
    }

    /// The best of some cells to divide by; none where all of them vanish identically.
    pub fn best(
        &self,
        g: &mut Graph,
        judge: &Judge<'_>,
        tie: Tie,
        cells: impl IntoIterator<Item = (usize, usize)>,
    ) -> Option<Cell> {
        let mut best = None;
        for (row, column) in cells {
            let Some((grade, size)) = judge.grade(g, self.rows[row][column]) else { continue };
            let rank = match tie {
                Tie::Smallest => (grade, size, Reverse(0), row, column),
                Tie::First => (grade, 0, Reverse(0), row, column),
                Tie::LastColumn => (grade, 0, Reverse(column), row, column),
            };
            best = Some(
                best.map_or(rank, |known: (Grade, usize, Reverse<usize>, usize, usize)| known.min(rank)),
            );
        }
        best.map(|(grade, _, _, row, column)| Cell { row, column, grade })
    }

    /// Makes an entry one and all others of its column zero: `r_i - r_ik/r_kk r_k`.
    pub fn eliminate(&mut self, g: &mut Graph, (row, column): (usize, usize)) {
        let inverse = g.powi(self.rows[row][column], -1);
        self.map_row(row, |_, entry| g.mul(entry, inverse));
        let others: Vec<usize> = (0..self.rows.len()).filter(|i| *i != row).collect();
        self.take_from(g, (row, column), &others);
    }

    /// Writes the entries of a row otherwise, each by its column and value.
    pub fn map_row(&mut self, row: usize, mut written: impl FnMut(usize, ExprId) -> ExprId) {
        self.rows[row].iter_mut().enumerate().for_each(|(column, entry)| *entry = written(column, *entry));
    }

    /// Takes multiples of a row, whose entry in a column is one, from others: `r_i - r_ik r_k`. The factors `r_ik`, by
    /// the order of `others`.
    pub fn take_from(
        &mut self,
        g: &mut Graph,
        (row, column): (usize, usize),
        others: &[usize],
    ) -> Vec<ExprId> {
        let pivot_row = self.rows[row].clone();
        let mut factors = Vec::with_capacity(others.len());
        for i in others {
            let factor = self.rows[*i][column];
            factors.push(factor);
            if factor == g.zero() {
                continue;
            }
            for (entry, pivot) in self.rows[*i].iter_mut().zip(&pivot_row) {
                if *pivot != g.zero() {
                    let product = g.mul(factor, *pivot);
                    let reduced = g.sub(*entry, product);
                    *entry = g.cancel_zero(reduced);
                }
            }
        }
        factors
    }

    /// Makes a column zero in all rows but one, without a division: `r_kk r_i - r_ik r_k`.
    pub fn cross_out(&mut self, g: &mut Graph, (row, column): (usize, usize)) {
        let pivot_row = self.rows[row].clone();
        for (i, other) in self.rows.iter_mut().enumerate() {
            let factor = other[column];
            if i == row || factor == g.zero() {
                continue;
            }
            for (entry, pivot) in other.iter_mut().zip(&pivot_row) {
                let (kept, taken) = (g.mul(*entry, pivot_row[column]), g.mul(*pivot, factor));
                let difference = g.sub(kept, taken);
                *entry = g.cancel_zero(difference);
            }
        }
    }

    /// Takes a row out.
    pub fn remove_row(&mut self, row: usize) {
        self.rows.remove(row);
    }

    /// Keeps the rows whose entry in a column is seen to vanish.
    pub fn retain_without(&mut self, g: &mut Graph, column: usize) {
        self.rows.retain_mut(|row| {
            row[column] = g.cancel_zero(row[column]);
            row[column] == g.zero()
        });
    }

    /// Makes a block of rows and columns the identity, and these columns zero in all other rows, by a division by the
    /// determinant of the block alone, which is returned; none where it is seen to vanish.
    ///
    /// # Shapes
    /// As many `rows` as `columns`; row `i` is solved for column `i`.
    pub fn eliminate_together(&mut self, g: &mut Graph, rows: &[usize], columns: &[usize]) -> Option<ExprId> {
        let square: Vec<Vec<ExprId>> =
            rows.iter().map(|row| columns.iter().map(|column| self.rows[*row][*column]).collect()).collect();
        let divisor = determinant(g, &square);
        let divisor = g.without_idle_symbols(divisor, None);
        if divisor == g.zero() {
            return None;
        }
        let inverse = g.powi(divisor, -1);
        let made: Vec<Vec<ExprId>> = (adjugate(g, &square).iter().enumerate())
            .map(|(i, weights)| {
                let entries =
                    (0..self.width()).map(|column| match columns.iter().position(|c| *c == column) {
                        Some(at) if at == i => g.one(),
                        Some(_) => g.zero(),
                        None => {
                            let along: Vec<ExprId> = rows.iter().map(|row| self.rows[*row][column]).collect();
                            let sum = g.dot(weights, &along);
                            let sum = g.cancel_zero(sum);
                            g.mul(sum, inverse)
                        }
                    });
                entries.collect()
            })
            .collect();
        for (row, own) in rows.iter().zip(made) {
            self.rows[*row] = own;
        }
        for (row, column) in rows.iter().zip(columns) {
            // The other rows of the block have a zero there.
            self.eliminate(g, (*row, *column));
        }
        Some(divisor)
    }

    /// A basis of the `c` with `rows c = 0`, and the columns whose unit vectors complete it: row by row, by the best
    /// cell of each.
    pub fn kernel(
        mut self,
        g: &mut Graph,
        judge: &Judge<'_>,
        width: usize,
    ) -> (Vec<Vec<ExprId>>, Vec<usize>) {
        self.cancel_zeros(g);
        let mut pivots = Vec::new();
        for row in 0..self.rows.len() {
            let cells = (0..width).map(|column| (row, column));
            let Some(cell) = self.best(g, judge, Tie::Smallest, cells) else { continue };
            self.eliminate(g, (row, cell.column));
            pivots.push((row, cell.column));
        }
        let mut vectors = Vec::new();
        for free in (0..width).filter(|k| pivots.iter().all(|(_, column)| column != k)) {
            let mut vector = vec![g.zero(); width];
            vector[free] = g.one();
            for &(row, column) in &pivots {
                vector[column] = g.neg(self.rows[row][free]);
            }
            vectors.push(vector);
        }
        let mut others: Vec<usize> = pivots.into_iter().map(|(_, column)| column).collect();
        others.sort_unstable();
        (vectors, others)
    }

    /// Rows of the same span, with a one alone in its column in as many of them as divisions by numbers make.
    pub fn tidied(mut self, g: &mut Graph) -> Vec<Vec<ExprId>> {
        let mut open: Vec<usize> = (0..self.rows.len()).collect();
        for column in 0..self.width() {
            let is_number = |i: &usize| {
                let entry = self.rows[*i][column];
                entry != g.zero() && g.as_rational(entry).is_some()
            };
            if let Some(row) = open.iter().copied().find(is_number) {
                self.eliminate(g, (row, column));
                open.retain(|i| *i != row);
            }
        }
        self.rows.sort_by_key(|row| row.iter().position(|e| *e != g.zero()));
        self.rows
    }
}
