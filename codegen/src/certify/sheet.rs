//! Residuals of identities at one point, and what counts as zero.
//!
//! Does not know: identities, points.

use hamel_runtime::Real;

use super::wide::Wide;

/// A residual is zero where it is no larger than so many times the bound of its rounding errors. The bound is of first
/// order and leaves out that sums of few terms may round against each other; 16 is more than both need.
const BOUND: f64 = 16.0;
/// Largest bound of rounding errors beside the terms of a row at which the row says anything: twelve digits of
/// thirty-one have to be left. A fault that is smaller than that everywhere is not one of formulas.
const SHARP: f64 = 1e-12;

/// Terms below this part of the numbers of a state are what is left of larger ones.
const NOTHING: f64 = 1e-18;

/// Numbers below it have no 31 digits, whose last ones are no numbers any more: errors of products are not told there.
const UNDERFLOW: f64 = 1e-270;

/// One row of an identity.
#[derive(Clone, Debug)]
pub(super) struct Residual {
    /// The function that the identity defines.
    pub(super) function: String,
    /// The row.
    pub(super) what: String,
    pub(super) value: Wide,
    /// Sum of the absolute values of its terms.
    pub(super) terms: f64,
}

impl Residual {
    pub(super) fn is_finite(&self) -> bool {
        self.value.all_finite() && self.terms.is_finite()
    }

    /// Whether rounding errors leave digits to compare, beside the terms or, where these vanish, numbers of that size.
    pub(super) fn is_sharp(&self, scale: f64) -> bool {
        self.is_finite() && self.value.error() <= SHARP * self.terms.max(scale)
    }

    pub(super) fn is_zero(&self) -> bool {
        self.value.size() <= UNDERFLOW.max(BOUND * self.value.error())
    }

    /// The residual beside the terms of its row or, where these are next to nothing, beside numbers of that size.
    pub(super) fn relative(&self, scale: f64) -> f64 {
        // Terms that are residuals themselves say nothing about a size.
        let size = if self.terms > NOTHING * scale { self.terms } else { scale };
        if size > 0.0 { self.value.size() / size } else { self.value.size() }
    }
}

/// All residuals at one point.
#[derive(Default)]
pub(super) struct Sheet {
    pub(super) rows: Vec<Residual>,
}

impl Sheet {
    /// A sum that has to vanish.
    pub(super) fn zero(&mut self, function: &str, what: impl Into<String>, terms: &[Wide]) {
        let value = terms.iter().fold(Wide::ZERO, |sum, x| sum + *x);
        let terms = terms.iter().map(|x| x.size()).sum();
        self.rows.push(Residual { function: function.to_owned(), what: what.into(), value, terms });
    }

    /// A sum that has to vanish, of terms of that size.
    pub(super) fn vanishes(&mut self, function: &str, what: impl Into<String>, value: Wide, terms: f64) {
        let terms = terms.max(value.size());
        self.rows.push(Residual { function: function.to_owned(), what: what.into(), value, terms });
    }

    /// Two numbers that have to be equal.
    pub(super) fn equal(&mut self, function: &str, what: impl Into<String>, found: Wide, defined: Wide) {
        self.zero(function, what, &[found, -defined]);
    }
}
