//! Random elements of matrix groups, and the rates of coordinates of groups along a velocity.
//!
//! Does not know: systems, points, which coordinates a scene carries.

use hamel_runtime::Real;

use hamel_lang::spec::{MatrixGroup, MatrixSpace, Side};

use super::random::Random;
use super::tape::rational;
use super::wide::Wide;

type Rows<R> = Vec<Vec<R>>;

/// Terms of the exponential series: of matrices below 4 in norm, 60 leave less than 1e-45.
const N_TERMS: usize = 60;

/// `g h`.
fn product<R: Real>(g: &Rows<R>, h: &Rows<R>) -> Rows<R> {
    let entry =
        |row: &Vec<R>, j: usize| row.iter().zip(h).fold(R::ZERO, |sum, (a, other)| sum + *a * other[j]);
    g.iter().map(|row| (0..h.len()).map(|j| entry(row, j)).collect()).collect()
}

/// `sum_a xi_a E_a` for the matrices of the algebra.
fn combined<R: Real>(group: &MatrixGroup, xi: &[R]) -> Rows<R> {
    let n = group.matrices().first().map_or(0, |m| m.n_rows());
    let mut rows = vec![vec![R::ZERO; n]; n];
    for (matrix, weight) in group.matrices().iter().zip(xi) {
        for (i, row) in rows.iter_mut().enumerate() {
            for (x, q) in row.iter_mut().zip(matrix.row(i)) {
                *x += *weight * rational::<R>(q);
            }
        }
    }
    rows
}

/// The coordinates of an element: entries row by row, of real and imaginary parts where the matrices are complex, which
/// stand as blocks `[[a, -b], [b, a]]`.
fn coordinates<R: Real>(group: &MatrixGroup, matrix: &Rows<R>) -> Vec<R> {
    let n = group.n();
    match group.family().is_complex() {
        false => matrix.iter().flatten().copied().collect(),
        true => {
            let part = |k: usize| (0..n * n).map(move |at| (2 * (at / n) + k, 2 * (at % n)));
            part(0).chain(part(1)).map(|(i, j)| matrix[i][j]).collect()
        }
    }
}

fn element<R: Real>(group: &MatrixGroup, coordinates: &[R]) -> Rows<R> {
    let n = group.n();
    match group.family().is_complex() {
        false => coordinates.chunks(n).map(<[R]>::to_vec).collect(),
        true => {
            let mut rows = vec![vec![R::ZERO; 2 * n]; 2 * n];
            for at in 0..n * n {
                let (i, j) = (2 * (at / n), 2 * (at % n));
                let (a, b) = (coordinates[at], coordinates[n * n + at]);
                (rows[i][j], rows[i + 1][j + 1], rows[i][j + 1], rows[i + 1][j]) = (a, a, -b, b);
            }
            rows
        }
    }
}

/// The exponential of a random element of the algebra, with random vectors of the spaces.
pub(super) fn random_element(group: &MatrixGroup, random: &mut Random) -> Vec<Wide> {
    let xi = random.vector(group.matrices().len());
    let x = combined(group, &xi);
    let n = x.len();
    let identity: Rows<Wide> =
        (0..n).map(|i| (0..n).map(|j| if i == j { Wide::ONE } else { Wide::ZERO }).collect()).collect();
    let (mut sum, mut term) = (identity.clone(), identity);
    for k in 1..=N_TERMS {
        term = product(&term, &x);
        let inverse = Wide::exact(k as f64).recip();
        term.iter_mut().flatten().for_each(|e| *e *= inverse);
        for (row, add) in sum.iter_mut().zip(&term) {
            row.iter_mut().zip(add).for_each(|(a, b)| *a += *b);
        }
    }
    let mut all = coordinates(group, &sum);
    for (_, dim) in group.spaces() {
        all.extend(random.vector(dim));
    }
    all
}

/// `g' = g xi`, `v' = g u` (left), `g' = xi g`, `v' = xi v + u` (right), `v' = u` for a space that the group leaves
/// alone.
pub(super) fn matrix_rates<R: Real>(group: &MatrixGroup, at: &[R], xi: &[R], side: Side) -> Vec<R> {
    let n_entries = group.n_blocks() * group.n() * group.n();
    let g = element(group, &at[..n_entries]);
    let (turning, mut moving) = xi.split_at(group.matrices().len());
    let hat = combined(group, turning);
    let rate = if side == Side::Left { product(&g, &hat) } else { product(&hat, &g) };
    let mut rates = coordinates(group, &rate);
    let mut rest = &at[n_entries..];
    let times = |m: &Rows<R>, v: &[R]| -> Vec<R> {
        m.iter().map(|row| row.iter().zip(v).fold(R::ZERO, |sum, (a, b)| sum + *a * *b)).collect()
    };
    for (space, dim) in group.spaces() {
        let (u, later) = moving.split_at(dim);
        let (v, after) = rest.split_at(dim);
        (moving, rest) = (later, after);
        rates.extend(match (space, side) {
            (MatrixSpace::Trivial(_), _) => u.to_vec(),
            (MatrixSpace::Standard, Side::Left) => times(&g, u),
            (MatrixSpace::Standard, Side::Right) => {
                times(&hat, v).into_iter().zip(u).map(|(a, b)| a + *b).collect()
            }
        });
    }
    rates
}

/// Rows of the rotation matrix of a unit quaternion `(w, x, y, z)`.
pub(super) fn rotation<R: Real>(q: &[R]) -> Rows<R> {
    let [w, x, y, z] = [q[0], q[1], q[2], q[3]];
    let two = R::from_f64(2.0);
    vec![
        vec![w * w + x * x - y * y - z * z, two * (x * y - w * z), two * (x * z + w * y)],
        vec![two * (x * y + w * z), w * w - x * x + y * y - z * z, two * (y * z - w * x)],
        vec![two * (x * z - w * y), two * (y * z + w * x), w * w - x * x - y * y + z * z],
    ]
}

/// `R hat(omega)` (left) or `hat(omega) R` (right), `hat(omega) v = omega x v`.
pub(super) fn turned<R: Real>(rotation: &Rows<R>, omega: &[R], side: Side) -> Rows<R> {
    let hat = vec![
        vec![R::ZERO, -omega[2], omega[1]],
        vec![omega[2], R::ZERO, -omega[0]],
        vec![-omega[1], omega[0], R::ZERO],
    ];
    if side == Side::Left { product(rotation, &hat) } else { product(&hat, rotation) }
}

/// `R v`.
pub(super) fn rotated<R: Real>(rotation: &Rows<R>, v: &[R]) -> Vec<R> {
    rotation.iter().map(|row| row.iter().zip(v).fold(R::ZERO, |sum, (a, b)| sum + *a * *b)).collect()
}
