//! Inputs: the field that holds them, their names and defaults, and the right-hand side at others.
//!
//! Deliberately does not know: what the functions compute, when an input has which value.

use super::functions::Arguments;
use super::text::{elements, length, strings};
use super::writer::{Takes, Writer};
use crate::emit::literal::number;
use crate::emit::text::ParamText;
use hamel_expr::rational_to_f64;

impl Writer<'_> {
    /// What moves the scene from outside. Without any, nothing here writes anything.
    pub(super) fn inputs(&self) -> &[ParamText] {
        &self.module.text.inputs
    }

    pub(super) fn number_of_inputs(&mut self) {
        match self.inputs().len() {
            0 => {}
            n => self.constant("Number of inputs.", "N_INPUTS", n),
        }
    }

    /// The field of what is prepared.
    pub(super) fn input_field(&self) -> String {
        match self.inputs() {
            [] => String::new(),
            inputs => {
                let names: Vec<&str> = inputs.iter().map(|input| input.name.as_str()).collect();
                format!(
                    "    double inputs[{}]; /**< Values that the inputs are held at: {}. */\n",
                    inputs.len(),
                    names.join(", ")
                )
            }
        }
    }

    /// Names, meanings and defaults as data.
    pub(super) fn input_data(&mut self) {
        let inputs = &self.module.text.inputs;
        if inputs.is_empty() {
            return;
        }
        let n = inputs.len();
        let defaults: Vec<String> = inputs.iter().map(|p| number(rational_to_f64(&p.default))).collect();
        let arrays = [
            ("Names of the inputs.", "char *const", "input_names", strings(inputs.iter().map(|p| &p.name))),
            (
                "Their meanings and units.",
                "char *const",
                "input_docs",
                strings(inputs.iter().map(|p| &p.doc)),
            ),
            (
                "What the inputs are held at where nothing else was said.",
                "double",
                "input_defaults",
                elements(&defaults),
            ),
        ];
        for (doc, kind, suffix, values) in arrays {
            self.array(doc, &format!("{kind} {}[{n}]", self.name(suffix)), &values);
        }
    }

    /// Statements that hold the inputs at their defaults.
    pub(super) fn inputs_at_defaults(&self) -> String {
        match self.inputs() {
            [] => String::new(),
            _ => format!("    memcpy(p->inputs, {}, sizeof p->inputs);\n", self.name("input_defaults")),
        }
    }

    /// The right-hand side at any inputs, and at those that are held; and what holds them.
    pub(super) fn rate_with_inputs(&mut self, doc: &[String]) {
        let (module, arguments, m) = (self.module, self.arguments(), self.inputs().len());
        let n = length(module.state.len());
        let body = self.body(&module.rate, Arguments::Inputs) + &self.results(&module.rate, "dy");
        let with = self.name("rhs_with");
        let signature = format!("void {with}({arguments}, const double inputs[{m}], double dy[{n}])");
        self.function(doc, &signature, &body);
        let title = "The derivative of the state at values of the inputs.";
        self.call(title, "rhs_with", Takes::PointAndInputs(m), Some(module.state.len()));
        let held = [
            "Writes the derivative of the state to dy, with the inputs at the values that they are held at."
                .to_owned(),
        ];
        self.function(
            &held,
            &format!("void {}({arguments}, double dy[{n}])", self.name("rhs")),
            &format!("    {with}(p, t, y, p->inputs, dy);\n"),
        );
        self.call("The derivative of the state.", "rhs", Takes::Point, Some(module.state.len()));
        let holds = ["Holds the inputs at values, from here on and in every function.".to_owned()];
        let (name, prepared) = (self.name("hold_inputs"), self.name("prepared"));
        self.function(
            &holds,
            &format!("void {name}({prepared} *p, const double inputs[{m}])"),
            "    memmove(p->inputs, inputs, sizeof p->inputs);\n",
        );
    }

    /// The method of C++ that holds the inputs.
    pub(super) fn holder(&self, method: &str) -> String {
        match self.inputs().len() {
            0 => String::new(),
            m => format!(
                "\n    /// Holds the inputs at values, from here on and in every function.\n    \
                     void {method}(const std::array<double, {m}> &u) noexcept {{\n        \
                         {}_hold_inputs(&p_, u.data());\n    }}\n",
                self.prefix
            ),
        }
    }
}
