//! Small random numbers that shrink to the simplest object, and the loop over cases.

use hamel_expr::Rational;
use num_traits::Zero;
use proptest::strategy::{Strategy, ValueTree as _};
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestError, TestRunner};

use crate::linear::{Rows, Vector, fraction, identity, int, product, transposed};

/// Integers in `-3..=3` that random objects are made of. All zeros give the simplest object: the standard basis.
#[derive(Clone, Debug)]
pub struct Draws {
    numbers: Vec<i8>,
    at: usize,
}

impl Draws {
    /// The next integer in `-3..=3`.
    ///
    /// # Panics
    /// When the test draws more numbers than it asked for.
    pub fn integer(&mut self) -> i64 {
        let n = *self.numbers.get(self.at).expect("a test asks for as many numbers as it draws");
        self.at += 1;
        i64::from(n)
    }

    /// An index below `n`.
    pub fn index(&mut self, n: usize) -> usize {
        // Two digits base seven cover 49 values.
        let k = 7 * (self.integer() + 3) + self.integer() + 3;
        usize::try_from(k).map_or(0, |k| k % n)
    }

    /// A small fraction, possibly zero.
    pub fn rational(&mut self) -> Rational {
        let n = self.integer();
        fraction(n, 1 + self.integer().abs())
    }

    /// A small fraction that is not zero.
    pub fn non_zero(&mut self) -> Rational {
        let q = self.rational();
        if q.is_zero() { fraction(1, 2) } else { q }
    }

    /// A vector of small fractions.
    pub fn vector(&mut self, n: usize) -> Vector {
        (0..n).map(|_| self.rational()).collect()
    }

    /// A vector without zeros, for points at which an identity that fails should be seen to fail.
    pub fn generic_vector(&mut self, n: usize) -> Vector {
        (0..n).map(|_| self.non_zero()).collect()
    }

    /// A matrix of small fractions.
    pub fn matrix(&mut self, n_rows: usize, n_columns: usize) -> Rows {
        (0..n_rows).map(|_| self.vector(n_columns)).collect()
    }

    /// An invertible matrix `L D U` with unit triangular `L`, `U`.
    pub fn invertible(&mut self, n: usize) -> Rows {
        let mut lower = identity(n);
        let mut upper = identity(n);
        for (i, row) in lower.iter_mut().enumerate() {
            row[..i].iter_mut().for_each(|q| *q = int(self.integer().signum()));
        }
        for (i, row) in upper.iter_mut().enumerate() {
            row[i] = [int(1), int(-1), int(2), fraction(1, 2)][self.index(4)].clone();
            row[i + 1..].iter_mut().for_each(|q| *q = int(self.integer().signum()));
        }
        product(&lower, &upper)
    }

    /// A symmetric positive definite matrix `L D L^T` in which no two basis vectors are orthogonal by construction:
    /// every entry of the unit triangular `L` below the diagonal is non-zero.
    pub fn positive_definite(&mut self, n: usize) -> Rows {
        let mut lower = identity(n);
        for (i, row) in lower.iter_mut().enumerate() {
            row[..i].iter_mut().for_each(|q| *q = fraction(2 * self.integer() + 1, 4));
        }
        let weights: Vector = (0..n).map(|_| int(1 + self.integer().abs())).collect();
        let scaled: Rows =
            lower.iter().map(|row| row.iter().zip(&weights).map(|(x, w)| x * w).collect()).collect();
        product(&scaled, &transposed(&lower))
    }
}

/// Runs `test` on `cases` random inputs of `n` numbers each.
///
/// The seed is fixed, so that a build is repeatable; `PROPTEST_RNG_SEED=<n>` sets another one. The number of cases is
/// bounded here. A failure prints its seed; with `PROPTEST_MAX_SHRINK_ITERS=200` it is shrunk and its numbers printed.
///
/// # Panics
/// When the test fails on an input, naming `what` and the seed.
pub fn for_all(what: &str, cases: u32, n: usize, test: impl Fn(Draws) -> Result<(), TestCaseError>) {
    let mut config = Config { cases, failure_persistence: None, ..Config::default() };
    // u32::MAX is proptest's mark for "not set". Every shrinking step prints its panic, so it is off unless asked for.
    let shrinking = config.max_shrink_iters != u32::MAX;
    if !shrinking {
        config.max_shrink_iters = 0;
    }
    if matches!(config.rng_seed, RngSeed::Random) {
        config.rng_seed = RngSeed::Fixed(0x68_616d_656c);
    }
    let seed = config.rng_seed;
    let strategy = proptest::collection::vec(-3i8..=3, n);
    let mut runner = TestRunner::new(config);
    let outcome = runner.run(&strategy, |numbers| test(Draws { numbers, at: 0 }));
    match outcome {
        Ok(()) => {}
        Err(TestError::Fail(reason, numbers)) if shrinking => {
            panic!("{what}: {reason}\nseed {seed:?}, numbers {numbers:?}")
        }
        Err(TestError::Fail(reason, _)) => panic!("{what}: {reason}\nseed {seed:?}"),
        Err(TestError::Abort(reason)) => panic!("{what}: {reason}, seed {seed:?}"),
    }
}

/// One fixed random input of `n` numbers, for tests that need one generic object.
///
/// # Panics
/// Never: drawing a vector of integers cannot be rejected.
pub fn one(seed: u64, n: usize) -> Draws {
    let config = Config { rng_seed: RngSeed::Fixed(seed), failure_persistence: None, ..Config::default() };
    let mut runner = TestRunner::new(config);
    let tree = proptest::collection::vec(-3i8..=3, n).new_tree(&mut runner);
    Draws { numbers: tree.expect("a vector of integers is never rejected").current(), at: 0 }
}
