//! Rust's spelling of expressions, and the names that Rust takes.
//!
//! Does not know: programs, items of a module.

use super::super::dialect::Dialect;
use super::super::expression::{Binding, Notation, Text};
use crate::program::{Literal, Signs};
use hamel_expr::Func;

/// The function of the runtime that multiplies and adds.
pub(super) const FMA: &str = "fma";

/// Rust, generic over a scalar `R` with the methods of `hamel_runtime::Real`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rust;

impl Rust {
    /// A method without arguments.
    fn method(receiver: Text, name: &str) -> Text {
        let receiver = receiver.at_least(Binding::Atom);
        Text { text: format!("{}.{name}()", receiver.text), binding: Binding::Atom, depth: receiver.depth }
    }
}

impl Rust {
    /// A method with one argument.
    fn method_with(receiver: Text, name: &str, argument: Text) -> Text {
        let receiver = receiver.at_least(Binding::Atom);
        let text = format!("{}.{name}({})", receiver.text, argument.text);
        Text { text, binding: Binding::Atom, depth: receiver.depth.max(argument.depth + 1) }
    }

    /// An associated function with two arguments. Of a chain of definitions by methods, each the argument of the next
    /// one, Clippy follows every path (1.95, `or_fun_call`): a function of a few hundred of them takes minutes.
    fn associated(name: &str, a: Text, b: Text) -> Text {
        let text = format!("R::{name}({}, {})", a.text, b.text);
        Text { text, binding: Binding::Atom, depth: a.depth.max(b.depth) + 1 }
    }
}

impl Notation for Rust {
    fn literal(&self, literal: Literal) -> String {
        match literal {
            Literal::Zero => "R::ZERO".to_owned(),
            Literal::One => "R::ONE".to_owned(),
            Literal::Number(x) => format!("R::from_f64({x:?})"),
            Literal::Ratio(p, q) => format!("R::ratio({p:?}, {q:?})"),
            Literal::Pi => "R::from_f64(::core::f64::consts::PI)".to_owned(),
        }
    }

    fn square_root(&self, of: Text) -> Text {
        Rust::method(of, "sqrt")
    }

    fn call(&self, function: Func, argument: Text) -> Text {
        let (Func::Stumpff(k) | Func::Turn(k)) = function else {
            return Rust::method(argument, function.name());
        };
        let receiver = argument.at_least(Binding::Atom);
        let text = format!("{}.{}({k})", receiver.text, function.name());
        Text { text, binding: Binding::Atom, depth: receiver.depth + 1 }
    }

    fn reciprocal(&self, of: Text) -> Text {
        Rust::method(of, "recip")
    }

    fn power(&self, base: Text, exponent: Text) -> Text {
        let base = base.at_least(Binding::Atom);
        let text = format!("({} * {}.ln()).exp()", exponent.text, base.text);
        Text { text, binding: Binding::Atom, depth: base.depth + 1 }
    }

    fn angle(&self, y: Text, x: Text) -> Text {
        Rust::method_with(y, "atan2", x)
    }

    fn sum_error(&self, a: Text, b: Text) -> Text {
        Rust::associated("sum_error", a, b)
    }

    fn product_error(&self, a: Text, b: Text) -> Text {
        Rust::associated("product_error", a, b)
    }

    fn circle_error(&self, sine: Text, cosine: Text) -> Text {
        Rust::associated("circle_error", sine, cosine)
    }

    fn fused(&self, signs: Signs, a: Text, b: Text, c: Text) -> Text {
        // The order is the program's: dual numbers round the products of a derivative in the order of the factors.
        let (a, c) = (a.signed(signs.product), c.signed(signs.addend));
        let text = format!("{FMA}({}, {}, {})", a.text, b.text, c.text);
        Text { text, binding: Binding::Atom, depth: a.depth.max(b.depth).max(c.depth) + 1 }
    }
}

/// Rust's words, also those of later editions, and names whose patterns would mean something else than a new binding.
const RESERVED: [&str; 62] = [
    "Err", "INFO", "None", "Ok", "R", "Self", "Some", "_", "abstract", "as", "async", "await", "become",
    "box", "break", "const", "continue", "core", "crate", "do", "dyn", "else", "enum", "extern", "false",
    "final", "fma", "fn", "for", "gen", "if", "impl", "in", "let", "loop", "macro", "match", "mod", "move",
    "mut", "override", "priv", "pub", "ref", "return", "self", "static", "struct", "super", "trait", "true",
    "try", "type", "typeof", "union", "unsafe", "unsized", "use", "virtual", "where", "while", "yield",
];

impl Dialect for Rust {
    fn reserved(&self) -> &'static [&'static str] {
        &RESERVED
    }

    fn arguments(&self) -> &'static [&'static str] {
        &["t", "dy", "params", "out"]
    }

    fn functions(&self) -> &'static [&'static str] {
        &[
            "new",
            "rhs",
            "on_circles",
            "rhs_on_circles",
            "energy",
            "pivots",
            "check",
            "signature",
            "domain",
            "prepare",
            "energy_of",
            "outputs_of",
            "clone",
            "fmt",
        ]
    }

    fn places(&self, matrix: &str) -> String {
        format!("{}_PATTERN", matrix.to_ascii_uppercase())
    }

    fn table(&self, k: usize) -> String {
        format!("PRODUCTS_{k}")
    }

    fn element(&self, array: &str, k: usize) -> String {
        format!("{array}[{k}]")
    }

    fn field(&self, name: &str) -> String {
        format!("self.{name}")
    }
}
