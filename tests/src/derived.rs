//! Scenes as programs, derived once by a version of the generator and kept for every program of tests.
//!
//! A scene is kept in the folder of what is compiled, under a hash of the sources of the generator, of the text of its
//! model, and of its name. `tests/tests/compiled.rs` takes none from there: it derives every scene of the repository,
//! holds it to its certificate, compares it with the generated module, which `cargo xtask generate --check` makes anew
//! as well, and keeps it for the others.
//!
//! Does not know: equations, how a scene is derived.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};

use hamel_codegen::config::store::{Key, Store};
use hamel_codegen::quotient::read_totals_of_file;
use hamel_codegen::scene::{self, BuiltScene, Executable};
use hamel_codegen::spec;
use hamel_expr::rational_to_f64;
use serde::{Deserialize, Serialize};

/// Bytes of all kept scenes together: those of several versions of the generator.
const MAX_BYTES: u64 = 500_000_000;

/// A scene, ready to be run, with the names that go with its program.
#[derive(Debug, Serialize, Deserialize)]
pub struct Derived {
    /// The model.
    pub model: String,
    /// The scene.
    pub scene: String,
    executable: Executable,
    params: Vec<Param>,
    outputs: Vec<Output>,
    matrices: Vec<Matrix>,
}

/// A parameter.
#[derive(Debug, Serialize, Deserialize)]
pub struct Param {
    /// Its name.
    pub name: String,
    /// Its default.
    pub default: f64,
}

/// A group of outputs.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Output {
    /// Its name.
    pub name: String,
    /// Names of its components.
    pub components: Vec<String>,
}

/// As [`scene::Matrix`].
#[derive(Debug, Serialize, Deserialize)]
pub struct Matrix {
    /// Its name; its entries are the output of that name.
    pub name: String,
    /// Numbers of rows and columns.
    pub shape: (usize, usize),
    /// Row and column of each entry, in the order of the output's components.
    pub pattern: Vec<(usize, usize)>,
}

impl Derived {
    fn of(model: &str, built: &BuiltScene) -> Derived {
        let param = |p: &spec::Param| Param { name: p.name.clone(), default: rational_to_f64(&p.default) };
        let output = |o: &hamel_mechanics::mechanics::Output| Output {
            name: o.name.clone(),
            components: o.components.iter().map(|(name, _)| name.clone()).collect(),
        };
        let matrix = |m: &scene::Matrix| Matrix {
            name: m.name.to_owned(),
            shape: m.shape,
            pattern: m.pattern.clone(),
        };
        Derived {
            model: model.to_owned(),
            scene: built.name().to_owned(),
            executable: built.executable(),
            params: built.params().iter().map(param).collect(),
            outputs: built.outputs().iter().map(output).collect(),
            matrices: built.matrices().iter().map(matrix).collect(),
        }
    }

    /// Names of the state.
    pub fn state_names(&self) -> &[String] {
        &self.program.state
    }

    /// Parameters in order.
    pub fn params(&self) -> &[Param] {
        &self.params
    }

    /// The default parameters.
    pub fn defaults(&self) -> Vec<f64> {
        self.params.iter().map(|p| p.default).collect()
    }

    /// Groups of outputs in order.
    pub fn outputs(&self) -> &[Output] {
        &self.outputs
    }

    /// Outputs that are matrices.
    pub fn matrices(&self) -> &[Matrix] {
        &self.matrices
    }

    /// Roles of its functions, and their operations: where a few scenes stand for all, each of these is in one of them.
    pub fn kinds(&self) -> BTreeSet<String> {
        let mut kinds = BTreeSet::new();
        for function in &self.program.functions {
            kinds.insert(function.role.name().to_owned());
            kinds
                .extend(function.instructions.iter().map(|i| format!("{:?}", std::mem::discriminant(&i.op))));
            kinds.extend(function.contractions.first().map(|_| "contraction".to_owned()));
        }
        kinds
    }
}

impl Deref for Derived {
    type Target = Executable;
    fn deref(&self) -> &Executable {
        &self.executable
    }
}

/// A model by its text, which names others from the folder of the specifications.
///
/// # Panics
/// When it has mistakes.
pub fn model_of_text(name: &str, text: &str) -> spec::Model {
    let specs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/specs").join(format!("{name}.hamel"));
    let model = spec::parse(name, text);
    model.and_then(|model| read_totals_of_file(model, &specs)).unwrap_or_else(|e| panic!("{e}"))
}

/// Under which a scene is kept.
fn key_of(model: &str, text: &str, scene: &str) -> Key {
    // Maps of quotients are made from the texts of other models as well.
    let parsed = text.contains("reduces").then(|| model_of_text(model, text));
    let totals = parsed.iter().flat_map(|parsed| &parsed.totals);
    let totals: Vec<&str> = totals.filter_map(|total| Some(total.origin.as_ref()?.text.as_str())).collect();
    Key::of(&(env!("HAMEL_SOURCES"), model, text, scene, totals))
}

fn store() -> Option<Store> {
    folder().map(|folder| Store::new(folder, MAX_BYTES))
}

/// Keeps a scene that was derived from a text, for programs that come later.
pub fn keep(model: &str, text: &str, built: &BuiltScene) {
    if let (Some(store), Ok(derived)) = (store(), serde_json::to_string(&Derived::of(model, built))) {
        store.keep(key_of(model, text, built.name()), &derived);
    }
}

/// A scene of a model with a text: from memory, or from the folder, or derived.
///
/// # Panics
/// When it cannot be built.
pub fn scene_of_text(model: &str, text: &str, scene: &str) -> &'static Derived {
    type Scenes = BTreeMap<String, &'static OnceLock<Derived>>;
    static SCENES: Mutex<Scenes> = Mutex::new(BTreeMap::new());
    let key = key_of(model, text, scene);
    let mut scenes = SCENES.lock().unwrap_or_else(PoisonError::into_inner);
    let cell = *scenes.entry(key.name()).or_insert_with(|| Box::leak(Box::default()));
    drop(scenes);
    cell.get_or_init(|| {
        let kept = store().and_then(|store| store.read(key));
        let kept = kept.and_then(|text| serde_json::from_str::<Derived>(&text).ok());
        if let Some(kept) = kept.filter(|kept| kept.executable.verify().is_ok()) {
            return kept;
        }
        let built = scene::build(&model_of_text(model, text), scene)
            .unwrap_or_else(|e| panic!("{model} {scene}: {e}"));
        keep(model, text, &built);
        Derived::of(model, &built)
    })
}

/// Beside what is compiled: this program is in `target/debug/deps`, or in `target/debug`.
fn folder() -> Option<PathBuf> {
    let program = std::env::current_exe().ok()?;
    let folder = program.parent()?;
    let folder = if folder.ends_with("deps") { folder.parent()? } else { folder };
    Some(folder.join("derived"))
}

#[cfg(test)]
mod tests {
    use super::{Derived, scene_of_text};
    use crate::models;

    #[test]
    fn a_kept_scene_is_the_one_that_is_derived() {
        let text = models::text("euler_disk");
        let kept = scene_of_text("euler_disk", &text, "derivatives");
        let built = models::build("euler_disk", "derivatives");
        let text = serde_json::to_string(&Derived::of("euler_disk", &built)).unwrap();
        assert_eq!(serde_json::to_string(kept).unwrap(), text);
        let read: Derived = serde_json::from_str(&text).unwrap();
        assert_eq!(read.executable, built.executable());
        assert_eq!(read.state_names(), built.state_names());
        assert_eq!(read.params().len(), built.params().len());
    }

    #[test]
    fn another_text_is_another_scene() {
        let [one, two] = [1, 2].map(|k| {
            let text = format!("model mass {{ coordinate x in real; lagrangian = {k}/2*x_dot^2 - x; }}");
            let scene = scene_of_text("mass", &text, "default");
            let mut dy = [0.0; 2];
            scene.prepare(&[]).unwrap().rhs(0.0, &[0.0, 0.0], &mut dy);
            dy[1]
        });
        assert_eq!([one, two], [-1.0, -0.5]);
    }
}
