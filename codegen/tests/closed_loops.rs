//! Linkages whose loops are closed by equations between coordinates, held to planar bodies in Cartesian coordinates
//! with the forces of their pins: Newton's and Euler's equations, solved numerically together with the second
//! derivatives of the pins.
//!
//! Deliberately does not know: how an equation between coordinates becomes a constraint.

use hamel_codegen::scene::{self, BuiltScene, Interpreter, PositionLayout};
use hamel_codegen::spec;
use hamel_runtime::{Dual, Error, Positions, StateVector, System, consistent, consistent_by};

/// A planar body: mass, moment of inertia about its centre.
struct Body(f64, f64);

/// A point of a body, by its place from the centre in the frame of the body; none for the ground.
type Point = (Option<usize>, [f64; 2]);

/// What holds bodies: two points stay together, or a point stays on the line `y = 0`, or a body does not turn.
enum Joint {
    Pin(Point, Point),
    OnAxis(usize, [f64; 2]),
    NoTurning(usize),
}

/// Bodies with gravity along `-y`.
struct Mechanism {
    bodies: Vec<Body>,
    joints: Vec<Joint>,
    gravity: f64,
}

fn turned(angle: f64, [x, y]: [f64; 2]) -> [f64; 2] {
    [angle.cos() * x - angle.sin() * y, angle.sin() * x + angle.cos() * y]
}

impl Mechanism {
    /// Rows of `J` and what `J qddot` is for the angles and rates of the bodies.
    fn rows(&self, angle: &[f64], rate: &[f64]) -> Vec<(Vec<f64>, f64)> {
        let n = 3 * self.bodies.len();
        let add = |row: &mut Vec<f64>, right: &mut f64, (body, place): Point, axis: usize, sign: f64| {
            let Some(k) = body else { return };
            let p = turned(angle[k], place);
            row[3 * k + axis] += sign;
            // v = v_c + w (-p_y, p_x), a = a_c + w' (-p_y, p_x) - w^2 p.
            row[3 * k + 2] += sign * if axis == 0 { -p[1] } else { p[0] };
            *right += sign * rate[k] * rate[k] * p[axis];
        };
        let mut rows = Vec::new();
        for joint in &self.joints {
            match joint {
                Joint::Pin(a, b) => {
                    for axis in 0..2 {
                        let (mut row, mut right) = (vec![0.0; n], 0.0);
                        add(&mut row, &mut right, *a, axis, 1.0);
                        add(&mut row, &mut right, *b, axis, -1.0);
                        rows.push((row, right));
                    }
                }
                Joint::OnAxis(body, place) => {
                    let (mut row, mut right) = (vec![0.0; n], 0.0);
                    add(&mut row, &mut right, (Some(*body), *place), 1, 1.0);
                    rows.push((row, right));
                }
                Joint::NoTurning(body) => {
                    let mut row = vec![0.0; n];
                    row[3 * body + 2] = 1.0;
                    rows.push((row, 0.0));
                }
            }
        }
        rows
    }

    /// `(x'', y'', theta'')` of every body; the forces of the pins act along their rows.
    fn accelerations(&self, angle: &[f64], rate: &[f64]) -> Vec<f64> {
        let rows = self.rows(angle, rate);
        let n = 3 * self.bodies.len();
        let size = n + rows.len();
        let mut matrix = vec![vec![0.0; size + 1]; size];
        for (k, Body(mass, inertia)) in self.bodies.iter().enumerate() {
            for (axis, value) in [*mass, *mass, *inertia].into_iter().enumerate() {
                matrix[3 * k + axis][3 * k + axis] = value;
            }
            matrix[3 * k + 1][size] = -mass * self.gravity;
        }
        for (c, (row, right)) in rows.iter().enumerate() {
            for (k, slope) in row.iter().enumerate() {
                matrix[k][n + c] = *slope;
                matrix[n + c][k] = *slope;
            }
            matrix[n + c][size] = *right;
        }
        let mut found = solve(matrix);
        found.truncate(n);
        found
    }
}

/// Elimination with pivots; the right side is the last column.
fn solve(mut rows: Vec<Vec<f64>>) -> Vec<f64> {
    let n = rows.len();
    for k in 0..n {
        let pivot = (k..n).max_by(|a, b| rows[*a][k].abs().total_cmp(&rows[*b][k].abs())).unwrap();
        rows.swap(k, pivot);
        assert!(rows[k][k].abs() > 1e-12, "the mechanism is singular");
        for i in 0..n {
            if i == k {
                continue;
            }
            let factor = rows[i][k] / rows[k][k];
            let pivot = rows[k].clone();
            rows[i].iter_mut().zip(&pivot).for_each(|(x, p)| *x -= factor * p);
        }
    }
    (0..n).map(|k| rows[k][n] / rows[k][k]).collect()
}

fn built(text: &str) -> BuiltScene {
    let model = spec::parse("loop.hamel", text).unwrap_or_else(|p| panic!("{p}"));
    scene::build(&model, "default").unwrap_or_else(|p| panic!("{p}"))
}

/// The rate of a component of the state at a state given by names; what is not named is none of the state's.
fn rates(scene: &BuiltScene, values: &[(&str, f64)]) -> impl Fn(&str) -> f64 + use<> {
    let params: Vec<f64> = scene.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&params).unwrap();
    let names = scene.state_names();
    let value = |name: &String| values.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("{name}")).1;
    let y: Vec<f64> = names.iter().map(value).collect();
    let mut dy = vec![0.0; y.len()];
    interpreter.rhs(0.0, &y, &mut dy);
    move |name| dy[names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{name} of {names:?}"))]
}

/// Rates of coordinates and accelerations in a scene that carries the momenta of all its velocities, at a state given
/// by these: what follows from the momenta, differentiated along their motion.
fn rates_by_momenta(scene: &BuiltScene, values: &[(&str, f64)]) -> impl Fn(&str) -> f64 + use<> {
    let params: Vec<f64> = scene.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
    let interpreter = scene.prepare(&params).unwrap();
    let value = |name: &str| values.iter().find(|(n, _)| *n == name).unwrap_or_else(|| panic!("{name}")).1;
    let (names, legendre) = (scene.state_names(), scene.legendre());
    let carried: Vec<&String> = legendre.momenta.iter().map(|(name, _)| name).collect();
    let mut y: Vec<f64> =
        names.iter().map(|name| if carried.contains(&name) { 0.0 } else { value(name) }).collect();
    let velocities: Vec<f64> = legendre.velocities.iter().map(|(name, _)| value(name)).collect();
    let momenta = interpreter.legendre(0.0, &y, &velocities).unwrap();
    for (name, momentum) in carried.iter().zip(momenta) {
        y[names.iter().position(|n| n == *name).unwrap()] = momentum;
    }
    let mut dy = vec![0.0; y.len()];
    interpreter.rhs(0.0, &y, &mut dy);
    let along: Vec<Dual> = y.iter().zip(&dy).map(|(y, dy)| Dual::new(*y, *dy)).collect();
    let params: Vec<Dual> = params.iter().map(|p| Dual::constant(*p)).collect();
    let executable = scene.executable();
    let outputs = executable.prepare_over(&params).unwrap().outputs(Dual::constant(0.0), &along);
    let outputs =
        scene.outputs().iter().flat_map(|o| &o.components).map(|(name, _)| name.clone()).zip(outputs);
    let outputs: Vec<(String, Dual)> = outputs.collect();
    for (name, expected) in legendre.velocities.iter().map(|(name, _)| name).zip(velocities) {
        let found =
            outputs.iter().find(|(n, _)| n == name).unwrap_or_else(|| panic!("{name}: {outputs:?}")).1;
        close(name, found.value, expected, 1.0);
    }
    move |name| {
        let own = names.iter().position(|n| n == name).map(|k| dy[k]);
        own.or_else(|| outputs.iter().find(|(n, _)| n == name).map(|(_, x)| x.derivative))
            .unwrap_or_else(|| panic!("{name} of {names:?}"))
    }
}

fn close(what: &str, found: f64, expected: f64, scale: f64) {
    // Elimination of some fifteen unknowns with pivots in two arithmetics.
    assert!((found - expected).abs() <= 1e-12 * scale, "{what}: {found} instead of {expected}");
}

const A: f64 = 0.3;
const B: f64 = 0.9;
const C: f64 = 0.7;
const D: f64 = 0.8;

/// `extra`: items of the model.
fn four_bar(extra: &str) -> String {
    format!(
        "model four_bar {{
            param a = 0.3 where a > 0; param b = 0.9 where b > 0; param c = 0.7 where c > 0; param d = 0.8;
            param g = 9.81;
            coordinate alpha in angle;
            coordinate beta, gamma in angle by
                a*[cos(alpha), sin(alpha)] + b*[cos(beta), sin(beta)] - c*[cos(gamma), sin(gamma)] = [d, 0];
            let v = a*alpha_dot*[-sin(alpha), cos(alpha)];
            let w = v + b/2*beta_dot*[-sin(beta), cos(beta)];
            lagrangian = 2*a^2*alpha_dot^2/6 + 3*dot(w, w)/2 + 3*b^2*beta_dot^2/24 + 1.5*c^2*gamma_dot^2/6
                - g*(2*a*sin(alpha)/2 + 3*(a*sin(alpha) + b*sin(beta)/2) + 1.5*c*sin(gamma)/2);
            {extra}
        }}"
    )
}

/// Angles of coupler and rocker for a crank, on the side where the rocker is above the ground.
fn closed_angles(alpha: f64) -> [f64; 2] {
    let (mut beta, mut gamma) = (0.6_f64, 1.5_f64);
    for _ in 0..50 {
        let f = A * alpha.cos() + B * beta.cos() - C * gamma.cos() - D;
        let h = A * alpha.sin() + B * beta.sin() - C * gamma.sin();
        let step = solve(vec![
            vec![-B * beta.sin(), C * gamma.sin(), -f],
            vec![B * beta.cos(), -C * gamma.cos(), -h],
        ]);
        beta += step[0];
        gamma += step[1];
    }
    [beta, gamma]
}

fn four_bar_in_space() -> Mechanism {
    Mechanism {
        bodies: vec![
            Body(2.0, 2.0 * A * A / 12.0),
            Body(3.0, 3.0 * B * B / 12.0),
            Body(1.5, 1.5 * C * C / 12.0),
        ],
        joints: vec![
            Joint::Pin((None, [0.0, 0.0]), (Some(0), [-A / 2.0, 0.0])),
            Joint::Pin((Some(0), [A / 2.0, 0.0]), (Some(1), [-B / 2.0, 0.0])),
            Joint::Pin((Some(1), [B / 2.0, 0.0]), (Some(2), [C / 2.0, 0.0])),
            Joint::Pin((None, [D, 0.0]), (Some(2), [-C / 2.0, 0.0])),
        ],
        gravity: 9.81,
    }
}

#[test]
fn a_four_bar_linkage_moves_as_its_bodies_do() {
    let scene = built(&four_bar(""));
    assert_eq!(scene.state_names(), ["alpha", "beta", "gamma", "alpha_dot"]);
    let multipliers = built(&four_bar("multipliers;"));
    let momenta = built(&four_bar("momentum P of alpha_dot; carry P;"));
    assert_eq!(momenta.state_names(), ["alpha", "beta", "gamma", "P"]);
    for alpha in [0.2, 1.0, 2.5, 3.9, 5.5] {
        let [beta, gamma] = closed_angles(alpha);
        let alpha_dot = 1.7;
        let rate =
            rates(&scene, &[("alpha", alpha), ("beta", beta), ("gamma", gamma), ("alpha_dot", alpha_dot)]);
        let (beta_dot, gamma_dot) = (rate("beta"), rate("gamma"));
        // The loop stays closed.
        let x = -A * alpha.sin() * alpha_dot - B * beta.sin() * beta_dot + C * gamma.sin() * gamma_dot;
        let y = A * alpha.cos() * alpha_dot + B * beta.cos() * beta_dot - C * gamma.cos() * gamma_dot;
        close("closing", x, 0.0, 1.0);
        close("closing", y, 0.0, 1.0);
        let expected =
            four_bar_in_space().accelerations(&[alpha, beta, gamma], &[alpha_dot, beta_dot, gamma_dot]);
        let size = expected.iter().fold(1.0_f64, |max, x| max.max(x.abs()));
        close("crank", rate("alpha_dot"), expected[2], size);
        let by_momenta = rates_by_momenta(
            &momenta,
            &[("alpha", alpha), ("beta", beta), ("gamma", gamma), ("alpha_dot", alpha_dot)],
        );
        close("coupler by its momentum", by_momenta("beta"), beta_dot, 1.0);
        close("rocker by its momentum", by_momenta("gamma"), gamma_dot, 1.0);
        close("crank by its momentum", by_momenta("alpha_dot"), expected[2], size);
        let all = [
            ("alpha", alpha),
            ("beta", beta),
            ("gamma", gamma),
            ("alpha_dot", alpha_dot),
            ("beta_dot", beta_dot),
            ("gamma_dot", gamma_dot),
        ];
        let rate = rates(&multipliers, &all);
        close("crank with multipliers", rate("alpha_dot"), expected[2], size);
        close("coupler with multipliers", rate("beta_dot"), expected[5], size);
        close("rocker with multipliers", rate("gamma_dot"), expected[8], size);
    }
}

#[test]
fn a_slider_crank_moves_as_its_bodies_do() {
    let scene = built(
        "model slider_crank {
            param r = 0.3 where r > 0; param l = 0.9 where l > r;
            coordinate theta in angle;
            coordinate phi in angle by r*sin(theta) + l*sin(phi) = 0;
            coordinate x in real by x = r*cos(theta) + l*cos(phi);
            let v = r*theta_dot*[-sin(theta), cos(theta)] + l/2*phi_dot*[-sin(phi), cos(phi)];
            lagrangian = 2*r^2*theta_dot^2/6 + 3*dot(v, v)/2 + 3*l^2*phi_dot^2/24 + 4*x_dot^2/2
                - 9.81*(2*r*sin(theta)/2 + 3*(r*sin(theta) + l*sin(phi)/2));
        }",
    );
    assert_eq!(scene.state_names(), ["theta", "phi", "x", "theta_dot"]);
    let (r, l) = (A, B);
    let mechanism = Mechanism {
        bodies: vec![Body(2.0, 2.0 * r * r / 12.0), Body(3.0, 3.0 * l * l / 12.0), Body(4.0, 1.0)],
        joints: vec![
            Joint::Pin((None, [0.0, 0.0]), (Some(0), [-r / 2.0, 0.0])),
            Joint::Pin((Some(0), [r / 2.0, 0.0]), (Some(1), [-l / 2.0, 0.0])),
            Joint::Pin((Some(1), [l / 2.0, 0.0]), (Some(2), [0.0, 0.0])),
            Joint::OnAxis(2, [0.0, 0.0]),
            Joint::NoTurning(2),
        ],
        gravity: 9.81,
    };
    for theta in [0.0_f64, 0.7, 1.6, 3.2, 5.0] {
        let phi = -(r * theta.sin() / l).asin();
        let x = r * theta.cos() + l * phi.cos();
        let rate = rates(&scene, &[("theta", theta), ("phi", phi), ("x", x), ("theta_dot", -2.3)]);
        let expected = mechanism.accelerations(&[theta, phi, 0.0], &[-2.3, rate("phi"), 0.0]);
        let size = expected.iter().fold(1.0_f64, |max, x| max.max(x.abs()));
        close("crank", rate("theta_dot"), expected[2], size);
    }
}

#[test]
fn a_five_bar_linkage_moves_as_its_bodies_do() {
    let text = |extra: &str| {
        format!(
            "model five_bar {{
            param l = 0.6 where l > 0; param d = 0.5;
            coordinate a, b in angle;
            coordinate p, q in angle by
                l*[cos(a) + cos(p) - cos(b) - cos(q), sin(a) + sin(p) - sin(b) - sin(q)] = [d, 0];
            let v = l*a_dot*[-sin(a), cos(a)] + l/2*p_dot*[-sin(p), cos(p)];
            let w = l*b_dot*[-sin(b), cos(b)] + l/2*q_dot*[-sin(q), cos(q)];
            lagrangian = l^2*(a_dot^2 + b_dot^2)/6 + (dot(v, v) + dot(w, w))/2 + l^2*(p_dot^2 + q_dot^2)/24
                - 9.81*l*(3/2*sin(a) + 3/2*sin(b) + sin(p)/2 + sin(q)/2);
            {extra}
        }}"
        )
    };
    let scene = built(&text(""));
    let momenta = built(&text("momentum P of a_dot; momentum Q of b_dot; carry P, Q;"));
    let one = built(&text("momentum Q of b_dot; carry Q;"));
    assert_eq!(momenta.state_names(), ["a", "b", "p", "q", "P", "Q"]);
    assert_eq!(one.state_names(), ["a", "b", "p", "q", "a_dot", "Q"]);
    assert_eq!(scene.state_names(), ["a", "b", "p", "q", "a_dot", "b_dot"]);
    let l = 0.6;
    let bar = || Body(1.0, l * l / 12.0);
    let mechanism = Mechanism {
        bodies: vec![bar(), bar(), bar(), bar()],
        joints: vec![
            Joint::Pin((None, [0.0, 0.0]), (Some(0), [-l / 2.0, 0.0])),
            Joint::Pin((None, [0.5, 0.0]), (Some(1), [-l / 2.0, 0.0])),
            Joint::Pin((Some(0), [l / 2.0, 0.0]), (Some(2), [-l / 2.0, 0.0])),
            Joint::Pin((Some(1), [l / 2.0, 0.0]), (Some(3), [-l / 2.0, 0.0])),
            Joint::Pin((Some(2), [l / 2.0, 0.0]), (Some(3), [l / 2.0, 0.0])),
        ],
        gravity: 9.81,
    };
    for (a, b) in [(2.0_f64, 1.1_f64), (1.9, 1.3), (1.7, 0.8)] {
        // The tip above the two knees.
        let (knee, other) = ([l * a.cos(), l * a.sin()], [0.5 + l * b.cos(), l * b.sin()]);
        let half = [(other[0] - knee[0]) / 2.0, (other[1] - knee[1]) / 2.0];
        let height = (l * l - half[0] * half[0] - half[1] * half[1]).sqrt();
        let size = half[0].hypot(half[1]);
        let up = [-half[1] / size * height, half[0] / size * height];
        let p = (half[1] + up[1]).atan2(half[0] + up[0]);
        let q = (up[1] - half[1]).atan2(up[0] - half[0]);
        let state = [("a", a), ("b", b), ("p", p), ("q", q), ("a_dot", 1.1), ("b_dot", -0.4)];
        let rate = rates(&scene, &state);
        let expected = mechanism.accelerations(&[a, b, p, q], &[1.1, -0.4, rate("p"), rate("q")]);
        let size = expected.iter().fold(1.0_f64, |max, x| max.max(x.abs()));
        close("first", rate("a_dot"), expected[2], size);
        close("second", rate("b_dot"), expected[5], size);
        for (how, scene) in [("both momenta", &momenta), ("one momentum", &one)] {
            let rate = rates_by_momenta(scene, &state);
            close(how, rate("a_dot"), expected[2], size);
            close(how, rate("b_dot"), expected[5], size);
        }
    }
}

/// The equation of a constraint says nothing about what it gives: here no coordinate can be divided by everywhere, and
/// multipliers keep it.
#[test]
fn a_constraint_between_positions_is_solved_where_it_can_be() {
    let solved = built(
        "model wire {
            coordinate x, z in real;
            constraint wire: z = x^2;
            lagrangian = (x_dot^2 + z_dot^2)/2 - 9.81*z;
        }",
    );
    assert_eq!(solved.state_names(), ["x", "z", "x_dot"]);
    let rate = rates(&solved, &[("x", 0.5), ("z", 0.25), ("x_dot", 2.0)]);
    // (1 + 4 x^2) x'' + 4 x x'^2 + 2 g x = 0.
    close("wire", rate("x_dot"), -(4.0 * 0.5 * 4.0 + 2.0 * 9.81 * 0.5) / 2.0, 10.0);
    let kept = built(
        "model pendulum {
            coordinate x, z in real;
            constraint rod: x^2 + z^2 = 1;
            lagrangian = (x_dot^2 + z_dot^2)/2 - 9.81*z;
            scene default { want rhs, invariants, constraint, multipliers; }
        }",
    );
    assert_eq!(kept.state_names(), ["x", "z", "x_dot", "z_dot"]);
    // At the lowest point the rod carries the weight and turns the velocity.
    let rate = rates(&kept, &[("x", 0.0), ("z", -1.0), ("x_dot", 2.0), ("z_dot", 0.0)]);
    close("horizontal", rate("x_dot"), 0.0, 1.0);
    close("vertical", rate("z_dot"), 4.0, 1.0);
    let names = kept.invariant_names().unwrap();
    assert!(
        names.contains(&"position_rod".to_owned()) && names.contains(&"residual_rod".to_owned()),
        "{names:?}"
    );
}

#[derive(Clone, Debug)]
struct State(Vec<f64>);

impl StateVector<f64> for State {
    fn as_slice(&self) -> &[f64] {
        &self.0
    }

    fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.0
    }
}

/// A scene that wants `positions`, with at most four functions.
struct Closed<'a> {
    interpreter: Interpreter<'a>,
    layout: PositionLayout,
}

impl<'a> Closed<'a> {
    fn new(scene: &'a BuiltScene) -> Closed<'a> {
        let params: Vec<f64> =
            scene.params().iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect();
        Closed { interpreter: scene.prepare(&params).unwrap(), layout: scene.positions().unwrap().clone() }
    }
}

impl System<f64> for Closed<'_> {
    type State = State;

    fn rhs(&self, t: f64, y: &State, dy: &mut State) {
        self.interpreter.rhs(t, &y.0, &mut dy.0);
    }
}

impl Positions<f64, 4> for Closed<'_> {
    fn n_equations(&self) -> usize {
        self.layout.n_equations
    }

    fn moved(&self) -> &[usize] {
        &self.layout.moved
    }

    fn residuals(&self, t: f64, y: &State) -> [f64; 4] {
        let values = self.interpreter.positions(t, &y.0).unwrap();
        std::array::from_fn(|k| values.get(k).copied().unwrap_or(0.0))
    }

    fn residual_gradients(&self, t: f64, y: &State, gradients: &mut [State; 4]) {
        gradients.iter_mut().for_each(|row| row.0.fill(0.0));
        let rows = self.interpreter.position_gradients(t, &y.0).unwrap();
        gradients.iter_mut().zip(rows).for_each(|(gradient, row)| gradient.0 = row);
    }
}

/// The scene `closed` of a model.
fn wanting(text: &str) -> BuiltScene {
    let model = spec::parse("loop.hamel", text).unwrap_or_else(|p| panic!("{p}"));
    scene::build(&model, "closed").unwrap_or_else(|p| panic!("{p}"))
}

#[test]
fn equations_come_with_their_derivatives_and_are_solved() {
    let scene = wanting(&four_bar("scene closed { want rhs, positions; }"));
    assert_eq!(scene.executable().position_names(), ["position_beta", "position_gamma"]);
    let closed = Closed::new(&scene);
    assert_eq!(closed.layout, PositionLayout { n_equations: 2, moved: vec![1, 2] });
    let y = [0.7_f64, 0.4, 1.3, 2.0];
    let rows = closed.interpreter.position_gradients(0.0, &y).unwrap();
    let expected = [
        [-A * y[0].sin(), -B * y[1].sin(), C * y[2].sin(), 0.0],
        [A * y[0].cos(), B * y[1].cos(), -C * y[2].cos(), 0.0],
    ];
    for (row, expected) in rows.iter().flatten().zip(expected.iter().flatten()) {
        assert!((row - expected).abs() < 1e-15, "{rows:?}");
    }
    for alpha in [0.2, 1.0, 2.5, 3.9, 5.5] {
        let mut y = State(vec![alpha, 0.6, 1.5, 2.0]);
        consistent(&closed, 0.0, &mut y).unwrap();
        let [beta, gamma] = closed_angles(alpha);
        assert!((y.0[1] - beta).abs() < 1e-14 && (y.0[2] - gamma).abs() < 1e-14, "{y:?}");
        assert_eq!((y.0[0], y.0[3]), (alpha, 2.0));
        // The crank from the rocker.
        let mut back = State(vec![alpha + 0.1, beta + 0.02, gamma, 2.0]);
        consistent_by(&closed, 0.0, &mut back, &[0, 1]).unwrap();
        assert!(closed.residuals(0.0, &back).iter().all(|f| f.abs() < 1e-15), "{back:?}");
        assert_eq!(back.0[2], gamma);
    }
    // A crank that is longer than everything else together leaves 5 - 0.9 - 0.7 - 0.8 at least.
    let long = wanting(&four_bar("scene closed { fix a = 5; want rhs, positions; }"));
    let mut y = State(vec![1.0, 0.6, 1.5, 2.0]);
    let Err(Error::PositionMissed { residual, .. }) = consistent(&Closed::new(&long), 0.0, &mut y) else {
        panic!("{y:?}");
    };
    assert!(residual > 2.6 / 2.0_f64.sqrt(), "{residual}");
    assert_eq!(y.0, [1.0, 0.6, 1.5, 2.0]);
}

#[test]
fn angles_on_circles_are_moved_along_them() {
    let text = four_bar("scene closed { want rhs, positions; circle beta, gamma; }");
    let scene = wanting(&text);
    let names = scene.executable().position_names();
    assert_eq!(names, ["position_beta", "position_gamma", "beta_circle", "gamma_circle"]);
    let state = scene.state_names();
    let closed = Closed::new(&scene);
    // Off the circles these functions say so.
    let off: Vec<f64> = (1..=state.len()).map(|k| k as f64).collect();
    let values = closed.interpreter.positions(0.0, &off).unwrap();
    assert_eq!(values[2..], [2.0 * 2.0 + 3.0 * 3.0, 4.0 * 4.0 + 5.0 * 5.0], "{state:?}");
    assert_eq!(closed.layout.moved.len(), 4, "{state:?}");
    let start = |name: &String| match name.as_str() {
        "beta_c" => 0.6_f64.cos(),
        "beta_s" => 0.6_f64.sin(),
        "gamma_c" => 1.5_f64.cos(),
        "gamma_s" => 1.5_f64.sin(),
        _ => 1.0,
    };
    let mut y = State(state.iter().map(start).collect());
    consistent(&closed, 0.0, &mut y).unwrap();
    let [beta, gamma] = closed_angles(1.0);
    let moved: Vec<f64> = closed.layout.moved.iter().map(|k| y.0[*k]).collect();
    for (found, expected) in moved.iter().zip([beta.cos(), beta.sin(), gamma.cos(), gamma.sin()]) {
        assert!((found - expected).abs() < 1e-14, "{state:?}: {moved:?}");
    }
}

#[test]
fn a_slider_at_its_dead_centre_and_a_vertical_that_is_advected() {
    let scene = wanting(
        "model slider_crank {
            param r = 0.3; param l = 0.9;
            coordinate theta in angle;
            coordinate phi in angle by r*sin(theta) + l*sin(phi) = 0;
            lagrangian = theta_dot^2 + phi_dot^2;
            scene closed { want rhs, positions; }
        }",
    );
    let mut y = State(vec![0.4, std::f64::consts::FRAC_PI_2, 1.0]);
    let found = consistent(&Closed::new(&scene), 0.0, &mut y);
    let expected = 0.3 * 0.4_f64.sin() + 0.9;
    let Err(Error::PositionSingular { index: 0, residual, .. }) = found else { panic!("{found:?}") };
    assert!((residual - expected).abs() < 1e-15, "{residual}");
    // A body that keeps an angle of its joint to the vertical: the vertical keeps its length.
    let scene = wanting(
        "model hanging {
            velocity Omega in so(3);
            coordinate phi in angle;
            advected Gamma in R^3 by cross(Omega, Gamma);
            constraint contact: Gamma3 = sin(phi)/2;
            multipliers;
            lagrangian = dot(Omega, Omega) + phi_dot^2 - Gamma3;
            scene closed { want rhs, positions; }
        }",
    );
    assert_eq!(scene.executable().position_names(), ["position_contact", "Gamma_dot_Gamma"]);
    let closed = Closed::new(&scene);
    let names = scene.state_names();
    let value = |name: &String| match name.as_str() {
        "phi" => 0.3,
        "Gamma1" => 0.6,
        "Gamma3" => 0.8,
        _ => 0.0,
    };
    let mut y = State(names.iter().map(value).collect());
    let free: Vec<usize> = (0..names.len()).filter(|k| names[*k] != "phi").collect();
    consistent_by(&closed, 0.0, &mut y, &free).unwrap();
    let at = |name: &str| y.0[names.iter().position(|n| n == name).unwrap()];
    assert!((at("Gamma3") - 0.3_f64.sin() / 2.0).abs() < 1e-15 && at("phi") == 0.3, "{y:?}");
    let square = at("Gamma1").powi(2) + at("Gamma2").powi(2) + at("Gamma3").powi(2);
    assert!((square - 1.0).abs() < 1e-15, "{square}");
}

#[test]
fn a_scene_without_the_coordinates_has_no_equations_between_them() {
    let problem = |text: &str| {
        let model = spec::parse("loop.hamel", text).unwrap_or_else(|p| panic!("{p}"));
        scene::build(&model, "closed").unwrap_err().to_string()
    };
    let none = problem(
        "model free { coordinate x in real; lagrangian = x_dot^2; scene closed { want positions; } }",
    );
    assert!(none.contains("there are no equations between coordinates: the model has none"), "{none}");
    let dropped = problem(
        "model line {
            coordinate x in real; coordinate y in real by y = 2*x;
            lagrangian = x_dot^2 + y_dot^2;
            scene closed { want rhs, positions; drop x, y; }
        }",
    );
    assert!(dropped.contains("position_y depends on a coordinate that the scene leaves out"), "{dropped}");
}

#[test]
fn generated_code_has_the_equations() {
    let text = wanting(&four_bar("scene closed { want rhs, positions; }")).emit().unwrap();
    for part in ["Positions<R, 2> for Prepared<R>", "const MOVED: &'static [usize] = &[1, 2];"] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn a_model_begins_where_its_equations_are_met() {
    let crank = |initial: &str| {
        let text = format!(
            "model slider_crank {{
                param r = 0.3; param l = 0.9;
                coordinate theta in angle;
                coordinate phi in angle by r*sin(theta) + l*sin(phi) = 0;
                coordinate x in real by x = r*cos(theta) + l*cos(phi);
                momentum p of theta_dot;
                lagrangian = theta_dot^2*(1 + sin(theta)^2) + phi_dot^2;
                initial theta_dot = 3; initial x = 0; {initial}
                scene momenta {{ carry p; want rhs; }}
                scene without {{ drop x; want rhs, positions; }}
                scene long {{ fix r = 2; want rhs; }}
            }}"
        );
        spec::parse("crank.hamel", &text).unwrap_or_else(|p| panic!("{p}"))
    };
    let start = |model: &spec::Model, scene: &str| {
        let built = scene::build(model, scene).unwrap_or_else(|p| panic!("{p}"));
        scene::initial_state(model, &built).map(|y| (built.state_names(), y.expect("an initial state")))
    };
    // Each branch from its side.
    for (phi, branch) in [(0.2, 0.0), (3.0, std::f64::consts::PI)] {
        let model = crank(&format!("initial theta = 0.4; initial phi = {phi};"));
        let shift = (0.3 * 0.4_f64.sin() / 0.9).asin();
        let angle = if branch == 0.0 { -shift } else { branch + shift };
        let expected = [0.4, angle, 0.3 * 0.4_f64.cos() + 0.9 * angle.cos()];
        for scene in ["default", "momenta", "minimal", "without"] {
            let (names, y) = start(&model, scene).unwrap_or_else(|e| panic!("{scene}: {e}"));
            // A scene without the slider has the rod's equation alone.
            let n = if names.contains(&"x".to_owned()) { 3 } else { 2 };
            assert_eq!(n == 3, scene == "default" || scene == "momenta", "{names:?}");
            for (found, expected) in y.iter().zip(&expected[..n]) {
                assert!((found - expected).abs() < 1e-14, "{scene}: {names:?} {y:?}");
            }
        }
    }
    // What gives only what is left out restricts nothing, and of what cannot be told there is no state.
    let text_of = |by: &str, dropped: &str| {
        format!(
            "model line {{
                coordinate x in real; coordinate {by};
                lagrangian = x_dot^2;
                initial x = 1; initial y = 0; initial x_dot = 2;
                scene closed {{ want rhs; drop {dropped}; }}
            }}"
        )
    };
    let line = |by: &str, dropped: &str| {
        let model = spec::parse("line.hamel", &text_of(by, dropped)).unwrap_or_else(|p| panic!("{p}"));
        let built = scene::build(&model, "closed").unwrap_or_else(|p| panic!("{p}"));
        (built.is_restricted(), scene::initial_state(&model, &built).unwrap_or_else(|e| panic!("{e}")))
    };
    assert_eq!(line("y in real by y = 2*x", "y"), (false, Some(vec![1.0, 2.0])));
    assert_eq!(line("y, z in real by [y + z - x, y - 2*z] = [0, 0]", "z"), (true, None));
    // A crank that is longer than the rod, across.
    let model = crank("initial theta = 1.6; initial phi = 0.2;");
    let message = start(&model, "long").unwrap_err().to_string();
    assert!(
        message.contains("slider_crank violates") && message.contains("position_phi is 1.0"),
        "{message}"
    );
    let model = crank("initial theta = 0.4; initial phi = pi/2;");
    let message = start(&model, "without").unwrap_err().to_string();
    assert!(message.contains("position_phi") && message.contains("dead centre"), "{message}");
    // The rate of y needs z.
    let text = text_of("y, z in real by [y + z - x, y - z^3] = [0, 0]", "z");
    let model = spec::parse("line.hamel", &text).unwrap_or_else(|p| panic!("{p}"));
    let message = scene::build(&model, "closed").unwrap_err().to_string();
    assert!(message.contains("z cannot be left out of scene closed: y depends on it"), "{message}");
}

fn output_names(scene: &BuiltScene) -> Vec<String> {
    scene.outputs().iter().flat_map(|o| &o.components).map(|(name, _)| name.clone()).collect()
}

#[test]
fn equations_that_constraints_on_velocities_imply_are_kept_without_rows() {
    // A pendulum, whose rod is said by velocities and by places.
    let text = |items: &str| {
        format!(
            "model pendulum {{
                coordinate x, z in real;
                lagrangian = (x_dot^2 + z_dot^2)/2 - 9.81*z;
                {items}
                initial x = 0.6; initial z = -0.7; initial x_dot = 0.5;
                scene held {{ want rhs, positions, constraint, multipliers; }}
            }}"
        )
    };
    let both = "constraint slide for z_dot: x*x_dot + z*z_dot = 0; constraint rod: x^2 + z^2 = 1;";
    let model = spec::parse("pendulum.hamel", &text(both)).unwrap_or_else(|p| panic!("{p}"));
    let scene = scene::build(&model, "held").unwrap_or_else(|p| panic!("{p}"));
    assert_eq!(scene.state_names(), ["x", "z", "x_dot"]);
    let executable = scene.executable();
    let interpreter = executable.prepare(&[]).unwrap();
    let y = scene::initial_state(&model, &scene).unwrap().unwrap();
    assert!((y[0].hypot(y[1]) - 1.0).abs() < 1e-15, "{y:?}");
    let mut dy = vec![0.0; 3];
    interpreter.rhs(0.0, &y, &mut dy);
    // x = sin phi, z = -cos phi.
    let phi = y[0].atan2(-y[1]);
    let rate = y[2] / phi.cos();
    let acceleration = -9.81 * phi.sin();
    let expected = [y[2], phi.sin() * rate, phi.cos() * acceleration - phi.sin() * rate * rate];
    for (found, expected) in dy.iter().zip(expected) {
        assert!((found - expected).abs() < 1e-13, "{dy:?} {expected}");
    }
    let observed = interpreter.outputs(0.0, &y);
    let names = output_names(&scene);
    let at =
        |name: &str| observed[names.iter().position(|n| n == name).unwrap_or_else(|| panic!("{names:?}"))];
    // E = lambda (x, z): the rod pulls with rate^2 + 9.81 cos phi towards the origin.
    assert!((at("lambda_slide") + rate * rate + 9.81 * phi.cos()).abs() < 1e-13);
    assert!(at("position_rod").abs() < 1e-15 && !names.iter().any(|name| name.contains("lambda_rod")));
    // Without the velocity that it gives, the row has a multiplier, and so has the rod without it.
    for items in [
        "constraint slide: x*x_dot + z*z_dot = 0; constraint rod: x^2 + z^2 = 1;",
        "constraint rod: x^2 + z^2 = 1;",
    ] {
        let model = spec::parse("pendulum.hamel", &text(items)).unwrap_or_else(|p| panic!("{p}"));
        let scene = scene::build(&model, "held").unwrap_or_else(|p| panic!("{p}"));
        assert_eq!(scene.state_names(), ["x", "z", "x_dot", "z_dot"]);
        let names = output_names(&scene);
        assert_eq!(names.iter().filter(|name| name.starts_with("lambda_")).count(), 1, "{names:?}");
    }
    // What does not follow restricts velocities beside the others.
    let other = "constraint slide for z_dot: x*x_dot + 2*z*z_dot = 0; constraint rod: x^2 + z^2 = 1;";
    let model = spec::parse("pendulum.hamel", &text(other)).unwrap_or_else(|p| panic!("{p}"));
    let scene = scene::build(&model, "held").unwrap_or_else(|p| panic!("{p}"));
    assert!(output_names(&scene).contains(&"lambda_rod".to_owned()));
}

#[test]
fn rows_one_after_the_other_are_the_same_motion() {
    // Three velocities of a body on a moving base, each row with the others in it.
    let text = |names: [&str; 3]| {
        format!(
            "model chained {{
                param a = 0.7; param b = 1.3 where b > 0;
                velocity v in R^5;
                coordinate q in real;
                lagrangian = dot(v, diag([1, 2, 3, 4, 5])*v)/2 + q_dot^2/2 + a*q_dot*v3 - b*q^2;
                constraint first{}: (2 + q^2)*v3 + sin(q)*v4 + v1 + v5 = 0;
                constraint second{}: cos(q)*v3 + (3 + q^2)*v4 - q*v2 + a*q_dot = 0;
                constraint third{}: v5 = q*v3 - v4 + 0.3;
                independent v1, v2, q_dot;
                initial q = 0.3; initial q_dot = 0.4; initial v1 = 1.1; initial v2 = -0.6;
                scene held {{ want rhs, energy, multipliers; }}
            }}",
            names[0], names[1], names[2]
        )
    };
    let values = |names: [&str; 3]| {
        let model = spec::parse("chained.hamel", &text(names)).unwrap_or_else(|p| panic!("{p}"));
        let scene = scene::build(&model, "held").unwrap_or_else(|p| panic!("{p}"));
        let executable = scene.executable();
        let params: Vec<f64> = scene.params().iter().map(|p| if p.name == "a" { 0.7 } else { 1.3 }).collect();
        let interpreter = executable.prepare(&params).unwrap();
        let y = scene::initial_state(&model, &scene).unwrap().unwrap();
        let mut dy = vec![0.0; y.len()];
        interpreter.rhs(0.2, &y, &mut dy);
        dy.extend(interpreter.outputs(0.2, &y));
        dy
    };
    let together = values(["", "", ""]);
    for names in [
        [" for v3", " for v4", " for v5"],
        [" for v3", " for v4", ""],
        [" for v4", " for v3", " for v5"],
        [" for v5", " for v4", " for v3"],
    ] {
        let chained = values(names);
        assert_eq!(chained.len(), together.len());
        for (found, expected) in chained.iter().zip(&together) {
            assert!(
                (found - expected).abs() < 1e-12 * expected.abs().max(1.0),
                "{names:?}: {chained:?} {together:?}"
            );
        }
    }
}
