//! Equations as ordered, named definitions.

use std::collections::{BTreeSet, HashMap};

use super::graph::{ExprId, Graph, Node, SymbolId};

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
#[derive(Clone, Debug)]
pub struct SectionWriter {
    sections: Vec<Section>,
    named: HashMap<ExprId, SymbolId>,
    varying: BTreeSet<SymbolId>,
}

impl SectionWriter {
    /// No sections yet; `varying` are the inputs that change from call to call, everything else is a parameter.
    pub fn new(varying: BTreeSet<SymbolId>) -> SectionWriter {
        SectionWriter { sections: Vec::new(), named: HashMap::new(), varying }
    }

    /// Whether an expression changes from call to call, also through definitions.
    pub fn varies(&self, g: &Graph, e: ExprId) -> bool {
        g.depends_on(e, &self.varying)
    }

    /// Starts a section; a section without definitions disappears.
    pub fn begin(&mut self, title: &str) {
        self.sections.push(Section { title: title.to_owned(), definitions: Vec::new() });
    }

    /// Gives `e` a name, unless it is zero, a constant, a symbol or a monomial in symbols, which are used as they are.
    pub fn define(&mut self, g: &mut Graph, name: &str, e: ExprId) -> ExprId {
        let e = g.cancel_zero(e);
        if is_monomial(g, e) {
            return e;
        }
        if let Some(known) = self.named.get(&e) {
            return g.sym(*known);
        }
        let symbol = g.define(name, e);
        self.named.insert(e, symbol);
        if self.varies(g, e) {
            self.varying.insert(symbol);
        }
        if self.sections.is_empty() {
            self.begin("definitions");
        }
        if let Some(section) = self.sections.last_mut() {
            section.definitions.push(Definition { symbol, expr: e });
        }
        g.sym(symbol)
    }

    /// The sections that have definitions, and every symbol that varies.
    pub fn finish(self) -> (Vec<Section>, BTreeSet<SymbolId>) {
        (self.sections.into_iter().filter(|s| !s.definitions.is_empty()).collect(), self.varying)
    }
}

fn is_monomial(g: &Graph, e: ExprId) -> bool {
    match g.node(e) {
        Node::Constant(_) | Node::Pi | Node::Symbol(_) => true,
        Node::Product { factors, .. } => factors.iter().all(|(base, exponent)| {
            matches!(g.node(*base), Node::Symbol(_))
                && exponent.is_integer()
                && exponent.numer().sign() == num_bigint::Sign::Plus
        }),
        _ => false,
    }
}
