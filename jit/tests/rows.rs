//! Rows of the midpoint rule in one loop against their substeps by the interpreter, in every kind of registers.

use hamel_codegen::{scene, spec};
use hamel_jit::{Compiled, Registers};
use hamel_program::program::{Operand, Point, Program, Role, Run};
use hamel_runtime::{F64x4, F64x8, Real};

use crate::{Lanes, registers, splat};

/// Rates with the time, an input, roots, angles, a component that is one of the state, and a number that is kept.
const MOVED: &str = "
    model moved {
        param a = 3/2;
        param b = 1/3;
        input push = 0.2;
        coordinate x in real;
        coordinate theta in angle;
        coordinate phi in angle;
        let u = x + a*sin(theta);
        let w = sqrt(1 + x^2)/(2 + cos(theta - phi));
        lagrangian = (x_dot^2 + (1 + x^2)*theta_dot^2 + 2*phi_dot^2 + x_dot*phi_dot*cos(theta - phi))/2
            - u*w*(x^2 - b*cos(phi)) - x*cos(t)/3;
        force x_dot = push;
    }
";

/// Rates that are components of the state and parameters, without any operation.
const PLAIN: &str = "model plain { param k = 2; coordinate x in real; lagrangian = x_dot^2/2 - k*x; }";

const PARAMS: [f64; 2] = [1.4, 0.35];

fn program(text: &str) -> Program {
    let model = spec::parse("row.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let scene = if model.inputs.is_empty() { "default" } else { scene::CONTROLLED };
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}")).into_program()
}

fn lane<L: Lanes>(values: &[L], k: usize) -> Vec<f64> {
    values.iter().map(|x| x.lane(k)).collect()
}

/// A row over a step by substeps, one after the other.
fn substeps(
    program: &Program,
    values: (&[f64], &[f64]),
    (t, h): (f64, f64),
    half: usize,
    (start, first): (&[f64], &[f64]),
) -> Vec<f64> {
    let rate = program.function_idx(&Role::Rate).unwrap();
    let n = start.len();
    let eta = h * (1.0 / (2 * half) as f64);
    let mut t = t + eta;
    let (mut even, mut odd) = (vec![0.0; n], first.iter().map(|f| eta * f).collect::<Vec<f64>>());
    let mut slope = vec![0.0; n];
    let mut substep = |at: &[f64], to: &mut [f64]| {
        let state: Vec<f64> = start.iter().zip(at).map(|(y, at)| y + at).collect();
        let point = Point { t, state: &state, argument: &[] };
        program.run_at(rate, values.0, values.1, point, &mut slope);
        to.iter_mut().zip(&slope).for_each(|(to, slope)| *to = Real::mul_add(eta + eta, *slope, *to));
        t += eta;
    };
    substep(&odd, &mut even);
    for _ in 1..half {
        substep(&even, &mut odd);
        substep(&odd, &mut even);
    }
    even.extend(odd);
    even
}

/// The first row that differs from that of `expected`, where there is code for rows.
fn first_other<L: Lanes>(compiled: &Compiled, expected: &Program) -> Option<String> {
    let rate = expected.function_idx(&Role::Rate).unwrap();
    let params = &PARAMS[..expected.params.len()];
    let prepared = expected.prepare(params).unwrap();
    let wide: (Vec<L>, Vec<L>) = (splat(params), splat(&prepared));
    let n = expected.state.len();
    let number = |k: usize| L::of(|lane| ((3 * k + lane) as f64 * 0.7).sin());
    for n_rows in 1..=7 {
        let start: Vec<L> = (0..n).map(number).collect();
        let slope: Vec<L> = (n..2 * n).map(number).collect();
        let mut increments = vec![L::from_f64(f64::NAN); 2 * n * n_rows];
        let times = (number(90), number(91) * L::from_f64(0.5));
        let values = (&wide.0[..], &wide.1[..]);
        if !compiled.run_rows(rate, values, times, (&start, &slope), &mut increments) {
            return None;
        }
        for (row, found) in increments.chunks_exact(2 * n).enumerate() {
            let half = n_rows - row;
            for k in 0..L::WIDTH {
                let times = (times.0.lane(k), times.1.lane(k));
                let own = substeps(
                    expected,
                    (params, &prepared),
                    times,
                    half,
                    (&lane(&start, k), &lane(&slope, k)),
                );
                let found = lane(found, k);
                if found.iter().zip(&own).any(|(a, b)| a.to_bits() != b.to_bits()) {
                    return Some(format!(
                        "{} substeps of {n_rows} rows, lane {k}: {found:?} and {own:?}",
                        2 * half
                    ));
                }
            }
        }
    }
    None
}

/// Whether this processor runs rows: a simple one has code wherever any has.
fn has_rows(compiled: &Compiled) -> bool {
    let rate = compiled_rate(compiled);
    compiled.is_wide::<F64x4>(rate)
}

fn compiled_rate(compiled: &Compiled) -> usize {
    <Compiled as Run<f64>>::program(compiled).function_idx(&Role::Rate).unwrap()
}

/// As many components as stay in registers, and more.
fn chain(n: usize) -> String {
    let spring = |k: usize| format!("(x{k} - x{})^2*sin(x{k} + t)/(2 + x{k}^2)", k % n + 1);
    let springs: Vec<String> = (1..=n).map(spring).collect();
    format!(
        "model chain {{ param a = 1.4; param b = 0.35; coordinate x: vector({n}) in real;
            lagrangian = dot(x_dot, x_dot)/2 - a*b*({}); }}",
        springs.join(" + ")
    )
}

#[test]
fn rows_have_the_bits_of_their_substeps() {
    let chains = [1, 2, 4, 5, 9].map(chain);
    for text in [MOVED, PLAIN].into_iter().chain(chains.iter().map(String::as_str)) {
        let program = program(text);
        for most in registers() {
            let compiled = Compiled::new(&program).unwrap().with_registers_up_to(most);
            assert_eq!(has_rows(&compiled), most >= Registers::Avx2 && cfg!(not(windows)));
            assert_eq!(first_other::<F64x4>(&compiled, &program), None, "{most:?}: {text}");
            assert_eq!(first_other::<F64x8>(&compiled, &program), None, "{most:?}: {text}");
        }
    }
}

/// An angle beyond the kernel of sine and cosine, on any lane.
#[test]
fn a_row_gives_up_where_an_angle_is_too_large() {
    fn runs<L: Lanes>(compiled: &Compiled, program: &Program, (angle, at): (f64, usize)) -> bool {
        let prepared = program.prepare(&PARAMS).unwrap();
        let mut start = splat::<L>(&vec![0.1; program.state.len()]);
        start[1] = L::of(|lane| if lane == at { angle } else { 0.1 * lane as f64 });
        let slope = vec![L::ZERO; start.len()];
        let mut increments = vec![L::ZERO; 6 * start.len()];
        let times = (L::ZERO, L::from_f64(0.1));
        let values = (splat(&PARAMS), splat(&prepared));
        let rate = compiled_rate(compiled);
        compiled.run_rows(rate, (&values.0[..], &values.1[..]), times, (&start, &slope), &mut increments)
    }
    let program = program(MOVED);
    for most in registers() {
        let compiled = Compiled::new(&program).unwrap().with_registers_up_to(most);
        assert_eq!(runs::<F64x4>(&compiled, &program, (0.4, 2)), has_rows(&compiled));
        assert_eq!(runs::<F64x8>(&compiled, &program, (0.4, 2)), has_rows(&compiled));
        for lane in 0..8 {
            assert!(lane >= 4 || !runs::<F64x4>(&compiled, &program, (1e9, lane)));
            assert!(!runs::<F64x8>(&compiled, &program, (1e9, lane)), "{most:?}, lane {lane}");
        }
    }
}

/// Another number in the place of a result is found.
#[test]
fn another_right_hand_side_is_found() {
    let program = program(MOVED);
    let mut other = program.clone();
    let rate = program.function_idx(&Role::Rate).unwrap();
    other.functions[rate].results[4].1 = Operand::State(0);
    for most in registers() {
        let compiled = Compiled::new(&other).unwrap().with_registers_up_to(most);
        assert_eq!(first_other::<F64x4>(&compiled, &program).is_some(), has_rows(&compiled));
        assert_eq!(first_other::<F64x8>(&compiled, &program).is_some(), has_rows(&compiled));
    }
}
