//! A model with functions of it that another model writes: they are read as outputs behind its last item.
//!
//! Deliberately does not know: what the functions are for.

use super::diagnostic::{Diagnostic, Diagnostics, Origin, Span};
use super::tokens::tokens;
use super::total::Image;

/// Problems of a model with functions of it.
#[derive(Clone, Debug)]
pub struct ImageProblems {
    /// Problems of the model.
    pub of_model: Diagnostics,
    /// Problems of the functions, in the text that the functions come from.
    pub of_images: Vec<Diagnostic>,
}

/// The text of a model with functions of it as outputs, and where these come from.
pub(super) struct Extended<'a> {
    /// The text.
    pub(super) text: String,
    /// What the names of the outputs begin with.
    prefix: String,
    added: Span,
    placed: Vec<(Span, &'a Image)>,
}

impl<'a> Extended<'a> {
    pub(super) fn new(text: &str, images: &'a [Image]) -> Extended<'a> {
        let end = end_of_model(text);
        let (mut items, mut placed, prefix) = (String::new(), Vec::new(), free_prefix(text));
        for (k, image) in images.iter().enumerate() {
            items.push_str(&format!("\noutput {prefix}{k} = "));
            let start = end + items.len();
            placed.push((Span::new(start, start + image.text.len()), image));
            items.push_str(&image.text);
            items.push(';');
        }
        let added = Span::new(end, end + items.len());
        Extended { text: with_items(text, &items), prefix, added, placed }
    }

    /// Whether an output is one of the functions.
    pub(super) fn has(&self, output: &str) -> bool {
        output.starts_with(&self.prefix)
    }

    /// The place in the text that a function comes from.
    fn moved(&self, span: Span) -> Option<Span> {
        let is_in = |(own, _): &&(Span, &Image)| own.start <= span.start && span.end <= own.end;
        let (own, image) = self.placed.iter().find(is_in)?;
        let (_, at) = image.places?;
        Some(Span::new(at.start + span.start - own.start, at.start + span.end - own.start))
    }

    /// Problems of the text, parted.
    pub(super) fn problems(&self, list: &Diagnostics, origin: &Origin) -> ImageProblems {
        let is_added = |span: Span| self.added.start <= span.start && span.end <= self.added.end;
        let is_ours = |d: &&Diagnostic| d.span.is_some_and(is_added);
        let (ours, own): (Vec<&Diagnostic>, Vec<&Diagnostic>) = list.iter().partition(is_ours);
        let of_images = ours.into_iter().map(|d| Diagnostic {
            span: d.span.and_then(|span| self.moved(span)),
            labels: d.labels.iter().filter_map(|(s, text)| Some((self.moved(*s)?, text.clone()))).collect(),
            ..d.clone()
        });
        let of_images = of_images.collect();
        let of_model = Diagnostics::new(Some(origin.clone()), own.into_iter().cloned().collect());
        ImageProblems { of_model, of_images }
    }
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
