//! The systems of the benchmark of nonholonomic integration: from model files to modules of the measuring program.
//!
//! A file says what a system is. The scenes that are measured are the same for all: the model as hamel writes it, with
//! its invariants and with Taylor coefficients, and with all velocities in the state. The scenes of the file itself are
//! cases, values of parameters, and are no modules.
//!
//! Does not know: how files are written or compared, what is measured.

use std::fmt::Write as _;

use hamel_codegen::config::{Bundle, Config};
use hamel_codegen::spec::{Scene, Want, Wanted};
use hamel_run::Error;
use hamel_run::model::{DEFAULT_SCENE, Model};
use hamel_run::repository::Repository;
use hamel_run::session::Session;

/// Folder of the model files.
pub(crate) const SPECS: &str = "xtask/bench/models";
/// Folder of the modules.
pub(super) const MODULES: &str = "xtask/bench/src/generated";
/// What follows the name of a model whose velocities are all in the state.
const UNREDUCED: &str = "_unreduced";

/// The systems, sorted by name; none where there is no folder.
///
/// # Errors
/// [`Error::Io`], and the problems of all files together.
pub(crate) fn systems(repository: &Repository, session: &Session) -> Result<Vec<Model>, Error> {
    let folder = repository.root().join(SPECS);
    let Ok(listing) = std::fs::read_dir(&folder) else { return Ok(Vec::new()) };
    let mut paths = Vec::new();
    for file in listing {
        let path = file.map_err(|e| Error::io(SPECS, e))?.path();
        if path.extension().is_some_and(|extension| extension == "hamel") {
            paths.push(path.display().to_string());
        }
    }
    paths.sort();
    let (mut models, mut errors) = (Vec::new(), Vec::new());
    for path in &paths {
        match session.find(path).and_then(hamel_run::session::ModelFile::into_model) {
            Ok(model) => models.push(model),
            Err(error) => errors.push(error),
        }
    }
    Error::all_of(errors)?;
    Ok(models)
}

/// A scene that is measured.
fn scene(name: &str, wants: &[Want]) -> Scene {
    Scene {
        name: name.to_owned(),
        fixed: Vec::new(),
        inputs: Vec::new(),
        wants: wants.iter().copied().map(Wanted::Want).collect(),
        drops: Vec::new(),
        circles: Vec::new(),
        carries: Vec::new(),
        formulation: None,
        discrete: None,
        doc: String::new(),
        span: None,
        extent: None,
        places: std::collections::BTreeMap::new(),
    }
}

/// The modules of all systems, with an index that visits them; `command` is what writes them.
///
/// # Errors
/// The problems of all systems together.
pub(super) fn generate(systems: Vec<Model>, command: &str) -> Result<Bundle, Error> {
    if systems.is_empty() {
        return Ok(Bundle::default());
    }
    let names: Vec<String> = systems.iter().map(|model| model.name.clone()).collect();
    let mut models = Vec::new();
    for model in systems {
        let mut unreduced = model.clone();
        unreduced.name.push_str(UNREDUCED);
        unreduced.force_multipliers = true;
        unreduced.scenes =
            vec![scene(DEFAULT_SCENE, &[Want::Rhs, Want::Energy, Want::Constraint, Want::Implicit])];
        let mut reduced = model;
        reduced.scenes = vec![
            scene("invariants", &[Want::Rhs, Want::Energy, Want::Invariants]),
            scene("taylor", &[Want::Rhs, Want::Energy, Want::Taylor]),
        ];
        models.extend([reduced, unreduced]);
    }
    let mut bundle = Config::new().command(command).generate(&models)?;
    // Scenes that every model has, and that nobody measures.
    let is_measured = |scene: &str| [DEFAULT_SCENE, "invariants", "taylor"].contains(&scene);
    let (kept, others) = std::mem::take(&mut bundle.entries).into_iter().partition(|e| is_measured(&e.scene));
    bundle.entries = kept;
    let others: Vec<hamel_program::emit::SceneEntry> = others;
    for entry in &others {
        bundle.files.remove(&format!("{}.rs", entry.module));
    }
    bundle.add_index(&[], command)?;
    let dimension = |module: &str| {
        bundle.entries.iter().find(|entry| entry.module == module).map_or(0, |entry| entry.n_state)
    };
    let mut list = String::new();
    for name in &names {
        let invariants = format!("{name}_invariants");
        let unreduced = format!("{name}{UNREDUCED}");
        let _ = writeln!(
            list,
            "            {name} {}, {invariants} {}, {name}_taylor, {unreduced} {};",
            dimension(name),
            dimension(&invariants),
            dimension(&unreduced)
        );
    }
    let macros = format!(
        "\n/// Calls a macro with every system: `$visit! {{ module dimension, module with invariants dimension, module \
         with\n/// coefficients, module with all velocities dimension; .. }}`.\n\
         #[macro_export]\n\
         macro_rules! for_each_system {{\n    ($visit:ident) => {{\n        $visit! {{\n{list}        }}\n    }};\n}}\n"
    );
    bundle.files.entry("mod.rs".into()).or_default().push_str(&macros);
    Ok(bundle)
}
