//! Linear systems as definitions: `A x = b` by symbolic elimination whose pivots have names.

use std::collections::BTreeMap;
use std::ops::Range;

use num_traits::Signed;

use hamel_expr::error::Error;
use hamel_expr::{
    Definition, ExprId, Fractions, Graph, Node, Rational, SectionWriter, Sign, Style, SymbolId, Vanishing,
    inlined, sign_of,
};
use hamel_lang::algebra::tableau::{Grade, Judge, Known};

use super::order::order_of_pivots;

/// Something that is divided by.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pivot {
    /// What it is, for the user: `inertia along Omega1`.
    pub name: String,
    /// Its value.
    pub expr: ExprId,
    /// The matrix that it is a pivot of.
    pub matrix: PivotMatrix,
    /// Where it comes from, if all of that depends on parameters alone.
    pub origin: Option<PivotOrigin>,
}

impl Pivot {
    /// What the coefficients of constraints, or of a change of frame, are divided by.
    pub(super) fn of_coefficients(name: &str, expr: ExprId) -> Pivot {
        let matrix = PivotMatrix { name: "C".into(), is_symmetric: false, follows_hessian: false };
        Pivot { name: name.to_owned(), expr, matrix, origin: None }
    }
}

/// The matrix that a pivot is of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PivotMatrix {
    /// What it is called in definitions: `A`, `M` for the Hessian, `S` for the response to multipliers, `C` for the
    /// coefficients of constraints and of a change of frame.
    pub name: String,
    /// Whether it was factored as `L D L^T`: by Sylvester's law of inertia as many pivots are negative as eigenvalues.
    pub is_symmetric: bool,
    /// Whether it has no negative eigenvalue where the Hessian of the Lagrangian has none: `Psi^T L_yy Psi`.
    pub follows_hessian: bool,
}

/// What a pivot `d_k = a_kk - sum_j l_kj d_j u_jk` is computed from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PivotOrigin {
    /// `a_kk`.
    pub entry: ExprId,
    /// `l_kj`, `d_j`, `u_jk` of the pivots before it.
    pub updates: Vec<[ExprId; 3]>,
    /// Entries of the matrix in row and column `k` that depend on parameters alone.
    pub entries: Vec<ExprId>,
}

/// `A` factored as `L D L^T` (symmetric) or `L D U` (general) with unit triangular `L` and `U`, in the order `order`.
///
/// The last two unknowns are not eliminated where their determinant is a number and no pivot would be: Cramer's rule
/// then needs no division. (A plate on its edge: its inertia about the contact differs from a multiple of the unit
/// matrix by one direction, whichever that is.)
///
/// # Shapes
/// `lower[i][j]`, `upper[j][i]` for `j < i`, `pivots[i]`, all in elimination order; with a block, its determinant is
/// the last pivot.
#[derive(Clone, Debug)]
pub struct Factorisation {
    row_order: Vec<usize>,
    column_order: Vec<usize>,
    lower: Vec<Vec<ExprId>>,
    upper: Vec<Vec<ExprId>>,
    pivots: Vec<ExprId>,
    /// What remains for the last two unknowns.
    block: Option<[[ExprId; 2]; 2]>,
    prefix: String,
    is_symmetric: bool,
    /// Of each pivot.
    origins: Vec<Option<PivotOrigin>>,
}

/// Whether `a_ij = a_ji` as functions.
pub(super) fn is_symmetric(g: &mut Graph, a: &[Vec<ExprId>]) -> bool {
    (0..a.len()).all(|i| (0..i).all(|j| g.is_equal(a[i][j], a[j][i])))
}

/// Sums of more terms are not multiplied out.
const MAX_TERMS: usize = 32;

/// `a_ij - a_ik a_kj/a_kk = (a_ij a_kk - a_ik a_kj)/a_kk` for polynomials in the parameters, where terms cancel in the
/// numerator: those digits are not lost then, and a sum of positive terms shows that a pivot is positive.
///
/// `entries` are `a_ij, a_kk, a_ik, a_kj`, `values` those of the names in them, `pivot` is `a_kk` as it is to be
/// written.
fn gathered(
    g: &mut Graph,
    values: &BTreeMap<SymbolId, ExprId>,
    entries: [ExprId; 4],
    pivot: ExprId,
) -> Option<ExprId> {
    let [a_ij, a_kk, a_ik, a_kj] = g.subs_all(&entries, values).ok()?.try_into().ok()?;
    let mut n_terms = 0;
    let mut products = Vec::new();
    for (a, b) in [(a_ij, a_kk), (a_ik, a_kj)] {
        let (a, b) = (g.expand(a), g.expand(b));
        if g.summands(a).len().max(g.summands(b).len()) > MAX_TERMS {
            return None;
        }
        let product = g.mul(a, b);
        let product = g.expand(product);
        n_terms += g.summands(product).len();
        products.push(product);
    }
    let difference = g.sub(products[0], products[1]);
    let numerator = g.expand(difference);
    let is_polynomial = |g: &Graph, e: ExprId| {
        g.reachable(&[e]).into_iter().all(|e| match g.node(e) {
            Node::Product { factors, .. } => factors.iter().all(|(_, q)| q.is_integer() && q.is_positive()),
            Node::Function(..) => false,
            _ => true,
        })
    };
    if g.summands(numerator).len() >= n_terms || !is_polynomial(g, numerator) {
        return None;
    }
    let inverse = g.powi(pivot, -1);
    Some(g.mul(numerator, inverse))
}

/// A number with everything cancelled in it, where its sign shows that way only.
fn seen_to_be_definite(
    g: &mut Graph,
    fractions: &mut Fractions,
    values: &BTreeMap<SymbolId, ExprId>,
    signs: &BTreeMap<ExprId, Sign>,
    e: ExprId,
) -> ExprId {
    let Ok(whole) = g.subs(e, values) else { return e };
    if sign_of(g, whole, signs).is_definite() {
        return e;
    }
    let normal = fractions.normal(g, whole);
    if sign_of(g, normal, signs).is_definite() && g.fingerprints_agree(normal, e) { normal } else { e }
}

impl Factorisation {
    /// Factors `a`, writing the entries of the factors as definitions prefixed by `prefix`.
    ///
    /// The unknowns `leading` are eliminated first, so that [`Factorisation::solve_leading`] can solve their block
    /// alone.
    ///
    /// Symmetric matrices keep their symmetry: pivots stay on the diagonal, ordered once by sparsity. A diagonal that
    /// vanishes, or is not proved not to, or a matrix that is not symmetric, gets general elimination with the
    /// best-ranked non-zero pivot. A pivot that `signs` of parameters show to be definite once everything in it has
    /// cancelled is written that way.
    ///
    /// # Errors
    /// [`Error::SingularMassMatrix`] with a null direction spelled in `names`.
    pub fn new(
        g: &mut Graph,
        writer: &mut SectionWriter,
        prefix: &str,
        a: &[Vec<ExprId>],
        names: &[String],
        signs: &BTreeMap<ExprId, Sign>,
        leading: &[usize],
    ) -> Result<Factorisation, Error> {
        let n = a.len();
        let mut symmetric = is_symmetric(g, a);
        let mut order: Vec<usize> = (0..n).collect();
        if symmetric {
            order = order_of_pivots(g, writer, a, leading);
        } else {
            order.sort_by_key(|i| !leading.contains(i));
        }
        let mut f = Factorisation {
            row_order: order.clone(),
            column_order: order,
            lower: vec![vec![g.zero(); n]; n],
            upper: vec![vec![g.zero(); n]; n],
            pivots: Vec::new(),
            block: None,
            prefix: prefix.to_owned(),
            is_symmetric: symmetric,
            origins: Vec::new(),
        };
        let constant: Vec<Definition> =
            writer.definitions().filter(|d| !writer.varies(g, d.expr)).copied().collect();
        let constant = inlined(g, &constant);
        let mut fractions = Fractions::default();
        // `rest` is the Schur complement in the current order.
        let mut rest: Vec<Vec<ExprId>> =
            f.row_order.iter().map(|&i| f.column_order.iter().map(|&j| a[i][j]).collect()).collect();
        for k in 0..n {
            g.within_budget()?;
            if !symmetric || g.vanishing(rest[k][k]) != Vanishing::NonZero {
                symmetric = false;
                f.is_symmetric = false;
                let end = if k < leading.len() { leading.len() } else { n };
                f.choose_pivot(g, writer, &mut rest, k..end).ok_or_else(|| singular(g, a, names))?;
            }
            let label = |i: usize| f.column_order[i] + 1;
            if k + 2 == n
                && (leading.len() <= k || leading.len() == n)
                && writer.varies(g, rest[k][k])
                && let Some(determinant) = constant_determinant(g, writer, &rest)
            {
                f.pivots.push(writer.define(g, &format!("{prefix}_det"), determinant));
                f.origins.push(None);
                f.block = Some([k, k + 1].map(|i| {
                    [k, k + 1].map(|j| {
                        let name = format!("{prefix}_b{}_{}", label(i), label(j));
                        writer.define(g, &name, rest[i][j])
                    })
                }));
                break;
            }
            let pivot = writer.define(g, &format!("{prefix}_d{}", label(k)), rest[k][k]);
            f.pivots.push(pivot);
            f.origins.push(f.origin(g, writer, a, k));
            let inverse = g.powi(pivot, -1);
            for i in k + 1..n {
                let below = g.mul(rest[i][k], inverse);
                f.lower[i][k] = writer.define(g, &format!("{prefix}_l{}_{}", label(i), label(k)), below);
            }
            for j in k + 1..n {
                f.upper[k][j] = if symmetric {
                    f.lower[j][k]
                } else {
                    let right = g.mul(rest[k][j], inverse);
                    writer.define(g, &format!("{prefix}_u{}_{}", label(k), label(j)), right)
                };
            }
            for i in k + 1..n {
                for j in k + 1..n {
                    if symmetric && j < i {
                        rest[i][j] = rest[j][i];
                        continue;
                    }
                    if f.lower[i][k] == g.zero() || rest[k][j] == g.zero() {
                        continue;
                    }
                    let entries = [rest[i][j], rest[k][k], rest[i][k], rest[k][j]];
                    let varies = entries.iter().any(|e| writer.varies(g, *e));
                    let gathered = if varies { None } else { gathered(g, &constant, entries, pivot) };
                    let mut reduced = gathered.unwrap_or_else(|| {
                        let product = g.mul(f.lower[i][k], rest[k][j]);
                        g.sub(rest[i][j], product)
                    });
                    if !varies && i == j {
                        reduced = seen_to_be_definite(g, &mut fractions, &constant, signs, reduced);
                    }
                    rest[i][j] = writer.define(
                        g,
                        &format!("{prefix}_s{}_{}_{}", label(k), label(i), label(j)),
                        reduced,
                    );
                }
            }
        }
        Ok(f)
    }

    /// What pivot `k`, the last one found, is computed from.
    fn origin(&self, g: &Graph, writer: &SectionWriter, a: &[Vec<ExprId>], k: usize) -> Option<PivotOrigin> {
        let (row, column) = (self.row_order[k], self.column_order[k]);
        let entry = a[row][column];
        let updates: Vec<[ExprId; 3]> =
            (0..k).map(|j| [self.lower[k][j], self.pivots[j], self.upper[j][k]]).collect();
        let is_constant = |e: &ExprId| !writer.varies(g, *e);
        if ![entry, self.pivots[k]].iter().chain(updates.iter().flatten()).all(is_constant) {
            return None;
        }
        let entries = a[row].iter().copied().chain(a.iter().map(|row| row[column]));
        let entries = entries.filter(|e| *e != g.zero() && is_constant(e)).collect();
        Some(PivotOrigin { entry, updates, entries })
    }

    /// Moves the best-ranked non-zero entry of a block to its first position.
    fn choose_pivot(
        &mut self,
        g: &mut Graph,
        writer: &SectionWriter,
        rest: &mut [Vec<ExprId>],
        block: Range<usize>,
    ) -> Option<()> {
        let k = block.start;
        // Divisors of parameters alone first: they are prepared once.
        let judge = Judge { params: Known::Written(writer), signs: None };
        let mut best: Option<((Grade, usize), usize, usize)> = None;
        for i in block.clone() {
            for j in block.clone() {
                let Some(rank) = judge.grade(g, rest[i][j]) else { continue };
                let candidate = (rank, i, j);
                best = Some(best.map_or(candidate, |b| b.min(candidate)));
            }
        }
        let (_, i, j) = best?;
        rest.swap(i, k);
        self.lower.swap(i, k);
        self.row_order.swap(i, k);
        for row in rest.iter_mut().chain(self.upper.iter_mut()) {
            row.swap(j, k);
        }
        self.column_order.swap(j, k);
        Some(())
    }

    /// The pivots in elimination order, with the name of the unknown that each belongs to; whether the matrix
    /// [follows the Hessian](PivotMatrix::follows_hessian).
    pub fn pivots(&self, names: &[String], follows_hessian: bool) -> Vec<Pivot> {
        let (name, is_symmetric) = (self.prefix.clone(), self.is_symmetric);
        let matrix = PivotMatrix { name, is_symmetric, follows_hessian: follows_hessian && is_symmetric };
        let values = self.pivots.iter().zip(&self.origins);
        let mut pivots: Vec<Pivot> = (values.zip(&self.column_order))
            .map(|((expr, origin), k)| Pivot {
                name: names[*k].clone(),
                expr: *expr,
                matrix: matrix.clone(),
                origin: origin.clone(),
            })
            .collect();
        if let (Some(_), Some(determinant), Some(last)) =
            (self.block, pivots.last_mut(), self.column_order.last())
        {
            determinant.name = format!("determinant of {} and {}", determinant.name, names[*last]);
        }
        pivots
    }

    /// Unknowns with a pivot of their own.
    fn n_eliminated(&self) -> usize {
        self.row_order.len() - if self.block.is_some() { 2 } else { 0 }
    }

    /// Solves the block of the first `n` unknowns, those that were to be `leading`, for one right-hand side; the
    /// unknowns are named by `labels`, intermediate values `c_` and that. Entries of `b` and of the result outside of
    /// the block mean nothing.
    pub fn solve_leading(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        n: usize,
        labels: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId> {
        if n == b.len() {
            return self.solve(g, writer, labels, b);
        }
        let mut z: Vec<ExprId> = Vec::with_capacity(n);
        for i in 0..n {
            let mut terms = vec![b[self.row_order[i]]];
            for (j, zj) in z.iter().enumerate() {
                let product = g.mul(self.lower[i][j], *zj);
                terms.push(g.neg(product));
            }
            let sum = g.sum(&terms);
            z.push(writer.define(g, &format!("c_{}", labels[self.column_order[i]]), sum));
        }
        let mut x = vec![g.zero(); b.len()];
        self.substitute_back(g, writer, labels, &z, (n, n), &mut x);
        x
    }

    /// The unknowns of the first rows from the intermediate values `z`, with those up to a column already in `x`.
    fn substitute_back(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        labels: &[String],
        z: &[ExprId],
        (n_rows, n_columns): (usize, usize),
        x: &mut [ExprId],
    ) {
        for i in (0..n_rows).rev() {
            let inverse = g.powi(self.pivots[i], -1);
            let mut terms = vec![g.mul(z[i], inverse)];
            for j in i + 1..n_columns {
                let product = g.mul(self.upper[i][j], x[self.column_order[j]]);
                terms.push(g.neg(product));
            }
            let sum = g.sum(&terms);
            let k = self.column_order[i];
            x[k] = writer.define(g, &labels[k], sum);
        }
    }

    /// The factors of `A^T`: `U^T D L^T`.
    pub(super) fn transposed(&self) -> Factorisation {
        let n = self.row_order.len();
        let turned = |of: &[Vec<ExprId>]| (0..n).map(|i| (0..n).map(|j| of[j][i]).collect()).collect();
        Factorisation {
            row_order: self.column_order.clone(),
            column_order: self.row_order.clone(),
            lower: turned(&self.upper),
            upper: turned(&self.lower),
            block: self.block.map(|[[a, b], [c, d]]| [[a, c], [b, d]]),
            ..self.clone()
        }
    }

    /// Solves for one right-hand side; the unknowns are named by `labels`, intermediate values `z_` and that.
    pub fn solve(
        &self,
        g: &mut Graph,
        writer: &mut SectionWriter,
        labels: &[String],
        b: &[ExprId],
    ) -> Vec<ExprId> {
        let n = b.len();
        let mut z = Vec::with_capacity(n);
        for i in 0..n {
            let mut terms = vec![b[self.row_order[i]]];
            for (j, zj) in z.iter().enumerate().take(self.n_eliminated()) {
                let product = g.mul(self.lower[i][j], *zj);
                terms.push(g.neg(product));
            }
            let sum = g.sum(&terms);
            z.push(writer.define(g, &intermediate(&labels[self.column_order[i]]), sum));
        }
        let mut x = vec![g.zero(); n];
        if let (Some([[a, b], [c, d]]), [.., determinant], [.., first, second]) =
            (self.block, self.pivots.as_slice(), z.as_slice())
        {
            let inverse = g.powi(*determinant, -1);
            for (i, [(p, u), (q, v)]) in
                [(n - 1, [(a, *second), (c, *first)]), (n - 2, [(d, *first), (b, *second)])]
            {
                let (plus, minus) = (g.mul(p, u), g.mul(q, v));
                let difference = g.sub(plus, minus);
                let k = self.column_order[i];
                let value = g.mul(difference, inverse);
                x[k] = writer.define(g, &labels[k], value);
            }
        }
        self.substitute_back(g, writer, labels, &z, (self.n_eliminated(), n), &mut x);
        x
    }
}

/// `a d - b c` of the last two rows, if that is a number other than zero.
fn constant_determinant(g: &mut Graph, writer: &SectionWriter, rest: &[Vec<ExprId>]) -> Option<ExprId> {
    let [.., first, second] = rest else { return None };
    let [.., a, b] = first[..] else { return None };
    let [.., c, d] = second[..] else { return None };
    let (ad, bc) = (g.mul(a, d), g.mul(b, c));
    let determinant = g.sub(ad, bc);
    let value = writer.constant(g, determinant)?;
    (g.vanishing(value) == Vanishing::NonZero).then_some(value)
}

/// Name of the value between the two triangular solves: `z_v1` for `dot_v1`.
fn intermediate(label: &str) -> String {
    format!("z_{}", label.strip_prefix("dot_").unwrap_or(label))
}

/// The error for an identically singular matrix, with a null vector found by exact elimination.
fn singular(g: &mut Graph, a: &[Vec<ExprId>], names: &[String]) -> Error {
    let n = a.len();
    // Reduce columns one by one: the first column that depends on the previous ones gives the direction.
    for k in 0..n {
        if let Err(exhausted) = g.within_budget() {
            return exhausted.into();
        }
        let left: Vec<Vec<ExprId>> = (0..k).map(|i| (0..k).map(|j| a[i][j]).collect()).collect();
        let right: Vec<Vec<ExprId>> = (0..k).map(|i| vec![a[i][k]]).collect();
        let Ok(solution) = hamel_lang::algebra::solve_symbolic(g, &left, &right) else { continue };
        let vanishes = (0..n).all(|i| {
            let mut terms = vec![a[i][k]];
            for (j, row) in solution.iter().enumerate() {
                let product = g.mul(a[i][j], row[0]);
                terms.push(g.neg(product));
            }
            let residual = g.sum(&terms);
            g.is_zero(residual)
        });
        if vanishes {
            let mut terms = Vec::new();
            for (j, name) in names.iter().enumerate().take(k + 1) {
                let symbol = g.symbol(name);
                let e = g.sym(symbol);
                let weight = if j == k {
                    g.one()
                } else {
                    g.scale(solution[j][0], &-Rational::from_integer(1.into()))
                };
                terms.push(g.mul(weight, e));
            }
            let direction = g.sum(&terms);
            return Error::SingularMassMatrix { direction: g.display(direction, Style::Plain) };
        }
    }
    Error::SingularMassMatrix { direction: names.join(", ") }
}
