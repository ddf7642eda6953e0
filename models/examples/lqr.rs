//! A linear-quadratic regulator that keeps the mobile robot on a line, from the linearization that its scene has.
//!
//! ```text
//! A^T P + P A - P B R^-1 B^T P + Q = 0,    tau = -R^-1 B^T P (y - y0)
//! ```
//!
//! The Riccati equation is solved by the sign of its Hamiltonian matrix.
//!
//! Run with `cargo run --release -p hamel-models --example lqr`.

use hamel_models::generated::mobile_robot_controlled::{Params, Prepared};
use hamel_runtime::nalgebra::{SMatrix, SVector};
use hamel_runtime::{Dop853, Integrator, Options, WithInput};

/// What is regulated: the rates of the wheels, the heading, the distance from the line.
const REGULATED: [usize; 4] = [2, 3, 4, 6];
const N: usize = REGULATED.len();

/// The solution `P` of the Riccati equation; none where the Newton iteration meets a singular matrix.
fn riccati(
    a: SMatrix<f64, N, N>,
    b: SMatrix<f64, N, 2>,
    q: SMatrix<f64, N, N>,
    r: SMatrix<f64, 2, 2>,
) -> Option<SMatrix<f64, N, N>> {
    let mut sign = SMatrix::<f64, 8, 8>::zeros();
    sign.fixed_view_mut::<N, N>(0, 0).copy_from(&a);
    sign.fixed_view_mut::<N, N>(0, N).copy_from(&(-b * r.try_inverse()? * b.transpose()));
    sign.fixed_view_mut::<N, N>(N, 0).copy_from(&-q);
    sign.fixed_view_mut::<N, N>(N, N).copy_from(&-a.transpose());
    for _ in 0..100 {
        let next = (sign + sign.try_inverse()?) * 0.5;
        let change = (next - sign).norm();
        sign = next;
        if change < 1e-13 * sign.norm() {
            break;
        }
    }
    // (sign + 1) [1; P] = 0: eight rows for four columns.
    let one = SMatrix::<f64, N, N>::identity();
    let (w11, w12) = (sign.fixed_view::<N, N>(0, 0), sign.fixed_view::<N, N>(0, N));
    let (w21, w22) = (sign.fixed_view::<N, N>(N, 0), sign.fixed_view::<N, N>(N, N));
    let (upper, lower) = (SMatrix::<f64, N, N>::from(w12), w22 + one);
    let (left, right) = (-(w11 + one), -SMatrix::<f64, N, N>::from(w21));
    let normal = upper.transpose() * upper + lower.transpose() * lower;
    Some(normal.try_inverse()? * (upper.transpose() * left + lower.transpose() * right))
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let robot = Prepared::new(&Params::default())?;
    // Straight ahead along x at 1 m/s, both wheels turning alike.
    let straight = [0.0, 0.0, -5.0, -5.0, 0.0, 0.0, 0.0];
    let (jacobian, by_inputs) = (robot.jacobian(0.0, &straight), robot.input_jacobian(0.0, &straight));
    let a = SMatrix::<f64, N, N>::from_fn(|i, j| jacobian[REGULATED[i]][REGULATED[j]]);
    let b = SMatrix::<f64, N, 2>::from_fn(|i, j| by_inputs[REGULATED[i]][j]);
    let weights = SMatrix::from_diagonal(&SVector::from([0.1, 0.1, 4.0, 4.0]));
    let p = riccati(a, b, weights, SMatrix::identity()).ok_or("the Riccati equation has no solution")?;
    let residual = a.transpose() * p + p * a - p * b * b.transpose() * p + weights;
    let gain = b.transpose() * p;
    println!("gain {gain:.4}residual of the Riccati equation {:.1e}", residual.norm());
    println!("eigenvalues with feedback {:.4}", (a - b * gain).complex_eigenvalues());

    let feedback = WithInput::new(robot, |_: f64, y: &[f64; 7]| {
        let error = SVector::<f64, N>::from_fn(|i, _| y[REGULATED[i]] - straight[REGULATED[i]]);
        (-gain * error).into()
    });
    // Half a metre beside the line, turned away from it, and too slow.
    let start = [0.0, 0.0, -4.0, -4.5, 0.4, 0.0, 0.5];
    let options = Options::adaptive(1e-10, 1e-12);
    let mut solver = Integrator::new(&feedback, Dop853, 0.0, start, options)?;
    println!("{:>5} {:>9} {:>9} {:>9}", "t", "x", "y", "heading");
    for k in 0..=10 {
        solver.integrate_to(f64::from(k))?;
        let y = solver.state();
        println!("{:>5} {:>9.4} {:>9.4} {:>9.4}", k, y[5], y[6], y[4]);
    }
    let end = *solver.state();
    let is_on_line = REGULATED.iter().all(|k| (end[*k] - straight[*k]).abs() < 0.02);
    if is_on_line && residual.norm() < 1e-9 { Ok(()) } else { Err("the robot has not found the line".into()) }
}
