//! The arena: nodes with their values at random points, and what symbols stand for.
//!
//! Deliberately does not know: how nodes are made canonical, where their values come from, budgets.

use super::knowledge::{Doubts, Fingerprint, Knowledge};
use super::node::{ExprId, Node, SymbolId};
use super::shared::SharedVec;

#[derive(Clone, Debug)]
struct SymbolEntry {
    name: String,
    /// What the symbol stands for.
    definition: Option<ExprId>,
}

#[derive(Clone, Debug)]
struct Entry {
    node: Node,
    fingerprint: Fingerprint,
    /// Why a fingerprint other than zero may prove nothing.
    doubts: Doubts,
}

/// Nodes by their handles; operands precede the nodes that use them.
#[derive(Clone, Debug)]
pub(super) struct Arena {
    entries: SharedVec<Entry>,
    symbols: Vec<SymbolEntry>,
    knowledge: Knowledge,
}

impl Arena {
    /// The first node of every graph, the number zero.
    pub(super) const ZERO: ExprId = ExprId(0);
    /// The second node of every graph, the number one.
    pub(super) const ONE: ExprId = ExprId(1);

    pub(super) fn new() -> Arena {
        Arena { entries: SharedVec::new(), symbols: Vec::new(), knowledge: Knowledge::new() }
    }

    pub(super) fn n_nodes(&self) -> usize {
        self.entries.len()
    }

    pub(super) fn node(&self, e: ExprId) -> &Node {
        &self.entries.at(e.index()).node
    }

    /// Appends a node, which must not be there yet.
    pub(super) fn push(&mut self, node: Node, fingerprint: Fingerprint, doubts: Doubts) -> ExprId {
        let id =
            ExprId(u32::try_from(self.entries.len()).expect("fewer than 2^32 expressions fit in memory"));
        self.entries.push(Entry { node, fingerprint, doubts });
        id
    }

    /// Values at the random points.
    pub(super) fn fingerprint(&self, e: ExprId) -> &Fingerprint {
        &self.entries.at(e.index()).fingerprint
    }

    /// Why a fingerprint other than zero may prove nothing.
    pub(super) fn doubts(&self, e: ExprId) -> Doubts {
        self.entries.at(e.index()).doubts
    }

    pub(super) fn knowledge(&self) -> &Knowledge {
        &self.knowledge
    }

    pub(super) fn knowledge_mut(&mut self) -> &mut Knowledge {
        &mut self.knowledge
    }

    pub(super) fn n_symbols(&self) -> usize {
        self.symbols.len()
    }

    pub(super) fn push_symbol(&mut self, name: &str, definition: Option<ExprId>) -> SymbolId {
        let id = SymbolId(u32::try_from(self.symbols.len()).expect("fewer than 2^32 symbols fit in memory"));
        self.symbols.push(SymbolEntry { name: name.to_owned(), definition });
        id
    }

    pub(super) fn name(&self, s: SymbolId) -> &str {
        &self.symbols[s.index()].name
    }

    pub(super) fn rename(&mut self, s: SymbolId, name: String) {
        self.symbols[s.index()].name = name;
    }

    /// What a symbol stands for, if it stands for anything.
    pub(super) fn definition(&self, s: SymbolId) -> Option<ExprId> {
        self.symbols[s.index()].definition
    }
}
