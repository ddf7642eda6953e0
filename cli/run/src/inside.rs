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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use hamel_runtime::F64x4;

    use crate::cache::Cache;
    use crate::dynamics::{Factory, VecState};
    use crate::interpreted::build;
    use crate::model::Checked;
    use crate::session::Session;

    #[test]
    fn lanes_have_the_bits_of_numbers_with_angles_and_on_circles() {
        let mut n_on_circles = 0;
        for name in ["snakeboard", "euler_disk", "two_arm_satellite"] {
            let path = format!("{}/../../models/specs/{name}.hamel", env!("CARGO_MANIFEST_DIR"));
            let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"));
            let model = Session::of_shipped(&[]).parse(name, &text).unwrap_or_else(|e| panic!("{e}"));
            let model = Arc::new(Checked::new(model, Cache::none()));
            let scene = build(&model, "default").unwrap_or_else(|e| panic!("{e}")).in_memory();
            let params: Vec<f64> = scene.info().params.iter().map(|p| p.default).collect();
            let dynamics = scene.prepare(&params).unwrap_or_else(|e| panic!("{e}"));
            let n = scene.info().state.len();
            let state =
                |lane: usize| (0..n).map(|c| (0.4 * c as f64 + 1.1 * lane as f64).sin()).collect::<Vec<_>>();
            let lanes = |states: &[Vec<f64>]| {
                let of = |c: usize| F64x4::new(std::array::from_fn(|lane| states[lane][c]));
                VecState((0..states[0].len()).map(of).collect::<Vec<_>>())
            };
            let (t, states) = (F64x4::splat(0.3), (0..4).map(state).collect::<Vec<_>>());
            let mut rates = lanes(&states);
            dynamics.rhs_on_lanes(t, &lanes(&states), &mut rates);
            let points: Vec<Vec<f64>> = states
                .iter()
                .map(|y| {
                    let mut z = vec![0.0; n + 2 * dynamics.n_circles()];
                    dynamics.on_circles(y, &mut z);
                    z
                })
                .collect();
            let mut on_circles = lanes(&points);
            if dynamics.n_circles() > 0 {
                dynamics.rhs_on_circles_on_lanes(t, &lanes(&points), &mut on_circles);
                n_on_circles += 1;
            }
            for lane in 0..4 {
                let (mut dy, mut dz) = (states[lane].clone(), points[lane].clone());
                dynamics.rhs(0.3, &states[lane], &mut dy);
                assert!(
                    rates.0.iter().zip(&dy).all(|(a, b)| a.lane(lane).to_bits() == b.to_bits()),
                    "{name}"
                );
                if dynamics.n_circles() > 0 {
                    dynamics.rhs_on_circles(0.3, &points[lane], &mut dz);
                    let found = on_circles.0.iter().zip(&dz);
                    assert!(found.into_iter().all(|(a, b)| a.lane(lane).to_bits() == b.to_bits()), "{name}");
                }
            }
        }
        assert!(n_on_circles > 0, "no scene on circles");
    }
}
