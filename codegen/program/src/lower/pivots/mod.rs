//! Pivots: everything that the rates divide by and that could vanish, from the matrix to the error that the user sees.
//!
//! 1. **Named.** `mechanics/solve` factors a matrix symbolically, in a fixed order, and gives every pivot a name that a
//!    user understands (`inertia along Omega1`), the matrix that it is of, and, where it depends on parameters alone,
//!    what it was computed from.
//! 2. **Sorted.** `scene/pivots` asks what is known of each. A pivot of definite sign needs no test, but may overflow.
//!    One that depends on parameters alone becomes a condition on them, asked once when they are prepared, with a bound
//!    on the growth of the elimination where the matrix need not be positive definite. All others are the results of
//!    the request [`Role::Pivots`]; of those that can change their sign a matrix is watched.
//! 3. **Computed.** [`functions`] takes each pivot in the very form in which [`Role::Rate`] divides by it: another form
//!    has other rounding errors, and would find a number where that one divides by zero. `divisors` adds what else that
//!    form divides by, unless it is seen to be finite and not zero everywhere.
//! 4. **Scaled.** `rounding` gives every pivot `p` the scale `s` of its rounding errors with those of the pivots before
//!    it: `p` is nothing but such errors unless `s + |p| > s`. A number that is compared with a fixed tolerance would
//!    depend on units. [`conditions`] does the same for conditions on the parameters.
//! 5. **Watched.** [`Role::Signature`] is one number made of the signs of the pivots of the watched matrices, which
//!    stays the same while none of them becomes singular, and, as its fraction, of those of single divisors.
//! 6. **Tested.** The function `check` of an emitted scene, as `scene::Interpreter::check`, calls
//!    `hamel_runtime::Pivot::verify` for each, the conditions are tested in `Prepared::new`, and an integrator that
//!    finds another signature after a step goes back to where it changed; where single divisors have changed their
//!    signs, if the slope has a pole there. The first pivot that fails is named in the error.
//!
//! Does not know: mechanics, what is done about a pivot that is lost.

mod divisors;
mod rounding;

use std::collections::BTreeSet;

use super::form::{self, Digits, Form};
use super::source::Source;
use super::{ParamCondition, Request, SearchBudget};
use crate::program::{Relation, Role, Search};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Func, Graph, Section, SymbolId, needed_sections};

pub use divisors::{Divisors, WatchedMatrix};

/// The function [`Role::Pivots`], and [`Role::Signature`] where a matrix is watched, with what became of the search for
/// the form of those pivots that the rates do not have.
///
/// # Errors
/// As [`form::cheapest`].
pub(super) fn functions(
    graph: &mut Graph,
    source: &Source<'_>,
    digits: &mut Digits,
    budget: &SearchBudget,
    request: &Request,
    rate: Option<&Form>,
) -> Result<(Vec<Form>, Search), Error> {
    let (pivots, crossed, search) = scaled_pivots(graph, source, digits, budget, request, rate)?;
    let signature = signature(graph, source, request, &pivots, &crossed);
    Ok(([pivots].into_iter().chain(signature).collect(), search))
}

/// The pivots with their scales, in the form in which the rates have them, and the single divisors among them that can
/// change their sign; a pivot that is no value of that form is computed in one of its own.
fn scaled_pivots(
    graph: &mut Graph,
    source: &Source<'_>,
    digits: &mut Digits,
    budget: &SearchBudget,
    request: &Request,
    rate: Option<&Form>,
) -> Result<(Form, Vec<ExprId>, Search), Error> {
    let sections_of_rate = rate.map_or(&[][..], |rate| rate.sections.as_slice());
    let divisors = sections_of_rate.iter().flat_map(|s| &s.definitions);
    // With what each is in the units of the pivots: whether it vanishes does not depend on its own.
    let divisors = divisors.map(|d| {
        let value = graph.sym(d.symbol);
        let unit = rate.and_then(|rate| rate.units.get(&d.symbol));
        (value, unit.map_or(value, |unit| graph.mul(*unit, value)))
    });
    let divisors: Vec<(ExprId, ExprId)> = divisors.collect();
    let in_rate = |graph: &mut Graph, pivot| {
        divisors.iter().find(|(_, whole)| graph.fingerprints_agree(*whole, pivot)).map(|(d, _)| *d)
    };
    let found: Vec<Option<ExprId>> = request.results.iter().map(|(_, e)| in_rate(graph, *e)).collect();
    let others =
        request.results.iter().zip(&found).filter(|(_, found)| found.is_none()).map(|(r, _)| r.clone());
    let others = Request { role: request.role.clone(), results: others.collect() };
    let (others, search) = form::cheapest(graph, source, digits, budget, &others)?;
    let Form { mut sections, request: others, units, .. } = others;
    let mut others = others.results.into_iter();
    let pivots = request.results.iter().zip(found).map(|((name, e), found)| match found {
        Some(in_rate) => (name.clone(), in_rate),
        None => others.next().unwrap_or_else(|| (name.clone(), *e)),
    });
    let mut results: Vec<(String, ExprId)> = pivots.collect();
    let known: Vec<ExprId> = results.iter().map(|(_, e)| *e).collect();
    let others =
        rate.map_or(Ok(Vec::new()), |rate| divisors::divisors(graph, source.inputs, rate, &known))?;
    let n_composite = others.iter().filter(|d| d.is_composite).count();
    let crossed: Vec<ExprId> = others.iter().filter(|d| d.changes_sign).map(|d| d.expr).collect();
    results.extend(others.into_iter().map(|d| (d.name, d.expr)));
    let n_single = results.len() - n_composite;
    let values: Vec<ExprId> = results.iter().map(|(_, e)| *e).collect();
    let own: BTreeSet<SymbolId> = sections.iter().flat_map(|s| &s.definitions).map(|d| d.symbol).collect();
    let nothing = Section { title: String::new(), definitions: Vec::new() };
    sections.resize(sections.len().max(sections_of_rate.len()), nothing);
    for (section, of_rate) in sections.iter_mut().zip(sections_of_rate) {
        section.definitions.extend(of_rate.definitions.iter().filter(|d| !own.contains(&d.symbol)));
    }
    let needed = needed_sections(graph, &sections, &values);
    let (mut scales, definitions) =
        rounding::rounding_scales(graph, &values[..n_single], &needed, &source.signs);
    scales.resize(values.len(), graph.zero());
    if let Some(last) = sections.last_mut() {
        last.definitions.extend(definitions);
    }
    let names: Vec<String> = results.iter().map(|(name, _)| name.clone()).collect();
    results.extend(names.into_iter().zip(scales));
    let request = Request { role: request.role.clone(), results };
    Ok((Form { sections, request, units, rolled: None }, crossed, search))
}

/// The function [`Role::Signature`], of the pivots as [`Role::Pivots`] has them and of the single divisors `crossed`;
/// none if nothing is watched.
fn signature(
    graph: &mut Graph,
    source: &Source<'_>,
    request: &Request,
    pivots: &Form,
    crossed: &[ExprId],
) -> Option<Form> {
    let watched = &source.inputs.divisors.watched;
    if watched.is_empty() && crossed.is_empty() {
        return None;
    }
    let as_computed = |pivot: &ExprId| {
        let k = request.results.iter().position(|(_, e)| e == pivot)?;
        Some(pivots.request.results.get(k)?.1)
    };
    let matrices: Vec<(bool, Vec<ExprId>)> =
        watched.iter().map(|m| (m.is_symmetric, m.pivots.iter().filter_map(as_computed).collect())).collect();
    let value = divisors::signature(graph, &matrices, crossed);
    let results = vec![(Role::Signature.name().to_owned(), value)];
    let request = Request { role: Role::Signature, results };
    Some(Form { request, ..pivots.clone() })
}

/// Conditions in the form in which they are asked, and the sections with the definitions that they are written with.
pub(super) struct Conditions {
    pub(super) sections: Vec<Section>,
    pub(super) conditions: Vec<ParamCondition>,
}

/// The conditions with scales of their rounding errors, `s + p > s` for `p > 0` and `s + |p| > s` for `p != 0`, and the
/// definitions of scales after the others.
pub(super) fn conditions(graph: &mut Graph, source: &Source<'_>, digits: &mut Digits) -> Conditions {
    let mut own = source.conditions.to_vec();
    for condition in own.iter_mut().filter(|c| c.is_rounded) {
        condition.greater = digits.best(graph, condition.greater);
    }
    let values: Vec<ExprId> = own.iter().filter(|c| c.is_rounded).map(|c| c.greater).collect();
    let needed = needed_sections(graph, source.sections, &values);
    let (scales, definitions) = rounding::rounding_scales(graph, &values, &needed, &source.signs);
    let mut scales = scales.into_iter();
    let mut sections = source.sections.to_vec();
    match sections.last_mut() {
        Some(last) => last.definitions.extend(definitions),
        None if definitions.is_empty() => {}
        None => sections.push(Section { title: String::new(), definitions }),
    }
    let conditions = own.iter().map(|condition| {
        let scale = if condition.is_rounded { scales.next() } else { None };
        let Some(scale) = scale.filter(|scale| *scale != graph.zero()) else { return condition.clone() };
        let size = match condition.relation {
            Relation::NotEqual => graph.func(Func::Abs, condition.greater),
            _ => condition.greater,
        };
        let greater = graph.add(scale, size);
        ParamCondition { greater, less: scale, relation: Relation::Greater, ..condition.clone() }
    });
    Conditions { sections, conditions: conditions.collect() }
}
