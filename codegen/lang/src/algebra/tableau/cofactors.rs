//! Determinants and adjugates by cofactors, which divide by nothing.
//!
//! Deliberately does not know: what is divided by a determinant.

use num_traits::{One, Zero};

use hamel_expr::{ExprId, Graph, Rational};

/// Rows up to which a block is solved by its adjugate, whose products grow as the factorial of the rows; larger blocks
/// are eliminated cell by cell, the best first. A guess: the shipped loops and frames have up to three.
pub const MAX_COFACTORS: usize = 3;

/// Rows up to which a determinant is written out, with `2^n` minors.
pub const MAX_DETERMINANT: usize = 8;

/// Products and sums of entries of a matrix.
pub trait Ring {
    /// An entry.
    type Entry: Clone;
    /// One.
    fn unit(&mut self) -> Self::Entry;
    /// `a b`.
    fn times(&mut self, a: &Self::Entry, b: &Self::Entry) -> Self::Entry;
    /// `-a`.
    fn negative(&mut self, a: &Self::Entry) -> Self::Entry;
    /// The sum of entries with signs: plus for those at even places, minus for those at odd ones.
    fn alternating(&mut self, terms: &[Self::Entry]) -> Self::Entry;
}

/// Expressions; sums that are seen to vanish are zero.
impl Ring for Graph {
    type Entry = ExprId;

    fn unit(&mut self) -> ExprId {
        self.one()
    }

    fn times(&mut self, a: &ExprId, b: &ExprId) -> ExprId {
        self.mul(*a, *b)
    }

    fn negative(&mut self, a: &ExprId) -> ExprId {
        self.neg(*a)
    }

    fn alternating(&mut self, terms: &[ExprId]) -> ExprId {
        let signed = terms.iter().enumerate().map(|(k, e)| if k % 2 == 0 { *e } else { self.neg(*e) });
        let signed: Vec<ExprId> = signed.collect();
        let sum = self.sum(&signed);
        self.cancel_zero(sum)
    }
}

/// Numbers.
pub struct Numbers;

impl Ring for Numbers {
    type Entry = Rational;

    fn unit(&mut self) -> Rational {
        Rational::one()
    }

    fn times(&mut self, a: &Rational, b: &Rational) -> Rational {
        a * b
    }

    fn negative(&mut self, a: &Rational) -> Rational {
        -a
    }

    fn alternating(&mut self, terms: &[Rational]) -> Rational {
        let terms = terms.iter().enumerate();
        terms.fold(Rational::zero(), |sum, (k, q)| if k % 2 == 0 { sum + q } else { sum - q })
    }
}

/// The determinant of a square matrix by its first row, each minor of the rows below made once.
///
/// # Shapes
/// `square`: `n x n`; one for `n = 0`. The minors are `2^n`: callers bound `n`.
pub fn determinant<R: Ring>(ring: &mut R, square: &[Vec<R::Entry>]) -> R::Entry {
    let n = square.len();
    let unit = ring.unit();
    // minors[S]: of the last |S| rows on the columns S.
    let mut minors = vec![unit; 1 << n];
    for set in 1_usize..1 << n {
        let row = &square[n - set.count_ones() as usize];
        let columns = (0..n).filter(|column| set >> column & 1 == 1);
        let terms: Vec<R::Entry> =
            columns.map(|column| ring.times(&row[column], &minors[set & !(1 << column)])).collect();
        minors[set] = ring.alternating(&terms);
    }
    minors.pop().unwrap_or_else(|| ring.unit())
}

/// The adjugate, whose product with the matrix is its determinant times the identity.
///
/// # Shapes
/// `square`: `n x n` -> `n x n`.
pub fn adjugate<R: Ring>(ring: &mut R, square: &[Vec<R::Entry>]) -> Vec<Vec<R::Entry>> {
    let n = square.len();
    let mut entry = |i: usize, j: usize| {
        let rows = square.iter().enumerate().filter(|(row, _)| *row != j);
        let minor: Vec<Vec<R::Entry>> = rows.map(|(_, row)| [&row[..i], &row[i + 1..]].concat()).collect();
        let minor = determinant(ring, &minor);
        if (i + j).is_multiple_of(2) { minor } else { ring.negative(&minor) }
    };
    (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect()
}
