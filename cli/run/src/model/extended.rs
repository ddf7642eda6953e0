//! Expressions of the model's language beside a model, and the text of a model with further items at its end.
//!
//! Does not know: which items, what is done with the model.

use std::collections::BTreeMap;

use hamel_codegen::spec::{self, Diagnostics};

/// Whether a text can be an expression within an item: nothing in it ends the item or hides what follows.
pub fn is_one_expression(text: &str) -> bool {
    !(text.contains([';', '{', '}', '\n']) || text.contains("//") || text.contains("/*"))
}

/// The first of some problems, with its help.
pub fn first_message(problems: &Diagnostics) -> String {
    let Some(problem) = problems.iter().next() else { return String::new() };
    let help = problem.help.as_ref().map(|help| format!(": {help}")).unwrap_or_default();
    format!("{}{help}", problem.message)
}

/// A finite number, or the value of an expression of numbers: `1/3`, `2*pi`, `sqrt(2)/2`.
///
/// # Errors
/// That it is neither.
pub fn number(text: &str) -> Result<f64, String> {
    let value = text.trim().parse::<f64>().ok().or_else(|| expression_of_numbers(text));
    value.filter(|x| x.is_finite()).ok_or_else(|| format!("{text:?} is not a finite number"))
}

/// The value that an initial value of the text would have in any model.
fn expression_of_numbers(text: &str) -> Option<f64> {
    if !is_one_expression(text) {
        return None;
    }
    let model = format!("model any {{ coordinate x in real; lagrangian = x_dot^2/2; initial x = {text}; }}");
    let model = spec::parse("any", &model).ok()?;
    let [(_, value)] = model.initial[..] else { return None };
    model.graph.eval_f64(value, &BTreeMap::new())
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_may_be_expressions() {
        for (text, value) in [
            ("1.5", 1.5),
            (" -2e-3", -2e-3),
            ("1/3", 1.0 / 3.0),
            ("2*pi", std::f64::consts::TAU),
            ("-(sqrt(2) + 1)^2", -(2.0_f64.sqrt() + 1.0).powi(2)),
        ] {
            assert!((number(text).unwrap() - value).abs() <= f64::EPSILON * value.abs(), "{text}");
        }
        for text in [
            "",
            "m",
            "x",
            "x_dot",
            "t",
            "1/0",
            "sqrt(-1)",
            "1; param x = 2",
            "[1, 2]",
            "nan",
            "inf",
            "1e999",
            "2*",
        ] {
            let told = number(text).unwrap_err();
            assert!(told.contains("is not a finite number"), "{told}");
        }
    }
}
