//! Parameters fixed to numbers, and inputs held at them: folded into every expression of a model before anything is
//! derived.
//!
//! Does not know: what the expressions are for.

use std::collections::BTreeMap;

use hamel_expr::error::Error;
use hamel_expr::{DivisionByZero, ExprId, Rational, Style, SymbolId};
use hamel_lang::spec::{self, Diagnostics, Model, Relation};

/// A model whose fixed parameters are replaced by their values everywhere, without the conditions that have become
/// true.
///
/// # Errors
/// Unknown parameters, values at which a denominator of the model vanishes or an expression of numbers has no value,
/// and conditions that have become false.
pub fn with_fixed(mut model: Model, fixed: &[(String, Rational)]) -> Result<Model, Diagnostics> {
    let mut values = BTreeMap::new();
    let mut unknown = Vec::new();
    for (name, value) in fixed {
        let list = match model.inputs.iter().any(|input| input.name == *name) {
            true => &mut model.inputs,
            false => &mut model.params,
        };
        match list.iter().position(|p| p.name == *name) {
            Some(k) => {
                let symbol = list.remove(k).symbol;
                values.insert(symbol, model.graph.rational(value.clone()));
            }
            None => unknown.push(name.clone()),
        }
    }
    let known: Vec<String> = model.params.iter().map(|p| p.name.clone()).collect();
    let problems: Vec<spec::Diagnostic> = unknown
        .into_iter()
        .map(|name| model.diagnose(&Error::UnknownName { name, kind: "parameter", known: known.clone() }))
        .collect();
    if !problems.is_empty() {
        return Err(model.diagnostics(problems));
    }
    if !values.is_empty() && substitute(&mut model, &values).is_err() {
        let (message, _) = Error::DivisionByZero { place: "the fixed parameters".into() }.message_and_help();
        let help = "a denominator of the model vanishes at these values";
        return Err(model.diagnostics(vec![spec::diagnose(&model, None, message, help)]));
    }
    let roots: Vec<ExprId> = model.expressions().into_iter().map(|(_, e)| e).collect();
    if !values.is_empty()
        && let Some(e) = model.graph.without_value(&roots)
    {
        let text = model.graph.display(e, Style::Plain);
        let message = format!("`{text}` is no real number with the fixed parameters");
        return Err(model.diagnostics(vec![spec::diagnose(
            &model,
            None,
            message,
            "fix them to other values",
        )]));
    }
    without_settled_conditions(model)
}

/// A model whose inputs are held at their defaults, those of `taken` excepted.
///
/// # Errors
/// As [`with_fixed`].
pub fn with_held_inputs(model: Model, taken: &[String]) -> Result<Model, Diagnostics> {
    let held = model.inputs.iter().filter(|input| !taken.contains(&input.name));
    let held: Vec<(String, Rational)> = held.map(|i| (i.name.clone(), i.default.clone())).collect();
    if held.is_empty() { Ok(model) } else { with_fixed(model, &held) }
}

fn substitute(model: &mut Model, values: &BTreeMap<SymbolId, ExprId>) -> Result<(), DivisionByZero> {
    let (graph, expressions) = model.expressions_mut();
    for (_, e) in expressions {
        *e = graph.subs(*e, values)?;
    }
    Ok(())
}

/// A model without the conditions on numbers alone, which have to hold.
fn without_settled_conditions(mut model: Model) -> Result<Model, Diagnostics> {
    let mut broken = Vec::new();
    let graph = &mut model.graph;
    model.conditions.retain(|c| {
        let difference = graph.sub(c.greater, c.less);
        let Some(value) = graph.as_rational(difference) else { return true };
        let zero = Rational::from_integer(0.into());
        let holds = match c.relation {
            Relation::Greater => *value > zero,
            Relation::GreaterEqual => *value >= zero,
            Relation::NotEqual => *value != zero,
        };
        if !holds {
            broken.push(c.clone());
        }
        false
    });
    if broken.is_empty() {
        return Ok(model);
    }
    let problems = broken.iter().map(|c| {
        let message = format!("fixed parameters violate the condition {}", c.text);
        spec::diagnose(&model, c.span, message, "fix them to other values")
    });
    Err(model.diagnostics(problems.collect()))
}
