//! The one place that calls the generator: model files in, scenes to evaluate, text and facts out.
//!
//! Deliberately does not know: commands, files that are written, JSON.

use std::collections::{BTreeMap, BTreeSet};
use std::io::IsTerminal as _;
use std::sync::Mutex;
use std::sync::OnceLock;

pub use hamel_codegen::emit::SceneEntry as Entry;
use hamel_codegen::expr::{Budget, Graph, Style, rational_to_f64};
use hamel_codegen::program::{self, Counts, Function, Jet};
use hamel_codegen::reduction;
use hamel_codegen::scene::{self, BuiltScene, Interpreter};
use hamel_codegen::spec::{self, ConnectionKind, Diagnostics, Domain, ReconstructionKind, circle_names};
pub use hamel_codegen::spec::{Kind, Model, Want};
use hamel_runtime::{Failure, Pivot};

use crate::dynamics::{BadParams, Dynamics, Factory, Info, OutputEntry, ParamEntry, VecState};
use crate::error::Error;
use crate::workspace::{Spec, Workspace};

/// Name of the scene that every model has.
pub const DEFAULT_SCENE: &str = scene::DEFAULT;

/// Reads and checks a model file; warnings about it go to standard error.
///
/// # Errors
/// [`Error::Io`], [`Error::Models`] with every problem of the text, [`Error::Misnamed`].
pub fn read(workspace: &Workspace, spec: &Spec) -> Result<Model, Error> {
    let shown = workspace.shown(&spec.path);
    let text = std::fs::read_to_string(&spec.path).map_err(|e| Error::io(shown.clone(), e))?;
    let model = parse(&shown, &text)?;
    if spec.in_repository && model.name != spec.name {
        return Err(Error::Misnamed { file: shown, model: model.name });
    }
    show_warnings(&model.warnings);
    Ok(model)
}

/// Writes warnings to standard error.
pub fn show_warnings(warnings: &Diagnostics) {
    if !warnings.is_empty() {
        let is_coloured = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
        eprintln!("{}", warnings.render(is_coloured));
    }
}

/// How many times the default budget every model has.
static BUDGET: OnceLock<u64> = OnceLock::new();

/// Gives every model that is read from here on so many times the default budget; only the first call counts.
pub fn set_budget(n: u64) {
    _ = BUDGET.set(n);
}

/// Reads and checks the text of a model; `file` is shown in messages.
///
/// # Errors
/// [`Error::Models`] with every problem of the text.
pub fn parse(file: &str, text: &str) -> Result<Model, Error> {
    let budget = Budget::default().times(BUDGET.get().copied().unwrap_or(1));
    Ok(spec::parse_within(budget, file, text)?)
}

/// Names of a model's scenes, the default first.
pub fn scene_names(model: &Model) -> Vec<String> {
    scene::names(model)
}

/// Whether a model's scene says that it wants something, such as [`INVARIANTS`].
pub fn wants(model: &Model, scene_name: &str, what: &str) -> bool {
    let own = model.scenes.iter().find(|scene| scene.name == scene_name);
    own.is_some_and(|scene| scene.wants.iter().any(|want| want.name() == what))
}

/// Whether a state can violate a constraint of a scene without the scene's own outputs telling it; the automatic
/// scenes with all outputs would.
///
/// # Errors
/// [`Error::Models`].
pub fn hides_residuals(model: &Model, scene_name: &str) -> Result<bool, Error> {
    let has_all = [DEFAULT_SCENE, RECONSTRUCTION_SCENE].contains(&scene_name)
        && model.scenes.iter().all(|scene| scene.name != scene_name);
    Ok(!has_all && scene::has_residuals(model)?)
}

/// What a scene wants that has its invariants compiled.
pub const INVARIANTS: &str = scene::INVARIANTS;

/// A scene that the interpreter evaluates.
#[derive(Debug)]
pub struct Built {
    scene: BuiltScene,
    info: Info,
    /// The same with its invariants, built when first asked for; none if there are none.
    with_invariants: OnceLock<Option<BuiltScene>>,
}

/// Derives and lowers a scene.
///
/// # Errors
/// [`Error::UnknownScene`], [`Error::Models`].
pub fn build(model: &Model, scene_name: &str) -> Result<Built, Error> {
    let mut known = scene_names(model);
    if !known.iter().any(|k| k == scene::DERIVATIVES) {
        // Built when it is asked for: it is emitted only for models that declare it.
        known.push(scene::DERIVATIVES.to_owned());
    }
    if !known.iter().any(|k| k == scene_name) {
        return Err(Error::UnknownScene { model: model.name.clone(), name: scene_name.into(), known });
    }
    Ok(built(model, scene::build(model, scene_name)?))
}

/// Derives and lowers a scene with everything that a report shows: see [`scene::build_pictured`].
///
/// # Errors
/// As [`build`].
pub fn build_pictured(model: &Model, scene_name: &str) -> Result<Built, Error> {
    Ok(built(model, scene::build_pictured(model, scene_name)?))
}

fn built(model: &Model, scene: BuiltScene) -> Built {
    let param = |p: &spec::Param| ParamEntry {
        name: p.name.clone(),
        default: rational_to_f64(&p.default),
        doc: p.doc.clone(),
    };
    let info = Info {
        model: model.name.clone(),
        scene: scene.name.clone(),
        state: scene.state_names(),
        params: scene.params().iter().map(param).collect(),
        outputs: scene.outputs().iter().map(output_entry).collect(),
        has_energy: scene.has_energy(),
        conserves_energy: scene.has_energy() && scene.equations.facts.energy_is_conserved,
    };
    Built { scene, info, with_invariants: OnceLock::new() }
}

fn output_entry(output: &hamel_codegen::mechanics::Output) -> OutputEntry {
    OutputEntry {
        name: output.name.clone(),
        components: output.components.iter().map(|(name, _)| name.clone()).collect(),
        doc: output.doc.clone(),
    }
}

/// Why a name cannot be that of a model, or nothing.
pub fn name_refusal(name: &str) -> Option<&'static str> {
    spec::name_refusal(name)
}

/// A parameter or a state variable as a page shows it.
#[derive(Clone, Debug)]
pub struct Quantity {
    /// Name in the code.
    pub name: String,
    /// Name in MathML.
    pub math: String,
    /// Default, of a parameter.
    pub value: Option<f64>,
    /// Unit; may be empty.
    pub unit: String,
    /// What it is, without the unit.
    pub doc: String,
}

/// What a view draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ViewKind {
    /// A cuboid.
    Box,
    /// A disk.
    Disk,
    /// A ball.
    Ball,
    /// A line between two points.
    Segment,
    /// A point.
    Point,
    /// What a point leaves behind.
    Path,
}

/// A view of a model.
#[derive(Clone, Debug)]
pub struct ViewEntry {
    /// Its name.
    pub name: String,
    /// Its documentation.
    pub doc: String,
    /// What it draws.
    pub kind: ViewKind,
    /// The output of [`build_pictured`] that has its numbers.
    pub output: String,
}

/// All that a page says about a scene, but for its motion.
#[derive(Clone, Debug)]
pub struct Page {
    /// Name of the model.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// First line of the documentation.
    pub title: String,
    /// The other lines.
    pub doc: Vec<String>,
    /// Kind of system.
    pub kind: String,
    /// Where it comes from.
    pub sources: Vec<String>,
    /// Free parameters.
    pub params: Vec<Quantity>,
    /// Conditions on them.
    pub conditions: Vec<String>,
    /// State variables.
    pub state: Vec<Quantity>,
    /// Text of the model file.
    pub text: String,
    /// Words of the model language.
    pub keywords: Vec<&'static str>,
    /// Titles and HTML of the explanation.
    pub sections: Vec<(String, String)>,
    /// The generated right-hand side.
    pub rhs: String,
    /// The generated module.
    pub module: String,
    /// Additions, multiplications, fused ones, divisions, roots, signs, calls and cost by function and section.
    pub operations: Vec<(String, Vec<u64>)>,
    /// What figures in space show.
    pub views: Vec<ViewEntry>,
}

/// Collects what a page says about a scene.
///
/// # Errors
/// As [`build`], and a bug of the emitter.
pub fn page(model: &Model, scene_name: &str) -> Result<Page, Error> {
    let Built { scene, .. } = build(model, scene_name)?;
    show_warnings(&scene::warnings(model, std::slice::from_ref(&scene)));
    let math = |name: &str| {
        let mut graph = Graph::new();
        let symbol = graph.symbol(name);
        let symbol = graph.sym(symbol);
        graph.display(symbol, Style::MathMl)
    };
    let quantity = |name: &str, value: Option<f64>, doc: &str| {
        let (doc, unit) = split_unit(doc, 0);
        Quantity { name: name.to_owned(), math: math(name), value, unit, doc }
    };
    let own = ["", "Parameters and state", "Operation counts"];
    let sections = hamel_codegen::explain::sections(model, &scene, Style::MathMl)
        .into_iter()
        .filter(|s| !own.contains(&s.title.as_str()))
        .map(|s| (s.title, s.text))
        .collect();
    let module = scene.emit().map_err(|e| model.diagnostics(vec![model.diagnose(&e)]))?;
    let view = |v: &spec::View| ViewEntry {
        name: v.name.clone(),
        doc: v.doc.clone(),
        kind: match v.shape {
            spec::ViewShape::Box { .. } => ViewKind::Box,
            spec::ViewShape::Disk { .. } => ViewKind::Disk,
            spec::ViewShape::Ball { .. } => ViewKind::Ball,
            spec::ViewShape::Segment => ViewKind::Segment,
            spec::ViewShape::Point => ViewKind::Point,
            spec::ViewShape::Path => ViewKind::Path,
        },
        output: scene::view_output(&v.name),
    };
    Ok(Page {
        model: model.name.clone(),
        scene: scene_name.to_owned(),
        title: model.doc.first().filter(|t| !t.trim().is_empty()).unwrap_or(&model.name).trim().to_owned(),
        doc: model.doc.iter().skip(1).cloned().collect(),
        kind: model.kind().to_string(),
        sources: model.sources.clone(),
        params: scene
            .params()
            .iter()
            .map(|p| quantity(&p.name, Some(rational_to_f64(&p.default)), &p.doc))
            .collect(),
        conditions: scene.equations.system.conditions.iter().map(|c| c.text.clone()).collect(),
        state: scene.state.iter().map(|s| quantity(&s.name, None, &s.doc)).collect(),
        text: model.origin.as_ref().map(|o| o.text.clone()).unwrap_or_default(),
        keywords: spec::keywords(),
        sections,
        rhs: function(&module, "    pub fn rhs("),
        operations: scene
            .operation_counts()
            .into_iter()
            .map(|(name, c)| {
                let numbers = [c.add, c.mul, c.fma, c.div, c.sqrt, c.neg, c.transcendental];
                (name, numbers.into_iter().map(|n| n as u64).chain([c.cost()]).collect())
            })
            .collect(),
        module,
        views: model.views.list.iter().map(view).collect(),
    })
}

/// The lines of a method of the module, from `head` to the brace that ends it, without their common indentation.
fn function(module: &str, head: &str) -> String {
    let Some(start) = module.find(head) else { return String::new() };
    let mut lines = Vec::new();
    for line in module[start..].lines() {
        lines.push(line.strip_prefix("    ").unwrap_or(line));
        if line == "    }" {
            break;
        }
    }
    lines.join("\n")
}

impl Built {
    /// The scene with the same parameters and state that has the residuals of the constraints that a state can violate, and
    /// the momenta; none if there are no such constraints.
    pub fn with_residuals(&self) -> Option<Built> {
        let scene = self.scene.with_residuals().ok()??;
        let outputs = scene.outputs().iter().map(output_entry).collect();
        let info = Info { outputs, has_energy: false, ..self.info.clone() };
        Some(Built { scene, info, with_invariants: OnceLock::new() })
    }

    /// Operations of one evaluation of the right-hand side.
    pub fn rhs_counts(&self) -> Counts {
        let program = &self.scene.program;
        // Every scene has a right-hand side.
        program.function(&program::Role::Rate).map_or_else(Counts::default, Function::counts)
    }
}

impl Factory for Built {
    fn info(&self) -> &Info {
        &self.info
    }

    fn prepare(&self, values: &[f64]) -> Result<Box<dyn Dynamics + '_>, BadParams> {
        let interpreter = self
            .scene
            .prepare(values)
            .map_err(|bad| BadParams { condition: bad.condition, meaning: bad.meaning })?;
        let (jet, invariants) = (OnceLock::new(), OnceLock::new());
        Ok(Box::new(Interpreted { built: self, params: values.to_vec(), interpreter, jet, invariants }))
    }
}

struct Interpreted<'a> {
    built: &'a Built,
    params: Vec<f64>,
    interpreter: Interpreter<'a>,
    /// The recurrence of Taylor coefficients, derived when first asked for; none only by a bug of the generator.
    jet: OnceLock<Option<Jet>>,
    /// The interpreter of the scene with invariants.
    invariants: OnceLock<Option<Interpreter<'a>>>,
}

impl<'a> Interpreted<'a> {
    fn with_invariants(&self) -> Option<&Interpreter<'a>> {
        let interpreter = self.invariants.get_or_init(|| {
            let scene = self.built.with_invariants.get_or_init(|| self.built.scene.with_invariants().ok());
            scene.as_ref()?.prepare(&self.params).ok()
        });
        interpreter.as_ref()
    }
}

impl Dynamics for Interpreted<'_> {
    fn info(&self) -> &Info {
        &self.built.info
    }

    fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        self.interpreter.rhs(t, y, dy);
    }

    fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        self.interpreter.energy(t, y)
    }

    fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        self.interpreter.outputs(t, y)
    }

    fn series(&self, t: f64, y: &[f64], out: &mut [VecState]) -> bool {
        let Some(jet) = self.jet.get_or_init(|| self.interpreter.scene().jet().ok()) else { return false };
        let mut out: Vec<&mut [f64]> = out.iter_mut().map(|state| state.0.as_mut_slice()).collect();
        self.interpreter.series(jet, t, y, &mut out);
        true
    }

    fn jacobian(&self, t: f64, y: &[f64], rows: &mut [VecState]) {
        let mut rows: Vec<&mut [f64]> = rows.iter_mut().map(|row| row.0.as_mut_slice()).collect();
        self.interpreter.rhs_jacobian(t, y, &mut rows);
    }

    fn rhs_cost(&self) -> Option<u64> {
        Some(self.built.rhs_counts().cost())
    }

    fn n_invariants(&self) -> Option<usize> {
        Some(self.with_invariants().and_then(|i| i.scene().invariant_names()).map_or(0, |names| names.len()))
    }

    fn invariants(&self, t: f64, y: &[f64], values: &mut [f64]) {
        if let Some(found) = self.with_invariants().and_then(|i| i.invariants(t, y)) {
            values.copy_from_slice(&found);
        }
    }

    fn invariant_gradients(&self, t: f64, y: &[f64], gradients: &mut [VecState]) {
        let rows = self.with_invariants().and_then(|i| i.invariant_gradients(t, y)).unwrap_or_default();
        gradients.iter_mut().zip(rows).for_each(|(gradient, row)| gradient.0 = row);
    }

    fn check(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        self.interpreter.pivots(t, y).into_iter().try_for_each(|(name, value, scale)| {
            let verified = Pivot { name: "", value, scale }.verify(t);
            verified.or_else(|_| Pivot { name: forever(name.to_owned()), value, scale }.verify(t))
        })
    }

    fn domain(&self, t: f64, y: &[f64]) -> Result<(), Failure> {
        let outside = |condition| Failure::OutsideDomain { t, condition: forever(condition) };
        self.interpreter.domain(t, y).map_err(outside)
    }

    fn signature(&self, t: f64, y: &[f64]) -> f64 {
        self.interpreter.signature(t, y)
    }

    fn pivots(&self, t: f64, y: &[f64], visit: &mut dyn FnMut(Pivot<f64>)) {
        for (name, value, scale) in self.interpreter.pivots(t, y) {
            visit(Pivot { name: forever(name.to_owned()), value, scale });
        }
    }
}

/// The runtime's failures borrow from the program for ever, so each pivot's name and each condition is kept once.
fn forever(name: String) -> &'static str {
    static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
    let mut kept = KEPT.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    if let Some(known) = kept.get(name.as_str()) {
        return known;
    }
    let name: &'static str = name.leak();
    kept.insert(name);
    name
}

/// The same system written with another connection: `trivial`, `mechanical` or `nonholonomic`.
///
/// # Errors
/// [`Error::Models`] when the system has no such connection.
pub fn with_connection(model: &Model, connection: &str) -> Result<Model, Error> {
    // The command line admits the three names only.
    let kind = ConnectionKind::from_name(connection).unwrap_or(ConnectionKind::Trivial);
    Ok(reduction::with_connection(model, kind)?)
}

/// Explains a scene in text, or in LaTeX; what its defaults make of it goes to standard error.
///
/// # Errors
/// As [`build`].
pub fn explain(model: &Model, scene_name: &str, latex: bool) -> Result<String, Error> {
    let built = build(model, scene_name)?;
    show_warnings(&scene::warnings(model, std::slice::from_ref(&built.scene)));
    let style = if latex { Style::Latex } else { Style::Unicode };
    Ok(hamel_codegen::explain::explain(model, &built.scene, style))
}

/// Operation counts of a scene by function and section.
///
/// # Errors
/// As [`build`].
pub fn operations(model: &Model, scene_name: &str) -> Result<String, Error> {
    let built = build(model, scene_name)?;
    show_warnings(&scene::warnings(model, std::slice::from_ref(&built.scene)));
    Ok(built.scene.operation_columns())
}

/// What a state variable is.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub enum Role {
    /// A coordinate in an open interval.
    Bounded {
        /// Lower end.
        from: f64,
        /// Upper end.
        to: f64,
    },
    /// An angle or a coordinate on the real line.
    Unbounded,
    /// A velocity.
    Velocity,
    /// A coordinate of the group.
    Group {
        /// Its value at the identity.
        identity: f64,
    },
    /// A component of an advected parameter.
    Advected {
        /// Which component.
        index: usize,
        /// Of how many.
        n: usize,
    },
}

/// Values of all parameters of a model: its defaults, what a scene fixes, and `given`.
pub fn all_params(model: &Model, scene_name: &str, given: &BTreeMap<String, f64>) -> BTreeMap<String, f64> {
    let mut values: BTreeMap<String, f64> =
        model.params.iter().map(|p| (p.name.clone(), rational_to_f64(&p.default))).collect();
    for scene in model.scenes.iter().filter(|s| s.name == scene_name) {
        values.extend(scene.fixed.iter().map(|(name, value)| (name.clone(), rational_to_f64(value))));
    }
    values.extend(given.iter().map(|(name, value)| (name.clone(), *value)));
    values
}

/// What the possible state variables of a model are.
pub fn roles(model: &Model, params: &BTreeMap<String, f64>) -> BTreeMap<String, Role> {
    let symbols = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?))).collect();
    let mut roles = BTreeMap::new();
    for coordinate in &model.base {
        let role = match coordinate.domain {
            Domain::Interval(from, to) => {
                match (model.graph.eval_f64(from, &symbols), model.graph.eval_f64(to, &symbols)) {
                    (Some(from), Some(to)) => Role::Bounded { from, to },
                    _ => Role::Unbounded,
                }
            }
            Domain::Angle | Domain::Real => Role::Unbounded,
        };
        roles.insert(coordinate.name.clone(), role);
        // A scene may carry it as a point of the circle.
        for (index, name) in circle_names(&coordinate.name).into_iter().enumerate() {
            roles.insert(name, Role::Advected { index, n: 2 });
        }
    }
    for (name, _) in model.all_velocities() {
        roles.insert(name.to_owned(), Role::Velocity);
    }
    for velocity in &model.quasi_velocities {
        roles.insert(velocity.name.clone(), Role::Velocity);
    }
    for item in &model.reconstruction {
        let has_quaternion =
            matches!(item.kind, ReconstructionKind::Quaternion { .. } | ReconstructionKind::Pose { .. });
        for (k, name) in item.names.iter().enumerate() {
            let identity = if has_quaternion && k == 0 { 1.0 } else { 0.0 };
            roles.insert(name.clone(), Role::Group { identity });
        }
    }
    for advected in &model.advected {
        let n = advected.components.len();
        for (index, (name, _)) in advected.components.iter().enumerate() {
            roles.insert(name.clone(), Role::Advected { index, n });
        }
    }
    roles
}

/// Name of the scene that a simulation with the group's coordinates runs.
pub const RECONSTRUCTION_SCENE: &str = scene::RECONSTRUCTION;

/// Names of the coordinates of the group that a model reconstructs, in the order of the scene's state; may be empty.
pub fn group_coordinates(model: &Model) -> Vec<String> {
    model.reconstruction.iter().flat_map(|item| item.names.clone()).collect()
}

/// Where the coordinates of the group start, in the order of [`group_coordinates`]: as the model's `initial` says,
/// otherwise at the identity.
pub fn group_start(model: &Model, params: &BTreeMap<String, f64>) -> Vec<f64> {
    let params = all_params(model, RECONSTRUCTION_SCENE, params);
    let (roles, preferred) = (roles(model, &params), initial_values(model, &params));
    let start = |name: &String| match (preferred.get(name), roles.get(name)) {
        (Some(value), _) => *value,
        (None, Some(Role::Group { identity })) => *identity,
        (None, _) => 0.0,
    };
    group_coordinates(model).iter().map(start).collect()
}

/// The initial values that a model gives, those of angles also as points of the circle.
pub fn initial_values(model: &Model, params: &BTreeMap<String, f64>) -> BTreeMap<String, f64> {
    let symbols = model.params.iter().filter_map(|p| Some((p.symbol, *params.get(&p.name)?))).collect();
    let value = |e| model.graph.eval_f64(e, &symbols).filter(|x| x.is_finite());
    let given = model.initial.iter().filter_map(|(name, e)| Some((name.clone(), value(*e)?)));
    let mut values: BTreeMap<String, f64> = given.collect();
    for coordinate in &model.base {
        let middle = || match coordinate.domain {
            Domain::Interval(from, to) => Some((value(from)? + value(to)?) / 2.0),
            Domain::Angle | Domain::Real => None,
        };
        if let Some(angle) = values.get(&coordinate.name).copied().or_else(middle) {
            values.extend(circle_names(&coordinate.name).into_iter().zip([angle.cos(), angle.sin()]));
        }
    }
    values
}

/// State variables that belong together in a figure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Block {
    /// Symbol of the vector, or nothing for a group of scalars.
    pub symbol: String,
    /// What they are, without the unit.
    pub doc: String,
    /// Their unit; empty when it is unknown or one.
    pub unit: String,
    /// Names of the members, and how they are spelled for people.
    pub members: Vec<(String, String)>,
}

/// Groups the possible state variables of a model: coordinates and their velocities by unit, vectors as they are.
pub fn blocks(model: &Model) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut scalars: Vec<Block> = Vec::new();
    let mut rates: Vec<Block> = Vec::new();
    let add = |list: &mut Vec<Block>, unit: String, doc: &str, name: &str| {
        let member = (name.to_owned(), spell(name));
        match list.iter_mut().find(|b| b.unit == unit) {
            Some(block) => {
                block.members.push(member);
                block.doc = if block.doc == doc { doc.to_owned() } else { String::new() };
            }
            None => {
                list.push(Block { symbol: String::new(), doc: doc.to_owned(), unit, members: vec![member] })
            }
        }
    };
    for coordinate in &model.base {
        let (doc, unit) = split_unit(&coordinate.doc, 0);
        let unit = match (unit.is_empty(), coordinate.domain) {
            (true, Domain::Angle) => "rad".to_owned(),
            _ => unit,
        };
        add(&mut scalars, unit.clone(), &doc, &coordinate.name);
        let rate = match unit.as_str() {
            "" => String::new(),
            unit => format!("{unit}/s"),
        };
        let doc = if doc.is_empty() { String::new() } else { format!("Rate of {}", lower_first(&doc)) };
        add(&mut rates, rate, &doc, &coordinate.velocity_name);
    }
    for (list, several) in [(scalars, "Coordinates"), (rates, "Velocities of the coordinates")] {
        for mut block in list {
            if block.members.len() > 1 && block.doc.is_empty() {
                block.doc = several.to_owned();
            }
            blocks.push(block);
        }
    }
    let mut seen: Vec<(&str, &str)> = Vec::new();
    for velocity in model.velocities.iter().chain(&model.quasi_velocities) {
        let member = (velocity.name.clone(), spell(&velocity.name));
        if seen.contains(&(velocity.block.as_str(), velocity.doc.as_str()))
            && let Some(block) = blocks.last_mut()
        {
            block.members.push(member);
            continue;
        }
        // One line of documentation may describe several blocks, each with its own unit.
        let position = seen.iter().filter(|(_, doc)| *doc == velocity.doc).count();
        seen.push((&velocity.block, &velocity.doc));
        let (doc, unit) = split_unit(&velocity.doc, position);
        blocks.push(Block { symbol: spell(&velocity.block), doc, unit, members: vec![member] });
    }
    for advected in &model.advected {
        let (doc, unit) = split_unit(&advected.doc, 0);
        let members = advected.components.iter().map(|(name, _)| (name.clone(), spell(name)));
        blocks.push(Block { symbol: spell(&advected.name), doc, unit, members: members.collect() });
    }
    for item in &model.reconstruction {
        // A pose is two things of different units.
        let n_turn = match item.kind {
            ReconstructionKind::PlanarPose { .. } => 1,
            ReconstructionKind::Pose { .. } => 4,
            _ => 0,
        };
        let (turn, rest) = item.names.split_at(n_turn);
        let is_described_apart = item.doc.matches('[').count() > 1;
        for (names, what) in [(turn, "Attitude"), (rest, "Position")] {
            if names.is_empty() {
                continue;
            }
            let position = usize::from(n_turn > 0 && what == "Position" && is_described_apart);
            let (mut doc, mut unit) = split_unit(&item.doc, position);
            if n_turn > 0 && !is_described_apart {
                doc = what.to_owned();
                if what == "Attitude" {
                    unit = if n_turn == 1 { "rad".to_owned() } else { String::new() };
                }
            }
            if doc.is_empty() {
                doc = "Group".to_owned();
            }
            let members = names.iter().map(|name| (name.clone(), spell(name))).collect();
            blocks.push(Block { symbol: String::new(), doc, unit, members });
        }
    }
    blocks
}

/// A name as people write it, such as `Ω₁`.
pub fn spell(name: &str) -> String {
    let mut graph = Graph::new();
    let symbol = graph.symbol(name);
    let symbol = graph.sym(symbol);
    let spelled = graph.display(symbol, Style::Unicode);
    match spelled.rsplit_once('_') {
        Some((head, digits)) if !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()) => {
            const SUBSCRIPTS: [char; 10] = ['₀', '₁', '₂', '₃', '₄', '₅', '₆', '₇', '₈', '₉'];
            let second: String = digits.bytes().map(|b| SUBSCRIPTS[usize::from(b - b'0')]).collect();
            let comma = if head.ends_with(SUBSCRIPTS) { "," } else { "" };
            format!("{head}{comma}{second}")
        }
        _ => spelled,
    }
}

fn upper_first(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map(|c| c.to_uppercase().chain(chars).collect()).unwrap_or_default()
}

fn lower_first(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map(|c| c.to_lowercase().chain(chars).collect()).unwrap_or_default()
}

/// Splits `Angular velocity [rad/s].` into text and the unit at a position, the last unit when there are fewer.
///
/// Of `Turning rate [rad/s] and velocity [m/s].`, each position has its own text.
fn split_unit(doc: &str, position: usize) -> (String, String) {
    let mut text = String::new();
    let mut texts: Vec<&str> = Vec::new();
    let mut units: Vec<&str> = Vec::new();
    let mut rest = doc;
    while let Some((before, after)) = rest.split_once('[')
        && let Some((unit, after)) = after.split_once(']')
    {
        text.push_str(before.trim_end());
        texts.push(before);
        units.push(unit.trim());
        rest = after;
    }
    text.push_str(rest);
    if let (true, Some(part)) = (texts.len() > 1, texts.get(position)) {
        let part = part.trim_start_matches([',', ';', ' ']);
        text = upper_first(part.strip_prefix("and ").unwrap_or(part).trim_end());
        if position + 1 == texts.len() {
            text.push_str(rest);
        }
    }
    let text = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let unit = units.get(position).or(units.last()).copied().unwrap_or_default();
    let unit = if unit == "-" || unit == "1" { "" } else { unit };
    let unit = unit.replace("^2", "²").replace("^3", "³").replace(' ', "·");
    (text.trim_end_matches('.').to_owned(), unit)
}

#[cfg(test)]
mod tests {
    use super::{spell, split_unit};

    #[test]
    fn names_are_spelled_with_subscripts() {
        let spelled = ["Omega1", "r1_2", "q_3", "psi_dot"].map(spell);
        assert_eq!(spelled, ["Ω₁", "r₁,₂", "q₃", "ψ̇"]);
    }

    #[test]
    fn units_are_read_from_documentation() {
        assert_eq!(split_unit("Mass [kg].", 0), ("Mass".into(), "kg".into()));
        assert_eq!(split_unit("Inertia [kg m^2].", 0).1, "kg·m²");
        assert_eq!(split_unit("Direction [-].", 0), ("Direction".into(), String::new()));
        let both = "Turning rate [rad/s] and velocity [m/s].";
        assert_eq!(split_unit(both, 0).1, "rad/s");
        assert_eq!(split_unit(both, 0).0, "Turning rate");
        assert_eq!(split_unit(both, 1), ("Velocity".into(), "m/s".into()));
        let both = "Angular velocity [rad/s] and velocity [m/s] in the body frame.";
        assert_eq!(split_unit(both, 1).0, "Velocity in the body frame");
        assert_eq!(split_unit("Anything", 0), ("Anything".into(), String::new()));
    }
}
