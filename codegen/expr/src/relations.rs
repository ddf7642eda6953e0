//! Linear relations with rational coefficients between functions: guessed from values, to be proved by who asks.

use num_traits::Zero;

use super::field;
use super::graph::Graph;
use super::knowledge::POINTS;
use super::node::ExprId;
use super::rational::Rational;

/// Vectors `c` of small rational numbers with `sum_j c_j f_jr = 0` for all `r`, as values at random points have it: a
/// basis of them, each with a last entry one that is zero in all others.
///
/// A relation is not proved; one that holds is found unless its numbers are large, or values of `abs` and roots are
/// known up to signs that matter.
///
/// # Shapes
/// `columns[j][r]`, equally many entries in each.
pub fn rational_relations(g: &mut Graph, columns: &[Vec<ExprId>]) -> Vec<Vec<Rational>> {
    let n = columns.len();
    let n_rows = columns.first().map_or(0, Vec::len);
    // Reduced rows with a one at their pivot, and zeros there in all others.
    let mut basis: Vec<(usize, Vec<u64>)> = Vec::new();
    let mut add = |mut row: Vec<u64>| {
        for (pivot, known) in &basis {
            subtract(&mut row, known, *pivot);
        }
        let Some(pivot) = row.iter().position(|x| *x != 0) else { return false };
        let Some(scale) = field::inverse(row[pivot]) else { return false };
        row.iter_mut().for_each(|x| *x = field::mul(*x, scale));
        for (_, known) in &mut basis {
            subtract(known, &row, pivot);
        }
        basis.push((pivot, row));
        basis.len() == n
    };
    let mut is_full = false;
    for r in 0..n_rows {
        for point in 0..POINTS {
            let row: Option<Vec<u64>> = columns.iter().map(|f| g.fingerprint(f[r])[point]).collect();
            is_full = is_full || row.is_some_and(&mut add);
        }
    }
    for r in 0..n_rows {
        if is_full {
            return Vec::new();
        }
        g.charge(n);
        let values: Option<Vec<_>> = columns.iter().map(|f| g.arena.further_values(f[r])).collect();
        let Some(values) = values else { continue };
        for point in 0..values.first().map_or(0, Vec::len) {
            let row: Option<Vec<u64>> = values.iter().map(|of| of[point]).collect();
            is_full = is_full || row.is_some_and(&mut add);
        }
    }
    let free = (0..n).filter(|j| !basis.iter().any(|(pivot, _)| pivot == j));
    let relation = |j: usize| -> Option<Vec<Rational>> {
        let mut relation = vec![Rational::zero(); n];
        relation[j] = Rational::from_integer(1.into());
        for (pivot, row) in basis.iter().filter(|(_, row)| row[j] != 0) {
            relation[*pivot] = field::as_small_rational(field::negate(row[j]))?;
        }
        Some(relation)
    };
    free.filter_map(relation).collect()
}

/// `row - row[pivot] known`.
fn subtract(row: &mut [u64], known: &[u64], pivot: usize) {
    let factor = field::negate(row[pivot]);
    if factor != 0 {
        row.iter_mut().zip(known).for_each(|(x, y)| *x = field::add(*x, field::mul(factor, *y)));
    }
}

#[cfg(test)]
mod tests {
    use super::rational_relations;
    use crate::{Graph, Rational};

    #[test]
    fn relations_are_found_and_independent_functions_have_none() {
        let mut g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name)).map(|s| g.sym(s));
        let sum = g.add(x, y);
        let square = g.powi(sum, 2);
        let squares = [g.powi(x, 2), g.powi(y, 2)];
        let product = g.mul(x, y);
        let columns: Vec<Vec<_>> = [squares[0], squares[1], product, square].map(|e| vec![e]).to_vec();
        let numbers: Vec<Rational> = [-1, -1, -2, 1].map(|n: i64| Rational::from_integer(n.into())).to_vec();
        assert_eq!(rational_relations(&mut g, &columns), [numbers]);
        // A relation has to hold in every row.
        let columns = [vec![x, y], vec![x, x]];
        assert!(rational_relations(&mut g, &columns).is_empty());
    }
}
