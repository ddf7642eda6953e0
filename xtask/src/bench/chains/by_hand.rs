//! Right-hand sides of the chains by recursions written by hand, each for its chain alone, in loops over the bodies;
//! that of the arm in space is without loops, in `spatial_arm.rs`.
//!
//! What depends on parameters alone is computed once. Masses and lengths are those of
//! `codegen/tests/linkages/families.rs`.
//!
//! Does not know: the generated code, other than the order of its state.

#[path = "spatial_arm.rs"]
mod spatial_arm;

use hamel_runtime::SceneInfo;
use hamel_runtime::math::{mul_add, sin_cos};

use crate::kernel::{Kernel, Rhs};

const G: f64 = 9.81;

fn mass(k: usize) -> f64 {
    1.0 + 0.1 * (k + 1) as f64
}

/// `a b + c d`.
fn sum(a: f64, b: f64, c: f64, d: f64) -> f64 {
    mul_add(a, b, c * d)
}

/// `a b - c d`.
fn difference(a: f64, b: f64, c: f64, d: f64) -> f64 {
    mul_add(a, b, -(c * d))
}

/// A snake on wheels, in the velocities `omega` and `v1` of its first link.
///
/// The wheel of the next link makes `(x, u)` of a link, velocity along it and length times rate of turning, those of
/// the next one by a reflection:
///
/// ```text
/// x' = cos(a) x - sin(a) u,    u' = -sin(a) x - cos(a) u,    a_dot = (u' - u)/l
/// ```
///
/// The equations are `sum V^T (D V z' + D b) = 0` with `D = diag(m, J/l^2)`, the products `V` of these reflections and
/// `b = V' z`, where `z` has the velocities of the first link.
///
/// # Source
/// Kane and Levinson 1985, Dynamics (partial velocities)
mod snake {
    use super::{difference, mul_add, sin_cos, sum};

    /// Mass and `J/l^2` of a link, its length and the reciprocal of that.
    pub struct Prepared {
        m: f64,
        j: f64,
        l: f64,
        per_l: f64,
    }

    pub fn prepare(_: &[f64]) -> Prepared {
        let (m, moment, l) = (1.1, 0.1, 0.4);
        Prepared { m, j: moment / (l * l), l, per_l: 1.0 / l }
    }

    /// State: `N - 1` angles, `omega`, `v1`.
    #[inline(never)]
    pub fn rhs<const N: usize, const DIM: usize>(p: &Prepared, _: f64, y: &[f64; DIM], dy: &mut [f64; DIM]) {
        let Prepared { m, j, l, per_l } = *p;
        let (mut x, mut u) = (y[N], l * y[N - 1]);
        // x and u by v1, by l omega, and what is left of their rates.
        let (mut by_v, mut by_w, mut bias) = ([1.0, 0.0], [0.0, 1.0], [0.0, 0.0]);
        let (mut vv, mut vw, mut ww) = (m, 0.0, j);
        let (mut f_v, mut f_w) = (0.0, 0.0);
        for k in 0..N - 1 {
            let (s, c) = sin_cos(y[k]);
            let next = |[a, b]: [f64; 2]| [difference(c, a, s, b), -sum(s, a, c, b)];
            let [x_next, u_next] = next([x, u]);
            let rate = (u_next - u) * per_l;
            dy[k] = rate;
            (x, u) = (x_next, u_next);
            (by_v, by_w) = (next(by_v), next(by_w));
            let [b, d] = next(bias);
            bias = [mul_add(rate, u, b), mul_add(-rate, x, d)];
            let [mb, jd] = [m * bias[0], j * bias[1]];
            let [mv, jv] = [m * by_v[0], j * by_v[1]];
            vv = mul_add(mv, by_v[0], mul_add(jv, by_v[1], vv));
            vw = mul_add(mv, by_w[0], mul_add(jv, by_w[1], vw));
            ww = mul_add(m * by_w[0], by_w[0], mul_add(j * by_w[1], by_w[1], ww));
            f_v = mul_add(-by_v[0], mb, mul_add(-by_v[1], jd, f_v));
            f_w = mul_add(-by_w[0], mb, mul_add(-by_w[1], jd, f_w));
        }
        let per_det = 1.0 / difference(vv, ww, vw, vw);
        dy[N - 1] = difference(vv, f_w, vw, f_v) * (per_det * per_l);
        dy[N] = difference(ww, f_v, vw, f_w) * per_det;
    }
}

/// An arm in the vertical plane, as articulated bodies in axes of the plane.
///
/// A body `k` and those behind it resist a motion of its joint with `F = M a + b`, a force without a torque, once their
/// turning has been eliminated; gravity is an acceleration of the base.
///
/// # Source
/// Featherstone 2008, Rigid Body Dynamics Algorithms, table 7.1
mod planar_arm {
    use super::{G, difference, mass, mul_add, sin_cos, sum};

    /// Of each body: `m`, `m c`, `J + m c^2` and `l`.
    pub struct Prepared<const N: usize>([[f64; 4]; N]);

    pub fn prepare<const N: usize>(_: &[f64]) -> Prepared<N> {
        Prepared(std::array::from_fn(|k| [mass(k), mass(k) * 0.2, 0.1 + mass(k) * 0.04, 0.5]))
    }

    /// State: `N` angles between links, their rates.
    #[inline(never)]
    pub fn rhs<const N: usize, const DIM: usize>(
        p: &Prepared<N>,
        _: f64,
        y: &[f64; DIM],
        dy: &mut [f64; DIM],
    ) {
        let (mut along, mut squares) = ([[0.0; 2]; N], [0.0; N]);
        let (mut angle, mut w) = (0.0, 0.0);
        for k in 0..N {
            angle += y[k];
            w += y[N + k];
            dy[k] = y[N + k];
            let (s, c) = sin_cos(angle);
            (along[k], squares[k]) = ([c, s], w * w);
        }
        // Of the bodies behind: M with entries xx, xy, yy, and b.
        let (mut xx, mut xy, mut yy, mut bx, mut by) = (0.0, 0.0, 0.0, 0.0, 0.0);
        // -(h . a + t) is the angular acceleration of a body whose joint has the acceleration a.
        let mut turns = [[0.0; 3]; N];
        for k in (0..N).rev() {
            let ([m, mc, moment, l], [c, s], ww) = (p.0[k], along[k], squares[k]);
            // M e', e' = (-s, c) across the link, and M e.
            let (ax, ay) = (difference(xy, c, xx, s), difference(yy, c, xy, s));
            let (ex, ey) = (sum(xx, c, xy, s), sum(xy, c, yy, s));
            let (lww, cww) = (l * ww, mc * ww);
            let (px, py) = (mul_add(-lww, ex, bx), mul_add(-lww, ey, by));
            let per_tt = 1.0 / mul_add(l * l, difference(c, ay, s, ax), moment);
            let torque = l * difference(c, py, s, px);
            let (hx, hy) = (difference(l, ax, mc, s), sum(l, ay, mc, c));
            let (gx, gy, t) = (hx * per_tt, hy * per_tt, torque * per_tt);
            turns[k] = [gx, gy, t];
            (xx, xy, yy) = (mul_add(-hx, gx, xx + m), mul_add(-hx, gy, xy), mul_add(-hy, gy, yy + m));
            (bx, by) = (mul_add(-cww, c, mul_add(-hx, t, px)), mul_add(-cww, s, mul_add(-hy, t, py)));
        }
        let (mut ax, mut ay, mut before) = (0.0, G, 0.0);
        for k in 0..N {
            let ([gx, gy, t], [c, s], l) = (turns[k], along[k], p.0[k][3]);
            let alpha = -mul_add(gx, ax, mul_add(gy, ay, t));
            dy[N + k] = alpha - before;
            before = alpha;
            let (la, lww) = (l * alpha, l * squares[k]);
            (ax, ay) = (mul_add(-la, s, mul_add(-lww, c, ax)), mul_add(la, c, mul_add(-lww, s, ay)));
        }
    }
}

/// Pendulums one behind the other by the forces along their rods, a tridiagonal system:
///
/// ```text
/// (1/m_k + 1/m_{k-1}) f_k - e_k.e_{k+1} f_{k+1}/m_k - e_{k-1}.e_k f_{k-1}/m_{k-1} = -l_k |e_k'|^2,
/// a_k - a_{k-1} = (f_k e_k - f_{k+1} e_{k+1})/m_k - (f_{k-1} e_{k-1} - f_k e_k)/m_{k-1}
/// ```
///
/// The point above the first one accelerates upwards with `g`, and has no mass to be moved.
struct Rods<const N: usize> {
    /// `1/m`, and the sum of it and the one before.
    per_m: [f64; N],
    diagonal: [f64; N],
    l: [f64; N],
    per_l: [f64; N],
}

impl<const N: usize> Rods<N> {
    fn prepare(_: &[f64]) -> Rods<N> {
        let per_m: [f64; N] = std::array::from_fn(|k| 1.0 / mass(k));
        let diagonal = std::array::from_fn(|k| if k == 0 { per_m[0] } else { per_m[k] + per_m[k - 1] });
        Rods { per_m, diagonal, l: [0.5; N], per_l: [2.0; N] }
    }

    /// The forces, from `-l |e'|^2`, with gravity in the first, and the `e_k.e_{k+1}`.
    fn forces(&self, right: &mut [f64; N], cosines: &[f64; N]) {
        // From the last rod to the first: the diagonal and the right-hand sides that are left.
        let mut per_pivot = [0.0; N];
        per_pivot[N - 1] = 1.0 / self.diagonal[N - 1];
        for k in (0..N - 1).rev() {
            let coupling = cosines[k] * self.per_m[k];
            let factor = coupling * per_pivot[k + 1];
            per_pivot[k] = 1.0 / mul_add(-factor, coupling, self.diagonal[k]);
            right[k] = mul_add(factor, right[k + 1], right[k]);
        }
        right[0] *= per_pivot[0];
        for k in 1..N {
            let coupling = cosines[k - 1] * self.per_m[k - 1];
            right[k] = mul_add(coupling, right[k - 1], right[k]) * per_pivot[k];
        }
    }
}

/// Pendulums in the plane, by their angles from the horizontal.
mod planar_pendulum {
    use super::{G, Rods, difference, mul_add, sin_cos, sum};

    /// State: `N` angles, their rates.
    #[inline(never)]
    pub(super) fn rhs<const N: usize, const DIM: usize>(
        p: &Rods<N>,
        _: f64,
        y: &[f64; DIM],
        dy: &mut [f64; DIM],
    ) {
        let (mut e, mut f, mut cosines, mut sines) = ([[0.0; 2]; N], [0.0; N], [0.0; N], [0.0; N]);
        for k in 0..N {
            let (s, c) = sin_cos(y[k]);
            let w = y[N + k];
            dy[k] = w;
            (e[k], f[k]) = ([c, s], -(p.l[k] * w * w));
            if k > 0 {
                let [cb, sb] = e[k - 1];
                (cosines[k - 1], sines[k - 1]) = (sum(c, cb, s, sb), difference(s, cb, c, sb));
            }
        }
        f[0] += G * e[0][1];
        p.forces(&mut f, &cosines);
        // Accelerations across the rods.
        let mut across = -G * e[0][0];
        for k in 0..N {
            if k + 1 < N {
                across = mul_add(-f[k + 1], sines[k] * p.per_m[k], across);
            }
            dy[N + k] = across * p.per_l[k];
            across = f[k] * sines[k] * p.per_m[k];
        }
    }
}

/// Pendulums in space, by their angles from the vertical and around it.
mod spherical_pendulum {
    use super::{G, Rods, difference, mul_add, sin_cos, sum};

    fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
        mul_add(a[0], b[0], sum(a[1], b[1], a[2], b[2]))
    }

    /// State: the angles `q` and `s` of each pendulum, their rates.
    #[inline(never)]
    pub(super) fn rhs<const N: usize, const DIM: usize>(
        p: &Rods<N>,
        _: f64,
        y: &[f64; DIM],
        dy: &mut [f64; DIM],
    ) {
        let (mut e, mut turns, mut f, mut cosines) = ([[0.0; 3]; N], [[0.0; 4]; N], [0.0; N], [0.0; N]);
        for k in 0..N {
            let ((sq, cq), (ss, cs)) = (sin_cos(y[2 * k]), sin_cos(y[2 * k + 1]));
            let (q_dot, s_dot) = (y[2 * N + 2 * k], y[2 * N + 2 * k + 1]);
            (dy[2 * k], dy[2 * k + 1]) = (q_dot, s_dot);
            let around = sq * s_dot;
            (e[k], turns[k]) = ([sq * cs, sq * ss, cq], [sq, cq, ss, cs]);
            f[k] = -(p.l[k] * sum(q_dot, q_dot, around, around));
            if k > 0 {
                cosines[k - 1] = dot(e[k - 1], e[k]);
            }
        }
        f[0] += G * e[0][2];
        p.forces(&mut f, &cosines);
        // The acceleration of the end before, and of this one.
        let mut before = [0.0, 0.0, G];
        for k in 0..N {
            let pull = f[k] * p.per_m[k];
            let mut now = e[k].map(|x| pull * x);
            if k + 1 < N {
                let pull = f[k + 1] * p.per_m[k];
                now = [0, 1, 2].map(|i| mul_add(-pull, e[k + 1][i], now[i]));
            }
            let [x, y_, z] = [0, 1, 2].map(|i| (now[i] - before[i]) * p.per_l[k]);
            let [sq, cq, ss, cs] = turns[k];
            let (q_dot, s_dot) = (y[2 * N + 2 * k], y[2 * N + 2 * k + 1]);
            let radial = sum(cs, x, ss, y_);
            dy[2 * N + 2 * k] = mul_add(cq, mul_add(sq * s_dot, s_dot, radial), -(sq * z));
            let across = difference(cs, y_, ss, x);
            dy[2 * N + 2 * k + 1] = mul_add(-2.0 * cq * q_dot, s_dot, across) / sq;
            before = now;
        }
    }
}

/// A kernel; the process ends soon enough for what it keeps.
fn kernel<P: 'static, const DIM: usize>(
    model: &'static str,
    prepare: fn(&[f64]) -> P,
    rhs: Rhs<f64, P, DIM>,
) -> Kernel {
    let scene = "bare";
    let info = SceneInfo::new(model, scene, &[]);
    Kernel::new(Box::leak(Box::new(info)), "by hand", 1, prepare, rhs)
}

macro_rules! chains {
    ($kernels:ident, $(($n:literal, $snake:literal, $plane:literal, $space:literal))*) => { $(
        $kernels.extend([
            kernel(concat!("wheeled_snake_", $n), snake::prepare, snake::rhs::<$n, $snake>),
            kernel(concat!("planar_arm_", $n), planar_arm::prepare, planar_arm::rhs::<$n, $plane>),
            kernel(concat!("planar_pendulum_", $n), Rods::prepare, planar_pendulum::rhs::<$n, $plane>),
            kernel(concat!("spherical_pendulum_", $n), Rods::prepare, spherical_pendulum::rhs::<$n, $space>),
        ]);
    )* };
}

/// The kernels, by the number of bodies and the dimensions of the states.
pub fn kernels() -> Vec<Kernel> {
    let mut kernels = spatial_arm::kernels();
    chains! {
        kernels,
        (2, 3, 4, 8) (3, 4, 6, 12) (5, 6, 10, 20) (8, 9, 16, 32) (10, 11, 20, 40) (14, 15, 28, 56) (20, 21, 40, 80)
        (40, 41, 80, 160)
    }
    kernels
}
