//! Whether motions near a relative equilibrium stay near it: eigenvalues on the reduced space, and the second variation
//! of the energy.
//!
//! In the frame that moves with the drift `zeta = sum c_k Z_k`, small deviations move by `L = Df - D zeta`. Gradients of
//! invariants are left eigenvectors of `L` to the eigenvalue zero, symmetries that commute with the drift are right
//! ones. Both are taken out: `L` acts on the deviations that change no invariant, modulo the symmetries. What is left
//! are the eigenvalues that decide. Where all lie on the imaginary axis and the energy is an invariant, it decides by
//! its second variation on the same space, with multipliers for the other invariants:
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

/// A vector beside which another one of this part of its size is zero.
const SMALL: f64 = 1e-7;
/// Eigenvalues nearer to zero than this part of the largest are zero.
const NEUTRAL: f64 = 1e-7;
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
        self.n_zero == 0 && (self.n_positive == 0 || self.n_negative == 0)
    }
}

/// The stability of a relative equilibrium.
#[derive(Clone, Debug, PartialEq)]
pub struct Stability {
    /// What it comes to.
    pub verdict: Verdict,
    /// Eigenvalues on the reduced space, real and imaginary part, the largest real part first.
    pub eigenvalues: Vec<[f64; 2]>,
    /// Number of deviations that change an invariant.
    pub n_invariants: usize,
    /// Number of deviations along symmetries.
    pub n_symmetries: usize,
    /// Number of eigenvalues that are zero: equilibria in families.
    pub n_neutral: usize,
    /// What the energy says, where it is an invariant that has no first variation.
    pub energy: Option<EnergyTest>,
}

/// What deviations are told by.
pub(super) struct Setting<'a> {
    pub(super) field: &'a Field<'a>,
    pub(super) symmetries: &'a [Symmetry],
    /// The energy among the invariants.
    pub(super) energy: Option<usize>,
    /// The components of the state that never change.
    pub(super) constants: &'a [bool],
}

impl Setting<'_> {
    /// The stability of an equilibrium with these drifts; nothing where a derivative has no value.
    pub(super) fn stability(&self, at: &Point, drifts: &[f64]) -> Option<Stability> {
        let n = at.y.len();
        let y = DVector::from_column_slice(&at.y);
        let by: Vec<Variable> = (0..n).map(Variable::State).collect();
        let slopes = self.field.derivatives(at, &by)?;
        let mut motion = DMatrix::from_fn(n, n, |i, j| slopes[j].rates[i]);
        for (symmetry, drift) in self.symmetries.iter().zip(drifts) {
            motion -= &symmetry.slope * *drift;
        }
        let mut of_invariants = gradients(&slopes, |s| &s.invariants);
        let n_found = of_invariants.len();
        let constant = (0..n).filter(|k| self.constants[*k]);
        of_invariants.extend(constant.map(|k| DVector::from_fn(n, |j, _| f64::from(j == k))));
        let mut of_rest = gradients(&slopes, |s| &s.positions);
        of_rest.extend(gradients(&slopes, |s| &s.residuals));
        let size = motion.norm();
        // Momenta in directions that the drift turns are no left eigenvectors.
        let is_kept = |g: &&DVector<f64>| (motion.transpose() * *g).norm() <= SMALL * size * g.norm();
        let conserved: Vec<&DVector<f64>> =
            of_invariants.iter().filter(is_kept).chain(&of_rest).filter(|g| g.norm() > 0.0).collect();
        let level = null_space(&conserved, n)?;
        let moved: Vec<DVector<f64>> = self.symmetries.iter().map(|s| s.at(&y)).collect();
        let is_commuting = |z: &&DVector<f64>| (&motion * *z).norm() <= SMALL * size * z.norm();
        let along: Vec<&DVector<f64>> = moved.iter().filter(|z| z.norm() > 0.0).filter(is_commuting).collect();
        let (space, n_symmetries) = modulo(&level, &along)?;
        let reduced = space.transpose() * &motion * &space;
        let mut eigenvalues: Vec<[f64; 2]> = match reduced.is_empty() {
            true => Vec::new(),
            false => reduced.complex_eigenvalues().iter().map(|z| [z.re, z.im]).collect(),
        };
        eigenvalues.sort_by(|x, y| y[0].total_cmp(&x[0]).then(y[1].total_cmp(&x[1])));
        let energy = self.energy.and_then(|e| self.energy_test(at, (&of_invariants, n_found), e, &space));
        let mut found = Stability {
            verdict: Verdict::Rigid,
            eigenvalues,
            n_invariants: n - level.ncols(),
            n_symmetries,
            n_neutral: 0,
            energy,
        };
        found.judge();
        Some(found)
    }

    /// The signs of the second variation on a space; nothing where the first one does not vanish.
    fn energy_test(
        &self,
        at: &Point,
        (gradients, n_found): (&[DVector<f64>], usize),
        energy: usize,
        space: &DMatrix<f64>,
    ) -> Option<EnergyTest> {
        let n = at.y.len();
        let others: Vec<usize> = (0..gradients.len()).filter(|k| *k != energy).collect();
        let columns = DMatrix::from_fn(n, others.len(), |i, k| gradients[others[k]][i]);
        let first = &gradients[energy];
        let mut weights = DVector::zeros(gradients.len());
        weights[energy] = 1.0;
        let mut rest = first.clone();
        if !others.is_empty() {
            let multipliers = columns.clone().svd(true, true).solve(&(-first), 1e-10 * columns.norm()).ok()?;
            rest += &columns * &multipliers;
            others.iter().zip(multipliers.iter()).for_each(|(k, lambda)| weights[*k] = *lambda);
        }
        if rest.norm() > SMALL * (first.norm() + f64::MIN_POSITIVE) && rest.norm() > 1e-12 {
            return None;
        }
        let second = space.transpose() * self.field.hessian(at, &weights.rows(0, n_found).into_owned())? * space;
        let values = second.symmetric_eigenvalues();
        let cut = NEUTRAL * values.amax();
        let count = |is: fn(f64, f64) -> bool| values.iter().filter(|x| is(**x, cut)).count();
        Some(EnergyTest {
            n_positive: count(|x, cut| x > cut),
            n_negative: count(|x, cut| x < -cut),
            n_zero: count(|x, cut| x.abs() <= cut),
        })
    }
}

impl Stability {
    /// The largest absolute value of an eigenvalue.
    fn size(&self) -> f64 {
        self.eigenvalues.iter().fold(0.0, |max: f64, z| max.max(z[0].hypot(z[1])))
    }

    /// Number of growing deviations.
    pub(super) fn n_growing(&self) -> usize {
        let cut = NEUTRAL * self.size();
        self.eigenvalues.iter().filter(|z| z[0] > cut).count()
    }

    /// Whether the eigenvalue nearest to the imaginary axis is real.
    pub(super) fn is_divergence(&self) -> bool {
        let nearest = self.eigenvalues.iter().min_by(|x, y| x[0].abs().total_cmp(&y[0].abs()));
        nearest.is_some_and(|z| z[1].abs() <= REAL * self.size())
    }

    /// What eigenvalues and energy come to.
    fn judge(&mut self) {
        let cut = NEUTRAL * self.size();
        self.n_neutral = self.eigenvalues.iter().filter(|z| z[0].hypot(z[1]) <= cut).count();
        let growth = self.eigenvalues.iter().fold(f64::NEG_INFINITY, |max, z| max.max(z[0]));
        self.verdict = match () {
            () if self.eigenvalues.is_empty() => Verdict::Rigid,
            () if growth > cut => Verdict::Unstable { rate: growth },
            () if growth < -cut => Verdict::Asymptotic { rate: -growth },
            () if self.energy.is_some_and(EnergyTest::is_definite) => Verdict::Stable,
            () => Verdict::Spectral,
        };
    }
}

/// The gradients of functions by the state, from their derivatives by each component.
fn gradients(slopes: &[Values<f64>], list: impl Fn(&Values<f64>) -> &Vec<f64>) -> Vec<DVector<f64>> {
    let n_functions = slopes.first().map_or(0, |s| list(s).len());
    (0..n_functions).map(|k| DVector::from_fn(slopes.len(), |j, _| list(&slopes[j])[k])).collect()
}

/// An orthonormal basis of the vectors that all rows take to zero.
fn null_space(rows: &[&DVector<f64>], n: usize) -> Option<DMatrix<f64>> {
    // Rows of size one: gradients have units of their own.
    let units: Vec<DVector<f64>> = rows.iter().map(|row| row.normalize()).collect();
    let matrix = DMatrix::from_fn(n.max(units.len()), n, |i, j| units.get(i).map_or(0.0, |row| row[j]));
    let svd = matrix.try_svd(false, true, f64::EPSILON, 10_000)?;
    let (sizes, v) = (svd.singular_values, svd.v_t?);
    let cut = SMALL * sizes.max();
    let null: Vec<DVector<f64>> =
        (0..n).filter(|k| sizes[*k] <= cut).map(|k| v.row(k).transpose()).collect();
    Some(DMatrix::from_fn(n, null.len(), |i, k| null[k][i]))
}

/// An orthonormal basis of the part of a space that is orthogonal to those of these directions that lie in it, and their
/// number.
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
