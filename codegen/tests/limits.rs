//! Every limit has a message, and what is within the limits ends: no input runs away.

use hamel_codegen::{scene, spec};

/// The first problem that the pipeline finds in a model; empty when there is none.
fn first_problem(items: &str) -> String {
    let text = format!("model big {{\n{items}\n}}");
    let outcome = spec::parse("big.hamel", &text).and_then(|model| scene::build(&model, scene::DEFAULT));
    outcome.map_or_else(|problems| problems.iter().next().unwrap().message.clone(), |_| String::new())
}

#[track_caller]
fn refused(items: &str, part: &str) {
    let start = std::time::Instant::now();
    let message = first_problem(items);
    eprintln!("{:?} {message}", start.elapsed());
    assert!(message.contains(part), "expected `{part}`, found `{message}`");
}

#[test]
fn a_derivation_that_grows_too_large_is_refused() {
    for n in [10, 20, 40, 80] {
        eprintln!("{n}");
        let rows = vec![format!("[{}]", vec!["1"; n].join(", ")); n].join(", ");
        let mass = format!("param G: matrix({n}, {n}) = [{rows}]; velocity x in R^{n}; lagrangian = transpose(x)*G*x/2;");
        refused(&mass, "");
    }
    for n in [10, 20, 40] {
        let rows: String = (1..=n).map(|k| format!("constraint x{k} = sin(x{} + q*x{})*q;", k + n, k + n + 1)).collect();
        refused(&format!("coordinate q in real; velocity x in R^{}; lagrangian = dot(x, x) + q_dot^2; {rows}", 2*n+1), "");
    }
}

#[test]
fn powers_of_sums_are_not_expanded() {
    refused("param a = 1; param b = 2; param c = 3; velocity v in R; lagrangian = v^2*(a + b + c*v)^200;", "");
    refused("param a = 1; velocity v in R^3; lagrangian = dot(v, v) + 1/(sqrt(v1 + 1) + sqrt(v2 + 2) + sqrt(v3 + 3) + sqrt(a + 5))^16 - ((v1 + v2 + v3 + a)^16 + sqrt(v1 + 7))^16;", "");
    refused("velocity v in R^3; lagrangian = dot(v, v) + (v1 + v2)^(1/1000);", "");
}
