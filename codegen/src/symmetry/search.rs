//! Which fields keep which functions: linear conditions on coefficients, guessed from values and proved.
//!
//! Does not know: how a model is reduced by them.

use hamel_expr::{ExprId, Rational, SymbolId, rational_relations};
use num_traits::Zero;

use super::setting::{Images, Setting};

/// A field by its coefficients in the ansatz.
pub(super) type Coefficients = Vec<Rational>;

/// Functions that a field has to keep, and equations that it has to keep as a whole.
pub(super) struct Kept {
    pub(super) functions: Vec<ExprId>,
    pub(super) equations: Vec<ExprId>,
}

impl Setting<'_> {
    /// What the motion follows from.
    pub(super) fn everything(&self) -> Kept {
        let functions = vec![self.kinetic, self.potential, self.power];
        Kept { functions, equations: self.constraints.clone() }
    }

    /// A basis of the fields of the ansatz that keep these, each with a last coefficient one that is zero in the
    /// others: `X f = 0`, and `X phi_c = sum_d lambda_cd phi_d` with numbers `lambda`.
    pub(super) fn symmetries(&mut self, kept: &Kept) -> Vec<Coefficients> {
        let all: Vec<usize> = (0..self.generators.len()).collect();
        self.symmetries_among(&all, kept)
    }

    /// As [`Setting::symmetries`], among some fields of the ansatz.
    pub(super) fn symmetries_among(&mut self, among: &[usize], kept: &Kept) -> Vec<Coefficients> {
        let n_rows = kept.functions.len() + kept.equations.len();
        let zero = self.graph.zero();
        let mut columns = Vec::new();
        for c in 0..kept.equations.len() {
            for phi in &kept.equations {
                let mut column = vec![zero; n_rows];
                column[kept.functions.len() + c] = self.on_groups(*phi);
                columns.push(column);
            }
        }
        let n_equations = columns.len();
        for j in among.iter().copied() {
            let images = self.generator(j).clone();
            let all: Vec<ExprId> = kept.functions.iter().chain(&kept.equations).copied().collect();
            let column = all.into_iter().map(|f| {
                let slope = self.graph.derivative_along(f, &images);
                self.on_groups(slope)
            });
            columns.push(column.collect());
        }
        let relations = self.null_space(&columns);
        let fields = relations.into_iter().map(|relation| {
            let mut field = vec![Rational::zero(); self.generators.len()];
            for (j, q) in among.iter().zip(&relation[n_equations..]) {
                field[*j] = q.clone();
            }
            field
        });
        fields.filter(|field| field.iter().any(|q| !q.is_zero())).collect()
    }

    /// Relations between columns, each with a last coefficient one that is zero in the others; proved.
    pub(super) fn null_space(&mut self, columns: &[Vec<ExprId>]) -> Vec<Vec<Rational>> {
        let n_rows = columns.first().map_or(0, Vec::len);
        let mut relations = rational_relations(&mut self.graph, columns);
        relations.retain(|relation| {
            (0..n_rows).all(|r| {
                let terms: Vec<(ExprId, Rational)> =
                    columns.iter().zip(relation).map(|(column, q)| (column[r], q.clone())).collect();
                let sum = self.graph.linear_combination(&terms);
                self.graph.is_zero(sum)
            })
        });
        relations
    }

    /// Whether a field keeps functions and equations; proved.
    pub(super) fn keeps(&mut self, field: &Images, kept: &Kept) -> bool {
        let functions = kept.functions.iter().all(|f| {
            let slope = self.graph.derivative_along(*f, field);
            self.vanishes(slope)
        });
        functions
            && kept.equations.iter().all(|phi| {
                let slope = self.graph.derivative_along(*phi, field);
                self.combination(&kept.equations, slope).is_some()
            })
    }

    /// Rational numbers `c` with `f = sum c_i basis_i` on the groups; proved.
    pub(super) fn combination(&mut self, basis: &[ExprId], f: ExprId) -> Option<Vec<Rational>> {
        let rows: Vec<Vec<ExprId>> = basis.iter().map(|e| vec![*e]).collect();
        self.combination_of_rows(&rows, &[f])
    }

    /// As [`Setting::combination`] in several rows at once.
    pub(super) fn combination_of_rows(
        &mut self,
        basis: &[Vec<ExprId>],
        f: &[ExprId],
    ) -> Option<Vec<Rational>> {
        let all: Vec<Vec<ExprId>> =
            basis.iter().map(Vec::as_slice).chain([f]).map(<[ExprId]>::to_vec).collect();
        let columns: Vec<Vec<ExprId>> =
            all.iter().map(|column| column.iter().map(|e| self.on_groups(*e)).collect()).collect();
        let relation = rational_relations(&mut self.graph, &columns).pop()?;
        let last = relation.last().filter(|q| !q.is_zero())?.clone();
        let holds = (0..f.len()).all(|r| {
            let terms: Vec<(ExprId, Rational)> =
                columns.iter().zip(&relation).map(|(column, q)| (column[r], q.clone())).collect();
            let sum = self.graph.linear_combination(&terms);
            self.graph.is_zero(sum)
        });
        holds.then(|| relation[..basis.len()].iter().map(|q| -(q / &last)).collect())
    }

    /// `[X, Y]` of two fields on the coordinates, as images of all of these.
    pub(super) fn bracket(&mut self, x: &Images, y: &Images) -> Vec<ExprId> {
        let zero = self.graph.zero();
        let mut entries = Vec::new();
        for symbol in self.coordinates() {
            let [of_x, of_y] = [x, y].map(|field| field.get(&symbol).copied().unwrap_or(zero));
            let (forward, backward) =
                (self.graph.derivative_along(of_y, x), self.graph.derivative_along(of_x, y));
            entries.push(self.graph.sub(forward, backward));
        }
        entries
    }

    /// The images of all coordinates under a field.
    pub(super) fn on_coordinates(&self, field: &Images) -> Vec<ExprId> {
        let image = |symbol| field.get(&symbol).copied().unwrap_or(self.graph.zero());
        self.coordinates().into_iter().map(image).collect()
    }

    fn coordinates(&self) -> Vec<SymbolId> {
        let base = self.model.base.iter().map(|c| c.symbol);
        base.chain(self.model.configurations.iter().flat_map(|c| c.symbols.iter().copied())).collect()
    }
}
