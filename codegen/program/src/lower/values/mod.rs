//! Expressions as values: numbered, then put into the functions of a program.
//!
//! `number` makes every value once for all functions, `assemble` hoists those that depend on parameters alone and
//! orders the others. Does not know: why an expression has the form that it has, fused operations.

mod assemble;
mod number;

use super::form::Form;
use super::pivots::Conditions;
use super::{Inputs, Request};
use crate::program::Program;
use hamel_expr::Graph;
use hamel_expr::error::Error;

/// The program of functions and conditions.
///
/// # Errors
/// [`Error::Program`] for a symbol that is used before its definition.
pub(super) fn program(
    graph: &mut Graph,
    inputs: &Inputs,
    functions: &[Form],
    conditions: &Conditions,
    requests: &[Request],
) -> Result<Program, Error> {
    let mut pool = number::Pool::new();
    let mut numbered = Vec::with_capacity(functions.len());
    for form in functions {
        let function = number::number_function(graph, inputs, form, &mut pool)?;
        graph.charge(function.definitions.len() + function.results.len());
        numbered.push(function);
    }
    graph.within_budget()?;
    let sides = number::number_conditions(graph, inputs, conditions, requests, &mut pool)?;
    assemble::assemble(graph, inputs, conditions, &pool, &numbered, &sides)
}
