//! States of a scene that a loop of Python moves on, in storage that stays.
//!
//! Deliberately does not know: how a step is taken, how results look in Python.

use std::sync::{Arc, Mutex, PoisonError};

use hamel_run::error::Error;
use hamel_run::interpreted::Built;
use hamel_run::stepper::{Room, Stepper as Steps};
use hamel_runtime::F64x8;
use numpy::{PyReadonlyArray2, PyReadwriteArray2, PyUntypedArrayMethods as _};
use pyo3::prelude::*;
use rayon::iter::{IndexedParallelIterator as _, IntoParallelRefMutIterator as _, ParallelIterator as _};
use rayon::slice::ParallelSliceMut as _;
use self_cell::self_cell;

use crate::errors::OrRaise as _;
use crate::motion::Options;
use crate::pool;
use crate::scene::Scene;

/// What moves states, and the storage of each piece of them, which one thread moves.
struct Moving<'a> {
    steps: Steps<'a>,
    pieces: Vec<Room<'a>>,
}

self_cell!(
    struct Kept {
        owner: Arc<Built>,
        #[not_covariant]
        dependent: Moving,
    }
);

/// Moves states of a scene on by the same length of time again and again.
#[pyclass(frozen, module = "pyhamel._hamel")]
pub(crate) struct Stepper {
    kept: Mutex<Kept>,
    n_state: usize,
    n_inputs: usize,
    /// Groups of eight that are work enough for a thread, some tens of microseconds.
    n_groups: usize,
}

/// A row that was not moved on, and why.
type Stopped = (usize, Error);

#[pymethods]
impl Stepper {
    /// For the parameters of a scene.
    #[staticmethod]
    fn of(py: Python<'_>, scene: &Scene, dt: f64, options: Options) -> PyResult<Stepper> {
        let made = || -> Result<Stepper, Error> {
            let pace = options.pace(scene.info(), dt)?;
            if scene.built().watched().is_some_and(|watched| watched.acts()) {
                let reason = "has events that change the state or end the motion, which a stepper does not carry out: \
                              choose a scene without `events`";
                return Err(Error::unusable("scene", reason));
            }
            let kept = Kept::try_new(scene.shared(), |built| -> Result<Moving<'_>, Error> {
                let steps = Steps::new(&**built, &scene.values, pace)?;
                Ok(Moving { steps, pieces: Vec::new() })
            })?;
            let (n_state, n_inputs) = (scene.info().state.len(), scene.info().inputs.len());
            // A step is some ten evaluations of eight states, which cost twice as much as one.
            let n_groups = (PIECE / (20 * scene.cost()).max(1)).clamp(2, 1 << 13) as usize;
            Ok(Stepper { kept: Mutex::new(kept), n_state, n_inputs, n_groups })
        };
        py.detach(made).or_raise(py)
    }

    /// Moves the rows of `states` on from `t`, in their place, with inputs held at the rows of `inputs`, or of a single
    /// one; where they are not given, they are what the scene has.
    #[pyo3(signature = (states, inputs, t, threads))]
    fn step(
        &self,
        py: Python<'_>,
        mut states: PyReadwriteArray2<'_, f64>,
        inputs: Option<PyReadonlyArray2<'_, f64>>,
        t: f64,
        threads: Option<bool>,
    ) -> PyResult<()> {
        let (n, n_inputs, n_rows) = (self.n_state, self.n_inputs, states.shape()[0]);
        let is_of_inputs = |u: &PyReadonlyArray2<'_, f64>| u.shape() == [n_rows, n_inputs];
        if states.shape()[1] != n || !inputs.as_ref().is_none_or(is_of_inputs) {
            return Err(pyo3::exceptions::PyValueError::new_err("arrays of other shapes than the scene's"));
        }
        let contiguous = |_| pyo3::exceptions::PyValueError::new_err("arrays that are not contiguous");
        let states = states.as_slice_mut().map_err(contiguous)?;
        let inputs = inputs.as_ref().map(|u| u.as_slice()).transpose().map_err(contiguous)?;
        let mut moved = || -> Result<(), Error> {
            let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
            kept.with_dependent_mut(|_, moving| self.moved(moving, t, (states, inputs), threads))
        };
        // One state takes less time than to let go of Python.
        let done = if n_rows == 1 { moved() } else { py.detach(moved) };
        done.or_raise(py)
    }
}

/// Cost of the work that a thread takes at once.
const PIECE: u64 = 1 << 17;

impl Stepper {
    fn moved<'m>(
        &self,
        Moving { steps, pieces }: &mut Moving<'m>,
        t: f64,
        (states, inputs): (&mut [f64], Option<&[f64]>),
        threads: Option<bool>,
    ) -> Result<(), Error> {
        let (n, n_inputs, n_rows) = (self.n_state, self.n_inputs, states.len() / self.n_state.max(1));
        let n_piece = self.n_groups * F64x8::LANES;
        // Two pieces are done before threads have woken up.
        let is_parallel = threads.unwrap_or(n_rows > 4 * n_piece);
        let n_piece = if is_parallel { n_piece } else { n_rows.max(1) };
        pieces.resize_with(n_rows.div_ceil(n_piece).max(pieces.len()), Room::default);
        let steps = &*steps;
        let of = |(number, (room, states)): (usize, (&mut Room<'m>, &mut [f64]))| {
            let (first, n_own) = (number * n_piece, states.len() / n);
            let inputs = inputs.map_or(&[][..], |all| &all[first * n_inputs..(first + n_own) * n_inputs]);
            let stopped = steps.step_all(room, t, inputs, states).err();
            stopped.map(|(row, error)| (first + row, error))
        };
        let stopped: Option<Stopped> = if is_parallel {
            let all = || {
                let pieces = pieces.par_iter_mut().zip(states.par_chunks_mut(n_piece * n)).enumerate();
                pieces.filter_map(of).min_by_key(|(row, _)| *row)
            };
            pool::of_process()?.install(all)
        } else {
            let pieces = pieces.iter_mut().zip(states.chunks_mut(n_piece * n)).enumerate();
            pieces.filter_map(of).next()
        };
        match stopped {
            None => Ok(()),
            Some((row, Error::Stopped { t, state, reason })) if n_rows > 1 => {
                Err(Error::Stopped { t, state, reason: format!("state {row} of {n_rows}: {reason}") })
            }
            Some((_, error)) => Err(error),
        }
    }
}
