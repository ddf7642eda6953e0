//! The linear system of a scene near a point, with the eigenvalues of its motion.
//!
//! Near the point, `y' = f + A (y - y0) + B (u - u0)` and `h = h0 + C (y - y0) + D (u - u0)` with the rates `f`, the
//! inputs `u` and the outputs `h` of the model. The derivatives are functions that the generator makes.
//!
//! Does not know: arguments of commands, how a point is shown.

use std::sync::Arc;

use hamel_codegen::scene::{self, Derivative, Executable, told_in_words};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::asked::assignments;
use crate::dynamics::Factory as _;
use crate::eigenvalues::{eigenvalues, sort};
use crate::error::Error;
use crate::forms::Forms;
use crate::info::Info;
use crate::interpreted;
use crate::model::Checked;
use crate::request::json::{by_name, number};
use crate::start::Starts;
use crate::stored::fits;

/// The point of a linear system, by names.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Parameters that differ from the scene's.
    pub set: Vec<(String, f64)>,
    /// Components of the state, in any of its forms; the rest is that of the initial state.
    pub at: Vec<(String, f64)>,
    /// Inputs that differ from the values that the model holds them at.
    pub hold: Vec<(String, f64)>,
    /// The time.
    pub t: f64,
}

/// What messages call the parts of a point.
#[derive(Clone, Copy, Debug)]
pub struct Words {
    /// Parameters.
    pub set: &'static str,
    /// Components of the state.
    pub at: &'static str,
    /// Inputs.
    pub hold: &'static str,
}

impl Words {
    /// Options of the command line.
    pub const OPTIONS: Words = Words { set: "--set", at: "--at", hold: "--hold" };
}

/// `A`, `B`, `C`, `D`, row by row.
pub type Matrices = [Vec<Vec<f64>>; 4];

/// The linear system at a point.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Name of the model.
    pub model: String,
    /// Name of the scene.
    pub scene: String,
    /// Names of the state's components: rows of `A` and `B`, columns of `A` and `C`.
    pub state: Vec<String>,
    /// Names of the inputs: columns of `B` and `D`.
    pub inputs: Vec<String>,
    /// Names of the outputs: rows of `C` and `D`.
    pub outputs: Vec<String>,
    /// Parameters with their values.
    pub params: Vec<(String, f64)>,
    /// The state `y0`.
    pub y: Vec<f64>,
    /// What the state has that nobody gave.
    pub told: Option<String>,
    /// The inputs `u0`.
    pub u: Vec<f64>,
    /// The rates `f`.
    pub rates: Vec<f64>,
    /// `A`, `B`, `C`, `D`, row by row.
    pub matrices: Matrices,
    /// Eigenvalues of `A`, real and imaginary part, the largest real part first.
    pub eigenvalues: Vec<[f64; 2]>,
}

/// The right-hand side of a scene with the derivatives, and the names of the outputs.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Derived {
    executable: Executable,
    outputs: Vec<String>,
}

impl Derived {
    /// Whether the program keeps its rules, is one of the scene, and has matrices of the sizes that the names say.
    fn is_sound(&self, info: &Info) -> bool {
        let (n, n_inputs, n_outputs) = (info.state.len(), info.inputs.len(), self.outputs.len());
        let sizes = [(n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs)];
        fits(&self.executable, info)
            && Derivative::LINEARIZATION.iter().zip(sizes).all(|(derivative, size)| {
                match self.executable.matrix_size(*derivative) {
                    Some(found) => found == size,
                    None => size.0 * size.1 == 0,
                }
            })
    }
}

/// The linear system of a scene at a point; messages use `words`.
///
/// # Errors
/// [`Error::Request`] with every name that is not there, and for a point where something has no value;
/// [`Error::UnknownScene`]; problems of the model; why there is no state with the given components.
pub fn linearize(model: &Arc<Checked>, scene: &str, asked: &Asked, words: &Words) -> Result<Linear, Error> {
    model.known_scene(scene)?;
    let built = interpreted::build(model, scene)?;
    let info = built.info();
    let forms = Forms::of(model, info)?;
    let mut problems = Vec::new();
    let set = assignments(&asked.set, words.set, "parameter", &info.param_names(), &mut problems);
    let given = assignments(&asked.at, words.at, "state", &forms.known(), &mut problems);
    let names: Vec<&str> = info.inputs.iter().map(|input| input.name.as_str()).collect();
    let held = assignments(&asked.hold, words.hold, "input", &names, &mut problems);
    if !problems.is_empty() {
        return Err(Error::Request { problems });
    }
    let starts = Starts::new(model, info, forms)?;
    let (params, y) = starts.choose(&built, &set, &given)?;
    let told = told_in_words(&starts.told([&set, &given], (&params, &y))?);
    let u: Vec<f64> = info.inputs.iter().map(|i| held.get(&i.name).copied().unwrap_or(i.default)).collect();
    let derived = model.cached(
        "linearization",
        scene,
        |derived: &Derived| derived.is_sound(info),
        || {
            let built = scene::build_linearized(model, scene)?;
            Ok(Derived { executable: built.executable(), outputs: built.observed() })
        },
    )?;
    let (rates, matrices) = derived.at((&params, asked.t, &y, &u), words)?;
    let a = DMatrix::from_fn(y.len(), y.len(), |i, j| matrices[0][i][j]);
    let unknown = || Error::unusable(words.at, "is a point where the eigenvalues of A were not found");
    let mut eigenvalues = eigenvalues(&a).ok_or_else(unknown)?;
    sort(&mut eigenvalues);
    Ok(Linear {
        model: info.model.clone(),
        scene: info.scene.clone(),
        state: info.state.clone(),
        inputs: names.into_iter().map(str::to_owned).collect(),
        outputs: derived.outputs,
        params: info.params.iter().map(|p| p.name.clone()).zip(params).collect(),
        eigenvalues,
        y,
        told,
        u,
        rates,
        matrices,
    })
}

impl Derived {
    /// Rates and matrices at parameters, time, state and inputs.
    fn at(
        &self,
        (params, t, y, u): (&[f64], f64, &[f64], &[f64]),
        words: &Words,
    ) -> Result<(Vec<f64>, Matrices), Error> {
        let refused = |reason: String| Error::unusable(words.at, reason);
        let mut interpreter = (self.executable.prepare(params))
            .map_err(|violated| Error::unusable(words.set, format!("violates a condition: {violated}")))?;
        interpreter.set_inputs(u);
        interpreter.check(t, y).map_err(|pivot| refused(format!("is a point where {pivot} vanishes")))?;
        let mut rates = vec![0.0; y.len()];
        interpreter.rhs(t, y, &mut rates);
        let matrices = Derivative::LINEARIZATION.map(|d| interpreter.matrix(d, t, y).unwrap_or_default());
        let numbers = matrices.iter().flatten().flatten().chain(&rates);
        if numbers.into_iter().any(|x| !x.is_finite()) {
            return Err(refused("is a point where the linear system has no value".to_owned()));
        }
        Ok((rates, matrices))
    }
}

impl Linear {
    /// Everything by name.
    pub fn to_json(&self) -> Value {
        let named = |names: &[String], values: &[f64]| by_name(names.iter().map(String::as_str), values);
        let rows = |rows: &[Vec<f64>]| -> Value {
            rows.iter().map(|row| row.iter().copied().map(number).collect::<Value>()).collect()
        };
        let [a, b, c, d] = &self.matrices;
        let (params, values): (Vec<String>, Vec<f64>) = self.params.iter().cloned().unzip();
        let mut answer = Map::new();
        answer.insert("model".into(), self.model.clone().into());
        answer.insert("scene".into(), self.scene.clone().into());
        answer.insert("state".into(), self.state.clone().into());
        answer.insert("inputs".into(), self.inputs.clone().into());
        answer.insert("outputs".into(), self.outputs.clone().into());
        answer.insert("params".into(), named(&params, &values));
        answer.insert("at".into(), named(&self.state, &self.y));
        answer.insert("hold".into(), named(&self.inputs, &self.u));
        if let Some(told) = &self.told {
            answer.insert("start".into(), told.clone().into());
        }
        answer.insert("rates".into(), named(&self.state, &self.rates));
        for (name, matrix) in [("A", a), ("B", b), ("C", c), ("D", d)] {
            answer.insert(name.into(), rows(matrix));
        }
        let eigenvalues = self.eigenvalues.iter().map(|z| z.map(number).into_iter().collect::<Value>());
        answer.insert("eigenvalues".into(), eigenvalues.collect());
        answer.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cache::Cache;
    use crate::model::parse;

    /// Matrices of other sizes than the names say would be read past their ends.
    #[test]
    fn a_stored_program_has_the_sizes_of_its_names() {
        let text = "model m { param k = 2; input u = 0.5; coordinate x in real; lagrangian = x_dot^2/2 - k*x^2/2; \
                    force x_dot = u; output h = k*x; output j = u*x_dot; }";
        let model = Arc::new(Checked::new(parse("m", text, 1).unwrap(), Cache::none()));
        let scene = "controlled";
        let asked = Asked { at: vec![("x".into(), 0.25), ("x_dot".into(), 3.0)], ..Asked::default() };
        let linear = linearize(&model, scene, &asked, &Words::OPTIONS).unwrap();
        let rows = |rows: &[&[f64]]| rows.iter().map(|row| row.to_vec()).collect::<Vec<_>>();
        let [a, b] = [rows(&[&[0.0, 1.0], &[-2.0, 0.0]]), rows(&[&[0.0], &[1.0]])];
        let [c, d] = [rows(&[&[2.0, 0.0], &[0.0, 0.5]]), rows(&[&[0.0], &[3.0]])];
        assert_eq!(linear.matrices, [a, b, c, d]);
        assert_eq!(linear.rates, [3.0, 0.0]);

        let built = scene::build_linearized(&model, scene).unwrap();
        let info = interpreted::build(&model, scene).unwrap().info().clone();
        let derived = Derived { executable: built.executable(), outputs: built.observed() };
        assert!(derived.is_sound(&info));
        let fewer = Derived { outputs: vec!["h".into()], ..derived.clone() };
        assert!(!fewer.is_sound(&info));
        let mut other = info.clone();
        other.inputs.clear();
        assert!(!derived.is_sound(&other));
        // The scene without the derivatives.
        let bare = Derived { executable: model.derive("default").unwrap().executable(), ..derived };
        assert!(!bare.is_sound(&info));
    }
}
