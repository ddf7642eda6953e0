//! What is looked at: scenes, and what their code does not say.
//!
//! Does not know: generated code, and what is measured.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use clap::Parser;
use hamel_codegen::spec::{Configuration, MatrixFamily};
use hamel_run::Error;
use hamel_run::model::roles::{self, Role};
use hamel_run::model::{Checked, DEFAULT_SCENE};
use hamel_run::repository::Repository;
use hamel_run::session::Session;

/// Measures rounding errors of all right-hand sides and drifts of long runs; started by `cargo xtask stress`
#[derive(Debug, Parser)]
pub struct Arguments {
    /// Root directory of the repository
    #[arg(long)]
    pub root: PathBuf,
    /// Few states and short runs, against pinned bounds; default scenes alone of models without generated code
    #[arg(long)]
    pub short: bool,
    /// Number of random states per scene
    #[arg(long)]
    pub samples: Option<u64>,
    /// Number of steps per run
    #[arg(long)]
    pub steps: Option<u64>,
    /// Names of models; all when none is given
    pub models: Vec<String>,
}

/// What is measured.
#[derive(Debug)]
pub struct StressRequest {
    /// The scenes to look at.
    pub scenes: Vec<SceneRequest>,
    /// Few states and short runs, against pinned bounds.
    pub short: bool,
    /// Number of states per scene; the program's own choice when absent.
    pub samples: Option<u64>,
    /// Number of steps per run; the program's own choice when absent.
    pub steps: Option<u64>,
    /// Where `stress.md` and the tables go; nowhere when absent.
    pub folder: Option<PathBuf>,
}

/// A scene, and what its code does not say.
#[derive(Clone, Debug)]
pub struct SceneRequest {
    /// The model.
    pub model: Arc<Checked>,
    /// Its text.
    pub text: String,
    /// Name of the scene within the model.
    pub scene: String,
    /// What the possible state variables are.
    pub roles_by_name: BTreeMap<String, Role>,
    /// Entries of rotations that the model has as coordinates, row by row.
    pub rotations_by_name: Vec<Vec<String>>,
    /// The initial values that the model gives.
    pub initial_by_name: BTreeMap<String, f64>,
    /// What the components of the state are; filled by the program.
    pub roles: Vec<Role>,
    /// Initial values of the components; filled by the program.
    pub initial: Vec<f64>,
    /// Places of the entries of rotations that the state has; filled by the program.
    pub rotations: Vec<Vec<usize>>,
}

impl SceneRequest {
    /// Puts roles and initial values in the order of the state.
    pub fn order(&mut self, state: &[String]) {
        let role = |name: &String| self.roles_by_name.get(name).copied().unwrap_or(Role::Velocity);
        self.roles = state.iter().map(role).collect();
        let initial = |(name, role): (&String, &Role)| match (self.initial_by_name.get(name), role) {
            (Some(value), _) => *value,
            (None, Role::Bounded { from, to }) => 0.5 * (from + to),
            (None, Role::Group { identity }) => *identity,
            (None, Role::Mode) => 0.0,
            (None, _) => 0.5,
        };
        let place = |name: &String| state.iter().position(|own| own == name);
        let places = |names: &Vec<String>| names.iter().map(place).collect::<Option<Vec<usize>>>();
        self.rotations = self.rotations_by_name.iter().filter_map(places).collect();
        self.initial = state.iter().zip(&self.roles).map(initial).collect();
    }
}

impl StressRequest {
    /// Reads the models; a run of all of them that is not short writes files.
    ///
    /// # Errors
    /// Unknown names and problems of a model.
    pub fn new(arguments: Arguments) -> Result<StressRequest, Error> {
        let Arguments { root, short, samples, steps, models } = arguments;
        let folder = (models.is_empty() && !short).then(|| root.join("docs"));
        let session = Session::of_repository(Repository::at(root));
        let mut scenes = Vec::new();
        for file in session.find_all(&models)? {
            let model = file.model()?;
            let text = file.text()?;
            let is_compiled = file.repository().is_some();
            // Deriving a scene takes longer than all else in a short run.
            let is_wanted = |scene: &String| is_compiled || !short || scene == DEFAULT_SCENE;
            for scene in model.scene_names().into_iter().filter(is_wanted) {
                let params = roles::all_params(model, &scene, &BTreeMap::new());
                scenes.push(SceneRequest {
                    model: Arc::clone(model),
                    text: text.clone().into_owned(),
                    roles_by_name: roles::roles(model, &params),
                    rotations_by_name: rotations(model),
                    initial_by_name: roles::initial_values(model, &params),
                    scene,
                    roles: Vec::new(),
                    initial: Vec::new(),
                    rotations: Vec::new(),
                });
            }
        }
        Ok(StressRequest { scenes, short, samples, steps, folder })
    }
}

/// Names of the entries of the elements of SO(n) and SE(n) that a model has as coordinates.
fn rotations(model: &Checked) -> Vec<Vec<String>> {
    let is_rotation = |c: &&Configuration| {
        matches!(c.group.family(), MatrixFamily::SpecialOrthogonal | MatrixFamily::Euclidean)
    };
    let entries = |c: &Configuration| c.names.iter().take(c.group.n().pow(2)).cloned().collect();
    model.configurations.iter().filter(is_rotation).map(entries).collect()
}
