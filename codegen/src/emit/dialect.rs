//! What differs between target languages in the code of a function: names that are taken, literals, operators, calls.
//!
//! A back end is a [`Dialect`] and a writer of modules: what a module holds and how its functions are declared
//! differs too much between languages to be one text with holes. Everything that is the same for all of them (which
//! functions there are, which values are variables, the order of statements, names) is made outside with the
//! dialect's answers.
//!
//! Does not know: any language, programs.

use super::expression::Text;
use crate::expr::Func;
use crate::program::{Literal, Signs};

/// How an expression is spelled: in a target language, or as a formula for people.
///
/// Sums, differences, products, quotients and opposites are spelled alike everywhere, by [`super::expression`].
pub(super) trait Notation {
    /// A constant; it binds tightly.
    fn literal(&self, literal: Literal) -> String;

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
}

/// A target language.
pub(super) trait Dialect: Notation {
    /// Words that no variable, field or function can be called: those of the language, and names of its library that
    /// mean something else than a new variable where a value is bound.
    fn reserved(&self) -> &'static [&'static str];

    /// Variables that the declaration of a function brings with it.
    fn arguments(&self) -> &'static [&'static str];

    /// Functions that every module has, or that generated interfaces bring with them.
    fn functions(&self) -> &'static [&'static str];

    /// The constant that says where the entries of a matrix are.
    fn places(&self, matrix: &str) -> String;

    /// A parameter or prepared number in a function of the module.
    fn field(&self, name: &str) -> String;
}
