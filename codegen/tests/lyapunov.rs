//! Forces of actuators that give a function its rate, against laws and equations by hand: a pendulum with a wheel, a
//! pendulum on a cart, a ball on a beam, a body with a rotor, a top with a torque about one axis.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_mechanics::mechanics::Decrease;

fn build_scene(items: &str, scene: &str) -> BuiltScene {
    let model = spec::parse("m.hamel", &format!("model m {{ {items} }}")).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"))
}

fn build(items: &str) -> BuiltScene {
    build_scene(&format!("{items} scene a {{ want energy, outputs; }}"), "a")
}

/// Rates, and the outputs of the model by name.
fn at(built: &BuiltScene, params: &[f64], y: &[f64], outputs: &[&str]) -> (Vec<f64>, Vec<f64>) {
    let prepared = built.prepare(params).unwrap_or_else(|e| panic!("{e}"));
    let mut dy = vec![0.0; y.len()];
    prepared.rhs(0.0, y, &mut dy);
    let value = |name: &&str| prepared.output(name, 0.0, y).unwrap_or_else(|| panic!("no {name}"))[0];
    (dy, outputs.iter().map(value).collect())
}

fn close(what: &str, found: f64, expected: f64) {
    assert!(
        (found - expected).abs() < 1e-12 * expected.abs().max(1.0),
        "{what}: {found}, by hand {expected}"
    );
}

/// Steps of the classical method of fourth order.
fn moved(built: &BuiltScene, params: &[f64], y: &[f64], (h, n): (f64, usize)) -> Vec<f64> {
    let prepared = built.prepare(params).unwrap_or_else(|e| panic!("{e}"));
    let mut y = y.to_vec();
    let rate = |y: &[f64]| {
        let mut dy = vec![0.0; y.len()];
        prepared.rhs(0.0, y, &mut dy);
        dy
    };
    let along = |y: &[f64], d: &[f64], h: f64| y.iter().zip(d).map(|(y, d)| y + h * d).collect::<Vec<f64>>();
    for _ in 0..n {
        let a = rate(&y);
        let b = rate(&along(&y, &a, h / 2.0));
        let c = rate(&along(&y, &b, h / 2.0));
        let d = rate(&along(&y, &c, h));
        for k in 0..y.len() {
            y[k] += h / 6.0 * (a[k] + 2.0 * b[k] + 2.0 * c[k] + d[k]);
        }
    }
    y
}

const WHEEL: &str = "param I: vector(2) = [1, 0.2] where I1 > 0, I2 > 0;
    param mgl = 3 where mgl > 0;
    param a: vector(3) = [20, 2, 0.25];
    param k = 2 where k > 0;
    param e = 0.7;
    coordinate theta, phi in real;
    lagrangian = I1*theta_dot^2/2 + I2*(theta_dot + phi_dot)^2/2 - mgl*cos(theta);
    actuate u along phi_dot;
    let d = I2*a2 - (I1 + I2)*a3;
    let turn = phi - ((I1 + I2)*a2 - I2*a1)/d*theta;
    lyapunov V = a1*theta_dot^2/2 + a2*theta_dot*phi_dot + a3*phi_dot^2/2
        + mgl*(a1*a3 - a2^2)/d*(1 - cos(theta)) + e*turn^2/2 rate -k*dV_du^2;";

/// `u = I2 (a2 - a3) m g l sin(theta)/d + e turn I1 I2/d - k b`, from the terms of `dV/dt` with the factor `phi'`.
#[test]
fn a_pendulum_with_a_wheel_stands_up() {
    let built = build(WHEEL);
    let params = [1.0, 0.2, 3.0, 20.0, 2.0, 0.25, 2.0, 0.7];
    let [i1, i2, mgl, a1, a2, a3, k, e] = params;
    let d = i2 * a2 - (i1 + i2) * a3;
    for y in [[0.4, -0.7, 0.3, 1.1], [2.9, 0.2, -1.4, 0.0], [0.6, 1.3, 0.0, 0.0]] {
        let [theta, phi, v, w]: [f64; 4] = y;
        let b = -(a1 * v + a2 * w) / i1 + (a2 * v + a3 * w) * (i1 + i2) / (i1 * i2);
        let turn = phi - ((i1 + i2) * a2 - i2 * a1) / d * theta;
        let u = i2 * (a2 - a3) * mgl * theta.sin() / d + e * turn * i1 * i2 / d - k * b;
        let (dy, outputs) = at(&built, &params, &y, &["u"]);
        close("u", outputs[0], u);
        let g = mgl * theta.sin();
        close("theta''", dy[2], (g - u) / i1);
        close("phi''", dy[3], -g / i1 + u * (i1 + i2) / (i1 * i2));
    }
    assert_eq!(built.equations().facts.decrease, Some(Decrease::Proved));
    let end = moved(&built, &params, &[0.3, 0.0, 0.0, 0.0], (0.01, 10_000));
    assert!(end.iter().all(|x| x.abs() < 1e-3), "{end:?}");
}

/// The momenta of the state in the place of its velocities: one motion, one force.
#[test]
fn a_force_is_the_same_by_momenta() {
    let built = build(WHEEL);
    let carried = format!(
        "{WHEEL} momentum p of theta_dot; momentum q of phi_dot; scene b {{ carry p, q; want outputs; }}"
    );
    let carried = build_scene(&carried, "b");
    let params = [1.0, 0.2, 3.0, 20.0, 2.0, 0.25, 2.0, 0.7];
    let y = [0.4, -0.7, 0.3, 1.1];
    let (dy, outputs) = at(&built, &params, &y, &["u", "V"]);
    let (p, q) = (1.2 * y[2] + 0.2 * y[3], 0.2 * (y[2] + y[3]));
    let (dz, same) = at(&carried, &params, &[y[0], y[1], p, q], &["u", "V"]);
    close("u", same[0], outputs[0]);
    close("V", same[1], outputs[1]);
    close("p'", dz[2], 1.2 * dy[2] + 0.2 * dy[3]);
    close("q'", dz[3], outputs[0]);
}

const CART: &str = "param alpha = 1 where alpha > 0; param beta = 0.5 where beta > 0;
    param gamma = 1 where gamma > beta^2/alpha; param D = 2 where D > 0;
    param kappa = 9; param c = 0.1 where c > 0; param e = 0.05; param k = 1 where k > 0;
    coordinate theta, s in real;
    lagrangian = alpha*theta_dot^2/2 + beta*cos(theta)*theta_dot*s_dot + gamma*s_dot^2/2 - D*cos(theta);
    actuate u along s_dot;
    let A = alpha - (kappa + 1)*beta^2/gamma*cos(theta)^2;
    let J = (1 + kappa)*beta*cos(theta)*theta_dot + gamma*s_dot;
    let h = beta*(1/gamma + c*(1 + kappa))/(c*gamma)*sin(theta);
    lyapunov V = -A*theta_dot^2/2 + c*J^2/2 + D*(1 - cos(theta)) + e*(s + h)^2/2 rate -k*dV_du^2;";

/// Controlled Lagrangians: without damping and stiffness `J` is conserved and `theta` has the inertia `A`, so that the
/// law is `u = d/dt(gamma s' + beta cos(theta) theta')` of that motion.
#[test]
fn a_pendulum_on_a_cart_has_the_law_of_controlled_lagrangians() {
    let built = build(CART);
    let [alpha, beta, gamma, d, kappa, c, e, k] = [1.0, 0.5, 1.0, 2.0, 9.0, 0.1, 0.05, 1.0];
    for y in [[0.4, -0.7, 0.3, 1.1], [-0.5, 0.2, -1.4, 0.6], [0.6, 0.1, 0.0, 0.0]] {
        let [theta, _, v, w]: [f64; 4] = y;
        let (sin, cos) = theta.sin_cos();
        // d/dt (A theta') = dA/dtheta theta'^2/2 + D sin, J' = 0.
        let a = alpha - (kappa + 1.0) * beta * beta / gamma * cos * cos;
        let da = 2.0 * (kappa + 1.0) * beta * beta / gamma * cos * sin;
        let theta2 = (d * sin - da * v * v / 2.0) / a;
        let s2 = -(1.0 + kappa) * beta * (cos * theta2 - sin * v * v) / gamma;
        let law = gamma * s2 + beta * (cos * theta2 - sin * v * v);
        let params = [alpha, beta, gamma, d, kappa, c, 0.0, 1e-300];
        let (dy, outputs) = at(&built, &params, &y, &["u"]);
        close("u", outputs[0], law);
        close("theta''", dy[2], theta2);
        close("s''", dy[3], s2);
        // Stiffness and damping add what the factor of the rate divides.
        let params = [alpha, beta, gamma, d, kappa, c, e, k];
        let (dy, outputs) = at(&built, &params, &y, &["u"]);
        let det = alpha * gamma - beta * beta * cos * cos;
        let ratio = (alpha * gamma - (1.0 + kappa) * beta * beta * cos * cos) / det;
        let slope = (1.0 / gamma + c * (1.0 + kappa)) * beta / (c * gamma);
        let b = ratio * c * gamma * (w + slope * cos * v);
        let stiff = e * (y[1] + slope * sin) / (ratio * c * gamma);
        close("u with stiffness and damping", outputs[0], law - stiff - k * b);
        close("theta'' of the mechanics", alpha * dy[2] + beta * cos * dy[3], d * sin);
        close("s'' of the mechanics", beta * cos * dy[2] + gamma * dy[3], outputs[0] + beta * sin * v * v);
    }
    let params = [alpha, beta, gamma, d, kappa, c, e, k];
    let end = moved(&built, &params, &[0.3, 0.5, 0.0, 0.0], (0.01, 40_000));
    assert!(end.iter().all(|x| x.abs() < 1e-2), "{end:?}");
}

const BEAM: &str = "param l = 1 where l > 0; param g = 9.81; param kp = 1; param k = 1 where k > 0;
    coordinate x, theta in real;
    let m = l^2 + x^2;
    lagrangian = x_dot^2/2 + m*theta_dot^2/2 - g*x*sin(theta);
    actuate u along theta_dot;
    lyapunov V = x_dot^2/sqrt(2*m) - x_dot*theta_dot + sqrt(m/2)*theta_dot^2 + g*(1 - cos(theta))
        + kp/2*(theta - ln((x + sqrt(m))/l)/sqrt(2))^2 rate -k*dV_du^2;";

/// The mass matrix and potential of Ortega, Spong, Gomez-Estern, Blankenstein 2002, with the slopes of `V` by hand.
#[test]
fn a_ball_on_a_beam_comes_to_rest() {
    let built = build(BEAM);
    let [l, g, kp, k] = [1.0_f64, 9.81, 1.0, 1.0];
    let params = [l, g, kp, k];
    let hand = |y: [f64; 4], u: f64| {
        let [x, theta, v, w] = y;
        let m = l * l + x * x;
        let (sin, cos) = theta.sin_cos();
        let rates = [x * w * w - g * sin, (u - 2.0 * x * v * w - g * x * cos) / m];
        let turn = theta - (x / l).asinh() / 2_f64.sqrt();
        let slopes = [
            -v * v * x / (2_f64.sqrt() * m.powf(1.5)) + w * w * x / (2.0 * m).sqrt()
                - kp * turn / (2.0 * m).sqrt(),
            g * sin + kp * turn,
            2.0 * v / (2.0 * m).sqrt() - w,
            -v + 2.0 * (m / 2.0).sqrt() * w,
        ];
        let rate = slopes[0] * v + slopes[1] * w + slopes[2] * rates[0] + slopes[3] * rates[1];
        (rates, rate, slopes[3] / m)
    };
    for y in [[0.4, -0.7, 0.3, 1.1], [-1.5, 0.2, -1.4, 0.6]] {
        let (dy, outputs) = at(&built, &params, &y, &["u"]);
        let (rates, rate, b) = hand(y, outputs[0]);
        close("x''", dy[2], rates[0]);
        close("theta''", dy[3], rates[1]);
        close("V'", rate, -k * b * b);
        let (_, without, _) = hand(y, 0.0);
        close("u", outputs[0], (-k * b * b - without) / b);
    }
    // At rest the force is the limit: dV/dx x' + g x cos theta theta' has the factor of the rate.
    let (_, outputs) = at(&built, &params, &[0.5, 0.1, 0.0, 0.0], &["u"]);
    let (_, near) = at(&built, &params, &[0.5, 0.1, 1e-9, 2e-9], &["u"]);
    assert!((outputs[0] - near[0]).abs() < 1e-7);
    let end = moved(&built, &params, &[0.5, 0.1, 0.0, 0.0], (0.002, 20_000));
    assert!(end.iter().all(|x| x.abs() < 1e-3), "{end:?}");
}

/// Bloch, Krishnaprasad, Marsden, Sanchez de Alvarez 1992: `u = k (L1 - L2) Omega1 Omega2` conserves a Hamiltonian.
#[test]
fn a_rotor_has_the_law_of_its_closed_loop() {
    let items = "param L: vector(2) = [1.5, 1.2] where L1 > 0, L2 > 0; param I3 = 0.9 where I3 > 0;
        param J3 = 0.1 where J3 > 0; param k = 0.5;
        coordinate alpha in real;
        velocity Omega in so(3);
        lagrangian = (L1*Omega1^2 + L2*Omega2^2 + I3*Omega3^2 + J3*(Omega3 + alpha_dot)^2)/2;
        actuate u along alpha_dot;
        let m3 = (I3 + J3)*Omega3 + J3*alpha_dot;
        let l = J3*(Omega3 + alpha_dot) - k*m3;
        lyapunov H = (L1*Omega1^2 + L2*Omega2^2 + ((1 - k)*m3 - l)^2/((1 - k)*I3))/2 + l^2/(2*J3*(1 - k));";
    let built = build(items);
    assert_eq!(built.equations().facts.decrease, Some(Decrease::Conserved));
    let params = [1.5, 1.2, 0.9, 0.1, 0.5];
    let y = [0.3, 0.7, 0.2, -1.1, 0.6];
    let [_, rotor, p, q, r] = y;
    let (dy, outputs) = at(&built, &params, &y, &["u"]);
    let u = 0.5 * 0.3 * p * q;
    close("u", outputs[0], u);
    let m3 = 1.0 * r + 0.1 * rotor;
    close("Omega1'", dy[2], (1.2 * q * r - m3 * q) / 1.5);
    close("Omega2'", dy[3], (m3 * p - 1.5 * p * r) / 1.2);
    close("Omega3'", dy[4], (0.3 * p * q - u) / 0.9);
    close("alpha''", dy[1], u / 0.1 - dy[4]);
}

/// A torque about one axis of a heavy body, from the left and from the right: `V` contains what the group moves.
#[test]
fn a_torque_about_one_axis_damps_a_top() {
    for (side, sign) in [("left", 1.0), ("right", -1.0)] {
        let items = format!(
            "param k = 0.4 where k > 0; velocity Omega in so(3); action {side};
            advected Gamma in R^3 by cross(Omega, Gamma);
            let E = (1.3*Omega1^2 + 1.7*Omega2^2 + 0.6*Omega3^2)/2 + Gamma1 + 2*Gamma3;
            lagrangian = 1.3*Omega1^2 + 1.7*Omega2^2 + 0.6*Omega3^2 - E;
            actuate u along Omega3 + Omega1/2;
            lyapunov V = E rate -k*dV_du^2;"
        );
        let built = build(&items);
        let y = [0.3, -0.7, 0.9, 0.2, 0.4, -0.6];
        let [p, q, r, g1, g2, g3] = y;
        let (dy, outputs) = at(&built, &[0.4], &y, &["u"]);
        let u = -0.4 * (r + p / 2.0);
        close("u", outputs[0], u);
        // I Omega' = sign (I Omega x Omega - Gamma x dE/dGamma) + u e.
        close("Omega1'", 1.3 * dy[0], sign * ((1.7 - 0.6) * q * r + 2.0 * g2) + u / 2.0);
        close("Omega2'", 1.7 * dy[1], sign * ((0.6 - 1.3) * r * p + g3 - 2.0 * g1));
        close("Omega3'", 0.6 * dy[2], sign * ((1.3 - 1.7) * p * q - g2) + u);
        close("Gamma1'", dy[3], sign * (g2 * r - g3 * q));
    }
}

/// A function of the energy that pumps it: the force vanishes at rest and is a polynomial of degree three.
#[test]
fn a_pendulum_is_swung_up_by_its_energy() {
    let items =
        "param k = 0.5 where k > 0; coordinate theta in real; lagrangian = theta_dot^2/2 + cos(theta);
        actuate u along theta_dot;
        lyapunov V = (theta_dot^2/2 - cos(theta) - 1)^2/2 rate -k*dV_du^2;";
    let built = build(items);
    let (dy, outputs) = at(&built, &[0.5], &[0.4, 1.2], &["u", "V"]);
    let excess = 0.72 - 0.4_f64.cos() - 1.0;
    close("u", outputs[0], -0.5 * excess * 1.2);
    close("theta''", dy[1], -0.4_f64.sin() + outputs[0]);
    close("V", outputs[1], excess * excess / 2.0);
}
