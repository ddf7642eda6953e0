//! Scenes: fixed parameters, outputs wanted, coordinates left out, angles carried as points of the circle.
//!
//! Deliberately does not know: what a scene changes in the equations.

use std::collections::BTreeMap;

use super::draft::{CarryDraft, DeclaredAs, Located, ModelBuilder, SceneDraft};
use crate::spec::diagnostic::{Diagnostic, Span};
use crate::spec::discrete::{Discrete, Retraction};
use crate::spec::layout::component_help;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::want::{Want, Wanted};
use hamel_expr::{Rational, SymbolId};

impl ModelBuilder {
    /// A scene: parameters fixed to numbers (in the order of their components) and what is wanted: names of outputs, or
    /// derivatives of the right-hand side such as `jacobian`.
    pub fn scene(
        &mut self,
        name: &str,
        fixed: &[(&str, &[Rational])],
        wants: &[&str],
        doc: &str,
    ) -> &mut Self {
        let here = self.here;
        let fixed = fixed.iter().map(|(n, v)| ((*n).to_owned(), v.to_vec(), here)).collect();
        let wants = wants.iter().map(|n| ((*n).to_owned(), here)).collect();
        self.located_scene(name, fixed, [wants, Vec::new(), Vec::new(), Vec::new()], Vec::new(), (doc, None))
    }

    /// What all scenes want besides their own wants: `digits`, and nothing else.
    pub(in crate::spec) fn want_of_all_scenes(&mut self, name: &str) -> &mut Self {
        let here = self.here;
        if name == Want::Digits.name() {
            self.wants_digits = true;
        } else {
            let help = "all scenes together can want `digits` alone; write the others into a `scene name { want ..; }`";
            self.problem(here, format!("`{name}` is wanted by a scene, not by the model"), help);
        }
        self
    }

    /// All scenes want `digits`: their functions carry rounding errors where they lose digits.
    pub fn want_digits(&mut self) -> &mut Self {
        self.want_of_all_scenes(Want::Digits.name())
    }

    pub(in crate::spec) fn located_scene(
        &mut self,
        name: &str,
        fixed: Vec<(String, Vec<Rational>, Option<Span>)>,
        [wants, drops, circles, inputs]: [Vec<Located>; 4],
        carries: Vec<CarryDraft>,
        (doc, extent): (&str, Option<Span>),
    ) -> &mut Self {
        let here = self.here;
        if let Some(reason) = names::refusal(name) {
            self.problem(here, format!("`{name}` cannot be used as a name"), reason);
        }
        if let Some(first) = self.scenes.iter().find(|s| s.scene.name == name) {
            let problem = Diagnostic::new(here, format!("scene `{name}` is declared twice"))
                .with_place(first.scene.span, "first here")
                .with_help("rename one of them");
            self.problems.push(problem);
        }
        let scene = Scene {
            name: name.to_owned(),
            fixed: Vec::new(),
            inputs: Vec::new(),
            wants: Vec::new(),
            drops: Vec::new(),
            circles: Vec::new(),
            carries: Vec::new(),
            formulation: None,
            discrete: None,
            doc: doc.to_owned(),
            span: here,
            extent,
            places: BTreeMap::new(),
        };
        self.scenes.push(SceneDraft { scene, fixed, inputs, wants, drops, circles, carries });
        self
    }

    /// The scenes of a model whose states carry `of_model` unless a scene says otherwise.
    pub(super) fn check_scenes(&mut self, of_model: &[Carried]) -> Vec<Scene> {
        let defaults: BTreeMap<SymbolId, Rational> =
            self.params.iter().map(|p| (p.symbol, p.default.clone())).collect();
        let mut result = Vec::new();
        for draft in self.scenes.clone() {
            let drops = self.check_drops(&draft);
            let circles = self.check_circles(&draft);
            let fixes = draft.fixed.iter().map(|(name, _, span)| (name, span));
            let named =
                draft.wants.iter().chain(&draft.inputs).chain(&draft.drops).chain(&drops).chain(&circles);
            let named = named.map(|(name, span)| (name, span));
            let places = fixes.chain(named).filter_map(|(name, span)| Some((name.clone(), (*span)?)));
            let places = places.chain(self.places_of_carries(&draft.carries)).collect();
            let [drops, circles] =
                [drops, circles].map(|list| list.into_iter().map(|(name, _)| name).collect());
            let carries = self.check_carries(&draft.carries);
            let inputs = self.check_scene_inputs(&draft);
            let mut scene = Scene { inputs, drops, circles, carries, places, ..draft.scene };
            let mut values = defaults.clone();
            let mut places: BTreeMap<SymbolId, Option<Span>> = BTreeMap::new();
            for (name, numbers, span) in draft.fixed {
                let of_input = self.input_blocks.get(&name);
                let list = if of_input.is_some() { self.inputs.clone() } else { self.params.clone() };
                let Some(positions) = of_input.or_else(|| self.blocks.get(&name)).cloned() else {
                    let known: Vec<&str> = self.blocks.keys().map(String::as_str).collect();
                    let help = names::suggest(&name, known);
                    self.problem(
                        span,
                        format!("scene `{}` fixes `{name}`, which is not a parameter", scene.name),
                        help,
                    );
                    continue;
                };
                if self.is_noise(&name) {
                    let message = format!("scene `{}` fixes `{name}`, which is a noise", scene.name);
                    self.problem(span, message, "leave it out: a scene that does not take it has no noise");
                    continue;
                }
                if positions.len() != numbers.len() {
                    let message =
                        format!("`{name}` has {} components, found {}", positions.len(), numbers.len());
                    let names: Vec<String> = positions.iter().map(|k| list[*k].name.clone()).collect();
                    self.problem(span, message, component_help(&names));
                    continue;
                }
                for (k, q) in positions.into_iter().zip(numbers) {
                    let param = &list[k];
                    let (component, symbol) = (param.name.clone(), param.symbol);
                    if !places.contains_key(&symbol) {
                        self.here = span;
                        self.check_range(&component, &q);
                    }
                    if places.insert(symbol, span).is_some() {
                        let message = format!("scene `{}` fixes `{component}` twice", scene.name);
                        self.problem(span, message, "keep one of them");
                    }
                    if scene.inputs.contains(&component) {
                        let message = format!("scene `{}` both fixes `{component}` and takes it", scene.name);
                        self.problem(span, message, "keep one of `fix` and `input`");
                    }
                    values.insert(symbol, q.clone());
                    scene.fixed.push((component, q));
                }
            }
            for (name, span) in draft.wants {
                if self.wants_of_given(&scene.name, &name, span)
                    || self.wants_of_totals(&scene.name, &name, span)
                    || self.wants_no_connection(&scene.name, &name, span)
                {
                    continue;
                }
                let named = |n: &String| *n == name;
                let known = Want::from_name(&name).is_some()
                    || self.casimirs.iter().map(|c| &c.name).any(named)
                    || self.sections.iter().map(|s| &s.name).any(named)
                    || self.outputs.iter().map(|o| &o.name).chain(&scene.circles).any(named);
                let is_broken =
                    ["output", "casimir", "section"].iter().any(|item| self.broken.contains(item));
                if !(known || is_broken) {
                    let mut names: Vec<&str> = Want::ALL.map(Want::name).to_vec();
                    names.extend(self.casimirs.iter().map(|c| c.name.as_str()));
                    names.extend(self.outputs.iter().map(|o| o.name.as_str()));
                    names.extend(self.sections.iter().map(|s| s.name.as_str()));
                    names.extend(scene.circles.iter().map(String::as_str));
                    let help = names::suggest(&name, names);
                    self.problem(span, format!("`{name}` is not an output"), help);
                } else if name == Want::Reconstruction.name()
                    && self.reconstructions.is_empty()
                    && !self.has_cyclic_coordinate(of_model, &scene.carries)
                    && !self.broken.contains("reconstruct")
                {
                    let message = format!(
                        "scene `{}` wants `reconstruction`, but the model reconstructs nothing",
                        scene.name
                    );
                    self.problem(span, message, "add an item such as `reconstruct q in SO(3);`");
                } else if name == Want::Matrices.name() {
                    let message = "a model that is built in Rust has equations, not products of matrices";
                    self.problem(span, message, "write the fluid as a model file: see `spec::matrix_fluid`");
                } else if scene.wants.iter().any(|wanted| wanted.name() == name) {
                    self.problem(
                        span,
                        format!("scene `{}` wants `{name}` twice", scene.name),
                        "keep one of them",
                    );
                } else {
                    scene.wants.push(Wanted::from_name(&name));
                }
            }
            self.check_scene_conditions(&scene, &places, &values);
            result.push(scene);
        }
        result
    }

    /// The conditions on fixed parameters alone must hold; the others depend on what the user of the scene gives.
    fn check_scene_conditions(
        &mut self,
        scene: &Scene,
        places: &BTreeMap<SymbolId, Option<Span>>,
        values: &BTreeMap<SymbolId, Rational>,
    ) {
        for condition in self.conditions.clone() {
            let mut free = self.graph.free_symbols(condition.greater);
            free.extend(self.graph.free_symbols(condition.less));
            let Some(first) = free.iter().next() else { continue };
            if !free.iter().all(|s| places.contains_key(s)) {
                continue;
            }
            if self.holds(&condition, values) != Some(true) {
                let span = places.get(first).copied().flatten();
                let problem =
                    Diagnostic::new(span, format!("scene `{}` violates `{}`", scene.name, condition.text))
                        .with_place(condition.span, "required here")
                        .with_help("fix the parameters to valid values");
                self.problems.push(problem);
            }
        }
    }

    /// Base coordinates (vectors or components) and advected parameters that a scene leaves out.
    pub fn scene_drops(&mut self, scene: &str, names: &[&str]) -> &mut Self {
        let here = self.here;
        match self.scenes.iter_mut().find(|s| s.scene.name == scene) {
            Some(draft) => draft.drops.extend(names.iter().map(|n| ((*n).to_owned(), here))),
            None => self.problem(here, format!("`{scene}` is not a scene"), "declare it first"),
        }
        self
    }

    /// Base coordinates (vectors or components) that a scene carries as points `(cos, sin)` of the circle: in the
    /// state, `theta_c` and `theta_s` stand for `theta`, and no sine and cosine of it is computed.
    pub fn scene_circles(&mut self, scene: &str, names: &[&str]) -> &mut Self {
        let here = self.here;
        match self.scenes.iter_mut().find(|s| s.scene.name == scene) {
            Some(draft) => draft.circles.extend(names.iter().map(|n| ((*n).to_owned(), here))),
            None => self.problem(here, format!("`{scene}` is not a scene"), "declare it first"),
        }
        self
    }

    /// Searches the formulations of a scene for one that costs less than the one it writes down.
    pub fn scene_formulation(&mut self, scene: &str, search: FormulationSearch) -> &mut Self {
        let here = self.here;
        match self.scenes.iter_mut().find(|s| s.scene.name == scene) {
            Some(draft) => draft.scene.formulation = Some(search),
            None => self.problem(here, format!("`{scene}` is not a scene"), "declare it first"),
        }
        self
    }

    /// Discrete equations of motion, by the midpoint quadrature of the action and a retraction of the group, or the one
    /// that the algebra chooses.
    pub fn scene_discrete(&mut self, scene: &str, retraction: Option<Retraction>) -> &mut Self {
        let here = self.here;
        match self.scenes.iter_mut().find(|s| s.scene.name == scene) {
            Some(draft) => draft.scene.discrete = Some(Discrete { retraction, place: here }),
            None => self.problem(here, format!("`{scene}` is not a scene"), "declare it first"),
        }
        self
    }

    /// The components of what a scene leaves out.
    pub(super) fn check_drops(&mut self, draft: &SceneDraft) -> Vec<(String, Option<Span>)> {
        let mut drops: Vec<String> = Vec::new();
        let mut components = Vec::new();
        for (name, span) in &draft.drops {
            let scene = &draft.scene.name;
            let is_base = self.names.get(name).is_some_and(|d| d.what == DeclaredAs::Coordinate);
            let advected = self.advected.iter();
            let is_state = self.first_order.iter().any(|state| state.name == *name);
            if drops.contains(name) {
                self.problem(*span, format!("scene `{scene}` drops `{name}` twice"), "keep one of them");
            } else if is_base || is_state || self.advected.iter().any(|a| a.name == *name) {
                drops.push(name.clone());
                components.extend(self.components_of(name).into_iter().map(|component| (component, *span)));
            } else if let Some(block) =
                advected.clone().find(|a| a.components.iter().any(|(n, _)| n == name)).map(|a| a.name.clone())
            {
                let message = format!("scene `{scene}` drops a part of `{block}`");
                self.problem(*span, message, format!("drop `{block}` as a whole"));
            } else if !["coordinate", "advected", "state"].iter().any(|item| self.broken.contains(item)) {
                let known = self.base.iter().map(|c| c.name.as_str());
                let known = known.chain(advected.map(|a| a.name.as_str()));
                let known = known.chain(self.first_order.iter().map(|state| state.name.as_str()));
                let help = names::suggest(name, known.collect::<Vec<_>>());
                let message = format!(
                    "scene `{scene}` drops `{name}`, which is neither a base coordinate nor an advected parameter"
                );
                self.problem(*span, message, help);
            }
        }
        components
    }

    /// The components of what a scene carries as points of the circle.
    pub(super) fn check_circles(&mut self, draft: &SceneDraft) -> Vec<(String, Option<Span>)> {
        let scene = &draft.scene.name;
        let mut circles: Vec<(String, Option<Span>)> = Vec::new();
        for (name, span) in &draft.circles {
            let is_base = self.names.get(name).is_some_and(|d| d.what == DeclaredAs::Coordinate);
            let entries = self.values.get(name).filter(|_| is_base).map(|v| v.entries().to_vec());
            let Some(entries) = entries else {
                if !self.broken.contains("coordinate") {
                    let help = names::suggest(name, self.base.iter().map(|c| c.name.as_str()));
                    let message = format!(
                        "scene `{scene}` carries `{name}` on a circle, which is not a base coordinate"
                    );
                    self.problem(*span, message, help);
                }
                continue;
            };
            for coordinate in self.base.clone() {
                let symbol = self.graph.sym(coordinate.symbol);
                if !entries.contains(&symbol) {
                    continue;
                }
                let angle = coordinate.name;
                let dropped =
                    draft.drops.iter().any(|(d, _)| *d == angle || d == name || self.is_part(&angle, d));
                let taken = circle_names(&angle)
                    .into_iter()
                    .find(|n| self.names.contains_key(n) || names::refusal(n).is_some());
                let problem = if circles.iter().any(|(known, _)| *known == angle) {
                    Some((format!("scene `{scene}` carries `{angle}` on a circle twice"), "keep one of them"))
                } else if coordinate.domain == Domain::Real {
                    let message = format!("scene `{scene}` carries `{angle}` on a circle, which is no angle");
                    Some((message, "declare the coordinate `in angle`, or in an interval of radians"))
                } else if dropped {
                    let message = format!("scene `{scene}` both drops `{angle}` and carries it on a circle");
                    Some((message, "keep one of them"))
                } else if let Some(taken) = taken {
                    let message =
                        format!("scene `{scene}` needs the name `{taken}` for a point of the circle");
                    Some((message, "rename what has that name"))
                } else if self.output_names.contains_key(&angle) {
                    let message =
                        format!("scene `{scene}` needs the name `{angle}` for an output, the angle");
                    Some((message, "rename the output of that name"))
                } else {
                    None
                };
                match problem {
                    Some((message, help)) => self.problem(*span, message, help),
                    None => circles.push((angle, *span)),
                }
            }
        }
        circles
    }

    /// The components of a base coordinate or an advected parameter, of one or more numbers.
    fn components_of(&mut self, name: &str) -> Vec<String> {
        let advected = self.advected.iter().find(|a| a.name == name).map(|a| &a.components);
        let first_order = self.first_order.iter().find(|state| state.name == name).map(|s| &s.components);
        if let Some(components) = advected.or(first_order) {
            return components.iter().map(|(component, _)| component.clone()).collect();
        }
        let base: Vec<String> = self.base.iter().map(|c| c.name.clone()).collect();
        base.into_iter().filter(|component| component == name || self.is_part(component, name)).collect()
    }

    /// Whether a coordinate is a component of the vector of that name.
    fn is_part(&mut self, component: &str, block: &str) -> bool {
        let entries = self.values.get(block).map(|v| v.entries().to_vec()).unwrap_or_default();
        let symbol = self.base.iter().find(|c| c.name == component).map(|c| c.symbol);
        symbol.is_some_and(|s| entries.contains(&self.graph.sym(s)))
    }
}
