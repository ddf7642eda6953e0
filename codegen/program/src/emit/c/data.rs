//! Structures, names and numbers of a scene, and what runs once for a set of parameters.
//!
//! Deliberately does not know: what is computed at a point.

use std::fmt::Write as _;

use super::text::{elements, length, plain, statements, string, strings};
use super::writer::Writer;
use crate::emit::expression::Binding;
use crate::emit::literal::number;
use crate::program::Relation;
use hamel_expr::rational_to_f64;

impl Writer<'_> {
    /// Sizes, and the structures of parameters and of what depends on them alone.
    pub(super) fn structures(&mut self) {
        let (module, prefix) = (self.module, self.prefix.clone());
        let mut doc = vec![format!("Model {}.", module.title().replace('`', "")), String::new()];
        doc.extend(module.text.doc.iter().cloned());
        if !module.text.sources.is_empty() {
            doc.extend([String::new(), "Source:".to_owned()]);
            doc.extend(module.text.sources.iter().map(|s| format!("- {}", s.replace('\n', " "))));
        }
        doc.extend([
            String::new(),
            "No function allocates, keeps anything between calls or fails in another way than by the code it returns."
                .to_owned(),
            "Arrays that are written may be those that are read.".to_owned(),
        ]);
        self.header.push_str(&super::text::comment(&doc));
        self.header.push('\n');
        self.constant("Number of components of the state.", "N_STATE", module.state.len());
        self.constant("Number of parameters.", "N_PARAMS", module.params.len());
        self.number_of_inputs();

        let mut components = String::new();
        for (k, (name, text)) in module.state.iter().zip(&module.text.state).enumerate() {
            let upper = &self.upper;
            let _ = writeln!(
                components,
                "    {upper}_AT_{name} = {k}, /**< {} */",
                plain(&described(&text.name, &text.doc))
            );
        }
        if !components.is_empty() {
            let _ = write!(
                self.header,
                "/** Places of the components of the state. */\nenum {prefix}_component {{\n{components}}};\n\n"
            );
        }

        let mut fields = String::new();
        for (name, p) in module.params.iter().zip(&module.text.params) {
            let doc = plain(&described(&p.name, &p.doc));
            let _ = writeln!(
                fields,
                "    double {name}; /**< {doc} Default: {:?}. */",
                rational_to_f64(&p.default)
            );
        }
        self.structure("Parameters.", "params", &fields);
        let mut fields = String::new();
        for i in &module.read_params {
            let (name, of) = (&module.fields[*i as usize], &module.program.params[*i as usize]);
            let _ = writeln!(fields, "    double {name}; /**< {} */", plain(of));
        }
        for (name, formula) in module.slots.iter().zip(&module.formulas) {
            let formula = formula.as_deref().unwrap_or("a longer expression in the parameters");
            let _ = writeln!(fields, "    double {name}; /**< {} */", plain(formula));
        }
        fields.push_str(&self.input_field());
        self.structure(
            "What depends on parameters alone; made by the function prepare.",
            "prepared",
            &fields,
        );
    }

    /// A structure, with a field that nothing reads where it would have none.
    fn structure(&mut self, doc: &str, name: &str, fields: &str) {
        let name = self.name(name);
        let fields = if fields.is_empty() { "    double unused;\n" } else { fields };
        let _ = write!(self.header, "/** {doc} */\ntypedef struct {name} {{\n{fields}}} {name};\n\n");
    }

    /// Names and meanings as data.
    pub(super) fn names(&mut self) {
        let (program, text) = (self.module.program, self.module.text);
        let (n, n_params) = (length(program.state.len()), length(program.params.len()));
        let name = |suffix: &str| format!("{}_{suffix}", self.prefix);
        let declare = |suffix: &str, n: usize| format!("char *const {}[{n}]", name(suffix));
        let arrays = [
            ("Names of the components of the state.", declare("state_names", n), strings(&program.state)),
            (
                "Their meanings and units.",
                declare("state_docs", n),
                strings(text.state.iter().map(|s| &s.doc)),
            ),
            ("Names of the parameters.", declare("param_names", n_params), strings(&program.params)),
            (
                "Their meanings and units.",
                declare("param_docs", n_params),
                strings(text.params.iter().map(|p| &p.doc)),
            ),
        ];
        for (doc, declaration, values) in arrays {
            self.array(doc, &declaration, &values);
        }
        self.input_data();
    }

    /// Parameters as arrays and by default, the initial state, and what runs once for a set of parameters.
    pub(super) fn prepare(&mut self) {
        let (module, params) = (self.module, self.name("params"));
        let fields = || module.params.iter();
        let n = length(module.params.len());
        let defaults: Vec<String> =
            module.text.params.iter().map(|p| number(rational_to_f64(&p.default))).collect();
        self.array(
            "Values of the parameters as published, in their order.",
            &format!("double {}[{n}]", self.name("param_defaults")),
            &elements(&defaults),
        );
        let (from, to) = (self.name("params_from_array"), self.name("params_to_array"));
        let nothing =
            |body: String, unused: &str| if body.is_empty() { format!("    {unused}\n") } else { body };
        let lines = fields().enumerate().map(|(k, name)| format!("    params->{name} = values[{k}];\n"));
        let body = nothing(lines.collect(), "(void)values;\n    params->unused = 0.0;");
        let doc = ["The parameters from their values in order.".to_owned()];
        self.function(&doc, &format!("void {from}(const double values[{n}], {params} *params)"), &body);
        let lines = fields().enumerate().map(|(k, name)| format!("    values[{k}] = params->{name};\n"));
        let body = nothing(lines.collect(), "(void)params;\n    values[0] = 0.0;");
        let doc = ["The values of the parameters in order.".to_owned()];
        self.function(&doc, &format!("void {to}(const {params} *params, double values[{n}])"), &body);
        let default = self.name("params_default");
        let body = format!(
            "    {params} params;\n    {from}({}, &params);\n    return params;\n",
            self.name("param_defaults")
        );
        self.function(
            &["The parameters as published.".to_owned()],
            &format!("{params} {default}(void)"),
            &body,
        );
        if let Some(initial) = &module.text.initial {
            let values: Vec<String> = initial.values.iter().map(|x| number(*x)).collect();
            let lines: String =
                values.iter().enumerate().map(|(k, value)| format!("    y[{k}] = {value};\n")).collect();
            let doc = initial.doc();
            let body = nothing(lines, "(void)y;");
            let signature = format!("void {}(double y[{}])", self.name("initial"), length(values.len()));
            self.function(&doc, &signature, &body);
        }
        self.constructor();
    }

    fn constructor(&mut self) {
        let module = self.module;
        let (program, prepare) = (&module.program.prepare, &module.prepare);
        let mut body = String::new();
        for (field, local) in module.params.iter().zip(&prepare.locals) {
            let _ = writeln!(body, "    const double {local} = params->{field};");
        }
        if prepare.locals.is_empty() {
            body.push_str("    (void)params;\n");
        }
        for (local, text) in prepare.locals.iter().zip(&module.text.params) {
            let code = self.code(violated(&format!("{} is finite", text.name), &text.doc));
            let _ = write!(body, "    if (!isfinite({local})) {{\n        return {code};\n    }}\n");
        }
        body.push_str(&statements(&prepare.statements));
        for (condition, [greater, less]) in program.conditions.iter().zip(&prepare.sides) {
            let sign = match condition.relation {
                Relation::Greater => ">",
                Relation::GreaterEqual => ">=",
                Relation::NotEqual => "!=",
            };
            let [greater, less] = [greater, less].map(|side| side.clone().at_least(Binding::Sum).text);
            let code = self.code(violated(&condition.text, &condition.meaning));
            let _ = write!(body, "    if (!({greater} {sign} {less})) {{\n        return {code};\n    }}\n");
        }
        for i in &module.read_params {
            let (field, local) = (&module.fields[*i as usize], &prepare.locals[*i as usize]);
            let _ = writeln!(body, "    p->{field} = {local};");
        }
        for (slot, value) in module.slots.iter().zip(&prepare.values) {
            let _ = writeln!(body, "    p->{slot} = {};", value.text);
        }
        body.push_str(&self.inputs_at_defaults());
        if module.read_params.is_empty() && module.slots.is_empty() && self.inputs().is_empty() {
            body.push_str("    p->unused = 0.0;\n");
        }
        body.push_str("    return 0;\n");
        let conditions: Vec<String> = program.conditions.iter().map(|c| format!(", {}", c.text)).collect();
        let doc = [
            "Checks the parameters and computes what depends on them alone.".to_owned(),
            String::new(),
            "Returns 0, or the code of the first of these that does not hold, with nothing written:"
                .to_owned(),
            format!("every parameter is finite{}.", conditions.concat()),
        ];
        let (name, params, prepared) = (self.name("prepare"), self.name("params"), self.name("prepared"));
        self.function(&doc, &format!("int {name}(const {params} *params, {prepared} *p)"), &body);
    }

    /// An array of names.
    pub(super) fn array_of_names(&mut self, doc: &str, suffix: &str, names: &[String]) {
        let declaration = format!("char *const {}[{}]", self.name(suffix), length(names.len()));
        let values: Vec<String> = names.iter().map(|name| string(name)).collect();
        self.array(doc, &declaration, &elements(&values));
    }
}

/// A name with its meaning.
fn described(name: &str, doc: &str) -> String {
    let doc = doc.trim().replace('\n', " ");
    if doc.is_empty() { format!("{name}.") } else { doc }
}

/// What is wrong with parameters.
fn violated(condition: &str, meaning: &str) -> String {
    if meaning.is_empty() {
        format!("{condition} does not hold")
    } else {
        format!("{condition} does not hold: {meaning}")
    }
}
