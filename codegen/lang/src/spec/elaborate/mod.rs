//! Syntax tree to model: what is declared first, what may use what. All checks of values are the builder's.
//!
//! Deliberately does not know: tokens, equations of motion.

mod algebra_expressions;
mod algebras;
mod bodies;
mod frames;
mod items;
mod lets;
mod loops;
mod named_frames;
mod order;
mod reconstruction;
mod values;
mod variables;

use std::collections::{BTreeMap, BTreeSet};

use self::values::Elaboration;
use crate::spec::ast::{File, Item, ItemKind};
use crate::spec::builder::ModelBuilder;
use crate::spec::diagnostic::{Diagnostics, Origin};
use crate::spec::model::Model;
use crate::spec::motions::Motions;
use crate::spec::names;
use crate::spec::parser::Outcome;
use crate::spec::parts;
use crate::spec::units::{self, DefinitionUnits};
use crate::spec::unused;
use hamel_expr::Budget;

/// Checks what the parser understood.
pub(super) fn elaborate(outcome: Outcome, origin: Origin, budget: Budget) -> Result<Model, Diagnostics> {
    let Some(mut file) = outcome.file else {
        return Err(Diagnostics::new(Some(origin), outcome.problems));
    };
    let mut problems = outcome.problems;
    file.items = parts::joined(file.items, &mut problems);
    let mut elaboration = Elaboration {
        text: &origin.text,
        builder: ModelBuilder::new(&file.name.text),
        weights: BTreeMap::new(),
        poisoned: outcome.poisoned,
        is_spent: false,
        has_families: !file.families.is_empty(),
        loops: file.indices.iter().map(|(_, scope)| *scope).collect(),
        withheld: BTreeSet::new(),
        motions: Motions::default(),
        warnings: Vec::new(),
        algebras: BTreeMap::new(),
        representations: BTreeMap::new(),
    };
    elaboration.builder.budget(budget);
    elaboration.builder.problems = problems;
    elaboration.builder.is_part = outcome.is_part;
    for (keyword, _) in names::ITEMS {
        if elaboration.poisoned.contains(*keyword) {
            elaboration.builder.broken.insert(keyword);
        }
    }
    elaboration.run(&file);
    let definitions = elaboration.definitions(&file.items);
    let (loops, told) = (elaboration.loops, elaboration.warnings);
    let built = elaboration.builder.build_with(Some(origin.clone()));
    let mut model = built.map_err(|problems| problems.once_for(&loops))?;
    // Beside errors they would be noise: a name that is misspelt once is unused as well.
    model.parts = parts::files(&file.items);
    let mut warnings = told;
    warnings.extend(model.warnings.iter().cloned());
    let unused = unused::warnings(&file.items).into_iter();
    // What a part does not use, its own file tells.
    warnings.extend(unused.filter(|w| w.span.is_none_or(|span| !parts::is_of_part(&file.items, span))));
    let (known, contradictions) = units::examine(&model, &definitions);
    model.units = known;
    warnings.extend(contradictions);
    model.warnings = model.diagnostics(warnings).once_for(&loops);
    Ok(model)
}

impl Elaboration<'_> {
    /// Definitions with their documentation and values, which the model does not keep.
    fn definitions(&self, items: &[Item]) -> Vec<DefinitionUnits> {
        let definition = |item: &Item| {
            let ItemKind::Let { name, .. } = &item.kind else { return None };
            let entries = self.builder.values.get(&name.text)?.entries().to_vec();
            Some(DefinitionUnits {
                name: name.text.clone(),
                span: name.span,
                doc: item.doc.join(" "),
                entries,
            })
        };
        items.iter().filter_map(definition).collect()
    }

    /// Forgets motions, and notes the angular velocities of configurations.
    fn note_configurations(&mut self) {
        self.motions.clear();
        self.motions.spins = self.builder.configuration_spins().into_iter().collect();
    }

    fn run(&mut self, file: &File) {
        for line in &file.doc {
            self.builder.doc(line);
        }
        self.builder.place = Some(file.name.span);
        if let Some(reason) = names::refusal(&file.name.text) {
            self.problem(file.name.span, format!("`{}` cannot be used as a name", file.name.text), reason);
            // The builder would say the same without a place.
            self.builder.rename("model_");
        }
        self.declare_sources_and_params(&file.items);
        if let [first, rest @ ..] = self.builder.sizes() {
            let rest: String = rest.iter().map(|s| format!(", `{} = {}`", s.name, s.value)).collect();
            let line = format!("Read with `{} = {}`{rest}.", first.name, first.value);
            self.builder.doc("").doc(&line);
        }
        self.define_algebras(&file.items);
        self.declare_variables(&file.items);
        self.note_configurations();
        self.withhold(&file.items);
        let lets = self.declare_lets(&file.items);
        self.check_indices(file);
        // A frame and an algebroid say what the velocities are that everything else is written in.
        let (first, rest) = lets.needed_first(&frames::expressions(&file.items));
        self.define_lets(&lets, &first);
        self.define_frames(&file.items);
        // The known ones are in the velocities before the frame.
        self.note_configurations();
        self.declare_momenta(&file.items);
        self.define_lets(&lets, &rest);
        for item in &file.items {
            self.use_values(item);
        }
        for item in &file.items {
            self.reconstruct(item);
        }
        for item in &file.items {
            match &item.kind {
                ItemKind::Body(body) => self.weighed_body(body),
                _ => self.named_frame(item),
            }
        }
        for item in &file.items {
            let ItemKind::Initial { name, value } = &item.kind else { continue };
            match self.eval(value) {
                Some(value) => _ = self.builder.at(Some(name.span)).initial(&name.text, &value),
                None => _ = self.builder.broken.insert("initial"),
            }
        }
        self.events(&file.items);
        // What figures show lives in a graph of its own, so that it leaves no trace in generated code.
        // What is wrong with a body has been said.
        let has_bodies = self.builder.problems.is_empty();
        let pictured = pictured(&file.items, has_bodies);
        if !pictured.is_empty() {
            self.builder.begin_views();
            // Their entries are expressions of the other graph.
            self.motions.clear();
            for item in pictured {
                match &item.kind {
                    ItemKind::Body(body) => self.picture(body, &item.doc.join("\n")),
                    _ => self.view(item),
                }
            }
            self.builder.end_views();
        }
    }
}

/// The views, and where there are none the bodies that say where they are in space.
fn pictured(items: &[Item], has_bodies: bool) -> Vec<&Item> {
    let of = |kind: fn(&ItemKind) -> bool| items.iter().filter(|item| kind(&item.kind)).collect::<Vec<_>>();
    let views = of(|kind| matches!(kind, ItemKind::View { .. }));
    if views.is_empty() && has_bodies {
        of(|kind| matches!(kind, ItemKind::Body(body) if body.on.is_none()))
    } else {
        views
    }
}
