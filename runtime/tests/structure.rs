//! What methods keep: quadratic invariants, symmetry, invariants by projection, the norm of quaternions.

use hamel_runtime::{
    Differentiable, Dop853, Error, Gauss4, Gauss6, Gauss8, Integrator, Invariants, Method, Midpoint, Options,
    Projected, Rk4, System, Tsit5,
};

const INERTIA: [f64; 3] = [0.6, 0.8, 0.5];

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A free rigid body with its attitude as a quaternion.
///
/// ```text
/// M' = M x Omega,  q' = q Omega / 2,  M_i = I_i Omega_i
/// ```
struct Body;

impl System<f64> for Body {
    type State = [f64; 7];
    fn rhs(&self, _t: f64, &[a, b, c, w, x, y, z]: &[f64; 7], dy: &mut [f64; 7]) {
        let [p, q, r] = [a / INERTIA[0], b / INERTIA[1], c / INERTIA[2]];
        *dy = [
            b * r - c * q,
            c * p - a * r,
            a * q - b * p,
            -0.5 * (x * p + y * q + z * r),
            0.5 * (w * p + y * r - z * q),
            0.5 * (w * q + z * p - x * r),
            0.5 * (w * r + x * q - y * p),
        ];
    }
}

/// Energy, the square of the momentum, and the square of the quaternion: all quadratic.
impl Invariants<f64, 3> for Body {
    fn values(&self, _t: f64, y: &[f64; 7]) -> [f64; 3] {
        let energy = 0.5 * (0..3).map(|i| y[i] * y[i] / INERTIA[i]).sum::<f64>();
        [energy, dot(&y[..3], &y[..3]), dot(&y[3..], &y[3..])]
    }
    fn gradients(&self, _t: f64, y: &[f64; 7], gradients: &mut [[f64; 7]; 3]) {
        for i in 0..7 {
            let momentum = i < 3;
            gradients[0][i] = if momentum { y[i] / INERTIA[i] } else { 0.0 };
            gradients[1][i] = if momentum { 2.0 * y[i] } else { 0.0 };
            gradients[2][i] = if momentum { 0.0 } else { 2.0 * y[i] };
        }
    }
}

const BODY_START: [f64; 7] = [0.9, -0.4, 1.1, 0.5, 0.5, -0.5, 0.5];

/// Largest relative deviations of the invariants at a hundred times up to the end of so many steps of size `h`.
fn deviations<M: Method<f64, Body>>(method: M, h: f64, n_steps: u32) -> [f64; 3] {
    let options = Options::fixed(h).with_max_steps(u64::MAX);
    let mut solver = Integrator::new(&Body, method, 0.0, BODY_START, options).unwrap();
    let start = Body.values(0.0, &BODY_START);
    let mut worst = [0.0_f64; 3];
    for n in 1..=100 {
        solver.integrate_to(f64::from(n_steps / 100 * n) * h).unwrap();
        let now = Body.values(0.0, solver.state());
        for ((worst, now), start) in worst.iter_mut().zip(now).zip(start) {
            *worst = worst.max((now / start - 1.0).abs());
        }
    }
    worst
}

#[test]
fn gauss_methods_keep_quadratic_invariants() {
    for (name, worst) in [
        ("gauss4", deviations(Gauss4::fixed_point(), 0.1, 40_000)),
        ("gauss6", deviations(Gauss6::fixed_point(), 0.1, 40_000)),
        ("gauss8", deviations(Gauss8::fixed_point(), 0.1, 40_000)),
    ] {
        println!("{name}: {worst:?}");
        // Round-off of the evaluation, and a random walk of it.
        assert!(worst.iter().all(|&w| w < 2e-14), "{name}: {worst:?}");
    }
    // The check can fail: an explicit method of the same order drifts.
    let drifting = deviations(Rk4, 0.1, 40_000);
    assert!(drifting.iter().all(|&w| w > 1e-6), "{drifting:?}");
}

#[test]
fn projection_keeps_invariants_and_order() {
    for (name, worst) in [
        ("rk4", deviations(Projected::<_, 3>::new(Rk4), 0.1, 100_000)),
        ("dop853", deviations(Projected::<_, 3>::new(Dop853), 0.2, 40_000)),
        ("gauss4", deviations(Projected::<_, 3>::new(Gauss4::fixed_point()), 0.2, 20_000)),
    ] {
        println!("{name}: {worst:?}");
        // A few units of round-off of the state, which do not add up.
        assert!(worst.iter().all(|&w| w < 2e-15), "{name}: {worst:?}");
    }
    // Those that are not to be kept are left as the method leaves them.
    let [first, second, third] = deviations(Projected::<_, 3>::onto_first(Rk4, 2), 0.1, 40_000);
    assert!(first < 2e-15 && second < 2e-15 && third > 1e-6, "{first} {second} {third}");
    let run = |n: u32, projected: bool| {
        let options = Options::fixed(4.0 / f64::from(n));
        if projected {
            let method = Projected::<_, 3>::new(Rk4);
            let mut solver = Integrator::new(&Body, method, 0.0, BODY_START, options).unwrap();
            solver.integrate_to(4.0).unwrap();
            *solver.state()
        } else {
            let mut solver = Integrator::new(&Body, Dop853, 0.0, BODY_START, options).unwrap();
            solver.integrate_to(4.0).unwrap();
            *solver.state()
        }
    };
    let reference = run(400, false);
    let error = |n| {
        let y = run(n, true);
        y.iter().zip(reference).map(|(y, r)| (y - r).abs()).fold(0.0, f64::max)
    };
    let order = (error(50) / error(200)).log2() / 2.0;
    assert!((3.8..4.3).contains(&order), "{order}");
    // Error control and dense output are those of the method.
    let method = Projected::<_, 3>::new(Tsit5);
    let mut solver = Integrator::new(&Body, method, 0.0, BODY_START, Options::adaptive(1e-9, 1e-9)).unwrap();
    let mut middle = [0.0; 7];
    solver.sample(4.0, [1.234], |_, y| middle = *y).unwrap();
    let close = |a: &[f64; 7], b: &[f64; 7]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-7);
    assert!(close(solver.state(), &reference));
    let mut solver = Integrator::new(&Body, Dop853, 0.0, BODY_START, Options::fixed(0.01)).unwrap();
    solver.integrate_to(1.234).unwrap();
    assert!(close(solver.state(), &middle));
}

#[test]
fn dependent_gradients_do_not_spoil_projection() {
    // Rotation about a principal axis: the gradients of energy and momentum are parallel, and all is constant.
    let start = [0.0, 0.0, 1.3, 1.0, 0.0, 0.0, 0.0];
    let method = Projected::<_, 3>::new(Rk4);
    let mut solver = Integrator::new(&Body, method, 0.0, start, Options::fixed(0.1)).unwrap();
    solver.integrate_to(100.0).unwrap();
    let [a, b, c, w, x, y, z] = *solver.state();
    let angle = 0.5 * 1.3 / INERTIA[2] * 100.0;
    assert!((a, b, x, y) == (0.0, 0.0, 0.0, 0.0) && (c - 1.3).abs() < 1e-15);
    assert!((w - angle.cos()).abs() < 1e-3 && (z - angle.sin()).abs() < 1e-3, "{w} {z}");
    assert!((w * w + z * z - 1.0).abs() < 1e-15);
}

/// A pendulum that turns over and over: `angle' = rate, rate' = -sin(angle)`.
struct Rotor;

impl System<f64> for Rotor {
    type State = [f64; 2];
    fn rhs(&self, _t: f64, &[angle, rate]: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [rate, -angle.sin()];
    }
}

impl Invariants<f64, 1> for Rotor {
    fn values(&self, _t: f64, &[angle, rate]: &[f64; 2]) -> [f64; 1] {
        [0.5 * rate * rate - angle.cos()]
    }
    fn gradients(&self, _t: f64, &[angle, rate]: &[f64; 2], gradients: &mut [[f64; 2]; 1]) {
        gradients[0] = [angle.sin(), rate];
    }
}

#[test]
fn projection_does_not_depend_on_the_last_place_of_an_angle_that_has_grown() {
    // Places of the angle are 1e-10 apart: far more than the energy is corrected by.
    let start = [1e6, 2.1];
    let method = Projected::<_, 1>::new(Dop853);
    let mut solver = Integrator::new(&Rotor, method, 0.0, start, Options::fixed(0.05)).unwrap();
    let [level] = Rotor.values(0.0, &start);
    let mut worst: f64 = 0.0;
    for _ in 0..20_000 {
        let _ = solver.step_towards(1e9).unwrap();
        worst = worst.max((Rotor.values(0.0, solver.state())[0] - level).abs());
    }
    // A few units of round-off of the energy.
    assert!(worst <= 8.0 * f64::EPSILON, "{worst:e}");
}

/// `x'' = -sin x`, or the stiff `x' = -rate (x - cos t)`.
enum Plane {
    Pendulum,
    Stiff { rate: f64 },
}

impl System<f64> for Plane {
    type State = [f64; 2];
    fn rhs(&self, t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = match self {
            Self::Pendulum => [y[1], -y[0].sin()],
            Self::Stiff { rate } => [-rate * (y[0] - t.cos()), -y[1]],
        };
    }
}

impl Differentiable<f64> for Plane {
    fn jacobian(&self, _t: f64, y: &[f64; 2], jacobian: &mut [[f64; 2]]) {
        match self {
            Self::Pendulum => jacobian.copy_from_slice(&[[0.0, 1.0], [-y[0].cos(), 0.0]]),
            Self::Stiff { rate } => jacobian.copy_from_slice(&[[-rate, 0.0], [0.0, -1.0]]),
        }
    }
}

#[test]
fn gauss_methods_are_reversible_and_their_energy_does_not_drift() {
    fn check<M: Method<f64, Plane>>(method: M, h: f64, bound: f64) {
        let name = M::TABLEAU.name;
        let energy = |y: &[f64; 2]| 0.5 * y[1] * y[1] - y[0].cos();
        let start = [1.5, 0.3];
        let mut solver = Integrator::new(&Plane::Pendulum, method, 0.0, start, Options::fixed(h)).unwrap();
        let mut spans = vec![];
        for span in 0..4 {
            let mut worst = 0.0_f64;
            for n in 1..=500 {
                solver.integrate_to(f64::from(span * 500 + n) * 10.0 * h).unwrap();
                worst = worst.max((energy(solver.state()) - energy(&start)).abs());
            }
            spans.push(worst);
        }
        println!("{name}: {spans:?}");
        // The energy oscillates, and the oscillation does not grow.
        assert!(spans[0] > 1e-13 && spans[0] < bound, "{name}: {spans:?}");
        assert!(spans[3] < 1.05 * spans[0] + 1e-14, "{name}: {spans:?}");
        // Back by the same steps: the method is its own inverse.
        solver.integrate_to(19_900.0 * h).unwrap();
        let there = *solver.state();
        solver.integrate_to(20_000.0 * h).unwrap();
        solver.integrate_to(19_900.0 * h).unwrap();
        let back = *solver.state();
        assert!(there.iter().zip(back).all(|(a, b)| (a - b).abs() < 1e-12), "{name}: {there:?} {back:?}");
    }
    check(Midpoint::fixed_point(), 0.02, 1e-4);
    check(Midpoint::newton(), 0.02, 1e-4);
    check(Gauss4::fixed_point(), 0.1, 2e-7);
    check(Gauss6::fixed_point(), 0.2, 5e-9);
    check(Gauss8::fixed_point(), 0.4, 1e-9);
    check(Gauss4::newton(), 0.1, 2e-7);
    check(Gauss6::newton(), 0.2, 5e-9);
    check(Gauss8::newton(), 0.4, 1e-9);
}

#[test]
fn newton_takes_steps_which_fixed_points_cannot() {
    let system = Plane::Stiff { rate: 1e4 };
    let options = Options::fixed(0.05);
    let mut solver = Integrator::new(&system, Gauss6::newton(), 0.0, [1.0, 1.0], options).unwrap();
    solver.integrate_to(5.0).unwrap();
    // Close to the slow solution cos t + sin t / rate, at steps 500 times the fast time scale.
    assert!((solver.state()[0] - 5.0_f64.cos() - 1e-4 * 5.0_f64.sin()).abs() < 1e-5, "{:?}", solver.state());
    assert!((solver.state()[1] - (-5.0_f64).exp()).abs() < 1e-10);
    let stats = solver.stats();
    assert_eq!((stats.steps, stats.jacobian_evals), (100, 100));
    assert!(stats.rhs_evals <= 100 * (4 * 3 + 1) + 1, "{stats:?}");

    let mut solver = Integrator::new(&system, Gauss6::fixed_point(), 0.0, [1.0, 1.0], options).unwrap();
    let error = solver.integrate_to(5.0).unwrap_err();
    assert!(
        matches!(error, Error::NotConverged { method: "gauss6", t: 0.0, h: 0.05, iterations } if iterations > 1),
        "{error:?}"
    );
    assert_eq!((solver.t(), solver.state()), (0.0, &[1.0, 1.0]));
    let adaptive = Integrator::new(&system, Gauss6::newton(), 0.0, [1.0, 1.0], Options::adaptive(1e-6, 1e-6));
    assert_eq!(adaptive.map(|_| ()), Err(Error::NoErrorEstimate { method: "gauss6-newton" }));
}

#[test]
fn starting_values_save_iterations() {
    let evals = |h: f64| {
        let mut solver =
            Integrator::new(&Body, Gauss8::fixed_point(), 0.0, BODY_START, Options::fixed(h)).unwrap();
        solver.integrate_to(20.0).unwrap();
        solver.stats().rhs_evals as f64 / solver.stats().steps as f64 / 4.0
    };
    println!("iterations: {:.2} at 0.1, {:.2} at 0.02", evals(0.1), evals(0.02));
    assert!(evals(0.1) < 12.0 && evals(0.02) < 7.0, "{} and {}", evals(0.1), evals(0.02));
}
