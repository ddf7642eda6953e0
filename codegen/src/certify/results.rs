//! Energy, outputs and momenta of a scene beside their definitions in the model.
//!
//! Does not know: rates, derivatives by the state.

use std::collections::BTreeSet;

use hamel_runtime::{Dual, Real};

use hamel_expr::{ExprId, SymbolId};
use hamel_lang::spec::{Configuration, ReconstructionKind, Want};
use hamel_mechanics::mechanics::{Output, OutputKind};
use hamel_program::program::Role;

use super::definition::{Missing, Place};
use super::linear::Reduced;
use super::motion::{Motion, constants};
use super::point::{Point, Setting};
use super::random::Random;
use super::runner::At;
use super::sheet::Sheet;
use super::tape::{Env, Tape};
use super::wide::Wide;

/// A scene at a point, and beside it a state that satisfies nothing.
pub(super) struct Results<'s, 'a> {
    pub(super) setting: &'s Setting<'a>,
    pub(super) point: &'s Point,
    pub(super) motion: &'s Motion,
}

/// Why a function could not be compared.
pub(super) enum Open {
    Missing(Missing),
    Because(&'static str),
}

impl From<Missing> for Open {
    fn from(missing: Missing) -> Open {
        Open::Missing(missing)
    }
}

pub(super) type Outcome = Result<(), Open>;

impl Results<'_, '_> {
    /// The values of a function at the point; none if the scene does not have it.
    pub(super) fn call(&self, role: &Role) -> Option<Vec<Wide>> {
        let k = self.setting.claim.program.function_idx(role)?;
        Some(self.setting.runner.call(k, &self.point.at(&self.motion.state), &[]))
    }

    /// The same along the motion.
    pub(super) fn call_along(&self, role: &Role) -> Option<Vec<Dual<Wide>>> {
        let k = self.setting.claim.program.function_idx(role)?;
        let state: Vec<Dual<Wide>> =
            self.motion.state.iter().zip(&self.motion.rates).map(|(x, d)| Dual::new(*x, *d)).collect();
        let (params, slots) = (constants(&self.point.params), constants(&self.point.slots));
        let inputs = constants(&self.point.inputs);
        let t = Dual::variable(self.point.t);
        let at = At { params: &params, slots: &slots, inputs: &inputs, t, state: &state };
        Some(self.setting.runner.call(k, &at, &[]))
    }

    /// Energy and all outputs.
    pub(super) fn check(&self, sheet: &mut Sheet, random: &mut Random, open: &mut dyn FnMut(&str, Open)) {
        let energy = Role::Energy;
        if let Some(found) = self.call(&energy) {
            match self.setting.definition.energy(&self.motion.at) {
                Ok(defined) => sheet.equal(energy.name(), "the energy", found[0], defined),
                Err(missing) => open(energy.name(), missing.into()),
            }
            self.claims(sheet);
        }
        for output in self.setting.claim.outputs {
            if let Err(why) = self.output(output, sheet, random) {
                open(&output.name, why);
            }
        }
    }

    /// Claims that tests of zero have shown in one prime field: at real points an unlucky prime says nothing. An energy
    /// that is said to stay has no rate, nor has a component of the state that is said to be constant.
    fn claims(&self, sheet: &mut Sheet) {
        let facts = &self.setting.claim.equations.facts;
        if facts.conserves_energy()
            && let Some(along) = self.call_along(&Role::Energy)
        {
            self.is_conserved(Role::Energy.name(), "the energy", along[0], sheet);
        }
        for (name, rate) in self.setting.claim.program.state.iter().zip(&self.motion.rates) {
            if facts.constants.contains(name) {
                sheet.vanishes(Role::Rate.name(), format!("the rate of {name}"), *rate, 1.0);
            }
        }
    }

    fn output(&self, output: &Output, sheet: &mut Sheet, random: &mut Random) -> Outcome {
        let Some(found) = self.call(&Role::Output(output.name.clone())) else { return Ok(()) };
        match output.kind {
            OutputKind::OfModel => self.of_model(output, &found, sheet),
            OutputKind::After => self.after(output, &found, sheet, random),
            OutputKind::Component => self.component(output, &found, sheet, random),
            OutputKind::Gradients | OutputKind::Remainder => Ok(()),
            OutputKind::Group(want) => self.group(want, output, &found, sheet, random),
        }
    }

    /// A component of a group that a scene wants alone.
    fn component(&self, output: &Output, found: &[Wide], sheet: &mut Sheet, random: &mut Random) -> Outcome {
        let name = &output.components[0].0;
        let whole = self.setting.claim.equations.outputs.iter().find(|o| {
            matches!(o.kind, OutputKind::Group(_)) && o.components.iter().any(|(own, _)| own == name)
        });
        match whole.map(|o| o.kind) {
            Some(OutputKind::Group(want)) if want != Want::Events => {
                self.group(want, output, found, sheet, random)
            }
            _ => self.of_model(output, found, sheet),
        }
    }

    pub(super) fn of_model(&self, output: &Output, found: &[Wide], sheet: &mut Sheet) -> Outcome {
        let model = self.setting.definition.model;
        let mut env = self.with_momenta()?;
        self.add_multipliers(&mut env)?;
        for ((name, _), found) in output.components.iter().zip(found) {
            let mut components = model.outputs.iter().flat_map(|o| &o.components);
            if let Some((_, e)) = components.find(|(own, _)| own == name) {
                let defined = Tape::new(&model.graph, &[*e]).eval(&env)?.roots[0];
                sheet.equal(&output.name, name.clone(), *found, defined);
                continue;
            }
            // An angle that is carried as a point of the circle, up to whole turns.
            let Some(coordinate) = model.base.iter().find(|c| c.name == *name) else {
                return Err(Open::Because("the model has no output of that name"));
            };
            let angle = env.get(coordinate.symbol).ok_or(coordinate.symbol)?;
            let (s, c) = (*found - angle).sin_cos();
            sheet.vanishes(&output.name, name.clone(), s, 1.0);
            sheet.vanishes(&output.name, name.clone(), c - Wide::ONE, 1.0);
        }
        Ok(())
    }

    /// The symbols of the model with the momenta that the state does not carry.
    fn with_momenta(&self) -> Result<Env<Wide>, Missing> {
        let definition = &self.setting.definition;
        let mut env = self.motion.at.env.clone();
        if definition.has_hamiltonian() {
            return Ok(env);
        }
        for momentum in Motion::named_momenta(self.setting, &self.motion.at)? {
            env.set(momentum.symbol, Motion::momentum(self.setting, &self.motion.at, &momentum.along)?);
        }
        Ok(env)
    }

    /// `<p, e>` along a velocity of the model before stages, by its place.
    fn momentum<R: Real>(&self, at: &Place<R>, k: usize) -> Result<R, Missing> {
        let definition = &self.setting.definition;
        let unit: Vec<R> = (0..definition.m).map(|j| if j == k { R::ONE } else { R::ZERO }).collect();
        let along = definition.group_velocities_before_stages(&at.env, &unit)?;
        Motion::momentum(self.setting, at, &along)
    }

    /// Names of the velocities of the model before stages.
    fn names_before_stages(&self) -> Vec<String> {
        let system = &self.setting.claim.equations.system;
        match &system.frame {
            Some(frame) => frame.original.iter().map(|u| u.name.clone()).collect(),
            None => self.setting.velocity_symbols.iter().map(|s| system.graph.name(*s).to_owned()).collect(),
        }
    }

    fn group(
        &self,
        want: Want,
        output: &Output,
        found: &[Wide],
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Outcome {
        let definition = &self.setting.definition;
        let model = definition.model;
        let equations = self.setting.claim.equations;
        let system = &equations.system;
        let named = || output.components.iter().map(|(name, _)| name.as_str()).zip(found.iter().copied());
        let function = output.name.as_str();
        match want {
            Want::EnergyRate => {
                let defined = definition.energy(&self.motion.moving)?;
                sheet.equal(function, "the rate of energy", found[0], defined.derivative);
            }
            Want::Momentum => {
                let names = self.names_before_stages();
                for (name, found) in named() {
                    let place = names.iter().position(|own| name.strip_prefix("p_") == Some(own));
                    let place = place.ok_or(Open::Because("a momentum along no velocity of the model"))?;
                    sheet.equal(function, name, found, self.momentum(&self.motion.at, place)?);
                }
            }
            Want::Velocities => {
                let names = self.names_before_stages();
                let values = definition.before_stages(&self.motion.at.env, &self.motion.at.of_system)?;
                let quasi = model.quasi_velocities.iter().map(|v| (v.name.clone(), v.symbol));
                let quasi: Vec<(String, SymbolId)> = quasi.collect();
                for (name, found) in named() {
                    let defined = match names.iter().position(|own| own == name) {
                        Some(k) => values[k],
                        None => {
                            let (_, symbol) = quasi
                                .iter()
                                .find(|(own, _)| own == name)
                                .ok_or(Open::Because("a velocity that the model does not have"))?;
                            self.motion.at.env.get(*symbol).ok_or(*symbol)?
                        }
                    };
                    sheet.equal(function, name, found, defined);
                }
            }
            Want::Multipliers => self.multipliers(output, found, sheet, random)?,
            Want::Constraint => self.residuals(output, sheet, random)?,
            Want::Casimirs => {
                let along = self.call_along(&Role::Output(output.name.clone())).unwrap_or_default();
                let env = self.with_momenta()?;
                for (k, (name, found)) in named().enumerate() {
                    let casimir = model.casimirs.iter().find(|c| c.name == name);
                    let casimir = casimir.ok_or(Open::Because("the model claims no such casimir"))?;
                    let defined = Tape::new(&model.graph, &[casimir.expr]).eval(&env)?.roots[0];
                    sheet.equal(function, name, found, defined);
                    self.is_conserved(function, name, along[k], sheet);
                }
            }
            Want::Circles => {
                for (name, found) in named() {
                    sheet.equal(function, name, found, Wide::ONE);
                }
            }
            Want::Sections => {
                for (name, found) in named() {
                    let section = model.sections.iter().find(|s| s.name == name);
                    let section = section.ok_or(Open::Because("the model has no such section"))?;
                    let s = Tape::new(&model.graph, &section.coefficients).eval(&self.motion.at.env)?.roots;
                    sheet.equal(function, name, found, definition.momentum_along(&self.motion.at, &s)?);
                }
            }
            Want::SectionRates => {
                let at = &self.motion.moving;
                for (name, found) in named() {
                    let section = model.sections.iter().find(|s| name.strip_prefix("dot_") == Some(&s.name));
                    let section = section.ok_or(Open::Because("the model has no such section"))?;
                    let s = Tape::new(&model.graph, &section.coefficients).eval(&at.env)?.roots;
                    sheet.equal(function, name, found, definition.momentum_along(at, &s)?.derivative);
                }
            }
            Want::NonholonomicMomentum | Want::MomentumEquation => {
                for (name, found) in named() {
                    let is_rate = want == Want::MomentumEquation;
                    let prefix = if is_rate { "dot_J_" } else { "J_" };
                    let unknown =
                        system.unknowns.iter().position(|u| name.strip_prefix(prefix) == Some(&u.name));
                    let unknown = unknown.ok_or(Open::Because("a momentum along no independent velocity"))?;
                    let at = &self.motion.moving;
                    let along = Motion::displacement_of(self.setting, at, unknown)?;
                    let along = definition.group_velocities(&at.env, &along[..definition.m])?;
                    let value = definition.lagrangian(at, &along, &Vec::new())?.derivative;
                    sheet.equal(function, name, found, if is_rate { value.derivative } else { value.value });
                }
            }
            Want::Phases => self.phases(output, found, sheet)?,
            Want::Connection => self.connection(output, found, sheet, random)?,
            Want::Dirac => self.dirac(output, found, sheet, random)?,
            Want::Invariants => {
                let along = self.call_along(&Role::Output(output.name.clone())).unwrap_or_default();
                for ((name, _), value) in output.components.iter().zip(along) {
                    self.is_conserved(function, name, value, sheet);
                }
            }
            Want::Positions => self.positions(output, sheet, random)?,
            Want::FramePoses => self.of_model(output, found, sheet)?,
            Want::FrameTwists => {
                self.of_model(output, found, sheet)?;
                self.twists(output, found, sheet, random)?;
            }
            Want::CenterOfMass | Want::CentroidalMomentum => {
                self.of_model(output, found, sheet)?;
                self.of_bodies(want, output, found, sheet, random)?;
            }
            Want::FrameDrifts => self.drifts(output, found, sheet)?,
            Want::Bias | Want::Gravity => self.forces_at_rest(want, found, sheet)?,
            Want::Events | Want::Outputs => self.of_model(output, found, sheet)?,
            Want::HamiltonianTime => {
                return Err(Open::Because("its Jacobi identity is proved symbolically alone"));
            }
            // Matrices, brackets and implicit forms have identities of their own.
            _ => {}
        }
        Ok(())
    }

    fn is_conserved(&self, function: &str, name: &str, along: Dual<Wide>, sheet: &mut Sheet) {
        // The rate is a sum of products of slopes and rates: of the size of the value times the fastest rate.
        let fastest = self.motion.rates.iter().map(|r| r.size()).fold(0.0, f64::max);
        let what = format!("the rate of {name}");
        sheet.vanishes(function, what, along.derivative, along.value.size().max(1.0) * fastest);
    }

    /// `E = lambda_A a^A` along a random displacement, virtual or not.
    fn multipliers(
        &self,
        output: &Output,
        found: &[Wide],
        sheet: &mut Sheet,
        random: &mut Random,
    ) -> Outcome {
        if output.kind == OutputKind::Component {
            return Err(Open::Because("a balance needs all multipliers, and the scene has one"));
        }
        let definition = &self.setting.definition;
        let n = definition.n_displacements();
        let by_order = !definition.model.virtual_constraints.is_empty();
        let mut displacement = random.vector(n);
        if self.setting.claim.equations.system.velocities.len() < definition.m {
            // What gives a velocity without inertia has no multiplier: displacements satisfy it.
            let forms = definition.one_forms(&self.motion.at)?.into_iter();
            let rows = forms.filter(|(name, _)| {
                let own = format!("lambda_{name}");
                output.components.iter().all(|(name, _)| *name != own)
            });
            let rows = rows.map(|(_, form)| form.into_iter().chain([Wide::ZERO]).collect());
            displacement = Reduced::new(rows.collect(), n).solution(&displacement);
        }
        let w = definition.group_velocities(&self.motion.at.env, &displacement[..definition.m])?;
        let mut terms = self.motion.unbalanced(self.setting, &w)?.to_vec();
        for (k, (name, form)) in definition.one_forms(&self.motion.at)?.into_iter().enumerate() {
            let own = format!("lambda_{name}");
            // Reactions along displacements of their own have the names of the constraints that they keep.
            let place = match by_order {
                true => Some(k),
                false => output.components.iter().position(|(name, _)| *name == own),
            };
            let Some(k) = place else { continue };
            let along = form.iter().zip(&displacement).fold(Wide::ZERO, |sum, (a, b)| sum + *a * *b);
            terms.push(-(found[k] * along));
        }
        sheet.zero(&output.name, "the balance of forces and reactions", &terms);
        for ((name, _), found) in output.components.iter().zip(found) {
            if self.is_off(name) {
                sheet.vanishes(&output.name, format!("{name} of a mode that is off"), *found, 1.0);
            }
        }
        Ok(())
    }

    /// A state beside the restrictions, with everything that follows from it.
    fn beside(&self, random: &mut Random) -> Result<(Point, Place<Wide>), Missing> {
        let point = self.setting.beside(self.point, random);
        let place = self.setting.place(&point.env)?;
        Ok((point, place))
    }

    /// Residuals where they do not vanish.
    fn residuals(&self, output: &Output, sheet: &mut Sheet, random: &mut Random) -> Outcome {
        let definition = &self.setting.definition;
        let model = definition.model;
        let (point, place) = self.beside(random)?;
        let state = point.state(self.setting);
        let Some(k) = self.setting.claim.program.function_idx(&Role::Output(output.name.clone())) else {
            return Ok(());
        };
        let found = self.setting.runner.call(k, &point.at(&state), &[]);
        let residuals = definition.residuals(&place.env)?;
        let positions = self.setting.positions.eval(&place.env)?.roots;
        for ((name, _), found) in output.components.iter().zip(found) {
            let constraint =
                model.constraints.iter().position(|c| name.strip_prefix("residual_") == Some(&c.name));
            match constraint {
                Some(k) => sheet.equal(&output.name, name.clone(), found, residuals[k]),
                None => nearest(&output.name, name, found, &positions, sheet)?,
            }
        }
        Ok(())
    }

    /// Equations between positions where they do not hold; what is kept beside them, along the motion.
    fn positions(&self, output: &Output, sheet: &mut Sheet, random: &mut Random) -> Outcome {
        let (point, place) = self.beside(random)?;
        let state = point.state(self.setting);
        let role = Role::Output(output.name.clone());
        let Some(k) = self.setting.claim.program.function_idx(&role) else { return Ok(()) };
        let found = self.setting.runner.call(k, &point.at(&state), &[]);
        let positions = self.setting.positions.eval(&place.env)?.roots;
        let along = self.call_along(&role).unwrap_or_default();
        for (k, (name, _)) in output.components.iter().enumerate() {
            if k < self.setting.claim.n_positions {
                nearest(&output.name, name, found[k], &positions, sheet)?;
                continue;
            }
            match self.relative_to_a_frame(name) {
                Some(configuration) => self.is_of_group(output, (k, name), configuration, sheet, random),
                None => self.is_conserved(&output.name, name, along[k], sheet),
            }
        }
        self.keep_groups(output, sheet, random);
        Ok(())
    }

    /// The functions beside the equations keep each matrix that these contain in its group: at an element of it their
    /// slopes leave a space of directions of the dimension of the group.
    fn keep_groups(&self, output: &Output, sheet: &mut Sheet, random: &mut Random) {
        let model = self.setting.definition.model;
        let role = Role::Output(output.name.clone());
        let Some(function) = self.setting.claim.program.function_idx(&role) else { return };
        for configuration in &model.configurations {
            let symbols = &configuration.symbols;
            let own: BTreeSet<SymbolId> = symbols.iter().copied().collect();
            let mut positions = model.constraints.iter().filter_map(|c| c.position);
            if !positions.any(|p| model.graph.depends_on(p.residual, &own)) {
                continue;
            }
            let mut point = self.point.clone();
            point.env.set_all(symbols, &super::group::random_element(&configuration.group, random));
            let (params, slots) = (constants(&point.params), constants(&point.slots));
            let inputs = constants(&point.inputs);
            let slopes = |symbol: &SymbolId| -> Vec<Wide> {
                let seeded = self.setting.seeded(&point.env, &[(*symbol, Wide::ONE)]);
                let state: Vec<Dual<Wide>> =
                    self.setting.state.iter().map(|s| seeded.get(*s).unwrap_or_default()).collect();
                let t = Dual::constant(point.t);
                let at = At { params: &params, slots: &slots, inputs: &inputs, t, state: &state };
                let found = self.setting.runner.call(function, &at, &[]);
                let kept = found.iter().skip(self.setting.claim.n_positions);
                kept.map(|value| value.derivative).chain([Wide::ZERO]).collect()
            };
            let rows: Vec<Vec<Wide>> = symbols.iter().map(slopes).collect();
            let n = rows.first().map_or(0, |row| row.len() - 1);
            let free = symbols.len() - Reduced::new(rows, n).rank();
            let of_spaces = configuration.group.spaces().into_iter().map(|(_, dim)| dim);
            let dimension = configuration.group.matrices().len() + of_spaces.sum::<usize>();
            let [free, dimension] = [free, dimension].map(|n| Wide::exact(n as f64));
            let what = format!("the dimension of what stays in the group of {}", configuration.name);
            sheet.equal(&output.name, what, free, dimension);
        }
    }

    /// The configuration that a function keeps in its group, where that is told in a frame that moves: the motion keeps
    /// the function where the matrix is in the group alone.
    fn relative_to_a_frame(&self, function: &str) -> Option<&Configuration> {
        let all = self.setting.definition.model.configurations.iter();
        let of = |c: &&Configuration| function.starts_with(&format!("{}_form_", c.name));
        all.filter(|c| !c.relative.is_empty()).find(of)
    }

    /// A function has one value on the group.
    fn is_of_group(
        &self,
        output: &Output,
        (k, name): (usize, &str),
        configuration: &Configuration,
        sheet: &mut Sheet,
        random: &mut Random,
    ) {
        let role = Role::Output(output.name.clone());
        let Some(function) = self.setting.claim.program.function_idx(&role) else { return };
        let mut at = || {
            let mut point = self.point.clone();
            let element = super::group::random_element(&configuration.group, random);
            point.env.set_all(&configuration.symbols, &element);
            let state = point.state(self.setting);
            self.setting.runner.call(function, &point.at(&state), &[])[k]
        };
        let (one, other) = (at(), at());
        sheet.equal(&output.name, format!("{name} on the group"), one, other);
    }

    /// Geometric and dynamic phases add up to the rate of their coordinate.
    fn phases(&self, output: &Output, found: &[Wide], sheet: &mut Sheet) -> Outcome {
        let model = self.setting.definition.model;
        let value =
            |name: String| output.components.iter().position(|(own, _)| *own == name).map(|k| found[k]);
        for item in &model.reconstruction {
            let rates: Vec<ExprId> = match &item.kind {
                ReconstructionKind::Angle { omega } => vec![*omega],
                ReconstructionKind::Translation { v } => v.clone(),
                ReconstructionKind::Quaternion { omega } => {
                    let Some((name, _)) = item.blocks.first() else { continue };
                    let parts = [value(format!("{name}_geometric")), value(format!("{name}_dynamic"))];
                    if let [Some(geometric), Some(dynamic)] = parts {
                        self.turn(output, (name, omega), [geometric, dynamic], sheet)?;
                    }
                    continue;
                }
                _ => continue,
            };
            let rates = Tape::new(&model.graph, &rates).eval(&self.motion.at.env)?.roots;
            for (name, rate) in item.names.iter().zip(rates) {
                let parts = [value(format!("{name}_geometric")), value(format!("{name}_dynamic"))];
                if let [Some(geometric), Some(dynamic)] = parts {
                    sheet.zero(&output.name, format!("the phases of {name}"), &[geometric, dynamic, -rate]);
                }
            }
        }
        Ok(())
    }

    /// `Omega = theta' u + (Q^T Q')^v` with the direction `u` of the momentum and the shortest turn `Q` of it to the
    /// third axis; the dynamic part of `theta'` is `Omega . u`.
    fn turn(
        &self,
        output: &Output,
        (name, omega): (&str, &[ExprId; 3]),
        [geometric, dynamic]: [Wide; 2],
        sheet: &mut Sheet,
    ) -> Outcome {
        let definition = &self.setting.definition;
        let model = definition.model;
        let turning = Tape::new(&model.graph, omega).eval(&self.motion.at.env)?.roots;
        let mut u = [Dual::constant(Wide::ZERO); 3];
        for (e, entry) in omega.iter().zip(&mut u) {
            let free = model.graph.free_symbols(*e);
            let own = model.velocities.iter().position(|v| free.contains(&v.symbol));
            let k = own.ok_or(Open::Because("an attitude that no velocity turns"))?;
            *entry = self.momentum(&self.motion.moving, model.n_shape() + k)?;
        }
        let norm = u.iter().fold(Dual::constant(Wide::ZERO), |sum, p| sum + *p * *p).sqrt();
        u.iter_mut().for_each(|p| *p /= norm);
        // Rodrigues' formula: 1 + [v] + [v]^2/(1 + u_3) with v = u x e3.
        let (one, zero) = (Dual::constant(Wide::ONE), Dual::constant(Wide::ZERO));
        let (a, b) = (u[1], -u[0]);
        let cross = [[zero, zero, b], [zero, zero, -a], [-b, a, zero]];
        let below = one + u[2];
        let mut q = [[zero; 3]; 3];
        for (i, row) in q.iter_mut().enumerate() {
            for (j, entry) in row.iter_mut().enumerate() {
                let square = (0..3).fold(zero, |sum, k| sum + cross[i][k] * cross[k][j]);
                *entry = cross[i][j] + square / below + if i == j { one } else { zero };
            }
        }
        let entry =
            |i: usize, j: usize| (0..3).fold(Wide::ZERO, |sum, k| sum + q[k][i].value * q[k][j].derivative);
        let of_turn = [entry(2, 1), entry(0, 2), entry(1, 0)];
        for (k, of_turn) in of_turn.into_iter().enumerate() {
            let along = [geometric, dynamic].map(|part| -(part * u[k].value));
            let terms = [turning[k], -of_turn, along[0], along[1]];
            sheet.zero(&output.name, format!("the turn of {name}"), &terms);
        }
        let terms: Vec<Wide> =
            turning.iter().zip(&u).map(|(w, u)| -(*w * u.value)).chain([dynamic]).collect();
        sheet.zero(&output.name, format!("the dynamic phase of {name}"), &terms);
        Ok(())
    }
}

/// A residual is that of an equation of the model.
fn nearest(function: &str, name: &str, found: Wide, defined: &[Wide], sheet: &mut Sheet) -> Outcome {
    let apart = |x: &Wide| (found - *x).size();
    let best = defined.iter().min_by(|a, b| apart(a).total_cmp(&apart(b)));
    let best = best.ok_or(Open::Because("a residual of no equation between positions"))?;
    sheet.equal(function, name, found, *best);
    Ok(())
}
