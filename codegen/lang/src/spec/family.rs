//! Members of a family: the text of a model with other sizes.
//!
//! Deliberately does not know: what a size is used for.

use super::ast::{Item, ItemKind};
use super::diagnostic::{Diagnostic, Diagnostics, Origin, Span};
use super::names;
use super::parser;

/// The text of a model with other values of its sizes.
///
/// The text that comes back is a model file, and its sizes are those asked for: who reads it, derives from it or keeps
/// it needs to know nothing else. Other bytes of the text stay as they are.
///
/// ```
/// use hamel_lang::spec::{parse, with_sizes};
///
/// let text = "model chain {
///     size n = 2 where n >= 1;
///     coordinate q: vector(n) in angle;
///     lagrangian = sum(q_dot[k]^2 for k in 1..n);
/// }";
/// let longer = with_sizes("chain.hamel", text, &[("n".to_owned(), 4)]).unwrap();
/// assert_eq!(parse("chain.hamel", &longer).unwrap().base.len(), 4);
/// let problems = with_sizes("chain.hamel", text, &[("m".to_owned(), 4)]).unwrap_err();
/// assert!(problems.to_string().contains("the model has no size `m`"));
/// ```
///
/// # Errors
/// A name that is no size of the text, at the model's name, and what is wrong with the text where it cannot be read.
/// Whether the model exists for these sizes is found by whoever reads it.
pub fn with_sizes(file: &str, text: &str, sizes: &[(String, i64)]) -> Result<String, Diagnostics> {
    if sizes.is_empty() {
        return Ok(text.to_owned());
    }
    let body = text.strip_prefix('\u{feff}').unwrap_or(text);
    let outcome = parser::parse_leniently(body);
    let problems = |list| {
        let origin = Origin { file: file.to_owned(), text: body.to_owned() };
        Err(Diagnostics::new(Some(origin), list))
    };
    let Some(read) = outcome.file else { return problems(outcome.problems) };
    let declared = |item: &Item| match &item.kind {
        ItemKind::Size { name, place, .. } => Some((name.text.clone(), *place)),
        _ => None,
    };
    let declared: Vec<(String, Span)> = read.items.iter().filter_map(declared).collect();
    let mut unknown = Vec::new();
    let mut replaced: Vec<(Span, i64)> = Vec::new();
    for (name, value) in sizes {
        match declared.iter().find(|(own, _)| own == name) {
            Some((_, place)) => replaced.push((*place, *value)),
            None => {
                let problem =
                    Diagnostic::new(Some(read.name.span), format!("the model has no size `{name}`"));
                unknown.push(problem.with_help(match declared.is_empty() {
                    true => "it declares none: `size n = 3;`".into(),
                    false => names::suggest(name, declared.iter().map(|(own, _)| own.as_str())),
                }));
            }
        }
    }
    if !unknown.is_empty() {
        return problems(unknown);
    }
    replaced.sort_by_key(|(place, _)| std::cmp::Reverse(place.start));
    let mut text = body.to_owned();
    for (place, value) in replaced {
        text.replace_range(place.start..place.end, &value.to_string());
    }
    Ok(text)
}
