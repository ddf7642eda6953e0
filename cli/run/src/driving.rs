//! What evaluates a scene with prepared parameters, its inputs held or driven; machine code of a scene on lanes.
//!
//! Does not know: where a scene comes from, what else it can be asked for.

use std::borrow::Cow;

use hamel_codegen::scene::Interpreter;
use hamel_program::program::{Point, Run as _, ViolatedCondition};
use hamel_runtime::{Dual, F64x4, Failure, Pivot, Real};

use super::dynamics::{BadParams, DualDynamics, LaneDynamics, Several, VecState};
use super::guards::{check, domain, pivots};
use super::inputs::Drive;
use super::machine::Compiled;

/// The condition that parameters violate.
pub(super) fn bad_params(bad: ViolatedCondition) -> BadParams {
    BadParams { condition: bad.condition, meaning: bad.meaning }
}

/// What evaluates a scene, with what drives its inputs.
#[derive(Clone, Debug)]
pub(super) struct Driving<'a, R = f64> {
    pub(super) interpreter: Interpreter<'a, R>,
    pub(super) drive: Drive,
}

impl<'a, R: Real> Driving<'a, R> {
    /// With inputs that stay where they are held.
    pub(super) fn held(interpreter: Interpreter<'a, R>) -> Driving<'a, R> {
        Driving { interpreter, drive: None }
    }

    /// The same with what drives the inputs.
    pub(super) fn driven(self, drive: &Drive) -> Driving<'a, R> {
        Driving { drive: drive.clone(), ..self }
    }

    /// The same with inputs that are held at these values, whatever drives them; as it is without values.
    pub(super) fn holding(mut self, inputs: &[R]) -> Driving<'a, R> {
        if !inputs.is_empty() {
            self.drive = None;
            self.interpreter.set_inputs(inputs);
        }
        self
    }

    /// What evaluates the scene with the inputs of a time.
    pub(super) fn at(&self, t: R) -> Cow<'_, Interpreter<'a, R>> {
        let Some(drive) = &self.drive else { return Cow::Borrowed(&self.interpreter) };
        let mut interpreter = self.interpreter.clone();
        interpreter.set_inputs(&drive.at(t));
        Cow::Owned(interpreter)
    }
}

impl DualDynamics for Driving<'_, Dual> {
    fn rhs(&self, t: Dual, y: &[Dual], dy: &mut [Dual]) {
        self.at(t).rhs(t, y, dy);
    }

    fn energy(&self, t: Dual, y: &[Dual]) -> Option<Dual> {
        self.at(t).energy(t, y)
    }

    fn outputs(&self, t: Dual, y: &[Dual]) -> Vec<Dual> {
        self.at(t).outputs(t, y)
    }
}

/// The machine code of a scene on lanes.
pub(super) struct OnLanes<'a, L = F64x4> {
    pub(super) driving: Driving<'a, L>,
    /// Number of parameters and of the inputs that are held.
    pub(super) n_values: usize,
    /// What evaluates the rates, and which function they are.
    pub(super) rate: (&'a Compiled, usize),
}

impl<L: Several> LaneDynamics<L> for OnLanes<'_, L> {
    fn rhs(&self, t: L, y: &VecState<L>, dy: &mut VecState<L>) {
        match &self.driving.drive {
            None => {
                let (compiled, rate) = self.rate;
                let (params, prepared) = self.driving.interpreter.values_of_functions();
                let point = Point { t, state: &y.0, argument: &[] };
                compiled.run_at(rate, params, prepared, point, &mut dy.0);
            }
            Some(_) => self.driving.at(t).rhs(t, &y.0, &mut dy.0),
        }
    }

    fn run_rows(&self, times: (L, L), start: (&[L], &[L]), increments: &mut [L]) -> bool {
        let (compiled, rate) = self.rate;
        let values = self.driving.interpreter.values_of_functions();
        // What drives inputs is looked up between the substeps.
        self.driving.drive.is_none() && compiled.run_rows(rate, values, times, start, increments)
    }

    fn hold(&mut self, inputs: &[L]) -> bool {
        let interpreter = &mut self.driving.interpreter;
        let is_held = self.n_values == interpreter.n_params() + inputs.len();
        if is_held && !inputs.is_empty() {
            interpreter.set_inputs(inputs);
        }
        is_held
    }

    fn energy(&self, t: L, y: &VecState<L>) -> Option<L> {
        self.driving.at(t).energy(t, &y.0)
    }

    fn write_outputs(&self, t: L, y: &VecState<L>, out: &mut Vec<L>) {
        self.driving.at(t).write_outputs(t, &y.0, out);
    }

    fn set(&mut self, values: &[L]) -> Option<Result<(), BadParams>> {
        // Inputs that are held, or are not, take part in what drives them.
        if values.len() != self.n_values {
            return None;
        }
        let interpreter = &mut self.driving.interpreter;
        let (params, inputs) = values.split_at(interpreter.n_params());
        let prepared = interpreter.prepare_again(params).map_err(bad_params);
        if !inputs.is_empty() {
            interpreter.set_inputs(inputs);
        }
        Some(prepared)
    }

    fn check(&self, t: L, y: &VecState<L>) -> Result<(), Failure> {
        check(&self.driving.at(t), t, &y.0)
    }

    fn domain(&self, t: L, y: &VecState<L>) -> Result<(), Failure> {
        domain(&self.driving.at(t), t, &y.0)
    }

    fn signature(&self, t: L, y: &VecState<L>) -> L {
        self.driving.at(t).signature(t, &y.0)
    }

    fn pivots(&self, t: L, y: &VecState<L>, visit: &mut dyn FnMut(Pivot<L>)) {
        pivots(&self.driving.at(t), t, &y.0, visit);
    }
}
