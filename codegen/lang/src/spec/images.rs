//! A model with functions of it that another model writes: they are read as outputs behind its last item.
//!
//! Deliberately does not know: what the functions are for.

use super::diagnostic::{Diagnostic, Diagnostics, Origin, Span};
use super::model::{Image, Model};
use super::tokens::tokens;
use hamel_expr::Budget;

/// Problems of a model with functions of it.
#[derive(Clone, Debug)]
pub struct ImageProblems {
    /// Those of the model.
    pub of_model: Diagnostics,
    /// Those of functions, in the text that the functions come from.
    pub of_images: Vec<Diagnostic>,
}

/// Reads a model, and functions of it as its last outputs, one for each image in their order; also how many outputs it
/// has of its own.
///
/// # Errors
/// All problems of the model, and of the functions.
pub fn parse_with_images(
    budget: Budget,
    origin: &Origin,
    images: &[Image],
) -> Result<(Model, usize), ImageProblems> {
    let text = origin.text.strip_prefix('\u{feff}').unwrap_or(&origin.text);
    let end = end_of_model(text);
    let mut items = String::new();
    let mut placed: Vec<(Span, &Image)> = Vec::new();
    let prefix = free_prefix(text);
    for (k, image) in images.iter().enumerate() {
        items.push_str(&format!("\noutput {prefix}{k} = "));
        let start = end + items.len();
        placed.push((Span::new(start, start + image.text.len()), image));
        items.push_str(&image.text);
        items.push(';');
    }
    let added = Span::new(end, end + items.len());
    let long = with_items(text, &items);
    let moved = |span: Span| {
        let (own, image) = placed.iter().find(|(own, _)| own.start <= span.start && span.end <= own.end)?;
        let (_, at) = image.places?;
        Some(Span::new(at.start + span.start - own.start, at.start + span.end - own.start))
    };
    let problems = |list: &Diagnostics| {
        let is_ours =
            |d: &&Diagnostic| d.span.is_some_and(|span| added.start <= span.start && span.end <= added.end);
        let (ours, own): (Vec<&Diagnostic>, Vec<&Diagnostic>) = list.iter().partition(is_ours);
        let of_images = ours.into_iter().map(|d| Diagnostic {
            span: d.span.and_then(moved),
            labels: d.labels.iter().filter_map(|(span, text)| Some((moved(*span)?, text.clone()))).collect(),
            ..d.clone()
        });
        let of_images = of_images.collect();
        let of_model = Diagnostics::new(Some(origin.clone()), own.into_iter().cloned().collect());
        ImageProblems { of_model, of_images }
    };
    let model = super::parse_within(budget, &origin.file, &long).map_err(|list| problems(&list))?;
    // Events add outputs of theirs behind.
    let n_own = model.outputs.iter().position(|output| output.name.starts_with(&prefix));
    let n_own = n_own.unwrap_or(model.outputs.len());
    Ok((model, n_own))
}

/// The text of a model with `items` before its last brace.
///
/// ```
/// let text = "model m { param k = 1; } // }";
/// assert_eq!(hamel_lang::spec::with_items(text, "let a = k; "), "model m { param k = 1; let a = k; } // }");
/// ```
pub fn with_items(text: &str, items: &str) -> String {
    let (before, behind) = text.split_at(end_of_model(text));
    [before, items, behind].concat()
}

/// Where the last brace is that is no part of a comment.
fn end_of_model(text: &str) -> usize {
    tokens(text).iter().rev().find(|token| token.text == "}").map_or(text.len(), |token| token.start)
}

/// The beginning of a name that the text has nowhere.
fn free_prefix(text: &str) -> String {
    let candidates = (0..).map(|k: usize| format!("image{}_", "_".repeat(k)));
    candidates.into_iter().find(|prefix| !text.contains(prefix.as_str())).unwrap_or_default()
}
