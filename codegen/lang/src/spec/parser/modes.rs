//! Events, and modes with the items that stand in them.
//!
//! Deliberately does not know: whether names exist, what follows from an event.

use proc_macro2::Delimiter;

use super::cursor::Parser;
use super::file::Outcome;
use super::lexer::Parsed;
use crate::spec::ast::*;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::event::EventDirection;

impl<'a> Parser<'a> {
    /// `mode stance { constraint ..; event ..; }`: the mode, then its items.
    pub(super) fn mode(
        &mut self,
        doc: Vec<String>,
        outcome: &mut Outcome,
        items: &mut Vec<Item>,
    ) -> Parsed<()> {
        let start = self.here().start;
        self.require_word("mode")?;
        let name = self.declared("the name of the mode")?;
        let span = Span::new(start, self.last);
        items.push(Item { doc, extent: span, span, kind: ItemKind::Mode(name.clone()), mode: None });
        let Some((mut inside, _)) = self.group(Delimiter::Brace) else {
            return self.require_punct(";").map(drop);
        };
        let from = items.len();
        inside.items(outcome, items);
        for item in &mut items[from..] {
            match item.kind {
                ItemKind::Constraint { .. }
                | ItemKind::Virtual { .. }
                | ItemKind::Force { .. }
                | ItemKind::AppliedForce { .. }
                | ItemKind::Event(_) => item.mode = Some(name.clone()),
                _ => {
                    let problem = Diagnostic::new(Some(item.span), "this item belongs to no mode");
                    let help = "in a mode stand `constraint`, `virtual`, `force` and `event`; move it out";
                    outcome.problems.push(problem.with_help(help));
                }
            }
        }
        Ok(())
    }

    /// An event, and whether it ends with a block.
    pub(super) fn event(&mut self) -> Parsed<(ItemKind, bool)> {
        let name = self.labelled("the name of the event")?;
        let (value, direction) = if self.word("when").is_some() {
            (self.negative_when()?, EventDirection::Below)
        } else {
            self.equals()?;
            let value = self.expr()?;
            let direction = if self.word("rising").is_some() {
                EventDirection::Rising
            } else if self.word("falling").is_some() {
                EventDirection::Falling
            } else {
                EventDirection::Either
            };
            (value, direction)
        };
        let mut event = EventItem { name, value, direction, sets: Vec::new(), acts: Vec::new(), stop: None };
        let Some((mut body, _)) = self.group(Delimiter::Brace) else {
            if self.peek_ident().is_some() {
                return self.expected(match direction {
                    EventDirection::Below => "`{` or `;`",
                    _ => "`rising`, `falling`, `{` or `;`",
                });
            }
            return Ok((ItemKind::Event(event), false));
        };
        while !body.at_end() {
            body.statement_of_event(&mut event)?;
            body.require_punct(";")?;
        }
        Ok((ItemKind::Event(event), true))
    }

    /// `a - b` of `a < b`, `b - a` of `a > b`.
    fn negative_when(&mut self) -> Parsed<Expr> {
        let start = self.here();
        let comparisons = self.comparisons()?;
        let [Comparison { first, rest }] = comparisons.as_slice() else {
            return self.expected("one comparison");
        };
        let [(compare, second)] = rest.as_slice() else { return self.expected("one comparison") };
        let (low, high) = match compare {
            Compare::Less => (first, second),
            Compare::Greater => (second, first),
            _ => {
                let span = start.to(Span::new(self.last, self.last));
                let problem = Diagnostic::new(Some(span), "an event happens when something becomes less");
                return Err(Box::new(problem.with_help("write `event name when a < b` or `a > b`")));
            }
        };
        let span = first.span.to(second.span);
        let node = Node::Sum(vec![(false, low.clone()), (true, high.clone())]);
        Ok(Expr { node, span })
    }

    fn statement_of_event(&mut self, event: &mut EventItem) -> Parsed<()> {
        let here = self.here();
        if self.word("then").is_some() {
            let target = self.named("the name of what the event sets")?;
            self.equals()?;
            event.sets.push((target, self.expr()?));
        } else if self.word("enter").is_some() {
            event.acts.push(Act::Enter(self.named("the name of a mode")?));
        } else if self.word("leave").is_some() {
            event.acts.push(Act::Leave(self.named("the name of a mode")?));
        } else if self.word("impact").is_some() {
            let mode = self.named("the name of a mode")?;
            let with = self.word("with").map(|_| self.expr()).transpose()?;
            event.acts.push(Act::Impact(mode, with));
        } else if self.word("stop").is_some() {
            if event.stop.is_some() {
                let problem = Diagnostic::new(Some(here), "`stop` is written twice");
                return Err(Box::new(problem.with_help("keep one of them")));
            }
            event.stop = Some(here);
        } else {
            return self.expected("`then`, `enter`, `leave`, `impact` or `stop`");
        }
        Ok(())
    }
}
