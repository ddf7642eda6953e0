//! `Prepared`: what depends on parameters alone, and its constructor, which checks them.
//!
//! Does not know: functions of the state.

use proc_macro2::{Ident, TokenStream};
use quote::quote;

use super::Writer;
use super::format::parse;
use super::tokens::{
    allow_names, allow_numbers, capitalised, doc_attributes, escaped, field, ident, idents, phantom,
    statements, wrapped,
};
use crate::emit::expression::Binding;
use crate::program::{Literal, Relation};
use hamel_expr::error::Error;

impl Writer<'_> {
    /// The structure of what depends on parameters alone, and how it is made.
    pub(super) fn prepared(&self) -> Result<TokenStream, Error> {
        let (module, text) = (self.module, self.module.text);
        let mut lines = vec![format!(
            "Equations of {} with everything computed that depends on parameters alone.",
            module.title()
        )];
        if !text.doc.is_empty() {
            lines.push(String::new());
            lines.extend(text.doc.iter().map(|line| escaped(line)));
        }
        lines.extend([String::new(), "# State".into(), String::new(), "```text".into()]);
        lines.extend(wrapped("y = [", &module.program.state, "]"));
        lines.push("```".into());
        if !text.sources.is_empty() {
            lines.extend([String::new(), "# Source".into(), String::new()]);
            lines.extend(text.sources.iter().map(|s| format!("- {}", escaped(&s.replace('\n', " ")))));
        }
        let title = doc_attributes(lines);

        let slot_docs = module.formulas.iter().map(|formula| match formula {
            Some(formula) => doc_attributes([format!("`{formula}`")]),
            None => doc_attributes(["A longer expression in the parameters."]),
        });
        let read = || module.read_params.iter().map(|i| *i as usize);
        let params: Vec<&String> = read().map(|i| &module.fields[i]).collect();
        let param_docs =
            read().map(|i| doc_attributes([format!("Parameter `{}`.", module.program.params[i])]));
        let names = allow_names(params.iter().copied().chain(&module.slots));
        let (params, slots) = (idents(params), idents(&module.slots));
        let has_inputs = !text.inputs.is_empty();
        let (marker, marked) = match params.is_empty() && slots.is_empty() && !has_inputs {
            true => phantom(),
            false => Default::default(),
        };
        let inputs = self.input_field();
        let new = self.constructor(marked)?;
        Ok(quote! {
            #title
            #[derive(Clone, Copy, Debug, PartialEq)]
            #names
            pub struct Prepared<R = f64> {
                #(#param_docs #params: R,)*
                #(#slot_docs #slots: R,)*
                #inputs
                #marker
            }

            #new
        })
    }

    /// The names of what is in the structure: parameters that functions of the state read, and slots.
    pub(super) fn fields(&self) -> Vec<Ident> {
        let module = self.module;
        let params = module.read_params.iter().map(|i| &module.fields[*i as usize]);
        idents(params.chain(&module.slots))
    }

    fn constructor(&self, marked: TokenStream) -> Result<TokenStream, Error> {
        let (module, rt) = (self.module, &self.runtime);
        let (program, prepare) = (&module.program.prepare, &module.prepare);
        let locals = idents(&prepare.locals);
        let destructuring = if locals.is_empty() {
            quote! { let _ = params; }
        } else {
            let pairs = module
                .params
                .iter()
                .zip(&locals)
                .map(|(name, local)| field(&ident(name), &quote! { #local }));
            quote! { let Params { #(#pairs),* } = *params; }
        };
        let finite = self.finiteness(&locals);
        let bindings = statements(&prepare.statements)?;
        let mut conditions = TokenStream::new();
        for (condition, [greater, less]) in program.conditions.iter().zip(&prepare.sides) {
            let greater = parse(&greater.clone().at_least(Binding::Atom).text)?;
            let less = parse(&less.text)?;
            let method = ident(match condition.relation {
                Relation::Greater => "all_gt",
                Relation::GreaterEqual => "all_ge",
                Relation::NotEqual => "all_ne",
            });
            let (text, meaning) = (&condition.text, &condition.meaning);
            conditions.extend(quote! {
                if !#greater.#method(#less) {
                    return Err(#rt::ParamError { condition: #text, meaning: #meaning });
                }
            });
        }
        let mut fields = Vec::new();
        for i in &module.read_params {
            let local = &locals[*i as usize];
            fields.push(field(&ident(&module.fields[*i as usize]), &quote! { #local }));
        }
        for (slot, value) in module.slots.iter().zip(&prepare.values) {
            fields.push(field(&ident(slot), &parse(&value.text)?));
        }
        let mut lines =
            vec!["Checks the parameters and computes what depends on them alone.".to_owned(), String::new()];
        let texts = program.conditions.iter().map(|condition| format!(", `{}`", condition.text));
        let texts: String = texts.collect();
        lines.extend([
            "# Errors".into(),
            String::new(),
            format!("The first of these that does not hold: every parameter is finite{texts}."),
            String::new(),
            "# Operations".into(),
            String::new(),
            format!("{}.", capitalised(&program.counts().to_string())),
        ]);
        let doc = doc_attributes(lines);
        let names = allow_names(prepare.locals.iter().chain(&prepare.variables).chain(&module.slots));
        let numbers = allow_numbers(self.program_numbers().chain(self.input_defaults()));
        let inputs = self.inputs_at_defaults();
        Ok(quote! {
            #names
            #numbers
            impl<R: #rt::Real> Prepared<R> {
                #doc
                pub fn new(params: &Params<R>) -> Result<Self, #rt::ParamError> {
                    #destructuring
                    #finite
                    #bindings
                    #conditions
                    Ok(Self { #(#fields,)* #inputs #marked })
                }
            }
        })
    }

    fn finiteness(&self, locals: &[Ident]) -> TokenStream {
        let rt = &self.runtime;
        let error = quote! { return Err(#rt::ParamError { condition, meaning }); };
        let conditions: Vec<String> =
            self.module.program.params.iter().map(|name| format!("{name} is finite")).collect();
        let meanings: Vec<&String> = self.module.text.params.iter().map(|p| &p.doc).collect();
        match locals {
            [] => TokenStream::new(),
            [local] => quote! {
                if !#local.all_finite() {
                    let (condition, meaning) = (#(#conditions)*, #(#meanings)*);
                    #error
                }
            },
            _ => quote! {
                for (value, condition, meaning) in [#((#locals, #conditions, #meanings)),*] {
                    if !value.all_finite() {
                        #error
                    }
                }
            },
        }
    }

    /// The numbers of the program.
    pub(super) fn program_numbers(&self) -> impl Iterator<Item = f64> + '_ {
        self.module.program.constants.iter().filter_map(|c| match c.literal() {
            Literal::Number(x) => Some(x),
            _ => None,
        })
    }
}
