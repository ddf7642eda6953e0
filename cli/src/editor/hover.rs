//! What is said about a word: the declaration that it stands for, its unit and structure, or the sentence of a keyword.
//!
//! Does not know: messages of the protocol, how equations are derived.

use std::fmt::Write as _;

use hamel_codegen::explain;
use hamel_codegen::spec::{Declaration, DeclarationKind, Model, Outline, Side, Span, WordKind, vocabulary};
use hamel_mechanics::mechanics::Equations;

use super::document::Document;
use hamel_run::model::spelling::spell;
use hamel_run::model::units::split_unit;

/// Longest part of an item that is shown.
const MAX_ITEM: usize = 400;
/// Most brackets of an algebra, most components and most formulas that are listed.
const MAX_LISTED: usize = 12;

/// What equations could add.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Wish {
    /// Nothing.
    Nothing,
    /// The rates of these state variables.
    Rates(Vec<String>),
    /// How many equations there are, and for what.
    Count,
}

/// What is said about a place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Answer {
    /// In Markdown.
    pub(crate) text: String,
    /// The word that it is about.
    pub(crate) span: Span,
    /// What to add once equations are known.
    pub(crate) wish: Wish,
}

/// What is said about a byte of a text; `model` is the one that the text was last, if it was one.
pub(crate) fn answer(document: &Document, offset: usize, model: Option<&Model>) -> Option<Answer> {
    let outline = &document.outline;
    if let Some((mention, declaration)) = outline.mention_at(offset) {
        let word = document.text.get(mention.word.start..mention.word.end)?;
        let text = of_declaration(document, outline, declaration, word, model);
        let wish = match (declaration.kind, model) {
            (DeclarationKind::Scene | DeclarationKind::Model, Some(_)) => Wish::Count,
            (kind, Some(model)) if kind.is_of_state() => {
                let names = state_names(declaration, word, model);
                if names.is_empty() { Wish::Nothing } else { Wish::Rates(names) }
            }
            _ => Wish::Nothing,
        };
        return Some(Answer { text, span: mention.word, wish });
    }
    let (span, kind) = outline.word_at(offset)?;
    let word = document.text.get(span.start..span.end)?;
    let known = vocabulary().into_iter().find(|known| known.word == word && known.kind == kind)?;
    let mut text = String::new();
    let form = if known.form.is_empty() { word } else { known.form };
    if kind == WordKind::Item {
        for form in form.split("` or `") {
            let _ = writeln!(text, "```hamel\n{form}\n```");
        }
    } else {
        let _ = writeln!(text, "```hamel\n{form}\n```");
    }
    text.push_str(known.sentence);
    let has_equations = model.is_some() && matches!(word, "lagrangian" | "hamiltonian");
    Some(Answer { text, span, wish: if has_equations { Wish::Count } else { Wish::Nothing } })
}

/// The answer with what equations add.
pub(crate) fn with_equations(answer: &Answer, equations: &Equations) -> String {
    let mut text = answer.text.clone();
    match &answer.wish {
        Wish::Nothing => {}
        Wish::Rates(names) => {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let rows = explain::rates(equations, &names);
            if !rows.is_empty() {
                let n_left_out = rows.len().saturating_sub(2 * MAX_LISTED);
                text.push_str("\n\n```text\n");
                for (left, right) in rows.iter().take(2 * MAX_LISTED) {
                    let _ = writeln!(text, "{left} = {right}");
                }
                if n_left_out > 0 {
                    let _ = writeln!(text, ".. and {n_left_out} more definitions");
                }
                text.push_str("```");
            }
        }
        Wish::Count => {
            let n = equations.state.len();
            let names: Vec<String> = equations.state.iter().map(|s| spell(&s.name)).collect();
            let s = if n == 1 { "" } else { "s" };
            let _ = write!(text, "\n\n{n} equation{s} of motion, for {}", listed(&names));
        }
    }
    text
}

fn listed(names: &[String]) -> String {
    let more = if names.len() > MAX_LISTED { ", .." } else { "" };
    format!("{}{more}", names[..names.len().min(MAX_LISTED)].join(", "))
}

/// The variables that a word stands for, as the state of the model as it is written has them; a rate of a coordinate is
/// one of its own.
fn state_names(declaration: &Declaration, word: &str, model: &Model) -> Vec<String> {
    let components = components(declaration, model);
    if components.iter().any(|name| name == word) {
        return vec![word.to_owned()];
    }
    let rates = model.base.iter().filter(|c| components.contains(&c.name)).map(|c| &c.velocity_name);
    let rates: Vec<String> = rates.cloned().collect();
    if rates.iter().any(|name| name == word) {
        return vec![word.to_owned()];
    }
    // Of a vector of coordinates, its rate.
    if word.strip_suffix("_dot").is_some_and(|name| name == declaration.name) {
        return rates;
    }
    components
}

/// Names of the components of a declaration, or its own.
fn components(declaration: &Declaration, model: &Model) -> Vec<String> {
    let name = &declaration.name;
    let of_array = model.param_arrays.iter().find(|array| array.name == *name);
    let found: Vec<String> = match declaration.kind {
        DeclarationKind::Parameter => of_array.map(|array| array.layout.names(name)).unwrap_or_default(),
        DeclarationKind::Input => {
            let is_component = |input: &str| {
                input.strip_prefix(name.as_str()).is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit()))
            };
            model
                .inputs
                .iter()
                .map(|input| &input.name)
                .filter(|input| is_component(input))
                .cloned()
                .collect()
        }
        DeclarationKind::Velocity | DeclarationKind::QuasiVelocity => {
            let all = model.velocities.iter().chain(&model.quasi_velocities);
            all.filter(|v| v.block == *name || v.name == *name).map(|v| v.name.clone()).collect()
        }
        DeclarationKind::Coordinate => {
            let is_component = |c: &str| {
                c.strip_prefix(name.as_str()).is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit()))
            };
            model.base.iter().map(|c| &c.name).filter(|c| is_component(c)).cloned().collect()
        }
        DeclarationKind::Advected => {
            let of = model.advected.iter().find(|a| a.name == *name);
            of.map(|a| a.components.iter().map(|(name, _)| name.clone()).collect()).unwrap_or_default()
        }
        DeclarationKind::State => {
            let of = model.first_order.iter().find(|state| state.name == *name);
            of.map(|s| s.components.iter().map(|(name, _)| name.clone()).collect()).unwrap_or_default()
        }
        DeclarationKind::Momentum => {
            let of = model.momenta.iter().find(|m| m.name == *name);
            of.map(|m| m.components.iter().map(|(name, ..)| name.clone()).collect()).unwrap_or_default()
        }
        _ => Vec::new(),
    };
    if found.is_empty() { vec![name.clone()] } else { found }
}

/// The text of an item on one line.
fn one_line(text: &str) -> String {
    let mut line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    if let Some((at, _)) = line.char_indices().nth(MAX_ITEM) {
        line.truncate(at);
        line.push_str(" ..");
    }
    line
}

fn of_declaration(
    document: &Document,
    outline: &Outline,
    declaration: &Declaration,
    word: &str,
    model: Option<&Model>,
) -> String {
    let Declaration { kind, name, .. } = declaration;
    let mut text = String::new();
    let item = document.text.get(declaration.item.start..declaration.item.end).unwrap_or_default();
    if *kind != DeclarationKind::Model {
        let _ = writeln!(text, "```hamel\n{}\n```", one_line(item.trim_end_matches(';')));
    }
    // One line of documentation may have a unit for each name of the item.
    let same_item = outline.declarations.iter().filter(|d| d.item == declaration.item && d.kind == *kind);
    let position = same_item.take_while(|d| d.span != declaration.span).count();
    let (doc, unit) = split_unit(&declaration.doc, position);
    let is_rate = *kind == DeclarationKind::Coordinate && word.ends_with("_dot");
    let _ = write!(text, "{}{} `{word}`", if is_rate { "rate of the " } else { "" }, kind.title());
    match (unit.is_empty(), is_rate) {
        (true, _) => {}
        (false, true) => _ = write!(text, " [{unit}/s]"),
        (false, false) => _ = write!(text, " [{unit}]"),
    }
    if let Some(model) = model {
        let parts = components(declaration, model);
        if parts.len() > 1 && *name == word {
            let _ = write!(text, ", components {}", listed(&parts));
        }
        if word != name
            && let Some(param) = model.params.iter().find(|p| p.name == word)
        {
            let _ = write!(text, ", default {}", param.default);
        }
    }
    if !doc.is_empty() {
        let shown = if *kind == DeclarationKind::Model { declaration.doc.trim() } else { doc.as_str() };
        let _ = write!(text, "\n\n{shown}");
    }
    if matches!(kind, DeclarationKind::Velocity | DeclarationKind::Momentum)
        && let Some(model) = model.filter(|model| model.algebra.dim() > 0)
    {
        structure(&mut text, model);
    }
    text
}

/// The algebra that velocities of a model are in.
fn structure(text: &mut String, model: &Model) {
    let side = match model.action {
        Side::Left => "left action, ξ = g⁻¹ ġ (body frame)",
        Side::Right => "right action, ξ = ġ g⁻¹ (space frame)",
    };
    let _ = write!(text, "\n\n{}, dimension {}, {side}", model.algebra.name(), model.algebra.dim());
    let brackets = explain::brackets(model);
    if brackets.is_empty() {
        return;
    }
    text.push_str("\n\n```text\n");
    for (left, right) in brackets.iter().take(MAX_LISTED) {
        let _ = writeln!(text, "{left} = {right}");
    }
    if brackets.len() > MAX_LISTED {
        let _ = writeln!(text, ".. and {} more", brackets.len() - MAX_LISTED);
    }
    text.push_str("```");
}
