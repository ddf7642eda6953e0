//! White noise in a model.
//!
//! Deliberately does not know: increments, who draws them.

use super::diagnostic::Span;
use hamel_expr::{ExprId, SymbolId};

/// White noise, in the sense of Stratonovich: an input that is the derivative of a Wiener process by time.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Name of the input.
    pub name: String,
    /// Its symbol, that of one of [`Model::inputs`](super::Model::inputs).
    pub symbol: SymbolId,
    /// The function `h(x, p, a, t)` that it multiplies, and where it stands; a noise that the model mentions has none.
    pub hamiltonian: Option<(ExprId, Option<Span>)>,
    /// Where it is declared.
    pub span: Option<Span>,
}

impl Noise {
    /// What messages call its function.
    pub fn function(&self) -> String {
        format!("the Hamiltonian of the noise `{}`", self.name)
    }
}
