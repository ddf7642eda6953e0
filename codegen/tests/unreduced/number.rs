//! Numbers with two infinitesimals, and matrices of them.

use std::ops::{Add, Mul, Sub};

/// `value + first e_1 + second e_2 + both e_1 e_2` with `e_1^2 = e_2^2 = 0`: exact first and mixed second derivatives.
///
/// # Source
/// Fike and Alonso 2011, hyper-dual numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Dual {
    /// The number.
    pub(crate) value: f64,
    /// Its derivative in the first direction.
    pub(crate) first: f64,
    /// Its derivative in the second direction.
    pub(crate) second: f64,
    /// Its mixed derivative.
    pub(crate) both: f64,
}

impl From<f64> for Dual {
    fn from(value: f64) -> Dual {
        Dual { value, first: 0.0, second: 0.0, both: 0.0 }
    }
}

impl Add for Dual {
    type Output = Dual;
    fn add(self, o: Dual) -> Dual {
        Dual {
            value: self.value + o.value,
            first: self.first + o.first,
            second: self.second + o.second,
            both: self.both + o.both,
        }
    }
}

impl Sub for Dual {
    type Output = Dual;
    fn sub(self, o: Dual) -> Dual {
        self + o * Dual::from(-1.0)
    }
}

impl Mul for Dual {
    type Output = Dual;
    fn mul(self, o: Dual) -> Dual {
        Dual {
            value: self.value * o.value,
            first: self.value * o.first + self.first * o.value,
            second: self.value * o.second + self.second * o.value,
            both: self.value * o.both + self.both * o.value + self.first * o.second + self.second * o.first,
        }
    }
}

impl Dual {
    /// `f(self)` by the value, the slope and the second derivative of `f` there.
    pub(crate) fn function(self, f: f64, slope: f64, bend: f64) -> Dual {
        Dual {
            value: f,
            first: slope * self.first,
            second: slope * self.second,
            both: slope * self.both + bend * self.first * self.second,
        }
    }
}

/// A square matrix by its rows.
pub(crate) type DualMatrix = Vec<Vec<Dual>>;

/// `exp(q e)` for an infinitesimal `q`, of which the third power vanishes.
pub(crate) fn exponential(e: &[Vec<f64>], q: Dual) -> DualMatrix {
    assert_eq!(q.value, 0.0, "the chart is used at its origin");
    let half_square = q * q * Dual::from(0.5);
    let n = e.len();
    let mut result = vec![vec![Dual::from(0.0); n]; n];
    for (i, row) in result.iter_mut().enumerate() {
        for (j, entry) in row.iter_mut().enumerate() {
            let square: f64 = (0..n).map(|k| e[i][k] * e[k][j]).sum();
            let unit = Dual::from(f64::from(u8::from(i == j)));
            *entry = unit + q * Dual::from(e[i][j]) + half_square * Dual::from(square);
        }
    }
    result
}

/// The product of all; empty for none.
pub(crate) fn product(factors: &[DualMatrix]) -> DualMatrix {
    let mut all = factors.iter();
    let Some(first) = all.next() else { return Vec::new() };
    all.fold(first.clone(), |a, b| times(&a, b))
}

/// `a b`.
pub(crate) fn times(a: &DualMatrix, b: &DualMatrix) -> DualMatrix {
    let entry = |row: &Vec<Dual>, j: usize| {
        row.iter().zip(b).fold(Dual::from(0.0), |sum, (x, other)| sum + *x * other[j])
    };
    a.iter().map(|row| (0..row.len()).map(|j| entry(row, j)).collect()).collect()
}

/// `a e`, where nothing stands for the identity.
pub(crate) fn times_after(a: &DualMatrix, e: &[Vec<f64>], size: usize) -> DualMatrix {
    let e: DualMatrix = e.iter().map(|row| row.iter().map(|x| Dual::from(*x)).collect()).collect();
    times(&or_identity(a, size), &e)
}

/// The identity where there is nothing.
fn or_identity(a: &DualMatrix, size: usize) -> DualMatrix {
    if !a.is_empty() {
        return a.clone();
    }
    let unit = |i: usize| (0..size).map(move |j| Dual::from(f64::from(u8::from(i == j))));
    (0..size).map(|i| unit(i).collect()).collect()
}
