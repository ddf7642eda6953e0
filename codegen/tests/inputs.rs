//! Inputs of a model: emitted code, the interpreter and machine-independent identities against one another.
//!
//! `inputs/module.rs` is the module. Write it again with
//! `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main inputs`.

use expect_test::expect_file;
use hamel_codegen::scene::{self, BuiltScene, Derivative, Writing};
use hamel_codegen::spec;
use hamel_runtime::{
    Controlled, ControlledJet, Differentiable, Dop853, Dual, F64x4, InputDifferentiable, Integrator,
    Interpolation, Jet, Options, OverScalar, Polynomial, PolynomialSignal, Real, Scene, System, Table,
    Taylor, Vern9, WithInput,
};

/// The module, as a crate has it.
mod module {
    include!("inputs/module.rs");
}

/// A cart with a pendulum, pushed, whose motor turns the pendulum as well.
const TEXT: &str = "model pushed {
    param m = 1 where m > 0;
    param l = 0.5 where l > 0;
    param c = 0.1;
    /// Push [N] and torque [N m].
    input tau: vector(2) = [0, 0.25];
    coordinate x in real;
    coordinate theta in angle;
    /// Called like the argument of the functions.
    velocity u in R;
    lagrangian = m*x_dot^2 + m/2*(l^2*theta_dot^2 + 2*l*x_dot*theta_dot*cos(theta)) - 9.81*m*l*cos(theta) + u^2/2;
    force x_dot = tau1 - c*x_dot;
    force theta_dot = tau2*cos(x);
    force u = -u*tau2^2;
    output tip = x + l*sin(theta);
    output power = tau1*x_dot + tau2*cos(x)*theta_dot - u^2*tau2^2;
    event slow = x_dot - tau1 rising { then x_dot = 0; }
    scene driven { input tau; want energy, energy_rate, outputs, events, linearization, taylor, jvp; }
    scene half { input tau2; fix tau1 = 2; want energy; }
    scene still { want energy; }
}";

const PARAMS: [f64; 3] = [1.3, 0.4, 0.2];

fn build(scene: &str) -> BuiltScene {
    let model = spec::parse("pushed.hamel", TEXT).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"))
}

fn point(seed: i32) -> (f64, [f64; 5], [f64; 2]) {
    let x = |k: i32| (f64::from(7 * seed + 3 * k) * 0.61).sin();
    (x(0), [x(1), 2.0 * x(2), x(3), x(4), x(5)], [3.0 * x(6), x(7)])
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

#[test]
fn the_module_is_the_one_that_was_compiled() {
    let command = "UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main inputs #".to_owned();
    let writing = Writing { command: Some(command), ..Writing::default() };
    expect_file!["inputs/module.rs"].assert_eq(&build("driven").emit_as(&writing).unwrap());
}

#[test]
fn emitted_functions_have_the_bits_of_the_interpreter_at_any_inputs() {
    let built = build("driven");
    let mut interpreter = built.prepare(&PARAMS).unwrap();
    let mut compiled = module::Prepared::prepare(&PARAMS).unwrap();
    assert_eq!(interpreter.inputs(), [0.0, 0.25]);
    assert_eq!(compiled.held_inputs(), &[0.0, 0.25]);
    assert_eq!(<module::Prepared as Controlled<f64, 2>>::INPUTS.map(|i| i.name), ["tau1", "tau2"]);
    let jet = built.jet().unwrap();
    for seed in 0..40 {
        let (t, y, u) = point(seed);
        let mut rates = [[0.0; 5]; 4];
        interpreter.rhs_with(t, &y, &u, &mut rates[0]);
        compiled.rhs_with(t, &y, &u, &mut rates[1]);
        interpreter.set_inputs(&u);
        compiled.hold_inputs(&u);
        interpreter.rhs(t, &y, &mut rates[2]);
        System::rhs(&compiled, t, &y, &mut rates[3]);
        for other in &rates[1..] {
            assert_eq!(bits(&rates[0]), bits(other));
        }
        let mut outputs = vec![0.0; <module::Prepared as Scene<f64>>::INFO.n_outputs()];
        compiled.outputs_of(t, &y, &mut outputs);
        assert_eq!(bits(&outputs), bits(&interpreter.outputs(t, &y)));
        let mut rows = [[0.0; 2]; 5];
        InputDifferentiable::input_jacobian(&compiled, t, &y, &mut rows);
        let columns = interpreter.matrix(Derivative::InputJacobian, t, &y).unwrap();
        for (row, other) in rows.iter().zip(columns) {
            assert_eq!(bits(row), bits(&other));
        }
        let (mut own, mut other) = ([[0.0; 5]; 9], vec![vec![0.0; 5]; 9]);
        let mut workspace = Jet::workspace(&compiled);
        Jet::series(&compiled, t, &y, &mut workspace, &mut own);
        let mut slices: Vec<&mut [f64]> = other.iter_mut().map(Vec::as_mut_slice).collect();
        interpreter.series(&jet, t, &y, &mut slices);
        for (own, other) in own.iter().zip(&other) {
            assert_eq!(bits(own), bits(other));
        }
        // Held inputs are polynomials of degree zero; here they are of degree three.
        let coefficients = [0, 1, 2, 3].map(|k| point(seed + 50 * k).2);
        compiled.series_with(t, &y, &coefficients, &mut workspace, &mut own);
        let rows = coefficients.map(|row| row.to_vec());
        let mut slices: Vec<&mut [f64]> = other.iter_mut().map(Vec::as_mut_slice).collect();
        interpreter.series_with(&jet, (t, &y), &rows, &mut slices);
        for (own, other) in own.iter().zip(&other) {
            assert_eq!(bits(own), bits(other));
        }
    }
}

/// The motion by pieces, each with a polynomial for its inputs, by a method that knows nothing of series.
fn by_pieces(signal: &impl PolynomialSignal<f64, 2>, (mut t, end): (f64, f64), mut y: [f64; 5]) -> [f64; 5] {
    let system = module::Prepared::prepare(&PARAMS).unwrap();
    while t != end {
        let mut coefficients = [[0.0; 2]; 4];
        let until = signal.piece((t, end), &mut coefficients);
        let driven = WithInput::new(system, Polynomial::new(t, coefficients));
        let mut solver = Integrator::new(&driven, Vern9, t, y, Options::adaptive(1e-14, 1e-14)).unwrap();
        solver.integrate_to(until).unwrap();
        (t, y) = (until, *solver.state());
    }
    y
}

#[test]
fn series_carry_inputs_that_are_polynomials_piece_by_piece() {
    let system = module::Prepared::prepare(&PARAMS).unwrap();
    let start = [0.1, 0.3, 0.2, -0.1, 0.5];
    let close = |what: &str, found: &[f64; 5], expected: &[f64; 5]| {
        for (a, b) in found.iter().zip(expected) {
            assert!((a - b).abs() <= 1e-12 * (1.0 + b.abs()), "{what}: {a} and {b}");
        }
    };
    let times = [0.25, 0.5, 1.25, 1.5];
    let rows = [[1.0, -0.5], [0.3, 0.8], [-1.2, 0.1], [0.4, 0.6]];
    for interpolation in [Interpolation::Linear, Interpolation::Cubic, Interpolation::Hold] {
        let table = Table::new(&times, &rows, interpolation).unwrap();
        let driven = WithInput::new(system, table);
        for options in [Options::adaptive(1e-14, 1e-14), Options::fixed(0.004)] {
            let mut solver = Integrator::new(&driven, Taylor::new(), 0.0, start, options).unwrap();
            let mut reached = Vec::new();
            while !solver.step_towards(2.0).unwrap().reached() {
                reached.push(solver.t());
            }
            let what = format!("{interpolation:?}, {options:?}");
            close(&what, solver.state(), &by_pieces(&table, (0.0, 2.0), start));
            // A step ends at every row.
            assert!(times.iter().all(|t| reached.contains(t)), "{what}: {reached:?}");
            // And on the way back, to another place than where it came from.
            let mut solver = Integrator::new(&driven, Taylor::new(), 2.0, start, options).unwrap();
            solver.integrate_to(0.7).unwrap();
            close(&what, solver.state(), &by_pieces(&table, (2.0, 0.7), start));
            solver.integrate_to(0.0).unwrap();
            close(&what, solver.state(), &by_pieces(&table, (2.0, 0.0), start));
        }
    }
    let cubic = Polynomial::new(0.5, [[1.0, 0.2], [-0.5, 0.3], [0.25, 0.0], [0.0, -0.1]]);
    let driven = WithInput::new(system, cubic);
    let options = Options::adaptive(1e-14, 1e-14);
    let mut solver = Integrator::new(&driven, Taylor::new(), 0.0, start, options).unwrap();
    solver.integrate_to(2.0).unwrap();
    close("polynomial", solver.state(), &by_pieces(&cubic, (0.0, 2.0), start));
    // One expansion a step, and nothing but the motion says how long these are.
    assert!(solver.stats().steps < 100, "{:?}", solver.stats());
}

#[test]
fn lanes_have_polynomials_of_their_own() {
    let system = module::Prepared::prepare(&PARAMS).unwrap();
    let start = [0.1, 0.3, 0.2, -0.1, 0.5];
    let slopes = [-1.0, 0.0, 0.5, 2.0];
    let signal = |slope: F64x4| {
        let [zero, one] = [0.0, 1.0].map(F64x4::splat);
        Polynomial::new(zero, [[one, zero], [slope, one]])
    };
    let driven = WithInput::new(OverScalar::over(&system, F64x4::splat), signal(F64x4::from(slopes)));
    let options = Options::adaptive(F64x4::splat(1e-14), F64x4::splat(1e-14));
    let mut solver =
        Integrator::new(&driven, Taylor::new(), F64x4::ZERO, start.map(F64x4::splat), options).unwrap();
    solver.integrate_to(F64x4::splat(2.0)).unwrap();
    for (lane, slope) in slopes.into_iter().enumerate() {
        let alone = by_pieces(&Polynomial::new(0.0, [[1.0, 0.0], [slope, 1.0]]), (0.0, 2.0), start);
        for (a, b) in solver.state().iter().zip(alone) {
            let a = a.to_array()[lane];
            assert!((a - b).abs() <= 1e-12 * (1.0 + b.abs()), "{slope}: {a} and {b}");
        }
    }
}

#[test]
fn derivatives_by_inputs_are_those_of_dual_numbers() {
    let compiled = module::Prepared::prepare(&PARAMS).unwrap();
    let duals: module::Prepared<Dual> = compiled.over(Dual::constant);
    for seed in 0..20 {
        let (t, y, u) = point(seed);
        let mut at = compiled;
        at.hold_inputs(&u);
        let (b, d) = (at.input_jacobian(t, &y), at.feedthrough(t, &y));
        for j in 0..2 {
            let moved =
                std::array::from_fn(|k| if k == j { Dual::variable(u[k]) } else { Dual::constant(u[k]) });
            let (t, y, mut dy) = (Dual::constant(t), y.map(Dual::constant), [Dual::constant(0.0); 5]);
            duals.rhs_with(t, &y, &moved, &mut dy);
            for (row, rate) in b.iter().zip(dy) {
                assert!((row[j] - rate.derivative).abs() <= 1e-13 * (1.0 + rate.derivative.abs()));
            }
            let mut moving = duals;
            moving.hold_inputs(&moved);
            for (row, value) in d.iter().zip([moving.tip(t, &y), moving.power(t, &y)]) {
                assert!((row[j] - value.derivative).abs() <= 1e-13 * (1.0 + value.derivative.abs()));
            }
        }
    }
}

#[test]
fn the_energy_changes_by_the_power_of_the_inputs() {
    let built = build("driven");
    let mut interpreter = built.prepare(&PARAMS).unwrap();
    let outputs = built.outputs();
    let place = |name: &str| {
        let before = outputs.iter().take_while(|o| o.name != name);
        before.map(|o| o.components.len()).sum::<usize>()
    };
    for seed in 0..20 {
        let (t, y, u) = point(seed);
        interpreter.set_inputs(&u);
        let values = interpreter.outputs(t, &y);
        let friction = PARAMS[2] * y[2] * y[2];
        let expected = values[place("power")] - friction;
        assert!((values[place("energy_rate")] - expected).abs() < 1e-12);
    }
}

#[test]
fn inputs_that_a_scene_does_not_take_are_numbers() {
    let text = |scene: &str| build(scene).emit().unwrap();
    let still = text("still");
    assert!(!still.contains("inputs") && !still.contains("Controlled"), "{still}");
    let without = TEXT.replace("input tau: vector(2) = [0, 0.25];", "let tau1 = 0; let tau2 = 1/4;");
    let first = without.find("scene driven").unwrap();
    let without = format!("{} scene still {{ want energy; }} }}", &without[..first]);
    let model = spec::parse("pushed.hamel", &without).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(still, scene::build(&model, "still").unwrap().emit().unwrap());
    assert_eq!(build("half").program().inputs.iter().map(|(n, _)| n.as_str()).collect::<Vec<_>>(), ["tau2"]);
    // Every model with inputs has a scene that takes them all.
    let model = spec::parse("pushed.hamel", TEXT).unwrap();
    assert!(scene::names(&model).contains(&scene::CONTROLLED.to_owned()));
    assert_eq!(build(scene::CONTROLLED).program().inputs.len(), 2);
}

#[test]
fn signals_drive_the_motion_that_the_same_functions_of_time_do() {
    let system = module::Prepared::prepare(&PARAMS).unwrap();
    let start = [0.1, 0.3, 0.2, -0.1, 0.5];
    let end = |t: f64, y: [f64; 5], driven: &dyn Fn(f64, [f64; 5]) -> [f64; 5]| driven(t, y);
    let wave = WithInput::new(system, |t: f64, _: &[f64; 5]| [t.sin(), 0.3 * t]);
    let by_closure = end(2.0, start, &|t, y| {
        let options = Options::adaptive(1e-12, 1e-12);
        let mut solver = Integrator::new(&wave, Dop853, 0.0, y, options).unwrap();
        solver.integrate_to(t).unwrap();
        *solver.state()
    });
    let declared = "input tau: vector(2) = [0, 0.25];";
    let text = TEXT.replace(declared, &format!("{declared} drive tau = [sin(t), 3/10*t];"));
    let model = spec::parse("pushed.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    assert!(model.inputs.is_empty());
    // Also where a scene would take what is driven.
    let built = scene::build(&model, "half").unwrap();
    let interpreter = built.prepare(&PARAMS).unwrap();
    let (mut dy, mut other) = ([0.0; 5], [0.0; 5]);
    for seed in 0..20 {
        let (t, y, _) = point(seed);
        interpreter.rhs(t, &y, &mut dy);
        wave.rhs(t, &y, &mut other);
        for (a, b) in dy.iter().zip(other) {
            assert!((a - b).abs() <= 1e-13 * (1.0 + b.abs()), "{a} and {b}");
        }
    }
    // A cubic through so many rows is the function up to the fourth power of their distance.
    let times: Vec<f64> = (0..=2000).map(|k| 0.001 * f64::from(k)).collect();
    let rows: Vec<[f64; 2]> = times.iter().map(|t| [t.sin(), 0.3 * t]).collect();
    let table = Table::new(&times, &rows, Interpolation::Cubic).unwrap();
    let driven = WithInput::new(system, table);
    let options = Options::adaptive(1e-11, 1e-11);
    let mut solver = Integrator::new(&driven, Dop853, 0.0, start, options).unwrap();
    solver.integrate_to(2.0).unwrap();
    for (a, b) in solver.state().iter().zip(by_closure) {
        assert!((a - b).abs() < 1e-8, "{a} and {b}");
    }
    let mut rows = [[0.0; 5]; 5];
    Differentiable::jacobian(&driven, 0.5, &start, &mut rows);
    let mut held = system;
    held.hold_inputs(&driven.inputs(0.5, &start));
    assert_eq!(rows, held.jacobian(0.5, &start));
}
