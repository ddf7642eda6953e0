//! Frames, algebroids and given rates: items of one block or one equation.
//!
//! Deliberately does not know: whether names exist, what a frame is used for.

use proc_macro2::{Delimiter, Ident};
use syn::buffer::Cursor;

use super::cursor::Parser;
use super::file::Outcome;
use super::lexer::Parsed;
use crate::spec::ast::*;
use crate::spec::diagnostic::{Diagnostic, Span};

impl Parser<'_> {
    /// `frame { u = r*phi_dot; }` behind its first word.
    pub(super) fn frame(&mut self) -> Parsed<ItemKind> {
        let (mut body, _) = self.require_group(Delimiter::Brace, "`{` with the quasi-velocities")?;
        let mut velocities = Vec::new();
        let form = "a quasi-velocity such as `u = r*phi_dot;`";
        body.entries(&mut |body| {
            let doc = body.docs()?;
            let name = body.declared(form)?;
            body.equals()?;
            let value = body.expr()?;
            body.require_punct(";")?;
            velocities.push(FrameVelocity { doc, name, value });
            Ok(())
        })?;
        if velocities.is_empty() {
            return body.expected(form);
        }
        Ok(ItemKind::Frame(velocities))
    }

    /// `algebroid { basis ..; velocities ..; anchor ..; [a, b] = ..; }` behind its first words.
    pub(super) fn algebroid(&mut self, span: Span, is_almost: bool) -> Parsed<ItemKind> {
        let (mut body, _) = self.require_group(Delimiter::Brace, "`{` with the basis")?;
        if body.word("basis").is_none() {
            return body.expected("`basis e1, e2, ..;`");
        }
        let basis = body.comma_separated(|p| p.ident("the name of a basis element"))?;
        body.require_punct(";")?;
        if body.word("velocities").is_none() {
            return body.expected("`velocities v1, v2, ..;`");
        }
        let velocities = body.comma_separated(|p| p.declared("the name of a velocity"))?;
        body.require_punct(";")?;
        let mut anchors = Vec::new();
        while body.word("anchor").is_some() {
            let rate = body.named("the rate of a coordinate, such as `x_dot`")?;
            body.equals()?;
            anchors.push((rate, body.expr()?));
            body.require_punct(";")?;
        }
        let mut rules = Vec::new();
        while !body.at_end() {
            rules.push(body.bracket_rule()?);
        }
        Ok(ItemKind::Algebroid(AlgebroidBlock { span, is_almost, basis, velocities, anchors, rules }))
    }

    /// `reduces "full.hamel" { Gamma = transpose(R)*[0, 0, 1]; }` behind its first word.
    pub(super) fn reduces(&mut self) -> Parsed<ItemKind> {
        let span = self.here();
        let Some(text) = self.string()? else { return self.expected("the file of a model in quotes") };
        let (mut body, _) =
            self.require_group(Delimiter::Brace, "`{` with functions of that model, or `{}`")?;
        let mut images = Vec::new();
        while !body.at_end() {
            let name = body.named("the name of a variable or a parameter of this model")?;
            body.equals()?;
            images.push((name, body.expr()?));
            body.require_punct(";")?;
        }
        Ok(ItemKind::Reduces(ReducesItem { file: Name { text, span }, images }))
    }

    /// `use "motor.hamel" as motor { k = 2; }` behind its first word, and whether it ends with a block.
    pub(super) fn part_used(&mut self) -> Parsed<(ItemKind, bool)> {
        let span = self.here();
        let Some(text) = self.string()? else { return self.expected("the file of a model in quotes") };
        self.require_word("as")?;
        let name = self.declared("the name of the part")?;
        let file = Name { text, span };
        let mut given = Vec::new();
        let Some((mut body, _)) = self.group(Delimiter::Brace) else {
            return Ok((ItemKind::Use(UseItem { file, name, given }), false));
        };
        while !body.at_end() {
            let name = body.named("the name of a parameter or an input of that model")?;
            body.equals()?;
            given.push((name, body.expr()?));
            body.require_punct(";")?;
        }
        Ok((ItemKind::Use(UseItem { file, name, given }), true))
    }

    /// `part motor "motor.hamel" { .. }`: a model that this one uses, as it was put into the text.
    pub(super) fn part(&mut self, outcome: &mut Outcome, items: &mut Vec<Item>) -> Parsed<()> {
        let start = self.here().start;
        self.require_word("part")?;
        let name = self.declared("the name of the part")?;
        let span = self.here();
        let Some(text) = self.string()? else { return self.expected("the file of a model in quotes") };
        let (mut inside, _) = self.require_group(Delimiter::Brace, "`{`")?;
        let (file, extent) = (Name { text, span }, Span::new(start, self.last));
        let (doc, mode) = (Vec::new(), None);
        items.push(Item { doc, extent, span: name.span, kind: ItemKind::Part { name, file }, mode });
        inside.items(outcome, items);
        Ok(())
    }

    /// `thermo` or `name: delta(v1) + delta(v2) = 0`, behind `virtual`.
    pub(super) fn displacements(&mut self) -> Parsed<ItemKind> {
        let is_thermo = |(word, rest): (Ident, Cursor<'_>)| {
            word == "thermo" && rest.punct().is_some_and(|(p, _)| p.as_char() == ';')
        };
        if self.cursor.ident().is_some_and(is_thermo) {
            self.require_word("thermo")?;
            return Ok(ItemKind::VirtualThermo);
        }
        let (name, gives) = self.name_of_equation()?;
        if let Some(first) = gives.first() {
            let message = "a condition on displacements is solved for none";
            return Err(Box::new(Diagnostic::new(Some(first.span), message).with_help("remove `for`")));
        }
        let (left, right) = self.equation("a condition on displacements", "delta(v1) + delta(v2) = 0")?;
        Ok(ItemKind::Virtual { name, left, right })
    }

    /// `u along x_dot`, behind `actuate`.
    pub(super) fn actuator(&mut self) -> Parsed<ItemKind> {
        let name = self.labelled("the name of the force")?;
        self.require_word("along")?;
        Ok(ItemKind::Actuate { name, along: self.expr()? })
    }

    /// `V = function rate -k*dV_du^2`, behind `lyapunov`.
    pub(super) fn lyapunov(&mut self) -> Parsed<ItemKind> {
        let name = self.labelled("the name of the function")?;
        self.equals()?;
        let function = self.expr()?;
        let rate = self.word("rate").map(|_| self.expr()).transpose()?;
        Ok(ItemKind::Lyapunov { name, function, rate })
    }

    /// `v = expression`, behind `acceleration` or `field`.
    pub(super) fn given(&mut self, what: &str) -> Parsed<(Name, Expr)> {
        let name = self.named(what)?;
        self.equals()?;
        Ok((name, self.expr()?))
    }

    /// `configuration R in SO(3) velocity Omega relative eta;`
    pub(super) fn configuration(&mut self) -> Parsed<ItemKind> {
        let names = self.comma_separated(|p| p.declared("the name of a configuration"))?;
        self.require_word("in")?;
        let group = self.algebra_expr()?;
        let by = if self.word("velocity").is_some() {
            MovedBy::Own(self.comma_separated(|p| p.declared("the name of a velocity"))?)
        } else if self.word("from").is_some() {
            MovedBy::Declared(self.comma_separated(|p| p.named("the name of a velocity"))?)
        } else if self.peek_punct(';') || self.peek_ident().is_some_and(|word| word == "relative") {
            MovedBy::Declared(Vec::new())
        } else {
            return self.expected(
                "`velocity` and names for the velocities that move it, `from` and their names, or `;`",
            );
        };
        let relative = match self.word("relative") {
            Some(_) => self.comma_separated(|p| p.named("the name of a velocity"))?,
            None => Vec::new(),
        };
        Ok(ItemKind::Configuration { names, group, by, relative })
    }
}
