//! Chains of stages as items of a model.

use hamel_expr::{ExprId, Graph, Rational};
use num_traits::Zero;

use crate::linear::{Rows, Vector};

/// The items of a chain of stages for the velocity `name`.
pub fn chain_text(name: &str, chain: &[Rows], metric: &[Vector]) -> String {
    let combination = |v: &Vector| {
        let terms = v.iter().enumerate().filter(|(_, q)| !q.is_zero());
        terms.map(|(k, q)| format!("({q})*{name}{}", k + 1)).collect::<Vec<_>>().join(" + ")
    };
    let mut text = String::from("stage n0;\n");
    for (j, rows) in chain.iter().enumerate() {
        let spanned: Vec<String> = rows.iter().map(combination).collect();
        text.push_str(&format!("stage n{} = ideal({});\n", j + 1, spanned.join(", ")));
    }
    let rows: Vec<String> = metric
        .iter()
        .map(|row| format!("[{}]", row.iter().map(Rational::to_string).collect::<Vec<_>>().join(", ")))
        .collect();
    text + &format!("inner_product = [{}];\n", rows.join(", "))
}

/// A model's text with more items.
///
/// # Panics
/// When the text does not end with a brace.
pub fn with_items(text: &str, items: &str) -> String {
    format!("{}{items}}}\n", text.trim_end().strip_suffix('}').expect("a model ends with a brace"))
}

/// A chain of ideals as expressions.
pub fn chain_exprs(g: &mut Graph, chain: &[Rows]) -> Vec<Vec<Vec<ExprId>>> {
    let vector = |g: &mut Graph, v: &Vector| v.iter().map(|q| g.rational(q.clone())).collect();
    chain.iter().map(|rows| rows.iter().map(|v| vector(g, v)).collect()).collect()
}
