//! All checks in order, and the model that results.
//!
//! Deliberately does not know: what is checked.

use super::draft::{ConfigurationDraft, GivenDraft, ModelBuilder};
use super::first_order::misplaced_states;
use super::inputs::{close, misplaced_inputs};
use super::noise::misplaced_noises;
use crate::algebra::LieAlgebra;
use crate::spec::diagnostic::{Diagnostics, Origin, Span};
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::redundant::leave_out;
use crate::spec::unit::Units;
use crate::spec::value::Value;
use crate::spec::view::Views;
use hamel_expr::Graph;

fn configuration(draft: ConfigurationDraft, advected: &[Advected]) -> Configuration {
    let ConfigurationDraft { group, advected: k, velocities, relative, values: _ } = draft;
    let name = advected[k].name.clone();
    let (names, symbols) = advected[k].components.iter().cloned().unzip();
    Configuration { name, advected: k, names, symbols, group, velocities, relative }
}

impl ModelBuilder {
    /// Checks everything and returns the model.
    ///
    /// # Errors
    /// All problems found, in the order of the text.
    pub fn build(self) -> Result<Model, Diagnostics> {
        self.build_with(None)
    }

    pub(in crate::spec) fn build_with(mut self, origin: Option<Origin>) -> Result<Model, Diagnostics> {
        if let Some(reason) = names::refusal(&self.name) {
            self.problem(None, format!("`{}` cannot be used as the name of a model", self.name), reason);
        }
        self.check_conditions();
        let lagrangian = self.check_lagrangian();
        let hamiltonian = self.check_hamiltonian();
        let given = self.check_given();
        let algebroid = self.check_algebroid();
        self.check_beside_frame();
        let stages = self.check_stages();
        self.move_configurations();
        let advected = self.check_advected();
        let first_order = self.check_first_order();
        let connection = self.check_connection();
        let mut constraints = self.check_constraints(&advected, connection.as_deref(), lagrangian);
        let mut virtual_constraints = self.check_virtual_constraints(&constraints);
        let both = (&mut constraints, &mut virtual_constraints);
        let lyapunov = self.check_lyapunov(&advected, connection.as_deref(), lagrangian, both);
        let independent = self.check_independent(&constraints);
        let accelerations = self.used_accelerations(&constraints, &virtual_constraints);
        let forces = self.check_forces();
        self.check_named_values();
        let sections = self.check_sections();
        let events = self.check_events();
        let reconstruction = self.check_reconstructions(connection.as_deref());
        if !self.broken.contains("frame of a body") {
            let frames = self.check_frames(&reconstruction);
            self.check_bodies(&frames, &reconstruction);
        }
        let initial = self.check_initial();
        let totals = self.check_totals();
        let carried = std::mem::take(&mut self.carries);
        let carries = self.check_carries(&carried);
        let quasi_invariances = self.quasi_invariances(&carried);
        let scenes = self.check_scenes(&carries);
        let drives = self.check_drives();
        let noises = self.check_noises();
        self.check_budget();
        if !self.problems.is_empty() {
            return Err(Diagnostics::new(origin, self.problems));
        }
        let by_name = |list: Vec<(String, Value, Option<Span>)>| {
            list.into_iter().filter_map(|(name, _, span)| Some((name, span?))).collect()
        };
        let placed_carries = self.places_of_carries(&carried);
        let first_component = self.connection.first().and_then(|(_, _, span)| *span);
        let places = Places {
            lagrangian: self.lagrangian.or(self.hamiltonian).and_then(|(_, span)| span),
            inner_product: self.inner_product.and_then(|(_, span)| span),
            independent: self.independent.and_then(|(_, span)| span),
            connection: self.derived_connection.and_then(|(_, span)| span).or(first_component),
            outputs: self.output_names.into_iter().filter_map(|(name, span)| Some((name, span?))).collect(),
            declared: self.names.into_iter().filter_map(|(name, of)| Some((name, of.span?))).collect(),
            forces: by_name(self.forces),
            given: self.given.iter().filter_map(GivenDraft::place).collect(),
            initial: by_name(self.initial),
            carries: placed_carries,
        };
        let drafts = std::mem::take(&mut self.configurations);
        let configurations = drafts.into_iter().map(|draft| configuration(draft, &advected)).collect();
        let views_graph = self.views_graph.unwrap_or_else(|| match self.views.is_empty() {
            true => Graph::new(),
            false => self.graph.clone(),
        });
        let mut model = Model {
            views: Views { graph: views_graph, list: self.views },
            name: self.name,
            doc: self.doc,
            sources: self.sources,
            units: Units::default(),
            topic: self.topic.map(|(text, _)| text),
            totals,
            parts: Vec::new(),
            sizes: self.sizes,
            graph: self.graph,
            time: self.time,
            params: self.params,
            param_arrays: self.param_arrays,
            inputs: self.inputs,
            input_arrays: self.input_arrays,
            noises,
            conditions: self.conditions,
            base: self.base,
            algebra: self.algebra.map_or_else(|| LieAlgebra::abelian(0).into(), |(algebra, _)| algebra),
            velocities: self.velocities,
            quasi_velocities: self.quasi_velocities,
            momenta: self.momenta,
            carries,
            quasi_invariances,
            wants_digits: self.wants_digits,
            connection,
            algebroid,
            frame: self.frame.map(|(frame, _)| frame),
            given,
            derived_connection: self.derived_connection.map(|(kind, _)| kind),
            action: self.action.map_or(Side::Left, |(side, _)| side),
            stages,
            advected,
            configurations,
            first_order,
            lagrangian,
            hamiltonian,
            constraints,
            implied: Vec::new(),
            accelerations,
            virtual_constraints,
            independent,
            force_multipliers: self.multipliers.is_some(),
            modes: self.modes,
            multipliers: self.multiplier_symbols,
            lyapunov,
            forces,
            casimirs: self.casimirs,
            outputs: self.outputs,
            sections,
            events,
            reconstruction,
            initial,
            scenes,
            places,
            warnings: Diagnostics::new(None, self.left_out),
            origin,
        };
        let mut problems = misplaced_inputs(&model);
        problems.extend(misplaced_states(&model));
        problems.extend(misplaced_noises(&model));
        if problems.is_empty() {
            problems.extend(close(&mut model, &drives));
        }
        if problems.is_empty() {
            problems.extend(leave_out(&mut model));
        }
        if problems.is_empty() { Ok(model) } else { Err(Diagnostics::new(model.origin, problems)) }
    }

    /// What is wrong with expressions that were not made says nothing.
    fn check_budget(&mut self) {
        let views = self.views_graph.as_ref().map_or(Ok(()), Graph::within_budget);
        let Err(exhausted) = self.graph.within_budget().and(views) else { return };
        let message = exhausted.message();
        self.problems.retain(|problem| problem.message == message);
        if self.problems.is_empty() {
            let span = self.lagrangian.as_ref().and_then(|(_, span)| *span);
            self.problem(span, message, exhausted.help());
        }
    }
}
