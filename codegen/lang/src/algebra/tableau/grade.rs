//! How good expressions are to divide by.
//!
//! Deliberately does not know: in which order unknowns are eliminated.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::{ExprId, Graph, SectionWriter, Sign, SymbolId, Vanishing, sign_of};

/// How good an expression is to divide by, the best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Grade {
    /// A number other than zero.
    Number,
    /// Proved to vanish nowhere on the domain.
    Definite,
    /// Made of parameters alone: one check before a run.
    Parameter,
    /// Changes along a motion and is proved not to vanish identically: watched in every run.
    Watched,
    /// Not proved not to vanish identically.
    Unproved,
}

impl Grade {
    /// Whether a run can come to a state where the expression vanishes.
    pub fn is_watched(self) -> bool {
        self >= Grade::Watched
    }

    /// Whether the expression is proved not to vanish identically.
    pub fn is_proved(self) -> bool {
        self < Grade::Unproved
    }

    /// Whether the expression can vanish, for some parameters or in some state.
    pub fn may_vanish(self) -> bool {
        self >= Grade::Parameter
    }
}

/// Which symbols are parameters.
#[derive(Clone, Copy)]
pub enum Known<'a> {
    /// None is known to be one.
    Nothing,
    /// These are.
    Params(&'a BTreeSet<SymbolId>),
    /// All that do not vary for a writer of definitions.
    Written(&'a SectionWriter),
}

/// What is known where divisors are graded.
#[derive(Clone, Copy)]
pub struct Judge<'a> {
    /// Which symbols are parameters.
    pub params: Known<'a>,
    /// Signs on the domain; without them no expression is [`Grade::Definite`].
    pub signs: Option<&'a BTreeMap<ExprId, Sign>>,
}

impl Judge<'_> {
    /// Knows neither parameters nor signs.
    pub const BLIND: Judge<'static> = Judge { params: Known::Nothing, signs: None };

    /// The grade of a divisor and its size in nodes; none for what vanishes identically.
    pub fn grade(&self, g: &mut Graph, e: ExprId) -> Option<(Grade, usize)> {
        if e == g.zero() {
            return None;
        }
        let is_proved = match g.vanishing(e) {
            Vanishing::Zero => return None,
            Vanishing::NonZero => true,
            Vanishing::Unknown => false,
        };
        let size = g.reachable(&[e]).len();
        g.charge(2 * size);
        let grade = if !is_proved {
            Grade::Unproved
        } else if g.as_rational(e).is_some() {
            Grade::Number
        } else if self.signs.is_some_and(|signs| sign_of(g, e, signs).is_definite()) {
            Grade::Definite
        } else if self.is_of_parameters(g, e) {
            Grade::Parameter
        } else {
            Grade::Watched
        };
        Some((grade, size))
    }

    fn is_of_parameters(&self, g: &Graph, e: ExprId) -> bool {
        match self.params {
            Known::Nothing => false,
            Known::Params(params) => g.free_symbols(e).is_subset(params),
            Known::Written(writer) => !writer.varies(g, e),
        }
    }
}
