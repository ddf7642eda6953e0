//! Misprints of Cortes, de Leon, Marrero and Martinez (S2) that change equations of motion: the printed formula,
//! written out by hand, and the corrected one at accelerations that the generator derives.

use hamel_expr::Rational;
use hamel_tests::errata::{
    Ours, Point, cross, diagonal, generic, inverse_pairing, minus, plus, scaled, spec_text, verdict,
};
use hamel_tests::linear::{Rows, Vector, dot, fraction, int, times, unit};

/// `G_na y'^a + ([n,b;g] + [n,g;b] + last)/2 y^b y^g` with `[a,b;c] = rho_c(G_ab) + C^m_ab G_mc`; the last term is
/// `+[b,g;n]` as printed and `-[g,b;n]` when corrected. `dg[c]` is `rho_c(G)`.
struct Geodesic {
    metric: Rows,
    dg: Vec<Rows>,
    /// `bracket[a][b]` is `[e_a, e_b]`.
    bracket: Vec<Vec<Vector>>,
}

impl Geodesic {
    fn symbol(&self, a: usize, b: usize, c: usize) -> Rational {
        let turning: Rational = self.bracket[a][b].iter().zip(&self.metric).map(|(q, row)| q * &row[c]).sum();
        &self.dg[c][a][b] + turning
    }

    fn residual(&self, y: &[Rational], ydot: &[Rational], printed: bool) -> Vector {
        let n = y.len();
        let mut total = times(&self.metric, ydot);
        for (k, component) in total.iter_mut().enumerate() {
            for b in 0..n {
                for c in 0..n {
                    let last = if printed { self.symbol(b, c, k) } else { -self.symbol(c, b, k) };
                    let sum = self.symbol(k, b, c) + self.symbol(k, c, b) + last;
                    *component += sum * &y[b] * &y[c] / int(2);
                }
            }
        }
        total
    }
}

fn zero_matrix(n: usize) -> Rows {
    vec![vec![int(0); n]; n]
}

#[test]
fn b1_last_christoffel_term_in_polar_coordinates() {
    let text = "model polar { coordinate r in (0, 10); coordinate phi in angle;
        lagrangian = 1/2*(r_dot^2 + r^2*phi_dot^2); }";
    let (r, y) = (int(2), [int(3), fraction(5, 4)]);
    let point = Point::new().with("r", r.clone()).with("phi", int(1));
    let point = point.with("r_dot", y[0].clone()).with("phi_dot", y[1].clone());
    let mut ours = Ours::at(text, &point);
    let ydot = [ours.rate("r_dot"), ours.rate("phi_dot")];
    let mut along_r = zero_matrix(2);
    along_r[1][1] = int(2) * &r;
    let geodesic = Geodesic {
        metric: vec![vec![int(1), int(0)], vec![int(0), &r * &r]],
        dg: vec![along_r, zero_matrix(2)],
        bracket: vec![vec![vec![int(0); 2]; 2]; 2],
    };
    verdict("B1 polar", &geodesic.residual(&y, &ydot, true), &geodesic.residual(&y, &ydot, false));
}

#[test]
fn b1_last_christoffel_term_with_base_and_brackets() {
    let text = "model body { coordinate q in real; velocity Omega in so(3);
        lagrangian = 1/2*(1 + q^2)*q_dot^2 + 1/2*dot(Omega, diag([2 + q, 3 + q^2, 5])*Omega) + q*q_dot*Omega1; }";
    let (q, y) = (fraction(1, 2), generic(3, 4));
    let point = Point::new().with("q", q.clone()).with("q_dot", y[0].clone());
    let mut ours = Ours::at(text, &point.with_vector("Omega", "", &y[1..]));
    let mut ydot = vec![ours.rate("q_dot")];
    ydot.extend(ours.rates("Omega", "", 3));
    let mut metric = zero_matrix(4);
    let mut along_q = zero_matrix(4);
    let diagonal = [int(1) + &q * &q, int(2) + &q, int(3) + &q * &q, int(5)];
    let slopes = [int(2) * &q, int(1), int(2) * &q, int(0)];
    for k in 0..4 {
        metric[k][k] = diagonal[k].clone();
        along_q[k][k] = slopes[k].clone();
    }
    metric[0][1] = q.clone();
    metric[1][0] = q;
    along_q[0][1] = int(1);
    along_q[1][0] = int(1);
    let bracket = (0..4).map(|a| (0..4).map(|b| ours.frame_bracket(a, b)).collect()).collect();
    let dg = vec![along_q, zero_matrix(4), zero_matrix(4), zero_matrix(4)];
    let geodesic = Geodesic { metric, dg, bracket };
    verdict("B1 algebroid", &geodesic.residual(&y, &ydot, true), &geodesic.residual(&y, &ydot, false));
}

#[test]
fn b2_suslov_sign_and_denominator() {
    let w = [fraction(3, 2), int(-2), int(0)];
    let point = Point::new().with("Omega1", w[0].clone()).with("Omega2", w[1].clone());
    let mut ours = Ours::at(&spec_text("suslov"), &point);
    let i = |a: usize, b: usize| ours.param(&format!("I{}{}", a.min(b), a.max(b)));
    let inertia: Rows = (1..4).map(|a| (1..4).map(|b| i(a, b)).collect()).collect();
    let inverse = hamel_tests::linear::inverse(&inertia).unwrap();
    let wdot = vec![ours.rate("Omega1"), ours.rate("Omega2"), int(0)];
    let e3 = unit(3, 2);
    let axis = times(&inverse, &e3);
    let pressure = dot(&times(&inertia, &w), &e3);
    let printed = times(&inverse, &scaled(&pressure, &cross(&w, &axis)));
    let right = times(&inverse, &scaled(&(pressure / dot(&e3, &axis)), &cross(&axis, &w)));
    verdict("B2", &minus(&wdot, &printed), &minus(&wdot, &right));
}

/// Veselova's body on its constraint.
struct Veselova {
    inertia: Vector,
    w: Vector,
    wdot: Vector,
    gamma: Vector,
    /// `dV/dgamma`.
    slope: Vector,
    lambda: Rational,
}

impl Veselova {
    fn new() -> Veselova {
        let gamma = [fraction(2, 3), fraction(-1, 3), fraction(2, 3)];
        let w = [int(2), int(1), fraction(-3, 2)];
        assert_eq!(dot(&gamma, &w), int(0));
        let point = Point::new().with_vector("Omega", "", &w).with_vector("gamma", "", &gamma);
        let mut ours = Ours::at(&spec_text("veselova"), &point);
        let slope = scaled(&ours.param("k"), &ours.params("chi", 3));
        let lambda = ours.output("multipliers")[0].clone();
        let wdot = ours.rates("Omega", "", 3);
        Veselova { inertia: ours.params("I", 3), w: w.to_vec(), wdot, gamma: gamma.to_vec(), slope, lambda }
    }

    fn momentum(&self) -> Vector {
        diagonal(&self.inertia, &self.w)
    }

    /// `I w' - Iw x w - torque - lambda gamma`.
    fn residual(&self, torque: &[Rational], lambda: &Rational) -> Vector {
        let left = diagonal(&self.inertia, &self.wdot);
        let right = plus(&plus(&cross(&self.momentum(), &self.w), torque), &scaled(lambda, &self.gamma));
        minus(&left, &right)
    }

    /// The multiplier that keeps `<w', gamma> = 0`.
    fn multiplier(&self, torque: &[Rational]) -> Rational {
        let free = plus(&cross(&self.momentum(), &self.w), torque);
        -inverse_pairing(&self.inertia, &self.gamma, &free)
            / inverse_pairing(&self.inertia, &self.gamma, &self.gamma)
    }
}

#[test]
fn b4_torque_of_the_potential() {
    let v = Veselova::new();
    let printed = cross(&v.w, &v.slope);
    let right = cross(&v.gamma, &v.slope);
    verdict("B4", &v.residual(&printed, &v.lambda), &v.residual(&right, &v.lambda));
    let recomputed = v.residual(&printed, &v.multiplier(&printed));
    verdict("B4, multiplier recomputed", &recomputed, &v.residual(&right, &v.multiplier(&right)));
}

#[test]
fn b5_poincare_chetaev_sign_and_complement() {
    let v = Veselova::new();
    // Psi*(dV) pairs with eta as dV(gamma x eta).
    let force = cross(&v.slope, &v.gamma);
    let divided = |u: &[Rational]| -> Vector { u.iter().zip(&v.inertia).map(|(x, i)| x / i).collect() };
    let free = minus(&v.wdot, &divided(&cross(&v.momentum(), &v.w)));
    let with = |sign: i64| plus(&free, &scaled(&int(sign), &divided(&force)));
    let directions = [v.w.clone(), cross(&v.w, &v.gamma)];
    // Membership in the complement of D: all pairings with D vanish.
    let plain = |x: &[Rational]| -> Vector { directions.iter().map(|eta| dot(x, eta)).collect() };
    let weighted = |x: &[Rational]| plain(&diagonal(&v.inertia, x));
    let right = weighted(&with(1));
    verdict("B5", &plain(&with(-1)), &right);
    verdict("B5, only the sign corrected", &plain(&with(1)), &right);
    verdict("B5, only the complement corrected", &weighted(&with(-1)), &right);
}

/// A Chaplygin sphere that carries a point mass on an elastic mount: the gyro of section 6.3 with shape space `R^3`
/// instead of the sphere, so that every number is rational.
const MOUNTED: &str = "model mounted {
    coordinate p: vector(3) in real;
    velocity Omega, X in se(3);
    advected Gamma in R^3 by cross(Omega, Gamma);
    let v = X + cross(Omega, p) + p_dot;
    lagrangian = 1/2*dot(Omega, diag([1, 6/5, 7/5])*Omega) + dot(X, X) + 3/20*dot(v, v) - 3*dot(Gamma, p) - dot(p, p);
    constraint X = 7/10*cross(Omega, Gamma);
    independent p_dot, Omega;
}";

/// Terms of the reduced equation along `(zeta, zeta x v)`: `w` angular velocity, `u` velocity of the centre,
/// `v = r Gamma`.
struct Mounted {
    /// `d/dt dL/dw`.
    rate_w: Vector,
    /// `ad*_w dL/dw`, `<ad*_w mu, eta> = <mu, [w, eta]>`.
    turning_w: Vector,
    /// `d/dt (rho_v^* dL/du)`.
    rate_u: Vector,
    /// `ad*_w (rho_v^* dL/du)`.
    turning_u: Vector,
    /// `rho_v^* dL/dv`.
    gradient: Vector,
    /// `<dL/du, w.(w_a.v)>`.
    missing: Vector,
}

impl Mounted {
    fn new() -> Mounted {
        let [p, pdot, w, gamma] = [5, 6, 7, 8].map(|seed| generic(seed, 3));
        let point = Point::new().with_vector("p", "", &p).with_vector("p", "_dot", &pdot);
        let point = point.with_vector("Omega", "", &w).with_vector("Gamma", "", &gamma);
        let mut ours = Ours::at(MOUNTED, &point);
        let (wdot, pddot) = (ours.rates("Omega", "", 3), ours.rates("p", "_dot", 3));
        let r = fraction(7, 10);
        let (arm, gammadot) = (scaled(&r, &gamma), cross(&gamma, &w));
        assert_eq!(ours.rates("Gamma", "", 3), gammadot);
        let armdot = scaled(&r, &gammadot);
        let u = cross(&w, &arm);
        let udot = plus(&cross(&wdot, &arm), &cross(&w, &armdot));
        let velocity = plus(&plus(&u, &cross(&w, &p)), &pdot);
        let acceleration = plus(&plus(&plus(&udot, &cross(&wdot, &p)), &cross(&w, &pdot)), &pddot);
        let (inertia, mu) = ([int(1), fraction(6, 5), fraction(7, 5)], fraction(3, 10));
        let slope_w = plus(&diagonal(&inertia, &w), &scaled(&mu, &cross(&p, &velocity)));
        let arm_rate = plus(&cross(&pdot, &velocity), &cross(&p, &acceleration));
        let rate_w = plus(&diagonal(&inertia, &wdot), &scaled(&mu, &arm_rate));
        let slope_u = plus(&scaled(&int(2), &u), &scaled(&mu, &velocity));
        let slope_u_rate = plus(&scaled(&int(2), &udot), &scaled(&mu, &acceleration));
        let pulled = cross(&arm, &slope_u);
        Mounted {
            rate_w,
            turning_w: cross(&slope_w, &w),
            rate_u: plus(&cross(&armdot, &slope_u), &cross(&arm, &slope_u_rate)),
            turning_u: cross(&pulled, &w),
            gradient: cross(&gamma, &scaled(&int(-3), &p)),
            missing: cross(&arm, &cross(&slope_u, &w)),
        }
    }

    /// `d/dt L_w + a ad*_w L_w + d/dt(rho* L_u) + b ad*_w(rho* L_u) + rho* L_v + c <L_u, w.(w_a.v)>`.
    fn sum(&self, a: i64, b: i64, c: i64) -> Vector {
        let mut total = plus(&plus(&self.rate_w, &self.rate_u), &self.gradient);
        for (k, term) in [(a, &self.turning_w), (b, &self.turning_u), (c, &self.missing)] {
            total = plus(&total, &scaled(&int(k), term));
        }
        total
    }
}

#[test]
fn b7_derivative_at_fixed_u_is_not_the_one_at_fixed_y() {
    let m = Mounted::new();
    verdict("B7", &m.sum(-1, -2, 0), &m.sum(-1, -2, 1));
}

#[test]
fn b8_signs_of_ad_star_in_the_vector_form() {
    let m = Mounted::new();
    verdict("B8", &m.sum(1, 2, 1), &m.sum(-1, -2, 1));
    // No other reading of the two signs repairs it.
    verdict("B8, only the first sign", &m.sum(1, -2, 1), &m.sum(-1, -2, 1));
    verdict("B8, only the second sign", &m.sum(-1, 2, 1), &m.sum(-1, -2, 1));
}

/// The mobile robot: `P`, `S`, `U`, both rates and accelerations of the wheels.
struct Robot {
    p: Rational,
    s: Rational,
    u: Rational,
    rate: Vector,
    acceleration: Vector,
}

impl Robot {
    fn new() -> Robot {
        let rate = vec![int(3), int(-2)];
        let point = Point::new().with_vector("psi", "", &[int(1), int(2)]).with_vector("psi", "_dot", &rate);
        let mut ours = Ours::at(&spec_text("mobile_robot"), &point);
        let [m0, m1, j, j2, l, r, c] = ["m0", "m1", "J", "J2", "l", "R", "c"].map(|name| ours.param(name));
        let m = &m0 + int(2) * m1;
        let turning = j / (&c * &c);
        let quarter = &r * &r / int(4);
        let p = j2 + &quarter * (&m + &turning);
        let s = quarter * (m - turning);
        let u = m0 * l * &r * &r * r / (int(4) * &c * &c);
        Robot { p, s, u, rate, acceleration: ours.rates("psi", "_dot", 2) }
    }
}

#[test]
fn b9_mobile_robot_sign_of_u() {
    let Robot { p, s, u, rate, acceleration } = Robot::new();
    let factor = &u * (&rate[1] - &rate[0]) / (&p * &p - &s * &s);
    let first = &factor * (&p * &rate[1] + &s * &rate[0]);
    let second = -factor * (&p * &rate[0] + &s * &rate[1]);
    let printed = [first, second];
    verdict("B9", &minus(&acceleration, &printed), &plus(&acceleration, &printed));
}

#[test]
fn b10_one_form_of_the_curvature() {
    let Robot { p, s, u, rate, acceleration } = Robot::new();
    let left = [&p * &acceleration[0] + &s * &acceleration[1], &s * &acceleration[0] + &p * &acceleration[1]];
    // psi1' dpsi2 - psi2' dpsi1.
    let form = [-rate[1].clone(), rate[0].clone()];
    let right = scaled(&(u * (&rate[1] - &rate[0])), &form);
    verdict("B10", &plus(&left, &right), &minus(&left, &right));
}

/// The ball on the rotating table at one state.
struct Table {
    ours: Ours,
    r: Rational,
    k2: Rational,
    turning: Rational,
    x: Vector,
    /// `pi_1 = r xdot + k^2 w_y`, `pi_2 = r ydot - k^2 w_x`, `pi_3 = k^2 w_z`.
    pi: Vector,
}

impl Table {
    fn new(x: [Rational; 2], velocity: [Rational; 2], spin: Rational) -> Table {
        let point = Point::new().with("x", x[0].clone()).with("y", x[1].clone());
        let point = point.with("x_dot", velocity[0].clone()).with("y_dot", velocity[1].clone());
        let ours = Ours::at(&spec_text("ball_on_rotating_table"), &point.with("omega_z", spin.clone()));
        let [r, k2, turning] = ["r", "k2", "Omega"].map(|name| ours.param(name));
        let w_x = (&turning * &x[0] - &velocity[1]) / &r;
        let w_y = (&turning * &x[1] + &velocity[0]) / &r;
        let pi = vec![&r * &velocity[0] + &k2 * w_y, &r * &velocity[1] - &k2 * w_x, &k2 * spin];
        Table { ours, r, k2, turning, x: x.to_vec(), pi }
    }

    fn generic() -> Table {
        Table::new([fraction(3, 2), int(-2)], [fraction(1, 3), int(2)], int(3))
    }

    /// `k^2 + r^2`.
    fn inertia(&self) -> Rational {
        &self.k2 + &self.r * &self.r
    }

    /// `R_L(pi_i) = pi_i' - {pi_i, L}`. The bracket is that of the generator's algebroid: `{x, F_s} = rho(s) x` and
    /// `{F_s, F_s'} = -F_[s, s']` for the functions `F_s` that are linear on the momenta.
    fn affine_part(&mut self) -> Vector {
        // Sections r d/dx + e_y, r d/dy - e_x, e_z of the linear part of the constraint, in the frame d/dx, d/dy, e_*.
        let r = self.r.clone();
        let (zero, one) = (int(0), int(1));
        let sections = [
            vec![r.clone(), zero.clone(), zero.clone(), one.clone(), zero.clone()],
            vec![zero.clone(), r.clone(), -one.clone(), zero.clone(), zero.clone()],
            vec![zero.clone(), zero.clone(), zero.clone(), zero, one],
        ];
        let p = self.ours.output("momentum");
        let momenta: Vector = sections.iter().map(|s| dot(&p, s)).collect();
        assert_eq!(momenta, self.pi);
        // L = (pi_1^2 + pi_2^2 + k^2 Omega^2 (x^2 + y^2))/(2 (k^2 + r^2)) + pi_3^2/(2 k^2).
        let inertia = self.inertia();
        let weight = &self.k2 * &self.turning * &self.turning;
        let (planar, position) = (&self.pi[..2], &self.x);
        let l = (dot(planar, planar) + &weight * dot(position, position)) / (int(2) * &inertia)
            + &self.pi[2] * &self.pi[2] / (int(2) * &self.k2);
        assert_eq!(self.ours.energy(), l);
        let slope_x = scaled(&(weight / &inertia), &self.x);
        let slope_pi = [&self.pi[0] / &inertia, &self.pi[1] / &inertia, &self.pi[2] / &self.k2];
        let mut rates = vec![int(0); 3];
        for (i, s) in sections.iter().enumerate() {
            rates[i] += (0..2).map(|k| &s[k] * &slope_x[k]).sum::<Rational>();
            for (j, other) in sections.iter().enumerate() {
                for (a, first) in s.iter().enumerate() {
                    for (b, second) in other.iter().enumerate() {
                        let bracket = dot(&p, &self.ours.frame_bracket(a, b));
                        rates[i] += first * second * bracket * &slope_pi[j];
                    }
                }
            }
        }
        // The generator's accelerations keep every pi, so R_L(pi_i) = -{pi_i, L}.
        let acceleration = [self.ours.rate("x_dot"), self.ours.rate("y_dot"), self.ours.rate("omega_z")];
        let velocity = [self.ours.variable("x_dot"), self.ours.variable("y_dot")];
        let turned = [
            (&self.turning * &velocity[0] - &acceleration[1]) / &self.r,
            (&self.turning * &velocity[1] + &acceleration[0]) / &self.r,
        ];
        assert_eq!(&self.r * &acceleration[0] + &self.k2 * &turned[1], int(0));
        assert_eq!(&self.r * &acceleration[1] - &self.k2 * &turned[0], int(0));
        assert_eq!(acceleration[2], int(0));
        rates
    }
}

#[test]
fn b11_kinetic_energy_in_euler_angles() {
    // R = Rz(psi) Rx(theta) Rz(phi), space-frame angular velocity; cosines and sines of Pythagorean angles.
    let (cos_psi, sin_psi) = (fraction(3, 5), fraction(4, 5));
    let (cos_theta, sin_theta) = (fraction(5, 13), fraction(12, 13));
    let [psi, theta, phi] = [int(2), int(-1), int(3)];
    let w_x = &theta * &cos_psi + &phi * &sin_theta * &sin_psi;
    let w_y = &theta * &sin_psi - &phi * &sin_theta * &cos_psi;
    let w_z = &psi + &phi * &cos_theta;
    let (x, y) = (fraction(1, 2), fraction(2, 3));
    let (r, turning) = (fraction(3, 10), fraction(7, 5));
    let velocity = [&r * &w_y - &turning * &y, &turning * &x - &r * &w_x];
    let translation = dot(&velocity, &velocity);
    let mut table = Table::new([x, y], velocity, w_z);
    let printed = &theta * &theta + &psi * &psi + int(2) * &phi * &psi * cos_theta;
    let right = &printed + &phi * &phi;
    let energy = table.ours.energy();
    let of = |square: Rational| (&translation + &table.k2 * square) / int(2) - &energy;
    verdict("B11", &[of(printed)], &[of(right)]);
}

#[test]
fn b13_affine_part_along_the_horizontal_momenta() {
    let mut table = Table::generic();
    let ours = table.affine_part();
    let factor = &table.r * &table.turning / table.inertia() * (&table.pi[2] - &table.k2 * &table.turning);
    let printed = scaled(&factor, &table.x);
    verdict("B13", &minus(&printed, &ours[..2]), &plus(&printed, &ours[..2]));
}

#[test]
fn b14_affine_part_along_the_vertical_momentum() {
    let mut table = Table::generic();
    let ours = table.affine_part();
    let factor = &table.r * &table.k2 * &table.turning / table.inertia();
    let pairing = dot(&table.pi[..2], &table.x);
    let right = &factor / table.inertia() * &pairing;
    verdict("B14", &[-factor * pairing - &ours[2]], &[right - &ours[2]]);
}
