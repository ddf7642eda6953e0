//! The items of parts in the text of a model: blocks `part motor "motor.hamel" { .. }`.
//!
//! Deliberately does not know: how they came into the text.

use super::ast::{Expr, Item, ItemKind, Name, Node, UseItem};
use super::diagnostic::{Diagnostic, Span};

/// Items `use`.
pub(super) fn uses(items: &[Item]) -> impl Iterator<Item = (&Item, &UseItem)> {
    items.iter().filter_map(|item| match &item.kind {
        ItemKind::Use(used) => Some((item, used)),
        _ => None,
    })
}

/// Parts that a text holds, each with its extent.
pub(super) fn parts_of(items: &[Item]) -> impl Iterator<Item = (&Name, Span)> {
    items.iter().filter_map(|item| match &item.kind {
        ItemKind::Part { name, .. } => Some((name, item.extent)),
        _ => None,
    })
}

/// The items of a file as one model has them: the Lagrangians of its parts are added to its own. Problems are parts
/// that nobody has read.
pub(super) fn joined(items: Vec<Item>, problems: &mut Vec<Diagnostic>) -> Vec<Item> {
    for (_, used) in uses(&items) {
        if !parts_of(&items).any(|(name, _)| name.text == used.name.text) {
            let message = format!("the part `{}` has not been read", used.name.text);
            let help =
                "put the texts together with `spec::compose`; commands and build scripts do so for files";
            problems.push(Diagnostic::new(Some(used.file.span), message).with_help(help));
        }
    }
    if parts_of(&items).next().is_none() {
        return items;
    }
    let mut sum: Vec<(bool, Expr)> = Vec::new();
    let mut kept: Vec<Item> = Vec::new();
    for item in &items {
        let ItemKind::Lagrangian(e) = &item.kind else {
            kept.push(item.clone());
            continue;
        };
        let is_of_part = is_of_part(&items, item.span);
        // A second one of the model itself is told as ever.
        if !is_of_part || sum.is_empty() {
            kept.push(item.clone());
        }
        if is_of_part || sum.is_empty() {
            sum.push((false, e.clone()));
        }
    }
    let first = kept.iter_mut().find_map(|item| match &mut item.kind {
        ItemKind::Lagrangian(e) => Some(e),
        _ => None,
    });
    if let Some(first) = first {
        *first = Expr { span: first.span, node: Node::Sum(sum) };
    }
    kept
}

/// Files of the parts that a text holds.
pub(super) fn files(items: &[Item]) -> Vec<String> {
    let file = |item: &Item| match &item.kind {
        ItemKind::Part { file, .. } => Some(file.text.clone()),
        _ => None,
    };
    let mut files: Vec<String> = items.iter().filter_map(file).collect();
    files.sort();
    files.dedup();
    files
}

/// Whether a span is within a part.
pub(super) fn is_of_part(items: &[Item], span: Span) -> bool {
    parts_of(items).any(|(_, block)| block.start <= span.start && span.end <= block.end)
}
