//! Taylor series by machine code of their recurrence, in every kind of registers, against the interpreter.

use hamel_codegen::scene;
use hamel_codegen::spec;
use hamel_jit::Compiled;
use hamel_program::lower::SearchBudget;
use hamel_program::program::{Jet, Operand, Program, Role, SeriesRoom};
use hamel_runtime::MAX_ORDER;

use crate::registers;

/// Functions with rules of their own, products, quotients, roots, powers, the time, and an input.
const FUNCTIONS: &str = "
    model functions {
        param a = 3/2;
        input push = 0.2;
        coordinate x in real;
        coordinate theta in angle;
        lagrangian = x_dot^2/2 + (2 + cos(theta)*sin(3*x))*theta_dot^2/2 - exp(x/9)*ln(x^2 + 2)/(1 + x^2)^(3/2)
            - sqrt(a + sin(x*theta))*atan(x - t) + tanh(x/3)*sinc(theta);
        force x_dot = push;
    }
";

/// Linear equations: nothing is convolved.
const LINEAR: &str = "model linear { param k = 2; coordinate x in real; lagrangian = x_dot^2/2 - k*x^2; }";

/// Sums over tables, which are interpreted.
const FLUID: &str = "
    model fluid {
        algebra fluid = zeitlin(3);
        momentum omega in fluid as *;
        action right;
        hamiltonian = -dot(omega, laplacian(fluid)^-1*omega);
    }
";

fn program(text: &str, products: usize) -> Program {
    let model = spec::parse("series.hamel", text).unwrap_or_else(|e| panic!("{e}"));
    let scene = if model.inputs.is_empty() { "default" } else { scene::CONTROLLED };
    let search = SearchBudget { products, ..SearchBudget::default() };
    scene::build_within(&model, scene, search).unwrap_or_else(|e| panic!("{e}")).into_program()
}

/// The coefficients in bits, of two expansions in the same room.
fn expanded(jet: &Jet, by: Option<&Compiled>) -> Vec<u64> {
    let params: Vec<f64> = (0..jet.program.params.len()).map(|k| 1.4 + 0.3 * k as f64).collect();
    let prepared = jet.program.prepare(&params).unwrap();
    let n_inputs = jet.program.inputs.len();
    let u: Vec<Vec<f64>> = (0..4).map(|k| vec![0.3 - 0.1 * f64::from(k); n_inputs]).collect();
    let mut room = SeriesRoom::default();
    let mut all = Vec::new();
    for (start, order) in [(0.4, MAX_ORDER), (0.7, 9)] {
        let y: Vec<f64> = (0..jet.n_state).map(|i| start - 0.43 * i as f64).collect();
        for u in [None, Some(&u[..])] {
            let mut rows = vec![vec![f64::NAN; jet.n_state]; order + 1];
            let mut out: Vec<&mut [f64]> = rows.iter_mut().map(Vec::as_mut_slice).collect();
            match by {
                Some(run) => jet.series_by(run, &mut room, (&params, &prepared), (0.2, &y), u, &mut out),
                None => match u {
                    Some(u) => jet.series_with((&params, &prepared), (0.2, &y), u, &mut out),
                    None => jet.series(&params, &prepared, 0.2, &y, &mut out),
                },
            }
            all.extend(rows.iter().flatten().map(|x| x.to_bits()));
        }
    }
    assert!(all.iter().all(|bits| f64::from_bits(*bits).is_finite()));
    all
}

/// Many series side by side.
fn chain(n: usize) -> String {
    let spring = |k: usize| format!("(x{k} - x{})^2*sin(x{k} + t)/(2 + x{k}^2)", k % n + 1);
    let springs: Vec<String> = (1..=n).map(spring).collect();
    format!(
        "model chain {{ coordinate x: vector({n}) in real; lagrangian = dot(x_dot, x_dot)/2 - ({}); }}",
        springs.join(" + ")
    )
}

#[test]
fn series_have_the_bits_of_the_interpreter() {
    let texts = [FUNCTIONS.to_owned(), LINEAR.to_owned(), chain(2), chain(5)];
    let programs = texts.iter().map(|text| program(text, usize::MAX)).chain([program(FLUID, 1)]);
    for program in programs {
        let jet = Jet::new(&program, program.function_idx(&Role::Rate).unwrap()).unwrap();
        let expected = expanded(&jet, None);
        for most in registers() {
            let compiled = Compiled::new(&jet.program).unwrap().with_registers_up_to(most);
            compiled.compile(false).unwrap();
            assert_eq!(expanded(&jet, Some(&compiled)), expected, "{most:?}: {:?}", program.state);
        }
    }
}

/// Another number in the place of a factor of a convolution is found.
#[test]
fn another_recurrence_is_found() {
    let program = program(FUNCTIONS, usize::MAX);
    let jet = Jet::new(&program, program.function_idx(&Role::Rate).unwrap()).unwrap();
    let expected = expanded(&jet, None);
    let mut other = jet.program.clone();
    let factor = other.functions[Jet::NEXT].results.last_mut().unwrap();
    factor.1 = Operand::State(0);
    let compiled = Compiled::new(&other).unwrap();
    assert_ne!(expanded(&jet, Some(&compiled)), expected);
}
