//! Inputs from a table: numbers at times, with straight lines, cubics or steps between them.
//!
//! The module deliberately does not know where the numbers come from, or what they drive.

use crate::inputs::{PolynomialSignal, Signal, SignalOverScalar};
use crate::real::Real;

/// What is between two rows of a [`Table`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Interpolation {
    /// A straight line: continuous, with a kink at every row.
    #[default]
    Linear,
    /// Cubic Hermite pieces with the slopes of parabolas through three neighbouring rows: once continuously
    /// differentiable; exact for parabolas.
    Cubic,
    /// The value of the row before, as a digital controller holds it: with a jump at every row, where the new value is.
    Hold,
}

/// Why numbers are no table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum TableError {
    /// There is no row.
    Empty,
    /// There is not one time for each row.
    Lengths {
        /// Number of times.
        times: usize,
        /// Number of rows.
        rows: usize,
    },
    /// The time of this row, counted from zero, is not finite or not later than that of the row before.
    Time {
        /// The row.
        row: usize,
    },
    /// A value of this row is not finite.
    Value {
        /// The row.
        row: usize,
    },
}

impl core::fmt::Display for TableError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Empty => f.write_str("table has no row"),
            Self::Lengths { times, rows } => write!(f, "table has {times} times and {rows} rows"),
            Self::Time { row } => {
                write!(f, "time of row {row} is not finite, or not later than the one before")
            }
            Self::Value { row } => write!(f, "value of row {row} is not finite"),
        }
    }
}

impl core::error::Error for TableError {}

/// Inputs by the times at which they are known; before the first and after the last row they stay what they are there.
///
/// Over lanes, which may be at different times, each lane gets its own value. The bits are those of `f64` where all
/// lanes are between the same two rows.
///
/// # Shapes
///
/// times: \[n\], rows: \[n\].
///
/// ```
/// use hamel_runtime::{Interpolation, Signal, Table};
///
/// let (times, rows) = ([0.0, 1.0, 3.0], [[0.0], [1.0], [9.0]]);
/// let line = Table::new(&times, &rows, Interpolation::Linear)?;
/// let cubic = Table::new(&times, &rows, Interpolation::Cubic)?;
/// let at = |table: &Table<'_, 1>, t: f64| Signal::<f64, (), 1>::at(table, t, &())[0];
/// assert_eq!((at(&line, 2.0), at(&cubic, 2.0)), (5.0, 4.0));
/// assert_eq!((at(&line, -1.0), at(&cubic, 9.0)), (0.0, 9.0));
/// # Ok::<(), hamel_runtime::TableError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Table<'a, const M: usize> {
    times: &'a [f64],
    rows: &'a [[f64; M]],
    interpolation: Interpolation,
}

impl<'a, const M: usize> Table<'a, M> {
    /// A table of these rows.
    ///
    /// # Errors
    ///
    /// [`TableError`] with what is wrong first.
    pub fn new(
        times: &'a [f64],
        rows: &'a [[f64; M]],
        interpolation: Interpolation,
    ) -> Result<Self, TableError> {
        if rows.is_empty() {
            return Err(TableError::Empty);
        }
        if times.len() != rows.len() {
            return Err(TableError::Lengths { times: times.len(), rows: rows.len() });
        }
        for (row, values) in rows.iter().enumerate() {
            let is_later = row == 0 || times[row - 1] < times[row];
            if !times[row].is_finite() || !is_later {
                return Err(TableError::Time { row });
            }
            if !values.iter().all(|x| x.is_finite()) {
                return Err(TableError::Value { row });
            }
        }
        Ok(Self { times, rows, interpolation })
    }

    /// The number of rows whose time every lane (`for_all`), or some lane, has reached.
    fn reached<R: Real>(&self, t: R, for_all: bool) -> usize {
        self.times.partition_point(|time| {
            let time = R::from_f64(*time);
            if for_all { t.all_ge(time) } else { !time.all_gt(t) }
        })
    }

    /// The slope of column `i` at a row: of the parabola through it and its neighbours, or of the line at an end.
    fn slope(&self, row: usize, i: usize) -> f64 {
        let secant = |k: usize| (self.rows[k + 1][i] - self.rows[k][i]) / (self.times[k + 1] - self.times[k]);
        let last = self.rows.len() - 1;
        if last == 0 {
            return 0.0;
        }
        if last == 1 {
            return secant(0);
        }
        // At an end, the parabola through the three rows there.
        let middle = row.clamp(1, last - 1);
        let (before, after) = (secant(middle - 1), secant(middle));
        let (h0, h1) =
            (self.times[middle] - self.times[middle - 1], self.times[middle + 1] - self.times[middle]);
        let curvature = (after - before) / (h0 + h1);
        match row {
            0 => before - h0 * curvature,
            row if row == last => after + h1 * curvature,
            _ => (h1 * before + h0 * after) / (h0 + h1),
        }
    }

    /// Hermite's cubic of column `i` behind row `k`: the coefficients of the powers of the part of the piece that has
    /// passed, from the first on.
    fn cubic(&self, k: usize, i: usize) -> [f64; 3] {
        let width = self.times[k + 1] - self.times[k];
        let (p, q) = (width * self.slope(k, i), width * self.slope(k + 1, i));
        let rise = self.rows[k + 1][i] - self.rows[k][i];
        [p, 3.0 * rise - 2.0 * p - q, p + q - 2.0 * rise]
    }

    /// Column `i` of the piece behind row `k` at a time in it.
    fn between<R: Real>(&self, k: usize, i: usize, t: R) -> R {
        let number = R::from_f64;
        let (start, width) = (self.times[k], self.times[k + 1] - self.times[k]);
        let (a, b) = (self.rows[k][i], self.rows[k + 1][i]);
        let s = (t - number(start)) / number(width);
        match self.interpolation {
            Interpolation::Linear => s.mul_add(number(b - a), number(a)),
            Interpolation::Cubic => {
                let [first, second, third] = self.cubic(k, i).map(number);
                s.mul_add(s.mul_add(s.mul_add(third, second), first), number(a))
            }
            Interpolation::Hold => {
                // One from the next row on, before it zero: this is asked of every lane by itself.
                let early = (t - number(self.times[k + 1])) * number(1e200);
                let not_late = number(0.5) * (early - early.abs());
                let step = R::ONE + not_late;
                (number(0.5) * (step + step.abs())).mul_add(number(b - a), number(a))
            }
        }
    }

    /// Column `i` where lanes are between different rows: pieces added up, each over as much of it as a lane has behind
    /// it.
    fn across<R: Real>(&self, (first, last): (usize, usize), i: usize, t: R) -> R {
        let half = R::from_f64(0.5);
        let largest = |a: R, b: R| half * (a + b + (a - b).abs());
        let least = |a: R, b: R| half * (a + b - (a - b).abs());
        let mut sum = R::from_f64(self.rows[first][i]);
        for k in first..last {
            let (low, high) = (R::from_f64(self.times[k]), R::from_f64(self.times[k + 1]));
            sum += self.between(k, i, least(largest(t, low), high)) - R::from_f64(self.rows[k][i]);
        }
        sum
    }
}

impl<R: Real, S, const M: usize> Signal<R, S, M> for Table<'_, M> {
    fn at(&self, t: R, _y: &S) -> [R; M] {
        let last = self.rows.len() - 1;
        let (all, some) = (self.reached(t, true), self.reached(t, false));
        core::array::from_fn(|i| {
            if all == some && all == 0 {
                R::from_f64(self.rows[0][i])
            } else if all == some && all > last {
                R::from_f64(self.rows[last][i])
            } else if all == some {
                self.between(all - 1, i, t)
            } else {
                self.across((all.saturating_sub(1), some.min(last)), i, t)
            }
        })
    }
}

impl<R: Real, const M: usize> PolynomialSignal<R, M> for Table<'_, M> {
    fn piece(&self, (t, towards): (R, R), coefficients: &mut [[R; M]]) -> R {
        let (n, number) = (self.rows.len(), R::from_f64);
        let is_backward = t.all_gt(towards);
        // The number of rows behind: at a row, that row on the way forward, and not on the way back.
        let behind = self.times.partition_point(|time| {
            let time = number(*time);
            if is_backward { t.all_gt(time) } else { t.all_ge(time) }
        });
        coefficients.fill([R::ZERO; M]);
        for i in 0..M {
            let mut put = |k: usize, value: R| {
                if let Some(row) = coefficients.get_mut(k) {
                    row[i] = value;
                }
            };
            if behind == 0 || behind == n || self.interpolation == Interpolation::Hold {
                put(0, number(self.rows[behind.saturating_sub(1)][i]));
                continue;
            }
            let k = behind - 1;
            put(0, self.between(k, i, t));
            let width = number(self.times[k + 1] - self.times[k]);
            if self.interpolation == Interpolation::Linear {
                put(1, number(self.rows[k + 1][i] - self.rows[k][i]) / width);
                continue;
            }
            let [first, second, third] = self.cubic(k, i).map(number);
            let s = (t - number(self.times[k])) / width;
            let (two, three) = (number(2.0), number(3.0));
            put(1, s.mul_add(s.mul_add(three * third, two * second), first) / width);
            put(2, (three * s).mul_add(third, second) / (width * width));
            put(3, third / (width * width * width));
        }
        let next = if is_backward { behind.checked_sub(1) } else { Some(behind) };
        let next = next.and_then(|row| self.times.get(row)).map(|time| number(*time));
        let is_before_end = |time: &R| if is_backward { time.all_gt(towards) } else { towards.all_gt(*time) };
        next.filter(is_before_end).unwrap_or(towards)
    }
}

impl<Q: Real, R: Real, SQ, S, const M: usize> SignalOverScalar<Q, R, SQ, S, M> for Table<'_, M> {
    type Over = Self;

    fn over(&self, _convert: impl Fn(R) -> Q) -> Self {
        *self
    }
}

#[cfg(test)]
mod tests {
    use super::{Interpolation, Table, TableError};
    use crate::inputs::Signal;
    use crate::{Dual, PolynomialSignal, Real};

    const TIMES: [f64; 4] = [0.0, 0.5, 2.0, 3.0];

    fn at<R: Real>(table: &Table<'_, 1>, t: R) -> R {
        Signal::<R, (), 1>::at(table, t, &())[0]
    }

    #[test]
    fn cubics_are_exact_for_parabolas_and_pass_through_the_rows() {
        let parabola = |t: f64| 1.0 - 2.0 * t + 3.0 * t * t;
        let rows = TIMES.map(|t| [parabola(t)]);
        let table = Table::new(&TIMES, &rows, Interpolation::Cubic).unwrap();
        for k in 0..=60 {
            let t = 0.05 * f64::from(k);
            assert!((at(&table, t) - parabola(t)).abs() < 1e-13, "at {t}");
            let slope = at(&table, Dual::variable(t)).derivative;
            let is_inside = t > 0.0 && t < 3.0;
            assert!(!is_inside || (slope - (6.0 * t - 2.0)).abs() < 1e-12, "slope at {t}: {slope}");
        }
        let wild = [[3.0], [-1.0], [4.0], [1.0]];
        let table = Table::new(&TIMES, &wild, Interpolation::Cubic).unwrap();
        for (t, row) in TIMES.iter().zip(wild) {
            assert!((at(&table, *t) - row[0]).abs() < 1e-15);
        }
    }

    #[test]
    fn what_is_held_jumps_at_the_rows() {
        let rows = [[3.0], [-1.0], [4.0], [1.0]];
        let table = Table::new(&TIMES, &rows, Interpolation::Hold).unwrap();
        let times = [-1.0, 0.0, 0.5_f64.next_down(), 0.5, 1.9, 2.0, 3.0_f64.next_down(), 3.0, 9.0];
        assert_eq!(times.map(|t| at(&table, t)), [3.0, 3.0, 3.0, -1.0, -1.0, 4.0, 4.0, 1.0, 1.0]);
    }

    #[test]
    fn pieces_are_the_polynomials_between_rows_and_end_there() {
        let rows = [[3.0], [-1.0], [4.0], [1.0]];
        let far = 9.0;
        for interpolation in [Interpolation::Linear, Interpolation::Cubic, Interpolation::Hold] {
            let table = Table::new(&TIMES, &rows, interpolation).unwrap();
            for (t, [before, after]) in [
                (-1.0, [-far, 0.0]),
                (0.0, [-far, 0.5]),
                (0.3, [0.0, 0.5]),
                (0.5, [0.0, 2.0]),
                (1.7, [0.5, 2.0]),
                (3.0, [2.0, far]),
                (3.5, [3.0, far]),
            ] {
                let mut coefficients = [[7.0]; 6];
                for (towards, end) in [(-far, before), (far, after), (t, t)] {
                    assert_eq!(table.piece((t, towards), &mut coefficients), end, "{t} towards {towards}");
                    for part in [0.25, 0.5, 0.75] {
                        let h = part * (end - t);
                        let value = coefficients.iter().rev().fold(0.0, |sum, [c]| sum * h + c);
                        let expected = at(&table, t + h);
                        // At a row, what is held on the way back is not what is held there.
                        let is_row = h == 0.0;
                        assert!(is_row || (value - expected).abs() < 1e-12 * f64::powi(1.0 + h.abs(), 3));
                    }
                }
                assert_eq!(coefficients[0], [at(&table, t)]);
                assert_eq!(coefficients[4..], [[0.0]; 2]);
                // As many as are asked for.
                let mut first = [[7.0]; 1];
                table.piece((t, far), &mut first);
                assert_eq!(first, [[at(&table, t)]]);
            }
        }
    }

    #[test]
    fn one_row_is_a_constant() {
        for interpolation in [Interpolation::Linear, Interpolation::Cubic, Interpolation::Hold] {
            let table = Table::new(&[1.0], &[[7.0]], interpolation).unwrap();
            assert_eq!([0.0, 1.0, 2.0].map(|t| at(&table, t)), [7.0; 3]);
        }
    }

    #[test]
    fn what_is_no_table_is_refused() {
        let new =
            |times: &[f64], rows: &[[f64; 1]]| Table::new(times, rows, Interpolation::Linear).unwrap_err();
        assert_eq!(new(&[], &[]), TableError::Empty);
        assert_eq!(new(&[0.0], &[[1.0], [2.0]]), TableError::Lengths { times: 1, rows: 2 });
        assert_eq!(new(&[0.0, 0.0], &[[1.0], [2.0]]), TableError::Time { row: 1 });
        assert_eq!(new(&[f64::NAN], &[[1.0]]), TableError::Time { row: 0 });
        assert_eq!(new(&[0.0, 1.0], &[[1.0], [f64::INFINITY]]), TableError::Value { row: 1 });
    }

    #[cfg(feature = "lanes")]
    #[test]
    fn lanes_at_different_times_have_their_own_values() {
        use crate::F64x4;

        let rows = [[3.0], [-1.0], [4.0], [1.0]];
        for interpolation in [Interpolation::Linear, Interpolation::Cubic, Interpolation::Hold] {
            let table = Table::new(&TIMES, &rows, interpolation).unwrap();
            for times in
                [[-1.0, 0.2, 1.1, 9.0], [0.6, 0.7, 1.1, 1.9], [2.0, 2.5, 3.0, 3.5], [5.0; 4], [-2.0; 4]]
            {
                let found = at(&table, F64x4::from(times)).to_array();
                for (t, found) in times.into_iter().zip(found) {
                    let expected = at(&table, t);
                    assert!((found - expected).abs() < 1e-14, "{t}: {found} and {expected}");
                }
            }
        }
    }
}
