//! Two systems by every solver, beside the runtime's own.
#![cfg(any(feature = "ode_solvers", feature = "diffsol", feature = "differential-equations"))]

use hamel_models::generated::{heavy_top_derivatives, veselova_derivatives};
use hamel_runtime::{Differentiable, Dop853, Integrator, Options, System};

const END: f64 = 2.0;

/// What is integrated: both systems have six components and their derivatives.
trait Six: Differentiable<f64> + System<f64, State = [f64; 6]> {}
impl<S: Differentiable<f64> + System<f64, State = [f64; 6]>> Six for S {}

fn heavy_top() -> (impl Six, [f64; 6]) {
    let top = heavy_top_derivatives::Prepared::new(&heavy_top_derivatives::Params::default());
    (top.unwrap(), [0.1, 0.2, 5.0, 0.0, 0.6, 0.8])
}

/// Nonholonomic: its Jacobian has the derivatives of a multiplier in it. The constraint `Omega . gamma = 0` holds at
/// the start.
fn veselova() -> (impl Six, [f64; 6]) {
    let body = veselova_derivatives::Prepared::new(&veselova_derivatives::Params::default());
    (body.unwrap(), [1.2, 0.3, -0.4, 0.0, 0.8, 0.6])
}

/// `tolerance` is on the state at the end, above the local one by the number of steps and the growth of errors; the
/// motion is larger by eight orders.
fn assert_agrees(system: &impl Six, start: [f64; 6], found: &[f64], tolerance: f64) {
    let mut solver = Integrator::new(system, Dop853, 0.0, start, Options::adaptive(1e-13, 1e-14)).unwrap();
    solver.integrate_to(END).unwrap();
    assert!(solver.state().iter().zip(start).any(|(x, start)| (x - start).abs() > 0.1));
    assert_eq!(found.len(), start.len());
    for (x, expected) in found.iter().zip(solver.state()) {
        assert!((x - expected).abs() < tolerance, "{x} and {expected}");
    }
}

/// A cart on a spring whose other end is moved, `x'' = -k (x - cos t)` with `k = 4`: it depends on time explicitly.
struct Driven;

impl System<f64> for Driven {
    type State = [f64; 2];
    fn rhs(&self, t: f64, &[x, v]: &[f64; 2], dy: &mut [f64; 2]) {
        *dy = [v, -4.0 * (x - t.cos())];
    }
}

impl Differentiable<f64> for Driven {
    fn jacobian(&self, _t: f64, _y: &[f64; 2], jacobian: &mut [[f64; 2]]) {
        jacobian.copy_from_slice(&[[0.0, 1.0], [-4.0, 0.0]]);
    }
}

impl Driven {
    const START: [f64; 2] = [0.0, 0.0];

    /// `x = (4/3) (cos t - cos 2t)`.
    fn solution(t: f64) -> [f64; 2] {
        let amplitude = 4.0 / 3.0;
        [amplitude * (t.cos() - (2.0 * t).cos()), amplitude * (2.0 * (2.0 * t).sin() - t.sin())]
    }

    /// The largest error of a state at the end.
    fn error(found: &[f64]) -> f64 {
        assert_eq!(found.len(), 2);
        found.iter().zip(Self::solution(END)).map(|(x, expected)| (x - expected).abs()).fold(0.0, f64::max)
    }
}

#[test]
fn the_runtime_integrates_a_system_with_explicit_time() {
    let options = Options::adaptive(1e-11, 1e-12);
    let mut solver = Integrator::new(&Driven, Dop853, 0.0, Driven::START, options).unwrap();
    solver.integrate_to(END).unwrap();
    assert!(Driven::error(solver.state()) < 1e-9, "{:?}", solver.state());
}

/// Runs a check on both systems.
macro_rules! both {
    ($($name:ident = $check:ident;)*) => {
        $(mod $name {
            #[test]
            fn heavy_top() {
                let (system, start) = crate::heavy_top();
                super::$check(&system, start);
            }

            #[test]
            fn veselova() {
                let (system, start) = crate::veselova();
                super::$check(&system, start);
            }
        })*
    };
}

#[cfg(feature = "ode_solvers")]
mod ode_solvers {
    use hamel_adapters::Adapter;
    use hamel_runtime::{Failure, System};
    use ode_solvers::{Dop853, Dopri5, OutputType, SVector};

    use super::{Driven, END, Six, assert_agrees};

    both! { with_dop853 = dop853; with_dopri5 = dopri5; }

    /// The error with explicit time of a method; none if it fails.
    macro_rules! error_with_time {
        ($method:ident) => {{
            let start = SVector::from(Driven::START);
            let mut solver = $method::new(Adapter(Driven), 0.0, END, END, start, 1e-11, 1e-12);
            solver.set_output(OutputType::Sparse);
            solver.integrate().ok().map(|_| Driven::error(solver.y_out().last().unwrap().as_slice()))
        }};
    }

    #[test]
    fn dopri5_is_right_with_explicit_time() {
        let error = error_with_time!(Dopri5).unwrap();
        assert!(error < 1e-9, "{error:e}");
    }

    /// What the documentation warns of. Where this fails the nodes have been put right: take the warnings back.
    #[test]
    fn dop853_is_wrong_with_explicit_time() {
        let error = error_with_time!(Dop853);
        assert!(error.is_none_or(|error| error > 1e-6), "{error:?}");
    }

    fn dop853(system: &impl Six, start: [f64; 6]) {
        let start_vector = SVector::from(start);
        let mut solver = Dop853::new(Adapter(system), 0.0, END, END, start_vector, 1e-11, 1e-12);
        solver.set_output(OutputType::Sparse);
        solver.integrate().unwrap();
        let last = solver.y_out().last().unwrap();
        Adapter(system).verify(END, &last.data.0[0]).unwrap();
        assert_agrees(system, start, last.as_slice(), 1e-9);
    }

    fn dopri5(system: &impl Six, start: [f64; 6]) {
        let start_vector = SVector::from(start);
        let mut solver = Dopri5::new(Adapter(system), 0.0, END, END, start_vector, 1e-11, 1e-12);
        solver.set_output(OutputType::Sparse);
        solver.integrate().unwrap();
        assert_agrees(system, start, solver.y_out().last().unwrap().as_slice(), 1e-9);
    }

    /// The right-hand side has a value everywhere, but the coordinate ends at one, if it does.
    struct Bounded {
        ends: bool,
    }

    impl System<f64> for Bounded {
        type State = [f64; 1];
        fn rhs(&self, _t: f64, _y: &[f64; 1], dy: &mut [f64; 1]) {
            *dy = [1.0];
        }
        fn domain(&self, t: f64, y: &[f64; 1]) -> Result<(), Failure> {
            if !self.ends || y[0] < 1.0 {
                Ok(())
            } else {
                Err(Failure::OutsideDomain { t, condition: "y < 1" })
            }
        }
    }

    #[test]
    fn the_solver_stops_at_the_end_of_the_domain() {
        let bounded = Adapter(Bounded { ends: true });
        assert_eq!(bounded.verify(0.0, &[0.5]), Ok(()));
        let outside = Err(Failure::OutsideDomain { t: 2.0, condition: "y < 1" });
        assert_eq!(bounded.verify(2.0, &[2.0]), outside);
        assert_eq!(bounded.verify(2.0, &[f64::NAN]), Err(Failure::NonFinite { t: 2.0, index: 0 }));

        let steps = |ends: bool| {
            let start = SVector::from([0.0]);
            let mut solver = Dop853::new(Adapter(Bounded { ends }), 0.0, 1e9, 1e9, start, 1e-9, 1e-9);
            solver.integrate().unwrap().accepted_steps
        };
        assert!(steps(true) < steps(false), "{} of {} steps", steps(true), steps(false));
    }
}

#[cfg(feature = "differential-equations")]
mod differential_equations {
    use differential_equations::linalg::Matrix;
    use differential_equations::prelude::*;
    use hamel_adapters::{Adapter, WithJacobian};

    use super::{Driven, END, Six, assert_agrees};

    #[test]
    fn explicit_time_is_passed_on() {
        let method = ExplicitRungeKutta::dop853().rtol(1e-11).atol(1e-12);
        let solution = IVP::ode(&Adapter(Driven), 0.0, END, Driven::START).method(method).solve().unwrap();
        let error = Driven::error(solution.y.last().unwrap());
        assert!(error < 1e-9, "{error:e}");
        let method = DiagonallyImplicitRungeKutta::kvaerno745().rtol(1e-10).atol(1e-11);
        let solution =
            IVP::ode(&WithJacobian(Driven), 0.0, END, Driven::START).method(method).solve().unwrap();
        let error = Driven::error(solution.y.last().unwrap());
        assert!(error < 1e-7, "{error:e}");
    }

    both! { with_dop853 = dop853; with_kvaerno745 = kvaerno745; with_jacobians = jacobians; }

    fn dop853(system: &impl Six, start: [f64; 6]) {
        let adapter = Adapter(system);
        let method = ExplicitRungeKutta::dop853().rtol(1e-11).atol(1e-12);
        let solution = IVP::ode(&adapter, 0.0, END, start).method(method).solve().unwrap();
        assert_agrees(system, start, solution.y.last().unwrap(), 1e-9);
    }

    fn kvaerno745(system: &impl Six, start: [f64; 6]) {
        let adapter = WithJacobian(system);
        let method = DiagonallyImplicitRungeKutta::kvaerno745().rtol(1e-10).atol(1e-11);
        let solution = IVP::ode(&adapter, 0.0, END, start).method(method).solve().unwrap();
        assert_agrees(system, start, solution.y.last().unwrap(), 1e-7);
    }

    /// Forward differences are within 1e-6 of derivatives of order one to ten; the entries themselves are larger.
    fn jacobians(system: &impl Six, start: [f64; 6]) {
        let (mut a, mut b) = (Matrix::<f64>::zeros(6, 6), Matrix::<f64>::zeros(6, 6));
        WithJacobian(system).jacobian(0.0, &start, &mut a);
        Adapter(system).jacobian(0.0, &start, &mut b);
        let mut largest = 0.0_f64;
        for row in 0..6 {
            for column in 0..6 {
                let (x, y) = (a[(row, column)], b[(row, column)]);
                assert!((x - y).abs() < 1e-5, "({row}, {column}): {x} and {y}");
                largest = largest.max(x.abs());
            }
        }
        assert!(largest > 0.5);
    }
}

#[cfg(feature = "diffsol")]
mod diffsol {
    use diffsol::{MatrixCommon as _, NalgebraLU, NalgebraMat, OdeBuilder, OdeSolverMethod as _};
    use hamel_adapters::diffsol::{
        consistent, implicit_jacobian_times, implicit_rhs, initial, jacobian_times, mass, rhs,
    };
    use hamel_runtime::{Dop853, Implicit, ImplicitInfo, Integrator, Options, System};

    use super::{Driven, END, Six, assert_agrees};

    /// The last state of what `$solver` finds.
    macro_rules! last {
        ($solver:expr, $n:expr) => {{
            let (states, ..) = $solver.unwrap().solve(END).unwrap();
            (0..$n).map(|k| states[(k, states.ncols() - 1)]).collect::<Vec<f64>>()
        }};
    }

    #[test]
    fn explicit_time_is_passed_on() {
        let builder = || OdeBuilder::<NalgebraMat<f64>>::new().rtol(1e-10).atol([1e-11]);
        let implicit = builder().rhs_implicit(rhs(&Driven), jacobian_times(&Driven));
        let implicit = implicit.init(initial(Driven::START), 2).build().unwrap();
        let error = Driven::error(&last!(implicit.bdf::<NalgebraLU<f64>>(), 2));
        assert!(error < 1e-6, "{error:e}");
        let explicit = builder().rhs(rhs(&Driven)).init(initial(Driven::START), 2).build().unwrap();
        let error = Driven::error(&last!(explicit.tsit45(), 2));
        assert!(error < 1e-8, "{error:e}");
    }

    both! { with_implicit_methods = implicit; with_tsit45 = tsit45; with_jacobians = products; }

    fn implicit(system: &impl Six, start: [f64; 6]) {
        let problem = OdeBuilder::<NalgebraMat<f64>>::new()
            .rtol(1e-10)
            .atol([1e-11])
            .rhs_implicit(rhs(system), jacobian_times(system))
            .init(initial(start), 6)
            .build()
            .unwrap();
        // Methods of low order take more steps and gather more error.
        assert_agrees(system, start, &last!(problem.bdf::<NalgebraLU<f64>>(), 6), 1e-6);
        assert_agrees(system, start, &last!(problem.esdirk34::<NalgebraLU<f64>>(), 6), 1e-6);
    }

    fn tsit45(system: &impl Six, start: [f64; 6]) {
        let problem = OdeBuilder::<NalgebraMat<f64>>::new()
            .rtol(1e-11)
            .atol([1e-12])
            .rhs(rhs(system))
            .init(initial(start), 6)
            .build()
            .unwrap();
        assert_agrees(system, start, &last!(problem.tsit45(), 6), 1e-8);
    }

    /// Columns of the Jacobian at one state after the other, so that one that is kept too long is found out.
    fn products(system: &impl Six, start: [f64; 6]) {
        let times = jacobian_times(system);
        let moved = start.map(|x| x + 0.1);
        for y in [start, moved, start] {
            let mut rows = [[0.0; 6]; 6];
            system.jacobian(0.0, &y, &mut rows);
            for column in 0..6 {
                let mut v = [0.0; 6];
                v[column] = 1.0;
                let mut out = [f64::NAN; 6];
                times(&y, &[], 0.0, &v, &mut out);
                assert_eq!(out, rows.map(|row| row[column]));
            }
        }
        assert!(rows_differ(system, &start, &moved));
    }

    /// By the implicit form and by the runtime's own integrator: the state at the end, and the algebraic equations
    /// there.
    fn assert_implicit_agrees<const N: usize, const Z: usize>(
        system: &(impl Implicit<f64, Variables = [f64; Z]> + System<f64, State = [f64; N]>),
        start: [f64; N],
        tolerance: f64,
    ) {
        let mut solver =
            Integrator::new(system, Dop853, 0.0, start, Options::adaptive(1e-13, 1e-14)).unwrap();
        solver.integrate_to(END).unwrap();
        assert!(solver.state().iter().zip(start).any(|(x, start)| (x - start).abs() > 0.1));
        let problem = OdeBuilder::<NalgebraMat<f64>>::new()
            .rtol(1e-10)
            .atol([1e-11])
            .rhs_implicit(implicit_rhs(system), implicit_jacobian_times(system))
            .mass(mass(system))
            .init(consistent(system, start), Z)
            .build()
            .unwrap();
        let found =
            [last!(problem.bdf::<NalgebraLU<f64>>(), Z), last!(problem.esdirk34::<NalgebraLU<f64>>(), Z)];
        for found in found {
            let (mut y, mut f) = ([0.0; N], [0.0; Z]);
            let z: [f64; Z] = found.try_into().unwrap();
            system.state_of(&z, &mut y);
            for (x, expected) in y.iter().zip(solver.state()) {
                assert!((x - expected).abs() < tolerance, "{x} and {expected}");
            }
            system.implicit_rhs(END, &z, &mut f);
            for (variable, f) in info(system).variables.iter().zip(f) {
                assert!(variable.is_differential || f.abs() < tolerance, "{} {f}", variable.name);
            }
        }
    }

    fn info<S: Implicit<f64>>(_: &S) -> ImplicitInfo {
        S::IMPLICIT
    }

    #[test]
    fn a_drifting_charge_by_its_implicit_form() {
        use hamel_models::generated::charged_particle_implicit as drift;
        let charge = drift::Prepared::new(&drift::Params::default()).unwrap();
        assert_eq!(drift::IMPLICIT.index, 1);
        assert_implicit_agrees(&charge, [0.6, -0.3], 1e-6);
    }

    #[test]
    fn a_sleigh_by_its_implicit_form() {
        use hamel_models::generated::chaplygin_sleigh_implicit as sleigh;
        let body = sleigh::Prepared::new(&sleigh::Params::default()).unwrap();
        assert_eq!(sleigh::IMPLICIT.index, 1);
        assert_implicit_agrees(&body, [0.4, -0.9], 1e-6);
    }

    fn rows_differ(system: &impl Six, a: &[f64; 6], b: &[f64; 6]) -> bool {
        let (mut of_a, mut of_b) = ([[0.0; 6]; 6], [[0.0; 6]; 6]);
        system.jacobian(0.0, a, &mut of_a);
        system.jacobian(0.0, b, &mut of_b);
        of_a != of_b
    }
}
