//! Phases of attitudes: wrong ones are found.

use hamel_codegen::scene::{Made, build_tampered};
use hamel_codegen::spec;
use hamel_program::program::{Instruction, Op, Operand, Program, Role};

/// A body with a rotor at a constant speed, and a mass that moves.
const BODY: &str = "model body {
    param I: diagonal(3) = [2.0, 1.5, 0.8] where I1 > 0, I2 > 0, I3 > 0;
    param k = 0.2;
    coordinate x in real;
    velocity Omega in so(3);
    lagrangian = 1/2*dot(Omega, I*Omega) + k*Omega1 + x_dot^2/2 + x*x_dot*Omega2/5 - x^2;
    reconstruct q in SO(3);
    scene a { want rhs, phases; }
}";

type Fault = fn(&mut Program);

fn phases(p: &Program) -> usize {
    p.function_idx(&Role::Output("phases".to_owned())).expect("phases")
}

fn negate(p: &mut Program, i: usize) {
    let k = phases(p);
    let function = &mut p.functions[k];
    let section = function.instructions.last().map_or(0, |last| last.section);
    let op = Op::Neg(function.results[i].1);
    function.instructions.push(Instruction { op, section, name: None });
    function.results[i].1 = Operand::Value(function.instructions.len() as u32 - 1);
}

fn exchange(p: &mut Program) {
    let k = phases(p);
    let results = &mut p.functions[k].results;
    let kept = results[0].1;
    results[0].1 = results[1].1;
    results[1].1 = kept;
}

#[test]
fn wrong_phases_of_an_attitude_do_not_pass() {
    let model = spec::parse("m.hamel", BODY).unwrap_or_else(|e| panic!("{e}"));
    let whole = build_tampered(&model, "a", &|_| {}).unwrap_or_else(|e| panic!("{e}"));
    assert!(whole.outputs().iter().any(|o| o.name == "phases" && o.components[0].0 == "q_geometric"));
    let faults: [(&str, Fault); 3] = [
        ("a solid angle of the other sense", |p| negate(p, 0)),
        ("a turn in the other sense", |p| negate(p, 1)),
        ("parts that are exchanged", exchange),
    ];
    for (what, fault) in faults {
        let tampered = |made: Made<'_>| {
            if let Made::Program(program) = made {
                fault(program);
            }
        };
        let problem = build_tampered(&model, "a", &tampered).map(|_| ()).expect_err(what).to_string();
        assert!(problem.contains("phases"), "{what}: {problem}");
    }
}
