//! The equations of an equilibrium and a solution near a guess.
//!
//! ```text
//! f(y; u, p) = sum c_k Z_k(y)      rates are drifts along symmetries
//! I(y) = I(y0)                     norms of advected vectors, points of circles, unit quaternions
//! phi(y) = 0                       equations between coordinates, constraints that a state can violate
//! h(y) = h0                        what the user keeps
//! ```
//!
//! for `y`, `c`, inputs and parameters that are set free. There are as many solutions as there are symmetries and
//! families, so each step is the shortest that meets the linear equations: Newton's method by singular values, damped
//! as Levenberg does where a whole step leads away.
//!
//! Does not know: how stable a solution is, families.
//!
//! # Source
//! Ben-Israel and Greville 2003, Generalized inverses, section 7.3 (Newton's method by least norm)

use nalgebra::{DMatrix, DVector};

use super::field::{Field, Point, Values, Variable};
use super::symmetry::Symmetry;

/// Singular values below this part of the largest are zeros.
const RANK: f64 = 1e-10;
/// Most steps of a search, and most times that a step is shortened, or damped more.
const LIMITS: (usize, usize) = (200, 40);
/// A step so small beside the unknowns ends the search.
const SMALL_STEP: f64 = 1e-13;
/// A residual counts as rounding up to this part of the size of its terms.
const ROUNDING: f64 = 1e-9;
/// Terms are no smaller than this where a residual is rounding.
const LEAST: f64 = 1e-4;
/// Unknowns beyond this have run away: the rates fall towards infinity.
const FAR: f64 = 1e9;

/// A quantity that may be kept at a value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Quantity {
    Variable(Variable),
    Invariant(usize),
    Position(usize),
    Residual(usize),
    Output(usize),
}

impl Quantity {
    pub(super) fn value(self, at: &Point, values: &Values<f64>) -> f64 {
        match self {
            Quantity::Variable(variable) => at.get(variable),
            Quantity::Invariant(k) => values.invariants[k],
            Quantity::Position(k) => values.positions[k],
            Quantity::Residual(k) => values.residuals[k],
            Quantity::Output(k) => values.outputs[k],
        }
    }

    /// Its derivative by a variable along which all functions have these derivatives.
    pub(super) fn slope(self, by: Variable, slopes: &Values<f64>) -> f64 {
        match self {
            Quantity::Variable(variable) => f64::from(variable == by),
            Quantity::Invariant(k) => slopes.invariants[k],
            Quantity::Position(k) => slopes.positions[k],
            Quantity::Residual(k) => slopes.residuals[k],
            Quantity::Output(k) => slopes.outputs[k],
        }
    }
}

/// The equations. The unknowns are the variables, the drifts `c`, and behind them the value of what a family goes
/// along, where there is such.
#[derive(Clone, Debug)]
pub(super) struct Equations<'a> {
    /// Has all numbers that are no unknowns.
    pub(super) base: &'a Point,
    pub(super) field: &'a Field<'a>,
    pub(super) symmetries: &'a [Symmetry],
    pub(super) variables: Vec<Variable>,
    /// Places of modes in the state, which stay on or off.
    pub(super) modes: &'a [usize],
    pub(super) held: Vec<(Quantity, f64)>,
    /// What a family goes along.
    pub(super) along: Option<Quantity>,
}

/// Residuals and their derivatives by all unknowns.
#[derive(Clone, Debug)]
pub(super) struct Linear {
    pub(super) residual: DVector<f64>,
    pub(super) jacobian: DMatrix<f64>,
}

/// Why there is no solution.
#[derive(Clone, Debug)]
pub(super) enum Missed {
    /// No values at the guess.
    NoValue,
    /// The smallest residuals near the guess are not zero.
    Residual(f64),
    /// The unknowns grow without bound.
    Away,
}

impl Equations<'_> {
    /// The unknowns at a point with drifts, and the value of what a family goes along.
    pub(super) fn unknowns(&self, at: &Point, drifts: &[f64], along: f64) -> DVector<f64> {
        let variables = self.variables.iter().map(|v| at.get(*v));
        let along = self.along.map(|_| along);
        DVector::from_iterator(self.n_unknowns(), variables.chain(drifts.iter().copied()).chain(along))
    }

    pub(super) fn n_unknowns(&self) -> usize {
        self.variables.len() + self.symmetries.len() + usize::from(self.along.is_some())
    }

    /// The point of unknowns.
    pub(super) fn point(&self, x: &DVector<f64>) -> Point {
        let mut at = self.base.clone();
        for (variable, value) in self.variables.iter().zip(x.iter()) {
            at.set(*variable, *value);
        }
        self.modes.iter().for_each(|k| at.y[*k] = self.base.y[*k]);
        if let Some(Quantity::Variable(variable)) = self.along
            && !self.variables.contains(&variable)
        {
            at.set(variable, x[x.len() - 1]);
        }
        at
    }

    /// The drifts among unknowns.
    pub(super) fn drifts(&self, x: &DVector<f64>) -> Vec<f64> {
        x.rows(self.variables.len(), self.symmetries.len()).iter().copied().collect()
    }

    /// The conditions beside the rates.
    pub(super) fn conditions(&self, x: &DVector<f64>) -> Vec<(Quantity, f64)> {
        let along = self.along.map(|quantity| (quantity, x[x.len() - 1]));
        self.held.iter().copied().chain(along).collect()
    }
}

/// Equations by their residuals.
pub(super) trait Solvable {
    /// The residuals at unknowns; nothing where they have no value.
    fn residual(&self, x: &DVector<f64>) -> Option<DVector<f64>>;

    /// Singular values of the derivatives below this part of the largest are zeros.
    fn rank(&self) -> f64 {
        RANK
    }

    /// Most steps of a search, and most times that a step is shortened, or damped more.
    fn limits(&self) -> (usize, usize) {
        LIMITS
    }

    /// The residuals and their derivatives; nothing where they have no value.
    fn linear(&self, x: &DVector<f64>) -> Option<Linear>;

    /// The solution near unknowns, with these further linear equations `row . x = value`.
    fn solve(&self, start: &DVector<f64>, further: &[(DVector<f64>, f64)]) -> Result<DVector<f64>, Missed> {
        let mut x = start.clone();
        let (steps, halvings) = self.limits();
        for _ in 0..steps {
            let Some(linear) = self.linear(&x).map(|linear| with_rows(linear, &x, further)) else {
                return Err(Missed::NoValue);
            };
            let size = linear.residual.norm();
            let Some(svd) = Svd::of_rank(&linear.jacobian, self.rank()) else { return Err(Missed::NoValue) };
            let mut found = None;
            let mut damping = 0.0;
            for _ in 0..halvings {
                let step = svd.step(&linear.residual, damping);
                let next = &x + &step;
                let residual = self.residual(&next);
                let residual = residual.map(|r| with_values(r, &next, further).norm());
                if residual.is_some_and(|r| r < size * (1.0 - 1e-4) || r == 0.0) {
                    found = Some((next, step));
                    break;
                }
                damping = if damping == 0.0 { 1e-6 * svd.largest() } else { 3.0 * damping };
            }
            let is_met = linear.is_met(&x);
            let Some((next, step)) = found else { return end(&x, &linear, is_met) };
            if next.amax() > FAR {
                return Err(Missed::Away);
            }
            let is_small = step.amax() <= SMALL_STEP * (1.0 + next.amax());
            x = next;
            if is_small && is_met {
                return Ok(x);
            }
        }
        let linear = self.linear(&x).map(|linear| with_rows(linear, &x, further));
        linear.map_or(Err(Missed::NoValue), |linear| end(&x, &linear, linear.is_met(&x)))
    }
}

impl Solvable for Equations<'_> {
    fn residual(&self, x: &DVector<f64>) -> Option<DVector<f64>> {
        let at = self.point(x);
        let values = self.field.values(&at)?;
        let mut rates = DVector::from_column_slice(&values.rates);
        let y = DVector::from_column_slice(&at.y);
        for (symmetry, drift) in self.symmetries.iter().zip(self.drifts(x)) {
            rates -= symmetry.at(&y) * drift;
        }
        let conditions = self.conditions(x);
        let rest = conditions.iter().map(|(quantity, value)| quantity.value(&at, &values) - value);
        let all: Vec<f64> = rates.iter().copied().chain(rest).collect();
        all.iter().all(|r| r.is_finite()).then(|| DVector::from_vec(all))
    }

    fn linear(&self, x: &DVector<f64>) -> Option<Linear> {
        let residual = self.residual(x)?;
        let at = self.point(x);
        let y = DVector::from_column_slice(&at.y);
        let conditions = self.conditions(x);
        let mut by = self.variables.clone();
        let extra = match self.along {
            Some(Quantity::Variable(variable)) if !by.contains(&variable) => Some(variable),
            _ => None,
        };
        by.extend(extra);
        let slopes = self.field.derivatives(&at, &by)?;
        let (n, last) = (at.y.len(), x.len() - 1);
        let mut jacobian = DMatrix::zeros(residual.len(), x.len());
        for (k, (variable, slopes)) in by.iter().zip(&slopes).enumerate() {
            let column = if k < self.variables.len() { k } else { last };
            for i in 0..n {
                jacobian[(i, column)] += slopes.rates[i];
            }
            if let Variable::State(j) = variable {
                for (symmetry, drift) in self.symmetries.iter().zip(self.drifts(x)) {
                    for i in 0..n {
                        jacobian[(i, column)] -= drift * symmetry.slope[(i, *j)];
                    }
                }
            }
            for (row, (quantity, _)) in conditions.iter().enumerate() {
                jacobian[(n + row, column)] += quantity.slope(*variable, slopes);
            }
        }
        for (k, symmetry) in self.symmetries.iter().enumerate() {
            let moved = -symmetry.at(&y);
            jacobian.view_mut((0, self.variables.len() + k), (n, 1)).copy_from(&moved);
        }
        if self.along.is_some() {
            jacobian[(residual.len() - 1, last)] -= 1.0;
        }
        jacobian.iter().all(|x| x.is_finite()).then_some(Linear { residual, jacobian })
    }
}

/// Where no step leads on.
fn end(x: &DVector<f64>, linear: &Linear, is_met: bool) -> Result<DVector<f64>, Missed> {
    if is_met { Ok(x.clone()) } else { Err(Missed::Residual(linear.residual.amax())) }
}

impl Linear {
    /// Whether every residual is rounding.
    fn is_met(&self, x: &DVector<f64>) -> bool {
        let sizes = self.jacobian.map(f64::abs) * x.map(|x| x.abs().max(1e-3));
        self.residual.iter().zip(sizes.iter()).all(|(r, size)| r.abs() <= ROUNDING * size.max(LEAST))
    }
}

fn with_values(residual: DVector<f64>, x: &DVector<f64>, further: &[(DVector<f64>, f64)]) -> DVector<f64> {
    let n = residual.len();
    let mut all = residual.resize_vertically(n + further.len(), 0.0);
    for (k, (row, value)) in further.iter().enumerate() {
        all[n + k] = row.dot(x) - value;
    }
    all
}

fn with_rows(linear: Linear, x: &DVector<f64>, further: &[(DVector<f64>, f64)]) -> Linear {
    let n = linear.residual.len();
    let residual = with_values(linear.residual, x, further);
    let mut jacobian = linear.jacobian.resize_vertically(n + further.len(), 0.0);
    for (k, (row, _)) in further.iter().enumerate() {
        jacobian.set_row(n + k, &row.transpose());
    }
    Linear { residual, jacobian }
}

/// A matrix by its singular values, with zeros where its rank says so.
pub(super) struct Svd {
    u: DMatrix<f64>,
    sizes: DVector<f64>,
    v: DMatrix<f64>,
}

impl Svd {
    pub(super) fn new(matrix: &DMatrix<f64>) -> Option<Svd> {
        Svd::of_rank(matrix, RANK)
    }

    /// Singular values below a part `rank` of the largest are zeros.
    pub(super) fn of_rank(matrix: &DMatrix<f64>, rank: f64) -> Option<Svd> {
        let svd = matrix.clone().try_svd(true, true, f64::EPSILON, 10_000)?;
        let cut = rank * svd.singular_values.max();
        let sizes = svd.singular_values.map(|s| if s > cut { s } else { 0.0 });
        Some(Svd { u: svd.u?, sizes, v: svd.v_t?.transpose() })
    }

    fn largest(&self) -> f64 {
        self.sizes.max()
    }

    /// The shortest step that meets the equations, or one that is shorter still.
    pub(super) fn step(&self, residual: &DVector<f64>, damping: f64) -> DVector<f64> {
        let parts = self.u.transpose() * residual;
        let filtered =
            parts.zip_map(
                &self.sizes,
                |part, s| {
                    if s > 0.0 { -part * s / (s * s + damping * damping) } else { 0.0 }
                },
            );
        &self.v * filtered
    }

    /// The part of a vector that the matrix takes to zero.
    pub(super) fn null_part(&self, vector: &DVector<f64>) -> DVector<f64> {
        let parts = self.v.transpose() * vector;
        let kept = parts.zip_map(&self.sizes, |part, s| if s > 0.0 { part } else { 0.0 });
        vector - &self.v * kept
    }
}
