//! Reduction by stages on a Lie algebra: adapted basis, quotient brackets, the forms `a` and `b`, and the way back.

use hamel_expr::error::Error;
use hamel_expr::{ExprId, Graph, Number, Rational, Style};
use hamel_lang::algebra::{
    LieAlgebra, independent_vectors, next_ideal, solve_over_determinant, solve_symbolic, whole_algebra,
};
use hamel_lang::spec::LEVEL_MOMENTUM;

/// Sparse bilinear form with values in the adapted basis: entries `(a, b, c, value)` meaning
/// `form(e_a, e_b) = value e_c + ..`, in ascending order of `(a, b, c)`.
pub type Tensor = Vec<(usize, usize, usize, ExprId)>;

/// One level of the chain: the orthogonal complement of `n_{j+1}` in `n_j`, which is the horizontal space at the
/// identity of the connection `A_{N_{j+1}}`.
#[derive(Clone, Debug)]
pub struct StageLevel {
    /// Name of the stage `n_j`.
    pub name: String,
    /// Indices of this level's elements in the adapted basis.
    pub range: std::ops::Range<usize>,
    /// `[eta, eta']` in the quotient `n_j / n_{j+1}`: the component in this level.
    pub quotient_bracket: Tensor,
    /// `a_j(eta, eta') = -(component of [eta, eta'] in the levels below)`, the curvature of `A_{N_{j+1}}` at the
    /// identity.
    pub curvature: Tensor,
    /// `b_j(eta, zeta) = [eta, zeta]` for `zeta` in `n_{j+1}`, the quotient vertical connection.
    pub vertical_connection: Tensor,
}

/// A part of a vertical equation by stages, tested on the adapted element `f_k`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VerticalPart {
    /// `k`.
    pub element: usize,
    /// What it is.
    pub kind: VerticalKind,
    /// Its value.
    pub value: ExprId,
}

/// What a part of a vertical equation is, for an element of level `i`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum VerticalKind {
    /// `<beta, [eta^i, f_k]_i>`.
    Coadjoint,
    /// `<beta, a_i(eta^i, f_k)>`.
    Curvature,
    /// `<beta, b_i(f_k, sum_{l>i} eta^l)>`.
    Below,
    /// `<beta, b_j(eta^j, f_k)>` of the level `j < i`.
    Above(usize),
}

impl VerticalKind {
    /// Whether the equation has minus it.
    pub fn is_negative(self) -> bool {
        matches!(self, VerticalKind::Curvature | VerticalKind::Below)
    }
}

/// A Lie algebra split along a chain of ideals `g = n_0 > n_1 > .. > n_k > 0`.
///
/// # Shapes
/// `basis`: `[dim][dim]`, row `k` is the adapted element `k` in the algebra's own basis.
///
/// # Source
/// Cendra, Diaz, "Lagrange-d'Alembert-Poincare equations by several stages", section 2, read with the identification
/// by horizontal lifts (the only one for which it holds).
#[derive(Clone, Debug)]
pub struct Stages {
    /// The levels, from `n_0` down.
    pub levels: Vec<StageLevel>,
    /// The adapted basis.
    pub basis: Vec<Vec<ExprId>>,
    /// `inverse[a][k]`: coefficient of adapted element `k` in the original element `a`.
    pub inverse: Vec<Vec<ExprId>>,
    /// `A^k_i` by adapted element and shape coordinate: the velocities along the levels are those of the model and
    /// `A xdot`. Absent where no stage has a connection of its own.
    pub connection: Option<Vec<Vec<ExprId>>>,
    /// What momenta along the adapted elements are called, before the names of the velocities along them.
    pub momentum: String,
}

impl Stages {
    /// Names of the velocities along the adapted elements: `name_1`, `name_2`, .. for a stage called `name` whose level
    /// has several dimensions, `name` for one.
    pub fn velocity_names(&self) -> Vec<String> {
        let names = self.levels.iter().flat_map(|level| {
            let several = level.range.len() > 1;
            (1..=level.range.len())
                .map(move |k| if several { format!("{}_{k}", level.name) } else { level.name.clone() })
        });
        names.collect()
    }

    /// Every coefficient.
    pub(super) fn expressions_mut(&mut self) -> impl Iterator<Item = &mut ExprId> {
        let Stages { levels, basis, inverse, connection, momentum: _ } = self;
        let forms = levels.iter_mut().flat_map(|level| {
            let StageLevel { name: _, range: _, quotient_bracket, curvature, vertical_connection } = level;
            quotient_bracket.iter_mut().chain(curvature).chain(vertical_connection).map(|(.., value)| value)
        });
        let connection = connection.iter_mut().flatten().flatten();
        forms.chain(basis.iter_mut().flatten()).chain(inverse.iter_mut().flatten()).chain(connection)
    }

    /// Splits `algebra` along the chain `n_0 = g`, `n_1`, .. given by spanning vectors of `n_1`, `n_2`, .., with the
    /// orthogonal complements of an inner product (default: the basis is orthonormal).
    ///
    /// # Errors
    /// [`Error::NotNested`], [`Error::NotAnIdeal`] (naming the offending pair), [`Error::EmptyStage`],
    /// [`Error::DegenerateInnerProduct`], [`Error::ShapeMismatch`].
    pub fn split(
        g: &mut Graph,
        algebra: &LieAlgebra<Number>,
        names: &[String],
        ideals: &[Vec<Vec<ExprId>>],
        inner_product: Option<&[Vec<ExprId>]>,
    ) -> Result<Stages, Vec<Error>> {
        let n = algebra.dim();
        if names.len() != ideals.len() + 1 {
            let what = "list of stage names".to_owned();
            return Err(vec![Error::ShapeMismatch { what, found: names.len(), expected: ideals.len() + 1 }]);
        }
        let mut chain = vec![whole_algebra(g, algebra)];
        for (k, spanning) in ideals.iter().enumerate() {
            let (above, next) = ((names[k].as_str(), &*chain[k]), (names[k + 1].as_str(), &**spanning));
            let ideal = next_ideal(g, algebra, algebra.basis(), above, next).map_err(|error| vec![error])?;
            chain.push(ideal);
        }
        let metric = match inner_product {
            Some(metric) => metric.to_vec(),
            None => identity(g, n),
        };
        let mut basis = Vec::with_capacity(n);
        let mut ranges = Vec::new();
        for (j, space) in chain.iter().enumerate() {
            let below: &[Vec<ExprId>] = chain.get(j + 1).map_or(&[], Vec::as_slice);
            let start = basis.len();
            basis.extend(
                horizontal_basis(g, space, below, &metric)
                    .map_err(|()| vec![Error::DegenerateInnerProduct { stage: names[j].clone() }])?,
            );
            ranges.push(start..basis.len());
        }
        let transposed: Vec<Vec<ExprId>> = (0..n).map(|a| basis.iter().map(|e| e[a]).collect()).collect();
        let unit = identity(g, n);
        // basis is invertible: each level completes the one below to a basis of the level's stage.
        let columns = solve_symbolic(g, &transposed, &unit)
            .map_err(|_| vec![Error::DegenerateInnerProduct { stage: names[0].clone() }])?;
        let mut inverse: Vec<Vec<ExprId>> =
            (0..n).map(|a| columns.iter().map(|row| row[a]).collect()).collect();
        for range in &ranges {
            by_products(g, &mut inverse, &metric, (&basis, range.clone()));
        }
        let mut stages = Stages {
            levels: Vec::new(),
            basis,
            inverse,
            connection: None,
            momentum: LEVEL_MOMENTUM.to_owned(),
        };
        let brackets = stages.adapted_brackets(g, algebra);
        stages.levels = ranges
            .iter()
            .zip(names)
            .map(|(range, name)| stage_forms(g, name, range.clone(), &brackets, n))
            .collect();
        stages.verify_rebuilt(g, &brackets)?;
        Ok(stages)
    }

    /// Vectors of the algebra, the columns of `rows`, in the adapted basis.
    pub(super) fn components(&self, g: &mut Graph, rows: &[Vec<ExprId>]) -> Vec<Vec<ExprId>> {
        let width = rows.first().map_or(0, Vec::len);
        let mut adapted = Vec::new();
        for k in 0..self.basis.len() {
            let mut row = Vec::new();
            for i in 0..width {
                let terms: Vec<ExprId> =
                    rows.iter().zip(&self.inverse).map(|(a, inverse)| g.mul(a[i], inverse[k])).collect();
                let sum = g.sum(&terms);
                row.push(g.cancel_zero(sum));
            }
            adapted.push(row);
        }
        adapted
    }

    /// Level to which an adapted basis element belongs.
    pub fn level_of(&self, k: usize) -> usize {
        self.levels.iter().position(|l| l.range.contains(&k)).unwrap_or(0)
    }

    /// `[e_p, e_q]` of adapted elements, components in the adapted basis: `[p][q] -> dense vector`.
    fn adapted_brackets(&self, g: &mut Graph, algebra: &LieAlgebra<Number>) -> Vec<Vec<Vec<ExprId>>> {
        let n = algebra.dim();
        let mut table = vec![vec![vec![g.zero(); n]; n]; n];
        for p in 0..n {
            for q in p + 1..n {
                let mut original: Vec<Vec<(ExprId, Rational)>> = vec![Vec::new(); n];
                for (a, b, value) in algebra.brackets() {
                    let vanishes = |x: ExprId, y: ExprId| x == g.zero() || y == g.zero();
                    if vanishes(self.basis[p][a], self.basis[q][b])
                        && vanishes(self.basis[p][b], self.basis[q][a])
                    {
                        continue;
                    }
                    let forward = g.mul(self.basis[p][a], self.basis[q][b]);
                    let backward = g.mul(self.basis[p][b], self.basis[q][a]);
                    let weight = g.sub(forward, backward);
                    if weight == g.zero() {
                        continue;
                    }
                    for (c, structure_constant) in value {
                        original[*c].push(g.weighted(weight, structure_constant));
                    }
                }
                let original: Vec<ExprId> = original.iter().map(|list| g.linear_combination(list)).collect();
                let support: Vec<usize> = (0..n).filter(|c| original[*c] != g.zero()).collect();
                if support.is_empty() {
                    continue;
                }
                for k in 0..n {
                    let there: Vec<usize> =
                        support.iter().copied().filter(|c| self.inverse[*c][k] != g.zero()).collect();
                    let terms: Vec<ExprId> =
                        there.into_iter().map(|c| g.mul(original[c], self.inverse[c][k])).collect();
                    let sum = g.sum(&terms);
                    let value = g.cancel_zero(sum);
                    table[p][q][k] = value;
                    table[q][p][k] = g.neg(value);
                }
            }
        }
        table
    }

    /// `[eta, eta']` of two vectors in the adapted basis, rebuilt from the stage forms level by level:
    /// level `i` is `[eta^i, eta'^i]_i + sum_{j<i} (-a_j^i(eta^j, eta'^j) + b_j^i(eta^j, sum_{k>j} eta'^k)
    /// - b_j^i(eta'^j, sum_{k>j} eta^k))`.
    pub fn rebuilt_bracket(&self, g: &mut Graph, eta: &[ExprId], eta_bar: &[ExprId]) -> Vec<ExprId> {
        let mut terms: Vec<Vec<ExprId>> = vec![Vec::new(); eta.len()];
        let mut add = |c: usize, value: ExprId, x: ExprId, y: ExprId, is_negative: bool| {
            if x != g.zero() && y != g.zero() {
                let term = g.product(&[value, x, y]);
                terms[c].push(if is_negative { g.neg(term) } else { term });
            }
        };
        for level in &self.levels {
            for (a, b, c, value) in &level.quotient_bracket {
                add(*c, *value, eta[*a], eta_bar[*b], false);
            }
            for (a, b, c, value) in &level.curvature {
                add(*c, *value, eta[*a], eta_bar[*b], true);
            }
            for (a, b, c, value) in &level.vertical_connection {
                add(*c, *value, eta[*a], eta_bar[*b], false);
                add(*c, *value, eta_bar[*a], eta[*b], true);
            }
        }
        terms.iter().map(|list| g.sum(list)).collect()
    }

    fn verify_rebuilt(&self, g: &mut Graph, brackets: &[Vec<Vec<ExprId>>]) -> Result<(), Vec<Error>> {
        let n = self.basis.len();
        let unit = identity(g, n);
        for p in 0..n {
            for q in p + 1..n {
                let rebuilt = self.rebuilt_bracket(g, &unit[p], &unit[q]);
                for (k, value) in rebuilt.into_iter().enumerate() {
                    if !g.is_equal(value, brackets[p][q][k]) {
                        let pair = [p, q].map(|e| format!("element {}", e + 1));
                        return Err(vec![Error::RebuiltBracketDiffers { pair }]);
                    }
                }
            }
        }
        Ok(())
    }

    /// The vertical equations by stages: `betadot_i` paired with every adapted basis element, given the velocities
    /// `eta` and momenta `beta` in the adapted basis. Every level's momentum may enter every level's equation:
    ///
    /// `betadot_i(z) = <beta_i, [eta^i, z]_i> + sum_{m>i} <beta_m, -a_i^m(eta^i, z) - b_i^m(z, sum_{l>i} eta^l)>
    /// + sum_{j<i} sum_{m>j} <beta_m, b_j^m(eta^j, z)>`.
    ///
    /// The printed equations keep `beta_i` alone, which is wrong unless the lost terms vanish.
    ///
    /// # Source
    /// Cendra, Diaz, equation (19), in the corrected closed form of (20).
    pub fn vertical_equations(&self, g: &mut Graph, eta: &[ExprId], beta: &[ExprId]) -> Vec<ExprId> {
        let mut right = vec![g.zero(); eta.len()];
        for VerticalPart { element, kind, value } in self.vertical_parts(g, eta, beta) {
            let term = if kind.is_negative() { g.neg(value) } else { value };
            right[element] = g.add(right[element], term);
        }
        right
    }

    /// The parts of the right sides of [`Stages::vertical_equations`] for which a form has components, by elements.
    pub fn vertical_parts(&self, g: &mut Graph, eta: &[ExprId], beta: &[ExprId]) -> Vec<VerticalPart> {
        let mut parts = Vec::new();
        for element in 0..eta.len() {
            let own = self.level_of(element);
            let level = &self.levels[own];
            let mut part = |g: &mut Graph, kind: VerticalKind, tensor: &Tensor, is_second: bool| {
                let picked = tensor.iter().filter(|(a, b, ..)| element == if is_second { *b } else { *a });
                let terms = picked.map(|(a, b, c, value)| {
                    let other = if is_second { *a } else { *b };
                    g.product(&[*value, beta[*c], eta[other]])
                });
                let terms: Vec<ExprId> = terms.collect();
                let value = g.sum(&terms);
                if value != g.zero() {
                    parts.push(VerticalPart { element, kind, value });
                }
            };
            part(g, VerticalKind::Coadjoint, &level.quotient_bracket, true);
            part(g, VerticalKind::Curvature, &level.curvature, true);
            part(g, VerticalKind::Below, &level.vertical_connection, false);
            for (j, above) in self.levels[..own].iter().enumerate() {
                part(g, VerticalKind::Above(j), &above.vertical_connection, true);
            }
        }
        parts
    }

    /// An adapted basis element spelled in the algebra's basis.
    pub fn spell_element(&self, g: &mut Graph, k: usize, basis: &[String], style: Style) -> String {
        let terms: Vec<ExprId> = (0..basis.len())
            .map(|a| {
                let symbol = g.symbol(&basis[a]);
                let e = g.sym(symbol);
                g.mul(self.basis[k][a], e)
            })
            .collect();
        let sum = g.sum(&terms);
        g.display(sum, style)
    }
}

fn identity(g: &Graph, n: usize) -> Vec<Vec<ExprId>> {
    (0..n).map(|i| (0..n).map(|j| if i == j { g.one() } else { g.zero() }).collect()).collect()
}

/// A basis of the orthogonal complement of `below` in `space`: representatives of the quotient, lifted horizontally
/// by `e - sum_k c_k f_k` with `<f_l, f_k> c_k = <f_l, e>`.
fn horizontal_basis(
    g: &mut Graph,
    space: &[Vec<ExprId>],
    below: &[Vec<ExprId>],
    metric: &[Vec<ExprId>],
) -> Result<Vec<Vec<ExprId>>, ()> {
    let candidates: Vec<Vec<ExprId>> = below.iter().chain(space).cloned().collect();
    let independent = independent_vectors(g, &candidates);
    let representatives: Vec<Vec<ExprId>> =
        independent[below.len()..].iter().map(|k| candidates[*k].clone()).collect();
    let inner = |g: &mut Graph, u: &[ExprId], v: &[ExprId]| {
        let zero = g.zero();
        let mut terms = Vec::new();
        for (i, p) in u.iter().enumerate().filter(|(_, p)| **p != zero) {
            for (j, q) in v.iter().enumerate().filter(|(_, q)| **q != zero) {
                terms.push(g.product(&[metric[i][j], *p, *q]));
            }
        }
        g.sum(&terms)
    };
    let mut gram = Vec::new();
    let mut right = Vec::new();
    for f in below {
        gram.push(below.iter().map(|h| inner(g, f, h)).collect::<Vec<_>>());
        right.push(representatives.iter().map(|e| inner(g, f, e)).collect::<Vec<_>>());
    }
    let coefficients = solve_over_determinant(g, &gram, &right).map_err(|_| ())?;
    let mut lifted = Vec::new();
    for (k, e) in representatives.iter().enumerate() {
        let mut vector = Vec::new();
        for (i, component) in e.iter().enumerate() {
            let mut terms = vec![*component];
            for (f, row) in below.iter().zip(&coefficients) {
                let along = g.mul(row[k], f[i]);
                terms.push(g.neg(along));
            }
            vector.push(g.sum(&terms));
        }
        lifted.push(vector);
    }
    Ok(lifted)
}

/// Writes components along a level by inner products, `eta = K^-1 <f, .>` with `K` that of the level, where that is
/// shorter than what the levels below leave of an elimination.
fn by_products(
    g: &mut Graph,
    inverse: &mut [Vec<ExprId>],
    metric: &[Vec<ExprId>],
    (basis, range): (&[Vec<ExprId>], std::ops::Range<usize>),
) {
    let is_number = |g: &Graph, e: ExprId| g.as_rational(e).is_some();
    if range.clone().all(|k| inverse.iter().all(|row| is_number(g, row[k]))) {
        return;
    }
    let lowered: Vec<Vec<ExprId>> =
        range.clone().map(|k| metric.iter().map(|row| g.dot(row, &basis[k])).collect()).collect();
    let gram: Vec<Vec<ExprId>> =
        lowered.iter().map(|f| range.clone().map(|k| g.dot(f, &basis[k])).collect()).collect();
    let Ok(solved) = solve_over_determinant(g, &gram, &lowered) else { return };
    for (k, row) in range.zip(solved) {
        for (own, e) in inverse.iter_mut().zip(row) {
            let size = |g: &Graph, e: ExprId| g.reachable(&[e]).len();
            if !is_number(g, own[k]) && size(g, e) < size(g, own[k]) && g.is_equal(e, own[k]) {
                own[k] = e;
            }
        }
    }
}

fn stage_forms(
    g: &mut Graph,
    name: &str,
    range: std::ops::Range<usize>,
    brackets: &[Vec<Vec<ExprId>>],
    n: usize,
) -> StageLevel {
    let mut level = StageLevel {
        name: name.to_owned(),
        range: range.clone(),
        quotient_bracket: Vec::new(),
        curvature: Vec::new(),
        vertical_connection: Vec::new(),
    };
    for a in range.clone() {
        for b in range.start..n {
            for (c, &value) in brackets[a][b].iter().enumerate() {
                if value == g.zero() {
                    continue;
                }
                if b >= range.end {
                    level.vertical_connection.push((a, b, c, value));
                } else if range.contains(&c) {
                    level.quotient_bracket.push((a, b, c, value));
                } else {
                    let minus = g.neg(value);
                    level.curvature.push((a, b, c, minus));
                }
            }
        }
    }
    level
}
