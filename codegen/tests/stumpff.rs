//! Sines and cosines of what may vanish: `sinc`, `cosc` and rotation vectors, by Stumpff's functions.

use std::collections::BTreeMap;

use hamel_codegen::scene::{self, BuiltScene, Derivative, Interpreter};
use hamel_codegen::spec::{self, ExprId, Func, Graph, Rational, Vanishing};
use hamel_runtime::{Dop853, Error, Integrator, Options, Stats, System};

fn build(items: &str, scene: &str) -> BuiltScene {
    let text = format!("model m {{ {items} }}");
    let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"))
}

/// A segment of constant curvature under its weight, and the same by quotients.
const SEGMENT: &str = "coordinate q in real; let p = 0.5*[sinc(q), q*cosc(q)];
    lagrangian = 0.1*dot(rate(p), rate(p)) - 0.15*q^2 - 1.962*p[2]; force q_dot = -0.01*q_dot;
    scene a { want energy, jacobian, jvp, taylor; }";
const BY_QUOTIENTS: &str = "coordinate q in real; let p = 0.5*[sin(q)/q, (1 - cos(q))/q];
    lagrangian = 0.1*dot(rate(p), rate(p)) - 0.15*q^2 - 1.962*p[2]; force q_dot = -0.01*q_dot;
    scene a { want energy, jacobian, jvp, taylor; }";

fn rates(built: &BuiltScene, y: [f64; 2]) -> f64 {
    let mut dy = [0.0; 2];
    built.prepare(&[]).unwrap().rhs(0.0, &y, &mut dy);
    dy[1]
}

/// A scene of one coordinate as a system.
struct Interpreted<'a>(Interpreter<'a>);

impl System<f64> for Interpreted<'_> {
    type State = [f64; 2];

    fn rhs(&self, t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        self.0.rhs(t, y, dy);
    }
}

/// The coordinate at a time, and what it took.
fn moved(built: &BuiltScene, start: [f64; 2], t: f64, tolerance: f64) -> Result<(f64, Stats), Error> {
    let system = Interpreted(built.prepare(&[]).unwrap());
    let options = Options::adaptive(tolerance, tolerance);
    let mut integrator = Integrator::new(&system, Dop853, 0.0, start, options)?;
    integrator.integrate_to(t)?;
    Ok((integrator.state()[0], integrator.stats()))
}

#[test]
fn equations_keep_their_digits_at_zero() {
    let (smooth, quotients) = (build(SEGMENT, "a"), build(BY_QUOTIENTS, "a"));
    // Away from zero both forms are one.
    for y in [[0.5, 0.3], [-1.2, 2.0], [3.0, -0.7]] {
        let (a, b) = (rates(&smooth, y), rates(&quotients, y));
        assert!((a - b).abs() < 1e-11 * b.abs().max(1.0), "{y:?}: {a} {b}");
    }
    // p' = (0, 1/4) at zero: (0.2/16) q'' = -1.962/4, and the slopes of p'.p' vanish there.
    let expected = -1.962 / 4.0 * 16.0 / 0.2;
    assert!((rates(&smooth, [0.0, 0.0]) - expected).abs() < 1e-13 * -expected);
    // q'' is smooth: (q''(h) - q''(-h))/2h is the slope, at any h down to the digits of a difference.
    let slope = |h: f64| (rates(&smooth, [h, 0.4]) - rates(&smooth, [-h, 0.4])) / (2.0 * h);
    assert!((slope(1e-4) - slope(1e-5)).abs() < 1e-5, "{} {}", slope(1e-4), slope(1e-5));
    let jacobian = smooth.prepare(&[]).unwrap().matrix(Derivative::Jacobian, 0.0, &[0.0, 0.4]).unwrap();
    assert!((jacobian[1][0] - slope(1e-5)).abs() < 1e-5, "{jacobian:?} {}", slope(1e-5));
}

/// The coefficients of the series, whose rules have the family of functions ahead in them.
#[test]
fn taylor_series_pass_zero() {
    let (smooth, quotients) = (build(SEGMENT, "a"), build(BY_QUOTIENTS, "a"));
    let series = |built: &BuiltScene, y: [f64; 2]| {
        let mut rows = vec![vec![0.0; 2]; 31];
        let mut out: Vec<&mut [f64]> = rows.iter_mut().map(Vec::as_mut_slice).collect();
        built.prepare(&[]).unwrap().series(&built.jet().unwrap(), 0.0, &y, &mut out);
        rows.iter().map(|row| row[0]).collect::<Vec<f64>>()
    };
    let (a, b) = (series(&smooth, [0.8, -0.4]), series(&quotients, [0.8, -0.4]));
    for (k, (a, b)) in a.iter().zip(&b).enumerate() {
        // Quotients divide by the series of q, which has a zero next to t = 0.19: rounding errors grow as terms at this
        // distance.
        let size = 0.15_f64.powi(k as i32);
        assert!((a - b).abs() * size < 1e-11, "order {k}: {a} {b}");
    }
    // At zero, by the motion itself: a step of the series against many of another method.
    for start in [[0.0, 0.3], [1e-9, 0.3], [-7e-4, 0.0]] {
        let coefficients = series(&smooth, start);
        let h = 0.04;
        let by_series = coefficients.iter().rev().fold(0.0, |sum, c| sum * h + c);
        let by_steps = moved(&smooth, start, h, 1e-14).unwrap().0;
        assert!((by_series - by_steps).abs() < 1e-13, "{start:?}: {by_series} {by_steps}");
    }
}

#[test]
fn the_soft_segment_swings_through_zero() {
    let (_, stats) = moved(&build(SEGMENT, "a"), [0.5, 0.0], 10.0, 1e-10).unwrap();
    assert!(stats.steps < 5000, "{stats:?}");
}

/// `x sinc(x) = sin(x)` and the like are known, and what is no identity is known to be none.
#[test]
fn zero_tests_know_the_identities() {
    let mut g = Graph::new();
    let [x, y] = ["x", "y"].map(|name| g.symbol(name)).map(|s| g.sym(s));
    let one = g.one();
    let sum = g.add(x, y);
    let of = |g: &mut Graph, k: u8, x: ExprId| {
        let z = g.powi(x, 2);
        g.func(Func::Stumpff(k), z)
    };
    let check = |g: &mut Graph, what: &str, e: ExprId, expected: Vanishing| {
        assert_eq!(g.vanishing(e), expected, "{what}");
    };
    for (what, x) in [("x", x), ("x + y", sum)] {
        let (sine, cosine) = (g.func(Func::Sin, x), g.func(Func::Cos, x));
        let [c1, c2, c3, c4] = [1, 2, 3, 4].map(|k| of(&mut g, k, x));
        let product = g.mul(x, c1);
        let difference = g.sub(product, sine);
        check(&mut g, &format!("{what}: x c_1 - sin x"), difference, Vanishing::Zero);
        let square = g.powi(x, 2);
        let product = g.mul(square, c2);
        let difference = g.sum(&[product, cosine]);
        let difference = g.sub(difference, one);
        check(&mut g, &format!("{what}: x^2 c_2 + cos x - 1"), difference, Vanishing::Zero);
        let product = g.mul(square, c3);
        let sum = g.sum(&[product, c1]);
        let difference = g.sub(sum, one);
        check(&mut g, &format!("{what}: x^2 c_3 + c_1 - 1"), difference, Vanishing::Zero);
        let half = g.rational(Rational::new(1.into(), 2.into()));
        let product = g.mul(square, c4);
        let sum = g.sum(&[product, c2]);
        let difference = g.sub(sum, half);
        check(&mut g, &format!("{what}: x^2 c_4 + c_2 - 1/2"), difference, Vanishing::Zero);
        let difference = g.sub(c1, c2);
        check(&mut g, &format!("{what}: c_1 - c_2"), difference, Vanishing::NonZero);
        let difference = g.sub(c1, cosine);
        check(&mut g, &format!("{what}: c_1 - cos x"), difference, Vanishing::NonZero);
    }
    // A square that is none to look at: the family keeps its relations, and other values are seen at real points.
    let (a, b) = (g.powi(x, 2), g.powi(y, 2));
    let z = g.add(a, b);
    let [c1, c2, c3] = [1, 2, 3].map(|k| g.func(Func::Stumpff(k), z));
    let bent = g.mul(z, c2);
    let cosine = g.sub(one, bent);
    let (of_cosine, of_sine) = (g.powi(cosine, 2), g.powi(c1, 2));
    let of_sine = g.mul(z, of_sine);
    let sum = g.add(of_cosine, of_sine);
    let difference = g.sub(sum, one);
    check(&mut g, "c_0^2 + z c_1^2 - 1", difference, Vanishing::Zero);
    let difference = g.sub(c2, c3);
    check(&mut g, "c_2 - c_3", difference, Vanishing::NonZero);
}

/// Derivatives against differences, at zero and on both sides of it.
#[test]
fn derivatives_are_of_the_family() {
    let mut g = Graph::new();
    let s = g.symbol("x");
    let x = g.sym(s);
    let z = g.powi(x, 2);
    for k in 1..6 {
        let f = g.func(Func::Stumpff(k), z);
        let first = g.diff(f, s);
        let second = g.diff(first, s);
        for at in [-2.5, -1e-4, 0.0, 1e-7, 0.3, 4.0] {
            let value = |e: ExprId, x: f64| g.eval_f64(e, &BTreeMap::from([(s, x)])).unwrap();
            let h = 1e-5;
            let slope = (value(f, at + h) - value(f, at - h)) / (2.0 * h);
            assert!((value(first, at) - slope).abs() < 1e-9, "c_{k}' at {at}");
            let slope = (value(first, at + h) - value(first, at - h)) / (2.0 * h);
            assert!((value(second, at) - slope).abs() < 1e-9, "c_{k}'' at {at}");
        }
    }
}

/// A body by its rotation vector: the momentum in space stays, which `casimir` has proved.
#[test]
fn rotation_vectors_turn_bodies() {
    let items = "param I: diagonal(3) = [1, 2, 3]; coordinate v: vector(3) in real; let R = rot(v);
        let w = spin(R); lagrangian = dot(w, I*w)/2; output omega = w; output vertical = R*[0, 0, 1];
        scene a { want energy, outputs; }";
    let built = build(items, "a");
    assert!(built.equations().facts.energy_is_conserved);
    let prepared = built.prepare(&[1.0, 2.0, 3.0]).unwrap();
    let out = |y: &[f64]| prepared.outputs(0.0, y);
    let names: Vec<String> =
        built.outputs().iter().flat_map(|o| &o.components).map(|(name, _)| name.clone()).collect();
    let of = |y: &[f64], stem: &str| -> [f64; 3] {
        [1, 2, 3].map(|k| {
            let name = format!("{stem}{k}");
            out(y)[names.iter().position(|own| *own == name).unwrap_or_else(|| panic!("{name}: {names:?}"))]
        })
    };
    // Euler's equations, with the rate of the angular velocity along the motion.
    for y in
        [[0.0, 0.0, 0.0, 0.3, -0.8, 0.5], [0.4, -1.1, 0.7, 0.3, -0.8, 0.5], [1e-8, 0.0, 0.0, 1.0, 0.2, 0.1]]
    {
        let mut dy = [0.0; 6];
        prepared.rhs(0.0, &y, &mut dy);
        let h = 1e-6;
        let moved = |sign: f64| -> Vec<f64> { y.iter().zip(&dy).map(|(y, d)| y + sign * h * d).collect() };
        let (ahead, behind, w) = (of(&moved(1.0), "omega"), of(&moved(-1.0), "omega"), of(&y, "omega"));
        let inertia = [1.0, 2.0, 3.0];
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let rate = (ahead[k] - behind[k]) / (2.0 * h);
            let expected = (inertia[i] - inertia[j]) * w[i] * w[j] / inertia[k];
            assert!((rate - expected).abs() < 1e-8, "{y:?}: omega{}' is {rate}, Euler {expected}", k + 1);
        }
    }
    // By half a turn about the first axis, and by nothing.
    let near = |found: [f64; 3], expected: [f64; 3]| {
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{found:?} {expected:?}");
    };
    near(of(&[std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0, 0.0], "vertical"), [0.0, 0.0, -1.0]);
    near(of(&[0.0; 6], "vertical"), [0.0, 0.0, 1.0]);
    near(of(&[0.0, 0.0, 0.0, 0.1, 0.2, 0.3], "omega"), [0.1, 0.2, 0.3]);
}

/// Names of functions that are values of a model, beside the functions.
#[test]
fn names_of_functions_are_free() {
    let items = "param exp = 2; param abs = 3; coordinate sin in real; coordinate cos in real; velocity sqrt in R;
        let delta = sin + exp; input dot = 0; lagrangian = (sin_dot^2 + cos_dot^2 + sqrt^2)/2 - abs*sin(delta)*cos(cos);
        force sin_dot = dot; virtual delta(cos_dot) = delta(sqrt); constraint cos_dot = sqrt;
        scene norm { input dot; }";
    let built = build(items, "norm");
    let mut dy = [0.0; 4];
    let prepared = built.prepare(&[2.0, 3.0]).unwrap();
    let n = built.state_names().len();
    let y = [0.3, 0.5, 0.0, 0.0];
    prepared.rhs_with(0.0, &y[..n], &[0.7], &mut dy[..n]);
    let at = built.state_names().iter().position(|name| name == "sin_dot").unwrap();
    let expected = 0.7 - 3.0 * (0.3_f64 + 2.0).cos() * 0.5_f64.cos();
    assert!((dy[at] - expected).abs() < 1e-14, "{dy:?} {expected}");
    let c = built.emit_c(&Default::default(), None).unwrap_or_else(|e| panic!("{e}"));
    assert!(c.source.contains("double"));
}
