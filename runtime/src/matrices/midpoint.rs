//! The isospectral midpoint rule, by fixed-point iteration from extrapolated starts.
//!
//! ```text
//! W_n = (I - Q) Y (I + Q),   W_(n+1) = (I + Q) Y (I - Q),   Q = i kappa h/2 P,   P = Delta_N^-1 Y
//! ```
//!
//! `I + Q` is the adjoint of `I - Q`, and `(I + Q) (I - Q)^-1` unitary: the spectrum of `W` is kept by the equations
//! themselves, whatever `P` is. With `A = P Y`, everything but `B = A P` of the two products is a sum of blocks:
//!
//! ```text
//! Y = W_n + D,   D = i kappa h/2 (A - A^+) - (kappa h/2)^2 B,   W_(n+1) = W_n + i kappa h (A - A^+)
//! ```
//!
//! `D` and `B` are Hermitian, of which the upper halves are computed. `B` is small of second order: an iteration that
//! takes it from the one before is nearly as good as one that computes it, so that every second one does. An end of the
//! iteration that is a part `r` of the vorticity away from the solution moves the Casimirs by the order of `h r`.
//!
//! Does not know: surfaces.

use super::panels::{
    Block, Extent, LANES, Row, add, adjoint, block, block_mut, element, n_panels, n_rows, product,
};
use super::{Laplacian, MatrixMut, MatrixRef};
use crate::error::{Error, Failure};
use crate::math::{mul_add, sqrt};
use crate::methods::two_sum;

/// Name of the method in errors.
const NAME: &str = "isospectral midpoint";

/// Choices of an integration by [`IsospectralMidpoint`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Options {
    /// The step, positive.
    pub step: f64,
    /// The iteration ends when it changes the vorticity by less than this part of it, in the norm of Frobenius; with
    /// zero it ends where round-off stops its progress.
    pub tolerance: f64,
    /// Limit on iterations of a step.
    pub max_iterations: u32,
    /// How many steps before may be extrapolated to start the iteration, 8 unless told; each takes room for one more
    /// matrix. As many are as would have come nearest to the last step: fewer where iterations end early.
    pub history: usize,
    /// Whether there is a constant stream function beside that of the vorticity; it takes room for one more matrix.
    pub has_background: bool,
}

/// Most steps that are extrapolated.
const MAX_HISTORY: usize = 8;

/// Steps between two looks at the number of steps that are best extrapolated.
const STEPS_OF_ORDER: u64 = 8;

impl Options {
    /// Steps of the size `h > 0`, iterated to round-off, so that Casimirs are kept to it.
    #[must_use]
    pub const fn fixed(h: f64) -> Self {
        Self { step: h, tolerance: 0.0, max_iterations: 100, history: MAX_HISTORY, has_background: false }
    }

    /// Sets the change at which the iteration ends, relative to the vorticity.
    #[must_use]
    pub const fn with_tolerance(mut self, tolerance: f64) -> Self {
        self.tolerance = tolerance;
        self
    }

    /// Sets the limit on iterations of a step.
    #[must_use]
    pub const fn with_max_iterations(mut self, limit: u32) -> Self {
        self.max_iterations = limit;
        self
    }

    /// Sets the largest number of steps that are extrapolated, up to 8.
    #[must_use]
    pub const fn with_history(mut self, steps: usize) -> Self {
        self.history = if steps < MAX_HISTORY { steps } else { MAX_HISTORY };
        self
    }

    /// Makes room for a [background](IsospectralMidpoint::background_mut).
    #[must_use]
    pub const fn with_background(mut self) -> Self {
        self.has_background = true;
        self
    }

    /// Checks every number of the options.
    ///
    /// # Errors
    ///
    /// [`Error::StepSize`], [`Error::RelativeTolerance`].
    pub fn validate(&self) -> Result<(), Error> {
        if !(self.step > 0.0 && self.step.is_finite()) {
            return Err(Error::StepSize { value: self.step });
        }
        if !(self.tolerance >= 0.0 && self.tolerance.is_finite()) {
            return Err(Error::RelativeTolerance { value: self.tolerance, least: 0.0 });
        }
        Ok(())
    }
}

/// Counts of work done since the solver was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct Stats {
    /// Steps.
    pub steps: u64,
    /// Iterations of all steps: solutions for the stream function, and products `P W`.
    pub iterations: u64,
    /// Products `P W P`.
    pub second_products: u64,
}

/// Moves the vorticity of a surface in fixed steps that keep its spectrum.
///
/// The method is of order 2, symmetric, and a Lie-Poisson integrator: traces of powers of the vorticity are kept to
/// round-off over any time, and the energy nearly. Steps end when the iteration does not change them any more; the
/// sums over steps are compensated.
///
/// # Source
///
/// Modin and Viviani, A Casimir preserving scheme for long-time simulation of spherical ideal hydrodynamics (2020);
/// Viviani, A minimal-variable symplectic method for isospectral flows (2020).
#[derive(Debug)]
pub struct IsospectralMidpoint<'s, L, S> {
    surface: &'s L,
    options: Options,
    storage: S,
    t: f64,
    /// What the sum `t` lacks.
    t_residue: f64,
    /// The step, signed, to which the history belongs.
    h: f64,
    /// Steps of the history that there are.
    n_known: usize,
    /// Where the next step goes in the history.
    next: usize,
    /// Steps that are extrapolated as soon as there are so many.
    order: usize,
    /// Norm of the vorticity, which the motion keeps; none before the first step.
    size: Option<f64>,
    stats: Stats,
}

/// The matrices of a solver.
struct Matrices<'a> {
    /// `W_n`.
    vorticity: &'a mut [Row],
    /// What the sum `vorticity` lacks, above the diagonal.
    residue: &'a mut [Row],
    /// `Y`.
    middle: &'a mut [Row],
    /// `P`.
    stream: &'a mut [Row],
    /// `A`.
    first: &'a mut [Row],
    /// `B`, above the diagonal.
    second: &'a mut [Row],
    /// The constant part of `P`, where there is one.
    background: &'a mut [Row],
    /// `D` of this step and of those before, above the diagonal.
    history: &'a mut [Row],
    work: &'a mut [Row],
}

impl<'a> Matrices<'a> {
    /// Rows of all matrices but the work space.
    fn n_rows(n: usize, options: &Options) -> usize {
        (7 + options.history + options.has_background as usize) * n_rows(n, n)
    }

    fn new(n: usize, options: &Options, storage: &'a mut [f64]) -> Self {
        let size = n_rows(n, n);
        let rows = storage.as_chunks_mut().0;
        let (vorticity, rows) = rows.split_at_mut(size);
        let (residue, rows) = rows.split_at_mut(size);
        let (middle, rows) = rows.split_at_mut(size);
        let (stream, rows) = rows.split_at_mut(size);
        let (first, rows) = rows.split_at_mut(size);
        let (second, rows) = rows.split_at_mut(size);
        let (background, rows) = rows.split_at_mut(if options.has_background { size } else { 0 });
        let (history, work) = rows.split_at_mut((1 + options.history) * size);
        Self { vorticity, residue, middle, stream, first, second, background, history, work }
    }
}

/// Writes the stream matrix `P` of a vorticity.
fn invert<L: Laplacian>(
    surface: &L,
    background: &[Row],
    vorticity: &[Row],
    stream: &mut [Row],
    work: &mut [Row],
) {
    surface.invert(vorticity, stream, work);
    add(stream, background);
}

impl<'s, L: Laplacian, S: AsRef<[f64]> + AsMut<[f64]>> IsospectralMidpoint<'s, L, S> {
    /// Numbers that a solver takes.
    #[must_use]
    pub fn storage(n: usize, options: &Options) -> usize {
        2 * LANES * (Matrices::n_rows(n, options) + L::n_work(n))
    }

    /// Places the fluid at rest, without vorticity, at time `t0`; `storage` has room for [`storage`](Self::storage)
    /// numbers.
    ///
    /// # Errors
    ///
    /// Those of [`Options::validate`]; [`Error::TimeNotFinite`]; [`Error::Storage`].
    pub fn new(surface: &'s L, mut storage: S, t0: f64, options: Options) -> Result<Self, Error> {
        options.validate()?;
        if !t0.is_finite() {
            return Err(Error::TimeNotFinite { value: t0 });
        }
        let (given, needed) = (storage.as_ref().len(), Self::storage(surface.n(), &options));
        match storage.as_mut().get_mut(..needed) {
            Some(numbers) => numbers.fill(0.0),
            None => return Err(Error::Storage { given, needed }),
        }
        Ok(Self {
            surface,
            options,
            storage,
            t: t0,
            t_residue: 0.0,
            h: 0.0,
            n_known: 0,
            next: 0,
            order: options.history,
            size: None,
            stats: Stats::default(),
        })
    }

    /// Time of the vorticity.
    #[must_use]
    pub const fn t(&self) -> f64 {
        self.t
    }

    /// The surface.
    #[must_use]
    pub const fn surface(&self) -> &'s L {
        self.surface
    }

    /// Counts of the work done so far.
    #[must_use]
    pub const fn stats(&self) -> Stats {
        self.stats
    }

    /// The vorticity.
    #[must_use]
    pub fn vorticity(&self) -> MatrixRef<'_> {
        let n = self.surface.n();
        MatrixRef { n, rows: &self.storage.as_ref().as_chunks().0[..n_rows(n, n)] }
    }

    /// The vorticity to write; what is known of steps before is forgotten.
    pub fn vorticity_mut(&mut self) -> MatrixMut<'_> {
        self.size = None;
        let n = self.surface.n();
        let Matrices { vorticity, residue, .. } = self.matrices();
        residue.fill([0.0; 2 * LANES]);
        MatrixMut { n, rows: vorticity }
    }

    /// The constant stream function to write, which is added to that of the vorticity; the steps before are
    /// forgotten. On the sphere `P = -Omega z` beside the vorticity that is seen from space is a frame that turns
    /// with the angular velocity `Omega`.
    ///
    /// # Panics
    ///
    /// Unless the options have a background.
    pub fn background_mut(&mut self) -> MatrixMut<'_> {
        assert!(self.options.has_background, "the options have no background");
        self.size = None;
        let n = self.surface.n();
        MatrixMut { n, rows: self.matrices().background }
    }

    /// Changes the vorticity by other terms of its motion, and keeps the steps before.
    pub(super) fn change_vorticity(&mut self, change: impl FnOnce(&mut [Row])) {
        let is_known = self.size.is_some();
        let Matrices { vorticity, residue, .. } = self.matrices();
        residue.fill([0.0; 2 * LANES]);
        change(vorticity);
        let size = is_known.then(|| sqrt(inner(vorticity, vorticity)));
        self.size = size;
    }

    /// Computes the stream function, with its constant part.
    pub fn stream(&mut self) -> MatrixRef<'_> {
        let surface = self.surface;
        let Matrices { vorticity, stream, background, work, .. } = self.matrices();
        invert(surface, background, vorticity, stream, work);
        MatrixRef { n: surface.n(), rows: stream }
    }

    /// Computes the derivative of the vorticity, `i kappa [P, W]`.
    pub fn derivative(&mut self) -> MatrixRef<'_> {
        let surface = self.surface;
        let (n, rate) = (surface.n(), surface.rate());
        let Matrices { vorticity, middle, stream, first, background, work, .. } = self.matrices();
        invert(surface, background, vorticity, stream, work);
        product(n, stream, vorticity, first, Extent::All);
        for a in 0..n_panels(n) {
            for b in 0..n_panels(n) {
                *block_mut(n, middle, a, b) = turned(&skew(n, first, a, b), rate);
            }
        }
        MatrixRef { n, rows: middle }
    }

    /// The energy `area/(2 N) tr((P + F) W)` with the constant part `F` of `P`.
    pub fn energy(&mut self) -> f64 {
        let surface = self.surface;
        let Matrices { vorticity, stream, background, work, .. } = self.matrices();
        invert(surface, background, vorticity, stream, work);
        let trace = inner(vorticity, stream) + inner(vorticity, background);
        0.5 * surface.area() / surface.n() as f64 * trace
    }

    /// The Casimirs `tr(W^k)/N` for `k = 1, 2, ..`, as many as there is room for.
    pub fn casimirs(&mut self, casimirs: &mut [f64]) {
        let n = self.surface.n();
        let Matrices { vorticity, middle: power, first: next, .. } = self.matrices();
        power.copy_from_slice(vorticity);
        for (at, casimir) in casimirs.iter_mut().enumerate() {
            // tr W^(2 j) = |W^j|^2, tr W^(2 j + 1) = <W^j, W^(j + 1)>.
            let trace = if at == 0 {
                (0..n).map(|i| element(n, vorticity, i, i)[0]).sum()
            } else if at % 2 == 1 {
                inner(power, power)
            } else {
                product(n, power, vorticity, next, Extent::All);
                let trace = inner(power, next);
                power.copy_from_slice(next);
                trace
            };
            *casimir = trace / n as f64;
        }
    }

    /// Takes a step of the size of the options, forwards in time.
    ///
    /// # Errors
    ///
    /// [`Error::NotConverged`]; [`Error::Failure`] where the vorticity is not finite. The vorticity before is kept.
    pub fn step(&mut self) -> Result<(), Error> {
        self.step_by(self.options.step)
    }

    /// Takes steps, forwards or backwards, until the time is exactly `t_end`; the last one is shortened.
    ///
    /// # Errors
    ///
    /// [`Error::TimeNotFinite`] for `t_end`, and those of [`step`](Self::step).
    pub fn integrate_to(&mut self, t_end: f64) -> Result<(), Error> {
        while let Some((h, is_last)) = self.step_towards(t_end)? {
            self.step_by(h)?;
            if is_last {
                self.set_clock((t_end, 0.0));
            }
        }
        Ok(())
    }

    /// The next step on the way to a time, and whether it is the last one; none where the time is reached.
    pub(super) fn step_towards(&self, t_end: f64) -> Result<Option<(f64, bool)>, Error> {
        if !t_end.is_finite() {
            return Err(Error::TimeNotFinite { value: t_end });
        }
        let remaining = (t_end - self.t) - self.t_residue;
        if remaining == 0.0 {
            return Ok(None);
        }
        let h = self.options.step.copysign(remaining);
        // A last step that differs by the rounding of times alone is one like the others.
        let ratio = remaining / h;
        Ok(Some(if ratio > 1.0 + 1e-9 {
            (h, false)
        } else {
            (if ratio > 1.0 - 1e-9 { h } else { remaining }, true)
        }))
    }

    /// The time, and what its sum lacks.
    pub(super) const fn clock(&self) -> (f64, f64) {
        (self.t, self.t_residue)
    }

    /// Makes the time another one.
    pub(super) const fn set_clock(&mut self, clock: (f64, f64)) {
        (self.t, self.t_residue) = clock;
    }

    /// Whether all of the vorticity is finite.
    ///
    /// # Errors
    /// [`Failure::NonFinite`].
    pub(super) fn finite(&self) -> Result<(), Error> {
        let n = self.surface.n();
        match non_finite(n, self.vorticity().rows) {
            Some(index) => Err(Failure::NonFinite { t: self.t, index }.into()),
            None => Ok(()),
        }
    }

    /// The options.
    pub(super) const fn options(&self) -> &Options {
        &self.options
    }

    fn matrices(&mut self) -> Matrices<'_> {
        Matrices::new(self.surface.n(), &self.options, self.storage.as_mut())
    }

    pub(super) fn step_by(&mut self, h: f64) -> Result<(), Error> {
        let (surface, options, t) = (self.surface, self.options, self.t);
        let n = surface.n();
        let factor = 0.5 * h * surface.rate();
        if self.size.is_none() || h != self.h {
            (self.n_known, self.order, self.h) = (0, options.history, h);
        }
        let (n_known, next, n_kept) = (self.n_known, self.next, 1 + options.history);
        let mut stats = self.stats;
        let mut m = Matrices::new(n, &options, self.storage.as_mut());
        let size = match self.size {
            Some(size) => size,
            None => sqrt(inner(m.vorticity, m.vorticity)),
        };
        start(n, &mut m, n_known.min(self.order), next, n_kept);
        let bound = options.tolerance * size;
        let (mut previous, mut iterations) = (f64::INFINITY, 0);
        // Whether B may be that of the iteration before. It converges as the square of the step, whatever the motion:
        // in a first step, without history, that is slower than all else.
        let mut may_lag = n_known > 0;
        loop {
            if iterations == options.max_iterations {
                return Err(Error::NotConverged { method: NAME, t, h, iterations });
            }
            let with_second = !may_lag || iterations.is_multiple_of(2);
            invert(surface, m.background, m.middle, m.stream, m.work);
            product(n, m.stream, m.middle, m.first, Extent::All);
            if with_second {
                product(n, m.first, m.stream, m.second, Extent::Upper);
            }
            let change = sqrt(improve(n, &mut m, next, factor));
            iterations += 1;
            stats.iterations += 1;
            stats.second_products += u64::from(with_second);
            if change <= bound || change <= f64::EPSILON * size && change > 0.5 * previous {
                break;
            }
            if !change.is_finite() {
                let index = non_finite(n, m.middle).unwrap_or(0);
                return Err(Failure::NonFinite { t, index }.into());
            }
            if change >= previous {
                if !may_lag && change <= ROUND_OFF * size {
                    break;
                }
                if iterations > PATIENCE && !may_lag {
                    return Err(Error::NotConverged { method: NAME, t, h, iterations });
                }
                may_lag = false;
            }
            may_lag &= change > 0.1 * ROUND_OFF * size;
            previous = change;
        }
        finish(n, &mut m, 2.0 * factor);
        stats.steps += 1;
        if n_known == options.history && stats.steps.is_multiple_of(STEPS_OF_ORDER) {
            self.order = best_order(n, m.history, next, n_kept);
        }
        (self.t, self.t_residue) = two_sum(t, h + self.t_residue);
        (self.n_known, self.next) = ((n_known + 1).min(options.history), (next + 1) % n_kept);
        (self.size, self.stats) = (Some(size), stats);
        Ok(())
    }
}

/// Changes that stop to decrease above this part of the vorticity are no round-off.
const ROUND_OFF: f64 = 1e3 * f64::EPSILON;
/// Changes may grow at first.
const PATIENCE: u32 = 10;

/// `tr(x y)` of Hermitian matrices.
fn inner(x: &[Row], y: &[Row]) -> f64 {
    let mut sums = [0.0; 2 * LANES];
    for (x, y) in x.iter().zip(y) {
        for (sum, (x, y)) in sums.iter_mut().zip(x.iter().zip(y)) {
            *sum = mul_add(*x, *y, *sum);
        }
    }
    sums.iter().sum()
}

fn non_finite(n: usize, matrix: &[Row]) -> Option<usize> {
    let is_bad = |at: &usize| !element(n, matrix, at / n, at % n).iter().all(|x| x.is_finite());
    (0..n * n).find(is_bad)
}

/// The start of the iteration: `D` by the polynomial through those of the steps before.
fn start(n: usize, m: &mut Matrices<'_>, n_known: usize, next: usize, n_kept: usize) {
    let size = n_rows(n, n);
    // The weights (-1)^k (q choose k + 1) of the step k + 1 steps ago.
    let mut weights = [0.0; MAX_HISTORY];
    let mut weight = -1.0;
    for (k, of_step) in weights.iter_mut().enumerate().take(n_known) {
        weight *= -((n_known - k) as f64) / (k + 1) as f64;
        *of_step = weight;
    }
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            let mut d: Block = [[0.0; 2 * LANES]; LANES];
            for (k, &weight) in weights[..n_known].iter().enumerate() {
                let slot = (next + n_kept - 1 - k) % n_kept;
                let old = block(n, &m.history[slot * size..][..size], a, b);
                for i in 0..LANES {
                    for l in 0..2 * LANES {
                        d[i][l] = mul_add(weight, old[i][l], d[i][l]);
                    }
                }
            }
            place(n, m, next, (a, b), &d);
        }
    }
}

/// The number of steps whose extrapolation comes nearest to the step in the slot `next`, in the norm of Frobenius: the
/// error of the polynomial through `q` steps before is the backward difference of the order `q`. Where iterations end
/// early, what they leave over is multiplied by `2^q`.
#[cold]
#[inline(never)]
fn best_order(n: usize, history: &[Row], next: usize, n_kept: usize) -> usize {
    let size = n_rows(n, n);
    let mut squares = [0.0; 1 + MAX_HISTORY];
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            for i in 0..LANES {
                let mut differences = [[0.0; 2 * LANES]; 1 + MAX_HISTORY];
                for (k, of_step) in differences.iter_mut().enumerate().take(n_kept) {
                    let slot = (next + n_kept - k) % n_kept;
                    *of_step = block(n, &history[slot * size..][..size], a, b)[i];
                }
                for (q, square) in squares.iter_mut().enumerate().take(n_kept).skip(1) {
                    for k in 0..n_kept - q {
                        for l in 0..2 * LANES {
                            differences[k][l] -= differences[k + 1][l];
                        }
                    }
                    *square += differences[0].iter().map(|x| x * x).sum::<f64>();
                }
            }
        }
    }
    let mut best = 0;
    for q in 1..n_kept {
        if best == 0 || squares[q] < squares[best] {
            best = q;
        }
    }
    best
}

/// Writes a block of `D`, and of `Y = W + D`.
#[inline(always)]
fn place(n: usize, m: &mut Matrices<'_>, next: usize, (a, b): (usize, usize), d: &Block) {
    let size = n_rows(n, n);
    *block_mut(n, &mut m.history[next * size..][..size], a, b) = *d;
    let (w, y) = (block(n, m.vorticity, a, b), block_mut(n, m.middle, a, b));
    for i in 0..LANES {
        for l in 0..2 * LANES {
            y[i][l] = w[i][l] + d[i][l];
        }
    }
    if a != b {
        let y = *y;
        *block_mut(n, m.middle, b, a) = adjoint(&y);
    }
}

/// `A - A^+`.
#[inline(always)]
fn skew(n: usize, first: &[Row], a: usize, b: usize) -> Block {
    let (mut x, y) = (*block(n, first, a, b), adjoint(block(n, first, b, a)));
    for i in 0..LANES {
        for l in 0..2 * LANES {
            x[i][l] -= y[i][l];
        }
    }
    x
}

/// `i factor x`.
#[inline(always)]
fn turned(x: &Block, factor: f64) -> Block {
    let mut out = [[0.0; 2 * LANES]; LANES];
    for i in 0..LANES {
        for l in 0..LANES {
            out[i][l] = -factor * x[i][LANES + l];
            out[i][LANES + l] = factor * x[i][l];
        }
    }
    out
}

/// Makes `D` and `Y` from `A` and `B`; the square of the norm of the change.
fn improve(n: usize, m: &mut Matrices<'_>, next: usize, factor: f64) -> f64 {
    let size = n_rows(n, n);
    let square = factor * factor;
    let mut total = 0.0;
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            // D = X + Y^+, of X = i factor A - factor^2 B above the diagonal, and Y = i factor A below it; on it half
            // of B is in both, so that D is Hermitian to the last digit.
            let (first, second) = (block(n, m.first, a, b), block(n, m.second, a, b));
            let of_second = if a == b { 0.5 * square } else { square };
            let mut d: Block = [[0.0; 2 * LANES]; LANES];
            for i in 0..LANES {
                for l in 0..LANES {
                    let (re, im) = (l, LANES + l);
                    d[i][re] = mul_add(-factor, first[i][im], -(of_second * second[i][re]));
                    d[i][im] = mul_add(factor, first[i][re], -(of_second * second[i][im]));
                }
            }
            let below = if a == b { adjoint(&d) } else { adjoint(&turned(block(n, m.first, b, a), factor)) };
            let old = block(n, &m.history[next * size..][..size], a, b);
            let mut sums = [0.0; LANES];
            for i in 0..LANES {
                for l in 0..LANES {
                    let (re, im) = (l, LANES + l);
                    d[i][re] += below[i][re];
                    d[i][im] += below[i][im];
                    let (x, y) = (d[i][re] - old[i][re], d[i][im] - old[i][im]);
                    sums[l] = mul_add(x, x, mul_add(y, y, sums[l]));
                }
            }
            total += if a == b { 1.0 } else { 2.0 } * sums.iter().sum::<f64>();
            place(n, m, next, (a, b), &d);
        }
    }
    total
}

/// `W_(n+1)` from `A`, with the rounding errors of the sum kept.
fn finish(n: usize, m: &mut Matrices<'_>, factor: f64) {
    for a in 0..n_panels(n) {
        for b in a..n_panels(n) {
            let skew = skew(n, m.first, a, b);
            let vorticity = block_mut(n, m.vorticity, a, b);
            let residue = block_mut(n, m.residue, a, b);
            for i in 0..LANES {
                for l in 0..LANES {
                    let (re, im) = (l, LANES + l);
                    let (x, y) = (
                        mul_add(-factor, skew[i][im], residue[i][re]),
                        mul_add(factor, skew[i][re], residue[i][im]),
                    );
                    (vorticity[i][re], residue[i][re]) = two_sum(vorticity[i][re], x);
                    (vorticity[i][im], residue[i][im]) = two_sum(vorticity[i][im], y);
                }
            }
            if a != b {
                let vorticity = *vorticity;
                *block_mut(n, m.vorticity, b, a) = adjoint(&vorticity);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::vec;

    use super::{LANES, best_order, block_mut, n_panels, n_rows};

    /// Steps along a cubic, each with an error, are extrapolated from four, or from fewer where the error is large.
    #[test]
    fn the_order_of_the_start_follows_the_errors_of_steps() {
        let (n, n_kept) = (11, 9);
        let size = n_rows(n, n);
        for next in [0, 5, 8] {
            let order = |error: f64| {
                let mut history = vec![[0.0; 2 * LANES]; n_kept * size];
                for back in 0..n_kept {
                    let slot = (next + n_kept - back) % n_kept;
                    let t = 0.1 * back as f64;
                    let sign = if back % 2 == 0 { 1.0 } else { -1.0 };
                    let value = 1.0 + t * (1.0 + t * (1.0 + t)) + sign * error;
                    for a in 0..n_panels(n) {
                        for b in a..n_panels(n) {
                            *block_mut(n, &mut history[slot * size..][..size], a, b) =
                                [[value; 2 * LANES]; LANES];
                        }
                    }
                }
                best_order(n, &history, next, n_kept)
            };
            // An alternating error is multiplied by 2^q in the difference of the order q; those of the cubic are
            // 0.11, 0.03, 0.006 and zero.
            assert_eq!(order(1e-6), 4);
            assert_eq!(order(1e-3), 3);
            assert_eq!(order(1.0), 1);
        }
    }
}
