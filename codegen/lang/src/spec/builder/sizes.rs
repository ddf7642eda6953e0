//! Sizes of a family, of which a model is one member.
//!
//! Deliberately does not know: text, loops.

use super::draft::{DeclaredAs, ModelBuilder};
use crate::spec::diagnostic::Span;
use crate::spec::size::FamilySize;

impl ModelBuilder {
    /// A size of the family that the model is of, with its value and its documentation.
    ///
    /// It claims the name and is told to readers, and nothing more: where a model is built in Rust, its loops are
    /// Rust's.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder};
    ///
    /// let mut builder = ModelBuilder::new("chain");
    /// builder.size("n", 3, "Number of links.");
    /// let rates: Vec<_> = (1..=3).map(|k| builder.coordinate(&format!("q{k}"), Domain::Angle, "").1).collect();
    /// let squares: Vec<_> = rates.iter().map(|rate| rate.mul(builder.graph(), rate).unwrap()).collect();
    /// ```
    pub fn size(&mut self, name: &str, value: i64, doc: &str) -> &mut Self {
        if self.declare(name, DeclaredAs::Size) {
            self.sizes.push(FamilySize { name: name.to_owned(), value, doc: doc.to_owned() });
        }
        self
    }

    pub(in crate::spec) fn sizes(&self) -> &[FamilySize] {
        &self.sizes
    }

    /// Where a name is declared, for one that is.
    pub(in crate::spec) fn place_of_name(&self, name: &str) -> Option<Option<Span>> {
        self.names.get(name).map(|declared| declared.span)
    }
}
