//! Residuals of the data along a motion, and their derivatives by the unknowns.
//!
//! Does not know: how the unknowns are searched.

use std::cell::{Cell, RefCell};
use std::ops::{ControlFlow, Range};

use hamel_runtime::{Dual, Integrator};
use nalgebra::{DMatrix, DVector};

use super::request::{Column, FitRequest, FitResponse, Follows, Progress, Quantity};
use crate::admissible;
use crate::auto::Purpose;
use crate::direction::Direction;
use crate::dynamics::{Factory, PreparedDuals, PreparedScene, VecState};
use crate::error::Error;
use crate::evaluate::{describe, prepare, refused, why_stopped};
use crate::least_squares::Linearised;
use crate::lost_rank::Held;
use crate::sensitivity::Along;
use crate::simulation::stopped_because;
use crate::solver::method_of;

/// Residuals and slopes above this belong to a motion that runs away: their squares would overflow.
const RUNS_AWAY: f64 = 1e100;

/// Parameters and initial state with values of the unknowns.
pub(super) fn values(request: &FitRequest, x: &[f64]) -> (Vec<f64>, Vec<f64>) {
    let (mut params, mut initial) = (request.params.clone(), request.initial.clone());
    for (direction, x) in request.free.iter().zip(x) {
        match direction {
            Direction::Param(k) => params[*k] = *x,
            Direction::Initial(k) => initial[*k] = *x,
        }
    }
    (params, initial)
}

/// Row, column and value of everything that was measured, in the order of the residuals.
pub(super) fn cells(request: &FitRequest) -> impl Iterator<Item = (usize, usize, f64)> + Clone {
    cells_in(request, 0..request.times.len())
}

fn cells_in(request: &FitRequest, rows: Range<usize>) -> impl Iterator<Item = (usize, usize, f64)> + Clone {
    let row = |(k, row): (usize, &Vec<Option<f64>>)| {
        let cells: Vec<(usize, usize, f64)> =
            row.iter().enumerate().filter_map(|(c, cell)| Some((k, c, (*cell)?))).collect();
        cells
    };
    let skipped = rows.start;
    let rows = request.values[rows].iter().enumerate();
    rows.map(move |(k, cells)| (k + skipped, cells)).flat_map(row)
}

/// Motions that residuals are taken of, counted.
pub(super) struct Motions<'a> {
    pub(super) factory: &'a dyn Factory,
    follower: Option<&'a dyn Follows>,
    n: usize,
    progress: RefCell<&'a mut Watch<'a>>,
    is_called_off: Cell<bool>,
}

/// Is told how far a fit is, and calls it off where it breaks.
pub type Watch<'a> = dyn FnMut(Progress) -> ControlFlow<()> + 'a;

impl<'a> Motions<'a> {
    /// # Errors
    /// [`Error::Options`] for a method without derivatives.
    pub(super) fn new(
        (factory, follower): (&'a dyn Factory, Option<&'a dyn Follows>),
        request: &FitRequest,
        progress: &'a mut Watch<'a>,
    ) -> Result<Motions<'a>, Error> {
        Along::new(factory, &request.free, request.method, "fit")?;
        let (progress, is_called_off) = (RefCell::new(progress), Cell::new(false));
        Ok(Motions { factory, follower, n: 0, progress, is_called_off })
    }

    /// Tells how far the fit is; breaks once it was called off.
    fn tell(&self, progress: Progress) -> ControlFlow<()> {
        if self.is_called_off.get() || (self.progress.borrow_mut())(progress).is_break() {
            self.is_called_off.set(true);
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }

    /// # Errors
    /// That the fit was called off.
    pub(super) fn go_on(&self) -> Result<(), Error> {
        match self.is_called_off.get() {
            false => Ok(()),
            true => Err(Error::Options {
                reason: format!("fit: called off after {} motions", self.n_integrated()),
            }),
        }
    }

    /// How many were integrated.
    pub(super) fn n_integrated(&self) -> usize {
        self.n
    }

    /// Counts a motion, and tells what came out.
    pub(super) fn told(&mut self, at: Result<Linearised, Error>) -> Result<Linearised, Error> {
        self.n += 1;
        let sum_of_squares = at.as_ref().ok().map(|at| at.residuals.norm_squared());
        // Whoever asks for the next motion learns that the fit was called off.
        let _ = self.tell(Progress::Motion { n: self.n, sum_of_squares });
        at
    }

    /// Residuals and their derivatives with values of the unknowns.
    pub(super) fn linearised(&mut self, request: &FitRequest, x: &[f64]) -> Result<Linearised, Error> {
        let at = self.residuals(request, x);
        self.told(at)
    }

    /// Parameters and the start of the motion, with its derivatives by the unknowns behind it.
    pub(super) fn start(&self, request: &FitRequest, x: &[f64]) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let (params, mut initial) = values(request, x);
        let base = prepare(self.factory, &params)?;
        let mut tangents = Vec::new();
        if let Some(follower) = self.follower {
            initial = follower.settled(&params, &initial, &request.free)?;
            tangents = follower.tangents(&request.free, (&params, &initial), &request.free)?;
        }
        admissible::check(&*base, &initial, 0)?;
        let along = Along::new(self.factory, &request.free, request.method, "fit")?;
        Ok((params, along.initial(&initial, &tangents)))
    }

    fn residuals(&self, request: &FitRequest, x: &[f64]) -> Result<Linearised, Error> {
        let (params, start) = self.start(request, x)?;
        let leg = Leg { directions: &request.free, t: 0.0, rows: 0..request.times.len(), end: None };
        let along = Along::new(self.factory, &request.free, request.method, "fit")?;
        let passed = leg.pass((self, &along), request, &params, &start)?;
        let n_cells = passed.slopes.len();
        let priors: Vec<(usize, f64, f64)> = priors(request, x).collect();
        let n = n_cells + priors.len();
        let (mut residuals, mut jacobian) = (DVector::zeros(n), DMatrix::zeros(n, x.len()));
        for (at, (residual, slopes)) in passed.residuals.iter().zip(&passed.slopes).enumerate() {
            residuals[at] = *residual;
            slopes.iter().enumerate().for_each(|(j, slope)| jacobian[(at, j)] = *slope);
        }
        for (at, (j, residual, slope)) in priors.into_iter().enumerate() {
            residuals[n_cells + at] = residual;
            jacobian[(n_cells + at, j)] = slope;
        }
        Ok(Linearised { residuals, jacobian })
    }
}

/// Of each prior the place of its unknown, `(x - m)/s` and `1/s`.
pub(super) fn priors<'a>(
    request: &'a FitRequest,
    x: &'a [f64],
) -> impl Iterator<Item = (usize, f64, f64)> + 'a {
    let known = request.known.iter().zip(x).enumerate();
    known.filter_map(|(j, (known, x))| {
        let prior = known.prior?;
        Some((j, (x - prior.mean) / prior.deviation, prior.deviation.recip()))
    })
}

/// A piece of a motion, with the rows of the table that lie on it.
pub(super) struct Leg<'a> {
    pub(super) directions: &'a [Direction],
    /// The time at which it starts.
    pub(super) t: f64,
    pub(super) rows: Range<usize>,
    /// The time at which it ends, unless that is the time of its last row.
    pub(super) end: Option<f64>,
}

/// What came out along a piece of a motion.
pub(super) struct Passed {
    /// The residual of each cell, in units of its standard deviation where that is known.
    pub(super) residuals: Vec<f64>,
    /// Its derivatives along each direction.
    pub(super) slopes: Vec<Vec<f64>>,
    /// The state at its end, with the derivatives behind it.
    pub(super) end: Vec<f64>,
}

impl Leg<'_> {
    /// From a state with its derivatives along the directions behind it.
    pub(super) fn pass(
        &self,
        (motions, along): (&Motions<'_>, &Along<'_>),
        request: &FitRequest,
        params: &[f64],
        start: &[f64],
    ) -> Result<Passed, Error> {
        let factory = motions.factory;
        let times = &request.times[self.rows.clone()];
        let end = self.end.or(times.last().copied()).unwrap_or_default();
        let (states, end) =
            motions.states((&prepare(along, params)?, request), start, (self.t, times, end))?;
        let n = factory.info().state.len();
        let needs_outputs =
            request.columns.iter().any(|column| !matches!(column.quantity, Quantity::State(_)));
        let duals: Vec<PreparedDuals<'_>> = if needs_outputs {
            let prepared =
                self.directions.iter().map(|direction| factory.prepare_duals(&direction.params(params)));
            // The same values were allowed before.
            prepared.collect::<Result<_, _>>().map_err(|bad| refused(factory.info(), params, bad))?
        } else {
            Vec::new()
        };
        let mut passed = Passed { residuals: Vec::new(), slopes: Vec::new(), end };
        let mut measured = Measured { row: usize::MAX, energy: Vec::new(), outputs: Vec::new() };
        for (k, c, cell) in cells_in(request, self.rows.clone()) {
            let (column, t, z) = (&request.columns[c], request.times[k], &states[k - self.rows.start]);
            let scale = column.sigma.unwrap_or(1.0).recip();
            if measured.row != k {
                measured = Measured::new(&duals, k, t, (z, n));
            }
            let (mut residual, mut slopes) = (0.0, vec![0.0; self.directions.len()]);
            for (j, slope) in slopes.iter_mut().enumerate() {
                let value = match column.quantity {
                    Quantity::State(i) => Dual::new(z[i], z[(j + 1) * n + i]),
                    Quantity::Energy => measured.energy[j],
                    Quantity::Output(i) => measured.outputs[j][i],
                };
                residual = (value.value - cell) * scale;
                *slope = value.derivative * scale;
                let size = f64::abs(residual).max(slope.abs());
                if !(residual.is_finite() && slope.is_finite() && size < RUNS_AWAY) {
                    let what = if size < f64::INFINITY { "runs away" } else { "is not finite" };
                    let reason = format!("{} or its derivative {what}", column.name);
                    return Err(stopped_because(factory.info(), t, &z[..n], reason));
                }
            }
            passed.residuals.push(residual);
            passed.slopes.push(slopes);
        }
        Ok(passed)
    }
}

/// Energy and outputs at a row of the table, along each direction.
struct Measured {
    row: usize,
    energy: Vec<Dual>,
    outputs: Vec<Vec<Dual>>,
}

impl Measured {
    fn new(duals: &[PreparedDuals<'_>], row: usize, t: f64, (z, n): (&[f64], usize)) -> Measured {
        let (mut energy, mut outputs) = (Vec::new(), Vec::new());
        for (j, scene) in duals.iter().enumerate() {
            let tangent = &z[(j + 1) * n..];
            let y: Vec<Dual> = z[..n].iter().zip(tangent).map(|(y, s)| Dual::new(*y, *s)).collect();
            let t = Dual::constant(t);
            energy.extend(scene.energy(t, &y));
            outputs.push(scene.outputs(t, &y));
        }
        Measured { row, energy, outputs }
    }
}

/// The fitted motion, a curve for each column.
pub(super) fn curves(
    motions: &Motions<'_>,
    request: &FitRequest,
    response: &FitResponse,
) -> Result<Vec<Vec<f64>>, Error> {
    let dynamics = prepare(motions.factory, &response.params)?;
    let end = response.curve_times.last().copied().unwrap_or_default();
    let (states, _) =
        motions.states((&dynamics, request), &response.initial, (0.0, &response.curve_times, end))?;
    let curve = |column: &Column| -> Result<Vec<f64>, Error> {
        let value = |(t, y): (&f64, &Vec<f64>)| {
            let value = match column.quantity {
                Quantity::State(i) => Some(y[i]),
                Quantity::Energy => dynamics.energy(*t, y),
                Quantity::Output(i) => dynamics.outputs(*t, y).get(i).copied(),
            };
            let reason = || format!("{} is not finite", column.name);
            let is_finite = |x: &f64| x.is_finite();
            value.filter(is_finite).ok_or_else(|| stopped_because(dynamics.info(), *t, y, reason()))
        };
        response.curve_times.iter().zip(&states).map(value).collect()
    };
    request.columns.iter().map(curve).collect()
}

impl Motions<'_> {
    /// The states of a motion at times, and at its end.
    fn states(
        &self,
        (dynamics, request): (&PreparedScene<'_>, &FitRequest),
        initial: &[f64],
        (t, times, end): (f64, &[f64], f64),
    ) -> Result<(Vec<Vec<f64>>, Vec<f64>), Error> {
        self.go_on()?;
        let method =
            method_of(request.method, request.steps, Purpose::Samples, &**dynamics, initial)?.of_scenes();
        let info = dynamics.info();
        let options = request.steps.options(end - t, request.max_steps)?;
        let initial = VecState(initial.to_vec());
        let mut solver = Integrator::new(dynamics, method, t, initial, options).map_err(|e| match e {
            hamel_runtime::Error::Failure(failure) => {
                Error::State { path: "initial".into(), reason: describe(info, failure) }
            }
            other => Error::Options { reason: other.to_string() },
        })?;
        let mut states = Vec::with_capacity(times.len());
        let sample = |_, y: &VecState| states.push(y.0.clone());
        let go_on = || self.tell(Progress::Step);
        let mut held = Held::new(&**dynamics, (t, &solver.state().0), sample, go_on);
        let reached = solver.observe::<0>(end, times.iter().copied(), [], &mut held);
        held.kept()?;
        self.go_on()?;
        match reached {
            Ok(_) => Ok((states, solver.state().0.clone())),
            Err(error) => {
                Err(stopped_because(info, solver.t(), &solver.state().0, why_stopped(info, &error)))
            }
        }
    }
}
