//! Logarithms of rotations, against quaternions, series of matrices and what an attitude spring has to do.

use hamel_codegen::scene::{self, BuiltScene, Derivative, Interpreter};
use hamel_codegen::spec;
use hamel_runtime::{Dop853, Integrator, Options, System};

fn model(items: &str) -> spec::Model {
    let text = format!("model m {{ {items} }}");
    spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"))
}

fn build(items: &str) -> BuiltScene {
    scene::build(&model(items), "a").unwrap_or_else(|e| panic!("{e}"))
}

fn problems(items: &str) -> String {
    match spec::parse("m.hamel", &format!("model m {{ {items} }}")) {
        Ok(_) => panic!("accepted: {items}"),
        Err(e) => e.to_string(),
    }
}

/// The rotation of a unit quaternion, by rows.
fn rotation([w, x, y, z]: [f64; 4]) -> [f64; 9] {
    [
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ]
}

/// The quaternion of a rotation vector.
fn quaternion(v: [f64; 3]) -> [f64; 4] {
    let angle = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let factor = if angle == 0.0 { 0.5 } else { (angle / 2.0).sin() / angle };
    [(angle / 2.0).cos(), factor * v[0], factor * v[1], factor * v[2]]
}

/// A body on a spring `k |log R|^2/2`.
const SPRING: &str = "param I: diagonal(3) = [1, 2, 3]; param k = 2;
    configuration R in SO(3) velocity Omega; let v = log(R);
    lagrangian = dot(Omega, I*Omega)/2 - k*dot(v, v)/2;
    output vector = v; output rate = rate(v);
    scene a { want energy, outputs, jacobian, jvp, taylor; }";

/// Rotation vectors from next to the identity to next to half a turn.
const VECTORS: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [1e-9, -2e-9, 0.5e-9],
    [1e-4, 0.0, 2e-4],
    [0.3, -0.1, 0.2],
    [-1.1, 0.7, 0.4],
    [1.4, 1.0, -1.2],
    [0.0, 3.0, 0.0],
    [1.8, -1.8, 1.8],
];

const OMEGA: [f64; 3] = [0.4, -0.9, 0.6];

/// The state of the scene in the order of its names.
fn state(built: &BuiltScene, v: [f64; 3], omega: [f64; 3]) -> Vec<f64> {
    let matrix = rotation(quaternion(v));
    let value = |name: &str| -> f64 {
        let digits: Vec<usize> =
            name.chars().filter_map(|c| c.to_digit(10)).map(|digit| digit as usize - 1).collect();
        match (name.starts_with('R'), digits.as_slice()) {
            (true, [i, j]) => matrix[3 * i + j],
            (false, [k]) => omega[*k],
            _ => panic!("{name}"),
        }
    };
    built.state_names().iter().map(|name| value(name)).collect()
}

fn at(built: &BuiltScene, name: &str) -> usize {
    let known = built.state_names();
    known.iter().position(|own| own == name).unwrap_or_else(|| panic!("{name}: {known:?}"))
}

/// The logarithm is the vector of the quaternion, and the spring pulls back along it: `I Omega' = I Omega x Omega - k
/// v`, as the rate of `|v|^2/2` is `v . Omega`.
#[test]
fn a_spring_pulls_along_the_rotation_vector() {
    let built = build(SPRING);
    assert!(built.equations().facts.energy_is_conserved);
    let prepared = built.prepare(&[1.0, 2.0, 3.0, 2.0]).unwrap();
    for v in VECTORS {
        let y = state(&built, v, OMEGA);
        let out = prepared.outputs(0.0, &y);
        // The trace is at its least by half a turn: its rounding moves the angle in inverse proportion to the distance.
        let angle = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let distance = (std::f64::consts::PI - angle).min(1.0);
        let tolerance = 4e-15 / distance.powi(2);
        for k in 0..3 {
            assert!((out[k] - v[k]).abs() <= tolerance * angle.max(1e-3), "{v:?}: {out:?}");
        }
        let mut dy = vec![0.0; y.len()];
        prepared.rhs(0.0, &y, &mut dy);
        let inertia = [1.0, 2.0, 3.0];
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let expected = ((inertia[i] - inertia[j]) * OMEGA[i] * OMEGA[j] - 2.0 * v[k]) / inertia[k];
            let found = dy[at(&built, &format!("Omega{}", k + 1))];
            // The slope of `|v|^2` is a difference of terms that are larger by the square of the distance.
            let allowed = 10.0 * tolerance * angle.max(1.0) / distance.powi(2);
            assert!((found - expected).abs() < allowed, "{v:?}: {found} {expected}");
        }
        // Its rate, by quaternions a moment before and after.
        let h = 1e-5;
        let moved = |sign: f64| {
            let [a, b, c] = OMEGA.map(|w| sign * h * w);
            let (p, q) = (quaternion(v), quaternion([a, b, c]));
            let turned = [
                p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
                p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
                p[0] * q[2] + p[2] * q[0] + p[3] * q[1] - p[1] * q[3],
                p[0] * q[3] + p[3] * q[0] + p[1] * q[2] - p[2] * q[1],
            ];
            let sine = turned[1..].iter().map(|x| x * x).sum::<f64>().sqrt();
            let factor = if sine == 0.0 { 2.0 } else { 2.0 * sine.atan2(turned[0]) / sine };
            [1, 2, 3].map(|k| factor * turned[k])
        };
        let (ahead, behind) = (moved(1.0), moved(-1.0));
        for k in 0..3 {
            let expected = (ahead[k] - behind[k]) / (2.0 * h);
            assert!((out[3 + k] - expected).abs() < 2e-8, "{v:?}: {out:?} {expected}");
        }
    }
}

struct Interpreted<'a>(Interpreter<'a>);

impl System<f64> for Interpreted<'_> {
    type State = [f64; 12];

    fn rhs(&self, t: f64, y: &[f64; 12], dy: &mut [f64; 12]) {
        self.0.rhs(t, y, dy);
    }
}

/// Jacobian and series are those of the motion, at the identity too.
#[test]
fn derivatives_and_series_pass_the_identity() {
    let built = build(SPRING);
    let parameters = [1.0, 2.0, 3.0, 2.0];
    let prepared = built.prepare(&parameters).unwrap();
    for v in [[0.0; 3], [1e-7, 0.0, -1e-7], [0.5, -0.8, 0.3], [1.4, 1.0, -1.2]] {
        let y = state(&built, v, OMEGA);
        let jacobian = prepared.matrix(Derivative::Jacobian, 0.0, &y).unwrap();
        let h = 1e-6;
        for column in 0..y.len() {
            let rates = |sign: f64| {
                let (mut y, mut dy) = (y.clone(), vec![0.0; y.len()]);
                y[column] += sign * h;
                prepared.rhs(0.0, &y, &mut dy);
                dy
            };
            let (ahead, behind) = (rates(1.0), rates(-1.0));
            for row in 0..y.len() {
                let slope = (ahead[row] - behind[row]) / (2.0 * h);
                assert!((jacobian[row][column] - slope).abs() < 1e-7, "{v:?} [{row}][{column}]: {slope}");
            }
        }
        let mut rows = vec![vec![0.0; 12]; 25];
        let mut out: Vec<&mut [f64]> = rows.iter_mut().map(Vec::as_mut_slice).collect();
        built.prepare(&parameters).unwrap().series(&built.jet().unwrap(), 0.0, &y, &mut out);
        let h = 0.1;
        let system = Interpreted(built.prepare(&parameters).unwrap());
        let start: [f64; 12] = y.clone().try_into().unwrap();
        let mut integrator =
            Integrator::new(&system, Dop853, 0.0, start, Options::adaptive(1e-13, 1e-13)).unwrap();
        integrator.integrate_to(h).unwrap();
        for k in 0..12 {
            let by_series = rows.iter().rev().fold(0.0, |sum, row| sum * h + row[k]);
            let by_steps = integrator.state()[k];
            assert!((by_series - by_steps).abs() < 1e-11, "{v:?} [{k}]: {by_series} {by_steps}");
        }
    }
}

/// Geometric control `-k log(R_d^T R) - d Omega`, with an attitude of numbers, where the body comes to rest, with one
/// that moves, behind which it stays, and with one that an input turns.
#[test]
fn attitudes_are_controlled() {
    let wanted = "let error = log(transpose(Rd)*R);
        lagrangian = dot(Omega, I*Omega)/2; force Omega = -4*error - 4*Omega; output error = error;";
    let body = "param I: diagonal(3) = [1, 2, 3]; configuration R in SO(3) velocity Omega;";
    let numbers = "let Rd = orthonormal([[0.36, 0.48, -0.8], [-0.8, 0.6, 0], [0.48, 0.64, 0.6]]);";
    let turned = "let Rd = rot(e3, t)*rot(e1, 0.3);";
    for (attitude, at_rest) in [(numbers, true), (turned, false)] {
        let built = build(&format!("{body} {attitude} {wanted} scene a {{ want outputs; }}"));
        let system = Interpreted(built.prepare(&[1.0, 2.0, 3.0]).unwrap());
        let start: [f64; 12] = state(&built, [0.4, -0.6, 0.2], OMEGA).try_into().unwrap();
        let mut integrator =
            Integrator::new(&system, Dop853, 0.0, start, Options::adaptive(1e-10, 1e-10)).unwrap();
        integrator.integrate_to(40.0).unwrap();
        let error = system.0.outputs(40.0, integrator.state());
        let size = error.iter().map(|x| x * x).sum::<f64>().sqrt();
        assert!(if at_rest { size < 1e-8 } else { size > 0.1 && size < 2.0 }, "{attitude}: {error:?}");
    }
    let built = build(&format!(
        "{body} input u = 0.5; let Rd = rot(e3, u); {wanted} scene a {{ input u; want outputs; }}"
    ));
    let y = state(&built, [0.0, 0.0, 0.2], [0.0; 3]);
    let mut dy = vec![0.0; y.len()];
    built.prepare(&[1.0, 2.0, 3.0]).unwrap().rhs_with(0.0, &y, &[0.7], &mut dy);
    let pulled = dy[at(&built, "Omega3")];
    assert!((pulled - 4.0 * 0.5 / 3.0).abs() < 1e-14, "{pulled}");
}

/// `exp` of a matrix with 4 or 3 rows by its series.
fn exponential<const N: usize>(a: [[f64; N]; N]) -> [[f64; N]; N] {
    let times = |x: &[[f64; N]; N], y: &[[f64; N]; N]| -> [[f64; N]; N] {
        std::array::from_fn(|i| std::array::from_fn(|j| (0..N).map(|k| x[i][k] * y[k][j]).sum()))
    };
    let mut sum: [[f64; N]; N] = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(i == j)));
    let mut term = sum;
    for n in 1..60 {
        term = times(&term, &a).map(|row| row.map(|x| x / f64::from(n)));
        for (sum, term) in sum.iter_mut().flatten().zip(term.iter().flatten()) {
            *sum += term;
        }
    }
    sum
}

/// Twists of displacements, of space and of the plane: the exponential gives the displacement back.
#[test]
fn twists_are_logarithms_of_displacements() {
    let built = build(
        "configuration R, r in SE(3) velocity Omega, V; lagrangian = dot(Omega, Omega)/2 + dot(V, V)/2;
         output twist = log(R, r); scene a { want outputs; }",
    );
    let prepared = built.prepare(&[]).unwrap();
    let place = [0.7, -0.4, 1.3];
    for v in VECTORS {
        let matrix = rotation(quaternion(v));
        let value = |name: &String| match name.as_bytes() {
            [b'R', i, j] => matrix[3 * usize::from(i - b'1') + usize::from(j - b'1')],
            [b'r', k] => place[usize::from(k - b'1')],
            _ => 0.0,
        };
        let y: Vec<f64> = built.state_names().iter().map(value).collect();
        let twist = prepared.outputs(0.0, &y);
        let [a, b, c] = [twist[0], twist[1], twist[2]];
        let hat = [[0.0, -c, b, twist[3]], [c, 0.0, -a, twist[4]], [-b, a, 0.0, twist[5]], [0.0; 4]];
        let found = exponential(hat);
        let distance = std::f64::consts::PI - v.iter().map(|x| x * x).sum::<f64>().sqrt();
        let allowed = 1e-13 / distance.min(1.0).powi(3);
        for i in 0..3 {
            assert!((found[i][3] - place[i]).abs() < allowed, "{v:?}: {found:?}");
            assert!((0..3).all(|j| (found[i][j] - matrix[3 * i + j]).abs() < allowed), "{v:?}: {found:?}");
        }
    }
    let built = build(
        "coordinate theta, x, y in real; lagrangian = (theta_dot^2 + x_dot^2 + y_dot^2)/2;
         output angle = log(rot(theta)); output twist = log(rot(theta), [x, y]); scene a { want outputs; }",
    );
    let prepared = built.prepare(&[]).unwrap();
    for theta in [0.0, 1e-8, -0.7, 2.9] {
        let out = prepared.outputs(0.0, &[theta, 0.4, -1.1, 0.0, 0.0, 0.0]);
        let found = exponential([[0.0, -out[1], out[2]], [out[1], 0.0, out[3]], [0.0; 3]]);
        assert!((out[0] - theta).abs() < 1e-15 && (found[0][0] - theta.cos()).abs() < 1e-14, "{out:?}");
        assert!((found[0][2] - 0.4).abs() < 1e-13 && (found[1][2] + 1.1).abs() < 1e-13, "{out:?}: {found:?}");
    }
}

/// The half turn is the end of the domain, and is told.
#[test]
fn half_a_turn_is_outside() {
    let built = build(SPRING);
    let prepared = built.prepare(&[1.0, 2.0, 3.0, 2.0]).unwrap();
    let inside = state(&built, [0.3, 0.2, 0.1], OMEGA);
    assert!(prepared.domain(0.0, &inside).is_ok());
    let mut y = inside;
    for (k, entry) in [1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, -1.0].into_iter().enumerate() {
        y[at(&built, &format!("R{}{}", k / 3 + 1, k % 3 + 1))] = entry;
    }
    let told = prepared.domain(0.0, &y).unwrap_err().to_string();
    assert!(told.contains("< 1"), "{told}");
    let told = problems("coordinate x in real; let v = log(rot(e1, pi)); lagrangian = x_dot^2 + v[1];");
    assert!(told.contains("a rotation by half a turn has no logarithm"), "{told}");
}

#[test]
fn what_is_no_rotation_has_no_logarithm() {
    for (items, message) in [
        ("let v = log(diag([1, 1, -1]));", "the matrix is no rotation"),
        ("let v = log([[1, 2, 0], [0, 1, 0], [0, 0, 1]]);", "the matrix is no rotation"),
        ("let v = log(x);", "`log` takes a rotation, found a number"),
        ("let v = log([x, 1, 2]);", "`log` takes a rotation, found vector(3)"),
        ("let v = log(rot(e1, x), [1, 2]);", "the place is vector(3), found vector(2)"),
        ("let v = log(rot(x), 3);", "the place is vector(2), found a number"),
        ("let v = log();", "`log` takes 1 or 2 arguments, found 0"),
    ] {
        let told = problems(&format!("coordinate x in real; {items} lagrangian = x_dot^2;"));
        assert!(told.contains(message), "{items}: {told}");
    }
    let built = build("param log = 2; coordinate x in real; lagrangian = log*x_dot^2; scene a {}");
    assert_eq!(built.state_names().len(), 2);
}
