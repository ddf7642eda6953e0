//! Rates along a motion, and what turns with it.
//!
//! The angular velocity of a matrix that is made of rotations is put together from theirs, `B^T w_A + w_B` for a
//! product
//! `A B`, so that chains of bodies keep the form in which each is written by the one before.
//!
//! What rotations and places are made of is noted as they are made, for velocities in frames that turn.
//!
//! Deliberately does not know: items, forces, which velocities a model has.

use super::ast::Expr;
use super::diagnostic::Span;
use super::eval::{Evaluator, Weighed};
use super::motions::Place;
use super::rates::rate_of;
use super::shape::Shape;
use super::value::Value;
use hamel_expr::{ExprId, Func, Graph};

/// The axial vector of a skew matrix of three rows, the number of one of two.
fn axial(entry: impl Fn(usize, usize) -> ExprId, n: usize) -> Vec<ExprId> {
    match n {
        2 => vec![entry(1, 0)],
        _ => vec![entry(2, 1), entry(0, 2), entry(1, 0)],
    }
}

impl Evaluator<'_> {
    /// `rate(x)`: the derivative by time of what is made of coordinates, time and parameters.
    pub(super) fn rate(&mut self, argument: &Expr) -> Option<Weighed> {
        let (value, bits) = self.eval(argument)?;
        let value = self.rate_of_value(&value, argument.span)?;
        Some((value, bits + 16))
    }

    pub(super) fn rate_of_value(&mut self, value: &Value, span: Span) -> Option<Value> {
        let Some(rates) = self.rates else {
            let help =
                "it is known where the coordinates are: in definitions, the Lagrangian, forces and outputs";
            return self.fail(span, "a rate is not known here", help);
        };
        self.charge(4 * value.entries().len() * (rates.len() + 1), span)?;
        let mut entries = Vec::new();
        for e in value.entries() {
            match rate_of(self.graph, *e, rates) {
                Ok(rate) => entries.push(rate),
                Err(symbol) => {
                    let message = format!("the rate of `{}` is not known", self.graph.name(symbol));
                    let help = "`rate` takes what is made of coordinates, time and parameters";
                    return self.fail(span, message, help);
                }
            }
        }
        Some(value.with_entries(entries))
    }

    /// `spin(R)`: the angular velocity of the frame with the attitude `R`, in that frame, `hat(w) = R^T R'`; for an
    /// angle of the plane its rate.
    pub(super) fn spin(&mut self, argument: &Expr) -> Option<Weighed> {
        let (value, bits) = self.eval(argument)?;
        let value = self.spin_of_value(&value, argument.span)?;
        Some((value, 2 * bits + 16))
    }

    pub(super) fn spin_of_value(&mut self, value: &Value, span: Span) -> Option<Value> {
        let n = match value.shape() {
            Shape::Scalar => return self.rate_of_value(value, span),
            Shape::Matrix(n, m) if n == m && (2..=3).contains(&n) => n,
            shape => {
                let help = "write an angle, or a product of rotations such as `rot(e3, phi)*rot(e1, theta)`";
                return self.fail(span, format!("an attitude is a rotation matrix, found {shape}"), help);
            }
        };
        let shaped = |w: Vec<ExprId>| match w.as_slice() {
            [only] => Value::Scalar(*only),
            _ => Value::Vector(w),
        };
        if let Some(w) = self.motions.spins.get(value.entries()) {
            return Some(shaped(w.clone()));
        }
        if !self.is_orthogonal(value, n) {
            let help = self.advice_for_rotation(value, n);
            return self.fail(span, "the matrix is no rotation", help);
        }
        let rate = self.rate_of_value(value, span)?;
        let back = value.transpose().ok()?;
        let skew = back.mul(self.graph, &rate).ok()?;
        let entries = skew.entries();
        Some(shaped(axial(|i, j| entries[i * n + j], n)))
    }

    /// Whether `R^T R = 1` is seen.
    pub(super) fn is_orthogonal(&mut self, value: &Value, n: usize) -> bool {
        let Ok(square) = value.transpose().and_then(|back| back.mul(self.graph, value)) else { return false };
        square.entries().to_vec().into_iter().enumerate().all(|(k, entry)| {
            let unit = if k / n == k % n { self.graph.one() } else { self.graph.zero() };
            let excess = self.graph.sub(entry, unit);
            self.graph.is_zero(excess)
        })
    }

    /// Notes the angular velocity of a rotation about an axis, where it is known: `axis phi'`.
    pub(super) fn note_rotation(&mut self, matrix: &Value, axis: Option<&[ExprId]>, phi: ExprId) {
        self.motions.rotations.insert(matrix.entries().to_vec());
        let Some(rates) = self.rates else { return };
        let Ok(rate) = rate_of(self.graph, phi, rates) else { return };
        // An axis that moves has an angular velocity of its own.
        let zero = self.graph.zero();
        let rests = |e: &ExprId, g: &Graph| {
            g.free_symbols(*e).iter().all(|symbol| rates.get(symbol).is_some_and(|rate| *rate == zero))
        };
        let w = match axis {
            None => vec![rate],
            Some(axis) if axis.iter().all(|a| rests(a, self.graph)) => {
                axis.iter().map(|a| self.graph.mul(*a, rate)).collect()
            }
            Some(_) => return,
        };
        self.motions.spins.insert(matrix.entries().to_vec(), w);
    }

    /// Notes the angular velocity of the rotation by a vector `v` with the square `v.v`, where it is known:
    /// `v' - c_2 v x v' + c_3 v x (v x v')`.
    ///
    /// # Source
    /// Iserles, Munthe-Kaas, Norsett, Zanna 2000, Lie-group methods, section B.1.
    pub(super) fn note_exponential(&mut self, matrix: &Value, v: [ExprId; 3], square: ExprId) {
        self.motions.rotations.insert(matrix.entries().to_vec());
        let Some(rates) = self.rates else { return };
        let Ok(rate) = v.into_iter().map(|e| rate_of(self.graph, e, rates)).collect::<Result<Vec<_>, _>>()
        else {
            return;
        };
        let g = &mut *self.graph;
        let [two, three] = [2, 3].map(|k| g.func(Func::Stumpff(k), square));
        let cross = |g: &mut Graph, a: &[ExprId], b: &[ExprId]| -> Vec<ExprId> {
            let component = |k: usize| {
                let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                let (plus, minus) = (g.mul(a[i], b[j]), g.mul(a[j], b[i]));
                g.sub(plus, minus)
            };
            (0..3).map(component).collect()
        };
        let once = cross(g, &v, &rate);
        let twice = cross(g, &v, &once);
        let component = |k: usize| {
            let (bent, turned) = (g.mul(two, once[k]), g.mul(three, twice[k]));
            let rest = g.sub(turned, bent);
            g.add(rate[k], rest)
        };
        self.motions.spins.insert(matrix.entries().to_vec(), (0..3).map(component).collect());
    }

    /// Whether a matrix is seen to be a rotation: made of rotations, or orthogonal with the determinant one.
    pub(super) fn is_rotation(&mut self, value: &Value, n: usize) -> bool {
        if self.motions.is_rotation(value.entries()) {
            return true;
        }
        let Ok(Value::Scalar(determinant)) = value.det(self.graph) else { return false };
        let one = self.graph.one();
        let excess = self.graph.sub(determinant, one);
        let is_rotation = self.graph.is_zero(excess) && self.is_orthogonal(value, n);
        if is_rotation {
            self.motions.rotations.insert(value.entries().to_vec());
        }
        is_rotation
    }

    /// Notes a rotation of numbers, which rests.
    fn note_numbers(&mut self, value: &Value) {
        let n = match value.shape() {
            Shape::Matrix(n, m) if n == m && (2..=3).contains(&n) => n,
            _ => return,
        };
        let is_number = |e: &ExprId| self.graph.as_rational(*e).is_some();
        if !self.motions.spins.contains_key(value.entries())
            && value.entries().iter().all(is_number)
            && self.is_rotation(value, n)
        {
            let rest = vec![self.graph.zero(); if n == 2 { 1 } else { 3 }];
            self.motions.spins.insert(value.entries().to_vec(), rest);
        }
    }

    /// Notes that a product of rotations is one, and its angular velocity: `B^T w_A + w_B`.
    pub(super) fn note_product(&mut self, left: &Value, right: &Value, product: &Value) {
        if [left, right].iter().any(|value| self.motions.is_rotation(value.entries())) {
            self.note_numbers(left);
            self.note_numbers(right);
        }
        if [left, right].iter().all(|value| self.motions.is_rotation(value.entries())) {
            self.motions.rotations.insert(product.entries().to_vec());
        }
        let known = |value: &Value| self.motions.spins.get(value.entries()).cloned();
        let (Some(a), Some(b)) = (known(left), known(right)) else { return };
        let turned = match a.as_slice() {
            [_] => a,
            _ => {
                let back = right.transpose().and_then(|back| back.mul(self.graph, &Value::Vector(a)));
                let Ok(turned) = back else { return };
                turned.into_entries()
            }
        };
        let w = turned.iter().zip(&b).map(|(a, b)| self.graph.add(*a, *b)).collect();
        self.motions.spins.insert(product.entries().to_vec(), w);
    }

    /// Notes the inverse of a rotation, and its angular velocity: `-R w`.
    pub(super) fn note_inverse(&mut self, matrix: &Value, inverse: &Value) {
        if self.motions.is_rotation(matrix.entries()) {
            self.motions.rotations.insert(inverse.entries().to_vec());
        }
        let Some(w) = self.motions.spins.get(matrix.entries()).cloned() else { return };
        let turned = match w.as_slice() {
            [_] => w,
            _ => match matrix.mul(self.graph, &Value::Vector(w)) {
                Ok(turned) => turned.into_entries(),
                Err(_) => return,
            },
        };
        let w = turned.iter().map(|e| self.graph.neg(*e)).collect();
        self.motions.spins.insert(inverse.entries().to_vec(), w);
    }

    /// Notes that a rotation of space is a product of two, or that a vector of space is turned by one.
    pub(super) fn note_turned(&mut self, left: &Value, right: &Value, product: &Value) {
        let is_rotation =
            |value: &Value| value.entries().len() == 9 && self.motions.spins.contains_key(value.entries());
        if !is_rotation(left) {
            return;
        }
        let (rotation, made) = (left.entries(), product.entries());
        match right {
            Value::Vector(c) => self.motions.note(made, Place::Turned(rotation.to_vec(), c.clone())),
            _ if is_rotation(right) => self.motions.note_factors(made, [rotation, right.entries()]),
            _ => {}
        }
    }

    /// Notes the places that a place is a sum of.
    pub(super) fn note_sum(&mut self, operands: &[(bool, &Value)], sum: &Value) {
        if operands.iter().any(|(_, value)| self.motions.places.contains_key(value.entries())) {
            let list = operands.iter().map(|(negative, value)| (*negative, value.entries().to_vec()));
            self.motions.note(sum.entries(), Place::Sum(list.collect()));
        }
    }

    /// The velocity of a place of space in the frame with an attitude, where both are written so that the velocity
    /// follows from the places before. Nothing where they are not, or where the result is not seen to be `R^T p'`.
    pub(super) fn velocity_in_frame(
        &mut self,
        place: &Value,
        velocity: &Value,
        attitude: &Value,
    ) -> Option<Value> {
        let rates = self.rates?;
        if place.entries().len() != 3 || attitude.entries().len() != 9 {
            return None;
        }
        let known = (place.entries(), velocity.entries());
        self.motions.in_frame(self.graph, rates, known, attitude.entries()).map(Value::Vector)
    }
}
