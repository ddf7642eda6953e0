//! Parameters and the conditions on them.
//!
//! Deliberately does not know: what parameters are used for.

use std::collections::BTreeMap;

use num_traits::{Signed, Zero};

use super::draft::{DeclaredAs, ModelBuilder};
use crate::spec::ast::Compare;
use crate::spec::layout::{Layout, component_help};
use crate::spec::model::*;
use crate::spec::shape::ValueError;
use crate::spec::value::Value;
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Rational, Relation, SymbolId};

impl ModelBuilder {
    /// A number.
    ///
    /// Parameters, their conditions and definitions are values; a condition names them in its text only.
    ///
    /// ```
    /// use hamel_lang::spec::{Compare, Layout, ModelBuilder, Rational, Value};
    ///
    /// let number = |n: i64| Rational::from_integer(n.into());
    /// let mut b = ModelBuilder::new("m");
    /// let mass = b.param("m", number(-1), "mass [kg]");
    /// let direction = b.param_array("chi", Layout::Vector(2), &[number(1)], "");
    /// assert_eq!(direction.entries().len(), 2);
    /// let zero = Value::number(b.graph(), number(0));
    /// b.condition("m > 0", &mass, Compare::Greater, &zero);
    /// let problems = b.build().unwrap_err().to_string();
    /// assert!(problems.contains("`chi` has 2 components, its default 1"));
    /// assert!(problems.contains("the default violates `m > 0`"));
    /// ```
    pub fn param(&mut self, name: &str, default: Rational, doc: &str) -> Value {
        self.check_range(name, &default);
        let (symbol, expr) = self.new_symbol(name, DeclaredAs::Parameter);
        self.blocks.insert(name.to_owned(), vec![self.params.len()]);
        self.params.push(Param { name: name.to_owned(), symbol, default, doc: doc.to_owned() });
        Value::Scalar(expr)
    }

    /// Generated code holds the value as an `f64`.
    pub(super) fn check_range(&mut self, name: &str, value: &Rational) {
        let number = hamel_expr::rational_to_f64(value);
        if !number.is_finite() || (number == 0.0 && !value.is_zero()) {
            self.error(self.here, &Error::OutOfRange { what: format!("the value of `{name}`") });
        }
    }

    /// A vector or a matrix; the defaults are in the order of the components.
    pub fn param_array(&mut self, name: &str, layout: Layout, defaults: &[Rational], doc: &str) -> Value {
        self.declare(name, DeclaredAs::Parameter);
        let names = layout.names(name);
        if names.len() != defaults.len() {
            let message = format!("`{name}` has {} components, its default {}", names.len(), defaults.len());
            self.problem(self.here, message, component_help(&names));
        }
        let mut components = Vec::with_capacity(names.len());
        let mut positions = Vec::with_capacity(names.len());
        let mut symbols = Vec::with_capacity(names.len());
        for (k, component) in names.iter().enumerate() {
            let (symbol, expr) = self.new_symbol(component, DeclaredAs::ParameterComponent);
            positions.push(self.params.len());
            self.blocks.insert(component.clone(), vec![self.params.len()]);
            let default = defaults.get(k).cloned().unwrap_or_else(Rational::zero);
            self.check_range(component, &default);
            self.params.push(Param { name: component.clone(), symbol, default, doc: doc.to_owned() });
            components.push(expr);
            symbols.push(symbol);
        }
        self.blocks.insert(name.to_owned(), positions);
        self.param_arrays.push(ParamArray { name: name.to_owned(), layout, symbols });
        let value = layout.assemble(&mut self.graph, &components);
        self.bind(name, &value);
        value
    }

    /// A validity condition on the parameters.
    pub fn condition(&mut self, text: &str, left: &Value, compare: Compare, right: &Value) -> &mut Self {
        let here = self.here;
        let sides = left.scalar("a condition").and_then(|l| Ok((l, right.scalar("a condition")?)));
        let (left, right) = match sides {
            Ok(sides) => sides,
            Err(error) => {
                self.problem(
                    here,
                    format!("condition `{text}` compares {}", shape_of(&error)),
                    "conditions compare numbers",
                );
                return self;
            }
        };
        let (greater, less, relation) = match compare {
            Compare::Greater => (left, right, Relation::Greater),
            Compare::GreaterEqual => (left, right, Relation::GreaterEqual),
            Compare::Less => (right, left, Relation::Greater),
            Compare::LessEqual => (right, left, Relation::GreaterEqual),
            Compare::NotEqual => (left, right, Relation::NotEqual),
        };
        self.conditions.push(Condition {
            text: text.to_owned(),
            greater,
            less,
            relation,
            subject: None,
            span: here,
        });
        self
    }

    pub(super) fn default_values(&self) -> BTreeMap<SymbolId, f64> {
        self.params.iter().map(|p| (p.symbol, hamel_expr::rational_to_f64(&p.default))).collect()
    }

    pub(super) fn check_conditions(&mut self) {
        let params: BTreeMap<SymbolId, String> =
            self.params.iter().map(|p| (p.symbol, p.name.clone())).collect();
        let defaults: BTreeMap<SymbolId, Rational> =
            self.params.iter().map(|p| (p.symbol, p.default.clone())).collect();
        for k in 0..self.conditions.len() {
            let condition = self.conditions[k].clone();
            let mut free = self.graph.free_symbols(condition.greater);
            free.extend(self.graph.free_symbols(condition.less));
            if let Some(wrong) = free.iter().find(|s| !params.contains_key(s)) {
                let message = format!(
                    "condition `{}` contains `{}`, which is not a parameter",
                    condition.text,
                    self.graph.name(*wrong)
                );
                self.problem(condition.span, message, "conditions restrict parameters only");
                continue;
            }
            if free.len() == 1 {
                self.conditions[k].subject = free.first().and_then(|s| params.get(s)).cloned();
            }
            match self.holds(&condition, &defaults) {
                Some(true) => {}
                Some(false) => {
                    let spelled: Vec<String> = free
                        .iter()
                        .take(8)
                        .map(|s| format!("{} = {}", params[s], hamel_expr::rational_to_f64(&defaults[s])))
                        .collect();
                    let what = if free.len() == 1 { "the default violates" } else { "the defaults violate" };
                    let message = format!("{what} `{}`", condition.text);
                    let help = if spelled.is_empty() {
                        "the condition never holds".to_owned()
                    } else {
                        format!("here {}", spelled.join(", "))
                    };
                    self.problem(condition.span, message, help);
                }
                None => {
                    let message = format!("condition `{}` has no value at the defaults", condition.text);
                    self.problem(
                        condition.span,
                        message,
                        "it divides by zero or leaves the domain of a function",
                    );
                }
            }
        }
    }

    /// Whether a condition holds, exactly where its value is rational; `None` when it has no value.
    pub(super) fn holds(
        &mut self,
        condition: &Condition,
        values: &BTreeMap<SymbolId, Rational>,
    ) -> Option<bool> {
        let difference = self.graph.sub(condition.greater, condition.less);
        let numbers: BTreeMap<SymbolId, ExprId> =
            values.iter().map(|(s, q)| (*s, self.graph.rational(q.clone()))).collect();
        let reduced = self.graph.subs(difference, &numbers).ok()?;
        if let Some(q) = self.graph.as_rational(reduced) {
            return Some(match condition.relation {
                Relation::Greater => q.is_positive(),
                Relation::GreaterEqual => !q.is_negative(),
                Relation::NotEqual => !q.is_zero(),
            });
        }
        // A number that could not be shown to vanish is what it is to sixteen digits.
        if self.graph.is_zero(reduced) {
            return Some(condition.relation == Relation::GreaterEqual);
        }
        let value = self.graph.eval_f64(reduced, &BTreeMap::new()).filter(|x| !x.is_nan())?;
        Some(match condition.relation {
            Relation::Greater => value > 0.0,
            Relation::GreaterEqual => value >= 0.0,
            Relation::NotEqual => value != 0.0,
        })
    }
}

fn shape_of(error: &ValueError) -> String {
    match error {
        ValueError::Argument { found, .. } => found.to_string(),
        other => other.to_string(),
    }
}
