//! The state of an elaboration, and values of expressions in it.
//!
//! Deliberately does not know: which items there are.

use std::collections::{BTreeMap, BTreeSet};

use crate::algebra::{LieAlgebra, Representation};
use crate::spec::ast::Expr;
use crate::spec::builder::ModelBuilder;
use crate::spec::diagnostic::{Diagnostic, Help, Span};
use crate::spec::eval::Evaluator;
use crate::spec::motions::Motions;
use crate::spec::rates::Rates;
use crate::spec::shape::Shape;
use crate::spec::value::Value;
use hamel_expr::{ExprId, Graph, Number, Rational};

pub(super) struct Elaboration<'a> {
    pub(super) text: &'a str,
    pub(super) builder: ModelBuilder,
    pub(super) weights: BTreeMap<String, u64>,
    pub(super) poisoned: BTreeSet<String>,
    pub(super) is_spent: bool,
    /// Where names and numbers of the text stand for others in each turn.
    pub(super) loops: Vec<Span>,
    /// Whether names are declared with an index.
    pub(super) has_families: bool,
    /// Names of reconstructed coordinates; they have values only when everything else is done.
    pub(super) withheld: BTreeSet<String>,
    /// Rotations and places that have been made, as they are known.
    pub(super) motions: Motions,
    /// What is to be told beside values.
    pub(super) warnings: Vec<Diagnostic>,
    pub(super) algebras: BTreeMap<String, LieAlgebra<Number>>,
    /// Representations with the algebra they belong to.
    pub(super) representations: BTreeMap<String, (LieAlgebra<Number>, Representation<Number>)>,
}

impl Elaboration<'_> {
    pub(super) fn problem(&mut self, span: Span, message: impl Into<String>, help: impl Into<Help>) {
        self.builder.problems.push(Diagnostic::new(Some(span), message).with_help(help));
    }

    pub(super) fn slice(&self, span: Span) -> &str {
        self.text.get(span.start..span.end).unwrap_or("")
    }

    /// Source text of an item on one line.
    pub(super) fn one_line(&self, span: Span) -> String {
        let text = self.slice(span);
        if text.contains("//") || text.contains("/*") {
            // Comments would end up in generated text.
            let kept: Vec<&str> = text.lines().map(|l| l.split("//").next().unwrap_or("")).collect();
            return kept.join(" ").split_whitespace().collect::<Vec<_>>().join(" ");
        }
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    /// Whether a place of the text is read otherwise than it stands there: several times, or with names that have an
    /// index.
    pub(super) fn is_read_otherwise(&self, span: Span) -> bool {
        let has_index = self.has_families && self.slice(span).contains('[');
        has_index || self.loops.iter().any(|scope| scope.start <= span.start && span.end <= scope.end)
    }

    /// An equation as it stands in the text, or as a turn of a loop reads it.
    pub(super) fn equation_text(&self, left: &Expr, right: &Expr) -> String {
        let place = left.span.to(right.span);
        if self.is_read_otherwise(place) { format!("{left} = {right}") } else { self.one_line(place) }
    }

    pub(super) fn eval(&mut self, expr: &Expr) -> Option<Value> {
        self.eval_with(expr, &[])
    }

    /// Both sides of an equation in which `functions`, of `delta` and `ddt`, are legal.
    pub(super) fn equation(
        &mut self,
        functions: &[&'static str],
        left: &Expr,
        right: &Expr,
    ) -> Option<(Value, Value)> {
        // Most constraints contain no accelerations and need no symbols for them.
        let mut tables = Vec::new();
        for function in functions {
            let calls = |of: fn(&Expr, &str) -> bool| of(left, function) || of(right, function);
            let table = match *function {
                _ if !calls(Expr::calls) => BTreeMap::new(),
                "delta" => self.builder.displacement_table(),
                _ if functions.len() == 1 && calls(Expr::nests) => self.builder.jerk_table(),
                _ => self.builder.acceleration_table(),
            };
            tables.push((*function, table));
        }
        let operators: Vec<_> = tables.iter().map(|(function, table)| (*function, table)).collect();
        let (left, right) = (self.eval_with(left, &operators), self.eval_with(right, &operators));
        Some((left?, right?))
    }

    fn eval_with(
        &mut self,
        expr: &Expr,
        operators: &[(&'static str, &BTreeMap<ExprId, ExprId>)],
    ) -> Option<Value> {
        let rates = self.rates_for(&[expr]);
        let mut evaluator = self.evaluator(operators, None);
        evaluator.rates = rates.as_ref();
        evaluator.eval(expr).map(|(value, _)| value)
    }

    /// Rates along a motion, for expressions that need them.
    pub(super) fn rates_for(&mut self, list: &[&Expr]) -> Option<Rates> {
        let needs = |expr: &&Expr| ["rate", "spin", "rot"].iter().any(|function| expr.calls(function));
        list.iter().any(needs).then(|| self.builder.rates())
    }

    /// What evaluates expressions of the model with everything that is declared by now.
    pub(super) fn evaluator<'s>(
        &'s mut self,
        operators: &'s [(&'static str, &'s BTreeMap<ExprId, ExprId>)],
        restriction: Option<&'static str>,
    ) -> Evaluator<'s> {
        // The sections of an algebroid are no algebra.
        let is_own = self.builder.has_algebroid();
        Evaluator {
            graph: &mut self.builder.graph,
            values: &self.builder.values,
            weights: &self.weights,
            poisoned: &self.poisoned,
            problems: &mut self.builder.problems,
            is_spent: &mut self.is_spent,
            restriction,
            operators,
            withheld: &self.withheld,
            algebras: &self.algebras,
            rates: None,
            motions: &mut self.motions,
            warnings: &mut self.warnings,
            own_algebra: self.builder.algebra.as_ref().filter(|_| !is_own).map(|(algebra, _)| algebra),
        }
    }

    /// Coordinates are declared before definitions, so only parameters are known here.
    pub(super) fn interval_end(&mut self, expr: &Expr) -> Option<ExprId> {
        let restriction = Some("the ends of an interval contain parameters and numbers only");
        let (value, _) = self.evaluator(&[], restriction).eval(expr)?;
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
    fn nameless(&mut self, expr: &Expr, restriction: &'static str) -> Option<(Graph, Value)> {
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
        value.map(|(value, _)| (graph, value))
    }

    /// Numbers in closed form; others are a problem, with `help`.
    pub(super) fn closed_forms(
        &mut self,
        expr: &Expr,
        restriction: &'static str,
        help: &str,
    ) -> Option<Vec<Number>> {
        let (graph, value) = self.nameless(expr, restriction)?;
        let numbers = value.entries().iter().map(|e| graph.as_number(*e)).collect();
        if Option::is_none(&numbers) {
            self.problem(expr.span, "the value is no number in closed form", help);
        }
        numbers
    }

    /// Rational numbers.
    pub(super) fn constant(&mut self, expr: &Expr, restriction: &'static str) -> Option<Vec<Rational>> {
        let (graph, value) = self.nameless(expr, restriction)?;
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

    pub(super) fn located(&mut self, expr: &Expr) -> Option<(Value, Option<Span>)> {
        Some((self.eval(expr)?, Some(expr.span)))
    }
}
