//! `import`: the model of a robot from its description.
//!
//! Does not know: formats, what becomes of them.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use hamel_codegen::import;
use hamel_codegen::spec::Diagnostics;

use crate::output::opened::Opened;
use hamel_run::error::Error;
use hamel_run::model;
use hamel_run::session::Session;

/// Write the model of a robot from its description in URDF, MJCF or SDF
///
/// One joint and the link that it moves stand after the other, with the names and the numbers of the file. What the
/// file has beside is listed on standard error and at the head of the model.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel import arm.urdf -o arm.hamel
  hamel import quadruped.urdf --floating -o quadruped.hamel
  hamel import walker.xml -o walker.hamel
  hamel import arm.urdf --frame tool0 -o arm.hamel
  hamel import hand.urdf --lock finger_joint_3 --limits spring     to standard output"
)]
pub struct Arguments {
    /// The description, a file in URDF, MJCF (MuJoCo) or SDF (Gazebo)
    pub file: PathBuf,
    /// The model to write, in the place of standard output; a file that is there is replaced
    #[arg(short, long, value_name = "FILE.hamel")]
    pub output: Option<PathBuf>,
    /// The root moves freely; it is at rest otherwise
    #[arg(long)]
    pub floating: bool,
    /// Replace a file that is there
    #[arg(long, requires = "output")]
    pub force: bool,
    /// What becomes of the limits of joints
    #[arg(long, value_enum, default_value_t)]
    pub limits: Limits,
    /// A joint that is fixed where its coordinate is zero; may be repeated
    #[arg(long, value_name = "JOINT")]
    pub lock: Vec<String>,
    /// A link whose frame the model names, for the wants `frames`, `frame_jacobians` and so on; may be repeated
    #[arg(long, value_name = "LINK")]
    pub frame: Vec<String>,
    /// The model has a `body` for each link with mass, for the wants `center_of_mass`, `centroidal_momentum` and so on
    #[arg(long)]
    pub bodies: bool,
}

/// What becomes of the limits of joints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum Limits {
    /// A motion that leaves them ends
    #[default]
    Interval,
    /// Smooth springs behind them
    Spring,
    /// They are left out
    None,
}

/// What a file does not say.
#[derive(Clone, Debug)]
pub struct Choices {
    /// The root moves freely.
    pub floating: bool,
    /// What becomes of the limits of joints.
    pub limits: Limits,
    /// Joints that are fixed.
    pub lock: Vec<String>,
    /// Links with named frames.
    pub frames: Vec<String>,
    /// Whether bodies are items.
    pub bodies: bool,
}

/// The checked model of a robot's description, with the notes on what the model lacks and the warnings about it.
///
/// # Errors
/// [`Error::Io`]; [`Error::Models`] with everything that keeps the file from being a model.
pub fn read(
    session: &Session,
    file: &Path,
    choices: Choices,
) -> Result<(import::Imported, Diagnostics), Error> {
    let shown = session.shown(file);
    let text = std::fs::read_to_string(file).map_err(|e| Error::io(shown.clone(), e))?;
    let mut options = import::Options::default();
    options.floating = choices.floating;
    options.limits = match choices.limits {
        Limits::Interval => import::Limits::Interval,
        Limits::Spring => import::Limits::Spring,
        Limits::None => import::Limits::None,
    };
    options.locked = choices.lock;
    options.frames = choices.frames;
    options.bodies = choices.bodies;
    let imported = import::import_with(&shown, &text, &options, &import::beside(file))?;
    let checked = session.parse(&format!("{}.hamel", imported.name), &imported.text)?;
    Ok((imported, checked.warnings))
}

/// Writes the model; it is checked before.
///
/// # Errors
/// As [`read`]; [`Error::Io`] where the model cannot be written.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let Arguments { file, output, force, floating, limits, lock, frame, bodies } = arguments;
    let (lock, frames) = (lock.clone(), frame.clone());
    let choices = Choices { floating: *floating, limits: *limits, lock, frames, bodies: *bodies };
    let opened = output.as_deref().map(|path| Opened::new_text(path, *force)).transpose()?;
    let (imported, warnings) = read(session, file, choices)?;
    model::show_warnings(&imported.notes);
    model::show_warnings(&warnings);
    let Some(opened) = opened else { return Ok(imported.text) };
    let target = session.shown(opened.path());
    opened.write(imported.text.as_bytes())?;
    Ok(format!("{target}: the model {}", imported.name))
}
