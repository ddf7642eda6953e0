//! Square systems solved for all unknowns.
//!
//! Deliberately does not know: where the systems come from.

use hamel_expr::{ExprId, Graph};

use super::cofactors::{MAX_COFACTORS, MAX_DETERMINANT, adjugate, determinant};
use super::grade::Judge;
use super::rows::{Tableau, Tie};

/// Solves `A X = B` on expressions, with exact zero tests and the simplest pivot of each column that is proved not to
/// vanish identically; where there is none, one of which it is not known.
///
/// # Shapes
/// `a`: `n x n`, `b`: `n x k` -> `n x k`.
///
/// # Errors
/// The index of the column without a pivot, when `A` is singular identically.
pub fn solve_symbolic(
    g: &mut Graph,
    a: &[Vec<ExprId>],
    b: &[Vec<ExprId>],
) -> Result<Vec<Vec<ExprId>>, usize> {
    column_by_column(g, a, b, false)
}

/// Solves `A X = B` for a symmetric `A`, with pivots on the diagonal wherever these are not identically zero: those of
/// a definite matrix vanish nowhere, while an entry beside the diagonal that is divided by may, and the solution with
/// it.
///
/// # Shapes
/// `a`: `n x n`, `b`: `n x k` -> `n x k`.
///
/// # Errors
/// The index of a column without a pivot, when `A` is singular identically.
pub fn solve_symmetric(
    g: &mut Graph,
    a: &[Vec<ExprId>],
    b: &[Vec<ExprId>],
) -> Result<Vec<Vec<ExprId>>, usize> {
    let n = a.len();
    let mut order: Vec<usize> = (0..n).collect();
    // Simple pivots first; the zeros of a saddle point's diagonal are filled by then.
    order.sort_by_key(|&k| (a[k][k] == g.zero(), g.reachable(&[a[k][k]]).len()));
    let permuted: Vec<Vec<ExprId>> =
        order.iter().map(|&i| order.iter().map(|&j| a[i][j]).collect()).collect();
    let right: Vec<Vec<ExprId>> = order.iter().map(|&i| b[i].clone()).collect();
    let solved = column_by_column(g, &permuted, &right, true).map_err(|column| order[column])?;
    let mut x = vec![Vec::new(); n];
    for (row, &i) in solved.into_iter().zip(&order) {
        x[i] = row;
    }
    Ok(x)
}

/// Solves `A X = B` for a symmetric `A` over its determinant as the one denominator, where `A` has few rows; as
/// [`solve_symmetric`] does otherwise.
///
/// # Shapes
/// `a`: `n x n`, `b`: `n x k` -> `n x k`.
///
/// # Errors
/// The index of a column, when `A` is singular identically.
pub fn solve_over_determinant(
    g: &mut Graph,
    a: &[Vec<ExprId>],
    b: &[Vec<ExprId>],
) -> Result<Vec<Vec<ExprId>>, usize> {
    if !(2..=MAX_COFACTORS).contains(&a.len()) {
        return solve_symmetric(g, a, b);
    }
    let determinant = determinant(g, a);
    if g.is_zero(determinant) {
        // Which column it is, the elimination knows.
        return solve_symmetric(g, a, b);
    }
    Ok(over(g, determinant, (a, b)))
}

/// Solves `A X = B` over the determinant of `A` as the one denominator; nothing where that vanishes identically, and
/// for more rows than determinants are written for.
///
/// # Shapes
/// `a`: `n x n`, `b`: `n x k` -> `n x k`.
pub fn solve_by_cofactors(g: &mut Graph, a: &[Vec<ExprId>], b: &[Vec<ExprId>]) -> Option<Vec<Vec<ExprId>>> {
    if a.len() > MAX_DETERMINANT {
        return None;
    }
    let determinant = determinant(g, a);
    (!g.is_zero(determinant)).then(|| over(g, determinant, (a, b)))
}

fn over(g: &mut Graph, determinant: ExprId, (a, b): (&[Vec<ExprId>], &[Vec<ExprId>])) -> Vec<Vec<ExprId>> {
    let inverse = g.powi(determinant, -1);
    let cofactors = adjugate(g, a);
    let width = b.first().map_or(0, Vec::len);
    let mut entry = |row: &[ExprId], i: usize| {
        let column: Vec<ExprId> = b.iter().map(|row| row[i]).collect();
        let sum = g.dot(row, &column);
        let numerator = g.cancel_zero(sum);
        g.mul(numerator, inverse)
    };
    cofactors.iter().map(|row| (0..width).map(|i| entry(row, i)).collect()).collect()
}

/// The determinant of a square matrix: by cofactors while its minors are few, by the product of the pivots of an
/// elimination otherwise; zero for a matrix that is singular identically.
///
/// # Shapes
/// `square`: `n x n`.
pub fn determinant_of(g: &mut Graph, square: &[Vec<ExprId>]) -> ExprId {
    if square.len() <= MAX_DETERMINANT {
        return determinant(g, square);
    }
    let mut tableau = Tableau::new(square.to_vec());
    let mut factors = Vec::with_capacity(square.len());
    for column in 0..square.len() {
        let Some(found) = step(g, &mut tableau, column, false) else { return g.zero() };
        factors.push(if found.row == column { found.pivot } else { g.neg(found.pivot) });
    }
    g.product(&factors)
}

/// A column that was eliminated: the row that was exchanged for that of the column, and what was divided by.
struct Step {
    row: usize,
    pivot: ExprId,
}

/// Eliminates a column of all rows by the best row that is not used up, or by the diagonal; none where all entries left
/// vanish identically.
fn step(g: &mut Graph, tableau: &mut Tableau, column: usize, prefer_diagonal: bool) -> Option<Step> {
    let n = tableau.rows().len();
    let mut best = |rows: std::ops::Range<usize>| {
        tableau.best(g, &Judge::BLIND, Tie::Smallest, rows.map(|row| (row, column)))
    };
    let diagonal = if prefer_diagonal { best(column..column + 1) } else { None };
    let row = diagonal.or_else(|| best(column..n))?.row;
    let pivot = tableau.rows()[row][column];
    tableau.swap_rows(row, column);
    tableau.eliminate(g, (column, column));
    Some(Step { row, pivot })
}

fn column_by_column(
    g: &mut Graph,
    a: &[Vec<ExprId>],
    b: &[Vec<ExprId>],
    prefer_diagonal: bool,
) -> Result<Vec<Vec<ExprId>>, usize> {
    let n = a.len();
    let mut tableau = Tableau::new(a.iter().zip(b).map(|(l, r)| [l.as_slice(), r].concat()).collect());
    for column in 0..n {
        step(g, &mut tableau, column, prefer_diagonal).ok_or(column)?;
    }
    Ok(tableau.into_rows().into_iter().map(|row| row[n..].to_vec()).collect())
}
