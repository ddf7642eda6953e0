//! What an FMU of a scene consists of besides its C: the description of the model, and the source of the functions of
//! FMI 3.0.
//!
//! Deliberately does not know: how the source is compiled, how the archive is made.
//!
//! Source: Functional Mock-up Interface Specification 3.0, Modelica Association, 2022.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use super::dependence::{self, Inputs};
use super::single::Precision;
use super::writer::Writer;
use super::{kernel, trace};
use crate::emit::module::OutputRoutine;
use crate::emit::text::{EventText, UnitText};
use crate::program::{Operand, Role};
use hamel_expr::error::Error;
use hamel_expr::rational_to_f64;

/// What an FMU of a scene consists of besides its C.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fmu {
    /// The text of `modelDescription.xml`.
    pub description: String,
    /// The text of `sources/buildDescription.xml`.
    pub build_description: String,
    /// The text of `sources/<prefix>_fmu.c`.
    pub source: String,
}

/// A variable of the description.
struct Variable {
    name: String,
    /// Attributes besides name and reference.
    attributes: String,
}

/// The functions of FMI 3.0 over those that the text before them defines.
const FUNCTIONS: &str = include_str!("fmi3.c");

/// Steps of co-simulation and their events, which stand in the place of [`EVENTS_HERE`] of these.
const EVENTS: &str = include_str!("fmi3_events.c");
const EVENTS_HERE: &str = "/* EVENTS */\n";

/// What a motion keeps, in the place of [`KEPT_HERE`].
const KEPT: &str = include_str!("fmi3_kept.c");
const KEPT_HERE: &str = "/* KEPT */\n\n";

/// Whether a step leads over a place where a motion may go on in more than one way, in the place of [`RANKS_HERE`].
const RANKS: &str = include_str!("fmi3_ranks.c");
const RANKS_HERE: &str = "/* RANKS */\n\n";

/// The output with the residuals of constraints.
const CONSTRAINT: &str = "constraint";

/// What stands before and after lines that scenes with inputs alone have.
const WITH_INPUTS: [&str; 2] = ["#ifdef FMU_INPUTS\n", "#endif /* FMU_INPUTS */\n"];

/// What stands before and after lines that scenes alone have whose constraints may lose their rank.
const WITH_ROWS: [&str; 2] = ["#ifdef FMU_ROWS\n", "#endif /* FMU_ROWS */\n"];

impl Writer<'_> {
    /// The FMU.
    ///
    /// # Errors
    /// [`Error::NoInitialState`].
    pub(super) fn fmu(&self) -> Result<Fmu, Error> {
        if self.module.text.initial.is_none() {
            return Err(Error::NoInitialState { model: self.module.text.model.clone() });
        }
        let body = self.fmu_functions()?;
        let description = self.description("TOKEN");
        let token = fingerprint(&[&description, &body, &self.header, &self.source]);
        let first = self.first_line();
        let functions = functions(!self.inputs().is_empty(), self.module.text.ranks.is_some());
        let source = format!(
            "{first}#include \"{prefix}.h\"\n\n#include <math.h>\n#include <stdbool.h>\n#include <stdint.h>\n\
             #include <stdlib.h>\n#include <string.h>\n\n\
             #if defined(__GNUC__)\n#pragma GCC diagnostic ignored \"-Wunused-variable\"\n#endif\n\n\
             #define FMU_TOKEN \"{token}\"\n{body}\n{functions}",
            prefix = self.prefix
        );
        let build_description = format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiBuildDescription fmiVersion=\"3.0\">\n  \
                 <BuildConfiguration modelIdentifier=\"{prefix}\">\n    \
                     <SourceFileSet language=\"C99\" compilerOptions=\"-ffp-contract=off\">\n      \
                         <SourceFile name=\"{prefix}.c\"/>\n      <SourceFile name=\"{prefix}_fmu.c\"/>\n    \
                     </SourceFileSet>\n    <Library name=\"m\" external=\"true\"/>\n  \
                 </BuildConfiguration>\n</fmiBuildDescription>\n",
            prefix = self.prefix
        );
        Ok(Fmu {
            description: description.replace("\"TOKEN\"", &format!("\"{token}\"")),
            build_description,
            source,
        })
    }

    /// Outputs that are variables: neither matrices nor parts of events.
    fn shown_outputs(&self) -> impl Iterator<Item = &OutputRoutine<'_>> {
        let events = &self.module.text.events;
        let of_events: BTreeSet<&str> =
            events.iter().filter_map(|e| e.sets.as_ref()).map(|(output, _)| output.as_str()).collect();
        let functions = self.module.event_functions();
        // The residuals of constraints have the equations between coordinates.
        let has_constraint = self.module.outputs.iter().any(|o| o.text.name == CONSTRAINT);
        let positions = self.module.positions().filter(|_| has_constraint);
        self.module.outputs.iter().filter(move |o| {
            o.matrix.is_none()
                && Some(o.name.as_str()) != functions
                && positions.is_none_or(|(text, ..)| text.values != o.text.name)
                && !of_events.contains(o.text.name.as_str())
        })
    }

    /// Where the residuals stand that a state of the motion keeps at zero, among the values of outputs that are shown,
    /// and their names: of constraints where the scene has these, of equations between coordinates otherwise.
    fn kept(&self) -> (usize, &[String]) {
        let positions = self.module.positions();
        let equations =
            |o: &OutputRoutine<'_>| positions.is_some_and(|(text, ..)| text.values == o.text.name);
        let is_constraint = |o: &OutputRoutine<'_>| o.text.name == CONSTRAINT;
        let has_constraint = self.module.outputs.iter().any(is_constraint);
        let mut at = usize::from(self.module.energy.is_some());
        for output in self.shown_outputs() {
            let components = &output.text.components;
            if is_constraint(output) {
                return (at, components);
            }
            if let Some((text, ..)) = positions.filter(|_| !has_constraint && equations(output)) {
                return (at, &components[..text.n_equations]);
            }
            at += components.len();
        }
        (0, &[])
    }

    /// The output with the functions of events.
    fn indicators(&self) -> Option<&OutputRoutine<'_>> {
        let name = self.module.event_functions()?;
        self.module.outputs.iter().find(|o| o.name == name)
    }

    /// Numbers, and what the functions of FMI call.
    fn fmu_functions(&self) -> Result<String, Error> {
        let (module, prefix) = (self.module, &self.prefix);
        let (n, n_events) = (module.state.len(), module.text.events.len());
        let arguments = "const fmu_prepared *p, double t, const double *y";
        let (mut outputs, mut roles, mut at) = (String::new(), Vec::new(), 0);
        if module.energy.is_some() {
            let _ = writeln!(outputs, "    out[0] = {prefix}_energy(p, t, y);");
            roles.push((Role::Energy, 1));
            at = 1;
        }
        let call = |output: &OutputRoutine<'_>, at: usize| match output.is_scalar() {
            true => format!("    out[{at}] = {prefix}_{}(p, t, y);\n", output.name),
            false => format!("    {prefix}_{}(p, t, y, out + {at});\n", output.name),
        };
        let role = |output: &OutputRoutine<'_>| {
            (Role::Output(output.text.name.clone()), output.text.components.len())
        };
        for output in self.shown_outputs() {
            outputs.push_str(&call(output, at));
            roles.push(role(output));
            at += output.text.components.len();
        }
        let indicators = self.indicators();
        let events = indicators.map_or_else(String::new, |output| call(output, 0));
        let (direction, apply) = match indicators {
            Some(_) => (
                format!("    return {prefix}_event_directions[event];\n"),
                format!("    return {prefix}_event_apply(p, event, t, y);\n"),
            ),
            None => {
                let ignored = "    (void)p, (void)event, (void)t, (void)y;\n    return 0;\n";
                ("    (void)event;\n    return 0;\n".to_owned(), ignored.to_owned())
            }
        };
        // To the functions of FMI, inputs are parameters that may be set at any time.
        let m = self.inputs().len();
        let (prepare, n_own, input_defaults, hold) = match (m, module.params.len()) {
            (0, _) => (
                format!("    return {prefix}_prepare(&params, p);\n"),
                "FMU_PARAMS".to_owned(),
                String::new(),
                String::new(),
            ),
            (m, n) => (
                format!(
                    "    const int code = {prefix}_prepare(&params, p);\n    \
                         {prefix}_hold_inputs(p, values + {n});\n    return code;\n"
                ),
                n.to_string(),
                format!("    memcpy(values + {n}, {prefix}_input_defaults, {m} * sizeof(double));\n"),
                format!(
                    "enum {{ FMU_INPUTS = {m} }};\n\n\
                     static void fmu_hold(const double *inputs, fmu_prepared *p) {{\n    \
                         {prefix}_hold_inputs(p, inputs);\n}}\n\n"
                ),
            ),
        };
        let unread = |body: &str| {
            if body.is_empty() {
                "    (void)p, (void)t, (void)y, (void)out;\n".to_owned()
            } else {
                body.to_owned()
            }
        };
        let wanted = [
            ("rates", vec![(Role::Rate, n)]),
            ("outputs", roles),
            ("events", indicators.map(role).into_iter().collect()),
        ];
        let called = |name: &str| format!("    {prefix}_{name}(p, t, y, out);\n");
        let (n_equations, n_functions, equations, gradients) = match module.positions() {
            Some((text, n, values, gradients)) => {
                let output = module.outputs.iter().find(|output| output.name == values);
                (text.n_equations, n, output.map_or_else(String::new, |o| call(o, 0)), called(gradients))
            }
            None => (0, 0, String::new(), String::new()),
        };
        let signature = match module.signature {
            Some(_) => format!("    return {prefix}_signature(p, t, y);\n"),
            None => "    (void)p, (void)t, (void)y;\n    return 0.0;\n".to_owned(),
        };
        let of_events = |text: &dyn Fn(&EventText) -> String| -> String {
            let each: Vec<String> = module.text.events.iter().map(text).collect();
            if each.is_empty() { "0".to_owned() } else { each.join(", ") }
        };
        let conditions = of_events(&|event| event.is_condition.to_string());
        let held = of_events(&|event| {
            format!("\"condition {} holds already, and happens where it begins to hold\"", event.name)
        });
        let (first_kept, kept) = self.kept();
        let n_kept = kept.len();
        let told = kept.iter().map(|name| {
            format!(
                "        \"{name} is not zero: start values and parameters have to satisfy the equations of the model\",\n"
            )
        });
        let told: String = told.chain((n_kept == 0).then(|| "        \"\",\n".to_owned())).collect();
        let tangents = trace::tangents(module.program, &wanted)?;
        let needed = kernel::functions(&tangents, Precision::Double);
        Ok(format!(
            "enum {{ FMU_STATE = {n}, FMU_PARAMS = {n_params}, FMU_OUTPUTS = {at}, FMU_EVENTS = {n_events} }};\n\
             enum {{ FMU_FIRST_KEPT = {first_kept}, FMU_KEPT = {n_kept}, \
                 FMU_EQUATIONS = {n_equations}, FMU_FUNCTIONS = {n_functions} }};\n\n\
             typedef {prefix}_prepared fmu_prepared;\n\n{needed}\n\
             static int fmu_prepare(const double *values, fmu_prepared *p) {{\n    {prefix}_params params;\n    \
                 {prefix}_params_from_array(values, &params);\n{prepare}}}\n\n{hold}\
             static const char *fmu_message(int code) {{\n    return {prefix}_message(code);\n}}\n\n\
             static const char *fmu_kept_message(int k) {{\n    static const char *const messages[] = {{\n{told}    }};\n    \
                 return messages[k];\n}}\n\n\
             static void fmu_initial(double *y) {{\n    {prefix}_initial(y);\n}}\n\n\
             static void fmu_params(double *values) {{\n    \
                 memcpy(values, {prefix}_param_defaults, {n_own} * sizeof(double));\n{input_defaults}}}\n\n\
             static int fmu_domain({arguments}) {{\n    return {prefix}_domain(p, t, y);\n}}\n\n\
             static int fmu_check({arguments}) {{\n    return {prefix}_check(p, t, y);\n}}\n\n\
             static void fmu_rates({arguments}, double *dy) {{\n    {prefix}_rhs(p, t, y, dy);\n}}\n\n\
             static void fmu_outputs({arguments}, double *out) {{\n{outputs}}}\n\n\
             static void fmu_events({arguments}, double *out) {{\n{events}}}\n\n{rows}\
             static double fmu_signature({arguments}) {{\n{signature}}}\n\n\
             static void fmu_equations({arguments}, double *out) {{\n{equations}}}\n\n\
             static void fmu_gradients({arguments}, double *out) {{\n{gradients}}}\n\n\
             static int fmu_direction(int event) {{\n{direction}}}\n\n\
             static bool fmu_is_condition(int event) {{\n    static const bool is_condition[] = {{{conditions}}};\n    \
                 return is_condition[event];\n}}\n\n\
             static const char *fmu_holds_message(int event) {{\n    static const char *const messages[] = {{{held}}};\n    \
                 return messages[event];\n}}\n\n\
             static int fmu_apply(const fmu_prepared *p, int event, double t, double *y) {{\n{apply}}}\n\n\
             /* Derivatives of rates, outputs and functions of events along a direction of all that they depend on. */\n\
             static void fmu_tangent(const double *params, const double *dparams, double t, double dt, const double *y,\n                        \
                 const double *dy, double *rates, double *outputs, double *events) {{\n    \
                 (void)params, (void)dparams, (void)t, (void)dt, (void)y, (void)dy;\n    \
                 (void)rates, (void)outputs, (void)events;\n{tangents}}}\n",
            n_params = module.params.len() + m,
            outputs = unread(&outputs),
            events = unread(&events),
            equations = unread(&equations),
            gradients = unread(&gradients),
            rows = self.rows(&call),
        ))
    }

    /// The rows that may become dependent, one after the other; empty where there are none.
    fn rows(&self, call: &impl Fn(&OutputRoutine<'_>, usize) -> String) -> String {
        let Some((text, output)) = self.module.ranks() else { return String::new() };
        let pattern = output.pattern();
        let mut entries = String::new();
        for (k, (i, j)) in pattern.iter().enumerate() {
            if let Some(row) = text.rows.iter().position(|own| own == i) {
                let _ = writeln!(entries, "    rows[{row}][{j}] = out[{k}];");
            }
        }
        let moving: Vec<String> = text.moving.iter().map(usize::to_string).collect();
        format!(
            "enum {{ FMU_ROWS = {n_rows}, FMU_MOVING = {n_moving} }};\n\n\
             /* Components of the state that the rows depend on. */\n\
             static const int fmu_moving[FMU_MOVING] = {{{moving}}};\n\n\
             /* Gradients of constraints that a motion keeps independent. */\n\
             static void fmu_rows(const fmu_prepared *p, double t, const double *y, double (*rows)[FMU_STATE]) {{\n    \
                 double out[{n}];\n    \
                 memset(rows, 0, FMU_ROWS * sizeof *rows);\n{values}{entries}}}\n\n",
            n_rows = text.rows.len(),
            n_moving = moving.len(),
            moving = moving.join(", "),
            n = pattern.len(),
            values = call(output, 0),
        )
    }

    /// The description of the model.
    fn description(&self, token: &str) -> String {
        let (module, prefix) = (self.module, &self.prefix);
        let (program, text) = (module.program, module.text);
        let n = module.state.len();
        let mut variables: Vec<Variable> = Vec::new();
        let mut names: BTreeSet<String> = BTreeSet::new();
        let units = &text.units;
        let mut defined: BTreeMap<String, UnitText> = BTreeMap::new();
        let mut add = |name: &str, mut attributes: String, unit: Option<&UnitText>| {
            let mut own = name.to_owned();
            while !names.insert(own.clone()) {
                own.push('_');
            }
            if let Some(unit) = unit {
                defined.insert(unit.name.clone(), unit.clone());
                let _ = write!(attributes, " unit=\"{}\"", escaped(&unit.name));
            }
            variables.push(Variable { name: own, attributes });
        };
        let time = "causality=\"independent\" variability=\"continuous\"".to_owned();
        add("time", time, units.time.as_ref());
        let initial = text.initial.iter().flat_map(|initial| &initial.values);
        for (state, start) in text.state.iter().zip(initial) {
            add(
                &state.name,
                format!(
                    "causality=\"output\" variability=\"continuous\" initial=\"exact\" start=\"{start:?}\"{}",
                    description(&state.doc)
                ),
                units.of_name.get(&state.name),
            );
        }
        let calculated = |causality: &str, rest: String| {
            format!("causality=\"{causality}\" variability=\"continuous\" initial=\"calculated\"{rest}")
        };
        for (k, state) in text.state.iter().enumerate() {
            let rate = calculated("local", format!(" derivative=\"{}\"", k + 1));
            add(&format!("der({})", state.name), rate, units.of_rate.get(&state.name));
        }
        for param in &text.params {
            let start = rational_to_f64(&param.default);
            add(
                &param.name,
                format!(
                    "causality=\"parameter\" variability=\"tunable\" initial=\"exact\" start=\"{start:?}\"{}",
                    description(&param.doc)
                ),
                units.of_name.get(&param.name),
            );
        }
        for input in &text.inputs {
            let start = rational_to_f64(&input.default);
            let doc = description(&input.doc);
            add(
                &input.name,
                format!("causality=\"input\" variability=\"continuous\" start=\"{start:?}\"{doc}"),
                units.of_name.get(&input.name),
            );
        }
        // Reference and inputs of what is computed.
        let first_param = 1 + 2 * n;
        let first_input = first_param + text.params.len();
        let mut reference = first_input + text.inputs.len();
        let mut inputs: BTreeMap<usize, Inputs> = BTreeMap::new();
        for (k, of) in dependence::of_results(program, module.rate.function).into_iter().enumerate() {
            inputs.insert(1 + n + k, of);
        }
        let first_output = reference;
        if let Some(energy) = &module.energy {
            add("energy", calculated("output", description("Energy")), units.energy.as_ref());
            inputs.extend(
                dependence::of_results(program, energy.function).into_iter().map(|of| (reference, of)),
            );
            reference += 1;
        }
        for output in self.shown_outputs() {
            let function = output.routine.function;
            let of_results = dependence::of_results(program, function);
            for (k, (component, of)) in output.text.components.iter().zip(of_results).enumerate() {
                let name = match output.is_scalar() {
                    true => output.text.name.clone(),
                    false => format!("{}.{component}", output.text.name),
                };
                let unit = units.of_output.get(&(output.text.name.clone(), k));
                add(&name, calculated("output", description(&output.text.doc)), unit);
                inputs.insert(reference, of);
                reference += 1;
            }
        }
        let first_event = reference;
        for event in &text.events {
            add(&format!("event({})", event.name), calculated("local", String::new()), None);
            reference += 1;
        }

        let number = |operand: &Operand| match operand {
            Operand::State(k) => Some(1 + *k as usize),
            Operand::Param(k) => Some(first_param + *k as usize),
            Operand::Input(k) => Some(first_input + *k as usize),
            Operand::Time => Some(0),
            _ => None,
        };
        let is_param = |operand: &Operand| matches!(operand, Operand::Param(_));
        let structure = |element: &str, at: usize, with_params: bool| {
            let list = inputs.get(&at).into_iter().flatten().filter(|o| with_params || !is_param(o));
            let mut numbers: Vec<usize> = list.filter_map(number).collect();
            numbers.sort_unstable();
            let list: Vec<String> = numbers.iter().map(usize::to_string).collect();
            let kinds = vec!["dependent"; list.len()].join(" ");
            format!(
                "    <{element} valueReference=\"{at}\" dependencies=\"{}\" dependenciesKind=\"{kinds}\"/>\n",
                list.join(" ")
            )
        };
        let states = 1..=n;
        let rates = 1 + n..1 + 2 * n;
        let outputs = first_output..first_event;
        let own = |at: usize| {
            format!(
                "    <Output valueReference=\"{at}\" dependencies=\"{at}\" dependenciesKind=\"constant\"/>\n"
            )
        };
        let mut model_structure: String = states.map(own).collect();
        model_structure.extend(outputs.clone().map(|at| structure("Output", at, false)));
        model_structure.extend(rates.clone().map(|at| structure("ContinuousStateDerivative", at, false)));
        model_structure.extend(outputs.chain(rates).map(|at| structure("InitialUnknown", at, true)));
        model_structure.extend(
            (first_event..reference).map(|at| format!("    <EventIndicator valueReference=\"{at}\"/>\n")),
        );
        let variables: String = variables
            .iter()
            .enumerate()
            .map(|(at, Variable { name, attributes })| {
                format!("    <Float64 name=\"{}\" valueReference=\"{at}\" {attributes}/>\n", escaped(name))
            })
            .collect();
        let interface = format!(
            "modelIdentifier=\"{prefix}\" canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\" \
             providesDirectionalDerivatives=\"true\" providesAdjointDerivatives=\"true\""
        );
        // Signs of functions of events and of pivots, and the rank of equations, are followed from step to step.
        let is_followed =
            module.signature.is_some() || module.positions().is_some() || module.text.ranks.is_some();
        let told_steps = if first_event < reference || is_followed {
            " needsCompletedIntegratorStep=\"true\""
        } else {
            ""
        };
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
             <fmiModelDescription fmiVersion=\"3.0\" modelName=\"{prefix}\" instantiationToken=\"{token}\"{doc} \
             generationTool=\"hamel {version}\" variableNamingConvention=\"flat\">\n  \
                 <ModelExchange {interface}{told_steps}/>\n  \
                 <CoSimulation {interface} canHandleVariableCommunicationStepSize=\"true\"/>\n\
             {unit_definitions}  \
                 <LogCategories>\n    <Category name=\"logStatusError\"/>\n  </LogCategories>\n  \
                 <DefaultExperiment startTime=\"0\" stopTime=\"10\" tolerance=\"1e-8\"/>\n  \
                 <ModelVariables>\n{variables}  </ModelVariables>\n  \
                 <ModelStructure>\n{model_structure}  </ModelStructure>\n</fmiModelDescription>\n",
            doc = description(text.doc.first().map_or("", String::as_str)),
            unit_definitions = unit_definitions(defined.values()),
            version = env!("CARGO_PKG_VERSION"),
        )
    }
}

/// The functions of FMI for a scene with or without inputs, and rows that may become dependent.
fn functions(has_inputs: bool, has_rows: bool) -> String {
    let all = FUNCTIONS.replace(EVENTS_HERE, EVENTS).replace(KEPT_HERE, KEPT).replace(RANKS_HERE, RANKS);
    with_or_without(WITH_ROWS, has_rows, &with_or_without(WITH_INPUTS, has_inputs, &all))
}

/// A text with the lines between two marks, or without them.
fn with_or_without([begin, end]: [&str; 2], are_there: bool, all: &str) -> String {
    let mut pieces = all.split(begin);
    let mut text = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let (between, after) = piece.split_once(end).unwrap_or((piece, ""));
        text.push_str(if are_there { between } else { "" });
        text.push_str(after);
    }
    text
}

/// The element with the definitions of units, where there are any.
fn unit_definitions<'a>(units: impl Iterator<Item = &'a UnitText>) -> String {
    let definition = |unit: &UnitText| {
        let bases = ["kg", "m", "s", "A", "K", "mol", "cd", "rad"].iter().zip(unit.exponents);
        let mut base: String = bases.filter(|(_, e)| *e != 0).map(|(b, e)| format!(" {b}=\"{e}\"")).collect();
        if unit.factor != 1.0 {
            let _ = write!(base, " factor=\"{:?}\"", unit.factor);
        }
        format!("    <Unit name=\"{}\">\n      <BaseUnit{base}/>\n    </Unit>\n", escaped(&unit.name))
    };
    let definitions: String = units.map(definition).collect();
    match definitions.is_empty() {
        true => definitions,
        false => format!("  <UnitDefinitions>\n{definitions}  </UnitDefinitions>\n"),
    }
}

/// The attribute with a description.
fn description(text: &str) -> String {
    let text = text.trim().replace('\n', " ");
    if text.is_empty() { text } else { format!(" description=\"{}\"", escaped(&text)) }
}

/// Text of an attribute.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// 32 hexadecimal digits that tell texts apart: FNV-1a from two starts.
fn fingerprint(texts: &[&str]) -> String {
    let hash = |start: u64| {
        let bytes = texts.iter().flat_map(|text| text.bytes().chain([0]));
        bytes.fold(start, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3))
    };
    format!("{:016x}{:016x}", hash(0xcbf2_9ce4_8422_2325), hash(0x9e37_79b9_7f4a_7c15))
}
