//! Systems of first order without energy: shapes by fields, groups by constraints, connections and gaits, against
//! drag that is summed over the links and integrated by a method of its own.

use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;

const SWIMMER: &str = include_str!("../../models/specs/purcell_swimmer.hamel");
const SNAKE: &str = include_str!("../../docs/book/kinematic_snake.hamel");

fn build(text: &str, scene: &str) -> BuiltScene {
    let model = spec::parse("m.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"))
}

fn refusal(items: &str) -> String {
    let text = format!("model m {{ {items} }}");
    match spec::parse("m.hamel", &text) {
        Ok(model) => scene::build(&model, "default").expect_err("a refusal").to_string(),
        Err(problems) => problems.to_string(),
    }
}

fn output(built: &BuiltScene, params: &[f64], y: &[f64], name: &str) -> f64 {
    let outputs = built.outputs();
    let mut names = outputs.iter().flat_map(|o| &o.components).map(|(name, _)| name);
    let at = names.position(|own| own == name).unwrap_or_else(|| panic!("no {name}"));
    built.prepare(params).unwrap_or_else(|e| panic!("{e}")).outputs(0.0, y)[at]
}

/// Nodes and weights of the rule of Gauss with three points, which is exact for the drag on a straight link.
const GAUSS: [(f64, f64); 3] =
    [(-0.774_596_669_241_483_4, 5.0 / 18.0), (0.0, 8.0 / 18.0), (0.774_596_669_241_483_4, 5.0 / 18.0)];

/// Force and moment about its centre of the drag on a swimmer of three links, by pieces of the links.
fn drag([l, k]: [f64; 2], angles: [f64; 2], rates: [f64; 2], [w, v1, v2]: [f64; 3]) -> [f64; 3] {
    let mut total = [0.0; 3];
    let links = [(0.0, 0.0, 0.0, 0.0), (-l, -1.0, angles[0], rates[0]), (l, 1.0, angles[1], rates[1])];
    for (joint, side, angle, rate) in links {
        let (along, across) = ([angle.cos(), angle.sin()], [-angle.sin(), angle.cos()]);
        for (node, weight) in GAUSS {
            let d = (node + side) * l;
            let place = [joint + d * along[0], d * along[1]];
            let turn = rate * d;
            let u = [v1 - w * place[1] + turn * across[0], v2 + w * place[0] + turn * across[1]];
            let (t, n) = (u[0] * along[0] + u[1] * along[1], u[0] * across[0] + u[1] * across[1]);
            let f = [0, 1].map(|i| weight * (t * along[i] + k * n * across[i]));
            total[0] += f[0];
            total[1] += f[1];
            total[2] += place[0] * f[1] - place[1] * f[0];
        }
    }
    total
}

/// The motion of the middle link at which nothing is left of the drag: three equations by Cramer's rule.
fn without_drag(p: [f64; 2], angles: [f64; 2], rates: [f64; 2]) -> [f64; 3] {
    let still = drag(p, angles, rates, [0.0; 3]);
    let unit = |k: usize| [0, 1, 2].map(|j| if j == k { 1.0 } else { 0.0 });
    let columns = [0, 1, 2].map(|k| drag(p, angles, [0.0; 2], unit(k)));
    let det = |c: [[f64; 3]; 3]| {
        (0..3).fold(0.0, |sum, i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            sum + c[0][i] * (c[1][j] * c[2][k] - c[1][k] * c[2][j])
        })
    };
    let whole = det(columns);
    [0, 1, 2].map(|k| {
        let mut replaced = columns;
        replaced[k] = still.map(|x| -x);
        det(replaced) / whole
    })
}

/// Heading and place after one turn of the shape, by the classical method of Runge and Kutta.
fn gait(p: [f64; 2], amplitude: f64, steps: u32) -> [f64; 3] {
    let rates = |t: f64, g: [f64; 3]| {
        let [w, v1, v2] = without_drag(
            p,
            [amplitude * t.sin(), amplitude * t.cos()],
            [amplitude * t.cos(), -amplitude * t.sin()],
        );
        let (s, c) = g[0].sin_cos();
        [w, c * v1 - s * v2, s * v1 + c * v2]
    };
    let h = std::f64::consts::TAU / f64::from(steps);
    let mut g = [0.0; 3];
    for step in 0..steps {
        let t = f64::from(step) * h;
        let moved = |k: [f64; 3], by: f64| [0, 1, 2].map(|i| g[i] + by * k[i]);
        let k1 = rates(t, g);
        let k2 = rates(t + h / 2.0, moved(k1, h / 2.0));
        let k3 = rates(t + h / 2.0, moved(k2, h / 2.0));
        let k4 = rates(t + h, moved(k3, h));
        g = [0, 1, 2].map(|i| g[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]));
    }
    g
}

#[test]
fn a_swimmer_without_inertia_has_its_shape_as_state() {
    let built = build(SWIMMER, "reconstruction");
    assert_eq!(built.state_names(), ["alpha1", "alpha2", "theta", "x", "y"]);
    let [l, k, amplitude, nu] = [0.7, 1.6, 0.9, 1.3];
    let prepared = built.prepare(&[l, k, amplitude, nu]).unwrap();
    for t in [0.0_f64, 0.4, 2.7] {
        let angles = [0.6 - t / 3.0, 1.1 * t.cos()];
        let rates = [nu * amplitude * (nu * t).cos(), -nu * amplitude * (nu * t).sin()];
        let mut dy = [0.0; 5];
        prepared.rhs(t, &[angles[0], angles[1], 0.0, 0.0, 0.0], &mut dy);
        let expected = without_drag([l, k], angles, rates);
        for (found, expected) in dy.iter().zip(rates.iter().chain(&expected)) {
            assert!((found - expected).abs() < 1e-14, "{found}, by sums over the links {expected}");
        }
    }
}

/// `xi = -A(x) xdot` is the motion without drag at these rates, and the curvature follows from differences of it; also
/// at shapes with equal angles, where coefficients of the equations vanish, and their determinant does not.
#[test]
fn the_connection_of_the_swimmer_is_its_motion_without_drag() {
    let built = build(SWIMMER, "shape");
    let p = [0.7, 1.6];
    let params = [p[0], p[1], 1.0, 1.0];
    let names = ["omega", "v1", "v2"];
    let unit = |of: usize| [0, 1].map(|j| if of == j { 1.0 } else { 0.0 });
    for shape in [[0.5, -0.8], [0.0, 0.0], [0.6, 0.6]] {
        let coefficient =
            |v: &str, i: usize| output(&built, &params, &shape, &format!("connection_{v}_alpha{}", i + 1));
        for i in 0..2 {
            for (v, expected) in names.iter().zip(without_drag(p, shape, unit(i))) {
                let found = -coefficient(v, i);
                assert!((found - expected).abs() < 1e-14, "{v}: {found}, by sums over the links {expected}");
            }
        }
        // Central differences of the drag's own motion; [e_omega, e_1] = e_2, [e_omega, e_2] = -e_1.
        let h = 1e-4;
        let slope = |along: usize, of: usize, k: usize| {
            let at = |by: f64| {
                let mut moved = shape;
                moved[along] += by;
                -without_drag(p, moved, unit(of))[k]
            };
            (at(h) - at(-h)) / (2.0 * h)
        };
        let [a, b] = [0, 1].map(|i| names.map(|v| coefficient(v, i)));
        let bracket = [0.0, -(a[0] * b[2] - b[0] * a[2]), a[0] * b[1] - b[0] * a[1]];
        for (k, v) in names.iter().enumerate() {
            let expected = slope(0, 1, k) - slope(1, 0, k) - bracket[k];
            let found = output(&built, &params, &shape, &format!("curvature_{v}_alpha1_alpha2"));
            // The error of a central difference: its step squared.
            assert!((found - expected).abs() < 1e-7, "{v}: {found}, by differences {expected}");
        }
    }
}

/// One turn of a circle of 0.8 in the plane of the joint angles moves a swimmer of links of length 1 and drag 2 by
/// (-0.1051146704, -0.0223886828): the value of an integration to nine digits.
#[test]
fn one_gait_of_the_swimmer() {
    let found = gait([0.5, 2.0], 0.8, 2000);
    let published = [0.0, -0.105_114_670_4, -0.022_388_682_8];
    for (found, published) in found.iter().zip(published) {
        assert!((found - published).abs() < 1e-9, "{found}, {published}");
    }
    let built = build(SWIMMER, "reconstruction");
    let prepared = built.prepare(&[0.5, 2.0, 0.8, 1.0]).unwrap();
    let n = 2000_u32;
    let h = std::f64::consts::TAU / f64::from(n);
    let mut y = vec![0.0, 0.8, 0.0, 0.0, 0.0];
    let rates = |t: f64, y: &[f64]| {
        let mut dy = vec![0.0; y.len()];
        prepared.rhs(t, y, &mut dy);
        dy
    };
    for step in 0..n {
        let t = f64::from(step) * h;
        let moved = |k: &[f64], by: f64| -> Vec<f64> { y.iter().zip(k).map(|(y, k)| y + by * k).collect() };
        let k1 = rates(t, &y);
        let k2 = rates(t + h / 2.0, &moved(&k1, h / 2.0));
        let k3 = rates(t + h / 2.0, &moved(&k2, h / 2.0));
        let k4 = rates(t + h, &moved(&k3, h));
        for i in 0..y.len() {
            y[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    for (found, expected) in y[2..].iter().zip(found) {
        assert!((found - expected).abs() < 1e-11, "{found}, by sums over the links {expected}");
    }
}

/// The wheels of the links do not slide, by the velocities of their centres in space.
#[test]
fn the_links_of_a_kinematic_snake_do_not_slide() {
    let built = build(SNAKE, "reconstruction");
    assert_eq!(built.state_names(), ["alpha1", "alpha2", "theta", "x", "y"]);
    let params: Vec<f64> = vec![0.6, 0.3, 0.9, 1.2];
    let l = params[0];
    let prepared = built.prepare(&params).unwrap();
    let y = [0.7, 1.2, 0.4, 0.0, 0.0];
    let mut dy = [0.0; 5];
    prepared.rhs(0.6, &y, &mut dy);
    let heading = y[2];
    let (s, c) = heading.sin_cos();
    assert!((c * dy[4] - s * dy[3]).abs() < 1e-14);
    for (side, k) in [(-1.0, 0), (1.0, 1)] {
        let angle = heading + y[k];
        let turning = dy[2] + dy[k];
        // Joint and centre of the link, each by its own turn about the one before.
        let u = [
            dy[3] - side * l * (s * dy[2] + angle.sin() * turning),
            dy[4] + side * l * (c * dy[2] + angle.cos() * turning),
        ];
        let across = angle.cos() * u[1] - angle.sin() * u[0];
        assert!(across.abs() < 1e-14, "{across}");
    }
}

/// Momenta of a Lagrangian in constraints are its derivatives: a body whose parts move, from rest.
#[test]
fn a_constraint_may_say_that_a_momentum_vanishes() {
    let items = "param J = 2 where J > 0; coordinate q in angle; velocity w in R; momentum L of w;
        lagrangian = J*w^2/2 + (w + (1 + q^2)*q_dot)^2/2;
        constraint still: L = 0; constraint shape: q_dot = cos(t);";
    let built = build(
        &format!("model m {{ {items} reconstruct phi in R; scene s {{ want reconstruction; }} }}"),
        "s",
    );
    assert_eq!(built.state_names(), ["q", "phi"]);
    let (t, q, j) = (0.3_f64, 0.4_f64, 1.7_f64);
    let mut dy = [0.0; 2];
    built.prepare(&[j]).unwrap().rhs(t, &[q, 0.0], &mut dy);
    let expected = -(1.0 + q * q) * t.cos() / (j + 1.0);
    assert!((dy[1] - expected).abs() < 1e-15, "{}, {expected}", dy[1]);
    let of_hamiltonian = refusal("velocity w in R; momentum p of w; hamiltonian = p^2/2; constraint p = 1;");
    assert!(of_hamiltonian.contains("contains the momentum `p`"), "{of_hamiltonian}");
}

/// Fields and constraints may contain inputs: nothing has to be differentiated.
#[test]
fn inputs_move_shapes_and_constraints() {
    let items = "input u = 0.4; input wind = 0; coordinate a in angle; velocity v in R^2; \
        constraint v1 + a*a_dot = wind; constraint v2 = a_dot; field a_dot = u - a; \
        reconstruct x, y in R^2; scene s { input u, wind; want reconstruction; }";
    let built = build(&format!("model m {{ {items} }}"), "s");
    let mut dy = [0.0; 3];
    built.prepare(&[]).unwrap().rhs_with(0.0, &[0.5, 0.0, 0.0], &[2.0, 0.7], &mut dy);
    assert_eq!(dy, [1.5, 0.7 - 0.75, 1.5]);
}

#[test]
fn what_does_not_determine_the_motion_is_refused() {
    let start = "coordinate a, b in angle; velocity w, v in se(2); field a_dot = 1; field b_dot = sin(t);";
    for (items, expected) in [
        ("constraint v2 = 0;", "1 constraint beside fields for 3 velocities"),
        ("field w = 0; field v = [0, 0]; constraint v1 = 0;", "1 constraint beside fields for 0 velocities"),
        ("constraint v = [a, b]; constraint v2 = 0;", "v2 = 0"),
        ("constraint v = [a, b]; constraint a_dot = 2;", "field a_dot contradicts the others"),
        ("constraint v = [a, b]; constraint w^2 = 1;", "not affine in the velocities"),
        ("constraint v = [a, b]; constraint ddt(w) = 1;", "not affine in the velocities"),
        ("acceleration w = 1; constraint v = [a, b];", "`constraint` beside `field` has no use"),
        ("constraint v = [a, b]; constraint w = 0; force w = 1;", "`force` beside `field` has no use"),
        ("constraint v = [a, b]; constraint w = 0; connection mechanical;", "mechanical"),
        ("constraint v = [a, b]; constraint w = 0; scene default { want energy; }", "no lagrangian"),
    ] {
        let found = refusal(&format!("{start} {items}"));
        assert!(found.contains(expected), "{items}: {found}");
    }
    for items in [
        "coordinate a in real; lagrangian = a_dot^2;",
        "coordinate a in real; velocity w in R; lagrangian = a_dot^2 + w^2;",
    ] {
        let found = refusal(&format!("{items} scene default {{ want connection; }}"));
        assert!(found.contains("wants `connection`, and the model has none"), "{found}");
    }
    let in_frame = refusal(
        "coordinate a in real; velocity w in R; frame { u = a_dot; p = w + a*a_dot; } lagrangian = u^2 + p^2; \
         connection mechanical; scene default { want connection; }",
    );
    assert!(in_frame.contains("connection"), "{in_frame}");
}
