//! The rule of initial states: which values are given, which are chosen, and which are moved first where equations ask
//! for others.
//!
//! A component has the value that the user gives, else the one of the model's `initial`, else zero: the identity of a
//! group, a point of a circle at the angle zero, the middle of an interval without zero, and a unit vector for an
//! advected parameter of several components, which is not zero for anybody. Velocities of a model without any `initial`
//! are moderate numbers, because a motion from rest would show nothing. Equations between coordinates, and then
//! constraints, are met by moving what nobody gave, and only where this is not enough what the model gives, never what
//! the user gives.
//!
//! Deliberately does not know: who evaluates a scene, how equations are met, the forms of a state.

use std::collections::{BTreeMap, BTreeSet};

use super::dependent::Dependent;
use super::implied::Implied;
use super::roles::{VariableRole, all_params, initial_values, variable_roles};
use hamel_expr::{ExprId, SymbolId};
use hamel_lang::spec::{Domain, Model, circle_names};

/// Where the value of a component of an initial state comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The user gives it.
    Given,
    /// The model's `initial`.
    Model,
    /// Nobody gives it.
    Chosen,
}

/// What became of a component that the user did not give.
#[derive(Clone, Debug, PartialEq)]
pub enum Told {
    /// Nobody gives it, and this is its value.
    Chosen {
        /// Name of the component.
        name: String,
        /// Its value.
        value: f64,
    },
    /// The model gives another value than equations allow.
    Moved {
        /// Name of the component.
        name: String,
        /// The value that the model gives.
        from: f64,
        /// Its value.
        to: f64,
    },
}

/// Part of a value up to which a difference to what the model gives is rounding.
const ROUNDING: f64 = 1e-12;

/// The same of velocities that are solved for: elimination loses a few digits.
const LINEAR_ROUNDING: f64 = 1e-9;

/// What is known about initial states of a scene's model before anybody asks for one.
#[derive(Clone, Debug)]
pub struct Prior {
    roles: BTreeMap<String, VariableRole>,
    /// Values that the model gives.
    initial: BTreeMap<String, f64>,
    /// Points of circles at the angle where nobody gives one.
    points: BTreeMap<String, f64>,
    /// Whether the model gives no initial value at all.
    is_silent: bool,
    implied: Option<Implied>,
    dependent: Option<Dependent>,
}

impl Prior {
    /// For a scene with the parameters `set`.
    pub fn of(model: &Model, scene: &str, set: &BTreeMap<String, f64>) -> Prior {
        let params = all_params(model, scene, set);
        let roles = variable_roles(model, &params);
        let point = |name: &String| {
            let angle = roles.get(name).map_or(0.0, neutral);
            circle_names(name).into_iter().zip([angle.cos(), angle.sin()])
        };
        let points = model.base.iter().flat_map(|c| point(&c.name)).collect();
        let (initial, is_silent) = (initial_values(model, &params), model.initial.is_empty());
        let (implied, dependent) = (Implied::of(model, &params), Dependent::of(model, &params));
        Prior { roles, initial, points, is_silent, implied, dependent }
    }

    /// Why a state with its components by name cannot be a start, though it keeps the equations of the scene: one that
    /// was left out does not hold there.
    pub fn refusal(&self, names: &[String], state: &[f64]) -> Option<String> {
        self.implied.as_ref()?.refusal(names, state)
    }

    /// Names of the parameters that the rule depends on for a model: those in initial values and in ends of intervals.
    pub fn reads(model: &Model) -> BTreeSet<String> {
        let domains = model.base.iter().map(|c| c.domain).chain(model.first_order.iter().map(|s| s.domain));
        let ends = domains.flat_map(|domain| match domain {
            Domain::Interval(from, to) => vec![from, to],
            Domain::Angle | Domain::Real => Vec::new(),
        });
        let all: Vec<ExprId> = ends.chain(model.initial.iter().map(|(_, e)| *e)).collect();
        let read: BTreeSet<SymbolId> = all.into_iter().flat_map(|e| model.graph.free_symbols(e)).collect();
        model.params.iter().filter(|p| read.contains(&p.symbol)).map(|p| p.name.clone()).collect()
    }

    /// Whether a component is a velocity or a momentum.
    pub fn is_velocity(&self, name: &str) -> bool {
        matches!(self.roles.get(name), Some(VariableRole::Velocity))
    }

    /// The values that the model gives.
    pub fn initial(&self) -> &BTreeMap<String, f64> {
        &self.initial
    }

    /// Whether the model gives no initial value at all.
    pub fn is_silent(&self) -> bool {
        self.is_silent
    }

    /// Where the values of components come from.
    pub fn origins(&self, names: &[String], given: &BTreeMap<String, f64>) -> Vec<Origin> {
        let origin = |name: &String| match (given.contains_key(name), self.initial.contains_key(name)) {
            (true, _) => Origin::Given,
            (false, true) => Origin::Model,
            (false, false) => Origin::Chosen,
        };
        names.iter().map(origin).collect()
    }

    /// Values without regard to equations. Where a scene has no value at one choice, another `attempt` is another
    /// choice.
    pub fn guess(&self, names: &[String], given: &BTreeMap<String, f64>, attempt: usize) -> Vec<f64> {
        // A fixed sequence of signs and sizes, none equal to another.
        const SIZES: [f64; 7] = [0.8, -0.5, 1.1, 0.6, -0.9, 0.4, -0.7];
        let shift = 0.15 * attempt as f64;
        let (mut n_velocities, mut n_coordinates) = (0, 0);
        let value = |name: &String| {
            if let Some(value) = given.get(name).or_else(|| self.initial.get(name)) {
                return *value;
            }
            if let Some(point) = self.points.get(name) {
                return *point;
            }
            let role = self.roles.get(name);
            match role {
                Some(VariableRole::Bounded { from, to }) if attempt > 0 => {
                    from + (to - from) * (0.5 + shift / 2.0)
                }
                Some(
                    role @ (VariableRole::Bounded { .. } | VariableRole::Group { .. } | VariableRole::Mode),
                ) => neutral(role),
                Some(VariableRole::Unbounded) => {
                    n_coordinates += 1;
                    shift * (1.0 + 0.3 * f64::from(n_coordinates))
                }
                Some(VariableRole::Advected { n: 1, .. }) => shift,
                Some(VariableRole::Advected { index, n }) => unit_vector(*index, *n, attempt),
                Some(VariableRole::Velocity) | None => {
                    let round = n_velocities / SIZES.len();
                    let size = SIZES[n_velocities % SIZES.len()] / (1.0 + 0.37 * round as f64);
                    n_velocities += 1;
                    // Zero, and not minus zero, at the first attempt.
                    if self.is_silent { size + shift } else { size * shift + 0.0 }
                }
            }
        };
        names.iter().map(value).collect()
    }

    /// What became of the components of a state that the user did not give; coordinates of the group begin at its
    /// identity, and modes are off, without a word.
    pub fn told(&self, names: &[String], given: &BTreeMap<String, f64>, state: &[f64]) -> Vec<Told> {
        let mut told = Vec::new();
        for ((name, origin), value) in names.iter().zip(self.origins(names, given)).zip(state) {
            let identity = match self.roles.get(name) {
                Some(VariableRole::Group { identity }) => Some(identity),
                Some(VariableRole::Mode) => Some(&0.0),
                _ => None,
            };
            let (name, value) = (name.clone(), *value);
            match (origin, self.initial.get(&name)) {
                (Origin::Chosen, _) if identity != Some(&value) => told.push(Told::Chosen { name, value }),
                (Origin::Model, Some(from)) if (value - from).abs() > ROUNDING * from.abs().max(1.0) => {
                    told.push(Told::Moved { name, from: *from, to: value });
                }
                (Origin::Given | Origin::Model | Origin::Chosen, _) => {}
            }
        }
        // Velocities that the model gives and the state has not.
        let is_lost = |name: &String| self.is_velocity(name) && !names.contains(name);
        if let Some(dependent) = self.dependent.as_ref().filter(|_| self.initial.keys().any(is_lost)) {
            for (name, to) in dependent.values(names, state) {
                if let Some(from) = self.initial.get(&name)
                    && (to - from).abs() > LINEAR_ROUNDING * from.abs().max(1.0)
                {
                    told.push(Told::Moved { name, from: *from, to });
                }
            }
        }
        told
    }
}

/// The value of a coordinate that nobody gives.
fn neutral(role: &VariableRole) -> f64 {
    match role {
        VariableRole::Bounded { from, to } if *from < 0.0 && 0.0 < *to => 0.0,
        VariableRole::Bounded { from, to } => from + (to - from) / 2.0,
        VariableRole::Group { identity } => *identity,
        VariableRole::Unbounded
        | VariableRole::Velocity
        | VariableRole::Mode
        | VariableRole::Advected { .. } => 0.0,
    }
}

/// A component of a unit vector that is along no axis.
fn unit_vector(index: usize, n: usize, attempt: usize) -> f64 {
    let component = |k: usize| 0.48 + 0.16 * ((k + attempt) % n) as f64 - if k == 0 { 0.12 } else { 0.0 };
    if n == 3 && attempt == 0 {
        return [0.36, 0.48, 0.8][index];
    }
    component(index) / (0..n).map(|k| component(k).powi(2)).sum::<f64>().sqrt()
}

/// The components of a state that equations between coordinates contain.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InPositions {
    /// Those that the equations give.
    pub determined: Vec<usize>,
    /// All of them.
    pub all: Vec<usize>,
}

/// What an initial state has to satisfy.
pub trait Conditions {
    /// Why it cannot.
    type Error;

    /// The components in equations between coordinates; none where nothing restricts the coordinates.
    fn in_positions(&self) -> Option<InPositions>;

    /// Moves the coordinates at `free` until the equations between coordinates hold.
    ///
    /// # Errors
    /// Which equation is not met.
    fn meet_positions(&mut self, y: &mut Vec<f64>, free: &[usize]) -> Result<(), Self::Error>;

    /// Moves the velocities at `free` until the constraints hold.
    ///
    /// # Errors
    /// Which constraint is not met.
    fn meet_constraint(&mut self, y: &mut Vec<f64>, free: &[usize]) -> Result<(), Self::Error>;
}

/// Moves a state onto its conditions, first by what nobody gives, then by what the model gives; `velocities` are the
/// places of the velocities. Who gives everything in an equation finds the state as it was.
///
/// # Errors
/// Of the last attempt, with the state as it was.
pub fn settle<C: Conditions>(
    conditions: &mut C,
    y: &mut Vec<f64>,
    origins: &[Origin],
    velocities: &[usize],
) -> Result<(), C::Error> {
    if let Some(InPositions { determined, all }) = conditions.in_positions() {
        let sets = free_coordinates(origins, &determined, &all);
        first_met(y, &sets, |y, free| conditions.meet_positions(y, free))?;
    }
    first_met(y, &free_velocities(origins, velocities), |y, free| conditions.meet_constraint(y, free))
}

/// Sets of coordinates that are moved onto equations between them, in the order in which they are tried; `determined`
/// are those that the equations give, of `all` in them.
pub fn free_coordinates(origins: &[Origin], determined: &[usize], all: &[usize]) -> Vec<Vec<usize>> {
    // What the equations give follows from the others; where the user gives some of it, the others follow.
    let follows = if determined.iter().all(|k| is_open(origins[*k])) { determined } else { all };
    let sets = [
        among(determined, origins, is_chosen),
        among(all, origins, is_chosen),
        among(follows, origins, is_open),
    ];
    distinct(sets)
}

/// The same of the velocities that are moved onto constraints.
pub fn free_velocities(origins: &[Origin], velocities: &[usize]) -> Vec<Vec<usize>> {
    distinct([among(velocities, origins, is_chosen), among(velocities, origins, is_open)])
}

fn is_chosen(origin: Origin) -> bool {
    origin == Origin::Chosen
}

fn is_open(origin: Origin) -> bool {
    origin != Origin::Given
}

fn among(places: &[usize], origins: &[Origin], is_free: fn(Origin) -> bool) -> Vec<usize> {
    places.iter().copied().filter(|k| is_free(origins[*k])).collect()
}

/// Sets that are not empty, each once.
fn distinct<const N: usize>(sets: [Vec<usize>; N]) -> Vec<Vec<usize>> {
    let mut kept: Vec<Vec<usize>> = Vec::new();
    for set in sets {
        if !set.is_empty() && !kept.contains(&set) {
            kept.push(set);
        }
    }
    kept
}

/// The state by the first of the sets of free components with which it meets what it has to.
fn first_met<E>(
    y: &mut Vec<f64>,
    sets: &[Vec<usize>],
    mut meet: impl FnMut(&mut Vec<f64>, &[usize]) -> Result<(), E>,
) -> Result<(), E> {
    let mut failure = None;
    for free in sets {
        let mut moved = y.clone();
        match meet(&mut moved, free) {
            Ok(()) => {
                *y = moved;
                return Ok(());
            }
            Err(error) => failure = Some(error),
        }
    }
    failure.map_or(Ok(()), Err)
}

/// What became of an initial state in words: `chosen: x = 0, y = 1; moved onto the equations: z from 1 to 1.25`; none
/// where everything is as it was given.
pub fn told_in_words(told: &[Told]) -> Option<String> {
    /// Components that are named one by one.
    const MAX_NAMED: usize = 12;
    let list = |parts: Vec<String>| {
        let more = parts.len().saturating_sub(MAX_NAMED);
        let named = parts[..parts.len() - more].join(", ");
        if more == 0 { named } else { format!("{named} and {more} more") }
    };
    let chosen = told.iter().filter_map(|one| match one {
        Told::Chosen { name, value } => Some(format!("{name} = {:?}", value + 0.0)),
        Told::Moved { .. } => None,
    });
    let moved = told.iter().filter_map(|one| match one {
        Told::Chosen { .. } => None,
        Told::Moved { name, from, to } => Some(format!("{name} from {from:?} to {to:?}")),
    });
    let (chosen, moved): (Vec<String>, Vec<String>) = (chosen.collect(), moved.collect());
    let chosen = (!chosen.is_empty()).then(|| format!("chosen: {}", list(chosen)));
    let moved = (!moved.is_empty()).then(|| format!("moved onto the equations: {}", list(moved)));
    let parts: Vec<String> = chosen.into_iter().chain(moved).collect();
    (!parts.is_empty()).then(|| parts.join("; "))
}

#[cfg(test)]
mod tests {
    use super::unit_vector;

    #[test]
    fn advected_vectors_are_unit_vectors() {
        for n in [2, 3, 5] {
            for attempt in 0..3 {
                let square: f64 = (0..n).map(|k| unit_vector(k, n, attempt).powi(2)).sum();
                assert!((square - 1.0).abs() < 1e-15);
            }
        }
    }
}
