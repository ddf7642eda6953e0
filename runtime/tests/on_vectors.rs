//! Systems on the vectors of `nalgebra`: every method has the bits that it has on arrays.

#![cfg(feature = "nalgebra")]

use hamel_runtime::nalgebra::{Matrix2, SVector, Vector2};
use hamel_runtime::{
    Convolutions, Differentiable, Dop853, Failure, Gauss6, Integrator, Invariants, Jet, MAX_ORDER, Method,
    OnVectors, Options, Pivot, Projected, Real, System, Taylor, Tsit5,
};

/// `x' = y, y' = -x^3`, which conserves `y^2/2 + x^4/4`.
#[derive(Clone, Copy)]
struct Quartic;

impl<R: Real> System<R> for Quartic {
    type State = [R; 2];

    fn rhs(&self, _t: R, y: &[R; 2], dy: &mut [R; 2]) {
        *dy = [y[1], -(y[0] * y[0] * y[0])];
    }

    fn check(&self, t: R, y: &[R; 2]) -> Result<(), Failure> {
        let mut all = Ok(());
        self.pivots(t, y, &mut |pivot| all = all.and(pivot.verify(t)));
        all
    }

    fn domain(&self, _t: R, y: &[R; 2]) -> Result<(), Failure> {
        let inside = R::from_f64(9.0).all_gt(y[0]);
        if inside { Ok(()) } else { Err(Failure::OutsideDomain { t: 0.0, condition: "x < 9" }) }
    }

    fn signature(&self, _t: R, y: &[R; 2]) -> R {
        let distance = R::from_f64(8.0) - y[0];
        distance / distance.abs()
    }

    fn pivots(&self, _t: R, y: &[R; 2], visit: &mut dyn FnMut(Pivot<R>)) {
        visit(Pivot { name: "distance", value: R::from_f64(8.0) - y[0], scale: R::ZERO });
    }
}

impl<R: Real> Differentiable<R> for Quartic {
    fn jacobian(&self, _t: R, y: &[R; 2], jacobian: &mut [[R; 2]]) {
        let slope = R::from_f64(-3.0) * y[0] * y[0];
        for (row, values) in jacobian.iter_mut().zip([[R::ZERO, R::ONE], [slope, R::ZERO]]) {
            *row = values;
        }
    }
}

impl<R: Real> Invariants<R, 1> for Quartic {
    fn values(&self, _t: R, y: &[R; 2]) -> [R; 1] {
        let square = y[0] * y[0];
        [R::from_f64(0.5) * y[1] * y[1] + R::from_f64(0.25) * square * square]
    }

    fn gradients(&self, _t: R, y: &[R; 2], gradients: &mut [[R; 2]; 1]) {
        gradients[0] = [y[0] * y[0] * y[0], y[1]];
    }
}

/// The oscillator `x' = y, y' = -x`, whose series needs no products.
#[derive(Clone, Copy)]
struct Oscillator;

impl System<f64> for Oscillator {
    type State = [f64; 2];

    fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [y[1], -y[0]];
    }
}

impl Jet<f64> for Oscillator {
    type Workspace = Convolutions<f64, 1>;

    fn workspace(&self) -> Self::Workspace {
        Convolutions::default()
    }

    fn series(&self, _t: f64, y: &[f64; 2], _workspace: &mut Self::Workspace, out: &mut [[f64; 2]]) {
        let mut coefficient = *y;
        for (out, k) in out.iter_mut().take(MAX_ORDER + 1).zip(1_u32..) {
            *out = coefficient;
            coefficient = [coefficient[1] / f64::from(k), -coefficient[0] / f64::from(k)];
        }
    }
}

/// States at the end and half-way, and the number of steps, on arrays and on vectors.
fn same_bits<S, M>(system: S, method: M, options: Options<f64>)
where
    S: System<f64, State = [f64; 2]> + Copy,
    M: Method<f64, S> + Method<f64, OnVectors<S, 2>>,
{
    let start = [1.3, -0.4];
    let vectors = OnVectors::new(system);
    let mut plain = Integrator::new(&system, method, 0.0, start, options).unwrap();
    let mut solver = Integrator::new(&vectors, method, 0.0, Vector2::from(start), options).unwrap();
    let (mut expected, mut found) = (Vec::new(), Vec::new());
    plain.sample(3.0, [0.7, 1.9], |_, y| expected.push(*y)).unwrap();
    solver.sample(3.0, [0.7, 1.9], |_, y| found.push((*y).into())).unwrap();
    expected.push(*plain.state());
    found.push((*solver.state()).into());
    assert_eq!(bits(&expected), bits(&found));
    assert_eq!(plain.stats(), solver.stats());
    assert!(plain.stats().steps > 2);
}

fn bits(states: &[[f64; 2]]) -> Vec<[u64; 2]> {
    states.iter().map(|y| y.map(f64::to_bits)).collect()
}

#[test]
fn methods_have_the_bits_that_they_have_on_arrays() {
    let adaptive = Options::adaptive(1e-9, 1e-11);
    same_bits(Quartic, Dop853, adaptive);
    same_bits(Quartic, Tsit5, adaptive);
    same_bits(Quartic, Gauss6::newton(), Options::fixed(0.1));
    same_bits(Quartic, Projected::<_, 1>::new(Tsit5), Options::fixed(0.1));
    same_bits(Oscillator, Taylor::default(), adaptive);
}

#[test]
fn derivatives_and_jacobians_are_vectors_and_matrices() {
    let system = OnVectors::new(Quartic);
    let y = Vector2::new(2.0, 0.5);
    assert_eq!(system.derivative(0.0, &y), Vector2::new(0.5, -8.0));
    assert_eq!(system.jacobian_matrix(0.0, &y), Matrix2::new(0.0, 1.0, -12.0, 0.0));
    let [energy] = Invariants::<f64, 1>::values(system.system(), 0.0, y.as_ref());
    assert_eq!(energy, 4.125);
}

#[test]
fn failures_are_those_of_the_system() {
    let system = OnVectors::new(Quartic);
    let singular = Vector2::new(8.0, 0.0);
    let refused = Integrator::new(&system, Tsit5, 0.0, singular, Options::fixed(0.1)).unwrap_err();
    assert_eq!(refused, Failure::Singular { t: 0.0, pivot: "distance" }.into());
    let outside = Vector2::new(9.5, 0.0);
    let refused = Integrator::new(&system, Tsit5, 0.0, outside, Options::fixed(0.1)).unwrap_err();
    assert_eq!(refused, Failure::OutsideDomain { t: 0.0, condition: "x < 9" }.into());
    let mut solver =
        Integrator::new(&system, Tsit5, 0.0, Vector2::new(7.9, 20.0), Options::fixed(0.02)).unwrap();
    assert_eq!(solver.integrate_to(1.0), Err(Failure::ChangedSign { t: 0.02, pivot: "distance" }.into()));
}

#[test]
fn vectors_of_single_precision_are_states_too() {
    let system = OnVectors::new(Quartic);
    let start = SVector::<f32, 2>::new(1.0, 0.0);
    let mut solver = Integrator::new(&system, Tsit5, 0.0, start, Options::adaptive(1e-5, 1e-6)).unwrap();
    solver.integrate_to(1.0).unwrap();
    let [energy] = Quartic.values(solver.t(), solver.state().as_ref());
    assert!((energy - 0.25).abs() < 1e-4, "{energy}");
}
