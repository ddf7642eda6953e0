//! Folded parts, the form of the function that a place is a call of, and what can be done with a model and its
//! scenes.
//!
//! Does not know: messages of the protocol but the form of an answer, how anything is done.

use hamel_codegen::spec::{self, DeclarationKind, WordKind, call_at, vocabulary};
use lsp_types::{
    CodeLens, Command, Documentation, FoldingRange, FoldingRangeKind, MarkupContent, MarkupKind,
    ParameterInformation, ParameterLabel, SignatureHelp, SignatureInformation, Uri,
};
use serde_json::json;

use super::document::Document;

/// Parts of several lines; the line of the closing bracket stays.
pub(crate) fn folds(document: &Document) -> Vec<FoldingRange> {
    let lines = document.lines();
    let fold = |fold: spec::Fold| {
        let (start, end) = (lines.position(fold.span.start), lines.position(fold.span.end));
        let last = if fold.is_comment { end.line } else { end.line.saturating_sub(1) };
        (last > start.line).then(|| FoldingRange {
            start_line: start.line,
            end_line: last,
            kind: fold.is_comment.then_some(FoldingRangeKind::Comment),
            ..FoldingRange::default()
        })
    };
    spec::folds(&document.text).into_iter().filter_map(fold).collect()
}

/// The form of the function whose argument a byte of a text is in.
pub(crate) fn signature(document: &Document, offset: usize) -> Option<SignatureHelp> {
    let call = call_at(&document.text, offset)?;
    let name = document.text.get(call.name.start..call.name.end)?;
    let word = vocabulary().into_iter().find(|word| word.kind == WordKind::Function && word.word == name)?;
    let label = if word.form.is_empty() { format!("{name}(x)") } else { word.form.to_owned() };
    let parameters: Vec<ParameterInformation> = arguments(&label)
        .into_iter()
        .map(|label| ParameterInformation {
            label: ParameterLabel::Simple(label.to_owned()),
            documentation: None,
        })
        .collect();
    // A function of more arguments than its form says has further forms, which the sentence tells.
    let active = u32::try_from(call.argument).ok().filter(|at| (*at as usize) < parameters.len());
    let value = word.sentence.to_owned();
    let information = SignatureInformation {
        label,
        documentation: Some(Documentation::MarkupContent(MarkupContent {
            kind: MarkupKind::Markdown,
            value,
        })),
        parameters: Some(parameters),
        active_parameter: active,
    };
    Some(SignatureHelp { signatures: vec![information], active_signature: Some(0), active_parameter: active })
}

/// The arguments of a form, `cross(a, b)`; a comma in brackets parts none.
fn arguments(form: &str) -> Vec<&str> {
    let Some((_, inner)) = form.split_once('(') else { return Vec::new() };
    let inner = inner.strip_suffix(')').unwrap_or(inner);
    let (mut depth, mut start, mut found) = (0_usize, 0, Vec::new());
    for (at, c) in inner.char_indices() {
        match c {
            '(' | '[' => depth += 1,
            ')' | ']' => depth = depth.saturating_sub(1),
            ',' if depth == 0 => {
                found.push(inner[start..at].trim());
                start = at + 1;
            }
            _ => {}
        }
    }
    found.push(inner[start..].trim());
    found
}

/// The command of the extension that shows what a command of `hamel` makes of a file: its arguments are the command,
/// the address of the file and a scene.
const SHOW: &str = "hamel.show";

/// What can be shown of a model, and of each of its scenes.
const LENSES: [&str; 3] = ["simulate", "explain", "report"];

/// Commands at the model and at its scenes.
pub(crate) fn lenses(document: &Document, uri: &Uri) -> Vec<CodeLens> {
    let lines = document.lines();
    let mut found = Vec::new();
    for declaration in &document.outline.declarations {
        let scene = match declaration.kind {
            DeclarationKind::Model => "default",
            DeclarationKind::Scene => declaration.name.as_str(),
            _ => continue,
        };
        let range = lines.range(declaration.span);
        for title in LENSES {
            let arguments = vec![json!(title), json!(uri.as_str()), json!(scene)];
            let command = Command::new(title.to_owned(), SHOW.to_owned(), Some(arguments));
            found.push(CodeLens { range, command: Some(command), data: None });
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::arguments;

    #[test]
    fn arguments_of_a_form_are_parted_by_commas_outside_of_brackets() {
        assert_eq!(arguments("cross(a, b)"), ["a", "b"]);
        assert_eq!(arguments("ad([g,] x, y)"), ["[g,] x", "y"]);
        assert_eq!(arguments("sin(x)"), ["x"]);
    }
}
