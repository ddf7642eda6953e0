//! Equations as vector algebra with nalgebra, the way they stand in a textbook: cross products, matrices assembled and
//! inverted or solved in every call, parameters read in every call.
//!
//! Deliberately does not know: the generated code, other than the parameters' names.

use hamel_models::generated;
use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

use crate::kernel::Kernel;

/// Writes `(Omega', Gamma x Omega)`.
fn write(rate: Vector3<f64>, gamma: Vector3<f64>, omega: Vector3<f64>, dy: &mut [f64; 6]) {
    let gamma_dot = gamma.cross(&omega);
    *dy = [rate.x, rate.y, rate.z, gamma_dot.x, gamma_dot.y, gamma_dot.z];
}

/// The inertia about a point at distance `-s`: `I - m [s]x^2`.
fn about(inertia: Matrix3<f64>, m: f64, s: Vector3<f64>) -> Matrix3<f64> {
    let skew = s.cross_matrix();
    inertia - skew * skew * m
}

/// The inverse, or something that is not finite: a right-hand side does not panic.
fn inverse(matrix: Matrix3<f64>) -> Matrix3<f64> {
    matrix.try_inverse().unwrap_or(Matrix3::repeat(f64::NAN))
}

/// The solution, or something that is not finite.
pub(crate) fn solve<const N: usize>(matrix: SMatrix<f64, N, N>, right: SVector<f64, N>) -> SVector<f64, N>
where
    nalgebra::Const<N>: nalgebra::DimMin<nalgebra::Const<N>, Output = nalgebra::Const<N>>,
{
    matrix.lu().solve(&right).unwrap_or(SVector::repeat(f64::NAN))
}

/// Heavy top.
///
/// ```text
/// Omega' = I^-1 (I Omega x Omega + m g l Gamma x chi),    Gamma' = Gamma x Omega
/// ```
pub mod heavy_top {
    use super::generated::heavy_top::Params;
    use super::{Matrix3, Vector3, inverse, write};

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (omega, gamma) = (Vector3::new(y[0], y[1], y[2]), Vector3::new(y[3], y[4], y[5]));
        let inertia = Matrix3::from_diagonal(&Vector3::new(p.I1, p.I2, p.I3));
        let chi = Vector3::new(p.chi1, p.chi2, p.chi3);
        let torque = (inertia * omega).cross(&omega) + gamma.cross(&chi) * (p.m * p.g * p.l);
        write(inverse(inertia) * torque, gamma, omega, dy);
    }
}

/// Kirchhoff's body.
///
/// ```text
/// Pi = J Omega + C V,    P = C^T Omega + M V,    t = Pi x Omega + P x V,    f = P x Omega
/// Omega' = (J - C M^-1 C^T)^-1 (t - C M^-1 f),    V' = M^-1 (f - C^T Omega')
/// ```
pub mod kirchhoff_body {
    use super::generated::kirchhoff_body::Params;
    use super::{Matrix3, Vector3, inverse};

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (omega, v) = (Vector3::new(y[0], y[1], y[2]), Vector3::new(y[3], y[4], y[5]));
        let j = Matrix3::from_diagonal(&Vector3::new(p.J1, p.J2, p.J3));
        let m = Matrix3::from_diagonal(&Vector3::new(p.M1, p.M2, p.M3));
        let c = Matrix3::new(p.C11, p.C12, p.C13, p.C21, p.C22, p.C23, p.C31, p.C32, p.C33);
        let (angular, linear) = (j * omega + c * v, c.transpose() * omega + m * v);
        let torque = angular.cross(&omega) + linear.cross(&v);
        let force = linear.cross(&omega);
        let coupling = c * inverse(m);
        let omega_dot = inverse(j - coupling * c.transpose()) * (torque - coupling * force);
        let v_dot = inverse(m) * (force - c.transpose() * omega_dot);
        *dy = [omega_dot.x, omega_dot.y, omega_dot.z, v_dot.x, v_dot.y, v_dot.z];
    }
}

/// Euler's disk, in the frame `(n, y, z)` of nodes and axis, which turns with
/// `f = (theta', phi' sin theta, phi' cos theta)`.
///
/// The body turns with `Omega = f + (0, 0, psi')`, the mass centre is at `s = (0, r, e r/2)` from the contact and moves
/// with `v = Omega x s`; gravity is `G`.
///
/// ```text
/// (I - M [s]x^2) Omega' = -f x I Omega - s x (M f x v - G)
/// ```
pub mod euler_disk {
    use super::generated::euler_disk::Params;
    use super::{Matrix3, Vector3, about, inverse};

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 5], dy: &mut [f64; 5]) {
        let [theta, _, theta_dot, phi_dot, psi_dot] = *y;
        let (sine, cosine) = theta.sin_cos();
        let frame = Vector3::new(theta_dot, phi_dot * sine, phi_dot * cosine);
        let omega = frame + Vector3::new(0.0, 0.0, psi_dot);
        let s = Vector3::new(0.0, p.r, 0.5 * p.e * p.r);
        let inertia = Matrix3::from_diagonal(&Vector3::new(p.I1, p.I1, p.I3));
        let gravity = Vector3::new(0.0, sine, cosine) * (-p.M * p.g);
        let force = frame.cross(&omega.cross(&s)) * p.M - gravity;
        let torque = -frame.cross(&(inertia * omega)) - s.cross(&force);
        let rate = inverse(about(inertia, p.M, s)) * torque;
        let phi_ddot = (rate.y - phi_dot * theta_dot * cosine) / sine;
        let psi_ddot = rate.z - phi_ddot * cosine + phi_dot * theta_dot * sine;
        *dy = [theta_dot, phi_dot, rate.x, phi_ddot, psi_ddot];
    }
}

/// Euler's disk with an advected parameter.
///
/// With `n = (Gamma1, Gamma2, 0)`, `s = r n/|n|`, `X = Omega x s`:
///
/// ```text
/// (I - m [s]x^2) Omega' = I Omega x Omega + m g Gamma x s - m s x (Omega x (s' + X)),    Gamma' = Gamma x Omega
/// ```
pub mod euler_disk_advected {
    use super::generated::euler_disk_advected::Params;
    use super::{Matrix3, Vector3, about, inverse, write};

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (omega, gamma) = (Vector3::new(y[0], y[1], y[2]), Vector3::new(y[3], y[4], y[5]));
        let inertia = Matrix3::from_diagonal(&Vector3::new(p.I1, p.I1, p.I3));
        let flat = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0);
        let unit = flat(gamma).normalize();
        let n_dot = flat(gamma.cross(&omega));
        let s = unit * p.r;
        let s_dot = (n_dot - unit * unit.dot(&n_dot)) * (p.r / flat(gamma).norm());
        let x = omega.cross(&s);
        let torque = (inertia * omega).cross(&omega) + gamma.cross(&s) * (p.m * p.g)
            - s.cross(&omega.cross(&(s_dot + x))) * p.m;
        write(inverse(about(inertia, p.m, s)) * torque, gamma, omega, dy);
    }
}

/// Chaplygin ball.
///
/// With `f = r Gamma + l chi`, `X = Omega x f`:
///
/// ```text
/// (I - m [f]x^2) Omega' = I Omega x Omega + m g l Gamma x chi - m f x (Omega x (f' + X)),    Gamma' = Gamma x Omega
/// ```
pub mod chaplygin_ball {
    use super::generated::chaplygin_ball::Params;
    use super::{Matrix3, Vector3, about, inverse, write};

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (omega, gamma) = (Vector3::new(y[0], y[1], y[2]), Vector3::new(y[3], y[4], y[5]));
        let inertia = Matrix3::from_diagonal(&Vector3::new(p.I1, p.I2, p.I3));
        let chi = Vector3::new(p.chi1, p.chi2, p.chi3);
        let phi = gamma * p.r + chi * p.l;
        let phi_dot = gamma.cross(&omega) * p.r;
        let x = omega.cross(&phi);
        let torque = (inertia * omega).cross(&omega) + gamma.cross(&chi) * (p.m * p.g * p.l)
            - phi.cross(&omega.cross(&(phi_dot + x))) * p.m;
        write(inverse(about(inertia, p.m, phi)) * torque, gamma, omega, dy);
    }
}

/// Snakeboard, projected to a basis `W` of the constraint.
///
/// Velocities `v = (psi', phi', omega, v1, v2) = W u`, `u = (psi', phi', s)`, generalised forces `f` of the rotating
/// frame:
///
/// ```text
/// W^T M W u' = W^T (f - M W' u)
/// ```
pub mod snakeboard {
    use super::generated::snakeboard::Params;
    use super::{SMatrix, SVector, Vector3, inverse};

    /// The mass matrix of `(psi', phi', omega, v1, v2)`.
    pub(crate) fn mass(p: &Params) -> SMatrix<f64, 5, 5> {
        let mut mass = SMatrix::<f64, 5, 5>::zeros();
        mass[(0, 0)] = p.J0;
        mass[(0, 2)] = p.J0;
        mass[(2, 0)] = p.J0;
        mass[(1, 1)] = 2.0 * p.J1;
        mass[(2, 2)] = p.J + p.J0 + 2.0 * p.J1;
        mass[(3, 3)] = p.m;
        mass[(4, 4)] = p.m;
        mass
    }

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 5], dy: &mut [f64; 5]) {
        let [_, phi, psi_dot, phi_dot, s] = *y;
        let (sine, cosine) = phi.sin_cos();
        let mut basis = SMatrix::<f64, 5, 3>::zeros();
        basis[(0, 0)] = 1.0;
        basis[(1, 1)] = 1.0;
        basis[(2, 2)] = sine;
        basis[(3, 2)] = -p.r * cosine;
        let mut basis_dot = SMatrix::<f64, 5, 3>::zeros();
        basis_dot[(2, 2)] = cosine * phi_dot;
        basis_dot[(3, 2)] = p.r * sine * phi_dot;
        let u = Vector3::new(psi_dot, phi_dot, s);
        let v = basis * u;
        let force = SVector::from([0.0, 0.0, 0.0, p.m * v[2] * v[4], -p.m * v[2] * v[3]]);
        let mass = mass(p);
        let right = basis.transpose() * (force - mass * (basis_dot * u));
        let rate = inverse(basis.transpose() * mass * basis) * right;
        *dy = [psi_dot, phi_dot, rate.x, rate.y, rate.z];
    }
}

/// Two-wheeled robot, projected to a basis `W` of the constraint.
///
/// Velocities `v = (psi1', psi2', omega, v1, v2) = W u`, `u = (psi1', psi2')`, generalised forces `f` of the rotating
/// frame:
///
/// ```text
/// W^T M W u' = W^T f
/// ```
pub mod mobile_robot {
    use super::generated::mobile_robot::Params;
    use super::{SMatrix, SVector, Vector2};

    /// The mass matrix of `(psi1', psi2', omega, v1, v2)`.
    pub(crate) fn mass(p: &Params) -> SMatrix<f64, 5, 5> {
        let m = p.m0 + 2.0 * p.m1;
        let mut mass = SMatrix::<f64, 5, 5>::from_diagonal(&SVector::from([p.J2, p.J2, p.J, m, m]));
        mass[(2, 4)] = p.m0 * p.l;
        mass[(4, 2)] = p.m0 * p.l;
        mass
    }

    /// The force of the rotating frame, `(0, 0, v2 p1 - v1 p2, omega p2, -omega p1)` with `p = M v`.
    pub(crate) fn force(mass: SMatrix<f64, 5, 5>, v: SVector<f64, 5>) -> SVector<f64, 5> {
        let momentum = mass * v;
        let (p1, p2) = (momentum[3], momentum[4]);
        SVector::from([0.0, 0.0, v[4] * p1 - v[3] * p2, v[2] * p2, -v[2] * p1])
    }

    /// A basis of the constraint.
    pub(crate) fn basis(p: &Params) -> SMatrix<f64, 5, 2> {
        let (half, turn) = (-0.5 * p.R_, -0.5 * p.R_ / p.c);
        SMatrix::<f64, 5, 2>::new(1.0, 0.0, 0.0, 1.0, turn, -turn, half, half, 0.0, 0.0)
    }

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 4], dy: &mut [f64; 4]) {
        let [_, _, psi1_dot, psi2_dot] = *y;
        let (basis, mass) = (basis(p), mass(p));
        let force = force(mass, basis * Vector2::new(psi1_dot, psi2_dot));
        let reduced = basis.transpose() * mass * basis;
        let rate = super::solve(reduced, basis.transpose() * force);
        *dy = [psi1_dot, psi2_dot, rate.x, rate.y];
    }
}

/// Satellite with two arms, the arms eliminated.
///
/// For a mass `m` at `r(x)` with `d = dr/dx`: `L = I - sum m [r]x^2` is the locked inertia, `b = m r x d` couples the
/// arm, `c = Omega x (Omega x r) + 2 x' Omega x d + x'^2 d^2r/dx^2`, `h = -k x - m d . c`:
///
/// ```text
/// (L - sum b b^T/(m d.d)) Omega' = I Omega x Omega - sum (m r x c + b h/(m d.d))
/// x'' = (h - b . Omega')/(m d.d)
/// ```
pub mod two_arm_satellite {
    use super::generated::two_arm_satellite::Params;
    use super::{Matrix3, Vector3, about, inverse};

    /// A point mass on an arm.
    pub(crate) struct Arm {
        pub(crate) m: f64,
        /// `r`, `dr/dx`.
        pub(crate) r: [Vector3<f64>; 2],
        /// `c`.
        pub(crate) c: Vector3<f64>,
        /// Generalised force of the spring.
        pub(crate) spring: f64,
    }

    /// The arms at a state.
    pub(crate) fn arms(p: &Params, y: &[f64; 7]) -> [Arm; 2] {
        let [alpha, beta, alpha_dot, beta_dot, o1, o2, o3] = *y;
        let omega = Vector3::new(o1, o2, o3);
        let ((sa, ca), (sb, cb)) = (alpha.sin_cos(), beta.sin_cos());
        let arm =
            |m: f64, hinge: Vector3<f64>, lever: Vector3<f64>, d: Vector3<f64>, x_dot: f64, spring: f64| {
                let r = hinge + lever;
                let c =
                    omega.cross(&omega.cross(&r)) + omega.cross(&d) * (2.0 * x_dot) - lever * (x_dot * x_dot);
                Arm { m, r: [r, d], c, spring }
            };
        [
            arm(
                p.ma,
                Vector3::new(0.6, 0.0, 0.0),
                Vector3::new(ca, sa, 0.0) * p.la,
                Vector3::new(-sa, ca, 0.0) * p.la,
                alpha_dot,
                -p.ka * alpha,
            ),
            arm(
                p.mb,
                Vector3::new(0.0, 0.5, 0.2),
                Vector3::new(0.0, cb, sb) * p.lb,
                Vector3::new(0.0, -sb, cb) * p.lb,
                beta_dot,
                -p.kb * beta,
            ),
        ]
    }

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Params, _: f64, y: &[f64; 7], dy: &mut [f64; 7]) {
        let [_, _, alpha_dot, beta_dot, o1, o2, o3] = *y;
        let omega = Vector3::new(o1, o2, o3);
        let inertia = Matrix3::from_diagonal(&Vector3::new(p.I1, p.I2, p.I3));
        let (mut matrix, mut torque) = (inertia, (inertia * omega).cross(&omega));
        let arms = arms(p, y).map(|Arm { m, r: [r, d], c, spring }| {
            let (b, own, h) = (r.cross(&d) * m, m * d.dot(&d), spring - m * d.dot(&c));
            matrix = about(matrix, m, r) - b * b.transpose() / own;
            torque -= r.cross(&c) * m + b * (h / own);
            (b, own, h)
        });
        let rate = inverse(matrix) * torque;
        let [alpha_ddot, beta_ddot] = arms.map(|(b, own, h)| (h - b.dot(&rate)) / own);
        *dy = [alpha_dot, beta_dot, alpha_ddot, beta_ddot, rate.x, rate.y, rate.z];
    }
}

/// Kernels of the modules named like their models, whose right-hand sides read the parameters themselves.
macro_rules! reading_parameters {
    ($kind:literal: $($model:ident)*) => {
        vec![$($crate::Kernel::new(
            &hamel_models::generated::$model::INFO,
            $kind,
            1,
            |values| hamel_models::generated::$model::Params::from_array($crate::kernel::params(values)),
            $model::rhs,
        )),*]
    };
}
pub(crate) use reading_parameters;

/// All of them.
pub fn kernels() -> Vec<Kernel> {
    reading_parameters! { "naive": heavy_top kirchhoff_body euler_disk euler_disk_advected chaplygin_ball
        snakeboard mobile_robot
    two_arm_satellite }
}
