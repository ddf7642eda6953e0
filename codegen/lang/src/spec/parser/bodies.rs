//! Forces at places and along velocities, and bodies.
//!
//! Deliberately does not know: whether names exist, what a body declares.

use proc_macro2::Delimiter;

use super::cursor::Parser;
use super::lexer::Parsed;
use crate::spec::ast::*;
use crate::spec::diagnostic::Diagnostic;

impl Parser<'_> {
    /// Whether `at` or `along` is next, and not as the name of a velocity.
    pub(super) fn is_applied(&self) -> bool {
        let Some((word, rest)) = self.cursor.ident() else { return false };
        let is_name = rest.punct().is_some_and(|(punct, _)| punct.as_char() == '=');
        (word == "at" || word == "along") && !is_name
    }

    /// `at p: F`, `along u: F`, behind the word `force`.
    pub(super) fn applied_force(&mut self) -> Parsed<ItemKind> {
        let is_place = self.word("at").is_some();
        if !is_place {
            self.require_word("along")?;
        }
        let on = self.expr()?;
        self.require_punct(":")?;
        Ok(ItemKind::AppliedForce { is_place, on, value: self.expr()? })
    }

    /// `on B: M`, behind the word `moment`: along the angular velocity of the body.
    pub(super) fn moment(&mut self) -> Parsed<ItemKind> {
        self.require_word("on")?;
        let name = self.part_of_body(BodyPart::Spin)?;
        self.require_punct(":")?;
        let on = Expr { node: Node::Name(name.text), span: name.span };
        Ok(ItemKind::AppliedForce { is_place: false, on, value: self.expr()? })
    }

    /// `frame tool on wrist at p attitude R` behind its first word.
    pub(super) fn named_frame(&mut self) -> Parsed<ItemKind> {
        let name = self.labelled("the name of the frame")?;
        let on =
            if self.word("on").is_some() { Some(self.labelled("the name of a frame before")?) } else { None };
        let mut parts: [(&str, Option<Expr>); 2] = [("at", None), ("attitude", None)];
        loop {
            let span = self.here();
            let Some((word, part)) = parts.iter_mut().find(|(word, _)| self.word(word).is_some()) else {
                break;
            };
            if part.is_some() {
                let problem = Diagnostic::new(Some(span), format!("`{word}` is written twice"));
                return Err(Box::new(problem.with_help("keep one of them")));
            }
            *part = Some(self.expr()?);
        }
        if !self.at_end() && !self.peek_punct(';') {
            return self.expected("`on`, `at`, `attitude` or `;`");
        }
        let [at, attitude] = parts.map(|(_, expr)| expr);
        Ok(ItemKind::NamedFrame { name, on, at, attitude })
    }

    /// `body B { mass m; inertia I; place p; attitude R; }` behind its first word; with `on wrist` behind the name it
    /// declares nothing, as frames are placed after everything else.
    pub(super) fn body(&mut self) -> Parsed<ItemKind> {
        let start = self.clone();
        let name = self.labelled("the name of a body")?;
        let on = if self.word("on").is_some() { Some(self.labelled("the name of a frame")?) } else { None };
        let (mut block, span) = self.require_group(
            Delimiter::Brace,
            "`on` and a frame, or `{` with mass and place, inertia and attitude",
        )?;
        let mut values: [(&str, Option<Expr>); 4] =
            [("mass", None), ("inertia", None), ("place", None), ("attitude", None)];
        while !block.at_end() {
            let here = block.here();
            let Some((word, value)) = values.iter_mut().find(|(word, _)| block.word(word).is_some()) else {
                return block.expected("`mass`, `inertia`, `place` or `attitude`");
            };
            if value.is_some() {
                let problem = Diagnostic::new(Some(here), format!("`{word}` is written twice"));
                return Err(Box::new(problem.with_help("keep one of them")));
            }
            *value = Some(block.expr()?);
            block.require_punct(";")?;
        }
        let [mass, inertia, place, attitude] = values.map(|(_, value)| value);
        let missing = match (&mass, &place, &inertia, &attitude) {
            (Some(_), None, ..) => Some(("a mass and no place", "add `place p;`, of the mass centre")),
            (None, Some(_), ..) => Some(("a place and no mass", "add `mass m;`")),
            (.., Some(_), None) if on.is_none() => {
                Some(("an inertia and no attitude", "add `attitude R;`, an angle or a matrix"))
            }
            (.., None, Some(_)) => {
                Some(("an attitude and no inertia", "add `inertia I;`, about the mass centre"))
            }
            (None, None, None, None) => {
                Some(("neither mass nor inertia", "write `body B { mass m; place p; }`"))
            }
            _ => None,
        };
        if let Some((what, help)) = missing {
            let problem = Diagnostic::new(Some(span), format!("body `{}` has {what}", name.text));
            return Err(Box::new(problem.with_help(help)));
        }
        let mut declared = Vec::new();
        if on.is_none() {
            declared.push(BodyPart::Energy);
            declared.extend(place.iter().flat_map(|_| [BodyPart::Velocity, BodyPart::Momentum]));
            declared.extend(attitude.iter().flat_map(|_| [BodyPart::Spin, BodyPart::AngularMomentum]));
        }
        let mut parts = Vec::new();
        for part in declared {
            let mut named = start.clone();
            parts.push((part, named.declared_with(part.ending())?));
        }
        Ok(ItemKind::Body(BodyItem { name, on, mass, inertia, place, attitude, parts }))
    }
}
