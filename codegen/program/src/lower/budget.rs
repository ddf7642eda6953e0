//! Limits on the searches of lowering.
//!
//! Does not know: what is searched for.

/// What the searches for the cheapest form may take, counted the same way on every machine.
///
/// A search that meets a limit keeps the best form that it has found; [`Report`](crate::program::Report) says so. All
/// limits but the last are those of one function. The defaults leave every scene of `models/specs` as it is without
/// limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SearchBudget {
    /// Common divisors looked at; a term that is multiplied out counts as ten.
    pub divisors: usize,
    /// Steps of the search for common divisors, those in known polynomials included: 5 million in the largest scene of
    /// `models/specs`.
    pub steps: usize,
    /// Terms multiplied out: 306,000 in the largest scene.
    pub terms: usize,
    /// Terms of the numbers that depend on parameters alone: those of a dense metric with parameters grow with every
    /// product. 43,000 in the derivatives of `kirchhoff_body`.
    pub numbers: usize,
    /// Terms looked at for other units.
    pub units: usize,
    /// Products of a function from which on they are loops over tables and not straight-line code: `zeitlin(7)` takes
    /// 0.4 us a call and 0.5 s of rustc 1.95 straight; `zeitlin(9)`, 5280 products, 2.1 us and 7 s straight, 3.9 us and
    /// 0.1 s as a loop; `zeitlin(11)`, 12,576 products, crashes rustc straight.
    pub products: usize,
    /// Terms, times points, whose rounding errors are measured, in all functions of a program together.
    pub measurements: usize,
}

impl Default for SearchBudget {
    fn default() -> SearchBudget {
        SearchBudget {
            divisors: 4_000_000,
            steps: 16_000_000,
            terms: 4_000_000,
            numbers: 100_000,
            units: 20_000_000,
            products: 4_000,
            measurements: 5_000_000,
        }
    }
}
