//! `report`: one HTML page about a model, with a motion.
//!
//! Does not know: what the page looks like, how a motion is integrated.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use clap::Args;
use hamel_codegen::config::{Bundle, Config};
use hamel_codegen::scene::Prior;
use hamel_codegen::spec::MatrixFluid;

use super::options::{InputOptions, duration};
use crate::output::fields::{self, fields};
use crate::output::opened::Opened;
use crate::output::plot::field;
use crate::output::report::contents::{self, Page, contents};
use crate::output::report::{self, Motion, Precision};
use hamel_run::bars::simulate_with_bar;
use hamel_run::dynamics::Factory;
use hamel_run::error::Error;
use hamel_run::forms::Forms;
use hamel_run::inputs::InputTable;
use hamel_run::interpreted::{self, Built};
use hamel_run::matrices::{self, Outcome};
use hamel_run::method::{MethodName, Steps};
use hamel_run::model::{self, Checked, blocks};
use hamel_run::noise::{self, Noise};
use hamel_run::session::Session;
use hamel_run::simulation::{MAX_EVENTS, SimulateRequest};
use hamel_run::start;

/// Write one HTML page about a model: definition, equations, operations, code, a motion and how accurate it is
///
/// The page loads nothing and opens from disk. A model that says what to draw (`view`) gets a figure in space that
/// plays the motion. Everything is computed by code that is made in memory.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel report heavy_top
  hamel report euler_disk --t-final 4 -o disk.html
  hamel report ./waves.hamel --step 0.02
  hamel report ./my_model.hamel --no-run"
)]
pub struct Arguments {
    /// Name of a model, or a path that ends in .hamel
    pub model: String,
    /// Name of the scene
    #[arg(long, default_value = "default")]
    pub scene: String,
    /// What drives the inputs.
    #[command(flatten)]
    pub inputs: InputOptions,
    /// File to write [default: the model's name with .html]
    #[arg(short, long, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Leave the motion out
    #[arg(long)]
    pub no_run: bool,
    /// Time of the motion, from 0
    #[arg(
        long,
        value_name = "T",
        default_value_t = 10.0,
        allow_negative_numbers = true,
        value_parser = duration,
        conflicts_with = "no_run",
    )]
    pub t_final: f64,
    /// Size of the steps of a fluid that is moved as products of matrices
    #[arg(
        long,
        value_name = "H",
        allow_negative_numbers = true,
        value_parser = duration,
        conflicts_with = "no_run",
    )]
    pub step: Option<f64>,
}

/// Writes one page about a scene and says where.
///
/// The motion is that of the scene with every coordinate and output, compiled in memory, so that cargo builds nothing.
///
/// # Errors
/// Unknown names, problems of the model, a motion that cannot be integrated, and files.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let clock = Instant::now();
    let opened = arguments.output.as_deref().map(page_file).transpose()?;
    let file = arguments.inputs.drive(session.find(&arguments.model)?)?;
    let (page, motion) = match file.fluid()? {
        Some(fluid) => of_matrices(&fluid, file.text()?.into_owned(), arguments)?,
        None => {
            let model = file.model()?;
            if arguments.step.is_some() {
                let reason = "is for fluids of matrices: a motion by equations has steps of its own";
                return Err(Error::unusable("--step", reason));
            }
            let page = contents(model, &arguments.scene)?;
            (page, if arguments.no_run { None } else { Some(motion(model, arguments)?) })
        }
    };
    let text = report::page(&page, motion.as_ref())?;
    let file = match opened {
        Some(file) => file,
        None => page_file(Path::new(&format!("{}.html", page.model)))?,
    };
    let shown = file.path().display().to_string();
    file.write(text.as_bytes())?;
    let (size, seconds) = (text.len() as f64 / 1e3, clock.elapsed().as_secs_f64());
    Ok(format!("wrote {shown} ({size:.0} kB, {seconds:.1} s)"))
}

/// The file of a page, open before anything is derived.
fn page_file(path: &Path) -> Result<Opened, Error> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
    if !["html", "htm"].contains(&extension.as_str()) {
        let reason = "is no page: let the name end in .html";
        return Err(Error::unusable(path.display().to_string(), reason));
    }
    Opened::new(path)
}

/// The page of a fluid of matrices and its motion.
fn of_matrices(
    fluid: &MatrixFluid,
    text: String,
    arguments: &Arguments,
) -> Result<(Page, Option<Motion>), Error> {
    if arguments.scene != model::DEFAULT_SCENE {
        let (name, known) = (arguments.scene.clone(), vec![model::DEFAULT_SCENE.to_owned()]);
        return Err(Error::UnknownScene { model: fluid.name.clone(), name, known });
    }
    let mut bundle = Bundle::default();
    Config::new().add_fluids(std::slice::from_ref(fluid), &mut bundle)?;
    let page = contents::of_matrices(fluid, text, bundle.files.into_values().collect());
    if arguments.no_run {
        return Ok((page, None));
    }
    let Some(step) = arguments.step else {
        let reason = "is what a fluid of matrices is moved by: give one, such as --step 0.01, or --no-run";
        return Err(Error::unusable("--step", reason));
    };
    let info = matrices::info(fluid);
    let request = SimulateRequest {
        params: info.params.iter().map(|p| p.default).collect(),
        initial: matrices::initial(fluid),
        t_final: arguments.t_final,
        method: MethodName::Isospectral,
        steps: Steps::Fixed { step },
        samples: report::SAMPLES,
        with_outputs: true,
        n_group: 0,
        max_steps: report::MAX_STEPS,
        max_events: MAX_EVENTS,
        watched: None,
        noise: Noise::default(),
        along: Vec::new(),
        tangents: Vec::new(),
    };
    let pictured: Vec<usize> = field::shown(request.samples).collect();
    let Outcome { response, fields, .. } =
        matrices::simulate(fluid, &request, &pictured, &mut hamel_run::interrupts::look)?;
    let motion = Motion {
        info,
        blocks: blocks::of_matrices(fluid),
        request,
        response,
        precision: Precision::default(),
        fields: Vec::new(),
        pictures: fields::of_matrices(fluid, &fields),
    };
    Ok((page, Some(motion)))
}

fn motion(model: &Arc<Checked>, arguments: &Arguments) -> Result<Motion, Error> {
    let steps = Steps::Adaptive { rtol: Steps::RTOL, atol: Steps::ATOL, max: None };
    let nothing = BTreeMap::new();
    let table = arguments.inputs.table(model)?;
    let bare = driven(interpreted::build(model, &arguments.scene)?.in_memory(), table.as_deref())?;
    noise::refuse(Factory::info(&bare), "whose paths no page shows: --no-run makes one without a motion")?;
    let mut motion = pictured(
        model,
        &arguments.scene,
        [&nothing, &nothing],
        table.as_deref(),
        (arguments.t_final, MethodName::Dop853, steps, report::SAMPLES),
    )?;
    // Accuracy is compared without outputs and without the coordinates of the group.
    let start = Factory::info(&bare).state.iter().map(|name| {
        let at = motion.info.state.iter().position(|s| s == name);
        at.map_or(0.0, |at| motion.request.initial[at])
    });
    let bare_request = SimulateRequest {
        initial: start.collect(),
        samples: 0,
        with_outputs: false,
        watched: bare.watched(),
        noise: Noise::default(),
        ..motion.request.clone()
    };
    motion.precision = Precision::measure(arguments.t_final, |method, steps| {
        simulate_with_bar(&bare, &SimulateRequest { method, steps, ..bare_request.clone() })
    });
    Ok(motion)
}

/// A scene whose inputs a table drives, if there is one.
fn driven(scene: Built, table: Option<&InputTable>) -> Result<Built, Error> {
    match table {
        Some(table) => scene.driven_by(table),
        None => Ok(scene),
    }
}

/// A motion of the scene with every coordinate and output, and what its views show: with parameters in `set` and
/// components of the initial state in `given`, inputs from a table, from zero to a time, by a method and its steps,
/// with so many samples.
///
/// # Errors
/// Problems of the model, and a motion that cannot be integrated.
pub fn pictured(
    model: &Arc<Checked>,
    scene: &str,
    [set, given]: [&BTreeMap<String, f64>; 2],
    table: Option<&InputTable>,
    (t_final, method, steps, samples): (f64, MethodName, Steps, usize),
) -> Result<Motion, Error> {
    let prior = Prior::of(model, scene, set);
    let full = driven(interpreted::build_pictured(model, scene)?.in_memory(), table)?;
    let watched = full.watched();
    let info = full.info().clone();
    let values: Vec<f64> =
        info.params.iter().map(|p| set.get(&p.name).copied().unwrap_or(p.default)).collect();
    let chosen = start::Chosen { prior: &prior, given, positions: Some(&full) };
    let forms = Forms::of(model, &info)?;
    let initial = start::state(&full, None, (&values, &[]), &forms, chosen)?;
    let request = SimulateRequest {
        params: values,
        initial,
        t_final,
        method,
        steps,
        samples,
        with_outputs: true,
        n_group: 0,
        max_steps: report::MAX_STEPS,
        max_events: MAX_EVENTS,
        watched,
        noise: Noise::default(),
        along: Vec::new(),
        tangents: Vec::new(),
    };
    let response = simulate_with_bar(&full, &request)?;
    let (fields, _) = fields(model, &info, &request, &response);
    let (blocks, pictures) = (blocks::blocks(model), Vec::new());
    Ok(Motion { info, blocks, request, response, precision: Precision::default(), fields, pictures })
}
