//! Model files: read and checked, and what they say about themselves.
//!
//! Does not know: where a file comes from, how a scene is evaluated, commands.

pub mod blocks;
mod checked;
mod extended;
pub mod roles;
pub mod spelling;
pub mod units;

use hamel_codegen::scene;
pub use hamel_codegen::spec::Model;
use hamel_codegen::spec::{self, ConnectionKind, Diagnostics, IdealChain, Want, Wanted};
use hamel_expr::Budget;

pub use checked::Checked;
pub use extended::{first_message, is_one_expression, number};

use crate::error::Error;
use crate::streams::{is_coloured, note};

/// Name of the scene that every model has.
pub const DEFAULT_SCENE: &str = scene::DEFAULT;

/// Name of the scene that takes all inputs of its model but noises.
pub const CONTROLLED_SCENE: &str = scene::CONTROLLED;

/// Name of the scene that takes the noises of its model as well.
pub const STOCHASTIC_SCENE: &str = scene::STOCHASTIC;

/// The scene that takes what can drive a model: the default one where there is nothing.
pub fn scene_with_inputs(model: &Model) -> &'static str {
    if model.controls().next().is_some() { CONTROLLED_SCENE } else { DEFAULT_SCENE }
}

/// Name of the scene that a simulation with the group's coordinates runs.
pub const RECONSTRUCTION_SCENE: &str = scene::RECONSTRUCTION;

/// Reads and checks the text of a model within so many times the default budget; `file` is shown in messages.
///
/// # Errors
/// [`Error::Models`] with every problem of the text.
pub fn parse(file: &str, text: &str, budget: u64) -> Result<Model, Error> {
    Ok(spec::parse_within(Budget::default().times(budget), file, text)?)
}

/// Writes warnings to standard error.
pub fn show_warnings(warnings: &Diagnostics) {
    if !warnings.is_empty() {
        note(warnings.render(is_coloured()));
    }
}

/// Whether a model has equations between coordinates.
pub fn has_positions(model: &Model) -> bool {
    model.constraints.iter().any(|constraint| constraint.position.is_some())
}

/// Whether a model's scene says that it wants something, such as its invariants.
pub fn wants(model: &Model, scene_name: &str, what: Want) -> bool {
    let own = model.scenes.iter().find(|scene| scene.name == scene_name);
    own.is_some_and(|scene| scene.wants.contains(&Wanted::Want(what)))
}

/// Why a name cannot be that of a model, or nothing.
pub fn name_refusal(name: &str) -> Option<&'static str> {
    spec::name_refusal(name)
}

/// The same system to be written with another connection: as an item `connection mechanical;` asks. A system without
/// such a connection is refused where it is derived.
pub fn with_connection(model: &Model, connection: ConnectionKind) -> Model {
    Model { derived_connection: Some(connection), ..model.clone() }
}

/// The same system with its group as the one stage, where it says nothing about stages.
pub fn with_one_stage(model: &Model) -> Model {
    match model.stages.is_some() || model.algebra.dim() == 0 {
        true => model.clone(),
        false => Model { stages: Some(IdealChain::whole()), ..model.clone() },
    }
}

/// Names of the coordinates that a model reconstructs, those of the group and cyclic ones, in the order of the scene's
/// state; may be empty.
pub fn group_coordinates(model: &Model) -> Vec<String> {
    scene::reconstructed(model)
}

/// The first line of a model's documentation; may be empty.
pub fn title(model: &Model) -> String {
    model.doc.iter().map(|line| line.trim()).find(|line| !line.is_empty()).unwrap_or_default().to_owned()
}
