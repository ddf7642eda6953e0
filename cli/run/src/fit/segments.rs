//! Multiple shooting: pieces of a motion that start on their own, and are drawn together.
//!
//! Does not know: equations between coordinates and constraints, which restrict where pieces may start.

use nalgebra::{DMatrix, DVector};

use super::request::{FitRequest, Quantity};
use super::residuals::{Leg, Motions, Passed, priors, values};
use crate::admissible;
use crate::direction::Direction;
use crate::error::Error;
use crate::evaluate::prepare;
use crate::least_squares::{Linearised, minimise};
use crate::sensitivity::Along;

/// How much a gap between two pieces counts beside an error of measurement, one search after the other.
const WEIGHTS: [f64; 4] = [0.1, 1.0, 10.0, 100.0];

/// Evaluations for each weight: the last search alone has to end at a minimum, and it has the whole motion.
const STEPS: usize = 60;

/// How much the distance from where a piece starts counts while it is fitted on its own: data outweigh it.
const LOOSE: f64 = 1e-3;

/// Part of the spread of a column that its errors are taken to be where nobody says so: small beside the motion, large
/// beside rounding.
const ERRORS: f64 = 0.01;

/// Values of the unknowns near a start by multiple shooting: the motion is cut into pieces, each with a state of its
/// own to start from,
///
/// ```text
/// minimum of |r(p, s)|^2 + w^2 sum_j |(y(t_j; s_j-1) - s_j) / e|^2,    w = 1/10, 1, 10, 100
/// ```
///
/// where `e` are errors of the components. Short pieces stay near the data whatever the parameters are, so that a sum
/// of squares over a long or chaotic motion has fewer minima. Intervals of the unknowns do not hold here.
///
/// # Source
/// Bock, Recent advances in parameter identification techniques for O.D.E. (1983); here gaps are drawn together by
/// weights.
pub(super) fn by_segments(motions: &mut Motions<'_>, request: &FitRequest, start: &[f64]) -> Vec<f64> {
    let Some(shooting) = Shooting::new(motions, request, start) else { return start.to_vec() };
    let mut x = shooting.one_by_one(motions, start);
    let patience = STEPS.div_ceil(x.len() + 1);
    for weight in WEIGHTS {
        let found = minimise(&x, patience, &mut None, &mut |x: &[f64]| {
            let at = shooting.linearised(motions, weight, x);
            motions.told(at)
        });
        // A search that ends early is still nearer.
        match found {
            Ok(found) => x = found.x,
            Err(_) => break,
        }
    }
    let known = request.known.iter().zip(&x);
    known.map(|(known, x)| x.clamp(known.least, known.most)).collect()
}

/// A motion in pieces.
struct Shooting {
    /// With errors for every column.
    request: FitRequest,
    /// Unknown parameters, and all components of the state of a piece.
    inner: Vec<Direction>,
    /// Places of the former among the unknowns.
    of_params: Vec<usize>,
    /// Times at which pieces begin, and the last time.
    ends: Vec<f64>,
    /// For each piece the rows on it.
    rows: Vec<std::ops::Range<usize>>,
    /// Errors of the components of the state.
    errors: Vec<f64>,
}

impl Shooting {
    /// None where the motion has no data to cut.
    fn new(motions: &Motions<'_>, request: &FitRequest, start: &[f64]) -> Option<Shooting> {
        let mut request = request.clone();
        for (c, column) in request.columns.iter_mut().enumerate() {
            let spread = spread(request.values.iter().filter_map(|row| row[c]));
            column.sigma.get_or_insert(if spread > 0.0 { ERRORS * spread } else { 1.0 });
        }
        let last = request.times.last().copied().filter(|last| *last > 0.0)?;
        let n_pieces = request.segments.min(request.times.len());
        let ends: Vec<f64> = (0..=n_pieces).map(|k| last * (k as f64 / n_pieces as f64)).collect();
        let place = |t: f64| request.times.partition_point(|own| *own < t);
        let rows: Vec<std::ops::Range<usize>> = (0..n_pieces)
            .map(|k| place(ends[k])..if k + 1 < n_pieces { place(ends[k + 1]) } else { request.times.len() })
            .collect();
        let n = motions.factory.info().state.len();
        let free = request.free.iter().enumerate();
        let of_params: Vec<usize> =
            free.filter(|(_, direction)| matches!(direction, Direction::Param(_))).map(|(k, _)| k).collect();
        let params = of_params.iter().map(|k| request.free[*k]);
        let inner: Vec<Direction> = params.chain((0..n).map(Direction::Initial)).collect();
        let (_, initial) = values(&request, start);
        let error = |i: usize| {
            let column = request.columns.iter().find(|column| column.quantity == Quantity::State(i));
            column.and_then(|column| column.sigma).unwrap_or(ERRORS * initial[i].abs().max(1.0))
        };
        let errors = (0..n).map(error).collect();
        Some(Shooting { inner, of_params, ends, rows, errors, request })
    }

    /// The unknowns near a start, and the states of the pieces behind the first: each piece is fitted on its own, from
    /// where the one before ends.
    fn one_by_one(&self, motions: &mut Motions<'_>, start: &[f64]) -> Vec<f64> {
        let (n, n_free) = (self.errors.len(), start.len());
        let of_state: Vec<Direction> = (0..n).map(Direction::Initial).collect();
        let sizes: Vec<f64> = start.iter().map(|x| x.abs().max(ERRORS)).collect();
        let mut x = loosely(motions, start, &sizes, &|motions, z| self.first(motions, z));
        let mut passed = self.first(motions, &x);
        for piece in 1..self.rows.len() {
            let (params, initial) = values(&self.request, &x[..n_free]);
            // Where the piece before has no end, its start is the next best.
            let before = if piece == 1 { initial } else { x[x.len() - n..].to_vec() };
            let from = passed.map_or(before, |passed| passed.end[..n].to_vec());
            let along =
                |motions: &Motions<'_>, z: &[f64]| self.later(motions, piece, (&of_state, &params, z));
            let own = loosely(motions, &from, &self.errors, &along);
            passed = along(motions, &own);
            x.extend(&own);
        }
        x
    }

    /// The motion along the first piece, with derivatives by the unknowns.
    fn first(&self, motions: &Motions<'_>, x: &[f64]) -> Result<Passed, Error> {
        let (params, start) = motions.start(&self.request, x)?;
        self.pass(motions, 0, (&self.request.free, &params, &start))
    }

    /// The motion along another piece, from a state.
    fn later(
        &self,
        motions: &Motions<'_>,
        piece: usize,
        (directions, params, state): (&[Direction], &[f64], &[f64]),
    ) -> Result<Passed, Error> {
        admissible::check(&*prepare(motions.factory, params)?, state, 0)?;
        let along = Along::new(motions.factory, directions, self.request.method, "fit")?;
        self.pass(motions, piece, (directions, params, &along.initial(state, &[])))
    }

    /// The motion along a piece from a state with its derivatives.
    fn pass(
        &self,
        motions: &Motions<'_>,
        piece: usize,
        (directions, params, start): (&[Direction], &[f64], &[f64]),
    ) -> Result<Passed, Error> {
        let along = Along::new(motions.factory, directions, self.request.method, "fit")?;
        let end = Some(self.ends[piece + 1]);
        let leg = Leg { directions, t: self.ends[piece], rows: self.rows[piece].clone(), end };
        leg.pass((motions, &along), &self.request, params, start)
    }

    /// Residuals of the data on all pieces, of the priors, and of the gaps between pieces.
    fn linearised(&self, motions: &Motions<'_>, weight: f64, x: &[f64]) -> Result<Linearised, Error> {
        let request = &self.request;
        let (n, n_free) = (self.errors.len(), request.free.len());
        let (params, _) = values(request, x);
        let mut rows: Vec<(f64, Vec<(usize, f64)>)> = Vec::new();
        // Places of the unknowns that each piece is differentiated by.
        let state_of = |piece: usize| n_free + (piece - 1) * n..n_free + piece * n;
        for piece in 0..self.rows.len() {
            let (places, passed) = match piece {
                0 => ((0..n_free).collect::<Vec<usize>>(), self.first(motions, &x[..n_free])?),
                _ => {
                    let places = self.of_params.iter().copied().chain(state_of(piece)).collect();
                    let state = &x[state_of(piece)];
                    (places, self.later(motions, piece, (&self.inner, &params, state))?)
                }
            };
            for (residual, slopes) in passed.residuals.into_iter().zip(passed.slopes) {
                rows.push((residual, places.iter().copied().zip(slopes).collect()));
            }
            if piece + 1 == self.rows.len() {
                continue;
            }
            for (i, place) in state_of(piece + 1).enumerate() {
                let scale = weight / self.errors[i];
                let gap = (passed.end[i] - x[place]) * scale;
                let slope = |j: usize| passed.end[(j + 1) * n + i] * scale;
                let slopes = places.iter().enumerate().map(|(j, place)| (*place, slope(j)));
                rows.push((gap, slopes.chain([(place, -scale)]).collect()));
            }
        }
        rows.extend(priors(request, x).map(|(j, residual, slope)| (residual, vec![(j, slope)])));
        let residuals = DVector::from_iterator(rows.len(), rows.iter().map(|(residual, _)| *residual));
        let mut jacobian = DMatrix::zeros(rows.len(), x.len());
        for (at, (_, slopes)) in rows.iter().enumerate() {
            slopes.iter().for_each(|(j, slope)| jacobian[(at, *j)] = *slope);
        }
        Ok(Linearised { residuals, jacobian })
    }
}

/// The motion along a piece with values of its unknowns.
type Piece<'a> = dyn Fn(&Motions<'_>, &[f64]) -> Result<Passed, Error> + 'a;

/// The unknowns of a piece that is fitted on its own. Where it does not determine one, this one stays where it starts.
fn loosely(motions: &mut Motions<'_>, start: &[f64], sizes: &[f64], along: &Piece<'_>) -> Vec<f64> {
    let m = start.len();
    let found = minimise(start, STEPS.div_ceil(m + 1), &mut None, &mut |z: &[f64]| {
        let at = along(motions, z).map(|passed| {
            let n_cells = passed.residuals.len();
            let (mut residuals, mut jacobian) = (DVector::zeros(n_cells + m), DMatrix::zeros(n_cells + m, m));
            for (k, (residual, slopes)) in passed.residuals.iter().zip(&passed.slopes).enumerate() {
                residuals[k] = *residual;
                slopes.iter().enumerate().for_each(|(j, slope)| jacobian[(k, j)] = *slope);
            }
            for (j, size) in sizes.iter().enumerate() {
                residuals[n_cells + j] = (z[j] - start[j]) * LOOSE / size;
                jacobian[(n_cells + j, j)] = LOOSE / size;
            }
            Linearised { residuals, jacobian }
        });
        motions.told(at)
    });
    found.map_or(start.to_vec(), |found| found.x)
}

/// The standard deviation of numbers.
fn spread(values: impl Iterator<Item = f64> + Clone) -> f64 {
    let n = values.clone().count().max(1) as f64;
    let mean = values.clone().sum::<f64>() / n;
    (values.map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}
