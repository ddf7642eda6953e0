//! Rigid bodies by positions and entries of rotation matrices.
//!
//! A rotation matrix is nine coordinates, row by row, with six equations `R^T R = 1`; the kinetic energy is the
//! integral of `|xdot + Rdot y|^2/2` over the body, `m |xdot|^2/2 + tr(Rdot E Rdot^T)/2` with second moments `E =
//! tr(I)/2 - I` about the mass centre. Angular velocities occur only where a model's variables are computed.
//!
//! Deliberately does not know: constraints, any system.

use hamel_runtime::Real;

use crate::random::Random;

/// A vector in space.
pub type V3<R> = [R; 3];

/// A matrix by its rows.
pub type M3<R> = [[R; 3]; 3];

/// The matrix of nine coordinates.
///
/// # Panics
/// When these are fewer.
pub fn matrix<R: Real>(q: &[R]) -> M3<R> {
    [[q[0], q[1], q[2]], [q[3], q[4], q[5]], [q[6], q[7], q[8]]]
}

/// The vector of three coordinates.
///
/// # Panics
/// When these are fewer.
pub fn vector<R: Real>(q: &[R]) -> V3<R> {
    [q[0], q[1], q[2]]
}

/// Numbers of the parameters as constants.
pub fn constant<R: Real, const N: usize>(values: [f64; N]) -> [R; N] {
    values.map(R::from_f64)
}

/// `a . b`.
pub fn dot<R: Real>(a: V3<R>, b: V3<R>) -> R {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a x b`.
pub fn cross<R: Real>(a: V3<R>, b: V3<R>) -> V3<R> {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// `a + b`.
pub fn sum<R: Real>(a: V3<R>, b: V3<R>) -> V3<R> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// `s a`.
pub fn scaled<R: Real>(s: R, a: V3<R>) -> V3<R> {
    a.map(|x| s * x)
}

/// `a - b`.
pub fn difference<R: Real>(a: V3<R>, b: V3<R>) -> V3<R> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// `A x`.
pub fn times<R: Real>(a: M3<R>, x: V3<R>) -> V3<R> {
    a.map(|row| dot(row, x))
}

/// `A^T`.
pub fn transposed<R: Real>(a: M3<R>) -> M3<R> {
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| a[j][i]))
}

/// `A B`.
pub fn product<R: Real>(a: M3<R>, b: M3<R>) -> M3<R> {
    let columns = transposed(b);
    a.map(|row| columns.map(|column| dot(row, column)))
}

/// `A + B`.
pub fn matrix_sum<R: Real>(a: M3<R>, b: M3<R>) -> M3<R> {
    [sum(a[0], b[0]), sum(a[1], b[1]), sum(a[2], b[2])]
}

/// The six equations of `R^T R = 1`.
pub fn orthogonality<R: Real>(a: M3<R>) -> Vec<R> {
    let columns = transposed(a);
    let pair = |i: usize, j: usize| dot(columns[i], columns[j]) - R::from_f64(f64::from(u8::from(i == j)));
    vec![pair(0, 0), pair(1, 1), pair(2, 2), pair(0, 1), pair(1, 2), pair(2, 0)]
}

/// The angular velocity in the body, from `R^T Rdot`.
pub fn body_rate<R: Real>(a: M3<R>, rate: M3<R>) -> V3<R> {
    let w = product(transposed(a), rate);
    [w[2][1], w[0][2], w[1][0]]
}

/// The angular velocity in space, from `Rdot R^T`.
pub fn space_rate<R: Real>(a: M3<R>, rate: M3<R>) -> V3<R> {
    let w = product(rate, transposed(a));
    [w[2][1], w[0][2], w[1][0]]
}

/// A symmetric matrix by its upper triangle, row by row.
pub fn symmetric([a, b, c, d, e, f]: [f64; 6]) -> M3<f64> {
    [[a, b, c], [b, d, e], [c, e, f]]
}

/// A diagonal matrix.
pub fn diagonal([a, b, c]: [f64; 3]) -> M3<f64> {
    [[a, 0.0, 0.0], [0.0, b, 0.0], [0.0, 0.0, c]]
}

/// `m |xdot|^2/2 + tr(Rdot E Rdot^T)/2` with moments of inertia `I` about the mass centre.
pub fn kinetic_energy<R: Real>(m: f64, inertia: M3<f64>, x_dot: V3<R>, rate: M3<R>) -> R {
    let half_trace = 0.5 * (inertia[0][0] + inertia[1][1] + inertia[2][2]);
    let mut energy = R::from_f64(0.5 * m) * dot(x_dot, x_dot);
    for row in rate {
        for i in 0..3 {
            for j in 0..3 {
                let moment = if i == j { half_trace - inertia[i][j] } else { -inertia[i][j] };
                energy += R::from_f64(0.5 * moment) * row[i] * row[j];
            }
        }
    }
    energy
}

/// The rotation by an angle about the axis of a unit vector, and its derivative by the angle.
pub fn turned<R: Real>(axis: V3<f64>, angle: R) -> (M3<R>, M3<R>) {
    let n: V3<R> = constant(axis);
    let zero = R::from_f64(0.0);
    let hat = [[zero, -n[2], n[1]], [n[2], zero, -n[0]], [-n[1], n[0], zero]];
    let square = product(hat, hat);
    let unit = diagonal([1.0; 3]).map(constant);
    let (sin, cos) = (angle.sin(), angle.cos());
    let one = R::from_f64(1.0);
    let value = matrix_sum(
        matrix_sum(unit, hat.map(|row| scaled(sin, row))),
        square.map(|row| scaled(one - cos, row)),
    );
    let slope = matrix_sum(hat.map(|row| scaled(cos, row)), square.map(|row| scaled(sin, row)));
    (value, slope)
}

/// A rotation, row by row, by a random unit quaternion.
pub fn random_rotation(random: &mut Random) -> Vec<f64> {
    loop {
        let q = [0; 4].map(|_| random.number());
        let size = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        if (0.1..1.0).contains(&size) {
            let [w, x, y, z] = q.map(|x| x / size);
            return vec![
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - w * z),
                2.0 * (x * z + w * y),
                2.0 * (x * y + w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - w * x),
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
            ];
        }
    }
}

/// Random numbers in `[-1, 1)`.
pub fn random_numbers(n: usize, random: &mut Random) -> Vec<f64> {
    (0..n).map(|_| random.number()).collect()
}
