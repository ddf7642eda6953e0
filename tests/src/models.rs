//! The models of `models/specs` by name, and their motion through the interpreter.

use std::path::Path;

use hamel_codegen::scene::{self, BuiltScene, Interpreter, PositionLayout};
use hamel_codegen::spec::{self, Model};
use hamel_expr::rational_to_f64;
use hamel_mechanics::mechanics::{Equations, derive};
use hamel_mechanics::reduction::{Formulation, reduce};
use hamel_runtime::{Dop853, Failure, Integrator, Options, Positions, StateVector, System};

use crate::derived::{Derived, model_of_text, scene_of_text};

/// The text of a model file.
///
/// # Panics
/// When there is none.
pub fn text(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/specs").join(format!("{name}.hamel"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The text of a model file with items added at its end.
///
/// # Panics
/// When the text does not end with a brace.
pub fn text_with(name: &str, items: &str) -> String {
    let text = text(name);
    let body = text.trim_end().strip_suffix('}').expect("a model ends with a brace");
    format!("{body}{items}\n}}\n")
}

/// A model by its name.
///
/// # Panics
/// When it has mistakes.
pub fn model(name: &str) -> Model {
    model_of_text(name, &text(name))
}

/// Names of all model files, sorted.
///
/// # Panics
/// When the folder cannot be read.
pub fn names() -> Vec<String> {
    names_in("specs")
}

/// Model and name of every scene that was generated, sorted by models.
pub fn generated() -> Vec<(&'static str, &'static str)> {
    macro_rules! listed {
        ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => { vec![$(($model, $scene)),*] };
    }
    hamel_models::for_each_scene!(listed)
}

/// Names of all models of the shelf, sorted.
///
/// # Panics
/// When the folder cannot be read.
pub fn names_on_shelf() -> Vec<String> {
    names_in("shelf")
}

fn names_in(folder: &str) -> Vec<String> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models").join(folder);
    let entries = std::fs::read_dir(&folder).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let mut names: Vec<String> = entries
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let stem = path.file_stem()?.to_str()?.to_owned();
            (path.extension()? == "hamel").then_some(stem)
        })
        .collect();
    names.sort();
    names
}

/// The derived equations of a model.
///
/// # Panics
/// When it cannot be reduced or derived.
pub fn equations(name: &str) -> Equations {
    let model = model(name);
    let system = reduce(&model, &Formulation::of(&model)).unwrap_or_else(|e| panic!("{e}"));
    derive(&system).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A scene of a model.
///
/// # Panics
/// When it cannot be built.
pub fn build(name: &str, scene: &str) -> BuiltScene {
    scene::build(&model(name), scene).unwrap_or_else(|e| panic!("{e}"))
}

/// A scene of a model as a program, which is derived once.
///
/// # Panics
/// When it cannot be built.
pub fn derived(name: &str, scene: &str) -> &'static Derived {
    scene_of_text(name, &text(name), scene)
}

/// Right-hand side and energy of a model of the shelf.
///
/// # Panics
/// When there is no such model, or it cannot be built.
pub fn build_from_shelf(name: &str) -> BuiltScene {
    build_member_from_shelf(name, &[])
}

/// Right-hand side and energy of the member with other sizes of a model of the shelf.
///
/// # Panics
/// When there is no such model or size, or it cannot be built.
pub fn build_member_from_shelf(name: &str, sizes: &[(&str, i64)]) -> BuiltScene {
    let sizes: Vec<(String, i64)> = sizes.iter().map(|(name, n)| ((*name).to_owned(), *n)).collect();
    let text = spec::with_sizes(name, &text_from_shelf(name), &sizes).unwrap_or_else(|e| panic!("{e}"));
    let body = text.trim_end().strip_suffix('}').expect("a model ends with a brace");
    // Less than the default scene, which costs several times as much to derive.
    build_from_text(name, &format!("{body}\nscene checked {{ want rhs, energy; }}\n}}\n"), "checked")
}

/// A scene of a model of the shelf.
///
/// # Panics
/// When there is none of this name, or it cannot be built.
pub fn build_scene_from_shelf(name: &str, scene: &str) -> BuiltScene {
    build_from_text(name, &text_from_shelf(name), scene)
}

/// The text of a model file of the shelf.
///
/// # Panics
/// When there is none.
pub fn text_from_shelf(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/shelf").join(format!("{name}.hamel"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn build_from_text(name: &str, text: &str, scene: &str) -> BuiltScene {
    let model = spec::parse(name, text).unwrap_or_else(|e| panic!("{e}"));
    scene::build(&model, scene).unwrap_or_else(|e| panic!("{e}"))
}

/// The default parameters of a scene, some of them replaced.
///
/// # Panics
/// When a name is unknown.
pub fn params(scene: &BuiltScene, replaced: &[(&str, f64)]) -> Vec<f64> {
    let known = scene.params();
    for (name, _) in replaced {
        assert!(known.iter().any(|p| p.name == *name), "no parameter {name}");
    }
    known
        .iter()
        .map(|p| {
            let own = replaced.iter().find(|(name, _)| p.name == *name);
            own.map_or_else(|| rational_to_f64(&p.default), |(_, value)| *value)
        })
        .collect()
}

/// A state whose dimension is known at run time.
#[derive(Clone)]
pub struct State(pub Vec<f64>);

impl StateVector<f64> for State {
    fn as_slice(&self) -> &[f64] {
        &self.0
    }
    fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.0
    }
    fn zeros_like(&self) -> State {
        State(vec![0.0; self.0.len()])
    }
}

/// A prepared scene as a system of the runtime.
pub struct Interpreted<'a>(pub Interpreter<'a>);

impl System<f64> for Interpreted<'_> {
    type State = State;
    fn rhs(&self, t: f64, y: &State, dy: &mut State) {
        self.0.rhs(t, &y.0, &mut dy.0);
    }

    fn domain(&self, t: f64, y: &State) -> Result<(), Failure> {
        let outside = |condition: String| Failure::OutsideDomain { t, condition: condition.leak() };
        self.0.domain(t, &y.0).map_err(outside)
    }
}

/// A prepared scene that has the equations between its coordinates: `K` functions.
pub struct Closed<'a, const K: usize> {
    /// The system.
    pub interpreter: Interpreter<'a>,
    /// How the equations are solved.
    pub layout: &'a PositionLayout,
}

impl<const K: usize> System<f64> for Closed<'_, K> {
    type State = State;
    fn rhs(&self, t: f64, y: &State, dy: &mut State) {
        self.interpreter.rhs(t, &y.0, &mut dy.0);
    }
}

impl<const K: usize> Positions<f64, K> for Closed<'_, K> {
    fn n_equations(&self) -> usize {
        self.layout.n_equations
    }
    fn moved(&self) -> &[usize] {
        &self.layout.moved
    }
    fn residuals(&self, t: f64, y: &State) -> [f64; K] {
        let values = self.interpreter.positions(t, &y.0).expect("equations between coordinates");
        values.try_into().expect("number of equations")
    }
    fn residual_gradients(&self, t: f64, y: &State, gradients: &mut [State; K]) {
        let rows = self.interpreter.position_gradients(t, &y.0).expect("equations between coordinates");
        gradients.iter_mut().zip(rows).for_each(|(gradient, row)| gradient.0 = row);
    }
}

/// A state on a trajectory.
pub struct At<'a> {
    /// Time.
    pub t: f64,
    names: &'a [String],
    values: &'a [f64],
    interpreter: &'a Interpreter<'a>,
}

impl At<'_> {
    /// A state variable.
    ///
    /// # Panics
    /// When there is none of this name.
    pub fn get(&self, name: &str) -> f64 {
        let k =
            self.names.iter().position(|n| n == name).unwrap_or_else(|| panic!("no state variable {name}"));
        self.values[k]
    }

    /// `name1, name2, name3`.
    pub fn vector(&self, name: &str) -> [f64; 3] {
        [1, 2, 3].map(|k| self.get(&format!("{name}{k}")))
    }

    /// `qw, qx, qy, qz`.
    pub fn quaternion(&self) -> [f64; 4] {
        ["qw", "qx", "qy", "qz"].map(|name| self.get(name))
    }

    /// The outputs of the scene, concatenated.
    pub fn outputs(&self) -> Vec<f64> {
        self.interpreter.outputs(self.t, self.values)
    }
}

/// Integrates a scene with the Dormand-Prince method of order 8 at tolerance 1e-13 and visits the states at `times`.
///
/// # Panics
/// When parameters are refused, a state variable has no initial value, or the integration fails.
pub fn follow(
    scene: &BuiltScene,
    replaced: &[(&str, f64)],
    initial: &[(&str, f64)],
    times: &[f64],
    mut visit: impl FnMut(&At),
) {
    let names = scene.state_names();
    let prepared = scene.prepare(&params(scene, replaced)).unwrap_or_else(|e| panic!("{e}"));
    let value = |name: &String| {
        let own = initial.iter().find(|(n, _)| n == name);
        own.unwrap_or_else(|| panic!("{name} has no initial value")).1
    };
    let start = State(names.iter().map(value).collect());
    let system = Interpreted(prepared.clone());
    let options = Options::adaptive(1e-13, 1e-13);
    let mut integrator =
        Integrator::new(&system, Dop853, 0.0, start, options).unwrap_or_else(|e| panic!("{e}"));
    for &t in times {
        if t > integrator.t() {
            integrator.integrate_to(t).unwrap_or_else(|e| panic!("{e}"));
        }
        visit(&At { t, names: &names, values: &integrator.state().0, interpreter: &prepared });
    }
}

/// `n + 1` equally spaced times from zero.
pub fn times(end: f64, n: u32) -> Vec<f64> {
    (0..=n).map(|k| end * f64::from(k) / f64::from(n)).collect()
}

/// Product of quaternions `(w, x, y, z)`.
pub fn quaternion_product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// The unit quaternion of the rotation by `|v|` about `v`.
pub fn rotation_by(v: [f64; 3]) -> [f64; 4] {
    let angle = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let scale = if angle == 0.0 { 0.5 } else { (angle / 2.0).sin() / angle };
    [(angle / 2.0).cos(), scale * v[0], scale * v[1], scale * v[2]]
}

/// `R(q) v`, by the matrix of a unit quaternion.
pub fn rotated(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let conjugate = [q[0], -q[1], -q[2], -q[3]];
    let turned = quaternion_product(quaternion_product(q, [0.0, v[0], v[1], v[2]]), conjugate);
    [turned[1], turned[2], turned[3]]
}

/// The conjugate quaternion.
pub fn conjugate(q: [f64; 4]) -> [f64; 4] {
    [q[0], -q[1], -q[2], -q[3]]
}

/// Fails unless two lists of numbers are the same within `bound`.
///
/// # Panics
/// When they differ by more, or are not numbers.
pub fn close(what: &str, found: &[f64], expected: &[f64], bound: f64) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (k, (a, b)) in found.iter().zip(expected).enumerate() {
        assert!(
            (a - b).abs() <= bound,
            "{what}, component {k}: {a} instead of {b}, off by {:e}",
            (a - b).abs()
        );
    }
}
