//! `linearize`: the linear system near a point, with the eigenvalues of its motion.
//!
//! Does not know: how anything is differentiated.

use std::fmt::Write as _;

use clap::Args;
use hamel_codegen::scene::{self, BuiltScene, Derivative, told_in_words};
use nalgebra::DMatrix;
use serde_json::{Map, Value};

use super::options::{assignment, assignments, finite};
use hamel_run::dynamics::Factory as _;
use hamel_run::error::Error;
use hamel_run::forms::Forms;
use hamel_run::interpreted;
use hamel_run::model;
use hamel_run::request::json::{by_name, number};
use hamel_run::session::Session;
use hamel_run::start::Starts;

/// Print the linear system near a point: the derivatives A, B, C, D of rates and outputs by state and inputs
///
/// Near the point, y' = f + A (y - y0) + B (u - u0), h = h0 + C (y - y0) + D (u - u0), where h are the outputs of the
/// model. The point is the model's initial state, with inputs at the values that they are held at; --at and --hold
/// change components. The eigenvalues of A decide whether a motion near an equilibrium stays there.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel linearize snakeboard --at phi=0 psi_dot=0 phi_dot=0 s=1
  hamel linearize mobile_robot --hold tau1=0.2 --json"
)]
pub struct Arguments {
    /// Name of a model, or a path that ends in .hamel
    pub model: String,
    /// Name of the scene [default: controlled where the model has inputs, otherwise default]
    #[arg(long)]
    pub scene: Option<String>,
    /// Parameters that differ from the model's defaults
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub set: Vec<(String, f64)>,
    /// Components of the state; the others keep their default
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub at: Vec<(String, f64)>,
    /// Inputs that differ from the values that the model holds them at
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub hold: Vec<(String, f64)>,
    /// Time
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    pub t: f64,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// The linear system at a point.
struct Linear {
    state: Vec<String>,
    inputs: Vec<String>,
    outputs: Vec<String>,
    params: Vec<(String, f64)>,
    y: Vec<f64>,
    /// What the state has that nobody gave.
    told: Option<String>,
    u: Vec<f64>,
    rates: Vec<f64>,
    /// `A`, `B`, `C`, `D`, row by row.
    matrices: [Vec<Vec<f64>>; 4],
    /// Eigenvalues of `A`, real and imaginary part.
    eigenvalues: Vec<[f64; 2]>,
}

/// The matrices for people, or as JSON.
///
/// # Errors
/// Unknown names, problems of the model, and a point where something has no value.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let file = session.find(&arguments.model)?;
    let model = file.model()?;
    let scene = arguments.scene.as_deref().unwrap_or(model::scene_with_inputs(model));
    model.known_scene(scene)?;
    let built = interpreted::build(model, scene)?;
    let info = built.info().clone();
    let forms = Forms::of(model, &info)?;
    let mut problems = Vec::new();
    let set = assignments(&arguments.set, "--set", "parameter", &info.param_names(), &mut problems);
    let given = assignments(&arguments.at, "--at", "state", &forms.known(), &mut problems);
    let names: Vec<&str> = info.inputs.iter().map(|input| input.name.as_str()).collect();
    let held = assignments(&arguments.hold, "--hold", "input", &names, &mut problems);
    if !problems.is_empty() {
        return Err(Error::Request { problems });
    }
    let starts = Starts::new(model, &info, forms)?;
    let (params, y) = starts.choose(&built, &set, &given)?;
    let told = told_in_words(&starts.told([&set, &given], (&params, &y))?);
    let u: Vec<f64> = info.inputs.iter().map(|i| held.get(&i.name).copied().unwrap_or(i.default)).collect();
    let linear =
        Linear { told, ..linear(&scene::build_linearized(model, scene)?, (&params, arguments.t, &y, &u))? };
    Ok(if arguments.json { linear.to_json(&info.model, scene).to_string() } else { linear.to_text() })
}

fn linear(scene: &BuiltScene, (params, t, y, u): (&[f64], f64, &[f64], &[f64])) -> Result<Linear, Error> {
    let refused = |reason: String| Error::unusable("--at", reason);
    let mut interpreter = scene
        .prepare(params)
        .map_err(|violated| Error::unusable("--set", format!("violates a condition: {violated}")))?;
    interpreter.set_inputs(u);
    interpreter.check(t, y).map_err(|pivot| refused(format!("is a point where {pivot} vanishes")))?;
    let mut rates = vec![0.0; y.len()];
    interpreter.rhs(t, y, &mut rates);
    let matrices = Derivative::LINEARIZATION.map(|d| interpreter.matrix(d, t, y).unwrap_or_default());
    let numbers = matrices.iter().flatten().flatten().chain(&rates);
    if numbers.into_iter().any(|x| !x.is_finite()) {
        return Err(refused("is a point where the linear system has no value".to_owned()));
    }
    let a = DMatrix::from_fn(y.len(), y.len(), |i, j| matrices[0][i][j]);
    let mut eigenvalues: Vec<[f64; 2]> = match a.is_empty() {
        true => Vec::new(),
        false => a.complex_eigenvalues().iter().map(|z| [z.re, z.im]).collect(),
    };
    eigenvalues.sort_by(|x, y| y[0].total_cmp(&x[0]).then(y[1].total_cmp(&x[1])));
    Ok(Linear {
        state: scene.state_names(),
        inputs: scene.inputs().iter().map(|input| input.name.clone()).collect(),
        outputs: scene.observed(),
        params: scene.params().iter().map(|p| p.name.clone()).zip(params.iter().copied()).collect(),
        y: y.to_vec(),
        told: None,
        u: u.to_vec(),
        rates,
        matrices,
        eigenvalues,
    })
}

impl Linear {
    fn to_json(&self, model: &str, scene: &str) -> Value {
        let named = |names: &[String], values: &[f64]| by_name(names.iter().map(String::as_str), values);
        let rows = |rows: &[Vec<f64>]| -> Value {
            rows.iter().map(|row| row.iter().copied().map(number).collect::<Value>()).collect()
        };
        let [a, b, c, d] = &self.matrices;
        let (params, values): (Vec<String>, Vec<f64>) = self.params.iter().cloned().unzip();
        let mut answer = Map::new();
        answer.insert("model".into(), model.into());
        answer.insert("scene".into(), scene.into());
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

    fn to_text(&self) -> String {
        let mut text = String::new();
        let row = |text: &mut String, name: &str, values: &[f64]| {
            let _ = write!(text, "  {name:<12}");
            for x in values {
                let _ = write!(text, " {:>12}", shown(*x));
            }
            text.push('\n');
        };
        let point = |text: &mut String, title: &str, names: &[String], values: &[f64]| {
            let _ = writeln!(text, "{title}");
            for (name, x) in names.iter().zip(values) {
                row(text, name, &[*x]);
            }
        };
        point(&mut text, "state y0", &self.state, &self.y);
        if let Some(told) = &self.told {
            let _ = writeln!(text, "  start: {told}");
        }
        if !self.inputs.is_empty() {
            point(&mut text, "inputs u0", &self.inputs, &self.u);
        }
        point(&mut text, "rates f", &self.state, &self.rates);
        let [a, b, c, d] = &self.matrices;
        let parts = [
            ("A = df/dy", &self.state, &self.state, a),
            ("B = df/du", &self.state, &self.inputs, b),
            ("C = dh/dy", &self.outputs, &self.state, c),
            ("D = dh/du", &self.outputs, &self.inputs, d),
        ];
        for (title, rows, columns, matrix) in parts {
            if rows.is_empty() || columns.is_empty() {
                continue;
            }
            let _ = write!(text, "{title:<14}");
            for name in columns {
                let _ = write!(text, " {name:>12}");
            }
            text.push('\n');
            for (name, values) in rows.iter().zip(matrix) {
                row(&mut text, name, values);
            }
        }
        text.push_str("eigenvalues of A");
        for [re, im] in &self.eigenvalues {
            let _ = match im {
                0.0 => write!(text, "\n  {}", shown(*re)),
                im => write!(
                    text,
                    "\n  {} {} {} i",
                    shown(*re),
                    if *im < 0.0 { '-' } else { '+' },
                    shown(im.abs())
                ),
            };
        }
        text
    }
}

/// Six digits, and zero for both zeros.
pub(super) fn shown(x: f64) -> String {
    match x {
        0.0 => "0".to_owned(),
        x if (1e-3..1e6).contains(&x.abs()) => {
            let text = format!("{x:.6}");
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        }
        x => format!("{x:.5e}"),
    }
}
