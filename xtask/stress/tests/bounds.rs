//! A short run fails at a model that loses digits, and says which function does.

use std::path::Path;

use clap::Parser as _;
use hamel_stress::request::{Arguments, StressRequest};
use hamel_stress::run;

/// A particle with a force and an output next to `x = 0` that no rule writes without a difference.
fn model(force: &str, output: &str, wants: &str) -> String {
    format!(
        "model particle {{
    param m = 1 where m > 0;
    param k = 2 where k > 0;
    coordinate x in angle;
    lagrangian = 1/2*m*x_dot^2;
    force x_dot = {force};
    output strain = {output};
    scene default {{ want {wants}; }}
}}
"
    )
}

/// What the short run finds wrong with the model.
fn found(name: &str, text: &str) -> String {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}.hamel"));
    std::fs::write(&path, text).unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let arguments = ["hamel-stress", "--short", "--root"].map(Into::into).into_iter();
    let arguments = arguments.chain([root.into_os_string(), path.into_os_string()]);
    let request = StressRequest::new(Arguments::parse_from(arguments)).unwrap();
    run::run(request).unwrap_err().to_string()
}

const DIFFERENCE: &str = "k*(sqrt(1 + x^2) - 1)";

#[test]
fn a_planted_loss_of_digits_is_found() {
    let of_rates = found("planted", &model(DIFFERENCE, "k*x", "rhs, energy, strain"));
    for what in ["rhs: ", "rhs at parameters 10^+-3: "] {
        assert!(of_rates.contains(&format!("particle default, {what}")), "{of_rates}");
    }
    assert!(!of_rates.contains("default, outputs"), "{of_rates}");
}

#[test]
fn a_planted_loss_of_an_output_is_found_and_scenes_that_want_digits_have_none() {
    let of_outputs = found("output", &model("-k*x", DIFFERENCE, "rhs, energy, strain"));
    for what in ["outputs: ", "outputs at parameters 10^+-3: "] {
        assert!(of_outputs.contains(&format!("particle default, {what}")), "{of_outputs}");
    }
    assert!(!of_outputs.contains("default, rhs"), "{of_outputs}");
    let of_digits = found("exact", &model(DIFFERENCE, DIFFERENCE, "rhs, energy, strain, digits"));
    assert!(!of_digits.contains("particle default, "), "{of_digits}");
    // Nothing but that the model is none of the repository's.
    assert!(of_digits.contains("no bound: (\"particle\", \"default\""), "{of_digits}");
}
