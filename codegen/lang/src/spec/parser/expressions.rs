//! Expressions by precedence: sum, product, sign, power, index, atom; and numbers.
//!
//! Deliberately does not know: items, functions, shapes.

use num_bigint::BigInt;
use num_traits::{One, Zero};
use proc_macro2::Delimiter;

use super::cursor::Parser;
use super::lexer::Parsed;
use super::sizes::number_node;
use crate::spec::ast::*;
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::limits::MAX_DIGITS;
use crate::spec::names;
use hamel_expr::Rational;

impl<'a> Parser<'a> {
    pub(super) fn expr(&mut self) -> Parsed<Expr> {
        self.deeper(|p| {
            let first = p.product()?;
            let mut list = vec![(false, first)];
            loop {
                let negative = if p.punct("+").is_some() {
                    false
                } else if p.punct("-").is_some() {
                    true
                } else {
                    break;
                };
                list.push((negative, p.product()?));
            }
            Ok(fold_chain(list, Node::Sum))
        })
    }

    fn product(&mut self) -> Parsed<Expr> {
        let mut list = vec![(false, self.signed()?)];
        loop {
            let divide = if let Some(star) = self.punct("*") {
                if let Some(second) = self.punct("*") {
                    let problem = Diagnostic::new(Some(star.to(second)), "`**` is not an operator");
                    return Err(Box::new(problem.with_help("powers are written `x^2`")));
                }
                false
            } else if self.punct("/").is_some() {
                true
            } else {
                break;
            };
            list.push((divide, self.signed()?));
        }
        Ok(fold_chain(list, Node::Product))
    }

    fn signed(&mut self) -> Parsed<Expr> {
        let start = self.here();
        if self.punct("-").is_some() {
            let inside = self.deeper(Self::signed)?;
            let span = Span::new(start.start, inside.span.end);
            return Ok(Expr { node: Node::Neg(Box::new(inside)), span });
        }
        if self.punct("+").is_some() {
            return self.deeper(Self::signed);
        }
        self.power()
    }

    fn power(&mut self) -> Parsed<Expr> {
        let base = self.indexed()?;
        if self.punct("^").is_none() {
            return Ok(base);
        }
        // Right associative, and the exponent may carry a sign: `x^-2`, `2^3^2 = 2^9`.
        let exponent = self.deeper(Self::signed)?;
        let span = base.span.to(exponent.span);
        Ok(Expr { node: Node::Power(Box::new(base), Box::new(exponent)), span })
    }

    fn indexed(&mut self) -> Parsed<Expr> {
        let base = self.atom()?;
        let Some((mut inside, span)) = self.group(Delimiter::Bracket) else { return Ok(base) };
        let mut indices = inside.comma_list(|p| p.expr())?;
        let mut span = base.span.to(span);
        // `C[1][2]` is the second entry of the row `C[1]`: what `C[1, 2]` is.
        while let Some((mut inside, more)) = self.group(Delimiter::Bracket) {
            if inside.at_end() {
                return inside.expected("an index");
            }
            indices.extend(inside.comma_list(|p| p.expr())?);
            span = span.to(more);
        }
        let base = match self.member_of_family(&base, &mut indices, span)? {
            Some(member) if indices.is_empty() => return Ok(member),
            Some(member) => member,
            None => base,
        };
        Ok(Expr { node: Node::Index(Box::new(base), indices), span })
    }

    pub(super) fn atom(&mut self) -> Parsed<Expr> {
        let start = self.here();
        if let Some((literal, rest)) = self.cursor.literal() {
            let value = number(&literal.to_string(), start)?;
            self.advance(start, rest);
            return Ok(Expr { node: Node::Number(value), span: start });
        }
        if let Some((mut inside, span)) = self.group(Delimiter::Parenthesis) {
            if inside.at_end() {
                return inside.expected("an expression");
            }
            let mut expr = inside.expr()?;
            if inside.peek_punct(',') {
                let problem = Diagnostic::new(Some(inside.here()), "expected `)`, found `,`");
                return Err(Box::new(problem.with_help("vectors are written `[a, b, c]`")));
            }
            inside.finish("`)` or an operator")?;
            expr.span = span;
            return Ok(expr);
        }
        if let Some((mut inside, span)) = self.group(Delimiter::Bracket) {
            let list = match inside.comprehension()? {
                Some(list) => list,
                None => inside.comma_list(|p| p.expr())?,
            };
            if list.is_empty() {
                return Err(Box::new(
                    Diagnostic::new(Some(span), "empty vector").with_help("write its entries: `[a, b]`"),
                ));
            }
            return Ok(Expr { node: Node::List(list), span });
        }
        if self.peek_punct('|') {
            let problem = Diagnostic::new(Some(start), "expected an expression, found `|`");
            return Err(Box::new(problem.with_help("write `abs(x)` for a number, `norm(v)` for a vector")));
        }
        if let Some(word) = self.peek_ident().filter(|word| names::CONDITIONS.contains(&word.as_str())) {
            let problem = Diagnostic::new(Some(start), format!("expected an expression, found `{word}`"));
            let help = names::not_smooth(&word).unwrap_or_default();
            return Err(Box::new(problem.with_help(help)));
        }
        let name = self.ident("an expression")?;
        if let Some((mut inside, span)) = self.group(Delimiter::Parenthesis) {
            let span = name.span.to(span);
            if let Some(terms) = inside.comprehension()? {
                return sum_of(&name, terms, span);
            }
            let arguments = inside.comma_list(|p| p.expr())?;
            return Ok(Expr { node: Node::Call(name, arguments), span });
        }
        let node = match self.number_of(&name.text) {
            Some(value) => number_node(value),
            None => Node::Name(name.text),
        };
        Ok(Expr { span: name.span, node })
    }
}

/// `sum(expr for k in 1..n)`: a sum of no terms is zero.
fn sum_of(name: &Name, terms: Vec<Expr>, span: Span) -> Parsed<Expr> {
    if name.text != "sum" {
        let problem =
            Diagnostic::new(Some(name.span), format!("`{}` of terms that are written once", name.text));
        return Err(Box::new(problem.with_help("write `sum(expr for k in 1..n)`, or a list in brackets")));
    }
    if terms.is_empty() {
        return Ok(Expr { node: number_node(0), span });
    }
    // As somebody would write it out: terms of terms are terms.
    let flat = terms.into_iter().flat_map(|term| match term.node {
        Node::Sum(list) => list,
        _ => vec![(false, term)],
    });
    let mut sum = fold_chain(flat.collect(), Node::Sum);
    sum.span = span;
    Ok(sum)
}

fn fold_chain(mut list: Vec<(bool, Expr)>, make: fn(Vec<(bool, Expr)>) -> Node) -> Expr {
    if list.len() == 1
        && let Some((_, only)) = list.pop()
    {
        return only;
    }
    let span = match (list.first(), list.last()) {
        (Some((_, first)), Some((_, last))) => first.span.to(last.span),
        _ => Span::new(0, 0),
    };
    Expr { node: make(list), span }
}

/// The exact value of decimal text.
pub(super) fn number(text: &str, span: Span) -> Parsed<Rational> {
    let problem =
        |message: String, help: &str| Err(Box::new(Diagnostic::new(Some(span), message).with_help(help)));
    if !text.starts_with(|c: char| c.is_ascii_digit()) {
        let shown: String = text.chars().take(40).collect();
        return problem(format!("expected an expression, found {shown}"), "texts are only used in `source`");
    }
    let clean: String = text.chars().filter(|c| *c != '_').collect();
    let (mantissa, exponent) = match clean.find(['e', 'E']) {
        Some(at) if !clean.starts_with("0x") => (&clean[..at], &clean[at + 1..]),
        _ => (clean.as_str(), "0"),
    };
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits = format!("{whole}{fraction}");
    if let Some(at) = digits.find(|c: char| !c.is_ascii_digit()) {
        let suffix: String = digits[at..].chars().take(40).collect();
        return problem(
            format!("`{suffix}` directly after a number"),
            "write products with `*`, and numbers in decimals: `2*x`",
        );
    }
    let magnitude = exponent.strip_prefix(['+', '-']).unwrap_or(exponent);
    if let Some(at) = magnitude.find(|c: char| !c.is_ascii_digit()) {
        let suffix: String = magnitude[at..].chars().take(40).collect();
        return problem(
            format!("`{suffix}` directly after a number"),
            "write products with `*`, and numbers in decimals: `2*x`",
        );
    }
    if digits.len() > MAX_DIGITS {
        let message = format!("number has {} digits, the limit is {MAX_DIGITS}", digits.len());
        return problem(message, "round it: generated code computes with 16 digits");
    }
    let exponent: i64 = match exponent.parse::<i64>() {
        Ok(e) if e.unsigned_abs() <= MAX_DIGITS as u64 => e,
        _ => {
            return problem(
                format!("exponent of the number is not between -{MAX_DIGITS} and {MAX_DIGITS}"),
                "choose units in which the value is moderate",
            );
        }
    };
    let integer: BigInt = digits.parse().unwrap_or_else(|_| BigInt::zero());
    // The digits after the point shift the exponent; both are at most MAX_DIGITS.
    let shift = exponent - fraction.len() as i64;
    let power = num_traits::pow(BigInt::from(10), shift.unsigned_abs() as usize);
    Ok(if shift < 0 { Rational::new(integer, power) } else { Rational::new(integer * power, BigInt::one()) })
}
