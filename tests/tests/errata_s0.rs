//! Misprints of Cendra and Diaz (S0) that change equations of motion, and the readings of its stage formulas that do
//! not hold: the printed formula and the corrected one at accelerations that the generator derives.
//!
//! A1 for random bases, metrics and chains of many algebras is tested in `properties_stages.rs`.

use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_expr::Rational;
use hamel_lang::algebra::{LieAlgebra, Representation};
use hamel_tests::algebras::ad_star;
use hamel_tests::draws::{Draws, one};
use hamel_tests::errata::{
    Ours, Point, StageNumbers, bilinear, cross, diagonal, generic, minus, plus, size, spec_text, verdict,
};
use hamel_tests::linear::{Rows, Vector, dot, fraction, int, inverse, times, transposed, unit};

#[test]
fn a1_euler_poincare_by_stages_keeps_every_momentum() {
    let [w, v] = [1, 2].map(|seed| generic(seed, 3));
    let point = Point::new().with_vector("Omega", "", &w).with_vector("V", "", &v);
    let mut ours = Ours::at(&spec_text("kirchhoff_body"), &point);
    let (j, m) = (ours.params("J", 3), ours.params("M", 3));
    let c: Rows = (1..4).map(|a| (1..4).map(|b| ours.param(&format!("C{a}{b}"))).collect()).collect();
    let impulses = |w: &[Rational], v: &[Rational]| {
        (plus(&diagonal(&j, w), &times(&c, v)), plus(&times(&transposed(&c), w), &diagonal(&m, v)))
    };
    let (pi, p) = impulses(&w, &v);
    let (pi_rate, p_rate) = impulses(&ours.rates("Omega", "", 3), &ours.rates("V", "", 3));
    let printed = minus(&pi_rate, &cross(&pi, &w));
    verdict("A1 body in a fluid, rotation", &printed, &minus(&printed, &cross(&p, &v)));
    // The last slot is right as printed.
    assert_eq!(p_rate, cross(&p, &w));
}

#[test]
fn a1_three_stages_in_the_metric_of_the_body() {
    let [w, v, u] = [3, 4, 5].map(|seed| generic(seed, 3));
    let point = Point::new().with_vector("Omega", "", &w).with_vector("V", "", &v);
    let text = spec_text("extended_pose").replace("stage rotation;", "inner_product = G; stage rotation;");
    let mut ours = Ours::at(&text, &point.with_vector("U", "", &u));
    let metric: Rows = (1..10)
        .map(|a| (1..10).map(|b: i32| ours.param(&format!("G{}{}", b.min(a), b.max(a)))).collect())
        .collect();
    let velocity = [w, v, u].concat();
    let rate = [ours.rates("Omega", "", 3), ours.rates("V", "", 3), ours.rates("U", "", 3)].concat();
    let stages = ours.stages();
    assert!(stages.levels.iter().any(|l| !l.curvature.is_empty()), "the metric couples the levels");
    let eta = times(&inverse(&transposed(&stages.basis)).unwrap(), &velocity);
    let beta = times(&stages.basis, &times(&metric, &velocity));
    let beta_rate = times(&stages.basis, &times(&metric, &rate));
    let printed = minus(&beta_rate, &stages.printed_vertical(&eta, &beta));
    let right = minus(&beta_rate, &stages.full_vertical(&eta, &beta));
    for level in 0..2 {
        let slot = |x: &[Rational]| stages.slot(x, level);
        verdict(&format!("A1 extended pose, slot {level}"), &slot(&printed), &slot(&right));
    }
    assert_eq!(size(&stages.slot(&printed, 2)), 0.0, "the last slot loses nothing");
    assert_eq!(size(&right), 0.0);
}

#[test]
fn a2_constrained_equations_by_stages_keep_every_momentum() {
    // S_(0,1) is spanned by Omega1, Omega2 and S_(1,2) by V1, V3; product metric.
    let text = "model m { velocity Omega, V in se(3); stage rotation; stage translation = ideal(V);
        lagrangian = 1/2*dot(Omega, diag([2, 3, 5])*Omega) + 1/2*dot(V, diag([1, 2, 3])*V) + Omega1*V3/2;
        constraint Omega3 = 0; constraint V2 = 0; independent Omega1, Omega2, V1, V3; }";
    let (w, v) = ([int(2), int(-1), int(0)], [int(3), int(0), fraction(1, 2)]);
    let point = [("Omega1", &w[0]), ("Omega2", &w[1]), ("V1", &v[0]), ("V3", &v[2])];
    let point = point.iter().fold(Point::new(), |point, (name, q)| point.with(name, (*q).clone()));
    let mut ours = Ours::at(text, &point);
    let momenta = |w: &[Rational], v: &[Rational]| {
        let mut pi = diagonal(&[int(2), int(3), int(5)], w);
        let mut p = diagonal(&[int(1), int(2), int(3)], v);
        pi[0] += &v[2] / int(2);
        p[2] += &w[0] / int(2);
        (pi, p)
    };
    let w_rate = [ours.rate("Omega1"), ours.rate("Omega2"), int(0)];
    let v_rate = [ours.rate("V1"), int(0), ours.rate("V3")];
    let ((pi, p), (pi_rate, p_rate)) = (momenta(&w, &v), momenta(&w_rate, &v_rate));
    let printed = minus(&pi_rate, &cross(&pi, &w));
    let right = minus(&printed, &cross(&p, &v));
    // The components of the vector along S are the equations.
    verdict("A2, slot 0", &printed[..2], &right[..2]);
    let last = minus(&p_rate, &cross(&p, &w));
    assert_eq!([&last[0], &last[2]], [&int(0), &int(0)], "the last slot loses nothing");
}

/// A body with a moving base and a connection on se(3), in two stages; with constraints when asked for.
struct Bundle {
    momenta: [Vector; 2],
    rates: [Vector; 2],
    /// `xi = v - A xdot`.
    xi: [Vector; 2],
}

impl Bundle {
    fn new(constrained: bool) -> Bundle {
        let constraints = if constrained {
            "constraint W3 = 0; constraint V2 = 0; independent x_dot, W1, W2, V1, V3;"
        } else {
            ""
        };
        let text = format!(
            "model m {{ coordinate x: vector(2) in real; velocity W, V in se(3);
            stage rotation; stage translation = ideal(V);
            connection W = [x2*x1_dot, x1*x2_dot, x1_dot - x2*x2_dot];
            connection V = [x1*x2_dot + x2_dot, x2*x1_dot, 2*x2_dot];
            lagrangian = 1/2*(1 + x1^2)*dot(x_dot, x_dot) + 1/2*dot(W, diag([2, 3, 5])*W)
                + 1/2*dot(V, diag([1, 2, 3])*V) + x1_dot*W2/3 + W1*V3/2;
            {constraints} }}"
        );
        let (x, xdot) = (generic(6, 2), generic(7, 2));
        let (mut w, mut v) = (generic(8, 3), generic(9, 3));
        if constrained {
            w[2] = int(0);
            v[1] = int(0);
        }
        let point = Point::new().with_vector("x", "", &x).with_vector("x", "_dot", &xdot);
        let mut ours = Ours::at(&text, &point.with_vector("W", "", &w).with_vector("V", "", &v));
        let mut rate = |name: &str, k: usize, fixed: usize| {
            if constrained && k == fixed { int(0) } else { ours.rate(&format!("{name}{k}")) }
        };
        let w_rate: Vector = (1..4).map(|k| rate("W", k, 3)).collect();
        let v_rate: Vector = (1..4).map(|k| rate("V", k, 2)).collect();
        let x_rate = ours.rate("x1_dot");
        let momenta = |w: &[Rational], v: &[Rational], xdot: &Rational| {
            let mut pi = diagonal(&[int(2), int(3), int(5)], w);
            let mut p = diagonal(&[int(1), int(2), int(3)], v);
            pi[0] += &v[2] / int(2);
            pi[1] += xdot / int(3);
            p[2] += &w[0] / int(2);
            [pi, p]
        };
        let turned = [&x[1] * &xdot[0], &x[0] * &xdot[1], &xdot[0] - &x[1] * &xdot[1]];
        let moved = [(&x[0] + int(1)) * &xdot[1], &x[1] * &xdot[0], int(2) * &xdot[1]];
        Bundle {
            momenta: momenta(&w, &v, &xdot[0]),
            rates: momenta(&w_rate, &v_rate, &x_rate),
            xi: [minus(&w, &turned), minus(&v, &moved)],
        }
    }

    /// Residuals of slot 0 as printed, of slot 0 with every momentum, and of slot 1.
    fn residuals(&self) -> [Vector; 3] {
        let [pi, p] = &self.momenta;
        let printed = minus(&self.rates[0], &cross(pi, &self.xi[0]));
        let right = minus(&printed, &cross(p, &self.xi[1]));
        [printed, right, minus(&self.rates[1], &cross(p, &self.xi[0]))]
    }
}

#[test]
fn a3_vertical_lagrange_poincare_by_stages_keeps_every_momentum() {
    let [printed, right, last] = Bundle::new(false).residuals();
    verdict("A3, slot 0", &printed, &right);
    assert_eq!(size(&last), 0.0, "the last slot loses nothing");
}

#[test]
fn a4_vertical_equation_of_section_5_keeps_every_momentum() {
    let [printed, right, last] = Bundle::new(true).residuals();
    verdict("A4, slot 0", &printed[..2], &right[..2]);
    assert_eq!([&last[0], &last[2]], [&int(0), &int(0)], "the last slot loses nothing");
}

#[test]
fn a6_horizontal_equation_of_two_stages() {
    // Strictly upper triangular 4x4 matrices, lower central series, one base coordinate: no curvature.
    let text = "model m { algebra upper { basis e12, e23, e34, e13, e24, e14;
            [e12, e23] = e13; [e23, e34] = e24; [e12, e24] = e14; [e13, e34] = e14; }
        coordinate x in real; velocity y1, y2, y3, y4, y5, y6 in upper;
        stage n0; stage n1 = ideal(y4, y5, y6); stage n2 = ideal(y6);
        connection y1 = x*x_dot; connection y2 = 2*x_dot; connection y3 = x^2*x_dot;
        connection y4 = -x*x_dot; connection y5 = 3*x_dot; connection y6 = x*x_dot;
        lagrangian = x_dot^2 + 1/2*(y1^2 + 2*y2^2 + 3*y3^2 + y4^2 + 2*y5^2 + 3*y6^2) + x_dot*(y2 + y6)/4 + y1*y6/3; }";
    let (x, xdot, y) = (fraction(3, 2), int(2), generic(10, 6));
    let point = Point::new().with("x", x.clone()).with("x_dot", xdot).with_vector("y", "", &y);
    let mut ours = Ours::at(text, &point);
    let (xddot, ydot) = (ours.rate("x_dot"), ours.rates("y", "", 6));
    // p_x = 2 xdot + (y2 + y6)/4 along the horizontal lift.
    let rate = int(2) * xddot + (&ydot[1] + &ydot[5]) / int(4);
    let momentum = ours.output("momentum");
    let mu = &momentum[1..];
    let a = [x.clone(), int(2), &x * &x, -x.clone(), int(3), x];
    let upper = |s: &[Rational], t: &[Rational]| {
        vec![
            int(0),
            int(0),
            int(0),
            &s[0] * &t[1] - &s[1] * &t[0],
            &s[1] * &t[2] - &s[2] * &t[1],
            &s[0] * &t[4] - &s[4] * &t[0] + &s[3] * &t[2] - &s[2] * &t[3],
        ]
    };
    // b_(N0,N1)(eta^(0,1), A^(1,2)) in slot (2,3), which the printed equation drops from [A, eta].
    let stages = ours.stages();
    let level = &stages.levels[0];
    let dropped = bilinear(&level.vertical, &stages.part(&y, 0..1), &stages.part(&a, 1..2));
    let dropped = dot(mu, &stages.part(&dropped, 2..3));
    let right = rate - dot(mu, &upper(&a, &y));
    let printed = &right - dropped;
    verdict("A6", &[printed], &[right]);
}

fn spaces(n: usize) -> (LieAlgebra, Vec<Rows>) {
    let so3 = LieAlgebra::so(3).unwrap();
    let standard = Representation::standard(&so3).unwrap();
    let algebra = LieAlgebra::semidirect(&so3, &vec![standard; n]).unwrap();
    let dim = algebra.dim();
    let chain = (1..=n).map(|j| (3 * j..dim).map(|k| unit(dim, k)).collect()).collect();
    (algebra, chain)
}

/// `[x, y]` of vectors in the adapted basis.
fn bracket(algebra: &LieAlgebra, stages: &StageNumbers, x: &[Rational], y: &[Rational]) -> Vector {
    let columns = transposed(&stages.basis);
    let original = algebra.bracket_of(&times(&columns, x), &times(&columns, y));
    times(&inverse(&columns).unwrap(), &original)
}

fn drawn(seed: u64) -> Draws {
    one(seed, 900)
}

#[test]
fn a7_bracket_with_the_connection_before_it_vanishes() {
    let (algebra, chain) = spaces(1);
    let mut draws = drawn(11);
    let stages = StageNumbers::split(&algebra, &chain, &mut draws);
    let (eta, a) = (draws.generic_vector(6), draws.generic_vector(6));
    let level = &stages.levels[0];
    let part = |x: &[Rational], k: usize| stages.part(x, k..k + 1);
    let b = |x: &[Rational], y: &[Rational]| bilinear(&level.vertical, &part(x, 0), &part(y, 1));
    let first = b(&a, &eta);
    let second = b(&eta, &a);
    let printed = minus(&minus(&vec![int(0); 6], &first), &second);
    let curved = bilinear(&level.curvature, &part(&a, 0), &part(&eta, 0));
    let right = plus(&minus(&curved, &first), &second);
    let expected = part(&bracket(&algebra, &stages, &eta, &a), 1);
    verdict("A7", &minus(&expected, &printed), &minus(&expected, &right));
}

#[test]
fn a8_no_bar_on_the_second_argument() {
    let (algebra, chain) = spaces(3);
    let mut draws = drawn(12);
    let stages = StageNumbers::split(&algebra, &chain, &mut draws);
    let (eta, bar) = (draws.generic_vector(12), draws.generic_vector(12));
    let level = &stages.levels[0];
    let horizontal = |x: &[Rational]| stages.part(x, 0..1);
    let rest = |x: &[Rational]| stages.part(x, 1..4);
    let b = |x: &[Rational], y: &[Rational]| bilinear(&level.vertical, &horizontal(x), &rest(y));
    let quotient = bilinear(&stages.levels[1].quotient, &stages.part(&eta, 1..2), &stages.part(&bar, 1..2));
    let curved = bilinear(&level.curvature, &horizontal(&eta), &horizontal(&bar));
    let common = plus(&minus(&quotient, &curved), &b(&eta, &bar));
    let expected = bracket(&algebra, &stages, &eta, &bar);
    let residual = |formula: &[Rational]| stages.slot(&minus(&expected, formula), 1);
    verdict("A8", &residual(&minus(&common, &b(&bar, &bar))), &residual(&minus(&common, &b(&bar, &eta))));
}

#[test]
fn a9_only_the_horizontal_lift_identifies_the_slots() {
    let (algebra, chain) = spaces(1);
    let mut draws = drawn(13);
    let stages = StageNumbers::split(&algebra, &chain, &mut draws);
    let (x, y) = (draws.generic_vector(6), draws.generic_vector(6));
    let level = &stages.levels[0];
    let part = |x: &[Rational], k: usize| stages.part(x, k..k + 1);
    // [k, k'] - a(k, k') + b(k, n') - b(k', n) + [n, n'] in the slots; [n, n'] = 0.
    let b = |x: &[Rational], y: &[Rational]| bilinear(&level.vertical, &part(x, 0), &part(y, 1));
    let quotient = bilinear(&level.quotient, &part(&x, 0), &part(&y, 0));
    let curved = bilinear(&level.curvature, &part(&x, 0), &part(&y, 0));
    let formula = plus(&minus(&quotient, &curved), &minus(&b(&x, &y), &b(&y, &x)));
    let right = minus(&bracket(&algebra, &stages, &x, &y), &formula);
    // Another section of the quotient: the adapted elements of level 0 moved along the ideal.
    let mut other = stages.clone();
    for row in &mut other.basis[..3] {
        let shift = draws.generic_vector(3);
        row.iter_mut().skip(3).zip(shift).for_each(|(q, s)| *q += s);
    }
    let wrong = minus(&bracket(&algebra, &other, &x, &y), &formula);
    verdict("A9", &wrong, &right);
}

/// Euler's disk: doubles, because its Lagrangian contains sines.
struct Disk {
    /// `I3 (psi'' + phi'' cos - theta' phi' sin)`, the rate of the momentum of the spin.
    spin: f64,
    /// `M <etadot, u> + M r (..) - M e r (..)/2`, the rate of the horizontal momentum along `u`.
    sliding: f64,
    r: f64,
}

impl Disk {
    fn new() -> Disk {
        let model = spec::parse("euler_disk.hamel", &spec_text("euler_disk")).unwrap();
        let scene = scene::build(&model, scene::DEFAULT).unwrap();
        assert_eq!(scene.state_names(), ["theta", "phi", "theta_dot", "phi_dot", "psi_dot"]);
        let default = |name: &str| {
            let found = scene.params().iter().find(|p| p.name == name).unwrap();
            hamel_expr::rational_to_f64(&found.default)
        };
        let [m, r, e, i3] = ["M", "r", "e", "I3"].map(default);
        let defaults: Vec<f64> = scene.params().iter().map(|p| default(&p.name)).collect();
        let state = [0.9, 0.6, -1.3, 1.7, -4.1];
        let mut rate = [0.0; 5];
        scene.prepare(&defaults).unwrap().rhs(0.0, &state, &mut rate);
        let [theta, _, theta_dot, phi_dot, _] = state;
        let (sin, cos) = theta.sin_cos();
        let [_, _, _, phi_ddot, psi_ddot] = rate;
        let spin = i3 * (psi_ddot + phi_ddot * cos - theta_dot * phi_dot * sin);
        let sliding = m * r * psi_ddot + m * r * (phi_ddot * cos - 2.0 * theta_dot * phi_dot * sin)
            - m * e * r / 2.0 * (phi_ddot * sin + 2.0 * theta_dot * phi_dot * cos);
        Disk { spin, sliding, r }
    }
}

/// Round-off of a sum of a dozen terms below one.
const ROUND_OFF: f64 = 1e-14;

#[test]
fn a10_vertical_equation_adds_the_slots() {
    let disk = Disk::new();
    // S_1 = 0: read by slots, (31) would keep the momentum of the spin.
    let right = disk.spin + disk.r * disk.sliding;
    println!("A10: printed {:.3}, right {right:.1e}", disk.spin.abs());
    assert!(disk.spin.abs() > 0.01);
    assert!(right.abs() < ROUND_OFF);
}

#[test]
fn a14_first_equation_of_eulers_disk_has_no_r_before_i3() {
    let disk = Disk::new();
    let printed = disk.r * disk.spin + disk.r * disk.sliding;
    let right = disk.spin + disk.r * disk.sliding;
    println!("A14: printed {:.4}, right {right:.1e}", printed.abs());
    assert!(printed.abs() > 0.01);
    assert!(right.abs() < ROUND_OFF);
}

#[test]
fn staged_equations_of_these_tests_are_the_coadjoint_ones() {
    let (algebra, chain) = spaces(2);
    let mut draws = drawn(14);
    let stages = StageNumbers::split(&algebra, &chain, &mut draws);
    let (eta, beta) = (draws.generic_vector(9), draws.generic_vector(9));
    let columns = transposed(&stages.basis);
    let mu = times(&inverse(&stages.basis).unwrap(), &beta);
    let expected = times(&stages.basis, &ad_star(&algebra, &times(&columns, &eta), &mu));
    assert_eq!(stages.full_vertical(&eta, &beta), expected);
    assert_ne!(stages.printed_vertical(&eta, &beta), expected);
}
