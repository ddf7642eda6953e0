//! Systems on arrays as systems on the vectors of the crate `nalgebra`.
//!
//! The module deliberately does not know which components of a state form a vector, an attitude or a place: modules
//! generated with `Config::nalgebra` do.

use core::array::from_fn;

use nalgebra::{ArrayStorage, SMatrix, SVector, Scalar};

use crate::error::Failure;
use crate::jet::{Jet, MAX_ORDER};
use crate::methods::Invariants;
use crate::positions::Positions;
use crate::real::Real;
use crate::system::{Differentiable, Pivot, SquareStorage, StateVector, System};

impl<R: Real + Scalar, const N: usize> StateVector<R> for SVector<R, N> {
    #[inline]
    fn as_slice(&self) -> &[R] {
        array(self)
    }

    #[inline]
    fn as_mut_slice(&mut self) -> &mut [R] {
        array_mut(self)
    }

    #[inline]
    fn zeros_like(&self) -> Self {
        vector([R::ZERO; N])
    }
}

impl<R: Real + Scalar, const N: usize> SquareStorage<R> for SVector<R, N> {
    type Rows = [Self; N];
    type Positions = [usize; N];

    fn rows_like(&self) -> Self::Rows {
        from_fn(|_| self.zeros_like())
    }

    fn positions_like(&self) -> Self::Positions {
        [0; N]
    }
}

/// A system whose state is an array, with a vector of the crate `nalgebra` for the array.
///
/// The numbers are those of the system itself, bit for bit: vectors lend their components, which are not copied. Every
/// method of this crate integrates it.
///
/// ```
/// use hamel_runtime::nalgebra::{SVector, Vector2};
/// use hamel_runtime::{Dop853, Integrator, OnVectors, Options, System};
///
/// struct Oscillator;
///
/// impl System<f64> for Oscillator {
///     type State = [f64; 2];
///     fn rhs(&self, _t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
///         *dy = [y[1], -y[0]];
///     }
/// }
///
/// let system = OnVectors::new(Oscillator);
/// assert_eq!(system.derivative(0.0, &Vector2::new(0.6, 0.8)), Vector2::new(0.8, -0.6));
///
/// let start = Vector2::new(1.0, 0.0);
/// let mut solver = Integrator::new(&system, Dop853, 0.0, start, Options::adaptive(1e-12, 1e-12))?;
/// solver.integrate_to(2.0)?;
/// let end: &SVector<f64, 2> = solver.state();
/// assert!((end - Vector2::new(2.0_f64.cos(), -2.0_f64.sin())).norm() < 1e-10);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OnVectors<S, const N: usize> {
    system: S,
}

impl<S, const N: usize> OnVectors<S, N> {
    /// The system on vectors; their dimension `N` is that of the first vector it is used with.
    #[must_use]
    pub const fn new(system: S) -> Self {
        Self { system }
    }

    /// The system on arrays, for its other functions: they take `y.as_ref()` of a vector `y`.
    #[must_use]
    pub const fn system(&self) -> &S {
        &self.system
    }

    /// The right-hand side `f(t, y)`.
    #[inline]
    #[must_use]
    pub fn derivative<R: Real + Scalar>(&self, t: R, y: &SVector<R, N>) -> SVector<R, N>
    where
        S: System<R, State = [R; N]>,
    {
        let mut dy = [R::ZERO; N];
        self.system.rhs(t, array(y), &mut dy);
        vector(dy)
    }

    /// The matrix of the derivatives `df_i/dy_j`, row `i` and column `j`.
    #[inline]
    #[must_use]
    pub fn jacobian_matrix<R: Real + Scalar>(&self, t: R, y: &SVector<R, N>) -> SMatrix<R, N, N>
    where
        S: Differentiable<R, State = [R; N]>,
    {
        let mut rows = [[R::ZERO; N]; N];
        self.system.jacobian(t, array(y), &mut rows);
        SMatrix::from_fn(|i, j| rows[i][j])
    }
}

impl<R: Real + Scalar, S: System<R, State = [R; N]>, const N: usize> System<R> for OnVectors<S, N> {
    type State = SVector<R, N>;

    #[inline]
    fn rhs(&self, t: R, y: &Self::State, dy: &mut Self::State) {
        self.system.rhs(t, array(y), array_mut(dy));
    }

    #[inline]
    fn check(&self, t: R, y: &Self::State) -> Result<(), Failure> {
        self.system.check(t, array(y))
    }

    #[inline]
    fn domain(&self, t: R, y: &Self::State) -> Result<(), Failure> {
        self.system.domain(t, array(y))
    }

    #[inline]
    fn signature(&self, t: R, y: &Self::State) -> R {
        self.system.signature(t, array(y))
    }

    #[inline]
    fn keeps_rank(&self, (t0, from): (R, &Self::State), (t1, to): (R, &Self::State)) -> bool {
        self.system.keeps_rank((t0, array(from)), (t1, array(to)))
    }

    #[inline]
    fn pivots(&self, t: R, y: &Self::State, visit: &mut dyn FnMut(Pivot<R>)) {
        self.system.pivots(t, array(y), visit);
    }
}

impl<R, S, const N: usize> Differentiable<R> for OnVectors<S, N>
where
    R: Real + Scalar,
    S: Differentiable<R, State = [R; N]>,
{
    #[inline]
    fn jacobian(&self, t: R, y: &Self::State, jacobian: &mut [Self::State]) {
        let mut rows = [[R::ZERO; N]; N];
        self.system.jacobian(t, array(y), &mut rows);
        copy(rows, jacobian);
    }
}

impl<R, S, const N: usize, const K: usize> Invariants<R, K> for OnVectors<S, N>
where
    R: Real + Scalar,
    S: Invariants<R, K, State = [R; N]>,
{
    #[inline]
    fn values(&self, t: R, y: &Self::State) -> [R; K] {
        self.system.values(t, array(y))
    }

    #[inline]
    fn gradients(&self, t: R, y: &Self::State, gradients: &mut [Self::State; K]) {
        let mut rows = [[R::ZERO; N]; K];
        self.system.gradients(t, array(y), &mut rows);
        copy(rows, gradients);
    }
}

impl<R, S, const N: usize, const K: usize> Positions<R, K> for OnVectors<S, N>
where
    R: Real + Scalar,
    S: Positions<R, K, State = [R; N]>,
{
    #[inline]
    fn n_equations(&self) -> usize {
        self.system.n_equations()
    }

    #[inline]
    fn moved(&self) -> &[usize] {
        self.system.moved()
    }

    #[inline]
    fn residuals(&self, t: R, y: &Self::State) -> [R; K] {
        self.system.residuals(t, array(y))
    }

    #[inline]
    fn residual_gradients(&self, t: R, y: &Self::State, gradients: &mut [Self::State; K]) {
        let mut rows = [[R::ZERO; N]; K];
        self.system.residual_gradients(t, array(y), &mut rows);
        copy(rows, gradients);
    }
}

impl<R, S, const N: usize> Jet<R> for OnVectors<S, N>
where
    R: Real + Scalar,
    S: Jet<R, State = [R; N]>,
{
    type Workspace = S::Workspace;

    fn workspace(&self) -> Self::Workspace {
        self.system.workspace()
    }

    #[inline]
    fn series(&self, t: R, y: &Self::State, workspace: &mut Self::Workspace, out: &mut [Self::State]) {
        self.series_towards((t, t), y, workspace, out);
    }

    #[inline]
    fn series_towards(
        &self,
        way: (R, R),
        y: &Self::State,
        workspace: &mut Self::Workspace,
        out: &mut [Self::State],
    ) -> R {
        let mut terms = [[R::ZERO; N]; MAX_ORDER + 1];
        let wanted = out.len().min(terms.len());
        let end = self.system.series_towards(way, array(y), workspace, &mut terms[..wanted]);
        copy(terms, out);
        end
    }
}

/// The components of a vector.
#[inline]
fn array<R, const N: usize>(vector: &SVector<R, N>) -> &[R; N] {
    &vector.data.0[0]
}

/// The components of a vector, for writing.
#[inline]
fn array_mut<R, const N: usize>(vector: &mut SVector<R, N>) -> &mut [R; N] {
    &mut vector.data.0[0]
}

/// The vector of an array.
#[inline]
fn vector<R: Scalar, const N: usize>(components: [R; N]) -> SVector<R, N> {
    SVector::from_array_storage(ArrayStorage([components]))
}

/// Writes arrays to as many vectors as there are of both.
#[inline]
fn copy<R: Scalar, const N: usize>(from: impl IntoIterator<Item = [R; N]>, to: &mut [SVector<R, N>]) {
    for (to, from) in to.iter_mut().zip(from) {
        *array_mut(to) = from;
    }
}
