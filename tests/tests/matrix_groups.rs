//! Groups of matrices that are reconstructed: against exponentials, quaternions and each other, and kept in the group.

use hamel_codegen::scene::{self, BuiltScene, Interpreter};
use hamel_codegen::spec;
use hamel_runtime::{Integrator, Invariants, Method, Options, Projected, System, Vern9};
use hamel_tests::models::{State, follow, times};

fn built(items: &str, name: &str) -> BuiltScene {
    let model =
        spec::parse("test.hamel", &format!("model m {{ {items} }}")).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, name).unwrap_or_else(|e| panic!("{e}\n{items}"))
}

/// A square matrix of complex numbers.
type Square = Vec<Vec<(f64, f64)>>;

fn product(a: &Square, b: &Square) -> Square {
    let n = a.len();
    let entry = |i: usize, j: usize| {
        (0..n).fold((0.0, 0.0), |sum, k| {
            let ((x, y), (u, v)) = (a[i][k], b[k][j]);
            (sum.0 + x * u - y * v, sum.1 + x * v + y * u)
        })
    };
    (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
}

fn identity(n: usize) -> Square {
    (0..n).map(|i| (0..n).map(|j| (if i == j { 1.0 } else { 0.0 }, 0.0)).collect()).collect()
}

fn sum(a: &Square, b: &Square, scale: f64) -> Square {
    let entry = |((a, b), (c, d)): (&(f64, f64), &(f64, f64))| (a + scale * c, b + scale * d);
    a.iter().zip(b).map(|(x, y)| x.iter().zip(y).map(entry).collect()).collect()
}

/// The conjugate of the transpose.
fn adjoint(a: &Square) -> Square {
    let n = a.len();
    (0..n).map(|i| (0..n).map(|j| (a[j][i].0, -a[j][i].1)).collect()).collect()
}

fn distance(a: &Square, b: &Square) -> f64 {
    let all = a.iter().flatten().zip(b.iter().flatten());
    all.map(|((a, b), (c, d))| (a - c).abs().max((b - d).abs())).fold(0.0, f64::max)
}

fn exponential(a: &Square) -> Square {
    let mut term = identity(a.len());
    let mut value = term.clone();
    for k in 1..40 {
        term = product(&term, a);
        term.iter_mut().flatten().for_each(|x| *x = (x.0 / f64::from(k), x.1 / f64::from(k)));
        value = sum(&value, &term, 1.0);
    }
    value
}

/// A matrix of the algebra by coordinates in the documented basis.
fn algebra_element(family: &str, n: usize, xi: &[f64]) -> Square {
    let mut m = vec![vec![(0.0, 0.0); n]; n];
    let mut next = xi.iter().copied();
    let mut take = || next.next().expect("a coordinate");
    match family {
        "so" if n == 3 => {
            let [a, b, c] = [take(), take(), take()];
            for (i, j, x) in [(2, 1, a), (0, 2, b), (1, 0, c)] {
                (m[i][j].0, m[j][i].0) = (x, -x);
            }
        }
        "so" => {
            for i in 0..n {
                for j in i + 1..n {
                    let x = take();
                    (m[i][j].0, m[j][i].0) = (x, -x);
                }
            }
        }
        "gl" => m.iter_mut().flatten().for_each(|e| e.0 = take()),
        "sl" => {
            for i in 0..n {
                for j in (0..n).filter(|j| *j != i) {
                    m[i][j].0 = take();
                }
            }
            for k in 0..n - 1 {
                let x = take();
                m[k][k].0 += x;
                m[k + 1][k + 1].0 -= x;
            }
        }
        "sp" => {
            let half = n / 2;
            for i in 0..half {
                for j in 0..half {
                    let x = take();
                    m[i][j].0 = x;
                    m[half + j][half + i].0 = -x;
                }
            }
            for (rows, columns) in [(0, half), (half, 0)] {
                for i in 0..half {
                    for j in i..half {
                        let x = take();
                        m[rows + i][columns + j].0 = x;
                        m[rows + j][columns + i].0 = x;
                    }
                }
            }
        }
        "su" | "u" => {
            for j in 0..n {
                for k in j + 1..n {
                    let (a, b) = (take(), take());
                    (m[j][k], m[k][j]) = ((a, b), (-a, b));
                }
            }
            let n_diagonal = if family == "su" { n - 1 } else { n };
            for k in 0..n_diagonal {
                let x = take();
                m[k][k].1 += x;
                if family == "su" {
                    m[k + 1][k + 1].1 -= x;
                }
            }
        }
        _ => panic!("{family}"),
    }
    m
}

const GROUPS: [(&str, &str, usize, usize); 10] = [
    ("so", "SO", 4, 6),
    ("so", "SO", 5, 10),
    ("so", "matrices(SO", 3, 3),
    ("su", "SU", 2, 3),
    ("su", "SU", 3, 8),
    ("u", "U", 2, 4),
    ("gl", "GL", 2, 4),
    ("gl", "GL", 3, 9),
    ("sl", "SL", 2, 3),
    ("sp", "Sp", 4, 10),
];

fn is_complex(family: &str) -> bool {
    matches!(family, "su" | "u")
}

/// Distinct moderate numbers.
fn coordinates(n: usize) -> Vec<f64> {
    (0..n).map(|k| 0.4 - 0.11 * k as f64 + 0.7 * ((k * k) % 5) as f64 / 5.0).collect()
}

/// Names and values of the entries of a matrix called `R`.
fn entries(family: &str, m: &Square) -> Vec<(String, f64)> {
    let n = m.len();
    let all = move |part: &'static str, of: fn(&(f64, f64)) -> f64| {
        let at = (0..n * n).map(move |k| (k / n, k % n));
        at.map(move |(i, j)| (format!("R{part}{}{}", i + 1, j + 1), of(&m[i][j]))).collect::<Vec<_>>()
    };
    match is_complex(family) {
        true => [all("_re", |x| x.0), all("_im", |x| x.1)].concat(),
        false => all("", |x| x.0),
    }
}

fn matrix_of(family: &str, n: usize, get: &dyn Fn(&str) -> f64) -> Square {
    let entry = |i: usize, j: usize| match is_complex(family) {
        true => [("_re", i, j), ("_im", i, j)]
            .map(|(part, i, j)| get(&format!("R{part}{}{}", i + 1, j + 1)))
            .into(),
        false => (get(&format!("R{}{}", i + 1, j + 1)), 0.0),
    };
    (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
}

/// A motion with a given velocity in the algebra, from a matrix, followed to a time.
fn moved(
    group: (&str, &str, usize, usize),
    side: &str,
    velocity: &[String],
    start: &Square,
    end: f64,
) -> Square {
    let (family, name, n, dim) = group;
    let close = if name.contains('(') { "))" } else { ")" };
    let fields = (1..=dim).map(|k| format!("field w{k} = {};", velocity[k - 1]));
    let items = format!(
        "coordinate s in real; field s_dot = 1; velocity w in {family}({n}); action {side}; {}
         reconstruct R in {name}({n}{close}; scene path {{ want rhs, reconstruction; }}",
        fields.collect::<Vec<_>>().concat()
    );
    let scene = built(&items, "path");
    let named = entries(family, start);
    let mut initial: Vec<(&str, f64)> = named.iter().map(|(name, x)| (name.as_str(), *x)).collect();
    initial.push(("s", 0.0));
    let mut last = identity(n);
    follow(&scene, &[], &initial, &[end], |at| last = matrix_of(family, n, &|name| at.get(name)));
    last
}

#[test]
fn with_a_constant_velocity_the_motion_is_an_exponential() {
    for group in GROUPS {
        let (family, _, n, dim) = group;
        let xi = coordinates(dim);
        let text: Vec<String> = xi.iter().map(|x| format!("{x:.6}")).collect();
        let xi: Vec<f64> = text.iter().map(|x| x.parse().expect("a number")).collect();
        let hat = algebra_element(family, n, &xi);
        let end = 0.8;
        let mut scaled = hat.clone();
        scaled.iter_mut().flatten().for_each(|x| *x = (x.0 * end, x.1 * end));
        let turned = exponential(&scaled);
        // A start that does not commute with the velocity.
        let reversed: Vec<f64> = xi.iter().rev().map(|x| x / 2.0).collect();
        let start = exponential(&algebra_element(family, n, &reversed));
        for (side, expected) in [("left", product(&start, &turned)), ("right", product(&turned, &start))] {
            let found = moved(group, side, &text, &start, end);
            assert!(distance(&found, &expected) < 1e-11, "{group:?}, {side}");
            assert!(distance(&found, &start) > 0.1, "it moves");
        }
    }
}

#[test]
fn a_right_motion_is_the_inverse_of_the_left_one_with_the_opposite_velocity() {
    for group in GROUPS {
        let (_, _, n, dim) = group;
        let velocity = |sign: &str| -> Vec<String> {
            (0..dim).map(|k| format!("{sign}(sin(s + {k})/2 + {k}*cos(2*s)/8)")).collect()
        };
        let start = identity(n);
        let left = moved(group, "left", &velocity(""), &start, 1.5);
        let right = moved(group, "right", &velocity("-"), &start, 1.5);
        assert!(distance(&product(&left, &right), &start) < 1e-11, "{group:?}");
        let same = moved(group, "right", &velocity(""), &start, 1.5);
        assert!(distance(&left, &same) > 1e-3, "{group:?}: the sides differ");
    }
}

/// A top, or a rigid body with two more vectors.
const BODY: &str = "velocity Omega, V in se(3);
    lagrangian = dot(Omega, diag([1, 2, 3])*Omega)/2 + dot(V, diag([2, 1, 4])*V)/2 + Omega1*V2/3;";

#[test]
fn matrices_turn_as_quaternions_do_and_carry_places_along() {
    for side in ["left", "right"] {
        let scene = built(
            &format!(
                "{BODY} action {side}; reconstruct q, r in SE(3); reconstruct R, x in semidirect(SO(3), standard);
                 scene path {{ want rhs, reconstruction; }}"
            ),
            "path",
        );
        let mut initial: Vec<(String, f64)> =
            scene.state_names().into_iter().map(|name| (name, 0.0)).collect();
        for (name, value) in &mut initial {
            *value = match name.as_str() {
                "Omega1" => 0.8,
                "Omega2" => -0.5,
                "Omega3" => 1.1,
                "V1" | "V3" => 0.6,
                "qw" | "R11" | "R22" | "R33" => 1.0,
                _ => 0.0,
            };
        }
        let initial: Vec<(&str, f64)> = initial.iter().map(|(name, x)| (name.as_str(), *x)).collect();
        let mut worst = 0.0_f64;
        follow(&scene, &[], &initial, &times(6.0, 12), |at| {
            let q = at.quaternion();
            for (j, axis) in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].into_iter().enumerate() {
                let turned = hamel_tests::models::rotated(q, axis);
                for (i, x) in turned.into_iter().enumerate() {
                    worst = worst.max((x - at.get(&format!("R{}{}", i + 1, j + 1))).abs());
                }
            }
            for (a, b) in at.vector("r").into_iter().zip(at.vector("x")) {
                worst = worst.max((a - b).abs());
            }
        });
        assert!(worst < 1e-11, "{side}: {worst:e}");
    }
}

/// A scene by the interpreter, with invariants that are always met after its own.
struct Kept<'a>(Interpreter<'a>);

impl System<f64> for Kept<'_> {
    type State = State;
    fn rhs(&self, t: f64, y: &State, dy: &mut State) {
        self.0.rhs(t, &y.0, &mut dy.0);
    }
}

impl<const K: usize> Invariants<f64, K> for Kept<'_> {
    fn values(&self, t: f64, y: &State) -> [f64; K] {
        let own = self.0.invariants(t, &y.0).expect("invariants");
        std::array::from_fn(|k| own.get(k).copied().unwrap_or_default())
    }
    fn gradients(&self, t: f64, y: &State, gradients: &mut [State; K]) {
        let rows = self.0.invariant_gradients(t, &y.0).expect("gradients");
        assert!(rows.len() <= K, "{} invariants", rows.len());
        gradients.iter_mut().for_each(|row| row.0.fill(0.0));
        gradients.iter_mut().zip(rows).for_each(|(to, row)| to.0 = row);
    }
}

const BODY_4: &str = "param J: diagonal(4) = [1, 2, 3, 4] where J1 > 0, J2 > 0, J3 > 0, J4 > 0;
    velocity w in so(4);
    let W = [[0, w1, w2, w3], [-w1, 0, w4, w5], [-w2, -w4, 0, w6], [-w3, -w5, -w6, 0]];
    lagrangian = -trace(W*J*W)/2; reconstruct R in SO(4); scene path { want rhs, energy, reconstruction, invariants; }";

const TOP_SU_3: &str = "velocity x in su(3);
    lagrangian = dot(x, diag([1, 2, 3, 1.5, 2.5, 1.2, 1.7, 0.9])*x)/2 + x7*x8/5;
    reconstruct R in SU(3); scene path { want rhs, energy, reconstruction, invariants; }";

/// The largest distances from the group over some steps: of `R R^*` from one, and of the determinant for `n = 3`.
fn strays<M>(scene: &BuiltScene, family: &str, n: usize, method: M, n_steps: u32) -> f64
where
    M: for<'a> Method<f64, Kept<'a>>,
{
    let params = hamel_tests::models::params(scene, &[]);
    let system = Kept(scene.prepare(&params).expect("valid parameters"));
    let names = scene.state_names();
    let n_entries = entries(family, &identity(n)).len();
    let n_velocities = names.len() - n_entries;
    let mut start = coordinates(n_velocities);
    start.extend(entries(family, &identity(n)).into_iter().map(|(_, x)| x));
    let mut solver =
        Integrator::new(&system, method, 0.0, State(start), Options::fixed(0.1)).expect("a start");
    let mut worst = 0.0_f64;
    for _ in 0..n_steps {
        let _ = solver.step_towards(1e9).expect("a step");
        let y = &solver.state().0;
        let get = |name: &str| y[names.iter().position(|own| own == name).expect("an entry")];
        let r = matrix_of(family, n, &get);
        worst = worst.max(distance(&product(&r, &adjoint(&r)), &identity(n)));
        if family == "su" {
            worst = worst.max(distance(&vec![vec![determinant_3(&r)]], &vec![vec![(1.0, 0.0)]]));
        }
    }
    worst
}

fn determinant_3(m: &Square) -> (f64, f64) {
    let times = |(a, b): (f64, f64), (c, d): (f64, f64)| (a * c - b * d, a * d + b * c);
    let mut sum = (0.0, 0.0);
    for (i, j, k, sign) in
        [(0, 1, 2, 1.0), (1, 2, 0, 1.0), (2, 0, 1, 1.0), (0, 2, 1, -1.0), (2, 1, 0, -1.0), (1, 0, 2, -1.0)]
    {
        let term = times(times(m[0][i], m[1][j]), m[2][k]);
        sum = (sum.0 + sign * term.0, sum.1 + sign * term.1);
    }
    sum
}

#[test]
fn projection_keeps_matrices_in_their_group() {
    let n_steps = 10_000;
    let body = built(BODY_4, "path");
    let (free, kept) = (
        strays(&body, "so", 4, Vern9, n_steps),
        strays(&body, "so", 4, Projected::<_, 32>::new(Vern9), n_steps),
    );
    println!("SO(4), {n_steps} steps: {free:e}, projected {kept:e}");
    assert!(kept < 1e-13 && free > 10.0 * kept, "{free:e}, {kept:e}");
    let top = built(TOP_SU_3, "path");
    let (free, kept) = (
        strays(&top, "su", 3, Vern9, n_steps),
        strays(&top, "su", 3, Projected::<_, 32>::new(Vern9), n_steps),
    );
    println!("SU(3), {n_steps} steps: {free:e}, projected {kept:e}");
    assert!(kept < 1e-13 && free > 10.0 * kept, "{free:e}, {kept:e}");
}

#[test]
fn what_a_group_keeps_and_momenta_in_space_are_invariants() {
    let names = |items: &str| {
        let scene = built(&format!("{items} scene kept {{ want invariants, reconstruction; }}"), "kept");
        scene.invariant_names().expect("invariants")
    };
    for side in ["left", "right"] {
        let found = names(&format!("{BODY} action {side}; reconstruct R, x in semidirect(SO(3), standard);"));
        let forms = found.iter().filter(|name| name.starts_with("R_form_")).count();
        assert_eq!(forms, 6, "{found:?}");
        assert!(found.iter().any(|name| name.starts_with("space_p_V")), "{found:?}");
        let volume = names(&format!(
            "velocity w in sl(2); lagrangian = dot(w, diag([1, 2, 3])*w)/2; action {side}; reconstruct F in SL(2);"
        ));
        assert_eq!(volume, ["F_det", "energy"], "{side}");
        let symplectic = names(&format!(
            "velocity w in sp(2); lagrangian = dot(w, diag([1, 2, 3])*w)/2; action {side}; reconstruct F in Sp(2);"
        ));
        assert_eq!(symplectic, ["F_form_1_2", "energy"], "{side}");
        let affine = names(&format!(
            "velocity w in gl(2); lagrangian = dot(w, diag([1, 2, 3, 4])*w)/2; action {side}; reconstruct F in GL(2);"
        ));
        // The second is the momentum along the centre, the multiples of one.
        assert_eq!(affine, ["energy", "gauge_momentum1"], "{side}");
    }
}

#[test]
fn parts_of_an_algebra_move_matrices_and_views_take_them() {
    let items = "velocity Omega, V, U in semidirect(so(3), standard, standard);
        lagrangian = dot(Omega, Omega) + dot(V, V) + dot(U, U);
        reconstruct R, r, u in semidirect(SO(3), standard, standard);
        reconstruct Q in matrices(SO(3)) from Omega;
        view body = box(1, 2, 3) at r attitude R; scene path { want rhs, reconstruction; }";
    let scene = built(items, "path");
    assert_eq!(scene.state_names().len(), 9 + 9 + 6 + 9);
    assert_eq!(&scene.state_names()[9..12], ["R11", "R12", "R13"]);
    let plane = built(
        "velocity omega, v in se(2); lagrangian = omega^2 + dot(v, v); reconstruct R, x in matrices(SE(2));
         scene path { want rhs, reconstruction; }",
        "path",
    );
    // Counter-clockwise, as the angle of SE(2).
    let interpreter = plane.prepare(&[]).expect("no parameters");
    let mut rates = [0.0; 9];
    interpreter.rhs(0.0, &[0.7, 0.2, 0.3, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0], &mut rates);
    assert_eq!(rates[3..], [0.0, -0.7, 0.7, 0.0, 0.2, 0.3]);
}
