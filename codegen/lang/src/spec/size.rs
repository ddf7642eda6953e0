//! A size of a family of models.
//!
//! Deliberately does not know: text, what a size is used for.

/// A size of the text, `size n = 5;`, with the value that a model was read with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FamilySize {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: i64,
    /// Its documentation.
    pub doc: String,
}
