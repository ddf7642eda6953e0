//! What can be asked of a scene with parameters, whoever evaluates it.
//!
//! Does not know: where a scene comes from, JSON, how states are integrated.

use std::ops::Deref;
use std::sync::Arc;

use hamel_ensemble::Lanes;
use hamel_runtime::{
    Differentiable, Dual, F64x4, F64x8, Failure, Invariants, Jet, OverScalar, Pivot, Positions, System,
    Wiener,
};

use hamel_codegen::scene::{DiscreteLayout, DiscretePart};
use hamel_codegen::spec::Want;
use hamel_program::program::SeriesRoom;

use super::info::Info;
use super::machine::Wide;
pub use super::state::{BadParams, PositionEquations, VecState};

/// A scene with parameter values, ready to be evaluated.
///
/// # Shapes
/// `y`, `dy`: `[n_state]`. A wrong size is a bug of the caller and panics.
///
/// Threads may share it.
pub trait Dynamics: Send + Sync {
    /// Names and meanings.
    fn info(&self) -> &Info;

    /// Writes the derivative `f(t, y)` to `dy`.
    fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]);

    /// Holds the inputs, all of them, at other values; false where the scene was prepared without values for them, or
    /// with values for others.
    fn hold(&mut self, inputs: &[f64]) -> bool {
        let _ = inputs;
        false
    }

    /// Writes the derivatives on four lanes, of which each has the bits of [`Dynamics::rhs`]; one lane after the other
    /// unless the scene has been compiled for lanes.
    fn rhs_on_lanes(&self, t: F64x4, y: &VecState<F64x4>, dy: &mut VecState<F64x4>) {
        lane_by_lane(y, dy, |k, y, dy| self.rhs(t.lane(k), y, dy));
    }

    /// Number of angles that the scene has as points of circles, too; zero where that does not pay.
    fn n_circles(&self) -> usize {
        0
    }

    /// Writes the state with cosine and sine of each of these angles behind it.
    fn on_circles(&self, _y: &[f64], _z: &mut [f64]) {}

    /// Writes the derivative of such a state.
    fn rhs_on_circles(&self, _t: f64, _z: &[f64], _dz: &mut [f64]) {}

    /// The same on four lanes, of which each has the bits of [`Dynamics::rhs_on_circles`]; one lane after the other
    /// unless the scene has been compiled for lanes.
    fn rhs_on_circles_on_lanes(&self, t: F64x4, z: &VecState<F64x4>, dz: &mut VecState<F64x4>) {
        lane_by_lane(z, dz, |k, z, dz| self.rhs_on_circles(t.lane(k), z, dz));
    }

    /// The inputs at a time, where a table drives them; none where they are held.
    fn inputs_at(&self, t: f64) -> Option<Vec<f64>> {
        let _ = t;
        None
    }

    /// Energy, when the scene computes it.
    fn energy(&self, t: f64, y: &[f64]) -> Option<f64>;

    /// All outputs, one after the other.
    fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64>;

    /// Writes the Taylor coefficients of the solution through a state on the way from a time to another one, and says
    /// up to which time they hold, as [`Jet::series_towards`]; none when the scene has no series.
    fn series(&self, way: (f64, f64), y: &[f64], room: &mut SeriesRoom, out: &mut [VecState]) -> Option<f64>;

    /// Writes the derivatives of the right-hand side: row `i` has those of component `i`.
    fn jacobian(&self, t: f64, y: &[f64], rows: &mut [VecState]);

    /// The product `J^T w` of the transposed Jacobian, or why the scene has none.
    ///
    /// # Errors
    /// The reason, in words that follow the name of the scene.
    fn vjp(&self, _t: f64, _y: &[f64], _w: &[f64]) -> Result<Vec<f64>, String> {
        Err("has no products of its transposed Jacobian".to_owned())
    }

    /// The forces along the velocities of the state that have to act beside the model's for these velocities to have
    /// the rates `a`, both in the order of [`Info::velocities`], where the scene wants `inverse_dynamics`.
    fn inverse_dynamics(&self, t: f64, y: &[f64], a: &[f64]) -> Option<Vec<f64>> {
        let _ = (t, y, a);
        None
    }

    /// What the map of a quotient gives for the state and the parameters of the total system, one after the other: the
    /// state or, on request, the parameters. None where the scene does not want `quotient`.
    fn quotient(&self, of_params: bool, t: f64, total: &[f64]) -> Option<Vec<f64>> {
        let _ = (of_params, t, total);
        None
    }

    /// A matrix that scenes want, row by row; velocities are in the order of [`Info::velocities`]. None where the scene
    /// does not want it.
    fn matrix(&self, want: Want, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        let _ = (want, t, y);
        None
    }

    /// Cost of one evaluation of the right-hand side, as [`hamel_program::program::Counts::cost`].
    fn rhs_cost(&self) -> u64;

    /// Number of invariants of the motion.
    fn n_invariants(&self) -> usize;

    /// Writes the invariants, as many as there are.
    fn invariants(&self, t: f64, y: &[f64], values: &mut [f64]);

    /// Writes their gradients.
    fn invariant_gradients(&self, t: f64, y: &[f64], gradients: &mut [VecState]);

    /// The equations between coordinates; none where there are none.
    fn positions(&self) -> Option<PositionEquations<'_>> {
        None
    }

    /// The same, whose rank is watched for: also where a motion is not moved onto them.
    fn watched_positions(&self) -> Option<PositionEquations<'_>> {
        self.positions()
    }

    /// Writes their residuals, and behind them what coordinates keep.
    fn position_residuals(&self, _t: f64, _y: &[f64], _values: &mut [f64]) {}

    /// Writes the gradients of these.
    fn position_gradients(&self, _t: f64, _y: &[f64], _gradients: &mut [VecState]) {}

    /// Derivatives of the residuals of the constraints that a state can violate, by velocities and momenta: a row for
    /// each, with zeros for other components of the state. None where there are no such constraints.
    fn constraint_rows(&self, t: f64, y: &[f64]) -> Vec<VecState> {
        let _ = (t, y);
        Vec::new()
    }

    /// The residuals of these constraints, in the order of the rows.
    fn constraint_residuals(&self, t: f64, y: &[f64]) -> Vec<f64> {
        let _ = (t, y);
        Vec::new()
    }

    /// Where the numbers of the discrete equations stand, where the scene has such equations.
    fn discrete(&self) -> Option<&DiscreteLayout> {
        None
    }

    /// Writes the results of a function of the discrete equations for the variables `(h, y, z)` of a step from
    /// a state at a time, inputs held at their values in the middle of the step.
    fn discrete_of(&self, part: DiscretePart, t: f64, variables: &[f64], out: &mut [f64]) {
        let _ = (part, t, variables);
        out.fill(f64::NAN);
    }

    /// Number of the exact flows whose generators add up to the right-hand side; why there are none otherwise.
    ///
    /// # Errors
    /// The reason, in words that follow the name of the scene.
    fn flows(&self) -> Result<usize, String>;

    /// Writes what one of the flows adds to a state in the time `tau`.
    fn flow(&self, index: usize, tau: f64, y: &[f64], increment: &mut [f64]);

    /// Says why the right-hand side has no value at a point.
    ///
    /// # Errors
    /// The reason, if the scene knows one.
    fn check(&self, t: f64, y: &[f64]) -> Result<(), Failure>;

    /// Says which coordinate has left its domain at a point.
    ///
    /// # Errors
    /// [`Failure::OutsideDomain`] with the condition that does not hold.
    fn domain(&self, t: f64, y: &[f64]) -> Result<(), Failure>;

    /// As [`System::signature`].
    fn signature(&self, t: f64, y: &[f64]) -> f64;

    /// As [`System::pivots`].
    fn pivots(&self, t: f64, y: &[f64], visit: &mut dyn FnMut(Pivot<f64>));
}

/// A scene with parameter values on lanes, to be integrated; every lane has the bits of [`Dynamics`].
///
/// # Shapes
/// As [`Dynamics`].
pub trait LaneDynamics<L: Several>: Send + Sync {
    /// Writes the derivatives on all lanes.
    fn rhs(&self, t: L, y: &VecState<L>, dy: &mut VecState<L>);

    /// As [`Dynamics::energy`].
    fn energy(&self, t: L, y: &VecState<L>) -> Option<L>;

    /// Runs rows of `2 m, .., 4, 2` substeps of the midpoint rule over a step `h` from `t` on, with the bits of the
    /// same substeps by [`rhs`](Self::rhs). False, and increments of no account, where there is no machine code for
    /// that.
    ///
    /// # Shapes
    /// start: a state and its derivative, \[n_state\] each; increments: \[m\]\[2\]\[n_state\], afterwards the last one
    /// of each row and the one before, the row of the most substeps first.
    fn run_rows(&self, (t, h): (L, L), start: (&[L], &[L]), increments: &mut [L]) -> bool {
        let _ = (t, h, start, increments);
        false
    }

    /// [`Dynamics::outputs`] in the place of what a vector has.
    fn write_outputs(&self, t: L, y: &VecState<L>, out: &mut Vec<L>);

    /// Fixes other parameters, as [`Factory::prepare_lanes`], without allocation, where that can be.
    fn set(&mut self, values: &[L]) -> Option<Result<(), BadParams>> {
        let _ = values;
        None
    }

    /// As [`Dynamics::hold`], without allocation where that can be.
    fn hold(&mut self, inputs: &[L]) -> bool {
        let _ = inputs;
        false
    }

    /// As [`System::check`].
    ///
    /// # Errors
    /// As [`System::check`], for any lane.
    fn check(&self, t: L, y: &VecState<L>) -> Result<(), Failure>;

    /// As [`System::domain`].
    ///
    /// # Errors
    /// As [`System::domain`], for any lane.
    fn domain(&self, t: L, y: &VecState<L>) -> Result<(), Failure>;

    /// As [`System::signature`].
    fn signature(&self, t: L, y: &VecState<L>) -> L;

    /// As [`System::pivots`].
    fn pivots(&self, t: L, y: &VecState<L>, visit: &mut dyn FnMut(Pivot<L>));
}

/// A scene with parameter values, whoever evaluates it.
#[derive(Clone)]
pub struct PreparedScene<'a>(Arc<dyn Dynamics + 'a>);

impl<'a> PreparedScene<'a> {
    /// The scene of an evaluator.
    pub fn new(dynamics: impl Dynamics + 'a) -> Self {
        PreparedScene(Arc::new(dynamics))
    }

    /// As [`Dynamics::hold`]; false as well where somebody else has the scene with these values.
    pub fn hold(&mut self, inputs: &[f64]) -> bool {
        Arc::get_mut(&mut self.0).is_some_and(|dynamics| dynamics.hold(inputs))
    }
}

impl<'a> Deref for PreparedScene<'a> {
    type Target = dyn Dynamics + 'a;

    fn deref(&self) -> &Self::Target {
        &*self.0
    }
}

/// The same on lanes.
pub type PreparedLanes<'a, L = F64x4> = Box<dyn LaneDynamics<L> + 'a>;

/// A scalar whose lanes are trajectories: [`F64x4`], [`F64x8`].
pub trait Several: Lanes + Wide + Send + Sync + 'static {
    /// As [`Factory::prepare_lanes`].
    ///
    /// # Errors
    /// As [`Factory::prepare`], for any lane.
    fn prepare<'a>(factory: &'a dyn Factory, values: &[Self]) -> Result<PreparedLanes<'a, Self>, BadParams>;

    /// Fixes other parameters of lanes of a scene.
    ///
    /// # Errors
    /// As [`Factory::prepare_lanes`]; the lanes are then to be prepared again before they are used.
    fn prepare_again<'a>(
        factory: &'a dyn Factory,
        lanes: &mut PreparedLanes<'a, Self>,
        values: &[Self],
    ) -> Result<(), BadParams> {
        match lanes.set(values) {
            Some(set) => set,
            None => {
                *lanes = Self::prepare(factory, values)?;
                Ok(())
            }
        }
    }
}

impl Several for F64x4 {
    fn prepare<'a>(factory: &'a dyn Factory, values: &[F64x4]) -> Result<PreparedLanes<'a>, BadParams> {
        factory.prepare_lanes(values)
    }
}

impl Several for F64x8 {
    fn prepare<'a>(
        factory: &'a dyn Factory,
        values: &[F64x8],
    ) -> Result<PreparedLanes<'a, F64x8>, BadParams> {
        factory.prepare_eight_lanes(values)
    }
}

/// A scene with parameter values over dual numbers: everything that it computes has its derivative along a direction of
/// parameters and state.
///
/// # Shapes
/// As [`Dynamics`].
pub trait DualDynamics: Send + Sync {
    /// As [`Dynamics::rhs`].
    fn rhs(&self, t: Dual, y: &[Dual], dy: &mut [Dual]);

    /// As [`Dynamics::energy`].
    fn energy(&self, t: Dual, y: &[Dual]) -> Option<Dual>;

    /// As [`Dynamics::outputs`].
    fn outputs(&self, t: Dual, y: &[Dual]) -> Vec<Dual>;
}

/// The same, whoever evaluates it.
pub type PreparedDuals<'a> = Box<dyn DualDynamics + 'a>;

/// A scene whose parameters are still to be given; threads may share it.
pub trait Factory: Sync {
    /// Names and meanings.
    fn info(&self) -> &Info;

    /// Fixes the parameters, `values` in the order of [`Info::params`]; behind them, or not, what all inputs are held
    /// at, in the order of [`Info::inputs`], whatever drives them otherwise.
    ///
    /// # Errors
    /// The first condition on the parameters that does not hold.
    fn prepare(&self, values: &[f64]) -> Result<PreparedScene<'_>, BadParams>;

    /// The same, moved by a path of the scene's noises.
    ///
    /// # Errors
    /// As [`Factory::prepare`].
    fn prepare_noisy(&self, values: &[f64], noise: Wiener) -> Result<PreparedScene<'_>, BadParams>;

    /// Fixes the parameters on four lanes; one lane after the other unless the scene has been compiled for lanes.
    ///
    /// # Errors
    /// As [`Factory::prepare`], for any lane.
    fn prepare_lanes(&self, values: &[F64x4]) -> Result<PreparedLanes<'_>, BadParams> {
        SideBySide::boxed(self, values)
    }

    /// The same on eight lanes.
    ///
    /// # Errors
    /// As [`Factory::prepare`], for any lane.
    fn prepare_eight_lanes(&self, values: &[F64x8]) -> Result<PreparedLanes<'_, F64x8>, BadParams> {
        SideBySide::boxed(self, values)
    }

    /// Fixes the parameters, with their derivatives along a direction.
    ///
    /// # Errors
    /// As [`Factory::prepare`].
    fn prepare_duals(&self, values: &[Dual]) -> Result<PreparedDuals<'_>, BadParams>;
}

impl<F: Factory + ?Sized> Factory for &F {
    fn info(&self) -> &Info {
        (**self).info()
    }

    fn prepare(&self, values: &[f64]) -> Result<PreparedScene<'_>, BadParams> {
        (**self).prepare(values)
    }

    fn prepare_noisy(&self, values: &[f64], noise: Wiener) -> Result<PreparedScene<'_>, BadParams> {
        (**self).prepare_noisy(values, noise)
    }

    fn prepare_lanes(&self, values: &[F64x4]) -> Result<PreparedLanes<'_>, BadParams> {
        (**self).prepare_lanes(values)
    }

    fn prepare_eight_lanes(&self, values: &[F64x8]) -> Result<PreparedLanes<'_, F64x8>, BadParams> {
        (**self).prepare_eight_lanes(values)
    }

    fn prepare_duals(&self, values: &[Dual]) -> Result<PreparedDuals<'_>, BadParams> {
        (**self).prepare_duals(values)
    }
}

/// Lanes of which each has dynamics of its own.
pub(super) struct SideBySide<'a>(Vec<PreparedScene<'a>>);

impl<'a> SideBySide<'a> {
    /// Prepares one lane after the other.
    pub(super) fn boxed<F: Factory + ?Sized, L: Several>(
        factory: &'a F,
        values: &[L],
    ) -> Result<PreparedLanes<'a, L>, BadParams> {
        let lanes = (0..L::LANES).map(|k| factory.prepare(&lane(values, k)));
        Ok(Box::new(SideBySide(lanes.collect::<Result<_, _>>()?)))
    }
}

fn lane<L: Several>(values: &[L], k: usize) -> Vec<f64> {
    values.iter().map(|x| x.lane(k)).collect()
}

/// The most lanes of a scalar.
const MAX_LANES: usize = F64x8::LANES;

/// Calls `rhs(k, y, dy)` for the lanes one after the other.
pub(super) fn lane_by_lane<L: Several>(
    y: &VecState<L>,
    dy: &mut VecState<L>,
    rhs: impl Fn(usize, &[f64], &mut [f64]),
) {
    let mut lanes = [const { Vec::new() }; MAX_LANES];
    for (k, out) in lanes.iter_mut().enumerate().take(L::LANES) {
        out.resize(y.0.len(), 0.0);
        rhs(k, &lane(&y.0, k), out);
    }
    for (at, dy) in dy.0.iter_mut().enumerate() {
        *dy = L::gather(|k| lanes[k][at]);
    }
}

impl<L: Several> LaneDynamics<L> for SideBySide<'_> {
    fn hold(&mut self, inputs: &[L]) -> bool {
        self.0.iter_mut().enumerate().all(|(k, dynamics)| dynamics.hold(&lane(inputs, k)))
    }

    fn rhs(&self, t: L, y: &VecState<L>, dy: &mut VecState<L>) {
        lane_by_lane(y, dy, |k, y, dy| Dynamics::rhs(&*self.0[k], t.lane(k), y, dy));
    }

    fn energy(&self, t: L, y: &VecState<L>) -> Option<L> {
        let lanes = self.0.iter().enumerate();
        let energies = lanes.map(|(k, d)| Dynamics::energy(&**d, t.lane(k), &lane(&y.0, k)));
        let energies: Vec<f64> = energies.collect::<Option<_>>()?;
        Some(L::gather(|k| energies[k]))
    }

    fn write_outputs(&self, t: L, y: &VecState<L>, out: &mut Vec<L>) {
        let of_lane = |k: usize| Dynamics::outputs(&*self.0[k], t.lane(k), &lane(&y.0, k));
        let lanes: Vec<Vec<f64>> = (0..L::LANES).map(of_lane).collect();
        out.clear();
        out.extend((0..lanes[0].len()).map(|at| L::gather(|k| lanes[k][at])));
    }

    fn check(&self, t: L, y: &VecState<L>) -> Result<(), Failure> {
        let lanes = self.0.iter().enumerate();
        lanes.into_iter().try_for_each(|(k, d)| System::check(d, t.lane(k), &VecState(lane(&y.0, k))))
    }

    fn domain(&self, t: L, y: &VecState<L>) -> Result<(), Failure> {
        let lanes = self.0.iter().enumerate();
        lanes.into_iter().try_for_each(|(k, d)| System::domain(d, t.lane(k), &VecState(lane(&y.0, k))))
    }

    fn signature(&self, t: L, y: &VecState<L>) -> L {
        L::gather(|k| Dynamics::signature(&*self.0[k], t.lane(k), &lane(&y.0, k)))
    }

    fn pivots(&self, t: L, y: &VecState<L>, visit: &mut dyn FnMut(Pivot<L>)) {
        let of_lane = |k: usize| {
            let mut pivots = Vec::new();
            Dynamics::pivots(&*self.0[k], t.lane(k), &lane(&y.0, k), &mut |pivot| pivots.push(pivot));
            pivots
        };
        let lanes: Vec<Vec<Pivot<f64>>> = (0..L::LANES).map(of_lane).collect();
        for (at, Pivot { name, .. }) in lanes[0].iter().enumerate() {
            let all = |part: fn(&Pivot<f64>) -> f64| L::gather(|k| part(&lanes[k][at]));
            visit(Pivot { name, value: all(|p| p.value), scale: all(|p| p.scale) });
        }
    }
}

impl System<f64> for dyn Dynamics + '_ {
    type State = VecState;

    fn rhs(&self, t: f64, y: &VecState, dy: &mut VecState) {
        Dynamics::rhs(self, t, &y.0, &mut dy.0);
    }

    fn check(&self, t: f64, y: &VecState) -> Result<(), Failure> {
        Dynamics::check(self, t, &y.0)
    }

    fn domain(&self, t: f64, y: &VecState) -> Result<(), Failure> {
        Dynamics::domain(self, t, &y.0)
    }

    fn signature(&self, t: f64, y: &VecState) -> f64 {
        Dynamics::signature(self, t, &y.0)
    }

    fn pivots(&self, t: f64, y: &VecState, visit: &mut dyn FnMut(Pivot<f64>)) {
        Dynamics::pivots(self, t, &y.0, visit);
    }
}

impl Differentiable<f64> for dyn Dynamics + '_ {
    fn jacobian(&self, t: f64, y: &VecState, jacobian: &mut [VecState]) {
        Dynamics::jacobian(self, t, &y.0, jacobian);
    }
}

impl Jet<f64> for dyn Dynamics + '_ {
    type Workspace = SeriesRoom;

    fn workspace(&self) -> SeriesRoom {
        SeriesRoom::default()
    }

    fn series(&self, t: f64, y: &VecState, workspace: &mut SeriesRoom, out: &mut [VecState]) {
        self.series_towards((t, t), y, workspace, out);
    }

    fn series_towards(
        &self,
        way: (f64, f64),
        y: &VecState,
        workspace: &mut SeriesRoom,
        out: &mut [VecState],
    ) -> f64 {
        Dynamics::series(self, way, &y.0, workspace, out).unwrap_or_else(|| {
            // The integrator reports what is not finite; who drives it asks first whether there are series.
            out.iter_mut().for_each(|state| state.0.fill(f64::NAN));
            way.1
        })
    }
}

impl System<f64> for PreparedScene<'_> {
    type State = VecState;

    fn rhs(&self, t: f64, y: &VecState, dy: &mut VecState) {
        System::rhs(&**self, t, y, dy);
    }

    fn check(&self, t: f64, y: &VecState) -> Result<(), Failure> {
        System::check(&**self, t, y)
    }

    fn domain(&self, t: f64, y: &VecState) -> Result<(), Failure> {
        System::domain(&**self, t, y)
    }

    fn signature(&self, t: f64, y: &VecState) -> f64 {
        System::signature(&**self, t, y)
    }

    fn pivots(&self, t: f64, y: &VecState, visit: &mut dyn FnMut(Pivot<f64>)) {
        System::pivots(&**self, t, y, visit);
    }
}

impl Differentiable<f64> for PreparedScene<'_> {
    fn jacobian(&self, t: f64, y: &VecState, jacobian: &mut [VecState]) {
        Differentiable::jacobian(&**self, t, y, jacobian);
    }
}

impl Jet<f64> for PreparedScene<'_> {
    type Workspace = SeriesRoom;

    fn workspace(&self) -> SeriesRoom {
        SeriesRoom::default()
    }

    fn series(&self, t: f64, y: &VecState, workspace: &mut SeriesRoom, out: &mut [VecState]) {
        Jet::series(&**self, t, y, workspace, out);
    }

    fn series_towards(
        &self,
        way: (f64, f64),
        y: &VecState,
        workspace: &mut SeriesRoom,
        out: &mut [VecState],
    ) -> f64 {
        Jet::series_towards(&**self, way, y, workspace, out)
    }
}

/// A scene with the same parameters on every lane.
pub struct OnLanes<'a>(PreparedScene<'a>);

impl System<F64x4> for OnLanes<'_> {
    type State = VecState<F64x4>;

    fn rhs(&self, t: F64x4, y: &VecState<F64x4>, dy: &mut VecState<F64x4>) {
        self.0.rhs_on_lanes(t, y, dy);
    }
}

impl<'a> OverScalar<F64x4> for PreparedScene<'a> {
    type Over = OnLanes<'a>;

    fn over(&self, _convert: impl Fn(f64) -> F64x4) -> OnLanes<'a> {
        OnLanes(self.clone())
    }

    fn state_over(state: &VecState, convert: impl Fn(f64) -> F64x4) -> VecState<F64x4> {
        VecState(state.0.iter().map(|y| convert(*y)).collect())
    }
}

impl<L: Several> System<L> for PreparedLanes<'_, L> {
    type State = VecState<L>;

    fn rhs(&self, t: L, y: &VecState<L>, dy: &mut VecState<L>) {
        (**self).rhs(t, y, dy);
    }

    fn check(&self, t: L, y: &VecState<L>) -> Result<(), Failure> {
        (**self).check(t, y)
    }

    fn domain(&self, t: L, y: &VecState<L>) -> Result<(), Failure> {
        (**self).domain(t, y)
    }

    fn signature(&self, t: L, y: &VecState<L>) -> L {
        (**self).signature(t, y)
    }

    fn pivots(&self, t: L, y: &VecState<L>, visit: &mut dyn FnMut(Pivot<L>)) {
        (**self).pivots(t, y, visit);
    }
}

impl<const K: usize> Invariants<f64, K> for PreparedScene<'_> {
    fn values(&self, t: f64, y: &VecState) -> [f64; K] {
        Invariants::values(&**self, t, y)
    }

    fn gradients(&self, t: f64, y: &VecState, gradients: &mut [VecState; K]) {
        Invariants::gradients(&**self, t, y, gradients);
    }
}

/// The invariants, and zeros for those beyond their number: these are met wherever the state goes.
impl<const K: usize> Invariants<f64, K> for dyn Dynamics + '_ {
    fn values(&self, t: f64, y: &VecState) -> [f64; K] {
        let mut values = [0.0; K];
        let n = self.n_invariants().min(K);
        Dynamics::invariants(self, t, &y.0, &mut values[..n]);
        values
    }

    fn gradients(&self, t: f64, y: &VecState, gradients: &mut [VecState; K]) {
        gradients.iter_mut().for_each(|gradient| gradient.0.fill(0.0));
        let n = self.n_invariants().min(K);
        Dynamics::invariant_gradients(self, t, &y.0, &mut gradients[..n]);
    }
}

/// The equations between coordinates, and zeros beyond their number.
impl<const K: usize> Positions<f64, K> for PreparedScene<'_> {
    fn n_equations(&self) -> usize {
        Dynamics::positions(&**self).map_or(0, |found| found.n_equations)
    }

    fn moved(&self) -> &[usize] {
        Dynamics::positions(&**self).map_or(&[], |found| found.moved)
    }

    fn residuals(&self, t: f64, y: &VecState) -> [f64; K] {
        let mut values = [0.0; K];
        let n = Dynamics::positions(&**self).map_or(0, |found| found.n_functions).min(K);
        self.position_residuals(t, &y.0, &mut values[..n]);
        values
    }

    fn residual_gradients(&self, t: f64, y: &VecState, gradients: &mut [VecState; K]) {
        gradients.iter_mut().for_each(|gradient| gradient.0.fill(0.0));
        let n = Dynamics::positions(&**self).map_or(0, |found| found.n_functions).min(K);
        self.position_gradients(t, &y.0, &mut gradients[..n]);
    }
}
