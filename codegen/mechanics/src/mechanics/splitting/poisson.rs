//! A bracket whose entries are affine in the state, by its coefficients.
//!
//! Deliberately does not know: Hamiltonians, how brackets are derived.

use std::collections::BTreeMap;

use hamel_expr::{ExprId, Graph, SymbolId};

/// `{y_i, y_j} = sum_k c_ij^k y_k + c_ij^0`, with coefficients that depend on parameters alone.
#[derive(Clone, Debug)]
pub(super) struct AffineBracket {
    /// `{y_i, y_j}`.
    pub(super) entries: Vec<Vec<ExprId>>,
    /// `c_ij^k`, with `c_ij^0` behind the others.
    coefficients: Vec<Vec<Vec<ExprId>>>,
}

impl AffineBracket {
    /// The coefficients of a bracket in the coordinates `symbols`; the position of the first entry that is not affine
    /// otherwise.
    pub(super) fn new(
        g: &mut Graph,
        symbols: &[SymbolId],
        entries: Vec<Vec<ExprId>>,
    ) -> Result<AffineBracket, (usize, usize)> {
        let n = symbols.len();
        let mut coefficients = vec![vec![vec![g.zero(); n + 1]; n]; n];
        for i in 0..n {
            for j in i + 1..n {
                if entries[i][j] == g.zero() {
                    continue;
                }
                let (mut slopes, offset) = g.affine_parts(entries[i][j], symbols).ok_or((i, j))?;
                slopes.push(offset);
                for e in &mut slopes {
                    *e = as_number(g, *e);
                }
                coefficients[j][i] = slopes.iter().map(|e| g.neg(*e)).collect();
                coefficients[i][j] = slopes;
            }
        }
        Ok(AffineBracket { entries, coefficients })
    }

    /// The matrix `B` of the motion `y' = B y` of the function `v . y`, with a one behind the components of `y`.
    pub(super) fn generator(&self, g: &mut Graph, v: &[ExprId]) -> Vec<Vec<ExprId>> {
        let n = v.len();
        let mut matrix = vec![vec![g.zero(); n + 1]; n + 1];
        for (i, row) in self.coefficients.iter().enumerate() {
            for (k, entry) in matrix[i].iter_mut().enumerate() {
                let column: Vec<ExprId> = row.iter().map(|by| by[k]).collect();
                let sum = g.dot(&column, v);
                *entry = g.cancel_zero(sum);
            }
        }
        matrix
    }

    /// `Pi v`.
    pub(super) fn times(&self, g: &mut Graph, v: &[ExprId]) -> Vec<ExprId> {
        self.entries.iter().map(|row| g.dot(row, v)).collect()
    }

    /// Whether `{v . y, w . y}` vanishes identically.
    pub(super) fn commute(&self, g: &mut Graph, v: &[ExprId], w: &[ExprId]) -> bool {
        let field = self.times(g, w);
        let value = g.dot(v, &field);
        g.is_zero(value)
    }
}

/// The number that an expression is for all parameters, the expression itself where there is none: momenta that are
/// written by velocities leave ones that are hard to see.
fn as_number(g: &mut Graph, e: ExprId) -> ExprId {
    let symbols = g.free_symbols(e);
    let values = symbols.into_iter().zip(2..).map(|(symbol, n)| (symbol, g.int(n)));
    let values: BTreeMap<SymbolId, ExprId> = values.collect();
    match g.subs(e, &values) {
        Ok(value) if g.as_rational(value).is_some() && g.fingerprints_agree(e, value) => value,
        _ => e,
    }
}
