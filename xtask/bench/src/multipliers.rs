//! Equations without reduction: all velocities, the full mass matrix `M`, and one multiplier for each constraint row
//! `a v = 0`, by one LU factorisation of nalgebra in every call.
//!
//! ```text
//! [[M, a^T], [a, 0]] (v', -lambda) = (f, -a' v)
//! ```
//!
//! Where there are no constraints it is the mass matrix that is factorised.
//!
//! Deliberately does not know: the generated code, other than the parameters' names.

use nalgebra::{SMatrix, SVector, Vector3};

use crate::kernel::Kernel;
use crate::naive::{self, solve};

/// The saddle-point matrix and right-hand side of dimension `T = N + A`, from `M`, `f`, `a` and `-a' v`; solved for
/// `v'`.
fn saddle<const N: usize, const A: usize, const T: usize>(
    mass: SMatrix<f64, N, N>,
    force: SVector<f64, N>,
    rows: SMatrix<f64, A, N>,
    rate: SVector<f64, A>,
) -> SVector<f64, N>
where
    nalgebra::Const<T>: nalgebra::DimMin<nalgebra::Const<T>, Output = nalgebra::Const<T>>,
{
    let mut matrix = SMatrix::<f64, T, T>::zeros();
    matrix.fixed_view_mut::<N, N>(0, 0).copy_from(&mass);
    matrix.fixed_view_mut::<A, N>(N, 0).copy_from(&rows);
    matrix.fixed_view_mut::<N, A>(0, N).copy_from(&rows.transpose());
    let mut right = SVector::<f64, T>::zeros();
    right.fixed_rows_mut::<N>(0).copy_from(&force);
    right.fixed_rows_mut::<A>(N).copy_from(&rate);
    solve(matrix, right).fixed_rows::<N>(0).into_owned()
}

/// Two vectors, one above the other.
fn stack(a: Vector3<f64>, b: Vector3<f64>) -> SVector<f64, 6> {
    SVector::from([a.x, a.y, a.z, b.x, b.y, b.z])
}

/// A rolling body on se(3) with velocities `(Omega, X)`, constraint `X = Omega x s` and torque `t` of the weight.
///
/// ```text
/// I Omega' = I Omega x Omega + t - s x lambda,    m X' = -m Omega x X + lambda... with rows ([s]x, 1)
/// X' - Omega' x s = Omega x s'
/// ```
fn rolling(
    inertia: [f64; 3],
    m: f64,
    [omega, gamma]: [Vector3<f64>; 2],
    [s, s_dot]: [Vector3<f64>; 2],
    torque: Vector3<f64>,
    dy: &mut [f64; 6],
) {
    let [i1, i2, i3] = inertia;
    let mass = SMatrix::<f64, 6, 6>::from_diagonal(&SVector::from([i1, i2, i3, m, m, m]));
    let x = omega.cross(&s);
    let momentum = Vector3::from(inertia).component_mul(&omega);
    let force = stack(momentum.cross(&omega) + torque, x.cross(&omega) * m);
    let mut rows = SMatrix::<f64, 3, 6>::zeros();
    rows.fixed_view_mut::<3, 3>(0, 0).copy_from(&s.cross_matrix());
    rows.fixed_view_mut::<3, 3>(0, 3).fill_with_identity();
    let v = saddle::<6, 3, 9>(mass, force, rows, omega.cross(&s_dot));
    let gamma_dot = gamma.cross(&omega);
    *dy = [v[0], v[1], v[2], gamma_dot.x, gamma_dot.y, gamma_dot.z];
}

/// Heavy top: no constraint, `M = I`.
pub mod heavy_top {
    use super::{SMatrix, Vector3, solve};
    use hamel_models::generated::heavy_top::Params;

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (omega, gamma) = (Vector3::new(y[0], y[1], y[2]), Vector3::new(y[3], y[4], y[5]));
        let inertia = SMatrix::<f64, 3, 3>::from_diagonal(&Vector3::new(p.I1, p.I2, p.I3));
        let weight = gamma.cross(&Vector3::new(p.chi1, p.chi2, p.chi3)) * (p.m * p.g * p.l);
        let rate = solve(inertia, (inertia * omega).cross(&omega) + weight);
        let gamma_dot = gamma.cross(&omega);
        *dy = [rate.x, rate.y, rate.z, gamma_dot.x, gamma_dot.y, gamma_dot.z];
    }
}

/// Kirchhoff's body: no constraint, `M = [[J, C], [C^T, M]]`.
pub mod kirchhoff_body {
    use super::{SMatrix, Vector3, solve, stack};
    use hamel_models::generated::kirchhoff_body::Params;

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (omega, v) = (Vector3::new(y[0], y[1], y[2]), Vector3::new(y[3], y[4], y[5]));
        let c = SMatrix::<f64, 3, 3>::new(p.C11, p.C12, p.C13, p.C21, p.C22, p.C23, p.C31, p.C32, p.C33);
        let mut mass = SMatrix::<f64, 6, 6>::from_diagonal(&[p.J1, p.J2, p.J3, p.M1, p.M2, p.M3].into());
        mass.fixed_view_mut::<3, 3>(0, 3).copy_from(&c);
        mass.fixed_view_mut::<3, 3>(3, 0).copy_from(&c.transpose());
        let momentum = mass * stack(omega, v);
        let (angular, linear) = (momentum.fixed_rows::<3>(0), momentum.fixed_rows::<3>(3));
        let rate = solve(mass, stack(angular.cross(&omega) + linear.cross(&v), linear.cross(&omega)));
        *dy = rate.into();
    }
}

/// Euler's disk in coordinates `(theta, phi, psi, x1, x2)`, where `x` is the contact and `c = r y + (e r/2) z` points
/// from it to the mass centre. Kinetic energy of translation `M/2 |x' + c'|^2`; constraint `x' = r psi' u(phi)`.
pub mod euler_disk {
    use super::{SMatrix, SVector, Vector3, saddle};
    use hamel_models::generated::euler_disk::Params;

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 5], dy: &mut [f64; 5]) {
        let [theta, phi, theta_dot, phi_dot, psi_dot] = *y;
        let ((st, ct), (sp, cp)) = (theta.sin_cos(), phi.sin_cos());
        let axis = Vector3::new(st * sp, -st * cp, ct);
        let up = Vector3::new(-ct * sp, ct * cp, st);
        let e3 = Vector3::z();
        let (r, h) = (p.r, 0.5 * p.e * p.r);
        // dc/dtheta, dc/dphi and the second derivatives.
        let c = up * r + axis * h;
        let c_theta = axis * r - up * h;
        let c_phi = e3.cross(&c);
        let lag = -c * (theta_dot * theta_dot)
            + e3.cross(&c_theta) * (2.0 * theta_dot * phi_dot)
            + e3.cross(&c_phi) * (phi_dot * phi_dot);
        let jacobian = SMatrix::<f64, 3, 5>::from_columns(&[
            c_theta,
            c_phi,
            Vector3::zeros(),
            Vector3::x(),
            Vector3::y(),
        ]);
        let mut mass = jacobian.transpose() * jacobian * p.M;
        mass[(0, 0)] += p.I1;
        mass[(1, 1)] += p.I1 * st * st + p.I3 * ct * ct;
        mass[(1, 2)] += p.I3 * ct;
        mass[(2, 1)] += p.I3 * ct;
        mass[(2, 2)] += p.I3;
        let spin = psi_dot + phi_dot * ct;
        let mut force = jacobian.transpose() * (e3 * -p.g - lag) * p.M;
        force[0] += p.I1 * phi_dot * phi_dot * st * ct - p.I3 * spin * phi_dot * st;
        force[1] += theta_dot * (p.I3 * st * (spin + phi_dot * ct) - 2.0 * p.I1 * phi_dot * st * ct);
        force[2] += p.I3 * phi_dot * theta_dot * st;
        let mut rows = SMatrix::<f64, 2, 5>::zeros();
        rows[(0, 2)] = r * cp;
        rows[(1, 2)] = r * sp;
        rows[(0, 3)] = 1.0;
        rows[(1, 4)] = 1.0;
        let rate = SVector::from([sp, -cp]) * (r * psi_dot * phi_dot);
        let v = saddle::<5, 2, 7>(mass, force, rows, rate);
        *dy = [theta_dot, phi_dot, v[0], v[1], v[2]];
    }
}

/// Euler's disk on se(3) with `s = r n/|n|`, `n = (Gamma1, Gamma2, 0)`.
pub mod euler_disk_advected {
    use super::{Vector3, rolling};
    use hamel_models::generated::euler_disk_advected::Params;

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (omega, gamma) = (Vector3::new(y[0], y[1], y[2]), Vector3::new(y[3], y[4], y[5]));
        let flat = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
        let unit = flat(gamma).normalize();
        let n_dot = flat(gamma.cross(&omega));
        let s = unit * p.r;
        let s_dot = (n_dot - unit * unit.dot(&n_dot)) * (p.r / flat(gamma).norm());
        let torque = gamma.cross(&s) * (p.m * p.g);
        rolling([p.I1, p.I1, p.I3], p.m, [omega, gamma], [s, s_dot], torque, dy);
    }
}

/// Chaplygin ball on se(3) with `s = r Gamma + l chi`.
pub mod chaplygin_ball {
    use super::{Vector3, rolling};
    use hamel_models::generated::chaplygin_ball::Params;

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (omega, gamma) = (Vector3::new(y[0], y[1], y[2]), Vector3::new(y[3], y[4], y[5]));
        let chi = Vector3::new(p.chi1, p.chi2, p.chi3);
        let (s, s_dot) = (gamma * p.r + chi * p.l, gamma.cross(&omega) * p.r);
        let torque = gamma.cross(&chi) * (p.m * p.g * p.l);
        rolling([p.I1, p.I2, p.I3], p.m, [omega, gamma], [s, s_dot], torque, dy);
    }
}

/// Snakeboard with velocities `(psi', phi', omega, v1, v2)` and constraints `sin phi v1 + r cos phi omega = 0`,
/// `v2 = 0`; then `s' = omega' sin phi - v1' cos phi/r`.
pub mod snakeboard {
    use super::{SMatrix, SVector, naive::snakeboard::mass, saddle};
    use hamel_models::generated::snakeboard::Params;

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 5], dy: &mut [f64; 5]) {
        let [_, phi, psi_dot, phi_dot, s] = *y;
        let (sine, cosine) = phi.sin_cos();
        let (omega, v1) = (sine * s, -p.r * cosine * s);
        let force = SVector::from([0.0, 0.0, 0.0, 0.0, -p.m * omega * v1]);
        let mut rows = SMatrix::<f64, 2, 5>::zeros();
        rows[(0, 2)] = p.r * cosine;
        rows[(0, 3)] = sine;
        rows[(1, 4)] = 1.0;
        let rate = SVector::from([phi_dot * (p.r * sine * omega - cosine * v1), 0.0]);
        let v = saddle::<5, 2, 7>(mass(p), force, rows, rate);
        *dy = [psi_dot, phi_dot, v[0], v[1], sine * v[2] - cosine * v[3] / p.r];
    }
}

/// Two-wheeled robot with velocities `(psi1', psi2', omega, v1, v2)` and the three rolling constraints.
pub mod mobile_robot {
    use super::{SMatrix, SVector, naive::mobile_robot as basics, saddle};
    use hamel_models::generated::mobile_robot::Params;

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 4], dy: &mut [f64; 4]) {
        let [_, _, psi1_dot, psi2_dot] = *y;
        let (omega, v1) = (-0.5 * p.R_ * (psi1_dot - psi2_dot) / p.c, -0.5 * p.R_ * (psi1_dot + psi2_dot));
        let mass = basics::mass(p);
        let force = basics::force(mass, SVector::from([psi1_dot, psi2_dot, omega, v1, 0.0]));
        #[rustfmt::skip]
        let rows = SMatrix::<f64, 3, 5>::new(
            0.0, 0.0, 0.0, 0.0, 1.0,
            p.R_, 0.0, p.c, 1.0, 0.0,
            0.0, p.R_, -p.c, 1.0, 0.0,
        );
        let v = saddle::<5, 3, 8>(mass, force, rows, SVector::zeros());
        *dy = [psi1_dot, psi2_dot, v[0], v[1]];
    }
}

/// Satellite with two arms: no constraint, the mass matrix of `(alpha', beta', Omega)` is `sum m J^T J` over the point
/// masses and the inertia of the main body.
pub mod two_arm_satellite {
    use super::{SMatrix, SVector, Vector3, naive::two_arm_satellite::arms, solve};
    use hamel_models::generated::two_arm_satellite::Params;

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 7], dy: &mut [f64; 7]) {
        let omega = Vector3::new(y[4], y[5], y[6]);
        let inertia = Vector3::new(p.I1, p.I2, p.I3);
        let gyro = inertia.component_mul(&omega).cross(&omega);
        let mut mass = SMatrix::<f64, 5, 5>::from_diagonal(&SVector::from([0.0, 0.0, p.I1, p.I2, p.I3]));
        let mut force = SVector::from([0.0, 0.0, gyro.x, gyro.y, gyro.z]);
        for (k, arm) in arms(p, y).iter().enumerate() {
            let [r, d] = arm.r;
            let mut jacobian = SMatrix::<f64, 3, 5>::zeros();
            jacobian.set_column(k, &d);
            jacobian.fixed_view_mut::<3, 3>(0, 2).copy_from(&-r.cross_matrix());
            mass += jacobian.transpose() * jacobian * arm.m;
            force -= jacobian.transpose() * arm.c * arm.m;
            force[k] += arm.spring;
        }
        let v = solve(mass, force);
        *dy = [y[2], y[3], v[0], v[1], v[2], v[3], v[4]];
    }
}

/// All of them.
pub fn kernels() -> Vec<Kernel> {
    naive::reading_parameters! { "multipliers": heavy_top kirchhoff_body euler_disk euler_disk_advected chaplygin_ball snakeboard
    mobile_robot two_arm_satellite }
}
