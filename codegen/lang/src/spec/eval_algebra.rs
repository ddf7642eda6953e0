//! Functions of the expression language that belong to an algebra: brackets, the Laplacian, products of modes.
//!
//! Deliberately does not know: how algebras are defined, items.

use super::ast::{Expr, Node};
use super::diagnostic::Span;
use super::eval::{Evaluator, Weighed};
use super::names;
use super::value::Value;
use crate::algebra::{Functions, LieAlgebra};
use hamel_expr::{ExprId, Number};

/// Largest power of an element.
const MAX_POWER: usize = 16;

impl Evaluator<'_> {
    /// `ad([g,] x, y)`, `coad([g,] x, mu)`, `laplacian([g])`, `poisson([g,] f, h)`, `pointwise([g,] f, h)`,
    /// `star_power([g,] f, k)`, `trace_power([g,] f, k)`; without `g`, of the algebra of the velocities.
    pub(super) fn of_algebra(&mut self, function: &str, arguments: &[Expr], span: Span) -> Option<Weighed> {
        let wanted = if function == "laplacian" { 0 } else { 2 };
        let (algebra, rest) = self.algebra_before(function, wanted, arguments, span)?;
        let n = algebra.dim();
        if function == "laplacian" {
            let Some(squares) = algebra.functions().map(Functions::squares) else {
                return self.no_modes(&algebra, function, span);
            };
            let mut entries = vec![self.graph.zero(); n * n];
            for (k, square) in squares.into_iter().enumerate() {
                entries[k * n + k] = self.graph.int(-square);
            }
            return Some((Value::Matrix { rows: n, columns: n, entries }, 16));
        }
        let (x, bits) = self.vector_of(&algebra, rest.first()?)?;
        if matches!(function, "star_power" | "trace_power") {
            let exponent = rest.get(1)?;
            let k = self.whole(exponent)?;
            if !(1..=MAX_POWER).contains(&k) {
                let message = format!("power {k} is not between 1 and {MAX_POWER}");
                return self.fail(exponent.span, message, "");
            }
            self.charge(k * n * n, span)?;
            let value = algebra.functions().and_then(|functions| match function {
                "star_power" => functions.star_power(self.graph, &x, k).map(Value::Vector),
                _ => functions.trace_power(self.graph, &x, k).map(Value::Scalar),
            });
            let Some(value) = value else { return self.no_modes(&algebra, function, span) };
            return Some((value, bits * k as u64 + 64));
        }
        let (y, other_bits) = self.vector_of(&algebra, rest.get(1)?)?;
        self.charge(n * n, span)?;
        if matches!(function, "pointwise" | "poisson") {
            let value = algebra.functions().and_then(|functions| match function {
                "pointwise" => functions.pointwise(self.graph, &x, &y),
                _ => functions.poisson(self.graph, &x, &y),
            });
            let Some(value) = value else { return self.no_modes(&algebra, function, span) };
            return Some((Value::Vector(value), bits + other_bits + 16));
        }
        let mut terms = vec![Vec::new(); n];
        let zero = self.graph.zero();
        let mut add = |evaluator: &mut Self, at: usize, a: ExprId, b: ExprId, q: &Number| {
            if a != zero && b != zero {
                let product = evaluator.graph.mul(a, b);
                terms[at].push(evaluator.graph.weighted(product, q));
            }
        };
        for (a, b, value) in algebra.brackets() {
            for (c, q) in value {
                let minus = hamel_expr::Scalar::negated(q);
                if function == "ad" {
                    // [x, y]^c = C^c_ab x^a y^b
                    add(self, *c, x[a], y[b], q);
                    add(self, *c, x[b], y[a], &minus);
                } else {
                    // <coad(x, mu), z> = -<mu, [x, z]>
                    add(self, b, x[a], y[*c], &minus);
                    add(self, a, x[b], y[*c], q);
                }
            }
        }
        let entries = terms.iter().map(|list| self.graph.linear_combination(list)).collect();
        Some((Value::Vector(entries), bits + other_bits + 16))
    }

    /// The algebra and the vector of `field([g,] f)`.
    pub(super) fn field_of(&mut self, arguments: &[Expr], span: Span) -> Option<(LieAlgebra<Number>, Value)> {
        let (algebra, rest) = self.algebra_before("field", 1, arguments, span)?;
        if !matches!(algebra.functions(), Some(Functions::Torus(_))) {
            return self.no_modes(&algebra, "field", span);
        }
        let (entries, _) = self.vector_of(&algebra, rest.first()?)?;
        Some((algebra, Value::Vector(entries)))
    }

    /// The algebra that a function is of, and its other arguments.
    fn algebra_before<'e>(
        &mut self,
        function: &str,
        wanted: usize,
        arguments: &'e [Expr],
        span: Span,
    ) -> Option<(LieAlgebra<Number>, &'e [Expr])> {
        Some(match arguments.split_first() {
            Some((first, rest)) if rest.len() == wanted => (self.algebra_named(first)?, rest),
            _ if arguments.len() == wanted => match self.own_algebra {
                Some(algebra) => (algebra.clone(), arguments),
                None => {
                    let help = format!("name one: `{function}(g{})`", if wanted == 0 { "" } else { ", .." });
                    return self.fail(span, "the model has no velocities in an algebra", help);
                }
            },
            _ => {
                let message = {
                    let plural = if wanted == 1 { "" } else { "s" };
                    format!("`{function}` takes {wanted} argument{plural}, or an algebra before them")
                };
                let help = match function {
                    "laplacian" => "write `laplacian(g)`".to_owned(),
                    "star_power" | "trace_power" => format!("write `{function}(g, f, 2)`"),
                    "field" => "write `field(f)` or `field(g, f)`".to_owned(),
                    _ => format!("write `{function}(x, y)` or `{function}(g, x, y)`"),
                };
                return self.fail(span, message, help);
            }
        })
    }

    fn no_modes<T>(&mut self, algebra: &LieAlgebra<Number>, function: &str, span: Span) -> Option<T> {
        let message = format!("`{function}` does not exist for {}", algebra.name());
        let help = match function {
            "star_power" | "trace_power" => "zeitlin(N) and zeitlin_sphere(N) have products of functions",
            "pointwise" => "witt(K) has functions on the circle",
            "laplacian" => "zeitlin(N), zeitlin_sphere(N), torus(K) and witt(K) have a basis of functions",
            "field" => "zeitlin(N) and torus(K) have functions on the torus, which is what is drawn",
            _ => "zeitlin(N), zeitlin_sphere(N) and torus(K) have functions on a surface",
        };
        self.fail(span, message, help)
    }

    fn algebra_named(&mut self, expr: &Expr) -> Option<LieAlgebra<Number>> {
        if let Node::Name(name) = &expr.node {
            if let Some(algebra) = self.algebras.get(name) {
                return Some(algebra.clone());
            }
            if self.poisoned.contains(name) {
                return None;
            }
            let help = match names::suggest(name, self.algebras.keys().map(String::as_str)) {
                near if near.is_empty() => "give the algebra a name: `algebra g = ..;`".into(),
                near => near,
            };
            return self.fail(expr.span, format!("unknown algebra `{name}`"), help);
        }
        self.fail(expr.span, "expected the name of an algebra", "give it a name: `algebra g = ..;`")
    }

    fn vector_of(&mut self, algebra: &LieAlgebra<Number>, expr: &Expr) -> Option<(Vec<ExprId>, u64)> {
        let (value, bits) = self.eval(expr)?;
        let (n, shape) = (algebra.dim(), value.shape());
        match value {
            Value::Vector(entries) if entries.len() == n => Some((entries, bits)),
            Value::Scalar(e) if n == 1 => Some((vec![e], bits)),
            _ => {
                let message = format!("an element of {} must be vector({n}), found {shape}", algebra.name());
                self.fail(expr.span, message, "")
            }
        }
    }
}
