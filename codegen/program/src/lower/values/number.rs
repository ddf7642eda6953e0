//! Value numbering: expressions to binary operations, each value once for all functions.
//!
//! Sums and products are grouped by how fast their operands change, parameter-only ones first, so that whatever can be
//! hoisted is a value of its own. Signs travel outwards: `a - b`, never `a + -b`. Does not know: which values end up in
//! which part of a program.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

use num_traits::{One, Signed as _, ToPrimitive, Zero};

use crate::lower::classes::{Class, Classes};
use crate::lower::form::Form;
use crate::lower::pivots::Conditions;
use crate::lower::roll::Rolled;
use crate::lower::source::needed_definitions;
use crate::lower::{Inputs, Request};
use crate::program::edit::Signed;
use crate::program::{Constant, Op, Operand, Role};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Node, Rational, Section, SymbolId};

/// All values of a program; an operand of a value is an earlier value, a constant or an input.
pub(super) struct Pool {
    pub(super) ops: Vec<Op>,
    pub(super) constants: Vec<Constant>,
    classes: Vec<Class>,
    op_index: HashMap<Op, Operand>,
    constant_index: HashMap<Constant, Operand>,
}

impl Pool {
    pub(super) fn new() -> Pool {
        Pool {
            ops: Vec::new(),
            constants: Vec::new(),
            classes: Vec::new(),
            op_index: HashMap::new(),
            constant_index: HashMap::new(),
        }
    }

    /// What an operand depends on.
    pub(super) fn class(&self, operand: Operand) -> Class {
        match operand {
            Operand::Value(i) => self.classes[i as usize],
            Operand::Constant(_) => Class::Constant,
            Operand::Param(_) | Operand::Slot(_) => Class::Param,
            Operand::Time | Operand::Input(_) => Class::Time,
            Operand::State(_) | Operand::Argument(_) | Operand::Contracted(_) => Class::State,
        }
    }

    fn push(&mut self, op: Op) -> Operand {
        // x + y = y + x and x * y = y * x, also in floating point.
        let swapped = match op {
            Op::Add(a, b) => Op::Add(b, a),
            Op::Mul(a, b) => Op::Mul(b, a),
            other => other,
        };
        if let Some(known) = self.op_index.get(&op).or_else(|| self.op_index.get(&swapped)) {
            return *known;
        }
        let class = op.operands().map(|o| self.class(o)).max().unwrap_or(Class::Constant);
        let value =
            Operand::Value(u32::try_from(self.ops.len()).expect("fewer than 2^32 values fit in memory"));
        self.ops.push(op);
        self.classes.push(class);
        self.op_index.insert(op, value);
        value
    }

    fn constant(&mut self, constant: Constant) -> Operand {
        if let Some(known) = self.constant_index.get(&constant) {
            return *known;
        }
        let i = u32::try_from(self.constants.len()).expect("fewer than 2^32 constants fit in memory");
        self.constants.push(constant.clone());
        self.constant_index.insert(constant, Operand::Constant(i));
        Operand::Constant(i)
    }

    fn rational(&mut self, q: Rational) -> Operand {
        self.constant(Constant::Rational(q))
    }
}

/// A function in terms of the pool.
pub(super) struct Numbered {
    pub(super) role: Role,
    pub(super) argument: Vec<String>,
    /// Section, name and value of each definition that is needed, in order.
    pub(super) definitions: Vec<(u32, String, Operand)>,
    /// Results of the straight-line code.
    pub(super) results: Vec<(String, Operand)>,
    /// Loops after it.
    pub(super) rolled: Option<Rolled>,
}

/// Numbers the values of one function.
///
/// # Errors
/// [`Error::Program`] for a symbol that is used before its definition.
pub(super) fn number_function(
    graph: &Graph,
    inputs: &Inputs,
    form: &Form,
    pool: &mut Pool,
) -> Result<Numbered, Error> {
    let Form { sections, request, rolled, .. } = form;
    let classes = Classes::of(graph, inputs, sections, std::slice::from_ref(request))?;
    let roots: Vec<ExprId> = request.results.iter().map(|(_, e)| *e).collect();
    let argument = inputs.argument(&request.role);
    let (definitions, operands) = number(graph, inputs, sections, &classes, argument, &roots, pool);
    let names = request.results.iter().map(|(name, _)| name.clone());
    Ok(Numbered {
        role: request.role.clone(),
        argument: argument.iter().map(|s| graph.name(*s).to_owned()).collect(),
        definitions,
        results: names.zip(operands).collect(),
        rolled: rolled.clone(),
    })
}

/// Numbers both sides of the conditions, in order: greater, less, greater, less.
///
/// # Errors
/// [`Error::Program`] for a symbol that is used before its definition.
pub(super) fn number_conditions(
    graph: &Graph,
    inputs: &Inputs,
    conditions: &Conditions,
    requests: &[Request],
    pool: &mut Pool,
) -> Result<Vec<Operand>, Error> {
    let Conditions { sections, conditions } = conditions;
    let roots: Vec<ExprId> = conditions.iter().flat_map(|c| [c.greater, c.less]).collect();
    let mut classes = Classes::of(graph, inputs, sections, requests)?;
    for root in &roots {
        classes.add(graph, *root)?;
    }
    Ok(number(graph, inputs, sections, &classes, &[], &roots, pool).1)
}

fn number(
    graph: &Graph,
    inputs: &Inputs,
    sections: &[Section],
    classes: &Classes,
    argument: &[SymbolId],
    roots: &[ExprId],
    pool: &mut Pool,
) -> (Vec<(u32, String, Operand)>, Vec<Operand>) {
    let needed = needed_definitions(graph, sections, roots);
    let mut definitions = Vec::new();
    for (section, definition) in
        sections.iter().zip(0u32..).flat_map(|(s, k)| s.definitions.iter().map(move |d| (k, d)))
    {
        if needed.contains(&definition.symbol) {
            definitions.push((section, *definition));
        }
    }
    let mut symbols: HashMap<SymbolId, Operand> = HashMap::new();
    symbols.extend(inputs.params.iter().zip(0u32..).map(|(s, i)| (*s, Operand::Param(i))));
    symbols.insert(inputs.time, Operand::Time);
    symbols.extend(inputs.held.iter().zip(0u32..).map(|((s, _), i)| (*s, Operand::Input(i))));
    symbols.extend(inputs.state.iter().zip(0u32..).map(|(s, i)| (*s, Operand::State(i))));
    symbols.extend(argument.iter().zip(0u32..).map(|(s, i)| (*s, Operand::Argument(i))));

    let everything: Vec<ExprId> =
        definitions.iter().map(|(_, d)| d.expr).chain(roots.iter().copied()).collect();
    let order = demanded(graph, &everything, &HashMap::new());
    let plans = plan_divisions(graph, classes, &order);
    let mut numbering = Numbering { graph, classes, pool, symbols, values: HashMap::new(), plans };
    let mut named = Vec::new();
    for (section, definition) in definitions {
        let value = numbering.value_of(definition.expr);
        numbering.symbols.insert(definition.symbol, value);
        let name = graph.name(definition.symbol);
        if !name.is_empty() {
            named.push((section, name.to_owned(), value));
        }
    }
    let operands = roots.iter().map(|root| numbering.value_of(*root)).collect();
    (named, operands)
}

/// Calls `visit` on what has to be a value before `node` can be one: a product inside a sum has to be none.
fn for_each_demanded(graph: &Graph, node: &Node, mut visit: impl FnMut(ExprId)) {
    match node {
        Node::Sum { terms, .. } => {
            for (term, _) in terms {
                match graph.node(*term) {
                    product @ Node::Product { .. } => product.for_each_operand(&mut visit),
                    _ => visit(*term),
                }
            }
        }
        node => node.for_each_operand(visit),
    }
}

/// Nodes that have to become values and are none yet, operands first.
fn demanded(graph: &Graph, roots: &[ExprId], done: &HashMap<ExprId, Signed>) -> Vec<ExprId> {
    let mut seen = HashSet::new();
    let mut pending = roots.to_vec();
    while let Some(e) = pending.pop() {
        if !done.contains_key(&e) && seen.insert(e) {
            for_each_demanded(graph, graph.node(e), |operand| pending.push(operand));
        }
    }
    let mut ordered: Vec<ExprId> = seen.into_iter().collect();
    ordered.sort_unstable();
    ordered
}

/// The denominator of a product: bases that change during integration, with positive exponents.
type Denominator = Vec<(ExprId, Rational)>;

/// How to divide by a denominator.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Plan {
    /// By one division.
    Divide,
    /// By multiplying with powers of shared reciprocals.
    Reciprocals(Vec<(Denominator, u32)>),
}

/// `x/d, y/d -> r = 1/d, x*r, y*r`, and `x/(d*e) -> x*r*s` where `r = 1/d` and `s = 1/e` are there anyway.
fn plan_divisions(graph: &Graph, classes: &Classes, order: &[ExprId]) -> BTreeMap<Denominator, Plan> {
    let mut uses: BTreeMap<Denominator, BTreeSet<(ExprId, Rational)>> = BTreeMap::new();
    let mut record = |e: ExprId, q: &Rational| {
        if let Node::Product { coefficient, factors } = graph.node(e) {
            let denominator = denominator_of(classes, factors);
            if !denominator.is_empty() {
                uses.entry(denominator).or_default().insert((e, (coefficient * q).abs()));
            }
        }
    };
    for e in order {
        record(*e, &Rational::one());
        if let Node::Sum { terms, .. } = graph.node(*e) {
            terms.iter().for_each(|(term, q)| record(*term, q));
        }
    }
    let half = Rational::new(1.into(), 2.into());
    let parts_of = |denominator: &Denominator| -> Vec<(Denominator, u32)> {
        let mut parts = Vec::new();
        for (base, q) in denominator {
            let part = [half.clone(), Rational::one()].into_iter().find_map(|unit| {
                let n = q / &unit;
                let single = vec![(*base, unit)];
                (n.is_integer() && uses.contains_key(&single)).then_some((single, n.numer().to_u32()?))
            });
            match part {
                Some(part) => parts.push(part),
                None => return vec![(denominator.clone(), 1)],
            }
        }
        parts
    };
    let parts: BTreeMap<&Denominator, Vec<(Denominator, u32)>> =
        uses.keys().map(|d| (d, parts_of(d))).collect();
    let mut n_uses: BTreeMap<&Denominator, usize> = BTreeMap::new();
    for (denominator, list) in &parts {
        for (part, _) in list {
            *n_uses.entry(part).or_default() += uses[*denominator].len();
        }
    }
    let plan = |denominator: &Denominator| match parts[denominator].as_slice() {
        [(part, 1)] if part == denominator && n_uses[part] == 1 => Plan::Divide,
        list => Plan::Reciprocals(list.to_vec()),
    };
    uses.keys().map(|denominator| (denominator.clone(), plan(denominator))).collect()
}

fn denominator_of(classes: &Classes, factors: &[(ExprId, Rational)]) -> Denominator {
    let changing = factors.iter().filter(|(base, q)| q.is_negative() && classes.get(*base) > Class::Param);
    changing.map(|(base, q)| (*base, -q)).collect()
}

struct Numbering<'a> {
    graph: &'a Graph,
    classes: &'a Classes,
    pool: &'a mut Pool,
    symbols: HashMap<SymbolId, Operand>,
    values: HashMap<ExprId, Signed>,
    plans: BTreeMap<Denominator, Plan>,
}

impl Numbering<'_> {
    /// The value of an expression, its sign applied.
    fn value_of(&mut self, root: ExprId) -> Operand {
        for e in demanded(self.graph, &[root], &self.values) {
            let value = match self.graph.node(e) {
                Node::Constant(c) => {
                    Signed { negative: c.is_negative(), operand: self.pool.rational(c.abs()) }
                }
                Node::Pi => Signed { negative: false, operand: self.pool.constant(Constant::Pi) },
                Node::Symbol(s) => Signed { negative: false, operand: self.symbols[s] },
                Node::Sum { constant, terms } => self.sum(e, constant, terms),
                Node::Product { coefficient, factors } => self.product(coefficient, factors),
                Node::Function(f, a) => {
                    let a = self.positive(self.values[a]);
                    Signed { negative: false, operand: self.pool.push(Op::Function(*f, a)) }
                }
                Node::Atan2(y, x) => {
                    let (y, x) = (self.positive(self.values[y]), self.positive(self.values[x]));
                    Signed { negative: false, operand: self.pool.push(Op::Atan2(y, x)) }
                }
            };
            self.values.insert(e, value);
        }
        self.positive(self.values[&root])
    }

    fn positive(&mut self, value: Signed) -> Operand {
        match value.operand {
            operand if !value.negative => operand,
            Operand::Constant(i) => match self.pool.constants[i as usize].clone() {
                Constant::Rational(q) => self.pool.rational(-q),
                Constant::Pi => self.pool.push(Op::Neg(value.operand)),
            },
            operand => self.pool.push(Op::Neg(operand)),
        }
    }

    // ---- sums -------------------------------------------------------------------------------------------------------

    fn sum(&mut self, e: ExprId, constant: &Rational, terms: &[(ExprId, Rational)]) -> Signed {
        // c*x - c*y = c*(x - y), unless parameter-only factors absorb c for nothing.
        let content = terms[0].1.abs();
        let equal = terms.iter().all(|(_, q)| q.abs() == content)
            && (constant.is_zero() || constant.abs() == content);
        let pays = self.classes.get(e) <= Class::Param || terms.iter().any(|(term, _)| !self.absorbs(*term));
        let divisor = if equal && pays { content } else { Rational::one() };

        let mut groups: [Vec<Signed>; 3] = Default::default();
        if !constant.is_zero() {
            let operand = self.pool.rational((constant / &divisor).abs());
            groups[0].push(Signed { negative: constant.is_negative(), operand });
        }
        for (term, q) in terms {
            let q = q / &divisor;
            let value = match self.graph.node(*term) {
                Node::Product { coefficient, factors } => self.product(&(coefficient * q), factors),
                _ => self.product(&q, &[(*term, Rational::one())]),
            };
            groups[self.group(value.operand)].push(value);
        }
        let mut total: Option<Signed> = None;
        for group in groups {
            // Starting from a positive summand saves a sign.
            let start = group.iter().position(|s| !s.negative).unwrap_or(0);
            let mut order: Vec<Signed> = group;
            if start < order.len() {
                order[..=start].rotate_right(1);
            }
            let subtotal = order.into_iter().reduce(|a, b| self.add(a, b));
            total = match (total, subtotal) {
                (Some(a), Some(b)) => Some(self.add(a, b)),
                (a, b) => a.or(b),
            };
        }
        let total = total.expect("a sum has terms");
        if divisor.is_one() {
            return total;
        }
        let factor = self.pool.rational(divisor);
        Signed { negative: total.negative, operand: self.pool.push(Op::Mul(factor, total.operand)) }
    }

    /// Whether a term has a parameter-only factor that takes up a rational one.
    fn absorbs(&self, term: ExprId) -> bool {
        match self.graph.node(term) {
            Node::Product { factors, .. } => {
                factors.iter().any(|(base, _)| self.classes.get(*base) <= Class::Param)
            }
            _ => self.classes.get(term) <= Class::Param,
        }
    }

    fn group(&self, operand: Operand) -> usize {
        match self.pool.class(operand) {
            Class::Constant | Class::Param => 0,
            Class::Time => 1,
            Class::State => 2,
        }
    }

    fn add(&mut self, a: Signed, b: Signed) -> Signed {
        let (negative, op) = a.plus(b);
        Signed { negative, operand: self.pool.push(op) }
    }

    // ---- products ---------------------------------------------------------------------------------------------------

    /// `coefficient * prod base^exponent = ((P * T) * S) / D`: parameters, time, state, over what changes below.
    fn product(&mut self, coefficient: &Rational, factors: &[(ExprId, Rational)]) -> Signed {
        let mut negative = coefficient.is_negative();
        let mut groups: [Vec<Operand>; 3] = Default::default();
        let mut divisor: Vec<Operand> = Vec::new();
        if !coefficient.abs().is_one() {
            groups[0].push(self.pool.rational(coefficient.abs()));
        }
        for (base, q) in factors {
            if q.is_negative() && self.classes.get(*base) > Class::Param {
                continue;
            }
            let value = self.values[base];
            let base = if q.is_integer() {
                negative ^= value.negative && num_integer::Integer::is_odd(q.numer());
                value.operand
            } else {
                self.positive(value)
            };
            let power = self.power(base, &q.abs());
            if q.is_negative() {
                divisor.push(power);
            } else {
                groups[self.group(power)].push(power);
            }
        }
        let [params, time, state] = groups.map(|group| self.chain(group));
        let params = match (params, self.chain(divisor)) {
            (numerator, None) => numerator,
            (None, Some(divisor)) => Some(self.pool.push(Op::Recip(divisor))),
            (Some(numerator), Some(divisor)) => Some(self.pool.push(Op::Div(numerator, divisor))),
        };
        let numerator = self.chain([params, time, state].into_iter().flatten().collect());
        let denominator = denominator_of(self.classes, factors);
        let operand = if denominator.is_empty() {
            numerator.unwrap_or_else(|| self.pool.rational(Rational::one()))
        } else {
            self.divide(numerator, &denominator)
        };
        Signed { negative, operand }
    }

    fn chain(&mut self, operands: Vec<Operand>) -> Option<Operand> {
        operands.into_iter().reduce(|a, b| self.pool.push(Op::Mul(a, b)))
    }

    fn divide(&mut self, numerator: Option<Operand>, denominator: &Denominator) -> Operand {
        match self.plans.get(denominator).cloned() {
            None | Some(Plan::Divide) => {
                let divisor = self.denominator_value(denominator);
                self.pool.push(match numerator {
                    Some(numerator) => Op::Div(numerator, divisor),
                    None => Op::Recip(divisor),
                })
            }
            Some(Plan::Reciprocals(parts)) => {
                let mut powers = Vec::with_capacity(parts.len());
                for (part, n) in parts {
                    let divisor = self.denominator_value(&part);
                    let reciprocal = self.pool.push(Op::Recip(divisor));
                    powers.push(self.integer_power(reciprocal, n));
                }
                let reciprocal = self.chain(powers).expect("a denominator has factors");
                match numerator {
                    Some(numerator) => self.pool.push(Op::Mul(numerator, reciprocal)),
                    None => reciprocal,
                }
            }
        }
    }

    fn denominator_value(&mut self, denominator: &Denominator) -> Operand {
        let mut powers = Vec::with_capacity(denominator.len());
        for (base, q) in denominator {
            let base = self.positive(self.values[base]);
            powers.push(self.power(base, q));
        }
        powers.sort_by_key(|power| self.group(*power));
        self.chain(powers).expect("a denominator has factors")
    }

    /// `x^q` for a positive `q`: `x^w * sqrt(x)` for halves, `exp(q ln x)` where roots of roots do not do.
    fn power(&mut self, base: Operand, q: &Rational) -> Operand {
        const MAX_ROOTS: u64 = 3;
        let whole = q.floor().numer().to_u32();
        let roots = q.denom().trailing_zeros().unwrap_or(0);
        let (Some(whole), true) = (whole, roots <= MAX_ROOTS && q.denom().magnitude().count_ones() == 1)
        else {
            let exponent = self.pool.rational(q.clone());
            return self.pool.push(Op::Power(base, exponent));
        };
        let mut factors = Vec::new();
        if whole > 0 {
            factors.push(self.integer_power(base, whole));
        }
        let mut rest = q - q.floor();
        let mut root = base;
        while !rest.is_zero() {
            // The next binary digit of the exponent says whether this root is a factor.
            root = self.pool.push(Op::Sqrt(root));
            rest = &rest + &rest;
            if rest >= Rational::one() {
                rest -= Rational::one();
                factors.push(root);
            }
        }
        self.chain(factors).expect("the exponent is positive")
    }

    /// `x^n` with `n >= 1`: `x^(2k) = (x^k)^2`, `x^(2k+1) = x^(2k) * x`.
    fn integer_power(&mut self, base: Operand, n: u32) -> Operand {
        let mut power = base;
        for bit in (0..n.ilog2()).rev() {
            power = self.pool.push(Op::Mul(power, power));
            if n >> bit & 1 == 1 {
                power = self.pool.push(Op::Mul(power, base));
            }
        }
        power
    }
}
