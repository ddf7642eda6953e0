//! Geometric and dynamic phases of coordinates that an abelian group moves.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_tests::models::{follow, params, quaternion_product, times};

fn tried(items: &str) -> Result<BuiltScene, String> {
    let text = format!("model m {{ {items} scene turned {{ want rhs, reconstruction, phases; }} }}");
    let model = spec::parse("test.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, "turned").map_err(|e| e.to_string())
}

fn built(items: &str) -> BuiltScene {
    tried(items).unwrap_or_else(|e| panic!("{e}\n{items}"))
}

/// The parts of the rate of a coordinate and the rate itself, at a state by names.
fn parts(scene: &BuiltScene, state: &[(&str, f64)], of: &str) -> ([f64; 2], f64) {
    let names = scene.state_names();
    let value = |name: &String| state.iter().find(|(own, _)| own == name).map_or(0.0, |(_, x)| *x);
    let y: Vec<f64> = names.iter().map(value).collect();
    let prepared = scene.prepare(&params(scene, &[])).expect("valid parameters");
    let mut rates = vec![0.0; y.len()];
    prepared.rhs(0.0, &y, &mut rates);
    let outputs = scene.outputs().iter().flat_map(|o| o.components.iter().map(|(name, _)| name.clone()));
    let values: Vec<(String, f64)> = outputs.zip(prepared.outputs(0.0, &y)).collect();
    let find = |part: &str| {
        let name = format!("{of}_{part}");
        values.iter().find(|(own, _)| *own == name).unwrap_or_else(|| panic!("no {name} in {values:?}")).1
    };
    let place = names.iter().position(|name| name == of).expect("a reconstructed coordinate");
    ([find("geometric"), find("dynamic")], rates[place])
}

fn close(a: f64, b: f64) -> bool {
    (a - b).abs() < 1e-14 * (1.0 + a.abs())
}

const HINGE: &str =
    "param I = 2 where I > 0; param J = 1 where J > 0; coordinate psi in angle; velocity omega in R;
    lagrangian = I/2*omega^2 + J/2*(omega + psi_dot)^2 + cos(psi); reconstruct theta in SO(2);";

#[test]
fn at_zero_momentum_the_heading_turns_by_the_geometric_phase() {
    let scene = built(&format!("{HINGE} connection mechanical;"));
    let (psi_dot, v) = (0.7, -0.4);
    let state = [("psi", 0.3), ("psi_dot", psi_dot), ("omega", v)];
    let ([geometric, dynamic], rate) = parts(&scene, &state, "theta");
    assert!(close(geometric, -psi_dot / 3.0) && close(dynamic, v) && close(rate, geometric + dynamic));
    let initial = [("psi", 1.0), ("psi_dot", 0.0), ("omega", 0.0), ("theta", 0.0)];
    let mut turned = 0.0_f64;
    follow(&scene, &[], &initial, &times(7.0, 14), |at| {
        turned = turned.max(at.get("theta").abs());
        assert!((at.get("theta") + (at.get("psi") - 1.0) / 3.0).abs() < 1e-11);
    });
    assert!(turned > 0.3);
}

#[test]
fn the_parts_depend_on_the_connection_and_their_sum_does_not() {
    let (psi, psi_dot, omega) = (0.3, 0.7, -0.4);
    for side in ["left", "right"] {
        for (connection, a) in [("mechanical", 1.0 / 3.0), ("omega = 0.3*psi*psi_dot", 0.3 * psi)] {
            let scene = built(&format!("{HINGE} action {side}; connection {connection};"));
            let state = [("psi", psi), ("psi_dot", psi_dot), ("omega", omega + a * psi_dot)];
            let ([geometric, dynamic], rate) = parts(&scene, &state, "theta");
            assert!(close(geometric, -a * psi_dot), "{connection}: {geometric}");
            assert!(close(dynamic, omega + a * psi_dot) && close(rate, omega), "{connection}");
        }
    }
}

#[test]
fn a_constraint_that_is_horizontal_leaves_no_dynamic_phase() {
    let rolling = "param c = 0.6; coordinate a, b in angle; velocity w in R^2;
        lagrangian = a_dot^2 + b_dot^2 + dot(w, w) + a_dot*w1/2;
        constraint w1 = c*cos(a)*b_dot; constraint w2 = a_dot - b*b_dot; connection nonholonomic;
        reconstruct x in R^2;";
    let scene = built(rolling);
    let state = [("a", 0.4), ("b", 1.5), ("a_dot", 0.9), ("b_dot", -0.8)];
    let expected = [0.6 * 0.4_f64.cos() * -0.8, 0.9 + 1.5 * 0.8];
    for (name, expected) in ["x1", "x2"].into_iter().zip(expected) {
        let ([geometric, dynamic], rate) = parts(&scene, &state, name);
        assert!(dynamic == 0.0 && close(geometric, expected) && close(rate, expected), "{name}: {geometric}");
    }
}

#[test]
fn a_cyclic_coordinate_with_a_fixed_momentum_has_phases_of_the_mechanical_connection() {
    let bead = "param p = 0.8; param q = 0.3; coordinate r in (0, 10); coordinate phi, chi in angle;
        lagrangian = (r_dot^2 + r^2*phi_dot^2 + chi_dot^2 + phi_dot*chi_dot)/2 + r*r_dot*phi_dot/4 + phi_dot/5 - r;
        routh phi = p, chi = q;";
    let scene = built(bead);
    let (r, r_dot) = (1.7, 0.6);
    // L_vv = [[r^2, 1/2], [1/2, 1]], L_vx = [r/4, 0], without velocities p - L_v = [p - 1/5, q].
    let (k, l, m) = (r * r, 0.5, 1.0);
    let solved = |a: f64, b: f64| {
        let det = k * m - l * l;
        [(m * a - l * b) / det, (k * b - l * a) / det]
    };
    let (still, moving) = (solved(0.8 - 0.2, 0.3), solved(-r / 4.0 * r_dot, 0.0));
    for (at, name) in ["phi", "chi"].into_iter().enumerate() {
        let ([geometric, dynamic], rate) = parts(&scene, &[("r", r), ("r_dot", r_dot)], name);
        assert!(close(geometric, moving[at]) && close(dynamic, still[at]), "{name}: {geometric}, {dynamic}");
        assert!(close(rate, still[at] + moving[at]) && geometric.abs() > 0.01);
    }
}

/// Moments of inertia, the largest about the first axis.
const MOMENTS: [f64; 3] = [2.0, 1.5, 0.8];

const FREE: &str =
    "param I: diagonal(3) = [2.0, 1.5, 0.8] where I1 > 0, I2 > 0, I3 > 0; velocity Omega in so(3);
    lagrangian = 1/2*dot(Omega, I*Omega); reconstruct q in SO(3);";

/// The complete elliptic integral `K(k)` by the arithmetic and geometric mean.
fn elliptic(k_squared: f64) -> f64 {
    let (mut a, mut b) = (1.0, (1.0 - k_squared).sqrt());
    for _ in 0..12 {
        (a, b) = ((a + b) / 2.0, (a * b).sqrt());
    }
    std::f64::consts::FRAC_PI_2 / a
}

/// Twice the energy, the length of the momentum, and the period of the momentum in the body: Landau, Lifshitz,
/// Mechanics, section 37.
fn period(omega: [f64; 3]) -> (f64, f64, f64) {
    let sum = |n: i32| MOMENTS.iter().zip(omega).map(|(i, w)| i.powi(n) * w * w).sum::<f64>();
    let (twice, square) = (sum(1), sum(2));
    let [mut c, b, mut a] = MOMENTS;
    if square < twice * b {
        (a, c) = (c, a);
    }
    let k = (b - a) * (twice * c - square) / ((c - b) * (square - twice * a));
    let period = 4.0 * elliptic(k) * (a * b * c / ((c - b) * (square - twice * a))).sqrt();
    (twice, square.sqrt(), period)
}

/// Montgomery's formula: after a period of the momentum in the body, the body has turned about the momentum by `2 E T/
/// |mu|` less the solid angle that the momentum has swept.
#[test]
fn a_free_body_turns_by_the_energy_and_a_solid_angle() {
    let scene = built(FREE);
    // About the axis of the smallest moment, about that of the largest, backwards, and next to the separatrix.
    let starts = [[0.4, -0.3, 2.1], [1.7, 0.4, 0.5], [-1.4, 0.6, -0.2], [0.05, 1.9, 0.3], [0.3, 0.5, -1.6]];
    for omega in starts {
        let (twice, norm, period) = period(omega);
        let mut initial = vec![("qw", 0.8), ("qx", 0.0), ("qy", 0.6), ("qz", 0.0)];
        initial.extend(["Omega1", "Omega2", "Omega3"].into_iter().zip(omega));
        let n = 1200_u32;
        let weight = period / f64::from(n);
        let (mut swept, mut along) = (0.0, 0.0);
        let mut attitudes = Vec::new();
        let mut ends = Vec::new();
        follow(&scene, &[], &initial, &times(period, n), |at| {
            let outputs =
                scene.outputs().iter().flat_map(|o| o.components.iter().map(|(name, _)| name.as_str()));
            let values: Vec<(&str, f64)> = outputs.zip(at.outputs()).collect();
            let find = |name: &str| values.iter().find(|(own, _)| *own == name).expect("a phase").1;
            // Ends of a period are one point: equal weights.
            if at.t < period - weight / 2.0 {
                swept += find("q_geometric") * weight;
                along += find("q_dynamic") * weight;
            }
            attitudes.push(["qw", "qx", "qy", "qz"].map(|name| at.get(name)));
            ends.push(["Omega1", "Omega2", "Omega3"].map(|name| at.get(name)));
        });
        let (first, last) = (attitudes[0], attitudes[n as usize]);
        assert!(
            ends[0].iter().zip(ends[n as usize]).all(|(a, b)| (a - b).abs() < 1e-9),
            "{omega:?}: no period"
        );
        assert!((along - twice * period / norm).abs() < 1e-9, "{omega:?}: {along}");
        // q(T) q(0)^-1 and the momentum in space.
        let [w, x, y, z] = first;
        let turn = quaternion_product(last, [w, -x, -y, -z]);
        let pi: Vec<f64> = MOMENTS.iter().zip(omega).map(|(i, w)| i * w / norm).collect();
        let mu = [
            (1.0 - 2.0 * (y * y + z * z)) * pi[0]
                + 2.0 * (x * y - w * z) * pi[1]
                + 2.0 * (x * z + w * y) * pi[2],
            2.0 * (x * y + w * z) * pi[0]
                + (1.0 - 2.0 * (x * x + z * z)) * pi[1]
                + 2.0 * (y * z - w * x) * pi[2],
            2.0 * (x * z - w * y) * pi[0]
                + 2.0 * (y * z + w * x) * pi[1]
                + (1.0 - 2.0 * (x * x + y * y)) * pi[2],
        ];
        let about: f64 = mu.iter().zip(&turn[1..]).map(|(m, t)| m * t).sum();
        assert!(
            mu.iter().zip(&turn[1..]).all(|(m, t)| (t - m * about).abs() < 1e-9),
            "{omega:?}: another axis"
        );
        let theta = 2.0 * about.atan2(turn[0]);
        let apart = theta - (twice * period / norm + swept);
        assert!(apart.sin().abs() < 1e-9 && apart.cos() > 0.0, "{omega:?}: {theta}, {swept}");
        assert!(swept.abs() > 0.1, "{omega:?}: {swept}");
    }
}

#[test]
fn attitudes_of_bodies_with_a_shape_or_rotors_have_phases_where_the_momentum_is_constant_in_space() {
    let rotors = "param k = 0.3; coordinate x in real; velocity Omega, W in product(so(3), so(3));
        connection Omega1 = x*x_dot;
        lagrangian = (Omega1^2 + 2*Omega2^2 + 3*Omega3^2)/2 + k*Omega2 + x_dot^2/2 + x*x_dot*Omega3/5 - x^2
            + (2*W1^2 + W2^2 + 3*W3^2)/2;
        reconstruct q in SO(3) from Omega; reconstruct p in SO(3) from W;";
    let scene = built(rotors);
    let names: Vec<&str> =
        scene.outputs().iter().flat_map(|o| o.components.iter().map(|(name, _)| name.as_str())).collect();
    for name in ["q_geometric", "q_dynamic", "p_geometric", "p_dynamic"] {
        assert!(names.contains(&name), "{name} in {names:?}");
    }
    // A weight, a torque, and an action from the right, whose momentum is constant in the body.
    for more in ["force Omega1 = 0.1;", "action right;"] {
        let problem = tried(&format!("{FREE} {more}")).expect_err("no phases");
        assert!(problem.contains("no angular momentum of a quaternion is constant in space"), "{problem}");
    }
}

#[test]
fn without_a_connection_there_are_no_phases() {
    let reason = "there are no phases: no coordinate of an abelian group is moved through a connection";
    let framed = HINGE.replace("reconstruct", "frame { a = omega + psi_dot; b = psi_dot; } reconstruct");
    let turning = "coordinate s in real; velocity w in so(3); lagrangian = s_dot^2 + dot(w, w) - s*w1;
        force w2 = s; connection w1 = s_dot; reconstruct q in SO(3);";
    for items in [HINGE.to_owned(), framed, turning.to_owned()] {
        let problem = tried(&items).expect_err("no connection");
        assert!(problem.contains(reason), "{problem}");
    }
}
