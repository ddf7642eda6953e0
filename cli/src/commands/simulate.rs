//! `simulate`: a motion from an initial state, as a summary and files for people or as JSON in and out.
//!
//! Does not know: how anything is integrated, what a request looks like, how files are written.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Args;
use hamel_codegen::scene::{self, Prior, told_in_words};
use hamel_codegen::spec::{MatrixFluid, Want};

use super::options::{EndOptions, MotionOptions, NoiseOptions, SceneOptions, assignments};
use crate::output::columns::Chosen;
use crate::output::crossings::{Crossings, EventTarget, OpenEventTarget};
use crate::output::fields::{self, fields};
use crate::output::files::{OpenTarget, Run, Target};
use crate::output::plot::field::{self, Field};
use crate::output::terminal::bold;
use hamel_run::asked::{Asked, Words};
use hamel_run::bars::simulate_with_bar;
use hamel_run::dynamics::Factory;
use hamel_run::error::{Error, Problem};
use hamel_run::fit::Follows as _;
use hamel_run::follow::Follower;
use hamel_run::forms::Forms;
use hamel_run::info::Info;
use hamel_run::integrate::has_state;
use hamel_run::interrupts::Shield;
use hamel_run::length::method_of_long;
use hamel_run::matrices::{self, Outcome};
use hamel_run::method::{MethodName, Steps};
use hamel_run::model::blocks;
use hamel_run::model::{self, Checked, Model, roles};
use hamel_run::noise::{Noise, method_for, samples_for};
use hamel_run::request::fluid::request as request_of_matrices;
use hamel_run::request::json::by_name;
use hamel_run::request::simulate::Completion;
use hamel_run::request::{read_request, sizes};
use hamel_run::session::Session;
use hamel_run::simulation::{MAX_EVENTS, SimulateRequest, SimulateResponse, SingularPosition};
use hamel_run::start::{Starts, judge};
use hamel_run::streams::{note, print};
use hamel_run::watched::{EventRecord, Watched};
use hamel_run::{admissible, auto, interpreted};

/// Integrate a model from an initial state; print a summary and write files
///
/// Integration starts at t = 0, from what --initial gives, else from the model's own initial values, else from zero,
/// moved onto equations between coordinates and constraints; the summary says what was chosen or moved.
///
/// With --reconstruct, position and attitude are integrated as well, and a figure shows the path.
///
/// With --json, a request is read from standard input instead:
///
/// {"params": {..}, "initial": {..}, "t_final": number, "method": "dop853", "rtol": .., "atol": .., "samples": n,
/// "max_steps": n}
///
/// and one line is printed:
///
/// {"t", "final": {..}, "samples": [[t, {..}], ..], "steps", "rejected", "rhs_evals", "energy_drift",
/// "constraint_residual", "initial_residual", "warnings"}
///
/// Components of "initial" that the model gives may be left out; the answer then has the whole of it as "initial".
///
/// A request with "sections", a list of texts as for --section, and a model with events add "events" to the answer,
/// [{"name", "t", "state": {..}}, ..], and "ended_by" where one has ended the motion; "max_events" limits their number.
///
/// A request with "sensitivity", a list of parameters and components of the initial state, adds the derivatives of the
/// final state by each to the answer, {"l": {"Omega1": .., ..}, ..}.
///
/// A request with "reconstruct" gives the coordinates of the group, all of them or none for the defaults, and the
/// answer has their final values in "reconstruction". `hamel list` shows their names: what scene reconstruction adds to
/// the state. docs/command-line.md says more about both.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel simulate heavy_top -o heavy_top.svg
  hamel simulate heavy_top --set m=2 l=0.1 --initial Omega3=20 --t-final 5 -o top.csv -o top.svg
  hamel simulate mobile_robot --reconstruct --initial x=1 y=-2 -o robot.svg
  hamel simulate suslov --method rk4 --step 0.001
  hamel simulate heavy_top --plot Omega1,Omega2 --plot Gamma3 -o top.png
  hamel simulate heavy_top --sensitivity l,Omega3 --t-final 2 -o top.csv
  hamel simulate ./my_model.hamel --t-final 3
  echo '{\"initial\": {\"Omega1\": 1, \"Omega2\": 0.2, \"Omega3\": 0.1}, \"t_final\": 10, \"samples\": 5}' \\
    | hamel simulate free_rigid_body --json
  echo '{\"initial\": {\"omega\": 1, \"v1\": 0.5}, \"t_final\": 5, \"reconstruct\": {\"theta\": 0, \"x\": 1, \"y\": 2}}' \\
    | hamel simulate chaplygin_sleigh --json"
)]
pub struct Arguments {
    /// Which scene, and who evaluates it.
    #[command(flatten)]
    pub scene: SceneOptions,
    /// From where, and how.
    #[command(flatten)]
    pub motion: MotionOptions,
    /// To where.
    #[command(flatten)]
    pub end: EndOptions,
    /// Which path.
    #[command(flatten)]
    pub noise: NoiseOptions,
    /// Integrate position and attitude (the coordinates of the group) as well; --initial takes them then
    #[arg(long)]
    pub reconstruct: bool,
    /// Number of samples in files, at equal distances, both ends included [default: 1001]
    #[arg(long, value_name = "N")]
    pub samples: Option<usize>,
    /// Function of the state to watch for changes of sign, an expression of the model's language with `rising` or
    /// `falling` behind it where only these are meant; may be repeated
    #[arg(long, value_name = "EXPRESSION")]
    pub section: Vec<String>,
    /// Parameters and components of the initial state by which the motion is differentiated as well
    #[arg(long, value_name = "NAME", num_args = 1.., value_delimiter = ',')]
    pub sensitivity: Vec<String>,
    /// File to write with the events and the crossings of sections: .csv, or .svg with the crossings in a plane; may be
    /// repeated
    #[arg(long, value_name = "FILE")]
    pub events: Vec<PathBuf>,
    /// Components of the state that span the plane of --events FILE.svg [default: the first two]
    #[arg(long, value_name = "X,Y", requires = "events", value_delimiter = ',')]
    pub plane: Vec<String>,
    /// Largest number of events [default: 100000]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_events: Option<u64>,
    /// File to write: .csv, .json, .npz, or a figure, .svg, .png or .pdf; may be repeated
    #[arg(short, long = "output", value_name = "FILE")]
    pub output: Vec<PathBuf>,
    /// A panel of figures, with the columns of these names; may be repeated, and stands in the place of all others
    #[arg(long, value_name = "NAME,..", requires = "output")]
    pub plot: Vec<String>,
    /// Logarithmic axes in the panels of --plot
    #[arg(long, requires = "plot")]
    pub log: bool,
    /// Read a JSON request from standard input and print a JSON answer
    #[arg(long, conflicts_with_all =
        ["set", "initial", "reconstruct", "t_final", "method", "rtol", "atol", "step", "max_step", "max_steps", "samples", "output", "plot", "log",
         "section", "sensitivity", "events", "plane", "max_events", "noise_seed", "noise_path", "noise_step"])]
    pub json: bool,
}

/// Samples in files unless another number is given: smooth curves, small files.
const DEFAULT_SAMPLES: usize = 1001;

/// Integrates; a summary for people, or the answer to a JSON request on one line.
///
/// # Errors
/// Everything that can be wrong with names, values or the request, the integration and files.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    if let Some(fluid) = session.find(&arguments.scene.model)?.fluid()? {
        return of_matrices(&fluid, arguments);
    }
    if arguments.json { answer(session, &arguments.scene) } else { simulate(session, arguments) }
}

/// The motion of a fluid of matrices; a summary, or the answer to a JSON request with the Casimirs at both ends.
fn of_matrices(fluid: &MatrixFluid, arguments: &Arguments) -> Result<String, Error> {
    let info = matrices::info(fluid);
    if arguments.scene.scene != info.scene {
        let (name, known) = (arguments.scene.scene.clone(), vec![info.scene]);
        return Err(Error::UnknownScene { model: info.model, name, known });
    }
    if arguments.json {
        let text = read_request("{\"initial\": {\"re_1_0\": 0.5, ..}, \"t_final\": 1, \"step\": 0.01}")?;
        if !SimulateRequest::sections(&text)?.is_empty() {
            return Err(Error::unusable("sections", "are not possible: a fluid of matrices has no events"));
        }
        let (request, is_completed) = request_of_matrices(fluid, &text, &info)?;
        let shield = Shield::raise();
        let Outcome { response, casimirs, .. } =
            matrices::simulate(fluid, &request, &[], &mut hamel_run::interrupts::look)?;
        drop(shield);
        let mut answer = response.to_json(&info, 0);
        if let Some(fields) = answer.as_object_mut() {
            let values = casimirs.into_iter().map(|(name, ends)| (name, ends.to_vec().into()));
            fields.insert("casimirs".into(), serde_json::Value::Object(values.collect()));
            if is_completed {
                let names = info.state.iter().map(String::as_str);
                fields.insert("initial".into(), by_name(names, &request.initial));
            }
        }
        return told_until_interrupted(&request, &response, answer.to_string());
    }
    let motion = &arguments.motion;
    if arguments.reconstruct {
        return Err(Error::unusable("--reconstruct", "is not possible: a fluid of matrices has no places"));
    }
    if !arguments.section.is_empty() || !arguments.events.is_empty() {
        return Err(Error::unusable("--section", "is not possible: a fluid of matrices has no events"));
    }
    if !arguments.sensitivity.is_empty() {
        let reason = "is not possible: a fluid of matrices has no derivatives of its motion";
        return Err(Error::unusable("--sensitivity", reason));
    }
    let method = motion.method.unwrap_or(MethodName::Isospectral);
    if method != MethodName::Isospectral {
        return Err(matrices::other_method(method));
    }
    if motion.max_step.is_some() {
        return Err(Error::unusable(
            "--max-step",
            "is not possible: a fluid of matrices is moved by fixed steps",
        ));
    }
    let (Some(step), None, None) = (motion.step, motion.rtol, motion.atol) else {
        let reason =
            "is what a fluid of matrices is moved by, without tolerances: give one, such as --step 0.01";
        return Err(Error::unusable("--step", reason));
    };
    let mut problems = Vec::new();
    let names: Vec<&str> = info.params.iter().map(|p| p.name.as_str()).collect();
    let set = assignments(&motion.set, "--set", "parameter", &names, &mut problems);
    let given = assignments(&motion.initial, "--initial", "state", &info.state_names(), &mut problems);
    if !problems.is_empty() {
        return Err(Error::Request { problems });
    }
    let targets: Vec<Target> = arguments.output.iter().map(|p| Target::new(p)).collect::<Result<_, _>>()?;
    let samples = arguments.samples.unwrap_or(if targets.is_empty() { 0 } else { DEFAULT_SAMPLES });
    let params: Vec<f64> =
        info.params.iter().map(|p| set.get(&p.name).copied().unwrap_or(p.default)).collect();
    let fluid = &matrices::at(fluid, &params)?;
    let mut initial = matrices::initial(fluid);
    for (name, value) in info.state.iter().zip(&mut initial) {
        *value = given.get(name).copied().unwrap_or(*value);
    }
    let steps = Steps::Fixed { step };
    let request = SimulateRequest {
        params,
        initial,
        t_final: arguments.end.t_final,
        method,
        steps,
        samples,
        with_outputs: !targets.is_empty(),
        n_group: 0,
        max_steps: motion.max_steps.unwrap_or(steps.max_steps()),
        max_events: MAX_EVENTS,
        watched: None,
        noise: Noise::default(),
        along: Vec::new(),
        tangents: Vec::new(),
    };
    let opened: Vec<OpenTarget> = targets.iter().map(Target::open).collect::<Result<_, _>>()?;
    let chosen = Chosen::new(&info, &[], &arguments.plot, arguments.log)?;
    let is_drawn = targets.iter().any(Target::is_figure) && arguments.plot.is_empty();
    let pictured: Vec<usize> = if is_drawn { field::shown(samples).collect() } else { Vec::new() };
    let shield = Shield::raise();
    let Outcome { response, fields, casimirs } =
        matrices::simulate(fluid, &request, &pictured, &mut hamel_run::interrupts::look)?;
    drop(shield);
    let title = fluid.doc.iter().map(|line| line.trim()).find(|line| !line.is_empty()).unwrap_or_default();
    let fields: Vec<Field> = if is_drawn { fields::of_matrices(fluid, &fields) } else { Vec::new() };
    let blocks = blocks::of_matrices(fluid);
    let run = Run {
        info: &info,
        title,
        blocks: &blocks,
        request: &request,
        response: &response,
        fields: &fields,
        chosen: &chosen,
    };
    opened.into_iter().try_for_each(|target| target.write(&run))?;
    let mut text = summary(&info, title, &request, &response, None);
    if !casimirs.is_empty() {
        text.push('\n');
    }
    let width = casimirs.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0).max(5);
    for (name, [start, end]) in &casimirs {
        let _ = write!(text, "\n  {name:width$}  {:>24}  {:>24}", format!("{start:?}"), format!("{end:?}"));
    }
    for target in &targets {
        let _ = write!(text, "\nwrote {} ({} samples)", target.path().display(), response.samples.len());
    }
    told_until_interrupted(&request, &response, text)
}

/// What there is to tell of a motion; where an interrupt has ended it, that is told at once, and the interrupt is an
/// error.
///
/// # Errors
/// [`Error::Interrupted`], and [`Error::Io`] where the text cannot be printed.
fn told_until_interrupted(
    request: &SimulateRequest,
    response: &SimulateResponse,
    text: String,
) -> Result<String, Error> {
    if request.is_complete(response) {
        return Ok(text);
    }
    print(&text)?;
    Err(Error::Interrupted { t: response.t, t_final: request.t_final })
}

/// The answer to a JSON request.
fn answer(session: &Session, scene: &SceneOptions) -> Result<String, Error> {
    let file = scene.find(session)?;
    let choice = scene.choice_of(&file)?;
    let text = read_request("{\"initial\": {\"Omega1\": 0.1, ..}, \"t_final\": 1}")?;
    let file = file.sized(&sizes::of_request(&text)?);
    let (reconstructs, asking) =
        (SimulateRequest::asks_to_reconstruct(&text)?, SimulateRequest::asking_method(&text)?);
    let model = || file.model();
    let choice = if reconstructs { choice.reconstructing(model()?, "reconstruct")? } else { choice };
    let projects = asking.is_some_and(MethodName::is_projection);
    let scene = choice.open(&file)?;
    let info = scene.info().clone();
    let forms = match SimulateRequest::has_other_names(&text, &info)? {
        true => Forms::of(model()?, &info)?,
        false => Forms::own(&info),
    };
    let n_group = if reconstructs { n_group(&info, model()?)? } else { 0 };
    if SimulateRequest::lacks_names(&text, &info, n_group)? {
        return answer_completed(&scene, model()?, &text, n_group);
    }
    if reconstructs {
        let mut request = reconstructing(&scene, model()?, &text, &forms)?;
        follow(&mut request, model, &info, &text)?;
        return respond(&scene, &request);
    }
    let mut request = SimulateRequest::parse_in(&text, &info, &forms, 0, &|_| Vec::new(), None)?;
    let sections = SimulateRequest::sections(&text)?;
    request.watched = Watched::new(model()?, &info, &sections, "sections")?;
    // The default scene has what there is, so that nobody has to read the model, unless it carries momenta.
    let has_all =
        choice.scene == model::DEFAULT_SCENE && info.output_range(Want::Velocities.name()).is_none();
    if projects || !(has_all || admissible::is_judged_by(&info)) {
        judge(model()?, &request, &info)?;
    }
    follow(&mut request, model, &info, &text)?;
    respond(&scene, &request)
}

/// Derivatives of the initial state of a request that is given as a whole: they stay on the equations of the model.
fn follow<'m>(
    request: &mut SimulateRequest,
    model: impl Fn() -> Result<&'m Arc<Checked>, Error>,
    info: &Info,
    text: &str,
) -> Result<(), Error> {
    if !request.along.is_empty() {
        let (model, given) = (model()?, SimulateRequest::given(text)?);
        let scene = interpreted::build(model, &info.scene)?;
        let follower = Follower::of_whole(model, (&scene, Forms::of(model, info)?), &given)?;
        request.tangents = follower.tangents(&request.along, (&request.params, &request.initial), &[])?;
    }
    Ok(())
}

/// The answer to a JSON request that leaves out components of the initial state, with the whole of it.
fn answer_completed(
    scene: &dyn Factory,
    model: &Arc<Checked>,
    text: &str,
    n_group: usize,
) -> Result<String, Error> {
    let info = scene.info().clone();
    let forms = Forms::of(model, &info)?;
    let starts = Starts::new(model, &info, Forms::of(model, &info)?)?;
    let known = Prior::of(model, &info.scene, &BTreeMap::new());
    let mut is_chosen = false;
    let mut choose = |set: &BTreeMap<String, f64>, given: &BTreeMap<String, f64>| {
        is_chosen = true;
        Ok(starts.choose(scene, set, given)?.1)
    };
    let defaults = |params: &BTreeMap<String, f64>| roles::group_start(model, params);
    // Modes are off where nobody says otherwise.
    let modes = model.modes.iter().map(|mode| (mode.name.clone(), 0.0));
    let known: BTreeMap<String, f64> =
        modes.chain(known.initial().iter().map(|(name, value)| (name.clone(), *value))).collect();
    let mut completion = Completion { known: &known, choose: &mut choose };
    let mut request =
        SimulateRequest::parse_in(text, &info, &forms, n_group, &defaults, Some(&mut completion))?;
    let sections = SimulateRequest::sections(text)?;
    request.watched = Watched::new(model, &info, &sections, "sections")?;
    judge(model, &request, &info)?;
    if !request.along.is_empty() {
        let own = interpreted::build(model, &info.scene)?;
        let names = info.param_names().into_iter().map(str::to_owned);
        let set = names.zip(request.params.iter().copied()).collect();
        let given = SimulateRequest::given(text)?;
        let follower = Follower::new(model, (&own, Forms::of(model, &info)?), [&set, &given])?;
        request.tangents = follower.tangents(&request.along, (&request.params, &request.initial), &[])?;
    }
    let response = simulate_with_bar(scene, &request)?;
    warn(&response);
    let mut answer = response.to_json(&info, n_group);
    if let (true, Some(fields)) = (is_chosen, answer.as_object_mut()) {
        let names = info.state.iter().map(String::as_str).take(info.state.len() - n_group);
        fields.insert("initial".into(), by_name(names, &request.initial));
    }
    Ok(answer.to_string())
}

/// Integrates as a JSON request says.
///
/// # Errors
/// As [`SimulateRequest::parse`] and [`hamel_run::integrate::simulate`].
pub fn simulate_text(scene: &dyn Factory, text: &str) -> Result<String, Error> {
    let request = SimulateRequest::parse(text, scene.info())?;
    if !SimulateRequest::sections(text)?.is_empty() {
        return Err(Error::unusable("sections", "needs the model besides the scene"));
    }
    respond(scene, &request)
}

fn respond(scene: &dyn Factory, request: &SimulateRequest) -> Result<String, Error> {
    let shield = Shield::raise();
    let response = simulate_with_bar(scene, request)?;
    drop(shield);
    warn(&response);
    let mut answer = response.to_json(scene.info(), request.n_group);
    if let (Some(fields), false) = (answer.as_object_mut(), request.is_complete(&response)) {
        fields.insert("interrupted".into(), true.into());
    }
    told_until_interrupted(request, &response, answer.to_string())
}

/// Integrates as a JSON request with `reconstruct` says; the scene is that with the group's coordinates.
///
/// # Errors
/// As [`simulate_text`], and when the scene's state does not end with the coordinates that the model reconstructs.
pub fn reconstruct_text(
    scene: &dyn Factory,
    model: &Checked,
    text: &str,
    forms: &Forms,
) -> Result<String, Error> {
    let request = reconstructing(scene, model, text, forms)?;
    respond(scene, &request)
}

/// The request of such a text.
fn reconstructing(
    scene: &dyn Factory,
    model: &Checked,
    text: &str,
    forms: &Forms,
) -> Result<SimulateRequest, Error> {
    let n_group = n_group(scene.info(), model)?;
    let defaults = |params: &BTreeMap<String, f64>| roles::group_start(model, params);
    let mut request = SimulateRequest::parse_in(text, scene.info(), forms, n_group, &defaults, None)?;
    let sections = SimulateRequest::sections(text)?;
    request.watched = Watched::new(model, scene.info(), &sections, "sections")?;
    Ok(request)
}

/// Tells the warnings of an integration on standard error.
fn warn(response: &SimulateResponse) {
    response.warnings.iter().for_each(|warning| note(format_args!("warning: {warning}")));
}

/// Number of coordinates of the group at the end of a scene's state.
fn n_group(info: &Info, model: &Model) -> Result<usize, Error> {
    let group = model::group_coordinates(model);
    if info.state.ends_with(&group) {
        return Ok(group.len());
    }
    Err(Error::NotCompiled {
        what: format!("scene {} of {}", info.scene, info.model),
        reason: format!("its state does not end with {}, as the model says", group.join(", ")),
    })
}

fn simulate(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let file = arguments.scene.find(session)?;
    let targets: Vec<Target> = arguments.output.iter().map(|p| Target::new(p)).collect::<Result<_, _>>()?;
    let of_events: Vec<EventTarget> =
        arguments.events.iter().map(|p| EventTarget::new(p)).collect::<Result<_, _>>()?;
    let opened: Vec<OpenTarget> = targets.iter().map(Target::open).collect::<Result<_, _>>()?;
    let opened_for_events: Vec<OpenEventTarget> =
        of_events.iter().map(EventTarget::open).collect::<Result<_, _>>()?;
    let model = file.model()?;
    let mut choice = arguments.scene.choice_of(&file)?;
    arguments.noise.chooses(&mut choice, model);
    if arguments.reconstruct && choice.scene == model::STOCHASTIC_SCENE {
        let reason = "is of scenes without noise: choose with --scene one that takes the noises and wants \
                      `reconstruction`, such as `scene in_space { input W; want rhs, energy, reconstruction; }`";
        return Err(Error::unusable("--reconstruct", reason));
    }
    if arguments.reconstruct {
        choice = choice.reconstructing(model, "--reconstruct")?;
    }
    let known = model.scene_names();
    if !known.contains(&choice.scene) {
        return Err(Error::UnknownScene { model: model.name.clone(), name: choice.scene, known });
    }
    let motion = &arguments.motion;
    let steps = motion.steps()?;
    let most = if targets.is_empty() { 0 } else { DEFAULT_SAMPLES };
    let method = match (motion.method, steps) {
        (Some(MethodName::Auto), Steps::Adaptive { rtol, .. }) => {
            let cost = interpreted::build(model, &choice.scene)?.rhs_counts().cost();
            let has_events = !arguments.section.is_empty() || scene::has_events(model, &choice.scene);
            Some(auto::choose(rtol, cost, auto::Purpose::of(arguments.samples.unwrap_or(most), has_events)))
        }
        (method, _) => method,
    };
    let scene = choice.open(&file)?;
    let info = scene.info().clone();
    has_state(&info)?;
    let samples = arguments.samples.unwrap_or_else(|| samples_for(&info, steps, arguments.end.t_final, most));
    let n_group = if arguments.reconstruct { n_group(&info, model)? } else { 0 };
    let plane = plane(&info, &arguments.plane)?;
    let chosen = Chosen::new(&info, &arguments.sensitivity, &arguments.plot, arguments.log)?;
    let asked = Asked {
        set: motion.set.clone(),
        initial: motion.initial.clone(),
        t_final: arguments.end.t_final,
        method: method_for(&info, method),
        steps,
        samples,
        with_outputs: !targets.is_empty(),
        n_group,
        max_steps: motion.max_steps,
        max_events: arguments.max_events,
        noise: arguments.noise.path(&info)?,
        sections: arguments.section.clone(),
        along: arguments.sensitivity.clone(),
    };
    let (mut request, told) = asked.request(&Words::OPTIONS, model, &scene)?;
    if motion.method == Some(MethodName::Auto)
        && choice.table.is_none()
        && let Some(method) = method_of_long(&interpreted::build(model, &choice.scene)?, &request)
    {
        request.method = method;
    }
    if choice.table.is_some() && !request.along.is_empty() && request.watched.is_some() {
        let reason = "is not carried through events whose inputs are in a table: drive them by expressions";
        return Err(Error::unusable("--sensitivity", reason));
    }
    let shield = Shield::raise();
    let response = simulate_with_bar(&scene, &request)?;
    drop(shield);
    warn(&response);
    let title = model::title(model);
    let blocks = blocks::blocks(model);
    let (fields, missing) = fields(model, &info, &request, &response);
    let run = Run {
        info: &info,
        title: &title,
        blocks: &blocks,
        request: &request,
        response: &response,
        fields: &fields,
        chosen: &chosen,
    };
    opened.into_iter().try_for_each(|target| target.write(&run))?;
    let crossings = Crossings {
        info: &info,
        title: &title,
        plane,
        events: response.events.as_deref().unwrap_or_default(),
    };
    opened_for_events.into_iter().try_for_each(|target| target.write(&crossings))?;
    let mut text = summary(&info, &title, &request, &response, told_in_words(&told).as_deref());
    if !targets.is_empty() && !missing.is_empty() {
        let list = missing.join(", ");
        let _ = write!(
            text,
            "\n  note: {list} needs more than the state of scene {} and is not drawn",
            info.scene
        );
    }
    for target in &targets {
        let _ = write!(text, "\nwrote {} ({} samples)", target.path().display(), response.samples.len());
    }
    for target in &of_events {
        let _ = write!(text, "\nwrote {} ({} events)", target.path().display(), crossings.events.len());
    }
    told_until_interrupted(&request, &response, text)
}

/// Positions in the state of the components that span a plane: those named, or the first two.
fn plane(info: &Info, names: &[String]) -> Result<[usize; 2], Error> {
    let [x, y] = names else {
        if names.is_empty() {
            return Ok([0, usize::from(info.state.len() > 1)]);
        }
        return Err(Error::unusable("--plane", "has two components of the state, as in --plane x,y"));
    };
    let place = |name: &String| {
        let known = || info.state.clone();
        info.state.iter().position(|s| s == name).ok_or_else(|| Error::Request {
            problems: vec![Problem::UnknownName {
                path: "--plane".into(),
                kind: "state",
                name: name.clone(),
                known: known(),
            }],
        })
    };
    Ok([place(x)?, place(y)?])
}

/// How often each event has happened, and when the last did.
fn told(events: &[EventRecord]) -> String {
    let mut counts: BTreeMap<&str, (usize, f64)> = BTreeMap::new();
    for EventRecord { name, t, .. } in events {
        let (count, last) = counts.entry(name).or_default();
        (*count, *last) = (*count + 1, *t);
    }
    let each =
        counts.iter().map(|(name, (count, last))| format!("{name} {count} times, last at t = {last:?}"));
    match counts.is_empty() {
        true => "events     none".to_owned(),
        false => format!("events     {}", each.collect::<Vec<_>>().join("\n             ")),
    }
}

fn summary(
    info: &Info,
    title: &str,
    request: &SimulateRequest,
    response: &SimulateResponse,
    start: Option<&str>,
) -> String {
    let mut text = format!("{}  {title}", bold(&info.model));
    if info.scene != model::DEFAULT_SCENE {
        let _ = write!(text, ", scene {}", info.scene);
    }
    let steps = request.steps.describe();
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
    if let Steps::Adaptive { rtol, atol, .. } = request.steps {
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
    if let Some(events) = &response.events {
        let _ = write!(text, "\n  {}", told(events));
    }
    if let Some(line) = SingularPosition::told(&response.singular_positions) {
        let _ = write!(text, "\n  singular   {line}");
    }
    if let Some(event) = &response.ended_by {
        let _ = write!(text, "\n  ended by event {event}");
    }
    if let Some(start) = start {
        let _ = write!(text, "\n  start      {start}");
    }
    let width = info.state.iter().map(|s| s.chars().count()).max().unwrap_or(0).max(5);
    let _ = write!(text, "\n\n  {:width$}  {:>24}  {:>24}", "", "initial", "final");
    for ((name, start), end) in info.state.iter().zip(&request.initial).zip(&response.last) {
        let _ = write!(text, "\n  {name:width$}  {:>24}  {:>24}", format!("{start:?}"), format!("{end:?}"));
    }
    for (by, values) in &response.along {
        let _ = write!(text, "\n\n  derivative of the final state by {by}");
        for (name, value) in info.state.iter().zip(values) {
            let _ = write!(text, "\n  {name:width$}  {:>24}", format!("{value:?}"));
        }
    }
    text
}
