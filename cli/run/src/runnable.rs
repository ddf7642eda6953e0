//! Programs of a scene, with what runs them: machine code that is made when a function is first called, or nothing
//! where they are interpreted.
//!
//! Does not know: which scene a program is of, who asks for it.

use std::ops::Deref;

use hamel_codegen::scene::{Executable, Interpreter};
use hamel_program::program::{Circles, Jet, Program, Role, Run, ViolatedCondition};

use super::driving::{Driving, OnLanes};
use super::dynamics::Several;
use super::inputs::Drive;
use super::machine::Compiled;
use crate::streams::note;

/// A program with what runs it: its machine code, or nothing where it is interpreted.
#[derive(Debug)]
pub(super) struct Runnable {
    pub(super) executable: Executable,
    pub(super) compiled: Option<Compiled>,
}

impl Deref for Runnable {
    type Target = Executable;

    fn deref(&self) -> &Executable {
        &self.executable
    }
}

/// The machine code of a program; none, with a note, where there is no compiler for this machine.
fn compiled(program: &Program) -> Option<Compiled> {
    let compiled = Compiled::new(program);
    if let Err(reason) = &compiled {
        note(format_args!("note: {reason}; the scene is interpreted"));
    }
    compiled.ok()
}

impl Runnable {
    pub(super) fn new(executable: Executable, in_memory: bool) -> Runnable {
        let compiled = in_memory.then(|| compiled(&executable.program)).flatten();
        Runnable { executable, compiled }
    }

    pub(super) fn prepare(&self, params: &[f64]) -> Result<Interpreter<'_>, ViolatedCondition> {
        match &self.compiled {
            Some(compiled) => self.executable.prepare_on(compiled, params),
            None => self.executable.prepare(params),
        }
    }

    /// On lanes with parameters and inputs of their own, where the program is compiled.
    pub(super) fn prepare_lanes<L: Several>(
        &self,
        (params, inputs): (&[L], &[L]),
        drive: &Drive,
    ) -> Option<Result<OnLanes<'_, L>, ViolatedCondition>> {
        let compiled = self.compiled.as_ref()?;
        let rate = self.program.function_idx(&Role::Rate)?;
        let on_lanes = |interpreter| OnLanes {
            driving: Driving::held(interpreter).driven(drive).holding(inputs),
            n_values: params.len() + inputs.len(),
            rate: (compiled, rate),
        };
        Some(self.executable.prepare_on(compiled, params).map(on_lanes))
    }
}

/// The right-hand side on circles, with what runs it.
#[derive(Debug)]
pub(super) struct RunnableCircles {
    pub(super) circles: Circles,
    pub(super) compiled: Option<Compiled>,
}

impl RunnableCircles {
    pub(super) fn new(circles: Circles, in_memory: bool) -> RunnableCircles {
        let compiled = in_memory.then(|| compiled(&circles.program)).flatten();
        RunnableCircles { circles, compiled }
    }

    pub(super) fn run(&self) -> &dyn Run<f64> {
        match &self.compiled {
            Some(compiled) => compiled,
            None => &self.circles.program,
        }
    }
}

/// The recurrence of Taylor coefficients, with what runs it.
#[derive(Debug)]
pub(super) struct RunnableSeries {
    pub(super) jet: Jet,
    compiled: Option<Compiled>,
}

impl RunnableSeries {
    pub(super) fn new(jet: Jet, in_memory: bool) -> RunnableSeries {
        let compiled = in_memory.then(|| compiled(&jet.program)).flatten();
        RunnableSeries { jet, compiled }
    }

    pub(super) fn run(&self) -> &dyn Run<f64> {
        match &self.compiled {
            Some(compiled) => compiled,
            None => &self.jet.program,
        }
    }
}
