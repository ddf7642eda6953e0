//! The code of the recurrence of Taylor coefficients, and the names under which it reads series.
//!
//! Does not know: any language, how convolutions are kept.

use super::body::{Code, Segment};
use super::dialect::Dialect;
use super::module::{Loops, Module, spell, variables};
use crate::program::{Function, Jet, Operand};

/// The functions of a recurrence.
pub(super) struct Series<'a> {
    pub(super) jet: &'a Jet,
    /// The variable of each input: the coefficients of the state, sums, kept values, the order and its inverse.
    pub(super) inputs: Vec<String>,
    /// The variable of each input of the system.
    pub(super) held: Vec<String>,
    /// Order zero.
    pub(super) start: Part<'a>,
    /// Every other order.
    pub(super) step: Part<'a>,
}

/// One function of a recurrence.
pub(super) struct Part<'a> {
    pub(super) function: &'a Function,
    pub(super) code: Code,
    /// What comes after the straight-line code, where something does.
    pub(super) loops: Option<Loops>,
}

/// The variables of the order and of its inverse.
pub(super) const ORDER: &str = "order";
pub(super) const INVERSE: &str = "inverse";

impl<'a> Series<'a> {
    /// Names and writes both functions; `taken` are the variables that the dialect's declaration of the method has
    /// besides the arguments of other functions.
    pub(super) fn new(
        dialect: &impl Dialect,
        module: &Module<'_>,
        jet: &'a Jet,
        taken: &[&str],
    ) -> Series<'a> {
        let mut scope = variables(dialect, &module.constants);
        scope.take(taken.iter().chain(&[ORDER, INVERSE]).copied());
        let mut inputs = scope.add_all(jet.program.state[..jet.n_state].iter().map(String::as_str));
        let numbered = |prefix: &str, n: usize| (0..n).map(|k| format!("{prefix}{k}")).collect::<Vec<_>>();
        for name in numbered("sum", jet.n_lanes).iter().chain(&numbered("kept", jet.n_kept)) {
            inputs.push(scope.add(name));
        }
        inputs.extend([ORDER.to_owned(), INVERSE.to_owned()]);
        let held = scope.add_all(jet.program.inputs.iter().map(|(name, _)| name.as_str()));
        let part = |k: usize| {
            let function = &jet.program.functions[k];
            let mut scope = scope.clone();
            let mut loops = Loops::new(function, &mut scope);
            let results: Vec<Operand> = function.outputs().collect();
            let instructions = &function.instructions;
            let segments = Segment::sections(&jet.program, instructions);
            let name = |operand: Operand| match (operand, &loops) {
                (Operand::Contracted(i), Some(loops)) => loops.element(dialect, function, i),
                _ => spell(dialect, (&module.fields, &module.slots), (&inputs, &[], &held), operand),
            };
            let mut code =
                Code::new(dialect, &jet.program, instructions, &segments, (&results, &[]), &mut scope, name);
            if let Some(loops) = &mut loops {
                loops.take_values(function, &mut code);
            }
            Part { function, code, loops }
        };
        let (start, step) = (part(Jet::FIRST), part(Jet::NEXT));
        Series { jet, inputs, held, start, step }
    }

    /// Number of the input that is the order, in the recurrence.
    pub(super) fn order(&self) -> u32 {
        self.inputs.len() as u32 - 2
    }

    /// Number of the input that is the inverse of the order.
    pub(super) fn inverse(&self) -> u32 {
        self.inputs.len() as u32 - 1
    }
}
