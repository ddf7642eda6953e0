//! The arena, its canonical constructors, differentiation, substitution and the zero test.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::fmt;
use std::hash::{Hash as _, Hasher as _};

use num_bigint::BigInt;
use num_traits::{One, Signed, ToPrimitive, Zero};
use rustc_hash::{FxHashMap, FxHasher};

use super::budget::{Budget, Exhausted, MAX_BITS, Meter, Resource, Stage, words, work_with};
use super::fingerprint::{Doubts, Fingerprint, Vanishing, first_values};
use super::independence::Knowledge;
use super::rational::{Rational, rational_to_f64};

/// Handle of an expression; equal handles are equal expressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ExprId(u32);

impl ExprId {
    /// Position in the arena; operands have smaller positions than the nodes that use them.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Handle of a symbol. Symbols are distinct even when their names are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct SymbolId(u32);

impl SymbolId {
    /// Position in the graph's symbol table.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Elementary functions of one argument. Square roots are powers with exponent 1/2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[expect(missing_docs, reason = "the variants are the functions they are named after")]
pub enum Func {
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Exp,
    Ln,
    Sinh,
    Cosh,
    Tanh,
    Abs,
}

impl Func {
    /// All functions, in a fixed order.
    pub const ALL: [Func; 12] = [
        Func::Sin,
        Func::Cos,
        Func::Tan,
        Func::Asin,
        Func::Acos,
        Func::Atan,
        Func::Exp,
        Func::Ln,
        Func::Sinh,
        Func::Cosh,
        Func::Tanh,
        Func::Abs,
    ];

    /// The name in the model language and in emitted code.
    pub fn name(self) -> &'static str {
        match self {
            Func::Sin => "sin",
            Func::Cos => "cos",
            Func::Tan => "tan",
            Func::Asin => "asin",
            Func::Acos => "acos",
            Func::Atan => "atan",
            Func::Exp => "exp",
            Func::Ln => "ln",
            Func::Sinh => "sinh",
            Func::Cosh => "cosh",
            Func::Tanh => "tanh",
            Func::Abs => "abs",
        }
    }

    /// The function of that name.
    pub fn from_name(name: &str) -> Option<Func> {
        Func::ALL.into_iter().find(|f| f.name() == name)
    }

    /// The value, through the functions that emitted code calls.
    pub fn eval(self, x: f64) -> f64 {
        use hamel_runtime::Real;
        match self {
            Func::Sin => Real::sin(x),
            Func::Cos => Real::cos(x),
            Func::Tan => Real::tan(x),
            Func::Asin => Real::asin(x),
            Func::Acos => Real::acos(x),
            Func::Atan => Real::atan(x),
            Func::Exp => Real::exp(x),
            Func::Ln => Real::ln(x),
            Func::Sinh => Real::sinh(x),
            Func::Cosh => Real::cosh(x),
            Func::Tanh => Real::tanh(x),
            Func::Abs => Real::abs(x),
        }
    }
}

/// A canonical node.
///
/// Invariants: a sum has at least two entries counting a non-zero constant, its terms are distinct, sorted, not
/// constants, not sums and have unit coefficient; a product's factors are distinct, sorted, with non-zero exponents and
/// its coefficient is non-zero; `1 * x^1` is `x` itself.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum Node {
    /// An exact rational.
    Constant(Rational),
    /// The ratio of a circle's circumference to its diameter.
    Pi,
    /// A named unknown.
    Symbol(SymbolId),
    /// `constant + sum_k coefficient_k * term_k`.
    Sum {
        /// The constant summand, often zero.
        constant: Rational,
        /// Terms and their non-zero coefficients.
        terms: Box<[(ExprId, Rational)]>,
    },
    /// `coefficient * prod_k base_k ^ exponent_k`.
    Product {
        /// The non-zero rational factor.
        coefficient: Rational,
        /// Bases and their non-zero exponents.
        factors: Box<[(ExprId, Rational)]>,
    },
    /// An elementary function of an expression.
    Function(Func, ExprId),
    /// The angle of the point `(x, y)` in `(-pi, pi]`, given `y` and `x` in that order.
    Atan2(ExprId, ExprId),
}

impl Node {
    /// Calls `visit` on every operand.
    pub fn for_each_operand(&self, mut visit: impl FnMut(ExprId)) {
        match self {
            Node::Constant(_) | Node::Pi | Node::Symbol(_) => {}
            Node::Sum { terms: list, .. } | Node::Product { factors: list, .. } => {
                list.iter().for_each(|(e, _)| visit(*e));
            }
            Node::Function(_, argument) => visit(*argument),
            Node::Atan2(y, x) => {
                visit(*y);
                visit(*x);
            }
        }
    }

    /// How many terms or factors it has.
    pub(crate) fn n_operands(&self) -> usize {
        match self {
            Node::Constant(_) | Node::Pi | Node::Symbol(_) => 0,
            Node::Sum { terms: list, .. } | Node::Product { factors: list, .. } => list.len(),
            Node::Function(..) => 1,
            Node::Atan2(..) => 2,
        }
    }

    /// A hash of the node. That of a ratio divides like Euclid, as its terms need not be coprime; here they are.
    fn short_hash(&self) -> u64 {
        let mut hasher = FxHasher::default();
        std::mem::discriminant(self).hash(&mut hasher);
        let rational = |q: &Rational, hasher: &mut FxHasher| {
            q.numer().hash(hasher);
            if !q.is_integer() {
                q.denom().hash(hasher);
            }
        };
        match self {
            Node::Constant(q) => rational(q, &mut hasher),
            Node::Pi => {}
            Node::Symbol(s) => s.hash(&mut hasher),
            Node::Sum { constant: q, terms: list } | Node::Product { coefficient: q, factors: list } => {
                rational(q, &mut hasher);
                for (e, q) in list {
                    e.hash(&mut hasher);
                    rational(q, &mut hasher);
                }
            }
            Node::Function(f, argument) => (f, argument).hash(&mut hasher),
            Node::Atan2(y, x) => (y, x).hash(&mut hasher),
        }
        hasher.finish()
    }
}

/// An expression was divided by an expression that is identically zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DivisionByZero;

impl fmt::Display for DivisionByZero {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("division by an expression that is identically zero")
    }
}

impl std::error::Error for DivisionByZero {}

#[derive(Clone, Debug)]
struct SymbolEntry {
    name: String,
    /// What the symbol stands for.
    definition: Option<ExprId>,
}

/// Arena of hash-consed expressions and their symbols.
///
/// ```
/// use hamel_codegen::expr::{Func, Graph};
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
    nodes: Vec<Node>,
    fingerprints: Vec<Fingerprint>,
    /// What is to be thought of the fingerprints.
    doubts: Vec<Doubts>,
    knowledge: Knowledge,
    /// Verdicts that took more than a look.
    verdicts: FxHashMap<ExprId, Vanishing>,
    /// The last node made of those with the same hash.
    index: FxHashMap<u64, ExprId>,
    /// The one made before it with the same hash.
    earlier: Vec<Option<ExprId>>,
    symbols: Vec<SymbolEntry>,
    /// Sums whose content was found to be one.
    primitive: HashSet<ExprId>,
    zero: ExprId,
    one: ExprId,
    meter: Meter,
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
            nodes: Vec::new(),
            fingerprints: Vec::new(),
            doubts: Vec::new(),
            knowledge: Knowledge::new(),
            verdicts: FxHashMap::default(),
            index: FxHashMap::default(),
            earlier: Vec::new(),
            symbols: Vec::new(),
            primitive: HashSet::new(),
            zero: ExprId(0),
            one: ExprId(1),
            meter: Meter::new(),
        };
        graph.intern(Node::Constant(Rational::zero()));
        graph.intern(Node::Constant(Rational::one()));
        graph
    }

    /// Number of nodes made so far.
    pub fn n_nodes(&self) -> usize {
        self.nodes.len()
    }

    /// The node behind a handle.
    pub fn node(&self, e: ExprId) -> &Node {
        &self.nodes[e.index()]
    }

    fn intern(&mut self, node: Node) -> ExprId {
        let hash = node.short_hash();
        let last = self.index.get(&hash).copied();
        let mut at = last;
        while let Some(id) = at {
            if self.nodes[id.index()] == node {
                return id;
            }
            at = self.earlier[id.index()];
        }
        self.meter.made(&node);
        self.learn(&node);
        let fingerprint = first_values(self, &node);
        let mut doubts = self.own_doubts(&node);
        self.behind(&node, |e| doubts = doubts.and(self.doubts[e.index()]));
        let id = ExprId(u32::try_from(self.nodes.len()).expect("fewer than 2^32 expressions fit in memory"));
        self.nodes.push(node);
        self.fingerprints.push(fingerprint);
        self.doubts.push(doubts);
        self.earlier.push(last);
        self.index.insert(hash, id);
        id
    }

    // ---- budget ---------------------------------------------------------------------------------------------------

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
    pub(crate) fn enter(&mut self, stage: Stage) {
        self.meter.enter(stage);
    }

    /// Counts work that makes no expressions.
    pub(crate) fn charge(&mut self, steps: usize) {
        self.meter.work(steps as u64);
    }

    /// Whether half of the steps of the budget are spent, or all of something: time for a search to take what it has.
    pub(crate) fn is_half_spent(&self) -> bool {
        self.meter.is_exhausted() || self.meter.spent().work > self.meter.limit().work / 2
    }

    /// An empty graph that goes on with the budget of this one; [`Graph::take_over`] brings back what it spends.
    pub(crate) fn fork(&self) -> Graph {
        let mut fork = Graph::new();
        fork.meter = self.meter.clone();
        fork
    }

    /// Counts what a [`Graph::fork`] has spent.
    pub(crate) fn take_over(&mut self, fork: &Graph) {
        self.meter.take_over(&fork.meter);
    }

    /// `c^q` for an integer `q`; one where it would have too many digits, and nothing more is made then.
    fn integer_power(&mut self, c: &Rational, q: &Rational) -> Rational {
        let bits = c.numer().bits().max(c.denom().bits()).saturating_sub(1);
        let exponent = q.numer().to_i32();
        let n_bits = exponent.map(|n| bits.saturating_mul(u64::from(n.unsigned_abs())));
        match (exponent, n_bits) {
            (Some(n), Some(n_bits)) if n_bits <= MAX_BITS => {
                self.meter.work(work_with(n_bits / 64));
                num_traits::Pow::pow(c, n)
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

    /// Counts an operation that made a number; nothing more is made when it is too long.
    fn made_number(&mut self, q: &Rational) {
        let words = words(q);
        if words > 1 {
            self.meter.work(work_with(words));
            if words > MAX_BITS / 64 {
                self.meter.give_up(Resource::NumberBits, MAX_BITS);
            }
        }
    }

    // ---- leaves ---------------------------------------------------------------------------------------------------

    /// A new symbol, distinct from every other one.
    pub fn symbol(&mut self, name: &str) -> SymbolId {
        self.push_symbol(name, None)
    }

    /// A new symbol that stands for `definition`: it prints and evaluates as a name, while zero tests see through it.
    pub fn define(&mut self, name: &str, definition: ExprId) -> SymbolId {
        self.push_symbol(name, Some(definition))
    }

    fn push_symbol(&mut self, name: &str, definition: Option<ExprId>) -> SymbolId {
        let id = SymbolId(u32::try_from(self.symbols.len()).expect("fewer than 2^32 symbols fit in memory"));
        self.symbols.push(SymbolEntry { name: name.to_owned(), definition });
        id
    }

    /// Name of a symbol.
    pub fn name(&self, s: SymbolId) -> &str {
        &self.symbols[s.index()].name
    }

    /// Gives a symbol another name, for those who read.
    pub(crate) fn rename(&mut self, s: SymbolId, name: String) {
        self.symbols[s.index()].name = name;
    }

    /// What a symbol stands for, if it was made with [`Graph::define`].
    pub(super) fn definition(&self, s: SymbolId) -> Option<ExprId> {
        self.symbols[s.index()].definition
    }

    /// Number of symbols made so far.
    pub fn n_symbols(&self) -> usize {
        self.symbols.len()
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
        self.zero
    }

    /// One.
    pub fn one(&self) -> ExprId {
        self.one
    }

    // ---- canonical constructors -------------------------------------------------------------------------------------

    /// `a + b`.
    pub fn add(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.sum(&[a, b])
    }

    /// `a - b`.
    pub fn sub(&mut self, a: ExprId, b: ExprId) -> ExprId {
        let minus = self.neg(b);
        self.sum(&[a, minus])
    }

    /// `-a`.
    pub fn neg(&mut self, a: ExprId) -> ExprId {
        self.scale(a, &-Rational::one())
    }

    /// `a * b`.
    pub fn mul(&mut self, a: ExprId, b: ExprId) -> ExprId {
        self.product(&[a, b])
    }

    /// `a / b`.
    ///
    /// # Errors
    /// [`DivisionByZero`] when `b` is identically zero.
    pub fn div(&mut self, a: ExprId, b: ExprId) -> Result<ExprId, DivisionByZero> {
        let inverse = self.pow(b, &-Rational::one())?;
        Ok(self.mul(a, inverse))
    }

    /// `q * a`; a rational factor is distributed over a sum.
    pub fn scale(&mut self, a: ExprId, q: &Rational) -> ExprId {
        if q.is_zero() {
            return self.zero;
        }
        if q.is_one() {
            return a;
        }
        if self.meter.is_exhausted() {
            return self.one;
        }
        match self.node(a).clone() {
            Node::Constant(c) => {
                let product = c * q;
                self.made_number(&product);
                self.rational(product)
            }
            Node::Sum { constant, terms } => {
                self.charge(terms.len());
                let terms = terms.iter().map(|(e, c)| (*e, c * q)).collect();
                self.intern(Node::Sum { constant: constant * q, terms })
            }
            Node::Product { coefficient, factors } => self.product_node(coefficient * q, factors),
            _ => self.product_node(q.clone(), Box::new([(a, Rational::one())])),
        }
    }

    /// The sum of any number of expressions: flattened, merged, sorted.
    pub fn sum(&mut self, summands: &[ExprId]) -> ExprId {
        let weighted: Vec<_> = summands.iter().map(|e| (*e, Rational::one())).collect();
        self.linear_combination(&weighted)
    }

    /// `sum_k q_k e_k`.
    pub fn linear_combination(&mut self, summands: &[(ExprId, Rational)]) -> ExprId {
        let mut constant = Rational::zero();
        let mut merged: BTreeMap<ExprId, Rational> = BTreeMap::new();
        for (e, q) in summands {
            if self.meter.is_exhausted() {
                return self.one;
            }
            self.charge(1);
            match self.node(*e).clone() {
                Node::Constant(c) => {
                    constant += c * q;
                    self.made_number(&constant);
                }
                Node::Sum { constant: inner, terms } => {
                    constant += inner * q;
                    self.made_number(&constant);
                    self.charge(terms.len());
                    for (term, c) in terms.iter() {
                        let total = merged.entry(*term).or_insert_with(Rational::zero);
                        *total += c * q;
                        self.made_number(total);
                    }
                }
                _ => {
                    let (coefficient, monic) = self.split_coefficient(*e);
                    let total = merged.entry(monic).or_insert_with(Rational::zero);
                    *total += coefficient * q;
                    self.made_number(total);
                }
            }
        }
        let terms: Vec<_> = merged.into_iter().filter(|(_, c)| !c.is_zero()).collect();
        match (terms.as_slice(), constant.is_zero()) {
            ([], _) => self.rational(constant),
            ([(e, c)], true) => {
                let (e, c) = (*e, c.clone());
                self.scale(e, &c)
            }
            _ => self.intern(Node::Sum { constant, terms: terms.into() }),
        }
    }

    /// Writes `e = q * monic` with a rational `q`; sums are left alone.
    pub fn split_coefficient(&mut self, e: ExprId) -> (Rational, ExprId) {
        match self.node(e) {
            Node::Product { coefficient, factors } if !coefficient.is_one() => {
                let (coefficient, factors) = (coefficient.clone(), factors.clone());
                (coefficient, self.product_node(Rational::one(), factors))
            }
            _ => (Rational::one(), e),
        }
    }

    fn product_node(&mut self, coefficient: Rational, factors: Box<[(ExprId, Rational)]>) -> ExprId {
        match &*factors {
            [] => self.rational(coefficient),
            [(base, exponent)] if exponent.is_one() => {
                if coefficient.is_one() {
                    *base
                } else if matches!(self.node(*base), Node::Sum { .. }) {
                    self.scale(*base, &coefficient)
                } else {
                    self.intern(Node::Product { coefficient, factors })
                }
            }
            _ => self.intern(Node::Product { coefficient, factors }),
        }
    }

    /// The product of any number of expressions: flattened, exponents merged, sorted, coefficient in front.
    pub fn product(&mut self, operands: &[ExprId]) -> ExprId {
        let weighted: Vec<_> = operands.iter().map(|e| (*e, Rational::one())).collect();
        self.power_product(&weighted).expect("exponents are positive")
    }

    /// `prod_k e_k ^ q_k`.
    ///
    /// Exponents of equal bases are added, which presumes bases of non-integer powers to be positive, as square roots
    /// in a real model are.
    ///
    /// # Errors
    /// [`DivisionByZero`] for a zero base with a negative exponent.
    pub fn power_product(&mut self, operands: &[(ExprId, Rational)]) -> Result<ExprId, DivisionByZero> {
        let mut coefficient = Rational::one();
        let mut merged: BTreeMap<ExprId, Rational> = BTreeMap::new();
        let mut pending: Vec<(ExprId, Rational)> = operands.iter().rev().cloned().collect();
        loop {
            while let Some((e, q)) = pending.pop() {
                if self.meter.is_exhausted() {
                    return Ok(self.one);
                }
                self.charge(1);
                if q.is_zero() {
                    continue;
                }
                match self.node(e).clone() {
                    Node::Constant(c) if c.is_zero() => {
                        if q.is_negative() {
                            return Err(DivisionByZero);
                        }
                        return Ok(self.zero);
                    }
                    Node::Constant(c) if q.is_integer() => {
                        coefficient *= self.integer_power(&c, &q);
                        self.made_number(&coefficient);
                    }
                    Node::Constant(c) => {
                        if let Some(root) = exact_root(&c, &q) {
                            coefficient *= root;
                        } else {
                            *merged.entry(e).or_insert_with(Rational::zero) += q;
                        }
                    }
                    Node::Product { coefficient: c, factors } if q.is_integer() => {
                        coefficient *= self.integer_power(&c, &q);
                        self.made_number(&coefficient);
                        pending.extend(factors.iter().rev().map(|(base, exponent)| (*base, exponent * &q)));
                    }
                    Node::Sum { .. } if q.is_integer() && !self.primitive.contains(&e) => {
                        let (content, primitive) = self.primitive_part(e);
                        coefficient *= self.integer_power(&content, &q);
                        self.made_number(&coefficient);
                        *merged.entry(primitive).or_insert_with(Rational::zero) += q;
                    }
                    _ => *merged.entry(e).or_insert_with(Rational::zero) += q,
                }
            }
            // Merging can turn the half-integer power of a constant or product into an integer one: flatten it again.
            let reducible: Vec<ExprId> = merged
                .iter()
                .filter(|(e, q)| match self.node(**e) {
                    Node::Constant(_) => q.is_integer() || **q >= Rational::one() || q.is_negative(),
                    Node::Product { .. } => q.is_integer(),
                    Node::Sum { .. } => {
                        q.is_integer() && !self.primitive.contains(*e) && !self.is_primitive(**e)
                    }
                    _ => q.is_zero(),
                })
                .map(|(e, _)| *e)
                .collect();
            if reducible.is_empty() {
                break;
            }
            for e in reducible {
                let Some(q) = merged.remove(&e) else { continue };
                match self.node(e).clone() {
                    Node::Constant(c) if !q.is_integer() => {
                        // 2^(3/2) = 2 * 2^(1/2): the integer part joins the coefficient.
                        let whole = q.floor();
                        coefficient *= self.integer_power(&c, &whole);
                        self.made_number(&coefficient);
                        merged.insert(e, q - whole);
                    }
                    _ => pending.push((e, q)),
                }
            }
        }
        let factors: Vec<_> = merged.into_iter().filter(|(_, q)| !q.is_zero()).collect();
        Ok(self.product_node(coefficient, factors.into()))
    }

    fn is_primitive(&self, e: ExprId) -> bool {
        match self.node(e) {
            Node::Sum { constant, terms } => content(constant, terms).is_none_or(|q| q.is_one()),
            _ => true,
        }
    }

    /// Writes a sum as `q * primitive`, the primitive part having coprime integer coefficients and a positive first
    /// one.
    pub fn primitive_part(&mut self, e: ExprId) -> (Rational, ExprId) {
        let Node::Sum { constant, terms } = self.node(e) else { return (Rational::one(), e) };
        let Some(q) = content(constant, terms) else {
            self.meter.give_up(Resource::NumberBits, MAX_BITS);
            return (Rational::one(), e);
        };
        self.charge(self.node(e).n_operands());
        self.made_number(&q);
        let primitive = self.scale(e, &q.recip());
        self.primitive.insert(primitive);
        (q, primitive)
    }

    /// `a ^ n` for an integer `n`; `0 ^ n` with negative `n` is refused by [`Graph::pow`], so here `n >= 0`.
    ///
    /// # Panics
    /// When `n` is negative and `a` is identically zero.
    pub fn powi(&mut self, a: ExprId, n: i64) -> ExprId {
        self.pow(a, &Rational::from(BigInt::from(n))).expect("caller gave a negative power of zero")
    }

    /// `a ^ q`.
    ///
    /// # Errors
    /// [`DivisionByZero`] for a negative power of zero, also when only the zero test sees that `a` vanishes. What is
    /// not known to vanish may be divided by: who chooses divisors asks for [`Graph::vanishing`].
    pub fn pow(&mut self, a: ExprId, q: &Rational) -> Result<ExprId, DivisionByZero> {
        if q.is_negative() && !self.meter.is_exhausted() && self.is_zero(a) {
            return Err(DivisionByZero);
        }
        self.power_product(&[(a, q.clone())])
    }

    /// The square root.
    pub fn sqrt(&mut self, a: ExprId) -> ExprId {
        let half = Rational::new(BigInt::one(), BigInt::from(2));
        self.power_product(&[(a, half)]).expect("exponent is positive")
    }

    /// An elementary function; odd and even functions take a canonical sign, values at special points fold.
    pub fn func(&mut self, f: Func, a: ExprId) -> ExprId {
        if self.meter.is_exhausted() {
            return self.one;
        }
        if a == self.zero {
            return match f {
                Func::Cos | Func::Exp | Func::Cosh => self.one,
                Func::Acos => {
                    let pi = self.pi();
                    self.scale(pi, &Rational::new(BigInt::one(), BigInt::from(2)))
                }
                Func::Ln => self.intern(Node::Function(f, a)),
                _ => self.zero,
            };
        }
        match f {
            Func::Ln if a == self.one => return self.zero,
            Func::Abs => {
                if let Node::Constant(c) = self.node(a) {
                    let c = c.abs();
                    return self.rational(c);
                }
            }
            Func::Tan => {
                let (s, c) = (self.func(Func::Sin, a), self.func(Func::Cos, a));
                // cos is not identically zero: its argument is not the constant pi/2 unless folded, handled by Err.
                if let Ok(t) = self.div(s, c) {
                    return t;
                }
            }
            Func::Sin | Func::Cos => {
                if let Some(value) = self.quarter_turn(f, a) {
                    return value;
                }
            }
            _ => {}
        }
        // A function undoes its inverse where that has a value.
        if let Node::Function(inner, value) = self.node(a)
            && matches!(
                (f, inner),
                (Func::Sin, Func::Asin)
                    | (Func::Cos, Func::Acos)
                    | (Func::Ln, Func::Exp)
                    | (Func::Exp, Func::Ln)
            )
        {
            return *value;
        }
        if self.leads_negative(a) {
            let mirrored = self.neg(a);
            match f {
                Func::Cos | Func::Cosh | Func::Abs => return self.func(f, mirrored),
                Func::Sin | Func::Asin | Func::Atan | Func::Sinh | Func::Tanh => {
                    let value = self.func(f, mirrored);
                    return self.neg(value);
                }
                _ => {}
            }
        }
        self.intern(Node::Function(f, a))
    }

    /// The angle of the point `(x, y)` in `(-pi, pi]`.
    ///
    /// Numbers on an axis fold. The angle of the origin has no value: it stays, and its derivatives do not exist.
    pub fn atan2(&mut self, y: ExprId, x: ExprId) -> ExprId {
        let sign = |g: &Graph, e: ExprId| g.as_rational(e).map(|c| c.signum().to_integer().to_i64());
        let quarters = match (sign(self, y), sign(self, x)) {
            (Some(Some(0)), Some(Some(1))) => return self.zero,
            (Some(Some(0)), Some(Some(-1))) => 2,
            (Some(Some(s)), Some(Some(0))) if s != 0 => s,
            _ => return self.intern(Node::Atan2(y, x)),
        };
        let pi = self.pi();
        self.scale(pi, &Rational::new(BigInt::from(quarters), BigInt::from(2)))
    }

    fn quarter_turn(&mut self, f: Func, a: ExprId) -> Option<ExprId> {
        let turns = match self.node(a) {
            Node::Pi => Rational::from(BigInt::from(2)),
            Node::Product { coefficient, factors } => match &**factors {
                [(base, q)] if q.is_one() && *self.node(*base) == Node::Pi => {
                    coefficient * Rational::from(BigInt::from(2))
                }
                _ => return None,
            },
            _ => return None,
        };
        if !turns.is_integer() {
            return None;
        }
        let n = num_integer::Integer::mod_floor(turns.numer(), &BigInt::from(4)).to_i64()?;
        let sines = [0, 1, 0, -1];
        let quarter = if f == Func::Sin { n } else { (n + 1) % 4 };
        let value = sines[quarter as usize];
        Some(self.int(value))
    }

    fn leads_negative(&self, a: ExprId) -> bool {
        match self.node(a) {
            Node::Constant(c) | Node::Product { coefficient: c, .. } => c.is_negative(),
            Node::Sum { terms, .. } => terms.first().is_some_and(|(_, c)| c.is_negative()),
            _ => false,
        }
    }

    // ---- questions ------------------------------------------------------------------------------------------------

    /// Whether the expression is known to vanish identically; `false` where it does not, and where nothing is known.
    ///
    /// `true` is structural, or from values at random points, with a chance of error below `1e-36` (of numbers:
    /// `5e-19`), or, where there are none, the outcome of exact expansion. Who would conclude something from `false`
    /// asks for [`Graph::vanishing`].
    pub fn is_zero(&mut self, e: ExprId) -> bool {
        self.verdict(e) == Vanishing::Zero
    }

    /// Whether the expression vanishes identically, does not, or whether that could not be found out.
    ///
    /// [`Vanishing::NonZero`] is proved: by a value in the prime field that no opaque value stands behind, or by an
    /// enclosure of a value at a real point.
    pub fn vanishing(&mut self, e: ExprId) -> Vanishing {
        match self.verdict(e) {
            Vanishing::Unknown if self.differs_at_a_real_point(e) => {
                self.verdicts.insert(e, Vanishing::NonZero);
                Vanishing::NonZero
            }
            verdict => verdict,
        }
    }

    /// As [`Graph::vanishing`], from the prime field and exact expansion alone.
    fn verdict(&mut self, e: ExprId) -> Vanishing {
        if e == self.zero {
            return Vanishing::Zero;
        }
        let first = self.first_verdict(e);
        if first != Vanishing::Unknown {
            return first;
        }
        if let Some(known) = self.verdicts.get(&e) {
            return *known;
        }
        let mut verdict = self.further_verdict(e);
        let differs = self.fingerprints[e.index()].iter().flatten().any(|v| *v != 0);
        if verdict == Vanishing::Unknown && !differs && self.expand(e) == self.zero {
            verdict = Vanishing::Zero;
        }
        self.verdicts.insert(e, verdict);
        verdict
    }

    /// What is to be thought of the values at the random points.
    pub(super) fn doubts(&self, e: ExprId) -> Doubts {
        self.doubts[e.index()]
    }

    pub(super) fn knowledge(&self) -> &Knowledge {
        &self.knowledge
    }

    pub(super) fn knowledge_mut(&mut self) -> &mut Knowledge {
        &mut self.knowledge
    }

    /// Values at the random points: expressions that are equal as functions have equal ones.
    pub(crate) fn fingerprint(&self, e: ExprId) -> &Fingerprint {
        &self.fingerprints[e.index()]
    }

    /// The expression itself, or zero when it vanishes identically.
    pub fn cancel_zero(&mut self, e: ExprId) -> ExprId {
        if self.is_zero(e) { self.zero } else { e }
    }

    /// Whether two expressions are equal as functions.
    pub fn is_equal(&mut self, a: ExprId, b: ExprId) -> bool {
        a == b || {
            let difference = self.sub(a, b);
            self.is_zero(difference)
        }
    }

    /// As [`Graph::is_equal`], from values alone without multiplying out: false where these say nothing. Two valid points are
    /// enough here, with a chance of error below `1e-18`; where signs are unknown, the difference is looked into for all of them.
    pub(crate) fn is_seen_to_be_equal(&mut self, a: ExprId, b: ExprId) -> bool {
        if a == b {
            return true;
        }
        match agreement(self.fingerprint(a), self.fingerprint(b)) {
            Some(true) => true,
            // An unknown sign has a value that says nothing about its square.
            Some(false) if self.doubts(a).signed || self.doubts(b).signed => {
                let difference = self.sub(a, b);
                self.further_verdict(difference) == Vanishing::Zero
            }
            Some(false) => false,
            None => match (self.further_values(a), self.further_values(b)) {
                // Behind roots few points are valid.
                (Some(x), Some(y)) => agreement(&x, &y) == Some(true),
                _ => false,
            },
        }
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
        let mut seen: HashSet<ExprId> = HashSet::new();
        let mut pending: Vec<ExprId> = roots.to_vec();
        while let Some(e) = pending.pop() {
            if seen.insert(e) {
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
        let mut here: HashMap<ExprId, ExprId> = HashMap::new();
        let order = other.reachable(roots);
        self.charge(order.len());
        for e in order {
            let moved = |list: &[(ExprId, Rational)]| -> Vec<(ExprId, Rational)> {
                list.iter().map(|(e, q)| (here[e], q.clone())).collect()
            };
            let copy = match other.node(e) {
                Node::Constant(q) => self.rational(q.clone()),
                Node::Pi => self.pi(),
                Node::Symbol(s) => self.sym(*s),
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
        self.free_symbols(e).iter().any(|s| symbols.contains(s))
    }

    /// Plain floating-point value, for defaults and messages; `None` for a symbol without a value.
    pub fn eval_f64(&self, e: ExprId, values: &BTreeMap<SymbolId, f64>) -> Option<f64> {
        self.eval_known(&[e], values).get(&e).copied()
    }

    /// Plain floating-point values of everything that the roots are made of, as far as symbols have values.
    pub(crate) fn eval_known(
        &self,
        roots: &[ExprId],
        values: &BTreeMap<SymbolId, f64>,
    ) -> BTreeMap<ExprId, f64> {
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

    // ---- calculus ---------------------------------------------------------------------------------------------------

    /// The partial derivative of `e` by `x`.
    pub fn diff(&mut self, e: ExprId, x: SymbolId) -> ExprId {
        self.diff_all(&[e], x)[0]
    }

    /// Partial derivatives of several expressions by one symbol, sharing the work.
    pub fn diff_all(&mut self, roots: &[ExprId], x: SymbolId) -> Vec<ExprId> {
        let mut derivative: HashMap<ExprId, ExprId> = HashMap::new();
        let order = self.reachable(roots);
        self.charge(order.len());
        for e in order {
            let d = self.diff_node(e, x, &derivative);
            derivative.insert(e, d);
        }
        roots.iter().map(|e| derivative[e]).collect()
    }

    fn diff_node(&mut self, e: ExprId, x: SymbolId, derivative: &HashMap<ExprId, ExprId>) -> ExprId {
        match self.node(e).clone() {
            Node::Constant(_) | Node::Pi => self.zero,
            Node::Symbol(s) => {
                if s == x {
                    self.one
                } else {
                    self.zero
                }
            }
            Node::Sum { terms, .. } => {
                let terms: Vec<_> = terms
                    .iter()
                    .filter(|(t, _)| derivative[t] != self.zero)
                    .map(|(t, q)| (derivative[t], q.clone()))
                    .collect();
                self.linear_combination(&terms)
            }
            Node::Product { coefficient, factors } => {
                // d(c prod b_k^q_k) = sum_k c q_k b_k^(q_k - 1) b_k' prod_{j != k} b_j^q_j
                let mut summands = Vec::new();
                for (k, (base, q)) in factors.iter().enumerate() {
                    let inner = derivative[base];
                    if inner == self.zero {
                        continue;
                    }
                    let mut rest: Vec<_> = factors.to_vec();
                    rest[k].1 -= Rational::one();
                    rest.push((inner, Rational::one()));
                    let term = self.power_product(&rest).expect("bases of a canonical product are not zero");
                    summands.push((term, &coefficient * q));
                }
                self.linear_combination(&summands)
            }
            Node::Function(f, a) => {
                let inner = derivative[&a];
                if inner == self.zero {
                    return self.zero;
                }
                let outer = self.func_derivative(f, a, e);
                self.mul(outer, inner)
            }
            Node::Atan2(y, x) => {
                let (dy, dx) = (derivative[&y], derivative[&x]);
                if dy == self.zero && dx == self.zero {
                    return self.zero;
                }
                let [by_y, by_x] = self.atan2_derivatives(y, x);
                let (along_y, along_x) = (self.mul(by_y, dy), self.mul(by_x, dx));
                self.add(along_y, along_x)
            }
        }
    }

    /// `f'(a)`, given `value = f(a)`.
    pub(crate) fn func_derivative(&mut self, f: Func, a: ExprId, value: ExprId) -> ExprId {
        let one = self.one;
        let root_of_one_minus_square = |g: &mut Graph, exponent: Rational| {
            let square = g.powi(a, 2);
            let base = g.sub(one, square);
            g.power_product(&[(base, exponent)]).expect("1 - a^2 is not identically zero")
        };
        let minus_half = Rational::new(BigInt::from(-1), BigInt::from(2));
        match f {
            Func::Sin => self.func(Func::Cos, a),
            Func::Cos => {
                let s = self.func(Func::Sin, a);
                self.neg(s)
            }
            Func::Tan => {
                let square = self.powi(value, 2);
                self.add(one, square)
            }
            Func::Asin => root_of_one_minus_square(self, minus_half),
            Func::Acos => {
                let d = root_of_one_minus_square(self, minus_half);
                self.neg(d)
            }
            Func::Atan => {
                let square = self.powi(a, 2);
                let base = self.add(one, square);
                self.powi(base, -1)
            }
            Func::Exp => value,
            Func::Ln => self.power_product(&[(a, -Rational::one())]).expect("the argument of ln is not zero"),
            Func::Sinh => self.func(Func::Cosh, a),
            Func::Cosh => self.func(Func::Sinh, a),
            Func::Tanh => {
                let square = self.powi(value, 2);
                self.sub(one, square)
            }
            Func::Abs => {
                // |a|' = |a| / a, wrong only at a = 0 where there is no derivative.
                self.power_product(&[(value, Rational::one()), (a, -Rational::one())])
                    .expect("the argument of abs is not zero")
            }
        }
    }

    /// The partial derivatives of `atan2(y, x)`, `x/(x^2 + y^2)` by `y` and `-y/(x^2 + y^2)` by `x`.
    pub(crate) fn atan2_derivatives(&mut self, y: ExprId, x: ExprId) -> [ExprId; 2] {
        let (squared_y, squared_x) = (self.powi(y, 2), self.powi(x, 2));
        let square = self.add(squared_x, squared_y);
        let minus = self.neg(y);
        let inverse = -Rational::one();
        [x, minus].map(|numerator| {
            self.power_product(&[(numerator, Rational::one()), (square, inverse.clone())])
                .expect("a sum of squares of which not both are zero")
        })
    }

    /// Replaces symbols by expressions, all at once.
    ///
    /// # Errors
    /// [`DivisionByZero`] when a substituted denominator vanishes identically.
    pub fn subs(
        &mut self,
        e: ExprId,
        replacements: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<ExprId, DivisionByZero> {
        Ok(self.subs_all(&[e], replacements)?[0])
    }

    /// [`Graph::subs`] on several expressions, sharing the work.
    ///
    /// # Errors
    /// [`DivisionByZero`] when a substituted denominator vanishes identically.
    pub fn subs_all(
        &mut self,
        roots: &[ExprId],
        replacements: &BTreeMap<SymbolId, ExprId>,
    ) -> Result<Vec<ExprId>, DivisionByZero> {
        self.rebuild_all(roots, replacements, Graph::func)
    }

    /// The expression with every function of it, innermost first, made by `function` from its new argument.
    ///
    /// # Errors
    /// [`DivisionByZero`] when a new denominator vanishes identically.
    pub(crate) fn rebuild(
        &mut self,
        e: ExprId,
        function: impl FnMut(&mut Graph, Func, ExprId) -> ExprId,
    ) -> Result<ExprId, DivisionByZero> {
        Ok(self.rebuild_all(&[e], &BTreeMap::new(), function)?[0])
    }

    fn rebuild_all(
        &mut self,
        roots: &[ExprId],
        replacements: &BTreeMap<SymbolId, ExprId>,
        mut function: impl FnMut(&mut Graph, Func, ExprId) -> ExprId,
    ) -> Result<Vec<ExprId>, DivisionByZero> {
        let mut image: HashMap<ExprId, ExprId> = HashMap::new();
        let order = self.reachable(roots);
        self.charge(order.len());
        for e in order {
            let replaced = match self.node(e).clone() {
                Node::Constant(_) | Node::Pi => e,
                Node::Symbol(s) => replacements.get(&s).copied().unwrap_or(e),
                Node::Sum { constant, terms } => {
                    if terms.iter().all(|(t, _)| image[t] == *t) {
                        e
                    } else {
                        let mut list: Vec<_> = terms.iter().map(|(t, q)| (image[t], q.clone())).collect();
                        list.push((self.one, constant));
                        self.linear_combination(&list)
                    }
                }
                Node::Product { coefficient, factors } => {
                    if factors.iter().all(|(b, _)| image[b] == *b) {
                        e
                    } else {
                        let list: Vec<_> = factors.iter().map(|(b, q)| (image[b], q.clone())).collect();
                        if list.iter().any(|(b, q)| q.is_negative() && self.is_zero(*b)) {
                            return Err(DivisionByZero);
                        }
                        let product = self.power_product(&list)?;
                        self.scale(product, &coefficient)
                    }
                }
                Node::Function(f, a) => function(self, f, image[&a]),
                Node::Atan2(y, x) => self.atan2(image[&y], image[&x]),
            };
            image.insert(e, replaced);
        }
        Ok(roots.iter().map(|e| image[e]).collect())
    }

    /// Coefficients of `e` as an affine function of `unknowns`: `e = sum_k a_k unknown_k + b`.
    ///
    /// Returns `None` when `e` is not affine in them.
    pub fn affine_parts(&mut self, e: ExprId, unknowns: &[SymbolId]) -> Option<(Vec<ExprId>, ExprId)> {
        let all: BTreeSet<SymbolId> = unknowns.iter().copied().collect();
        let mut slopes = Vec::with_capacity(unknowns.len());
        for x in unknowns {
            let slope = self.diff(e, *x);
            // A slope may mention the unknowns structurally and still not depend on them.
            let mut constant = true;
            for y in &all {
                let second = self.diff(slope, *y);
                constant &= self.is_zero(second);
            }
            if !constant {
                return None;
            }
            slopes.push(slope);
        }
        let zeros: BTreeMap<SymbolId, ExprId> = unknowns.iter().map(|s| (*s, self.zero)).collect();
        let mut parts = slopes;
        parts.push(e);
        let mut parts = self.subs_all(&parts, &zeros).ok()?;
        let offset = parts.pop()?;
        let parts = parts.into_iter().map(|a| self.cancel_zero(a)).collect();
        let offset = self.cancel_zero(offset);
        Some((parts, offset))
    }
}

/// Whether values are equal wherever both exist; none where that is at one point at most and they are.
pub(super) fn agreement(a: &[Option<u64>], b: &[Option<u64>]) -> Option<bool> {
    let equal: Vec<bool> = a.iter().zip(b).filter_map(|(x, y)| Some((*x)? == (*y)?)).collect();
    match equal.iter().all(|equal| *equal) {
        false => Some(false),
        true => (equal.len() >= 2).then_some(true),
    }
}

/// The largest number that divides all of these with whole quotients, with the sign of the first; none where it is too long.
pub(super) fn content(constant: &Rational, terms: &[(ExprId, Rational)]) -> Option<Rational> {
    let mut numerator = constant.numer().clone();
    let mut denominator = constant.denom().clone();
    for (_, q) in terms {
        numerator = num_integer::Integer::gcd(&numerator, q.numer());
        denominator = num_integer::Integer::lcm(&denominator, q.denom());
        if denominator.bits() > MAX_BITS {
            return None;
        }
    }
    let magnitude = Rational::new(numerator, denominator);
    Some(if terms.first().is_some_and(|(_, q)| q.is_negative()) { -magnitude } else { magnitude })
}

/// `c^q` for a non-integer `q` when it is rational.
fn exact_root(c: &Rational, q: &Rational) -> Option<Rational> {
    let degree = q.denom().to_u32()?;
    if c.is_negative() {
        return None;
    }
    let root = |n: &BigInt| {
        let r = n.nth_root(degree);
        (num_traits::Pow::pow(&r, degree) == *n).then_some(r)
    };
    let root = Rational::new(root(c.numer())?, root(c.denom())?);
    Some(num_traits::Pow::pow(&root, q.numer().to_i32()?))
}
