//! Taylor coefficients of solutions: against closed forms, identities, the equations, and compiled against interpreted.

use hamel_codegen::{scene, spec};
use hamel_expr::{ExprId, Func, Graph, Rational};
use hamel_program::lower::{Inputs, Request, SearchBudget, lower};
use hamel_program::program::{Jet, Role};
use hamel_runtime::{Dop853, Error, Integrator, Options, Scene, System, Taylor};

const ORDER: usize = 24;

/// Coefficients of functions of the time, from `y' = f(t)`, `y = 0`.
fn of_time(t: f64, f: impl FnOnce(&mut Graph, ExprId) -> Vec<ExprId>) -> Vec<Vec<f64>> {
    let mut g = Graph::new();
    let time = g.symbol("t");
    let argument = g.sym(time);
    let rates = f(&mut g, argument);
    let n = rates.len();
    let state: Vec<_> = (0..n).map(|i| g.symbol(&format!("y{i}"))).collect();
    let results = rates.into_iter().enumerate().map(|(i, e)| (format!("y{i}"), e)).collect();
    let inputs = Inputs {
        params: vec![],
        time,
        held: Vec::new(),
        state,
        signs: Default::default(),
        circles: vec![],
        arguments: Default::default(),
        divisors: Default::default(),
        sampling: None,
    };
    let program =
        lower(&mut g, &inputs, &[], &[], &[Request { role: Role::Rate, results }], &SearchBudget::default())
            .unwrap();
    let mut out = vec![vec![0.0; n]; ORDER + 2];
    let mut slices: Vec<&mut [f64]> = out.iter_mut().map(Vec::as_mut_slice).collect();
    Jet::new(&program, 0).unwrap().series(&[], &[], t, &vec![0.0; n], &mut slices);
    (0..n).map(|i| (0..=ORDER).map(|k| (k + 1) as f64 * out[k + 1][i]).collect()).collect()
}

/// Compares terms at the distance `radius`, at which those of all series involved decay.
fn close(what: &str, found: &[f64], expected: &[f64], radius: f64) {
    assert!(expected.iter().any(|x| *x != 0.0), "{what} vanishes");
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        let size = radius.powi(k as i32);
        // Sums of at most 24 terms of size one, and weights up to 24.
        let bound = 1e-13 * (1.0 + b.abs() * size);
        assert!((a - b).abs() * size <= bound, "{what}, order {k}: {a} instead of {b}");
    }
}

fn product(a: &[f64], b: &[f64]) -> Vec<f64> {
    (0..a.len().min(b.len())).map(|k| (0..=k).map(|j| a[j] * b[k - j]).sum()).collect()
}

fn sum(a: &[f64], b: &[f64], sign: f64) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a + sign * b).collect()
}

fn derivative(a: &[f64]) -> Vec<f64> {
    (1..a.len()).map(|k| k as f64 * a[k]).collect()
}

/// Coefficients from the ratio of neighbours: `c_k = c_{k-1} ratio(k)`.
fn by_ratio(ratio: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut c = vec![1.0];
    (1..=ORDER).for_each(|k| c.push(c[k - 1] * ratio(k as f64)));
    c
}

#[test]
fn functions_have_their_closed_series() {
    let series = of_time(0.0, |g, t| {
        let one = g.one();
        let next = g.add(one, t);
        let mut all =
            [Func::Exp, Func::Sin, Func::Sinh, Func::Atan, Func::Asin].map(|f| g.func(f, t)).to_vec();
        all.push(g.func(Func::Ln, next));
        all.push(g.pow(next, &Rational::new(1.into(), 2.into())).unwrap());
        all.push(g.pow(next, &Rational::new((-1).into(), 3.into())).unwrap());
        all.push(g.div(one, next).unwrap());
        let square = g.powi(t, 2);
        for k in 1..4 {
            all.push(g.func(Func::Stumpff(k), square));
        }
        all.push(g.func(Func::Stumpff(1), t));
        let half = g.scale(t, &Rational::new(1.into(), 2.into()));
        all.extend([0, 2].map(|k| g.func(Func::Turn(k), half)));
        all
    });
    let binomial = |q: f64| by_ratio(|k| (q - k + 1.0) / k);
    let exp = by_ratio(|k| 1.0 / k);
    let sign = |k: usize| if k % 4 < 2 { 1.0 } else { -1.0 };
    let odd = |f: &dyn Fn(usize) -> f64| -> Vec<f64> {
        (0..=ORDER).map(|k| if k % 2 == 1 { f(k) } else { 0.0 }).collect()
    };
    let central = binomial(-0.5);
    close("exp", &series[0], &exp, 1.0);
    close("sin", &series[1], &odd(&|k| sign(k) * exp[k]), 1.0);
    close("sinh", &series[2], &odd(&|k| exp[k]), 1.0);
    close("atan", &series[3], &odd(&|k| sign(k) / k as f64), 1.0);
    close("asin", &series[4], &odd(&|k| central[(k - 1) / 2].abs() / k as f64), 1.0);
    let geometric = binomial(-1.0);
    let ln: Vec<f64> = (0..=ORDER).map(|k| if k == 0 { 0.0 } else { geometric[k - 1] / k as f64 }).collect();
    close("ln(1 + t)", &series[5], &ln, 1.0);
    close("sqrt(1 + t)", &series[6], &binomial(0.5), 1.0);
    close("(1 + t)^(-1/3)", &series[7], &binomial(-1.0 / 3.0), 1.0);
    close("1/(1 + t)", &series[8], &geometric, 1.0);
    // c_k(z) = sum_j (-z)^j/(2 j + k)!, of a square and of the time itself.
    let factorial = |n: usize| (1..=n).map(|k| k as f64).product::<f64>();
    let term = |j: usize, k: usize| (-1.0_f64).powi(j as i32) / factorial(2 * j + k);
    for k in 1..4 {
        let even = (0..=ORDER).map(|n| if n % 2 == 0 { term(n / 2, k) } else { 0.0 });
        close("c_k(t^2)", &series[8 + k], &even.collect::<Vec<_>>(), 1.0);
    }
    close("c_1(t)", &series[12], &(0..=ORDER).map(|j| term(j, 1)).collect::<Vec<_>>(), 1.0);
    // The coefficients of `theta/sin(theta)` by `w = sin(theta/2)^2`, and of the second half of its second derivative.
    let turn = by_ratio(|k| 2.0 * k / (2.0 * k + 1.0));
    let tail = |n: usize| 2.0 * (n as f64) / (2.0 * n as f64 + 1.0);
    let more: Vec<f64> = (0..2)
        .scan(turn[ORDER], |last, k| {
            *last *= tail(ORDER + 1 + k);
            Some(*last)
        })
        .collect();
    let all: Vec<f64> = turn.iter().chain(&more).copied().collect();
    let halved = |n: usize| 0.5_f64.powi(n as i32);
    close("turn0(t/2)", &series[13], &(0..=ORDER).map(|n| turn[n] * halved(n)).collect::<Vec<_>>(), 1.0);
    let second = |n: usize| all[n + 2] * ((n + 2) * (n + 1)) as f64 / 2.0 * halved(n);
    close("turn2(t/2)", &series[14], &(0..=ORDER).map(second).collect::<Vec<_>>(), 1.0);
}

#[test]
fn angles_of_points_have_the_series_of_angles() {
    let series = of_time(0.4, |g, t| {
        let (one, two, half) = (g.one(), g.int(2), g.rational(Rational::new(1.into(), 2.into())));
        let square = g.powi(t, 2);
        let (radius, shifted) = (g.add(two, square), g.add(t, half));
        let [sine, cosine] = [Func::Sin, Func::Cos].map(|f| g.func(f, shifted));
        let (y, x) = (g.mul(radius, sine), g.mul(radius, cosine));
        let minus = [g.neg(y), g.neg(x)];
        vec![
            shifted,
            g.atan2(y, x),
            g.atan2(minus[0], minus[1]),
            g.func(Func::Atan, shifted),
            g.atan2(shifted, one),
            g.atan2(one, shifted),
            g.atan2(t, t),
        ]
    });
    let [shifted, angle, opposite, atan, upright, lying, diagonal] = series.as_slice() else {
        panic!("{} series", series.len());
    };
    let number = |x: f64| (0..=ORDER).map(|k| if k == 0 { x } else { 0.0 }).collect::<Vec<_>>();
    let pi = std::f64::consts::PI;
    close("atan2(r sin x, r cos x)", angle, shifted, 1.0);
    close("atan2(-r sin x, -r cos x)", opposite, &sum(shifted, &number(pi), -1.0), 1.0);
    close("atan2(x, 1)", upright, atan, 1.0);
    close("atan2(1, x)", lying, &sum(&number(pi / 2.0), atan, -1.0), 1.0);
    close("atan2(x, x)", diagonal, &number(pi / 4.0), 0.4);
}

#[test]
fn functions_of_functions_satisfy_identities() {
    // x = t/2 + sin(t)/3 away from every special point.
    let series = of_time(0.4, |g, t| {
        use Func::{Abs, Acos, Asin, Atan, Cos, Cosh, Exp, Ln, Sin, Sinh, Tan, Tanh};
        let (half, third) = (Rational::new(1.into(), 2.into()), Rational::new(1.into(), 3.into()));
        let (a, b) = (g.rational(half), g.rational(third.clone()));
        let sine = g.func(Sin, t);
        let (a, b) = (g.mul(a, t), g.mul(b, sine));
        let x = g.add(a, b);
        let mut all = vec![x];
        all.extend([Sin, Cos, Tan, Sinh, Cosh, Tanh, Exp, Ln, Asin, Acos, Atan, Abs].map(|f| g.func(f, x)));
        all.push(g.pow(x, &third).unwrap());
        all
    });
    let [x, sin, cos, tan, sinh, cosh, tanh, exp, ln, asin, acos, atan, abs, root] = series.as_slice() else {
        panic!("{} series", series.len());
    };
    let one: Vec<f64> = (0..=ORDER).map(|k| if k == 0 { 1.0 } else { 0.0 }).collect();
    let (square, rate) = (product(x, x), derivative(x));
    close("sin^2 + cos^2", &sum(&product(sin, sin), &product(cos, cos), 1.0), &one, 0.3);
    close("sin'", &derivative(sin), &product(&rate, cos), 0.3);
    close("cosh^2 - sinh^2", &sum(&product(cosh, cosh), &product(sinh, sinh), -1.0), &one, 0.3);
    close("tan cos", &product(tan, cos), sin, 0.3);
    close("tanh cosh", &product(tanh, cosh), sinh, 0.3);
    close("exp", exp, &sum(cosh, sinh, 1.0), 0.3);
    close("|x|", abs, x, 0.3);
    close("cube", &product(&product(root, root), root), x, 0.3);
    close("x ln'", &product(x, &derivative(ln)), &rate, 0.3);
    close("(1 + x^2) atan'", &product(&sum(&one, &square, 1.0), &derivative(atan)), &rate, 0.3);
    close("acos'", &sum(&derivative(acos), &derivative(asin), 2.0), &derivative(asin), 0.3);
    let slope = derivative(asin);
    close(
        "asin'",
        &product(&sum(&one, &square, -1.0), &product(&slope, &slope)),
        &product(&rate, &rate),
        0.3,
    );
}

macro_rules! compiled {
    ($($model:ident $file:literal)*) => {$(
        #[allow(dead_code, missing_docs, unreachable_pub)]
        mod $model {
            include!(concat!("../../models/src/generated/", $file));
        }
    )*};
}
compiled! {
    heavy_top "heavy_top_taylor.rs"
    euler_disk "euler_disk_taylor.rs"
    chaplygin_ball "chaplygin_ball_taylor.rs"
    two_arm_satellite "two_arm_satellite_taylor.rs"
    snakeboard "snakeboard_taylor.rs"
}

fn compiled_equals_interpreted<S, const N: usize>(name: &str)
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
{
    let path = format!("{}/../models/specs/{name}.hamel", env!("CARGO_MANIFEST_DIR"));
    let model = spec::parse(name, &std::fs::read_to_string(path).unwrap()).unwrap_or_else(|e| panic!("{e}"));
    let scene = scene::build(&model, "taylor").unwrap_or_else(|e| panic!("{e}"));
    let defaults: Vec<f64> = S::INFO.params.iter().map(|p| p.default).collect();
    let compiled = S::prepare(&defaults).unwrap();
    let y: [f64; N] = std::array::from_fn(|i| 0.7 - 0.43 * i as f64 + 0.11 * (i * i) as f64);
    let interpreter = scene.prepare(&defaults).unwrap();
    let (mut one, mut other) = ([[0.0; N]; ORDER + 1], [[f64::NAN; N]; ORDER + 1]);
    assert!(compiled.series_of(0.2, &y, &mut one), "{name} has no series");
    let mut slices: Vec<&mut [f64]> = other.iter_mut().map(<[f64; N]>::as_mut_slice).collect();
    interpreter.series(&scene.jet().unwrap(), 0.2, &y, &mut slices);
    let bits = |series: &[[f64; N]]| series.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    assert_eq!(bits(&one), bits(&other), "{name}");
    let mut rate = [0.0; N];
    compiled.rhs(0.2, &y, &mut rate);
    assert!(rate.iter().any(|x| *x != 0.0));
    assert_eq!((one[0], one[1]), (y, rate), "{name}: the first coefficients are state and derivative");
}

#[test]
fn compiled_series_equal_interpreted_ones() {
    compiled_equals_interpreted::<heavy_top::Prepared, 6>("heavy_top");
    compiled_equals_interpreted::<euler_disk::Prepared, 5>("euler_disk");
    compiled_equals_interpreted::<chaplygin_ball::Prepared, 6>("chaplygin_ball");
    compiled_equals_interpreted::<two_arm_satellite::Prepared, 7>("two_arm_satellite");
    compiled_equals_interpreted::<snakeboard::Prepared, 5>("snakeboard");
}

const START: [f64; 6] = [0.4, -0.3, 2.0, 0.0, 0.6, 0.8];

fn top() -> heavy_top::Prepared {
    heavy_top::Prepared::new(&heavy_top::Params::default()).unwrap()
}

fn distance(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).abs() / (1.0 + b.abs())).fold(0.0, f64::max)
}

#[test]
fn trajectories_agree_with_another_method() {
    let top = top();
    let mut exact = Integrator::new(&top, Dop853, 0.0, START, Options::adaptive(1e-14, 1e-14)).unwrap();
    exact.integrate_to(5.0).unwrap();
    let mut previous = f64::INFINITY;
    // The last bound is the round-off of the comparison.
    for (tolerance, bound) in [(1e-6, 2e-6), (1e-9, 2e-9), (1e-12, 2e-12), (1e-14, 2e-13)] {
        let options = Options::adaptive(tolerance, tolerance);
        let mut solver = Integrator::new(&top, Taylor::new(), 0.0, START, options).unwrap();
        solver.integrate_to(5.0).unwrap();
        let error = distance(solver.state(), exact.state());
        assert!(error < bound && error < previous, "{tolerance:e}: {error:e}");
        previous = error;
    }
}

#[test]
fn fixed_steps_have_the_order_and_dense_output_is_as_accurate() {
    let top = top();
    let at = |order: usize, h: f64| {
        let method = Taylor::of_order(order);
        let mut solver = Integrator::new(&top, method, 0.0, START, Options::fixed(h)).unwrap();
        solver.integrate_to(1.0).unwrap();
        let mut between = [0.0; 6];
        solver.interpolate(0.975, &mut between).unwrap();
        (*solver.state(), between)
    };
    let (exact, between) = at(24, 0.05);
    for order in [3, 6, 9] {
        let (coarse, fine) = (at(order, 0.1).0, at(order, 0.05).0);
        let slope = (distance(&coarse, &exact) / distance(&fine, &exact)).log2();
        assert!((slope - order as f64).abs() < 1.0, "order {order}: {slope}");
    }
    let mut solver = Integrator::new(&top, Taylor::new(), 0.0, START, Options::fixed(0.025)).unwrap();
    solver.integrate_to(0.975).unwrap();
    assert!(distance(&between, solver.state()) < 1e-14);
}

#[test]
fn an_order_out_of_range_is_refused() {
    let top = top();
    let refused = Integrator::new(&top, Taylor::of_order(33), 0.0, START, Options::adaptive(1e-9, 1e-9));
    assert_eq!(refused.unwrap_err(), Error::Order { order: 33, least: 2, most: 32 });
}
