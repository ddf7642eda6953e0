//! Problems of a text as an editor shows them, and what can be done about them by one key.
//!
//! Does not know: what can be wrong.

use std::collections::HashMap;

use hamel_codegen::spec::{Diagnostics, Replacement, Severity, Span};
use lsp_types::{
    CodeAction, CodeActionKind, Diagnostic, DiagnosticRelatedInformation, DiagnosticSeverity, Location,
    Range, TextEdit, Uri, WorkspaceEdit,
};

use super::position::Lines;

/// Shown beside each problem.
const SOURCE: &str = "hamel";

/// The problems of a text, those without a place at its beginning.
pub(crate) fn problems(uri: &Uri, lines: &Lines<'_>, found: &Diagnostics) -> Vec<Diagnostic> {
    let start = Span::new(0, 0);
    let shown = |problem: &hamel_codegen::spec::Diagnostic| {
        let mut message = problem.message.clone();
        for more in [Some(&problem.label).filter(|label| !label.is_empty()), problem.help.as_ref()] {
            message.extend(more.map(|text| format!("\n{text}")));
        }
        let related = problem.labels.iter().map(|(span, text)| DiagnosticRelatedInformation {
            location: Location::new(uri.clone(), lines.range(*span)),
            message: text.clone(),
        });
        Diagnostic {
            range: lines.range(problem.span.unwrap_or(start)),
            severity: Some(match problem.severity {
                Severity::Error => DiagnosticSeverity::ERROR,
                Severity::Warning => DiagnosticSeverity::WARNING,
            }),
            source: Some(SOURCE.to_owned()),
            message,
            related_information: Some(related.collect()),
            ..Diagnostic::default()
        }
    };
    found.iter().map(shown).collect()
}

/// Where a word stands alone within a part of a text.
fn find_word(text: &str, span: Span, word: &str) -> Option<Span> {
    let part = text.get(span.start..span.end)?;
    let is_part_of_word = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    part.match_indices(word).find_map(|(at, _)| {
        let (before, after) = (&part[..at], &part[at + word.len()..]);
        let is_whole = !is_part_of_word(before.chars().next_back()) && !is_part_of_word(after.chars().next());
        is_whole.then(|| Span::new(span.start + at, span.start + at + word.len()))
    })
}

/// A replacement for each problem within a range whose help proposes one.
pub(crate) fn repairs(
    uri: &Uri,
    text: &str,
    lines: &Lines<'_>,
    found: &Diagnostics,
    range: Range,
) -> Vec<CodeAction> {
    let asked = Span::new(lines.offset(range.start), lines.offset(range.end));
    let mut actions = Vec::new();
    for problem in found.iter() {
        let (Some(span), Some(Replacement { wrong, right })) = (problem.span, &problem.replacement) else {
            continue;
        };
        let touches = span.start <= asked.end && asked.start <= span.end;
        let Some(place) = find_word(text, span, wrong).filter(|_| touches) else { continue };
        let edit = TextEdit::new(lines.range(place), right.clone());
        #[allow(clippy::mutable_key_type, reason = "the type of the protocol")]
        let changes = HashMap::from([(uri.clone(), vec![edit])]);
        actions.push(CodeAction {
            title: format!("Replace `{wrong}` by `{right}`"),
            kind: Some(CodeActionKind::QUICKFIX),
            edit: Some(WorkspaceEdit::new(changes)),
            is_preferred: Some(true),
            ..CodeAction::default()
        });
    }
    actions
}
