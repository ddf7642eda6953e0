//! What generating one scene may take, counted the same way on every machine: no clock, no free memory.
//!
//! A graph counts what is made in it. Once it is past its budget it makes nothing more: every constructor returns one,
//! so that whatever is under way comes to its end at once, and whoever hands out a result asks [`Graph::within_budget`]
//! first. Deliberately does not know: what the expressions are for.
//!
//! [`Graph::within_budget`]: super::Graph::within_budget

use std::fmt;
use std::time::Instant;

use super::node::Node;
use super::rational::{MAX_BITS, Rational};
use super::trace::{self, Topic};

/// Limits on the way from the text of a model to the program of one scene.
///
/// The default is ten times what the largest scene of `models/specs` takes (78,000 expressions, 49 MB, 4 million
/// steps), and leaves room for all derivatives of the largest model, which hold more than 256 MiB.
///
/// ```
/// use hamel_expr::Budget;
/// let larger = Budget::default().times(4);
/// assert_eq!(larger.expressions, 4 * Budget::default().expressions);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Budget {
    /// Expressions made.
    pub expressions: u64,
    /// Bytes that these and the tables beside them take.
    pub bytes: u64,
    /// Steps of work: a term added, a factor multiplied, an expression visited, each about a tenth of a microsecond.
    pub work: u64,
}

impl Default for Budget {
    fn default() -> Budget {
        Budget { expressions: 1_000_000, bytes: 512 << 20, work: 200_000_000 }
    }
}

impl Budget {
    /// No limits.
    pub const UNLIMITED: Budget = Budget { expressions: u64::MAX, bytes: u64::MAX, work: u64::MAX };

    /// All limits so many times as large.
    #[must_use]
    pub fn times(self, n: u64) -> Budget {
        let Budget { expressions, bytes, work } = self;
        let [expressions, bytes, work] = [expressions, bytes, work].map(|limit| limit.saturating_mul(n));
        Budget { expressions, bytes, work }
    }

    /// Everything spent since an earlier time, when this much was: for people.
    pub fn since(self, earlier: Budget) -> String {
        let made = self.expressions.saturating_sub(earlier.expressions);
        let work = self.work.saturating_sub(earlier.work);
        format!("{made} expressions, {work} steps of work")
    }
}

/// A part of the way from the text of a model to a program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Stage {
    /// Values of the items of a model.
    Values,
    /// The algebroid and the constraint.
    Reduction,
    /// Momenta and forces.
    Derivation,
    /// The solution for the accelerations.
    Elimination,
    /// Energy, outputs and what is claimed of them.
    Results,
    /// Derivatives of the right-hand side and invariants.
    Derivatives,
    /// The program.
    Lowering,
    /// The text.
    Emission,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Stage::Values => "evaluation of the model's values",
            Stage::Reduction => "reduction",
            Stage::Derivation => "derivation of momenta and forces",
            Stage::Elimination => "solution for the accelerations",
            Stage::Results => "derivation of energy and outputs",
            Stage::Derivatives => "derivatives of the right-hand side",
            Stage::Lowering => "lowering to a program",
            Stage::Emission => "emission of the program",
        })
    }
}

/// What a budget limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Resource {
    /// [`Budget::expressions`].
    Expressions,
    /// [`Budget::bytes`].
    Bytes,
    /// [`Budget::work`].
    Work,
    /// Bits of one exact number, which no budget raises.
    NumberBits,
}

/// A budget was not enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exhausted {
    /// Where.
    pub stage: Stage,
    /// What grew.
    pub resource: Resource,
    /// Beyond what.
    pub limit: u64,
}

impl Exhausted {
    /// What is wrong.
    pub fn message(&self) -> String {
        let Exhausted { stage, resource, limit } = self;
        match resource {
            Resource::Expressions => format!("{stage} makes more than {limit} expressions"),
            Resource::Bytes => format!("{stage} takes more than {} MiB of memory", limit >> 20),
            Resource::Work => format!("{stage} takes more than {limit} steps of work"),
            Resource::NumberBits => format!("{stage} makes an exact number of more than {limit} bits"),
        }
    }

    /// What to change.
    pub fn help(&self) -> &'static str {
        match self.resource {
            Resource::NumberBits => "write smaller powers, or fix parameters to numbers of fewer digits",
            _ => {
                "write smaller expressions, use fewer velocities, fix parameters in a scene, or raise the budget: \
                 `--budget 4` of the command line, `budget=4` of Python, `Config::budget` of a build script"
            }
        }
    }
}

impl fmt::Display for Exhausted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}; {}", self.message(), self.help())
    }
}

impl std::error::Error for Exhausted {}

/// What was spent of a budget.
#[derive(Clone, Debug)]
pub(super) struct Meter {
    limit: Budget,
    spent: Budget,
    stage: Stage,
    /// When the stage began, and what was spent then, where that is traced.
    began: Option<(Instant, Budget)>,
    exhausted: Option<Exhausted>,
}

impl Meter {
    pub(super) fn new() -> Meter {
        let spent = Budget { expressions: 0, bytes: 0, work: 0 };
        let began = trace::start(Topic::Derive).map(|now| (now, spent));
        Meter { limit: Budget::UNLIMITED, spent, stage: Stage::Values, began, exhausted: None }
    }

    pub(super) fn set_limit(&mut self, limit: Budget) {
        self.limit = limit;
    }

    pub(super) fn limit(&self) -> Budget {
        self.limit
    }

    pub(super) fn spent(&self) -> Budget {
        self.spent
    }

    pub(super) fn enter(&mut self, stage: Stage) {
        if let Some((since, before)) = self.began {
            trace::tell(since, self.stage, self.spent.since(before));
            self.began = trace::start(Topic::Derive).map(|now| (now, self.spent));
        }
        trace::at(stage);
        self.stage = stage;
    }

    pub(super) fn is_exhausted(&self) -> bool {
        self.exhausted.is_some()
    }

    pub(super) fn exhausted(&self) -> Option<Exhausted> {
        self.exhausted
    }

    /// Spends what another meter, which began as a copy of this one, has spent besides.
    pub(super) fn take_over(&mut self, other: &Meter) {
        // Its expressions are gone.
        self.spent = Budget { bytes: self.spent.bytes, ..other.spent };
        self.exhausted = self.exhausted.or(other.exhausted);
    }

    /// Nothing more is made for this reason, unless there is one already.
    pub(super) fn give_up(&mut self, resource: Resource, limit: u64) {
        self.exhausted.get_or_insert(Exhausted { stage: self.stage, resource, limit });
    }

    pub(super) fn work(&mut self, steps: u64) {
        self.spent.work = self.spent.work.saturating_add(steps);
        if self.spent.work > self.limit.work {
            self.give_up(Resource::Work, self.limit.work);
        }
    }

    pub(super) fn hold(&mut self, bytes: u64) {
        self.spent.bytes = self.spent.bytes.saturating_add(bytes);
        if self.spent.bytes > self.limit.bytes {
            self.give_up(Resource::Bytes, self.limit.bytes);
        }
    }

    /// Counts an operation that made a number; nothing more is made when it is too long.
    pub(super) fn made_number(&mut self, q: &Rational) {
        let words = words(q);
        if words > 1 {
            self.work(work_with(words));
            if words > MAX_BITS / 64 {
                self.give_up(Resource::NumberBits, MAX_BITS);
            }
        }
    }

    /// Counts a node that is put into the arena.
    pub(super) fn made(&mut self, node: &Node) {
        self.spent.expressions += 1;
        if self.spent.expressions > self.limit.expressions {
            self.give_up(Resource::Expressions, self.limit.expressions);
        }
        // Arena, fingerprint and index; then a handle with two allocated integers for each operand.
        let (mut bytes, mut steps) = (288, 4);
        let mut number = |q: &Rational| {
            let words = words(q);
            bytes += 8 * words;
            steps += work_with(words);
        };
        match node {
            Node::Constant(q) => number(q),
            Node::Sum { constant: q, terms: list } | Node::Product { coefficient: q, factors: list } => {
                number(q);
                list.iter().for_each(|(_, q)| number(q));
                // Roots and inverses in the field of the fingerprints.
                let n_dear = match node {
                    Node::Product { .. } => list.iter().filter(|(_, q)| !is_small_power(q)).count(),
                    _ => 0,
                };
                (bytes, steps) = (bytes + 128 * list.len() as u64, steps + 20 * n_dear as u64);
            }
            Node::Function(..) | Node::Atan2(..) => steps += 20,
            Node::Pi | Node::Symbol(_) => {}
        }
        self.hold(bytes);
        self.work(steps);
    }
}

fn is_small_power(q: &Rational) -> bool {
    use num_traits::Signed as _;
    q.is_integer() && q.is_positive()
}

/// 64-bit words of a number.
pub(super) fn words(q: &Rational) -> u64 {
    (q.numer().bits() + q.denom().bits()) / 64 + 1
}

/// Steps of one operation on numbers of so many words: common divisors are found bit by bit.
pub(super) fn work_with(words: u64) -> u64 {
    1 + words * words / 2
}
