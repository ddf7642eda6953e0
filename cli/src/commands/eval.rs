//! `eval`: values of a scene at given states, JSON in and out.
//!
//! Does not know: how anything is evaluated, what a request looks like.

use clap::Args;

use super::options::SceneOptions;
use hamel_run::dynamics::Factory;
use hamel_run::error::Error;
use hamel_run::evaluate::{self, EvalRequest};
use hamel_run::forms::Forms;
use hamel_run::request::{read_request, sizes};
use hamel_run::session::Session;

/// Evaluate derivatives, energy and outputs at given states, JSON in and out
///
/// Reads a request from standard input:
///
/// {"params": {name: number, ..}, "states": [{name: number, ..}, ..], "t": number, "sizes": {name: number, ..},
/// "accelerations": [{velocity: number, ..}, ..]}
///
/// Missing parameters take the model's defaults, a missing t is 0, and every state names all state variables; where the
/// model names momenta, all velocities may be given for momenta of the state, and all momenta for velocities.
/// Accelerations, one object per state, are for scenes that want inverse_dynamics: the answer then has the forces.
///
/// Prints one line, with one entry per state throughout:
///
/// {"model", "state": [names], "derivatives": [[..], ..], "energy": [..] or null, "outputs": {group: [{..}, ..], ..}}
/// and "inverse_dynamics": [{velocity: number, ..}, ..] where accelerations are given
///
/// docs/command-line.md says more about both.
#[expect(rustdoc::broken_intra_doc_links, reason = "the help of the command shows JSON as it is")]
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  echo '{\"states\": [{\"Omega1\": 1, \"Omega2\": 0.2, \"Omega3\": 0.1}]}' | hamel eval free_rigid_body
  hamel eval heavy_top --scene lagrange < request.json"
)]
pub struct Arguments {
    /// Which scene, and who evaluates it.
    #[command(flatten)]
    pub scene: SceneOptions,
}

/// The answer to a JSON request, on one line.
///
/// # Errors
/// Everything that can be wrong with names, the request, parameters and states.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let file = arguments.scene.find(session)?;
    let text = read_request("{\"states\": [{\"Omega1\": 0.1, ..}]}")?;
    // A request may ask for another member of a family. A wrong name of a scene is told before a missing request.
    let sizes = sizes::of_request(&text);
    let file = match &sizes {
        Ok(sizes) => file.sized(sizes),
        Err(_) => file,
    };
    let scene = arguments.scene.choice_of(&file)?.open(&file)?;
    sizes?;
    if !EvalRequest::has_other_names(&text, scene.info())? {
        return eval_text(&scene, &text);
    }
    let forms = Forms::of(file.model()?, scene.info())?;
    let request = EvalRequest::parse_in(&text, scene.info(), &forms)?;
    answer(&scene, &request)
}

/// Evaluates a JSON request.
///
/// # Errors
/// As [`EvalRequest::parse`] and [`hamel_run::evaluate::eval`].
pub fn eval_text(scene: &dyn Factory, text: &str) -> Result<String, Error> {
    let request = EvalRequest::parse(text, scene.info())?;
    answer(scene, &request)
}

fn answer(scene: &dyn Factory, request: &EvalRequest) -> Result<String, Error> {
    let response = evaluate::eval(scene, request)?;
    Ok(response.to_json(scene.info()).to_string())
}
