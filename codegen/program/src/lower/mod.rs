//! Ordered definitions and wanted results to a flat straight-line [`Program`] with a parameter-only part.
//!
//! First every function is written in the `form` that costs least, or is taken for a loop over tables (`roll`), pivots
//! and conditions are given the scales of their rounding errors (`pivots`), then expressions become `values` of a
//! program, and `passes` rewrite the program. Every rewrite is directional, none makes a function cost more, none calls
//! another, and what comes out is verified after each. Functions that lose digits all the same get them back by
//! `compensation`, at a cost. Does not know: mechanics (a definition is a name with a formula), Rust (a program has
//! operations and operands, no text).

mod budget;
mod check;
mod classes;
mod compensation;
mod form;
mod passes;
mod pivots;
mod roll;
mod source;
mod values;

use std::collections::BTreeMap;

use crate::program::{Counts, Program, Relation, Report, Role, Search, Symbols, verify};
use hamel_expr::error::Error;
use hamel_expr::trace::{self, Topic};
use hamel_expr::{ExprId, Graph, Rational, Section, Sign, SymbolId};

pub use budget::SearchBudget;
pub use compensation::{Sampling, VariableKind};
pub use pivots::{Divisors, WatchedMatrix};

use check::Check;
use compensation::compensate;
use form::{Digits, Form};
use passes::PASSES;
use source::Source;

/// The symbols that get their values from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Inputs {
    /// Parameters, constant in time.
    pub params: Vec<SymbolId>,
    /// Time.
    pub time: SymbolId,
    /// Inputs, constant in a call, with the values that they are held at where none are given.
    pub held: Vec<(SymbolId, Rational)>,
    /// Components of the state.
    pub state: Vec<SymbolId>,
    /// Signs of expressions in the parameters: what may be divided by.
    pub signs: BTreeMap<ExprId, Sign>,
    /// Pairs of components of the state, cosine and sine, whose squares add up to one.
    pub circles: Vec<[SymbolId; 2]>,
    /// Components of the vector that a function takes besides time and state, by the function's role.
    pub arguments: BTreeMap<Role, Vec<SymbolId>>,
    /// What is known about values that may be divided by.
    pub divisors: Divisors,
    /// Where functions are measured for the digits that they lose; none where no function is.
    pub sampling: Option<Sampling>,
}

impl Inputs {
    /// Components of the vector that a function takes besides time and state; most take none.
    fn argument(&self, role: &Role) -> &[SymbolId] {
        self.arguments.get(role).map_or(&[], Vec::as_slice)
    }

    /// What the inputs of the program stand for.
    pub fn symbols(&self) -> Symbols<'_> {
        let Inputs { params, time, held, state, arguments, .. } = self;
        Symbols { params, time: *time, inputs: held, state, arguments }
    }
}

/// A function to make: what it is for and its named results.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    /// What the function is for.
    pub role: Role,
    /// Names and values of the results in order.
    pub results: Vec<(String, ExprId)>,
}

/// A condition that the parameters have to satisfy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParamCondition {
    /// As the model words it.
    pub text: String,
    /// What it means; may be empty.
    pub meaning: String,
    /// The side that has to be larger.
    pub greater: ExprId,
    /// The side that has to be smaller.
    pub less: ExprId,
    /// How they compare.
    pub relation: Relation,
    /// Whether the larger side, to be positive or other than zero, is the result of a calculation, which rounding
    /// errors could hide.
    pub is_rounded: bool,
}

/// The rates in the form that a search found, for further programs by the same graph.
#[derive(Clone, Debug)]
pub struct KnownRates {
    asked: Request,
    form: Form,
    search: Search,
}

impl KnownRates {
    /// The form with its definitions in the sections of a source, if the source asks for these rates; sections have
    /// their order, and some more may stand between them.
    fn in_sections_of(&self, source: &Source<'_>, request: &Request) -> Option<Form> {
        if *request != self.asked {
            return None;
        }
        let nothing = |section: &Section| Section { title: section.title.clone(), definitions: Vec::new() };
        let mut sections: Vec<Section> = source.sections.iter().map(nothing).collect();
        // The last one comes after all of the source.
        let (last, known) = self.form.sections.split_last()?;
        let mut from = 0;
        for section in known.iter().filter(|section| !section.definitions.is_empty()) {
            let place = from + sections[from..].iter().position(|there| there.title == section.title)?;
            sections[place].definitions.clone_from(&section.definitions);
            from = place + 1;
        }
        sections.push(last.clone());
        Some(Form { sections, ..self.form.clone() })
    }
}

/// Lowers sections of definitions and the requested functions to one program.
///
/// Pivots are computed as the rates compute them where these are requested first, otherwise in a form of their own.
///
/// # Errors
/// [`Error::Program`] when a symbol is used before its definition, or a condition depends on more than parameters;
/// [`Error::OutOfRange`] when a constant does not fit an `f64`; [`Error::OverBudget`].
pub fn lower(
    graph: &mut Graph,
    inputs: &Inputs,
    sections: &[Section],
    conditions: &[ParamCondition],
    requests: &[Request],
    budget: &SearchBudget,
) -> Result<Program, Error> {
    lower_with(graph, inputs, sections, conditions, requests, (budget, None))
}

/// Searches the form of the rates that costs least, for all programs by continuations of this graph: [`lower_with`].
///
/// # Errors
/// As [`lower`].
pub fn search_rates(
    graph: &mut Graph,
    inputs: &Inputs,
    sections: &[Section],
    conditions: &[ParamCondition],
    asked: Request,
    budget: &SearchBudget,
) -> Result<KnownRates, Error> {
    let requests = std::slice::from_ref(&asked);
    let found = Source::new(graph, inputs, sections, conditions, requests).and_then(|source| {
        let mut digits = Digits::new(graph, &source);
        functions(graph, &source, &mut digits, (budget, None))
    });
    graph.within_budget()?;
    let (mut forms, mut report) = found?;
    let (form, (_, search)) = (forms.remove(0), report.searches.remove(0));
    Ok(KnownRates { asked, form, search })
}

/// As [`lower`], with rates that are `known`, by this graph or one that it is a continuation of: these are not searched
/// again.
///
/// # Errors
/// As [`lower`].
pub fn lower_with(
    graph: &mut Graph,
    inputs: &Inputs,
    sections: &[Section],
    conditions: &[ParamCondition],
    requests: &[Request],
    (budget, known): (&SearchBudget, Option<&KnownRates>),
) -> Result<Program, Error> {
    let lowered = Source::new(graph, inputs, sections, conditions, requests)
        .and_then(|source| lowered(graph, &source, budget, known));
    // Beside a graph that is past its budget, whatever else seems wrong says nothing.
    graph.within_budget()?;
    lowered
}

/// The way from expressions to a program.
fn lowered(
    graph: &mut Graph,
    source: &Source<'_>,
    budget: &SearchBudget,
    known: Option<&KnownRates>,
) -> Result<Program, Error> {
    let mut digits = Digits::new(graph, source);
    let (functions, report) = functions(graph, source, &mut digits, (budget, known))?;
    let conditions = pivots::conditions(graph, source, &mut digits);
    let mut program = values::program(graph, source.inputs, &functions, &conditions, source.requests)?;
    program.report = report;
    let mut check = Check::new(graph, source, &functions, &conditions);
    check.after("numbering", &program)?;
    let numbered = check.compares().then(|| program.clone());
    for (name, pass) in PASSES {
        let since = trace::start(Topic::Lower);
        pass(&mut program);
        if let Some(since) = since {
            let mut counts = Counts::default();
            program.functions.iter().for_each(|function| counts += function.counts());
            trace::tell(since, name, counts);
        }
    }
    if let Some(numbered) = numbered
        && let Err(error) = check.after("all passes", &program)
    {
        return Err(check.of_passes(numbered).err().unwrap_or(error));
    }
    if let Some(sampling) = &source.inputs.sampling {
        trace::at("rounding errors of functions");
        let since = trace::start(Topic::Lower);
        compensate(&mut program, sampling);
        if let Some(since) = since {
            let mut counts = Counts::default();
            program.functions.iter().for_each(|function| counts += function.counts());
            trace::tell(since, "rounding errors", counts);
        }
        check.after("compensation", &program)?;
    }
    verify(&program)?;
    Ok(program)
}

/// Names of the passes over a program, in order.
pub fn passes() -> impl Iterator<Item = &'static str> {
    PASSES.iter().map(|(name, _)| *name)
}

/// Runs the pass of a name on a program: for tests of one pass.
///
/// # Errors
/// [`Error::UnknownName`].
pub fn run_pass(name: &str, program: &mut Program) -> Result<(), Error> {
    let pass = PASSES.iter().find(|(known, _)| *known == name).ok_or_else(|| Error::UnknownName {
        name: name.to_owned(),
        kind: "pass",
        known: passes().map(str::to_owned).collect(),
    })?;
    (pass.1)(program);
    Ok(())
}

/// Every function in the form that costs least, in the order of the requests.
fn functions(
    graph: &mut Graph,
    source: &Source<'_>,
    digits: &mut Digits,
    (budget, known): (&SearchBudget, Option<&KnownRates>),
) -> Result<(Vec<Form>, Report), Error> {
    let (mut functions, mut report) = (Vec::<Form>::new(), Report::default());
    for request in source.requests {
        graph.within_budget()?;
        trace::at(format_args!("search for the cheapest form of {}", request.role));
        let (since, before) = (trace::start(Topic::Lower), graph.spent());
        let search = if request.role == Role::Pivots {
            let rate = functions.iter().find(|form| form.request.role == Role::Rate);
            let (own, search) = pivots::functions(graph, source, digits, budget, request, rate)?;
            functions.extend(own);
            search
        } else if let Some((known, form)) =
            known.and_then(|known| Some((known, known.in_sections_of(source, request)?)))
        {
            functions.push(form);
            known.search.clone()
        } else {
            let (form, search) = written(graph, source, digits, budget, request)?;
            functions.push(form);
            search
        };
        if let Some(since) = since {
            trace::tell(since, &request.role, graph.spent().since(before));
        }
        report.searches.push((request.role.clone(), search));
    }
    graph.within_budget()?;
    Ok((functions, report))
}

/// A function in the form that costs least, or as loops over tables where it is mostly sums of products.
fn written(
    graph: &mut Graph,
    source: &Source<'_>,
    digits: &mut Digits,
    budget: &SearchBudget,
    request: &Request,
) -> Result<(Form, Search), Error> {
    let may_be_rolled = match request.role {
        Role::Rate | Role::Energy | Role::Output(_) | Role::Product(_) => true,
        // Guards are read by others in the form in which they are computed; a function of variables reads no state.
        _ => false,
    };
    let rolled = if may_be_rolled { roll::rolled(graph, source, budget, request) } else { None };
    let Some((rolled, rest)) = rolled else { return form::cheapest(graph, source, digits, budget, request) };
    graph.within_budget()?;
    let scalars: Vec<ExprId> = rest.results.iter().map(|(_, e)| *e).collect();
    let source = source.with(graph, &scalars)?;
    let (form, search) = form::cheapest(graph, &source, digits, budget, &rest)?;
    Ok((Form { rolled: Some(rolled), ..form }, search))
}
