//! The item `reduces` of a checked model.
//!
//! Deliberately does not know: the other model, who reads its text.

use super::diagnostic::{Origin, Span};

/// A model that another one says to be the quotient of: `reduces`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Total {
    /// Its file, from the folder of the model that says so.
    pub file: String,
    /// Where the file is named.
    pub place: Option<Span>,
    /// Its text, where somebody has read it.
    pub origin: Option<Origin>,
    /// Variables and parameters of the quotient as functions of it.
    pub images: Vec<Image>,
}

/// A variable or a parameter of a quotient as a function of the total system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Its name, of a vector or a component.
    pub name: String,
    /// Its components.
    pub components: Vec<String>,
    /// The function, as written: its names belong to the total system.
    pub text: String,
    /// Where the name and the function are written.
    pub places: Option<(Span, Span)>,
}
