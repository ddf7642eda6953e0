//! Equations as an expert writes them by hand: the best frame, parameter-only work done once, no matrix inverted in
//! the call that can be inverted before, one sine and cosine an angle, one division where one suffices.
//!
//! Deliberately does not know: the generated code, other than the parameters' names.

use hamel_models::generated;
use hamel_runtime::math::{mul_add, sin_cos};
use nalgebra::SMatrix;

use crate::kernel::{Kernel, params};

/// Heavy top.
///
/// ```text
/// I Omega' = I Omega x Omega + m g l Gamma x chi,    Gamma' = Gamma x Omega
/// ```
pub mod heavy_top {
    use super::generated::heavy_top::Params;
    use super::mul_add;

    /// Quotients by the moments of inertia.
    pub struct Prepared {
        gyro: [f64; 3],
        /// `m g l chi_k / I_j` for `(j, k) = (1, 3), (1, 2), (2, 1), (2, 3), (3, 2), (3, 1)`.
        weight: [f64; 6],
    }

    impl Prepared {
        /// Precomputes.
        pub fn new(p: &Params) -> Self {
            let w = p.m * p.g * p.l;
            let (a1, a2, a3) = (1.0 / p.I1, 1.0 / p.I2, 1.0 / p.I3);
            Self {
                gyro: [(p.I2 - p.I3) * a1, (p.I3 - p.I1) * a2, (p.I1 - p.I2) * a3],
                weight: [
                    w * p.chi3 * a1,
                    w * p.chi2 * a1,
                    w * p.chi1 * a2,
                    w * p.chi3 * a2,
                    w * p.chi2 * a3,
                    w * p.chi1 * a3,
                ],
            }
        }
    }

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Prepared, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let [o1, o2, o3, g1, g2, g3] = *y;
        let [k1, k2, k3] = p.gyro;
        let [w13, w12, w21, w23, w32, w31] = p.weight;
        *dy = [
            mul_add(k1 * o2, o3, mul_add(w13, g2, -(w12 * g3))),
            mul_add(k2 * o3, o1, mul_add(w21, g3, -(w23 * g1))),
            mul_add(k3 * o1, o2, mul_add(w32, g1, -(w31 * g2))),
            mul_add(g2, o3, -(g3 * o2)),
            mul_add(g3, o1, -(g1 * o3)),
            mul_add(g1, o2, -(g2 * o1)),
        ];
    }
}

/// Kirchhoff's body.
///
/// ```text
/// (Pi, P) = K (Omega, V),    K = [[J, C], [C^T, M]],    (Omega, V)' = K^-1 (Pi x Omega + P x V, P x Omega)
/// ```
pub mod kirchhoff_body {
    use super::generated::kirchhoff_body::Params;
    use super::{SMatrix, mul_add};

    /// `K` in its parts, and its inverse.
    pub struct Prepared {
        j: [f64; 3],
        m: [f64; 3],
        c: [[f64; 3]; 3],
        inverse: [[f64; 6]; 6],
    }

    impl Prepared {
        /// Precomputes.
        ///
        /// # Panics
        /// When the inertia matrix is singular.
        pub fn new(p: &Params) -> Self {
            let (j, m) = ([p.J1, p.J2, p.J3], [p.M1, p.M2, p.M3]);
            let c = [[p.C11, p.C12, p.C13], [p.C21, p.C22, p.C23], [p.C31, p.C32, p.C33]];
            let k = SMatrix::<f64, 6, 6>::from_fn(|a, b| match (a < 3, b < 3) {
                (true, true) => f64::from(u8::from(a == b)) * j[a],
                (false, false) => f64::from(u8::from(a == b)) * m[a - 3],
                (true, false) => c[a][b - 3],
                (false, true) => c[b][a - 3],
            });
            let k = k.try_inverse().expect("the inertia matrix is invertible");
            Self { j, m, c, inverse: [0, 1, 2, 3, 4, 5].map(|a| [0, 1, 2, 3, 4, 5].map(|b| k[(a, b)])) }
        }
    }

    #[inline(always)]
    fn dot(a: [f64; 3], b: [f64; 3], start: f64) -> f64 {
        mul_add(a[0], b[0], mul_add(a[1], b[1], mul_add(a[2], b[2], start)))
    }

    #[inline(always)]
    fn cross(a: [f64; 3], b: [f64; 3], start: [f64; 3]) -> [f64; 3] {
        [
            mul_add(a[1], b[2], mul_add(-a[2], b[1], start[0])),
            mul_add(a[2], b[0], mul_add(-a[0], b[2], start[1])),
            mul_add(a[0], b[1], mul_add(-a[1], b[0], start[2])),
        ]
    }

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Prepared, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let (o, v) = ([y[0], y[1], y[2]], [y[3], y[4], y[5]]);
        let (j, c, m) = (&p.j, &p.c, &p.m);
        let angular = [dot(c[0], v, j[0] * o[0]), dot(c[1], v, j[1] * o[1]), dot(c[2], v, j[2] * o[2])];
        let column = |a: usize| [c[0][a], c[1][a], c[2][a]];
        let linear =
            [dot(column(0), o, m[0] * v[0]), dot(column(1), o, m[1] * v[1]), dot(column(2), o, m[2] * v[2])];
        let torque = cross(angular, o, cross(linear, v, [0.0; 3]));
        let force = cross(linear, o, [0.0; 3]);
        let f = [torque[0], torque[1], torque[2], force[0], force[1], force[2]];
        // Loops and indices, not `map` of an array, which stays a call.
        for a in 0..6 {
            let k = &p.inverse[a];
            let tail = mul_add(k[3], f[3], mul_add(k[4], f[4], k[5] * f[5]));
            dy[a] = mul_add(k[0], f[0], mul_add(k[1], f[1], mul_add(k[2], f[2], tail)));
        }
    }
}

/// Euler's disk, in the frame `(n, y, z)` that turns with nodes and inclination but not with the spin.
///
/// With `(p, q, s) = (theta', phi' sin theta, phi' cos theta)`, the total spin `w = psi' + s`, `h = e r/2` and
/// `k = r q + h s`, the balance of angular momentum about the contact has constant coefficients:
///
/// ```text
/// (I1 + M (r^2 + h^2)) p' = I1 s q - I3 q w + M (q h - r w) k - M g (r cos theta - h sin theta)
/// [[I1 + M h^2, -M r h], [-M r h, I3 + M r^2]] (q', w') = p (I3 w - I1 s - h M k, r M k)
/// phi'' = (q' - p s)/sin theta,    psi'' = w' - phi'' cos theta + p q
/// ```
pub mod euler_disk {
    use super::generated::euler_disk::Params;
    use super::{mul_add, sin_cos};

    /// Coefficients.
    pub struct Prepared {
        /// `p' = q (a0 s + a1 w + a2 k) + a3 w k + a4 cos theta + a5 sin theta`.
        a: [f64; 6],
        /// `q' = p (b0 w + b1 s + b2 k)`.
        b: [f64; 3],
        /// `w' = p (c0 w + c1 s + c2 k)`.
        c: [f64; 3],
        r: f64,
        h: f64,
    }

    impl Prepared {
        /// Precomputes.
        pub fn new(p: &Params) -> Self {
            let (m, r, h) = (p.M, p.r, 0.5 * p.e * p.r);
            let about_contact = p.I1 + m * (r * r + h * h);
            let [a11, a12, a22] = [p.I1 + m * h * h, -m * r * h, p.I3 + m * r * r];
            let det = a11 * a22 - a12 * a12;
            // Columns of what multiplies w, s and k on the right-hand side.
            let columns = [[p.I3, 0.0], [-p.I1, 0.0], [-h * m, r * m]];
            Self {
                a: [p.I1, -p.I3, m * h, -m * r, -m * p.g * r, m * p.g * h].map(|x| x / about_contact),
                b: columns.map(|[f, g]| (a22 * f - a12 * g) / det),
                c: columns.map(|[f, g]| (a11 * g - a12 * f) / det),
                r,
                h,
            }
        }
    }

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(prepared: &Prepared, _: f64, y: &[f64; 5], dy: &mut [f64; 5]) {
        let [theta, _, p, phi_dot, psi_dot] = *y;
        let Prepared { a, b, c, r, h } = *prepared;
        let (sine, cosine) = sin_cos(theta);
        let (q, s) = (phi_dot * sine, phi_dot * cosine);
        let w = psi_dot + s;
        let k = mul_add(r, q, h * s);
        let gyro = mul_add(a[0], s, mul_add(a[1], w, a[2] * k));
        let weight = mul_add(a[4], cosine, a[5] * sine);
        let p_dot = mul_add(q, gyro, mul_add(a[3] * w, k, weight));
        let q_dot = mul_add(b[0], w, mul_add(b[1], s, b[2] * k));
        let w_dot = mul_add(c[0], w, mul_add(c[1], s, c[2] * k));
        let phi_ddot = p * (q_dot - s) / sine;
        *dy = [p, phi_dot, p_dot, phi_ddot, mul_add(p, w_dot + q, -(phi_ddot * cosine))];
    }
}

/// Chaplygin ball.
///
/// With `f = sqrt(m) (r Gamma + l chi)` and `d = I + |f|^2` the matrix is diagonal but for one term of rank one, so
/// that it is inverted by the formula of Sherman and Morrison with one division:
///
/// ```text
/// (diag(d) - f f^T) Omega' = I Omega x Omega + m l (g + r |Omega|^2) Gamma x chi - sqrt(m) l (Omega . chi) f x Omega
/// Gamma' = Gamma x Omega
/// ```
pub mod chaplygin_ball {
    use super::generated::chaplygin_ball::Params;
    use super::mul_add;

    /// Coefficients.
    pub struct Prepared {
        inertia: [f64; 3],
        /// `I2 - I3, I3 - I1, I1 - I2`.
        gyro: [f64; 3],
        /// `sqrt(m) r`.
        radius: f64,
        /// `sqrt(m) l chi`.
        offset: [f64; 3],
        /// `m l r chi`.
        lever: [f64; 3],
        /// `g/r`.
        weight: f64,
    }

    impl Prepared {
        /// Precomputes.
        pub fn new(p: &Params) -> Self {
            let (chi, root) = ([p.chi1, p.chi2, p.chi3], p.m.sqrt());
            Self {
                inertia: [p.I1, p.I2, p.I3],
                gyro: [p.I2 - p.I3, p.I3 - p.I1, p.I1 - p.I2],
                radius: root * p.r,
                offset: chi.map(|x| root * p.l * x),
                lever: chi.map(|x| p.m * p.l * p.r * x),
                weight: p.g / p.r,
            }
        }
    }

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Prepared, _: f64, y: &[f64; 6], dy: &mut [f64; 6]) {
        let [o1, o2, o3, g1, g2, g3] = *y;
        let [x1, x2, x3] = p.offset;
        let [l1, l2, l3] = p.lever;
        let f = [mul_add(p.radius, g1, x1), mul_add(p.radius, g2, x2), mul_add(p.radius, g3, x3)];
        let [f1, f2, f3] = f;
        let along = mul_add(o1, x1, mul_add(o2, x2, o3 * x3));
        let height = mul_add(o1, o1, mul_add(o2, o2, mul_add(o3, o3, p.weight)));
        let b1 = mul_add(
            p.gyro[0] * o2,
            o3,
            mul_add(height, mul_add(g2, l3, -(g3 * l2)), -(along * mul_add(f2, o3, -(f3 * o2)))),
        );
        let b2 = mul_add(
            p.gyro[1] * o3,
            o1,
            mul_add(height, mul_add(g3, l1, -(g1 * l3)), -(along * mul_add(f3, o1, -(f1 * o3)))),
        );
        let b3 = mul_add(
            p.gyro[2] * o1,
            o2,
            mul_add(height, mul_add(g1, l2, -(g2 * l1)), -(along * mul_add(f1, o2, -(f2 * o1)))),
        );
        let square = mul_add(f1, f1, mul_add(f2, f2, f3 * f3));
        let [d1, d2, d3] = p.inertia.map(|i| i + square);
        // adj(diag(d)), its product with f, det(diag(d)) and det of the whole.
        let (a1, a2, a3) = (d2 * d3, d1 * d3, d1 * d2);
        let (u1, u2, u3) = (a1 * f1, a2 * f2, a3 * f3);
        let det_d = d1 * a1;
        let det = det_d - mul_add(u1, f1, mul_add(u2, f2, u3 * f3));
        let both = 1.0 / (det_d * det);
        let factor = mul_add(u1, b1, mul_add(u2, b2, u3 * b3)) * (both * det_d);
        let inverse = both * det;
        *dy = [
            inverse * a1 * mul_add(f1, factor, b1),
            inverse * a2 * mul_add(f2, factor, b2),
            inverse * a3 * mul_add(f3, factor, b3),
            mul_add(g2, o3, -(g3 * o2)),
            mul_add(g3, o1, -(g1 * o3)),
            mul_add(g1, o2, -(g2 * o1)),
        ];
    }
}

/// Snakeboard.
///
/// With `q = (J + 2 J1)/(m r^2)` and `k = s phi' cos phi/(cos^2 phi + q sin^2 phi)`
///
/// ```text
/// psi'' = -k,    phi'' = 0,    s' = (1 - q) k sin phi
/// ```
///
/// `1 + (q - 1) sin^2 phi` in the denominator would share `(q - 1) sin phi` and save two multiplications, but for a
/// light rotor, `q << 1`, it loses the digits of `q` next to `phi = pi/2`: an error of `eps/q` where rounding `phi`
/// does `eps/sqrt(q)`.
pub mod snakeboard {
    use super::generated::snakeboard::Params;
    use super::{mul_add, sin_cos};

    /// `q` and `q - 1`.
    pub struct Prepared {
        ratio: f64,
        excess: f64,
    }

    impl Prepared {
        /// Precomputes.
        pub fn new(p: &Params) -> Self {
            let [inertia, moment] = [p.J + 2.0 * p.J1, p.m * p.r * p.r];
            Self { ratio: inertia / moment, excess: (inertia - moment) / moment }
        }
    }

    /// The right-hand side.
    #[inline(never)]
    pub fn rhs(p: &Prepared, _: f64, y: &[f64; 5], dy: &mut [f64; 5]) {
        let [_, phi, psi_dot, phi_dot, s] = *y;
        let (sine, cosine) = sin_cos(phi);
        let k = -(s * phi_dot * cosine) / mul_add(p.ratio * sine, sine, cosine * cosine);
        *dy = [psi_dot, phi_dot, k, 0.0, p.excess * sine * k];
    }
}

macro_rules! kernels {
    ($($model:ident)*) => {
        vec![$(Kernel::new(
            &generated::$model::INFO,
            "expert",
            1,
            |values| $model::Prepared::new(&generated::$model::Params::from_array(params(values))),
            $model::rhs,
        )),*]
    };
}

/// All of them.
pub fn kernels() -> Vec<Kernel> {
    kernels! { heavy_top kirchhoff_body euler_disk chaplygin_ball snakeboard }
}
