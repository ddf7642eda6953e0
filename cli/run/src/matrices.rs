//! A fluid that is moved as products of matrices, integrated by the isospectral midpoint rule, with friction and force
//! by Strang's splitting.
//!
//! Does not know: how a request was written, files, figures, models with equations.

use std::ops::ControlFlow;

use hamel_codegen::certify;
use hamel_codegen::config::Problem;
use hamel_codegen::fluid::{Modes, Solver, rational, stream};
use hamel_codegen::spec::{FluidField, FluidSurface, MatrixFluid};
use hamel_expr::rational_to_f64;
use hamel_runtime::Error as SolverError;
use hamel_runtime::matrices::{Options, Sphere, Torus};

use super::info::{Info, OutputEntry, ParamEntry};
use super::method::{MethodName, Steps};
use super::simulation::{Sample, SimulateRequest, SimulateResponse, stopped_because};
use crate::error::Error;
use crate::model::DEFAULT_SCENE;

/// What the state is in figures and answers: the modes that the model gives.
pub fn info(fluid: &MatrixFluid) -> Info {
    let casimirs: Vec<String> = fluid.casimirs.iter().map(|c| c.name.clone()).collect();
    let group = |components| OutputEntry {
        name: "casimirs".into(),
        components,
        doc: if fluid.carried.is_empty() {
            "traces of powers of the vorticity by N".into()
        } else {
            "traces of products of matrices by N".into()
        },
    };
    let param = |p: &hamel_codegen::spec::FluidParam| ParamEntry {
        name: p.name.clone(),
        default: rational_to_f64(&p.value),
        doc: p.doc.clone(),
    };
    Info {
        model: fluid.name.clone(),
        scene: DEFAULT_SCENE.into(),
        state: fluid.modes.iter().map(|m| m.name.clone()).collect(),
        momenta: Vec::new(),
        params: fluid.params.iter().map(param).collect(),
        inputs: Vec::new(),
        noises: Vec::new(),
        velocities: Vec::new(),
        frames: Vec::new(),
        outputs: if casimirs.is_empty() { Vec::new() } else { vec![group(casimirs)] },
        has_energy: true,
        conserves_energy: !fluid.is_damped(),
    }
}

/// Why no method but one moves matrices.
pub fn other_method(method: MethodName) -> Error {
    let name = method.name();
    let reason = format!("method {name}: matrices are moved by isospectral alone, leave the method out");
    Error::Options { reason }
}

/// Values of the modes at time zero, unless told otherwise.
pub fn initial(fluid: &MatrixFluid) -> Vec<f64> {
    fluid.modes.iter().map(|mode| rational_to_f64(&mode.initial)).collect()
}

/// The fluid with values of its parameters, in their order.
///
/// # Errors
/// [`Error::Options`] for values that are not finite, and conditions that they violate.
pub fn at(fluid: &MatrixFluid, params: &[f64]) -> Result<MatrixFluid, Error> {
    let mut exact = Vec::new();
    for (param, value) in fluid.params.iter().zip(params) {
        // A double is not the decimal number that it stands for.
        let is_default = rational_to_f64(&param.value) == *value;
        let given = if is_default { Some(param.value.clone()) } else { rational(*value) };
        let reason = format!("parameter {}: {value} is no finite number", param.name);
        exact.push(given.ok_or(Error::Options { reason })?);
    }
    Ok(fluid.at(&exact)?)
}

/// What came out, and the Casimirs at the start and at the end.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// As of any other simulation; evaluations of the right-hand side are iterations.
    pub response: SimulateResponse,
    /// Times of the samples that were asked for, and all coefficients of the vorticity and of each carried field, in
    /// the order of the algebra.
    pub fields: Vec<(f64, Vec<Vec<f64>>)>,
    /// Name, value at the start and at the end.
    pub casimirs: Vec<(String, [f64; 2])>,
}

/// Integrates a fluid in steps of one size, at most that of the request, such that samples are at steps; `pictured` are
/// the samples, in ascending order, at which all of the fields is wanted; `look` is called after steps, and may end
/// the motion.
///
/// # Errors
/// [`Error::Options`] for another method and for tolerances in the place of a step, parameters that the model refuses,
/// [`Error::Stopped`] where the iteration of a step does not converge.
pub fn simulate(
    fluid: &MatrixFluid,
    request: &SimulateRequest,
    pictured: &[usize],
    look: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    let info = info(fluid);
    request.validate(&info)?;
    let options = |reason: String| Error::Options { reason };
    // Who says nothing about the method has the default of all others.
    if ![MethodName::default(), MethodName::Isospectral].contains(&request.method) {
        return Err(other_method(request.method));
    }
    if !request.along.is_empty() {
        return Err(options("sensitivity: a fluid of matrices has no derivatives of its motion".into()));
    }
    let Steps::Fixed { step } = request.steps else {
        let reason = "a fluid of matrices is moved in fixed steps: give the step, and no tolerances";
        return Err(options(reason.into()));
    };
    let fluid = &at(fluid, &request.params)?;
    certify::fluid(fluid)
        .map_err(|source| Problem::Emission { model: fluid.name.clone(), source: Box::new(source) })
        .map_err(hamel_codegen::config::Problems::from)?;
    match fluid.surface {
        FluidSurface::Torus => run::<Torus<Vec<f64>>>((fluid, &info), request, step, pictured, look),
        FluidSurface::Sphere => run::<Sphere<Vec<f64>>>((fluid, &info), request, step, pictured, look),
    }
}

fn run<S: Modes>(
    (fluid, info): (&MatrixFluid, &Info),
    request: &SimulateRequest,
    step: f64,
    pictured: &[usize],
    look: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    let clock = std::time::Instant::now();
    let intervals = request.samples.max(2) - 1;
    let per_interval = (request.t_final.abs() / intervals as f64 / step * (1.0 - 1e-12)).ceil().max(1.0);
    let n_steps = per_interval * intervals as f64;
    let limit = request.max_steps;
    if n_steps > limit as f64 {
        let reason =
            format!("{n_steps:.1e} steps are needed, and at most {limit} are taken: give a larger step");
        return Err(Error::Options { reason });
    }
    let size = request.t_final.abs() / n_steps;
    // At time zero nothing moves, whatever the step.
    let options = Options::fixed(if size > 0.0 { size } else { step });
    let refused = |e: SolverError| Error::Options { reason: e.to_string() };
    let surface = &S::surface(fluid.n, stream(fluid)).map_err(refused)?;
    let mut solver = Solver::new(fluid, surface, options).map_err(refused)?;
    for (mode, value) in fluid.modes.iter().zip(&request.initial) {
        surface.add(mode.wave, *value, solver.field_mut(mode.field));
    }
    let casimirs = |solver: &mut Solver<'_, S>| solver.casimirs(fluid);
    let modes = |solver: &Solver<'_, S>| -> Vec<f64> {
        fluid.modes.iter().map(|mode| surface.value(mode.wave, solver.field(mode.field))).collect()
    };
    let initial_energy = solver.energy();
    let energy_scale = if initial_energy.abs() >= f64::MIN_POSITIVE { initial_energy.abs() } else { 1.0 };
    let first = casimirs(&mut solver);
    let mut deviation = 0.0_f64;
    let (mut samples, mut energy_at_steps, mut fields) = (Vec::new(), Vec::new(), Vec::new());
    let n_samples = request.samples;
    // So many points are enough for any figure.
    let stride = (n_steps / 4096.0).ceil().max(1.0) as u64;
    let mut is_interrupted = false;
    'motion: for k in 0..=intervals {
        let (from, to) =
            (if k == 0 { 0.0 } else { request.t_final * ((k - 1) as f64 / intervals as f64) }, {
                request.t_final * (k as f64 / intervals as f64)
            });
        let count = if k == 0 || request.t_final == 0.0 { 0 } else { per_interval as u64 };
        for j in 1..=count {
            let time = if j == count { to } else { from + (to - from) * (j as f64 / count as f64) };
            if let Err(error) = solver.integrate_to(time) {
                return Err(stopped_because(info, solver.fluid().t(), &modes(&solver), error.to_string()));
            }
            let energy = solver.energy();
            deviation = deviation.max((energy - initial_energy).abs());
            if request.with_outputs && solver.fluid().stats().steps.is_multiple_of(stride) {
                energy_at_steps.push((solver.fluid().t(), energy));
            }
            if (k, j) != (intervals, count) && look().is_break() {
                is_interrupted = true;
                break 'motion;
            }
        }
        // A single sample is the end.
        if n_samples > 1 || (n_samples == 1 && k == intervals) {
            if pictured.binary_search(&samples.len()).is_ok() {
                let carried = (0..fluid.carried.len()).map(FluidField::Carried);
                let all = std::iter::once(FluidField::Vorticity).chain(carried);
                let all = all.map(|field| surface.all(solver.field(field))).collect();
                fields.push((solver.fluid().t(), all));
            }
            samples.push(Sample {
                t: solver.fluid().t(),
                state: modes(&solver),
                energy: Some(solver.energy()),
                outputs: if request.with_outputs { casimirs(&mut solver) } else { Vec::new() },
                along: Vec::new(),
            });
        }
    }
    let stats = solver.fluid().stats();
    let last = casimirs(&mut solver);
    let names = fluid.casimirs.iter().map(|c| c.name.clone());
    Ok(Outcome {
        fields,
        casimirs: names.zip(first.into_iter().zip(last).map(|(a, b)| [a, b])).collect(),
        response: SimulateResponse {
            t: if is_interrupted { solver.fluid().t() } else { request.t_final },
            last: modes(&solver),
            along: Vec::new(),
            samples,
            steps: stats.steps,
            rejected: 0,
            rhs_evals: stats.iterations,
            energy_drift: Some(deviation / energy_scale),
            initial_energy: Some(initial_energy),
            energy_scale,
            energy_at_steps,
            initial_residual: None,
            constraint_residual: None,
            events: None,
            ended_by: None,
            singular_positions: Vec::new(),
            warnings: Vec::new(),
            seconds: clock.elapsed().as_secs_f64(),
        },
    })
}
