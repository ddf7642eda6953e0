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

mod along;
mod angles;
mod check;
mod discrete;
mod forms;
mod group;
mod initial;
mod map;
mod marked;
mod modules;
mod names;
mod reconstruct;
mod search;
mod section;
mod setting;
#[cfg(test)]
mod tests;
mod total;
mod write;

use hamel_expr::{ExprId, Rational, trace};
use hamel_lang::spec::{self, Diagnostic, Diagnostics, Model, Side};
use hamel_mechanics::mechanics::Quotient;
use num_traits::{One, Signed, Zero};

use group::{SymmetryGroup, Way};
use modules::Module;
use section::Section;
use setting::{FIRST_CONSTRAINT, Generator, Refusal, Setting};
use write::{Pieces, Written, named};

/// A model that was reduced.
#[derive(Clone, Debug)]
pub struct Reduced {
    /// The reduced model in the model language.
    pub text: String,
    /// The report for people.
    pub report: Vec<String>,
    /// The dimension of the group.
    pub dim: usize,
    /// The map from the model to the reduced one, where it was found.
    pub map: Option<ReductionMap>,
}

/// Variables of a reduced model as functions of the model that it was made from, with the proof that it is the quotient
/// of this one by them.
#[derive(Clone, Debug)]
pub struct ReductionMap {
    /// Names of variables of the reduced model, and their functions in the names of the model. A variable that is not
    /// listed is the one of the same name.
    pub images: Vec<(String, String)>,
    /// The proof.
    pub proved: Quotient,
}

impl Reduced {
    /// The reduced model that says to be the quotient of the model of this file, where the map is known.
    ///
    /// ```
    /// let text = "model top { configuration R in SO(3) velocity Omega; lagrangian = dot(Omega, Omega)/2 - 4*R33; }";
    /// let model = hamel_codegen::spec::parse("top.hamel", text).unwrap();
    /// let reduced = hamel_codegen::symmetry::reduce(&model).unwrap();
    /// assert!(reduced.text_of("top.hamel").contains("reduces \"top.hamel\" {\n        a1 = -R32;"));
    /// ```
    pub fn text_of(&self, file: &str) -> String {
        let Some(map) = &self.map else { return self.text.clone() };
        spec::with_items(&self.text, &item(file, &map.images))
    }
}

/// The item `reduces`, a line for each function.
fn item(file: &str, images: &[(String, String)]) -> String {
    let lines: String = images.iter().map(|(name, f)| format!("\n        {name} = {f};")).collect();
    let end = if images.is_empty() { "" } else { "\n    " };
    format!("    reduces {file:?} {{{lines}{end}}}\n")
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
    trace::at("search for symmetries");
    reduce_held(model, |_, _| {})
}

/// As [`reduce`]; the text is shown, with the comparison that texts are held to.
fn reduce_held(
    model: &Model,
    show: impl FnOnce(&str, &mut dyn FnMut(&str) -> Result<(), String>),
) -> Result<Reduced, Diagnostics> {
    let refuse = |Refusal(what, help): Refusal| {
        let message = format!("symmetries of a model with {what} are not looked for");
        model.diagnostics(vec![Diagnostic::new(model.places.lagrangian, message).with_help(help)])
    };
    let mut setting = Setting::new(model).map_err(refuse)?;
    let mut told = setting.told();
    setting.hold_to_motion(&mut told).map_err(|what| disagrees(model, &what))?;
    let further = setting.discrete();
    let lines: Vec<String> = told.iter().map(|t| t.line(&setting)).collect();
    let is_gyroscopic = told.iter().any(|t| !t.is_strict && t.unused.is_none());
    if is_gyroscopic {
        setting.make_gyroscopic();
    }
    let plain = Way { side: Side::Left, is_broken: false, angles: None };
    let mut candidates = vec![setting.candidate(&plain, &lines)];
    let mut others = Vec::new();
    if !lines.is_empty() {
        others.push(Way { is_broken: true, ..plain.clone() });
    }
    if !model.configurations.is_empty() {
        others.push(Way { side: Side::Right, ..plain.clone() });
    }
    if let Some(angles) = setting.angle_group() {
        others.push(Way { angles: Some(angles), ..plain });
    }
    for way in others {
        let other = setting.candidate(&way, &lines);
        let is_new = candidates.iter().all(|c| c.written.text != other.written.text);
        if is_new && other.has_group() {
            candidates.push(other);
        }
    }
    // Rows of attitudes that stay otherwise, each in a setting of its own.
    let mut settings = vec![setting];
    for (k, axis) in settings[0].rows() {
        let takes = |c: &Candidate| {
            c.pieces
                .group
                .fields
                .iter()
                .any(|f| settings[0].configuration_of(f).is_some_and(|(of, _)| of == k))
        };
        if candidates.iter().any(takes) {
            continue;
        }
        let mut other = Setting::new(model).map_err(refuse)?;
        if is_gyroscopic {
            other.make_gyroscopic();
        }
        let Some(way) = other.mark((k, axis)) else { continue };
        let candidate = Candidate { setting: settings.len(), ..other.candidate(&way, &lines) };
        candidates.push(candidate);
        settings.push(other);
    }
    for setting in &settings {
        if let Err(exhausted) = setting.graph.within_budget() {
            return Err(model.diagnostics(vec![model.diagnose(&exhausted.into())]));
        }
    }
    candidates.sort_by_key(|c| !c.has_group());
    candidates.truncate(candidates.iter().filter(|c| c.has_group()).count().max(1));
    if candidates.len() > 1 {
        // Of several groups the one that leaves less to compute; the first of equals.
        candidates.sort_by_cached_key(|c| check::cost(&c.written.text).unwrap_or(u64::MAX));
    }
    let Candidate { pieces, section, written, setting } = candidates.swap_remove(0);
    let mut setting = settings.swap_remove(setting);
    let dim = pieces.group.fields.len();
    if dim == 0 {
        let mut found = pieces.report.join(" ");
        if pieces.only_told {
            found.push_str(
                " None of them moves a coordinate of its own by which the motion could be reduced.",
            );
        }
        let message = format!("`{}` is not reduced: there is no group to reduce it by", model.name);
        let problem = Diagnostic::new(model.places.lagrangian, message).with_help(found);
        return Err(model.diagnostics(vec![problem]));
    }
    if let Err(differs) = setting.compared((&pieces.group, &section), &written, &written.text) {
        return Err(disagrees(model, &differs));
    }
    let found = setting.proved_map((&pieces.group, &section), &written)?;
    let (map, images) = found.map_or((None, None), |(map, images)| (Some(map), Some(images)));
    let (text, started) = setting.started((&pieces.group, &section), &written, images.as_deref());
    show(&text, &mut |text| {
        setting.compared((&pieces.group, &section), &written, text)?;
        match started {
            Some(Ok(())) => setting.starts_alike(&named(images.as_deref()), text),
            _ => Ok(()),
        }
    });
    if let Err(exhausted) = setting.graph.within_budget() {
        return Err(model.diagnostics(vec![model.diagnose(&exhausted.into())]));
    }
    let mut report = [pieces.report, further, written.left].concat();
    report.extend(started.and_then(Result::err));
    report.push(match &map {
        Some(map) => format!("Proved: a quotient of the model, by {} conditions.", map.proved.n_conditions),
        None => "The map is not written: it is not found. Rates are compared at points.".to_owned(),
    });
    Ok(Reduced { text, report, dim, map })
}

fn disagrees(model: &Model, what: &str) -> Diagnostics {
    let message = format!("internal: the reduced model disagrees with `{}`: {what}", model.name);
    let problem = Diagnostic::new(model.places.lagrangian, message).with_help("please report this model");
    model.diagnostics(vec![problem])
}

/// A group that the model can be reduced by, with what it makes of the model.
struct Candidate {
    /// The setting that it is of.
    setting: usize,
    pieces: Pieces,
    section: Section,
    written: Written,
}

impl Candidate {
    fn has_group(&self) -> bool {
        !self.pieces.group.fields.is_empty()
    }
}

impl Setting<'_> {
    /// The group of that kind, and the model reduced by it; `told` are lines on symmetries.
    fn candidate(&mut self, way: &Way, told: &[String]) -> Candidate {
        let everything = self.everything();
        let mut group = self.group(way);
        let mut left = Vec::new();
        let (moved, module) = loop {
            match self.moved(&group) {
                Ok(found) => break found,
                // A field whose module has no end is no part of the group.
                Err((a, why)) => {
                    left.push(format!("Left: {}, {why}.", self.described(&group.fields[a].coefficients)));
                    group = self.without(group, a);
                }
            }
        };
        let mut report: Vec<String> = told.to_vec();
        if told.is_empty() {
            report.push(
                "No symmetry was found among translations, linear fields and translations of groups.".into(),
            );
        }
        for field in &group.fields {
            if !self.keeps(&field.images, &everything) {
                report.push(format!("Of the kinetic energy alone: {}.", self.described(&field.coefficients)));
            }
        }
        let only_told = !told.is_empty() && left.is_empty();
        report.extend(left);
        let pieces = Pieces { group, moved, module, report, only_told };
        let section = self.section(&pieces.group);
        let written = self.written(&pieces, &section);
        Candidate { setting: 0, pieces, section, written }
    }
}

impl Setting<'_> {
    /// Potential energy, forces and constraints that the group moves, by their places in [`Setting::brought`], with
    /// their module; or a field that makes too much of them, and why.
    fn moved(&mut self, group: &SymmetryGroup) -> Result<(Vec<usize>, Option<Module>), (usize, String)> {
        let all = self.brought();
        let mut moved = Vec::new();
        for k in 0..FIRST_CONSTRAINT {
            let own = search::Kept { functions: vec![all[k]], equations: Vec::new() };
            if !group.fields.iter().all(|f| self.keeps(&f.images, &own)) {
                moved.push(k);
            }
        }
        let equations = search::Kept { functions: Vec::new(), equations: self.constraints.clone() };
        if !group.fields.iter().all(|f| self.keeps(&f.images, &equations)) {
            moved.extend(FIRST_CONSTRAINT..all.len());
        }
        if moved.is_empty() {
            return Ok((moved, None));
        }
        let list: Vec<ExprId> = moved.iter().map(|k| all[*k]).collect();
        match self.smallest_module(group, (&moved, &list)) {
            Some(module) => Ok((moved, Some(module))),
            None => {
                let what = write::moved_in_words(&moved);
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

    /// The module of functions, with what mixes constraints taken out where it is smaller then.
    fn smallest_module(
        &mut self,
        group: &SymmetryGroup,
        (moved, list): (&[usize], &[ExprId]),
    ) -> Option<Module> {
        let n = list.len();
        let none = vec![vec![vec![Rational::zero(); n]; n]; group.fields.len()];
        let plain = self.module(group, list, none.clone());
        let first = moved.iter().filter(|k| **k < FIRST_CONSTRAINT).count();
        let Some(twist) = self.twist(group, &list[first..]).filter(|_| first < n) else { return plain };
        let mut whole = none;
        for (lambda, own) in whole.iter_mut().zip(&twist) {
            for (r, row) in own.iter().enumerate() {
                lambda[first + r][first..].clone_from_slice(row);
            }
        }
        let twisted = self.module(group, list, whole);
        match (plain, twisted) {
            (Some(plain), Some(twisted)) if plain.basis.len() <= twisted.basis.len() => Some(plain),
            (plain, twisted) => twisted.or(plain),
        }
    }

    /// A field in words.
    fn described(&self, coefficients: &[Rational]) -> String {
        let model = self.model;
        let mut text = String::new();
        for (generator, q) in self.generators.iter().zip(coefficients).rev().filter(|(_, q)| !q.is_zero()) {
            let what = match *generator {
                Generator::Translation(i) => format!("d/d{}", model.base[i].name),
                Generator::Turned(field) => self.turned_in_words(&field),
                Generator::Linear(i, j) => format!("{} d/d{}", model.base[i].name, model.base[j].name),
                Generator::Left(k, a) => format!("{} of {} in space", along(a), model.configurations[k].name),
                Generator::Right(k, a) => {
                    format!("{} of {} in the body", along(a), model.configurations[k].name)
                }
            };
            text = joined(text, q, &what);
        }
        text
    }
}

/// A sum in words with one more term.
fn joined(text: String, q: &Rational, what: &str) -> String {
    let (sign, size) = if q.is_negative() { (" - ", -q.clone()) } else { (" + ", q.clone()) };
    let factor = if size.is_one() { String::new() } else { format!("{size} ") };
    let sign = if text.is_empty() { sign.trim_start_matches([' ', '+']) } else { sign };
    format!("{text}{sign}{factor}{what}")
}

fn along(a: usize) -> String {
    format!("turn {}", a + 1)
}
