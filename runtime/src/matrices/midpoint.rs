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
//! Fields that the flow carries are moved by the same rule ([`carried`](super::carried)), and iterated with the
//! vorticity.
//!
//! Does not know: surfaces.

use super::carried::{Carried, Current, Fields, Layout, MAX_CARRIED, Part};
use super::iteration::{
    Moved, best_order, errors_of_start, finish, improve, inner, non_finite, skew, start, turned,
};
use super::options::{Options, Stats};
use super::panels::{Extent, LANES, Row, add, block_mut, element, n_panels, n_rows, product};
use super::{Laplacian, MatrixMut, MatrixRef};
use crate::error::{Error, Failure};
use crate::math::sqrt;
use crate::methods::two_sum;

/// Name of the method in errors.
const NAME: &str = "isospectral midpoint";

/// Steps between two looks at the number of steps that are best extrapolated.
const STEPS_OF_ORDER: u64 = 8;

/// Moves the vorticity of a surface in fixed steps that keep its spectrum.
///
/// The method is of order 2, symmetric, and a Lie-Poisson integrator: traces of powers of the vorticity are kept to
/// round-off over any time, and the energy nearly. Steps end when the iteration does not change them any more; the
/// sums over steps are compensated.
///
/// With [carried fields](Options::with_carried) it is the magnetic midpoint rule, and keeps `tr A^k` of each field; of
/// one field `tr W A^k` as well.
///
/// # Source
///
/// Modin and Viviani, A Casimir preserving scheme for long-time simulation of spherical ideal hydrodynamics (2020);
/// Viviani, A minimal-variable symplectic method for isospectral flows (2020); Modin and Roop, Spatio-temporal
/// Lie-Poisson discretization for incompressible magnetohydrodynamics on the sphere (2023).
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
    /// Norm of the vorticity, which the motion keeps without carried fields; none before the first step.
    size: Option<f64>,
    /// What makes the currents of carried fields, none for those without energy.
    currents: [Option<Current>; MAX_CARRIED],
    stats: Stats,
}

/// The matrices of a solver.
struct Matrices<'a> {
    vorticity: Moved<'a>,
    /// `P`.
    stream: &'a mut [Row],
    /// The constant part of `P`, where there is one.
    background: &'a mut [Row],
    carried: Fields<'a>,
    work: &'a mut [Row],
}

impl<'a> Matrices<'a> {
    const fn layout(n: usize, options: &Options) -> Layout {
        Layout { n, n_kept: 1 + options.history, has_constant: options.has_background }
    }

    /// Rows of all matrices but the work space.
    const fn n_rows(n: usize, options: &Options) -> usize {
        let n_carried = options.n_carried;
        let n_of_vorticity = Moved::n_matrices(1 + options.history) + 1 + options.has_background as usize;
        let n_sums = (n_carried > 0) as usize;
        (n_of_vorticity + n_sums) * n_rows(n, n) + n_carried * Self::layout(n, options).n_rows()
    }

    fn new(n: usize, options: &Options, storage: &'a mut [f64]) -> Self {
        let (size, layout) = (n_rows(n, n), Self::layout(n, options));
        let (vorticity, rows) = Moved::new(n, layout.n_kept, storage.as_chunks_mut().0);
        let (stream, rows) = rows.split_at_mut(size);
        let (background, rows) = rows.split_at_mut(if options.has_background { size } else { 0 });
        let (sum, rows) = rows.split_at_mut(if options.n_carried > 0 { size } else { 0 });
        let (fields, work) = rows.split_at_mut(options.n_carried * layout.n_rows());
        Self { vorticity, stream, background, carried: Fields { layout, rows: fields, sum }, work }
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
        let n_work = if options.n_carried > 0 { L::n_work(n).max(L::n_apply_work(n)) } else { L::n_work(n) };
        2 * LANES * (Matrices::n_rows(n, options) + n_work)
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
            currents: [None; MAX_CARRIED],
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
        let Moved { value, residue, .. } = self.matrices().vorticity;
        residue.fill([0.0; 2 * LANES]);
        MatrixMut { n, rows: value }
    }

    /// A field that the flow carries, by its number from zero on.
    ///
    /// # Panics
    ///
    /// If there is no such field.
    #[must_use]
    pub fn carried(&self, k: usize) -> MatrixRef<'_> {
        assert!(k < self.options.n_carried, "the options have no such field");
        let (n, options) = (self.surface.n(), &self.options);
        let before =
            Matrices::n_rows(n, options) - (options.n_carried - k) * Matrices::layout(n, options).n_rows();
        MatrixRef { n, rows: &self.storage.as_ref().as_chunks().0[before..][..n_rows(n, n)] }
    }

    /// A field that the flow carries to write; the steps before are forgotten.
    ///
    /// # Panics
    ///
    /// If there is no such field.
    pub fn carried_mut(&mut self, k: usize) -> MatrixMut<'_> {
        assert!(k < self.options.n_carried, "the options have no such field");
        self.size = None;
        let n = self.surface.n();
        let mut matrices = self.matrices();
        matrices.carried.get(k).field.residue.fill([0.0; 2 * LANES]);
        let layout = matrices.carried.layout;
        MatrixMut { n, rows: layout.get(matrices.carried.rows, k).field.value }
    }

    /// Gives a carried field an energy; without one it is a tracer.
    ///
    /// # Errors
    ///
    /// [`Error::Number`] for a coefficient that is not finite.
    ///
    /// # Panics
    ///
    /// If there is no such field.
    pub fn set_current(&mut self, k: usize, current: Current) -> Result<(), Error> {
        assert!(k < self.options.n_carried, "the options have no such field");
        if let Some(value) = current.coefficients.into_iter().find(|c| !c.is_finite()) {
            return Err(Error::Number { value, needs: "coefficient of a current: that is finite" });
        }
        self.size = None;
        self.currents[k] = Some(current);
        Ok(())
    }

    /// The constant part of the current of a carried field to write; the steps before are forgotten.
    ///
    /// # Panics
    ///
    /// If there is no such field, or unless the options have a background.
    pub fn constant_current_mut(&mut self, k: usize) -> MatrixMut<'_> {
        assert!(k < self.options.n_carried, "the options have no such field");
        assert!(self.options.has_background, "the options have no background");
        self.size = None;
        self.currents[k].get_or_insert(Current::none());
        let n = self.surface.n();
        let Fields { layout, rows, .. } = self.matrices().carried;
        MatrixMut { n, rows: layout.get(rows, k).constant }
    }

    /// Computes the current of a carried field, with its constant part.
    ///
    /// # Panics
    ///
    /// If there is no such field.
    pub fn current(&mut self, k: usize) -> MatrixRef<'_> {
        assert!(k < self.options.n_carried, "the options have no such field");
        let surface = self.surface;
        let current = self.currents[k].unwrap_or_default();
        let Matrices { carried: Fields { layout, rows, .. }, work, .. } = self.matrices();
        let mut carried = layout.get(rows, k);
        carried.write_current(surface, &current, false, work);
        MatrixRef { n: surface.n(), rows: carried.current }
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
        let Moved { value, residue, .. } = self.matrices().vorticity;
        residue.fill([0.0; 2 * LANES]);
        change(value);
        let size = is_known.then(|| sqrt(inner(value, value)));
        self.size = size;
    }

    /// Makes the carried fields those before the last step.
    pub(super) fn restore_carried(&mut self) {
        let n_carried = self.options.n_carried;
        let mut matrices = self.matrices();
        for k in 0..n_carried {
            let Carried { field, current, .. } = matrices.carried.get(k);
            field.value.copy_from_slice(current);
            field.residue.fill([0.0; 2 * LANES]);
        }
    }

    /// Computes the stream function, with its constant part.
    pub fn stream(&mut self) -> MatrixRef<'_> {
        let surface = self.surface;
        let Matrices { vorticity, stream, background, work, .. } = self.matrices();
        invert(surface, background, vorticity.value, stream, work);
        MatrixRef { n: surface.n(), rows: stream }
    }

    /// Computes the derivative of the vorticity, `i kappa ([P, W] + sum of [J, A])`.
    pub fn derivative(&mut self) -> MatrixRef<'_> {
        let (surface, options, currents) = (self.surface, self.options, self.currents);
        let n = surface.n();
        let Matrices { vorticity, stream, background, mut carried, work } = self.matrices();
        let Moved { value, middle, first, .. } = vorticity;
        invert(surface, background, value, stream, work);
        product(n, stream, value, first, Extent::All);
        for (k, current) in currents.iter().enumerate().take(options.n_carried) {
            let Some(current) = current else { continue };
            let Fields { layout, rows, sum } = &mut carried;
            let mut of_field = layout.get(rows, k);
            of_field.write_current(surface, current, false, work);
            product(n, of_field.current, of_field.field.value, sum, Extent::All);
            add(first, sum);
        }
        commutator(n, first, middle, surface.rate());
        MatrixRef { n, rows: middle }
    }

    /// Computes the derivative of a carried field, `i kappa [P, A]`.
    ///
    /// # Panics
    ///
    /// If there is no such field.
    pub fn carried_derivative(&mut self, k: usize) -> MatrixRef<'_> {
        assert!(k < self.options.n_carried, "the options have no such field");
        let surface = self.surface;
        let n = surface.n();
        let Matrices { vorticity, stream, background, carried, work } = self.matrices();
        invert(surface, background, vorticity.value, stream, work);
        let Moved { value, middle, first, .. } = carried.layout.get(carried.rows, k).field;
        product(n, stream, value, first, Extent::All);
        commutator(n, first, middle, surface.rate());
        MatrixRef { n, rows: middle }
    }

    /// The energy `area/(2 N) (tr (P + F) W + sum of tr (J + J_0) A)` with the constant parts `F` of `P`, `J_0` of `J`.
    pub fn energy(&mut self) -> f64 {
        let (surface, options, currents) = (self.surface, self.options, self.currents);
        let Matrices { vorticity, stream, background, mut carried, work } = self.matrices();
        invert(surface, background, vorticity.value, stream, work);
        let mut trace = inner(vorticity.value, stream) + inner(vorticity.value, background);
        for (k, current) in currents.iter().enumerate().take(options.n_carried) {
            let Some(current) = current else { continue };
            let mut of_field = carried.get(k);
            of_field.write_current(surface, current, false, work);
            let field = &of_field.field.value;
            trace += inner(field, of_field.current) + inner(field, of_field.constant);
        }
        0.5 * surface.area() / surface.n() as f64 * trace
    }

    /// The traces `tr(W^k)/N` for `k = 1, 2, ..`, as many as there is room for: Casimirs without carried fields.
    pub fn casimirs(&mut self, casimirs: &mut [f64]) {
        let n = self.surface.n();
        let Moved { value, middle, first, .. } = self.matrices().vorticity;
        traces(n, value, (middle, first), casimirs);
    }

    /// The Casimirs `tr(A^k)/N` of a carried field for `k = 1, 2, ..`, as many as there is room for.
    ///
    /// # Panics
    ///
    /// If there is no such field.
    pub fn carried_casimirs(&mut self, k: usize, casimirs: &mut [f64]) {
        assert!(k < self.options.n_carried, "the options have no such field");
        let n = self.surface.n();
        let Fields { layout, rows, .. } = self.matrices().carried;
        let Moved { value, middle, first, .. } = layout.get(rows, k).field;
        traces(n, value, (middle, first), casimirs);
    }

    /// The traces `tr(W A^k)/N` with a carried field for `k = 1, 2, ..`, as many as there is room for: Casimirs where
    /// no other field has an energy. The first one is the cross helicity.
    ///
    /// # Panics
    ///
    /// If there is no such field.
    pub fn cross_casimirs(&mut self, k: usize, casimirs: &mut [f64]) {
        assert!(k < self.options.n_carried, "the options have no such field");
        let n = self.surface.n();
        let Matrices { vorticity, carried, .. } = self.matrices();
        let Moved { value, middle: power, first: next, .. } = carried.layout.get(carried.rows, k).field;
        power.copy_from_slice(value);
        for (at, casimir) in casimirs.iter_mut().enumerate() {
            if at > 0 {
                product(n, power, value, next, Extent::All);
                power.copy_from_slice(next);
            }
            *casimir = inner(vorticity.value, power) / n as f64;
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
        let (n, n_carried) = (surface.n(), options.n_carried);
        let factor = 0.5 * h * surface.rate();
        if self.size.is_none() || h != self.h {
            (self.n_known, self.order, self.h) = (0, options.history, h);
        }
        let (n_known, next, n_kept) = (self.n_known, self.next, 1 + options.history);
        let (mut stats, currents) = (self.stats, self.currents);
        let mut m = Matrices::new(n, &options, self.storage.as_mut());
        let mut sizes = Sizes::new(&mut m, self.size.filter(|_| n_carried == 0), n_carried);
        start(n, &mut m.vorticity, n_known.min(self.order), next, n_kept);
        for k in 0..n_carried {
            start(n, &mut m.carried.get(k).field, n_known.min(self.order), next, n_kept);
        }
        let size = sizes.unit();
        let bound = options.tolerance * size;
        // The change of the iteration before, and of the one before that.
        let (mut changes, mut iterations) = ([f64::INFINITY; 2], 0);
        // Whether B may be that of the iteration before. It converges as the square of the step, whatever the motion:
        // in a first step, without history, that is slower than all else.
        let mut may_lag = n_known > 0;
        loop {
            if iterations == options.max_iterations {
                return Err(Error::NotConverged { method: NAME, t, h, iterations });
            }
            let part = Part { factor, with_second: !may_lag || iterations.is_multiple_of(2) };
            let Moved { middle, first, second, .. } = &mut m.vorticity;
            invert(surface, m.background, middle, m.stream, m.work);
            product(n, m.stream, middle, first, Extent::All);
            let mut squares = [0.0; 1 + MAX_CARRIED];
            let mut of_currents = 0.0;
            for (k, current) in currents.iter().enumerate().take(n_carried) {
                squares[1 + k] = m.carried.move_field(k, m.stream, next, &part);
                if let Some(current) = current {
                    of_currents += m.carried.add_force((surface, k, current), first, m.work);
                }
            }
            if iterations == 0 {
                sizes.add_force(factor * of_currents);
            }
            if part.with_second {
                product(n, first, m.stream, second, Extent::Upper);
                for k in (0..n_carried).filter(|k| currents[*k].is_some()) {
                    m.carried.add_second(k, second);
                }
            }
            squares[0] = improve(n, &mut m.vorticity, next, factor);
            let change = sizes.change(&squares);
            // Fields and vorticity may take turns in their changes.
            let previous = if n_carried == 0 { changes[0] } else { changes[0].max(changes[1]) };
            iterations += 1;
            stats.iterations += 1;
            stats.second_products += u64::from(part.with_second);
            if change <= bound || change <= f64::EPSILON * size && change > 0.5 * previous {
                break;
            }
            if !change.is_finite() {
                let bad = |k| match k {
                    0 => non_finite(n, m.vorticity.middle),
                    _ => non_finite(n, m.carried.get(k - 1).field.middle),
                };
                let index = (0..=n_carried).find_map(bad).unwrap_or(0);
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
            changes = [change, changes[0]];
        }
        finish(n, &mut m.vorticity, 2.0 * factor);
        for k in 0..n_carried {
            let Carried { mut field, current, .. } = m.carried.get(k);
            // Where the step is not wanted after all.
            current.copy_from_slice(field.value);
            finish(n, &mut field, 2.0 * factor);
        }
        stats.steps += 1;
        if n_known == options.history && stats.steps.is_multiple_of(STEPS_OF_ORDER) {
            let mut errors =
                errors_of_start(n, m.vorticity.history, next, n_kept).map(|x| sizes.relative(0, x));
            for k in 0..n_carried {
                let of_field = errors_of_start(n, m.carried.get(k).field.history, next, n_kept);
                errors.iter_mut().zip(of_field).for_each(|(sum, x)| *sum += sizes.relative(1 + k, x));
            }
            self.order = best_order(&errors, n_kept);
        }
        (self.t, self.t_residue) = two_sum(t, h + self.t_residue);
        (self.n_known, self.next) = ((n_known + 1).min(options.history), (next + 1) % n_kept);
        (self.size, self.stats) = (Some(sizes.of[0]), stats);
        Ok(())
    }
}

/// Changes that stop to decrease above this part of the vorticity are no round-off.
const ROUND_OFF: f64 = 1e3 * f64::EPSILON;
/// Changes may grow at first.
const PATIENCE: u32 = 10;

/// What changes of the vorticity and of carried fields are measured by: without carried fields the vorticity is, in its
/// own norm, otherwise each by its size.
struct Sizes {
    of: [f64; 1 + MAX_CARRIED],
    n_carried: usize,
}

impl Sizes {
    /// Norms of the fields; `known` is that of the vorticity.
    fn new(m: &mut Matrices<'_>, known: Option<f64>, n_carried: usize) -> Self {
        let norm = |x: &[Row]| sqrt(inner(x, x));
        let mut of = [0.0; 1 + MAX_CARRIED];
        of[0] = known.unwrap_or_else(|| norm(m.vorticity.value));
        for k in 0..n_carried {
            of[1 + k] = norm(m.carried.get(k).field.value);
        }
        Self { of, n_carried }
    }

    /// Currents may make a vorticity from none: what they add in half a step counts as a part of its size.
    fn add_force(&mut self, size: f64) {
        self.of[0] += size.abs();
    }

    /// What a change of the whole is.
    fn unit(&self) -> f64 {
        if self.n_carried == 0 { self.of[0] } else { 1.0 }
    }

    /// The square of a change of a field by that of its size.
    fn relative(&self, field: usize, square: f64) -> f64 {
        // A field that vanishes stays as it is.
        if self.n_carried == 0 || square == 0.0 { square } else { square / (self.of[field] * self.of[field]) }
    }

    /// The change of the whole by the squares of the changes of fields.
    fn change(&self, squares: &[f64; 1 + MAX_CARRIED]) -> f64 {
        sqrt(squares.iter().enumerate().map(|(field, square)| self.relative(field, *square)).sum())
    }
}

/// `i rate (A - A^+)`.
fn commutator(n: usize, first: &[Row], out: &mut [Row], rate: f64) {
    for a in 0..n_panels(n) {
        for b in 0..n_panels(n) {
            *block_mut(n, out, a, b) = turned(&skew(n, first, a, b), rate);
        }
    }
}

/// The traces `tr(W^k)/N` for `k = 1, 2, ..`.
fn traces(n: usize, matrix: &[Row], (power, next): (&mut [Row], &mut [Row]), traces: &mut [f64]) {
    power.copy_from_slice(matrix);
    for (at, of_power) in traces.iter_mut().enumerate() {
        // tr W^(2 j) = |W^j|^2, tr W^(2 j + 1) = <W^j, W^(j + 1)>.
        let trace = if at == 0 {
            (0..n).map(|i| element(n, matrix, i, i)[0]).sum()
        } else if at % 2 == 1 {
            inner(power, power)
        } else {
            product(n, power, matrix, next, Extent::All);
            let trace = inner(power, next);
            power.copy_from_slice(next);
            trace
        };
        *of_power = trace / n as f64;
    }
}
