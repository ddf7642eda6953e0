//! Derivatives of a motion through an event that changes its state or ends it.
//!
//! Deliberately does not know: how events are found, how derivatives are carried between them.

use hamel_codegen::scene::{Executable, Interpreter, SceneEvent};
use hamel_runtime::Dual;

use super::direction::Direction;

/// What an event does to the derivatives of a motion.
///
/// An event at `t` where `g(t, y; p) = 0` is later by `dt` where state and parameters are others, and the motion before
/// it lasts longer by that, the motion behind it is shorter:
///
/// ```text
/// dt = -(g_y s + g_p q) / (g_t + g_y f)
/// s' = h_y (s + f dt) + h_t dt + h_p q - f' dt
/// ```
///
/// with the state `h(t, y; p)` after the event, and the rates `f` before and `f'` after it. Where the event ends the
/// motion, the last term is missing: these are the derivatives of the last state, whose time is another.
///
/// # Source
///
/// Aizerman and Gantmakher, Determination of stability by linear approximation of a periodic solution of a system of
/// differential equations with discontinuous right-hand sides (1958).
pub(super) struct Saltation<'a> {
    /// With parameters that do not move.
    still: Interpreter<'a, Dual>,
    /// For each direction with parameters that move along it.
    along: Vec<Interpreter<'a, Dual>>,
}

impl<'a> Saltation<'a> {
    /// For directions in the order of the derivatives behind a state.
    ///
    /// # Errors
    /// The condition on parameters that does not hold.
    pub(super) fn new(
        executable: &'a Executable,
        params: &[f64],
        directions: &[Direction],
    ) -> Result<Saltation<'a>, String> {
        let prepare = |duals: &[Dual]| executable.prepare_over(duals).map_err(|bad| bad.condition);
        let still: Vec<Dual> = params.iter().copied().map(Dual::constant).collect();
        let along = directions.iter().map(|direction| prepare(&direction.params(params)));
        Ok(Saltation { still: prepare(&still)?, along: along.collect::<Result<_, _>>()? })
    }

    /// Takes a state with its derivatives behind it through an event, by its place among all; `rates` are those of the
    /// state with its derivatives. Gives the events that have happened: this one, and conditions that it has made true.
    ///
    /// # Errors
    /// Why there are no derivatives behind the event.
    pub(super) fn pass(
        &self,
        (place, events): (usize, &[SceneEvent]),
        t: f64,
        z: &mut [f64],
        rates: &dyn Fn(&[f64]) -> Vec<f64>,
    ) -> Result<Vec<usize>, String> {
        let n = z.len() / (self.along.len() + 1);
        let (y, before) = (z[..n].to_vec(), rates(z));
        let moved = |s: &[f64], by: f64| -> Vec<Dual> {
            let each = y.iter().zip(s).zip(&before);
            each.map(|((y, s), f)| Dual::new(*y, f.mul_add(by, *s))).collect()
        };
        let slope = |scene: &Interpreter<'_, Dual>, t: Dual, y: &[Dual]| {
            scene.events(t, y).and_then(|values| Some(values.get(place)?.derivative)).unwrap_or(f64::NAN)
        };
        let crossing = slope(&self.still, Dual::variable(t), &moved(&vec![0.0; n], 1.0));
        let mut delays = Vec::with_capacity(self.along.len());
        let mut tangents = Vec::with_capacity(z.len() - n);
        let mut done = Vec::new();
        let (own, derivatives) = z.split_at_mut(n);
        for (scene, s) in self.along.iter().zip(derivatives.chunks(n)) {
            let delay = -slope(scene, Dual::constant(t), &moved(s, 0.0)) / crossing;
            if !delay.is_finite() {
                return Err("has no derivatives: the motion touches it without crossing".to_owned());
            }
            let mut after = moved(s, delay);
            done = scene.apply(events, place, Dual::new(t, delay), &mut after);
            delays.push(delay);
            tangents.push(after.iter().map(|y| y.derivative).collect::<Vec<f64>>());
            own.iter_mut().zip(&after).for_each(|(y, after)| *y = after.value);
        }
        let after = rates(z);
        for ((s, tangent), delay) in z[n..].chunks_mut(n).zip(tangents).zip(delays) {
            let delay = if done.iter().any(|k| events[*k].stops) { 0.0 } else { delay };
            for ((s, tangent), f) in s.iter_mut().zip(tangent).zip(&after) {
                *s = (-delay).mul_add(*f, tangent);
            }
        }
        Ok(done)
    }
}
