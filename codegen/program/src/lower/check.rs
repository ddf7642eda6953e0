//! What a pass must not do, looked for where debug assertions are on: break the rules of programs, or change a value.
//!
//! Does not know: which passes there are.

use super::Inputs;
use super::form::Form;
use super::passes::PASSES;
use super::pivots::Conditions;
use super::source::Source;
use crate::program::{Program, verify_rules};
use hamel_expr::error::Error;
use hamel_expr::{Budget, ExprId, Graph, Vanishing};

/// What a program has to compute.
pub(super) struct Check<'a> {
    inputs: &'a Inputs,
    /// A copy of the graph, whose budget stays as it is; none where nothing is compared.
    graph: Option<Graph>,
    results: Vec<ExprId>,
}

impl<'a> Check<'a> {
    /// A check of the program of these functions and conditions.
    pub(super) fn new(
        graph: &Graph,
        source: &Source<'a>,
        functions: &[Form],
        conditions: &Conditions,
    ) -> Check<'a> {
        let graph = cfg!(debug_assertions).then(|| {
            let mut graph = graph.clone();
            graph.set_budget(Budget::UNLIMITED);
            graph
        });
        let results = functions.iter().flat_map(Form::results).map(|(_, e)| *e);
        let sides = conditions.conditions.iter().flat_map(|c| [c.greater, c.less]);
        Check { inputs: source.inputs, graph, results: results.chain(sides).collect() }
    }

    /// Whether anything is compared.
    pub(super) fn compares(&self) -> bool {
        self.graph.is_some()
    }

    /// Runs the passes on a program once more, and looks at it after each: which of them it was.
    ///
    /// # Errors
    /// As [`Check::after`].
    pub(super) fn of_passes(&mut self, mut program: Program) -> Result<(), Error> {
        for (name, pass) in PASSES {
            pass(&mut program);
            self.after(name, &program)?;
        }
        Ok(())
    }

    /// Looks at the program after a pass.
    ///
    /// # Errors
    /// [`Error::Program`] with the pass and the first rule that it breaks or the first value that it changes, a bug.
    pub(super) fn after(&mut self, pass: &str, program: &Program) -> Result<(), Error> {
        let Some(graph) = &mut self.graph else { return Ok(()) };
        let broken =
            |reason: String| Error::Program { reason: format!("after {pass}, a bug of hamel: {reason}") };
        verify_rules(program).map_err(|error| match error {
            // The model's numbers are wrong, not the pass.
            Error::OutOfRange { .. } => error,
            error => broken(error.to_string()),
        })?;
        let found = program.to_named_expressions(graph, self.inputs.symbols())?;
        let functions = program.functions.iter();
        let names = functions.flat_map(|f| f.results.iter().map(|(name, _)| format!("{}.{name}", f.role)));
        let sides = program.prepare.conditions.iter().flat_map(|c| [c.text.clone(), c.text.clone()]);
        for ((expected, found), name) in self.results.iter().zip(found).zip(names.chain(sides)) {
            if graph.fingerprints_agree(found, *expected) {
                continue;
            }
            let difference = graph.sub(found, *expected);
            if graph.vanishing(difference) == Vanishing::NonZero {
                return Err(broken(format!("{name} is another value")));
            }
        }
        Ok(())
    }
}
