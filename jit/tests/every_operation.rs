//! Models with every operation of a program, compiled in memory, against the interpreter.
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec;
use hamel_jit::{Compiled, Error};
use hamel_program::lower::SearchBudget;
use hamel_program::program::{Instruction, Op, Operand, Point, Program, Run};
use hamel_runtime::{F64x4, F64x8};

use crate::{Lanes, registers, splat};

/// The default scene, with tables from a number of products on.
fn built(text: &str, products: usize) -> BuiltScene {
    let model = spec::parse("test.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let search = SearchBudget { products, ..SearchBudget::default() };
    scene::build_within(&model, "default", search).unwrap_or_else(|e| panic!("{e}"))
}

const FUNCTIONS: &str = "
    model functions {
        param a = 3/2;
        coordinate x in real;
        coordinate theta in angle;
        lagrangian = x_dot^2/2 + (2 + cos(theta)*sin(3*x))*theta_dot^2/2 - exp(x/9)*ln(x^2 + 2);
        output all = [tan(x), asin(x/40), acos(x/40), atan(x), exp(x/7), ln(x^2 + 1), sinh(x/5), cosh(x/5), tanh(x),
            abs(x), atan2(x, theta_dot), (x^2 + 1)^(1/3), sqrt(x^2 + a), a^(1/3)*x, 1/(x^2 + a),
            sin(theta)*cos(x*theta) + sin(x), -x, t - x*theta, sinc(x), cosc(x/3), x*theta*sinc(x*theta), log(rot(e1, x)*rot(e2, theta))[1],
            log(rot(e3, theta)*rot(e1, x), [x, 1, 2])[5]];
    }
";

fn bits(x: f64) -> u64 {
    if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() }
}

#[test]
fn every_operation_has_the_bits_of_the_interpreter_on_numbers_and_on_lanes() {
    let mut program = built(FUNCTIONS, usize::MAX).into_program();
    // Rounding errors, which no formula has.
    let [x, theta] = [0, 1].map(Operand::State);
    let function = program.functions.last_mut().unwrap();
    let section = function.instructions.last().unwrap().section;
    for op in [Op::SumError(x, theta), Op::ProductError(x, theta), Op::CircleError(x, theta)] {
        let value = Operand::Value(u32::try_from(function.instructions.len()).unwrap());
        function.instructions.push(Instruction { op, section, name: None });
        function.results.push((format!("{op:?}"), value));
    }
    let program = &program;
    let is_power = |op: &Op| matches!(op, Op::Power(..));
    assert!(program.functions.iter().flat_map(|f| &f.instructions).any(|i| is_power(&i.op)), "a power");
    for most in registers() {
        let compiled = Compiled::new(program).unwrap().with_registers_up_to(most);
        compare::<F64x4>(&compiled, program);
        compare::<F64x8>(&compiled, program);
    }
}

/// Every function at special numbers, on lanes and on numbers.
fn compare<L: Lanes>(compiled: &Compiled, program: &Program) {
    let params = [1.5];
    let prepared = program.prepare(&params).unwrap();
    let special = [0.0, -0.0, 0.7, -2.9, 35.0, 1e-310, 411_774.5, -3e17, f64::INFINITY, f64::NAN];
    let mut compared = 0;
    for (k, function) in program.functions.iter().enumerate() {
        for round in 0..special.len() * 7 {
            let number =
                |place: usize, lane: usize| special[(round * (place + 1) + 3 * lane + place) % special.len()];
            let lanes = |place: usize| L::of(|lane| number(place, lane));
            let state: Vec<L> = (0..program.state.len()).map(|i| lanes(i + 1)).collect();
            let point = Point { t: lanes(0), state: &state, argument: &[] };
            let mut on_lanes = vec![L::ZERO; function.results.len()];
            Run::<L>::run_at(compiled, k, &splat(&params), &splat(&prepared), point, &mut on_lanes);
            for lane in 0..L::WIDTH {
                let state: Vec<f64> = state.iter().map(|x| x.lane(lane)).collect();
                let point = Point { t: number(0, lane), state: &state, argument: &[] };
                let (mut interpreted, mut own) =
                    (vec![0.0; function.results.len()], vec![0.0; function.results.len()]);
                program.run_at(k, &params, &prepared, point, &mut interpreted);
                Run::<f64>::run_at(compiled, k, &params, &prepared, point, &mut own);
                for (at, expected) in interpreted.iter().enumerate() {
                    let name = &function.results[at].0;
                    assert_eq!(
                        bits(own[at]),
                        bits(*expected),
                        "{name} at {state:?}: {} and {expected}",
                        own[at]
                    );
                    let lane = on_lanes[at].lane(lane);
                    assert_eq!(
                        bits(lane),
                        bits(*expected),
                        "{name} on a lane at {state:?}: {lane} and {expected}"
                    );
                    compared += usize::from(expected.is_finite());
                }
            }
        }
    }
    assert!(compared > 1000, "{compared} numbers");
}

#[test]
fn functions_that_run_through_tables_are_compiled_up_to_the_tables() {
    let scene = built(
        "model fluid {
            algebra fluid = zeitlin(3);
            momentum omega in fluid as *;
            action right;
            hamiltonian = -dot(omega, laplacian(fluid)^-1*omega);
        }",
        1,
    );
    let program = scene.program();
    assert!(program.functions.iter().any(|f| !f.contractions.is_empty()), "tables");
    let compiled = Compiled::new(program).unwrap();
    let prepared = program.prepare::<f64>(&[]).unwrap();
    let state: Vec<f64> = (0..program.state.len()).map(|i| (1.3 * i as f64).sin()).collect();
    for (k, function) in program.functions.iter().enumerate() {
        let point = Point { t: 0.5, state: &state, argument: &[] };
        let (mut interpreted, mut own) =
            (vec![0.0; function.results.len()], vec![0.0; function.results.len()]);
        program.run_at(k, &[], &prepared, point, &mut interpreted);
        Run::<f64>::run_at(&compiled, k, &[], &prepared, point, &mut own);
        assert_eq!(own, interpreted, "{}", function.role);
    }
}

#[test]
fn programs_that_break_the_rules_are_not_compiled() {
    let mut program = built(FUNCTIONS, usize::MAX).into_program();
    program.functions[0].instructions.truncate(1);
    assert!(matches!(Compiled::new(&program), Err(Error::Program { .. })));
}

#[test]
#[should_panic(expected = "numbers of components")]
fn vectors_of_other_sizes_are_refused() {
    let scene = built(FUNCTIONS, usize::MAX);
    let compiled = Compiled::new(scene.program()).unwrap();
    let prepared = scene.program().prepare(&[1.5]).unwrap();
    let point = Point { t: 0.0, state: &[0.1; 3], argument: &[] };
    Run::<f64>::run_at(&compiled, 0, &[1.5], &prepared, point, &mut [0.0; 4]);
}

/// The prepare part is compiled for many sets of parameters: with the same bits, and with the same refusals.
#[test]
fn prepared_numbers_have_the_bits_of_the_interpreter_on_numbers_and_on_lanes() {
    let scene = built(
        "model prepared {
            param a = 3/2 where a > 0;
            param b = 1;
            require a + b > 1/10;
            coordinate x in real;
            let k = sqrt(a)*exp(b/7)/3 + a^(1/3)*sin(b)*cos(b) + a/(1 + b^2);
            lagrangian = a*x_dot^2/2 - k*x^2/2 + k*ln(a)*x;
            force x_dot = -pi*b*x_dot;
        }",
        usize::MAX,
    );
    let program = scene.program();
    let compiled = Compiled::new(program).unwrap();
    let (mut refused, mut differing) = (0, 0);
    let mut before = Vec::new();
    for k in 0..400 {
        let params = [0.013 * f64::from(k) - 0.1, 0.7 - 0.005 * f64::from(k)];
        let expected = program.prepare(&params);
        let found = Run::<f64>::prepare(&compiled, &params);
        let as_bits = |values: &Vec<f64>| values.iter().copied().map(bits).collect::<Vec<u64>>();
        assert_eq!(found.as_ref().map(as_bits), expected.as_ref().map(as_bits), "{params:?}");
        refused += usize::from(expected.is_err());
        differing += usize::from(expected.as_ref().is_ok_and(|values| *values != before));
        before = expected.unwrap_or_default();
        prepared_on_lanes::<F64x4>(&compiled, program, params);
        prepared_on_lanes::<F64x8>(&compiled, program, params);
    }
    assert!(refused > 5 && differing > 300, "{refused} refused, {differing} different");
}

fn prepared_on_lanes<L: Lanes>(compiled: &Compiled, program: &Program, params: [f64; 2]) {
    let first = [params[0], params[0] + 0.25, 1.0, 2.25, params[0], 0.5, params[0] + 1.0, 3.0];
    let lanes = [L::of(|lane| first[lane]), L::from_f64(params[1])];
    let found = Run::<L>::prepare(compiled, &lanes);
    for lane in 0..L::WIDTH {
        let expected = program.prepare(&lanes.map(|x| x.lane(lane)));
        match (&found, expected) {
            (Ok(found), Ok(expected)) => {
                let found: Vec<u64> = found.iter().map(|x| bits(x.lane(lane))).collect();
                let expected: Vec<u64> = expected.into_iter().map(bits).collect();
                assert_eq!(found, expected, "{params:?}, lane {lane}");
            }
            // One lane that is refused refuses all.
            (Err(_), _) => {}
            (Ok(_), Err(refused)) => panic!("{params:?}, lane {lane}: {refused}"),
        }
    }
}
