//! The rounding errors of right-hand sides, bounded, or measured where a right-hand side carries them along, at points
//! that all formulations of a scene share.
//!
//! Does not know: how formulations are found, what their operations cost.

use std::collections::BTreeMap;

use hamel_runtime::DoubleDouble;

use crate::scene::built::BuiltScene;
use hamel_expr::{SymbolId, rational_to_f64};
use hamel_lang::spec::{Domain, Model};
use hamel_mechanics::mechanics::{ChangeOfState, Equations};
use hamel_program::program::{Bounded, Program, Role};

/// Points at which errors are bounded, and those drawn to find as many.
const POINTS: usize = 16;
const DRAWN: usize = 64;
/// The largest relative error of rounding to a double.
const ROUNDOFF: f64 = f64::EPSILON / 2.0;
/// Relative change of an input in difference quotients.
const SHIFT: f64 = 1.0 / (1u64 << 20) as f64;

/// Time, parameters and states of one formulation, at which others are measured too.
#[derive(Clone, Debug)]
pub(super) struct Points {
    /// The inputs in order.
    inputs: Vec<SymbolId>,
    /// Parameters of the program.
    params: Vec<SymbolId>,
    time: SymbolId,
    points: Vec<BTreeMap<SymbolId, f64>>,
}

impl Points {
    /// Parameters up to a factor of two from their defaults that the scene allows, states of order one, coordinates in
    /// their intervals; the same ones every time.
    pub(super) fn new(model: &Model, hub: &Equations, built: &BuiltScene) -> Points {
        let mut random = Random(0x5eed);
        let system = &hub.system;
        let params: Vec<SymbolId> = system.params.iter().map(|p| p.symbol).collect();
        let mut points = Vec::new();
        for _ in 0..DRAWN {
            let mut point = BTreeMap::from([(system.time, random.number())]);
            for param in &system.params {
                point.insert(param.symbol, rational_to_f64(&param.default) * random.number().exp2());
            }
            for s in hub.state.iter().chain(&hub.reconstruction) {
                let coordinate = model.base.iter().find(|c| c.symbol == s.symbol);
                let value = match coordinate.map(|c| c.domain) {
                    Some(Domain::Interval(low, high)) => {
                        let end = |e| model.graph.eval_f64(e, &known(&point, model));
                        let (low, high) = (end(low).unwrap_or(-1.0), end(high).unwrap_or(1.0));
                        low + (high - low) * (0.5 + 0.4 * random.number())
                    }
                    Some(Domain::Angle) => std::f64::consts::PI * random.number(),
                    Some(Domain::Real) | None => 2.0 * random.number(),
                };
                point.insert(s.symbol, value);
            }
            let values: Vec<f64> = params.iter().map(|s| point[s]).collect();
            if built.program.prepare(&values).is_ok() {
                points.push(point);
            }
            if points.len() == POINTS {
                break;
            }
        }
        let states = hub.state.iter().chain(&hub.reconstruction).map(|s| s.symbol);
        let inputs = params.iter().copied().chain([system.time]).chain(states).collect();
        Points { inputs, params, time: system.time, points }
    }

    /// Leaves out points at which a formulation has no bound.
    pub(super) fn keep_those_of(&mut self, built: &BuiltScene, change: &ChangeOfState) {
        let points = std::mem::take(&mut self.points);
        self.points = points.into_iter().filter(|point| self.at(built, change, point).is_some()).collect();
    }

    /// The largest bound of the error of a rate, or the error itself where the rates carry errors along, over all
    /// points and components, in units of the roundoff times what rounding time, parameters and the state of the hub,
    /// in which the points are, does to that rate; infinite where a rate of a point is not finite, zero where there are
    /// no points.
    pub(super) fn bound(&self, built: &BuiltScene, change: &ChangeOfState) -> f64 {
        let largest = self.points.iter().map(|point| self.at(built, change, point).unwrap_or(f64::INFINITY));
        largest.fold(0.0, f64::max)
    }

    fn at(&self, built: &BuiltScene, change: &ChangeOfState, point: &BTreeMap<SymbolId, f64>) -> Option<f64> {
        let program = &built.program;
        let (params, state) = self.mapped(built, change, point)?;
        let exact = |x: &[f64]| x.iter().map(|x| Bounded::exact(DoubleDouble::from(*x))).collect::<Vec<_>>();
        let rates = run(program, &exact(&params), Bounded::exact(point[&self.time].into()), &exact(&state))?;
        let plain = run(program, &params, point[&self.time], &state)?;
        let mut effects: Vec<f64> = plain.iter().map(|x| x.abs()).collect();
        for input in &self.inputs {
            let mut moved = point.clone();
            moved.entry(*input).and_modify(|x| *x *= 1.0 + SHIFT);
            let Some((params, state)) = self.mapped(built, change, &moved) else { continue };
            let Some(other) = run(program, &params, moved[&self.time], &state) else { continue };
            for ((effect, other), plain) in effects.iter_mut().zip(other).zip(&plain) {
                let change = (other - plain).abs() / SHIFT;
                *effect += if change.is_finite() { change } else { 0.0 };
            }
        }
        // A bound of the errors of a value and of its rest does not know that one takes away those of the other.
        let carries_errors =
            program.function_idx(&Role::Rate).is_some_and(|k| program.functions[k].carries_errors());
        let error = |rate: &Bounded, plain: &f64| {
            if carries_errors {
                (rate.value() - DoubleDouble::from(*plain)).hi().abs() / ROUNDOFF
            } else {
                rate.error()
            }
        };
        let errors = rates.iter().zip(&plain).map(|(rate, plain)| error(rate, plain));
        let losses = errors.zip(effects).filter(|(_, effect)| *effect > 0.0);
        let losses = losses.map(|(error, effect)| error / effect);
        losses
            .map(|loss| loss.is_finite().then_some(loss))
            .try_fold(0.0_f64, |worst, loss| Some(worst.max(loss?)))
    }

    /// Parameters and state of the program at a point of the hub.
    fn mapped(
        &self,
        built: &BuiltScene,
        change: &ChangeOfState,
        point: &BTreeMap<SymbolId, f64>,
    ) -> Option<(Vec<f64>, Vec<f64>)> {
        let roots: Option<Vec<_>> = built.state.iter().map(|s| change.value(s.symbol)).collect();
        let roots = roots?;
        let values = change.graph().eval_known(&roots, point);
        let state = roots.iter().map(|e| values.get(e).copied()).collect::<Option<Vec<f64>>>()?;
        Some((self.params.iter().map(|s| point[s]).collect(), state))
    }
}

fn known(point: &BTreeMap<SymbolId, f64>, model: &Model) -> BTreeMap<SymbolId, f64> {
    let defaults = model.params.iter().map(|p| (p.symbol, rational_to_f64(&p.default)));
    defaults.chain(point.iter().map(|(s, x)| (*s, *x))).collect()
}

/// The rates; none where the parameters are refused.
fn run<R: hamel_runtime::Real>(program: &Program, params: &[R], t: R, state: &[R]) -> Option<Vec<R>> {
    let prepared = program.prepare(params).ok()?;
    let mut rates = vec![R::ZERO; state.len()];
    program.run(program.function_idx(&Role::Rate)?, params, &prepared, t, state, &mut rates);
    Some(rates)
}

/// SplitMix64 (Steele, Lea, Flood, 2014), to `[-1, 1)`.
struct Random(u64);

impl Random {
    fn number(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / (1u64 << 63) as f64 - 1.0
    }
}
