//! Relative periodic orbits: motions that come back after a time, up to a drift along symmetries.
//!
//! ```text
//! F_T(y) = exp(T sum c_k Z_k) y + 2 pi w    w full turns of angles
//! f(y0) . (y - y0) = 0                      the place on the orbit nearest to the guess y0
//! ```
//!
//! for the state `y`, the drifts `c` and the period `T`, beside what an equilibrium keeps. The flow `F_T` with its
//! derivatives is the integrator's, events and what they set included, so that gaits with impacts are such orbits.
//!
//! The motion of a state that breaks an equation between coordinates or a constraint, as states on the way of Newton's
//! method do, is that of the nearest state that keeps them.
//!
//! Does not know: how a motion is integrated, how stable an orbit is.
//!
//! # Source
//! Seydel 2010, Practical bifurcation and stability analysis, chapter 7 (shooting)

use nalgebra::{DMatrix, DVector};

use super::field::{Point, Variable};
use super::search::{Equations, Linear, Quantity, Solvable, Svd};
use super::symmetry::Symmetry;

/// The state that a motion reaches after a time, and its derivatives by the initial state where they are asked for;
/// nothing where the motion does not go so far.
pub(super) type Flow<'a> = &'a dyn Fn(&Point, f64, bool) -> Option<(Vec<f64>, DMatrix<f64>)>;

/// The equations of an orbit. The unknowns are the state, the drifts, and the period.
pub(super) struct Orbit<'a> {
    /// Has the drifts and the quantities that are kept.
    pub(super) equations: &'a Equations<'a>,
    pub(super) flow: Flow<'a>,
    /// The rates at the guess.
    pub(super) phase: DVector<f64>,
    /// Full turns of the components, in radians.
    pub(super) turns: DVector<f64>,
}

/// The map `y -> linear y + shift` that symmetries with drifts make of a time.
pub(super) fn drifted(
    symmetries: &[Symmetry],
    drifts: &[f64],
    t: f64,
    n: usize,
) -> (DMatrix<f64>, DVector<f64>) {
    let whole = (generator(symmetries, drifts, n) * t).exp();
    (whole.view((0, 0), (n, n)).into_owned(), whole.view((0, n), (n, 1)).column(0).into_owned())
}

/// `sum c_k Z_k` as a matrix that acts on `(y, 1)`.
fn generator(symmetries: &[Symmetry], drifts: &[f64], n: usize) -> DMatrix<f64> {
    let mut matrix = DMatrix::zeros(n + 1, n + 1);
    for (symmetry, drift) in symmetries.iter().zip(drifts) {
        let mut part = matrix.view_mut((0, 0), (n, n));
        part += &symmetry.slope * *drift;
        let mut column = matrix.view_mut((0, n), (n, 1));
        column += &symmetry.shift * *drift;
    }
    matrix
}

/// Equations between coordinates and constraints. The unknowns are the state.
struct Admissible<'a> {
    equations: &'a Equations<'a>,
    at: &'a Point,
    conditions: Vec<(Quantity, f64)>,
}

/// The nearest state that keeps the equations between coordinates and the constraints.
pub(super) fn admissible(equations: &Equations<'_>, at: &Point) -> Option<Point> {
    let y = DVector::from_column_slice(&at.y);
    let found = match Admissible::new(equations, at) {
        Some(conditions) => conditions.solve(&y, &[]).ok()?,
        None => y,
    };
    Some(Point { y: found.iter().copied().collect(), ..at.clone() })
}

/// The derivative of [`admissible`] by the state, at one that keeps the conditions: a projection.
fn projection(equations: &Equations<'_>, at: &Point) -> Option<DMatrix<f64>> {
    let y = DVector::from_column_slice(&at.y);
    let mut matrix = DMatrix::identity(y.len(), y.len());
    if let Some(conditions) = Admissible::new(equations, at) {
        let slopes = Svd::new(&conditions.linear(&y)?.jacobian)?;
        for mut column in matrix.column_iter_mut() {
            let allowed = slopes.null_part(&column.clone_owned());
            column.copy_from(&allowed);
        }
    }
    Some(matrix)
}

impl<'a> Admissible<'a> {
    /// Nothing where there are no conditions.
    fn new(equations: &'a Equations<'a>, at: &'a Point) -> Option<Admissible<'a>> {
        let is_needed = |own: &Quantity| matches!(own, Quantity::Position(_) | Quantity::Residual(_));
        let conditions: Vec<_> = equations.held.iter().copied().filter(|(own, _)| is_needed(own)).collect();
        (!conditions.is_empty()).then_some(Admissible { equations, at, conditions })
    }

    fn point(&self, y: &DVector<f64>) -> Point {
        Point { y: y.iter().copied().collect(), ..self.at.clone() }
    }
}

impl Solvable for Admissible<'_> {
    fn residual(&self, y: &DVector<f64>) -> Option<DVector<f64>> {
        let at = self.point(y);
        let values = self.equations.field.values(&at)?;
        let left = self.conditions.iter().map(|(quantity, value)| quantity.value(&at, &values) - value);
        let all: Vec<f64> = left.collect();
        all.iter().all(|r| r.is_finite()).then(|| DVector::from_vec(all))
    }

    fn linear(&self, y: &DVector<f64>) -> Option<Linear> {
        let residual = self.residual(y)?;
        let by: Vec<Variable> = (0..y.len()).map(Variable::State).collect();
        let slopes = self.equations.field.derivatives(&self.point(y), &by)?;
        let slope = |row: usize, column: usize| self.conditions[row].0.slope(by[column], &slopes[column]);
        let jacobian = DMatrix::from_fn(residual.len(), y.len(), slope);
        jacobian.iter().all(|x| x.is_finite()).then_some(Linear { residual, jacobian })
    }
}

impl Orbit<'_> {
    /// The unknowns without the period.
    fn parted(x: &DVector<f64>) -> (DVector<f64>, f64) {
        (x.rows(0, x.len() - 1).into_owned(), x[x.len() - 1])
    }

    /// The residuals where the motion has reached a state.
    fn residual_at(&self, inner: &DVector<f64>, t: f64, reached: &[f64]) -> Option<DVector<f64>> {
        let at = self.equations.point(inner);
        let values = self.equations.field.values(&at)?;
        let y = DVector::from_column_slice(&at.y);
        let n = y.len();
        let (linear, shift) = drifted(self.equations.symmetries, &self.equations.drifts(inner), t, n);
        let back = DVector::from_column_slice(reached) - linear * &y - shift - &self.turns;
        let conditions = self.equations.conditions(inner);
        let rest = conditions.iter().map(|(quantity, value)| quantity.value(&at, &values) - value);
        let start = DVector::from_column_slice(&self.equations.base.y);
        let phase = self.phase.dot(&(&y - start));
        let all: Vec<f64> = back.iter().copied().chain(rest).chain([phase]).collect();
        all.iter().all(|r| r.is_finite()).then(|| DVector::from_vec(all))
    }
}

impl Solvable for Orbit<'_> {
    fn residual(&self, x: &DVector<f64>) -> Option<DVector<f64>> {
        let (inner, t) = Orbit::parted(x);
        let start = admissible(self.equations, &self.equations.point(&inner))?;
        let (reached, _) = (self.flow)(&start, t, false)?;
        self.residual_at(&inner, t, &reached)
    }

    fn linear(&self, x: &DVector<f64>) -> Option<Linear> {
        let (inner, t) = Orbit::parted(x);
        let Equations { field, symmetries, .. } = self.equations;
        let at = self.equations.point(&inner);
        let n = at.y.len();
        let start = admissible(self.equations, &at)?;
        let (reached, flow) = (self.flow)(&start, t, true)?;
        let flow = flow * projection(self.equations, &start)?;
        let residual = self.residual_at(&inner, t, &reached)?;
        let drifts = self.equations.drifts(&inner);
        let (turned, _) = drifted(symmetries, &drifts, t, n);
        let mut jacobian = DMatrix::zeros(residual.len(), x.len());
        jacobian.view_mut((0, 0), (n, n)).copy_from(&(flow - turned));
        let whole = generator(symmetries, &drifts, n);
        let extended = DVector::from_iterator(n + 1, at.y.iter().copied().chain([1.0]));
        // The derivative of an exponential along a matrix stands in the exponential of a matrix of blocks.
        for k in 0..symmetries.len() {
            let one = generator(&symmetries[k..=k], &[1.0], n);
            let mut blocks = DMatrix::zeros(2 * n + 2, 2 * n + 2);
            blocks.view_mut((0, 0), (n + 1, n + 1)).copy_from(&whole);
            blocks.view_mut((n + 1, n + 1), (n + 1, n + 1)).copy_from(&whole);
            blocks.view_mut((0, n + 1), (n + 1, n + 1)).copy_from(&one);
            let slope = (blocks * t).exp().view((0, n + 1), (n + 1, n + 1)) * &extended;
            jacobian.view_mut((0, n + k), (n, 1)).copy_from(&(-slope.rows(0, n)));
        }
        let end = Point { y: reached, ..at.clone() };
        let rates = DVector::from_vec(field.values(&end)?.rates);
        let moved = &whole * ((&whole * t).exp() * &extended);
        jacobian.view_mut((0, x.len() - 1), (n, 1)).copy_from(&(rates - moved.rows(0, n)));
        let by: Vec<Variable> = (0..n).map(Variable::State).collect();
        let slopes = field.derivatives(&at, &by)?;
        let conditions = self.equations.conditions(&inner);
        for (column, (variable, slopes)) in by.iter().zip(&slopes).enumerate() {
            for (row, (quantity, _)) in conditions.iter().enumerate() {
                jacobian[(n + row, column)] = quantity.slope(*variable, slopes);
            }
            jacobian[(residual.len() - 1, column)] = self.phase[column];
        }
        jacobian.iter().all(|x| x.is_finite()).then_some(Linear { residual, jacobian })
    }
}
