//! What a model takes of one of its parts: the text of its items, with other names.
//!
//! Deliberately does not know: what the items mean for a motion.

use std::ops::Range;

use super::super::ast::{
    Carry, Expr, File, Item, ItemKind, MovedBy, Name, Node, ReconstructWay, Shape, UseItem,
};
use super::super::diagnostic::{Diagnostic, Origin, Span};
use super::super::model::{Model, Side};
use super::super::names;
use super::super::outline::{DeclarationKind, Outline};
use super::super::parser;
use super::super::tokens::tokens;

/// A model that another one uses.
pub(super) struct Part {
    /// Where it is used, and its name there.
    pub(super) name: Name,
    pub(super) model: Model,
    origin: Origin,
    file: File,
    given: Vec<(Name, Expr)>,
    /// Insertions and deletions in the text, in order and apart from each other.
    pub(super) edits: Vec<(Range<usize>, String)>,
    /// Parameters in the place of which the model that uses it gives values.
    pub(super) bound: Vec<String>,
    /// Where a name has to be put behind that of the part.
    renamed: Vec<usize>,
    /// Names of constraints whose multipliers have names.
    multipliers: Vec<String>,
}

impl Part {
    /// `host`: the items of the model that uses it, whose initial values stand in the place of its own.
    ///
    /// # Errors
    /// An item that a part cannot have, a given name that is none of it.
    pub(super) fn new(
        (item, used): (&Item, &UseItem),
        host: &[Item],
        origin: Origin,
        model: Model,
    ) -> Result<Part, Box<Diagnostic>> {
        let file = parser::parse_leniently(&origin.text).file;
        let Some(file) = file else {
            let message = format!("`{}` is no model", used.file.text);
            return Err(Box::new(Diagnostic::new(Some(used.file.span), message)));
        };
        for item in &file.items {
            if let Some(what) = refused(item, &file) {
                let (line, _) = origin.line_column(item.span.start);
                let message = format!("`{}` cannot be a part: it has {what} in line {line}", used.file.text);
                let help = "a part has a Lagrangian in coordinates and velocities of its own algebra";
                return Err(Box::new(Diagnostic::new(Some(used.file.span), message).with_help(help)));
            }
        }
        let (name, given) = (used.name.clone(), used.given.clone());
        let (renamed, multipliers) = renamed(&origin.text, &file);
        let (edits, bound) = (Vec::new(), Vec::new());
        let mut part = Part { name, model, origin, file, given, edits, bound, renamed, multipliers };
        part.check_given(item)?;
        part.edit(host);
        Ok(part)
    }

    /// The name of something of the part in the whole.
    pub(super) fn renamed(&self, name: &str) -> String {
        match multiplier_of(name, &self.multipliers) {
            Some(constraint) => format!("lambda_{}_{constraint}", self.name.text),
            None => format!("{}_{name}", self.name.text),
        }
    }

    fn check_given(&mut self, item: &Item) -> Result<(), Box<Diagnostic>> {
        let mut seen: Vec<&str> = Vec::new();
        for (name, _) in &self.given {
            if seen.contains(&name.text.as_str()) {
                let message = format!("`{}` is given twice", name.text);
                return Err(Box::new(
                    Diagnostic::new(Some(name.span), message).with_help("keep one of them"),
                ));
            }
            seen.push(&name.text);
            let found = self.file.items.iter().find_map(|item| match &item.kind {
                ItemKind::Param { name: own, shape, .. } | ItemKind::Input { name: own, shape, .. } => {
                    (own.text == name.text).then_some(shape)
                }
                _ => None,
            });
            let Some(shape) = found else {
                let known = self.file.items.iter().filter_map(|item| match &item.kind {
                    ItemKind::Param { name, .. } | ItemKind::Input { name, .. } => Some(name.text.as_str()),
                    _ => None,
                });
                return Err(unknown(name, &self.model, known));
            };
            if !is_given(shape) {
                let message = format!("`{}` is a matrix, which cannot be given", name.text);
                let help = "numbers and vectors can; set its entries by `fix` in a scene";
                let place = "of this part";
                let problem = Diagnostic::new(Some(name.span), message).with_help(help);
                return Err(Box::new(problem.with_place(Some(item.span), place)));
            }
        }
        let of_params = self.file.items.iter().filter_map(|item| match &item.kind {
            ItemKind::Param { name, .. } => Some(name.text.clone()),
            _ => None,
        });
        let params: Vec<String> = of_params.collect();
        let given = self.given.iter().map(|(name, _)| name.text.clone());
        self.bound = given.filter(|name| params.contains(name)).collect();
        Ok(())
    }

    /// Finds what changes in the text.
    fn edit(&mut self, host: &[Item]) {
        let before = format!("{}_", self.name.text);
        let names = self.renamed.iter().map(|at| (*at..*at, before.clone()));
        let mut edits: Vec<(Range<usize>, String)> = names.collect();
        let is_given_anew = |name: &Name| {
            let whole = self.renamed(&name.text);
            host.iter().any(|item| matches!(&item.kind, ItemKind::Initial { name, .. } if name.text == whole))
        };
        for item in &self.file.items {
            let is_bound = |name: &Name| self.bound.contains(&name.text);
            match &item.kind {
                ItemKind::Param { name, .. } if is_bound(name) => {
                    edits.push((item.extent.start..item.extent.end, String::new()));
                }
                ItemKind::Initial { name, .. } if is_given_anew(name) => {
                    edits.push((item.extent.start..item.extent.end, String::new()));
                }
                ItemKind::Momentum { velocity, .. } if velocity.text == "stages" => {
                    edits.push((item.extent.start..item.extent.end, String::new()));
                }
                kind if stays_behind(kind) => {
                    edits.push((item.extent.start..item.extent.end, String::new()));
                }
                ItemKind::Reconstruct { way: ReconstructWay::Group { from, .. }, .. } if from.is_empty() => {
                    edits.push((item.span.end..item.span.end, self.moved_by_own()));
                }
                ItemKind::Configuration { by: MovedBy::Declared(list), group, .. } if list.is_empty() => {
                    edits.push((group.span.end..group.span.end, self.moved_by_own()));
                }
                _ => {}
            }
        }
        edits.sort_by_key(|(range, _)| (range.start, std::cmp::Reverse(range.end)));
        let mut end = 0;
        edits.retain(|(range, _)| {
            let is_free = range.start >= end;
            end = end.max(range.end);
            is_free
        });
        self.edits = edits;
    }

    /// ` from a_Omega`, all velocities of the part in its algebra.
    fn moved_by_own(&self) -> String {
        let own = self.file.items.iter().flat_map(|item| match &item.kind {
            ItemKind::Velocity { names, .. } | ItemKind::Configuration { by: MovedBy::Own(names), .. } => {
                names.as_slice()
            }
            _ => &[],
        });
        let own: Vec<String> = own.map(|name| self.renamed(&name.text)).collect();
        if own.is_empty() { String::new() } else { format!(" from {}", own.join(", ")) }
    }

    /// A piece of the text with the edits in it.
    fn text(&self, range: Range<usize>) -> String {
        let (mut text, mut at) = (String::new(), range.start);
        for (edited, new) in &self.edits {
            if edited.start < at || edited.end > range.end {
                continue;
            }
            text.push_str(&self.origin.text[at..edited.start]);
            text.push_str(new);
            at = edited.end;
        }
        text.push_str(&self.origin.text[at..range.end]);
        text
    }

    /// The part as a block of the model that uses it, whose text is `host`.
    pub(super) fn block(&self, host: &str) -> String {
        let all = tokens(&self.origin.text);
        let mut braces = all.iter().filter(|token| token.is("{") && token.start > self.file.name.span.start);
        let begin = braces.next().map_or(0, |token| token.start + 1);
        let end = all.iter().rev().find(|token| token.is("}")).map_or(begin, |token| token.start);
        let mut text = format!("\npart {} \"{}\" {{", self.name.text, self.origin.file.escape_default());
        text.push_str(&self.text(begin..end));
        for (name, value) in &self.given {
            let value = &host[value.span.start..value.span.end];
            let whole = self.renamed(&name.text);
            if !self.bound.contains(&name.text) {
                continue;
            }
            text.push_str(&format!("\nlet {whole} = {value};"));
            for k in 1..=self.length(name) {
                text.push_str(&format!("\nlet {whole}{k} = {whole}[{k}];"));
            }
            if let Some(range) = self.conditions(name) {
                text.push_str(&format!("\nrequire {};", self.whole_text(range)));
            }
        }
        text.push_str("\n}\n");
        text
    }

    /// What drives its inputs in the model that uses it.
    pub(super) fn drives(&self, host: &str) -> String {
        let inputs = self.given.iter().filter(|(name, _)| !self.bound.contains(&name.text));
        let drive = |(name, value): &(Name, Expr)| {
            let value = &host[value.span.start..value.span.end];
            format!("\ndrive {} = {value};", self.renamed(&name.text))
        };
        inputs.map(drive).collect()
    }

    /// Components of a parameter that have names of their own: none of a number.
    fn length(&self, name: &Name) -> usize {
        let array = self.model.param_arrays.iter().find(|array| array.name == name.text);
        array.map_or(0, |array| array.symbols.len())
    }

    /// Where the conditions on a parameter stand.
    fn conditions(&self, name: &Name) -> Option<Range<usize>> {
        self.file.items.iter().find_map(|item| match &item.kind {
            ItemKind::Param { name: own, conditions, .. } if own.text == name.text => {
                let start = conditions.first()?.first.span.start;
                let end = conditions.last()?.rest.last()?.1.span.end;
                Some(start..end)
            }
            _ => None,
        })
    }

    /// A piece of an item that is taken out, with its names.
    fn whole_text(&self, range: Range<usize>) -> String {
        let (mut text, mut at) = (String::new(), range.start);
        for &place in self.renamed.iter().filter(|place| range.contains(place)) {
            text.push_str(&self.origin.text[at..place]);
            text.push_str(&self.name.text);
            text.push('_');
            at = place;
        }
        text.push_str(&self.origin.text[at..range.end]);
        text
    }

    /// The side from which its group acts, where it has one.
    fn side(&self) -> Option<Side> {
        (!self.model.velocities.is_empty()).then_some(self.model.action)
    }

    fn has(&self, kind: fn(&ItemKind) -> bool) -> bool {
        self.file.items.iter().any(|item| kind(&item.kind))
    }
}

/// The constraint whose multiplier has a name, or that constraint with the number of its component.
fn multiplier_of<'n>(name: &'n str, constraints: &[String]) -> Option<&'n str> {
    let rest = name.strip_prefix("lambda_")?;
    let stem = rest.trim_end_matches(|c: char| c.is_ascii_digit());
    constraints.iter().any(|own| own == rest || own == stem).then_some(rest)
}

/// Where names that a text declares stand, in order: of everything but the model, scenes and basis elements; and the
/// names of constraints whose multipliers have names, as far as nothing else has these.
fn renamed(text: &str, file: &File) -> (Vec<usize>, Vec<String>) {
    use DeclarationKind::{BasisElement, Model, Scene};
    let outline = Outline::new(text);
    let is_renamed = |kind: DeclarationKind| !matches!(kind, Model | Scene | BasisElement);
    let mentions = outline.mentions.iter().filter(|m| is_renamed(outline.declarations[m.declaration].kind));
    let mut places: Vec<usize> = mentions.map(|mention| mention.name.start).collect();
    let is_declared = |multiplier: &str| outline.declarations.iter().any(|own| own.name == multiplier);
    let constraints: Vec<String> = file
        .items
        .iter()
        .filter_map(name_of_constraint)
        .map(|name| name.text.clone())
        .filter(|name| !is_declared(&format!("lambda_{name}")))
        .collect();
    for token in tokens(text) {
        if multiplier_of(token.text, &constraints).is_some() && !is_declared(token.text) {
            places.push(token.start + "lambda_".len());
        }
    }
    let parts = file.items.iter().filter_map(|item| match &item.kind {
        ItemKind::Part { name, .. } => Some(name.span.start),
        _ => None,
    });
    places.extend(parts);
    places.sort_unstable();
    places.dedup();
    (places, constraints)
}

/// What may be said of a parameter or an input of a part: a number, or a vector of numbers.
fn is_given(shape: &Shape) -> bool {
    matches!(shape, Shape::Scalar | Shape::Vector(_))
}

/// A name that stands for nothing in a part.
fn unknown<'a>(name: &Name, part: &Model, known: impl IntoIterator<Item = &'a str>) -> Box<Diagnostic> {
    let message = format!("{} has no parameter or input `{}`", part.name, name.text);
    Box::new(Diagnostic::new(Some(name.span), message).with_help(names::suggest(&name.text, known)))
}

fn name_of_constraint(item: &Item) -> Option<&Name> {
    match &item.kind {
        ItemKind::Constraint { name, .. } | ItemKind::Virtual { name, .. } => name.as_ref(),
        _ => None,
    }
}

/// Items about a model for itself: its scenes, stages and state, its claims, where it comes from.
/// Words that a model has once are said by [`once`] and [`side`].
fn stays_behind(kind: &ItemKind) -> bool {
    matches!(
        kind,
        ItemKind::Source(_)
            | ItemKind::Topic(_)
            | ItemKind::Scene { .. }
            | ItemKind::Reduces(_)
            | ItemKind::Casimir { .. }
            | ItemKind::Section { .. }
            | ItemKind::Stage { .. }
            | ItemKind::InnerProduct(_)
            | ItemKind::LagrangianInnerProduct
            | ItemKind::Independent(_)
            | ItemKind::Carry(_)
            | ItemKind::Want(_)
            | ItemKind::Use(_)
            | ItemKind::Action(_)
            | ItemKind::Multipliers
            | ItemKind::VirtualThermo
    )
}

/// Why an item keeps its model from being a part.
fn refused(item: &Item, file: &File) -> Option<String> {
    Some(match &item.kind {
        ItemKind::Hamiltonian(_) | ItemKind::MomentumIn { .. } => "a Hamiltonian".to_owned(),
        ItemKind::Actuate { .. } | ItemKind::Lyapunov { .. } => {
            "a force that follows from a function".to_owned()
        }
        ItemKind::Algebroid(_) => "an algebroid of its own".to_owned(),
        ItemKind::Acceleration { .. } | ItemKind::Field { .. } => "a motion that is given".to_owned(),
        ItemKind::DerivedConnection(_) => "a connection that its Lagrangian defines".to_owned(),
        ItemKind::Carry(list) if list.iter().any(|carry| matches!(carry, Carry::Level { .. })) => {
            "a momentum that is a parameter".to_owned()
        }
        ItemKind::Velocity { labels, .. } | ItemKind::Advected { labels, .. } if !labels.is_empty() => {
            "names of components, `as`,".to_owned()
        }
        ItemKind::Advected { name, action: Expr { node: Node::Name(by), .. }, .. } if !is_value(by, file) => {
            format!("`{}` moved by `{by}`", name.text)
        }
        _ => return None,
    })
}

/// Whether a name stands for a value of the model, and not for a representation.
fn is_value(name: &str, file: &File) -> bool {
    file.items.iter().any(|item| matches!(&item.kind, ItemKind::Let { name: own, .. } if own.text == name))
}

/// `action right;` where parts say so and the model does not.
///
/// # Errors
/// Parts whose groups act from different sides.
pub(super) fn side(items: &[Item], parts: &[Part]) -> Result<String, Box<Diagnostic>> {
    let said = items.iter().find_map(|item| match &item.kind {
        ItemKind::Action(side) => Some(if side.text == "right" { Side::Right } else { Side::Left }),
        _ => None,
    });
    let has_own = items.iter().any(|item| {
        let own = |by: &MovedBy| matches!(by, MovedBy::Own(_));
        match &item.kind {
            ItemKind::Velocity { .. } => true,
            ItemKind::Configuration { by, .. } => own(by),
            _ => false,
        }
    });
    let mut side = said.or_else(|| has_own.then_some(Side::Left));
    for part in parts {
        let Some(own) = part.side() else { continue };
        if *side.get_or_insert(own) != own {
            let word = if own == Side::Right { "right" } else { "left" };
            let message =
                format!("the group of `{}` acts from the {word}, others from the other side", part.name.text);
            let help = "groups of one model act from one side";
            return Err(Box::new(Diagnostic::new(Some(part.name.span), message).with_help(help)));
        }
    }
    let is_new = side == Some(Side::Right) && said.is_none();
    Ok(if is_new { "\naction right;".to_owned() } else { String::new() })
}

/// Words that a model has once, where a part has them and the model does not.
pub(super) fn once(items: &[Item], parts: &[Part]) -> String {
    let missing = |word: &str, is: fn(&ItemKind) -> bool| {
        let is_new = parts.iter().any(|part| part.has(is)) && !items.iter().any(|item| is(&item.kind));
        if is_new { format!("\n{word}") } else { String::new() }
    };
    missing("multipliers;", |kind| matches!(kind, ItemKind::Multipliers))
        + &missing("virtual thermo;", |kind| matches!(kind, ItemKind::VirtualThermo))
}

/// A text with blanks in the place of some of it.
pub(super) fn blanked(text: &str, spans: &[Span]) -> String {
    let mut bytes = text.as_bytes().to_vec();
    for span in spans {
        for byte in &mut bytes[span.start..span.end] {
            if *byte != b'\n' {
                *byte = b' ';
            }
        }
    }
    String::from_utf8(bytes).unwrap_or_default()
}
