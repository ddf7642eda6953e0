//! Holds a model that says to be the quotient of others to what it says.
//!
//! `reduces "full.hamel" { Gamma = transpose(R)*[0, 0, 1]; }` names a model and functions of it. Both are reduced to
//! algebroids, and the map has to relate these, the Lagrangians, constraints and forces. A model that the file itself
//! is the quotient of follows: reduction by stages is a chain of such items.
//!
//! Does not know: how anything is proved.

use std::collections::BTreeMap;
use std::path::Path;

use hamel_expr::ExprId;
use hamel_lang::spec::{
    Diagnostic, Diagnostics, Model, Origin, Scene, Total, Want, Wanted, parse_with_images,
};
pub use hamel_mechanics::mechanics::Quotient;
use hamel_mechanics::mechanics::{NotQuotient, quotient_of};
use hamel_mechanics::reduction::{Formulation, reduce};

use crate::files::Files;

/// Longer chains go in a circle.
const MAX_STEPS: usize = 16;

/// Conditions that are told; the others of their kind have the same reason most often.
const MAX_TOLD: usize = 2;

/// One step of a chain, proved.
#[derive(Clone, Debug)]
pub struct Step {
    /// File of the quotient.
    pub quotient: String,
    /// File of the model that it is the quotient of.
    pub total: String,
    /// The proof.
    pub proved: Quotient,
}

/// Proves every `reduces` of a model, and of the models that they name; `read` gives the text of a file that another
/// file names, or why there is none.
///
/// # Errors
/// What does not hold, at its place in the text that says it, for each text.
pub fn hold(
    model: &Model,
    read: &mut dyn FnMut(&str, &str) -> Result<Origin, String>,
) -> Result<Vec<Step>, Vec<Diagnostics>> {
    let mut steps = Vec::new();
    hold_from(model, read, &mut steps, 0)?;
    Ok(steps)
}

/// As [`hold`] for the model of a file: other files are named from the folder of the one that names them.
///
/// # Errors
/// As [`hold`].
pub fn hold_file(model: &Model, path: &Path) -> Result<Vec<Step>, Vec<Diagnostics>> {
    let mut files = Files::of(shown(model), path);
    hold(model, &mut |here, file| files.read(here, file))
}

/// The model with the texts of the models that it is the quotient of, where a scene wants the map: what a scene is
/// built from. `read` is that of [`hold`].
///
/// # Errors
/// A file that cannot be read, at its name.
pub fn read_totals(
    mut model: Model,
    read: &mut dyn FnMut(&str, &str) -> Result<Origin, String>,
) -> Result<Model, Diagnostics> {
    let wants = |scene: &Scene| scene.wants.contains(&Wanted::Want(Want::Quotient));
    if !model.scenes.iter().any(wants) {
        return Ok(model);
    }
    let here = model.origin.as_ref().map_or(String::new(), |origin| origin.file.clone());
    for k in 0..model.totals.len() {
        let origin = of_total(&model, &here, &model.totals[k], read)?;
        model.totals[k].origin = Some(origin);
    }
    Ok(model)
}

/// As [`read_totals`] for the model of a file, as [`hold_file`].
///
/// # Errors
/// As [`read_totals`].
pub fn read_totals_of_file(model: Model, path: &Path) -> Result<Model, Diagnostics> {
    let mut files = Files::of(shown(&model), path);
    read_totals(model, &mut |here, file| files.read(here, file))
}

/// The model with the texts that another reading of it has: the same text with further items.
#[must_use]
pub fn with_totals_of(mut model: Model, other: &Model) -> Model {
    for total in &mut model.totals {
        let known = other.totals.iter().find(|known| known.file == total.file);
        total.origin = known.and_then(|known| known.origin.clone());
    }
    model
}

/// The text that an item names.
fn of_total(
    model: &Model,
    here: &str,
    total: &Total,
    read: &mut dyn FnMut(&str, &str) -> Result<Origin, String>,
) -> Result<Origin, Diagnostics> {
    read(here, &total.file).map_err(|why| {
        let message = format!("`{}` cannot be read: {why}", total.file);
        let help = "name the file from the folder of this one";
        Diagnostics::new(model.origin.clone(), vec![Diagnostic::new(total.place, message).with_help(help)])
    })
}

/// What the file of a model is shown as.
fn shown(model: &Model) -> &str {
    model.origin.as_ref().map_or("", |origin| origin.file.as_str())
}

fn hold_from(
    model: &Model,
    read: &mut dyn FnMut(&str, &str) -> Result<Origin, String>,
    steps: &mut Vec<Step>,
    depth: usize,
) -> Result<(), Vec<Diagnostics>> {
    let here = model.origin.as_ref().map_or("", |origin| origin.file.as_str());
    for total in &model.totals {
        let said = |problem: Diagnostic| vec![Diagnostics::new(model.origin.clone(), vec![problem])];
        if depth == MAX_STEPS {
            let message = format!("more than {MAX_STEPS} models are quotients of each other");
            return Err(said(Diagnostic::new(total.place, message).with_help("end the chain")));
        }
        let origin = of_total(model, here, total, read).map_err(|problems| vec![problems])?;
        let (of_total, proved) =
            related(model, total, &origin).map_err(|why| why.diagnostics(model, total))?;
        steps.push(Step { quotient: here.to_owned(), total: origin.file.clone(), proved });
        hold_from(&of_total, read, steps, depth + 1)?;
    }
    Ok(())
}

/// Why a model is not seen to be the quotient of another.
pub(crate) enum Unrelated {
    /// Texts that cannot be read.
    Texts(Vec<Diagnostics>),
    /// Conditions.
    Conditions(Vec<NotQuotient>),
}

impl Unrelated {
    /// The problems of every text, at their places.
    pub(crate) fn diagnostics(self, model: &Model, total: &Total) -> Vec<Diagnostics> {
        match self {
            Unrelated::Texts(problems) => problems,
            Unrelated::Conditions(list) => {
                let mut problems: Vec<Diagnostic> =
                    list.iter().take(MAX_TOLD).map(|problem| told(problem, total)).collect();
                if let (Some(last), n @ 1..) = (problems.last_mut(), list.len().saturating_sub(MAX_TOLD)) {
                    last.message.push_str(&format!("; {n} more conditions do not hold"));
                }
                vec![Diagnostics::new(model.origin.clone(), problems)]
            }
        }
    }
}

/// The model of an item, and the proof that the model is its quotient.
pub(crate) fn related(model: &Model, total: &Total, origin: &Origin) -> Result<(Model, Quotient), Unrelated> {
    let here = |problems: Vec<Diagnostic>| Diagnostics::new(model.origin.clone(), problems);
    let budget = model.graph.budget();
    let (other, n_own) = parse_with_images(budget, origin, &total.images).map_err(|problems| {
        let mut list = Vec::new();
        if !problems.of_images.is_empty() {
            list.push(here(problems.of_images));
        }
        if !problems.of_model.is_empty() {
            list.push(problems.of_model);
        }
        Unrelated::Texts(list)
    })?;
    let mut problems = Vec::new();
    if let Some(noisy) = [model, &other].into_iter().find(|of| !of.noises.is_empty()) {
        let message = format!("`{}` has noise, of which the map says nothing", noisy.name);
        let help = "leave the noise out of both, or `reduces`";
        return Err(Unrelated::Texts(vec![here(vec![
            Diagnostic::new(total.place, message).with_help(help),
        ])]));
    }
    for (image, output) in total.images.iter().zip(&other.outputs[n_own..]) {
        let (wanted, found) = (image.components.len(), output.components.len());
        if wanted != found {
            let span = image.places.map(|(_, value)| value).or(total.place);
            let numbers = |n: usize| format!("{n} number{}", if n == 1 { "" } else { "s" });
            let message = format!("`{}` has {}, found {}", image.name, numbers(wanted), numbers(found));
            problems.push(Diagnostic::new(span, message));
        }
    }
    if !problems.is_empty() {
        return Err(Unrelated::Texts(vec![here(problems)]));
    }
    let reduced = |of: &Model| reduce(of, &Formulation::of(of)).map_err(|why| Unrelated::Texts(vec![why]));
    let (system, quotient) = (reduced(&other)?, reduced(model)?);
    let names = total.images.iter().flat_map(|image| image.components.iter().cloned());
    let values = system.outputs[n_own..].iter().flat_map(|o| o.components.iter().map(|(_, e)| *e));
    let images: BTreeMap<String, ExprId> = names.zip(values).collect();
    let proved = quotient_of(&system, &quotient, &other.configurations, &images);
    proved.map(|proved| (other, proved)).map_err(Unrelated::Conditions)
}

/// A condition that fails, at the function that it is about, or at the name of the file.
fn told(problem: &NotQuotient, total: &Total) -> Diagnostic {
    let at = |name: &str| {
        let image = total.images.iter().find(|image| image.components.iter().any(|c| c == name));
        image.and_then(|image| image.places).map(|(_, value)| value).or(total.place)
    };
    let file = &total.file;
    match problem {
        NotQuotient::Refused { is_quotient, has } => {
            let whose = if *is_quotient { "this model".to_owned() } else { format!("`{file}`") };
            Diagnostic::new(total.place, format!("{whose} has {has}"))
                .with_help("`reduces` relates models with a Lagrangian and constraints on velocities")
        }
        NotQuotient::NoImage { name } => Diagnostic::new(
            total.place,
            format!("`{name}` is no function of `{file}`, which has no `{name}`"),
        )
        .with_help(format!("add `{name} = ..;`")),
        NotQuotient::NotOnBase { name, is_velocity } => {
            let (what, help) = if *is_velocity {
                ("is not affine in the velocities", "give it by coordinates and velocities, linear in these")
            } else {
                (
                    "depends on more than coordinates and time",
                    "give parameters by parameters, coordinates by coordinates",
                )
            };
            Diagnostic::new(at(name), format!("the function for `{name}` {what} of `{file}`")).with_help(help)
        }
        NotQuotient::NoValue => {
            Diagnostic::new(total.place, "the model divides by zero where the functions lead")
                .with_help("change them")
        }
        NotQuotient::Violated { relation, residual, is_proved } => {
            let message = match (is_proved, residual.is_empty()) {
                (true, _) => format!("{relation} differs by `{residual}`"),
                (false, true) => format!("{relation} does not hold, or it is not seen to"),
                (false, false) => format!("{relation} is not seen to agree: `{residual}` is left"),
            };
            Diagnostic::new(total.place, format!("this model is not the quotient of `{file}`: {message}"))
                .with_help("change the functions, or one of the models")
        }
    }
}
