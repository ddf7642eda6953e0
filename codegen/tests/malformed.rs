//! Valid models whose programs were once malformed, and random ones like them: whatever the form of the constraint, a
//! scene is built, and its accelerations are those of the multiplier form.
//!
//! The cases are the same in every run;
//! `PROPTEST_CASES=5000 cargo test --release -p hamel-codegen --test main malformed` goes on from there.

use std::path::Path;

use hamel_codegen::expr::rational_to_f64;
use hamel_codegen::scene::{self, BuiltScene};
use hamel_codegen::spec::{self, Model};
use proptest::prelude::*;
use proptest::sample::select;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};

fn parsed(text: &str) -> Model {
    spec::parse("m.hamel", text).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

fn built(text: &str, scene: &str) -> BuiltScene {
    scene::build(&parsed(text), scene).unwrap_or_else(|e| panic!("{e}\n{text}"))
}

/// The text with one more item.
fn with_item(text: &str, item: &str) -> String {
    let end = text.rfind('}').expect("a model ends with a brace");
    format!("{}    {item}\n}}\n", &text[..end])
}

/// Rates by name at a state given by name; none next to a singularity, or where nothing can be computed.
fn rates(scene: &BuiltScene, value: impl Fn(&str) -> f64) -> Option<Vec<(String, f64)>> {
    let params: Vec<f64> = scene.params().iter().map(|p| rational_to_f64(&p.default)).collect();
    let names = scene.state_names();
    let state: Vec<f64> = names.iter().map(|name| value(name)).collect();
    let interpreter = scene.prepare(&params).ok()?;
    interpreter.check(0.3, &state).ok()?;
    let mut rates = vec![f64::NAN; state.len()];
    interpreter.rhs(0.3, &state, &mut rates);
    Some(names.into_iter().zip(rates).collect())
}

/// Compares the eliminated form with the multiplier form at a few states; how many of them could be.
fn compare(text: &str) -> usize {
    compare_with(text, text)
}

/// As [`compare`], the multiplier form being that of another text.
fn compare_with(text: &str, for_multipliers: &str) -> usize {
    let velocities: Vec<String> =
        parsed(text).all_velocities().into_iter().map(|(name, _)| name.to_owned()).collect();
    // The dependent velocities are values of the eliminated form.
    let with_output = with_item(text, &format!("output all_velocities = [{}];", velocities.join(", ")));
    let eliminated = built(&with_output, scene::DEFAULT);
    let multipliers = built(&with_item(for_multipliers, "multipliers; scene motion { want rhs; }"), "motion");
    let mut n_compared = 0;
    for round in 0..6u32 {
        let component = |name: &str| {
            let seed = name.bytes().fold(round + 1, |h, b| h.wrapping_mul(31).wrapping_add(u32::from(b)));
            f64::from(seed.wrapping_mul(2_654_435_761) >> 8) / f64::from(1u32 << 24) - 0.5
        };
        let Some(own) = rates(&eliminated, component) else { continue };
        let params: Vec<f64> = eliminated.params().iter().map(|p| rational_to_f64(&p.default)).collect();
        let state: Vec<f64> = eliminated.state_names().iter().map(|name| component(name)).collect();
        let interpreter = eliminated.prepare(&params).expect("prepared before");
        let outputs = interpreter.outputs(0.3, &state);
        let all = &outputs[outputs.len() - velocities.len()..];
        let value = |name: &str| {
            velocities.iter().position(|v| v == name).map_or_else(|| component(name), |k| all[k])
        };
        let Some(other) = rates(&multipliers, value) else { continue };
        let largest = other.iter().fold(1.0, |m: f64, (_, rate)| m.max(rate.abs()));
        // Rates as large as that come from a matrix that is nearly singular in one of the two forms.
        if largest.is_nan() || largest >= 1e4 {
            continue;
        }
        n_compared += 1;
        for (name, rate) in &own {
            let Some((_, expected)) = other.iter().find(|(n, _)| n == name) else { continue };
            assert!(rate.is_finite(), "{name}: {rate}\n{text}");
            // Both forms lose some digits of the largest rate where a pivot is small.
            let error = (rate - expected).abs() / largest;
            assert!(error < 1e-8, "{name}: {rate}, by multipliers {expected}\n{text}");
        }
    }
    n_compared
}

fn case(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/malformed").join(name);
    std::fs::read_to_string(path).unwrap()
}

#[test]
fn a_virtual_condition_with_a_rational_coefficient_in_velocities() {
    assert!(compare(&case("malformed_check.hamel")) >= 4);
}

#[test]
fn a_unicycle_whose_wheel_cannot_slide() {
    let text = case("malformed_program.hamel");
    // Multipliers need inertia along the velocity that the constraint keeps at zero; how much does not matter.
    let with_inertia = text.replace("1/2*dot(oT, IT*oT);", "1/2*dot(oT, IT*oT) + v2^2/2;");
    assert_ne!(with_inertia, text);
    assert!(compare_with(&text, &with_inertia) >= 4);
}

#[test]
fn a_unicycle_with_its_constraints_eliminated() {
    assert!(compare(&case("unicycle_eliminated.hamel")) >= 4);
}

/// A number with one digit after the point, zero excluded.
fn number() -> impl Strategy<Value = String> {
    (prop_oneof![-9..0i32, 1..10i32])
        .prop_map(|n| format!("({}.{})", if n < 0 { "-0" } else { "0" }, n.abs()))
}

/// A coefficient: a number, a parameter, or a function of a coordinate or a velocity that may be rational.
fn coefficient(arguments: &'static [&'static str]) -> impl Strategy<Value = String> {
    (number(), number(), select(arguments), 0..6usize).prop_map(|(p, q, x, kind)| match kind {
        0 => p,
        1 => format!("({p} + a*{q})"),
        2 => format!("({p} + {q}*cos({x}))"),
        3 => format!("(2 + a + {q}*sin({x}))"),
        4 => format!("({p} + {q}*{x}/(2 + {x}^2))"),
        _ => format!("(a*{p} + b*{q}*{x}^2)"),
    })
}

/// Three velocities in an algebra, a metric and gyroscopic terms, one constraint, and a condition on virtual
/// displacements that may depend on velocities.
fn model() -> impl Strategy<Value = String> {
    let algebra = select(
        &[
            "algebra g = so(3);",
            "algebra g = se(2);",
            "algebra g = heisenberg(1);",
            "algebra g { basis e1, e2, e3; [e1, e2] = e2; [e1, e3] = e2 + e3; }",
            "algebra g { basis e1, e2, e3; [e1, e2] = e2; [e1, e3] = -e3; }",
        ][..],
    );
    let side = select(&["left", "right"][..]);
    const COORDINATE: &[&str] = &["x"];
    const VELOCITY: &[&str] = &["y1", "y2", "x", "x_dot"];
    let metric = (coefficient(COORDINATE), coefficient(COORDINATE), coefficient(COORDINATE));
    let constraint = (coefficient(COORDINATE), coefficient(COORDINATE), coefficient(COORDINATE));
    let displacement = (coefficient(VELOCITY), coefficient(VELOCITY), any::<bool>());
    (algebra, side, metric, constraint, displacement, coefficient(VELOCITY)).prop_map(
        |(algebra, side, (m1, m2, m3), (c1, c2, c3), (d1, d2, is_virtual), force)| {
            let condition = if is_virtual {
                format!("virtual delta(y3) + {d1}*delta(y1) + {d2}*delta(x_dot) = 0;")
            } else {
                String::new()
            };
            format!(
                "model random {{
    param a = 0.7; param b = 1.3 where b > 0;
    {algebra}
    coordinate x in real;
    velocity y1, y2, y3 in g;
    action {side};
    lagrangian = 1.5*y1^2 + 1.3*b*y2^2 + 1.2*y3^2 + x_dot^2 + ({m1}*y3 + {m2}*y2 + {m3}*x_dot)^2/2 + {m1}*y1 - {c2};
    force y1 = {force} - 0.3*y1;
    constraint {c1}*y1 + {c2}*x_dot + y3 + 0*{c3} = {c3}*y2;
    {condition}
}}
"
            )
        },
    )
}

#[test]
fn random_constraints_have_the_accelerations_of_the_multiplier_form() {
    let cases = std::env::var("PROPTEST_CASES").ok().and_then(|n| n.parse().ok()).unwrap_or(6);
    let config = Config { cases, failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let n_compared = std::cell::Cell::new(0);
    let outcome = runner.run(&model(), |text| {
        n_compared.set(n_compared.get() + compare(&text));
        Ok(())
    });
    outcome.unwrap_or_else(|e| panic!("{e}"));
    assert!(n_compared.get() > 4 * cases as usize, "only {} states compared", n_compared.get());
}
