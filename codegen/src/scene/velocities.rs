//! The motion of a scene in the velocities of its model, for equations that are written in these.
//!
//! Does not know: what the equations are for.

use hamel_expr::error::Error;
use hamel_lang::spec::{CarriedBy, Model};
use hamel_mechanics::mechanics::{Equations, derive, same_motion};
use hamel_mechanics::reduction::{Formulation, StageUse, reduce};

use super::BuiltScene;

fn refused(what: &str, possible: &str) -> Error {
    Error::Unsupported { what: what.into(), possible: possible.into() }
}

/// The same motion in the velocities of the model and its own frame, where the scene has others.
///
/// # Errors
/// [`Error::Unsupported`] beside a Hamiltonian and momenta that are parameters, and where both are not seen to be one
/// motion.
pub fn in_velocities(model: &Model, scene: &BuiltScene) -> Result<Option<Equations>, Error> {
    let own = &scene.equations.system.formulation;
    if scene.equations.system.hamiltonian.is_some() {
        return Err(refused("equations by stages of a hamiltonian", "a model with a lagrangian"));
    }
    if own.momenta.iter().any(|carried| matches!(carried.by, CarriedBy::Parameter(_))) {
        return Err(refused(
            "equations by stages of momenta that are parameters",
            "the model without `routh`",
        ));
    }
    let is_plain = own.momenta.is_empty() && matches!(own.stages, StageUse::Shown | StageUse::Unused);
    if is_plain {
        return Ok(None);
    }
    let formulation = Formulation { momenta: Vec::new(), stages: StageUse::Shown, ..own.clone() };
    let system = reduce(model, &formulation).map_err(|_| refused(UNPROVED, OTHERWISE))?;
    let equations = derive(&system)?;
    match same_motion(&scene.equations, &equations) {
        Ok(()) => Ok(Some(equations)),
        Err(_) => Err(refused(UNPROVED, OTHERWISE)),
    }
}

const UNPROVED: &str = "velocities in which the motion is not seen to be the same";
const OTHERWISE: &str = "a scene that carries velocities";
