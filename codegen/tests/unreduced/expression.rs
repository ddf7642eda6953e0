//! Expressions that can be written as text of the model language and have values.

use super::number::Dual;

/// What an expression contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sym {
    /// A coordinate.
    X(usize),
    /// Its rate.
    XDot(usize),
    /// A component of the group velocity.
    Xi(usize),
    /// A component of the parameters that the group moves.
    A(usize),
    /// Time.
    T,
}

/// An expression. Numbers are tenths: they are the same in text and in value.
#[derive(Clone, Debug)]
pub(crate) enum Expr {
    /// A number of tenths.
    Tenths(i64),
    /// A symbol.
    Sym(Sym),
    /// A sum.
    Sum(Vec<Expr>),
    /// A product.
    Product(Vec<Expr>),
    /// A square.
    Square(Box<Expr>),
    /// The sine.
    Sin(Box<Expr>),
    /// The cosine.
    Cos(Box<Expr>),
}

/// Values of all symbols.
#[derive(Clone, Debug)]
pub(crate) struct Point<T> {
    /// Coordinates.
    pub(crate) x: Vec<T>,
    /// Their rates.
    pub(crate) x_dot: Vec<T>,
    /// Group velocity.
    pub(crate) xi: Vec<T>,
    /// Advected parameters.
    pub(crate) a: Vec<T>,
    /// Time.
    pub(crate) t: T,
}

impl Sym {
    /// Its name in a model, where `w` is the group velocity.
    pub(crate) fn name(self) -> String {
        match self {
            Sym::X(i) => format!("x{}", i + 1),
            Sym::XDot(i) => format!("x{}_dot", i + 1),
            Sym::Xi(k) => format!("w{}", k + 1),
            Sym::A(k) => format!("a{}", k + 1),
            Sym::T => "t".to_owned(),
        }
    }
}

impl Expr {
    /// `a b`.
    pub(crate) fn times(self, other: Expr) -> Expr {
        Expr::Product(vec![self, other])
    }

    /// Zero.
    pub(crate) fn zero() -> Expr {
        Expr::Tenths(0)
    }

    /// As text.
    pub(crate) fn text(&self) -> String {
        let list =
            |parts: &[Expr], between: &str| parts.iter().map(Expr::text).collect::<Vec<_>>().join(between);
        match self {
            Expr::Tenths(n) if *n < 0 => format!("(-{}.{})", -n / 10, -n % 10),
            Expr::Tenths(n) => format!("{}.{}", n / 10, n % 10),
            Expr::Sym(s) => s.name(),
            Expr::Sum(parts) if parts.is_empty() => "0".to_owned(),
            Expr::Product(parts) if parts.is_empty() => "1".to_owned(),
            Expr::Sum(parts) => format!("({})", list(parts, " + ")),
            Expr::Product(parts) => list(parts, "*"),
            Expr::Square(e) => format!("({})^2", e.text()),
            Expr::Sin(e) => format!("sin({})", e.text()),
            Expr::Cos(e) => format!("cos({})", e.text()),
        }
    }

    /// Its value.
    pub(crate) fn value(&self, at: &Point<Dual>) -> Dual {
        match self {
            Expr::Tenths(n) => Dual::from(*n as f64 / 10.0),
            Expr::Sym(Sym::X(i)) => at.x[*i],
            Expr::Sym(Sym::XDot(i)) => at.x_dot[*i],
            Expr::Sym(Sym::Xi(k)) => at.xi[*k],
            Expr::Sym(Sym::A(k)) => at.a[*k],
            Expr::Sym(Sym::T) => at.t,
            Expr::Sum(parts) => parts.iter().fold(Dual::from(0.0), |sum, e| sum + e.value(at)),
            Expr::Product(parts) => parts.iter().fold(Dual::from(1.0), |all, e| all * e.value(at)),
            Expr::Square(e) => {
                let v = e.value(at);
                v * v
            }
            Expr::Sin(e) => {
                let v = e.value(at);
                let (s, c) = v.value.sin_cos();
                v.function(s, c, -s)
            }
            Expr::Cos(e) => {
                let v = e.value(at);
                let (s, c) = v.value.sin_cos();
                v.function(c, -s, -c)
            }
        }
    }

    /// Its derivative.
    pub(crate) fn derivative(&self, by: Sym) -> Expr {
        match self {
            Expr::Tenths(_) => Expr::zero(),
            Expr::Sym(s) => Expr::Tenths(if *s == by { 10 } else { 0 }),
            Expr::Sum(parts) => Expr::Sum(parts.iter().map(|e| e.derivative(by)).collect()),
            Expr::Product(parts) => {
                let term = |k: usize| {
                    let factor = |(j, e): (usize, &Expr)| if j == k { e.derivative(by) } else { e.clone() };
                    Expr::Product(parts.iter().enumerate().map(factor).collect())
                };
                Expr::Sum((0..parts.len()).map(term).collect())
            }
            Expr::Square(e) => Expr::Product(vec![Expr::Tenths(20), (**e).clone(), e.derivative(by)]),
            Expr::Sin(e) => Expr::Cos(e.clone()).times(e.derivative(by)),
            Expr::Cos(e) => Expr::Product(vec![Expr::Tenths(-10), Expr::Sin(e.clone()), e.derivative(by)]),
        }
    }

    /// Whether it contains a symbol of some kind.
    pub(crate) fn contains(&self, is: &dyn Fn(Sym) -> bool) -> bool {
        match self {
            Expr::Tenths(_) => false,
            Expr::Sym(s) => is(*s),
            Expr::Sum(parts) | Expr::Product(parts) => parts.iter().any(|e| e.contains(is)),
            Expr::Square(e) | Expr::Sin(e) | Expr::Cos(e) => e.contains(is),
        }
    }
}
