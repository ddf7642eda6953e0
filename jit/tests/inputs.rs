//! Functions that read inputs, in memory and interpreted, bit for bit on numbers and on lanes.

use hamel_codegen::{scene, spec};
use hamel_jit::Compiled;
use hamel_program::program::{Point, Program, Run};
use hamel_runtime::{F64x4, F64x8};

use crate::{Lanes, registers};

const TEXT: &str = "model pushed {
    param m = 1.3 where m > 0;
    input push: vector(2) = [0.5, 0];
    coordinate x, y in real;
    lagrangian = m*(x_dot^2 + y_dot^2 + x_dot*y_dot*cos(x - y))/2;
    force x_dot = push1*cos(y) - push2^2;
    force y_dot = push2*x_dot;
    output power = push1*cos(y)*x_dot;
}";

#[test]
fn inputs_are_read_where_they_are_held() {
    let model = spec::parse("pushed.hamel", TEXT).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, scene::CONTROLLED).unwrap_or_else(|e| panic!("{e}"));
    let program = built.program();
    for most in registers() {
        let compiled = Compiled::new(program).unwrap().with_registers_up_to(most);
        hold::<F64x4>(&compiled, program);
        hold::<F64x8>(&compiled, program);
    }
}

fn hold<L: Lanes>(compiled: &Compiled, program: &Program) {
    let params = [1.3];
    let held = program.prepare(&params).unwrap();
    assert_eq!(held[held.len() - 2..], [0.5, 0.0]);
    for (k, function) in program.functions.iter().enumerate() {
        let mut lanes = vec![L::ZERO; function.results.len()];
        let lane = |of: &dyn Fn(f64) -> f64| L::of(|lane| of(lane as f64));
        let inputs_of = |x: f64| [0.3 * x - 0.2, 1.1 - x];
        let mut prepared: Vec<L> = held.iter().map(|x| L::from_f64(*x)).collect();
        let n = prepared.len();
        for i in 0..2 {
            prepared[n - 2 + i] = lane(&|x| inputs_of(x)[i]);
        }
        let state_of = |x: f64| [0.1 * x, 0.4, -0.3 * x, 0.9];
        let state: Vec<L> = (0..4).map(|i| lane(&|x| state_of(x)[i])).collect();
        let point = Point { t: L::ZERO, state: &state, argument: &[] };
        Run::<L>::run_at(compiled, k, &[L::from_f64(1.3)], &prepared, point, &mut lanes);
        for lane in 0..L::WIDTH {
            let x = lane as f64;
            let mut prepared = held.clone();
            prepared[n - 2..].copy_from_slice(&inputs_of(x));
            let state = state_of(x);
            let point = Point { t: 0.0, state: &state, argument: &[] };
            let (mut own, mut other) = (vec![0.0; lanes.len()], vec![0.0; lanes.len()]);
            Run::<f64>::run_at(compiled, k, &params, &prepared, point, &mut own);
            program.run_at(k, &params, &prepared, point, &mut other);
            for ((own, other), lanes) in own.iter().zip(&other).zip(&lanes) {
                let name = function.role.name();
                assert_eq!(own.to_bits(), other.to_bits(), "{name}");
                assert_eq!(lanes.lane(lane).to_bits(), other.to_bits(), "{name}, lane {lane}");
            }
        }
    }
}
