//! No text makes the pipeline panic: mutated specs and random, nearly valid models are parsed, checked and, where they
//! are small, derived, lowered and emitted.
//!
//! The cases are the same in every run. `PROPTEST_CASES=100000 cargo test --release -p hamel-codegen --test main fuzz`
//! goes on from there; a failing text is printed after shrinking and belongs into `found_by_fuzzing` below.

use std::path::Path;

use hamel_codegen::scene;
use hamel_codegen::spec::{self, Model};
use proptest::prelude::*;
use proptest::sample::{Index, select};
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

/// Largest graph of a model that is derived here; larger ones only cost time.
const MAX_NODES: usize = 1500;

/// Runs a text as far as it goes; how far is counted.
fn run(text: &str) -> Reached {
    let model = match spec::parse("fuzz.hamel", text) {
        Ok(model) => model,
        Err(problems) => {
            assert!(!problems.is_empty(), "failed without a problem");
            problems.iter().for_each(|p| assert!(!p.message.is_empty()));
            assert!(problems.render(true).len() >= problems.render(false).len());
            return Reached::Refused;
        }
    };
    if !is_small(&model) {
        return Reached::Checked;
    }
    let mut reached = Reached::Checked;
    for name in scene::names(&model) {
        match scene::build(&model, &name) {
            Ok(built) => {
                let text = built.emit().unwrap_or_else(|e| panic!("{e}"));
                assert!(!text.contains("NaN"), "{text}");
                reached = Reached::Emitted;
            }
            Err(problems) => {
                let text = problems.to_string();
                assert!(!text.contains("please report this"), "{text}");
            }
        }
    }
    reached
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Reached {
    Refused,
    Checked,
    Emitted,
}

fn is_small(model: &Model) -> bool {
    let n_state = model.all_velocities().len() + model.base.len() + model.advected.len();
    n_state <= 10 && model.graph.n_nodes() <= MAX_NODES
}

/// Runs a property on the same cases every time.
fn for_all<S: Strategy>(n_cases: u32, strategy: S, property: impl Fn(S::Value) -> Reached) -> [usize; 3] {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(n_cases);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let counts = std::cell::Cell::new([0; 3]);
    let outcome = runner.run(&strategy, |value| {
        let mut so_far = counts.get();
        so_far[property(value) as usize] += 1;
        counts.set(so_far);
        Ok(())
    });
    outcome.unwrap_or_else(|e| panic!("{e}"));
    counts.get()
}

/// The specs of the repository.
fn specs() -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/specs");
    let mut files: Vec<_> = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files.iter().map(|file| std::fs::read_to_string(file).unwrap()).collect()
}

/// Words, numbers and single characters, with the blanks before them; comments are left out.
fn tokens(text: &str) -> Vec<String> {
    let mut tokens: Vec<String> = Vec::new();
    for line in text.lines().filter(|line| !line.trim_start().starts_with("//")) {
        let mut last = ' ';
        for c in line.chars().chain(['\n']) {
            let word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '.';
            match tokens.last_mut() {
                Some(token) if last.is_whitespace() || word(last) && word(c) => token.push(c),
                _ => tokens.push(c.to_string()),
            }
            last = c;
        }
    }
    tokens
}

#[derive(Clone, Debug)]
enum Mutation {
    Delete,
    Repeat,
    Swap,
    Replace(&'static str),
    Insert(&'static str),
    /// Another token of the same text.
    Copy(Index),
}

const PIECES: &[&str] = &[
    "0",
    "1",
    "2",
    "-1",
    "1/0",
    "0.5",
    "1e400",
    "(",
    ")",
    "[",
    "]",
    "{",
    "}",
    ";",
    ",",
    "=",
    ":",
    "+",
    "-",
    "*",
    "/",
    "^",
    "^2",
    "^(1/2)",
    "t",
    "pi",
    "Omega",
    "Omega1",
    "v",
    "Gamma",
    "sqrt(2)",
    "norm",
    "dot",
    "cross(",
    "identity(3)",
    "so(3)",
    "se(2)",
    "R^3",
    "R",
    "in",
    "by",
    "where",
    "> 0",
    "!= 0",
    "scene",
    "constraint",
    "multipliers;",
    "action right;",
    "stage s;",
    "independent",
    "virtual",
    "delta(",
    "ddt(",
    "connection mechanical;",
    "quasi_velocity s;",
    "drop",
];

fn mutation() -> impl Strategy<Value = Mutation> {
    prop_oneof![
        Just(Mutation::Delete),
        Just(Mutation::Repeat),
        Just(Mutation::Swap),
        select(PIECES).prop_map(Mutation::Replace),
        select(PIECES).prop_map(Mutation::Insert),
        any::<Index>().prop_map(Mutation::Copy),
    ]
}

#[test]
fn mutated_specs_do_not_panic() {
    let specs = specs();
    let changes = prop::collection::vec((any::<Index>(), mutation()), 1..4);
    let counts = for_all(400, (any::<Index>(), changes), |(which, changes)| {
        let mut list = tokens(&specs[which.index(specs.len())]);
        for (place, change) in changes {
            let at = place.index(list.len());
            match change {
                Mutation::Delete if list.len() > 1 => drop(list.remove(at)),
                Mutation::Delete => {}
                Mutation::Repeat => list.insert(at, list[at].clone()),
                Mutation::Swap => {
                    let other = (at + 1) % list.len();
                    list.swap(at, other);
                }
                Mutation::Replace(piece) => list[at] = format!(" {piece} "),
                Mutation::Insert(piece) => list.insert(at, format!(" {piece} ")),
                Mutation::Copy(from) => list[at] = list[from.index(list.len())].clone(),
            }
        }
        run(&list.concat())
    });
    // Otherwise the mutations test nothing but the parser.
    assert!(counts[Reached::Refused as usize] > 0 && counts[Reached::Emitted as usize] > 0, "{counts:?}");
}

/// An expression of any shape over the names that [`model`] declares.
fn expression() -> impl Strategy<Value = String> {
    let names = &[
        "a", "b", "k", "I", "I1", "x", "x_dot", "y", "y_dot", "omega", "v", "v1", "v2", "Gamma", "Gamma1",
        "Gamma2", "t", "pi", "s",
    ];
    let numbers = &["0", "1", "2", "3", "1/2", "0.1", "1e-3", "10"];
    let leaf = prop_oneof![6 => select(&names[..]), 2 => select(&numbers[..])].prop_map(str::to_owned);
    leaf.prop_recursive(4, 16, 3, |inner| {
        let function = select(
            &[
                "sin",
                "cos",
                "tan",
                "exp",
                "ln",
                "sqrt",
                "abs",
                "norm",
                "transpose",
                "diag",
                "det",
                "trace",
                "sum",
                "hat",
                "asin",
                "tanh",
                "delta",
                "ddt",
                "identity",
            ][..],
        );
        let operator = select(&["+", "-", "*", "/"][..]);
        let power = select(&["2", "-1", "1/2", "(-1/2)", "3", "0", "1/3", "x"][..]);
        prop_oneof![
            4 => (inner.clone(), operator, inner.clone()).prop_map(|(a, o, b)| format!("({a} {o} {b})")),
            2 => (inner.clone(), power).prop_map(|(a, n)| format!("({a})^{n}")),
            2 => (function, inner.clone()).prop_map(|(f, a)| format!("{f}({a})")),
            1 => (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("dot({a}, {b})")),
            1 => (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("[{a}, {b}]")),
            1 => (inner, 1..4_usize).prop_map(|(a, n)| format!("{a}[{n}]")),
        ]
    })
}

/// A number: entries of vectors and products of what may have a shape.
fn number() -> impl Strategy<Value = String> {
    let names = &[
        "a",
        "b",
        "k",
        "I1",
        "x",
        "x_dot",
        "y_dot",
        "omega",
        "v1",
        "v2",
        "Gamma1",
        "Gamma2",
        "dot(v, v)",
        "t",
        "2",
    ];
    let leaf = select(&names[..]).prop_map(str::to_owned);
    leaf.prop_recursive(3, 10, 2, |inner| {
        let function = select(&["sin", "cos", "exp", "sqrt", "abs", "ln", "tanh"][..]);
        let operator = select(&["+", "-", "*", "*", "/"][..]);
        let power = select(&["2", "-1", "(1/2)", "(-3/2)", "3", "(1/3)"][..]);
        prop_oneof![
            4 => (inner.clone(), operator, inner.clone()).prop_map(|(a, o, b)| format!("({a} {o} {b})")),
            1 => (inner.clone(), power).prop_map(|(a, n)| format!("({a})^{n}")),
            1 => (function, inner).prop_map(|(f, a)| format!("{f}({a})")),
        ]
    })
}

/// An optional item of a model that may or may not be right.
fn item() -> impl Strategy<Value = String> {
    let velocity = select(&["omega", "v", "v1", "v2", "x_dot", "y_dot", "s", "w"][..]);
    let stem = || select(&["x", "y", "v", "v1", "omega", "Gamma", "Gamma1", "a", "I", "k", "h"][..]);
    prop_oneof![
        (velocity.clone(), number()).prop_map(|(v, e)| format!("constraint {v} = {e};")),
        number().prop_map(|e| format!("constraint {e} = 0;")),
        (velocity.clone(), number()).prop_map(|(v, e)| format!("constraint ddt({v}) + {e} = 0;")),
        (velocity.clone(), velocity.clone(), number())
            .prop_map(|(v, w, e)| format!("virtual delta({v}) + ({e})*delta({w}) = 0;")),
        expression().prop_map(|e| format!("virtual {e} = 0;")),
        prop::collection::vec(velocity.clone(), 1..4).prop_map(|v| format!("independent {};", v.join(", "))),
        Just("multipliers;".to_owned()),
        Just("quasi_velocity s;".to_owned()),
        Just("action right;".to_owned()),
        (velocity.clone(), expression()).prop_map(|(v, e)| format!("force {v} = {e};")),
        number().prop_map(|e| format!("casimir c = {e};")),
        expression().prop_map(|e| format!("output h = {e};")),
        (number(), expression()).prop_map(|(a, b)| format!("section p = [{a}, 1, {b}];")),
        expression().prop_map(|e| format!("let k = {e};")),
        expression().prop_map(|e| format!("require {e} > 0;")),
        select(&["trivial", "mechanical", "nonholonomic"][..]).prop_map(|c| format!("connection {c};")),
        (velocity, number()).prop_map(|(v, e)| format!("connection {v} = {e};")),
        Just("stage whole; stage translations = ideal(v);".to_owned()),
        (number(), number()).prop_map(|(a, b)| format!("inner_product = diag([1, {a}, {b}]);")),
        select(
            &[
                "theta, X, Y in SE(2)",
                "theta in SO(2) from omega",
                "X in R^2 from v",
                "psi by omega*x",
                "R, X in matrices(SE(2))",
                "R, X in semidirect(SO(2), standard)",
            ][..]
        )
        .prop_map(|r| format!("reconstruct {r};")),
        (stem(), number()).prop_map(|(n, e)| format!("initial {n} = {e};")),
        (select(&["box", "disk", "ball", "segment", "path", "cone"][..]), expression(), expression())
            .prop_map(|(shape, a, b)| format!("view shown = {shape}({a}) at {b} attitude {a};")),
        (stem(), select(&["0", "1", "-2", "[1, 2]", "1/3"][..]))
            .prop_map(|(n, q)| format!("scene one {{ fix {n} = {q}; want energy; }}")),
        (
            stem(),
            select(
                &[
                    "rhs",
                    "energy",
                    "momentum",
                    "multipliers",
                    "h",
                    "c",
                    "outputs",
                    "energy_rate",
                    "phases",
                    "p",
                ][..]
            )
        )
            .prop_map(|(n, w)| format!("scene two {{ want {w}; drop {n}; }}")),
    ]
}

/// A model that is right but for its random items.
fn model() -> impl Strategy<Value = String> {
    let advected = select(
        &[
            "",
            "advected Gamma in R^2 by omega*[-Gamma2, Gamma1];",
            "advected Gamma in R^2 by omega*[Gamma2, Gamma1];",
            "advected Gamma in R^2 by [v1, v2];",
        ][..],
    );
    let base = select(
        &["", "coordinate x in (0, 1);", "coordinate x, y in angle;", "coordinate x in (a, 3*a);"][..],
    );
    let algebra = select(&["se(2)", "product(R, R^2)", "heisenberg(1)", "semidirect(so(2), standard)"][..]);
    let kinetic = select(
        &[
            "I1*omega^2 + dot(v, v)",
            "omega^2 + (v1 + v2)^2",
            "omega^2 + v1*v2 + v2^2",
            "a*omega^2 + b*dot(v, v) + omega*v1",
        ][..],
    );
    let items = prop::collection::vec(item(), 0..5);
    (advected, base, algebra, kinetic, number(), items).prop_map(
        |(advected, base, algebra, kinetic, potential, items)| {
            let rates = match base {
                "" => "",
                b if b.contains("y") => " + x_dot^2 + y_dot^2",
                _ => " + x_dot^2",
            };
            format!(
                "model fuzz {{
    param a = 2; param b = 1 where b > 0; param I: diagonal(2) = [1, 3];
    velocity omega, v in {algebra};
    {base} {advected}
    lagrangian = ({kinetic}{rates})/2 + {potential};
    {}
}}",
                items.join("\n    ")
            )
        },
    )
}

#[test]
fn random_models_do_not_panic() {
    let counts = for_all(400, model(), |text| run(&text));
    assert!(counts.iter().all(|n| *n > 0), "{counts:?}");
}

#[test]
fn random_expressions_do_not_panic() {
    let counts = for_all(400, expression(), |e| {
        run(&format!(
            "model fuzz {{ param a = 2; param b = 1; param k = 3; param I: diagonal(2) = [1, 3]; coordinate x, y in real;
             velocity omega, v in se(2); advected Gamma in R^2 by omega*[-Gamma2, Gamma1]; quasi_velocity s;
             lagrangian = omega^2 + dot(v, v) + x_dot^2 + y_dot^2; output h = {e}; constraint v1 = s; }}"
        ))
    });
    assert!(counts[Reached::Refused as usize] > 0 && counts[Reached::Emitted as usize] > 0, "{counts:?}");
}

/// Texts that once made the pipeline panic.
mod found_by_fuzzing {
    use super::{Reached, run};

    #[test]
    fn more_quasi_velocities_than_constraints_beside_virtual_conditions() {
        let text = "model m { velocity omega, v in se(2); quasi_velocity s; lagrangian = omega^2 + dot(v, v);
                     virtual delta(v1) + 2*delta(v2) = 0; }";
        assert_eq!(run(text), Reached::Checked);
    }

    #[test]
    fn more_nonlinear_constraints_than_velocities() {
        let text = "model m { velocity v in R; lagrangian = v^2; constraint v^2 = 1; constraint v^3 = 1;
                     virtual delta(v) = 0; }";
        assert_eq!(run(text), Reached::Checked);
    }

    #[test]
    fn numbers_beyond_f64() {
        let velocity = "velocity v in R; lagrangian";
        assert_eq!(run(&format!("model m {{ param a = 1e400; {velocity} = a*v^2; }}")), Reached::Refused);
        assert_eq!(run(&format!("model m {{ param a = 1e-400; {velocity} = a*v^2; }}")), Reached::Refused);
        assert_eq!(
            run(&format!("model m {{ param a = 1; {velocity} = a*v^2; scene s {{ fix a = 1e350; }} }}")),
            Reached::Refused
        );
        assert_eq!(
            run(&format!(
                "model m {{ coordinate q in real; {velocity} = v^2 + q_dot^2 + 1e300*1e300*q^3; }}"
            )),
            Reached::Checked
        );
        assert_eq!(
            run(&format!("model m {{ coordinate q in real; {velocity} = v^2 + q_dot^2 + 1e-350*q^3; }}")),
            Reached::Checked
        );
    }
}
