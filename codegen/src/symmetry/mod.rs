//! An unreduced model to the model that is reduced by its symmetries, as text.
//!
//! The fields of an ansatz (translations, linear fields, translations of groups from both sides) that keep Lagrangian,
//! forces and constraints are the null space of linear conditions. The group consists of fields that keep the kinetic
//! energy, each with a coordinate of its own; what potential energy and constraints are made of by it is an advected
//! parameter. The reduced Lagrangian is the one of the model at the identity of the group, with velocities `sum_a xi^a
//! X_a + sdot`. Every relation is proved by the zero test.
//!
//! Source: Marsden and Ratiu 1999, chapters 9 and 13; Cendra, Holm, Marsden and Ratiu 1998 for advected parameters.
//!
//! Does not know: equations of motion, scenes, how a model is run.

mod check;
mod group;
mod modules;
mod search;
mod section;
mod setting;
#[cfg(test)]
mod tests;
mod write;

use hamel_expr::ExprId;
use hamel_lang::spec::{Diagnostic, Diagnostics, Model};
use num_traits::Zero;

use group::SymmetryGroup;
use modules::Module;
use setting::{Generator, Refusal, Setting};
use write::Pieces;

/// A model that was reduced.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The reduced model in the model language.
    pub text: String,
    /// The report for people.
    pub report: Vec<String>,
    /// The dimension of the group.
    pub dim: usize,
}

/// Reduces a model by the symmetries that are found.
///
/// ```
/// let text = "model top { param I: diagonal(3) = [1, 2, 3]; configuration R in SO(3) velocity Omega; \
///             lagrangian = dot(Omega, I*Omega)/2 - 4*R33; }";
/// let model = hamel_codegen::spec::parse("top.hamel", text).unwrap();
/// let reduced = hamel_codegen::symmetry::reduce(&model).unwrap();
/// assert_eq!(reduced.dim, 3);
/// assert!(reduced.text.contains("advected a in R^3"));
/// ```
///
/// # Errors
/// What a model has that is not looked into; a model without a group to reduce it by; a reduced model that disagrees
/// with the model, which is a fault of the generator.
pub fn reduce(model: &Model) -> Result<Reduced, Diagnostics> {
    reduce_altered(model, |text| text)
}

/// As [`reduce`], with the text altered before it is compared with the model.
fn reduce_altered(model: &Model, alter: impl Fn(String) -> String) -> Result<Reduced, Diagnostics> {
    let refuse = |Refusal(what, help): Refusal| {
        let message = format!("symmetries of a model with {what} are not looked for");
        model.diagnostics(vec![Diagnostic::new(model.places.lagrangian, message).with_help(help)])
    };
    let mut setting = Setting::new(model).map_err(refuse)?;
    let everything = setting.everything();
    let known = setting.symmetries(&everything);
    let mut group = setting.group();
    let mut left = Vec::new();
    let (moved, module) = loop {
        match setting.moved(&group) {
            Ok(found) => break found,
            // A field whose module has no end is no part of the group.
            Err((a, why)) => {
                left.push(format!("Left: {}, {why}.", setting.described(&group.fields[a].coefficients)));
                group = setting.without(group, a);
            }
        }
    };
    let mut report: Vec<String> = Vec::new();
    for field in &known {
        report.push(format!("Symmetry: {}.", setting.described(field)));
    }
    if known.is_empty() {
        report.push(
            "No symmetry was found among translations, linear fields and translations of groups.".into(),
        );
    }
    for field in &group.fields {
        if !setting.keeps(&field.images, &everything) {
            report.push(format!("Of the kinetic energy alone: {}.", setting.described(&field.coefficients)));
        }
    }
    report.extend(left.iter().cloned());
    let dim = group.fields.len();
    if dim == 0 {
        let mut found = report.join(" ");
        if !known.is_empty() && left.is_empty() {
            found.push_str(
                " None of them moves a coordinate of its own by which the motion could be reduced.",
            );
        }
        let message = format!("`{}` is not reduced: there is no group to reduce it by", model.name);
        let problem = Diagnostic::new(model.places.lagrangian, message).with_help(found);
        return Err(model.diagnostics(vec![problem]));
    }
    let pieces = Pieces { group, moved, module, report };
    let section = setting.section(&pieces.group);
    let written = setting.written(&pieces, &section);
    let text = alter(written.text.clone());
    if let Err(differs) = setting.compared((&pieces.group, &section), &written, &text) {
        let message = format!("internal: the reduced model disagrees with `{}`: {differs}", model.name);
        let problem = Diagnostic::new(model.places.lagrangian, message).with_help("please report this model");
        return Err(model.diagnostics(vec![problem]));
    }
    if let Err(exhausted) = setting.graph.within_budget() {
        return Err(model.diagnostics(vec![model.diagnose(&exhausted.into())]));
    }
    Ok(Reduced { text, report: pieces.report, dim })
}

impl Setting<'_> {
    /// Potential energy and constraints that the group moves, by their places in [`Setting::brought`], with their
    /// module; or a field that makes too much of them, and why.
    fn moved(&mut self, group: &SymmetryGroup) -> Result<(Vec<usize>, Option<Module>), (usize, String)> {
        let power = search::Kept { functions: vec![self.power], equations: Vec::new() };
        if let Some(a) = (0..group.fields.len()).rev().find(|a| !self.keeps(&group.fields[*a].images, &power))
        {
            return Err((a, "which the forces do not keep".to_owned()));
        }
        let functions = search::Kept { functions: vec![self.potential], equations: Vec::new() };
        let equations = search::Kept { functions: Vec::new(), equations: self.constraints.clone() };
        let all = self.brought();
        let mut moved = Vec::new();
        if !group.fields.iter().all(|f| self.keeps(&f.images, &functions)) {
            moved.push(0);
        }
        if !group.fields.iter().all(|f| self.keeps(&f.images, &equations)) {
            moved.extend(1..all.len());
        }
        if moved.is_empty() {
            return Ok((moved, None));
        }
        let list: Vec<ExprId> = moved.iter().map(|k| all[*k]).collect();
        match self.module(group, &list) {
            Some(module) => Ok((moved, Some(module))),
            None => {
                let what = if moved.contains(&0) { "potential energy or constraints" } else { "constraints" };
                let why = format!("of which more than {} functions are made from {what}", modules::MAX_DIM);
                // A field that keeps everything has no part in it.
                let everything = self.everything();
                let a = (0..group.fields.len())
                    .rev()
                    .find(|a| !self.keeps(&group.fields[*a].images, &everything));
                Err((a.unwrap_or(group.fields.len() - 1), why))
            }
        }
    }

    /// A field in words.
    fn described(&self, coefficients: &[hamel_expr::Rational]) -> String {
        let model = self.model;
        let mut text = String::new();
        for (generator, q) in self.generators.iter().zip(coefficients).rev().filter(|(_, q)| !q.is_zero()) {
            let what = match *generator {
                Generator::Translation(i) => format!("d/d{}", model.base[i].name),
                Generator::Linear(i, j) => format!("{} d/d{}", model.base[i].name, model.base[j].name),
                Generator::Left(k, a) => format!("{} of {} in space", along(a), model.configurations[k].name),
                Generator::Right(k, a) => {
                    format!("{} of {} in the body", along(a), model.configurations[k].name)
                }
            };
            let one = hamel_expr::Rational::from_integer(1.into());
            let (sign, size) =
                if *q < hamel_expr::Rational::zero() { (" - ", -q.clone()) } else { (" + ", q.clone()) };
            let factor = if size == one { String::new() } else { format!("{size} ") };
            let sign = if text.is_empty() { sign.trim_start_matches([' ', '+']) } else { sign };
            text.push_str(&format!("{sign}{factor}{what}"));
        }
        text
    }
}

fn along(a: usize) -> String {
    format!("turn {}", a + 1)
}
