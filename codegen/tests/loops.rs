//! Functions as loops over tables: emitted code against the interpreter bit for bit, and against straight-line code;
//! Taylor coefficients too.
//!
//! `loops/module.rs` is the module. Write it again with
//! `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main loops`.

use expect_test::expect_file;
use hamel_codegen::scene::{self, BuiltScene, Writing};
use hamel_codegen::spec;
use hamel_program::lower::SearchBudget;
use hamel_program::program::{Factors, Point, Role};
use hamel_runtime::{DoubleDouble, MAX_ORDER, Real, Scene};

/// The module, as a crate has it.
mod module {
    include!("loops/module.rs");
}

/// A fluid that a wave stirs, with names that emitted functions have for something else.
const TEXT: &str = "model stirred {
    /// Viscosity.
    param mu = 0.05;
    /// Frequency.
    param w = 1.3;
    param alpha = 0.3 where 1 + alpha > 0, 1 + 2*alpha > 0;
    algebra fluid = zeitlin(3);
    velocity omega in vorticity(fluid) as *;
    coordinate sums0 in real;
    action right;
    lagrangian = 1/2*sums0_dot^2 + dot(omega, (alpha*identity(8) - laplacian(fluid)^-1)*omega);
    force omega = -2*mu*omega + [cos(w*t), 0, 0, 0, sin(w*t), 0, 0, 0];
    force sums0_dot = -sums0 + re_1_0*im_1_1;
    output c = re_0_1*re_1_0*re_1_1 + im_0_1*(re_0_1 + 2*im_1_1)*(im_1_0 - mu*sums0);
    output cubed = exp(re_0_1)*im_0_1 + re_1_1^3;
    scene default { want rhs, energy, outputs, jacobian, jvp, vjp, taylor; }
}";

fn build(products: usize) -> BuiltScene {
    let model = spec::parse("stirred.hamel", TEXT).unwrap_or_else(|e| panic!("{e}"));
    let search = SearchBudget { products, ..SearchBudget::default() };
    scene::build_within(&model, "default", search).unwrap_or_else(|e| panic!("{e}"))
}

/// States and vectors that have nothing to do with each other.
fn point(seed: u32) -> ([f64; 10], [f64; 10]) {
    let mut x = 0.37 + f64::from(seed) * 0.113;
    let mut next = || {
        x = 3.9 * x.fract() * (1.0 - x.fract());
        2.0 * x - 1.0
    };
    (std::array::from_fn(|_| next()), std::array::from_fn(|_| next()))
}

#[test]
fn the_module_is_the_one_that_was_compiled() {
    let command = "UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main loops #".to_owned();
    let writing = Writing { command: Some(command), ..Writing::default() };
    expect_file!["loops/module.rs"].assert_eq(&build(1).emit_as(&writing).unwrap());
}

#[test]
fn emitted_loops_have_the_bits_of_the_interpreter() {
    let built = build(1);
    let params = [0.07, 1.1, 0.4];
    let interpreter = built.prepare(&params).unwrap();
    let compiled = module::Prepared::prepare(&params).unwrap();
    let prepared = built.program().prepare(&params).unwrap();
    for seed in 0..20 {
        let (y, v) = point(seed);
        let t = 0.1 * f64::from(seed);
        let mut rates = [[0.0; 10]; 2];
        compiled.rhs(t, &y, &mut rates[0]);
        interpreter.rhs(t, &y, &mut rates[1]);
        assert_eq!(rates[0].map(f64::to_bits), rates[1].map(f64::to_bits));
        assert_eq!(Some(compiled.energy(t, &y).to_bits()), interpreter.energy(t, &y).map(f64::to_bits));
        let outputs = interpreter.outputs(t, &y);
        let mut own: Vec<f64> = vec![0.0; outputs.len()];
        compiled.outputs_of(t, &y, &mut own);
        let bits = |x: &[f64]| x.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
        assert_eq!(bits(&own), bits(&outputs));
        for (name, found) in [("jvp", compiled.jvp(t, &y, &v)), ("vjp", compiled.vjp(t, &y, &v))] {
            let k = built.program().function_idx(&Role::Product(name.into())).unwrap();
            let mut expected = [0.0; 10];
            let point = Point { t, state: &y, argument: &v };
            built.program().run_at(k, &params, &prepared, point, &mut expected);
            assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits), "{name}");
        }
    }
}

#[test]
fn emitted_taylor_coefficients_have_the_bits_of_the_interpreter() {
    let (built, params) = (build(1), [0.07, 1.1, 0.4]);
    let interpreter = built.prepare(&params).unwrap();
    let compiled = module::Prepared::prepare(&params).unwrap();
    let jet = built.jet().unwrap();
    assert!(jet.scalars_change);
    for (seed, n_orders) in [(0, MAX_ORDER + 1), (1, MAX_ORDER + 3), (2, 9), (3, 2), (4, 1), (5, 0)] {
        let (y, _) = point(seed);
        let t = 0.1 * f64::from(seed);
        let (mut own, mut other) = (vec![[7.0; 10]; n_orders], vec![[7.0; 10]; n_orders]);
        assert!(compiled.series_of(t, &y, &mut own));
        let mut rows: Vec<&mut [f64]> = other.iter_mut().map(<[f64; 10]>::as_mut_slice).collect();
        interpreter.series(&jet, t, &y, &mut rows);
        let bits =
            |series: &[[f64; 10]]| series.as_flattened().iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
        assert_eq!(bits(&own), bits(&other), "{n_orders} orders");
        if n_orders > 1 {
            let mut rates = [0.0; 10];
            compiled.rhs(t, &y, &mut rates);
            assert_eq!((own[0], own[1]), (y, rates));
        }
        // What is beyond the highest order is left as it is.
        assert!(own.iter().skip(MAX_ORDER + 1).flatten().all(|x| *x == 7.0));
    }
}

/// The code of Taylor coefficients without its numbers: sizes of arrays and counts in the documentation.
#[test]
fn the_code_of_taylor_coefficients_does_not_grow_with_the_number_of_modes() {
    let code = |n: usize| {
        let text = format!(
            "model fluid {{
                algebra g = zeitlin({n});
                momentum omega in g as *;
                action right;
                hamiltonian = -dot(omega, laplacian(g)^-1*omega);
                scene default {{ want rhs, taylor; }}
            }}"
        );
        let model = spec::parse("fluid.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
        let search = SearchBudget { products: 1, ..SearchBudget::default() };
        let module = scene::build_within(&model, "default", search).unwrap().emit().unwrap();
        let start = module.find("::Jet<R>").unwrap();
        let code = &module[start..module[start..].find("\n}\n").unwrap() + start];
        code.chars().filter(|c| !c.is_ascii_digit()).collect::<String>()
    };
    let small = code(3);
    assert!(small.contains("add_convolutions_to"), "{small}");
    assert_eq!(small, code(7));
}

/// Which functions are loops, and what their factors are.
#[test]
fn functions_are_loops_as_far_as_they_can_be() {
    let built = build(1);
    let kinds = |role: &Role| {
        let function = built.program().function(role).unwrap();
        let terms = function.contractions.iter().flat_map(|c| &c.terms);
        terms.map(|p| (p.left, p.right)).collect::<Vec<_>>()
    };
    let rate = kinds(&Role::Rate);
    assert!(rate.contains(&(Factors::State, Factors::Scalars)), "{rate:?}");
    let jvp = kinds(&Role::Product("jvp".into()));
    assert!(jvp.iter().any(|(left, right)| [left, right].contains(&&Factors::Argument)), "{jvp:?}");
    assert!(!kinds(&Role::Energy).is_empty());
    assert!(kinds(&Role::Pivots).is_empty());
}

#[test]
fn loops_compute_what_straight_line_code_computes() {
    let (rolled, straight) = (build(1), build(usize::MAX));
    assert!(straight.program().functions.iter().all(|f| f.contractions.is_empty()));
    let params = [0.07, 1.1, 0.4].map(DoubleDouble::from);
    let mut n_compared = 0;
    for seed in 0..5 {
        let (y, v) = point(seed);
        let (y, v) = (y.map(DoubleDouble::from), v.map(DoubleDouble::from));
        let t = DoubleDouble::from(0.3 * f64::from(seed));
        for (k, function) in straight.program().functions.iter().enumerate() {
            let argument = if function.argument.is_empty() { &[][..] } else { &v[..] };
            let run = |built: &BuiltScene| {
                let prepared = built.program().prepare(&params).unwrap();
                let mut out = vec![DoubleDouble::ZERO; function.results.len()];
                built.program().run_at(k, &params, &prepared, Point { t, state: &y, argument }, &mut out);
                out
            };
            for ((a, b), (name, _)) in run(&rolled).iter().zip(run(&straight)).zip(&function.results) {
                // Prepared numbers take pi as a double.
                let off = (*a - b).hi().abs();
                assert!(off < 1e-15, "{} {name}: {off:e}", function.role);
                n_compared += 1;
            }
        }
    }
    assert!(n_compared > 400, "{n_compared}");
}
