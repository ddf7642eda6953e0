//! The arena of expressions with its symbols and its budget, and what can be asked of it.
//!
//! Deliberately does not know: canonical forms, derivatives, the zero test.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use num_bigint::BigInt;
use num_traits::{One, ToPrimitive, Zero};
use rustc_hash::{FxHashMap, FxHashSet};

use super::arena::Arena;
use super::budget::{Budget, Exhausted, Meter, Resource, Stage, work_with};
use super::fingerprint::first_values;
use super::knowledge::{Fingerprint, Vanishing};
use super::node::{ExprId, Node, SymbolId};
use super::rational::{MAX_BITS, Rational, rational_to_f64};

/// An expression was divided by an expression that is identically zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DivisionByZero;

impl fmt::Display for DivisionByZero {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("division by an expression that is identically zero")
    }
}

impl std::error::Error for DivisionByZero {}

/// Hash-consed expressions, their symbols and their budget.
///
/// ```
/// use hamel_expr::{Func, Graph};
/// let mut g = Graph::new();
/// let theta = g.symbol("theta");
/// let theta = g.sym(theta);
/// let (s, c) = (g.func(Func::Sin, theta), g.func(Func::Cos, theta));
/// let (s2, c2, one) = (g.powi(s, 2), g.powi(c, 2), g.one());
/// let circle = g.sum(&[s2, c2]);
/// let zero = g.sub(circle, one);
/// assert!(g.is_zero(zero));
/// ```
#[derive(Clone, Debug)]
pub struct Graph {
    pub(super) arena: Arena,
    /// Verdicts that took more than a look.
    pub(super) verdicts: FxHashMap<ExprId, Vanishing>,
    /// The last node made of those with the same hash.
    pub(super) index: FxHashMap<u64, ExprId>,
    /// The one made before it with the same hash.
    pub(super) earlier: Vec<Option<ExprId>>,
    /// Sums whose content was found to be one.
    pub(super) primitive: FxHashSet<ExprId>,
    pub(super) meter: Meter,
}

impl Default for Graph {
    fn default() -> Self {
        Graph::new()
    }
}

impl Graph {
    /// An empty graph.
    pub fn new() -> Graph {
        let mut graph = Graph {
            arena: Arena::new(),
            verdicts: FxHashMap::default(),
            index: FxHashMap::default(),
            earlier: Vec::new(),
            primitive: FxHashSet::default(),
            meter: Meter::new(),
        };
        graph.intern(Node::Constant(Rational::zero()));
        graph.intern(Node::Constant(Rational::one()));
        graph
    }

    /// Number of nodes made so far.
    pub fn n_nodes(&self) -> usize {
        self.arena.n_nodes()
    }

    /// The node behind a handle.
    pub fn node(&self, e: ExprId) -> &Node {
        self.arena.node(e)
    }

    pub(super) fn intern(&mut self, node: Node) -> ExprId {
        let hash = node.short_hash();
        let last = self.index.get(&hash).copied();
        let mut at = last;
        while let Some(id) = at {
            if *self.arena.node(id) == node {
                return id;
            }
            at = self.earlier[id.index()];
        }
        self.meter.made(&node);
        self.arena.learn(&node);
        let fingerprint = first_values(&self.arena, &node);
        let mut doubts = self.arena.own_doubts(&node);
        self.arena.behind(&node, |e| doubts = doubts.and(self.arena.doubts(e)));
        let id = self.arena.push(node, fingerprint, doubts);
        self.earlier.push(last);
        self.index.insert(hash, id);
        id
    }

    /// Limits what may be made in this graph from now on, what is there already included; a new graph has no limits.
    pub fn set_budget(&mut self, budget: Budget) {
        self.meter.set_limit(budget);
    }

    /// The limits.
    pub fn budget(&self) -> Budget {
        self.meter.limit()
    }

    /// What was spent so far, here and in the graphs that this one is a copy of.
    pub fn spent(&self) -> Budget {
        self.meter.spent()
    }

    /// Whether everything that was asked for was made. Past its budget, and past 2^18 bits of one number, a graph makes
    /// nothing more: expressions are other than what was asked for then, and no result may be taken from it.
    ///
    /// # Errors
    /// [`Exhausted`], for what was not enough first.
    pub fn within_budget(&self) -> Result<(), Exhausted> {
        self.meter.exhausted().map_or(Ok(()), Err)
    }

    /// Names the part of the work that follows, for the message.
    pub fn enter(&mut self, stage: Stage) {
        self.meter.enter(stage);
    }

    /// Counts work that makes no expressions.
    pub fn charge(&mut self, steps: usize) {
        self.meter.work(steps as u64);
    }

    /// Whether half of the steps of the budget are spent, or all of something: time for a search to take what it has.
    pub fn is_half_spent(&self) -> bool {
        self.meter.is_exhausted() || self.meter.spent().work > self.meter.limit().work / 2
    }

    /// An empty graph that goes on with the budget of this one; [`Graph::take_over`] brings back what it spends.
    pub fn fork(&self) -> Graph {
        let mut fork = Graph::new();
        fork.meter = self.meter.clone();
        fork
    }

    /// Counts what a [`Graph::fork`] has spent.
    pub fn take_over(&mut self, fork: &Graph) {
        self.meter.take_over(&fork.meter);
    }

    /// `c^q` for an integer `q`; one where it would have too many digits, and nothing more is made then.
    pub(super) fn integer_power(&mut self, c: &Rational, q: &Rational) -> Rational {
        let bits = c.numer().bits().max(c.denom().bits()).saturating_sub(1);
        let exponent = q.numer().to_i32();
        let n_bits = exponent.map(|n| bits.saturating_mul(u64::from(n.unsigned_abs())));
        match (exponent, n_bits) {
            (Some(n), Some(n_bits)) if n_bits <= MAX_BITS => {
                self.meter.work(work_with(n_bits / 64));
                if n == 1 { c.clone() } else { num_traits::Pow::pow(c, n) }
            }
            // One and minus one have no bits to multiply.
            _ if bits == 0 => {
                let is_odd = num_integer::Integer::is_odd(q.numer());
                if is_odd { c.clone() } else { Rational::one() }
            }
            _ => {
                self.meter.give_up(Resource::NumberBits, MAX_BITS);
                Rational::one()
            }
        }
    }

    /// As [`Meter::made_number`].
    pub(super) fn made_number(&mut self, q: &Rational) {
        self.meter.made_number(q);
    }

    /// A new symbol, distinct from every other one.
    pub fn symbol(&mut self, name: &str) -> SymbolId {
        self.arena.push_symbol(name, None)
    }

    /// A new symbol that stands for `definition`: it prints and evaluates as a name, while zero tests see through it.
    pub fn define(&mut self, name: &str, definition: ExprId) -> SymbolId {
        self.arena.push_symbol(name, Some(definition))
    }

    /// Name of a symbol.
    pub fn name(&self, s: SymbolId) -> &str {
        self.arena.name(s)
    }

    /// Gives a symbol another name, for those who read.
    pub fn rename(&mut self, s: SymbolId, name: String) {
        self.arena.rename(s, name);
    }

    /// What a symbol stands for, if it was made with [`Graph::define`].
    pub(super) fn definition(&self, s: SymbolId) -> Option<ExprId> {
        self.arena.definition(s)
    }

    /// Number of symbols made so far.
    pub fn n_symbols(&self) -> usize {
        self.arena.n_symbols()
    }

    /// A symbol as an expression.
    pub fn sym(&mut self, s: SymbolId) -> ExprId {
        self.intern(Node::Symbol(s))
    }

    /// The integer `n`.
    pub fn int(&mut self, n: i64) -> ExprId {
        self.rational(Rational::from(BigInt::from(n)))
    }

    /// An exact rational.
    pub fn rational(&mut self, q: Rational) -> ExprId {
        self.intern(Node::Constant(q))
    }

    /// The number pi.
    pub fn pi(&mut self) -> ExprId {
        self.intern(Node::Pi)
    }

    /// Zero.
    pub fn zero(&self) -> ExprId {
        Arena::ZERO
    }

    /// One.
    pub fn one(&self) -> ExprId {
        Arena::ONE
    }

    /// Values at the random points: expressions that are equal as functions have equal ones.
    pub fn fingerprint(&self, e: ExprId) -> &Fingerprint {
        self.arena.fingerprint(e)
    }

    /// The value of a constant node.
    pub fn as_rational(&self, e: ExprId) -> Option<&Rational> {
        match self.node(e) {
            Node::Constant(c) => Some(c),
            _ => None,
        }
    }

    /// Every node that the roots need, in ascending (operands first) order.
    pub fn reachable(&self, roots: &[ExprId]) -> Vec<ExprId> {
        self.reachable_beside(roots, |_| false)
    }

    /// Every node that the roots need and that is not known, nor needed by known ones alone, in ascending order.
    pub(super) fn reachable_beside(
        &self,
        roots: &[ExprId],
        is_known: impl Fn(ExprId) -> bool,
    ) -> Vec<ExprId> {
        let mut seen: FxHashSet<ExprId> = FxHashSet::default();
        let mut pending: Vec<ExprId> = roots.to_vec();
        while let Some(e) = pending.pop() {
            if !is_known(e) && seen.insert(e) {
                self.node(e).for_each_operand(|operand| pending.push(operand));
            }
        }
        let mut ordered: Vec<ExprId> = seen.into_iter().collect();
        ordered.sort_unstable();
        ordered
    }

    /// Expressions of another graph in this one. Their symbols are those of a graph that both were cloned from.
    ///
    /// # Errors
    /// [`DivisionByZero`] never happens for expressions that exist in `other`.
    pub fn import(&mut self, other: &Graph, roots: &[ExprId]) -> Result<Vec<ExprId>, DivisionByZero> {
        self.import_with(other, roots, &BTreeMap::new())
    }

    /// As [`Graph::import`], with other expressions, of this graph, in the place of some symbols of the other one.
    ///
    /// # Errors
    /// [`DivisionByZero`] where a denominator vanishes identically with what is put in.
    pub fn import_with(
        &mut self,
        other: &Graph,
        roots: &[ExprId],
        replacement: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<Vec<ExprId>, DivisionByZero> {
        let mut here: FxHashMap<ExprId, ExprId> = FxHashMap::default();
        let order = other.reachable(roots);
        self.charge(order.len());
        for e in order {
            let moved = |list: &[(ExprId, Rational)]| -> Vec<(ExprId, Rational)> {
                list.iter().map(|(e, q)| (here[e], q.clone())).collect()
            };
            let copy = match other.node(e) {
                Node::Constant(q) => self.rational(q.clone()),
                Node::Pi => self.pi(),
                Node::Symbol(s) => replacement.get(s).copied().unwrap_or_else(|| self.sym(*s)),
                Node::Sum { constant, terms } => {
                    let constant = self.rational(constant.clone());
                    let mut all = moved(terms);
                    all.push((constant, Rational::one()));
                    self.linear_combination(&all)
                }
                Node::Product { coefficient, factors } => {
                    let product = self.power_product(&moved(factors))?;
                    self.scale(product, coefficient)
                }
                Node::Function(f, a) => self.func(*f, here[a]),
                Node::Atan2(y, x) => self.atan2(here[y], here[x]),
            };
            here.insert(e, copy);
        }
        Ok(roots.iter().map(|e| here[e]).collect())
    }

    /// The symbols an expression depends on structurally.
    pub fn free_symbols(&self, e: ExprId) -> BTreeSet<SymbolId> {
        self.reachable(&[e])
            .into_iter()
            .filter_map(|e| match self.node(e) {
                Node::Symbol(s) => Some(*s),
                _ => None,
            })
            .collect()
    }

    /// Whether `e` depends on any of `symbols`.
    pub fn depends_on(&self, e: ExprId, symbols: &BTreeSet<SymbolId>) -> bool {
        let (mut seen, mut pending) = (FxHashSet::from_iter([e]), vec![e]);
        while let Some(e) = pending.pop() {
            match self.node(e) {
                Node::Symbol(s) if symbols.contains(s) => return true,
                node => node.for_each_operand(|operand| {
                    if seen.insert(operand) {
                        pending.push(operand);
                    }
                }),
            }
        }
        false
    }

    /// Plain floating-point value, for defaults and messages; `None` for a symbol without a value.
    pub fn eval_f64(&self, e: ExprId, values: &BTreeMap<SymbolId, f64>) -> Option<f64> {
        self.eval_known(&[e], values).get(&e).copied()
    }

    /// Plain floating-point values of everything that the roots are made of, as far as symbols have values.
    pub fn eval_known(&self, roots: &[ExprId], values: &BTreeMap<SymbolId, f64>) -> BTreeMap<ExprId, f64> {
        let mut known: BTreeMap<ExprId, f64> = BTreeMap::new();
        for e in self.reachable(roots) {
            let mut has_value = true;
            self.node(e).for_each_operand(|part| has_value &= known.contains_key(&part));
            if !has_value {
                continue;
            }
            let value = match self.node(e) {
                Node::Constant(c) => rational_to_f64(c),
                Node::Pi => std::f64::consts::PI,
                Node::Symbol(s) => match values.get(s) {
                    Some(value) => *value,
                    None => continue,
                },
                Node::Sum { constant, terms } => terms
                    .iter()
                    .fold(rational_to_f64(constant), |acc, (t, q)| acc + rational_to_f64(q) * known[t]),
                Node::Product { coefficient, factors } => {
                    factors.iter().fold(rational_to_f64(coefficient), |acc, (b, q)| {
                        acc * match q.numer().to_i32() {
                            Some(n) if q.is_integer() => known[b].powi(n),
                            _ => known[b].powf(rational_to_f64(q)),
                        }
                    })
                }
                Node::Function(f, a) => f.eval(known[a]),
                Node::Atan2(y, x) => hamel_runtime::Real::atan2(known[y], known[x]),
            };
            known.insert(e, value);
        }
        known
    }
}
