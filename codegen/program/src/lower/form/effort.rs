//! What the search for the cheapest form of one function has taken of its budget.
//!
//! Does not know: what is searched for.

use std::collections::BTreeSet;

use crate::lower::SearchBudget;
use crate::program::Limit;
use hamel_expr::Graph;

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
    /// What had been done when the search was allowed to go on.
    before: Done,
    /// The part of the budget that may be taken since then, as a fraction.
    allowed: (usize, usize),
}

/// What of the budget is allowed anew to a search that goes on.
#[derive(Clone, Copy, Debug, Default)]
struct Done {
    steps: usize,
    divisors: usize,
    numbers: usize,
}

impl Effort {
    pub(super) fn new(budget: &SearchBudget) -> Effort {
        Effort {
            budget: *budget,
            divisors: 0,
            steps: 0,
            terms: 0,
            units: 0,
            limits: BTreeSet::new(),
            before: Done::default(),
            allowed: (1, 1),
        }
    }

    /// Allows as many steps, divisors and terms of numbers again, of which there are `n_numbers` by now; that these
    /// were limits is forgotten.
    pub(super) fn go_on(&mut self, n_numbers: usize) {
        self.before = Done { steps: self.steps, divisors: self.n_divisors(), numbers: n_numbers };
        self.limits.remove(&Limit::Numbers);
        self.allow(1, 1);
    }

    /// Allows a part of the steps and divisors.
    pub(super) fn allow(&mut self, part: usize, of: usize) {
        self.allowed = (part, of);
        self.limits.retain(|limit| !matches!(limit, Limit::Steps | Limit::Divisors));
    }

    fn n_divisors(&self) -> usize {
        self.divisors + 10 * self.terms
    }

    /// Whether `n`, of which there were some `before`, is more than is allowed of a part of the budget.
    fn is_beyond(&self, n: usize, before: usize, budget: usize) -> bool {
        n - before > budget / self.allowed.1 * self.allowed.0
    }

    /// Whether so much was done that the form found so far has to do.
    pub(super) fn is_spent(&mut self, graph: &Graph) -> bool {
        let is_beyond = self.is_beyond(self.steps, self.before.steps, self.budget.steps);
        let steps = self.meets(Limit::Steps, is_beyond);
        self.meets(Limit::Scene, graph.is_half_spent()) || steps
    }

    /// Whether no further definition is to be looked at.
    pub(super) fn has_seen_enough(&mut self) -> bool {
        let is_beyond = self.is_beyond(self.n_divisors(), self.before.divisors, self.budget.divisors);
        self.meets(Limit::Divisors, is_beyond)
    }

    /// Whether nothing more is to be multiplied out.
    pub(super) fn has_multiplied_enough(&mut self) -> bool {
        self.meets(Limit::Terms, self.terms >= self.budget.terms)
    }

    /// Whether numbers of `n_terms` terms in all are too long for anything to be multiplied out.
    pub(super) fn has_long_numbers(&mut self, n_terms: usize) -> bool {
        self.meets(Limit::Numbers, n_terms - self.before.numbers > self.budget.numbers)
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
