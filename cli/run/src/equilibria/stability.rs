//! Whether motions near a relative equilibrium stay near it: eigenvalues on the reduced space, and the second variation
//! of the energy.
//!
//! In the frame that moves with the drift `zeta = sum c_k Z_k`, small deviations move by `L = Df - D zeta`. The span
//! of the gradients of invariants is mapped into itself by `L^T`, that of the symmetries by `L`. Both are taken out:
//! `L` acts on the deviations that change no invariant, modulo the symmetries among them (the isotropy group of the
//! momentum). The eigenvalues that are left decide. Where all lie on the imaginary axis and the energy is an
//! invariant, it decides by its second variation on the same space, with multipliers for the other invariants:
//!
//! ```text
//! d(E + sum lambda_j I_j) = 0,   d^2(E + sum lambda_j I_j) definite
//! ```
//!
//! Does not know: how the equilibrium was found.
//!
//! # Source
//! Arnold 1966, Sur un principe variationnel pour les ecoulements stationnaires (energy and Casimirs); Simo, Lewis and
//! Marsden 1991, Stability of relative equilibria, part I, section 2 (energy and momenta, modulo symmetries); Routh
//! 1877 (integrals of constrained systems)

use nalgebra::{DMatrix, DVector};

use super::field::{Field, Point, Values, Variable};
use super::symmetry::Symmetry;
use crate::eigenvalues::{eigenvalues, sort};

/// A vector beside which another one of this part of its size is zero.
const SMALL: f64 = 1e-7;
/// Eigenvalues nearer to zero than this part of the largest are zero.
const NEUTRAL: f64 = 1e-7;
/// Singular values below this part of the largest are zero: equilibria are known to some 1e-13.
const ZERO: f64 = 1e-9;
/// At rest, derivatives may be smaller than at the guess by this factor, and count as zeros below [`ZERO`] of that.
const RESTED: f64 = 1e-3;
/// Logarithms of multipliers below this are zero: what the tolerance of the integration leaves of their digits.
const INTEGRATED: f64 = 1e-6;
/// Most steps towards a definite matrix.
const MAX_ASCENTS: usize = 300;
/// Where two real eigenvalues meet, rounding parts them by the root of the roundoff.
const REAL: f64 = 1e-4;

/// What the linear motion and the energy say.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// A deviation grows, at first by `exp(rate t)`.
    Unstable {
        /// The largest real part.
        rate: f64,
    },
    /// All deviations die out, the slowest by `exp(-rate t)`.
    Asymptotic {
        /// The smallest distance of an eigenvalue from the imaginary axis.
        rate: f64,
    },
    /// The second variation of the energy is definite.
    Stable,
    /// No deviation grows in the linear approximation; the second variation of the energy is not definite, or there
    /// is none.
    Spectral,
    /// No deviation is left: invariants and symmetries leave no freedom.
    Rigid,
}

impl Verdict {
    /// One word for tables and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Unstable { .. } => "unstable",
            Verdict::Asymptotic { .. } => "asymptotically stable",
            Verdict::Stable => "stable",
            Verdict::Spectral => "spectrally stable",
            Verdict::Rigid => "rigid",
        }
    }

    /// The largest real part of an eigenvalue.
    pub fn growth(self) -> f64 {
        match self {
            Verdict::Unstable { rate } => rate,
            Verdict::Asymptotic { rate } => -rate,
            Verdict::Stable | Verdict::Spectral | Verdict::Rigid => 0.0,
        }
    }
}

/// What the second variation of the energy says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EnergyTest {
    /// Number of its eigenvalues above zero.
    pub n_positive: usize,
    /// Number of its eigenvalues below zero.
    pub n_negative: usize,
    /// Number of its eigenvalues that are zero.
    pub n_zero: usize,
}

impl EnergyTest {
    /// Whether all have one sign.
    pub fn is_definite(self) -> bool {
        self.n_zero == 0 && (self.n_positive == 0) != (self.n_negative == 0)
    }
}

/// The stability of a relative equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub struct Stability {
    /// What it comes to.
    pub verdict: Verdict,
    /// Eigenvalues on the reduced space that are not zero, real and imaginary part, the largest real part first.
    pub eigenvalues: Vec<[f64; 2]>,
    /// Floquet's multipliers of an orbit, the largest first; its eigenvalues are the exponents.
    pub multipliers: Vec<[f64; 2]>,
    /// Number of deviations that change an invariant.
    pub n_invariants: usize,
    /// Number of deviations along symmetries.
    pub n_symmetries: usize,
    /// Number of eigenvalues that are zero: equilibria in families.
    pub n_neutral: usize,
    /// Numbers below this are zero beside the eigenvalues.
    cut: f64,
    /// What the energy says, where it is an invariant that has no first variation.
    pub energy: Option<EnergyTest>,
}

/// A reduced space.
struct Reduced {
    /// An orthonormal basis, column by column.
    space: DMatrix<f64>,
    n_invariants: usize,
    n_symmetries: usize,
    /// Gradients of everything that is kept.
    kept: Vec<DVector<f64>>,
    /// Gradients of the components that never change.
    constants: Vec<DVector<f64>>,
}

/// What deviations are told by.
pub(super) struct Setting<'a> {
    pub(super) field: &'a Field<'a>,
    pub(super) symmetries: &'a [Symmetry],
    /// Whether there is an energy that is kept: the first of all that is kept.
    pub(super) has_energy: bool,
    /// The components of the state that never change.
    pub(super) constants: &'a [bool],
    /// Places of modes: no deviation switches one.
    pub(super) modes: &'a [usize],
    /// The size of derivatives of the rates where the search began: eigenvalues that are rounding beside it are zero.
    pub(super) scale: f64,
}

impl Setting<'_> {
    /// The stability of an equilibrium with these drifts; nothing where a derivative has no value.
    pub(super) fn stability(&self, at: &Point, drifts: &[f64]) -> Option<Stability> {
        let slopes = self.slopes(at)?;
        let motion = self.motion(&slopes, drifts);
        let Reduced { space, n_invariants, n_symmetries, kept, constants } =
            self.reduced(at, &slopes, (&motion, true), Vec::new())?;
        let (reduced, n_neutral) = without_null(space.transpose() * &motion * &space, self.scale)?;
        let mut eigenvalues = eigenvalues(&reduced)?;
        sort(&mut eigenvalues);
        let energy = self.energy_test(at, &kept, &constants, &space);
        let mut found = Stability {
            verdict: Verdict::Rigid,
            eigenvalues,
            multipliers: Vec::new(),
            n_invariants,
            n_symmetries,
            n_neutral,
            cut: 0.0,
            energy,
        };
        let largest = found.eigenvalues.iter().fold(0.0, |max: f64, z| max.max(z[0].hypot(z[1])));
        found.cut = NEUTRAL * largest;
        found.judge();
        Some(found)
    }

    /// The stability of an orbit of a period whose flow has these derivatives, seen from the frame that drifts along:
    /// Floquet's multipliers, and exponents for eigenvalues. Where
    /// events change the state on the way, invariants and symmetries are asked one by one whether they are kept.
    pub(super) fn of_orbit(
        &self,
        at: &Point,
        (monodromy, is_smooth): (&DMatrix<f64>, bool),
        period: f64,
    ) -> Option<Stability> {
        let slopes = self.slopes(at)?;
        let n = at.y.len();
        let ahead = DVector::from_vec(self.field.values(at)?.rates);
        // The flow and its difference from one have the same invariant spaces.
        let change = monodromy - DMatrix::identity(n, n);
        let Reduced { space, n_invariants, n_symmetries, .. } =
            self.reduced(at, &slopes, (&change, is_smooth), vec![ahead])?;
        let (reduced, n_neutral) = without_null(space.transpose() * &change * &space, 1.0)?;
        let mut multipliers = eigenvalues(&reduced)?;
        multipliers.iter_mut().for_each(|z| z[0] += 1.0);
        multipliers.sort_by(|x, y| y[0].hypot(y[1]).total_cmp(&x[0].hypot(x[1])));
        let exponent =
            |z: &[f64; 2]| [z[0].hypot(z[1]).max(f64::MIN_POSITIVE).ln() / period, z[1].atan2(z[0]) / period];
        let mut found = Stability {
            verdict: Verdict::Rigid,
            eigenvalues: multipliers.iter().map(exponent).collect(),
            multipliers,
            n_invariants,
            n_symmetries,
            n_neutral,
            cut: INTEGRATED / period,
            energy: None,
        };
        sort(&mut found.eigenvalues);
        found.judge();
        Some(found)
    }

    fn slopes(&self, at: &Point) -> Option<Vec<Values<f64>>> {
        let by: Vec<Variable> = (0..at.y.len()).map(Variable::State).collect();
        self.field.derivatives(at, &by).filter(|slopes| slopes.iter().all(Values::are_finite))
    }

    /// `L`.
    fn motion(&self, slopes: &[Values<f64>], drifts: &[f64]) -> DMatrix<f64> {
        let n = slopes.len();
        let mut motion = DMatrix::from_fn(n, n, |i, j| slopes[j].rates[i]);
        for (symmetry, drift) in self.symmetries.iter().zip(drifts) {
            motion -= &symmetry.slope * *drift;
        }
        motion
    }

    /// The reduced space on which a matrix acts; `ahead` are directions that go like symmetries.
    fn reduced(
        &self,
        at: &Point,
        slopes: &[Values<f64>],
        (matrix, is_smooth): (&DMatrix<f64>, bool),
        ahead: Vec<DVector<f64>>,
    ) -> Option<Reduced> {
        let n = at.y.len();
        let y = DVector::from_column_slice(&at.y);
        let kept = gradients(slopes, Values::kept);
        let n_strict = slopes.first().map_or(0, |s| s.positions.len() + s.residuals.len());
        let (of_motion, strict) = kept.split_at(kept.len() - n_strict);
        let unit = |k: usize| DVector::from_fn(n, |j, _| f64::from(j == k));
        let is_constant = |k: &usize| self.constants[*k] && !self.modes.contains(k);
        let constants: Vec<DVector<f64>> = (0..n).filter(is_constant).map(unit).collect();
        let modes: Vec<DVector<f64>> = self.modes.iter().map(|k| unit(*k)).collect();
        // Momenta that a drift turns stay among momenta.
        let turned = matrix.transpose();
        let is_met = |matrix: &DMatrix<f64>, v: &DVector<f64>| {
            is_smooth || (matrix * v).norm() <= SMALL * matrix.norm() * v.norm()
        };
        let all = of_motion.iter().chain(&constants).filter(|g| is_met(&turned, g));
        let conserved = invariant_span(&turned, all.chain(strict).chain(&modes));
        let level = null_space(&conserved, n)?;
        let moved: Vec<DVector<f64>> = self.symmetries.iter().map(|s| s.at(&y)).chain(ahead).collect();
        let along = invariant_span(matrix, moved.iter().filter(|z| is_met(matrix, z)));
        let (space, n_symmetries) = modulo(&level, &along)?;
        let n_invariants = n - level.ncols() - modes.len();
        let constants = [constants, modes].concat();
        Some(Reduced { n_invariants, space, n_symmetries, kept, constants })
    }

    /// The signs of the second variation on a space; nothing where the energy is not kept, or has a first one.
    fn energy_test(
        &self,
        at: &Point,
        kept: &[DVector<f64>],
        constants: &[DVector<f64>],
        space: &DMatrix<f64>,
    ) -> Option<EnergyTest> {
        if !self.has_energy {
            return None;
        }
        let n = at.y.len();
        let gradients: Vec<&DVector<f64>> = kept.iter().chain(constants).collect();
        let twin = self.field.energy_among_invariants().map(|k| k + 1);
        let others: Vec<usize> = (1..gradients.len()).filter(|k| Some(*k) != twin).collect();
        let columns = DMatrix::from_fn(n, others.len(), |i, k| gradients[others[k]][i]);
        let first = gradients[0];
        let mut weights = DVector::zeros(gradients.len());
        weights[0] = 1.0;
        let mut free = Vec::new();
        let mut rest = first.clone();
        if !others.is_empty() {
            let rows: Vec<DVector<f64>> = columns.row_iter().map(|row| row.transpose()).collect();
            let rows: Vec<&DVector<f64>> = rows.iter().filter(|row| row.norm() > 0.0).collect();
            let svd = columns.clone().svd(true, true);
            let multipliers = svd.solve(&(-first), 1e-10 * columns.norm()).ok()?;
            rest += &columns * &multipliers;
            others.iter().zip(multipliers.iter()).for_each(|(k, lambda)| weights[*k] = *lambda);
            let null = null_space(&rows, others.len())?;
            free = null
                .column_iter()
                .map(|column| with_places(&others, column.iter(), gradients.len()))
                .collect();
        }
        if rest.norm() > SMALL * first.norm() && rest.norm() > 1e-12 {
            return None;
        }
        let second = |weights: &DVector<f64>| {
            // Components of the state have no second derivatives.
            Some(space.transpose() * self.field.hessian(at, &weights.as_slice()[..kept.len()])? * space)
        };
        let by_free = free.iter().map(second).collect::<Option<Vec<_>>>()?;
        let own = second(&weights)?;
        let are_finite = by_free.iter().chain([&own]).all(|m| m.iter().all(|x| x.is_finite()));
        are_finite.then(|| EnergyTest::of(&most_definite(own, &by_free)))
    }
}

/// A vector with these values in some places.
fn with_places<'v>(places: &[usize], values: impl Iterator<Item = &'v f64>, n: usize) -> DVector<f64> {
    let mut all = DVector::zeros(n);
    places.iter().zip(values).for_each(|(k, value)| all[*k] = *value);
    all
}

/// The most definite of the matrices `first + sum x_k others_k`, of either sign: dependent gradients leave multipliers
/// free. The least eigenvalue is a concave function of `x`, and Polyak's steps along its gradient lead upwards.
fn most_definite(first: DMatrix<f64>, others: &[DMatrix<f64>]) -> DMatrix<f64> {
    if others.iter().all(|m| m.amax() == 0.0) || first.is_empty() {
        return first;
    }
    for sign in [1.0, -1.0] {
        let mut x = vec![0.0; others.len()];
        for _ in 0..MAX_ASCENTS {
            let sum = others.iter().zip(&x).fold(first.clone(), |sum, (m, x)| sum + m * *x);
            let eigen = (&sum * sign).symmetric_eigen();
            let (least, low) = eigen.eigenvalues.argmin();
            if low > NEUTRAL * sum.amax() {
                return sum;
            }
            let v = eigen.eigenvectors.column(least);
            let slope: Vec<f64> = others.iter().map(|m| sign * v.dot(&(m * v))).collect();
            let size: f64 = slope.iter().map(|s| s * s).sum();
            if size <= 1e-20 * sum.amax() * sum.amax() {
                break;
            }
            // A little beyond zero, so that a definite matrix is met in a finite number of steps.
            let ahead = 1e-3 * first.amax() - low;
            x.iter_mut().zip(&slope).for_each(|(x, s)| *x += ahead * s / size);
        }
    }
    first
}

impl EnergyTest {
    /// The signs of the eigenvalues of a matrix.
    fn of(matrix: &DMatrix<f64>) -> EnergyTest {
        let values = match matrix.is_empty() {
            true => DVector::zeros(0),
            false => matrix.clone().symmetric_eigenvalues(),
        };
        let cut = NEUTRAL * values.iter().fold(0.0, |max: f64, x| max.max(x.abs()));
        let count = |is: fn(f64, f64) -> bool| values.iter().filter(|x| is(**x, cut)).count();
        EnergyTest {
            n_positive: count(|x, cut| x > cut),
            n_negative: count(|x, cut| x < -cut),
            n_zero: count(|x, cut| x.abs() <= cut),
        }
    }
}

impl Stability {
    /// Numbers below this are zero beside the eigenvalues.
    pub(super) fn cut(&self) -> f64 {
        self.cut
    }

    /// Number of growing deviations.
    pub(super) fn n_growing(&self) -> usize {
        self.eigenvalues.iter().filter(|z| z[0] > self.cut).count()
    }

    /// Whether it is a real eigenvalue that has changed its sign since a neighbour.
    pub(super) fn is_divergence(&self, before: &Stability) -> bool {
        if self.n_neutral > before.n_neutral {
            return true;
        }
        let nearest = self.eigenvalues.iter().min_by(|x, y| x[0].abs().total_cmp(&y[0].abs()));
        nearest.is_some_and(|z| z[1].abs() <= REAL / NEUTRAL * self.cut)
    }

    /// Whether the multiplier nearest to the unit circle is minus one.
    pub(super) fn is_doubling(&self) -> bool {
        let distance = |z: &[f64; 2]| (z[0].hypot(z[1]) - 1.0).abs();
        let nearest = self.multipliers.iter().min_by(|x, y| distance(x).total_cmp(&distance(y)));
        nearest.is_some_and(|z| z[0] < 0.0 && z[1].abs() <= REAL)
    }

    /// What eigenvalues and energy come to.
    fn judge(&mut self) {
        let cut = self.cut;
        let growth = self.eigenvalues.iter().fold(f64::NEG_INFINITY, |max, z| max.max(z[0]));
        self.verdict = match () {
            () if self.eigenvalues.is_empty() && self.n_neutral == 0 => Verdict::Rigid,
            () if growth > cut => Verdict::Unstable { rate: growth },
            () if growth < -cut && self.n_neutral == 0 => Verdict::Asymptotic { rate: -growth },
            () if self.energy.is_some_and(EnergyTest::is_definite) => Verdict::Stable,
            () => Verdict::Spectral,
        };
    }
}

/// A matrix without its eigenvalue zero, and the multiplicity of that: it acts on the quotient by its null space, again
/// and again, so that chains of generalised eigenvectors, whose eigenvalues rounding would scatter, go as well.
fn without_null(mut matrix: DMatrix<f64>, scale: f64) -> Option<(DMatrix<f64>, usize)> {
    let n = matrix.ncols();
    let cut = ZERO * matrix.norm().max(RESTED * scale);
    while matrix.ncols() > 0 {
        let svd = matrix.clone().try_svd(false, true, f64::EPSILON, 10_000)?;
        let (sizes, v) = (svd.singular_values, svd.v_t?);
        let kept: Vec<DVector<f64>> =
            (0..sizes.len()).filter(|k| sizes[*k] > cut).map(|k| v.row(k).transpose()).collect();
        if kept.len() == matrix.ncols() {
            break;
        }
        let basis = DMatrix::from_fn(matrix.ncols(), kept.len(), |i, k| kept[k][i]);
        matrix = basis.transpose() * matrix * basis;
    }
    let n_left = matrix.ncols();
    Some((matrix, n - n_left))
}

/// The vectors of a list whose span a matrix maps into itself.
fn invariant_span<'v>(
    matrix: &DMatrix<f64>,
    vectors: impl Iterator<Item = &'v DVector<f64>>,
) -> Vec<&'v DVector<f64>> {
    let mut kept: Vec<&DVector<f64>> = vectors.filter(|v| v.norm() > 0.0).collect();
    let size = matrix.norm();
    while !kept.is_empty() {
        let units: Vec<DVector<f64>> = kept.iter().map(|v| v.normalize()).collect();
        let svd = DMatrix::from_columns(&units).svd(true, false);
        let Some(u) = svd.u else { return kept };
        let rank = svd.singular_values.iter().filter(|s| **s > SMALL * svd.singular_values.max()).count();
        let basis = u.columns(0, rank);
        let stays = |unit: &DVector<f64>| {
            let moved = matrix * unit;
            let outside = &moved - basis * (basis.transpose() * &moved);
            outside.norm() <= SMALL * size
        };
        let n_before = kept.len();
        let mut each = units.iter();
        kept.retain(|_| each.next().is_some_and(&stays));
        if kept.len() == n_before {
            break;
        }
    }
    kept
}

/// The gradients of functions by the state, from their derivatives by each component.
fn gradients<'s, I: Iterator<Item = &'s f64>>(
    slopes: &'s [Values<f64>],
    list: impl Fn(&'s Values<f64>) -> I,
) -> Vec<DVector<f64>> {
    let columns: Vec<Vec<f64>> = slopes.iter().map(|by| list(by).copied().collect()).collect();
    let n_functions = columns.first().map_or(0, Vec::len);
    (0..n_functions).map(|k| DVector::from_fn(columns.len(), |j, _| columns[j][k])).collect()
}

/// An orthonormal basis of the vectors that all rows take to zero.
fn null_space(rows: &[&DVector<f64>], n: usize) -> Option<DMatrix<f64>> {
    // Rows of size one: gradients have units of their own.
    let units: Vec<DVector<f64>> = rows.iter().map(|row| row.normalize()).collect();
    let matrix = DMatrix::from_fn(n.max(units.len()), n, |i, j| units.get(i).map_or(0.0, |row| row[j]));
    let svd = matrix.try_svd(false, true, f64::EPSILON, 10_000)?;
    let (sizes, v) = (svd.singular_values, svd.v_t?);
    let cut = SMALL * sizes.max();
    let null: Vec<DVector<f64>> = (0..n).filter(|k| sizes[*k] <= cut).map(|k| v.row(k).transpose()).collect();
    Some(DMatrix::from_fn(n, null.len(), |i, k| null[k][i]))
}

/// An orthonormal basis of the part of a space that is orthogonal to all of these directions in it, and
/// their number.
fn modulo(space: &DMatrix<f64>, along: &[&DVector<f64>]) -> Option<(DMatrix<f64>, usize)> {
    if along.is_empty() || space.ncols() == 0 {
        return Some((space.clone(), 0));
    }
    let n = space.nrows();
    let units: Vec<DVector<f64>> = along.iter().map(|z| z.normalize()).collect();
    let directions = DMatrix::from_fn(n, units.len(), |i, k| units[k][i]);
    // Combinations of the directions whose part outside the space vanishes.
    let inside = space * (space.transpose() * &directions);
    let outside = &directions - &inside;
    let outside_rows: Vec<DVector<f64>> = (0..n).map(|i| outside.row(i).transpose()).collect();
    let svd = DMatrix::from_fn(n.max(units.len()), units.len(), |i, k| {
        outside_rows.get(i).map_or(0.0, |row| row[k])
    })
    .try_svd(false, true, f64::EPSILON, 10_000)?;
    let (sizes, v) = (svd.singular_values, svd.v_t?);
    let combined: Vec<DVector<f64>> = (0..units.len())
        .filter(|k| sizes[*k] <= SMALL)
        .map(|k| space.transpose() * &directions * v.row(k).transpose())
        .filter(|z| z.norm() > SMALL)
        .collect();
    let rows: Vec<&DVector<f64>> = combined.iter().collect();
    let rest = null_space(&rows, space.ncols())?;
    let n_directions = space.ncols() - rest.ncols();
    Some((space * rest, n_directions))
}
