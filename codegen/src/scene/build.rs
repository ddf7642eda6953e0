//! One scene through the whole pipeline.
//!
//! Does not know: how equations are derived, how programs are lowered.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::certify::{Certificate, Claim, DiscreteClaim, MatrixClaim, N_POINTS, certify, certify_quotient};
use hamel_expr::error::Error;
use hamel_expr::parallel::side_by_side;
use hamel_expr::{Budget, ExprId, Stage, SymbolId, Trials, needed_sections, rational_to_f64, trace};
use hamel_lang::spec::{self, Diagnostics, Model, Param, Want, Wanted};
use hamel_mechanics::mechanics::{
    EXPANDED, Equations, Extent, LABORIOUS, Output, OutputKind, StateEquation, derive, derive_to,
    is_recursive, operations_of_factors, operations_of_motion,
};
use hamel_mechanics::reduction::{Formulation, ReducedSystem, reduce};
use hamel_program::lower::{self, Inputs, Request, Sampling, SearchBudget, VariableKind};
use hamel_program::program::Role;

use super::built::{BuiltScene, TotalSystem, legendre_role};
use super::bundle;
use super::dependence::{ignorable, needs, outputs_of_model};
use super::derived::{Derived, Guards, inputs_of, rates_of};
use super::plan::{Asked, DEFAULT, Drops, Outputs, Plan, Share};
use super::quotient;
use super::roles::{VariableRole, all_params, variable_roles};
use super::splitting;
use super::{
    bracket, derivatives, discrete, dynamics, events, frames, implicit, invariants, positions, ranks,
};

/// Equations of one model in the formulations that its scenes ask for, each derived once.
#[derive(Debug)]
pub(super) struct Derivations {
    pub(super) model: Arc<Model>,
    done: Vec<(Asked, Result<Derived, Diagnostics>)>,
}

impl Derivations {
    pub(super) fn new(model: Arc<Model>) -> Derivations {
        Derivations { model, done: Vec::new() }
    }

    /// Derives the equations that several scenes ask for, side by side, unless they are there.
    pub(super) fn derive_all(&mut self, asked: impl IntoIterator<Item = Asked>) {
        let mut missing: Vec<Asked> = Vec::new();
        for asked in asked {
            if !self.done.iter().map(|(known, _)| known).chain(&missing).any(|known| *known == asked) {
                missing.push(asked);
            }
        }
        let derived = side_by_side(&missing, |asked| self.derived(asked));
        self.done.extend(missing.into_iter().zip(derived));
    }

    /// All equations in a formulation.
    pub(super) fn equations(&self, formulation: &Formulation) -> Result<Arc<Equations>, Diagnostics> {
        self.derivation(&Asked::whole(formulation.clone())).map(|derived| derived.equations)
    }

    fn derivation(&self, asked: &Asked) -> Result<Derived, Diagnostics> {
        match self.done.iter().find(|(other, _)| other == asked) {
            Some((_, known)) => known.clone(),
            None => self.derived(asked),
        }
    }

    fn derived(&self, Asked { formulation, extent }: &Asked) -> Result<Derived, Diagnostics> {
        let model = &*self.model;
        let system = reduce(model, formulation)?;
        let is_open = formulation.squares && formulation.recursive.is_none();
        let is_tried = is_open && is_recursive(&system);
        let found = if is_tried { cheaper_by_recursion(model, &system, *extent) } else { None };
        if let Some(found) = found {
            return Ok(found);
        }
        let derived = derive_to(&system, *extent).map(|equations| Derived::from(Arc::new(equations)));
        derived.map_err(|e| model.diagnostics(vec![model.diagnose(&e)]))
    }
}

/// The equations by recursion or multiplied out, whichever right-hand side costs less; none where those by recursion
/// cannot be derived.
fn cheaper_by_recursion(model: &Model, system: &ReducedSystem, extent: Extent) -> Option<Derived> {
    let lowered = |equations: Equations, formulation: &Formulation| {
        let plan = Plan::bare(DEFAULT.to_owned(), formulation.clone());
        let mut derived = Derived::from(Arc::new(equations));
        derived.by_cost = true;
        let built = build_derived(model, derived.clone(), &plan).ok()?;
        let cost = built.program.function(&Role::Rate)?.counts().cost();
        Some((cost, built.spent, derived))
    };
    let in_form = |recursive: bool| {
        let formulation = Formulation { recursive: Some(recursive), ..system.formulation.clone() };
        ReducedSystem { formulation, ..system.clone() }
    };
    let own = system.graph.budget();
    let by_recursion = in_form(true);
    let equations = derive_to(&by_recursion, extent).ok()?;
    let n_by_recursion = equations.n_operations();
    let (reduced, derived) = (system.graph.spent().work, equations.system.graph.spent().work);
    let (cost, spent, by_recursion) = lowered(equations, &by_recursion.formulation)?;
    let mut trials = Trials::new(&());
    trials.attempt(&mut (), 0, |()| Some((cost, by_recursion)));
    let most = EXPANDED * n_by_recursion;
    if operations_of_factors(system) > most {
        return trials.finish(&mut ());
    }
    // What takes more than recursion took does not cost less; searches stop at half of the work.
    let least = |own: u64, spent: u64| own.min(spent.saturating_mul(2));
    let least = Budget {
        expressions: least(own.expressions, spent.expressions),
        bytes: least(own.bytes, spent.bytes),
        work: least(own.work, spent.work),
    };
    let mut expanded = in_form(false);
    // Before any search, what the derivation took tells.
    let work = least.work.min(reduced + LABORIOUS * (derived - reduced));
    expanded.graph.set_budget(Budget { work, ..least });
    let n_expanded = operations_of_motion(&expanded);
    if !n_expanded.is_ok_and(|n| n <= most) {
        return trials.finish(&mut ());
    }
    expanded.graph.set_budget(least);
    trials.attempt(&mut (), 0, |()| {
        let (cost, _, mut derived) = lowered(derive(&expanded).ok()?, &expanded.formulation)?;
        Arc::make_mut(&mut derived.equations).system.graph.set_budget(own);
        Some((cost, derived))
    });
    trials.finish(&mut ())
}

/// Builds a scene by its plan; problems without a place of their own are at the scene.
pub(super) fn build_planned(derivations: &Derivations, plan: Plan) -> Result<BuiltScene, Diagnostics> {
    let model = &*derivations.model;
    let scene = plan.name.clone();
    let built = build_scene(derivations, plan).and_then(|built| {
        let certified = built.certified(Arc::clone(&derivations.model));
        certified.map_err(|e| model.diagnostics(vec![model.diagnose(&e)]))
    });
    built.map_err(|problems| {
        let Some(own) = model.scenes.iter().find(|s| s.name == scene) else { return problems };
        let located = problems.iter().map(|problem| {
            if problem.span.is_none() {
                return spec::Diagnostic { span: own.span, ..problem.clone() };
            }
            // Fixed parameters may be what is wrong.
            let is_about_fixing =
                !own.fixed.is_empty() && !own.places.values().any(|s| Some(*s) == problem.span);
            problem.clone().with_place(own.span.filter(|_| is_about_fixing), "in this scene")
        });
        model.diagnostics(located.collect())
    })
}

fn build_scene(derivations: &Derivations, plan: Plan) -> Result<BuiltScene, Diagnostics> {
    let model = &*derivations.model;
    let own = model.scenes.iter().find(|s| s.name == plan.name);
    let place_of = |name: &str| own.and_then(|s| s.places.get(name).copied());
    let fail_at = |span: Option<spec::Span>, message: String, help: String| {
        model.diagnostics(vec![spec::diagnose(model, span, message, help)])
    };
    if plan.reconstructs && plan.formulation.reconstructed(model).is_empty() {
        let help = "say how the group moves with `reconstruct .. in ..;`".to_owned();
        let message = format!("{} has nothing to reconstruct in this formulation", model.name);
        return Err(fail_at(place_of(Want::Reconstruction.name()), message, help));
    }
    let derived = derivations.derivation(&plan.asked()).map_err(|problems| {
        let on_lines = Formulation { circles: Vec::new(), ..plan.formulation.clone() };
        if plan.formulation.circles.is_empty() || reduce(model, &on_lines).is_err() {
            return problems;
        }
        // At the angle in the scene where the model has no text for the place itself.
        let here = plan.formulation.circles.iter().find_map(|angle| place_of(angle));
        let located = problems.iter().map(|problem| match problem.span {
            None => spec::Diagnostic { span: here, ..problem.clone() },
            Some(_) => problem.clone().with_place(here, "on the circle in this scene"),
        });
        model.diagnostics(located.collect())
    })?;
    build_derived(model, derived, &plan)
}

/// Selects what a scene wants of its equations, and lowers them.
pub(super) fn build_derived(
    model: &Model,
    derived: impl Into<Derived>,
    plan: &Plan,
) -> Result<BuiltScene, Diagnostics> {
    let derived = derived.into();
    let equations = Arc::clone(&derived.equations);
    let scene = plan.name.as_str();
    let own = model.scenes.iter().find(|s| s.name == scene);
    let place_of = |name: &str| own.and_then(|s| s.places.get(name).copied());
    let fail_at = |span: Option<spec::Span>, message: String, help: String| {
        model.diagnostics(vec![spec::diagnose(model, span, message, help)])
    };
    let available = available_outputs(&equations);
    if let Some((want, message, help)) = frames::missing(&available, &plan.of_frames) {
        let message = format!("scene {scene} wants {}, and {} has {message}", want.name(), model.name);
        let place = place_of(want.name()).or_else(|| place_of(Want::Frames.name()));
        return Err(fail_at(place, message, help.to_owned()));
    }
    let outputs = match &plan.outputs {
        // Frames and bodies are for those who ask.
        Outputs::All => available.into_iter().filter(|o| !frames::is_asked_for(o)).collect(),
        Outputs::Named(wants) => {
            let mut selected = Vec::new();
            for wanted in wants {
                let found = wanted_outputs(&available, wanted);
                if found.is_empty() {
                    let known: Vec<&str> = available.iter().map(|o| o.name.as_str()).collect();
                    let want = wanted.name();
                    return Err(fail_at(
                        place_of(want),
                        format!("scene {scene} wants {want}, which {} does not have", model.name),
                        format!("outputs: rhs, energy, {}", known.join(", ")),
                    ));
                }
                selected.extend(found);
            }
            selected
        }
    };
    let in_space = frames::needs_group(&equations, &outputs, &plan.of_frames);
    if let Some((want, help)) = in_space.filter(|_| !plan.reconstructs) {
        let place = place_of(want.name()).or_else(|| place_of(Want::Frames.name()));
        let message = format!("scene {scene} wants {}, and its state has no group", want.name());
        return Err(fail_at(place, message, help.to_owned()));
    }
    let mut results: Vec<ExprId> =
        outputs.iter().flat_map(|o| o.components.iter().map(|(_, e)| *e)).collect();
    results.extend(plan.energy.then_some(equations.energy));
    if plan.reconstructs {
        results.extend(equations.reconstruction.iter().map(|c| c.derivative));
    }
    let ignorable = ignorable(&equations, &results);
    let dropped = match &plan.drops {
        Drops::Nothing => Vec::new(),
        Drops::Ignorable => ignorable,
        Drops::Components(names) => {
            let chosen: Vec<String> =
                equations.state.iter().map(|s| s.name.clone()).filter(|name| names.contains(name)).collect();
            if let Some(needed) = chosen.iter().find(|name| !ignorable.contains(name)) {
                let help = if ignorable.is_empty() {
                    "every coordinate is needed".to_owned()
                } else {
                    format!("can be left out: {}", ignorable.join(", "))
                };
                return Err(fail_at(
                    place_of(needed),
                    format!("{needed} cannot be left out of scene {scene}: the rest depends on it"),
                    help,
                ));
            }
            // What can be left out together may need each other.
            for state in equations.state.iter().filter(|s| chosen.contains(&s.name)) {
                let symbol = BTreeSet::from([state.symbol]);
                let mut kept = equations.state.iter().filter(|s| !chosen.contains(&s.name));
                let graph = &equations.system.graph;
                if let Some(other) = kept.find(|s| needs(graph, &equations, s.derivative, &symbol)) {
                    let (name, other) = (&state.name, &other.name);
                    return Err(fail_at(
                        place_of(name),
                        format!("{name} cannot be left out of scene {scene}: {other} depends on it"),
                        format!("leave {other} out as well"),
                    ));
                }
            }
            chosen
        }
    };
    let mut state = equations.state.clone();
    state.retain(|s| !dropped.contains(&s.name));
    if plan.reconstructs {
        state.extend(equations.reconstruction.iter().cloned());
    }
    let sampling = sampling(model, plan, (&equations, &state));
    let total = if plan.quotient { Some(Arc::new(total_system(model)?)) } else { None };
    lower_scene(derived, plan, state, (outputs, Some(sampling), total)).map_err(|e| {
        let problem = model.diagnose(&e);
        let span = match e {
            Error::NothingConserved { .. } => place_of(Want::Invariants.name()),
            Error::NoPositions { .. } => place_of(Want::Positions.name()),
            Error::NoBracket { .. } => {
                place_of(Want::Bracket.name()).or_else(|| place_of(Want::HamiltonianTime.name()))
            }
            Error::NoDiscrete { .. } => {
                let own = model.scenes.iter().find(|own| own.name == *scene);
                own.and_then(|own| own.discrete?.place)
            }
            Error::NoPhases { .. } => place_of(Want::Phases.name()),
            Error::NoConnection { .. } => place_of(Want::Connection.name()),
            Error::NoDirac { .. } => place_of(Want::Dirac.name()),
            Error::NoQuotient { .. } => place_of(Want::Quotient.name()),
            Error::NoSplitting { .. } => place_of(Want::Splitting.name()),
            Error::NoHamiltonianTime { .. } => place_of(Want::HamiltonianTime.name()),
            Error::Unsupported { .. } if plan.implicit => place_of(Want::Implicit.name()),
            Error::Unsupported { .. } => {
                let wants = plan.dynamics.iter().chain(&plan.of_frames).chain([&Want::Frames]);
                wants.into_iter().find_map(|want| place_of(want.name())).or(problem.span)
            }
            _ => problem.span,
        };
        model.diagnostics(vec![spec::Diagnostic { span, ..problem }])
    })
}

/// The system that a model is the quotient of, held to its own model.
fn total_system(model: &Model) -> Result<TotalSystem, Diagnostics> {
    let other = quotient::total_model(model)?;
    let outputs = Outputs::Named(vec![quotient::wanted()]);
    let plan = Plan { outputs, ..Plan::bare(DEFAULT.to_owned(), Formulation::of(&other)) };
    let file = model.totals.first().map_or(String::new(), |total| total.file.clone());
    Ok(TotalSystem { file, scene: build_planned(&Derivations::new(Arc::new(other)), plan)? })
}

/// A group by its name, every output of the model, or a single component of a group.
fn wanted_outputs(available: &[Output], wanted: &Wanted) -> Vec<Output> {
    let of_kind = |kind: OutputKind| available.iter().filter(move |o| o.kind == kind).cloned().collect();
    let name = match wanted {
        Wanted::Want(Want::Outputs) => return of_kind(OutputKind::OfModel),
        Wanted::Want(Want::Events) => {
            let is_of_events =
                |o: &&Output| matches!(o.kind, OutputKind::Group(Want::Events) | OutputKind::After);
            return available.iter().filter(is_of_events).cloned().collect();
        }
        Wanted::Want(want) => return of_kind(OutputKind::Group(*want)),
        Wanted::Own(name) => name,
    };
    if let Some(group) = available.iter().find(|o| o.name == *name) {
        return vec![group.clone()];
    }
    let single = available.iter().find_map(|o| {
        let component = o.components.iter().find(|(own, _)| own == name)?.clone();
        let (name, doc) = (name.clone(), o.doc.clone());
        Some(Output { kind: OutputKind::Component, name, components: vec![component], doc })
    });
    single.into_iter().collect()
}

fn available_outputs(equations: &Equations) -> Vec<Output> {
    let mut outputs = equations.outputs.clone();
    if equations.has_energy() && !equations.facts.energy_is_conserved {
        let components = vec![(Want::EnergyRate.name().into(), equations.energy_rate)];
        let doc = "rate of energy dE/dt along the motion";
        outputs.insert(0, Output::group(Want::EnergyRate, components, doc));
    }
    outputs
}

/// Where the functions of a scene are measured: about the defaults of its parameters, by the roles of its variables.
fn sampling(model: &Model, plan: &Plan, (equations, state): (&Equations, &[StateEquation])) -> Sampling {
    let params = all_params(model, &plan.name, &BTreeMap::new());
    let roles = variable_roles(model, &params);
    let kind = |s: &StateEquation| match roles.get(&s.name).copied() {
        Some(VariableRole::Bounded { from, to }) => VariableKind::Bounded { from, to },
        Some(VariableRole::Unbounded | VariableRole::Mode) => VariableKind::Unbounded,
        Some(VariableRole::Advected { index, n }) => VariableKind::Vector { index, n },
        Some(VariableRole::Group { .. }) => VariableKind::Group,
        Some(VariableRole::Velocity) | None => VariableKind::Velocity,
    };
    let default = |p: &Param| params.get(&p.name).copied().unwrap_or_else(|| rational_to_f64(&p.default));
    let params = equations.system.params.iter().map(default).collect();
    Sampling { carries_errors: plan.digits, params, state: state.iter().map(kind).collect() }
}

/// Lowers what a scene asks for of its equations.
pub(super) fn lower_scene(
    derived: Derived,
    plan: &Plan,
    state: Vec<StateEquation>,
    (mut outputs, sampling, total): (Vec<Output>, Option<Sampling>, Option<Arc<TotalSystem>>),
) -> Result<BuiltScene, Error> {
    let is_shared = (plan.is_plain() || derived.by_cost) && !plan.hamiltonian_time;
    let is_shared = is_shared && plan.search == SearchBudget::default();
    let searched = if is_shared { Some(derived.searched(&state)?) } else { None };
    let equations = derived.equations;
    let system = &equations.system;
    let mut graph = searched.as_ref().map_or(&system.graph, |searched| &searched.graph).clone();
    graph.set_budget(system.graph.budget());
    graph.enter(Stage::Derivatives);
    let mut inputs = Inputs { sampling, ..inputs_of(&equations, &state) };
    // What moves in the scene's own time; the rates of a built scene stay those of its equations.
    let mut moving = state.clone();
    let mut factor = graph.one();
    if plan.hamiltonian_time {
        if plan.implicit {
            let reason = "the implicit form is that in the time of the model".to_owned();
            return Err(Error::NoHamiltonianTime { reason });
        }
        let (found, output) = bracket::hamiltonian_time(&mut graph, &equations, &state)?;
        moving.iter_mut().for_each(|s| s.derivative = graph.mul(found, s.derivative));
        outputs.push(output);
        factor = found;
    }
    let of_model = outputs_of_model(&equations, &state);
    let what = (moving.as_slice(), of_model.as_slice());
    let derivatives = derivatives::differentiate(&mut graph, &equations, what, &inputs, &plan.derivatives)?;
    inputs.arguments.extend(derivatives.arguments);
    outputs.extend(derivatives.outputs);
    let mut matrices = derivatives.matrices;
    let dynamics = dynamics::find(&mut graph, &equations, &plan.dynamics)?;
    let of_frames = frames::find(&mut graph, &equations, &state, &plan.of_frames)?;
    outputs.extend(of_frames.outputs);
    matrices.extend(of_frames.matrices);
    outputs.extend(dynamics.outputs);
    matrices.extend(dynamics.matrices);
    inputs.arguments.extend(dynamics.arguments);
    let mut own_sections = [derivatives.sections, dynamics.sections, of_frames.sections].concat();
    if plan.invariants {
        let found = invariants::find(&mut graph, &equations, &moving, &inputs);
        graph.within_budget()?;
        let found = found.ok_or_else(|| Error::NothingConserved { scene: plan.name.clone() })?;
        outputs.extend(found.outputs);
        matrices.push(found.gradients);
        own_sections.extend(found.sections);
    }
    let ranks = if plan.ranks { ranks::find(&mut graph, &equations, &state)? } else { None };
    let mut layout = None;
    if plan.positions != Share::None || ranks.as_ref().is_some_and(|found| found.constraints.is_none()) {
        let found = positions::find(&mut graph, &equations, &state);
        graph.within_budget()?;
        match found {
            Err(Error::NoPositions { .. }) if plan.positions != Share::Wanted => {}
            found => {
                let (found, how) = found?;
                outputs.extend(found.outputs);
                matrices.push(found.gradients);
                own_sections.extend(found.sections);
                layout = Some(how);
            }
        }
    }
    let ranks = ranks.map(|found| {
        if let Some(found) = found.constraints {
            // The scene may want the residuals.
            let is_there = |o: &Output| outputs.iter().any(|other| other.name == o.name);
            let further: Vec<Output> = found.outputs.into_iter().filter(|o| !is_there(o)).collect();
            outputs.extend(further);
            matrices.push(found.gradients);
            own_sections.extend(found.sections);
        }
        found.layout
    });
    if plan.phases {
        outputs.push(bundle::phases_of(&mut graph, &equations, &state)?);
    }
    if plan.dirac {
        outputs.push(bundle::dirac_of(&mut graph, &equations, &state)?);
        graph.within_budget()?;
    }
    if let Some(dim) = plan.connection {
        outputs.push(bundle::connection_of(&mut graph, &equations, &state, dim)?);
        graph.within_budget()?;
    }
    if plan.bracket {
        let found = bracket::find(&mut graph, &equations, &state, factor);
        graph.within_budget()?;
        let found = found?;
        outputs.extend(found.outputs);
        matrices.push(found.matrix);
        own_sections.extend(found.sections);
    }
    let mut flows = Vec::new();
    let mut flow_requests = Vec::new();
    if plan.splitting {
        if plan.hamiltonian_time {
            let reason = "the flows are those in the time of the model".to_owned();
            return Err(Error::NoSplitting { reason });
        }
        let found = splitting::find(&mut graph, &equations, &state);
        graph.within_budget()?;
        let found = found?;
        flows = found.flows;
        inputs.arguments.extend(found.arguments);
        own_sections.extend(found.sections);
        flow_requests.extend(found.requests);
    }
    let mut quotient_requests = Vec::new();
    if let Some(total) = &total {
        let found = quotient::find(&mut graph, total, &equations, &state)?;
        inputs.arguments.extend(found.arguments);
        quotient_requests.extend(found.requests);
    }
    let mut implicit_form = None;
    let mut implicit_requests = Vec::new();
    if plan.implicit {
        let found = implicit::find(&mut graph, &equations, &state)?;
        outputs.push(found.output);
        inputs.arguments.extend(found.arguments);
        own_sections.extend(found.sections);
        implicit_requests.extend(found.requests);
        implicit_form = Some(found.implicit);
    }
    let mut discrete_steps = None;
    let mut discrete_requests = Vec::new();
    if let Some(asked) = &plan.discrete {
        if plan.hamiltonian_time {
            let reason = "steps are those in the time of the model".to_owned();
            return Err(Error::NoDiscrete { reason });
        }
        let found = discrete::find(&mut graph, &equations, &state, asked)?;
        inputs.arguments.extend(found.arguments);
        discrete_requests.extend(found.requests);
        discrete_steps = Some(found.discrete);
    }
    graph.within_budget()?;
    graph.enter(Stage::Lowering);
    let rhs = rates_of(&moving);
    let guards = match &searched {
        Some(searched) => searched.guards.clone(),
        None => Guards::of(&mut graph, &equations, &rhs, &inputs.state),
    };
    let Guards { conditions, divisors, pivots, domain } = guards;
    inputs.divisors = divisors;
    let mut requests = vec![rhs];
    if plan.energy {
        let results = vec![("energy".to_owned(), equations.energy)];
        requests.push(Request { role: Role::Energy, results });
    }
    requests.push(Request { role: Role::Pivots, results: pivots });
    for output in &outputs {
        let role = Role::Output(output.name.clone());
        requests.push(Request { role, results: output.components.clone() });
    }
    requests.extend(derivatives.requests);
    requests.extend(dynamics.requests);
    let legendre = &equations.legendre;
    if !legendre.momenta.is_empty() {
        requests.push(Request { role: legendre_role(), results: legendre.momenta.clone() });
    }
    requests.extend(implicit_requests);
    requests.extend(discrete_requests);
    requests.extend(quotient_requests);
    requests.extend(flow_requests);
    if !domain.is_empty() {
        requests.push(Request { role: Role::Domain, results: domain });
    }
    let results = requests.iter().flat_map(|r| r.results.iter().map(|(_, e)| *e));
    let roots: Vec<ExprId> = results.chain(conditions.iter().flat_map(|c| [c.greater, c.less])).collect();
    let mut sections = equations.sections.clone();
    sections.extend(own_sections);
    let sections = needed_sections(&graph, &sections, &roots);
    let events = events::of_scene(&equations, &plan.name, &state, &outputs)?;
    let known = searched.as_ref().map(|searched| &searched.rates);
    let program =
        lower::lower_with(&mut graph, &inputs, &sections, &conditions, &requests, (&plan.search, known))?;
    let products = [derivatives.products, dynamics.products].concat();
    let spent = graph.spent();
    let (name, wants_taylor, doc) = (plan.name.clone(), plan.taylor, plan.doc.clone());
    let chosen = plan.chosen.clone();
    Ok(BuiltScene {
        name,
        equations,
        program,
        state,
        outputs,
        matrices,
        products,
        implicit: implicit_form,
        discrete: discrete_steps,
        positions: layout,
        ranks,
        total,
        flows,
        events,
        wants_taylor,
        doc,
        chosen,
        spent,
        is_in_hamiltonian_time: plan.hamiltonian_time,
        model: None,
        certificate: Certificate::default(),
    })
}

impl BuiltScene {
    /// The scene, held to the model that it was made from.
    ///
    /// # Errors
    /// [`Error::Disagrees`].
    pub(super) fn certified(self, model: Arc<Model>) -> Result<BuiltScene, Error> {
        let certificate = self.held_to(&model, N_POINTS)?;
        Ok(BuiltScene { model: Some(model), certificate, ..self })
    }

    /// Holds the scene to its model at so many points.
    ///
    /// # Errors
    /// [`Error::Disagrees`].
    pub(super) fn held_to(&self, model: &Model, n_points: usize) -> Result<Certificate, Error> {
        trace::at(format_args!("certificate of scene {}", self.name));
        let claim = self.claim(model, n_points);
        let certificate = certify(&claim)?;
        match (&self.total, self.total.as_ref().and_then(|total| total.scene.model.as_ref())) {
            (Some(total), Some(of_total)) => {
                let other = total.scene.claim(of_total, n_points);
                certify_quotient(&claim, &other, certificate)
            }
            _ => Ok(certificate),
        }
    }

    /// The scene as it is compared with a model.
    pub(super) fn claim<'a>(&'a self, model: &'a Model, n_points: usize) -> Claim<'a> {
        let state: Vec<SymbolId> = self.state.iter().map(|s| s.symbol).collect();
        let in_bracket =
            (0..state.len()).filter(|k| self.equations.state.iter().any(|s| s.symbol == state[*k]));
        let in_bracket: Vec<usize> = in_bracket.collect();
        let matrices = self.matrices.iter().map(|matrix| MatrixClaim {
            name: matrix.name,
            shape: matrix.shape,
            pattern: &matrix.pattern,
            columns: in_bracket.clone(),
        });
        let implicit = self.implicit.as_ref();
        Claim {
            model,
            scene: &self.name,
            equations: &self.equations,
            program: &self.program,
            state,
            is_in_hamiltonian_time: self.is_in_hamiltonian_time,
            outputs: &self.outputs,
            matrices: matrices.collect(),
            observed: self.observed(),
            n_positions: self.positions.as_ref().map_or(0, |layout| layout.n_equations),
            differential: implicit
                .iter()
                .flat_map(|i| i.variables.iter().map(|v| v.is_differential))
                .collect(),
            implicit_pattern: implicit.map_or(&[], |i| &i.pattern),
            discrete: self.discrete.as_ref().map(|found| DiscreteClaim {
                map: &found.map,
                n_unknowns: found.unknowns.len(),
                pattern: &found.pattern,
                state: &found.state,
            }),
            n_points,
        }
    }
}
