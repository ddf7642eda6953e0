//! Definitions of algebras and representations, in the order of their use.
//!
//! Deliberately does not know: velocities, what an algebra expression may consist of.

use std::collections::{BTreeMap, BTreeSet};

use super::algebra_expressions::{BUILT_IN, FAMILIES, SHORT_FAMILIES};
use super::order::{describe_cycle, order_by_use};
use super::values::Elaboration;
use crate::algebra::{LieAlgebra, Matrix, Representation};
use crate::spec::ast::{self, AlgebraExpr, AlgebraNode, Expr, Item, ItemKind, Name, Node};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::eval::Evaluator;
use crate::spec::limits::{MAX_BASIS, MAX_REPRESENTATION, MAX_REPRESENTATION_WORK};
use crate::spec::motions::Motions;
use crate::spec::names;
use crate::spec::value::Value;
use hamel_expr::error::Error;
use hamel_expr::{Number, Scalar, SymbolId};

/// What constants may be.
const CONSTANTS: &str = "for example `2*e1 - sqrt(3)*e3`, or `0`; constants are made of numbers, pi, roots, and sines of multiples of pi";

impl Elaboration<'_> {
    pub(super) fn define_algebras(&mut self, items: &[Item]) {
        let mut nodes: Vec<(&Name, &Item, Vec<String>)> = Vec::new();
        for item in items {
            let (name, used) = match &item.kind {
                ItemKind::AlgebraName { name, value } => (name, value.names()),
                ItemKind::AlgebraBrackets { name, .. } => (name, Vec::new()),
                ItemKind::Representation { name, algebra, .. } => (name, algebra.names()),
                _ => continue,
            };
            nodes.push((name, item, used));
        }
        let mut index: BTreeMap<&str, usize> = BTreeMap::new();
        for (k, (name, ..)) in nodes.iter().enumerate() {
            let reserved = [BUILT_IN, FAMILIES].iter().any(|names| names.contains(&name.text.as_str()))
                && !SHORT_FAMILIES.contains(&name.text.as_str());
            if let Some(reason) = names::refusal(&name.text).or(reserved.then_some("it is built in")) {
                self.problem(name.span, format!("`{}` cannot be used as a name", name.text), reason);
            } else if let Some(first) = index.get(name.text.as_str()) {
                let problem = Diagnostic::new(Some(name.span), format!("`{}` is declared twice", name.text))
                    .with_place(Some(nodes[*first].0.span), "first here")
                    .with_help("rename one of them");
                self.builder.problems.push(problem);
            } else {
                index.insert(&name.text, k);
            }
        }
        let uses: Vec<Vec<usize>> = nodes
            .iter()
            .map(|(_, _, used)| used.iter().filter_map(|u| index.get(u.as_str()).copied()).collect())
            .collect();
        let (order, cycles) = order_by_use(&uses);
        for cycle in cycles {
            let described = describe_cycle(&cycle, |k| &nodes[k].0.text);
            self.problem(
                nodes[cycle[0]].0.span,
                format!("definition in a circle: {described}"),
                "define one of them without the others",
            );
            for k in cycle {
                self.poisoned.insert(nodes[k].0.text.clone());
            }
        }
        for k in order {
            let (name, item, _) = &nodes[k];
            if index.get(name.text.as_str()) == Some(&k) && !self.define_algebra(name, item) {
                self.poisoned.insert(name.text.clone());
            }
        }
    }

    fn define_algebra(&mut self, name: &Name, item: &Item) -> bool {
        match &item.kind {
            ItemKind::AlgebraName { value, .. } => match self.algebra(value) {
                Some(algebra) => self.algebras.insert(name.text.clone(), algebra).is_none(),
                None => false,
            },
            ItemKind::AlgebraBrackets { is_almost, basis, rules, .. } => {
                match self.bracket_algebra(name, *is_almost, basis, rules) {
                    Some(algebra) => self.algebras.insert(name.text.clone(), algebra).is_none(),
                    None => false,
                }
            }
            ItemKind::Representation { algebra, dim, matrices, .. } => {
                let Some(algebra) = self.algebra(algebra) else { return false };
                match self.representation_of(name, &algebra, dim.value, matrices) {
                    Some(r) => self.representations.insert(name.text.clone(), (algebra, r)).is_none(),
                    None => false,
                }
            }
            _ => true,
        }
    }

    /// Linear combinations of names with constant coefficients.
    fn combination(&mut self, expr: &Expr, basis: &[Name]) -> Option<Vec<(usize, Number)>> {
        let mut graph = self.builder.graph.fork();
        let pi = Value::Scalar(graph.pi());
        let mut values = BTreeMap::from([("pi".to_owned(), pi)]);
        let mut symbols: Vec<SymbolId> = Vec::new();
        for element in basis {
            let symbol = graph.symbol(&element.text);
            let e = graph.sym(symbol);
            symbols.push(symbol);
            values.insert(element.text.clone(), Value::Scalar(e));
        }
        let mut evaluator = Evaluator {
            graph: &mut graph,
            values: &values,
            weights: &BTreeMap::new(),
            poisoned: &BTreeSet::new(),
            problems: &mut self.builder.problems,
            is_spent: &mut self.is_spent,
            restriction: None,
            operators: &[],
            withheld: &BTreeSet::new(),
            algebras: &self.algebras,
            rates: None,
            motions: &mut Motions::default(),
            warnings: &mut self.warnings,
            own_algebra: None,
        };
        let value = evaluator.eval(expr);
        self.builder.graph.take_over(&graph);
        let (value, _) = value?;
        let parts = match value {
            Value::Scalar(e) => {
                let free = graph.free_symbols(e);
                let occurring: Vec<SymbolId> = symbols.iter().copied().filter(|s| free.contains(s)).collect();
                graph.affine_parts(e, &occurring).map(|(slopes, offset)| (occurring, slopes, offset))
            }
            _ => None,
        };
        let combination =
            parts.filter(|(.., offset)| *offset == graph.zero()).and_then(|(occurring, slopes, _)| {
                occurring
                    .iter()
                    .zip(slopes)
                    .map(|(s, slope)| {
                        let at = symbols.iter().position(|x| x == s)?;
                        Some((at, graph.as_number(slope)?))
                    })
                    .collect::<Option<Vec<_>>>()
            });
        if combination.is_none() {
            self.problem(
                expr.span,
                "expected a combination of basis elements with constant coefficients",
                CONSTANTS,
            );
        }
        combination
    }

    fn bracket_algebra(
        &mut self,
        name: &Name,
        is_almost: bool,
        basis: &[Name],
        rules: &[ast::BracketRule],
    ) -> Option<LieAlgebra<Number>> {
        if basis.len() > MAX_BASIS {
            let message = format!(
                "algebra `{}` has {} basis elements, the limit is {MAX_BASIS}",
                name.text,
                basis.len()
            );
            self.problem(name.span, message, "");
            return None;
        }
        let mut index: BTreeMap<&str, usize> = BTreeMap::new();
        let mut fine = true;
        for (k, element) in basis.iter().enumerate() {
            if let Some(reason) = names::refusal(&element.text) {
                self.problem(element.span, format!("`{}` cannot be used as a name", element.text), reason);
                fine = false;
            }
            if index.insert(&element.text, k).is_some() {
                self.problem(
                    element.span,
                    format!("basis element `{}` is named twice", element.text),
                    "rename one of them",
                );
                fine = false;
            }
        }
        let mut brackets = Vec::new();
        let mut spans: BTreeMap<(usize, usize), Span> = BTreeMap::new();
        for rule in rules {
            let mut pair = Vec::new();
            for side in [&rule.left, &rule.right] {
                match index.get(side.text.as_str()) {
                    Some(k) => pair.push(*k),
                    None => {
                        let help = names::suggest(&side.text, index.keys().copied());
                        self.problem(side.span, format!("`{}` is not a basis element", side.text), help);
                    }
                }
            }
            let value = self.combination(&rule.value, basis);
            let (&[a, b], Some(value)) = (pair.as_slice(), value) else {
                fine = false;
                continue;
            };
            spans.insert((a.min(b), a.max(b)), rule.span);
            brackets.push((a, b, value));
        }
        if !fine {
            return None;
        }
        let names: Vec<String> = basis.iter().map(|b| b.text.clone()).collect();
        let algebra = match is_almost {
            true => LieAlgebra::almost(&name.text, names, &brackets),
            false => LieAlgebra::from_brackets(&name.text, names, &brackets),
        };
        match algebra {
            Ok(algebra) => Some(algebra),
            Err(errors) => {
                let rule = |a: &String, b: &String| {
                    let at = |n: &String| index.get(n.as_str()).copied().unwrap_or(0);
                    spans.get(&(at(a).min(at(b)), at(a).max(at(b)))).copied()
                };
                for error in errors.iter().take(3) {
                    let places: Vec<Span> = match error {
                        Error::NotAntisymmetric { a, b } => rule(a, b).into_iter().collect(),
                        Error::JacobiViolated { triple: [a, b, c], .. } => {
                            [rule(a, b), rule(b, c), rule(c, a)].into_iter().flatten().collect()
                        }
                        _ => Vec::new(),
                    };
                    let (message, help) = error.message_and_help();
                    let first = places.first().copied().unwrap_or(name.span);
                    let mut problem = Diagnostic::new(Some(first), message).with_help(help);
                    for other in places.into_iter().skip(1) {
                        problem = problem.with_place(Some(other), "together with this one");
                    }
                    self.builder.problems.push(problem);
                }
                None
            }
        }
    }

    fn representation_of(
        &mut self,
        name: &Name,
        algebra: &LieAlgebra<Number>,
        dim: usize,
        matrices: &[(Name, Expr)],
    ) -> Option<Representation<Number>> {
        let n = algebra.dim();
        if n * n * dim * dim * dim > MAX_REPRESENTATION_WORK || n * dim * dim > MAX_REPRESENTATION {
            let message = format!("representation `{}` is too large", name.text);
            self.problem(name.span, message, format!("{n} matrices of size {dim}"));
            return None;
        }
        let mut table: Vec<Option<Matrix<Number>>> = vec![None; n];
        let mut fine = true;
        for (element, expr) in matrices {
            let numbers = self.closed_forms(expr, "entries are numbers", CONSTANTS);
            let Some(k) = algebra.basis().iter().position(|b| *b == element.text) else {
                let help = names::suggest(&element.text, algebra.basis().iter().map(String::as_str));
                let message = format!("`{}` is not a basis element of {}", element.text, algebra.name());
                self.problem(element.span, message, help);
                fine = false;
                continue;
            };
            let Some(numbers) = numbers else {
                fine = false;
                continue;
            };
            let rows: Vec<Vec<Number>> = numbers.chunks(dim.max(1)).map(<[Number]>::to_vec).collect();
            if numbers.len() != dim * dim {
                let message = format!("matrix of `{}` must be matrix({dim}, {dim})", element.text);
                self.problem(expr.span, message, "write it by rows: `[[..], ..]`");
                fine = false;
            } else if table[k].is_some() {
                self.problem(
                    element.span,
                    format!("matrix of `{}` is given twice", element.text),
                    "keep one of them",
                );
                fine = false;
            } else {
                table[k] = Matrix::from_rows(&rows);
            }
        }
        let missing: Vec<&str> =
            table.iter().zip(algebra.basis()).filter(|(m, _)| m.is_none()).map(|(_, b)| b.as_str()).collect();
        if fine && !missing.is_empty() {
            let shown: Vec<&str> = missing.into_iter().take(12).collect();
            let message =
                format!("representation `{}` lacks the matrices of {}", name.text, names::list(&shown));
            self.problem(name.span, message, "give one matrix per basis element");
            fine = false;
        }
        if !fine {
            return None;
        }
        match Representation::from_matrices(&name.text, algebra, table.into_iter().flatten().collect()) {
            Ok(r) => Some(r),
            Err(error) => {
                let matrix_of = |element: &String| matrices.iter().find(|(n, _)| n.text == *element);
                let places: Vec<Span> = match &error {
                    Error::NotARepresentation { pair, .. } => {
                        pair.iter().filter_map(matrix_of).map(|(n, e)| n.span.to(e.span)).collect()
                    }
                    _ => Vec::new(),
                };
                let (message, help) = error.message_and_help();
                let problem = Diagnostic::new(Some(places.first().copied().unwrap_or(name.span)), message)
                    .with_place(places.get(1).copied(), "together with this one")
                    .with_help(help);
                self.builder.problems.push(problem);
                None
            }
        }
    }

    /// The action on an advected parameter: an expression, or a representation of the algebra of the velocities, `ad`
    /// and `coad` being the adjoint and the coadjoint one.
    pub(super) fn action_on(&mut self, name: &Name, action: &Expr) -> Option<Value> {
        let Some(expr) = self.as_representation(action) else { return self.eval(action) };
        let Some((algebra, _)) = self.builder.algebra.clone() else {
            if !self.builder.broken.contains("velocity") {
                let help = "declare them: `velocity xi in so(3);`";
                self.problem(action.span, "the model has no velocities in an algebra", help);
            }
            return None;
        };
        let r = self.representation(&expr, &algebra)?;
        let value = self.builder.values.get(&name.text)?.clone();
        if value.entries().len() != r.dim() {
            let message = format!(
                "`{}` has {} components, the representation acts on R^{}",
                name.text,
                value.entries().len(),
                r.dim()
            );
            self.problem(
                action.span,
                message,
                "an advected parameter lives in the space of its representation",
            );
            return None;
        }
        let mut terms = vec![Vec::new(); r.dim()];
        for (a, velocity) in self.builder.velocities.iter().enumerate() {
            let xi = self.builder.graph.sym(velocity.symbol);
            for (i, list) in terms.iter_mut().enumerate() {
                let row = r.matrix(a).row(i).iter().zip(value.entries());
                for (q, x) in row.filter(|(q, _)| !q.is_zero()) {
                    let product = self.builder.graph.mul(xi, *x);
                    list.push(self.builder.graph.weighted(product, q));
                }
            }
        }
        let mut entries = terms.iter().map(|list| self.builder.graph.linear_combination(list));
        Some(match value {
            Value::Scalar(_) => Value::Scalar(entries.next()?),
            _ => Value::Vector(entries.collect()),
        })
    }

    /// The representation that an expression is the name of, or its dual; names of values come first.
    fn as_representation(&self, expr: &Expr) -> Option<AlgebraExpr> {
        let node = match &expr.node {
            Node::Name(name) if name == "ad" => AlgebraNode::Name("adjoint".into()),
            Node::Name(name) if name == "coad" => AlgebraNode::Name("coadjoint".into()),
            Node::Name(name) if self.builder.values.contains_key(name) => return None,
            Node::Name(name) => {
                let is_known = BUILT_IN.contains(&name.as_str()) || self.representations.contains_key(name);
                AlgebraNode::Name(is_known.then(|| name.clone())?)
            }
            Node::Call(name, arguments) if name.text == "dual" => {
                AlgebraNode::Call(name.clone(), vec![self.as_representation(arguments.first()?)?])
            }
            _ => return None,
        };
        Some(AlgebraExpr { node, span: expr.span })
    }
}
