//! Scalars, vectors and matrices of expressions, with operations that check shapes.

use std::collections::BTreeMap;

use num_traits::{One, Signed, ToPrimitive, Zero};

use super::limits::{MAX_DIM, MAX_EXPONENT};
use super::shape::{Expected, Operation, Shape, ValueError};
use crate::algebra::tableau::{MAX_DETERMINANT, determinant};
use hamel_expr::{ExprId, Func, Graph, Rational, Style};

/// An expression value: a number, a vector or a matrix of symbolic expressions.
///
/// All operations check shapes; those that can fail return [`ValueError`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// A number.
    Scalar(ExprId),
    /// A column.
    Vector(Vec<ExprId>),
    /// A matrix, entries row by row.
    Matrix {
        /// Number of rows.
        rows: usize,
        /// Number of columns.
        columns: usize,
        /// `rows * columns` entries.
        entries: Vec<ExprId>,
    },
}

type Outcome = Result<Value, ValueError>;

impl Value {
    /// A number.
    pub fn number(g: &mut Graph, q: impl Into<Rational>) -> Value {
        Value::Scalar(g.rational(q.into()))
    }

    /// The `n` by `n` identity.
    pub fn identity(g: &mut Graph, n: usize) -> Value {
        let entries = (0..n * n).map(|k| if k / n == k % n { g.one() } else { g.zero() }).collect();
        Value::Matrix { rows: n, columns: n, entries }
    }

    /// A vector of numbers, or a matrix of rows.
    ///
    /// # Errors
    /// [`ValueError::Ragged`] when the entries differ in shape, [`ValueError::Argument`] for matrices as entries.
    pub fn list(parts: Vec<Value>) -> Outcome {
        if parts.len() > MAX_DIM {
            return Err(ValueError::TooLarge);
        }
        let first = parts.first().map_or(Shape::Scalar, Value::shape);
        if let Some(other) = parts.iter().map(Value::shape).find(|shape| *shape != first) {
            return Err(ValueError::Ragged { first, other });
        }
        let rows = parts.len();
        let entries: Vec<ExprId> = parts.into_iter().flat_map(Value::into_entries).collect();
        match first {
            Shape::Scalar => Ok(Value::Vector(entries)),
            Shape::Vector(columns) => Ok(Value::Matrix { rows, columns, entries }),
            found => Err(ValueError::Brackets { expected: Expected::NumbersOrRows, found }),
        }
    }

    /// The shape.
    pub fn shape(&self) -> Shape {
        match self {
            Value::Scalar(_) => Shape::Scalar,
            Value::Vector(v) => Shape::Vector(v.len()),
            Value::Matrix { rows, columns, .. } => Shape::Matrix(*rows, *columns),
        }
    }

    /// All entries, row by row.
    pub fn entries(&self) -> &[ExprId] {
        match self {
            Value::Scalar(e) => std::slice::from_ref(e),
            Value::Vector(v) => v,
            Value::Matrix { entries, .. } => entries,
        }
    }

    /// A value of the same shape with other entries, of which there have to be as many.
    pub(super) fn with_entries(&self, entries: Vec<ExprId>) -> Value {
        match self {
            Value::Scalar(e) => Value::Scalar(entries.first().copied().unwrap_or(*e)),
            Value::Vector(_) => Value::Vector(entries),
            Value::Matrix { rows, columns, .. } => Value::Matrix { rows: *rows, columns: *columns, entries },
        }
    }

    /// All entries, row by row.
    pub fn into_entries(self) -> Vec<ExprId> {
        match self {
            Value::Scalar(e) => vec![e],
            Value::Vector(v) => v,
            Value::Matrix { entries, .. } => entries,
        }
    }

    /// The expression of a number.
    ///
    /// # Errors
    /// [`ValueError::Argument`] for a vector or a matrix.
    pub fn scalar(&self, function: &str) -> Result<ExprId, ValueError> {
        match self {
            Value::Scalar(e) => Ok(*e),
            _ => Err(ValueError::Argument {
                function: function.into(),
                expected: Expected::Number,
                found: self.shape(),
            }),
        }
    }

    /// The same shape with every entry mapped.
    #[must_use]
    pub fn map(&self, mut f: impl FnMut(ExprId) -> ExprId) -> Value {
        match self {
            Value::Scalar(e) => Value::Scalar(f(*e)),
            Value::Vector(v) => Value::Vector(v.iter().map(|e| f(*e)).collect()),
            Value::Matrix { rows, columns, entries } => Value::Matrix {
                rows: *rows,
                columns: *columns,
                entries: entries.iter().map(|e| f(*e)).collect(),
            },
        }
    }

    fn same_shape(&self, other: &Value, operation: Operation) -> Result<(), ValueError> {
        if self.shape() == other.shape() {
            return Ok(());
        }
        Err(ValueError::Shapes { operation, left: self.shape(), right: other.shape() })
    }

    /// `a + b`.
    ///
    /// # Errors
    /// [`ValueError::Shapes`] unless both have one shape.
    pub fn add(&self, g: &mut Graph, other: &Value) -> Outcome {
        Value::sum_of(g, &[(false, self), (false, other)])
    }

    /// `a - b`.
    ///
    /// # Errors
    /// [`ValueError::Shapes`] unless both have one shape.
    pub fn sub(&self, g: &mut Graph, other: &Value) -> Outcome {
        Value::sum_of(g, &[(false, self), (true, other)])
    }

    /// A signed sum; the flag marks subtracted operands.
    ///
    /// # Errors
    /// [`ValueError::Shapes`] for the first operand whose shape differs from the first one's.
    pub fn sum_of(g: &mut Graph, operands: &[(bool, &Value)]) -> Outcome {
        let Some((_, first)) = operands.first() else { return Ok(Value::Scalar(g.zero())) };
        for (negative, operand) in operands {
            first.same_shape(operand, if *negative { Operation::Subtract } else { Operation::Add })?;
        }
        let mut position = 0;
        Ok(first.map(|_| {
            let summands: Vec<(ExprId, Rational)> = operands
                .iter()
                .map(|(negative, v)| {
                    (v.entries()[position], if *negative { -Rational::one() } else { Rational::one() })
                })
                .collect();
            position += 1;
            g.linear_combination(&summands)
        }))
    }

    /// `-a`.
    #[must_use]
    pub fn neg(&self, g: &mut Graph) -> Value {
        self.map(|e| g.neg(e))
    }

    /// `s * a` for a number `s`.
    #[must_use]
    pub fn scale(&self, g: &mut Graph, s: ExprId) -> Value {
        self.map(|e| g.mul(s, e))
    }

    /// `a * b`: scaling when one is a number, otherwise the matrix product with vectors as columns. A product with one
    /// row and one column is a number, so `transpose(v) * A * v` is one.
    ///
    /// # Errors
    /// [`ValueError::Shapes`] when the shapes do not match.
    pub fn mul(&self, g: &mut Graph, other: &Value) -> Outcome {
        match (self, other) {
            (Value::Scalar(a), b) => return Ok(b.scale(g, *a)),
            (a, Value::Scalar(b)) => return Ok(a.scale(g, *b)),
            _ => {}
        }
        let mismatch = || ValueError::Shapes {
            operation: Operation::Multiply,
            left: self.shape(),
            right: other.shape(),
        };
        let columns_of = |v: &Value| match v.shape() {
            Shape::Matrix(n, m) => (n, m),
            Shape::Vector(n) => (n, 1),
            Shape::Scalar => (1, 1),
        };
        let ((n, k), (k2, m)) = (columns_of(self), columns_of(other));
        if k != k2 || matches!((self, other), (Value::Vector(_), Value::Vector(_))) {
            return Err(mismatch());
        }
        let (a, b) = (self.entries(), other.entries());
        let zero = g.zero();
        let mut entries = Vec::with_capacity(n * m);
        for i in 0..n {
            let own: Vec<usize> = (0..k).filter(|l| a[i * k + l] != zero).collect();
            for j in 0..m {
                let row = own.iter().filter(|l| b[*l * m + j] != zero);
                let terms: Vec<ExprId> = row.map(|l| g.mul(a[i * k + l], b[l * m + j])).collect();
                entries.push(g.sum(&terms));
            }
        }
        Ok(match (n, m, other) {
            (1, 1, _) => Value::Scalar(entries[0]),
            (_, _, Value::Vector(_)) => Value::Vector(entries),
            _ => Value::Matrix { rows: n, columns: m, entries },
        })
    }

    /// `a / s` for a number `s`.
    ///
    /// # Errors
    /// [`ValueError::Shapes`] unless `s` is a number, [`ValueError::DivisionByZero`].
    pub fn div(&self, g: &mut Graph, other: &Value) -> Outcome {
        let Value::Scalar(s) = other else {
            return Err(ValueError::Shapes {
                operation: Operation::Divide,
                left: self.shape(),
                right: other.shape(),
            });
        };
        let one = g.one();
        let inverse = g.div(one, *s).map_err(|_| ValueError::DivisionByZero)?;
        Ok(self.scale(g, inverse))
    }

    /// `a^b` for numbers: a rational power, `exp(b ln a)` otherwise.
    ///
    /// # Errors
    /// [`ValueError::Shapes`], [`ValueError::Exponent`] beyond 1000, [`ValueError::DivisionByZero`] for `0^-1`,
    /// [`ValueError::NoValue`] for `(-1)^(1/2)`.
    pub fn pow(&self, g: &mut Graph, exponent: &Value) -> Outcome {
        if let (Value::Matrix { rows, columns, .. }, Value::Scalar(power)) = (self, exponent)
            && rows == columns
            && let Some(q) = g.as_rational(*power).cloned()
        {
            return self.matrix_power(g, &q);
        }
        let (Value::Scalar(base), Value::Scalar(power)) = (self, exponent) else {
            return Err(ValueError::Shapes {
                operation: Operation::Raise,
                left: self.shape(),
                right: exponent.shape(),
            });
        };
        let Some(q) = g.as_rational(*power).cloned() else {
            let log = g.func(Func::Ln, *base);
            let product = g.mul(*power, log);
            let value = g.func(Func::Exp, product);
            return with_value(g, value);
        };
        let small = |n: Option<u32>| n.is_some_and(|n| n <= MAX_EXPONENT);
        if !small(q.numer().abs().to_u32()) || !small(q.denom().to_u32()) {
            return Err(ValueError::Exponent(q));
        }
        let value = g.pow(*base, &q).map_err(|_| ValueError::DivisionByZero)?;
        with_value(g, value)
    }

    /// Whether it is a square matrix with nothing beside its diagonal.
    pub fn is_diagonal(&self, g: &Graph) -> bool {
        let Value::Matrix { rows, columns, entries } = self else { return false };
        let is_zero = |(k, e): (usize, &ExprId)| *e == g.zero() || k / columns == k % columns;
        rows == columns && entries.iter().enumerate().all(is_zero)
    }

    /// Number of entries that are not zero.
    pub fn n_nonzero(&self, g: &Graph) -> usize {
        self.entries().iter().filter(|e| **e != g.zero()).count()
    }

    /// Powers of a square matrix: products for a positive whole number, entry by entry for a diagonal matrix.
    fn matrix_power(&self, g: &mut Graph, q: &Rational) -> Outcome {
        let Value::Matrix { rows, columns, entries } = self else { return Err(ValueError::TooLarge) };
        let n = *rows;
        if self.is_diagonal(g) {
            let power = Value::number(g, q.clone());
            let mut raised = entries.clone();
            for k in (0..n).map(|i| i * n + i) {
                if let Value::Scalar(e) = Value::Scalar(entries[k]).pow(g, &power)? {
                    raised[k] = e;
                }
            }
            return Ok(Value::Matrix { rows: n, columns: *columns, entries: raised });
        }
        let times = q.numer().to_u32().filter(|n| q.is_integer() && (1..=MAX_EXPONENT).contains(n));
        let Some(times) = times else { return Err(ValueError::MatrixPower(q.clone())) };
        let (mut square, mut rest, mut power) = (self.clone(), times, None::<Value>);
        loop {
            if rest % 2 == 1 {
                power = Some(match power {
                    Some(before) => before.mul(g, &square)?,
                    None => square.clone(),
                });
            }
            rest /= 2;
            if rest == 0 {
                return power.ok_or(ValueError::TooLarge);
            }
            square = square.mul(g, &square)?;
        }
    }

    /// `sum_i a_i b_i`.
    ///
    /// # Errors
    /// [`ValueError::Shapes`] unless both are vectors of one dimension.
    pub fn dot(&self, g: &mut Graph, other: &Value) -> Outcome {
        match (self, other) {
            (Value::Vector(a), Value::Vector(b)) if a.len() == b.len() => Ok(Value::Scalar(g.dot(a, b))),
            _ => Err(ValueError::Shapes {
                operation: Operation::Dot,
                left: self.shape(),
                right: other.shape(),
            }),
        }
    }

    /// The cross product in `R^3`.
    ///
    /// # Errors
    /// [`ValueError::Shapes`] unless both are `vector(3)`.
    pub fn cross(&self, g: &mut Graph, other: &Value) -> Outcome {
        let (Value::Vector(a), Value::Vector(b)) = (self, other) else {
            return Err(ValueError::Shapes {
                operation: Operation::Cross,
                left: self.shape(),
                right: other.shape(),
            });
        };
        if (a.len(), b.len()) != (3, 3) {
            return Err(ValueError::Shapes {
                operation: Operation::Cross,
                left: self.shape(),
                right: other.shape(),
            });
        }
        let mut entry = |i: usize, j: usize| {
            let (p, q) = (g.mul(a[i], b[j]), g.mul(a[j], b[i]));
            g.sub(p, q)
        };
        Ok(Value::Vector(vec![entry(1, 2), entry(2, 0), entry(0, 1)]))
    }

    /// The Euclidean norm of a vector.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless it is a vector.
    pub fn norm(&self, g: &mut Graph) -> Outcome {
        self.vector("norm")?;
        let square = self.dot(g, self)?.scalar("norm")?;
        Ok(Value::Scalar(g.sqrt(square)))
    }

    fn vector(&self, function: &'static str) -> Result<&[ExprId], ValueError> {
        match self {
            Value::Vector(v) => Ok(v),
            _ => Err(ValueError::Argument {
                function: function.into(),
                expected: Expected::Vector,
                found: self.shape(),
            }),
        }
    }

    fn square(&self, function: &'static str) -> Result<(usize, &[ExprId]), ValueError> {
        match self {
            Value::Matrix { rows, columns, entries } if rows == columns => Ok((*rows, entries)),
            _ => Err(ValueError::Argument {
                function: function.into(),
                expected: Expected::SquareMatrix,
                found: self.shape(),
            }),
        }
    }

    /// The transposed matrix; a vector becomes a matrix with one row.
    ///
    /// # Errors
    /// [`ValueError::Argument`] for a number.
    pub fn transpose(&self) -> Outcome {
        match self {
            Value::Scalar(_) => Err(ValueError::Argument {
                function: "transpose".into(),
                expected: Expected::VectorOrMatrix,
                found: self.shape(),
            }),
            Value::Vector(v) => Ok(Value::Matrix { rows: 1, columns: v.len(), entries: v.clone() }),
            Value::Matrix { rows, columns, entries } => {
                let (n, m) = (*rows, *columns);
                let entries = (0..n * m).map(|k| entries[(k % n) * m + k / n]).collect();
                Ok(Value::Matrix { rows: m, columns: n, entries })
            }
        }
    }

    /// The diagonal matrix of a vector, or the diagonal of a square matrix.
    ///
    /// # Errors
    /// [`ValueError::Argument`] for anything else.
    pub fn diag(&self, g: &mut Graph) -> Outcome {
        if let Value::Matrix { .. } = self {
            let (n, entries) = self.square("diag")?;
            return Ok(Value::Vector((0..n).map(|i| entries[i * n + i]).collect()));
        }
        let v = self.vector("diag")?;
        let n = v.len();
        let entries = (0..n * n).map(|k| if k / n == k % n { v[k / n] } else { g.zero() }).collect();
        Ok(Value::Matrix { rows: n, columns: n, entries })
    }

    /// The antisymmetric matrix of a vector of `R^3`: `hat(a) b = a x b`.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless it is `vector(3)`.
    pub fn hat(&self, g: &mut Graph) -> Outcome {
        let wrong =
            ValueError::Argument { function: "hat".into(), expected: Expected::Vector3, found: self.shape() };
        let Value::Vector(v) = self else { return Err(wrong) };
        let [a, b, c] = v.as_slice() else { return Err(wrong) };
        let (a, b, c, zero) = (*a, *b, *c, g.zero());
        let (na, nb, nc) = (g.neg(a), g.neg(b), g.neg(c));
        Ok(Value::Matrix { rows: 3, columns: 3, entries: vec![zero, nc, b, c, zero, na, nb, a, zero] })
    }

    /// The trace of a square matrix.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless it is square.
    pub fn trace(&self, g: &mut Graph) -> Outcome {
        let (n, entries) = self.square("trace")?;
        let diagonal: Vec<ExprId> = (0..n).map(|i| entries[i * n + i]).collect();
        Ok(Value::Scalar(g.sum(&diagonal)))
    }

    /// The sum of the entries of a vector.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless it is a vector.
    pub fn sum(&self, g: &mut Graph) -> Outcome {
        let v = self.vector("sum")?;
        Ok(Value::Scalar(g.sum(v)))
    }

    /// The determinant of a square matrix with at most 8 rows.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless it is square and small.
    pub fn det(&self, g: &mut Graph) -> Outcome {
        let (n, a) = self.square("det")?;
        if n > MAX_DETERMINANT {
            let found = self.shape();
            return Err(ValueError::Argument {
                function: "det".into(),
                expected: Expected::AtMostRows(MAX_DETERMINANT),
                found,
            });
        }
        let rows: Vec<Vec<ExprId>> = (0..n).map(|i| a[i * n..(i + 1) * n].to_vec()).collect();
        Ok(Value::Scalar(determinant(g, &rows)))
    }

    /// An elementary function of a number.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless it is a number, [`ValueError::LogarithmOfZero`], [`ValueError::NoValue`].
    pub fn func(&self, g: &mut Graph, f: Func) -> Outcome {
        let a = self.scalar(f.name())?;
        if f == Func::Ln && g.as_rational(a).is_some_and(Zero::is_zero) {
            return Err(ValueError::LogarithmOfZero);
        }
        let value = g.func(f, a);
        with_value(g, value)
    }

    /// `sinc` and `cosc` of a number `x`: functions of Stumpff of `x^2`, which are smooth where `x` vanishes.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless it is a number.
    pub fn of_square(&self, g: &mut Graph, f: Func, name: &'static str) -> Outcome {
        let x = self.scalar(name)?;
        let square = g.powi(x, 2);
        Ok(Value::Scalar(g.func(f, square)))
    }

    /// The angle of the point `(x, y)` in `(-pi, pi]`, `self` being `y`.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless both are numbers, [`ValueError::AngleOfOrigin`] when both are zero.
    pub fn atan2(&self, g: &mut Graph, x: &Value) -> Outcome {
        let (y, x) = (self.scalar("atan2")?, x.scalar("atan2")?);
        if g.is_zero(y) && g.is_zero(x) {
            return Err(ValueError::AngleOfOrigin);
        }
        Ok(Value::Scalar(g.atan2(y, x)))
    }

    /// The square root of a number.
    ///
    /// # Errors
    /// [`ValueError::Argument`] unless it is a number, [`ValueError::NoValue`].
    pub fn sqrt(&self, g: &mut Graph) -> Outcome {
        let a = self.scalar("sqrt")?;
        let value = g.sqrt(a);
        with_value(g, value)
    }

    /// Entry `i` of a vector, row `i` of a matrix; `i` counts from one.
    ///
    /// # Errors
    /// [`ValueError::Index`], [`ValueError::Argument`] for a number.
    pub fn row(&self, i: usize) -> Outcome {
        let outside = |len: usize| ValueError::Index { index: i.to_string(), len };
        match self {
            Value::Scalar(_) => {
                Err(ValueError::Brackets { expected: Expected::VectorOrMatrix, found: self.shape() })
            }
            Value::Vector(v) => i
                .checked_sub(1)
                .and_then(|i| v.get(i))
                .map(|e| Value::Scalar(*e))
                .ok_or_else(|| outside(v.len())),
            Value::Matrix { rows, columns, entries } => {
                if i == 0 || i > *rows {
                    return Err(outside(*rows));
                }
                Ok(Value::Vector(entries[(i - 1) * columns..i * columns].to_vec()))
            }
        }
    }

    /// The sides of an equation; a side that is the number 0 gets the shape of the other: `v = 0` for a vector `v`.
    pub(super) fn fit_zero(g: &Graph, left: &Value, right: &Value) -> (Value, Value) {
        let zero = g.zero();
        match (left, right) {
            (Value::Scalar(e), other) if *e == zero => (other.map(|_| zero), other.clone()),
            (other, Value::Scalar(e)) if *e == zero => (other.clone(), other.map(|_| zero)),
            _ => (left.clone(), right.clone()),
        }
    }

    /// The value with every entry replaced by its image in the table of a function of velocities.
    ///
    /// # Errors
    /// [`ValueError::NotAVelocity`] when an entry has no image, [`ValueError::OrderTooHigh`] when it is a derivative of
    /// the highest order.
    pub(super) fn image(
        &self,
        function: &'static str,
        table: &BTreeMap<ExprId, ExprId>,
    ) -> Result<Value, ValueError> {
        if let Some(other) = self.entries().iter().find(|e| !table.contains_key(e)) {
            let is_derivative = function == "ddt" && table.values().any(|image| image == other);
            return Err(match is_derivative {
                true => ValueError::OrderTooHigh { function },
                false => ValueError::NotAVelocity { function },
            });
        }
        Ok(self.map(|e| table.get(&e).copied().unwrap_or(e)))
    }
}

/// A number of which nothing is known that shows it to be none.
fn with_value(g: &mut Graph, e: ExprId) -> Outcome {
    match g.is_number_without_value(e) {
        true => Err(ValueError::NoValue(g.display(e, Style::Plain))),
        false => Ok(Value::Scalar(e)),
    }
}
