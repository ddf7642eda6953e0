//! Noise of a motion: which path, on which grid of times, and what a motion with noise can be asked for.
//!
//! Does not know: how increments are made, how a scene is evaluated.

use hamel_runtime::Wiener;
use serde::{Deserialize, Serialize};

use super::info::Info;
use super::method::{MethodName, Steps};
use crate::error::Error;

/// Which path of the noises of a scene a motion takes; nothing where a scene has no noise.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Noise {
    /// Seed of all paths.
    #[serde(default)]
    pub seed: u64,
    /// Number of the path; in an ensemble, that of the trajectory.
    #[serde(default)]
    pub path: u32,
    /// The grid on which increments are drawn, where that is not the step: another step then has the same path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step: Option<f64>,
}

/// Relative distance from a whole number of steps that rounding explains.
const ROUNDING: f64 = 1e-9;

impl Noise {
    /// Whether a scene has noises for a path that somebody has chosen.
    ///
    /// # Errors
    /// What follows the word for the place where it was chosen.
    pub fn suits(&self, info: &Info) -> Result<(), String> {
        if *self == Noise::default() || !info.noises.is_empty() {
            return Ok(());
        }
        let Info { scene, model, .. } = info;
        Err(format!(
            "is given, but scene {scene} of {model} has no noise: a model with `noise` has scene stochastic"
        ))
    }

    /// The increments for a motion with states at these times.
    ///
    /// # Errors
    /// [`Error::Options`] for steps and methods that go over jumps of the noise, and for times between two steps, where
    /// the motion has no state.
    pub(crate) fn wiener(
        &self,
        info: &Info,
        (method, steps): (MethodName, Steps),
        times: impl IntoIterator<Item = f64>,
    ) -> Result<Wiener, Error> {
        let refused = |reason: String| {
            let Info { scene, model, .. } = info;
            Err(Error::Options { reason: format!("scene {scene} of {model} has noise: {reason}") })
        };
        let Steps::Fixed { step } = steps else {
            return refused("it is held over steps of one size, so give a step and no tolerances".into());
        };
        if !method.evaluates_inside() {
            return refused(format!(
                "method {} evaluates the rates at the ends of steps, where noise jumps; choose midpoint, gauss4, gauss6 \
                 or gauss8",
                method.name()
            ));
        }
        let whole = |ratio: f64| {
            let n = ratio.round();
            (n >= 1.0 && (ratio - n).abs() <= ROUNDING * n && n <= f64::from(u32::MAX)).then_some(n as u32)
        };
        let fine = self.step.unwrap_or(step);
        if !(fine > 0.0 && fine.is_finite() && step > 0.0 && step.is_finite()) {
            return refused(format!(
                "its step {fine:?} and the step {step:?} of the method have to be above zero"
            ));
        }
        let wiener = Wiener::new(self.seed, fine).with_path(self.path);
        let wiener = match (whole(step / fine), whole(fine / step)) {
            (Some(n), _) => wiener.merged(n),
            (None, Some(_)) => wiener,
            (None, None) => {
                return refused(format!(
                    "its step {fine:?} is no whole part and no multiple of the step {step:?} of the method"
                ));
            }
        };
        if let Some(t) = times.into_iter().find(|t| *t != 0.0 && whole(t.abs() / step).is_none()) {
            return refused(format!(
                "its states are those at the ends of steps, and the time {t:?} is no multiple of the step {step:?}"
            ));
        }
        Ok(wiener)
    }
}

/// The number of samples of a motion for which nobody has chosen another one: `most`, or fewer where noise leaves a
/// motion no states but those at the ends of steps.
pub fn samples_for(info: &Info, steps: Steps, t_final: f64, most: usize) -> usize {
    let Steps::Fixed { step } = steps else { return most };
    let n_steps = (t_final / step).abs().round();
    if info.noises.is_empty() || !(n_steps >= 1.0 && n_steps <= f64::from(u32::MAX)) {
        return most;
    }
    let n_steps = n_steps as usize;
    let divides = |n: &usize| n_steps.is_multiple_of(*n);
    (1..most.min(n_steps + 1)).rev().find(divides).map_or(most, |n| n + 1)
}

/// The method of a motion: the one that somebody has chosen, if anybody has.
pub fn method_for(info: &Info, chosen: Option<MethodName>) -> MethodName {
    let unchosen = if info.noises.is_empty() { MethodName::default() } else { MethodName::Midpoint };
    chosen.unwrap_or(unchosen)
}

/// A scene with noise where none is possible.
///
/// # Errors
/// [`Error::Options`] where the scene has noise.
pub fn refuse(info: &Info, what: &str) -> Result<(), Error> {
    if info.noises.is_empty() {
        return Ok(());
    }
    let Info { scene, model, .. } = info;
    let reason = format!("scene {scene} of {model} has noise, {what}; a scene that takes no noise has none");
    Err(Error::Options { reason })
}
