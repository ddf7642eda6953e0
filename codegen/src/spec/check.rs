//! Syntax tree to model: order of definitions, names, values; the rest is the builder's.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::Zero;

use super::ast::{
    self, AlgebraExpr, AlgebraNode, Comparison, DomainExpr, Expr, File, Item, ItemKind, Name, Node,
    ReconstructWay,
};
use super::builder::{Group, Layout, ModelBuilder, Placement, component_help};
use super::diagnostic::{Diagnostic, Diagnostics, Origin, Span};
use super::eval::{Evaluator, is_poisoned};
use super::model::{ConnectionKind, Domain, Model, Side};
use super::names;
use super::parser::{MAX_DIM, Outcome};
use super::unused;
use super::value::{Shape, Value};
use crate::algebra::{LieAlgebra, Matrix, Representation};
use crate::error::Error;
use crate::expr::{Budget, ExprId, Rational, SymbolId};

/// Entries of the matrices of one representation.
const MAX_REPRESENTATION: usize = 150_000;
/// Multiplications in the check of a representation given by matrices.
const MAX_REPRESENTATION_WORK: usize = 100_000_000;
/// Largest basis of an algebra given by brackets: Jacobi is checked on every triple.
const MAX_BASIS: usize = 80;
/// Largest abelian algebra, for the same reason.
const MAX_ABELIAN: usize = 100;

/// Checks what the parser understood.
pub(super) fn check(outcome: Outcome, origin: Origin, budget: Budget) -> Result<Model, Diagnostics> {
    let Some(file) = outcome.file else { return Err(Diagnostics::new(Some(origin), outcome.problems)) };
    let mut checker = Checker {
        text: &origin.text,
        builder: ModelBuilder::new(&file.name.text),
        weights: BTreeMap::new(),
        poisoned: outcome.poisoned,
        is_spent: false,
        withheld: BTreeSet::new(),
        algebras: BTreeMap::new(),
        representations: BTreeMap::new(),
    };
    checker.builder.budget(budget);
    checker.builder.problems = outcome.problems;
    for (keyword, _) in names::ITEMS {
        if checker.poisoned.contains(*keyword) {
            checker.builder.broken.insert(keyword);
        }
    }
    checker.run(&file);
    let mut model = checker.builder.build_with(Some(origin.clone()))?;
    // Beside errors they would be noise: a name that is misspelt once is unused as well.
    model.warnings = model.diagnostics(unused::warnings(&file.items));
    Ok(model)
}

struct Checker<'a> {
    text: &'a str,
    builder: ModelBuilder,
    weights: BTreeMap<String, u64>,
    poisoned: BTreeSet<String>,
    is_spent: bool,
    /// Names of reconstructed coordinates; they have values only when everything else is done.
    withheld: BTreeSet<String>,
    algebras: BTreeMap<String, LieAlgebra>,
    /// Representations with the algebra they belong to.
    representations: BTreeMap<String, (LieAlgebra, Representation)>,
}

impl Checker<'_> {
    fn problem(&mut self, span: Span, message: impl Into<String>, help: impl Into<String>) {
        self.builder.problems.push(Diagnostic::new(Some(span), message).with_help(help));
    }

    fn run(&mut self, file: &File) {
        for line in &file.doc {
            self.builder.doc(line);
        }
        self.builder.place = Some(file.name.span);
        if let Some(reason) = names::refusal(&file.name.text) {
            self.problem(file.name.span, format!("`{}` cannot be used as a name", file.name.text), reason);
            // The builder would say the same without a place.
            self.builder.rename("model_");
        }
        self.declare_sources_and_params(&file.items);
        self.define_algebras(&file.items);
        self.declare_variables(&file.items);
        self.withhold(&file.items);
        self.define_lets(&file.items);
        for item in &file.items {
            self.use_values(item);
        }
        for item in &file.items {
            self.reconstruct(item);
        }
        for item in &file.items {
            let ItemKind::Initial { name, value } = &item.kind else { continue };
            match self.eval(value) {
                Some(value) => _ = self.builder.at(Some(name.span)).initial(&name.text, &value),
                None => _ = self.builder.broken.insert("initial"),
            }
        }
        // What figures show lives in a graph of its own, so that it leaves no trace in generated code.
        if items_have_views(&file.items) {
            self.builder.begin_views();
            for item in &file.items {
                self.view(item);
            }
            self.builder.end_views();
        }
    }

    fn slice(&self, span: Span) -> &str {
        self.text.get(span.start..span.end).unwrap_or("")
    }

    /// Source text of an item on one line.
    fn one_line(&self, span: Span) -> String {
        let text = self.slice(span);
        if text.contains("//") || text.contains("/*") {
            // Comments would end up in generated text.
            let kept: Vec<&str> = text.lines().map(|l| l.split("//").next().unwrap_or("")).collect();
            return kept.join(" ").split_whitespace().collect::<Vec<_>>().join(" ");
        }
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    fn eval(&mut self, expr: &Expr) -> Option<Value> {
        self.eval_with(expr, None)
    }

    /// Both sides of an equation in which `delta` or `ddt` is legal.
    fn equation(&mut self, function: &'static str, left: &Expr, right: &Expr) -> Option<(Value, Value)> {
        // Most constraints contain no accelerations and need no symbols for them.
        let table = match function {
            _ if !calls(left, function) && !calls(right, function) => BTreeMap::new(),
            "delta" => self.builder.displacement_table(),
            _ => self.builder.acceleration_table(),
        };
        let operator = Some((function, &table));
        let (left, right) = (self.eval_with(left, operator), self.eval_with(right, operator));
        Some((left?, right?))
    }

    fn eval_with(
        &mut self,
        expr: &Expr,
        operator: Option<(&'static str, &BTreeMap<ExprId, ExprId>)>,
    ) -> Option<Value> {
        let mut evaluator = Evaluator {
            graph: &mut self.builder.graph,
            values: &self.builder.values,
            weights: &self.weights,
            poisoned: &self.poisoned,
            problems: &mut self.builder.problems,
            is_spent: &mut self.is_spent,
            restriction: None,
            operator,
            withheld: &self.withheld,
        };
        evaluator.eval(expr).map(|(value, _)| value)
    }

    /// Coordinates are declared before definitions, so only parameters are known here.
    fn interval_end(&mut self, expr: &Expr) -> Option<ExprId> {
        let mut evaluator = Evaluator {
            graph: &mut self.builder.graph,
            values: &self.builder.values,
            weights: &self.weights,
            poisoned: &self.poisoned,
            problems: &mut self.builder.problems,
            is_spent: &mut self.is_spent,
            restriction: Some("the ends of an interval contain parameters and numbers only"),
            operator: None,
            withheld: &self.withheld,
        };
        let (value, _) = evaluator.eval(expr)?;
        match value {
            Value::Scalar(e) => Some(e),
            _ => {
                let message = format!("the end of an interval must be a number, found {}", value.shape());
                self.problem(expr.span, message, "index the vector, as in `v[1]`");
                None
            }
        }
    }

    /// A value without names, in a graph of its own.
    fn constant(&mut self, expr: &Expr, restriction: &'static str) -> Option<Vec<Rational>> {
        let mut graph = self.builder.graph.fork();
        let pi = Value::Scalar(graph.pi());
        let mut evaluator = Evaluator {
            graph: &mut graph,
            values: &BTreeMap::from([("pi".to_owned(), pi)]),
            weights: &BTreeMap::new(),
            poisoned: &BTreeSet::new(),
            problems: &mut self.builder.problems,
            is_spent: &mut self.is_spent,
            restriction: Some(restriction),
            operator: None,
            withheld: &BTreeSet::new(),
        };
        let value = evaluator.eval(expr);
        self.builder.graph.take_over(&graph);
        let (value, _) = value?;
        let numbers: Option<Vec<Rational>> =
            value.entries().iter().map(|e| graph.as_rational(*e).cloned()).collect();
        if numbers.is_none() {
            let decimals: Vec<String> = (value.entries().iter().take(12))
                .filter_map(|e| graph.eval_f64(*e, &BTreeMap::new()))
                .filter(|x| x.is_finite())
                .map(|x| x.to_string())
                .collect();
            let help = match (value.shape(), decimals.as_slice()) {
                (Shape::Scalar, [number]) => format!("write it in decimals: `{number}`"),
                (Shape::Vector(n), list) if list.len() == n => {
                    format!("write it in decimals: `[{}]`", list.join(", "))
                }
                _ => "write it in decimals, such as `0.785398`".to_owned(),
            };
            self.problem(expr.span, "the value is not a rational number", help);
        }
        numbers
    }

    // Parameters.

    fn declare_sources_and_params(&mut self, items: &[Item]) {
        for item in items {
            match &item.kind {
                ItemKind::Source(text) => {
                    self.builder.source(text);
                }
                ItemKind::Param { name, shape, default, .. } => {
                    self.declare_param(item, name, shape, default.as_ref())
                }
                _ => {}
            }
        }
    }

    fn declare_param(&mut self, item: &Item, name: &Name, shape: &ast::Shape, default: Option<&Expr>) {
        let layout = match shape {
            ast::Shape::Scalar => None,
            ast::Shape::Vector(n) => Some(Layout::Vector(n.value)),
            ast::Shape::Diagonal(n) => Some(Layout::Diagonal(n.value)),
            ast::Shape::Symmetric(n) => Some(Layout::Symmetric(n.value)),
            ast::Shape::Matrix(n, m) => Some(Layout::Matrix(n.value, m.value)),
        };
        let component_names = layout.map_or_else(|| vec![name.text.clone()], |l| l.names(&name.text));
        let n = component_names.len();
        let numbers = match default {
            Some(expr) => self.constant(expr, "defaults are numbers").and_then(|numbers| {
                if numbers.len() == n && (layout.is_none() == !matches!(expr.node, Node::List(_))) {
                    return Some(numbers);
                }
                let message = match layout {
                    None => format!("parameter `{}` is a number, its default is a list", name.text),
                    Some(_) => format!("`{}` has {n} components, its default {}", name.text, numbers.len()),
                };
                let help = match layout {
                    None => format!(
                        "declare it as a vector: `param {}: vector({}) = ..`",
                        name.text,
                        numbers.len()
                    ),
                    Some(_) => component_help(&component_names),
                };
                self.problem(expr.span, message, help);
                None
            }),
            None => {
                let help =
                    if n == 1 { "write `= 1.0`" } else { "write `= [..]` with the components in order" };
                self.problem(name.span, format!("parameter `{}` has no default", name.text), help);
                None
            }
        };
        // Conditions would be checked against a wrong default.
        if numbers.is_none() {
            self.poisoned.insert(name.text.clone());
        }
        let numbers = numbers.unwrap_or_else(|| vec![Rational::zero(); n]);
        let doc = item.doc.join("\n");
        self.builder.at(Some(name.span));
        match layout {
            None => {
                self.builder.param(&name.text, numbers.first().cloned().unwrap_or_else(Rational::zero), &doc)
            }
            Some(layout) => self.builder.param_array(&name.text, layout, &numbers, &doc),
        };
    }

    // Algebras.

    fn define_algebras(&mut self, items: &[Item]) {
        let mut nodes: Vec<(&Name, &Item, Vec<String>)> = Vec::new();
        for item in items {
            let (name, used) = match &item.kind {
                ItemKind::AlgebraName { name, value } => (name, algebra_names(value)),
                ItemKind::AlgebraBrackets { name, .. } => (name, Vec::new()),
                ItemKind::Representation { name, algebra, .. } => (name, algebra_names(algebra)),
                _ => continue,
            };
            nodes.push((name, item, used));
        }
        let mut index: BTreeMap<&str, usize> = BTreeMap::new();
        for (k, (name, ..)) in nodes.iter().enumerate() {
            let reserved = [BUILT_IN, FAMILIES].iter().any(|names| names.contains(&name.text.as_str()));
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
            ItemKind::AlgebraBrackets { basis, rules, .. } => {
                match self.bracket_algebra(name, basis, rules) {
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

    /// Linear combinations of names with rational coefficients.
    fn combination(&mut self, expr: &Expr, basis: &[Name]) -> Option<Vec<(usize, Rational)>> {
        let mut graph = self.builder.graph.fork();
        let mut values = BTreeMap::new();
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
            operator: None,
            withheld: &BTreeSet::new(),
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
                        Some((at, graph.as_rational(slope)?.clone()))
                    })
                    .collect::<Option<Vec<_>>>()
            });
        if combination.is_none() {
            self.problem(
                expr.span,
                "expected a rational combination of basis elements",
                "for example `2*e1 - e3`, or `0`",
            );
        }
        combination
    }

    fn bracket_algebra(
        &mut self,
        name: &Name,
        basis: &[Name],
        rules: &[ast::BracketRule],
    ) -> Option<LieAlgebra> {
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
        match LieAlgebra::from_brackets(&name.text, names, &brackets) {
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
        algebra: &LieAlgebra,
        dim: usize,
        matrices: &[(Name, Expr)],
    ) -> Option<Representation> {
        let n = algebra.dim();
        if n * n * dim * dim * dim > MAX_REPRESENTATION_WORK || n * dim * dim > MAX_REPRESENTATION {
            let message = format!("representation `{}` is too large", name.text);
            self.problem(name.span, message, format!("{n} matrices of size {dim}"));
            return None;
        }
        let mut table: Vec<Option<Matrix>> = vec![None; n];
        let mut fine = true;
        for (element, expr) in matrices {
            let numbers = self.constant(expr, "entries are numbers");
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
            let rows: Vec<Vec<Rational>> = numbers.chunks(dim.max(1)).map(<[Rational]>::to_vec).collect();
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

    fn algebra(&mut self, expr: &AlgebraExpr) -> Option<LieAlgebra> {
        let span = expr.span;
        let (name, arguments) = match &expr.node {
            AlgebraNode::Number(_) => {
                self.problem(span, "expected an algebra, found a number", "for example `so(3)` or `R^3`");
                return None;
            }
            AlgebraNode::Power(n) if *n > MAX_ABELIAN => {
                self.problem(span, format!("R^{n} is too large"), format!("the largest is R^{MAX_ABELIAN}"));
                return None;
            }
            AlgebraNode::Power(n) => return Some(LieAlgebra::abelian(*n)),
            AlgebraNode::Name(name) => {
                if name == "R" {
                    return Some(LieAlgebra::abelian(1));
                }
                if let Some(algebra) = self.algebras.get(name) {
                    return Some(algebra.clone());
                }
                if is_poisoned(name, &self.poisoned) {
                    return None;
                }
                let message = if FAMILIES.contains(&name.as_str())
                    || ["product", "semidirect"].contains(&name.as_str())
                {
                    self.problem(
                        span,
                        format!("`{name}` needs arguments"),
                        format!(
                            "for example `{name}({})`",
                            match name.as_str() {
                                "product" => "so(3), R^3",
                                "semidirect" => "so(3), standard",
                                _ => "3",
                            }
                        ),
                    );
                    return None;
                } else if self.representations.contains_key(name) {
                    format!("`{name}` is a representation, not an algebra")
                } else {
                    format!("unknown algebra `{name}`")
                };
                let help = self.algebra_help(name);
                self.problem(span, message, help);
                return None;
            }
            AlgebraNode::Call(name, arguments) => (name, arguments),
        };
        match name.text.as_str() {
            "product" => {
                if arguments.is_empty() {
                    self.problem(span, "`product` of nothing", "write `product(so(3), R^3)`");
                    return None;
                }
                let factors: Vec<Option<LieAlgebra>> = arguments.iter().map(|a| self.algebra(a)).collect();
                let factors: Vec<LieAlgebra> = factors.into_iter().collect::<Option<_>>()?;
                self.check_dim(span, factors.iter().map(LieAlgebra::dim).sum())?;
                Some(LieAlgebra::product(&factors))
            }
            "semidirect" => {
                let Some((base, spaces)) = arguments.split_first().filter(|(_, spaces)| !spaces.is_empty())
                else {
                    self.problem(
                        span,
                        "`semidirect` takes an algebra and its representations",
                        "for example `semidirect(so(3), standard)`",
                    );
                    return None;
                };
                let base = self.algebra(base)?;
                let spaces: Vec<Option<Representation>> =
                    spaces.iter().map(|s| self.representation(s, &base)).collect();
                let spaces: Vec<Representation> = spaces.into_iter().collect::<Option<_>>()?;
                self.check_dim(span, base.dim() + spaces.iter().map(Representation::dim).sum::<usize>())?;
                match LieAlgebra::semidirect(&base, &spaces) {
                    Ok(algebra) => Some(algebra),
                    Err(error) => {
                        self.builder.error(Some(span), &error);
                        None
                    }
                }
            }
            family if FAMILIES.contains(&family) => {
                let [AlgebraExpr { node: AlgebraNode::Number(n), .. }] = arguments.as_slice() else {
                    self.problem(
                        span,
                        format!("`{family}` takes one number"),
                        format!("for example `{family}(3)`"),
                    );
                    return None;
                };
                self.named_algebra(family, *n, span)
            }
            other => {
                let help = self.algebra_help(other);
                self.problem(name.span, format!("unknown algebra `{other}`"), help);
                None
            }
        }
    }

    fn named_algebra(&mut self, family: &str, n: usize, span: Span) -> Option<LieAlgebra> {
        // Their structure constants come from an elimination that grows with the sixth power of n.
        let largest = match family {
            "so" | "se" => 10,
            "heisenberg" => 14,
            _ => 8,
        };
        if n > largest {
            self.problem(
                span,
                format!("{family}({n}) is too large"),
                format!("the largest is {family}({largest})"),
            );
            return None;
        }
        let algebra = match family {
            "so" => LieAlgebra::so(n),
            "se" => LieAlgebra::se(n),
            "su" => LieAlgebra::su(n),
            "gl" => LieAlgebra::gl(n),
            "sl" => LieAlgebra::sl(n),
            _ => LieAlgebra::heisenberg(n),
        };
        match algebra {
            Ok(algebra) => Some(algebra),
            Err(error) => {
                self.builder.error(Some(span), &error);
                None
            }
        }
    }

    fn check_dim(&mut self, span: Span, dim: usize) -> Option<()> {
        if dim <= MAX_DIM {
            return Some(());
        }
        self.problem(span, format!("algebra of dimension {dim}, the limit is {MAX_DIM}"), "");
        None
    }

    fn algebra_help(&self, name: &str) -> String {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
        if FAMILIES.contains(&stem) && stem.len() < name.len() {
            return format!("did you mean `{stem}({})`?", &name[stem.len()..]);
        }
        let mut known: Vec<&str> =
            vec!["so", "se", "su", "gl", "sl", "heisenberg", "R", "product", "semidirect"];
        known.extend(self.algebras.keys().map(String::as_str));
        names::suggest(name, known)
    }

    fn representation(&mut self, expr: &AlgebraExpr, algebra: &LieAlgebra) -> Option<Representation> {
        let span = expr.span;
        let n = algebra.dim();
        let adjoint_fits = n * n * n <= MAX_REPRESENTATION;
        match &expr.node {
            AlgebraNode::Name(name) => {
                match name.as_str() {
                    "standard" => {
                        match Representation::standard(algebra) {
                            Some(r) => Some(r),
                            None => {
                                let message = format!("`standard` does not exist for {}", algebra.name());
                                self.problem(span, message, "so(n), gl(n), sl(n) and su(n) have one; give yours with `representation`");
                                None
                            }
                        }
                    }
                    "adjoint" | "coadjoint" if !adjoint_fits => {
                        self.problem(span, format!("`{name}` of {} is too large", algebra.name()), "");
                        None
                    }
                    "adjoint" => Some(Representation::adjoint(algebra)),
                    "coadjoint" => Some(Representation::coadjoint(algebra)),
                    _ => self.named_representation(name, algebra, span),
                }
            }
            AlgebraNode::Call(name, arguments) => match (name.text.as_str(), arguments.as_slice()) {
                ("dual", [inner]) => self.representation(inner, algebra).map(|r| r.dual()),
                ("trivial", [AlgebraExpr { node: AlgebraNode::Number(dim), .. }]) => {
                    if dim * dim * n > MAX_REPRESENTATION {
                        self.problem(span, "trivial representation is too large", "");
                        return None;
                    }
                    Some(Representation::trivial(algebra, *dim))
                }
                ("dual", _) => {
                    self.problem(span, "`dual` takes one representation", "for example `dual(standard)`");
                    None
                }
                ("trivial", _) => {
                    self.problem(span, "`trivial` takes one number", "for example `trivial(3)`");
                    None
                }
                (other, _) => {
                    let help = names::suggest(other, ["standard", "adjoint", "coadjoint", "dual", "trivial"]);
                    self.problem(span, format!("unknown representation `{other}`"), help);
                    None
                }
            },
            _ => {
                self.problem(span, "expected a representation", "for example `standard` or `trivial(3)`");
                None
            }
        }
    }

    fn named_representation(
        &mut self,
        name: &str,
        algebra: &LieAlgebra,
        span: Span,
    ) -> Option<Representation> {
        if let Some((owner, r)) = self.representations.get(name) {
            if owner == algebra {
                return Some(r.clone());
            }
            let message = format!("`{name}` represents {}, not {}", owner.name(), algebra.name());
            self.problem(span, message, "declare a representation of this algebra");
            return None;
        }
        if !is_poisoned(name, &self.poisoned) {
            let mut known = vec!["standard", "adjoint", "coadjoint", "dual", "trivial"];
            known.extend(self.representations.keys().map(String::as_str));
            let help = names::suggest(name, known);
            self.problem(span, format!("unknown representation `{name}`"), help);
        }
        None
    }

    // Variables.

    fn declare_variables(&mut self, items: &[Item]) {
        for item in items {
            match &item.kind {
                ItemKind::Velocity { names, algebra } => self.declare_velocities(item, names, algebra),
                ItemKind::QuasiVelocity(names) => {
                    for name in names {
                        self.builder.at(Some(name.span)).quasi_velocity(&name.text, &item.doc.join("\n"));
                    }
                }
                ItemKind::Coordinate { names, shape, domain } => {
                    self.declare_coordinates(item, names, shape, domain)
                }
                ItemKind::Advected { name, dim, .. } => {
                    self.builder.at(Some(name.span));
                    self.builder.advected(&name.text, dim.map(|d| d.value), &item.doc.join("\n"));
                }
                _ => {}
            }
        }
    }

    fn declare_velocities(&mut self, item: &Item, names: &[Name], algebra: &AlgebraExpr) {
        let Some(algebra) = self.algebra(algebra) else {
            self.builder.broken.insert("velocity");
            self.poisoned.extend(names.iter().map(|n| n.text.clone()));
            return;
        };
        let located: Vec<(&str, Option<Span>)> =
            names.iter().map(|n| (n.text.as_str(), Some(n.span))).collect();
        let span = names.first().map_or(item.span, |n| n.span).to(names.last().map_or(item.span, |n| n.span));
        let before = self.builder.problems.len();
        self.builder.at(Some(span)).located_velocities(algebra, &located, &item.doc.join("\n"));
        if self.builder.problems.len() > before {
            // The wrong number of names: their components are unknown.
            self.builder.broken.insert("velocity");
            for name in names {
                self.builder.values.remove(&name.text);
                self.poisoned.insert(name.text.clone());
            }
        }
    }

    fn declare_coordinates(&mut self, item: &Item, names: &[Name], shape: &ast::Shape, domain: &DomainExpr) {
        let domain = match domain {
            DomainExpr::Angle => Domain::Angle,
            DomainExpr::Real => Domain::Real,
            DomainExpr::Interval(low, high) => {
                self.builder.at(Some(low.span.to(high.span)));
                let ends = (self.interval_end(low), self.interval_end(high));
                match ends {
                    (Some(low), Some(high)) => Domain::Interval(low, high),
                    _ => Domain::Real,
                }
            }
        };
        let doc = item.doc.join("\n");
        for name in names {
            self.builder.at(Some(name.span));
            match shape {
                ast::Shape::Scalar => {
                    self.builder.coordinate(&name.text, domain, &doc);
                }
                ast::Shape::Vector(n) => {
                    self.builder.coordinate_vector(&name.text, n.value, domain, &doc);
                }
                _ => {
                    let message = format!("coordinate `{}` must be a number or a vector", name.text);
                    self.problem(name.span, message, "write `coordinate x: vector(3) in real;`");
                    self.poisoned.insert(name.text.clone());
                }
            }
        }
    }

    // Definitions.

    fn define_lets(&mut self, items: &[Item]) {
        let mut lets: Vec<(&Name, &Expr)> = Vec::new();
        let mut index: BTreeMap<&str, usize> = BTreeMap::new();
        for item in items {
            let ItemKind::Let { name, value } = &item.kind else { continue };
            if self.builder.at(Some(name.span)).declare(&name.text, "a definition") {
                index.insert(&name.text, lets.len());
                lets.push((name, value));
            } else {
                self.poisoned.insert(name.text.clone());
            }
        }
        let uses: Vec<Vec<usize>> = lets
            .iter()
            .map(|(_, value)| names_in(value).into_iter().filter_map(|n| index.get(n).copied()).collect())
            .collect();
        let (order, cycles) = order_by_use(&uses);
        for cycle in cycles {
            let described = describe_cycle(&cycle, |k| &lets[k].0.text);
            let mut problem =
                Diagnostic::new(Some(lets[cycle[0]].0.span), format!("definition in a circle: {described}"));
            for k in cycle.iter().skip(1).take(4) {
                problem = problem.with_place(Some(lets[*k].0.span), "part of the circle");
            }
            self.builder.problems.push(problem.with_help("define one of them without the others"));
            self.poisoned.extend(cycle.iter().map(|k| lets[*k].0.text.clone()));
        }
        for k in order {
            let (name, expr) = lets[k];
            if self.poisoned.contains(&name.text) {
                continue;
            }
            let mut evaluator = Evaluator {
                graph: &mut self.builder.graph,
                values: &self.builder.values,
                weights: &self.weights,
                poisoned: &self.poisoned,
                problems: &mut self.builder.problems,
                is_spent: &mut self.is_spent,
                restriction: None,
                operator: None,
                withheld: &self.withheld,
            };
            match evaluator.eval(expr) {
                Some((value, bits)) => {
                    self.builder.bind(&name.text, &value);
                    self.weights.insert(name.text.clone(), bits);
                }
                None => {
                    self.poisoned.insert(name.text.clone());
                }
            }
        }
    }

    // Everything that uses values.

    fn use_values(&mut self, item: &Item) {
        let span = Some(item.span);
        match &item.kind {
            ItemKind::Param { name, conditions, .. } => {
                if !self.poisoned.contains(&name.text) {
                    conditions.iter().for_each(|c| self.condition(c));
                }
            }
            ItemKind::Require(conditions) => conditions.iter().for_each(|c| self.condition(c)),
            ItemKind::Action(side) => match side.text.as_str() {
                "left" => _ = self.builder.at(Some(side.span)).action(Side::Left),
                "right" => _ = self.builder.at(Some(side.span)).action(Side::Right),
                other => {
                    let help = names::suggest(other, ["left", "right"]);
                    self.problem(side.span, format!("unknown side `{other}`"), help);
                }
            },
            ItemKind::Stage { name, ideal } => {
                let Some(ideal) = ideal else {
                    self.builder.at(Some(name.span)).stage(&name.text);
                    return;
                };
                let values: Vec<Option<Value>> = ideal.iter().map(|e| self.eval(e)).collect();
                match values.into_iter().collect::<Option<Vec<Value>>>() {
                    Some(values) => _ = self.builder.at(span).stage_ideal(&name.text, &values),
                    None => _ = self.builder.broken.insert("stage"),
                }
            }
            ItemKind::InnerProduct(expr) => {
                if let Some(value) = self.eval(expr) {
                    self.builder.at(Some(expr.span)).inner_product(&value);
                }
            }
            ItemKind::Advected { name, action, .. } => match self.eval(action) {
                Some(value) => _ = self.builder.at(Some(action.span)).advected_action(&name.text, &value),
                None => _ = self.builder.broken.insert("advected"),
            },
            ItemKind::Lagrangian(expr) => match self.eval(expr) {
                Some(value) => _ = self.builder.at(Some(expr.span)).lagrangian(&value),
                None => _ = self.builder.broken.insert("lagrangian"),
            },
            ItemKind::Constraint { name, left, right } => match self.equation("ddt", left, right) {
                Some((l, r)) => {
                    let place = left.span.to(right.span);
                    let text = self.one_line(place);
                    let name = name.as_ref().map(|n| n.text.as_str());
                    self.builder.at(Some(place)).constraint(name, &text, &l, &r);
                }
                None => _ = self.builder.broken.insert("constraint"),
            },
            ItemKind::Virtual { name, left, right } => match self.equation("delta", left, right) {
                Some((l, r)) => {
                    let place = left.span.to(right.span);
                    let text = self.one_line(place);
                    let name = name.as_ref().map(|n| n.text.as_str());
                    self.builder.at(Some(place)).virtual_constraint(name, &text, &l, &r);
                }
                None => _ = self.builder.broken.insert("virtual"),
            },
            ItemKind::Connection { name, value } => match self.eval(value) {
                Some(value) => _ = self.builder.at(Some(name.span)).connection(&name.text, &value),
                None => _ = self.builder.broken.insert("connection"),
            },
            ItemKind::DerivedConnection(name) => {
                if let Some(kind) = ConnectionKind::from_name(&name.text) {
                    self.builder.at(Some(name.span)).derived_connection(kind);
                }
            }
            ItemKind::Independent(names) => {
                let located = names.iter().map(|n| (n.text.clone(), Some(n.span))).collect();
                self.builder.at(span).located_independent(located);
            }
            ItemKind::Multipliers => _ = self.builder.at(span).multipliers(),
            ItemKind::Force { name, value } => {
                if let Some(value) = self.eval(value) {
                    self.builder.at(Some(name.span)).force(&name.text, &value);
                }
            }
            ItemKind::Casimir { name, value } => match self.eval(value) {
                Some(Value::Scalar(e)) => {
                    self.builder.at(Some(name.span)).casimir(
                        &name.text,
                        &Value::Scalar(e),
                        &item.doc.join("\n"),
                    );
                }
                Some(other) => {
                    let message =
                        format!("casimir `{}` must be a number, found {}", name.text, other.shape());
                    self.problem(value.span, message, "use `dot(a, b)` for the pairing of vectors");
                    self.builder.broken.insert("casimir");
                }
                None => _ = self.builder.broken.insert("casimir"),
            },
            ItemKind::Output { name, value } => match self.eval(value) {
                Some(value) => {
                    _ = self.builder.at(Some(name.span)).output(&name.text, &value, &item.doc.join("\n"))
                }
                None => _ = self.builder.broken.insert("output"),
            },
            ItemKind::Scene { name, fixed, wants, drops, circles } => {
                self.scene(item, name, fixed, [wants, drops, circles]);
            }
            ItemKind::Source(_)
            | ItemKind::Let { .. }
            | ItemKind::AlgebraName { .. }
            | ItemKind::AlgebraBrackets { .. }
            | ItemKind::Representation { .. }
            | ItemKind::Velocity { .. }
            | ItemKind::QuasiVelocity(_)
            | ItemKind::Reconstruct { .. }
            | ItemKind::Initial { .. }
            | ItemKind::View { .. }
            | ItemKind::Coordinate { .. } => {}
        }
    }

    fn condition(&mut self, comparison: &Comparison) {
        let sides: Vec<&Expr> =
            std::iter::once(&comparison.first).chain(comparison.rest.iter().map(|(_, e)| e)).collect();
        let values: Vec<Option<Value>> = sides.iter().map(|e| self.eval(e)).collect();
        let Some(values) = values.into_iter().collect::<Option<Vec<Value>>>() else { return };
        // A default that is already reported must not be compared.
        if sides.iter().any(|e| names_in(e).into_iter().any(|n| is_poisoned(n, &self.poisoned))) {
            return;
        }
        for (k, (compare, _)) in comparison.rest.iter().enumerate() {
            let span = sides[k].span.to(sides[k + 1].span);
            let text = self.one_line(span);
            self.builder.at(Some(span)).condition(&text, &values[k], *compare, &values[k + 1]);
        }
    }

    // Reconstruction.

    /// Nothing but reconstruction itself sees reconstructed coordinates.
    fn withhold(&mut self, items: &[Item]) {
        for item in items {
            let ItemKind::Reconstruct { names, way } = &item.kind else { continue };
            let plain: Vec<&str> = names.iter().map(|n| n.text.as_str()).collect();
            self.withheld.extend(plain.iter().map(|n| (*n).to_owned()));
            if let ReconstructWay::Group { group, .. } = way
                && let Some(components) = group_of(group).and_then(|group| group.coordinates(&plain))
            {
                self.withheld.extend(components.into_iter().flatten());
            }
        }
    }

    fn reconstruct(&mut self, item: &Item) {
        let ItemKind::Reconstruct { names, way } = &item.kind else { return };
        let located: Vec<(&str, Option<Span>)> =
            names.iter().map(|n| (n.text.as_str(), Some(n.span))).collect();
        let span = names.first().map_or(item.span, |n| n.span).to(names.last().map_or(item.span, |n| n.span));
        let doc = item.doc.join("\n");
        let before = self.builder.problems.len();
        match way {
            ReconstructWay::Rate(rate) => {
                if let Some(rate) = self.eval(rate) {
                    self.builder.at(Some(span)).located_rate(&located, &rate, &doc);
                }
            }
            ReconstructWay::Group { group, from } => match group_of(group) {
                Some(group) => {
                    let from = from.iter().map(|n| (n.text.clone(), Some(n.span))).collect();
                    self.builder.at(Some(span)).located_group(&located, group, from, &doc);
                }
                None => {
                    let written = self.one_line(group.span);
                    let mut known = Group::NAMED.iter().map(|(name, _)| *name);
                    // `SU(2)` is one letter from `SE(2)` and another group: only the case is a slip.
                    let help = match known.clone().find(|name| name.eq_ignore_ascii_case(&written)) {
                        Some(name) => format!("did you mean `{name}`?"),
                        None => format!(
                            "legal here: {}",
                            names::list(&known.by_ref().chain(["R^n"]).collect::<Vec<_>>())
                        ),
                    };
                    self.problem(group.span, format!("unknown group `{written}`"), help);
                }
            },
        }
        if self.builder.problems.len() > before {
            self.builder.broken.insert("reconstruct");
            self.poisoned.extend(names.iter().map(|n| n.text.clone()));
        }
    }

    /// Everything of the model is known where a view is evaluated.
    fn view(&mut self, item: &Item) {
        let ItemKind::View { name, shape, arguments, around, at, attitude } = &item.kind else { return };
        let arguments: Vec<Option<_>> = arguments.iter().map(|e| self.located(e)).collect();
        let mut is_complete = true;
        let [around, at, attitude] = [around, at, attitude].map(|part| {
            let value = self.located(part.as_ref()?);
            is_complete &= value.is_some();
            value
        });
        let Some(arguments) = arguments.into_iter().collect::<Option<Vec<_>>>().filter(|_| is_complete)
        else {
            return;
        };
        let shape = (shape.text.as_str(), Some(shape.span));
        let placement = Placement { around, at, attitude };
        let doc = item.doc.join("\n");
        self.builder.at(Some(name.span)).located_view(&name.text, shape, &arguments, placement, &doc);
    }

    fn located(&mut self, expr: &Expr) -> Option<(Value, Option<Span>)> {
        Some((self.eval(expr)?, Some(expr.span)))
    }

    /// `lists`: outputs wanted, coordinates left out, angles carried as points of the circle.
    fn scene(&mut self, item: &Item, name: &Name, fixed: &[(Name, Expr)], lists: [&[Name]; 3]) {
        let mut numbers = Vec::new();
        for (name, expr) in fixed {
            if let Some(values) = self.constant(expr, "parameters are fixed to numbers")
                && !is_poisoned(&name.text, &self.poisoned)
            {
                numbers.push((name.text.clone(), values, Some(name.span)));
            }
        }
        let located = |names: &[Name]| names.iter().map(|w| (w.text.clone(), Some(w.span))).collect();
        let lists = lists.map(located);
        let doc = item.doc.join("\n");
        let builder = self.builder.at(Some(name.span));
        builder.located_scene(&name.text, numbers, lists, &doc);
    }
}

fn items_have_views(items: &[Item]) -> bool {
    items.iter().any(|item| matches!(item.kind, ItemKind::View { .. }))
}

/// Families of algebras, one for each number.
const FAMILIES: &[&str] = &["so", "se", "su", "gl", "sl", "heisenberg"];

/// Names that algebra definitions cannot take, besides the families.
const BUILT_IN: &[&str] =
    &["R", "product", "semidirect", "standard", "adjoint", "coadjoint", "dual", "trivial"];

/// Names in an algebra expression. Its depth is bounded by the parser.
pub(super) fn algebra_names(expr: &AlgebraExpr) -> Vec<String> {
    match &expr.node {
        AlgebraNode::Name(name) => vec![name.clone()],
        AlgebraNode::Number(_) | AlgebraNode::Power(_) => Vec::new(),
        AlgebraNode::Call(_, arguments) => arguments.iter().flat_map(algebra_names).collect(),
    }
}

fn group_of(expr: &AlgebraExpr) -> Option<Group> {
    match &expr.node {
        AlgebraNode::Name(name) if name == "R" => Some(Group::Translation(1)),
        AlgebraNode::Power(n) => Some(Group::Translation(*n)),
        AlgebraNode::Call(name, arguments) => {
            let [AlgebraExpr { node: AlgebraNode::Number(n), .. }] = arguments.as_slice() else {
                return None;
            };
            let written = format!("{}({n})", name.text);
            Group::NAMED.iter().find(|(known, _)| *known == written).map(|(_, group)| *group)
        }
        _ => None,
    }
}

/// Names in an expression, without function names.
pub(super) fn names_in(expr: &Expr) -> Vec<&str> {
    let mut names = Vec::new();
    for_each_node(expr, |node| {
        if let Node::Name(name) = node {
            names.push(name.as_str());
        }
    });
    names
}

/// Whether an expression calls a function by name.
fn calls(expr: &Expr, function: &str) -> bool {
    let mut found = false;
    for_each_node(expr, |node| found |= matches!(node, Node::Call(name, _) if name.text == function));
    found
}

fn for_each_node<'a>(expr: &'a Expr, mut visit: impl FnMut(&'a Node)) {
    let mut pending = vec![expr];
    while let Some(expr) = pending.pop() {
        visit(&expr.node);
        match &expr.node {
            Node::Number(_) | Node::Name(_) => {}
            Node::Sum(list) | Node::Product(list) => pending.extend(list.iter().map(|(_, e)| e)),
            Node::Neg(inside) => pending.push(inside),
            Node::Power(a, b) => pending.extend([a.as_ref(), b.as_ref()]),
            Node::Call(_, arguments) => pending.extend(arguments),
            Node::Index(base, indices) => {
                pending.push(base);
                pending.extend(indices);
            }
            Node::List(list) => pending.extend(list),
        }
    }
}

/// An order in which everything comes after what it uses, and the cycles that prevent one.
fn order_by_use(uses: &[Vec<usize>]) -> (Vec<usize>, Vec<Vec<usize>>) {
    #[derive(Clone, Copy, PartialEq)]
    enum State {
        New,
        Open,
        Done,
    }
    let mut state = vec![State::New; uses.len()];
    let (mut order, mut cycles) = (Vec::new(), Vec::new());
    for root in 0..uses.len() {
        if state[root] != State::New {
            continue;
        }
        // The path from the root, each with the next use to follow.
        let mut path: Vec<(usize, usize)> = vec![(root, 0)];
        state[root] = State::Open;
        while let Some((node, next)) = path.last_mut() {
            match uses[*node].get(*next) {
                Some(used) => {
                    *next += 1;
                    let used = *used;
                    match state[used] {
                        State::New => {
                            state[used] = State::Open;
                            path.push((used, 0));
                        }
                        State::Open => {
                            let start = path.iter().position(|(n, _)| *n == used).unwrap_or(0);
                            cycles.push(path[start..].iter().map(|(n, _)| *n).collect());
                        }
                        State::Done => {}
                    }
                }
                None => {
                    state[*node] = State::Done;
                    order.push(*node);
                    path.pop();
                }
            }
        }
    }
    (order, cycles)
}

fn describe_cycle<'a>(cycle: &[usize], name: impl Fn(usize) -> &'a String) -> String {
    let mut words: Vec<&str> = cycle.iter().take(8).map(|k| name(*k).as_str()).collect();
    if cycle.len() > 8 {
        words.push("..");
    }
    if let Some(first) = cycle.first() {
        words.push(name(*first));
    }
    words.join(" -> ")
}
