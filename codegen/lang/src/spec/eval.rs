//! Values of syntax trees: names, shapes, functions. Every problem gets the span of the offending operand.

use std::collections::{BTreeMap, BTreeSet};

use num_traits::{One, Signed, ToPrimitive};

use super::ast::{BodyPart, Expr, Node};
use super::diagnostic::{Diagnostic, Help, Span};
use super::limits::MAX_DIM;
use super::motions::Motions;
use super::names::{self, ALGEBRA_FUNCTIONS, FUNCTIONS, OPERATORS};
use super::rates::Rates;
use super::shape::{Operation, Shape, ValueError};
use super::value::Value;
use crate::algebra::LieAlgebra;
use hamel_expr::{ExprId, Func, Graph, Number, Rational};

/// Steps of work that are taken for a scalar operation before its expressions are made: the default budget has room for
/// 4 million.
const STEPS: usize = 50;
/// Bound on the bits of any coefficient, so that nested powers cannot fill the memory.
const MAX_BITS: u64 = 1 << 18;
/// What a parameter may contribute to a coefficient when it is fixed to a number.
const SYMBOL_BITS: u64 = 16;

/// A value and a bound on the bits of its coefficients.
pub(super) type Weighed = (Value, u64);

/// Everything an expression can see.
pub(super) struct Evaluator<'a> {
    pub(super) graph: &'a mut Graph,
    pub(super) values: &'a BTreeMap<String, Value>,
    /// Weights of `let`s; other names have the weight of a symbol.
    pub(super) weights: &'a BTreeMap<String, u64>,
    /// Names about which a problem is already reported.
    pub(super) poisoned: &'a BTreeSet<String>,
    pub(super) problems: &'a mut Vec<Diagnostic>,
    /// Whether it is reported that the budget is spent.
    pub(super) is_spent: &'a mut bool,
    /// Added to "unknown name" when names are restricted, as in defaults.
    pub(super) restriction: Option<&'static str>,
    /// `delta` and `ddt` where they are legal, with their values on velocities.
    pub(super) operators: &'a [(&'static str, &'a BTreeMap<ExprId, ExprId>)],
    /// Reconstructed coordinates, which only their items can see.
    pub(super) withheld: &'a BTreeSet<String>,
    /// Algebras by their names.
    pub(super) algebras: &'a BTreeMap<String, LieAlgebra<Number>>,
    /// Rates along a motion, where they are known.
    pub(super) rates: Option<&'a Rates>,
    /// Rotations and places that have been made, as they are known.
    pub(super) motions: &'a mut Motions,
    /// What is to be told beside a value.
    pub(super) warnings: &'a mut Vec<Diagnostic>,
    /// The algebra of the velocities.
    pub(super) own_algebra: Option<&'a LieAlgebra<Number>>,
}

/// A name stands for itself, for a component (`I1` of `I`), for a rate (`x_dot` of `x`) or for what a body declares
/// (`B_energy` of `B`).
pub(super) fn is_poisoned(name: &str, poisoned: &BTreeSet<String>) -> bool {
    let stem = name.strip_suffix("_dot").unwrap_or(name);
    let stem = stem.trim_end_matches(|c: char| c.is_ascii_digit() || c == '_');
    let body = BodyPart::ALL.iter().find_map(|part| stem.strip_suffix(part.ending()));
    poisoned.contains(name)
        || poisoned.contains(stem)
        || poisoned.contains(stem.trim_end_matches("_dot"))
        || body.is_some_and(|body| poisoned.contains(body))
}

impl Evaluator<'_> {
    /// The value, or `None` when a problem was reported (now or before).
    pub(super) fn eval(&mut self, expr: &Expr) -> Option<Weighed> {
        let (value, bits) = match &expr.node {
            Node::Number(q) => (Value::number(self.graph, q.clone()), bits_of(q)),
            Node::Name(name) => self.name(name, expr.span)?,
            Node::Sum(list) => self.sum(list)?,
            Node::Product(list) => self.product(list)?,
            Node::Neg(inside) => self.negate(inside)?,
            Node::Power(base, exponent) => self.power(base, exponent, expr.span)?,
            Node::Call(name, arguments) => self.call(name, arguments, expr.span)?,
            Node::Index(base, indices) => self.index(base, indices, expr.span)?,
            Node::List(list) => self.list(list, expr.span)?,
        };
        let bits = self.exact_bits(&value).unwrap_or(bits);
        if bits > MAX_BITS {
            return self.fail(
                expr.span,
                "numbers in this expression become too large",
                "write smaller powers",
            );
        }
        self.charge(value.entries().len(), expr.span)?;
        Some((value, bits))
    }

    /// Counts scalar operations; past the budget every expression fails, the first one with a report.
    pub(super) fn charge(&mut self, n: usize, span: Span) -> Option<()> {
        self.graph.charge(n.saturating_mul(STEPS));
        let Err(exhausted) = self.graph.within_budget() else { return Some(()) };
        if std::mem::replace(self.is_spent, true) {
            return None;
        }
        self.fail(span, exhausted.message(), exhausted.help())
    }

    fn exact_bits(&self, value: &Value) -> Option<u64> {
        match value {
            Value::Scalar(e) => self.graph.as_rational(*e).map(bits_of),
            _ => None,
        }
    }

    pub(super) fn fail<T>(
        &mut self,
        span: Span,
        message: impl Into<String>,
        help: impl Into<Help>,
    ) -> Option<T> {
        self.problems.push(Diagnostic::new(Some(span), message).with_help(help));
        None
    }

    fn error<T>(&mut self, span: Span, error: &ValueError, places: &[(&Expr, Shape)]) -> Option<T> {
        let mut problem = Diagnostic::new(Some(span), error.to_string()).with_help(error.help());
        for (operand, shape) in places {
            problem = problem.with_place(Some(operand.span), shape.to_string());
        }
        self.problems.push(problem);
        None
    }

    fn name(&mut self, name: &str, span: Span) -> Option<Weighed> {
        if let Some(value) = self.values.get(name) {
            let bits = self.weights.get(name).copied().unwrap_or(SYMBOL_BITS);
            return Some((value.clone(), bits));
        }
        if is_poisoned(name, self.poisoned) {
            return None;
        }
        let shown: String = name.chars().take(80).collect();
        // Written as `moment on B`, which is shorter.
        if let Some((body, index)) = name.rsplit_once(BodyPart::Spin.ending())
            && span.end - span.start < name.len()
        {
            let message = format!("no body `{body}{index}` that turns is declared");
            return self.fail(span, message, "declare it: `body B { inertia I; attitude R; }`");
        }
        if let Some(restriction) = self.restriction {
            return self.fail(span, format!("`{shown}` is not known here"), restriction);
        }
        if FUNCTIONS.contains(&name) || OPERATORS.iter().any(|(operator, _)| *operator == name) {
            return self.fail(span, format!("`{name}` is a function"), format!("write `{name}(..)`"));
        }
        if self.withheld.contains(name.trim_end_matches(|c: char| c.is_ascii_digit()))
            || self.withheld.contains(name)
        {
            let help =
                "only later `reconstruct` items see it; use `coordinate` when the equations depend on it";
            return self.fail(span, format!("`{shown}` is a reconstructed coordinate"), help);
        }
        let hint = self.suggestion(name);
        self.fail(span, format!("unknown name `{shown}`"), hint)
    }

    fn suggestion(&self, name: &str) -> Help {
        // A component of a known vector, `Gamma4`, deserves the range.
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
        match self.values.get(stem).map(Value::shape) {
            Some(Shape::Vector(n)) if stem.len() < name.len() => {
                format!("`{stem}` is vector({n}): its components are `{stem}1` to `{stem}{n}`").into()
            }
            _ => {
                if name.strip_suffix("_dot").is_some_and(|stem| self.values.contains_key(stem)) {
                    return "only coordinates have a `_dot`; accelerations are `ddt(Omega)`, in `constraint`"
                        .into();
                }
                let near = names::suggest(name, self.values.keys().map(String::as_str));
                if near.is_empty() { "declare it with `param` or `let`".into() } else { near }
            }
        }
    }

    /// Evaluates all operands before giving up, so that all of them are reported.
    fn all(&mut self, list: &[(bool, Expr)]) -> Option<Vec<Weighed>> {
        let values: Vec<Option<Weighed>> = list.iter().map(|(_, e)| self.eval(e)).collect();
        values.into_iter().collect()
    }

    fn sum(&mut self, list: &[(bool, Expr)]) -> Option<Weighed> {
        let values = self.all(list)?;
        let (_, first_expr) = list.first()?;
        let first = values.first()?.0.shape();
        for ((negative, operand), (value, _)) in list.iter().zip(&values).skip(1) {
            if value.shape() != first {
                let operation = if *negative { Operation::Subtract } else { Operation::Add };
                let error = ValueError::Shapes { operation, left: first, right: value.shape() };
                return self.error(operand.span, &error, &[(first_expr, first), (operand, value.shape())]);
            }
        }
        let bits = values.iter().map(|(_, bits)| *bits).max().unwrap_or(0) + 8;
        let first_len = values.first()?.0.entries().len();
        let operands: Vec<(bool, &Value)> =
            list.iter().zip(&values).map(|((n, _), (v, _))| (*n, v)).collect();
        self.charge(operands.len() * first_len, first_expr.span)?;
        match Value::sum_of(self.graph, &operands) {
            Ok(value) => {
                self.note_sum(&operands, &value);
                Some((value, bits))
            }
            Err(error) => self.error(first_expr.span, &error, &[]),
        }
    }

    fn product(&mut self, list: &[(bool, Expr)]) -> Option<Weighed> {
        let values = self.all(list)?;
        let bits = values.iter().fold(0_u64, |sum, (_, bits)| sum.saturating_add(*bits));
        if bits > MAX_BITS {
            let span = list.first()?.1.span.to(list.last()?.1.span);
            return self.fail(span, "numbers in this expression become too large", "write smaller powers");
        }
        // Numbers commute and are collected; vectors and matrices multiply in order.
        let mut numbers: Vec<(ExprId, Rational)> = Vec::new();
        let mut rest: Option<(Value, Span)> = None;
        for ((divide, operand), (value, _)) in list.iter().zip(values) {
            match (&value, *divide) {
                (Value::Scalar(e), false) => numbers.push((*e, Rational::one())),
                (Value::Scalar(e), true) => {
                    if self.graph.is_zero(*e) {
                        let error = ValueError::DivisionByZero;
                        return self.error(operand.span, &error, &[]);
                    }
                    numbers.push((*e, -Rational::one()));
                }
                (_, true) => {
                    let left = rest.as_ref().map_or(Shape::Scalar, |(v, _)| v.shape());
                    let error =
                        ValueError::Shapes { operation: Operation::Divide, left, right: value.shape() };
                    return self.error(operand.span, &error, &[(operand, value.shape())]);
                }
                (_, false) => {
                    let Some((left, span)) = rest.take() else {
                        rest = Some((value, operand.span));
                        continue;
                    };
                    let columns = if let Shape::Matrix(_, m) = value.shape() { m } else { 1 };
                    self.charge(left.n_nonzero(self.graph) * columns, operand.span)?;
                    match left.mul(self.graph, &value) {
                        Ok(Value::Scalar(e)) => numbers.push((e, Rational::one())),
                        Ok(product) => {
                            self.note_product(&left, &value, &product);
                            self.note_turned(&left, &value, &product);
                            rest = Some((product, span.to(operand.span)));
                        }
                        Err(error) => {
                            let problem = Diagnostic::new(Some(span.to(operand.span)), error.to_string())
                                .with_place(Some(span), left.shape().to_string())
                                .with_place(Some(operand.span), value.shape().to_string())
                                .with_help(error.help());
                            self.problems.push(problem);
                            return None;
                        }
                    }
                }
            }
        }
        let number = match self.graph.power_product(&numbers) {
            Ok(number) => number,
            Err(_) => {
                let span = list.first()?.1.span.to(list.last()?.1.span);
                return self.error(span, &ValueError::DivisionByZero, &[]);
            }
        };
        Some(match rest {
            None => (Value::Scalar(number), bits),
            Some((value, _)) if numbers.is_empty() => (value, bits),
            Some((value, _)) => (value.scale(self.graph, number), bits),
        })
    }

    fn negate(&mut self, inside: &Expr) -> Option<Weighed> {
        let (value, bits) = self.eval(inside)?;
        Some((value.neg(self.graph), bits))
    }

    fn power(&mut self, base: &Expr, exponent: &Expr, span: Span) -> Option<Weighed> {
        let (b, e) = (self.eval(base), self.eval(exponent));
        let ((b, b_bits), (e, e_bits)) = (b?, e?);
        self.raise(&b, &e, (b_bits, e_bits), (base, exponent), span)
    }

    fn raise(
        &mut self,
        b: &Value,
        e: &Value,
        (b_bits, e_bits): (u64, u64),
        (base, exponent): (&Expr, &Expr),
        span: Span,
    ) -> Option<Weighed> {
        let constant = match e {
            Value::Scalar(e) => self.graph.as_rational(*e).cloned(),
            _ => None,
        };
        let bits = match &constant {
            Some(q) => b_bits.saturating_mul(q.abs().ceil().to_integer().to_u64().unwrap_or(u64::MAX).max(1)),
            None => b_bits.saturating_add(e_bits),
        };
        if bits > MAX_BITS
            && constant.as_ref().is_none_or(|q| q.numer().abs().to_u64().is_some_and(|n| n <= 1000))
        {
            return self.fail(span, "numbers in this expression become too large", "write smaller powers");
        }
        if let (Shape::Matrix(n, _), Some(q)) = (b.shape(), &constant) {
            let n_products = if b.is_diagonal(self.graph) { n } else { n * n * n };
            self.charge(n_products * q.numer().bits() as usize, span)?;
        }
        match b.pow(self.graph, e) {
            Ok(value) => Some((value, bits)),
            Err(error @ ValueError::DivisionByZero) => self.error(base.span, &error, &[]),
            Err(error @ (ValueError::Exponent(_) | ValueError::MatrixPower(_))) => {
                self.error(exponent.span, &error, &[])
            }
            Err(error) => self.error(span, &error, &[(base, b.shape()), (exponent, e.shape())]),
        }
    }

    fn list(&mut self, list: &[Expr], span: Span) -> Option<Weighed> {
        if list.len() > MAX_DIM {
            let message = format!("vector has {} entries, the limit is {MAX_DIM}", list.len());
            return self.fail(span, message, "");
        }
        let values: Vec<Option<Weighed>> = list.iter().map(|e| self.eval(e)).collect();
        let values: Vec<Weighed> = values.into_iter().collect::<Option<_>>()?;
        let bits = values.iter().map(|(_, bits)| *bits).max().unwrap_or(0);
        let first = values.first()?.0.shape();
        for (operand, (value, _)) in list.iter().zip(&values) {
            if value.shape() != first {
                let error = ValueError::Ragged { first, other: value.shape() };
                return self.error(operand.span, &error, &[(list.first()?, first), (operand, value.shape())]);
            }
        }
        match Value::list(values.into_iter().map(|(v, _)| v).collect()) {
            Ok(value) => Some((value, bits)),
            Err(error) => self.error(span, &error, &[]),
        }
    }

    /// An index from one; reports anything else.
    pub(super) fn whole(&mut self, expr: &Expr) -> Option<usize> {
        let (value, _) = self.eval(expr)?;
        let number = match value {
            Value::Scalar(e) => {
                self.graph.as_rational(e).filter(|q| q.is_integer()).and_then(|q| q.numer().to_usize())
            }
            _ => None,
        };
        match number {
            Some(n) => Some(n),
            None => self.fail(
                expr.span,
                "expected a whole number",
                "indices and dimensions are constants such as `2`",
            ),
        }
    }

    fn index(&mut self, base: &Expr, indices: &[Expr], span: Span) -> Option<Weighed> {
        let (mut value, bits) = self.eval(base)?;
        let shape = value.shape();
        let wanted = match shape {
            Shape::Scalar => 0,
            Shape::Vector(_) => 1,
            Shape::Matrix(..) => 2,
        };
        if indices.is_empty() || indices.len() > wanted {
            let plural = if indices.len() == 1 { "index" } else { "indices" };
            let message = format!("{} {plural} for {shape}", indices.len());
            let help = match wanted {
                0 => "a number has no components",
                1 => "write `v[1]`",
                _ => "write `A[1, 2]`, or `A[1]` for a row",
            };
            return self.fail(span, message, help);
        }
        for expr in indices {
            let n = self.whole(expr)?;
            match value.row(n) {
                Ok(entry) => value = entry,
                Err(error) => return self.error(expr.span, &error, &[(base, shape)]),
            }
        }
        Some((value, bits))
    }

    fn call(&mut self, name: &super::ast::Name, arguments: &[Expr], span: Span) -> Option<Weighed> {
        let function = name.text.as_str();
        let operator = OPERATORS.iter().find(|(operator, _)| *operator == function);
        let is_legal = self.operators.iter().any(|(legal, _)| *legal == function);
        if let Some((_, help)) = operator.filter(|_| !is_legal) {
            return self.fail(name.span, format!("`{function}` is not legal here"), *help);
        }
        if ALGEBRA_FUNCTIONS.contains(&function) {
            return self.of_algebra(function, arguments, span);
        }
        match function {
            "rot" => return self.rotation(arguments, span),
            "log" => return self.logarithm(arguments, (name.span, span)),
            "orthonormal" => return self.orthonormal(arguments, span),
            "rate" | "spin" => {
                let [argument] = arguments else {
                    let message = format!("`{function}` takes 1 argument, found {}", arguments.len());
                    let example = if function == "rate" { "rate(p)" } else { "spin(R)" };
                    return self.fail(span, message, format!("write `{example}`"));
                };
                return if function == "rate" { self.rate(argument) } else { self.spin(argument) };
            }
            "unit" => return self.length(function, arguments, span),
            // With one argument it is one of those that follow.
            "norm" if arguments.len() == 2 => return self.length(function, arguments, span),
            _ => {}
        }
        let wanted = match function {
            "dot" | "cross" | "pow" | "atan2" => 2,
            _ if operator.is_some() => 1,
            _ if FUNCTIONS.contains(&function) => 1,
            _ => {
                if self.values.contains_key(function) {
                    let help = format!("write a product as `{function} * (..)`");
                    return self.fail(name.span, format!("`{function}` is not a function"), help);
                }
                let help = match function {
                    "inverse" | "inv" => "matrices are not inverted: write the solution out".into(),
                    "arctan2" | "arg" => "write `atan2(y, x)` for the angle of the point (x, y)".into(),
                    _ => match names::not_smooth(function) {
                        Some(advice) => advice.into(),
                        None => names::suggest(function, FUNCTIONS.iter().copied()),
                    },
                };
                return self.fail(name.span, format!("unknown function `{function}`"), help);
            }
        };
        if arguments.len() != wanted {
            let plural = if wanted == 1 { "" } else { "s" };
            let message = format!("`{function}` takes {wanted} argument{plural}, found {}", arguments.len());
            let help = match function {
                "diag" => "write `diag([a, b, c])`".to_owned(),
                "dot" | "cross" => format!("write `{function}(a, b)` with two vectors"),
                "pow" => "write `pow(x, y)` or `x^y`".to_owned(),
                "atan2" => "write `atan2(y, x)` for the angle of the point (x, y)".to_owned(),
                "identity" => "write `identity(3)`".to_owned(),
                "norm" | "sum" | "hat" => format!("write `{function}(v)` with a vector"),
                "det" | "trace" | "transpose" => format!("write `{function}(A)` with a matrix"),
                _ => format!("write `{function}(x)`"),
            };
            return self.fail(span, message, help);
        }
        if function == "identity" {
            let argument = arguments.first()?;
            let n = self.whole(argument)?;
            if !(1..=MAX_DIM).contains(&n) {
                let message = format!("dimension `{n}` is not between 1 and {MAX_DIM}");
                return self.fail(argument.span, message, "");
            }
            return Some((Value::identity(self.graph, n), 1));
        }
        let values: Vec<Option<Weighed>> = arguments.iter().map(|a| self.eval(a)).collect();
        let values: Vec<Weighed> = values.into_iter().collect::<Option<_>>()?;
        self.apply(function, arguments, &values, span)
    }

    fn apply(
        &mut self,
        function: &str,
        arguments: &[Expr],
        values: &[Weighed],
        span: Span,
    ) -> Option<Weighed> {
        let (a, a_bits) = values.first()?;
        let (b, b_bits) = values.get(1).unwrap_or(&values[0]);
        if let Some((operator, table)) = self.operators.iter().find(|(operator, _)| *operator == function) {
            return match a.image(operator, table) {
                Ok(value) => Some((value, SYMBOL_BITS)),
                Err(error) => self.error(span, &error, &[]),
            };
        }
        let g = &mut *self.graph;
        let (result, bits) = match function {
            "dot" => (a.dot(g, b), a_bits + b_bits + 8),
            "cross" => (a.cross(g, b), a_bits + b_bits + 8),
            "pow" => return self.raise(a, b, (*a_bits, *b_bits), (&arguments[0], &arguments[1]), span),
            "norm" => (a.norm(g), 2 * a_bits + 8),
            "transpose" => (a.transpose(), *a_bits),
            "diag" => (a.diag(g), *a_bits),
            "hat" => (a.hat(g), *a_bits),
            "det" => (a.det(g), 8 * a_bits + 16),
            "trace" => (a.trace(g), a_bits + 8),
            "sum" => (a.sum(g), a_bits + 8),
            "sqrt" => (a.sqrt(g), *a_bits),
            "atan2" => (a.atan2(g, b), a_bits + b_bits),
            "sinc" => (a.of_square(g, Func::Stumpff(1), "sinc"), 2 * a_bits),
            "cosc" => (a.of_square(g, Func::Stumpff(2), "cosc"), 2 * a_bits),
            _ => (Func::from_name(function).map_or(Err(ValueError::TooLarge), |f| a.func(g, f)), *a_bits),
        };
        match result {
            Ok(value) => {
                if function == "transpose" {
                    self.note_inverse(a, &value);
                }
                Some((value, bits))
            }
            Err(error) => {
                let shapes: Vec<(&Expr, Shape)> =
                    arguments.iter().zip(values).map(|(e, (v, _))| (e, v.shape())).collect();
                let is_about_shapes = !matches!(
                    error,
                    ValueError::DivisionByZero
                        | ValueError::LogarithmOfZero
                        | ValueError::AngleOfOrigin
                        | ValueError::NoValue(_)
                );
                let shapes = if is_about_shapes { &shapes[..] } else { &[] };
                self.error(span, &error, shapes)
            }
        }
    }
}

fn bits_of(q: &Rational) -> u64 {
    q.numer().bits() + q.denom().bits()
}
