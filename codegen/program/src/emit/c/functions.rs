//! What is computed at a point: derivative, energy, outputs, matrices, products, flows, the implicit form.
//!
//! Deliberately does not know: where the equations end.

use std::fmt::Write as _;

use super::text::{elements, length, statements};
use super::writer::{Takes, Writer};
use crate::emit::module::{IMPLICIT_JACOBIAN, OutputRoutine, Routine, VariablesRoutine};
use crate::emit::text::MatrixText;
use crate::program::{Operand, Role};
use hamel_expr::error::Error;

/// The arguments of a function that a body may leave unread.
#[derive(Clone, Copy, Debug)]
pub(super) enum Arguments {
    /// Time and state.
    Point,
    /// Time, state and inputs in the place of those that are held.
    Inputs,
    /// Time, state and a vector.
    Product,
    /// Time and variables in the place of the state.
    Variables,
    /// A time and the state.
    Flow,
}

/// Entries of a matrix: shape, places, and whether those below the diagonal are minus those above.
struct Pattern<'p> {
    name: &'p str,
    shape: (usize, usize),
    places: &'p [(usize, usize)],
    is_antisymmetric: bool,
}

impl<'p> Pattern<'p> {
    fn of(matrix: &'p MatrixText) -> Pattern<'p> {
        Pattern {
            name: &matrix.name,
            shape: matrix.shape,
            places: &matrix.pattern,
            is_antisymmetric: matrix.is_antisymmetric,
        }
    }
}

impl Writer<'_> {
    /// The arguments of a function of time and state, without the closing bracket.
    pub(super) fn arguments(&self) -> String {
        let n = length(self.module.state.len());
        format!("const {} *p, double t, const double y[{n}]", self.name("prepared"))
    }

    /// Functions of time and state, products and flows.
    pub(super) fn functions(&mut self) {
        let module = self.module;
        let (arguments, n) = (self.arguments(), length(module.state.len()));
        let doc = self.doc("Writes the derivative of the state to dy.", &module.rate, &module.program.state);
        match self.inputs() {
            [] => {
                let body = self.body(&module.rate, Arguments::Point) + &self.results(&module.rate, "dy");
                self.function(
                    &doc,
                    &format!("void {}({arguments}, double dy[{n}])", self.name("rhs")),
                    &body,
                );
                self.call("The derivative of the state.", "rhs", Takes::Point, Some(module.state.len()));
            }
            _ => self.rate_with_inputs(&doc),
        }
        if let Some(energy) = &module.energy {
            self.scalar("energy", "Energy.", energy);
        }
        for output in &module.outputs {
            self.output(output);
        }
        self.outputs();
        for product in &module.products {
            let routine = &product.routine;
            let body = self.body(routine, Arguments::Product) + &self.results(routine, "out");
            let doc = self.doc(&product.text.doc, routine, &product.text.components);
            let (n, k) = (length(routine.argument.len()), length(routine.function.results.len()));
            let name = self.name(&product.name);
            let signature = format!("void {name}({arguments}, const double vector[{n}], double out[{k}])");
            self.function(&doc, &signature, &body);
            let (n, k) = (routine.argument.len(), routine.function.results.len());
            self.call(&product.text.doc, &product.name, Takes::PointAndVector(n), Some(k));
        }
        for flow in &module.flows {
            let body = self.body(&flow.routine, Arguments::Flow) + &self.results(&flow.routine, "out");
            let title = format!(
                "What the flow of the part of the Hamiltonian that is a function of {} adds to the state in a time.",
                flow.text.forms.join(", ")
            );
            let doc = self.doc(&title, &flow.routine, &[]);
            let (name, prepared) = (self.name(&flow.name), self.name("prepared"));
            let signature = format!(
                "void {name}(const {prepared} *p, double value, const double y[{n}], double out[{n}])"
            );
            self.function(&doc, &signature, &body);
            self.call(&title, &flow.name, Takes::Flow, Some(module.state.len()));
        }
        if let Some(signature) = &module.signature {
            let title = "A number that stays the same along a motion while no matrix that is solved with becomes \
                         singular.";
            self.scalar("signature", title, signature);
        }
    }

    /// A function with one result.
    fn scalar(&mut self, name: &str, title: &str, routine: &Routine<'_>) {
        let mut body = self.body(routine, Arguments::Point);
        for result in &routine.code.results {
            let _ = writeln!(body, "    return {};", result.text);
        }
        let doc = self.doc(title, routine, &[]);
        let signature = format!("double {}({})", self.name(name), self.arguments());
        self.function(&doc, &signature, &body);
        self.call(title, name, Takes::Point, None);
    }

    fn output(&mut self, output: &OutputRoutine<'_>) {
        let OutputRoutine { text, name, routine, .. } = output;
        let meaning = if text.doc.trim().is_empty() {
            format!("Output {}.", text.name)
        } else {
            text.doc.trim().to_owned()
        };
        if output.is_scalar() {
            return self.scalar(name, &meaning, routine);
        }
        let body = self.body(routine, Arguments::Point) + &self.results(routine, "out");
        let doc = self.doc(&meaning, routine, &text.components);
        let k = routine.function.results.len();
        let signature = format!("void {}({}, double out[{}])", self.name(name), self.arguments(), length(k));
        self.function(&doc, &signature, &body);
        self.call(&meaning, name, Takes::Point, Some(k));
    }

    /// All outputs side by side, with their names.
    fn outputs(&mut self) {
        let module = self.module;
        let (mut body, mut names) = (String::new(), Vec::new());
        // A matrix without entries has no place here, and its function writes a zero for want of arrays of length zero.
        for output in module.outputs.iter().filter(|o| !o.text.components.is_empty()) {
            let (name, at) = (self.name(&output.name), names.len());
            if output.is_scalar() {
                let _ = writeln!(body, "    all[{at}] = {name}(p, t, y);");
                names.push(output.text.name.clone());
            } else {
                let _ = writeln!(body, "    {name}(p, t, y, all + {at});");
                let group = &output.text.name;
                names.extend(output.text.components.iter().map(|component| format!("{group}.{component}")));
            }
        }
        let n = length(names.len());
        let body = match names.is_empty() {
            true => "    (void)p;\n    (void)t;\n    (void)y;\n    out[0] = 0.0;\n".to_owned(),
            // The state may be what is written.
            false => format!("    double all[{n}];\n{body}    memcpy(out, all, sizeof all);\n"),
        };
        self.constant("Number of components of all outputs.", "N_OUTPUTS", names.len());
        self.array_of_names("Names of the outputs and their components, in order.", "output_names", &names);
        let doc = ["All outputs side by side.".to_owned()];
        let signature = format!("void {}({}, double out[{n}])", self.name("outputs"), self.arguments());
        self.function(&doc, &signature, &body);
        self.call(&doc[0], "outputs", Takes::Point, Some(names.len()));
    }

    /// The patterns of matrices, and each of them with its zeros.
    ///
    /// # Errors
    /// [`Error::ShapeMismatch`] where an entry is outside of its matrix.
    pub(super) fn matrices(&mut self) -> Result<(), Error> {
        let module = self.module;
        for output in &module.outputs {
            if let Some((matrix, all)) = &output.matrix {
                self.matrix(&Pattern::of(matrix), (&matrix.doc, &output.name, all), "y")?;
            }
        }
        Ok(())
    }

    fn matrix(
        &mut self,
        pattern: &Pattern<'_>,
        (doc, entries, all): (&str, &str, &str),
        point: &str,
    ) -> Result<(), Error> {
        let Pattern { name, shape: (n_rows, n_columns), places, is_antisymmetric } = *pattern;
        if let Some((i, j)) = places.iter().find(|(i, j)| *i >= n_rows || *j >= n_columns) {
            let what = format!("row or column of an entry of {name}");
            return Err(Error::ShapeMismatch { what, found: *i.max(j), expected: n_rows.max(n_columns) });
        }
        let n = places.len();
        let upper = name.to_ascii_uppercase();
        self.constant(
            &format!("Number of entries of {name} that do not vanish."),
            &format!("{upper}_NONZEROS"),
            n,
        );
        let columns_of = |of: fn(&(usize, usize)) -> usize| -> Vec<String> {
            places.iter().map(|place| of(place).to_string()).collect()
        };
        let entries = self.name(entries);
        let elsewhere =
            if is_antisymmetric { "those below the diagonal are minus these" } else { "the others vanish" };
        let [rows, columns] = ["rows", "columns"].map(|what| self.new_name(&format!("{name}_{what}")));
        self.array(
            &format!("Row of each entry that {entries} computes; {elsewhere}."),
            &format!("int {rows}[{}]", length(n)),
            &elements(&columns_of(|p| p.0)),
        );
        self.array(
            &format!("Column of each entry that {entries} computes."),
            &format!("int {columns}[{}]", length(n)),
            &elements(&columns_of(|p| p.1)),
        );
        if places.is_sorted() && !is_antisymmetric {
            let starts = self.new_name(&format!("{name}_row_starts"));
            let before = |row: usize| places.partition_point(|(i, _)| *i < row).to_string();
            self.array(
                "Number of entries before each row, and of all: with the columns, the matrix by compressed rows.",
                &format!("int {starts}[{}]", n_rows + 1),
                &elements(&(0..=n_rows).map(before).collect::<Vec<_>>()),
            );
        }
        let size = length(n_rows * n_columns);
        let mut body =
            format!("    double entries[{}];\n    {entries}(p, t, {point}, entries);\n", length(n));
        let _ = write!(body, "    for (int k = 0; k < {size}; k++) {{\n        out[k] = 0.0;\n    }}\n");
        if n > 0 {
            let _ = write!(
                body,
                "    for (int k = 0; k < {n}; k++) {{\n        \
                         out[{n_columns} * {rows}[k] + {columns}[k]] = entries[k];\n"
            );
            if is_antisymmetric {
                let _ = writeln!(body, "        out[{n_columns} * {columns}[k] + {rows}[k]] = -entries[k];");
            }
            body.push_str("    }\n");
        }
        let doc = [doc.to_owned(), String::new(), format!("{n_rows} rows of {n_columns}, row by row.")];
        let arguments = match point {
            "y" => self.arguments(),
            _ => self.variables(),
        };
        let signature = format!("void {}({arguments}, double out[{size}])", self.name(all));
        self.function(&doc, &signature, &body);
        let n_variables = self.module.implicit.as_ref().map_or(0, |implicit| implicit.text.variables.len());
        let takes = if point == "y" { Takes::Point } else { Takes::Variables(n_variables) };
        self.call(&doc[0], all, takes, Some(n_rows * n_columns));
        Ok(())
    }

    /// The arguments of a function of time and of the variables of the implicit form.
    fn variables(&self) -> String {
        let n = self.module.implicit.as_ref().map_or(1, |implicit| length(implicit.text.variables.len()));
        format!("const {} *p, double t, const double vector[{n}]", self.name("prepared"))
    }

    /// The implicit form, where the scene has one.
    ///
    /// # Errors
    /// As [`Writer::matrices`].
    pub(super) fn implicit(&mut self) -> Result<(), Error> {
        let module = self.module;
        let Some(implicit) = &module.implicit else { return Ok(()) };
        let names: Vec<String> = implicit.text.variables.iter().map(|v| v.name.clone()).collect();
        let n = names.len();
        self.constant("Number of variables z of the implicit form M z' = f(t, z).", "N_IMPLICIT", n);
        self.constant("Differential index of the implicit form.", "IMPLICIT_INDEX", implicit.text.index);
        self.array_of_names("Names of the variables of the implicit form.", "implicit_names", &names);
        let kinds = implicit.text.variables.iter().map(|v| usize::from(v.is_differential).to_string());
        self.array(
            "The diagonal of M: 1 where the row is a differential equation, 0 where it is algebraic.",
            &format!("int {}[{}]", self.name("implicit_differential"), length(n)),
            &elements(&kinds.collect::<Vec<_>>()),
        );
        let arguments = self.variables();
        for (name, routine, title) in [
            (&implicit.rhs, &implicit.right, "Right-hand side f(t, z) of the implicit form M z' = f(t, z)."),
            (
                &implicit.entries,
                &implicit.jacobian,
                "Entries df_i/dz_j that do not vanish identically, row by row.",
            ),
        ] {
            let body = self.body(routine, Arguments::Variables) + &self.results(routine, "out");
            let doc = self.doc(title, routine, &[]);
            let k = length(routine.function.results.len());
            self.function(&doc, &format!("void {}({arguments}, double out[{k}])", self.name(name)), &body);
            self.call(title, name, Takes::Variables(n), Some(routine.function.results.len()));
        }
        let pattern = Pattern {
            name: IMPLICIT_JACOBIAN,
            shape: (n, n),
            places: &implicit.text.pattern,
            is_antisymmetric: false,
        };
        let doc = "Matrix df_i/dz_j of the implicit form.";
        self.matrix(&pattern, (doc, &implicit.entries, &implicit.all), "vector")
    }

    /// The map from the system that the model is the quotient of, where the scene has it.
    pub(super) fn quotient(&mut self) {
        let module = self.module;
        let Some(text) = &module.text.quotient else { return };
        let (state, params) = (&text.state, &text.params);
        self.constant("Number of components of the total system's state.", "N_TOTAL_STATE", state.len());
        self.constant("Number of parameters of the total system.", "N_TOTAL_PARAMS", params.len());
        let doc = format!("Components of the state of {}, the first numbers of vector.", text.file);
        self.array_of_names(&doc, "total_state_names", state);
        let doc = format!("Parameters of {}, the last numbers of vector.", text.file);
        self.array_of_names(&doc, "total_param_names", params);
        let n = state.len() + params.len();
        for function in &module.quotient {
            self.of_variables(function, n);
        }
    }

    /// The discrete equations, where the scene has them.
    pub(super) fn discrete(&mut self) {
        let module = self.module;
        let Some(discrete) = &module.discrete else { return };
        let text = discrete.text;
        let n = 1 + text.state.len() + text.unknowns.len();
        self.constant(
            "Number of unknowns z of a step by the discrete equations.",
            "N_DISCRETE",
            text.unknowns.len(),
        );
        let doc = "Unknowns of a step; vector has the step, the state and these.";
        self.array_of_names(doc, "discrete_names", &text.unknowns);
        let list = |places: &mut dyn Iterator<Item = usize>| {
            places.map(|place| place.to_string()).collect::<Vec<String>>()
        };
        let places = [
            (
                "Places of the components of the state among the unknowns.",
                "discrete_state",
                list(&mut text.state.iter().copied()),
            ),
            (
                "Rows of the entries of discrete_jacobian.",
                "discrete_rows",
                list(&mut text.pattern.iter().map(|(i, _)| *i)),
            ),
            (
                "Columns of the entries of discrete_jacobian.",
                "discrete_columns",
                list(&mut text.pattern.iter().map(|(_, j)| *j)),
            ),
        ];
        for (doc, name, list) in places {
            self.array(doc, &format!("int {}[{}]", self.name(name), length(list.len())), &elements(&list));
        }
        for function in discrete.all() {
            self.of_variables(function, n);
        }
    }

    /// A function of time and so many variables.
    fn of_variables(&mut self, function: &VariablesRoutine<'_>, n: usize) {
        let routine = &function.routine;
        let names: Vec<String> = routine.function.results.iter().map(|(name, _)| name.clone()).collect();
        let body = self.body(routine, Arguments::Variables) + &self.results(routine, "out");
        let doc = self.doc(function.title, routine, &names);
        let (prepared, name) = (self.name("prepared"), self.name(&function.name));
        let (k, size) = (length(names.len()), length(n));
        let arguments = format!("const {prepared} *p, double t, const double vector[{size}]");
        self.function(&doc, &format!("void {name}({arguments}, double out[{k}])"), &body);
        self.call(function.title, &function.name, Takes::Variables(n), Some(names.len()));
    }

    /// What a function computes, in which order, and what it costs.
    fn doc(&self, title: &str, routine: &Routine<'_>, results: &[String]) -> Vec<String> {
        let function = routine.function;
        let mut lines = vec![title.trim().to_owned(), String::new()];
        if !results.is_empty() && results.len() <= 40 {
            let what = if function.role == Role::Rate { "State" } else { "Components" };
            lines.push(format!("{what}: {}.", results.join(", ")));
        }
        lines.push(format!("Operations: {}.", function.counts()));
        let n_products: usize = function.contractions.iter().map(|c| c.n_products).sum();
        if n_products > 0 {
            lines.push(format!("Loops over tables of {n_products} products."));
        }
        lines
    }

    /// The statements before the results.
    pub(super) fn body(&self, routine: &Routine<'_>, arguments: Arguments) -> String {
        let mut body = String::new();
        let takes_inputs = matches!(arguments, Arguments::Inputs);
        let reads_fields =
            routine.code.reads.iter().any(|o| matches!(o, Operand::Param(_) | Operand::Slot(_)))
                || routine.reads_inputs() && !takes_inputs;
        let reads_state = routine.code.reads_state() || routine.contracts_state();
        let reads_vector = routine.code.reads_argument() || routine.contracts_argument();
        let unread = match arguments {
            Arguments::Point => vec![("t", routine.reads_time()), ("y", reads_state)],
            Arguments::Inputs => {
                vec![("t", routine.reads_time()), ("y", reads_state), ("inputs", routine.reads_inputs())]
            }
            Arguments::Product => {
                vec![("t", routine.reads_time()), ("y", reads_state), ("vector", reads_vector)]
            }
            Arguments::Variables => vec![("t", routine.reads_time()), ("vector", reads_vector)],
            Arguments::Flow => vec![("value", reads_vector), ("y", reads_state)],
        };
        for (name, is_read) in [("p", reads_fields)].into_iter().chain(unread) {
            if !is_read {
                let _ = writeln!(body, "    (void){name};");
            }
        }
        let named = |names: &[Option<String>], of: &dyn Fn(usize) -> String| {
            let named = names.iter().enumerate().filter_map(|(k, name)| name.as_ref().map(|name| (k, name)));
            named.map(|(k, name)| format!("    const double {name} = {};\n", of(k))).collect::<String>()
        };
        body.push_str(&named(&routine.state, &|k| format!("y[{k}]")));
        let is_flow = matches!(arguments, Arguments::Flow);
        body.push_str(&named(&routine.argument, &|k| match is_flow {
            true => "value".to_owned(),
            false => format!("vector[{k}]"),
        }));
        let held = if takes_inputs { "inputs" } else { "p->inputs" };
        body.push_str(&named(&routine.inputs, &|k| format!("{held}[{k}]")));
        body.push_str(&statements(&routine.code.statements));
        body.push_str(&self.loops(routine));
        body
    }

    /// Statements that write the results to an array.
    pub(super) fn results(&self, routine: &Routine<'_>, to: &str) -> String {
        let results = &routine.code.results;
        let whole = routine.loops.as_ref().zip(routine.function.contraction_of_first_results(results.len()));
        match whole {
            Some((loops, k)) => {
                let sums = &loops.sums[k];
                format!("    memcpy({to}, {sums}, sizeof {sums});\n")
            }
            None if results.is_empty() => format!("    {to}[0] = 0.0;\n"),
            None => {
                let lines = results.iter().enumerate();
                lines.map(|(k, result)| format!("    {to}[{k}] = {};\n", result.text)).collect()
            }
        }
    }
}
