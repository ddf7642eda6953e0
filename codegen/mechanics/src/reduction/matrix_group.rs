//! What the matrices of a group keep along its motion, and momenta in space.
//!
//! Does not know: which coordinates a scene carries.

use num_traits::{One, Zero};

use hamel_expr::{ExprId, Graph, Rational, SymbolId};
use hamel_lang::algebra::Matrix;
use hamel_lang::algebra::tableau::{Ring, determinant};
use hamel_lang::spec::group_motion::{Element, constant, product, transposed};
use hamel_lang::spec::{KeptForm, MatrixGroup, MatrixSpace, Side};

/// Momenta along some velocities, turned into space: `J_i = sum_k rows[i][k] p_k`.
#[derive(Clone, Debug)]
pub struct MomentumInSpace {
    /// Positions of the velocities in the frame.
    pub velocities: Vec<usize>,
    /// In terms of the reconstructed coordinates.
    pub rows: Vec<Vec<ExprId>>,
    /// The quaternion that turns them, by its name and its scalar part.
    pub attitude: Option<(String, SymbolId)>,
}

/// Determinants of larger matrices are not written down.
const MAX_DETERMINANT: usize = 4;

/// Functions of the coordinates that a motion of the group keeps, whatever matrix it starts from, with names after
/// that of the matrix: `g M g^T` (left) or `g^T M g` (right) for the form that the group keeps, and determinants.
pub(super) fn equations(
    g: &mut Graph,
    group: &MatrixGroup,
    (name, coordinates): (&str, &[ExprId]),
    side: Side,
) -> Vec<(String, ExprId)> {
    let element = Element::new(g, group, coordinates);
    let r = &element.matrix;
    let mut list = Vec::new();
    let is_complex = group.family().is_complex();
    if let Some(KeptForm::Bilinear(form)) = group.kept_form() {
        let form = constant(g, &form);
        let turned = transposed(r);
        let (left, right) = if side == Side::Left { (r, &turned) } else { (&turned, r) };
        let half = product(g, left, &form);
        let value = product(g, &half, right);
        // Real and imaginary parts stand in the first columns of the blocks.
        let step = if is_complex { 2 } else { 1 };
        for i in 0..value.len() {
            for j in (i / step * step..value.len()).step_by(step) {
                let e = g.cancel_zero(value[i][j]);
                if e != g.zero() {
                    list.push((format!("{name}_form_{}_{}", i + 1, j + 1), e));
                }
            }
        }
    }
    let is_special =
        matches!(group.kept_form(), Some(KeptForm::Volume)) || (is_complex && has_no_trace(group));
    if is_special && group.n() <= MAX_DETERMINANT {
        let n = group.n();
        let step = if is_complex { 2 } else { 1 };
        let entry = |i: usize, j: usize| {
            let im = if is_complex { r[step * i + 1][step * j] } else { g.zero() };
            (r[step * i][step * j], im)
        };
        let rows: Vec<Vec<(ExprId, ExprId)>> =
            (0..n).map(|i| (0..n).map(|j| entry(i, j)).collect()).collect();
        let (re, im) = determinant(&mut Complex(g), &rows);
        list.push((format!("{name}_det"), re));
        if is_complex {
            list.push((format!("{name}_det_im"), im));
        }
    }
    list
}

/// Whether no matrix of the algebra has a trace, in its complex entries.
fn has_no_trace(group: &MatrixGroup) -> bool {
    let n = group.n();
    group.matrices().iter().all(|m| {
        let trace = (0..n).fold(Rational::zero(), |sum, k| sum + m.get(2 * k + 1, 2 * k));
        trace.is_zero()
    })
}

/// What the coadjoint action of the matrix makes of momenta, for groups whose inverses are transposes: those along
/// its own algebra where there are no spaces, `Ad*_{g^-1} p` (left) or `Ad*_g p` (right), and those along the spaces.
///
/// `elements`: positions in the frame of the velocities that move the group.
pub(super) fn momenta_in_space(
    g: &mut Graph,
    group: &MatrixGroup,
    coordinates: &[ExprId],
    elements: &[usize],
    side: Side,
) -> Vec<MomentumInSpace> {
    let is_identity = |form: Matrix| form == Matrix::identity(form.n_rows());
    let is_orthogonal = match group.kept_form() {
        Some(KeptForm::Bilinear(form)) => is_identity(form),
        Some(KeptForm::Volume) | None => false,
    };
    if !is_orthogonal {
        return Vec::new();
    }
    let element = Element::new(g, group, coordinates);
    let turned = transposed(&element.matrix);
    // R of R E R^T is the matrix for a right action, its transpose for a left one.
    let (first, last) = match side {
        Side::Left => (&turned, &element.matrix),
        Side::Right => (&element.matrix, &turned),
    };
    let (own, mut moving) = elements.split_at(group.matrices().len());
    let mut found = Vec::new();
    if group.spaces().is_empty()
        && let Some(dual) = dual_basis(group.matrices())
    {
        let mut rows = Vec::new();
        for e in group.matrices() {
            let e = constant(g, e);
            let half = product(g, first, &e);
            let conjugate = product(g, &half, last);
            let row = dual.iter().map(|form| {
                let mut terms = Vec::new();
                for (i, conjugate) in conjugate.iter().enumerate() {
                    for (j, entry) in conjugate.iter().enumerate() {
                        terms.push(g.scale(*entry, form.get(i, j)));
                    }
                }
                g.sum(&terms)
            });
            rows.push(row.collect());
        }
        found.push(MomentumInSpace { velocities: own.to_vec(), rows, attitude: None });
    }
    for (space, dim) in group.spaces() {
        let (velocities, after) = moving.split_at(dim);
        moving = after;
        if space == MatrixSpace::Standard {
            let (velocities, rows) = (velocities.to_vec(), last.clone());
            found.push(MomentumInSpace { velocities, rows, attitude: None });
        }
    }
    found
}

/// `D_a` with `<D_a, E_b> = delta_ab` in the inner product of entries, in the span of the `E_b`.
fn dual_basis(matrices: &[Matrix]) -> Option<Vec<Matrix>> {
    let n = matrices.len();
    let inner = |a: &Matrix, b: &Matrix| {
        let rows = (0..a.n_rows()).flat_map(|i| a.row(i).iter().zip(b.row(i)));
        rows.fold(Rational::zero(), |sum, (x, y)| sum + x * y)
    };
    let mut gram = Matrix::zeros(n, n);
    for (a, x) in matrices.iter().enumerate() {
        for (b, y) in matrices.iter().enumerate() {
            gram.set(a, b, inner(x, y));
        }
    }
    let inverse = gram.inverse()?;
    let minus = -Rational::one();
    let dual = (0..n).map(|a| {
        let zero = Matrix::zeros(matrices[a].n_rows(), matrices[a].n_columns());
        let parts = matrices.iter().enumerate();
        parts.fold(zero, |sum, (b, m)| sum.minus(&m.scaled(&(inverse.get(a, b) * &minus))))
    });
    Some(dual.collect())
}

/// Complex expressions, real and imaginary part.
struct Complex<'a>(&'a mut Graph);

impl Ring for Complex<'_> {
    type Entry = (ExprId, ExprId);

    fn unit(&mut self) -> (ExprId, ExprId) {
        (self.0.one(), self.0.zero())
    }

    fn times(&mut self, (a, b): &(ExprId, ExprId), (c, d): &(ExprId, ExprId)) -> (ExprId, ExprId) {
        let g = &mut *self.0;
        let [ac, bd, ad, bc] = [(a, c), (b, d), (a, d), (b, c)].map(|(x, y)| g.mul(*x, *y));
        (g.sub(ac, bd), g.add(ad, bc))
    }

    fn negative(&mut self, (a, b): &(ExprId, ExprId)) -> (ExprId, ExprId) {
        (self.0.neg(*a), self.0.neg(*b))
    }

    fn alternating(&mut self, terms: &[(ExprId, ExprId)]) -> (ExprId, ExprId) {
        let (re, im): (Vec<ExprId>, Vec<ExprId>) = terms.iter().copied().unzip();
        (self.0.alternating(&re), self.0.alternating(&im))
    }
}
