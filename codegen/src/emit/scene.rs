//! The items of one scene's module.

mod derivatives;

use std::collections::{BTreeMap, BTreeSet};

use proc_macro2::{Ident, Literal, Span, TokenStream};
use quote::quote;

use super::body::{self, Body, Text, parse, segments};
use super::names::{Scope, is_unusual, legal};
use super::{SceneText, doc_attributes, escaped, format_module, header};
use crate::error::Error;
use crate::expr::rational_to_f64;
use crate::program::{Function, Jet, Operand, Program, Relation, Role};

/// Names of methods and arguments that locals must not hide.
pub(super) const ARGUMENTS: [&str; 4] = ["t", "dy", "params", "out"];
/// Names that no method of an output can have.
const METHODS: [&str; 12] = [
    "new",
    "rhs",
    "energy",
    "pivots",
    "check",
    "signature",
    "domain",
    "prepare",
    "energy_of",
    "outputs_of",
    "clone",
    "fmt",
];
/// Longer formulas say less than a sentence.
const MAX_DOC_FORMULA: usize = 90;

pub(super) fn emit(program: &Program, jet: Option<&Jet>, text: &SceneText) -> Result<String, Error> {
    let module = Module::new(program, text)?;
    let items = [
        module.info()?,
        module.params()?,
        module.state()?,
        module.patterns(),
        module.prepared()?,
        module.functions()?,
        module.traits(jet.is_some())?,
        module.differentiable(),
        module.invariants(),
        jet.map_or(Ok(TokenStream::new()), |jet| super::jet::emit(&module, jet))?,
    ];
    let tokens = items.into_iter().collect();
    Ok(format!("{}{}", header(&text.command), format_module(tokens, &text.runtime)?))
}

pub(super) struct Module<'a> {
    program: &'a Program,
    text: &'a SceneText,
    /// Identifiers of parameters and components of the state.
    params: Vec<Ident>,
    pub(super) state: Vec<Ident>,
    /// Which parameters functions read, and the fields of slots.
    read_params: BTreeSet<u32>,
    pub(super) fields: Vec<Ident>,
    pub(super) slot_fields: Vec<Ident>,
    /// Outputs with their functions and methods.
    outputs: Vec<(&'a super::OutputText, &'a Function, Ident)>,
}

pub(super) fn ident(name: &str) -> Ident {
    Ident::new(name, Span::call_site())
}

fn idents(scope: &mut Scope, names: impl IntoIterator<Item = impl AsRef<str>>) -> Vec<Ident> {
    names.into_iter().map(|name| ident(&scope.add(name.as_ref()))).collect()
}

fn expect_size(what: &str, found: usize, expected: usize) -> Result<(), Error> {
    if found == expected {
        Ok(())
    } else {
        Err(Error::ShapeMismatch { what: what.to_owned(), found, expected })
    }
}

/// `#[allow(..)]` for what the names and numbers of the model need.
pub(super) fn allow(lint: &str, reason: &str) -> TokenStream {
    // `clippy::approx_constant` is a path.
    let path: syn::Path = syn::parse_str(lint).expect("lints are constants of this module");
    quote! { #[allow(#path, reason = #reason)] }
}

pub(super) fn allow_names<'i>(identifiers: impl IntoIterator<Item = &'i Ident>) -> TokenStream {
    if identifiers.into_iter().any(|i| is_unusual(&i.to_string())) {
        allow("non_snake_case", "names are those of the model")
    } else {
        TokenStream::new()
    }
}

/// Whether clippy takes one of the numbers for a rounded mathematical constant.
pub(super) fn allow_numbers(numbers: impl IntoIterator<Item = f64>) -> TokenStream {
    use std::f64::consts as c;
    let known = [
        c::E,
        c::FRAC_1_PI,
        c::FRAC_1_SQRT_2,
        c::FRAC_2_PI,
        c::FRAC_2_SQRT_PI,
        c::FRAC_PI_2,
        c::FRAC_PI_3,
        c::FRAC_PI_4,
        c::FRAC_PI_6,
        c::FRAC_PI_8,
        c::LN_2,
        c::LN_10,
        c::LOG10_2,
        c::LOG10_E,
        c::LOG2_10,
        c::LOG2_E,
        c::PI,
        c::SQRT_2,
        c::TAU,
        1.618_033_988_749_895,
        0.577_215_664_901_532_9,
    ];
    if numbers.into_iter().any(|x| known.iter().any(|k| (x.abs() - k).abs() < 2e-3 * k)) {
        allow("clippy::approx_constant", "values are those of the model")
    } else {
        TokenStream::new()
    }
}

/// The length of an array, without a suffix.
pub(super) fn size(n: usize) -> Literal {
    Literal::usize_unsuffixed(n)
}

/// The double as a literal expression, shortest form that reads back the same.
fn number(x: f64) -> TokenStream {
    let magnitude = Literal::f64_unsuffixed(x.abs());
    if x.is_sign_negative() && x != 0.0 {
        quote! { -#magnitude }
    } else {
        quote! { #magnitude }
    }
}

/// The function in a role is missing.
fn missing(program: &Program, role: &Role) -> Error {
    Error::UnknownName {
        name: role.name().to_owned(),
        kind: "function of the program",
        known: program.functions.iter().map(|f| f.role.name().to_owned()).collect(),
    }
}

impl<'a> Module<'a> {
    fn new(program: &'a Program, text: &'a SceneText) -> Result<Module<'a>, Error> {
        expect_size("list of documented parameters", text.params.len(), program.params.len())?;
        expect_size("list of documented state components", text.state.len(), program.state.len())?;
        let find = |role: &Role| program.function(role).ok_or_else(|| missing(program, role));
        let rhs = find(&Role::Rate)?;
        expect_size("function rhs", rhs.results.len(), program.state.len())?;
        if let Some(energy) = program.function(&Role::Energy) {
            expect_size("function energy", energy.results.len(), 1)?;
        }
        let mut methods = Scope::with(&METHODS);
        let mut outputs = Vec::with_capacity(text.outputs.len());
        for output in &text.outputs {
            let function = find(&Role::Output(output.name.clone()))?;
            expect_size(&format!("output {}", output.name), output.components.len(), function.results.len())?;
            let is_matrix = text.matrices.iter().any(|m| m.name == output.name);
            let entries = derivatives::entries_method(&output.name);
            let method = methods.add(if is_matrix { &entries } else { &output.name });
            outputs.push((output, function, ident(&method)));
        }

        let mut read_params = BTreeSet::new();
        for function in &program.functions {
            let operands = function.instructions.iter().flat_map(|i| i.op.operands());
            for operand in operands.chain(function.results.iter().map(|(_, o)| *o)) {
                if let Operand::Param(i) = operand {
                    read_params.insert(i);
                }
            }
        }
        let mut scope = Scope::default();
        let fields = idents(&mut scope, &program.params);
        let mut slot_fields = Vec::with_capacity(program.prepare.slots.len());
        for slot in &program.prepare.slots {
            slot_fields.push(ident(&match &slot.name {
                Some(name) => scope.add(name),
                None => scope.temporary("c"),
            }));
        }
        Ok(Module {
            program,
            text,
            params: idents(&mut Scope::default(), &program.params),
            state: idents(&mut Scope::default(), &program.state),
            read_params,
            fields,
            slot_fields,
            outputs,
        })
    }

    fn function(&self, role: &Role) -> Option<&'a Function> {
        self.program.function(role)
    }

    // ---- INFO, Params, State ----------------------------------------------------------------------------------------

    fn info(&self) -> Result<TokenStream, Error> {
        let SceneText { model, scene, .. } = self.text;
        let state = &self.program.state;
        let params = self.text.params.iter().map(|p| {
            let (name, default, doc) = (&p.name, number(rational_to_f64(&p.default)), &p.doc);
            quote! { ::hamel_runtime::ParamInfo { name: #name, default: #default, doc: #doc } }
        });
        let outputs = self.outputs.iter().map(|(output, ..)| {
            let super::OutputText { name, components, doc } = output;
            quote! { ::hamel_runtime::OutputInfo { name: #name, components: &[#(#components),*], doc: #doc } }
        });
        let has_energy = self.function(&Role::Energy).is_some();
        let allow = allow_numbers(self.defaults());
        Ok(quote! {
            /// Names, defaults and meanings of all that the scene has.
            #allow
            pub const INFO: ::hamel_runtime::SceneInfo = ::hamel_runtime::SceneInfo {
                model: #model,
                scene: #scene,
                state: &[#(#state),*],
                params: &[#(#params),*],
                outputs: &[#(#outputs),*],
                has_energy: #has_energy,
            };
        })
    }

    fn defaults(&self) -> impl Iterator<Item = f64> + '_ {
        self.text.params.iter().map(|p| rational_to_f64(&p.default))
    }

    fn params(&self) -> Result<TokenStream, Error> {
        let fields = &self.params;
        let n = size(fields.len());
        let mut docs = Vec::with_capacity(fields.len());
        for p in &self.text.params {
            let default = rational_to_f64(&p.default);
            let meaning =
                if p.doc.trim().is_empty() { format!("Parameter `{}`.", p.name) } else { sentence(&p.doc) };
            docs.push(doc_attributes([meaning, String::new(), format!("Default: {default:?}.")]));
        }
        let defaults = self.defaults().map(|x| match x {
            0.0 => quote! { R::ZERO },
            1.0 => quote! { R::ONE },
            x => {
                let x = number(x);
                quote! { R::from_f64(#x) }
            }
        });
        let (names, numbers) = (allow_names(fields), allow_numbers(self.defaults()));
        let title = doc_attributes([format!("Parameters of {}.", self.title())]);
        // A structure needs a field that mentions its scalar.
        let (marker, marked) = if fields.is_empty() { phantom() } else { Default::default() };
        Ok(quote! {
            #title
            #[derive(Clone, Copy, Debug, PartialEq)]
            #names
            pub struct Params<R = f64> {
                #(#docs pub #fields: R,)*
                #marker
            }

            #names
            impl<R: ::hamel_runtime::Real> Params<R> {
                /// The parameters from their values in the order of `INFO.params`.
                #[must_use]
                pub fn from_array(values: [R; #n]) -> Self {
                    let [#(#fields),*] = values;
                    Self { #(#fields,)* #marked }
                }

                /// The values in the order of `INFO.params`.
                #[must_use]
                pub fn to_array(self) -> [R; #n] {
                    [#(self.#fields),*]
                }
            }

            #numbers
            impl<R: ::hamel_runtime::Real> Default for Params<R> {
                fn default() -> Self {
                    Self { #(#fields: #defaults,)* #marked }
                }
            }
        })
    }

    fn state(&self) -> Result<TokenStream, Error> {
        let fields = &self.state;
        let n = size(fields.len());
        let docs = self.text.state.iter().map(|s| {
            doc_attributes([if s.doc.trim().is_empty() {
                format!("Component `{}`.", s.name)
            } else {
                sentence(&s.doc)
            }])
        });
        let names = allow_names(fields);
        let title =
            doc_attributes([format!("State of {} by name, in the order of the array.", self.title())]);
        let (marker, marked) = if fields.is_empty() { phantom() } else { Default::default() };
        Ok(quote! {
            #title
            #[derive(Clone, Copy, Debug, PartialEq)]
            #names
            pub struct State<R = f64> {
                #(#docs pub #fields: R,)*
                #marker
            }

            #names
            impl<R: ::hamel_runtime::Real> State<R> {
                /// The named components of an array.
                #[must_use]
                pub fn from_array(y: [R; #n]) -> Self {
                    let [#(#fields),*] = y;
                    Self { #(#fields,)* #marked }
                }

                /// The components as the array that [`Prepared::rhs`] takes.
                #[must_use]
                pub fn to_array(self) -> [R; #n] {
                    [#(self.#fields),*]
                }
            }
        })
    }

    fn title(&self) -> String {
        if self.text.scene == "default" {
            format!("`{}`", self.text.model)
        } else {
            format!("`{}`, scene `{}`", self.text.model, self.text.scene)
        }
    }

    // ---- Prepared ---------------------------------------------------------------------------------------------------

    fn prepared(&self) -> Result<TokenStream, Error> {
        let mut lines = vec![format!(
            "Equations of {} with everything computed that depends on parameters alone.",
            self.title()
        )];
        if !self.text.doc.is_empty() {
            lines.push(String::new());
            lines.extend(self.text.doc.iter().map(|line| escaped(line)));
        }
        lines.extend([String::new(), "# State".into(), String::new(), "```text".into()]);
        lines.extend(wrapped("y = [", &self.program.state, "]"));
        lines.push("```".into());
        if !self.text.sources.is_empty() {
            lines.extend([String::new(), "# Source".into(), String::new()]);
            lines.extend(self.text.sources.iter().map(|s| format!("- {}", escaped(&s.replace('\n', " ")))));
        }
        let title = doc_attributes(lines);

        let slot_docs = self.slot_docs();
        let params: Vec<&Ident> = self.read_params.iter().map(|i| &self.fields[*i as usize]).collect();
        let param_docs: Vec<TokenStream> = self
            .read_params
            .iter()
            .map(|i| doc_attributes([format!("Parameter `{}`.", self.program.params[*i as usize])]))
            .collect();
        let slots = &self.slot_fields;
        let names = allow_names(params.iter().copied().chain(slots));
        let (marker, marked) =
            if params.is_empty() && slots.is_empty() { phantom() } else { Default::default() };
        let new = self.constructor(marked)?;
        Ok(quote! {
            #title
            #[derive(Clone, Copy, Debug, PartialEq)]
            #names
            pub struct Prepared<R = f64> {
                #(#param_docs #params: R,)*
                #(#slot_docs #slots: R,)*
                #marker
            }

            #new
        })
    }

    /// The formula of each slot where it is short.
    fn slot_docs(&self) -> Vec<TokenStream> {
        let mut formulas: Vec<Option<Text>> = Vec::with_capacity(self.program.prepare.instructions.len());
        for instruction in &self.program.prepare.instructions {
            let too_long = |o: Operand| matches!(o, Operand::Value(v) if formulas[v as usize].is_none());
            if instruction.op.operands().any(too_long) {
                formulas.push(None);
                continue;
            }
            let text = body::operation(&instruction.op, false, |operand| match operand {
                Operand::Value(v) => {
                    formulas[v as usize].clone().unwrap_or_else(|| Text::atom(String::new()))
                }
                Operand::Constant(i) => body::constant(&self.program.constants[i as usize], false),
                Operand::Param(i) => Text::atom(self.program.params[i as usize].clone()),
                _ => Text::atom(String::new()),
            });
            formulas.push((text.text.len() <= MAX_DOC_FORMULA).then_some(text));
        }
        let doc = |slot: &crate::program::Slot| match &formulas[slot.value as usize] {
            Some(formula) => doc_attributes([format!("`{}`", formula.text)]),
            None => doc_attributes(["A longer expression in the parameters."]),
        };
        self.program.prepare.slots.iter().map(doc).collect()
    }

    fn constructor(&self, marked: TokenStream) -> Result<TokenStream, Error> {
        let prepare = &self.program.prepare;
        let mut scope = Scope::with(&ARGUMENTS);
        let locals = idents(&mut scope, &self.program.params);
        let sides = prepare.conditions.iter().flat_map(|c| [c.greater, c.less]);
        let results: Vec<Operand> =
            sides.chain(prepare.slots.iter().map(|slot| Operand::Value(slot.value))).collect();
        let body = Body::new(self.program, &prepare.instructions, &results, &mut scope, "t", |operand| {
            match operand {
                Operand::Param(i) => locals[i as usize].to_string(),
                // Verified: the prepare part reads parameters and constants only.
                _ => String::new(),
            }
        });

        let destructuring = if locals.is_empty() {
            quote! { let _ = params; }
        } else {
            let pairs = self.params.iter().zip(&locals).map(|(field, local)| {
                if field == local {
                    quote! { #field }
                } else {
                    quote! { #field: #local }
                }
            });
            quote! { let Params { #(#pairs),* } = *params; }
        };
        let finite = self.finiteness(&locals);
        let statements = body.statements(&[(0..prepare.instructions.len(), None)], &results)?;
        let mut conditions = TokenStream::new();
        for condition in &prepare.conditions {
            let greater = receiver(self.spell(&body, condition.greater, &locals)?);
            let less = self.spell(&body, condition.less, &locals)?;
            let method = ident(match condition.relation {
                Relation::Greater => "all_gt",
                Relation::GreaterEqual => "all_ge",
                Relation::NotEqual => "all_ne",
            });
            let (text, meaning) = (&condition.text, &condition.meaning);
            conditions.extend(quote! {
                if !#greater.#method(#less) {
                    return Err(::hamel_runtime::ParamError { condition: #text, meaning: #meaning });
                }
            });
        }
        let mut fields = TokenStream::new();
        for i in &self.read_params {
            let (field, local) = (&self.fields[*i as usize], &locals[*i as usize]);
            fields.extend(if field == local {
                quote! { #field, }
            } else {
                quote! { #field: #local, }
            });
        }
        for (slot, field) in prepare.slots.iter().zip(&self.slot_fields) {
            let value = self.spell(&body, Operand::Value(slot.value), &locals)?;
            fields.extend(if *field == value.to_string() {
                quote! { #field, }
            } else {
                quote! { #field: #value, }
            });
        }
        let mut lines =
            vec!["Checks the parameters and computes what depends on them alone.".to_owned(), String::new()];
        lines.extend([
            "# Errors".into(),
            String::new(),
            "The first of these that does not hold: every parameter is finite".into(),
        ]);
        for condition in &prepare.conditions {
            let last = lines.last_mut().expect("lines were pushed above");
            last.push_str(&format!(", `{}`", condition.text));
        }
        lines.last_mut().expect("lines were pushed above").push('.');
        lines.extend([
            String::new(),
            "# Operations".into(),
            String::new(),
            format!("{}.", capitalised(&prepare.counts().to_string())),
        ]);
        let doc = doc_attributes(lines);
        let names =
            allow_names(&locals.iter().cloned().chain(self.slot_fields.iter().cloned()).collect::<Vec<_>>());
        let numbers = allow_numbers(self.program_numbers());
        Ok(quote! {
            #names
            #numbers
            impl<R: ::hamel_runtime::Real> Prepared<R> {
                #doc
                pub fn new(params: &Params<R>) -> Result<Self, ::hamel_runtime::ParamError> {
                    #destructuring
                    #finite
                    #statements
                    #conditions
                    Ok(Self { #fields #marked })
                }
            }
        })
    }

    fn finiteness(&self, locals: &[Ident]) -> TokenStream {
        let error = quote! { return Err(::hamel_runtime::ParamError { condition, meaning }); };
        let conditions: Vec<String> =
            self.program.params.iter().map(|name| format!("{name} is finite")).collect();
        let meanings: Vec<&String> = self.text.params.iter().map(|p| &p.doc).collect();
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

    fn program_numbers(&self) -> Vec<f64> {
        let literal = |c: &crate::program::Constant| match c.literal() {
            crate::program::Literal::Number(x) => Some(x),
            _ => None,
        };
        self.program.constants.iter().filter_map(literal).collect()
    }

    /// An operand of the prepare part as tokens.
    fn spell(&self, body: &Body<'_>, operand: Operand, params: &[Ident]) -> Result<TokenStream, Error> {
        match operand {
            Operand::Param(i) => {
                let name = &params[i as usize];
                Ok(quote! { #name })
            }
            Operand::Value(v) => parse(&body.value(v)),
            Operand::Constant(i) => parse(&body::constant(&self.program.constants[i as usize], true).text),
            _ => Err(Error::Program { reason: format!("{operand:?} in the prepare part") }),
        }
    }

    // ---- functions --------------------------------------------------------------------------------------------------

    fn functions(&self) -> Result<TokenStream, Error> {
        let n = size(self.state.len());
        let arguments = quote! { &self, t: R, y: &[R; #n] };
        let mut methods = TokenStream::new();
        let mut unusual: Vec<Ident> = Vec::new();
        let mut method_names: Vec<Ident> = Vec::new();
        let mut names_of = |written: &Written| unusual.extend(written.locals.iter().map(|name| ident(name)));

        if let Some(rhs) = self.function(&Role::Rate) {
            let written = self.write(rhs)?;
            names_of(&written);
            let doc =
                self.function_doc(rhs, "Writes the derivative of the state to `dy`.", &self.program.state);
            let Written { statements, results, .. } = written;
            methods.extend(quote! {
                #doc
                #[inline]
                pub fn rhs(#arguments, dy: &mut [R; #n]) {
                    #statements
                    *dy = [#(#results),*];
                }
            });
        }
        if let Some(energy) = self.function(&Role::Energy) {
            let written = self.write(energy)?;
            names_of(&written);
            let doc = self.function_doc(energy, "Energy.", &[]);
            let Written { statements, results, .. } = written;
            methods.extend(quote! {
                #doc
                #[inline]
                #[must_use]
                pub fn energy(#arguments) -> R {
                    #statements
                    #(#results)*
                }
            });
        }
        for (output, function, method) in &self.outputs {
            let written = self.write(function)?;
            names_of(&written);
            let meaning = if output.doc.trim().is_empty() {
                format!("Output `{}`.", output.name)
            } else {
                sentence(&output.doc)
            };
            let components: &[String] = if is_scalar(output) { &[] } else { &output.components };
            let doc = self.function_doc(function, &meaning, components);
            let Written { statements, results, .. } = written;
            let k = size(results.len());
            let (kind, value) = if is_scalar(output) {
                (quote! { R }, quote! { #(#results)* })
            } else {
                (quote! { [R; #k] }, quote! { [#(#results),*] })
            };
            method_names.push(method.clone());
            methods.extend(quote! {
                #doc
                #[inline]
                #[must_use]
                pub fn #method(#arguments) -> #kind {
                    #statements
                    #value
                }
            });
        }
        methods.extend(self.dense_matrices()?);
        for product in &self.text.products {
            let function = self.product(product)?;
            let written = self.write(function)?;
            names_of(&written);
            methods.extend(self.product_method(product, function, written));
        }
        if let Some(check) = self.checked() {
            let written = self.write(check)?;
            names_of(&written);
            methods.extend(self.pivots(check, written));
        }
        if let Some(signature) = self.function(&Role::Signature) {
            let written = self.write(signature)?;
            names_of(&written);
            let title = "A number that stays the same along a motion while no matrix that is solved with becomes singular.";
            let doc = self.function_doc(signature, title, &[]);
            let Written { statements, results, .. } = written;
            methods.extend(quote! {
                #doc
                #[inline]
                #[must_use]
                pub fn signature(#arguments) -> R {
                    #statements
                    #(#results)*
                }
            });
        }
        if let Some(domain) = self.function(&Role::Domain) {
            let written = self.write(domain)?;
            names_of(&written);
            methods.extend(self.domain(domain, written));
        }
        let names = allow_names(unusual.iter().chain(&method_names).chain(&self.state));
        let numbers = allow_numbers(self.program_numbers());
        let n_sections = self.program.sections.len() as u32;
        let has_titles =
            self.program.functions.iter().flat_map(|f| &f.instructions).any(|i| i.section + 1 < n_sections);
        let comments = if has_titles {
            allow("unused_doc_comments", "comments on statements say which formula they are")
        } else {
            TokenStream::new()
        };
        Ok(quote! {
            #names
            #numbers
            #comments
            impl<R: ::hamel_runtime::Real> Prepared<R> {
                #methods
            }
        })
    }

    /// What is divided by, and the function that fails with the first of it that cannot be divided by.
    fn pivots(&self, function: &Function, written: Written) -> TokenStream {
        let n = size(self.state.len());
        let Written { statements, results, .. } = written;
        let n_pivots = results.len() / 2;
        let (values, scales) = results.split_at(n_pivots);
        let names = function.results[..n_pivots].iter().map(|(name, _)| name);
        let title = "What the right-hand side divides by that may vanish or overflow, each with the scale of its rounding errors.";
        let doc = self.function_doc(function, title, &[]);
        let check_doc = doc_attributes([
            "Says which pivot vanishes at a point, or is not finite.",
            "",
            "# Errors",
            "",
            "`Singular` with the first pivot that is zero up to the rounding errors of what it is computed from, or",
            "`PivotNotFinite`.",
        ]);
        let n_pivots = size(n_pivots);
        quote! {
            #doc
            #[must_use]
            pub fn pivots(&self, t: R, y: &[R; #n]) -> [::hamel_runtime::Pivot<R>; #n_pivots] {
                #statements
                [#(::hamel_runtime::Pivot { name: #names, value: #values, scale: #scales }),*]
            }

            #check_doc
            pub fn check(&self, t: R, y: &[R; #n]) -> Result<(), ::hamel_runtime::Failure> {
                ::hamel_runtime::Pivot::verify_all(t, &self.pivots(t, y))
            }
        }
    }

    /// The function that fails with the first end of a coordinate's interval that does not hold.
    fn domain(&self, function: &Function, written: Written) -> TokenStream {
        let n = size(self.state.len());
        let Written { statements, results, .. } = written;
        let conditions = function.results.iter().map(|(name, _)| name);
        let tuples: Vec<TokenStream> =
            results.iter().zip(conditions).map(|(v, c)| quote! { (#v, #c) }).collect();
        let mut doc =
            vec!["Says whether a point lies outside the domain of the coordinates.", "", "# Errors", ""];
        doc.push("`OutsideDomain` with the first condition that does not hold.");
        let mut doc: Vec<String> = doc.into_iter().map(str::to_owned).collect();
        doc.extend(self.operations(function));
        let doc = doc_attributes(doc);
        // Not a number is not greater than anything.
        let failure = quote! {
            if !value.all_gt(R::ZERO) {
                let t = if t.all_ge(R::ZERO) { t.magnitude() } else { -t.magnitude() };
                return Err(::hamel_runtime::Failure::OutsideDomain { t, condition });
            }
        };
        let test = match tuples.as_slice() {
            [tuple] => quote! { let (value, condition) = #tuple; #failure },
            _ => quote! { for (value, condition) in [#(#tuples),*] { #failure } },
        };
        quote! {
            #doc
            #[inline]
            pub fn domain(&self, t: R, y: &[R; #n]) -> Result<(), ::hamel_runtime::Failure> {
                #statements
                #test
                Ok(())
            }
        }
    }

    /// The function `check`, unless there is nothing to check.
    fn checked(&self) -> Option<&'a Function> {
        self.function(&Role::Pivots).filter(|check| !check.results.is_empty())
    }

    fn write(&self, function: &Function) -> Result<Written, Error> {
        let operands: Vec<Operand> = function.instructions.iter().flat_map(|i| i.op.operands()).collect();
        let results: Vec<Operand> = function.results.iter().map(|(_, o)| *o).collect();
        let used: BTreeSet<Operand> = operands.into_iter().chain(results.iter().copied()).collect();
        let mut scope = Scope::with(&ARGUMENTS);
        let mut state: BTreeMap<u32, String> = BTreeMap::new();
        for (name, i) in self.program.state.iter().zip(0u32..) {
            state.insert(i, scope.add(name));
        }
        let argument: Vec<String> = function.argument.iter().map(|name| scope.add(name)).collect();
        let spell = |operand: Operand| match operand {
            Operand::Argument(i) => argument[i as usize].clone(),
            Operand::Param(i) => format!("self.{}", self.fields[i as usize]),
            Operand::Slot(i) => format!("self.{}", self.slot_fields[i as usize]),
            Operand::State(i) => state[&i].clone(),
            // Values and constants are spelled by the body.
            _ => "t".to_owned(),
        };
        let body = Body::new(self.program, &function.instructions, &results, &mut scope, "t", spell);

        let mut statements = self.vector(function, &argument, &used);
        let reads_state = used.iter().any(|o| matches!(o, Operand::State(_)));
        if reads_state {
            let names = state.iter().map(|(i, name)| {
                if used.contains(&Operand::State(*i)) {
                    let name = ident(name);
                    quote! { #name }
                } else {
                    quote! { _ }
                }
            });
            statements.extend(quote! { let [#(#names),*] = *y; });
        }
        let reads_time = used.contains(&Operand::Time) || function.role == Role::Domain;
        statements.extend(match (reads_time, reads_state) {
            (true, true) => TokenStream::new(),
            (true, false) => quote! { let _ = y; },
            (false, true) => quote! { let _ = t; },
            (false, false) => quote! { let _ = (t, y); },
        });
        statements.extend(body.statements(&segments(self.program, &function.instructions), &results)?);
        let mut values = Vec::with_capacity(results.len());
        for operand in results {
            values.push(parse(&match operand {
                Operand::Value(v) => body.value(v),
                Operand::Constant(i) => body::constant(&self.program.constants[i as usize], true).text,
                input => spell(input),
            })?);
        }
        let named = function.instructions.iter().filter_map(|i| i.name.as_deref().map(legal));
        Ok(Written { statements, results: values, locals: named.chain(argument).collect() })
    }

    /// Takes the vector of a function apart. This comes first: a component of the state may have the vector's name.
    fn vector(&self, function: &Function, argument: &[String], used: &BTreeSet<Operand>) -> TokenStream {
        let Some(product) =
            self.text.products.iter().find(|p| Role::Product(p.name.clone()) == function.role)
        else {
            return TokenStream::new();
        };
        let vector = ident(&product.vector);
        if !used.iter().any(|o| matches!(o, Operand::Argument(_))) {
            return quote! { let _ = #vector; };
        }
        let names = argument.iter().zip(0u32..).map(|(name, i)| {
            if used.contains(&Operand::Argument(i)) {
                let name = ident(name);
                quote! { #name }
            } else {
                quote! { _ }
            }
        });
        quote! { let [#(#names),*] = *#vector; }
    }

    fn function_doc(&self, function: &Function, title: &str, results: &[String]) -> TokenStream {
        let mut lines = vec![title.to_owned()];
        let formulas = self.text.formulas.get(&function.role).filter(|lines| !lines.is_empty());
        if let Some(formulas) = formulas {
            lines.extend([String::new(), "```text".into()]);
            lines.extend(formulas.iter().cloned());
            lines.push("```".into());
        }
        if !results.is_empty() {
            let (what, open) =
                if function.role == Role::Rate { ("State", "y = [") } else { ("Components", "[") };
            lines.extend([String::new(), format!("# {what}"), String::new(), "```text".into()]);
            lines.extend(wrapped(open, results, "]"));
            lines.push("```".into());
        }
        lines.extend(self.operations(function));
        doc_attributes(lines)
    }

    fn operations(&self, function: &Function) -> Vec<String> {
        let counts = capitalised(&function.counts().to_string());
        vec![String::new(), "# Operations".into(), String::new(), format!("{counts}.")]
    }

    // ---- traits -----------------------------------------------------------------------------------------------------

    fn traits(&self, has_jet: bool) -> Result<TokenStream, Error> {
        let (n, n_params) = (size(self.state.len()), size(self.params.len()));
        let arguments = quote! { &self, t: R, y: &[R; #n] };
        let check = self.checked().map(|_| {
            quote! {
                fn check(#arguments) -> Result<(), ::hamel_runtime::Failure> {
                    self.check(t, y)
                }

                fn pivots(#arguments, visit: &mut dyn FnMut(::hamel_runtime::Pivot<R>)) {
                    self.pivots(t, y).into_iter().for_each(visit);
                }
            }
        });
        let signature = self.function(&Role::Signature).map(|_| {
            quote! {
                #[inline]
                fn signature(#arguments) -> R {
                    self.signature(t, y)
                }
            }
        });
        let domain = self.function(&Role::Domain).map(|_| {
            quote! {
                #[inline]
                fn domain(#arguments) -> Result<(), ::hamel_runtime::Failure> {
                    self.domain(t, y)
                }
            }
        });
        let energy = if self.function(&Role::Energy).is_some() {
            quote! { Some(self.energy(t, y)) }
        } else {
            quote! { let _ = (t, y); None }
        };
        let is_kept = self.text.conserves_energy && self.function(&Role::Energy).is_some();
        let conserves_energy = is_kept.then(|| quote! { const CONSERVES_ENERGY: bool = true; });
        let wrong_number = format!("the number of values is {n_params}");
        let (outputs, invariants) = (self.outputs_of(), self.invariants_of());
        let series = has_jet.then(|| {
            quote! {
                fn series_of(#arguments, out: &mut [[R; #n]]) -> bool {
                    let mut workspace = ::hamel_runtime::Jet::workspace(self);
                    ::hamel_runtime::Jet::series(self, t, y, &mut workspace, out);
                    true
                }
            }
        });
        Ok(quote! {
            impl<R: ::hamel_runtime::Real> ::hamel_runtime::System<R> for Prepared<R> {
                type State = [R; #n];

                #[inline]
                fn rhs(#arguments, dy: &mut [R; #n]) {
                    self.rhs(t, y, dy);
                }

                #check

                #signature

                #domain
            }

            impl<R: ::hamel_runtime::Real> ::hamel_runtime::Scene<R> for Prepared<R> {
                const INFO: ::hamel_runtime::SceneInfo = INFO;

                #conserves_energy

                fn prepare(values: &[R]) -> Result<Self, ::hamel_runtime::ParamError> {
                    let Ok(values) = <[R; #n_params]>::try_from(values) else {
                        return Err(::hamel_runtime::ParamError {
                            condition: #wrong_number,
                            meaning: "one for each of INFO.params",
                        });
                    };
                    Self::new(&Params::from_array(values))
                }

                fn energy_of(#arguments) -> Option<R> {
                    #energy
                }

                fn outputs_of(#arguments, out: &mut [R]) {
                    #outputs
                }

                #series

                #invariants
            }
        })
    }

    fn outputs_of(&self) -> TokenStream {
        if self.outputs.is_empty() {
            return quote! { let _ = (t, y, out); };
        }
        let mut names = Vec::new();
        let mut calls = TokenStream::new();
        for (output, _, method) in &self.outputs {
            let own: Vec<Ident> =
                (0..output.components.len()).map(|k| ident(&format!("v{}", names.len() + k))).collect();
            calls.extend(if is_scalar(output) {
                quote! { let #(#own)* = self.#method(t, y); }
            } else {
                quote! { let [#(#own),*] = self.#method(t, y); }
            });
            names.extend(own);
        }
        let total = size(names.len());
        quote! {
            if let Ok(out) = <&mut [R; #total]>::try_from(out) {
                #calls
                *out = [#(#names),*];
            }
        }
    }
}

struct Written {
    statements: TokenStream,
    results: Vec<TokenStream>,
    locals: Vec<String>,
}

/// An output whose only component is itself is a scalar.
fn is_scalar(output: &super::OutputText) -> bool {
    matches!(output.components.as_slice(), [component] if *component == output.name)
}

/// A field for structures without any, and its value.
fn phantom() -> (TokenStream, TokenStream) {
    (quote! { scalar: ::core::marker::PhantomData<R>, }, quote! { scalar: ::core::marker::PhantomData, })
}

/// In parentheses when a method call would bind to a part only.
fn receiver(value: TokenStream) -> TokenStream {
    let operator = |tree: proc_macro2::TokenTree| match tree {
        proc_macro2::TokenTree::Punct(p) => matches!(p.as_char(), '+' | '-' | '*' | '/'),
        _ => false,
    };
    if value.clone().into_iter().any(operator) {
        quote! { (#value) }
    } else {
        value
    }
}

fn sentence(text: &str) -> String {
    let text = escaped(&capitalised(text.trim()));
    if text.ends_with(['.', '!', '?', ')', '`']) { text } else { format!("{text}.") }
}

fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    match chars.next() {
        Some(first) => first.to_uppercase().chain(chars).collect(),
        None => String::new(),
    }
}

/// A list broken into lines of bounded length.
fn wrapped(open: &str, names: &[String], close: &str) -> Vec<String> {
    const WIDTH: usize = 90;
    let mut lines = vec![open.to_owned()];
    for (k, name) in names.iter().enumerate() {
        let separator = if k == 0 { "" } else { ", " };
        let line = lines.last_mut().expect("there is a first line");
        if line.len() + name.len() + 2 > WIDTH {
            line.push(',');
            lines.push(format!("     {name}"));
        } else {
            line.push_str(&format!("{separator}{name}"));
        }
    }
    lines.last_mut().expect("there is a first line").push_str(close);
    lines
}
