//! `linearize`: the linear system near a point, with the eigenvalues of its motion.
//!
//! Does not know: how a linear system is found.

use std::fmt::Write as _;

use clap::Args;

use super::options::{assignment, finite};
use hamel_run::error::Error;
use hamel_run::linearize::{Asked, Linear, Words, linearize};
use hamel_run::model;
use hamel_run::session::Session;

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

/// The matrices for people, or as JSON.
///
/// # Errors
/// Unknown names, problems of the model, and a point where something has no value.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let file = session.find(&arguments.model)?;
    let model = file.model()?;
    let scene = arguments.scene.as_deref().unwrap_or(model::scene_with_inputs(model));
    let asked = Asked {
        set: arguments.set.clone(),
        at: arguments.at.clone(),
        hold: arguments.hold.clone(),
        t: arguments.t,
    };
    let linear = linearize(model, scene, &asked, &Words::OPTIONS)?;
    Ok(if arguments.json { linear.to_json().to_string() } else { to_text(&linear) })
}

/// The matrices with names at rows and columns.
fn to_text(linear: &Linear) -> String {
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
    point(&mut text, "state y0", &linear.state, &linear.y);
    if let Some(told) = &linear.told {
        let _ = writeln!(text, "  start: {told}");
    }
    if !linear.inputs.is_empty() {
        point(&mut text, "inputs u0", &linear.inputs, &linear.u);
    }
    point(&mut text, "rates f", &linear.state, &linear.rates);
    let [a, b, c, d] = &linear.matrices;
    let parts = [
        ("A = df/dy", &linear.state, &linear.state, a),
        ("B = df/du", &linear.state, &linear.inputs, b),
        ("C = dh/dy", &linear.outputs, &linear.state, c),
        ("D = dh/du", &linear.outputs, &linear.inputs, d),
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
    for [re, im] in &linear.eigenvalues {
        let _ = match im {
            0.0 => write!(text, "\n  {}", shown(*re)),
            im => {
                write!(text, "\n  {} {} {} i", shown(*re), if *im < 0.0 { '-' } else { '+' }, shown(im.abs()))
            }
        };
    }
    text
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
