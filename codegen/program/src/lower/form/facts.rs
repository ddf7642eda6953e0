//! Facts about a polynomial that are found once and shared by its copies.
//!
//! Does not know: polynomials, how facts are found.

use std::rc::Rc;

use super::numbers::Coefficient;
use crate::program::cost::thirds::{CALL, DIVISION, ROOT};
use hamel_expr::Func;

/// What one polynomial costs.
#[derive(Clone, Debug)]
pub(super) struct Price {
    /// Multiplications and additions.
    pub(super) sum: i64,
    /// Operations that others may share.
    pub(super) costly: Box<[Costly]>,
}

/// An operation that costs more than a multiplication; equal ones are computed once.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Costly {
    /// By an atom.
    Division(u32),
    /// Of an atom.
    Root(u32),
    /// Of a polynomial.
    Function(Func, u32),
    /// Of two polynomials.
    Atan2(u32, u32),
}

impl Costly {
    pub(super) fn cost(&self) -> i64 {
        match self {
            Costly::Division(_) => DIVISION,
            Costly::Root(_) => ROOT,
            Costly::Function(..) | Costly::Atan2(..) => CALL,
        }
    }
}

/// Where a divisor occurs in a polynomial.
#[derive(Clone, Copy, Debug)]
pub(super) struct Occurrence {
    /// Its number in the tables of the extractor.
    pub(super) divisor: u32,
    /// The place of a term.
    pub(super) first: u32,
    /// The other term of a sum; the same term for a product.
    pub(super) second: u32,
    /// What a sum is multiplied by, besides the common powers of its terms.
    pub(super) scale: Coefficient,
    /// Factors that stand beside a sum in the term that takes the place of the two; none for a product.
    pub(super) n_left: u32,
}

/// Where divisors occur in one polynomial and what replacing all occurrences of each would save.
#[derive(Debug)]
pub(super) struct Candidates {
    /// Sorted by divisor, then by place.
    pub(super) occurrences: Vec<Occurrence>,
    /// Sorted by divisor.
    pub(super) savings: Vec<(u32, i64)>,
}

/// What an extractor knows about a polynomial.
#[derive(Clone, Debug)]
pub(super) struct Facts {
    /// Of the extractor's tables.
    pub(super) generation: usize,
    /// Nothing before they are asked for.
    pub(super) candidates: Option<Rc<Candidates>>,
    /// The divisor that the polynomial is, if it is one.
    pub(super) divisor: Option<Option<(u32, Coefficient)>>,
}
