//! What the commands do, given their arguments.
//!
//! Deliberately does not know: how arguments are parsed.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::{IsTerminal as _, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use hamel_codegen::config::write_atomically;
use serde_json::{Map, Value};

use crate::admissible;
use crate::auto;
use crate::backend::{Backend, Local};
use crate::codegen_bridge::{self as bridge, Kind, Model};
use crate::compiled::Remote;
use crate::dynamics::Info;
use crate::error::{Error, Problem};
use crate::eval::EvalRequest;
use crate::eval::prepare;
use crate::files::{Run, Target};
use crate::generate;
use crate::initial;
use crate::json::number;
use crate::report;
use crate::simulate::{MethodName, SimulateRequest, SimulateResponse, Steps, has_state, samples_refusal};
use crate::workspace::{Spec, Workspace};

/// Who evaluates a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Via {
    /// The generated and compiled module, in another process.
    #[default]
    Compiled,
    /// The lowered program, operation by operation, in this process.
    Interpreter,
}

/// Which scene, and who evaluates it.
#[derive(Clone, Debug)]
pub struct Choice {
    /// A model's name or a path that ends in `.hamel`.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// Who evaluates it.
    pub via: Via,
}

impl Choice {
    /// The same model with the coordinates of the group; `path` is how the user asked for them.
    ///
    /// # Errors
    /// [`Error::Request`] when the model does not reconstruct any, or when another scene than the default was chosen;
    /// [`Error::UnknownScene`].
    pub fn reconstructing(&self, model: &Model, path: &str) -> Result<Choice, Error> {
        let known = bridge::scene_names(model);
        if !known.contains(&self.scene) {
            return Err(Error::UnknownScene { model: model.name.clone(), name: self.scene.clone(), known });
        }
        let fail = |reason: String| Error::Request {
            problems: vec![Problem::Unusable { path: path.to_owned(), reason }],
        };
        if model.reconstruction.is_empty() {
            return Err(fail(format!(
                "is not possible: {} does not say how the group moves; leave it out, or add `reconstruct .. ;` to \
                 the model",
                model.name
            )));
        }
        if self.scene != bridge::DEFAULT_SCENE {
            return Err(fail(format!(
                "chooses the scene itself, but scene {} is chosen as well: leave out --scene {}, and give parameters \
                 that it fixes as values; or leave out {path}",
                self.scene, self.scene
            )));
        }
        Ok(Choice { scene: bridge::RECONSTRUCTION_SCENE.to_owned(), ..self.clone() })
    }

    /// The scene as a method needs it: what was compiled without its invariants is interpreted for a projection onto them.
    fn suited_to(&self, model: &Model, method: MethodName) -> Choice {
        let has_invariants = || bridge::wants(model, &self.scene, bridge::INVARIANTS);
        if method != MethodName::Projected || self.via == Via::Interpreter || has_invariants() {
            return self.clone();
        }
        eprintln!(
            "note: scene {} does not want `invariants`, so it is evaluated by the interpreter, which finds them",
            self.scene
        );
        Choice { via: Via::Interpreter, ..self.clone() }
    }

    /// The scene, ready to answer. A file outside the repository was never compiled, so it is interpreted.
    ///
    /// # Errors
    /// Unknown names, problems of the model, [`Error::NotCompiled`].
    pub fn open(&self, workspace: &Workspace, spec: &Spec) -> Result<Box<dyn Backend>, Error> {
        let via = if spec.in_repository { self.via } else { Via::Interpreter };
        if via != self.via {
            eprintln!(
                "note: {} is not one of the repository's models, so it is evaluated by the interpreter",
                spec.path.display()
            );
        }
        match via {
            Via::Compiled => Ok(Box::new(Remote::open(workspace, &spec.name, &self.scene)?)),
            Via::Interpreter => {
                let model = bridge::read(workspace, spec)?;
                Ok(Box::new(Local::new(bridge::build(&model, &self.scene)?)))
            }
        }
    }
}

/// `generate`: a line about what was done.
///
/// # Errors
/// As [`generate::generate`].
pub fn generate(workspace: &Workspace, models: &[String], check: bool) -> Result<String, Error> {
    let done = generate::generate(workspace, models, check)?;
    let mut line = format!("{} models, {} scenes in {:.2} s", done.n_models, done.n_modules, done.seconds);
    if let (Some((name, seconds)), true) = (&done.slowest, done.n_models > 1) {
        let _ = write!(line, " (slowest: {name}, {seconds:.2} s)");
    }
    line.push_str(": ");
    if check {
        line.push_str("generated files are up to date");
    } else if done.written.is_empty() && done.removed.is_empty() {
        line.push_str("nothing changed");
    } else {
        let _ = write!(line, "{} files written", done.written.len());
        if !done.removed.is_empty() {
            let _ = write!(line, ", {} removed", done.removed.len());
        }
    }
    Ok(line)
}

/// A model to start from, with `NAME` for its name.
const STARTER: &str = include_str!("starter.hamel");

/// `new`: writes a model to start from, and says what to do with it.
///
/// # Errors
/// [`Error::BadName`] for a name that a model cannot have; [`Error::NoFolder`]; [`Error::Exists`]; [`Error::Io`].
pub fn new(workspace: &Workspace, model: &str) -> Result<String, Error> {
    let path = match model.strip_suffix(".hamel") {
        Some(_) => PathBuf::from(model),
        None => workspace.specs_folder().join(format!("{model}.hamel")),
    };
    let name = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    // Without the ending, all of it is the name, also what looks like a folder.
    let name = if model.ends_with(".hamel") { name } else { model };
    if let Some(reason) = bridge::name_refusal(name) {
        let instead: String = name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
        let instead = Some(instead).filter(|instead| bridge::name_refusal(instead).is_none());
        return Err(Error::BadName { name: name.to_owned(), reason, instead });
    }
    let text = STARTER.replace("NAME", name);
    let shown = workspace.shown(&path);
    bridge::parse(&shown, &text)?;
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir());
    if let Some(folder) = folder {
        return Err(Error::NoFolder { file: shown, folder: workspace.shown(folder) });
    }
    let fail = |e: std::io::Error| match e.kind() {
        std::io::ErrorKind::AlreadyExists => Error::Exists { file: shown.clone() },
        _ => Error::io(shown.clone(), e),
    };
    let mut file = std::fs::File::create_new(&path).map_err(fail)?;
    file.write_all(text.as_bytes()).map_err(fail)?;
    let is_ours = path.parent() == Some(&workspace.specs_folder());
    // A model of the repository is compiled only after `generate`; any other one is interpreted anyway.
    let (argument, via) = if is_ours { (name, " --via interpreter") } else { (model, "") };
    let last = match is_ours {
        true => "  cargo xtask generate",
        false => "In a crate of its own, a build script generates it: docs/build-rs.md",
    };
    let lines = [
        &format!("{shown} is a model to start from. Look at it, change it, and try:"),
        &format!("  cargo xtask explain {argument}"),
        &format!("  cargo xtask simulate {argument}{via} --reconstruct -o {name}.svg"),
        last,
    ];
    Ok(lines.join("\n"))
}

struct Listed {
    name: String,
    kind: Kind,
    title: String,
    sources: Vec<String>,
    scenes: Vec<(String, Info)>,
}

/// `list`: all models, or those named, for people or as JSON.
///
/// # Errors
/// Unknown names; the problems of all models together.
pub fn list(workspace: &Workspace, models: &[String], json: bool) -> Result<String, Error> {
    let specs = if models.is_empty() {
        workspace.specs()?
    } else {
        models.iter().map(|m| workspace.spec(m)).collect::<Result<_, _>>()?
    };
    let mut listed = Vec::new();
    let mut errors = Vec::new();
    // Every scene is derived and lowered, which takes a second for the largest models.
    let described: Vec<_> = std::thread::scope(|scope| {
        let started: Vec<_> = specs.iter().map(|spec| scope.spawn(|| describe(workspace, spec))).collect();
        started.into_iter().map(|thread| thread.join()).collect()
    });
    for outcome in described {
        match outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic)) {
            Ok(entry) => listed.push(entry),
            Err(error) => errors.push(error),
        }
    }
    if !errors.is_empty() {
        return Err(Error::Several { errors });
    }
    if json {
        return Ok(Value::from_iter(listed.iter().map(Listed::to_json)).to_string());
    }
    let width = terminal_width();
    listed.sort_by_key(|entry| entry.kind);
    let mut text = String::new();
    for group in listed.chunk_by(|a, b| a.kind == b.kind) {
        let _ = writeln!(text, "{}\n", bold(&format!("[{}]", group[0].kind)));
        for entry in group {
            let _ = writeln!(text, "{}", entry.to_text(width));
        }
    }
    Ok(text.trim_end().to_owned())
}

fn describe(workspace: &Workspace, spec: &Spec) -> Result<Listed, Error> {
    let model = bridge::read(workspace, spec)?;
    let mut scenes = Vec::new();
    for name in bridge::scene_names(&model) {
        let built = bridge::build(&model, &name)?;
        scenes.push((name, crate::dynamics::Factory::info(&built).clone()));
    }
    Ok(Listed {
        name: model.name.clone(),
        kind: model.kind(),
        title: title(&model.doc),
        sources: model.sources.clone(),
        scenes,
    })
}

impl Listed {
    fn to_json(&self) -> Value {
        let scene = |(name, info): &(String, Info)| {
            let mut outputs = Map::new();
            for group in &info.outputs {
                outputs.insert(group.name.clone(), group.components.clone().into());
            }
            let params: Value = info.params.iter().map(|p| (p.name.clone(), number(p.default))).collect();
            let mut entry = Map::new();
            entry.insert("scene".into(), name.clone().into());
            entry.insert("state".into(), info.state.clone().into());
            entry.insert("params".into(), params);
            entry.insert("outputs".into(), outputs.into());
            entry.insert("has_energy".into(), info.has_energy.into());
            Value::from(entry)
        };
        let mut entry = Map::new();
        entry.insert("model".into(), self.name.clone().into());
        entry.insert("title".into(), self.title.clone().into());
        entry.insert("sources".into(), self.sources.clone().into());
        entry.insert("scenes".into(), self.scenes.iter().map(scene).collect());
        entry.into()
    }

    fn to_text(&self, width: usize) -> String {
        let mut text = format!("{}  {}\n", bold(&self.name), self.title);
        let mut row = |label: &str, items: Vec<String>, separator: &str| {
            if items.is_empty() {
                return;
            }
            let lines = wrap(&items, separator, width.saturating_sub(12).max(30));
            for (k, line) in lines.iter().enumerate() {
                let _ = writeln!(text, "  {:8}  {line}", if k == 0 { label } else { "" });
            }
        };
        let values = |info: &Info| {
            info.params.iter().map(|p| format!("{} = {}", p.name, p.default)).collect::<Vec<String>>()
        };
        for (k, (name, info)) in self.scenes.iter().enumerate() {
            if k == 0 {
                row("state", info.state.clone(), " ");
                row("params", values(info), ", ");
                continue;
            }
            let default = &self.scenes[0].1;
            let fixed = default.params.iter().filter(|p| info.params.iter().all(|q| q.name != p.name));
            let fixed: Vec<String> = fixed.map(|p| p.name.clone()).collect();
            let mut parts = Vec::new();
            if !fixed.is_empty() {
                parts.push(format!("fixes {}", fixed.join(", ")));
            }
            if info.state != default.state {
                parts.push(format!("state {}", info.state.join(" ")));
            }
            let colon = if parts.is_empty() { "" } else { ": " };
            let line = format!("{name}{colon}{}", parts.join("; "));
            row("scene", line.split_whitespace().map(str::to_owned).collect(), " ");
        }
        for source in &self.sources {
            let words = source.split_whitespace().map(str::to_owned).collect();
            row("source", words, " ");
        }
        text
    }
}

fn wrap(items: &[String], separator: &str, width: usize) -> Vec<String> {
    let mut lines: Vec<String> = vec![String::new()];
    let mut length = 0;
    for (k, item) in items.iter().enumerate() {
        let piece = if k + 1 < items.len() { format!("{item}{separator}") } else { item.clone() };
        let size = piece.chars().count();
        if length > 0 && length + piece.trim_end().chars().count() > width {
            lines.push(String::new());
            length = 0;
        }
        length += size;
        // There is always a last line.
        if let Some(line) = lines.last_mut() {
            line.push_str(&piece);
        }
    }
    lines.into_iter().map(|line| line.trim_end().to_owned()).collect()
}

fn terminal_width() -> usize {
    let columns = std::env::var("COLUMNS").ok().and_then(|c| c.parse().ok());
    columns.unwrap_or(100_usize).clamp(60, 140)
}

fn bold(text: &str) -> String {
    if colours_on_stdout() { format!("\u{1b}[1m{text}\u{1b}[0m") } else { text.to_owned() }
}

fn colours_on_stdout() -> bool {
    std::io::stdout().is_terminal() && std::env::var_os("NO_COLOR").is_none()
}

fn title(doc: &[String]) -> String {
    doc.iter().map(|line| line.trim()).find(|line| !line.is_empty()).unwrap_or_default().to_owned()
}

/// What `explain` shows of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aspect {
    /// Algebra, equations and a summary of operation counts, in Unicode.
    Text,
    /// The same as a LaTeX fragment.
    Latex,
    /// Operation counts by function and section.
    Operations,
}

/// `explain`: algebra, equations and operation counts of a scene.
///
/// # Errors
/// Unknown names and problems of the model.
pub fn explain(
    workspace: &Workspace,
    model: &str,
    scene: &str,
    aspect: Aspect,
    connection: Option<&str>,
) -> Result<String, Error> {
    let spec = workspace.spec(model)?;
    let mut model = bridge::read(workspace, &spec)?;
    if let Some(connection) = connection {
        model = bridge::with_connection(&model, connection)?;
    }
    match aspect {
        Aspect::Operations => bridge::operations(&model, scene),
        Aspect::Text | Aspect::Latex => bridge::explain(&model, scene, aspect == Aspect::Latex),
    }
}

/// Reads a request from standard input, and says so when nobody seems to know.
///
/// # Errors
/// [`Error::Io`].
pub fn read_request(example: &str) -> Result<String, Error> {
    let stdin = std::io::stdin();
    if stdin.is_terminal() {
        eprintln!("reading a JSON request such as {example} from the terminal; end it with Ctrl-D");
    }
    let mut text = String::new();
    stdin.lock().read_to_string(&mut text).map_err(|e| Error::io("standard input", e))?;
    Ok(text)
}

/// `eval`: the answer to a JSON request, on one line.
///
/// # Errors
/// Everything that can be wrong with names, the request, parameters and states.
pub fn eval(workspace: &Workspace, choice: &Choice) -> Result<String, Error> {
    let spec = workspace.spec(&choice.model)?;
    let text = read_request("{\"states\": [{\"Omega1\": 0.1, ..}]}")?;
    let mut backend = choice.open(workspace, &spec)?;
    eval_text(&mut *backend, &text)
}

/// Evaluates a JSON request.
///
/// # Errors
/// As [`EvalRequest::parse`] and [`crate::eval::eval`].
pub fn eval_text(backend: &mut dyn Backend, text: &str) -> Result<String, Error> {
    let request = EvalRequest::parse(text, backend.info())?;
    let response = backend.eval(&request)?;
    Ok(response.to_json(backend.info()).to_string())
}

/// `simulate --json`: the answer to a JSON request, on one line.
///
/// # Errors
/// Everything that can be wrong with names, the request, parameters, the initial state and the integration.
pub fn simulate_json(workspace: &Workspace, choice: &Choice) -> Result<String, Error> {
    let spec = workspace.spec(&choice.model)?;
    let text = read_request("{\"initial\": {\"Omega1\": 0.1, ..}, \"t_final\": 1}")?;
    let (reconstructs, projects) =
        (SimulateRequest::asks_to_reconstruct(&text)?, SimulateRequest::asks_to_project(&text)?);
    if !reconstructs && !projects {
        let mut backend = choice.open(workspace, &spec)?;
        // The default scene has what there is, so that nobody has to read the model.
        if choice.scene != bridge::DEFAULT_SCENE && !admissible::is_judged_by(backend.info()) {
            let model = bridge::read(workspace, &spec)?;
            judge(&model, &SimulateRequest::parse(&text, backend.info())?, backend.info())?;
        }
        return simulate_text(&mut *backend, &text);
    }
    let model = bridge::read(workspace, &spec)?;
    let reconstructing = reconstructs.then(|| choice.reconstructing(&model, "reconstruct")).transpose()?;
    let method = if projects { MethodName::Projected } else { MethodName::default() };
    let choice = reconstructing.as_ref().unwrap_or(choice).suited_to(&model, method);
    let mut backend = choice.open(workspace, &spec)?;
    if reconstructs {
        return reconstruct_text(&mut *backend, &model, &text);
    }
    judge(&model, &SimulateRequest::parse(&text, backend.info())?, backend.info())?;
    simulate_text(&mut *backend, &text)
}

/// Checks that the initial state of a request keeps the constraints, where the scene leaves out what tells that.
///
/// # Errors
/// [`Error::Inadmissible`].
fn judge(model: &Model, request: &SimulateRequest, info: &Info) -> Result<(), Error> {
    if let Some(scene) = residuals(model, info)? {
        admissible::check(&*prepare(&scene, &request.params)?, &request.initial, request.n_group)?;
    }
    Ok(())
}

/// The scene with the residuals of constraints that a state can violate, unless it has them itself; none if there are none.
fn residuals(model: &Model, info: &Info) -> Result<Option<bridge::Built>, Error> {
    if admissible::is_judged_by(info) || !bridge::hides_residuals(model, &info.scene)? {
        return Ok(None);
    }
    Ok(bridge::build(model, &info.scene)?.with_residuals())
}

/// Integrates as a JSON request says.
///
/// # Errors
/// As [`SimulateRequest::parse`] and [`crate::simulate::simulate`].
pub fn simulate_text(backend: &mut dyn Backend, text: &str) -> Result<String, Error> {
    let request = SimulateRequest::parse(text, backend.info())?;
    let response = backend.simulate(&request)?;
    warn(&response);
    Ok(response.to_json(backend.info(), request.n_group).to_string())
}

/// Integrates as a JSON request with `reconstruct` says; the backend is that of the scene with the group's coordinates.
///
/// # Errors
/// As [`simulate_text`], and when the scene's state does not end with the coordinates that the model reconstructs.
pub fn reconstruct_text(backend: &mut dyn Backend, model: &Model, text: &str) -> Result<String, Error> {
    let n_group = n_group(backend.info(), model)?;
    let defaults = |params: &BTreeMap<String, f64>| bridge::group_start(model, params);
    let request = SimulateRequest::parse_with_group(text, backend.info(), n_group, &defaults)?;
    let response = backend.simulate(&request)?;
    warn(&response);
    Ok(response.to_json(backend.info(), request.n_group).to_string())
}

/// Tells the warnings of an integration on standard error.
fn warn(response: &SimulateResponse) {
    response.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
}

/// Number of coordinates of the group at the end of a scene's state.
fn n_group(info: &Info, model: &Model) -> Result<usize, Error> {
    let group = bridge::group_coordinates(model);
    if info.state.ends_with(&group) {
        return Ok(group.len());
    }
    Err(Error::NotCompiled {
        what: format!("scene {} of {}", info.scene, info.model),
        reason: format!("its state does not end with {}, as the model says", group.join(", ")),
    })
}

/// Arguments of `simulate` for people.
#[derive(Clone, Debug, Default)]
pub struct Simulation {
    /// Parameters that differ from the defaults.
    pub set: Vec<(String, f64)>,
    /// Components of the initial state that differ from the default one.
    pub initial: Vec<(String, f64)>,
    /// Whether the coordinates of the group are integrated as well.
    pub reconstruct: bool,
    /// Time to reach.
    pub t_final: f64,
    /// The method.
    pub method: MethodName,
    /// Relative tolerance.
    pub rtol: Option<f64>,
    /// Absolute tolerance.
    pub atol: Option<f64>,
    /// Size of fixed steps.
    pub step: Option<f64>,
    /// Largest number of steps.
    pub max_steps: Option<u64>,
    /// Number of samples in files.
    pub samples: Option<usize>,
    /// Files to write.
    pub outputs: Vec<PathBuf>,
}

/// Samples in files unless another number is given: smooth curves, small files.
const DEFAULT_SAMPLES: usize = 1001;

/// `simulate`: integrates, writes files, and returns a summary for people.
///
/// # Errors
/// Everything that can be wrong with names, values, the integration and files.
pub fn simulate(workspace: &Workspace, choice: &Choice, arguments: &Simulation) -> Result<String, Error> {
    let spec = workspace.spec(&choice.model)?;
    let targets: Vec<Target> = arguments.outputs.iter().map(|p| Target::new(p)).collect::<Result<_, _>>()?;
    let model = bridge::read(workspace, &spec)?;
    let reconstructing;
    let choice = if arguments.reconstruct {
        reconstructing = choice.reconstructing(&model, "--reconstruct")?;
        &reconstructing
    } else {
        choice
    };
    let known = bridge::scene_names(&model);
    if !known.contains(&choice.scene) {
        return Err(Error::UnknownScene { model: model.name, name: choice.scene.clone(), known });
    }
    let steps = Steps::new(arguments.method, arguments.rtol, arguments.atol, arguments.step)
        .map_err(|reason| Problem::Unusable { path: "--step".into(), reason })
        .map_err(|problem| Error::Request { problems: vec![problem] })?;
    let method = match (arguments.method, steps) {
        (MethodName::Auto, Steps::Adaptive { rtol, .. }) => {
            // Compiled code does not say what it costs.
            let cost = bridge::build(&model, &choice.scene)?.rhs_counts().cost();
            let is_interpreted = choice.via == Via::Interpreter || !spec.in_repository;
            auto::choose(rtol, Some(cost), is_interpreted || bridge::wants(&model, &choice.scene, "taylor"))
        }
        (method, _) => method,
    };
    let mut backend = choice.suited_to(&model, method).open(workspace, &spec)?;
    let info = backend.info().clone();
    has_state(&info)?;
    let n_group = if arguments.reconstruct { n_group(&info, &model)? } else { 0 };
    let mut problems = Vec::new();
    let set = assignments(&arguments.set, "--set", "parameter", &info.param_names(), &mut problems);
    let given = assignments(&arguments.initial, "--initial", "state", &info.state_names(), &mut problems);
    if !problems.is_empty() {
        let group = bridge::group_coordinates(&model);
        let is_of_group =
            |p: &Problem| matches!(p, Problem::UnknownName { name, .. } if group.contains(name));
        if !arguments.reconstruct && problems.iter().any(is_of_group) {
            let reason = format!(
                "takes {} with --reconstruct only, which integrates these coordinates of the group as well",
                group.join(", ")
            );
            problems.push(Problem::Unusable { path: "--initial".into(), reason });
        }
        return Err(Error::Request { problems });
    }
    let samples = arguments.samples.unwrap_or(if targets.is_empty() { 0 } else { DEFAULT_SAMPLES });
    if let Some(reason) = samples_refusal(samples as u64, &info, !targets.is_empty()) {
        let problems = vec![Problem::Unusable { path: "--samples".into(), reason }];
        return Err(Error::Request { problems });
    }
    let (params, initial) = Starts::new(&model, &info)?.choose(&mut *backend, &set, &given)?;
    let request = SimulateRequest {
        params,
        initial,
        t_final: arguments.t_final,
        method,
        steps,
        samples,
        with_outputs: !targets.is_empty(),
        n_group,
        max_steps: arguments.max_steps.unwrap_or(steps.max_steps()),
    };
    let response = backend.simulate(&request)?;
    warn(&response);
    let title = title(&model.doc);
    let blocks = bridge::blocks(&model);
    let run = Run { info: &info, title: &title, blocks: &blocks, request: &request, response: &response };
    for target in &targets {
        target.write(&run)?;
    }
    let mut text = summary(&info, &title, &request, &response);
    for target in &targets {
        let _ = write!(text, "\nwrote {} ({} samples)", target.path().display(), response.samples.len());
    }
    Ok(text)
}

/// Arguments of `report`.
#[derive(Clone, Debug)]
pub struct Report {
    /// A model's name or a path that ends in `.hamel`.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// The file; the model's name with `.html` unless given.
    pub output: Option<PathBuf>,
    /// Whether a motion is integrated and shown.
    pub run: bool,
    /// Time to reach.
    pub t_final: f64,
}

/// `report`: writes one page about a scene and says where.
///
/// The motion is that of the scene with every coordinate and output, by the interpreter, so that nothing is compiled.
///
/// # Errors
/// Unknown names, problems of the model, a motion that cannot be integrated, and files.
pub fn report(workspace: &Workspace, arguments: &Report) -> Result<String, Error> {
    let clock = Instant::now();
    let spec = workspace.spec(&arguments.model)?;
    let model = bridge::read(workspace, &spec)?;
    let page = bridge::page(&model, &arguments.scene)?;
    let motion = if arguments.run { Some(motion(&model, arguments)?) } else { None };
    let text = report::page(&page, motion.as_ref())?;
    let path = arguments.output.clone().unwrap_or_else(|| PathBuf::from(format!("{}.html", model.name)));
    let shown = path.display().to_string();
    write_atomically(&path, text.as_bytes()).map_err(|e| Error::io(shown.clone(), e))?;
    let (size, seconds) = (text.len() as f64 / 1e3, clock.elapsed().as_secs_f64());
    Ok(format!("wrote {shown} ({size:.0} kB, {seconds:.1} s)"))
}

fn motion(model: &Model, arguments: &Report) -> Result<report::Motion, Error> {
    let params = bridge::all_params(model, &arguments.scene, &BTreeMap::new());
    let (roles, preferred) = (bridge::roles(model, &params), bridge::initial_values(model, &params));
    let mut full = Local::new(bridge::build_pictured(model, &arguments.scene)?);
    let info = full.info().clone();
    let values = info.defaults();
    let initial = initial::state(&mut full, None, (&values, &[]), &roles, &preferred, &BTreeMap::new())?;
    let request = SimulateRequest {
        params: values,
        initial,
        t_final: arguments.t_final,
        method: MethodName::Dop853,
        steps: Steps::Adaptive { rtol: Steps::RTOL, atol: Steps::ATOL },
        samples: report::SAMPLES,
        with_outputs: true,
        n_group: 0,
        max_steps: report::MAX_STEPS,
    };
    let response = full.simulate(&request)?;
    // Accuracy is compared without outputs and without the coordinates of the group.
    let mut bare = Local::new(bridge::build(model, &arguments.scene)?);
    let start = bare.info().state.iter().map(|name| {
        let at = info.state.iter().position(|s| s == name);
        at.map_or(0.0, |at| request.initial[at])
    });
    let bare_request =
        SimulateRequest { initial: start.collect(), samples: 0, with_outputs: false, ..request.clone() };
    let precision = report::Precision::measure(arguments.t_final, |method, steps| {
        bare.simulate(&SimulateRequest { method, steps, ..bare_request.clone() })
    });
    Ok(report::Motion { info, blocks: bridge::blocks(model), request, response, precision })
}

/// Chooses parameters and initial states of a scene.
pub(crate) struct Starts<'a> {
    model: &'a Model,
    info: &'a Info,
    /// Has the residual of the constraint where the scene itself leaves it out.
    residuals: Option<bridge::Built>,
}

impl<'a> Starts<'a> {
    pub(crate) fn new(model: &'a Model, info: &'a Info) -> Result<Starts<'a>, Error> {
        Ok(Starts { model, info, residuals: residuals(model, info)? })
    }

    /// Parameters with those in `set`, and an initial state with the components in `given`; `backend` is that of the scene.
    pub(crate) fn choose(
        &self,
        backend: &mut dyn Backend,
        set: &BTreeMap<String, f64>,
        given: &BTreeMap<String, f64>,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let params: Vec<f64> =
            self.info.params.iter().map(|p| set.get(&p.name).copied().unwrap_or(p.default)).collect();
        let all_params = bridge::all_params(self.model, &self.info.scene, set);
        let roles = bridge::roles(self.model, &all_params);
        let preferred = bridge::initial_values(self.model, &all_params);
        let mut other = self.residuals.as_ref().map(Local::new);
        let other = other.as_mut().map(|local| local as &mut dyn Backend);
        let initial = initial::state(backend, other, (&params, &params), &roles, &preferred, given)?;
        // What the user gave may leave nothing to choose.
        if let Some(scene) = &self.residuals {
            admissible::check(&*prepare(scene, &params)?, &initial, 0)?;
        }
        Ok((params, initial))
    }
}

/// Values by name, each once and known; `path` is the option that gave them.
pub(crate) fn assignments(
    given: &[(String, f64)],
    path: &str,
    kind: &'static str,
    known: &[&str],
    problems: &mut Vec<Problem>,
) -> BTreeMap<String, f64> {
    let mut values = BTreeMap::new();
    for (name, value) in given {
        let name = name.clone();
        if !known.contains(&name.as_str()) {
            let known = known.iter().map(|k| (*k).to_owned()).collect();
            problems.push(Problem::UnknownName { path: path.into(), kind, name, known });
        } else if values.insert(name.clone(), *value).is_some() {
            problems.push(Problem::Repeated { path: path.into(), name });
        }
    }
    values
}

fn summary(info: &Info, title: &str, request: &SimulateRequest, response: &SimulateResponse) -> String {
    let mut text = format!("{}  {title}", bold(&info.model));
    if info.scene != bridge::DEFAULT_SCENE {
        let _ = write!(text, ", scene {}", info.scene);
    }
    let steps = match request.steps {
        Steps::Adaptive { rtol, atol } => format!("rtol {rtol:e}, atol {atol:e}"),
        Steps::Fixed { step } => format!("step {step:?}"),
    };
    let _ = write!(
        text,
        "\n  t = {:?} by {}, {steps}: {} steps, {} rejected, {} evaluations, {:.1} ms",
        response.t,
        request.method.name(),
        response.steps,
        response.rejected,
        response.rhs_evals,
        1e3 * response.seconds
    );
    if let Steps::Adaptive { rtol, atol } = request.steps {
        let largest = request.initial.iter().chain(&response.last).fold(0.0_f64, |max, y| max.max(y.abs()));
        if largest > 0.0 && rtol * largest < atol {
            let _ = write!(
                text,
                "\n  note: no component is above {largest:.1e}, so that atol = {atol:e} is all that bounds the error: \
                 give a smaller --atol, or 0"
            );
        }
    }
    if let (Some(drift), Some(initial)) = (response.energy_drift, response.initial_energy) {
        let scale = if response.energy_scale == initial.abs() { "|E(0)|" } else { "the size of its terms" };
        let word = if info.conserves_energy { "drift" } else { "largest change" };
        let _ =
            write!(text, "\n  energy     {initial:.6e} at the start, {word} {drift:.1e} relative to {scale}");
    }
    if let Some(residual) = response.constraint_residual {
        let _ = write!(text, "\n  constraint residual at most {residual:.1e}");
    }
    let width = info.state.iter().map(|s| s.chars().count()).max().unwrap_or(0).max(5);
    let _ = write!(text, "\n\n  {:width$}  {:>24}  {:>24}", "", "initial", "final");
    for ((name, start), end) in info.state.iter().zip(&request.initial).zip(&response.last) {
        let _ = write!(text, "\n  {name:width$}  {:>24}  {:>24}", format!("{start:?}"), format!("{end:?}"));
    }
    text
}

/// `test`: the whole test suite, then crates outside the workspace that use hamel as others do.
///
/// # Errors
/// [`Error::Failed`] with the step that failed; later steps are not run.
pub fn test(workspace: &Workspace) -> Result<String, Error> {
    let downstream = workspace.root().join("tests/downstream");
    // They share one directory for what they compile: the generator above all.
    let compiled = workspace.root().join("target/downstream");
    let steps: [(&str, &Path, &[&str], Option<&Path>); 4] = [
        ("cargo test --workspace", workspace.root(), &["test", "--workspace"], None),
        // Apart, because the solvers of others bring much to compile.
        (
            "cargo test of the adapters",
            workspace.root(),
            &["test", "--package", "hamel-adapters", "--all-features"],
            None,
        ),
        ("cargo test in tests/downstream", &downstream, &["test", "--locked"], Some(&compiled)),
        (
            "cargo run in tests/downstream_no_std",
            &downstream,
            &["run", "--locked", "--package", "hamel-downstream-no-std"],
            Some(&compiled),
        ),
    ];
    let mut lines = Vec::new();
    for (name, folder, arguments, target) in steps {
        eprintln!("{}", bold(&format!("running {name}")));
        let clock = Instant::now();
        let mut command = Command::new(Workspace::cargo());
        command.args(arguments).current_dir(folder);
        command.envs(target.map(|target| ("CARGO_TARGET_DIR", target)));
        let status = command.status().map_err(|e| Error::io("cargo could not be started", e))?;
        if !status.success() {
            let status = format!("{status}; the steps before it passed, later ones were not run");
            return Err(Error::Failed { step: name.into(), status });
        }
        lines.push(format!("passed  {name}  ({:.1} s)", clock.elapsed().as_secs_f64()));
    }
    Ok(lines.join("\n"))
}
