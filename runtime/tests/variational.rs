//! Derivatives along motions against what is known in closed form, against dual numbers through the whole integration,
//! and Lyapunov exponents.

use hamel_runtime::{
    Dop853, Dual, Error, Failure, Integrator, Options, Pivot, Real, System, Variational, Vern9,
};

/// Lorenz 1963.
#[derive(Clone, Copy, Debug)]
struct Lorenz<R> {
    sigma: R,
    rho: R,
    beta: R,
}

impl<R: Real> Lorenz<R> {
    fn new(rho: R) -> Self {
        Lorenz { sigma: R::from_f64(10.0), rho, beta: R::ratio(8.0, 3.0) }
    }
}

impl<R: Real> System<R> for Lorenz<R> {
    type State = [R; 3];

    fn rhs(&self, _t: R, y: &[R; 3], dy: &mut [R; 3]) {
        *dy = [self.sigma * (y[1] - y[0]), y[0] * (self.rho - y[2]) - y[1], y[0] * y[1] - self.beta * y[2]];
    }
}

/// `y' = (r/2) y^2`, of which `y = 1/(1 - r t/2)` becomes infinite.
struct Riccati<R>(R);

impl<R: Real> System<R> for Riccati<R> {
    type State = [R; 1];

    fn rhs(&self, _t: R, y: &[R; 1], dy: &mut [R; 1]) {
        *dy = [R::from_f64(0.5) * self.0 * y[0] * y[0]];
    }

    fn domain(&self, t: R, y: &[R; 1]) -> Result<(), Failure> {
        match R::from_f64(4.0).all_gt(y[0]) {
            true => Ok(()),
            false => Err(Failure::OutsideDomain { t: t.magnitude(), condition: "y < 4" }),
        }
    }

    fn signature(&self, _t: R, _y: &[R; 1]) -> R {
        R::from_f64(0.25)
    }

    fn pivots(&self, _t: R, y: &[R; 1], visit: &mut dyn FnMut(Pivot<R>)) {
        visit(Pivot { name: "y", value: y[0], scale: self.0 });
    }
}

#[test]
fn derivatives_are_those_of_the_solution() {
    // y = 1/(1/y0 - r t/2): dy/dr = y^2 t/2, dy/dy0 = (y/y0)^2.
    let systems = [Dual::variable(0.6), Dual::constant(0.6)].map(Riccati);
    let variational = Variational::<_, _, [f64; 3]>::new(&systems, [Dual::ZERO; 1]);
    assert_eq!((variational.n(), variational.n_directions()), (1, 2));
    let options = Options::adaptive(1e-13, 1e-13);
    let mut solver = Integrator::new(&variational, Vern9, 0.0, [0.5, 0.0, 1.0], options).unwrap();
    solver.integrate_to(2.0).unwrap();
    let y = 1.0 / (2.0 - 0.6);
    let expected = [y, y * y, 4.0 * y * y];
    for (found, expected) in solver.state().iter().zip(expected) {
        assert!((found - expected).abs() < 1e-11, "{found} {expected}");
    }
    // Out of the domain at 4, of the system and of its derivatives.
    let error = solver.integrate_to(6.0).unwrap_err();
    assert!(matches!(error, Error::Failure(Failure::OutsideDomain { condition: "y < 4", .. })), "{error}");
    let z = [0.5, 0.25, 1.0];
    let mut seen = Vec::new();
    variational.pivots(0.0, &z, &mut |pivot| seen.push(pivot));
    assert_eq!(seen, [Pivot { name: "y", value: 0.5, scale: 0.6 }]);
    assert_eq!(variational.signature(0.0, &z), 0.25);
}

/// The same integration with dual numbers as scalars throughout takes the derivative of what the method computes.
#[test]
fn derivatives_are_those_of_an_integration_with_dual_numbers() {
    let rho = Dual::variable(28.0);
    let systems = [Lorenz::new(rho), Lorenz::new(Dual::constant(28.0))];
    let variational = Variational::<_, _, [f64; 9]>::new(&systems, [Dual::ZERO; 3]);
    let start = [1.0, 2.0, 20.0];
    let z = [1.0, 2.0, 20.0, 0.0, 0.0, 0.0, 0.3, -0.5, 0.8];
    let mut solver = Integrator::new(&variational, Vern9, 0.0, z, Options::adaptive(1e-13, 1e-13)).unwrap();
    solver.integrate_to(1.0).unwrap();
    let through = |system: &Lorenz<Dual>, direction: [f64; 3]| {
        let start = [0, 1, 2].map(|i| Dual::new(start[i], direction[i]));
        let tolerance = Dual::constant(1e-14);
        let options = Options::adaptive(tolerance, tolerance);
        let mut solver = Integrator::new(system, Vern9, Dual::ZERO, start, options).unwrap();
        solver.integrate_to(Dual::constant(1.0)).unwrap();
        *solver.state()
    };
    let expected = [through(&systems[0], [0.0; 3]), through(&systems[1], [0.3, -0.5, 0.8])];
    for (k, expected) in expected.iter().enumerate() {
        for (found, expected) in variational.tangent(solver.state(), k).iter().zip(expected) {
            // Derivatives of a chaotic motion have grown by a hundred.
            let bound = 1e-10 * (1.0 + expected.derivative.abs());
            assert!((found - expected.derivative).abs() < bound, "{k}: {found} {expected:?}");
        }
    }
    for (found, expected) in solver.state().iter().zip(expected[0]) {
        assert!((found - expected.value).abs() < 1e-10, "{found} {expected:?}");
    }
}

/// A node with known rates, turned.
struct Linear;

impl<R: Real> System<R> for Linear {
    type State = [R; 2];

    fn rhs(&self, _t: R, y: &[R; 2], dy: &mut [R; 2]) {
        // Eigenvalues 0.5 and -2.
        *dy = [R::from_f64(-1.0) * y[0] + R::from_f64(1.5) * y[1], R::ONE * y[0] - R::from_f64(0.5) * y[1]];
    }
}

#[test]
fn exponents_of_a_linear_system_are_real_parts_of_its_eigenvalues() {
    let variational = Variational::<_, _, [f64; 6]>::new(&[Linear, Linear], [Dual::ZERO; 2]);
    let (mut t, mut z) = (0.0, [0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    let options = Options::adaptive(1e-12, 1e-12);
    let mut exponents = [0.0; 2];
    let mut run = |t: &mut f64, z: &mut [f64; 6], plan| {
        variational.lyapunov_exponents(&Dop853, (t, z), options, plan, &mut exponents).unwrap();
        exponents
    };
    // The directions settle first.
    run(&mut t, &mut z, (1.0, 20));
    let found = run(&mut t, &mut z, (0.5, 20));
    assert!((t - 30.0).abs() < 1e-12);
    assert!((found[0] - 0.5).abs() < 1e-9 && (found[1] + 2.0).abs() < 1e-9, "{found:?}");
}

#[test]
fn exponents_of_the_attractor_of_lorenz_are_those_in_print() {
    let systems = [Lorenz::new(Dual::constant(28.0)); 3];
    let variational = Variational::<_, _, [f64; 12]>::new(&systems, [Dual::ZERO; 3]);
    let mut z = [0.0; 12];
    z[..3].copy_from_slice(&[1.0, 2.0, 20.0]);
    (0..3).for_each(|k| z[3 + 4 * k] = 1.0);
    let (mut t, mut exponents) = (0.0, [0.0; 3]);
    let options = Options::adaptive(1e-9, 1e-9);
    for n in [40, 2000] {
        variational
            .lyapunov_exponents(&Dop853, (&mut t, &mut z), options, (0.25, n), &mut exponents)
            .unwrap();
    }
    // The sum is the divergence, which is constant; the others converge as one over the time, 500 here.
    let sum: f64 = exponents.iter().sum();
    assert!((sum + 41.0 / 3.0).abs() < 1e-6, "{exponents:?}");
    assert!((exponents[0] - 0.9056).abs() < 0.03 && exponents[1].abs() < 0.02, "{exponents:?}");
}

#[test]
fn dependent_directions_are_refused_and_nothing_is_lost() {
    let variational = Variational::<_, _, [f64; 6]>::new(&[Linear, Linear], [Dual::ZERO; 2]);
    let (mut t, mut z) = (1.0, [0.3, 0.4, 1.0, 0.0, 0.0, 0.0]);
    let before = z;
    let mut exponents = [0.0; 2];
    let plan = (0.5, 3);
    let options = Options::adaptive(1e-9, 1e-9);
    let found = variational.lyapunov_exponents(&Dop853, (&mut t, &mut z), options, plan, &mut exponents);
    assert!(matches!(found, Err(Error::Failure(Failure::NonFinite { index: 4, .. }))), "{found:?}");
    assert_eq!((t, z), (1.0, before));
    let found = variational.lyapunov_exponents(&Dop853, (&mut t, &mut z), options, (0.0, 3), &mut exponents);
    assert_eq!(found, Err(Error::StepSize { value: 0.0 }));
}

#[test]
#[should_panic(expected = "at least one direction")]
fn no_direction_is_told() {
    let _ = Variational::<f64, Linear, [f64; 2]>::new(&[], [Dual::ZERO; 2]);
}
