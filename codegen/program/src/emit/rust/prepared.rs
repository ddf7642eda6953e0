//! `Prepared`: what depends on parameters alone, and its constructor, which checks them.
//!
//! Does not know: functions of the state.

use proc_macro2::TokenStream;
use quote::quote;

use super::Writer;
use super::lines::{self, ALLOW, documentation, literal};
use super::tokens::{MARKER, capitalised, doc_attributes, escaped, text_of, wrapped};
use crate::emit::expression::Binding;
use crate::program::Relation;

/// Characters of a structure in one line.
const MAX_LINE: usize = 80;
/// Characters of a field that shares its line with others.
const MAX_SHARED: usize = 30;

impl Writer<'_> {
    /// The structure of what depends on parameters alone.
    pub(super) fn prepared(&self) -> TokenStream {
        let (module, text) = (self.module, self.module.text);
        let mut doc = vec![format!(
            "Equations of {} with everything computed that depends on parameters alone.",
            module.title()
        )];
        if !text.doc.is_empty() {
            doc.push(String::new());
            doc.extend(text.doc.iter().map(|line| escaped(line)));
        }
        doc.extend([String::new(), "# State".into(), String::new(), "```text".into()]);
        doc.extend(wrapped("y = [", &module.program.state, "]"));
        doc.push("```".into());
        if !text.sources.is_empty() {
            doc.extend([String::new(), "# Source".into(), String::new()]);
            doc.extend(text.sources.iter().map(|s| format!("- {}", escaped(&s.replace('\n', " ")))));
        }
        let mut structure = documentation(doc);
        structure.push_str(&format!(
            "#[derive(Clone, Copy, Debug, PartialEq)]\n{ALLOW}\npub struct Prepared<R = f64> {{\n"
        ));
        let params = module.read_params.iter().map(|i| (&module.fields[*i as usize], None));
        let slots = module.slots.iter().zip(module.formulas.iter().map(Option::as_ref));
        let fields: Vec<(&String, Option<&String>)> = params.chain(slots).collect();
        for run in fields.chunk_by(|a, b| a.1.is_none() && b.1.is_none()) {
            match run {
                [(slot, Some(formula))] => structure.push_str(&format!("    {slot}: R, // {formula}\n")),
                run => {
                    let fields: Vec<String> = run.iter().map(|(field, _)| format!("{field}: R")).collect();
                    structure.push_str(&format!("{}\n", lines::filled(&fields)));
                }
            }
        }
        structure.push_str(&self.input_field());
        if self.is_without_numbers() {
            structure.push_str(&format!("    {MARKER}: ::core::marker::PhantomData<R>,\n"));
        }
        structure.push('}');
        lines::statements(&structure)
    }

    /// Whether the structure has a marker alone.
    fn is_without_numbers(&self) -> bool {
        self.fields().is_empty() && self.module.text.inputs.is_empty()
    }

    /// The names of the numbers in the structure: parameters that functions of the state read, and slots.
    fn fields(&self) -> Vec<&str> {
        let module = self.module;
        let params = module.read_params.iter().map(|i| &module.fields[*i as usize]);
        params.chain(&module.slots).map(String::as_str).collect()
    }

    /// The structure over another scalar.
    pub(super) fn over_scalar(&self) -> TokenStream {
        let (fields, has_inputs) = (self.fields(), !self.module.text.inputs.is_empty());
        let open = format!("{}::over_scalar!(Prepared[{}] {{ ", self.path, self.module.state.len());
        let close = match (fields.is_empty(), has_inputs) {
            (_, true) => " } array inputs);".to_owned(),
            (true, false) => format!("}} marker {MARKER});"),
            (false, false) => " });".to_owned(),
        };
        lines::statements(&lines::list(&open, &fields, &close))
    }

    /// The method that makes it.
    pub(super) fn constructor(&self) -> TokenStream {
        let (module, rt) = (self.module, &self.runtime);
        let (program, prepare) = (&module.program.prepare, &module.prepare);
        let field = |field: &str, value: &str| match field == value {
            true => field.to_owned(),
            false => format!("{field}: {value}"),
        };
        let mut body = Vec::new();
        match module.params.is_empty() {
            true => body.push("let _ = params;".to_owned()),
            false => body.push("INFO.require_finite(&params.to_array())?;".to_owned()),
        }
        // What nothing reads has been checked, and gets no variable.
        let is_read =
            |i: &usize| prepare.reads.contains(&(*i as u32)) || module.read_params.contains(&(*i as u32));
        let read: Vec<usize> = (0..prepare.locals.len()).filter(is_read).collect();
        if !read.is_empty() {
            let names = read.iter().map(|i| field(&module.params[*i], &prepare.locals[*i]));
            let others = (read.len() < prepare.locals.len()).then(|| "..".to_owned());
            let names: Vec<String> = names.chain(others).collect();
            let pattern = lines::list("let Params { ", &names, " } = *params;");
            // Nothing may follow what stands for all others.
            body.push(pattern.replace("..,\n}", "..\n}"));
        }
        body.extend(Some(text_of(&prepare.statements)).filter(|text| !text.is_empty()));
        for (condition, [greater, less]) in program.conditions.iter().zip(&prepare.sides) {
            let greater = greater.clone().at_least(Binding::Atom).text;
            let method = match condition.relation {
                Relation::Greater => "all_gt",
                Relation::GreaterEqual => "all_ge",
                Relation::NotEqual => "all_ne",
            };
            body.push(format!(
                "{}::ParamError::require({greater}.{method}({}), {}, {})?;",
                self.path,
                less.text,
                literal(&condition.text),
                literal(&condition.meaning)
            ));
        }
        let params = module.read_params.iter().map(|i| {
            let i = *i as usize;
            field(&module.fields[i], &prepare.locals[i])
        });
        let slots = module.slots.iter().zip(&prepare.values).map(|(slot, value)| field(slot, &value.text));
        let inputs = self.inputs_at_defaults();
        let marker = self.is_without_numbers().then(|| format!("{MARKER}: ::core::marker::PhantomData"));
        body.push(made(
            "Ok(Self {",
            &params.chain(slots).chain(inputs).chain(marker).collect::<Vec<_>>(),
            "})",
        ));
        let body = lines::statements(&body.join("\n"));
        let texts = program.conditions.iter().map(|condition| format!(", `{}`", condition.text));
        let texts: String = texts.collect();
        let doc = doc_attributes([
            "Checks the parameters and computes what depends on them alone.".to_owned(),
            String::new(),
            format!("Operations: {}.", program.counts()),
            String::new(),
            "# Errors".into(),
            String::new(),
            capitalised(&format!("the first of these that does not hold: every parameter is finite{texts}.")),
        ]);
        quote! {
            #doc
            pub fn new(params: &Params<R>) -> Result<Self, #rt::ParamError> {
                #body
            }
        }
    }
}

/// A structure from its fields: short ones share lines.
fn made(open: &str, fields: &[String], close: &str) -> String {
    let line = fields.join(", ");
    if line.len() <= MAX_LINE {
        return format!("{open} {line} {close}");
    }
    let mut text = open.to_owned();
    for run in fields.chunk_by(|a, b| a.len().max(b.len()) <= MAX_SHARED) {
        match run {
            [field] => text.push_str(&format!("\n    {field},")),
            run => text.push_str(&format!("\n{}", lines::filled(run))),
        }
    }
    format!("{text}\n{close}")
}
