//! Names that Rust takes, in a model: the module compiles, `INFO` keeps them, results are the interpreter's.
//!
//! `reserved/names.rs` is the module. Write it again with
//! `UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main reserved`.

use expect_test::expect_file;
use hamel_codegen::emit::{MatrixText, OutputText, ParamText, SceneText, StateText, emit_scene};
use hamel_codegen::expr::{Definition, Func, Graph, Rational, Section};
use hamel_codegen::lower::{Inputs, ParamCondition, Request, SearchBudget, lower};
use hamel_codegen::program::{Jet, Program, Relation, Role};
use hamel_runtime::{Dop853, Integrator, Options, Scene as _, Taylor};

/// The module, as a crate has it.
mod names {
    include!("reserved/names.rs");
}

/// Words of Rust, what the module declares, what its functions bind, and the names that these would give way to.
const PARAMS: [&str; 22] = [
    "type",
    "type_",
    "self",
    "Self",
    "crate",
    "super",
    "R",
    "R_",
    "Some",
    "Err",
    "INFO",
    "JACOBIAN_PATTERN",
    "Params",
    "out",
    "params",
    "value",
    "condition",
    "t0",
    "c0",
    "f64",
    "core",
    "hamel_runtime",
];
const STATE: [&str; 22] = [
    "loop",
    "match",
    "y",
    "dy",
    "t1",
    "State",
    "Prepared",
    "Result",
    "Ok",
    "None",
    "workspace",
    "order",
    "coefficient",
    "k",
    "next",
    "sum0",
    "kept0",
    "derivative",
    "async",
    "gen",
    "e0",
    "v0",
];
/// Names of outputs, which are methods.
const OUTPUTS: [&str; 8] =
    ["new", "rhs", "fn", "clone", "jacobian_nonzeros", "workspace", "energy", "Default"];

/// `y_i' = -p_i y_i + d_i sin(y_(i+1))` with `d_i = p_i y_(i+1)` under the parameter's name, so that functions,
/// sections and series have variables of all these names.
fn program() -> (Program, SceneText) {
    let mut g = Graph::new();
    let params = PARAMS.map(|name| g.symbol(name));
    let time = g.symbol("the time");
    let state = STATE.map(|name| g.symbol(name));
    let n = STATE.len();
    let (mut definitions, mut rates, mut entries, mut pattern) = (vec![], vec![], vec![], vec![]);
    for i in 0..n {
        let (p, here, there) = (g.sym(params[i]), g.sym(state[i]), g.sym(state[(i + 1) % n]));
        let product = g.mul(p, there);
        let symbol = g.define(PARAMS[(i + 1) % n], product);
        definitions.push(Definition { symbol, expr: product });
        let (d, sine) = (g.sym(symbol), g.func(Func::Sin, there));
        let (damping, drive) = (g.mul(p, here), g.mul(d, sine));
        rates.push((STATE[i].to_owned(), g.sub(drive, damping)));
        let cosine = g.func(Func::Cos, there);
        let bend = g.mul(there, cosine);
        let slope = g.add(sine, bend);
        for (j, entry) in [(i, g.neg(p)), ((i + 1) % n, g.mul(p, slope))] {
            entries.push((format!("d_{i}_{j}"), entry));
            pattern.push((i, j));
        }
    }
    let mut requests = vec![
        Request { role: Role::Rate, results: rates.clone() },
        Request { role: Role::Energy, results: vec![("energy".into(), rates[0].1)] },
        Request { role: Role::Output("jacobian".into()), results: entries.clone() },
    ];
    for (output, rate) in OUTPUTS.iter().zip(&rates) {
        let results = vec![((*output).to_owned(), rate.1)];
        requests.push(Request { role: Role::Output((*output).into()), results });
    }
    let (greater, less) = (g.sym(params[0]), g.zero());
    let conditions = [ParamCondition {
        text: "type > 0".into(),
        meaning: String::new(),
        greater,
        less,
        relation: Relation::Greater,
        is_rounded: false,
    }];
    let inputs = Inputs {
        params: params.to_vec(),
        time,
        held: Vec::new(),
        state: state.to_vec(),
        signs: Default::default(),
        circles: vec![],
        arguments: Default::default(),
        divisors: Default::default(),
    };
    let sections = [Section { title: "drives".into(), definitions }];
    let program =
        lower(&mut g, &inputs, &sections, &conditions, &requests, &SearchBudget::default()).unwrap();
    let output = |name: &str, components: Vec<String>| OutputText {
        name: name.to_owned(),
        components,
        doc: String::new(),
    };
    let jacobian = output("jacobian", entries.into_iter().map(|(name, _)| name).collect());
    let outputs = OUTPUTS.iter().map(|name| output(name, vec![(*name).to_owned()]));
    let text = SceneText {
        model: "match".into(),
        scene: "default".into(),
        command: "UPDATE_EXPECT=1 cargo test -p hamel-codegen --test main reserved".into(),
        params: PARAMS
            .iter()
            .zip(1..)
            .map(|(name, k)| ParamText {
                name: (*name).into(),
                default: Rational::new(k.into(), 16.into()),
                doc: String::new(),
            })
            .collect(),
        state: STATE.iter().map(|name| StateText { name: (*name).into(), doc: String::new() }).collect(),
        outputs: [jacobian].into_iter().chain(outputs).collect(),
        matrices: vec![MatrixText {
            name: "jacobian".into(),
            shape: (n, n),
            pattern,
            is_antisymmetric: false,
            doc: "derivatives of the right-hand side".into(),
        }],
        ..SceneText::default()
    };
    (program, text)
}

#[test]
fn the_module_is_the_one_that_was_compiled() {
    let (program, text) = program();
    let jet = Jet::new(&program, program.function_idx(&Role::Rate).unwrap()).unwrap();
    let emitted = emit_scene(&program, Some(&jet), &text).unwrap();
    expect_file!["reserved/names.rs"].assert_eq(&emitted);
}

#[test]
fn the_scene_keeps_the_names_of_the_model() {
    let params: Vec<_> = names::INFO.params.iter().map(|p| p.name).collect();
    assert_eq!(params, PARAMS);
    assert_eq!(names::INFO.state, STATE);
    assert_eq!(names::INFO.outputs.len(), OUTPUTS.len() + 1);
    let refused = names::Prepared::new(&names::Params { type__2: -1.0, ..Default::default() }).unwrap_err();
    assert_eq!(refused.condition, "type > 0");
}

#[test]
fn results_are_those_of_the_interpreter() {
    let (program, _) = program();
    let params = names::Params::<f64>::default();
    let prepared = names::Prepared::new(&params).unwrap();
    let slots = program.prepare(&params.to_array()).unwrap();
    let y: [f64; 22] = std::array::from_fn(|k| 0.3 + 0.01 * k as f64);
    let (mut found, mut expected) = ([0.0; 22], [0.0; 22]);
    prepared.rhs(0.0, &y, &mut found);
    let rate = program.function_idx(&Role::Rate).unwrap();
    program.run(rate, &params.to_array(), &slots, 0.0, &y, &mut expected);
    assert_eq!(found, expected);
    assert_eq!(prepared.fn_(0.0, &y), found[2]);
    assert_eq!(prepared.rhs_2(0.0, &y), found[1]);
    assert_eq!(names::State::from_array(y).loop_, y[0]);

    let options = Options::adaptive(1e-12, 1e-14);
    let mut plain = Integrator::new(&prepared, Dop853, 0.0, y, options).unwrap();
    let mut series = Integrator::new(&prepared, Taylor::default(), 0.0, y, options).unwrap();
    plain.integrate_to(1.0).unwrap();
    series.integrate_to(1.0).unwrap();
    for (a, b) in plain.state().iter().zip(series.state()) {
        assert!((a - b).abs() < 1e-11, "{a} and {b}");
    }
    let mut outputs = vec![0.0; names::INFO.n_outputs()];
    prepared.outputs_of(0.0, &y, &mut outputs);
    assert_eq!(outputs[44..], found[..8]);
}
