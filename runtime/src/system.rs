//! What the integrators ask of a system and generic drivers of a scene, and the storage of a state.
//!
//! The module deliberately does not know how a system is integrated.

use core::fmt::Debug;

use crate::error::{Condition, Failure, ParamError};
use crate::options::signed;
use crate::real::Real;

/// Storage of a state and of its derivatives: a fixed array in generated code.
///
/// Other crates may implement it for storage whose dimension is known at run time only.
pub trait StateVector<R: Real>: Clone {
    /// The components in order.
    fn as_slice(&self) -> &[R];

    /// The components in order, for writing.
    fn as_mut_slice(&mut self) -> &mut [R];

    /// A state of the same dimension with every component zero.
    #[must_use]
    fn zeros_like(&self) -> Self {
        let mut zeros = self.clone();
        zeros.as_mut_slice().fill(R::ZERO);
        zeros
    }
}

impl<R: Real, const N: usize> StateVector<R> for [R; N] {
    #[inline]
    fn as_slice(&self) -> &[R] {
        self
    }

    #[inline]
    fn as_mut_slice(&mut self) -> &mut [R] {
        self
    }

    #[inline]
    fn zeros_like(&self) -> Self {
        [R::ZERO; N]
    }
}

/// A state with storage for square matrices of its dimension, as Newton's iteration needs them.
pub trait SquareStorage<R: Real>: StateVector<R> {
    /// The rows of a matrix: as many states as a state has components.
    type Rows: Clone + Debug + AsRef<[Self]> + AsMut<[Self]>;

    /// As many positions.
    type Positions: Clone + Debug + AsRef<[usize]> + AsMut<[usize]>;

    /// A matrix of zeros of the same dimension.
    #[must_use]
    fn rows_like(&self) -> Self::Rows;

    /// Positions of the same dimension, all zero.
    #[must_use]
    fn positions_like(&self) -> Self::Positions;
}

impl<R: Real, const N: usize> SquareStorage<R> for [R; N] {
    type Rows = [[R; N]; N];
    type Positions = [usize; N];

    fn rows_like(&self) -> Self::Rows {
        [[R::ZERO; N]; N]
    }

    fn positions_like(&self) -> Self::Positions {
        [0; N]
    }
}

/// Something that a right-hand side divides by, at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pivot<R> {
    /// What it is, in the words of the model.
    pub name: &'static str,
    /// Its value, computed as the right-hand side does, but for a positive factor.
    pub value: R,
    /// The scale of its rounding errors: it is nothing else where the sum of the scale and its absolute value rounds to
    /// the scale. Zero where no terms can cancel.
    pub scale: R,
}

impl<R: Real> Pivot<R> {
    /// A pivot by name, value and scale.
    #[inline]
    #[must_use]
    pub const fn new(name: &'static str, value: R, scale: R) -> Self {
        Self { name, value, scale }
    }

    /// Whether something can be divided by the value: it is finite and, on every lane, more than its rounding errors.
    ///
    /// # Errors
    ///
    /// [`Failure::PivotNotFinite`], [`Failure::Singular`].
    pub fn verify(&self, t: R) -> Result<(), Failure> {
        let Pivot { name: pivot, value, scale } = *self;
        if !value.all_finite() {
            return Err(Failure::PivotNotFinite { t: signed(t), pivot });
        }
        // The reciprocal overflows for subnormal numbers, which have lost their digits.
        if (scale + value.abs()).all_gt(scale) && value.recip().all_finite() {
            Ok(())
        } else {
            Err(Failure::Singular { t: signed(t), pivot })
        }
    }

    /// [`verify`](Self::verify) for several.
    ///
    /// # Errors
    ///
    /// That of the first that cannot be divided by.
    pub fn verify_all(t: R, pivots: &[Self]) -> Result<(), Failure> {
        pivots.iter().try_for_each(|pivot| pivot.verify(t))
    }
}

impl Failure {
    /// Passes where a value is positive on every lane: a condition on the point, within the domain.
    ///
    /// # Errors
    ///
    /// [`Failure::OutsideDomain`] otherwise, also where the value is NaN.
    #[inline]
    pub fn require_positive<R: Real>(t: R, value: R, condition: &'static str) -> Result<(), Self> {
        if value.all_gt(R::ZERO) { Ok(()) } else { Err(Self::OutsideDomain { t: signed(t), condition }) }
    }
}

/// A system of ordinary differential equations of first order.
///
/// ```text
/// dy/dt = f(t, y)
/// ```
pub trait System<R: Real> {
    /// Storage of `y` and of `dy/dt`.
    type State: StateVector<R>;

    /// Writes `f(t, y)` to `dy`, every component; infinite or NaN where `f` has no value.
    fn rhs(&self, t: R, y: &Self::State, dy: &mut Self::State);

    /// Says why the right-hand side cannot be evaluated at a point: a pivot that vanishes or is not finite, a point
    /// outside the domain.
    ///
    /// The integrators call it at the initial state, where they met something that is not finite, and at states so
    /// large that their powers may not be.
    ///
    /// # Errors
    ///
    /// The reason, if the system knows one.
    fn check(&self, t: R, y: &Self::State) -> Result<(), Failure> {
        let _ = (t, y);
        Ok(())
    }

    /// Says whether a point lies outside the domain of the coordinates, such as `0 < theta < pi/2`, even where the
    /// right-hand side has a value.
    ///
    /// The integrators call it at every state that they would accept, so that it is to be cheap. A step out of the
    /// domain is tried again shorter, or ends the integration with fixed steps.
    ///
    /// # Errors
    ///
    /// [`Failure::OutsideDomain`] with the first condition that does not hold.
    #[inline]
    fn domain(&self, t: R, y: &Self::State) -> Result<(), Failure> {
        let _ = (t, y);
        Ok(())
    }

    /// A number that stays the same along a motion as long as no matrix that is solved with becomes singular.
    ///
    /// ```text
    /// symmetric matrices: sum of the signs of the pivots; others: product of them
    /// ```
    ///
    /// By Sylvester's law of inertia the sum changes only where an eigenvalue passes through zero, the product only
    /// where the determinant does. Several matrices have multiples that keep their numbers apart. NaN where a pivot
    /// is zero or not finite.
    ///
    /// The integrators compare it at every state that they would accept with that of the initial state, so that it is
    /// to be cheap. A step over a singular point is tried again shorter, or ends the integration with fixed steps.
    #[inline]
    fn signature(&self, t: R, y: &Self::State) -> R {
        let _ = (t, y);
        R::ZERO
    }

    /// Whether constraints that a motion keeps independent stay so on the way from one state, with its time, to another
    /// one: where they lose their rank, the motion may go on in more than one way.
    ///
    /// The integrators ask at every state that they would accept, from the one before, so that it is to be cheap. A
    /// step over such a place is tried again shorter, or ends the integration with fixed steps. [`keeps_rank`] answers
    /// for systems whose rows are known.
    ///
    /// [`keeps_rank`]: crate::keeps_rank
    #[inline]
    fn keeps_rank(&self, from: (R, &Self::State), to: (R, &Self::State)) -> bool {
        let _ = (from, to);
        true
    }

    /// Calls `visit` with everything that the right-hand side divides by and that may vanish or overflow, in a fixed
    /// order.
    ///
    /// The integrators ask for it only when they stop, to say why.
    fn pivots(&self, t: R, y: &Self::State, visit: &mut dyn FnMut(Pivot<R>)) {
        let _ = (t, y, visit);
    }
}

impl<R: Real, S: System<R> + ?Sized> System<R> for &S {
    type State = S::State;

    #[inline]
    fn rhs(&self, t: R, y: &Self::State, dy: &mut Self::State) {
        (**self).rhs(t, y, dy);
    }

    #[inline]
    fn check(&self, t: R, y: &Self::State) -> Result<(), Failure> {
        (**self).check(t, y)
    }

    #[inline]
    fn domain(&self, t: R, y: &Self::State) -> Result<(), Failure> {
        (**self).domain(t, y)
    }

    #[inline]
    fn signature(&self, t: R, y: &Self::State) -> R {
        (**self).signature(t, y)
    }

    #[inline]
    fn keeps_rank(&self, from: (R, &Self::State), to: (R, &Self::State)) -> bool {
        (**self).keeps_rank(from, to)
    }

    #[inline]
    fn pivots(&self, t: R, y: &Self::State, visit: &mut dyn FnMut(Pivot<R>)) {
        (**self).pivots(t, y, visit);
    }
}

impl<R: Real, S: Differentiable<R> + ?Sized> Differentiable<R> for &S {
    #[inline]
    fn jacobian(&self, t: R, y: &Self::State, jacobian: &mut [Self::State]) {
        (**self).jacobian(t, y, jacobian);
    }
}

/// A system that computes the derivatives of its right-hand side, as implicit methods need them.
pub trait Differentiable<R: Real>: System<R> {
    /// Writes df_i/dy_j to row i of `jacobian`.
    ///
    /// # Shapes
    ///
    /// jacobian: \[n\] rows of n components, n the dimension of the state.
    fn jacobian(&self, t: R, y: &Self::State, jacobian: &mut [Self::State]);
}

/// A system over the scalar `R` that exists over the scalar `Q`, too; generated ones do over any.
///
/// A method that evaluates several states at once takes one in lanes: `Gbs14`, with the feature `lanes`.
pub trait OverScalar<Q: Real, R: Real = f64>: System<R> {
    /// The system over `Q`.
    type Over: System<Q>;

    /// The same system, its numbers converted.
    fn over(&self, convert: impl Fn(R) -> Q) -> Self::Over;

    /// A state of the same dimension, its components converted.
    fn state_over(state: &Self::State, convert: impl Fn(R) -> Q) -> <Self::Over as System<Q>>::State;
}

impl<Q: Real, R: Real, S: OverScalar<Q, R> + ?Sized> OverScalar<Q, R> for &S {
    type Over = S::Over;

    fn over(&self, convert: impl Fn(R) -> Q) -> Self::Over {
        (**self).over(convert)
    }

    fn state_over(state: &Self::State, convert: impl Fn(R) -> Q) -> <Self::Over as System<Q>>::State {
        S::state_over(state, convert)
    }
}

/// A system that calls sine and cosine of angles, and can do without: it exists with cosine and sine of each angle
/// behind its state, too.
///
/// ```text
/// z = (y, cos x_1, sin x_1, cos x_2, ..)        dz/dt = (f(t, y), -x_1' sin x_1, x_1' cos x_1, ..)
/// ```
///
/// The angles `x_k` are components of the state or linear in them. [`OnCircles`](crate::OnCircles) integrates such a
/// system; generated ones are of this kind where less is calculated that way.
pub trait Circles<R: Real>: System<R> {
    /// The system of `z`: its right-hand side takes cosines and sines from the state, whatever the angles in it are.
    ///
    /// Where they are those of the angles, the components of `y` have the bits of [`System::rhs`]. Guards are those
    /// of the system itself, on `y`.
    type Inside: System<R>;

    /// The system of `z`.
    fn inside(&self) -> Self::Inside;

    /// The state with cosine and sine of each angle behind it.
    ///
    /// # Shapes
    ///
    /// result: \[n + 2 K\], n the dimension of the state and K the number of angles.
    fn on_circles(&self, y: &Self::State) -> <Self::Inside as System<R>>::State;
}

impl<R: Real, S: Circles<R> + ?Sized> Circles<R> for &S {
    type Inside = S::Inside;

    fn inside(&self) -> Self::Inside {
        (**self).inside()
    }

    #[inline]
    fn on_circles(&self, y: &Self::State) -> <Self::Inside as System<R>>::State {
        (**self).on_circles(y)
    }
}

/// A parameter of a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct ParamInfo {
    /// Name, as the model spells it.
    pub name: &'static str,
    /// Value of the scene as published.
    pub default: f64,
    /// Meaning and unit.
    pub doc: &'static str,
}

impl ParamInfo {
    /// A parameter by name, default and meaning.
    #[must_use]
    pub const fn new(name: &'static str, default: f64, doc: &'static str) -> Self {
        Self { name, default, doc }
    }
}

/// An output of a scene: a scalar, or several components.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct OutputInfo {
    /// Name, as the model spells it.
    pub name: &'static str,
    /// Names of the components in order.
    pub components: &'static [&'static str],
    /// Meaning and unit.
    pub doc: &'static str,
}

impl OutputInfo {
    /// An output by name, components and meaning.
    #[must_use]
    pub const fn new(name: &'static str, components: &'static [&'static str], doc: &'static str) -> Self {
        Self { name, components, doc }
    }
}

/// Names and meanings of all that a scene has.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct SceneInfo {
    /// Name of the model.
    pub model: &'static str,
    /// Name of the scene within the model.
    pub scene: &'static str,
    /// Names of the state's components in order.
    pub state: &'static [&'static str],
    /// Parameters in the order of [`Scene::prepare`].
    pub params: &'static [ParamInfo],
    /// Outputs in the order of [`Scene::outputs_of`].
    pub outputs: &'static [OutputInfo],
    /// Whether [`Scene::energy_of`] has a value.
    pub has_energy: bool,
}

impl SceneInfo {
    /// A scene with these components of the state and nothing else.
    #[must_use]
    pub const fn new(model: &'static str, scene: &'static str, state: &'static [&'static str]) -> Self {
        Self { model, scene, state, params: &[], outputs: &[], has_energy: false }
    }

    /// The same with parameters.
    #[must_use]
    pub const fn with_params(self, params: &'static [ParamInfo]) -> Self {
        Self { params, ..self }
    }

    /// The same with outputs.
    #[must_use]
    pub const fn with_outputs(self, outputs: &'static [OutputInfo]) -> Self {
        Self { outputs, ..self }
    }

    /// The same with an energy.
    #[must_use]
    pub const fn with_energy(self) -> Self {
        Self { has_energy: true, ..self }
    }

    /// The parameters as published.
    ///
    /// # Shapes
    ///
    /// result: \[n_params\]; zeros behind, if it is longer.
    #[must_use]
    pub fn defaults<R: Real, const N: usize>(&self) -> [R; N] {
        core::array::from_fn(|k| self.params.get(k).map_or(R::ZERO, |param| R::from_f64(param.default)))
    }

    /// Values of the parameters as an array.
    ///
    /// # Errors
    ///
    /// [`Condition::Count`] where there are more or fewer values.
    pub fn array_of<R: Real, const N: usize>(&self, values: &[R]) -> Result<[R; N], ParamError> {
        let wrong = ParamError::new(Condition::Count(N), "one for each of INFO.params");
        values.try_into().map_err(|_| wrong)
    }

    /// Checks that the parameters are finite on every lane.
    ///
    /// # Shapes
    ///
    /// values: \[n_params\].
    ///
    /// # Errors
    ///
    /// [`Condition::IsFinite`] with the first parameter that is infinite or NaN.
    pub fn require_finite<R: Real>(&self, values: &[R]) -> Result<(), ParamError> {
        let infinite = self.params.iter().zip(values).find(|(_, value)| !value.all_finite());
        match infinite {
            Some((param, _)) => Err(ParamError::new(Condition::IsFinite(param.name), param.doc)),
            None => Ok(()),
        }
    }

    /// Number of components of all outputs, the length of the slice that [`Scene::outputs_of`] fills.
    #[must_use]
    pub const fn n_outputs(&self) -> usize {
        let mut sum = 0;
        let mut index = 0;
        while index < self.outputs.len() {
            sum += self.outputs[index].components.len();
            index += 1;
        }
        sum
    }
}

/// A generated system with its parameters, described well enough for drivers that serve any scene.
pub trait Scene<R: Real>: System<R> + Sized {
    /// Names, defaults and meanings.
    const INFO: SceneInfo;

    /// Makes a scene from parameter values, computing once what depends on them alone.
    ///
    /// # Shapes
    ///
    /// values: \[n_params\], in the order of `INFO.params`.
    ///
    /// # Errors
    ///
    /// The first condition on the parameters that does not hold.
    fn prepare(values: &[R]) -> Result<Self, ParamError>;

    /// Whether the energy is proved to be constant along the motion; false also where there is none.
    const CONSERVES_ENERGY: bool = false;

    /// Energy at a state, if the model has one.
    fn energy_of(&self, t: R, y: &Self::State) -> Option<R>;

    /// Writes all outputs at a state, one after the other, to `out`.
    ///
    /// # Shapes
    ///
    /// out: \[[`INFO.n_outputs()`](SceneInfo::n_outputs)\].
    fn outputs_of(&self, t: R, y: &Self::State, out: &mut [R]);

    /// Writes the Taylor coefficients of the solution through a state, as [`Jet::series`](crate::Jet::series) does;
    /// false if the scene was generated without them.
    ///
    /// For drivers that serve any scene: it makes a new workspace in every call.
    fn series_of(&self, t: R, y: &Self::State, out: &mut [Self::State]) -> bool {
        let _ = (t, y, out);
        false
    }

    /// Number of the angles that [`Circles`] carries as points; zero if the scene was generated without.
    const N_CIRCLES: usize = 0;

    /// Writes the state with cosines and sines behind it, as [`Circles::on_circles`].
    ///
    /// For drivers that serve any scene.
    ///
    /// # Shapes
    ///
    /// z: \[n + 2 [`N_CIRCLES`](Self::N_CIRCLES)\].
    fn on_circles_of(&self, y: &Self::State, z: &mut [R]) {
        let _ = (y, z);
    }

    /// Writes the derivative of such a state, as the right-hand side of [`Circles::Inside`].
    ///
    /// # Shapes
    ///
    /// z, dz: \[n + 2 [`N_CIRCLES`](Self::N_CIRCLES)\].
    fn rhs_on_circles_of(&self, t: R, z: &[R], dz: &mut [R]) {
        let _ = (t, z, dz);
    }

    /// Number of invariants of the motion that the scene computes; zero if it was generated without them.
    const N_INVARIANTS: usize = 0;

    /// Writes the invariants at a state, as [`Invariants::values`](crate::Invariants::values).
    ///
    /// For drivers that serve any scene.
    ///
    /// # Shapes
    ///
    /// values: \[[`N_INVARIANTS`](Self::N_INVARIANTS)\].
    fn invariants_of(&self, t: R, y: &Self::State, values: &mut [R]) {
        let _ = (t, y, values);
    }

    /// Writes their gradients, as [`Invariants::gradients`](crate::Invariants::gradients).
    ///
    /// # Shapes
    ///
    /// gradients: \[[`N_INVARIANTS`](Self::N_INVARIANTS)\].
    fn invariant_gradients_of(&self, t: R, y: &Self::State, gradients: &mut [Self::State]) {
        let _ = (t, y, gradients);
    }

    /// Number of functions of the equations between coordinates; zero if the scene was generated without them.
    const N_POSITIONS: usize = 0;

    /// How many of them have to vanish, as [`Positions::n_equations`](crate::Positions::n_equations).
    const POSITION_EQUATIONS: usize = 0;

    /// The components that are moved, as [`Positions::moved`](crate::Positions::moved).
    const MOVED: &'static [usize] = &[];

    /// Writes the functions at a state, as [`Positions::residuals`](crate::Positions::residuals).
    ///
    /// For drivers that serve any scene.
    ///
    /// # Shapes
    ///
    /// values: \[[`N_POSITIONS`](Self::N_POSITIONS)\].
    fn positions_of(&self, t: R, y: &Self::State, values: &mut [R]) {
        let _ = (t, y, values);
    }

    /// Writes their gradients, as [`Positions::residual_gradients`](crate::Positions::residual_gradients).
    ///
    /// # Shapes
    ///
    /// gradients: \[[`N_POSITIONS`](Self::N_POSITIONS)\].
    fn position_gradients_of(&self, t: R, y: &Self::State, gradients: &mut [Self::State]) {
        let _ = (t, y, gradients);
    }

    /// Inputs in the order of [`hold_inputs_of`](Self::hold_inputs_of); none if the scene takes none.
    const INPUTS_OF: &'static [ParamInfo] = &[];

    /// Holds the inputs at these values, as [`Controlled::hold_inputs`](crate::Controlled::hold_inputs).
    ///
    /// For drivers that serve any scene.
    ///
    /// # Shapes
    ///
    /// values: \[`INPUTS_OF.len()`\].
    fn hold_inputs_of(&mut self, values: &[R]) {
        let _ = values;
    }

    /// Number of exact flows whose generators add up to the right-hand side; zero if the scene was generated without
    /// them.
    const N_FLOWS: usize = 0;

    /// Writes the increment of one of them, as [`ExactFlows::flow`](crate::ExactFlows::flow).
    ///
    /// For drivers that serve any scene.
    fn flow_of(&self, index: usize, tau: R, y: &Self::State, increment: &mut Self::State) {
        let _ = (index, tau, y, increment);
    }
}

#[cfg(test)]
mod tests {
    use super::{OutputInfo, ParamInfo, SceneInfo, StateVector};
    use crate::error::Condition;

    #[test]
    fn components_of_outputs_are_counted() {
        const OUTPUTS: &[OutputInfo] =
            &[OutputInfo::new("speed", &["speed"], ""), OutputInfo::new("p", &["p1", "p2", "p3"], "")];
        let info = SceneInfo::new("m", "s", &["x"]).with_outputs(OUTPUTS);
        assert_eq!(info.n_outputs(), 4);
    }

    #[test]
    fn parameters_have_to_be_finite_and_as_many_as_they_are() {
        const PARAMS: &[ParamInfo] = &[ParamInfo::new("m", 1.5, "mass"), ParamInfo::new("g", 0.0, "")];
        let info = SceneInfo::new("m", "s", &["x"]).with_params(PARAMS);
        assert_eq!(info.defaults::<f64, 2>(), [1.5, 0.0]);
        assert_eq!(info.require_finite(&[1.0, 2.0]), Ok(()));
        let error = info.require_finite(&[f64::NAN, f64::INFINITY]).unwrap_err();
        assert_eq!((error.condition, error.meaning), (Condition::IsFinite("m"), "mass"));
        assert_eq!(info.array_of(&[1.0, 2.0]), Ok([1.0, 2.0]));
        assert_eq!(info.array_of::<_, 2>(&[1.0]).unwrap_err().condition, "the number of values is 2");
    }

    #[test]
    fn zeros_have_the_dimension_of_the_state() {
        let state = [1.0, f64::NAN];
        assert_eq!(state.zeros_like(), [0.0, 0.0]);
        assert_eq!(StateVector::<f64>::as_slice(&state).len(), 2);
    }
}
