//! `explain`: algebra, equations and operation counts of a scene.
//!
//! Does not know: how any of it is computed.

use std::sync::Arc;

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser as _};
use hamel_codegen::scene;
use hamel_codegen::spec::ConnectionKind;
use hamel_expr::Style;
use hamel_mechanics::mechanics::connection_coefficients;

use crate::output::formulations::table;
use crate::output::terminal::Bar;
use hamel_run::cache::Cache;
use hamel_run::error::Error;
use hamel_run::model::{self, Checked};
use hamel_run::session::Session;

/// Show algebra, stage forms, connection, equations and operation counts of a model
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel explain kirchhoff_body
  hamel explain heavy_top --scene lagrange
  hamel explain two_arm_satellite --ops
  hamel explain euler_disk --formulations
  hamel explain chaplygin_sleigh --coefficients
  hamel explain heavy_top --dirac
  hamel explain heavy_top --certify
  hamel explain heavy_top --stages
  hamel explain kirchhoff_body --by paper --latex > kirchhoff.tex
  hamel explain euler_disk --latex > euler_disk.tex"
)]
pub struct Arguments {
    /// Name of a model, or a path that ends in .hamel
    pub model: String,
    /// Name of the scene
    #[arg(long, default_value = "default")]
    pub scene: String,
    /// Print a LaTeX fragment that needs amsmath
    #[arg(long)]
    pub latex: bool,
    /// Print a table of operation counts by function and section instead
    #[arg(long, conflicts_with = "latex")]
    pub ops: bool,
    /// Search for formulations that are the same motion, and print what each costs instead
    #[arg(long, conflicts_with_all = ["latex", "ops"])]
    pub formulations: bool,
    /// Print the coefficients of the Levi-Civita connection of the kinetic energy, and of the constrained one, instead
    #[arg(long, conflicts_with_all = ["ops", "formulations", "dirac"])]
    pub coefficients: bool,
    /// Print the reduced Dirac structure instead: its conditions with the numbers of the model
    #[arg(long, conflicts_with_all = ["ops", "formulations"])]
    pub dirac: bool,
    /// Hold every function of the scene to its definition at 64 points, and print the largest residual of each instead
    #[arg(long, conflicts_with_all = ["latex", "ops", "formulations", "coefficients", "dirac"])]
    pub certify: bool,
    /// Print everything that each stage of the pipeline made instead: expressions of the model, the system on its Lie
    /// algebroid, definitions of the equations, the program
    #[arg(long, conflicts_with_all = ["latex", "ops", "formulations", "coefficients", "dirac", "certify"])]
    pub stages: bool,
    /// Print the equations by stages in the notation of a source instead: `paper` is that of Cendra and Diaz,
    /// Lagrange-d'Alembert-Poincare equations by several stages
    #[arg(long, value_parser = ["paper"], conflicts_with_all = ["ops", "formulations", "coefficients", "dirac", "certify", "stages"])]
    pub by: Option<String>,
    /// Write the system with another connection first: the velocity becomes v = xi + A(x) xdot
    #[arg(long, value_parser = PossibleValuesParser::new(CONNECTIONS).try_map(|name| connection(&name)))]
    pub connection: Option<ConnectionKind>,
}

/// Names of the connections that a system can be written with.
const CONNECTIONS: [&str; 3] = ["trivial", "mechanical", "nonholonomic"];

fn connection(name: &str) -> Result<ConnectionKind, String> {
    ConnectionKind::from_name(name).ok_or_else(|| format!("there is no connection {name}"))
}

/// The explanation; what the model's defaults make of the scene goes to standard error.
///
/// # Errors
/// Unknown names and problems of the model.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let file = session.find(&arguments.model)?;
    let mut model = Arc::clone(file.model()?);
    if let Some(connection) = arguments.connection {
        model = Arc::new(Checked::new(model::with_connection(&model, connection), Cache::none()));
    }
    if arguments.formulations {
        return formulations(&model, &arguments.scene);
    }
    if arguments.by.is_some() {
        model = Arc::new(Checked::new(model::with_one_stage(&model), Cache::none()));
    }
    let built = model.derive(&arguments.scene)?;
    model::show_warnings(&scene::warnings(&model, std::slice::from_ref(&*built)));
    if arguments.ops {
        return Ok(built.operation_columns());
    }
    if arguments.certify {
        let found = built.certify(DEEP);
        let found = found.map_err(|error| model.diagnostics(vec![model.diagnose(&error)]))?;
        return Ok(found.table());
    }
    if arguments.stages {
        return Ok(hamel_codegen::explain::stages(&model, &built));
    }
    let style = if arguments.latex { Style::Latex } else { Style::Unicode };
    if arguments.by.is_some() {
        let found = hamel_codegen::explain::by_paper(&model, &built, style);
        return Ok(found.map_err(|error| model.diagnostics(vec![model.diagnose(&error)]))?);
    }
    if arguments.coefficients {
        let found = connection_coefficients(&built.equations().system);
        let found = found.map_err(|error| model.diagnostics(vec![model.diagnose(&error)]))?;
        return Ok(hamel_codegen::explain::connection_coefficients(&found, style));
    }
    Ok(match arguments.dirac {
        true => hamel_codegen::explain::dirac(&model, &built, style),
        false => hamel_codegen::explain::explain(&model, &built, style),
    })
}

/// Points at which `--certify` looks.
const DEEP: usize = 64;

/// The table of all formulations of a scene, found under a bar that appears on a terminal only.
fn formulations(model: &Checked, scene: &str) -> Result<String, Error> {
    model.known_scene(scene)?;
    let bar = Bar::new();
    let found = scene::formulations(model, scene, &|done, total| bar.show(done, total));
    bar.finish();
    Ok(table(model, scene, &found?))
}
