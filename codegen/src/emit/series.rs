//! The code of the recurrence of Taylor coefficients, and the names under which it reads series.
//!
//! Does not know: any language, how convolutions are kept.

use super::body::{Code, Segment};
use super::dialect::Dialect;
use super::module::{Module, spell, variables};
use crate::program::{Function, Jet, Operand};

/// The functions of a recurrence.
pub(super) struct Series<'a> {
    pub(super) jet: &'a Jet,
    /// The variable of each input: the coefficients of the state, sums, kept values, the order and its inverse.
    pub(super) inputs: Vec<String>,
    /// Order zero.
    pub(super) start: Code,
    /// Every other order.
    pub(super) step: Code,
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
        let code = |function: &Function| {
            let results: Vec<Operand> = function.results.iter().map(|(_, o)| *o).collect();
            let segments = Segment::sections(&jet.program, &function.instructions);
            let name =
                |operand: Operand| spell(dialect, (&module.fields, &module.slots), (&inputs, &[]), operand);
            let mut scope = scope.clone();
            Code::new(dialect, &jet.program, &function.instructions, &segments, &results, &mut scope, name)
        };
        let (start, step) =
            (code(&jet.program.functions[Jet::FIRST]), code(&jet.program.functions[Jet::NEXT]));
        Series { jet, inputs, start, step }
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
