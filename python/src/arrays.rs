//! States in arrays of numpy, read where they are, and what is computed of them, written where it belongs.
//!
//! Deliberately does not know: what is computed of a state.

use hamel_run::Error;
use hamel_runtime::F64x8;
use numpy::ndarray::{ArrayView2, ArrayViewMut2, Axis};
use rayon::iter::{IntoParallelIterator as _, ParallelIterator as _};

use crate::pool;

/// Work of one piece that a thread takes at once, in units of a scene's cost: some tens of microseconds.
const PIECE: u64 = 1 << 17;

/// Rows of an array, wherever its numbers are.
pub(crate) enum Rows<'a> {
    /// One row after the other.
    ByRow(&'a [f64], usize),
    /// One column after the other: lanes are read side by side.
    ByColumn(Vec<&'a [f64]>),
    /// Neither.
    Anyhow(ArrayView2<'a, f64>),
}

impl<'a> Rows<'a> {
    /// The rows of an array.
    pub(crate) fn of(array: ArrayView2<'a, f64>) -> Rows<'a> {
        let width = array.ncols();
        if let Some(all) = array.to_slice() {
            return Rows::ByRow(all, width);
        }
        let columns: Option<Vec<&[f64]>> =
            (0..width).map(|k| array.index_axis_move(Axis(1), k).to_slice()).collect();
        match columns {
            Some(columns) => Rows::ByColumn(columns),
            None => Rows::Anyhow(array),
        }
    }

    /// Eight rows from `first` on, side by side.
    #[inline]
    pub(crate) fn lanes(&self, first: usize, lanes: &mut [F64x8]) {
        match self {
            Rows::ByRow(all, width) => {
                let rows = &all[first * width..(first + F64x8::LANES) * width];
                let (a, rest) = rows.split_at(*width);
                let (b, rest) = rest.split_at(*width);
                let (c, rest) = rest.split_at(*width);
                let (d, rest) = rest.split_at(*width);
                let (e, rest) = rest.split_at(*width);
                let (f, rest) = rest.split_at(*width);
                let (g, h) = rest.split_at(*width);
                let halves = a.iter().zip(b).zip(c).zip(d).zip(e.iter().zip(f).zip(g).zip(h));
                for (lane, ((((a, b), c), d), (((e, f), g), h))) in lanes.iter_mut().zip(halves) {
                    *lane = F64x8::new([*a, *b, *c, *d, *e, *f, *g, *h]);
                }
            }
            Rows::ByColumn(columns) => {
                for (lane, column) in lanes.iter_mut().zip(columns) {
                    let (eight, _) = column[first..].as_chunks();
                    *lane = F64x8::new(eight[0]);
                }
            }
            Rows::Anyhow(array) => {
                for (k, lane) in lanes.iter_mut().enumerate() {
                    *lane = F64x8::new(std::array::from_fn(|row| array[[first + row, k]]));
                }
            }
        }
    }

    /// One row.
    #[inline]
    pub(crate) fn row(&self, at: usize, out: &mut [f64]) {
        match self {
            Rows::ByRow(all, width) => out.copy_from_slice(&all[at * width..(at + 1) * width]),
            Rows::ByColumn(columns) => {
                out.iter_mut().zip(columns).for_each(|(out, column)| *out = column[at])
            }
            Rows::Anyhow(array) => out.iter_mut().enumerate().for_each(|(k, out)| *out = array[[at, k]]),
        }
    }
}

/// Rows of an array to be written, the same way.
pub(crate) enum RowsMut<'a> {
    /// One row after the other.
    ByRow(&'a mut [f64], usize),
    /// One column after the other.
    ByColumn(Vec<&'a mut [f64]>),
    /// Neither.
    Anyhow(ArrayViewMut2<'a, f64>),
}

impl<'a> RowsMut<'a> {
    /// The rows of an array.
    pub(crate) fn of(mut array: ArrayViewMut2<'a, f64>) -> RowsMut<'a> {
        let width = array.ncols();
        if array.as_slice_mut().is_some() {
            // It is in order, as has just been seen.
            return array
                .into_slice()
                .map_or_else(|| RowsMut::ByRow(&mut [], 0), |all| RowsMut::ByRow(all, width));
        }
        if (0..width).any(|k| array.index_axis_mut(Axis(1), k).as_slice_mut().is_none()) {
            return RowsMut::Anyhow(array);
        }
        let mut columns = Vec::with_capacity(width);
        for _ in 0..width {
            let (first, rest) = array.split_at(Axis(1), 1);
            columns.extend(first.index_axis_move(Axis(1), 0).into_slice());
            array = rest;
        }
        RowsMut::ByColumn(columns)
    }

    /// Writes eight rows from `first` on; whether all numbers are finite.
    #[inline]
    pub(crate) fn set_lanes(&mut self, first: usize, lanes: &[F64x8]) -> bool {
        const EXPONENT: u64 = 0x7ff << 52;
        let mut is_finite = true;
        match self {
            RowsMut::ByRow(all, width) => {
                let rows = &mut all[first * *width..(first + F64x8::LANES) * *width];
                let (a, rest) = rows.split_at_mut(*width);
                let (b, rest) = rest.split_at_mut(*width);
                let (c, rest) = rest.split_at_mut(*width);
                let (d, rest) = rest.split_at_mut(*width);
                let (e, rest) = rest.split_at_mut(*width);
                let (f, rest) = rest.split_at_mut(*width);
                let (g, h) = rest.split_at_mut(*width);
                let halves = a.iter_mut().zip(b).zip(c).zip(d).zip(e.iter_mut().zip(f).zip(g).zip(h));
                for (lane, ((((a, b), c), d), (((e, f), g), h))) in lanes.iter().zip(halves) {
                    [*a, *b, *c, *d, *e, *f, *g, *h] = lane.to_array();
                }
            }
            RowsMut::ByColumn(columns) => {
                for (lane, column) in lanes.iter().zip(columns) {
                    column[first..first + F64x8::LANES].copy_from_slice(&lane.to_array());
                }
            }
            RowsMut::Anyhow(array) => {
                for (k, lane) in lanes.iter().enumerate() {
                    lane.to_array().iter().enumerate().for_each(|(row, x)| array[[first + row, k]] = *x);
                }
            }
        }
        for lane in lanes {
            is_finite &=
                lane.to_array().iter().fold(true, |all, x| all & (x.to_bits() & EXPONENT != EXPONENT));
        }
        is_finite
    }

    /// Writes one row; whether all numbers are finite.
    pub(crate) fn set_row(&mut self, at: usize, row: &[f64]) -> bool {
        match self {
            RowsMut::ByRow(all, width) => all[at * *width..(at + 1) * *width].copy_from_slice(row),
            RowsMut::ByColumn(columns) => columns.iter_mut().zip(row).for_each(|(column, x)| column[at] = *x),
            RowsMut::Anyhow(array) => row.iter().enumerate().for_each(|(k, x)| array[[at, k]] = *x),
        }
        row.iter().all(|x| x.is_finite())
    }
}

/// The same rows of two arrays.
type Piece<'a> = (ArrayView2<'a, f64>, ArrayViewMut2<'a, f64>);

/// Calls `work` for pieces of rows of both arrays, on the threads of the process where it pays or where `is_parallel`
/// says so; `cost` is that of a row. What it says is whether all of its numbers are finite.
///
/// # Errors
/// When the system refuses threads.
pub(crate) fn in_pieces<'a>(
    states: ArrayView2<'a, f64>,
    out: ArrayViewMut2<'a, f64>,
    (cost, is_parallel): (u64, Option<bool>),
    work: impl Fn(&Rows<'_>, &mut RowsMut<'_>, usize) -> bool + Sync,
) -> Result<bool, Error> {
    let n_rows = states.nrows();
    // A multiple of the lanes, though every lane has the bits of a single number.
    let at_once = (PIECE / cost.max(1)).clamp(16, 1 << 16) as usize / F64x8::LANES * F64x8::LANES;
    let on = |(states, out): Piece<'_>| {
        let n = states.nrows();
        work(&Rows::of(states), &mut RowsMut::of(out), n)
    };
    // Two pieces are done before threads have woken up.
    if !is_parallel.unwrap_or(n_rows > 4 * at_once) {
        return Ok(on((states, out)));
    }
    let mut pieces: Vec<Piece<'_>> = Vec::with_capacity(n_rows / at_once + 1);
    let (mut states, mut out) = (states, out);
    while states.nrows() > at_once {
        let (piece, rest) = states.split_at(Axis(0), at_once);
        let (piece_out, rest_out) = out.split_at(Axis(0), at_once);
        pieces.push((piece, piece_out));
        (states, out) = (rest, rest_out);
    }
    pieces.push((states, out));
    let all = || pieces.into_par_iter().map(on).reduce(|| true, |a, b| a & b);
    Ok(pool::of_process()?.install(all))
}
