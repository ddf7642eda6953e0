//! The form in which a function is computed: which definitions it keeps, in which units, with which common factors.
//!
//! `read` turns what a function needs into `polynomial`s with `numbers` as coefficients, `search` finds the cheapest
//! form by multiplying definitions out, `extract`ing common sums and products, and measuring values in other `units`,
//! `digits` measures what forms lose to rounding, `write` turns polynomials back into definitions, and what comes out
//! is compared with what was asked for. `effort` counts the work. Does not know: values of a program, mechanics.

mod digits;
mod effort;
mod exponent;
mod extract;
mod facts;
mod numbers;
mod polynomial;
mod price;
mod read;
mod search;
mod units;
mod write;

use std::collections::BTreeMap;

use rustc_hash::FxHashMap;

use super::classes::Class;
use super::roll::Rolled;
use super::source::{Source, needed_definitions};
use super::{Request, SearchBudget};
use crate::program::{self, FallBack, Role};
use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Section, SymbolId, Vanishing};

pub(super) use digits::Digits;

use extract::Extractor;
use read::Reader;
use search::Search;
use write::Writer;

/// A function in the form in which it is computed.
#[derive(Clone, Debug)]
pub(super) struct Form {
    /// Definitions, in the sections of the source and one more.
    pub(super) sections: Vec<Section>,
    /// Results, written with these definitions.
    pub(super) request: Request,
    /// Units of definitions: the value that was asked for is the unit times the definition's. One where there is none.
    pub(super) units: BTreeMap<SymbolId, ExprId>,
    /// Loops after these definitions, of a function that is mostly sums of products: `request` is what they need then.
    pub(super) rolled: Option<Rolled>,
}

impl Form {
    /// The results of the function.
    pub(super) fn results(&self) -> &[(String, ExprId)] {
        self.rolled.as_ref().map_or(&self.request, |rolled| &rolled.asked).results.as_slice()
    }
}

/// The cheapest form of one function that the search finds, equal as a function, or the function as it was, and what
/// became of the search.
///
/// # Errors
/// [`Error::Program`] where the search finds another function, a bug, if debug assertions are on;
/// [`Error::DivisionByZero`].
pub(super) fn cheapest(
    graph: &mut Graph,
    source: &Source<'_>,
    digits: &mut Digits,
    budget: &SearchBudget,
    request: &Request,
) -> Result<(Form, program::Search), Error> {
    let roots: Vec<ExprId> = request.results.iter().map(|(_, e)| *e).collect();
    let needed_symbols = needed_definitions(graph, source.sections, &roots);
    let mut reader = Reader::new(graph, source, budget);
    for [cosine, sine] in source.circles_for(graph, &roots) {
        let [cosine, sine] = [cosine, sine].map(|s| graph.sym(s));
        reader.system.relate(cosine, sine);
    }
    for (section, s) in source.sections.iter().enumerate() {
        for definition in &s.definitions {
            if needed_symbols.contains(&definition.symbol)
                && source.classes.get(definition.expr) > Class::Param
            {
                reader.define(graph, definition.symbol, section, definition.expr)?;
            }
        }
    }
    let mut results: Vec<Option<usize>> = Vec::with_capacity(roots.len());
    for root in &roots {
        let changes = source.classes.get(*root) > Class::Param;
        results.push(if changes { Some(reader.read(graph, *root)?) } else { None });
    }
    let Reader { mut system, entries, .. } = reader;
    let kept: Vec<usize> = results.iter().flatten().copied().collect();
    let keeps_digits = request.role == Role::Rate;
    let extractor = Extractor::default();
    let search = Search { graph, system: &mut system, digits, roots: &kept, keeps_digits, extractor };
    let entries = search.run(entries);
    let (exprs, units) = (FxHashMap::default(), BTreeMap::new());
    let mut writer = Writer { graph, system: &system, entries: &entries, digits, exprs, units };
    let sections = writer.sections(source, &needed_symbols, &kept)?;
    let values = results.iter().zip(&roots).map(|(k, root)| k.map_or(*root, |k| writer.exprs[&k]));
    let values: Vec<ExprId> = values.collect();
    let units = writer.units;
    let limits = system.effort.into_limits();
    let fall_back = values.iter().zip(&roots).find_map(|(value, root)| difference(graph, *value, *root));
    if fall_back == Some(FallBack::Differs) && cfg!(debug_assertions) {
        graph.within_budget()?;
        let reason = format!("the cheaper form of {} is another function, a bug of hamel", request.role);
        return Err(Error::Program { reason });
    }
    let form = match fall_back {
        Some(_) => {
            let sections = source.sections.to_vec();
            Form { sections, request: request.clone(), units: BTreeMap::new(), rolled: None }
        }
        None => {
            let names = request.results.iter().map(|(name, _)| name.clone());
            let request = Request { role: request.role.clone(), results: names.zip(values).collect() };
            Form { sections, request, units, rolled: None }
        }
    };
    Ok((form, program::Search { limits, fall_back }))
}

/// Why a value cannot take the place of the one that was asked for; none where both are equal.
///
/// Values at random points see through definitions, so that functions of the inputs are compared. Roots that are tied
/// by more than their squares, as `sqrt(a b)` and `sqrt(a) sqrt(b)`, are known up to their signs there: then
/// `(v - a) (v + a) = 0` with `v + a` other than zero says that both are equal, as both are analytic where roots are
/// positive, and no real point was found at which they differ.
fn difference(graph: &mut Graph, value: ExprId, asked: ExprId) -> Option<FallBack> {
    if graph.fingerprints_agree(value, asked) {
        return None;
    }
    let difference = graph.sub(value, asked);
    match graph.vanishing(difference) {
        Vanishing::Zero => None,
        Vanishing::NonZero => Some(FallBack::Differs),
        Vanishing::Unknown => {
            let (sum, squares) = (graph.add(value, asked), [value, asked].map(|e| graph.powi(e, 2)));
            let difference = graph.sub(squares[0], squares[1]);
            let is_either = graph.vanishing(difference) == Vanishing::Zero;
            let is_equal = is_either && graph.vanishing(sum) == Vanishing::NonZero;
            (!is_equal).then_some(FallBack::Unknown)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hamel_expr::{Func, Rational};

    #[test]
    fn what_differs_is_told_from_what_is_not_known() {
        let mut g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name)).map(|s| g.sym(s));
        let (sum, other) = (g.add(x, y), g.sub(x, y));
        let product = g.mul(sum, other);
        let (xx, yy) = (g.powi(x, 2), g.powi(y, 2));
        let squares = g.sub(xx, yy);
        assert_eq!(difference(&mut g, product, squares), None);
        assert_eq!(difference(&mut g, product, xx), Some(FallBack::Differs));
        // acos(x) + asin(x) = pi/2, of which the zero test knows nothing.
        let (inverse_cosine, inverse_sine) = (g.func(Func::Acos, x), g.func(Func::Asin, x));
        let (whole, pi) = (g.add(inverse_cosine, inverse_sine), g.pi());
        let half = g.scale(pi, &Rational::new(1.into(), 2.into()));
        assert_eq!(difference(&mut g, whole, half), Some(FallBack::Unknown));
    }

    #[test]
    fn roots_that_are_tied_by_more_than_their_squares_are_compared() {
        let mut g = Graph::new();
        let [x, y, z] = ["x", "y", "z"].map(|name| g.symbol(name)).map(|s| g.sym(s));
        let half = Rational::new(1.into(), 2.into());
        // sqrt(x (y + z)), multiplied out and by factors.
        let sum = g.add(y, z);
        let (xy, xz) = (g.mul(x, y), g.mul(x, z));
        let flat = g.add(xy, xz);
        let [whole, first, second] = [flat, x, sum].map(|e| g.pow(e, &half).unwrap());
        let parts = g.mul(first, second);
        let open = g.sub(parts, whole);
        assert_eq!(g.vanishing(open), Vanishing::Unknown);
        assert_eq!(difference(&mut g, parts, whole), None);
        let negative = g.neg(parts);
        assert!(difference(&mut g, negative, whole).is_some());
        // sqrt((x + y)^2) is not x + y where that is negative.
        let (xx, yy, two_xy) = (g.powi(x, 2), g.powi(y, 2), g.scale(xy, &Rational::from_integer(2.into())));
        let square = [xx, two_xy, yy].into_iter().reduce(|a, b| g.add(a, b)).unwrap();
        let (root, base) = (g.pow(square, &half).unwrap(), g.add(x, y));
        assert_eq!(difference(&mut g, root, base), Some(FallBack::Differs));
    }
}
