//! Fields that the flow carries, and the forces of their energy on the vorticity: the potential of a magnetic field, a
//! buoyancy, a tracer.
//!
//! ```text
//! W' = i kappa ([P, W] + sum of [J, A]),   A' = i kappa [P, A],   J = sum over k of c_k (-Delta)^k A + J_0
//! ```
//!
//! With dual numbers, `e e = 0`, these are the equations of one matrix: `Z' = i kappa [M, Z]` of `Z = A + e W` and
//! `M = P + e J`. The isospectral midpoint rule of `Z` is the magnetic midpoint rule:
//!
//! ```text
//! A_n = (I - Q) X (I + Q),   A_(n+1) = (I + Q) X (I - Q),   Q = i kappa h/2 P,   R = i kappa h/2 J
//! W_n = (I - Q) Y (I + Q) - R X (I + Q) + (I - Q) X R,   W_(n+1) = (I + Q) Y (I - Q) + R X (I - Q) - (I + Q) X R
//! ```
//!
//! so that traces of powers of `Z`, in which are `tr A^k` and `tr W A^k`, are kept by the equations themselves. With
//! `S = P X` and `F = P Y + J X` both are steps of one form:
//!
//! ```text
//! X = A_n + i kappa h/2 (S - S^+) - (kappa h/2)^2 P X P,   Y = W_n + i kappa h/2 (F - F^+) - (kappa h/2)^2 (F P + S J)
//! ```
//!
//! An iteration makes `X` first, and `Y` with the force of the new one: waves of Alfven, in which each makes the other,
//! converge twice as fast.
//!
//! Does not know: surfaces, when an iteration ends.

use super::Laplacian;
use super::iteration::{Moved, improve, inner};
use super::panels::{Extent, LANES, Row, add, add_upper, n_rows, product};
use crate::math::sqrt;

/// Most fields that a flow carries.
pub(super) const MAX_CARRIED: usize = 4;

/// Highest power of the Laplacian in a current.
const MAX_POWER: usize = 4;

/// What makes the current of a carried field `A`, the derivative of its energy:
///
/// ```text
/// J = sum over k of c_k (-Delta)^k A + J_0
/// ```
///
/// The potential of a magnetic field has `c_1 = 1`, a tracer has none. A buoyancy has the constant part `J_0` alone,
/// minus the height.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Current {
    pub(super) coefficients: [f64; 1 + MAX_POWER],
}

impl Current {
    /// No current: the field has no energy.
    #[must_use]
    pub const fn none() -> Self {
        Self { coefficients: [0.0; 1 + MAX_POWER] }
    }

    /// The current of the potential of a magnetic field: minus the Laplacian of it.
    #[must_use]
    pub const fn magnetic() -> Self {
        Self::none().with(1, 1.0)
    }

    /// Sets the coefficient of the power `k` of minus the Laplacian, from 0 to 4.
    ///
    /// # Panics
    ///
    /// Where `k` is larger.
    #[must_use]
    pub const fn with(mut self, k: usize, coefficient: f64) -> Self {
        self.coefficients[k] = coefficient;
        self
    }

    /// The coefficients without the last ones that vanish.
    fn used(&self) -> &[f64] {
        let n = self.coefficients.iter().rposition(|c| *c != 0.0).map_or(0, |k| k + 1);
        &self.coefficients[..n]
    }
}

/// The matrices of a carried field.
pub(super) struct Carried<'a> {
    pub(super) field: Moved<'a>,
    /// `J`; after a step, the field before it.
    pub(super) current: &'a mut [Row],
    /// `J_0`, where fields have one.
    pub(super) constant: &'a mut [Row],
}

/// Where the matrices of carried fields are in their room.
#[derive(Clone, Copy)]
pub(super) struct Layout {
    pub(super) n: usize,
    /// Steps of the history.
    pub(super) n_kept: usize,
    /// Whether currents may have a constant part.
    pub(super) has_constant: bool,
}

impl Layout {
    /// Rows of each field.
    pub(super) const fn n_rows(self) -> usize {
        (Moved::n_matrices(self.n_kept) + 1 + self.has_constant as usize) * n_rows(self.n, self.n)
    }

    /// The matrices of a field.
    pub(super) fn get(self, rows: &mut [Row], k: usize) -> Carried<'_> {
        let rows = &mut rows[k * self.n_rows()..][..self.n_rows()];
        let (field, rest) = Moved::new(self.n, self.n_kept, rows);
        let (current, constant) = rest.split_at_mut(n_rows(self.n, self.n));
        Carried { field, current, constant }
    }
}

impl Carried<'_> {
    /// Writes the current of a matrix, `value` or `middle` of the field.
    pub(super) fn write_current<L: Laplacian>(
        &mut self,
        surface: &L,
        current: &Current,
        is_middle: bool,
        work: &mut [Row],
    ) {
        let of = if is_middle { &self.field.middle } else { &self.field.value };
        match current.used() {
            [] => self.current.fill([0.0; 2 * LANES]),
            coefficients => surface.apply(coefficients, of, self.current, work),
        }
        add(self.current, self.constant);
    }
}

/// Room of carried fields, with one matrix for sums.
pub(super) struct Fields<'a> {
    pub(super) layout: Layout,
    pub(super) rows: &'a mut [Row],
    pub(super) sum: &'a mut [Row],
}

impl Fields<'_> {
    /// The matrices of a field.
    pub(super) fn get(&mut self, k: usize) -> Carried<'_> {
        self.layout.get(self.rows, k)
    }

    /// Writes `S = P X` of a field, and `S P` where it is wanted, and makes `X` of it; the square of the norm of the
    /// change.
    pub(super) fn move_field(&mut self, k: usize, stream: &[Row], next: usize, of: &Part) -> f64 {
        let n = self.layout.n;
        let Carried { mut field, .. } = self.layout.get(self.rows, k);
        product(n, stream, field.middle, field.first, Extent::All);
        if of.with_second {
            product(n, field.first, stream, field.second, Extent::Upper);
        }
        improve(n, &mut field, next, of.factor)
    }

    /// Writes the current `J` of a field, and adds `J X` to the force `F`; the product of the norms of `J` and `X`.
    pub(super) fn add_force<L: Laplacian>(
        &mut self,
        (surface, k, current): (&L, usize, &Current),
        force: &mut [Row],
        work: &mut [Row],
    ) -> f64 {
        let mut carried = self.layout.get(self.rows, k);
        carried.write_current(surface, current, true, work);
        product(self.layout.n, carried.current, carried.field.middle, self.sum, Extent::All);
        add(force, self.sum);
        let square = |x: &[Row]| inner(x, x);
        sqrt(square(carried.current) * square(carried.field.middle))
    }

    /// Adds `S J` of a field to `F P`.
    pub(super) fn add_second(&mut self, k: usize, second: &mut [Row]) {
        let n = self.layout.n;
        let Carried { field, current, .. } = self.layout.get(self.rows, k);
        product(n, field.first, current, self.sum, Extent::Upper);
        add_upper(n, second, self.sum);
    }
}

/// An iteration.
pub(super) struct Part {
    /// `kappa h/2`.
    pub(super) factor: f64,
    /// Whether products of second order are computed.
    pub(super) with_second: bool,
}
