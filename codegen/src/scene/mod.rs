//! Scenes: what is wanted of a model, what is fixed, and what is left out.
//!
//! [`build`] runs the whole pipeline for one scene, [`Scenes`] for several of one model, whose equations are derived
//! once for each formulation. The default scene fixes nothing and wants every output, `minimal` leaves
//! out coordinates that nothing asks for, `reconstruction` adds those of the group; a `scene` block of the model fixes
//! parameters (folded exactly before the derivation), names the outputs it wants and the coordinates it drops.
//!
//! [`build_pictured`] adds what figures in space show, which no other scene carries.
//!
//! Does not know: how equations are derived, how programs are lowered, how text is emitted.

mod bracket;
mod build;
mod built;
mod bundle;
mod counts;
mod defaults;
mod dependence;
mod dependent;
mod derivatives;
mod derived;
mod discrete;
mod domain;
mod dynamics;
mod events;
mod formulations;
mod frames;
mod gradients;
mod groups;
mod implicit;
mod implied;
mod interpreter;
mod invariants;
pub mod nearest;
mod pivots;
mod places;
mod plan;
mod positions;
mod prior;
mod quotient;
mod ranks;
mod roles;
mod splitting;
mod start;
mod tamper;
mod text;
mod velocities;

use std::collections::BTreeSet;
use std::sync::Arc;

use hamel_expr::error::Error;
use hamel_expr::parallel::side_by_side;
use hamel_lang::spec::{self, Carried, CarriedBy, Diagnostics, Model, Want, Wanted};
use hamel_mechanics::mechanics::{Output, OutputKind};
use hamel_mechanics::reduction::{AccelerationSource, Formulation, KinematicConstraint, StageUse, reduce};
use hamel_program::lower::SearchBudget;

use build::{Derivations, build_planned, lower_scene};
use dependence::{ignorable, left_out, needs};
use plan::{Asked, Drops, Outputs, Plan, Share};

pub use crate::certify::Certificate;
pub use built::BuiltScene;
pub use defaults::{initial_state, warnings};
pub use derivatives::{Derivative, Matrix, Product};
pub use discrete::{Discrete, DiscreteLayout, DiscretePart};
pub use events::SceneEvent;
pub use formulations::{Candidate, Formulations, LeftOut, Progress};
pub use groups::groups;
pub use hamel_program::emit::{CModule, Fmu, WasmModule};
pub use hamel_program::program::Role;
pub use implicit::Implicit;
pub use interpreter::{Executable, Interpreter};
pub use plan::{CONTROLLED, DEFAULT, DERIVATIVES, INVARIANTS, MINIMAL, RECONSTRUCTION, STOCHASTIC};
pub use positions::PositionLayout;
pub use prior::{
    Conditions, InPositions, Origin, Prior, Told, free_coordinates, free_velocities, settle, told_in_words,
};
pub use roles::{VariableRole, all_params, initial_slopes, initial_values, variable_roles};
pub use start::{Start, start};
pub use tamper::{Made, build_tampered};
pub use text::{Language, Writing};
pub use velocities::in_velocities;

/// The scenes of a model; what several of them share is derived once.
///
/// ```
/// use hamel_codegen::{scene::Scenes, spec};
///
/// let text = "model spring { param k = 2; coordinate x in real; lagrangian = 1/2*x_dot^2 - k/2*x^2; }";
/// let model = spec::parse("spring.hamel", text)?;
/// let mut scenes = Scenes::new(&model);
/// let names = scenes.names();
/// let built = scenes.build_all(&names)?;
/// assert_eq!(built.len(), 1);
/// # Ok::<(), spec::Diagnostics>(())
/// ```
#[derive(Debug)]
pub struct Scenes {
    derivations: Derivations,
    /// What every scene has besides what it wants.
    derivatives: Vec<Derivative>,
    positions: bool,
    ranks: bool,
}

impl Scenes {
    /// None of them built.
    pub fn new(model: &Model) -> Scenes {
        Scenes::of(Arc::new(model.clone()))
    }

    /// As [`new`](Self::new), of a model that others share.
    pub fn of(model: Arc<Model>) -> Scenes {
        Scenes {
            derivations: Derivations::new(model),
            derivatives: Vec::new(),
            positions: false,
            ranks: false,
        }
    }

    /// The same with what every scene has in a language besides what it wants: derivatives of the right-hand side,
    /// equations between coordinates, the rows whose rank a motion may lose.
    pub fn for_language(mut self, language: Language) -> Scenes {
        self.derivatives = language.derivatives().to_vec();
        self.positions = language.positions();
        self.ranks = language.ranks();
        self
    }

    /// The same with what [`BuiltScene::emit_fmu`] asks of a scene besides what it wants: equations between
    /// coordinates, where the scene carries these, to which an importer's values are held, and the rows whose rank a
    /// motion may lose.
    pub fn for_fmus(mut self) -> Scenes {
        self.positions = true;
        self.ranks = true;
        self
    }

    /// Names of the scenes that are emitted, the default first; [`DERIVATIVES`] is one only if the model says so.
    ///
    /// Every model has [`DEFAULT`]; [`MINIMAL`] and [`RECONSTRUCTION`] where they differ from it, [`CONTROLLED`] where
    /// it has inputs, [`STOCHASTIC`] where it has noises; then its own, of which one may be the default.
    pub fn names(&mut self) -> Vec<String> {
        names_of(&Arc::clone(&self.derivations.model), || self.has_ignorable_coordinates())
    }

    /// Whether there are coordinates on which neither the rest of the motion nor the energy depends.
    pub fn has_ignorable_coordinates(&mut self) -> bool {
        let formulation = Formulation::of(&self.derivations.model);
        self.derivations.derive_all([Asked::whole(formulation.clone())]);
        let derived = self.derivations.equations(&formulation);
        derived.is_ok_and(|equations| !ignorable(&equations, &[equations.energy]).is_empty())
    }

    /// Whether there is a scene of this name, or could be: see [`has_scene`].
    pub fn has(&mut self, name: &str) -> bool {
        let model = &*Arc::clone(&self.derivations.model);
        let has_minimal = || name == MINIMAL && self.has_ignorable_coordinates();
        name == DERIVATIVES || names_of(model, has_minimal).iter().any(|known| known == name)
    }

    /// Builds one scene.
    ///
    /// # Errors
    /// As [`build`].
    pub fn build(&mut self, scene: &str) -> Result<BuiltScene, Diagnostics> {
        let plan = self.plan(scene)?;
        self.derivations.derive_all([plan.asked()]);
        build_planned(&self.derivations, plan)
    }

    /// Builds several scenes, by their names.
    ///
    /// # Errors
    /// The problems of all of them; what several have in common is reported once.
    pub fn build_all(&mut self, scenes: &[String]) -> Result<Vec<BuiltScene>, Diagnostics> {
        let mut built = Vec::new();
        let mut problems: Vec<spec::Diagnostic> = Vec::new();
        let plans: Vec<Result<Plan, Diagnostics>> = scenes.iter().map(|name| self.plan(name)).collect();
        self.derivations.derive_all(plans.iter().flatten().map(Plan::asked));
        let outcomes = side_by_side(&plans, |plan| build_planned(&self.derivations, plan.clone()?));
        for outcome in outcomes {
            match outcome {
                Ok(scene) => built.push(scene),
                Err(found) => {
                    for problem in &found {
                        if !problems.iter().any(|p| p.span == problem.span && p.message == problem.message) {
                            problems.push(problem.clone());
                        }
                    }
                }
            }
        }
        if problems.is_empty() { Ok(built) } else { Err(self.derivations.model.diagnostics(problems)) }
    }

    /// What a scene asks for, in the formulation that is chosen where it asks for a search.
    fn plan(&mut self, scene: &str) -> Result<Plan, Diagnostics> {
        let plan = self.written_plan(scene)?;
        let own = self.derivations.model.scenes.iter().find(|own| own.name == scene);
        let Some(search) = own.and_then(|own| own.formulation) else { return Ok(plan) };
        Ok(formulations::chosen(&self.derivations.model, plan, search))
    }

    /// What a scene asks for as it is written.
    fn written_plan(&mut self, scene: &str) -> Result<Plan, Diagnostics> {
        let model = &*Arc::clone(&self.derivations.model);
        let plan = Plan::of(model, scene).map(|mut plan| {
            // There are none by inputs where the scene takes none.
            let by_inputs = |d: Derivative| matches!(d, Derivative::InputJacobian | Derivative::Feedthrough);
            let has_inputs = !plan.formulation.inputs.is_empty();
            let added = self.derivatives.iter().copied();
            plan.derivatives.extend(added.filter(|d| has_inputs || !by_inputs(*d)));
            if self.positions && plan.positions == Share::None {
                plan.positions = Share::Possible;
            }
            plan.ranks = self.ranks;
            plan
        });
        plan.ok_or_else(|| {
            let help = format!("scenes: {}", self.names().join(", "));
            let message = format!("{} has no scene {scene}", model.name);
            model.diagnostics(vec![spec::diagnose(model, None, message, help)])
        })
    }
}

/// As [`Scenes::names`], with the one answer that takes a derivation, [`Scenes::has_ignorable_coordinates`], from
/// elsewhere.
pub fn names_of(model: &Model, has_ignorable_coordinates: impl FnOnce() -> bool) -> Vec<String> {
    let mut names = vec![DEFAULT.to_owned()];
    let own = |name: &str| model.scenes.iter().any(|s| s.name == name);
    if !own(MINIMAL) && has_ignorable_coordinates() {
        names.push(MINIMAL.to_owned());
    }
    if !own(RECONSTRUCTION) && !reconstructed(model).is_empty() {
        names.push(RECONSTRUCTION.to_owned());
    }
    if !own(CONTROLLED) && model.controls().next().is_some() {
        names.push(CONTROLLED.to_owned());
    }
    if !own(STOCHASTIC) && !model.noises.is_empty() {
        names.push(STOCHASTIC.to_owned());
    }
    names.extend(model.scenes.iter().map(|s| s.name.clone()).filter(|name| name != DEFAULT));
    names
}

/// Names of a model's scenes that are emitted: see [`Scenes::names`].
pub fn names(model: &Model) -> Vec<String> {
    Scenes::new(model).names()
}

/// Whether a model has a scene, or could have it: see [`Scenes::names`], and [`DERIVATIVES`]. Derives the model only
/// where the answer takes that, for [`MINIMAL`].
pub fn has_scene(model: &Model, name: &str) -> bool {
    Scenes::new(model).has(name)
}

/// Names of the coordinates that the scene [`RECONSTRUCTION`] adds to the state, in its order: those of the group, and
/// cyclic ones whose momenta are parameters. Empty where nothing is reconstructed.
pub fn reconstructed(model: &Model) -> Vec<String> {
    let formulation = Plan::of(model, RECONSTRUCTION).map(|plan| plan.formulation);
    formulation.unwrap_or_else(|| Formulation::of(model)).reconstructed(model)
}

/// Whether a state of the model can violate a constraint: whether it has residuals, the output [`Want::Constraint`].
///
/// # Errors
/// What reduction can find.
pub fn has_residuals(model: &Model) -> Result<bool, Diagnostics> {
    if model.constraints.iter().any(|c| c.position.is_some()) {
        return Ok(true);
    }
    let KinematicConstraint::Multipliers { rows, .. } = reduce(model, &Formulation::of(model))?.constraint
    else {
        return Ok(false);
    };
    Ok(rows.iter().any(|row| matches!(row.source, AccelerationSource::Differentiated(_))))
}

/// Builds one scene of a model.
///
/// ```
/// use hamel_codegen::scene::Role;
/// use hamel_codegen::{scene, spec};
///
/// let text = "model top {
///     param I: diagonal(3) = [2, 1.5, 0.8] where I1 > 0, I2 > 0, I3 > 0;
///     velocity Omega in so(3);
///     lagrangian = 1/2*dot(Omega, I*Omega);
///     scene ball { fix I = [1, 1, 1]; want rhs; }
/// }";
/// let model = spec::parse("top.hamel", text)?;
/// let ball = scene::build(&model, "ball")?;
/// let rhs = ball.program().function(&Role::Rate).unwrap();
/// assert_eq!(rhs.counts().total(), 0);
/// # Ok::<(), spec::Diagnostics>(())
/// ```
///
/// # Errors
/// Unknown scene or output, a coordinate that cannot be left out, and everything that reduction, derivation and
/// lowering can find.
pub fn build(model: &Model, scene: &str) -> Result<BuiltScene, Diagnostics> {
    Scenes::new(model).build(scene)
}

/// Builds a scene in another formulation than its own.
///
/// # Errors
/// As [`build`]; what the formulation chooses may not exist for the model.
pub fn build_in(model: &Model, scene: &str, formulation: &Formulation) -> Result<BuiltScene, Diagnostics> {
    let mut scenes = Scenes::new(model);
    let plan = Plan { formulation: formulation.clone(), ..scenes.written_plan(scene)? };
    build_planned(&scenes.derivations, plan)
}

/// Builds a scene with other limits on the searches of lowering, and another number of products from which on they
/// become loops over tables.
///
/// # Errors
/// As [`build`].
pub fn build_within(model: &Model, scene: &str, search: SearchBudget) -> Result<BuiltScene, Diagnostics> {
    let mut scenes = Scenes::new(model);
    let plan = Plan { search, ..scenes.plan(scene)? };
    build_planned(&scenes.derivations, plan)
}

/// The right-hand side of a scene whose state carries these momenta (names of components) and no others, with the
/// velocities that they stand for as outputs: both ways between velocities and momenta, whatever the scene itself
/// carries. Momenta that are parameters stay parameters. `levels`: what the scene carries by names that the model does
/// not have, along the levels of stages or chosen by a search, stays in the state too.
///
/// # Errors
/// As [`build`], and a name that is no momentum.
pub fn build_carrying(
    model: &Model,
    scene: &str,
    momenta: &[String],
    levels: bool,
) -> Result<BuiltScene, Diagnostics> {
    let mut scenes = Scenes::new(model);
    let own = scenes.plan(scene)?;
    let mut formulation = own.formulation.clone();
    let is_named =
        |name: &String| model.momenta.iter().flat_map(|m| &m.components).any(|(own, ..)| own == name);
    formulation.momenta.retain(|carried| match &carried.by {
        CarriedBy::Momentum(name) => levels && !is_named(name),
        by => matches!(by, CarriedBy::Parameter(_)),
    });
    if formulation.stages.is_carried() && !levels {
        formulation.stages = StageUse::Shown;
    }
    for name in momenta {
        let components = model.momenta.iter().flat_map(|m| &m.components);
        let Some((.., velocity)) = components.clone().find(|(component, ..)| component == name) else {
            let known: Vec<&str> = components.map(|(component, ..)| component.as_str()).collect();
            let message = format!("{} has no momentum {name}", model.name);
            let help = format!("momenta: {}", known.join(", "));
            return Err(model.diagnostics(vec![spec::diagnose(model, None, message, help)]));
        };
        formulation.momenta.push(Carried { velocity: *velocity, by: CarriedBy::Momentum(name.clone()) });
    }
    formulation.momenta.sort_by_key(|carried| carried.velocity);
    let bare = Plan::bare(own.name.clone(), formulation);
    let outputs = Outputs::Named(vec![Wanted::Want(Want::Velocities)]);
    let plan = Plan { outputs, drops: own.drops, ..bare };
    scenes.derivations.derive_all([plan.asked()]);
    build_planned(&scenes.derivations, plan)
}

/// The formulations of a scene that are proved to be its motion, with what they cost: see [`Formulations`].
///
/// ```
/// use hamel_codegen::{scene, spec};
///
/// let text = "model cart {
///     coordinate x in real;
///     velocity v in R^1;
///     lagrangian = 1/2*x_dot^2*(2 + x^2) + v*x_dot*x + v^2;
/// }";
/// let model = spec::parse("cart.hamel", text)?;
/// let found = scene::formulations(&model, scene::DEFAULT, &|_, _| {})?;
/// assert!(found.best(false).counts.cost() <= found.own().counts.cost());
/// # Ok::<(), spec::Diagnostics>(())
/// ```
///
/// # Errors
/// As [`build`].
pub fn formulations(
    model: &Model,
    scene: &str,
    progress: formulations::Progress<'_>,
) -> Result<Formulations, Diagnostics> {
    let plan = Scenes::new(model).written_plan(scene)?;
    formulations::search(model, &plan, false, progress)
}

/// Name of the output with the numbers of a view, see [`spec::View::numbers`]; no output of a model has such a name.
pub fn view_output(view: &str) -> String {
    format!("view {view}")
}

/// Builds a scene with everything that a report shows: the parameters that `scene` fixes, every coordinate, those of
/// the group when the model reconstructs them, every output, and the views in space, each as the output
/// [`view_output`].
///
/// # Errors
/// As [`build`].
pub fn build_pictured(model: &Model, scene: &str) -> Result<BuiltScene, Diagnostics> {
    let mut pictured = model.clone();
    let is_in_space = |view: &&spec::View| !matches!(view.shape, spec::ViewShape::Field { .. });
    for view in model.views.list.iter().filter(is_in_space) {
        let numbers = pictured.graph.import(&model.views.graph, &view.numbers());
        let within = pictured.graph.within_budget();
        within
            .map_err(|e| model.diagnostics(vec![spec::diagnose(model, view.span, e.message(), e.help())]))?;
        let numbers = numbers.map_err(|_| {
            let message = format!("view {} divides by zero", view.name);
            model.diagnostics(vec![spec::diagnose(model, view.span, message, "")])
        })?;
        let name = view_output(&view.name);
        let components = numbers.into_iter().enumerate().map(|(k, e)| (format!("{name} {k}"), e)).collect();
        let (doc, part) = (view.doc.clone(), spec::OutputPart::Own);
        pictured.outputs.push(spec::NamedVector { name, components, doc, part });
    }
    let mut scenes = Scenes::new(&pictured);
    let plan = scenes.plan(scene)?;
    let (outputs, reconstructs) = (Outputs::All, !plan.formulation.reconstructed(model).is_empty());
    let plan = Plan {
        outputs,
        energy: true,
        derivatives: BTreeSet::new(),
        drops: Drops::Nothing,
        reconstructs,
        quotient: false,
        ..plan
    };
    build_planned(&scenes.derivations, plan)
}

/// Whether a scene has the events of its model: it wants them, or all outputs.
pub fn has_events(model: &Model, scene: &str) -> bool {
    let wants = |plan: Plan| match plan.outputs {
        Outputs::All => true,
        Outputs::Named(wants) => wants.contains(&Wanted::Want(Want::Events)),
    };
    !model.events.is_empty() && Plan::of(model, scene).is_some_and(wants)
}

/// Builds the right-hand side of a scene and the events of the model, whether or not the scene wants them, in its
/// state.
///
/// # Errors
/// As [`build`]; [`Error::EventSets`] as a problem where the state does not carry what an event sets.
pub fn build_events(model: &Model, scene: &str) -> Result<BuiltScene, Diagnostics> {
    let mut scenes = Scenes::new(model);
    let own = scenes.plan(scene)?;
    let outputs = Outputs::Named(vec![Wanted::Want(Want::Events)]);
    let bare = Plan::bare(own.name.clone(), own.formulation.clone());
    let plan = Plan { outputs, drops: own.drops, reconstructs: own.reconstructs, ..bare };
    scenes.derivations.derive_all([plan.asked()]);
    build_planned(&scenes.derivations, plan)
}

/// Builds the right-hand side of a scene, in its state and with its inputs, and its linearization: the derivatives of
/// [`Derivative::LINEARIZATION`], whether or not the scene wants them.
///
/// # Errors
/// As [`build`].
pub fn build_linearized(model: &Model, scene: &str) -> Result<BuiltScene, Diagnostics> {
    let mut scenes = Scenes::new(model);
    let own = scenes.plan(scene)?;
    let bare = Plan::bare(own.name.clone(), own.formulation.clone());
    let derivatives = Derivative::LINEARIZATION.into();
    let (drops, reconstructs, hamiltonian_time) = (own.drops, own.reconstructs, own.hamiltonian_time);
    let plan = Plan { derivatives, drops, reconstructs, hamiltonian_time, ..bare };
    scenes.derivations.derive_all([plan.asked()]);
    build_planned(&scenes.derivations, plan)
}

impl BuiltScene {
    /// The scene with the same parameters and state that wants the right-hand side and the invariants.
    ///
    /// # Errors
    /// [`Error::NothingConserved`], and what lowering can find.
    pub fn with_invariants(&self) -> Result<BuiltScene, Error> {
        let plan = Plan { invariants: true, ..self.bare_plan() };
        self.beside(&plan, Vec::new())
    }

    /// The scene with the same parameters and state that wants the right-hand side and products of its transposed
    /// Jacobian ([`Derivative::Vjp`]).
    ///
    /// # Errors
    /// What lowering can find.
    pub fn with_vjp(&self) -> Result<BuiltScene, Error> {
        let plan = Plan { derivatives: [Derivative::Vjp].into(), ..self.bare_plan() };
        self.beside(&plan, Vec::new())
    }

    /// The scene with the same parameters and state that wants the right-hand side and the residuals of the equations
    /// between coordinates.
    ///
    /// # Errors
    /// [`Error::NoPositions`], and what lowering can find.
    pub fn with_positions(&self) -> Result<BuiltScene, Error> {
        let plan = Plan { positions: Share::Wanted, ..self.bare_plan() };
        self.beside(&plan, Vec::new())
    }

    /// Whether a state of the scene can violate the equations between coordinates: not where there are none, or where
    /// each gives a coordinate that the scene leaves out.
    pub fn is_restricted(&self) -> bool {
        positions::restrict(&self.equations, &self.state)
    }

    /// The scene with the same parameters and state that wants the right-hand side and its exact flows.
    ///
    /// # Errors
    /// [`Error::NoSplitting`], and what lowering can find.
    pub fn with_splitting(&self) -> Result<BuiltScene, Error> {
        let plan = Plan { splitting: true, ..self.bare_plan() };
        self.beside(&plan, Vec::new())
    }

    /// The scene with the same parameters and state that has, besides the right-hand side, the residuals of the
    /// constraints that a state can violate ([`Want::Constraint`]) and the momenta ([`Want::Momentum`]).
    ///
    /// None if there are no such constraints, or if they depend on a coordinate that this scene leaves out; momenta
    /// that do are missing.
    ///
    /// # Errors
    /// What lowering can find.
    pub fn with_residuals(&self) -> Result<Option<BuiltScene>, Error> {
        let residuals = OutputKind::Group(Want::Constraint);
        // Equations have these whatever a scene asks for: without them nothing else is derived.
        if self.equations.outputs.iter().all(|o| o.kind != residuals) {
            return Ok(None);
        }
        let whole = self.whole()?;
        let graph = &whole.equations.system.graph;
        let left_out = left_out(&whole.equations, &whole.state);
        let group = |want: Want| {
            let found = whole.equations.outputs.iter().find(|o| o.kind == OutputKind::Group(want))?;
            let is_known =
                found.components.iter().all(|(_, e)| !needs(graph, &whole.equations, *e, &left_out));
            is_known.then(|| found.clone())
        };
        let Some(residuals) = group(Want::Constraint) else { return Ok(None) };
        let outputs = [residuals].into_iter().chain(group(Want::Momentum)).collect();
        whole.beside(&self.bare_plan(), outputs).map(Some)
    }

    /// Another scene in the same state, held to the same model.
    fn beside(&self, plan: &Plan, outputs: Vec<Output>) -> Result<BuiltScene, Error> {
        let whole = self.whole()?;
        let built =
            lower_scene(whole.equations.clone().into(), plan, whole.state.clone(), (outputs, None, None))?;
        match &self.model {
            Some(model) => built.certified(Arc::clone(model)),
            None => Ok(built),
        }
    }

    /// The right-hand side of this scene alone, in its time.
    fn bare_plan(&self) -> Plan {
        let hamiltonian_time =
            self.outputs.iter().any(|o| o.kind == OutputKind::Group(Want::HamiltonianTime));
        let bare = Plan::bare(self.name.clone(), self.equations.system.formulation.clone());
        Plan { hamiltonian_time, ..bare }
    }
}
