//! The text of a model with further items at its end.
//!
//! Does not know: which items, what is done with the model.

use hamel_codegen::spec::Diagnostics;

/// Whether a text can be an expression within an item: nothing in it ends the item or hides what follows.
pub fn is_one_expression(text: &str) -> bool {
    !(text.contains([';', '{', '}', '\n']) || text.contains("//") || text.contains("/*"))
}

/// The text of a model with `items` before its last brace.
pub fn with_items(text: &str, items: &str) -> String {
    // The end of the model: the last brace that is no part of a comment.
    let mut end = None;
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        let code = line.split("//").next().unwrap_or(line);
        end = code.rfind('}').map(|at| start + at).or(end);
        start += line.len();
    }
    let mut extended = text.to_owned();
    extended.insert_str(end.unwrap_or(text.len()), items);
    extended
}

/// The first of some problems, with its help.
pub fn first_message(problems: &Diagnostics) -> String {
    let Some(problem) = problems.iter().next() else { return String::new() };
    let help = problem.help.as_ref().map(|help| format!(": {help}")).unwrap_or_default();
    format!("{}{help}", problem.message)
}
