//! Scenes: what is wanted of a model, what is fixed, and what is left out.
//!
//! [`build`] runs the whole pipeline for one scene. The default scene fixes nothing and wants every output, `minimal` leaves
//! out coordinates that nothing asks for, `reconstruction` adds those of the group; a `scene` block of the model fixes
//! parameters (folded exactly before the derivation), names the outputs it wants and the coordinates it drops.
//!
//! [`build_pictured`] adds what figures in space show, which no other scene carries.
//!
//! Deliberately does not know: how equations are derived, how programs are lowered, how text is emitted.

mod defaults;
mod derivatives;
mod invariants;

use std::collections::{BTreeMap, BTreeSet};

use hamel_runtime::Dual;

use crate::emit::{self, MatrixText, OutputText, ParamText, ProductText, SceneEntry, SceneText, StateText};
use crate::error::Error;
use crate::expr::{
    Budget, Exhausted, ExprId, Func, Graph, Rational, Resource, Sign, Stage, SymbolId, inlined,
    needed_sections, rational_to_f64, sign_of,
};
use crate::lower::{self, Inputs, ParamCondition, Request, SearchBudget};
use crate::mechanics::{Equations, Output, Pivot, PivotOrigin, StateEquation, derive};
use crate::program::{Counts, Jet, Point, Program, Relation, Role, ViolatedCondition};
use crate::reduction::{AccelerationSource, KinematicConstraint, reduce, with_circles};
use crate::spec::{self, Diagnostics, Model, Param, Want};

use invariants::GRADIENTS;

pub use defaults::warnings;
pub use derivatives::{Derivative, Matrix, Product};
pub use invariants::INVARIANTS;

/// Name of the scene that every model has.
pub const DEFAULT: &str = "default";

/// A scene after the whole pipeline: its equations and its program.
#[derive(Clone, Debug)]
pub struct BuiltScene {
    /// Name of the scene.
    pub name: String,
    /// What was derived.
    pub equations: Equations,
    /// What was lowered: the rates, the energy (when wanted), the pivots, one function for each output and each product, then
    /// the domain where there is one; see [`Role`].
    pub program: Program,
    /// The state of this scene: that of the model without what is left out, with what is reconstructed.
    pub state: Vec<StateEquation>,
    outputs: Vec<Output>,
    matrices: Vec<Matrix>,
    products: Vec<Product>,
    /// Whether the emitted module has the Taylor coefficients of solutions.
    wants_taylor: bool,
    doc: String,
    spent: Budget,
}

/// How a scene's module is written down.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Writing {
    /// Command that writes the module again when the model's name follows, such as `cargo xtask generate`; without one,
    /// the first line says to change the model.
    pub command: Option<String>,
    /// Path of the runtime in the crate that the module is for; `::hamel_runtime` unless given.
    pub runtime: Option<String>,
}

/// Name of the scene without the coordinates that nothing asks for; a model has it when there are such coordinates.
pub const MINIMAL: &str = "minimal";

/// Name of the scene with the coordinates of the group; a model has it when it says how to reconstruct them.
pub const RECONSTRUCTION: &str = Want::Reconstruction.name();

/// Name of the scene with all derivatives of the right-hand side; every model has it, built when it is asked for.
pub const DERIVATIVES: &str = "derivatives";
/// What a scene wants whose module has the Taylor coefficients of solutions.
const TAYLOR: &str = Want::Taylor.name();

/// What a scene asks for.
struct Plan {
    name: String,
    fixed: Vec<(String, Rational)>,
    /// `None`: every output.
    wants: Option<Vec<String>>,
    drops: Drops,
    circles: Vec<String>,
    reconstructs: bool,
    wants_taylor: bool,
    wants_invariants: bool,
    doc: String,
}

impl Plan {
    /// Everything that the model has under a name.
    fn new(name: String) -> Plan {
        Plan {
            name,
            fixed: Vec::new(),
            wants: None,
            drops: Drops::Nothing,
            circles: Vec::new(),
            reconstructs: false,
            wants_taylor: false,
            wants_invariants: false,
            doc: String::new(),
        }
    }
}

enum Drops {
    Nothing,
    Ignorable,
    Named(Vec<String>),
}

/// Names of a model's scenes that are emitted, the default first; [`DERIVATIVES`] is one only if the model says so.
///
/// Every model has [`DEFAULT`]; [`MINIMAL`] and [`RECONSTRUCTION`] where they differ from it; then its own.
pub fn names(model: &Model) -> Vec<String> {
    let mut names = vec![DEFAULT.to_owned()];
    let own = |name: &str| model.scenes.iter().any(|s| s.name == name);
    if !own(MINIMAL) && has_ignorable_coordinates(model) {
        names.push(MINIMAL.to_owned());
    }
    if !own(RECONSTRUCTION) && !model.reconstruction.is_empty() {
        names.push(RECONSTRUCTION.to_owned());
    }
    names.extend(model.scenes.iter().map(|s| s.name.clone()));
    names
}

fn has_ignorable_coordinates(model: &Model) -> bool {
    let Some(equations) = reduce(model, &[]).ok().and_then(|system| derive(&system).ok()) else {
        return false;
    };
    !ignorable(&equations, &[equations.energy]).is_empty()
}

/// Whether a state of the model can violate a constraint: whether it has residuals, the output [`Want::Constraint`].
///
/// # Errors
/// What reduction can find.
pub fn has_residuals(model: &Model) -> Result<bool, Diagnostics> {
    let KinematicConstraint::Multipliers { rows, .. } = reduce(model, &[])?.constraint else {
        return Ok(false);
    };
    Ok(rows.iter().any(|row| matches!(row.source, AccelerationSource::Differentiated(_))))
}

fn plan(model: &Model, scene: &str) -> Option<Plan> {
    let name = scene.to_owned();
    if let Some(own) = model.scenes.iter().find(|s| s.name == scene) {
        let drops = if own.drops.is_empty() { Drops::Nothing } else { Drops::Named(own.drops.clone()) };
        let reconstructs = own.wants.iter().any(|w| w == RECONSTRUCTION);
        let wants_taylor = own.wants.iter().any(|w| w == TAYLOR);
        let wants_invariants = own.wants.iter().any(|w| w == INVARIANTS);
        let is_output = |want: &&String| ![RECONSTRUCTION, TAYLOR, INVARIANTS].contains(&want.as_str());
        let wants = own.wants.iter().filter(is_output).cloned().collect();
        return Some(Plan {
            name,
            fixed: own.fixed.clone(),
            wants: Some(wants),
            drops,
            circles: own.circles.clone(),
            reconstructs,
            wants_taylor,
            wants_invariants,
            doc: own.doc.clone(),
        });
    }
    let automatic = |wants, drops, reconstructs, doc: &str| {
        let doc = doc.to_owned();
        Some(Plan { wants, drops, reconstructs, doc, ..Plan::new(name) })
    };
    match scene {
        DEFAULT => automatic(None, Drops::Nothing, false, ""),
        MINIMAL => {
            let doc = "without the coordinates on which nothing depends";
            automatic(Some(vec![Want::Energy.name().to_owned()]), Drops::Ignorable, false, doc)
        }
        DERIVATIVES => {
            let wants = [Want::Energy.name()].into_iter().chain(Derivative::ALL.map(Derivative::name));
            let wants = wants.map(str::to_owned).collect();
            automatic(Some(wants), Drops::Nothing, false, "with the derivatives of the right-hand side")
        }
        RECONSTRUCTION => automatic(None, Drops::Nothing, true, "with the coordinates of the group"),
        _ => None,
    }
}

/// Builds one scene of a model.
///
/// ```
/// use hamel_codegen::{program::Role, scene, spec};
///
/// let text = "model top {
///     param I: diagonal(3) = [2, 1.5, 0.8] where I1 > 0, I2 > 0, I3 > 0;
///     velocity Omega in so(3);
///     lagrangian = 1/2*dot(Omega, I*Omega);
///     scene ball { fix I = [1, 1, 1]; want rhs; }
/// }";
/// let model = spec::parse("top.hamel", text)?;
/// let ball = scene::build(&model, "ball")?;
/// let rhs = ball.program.function(&Role::Rate).unwrap();
/// assert_eq!(rhs.counts().total(), 0);
/// # Ok::<(), spec::Diagnostics>(())
/// ```
///
/// # Errors
/// Unknown scene or output, a coordinate that cannot be left out, and everything that reduction, derivation and
/// lowering can find.
pub fn build(model: &Model, scene: &str) -> Result<BuiltScene, Diagnostics> {
    build_located(model, scene, |plan| plan)
}

/// Name of the output with the numbers of a view, see [`spec::View::numbers`]; no output of a model has such a name.
pub fn view_output(view: &str) -> String {
    format!("view {view}")
}

/// Builds a scene with everything that a report shows: the parameters that `scene` fixes, every coordinate, those of the
/// group when the model reconstructs them, every output, and the views, each as the output [`view_output`].
///
/// # Errors
/// As [`build`].
pub fn build_pictured(model: &Model, scene: &str) -> Result<BuiltScene, Diagnostics> {
    let mut pictured = model.clone();
    for view in &model.views.list {
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
        pictured.outputs.push(spec::NamedVector { name, components, doc: view.doc.clone() });
    }
    let reconstructs = !model.reconstruction.is_empty();
    build_located(&pictured, scene, |plan| Plan { wants: None, drops: Drops::Nothing, reconstructs, ..plan })
}

fn build_located(
    model: &Model,
    scene: &str,
    change: impl FnOnce(Plan) -> Plan,
) -> Result<BuiltScene, Diagnostics> {
    build_scene(model, scene, change).map_err(|problems| {
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

fn build_scene(
    model: &Model,
    scene: &str,
    change: impl FnOnce(Plan) -> Plan,
) -> Result<BuiltScene, Diagnostics> {
    let own = model.scenes.iter().find(|s| s.name == scene);
    let place_of = |name: &str| own.and_then(|s| s.places.get(name).copied());
    let fail_at = |span: Option<spec::Span>, message: String, help: String| {
        model.diagnostics(vec![spec::diagnose(model, span, message, help)])
    };
    let fail = |message: String, help: String| fail_at(None, message, help);
    let Some(plan) = plan(model, scene) else {
        let known = names(model).join(", ");
        return Err(fail(format!("{} has no scene {scene}", model.name), format!("scenes: {known}")));
    };
    let plan = change(plan);
    if plan.reconstructs && model.reconstruction.is_empty() {
        let help = "say how with `reconstruct .. in ..;`".to_owned();
        return Err(fail(format!("{} does not say how to reconstruct the group motion", model.name), help));
    }
    let system = with_circles(model, reduce(model, &plan.fixed)?, &plan.circles).map_err(|problems| {
        // At the angle in the scene where the model has no text for the place itself.
        let here = plan.circles.iter().find_map(|angle| place_of(angle));
        let located = problems.iter().map(|problem| match problem.span {
            None => spec::Diagnostic { span: here, ..problem.clone() },
            Some(_) => problem.clone().with_place(here, "on the circle in this scene"),
        });
        model.diagnostics(located.collect())
    })?;
    let equations = derive(&system).map_err(|e| model.diagnostics(vec![model.diagnose(&e)]))?;
    let available = available_outputs(&equations);
    let mut wants_energy = true;
    let mut derivatives = BTreeSet::new();
    let outputs = match &plan.wants {
        None => available,
        Some(wants) => {
            wants_energy = wants.iter().any(|w| w == Want::Energy.name());
            let mut selected = Vec::new();
            let is_output = |w: &&String| ![Want::Energy, Want::Rhs].map(Want::name).contains(&w.as_str());
            for want in wants.iter().filter(is_output) {
                if let Some(derivative) = Derivative::from_name(want) {
                    derivatives.insert(derivative);
                    continue;
                }
                let found = wanted_outputs(&equations, &available, want);
                if found.is_empty() {
                    let known: Vec<&str> = available.iter().map(|o| o.name.as_str()).collect();
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
    let mut results: Vec<ExprId> =
        outputs.iter().flat_map(|o| o.components.iter().map(|(_, e)| *e)).collect();
    results.extend(wants_energy.then_some(equations.energy));
    if plan.reconstructs {
        results.extend(equations.reconstruction.iter().map(|c| c.derivative));
    }
    let ignorable = ignorable(&equations, &results);
    let dropped = match &plan.drops {
        Drops::Nothing => Vec::new(),
        Drops::Ignorable => ignorable,
        Drops::Named(names) => {
            let matches = |state: &str, name: &str| {
                state == name
                    || state.strip_prefix(name).is_some_and(|rest| rest.bytes().all(|b| b.is_ascii_digit()))
            };
            let chosen: Vec<String> = equations
                .state
                .iter()
                .filter(|s| names.iter().any(|n| matches(&s.name, n)))
                .map(|s| s.name.clone())
                .collect();
            if let Some(needed) = chosen.iter().find(|name| !ignorable.contains(name)) {
                let help = if ignorable.is_empty() {
                    "every coordinate is needed".to_owned()
                } else {
                    format!("can be left out: {}", ignorable.join(", "))
                };
                let stem = needed.trim_end_matches(|c: char| c.is_ascii_digit());
                return Err(fail_at(
                    place_of(needed).or_else(|| place_of(stem)),
                    format!("{needed} cannot be left out of scene {scene}: the rest depends on it"),
                    help,
                ));
            }
            chosen
        }
    };
    let mut state = equations.state.clone();
    state.retain(|s| !dropped.contains(&s.name));
    if plan.reconstructs {
        state.extend(equations.reconstruction.iter().cloned());
    }
    let built = lower_scene(equations, plan, state, outputs, wants_energy, &derivatives);
    built.map_err(|e| {
        let problem = model.diagnose(&e);
        let span = if let Error::NothingConserved { .. } = e { place_of(INVARIANTS) } else { problem.span };
        model.diagnostics(vec![spec::Diagnostic { span, ..problem }])
    })
}

/// Builds scenes of a model, by their names: see [`names`].
///
/// # Errors
/// The problems of all scenes; what several have in common is reported once.
pub fn build_several(model: &Model, scenes: &[String]) -> Result<Vec<BuiltScene>, Diagnostics> {
    let mut built = Vec::new();
    let mut problems: Vec<spec::Diagnostic> = Vec::new();
    for name in scenes {
        match build(model, name) {
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
    if problems.is_empty() { Ok(built) } else { Err(model.diagnostics(problems)) }
}

/// Base coordinates on which neither another state variable's rate, nor a wanted result, nor a pivot depends.
fn ignorable(equations: &Equations, results: &[ExprId]) -> Vec<String> {
    let graph = &equations.system.graph;
    let mut inputs: BTreeMap<SymbolId, BTreeSet<SymbolId>> = BTreeMap::new();
    let needs = |e: ExprId, inputs: &BTreeMap<SymbolId, BTreeSet<SymbolId>>| -> BTreeSet<SymbolId> {
        graph
            .free_symbols(e)
            .into_iter()
            .flat_map(|s| inputs.get(&s).cloned().unwrap_or_else(|| BTreeSet::from([s])))
            .collect()
    };
    for definition in equations.sections.iter().flat_map(|s| &s.definitions) {
        let needed = needs(definition.expr, &inputs);
        inputs.insert(definition.symbol, needed);
    }
    let base = equations.system.algebroid.base();
    let mut needed: BTreeSet<SymbolId> = results
        .iter()
        .chain(equations.pivots.iter().map(|p| &p.expr))
        .flat_map(|e| needs(*e, &inputs))
        .collect();
    let mut open: Vec<(SymbolId, BTreeSet<SymbolId>)> = Vec::new();
    for s in &equations.state {
        let rate = needs(s.derivative, &inputs);
        if base.contains(&s.symbol) {
            open.push((s.symbol, rate));
        } else {
            needed.extend(rate);
        }
    }
    // A coordinate that is needed needs what its own rate depends on.
    while let Some(k) = open.iter().position(|(symbol, _)| needed.contains(symbol)) {
        needed.extend(open.swap_remove(k).1);
    }
    let dropped: BTreeSet<SymbolId> = open.into_iter().map(|(symbol, _)| symbol).collect();
    equations.state.iter().filter(|s| dropped.contains(&s.symbol)).map(|s| s.name.clone()).collect()
}

/// Coordinates of the base and the group that are no part of a scene's state.
fn left_out(equations: &Equations, state: &[StateEquation]) -> BTreeSet<SymbolId> {
    let carried: BTreeSet<SymbolId> = state.iter().map(|s| s.symbol).collect();
    let base = equations.system.algebroid.base().iter().copied();
    let all = base.chain(equations.reconstruction.iter().map(|s| s.symbol));
    all.filter(|symbol| !carried.contains(symbol)).collect()
}

/// Whether a value depends on one of `symbols`, also by the sections that it uses.
fn needs(g: &Graph, equations: &Equations, e: ExprId, symbols: &BTreeSet<SymbolId>) -> bool {
    let sections = needed_sections(g, &equations.sections, &[e]);
    let definitions = sections.iter().flat_map(|s| &s.definitions).map(|d| d.expr);
    definitions.chain([e]).any(|e| g.depends_on(e, symbols))
}

/// A group by its name, every output of the model (`outputs`), or a single component of a group.
fn wanted_outputs(equations: &Equations, available: &[Output], want: &str) -> Vec<Output> {
    if want == Want::Outputs.name() {
        let of_model = &equations.system.outputs;
        return available.iter().filter(|o| of_model.iter().any(|m| m.name == o.name)).cloned().collect();
    }
    if let Some(group) = available.iter().find(|o| o.name == want) {
        return vec![group.clone()];
    }
    let single = available.iter().find_map(|o| {
        let component = o.components.iter().find(|(name, _)| name == want)?.clone();
        Some(Output { name: want.to_owned(), components: vec![component], doc: o.doc.clone() })
    });
    single.into_iter().collect()
}

fn available_outputs(equations: &Equations) -> Vec<Output> {
    let mut outputs = equations.outputs.clone();
    if !equations.facts.energy_is_conserved {
        outputs.insert(
            0,
            Output {
                name: Want::EnergyRate.name().into(),
                components: vec![(Want::EnergyRate.name().into(), equations.energy_rate)],
                doc: "rate of energy dE/dt along the motion".into(),
            },
        );
    }
    outputs
}

fn lower_scene(
    equations: Equations,
    plan: Plan,
    state: Vec<StateEquation>,
    mut outputs: Vec<Output>,
    wants_energy: bool,
    derivatives: &BTreeSet<Derivative>,
) -> Result<BuiltScene, Error> {
    let system = &equations.system;
    let mut graph = system.graph.clone();
    graph.enter(Stage::Derivatives);
    let mut inputs = Inputs {
        params: system.params.iter().map(|p| p.symbol).collect(),
        time: system.time,
        state: state.iter().map(|s| s.symbol).collect(),
        signs: system.signs.clone(),
        arguments: BTreeMap::new(),
        divisors: lower::Divisors::default(),
        circles: system.circles.iter().map(|c| [c.cosine, c.sine]).collect(),
    };
    let derivatives =
        derivatives::differentiate(&mut graph, &equations.sections, &state, &inputs, derivatives);
    inputs.arguments = derivatives.arguments;
    outputs.extend(derivatives.outputs);
    let mut matrices = derivatives.matrices;
    let mut own_sections = derivatives.sections;
    if plan.wants_invariants {
        let found = invariants::find(&mut graph, &equations, &state, &inputs);
        graph.within_budget()?;
        let found = found.ok_or_else(|| Error::NothingConserved { scene: plan.name.clone() })?;
        outputs.extend(found.outputs);
        matrices.push(found.gradients);
        own_sections.extend(found.sections);
    }
    graph.within_budget()?;
    graph.enter(Stage::Lowering);
    let mut conditions: Vec<ParamCondition> = system
        .conditions
        .iter()
        .map(|c| ParamCondition {
            text: c.text.clone(),
            meaning: String::new(),
            greater: c.greater,
            less: c.less,
            relation: match c.relation {
                spec::Relation::Greater => Relation::Greater,
                spec::Relation::GreaterEqual => Relation::GreaterEqual,
                spec::Relation::NotEqual => Relation::NotEqual,
            },
            is_rounded: false,
        })
        .collect();
    let pivots = sorted_pivots(&mut graph, &equations);
    conditions.extend(pivots.conditions);
    inputs.divisors = pivots.divisors;
    let rhs: Vec<(String, ExprId)> = state.iter().map(|s| (s.name.clone(), s.derivative)).collect();
    let mut requests = vec![Request { role: Role::Rate, results: rhs }];
    if wants_energy {
        let results = vec![("energy".to_owned(), equations.energy)];
        requests.push(Request { role: Role::Energy, results });
    }
    requests.push(Request { role: Role::Pivots, results: pivots.moving });
    for output in &outputs {
        let role = Role::Output(output.name.clone());
        requests.push(Request { role, results: output.components.clone() });
    }
    requests.extend(derivatives.requests);
    let carried: BTreeSet<SymbolId> = inputs.state.iter().copied().collect();
    let left_out: BTreeSet<SymbolId> =
        system.algebroid.base().iter().filter(|x| !carried.contains(x)).copied().collect();
    let domains = system.domains.iter().filter(|d| !graph.depends_on(d.positive, &left_out));
    let results: Vec<(String, ExprId)> = domains.map(|d| (d.text.clone(), d.positive)).collect();
    if !results.is_empty() {
        requests.push(Request { role: Role::Domain, results });
    }
    let results = requests.iter().flat_map(|r| r.results.iter().map(|(_, e)| *e));
    let roots: Vec<ExprId> = results.chain(conditions.iter().flat_map(|c| [c.greater, c.less])).collect();
    let mut sections = equations.sections.clone();
    sections.extend(own_sections);
    let sections = needed_sections(&graph, &sections, &roots);
    let program =
        lower::lower(&mut graph, &inputs, &sections, &conditions, &requests, &SearchBudget::default())?;
    let products = derivatives.products;
    let spent = graph.spent();
    let Plan { name, wants_taylor, doc, .. } = plan;
    Ok(BuiltScene { name, equations, program, state, outputs, matrices, products, wants_taylor, doc, spent })
}

/// What is asked of the pivots, and when.
struct SortedPivots {
    /// Of those that depend on parameters alone: asked when these are prepared.
    conditions: Vec<ParamCondition>,
    /// Those that change along a motion and could vanish.
    moving: Vec<(String, ExprId)>,
    divisors: lower::Divisors,
}

/// Entries of a matrix without a definite sign may be added to this multiple of their size while it is factored: three of
/// sixteen digits are lost at most besides those that its condition costs.
const MAX_GROWTH: i64 = 1024;

/// Sorts pivots by what is known about them.
///
/// A symmetric matrix of parameters whose pivots are positive for the defaults is taken for an inertia, and has to be
/// positive definite: elimination is stable then (Higham 2002, section 10.1). From any other, elimination in a fixed order
/// can lose everything, which the growth of its entries tells (section 9.3).
fn sorted_pivots(graph: &mut Graph, equations: &Equations) -> SortedPivots {
    let system = &equations.system;
    let values = inlined(graph, equations.sections.iter().flat_map(|s| &s.definitions));
    let defaults: BTreeMap<SymbolId, f64> =
        system.params.iter().map(|p| (p.symbol, rational_to_f64(&p.default))).collect();
    let in_inputs: Vec<ExprId> =
        equations.pivots.iter().map(|p| graph.subs(p.expr, &values).unwrap_or(p.expr)).collect();
    // Names of symmetric matrices with a pivot that is not positive for the defaults.
    let mut indefinite = BTreeSet::new();
    for (pivot, value) in equations.pivots.iter().zip(&in_inputs) {
        let is_positive = |x: f64| x.is_finite() && x > 0.0;
        if equations.is_parameter_only(pivot.expr)
            && !graph.eval_f64(*value, &defaults).is_some_and(is_positive)
        {
            indefinite.insert(&pivot.matrix.name);
        }
    }
    let mut sorted =
        SortedPivots { conditions: Vec::new(), moving: Vec::new(), divisors: lower::Divisors::default() };
    let mut watched: BTreeMap<&String, lower::WatchedMatrix> = BTreeMap::new();
    let mut is_a_sum_of_squares = None;
    for (pivot, value) in equations.pivots.iter().zip(in_inputs) {
        let sign = sign_of(graph, value, &system.signs);
        let matrix = &pivot.matrix;
        let is_parameter_only = equations.is_parameter_only(pivot.expr);
        if sign.is_definite() {
            if !is_parameter_only {
                sorted.divisors.names.push((value, pivot.name.clone()));
            }
        } else if is_parameter_only {
            let is_inertia = matrix.is_symmetric && !indefinite.contains(&matrix.name);
            sorted.conditions.push(pivot_condition(graph, pivot, is_inertia));
            if !is_inertia && let Some(origin) = &pivot.origin {
                sorted.conditions.extend(growth_condition(graph, &pivot.name, origin));
            }
        } else {
            sorted.moving.push((pivot.name.clone(), pivot.expr));
            let mut keeps_sign = || {
                matrix.follows_hessian
                    && *is_a_sum_of_squares.get_or_insert_with(|| equations.hessian_is_a_sum_of_squares())
            };
            if sign == Sign::Unknown && !keeps_sign() {
                let new = || lower::WatchedMatrix { is_symmetric: matrix.is_symmetric, pivots: Vec::new() };
                watched.entry(&matrix.name).or_insert_with(new).pivots.push(pivot.expr);
            }
        }
    }
    sorted.divisors.watched = watched.into_values().collect();
    sorted
}

/// That a pivot of parameters can be divided by, and is positive where it is of an inertia.
fn pivot_condition(graph: &Graph, pivot: &Pivot, is_inertia: bool) -> ParamCondition {
    let (relation, text, meaning) = if is_inertia {
        (
            Relation::Greater,
            format!("{} > 0", pivot.name),
            "the matrix of inertia is positive definite for the default parameters and has to be so for these",
        )
    } else {
        (Relation::NotEqual, defaults::not_zero(&pivot.name), "")
    };
    ParamCondition {
        text,
        meaning: meaning.into(),
        greater: pivot.expr,
        less: graph.zero(),
        relation,
        is_rounded: true,
    }
}

/// That the terms of a pivot are not so much larger than the entries of the matrix that these are lost in their rounding errors; none
/// for the first pivot, which is an entry.
fn growth_condition(graph: &mut Graph, name: &str, origin: &PivotOrigin) -> Option<ParamCondition> {
    if origin.updates.is_empty() {
        return None;
    }
    let size = |graph: &mut Graph, e: ExprId| graph.func(Func::Abs, e);
    let mut terms = vec![size(graph, origin.entry)];
    for update in &origin.updates {
        let product = graph.product(update);
        terms.push(size(graph, product));
    }
    let entries: Vec<ExprId> = origin.entries.iter().map(|e| size(graph, *e)).collect();
    let (terms, entries) = (graph.sum(&terms), graph.sum(&entries));
    Some(ParamCondition {
        text: format!("terms of {name} <= {MAX_GROWTH} entries of its matrix"),
        meaning: "the entries would be lost in the rounding errors of the elimination".into(),
        greater: graph.scale(entries, &Rational::from_integer(MAX_GROWTH.into())),
        less: terms,
        relation: Relation::GreaterEqual,
        is_rounded: false,
    })
}

impl BuiltScene {
    /// Names of the state variables in order.
    pub fn state_names(&self) -> Vec<String> {
        self.state.iter().map(|s| s.name.clone()).collect()
    }

    /// Parameters that the scene leaves free.
    pub fn params(&self) -> &[Param] {
        &self.equations.system.params
    }

    /// Outputs of the scene, besides the right-hand side and the energy.
    pub fn outputs(&self) -> &[Output] {
        &self.outputs
    }

    /// Derivatives that are matrices; their entries are outputs.
    pub fn matrices(&self) -> &[Matrix] {
        &self.matrices
    }

    /// Derivatives that are products with a vector.
    pub fn products(&self) -> &[Product] {
        &self.products
    }

    /// Whether the scene computes the energy.
    pub fn has_energy(&self) -> bool {
        self.program.function(&Role::Energy).is_some()
    }

    /// What it took of the model's budget, from the text to the program.
    pub fn spent(&self) -> Budget {
        self.spent
    }

    /// Documentation of the scene.
    pub fn doc(&self) -> &str {
        &self.doc
    }

    /// Name of the emitted module: the model's, followed by the scene's unless it is the default.
    pub fn module_name(&self) -> String {
        SceneEntry::module_name(&self.equations.system.name, &self.name)
    }

    /// The text of the scene's Rust module.
    ///
    /// # Errors
    /// [`Error::OverBudget`]; [`Error::Emission`], a bug of the emitter.
    pub fn emit(&self) -> Result<String, Error> {
        self.emit_as(&Writing::default())
    }

    /// The text of the scene's Rust module, written down in a given way.
    ///
    /// # Errors
    /// [`Error::NotAPath`] for the runtime; [`Error::OverBudget`]; [`Error::Emission`], a bug of the emitter.
    pub fn emit_as(&self, writing: &Writing) -> Result<String, Error> {
        let budget = self.equations.system.graph.budget();
        let functions = self.program.functions.iter().map(|f| f.instructions.len()).sum::<usize>();
        let n_instructions = (functions + self.program.prepare.instructions.len()) as u64;
        if self.spent.bytes.saturating_add(BYTES_OF_AN_INSTRUCTION * n_instructions) > budget.bytes {
            let exhausted =
                Exhausted { stage: Stage::Emission, resource: Resource::Bytes, limit: budget.bytes };
            return Err(exhausted.into());
        }
        let jet = if self.wants_taylor { Some(self.jet()?) } else { None };
        emit::emit_scene(&self.program, jet.as_ref(), &self.text(writing))
    }

    /// The recurrence of the Taylor coefficients of solutions, whether or not the scene wants it in its module.
    ///
    /// # Errors
    /// [`Error::UnknownName`], a bug: every scene has a right-hand side.
    pub fn jet(&self) -> Result<Jet, Error> {
        let known = || self.program.functions.iter().map(|f| f.role.name().to_owned()).collect();
        let rhs = self.program.function_idx(&Role::Rate).ok_or_else(|| Error::UnknownName {
            name: Role::Rate.name().to_owned(),
            kind: "function of the program",
            known: known(),
        })?;
        Jet::new(&self.program, rhs)
    }

    /// Names of the invariants that the scene wants; none if it wants none.
    pub fn invariant_names(&self) -> Option<Vec<String>> {
        let output = self.outputs.iter().find(|o| o.name == INVARIANTS)?;
        Some(output.components.iter().map(|(name, _)| name.clone()).collect())
    }

    /// The scene with the same parameters and state that wants the right-hand side and the invariants.
    ///
    /// # Errors
    /// [`Error::NothingConserved`], and what lowering can find.
    pub fn with_invariants(&self) -> Result<BuiltScene, Error> {
        let plan = Plan { wants_invariants: true, ..Plan::new(self.name.clone()) };
        lower_scene(self.equations.clone(), plan, self.state.clone(), Vec::new(), false, &BTreeSet::new())
    }

    /// The scene with the same parameters and state that has, besides the right-hand side, the residuals of the constraints
    /// that a state can violate ([`Want::Constraint`]) and the momenta ([`Want::Momentum`]).
    ///
    /// None if there are no such constraints, or if they depend on a coordinate that this scene leaves out; momenta that do
    /// are missing.
    ///
    /// # Errors
    /// What lowering can find.
    pub fn with_residuals(&self) -> Result<Option<BuiltScene>, Error> {
        let graph = &self.equations.system.graph;
        let left_out = left_out(&self.equations, &self.state);
        let group = |want: Want| {
            let found = self.equations.outputs.iter().find(|o| o.name == want.name())?;
            let is_known =
                found.components.iter().all(|(_, e)| !needs(graph, &self.equations, *e, &left_out));
            is_known.then(|| found.clone())
        };
        let Some(residuals) = group(Want::Constraint) else { return Ok(None) };
        let outputs = [residuals].into_iter().chain(group(Want::Momentum)).collect();
        let plan = Plan::new(self.name.clone());
        lower_scene(self.equations.clone(), plan, self.state.clone(), outputs, false, &BTreeSet::new())
            .map(Some)
    }

    /// The entry of the scene in the index of modules.
    pub fn entry(&self) -> SceneEntry {
        SceneEntry {
            module: self.module_name(),
            model: self.equations.system.name.clone(),
            scene: self.name.clone(),
            n_state: self.program.state.len(),
            doc: self.equations.system.doc.first().cloned().unwrap_or_default(),
        }
    }

    fn text(&self, writing: &Writing) -> SceneText {
        let system = &self.equations.system;
        let command = match &writing.command {
            Some(command) => format!("{command} {}", system.name),
            None => format!("do not edit, change the model {}", system.name),
        };
        let mut doc = system.doc.clone();
        if !self.doc.is_empty() {
            doc.push(String::new());
            doc.push(format!("Scene `{}`: {}", self.name, self.doc));
        }
        let energy = "`E = p.y - L`".to_owned();
        let motion = "Lagrange-d'Alembert equations `W^a_b E_a = 0`, \
                      `E_a = d/dt p_a + C^c_ab y^b p_c - rho^i_a dL/dx^i - F_a`, solved for the accelerations"
            .to_owned();
        let formulas = [(Role::Energy, vec![energy]), (Role::Rate, vec![motion])];
        SceneText {
            model: system.name.clone(),
            scene: self.name.clone(),
            command,
            runtime: writing.runtime.clone().unwrap_or_default(),
            doc,
            sources: system.sources.clone(),
            params: system
                .params
                .iter()
                .map(|p| ParamText { name: p.name.clone(), default: p.default.clone(), doc: p.doc.clone() })
                .collect(),
            state: self
                .state
                .iter()
                .map(|s| StateText { name: s.name.clone(), doc: s.doc.clone() })
                .collect(),
            outputs: self
                .outputs
                .iter()
                .map(|o| OutputText {
                    name: o.name.clone(),
                    components: o.components.iter().map(|(name, _)| name.clone()).collect(),
                    doc: o.doc.clone(),
                })
                .collect(),
            matrices: self.matrices.iter().map(matrix_text).collect(),
            products: self.products.iter().map(product_text).collect(),
            formulas: BTreeMap::from(formulas),
            conserves_energy: self.equations.facts.energy_is_conserved,
            groups: None,
        }
    }

    /// Checks parameters and prepares an interpreter for them.
    ///
    /// # Errors
    /// The condition that the parameters violate.
    ///
    /// # Panics
    /// When the number of parameters is wrong.
    pub fn prepare(&self, params: &[f64]) -> Result<Interpreter<'_>, ViolatedCondition> {
        let prepared = self.program.prepare(params)?;
        Ok(Interpreter { scene: self, params: params.to_vec(), prepared })
    }

    /// Operations of every function, per section of the right-hand side, and of the part that runs once.
    pub fn operation_table(&self) -> String {
        let cells = |counts: Counts| vec![counts.to_string()];
        table(self.operations(|role| *role == Role::Rate).into_iter().map(|(name, c)| (name, cells(c))))
    }

    /// Operations of every function and its sections in columns: additions and multiplications include the fused ones. After
    /// them a line for every search for a cheaper form that stopped early, and every function that is computed as it was
    /// derived.
    pub fn operation_columns(&self) -> String {
        let heads = ["add", "mul", "fused", "div", "sqrt", "neg", "calls", "cost"];
        let cells = |c: Counts| {
            let numbers = [c.add, c.mul, c.fma, c.div, c.sqrt, c.neg, c.transcendental];
            let numbers = numbers.into_iter().map(|n| n as u64).chain([c.cost()]);
            numbers.map(|n| format!("{n:>5}")).collect::<Vec<_>>()
        };
        let rows = self.operation_counts();
        let head = (String::new(), heads.map(|head| format!("{head:>5}")).to_vec());
        let rows = rows.into_iter().map(|(name, c)| (name, cells(c)));
        format!("{}{}", table(std::iter::once(head).chain(rows)), self.program.report)
    }

    /// Operations of the part that runs once, of all functions together, and of every function, followed by those of its
    /// sections, whose names begin with spaces.
    pub fn operation_counts(&self) -> Vec<(String, Counts)> {
        let mut total = Counts::default();
        self.program.functions.iter().for_each(|f| total += f.counts());
        let mut rows = self.operations(|_| true);
        rows.insert(1, ("all functions, once each".into(), total));
        rows
    }

    /// Operations of the part that runs once and of every function, and of the sections of some.
    fn operations(&self, by_section: impl Fn(&Role) -> bool) -> Vec<(String, Counts)> {
        let mut rows = vec![("prepare (once per parameter set)".into(), self.program.prepare.counts())];
        for function in self.program.functions.iter().filter(|f| !f.results.is_empty()) {
            rows.push((function.role.name().to_owned(), function.counts()));
            if by_section(&function.role) {
                for (k, title) in self.program.sections.iter().enumerate() {
                    let counts = function.counts_of_section(k);
                    if counts.total() > 0 {
                        rows.push((format!("  {title}"), counts));
                    }
                }
            }
        }
        rows
    }
}

/// What an instruction takes as a syntax tree and as text, about.
const BYTES_OF_AN_INSTRUCTION: u64 = 4096;

/// Rows of a name and cells as lines.
fn table(rows: impl Iterator<Item = (String, Vec<String>)>) -> String {
    let rows: Vec<_> = rows.collect();
    let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    let line = |(name, cells): &(String, Vec<String>)| {
        let pad = " ".repeat(width - name.chars().count());
        format!("  {name}{pad}  {}\n", cells.join("  "))
    };
    rows.iter().map(line).collect()
}

fn matrix_text(matrix: &Matrix) -> MatrixText {
    MatrixText {
        name: matrix.name.to_owned(),
        shape: matrix.shape,
        pattern: matrix.pattern.clone(),
        doc: matrix.doc.to_owned(),
    }
}

fn product_text(product: &Product) -> ProductText {
    ProductText {
        name: product.derivative.name().to_owned(),
        vector: product.vector.to_owned(),
        components: product.components.clone(),
        doc: product.doc.to_owned(),
    }
}

/// A scene's program with prepared parameters, run operation by operation.
#[derive(Clone, Debug)]
pub struct Interpreter<'a> {
    scene: &'a BuiltScene,
    params: Vec<f64>,
    prepared: Vec<f64>,
}

impl Interpreter<'_> {
    /// The scene.
    pub fn scene(&self) -> &BuiltScene {
        self.scene
    }

    fn call(&self, role: &Role, t: f64, y: &[f64], out: &mut [f64]) -> bool {
        let Some(k) = self.scene.program.function_idx(role) else { return false };
        self.scene.program.run(k, &self.params, &self.prepared, t, y, out);
        true
    }

    /// Time derivative of the state.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        self.call(&Role::Rate, t, y, dy);
    }

    /// Derivatives of [`rhs`](Interpreter::rhs) by the components of the state: row `i` has those of component `i`.
    ///
    /// By dual numbers, so that the scene need not want the Jacobian.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs_jacobian(&self, t: f64, y: &[f64], rows: &mut [&mut [f64]]) {
        let Some(k) = self.scene.program.function_idx(&Role::Rate) else { return };
        let constants = |values: &[f64]| values.iter().copied().map(Dual::constant).collect::<Vec<Dual>>();
        let (params, prepared) = (constants(&self.params), constants(&self.prepared));
        let (mut state, mut out) = (constants(y), constants(y));
        for column in 0..y.len() {
            state[column] = Dual::variable(y[column]);
            self.scene.program.run(k, &params, &prepared, Dual::constant(t), &state, &mut out);
            state[column] = Dual::constant(y[column]);
            rows.iter_mut().zip(&out).for_each(|(row, value)| row[column] = value.derivative);
        }
    }

    /// Taylor coefficients of the solution through a state, by the recurrence of [`BuiltScene::jet`].
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series(&self, jet: &Jet, t: f64, y: &[f64], out: &mut [&mut [f64]]) {
        jet.series(&self.params, &self.prepared, t, y, out);
    }

    /// Energy, when the scene wants it.
    pub fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        let mut out = [0.0];
        self.call(&Role::Energy, t, y, &mut out).then_some(out[0])
    }

    /// All outputs, concatenated.
    pub fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        let mut all = Vec::new();
        for output in &self.scene.outputs {
            let mut out = vec![0.0; output.components.len()];
            self.call(&Role::Output(output.name.clone()), t, y, &mut out);
            all.extend(out);
        }
        all
    }

    /// A derivative that is a matrix, row by row, when the scene wants it.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn matrix(&self, derivative: Derivative, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(derivative.name(), t, y)
    }

    /// Invariants of the motion, when the scene wants them, in the order of its output `invariants`.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn invariants(&self, t: f64, y: &[f64]) -> Option<Vec<f64>> {
        let names = self.scene.invariant_names()?;
        let mut values = vec![0.0; names.len()];
        self.call(&Role::Output(INVARIANTS.to_owned()), t, y, &mut values);
        Some(values)
    }

    /// Their gradients, a row for each.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn invariant_gradients(&self, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(GRADIENTS, t, y)
    }

    fn matrix_named(&self, name: &str, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        let matrix = self.scene.matrices.iter().find(|m| m.name == name)?;
        let mut entries = vec![0.0; matrix.pattern.len()];
        self.call(&Role::Output(name.to_owned()), t, y, &mut entries);
        let (n_rows, n_columns) = matrix.shape;
        let mut rows = vec![vec![0.0; n_columns]; n_rows];
        for ((i, j), entry) in matrix.pattern.iter().zip(entries) {
            rows[*i][*j] = entry;
        }
        Some(rows)
    }

    /// A derivative that is a product with `vector`, when the scene wants it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn product(&self, derivative: Derivative, t: f64, y: &[f64], vector: &[f64]) -> Option<Vec<f64>> {
        let product = self.scene.products.iter().find(|p| p.derivative == derivative)?;
        let k = self.scene.program.function_idx(&derivative.role())?;
        let mut out = vec![0.0; product.components.len()];
        let point = Point { t, state: y, argument: vector };
        self.scene.program.run_at(k, &self.params, &self.prepared, point, &mut out);
        Some(out)
    }

    /// Everything that the right-hand side divides by and that may vanish or overflow: names, values, and scales of their
    /// rounding errors, as [`hamel_runtime::Pivot`] has them.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn pivots(&self, t: f64, y: &[f64]) -> Vec<(&str, f64, f64)> {
        let program = &self.scene.program;
        let Some(k) = program.function_idx(&Role::Pivots) else { return Vec::new() };
        let results = &program.functions[k].results;
        let mut out = vec![0.0; results.len()];
        program.run(k, &self.params, &self.prepared, t, y, &mut out);
        let (values, scales) = out.split_at(out.len() / 2);
        let names = results.iter().map(|(name, _)| name.as_str());
        names.zip(values).zip(scales).map(|((name, value), scale)| (name, *value, *scale)).collect()
    }

    /// Why the right-hand side cannot be evaluated here.
    ///
    /// # Errors
    /// The name of the pivot that is not finite, that vanishes, or that rounding errors of its terms could hide.
    pub fn check(&self, t: f64, y: &[f64]) -> Result<(), String> {
        let lost = |(_, value, scale): &(&str, f64, f64)| {
            hamel_runtime::Pivot { name: "", value: *value, scale: *scale }.verify(t).is_err()
        };
        self.pivots(t, y).into_iter().find(lost).map_or(Ok(()), |(name, ..)| Err(name.to_owned()))
    }

    /// The number that stays the same along a motion while no matrix becomes singular; zero if none can.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn signature(&self, t: f64, y: &[f64]) -> f64 {
        let mut out = [0.0];
        self.call(&Role::Signature, t, y, &mut out);
        out[0]
    }

    /// Whether the coordinates lie in their domain.
    ///
    /// # Errors
    /// The first condition that does not hold, such as `theta > 0`.
    pub fn domain(&self, t: f64, y: &[f64]) -> Result<(), String> {
        let is_inside = |value: &f64| *value > 0.0;
        self.guard(&Role::Domain, t, y, |out| out.iter().position(|value| !is_inside(value)))
    }

    /// The name of the result of a function that does not hold.
    fn guard(
        &self,
        role: &Role,
        t: f64,
        y: &[f64],
        broken: impl Fn(&[f64]) -> Option<usize>,
    ) -> Result<(), String> {
        let Some(k) = self.scene.program.function_idx(role) else { return Ok(()) };
        let results = &self.scene.program.functions[k].results;
        let mut out = vec![0.0; results.len()];
        self.scene.program.run(k, &self.params, &self.prepared, t, y, &mut out);
        broken(&out).map_or(Ok(()), |k| Err(results[k].0.clone()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec;

    fn built(text: &str) -> BuiltScene {
        let model = spec::parse("m", text).expect("a valid model");
        build(&model, DEFAULT).expect("a scene")
    }

    #[test]
    fn two_unknowns_with_a_constant_determinant_are_solved_without_a_division() {
        // The inertia is I, and I + q along u = (cos a, sin a): no pivot is a number, the determinant I (I + q) is.
        let scene = built(
            "model m {
                param I = 2 where I > 0;
                param q = 3 where q > 0;
                coordinate a in angle;
                coordinate x, y in real;
                lagrangian = 1/2*a_dot^2 + I/2*(x_dot^2 + y_dot^2) + q/2*(cos(a)*x_dot + sin(a)*y_dot)^2;
            }",
        );
        let rhs = scene.program.function(&Role::Rate).expect("a right-hand side");
        assert_eq!(rhs.counts().div, 0, "{rhs:?}");
        assert!(!scene.emit().expect("a module").contains("fn check"), "nothing can vanish");

        let interpreter = scene.prepare(&[2.0, 3.0]).expect("positive inertia");
        let values = [("a", 0.7), ("x", 0.1), ("y", -0.4), ("a_dot", 1.3), ("x_dot", 0.6), ("y_dot", -0.9)];
        let (names, values): (Vec<&str>, Vec<f64>) = values.into_iter().unzip();
        assert_eq!(scene.state_names(), names);
        let mut rate = [0.0; 6];
        interpreter.rhs(0.0, &values, &mut rate);
        let ([a, _, _, turn, vx, vy], [.., ax, ay]) = (<[f64; 6]>::try_from(values).expect("six"), rate);
        let (sine, cosine) = a.sin_cos();
        let along = cosine * vx + sine * vy;
        let along_rate = turn * (cosine * vy - sine * vx) + cosine * ax + sine * ay;
        // The momentum p = I v + q (u.v) u is conserved.
        let force = [
            2.0 * ax + 3.0 * (along_rate * cosine - along * turn * sine),
            2.0 * ay + 3.0 * (along_rate * sine + along * turn * cosine),
        ];
        // Terms of size one to four, some forty operations.
        assert!(ax.abs() > 0.1 && force.iter().all(|f| f.abs() < 1e-14), "{force:?}");
    }

    #[test]
    fn a_pivot_that_is_rounding_error_alone_is_refused() {
        // The second pivot is y - x^2.
        let scene = built(
            "model m {
                coordinate x, y in real;
                coordinate a, b in real;
                lagrangian = 1/2*(x_dot^2 + y_dot^2 + a_dot^2) + x*a_dot*b_dot + y/2*b_dot^2;
            }",
        );
        let interpreter = scene.prepare(&[]).expect("no parameters");
        let at = |x: f64, y: f64| {
            let state = scene.state_names().into_iter().map(|name| match name.as_str() {
                "x" => x,
                "y" => y,
                _ => 0.5,
            });
            interpreter.check(0.0, &state.collect::<Vec<_>>())
        };
        // 0.1^2 is not exact: the difference is about 1e-18.
        assert_ne!(f64::mul_add(0.1, 0.1, -0.1 * 0.1), 0.0);
        assert!(at(0.1, 0.1 * 0.1).is_err());
        // What can be told from rounding errors is a value.
        assert_eq!(at(0.1, 0.1 * 0.1 * (1.0 + 8.0 * f64::EPSILON)), Ok(()));
        assert!(at(0.0, 0.0).is_err());
    }

    #[test]
    fn a_pivot_that_is_lost_in_the_errors_of_the_one_before_it_is_refused() {
        // The inertia along b is p = y - x^2, that along c, which comes last, z - 2 - w^2/p.
        let scene = built(
            "model m {
                coordinate x, y, z, w in real;
                coordinate a, b, c, d, e in real;
                lagrangian = 1/2*(x_dot^2 + y_dot^2 + z_dot^2 + w_dot^2 + a_dot^2 + d_dot^2 + e_dot^2)
                    + x*a_dot*b_dot + y/2*b_dot^2 + w*b_dot*c_dot + z/2*c_dot^2 + c_dot*d_dot + c_dot*e_dot;
            }",
        );
        let interpreter = scene.prepare(&[]).expect("no parameters");
        let at = |y: f64, relative: f64| {
            let (x, w) = (0.1, 1.0);
            let last = w * w / f64::mul_add(-x, x, y);
            let state = scene.state_names().into_iter().map(|name| match name.as_str() {
                "x" => x,
                "y" => y,
                "z" => 2.0 + last * (1.0 + relative),
                "w" => w,
                _ => 0.5,
            });
            interpreter.check(0.0, &state.collect::<Vec<_>>())
        };
        assert_eq!(at(0.02, 1e-6), Ok(()));
        // 1e-10 of y is left of the first, with an error of 1e-6 of it, and so is what the second is a difference of.
        let refused = at(0.01 * (1.0 + 1e-10), 1e-6).expect_err("the pivot of c");
        assert!(refused.contains("c_dot"), "{refused}");
        assert_eq!(at(0.01 * (1.0 + 1e-10), 1e-3), Ok(()));
    }

    #[test]
    fn parameters_whose_pivot_is_rounding_error_alone_are_refused() {
        let scene = built(
            "model m {
                param p = 1;
                param q = 2;
                coordinate a, b in real;
                lagrangian = 1/2*a_dot^2 + p*a_dot*b_dot + q/2*b_dot^2;
            }",
        );
        let condition = |q: f64| scene.prepare(&[0.1, q]).err().map(|e| e.to_string());
        let refused = condition(0.1 * 0.1).expect("1e-18 is left of 0.01");
        assert!(refused.contains("inertia along b_dot > 0"), "{refused}");
        assert_eq!(condition(0.1 * 0.1 * (1.0 + 16.0 * f64::EPSILON)), None);
        // Overflow: no number is left to divide by.
        assert!(scene.prepare(&[1e200, 1.0]).is_err());
    }

    #[test]
    fn pivots_that_are_sums_of_positive_terms_are_not_asked_for() {
        // The second pivot is c - c^2 d^2/(I + c d^2) = c I/(I + c d^2).
        let scene = built(
            "model m {
                param I = 1 where I > 0;
                param c = 2 where c > 0;
                param d = 3;
                coordinate a, b in real;
                lagrangian = 1/2*((I + c*d^2)*a_dot^2 + c*b_dot^2) + c*d*a_dot*b_dot;
            }",
        );
        let conditions: Vec<&str> =
            scene.program.prepare.conditions.iter().map(|c| c.text.as_str()).collect();
        assert_eq!(conditions, ["I > 0", "c > 0"]);
        // Eliminated as it stands, nothing would be left of c.
        let interpreter = scene.prepare(&[1.0, 1.0, 1e9]).expect("allowed parameters");
        assert_eq!(interpreter.check(0.0, &[0.0; 4]), Ok(()));
    }

    /// `A = [[e, 1], [1, q]]` with these defaults.
    fn coupled(e: &str, q: &str) -> BuiltScene {
        built(&format!(
            "model m {{
                param e = {e};
                param q = {q};
                coordinate a, b in real;
                lagrangian = e/2*a_dot^2 + a_dot*b_dot + q/2*b_dot^2;
            }}"
        ))
    }

    #[test]
    fn an_inertia_that_is_definite_by_default_has_to_be_so_for_all_parameters() {
        let scene = coupled("2", "3");
        let texts: Vec<&str> = scene.program.prepare.conditions.iter().map(|c| c.text.as_str()).collect();
        assert_eq!(texts, ["inertia along a_dot > 0", "inertia along b_dot > 0"]);
        let refused = scene.prepare(&[2.0, 0.4]).expect_err("det = -0.2");
        assert_eq!(refused.condition, "inertia along b_dot > 0");
        assert!(refused.meaning.contains("positive definite"), "{refused}");
        assert!(scene.prepare(&[-2.0, -3.0]).is_err(), "negative definite");
        assert!(scene.prepare(&[1e-9, 1.1e9]).is_ok(), "growth is no matter there");
    }

    #[test]
    fn a_lagrangian_that_is_indefinite_by_default_is_refused_where_its_entries_are_lost() {
        let scene = coupled("1", "-1");
        // x = (e b2 - b1)/(e q - 1) and the like, of any sign.
        for (e, q) in [(1.0, -1.0), (1.0, 3.0), (-2.0, 0.25), (0.01, -0.02)] {
            assert!(scene.prepare(&[e, q]).is_ok(), "{e} {q}");
        }
        // The second pivot is q - 1/e: nothing is left of q.
        let lost = scene.prepare(&[1e-15, 0.3]).expect_err("growth of 1e15");
        assert_eq!(lost.condition, "terms of inertia along b_dot <= 1024 entries of its matrix");
        assert!(lost.meaning.contains("rounding errors"), "{lost}");
        assert!(scene.prepare(&[0.0, 1.0]).is_err() && scene.prepare(&[2.0, 0.5]).is_err());
    }

    #[test]
    fn pivots_that_can_change_their_sign_are_watched_and_no_others() {
        let watches = |lagrangian: &str| {
            let text =
                format!("model m {{ param k = 2; coordinate x, w in real; lagrangian = {lagrangian}; }}");
            built(&text).program.function_idx(&Role::Signature).is_some()
        };
        assert!(watches("1/2*(1 - x^2)*x_dot^2 + 1/2*w_dot^2 - 1/2*w^2"));
        assert!(watches("1/2*x_dot^2 + x*x_dot*w_dot + 1/2*w_dot^2"));
        // Proved positive; squares, whose sum has no negative eigenvalue; parameters.
        assert!(!watches("1/2*(1 + x^2)*x_dot^2 + 1/2*w_dot^2"));
        assert!(!watches("1/2*x^2*x_dot^2 + 1/2*(w_dot + sin(x)*x_dot)^2"));
        assert!(!watches("1/2*(w_dot + cos(x)*x_dot)^2 + 1/2*(w_dot - x*x_dot)^2 - x + w_dot"));
        assert!(!watches("k/2*x_dot^2 + x_dot*w_dot + 1/2*w_dot^2 - cos(x)"));
    }

    #[test]
    fn the_signature_changes_where_a_matrix_becomes_singular() {
        // Two pivots, 1 - x^2 and then 4 - x^2 - w^2/(1 - x^2).
        let scene = built(
            "model m {
                coordinate x, w in real;
                lagrangian = 1/2*(1 - x^2)*x_dot^2 + w*x_dot*w_dot + 1/2*(4 - x^2)*w_dot^2;
            }",
        );
        let interpreter = scene.prepare(&[]).expect("no parameters");
        let at = |x: f64, w: f64| {
            assert_eq!(scene.state_names()[..2], ["x", "w"]);
            interpreter.signature(0.0, &[x, w, 0.3, 0.4])
        };
        // The number of negative eigenvalues: none, one, one, two.
        let count = |x: f64, w: f64| {
            let (a, d) = (1.0 - x * x, 4.0 - x * x);
            let determinant = a * d - w * w;
            if determinant < 0.0 { 0.0 } else { 2.0 * f64::signum(a + d) }
        };
        for (x, w) in [(0.0, 0.0), (0.5, 0.3), (0.0, 3.0), (1.5, 0.2), (1.5, -4.0), (3.0, 0.1), (-3.0, 0.5)] {
            assert_eq!(at(x, w), count(x, w), "{x} {w}");
        }
        // On the line x = 1 a pivot is zero.
        assert!(at(1.0, 0.5).is_nan());
        let text = scene.emit().expect("a module");
        assert!(text.contains("fn signature(&self, t: R, y: &[R; 4]) -> R"), "{text}");
    }

    #[test]
    fn a_pivot_that_is_not_finite_is_refused_whatever_its_sign() {
        let scene = built("model m { coordinate x in real; lagrangian = 1/2*(1 + x^2)*x_dot^2; }");
        let interpreter = scene.prepare(&[]).expect("no parameters");
        let mut rate = [0.0; 2];
        interpreter.rhs(0.0, &[1e160, 1.0], &mut rate);
        assert_eq!(rate[1].abs(), 0.0, "x' = -x x'^2/(1 + x^2) is 1e-160");
        assert_eq!(interpreter.check(0.0, &[1e160, 1.0]), Err("inertia along x_dot".into()));
        assert_eq!(interpreter.check(0.0, &[1e150, 1.0]), Ok(()));
    }

    #[test]
    fn divisors_of_the_model_are_checked_by_their_formula() {
        let scene = built(
            "model m {
                param k = 2;
                coordinate x, y in real;
                lagrangian = 1/2*(x_dot^2 + y_dot^2) + k/sqrt(x^2 + y^2) + cos(x)/(2 + sin(y)) + 1/(x - y)^2;
            }",
        );
        let interpreter = scene.prepare(&[2.0]).expect("a number");
        let names: Vec<&str> = interpreter.pivots(0.0, &[0.3, 0.4, 0.0, 0.0]).iter().map(|p| p.0).collect();
        assert!(names.contains(&"x^2 + y^2"), "{names:?}");
        assert!(names.iter().any(|n| ["x - y", "-x + y", "y - x"].contains(n)), "{names:?}");
        assert_eq!(interpreter.check(0.0, &[0.0; 4]), Err(names[0].into()));
        assert!(interpreter.check(0.0, &[0.5, 0.5, 0.0, 0.0]).is_err());
        assert_eq!(interpreter.check(0.0, &[0.5, 0.25, 0.0, 0.0]), Ok(()));
    }
}
