//! What solvers of equations with a mass matrix ask of a scene.
//!
//! The module deliberately does not know how such equations are integrated.

use crate::real::Real;
use crate::system::{StateVector, System};

/// A variable of an implicit form.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ImplicitVariable {
    /// Name: that of the model for a component of the state.
    pub name: &'static str,
    /// Meaning and unit.
    pub doc: &'static str,
    /// Whether the mass matrix has a one at its place; its row is an algebraic equation otherwise.
    pub is_differential: bool,
}

impl ImplicitVariable {
    /// A variable by name, meaning and kind of its row.
    #[must_use]
    pub const fn new(name: &'static str, doc: &'static str, is_differential: bool) -> Self {
        Self { name, doc, is_differential }
    }
}

/// What is known of an implicit form without evaluating it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct ImplicitInfo {
    /// The variables in order.
    pub variables: &'static [ImplicitVariable],
    /// The differential index: 1 where there are algebraic equations, 0 otherwise.
    pub index: usize,
    /// The place among the variables of each component of the state.
    pub state: &'static [usize],
}

impl ImplicitInfo {
    /// An implicit form by its variables, its index and the place of each component of the state.
    #[must_use]
    pub const fn new(variables: &'static [ImplicitVariable], index: usize, state: &'static [usize]) -> Self {
        Self { variables, index, state }
    }

    /// The diagonal of the mass matrix, which has nothing beside it: one for a differential equation, zero for an
    /// algebraic one.
    #[must_use]
    pub fn mass<R: Real>(&self, place: usize) -> R {
        if self.variables[place].is_differential { R::ONE } else { R::ZERO }
    }
}

/// A system that also has its equations of motion in implicit form, with a mass matrix that may be singular.
///
/// ```text
/// M z' = f(t, z)
/// ```
///
/// `M` is constant and diagonal, ones and zeros. Where a row has a zero, `f` is an algebraic equation, whose derivative
/// by the algebraic variables is regular: the index is one, and solvers of such equations need no more.
pub trait Implicit<R: Real>: System<R> {
    /// Storage of `z`, and of `f`.
    type Variables: StateVector<R>;

    /// Names, mass matrix and index.
    const IMPLICIT: ImplicitInfo;

    /// The variables at a state: initial values that satisfy every algebraic equation.
    fn consistent(&self, t: R, y: &Self::State) -> Self::Variables;

    /// Writes `f(t, z)` to `f`, every component.
    fn implicit_rhs(&self, t: R, z: &Self::Variables, f: &mut Self::Variables);

    /// Writes `df_i/dz_j` to row `i` of `jacobian`.
    ///
    /// # Shapes
    ///
    /// jacobian: as many rows as there are variables.
    fn implicit_jacobian(&self, t: R, z: &Self::Variables, jacobian: &mut [Self::Variables]);

    /// Writes `M v` to `out`.
    fn mass_times(&self, v: &Self::Variables, out: &mut Self::Variables) {
        for (place, (out, v)) in out.as_mut_slice().iter_mut().zip(v.as_slice()).enumerate() {
            *out = Self::IMPLICIT.mass::<R>(place) * *v;
        }
    }

    /// Writes the components of the state that are among the variables to `y`: all of them.
    fn state_of(&self, z: &Self::Variables, y: &mut Self::State) {
        for (component, place) in y.as_mut_slice().iter_mut().zip(Self::IMPLICIT.state) {
            *component = z.as_slice()[*place];
        }
    }
}

impl<R: Real, S: Implicit<R>> Implicit<R> for &S {
    type Variables = S::Variables;

    const IMPLICIT: ImplicitInfo = S::IMPLICIT;

    fn consistent(&self, t: R, y: &Self::State) -> Self::Variables {
        (**self).consistent(t, y)
    }

    fn implicit_rhs(&self, t: R, z: &Self::Variables, f: &mut Self::Variables) {
        (**self).implicit_rhs(t, z, f);
    }

    fn implicit_jacobian(&self, t: R, z: &Self::Variables, jacobian: &mut [Self::Variables]) {
        (**self).implicit_jacobian(t, z, jacobian);
    }
}
