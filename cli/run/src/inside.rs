//! A scene with its angles as points of circles, as integrators carry them within a step.
//!
//! Does not know: which angles there are, how anything is integrated.

use hamel_runtime::{Circles, F64x4, OverScalar, System};

use super::dynamics::{Dynamics, PreparedScene, VecState};

/// A scene whose state has points of circles behind it.
pub struct Inside<'a>(PreparedScene<'a>);

impl System<f64> for Inside<'_> {
    type State = VecState;

    fn rhs(&self, t: f64, z: &VecState, dz: &mut VecState) {
        self.0.rhs_on_circles(t, &z.0, &mut dz.0);
    }
}

/// The same on every lane.
pub struct InsideOnLanes<'a>(PreparedScene<'a>);

impl System<F64x4> for InsideOnLanes<'_> {
    type State = VecState<F64x4>;

    fn rhs(&self, t: F64x4, z: &VecState<F64x4>, dz: &mut VecState<F64x4>) {
        self.0.rhs_on_circles_on_lanes(t, z, dz);
    }
}

impl<'a> OverScalar<F64x4> for Inside<'a> {
    type Over = InsideOnLanes<'a>;

    fn over(&self, _convert: impl Fn(f64) -> F64x4) -> InsideOnLanes<'a> {
        InsideOnLanes(self.0.clone())
    }

    fn state_over(state: &VecState, convert: impl Fn(f64) -> F64x4) -> VecState<F64x4> {
        PreparedScene::state_over(state, convert)
    }
}

impl<'a> Circles<f64> for PreparedScene<'a> {
    type Inside = Inside<'a>;

    fn inside(&self) -> Inside<'a> {
        Inside(self.clone())
    }

    fn on_circles(&self, y: &VecState) -> VecState {
        let mut z = VecState(vec![0.0; y.0.len() + 2 * self.n_circles()]);
        Dynamics::on_circles(&**self, &y.0, &mut z.0);
        z
    }
}
