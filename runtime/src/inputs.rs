//! Systems with inputs, and the signals that drive them.
//!
//! The module deliberately does not know who decides what an input is: a controller, a plan or a measurement.

use core::marker::PhantomData;

use crate::error::Failure;
use crate::events::{Action, Direction, Events};
use crate::jet::{Jet, MAX_ORDER};
use crate::real::Real;
use crate::system::{Differentiable, OverScalar, ParamInfo, Pivot, System};

/// A system that is moved from outside by `M` inputs.
///
/// ```text
/// dy/dt = f(t, y, u)
/// ```
///
/// As a [`System`], it holds its inputs at the values that it has itself; [`WithInput`] drives it by a signal. Inputs
/// that are held for a while and then change, as a computer's do, are a [`hold_inputs`](Self::hold_inputs) and a new
/// [`Integrator`](crate::Integrator) from the state that was reached: no step goes over the jump.
pub trait Controlled<R: Real, const M: usize>: System<R> {
    /// Names, meanings, and the values that the inputs are held at from the start.
    const INPUTS: [ParamInfo; M];

    /// The values that the inputs are held at.
    fn held_inputs(&self) -> &[R; M];

    /// Holds the inputs at other values.
    fn hold_inputs(&mut self, u: &[R; M]);

    /// Writes `f(t, y, u)` to `dy`, whatever the inputs are held at.
    fn rhs_with(&self, t: R, y: &Self::State, u: &[R; M], dy: &mut Self::State);
}

/// A system that computes the derivatives of its right-hand side by its inputs.
pub trait InputDifferentiable<R: Real, const M: usize>: Controlled<R, M> {
    /// Writes df_i/du_j, with the inputs where they are held, to row i of `jacobian`.
    ///
    /// # Shapes
    ///
    /// jacobian: \[n\] rows, n the dimension of the state.
    fn input_jacobian(&self, t: R, y: &Self::State, jacobian: &mut [[R; M]]);
}

/// A system that knows the Taylor coefficients of its solutions also where its inputs change, as polynomials in time.
pub trait ControlledJet<R: Real, const M: usize>: Controlled<R, M> + Jet<R> {
    /// Writes the Taylor coefficients of the solution through `y`, as [`Jet::series`] does, whatever the inputs are
    /// held at.
    ///
    /// ```text
    /// y(t + h) = sum_k out_k h^k    where    u(t + h) = sum_k u_k h^k
    /// ```
    ///
    /// # Shapes
    ///
    /// u: any length; coefficients beyond it are zero. out: \[order + 1\].
    fn series_with(
        &self,
        t: R,
        y: &Self::State,
        u: &[[R; M]],
        workspace: &mut Self::Workspace,
        out: &mut [Self::State],
    );
}

/// What inputs are at a time and a state: a closure `|t, y| [..]`, or a [`Table`](crate::Table).
pub trait Signal<R: Real, S, const M: usize> {
    /// The inputs.
    fn at(&self, t: R, y: &S) -> [R; M];
}

impl<R: Real, S, const M: usize, F: Fn(R, &S) -> [R; M]> Signal<R, S, M> for F {
    #[inline]
    fn at(&self, t: R, y: &S) -> [R; M] {
        self(t, y)
    }
}

/// A signal of time alone that consists of polynomials: a [`Table`](crate::Table), a [`Polynomial`](crate::Polynomial).
///
/// Closures are not known to be polynomials: [`Taylor`](crate::Taylor) does not integrate what they drive.
#[diagnostic::on_unimplemented(
    message = "`{Self}` is not known to be a polynomial in time",
    label = "the method `Taylor` needs inputs that are polynomials in time, piece by piece",
    note = "drive the system by a `Table` or a `Polynomial`, hold its inputs, or choose a method without series"
)]
pub trait PolynomialSignal<R: Real, const M: usize> {
    /// Writes the coefficients of the polynomial that the inputs are from `t` on, on the way towards another time
    /// (towards `t` itself as towards a later one), and returns the end of it: `towards`, or an earlier time.
    ///
    /// ```text
    /// u(t + h) = sum_k coefficients_k h^k
    /// ```
    ///
    /// At the end of a piece, those of the piece that follows on the way. Lanes are to be at one time.
    ///
    /// # Shapes
    ///
    /// coefficients: \[order + 1\]; those beyond the degree are set to zero, those beyond the order left out.
    fn piece(&self, way: (R, R), coefficients: &mut [[R; M]]) -> R;
}

/// A system with inputs that a signal gives: a [`System`] for every integrator.
///
/// ```text
/// dy/dt = f(t, y, u(t, y))
/// ```
///
/// A signal with a kink, such as a table with straight pieces, makes adaptive methods shorten their steps there; one
/// with a jump is to be held from jump to jump, see [`Controlled`]. [`Taylor`](crate::Taylor) ends a step at every row
/// of a table, whatever is between rows, and goes on from there with the next polynomial, so that kinks and jumps cost
/// it no accuracy; it takes signals that are polynomials piece by piece, [`PolynomialSignal`], and no closures:
///
/// ```compile_fail
/// # use hamel_runtime::{ControlledJet, Integrator, Options, Taylor, WithInput};
/// fn series_of_a_closure<T: ControlledJet<f64, 1, State = [f64; 2]> + Clone>(system: T) {
///     let driven = WithInput::new(system, |t: f64, _y: &[f64; 2]| [t]);
///     let _ = Integrator::new(&driven, Taylor::new(), 0.0, [0.0; 2], Options::adaptive(1e-9, 1e-9));
/// }
/// ```
///
/// ```
/// use hamel_runtime::{Controlled, Integrator, Options, ParamInfo, System, Vern9, WithInput};
///
/// #[derive(Clone, Copy)]
/// struct Cart {
///     inputs: [f64; 1],
/// }
///
/// impl System<f64> for Cart {
///     type State = [f64; 2];
///     fn rhs(&self, t: f64, y: &[f64; 2], dy: &mut [f64; 2]) {
///         self.rhs_with(t, y, &self.inputs, dy);
///     }
/// }
///
/// impl Controlled<f64, 1> for Cart {
///     const INPUTS: [ParamInfo; 1] = [ParamInfo::new("push", 0.0, "force [N]")];
///     fn held_inputs(&self) -> &[f64; 1] {
///         &self.inputs
///     }
///     fn hold_inputs(&mut self, u: &[f64; 1]) {
///         self.inputs = *u;
///     }
///     fn rhs_with(&self, _t: f64, y: &[f64; 2], u: &[f64; 1], dy: &mut [f64; 2]) {
///         *dy = [y[1], u[0]];
///     }
/// }
///
/// // A spring by feedback.
/// let driven = WithInput::new(Cart { inputs: [0.0] }, |_t: f64, y: &[f64; 2]| [-y[0]]);
/// let mut solver = Integrator::new(&driven, Vern9, 0.0, [1.0, 0.0], Options::adaptive(1e-12, 1e-12))?;
/// solver.integrate_to(2.0)?;
/// assert!((solver.state()[0] - 2.0_f64.cos()).abs() < 1e-11);
/// # Ok::<(), hamel_runtime::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WithInput<R, T, G, const M: usize> {
    system: T,
    signal: G,
    scalar: PhantomData<fn() -> R>,
}

impl<R: Real, T: Controlled<R, M>, G: Signal<R, T::State, M>, const M: usize> WithInput<R, T, G, M> {
    /// The system, driven by the signal.
    pub const fn new(system: T, signal: G) -> Self {
        Self { system, signal, scalar: PhantomData }
    }

    /// The system, whose inputs are held where they were.
    pub const fn system(&self) -> &T {
        &self.system
    }

    /// The inputs at a time and a state.
    #[inline]
    pub fn inputs(&self, t: R, y: &T::State) -> [R; M] {
        self.signal.at(t, y)
    }
}

impl<R: Real, T: Controlled<R, M> + Clone, G: Signal<R, T::State, M>, const M: usize> WithInput<R, T, G, M> {
    /// The system with its inputs held at what the signal is there: for its energy, its outputs, its linearisation.
    #[inline]
    pub fn at(&self, t: R, y: &T::State) -> T {
        let mut system = self.system.clone();
        system.hold_inputs(&self.signal.at(t, y));
        system
    }
}

impl<R: Real, T: Controlled<R, M> + Clone, G: Signal<R, T::State, M>, const M: usize> System<R>
    for WithInput<R, T, G, M>
{
    type State = T::State;

    #[inline]
    fn rhs(&self, t: R, y: &Self::State, dy: &mut Self::State) {
        self.system.rhs_with(t, y, &self.signal.at(t, y), dy);
    }

    fn check(&self, t: R, y: &Self::State) -> Result<(), Failure> {
        self.at(t, y).check(t, y)
    }

    #[inline]
    fn domain(&self, t: R, y: &Self::State) -> Result<(), Failure> {
        self.at(t, y).domain(t, y)
    }

    #[inline]
    fn signature(&self, t: R, y: &Self::State) -> R {
        self.at(t, y).signature(t, y)
    }

    #[inline]
    fn keeps_rank(&self, from: (R, &Self::State), to: (R, &Self::State)) -> bool {
        self.at(from.0, from.1).keeps_rank(from, to)
    }

    fn pivots(&self, t: R, y: &Self::State, visit: &mut dyn FnMut(Pivot<R>)) {
        self.at(t, y).pivots(t, y, visit);
    }
}

/// The derivatives by the state at the inputs that the signal gives, which a signal of time alone does not add to.
///
/// Of a signal that feeds the state back, `df/du du/dy` is missing: implicit methods converge more slowly with it, and
/// what converges is the motion all the same.
impl<R, T, G, const M: usize> Differentiable<R> for WithInput<R, T, G, M>
where
    R: Real,
    T: Controlled<R, M> + Differentiable<R> + Clone,
    G: Signal<R, T::State, M>,
{
    fn jacobian(&self, t: R, y: &Self::State, jacobian: &mut [Self::State]) {
        self.at(t, y).jacobian(t, y, jacobian);
    }
}

/// The series of the motion while the inputs are the polynomial that the signal is there.
impl<R, T, G, const M: usize> Jet<R> for WithInput<R, T, G, M>
where
    R: Real,
    T: ControlledJet<R, M> + Clone,
    G: Signal<R, T::State, M> + PolynomialSignal<R, M>,
{
    type Workspace = T::Workspace;

    fn workspace(&self) -> Self::Workspace {
        self.system.workspace()
    }

    #[inline]
    fn series(&self, t: R, y: &Self::State, workspace: &mut Self::Workspace, out: &mut [Self::State]) {
        self.series_towards((t, t), y, workspace, out);
    }

    fn series_towards(
        &self,
        way: (R, R),
        y: &Self::State,
        workspace: &mut Self::Workspace,
        out: &mut [Self::State],
    ) -> R {
        // The highest order of the state is that of the inputs and one more.
        let mut u = [[R::ZERO; M]; MAX_ORDER];
        let u = &mut u[..out.len().saturating_sub(1).min(MAX_ORDER)];
        let end = self.signal.piece(way, u);
        self.system.series_with(way.0, y, u, workspace, out);
        end
    }
}

impl<R, T, G, const M: usize, const K: usize> Events<R, K> for WithInput<R, T, G, M>
where
    R: Real,
    T: Controlled<R, M> + Events<R, K> + Clone,
    G: Signal<R, T::State, M>,
{
    const DIRECTIONS: [Direction; K] = T::DIRECTIONS;

    fn event_values(&self, t: R, y: &Self::State) -> [R; K] {
        self.at(t, y).event_values(t, y)
    }

    fn event_apply(&self, index: usize, t: R, y: &mut Self::State) -> Action {
        self.at(t, y).event_apply(index, t, y)
    }
}

/// A signal that exists over another scalar, as [`OverScalar`] asks of a system: tables do, closures are of one scalar.
pub trait SignalOverScalar<Q: Real, R: Real, SQ, S, const M: usize>: Signal<R, S, M> {
    /// The signal over `Q`.
    type Over: Signal<Q, SQ, M>;

    /// The same signal, its numbers converted.
    fn over(&self, convert: impl Fn(R) -> Q) -> Self::Over;
}

impl<Q, R, T, G, const M: usize> OverScalar<Q, R> for WithInput<R, T, G, M>
where
    Q: Real,
    R: Real,
    T: Controlled<R, M> + OverScalar<Q, R> + Clone,
    T::Over: Controlled<Q, M> + Clone,
    G: SignalOverScalar<Q, R, <T::Over as System<Q>>::State, T::State, M>,
{
    type Over = WithInput<Q, T::Over, G::Over, M>;

    fn over(&self, convert: impl Fn(R) -> Q) -> Self::Over {
        WithInput::new(self.system.over(&convert), self.signal.over(&convert))
    }

    fn state_over(state: &Self::State, convert: impl Fn(R) -> Q) -> <T::Over as System<Q>>::State {
        T::state_over(state, convert)
    }
}
