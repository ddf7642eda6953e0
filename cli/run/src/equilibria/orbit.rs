//! Relative periodic orbits: motions that come back after a time, up to a drift along symmetries.
//!
//! ```text
//! F_T(y) = exp(T sum c_k Z_k) y + 2 pi w    w full turns of angles
//! f'(y0) . (y - y0) = 0                     the place on the orbit nearest to the guess y0
//! ```
//!
//! for the state `y`, the drifts `c` and the period `T`, beside what an equilibrium keeps; `f'` are the rates without
//! their part along symmetries, which move an orbit as a whole. The flow `F_T` with its derivatives is the
//! integrator's, events and what they set included, so that gaits with impacts are such orbits.
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
use crate::direction::Direction;

/// Zeros among singular values of a flow's derivatives, such as moves along a symmetry, are integrated to this part of
/// the largest.
const RANK: f64 = 1e-8;

/// Most steps of a search, and most times that a step is shortened: each takes a motion of a period.
const LIMITS: (usize, usize) = (50, 16);

/// The state that a motion reaches after a time, and its derivatives along some directions; nothing where the motion
/// does not go so far.
pub(super) type Flow<'a> = &'a dyn Fn(&Point, f64, &[Direction]) -> Option<(Vec<f64>, DMatrix<f64>)>;

/// What singles out one state and one round of an orbit.
pub(super) struct Frame {
    /// The rates at the guess, without their part along symmetries.
    pub(super) phase: DVector<f64>,
    /// Full turns of the components, in radians.
    pub(super) turns: DVector<f64>,
}

/// The equations of an orbit. The unknowns are the state, the drifts, the period, and what a family goes along.
pub(super) struct Orbit<'a> {
    /// Has the drifts and the quantities that are kept.
    pub(super) equations: &'a Equations<'a>,
    pub(super) flow: Flow<'a>,
    pub(super) frame: &'a Frame,
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

/// Rates without their part along symmetries.
pub(super) fn across(symmetries: &[Symmetry], y: &[f64], rates: Vec<f64>) -> Option<DVector<f64>> {
    let (y, rates) = (DVector::from_column_slice(y), DVector::from_vec(rates));
    if symmetries.is_empty() {
        return Some(rates);
    }
    let rows: Vec<_> = symmetries.iter().map(|symmetry| symmetry.at(&y).transpose()).collect();
    Some(Svd::new(&DMatrix::from_rows(&rows))?.null_part(&rates))
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

/// The derivative of [`admissible`] at a state that keeps the conditions: by the state, a projection, and behind it by
/// a parameter.
fn projection(equations: &Equations<'_>, at: &Point, param: Option<Variable>) -> Option<DMatrix<f64>> {
    let y = DVector::from_column_slice(&at.y);
    let n = y.len();
    let mut matrix = DMatrix::identity(n, n + usize::from(param.is_some()));
    if let Some(conditions) = Admissible::new(equations, at) {
        let slopes = Svd::new(&conditions.linear(&y)?.jacobian)?;
        for mut column in matrix.columns_mut(0, n).column_iter_mut() {
            let allowed = slopes.null_part(&column.clone_owned());
            column.copy_from(&allowed);
        }
        if let Some(param) = param {
            let by_param = equations.field.derivatives(at, &[param])?;
            let changes = conditions.conditions.iter().map(|(own, _)| own.slope(param, &by_param[0]));
            let changes = DVector::from_iterator(conditions.conditions.len(), changes);
            matrix.column_mut(n).copy_from(&slopes.step(&changes, 0.0));
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
        let mut jacobian = DMatrix::from_fn(residual.len(), y.len(), slope);
        self.equations.modes.iter().for_each(|mode| jacobian.column_mut(*mode).fill(0.0));
        jacobian.iter().all(|x| x.is_finite()).then_some(Linear { residual, jacobian })
    }
}

impl Orbit<'_> {
    /// The unknowns of the equations, and the period.
    pub(super) fn parted(&self, x: &DVector<f64>) -> (DVector<f64>, f64) {
        let place = self.place_of_period();
        (x.clone().remove_row(place), x[place])
    }

    /// The unknowns of the equations with a period.
    pub(super) fn joined(&self, inner: &DVector<f64>, period: f64) -> DVector<f64> {
        inner.clone().insert_row(self.place_of_period(), period)
    }

    fn place_of_period(&self) -> usize {
        self.equations.variables.len() + self.equations.symmetries.len()
    }

    /// The parameter that a family goes along.
    fn param(&self) -> Option<Variable> {
        match self.equations.along {
            Some(Quantity::Variable(variable @ Variable::Param(_))) => Some(variable),
            _ => None,
        }
    }

    /// The residuals where the motion has reached a state.
    fn residual_at(&self, inner: &DVector<f64>, t: f64, reached: &[f64]) -> Option<DVector<f64>> {
        let at = self.equations.point(inner);
        let values = self.equations.field.values(&at)?;
        let y = DVector::from_column_slice(&at.y);
        let n = y.len();
        let (linear, shift) = drifted(self.equations.symmetries, &self.equations.drifts(inner), t, n);
        let back = DVector::from_column_slice(reached) - linear * &y - shift - &self.frame.turns;
        let conditions = self.equations.conditions(inner);
        let rest = conditions.iter().map(|(quantity, value)| quantity.value(&at, &values) - value);
        let start = DVector::from_column_slice(&self.equations.base.y);
        let phase = self.frame.phase.dot(&(&y - start));
        let all: Vec<f64> = back.iter().copied().chain(rest).chain([phase]).collect();
        all.iter().all(|r| r.is_finite()).then(|| DVector::from_vec(all))
    }

    /// The derivatives of the drift of a state: by the drifts, and by the time behind them.
    fn slopes_of_drift(&self, drifts: &[f64], y: &[f64], t: f64) -> DMatrix<f64> {
        let (symmetries, n) = (self.equations.symmetries, y.len());
        let whole = generator(symmetries, drifts, n);
        let extended = DVector::from_iterator(n + 1, y.iter().copied().chain([1.0]));
        let mut slopes = DMatrix::zeros(n, symmetries.len() + 1);
        // The derivative of an exponential along a matrix stands in the exponential of a matrix of blocks.
        for k in 0..symmetries.len() {
            let one = generator(&symmetries[k..=k], &[1.0], n);
            let mut blocks = DMatrix::zeros(2 * n + 2, 2 * n + 2);
            blocks.view_mut((0, 0), (n + 1, n + 1)).copy_from(&whole);
            blocks.view_mut((n + 1, n + 1), (n + 1, n + 1)).copy_from(&whole);
            blocks.view_mut((0, n + 1), (n + 1, n + 1)).copy_from(&one);
            let slope = (blocks * t).exp().view((0, n + 1), (n + 1, n + 1)) * &extended;
            slopes.column_mut(k).copy_from(&slope.rows(0, n));
        }
        let moved = &whole * ((&whole * t).exp() * &extended);
        slopes.column_mut(symmetries.len()).copy_from(&moved.rows(0, n));
        slopes
    }
}

impl Solvable for Orbit<'_> {
    fn rank(&self) -> f64 {
        RANK
    }

    fn limits(&self) -> (usize, usize) {
        LIMITS
    }

    fn residual(&self, x: &DVector<f64>) -> Option<DVector<f64>> {
        let (inner, t) = self.parted(x);
        let start = admissible(self.equations, &self.equations.point(&inner))?;
        let (reached, _) = (self.flow)(&start, t, &[])?;
        self.residual_at(&inner, t, &reached)
    }

    fn linear(&self, x: &DVector<f64>) -> Option<Linear> {
        let (inner, t) = self.parted(x);
        let Equations { field, symmetries, .. } = self.equations;
        let at = self.equations.point(&inner);
        let (n, last) = (at.y.len(), x.len() - 1);
        let start = admissible(self.equations, &at)?;
        let param = self.param();
        let of_param = param.and_then(|param| match param {
            Variable::Param(k) => Some(Direction::Param(k)),
            _ => None,
        });
        let directions: Vec<Direction> = (0..n).map(Direction::Initial).chain(of_param).collect();
        let (reached, flow) = (self.flow)(&start, t, &directions)?;
        let by_start = flow.columns(0, n) * projection(self.equations, &start, param)?;
        let residual = self.residual_at(&inner, t, &reached)?;
        let drifts = self.equations.drifts(&inner);
        let (turned, _) = drifted(symmetries, &drifts, t, n);
        let mut jacobian = DMatrix::zeros(residual.len(), x.len());
        jacobian.view_mut((0, 0), (n, n)).copy_from(&(by_start.columns(0, n) - turned));
        if param.is_some() {
            jacobian.view_mut((0, last), (n, 1)).copy_from(&(by_start.column(n) + flow.column(n)));
        }
        let end = Point { y: reached, ..at.clone() };
        let rates = DVector::from_vec(field.values(&end)?.rates);
        let mut slopes = -self.slopes_of_drift(&drifts, &at.y, t);
        let mut of_time = slopes.column_mut(symmetries.len());
        of_time += rates;
        jacobian.view_mut((0, self.equations.variables.len()), slopes.shape()).copy_from(&slopes);
        let by: Vec<Variable> = (0..n).map(Variable::State).chain(param).collect();
        let slopes = field.derivatives(&at, &by)?;
        let conditions = self.equations.conditions(&inner);
        for (k, (variable, slopes)) in by.iter().zip(&slopes).enumerate() {
            let column = if k < n { k } else { last };
            for (row, (quantity, _)) in conditions.iter().enumerate() {
                jacobian[(n + row, column)] += quantity.slope(*variable, slopes);
            }
        }
        for (column, phase) in self.frame.phase.iter().enumerate() {
            jacobian[(residual.len() - 1, column)] = *phase;
        }
        if self.equations.along.is_some() {
            jacobian[(residual.len() - 2, last)] -= 1.0;
        }
        self.equations.modes.iter().for_each(|mode| jacobian.column_mut(*mode).fill(0.0));
        jacobian.iter().all(|x| x.is_finite()).then_some(Linear { residual, jacobian })
    }
}
