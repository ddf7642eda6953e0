//! Derivatives of ordered definitions as further definitions, sharing every value with the original ones.
//!
//! Definitions and results are linearised once: `dv_i = sum_j c_ij dv_j` over the values `v_j` that `v_i` is made of.
//! Forward mode pushes tangents through the linear equations, reverse mode pulls adjoints back through their transpose.
//! A definition's value is used, never differentiated through its expansion, so divisions and factorisations stay what
//! they are and every derivative costs a small multiple of what it differentiates.
//!
//! Deliberately does not know: mechanics, which inputs are a state, programs.
//!
//! # Source
//! Griewank and Walther 2008, Evaluating Derivatives, chapter 3.

use std::collections::{BTreeSet, HashMap};

use crate::{ExprId, Graph, Node, Section, SectionWriter, SymbolId};

/// A value that depends on the inputs: an input, a definition, or a part of an expression.
#[derive(Clone, Debug)]
struct Vertex {
    /// The name, unless the value is a part of an expression or a result.
    symbol: Option<SymbolId>,
    /// Position of the section it belongs to; the number of sections for results.
    section: usize,
    /// Earlier vertices and the partial derivatives by them, none zero.
    partials: Vec<(usize, ExprId)>,
}

/// Ordered definitions and results, linearised with respect to some of their inputs.
///
/// ```text
/// dv_i = sum_{j < i} c_ij dv_j
/// ```
///
/// Inputs that are not differentiated by are constants.
#[derive(Clone, Debug)]
pub struct Linearisation {
    /// The inputs first, then in order of evaluation.
    vertices: Vec<Vertex>,
    n_inputs: usize,
    /// The vertex of each result; none for a result that does not depend on the inputs.
    roots: Vec<Option<usize>>,
    titles: Vec<String>,
}

impl Linearisation {
    /// Linearises `roots`, which are written in terms of inputs and the definitions of `sections`.
    pub fn new(g: &mut Graph, sections: &[Section], roots: &[ExprId], inputs: &[SymbolId]) -> Linearisation {
        let mut builder = Builder { vertices: Vec::new(), symbols: HashMap::new(), parts: HashMap::new() };
        for input in inputs {
            let position = builder.push(Vertex { symbol: Some(*input), section: 0, partials: Vec::new() });
            builder.symbols.insert(*input, position);
        }
        for (k, section) in sections.iter().enumerate() {
            for definition in &section.definitions {
                builder.parts_of(g, definition.expr, k);
                let value = g.sym(definition.symbol);
                let partials = builder.partials(g, definition.expr, value);
                if !partials.is_empty() {
                    let vertex = Vertex { symbol: Some(definition.symbol), section: k, partials };
                    let position = builder.push(vertex);
                    builder.symbols.insert(definition.symbol, position);
                }
            }
        }
        let roots = roots
            .iter()
            .map(|root| {
                builder.parts_of(g, *root, sections.len());
                builder.part(g, *root, sections.len())
            })
            .collect();
        Linearisation {
            vertices: builder.vertices,
            n_inputs: inputs.len(),
            roots,
            titles: sections.iter().map(|s| s.title.clone()).collect(),
        }
    }

    /// Forward mode: the tangents `J v` of the results along directions `v` of the inputs, side by side.
    ///
    /// `name` spells the tangent of a definition along the direction of that position, `title` a section of tangents,
    /// given that of the definitions.
    ///
    /// # Shapes
    /// directions: \[n_directions\]\[n_inputs\] -> \[n_roots\]\[n_directions\].
    ///
    /// # Panics
    /// When a direction has another size.
    pub fn forward(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        directions: &[Vec<ExprId>],
        name: impl Fn(&str, usize) -> String,
        title: impl Fn(&str) -> String,
    ) -> Vec<Vec<ExprId>> {
        assert!(directions.iter().all(|v| v.len() == self.n_inputs), "dimension of the directions");
        let zeros = vec![g.zero(); directions.len()];
        let mut tangents: Vec<Vec<ExprId>> =
            (0..self.n_inputs).map(|j| directions.iter().map(|v| v[j]).collect()).collect();
        let mut section = None;
        for vertex in &self.vertices[self.n_inputs..] {
            self.enter(&mut section, vertex, writer, &title);
            let mut tangent = Vec::with_capacity(directions.len());
            for k in 0..directions.len() {
                let mut terms = Vec::with_capacity(vertex.partials.len());
                for (j, partial) in &vertex.partials {
                    if tangents[*j][k] != g.zero() {
                        terms.push(g.mul(*partial, tangents[*j][k]));
                    }
                }
                let sum = g.sum(&terms);
                tangent.push(named(g, writer, vertex, sum, |value| name(value, k)));
            }
            tangents.push(tangent);
        }
        self.roots.iter().map(|root| root.map_or_else(|| zeros.clone(), |k| tangents[k].clone())).collect()
    }

    /// Reverse mode: the adjoints `J^T w` of the inputs under a covector `w` on the results.
    ///
    /// `name` spells the adjoint of a definition, `title` a section of adjoints, given that of the definitions.
    ///
    /// # Shapes
    /// covector: \[n_roots\] -> \[n_inputs\].
    ///
    /// # Panics
    /// When the covector has another size.
    pub fn reverse(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        covector: &[ExprId],
        name: impl Fn(&str) -> String,
        title: impl Fn(&str) -> String,
    ) -> Vec<ExprId> {
        assert_eq!(covector.len(), self.roots.len(), "dimension of the covector");
        let mut terms: Vec<Vec<ExprId>> = vec![Vec::new(); self.vertices.len()];
        for (root, w) in self.roots.iter().zip(covector) {
            if let Some(k) = root {
                terms[*k].push(*w);
            }
        }
        let mut section = None;
        for (i, vertex) in self.vertices.iter().enumerate().skip(self.n_inputs).rev() {
            self.enter(&mut section, vertex, writer, &title);
            let sum = g.sum(&terms[i]);
            let adjoint = named(g, writer, vertex, sum, &name);
            if adjoint != g.zero() {
                for (j, partial) in &vertex.partials {
                    terms[*j].push(g.mul(*partial, adjoint));
                }
            }
        }
        let adjoints = terms[..self.n_inputs].iter().map(|terms| g.sum(terms)).collect::<Vec<_>>();
        adjoints.into_iter().map(|e| g.cancel_zero(e)).collect()
    }

    /// The matrix `J`, a row for each result; entries that vanish identically are zero.
    ///
    /// `name` spells the derivative of a definition, its first argument, by an input, its second.
    pub fn jacobian(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        name: impl Fn(&str, &str) -> String,
        title: impl Fn(&str) -> String,
    ) -> Vec<Vec<ExprId>> {
        let n = self.n_inputs;
        let units: Vec<Vec<ExprId>> =
            (0..n).map(|j| (0..n).map(|k| if k == j { g.one() } else { g.zero() }).collect()).collect();
        let inputs: Vec<String> =
            self.vertices[..n].iter().filter_map(|v| Some(g.name(v.symbol?).to_owned())).collect();
        self.forward(g, writer, &units, |value, k| name(value, &inputs[k]), title)
    }

    /// Begins the section of a vertex that gets a name.
    fn enter(
        &self,
        current: &mut Option<usize>,
        vertex: &Vertex,
        writer: &mut SectionWriter,
        title: impl Fn(&str) -> String,
    ) {
        if vertex.symbol.is_some() && *current != Some(vertex.section) {
            *current = Some(vertex.section);
            writer.begin(&title(&self.titles[vertex.section]));
        }
    }
}

/// A derivative that belongs to a vertex: defined under a name if the vertex has one.
fn named(
    g: &mut Graph,
    writer: &mut SectionWriter,
    vertex: &Vertex,
    e: ExprId,
    name: impl Fn(&str) -> String,
) -> ExprId {
    match vertex.symbol {
        Some(symbol) => {
            let name = name(g.name(symbol));
            writer.define(g, &name, e)
        }
        None => g.cancel_zero(e),
    }
}

struct Builder {
    vertices: Vec<Vertex>,
    /// Vertices of inputs and definitions; a symbol without one is constant.
    symbols: HashMap<SymbolId, usize>,
    /// Vertices of other expressions, none for constant ones.
    parts: HashMap<ExprId, Option<usize>>,
}

impl Builder {
    fn push(&mut self, vertex: Vertex) -> usize {
        self.vertices.push(vertex);
        self.vertices.len() - 1
    }

    /// Makes vertices of all that `root` is made of, `root` itself left out, operands first.
    fn parts_of(&mut self, g: &mut Graph, root: ExprId, section: usize) {
        let mut seen = BTreeSet::new();
        let mut pending = vec![root];
        while let Some(e) = pending.pop() {
            for_each_operand(g, e, |operand| {
                let leaf = matches!(g.node(operand), Node::Symbol(_) | Node::Constant(_) | Node::Pi);
                if !leaf && !self.parts.contains_key(&operand) && seen.insert(operand) {
                    pending.push(operand);
                }
            });
        }
        // Operands precede the nodes that use them in the arena.
        for e in seen {
            self.part(g, e, section);
        }
    }

    /// The vertex of an expression whose parts have theirs.
    fn part(&mut self, g: &mut Graph, e: ExprId, section: usize) -> Option<usize> {
        match g.node(e) {
            Node::Symbol(s) => return self.symbols.get(s).copied(),
            Node::Constant(_) | Node::Pi => return None,
            _ => {}
        }
        if let Some(known) = self.parts.get(&e) {
            return *known;
        }
        let partials = self.partials(g, e, e);
        let position = (!partials.is_empty()).then(|| self.push(Vertex { symbol: None, section, partials }));
        self.parts.insert(e, position);
        position
    }

    fn partials(&mut self, g: &mut Graph, e: ExprId, value: ExprId) -> Vec<(usize, ExprId)> {
        let mut list = Vec::new();
        for (operand, partial) in g.partials(e, value) {
            let position = match g.node(operand) {
                Node::Symbol(s) => self.symbols.get(s).copied(),
                _ => self.parts.get(&operand).copied().flatten(),
            };
            if let Some(position) = position {
                let partial = g.cancel_zero(partial);
                if partial != g.zero() {
                    list.push((position, partial));
                }
            }
        }
        list
    }
}

/// Calls `visit` on the operands that [`Graph::partials`] tells apart.
fn for_each_operand(g: &Graph, e: ExprId, mut visit: impl FnMut(ExprId)) {
    match g.node(e) {
        Node::Sum { terms, .. } => {
            for (term, _) in terms {
                match g.node(*term) {
                    product @ Node::Product { .. } => product.for_each_operand(&mut visit),
                    _ => visit(*term),
                }
            }
        }
        node => node.for_each_operand(visit),
    }
}

#[cfg(test)]
mod tests;
