//! `generate`: models as Rust modules, as C or for WebAssembly, to be checked in.
//!
//! Does not know: how a scene becomes text.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use clap::{Args, ValueEnum};
use hamel_codegen::Config;
use hamel_codegen::config::{Language, Precision, Progress};
use hamel_codegen::scene::{self, Scenes};

use crate::output::fmu::{self, archive};
use crate::output::opened::writable;
use hamel_run::error::Error;
use hamel_run::model::{Model, show_warnings};
use hamel_run::session::Session;
use hamel_run::signs;

/// Write the scenes of models as Rust modules or as C, or check that they are up to date
///
/// Every scene goes into a file of its own, called like the model, with the name of the scene unless that is the
/// default. All scenes are parsed, derived and emitted first; when any model has a problem, nothing is written. Files
/// are written only when they change. Rust modules need the crate hamel-runtime; C is C99, a header and a source, and
/// needs sqrt and fma of math.h. A build script does the same without files to check in.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel generate my_model.hamel --out-dir src/generated
  hamel generate arm.hamel leg.hamel --out-dir src/generated --mod-file mod.rs
  hamel generate heavy_top --scene default --out-dir src
  hamel generate heavy_top --language c --out-dir src               heavy_top.h and heavy_top.c
  hamel generate heavy_top --language c --precision float --out-dir src
  hamel generate heavy_top --language jax --out-dir src             heavy_top_jax.py
  hamel generate heavy_top --language wasm --out-dir src            for WebAssembly, with JavaScript
  hamel generate heavy_top --language fmu -o heavy_top.fmu          an FMU of FMI 3.0
  hamel generate my_model.hamel --out-dir src/generated --check     fail when something would be written"
)]
pub struct Arguments {
    /// Paths that end in .hamel, or names of models
    #[arg(required = true, value_name = "MODEL")]
    pub models: Vec<String>,
    /// Folder to write to
    #[arg(long, value_name = "FOLDER", required_unless_present = "output")]
    pub out_dir: Option<PathBuf>,
    /// The FMU of one scene, the default one unless --scene names another, in the place of a folder
    #[arg(short, long, value_name = "FILE", conflicts_with_all = ["out_dir", "mod_file", "check"])]
    pub output: Option<PathBuf>,
    /// Language of the files
    #[arg(long, value_enum, value_name = "LANGUAGE", default_value_t = Target::Rust)]
    pub language: Target,
    /// Numbers of C and C++: float for processors that compute with it alone
    #[arg(long, value_enum, value_name = "PRECISION", default_value_t = Numbers::Double)]
    pub precision: Numbers,
    /// Scene to generate, of every model; may be repeated [default: all of each model]
    #[arg(long, value_name = "NAME")]
    pub scene: Vec<String>,
    /// Write one more file, with a module for each scene (Rust)
    #[arg(long, value_name = "FILE")]
    pub mod_file: Option<String>,
    /// Replace files that hamel has not generated, or has generated from other models
    #[arg(long, conflicts_with = "check")]
    pub force: bool,
    /// Write nothing; fail and name the files that are not up to date
    #[arg(long)]
    pub check: bool,
}

/// What a scene is written as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// A module for the crate hamel-runtime
    Rust,
    /// A header and a source of C99
    C,
    /// The same with a header for C++17
    Cpp,
    /// The same as C with the right-hand side and its Jacobian for `casadi.external`
    Casadi,
    /// The Rust module with the root of a crate for WebAssembly, and a module of JavaScript that calls it
    Wasm,
    /// Python with CasADi: expressions, with derivatives of every order
    CasadiExpr,
    /// Python with JAX: functions that compile and have derivatives
    Jax,
    /// Python with SymPy: expressions with exact numbers
    Sympy,
    /// A module of Julia, for DifferentialEquations.jl
    Julia,
    /// A function file of MATLAB and Octave, for ode45
    Matlab,
    /// An FMU of FMI 3.0 for model exchange and co-simulation, by the C compiler of this machine
    Fmu,
}

/// The numbers that a scene is written on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Numbers {
    /// 64 bits
    Double,
    /// 32 bits
    Float,
}

impl Target {
    /// The language of files that are texts.
    fn language(self) -> Language {
        match self {
            Target::Rust => Language::Rust,
            // An archive around C.
            Target::C | Target::Fmu => Language::C,
            Target::Cpp => Language::Cpp,
            Target::Casadi => Language::Casadi,
            Target::Wasm => Language::Wasm,
            Target::CasadiExpr => Language::CasadiExpr,
            Target::Jax => Language::Jax,
            Target::Sympy => Language::Sympy,
            Target::Julia => Language::Julia,
            Target::Matlab => Language::Matlab,
        }
    }

    /// As the command line has it.
    fn word(self) -> &'static str {
        match self {
            Target::Rust => "rust",
            Target::C => "c",
            Target::Cpp => "cpp",
            Target::Casadi => "casadi",
            Target::Wasm => "wasm",
            Target::CasadiExpr => "casadi-expr",
            Target::Jax => "jax",
            Target::Sympy => "sympy",
            Target::Julia => "julia",
            Target::Matlab => "matlab",
            Target::Fmu => "fmu",
        }
    }
}

impl Arguments {
    /// The command that writes the files.
    fn command(&self, session: &Session) -> String {
        let mut words = vec!["hamel generate".to_owned()];
        words.extend(self.models.iter().cloned());
        words.extend(session.sizes().iter().map(|(name, value)| format!("--size {name}={value}")));
        words.extend(self.out_dir.iter().map(|folder| format!("--out-dir {}", folder.display())));
        if self.language != Target::Rust {
            words.push(format!("--language {}", self.language.word()));
        }
        words.extend((self.precision == Numbers::Float).then(|| "--precision float".to_owned()));
        words.extend(self.scene.iter().map(|scene| format!("--scene {scene}")));
        words.extend(self.mod_file.iter().map(|file| format!("--mod-file {file}")));
        words.join(" ")
    }
}

/// Writes the files, or compares them; a line about what was done.
///
/// # Errors
/// The problems of all models together; [`Error::Stale`] when checking. On an error nothing has been written.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let (mut models, mut fluids, mut errors) = (Vec::<Model>::new(), Vec::new(), Vec::new());
    for argument in &arguments.models {
        let read = session.find(argument).and_then(|file| match file.fluid()? {
            Some(fluid) => {
                fluids.push(fluid);
                Ok(None)
            }
            None => {
                file.quotients()?;
                file.into_model().map(Some)
            }
        });
        match read {
            Ok(model) => models.extend(model),
            Err(error) => errors.push(error),
        }
    }
    Error::all_of(errors)?;
    if let (Some(fluid), false) = (fluids.first(), arguments.scene.is_empty() && arguments.mod_file.is_none())
    {
        let reason =
            format!("are of scenes, and {} is a fluid of matrices: generate it by itself", fluid.name);
        return Err(Error::unusable("--scene and --mod-file", reason));
    }
    if arguments.precision == Numbers::Float && !matches!(arguments.language, Target::C | Target::Cpp) {
        let reason = "float is for C and C++: add --language c; a module of Rust computes with f32 as it stands, \
                      `Prepared<f32>`";
        return Err(Error::unusable("--precision", reason));
    }
    if arguments.language != Target::Rust {
        if let Some(fluid) = fluids.first() {
            let reason = "is a fluid of matrices, which hamel-runtime moves: generate it as Rust";
            return Err(Error::unusable(&fluid.name, reason));
        }
        if arguments.mod_file.is_some() {
            let reason =
                "is a file for several scenes in Rust: leave it out, every scene has files of its own";
            return Err(Error::unusable("--mod-file", reason));
        }
    }
    let Some(out_dir) = arguments.out_dir.as_ref().filter(|_| arguments.language != Target::Fmu) else {
        return fmus(&models, arguments);
    };
    let mut config = Config::new();
    config.out_dir(out_dir).language(arguments.language.language());
    config.precision(match arguments.precision {
        Numbers::Double => Precision::Double,
        Numbers::Float => Precision::Single,
    });
    for model in models.iter().filter(|_| !arguments.scene.is_empty()) {
        config.scenes(&model.name, arguments.scene.iter());
    }
    if let Some(file) = &arguments.mod_file {
        config.include_file(file);
    }
    if !arguments.check {
        writable(out_dir)?;
    }
    let (n_models, n_done) = (models.len(), AtomicUsize::new(0));
    let mut bundle = config.generate_with(&models, &|progress| match progress {
        Progress::Begun { model } => {
            let k = n_done.load(Ordering::Relaxed) + 1;
            signs::whole(if n_models > 1 {
                format!("model {k} of {n_models}, {model}")
            } else {
                String::new()
            });
        }
        Progress::Done { .. } => {
            n_done.fetch_add(1, Ordering::Relaxed);
        }
        _ => {}
    })?;
    config.add_fluids(&fluids, &mut bundle)?;
    bundle.warnings.iter().for_each(show_warnings);
    let n_scenes = bundle.entries.len() + fluids.len();
    if arguments.check {
        let wrong = |path: &Path| if path.is_file() { "is out of date" } else { "is missing" };
        let changed = bundle.changed(out_dir).into_iter();
        let files: Vec<(PathBuf, &'static str)> =
            changed.map(|(path, _)| (path.clone(), wrong(&path))).collect();
        if !files.is_empty() {
            return Err(Error::Stale { files, command: arguments.command(session) });
        }
        return Ok(format!("{n_scenes} scenes: generated files are up to date"));
    }
    let written = if arguments.force { bundle.write_over(out_dir)? } else { bundle.write(out_dir)? };
    let mut text = format!("{n_scenes} scenes: ");
    match written.len() {
        0 => text.push_str("nothing changed"),
        n => {
            let _ = write!(text, "{n} files written");
        }
    }
    written.iter().for_each(|path| text.push_str(&format!("\n  {}", path.display())));
    Ok(text)
}

/// Writes FMUs: one to the file that was named, or one for each scene to the folder.
fn fmus(models: &[Model], arguments: &Arguments) -> Result<String, Error> {
    if arguments.language != Target::Fmu {
        let reason = "is the file of an FMU: add --language fmu, or give --out-dir in its place";
        return Err(Error::unusable("--output", reason));
    }
    if arguments.check {
        let reason = "compares texts, and an FMU is compiled: leave it out";
        return Err(Error::unusable("--check", reason));
    }
    if arguments.output.is_some() && (models.len() != 1 || arguments.scene.len() > 1) {
        let reason = "is one FMU, of one scene: give one model and one --scene, or --out-dir";
        return Err(Error::unusable("--output", reason));
    }
    let fmu_file = |path: &Path| fmu::open(path, arguments.force);
    let mut opened = arguments.output.as_deref().map(fmu_file).transpose()?;
    let mut written = Vec::new();
    for model in models {
        let mut scenes = Scenes::new(model).for_fmus();
        let names = match (&arguments.output, arguments.scene.is_empty()) {
            (_, false) => arguments.scene.clone(),
            (Some(_), true) => vec![scene::DEFAULT.to_owned()],
            (None, true) => scenes.names(),
        };
        for built in
            scenes.build_all(&names).map_err(|problems| Error::Models { problems: vec![problems] })?
        {
            let (name, bytes) = archive(model, &built)?;
            let file = match (opened.take(), &arguments.out_dir) {
                (Some(file), _) => file,
                (None, Some(folder)) => fmu_file(&folder.join(name))?,
                (None, None) => fmu_file(Path::new(&name))?,
            };
            written.push(format!("\n  {}", file.path().display()));
            file.write(&bytes)?;
        }
    }
    Ok(format!("{} FMUs written{}", written.len(), written.concat()))
}
