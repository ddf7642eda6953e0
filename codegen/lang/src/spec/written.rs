//! Expressions of the syntax tree as text: for what a loop reads several times, which stands nowhere as it is read.
//!
//! Deliberately does not know: what names stand for.

use std::fmt;

use num_traits::Signed;

use super::ast::{Compare, Expr, Node};

/// How tightly an expression binds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Binding {
    Sum,
    Product,
    Sign,
    Atom,
}

fn binding(node: &Node) -> Binding {
    match node {
        Node::Sum(_) => Binding::Sum,
        Node::Product(_) => Binding::Product,
        Node::Number(value) if value.is_negative() => Binding::Sign,
        Node::Number(value) if !value.is_integer() => Binding::Product,
        Node::Neg(_) | Node::Power(..) => Binding::Sign,
        Node::Number(_) | Node::Name(_) | Node::Call(..) | Node::Index(..) | Node::List(_) => Binding::Atom,
    }
}

/// The operand, in parentheses where it would bind less than it has to.
fn operand(f: &mut fmt::Formatter<'_>, expr: &Expr, least: Binding) -> fmt::Result {
    if binding(&expr.node) < least { write!(f, "({expr})") } else { write!(f, "{expr}") }
}

fn list(f: &mut fmt::Formatter<'_>, entries: &[Expr]) -> fmt::Result {
    entries.iter().enumerate().try_for_each(|(k, entry)| {
        f.write_str(if k == 0 { "" } else { ", " })?;
        write!(f, "{entry}")
    })
}

impl fmt::Display for Expr {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.node {
            Node::Number(value) => write!(f, "{value}"),
            Node::Name(name) => f.write_str(name),
            Node::Sum(terms) => terms.iter().enumerate().try_for_each(|(k, (negative, term))| {
                f.write_str(match (k, negative) {
                    (0, _) => "",
                    (_, false) => " + ",
                    (_, true) => " - ",
                })?;
                operand(f, term, Binding::Product)
            }),
            Node::Product(factors) => factors.iter().enumerate().try_for_each(|(k, (divide, factor))| {
                f.write_str(match (k, divide) {
                    (0, _) => "",
                    (_, false) => "*",
                    (_, true) => "/",
                })?;
                operand(f, factor, if k == 0 { Binding::Product } else { Binding::Sign })
            }),
            Node::Neg(inside) => {
                f.write_str("-")?;
                operand(f, inside, Binding::Sign)
            }
            Node::Power(base, exponent) => {
                operand(f, base, Binding::Atom)?;
                f.write_str("^")?;
                operand(f, exponent, Binding::Sign)
            }
            Node::Call(name, arguments) => {
                write!(f, "{}(", name.text)?;
                list(f, arguments)?;
                f.write_str(")")
            }
            Node::Index(base, indices) => {
                operand(f, base, Binding::Atom)?;
                f.write_str("[")?;
                list(f, indices)?;
                f.write_str("]")
            }
            Node::List(entries) => {
                f.write_str("[")?;
                list(f, entries)?;
                f.write_str("]")
            }
        }
    }
}

impl fmt::Display for Compare {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Compare::Less => "<",
            Compare::LessEqual => "<=",
            Compare::Greater => ">",
            Compare::GreaterEqual => ">=",
            Compare::NotEqual => "!=",
        })
    }
}
