//! Rotations, lengths and directions.
//!
//! Deliberately does not know: attitudes of a model, items.

use super::ast::{Expr, Node};
use super::diagnostic::Span;
use super::eval::{Evaluator, Weighed};
use super::shape::Shape;
use super::value::Value;
use crate::expr::{ExprId, Func, Rational};

/// Axes by their words, as `rot` takes them.
const AXES: [&str; 3] = ["e1", "e2", "e3"];

impl Evaluator<'_> {
    /// `rot(phi)` of the plane, `rot(axis, phi)` of space: by the angle `phi` about an axis of length one, the matrix
    /// `a a^T + cos(phi) (1 - a a^T) + sin(phi) hat(a)`, whose columns are the turned axes.
    pub(super) fn rotation(&mut self, arguments: &[Expr], span: Span) -> Option<Weighed> {
        let (axis, angle) = match arguments {
            [angle] => (None, angle),
            [axis, angle] => (Some(axis), angle),
            _ => {
                let message = format!("`rot` takes 1 or 2 arguments, found {}", arguments.len());
                return self.fail(span, message, "write `rot(phi)` in the plane, `rot(e3, phi)` in space");
            }
        };
        let axis = match axis {
            Some(axis) => Some(self.axis(axis)?),
            None => None,
        };
        let (value, bits) = self.eval(angle)?;
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
