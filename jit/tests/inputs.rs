//! Functions that read inputs, in memory and interpreted, bit for bit on numbers and on lanes.

use hamel_codegen::{scene, spec};
use hamel_jit::Compiled;
use hamel_program::program::{Point, Run};
use hamel_runtime::F64x4;

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
    let compiled = Compiled::new(program).unwrap();
    let params = [1.3];
    let held = program.prepare(&params).unwrap();
    assert_eq!(held[held.len() - 2..], [0.5, 0.0]);
    for (k, function) in program.functions.iter().enumerate() {
        let mut lanes = vec![F64x4::splat(0.0); function.results.len()];
        let lane = |of: &dyn Fn(f64) -> f64| F64x4::new([0.0, 1.0, 2.0, 3.0].map(of));
        let inputs_of = |x: f64| [0.3 * x - 0.2, 1.1 - x];
        let mut prepared: Vec<F64x4> = held.iter().map(|x| F64x4::splat(*x)).collect();
        let n = prepared.len();
        for i in 0..2 {
            prepared[n - 2 + i] = lane(&|x| inputs_of(x)[i]);
        }
        let state_of = |x: f64| [0.1 * x, 0.4, -0.3 * x, 0.9];
        let state: Vec<F64x4> = (0..4).map(|i| lane(&|x| state_of(x)[i])).collect();
        let point = Point { t: F64x4::splat(0.0), state: &state, argument: &[] };
        compiled.run_at(k, &[F64x4::splat(1.3)], &prepared, point, &mut lanes);
        for x in 0..4_u8 {
            let mut prepared = held.clone();
            prepared[n - 2..].copy_from_slice(&inputs_of(f64::from(x)));
            let state = state_of(f64::from(x));
            let point = Point { t: 0.0, state: &state, argument: &[] };
            let (mut own, mut other) = (vec![0.0; lanes.len()], vec![0.0; lanes.len()]);
            compiled.run_at(k, &params, &prepared, point, &mut own);
            program.run_at(k, &params, &prepared, point, &mut other);
            for ((own, other), lanes) in own.iter().zip(&other).zip(&lanes) {
                let name = function.role.name();
                assert_eq!(own.to_bits(), other.to_bits(), "{name}");
                assert_eq!(lanes.lane(usize::from(x)).to_bits(), other.to_bits(), "{name}, lane {x}");
            }
        }
    }
}
