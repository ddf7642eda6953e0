//! Rotation matrices from measurements and drawings, whose entries are rounded: the nearest rotation, exactly.
//!
//! Deliberately does not know: attitudes of a model, items.

use num_bigint::BigInt;
use num_traits::{One, Signed, Zero};

use super::ast::Expr;
use super::diagnostic::{Diagnostic, Span};
use super::eval::{Evaluator, Weighed};
use super::shape::Shape;
use super::value::Value;
use crate::algebra::tableau::{Numbers, adjugate, determinant};
use hamel_expr::{Rational, rational_to_f64};

/// Largest change of an entry: that of two digits.
const FARTHEST: (i64, i64) = (1, 100);
/// A change that doubles do not have is not told.
const TOLD: f64 = 1e-15;
/// Binary digits of the parameters of a rotation, and of the steps to it.
const DIGITS: u32 = 56;
const STEP_DIGITS: u32 = 80;
/// The steps converge quadratically, from two digits.
const STEPS: usize = 7;

type Rows = Vec<Vec<Rational>>;

impl Evaluator<'_> {
    /// `orthonormal(M)`: the rotation matrix that is nearest to a matrix of numbers, with rational entries that are
    /// orthonormal exactly. A change that somebody could see is told.
    pub(super) fn orthonormal(&mut self, arguments: &[Expr], span: Span) -> Option<Weighed> {
        let [argument] = arguments else {
            let message = format!("`orthonormal` takes 1 argument, found {}", arguments.len());
            return self.fail(span, message, "write `orthonormal(A)` with a matrix of numbers");
        };
        let (value, _) = self.eval(argument)?;
        let n = match value.shape() {
            Shape::Matrix(n, m) if n == m && (2..=3).contains(&n) => n,
            shape => {
                let message = format!("`orthonormal` takes matrix(2, 2) or matrix(3, 3), found {shape}");
                return self.fail(argument.span, message, "write the rows of a rotation: `[[a, b], [c, d]]`");
            }
        };
        let numbers: Option<Vec<Rational>> =
            value.entries().iter().map(|e| self.graph.as_rational(*e).cloned()).collect();
        let Some(numbers) = numbers else {
            let help = "write its entries in decimals; a rotation by an angle is `rot(axis, phi)`";
            return self.fail(argument.span, "`orthonormal` takes a matrix of numbers", help);
        };
        self.charge(1 << 12, span)?;
        let given: Rows = numbers.chunks(n).map(<[Rational]>::to_vec).collect();
        let Some((rotation, moved)) = nearest(&given).filter(|(_, moved)| *moved <= farthest()) else {
            let message = match is_reflection(&given) {
                true => "the matrix is a reflection, not near any rotation",
                false => "the matrix is not near any rotation",
            };
            let (p, q) = FARTHEST;
            let help = format!(
                "its columns have to be orthonormal and right-handed, so that no entry moves by more than {p}/{q}"
            );
            return self.fail(argument.span, message, help);
        };
        let moved = rational_to_f64(&moved);
        if moved > TOLD {
            let message = format!("the nearest rotation differs from the matrix by {moved:.1e}");
            let warning = Diagnostic::warning(Some(argument.span), message);
            let warning = warning.with_help("give more digits of its entries, if there are any");
            if !self.warnings.contains(&warning) {
                self.warnings.push(warning);
            }
        }
        let entries = rotation.into_iter().flatten().map(|q| self.graph.rational(q)).collect();
        Some((Value::Matrix { rows: n, columns: n, entries }, 1))
    }

    /// What to do about a matrix that should be a rotation and is none.
    pub(super) fn advice_for_rotation(&self, value: &Value, n: usize) -> &'static str {
        let numbers: Option<Vec<Rational>> =
            value.entries().iter().map(|e| self.graph.as_rational(*e).cloned()).collect();
        let is_near = numbers.is_some_and(|numbers| {
            let rows: Rows = numbers.chunks(n).map(<[Rational]>::to_vec).collect();
            nearest(&rows).is_some_and(|(_, moved)| moved <= farthest())
        });
        match is_near {
            true => "its entries are rounded: write `orthonormal(A)` for the nearest rotation",
            false => "write it as a product of rotations such as `rot(e3, phi)*rot(e1, theta)`",
        }
    }
}

fn farthest() -> Rational {
    Rational::new(FARTHEST.0.into(), FARTHEST.1.into())
}

fn half() -> Rational {
    Rational::new(BigInt::one(), 2.into())
}

/// A number with so many binary digits behind the point.
fn rounded(q: &Rational, digits: u32) -> Rational {
    let scale = Rational::from_integer(BigInt::one() << digits);
    (q * &scale).round() / scale
}

fn is_reflection(m: &Rows) -> bool {
    determinant(&mut Numbers, m).is_negative()
}

/// The rotation nearest to a matrix, and the largest change of an entry; none where there is no single one nearby.
///
/// `X <- (X + X^-T)/2` goes to the orthogonal factor of the polar decomposition, which is the nearest rotation. Its
/// parameters (the half angle of the plane, a quaternion) up to a factor are rational functions of its entries, and any
/// parameters make an exact rotation.
///
/// # Source
/// Higham 1986 (Computing the polar decomposition, with applications); Shepperd 1978 (Quaternion from rotation matrix).
fn nearest(given: &Rows) -> Option<(Rows, Rational)> {
    let limit = Rational::from_integer(2.into());
    if given.iter().flatten().any(|q| q.abs() > limit) {
        return None;
    }
    let mut x: Rows = given.iter().map(|row| row.iter().map(|q| rounded(q, STEP_DIGITS)).collect()).collect();
    for _ in 0..STEPS {
        let adjugate = adjugate(&mut Numbers, &x);
        let determinant = determinant(&mut Numbers, &x);
        // Half of that of a rotation is far from all of them.
        if determinant < half() {
            return None;
        }
        let step = |a: &Rational, b: &Rational| rounded(&((a + b / &determinant) * half()), STEP_DIGITS);
        let entry = |i: usize, j: usize| step(&x[i][j], &adjugate[j][i]);
        x = (0..x.len()).map(|i| (0..x.len()).map(|j| entry(i, j)).collect()).collect();
    }
    let rotation = if x.len() == 2 { of_plane(&x) } else { of_space(&x) };
    let changes = given.iter().flatten().zip(rotation.iter().flatten()).map(|(a, b)| (a - b).abs());
    let moved = changes.max().unwrap_or_else(Rational::zero);
    Some((rotation, moved))
}

/// Parameters up to a factor, the largest of them one, with few digits.
fn scaled(parameters: Vec<Rational>) -> Vec<Rational> {
    let largest =
        parameters.iter().map(Rational::abs).max().filter(|q| !q.is_zero()).unwrap_or_else(Rational::one);
    parameters.iter().map(|q| rounded(&(q / &largest), DIGITS)).collect()
}

fn of_plane(x: &Rows) -> Rows {
    let (cosine, sine) = (&x[0][0], &x[1][0]);
    let one = Rational::one();
    // Both are cosine and sine of the half angle up to a factor; one of them is not small.
    let p = scaled(match cosine.is_negative() {
        true => vec![sine.clone(), one - cosine],
        false => vec![one + cosine, sine.clone()],
    });
    let (u, v) = (&p[0], &p[1]);
    let norm = u * u + v * v;
    let (c, s) = ((u * u - v * v) / &norm, Rational::from_integer(2.into()) * u * v / &norm);
    vec![vec![c.clone(), -&s], vec![s, c]]
}

fn of_space(x: &Rows) -> Rows {
    let one = Rational::one();
    let trace = &x[0][0] + &x[1][1] + &x[2][2];
    // Rows of 4 q q^T: that of the largest component has no small divisor.
    let skew = |i: usize, j: usize| &x[i][j] - &x[j][i];
    let sum = |i: usize, j: usize| &x[i][j] + &x[j][i];
    let rows = [
        vec![&one + &trace, skew(2, 1), skew(0, 2), skew(1, 0)],
        vec![skew(2, 1), &one + &x[0][0] - &x[1][1] - &x[2][2], sum(0, 1), sum(0, 2)],
        vec![skew(0, 2), sum(0, 1), &one - &x[0][0] + &x[1][1] - &x[2][2], sum(1, 2)],
        vec![skew(1, 0), sum(0, 2), sum(1, 2), &one - &x[0][0] - &x[1][1] + &x[2][2]],
    ];
    let best = (0..4).max_by(|a, b| rows[*a][*a].cmp(&rows[*b][*b])).unwrap_or(0);
    let q = scaled(rows[best].clone());
    let two = Rational::from_integer(2.into());
    let (w, v) = (&q[0], &q[1..]);
    let norm = q.iter().map(|p| p * p).fold(Rational::zero(), |sum, p| sum + p);
    // R = 1 + 2 (w hat(v) + hat(v)^2)/|q|^2.
    let hat = |i: usize, j: usize| match (i + 3 - j) % 3 {
        0 => Rational::zero(),
        1 => v[(i + 1) % 3].clone(),
        _ => -&v[(j + 1) % 3],
    };
    let entry = |i: usize, j: usize| {
        let square = (0..3).map(|k| hat(i, k) * hat(k, j)).fold(Rational::zero(), |sum, p| sum + p);
        let unit = if i == j { one.clone() } else { Rational::zero() };
        unit + &two * (w * hat(i, j) + square) / &norm
    };
    (0..3).map(|i| (0..3).map(|j| entry(i, j)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::{Rational, Rows, is_reflection, nearest};
    use hamel_expr::rational_to_f64;

    fn rows(entries: &[&[f64]]) -> Rows {
        let exact = |x: &f64| Rational::from_float(*x).unwrap();
        entries.iter().map(|row| row.iter().map(exact).collect()).collect()
    }

    /// A rotation by an axis and an angle, in doubles.
    fn turned([a, b, c]: [f64; 3], phi: f64) -> Vec<Vec<f64>> {
        let norm = (a * a + b * b + c * c).sqrt();
        let axis = [a / norm, b / norm, c / norm];
        let hat = [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]];
        let entry = |i: usize, j: usize| {
            let unit = f64::from(i == j);
            let along = axis[i] * axis[j];
            along + phi.cos() * (unit - along) + phi.sin() * hat[i][j]
        };
        (0..3).map(|i| (0..3).map(|j| entry(i, j)).collect()).collect()
    }

    fn assert_is_rotation(r: &Rows) {
        let n = r.len();
        for i in 0..n {
            for j in 0..n {
                let dot: Rational = (0..n).map(|k| &r[k][i] * &r[k][j]).sum();
                assert_eq!(dot, Rational::from_integer(i64::from(i == j).into()), "{i} {j}");
            }
        }
        assert!(!is_reflection(r));
    }

    #[test]
    fn rotations_of_doubles_move_by_their_rounding_and_are_exact_then() {
        let axes = [[1.0, 2.0, 3.0], [0.0, -1.0, 1e-3], [-2.0, 0.1, 0.5]];
        for axis in axes {
            for phi in [0.0, 1e-9, 0.3, 1.5, 2.0, 3.1, std::f64::consts::PI, -2.9] {
                let given: Vec<Vec<f64>> = turned(axis, phi);
                let given: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
                let (r, moved) = nearest(&rows(&given)).unwrap();
                assert_is_rotation(&r);
                assert!(rational_to_f64(&moved) < 1e-15, "{axis:?} {phi}: {:e}", rational_to_f64(&moved));
            }
        }
        for phi in [0.0, 0.4, 1.7, 3.0, std::f64::consts::PI, -1.0, -3.0] {
            let (s, c) = f64::sin_cos(phi);
            let (r, moved) = nearest(&rows(&[&[c, -s], &[s, c]])).unwrap();
            assert_is_rotation(&r);
            assert!(rational_to_f64(&moved) < 1e-15, "{phi}");
        }
    }

    /// The nearest rotation has a symmetric product with what it is nearest to: `R^T M` is the other polar factor.
    #[test]
    fn rounded_digits_move_to_the_nearest_rotation() {
        let given = turned([1.0, -2.0, 0.5], 0.8);
        let short: Vec<Vec<f64>> =
            given.iter().map(|row| row.iter().map(|x| (x * 1e3).round() / 1e3).collect()).collect();
        let short = rows(&short.iter().map(Vec::as_slice).collect::<Vec<_>>());
        let (r, moved) = nearest(&short).unwrap();
        assert_is_rotation(&r);
        let moved = rational_to_f64(&moved);
        assert!((1e-5..1e-3).contains(&moved), "{moved}");
        let entry = |i: usize, j: usize| -> Rational { (0..3).map(|k| &r[k][i] * &short[k][j]).sum() };
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let skew = rational_to_f64(&(entry(i, j) - entry(j, i)));
            assert!(skew.abs() < 1e-14, "{skew:e}");
        }
    }

    #[test]
    fn what_is_no_rotation_is_none() {
        assert!(nearest(&rows(&[&[1.0, 0.0], &[0.0, -1.0]])).is_none());
        assert!(nearest(&rows(&[&[0.0, 0.0], &[0.0, 0.0]])).is_none());
        assert!(nearest(&rows(&[&[1e9, 0.0], &[0.0, 1e9]])).is_none());
        let (_, moved) = nearest(&rows(&[&[1.2, 0.0], &[0.0, 1.0]])).unwrap();
        assert!(rational_to_f64(&moved) > 0.1);
    }
}
