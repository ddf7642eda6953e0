//! Deliberate faults between the steps of the pipeline, which the comparison with the model has to find.
//!
//! For tests alone: nothing calls it where the feature `internals` is off. Does not know: which faults there are.

use std::sync::Arc;

use hamel_lang::spec::{Diagnostics, Model};
use hamel_mechanics::mechanics::{Equations, derive_to};
use hamel_mechanics::reduction::{ReducedSystem, reduce};
use hamel_program::program::Program;

use super::build::build_derived;
use super::{BuiltScene, Scenes};

/// What a step of the pipeline has made.
#[derive(Debug)]
pub enum Made<'a> {
    /// By reduction.
    System(&'a mut ReducedSystem),
    /// By the derivation.
    Equations(&'a mut Equations),
    /// By lowering.
    Program(&'a mut Program),
}

/// Builds a scene as [`build`](super::build) does, with what an FMU asks of it, and calls `fault` with what
/// every step has made.
///
/// # Errors
/// As [`build`](super::build); [`Error::Disagrees`](hamel_expr::error::Error::Disagrees) for the faults.
pub fn build_tampered(
    model: &Model,
    scene: &str,
    fault: &dyn Fn(Made<'_>),
) -> Result<BuiltScene, Diagnostics> {
    let plan = Scenes::new(model).for_fmus().plan(scene)?;
    let mut system = reduce(model, &plan.formulation)?;
    fault(Made::System(&mut system));
    let told = |e| model.diagnostics(vec![model.diagnose(&e)]);
    let mut equations = derive_to(&system, plan.asked().extent).map_err(told)?;
    fault(Made::Equations(&mut equations));
    let mut built = build_derived(model, Arc::new(equations), &plan)?;
    fault(Made::Program(&mut built.program));
    built.certified(Arc::new(model.clone())).map_err(told)
}
