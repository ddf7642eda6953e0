//! The equations of some state variables alone, with what they need, and brackets: for those who ask about one name.
//!
//! Does not know: how equations are derived, sections of an explanation.

use std::collections::{BTreeMap, BTreeSet};

use hamel_expr::error::spell_vector;
use hamel_expr::{Definition, ExprId, Number, Style, SymbolId, identifier};
use hamel_lang::spec::Model;
use hamel_mechanics::mechanics::Equations;

/// Longest right-hand side that is written down.
const MAX_CHARACTERS: usize = 600;

/// The rates of the state variables among `names`, `d/dt Omega1 = ..`, and behind them the definitions that they need,
/// in order; each as left and right side in Unicode. A right side that is too long to be read is `..`.
pub fn rates(equations: &Equations, names: &[&str]) -> Vec<(String, String)> {
    let g = &equations.labelled();
    let name = |symbol: SymbolId| identifier(g.name(symbol), Style::Unicode);
    let definitions: Vec<&Definition> = equations.sections.iter().flat_map(|s| &s.definitions).collect();
    let values: BTreeMap<SymbolId, ExprId> = definitions.iter().map(|d| (d.symbol, d.expr)).collect();
    let written = |e: ExprId| {
        let text = g.display(e, Style::Unicode);
        if text.chars().count() > MAX_CHARACTERS { "..".to_owned() } else { text }
    };
    let (mut rows, mut pending, mut used) = (Vec::new(), Vec::new(), BTreeSet::new());
    for state in equations.state.iter().filter(|s| names.contains(&s.name.as_str())) {
        // A rate that has a name is written out, where it is nothing else than that name.
        let symbols = g.free_symbols(state.derivative);
        let named = symbols.iter().find(|s| symbols.len() == 1 && written(state.derivative) == name(**s));
        let value = named.and_then(|s| values.get(s)).copied().unwrap_or(state.derivative);
        let left = format!("d/dt {}", identifier(&state.name, Style::Unicode));
        rows.push((left, written(value)));
        pending.push(value);
    }
    while let Some(e) = pending.pop() {
        for symbol in g.free_symbols(e) {
            if let Some(value) = values.get(&symbol)
                && used.insert(symbol)
            {
                pending.push(*value);
            }
        }
    }
    rows.extend(
        definitions.iter().filter(|d| used.contains(&d.symbol)).map(|d| (name(d.symbol), written(d.expr))),
    );
    rows
}

/// The brackets of the basis of a model's algebra that do not vanish, `[e1, e2] = e3`, as left and right side in
/// Unicode.
pub fn brackets(model: &Model) -> Vec<(String, String)> {
    let algebra = &model.algebra;
    let basis: Vec<String> = algebra.basis().iter().map(|b| identifier(b, Style::Unicode)).collect();
    let row = |(a, b, value): (usize, usize, &[(usize, Number)])| {
        let mut dense = vec![Number::default(); algebra.dim()];
        value.iter().for_each(|(c, q)| dense[*c] = q.clone());
        (format!("[{}, {}]", basis[a], basis[b]), spell_vector(&basis, &dense))
    };
    algebra.brackets().map(row).collect()
}
