//! One operation as text, with no more parentheses than it needs.
//!
//! Does not know: any language beyond the signs that all of them share, which values are variables.

use crate::program::{Constant, Literal, Op, Operand, Signs};
use hamel_expr::Func;

/// An expression as text, with how tightly its outermost operator binds and the depth of its parentheses.
#[derive(Clone, Debug)]
pub(super) struct Text {
    pub(super) text: String,
    pub(super) binding: Binding,
    pub(super) depth: usize,
}

/// How tightly an operator binds, loosest first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Binding {
    Sum,
    Product,
    Sign,
    Atom,
}

impl Text {
    pub(super) fn atom(text: impl Into<String>) -> Text {
        Text { text: text.into(), binding: Binding::Atom, depth: 0 }
    }

    /// In parentheses unless it binds at least as tightly as asked.
    pub(super) fn at_least(self, binding: Binding) -> Text {
        if self.binding >= binding {
            return self;
        }
        Text { text: format!("({})", self.text), binding: Binding::Atom, depth: self.depth + 1 }
    }

    /// The opposite where `negative`.
    pub(super) fn signed(self, negative: bool) -> Text {
        if !negative {
            return self;
        }
        let text = self.at_least(Binding::Atom);
        Text { text: format!("-{}", text.text), binding: Binding::Sign, depth: text.depth }
    }
}

/// How an expression is spelled: in a target language, or as a formula for people.
///
/// Sums, differences, products, quotients and opposites are spelled alike everywhere, by [`operation`].
pub(super) trait Notation {
    /// A constant by the doubles that it is made of; it binds tightly.
    fn literal(&self, literal: Literal) -> String;

    /// A constant; it binds tightly.
    fn constant(&self, constant: &Constant) -> String {
        self.literal(constant.literal())
    }

    /// The square root.
    fn square_root(&self, of: Text) -> Text;

    /// The value of an elementary function.
    fn call(&self, function: Func, argument: Text) -> Text;

    /// The reciprocal.
    fn reciprocal(&self, of: Text) -> Text;

    /// A positive number to a constant power.
    fn power(&self, base: Text, exponent: Text) -> Text;

    /// The angle of the point `(x, y)`.
    fn angle(&self, y: Text, x: Text) -> Text;

    /// `±(a * b) ± c`, rounded once where the target has the instruction.
    fn fused(&self, signs: Signs, a: Text, b: Text, c: Text) -> Text;

    /// What rounding leaves out of `a + b`.
    fn sum_error(&self, a: Text, b: Text) -> Text;

    /// What rounding leaves out of `a * b`.
    fn product_error(&self, a: Text, b: Text) -> Text;

    /// Half of what rounding leaves out of `1 - sine^2 - cosine^2`.
    fn circle_error(&self, sine: Text, cosine: Text) -> Text;
}

/// The operation in a notation; `operand` spells its operands.
pub(super) fn operation(op: &Op, notation: &impl Notation, operand: impl Fn(Operand) -> Text) -> Text {
    let binary = |a: Operand, sign: &str, b: Operand, left: Binding, right: Binding| {
        let (a, b) = (operand(a).at_least(left), operand(b).at_least(right));
        Text { text: format!("{} {sign} {}", a.text, b.text), binding: left, depth: a.depth.max(b.depth) }
    };
    match *op {
        Op::Add(a, b) => binary(a, "+", b, Binding::Sum, Binding::Product),
        Op::Sub(a, b) => binary(a, "-", b, Binding::Sum, Binding::Product),
        Op::Mul(a, b) => binary(a, "*", b, Binding::Product, Binding::Sign),
        Op::Div(a, b) => binary(a, "/", b, Binding::Product, Binding::Sign),
        Op::Neg(a) => operand(a).signed(true),
        Op::Recip(a) => notation.reciprocal(operand(a)),
        Op::Sqrt(a) => notation.square_root(operand(a)),
        Op::Power(a, q) => notation.power(operand(a), operand(q)),
        Op::Function(f, a) => notation.call(f, operand(a)),
        Op::Atan2(y, x) => notation.angle(operand(y), operand(x)),
        Op::SumError(a, b) => notation.sum_error(operand(a), operand(b)),
        Op::ProductError(a, b) => notation.product_error(operand(a), operand(b)),
        Op::CircleError(a, b) => notation.circle_error(operand(a), operand(b)),
        Op::MulAdd(signs, a, b, c) => notation.fused(signs, operand(a), operand(b), operand(c)),
    }
}

/// Formulas for people, in comments.
#[derive(Clone, Copy, Debug)]
pub(super) struct Formula;

impl Formula {
    fn apply(name: &str, argument: Text) -> Text {
        Text { text: format!("{name}({})", argument.text), binding: Binding::Atom, depth: argument.depth + 1 }
    }

    fn apply_to_two(name: &str, a: Text, b: Text) -> Text {
        let text = format!("{name}({}, {})", a.text, b.text);
        Text { text, binding: Binding::Atom, depth: a.depth.max(b.depth) + 1 }
    }
}

impl Notation for Formula {
    fn literal(&self, literal: Literal) -> String {
        match literal {
            Literal::Zero => "0".to_owned(),
            Literal::One => "1".to_owned(),
            Literal::Number(x) => format!("{x}"),
            Literal::Ratio(p, q) => format!("({p}/{q})"),
            Literal::Pi => "pi".to_owned(),
        }
    }

    fn square_root(&self, of: Text) -> Text {
        Formula::apply("sqrt", of)
    }

    fn call(&self, function: Func, argument: Text) -> Text {
        match function {
            Func::Stumpff(k) => Formula::apply(&format!("c{k}"), argument),
            Func::Turn(k) => Formula::apply(&format!("tau{k}"), argument),
            _ => Formula::apply(function.name(), argument),
        }
    }

    fn reciprocal(&self, of: Text) -> Text {
        let of = of.at_least(Binding::Sign);
        Text { text: format!("1 / {}", of.text), binding: Binding::Product, depth: of.depth }
    }

    fn power(&self, base: Text, exponent: Text) -> Text {
        let base = base.at_least(Binding::Atom);
        Text {
            text: format!("{}^{}", base.text, exponent.text),
            binding: Binding::Atom,
            depth: base.depth + 1,
        }
    }

    fn angle(&self, y: Text, x: Text) -> Text {
        Formula::apply_to_two("atan2", y, x)
    }

    fn sum_error(&self, a: Text, b: Text) -> Text {
        Formula::apply_to_two("sum_error", a, b)
    }

    fn product_error(&self, a: Text, b: Text) -> Text {
        Formula::apply_to_two("product_error", a, b)
    }

    fn circle_error(&self, sine: Text, cosine: Text) -> Text {
        Formula::apply_to_two("circle_error", sine, cosine)
    }

    fn fused(&self, signs: Signs, a: Text, b: Text, c: Text) -> Text {
        let (minus, sign) = (if signs.product { "-" } else { "" }, if signs.addend { "-" } else { "+" });
        let c = c.at_least(Binding::Product);
        let depth = a.depth.max(b.depth).max(c.depth) + 1;
        let (a, b) = (a.at_least(Binding::Sign), b.at_least(Binding::Sign));
        Text {
            text: format!("{minus}{} * {} {sign} {}", a.text, b.text, c.text),
            binding: Binding::Sum,
            depth,
        }
    }
}
