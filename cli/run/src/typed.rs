//! A scene known at compile time, such as a generated one, behind what can be asked of any scene.
//!
//! Does not know: which scenes there are, how states are integrated.

use std::marker::PhantomData;

use hamel_runtime::{Dual, F64x4, Failure, MAX_ORDER, ParamError, Pivot, Real, Scene, System};

use super::dynamics::{
    BadParams, DualDynamics, Dynamics, Factory, LaneDynamics, PositionEquations, PreparedDuals,
    PreparedLanes, PreparedScene, VecState,
};
use super::info::Info;

/// One scene with three scalars, none of which a value is kept of.
type Scalars<S, W, D> = fn() -> (S, W, D);

/// A scene known at compile time, such as a generated one, behind [`Factory`]: on one lane, `S`, on four, `W`, and with
/// dual numbers, `D`, for its Jacobian.
#[derive(Debug)]
pub struct Typed<S, W, D, const N: usize> {
    info: Info,
    scalars: PhantomData<Scalars<S, W, D>>,
}

impl<S, W, D, const N: usize> Typed<S, W, D, N>
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    W: Scene<F64x4> + System<F64x4, State = [F64x4; N]>,
    D: Scene<Dual> + System<Dual, State = [Dual; N]>,
{
    /// The scene.
    pub fn new() -> Self {
        Typed { info: Info::of::<f64, S>(), scalars: PhantomData }
    }
}

impl<S, W, D, const N: usize> Default for Typed<S, W, D, N>
where
    S: Scene<f64> + System<f64, State = [f64; N]>,
    W: Scene<F64x4> + System<F64x4, State = [F64x4; N]>,
    D: Scene<Dual> + System<Dual, State = [Dual; N]>,
{
    fn default() -> Self {
        Self::new()
    }
}

impl<S, W, D, const N: usize> Factory for Typed<S, W, D, N>
where
    S: Scene<f64> + System<f64, State = [f64; N]> + Send + Sync,
    W: Scene<F64x4> + System<F64x4, State = [F64x4; N]> + Send + Sync,
    D: Scene<Dual> + System<Dual, State = [Dual; N]> + Send + Sync,
{
    fn info(&self) -> &Info {
        &self.info
    }

    fn prepare(&self, values: &[f64]) -> Result<PreparedScene<'_>, BadParams> {
        let duals: Vec<Dual> = values.iter().copied().map(Dual::constant).collect();
        let lanes: Vec<F64x4> = values.iter().copied().map(F64x4::splat).collect();
        let (scene, lanes, dual) = (of::<f64, S>(values)?, of::<F64x4, W>(&lanes)?, of::<Dual, D>(&duals)?);
        Ok(PreparedScene::new(PreparedTyped { info: &self.info, scene, lanes, dual }))
    }

    fn prepare_lanes(&self, values: &[F64x4]) -> Result<PreparedLanes<'_>, BadParams> {
        struct Prepared<W>(W);
        impl<W, const N: usize> LaneDynamics for Prepared<W>
        where
            W: System<F64x4, State = [F64x4; N]> + Send + Sync,
        {
            fn rhs(&self, t: F64x4, y: &VecState<F64x4>, dy: &mut VecState<F64x4>) {
                self.0.rhs(t, array(&y.0), array_mut(&mut dy.0));
            }

            fn check(&self, t: F64x4, y: &VecState<F64x4>) -> Result<(), Failure> {
                self.0.check(t, array(&y.0))
            }

            fn domain(&self, t: F64x4, y: &VecState<F64x4>) -> Result<(), Failure> {
                self.0.domain(t, array(&y.0))
            }

            fn signature(&self, t: F64x4, y: &VecState<F64x4>) -> F64x4 {
                self.0.signature(t, array(&y.0))
            }

            fn pivots(&self, t: F64x4, y: &VecState<F64x4>, visit: &mut dyn FnMut(Pivot<F64x4>)) {
                self.0.pivots(t, array(&y.0), visit);
            }
        }
        Ok(Box::new(Prepared(of::<F64x4, W>(values)?)))
    }

    fn prepare_duals(&self, values: &[Dual]) -> Result<PreparedDuals<'_>, BadParams> {
        struct Prepared<D>(D);
        impl<D, const N: usize> DualDynamics for Prepared<D>
        where
            D: Scene<Dual> + System<Dual, State = [Dual; N]> + Send + Sync,
        {
            fn rhs(&self, t: Dual, y: &[Dual], dy: &mut [Dual]) {
                self.0.rhs(t, array(y), array_mut(dy));
            }

            fn energy(&self, t: Dual, y: &[Dual]) -> Option<Dual> {
                self.0.energy_of(t, array(y))
            }

            fn outputs(&self, t: Dual, y: &[Dual]) -> Vec<Dual> {
                let mut out = vec![Dual::ZERO; D::INFO.n_outputs()];
                self.0.outputs_of(t, array(y), &mut out);
                out
            }
        }
        Ok(Box::new(Prepared(of::<Dual, D>(values)?)))
    }
}

/// The scene with parameters, and inputs where they are behind them.
fn of<R: Real, S: Scene<R>>(values: &[R]) -> Result<S, ParamError> {
    let (params, inputs) = values.split_at(S::INFO.params.len().min(values.len()));
    let mut scene = S::prepare(params)?;
    if !inputs.is_empty() {
        scene.hold_inputs_of(inputs);
    }
    Ok(scene)
}

struct PreparedTyped<'a, S, W, D> {
    info: &'a Info,
    scene: S,
    /// The same on every lane.
    lanes: W,
    /// The same with dual numbers.
    dual: D,
}

fn array<R, const N: usize>(y: &[R]) -> &[R; N] {
    y.try_into().expect("state of the scene's dimension")
}

fn array_mut<R, const N: usize>(dy: &mut [R]) -> &mut [R; N] {
    dy.try_into().expect("derivative of the scene's dimension")
}

impl<S, W, D, const N: usize> Dynamics for PreparedTyped<'_, S, W, D>
where
    S: Scene<f64> + System<f64, State = [f64; N]> + Send + Sync,
    W: Scene<F64x4> + System<F64x4, State = [F64x4; N]> + Send + Sync,
    D: System<Dual, State = [Dual; N]> + Send + Sync,
{
    fn info(&self) -> &Info {
        self.info
    }

    fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        System::rhs(&self.scene, t, array(y), array_mut(dy));
    }

    fn rhs_on_lanes(&self, t: F64x4, y: &VecState<F64x4>, dy: &mut VecState<F64x4>) {
        self.lanes.rhs(t, array(&y.0), array_mut(&mut dy.0));
    }

    fn n_circles(&self) -> usize {
        S::N_CIRCLES
    }

    fn on_circles(&self, y: &[f64], z: &mut [f64]) {
        self.scene.on_circles_of(array(y), z);
    }

    fn rhs_on_circles(&self, t: f64, z: &[f64], dz: &mut [f64]) {
        self.scene.rhs_on_circles_of(t, z, dz);
    }

    fn rhs_on_circles_on_lanes(&self, t: F64x4, z: &VecState<F64x4>, dz: &mut VecState<F64x4>) {
        self.lanes.rhs_on_circles_of(t, &z.0, &mut dz.0);
    }

    fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        self.scene.energy_of(t, array(y))
    }

    fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        let mut out = vec![0.0; S::INFO.n_outputs()];
        self.scene.outputs_of(t, array(y), &mut out);
        out
    }

    fn series(&self, (t, towards): (f64, f64), y: &[f64], out: &mut [VecState]) -> Option<f64> {
        let mut series = [[0.0; N]; MAX_ORDER + 1];
        let n = out.len().min(series.len());
        let known = self.scene.series_of(t, array(y), &mut series[..n]);
        for (out, coefficient) in out.iter_mut().zip(&series) {
            out.0.copy_from_slice(coefficient);
        }
        known.then_some(towards)
    }

    fn jacobian(&self, t: f64, y: &[f64], rows: &mut [VecState]) {
        let mut state: [Dual; N] = array::<f64, N>(y).map(Dual::constant);
        let mut out = state;
        for column in 0..N {
            state[column] = Dual::variable(y[column]);
            System::rhs(&self.dual, Dual::constant(t), &state, &mut out);
            state[column] = Dual::constant(y[column]);
            rows.iter_mut().zip(&out).for_each(|(row, value)| row.0[column] = value.derivative);
        }
    }

    fn rhs_cost(&self) -> Option<u64> {
        None
    }

    fn n_invariants(&self) -> Option<usize> {
        (S::N_INVARIANTS > 0).then_some(S::N_INVARIANTS)
    }

    fn invariants(&self, t: f64, y: &[f64], values: &mut [f64]) {
        self.scene.invariants_of(t, array(y), values);
    }

    fn invariant_gradients(&self, t: f64, y: &[f64], gradients: &mut [VecState]) {
        let mut rows = vec![[0.0; N]; gradients.len()];
        self.scene.invariant_gradients_of(t, array(y), &mut rows);
        gradients.iter_mut().zip(&rows).for_each(|(gradient, row)| gradient.0.copy_from_slice(row));
    }

    fn positions(&self) -> Option<PositionEquations<'_>> {
        let found = PositionEquations {
            n_functions: S::N_POSITIONS,
            n_equations: S::POSITION_EQUATIONS,
            moved: S::MOVED,
        };
        (S::N_POSITIONS > 0).then_some(found)
    }

    fn position_residuals(&self, t: f64, y: &[f64], values: &mut [f64]) {
        self.scene.positions_of(t, array(y), values);
    }

    fn position_gradients(&self, t: f64, y: &[f64], gradients: &mut [VecState]) {
        let mut rows = vec![[0.0; N]; gradients.len()];
        self.scene.position_gradients_of(t, array(y), &mut rows);
        gradients.iter_mut().zip(&rows).for_each(|(gradient, row)| gradient.0.copy_from_slice(row));
    }

    fn flows(&self) -> Result<usize, String> {
        let missing = "was compiled without its exact flows: choose a scene that wants `splitting`, or --via interpreter";
        if S::N_FLOWS > 0 { Ok(S::N_FLOWS) } else { Err(missing.to_owned()) }
    }

    fn flow(&self, index: usize, tau: f64, y: &[f64], increment: &mut [f64]) {
        self.scene.flow_of(index, tau, array(y), array_mut(increment));
    }

    fn check(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        System::check(&self.scene, t, array(y))
    }

    fn domain(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        System::domain(&self.scene, t, array(y))
    }

    fn signature(&self, t: f64, y: &[f64]) -> f64 {
        System::signature(&self.scene, t, array(y))
    }

    fn pivots(&self, t: f64, y: &[f64], visit: &mut dyn FnMut(Pivot<f64>)) {
        System::pivots(&self.scene, t, array(y), visit);
    }
}
