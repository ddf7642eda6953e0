//! Where a name is declared and mentioned, what a text consists of, and a name replaced by another.
//!
//! Does not know: messages of the protocol.

use std::collections::HashMap;

use hamel_codegen::spec::{self, Declaration, DeclarationKind, Outline, Span, WordKind};
use lsp_types::{
    DocumentHighlight, DocumentHighlightKind, DocumentSymbol, Location, SemanticToken, SemanticTokenType,
    SymbolKind, TextEdit, Uri, WorkspaceEdit,
};

use super::document::{Document, check};

/// The declaration of what a place mentions.
pub(crate) fn definition(document: &Document, uri: &Uri, offset: usize) -> Option<Location> {
    let (_, declaration) = document.outline.mention_at(offset)?;
    Some(Location::new(uri.clone(), document.lines().range(declaration.span)))
}

/// Every word that stands for the same as the one at a place; `with_declaration` is whether the declaration is among
/// them.
fn mentions(outline: &Outline, offset: usize, with_declaration: bool) -> Vec<(Span, bool)> {
    let Some((mention, declaration)) = outline.mention_at(offset) else { return Vec::new() };
    let same = outline.mentions.iter().filter(|m| m.declaration == mention.declaration);
    let spans = same.map(|m| (m.word, m.word == declaration.span));
    spans.filter(|(_, is_declaration)| with_declaration || !is_declaration).collect()
}

pub(crate) fn references(document: &Document, uri: &Uri, offset: usize, all: bool) -> Vec<Location> {
    let lines = document.lines();
    let found = mentions(&document.outline, offset, all).into_iter();
    found.map(|(span, _)| Location::new(uri.clone(), lines.range(span))).collect()
}

pub(crate) fn highlights(document: &Document, offset: usize) -> Vec<DocumentHighlight> {
    let lines = document.lines();
    let highlight = |(span, is_declaration)| DocumentHighlight {
        range: lines.range(span),
        kind: Some(match is_declaration {
            true => DocumentHighlightKind::WRITE,
            false => DocumentHighlightKind::READ,
        }),
    };
    mentions(&document.outline, offset, true).into_iter().map(highlight).collect()
}

/// Whether other texts than mentions may contain the name: components of vectors are called by basis elements.
fn is_part_of_other_names(declaration: &Declaration) -> bool {
    declaration.kind == DeclarationKind::BasisElement
}

/// The name that is replaced where somebody renames what a place mentions.
pub(crate) fn renamed(document: &Document, offset: usize) -> Option<Span> {
    let (mention, declaration) = document.outline.mention_at(offset)?;
    (!is_part_of_other_names(declaration)).then_some(mention.name)
}

/// Another name for what a place mentions: names of its components, of its rate and of derivatives by it change with
/// it. A text that was a model stays one.
///
/// # Errors
/// Why it cannot be called so.
pub(crate) fn rename(
    document: &Document,
    uri: &Uri,
    offset: usize,
    name: &str,
) -> Result<WorkspaceEdit, String> {
    let outline = &document.outline;
    let Some((mention, declaration)) = outline.mention_at(offset) else {
        return Err("there is no name of the model here".to_owned());
    };
    if is_part_of_other_names(declaration) {
        return Err(format!("components may be called by the basis element `{}`", declaration.name));
    }
    if let Some(reason) = spec::name_refusal(name) {
        return Err(format!("`{name}` cannot be used as a name: {reason}"));
    }
    let mut spans: Vec<Span> =
        outline.mentions.iter().filter(|m| m.declaration == mention.declaration).map(|m| m.name).collect();
    spans.sort();
    let mut text = document.text.to_string();
    for span in spans.iter().rev() {
        text.replace_range(span.start..span.end, name);
    }
    if is_model(&document.text)
        && let Err(problem) = first_problem(&text)
    {
        return Err(format!("`{name}` in the place of `{}` would be wrong: {problem}", declaration.name));
    }
    let lines = document.lines();
    let edits = spans.iter().map(|span| TextEdit::new(lines.range(*span), name.to_owned())).collect();
    #[allow(clippy::mutable_key_type, reason = "the type of the protocol")]
    let changes = HashMap::from([(uri.clone(), edits)]);
    Ok(WorkspaceEdit::new(changes))
}

fn is_model(text: &str) -> bool {
    first_problem(text).is_ok()
}

/// The first error of a text, if it has one.
fn first_problem(text: &str) -> Result<(), String> {
    let found = check("", text.into()).found;
    match found.iter().find(|problem| problem.severity == spec::Severity::Error) {
        Some(problem) => Err(problem.message.clone()),
        None => Ok(()),
    }
}

/// What a text consists of: the model, and within it everything that it declares.
pub(crate) fn symbols(document: &Document) -> Vec<DocumentSymbol> {
    let lines = document.lines();
    let outline = &document.outline;
    let symbol = |d: &Declaration, children: Option<Vec<DocumentSymbol>>| {
        let end = Span::new(d.extent.start.min(d.span.start), d.extent.end.max(d.span.end));
        #[allow(deprecated, reason = "the protocol still has the field")]
        DocumentSymbol {
            name: d.name.clone(),
            detail: Some(d.kind.title().to_owned()),
            kind: match d.kind {
                DeclarationKind::Model | DeclarationKind::Scene | DeclarationKind::Stage => {
                    SymbolKind::MODULE
                }
                DeclarationKind::Parameter | DeclarationKind::Size => SymbolKind::CONSTANT,
                DeclarationKind::Algebra | DeclarationKind::Representation => SymbolKind::CLASS,
                DeclarationKind::Event => SymbolKind::EVENT,
                DeclarationKind::Casimir | DeclarationKind::Output => SymbolKind::PROPERTY,
                _ => SymbolKind::VARIABLE,
            },
            tags: None,
            deprecated: None,
            range: lines.range(end),
            selection_range: lines.range(d.span),
            children,
        }
    };
    let is_model = |d: &&Declaration| d.kind == DeclarationKind::Model;
    let within = |d: &&Declaration| {
        use DeclarationKind::{BasisElement, Index, Model};
        !matches!(d.kind, Model | BasisElement | Index)
    };
    let children: Vec<DocumentSymbol> =
        outline.declarations.iter().filter(within).map(|d| symbol(d, None)).collect();
    match outline.declarations.iter().find(is_model) {
        Some(model) => vec![symbol(model, Some(children))],
        None => children,
    }
}

/// Kinds of words, in the order in which [`tokens`] counts them.
pub(crate) const TOKEN_TYPES: [SemanticTokenType; 6] = [
    SemanticTokenType::KEYWORD,
    SemanticTokenType::FUNCTION,
    SemanticTokenType::PARAMETER,
    SemanticTokenType::VARIABLE,
    SemanticTokenType::TYPE,
    SemanticTokenType::PROPERTY,
];

/// Every word of a text that is of the language or of the model, with its kind.
pub(crate) fn tokens(document: &Document) -> Vec<SemanticToken> {
    let outline = &document.outline;
    let kind_of = |d: &Declaration| match d.kind {
        DeclarationKind::Parameter | DeclarationKind::Size | DeclarationKind::Index => 2,
        DeclarationKind::Algebra | DeclarationKind::Representation | DeclarationKind::BasisElement => 4,
        DeclarationKind::Casimir
        | DeclarationKind::Output
        | DeclarationKind::Section
        | DeclarationKind::Event
        | DeclarationKind::Scene
        | DeclarationKind::Stage
        | DeclarationKind::View
        | DeclarationKind::Constraint
        | DeclarationKind::Model => 5,
        _ => 3,
    };
    let names = outline.mentions.iter();
    let names = names.filter_map(|m| Some((m.word, kind_of(outline.declarations.get(m.declaration)?))));
    let words = outline.words.iter().map(|(span, kind)| match kind {
        WordKind::Item | WordKind::Part => (*span, 0),
        WordKind::Function => (*span, 1),
        WordKind::Constant => (*span, 2),
        WordKind::Setting => (*span, 4),
    });
    let mut all: Vec<(Span, u32)> = names.chain(words).collect();
    all.sort();
    let lines = document.lines();
    let (mut line, mut column) = (0, 0);
    let mut tokens = Vec::new();
    for (span, token_type) in all {
        let range = lines.range(span);
        if range.start.line != range.end.line {
            continue;
        }
        let is_same_line = range.start.line == line;
        tokens.push(SemanticToken {
            delta_line: range.start.line - line,
            delta_start: if is_same_line { range.start.character - column } else { range.start.character },
            length: range.end.character - range.start.character,
            token_type,
            token_modifiers_bitset: 0,
        });
        (line, column) = (range.start.line, range.start.character);
    }
    tokens
}
