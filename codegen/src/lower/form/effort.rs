//! What the search for the cheapest form of one function has taken of its budget.
//!
//! Does not know: what is searched for.

use std::collections::BTreeSet;

use crate::expr::Graph;
use crate::lower::SearchBudget;
use crate::program::Limit;

/// Steps of the search for common divisors that take as long as a step of the graph's budget.
const STEPS_OF_ONE: usize = 4;

/// Counts of work, which are the same on every machine, and the limits met.
#[derive(Debug)]
pub(super) struct Effort {
    budget: SearchBudget,
    /// Occurrences of divisors looked at.
    pub(super) divisors: usize,
    /// Everything that the search for common divisors has done, also with what was known.
    pub(super) steps: usize,
    /// Terms multiplied out or summed.
    pub(super) terms: usize,
    /// Terms looked at for other units.
    pub(super) units: usize,
    limits: BTreeSet<Limit>,
}

impl Effort {
    pub(super) fn new(budget: &SearchBudget) -> Effort {
        Effort { budget: *budget, divisors: 0, steps: 0, terms: 0, units: 0, limits: BTreeSet::new() }
    }

    /// Whether so much was done that the form found so far has to do.
    pub(super) fn is_spent(&mut self, graph: &Graph) -> bool {
        let steps = self.meets(Limit::Steps, self.steps > self.budget.steps);
        self.meets(Limit::Scene, graph.is_half_spent()) || steps
    }

    /// Whether no further definition is to be looked at.
    pub(super) fn has_seen_enough(&mut self) -> bool {
        self.meets(Limit::Divisors, self.divisors + 10 * self.terms > self.budget.divisors)
    }

    /// Whether nothing more is to be multiplied out.
    pub(super) fn has_multiplied_enough(&mut self) -> bool {
        self.meets(Limit::Terms, self.terms >= self.budget.terms)
    }

    /// Whether numbers of `n_terms` terms in all are too long for anything to be multiplied out.
    pub(super) fn has_long_numbers(&mut self, n_terms: usize) -> bool {
        self.meets(Limit::Numbers, n_terms > self.budget.numbers)
    }

    /// Whether no other units are to be looked for.
    pub(super) fn has_measured_enough_units(&mut self) -> bool {
        self.meets(Limit::Units, self.units > self.budget.units)
    }

    /// Whether `n_measured` rounding errors of terms are enough.
    pub(super) fn has_measured_enough_errors(&mut self, n_measured: usize) -> bool {
        self.meets(Limit::Measurements, n_measured > self.budget.measurements)
    }

    /// Takes the steps since there were `before` of them from the graph's budget.
    pub(super) fn charge_steps(&self, graph: &mut Graph, before: usize) {
        graph.charge((self.steps - before) / STEPS_OF_ONE);
    }

    /// The limits that the search met.
    pub(super) fn into_limits(self) -> BTreeSet<Limit> {
        self.limits
    }

    fn meets(&mut self, limit: Limit, is_met: bool) -> bool {
        if is_met {
            self.limits.insert(limit);
        }
        is_met
    }
}
