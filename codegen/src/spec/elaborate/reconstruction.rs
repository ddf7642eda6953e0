//! Reconstructed coordinates, whose names nothing but reconstruction itself sees.
//!
//! Deliberately does not know: the other items.

use super::values::Elaboration;
use crate::spec::ast::{AlgebraExpr, AlgebraNode, Item, ItemKind, ReconstructWay};
use crate::spec::diagnostic::Span;
use crate::spec::group::Group;
use crate::spec::names;

impl Elaboration<'_> {
    /// Nothing but reconstruction itself sees reconstructed coordinates.
    pub(super) fn withhold(&mut self, items: &[Item]) {
        for item in items {
            let ItemKind::Reconstruct { names, way } = &item.kind else { continue };
            let plain: Vec<&str> = names.iter().map(|n| n.text.as_str()).collect();
            self.withheld.extend(plain.iter().map(|n| (*n).to_owned()));
            if let ReconstructWay::Group { group, .. } = way
                && let Some(components) = group_of(group).and_then(|group| group.coordinates(&plain))
            {
                self.withheld.extend(components.into_iter().flatten());
            }
        }
    }

    pub(super) fn reconstruct(&mut self, item: &Item) {
        let ItemKind::Reconstruct { names, way } = &item.kind else { return };
        let located: Vec<(&str, Option<Span>)> =
            names.iter().map(|n| (n.text.as_str(), Some(n.span))).collect();
        let span = names.first().map_or(item.span, |n| n.span).to(names.last().map_or(item.span, |n| n.span));
        let doc = item.doc.join("\n");
        let before = self.builder.problems.len();
        match way {
            ReconstructWay::Rate(rate) => {
                if let Some(rate) = self.eval(rate) {
                    self.builder.at(Some(span)).located_rate(&located, &rate, &doc);
                }
            }
            ReconstructWay::Group { group, from } => match group_of(group) {
                Some(group) => {
                    let from = from.iter().map(|n| (n.text.clone(), Some(n.span))).collect();
                    self.builder.at(Some(span)).located_group(&located, group, from, &doc);
                }
                None => {
                    let written = self.one_line(group.span);
                    let mut known = Group::NAMED.iter().map(|(name, _)| *name);
                    // `SU(2)` is one letter from `SE(2)` and another group: only the case is a slip.
                    let help = match known.clone().find(|name| name.eq_ignore_ascii_case(&written)) {
                        Some(name) => format!("did you mean `{name}`?"),
                        None => format!(
                            "legal here: {}",
                            names::list(&known.by_ref().chain(["R^n"]).collect::<Vec<_>>())
                        ),
                    };
                    self.problem(group.span, format!("unknown group `{written}`"), help);
                }
            },
        }
        if self.builder.problems.len() > before {
            self.builder.broken.insert("reconstruct");
            self.poisoned.extend(names.iter().map(|n| n.text.clone()));
        }
    }
}

fn group_of(expr: &AlgebraExpr) -> Option<Group> {
    match &expr.node {
        AlgebraNode::Name(name) if name == "R" => Some(Group::Translation(1)),
        AlgebraNode::Power(n) => Some(Group::Translation(*n)),
        AlgebraNode::Call(name, arguments) => {
            let [AlgebraExpr { node: AlgebraNode::Number(n), .. }] = arguments.as_slice() else {
                return None;
            };
            let written = format!("{}({n})", name.text);
            Group::NAMED.iter().find(|(known, _)| *known == written).map(|(_, group)| *group)
        }
        _ => None,
    }
}
