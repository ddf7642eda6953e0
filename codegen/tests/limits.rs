//! Every limit of derivations has a message, and what is within the limits ends.
//!
//! The limits of the language itself are in `tests/bad` and beside the modules that have them.

use hamel_codegen::{scene, spec};

/// The problems that the pipeline finds in a model; empty when there are none.
fn problems(items: &str) -> String {
    let text = format!("model big {{\n{items}\n}}");
    let outcome = spec::parse("big.hamel", &text).and_then(|model| scene::build(&model, scene::DEFAULT));
    outcome.map_or_else(|problems| problems.to_string(), |_| String::new())
}

#[test]
fn a_derivation_that_grows_too_large_is_refused() {
    let report = problems(
        "velocity x in R^90;
         let A = x*transpose(x);
         lagrangian = dot(x, A*A*x);",
    );
    assert!(report.contains("the equations have more than 250000 expressions"), "{report}");
    assert!(report.contains("big.hamel:4:"), "{report}");
}

#[test]
fn powers_of_sums_are_not_expanded() {
    for energy in [
        "v1^2*(a + b + c*v2)^200 + dot(v, v)",
        "dot(v, v) + (v1 + v2)^(1/1000)",
        // Too few points of the zero test have all these roots, so that it falls back to multiplying out.
        "dot(v, v) + 1/(sqrt(v1 + 1) + sqrt(v2 + 2) + sqrt(v3 + 3) + sqrt(a + 5))^16 - ((v1 + v2 + v3)^16 + sqrt(v1 + 7))^16",
    ] {
        let report = problems(&format!(
            "param a = 1; param b = 2; param c = 3; velocity v in R^3; lagrangian = {energy};"
        ));
        assert_eq!(report, "", "{energy}");
    }
}
