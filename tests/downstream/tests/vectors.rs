//! A module in the types of `nalgebra`: the numbers are those of arrays, and the motion of a free body is the known
//! one.

use hamel_downstream::kite::{Params, Prepared, State};
use hamel_runtime::nalgebra::{Isometry3, SMatrix, SVector, UnitQuaternion, Vector3};
use hamel_runtime::{Differentiable, Dop853, Integrator, Options, System};

fn start() -> State {
    let attitude = UnitQuaternion::from_euler_angles(0.3, -0.8, 1.1);
    State::from_array([0.0; 13])
        .with_Omega(Vector3::new(1.0, 3.0, 0.5))
        .with_V(Vector3::new(2.0, -0.5, 0.25))
        .with_place(Isometry3::from_parts(Vector3::new(0.0, 0.0, 10.0).into(), attitude))
}

#[test]
fn vectors_have_the_bits_of_arrays() {
    let params = Params::default().with_I(Vector3::new(0.35, 0.2, 0.45));
    let prepared = Prepared::new(&params).unwrap();
    let (arrays, vectors) = (prepared, prepared.on_vectors());
    let y = start().to_vector();

    let mut rate = [0.0; 13];
    System::rhs(&arrays, 0.0, y.as_ref(), &mut rate);
    assert_eq!(vectors.derivative(0.0, &y), SVector::from(rate));

    let mut rows = [[0.0; 13]; 13];
    Differentiable::jacobian(&arrays, 0.0, y.as_ref(), &mut rows);
    let jacobian: SMatrix<f64, 13, 13> = vectors.jacobian_matrix(0.0, &y);
    assert_eq!(jacobian, SMatrix::<f64, 13, 13>::from_fn(|i, j| rows[i][j]));
    assert!(jacobian.norm() > 1.0);

    let options = Options::adaptive(1e-10, 1e-12);
    let mut plain = Integrator::new(&arrays, Dop853, 0.0, y.into(), options).unwrap();
    let mut solver = Integrator::new(&vectors, Dop853, 0.0, y, options).unwrap();
    plain.integrate_to(2.0).unwrap();
    solver.integrate_to(2.0).unwrap();
    assert_eq!(*solver.state(), SVector::from(*plain.state()));
}

#[test]
fn a_free_body_keeps_its_momenta_in_space() {
    let params = Params::<f64>::default();
    let inertia = params.I();
    let start = start();
    let system = Prepared::new(&params).unwrap().on_vectors();
    let options = Options::adaptive(1e-12, 1e-12);
    let mut solver = Integrator::new(&system, Dop853, 0.0, start.to_vector(), options).unwrap();
    solver.integrate_to(5.0).unwrap();
    let end = State::from_vector(*solver.state());

    // The mass centre goes straight on, and the angular momentum stays where it is; errors of 1e-12 a step add up.
    let velocity = start.q() * start.V();
    let expected = start.place().translation.vector + 5.0 * velocity;
    assert!((end.place().translation.vector - expected).norm() < 1e-9);
    assert!((end.r() - expected).norm() < 1e-9);
    let momentum = |state: &State| state.q() * (inertia * state.Omega());
    assert!((momentum(&end) - momentum(&start)).norm() < 1e-9);
    assert!(start.q().angle_to(&end.q()) > 0.1 && (end.Omega() - start.Omega()).norm() > 0.1);
    let energy = |state: &State| system.system().energy(0.0, state.to_vector().as_ref());
    assert!((energy(&end) / energy(&start) - 1.0).abs() < 1e-10);
}
