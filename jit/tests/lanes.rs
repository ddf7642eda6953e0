//! Code on four and on eight lanes at once against the interpreter, in every kind of registers.

use hamel_codegen::{scene, spec};
use hamel_jit::{Compiled, Registers};
use hamel_program::program::{Op, Point, Program, Run, Signs};
use hamel_runtime::{F64x4, F64x8};

use crate::{Lanes, registers, splat};

/// More values at once than there are registers, angles, roots, quotients and signs.
const MANY: &str = "
    model many {
        param a = 3/2;
        param b = 1/3;
        coordinate x in real;
        coordinate theta in angle;
        coordinate phi in angle;
        let u = x + a*sin(theta);
        let v = x^2 - b*cos(phi);
        let w = sqrt(1 + x^2)/(2 + cos(theta - phi));
        lagrangian = (x_dot^2 + (1 + x^2)*theta_dot^2 + 2*phi_dot^2 + x_dot*phi_dot*cos(theta - phi))/2 - u*v*w;
        output all = [u*v + w, u - v*w, -u, abs(v), u*v - w*a, 1/(1 + w^2), t - u, sin(phi)*cos(theta) - sin(theta)*cos(phi),
            sin(x), cos(3*x) - w, u*theta_dot - v*phi_dot + w*x_dot, -(u*v) - w];
    }
";

fn program() -> Program {
    let model = spec::parse("many.hamel", MANY).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, "default").unwrap_or_else(|e| panic!("{e}")).into_program()
}

/// The first result that is not that of the interpreter on `expected`, over many states.
fn first_other<L: Lanes>(compiled: &Compiled, expected: &Program) -> Option<String> {
    let params = [1.4, 0.35];
    let prepared = expected.prepare(&params).unwrap();
    let special =
        [0.0, -0.0, 0.7, -2.9, 35.0, 1e-310, 411_773.9, 411_774.5, -3e17, f64::INFINITY, f64::NAN, 1e200];
    let (wide_params, wide_prepared) = (splat::<L>(&params), splat::<L>(&prepared));
    for (k, function) in expected.functions.iter().enumerate() {
        let n = function.results.len();
        for round in 0..special.len() * 13 {
            let number = |place: usize, lane: usize| {
                let usual = 0.3 + 0.1 * (round as f64) - 0.7 * (place as f64) * (lane as f64 - 1.3);
                if round % 3 == 0 {
                    special[(round * (place + 1) + 5 * lane + place) % special.len()]
                } else {
                    usual
                }
            };
            let lanes = |place: usize| L::of(|lane| number(place, lane));
            let state: Vec<L> = (1..=expected.state.len()).map(lanes).collect();
            let mut out = vec![L::ZERO; n];
            let point = Point { t: lanes(0), state: &state, argument: &[] };
            Run::<L>::run_at(compiled, k, &wide_params, &wide_prepared, point, &mut out);
            for lane in 0..L::WIDTH {
                let state: Vec<f64> = state.iter().map(|x| x.lane(lane)).collect();
                let mut own = vec![0.0; n];
                expected.run_at(
                    k,
                    &params,
                    &prepared,
                    Point { t: number(0, lane), state: &state, argument: &[] },
                    &mut own,
                );
                for (at, own) in own.iter().enumerate() {
                    let found = out[at].lane(lane);
                    if found.to_bits() != own.to_bits() && !(found.is_nan() && own.is_nan()) {
                        let name = &function.results[at].0;
                        return Some(format!("{name} at {state:?}: {found:?} and {own:?}"));
                    }
                }
            }
        }
    }
    None
}

/// Code for some registers at most.
fn compiled(program: &Program, most: Registers) -> Compiled {
    Compiled::new(program).unwrap().with_registers_up_to(most)
}

#[test]
fn every_lane_has_the_bits_of_the_interpreter() {
    let program = program();
    for most in registers() {
        let compiled = compiled(&program, most);
        let has_code = most >= Registers::Avx2 && cfg!(not(windows));
        for k in 0..program.functions.len() {
            assert_eq!(compiled.is_wide::<F64x4>(k), has_code, "all or none, by the registers");
            assert_eq!(compiled.is_wide::<F64x8>(k), has_code, "all or none, by the registers");
        }
        assert_eq!(first_other::<F64x4>(&compiled, &program), None, "{most:?}");
        assert_eq!(first_other::<F64x8>(&compiled, &program), None, "{most:?}");
    }
}

/// Values that are kept for the end take more than a page of the stack.
#[test]
fn a_frame_of_several_pages_is_touched_page_by_page() {
    fn holds<L: Lanes>(compiled: &Compiled, program: &Program, state: &[f64]) {
        let prepared = program.prepare(&[0.3, 1.0]).unwrap();
        for (k, function) in program.functions.iter().enumerate() {
            let mut own = vec![0.0; function.results.len()];
            program.run_at(k, &[0.3, 1.0], &prepared, Point { t: 0.5, state, argument: &[] }, &mut own);
            let mut out = vec![L::from_f64(f64::NAN); own.len()];
            let state = splat::<L>(state);
            let point = Point { t: L::from_f64(0.5), state: &state, argument: &[] };
            Run::<L>::run_at(compiled, k, &splat(&[0.3, 1.0]), &splat(&prepared), point, &mut out);
            for lane in 0..L::WIDTH {
                assert!(out.iter().zip(&own).all(|(found, own)| found.lane(lane).to_bits() == own.to_bits()));
            }
        }
    }
    let n = 95;
    let product = |k: usize| format!("(x{k} - k*x{})", k % n + 1);
    let all: Vec<String> = (1..=n).map(product).collect();
    let pairs: Vec<String> = (1..=n).map(|k| format!("{}*{}", product(k), product(n + 1 - k))).collect();
    let text = format!(
        "model wide {{ param k = 0.3; param b = 1; coordinate x: vector({n}) in real; lagrangian = dot(x_dot, x_dot)/2;
            output all = [{}, {}]; }}",
        all.join(", "),
        pairs.join(", ")
    );
    let model = spec::parse("wide.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
    let program = scene::build(&model, "default").unwrap_or_else(|e| panic!("{e}")).into_program();
    let state: Vec<f64> = (0..2 * n).map(|k| (k as f64).sin()).collect();
    for most in registers() {
        let compiled = compiled(&program, most);
        holds::<F64x4>(&compiled, &program, &state);
        holds::<F64x8>(&compiled, &program, &state);
    }
}

/// A difference with its operands exchanged, and a sum with another sign; not where the sign has no part in a result,
/// as that of an angle in its cosine.
#[test]
fn most_planted_faults_are_found() {
    let program = program();
    let (mut n_found, mut n_all) = (0, 0);
    for k in 0..program.functions.len() {
        for at in 0..program.functions[k].instructions.len() {
            let mut other = program.clone();
            let op = &mut other.functions[k].instructions[at].op;
            match *op {
                Op::Sub(a, b) => *op = Op::Sub(b, a),
                Op::MulAdd(signs, a, b, c) => {
                    *op = Op::MulAdd(Signs { addend: !signs.addend, ..signs }, a, b, c);
                }
                _ => continue,
            }
            let compiled = Compiled::new(&other).unwrap();
            let of_four = first_other::<F64x4>(&compiled, &program).is_some();
            assert_eq!(first_other::<F64x8>(&compiled, &program).is_some(), of_four);
            n_found += usize::from(of_four);
            n_all += 1;
        }
    }
    assert!(n_all > 20 && 2 * n_found > n_all, "{n_found} of {n_all}");
}
