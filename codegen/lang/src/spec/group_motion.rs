//! The group equation `gdot = g xi` (left) or `gdot = xi g` (right) for matrices and the vectors of a semidirect
//! product.
//!
//! Matrices are real here: a complex number `a + ib` is the block `[[a, -b], [b, a]]`.
//!
//! Deliberately does not know: models, which coordinates a scene carries.

use num_traits::Zero;

use super::matrix_group::{MatrixFamily, MatrixGroup, MatrixSpace};
use super::model::Side;
use crate::algebra::Matrix;
use hamel_expr::{ExprId, Graph, Rational};

/// A square matrix of expressions.
pub type Rows = Vec<Vec<ExprId>>;

/// A group element by its coordinates.
pub struct Element {
    /// `g`, as a real matrix.
    pub matrix: Rows,
    /// A vector for each space.
    pub vectors: Vec<Vec<ExprId>>,
}

impl Element {
    /// The element with these coordinates, in the order of [`MatrixGroup`].
    pub fn new(g: &mut Graph, group: &MatrixGroup, coordinates: &[ExprId]) -> Element {
        let n = group.n();
        let (entries, mut rest) = coordinates.split_at(n_entries(group));
        let matrix = match group.family().is_complex() {
            false => entries.chunks(n).map(<[ExprId]>::to_vec).collect(),
            true => {
                let (re, im) = entries.split_at(n * n);
                let mut rows = vec![vec![g.zero(); 2 * n]; 2 * n];
                for (k, (a, b)) in re.iter().zip(im).enumerate() {
                    let (i, j) = (2 * (k / n), 2 * (k % n));
                    (rows[i][j], rows[i + 1][j + 1]) = (*a, *a);
                    (rows[i][j + 1], rows[i + 1][j]) = (g.neg(*b), *b);
                }
                rows
            }
        };
        let mut vectors = Vec::new();
        for (_, dim) in group.spaces() {
            let (vector, after) = rest.split_at(dim);
            vectors.push(vector.to_vec());
            rest = after;
        }
        Element { matrix, vectors }
    }
}

/// How many coordinates are entries of the matrix.
fn n_entries(group: &MatrixGroup) -> usize {
    group.n_blocks() * group.n() * group.n()
}

/// Rates of the coordinates by the group velocity: `g' = g xi`, `v' = g u` (left), or `g' = xi g`, `v' = xi v + u`
/// (right), with `u` alone for a space that the group leaves alone.
pub fn group_rates(
    g: &mut Graph,
    group: &MatrixGroup,
    coordinates: &[ExprId],
    xi: &[ExprId],
    side: Side,
) -> Vec<ExprId> {
    let element = Element::new(g, group, coordinates);
    let (turning, mut moving) = xi.split_at(group.matrices().len());
    let hat = combined(g, group.matrices(), turning);
    let rate = match side {
        Side::Left => product(g, &element.matrix, &hat),
        Side::Right => product(g, &hat, &element.matrix),
    };
    let n = group.n();
    let mut rates: Vec<ExprId> = match group.family().is_complex() {
        false => rate.into_iter().flatten().collect(),
        true => {
            let part = |k: usize| (0..n * n).map(move |at| (2 * (at / n) + k, 2 * (at % n)));
            part(0).chain(part(1)).map(|(i, j)| rate[i][j]).collect()
        }
    };
    for ((space, dim), vector) in group.spaces().into_iter().zip(&element.vectors) {
        let (u, after) = moving.split_at(dim);
        moving = after;
        rates.extend(match (space, side) {
            (MatrixSpace::Trivial(_), _) => u.to_vec(),
            (MatrixSpace::Standard, Side::Left) => applied(g, &element.matrix, u),
            (MatrixSpace::Standard, Side::Right) => {
                let turned = applied(g, &hat, vector);
                turned.into_iter().zip(u).map(|(a, b)| g.add(a, *b)).collect()
            }
        });
    }
    rates
}

/// `sum_a xi_a E_a`.
fn combined(g: &mut Graph, matrices: &[Matrix], xi: &[ExprId]) -> Rows {
    let size = matrices.first().map_or(0, Matrix::n_rows);
    let entry = |g: &mut Graph, i: usize, j: usize| {
        let terms: Vec<(ExprId, Rational)> = (matrices.iter().zip(xi))
            .filter(|(m, _)| !m.get(i, j).is_zero())
            .map(|(m, x)| (*x, m.get(i, j).clone()))
            .collect();
        g.linear_combination(&terms)
    };
    (0..size).map(|i| (0..size).map(|j| entry(g, i, j)).collect()).collect()
}

/// A matrix of numbers.
pub fn constant(g: &mut Graph, m: &Matrix) -> Rows {
    (0..m.n_rows()).map(|i| m.row(i).iter().map(|q| g.rational(q.clone())).collect()).collect()
}

/// The transpose.
pub fn transposed(m: &Rows) -> Rows {
    (0..m.len()).map(|i| m.iter().map(|row| row[i]).collect()).collect()
}

/// The product of matrices.
pub fn product(g: &mut Graph, a: &Rows, b: &Rows) -> Rows {
    let columns = transposed(b);
    a.iter().map(|row| columns.iter().map(|column| g.dot(row, column)).collect()).collect()
}

fn applied(g: &mut Graph, m: &Rows, v: &[ExprId]) -> Vec<ExprId> {
    m.iter().map(|row| g.dot(row, v)).collect()
}

/// An element of the group by as many free symbols as it has dimensions, rational functions that reach a neighbourhood
/// of the identity: what vanishes for it vanishes on the group (its component, which is an irreducible variety). None
/// where the group has no such form here: rotations of two and three dimensions, `SU(2)` and their semidirect products
/// have.
///
/// Rotations of space by Cayley's formula, `q = 1 + (a, b, c)` as a quaternion; `SU(2)` by stereographic projection.
pub fn rational_element(g: &mut Graph, group: &MatrixGroup, symbols: &[ExprId]) -> Option<Vec<ExprId>> {
    let (turning, moving) = symbols.split_at_checked(group.matrices().len())?;
    let one = g.one();
    let square = |g: &mut Graph, list: &[ExprId]| g.dot(list, list);
    let mut entries = match (group.is_of_rotations(), group.family(), group.n(), turning) {
        (true, _, 2, &[a]) => {
            let s = square(g, &[a]);
            let n = g.add(one, s);
            let (c, s) = (g.sub(one, s), g.scale(a, &Rational::from_integer(2.into())));
            let back = g.neg(s);
            over(g, &[c, back, s, c], n)?
        }
        (true, _, 3, &[a, b, c]) => {
            let squares = [a, b, c].map(|x| square(g, &[x]));
            let n = g.sum(&[one, squares[0], squares[1], squares[2]]);
            let two = Rational::from_integer(2.into());
            let mut list = Vec::with_capacity(9);
            let u = [a, b, c];
            for i in 0..3 {
                for j in 0..3 {
                    list.push(if i == j {
                        let (p, q) = ((i + 1) % 3, (i + 2) % 3);
                        let [minus_p, minus_q] = [squares[p], squares[q]].map(|e| g.neg(e));
                        g.sum(&[one, squares[i], minus_p, minus_q])
                    } else {
                        let k = 3 - i - j;
                        let product = g.mul(u[i], u[j]);
                        let turned = if (i + 1) % 3 == j { g.neg(u[k]) } else { u[k] };
                        let sum = g.add(product, turned);
                        g.scale(sum, &two)
                    });
                }
            }
            over(g, &list, n)?
        }
        (false, MatrixFamily::SpecialUnitary, 2, &[a, b, c]) => {
            let s = square(g, &[a, b, c]);
            let n = g.add(one, s);
            let two = Rational::from_integer(2.into());
            let [a, b, c] = [a, b, c].map(|e| g.scale(e, &two));
            let (minus_a, minus_b) = (g.neg(a), g.neg(b));
            let w = g.sub(one, s);
            // [[w + i a, -b + i c], [b + i c, w - i a]].
            over(g, &[w, minus_b, b, w, a, c, c, minus_a], n)?
        }
        _ => return None,
    };
    entries.extend(moving.iter().copied());
    Some(entries)
}

fn over(g: &mut Graph, list: &[ExprId], n: ExprId) -> Option<Vec<ExprId>> {
    list.iter().map(|e| g.div(*e, n).ok()).collect()
}
