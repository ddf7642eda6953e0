//! Starts the program that measures rounding errors and drifts of the compiled models, and tells it about the models.
//!
//! Deliberately does not know: generated code, and what is measured.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use serde::{Deserialize, Serialize};

use crate::codegen_bridge::{self as bridge, Role};
use crate::compiled;
use crate::error::Error;
use crate::workspace::{Spec, Workspace};

/// Name of the package and program.
const PACKAGE: &str = "hamel-stress";

/// What the program reads from standard input.
#[derive(Debug, Serialize, Deserialize)]
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

/// A scene, and what its generated code does not say.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SceneRequest {
    /// Name of the model.
    pub model: String,
    /// Name of the scene within the model.
    pub scene: String,
    /// What the possible state variables are.
    pub roles_by_name: BTreeMap<String, Role>,
    /// The initial values that the model gives.
    pub initial_by_name: BTreeMap<String, f64>,
    /// What the components of the state are; filled by the program.
    #[serde(skip)]
    pub roles: Vec<Role>,
    /// Initial values of the components; filled by the program.
    #[serde(skip)]
    pub initial: Vec<f64>,
}

impl SceneRequest {
    /// Puts roles and initial values in the order of the state.
    pub fn order(&mut self, state: &[&str]) {
        let role = |name: &&str| self.roles_by_name.get(*name).copied().unwrap_or(Role::Velocity);
        self.roles = state.iter().map(role).collect();
        let initial = |(name, role): (&&str, &Role)| match (self.initial_by_name.get(*name), role) {
            (Some(value), _) => *value,
            (None, Role::Bounded { from, to }) => 0.5 * (from + to),
            (None, Role::Group { identity }) => *identity,
            (None, _) => 0.5,
        };
        self.initial = state.iter().zip(&self.roles).map(initial).collect();
    }
}

/// `stress`: measures all models, or the given ones.
///
/// The program prints its summary itself. A run of all models that is not short writes `stress.md`, `stress.csv`
/// and `stress_runs.csv` in `docs`.
///
/// # Errors
/// Unknown names, problems of a model, [`Error::NotCompiled`], and [`Error::Failed`] when a bound is exceeded.
pub fn stress(
    workspace: &Workspace,
    models: &[String],
    short: bool,
    samples: Option<u64>,
    steps: Option<u64>,
) -> Result<String, Error> {
    let specs: Vec<Spec> = if models.is_empty() {
        workspace.specs()?
    } else {
        models.iter().map(|name| workspace.spec(name)).collect::<Result<_, _>>()?
    };
    let mut scenes = Vec::new();
    for spec in &specs {
        let model = bridge::read(workspace, spec)?;
        for scene in bridge::scene_names(&model) {
            let params = bridge::all_params(&model, &scene, &BTreeMap::new());
            scenes.push(SceneRequest {
                model: model.name.clone(),
                roles_by_name: bridge::roles(&model, &params),
                initial_by_name: bridge::initial_values(&model, &params),
                scene,
                roles: Vec::new(),
                initial: Vec::new(),
            });
        }
    }
    let folder = (models.is_empty() && !short).then(|| workspace.root().join("docs"));
    let request = StressRequest { scenes, short, samples, steps, folder };
    let text = serde_json::to_string(&request).map_err(|e| Error::io("the request", e.into()))?;
    let build = compiled::cargo_build(workspace, PACKAGE);
    let program = compiled::run_build(build, PACKAGE, "building the stress tests")?.ok_or_else(|| {
        Error::NotCompiled { what: "stress".into(), reason: "the compiled models do not build".into() }
    })?;
    let fail = |e| Error::io(program.display().to_string(), e);
    let mut child = Command::new(&program).stdin(Stdio::piped()).spawn().map_err(fail)?;
    if let Some(mut stdin) = child.stdin.take() {
        stdin.write_all(text.as_bytes()).map_err(fail)?;
    }
    let status = child.wait().map_err(fail)?;
    if status.success() {
        Ok(String::new())
    } else {
        Err(Error::Failed { step: "stress".into(), status: status.to_string() })
    }
}
