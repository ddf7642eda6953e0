//! From a checked model to one Lie algebroid with Lagrangian, constraint and force.
//!
//! [`reduce`] is a list of rewrites in the order that a [`Formulation`] is read in: of the model (`fix`, `connection`),
//! from the model to a [`ReducedSystem`] (`assemble`, with `algebroid`, `constraint`, `stages` and `reconstruction`),
//! and of the system (`circle`, `frame`). A new kind of system is one more rewrite, never a second derivation.
//!
//! Does not know: equations of motion, programs, text files.

mod algebroid;
mod assemble;
mod change;
mod circle;
mod connection;
mod constraint;
mod degenerate;
mod domain;
mod fix;
mod formulation;
mod frame;
mod given;
mod inertialess;
mod lift;
mod lifted;
mod matrix_group;
mod momenta;
mod noise;
mod part;
mod quasi_invariance;
mod reconstruction;
mod stages;
mod system;

use hamel_lang::spec::{Diagnostics, Model};

pub use change::{Change, Frame};
pub use circle::with_circles;
pub use connection::beside_connection;
pub use connection::with_connection;
pub use constraint::{
    AccelerationRow, AccelerationSource, CarriedAcceleration, ConstraintRow, HigherOrder,
    KinematicConstraint, Reactions, Response, SolvedConstraint, Unknown,
};
pub use degenerate::{Degeneracy, DegenerateOutcome, DegenerateStep};
pub use domain::DomainCondition;
pub use fix::{with_fixed, with_held_inputs};
pub use formulation::{Formulation, FoundChain, StageUse, carried_by_momenta};
pub use lift::Lift;
pub use matrix_group::MomentumInSpace;
pub use momenta::momentum_of;
pub use momenta::{CarriedMomentum, Hamiltonian};
pub use part::Part;
pub use reconstruction::ReconstructedCoordinate;
pub use stages::{StageLevel, Stages, Tensor, VerticalKind, VerticalPart};
pub use system::{Block, BlockKind, Circle, Feedback, OwnRate, PositionResidual, ReducedSystem, StateKind};

/// Reduces a model in the formulation that is asked for.
///
/// Left action: `C` are the structure constants and advected parameters obey `adot = -xi . a`. Right action: the sign
/// of every structure constant changes and `adot = xi . a`.
///
/// # Errors
/// Everything inconsistent that is found, at the spans of the model's text.
pub fn reduce(model: &Model, formulation: &Formulation) -> Result<ReducedSystem, Diagnostics> {
    let mut written = chosen(model, formulation);
    written = with_fixed(written, &formulation.fixed)?;
    written = with_held_inputs(written, &formulation.inputs)?;
    let gauge;
    (written, gauge) = quasi_invariance::with_invariant_lagrangian(written, formulation)?;
    written = inertialess::without_inertialess(written, formulation)?;
    let mut system = match lifted(&mut written, formulation)? {
        Some(system) => system,
        None => {
            if let Some(kind) = formulation.connection {
                written = with_connection(&written, kind)?;
            }
            assemble::on_algebroid(written.clone(), formulation)?
        }
    };
    system.gauge = gauge;
    system = with_circles(&written, system, &formulation.circles)?;
    frame::with_stages(system)
        .map_err(|error| written.diagnostics(vec![constraint::refused(&written, &error)]))
}

/// The system with its mechanical connection by the equation that this solves, where nothing else changes velocities.
fn lifted(written: &mut Model, formulation: &Formulation) -> Result<Option<ReducedSystem>, Diagnostics> {
    let Some(lift) = Lift::of(written, formulation) else { return Ok(None) };
    let system = assemble::on_algebroid(written.clone(), formulation)?;
    if system.degeneracy.is_some() {
        return Ok(None);
    }
    let system = lifted::over_lift(system, lift);
    system.map(Some).map_err(|error| written.diagnostics(vec![written.diagnose(&error)]))
}

/// The model with the items that a formulation chooses in the place of its own.
fn chosen(model: &Model, formulation: &Formulation) -> Model {
    let Formulation {
        fixed: _,
        inputs: _,
        connection: _,
        independent,
        multipliers,
        circles: _,
        squares: _,
        recursive: _,
        momenta: _,
        stages,
        chain,
    } = formulation;
    let mut written = model.clone();
    if let Some(chain) = chain {
        written.stages = chain.stages(&mut written.graph, model.stages.as_ref());
    }
    written.stages = written.stages.filter(|_| *stages != StageUse::Unused);
    Model {
        derived_connection: None,
        independent: independent.clone(),
        force_multipliers: *multipliers,
        ..written
    }
}
