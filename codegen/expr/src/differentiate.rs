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
use std::ops::Range;

use crate::{Definition, ExprId, Graph, Node, Section, SectionWriter, SymbolId};

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

/// The solution `x` of a linear system among definitions, by the system: `r(x) = A x - f = 0` is differentiated at
/// fixed `x`, `A dx = -dr`, and the definitions by which it was solved are not.
///
/// # Shapes
/// With `n` components: residual, labels `[n]`; symbols at most `n`.
#[derive(Clone, Debug)]
pub struct Solved {
    /// Definitions that are components of the solution, each with its position in it.
    pub symbols: Vec<(SymbolId, usize)>,
    /// The components of `r` at the solution, as they are written, although each is equal to zero.
    pub residual: Vec<ExprId>,
    /// Names that the residual has for functions of the solution. Nothing differentiates these.
    pub held: Section,
    /// Definitions that the residual alone needs; they need none that comes after the first component of the solution,
    /// other components apart.
    pub sections: Vec<Section>,
    /// Names of the components.
    pub labels: Vec<String>,
}

/// Solves a linear system for further right-hand sides.
pub trait Linear {
    /// `x` of `A x = b`, `[n] -> [n]`; its components are named by `labels`.
    fn solve(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        labels: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId>;

    /// `x` of `A^T x = b`.
    fn solve_transposed(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        labels: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId>;
}

/// The vertices of a solution.
#[derive(Clone)]
struct Block<'a> {
    /// The first of the vertices of its components, one after the other.
    start: usize,
    /// The vertices of the residual.
    residual: Vec<Option<usize>>,
    solved: &'a Solved,
    linear: &'a dyn Linear,
}

/// Ordered definitions and results, linearised with respect to some of their inputs.
///
/// ```text
/// dv_i = sum_{j < i} c_ij dv_j
/// ```
///
/// Inputs that are not differentiated by are constants.
#[derive(Clone)]
pub struct Linearisation<'a> {
    /// The inputs first, then in order of evaluation.
    vertices: Vec<Vertex>,
    n_inputs: usize,
    /// The vertex of each result; none for a result that does not depend on the inputs.
    roots: Vec<Option<usize>>,
    titles: Vec<String>,
    block: Option<Block<'a>>,
    /// Whether some result depends on a vertex.
    is_needed: Vec<bool>,
}

impl<'a> Linearisation<'a> {
    /// Linearises `roots`, which are written in terms of inputs and the definitions of `sections`.
    pub fn new(g: &mut Graph, sections: &[Section], roots: &[ExprId], inputs: &[SymbolId]) -> Self {
        Linearisation::with_solved(g, sections, roots, inputs, None)
    }

    /// The same, where some definitions are the solution of a linear system: `dx = -A^-1 dr` in the place of their own
    /// partial derivatives.
    pub fn with_solved(
        g: &mut Graph,
        sections: &[Section],
        roots: &[ExprId],
        inputs: &[SymbolId],
        solved: Option<(&'a Solved, &'a dyn Linear)>,
    ) -> Self {
        let mut builder = Builder { vertices: Vec::new(), symbols: HashMap::new(), parts: HashMap::new() };
        let mut block = None;
        for input in inputs {
            let position = builder.push(Vertex { symbol: Some(*input), section: 0, partials: Vec::new() });
            builder.symbols.insert(*input, position);
        }
        for (k, section) in sections.iter().enumerate() {
            for definition in &section.definitions {
                let of_solution = solved.filter(|(solved, _)| solved.position(definition.symbol).is_some());
                let Some((solved, linear)) = of_solution else {
                    builder.definition(g, definition, k);
                    continue;
                };
                if block.is_none() {
                    let residual = builder.residual(g, solved, sections.len() + 1);
                    let start = builder.vertices.len();
                    for (symbol, _) in &solved.symbols {
                        let vertex = Vertex { symbol: Some(*symbol), section: k, partials: Vec::new() };
                        let position = builder.push(vertex);
                        builder.symbols.insert(*symbol, position);
                    }
                    block = Some(Block { start, residual, solved, linear });
                }
            }
        }
        let roots = roots.iter().map(|root| builder.root(g, *root, sections.len())).collect();
        let mut titles: Vec<String> = sections.iter().map(|s| s.title.clone()).collect();
        titles.push("results".to_owned());
        titles.extend(solved.iter().flat_map(|(solved, _)| solved.sections.iter().map(|s| s.title.clone())));
        let mut linear = Linearisation {
            is_needed: vec![false; builder.vertices.len()],
            vertices: builder.vertices,
            n_inputs: inputs.len(),
            roots,
            titles,
            block,
        };
        linear.find_needed();
        linear
    }

    fn find_needed(&mut self) {
        let mut pending: Vec<usize> = self.roots.iter().flatten().copied().collect();
        while let Some(i) = pending.pop() {
            if std::mem::replace(&mut self.is_needed[i], true) {
                continue;
            }
            pending.extend(self.vertices[i].partials.iter().map(|(j, _)| *j));
            if let Some(block) = self.block.as_ref().filter(|block| block.vertices().contains(&i)) {
                pending.extend(block.residual.iter().flatten());
            }
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
        for (i, vertex) in self.vertices.iter().enumerate().skip(self.n_inputs) {
            if i < tangents.len() {
                continue;
            }
            if !self.is_needed[i] {
                tangents.push(zeros.clone());
                continue;
            }
            self.enter(&mut section, vertex, writer, &title);
            if let Some(block) = self.block.as_ref().filter(|block| block.vertices().contains(&i)) {
                let of_solution = block.tangents(g, writer, &tangents, directions.len(), &name);
                tangents.extend(of_solution.into_iter().skip(i - block.start));
                continue;
            }
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
            if let Some(block) = self.block.as_ref().filter(|block| block.vertices().contains(&i)) {
                if i == block.start {
                    block.adjoints(g, writer, &mut terms, &name);
                }
                continue;
            }
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

impl Solved {
    /// The residual and the definitions that it alone needs.
    pub fn expressions(&self) -> impl Iterator<Item = ExprId> {
        let definitions = self.sections.iter().flat_map(|section| &section.definitions);
        definitions.map(|definition| definition.expr).chain(self.residual.iter().copied())
    }

    /// The position of a component in the solution.
    fn position(&self, symbol: SymbolId) -> Option<usize> {
        self.symbols.iter().find(|(own, _)| *own == symbol).map(|(_, position)| *position)
    }
}

impl Block<'_> {
    fn vertices(&self) -> Range<usize> {
        self.start..self.start + self.solved.symbols.len()
    }

    /// `dx = -A^-1 dr` along every direction, by vertex.
    fn tangents(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        tangents: &[Vec<ExprId>],
        n_directions: usize,
        name: impl Fn(&str, usize) -> String,
    ) -> Vec<Vec<ExprId>> {
        let mut of_vertices = vec![Vec::with_capacity(n_directions); self.solved.symbols.len()];
        for k in 0..n_directions {
            let mut right = Vec::with_capacity(self.residual.len());
            for (root, label) in self.residual.iter().zip(&self.solved.labels) {
                let slope = root.map_or(g.zero(), |i| tangents[i][k]);
                let value = g.neg(slope);
                right.push(writer.define(g, &name(&format!("balance_{label}"), k), value));
            }
            let labels: Vec<String> = self.solved.labels.iter().map(|label| name(label, k)).collect();
            let solution = self.linear.solve(g, writer, &labels, &right);
            for (list, (_, position)) in of_vertices.iter_mut().zip(&self.solved.symbols) {
                list.push(solution[*position]);
            }
        }
        of_vertices
    }

    /// Adds `-A^-T w` to the adjoints of the residual, with the adjoints `w` of the solution.
    fn adjoints(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        terms: &mut [Vec<ExprId>],
        name: impl Fn(&str) -> String,
    ) {
        let mut right = vec![g.zero(); self.residual.len()];
        for (i, (_, position)) in self.vertices().zip(&self.solved.symbols) {
            let sum = g.sum(&terms[i]);
            right[*position] = writer.define(g, &name(&self.solved.labels[*position]), sum);
        }
        let labels: Vec<String> =
            self.solved.labels.iter().map(|label| name(&format!("balance_{label}"))).collect();
        let solution = self.linear.solve_transposed(g, writer, &labels, &right);
        for (root, adjoint) in self.residual.iter().zip(solution) {
            if let Some(i) = root {
                terms[*i].push(g.neg(adjoint));
            }
        }
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

    fn definition(&mut self, g: &mut Graph, definition: &Definition, section: usize) {
        self.parts_of(g, definition.expr, section);
        let value = g.sym(definition.symbol);
        let partials = self.partials(g, definition.expr, value);
        if !partials.is_empty() {
            let position = self.push(Vertex { symbol: Some(definition.symbol), section, partials });
            self.symbols.insert(definition.symbol, position);
        }
    }

    fn root(&mut self, g: &mut Graph, root: ExprId, section: usize) -> Option<usize> {
        self.parts_of(g, root, section);
        self.part(g, root, section)
    }

    /// The residual of a system at a solution that is held, with sections from that position on.
    fn residual(&mut self, g: &mut Graph, solved: &Solved, first: usize) -> Vec<Option<usize>> {
        // Parts in which the solution is held are other vertices where it is not.
        let parts = self.parts.clone();
        for (k, section) in solved.sections.iter().enumerate() {
            for definition in &section.definitions {
                self.definition(g, definition, first + k);
            }
        }
        let section = first + solved.sections.len();
        let roots = solved.residual.iter().map(|root| self.root(g, *root, section)).collect();
        self.parts = parts;
        roots
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
