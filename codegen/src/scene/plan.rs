//! What a scene asks for.
//!
//! Does not know: which outputs there are, how anything is derived.

use std::collections::BTreeSet;

use hamel_lang::spec::{ConnectionKind, Model, Want, Wanted};
use hamel_mechanics::mechanics::Extent;
use hamel_mechanics::reduction::{Formulation, StageUse, carried_by_momenta};
use hamel_program::lower::SearchBudget;

use super::derivatives::Derivative;
use super::discrete;

/// Name of the scene that every model has.
pub const DEFAULT: &str = "default";

/// Name of the scene without the coordinates that nothing asks for; a model has it when there are such coordinates.
pub const MINIMAL: &str = "minimal";

/// Name of the scene with the coordinates of the group; a model has it when it says how to reconstruct them.
pub const RECONSTRUCTION: &str = Want::Reconstruction.name();

/// Name of the scene that takes all inputs of its model but noises; a model has it when it declares such inputs.
pub const CONTROLLED: &str = "controlled";

/// Name of the scene that takes noises and all other inputs of its model; a model has it when it declares noises.
pub const STOCHASTIC: &str = "stochastic";

/// Name of the scene with all derivatives of the right-hand side; every model has it, built when it is asked for.
pub const DERIVATIVES: &str = "derivatives";

/// What a scene wants that has functions of its invariants and their gradients, and the name of that of the values.
pub const INVARIANTS: &str = Want::Invariants.name();

/// What a scene asks for.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) name: String,
    pub(super) formulation: Formulation,
    pub(super) outputs: Outputs,
    pub(super) energy: bool,
    pub(super) derivatives: BTreeSet<Derivative>,
    pub(super) invariants: bool,
    /// Residuals of the equations between coordinates.
    pub(super) positions: Share,
    /// The rows that a motion keeps independent, where there are any.
    pub(super) ranks: bool,
    /// Rates of geometric and dynamic phases.
    pub(super) phases: bool,
    /// The local form of the connection and its curvature, along so many velocities of the algebra.
    pub(super) connection: Option<usize>,
    /// The matrices of the reduced Dirac structure.
    pub(super) dirac: bool,
    /// The nonholonomic bracket.
    pub(super) bracket: bool,
    /// The time in which the motion is Hamiltonian, in the place of the model's.
    pub(super) hamiltonian_time: bool,
    /// Exact flows whose generators add up to the motion.
    pub(super) splitting: bool,
    pub(super) implicit: bool,
    /// What the discrete equations ask of the model.
    pub(super) discrete: Option<discrete::Asked>,
    /// The map of the model that this one is the quotient of.
    pub(super) quotient: bool,
    /// Mass matrix, inverse dynamics and forces at rest, as far as they are wanted.
    pub(super) dynamics: BTreeSet<Want>,
    /// The wanted functions of frames and bodies.
    pub(super) of_frames: BTreeSet<Want>,
    /// Functions that lose digits carry their rounding errors along.
    pub(super) digits: bool,
    pub(super) taylor: bool,
    pub(super) reconstructs: bool,
    pub(super) drops: Drops,
    /// What the search for the cheapest form of each function may take.
    pub(super) search: SearchBudget,
    pub(super) doc: String,
    /// What a search for a formulation has chosen, for those who read.
    pub(super) chosen: Option<String>,
}

/// Whether a scene has something.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Share {
    None,
    /// Unless the model or the scene lacks what it takes.
    Possible,
    Wanted,
}

/// Outputs of a scene besides energy, derivatives, invariants and positions.
#[derive(Clone, Debug)]
pub(super) enum Outputs {
    All,
    Named(Vec<Wanted>),
}

/// Base coordinates and advected parameters that a scene leaves out.
#[derive(Clone, Debug)]
pub(super) enum Drops {
    Nothing,
    /// All on which nothing depends.
    Ignorable,
    /// These components.
    Components(Vec<String>),
}

/// Equations that a scene asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Asked {
    pub(super) formulation: Formulation,
    pub(super) extent: Extent,
}

impl Asked {
    /// All that there is of a formulation.
    pub(super) fn whole(formulation: Formulation) -> Asked {
        Asked { formulation, extent: Extent::Whole }
    }
}

impl Plan {
    /// The equations that the scene is made from: of a scene that wants the right-hand side alone, no more than its
    /// rates.
    pub(super) fn asked(&self) -> Asked {
        self.asked_and_plain().0
    }

    fn asked_and_plain(&self) -> (Asked, bool) {
        let Plan {
            name: _,
            formulation,
            outputs,
            energy,
            derivatives,
            invariants,
            positions,
            ranks: _,
            phases,
            connection,
            dirac,
            bracket,
            hamiltonian_time,
            splitting,
            implicit,
            discrete,
            quotient,
            dynamics,
            of_frames,
            digits: _,
            taylor: _,
            reconstructs: _,
            drops: _,
            search: _,
            doc: _,
            chosen: _,
        } = self;
        let has_outputs = !matches!(outputs, Outputs::Named(wanted) if wanted.is_empty());
        let wants = [
            *invariants,
            *phases,
            connection.is_some(),
            *dirac,
            *bracket,
            *hamiltonian_time,
            *splitting,
            *implicit,
            *quotient,
            discrete.is_some(),
        ];
        let has_sets = !derivatives.is_empty() || !dynamics.is_empty() || !of_frames.is_empty();
        let is_plain = !(has_sets || *positions != Share::None || wants.contains(&true));
        let extent = if has_outputs || *energy || !is_plain { Extent::Whole } else { Extent::Rates };
        (Asked { formulation: formulation.clone(), extent }, is_plain)
    }

    /// Whether the scene wants nothing but functions that its equations have, apart from rows whose rank a motion may
    /// lose, which few have.
    pub(super) fn is_plain(&self) -> bool {
        self.asked_and_plain().1
    }

    /// The right-hand side alone, in a formulation.
    pub(super) fn bare(name: String, formulation: Formulation) -> Plan {
        Plan {
            name,
            formulation,
            outputs: Outputs::Named(Vec::new()),
            energy: false,
            derivatives: BTreeSet::new(),
            invariants: false,
            positions: Share::None,
            ranks: false,
            phases: false,
            connection: None,
            dirac: false,
            bracket: false,
            hamiltonian_time: false,
            splitting: false,
            implicit: false,
            discrete: None,
            quotient: false,
            dynamics: BTreeSet::new(),
            of_frames: BTreeSet::new(),
            digits: false,
            taylor: false,
            reconstructs: false,
            drops: Drops::Nothing,
            search: SearchBudget::default(),
            doc: String::new(),
            chosen: None,
        }
    }

    /// The plan of a scene that the model has by a block of its own, or that every model has.
    pub(super) fn of(model: &Model, scene: &str) -> Option<Plan> {
        let bare = Plan::bare(scene.to_owned(), Formulation::of(model));
        let bare = Plan { digits: model.wants_digits, ..bare };
        if let Some(own) = model.scenes.iter().find(|s| s.name == scene) {
            let mut plan = Plan { doc: own.doc.clone(), ..bare };
            plan.formulation.fixed.clone_from(&own.fixed);
            plan.formulation.inputs.clone_from(&own.inputs);
            plan.formulation.circles.clone_from(&own.circles);
            plan.discrete = own.discrete.map(|words| discrete::Asked::of(model, words));
            plan.formulation.momenta = carried_by_momenta(model, &own.carries);
            plan.formulation.stages = StageUse::of(model.stages.is_some(), &model.carries, &own.carries);
            if !own.drops.is_empty() {
                plan.drops = Drops::Components(own.drops.clone());
            }
            let mut outputs = Vec::new();
            for wanted in &own.wants {
                match wanted {
                    Wanted::Want(Want::Rhs) => {}
                    Wanted::Want(Want::Energy) => plan.energy = true,
                    Wanted::Want(Want::Reconstruction) => plan.reconstructs = true,
                    Wanted::Want(Want::Taylor) => plan.taylor = true,
                    Wanted::Want(Want::Invariants) => plan.invariants = true,
                    Wanted::Want(Want::Positions) => plan.positions = Share::Wanted,
                    Wanted::Want(Want::Phases) => plan.phases = true,
                    Wanted::Want(Want::Connection) => {
                        plan.connection = Some(model.velocities.len());
                        // Without velocities in the state nothing but the connection depends on it.
                        if model.is_kinematic() && model.connection.is_none() {
                            plan.formulation.connection.get_or_insert(ConnectionKind::Nonholonomic);
                        }
                    }
                    Wanted::Want(Want::Dirac) => plan.dirac = true,
                    Wanted::Want(Want::Bracket) => plan.bracket = true,
                    Wanted::Want(Want::HamiltonianTime) => plan.hamiltonian_time = true,
                    Wanted::Want(Want::Splitting) => plan.splitting = true,
                    Wanted::Want(Want::Linearization) => plan.derivatives.extend(Derivative::LINEARIZATION),
                    Wanted::Want(
                        want @ (Want::MassMatrix | Want::InverseDynamics | Want::Bias | Want::Gravity),
                    ) => _ = plan.dynamics.insert(*want),
                    Wanted::Want(
                        want @ (Want::FrameJacobians
                        | Want::FrameDrifts
                        | Want::OperationalSpace
                        | Want::CenterOfMassJacobian
                        | Want::CentroidalMomentumMatrix),
                    ) => _ = plan.of_frames.insert(*want),
                    Wanted::Want(want @ (Want::CenterOfMass | Want::CentroidalMomentum)) => {
                        plan.of_frames.insert(*want);
                        outputs.push(wanted.clone());
                    }
                    Wanted::Want(Want::Frames) => {
                        outputs.extend([Want::FramePoses, Want::FrameTwists].map(Wanted::Want));
                        plan.of_frames.extend([Want::FrameJacobians, Want::FrameDrifts]);
                    }
                    Wanted::Want(Want::Implicit) => plan.implicit = true,
                    Wanted::Want(Want::Quotient) => plan.quotient = true,
                    Wanted::Want(Want::Digits) => plan.digits = true,
                    Wanted::Want(want) => match Derivative::of(*want) {
                        Some(derivative) => _ = plan.derivatives.insert(derivative),
                        None => outputs.push(wanted.clone()),
                    },
                    Wanted::Own(_) => outputs.push(wanted.clone()),
                }
            }
            plan.outputs = Outputs::Named(outputs);
            return Some(plan);
        }
        let energy = model.given.is_none();
        let everything = Plan { outputs: Outputs::All, energy, ..bare.clone() };
        match scene {
            DEFAULT => Some(everything),
            MINIMAL => {
                let doc = "without the coordinates on which nothing depends".to_owned();
                Some(Plan { energy, drops: Drops::Ignorable, doc, ..bare })
            }
            DERIVATIVES => {
                let doc = "with the derivatives of the right-hand side".to_owned();
                Some(Plan { energy, derivatives: Derivative::OF_MOTION.into(), doc, ..bare })
            }
            CONTROLLED if model.controls().next().is_some() => {
                let mut plan = Plan { doc: "with inputs".to_owned(), ..everything };
                plan.formulation.inputs = model.controls().map(|input| input.name.clone()).collect();
                Some(plan)
            }
            STOCHASTIC if !model.noises.is_empty() => {
                let mut plan = Plan { doc: "with noise".to_owned(), ..everything };
                plan.formulation.inputs = model.inputs.iter().map(|input| input.name.clone()).collect();
                Some(plan)
            }
            RECONSTRUCTION => Some(Plan {
                reconstructs: true,
                doc: "with the coordinates of the group".to_owned(),
                ..everything
            }),
            _ => None,
        }
    }
}
