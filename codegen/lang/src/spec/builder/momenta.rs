//! Names of momenta, and what a state carries for each velocity.
//!
//! Deliberately does not know: how a velocity follows from its momentum, whether a momentum is conserved.

use std::collections::BTreeMap;

use super::draft::{CarryDraft, DeclaredAs, Located, ModelBuilder};
use super::stages::STAGES;
use crate::spec::diagnostic::Span;
use crate::spec::layout::Layout;
use crate::spec::model::*;
use crate::spec::names;
use crate::spec::value::Value;
use hamel_expr::ExprId;

impl ModelBuilder {
    /// A name for the momenta along a velocity (vector or component): `W^T dL/dy`, which outputs and casimirs may
    /// mention and [`ModelBuilder::carry`] makes state variables.
    ///
    /// ```
    /// use hamel_lang::spec::{LieAlgebra, ModelBuilder};
    ///
    /// let mut b = ModelBuilder::new("body");
    /// let omega = b.velocities(LieAlgebra::so(3).unwrap(), &["Omega"]).remove(0);
    /// let pi = b.momentum("Pi", "Omega", "angular momentum").unwrap();
    /// let (square, energy) = (pi.dot(b.graph(), &pi).unwrap(), omega.dot(b.graph(), &omega).unwrap());
    /// b.lagrangian(&energy).casimir("C", &square, "").carry(&["Pi"]);
    /// let model = b.build().unwrap();
    /// assert_eq!(model.momenta[0].components[2].0, "Pi3");
    /// assert_eq!(model.carries.len(), 3);
    /// ```
    pub fn momentum(&mut self, name: &str, velocity: &str, doc: &str) -> Option<Value> {
        let here = self.here;
        self.located_momentum(name, (velocity, here), doc)
    }

    pub(in crate::spec) fn located_momentum(
        &mut self,
        name: &str,
        velocity: (&str, Option<Span>),
        doc: &str,
    ) -> Option<Value> {
        self.labelled_momentum(name, velocity, None, doc)
    }

    /// A momentum whose components may have names of their own.
    pub(in crate::spec) fn labelled_momentum(
        &mut self,
        name: &str,
        (velocity, span): (&str, Option<Span>),
        labels: Option<Vec<String>>,
        doc: &str,
    ) -> Option<Value> {
        let here = self.here;
        let velocities = self.slot(velocity);
        if velocities.is_empty() {
            self.unknown_velocity(velocity, span);
            return None;
        }
        let taken = |m: &&Momentum| m.components.iter().any(|(_, _, k)| velocities.contains(k));
        if let Some(other) = self.momenta.iter().find(taken).map(|m| m.name.clone()) {
            let message = format!("`{velocity}` has the momentum `{other}` already");
            self.problem(span, message, "a velocity has one momentum; keep one of the names");
            return None;
        }
        let value;
        let mut components = Vec::new();
        if let [velocity] = velocities[..] {
            let (symbol, expr) = self.new_symbol(name, DeclaredAs::Momentum);
            components.push((name.to_owned(), symbol, velocity));
            value = Value::Scalar(expr);
        } else {
            self.declare(name, DeclaredAs::Momentum);
            let mut entries: Vec<ExprId> = Vec::new();
            let names = labels.unwrap_or_else(|| Layout::Vector(velocities.len()).names(name));
            for (component, velocity) in names.into_iter().zip(velocities) {
                let (symbol, expr) = self.new_symbol(&component, DeclaredAs::MomentumComponent);
                components.push((component, symbol, velocity));
                entries.push(expr);
            }
            value = Value::Vector(entries);
            self.bind(name, &value);
        }
        self.momenta.push(Momentum { name: name.to_owned(), components, doc: doc.to_owned(), span: here });
        Some(value)
    }

    pub(in crate::spec) fn is_momentum(&self, name: &str) -> bool {
        self.momenta.iter().any(|m| m.name == name)
    }

    /// What the state carries: momenta in the place of their velocities, by name (vectors or components).
    pub fn carry(&mut self, names: &[&str]) -> &mut Self {
        let here = self.here;
        let drafts = names.iter().map(|name| CarryDraft::Named(((*name).to_owned(), here))).collect();
        self.located_carries(drafts)
    }

    /// Fixes the conserved momentum of a cyclic coordinate, or of a velocity, to a parameter (Routh).
    pub fn routh(&mut self, cyclic: &str, parameter: &str) -> &mut Self {
        let [cyclic, parameter] = [cyclic, parameter].map(|name| (name.to_owned(), self.here));
        self.located_carries(vec![CarryDraft::Level { cyclic, parameter, up_to: None }])
    }

    /// As [`ModelBuilder::routh`] where the Lagrangian is invariant up to the rate of a function `f` alone: the
    /// parameter is `dL/dy - f`.
    ///
    /// ```
    /// use hamel_lang::spec::{Domain, ModelBuilder, Rational};
    ///
    /// let mut b = ModelBuilder::new("particle");
    /// let (x, x_dot) = b.coordinate("x", Domain::Real, "");
    /// let (u, u_dot) = b.coordinate("u", Domain::Real, "");
    /// b.param("p", Rational::from_integer(1.into()), "");
    /// let squares = [x_dot.mul(b.graph(), &x_dot).unwrap(), u_dot.mul(b.graph(), &u_dot).unwrap()];
    /// let drift = u.mul(b.graph(), &x_dot).unwrap();
    /// let energy = squares[0].add(b.graph(), &squares[1]).unwrap().add(b.graph(), &drift).unwrap();
    /// b.lagrangian(&energy).routh_up_to("u", "p", &x);
    /// assert_eq!(b.build().unwrap().quasi_invariances.len(), 1);
    /// ```
    pub fn routh_up_to(&mut self, cyclic: &str, parameter: &str, f: &Value) -> &mut Self {
        let here = self.here;
        let [cyclic, parameter] = [cyclic, parameter].map(|name| (name.to_owned(), here));
        let up_to = Some((f.clone(), here));
        self.located_carries(vec![CarryDraft::Level { cyclic, parameter, up_to }])
    }

    pub(in crate::spec) fn located_carries(&mut self, drafts: Vec<CarryDraft>) -> &mut Self {
        self.carries.extend(drafts);
        self
    }

    /// What the state of a scene carries: see [`ModelBuilder::carry`].
    pub fn scene_carries(&mut self, scene: &str, names: &[&str]) -> &mut Self {
        let here = self.here;
        match self.scenes.iter_mut().find(|s| s.scene.name == scene) {
            Some(draft) => {
                draft.carries.extend(names.iter().map(|name| CarryDraft::Named(((*name).to_owned(), here))));
            }
            None => self.problem(here, format!("`{scene}` is not a scene"), "declare it first"),
        }
        self
    }

    /// The velocities of a vector or component, by index into base velocities, velocities in the algebra and
    /// quasi-velocities.
    fn slot(&self, name: &str) -> Vec<usize> {
        let quasi = self.quasi_velocities.iter().position(|v| v.name == name);
        match quasi {
            Some(k) => vec![self.n_shape() + self.velocities.len() + k],
            None => self.velocity_indices(name),
        }
    }

    /// Every velocity with what stands for it, at its place.
    pub(super) fn check_carries(&mut self, drafts: &[CarryDraft]) -> Vec<Carried> {
        let mut result: Vec<Carried> = Vec::new();
        for draft in drafts {
            let (found, span) = match draft {
                CarryDraft::Named((name, span)) => (self.carried_by_name(name, *span), *span),
                CarryDraft::Momenta { velocity: (velocity, at), momentum: (momentum, span) } => {
                    let slot = self.slot(velocity);
                    if slot.is_empty() {
                        self.unknown_velocity(velocity, *at);
                        continue;
                    }
                    let found = self.carried_by_name(momentum, *span);
                    if !found.is_empty() && found.iter().any(|c| !slot.contains(&c.velocity)) {
                        let message = format!("`{momentum}` is not the momentum of `{velocity}`");
                        let help = format!("declare one: `momentum {velocity}_momentum of {velocity};`");
                        self.problem(*span, message, help);
                        continue;
                    }
                    (found, *span)
                }
                CarryDraft::Level { cyclic, parameter, up_to: _ } => {
                    (self.at_level(cyclic, parameter).into_iter().collect(), parameter.1)
                }
            };
            for carried in found {
                let known = result.iter_mut().find(|known| known.velocity == carried.velocity);
                // `carry stages, B_rotation;` is the momentum of one level, and velocities of the others.
                if let Some(Carried { by: CarriedBy::Levels(momenta), .. }) = known
                    && let CarriedBy::Levels(others) = &carried.by
                {
                    momenta.extend(others.iter().cloned());
                    momenta.sort_unstable();
                    momenta.dedup();
                    continue;
                }
                if result.iter().any(|known| known.velocity == carried.velocity) {
                    let name = self.name_of_velocity(carried.velocity);
                    let message = format!("what the state carries for `{name}` is said twice");
                    self.problem(span, message, "keep one of them");
                    break;
                }
                result.push(carried);
            }
        }
        result
    }

    /// The functions up to whose rates the Lagrangian is invariant, of the model and its scenes.
    pub(super) fn quasi_invariances(&mut self, of_model: &[CarryDraft]) -> Vec<QuasiInvariance> {
        let of_scenes = self.scenes.iter().flat_map(|draft| draft.carries.clone());
        let drafts: Vec<CarryDraft> = of_model.iter().cloned().chain(of_scenes).collect();
        let mut result: Vec<QuasiInvariance> = Vec::new();
        for draft in drafts {
            let CarryDraft::Level { cyclic, parameter, up_to: Some((function, span)) } = draft else {
                continue;
            };
            let (parameter, cyclic) = (parameter.0, cyclic.0);
            let what = format!("the function that the momentum of `{cyclic}` is up to");
            let coordinate = self.base[..self.n_shape()].iter().position(|c| c.name == cyclic);
            let slot = coordinate.map_or_else(|| self.slot(&cyclic), |k| vec![k]);
            // Other problems with these names are reported with the momenta.
            let [velocity] = slot[..] else { continue };
            let Value::Scalar(function) = function else {
                let message = format!("{what} must be a number, found {}", function.shape());
                self.problem(span, message, "a parameter is one momentum");
                continue;
            };
            let free = self.graph.free_symbols(function);
            let velocities = self.velocity_symbols();
            if let Some(symbol) = free.iter().find(|s| velocities.contains(s)) {
                let message = format!("{what} contains the velocity `{}`", self.graph.name(*symbol));
                self.problem(
                    span,
                    message,
                    "it is a function of coordinates, advected parameters and parameters",
                );
                continue;
            }
            if self.reports_stray(function, span, &what, &[]) {
                continue;
            }
            let of_same = result.iter().find(|q| q.velocity == velocity && q.parameter == parameter);
            match of_same.map(|q| q.function) {
                Some(other) if !self.graph.is_equal(function, other) => {
                    let message = format!("`{parameter}` is the momentum of `{cyclic}` up to two functions");
                    self.problem(span, message, "use another parameter");
                }
                Some(_) => {}
                None => result.push(QuasiInvariance { velocity, parameter, function, span }),
            }
        }
        result
    }

    /// Where every momentum and parameter that stands for a velocity is named.
    pub(super) fn places_of_carries(&self, drafts: &[CarryDraft]) -> BTreeMap<String, Span> {
        let mut places = BTreeMap::new();
        for draft in drafts {
            let (CarryDraft::Named((name, span))
            | CarryDraft::Momenta { momentum: (name, span), .. }
            | CarryDraft::Level { parameter: (name, span), .. }) = draft;
            let Some(span) = *span else { continue };
            let whole = self.momenta.iter().find(|m| m.name == *name);
            let components = whole.into_iter().flat_map(|m| m.components.iter().map(|(n, ..)| n.clone()));
            places.extend(components.chain([name.clone()]).map(|name| (name, span)));
        }
        places
    }

    fn carried_by_name(&mut self, name: &str, span: Option<Span>) -> Vec<Carried> {
        let components = self.momenta.iter().flat_map(|m| {
            let is_whole = m.name == name;
            m.components.iter().filter(move |(n, ..)| is_whole || n == name)
        });
        let momenta: Vec<Carried> = components
            .map(|(n, _, k)| Carried { velocity: *k, by: CarriedBy::Momentum(n.clone()) })
            .collect();
        if !momenta.is_empty() {
            return momenta;
        }
        let slot = self.slot(name);
        if slot.is_empty() && name == STAGES {
            return self.carried_levels(&[], span);
        }
        if let Some(levels) = self.levels_of_momentum(name) {
            return self.carried_levels(&levels, span);
        }
        if slot.is_empty() && !["velocity", "momentum"].iter().any(|item| self.broken.contains(item)) {
            let help = match self.momenta.is_empty() && self.level_momentum.is_none() {
                true => "declare it: `momentum Pi of Omega;`".into(),
                false => names::suggest(name, self.momenta_and_velocities().iter().map(String::as_str)),
            };
            self.problem(span, format!("`{name}` is neither a momentum nor a velocity"), help);
        }
        slot.into_iter().map(|velocity| Carried { velocity, by: CarriedBy::Velocity }).collect()
    }

    fn momenta_and_velocities(&self) -> Vec<String> {
        let momenta = self.momenta.iter();
        let momenta = momenta.flat_map(|m| m.components.iter().map(|(n, ..)| n).chain([&m.name]));
        let velocities = self.velocities.iter().flat_map(|v| [&v.name, &v.block]);
        let levels = self.level_momentum.iter().flat_map(|(momentum, _)| {
            let of_one = self.stages.iter().map(move |draft| format!("{momentum}_{}", draft.name));
            of_one.chain([momentum.clone()])
        });
        let mut names: Vec<String> =
            momenta.chain(velocities).cloned().chain(self.velocity_names()).chain(levels).collect();
        names.sort();
        names.dedup();
        names
    }

    /// `routh phi = p`: one coordinate or velocity, one parameter.
    fn at_level(&mut self, (cyclic, at): &Located, (parameter, span): &Located) -> Option<Carried> {
        let coordinate = self.base[..self.n_shape()].iter().position(|c| c.name == *cyclic);
        let is_replaced = |k: &usize| {
            self.frame.as_ref().is_some_and(|(frame, _)| frame.original[*k].1 != self.base[*k].velocity)
        };
        if let Some(k) = coordinate.filter(is_replaced) {
            let message = format!("`{cyclic}` has no momentum: the frame replaces its velocity");
            let help =
                format!("name the quasi-velocity: `routh {} = {parameter};`", self.base[k].velocity_name);
            self.problem(*at, message, help);
            return None;
        }
        let slot = coordinate.map_or_else(|| self.slot(cyclic), |k| vec![k]);
        let [velocity] = slot[..] else {
            if slot.is_empty() && !self.broken.contains("coordinate") && !self.broken.contains("velocity") {
                let base = self.base.iter().map(|c| c.name.as_str());
                let help =
                    names::suggest(cyclic, base.chain(self.velocities.iter().map(|v| v.name.as_str())));
                self.problem(*at, format!("`{cyclic}` is neither a coordinate nor a velocity"), help);
            } else if !slot.is_empty() {
                let message = format!("`{cyclic}` has {} components", slot.len());
                self.problem(*at, message, "a parameter is one momentum; name the components one by one");
            }
            return None;
        };
        if !self.params.iter().any(|p| p.name == *parameter) {
            if !self.broken.contains("param") {
                let help = match self.params.is_empty() {
                    true => format!("declare it: `param {parameter} = 1;`").into(),
                    false => names::suggest(parameter, self.params.iter().map(|p| p.name.as_str())),
                };
                self.problem(*span, format!("`{parameter}` is not a parameter"), help);
            }
            return None;
        }
        Some(Carried { velocity, by: CarriedBy::Parameter(parameter.clone()) })
    }

    /// Whether the momentum of a base coordinate is a parameter, so that only a reconstruction needs the coordinate.
    pub(super) fn has_cyclic_coordinate(&self, of_model: &[Carried], of_scene: &[Carried]) -> bool {
        let n_base = self.n_shape();
        let is_kept = |c: &&Carried| of_scene.iter().all(|own| own.velocity != c.velocity);
        let mut carries = of_model.iter().filter(is_kept).chain(of_scene);
        carries.any(|c| c.velocity < n_base && matches!(c.by, CarriedBy::Parameter(_)))
    }

    /// The velocity that a momentum is of, or the momentum of a velocity, by the names of components.
    pub(super) fn counterpart(&self, component: &str) -> Option<String> {
        let mut velocities = self.velocity_names();
        velocities.extend(self.quasi_velocities.iter().map(|v| v.name.clone()));
        let mut momenta = self.momenta.iter().flat_map(|m| &m.components);
        momenta.find_map(|(momentum, _, k)| match velocities.get(*k) {
            Some(velocity) if velocity == component => Some(momentum.clone()),
            Some(velocity) if momentum == component => Some(velocity.clone()),
            _ => None,
        })
    }

    fn name_of_velocity(&self, k: usize) -> String {
        let mut names = self.velocity_names();
        names.extend(self.quasi_velocities.iter().map(|v| v.name.clone()));
        names.swap_remove(k)
    }
}
