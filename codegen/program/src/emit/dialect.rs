//! What differs between target languages in the code of a function: names that are taken, literals, operators, calls.
//!
//! A back end is a [`Dialect`] and a writer of modules: what a module holds and how its functions are declared
//! differs too much between languages to be one text with holes. Everything that is the same for all of them (which
//! functions there are, which values are variables, the order of statements, names) is made outside with the
//! dialect's answers.
//!
//! Does not know: any language, programs.

use super::expression::Notation;

/// A target language.
pub(super) trait Dialect: Notation {
    /// Words that no variable, field or function can be called: those of the language, and names of its library that
    /// mean something else than a new variable where a value is bound.
    fn reserved(&self) -> &'static [&'static str];

    /// Characters that an identifier may have.
    fn longest_name(&self) -> usize {
        usize::MAX
    }

    /// Variables that the declaration of a function brings with it.
    fn arguments(&self) -> &'static [&'static str];

    /// Functions that every module has, or that generated interfaces bring with them.
    fn functions(&self) -> &'static [&'static str];

    /// The constant that says where the entries of a matrix are.
    fn places(&self, matrix: &str) -> String;

    /// The constant that is a table of products, by its number.
    fn table(&self, k: usize) -> String;

    /// An element of an array.
    fn element(&self, array: &str, k: usize) -> String;

    /// A parameter or prepared number in a function of the module.
    fn field(&self, name: &str) -> String;
}
