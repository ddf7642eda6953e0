//! What a generated module holds, before any language says how: names, which functions there are, and the code of each.
//!
//! Does not know: any language beyond what its dialect answers; mechanics.

use std::collections::{BTreeMap, BTreeSet};

use super::body::{Code, Segment, constant};
use super::dialect::Dialect;
use super::expression::{Formula, Text, operation};
use super::names::Scope;
use super::text::{
    DiscreteText, FlowText, ImplicitText, MatrixText, OutputText, PositionsText, ProductText, RanksText,
    SceneText,
};
use crate::program::{Circles, Factors, Function, Operand, Program, Role};
use hamel_expr::error::Error;

/// Longer formulas say less than a sentence.
const MAX_DOC_FORMULA: usize = 90;

/// The output that the gradients [`GRADIENTS`] are of.
const INVARIANTS: &str = "invariants";
/// The matrix whose rows are the gradients of [`INVARIANTS`].
const GRADIENTS: &str = "invariant_gradients";
/// The matrix of the derivatives of the right-hand side by the state.
const JACOBIAN: &str = "jacobian";
/// The product of the transposed Jacobian with a covector.
const STATE_PULL_BACK: &str = "vjp";
/// The same of the derivatives by the parameters.
const PARAMS_PULL_BACK: &str = "sensitivity_vjp";
/// The output with the functions of events.
const EVENTS: &str = "events";

/// The field with the values that inputs are held at.
pub(super) const INPUTS: &str = "inputs";

/// The constant with the variables of the implicit form.
pub(super) const IMPLICIT: &str = "IMPLICIT";
/// The constants with the unknowns of discrete equations, and the places of the state among them.
pub(super) const DISCRETE: &str = "DISCRETE";
pub(super) const DISCRETE_STATE: &str = "DISCRETE_STATE";
/// The derivatives of discrete equations.
pub(super) const DISCRETE_JACOBIAN: &str = "discrete_jacobian";
/// The constants with the variables of the map of a quotient.
pub(super) const TOTAL_STATE: &str = "TOTAL_STATE";
pub(super) const TOTAL_PARAMS: &str = "TOTAL_PARAMS";
/// The matrix of the derivatives of the implicit form.
pub(super) const IMPLICIT_JACOBIAN: &str = "implicit_jacobian";

/// The module of a scene.
pub(super) struct Module<'a> {
    pub(super) program: &'a Program,
    pub(super) text: &'a SceneText,
    /// Constants of the module, which no variable can be called.
    pub(super) constants: Vec<String>,
    /// Those that are tables of the program.
    pub(super) tables: Vec<String>,
    /// Identifiers of parameters and components of the state in structures of their own.
    pub(super) params: Vec<String>,
    pub(super) state: Vec<String>,
    /// Which parameters functions read.
    pub(super) read_params: BTreeSet<u32>,
    /// Identifiers of all parameters and of prepared numbers in one structure.
    pub(super) fields: Vec<String>,
    pub(super) slots: Vec<String>,
    /// The formula of each prepared number where it is short.
    pub(super) formulas: Vec<Option<String>>,
    /// What runs once for a set of parameters.
    pub(super) prepare: Prepare,
    pub(super) rate: Routine<'a>,
    /// The right-hand side on circles, where it costs less.
    pub(super) circles: Option<CircleRoutines<'a>>,
    pub(super) energy: Option<Routine<'a>>,
    /// Outputs with the identifiers of their functions.
    pub(super) outputs: Vec<OutputRoutine<'a>>,
    /// Functions of a vector besides time and state.
    pub(super) products: Vec<ProductRoutine<'a>>,
    pub(super) implicit: Option<ImplicitRoutines<'a>>,
    /// The discrete equations.
    pub(super) discrete: Option<DiscreteRoutines<'a>>,
    /// The map from the system that the model is the quotient of.
    pub(super) quotient: Vec<VariablesRoutine<'a>>,
    pub(super) flows: Vec<FlowRoutine<'a>>,
    /// The pivots, unless there is nothing to check.
    pub(super) pivots: Option<Routine<'a>>,
    pub(super) signature: Option<Routine<'a>>,
    pub(super) domain: Option<Routine<'a>>,
}

/// The code that runs once for a set of parameters.
pub(super) struct Prepare {
    /// The variables of the parameters, and which of them are read.
    pub(super) locals: Vec<String>,
    pub(super) reads: BTreeSet<u32>,
    pub(super) statements: Vec<super::body::Statement>,
    /// Both sides of each condition, the greater first.
    pub(super) sides: Vec<[Text; 2]>,
    /// The values of the slots.
    pub(super) values: Vec<Text>,
}

/// A function of the module.
pub(super) struct Routine<'a> {
    pub(super) function: &'a Function,
    pub(super) code: Code,
    /// The variable of each component of the state that is read.
    pub(super) state: Vec<Option<String>>,
    /// The same for components of the function's own vector.
    pub(super) argument: Vec<Option<String>>,
    /// The same for inputs.
    pub(super) inputs: Vec<Option<String>>,
    /// What comes after the straight-line code, where something does.
    pub(super) loops: Option<Loops>,
}

/// The variables of a function's contractions.
pub(super) struct Loops {
    /// The array of the scalars, and their values.
    pub(super) scalars: String,
    pub(super) values: Vec<Text>,
    /// The function's own vector as a whole.
    pub(super) argument: String,
    /// The array of the sums of each contraction.
    pub(super) sums: Vec<String>,
}

impl Loops {
    /// Names the variables; none where there are no contractions.
    pub(super) fn new(function: &Function, scope: &mut Scope) -> Option<Loops> {
        (!function.contractions.is_empty()).then(|| Loops {
            scalars: scope.add("scalars"),
            values: Vec::new(),
            argument: scope.add("argument"),
            sums: (0..function.contractions.len()).map(|k| scope.add(&format!("sums{k}"))).collect(),
        })
    }

    /// A result of a contraction, counted through all of them.
    pub(super) fn element(&self, dialect: &impl Dialect, function: &Function, i: u32) -> String {
        let (k, at) = function.contracted(i);
        dialect.element(&self.sums[k], at)
    }

    /// Takes the values of the scalars, which come after the results of the function.
    pub(super) fn take_values(&mut self, function: &Function, code: &mut Code) {
        self.values = code.results.split_off(function.results.len());
    }
}

/// The function of an output.
pub(super) struct OutputRoutine<'a> {
    pub(super) text: &'a OutputText,
    /// The matrix that it computes the entries of, with the identifier of the function that computes all of it.
    pub(super) matrix: Option<(&'a MatrixText, String)>,
    pub(super) name: String,
    pub(super) routine: Routine<'a>,
}

/// The right-hand side with angles as points of circles.
pub(super) struct CircleRoutines<'a> {
    pub(super) circles: &'a Circles,
    pub(super) rate: Routine<'a>,
    /// Cosine and sine of every angle.
    pub(super) points: Routine<'a>,
}

/// The function of a product.
pub(super) struct ProductRoutine<'a> {
    pub(super) text: &'a ProductText,
    pub(super) name: String,
    pub(super) routine: Routine<'a>,
}

/// The function of an exact flow.
pub(super) struct FlowRoutine<'a> {
    pub(super) text: &'a FlowText,
    pub(super) name: String,
    pub(super) routine: Routine<'a>,
}

/// The functions of discrete equations: first values, rows, and entries of their derivatives.
pub(super) struct DiscreteRoutines<'a> {
    pub(super) text: &'a DiscreteText,
    pub(super) start: VariablesRoutine<'a>,
    pub(super) residual: VariablesRoutine<'a>,
    pub(super) jacobian: VariablesRoutine<'a>,
}

impl<'a> DiscreteRoutines<'a> {
    pub(super) fn all(&self) -> [&VariablesRoutine<'a>; 3] {
        [&self.start, &self.residual, &self.jacobian]
    }
}

/// A function of time and variables.
pub(super) struct VariablesRoutine<'a> {
    pub(super) name: String,
    /// What it gives.
    pub(super) title: &'a str,
    pub(super) routine: Routine<'a>,
}

/// The functions of an implicit form.
pub(super) struct ImplicitRoutines<'a> {
    pub(super) text: &'a ImplicitText,
    /// `f(t, z)`, and the identifier of its function.
    pub(super) right: Routine<'a>,
    pub(super) rhs: String,
    /// The entries of `df/dz`, with the identifiers of the functions that compute them and all of the matrix.
    pub(super) jacobian: Routine<'a>,
    pub(super) entries: String,
    pub(super) all: String,
    /// The identifier of the function of the variables at a state.
    pub(super) values: String,
}

impl OutputRoutine<'_> {
    /// An output whose only component is itself is a scalar.
    pub(super) fn is_scalar(&self) -> bool {
        matches!(self.text.components.as_slice(), [component] if *component == self.text.name)
    }

    /// Places of the entries, of a matrix.
    pub(super) fn pattern(&self) -> &[(usize, usize)] {
        self.matrix.as_ref().map_or(&[], |(matrix, _)| &matrix.pattern)
    }
}

impl<'a> Module<'a> {
    /// Names everything and writes down the code of every function.
    ///
    /// # Errors
    /// As [`super::emit_scene`].
    pub(super) fn new(
        dialect: &impl Dialect,
        program: &'a Program,
        circles: Option<&'a Circles>,
        text: &'a SceneText,
    ) -> Result<Module<'a>, Error> {
        expect_size("list of documented parameters", text.params.len(), program.params.len())?;
        expect_size("list of documented inputs", text.inputs.len(), program.inputs.len())?;
        expect_size("list of documented state components", text.state.len(), program.state.len())?;
        let mut constants: Vec<String> = text.matrices.iter().map(|m| dialect.places(&m.name)).collect();
        let tables: Vec<String> = (0..program.tables.len()).map(|k| dialect.table(k)).collect();
        constants.extend(tables.iter().cloned());
        if text.implicit.is_some() {
            constants.extend([IMPLICIT.to_owned(), dialect.places(IMPLICIT_JACOBIAN)]);
        }
        if text.discrete.is_some() {
            constants.extend(
                [DISCRETE, DISCRETE_STATE]
                    .map(str::to_owned)
                    .into_iter()
                    .chain([dialect.places(DISCRETE_JACOBIAN)]),
            );
        }
        if text.quotient.is_some() {
            constants.extend([TOTAL_STATE.to_owned(), TOTAL_PARAMS.to_owned()]);
        }
        let names = Names::new(dialect, program);
        let optional = |role: &Role| {
            let function = program.function(role)?;
            Some(Routine::new(dialect, program, (&names, &constants), function))
        };
        let required = |role: &Role| optional(role).ok_or_else(|| missing(program, role));
        let rate = required(&Role::Rate)?;
        expect_size("function rhs", rate.function.results.len(), program.state.len())?;
        let circles = circles.map(|circles| {
            let [rate, points] = [Circles::RATE, Circles::POINTS].map(|k| {
                let function = &circles.program.functions[k];
                Routine::new(dialect, &circles.program, (&names, &constants), function)
            });
            CircleRoutines { circles, rate, points }
        });
        let energy = optional(&Role::Energy);
        if let Some(energy) = &energy {
            expect_size("function energy", energy.function.results.len(), 1)?;
        }

        // What generated interfaces call keeps its name; outputs of the model give way.
        let mut functions = Scope::with(dialect, dialect.functions().iter().copied());
        let mut products = Vec::with_capacity(text.products.len());
        for product in &text.products {
            let routine = required(&Role::Product(product.name.clone()))?;
            let what = format!("product {}", product.name);
            expect_size(&what, product.components.len(), routine.function.results.len())?;
            products.push(ProductRoutine { text: product, name: functions.add(&product.name), routine });
        }
        let mut implicit = None;
        if let Some(text) = &text.implicit {
            let [right, jacobian] =
                [&text.right_side, &text.jacobian].map(|name| required(&Role::OfVariables(name.clone())));
            let (right, jacobian) = (right?, jacobian?);
            expect_size("implicit form", right.function.results.len(), text.variables.len())?;
            expect_size("pattern of the implicit form", text.pattern.len(), jacobian.function.results.len())?;
            let (rhs, all) = (functions.add(&text.right_side), functions.add(&text.jacobian));
            let (entries, values) = (functions.add(&format!("{}_nonzeros", text.jacobian)), String::new());
            implicit = Some(ImplicitRoutines { text, right, rhs, jacobian, entries, all, values });
        }
        let discrete = match &text.discrete {
            None => None,
            Some(text) => {
                let n = text.unknowns.len();
                expect_size("places of the state among unknowns", text.state.len(), program.state.len())?;
                let mut routine = |(name, title): &'a (String, String), size: usize| {
                    let routine = required(&Role::OfVariables(name.clone()))?;
                    expect_size(name, routine.function.results.len(), size)?;
                    expect_size(
                        &format!("variables of {name}"),
                        routine.argument.len(),
                        1 + program.state.len() + n,
                    )?;
                    Ok::<_, Error>(VariablesRoutine { name: functions.add(name), title, routine })
                };
                Some(DiscreteRoutines {
                    text,
                    start: routine(&text.start, n)?,
                    residual: routine(&text.residual, n)?,
                    jacobian: routine(&text.jacobian, text.pattern.len())?,
                })
            }
        };
        let mut quotient = Vec::new();
        if let Some(text) = &text.quotient {
            for (name, title) in std::iter::once(&text.of_state).chain(&text.of_params) {
                let routine = required(&Role::OfVariables(name.clone()))?;
                let n = text.state.len() + text.params.len();
                expect_size(&format!("variables of {name}"), routine.argument.len(), n)?;
                quotient.push(VariablesRoutine { name: functions.add(name), title, routine });
            }
        }
        let mut flows = Vec::with_capacity(text.flows.len());
        for flow in &text.flows {
            let routine = required(&Role::Flow(flow.name.clone()))?;
            let what = format!("flow {}", flow.name);
            expect_size(&what, routine.function.results.len(), program.state.len())?;
            flows.push(FlowRoutine { text: flow, name: functions.add(&flow.name), routine });
        }
        let mut matrices = BTreeMap::new();
        for matrix in &text.matrices {
            let output = text.outputs.iter().find(|o| o.name == matrix.name);
            let output = output.ok_or_else(|| Error::UnknownName {
                name: matrix.name.clone(),
                kind: "output with the entries of a matrix",
                known: text.outputs.iter().map(|o| o.name.clone()).collect(),
            })?;
            let what = format!("pattern of {}", matrix.name);
            expect_size(&what, matrix.pattern.len(), output.components.len())?;
            let names = (functions.add(&matrix.name), functions.add(&format!("{}_nonzeros", matrix.name)));
            matrices.insert(&matrix.name, (matrix, names));
        }
        let mut outputs = Vec::with_capacity(text.outputs.len());
        for output in &text.outputs {
            let routine = required(&Role::Output(output.name.clone()))?;
            let n_results = routine.function.results.len();
            expect_size(&format!("output {}", output.name), output.components.len(), n_results)?;
            let (matrix, name) = match matrices.remove(&output.name) {
                Some((matrix, (all, entries))) => (Some((matrix, all)), entries),
                None => (None, functions.add(&output.name)),
            };
            if let Some(implicit) = implicit.as_mut().filter(|implicit| implicit.text.values == output.name) {
                implicit.values.clone_from(&name);
            }
            outputs.push(OutputRoutine { text: output, matrix, name, routine });
        }

        let mut read_params = BTreeSet::new();
        for function in &program.functions {
            let operands = function.instructions.iter().flat_map(|i| i.op.operands());
            for operand in operands.chain(function.outputs()) {
                if let Operand::Param(i) = operand {
                    read_params.insert(i);
                }
            }
        }
        let idents = |names: &[String]| {
            let mut scope = Scope::with(dialect, constants.iter().map(String::as_str));
            scope.add_all(names.iter().map(String::as_str))
        };
        Ok(Module {
            program,
            text,
            params: idents(&program.params),
            state: idents(&program.state),
            read_params,
            formulas: formulas(program),
            prepare: Prepare::new(dialect, program, &constants)?,
            rate,
            circles,
            energy,
            outputs,
            products,
            implicit,
            discrete,
            quotient,
            flows,
            pivots: optional(&Role::Pivots).filter(|pivots| !pivots.function.results.is_empty()),
            signature: optional(&Role::Signature),
            domain: optional(&Role::Domain),
            fields: names.fields,
            slots: names.slots,
            constants,
            tables,
        })
    }

    /// The function that computes the derivatives of the right-hand side by the state.
    pub(super) fn jacobian(&self) -> Option<&str> {
        self.matrix_function(JACOBIAN)
    }

    /// The functions of the products of the transposed derivatives by state and parameters with a covector; none unless
    /// the scene has both.
    pub(super) fn pull_backs(&self) -> Option<[&str; 2]> {
        let function = |name: &str| {
            self.products
                .iter()
                .find(|product| product.text.name == name)
                .map(|product| product.name.as_str())
        };
        Some([function(STATE_PULL_BACK)?, function(PARAMS_PULL_BACK)?])
    }

    /// Number of the invariants, and the functions of their values and gradients.
    pub(super) fn invariants(&self) -> Option<(usize, &str, &str)> {
        let gradients = self.matrix_function(GRADIENTS)?;
        let values = self.outputs.iter().find(|o| o.text.name == INVARIANTS)?;
        Some((values.text.components.len(), &values.name, gradients))
    }

    /// The equations between coordinates: number of functions, the functions of their values and gradients.
    pub(super) fn positions(&self) -> Option<(&PositionsText, usize, &str, &str)> {
        let text = self.text.positions.as_ref()?;
        let gradients = self.matrix_function(&text.gradients)?;
        let values = self.outputs.iter().find(|o| o.text.name == text.values)?;
        Some((text, values.text.components.len(), &values.name, gradients))
    }

    /// The rows that a motion keeps independent, and the entries of their matrix.
    pub(super) fn ranks(&self) -> Option<(&RanksText, &OutputRoutine<'_>)> {
        let text = self.text.ranks.as_ref()?;
        Some((text, self.outputs.iter().find(|o| o.text.name == text.matrix && o.matrix.is_some())?))
    }

    /// The function that computes the functions of events; none where the scene has no events.
    pub(super) fn event_functions(&self) -> Option<&str> {
        self.output(EVENTS).filter(|_| !self.text.events.is_empty())
    }

    /// The function that computes an output.
    pub(super) fn output(&self, name: &str) -> Option<&str> {
        self.outputs.iter().find(|o| o.text.name == name).map(|o| o.name.as_str())
    }

    /// The function that computes a matrix.
    pub(super) fn matrix_function(&self, name: &str) -> Option<&str> {
        let mut matrices = self.outputs.iter().filter_map(|o| o.matrix.as_ref());
        matrices.find(|(matrix, _)| matrix.name == name).map(|(_, function)| function.as_str())
    }

    /// The model and the scene in a sentence.
    pub(super) fn title(&self) -> String {
        if self.text.scene == "default" {
            format!("`{}`", self.text.model)
        } else {
            format!("`{}`, scene `{}`", self.text.model, self.text.scene)
        }
    }
}

/// Names that functions have for numbers which do not change along a motion.
#[derive(Clone, Debug)]
pub(super) struct Names {
    pub(super) fields: Vec<String>,
    pub(super) slots: Vec<String>,
}

impl Names {
    fn new(dialect: &impl Dialect, program: &Program) -> Names {
        // What holds the inputs is a field, too.
        let of_inputs = (!program.inputs.is_empty()).then_some(INPUTS);
        let mut scope = Scope::with(dialect, of_inputs);
        let fields = scope.add_all(program.params.iter().map(String::as_str));
        let mut name = |slot: &crate::program::Slot| match &slot.name {
            Some(name) => scope.add(name),
            None => scope.temporary("c"),
        };
        Names { fields, slots: program.prepare.slots.iter().map(&mut name).collect() }
    }
}

impl<'a> Routine<'a> {
    fn new(
        dialect: &impl Dialect,
        program: &Program,
        (names, constants): (&Names, &[String]),
        function: &'a Function,
    ) -> Routine<'a> {
        let mut scope = variables(dialect, constants);
        // Variables in the place of the state have the names of its components.
        let in_scope = match function.role {
            Role::OfVariables(_) => &[],
            _ => program.state.as_slice(),
        };
        let state = scope.add_all(in_scope.iter().map(String::as_str));
        let argument = scope.add_all(function.argument.iter().map(String::as_str));
        let inputs = scope.add_all(program.inputs.iter().map(|(name, _)| name.as_str()));
        let mut loops = Loops::new(function, &mut scope);
        let results: Vec<Operand> = function.outputs().collect();
        let instructions = &function.instructions;
        let segments = Segment::sections(program, instructions);
        let name = |operand: Operand| match (operand, &loops) {
            (Operand::Contracted(i), Some(loops)) => loops.element(dialect, function, i),
            _ => spell(dialect, (&names.fields, &names.slots), (&state, &argument, &inputs), operand),
        };
        let rates = function.results.iter().filter(|_| function.role == Role::Rate);
        let rates: Vec<String> = rates.map(|(name, _)| format!("dot_{name}")).collect();
        let results = (results.as_slice(), rates.as_slice());
        let mut code = Code::new(dialect, program, instructions, &segments, results, &mut scope, name);
        if let Some(loops) = &mut loops {
            loops.take_values(function, &mut code);
        }
        let read = |names: Vec<String>, operand: fn(u32) -> Operand| -> Vec<Option<String>> {
            let names = names.into_iter().zip(0u32..);
            names.map(|(name, i)| code.reads.contains(&operand(i)).then_some(name)).collect()
        };
        let (state, argument) = (read(state, Operand::State), read(argument, Operand::Argument));
        let inputs = read(inputs, Operand::Input);
        Routine { function, code, state, argument, inputs, loops }
    }

    /// Whether a contraction takes factors from there.
    fn contracts(&self, factors: Factors) -> bool {
        let mut terms = self.function.contractions.iter().flat_map(|c| &c.terms);
        terms.any(|p| p.left == factors || p.right == factors)
    }

    /// Whether the state is read as a whole.
    pub(super) fn contracts_state(&self) -> bool {
        self.contracts(Factors::State)
    }

    /// Whether the function's own vector is read as a whole.
    pub(super) fn contracts_argument(&self) -> bool {
        self.contracts(Factors::Argument)
    }

    /// Whether the code reads an input.
    pub(super) fn reads_inputs(&self) -> bool {
        self.inputs.iter().any(Option::is_some)
    }

    /// Whether the code reads the time.
    pub(super) fn reads_time(&self) -> bool {
        self.code.reads.contains(&Operand::Time)
    }
}

/// The scope of the variables of a function.
pub(super) fn variables(dialect: &impl Dialect, constants: &[String]) -> Scope {
    let taken = dialect.arguments().iter().copied();
    Scope::with(dialect, taken.chain(constants.iter().map(String::as_str)))
}

/// The name of an input of a function.
pub(super) fn spell(
    dialect: &impl Dialect,
    (fields, slots): (&[String], &[String]),
    (state, argument, inputs): (&[String], &[String], &[String]),
    operand: Operand,
) -> String {
    match operand {
        Operand::Param(i) => dialect.field(&fields[i as usize]),
        Operand::Slot(i) => dialect.field(&slots[i as usize]),
        Operand::State(i) => state[i as usize].clone(),
        Operand::Argument(i) => argument[i as usize].clone(),
        Operand::Input(i) => inputs[i as usize].clone(),
        Operand::Time => "t".to_owned(),
        // Values and constants are spelled by the body, sums by the function that has them.
        Operand::Value(_) | Operand::Constant(_) | Operand::Contracted(_) => String::new(),
    }
}

impl Prepare {
    fn new(dialect: &impl Dialect, program: &Program, constants: &[String]) -> Result<Prepare, Error> {
        let prepare = &program.prepare;
        let mut scope = variables(dialect, constants);
        let locals = scope.add_all(program.params.iter().map(String::as_str));
        let sides = prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
        let results: Vec<Operand> =
            sides.chain(prepare.slots.iter().map(|slot| Operand::Value(slot.value))).collect();
        let segments = Segment::all(&prepare.instructions);
        let spell = |operand: Operand| match operand {
            Operand::Param(i) => locals[i as usize].clone(),
            _ => String::new(),
        };
        let results = (results.as_slice(), [].as_slice());
        let code = Code::new(dialect, program, &prepare.instructions, &segments, results, &mut scope, spell);
        if let Some(operand) = code.reads.iter().find(|o| !matches!(o, Operand::Param(_))) {
            return Err(Error::Program { reason: format!("{operand:?} in the prepare part") });
        }
        let Code { statements, results, reads, .. } = code;
        let (sides, values) = results.split_at(2 * prepare.conditions.len());
        let sides = sides.chunks_exact(2).map(|pair| [pair[0].clone(), pair[1].clone()]).collect();
        let param = |operand: Operand| if let Operand::Param(i) = operand { Some(i) } else { None };
        let reads = reads.into_iter().filter_map(param).collect();
        Ok(Prepare { locals, reads, statements, sides, values: values.to_vec() })
    }
}

/// The formula of each slot where it is short.
fn formulas(program: &Program) -> Vec<Option<String>> {
    let mut formulas: Vec<Option<Text>> = Vec::with_capacity(program.prepare.instructions.len());
    for instruction in &program.prepare.instructions {
        let is_too_long = |o: Operand| matches!(o, Operand::Value(v) if formulas[v as usize].is_none());
        if instruction.op.operands().any(is_too_long) {
            formulas.push(None);
            continue;
        }
        let text = operation(&instruction.op, &Formula, |operand| match operand {
            Operand::Value(v) => formulas[v as usize].clone().unwrap_or_else(|| Text::atom("")),
            Operand::Constant(i) => constant(&Formula, &program.constants[i as usize]),
            Operand::Param(i) => Text::atom(&program.params[i as usize]),
            _ => Text::atom(""),
        });
        formulas.push((text.text.len() <= MAX_DOC_FORMULA).then_some(text));
    }
    let of_slot =
        |slot: &crate::program::Slot| formulas[slot.value as usize].as_ref().map(|f| f.text.clone());
    program.prepare.slots.iter().map(of_slot).collect()
}

/// The function in a role is missing.
fn missing(program: &Program, role: &Role) -> Error {
    Error::UnknownName {
        name: role.name().to_owned(),
        kind: "function of the program",
        known: program.functions.iter().map(|f| f.role.name().to_owned()).collect(),
    }
}

fn expect_size(what: &str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected {
        Ok(())
    } else {
        Err(Error::ShapeMismatch { what: what.to_owned(), found, expected })
    }
}
