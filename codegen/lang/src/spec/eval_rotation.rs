//! Rotations, lengths and directions.
//!
//! Deliberately does not know: attitudes of a model, items.

use super::ast::{Expr, Node};
use super::diagnostic::Span;
use super::eval::{Evaluator, Weighed};
use super::shape::Shape;
use super::value::Value;
use hamel_expr::{ExprId, Func, Rational};

/// Axes by their words, as `rot` takes them.
const AXES: [&str; 3] = ["e1", "e2", "e3"];

impl Evaluator<'_> {
    /// `rot(phi)` of the plane, `rot(axis, phi)` of space: by the angle `phi` about an axis of length one, the matrix
    /// `a a^T + cos(phi) (1 - a a^T) + sin(phi) hat(a)`, whose columns are the turned axes; `rot(v)` of a rotation
    /// vector.
    pub(super) fn rotation(&mut self, arguments: &[Expr], span: Span) -> Option<Weighed> {
        let (axis, angle) = match arguments {
            [angle] => (None, angle),
            [axis, angle] => (Some(axis), angle),
            _ => {
                let message = format!("`rot` takes 1 or 2 arguments, found {}", arguments.len());
                let help = "write `rot(phi)` in the plane, `rot(e3, phi)` or `rot(v)` with a vector in space";
                return self.fail(span, message, help);
            }
        };
        let axis = match axis {
            Some(axis) => Some(self.axis(axis)?),
            None => None,
        };
        let (value, bits) = self.eval(angle)?;
        if let (None, Value::Vector(v)) = (&axis, &value)
            && let [a, b, c] = v[..]
        {
            self.charge(256, span)?;
            return Some((self.exponential([a, b, c]), 4 * bits + 16));
        }
        let Value::Scalar(phi) = value else {
            let message = format!("the angle of `rot` is a number, found {}", value.shape());
            return self.fail(angle.span, message, "write `rot(e3, phi)`: the axis comes first");
        };
        self.charge(64, span)?;
        let g = &mut *self.graph;
        let (cosine, sine) = (g.func(Func::Cos, phi), g.func(Func::Sin, phi));
        let Some((axis, axis_bits)) = axis else {
            let minus = g.neg(sine);
            let entries = vec![cosine, minus, sine, cosine];
            let matrix = Value::Matrix { rows: 2, columns: 2, entries };
            self.note_rotation(&matrix, None, phi);
            return Some((matrix, bits));
        };
        let zero = g.zero();
        let minus: Vec<ExprId> = axis.iter().map(|a| g.neg(*a)).collect();
        let hat = [zero, minus[2], axis[1], axis[2], zero, minus[0], minus[1], axis[0], zero];
        let entries = (0..9)
            .map(|k| {
                let (i, j) = (k / 3, k % 3);
                let along = g.mul(axis[i], axis[j]);
                let unit = if i == j { g.one() } else { zero };
                let across = g.sub(unit, along);
                let (c, s) = (g.mul(cosine, across), g.mul(sine, hat[k]));
                let turned = g.add(c, s);
                g.add(along, turned)
            })
            .collect();
        let matrix = Value::Matrix { rows: 3, columns: 3, entries };
        self.note_rotation(&matrix, Some(&axis), phi);
        Some((matrix, bits + 2 * axis_bits + 8))
    }

    /// The rotation `exp(hat(v)) = (1 - c_2 v.v) + c_1 hat(v) + c_2 v v^T` by the length of `v` about `v`, with
    /// Stumpff's functions `c_k` of `v.v`, so that everything is smooth where `v` vanishes.
    fn exponential(&mut self, v: [ExprId; 3]) -> Value {
        let g = &mut *self.graph;
        let square = g.dot(&v, &v);
        let [one, two] = [1, 2].map(|k| g.func(Func::Stumpff(k), square));
        let bent = g.mul(square, two);
        let cosine = g.sub(g.one(), bent);
        let zero = g.zero();
        let minus = v.map(|e| g.neg(e));
        let hat = [zero, minus[2], v[1], v[2], zero, minus[0], minus[1], v[0], zero];
        let entries = (0..9).map(|k| {
            let (i, j) = (k / 3, k % 3);
            let (across, along) = (g.mul(one, hat[k]), g.product(&[two, v[i], v[j]]));
            g.sum(&[if i == j { cosine } else { zero }, across, along])
        });
        let matrix = Value::Matrix { rows: 3, columns: 3, entries: entries.collect() };
        self.note_exponential(&matrix, v, square);
        matrix
    }

    /// An axis of space: `e1`, `e2`, `e3` where the model has no such names, or a vector whose length is one.
    fn axis(&mut self, expr: &Expr) -> Option<(Vec<ExprId>, u64)> {
        if let Node::Name(name) = &expr.node
            && !self.values.contains_key(name)
            && let Some(k) = AXES.iter().position(|axis| axis == name)
        {
            let entries = (0..3).map(|i| if i == k { self.graph.one() } else { self.graph.zero() }).collect();
            return Some((entries, 1));
        }
        let (value, bits) = self.eval(expr)?;
        let help = "write `e1`, `e2`, `e3`, or a vector of length one such as `[3/5, 0, 4/5]`";
        let Value::Vector(entries) = &value else {
            return self.fail(expr.span, format!("an axis is vector(3), found {}", value.shape()), help);
        };
        if entries.len() != 3 {
            return self.fail(expr.span, format!("an axis is vector(3), found {}", value.shape()), help);
        }
        let square = value.dot(self.graph, &value).ok()?.scalar("rot").ok()?;
        let one = self.graph.one();
        let excess = self.graph.sub(square, one);
        if !self.graph.is_zero(excess) {
            return self.fail(expr.span, "the length of the axis is not one", help);
        }
        Some((entries.clone(), bits))
    }

    /// `norm(v)`, `unit(v)`: length and direction; with a second argument `eps` those of `v` as if it had a component
    /// of this length more, `sqrt(dot(v, v) + eps^2)` and `v/sqrt(dot(v, v) + eps^2)`, which are smooth where `v` is
    /// zero.
    pub(super) fn length(&mut self, function: &str, arguments: &[Expr], span: Span) -> Option<Weighed> {
        let (vector, eps) = match arguments {
            [vector] => (vector, None),
            [vector, eps] => (vector, Some(eps)),
            _ => {
                let message = format!("`{function}` takes 1 or 2 arguments, found {}", arguments.len());
                let help = format!("write `{function}(v)` with a vector, or `{function}(v, eps)`");
                return self.fail(span, message, help);
            }
        };
        let (v, eps) = (self.eval(vector), eps.map(|eps| (eps, self.eval(eps))));
        let (v, bits) = v?;
        if !matches!(v.shape(), Shape::Vector(_)) {
            let message = format!("`{function}` takes vector, found {}", v.shape());
            return self.fail(vector.span, message, "the length of a number is `abs(x)`");
        }
        let mut bits = 2 * bits + 8;
        let mut square = v.dot(self.graph, &v).ok()?.scalar("norm").ok()?;
        if let Some((expr, value)) = eps {
            let (eps, eps_bits) = value?;
            let Value::Scalar(eps) = eps else {
                let message =
                    format!("the second argument of `{function}` is a number, found {}", eps.shape());
                return self.fail(expr.span, message, "a small length, such as a parameter `eps`");
            };
            let more = self.graph.mul(eps, eps);
            square = self.graph.add(square, more);
            bits += 2 * eps_bits;
        }
        let length = self.graph.sqrt(square);
        if function == "norm" {
            return Some((Value::Scalar(length), bits));
        }
        if self.graph.is_zero(square) {
            let help = "zero has no direction: `unit(v, eps)` is zero there";
            return self.fail(vector.span, "division by zero", help);
        }
        let Ok(inverse) = self.graph.power_product(&[(length, -Rational::from_integer(1.into()))]) else {
            return self.fail(vector.span, "division by zero", "zero has no direction");
        };
        Some((v.scale(self.graph, inverse), bits))
    }
}
