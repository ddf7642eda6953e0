//! Functions that are mostly sums of products, as loops over constant tables.
//!
//! A definition, a result or a sum inside a product is *rolled* when all of its terms are a number times at most two
//! factors and one *scalar*, where a factor is a component of the state or of the function's own vector, or another
//! rolled sum, and the scalar is whatever else stands in the term, computed straight; with two factors beside it, its
//! product with one of them becomes a rolled sum of its own. Sums that others need in order to be computed straight
//! are computed straight themselves. What is left is numbered by how deep rolled sums stand in each other: each level
//! becomes one [`Contraction`].
//!
//! Straight-line code of many products is compiled slowly and read from memory once a call: from a number of products
//! on that [`SearchBudget::products`] says, loops are the better form where tables have products for most sums that
//! they run through. Nothing is searched for then: sums are what they were derived as.
//!
//! Does not know: mechanics, where a sum comes from; how scalars are computed.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use num_traits::{One, Signed, ToPrimitive, Zero};

use super::classes::Class;
use super::source::{Source, needed_definitions};
use super::{Request, SearchBudget};
use crate::program::{Contraction, Factors, Place, Products, Table};
use hamel_expr::{ExprId, Graph, Node, Number, Rational, Scalar, SymbolId};

/// Visits of sums by tables up to which loops are the better form, for each product in the tables: a visit takes four
/// additions. Derivatives of fluids have one, derivatives of an arm of seven joints eight.
const VISITS_EACH: usize = 2;
/// Products in the tables for each scalar that is computed straight, from which on loops are the better form: fluids
/// have thousands, the Jacobian of five spherical pendulums 16, which as straight-line code takes a fifth of the
/// operations.
const PRODUCTS_EACH: usize = 64;
/// Scalars that are few, however few products there are.
const SCALARS: usize = 100;
/// Visits that are few, however few products there are.
const VISITS: usize = 1000;

/// Where a result of a rolled function comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Origin {
    /// The result of straight-line code at this position.
    Straight(usize),
    /// The sum of this number, counted through all contractions.
    Sum(u32),
}

/// A function as contractions of what a smaller function computes.
#[derive(Clone, Debug)]
pub(super) struct Rolled {
    /// The results of the whole function.
    pub(super) asked: Request,
    /// Where each comes from.
    pub(super) origins: Vec<Origin>,
    /// How many of the results of the straight-line code are results of the function; scalars come after them.
    pub(super) n_straight: usize,
    /// In order; tables are those of this function.
    pub(super) contractions: Vec<Contraction>,
    pub(super) tables: Vec<Table>,
}

/// A factor of a product.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Factor {
    State(usize),
    Argument(usize),
    Unit(usize),
}

impl Factor {
    /// The rolled sum that it is.
    fn unit(self) -> Option<usize> {
        match self {
            Factor::Unit(u) => Some(u),
            Factor::State(_) | Factor::Argument(_) => None,
        }
    }
}

/// A number times at most two factors and a scalar.
#[derive(Clone, Debug)]
struct Term {
    number: Number,
    factors: Vec<Factor>,
    scalar: Option<ExprId>,
}

/// A sum that may be rolled.
#[derive(Debug)]
struct Unit {
    /// Its value, and the expression that stands for it in others.
    value: ExprId,
    name: ExprId,
    /// None where it is computed straight.
    terms: Option<Vec<Term>>,
}

/// The function in that form, and the request for what has to be computed straight; none where fewer products than the
/// budget says would be rolled, tables would be nearly empty, or most of the work is in what they are fed with.
pub(super) fn rolled(
    graph: &mut Graph,
    source: &Source<'_>,
    budget: &SearchBudget,
    request: &Request,
) -> Option<(Rolled, Request)> {
    let mut roller = Roller::new(graph, source, request);
    let roots: Vec<ExprId> = request.results.iter().map(|(_, e)| *e).collect();
    let needed = needed_definitions(roller.graph, source.sections, &roots);
    let definitions = source.sections.iter().flat_map(|s| &s.definitions);
    for definition in definitions.filter(|d| needed.contains(&d.symbol)) {
        if source.classes.get(definition.expr) > Class::Param {
            let name = roller.graph.sym(definition.symbol);
            let unit = roller.unit(name, definition.expr);
            roller.symbols.insert(definition.symbol, unit);
        }
    }
    let mut places = Vec::with_capacity(roots.len());
    for root in &roots {
        let is_input = matches!(roller.graph.node(*root), Node::Symbol(s) if !roller.symbols.contains_key(s));
        let changes = source.classes.get(*root) > Class::Param;
        places.push((changes && !is_input).then(|| roller.unit(*root, *root)));
    }
    roller.settle();
    roller.split();
    let live = roller.live(places.iter().flatten().copied());
    let n_products: usize = live.iter().filter_map(|u| roller.units[*u].terms.as_ref()).map(Vec::len).sum();
    if n_products < budget.products {
        return None;
    }
    let found = roller.assemble(request, &places, &live)?;
    let n_scalars = found.1.results.len() - found.0.n_straight;
    if n_scalars > SCALARS.max(n_products / PRODUCTS_EACH) {
        return None;
    }
    // Every table runs through all sums of its level, also through those to which it adds nothing.
    let n_visits: usize = found.0.contractions.iter().map(|c| c.terms.len() * c.n_results).sum();
    (n_visits <= VISITS.max(VISITS_EACH * n_products)).then_some(found)
}

struct Roller<'a> {
    graph: &'a mut Graph,
    source: &'a Source<'a>,
    /// The function's own vector.
    argument: &'a [SymbolId],
    inputs: HashMap<SymbolId, Factor>,
    units: Vec<Unit>,
    /// Units by the names of definitions, and by the expressions that they are the values of.
    symbols: HashMap<SymbolId, usize>,
    by_value: HashMap<ExprId, usize>,
    /// Numbers that constant factors are.
    numbers: HashMap<ExprId, Option<Number>>,
    one: ExprId,
}

impl<'a> Roller<'a> {
    fn new(graph: &'a mut Graph, source: &'a Source<'a>, request: &Request) -> Roller<'a> {
        let mut inputs = HashMap::new();
        let state = source.inputs.state.iter().enumerate().map(|(i, s)| (*s, Factor::State(i)));
        let argument = source.inputs.argument(&request.role);
        let own = argument.iter().enumerate().map(|(i, s)| (*s, Factor::Argument(i)));
        inputs.extend(state.chain(own));
        let one = graph.one();
        let (symbols, by_value) = (HashMap::new(), HashMap::new());
        let (units, numbers) = (Vec::new(), HashMap::new());
        Roller { graph, source, argument, inputs, units, symbols, by_value, numbers, one }
    }

    // ---- reading ----------------------------------------------------------------------------------------------------

    /// The unit of a value, there already or new.
    fn unit(&mut self, name: ExprId, value: ExprId) -> usize {
        let known = match self.graph.node(name) {
            Node::Symbol(s) if name == value => self.symbols.get(s).copied(),
            _ => self.by_value.get(&value).copied(),
        };
        if let Some(known) = known {
            return known;
        }
        let terms = self.terms(value);
        self.units.push(Unit { value, name, terms });
        self.by_value.insert(value, self.units.len() - 1);
        self.units.len() - 1
    }

    /// The terms of a value; none where one has too many factors, or all are scalars.
    fn terms(&mut self, value: ExprId) -> Option<Vec<Term>> {
        let (constant, terms) = match self.graph.node(value) {
            Node::Sum { constant, terms } => (constant.clone(), terms.to_vec()),
            _ => (<Rational as Zero>::zero(), vec![(value, <Rational as One>::one())]),
        };
        let mut list = Vec::with_capacity(terms.len() + 1);
        for (term, q) in terms {
            list.push(self.term(term, &q)?);
        }
        if !Zero::is_zero(&constant) {
            list.push(Term { number: constant.into(), factors: Vec::new(), scalar: None });
        }
        // Nothing to run through.
        list.iter().any(|term| !term.factors.is_empty()).then_some(list)
    }

    fn term(&mut self, term: ExprId, q: &Rational) -> Option<Term> {
        let (coefficient, factors) = match self.graph.node(term) {
            Node::Product { coefficient, factors } => (coefficient * q, factors.to_vec()),
            _ => (q.clone(), vec![(term, <Rational as One>::one())]),
        };
        let mut number = Number::from(coefficient);
        let (mut own, mut others) = (Vec::new(), Vec::new());
        for (base, exponent) in factors {
            if self.source.classes.get(base) == Class::Constant {
                let constant = self.graph.power_product(&[(base, exponent.clone())]).ok()?;
                match self.number(constant) {
                    Some(constant) => number = number.times(&constant),
                    None => others.push((base, exponent)),
                }
                continue;
            }
            let times =
                if exponent.is_integer() && exponent.is_positive() { exponent.to_usize() } else { None };
            match times.filter(|n| *n <= 2).and_then(|n| Some((self.factor(base)?, n))) {
                Some((factor, n)) => own.extend(std::iter::repeat_n(factor, n)),
                None => others.push((base, exponent)),
            }
        }
        let scalar = match others.is_empty() {
            true => None,
            false => Some(self.graph.power_product(&others).ok()?),
        };
        if own.len() > 2 || Scalar::is_zero(&number) {
            return None;
        }
        Some(Term { number, factors: own, scalar })
    }

    /// The number that an expression without parameters is.
    fn number(&mut self, e: ExprId) -> Option<Number> {
        if !self.numbers.contains_key(&e) {
            let number = self.graph.as_number(e);
            self.numbers.insert(e, number);
        }
        self.numbers[&e].clone()
    }

    /// The component or sum that a factor is; none for scalars.
    fn factor(&mut self, base: ExprId) -> Option<Factor> {
        match self.graph.node(base) {
            Node::Symbol(s) => {
                self.inputs.get(s).copied().or_else(|| self.symbols.get(s).map(|u| Factor::Unit(*u)))
            }
            Node::Sum { .. } if self.source.classes.get(base) > Class::Time => {
                let unit = self.unit(base, base);
                self.units[unit].terms.is_some().then_some(Factor::Unit(unit))
            }
            _ => None,
        }
    }

    // ---- what is rolled ---------------------------------------------------------------------------------------------

    /// Takes out of the rolled sums all that is needed to compute others straight. What a unit needs stands before it.
    fn settle(&mut self) {
        for u in (0..self.units.len()).rev() {
            let straight: Vec<ExprId> = match &self.units[u].terms {
                None => vec![self.units[u].value],
                Some(terms) => terms.iter().filter_map(|term| term.scalar).collect(),
            };
            let distinct: BTreeSet<ExprId> = straight.into_iter().collect();
            for symbol in distinct.into_iter().flat_map(|e| self.graph.free_symbols(e)) {
                if let Some(needed) = self.symbols.get(&symbol) {
                    self.units[*needed].terms = None;
                }
            }
        }
        for u in 0..self.units.len() {
            let Some(mut terms) = self.units[u].terms.take() else { continue };
            for term in &mut terms {
                let is_straight = |f: &Factor| f.unit().is_some_and(|u| self.units[u].terms.is_none());
                let (straight, own): (Vec<Factor>, Vec<Factor>) =
                    term.factors.iter().partition(|f| is_straight(f));
                if straight.is_empty() {
                    continue;
                }
                let names = straight.iter().filter_map(|f| f.unit()).map(|u| self.units[u].name);
                let product: Vec<ExprId> = names.chain(term.scalar).collect();
                (term.factors, term.scalar) = (own, Some(self.graph.product(&product)));
            }
            self.units[u].terms = Some(terms);
        }
    }

    /// Takes products of a scalar with one of two factors for rolled sums of their own: the factor that stands beside
    /// the scalar more often, so that there are few.
    fn split(&mut self) {
        let mut n_pairs: BTreeMap<(ExprId, Factor), usize> = BTreeMap::new();
        let all = self.units.iter().filter_map(|u| u.terms.as_ref()).flatten();
        for term in all.filter(|term| term.factors.len() == 2) {
            for (scalar, factor) in term.scalar.iter().flat_map(|s| term.factors.iter().map(|f| (*s, *f))) {
                *n_pairs.entry((scalar, factor)).or_default() += 1;
            }
        }
        let mut products: BTreeMap<(ExprId, Factor), usize> = BTreeMap::new();
        for u in 0..self.units.len() {
            let Some(mut terms) = self.units[u].terms.take() else { continue };
            for term in terms.iter_mut().filter(|term| term.factors.len() == 2) {
                let Some(scalar) = term.scalar.take() else { continue };
                let n = |k: usize| n_pairs[&(scalar, term.factors[k])];
                let k = usize::from(n(1) > n(0));
                let factor = term.factors[k];
                let product = *products.entry((scalar, factor)).or_insert_with(|| {
                    let own = match factor {
                        Factor::State(i) => self.graph.sym(self.source.inputs.state[i]),
                        Factor::Argument(i) => self.graph.sym(self.argument[i]),
                        Factor::Unit(u) => self.units[u].name,
                    };
                    let value = self.graph.mul(scalar, own);
                    let term = Term { number: Number::one(), factors: vec![factor], scalar: Some(scalar) };
                    self.units.push(Unit { value, name: value, terms: Some(vec![term]) });
                    self.units.len() - 1
                });
                term.factors[k] = Factor::Unit(product);
            }
            self.units[u].terms = Some(terms);
        }
    }

    /// The rolled sums that these need, and they themselves, in order.
    fn live(&self, roots: impl Iterator<Item = usize>) -> BTreeSet<usize> {
        let mut live = BTreeSet::new();
        let mut pending: Vec<usize> = roots.collect();
        while let Some(u) = pending.pop() {
            let Some(terms) = &self.units[u].terms else { continue };
            if live.insert(u) {
                pending.extend(terms.iter().flat_map(|t| &t.factors).filter_map(|f| f.unit()));
            }
        }
        live
    }

    // ---- tables -----------------------------------------------------------------------------------------------------

    /// How deep each rolled sum stands: how many others it is made of, one of the other.
    fn levels(&self, live: &BTreeSet<usize>) -> BTreeMap<usize, usize> {
        let mut levels: BTreeMap<usize, usize> = BTreeMap::new();
        let mut pending: Vec<usize> = live.iter().rev().copied().collect();
        while let Some(u) = pending.last().copied() {
            let factors = self.units[u].terms.iter().flatten().flat_map(|t| &t.factors);
            let below: Vec<usize> = factors.filter_map(|f| f.unit()).collect();
            let open = below.iter().copied().filter(|u| !levels.contains_key(u)).max();
            match open {
                // The products with scalars come last in the list.
                Some(open) => pending.push(open),
                None => {
                    pending.pop();
                    levels.insert(u, below.iter().map(|u| levels[u] + 1).max().unwrap_or(0));
                }
            }
        }
        levels
    }

    /// The contractions; none where a table would have too many factors or numbers.
    fn assemble(
        self,
        request: &Request,
        places: &[Option<usize>],
        live: &BTreeSet<usize>,
    ) -> Option<(Rolled, Request)> {
        let levels = self.levels(live);
        let n_levels = levels.values().max().map_or(0, |level| level + 1);
        // Those that are results come first, in their order, so that an array of results is that of a contraction.
        let mut order: Vec<Vec<usize>> = vec![Vec::new(); n_levels];
        let mut at: BTreeMap<usize, usize> = BTreeMap::new();
        for u in places.iter().flatten().chain(live) {
            if let Some(level) = levels.get(u)
                && !at.contains_key(u)
            {
                at.insert(*u, order[*level].len());
                order[*level].push(*u);
            }
        }
        let mut scalars: Vec<ExprId> = Vec::new();
        let mut scalar_idx: HashMap<ExprId, usize> = HashMap::new();
        let (mut contractions, mut tables): (Vec<Contraction>, Vec<Table>) = (Vec::new(), Vec::new());
        for own in &order {
            let mut writers: BTreeMap<[Factors; 2], TableWriter> = BTreeMap::new();
            for (k, u) in own.iter().enumerate() {
                for term in self.units[*u].terms.iter().flatten() {
                    let mut sides: Vec<(Factors, usize)> = Vec::with_capacity(2);
                    sides.extend(term.factors.iter().map(|f| match f {
                        Factor::State(i) => (Factors::State, *i),
                        Factor::Argument(i) => (Factors::Argument, *i),
                        Factor::Unit(u) => (Factors::Contraction(levels[u] as u32), at[u]),
                    }));
                    // Every product has two factors.
                    let ones = std::iter::repeat(self.one);
                    for scalar in term.scalar.into_iter().chain(ones).take(2 - sides.len()) {
                        let i = *scalar_idx.entry(scalar).or_insert_with(|| {
                            scalars.push(scalar);
                            scalars.len() - 1
                        });
                        sides.push((Factors::Scalars, i));
                    }
                    sides.sort_unstable();
                    let writer = writers.entry([sides[0].0, sides[1].0]).or_default();
                    writer.push(k, [sides[0].1, sides[1].1], &term.number)?;
                }
            }
            let (mut terms, mut n_products) = (Vec::new(), 0);
            for ([left, right], writer) in writers {
                let table = writer.finish(own.len())?;
                n_products += table.n_products();
                terms.push(Products { table: u32::try_from(tables.len()).ok()?, left, right });
                tables.push(table);
            }
            contractions.push(Contraction { n_results: own.len(), n_products, terms });
        }
        let starts: Vec<usize> =
            (0..n_levels).map(|level| order[..level].iter().map(Vec::len).sum()).collect();
        let (mut origins, mut straight) = (Vec::new(), Vec::new());
        for ((name, e), place) in request.results.iter().zip(places) {
            origins.push(match place.filter(|u| at.contains_key(u)) {
                Some(u) => Origin::Sum(u32::try_from(starts[levels[&u]] + at[&u]).ok()?),
                None => {
                    straight.push((name.clone(), *e));
                    Origin::Straight(straight.len() - 1)
                }
            });
        }
        let n_straight = straight.len();
        straight.extend(scalars.into_iter().map(|e| (String::new(), e)));
        let rest = Request { role: request.role.clone(), results: straight };
        Some((Rolled { asked: request.clone(), origins, n_straight, contractions, tables }, rest))
    }
}

/// A table in the making.
#[derive(Default)]
struct TableWriter {
    places: Vec<u8>,
    ends: Vec<u32>,
    numbers: Vec<Number>,
    index: HashMap<String, usize>,
}

impl TableWriter {
    /// Adds a product to the sum at a position, which is no earlier than that of the product before; none where
    /// something does not fit.
    fn push(&mut self, k: usize, [left, right]: [usize; 2], number: &Number) -> Option<()> {
        self.close(k)?;
        let n = self.numbers.len();
        let at = *self.index.entry(number.to_string()).or_insert(n);
        if at == n {
            self.numbers.push(number.clone());
        }
        Table::push(&mut self.places, Place { left, right, number: at })
    }

    /// Ends the sums before a position.
    fn close(&mut self, k: usize) -> Option<()> {
        let n_products = u32::try_from(self.places.len() / 6).ok()?;
        self.ends.resize(self.ends.len().max(k), n_products);
        Some(())
    }

    fn finish(mut self, n_results: usize) -> Option<Table> {
        self.close(n_results)?;
        Some(Table::new(self.places, self.ends, self.numbers))
    }
}
