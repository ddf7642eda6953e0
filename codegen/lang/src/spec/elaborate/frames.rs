//! What velocities are: those of a frame, those of an algebroid.
//!
//! Deliberately does not know: what is linear, what can be inverted.

use super::values::Elaboration;
use crate::spec::ast::{AlgebroidBlock, Expr, Item, ItemKind};
use crate::spec::builder::{DeclaredAs, SectionBracket};
use crate::spec::value::Value;

/// Expressions that have to be known before anything that contains velocities.
pub(super) fn expressions(items: &[Item]) -> Vec<&Expr> {
    let mut list = Vec::new();
    for item in items {
        match &item.kind {
            ItemKind::Frame(velocities) => list.extend(velocities.iter().map(|v| &v.value)),
            ItemKind::Algebroid(block) => list.extend(block.anchors.iter().map(|(_, value)| value)),
            _ => {}
        }
    }
    list
}

impl Elaboration<'_> {
    pub(super) fn define_frames(&mut self, items: &[Item]) {
        for item in items {
            let ItemKind::Algebroid(block) = &item.kind else { continue };
            for (rate, value) in &block.anchors {
                if let Some(value) = self.eval(value) {
                    self.builder.at(Some(rate.span)).anchor(&rate.text, &value);
                } else {
                    self.builder.broken.insert("algebroid");
                }
            }
            self.builder.at(Some(block.span)).settle_anchor();
        }
        let mut is_framed = false;
        for item in items {
            let ItemKind::Frame(velocities) = &item.kind else { continue };
            is_framed = true;
            for velocity in velocities {
                let name = &velocity.name;
                let doc = if velocity.doc.is_empty() { &item.doc } else { &velocity.doc };
                match self.eval(&velocity.value) {
                    Some(value) => {
                        let builder = self.builder.at(Some(name.span));
                        builder.frame_velocity(&name.text, &value, &doc.join("\n"));
                    }
                    None => {
                        self.poisoned.insert(name.text.clone());
                        self.builder.broken.insert("frame");
                    }
                }
            }
        }
        if is_framed {
            self.builder.settle_frame();
        }
    }

    /// Velocities of an algebroid, before its anchor is known.
    pub(super) fn declare_algebroid(&mut self, item: &Item, block: &AlgebroidBlock) {
        let named = |names: &[crate::spec::ast::Name]| -> Vec<_> {
            names.iter().map(|n| (n.text.clone(), Some(n.span))).collect()
        };
        let (basis, velocities) = (named(&block.basis), named(&block.velocities));
        let builder = self.builder.at(Some(block.span));
        builder.located_algebroid(&basis, &velocities, block.is_almost, &item.doc.join("\n"));
    }

    /// Brackets: combinations of the basis with coefficients on the base.
    pub(super) fn brackets_of_algebroid(&mut self, block: &AlgebroidBlock) {
        // Elements of the basis are known in brackets and nowhere else.
        let mut sections = Vec::new();
        for element in &block.basis {
            if !self.builder.at(Some(element.span)).declare(&element.text, DeclaredAs::Section) {
                self.builder.broken.insert("algebroid");
                return;
            }
            let symbol = self.builder.graph.symbol(&element.text);
            let value = Value::Scalar(self.builder.graph.sym(symbol));
            self.builder.bind(&element.text, &value);
            sections.push(symbol);
        }
        for rule in &block.rules {
            let value = self.eval(&rule.value);
            let Some(value) = value else {
                self.builder.broken.insert("algebroid");
                continue;
            };
            let pair = [&rule.left, &rule.right].map(|name| (name.text.clone(), Some(name.span)));
            let rule = SectionBracket { pair, value, span: Some(rule.span) };
            self.builder.section_bracket(rule, &sections);
        }
        for element in &block.basis {
            self.builder.values.remove(&element.text);
        }
    }
}
