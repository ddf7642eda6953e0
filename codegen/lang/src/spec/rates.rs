//! Derivatives by time of what is made of coordinates, time and parameters.
//!
//! Deliberately does not know: which velocities a model has.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Graph, SymbolId};

/// Rates of symbols: of coordinates, of the time and, zero, of parameters.
pub(super) type Rates = BTreeMap<SymbolId, ExprId>;

/// Angular velocities of rotation matrices, by the entries of these: one number in the plane, three in space, in the
/// turned frame.
pub(super) type Spins = BTreeMap<Vec<ExprId>, Vec<ExprId>>;

/// The rate of an expression, or the first symbol in it whose rate is not known.
pub(super) fn rate_of(g: &mut Graph, e: ExprId, rates: &Rates) -> Result<ExprId, SymbolId> {
    match g.free_symbols(e).into_iter().find(|symbol| !rates.contains_key(symbol)) {
        Some(symbol) => Err(symbol),
        None => Ok(g.derivative_along(e, rates)),
    }
}
