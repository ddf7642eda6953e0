//! Velocities along what constraints leave, where constraints are solved by dividing by what their solutions do not
//! divide by: at `cos phi = 0` two wheels of a snakeboard say the same, and the board still has one way to go.
//!
//! Does not know: symmetries.

use std::collections::BTreeSet;

use hamel_expr::{ExprId, Rational, SymbolId};
use num_traits::One;

use super::section::Section;
use super::setting::Setting;

/// Minors of more rows are not multiplied out.
const MAX_ROWS: usize = 3;

impl Setting<'_> {
    /// Replaces `m` equations between `m + 1` velocities, `W y = 0`, whose minors share a factor that depends on the
    /// state: with `n` the minors without it, `W n = 0`, and `y = n s` by a velocity `s`. Where `W` has rank `m` both
    /// say the same.
    pub(super) fn along_solutions(
        &mut self,
        constraints: &mut Vec<(String, ExprId)>,
        section: &Section,
    ) -> Vec<SymbolId> {
        let mut along = Vec::new();
        for block in self.blocks(constraints, section) {
            let Some((symbol, rows)) = self.along_solution(constraints, &block, section) else { continue };
            along.push(symbol);
            let first = block[0];
            for (place, row) in rows.into_iter().enumerate() {
                let name = match block.get(place) {
                    Some(k) => constraints[*k].0.clone(),
                    None => format!("{}_{}", constraints[first].0, place + 1),
                };
                match block.get(place) {
                    Some(k) => constraints[*k] = (name, row),
                    None => constraints.push((name, row)),
                }
            }
        }
        along
    }

    /// Constraints that have velocities in common.
    fn blocks(&self, constraints: &[(String, ExprId)], section: &Section) -> Vec<Vec<usize>> {
        let velocities: BTreeSet<SymbolId> = section.velocities().iter().copied().collect();
        let mut blocks: Vec<(Vec<usize>, BTreeSet<SymbolId>)> = Vec::new();
        for (k, (_, residual)) in constraints.iter().enumerate() {
            let own = self.graph.free_symbols(*residual).intersection(&velocities).copied().collect();
            let (joined, apart): (Vec<_>, Vec<_>) =
                blocks.into_iter().partition(|(_, of)| !of.is_disjoint(&own));
            blocks = apart;
            let mut block = (vec![k], own);
            for (rows, of) in joined {
                block.0.extend(rows);
                block.1.extend(of);
            }
            block.0.sort_unstable();
            blocks.push(block);
        }
        blocks.into_iter().map(|(rows, _)| rows).collect()
    }

    fn along_solution(
        &mut self,
        constraints: &[(String, ExprId)],
        block: &[usize],
        section: &Section,
    ) -> Option<(SymbolId, Vec<ExprId>)> {
        let m = block.len();
        let mut of_block: BTreeSet<SymbolId> = BTreeSet::new();
        for k in block {
            of_block.extend(self.graph.free_symbols(constraints[*k].1));
        }
        let unknowns: Vec<SymbolId> =
            section.velocities().iter().copied().filter(|y| of_block.contains(y)).collect();
        if unknowns.len() != m + 1 || !(2..=MAX_ROWS).contains(&m) {
            return None;
        }
        let mut rows = Vec::with_capacity(m);
        for k in block {
            let (row, offset) = self.graph.affine_parts(constraints[*k].1, &unknowns)?;
            if !self.graph.is_zero(offset) {
                return None;
            }
            rows.push(row);
        }
        let mut minors = Vec::with_capacity(m + 1);
        for j in 0..=m {
            let columns: Vec<usize> = (0..=m).filter(|c| *c != j).collect();
            let minor = self.determinant(&rows, &columns);
            let signed = if j % 2 == 0 { minor } else { self.graph.neg(minor) };
            let expanded = self.graph.expand(signed);
            minors.push(self.graph.cancel_zero(expanded));
        }
        let constants: BTreeSet<SymbolId> = self.model.params.iter().map(|p| p.symbol).collect();
        let shared = self.graph.shared_factors(&minors);
        if !shared.iter().any(|(base, _)| !self.graph.free_symbols(*base).is_subset(&constants)) {
            return None;
        }
        let mut direction: Vec<ExprId> =
            minors.iter().map(|minor| self.graph.without_factors(*minor, &shared)).collect();
        // A positive first entry with coprime numbers.
        let first = direction.iter().copied().find(|e| *e != self.graph.zero())?;
        let scale = self.graph.primitive_part(first).0 * self.graph.split_coefficient(first).0;
        let inverse = Rational::one() / scale;
        direction = direction.into_iter().map(|e| self.graph.scale(e, &inverse)).collect();
        for row in &rows {
            let product = self.graph.dot(row, &direction);
            if !self.graph.is_zero(product) {
                return None;
            }
        }
        let name = self.free_name("s");
        let symbol = self.graph.symbol(&name);
        let speed = self.graph.sym(symbol);
        let residuals = unknowns.iter().zip(&direction).map(|(y, n)| {
            let (y, along) = (self.graph.sym(*y), self.graph.mul(*n, speed));
            self.graph.sub(y, along)
        });
        Some((symbol, residuals.collect()))
    }

    fn determinant(&mut self, rows: &[Vec<ExprId>], columns: &[usize]) -> ExprId {
        let [column, rest @ ..] = columns else { return self.graph.one() };
        let mut terms = Vec::new();
        for r in 0..rows.len() {
            let others: Vec<Vec<ExprId>> =
                rows.iter().enumerate().filter(|(k, _)| *k != r).map(|(_, row)| row.clone()).collect();
            let minor = self.determinant(&others, rest);
            let term = self.graph.mul(rows[r][*column], minor);
            terms.push(if r % 2 == 0 { term } else { self.graph.neg(term) });
        }
        self.graph.sum(&terms)
    }

    /// A name that the model does not declare.
    pub(super) fn free_name(&self, wanted: &str) -> String {
        let mut name = wanted.to_owned();
        while self.model.places.declared.contains_key(&name) {
            name.push('_');
        }
        name
    }
}
