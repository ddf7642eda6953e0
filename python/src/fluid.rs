//! Fluids that are moved as products of matrices, as arrays of Python.
//!
//! Deliberately does not know: how a fluid is moved, how results look in Python.

use std::collections::BTreeMap;

use hamel_codegen::spec::{self, FluidSurface, MatrixFluid};
use hamel_expr::rational_to_f64;
use hamel_run::error::Error;
use hamel_run::matrices::{self, Outcome};
use hamel_run::method::{MethodName, Steps};
use hamel_run::noise::Noise;
use hamel_run::session::Session;
use hamel_run::simulation::SimulateRequest;
use numpy::ndarray::Array2;
use numpy::{PyArray1, PyArray2, ToPyArray as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::OrRaise as _;
use crate::interrupts::Interrupts;
use crate::shipped::SHIPPED;

/// A fluid that is moved as products of matrices.
#[pyclass(frozen, module = "pyhamel._hamel")]
pub(crate) struct Fluid {
    fluid: MatrixFluid,
}

/// Values by name, of names that there are.
fn chosen(
    given: &BTreeMap<String, f64>,
    what: &str,
    defaults: impl Iterator<Item = (String, f64)>,
) -> Result<Vec<f64>, Error> {
    let defaults: Vec<(String, f64)> = defaults.collect();
    if let Some(wrong) = given.keys().find(|name| defaults.iter().all(|(known, _)| known != *name)) {
        let known: Vec<&str> = defaults.iter().map(|(name, _)| name.as_str()).collect();
        let reason = format!("{wrong} is no {what} of the fluid; there are {}", known.join(", "));
        return Err(Error::Options { reason });
    }
    Ok(defaults.into_iter().map(|(name, value)| given.get(&name).copied().unwrap_or(value)).collect())
}

#[pymethods]
impl Fluid {
    /// The fluid of a file, or of `text`, which `name` stands for then.
    #[staticmethod]
    fn load(py: Python<'_>, name: &str, text: Option<String>) -> PyResult<Fluid> {
        let load = || -> Result<Fluid, Error> {
            let found = match text {
                Some(text) => spec::matrix_fluid(name, &text)?,
                None => Session::of_shipped(SHIPPED).find(name)?.fluid()?,
            };
            let reason = || "has equations: `load` takes it".to_owned();
            Ok(Fluid { fluid: found.ok_or_else(|| Error::unusable(name.to_owned(), reason()))? })
        };
        py.detach(load).or_raise(py)
    }

    /// Name of the model.
    #[getter]
    fn name(&self) -> &str {
        &self.fluid.name
    }

    /// Size of the matrices.
    #[getter]
    fn n(&self) -> usize {
        self.fluid.n
    }

    /// `torus` or `sphere`.
    #[getter]
    fn surface(&self) -> &'static str {
        match self.fluid.surface {
            FluidSurface::Torus => "torus",
            FluidSurface::Sphere => "sphere",
        }
    }

    /// Names of the modes that the model gives, and their values at time zero.
    #[getter]
    fn modes(&self) -> Vec<(String, f64)> {
        let modes = self.fluid.modes.iter();
        modes.map(|mode| (mode.name.clone(), rational_to_f64(&mode.initial))).collect()
    }

    /// Name, value and meaning of each parameter.
    #[getter]
    fn params(&self) -> Vec<(String, f64, String)> {
        let params = self.fluid.params.iter();
        params.map(|p| (p.name.clone(), rational_to_f64(&p.value), p.doc.clone())).collect()
    }

    /// Names of the Casimirs.
    #[getter]
    fn casimirs(&self) -> Vec<String> {
        self.fluid.casimirs.iter().map(|casimir| casimir.name.clone()).collect()
    }

    /// Names of the fields that the flow carries.
    #[getter]
    fn carried(&self) -> Vec<String> {
        self.fluid.carried.iter().map(|field| field.name.clone()).collect()
    }

    /// All coefficients in the order of fields: wave or degree and order, and whether it is the imaginary part or that
    /// of the sine.
    fn waves(&self) -> Vec<(i64, i64, bool)> {
        let waves = self.fluid.surface.waves(self.fluid.n).into_iter();
        waves.map(|wave| (wave.wave.0, wave.wave.1, wave.is_second)).collect()
    }

    /// A motion up to a time, by steps of a size, with so many samples: arrays by name.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        motion: (f64, f64, usize),
        y0: BTreeMap<String, f64>,
        params: BTreeMap<String, f64>,
        with_fields: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let (t_final, step, samples) = motion;
        let mut interrupts = Interrupts::new();
        let run = || -> Result<Outcome, Error> {
            if samples < 2 {
                let reason = format!("samples is {samples}: give at least 2");
                return Err(Error::Options { reason });
            }
            let defaults = self.fluid.params.iter().map(|p| (p.name.clone(), rational_to_f64(&p.value)));
            let params = chosen(&params, "parameter", defaults)?;
            let fluid = matrices::at(&self.fluid, &params)?;
            let modes = fluid.modes.iter().map(|mode| mode.name.clone());
            let initial = chosen(&y0, "mode", modes.zip(matrices::initial(&fluid)))?;
            let steps = Steps::Fixed { step };
            let request = SimulateRequest {
                params,
                initial,
                t_final,
                method: MethodName::Isospectral,
                steps,
                samples,
                with_outputs: true,
                n_group: 0,
                max_steps: steps.max_steps(),
                max_events: 0,
                watched: None,
                noise: Noise::default(),
                along: Vec::new(),
                tangents: Vec::new(),
            };
            let pictured: Vec<usize> = if with_fields { (0..samples).collect() } else { Vec::new() };
            matrices::simulate(&self.fluid, &request, &pictured, &mut || interrupts.look())
        };
        let made = py.detach(run);
        interrupts.raised()?;
        let Outcome { response, fields, .. } = made.or_raise(py)?;
        let samples = &response.samples;
        let table = |width: usize, rows: Vec<&[f64]>| {
            let all: Vec<f64> = rows.iter().flat_map(|row| row.iter().copied()).collect();
            let made = Array2::from_shape_vec((rows.len(), width), all);
            made.map_err(|e| pyo3::exceptions::PyRuntimeError::new_err(e.to_string()))
        };
        let found = PyDict::new(py);
        let column = |values: Vec<f64>| -> Bound<'py, PyArray1<f64>> { values.to_pyarray(py) };
        found.set_item("t", column(samples.iter().map(|sample| sample.t).collect()))?;
        found.set_item("energy", column(samples.iter().filter_map(|sample| sample.energy).collect()))?;
        let (n_modes, n_casimirs) = (self.fluid.modes.len(), self.fluid.casimirs.len());
        let y: Bound<'py, PyArray2<f64>> =
            table(n_modes, samples.iter().map(|s| s.state.as_slice()).collect())?.to_pyarray(py);
        found.set_item("y", y)?;
        let casimirs = table(n_casimirs, samples.iter().map(|s| s.outputs.as_slice()).collect())?;
        found.set_item("casimirs", casimirs.to_pyarray(py))?;
        if with_fields {
            let n_waves = self.fluid.n * self.fluid.n - 1;
            let carried = PyDict::new(py);
            let of_field =
                |k: usize| table(n_waves, fields.iter().map(|(_, all)| all[k].as_slice()).collect());
            found.set_item("fields", of_field(0)?.to_pyarray(py))?;
            for (k, field) in self.fluid.carried.iter().enumerate() {
                carried.set_item(&field.name, of_field(1 + k)?.to_pyarray(py))?;
            }
            found.set_item("carried", carried)?;
        }
        Ok(found)
    }
}
