//! The text of a model with further items at its end.
//!
//! Does not know: which items, what is done with the model.

use hamel_codegen::spec::Diagnostics;

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
