//! The sizes of a file, what stands for whole numbers within loops, and names with an index.
//!
//! A file is read as if its loops were written out: where a size or the index of a loop stands in an expression, the
//! syntax tree has its number, and `w[k]` is the name `w3` in the turn where `k` is 3.
//!
//! Deliberately does not know: items, what a name stands for.

use num_bigint::BigInt;
use num_traits::{One, Signed, ToPrimitive, Zero};
use proc_macro2::Delimiter;
use syn::buffer::Cursor;

use super::cursor::Parser;
use super::lexer::Parsed;
use super::scope::{Loops, Shared};
use crate::spec::ast::*;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::limits::{MAX_DIM, MAX_INDEX, MAX_WRITTEN};
use hamel_expr::Rational;

/// Digits that a number may have on the way to an index.
const MAX_BITS: u64 = 256;

/// What a turn counts beside its text, in bytes.
const TURN: usize = 64;

/// The value of an expression of numbers, or where it is none.
pub(super) fn constant(expr: &Expr) -> Result<Rational, Span> {
    let within = |value: Rational| {
        let is_short = value.numer().bits().max(value.denom().bits()) <= MAX_BITS;
        if is_short { Ok(value) } else { Err(expr.span) }
    };
    match &expr.node {
        Node::Number(value) => within(value.clone()),
        Node::Neg(inside) => constant(inside).map(|value| -value),
        Node::Sum(list) => list.iter().try_fold(Rational::zero(), |sum, (negative, operand)| {
            let value = constant(operand)?;
            within(if *negative { sum - value } else { sum + value })
        }),
        Node::Product(list) => list.iter().try_fold(Rational::one(), |product, (divide, operand)| {
            let value = constant(operand)?;
            match *divide {
                true if value.is_zero() => Err(operand.span),
                true => within(product / value),
                false => within(product * value),
            }
        }),
        Node::Power(base, exponent) => {
            let (value, by) = (constant(base)?, constant(exponent)?);
            let by = by.is_integer().then(|| by.to_integer().to_usize()).flatten();
            let by = by.filter(|by| *by as u64 * value.numer().bits().max(1) <= MAX_BITS);
            within(num_traits::pow(value, by.ok_or(exponent.span)?))
        }
        Node::Name(_) | Node::Call(..) | Node::Index(..) | Node::List(_) => Err(expr.span),
    }
}

impl<'a> Parser<'a> {
    /// The number that a name stands for.
    pub(super) fn number_of(&self, name: &str) -> Option<i64> {
        let inner = self.turns.iter().rev().chain(self.shared.sizes.iter().rev());
        inner.filter(|(own, _)| own == name).map(|(_, value)| *value).next()
    }

    /// Whether a name that stands for a number is next.
    pub(super) fn is_number_next(&self) -> bool {
        self.peek_ident().is_some_and(|word| self.number_of(&word).is_some())
    }

    /// A whole number: one that is written, a size, or an expression of both.
    pub(super) fn whole(&mut self, what: &str) -> Parsed<(i64, Span)> {
        if self.at_end() {
            return self.expected(what);
        }
        let expr = self.expr()?;
        Ok((self.value_of(&expr, what)?, expr.span))
    }

    /// The value of an expression that has to be a whole number.
    pub(super) fn value_of(&self, expr: &Expr, what: &str) -> Parsed<i64> {
        let problem = |span, message: String, help: String| {
            Err(Box::new(Diagnostic::new(Some(span), message).with_help(help)))
        };
        let value = match constant(expr) {
            Ok(value) => value,
            Err(span) => {
                let text = self.text.get(span.start..span.end).unwrap_or("");
                let named: String = text.chars().take(40).collect();
                let help = match &expr.node {
                    Node::Name(name) => format!("declare its size: `size {name} = 3;`"),
                    _ => "it is made of numbers, sizes of the file and indices of loops".to_owned(),
                };
                return problem(span, format!("expected {what}, found `{named}`"), help);
            }
        };
        match value.is_integer().then(|| value.to_integer().to_i64()).flatten() {
            Some(whole) if whole.unsigned_abs() <= MAX_INDEX => Ok(whole),
            _ => {
                let message = format!("expected {what}, found {value}{}", self.turn());
                let help = match value.is_integer() {
                    true => format!("whole numbers here are at most {MAX_INDEX}"),
                    false => "sizes and indices count, so that nothing is rounded".to_owned(),
                };
                problem(expr.span, message, help)
            }
        }
    }

    /// In which turn of the loops around, for a message: ` where k = 3`.
    pub(super) fn turn(&self) -> String {
        let turns: Vec<String> = self.turns.iter().map(|(name, value)| format!("{name} = {value}")).collect();
        if turns.is_empty() { String::new() } else { format!(" where {}", turns.join(", ")) }
    }

    /// A name that is declared, perhaps with an index, as in `w[k + 1]`.
    pub(super) fn declared(&mut self, what: &str) -> Parsed<Name> {
        self.declared_as(what, false)
    }

    /// A name that no expression mentions, perhaps with an index.
    pub(super) fn labelled(&mut self, what: &str) -> Parsed<Name> {
        let name = self.ident(what)?;
        Ok(match (self.index_of_name(&name)?, self.shared.loops) {
            (Some((index, span)), Loops::WrittenOut) => Name { text: format!("{}{index}", name.text), span },
            _ => name,
        })
    }

    /// The name of a coordinate.
    pub(super) fn declared_coordinate(&mut self, what: &str) -> Parsed<Name> {
        self.declared_as(what, true)
    }

    /// What a body declares: the name that is next with an ending, and with its index behind that.
    pub(super) fn declared_with(&mut self, ending: &str) -> Parsed<Name> {
        let name = self.ident("the name of a body")?;
        let name = Name { text: format!("{}{ending}", name.text), span: name.span };
        self.declare(name, false)
    }

    /// The name of a part of a body.
    pub(super) fn part_of_body(&mut self, part: BodyPart) -> Parsed<Name> {
        let name = self.ident("the name of a body")?;
        let name = Name { text: format!("{}{}", name.text, part.ending()), span: name.span };
        self.mention(name)
    }

    /// Names of velocities in copies of an algebra: all of them for each copy, with its number as index.
    pub(super) fn for_copies(&mut self, names: Vec<Name>, copies: Option<usize>) -> Vec<Name> {
        let Some(copies) = copies else { return names };
        let mut declared = self.shared.declared.borrow_mut();
        for name in &names {
            let members = (1..=copies).filter_map(|k| i64::try_from(k).ok());
            declared.entry(name.text.clone()).or_default().members.extend(members);
        }
        match self.shared.loops {
            Loops::WrittenOut => {
                let of_copy = |k: usize| {
                    names.iter().map(move |name| Name { text: format!("{}{k}", name.text), span: name.span })
                };
                (1..=copies).flat_map(of_copy).collect()
            }
            Loops::Once => names,
        }
    }

    fn declared_as(&mut self, what: &str, is_coordinate: bool) -> Parsed<Name> {
        let name = self.ident(what)?;
        self.declare(name, is_coordinate)
    }

    fn declare(&mut self, name: Name, is_coordinate: bool) -> Parsed<Name> {
        let Some((index, span)) = self.index_of_name(&name)? else { return Ok(name) };
        let mut declared = self.shared.declared.borrow_mut();
        let family = declared.entry(name.text.clone()).or_default();
        family.members.insert(index);
        family.are_coordinates |= is_coordinate;
        Ok(match self.shared.loops {
            Loops::WrittenOut => Name { text: format!("{}{index}", name.text), span },
            Loops::Once => name,
        })
    }

    /// A name that is declared elsewhere, perhaps with an index: a member of a family or a component of a vector.
    pub(super) fn named(&mut self, what: &str) -> Parsed<Name> {
        let name = self.ident(what)?;
        self.mention(name)
    }

    fn mention(&mut self, name: Name) -> Parsed<Name> {
        let Some((index, span)) = self.index_of_name(&name)? else { return Ok(name) };
        let text = match (self.shared.member(&name.text, index), name.text.strip_suffix("_dot")) {
            (Some(member), _) => self.is_member(member, &name.text, index, span)?,
            (None, Some(stem)) => format!("{stem}{index}_dot"),
            (None, None) => format!("{}{index}", name.text),
        };
        Ok(Name { text, span })
    }

    /// `[k]` behind a name, and the span of both.
    fn index_of_name(&mut self, name: &Name) -> Parsed<Option<(i64, Span)>> {
        let Some((mut inside, span)) = self.group(Delimiter::Bracket) else { return Ok(None) };
        let (index, place) = inside.whole("an index such as `k`")?;
        if inside.peek_punct(',') {
            let problem = Diagnostic::new(Some(inside.here()), "a name has one index");
            return Err(Box::new(problem.with_help("components of matrices are named `C12`")));
        }
        inside.finish("`]`")?;
        if index < 0 {
            let message = format!("index {index} of `{}` is negative{}", name.text, self.turn());
            let help = "indices of names begin with 0";
            return Err(Box::new(Diagnostic::new(Some(place), message).with_help(help)));
        }
        Ok(Some((index, name.span.to(span))))
    }

    fn is_member(&self, found: Result<String, String>, name: &str, k: i64, span: Span) -> Parsed<String> {
        found.map_err(|members| {
            let message = format!("`{name}[{k}]` is not declared{}", self.turn());
            Box::new(
                Diagnostic::new(Some(span), message).with_help(format!("`{name}` is declared for {members}")),
            )
        })
    }

    /// What `base[indices]` is where `base` is a family: its member, with the indices that are left.
    pub(super) fn member_of_family(
        &self,
        base: &Expr,
        indices: &mut Vec<Expr>,
        span: Span,
    ) -> Parsed<Option<Expr>> {
        let (Node::Name(name), Some(first)) = (&base.node, indices.first()) else { return Ok(None) };
        // Anything but a number is no index of a name.
        if self.shared.member(name, 0).is_none() {
            return Ok(None);
        }
        let index = self.value_of(first, "an index such as `k`")?;
        let Some(found) = self.shared.member(name, index) else { return Ok(None) };
        let text = self.is_member(found, name, index, span)?;
        indices.remove(0);
        Ok(Some(Expr { node: Node::Name(text), span }))
    }

    /// Charges what a turn of a loop writes out, and the turn itself.
    pub(super) fn charge(&self, bytes: usize, span: Span) -> Parsed<()> {
        let written = self.shared.written.get().saturating_add(bytes.saturating_add(TURN));
        self.shared.written.set(written);
        if written <= MAX_WRITTEN {
            return Ok(());
        }
        let message = format!("loops write out more than {} MiB", MAX_WRITTEN >> 20);
        Err(Box::new(Diagnostic::new(Some(span), message).with_help("choose a smaller size")))
    }
}

/// A number of the syntax tree.
pub(super) fn number_node(value: i64) -> Node {
    Node::Number(Rational::from_integer(BigInt::from(value)))
}

/// Sizes at the top level of a model, with what they are where it is no whole number.
pub(super) fn read_sizes(text: &str, cursor: Cursor<'_>, loops: Loops) -> Vec<(String, i64)> {
    let mut shared = Shared::new(loops, Vec::new());
    // What stands in the braces of parts is read where these end.
    let mut around: Vec<Cursor<'_>> = Vec::new();
    let mut at = cursor;
    // Whether an item may begin, and whether a part has begun.
    let (mut is_start, mut is_part) = (true, false);
    loop {
        let Some((tree, rest)) = at.token_tree() else {
            let Some(outer) = around.pop() else { break };
            (at, is_start, is_part) = (outer, true, false);
            continue;
        };
        let word = at.ident().filter(|_| is_start).map(|(word, _)| word.to_string());
        if word.as_deref() == Some("size") {
            let read = Parser::new(text, rest, &shared).size_value();
            if let Ok((name, value, _)) = read {
                shared.sizes.push((name.text, value));
            }
        }
        is_part |= word.as_deref() == Some("part");
        if let Some((inside, _, _)) = at.group(Delimiter::Brace).filter(|_| is_part) {
            around.push(rest);
            (at, is_start, is_part) = (inside, true, false);
            continue;
        }
        is_start = match &tree {
            proc_macro2::TokenTree::Punct(punct) => punct.as_char() == ';',
            proc_macro2::TokenTree::Group(_) => true,
            _ => false,
        };
        at = rest;
    }
    shared.sizes
}

impl<'a> Parser<'a> {
    /// `n = 5`, behind the word `size`.
    pub(super) fn size_value(&mut self) -> Parsed<(Name, i64, Span)> {
        let name = self.ident("the name of a size")?;
        self.equals()?;
        let (value, span) = self.whole("a whole number")?;
        if value < 0 {
            let message = format!("size `{}` is {value}", name.text);
            return Err(Box::new(
                Diagnostic::new(Some(span), message).with_help("sizes are whole numbers from 0"),
            ));
        }
        Ok((name, value, span))
    }

    /// A dimension, up to the comma or the bracket behind it.
    pub(super) fn size(&mut self) -> Parsed<Size> {
        self.size_up_to(MAX_DIM)
    }

    pub(super) fn size_up_to(&mut self, largest: usize) -> Parsed<Size> {
        if self.is_number_alone() {
            return self.written_size(largest);
        }
        if self.cursor.literal().is_none() && self.peek_ident().is_none() && !self.peek_punct('(') {
            return self.expected("a whole number");
        }
        let (value, span) = self.whole("a whole number")?;
        self.dimension(value, span, largest)
    }

    /// Whether a number is next, and no operator behind it.
    fn is_number_alone(&self) -> bool {
        let behind = self.cursor.literal().map(|(_, rest)| rest.punct().map(|(punct, _)| punct.as_char()));
        behind.is_some_and(|c| !c.is_some_and(|c| matches!(c, '+' | '-' | '*' | '/' | '^')))
    }

    fn written_size(&mut self, largest: usize) -> Parsed<Size> {
        let span = self.here();
        let Some((literal, rest)) = self.cursor.literal() else { return self.expected("a whole number") };
        let text = literal.to_string();
        let value = text.parse::<usize>().ok().filter(|_| text.bytes().all(|b| b.is_ascii_digit()));
        if value.is_none() && !text.bytes().all(|b| b.is_ascii_digit()) {
            return self.expected("a whole number");
        }
        self.advance(span, rest);
        match value {
            Some(value) if (1..=largest).contains(&value) => Ok(Size { value, span }),
            _ => {
                let message = format!("dimension `{text}` is not between 1 and {largest}");
                Err(Box::new(Diagnostic::new(Some(span), message)))
            }
        }
    }

    /// The dimension of `R^n`: a number, a size, or an expression in parentheses.
    pub(super) fn size_of_power(&mut self) -> Parsed<Size> {
        if let Some((mut inside, _)) = self.group(Delimiter::Parenthesis) {
            let (value, span) = inside.whole("a whole number")?;
            inside.finish("`)`")?;
            return self.dimension(value, span, MAX_DIM);
        }
        if !self.is_number_next() {
            return self.written_size(MAX_DIM);
        }
        let expr = self.atom()?;
        let value = self.value_of(&expr, "a whole number")?;
        self.dimension(value, expr.span, MAX_DIM)
    }

    fn dimension(&self, value: i64, span: Span, largest: usize) -> Parsed<Size> {
        match usize::try_from(value) {
            Ok(value) if (1..=largest).contains(&value) => Ok(Size { value, span }),
            _ => {
                let text = self.text.get(span.start..span.end).unwrap_or("");
                let message = format!("dimension `{text}` is {value}, not between 1 and {largest}");
                Err(Box::new(Diagnostic::new(Some(span), message)))
            }
        }
    }

    /// `size n = 5 where n >= 2;`
    pub(super) fn size_item(&mut self) -> Parsed<ItemKind> {
        let (name, value, span) = self.size_value()?;
        let conditions = if self.word("where").is_some() { self.comparisons()? } else { Vec::new() };
        for Comparison { first, rest } in &conditions {
            let mut left = first;
            for (compare, right) in rest {
                let [a, b] = [constant(left), constant(right)].map(|side| {
                    side.map_err(|place| {
                        let problem =
                            Diagnostic::new(Some(place), "a condition on sizes has nothing but sizes");
                        Box::new(problem.with_help("conditions on parameters stand behind these"))
                    })
                });
                if !compare.holds(&(a? - b?)) {
                    let place = left.span.to(right.span);
                    let text = self.text.get(place.start..place.end).unwrap_or("");
                    let message = format!("size `{}` is {value}, against `{text}`", name.text);
                    let problem = Diagnostic::new(Some(place), message).with_place(Some(span), "its value");
                    return Err(Box::new(problem.with_help("choose another size")));
                }
                left = right;
            }
        }
        Ok(ItemKind::Size { name, value, place: span })
    }
}

impl Compare {
    /// Whether a difference of two sides fits.
    fn holds(self, difference: &Rational) -> bool {
        match self {
            Compare::Less => difference.is_negative(),
            Compare::LessEqual => !difference.is_positive(),
            Compare::Greater => difference.is_positive(),
            Compare::GreaterEqual => !difference.is_negative(),
            Compare::NotEqual => !difference.is_zero(),
        }
    }
}
