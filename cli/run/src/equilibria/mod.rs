//! Relative equilibria of a scene: states whose rates are drifts along symmetries, alone or in families by a parameter,
//! with their stability on the reduced space.
//!
//! The equations of a scene are reduced already, so that what turns and moves steadily in space is at rest there.
//! Symmetries that are left in a scene - cyclic coordinates, a heading, equal moments of inertia - are found by
//! numbers.
//!
//! Does not know: arguments, how an answer is shown.

mod answer;
mod family;
mod field;
mod orbit;
mod search;
mod stability;
mod symmetry;

use std::collections::BTreeMap;
use std::sync::Arc;

use hamel_codegen::scene::{Prior, Told};
use hamel_codegen::spec::{Domain, Want};
use nalgebra::{DMatrix, DVector};

use crate::direction::Direction;
use crate::dynamics::Factory as _;
use crate::error::{Error, Problem};
use crate::forms::Forms;
use crate::info::{Info, ParamEntry};
use crate::inputs::InputTable;
use crate::integrate::simulate;
use crate::interpreted::{self, Built};
use crate::method::{MethodName, Steps};
use crate::model::Checked;
use crate::noise::Noise;
use crate::simulation::{MAX_EVENTS, SimulateRequest};
use crate::start::Starts;
use family::{Follower, OnCurve};
use field::{ENERGY, Field, MOVING_ENERGY, Point, Values, Variable};
use orbit::{Orbit, admissible, drifted};
use search::{Equations, Missed, Quantity, Solvable as _};
use stability::Setting;
use symmetry::Symmetry;

pub use family::{Change, End};
pub use stability::{EnergyTest, Stability, Verdict};

/// Tolerances of the motions that orbits are made of, a little above the roundoff.
const RTOL: f64 = 1e-13;
const ATOL: f64 = 1e-15;
/// A period differs from the guess by less than this factor.
const STRETCH: f64 = 3.0;
/// A motion that moves by less than this in a period, beside its size, is an equilibrium.
const AT_REST: f64 = 1e-8;
/// Most steps of such a motion.
const MAX_STEPS: u64 = 1_000_000;

/// A question.
#[derive(Clone, Debug, Default)]
pub struct Asked {
    /// Parameters that differ from the scene's.
    pub set: BTreeMap<String, f64>,
    /// Components of the guess, in any form of the state.
    pub at: BTreeMap<String, f64>,
    /// Inputs that differ from the values that the model holds them at.
    pub hold: BTreeMap<String, f64>,
    /// What keeps its value of the guess, or another one: components of the state, invariants, outputs.
    pub keep: Vec<(String, Option<f64>)>,
    /// Inputs and parameters that are solved for.
    pub free: Vec<String>,
    /// Whether nothing drifts.
    pub at_rest: bool,
    /// The time that equations with time in them are frozen at.
    pub t: Option<f64>,
    /// What a family goes along.
    pub along: Option<Along>,
    /// About how long an orbit takes: then a relative periodic orbit is sought.
    pub period: Option<f64>,
    /// What messages put before the name of an option: `--` on the command line.
    pub dashes: &'static str,
}

/// The way of a family.
#[derive(Clone, Debug)]
pub struct Along {
    /// A parameter, an input, a component of the state, an invariant, or an output.
    pub name: String,
    /// The first value.
    pub from: f64,
    /// The last value.
    pub to: f64,
    /// Number of points at equal distances where the family does not turn back.
    pub n_points: usize,
}

/// A relative equilibrium.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// The state, in the order of the scene.
    pub state: Vec<f64>,
    /// Values of the inputs.
    pub inputs: Vec<f64>,
    /// Values of the parameters.
    pub params: Vec<f64>,
    /// Drifts along the symmetries of [`Answer::symmetries`].
    pub drifts: Vec<f64>,
    /// The largest rate that is no drift.
    pub residual: f64,
    /// What the family goes along.
    pub along: Option<f64>,
    /// The period of an orbit.
    pub period: Option<f64>,
    /// Its stability.
    pub stability: Stability,
}

/// An answer.
#[derive(Clone, Debug)]
pub struct Answer {
    /// The scene.
    pub info: Info,
    /// Symmetries that are left in the scene, in words.
    pub symmetries: Vec<String>,
    /// What the guess has that nobody gave.
    pub told: Vec<Told>,
    /// The equilibrium, or all of the family.
    pub equilibria: Vec<Equilibrium>,
    /// What happens along the family: behind which equilibrium, what, and where.
    pub changes: Vec<(usize, Change, Equilibrium)>,
    /// How the family ends.
    pub end: Option<End>,
}

/// Finds a relative equilibrium near a guess, a family of them, or a relative periodic orbit.
///
/// # Errors
/// [`Error::Request`] with every name that is not there; why there is no guess, and no equilibrium near it.
pub fn find(model: &Arc<Checked>, scene: &str, asked: &Asked) -> Result<Answer, Error> {
    let built = interpreted::build(model, scene)?;
    let built = if asked.period.is_some() { built.in_memory() } else { built };
    let residuals = built.with_residuals();
    let field = Field::new(&built, residuals.as_ref(), asked.t.unwrap_or(0.0));
    let field = if asked.period.is_some() { field.with_events() } else { field };
    let search = Search::new(model, &built, &field, asked)?;
    search.answer()
}

/// What a component of the state is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    Coordinate,
    /// A velocity or a momentum.
    Velocity,
    /// A component of a vector whose norm is kept: advected parameters, points of circles, quaternions.
    Advected,
}

struct Search<'a> {
    asked: &'a Asked,
    built: &'a Built,
    field: &'a Field<'a>,
    guess: Point,
    told: Vec<Told>,
    /// All symmetries that are left.
    symmetries: Vec<Symmetry>,
    /// Components of the state that never change.
    constants: Vec<bool>,
    /// Whether a component is an angle.
    is_angle: Vec<bool>,
    /// Whether there is an energy that is kept.
    has_energy: bool,
    /// The size of the derivatives of the rates at the guess.
    scale: f64,
    held: Vec<(Quantity, f64)>,
    free: Vec<Variable>,
    along: Option<Quantity>,
}

impl<'a> Search<'a> {
    fn new(
        model: &Arc<Checked>,
        built: &'a Built,
        field: &'a Field<'a>,
        asked: &'a Asked,
    ) -> Result<Search<'a>, Error> {
        let info = built.info();
        let names = Names { info, invariants: field.invariant_names() };
        let forms = Forms::of(model, info)?;
        names.check(asked, &forms)?;
        let (mut set, mut given, mut hold) = (asked.set.clone(), asked.at.clone(), asked.hold.clone());
        if let Some(Along { name, from, .. }) = &asked.along
            && let Some(Quantity::Variable(variable)) = names.quantity(name)
        {
            let list = match variable {
                Variable::Param(_) => &mut set,
                Variable::Input(_) => &mut hold,
                Variable::State(_) => &mut given,
            };
            list.insert(name.clone(), *from);
        }
        let velocity_names = forms.names(&forms.velocities());
        let starts = Starts::new(model, info, forms)?;
        let (params, y) = starts.choose(built, &set, &given)?;
        let told = starts.told([&set, &given], (&params, &y))?;
        let value = |input: &ParamEntry| hold.get(&input.name).copied().unwrap_or(input.default);
        let guess = Point { y, inputs: info.inputs.iter().map(value).collect(), params };
        if asked.period.is_some() && field.reads_time() {
            let reason = "depends on time: only motions without time in their equations and events come back";
            return Err(Error::unusable("the motion", reason));
        }
        if asked.t.is_none() && field.reads_time() {
            let reason = "depends on time: give the time `t` that the equations are frozen at";
            return Err(Error::unusable("the motion", reason));
        }
        let prior = Prior::of(model, &info.scene, &set);
        let is_velocity: Vec<bool> = velocity_names.iter().map(|name| prior.is_velocity(name)).collect();
        let of_base = model.base.iter().map(|c| (&c.name, c.domain));
        let of_states = model
            .first_order
            .iter()
            .flat_map(|state| state.components.iter().map(|(name, _)| (name, state.domain)));
        let angles: Vec<&String> = of_base
            .chain(of_states)
            .filter(|(_, domain)| matches!(domain, Domain::Angle))
            .map(|(name, _)| name)
            .collect();
        let is_angle = |name: &String| angles.contains(&name);
        let mut search = Search {
            asked,
            built,
            field,
            guess,
            told,
            symmetries: Vec::new(),
            constants: Vec::new(),
            is_angle: velocity_names.iter().map(is_angle).collect(),
            has_energy: false,
            scale: 0.0,
            held: Vec::new(),
            free: asked.free.iter().filter_map(|name| names.variable(name)).collect(),
            along: asked.along.as_ref().and_then(|along| names.quantity(&along.name)),
        };
        let is_coordinate = |name: &String| model.base.iter().any(|c| c.name == *name);
        let roles: Vec<Role> = (velocity_names.iter().zip(&is_velocity))
            .map(|(name, is_velocity)| match (is_velocity, is_coordinate(name)) {
                (true, _) => Role::Velocity,
                (false, true) => Role::Coordinate,
                (false, false) => Role::Advected,
            })
            .collect();
        search.look_around(&roles, &names)?;
        Ok(search)
    }

    /// Finds the quantities that are kept in any case, and the symmetries.
    fn look_around(&mut self, roles: &[Role], names: &Names<'_>) -> Result<(), Error> {
        let no_value = || Error::unusable("the guess", "is a state where the motion has no value");
        let n = self.guess.y.len();
        let by: Vec<Variable> = (0..n).map(Variable::State).collect();
        let values = self.field.values(&self.guess).filter(Values::are_finite).ok_or_else(no_value)?;
        let around = symmetry::around(self.field, &self.guess);
        let at_guess = self.field.derivatives(&self.guess, &by).ok_or_else(no_value)?;
        let slopes = || around.iter().map(|(_, slopes)| slopes).chain([&at_guess]);
        let is_of_advected = |k: &usize| {
            slopes().all(|by| (0..n).all(|i| roles[i] == Role::Advected || by[i].invariants[*k] == 0.0))
        };
        let is_found = |k: &usize| is_of_motion(&names.invariants[*k]);
        let all = 0..values.invariants.len();
        let kept: Vec<usize> = all.clone().filter(|k| !is_found(k) && is_of_advected(k)).collect();
        self.constants = (0..n)
            .map(|k| values.rates[k] == 0.0 && slopes().all(|by| by.iter().all(|s| s.rates[k] == 0.0)))
            .collect();
        // A user who keeps other quantities may move between the levels of Casimirs.
        let on_levels = self.asked.keep.is_empty()
            && self
                .along
                .is_none_or(|q| matches!(q, Quantity::Variable(Variable::Param(_) | Variable::Input(_))));
        let casimirs = names.info.outputs.iter().filter(|group| group.name == Want::Casimirs.name());
        let casimirs: Vec<&String> = casimirs.flat_map(|group| &group.components).collect();
        let is_casimir = |k: &usize| on_levels && casimirs.contains(&&names.invariants[*k]);
        for k in all.filter(|k| kept.contains(k) || is_casimir(k)) {
            self.held.push((Quantity::Invariant(k), values.invariants[k]));
        }
        self.scale = DMatrix::from_fn(n, n, |i, j| at_guess[j].rates[i]).norm();
        let n_equations = self.field.n_equations();
        for (k, value) in values.positions.iter().enumerate() {
            self.held.push((Quantity::Position(k), if k < n_equations { 0.0 } else { *value }));
        }
        self.held.extend((0..values.residuals.len()).map(|k| (Quantity::Residual(k), 0.0)));
        for (name, value) in &self.asked.keep {
            let Some(quantity) = names.quantity(name) else { continue };
            self.held.push((quantity, value.unwrap_or_else(|| quantity.value(&self.guess, &values))));
        }
        self.has_energy = !values.energy.is_empty();
        let rule = symmetry::Kept { invariants: kept, energy: self.has_energy };
        let is_velocity: Vec<bool> = roles.iter().map(|role| *role == Role::Velocity).collect();
        self.symmetries = symmetry::find(self.field, &self.guess, &is_velocity, &rule);
        Ok(())
    }

    fn equations(&self) -> Equations<'_> {
        let state = (0..self.guess.y.len()).map(Variable::State);
        let symmetries = if self.asked.at_rest { &[][..] } else { &self.symmetries[..] };
        Equations {
            base: &self.guess,
            field: self.field,
            symmetries,
            variables: state.chain(self.free.iter().copied()).collect(),
            held: self.held.clone(),
            along: None,
        }
    }

    fn answer(self) -> Result<Answer, Error> {
        let setting = Setting {
            field: self.field,
            symmetries: &self.symmetries,
            has_energy: self.has_energy,
            constants: &self.constants,
            scale: self.scale,
        };
        if let Some(period) = self.asked.period {
            return self.orbit(&setting, period);
        }
        let mut equations = self.equations();
        let from = self.asked.along.as_ref().map(|along| along.from);
        if let (Some(quantity), Some(from)) = (self.along, from)
            && !matches!(quantity, Quantity::Variable(Variable::Param(_) | Variable::Input(_)))
        {
            equations.held.push((quantity, from));
        }
        let drifts = self.first_drifts(&equations);
        let start = equations.unknowns(&self.guess, &drifts, 0.0);
        let x = equations.solve(&start, &[]).map_err(|missed| self.missed(missed))?;
        let at = equations.point(&x);
        self.field.check(&at).map_err(|reason| {
            Error::unusable("the guess", format!("leads to a state where {reason}: give another one"))
        })?;
        let first =
            self.equilibrium(&equations, &setting, &x, None).ok_or_else(|| self.missed(Missed::NoValue))?;
        let mut answer = self.answer_of(first);
        if let Some(along) = &self.asked.along {
            self.follow(&setting, along, (&at, &equations.drifts(&x)), &mut answer)?;
        }
        Ok(answer)
    }

    fn answer_of(&self, first: Equilibrium) -> Answer {
        Answer {
            info: self.built.info().clone(),
            symmetries: self.symmetries.iter().map(|s| s.to_text(&self.built.info().state)).collect(),
            told: self.told.clone(),
            equilibria: vec![first],
            changes: Vec::new(),
            end: None,
        }
    }

    /// The relative periodic orbit near the guess.
    fn orbit(&self, setting: &Setting<'_>, period: f64) -> Result<Answer, Error> {
        let equations = self.equations();
        let n = self.guess.y.len();
        let held = |input: &ParamEntry, value: &f64| (input.name.clone(), *value);
        let inputs: Vec<(String, f64)> =
            self.built.info().inputs.iter().zip(&self.guess.inputs).map(|(i, x)| held(i, x)).collect();
        let driven = match inputs.is_empty() {
            true => None,
            false => Some(self.built.also_driven_by(&InputTable::held("hold", &inputs))?),
        };
        let scene = driven.as_ref().unwrap_or(self.built);
        // Neither no time at all nor many rounds.
        let allowed = period / STRETCH..period * STRETCH;
        let flow = |at: &Point, t: f64, is_derived: bool| {
            if allowed.contains(&t) { flowed(scene, at, t, is_derived) } else { None }
        };
        let (reached, _) = flow(&self.guess, period, false).ok_or_else(|| {
            Error::unusable(
                "the guess",
                format!("has no motion to the time {period}: give another period or guess"),
            )
        })?;
        let values = self.field.values(&self.guess).ok_or_else(|| self.missed(Missed::NoValue))?;
        let turn = |k: usize| {
            let full = std::f64::consts::TAU;
            if self.is_angle[k] { full * ((reached[k] - self.guess.y[k]) / full).round() } else { 0.0 }
        };
        let orbit = Orbit {
            equations: &equations,
            flow: &flow,
            phase: DVector::from_vec(values.rates),
            turns: DVector::from_fn(n, |k, _| turn(k)),
        };
        let drifts = vec![0.0; equations.symmetries.len()];
        let start = equations.unknowns(&self.guess, &drifts, 0.0).push(period);
        let x = orbit.solve(&start, &[]).map_err(|missed| self.missed(missed))?;
        let no_value = || self.missed(Missed::NoValue);
        let inner = x.rows(0, x.len() - 1).into_owned();
        let at = admissible(&equations, &equations.point(&inner)).ok_or_else(no_value)?;
        let (drifts, period) = (equations.drifts(&inner), x[x.len() - 1]);
        let residual = orbit.residual(&x).ok_or_else(no_value)?.rows(0, n).amax();
        let rest = equations.residual(&inner).ok_or_else(no_value)?.rows(0, n).amax();
        if rest * period <= AT_REST * (1.0 + DVector::from_column_slice(&at.y).amax()) {
            let reason = "leads to an equilibrium, which comes back after any time: give another one";
            return Err(Error::unusable("the guess", reason));
        }
        let (_, derivatives) = flow(&at, period, true).ok_or_else(no_value)?;
        // Back from where the drift has led.
        let (back, _) = drifted(equations.symmetries, &drifts, -period, n);
        let stability = setting
            .of_orbit(&at, (&(back * derivatives), scene.watched().is_none()), period)
            .ok_or_else(no_value)?;
        let Point { y: state, inputs, params } = at;
        let period = Some(period);
        Ok(self.answer_of(Equilibrium {
            state,
            inputs,
            params,
            drifts,
            residual,
            along: None,
            period,
            stability,
        }))
    }

    /// Drifts that meet the rates of the guess best.
    fn first_drifts(&self, equations: &Equations<'_>) -> Vec<f64> {
        let n = equations.symmetries.len();
        let start = equations.unknowns(&self.guess, &vec![0.0; n], 0.0);
        let Some(values) = self.field.values(&self.guess).filter(|_| n > 0) else { return vec![0.0; n] };
        let y = DVector::from_column_slice(&self.guess.y);
        let moved: Vec<_> = equations.symmetries.iter().map(|s| s.at(&y)).collect();
        let columns = DMatrix::from_columns(&moved);
        let rates = DVector::from_vec(values.rates);
        let found = columns.clone().svd(true, true).solve(&rates, 1e-10 * columns.norm().max(1e-300));
        found.map_or_else(|_| equations.drifts(&start), |c| c.iter().copied().collect())
    }

    fn equilibrium(
        &self,
        equations: &Equations<'_>,
        setting: &Setting<'_>,
        x: &DVector<f64>,
        stability: Option<Stability>,
    ) -> Option<Equilibrium> {
        let at = equations.point(x);
        let drifts = equations.drifts(x);
        let stability = match stability {
            Some(found) => found,
            None => setting.stability(&at, &drifts)?,
        };
        let residual = equations.linear(x)?.residual.rows(0, at.y.len()).amax();
        let along = self.asked.along.as_ref().map(|along| match equations.along {
            Some(_) => x[x.len() - 1],
            None => along.from,
        });
        let Point { y: state, inputs, params } = at;
        Some(Equilibrium { state, inputs, params, drifts, residual, along, period: None, stability })
    }

    fn follow(
        &self,
        setting: &Setting<'_>,
        along: &Along,
        (at, drifts): (&Point, &[f64]),
        answer: &mut Answer,
    ) -> Result<(), Error> {
        let equations = Equations { along: self.along, ..self.equations() };
        let follower = Follower {
            equations: &equations,
            setting,
            first: along.from,
            last: along.to,
            n_points: along.n_points,
        };
        let curve = follower
            .follow(&equations.unknowns(at, drifts, along.from))
            .ok_or_else(|| self.missed(Missed::NoValue))?;
        let shown = |on: &OnCurve| {
            let x = follower.unscaled(&on.x);
            self.equilibrium(&equations, setting, &x, Some(on.stability.clone()))
        };
        answer.equilibria = curve.points.iter().filter_map(shown).collect();
        answer.changes =
            curve.changes.iter().filter_map(|(k, change, on)| Some((*k, *change, shown(on)?))).collect();
        answer.end = Some(curve.end);
        Ok(())
    }

    fn missed(&self, missed: Missed) -> Error {
        let reason = match missed {
            Missed::NoValue => "leads to a state where the motion has no value".to_owned(),
            Missed::Residual(size) if self.asked.period.is_some() => {
                format!("has no orbit near it: motions there come back to {size:.3e} at best")
            }
            Missed::Away => "leads away without bound: the rates vanish at infinity only".to_owned(),
            Missed::Residual(size) => {
                format!("has no equilibrium near it: the smallest rates there are {size:.3e}")
            }
        };
        let free = match (self.asked.free.is_empty(), self.guess.inputs.is_empty()) {
            (true, false) => ", or set an input free",
            _ => "",
        };
        Error::unusable("the guess", format!("{reason}; give another one{free}"))
    }
}

/// Whether an invariant says where a motion is on its way, and is no condition on its state: energies and momenta.
fn is_of_motion(name: &str) -> bool {
    [ENERGY, MOVING_ENERGY].contains(&name)
        || ["gauge_momentum", "space_"].iter().any(|first| name.starts_with(first))
}

/// The state that a motion reaches, and its derivatives by the initial state; nothing where it does not go so far.
fn flowed(scene: &Built, at: &Point, t: f64, is_derived: bool) -> Option<(Vec<f64>, DMatrix<f64>)> {
    let n = at.y.len();
    let along = if is_derived { (0..n).map(Direction::Initial).collect() } else { Vec::new() };
    let request = SimulateRequest {
        params: at.params.clone(),
        initial: at.y.clone(),
        t_final: t,
        method: MethodName::Dop853,
        steps: Steps::new(MethodName::Dop853, Some(RTOL), Some(ATOL), None).ok()?,
        samples: 1,
        with_outputs: false,
        n_group: 0,
        max_steps: MAX_STEPS,
        max_events: MAX_EVENTS,
        watched: scene.watched(),
        noise: Noise::default(),
        along,
        tangents: Vec::new(),
    };
    let response = simulate(scene, &request, &mut |_| ()).ok().filter(|found| found.t == t)?;
    let columns: Vec<DVector<f64>> =
        response.along.iter().map(|(_, column)| DVector::from_column_slice(column)).collect();
    let derivatives = if is_derived { DMatrix::from_columns(&columns) } else { DMatrix::zeros(0, 0) };
    Some((response.last, derivatives))
}

/// What names may mean.
struct Names<'a> {
    info: &'a Info,
    invariants: Vec<String>,
}

impl Names<'_> {
    fn outputs(&self) -> impl Iterator<Item = &String> {
        self.info.outputs.iter().flat_map(|group| &group.components)
    }

    fn variable(&self, name: &str) -> Option<Variable> {
        let input = self.info.inputs.iter().position(|input| input.name == name).map(Variable::Input);
        let param = || self.info.params.iter().position(|p| p.name == name).map(Variable::Param);
        input.or_else(param)
    }

    fn quantity(&self, name: &str) -> Option<Quantity> {
        let state = self.info.state.iter().position(|own| own == name);
        let state = state.map(|k| Quantity::Variable(Variable::State(k)));
        let other = || self.variable(name).map(Quantity::Variable);
        let invariant = || self.invariants.iter().position(|own| own == name).map(Quantity::Invariant);
        let output = || self.outputs().position(|own| own == name).map(Quantity::Output);
        state.or_else(other).or_else(invariant).or_else(output)
    }

    /// All names that something can be kept at.
    fn kept(&self) -> Vec<String> {
        self.info.state.iter().chain(&self.invariants).chain(self.outputs()).cloned().collect()
    }

    /// Inputs and parameters.
    fn variables(&self) -> Vec<String> {
        self.info.inputs.iter().chain(&self.info.params).map(|entry| entry.name.clone()).collect()
    }

    fn check(&self, asked: &Asked, forms: &Forms) -> Result<(), Error> {
        let mut problems = Vec::new();
        let unknown = |path: &str, name: &String, kind: &'static str, known: Vec<String>| {
            Problem::UnknownName { path: path.into(), name: name.clone(), kind, known }
        };
        let own = |names: &[ParamEntry]| names.iter().map(|entry| entry.name.clone()).collect();
        let of_state: Vec<String> = forms.known().into_iter().map(str::to_owned).collect();
        let given = [
            (&asked.set, "set", "parameter", own(&self.info.params)),
            (&asked.hold, "hold", "input", own(&self.info.inputs)),
            (&asked.at, "at", "state", of_state),
        ];
        for (list, path, kind, known) in given {
            let wrong = list.keys().filter(|name| !known.contains(name));
            problems.extend(wrong.map(|name| unknown(path, name, kind, known.clone())));
        }
        for (name, _) in &asked.keep {
            if self.quantity(name).is_none() || self.variable(name).is_some() {
                problems.push(unknown("keep", name, "value", self.kept()));
            }
        }
        for name in &asked.free {
            if self.variable(name).is_none() {
                problems.push(unknown("free", name, "input or parameter", self.variables()));
            }
        }
        if let Some(along) = &asked.along {
            let known = || self.variables().into_iter().chain(self.kept()).collect();
            if self.quantity(&along.name).is_none() {
                problems.push(unknown("along", &along.name, "value", known()));
            }
            let is_said_twice = asked.free.contains(&along.name)
                || asked.keep.iter().any(|(name, _)| *name == along.name)
                || [&asked.set, &asked.hold].iter().any(|list| list.contains_key(&along.name));
            if is_said_twice {
                let reason = format!("goes along {}, which is given or set free besides", along.name);
                problems.push(Problem::Unusable { path: format!("{}along", asked.dashes), reason });
            }
        }
        if problems.is_empty() { Ok(()) } else { Err(Error::Request { problems }) }
    }
}
