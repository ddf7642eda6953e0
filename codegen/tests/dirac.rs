//! Matrices of reduced Dirac structures: motions by hand are in them, wrong ones are found.

use std::collections::BTreeMap;

use hamel_codegen::scene::{self, Made, build_tampered};
use hamel_codegen::spec;
use hamel_expr::SymbolId;
use hamel_mechanics::mechanics::DiracStructure;
use hamel_mechanics::reduction::{Formulation, reduce};
use hamel_program::program::{Constant, Instruction, Op, Operand, Program, Role};

const TOP: &str = "model top {
    param I: diagonal(3) = [1.3, 1.7, 0.6] where I1 > 0, I2 > 0, I3 > 0;
    param k = 0.7;
    param chi: vector(3) = [0, 0.6, 0.8];
    velocity Omega in so(3);
    advected Gamma in R^3 by cross(Omega, Gamma);
    lagrangian = dot(Omega, I*Omega)/2 - k*dot(Gamma, chi);
    scene a { want rhs, dirac; }
}";

/// Two constraints are parametrised by a velocity of their own.
const BOARD: &str = "model board {
    param m = 2.5 where m > 0;
    param r = 0.6 where r > 0;
    coordinate psi, phi in angle;
    velocity omega, v in se(2);
    quasi_velocity s;
    lagrangian = m/2*dot(v, v) + 3/10*omega^2 + (omega + psi_dot)^2/25 + (omega + phi_dot)^2/50 + (omega - phi_dot)^2/50;
    constraint forward: v1 = -r*cos(phi)*s;
    constraint sideways: v2 = 0;
    constraint turning: omega = sin(phi)*s;
    scene a { want rhs, momentum, dirac; }
}";

/// A frame of lifts that depends on the shape, the action from the right, an affine constraint.
const PARTS: &str = "model parts {
    coordinate x: vector(2) in real;
    velocity v in so(3);
    action right;
    connection mechanical;
    lagrangian = dot(x_dot, x_dot) + v1^2 + 2*v2^2 + (3 + x2^2)*v3^2 + x1*x_dot[2]*v1/4 - x1*x_dot[1]*v2;
    constraint edge: v3 = x1*v1 + t;
    scene a { want rhs, dirac; }
}";

/// The matrices `F` and `E` at a state, `[2 n][2 n]`.
fn matrices(text: &str, y: &[f64], n: usize) -> [Vec<Vec<f64>>; 2] {
    let model = spec::parse("m.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "a").unwrap_or_else(|e| panic!("{e}"));
    let prepared = built.prepare(&defaults(&model)).unwrap_or_else(|e| panic!("{e}"));
    let values = prepared.output("dirac", 0.0, y).unwrap();
    assert_eq!(values.len(), 8 * n * n);
    let (flows, efforts) = values.split_at(4 * n * n);
    [flows, efforts].map(|m| m.chunks(2 * n).map(<[f64]>::to_vec).collect())
}

fn defaults(model: &spec::Model) -> Vec<f64> {
    model.params.iter().map(|p| hamel_expr::rational_to_f64(&p.default)).collect()
}

fn is_in([flows, efforts]: &[Vec<Vec<f64>>; 2], flow: &[f64], effort: &[f64], tolerance: f64) -> bool {
    let along = |row: &[f64], x: &[f64]| row.iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
    flows.iter().zip(efforts).all(|(f, e)| (along(f, flow) + along(e, effort)).abs() < tolerance)
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[test]
fn the_motion_of_a_top_is_in_its_structure() {
    let (omega, gamma, chi) = ([0.4, -0.3, 2.0], [0.36, 0.48, 0.8], [0.0, 0.6, 0.8]);
    let found = matrices(TOP, &[omega, gamma].concat(), 3);
    let momentum = [1.3 * omega[0], 1.7 * omega[1], 0.6 * omega[2]];
    let torque = cross(gamma, chi).map(|x| 0.7 * x);
    let turned = cross(momentum, omega);
    let rates: Vec<f64> = (0..3).map(|k| turned[k] + torque[k]).collect();
    let effort = [torque.map(|x| -x), omega].concat();
    assert!(is_in(&found, &[omega.as_slice(), &rates].concat(), &effort, 1e-14));
    let other = [torque.map(|x| 1.01 * -x), omega].concat();
    assert!(!is_in(&found, &[omega.as_slice(), &rates].concat(), &other, 1e-4));
}

/// Without forces the efforts along velocities vanish.
#[test]
fn the_motion_of_a_snakeboard_is_in_its_structure() {
    let model = spec::parse("m.hamel", BOARD).unwrap_or_else(|e| panic!("{e}"));
    let built = scene::build(&model, "a").unwrap_or_else(|e| panic!("{e}"));
    let params = defaults(&model);
    let prepared = built.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
    let y = [0.3, 0.7, 0.9, -0.4, 1.1];
    let mut rates = [0.0; 5];
    prepared.rhs(0.0, &y, &mut rates);
    let momenta = |h: f64| {
        let at: Vec<f64> = y.iter().zip(rates).map(|(y, d)| y + h * d).collect();
        prepared.output("momentum", 0.0, &at).unwrap()
    };
    let h = 1e-5;
    let slope: Vec<f64> = momenta(h).iter().zip(momenta(-h)).map(|(a, b)| (a - b) / (2.0 * h)).collect();
    // psi_dot, phi_dot, then omega, v1, v2 by s.
    let (phi, s) = (y[1], y[4]);
    let velocities = [y[2], y[3], phi.sin() * s, -0.6 * phi.cos() * s, 0.0];
    let found = matrices(BOARD, &y, 5);
    let flow = [velocities.as_slice(), &slope].concat();
    assert!(is_in(&found, &flow, &[[0.0; 5], velocities].concat(), 1e-8));
    // Two conditions on displacements, that of the parametrised pair among them.
    let [flows, efforts] = &found;
    assert!(efforts[..2].iter().flatten().all(|x| *x == 0.0) && flows[1][2] != 0.0 && flows[1][3] != 0.0);
    let sideways = [[0.0, 0.0, 0.0, 0.0, 0.1], [0.0; 5]].concat();
    assert!(!is_in(&found, &sideways, &[0.0; 10], 1e-3));
}

type Fault = fn(&mut Program, usize);

/// The value at a place with the other sign.
fn negate(p: &mut Program, i: usize) {
    let k = p.function_idx(&Role::Output("dirac".to_owned())).expect("dirac");
    let last = p.sections.len() as u32 - 1;
    let function = &mut p.functions[k];
    let section = function.instructions.last().map_or(last, |last| last.section);
    let op = Op::Neg(function.results[i].1);
    function.instructions.push(Instruction { op, section, name: None });
    function.results[i].1 = Operand::Value(function.instructions.len() as u32 - 1);
}

fn drop_entry(p: &mut Program, i: usize) {
    let k = p.function_idx(&Role::Output("dirac".to_owned())).expect("dirac");
    p.constants.push(Constant::Rational(hamel_expr::Rational::from_integer(0.into())));
    p.functions[k].results[i].1 = Operand::Constant(p.constants.len() as u32 - 1);
}

/// Every entry that is not zero, with another sign and left out.
#[test]
fn wrong_entries_do_not_pass() {
    for text in [TOP, BOARD, PARTS] {
        let model = spec::parse("m.hamel", text).unwrap_or_else(|e| panic!("{e}"));
        let whole = scene::build(&model, "a").unwrap_or_else(|e| panic!("{e}"));
        let output = whole.outputs().iter().find(|o| o.name == "dirac").unwrap();
        let y: Vec<f64> = (0..whole.state_names().len()).map(|k| 0.3 + 0.17 * k as f64).collect();
        let prepared = whole.prepare(&defaults(&model)).unwrap_or_else(|e| panic!("{e}"));
        let values = prepared.output("dirac", 0.4, &y).unwrap();
        let places: Vec<usize> = (0..values.len()).filter(|i| values[*i] != 0.0).collect();
        assert!(places.len() > 15);
        let n = 2 * (values.len() / 8).isqrt();
        let faults: [(bool, Fault); 2] = [(true, negate), (false, drop_entry)];
        for (i, (is_sign, fault)) in places.iter().step_by(3).flat_map(|i| faults.map(|fault| (*i, fault))) {
            let row = i / n % n;
            // A row of one entry says the same with the other sign.
            if is_sign && places.iter().filter(|i| **i / n % n == row).count() == 1 {
                continue;
            }
            let tampered = |made: Made<'_>| {
                if let Made::Program(program) = made {
                    fault(program, i);
                }
            };
            let name = &output.components[i].0;
            let problem = build_tampered(&model, "a", &tampered).map(|_| ()).expect_err(name).to_string();
            assert!(problem.contains("dirac"), "{name}: {problem}");
        }
    }
}

#[test]
fn structures_without_matrices_are_refused() {
    for (items, reason) in [
        (
            "velocity w in so(3); lagrangian = dot(w, w); constraint w1 = 0; multipliers;",
            "multipliers keep constraints",
        ),
        ("coordinate q, p in real; lagrangian = p*q_dot - p^2 - q^2;", "no displacement is left"),
    ] {
        let text = format!("model m {{ {items} scene a {{ want rhs, dirac; }} }}");
        let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
        let problem = scene::build(&model, "a").map(|_| ()).unwrap_err().to_string();
        assert!(problem.contains(reason), "{problem}");
    }
}

/// For people: displacements of the board are along its motions, whatever the velocity of its own is.
#[test]
fn displacements_along_a_velocity_of_their_own_are_told() {
    let model = spec::parse("m.hamel", BOARD).unwrap_or_else(|e| panic!("{e}"));
    let system = reduce(&model, &Formulation::of(&model)).unwrap_or_else(|e| panic!("{e}"));
    let found = DiracStructure::new(&system);
    assert!(found.has_own_velocities);
    let (phi, r) = (0.7_f64, 0.6);
    let mut values: BTreeMap<SymbolId, f64> = found.eta.iter().copied().zip([0.0; 5]).collect();
    values.extend([(model.base[1].symbol, phi), (model.params[1].symbol, r)]);
    let mut size = |eta: [f64; 5]| -> f64 {
        values.extend(found.eta.iter().copied().zip(eta));
        let residuals = found.annihilator.iter().map(|e| found.graph.eval_f64(*e, &values).unwrap().abs());
        residuals.fold(0.0, f64::max)
    };
    assert!(size([0.3, -0.2, phi.sin() * 1.1, -r * phi.cos() * 1.1, 0.0]) < 1e-15);
    for wrong in [[0.0, 0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 0.0, 1.0]] {
        assert!(size(wrong) > 0.1, "{wrong:?}");
    }
}
