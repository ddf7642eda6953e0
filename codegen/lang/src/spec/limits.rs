//! Limits on what a model file may contain, each with a message where it is passed.
//!
//! Deliberately does not know: what is limited by the budget of expressions.

/// Largest model file in bytes.
pub(super) const MAX_BYTES: usize = 1 << 20;

/// Deepest nesting of an expression.
pub(super) const MAX_DEPTH: usize = 64;

/// Deepest nesting of brackets of any kind, checked before anything recursive sees the tokens.
pub(super) const MAX_BRACKETS: usize = MAX_DEPTH + 8;

/// Largest dimension of a vector, matrix or algebra.
pub(super) const MAX_DIM: usize = 200;

/// Largest size of matrices of a fluid that is moved as products of them.
pub(super) const MAX_MATRIX: usize = 1024;

/// Largest size and largest index of a loop, in magnitude.
pub(super) const MAX_INDEX: u64 = 1024;

/// Bytes of text that the loops of a file may write out.
pub(super) const MAX_WRITTEN: usize = 8 << 20;

/// Most digits of a number and largest absolute decimal exponent.
pub(super) const MAX_DIGITS: usize = 400;

/// Bad characters reported before the lexer gives up.
pub(super) const MAX_BAD_CHARACTERS: usize = 20;

/// Entries of the matrices of one representation.
pub(super) const MAX_REPRESENTATION: usize = 150_000;

/// Multiplications in the check of a representation given by matrices.
pub(super) const MAX_REPRESENTATION_WORK: usize = 100_000_000;

/// Largest basis of an algebra given by brackets: Jacobi is checked on every triple.
pub(super) const MAX_BASIS: usize = 80;

/// Largest abelian algebra, for the same reason.
pub(super) const MAX_ABELIAN: usize = 100;

/// Largest numerator and denominator of a rational exponent.
pub(super) const MAX_EXPONENT: u32 = 1000;
