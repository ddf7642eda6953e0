//! Relative equilibria of a scene: states whose rates are drifts along symmetries, alone or in families by a parameter,
//! with their stability on the reduced space.
//!
//! The equations of a scene are reduced already, so that what turns and moves steadily in space is at rest there.
//! Symmetries that are left in a scene - cyclic coordinates, a heading, equal moments of inertia - are found by
//! numbers.
//!
//! Does not know: arguments, how an answer is shown.

mod answer;
mod asked;
mod family;
mod field;
mod orbit;
mod search;
mod stability;
mod symmetry;

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
use asked::Names;
use family::{Follower, HALVINGS, OnCurve};
use field::{ENERGY, Field, MOVING_ENERGY, Part, Point, Values, Variable};
use orbit::{Frame, Orbit, across, admissible, drifted};
use search::{Equations, Missed, Quantity, Solvable as _};
use stability::Setting;
use symmetry::Symmetry;

pub use asked::{Along, Asked};
pub use family::{Change, End};
pub use stability::{EnergyTest, Stability, Verdict};

/// Tolerances of the motions that orbits are made of, a little above the roundoff.
const RTOL: f64 = 1e-13;
const ATOL: f64 = 1e-15;
/// A period differs from the guess by less than this factor.
const STRETCH: f64 = 3.0;
/// A motion that moves by less than this in a period, beside its size, is an equilibrium.
const AT_REST: f64 = 1e-8;
/// The guess, and places on its motion, in periods.
const PLACES: [f64; 5] = [0.0, 0.13, 0.31, 0.57, 0.79];
/// Halvings that locate a change of orbits: multipliers are integrated to fewer digits.
const HALVINGS_OF_ORBITS: usize = 25;
/// Most steps of such a motion.
const MAX_STEPS: u64 = 1_000_000;

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
    /// Components of the state that are modes.
    modes: Vec<usize>,
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
            modes: Vec::new(),
            has_energy: false,
            scale: 0.0,
            held: Vec::new(),
            free: asked.free.iter().filter_map(|name| names.variable(name)).collect(),
            along: asked.along.as_ref().and_then(|along| names.quantity(&along.name)),
        };
        let is_coordinate = |name: &String| model.base.iter().any(|c| c.name == *name);
        let is_mode = |name: &String| model.modes.iter().any(|mode| mode.name == *name);
        let parts: Vec<Part> = (velocity_names.iter().zip(&is_velocity))
            .map(|(name, is_velocity)| match (is_velocity, is_coordinate(name)) {
                (true, _) => Part::Velocity,
                (false, true) => Part::Coordinate,
                (false, false) if is_mode(name) => Part::Mode,
                (false, false) => Part::Advected,
            })
            .collect();
        search.modes = (0..parts.len()).filter(|k| parts[*k] == Part::Mode).collect();
        search.look_around(&parts, &names)?;
        Ok(search)
    }

    /// Finds the quantities that are kept in any case, and the symmetries.
    fn look_around(&mut self, parts: &[Part], names: &Names<'_>) -> Result<(), Error> {
        let no_value = || Error::unusable("the guess", "is a state where the motion has no value");
        let n = self.guess.y.len();
        let by: Vec<Variable> = (0..n).map(Variable::State).collect();
        let values = self.field.values(&self.guess).filter(Values::are_finite).ok_or_else(no_value)?;
        let around = symmetry::around(self.field, &self.guess, parts);
        let at_guess = self.field.derivatives(&self.guess, &by).ok_or_else(no_value)?;
        let slopes = || around.iter().map(|(.., slopes)| slopes).chain([&at_guess]);
        let is_of_advected = |k: &usize| {
            slopes().all(|by| (0..n).all(|i| parts[i] == Part::Advected || by[i].invariants[*k] == 0.0))
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
        let is_met = || around.iter().all(|(at, values, _)| self.field.energy_is_kept_by_events(at, values));
        let rule = symmetry::Kept { invariants: kept, energy: self.has_energy && is_met() };
        self.symmetries = symmetry::find(self.field, &self.guess, parts, &rule);
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
            modes: &self.modes,
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
            modes: &self.modes,
            scale: self.scale,
        };
        if let Some(period) = self.asked.period {
            return self.orbit(&setting, period);
        }
        let mut equations = self.equations();
        self.hold_first(&mut equations);
        let values = self.field.values(&self.guess).ok_or_else(|| self.missed(Missed::NoValue))?;
        let drifts = first_drifts(&equations, &DVector::from_vec(values.rates));
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
            let drifts = equations.drifts(&x);
            let equations = Equations { along: self.along, ..self.equations() };
            let judge = |x: &DVector<f64>| setting.stability(&equations.point(x), &equations.drifts(x));
            let follower = Follower {
                equations: &equations,
                judge: &judge,
                first: along.from,
                last: along.to,
                n_points: along.n_points,
                n_halvings: HALVINGS,
            };
            let shown = |x: &DVector<f64>, stability: Stability| {
                self.equilibrium(&equations, &setting, x, Some(stability))
            };
            self.follow(&follower, &equations.unknowns(&at, &drifts, along.from), &shown, &mut answer)?;
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

    /// The relative periodic orbit near the guess, or a family of them.
    fn orbit(&self, setting: &Setting<'_>, period: f64) -> Result<Answer, Error> {
        if let Some(Quantity::Variable(Variable::Input(_))) = self.along {
            let path = format!("{}along", self.asked.dashes);
            let reason = "is an input: families of orbits go along parameters and what a state has".into();
            return Err(Error::Request { problems: vec![Problem::Unusable { path, reason }] });
        }
        let inputs = self.built.info().inputs.iter().zip(&self.guess.inputs);
        let inputs: Vec<(String, f64)> = inputs.map(|(input, x)| (input.name.clone(), *x)).collect();
        let driven = match inputs.is_empty() {
            true => None,
            false => Some(self.built.also_driven_by(&InputTable::held("hold", &inputs))?),
        };
        let scene = driven.as_ref().unwrap_or(self.built);
        // Neither no time at all nor many rounds.
        let allowed = period / STRETCH..period * STRETCH;
        let flow = |at: &Point, t: f64, along: &[Direction]| {
            if allowed.contains(&t) { flowed(scene, at, t, along) } else { None }
        };
        let mut guess = self.guess.clone();
        let mut missed = None;
        let mut found = None;
        for place in self.places() {
            if *place > 0.0 {
                let Some((y, _)) = flowed(scene, &self.guess, place * period, &[]) else { continue };
                guess.y = y;
            }
            match self.first_orbit(&guess, &flow, period) {
                Ok(orbit) => {
                    found = Some(orbit);
                    break;
                }
                Err(error) => missed = missed.or(Some(error)),
            }
        }
        let no_value = || self.missed(Missed::NoValue);
        let Some((x, frame)) = found else { return Err(missed.unwrap_or_else(no_value)) };
        let mut equations = Equations { base: &guess, ..self.equations() };
        self.hold_first(&mut equations);
        let orbit = Orbit { equations: &equations, flow: &flow, frame: &frame };
        let is_smooth = scene.watched().is_none();
        let first = self.on_orbit(&orbit, setting, is_smooth, &x).ok_or_else(no_value)?;
        let mut answer = self.answer_of(first);
        if let Some(along) = &self.asked.along {
            let equations = Equations { base: &guess, along: self.along, ..self.equations() };
            let orbit = Orbit { equations: &equations, flow: &flow, frame: &frame };
            let shown = |x: &DVector<f64>| self.on_orbit(&orbit, setting, is_smooth, x);
            let judge = |x: &DVector<f64>| Some(shown(x)?.stability);
            let follower = Follower {
                equations: &orbit,
                judge: &judge,
                first: along.from,
                last: along.to,
                n_points: along.n_points,
                n_halvings: HALVINGS_OF_ORBITS,
            };
            let shown = |x: &DVector<f64>, stability| Some(Equilibrium { stability, ..shown(x)? });
            self.follow(&follower, &x.push(along.from), &shown, &mut answer)?;
        }
        Ok(answer)
    }

    /// The orbit near a guess, by its unknowns.
    fn first_orbit(
        &self,
        guess: &Point,
        flow: orbit::Flow<'_>,
        period: f64,
    ) -> Result<(DVector<f64>, Frame), Error> {
        let mut equations = Equations { base: guess, ..self.equations() };
        self.hold_first(&mut equations);
        let n = guess.y.len();
        let (reached, _) = flow(guess, period, &[]).ok_or_else(|| {
            Error::unusable(
                "the guess",
                format!("has no motion to the time {period}: give another period or guess"),
            )
        })?;
        let no_value = || self.missed(Missed::NoValue);
        let values = self.field.values(guess).ok_or_else(no_value)?;
        let turn = |k: usize| {
            let full = std::f64::consts::TAU;
            if self.is_angle[k] { full * ((reached[k] - guess.y[k]) / full).round() } else { 0.0 }
        };
        let phase = across(equations.symmetries, &guess.y, values.rates).ok_or_else(no_value)?;
        let frame = Frame { phase, turns: DVector::from_fn(n, |k, _| turn(k)) };
        let change = DVector::from_fn(n, |k, _| reached[k] - guess.y[k]) - &frame.turns;
        let orbit = Orbit { equations: &equations, flow, frame: &frame };
        let drifts = first_drifts(&equations, &(change / period));
        let start = orbit.joined(&equations.unknowns(guess, &drifts, 0.0), period);
        let is_at_rest = |x: &DVector<f64>| {
            let (inner, period) = orbit.parted(x);
            let rest = equations.residual(&inner).map_or(0.0, |rates| rates.rows(0, n).amax());
            rest * period <= AT_REST * (1.0 + x.rows(0, n).amax())
        };
        let mut x = orbit.solve(&start, &[]).map_err(|missed| self.missed(missed))?;
        if is_at_rest(&x) {
            // Where orbits are a family about an equilibrium, the one that is as far from it as the guess, in what
            // moves.
            let from_rest = &start - &x;
            let moves = |k: usize| k < n && frame.phase[k] != 0.0;
            let row = DVector::from_fn(x.len(), |k, _| if moves(k) { from_rest[k] } else { 0.0 });
            let value = row.dot(&start);
            if let Ok(other) = orbit.solve(&start, &[(row, value)]) {
                x = other;
            }
        }
        if is_at_rest(&x) {
            let reason = "leads to an equilibrium, which comes back after any time: give another one";
            return Err(Error::unusable("the guess", reason));
        }
        Ok((x, frame))
    }

    /// Where the motion of the guess is looked at, in periods, one after the other until an orbit is found: a guess
    /// near an event has motions with and without it about it. A family begins away from there.
    fn places(&self) -> &'static [f64] {
        match (self.may_move(), self.along.is_some()) {
            (true, true) => &PLACES[1..],
            (true, false) => &PLACES,
            (false, _) => &PLACES[..1],
        }
    }

    /// Whether an orbit may be told from another place than the one nearest to the guess: events act near that one, and
    /// nothing is asked of the state there.
    fn may_move(&self) -> bool {
        let is_of_motion = |quantity: &Quantity| {
            matches!(quantity, Quantity::Invariant(_) | Quantity::Variable(Variable::Param(_)))
        };
        let mut held = self.held.iter().map(|(quantity, _)| quantity);
        let is_needed = |own: &Quantity| matches!(own, Quantity::Position(_) | Quantity::Residual(_));
        let are_held_alike = held.all(|own| is_needed(own) || is_of_motion(own));
        !self.field.acting().is_empty() && are_held_alike && self.along.as_ref().is_none_or(is_of_motion)
    }

    /// An orbit from its unknowns.
    fn on_orbit(
        &self,
        orbit: &Orbit<'_>,
        setting: &Setting<'_>,
        is_smooth: bool,
        x: &DVector<f64>,
    ) -> Option<Equilibrium> {
        let n = self.guess.y.len();
        let equations = orbit.equations;
        let (inner, period) = orbit.parted(x);
        let at = admissible(equations, &equations.point(&inner))?;
        let drifts = equations.drifts(&inner);
        let residual = orbit.residual(x)?.rows(0, n).amax();
        let directions: Vec<Direction> = (0..n).map(Direction::Initial).collect();
        let (_, derivatives) = (orbit.flow)(&at, period, &directions)?;
        // Back from where the drift has led.
        let (back, _) = drifted(equations.symmetries, &drifts, -period, n);
        let stability = setting.of_orbit(&at, (&(back * derivatives), is_smooth), period)?;
        let along = equations.along.map(|_| x[x.len() - 1]);
        let Point { y: state, inputs, params } = at;
        let period = Some(period);
        Some(Equilibrium { state, inputs, params, drifts, residual, along, period, stability })
    }

    /// Holds what a family goes along at its first value, where that is a quantity of the state.
    fn hold_first(&self, equations: &mut Equations<'_>) {
        let from = self.asked.along.as_ref().map(|along| along.from);
        if let (Some(quantity), Some(from)) = (self.along, from)
            && !matches!(quantity, Quantity::Variable(Variable::Param(_) | Variable::Input(_)))
        {
            equations.held.push((quantity, from));
        }
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

    /// Follows a family; `shown` makes an equilibrium or an orbit of its unknowns.
    fn follow(
        &self,
        follower: &Follower<'_>,
        start: &DVector<f64>,
        shown: &dyn Fn(&DVector<f64>, Stability) -> Option<Equilibrium>,
        answer: &mut Answer,
    ) -> Result<(), Error> {
        let curve = follower.follow(start).ok_or_else(|| self.missed(Missed::NoValue))?;
        let shown = |on: &OnCurve| shown(&follower.unscaled(&on.x), on.stability.clone());
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

/// Drifts that meet rates at the guess best.
fn first_drifts(equations: &Equations<'_>, rates: &DVector<f64>) -> Vec<f64> {
    let n = equations.symmetries.len();
    if n == 0 {
        return Vec::new();
    }
    let y = DVector::from_column_slice(&equations.base.y);
    let moved: Vec<_> = equations.symmetries.iter().map(|s| s.at(&y)).collect();
    let columns = DMatrix::from_columns(&moved);
    let least = 1e-10 * columns.norm().max(1e-300);
    let found = columns.svd(true, true).solve(rates, least);
    found.map_or_else(|_| vec![0.0; n], |c| c.iter().copied().collect())
}

/// Whether an invariant says where a motion is on its way, and is no condition on its state: energies and momenta.
fn is_of_motion(name: &str) -> bool {
    [ENERGY, MOVING_ENERGY].contains(&name)
        || ["gauge_momentum", "space_"].iter().any(|first| name.starts_with(first))
}

/// The state that a motion reaches, and its derivatives along directions; nothing where it does not go so far.
fn flowed(scene: &Built, at: &Point, t: f64, along: &[Direction]) -> Option<(Vec<f64>, DMatrix<f64>)> {
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
        along: along.to_vec(),
        tangents: Vec::new(),
    };
    let response = simulate(scene, &request, &mut |_| ()).ok().filter(|found| found.t == t)?;
    let columns: Vec<DVector<f64>> =
        response.along.iter().map(|(_, column)| DVector::from_column_slice(column)).collect();
    let derivatives = if columns.is_empty() { DMatrix::zeros(0, 0) } else { DMatrix::from_columns(&columns) };
    Some((response.last, derivatives))
}
