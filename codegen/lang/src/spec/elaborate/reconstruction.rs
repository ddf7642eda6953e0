//! Reconstructed coordinates, whose names nothing but reconstruction itself sees.
//!
//! Deliberately does not know: the other items.

use super::values::Elaboration;
use crate::spec::ast::{AlgebraExpr, AlgebraNode, Item, ItemKind, ReconstructWay};
use crate::spec::diagnostic::Span;
use crate::spec::group::Group;
use crate::spec::matrix_group::{MatrixFamily, MatrixGroup, MatrixSpace};
use crate::spec::names;

impl Elaboration<'_> {
    /// Nothing but reconstruction itself sees reconstructed coordinates.
    pub(super) fn withhold(&mut self, items: &[Item]) {
        for item in items {
            let ItemKind::Reconstruct { names, way } = &item.kind else { continue };
            let plain: Vec<&str> = names.iter().map(|n| n.text.as_str()).collect();
            self.withheld.extend(plain.iter().map(|n| (*n).to_owned()));
            if let ReconstructWay::Group { group, .. } = way
                && let Some(blocks) = group_of(group).and_then(|group| group.coordinates(&plain))
            {
                self.withheld.extend(blocks.iter().map(|block| block.name.clone()));
                self.withheld.extend(blocks.into_iter().flat_map(|block| block.components));
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
            // Several coordinates may be in the rates of all of them.
            ReconstructWay::Rate(rate) if located.len() > 1 => {
                let Some(draft) = self.builder.at(Some(span)).declared_rates(&located, &doc) else { return };
                if let Some(rate) = self.eval(rate) {
                    self.builder.at(Some(span)).with_rates(draft, &rate);
                }
            }
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
                None => self.unknown_group(group),
            },
        }
        if self.builder.problems.len() > before {
            self.builder.broken.insert("reconstruct");
            self.poisoned.extend(names.iter().map(|n| n.text.clone()));
        }
    }

    fn unknown_group(&mut self, group: &AlgebraExpr) {
        let written = self.one_line(group.span);
        let known = Group::NAMED.iter().map(|(name, _)| *name);
        // `SU(2)` is one letter from `SE(2)` and another group: only the case is a slip.
        let help = match known.clone().find(|name| name.eq_ignore_ascii_case(&written)) {
            Some(name) => format!("did you mean `{name}`?"),
            None => {
                let families = Group::OF_MATRICES.iter().map(|(name, _)| *name);
                let others = ["R^n", "matrices(SO(3))", "semidirect(SO(3), standard)"];
                let all: Vec<&str> = known.chain(families).chain(others).collect();
                format!("legal here: {}", names::list(&all))
            }
        };
        self.problem(group.span, format!("unknown group `{written}`"), help);
    }

    /// The group of a configuration; anything else is a problem.
    pub(super) fn group_of_configuration(&mut self, group: &AlgebraExpr) -> Option<MatrixGroup> {
        let found = matrices_of(group);
        if found.is_none() {
            match group_of(group) {
                Some(Group::Translation(n)) => {
                    let help = format!("write `coordinate x: vector({n}) in real;`");
                    self.problem(group.span, format!("R^{n} is no group of matrices"), help);
                }
                Some(_) => {
                    let help = "write `coordinate theta in angle;`";
                    self.problem(group.span, "a rotation of the plane is an angle", help);
                }
                None => self.unknown_group(group),
            }
        }
        found
    }
}

/// The group of matrices of that expression, its rotations by a matrix, if it is one.
pub(super) fn matrices_of(expr: &AlgebraExpr) -> Option<MatrixGroup> {
    let AlgebraNode::Call(name, arguments) = &expr.node else { return None };
    let group = match (name.text.as_str(), arguments.as_slice()) {
        ("SO", [AlgebraExpr { node: AlgebraNode::Number(2), .. }]) => None,
        ("matrices" | "semidirect", _) => group_of(expr),
        _ => of_matrices(expr, &[]),
    };
    match group? {
        Group::Matrices(group) => Some(*group),
        _ => None,
    }
}

/// The group of that expression; none where there is none.
fn group_of(expr: &AlgebraExpr) -> Option<Group> {
    match &expr.node {
        AlgebraNode::Name(name) if name == "R" => Some(Group::Translation(1)),
        AlgebraNode::Power(n) => Some(Group::Translation(*n)),
        AlgebraNode::Call(name, arguments) => match (name.text.as_str(), arguments.as_slice()) {
            ("matrices", [inner]) => of_matrices(inner, &[]),
            ("semidirect", [inner, spaces @ ..]) if !spaces.is_empty() => {
                let spaces: Option<Vec<MatrixSpace>> = spaces.iter().map(space_of).collect();
                of_matrices(inner, &spaces?)
            }
            (family, [AlgebraExpr { node: AlgebraNode::Number(n), .. }]) => {
                let written = format!("{family}({n})");
                let named = Group::NAMED.iter().find(|(known, _)| *known == written);
                let least =
                    Group::OF_MATRICES.iter().find(|(known, _)| known.strip_suffix("(n)") == Some(family));
                match (named, least) {
                    (Some((_, group)), _) => Some(group.clone()),
                    (None, Some((_, least))) if n >= least => of_matrices(expr, &[]),
                    _ => None,
                }
            }
            _ => None,
        },
        _ => None,
    }
}

/// A group of matrices, by its family and number, with spaces.
fn of_matrices(expr: &AlgebraExpr, spaces: &[MatrixSpace]) -> Option<Group> {
    let AlgebraNode::Call(name, arguments) = &expr.node else { return None };
    let [AlgebraExpr { node: AlgebraNode::Number(n), .. }] = arguments.as_slice() else { return None };
    let (_, family) = MatrixFamily::NAMED.iter().find(|(known, _)| *known == name.text)?;
    // Of larger ones the algebras are not made either.
    let largest = match family {
        MatrixFamily::SpecialOrthogonal | MatrixFamily::Euclidean => 10,
        _ => 8,
    };
    let group = MatrixGroup::new(*family, Some(*n).filter(|n| *n <= largest)?, spaces).ok()?;
    Some(Group::Matrices(Box::new(group)))
}

/// `standard`, or `trivial(n)`.
fn space_of(expr: &AlgebraExpr) -> Option<MatrixSpace> {
    match &expr.node {
        AlgebraNode::Name(name) if name == "standard" => Some(MatrixSpace::Standard),
        AlgebraNode::Call(name, arguments) if name.text == "trivial" => match arguments.as_slice() {
            [AlgebraExpr { node: AlgebraNode::Number(n), .. }] => Some(MatrixSpace::Trivial(*n)),
            _ => None,
        },
        _ => None,
    }
}
