//! A scene after the whole pipeline.
//!
//! Does not know: how it came about, what is made of it.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::sync::Arc;

use crate::certify::Certificate;
use hamel_expr::error::Error;
use hamel_expr::{Budget, SymbolId};
use hamel_lang::spec::{Model, Param, Want};
use hamel_mechanics::mechanics::{Equations, Legendre, Output, OutputKind, StateEquation, derive};
use hamel_program::program::{Program, Role};

use super::dependence::{left_out, outputs_of_model};
use super::derivatives::{Matrix, Product};
use super::discrete::Discrete;
use super::events::SceneEvent;
use super::frames;
use super::implicit::Implicit;
use super::positions::PositionLayout;
use super::ranks::RankLayout;

/// A scene after the whole pipeline: its equations and its program.
#[derive(Clone, Debug)]
pub struct BuiltScene {
    pub(crate) name: String,
    pub(crate) equations: Arc<Equations>,
    pub(crate) program: Program,
    pub(crate) state: Vec<StateEquation>,
    pub(super) outputs: Vec<Output>,
    pub(super) matrices: Vec<Matrix>,
    pub(super) products: Vec<Product>,
    pub(super) implicit: Option<Implicit>,
    pub(super) discrete: Option<Discrete>,
    pub(super) positions: Option<PositionLayout>,
    pub(super) ranks: Option<RankLayout>,
    /// The system that the model is the quotient of, where the scene wants the map.
    pub(super) total: Option<Arc<TotalSystem>>,
    pub(super) flows: Vec<Vec<String>>,
    pub(super) events: Vec<SceneEvent>,
    /// Whether the emitted module has the Taylor coefficients of solutions.
    pub(super) wants_taylor: bool,
    pub(super) doc: String,
    /// What a search for a formulation has chosen.
    pub(super) chosen: Option<String>,
    pub(super) spent: Budget,
    pub(super) is_in_hamiltonian_time: bool,
    /// The model, where the scene was held to it.
    pub(super) model: Option<Arc<Model>>,
    pub(super) certificate: Certificate,
}

/// The system that a model is the quotient of: its rates, and as an output the images of variables and parameters of
/// the quotient, by their names.
#[derive(Clone, Debug)]
pub(crate) struct TotalSystem {
    /// The file that the quotient names.
    pub(crate) file: String,
    /// The scene, held to its own model.
    pub(crate) scene: BuiltScene,
}

impl TotalSystem {
    /// Names of the components of the total state, and of the total parameters.
    pub(super) fn variables(&self) -> [&[String]; 2] {
        [&self.scene.program.state, &self.scene.program.params]
    }
}

/// Name of the function from velocities to the momenta that a state carries.
const LEGENDRE: &str = "legendre";

/// The role of that function, which takes the velocities besides time and state.
pub(super) fn legendre_role() -> Role {
    Role::Product(LEGENDRE.to_owned())
}

impl BuiltScene {
    /// The scene with all that there is of its equations: one that wants its rates alone is made without the rest.
    ///
    /// # Errors
    /// As [`derive`](hamel_mechanics::mechanics::derive).
    pub(crate) fn whole(&self) -> Result<Cow<'_, BuiltScene>, Error> {
        if self.equations.is_whole() {
            return Ok(Cow::Borrowed(self));
        }
        let equations = Arc::new(derive(&self.equations.system)?);
        let state = self.state.iter().map(|s| {
            let all = equations.state.iter().chain(&equations.reconstruction);
            all.into_iter().find(|own| own.symbol == s.symbol).unwrap_or(s).clone()
        });
        Ok(Cow::Owned(BuiltScene { state: state.collect(), equations, ..self.clone() }))
    }

    /// Name of the scene.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The equations of motion, as far as the scene asks for them: [`Equations::is_whole`].
    pub fn equations(&self) -> &Arc<Equations> {
        &self.equations
    }

    /// What was lowered: the rates, the energy (when wanted), the pivots, one function for each output and each
    /// product, then the domain where there is one; see [`Role`].
    pub fn program(&self) -> &Program {
        &self.program
    }

    /// The program alone.
    pub fn into_program(self) -> Program {
        self.program
    }

    /// The state of this scene: that of the model without what is left out, with what is reconstructed; the derivatives
    /// are those by the time of the model.
    pub fn state(&self) -> &[StateEquation] {
        &self.state
    }

    /// Names of the state variables in order.
    pub fn state_names(&self) -> Vec<String> {
        self.state.iter().map(|s| s.name.clone()).collect()
    }

    /// Coordinates of the base and the group that are no part of the state.
    pub(crate) fn left_out(&self) -> BTreeSet<SymbolId> {
        left_out(&self.equations, &self.state)
    }

    /// Parameters that the scene leaves free.
    pub fn params(&self) -> &[Param] {
        &self.equations.system.params
    }

    /// Outputs of the scene, besides the right-hand side and the energy.
    pub fn outputs(&self) -> &[Output] {
        &self.outputs
    }

    /// Names of the outputs of the model that a linearization observes: the rows of its matrices `C` and `D`.
    pub fn observed(&self) -> Vec<String> {
        let observed = outputs_of_model(&self.equations, &self.state);
        observed.into_iter().map(|(name, _)| name).collect()
    }

    /// Inputs that the scene takes, with the values that they are held at.
    pub fn inputs(&self) -> &[Param] {
        &self.equations.system.inputs
    }

    /// Derivatives that are matrices; their entries are outputs.
    pub fn matrices(&self) -> &[Matrix] {
        &self.matrices
    }

    /// Derivatives that are products with a vector.
    pub fn products(&self) -> &[Product] {
        &self.products
    }

    /// The implicit form, where the scene wants it.
    pub fn implicit(&self) -> Option<&Implicit> {
        self.implicit.as_ref()
    }

    /// The discrete equations, where the scene has them.
    pub fn discrete(&self) -> Option<&Discrete> {
        self.discrete.as_ref()
    }

    /// How the equations between coordinates are solved, where the scene wants them.
    pub fn positions(&self) -> Option<&PositionLayout> {
        self.positions.as_ref()
    }

    /// The exact flows that the scene has, each by the linear forms of the state that its part of the Hamiltonian is a
    /// function of; none unless the scene wants them.
    pub fn flows(&self) -> &[Vec<String>] {
        &self.flows
    }

    /// The events that the scene has, in the order of its output `events`.
    pub fn events(&self) -> &[SceneEvent] {
        &self.events
    }

    /// The momenta that the state carries as functions of velocities; empty where it carries none.
    pub fn legendre(&self) -> &Legendre {
        &self.equations.legendre
    }

    /// Whether the scene computes the energy.
    pub fn has_energy(&self) -> bool {
        self.program.function(&Role::Energy).is_some()
    }

    /// What it took of the model's budget, from the text to the program.
    pub fn spent(&self) -> Budget {
        self.spent
    }

    /// Which functions were held to their definitions, and at how many points.
    pub fn certificate(&self) -> &Certificate {
        &self.certificate
    }

    /// Holds the scene to its definition once more, at as many points as asked for.
    ///
    /// # Errors
    /// [`Error::Disagrees`](hamel_expr::error::Error::Disagrees).
    pub fn certify(&self, n_points: usize) -> Result<Certificate, Error> {
        match &self.model {
            Some(model) => self.held_to(model, n_points),
            None => Ok(self.certificate.clone()),
        }
    }

    /// Documentation of the scene.
    pub fn doc(&self) -> &str {
        &self.doc
    }

    /// Names of the inputs that are white noise.
    pub fn noise_names(&self) -> Vec<String> {
        let system = &self.equations.system;
        system.noises.iter().map(|noise| system.graph.name(*noise).to_owned()).collect()
    }

    /// Names of the frames of the model, in the order of their poses and twists.
    pub fn frame_names(&self) -> Vec<String> {
        frames::names(&self.equations)
    }

    /// Names of the invariants that the scene wants; none if it wants none.
    pub fn invariant_names(&self) -> Option<Vec<String>> {
        let output = self.outputs.iter().find(|o| o.kind == OutputKind::Group(Want::Invariants))?;
        Some(output.components.iter().map(|(name, _)| name.clone()).collect())
    }
}
