//! A model that is put together from other models: its text with theirs in it.
//!
//! `use "motor.hamel" as motor;` takes what the model of another file declares, each name behind `motor_`, and its
//! Lagrangian is added to that of the model. The text that comes back is a model file, and who reads it needs to know
//! nothing else: behind the items as they are written stand blocks `part motor "motor.hamel" { .. }`. On the algebroid
//! this is the product of the parts' algebroids, and constraints between them are the interaction structure.
//!
//! Source: Jacobs and Yoshimura 2014, Tensor products of Dirac structures and interconnection in Lagrangian mechanics.
//!
//! Deliberately does not know: where files are, who reads them.

mod held;
mod taken;
#[cfg(test)]
mod tests;

use super::ast::{Item, UseItem};
use super::diagnostic::{Diagnostic, Diagnostics, Origin};
use super::elaborate::elaborate;
use super::images::with_items;
use super::parser;
use super::parts::{parts_of, uses};
use hamel_expr::Budget;

use taken::Part;

/// Longer chains go in a circle.
const MAX_DEPTH: usize = 16;

/// The text of a model with the texts of its parts; `read` gives the text of a file that another file names, or why
/// there is none. A text without `use` comes back as it is.
///
/// ```
/// use hamel_lang::spec::{Origin, compose, parse};
///
/// let wheel = "model wheel { param I = 2 where I > 0; coordinate q in angle; lagrangian = I*q_dot^2/2; }";
/// let text = "model pair {
///     use \"wheel.hamel\" as a;
///     use \"wheel.hamel\" as b { I = 3*a_I; }
///     constraint a_q_dot + 2*b_q_dot = 0;
/// }";
/// let origin = Origin { file: "pair.hamel".into(), text: text.into() };
/// let whole = compose(origin, &mut |_, file| Ok(Origin { file: file.into(), text: wheel.into() }))?;
/// let model = parse("pair.hamel", &whole.text)?;
/// assert_eq!(model.base.iter().map(|c| c.name.as_str()).collect::<Vec<_>>(), ["a_q", "b_q"]);
/// # Ok::<(), hamel_lang::spec::Diagnostics>(())
/// ```
///
/// # Errors
/// Problems of the first text that has some: of a part in its own file, and what a part cannot have, at its `use`.
pub fn compose(
    origin: Origin,
    read: &mut dyn FnMut(&str, &str) -> Result<Origin, String>,
) -> Result<Origin, Diagnostics> {
    composed(origin, read, 0)
}

fn composed(
    origin: Origin,
    read: &mut dyn FnMut(&str, &str) -> Result<Origin, String>,
    depth: usize,
) -> Result<Origin, Diagnostics> {
    let text = origin.text.strip_prefix('\u{feff}').unwrap_or(&origin.text);
    if !text.contains("use") {
        return Ok(origin);
    }
    let Some(file) = parser::parse_leniently(text).file else { return Ok(origin) };
    let known: Vec<&str> = parts_of(&file.items).map(|(name, _)| name.text.as_str()).collect();
    let missing: Vec<(&Item, &UseItem)> =
        uses(&file.items).filter(|(_, used)| !known.contains(&used.name.text.as_str())).collect();
    if missing.is_empty() {
        return Ok(origin);
    }
    let here = Origin { file: origin.file.clone(), text: text.to_owned() };
    let refused = |problems: Vec<Diagnostic>| Diagnostics::new(Some(here.clone()), problems);
    let mut parts: Vec<Part> = Vec::new();
    for (item, used) in missing {
        if depth == MAX_DEPTH {
            let message = format!("more than {MAX_DEPTH} models are parts of each other");
            return Err(refused(vec![
                Diagnostic::new(Some(used.file.span), message).with_help("end the chain"),
            ]));
        }
        let part = read(&here.file, &used.file.text).map_err(|why| {
            let message = format!("`{}` cannot be read: {why}", used.file.text);
            let help = "name the file from the folder of this one";
            refused(vec![Diagnostic::new(Some(used.file.span), message).with_help(help)])
        })?;
        let part = composed(part, read, depth + 1)?;
        let outcome = parser::Outcome { is_part: true, ..parser::parse_file(&part.text) };
        let model = elaborate(outcome, part.clone(), Budget::default())?;
        let taken = Part::new((item, used), &file.items, part, model);
        parts.push(taken.map_err(|problem| refused(vec![*problem]))?);
    }
    let sides = taken::side(&file.items, &parts).map_err(|problem| refused(vec![*problem]))?;
    let blocks: String = parts.iter().map(|part| part.block(text)).collect();
    let items = [sides, blocks, taken::once(&file.items, &parts)].concat();
    let undriven = Origin { file: here.file.clone(), text: with_items(text, &items) };
    held::hold(&undriven, &file, &parts).map_err(|(place, reason)| {
        let message = format!("internal: the part `{}` disagrees with its file: {reason}", place.text);
        refused(vec![Diagnostic::new(Some(place.span), message).with_help("please report this")])
    })?;
    let drives: String = parts.iter().map(|part| part.drives(text)).collect();
    Ok(Origin { file: here.file.clone(), text: with_items(text, &(items + &drives)) })
}
