//! Shapes of values, and what can be wrong with an operation on values.
//!
//! Deliberately does not know: expressions.

use std::fmt;

use super::limits::{MAX_DIM, MAX_EXPONENT};
use hamel_expr::Rational;

/// Shape of a [`Value`](super::Value).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// A number.
    Scalar,
    /// `n` numbers.
    Vector(usize),
    /// Rows and columns.
    Matrix(usize, usize),
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Shape::Scalar => f.write_str("a number"),
            Shape::Vector(n) => write!(f, "vector({n})"),
            Shape::Matrix(n, m) => write!(f, "matrix({n}, {m})"),
        }
    }
}

/// An operation on two values.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Operation {
    /// `a + b`.
    Add,
    /// `a - b`.
    Subtract,
    /// `a * b`.
    Multiply,
    /// `a / b`.
    Divide,
    /// `a ^ b`.
    Raise,
    /// `a = b`, in a constraint.
    Equate,
    /// `dot(a, b)`.
    Dot,
    /// `cross(a, b)`.
    Cross,
}

/// What a function or a bracket takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Expected {
    /// A number.
    Number,
    /// A vector.
    Vector,
    /// A vector with three components.
    Vector3,
    /// A matrix with as many rows as columns.
    SquareMatrix,
    /// A vector or a matrix.
    VectorOrMatrix,
    /// Numbers, or vectors as rows.
    NumbersOrRows,
    /// A matrix with at most so many rows.
    AtMostRows(usize),
}

impl fmt::Display for Expected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Expected::Number => f.write_str("a number"),
            Expected::Vector => f.write_str("a vector"),
            Expected::Vector3 => f.write_str("vector(3)"),
            Expected::SquareMatrix => f.write_str("a square matrix"),
            Expected::VectorOrMatrix => f.write_str("a vector or a matrix"),
            Expected::NumbersOrRows => f.write_str("numbers or rows"),
            Expected::AtMostRows(n) => write!(f, "at most {n} rows"),
        }
    }
}

/// Why an operation on values is impossible.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum ValueError {
    /// The operation is not defined for these two shapes.
    Shapes {
        /// What was tried.
        operation: Operation,
        /// First operand.
        left: Shape,
        /// Second operand.
        right: Shape,
    },
    /// A function got an argument of the wrong shape.
    Argument {
        /// Name of the function.
        function: String,
        /// What it takes.
        expected: Expected,
        /// What it got.
        found: Shape,
    },
    /// The entries of a vector or a matrix, or what is indexed, have the wrong shape.
    Brackets {
        /// What the brackets take.
        expected: Expected,
        /// What they got.
        found: Shape,
    },
    /// Division by an expression that is identically zero.
    DivisionByZero,
    /// The logarithm of an expression that is identically zero.
    LogarithmOfZero,
    /// The angle of a point that is the origin identically.
    AngleOfOrigin,
    /// A number that is none, by its text.
    NoValue(String),
    /// An exponent beyond the limits.
    Exponent(Rational),
    /// A power of a matrix that is not diagonal, with an exponent that is no positive whole number.
    MatrixPower(Rational),
    /// An index outside `1..=len`.
    Index {
        /// The index, counted from one.
        index: String,
        /// Number of entries.
        len: usize,
    },
    /// Rows of different lengths, or entries of different shapes.
    Ragged {
        /// Shape of the first entry.
        first: Shape,
        /// Shape of the entry that differs.
        other: Shape,
    },
    /// A displacement or an acceleration of something that is not a velocity.
    NotAVelocity {
        /// `delta` or `ddt`.
        function: &'static str,
    },
    /// A derivative of what is the highest derivative already.
    OrderTooHigh {
        /// `ddt`.
        function: &'static str,
    },
    /// More entries than the limit.
    TooLarge,
}

/// Where functions have values.
pub(crate) const NO_VALUE: &str = "logarithms have values of positive numbers, roots of numbers that are not negative, \
                                   `asin` and `acos` between -1 and 1, `tan` besides odd multiples of pi/2";

impl fmt::Display for ValueError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ValueError::Shapes { operation, left, right } => match operation {
                Operation::Add => write!(f, "cannot add {left} and {right}"),
                Operation::Subtract => write!(f, "cannot subtract {right} from {left}"),
                Operation::Multiply => write!(f, "cannot multiply {left} and {right}"),
                Operation::Divide => write!(f, "cannot divide {left} by {right}"),
                Operation::Raise => write!(f, "cannot raise {left} to {right}"),
                Operation::Equate => write!(f, "cannot equate {left} with {right}"),
                Operation::Dot => write!(f, "`dot` of {left} and {right}"),
                Operation::Cross => write!(f, "`cross` of {left} and {right}"),
            },
            ValueError::Argument { function, expected, found } => {
                write!(f, "`{function}` takes {expected}, found {found}")
            }
            ValueError::Brackets { expected, found } => write!(f, "expected {expected}, found {found}"),
            ValueError::DivisionByZero => f.write_str("division by zero"),
            ValueError::LogarithmOfZero => f.write_str("logarithm of zero"),
            ValueError::AngleOfOrigin => f.write_str("angle of the origin"),
            ValueError::NoValue(text) => write!(f, "`{text}` is no real number"),
            ValueError::MatrixPower(q) => write!(f, "power {q} of a matrix that is not diagonal"),
            ValueError::Exponent(q) => {
                let shown: String = q.to_string().chars().take(40).collect();
                write!(f, "exponent {shown} is too large, the limit is {MAX_EXPONENT}")
            }
            ValueError::Index { index, len } => write!(f, "index {index} is not between 1 and {len}"),
            ValueError::Ragged { first, other } => {
                write!(f, "entries of different shapes: {first} and {other}")
            }
            ValueError::NotAVelocity { function } => write!(f, "`{function}` takes a velocity"),
            ValueError::OrderTooHigh { function } => write!(f, "`{function}` is applied too often"),
            ValueError::TooLarge => write!(f, "more than {MAX_DIM} rows or columns"),
        }
    }
}

impl std::error::Error for ValueError {}

impl ValueError {
    /// What to change, or nothing.
    pub fn help(&self) -> String {
        match self {
            ValueError::Shapes {
                operation: Operation::Multiply,
                left: Shape::Vector(a),
                right: Shape::Vector(b),
            } => {
                if (*a, *b) == (3, 3) {
                    "write `dot(a, b)` or `cross(a, b)`".into()
                } else {
                    "write `dot(a, b)`, or `a * transpose(b)` for the matrix".into()
                }
            }
            ValueError::Shapes {
                operation: Operation::Multiply,
                left: Shape::Matrix(_, m),
                right: Shape::Vector(n),
            } => {
                format!("the matrix needs {n} columns instead of {m}; `transpose` may help")
            }
            ValueError::Shapes {
                operation: Operation::Multiply,
                left: Shape::Matrix(_, m),
                right: Shape::Matrix(n, _),
            } => {
                format!("the columns of the first ({m}) must be the rows of the second ({n})")
            }
            ValueError::Shapes {
                operation: Operation::Multiply,
                left: Shape::Vector(_),
                right: Shape::Matrix(..),
            } => "write `transpose(v) * A` or `A * v`".into(),
            ValueError::Shapes { operation: Operation::Divide, right: Shape::Scalar, .. } => String::new(),
            ValueError::Shapes { operation: Operation::Divide, .. } => {
                "only a number can divide: solve by hand or use `dot`".into()
            }
            ValueError::Shapes { operation: Operation::Raise, left: Shape::Vector(_), .. } => {
                "powers are for numbers: write `dot(v, v)`, or `[v1^2, v2^2]` component by component".into()
            }
            ValueError::Shapes { operation: Operation::Raise, left: Shape::Matrix(..), .. } => {
                "powers are for numbers: write `A * A`; matrices are not inverted".into()
            }
            ValueError::Shapes { operation: Operation::Raise, .. } => "an exponent is a number".into(),
            ValueError::DivisionByZero => {
                "the divisor vanishes identically, whatever the names in it stand for".into()
            }
            ValueError::LogarithmOfZero => "its argument vanishes identically".into(),
            ValueError::AngleOfOrigin => "both coordinates of the point vanish identically".into(),
            ValueError::NoValue(_) => NO_VALUE.into(),
            ValueError::Exponent(_) => "powers are computed exactly".into(),
            ValueError::MatrixPower(_) => "matrices are not inverted: write the solution out".into(),
            ValueError::Ragged { .. } => "a vector holds numbers, a matrix rows of one length".into(),
            ValueError::NotAVelocity { function } => {
                format!(
                    "name a velocity of the base or of the algebra: `{function}(Omega)`, `{function}(q_dot)`"
                )
            }
            ValueError::OrderTooHigh { .. } => {
                "a constraint is of third order at most, `ddt(ddt(v))`, as the state has accelerations and not their rates; a condition on displacements of second, `ddt(v)`".into()
            }
            ValueError::Shapes { operation: Operation::Cross, .. } => "both must be vector(3)".into(),
            ValueError::Shapes { operation: Operation::Dot, .. } => {
                "both must be vectors of one dimension".into()
            }
            ValueError::Shapes {
                operation: Operation::Add | Operation::Subtract | Operation::Equate,
                left,
                right,
            } => match (left, right) {
                (Shape::Scalar, _) | (_, Shape::Scalar) => {
                    "a number and a vector do not add: index the vector, as in `v[1]`, or use `dot`".into()
                }
                _ => "both sides must have the same shape".into(),
            },
            ValueError::Argument { function, expected: Expected::Number, .. } => {
                format!("apply it to each component, as in `[{function}(a), {function}(b)]`")
            }
            ValueError::Argument { function, expected: Expected::Vector, found: Shape::Scalar }
                if function == "norm" =>
            {
                "write `abs(x)` for a number".into()
            }
            _ => String::new(),
        }
    }
}
