//! Parameters and an initial state for those who do not give all of them: moderate, deterministic, on the constraint.
//!
//! Does not know: who evaluates the scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use hamel_codegen::spec::Want;
use hamel_runtime::consistent_by;

use super::admissible::{self, Outcome, Places, project};
use super::backend::{Backend, Local};
use super::dynamics::{Factory as _, VecState};
use super::evaluate::{EvalRequest, prepare};
use super::forms::Forms;
use super::info::Info;
use super::interpreted::{self, Built};
use super::simulation::SimulateRequest;
use super::solver::MAX_INVARIANTS;
use crate::error::Error;
use crate::model::roles::{self, Role};
use crate::model::{self, Checked};

/// How often other values are tried when the scene has no value at the first ones.
const N_ATTEMPTS: usize = 4;

/// What is known about an initial state.
#[derive(Clone, Copy, Debug)]
pub struct Chosen<'a> {
    /// What the state variables are.
    pub roles: &'a BTreeMap<String, Role>,
    /// Values that the model prefers, in whatever form.
    pub preferred: &'a BTreeMap<String, f64>,
    /// Values that it has to have.
    pub given: &'a BTreeMap<String, f64>,
    /// The scene, where its model has equations between coordinates.
    pub positions: Option<&'a Built>,
}

/// A state of a scene in which `given` components have the given values, and others the `preferred` ones of the model.
///
/// The rest is chosen: velocities get distinct moderate values, coordinates the middle of their interval (others a
/// small value), advected parameters unit vectors. Where the scene keeps velocities that a constraint relates, the ones
/// that were not given are moved by the least amount onto it; `constraint` answers for the scene's output group of that
/// name. Momenta follow from velocities and the other way round, as `forms` have it: what is chosen is velocities.
///
/// # Errors
/// Why no such state could be found.
pub fn state(
    backend: &mut dyn Backend,
    constraint: Option<&mut dyn Backend>,
    params: (&[f64], &[f64]),
    forms: &Forms,
    chosen: Chosen<'_>,
) -> Result<Vec<f64>, Error> {
    let Chosen { roles, preferred, given, positions } = chosen;
    let n_state = backend.info().state.len();
    let mut constraint = constraint;
    let own = forms.own_form();
    // As the model gives it, and as the user does, which is the same wherever it can be.
    let first = forms.with_momenta_of(preferred);
    let asked = forms
        .form_among(std::slice::from_ref(&first), given.keys().map(String::as_str))
        .map_err(|reason| Error::unusable("initial", reason))?;
    let (names, asked_names) = (forms.names(&first), forms.names(&asked));
    let mut start = preferred.clone();
    start.extend(given.iter().map(|(name, value)| (name.clone(), *value)));
    let of_velocities = forms.names(&forms.velocities());
    let is_velocity = |k: &usize| roles.get(&of_velocities[*k]) == Some(&Role::Velocity);
    let velocities: Vec<usize> = (0..n_state).filter(is_velocity).collect();
    let is_free = |k: &usize| !given.contains_key(&asked_names[*k]);
    let free: Vec<usize> = velocities.iter().copied().filter(is_free).collect();
    let mut attempt = |attempt: usize| -> Result<Vec<f64>, Error> {
        let mut y = first_guess(&names, roles, &start, attempt);
        if first != asked {
            y = forms.convert(params.0, 0.0, &y, [&first, &asked])?;
            for (value, name) in y.iter_mut().zip(&asked_names) {
                *value = given.get(name).copied().unwrap_or(*value);
            }
        }
        let own_state = |y: &[f64]| forms.convert(params.0, 0.0, y, [&asked, &own]);
        if let Some(scene) = positions {
            let is_given = |k: usize| given.contains_key(&asked_names[k]);
            let is_place = |k: usize| !matches!(roles.get(&of_velocities[k]), Some(Role::Velocity));
            meet_positions(scene, params.0, &mut y, &is_given, (0..n_state).filter(|k| is_place(*k)))?;
        }
        if !free.is_empty() {
            match &mut constraint {
                Some(other) => {
                    meet_constraint(&mut **other, params.1, &own_state, &mut y, [&velocities, &free])?;
                }
                None => meet_constraint(backend, params.0, &own_state, &mut y, [&velocities, &free])?,
            }
        }
        let y = own_state(&y)?;
        backend.eval(&EvalRequest { params: params.0.to_vec(), t: 0.0, states: vec![y.clone()] })?;
        Ok(y)
    };
    let mut failure = None;
    for k in 0..N_ATTEMPTS {
        match attempt(k) {
            Ok(y) => return Ok(y),
            Err(error) => failure = failure.or(Some(error)),
        }
    }
    // The loop runs at least once.
    Err(match failure.expect("an attempt") {
        Error::State { reason, .. } | Error::Remote { message: reason, .. } if given.len() < n_state => {
            let reason = format!("{reason}; choose another state with --initial name=value ..");
            Error::State { path: "the default initial state".into(), reason }
        }
        other => other,
    })
}

/// Values without regard to the constraint.
fn first_guess(
    names: &[String],
    roles: &BTreeMap<String, Role>,
    start: &BTreeMap<String, f64>,
    attempt: usize,
) -> Vec<f64> {
    // A fixed sequence of signs and sizes, none equal to another.
    const SIZES: [f64; 7] = [0.8, -0.5, 1.1, 0.6, -0.9, 0.4, -0.7];
    let shift = 0.15 * attempt as f64;
    let mut n_velocities = 0;
    let mut n_coordinates = 0;
    let value = |name: &String| {
        if let Some(value) = start.get(name) {
            return *value;
        }
        match roles.get(name) {
            Some(Role::Bounded { from, to }) => from + (to - from) * (0.5 + shift / 2.0),
            // Coordinates of the group start at its identity.
            Some(Role::Group { identity }) => *identity,
            Some(Role::Unbounded) => {
                n_coordinates += 1;
                shift * (1.0 + 0.3 * f64::from(n_coordinates))
            }
            Some(Role::Advected { index, n }) => unit_vector(*index, *n, attempt),
            Some(Role::Velocity) | None => {
                let round = n_velocities / SIZES.len();
                let size = SIZES[n_velocities % SIZES.len()] / (1.0 + 0.37 * round as f64);
                n_velocities += 1;
                size + shift
            }
        }
    };
    names.iter().map(value).collect()
}

/// A component of a unit vector that is along no axis.
fn unit_vector(index: usize, n: usize, attempt: usize) -> f64 {
    let component = |k: usize| 0.48 + 0.16 * ((k + attempt) % n) as f64 - if k == 0 { 0.12 } else { 0.0 };
    if n == 3 && attempt == 0 {
        return [0.36, 0.48, 0.8][index];
    }
    component(index) / (0..n).map(|k| component(k).powi(2)).sum::<f64>().sqrt()
}

/// From the components that a state was guessed in to the scene's own.
type OwnState<'a> = &'a dyn Fn(&[f64]) -> Result<Vec<f64>, Error>;

/// Moves the velocities at positions `free` onto the constraint, by Newton's method with the least change; `velocities`
/// are the positions of all, and `own_state` makes the state of the scene.
fn meet_constraint(
    backend: &mut dyn Backend,
    params: &[f64],
    own_state: OwnState<'_>,
    y: &mut [f64],
    [velocities, free]: [&[usize]; 2],
) -> Result<(), Error> {
    let Some(constraint) = backend.info().output_range(Want::Constraint.name()) else { return Ok(()) };
    // Whoever gives no velocity has no metric in mind, and the model's own initial velocities are moved as little as
    // can be.
    let places = Places { constraint, velocities: velocities.to_vec(), momenta: None };
    let mut outputs = |states: Vec<Vec<f64>>| {
        let states = states.iter().map(|y| own_state(y)).collect::<Result<_, Error>>()?;
        Ok(backend.eval(&EvalRequest { params: params.to_vec(), t: 0.0, states })?.outputs)
    };
    match project(&mut outputs, &places, y, free)? {
        Outcome::Met => Ok(()),
        Outcome::Missed { largest } => {
            let reason = format!(
                "the constraint is violated by {largest:e} and the velocities that were not given cannot meet it: \
                 give others"
            );
            Err(Error::State { path: "initial".into(), reason })
        }
    }
}

/// Moves the coordinates that equations give until they satisfy these; where some of them are given, all others in the
/// equations. The components of `y` are those of the scene but for velocities, which no equation contains; `places` are
/// all others.
fn meet_positions(
    scene: &Built,
    params: &[f64],
    y: &mut Vec<f64>,
    is_given: &dyn Fn(usize) -> bool,
    mut places: impl Iterator<Item = usize>,
) -> Result<(), Error> {
    let dynamics = prepare(scene, params)?;
    let Some(found) = dynamics.positions() else {
        if !scene.is_restricted() || places.all(is_given) {
            return Ok(());
        }
        let reason = format!(
            "scene {} leaves out a coordinate that the equations between the others contain: give all others, or take \
             a scene that keeps it",
            scene.info().scene
        );
        return Err(Error::State { path: "initial".into(), reason });
    };
    let mut free = found.moved.to_vec();
    if free.iter().any(|k| is_given(*k)) {
        free = scene.components_in_positions();
        free.retain(|k| !is_given(*k));
    }
    // Who gives all of them is told what is violated.
    if free.is_empty() {
        return Ok(());
    }
    let mut state = VecState(std::mem::take(y));
    let met = consistent_by::<_, MAX_INVARIANTS, _>(&dynamics, 0.0, &mut state, &free);
    *y = state.0;
    let name = |index: usize| scene.position_names().get(index).cloned().unwrap_or_default();
    let reason = match met {
        Ok(()) => return Ok(()),
        Err(hamel_runtime::Error::PositionMissed { index, residual, .. }) => format!(
            "the equations between coordinates are violated by {residual:e} ({}) and the coordinates that were not \
             given cannot meet them: give others",
            name(index)
        ),
        Err(hamel_runtime::Error::PositionSingular { index, residual, .. }) => format!(
            "the equations between coordinates are violated by {residual:e} ({}), at a dead centre, where the \
             coordinates that were not given do not change that: give others beside it",
            name(index)
        ),
        Err(other) => other.to_string(),
    };
    Err(Error::State { path: "initial".into(), reason })
}

/// Chooses parameters and initial states of a scene.
#[derive(Debug)]
pub struct Starts<'a> {
    model: &'a Arc<Checked>,
    info: &'a Info,
    forms: Forms,
    /// Has the residual of the constraint where the scene itself leaves it out.
    residuals: Option<Built>,
    /// The scene, where the model has equations between coordinates.
    positions: Option<Built>,
}

impl<'a> Starts<'a> {
    /// With the forms of the scene's states.
    ///
    /// # Errors
    /// [`Error::Models`].
    pub fn new(model: &'a Arc<Checked>, info: &'a Info, forms: Forms) -> Result<Starts<'a>, Error> {
        let positions =
            model::has_positions(model).then(|| interpreted::build(model, &info.scene)).transpose()?;
        Ok(Starts { model, info, forms, residuals: residuals(model, info)?, positions })
    }

    /// The value of a variable of some form at a state of the scene; none where there is no such variable.
    pub(crate) fn value(&self, params: &[f64], y: &[f64], name: &str) -> Result<Option<f64>, Error> {
        self.forms.value(params, y, name)
    }

    /// Parameters with those in `set`, and an initial state with the components in `given`; `backend` is that of the
    /// scene.
    ///
    /// # Errors
    /// As [`state`], and [`Error::Inadmissible`].
    pub fn choose(
        &self,
        backend: &mut dyn Backend,
        set: &BTreeMap<String, f64>,
        given: &BTreeMap<String, f64>,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let params: Vec<f64> =
            self.info.params.iter().map(|p| set.get(&p.name).copied().unwrap_or(p.default)).collect();
        let all_params = roles::all_params(self.model, &self.info.scene, set);
        let roles = roles::roles(self.model, &all_params);
        let preferred = roles::initial_values(self.model, &all_params);
        let mut other = self.residuals.as_ref().map(Local::new);
        let other = other.as_mut().map(|local| local as &mut dyn Backend);
        let positions = self.positions.as_ref();
        let chosen = Chosen { roles: &roles, preferred: &preferred, given, positions };
        let initial = state(backend, other, (&params, &params), &self.forms, chosen)?;
        // What the user gave may leave nothing to choose.
        if let Some(scene) = &self.residuals {
            admissible::check(&*prepare(scene, &params)?, &initial, 0)?;
        }
        Ok((params, initial))
    }
}

/// Checks that the initial state of a request keeps the constraints, where the scene leaves out what tells that.
///
/// # Errors
/// [`Error::Inadmissible`].
pub(crate) fn judge(model: &Arc<Checked>, request: &SimulateRequest, info: &Info) -> Result<(), Error> {
    if let Some(scene) = residuals(model, info)? {
        admissible::check(&*prepare(&scene, &request.params)?, &request.initial, request.n_group)?;
    }
    Ok(())
}

/// The scene with the residuals of constraints that a state can violate, unless it has them itself; none if there are
/// none.
fn residuals(model: &Arc<Checked>, info: &Info) -> Result<Option<Built>, Error> {
    if admissible::is_judged_by(info) || !model.hides_residuals(&info.scene)? {
        return Ok(None);
    }
    Ok(interpreted::build(model, &info.scene)?.with_residuals())
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
