//! Equations as ordered, named definitions.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet, HashMap};

use num_traits::Signed;
use rustc_hash::{FxHashMap, FxHashSet};

use super::graph::Graph;
use super::node::{ExprId, Node, SymbolId};

/// `symbol = expr`, where `expr` mentions inputs and earlier definitions only.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Definition {
    /// The name; made with [`Graph::define`].
    pub symbol: SymbolId,
    /// Its value.
    pub expr: ExprId,
}

/// Definitions that belong together under one formula.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// The formula, such as `momenta p = dL/dy`.
    pub title: String,
    /// In order of dependence.
    pub definitions: Vec<Definition>,
}

/// Writes sections: names what is worth a name, passes the rest through, and keeps track of what varies.
#[derive(Clone, Debug, Default)]
pub struct SectionWriter {
    sections: Vec<Section>,
    named: HashMap<ExprId, SymbolId>,
    varying: BTreeSet<SymbolId>,
    /// Values of what varies at one point: zero, unless the inputs have none there.
    at_origin: BTreeMap<SymbolId, ExprId>,
    /// Expressions that were found not to vary, with their values at the first of the random points: what varies is
    /// named before anything mentions it, so that they never will. A trial that was given up leaves ids that mean
    /// something else by now, which these values tell.
    constant: RefCell<FxHashMap<ExprId, Option<u64>>>,
}

impl SectionWriter {
    /// No sections yet; `varying` are the inputs that change from call to call, everything else is a parameter. A point
    /// of the inputs is zero in all of them but the `units`, which are one.
    pub fn new(g: &Graph, varying: BTreeSet<SymbolId>, units: &[SymbolId]) -> SectionWriter {
        let mut at_origin: BTreeMap<SymbolId, ExprId> = varying.iter().map(|s| (*s, g.zero())).collect();
        at_origin.extend(units.iter().map(|s| (*s, g.one())));
        SectionWriter {
            sections: Vec::new(),
            named: HashMap::new(),
            varying,
            at_origin,
            constant: RefCell::default(),
        }
    }

    /// Goes on after definitions that exist: their values have names already.
    pub fn after(g: &Graph, varying: BTreeSet<SymbolId>, sections: &[Section]) -> SectionWriter {
        let mut writer = SectionWriter::new(g, varying, &[]);
        for definition in sections.iter().flat_map(|section| &section.definitions) {
            writer.named.entry(definition.expr).or_insert(definition.symbol);
        }
        writer
    }

    /// Further inputs that change from call to call, before anything mentions them.
    pub fn vary(&mut self, g: &Graph, inputs: &[SymbolId]) {
        self.varying.extend(inputs);
        self.at_origin.extend(inputs.iter().map(|s| (*s, g.zero())));
    }

    /// Whether an expression changes from call to call, also through definitions.
    pub fn varies(&self, g: &Graph, e: ExprId) -> bool {
        let mut constant = self.constant.borrow_mut();
        let value = |e: ExprId| g.fingerprint(e)[0];
        let (mut seen, mut pending) = (FxHashSet::from_iter([e]), vec![e]);
        while let Some(e) = pending.pop() {
            if constant.get(&e).is_some_and(|known| *known == value(e)) {
                continue;
            }
            match g.node(e) {
                Node::Symbol(s) if self.varying.contains(s) => return true,
                node => node.for_each_operand(|operand| {
                    if seen.insert(operand) {
                        pending.push(operand);
                    }
                }),
            }
        }
        constant.extend(seen.into_iter().map(|e| (e, value(e))));
        false
    }

    /// Starts a section; a section without definitions disappears.
    pub fn begin(&mut self, title: &str) {
        self.sections.push(Section { title: title.to_owned(), definitions: Vec::new() });
    }

    /// Gives `e` a name, unless it is zero, a constant, a symbol or a monomial in symbols, which are used as they are.
    pub fn define(&mut self, g: &mut Graph, name: &str, e: ExprId) -> ExprId {
        let e = g.cancel_zero(e);
        let (e, at_origin) = self.settled(g, e);
        if g.is_trivial(e) {
            return e;
        }
        if let Some(known) = self.named.get(&e) {
            return g.sym(*known);
        }
        let symbol = g.define(name, e);
        self.named.insert(e, symbol);
        if self.varies(g, e) {
            self.varying.insert(symbol);
            self.at_origin.extend(at_origin.map(|value| (symbol, value)));
        }
        if self.sections.is_empty() {
            self.begin("definitions");
        }
        if let Some(section) = self.sections.last_mut() {
            section.definitions.push(Definition { symbol, expr: e });
        }
        g.sym(symbol)
    }

    /// The value of an expression that is constant however it is written; none if it varies, or if that cannot be seen.
    pub fn constant(&self, g: &mut Graph, e: ExprId) -> Option<ExprId> {
        let e = self.settled(g, e).0;
        (!self.varies(g, e)).then_some(e)
    }

    /// An expression that is constant however it is written (`sin^2 x + cos^2 x`) as its value at the one point where
    /// everything that varies has one; that value in any case, where there is one.
    fn settled(&self, g: &mut Graph, e: ExprId) -> (ExprId, Option<ExprId>) {
        if !self.varies(g, e) {
            return (e, None);
        }
        match g.subs(e, &self.at_origin) {
            Ok(value) if !self.varies(g, value) => {
                let e = if g.fingerprints_agree(e, value) { value } else { e };
                (e, Some(value))
            }
            _ => (e, None),
        }
    }

    /// Everything defined so far, in order.
    pub fn definitions(&self) -> impl Iterator<Item = &Definition> {
        self.sections.iter().flat_map(|s| &s.definitions)
    }

    /// The sections that have definitions, and every symbol that varies.
    pub fn finish(self) -> (Vec<Section>, BTreeSet<SymbolId>) {
        (self.sections.into_iter().filter(|s| !s.definitions.is_empty()).collect(), self.varying)
    }
}

/// The values of definitions without the names of others in them; a definition whose value has a vanishing denominator
/// then keeps the names.
pub fn inlined<'a>(
    g: &mut Graph,
    definitions: impl IntoIterator<Item = &'a Definition>,
) -> BTreeMap<SymbolId, ExprId> {
    let mut values = BTreeMap::new();
    for definition in definitions {
        let value = g.subs(definition.expr, &values).unwrap_or(definition.expr);
        values.insert(definition.symbol, value);
    }
    values
}

/// The sections with only those definitions that the roots need, directly or through others.
pub fn needed_sections(g: &Graph, sections: &[Section], roots: &[ExprId]) -> Vec<Section> {
    let mut needed: BTreeSet<SymbolId> = roots.iter().flat_map(|e| g.free_symbols(*e)).collect();
    let mut kept = Vec::new();
    for section in sections.iter().rev() {
        let mut definitions = Vec::new();
        for definition in section.definitions.iter().rev() {
            if needed.contains(&definition.symbol) {
                needed.extend(g.free_symbols(definition.expr));
                definitions.push(*definition);
            }
        }
        definitions.reverse();
        if !definitions.is_empty() {
            kept.push(Section { title: section.title.clone(), definitions });
        }
    }
    kept.reverse();
    kept
}

impl Graph {
    /// Whether an expression is a constant, a symbol or a monomial in symbols: not worth a name.
    pub fn is_trivial(&self, e: ExprId) -> bool {
        match self.node(e) {
            Node::Constant(_) | Node::Pi | Node::Symbol(_) => true,
            Node::Product { factors, .. } => factors.iter().all(|(base, exponent)| {
                let symbol = matches!(self.node(*base), Node::Symbol(_));
                symbol && exponent.is_integer() && exponent.is_positive()
            }),
            _ => false,
        }
    }
}
