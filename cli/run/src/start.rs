//! Parameters and an initial state for those who do not give all of them, by the rule of
//! [`hamel_codegen::scene::Prior`].
//!
//! Does not know: who evaluates the scene.

use std::collections::BTreeMap;
use std::sync::Arc;

use hamel_codegen::scene::nearest::{Outcome, Places, project};
use hamel_codegen::scene::{Conditions, InPositions, Origin, Prior, Told, settle};
use hamel_codegen::spec::Want;
use hamel_runtime::consistent_by;

use super::admissible;
use super::any_method::MAX_INVARIANTS;
use super::dynamics::{Factory, PreparedScene, VecState};
use super::evaluate::{EvalRequest, eval, prepare};
use super::forms::Forms;
use super::info::Info;
use super::interpreted::{self, Built};
use super::simulation::SimulateRequest;
use crate::error::Error;
use crate::model::{self, Checked};

/// How often other values are tried when the scene has no value at the first ones.
const N_ATTEMPTS: usize = 4;

/// What is known about an initial state.
#[derive(Clone, Copy, Debug)]
pub struct Chosen<'a> {
    /// What the model says.
    pub prior: &'a Prior,
    /// Values that it has to have.
    pub given: &'a BTreeMap<String, f64>,
    /// The scene, where its model has equations between coordinates.
    pub positions: Option<&'a Built>,
}

/// A state of a scene in which `given` components have the given values, and others those of the model, or chosen ones,
/// moved onto the equations between coordinates and the constraint as [`settle`] does; `constraint` answers for the
/// scene's output group of that name. Momenta follow from velocities and the other way round, as `forms` have it: what
/// is chosen is velocities.
///
/// # Errors
/// Why no such state could be found.
pub fn state(
    scene: &dyn Factory,
    constraint: Option<&dyn Factory>,
    params: (&[f64], &[f64]),
    forms: &Forms,
    chosen: Chosen<'_>,
) -> Result<Vec<f64>, Error> {
    let Chosen { prior, given, positions } = chosen;
    let given = &forms.with_points(given).map_err(|reason| Error::unusable("initial", reason))?;
    let n_state = scene.info().state.len();
    let own = forms.own_form();
    // As the model gives it, and as the user does, which is the same wherever it can be.
    let first = forms.with_momenta_of(prior.initial());
    let asked = forms
        .form_among(std::slice::from_ref(&first), given.keys().map(String::as_str))
        .map_err(|reason| Error::unusable("initial", reason))?;
    let (names, asked_names) = (forms.names(&first), forms.names(&asked));
    let of_velocities = forms.names(&forms.velocities());
    let velocities: Vec<usize> = (0..n_state).filter(|k| prior.is_velocity(&of_velocities[*k])).collect();
    let origins = origins(prior, &names, &asked_names, given);
    let prepared = positions.map(|scene| prepare(scene, params.0)).transpose()?;
    if let (Some(scene), Some(prepared)) = (positions, &prepared)
        && prepared.positions().is_none()
        && scene.is_restricted()
        && (0..n_state).any(|k| origins[k] != Origin::Given && !velocities.contains(&k))
    {
        let reason = format!(
            "scene {} leaves out a coordinate that the equations between the others contain: give all others, or take \
             a scene that keeps it",
            scene.info().scene
        );
        return Err(Error::State { path: "initial".into(), reason });
    }
    let attempt = |attempt: usize| -> Result<Vec<f64>, Error> {
        let mut y = prior.guess(&names, given, attempt);
        if first != asked {
            y = forms.convert(params.0, 0.0, &y, [&first, &asked])?;
            for (value, name) in y.iter_mut().zip(&asked_names) {
                *value = given.get(name).copied().unwrap_or(*value);
            }
        }
        let own_state = |y: &[f64]| forms.convert(params.0, 0.0, y, [&asked, &own]);
        let (judge, judged_params) = constraint.map_or((scene, params.0), |other| (other, params.1));
        let mut conditions = OfScene {
            positions: positions.zip(prepared.as_ref()),
            judge,
            params: judged_params,
            own_state: &own_state,
            velocities: &velocities,
        };
        settle(&mut conditions, &mut y, &origins, &velocities)?;
        if let Some(reason) = prior.refusal(&asked_names, &y) {
            return Err(Error::State { path: "initial".into(), reason });
        }
        let y = own_state(&y)?;
        forms.hold(given.iter().map(|(name, value)| (name.as_str(), *value)), &y)?;
        eval(
            scene,
            &EvalRequest {
                params: params.0.to_vec(),
                t: 0.0,
                states: vec![y.clone()],
                ..EvalRequest::default()
            },
        )?;
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
        Error::State { reason, .. } if given.len() < n_state => {
            let reason = format!("{reason}; choose another state with --initial name=value ..");
            Error::State { path: "the default initial state".into(), reason }
        }
        other => other,
    })
}

/// Where the components of a state come from, by the names that the model and the user give them.
pub(super) fn origins(
    prior: &Prior,
    names: &[String],
    asked: &[String],
    given: &BTreeMap<String, f64>,
) -> Vec<Origin> {
    let mut origins = prior.origins(asked, given);
    // A velocity may follow from a momentum that the model gives.
    for (origin, by_model) in origins.iter_mut().zip(prior.origins(names, &BTreeMap::new())) {
        if *origin == Origin::Chosen {
            *origin = by_model;
        }
    }
    origins
}

/// From the components that a state was guessed in to the scene's own.
pub(super) type OwnState<'a> = &'a dyn Fn(&[f64]) -> Result<Vec<f64>, Error>;

/// What a state of a scene has to satisfy.
pub(super) struct OfScene<'a, 'b> {
    pub(super) positions: Option<(&'a Built, &'a PreparedScene<'a>)>,
    /// Has the residuals of the constraint.
    pub(super) judge: &'b dyn Factory,
    pub(super) params: &'a [f64],
    pub(super) own_state: OwnState<'b>,
    /// Places of all velocities.
    pub(super) velocities: &'a [usize],
}

impl Conditions for OfScene<'_, '_> {
    type Error = Error;

    fn in_positions(&self) -> Option<InPositions> {
        let (scene, prepared) = self.positions?;
        let determined = prepared.positions()?.moved.to_vec();
        Some(InPositions { determined, all: scene.components_in_positions() })
    }

    fn meet_positions(&mut self, y: &mut Vec<f64>, free: &[usize]) -> Result<(), Error> {
        let Some((scene, prepared)) = self.positions else { return Ok(()) };
        let mut state = VecState(std::mem::take(y));
        let met = consistent_by::<_, MAX_INVARIANTS, _>(prepared, 0.0, &mut state, free);
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

    fn meet_constraint(&mut self, y: &mut Vec<f64>, free: &[usize]) -> Result<(), Error> {
        let OfScene { judge, params, own_state, velocities, .. } = self;
        let Some(constraint) = judge.info().output_range(Want::Constraint.name()) else { return Ok(()) };
        // Whoever gives no velocity has no metric in mind, and the model's own initial velocities are moved as little
        // as can be.
        let places = Places { constraint, velocities: velocities.to_vec(), momenta: None };
        let mut outputs = |states: Vec<Vec<f64>>| -> Result<Vec<Vec<f64>>, Error> {
            let states = states.iter().map(|y| own_state(y)).collect::<Result<_, Error>>()?;
            Ok(eval(
                *judge,
                &EvalRequest { params: params.to_vec(), t: 0.0, states, ..EvalRequest::default() },
            )?
            .outputs)
        };
        let (index, largest) = match project(&mut outputs, &places, y, free)? {
            Outcome::Met => return Ok(()),
            Outcome::Missed { index, largest } => (index, largest),
        };
        let group = judge.info().outputs.iter().find(|group| group.name == Want::Constraint.name());
        let name = group.and_then(|group| group.components.get(index)).cloned().unwrap_or_default();
        let reason = format!(
            "the constraint is violated by {largest:e} ({name}) and the velocities that were not given cannot meet it: \
             give others"
        );
        Err(Error::State { path: "initial".into(), reason })
    }
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

    /// What became of an initial state beside what the user gave.
    ///
    /// # Errors
    /// As [`Forms::convert`].
    pub fn told(
        &self,
        asked: [&BTreeMap<String, f64>; 2],
        found: (&[f64], &[f64]),
    ) -> Result<Vec<Told>, Error> {
        told(self.model, (self.info, &self.forms), asked, found)
    }

    /// The value of a variable of some form at a state of the scene; none where there is no such variable.
    pub fn value(&self, params: &[f64], y: &[f64], name: &str) -> Result<Option<f64>, Error> {
        self.forms.value(params, y, name)
    }

    /// Parameters with those in `set`, and an initial state with the components in `given`; `scene` is that of the
    /// starts.
    ///
    /// # Errors
    /// As [`state`], and [`Error::Inadmissible`].
    pub fn choose(
        &self,
        scene: &dyn Factory,
        set: &BTreeMap<String, f64>,
        given: &BTreeMap<String, f64>,
    ) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let params: Vec<f64> =
            self.info.params.iter().map(|p| set.get(&p.name).copied().unwrap_or(p.default)).collect();
        let prior = Prior::of(self.model, &self.info.scene, set);
        let other = self.residuals.as_ref().map(|residuals| residuals as &dyn Factory);
        let positions = self.positions.as_ref();
        let chosen = Chosen { prior: &prior, given, positions };
        let initial = state(scene, other, (&params, &params), &self.forms, chosen)?;
        // What the user gave may leave nothing to choose.
        if let Some(scene) = &self.residuals {
            admissible::check(&*prepare(scene, &params)?, &initial, 0)?;
        }
        Ok((params, initial))
    }
}

/// Where a value that varies among starts stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Param(usize),
    State(usize),
}

/// Starts that are the same but for some numbers: no condition moves any of them, and none is converted.
#[derive(Clone, Debug)]
pub struct Alike {
    params: Vec<f64>,
    state: Vec<f64>,
    /// Of the values that vary.
    places: Vec<Place>,
}

impl Alike {
    /// Parameters and state with these values in their places.
    pub fn with(&self, values: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let (mut params, mut state) = (Vec::new(), Vec::new());
        self.write(values, &mut params, &mut state);
        (params, state)
    }

    /// [`with`](Self::with) into vectors that are there.
    pub fn write(&self, values: &[f64], params: &mut Vec<f64>, state: &mut Vec<f64>) {
        params.clone_from(&self.params);
        state.clone_from(&self.state);
        for (place, value) in self.places.iter().zip(values) {
            match place {
                Place::Param(k) => params[*k] = *value,
                Place::State(k) => state[*k] = *value,
            }
        }
    }

    /// The value at a place among parameters and state of a start.
    pub fn value(&self, at: usize, (params, state): &(Vec<f64>, Vec<f64>)) -> f64 {
        match self.places[at] {
            Place::Param(k) => params[k],
            Place::State(k) => state[k],
        }
    }
}

impl Starts<'_> {
    /// The starts that [`Starts::choose`] finds first for these parameters and components, with others of the values
    /// called `names`. There are such where no condition moves a start, where it is given in the scene's own form, and
    /// where no value of the model depends on a parameter that varies.
    pub fn alike(
        &self,
        set: &BTreeMap<String, f64>,
        given: &BTreeMap<String, f64>,
        names: &[String],
    ) -> Option<Alike> {
        let is_met_by_any = self.residuals.is_none()
            && self.positions.is_none()
            && self.info.inputs.is_empty()
            && self.info.output_range(Want::Constraint.name()).is_none();
        if !is_met_by_any {
            return None;
        }
        let own = self.forms.own_form();
        let own_names = self.forms.names(&own);
        let read = Prior::reads(self.model);
        let mut all = given.clone();
        let mut places = Vec::with_capacity(names.len());
        for name in names {
            places.push(match self.info.params.iter().position(|p| p.name == *name) {
                Some(_) if read.contains(name) => return None,
                Some(k) => Place::Param(k),
                None => {
                    all.insert(name.clone(), 0.0);
                    Place::State(own_names.iter().position(|known| known == name)?)
                }
            });
        }
        let prior = Prior::of(self.model, &self.info.scene, set);
        let first = self.forms.with_momenta_of(prior.initial());
        let asked =
            self.forms.form_among(std::slice::from_ref(&first), all.keys().map(String::as_str)).ok()?;
        if first != own || asked != own || self.forms.with_points(&all).ok()? != all {
            return None;
        }
        let params =
            self.info.params.iter().map(|p| set.get(&p.name).copied().unwrap_or(p.default)).collect();
        Some(Alike { params, state: prior.guess(&own_names, &all, 0), places })
    }
}

/// What became of an initial state beside what the user gave, by the names that the state was asked for in.
///
/// # Errors
/// As [`Forms::convert`].
pub fn told(
    model: &Checked,
    (info, forms): (&Info, &Forms),
    [set, given]: [&BTreeMap<String, f64>; 2],
    (params, initial): (&[f64], &[f64]),
) -> Result<Vec<Told>, Error> {
    let prior = Prior::of(model, &info.scene, set);
    let given = &forms.with_points(given).map_err(|reason| Error::unusable("initial", reason))?;
    let first = forms.with_momenta_of(prior.initial());
    let asked = forms.form_among(&[first], given.keys().map(String::as_str)).unwrap_or(forms.own_form());
    let state = forms.convert(params, 0.0, initial, [&forms.own_form(), &asked])?;
    Ok(prior.told(&forms.names(&asked), given, &state))
}

/// Checks that the initial state of a request keeps the constraints, where the scene leaves out what tells that.
///
/// # Errors
/// [`Error::Inadmissible`].
pub fn judge(model: &Arc<Checked>, request: &SimulateRequest, info: &Info) -> Result<(), Error> {
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
