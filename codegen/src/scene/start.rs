//! The initial state of a scene: that of its model, completed and moved by the rule of [`super::prior`].
//!
//! Deliberately does not know: what users give, who shows the state.

use std::collections::BTreeMap;
use std::ops::Range;

use hamel_runtime::{Positions, StateVector, System, consistent_by};

use super::built::BuiltScene;
use super::interpreter::{Executable, Interpreter};
use super::nearest::{Outcome, Places, least_change, project};
use super::positions::PositionLayout;
use super::prior::{Conditions, InPositions, Prior, Told, settle};
use super::roles::all_params;
use hamel_expr::error::Error;
use hamel_lang::spec::{Model, Want};
use hamel_program::program::{Program, Role};

/// Most equations, and functions that coordinates in them keep.
const MAX_FUNCTIONS: usize = 64;

/// How often other values are tried when the scene has no value at the first ones.
const N_ATTEMPTS: usize = 4;

/// An initial state of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Start {
    /// The state.
    pub state: Vec<f64>,
    /// What the model does not give, or gives otherwise.
    pub told: Vec<Told>,
}

impl From<Vec<f64>> for Start {
    fn from(state: Vec<f64>) -> Start {
        Start { state, told: Vec::new() }
    }
}

/// The initial state of a scene for its defaults of the parameters: as the model gives it, else zero, on the equations
/// between coordinates and the constraints; momenta by their velocities unless the model gives momenta. None where the
/// scene has no value there, or leaves out a coordinate that it takes to tell.
///
/// # Errors
/// [`Error::NoStart`]; what lowering the equations can find.
pub fn start(model: &Model, scene: &BuiltScene) -> Result<Option<Start>, Error> {
    let by_name = all_params(model, &scene.name, &BTreeMap::new());
    let params: Vec<f64> =
        scene.params().iter().map(|p| by_name.get(&p.name).copied().unwrap_or(f64::NAN)).collect();
    let Ok(interpreter) = scene.prepare(&params) else { return Ok(None) };
    let prior = Prior::of(model, &scene.name, &BTreeMap::new());
    let of_positions = match scene.is_restricted() {
        false => None,
        true if scene.positions().is_some() => Some(scene.executable()),
        true => match scene.with_positions() {
            Err(Error::NoPositions { .. }) => return Ok(None),
            found => Some(found?.executable()),
        },
    };
    let of_constraint = match range_of(&scene.program, Want::Constraint) {
        Some(_) => Some(scene.executable()),
        None => scene.with_residuals()?.map(|found| found.executable()),
    };
    let form = Form::of(scene, &prior);
    let mut conditions = OfScene {
        scene: &interpreter,
        model: &model.name,
        positions: closed(of_positions.as_ref(), &params),
        constraint: of_constraint.as_ref().and_then(|found| {
            let range = range_of(&found.program, Want::Constraint)?;
            Some((found.prepare(&params).ok()?, range))
        }),
        velocities: (0..form.names.len()).filter(|k| prior.is_velocity(&form.names[*k])).collect(),
        form: &form,
    };
    if of_positions.is_some() && conditions.positions.is_none() {
        return Ok(None);
    }
    let none = BTreeMap::new();
    let origins = prior.origins(&form.names, &none);
    let velocities = conditions.velocities.clone();
    let mut failure = None;
    for attempt in 0..N_ATTEMPTS {
        let mut y = prior.guess(&form.names, &none, attempt);
        if let Err(error) = settle(&mut conditions, &mut y, &origins, &velocities) {
            failure = failure.or(Some(error));
            continue;
        }
        if let Some(reason) = prior.refusal(&form.names, &y) {
            failure = failure.or(Some(Missed::Positions(reason)));
            continue;
        }
        let Some(state) = form.own_state(&interpreter, &y) else { continue };
        let mut rates = vec![0.0; state.len()];
        interpreter.rhs(0.0, &state, &mut rates);
        // The last choice is told to have no motion by whoever starts there.
        let is_there = interpreter.check(0.0, &state).is_ok() && rates.iter().all(|rate| rate.is_finite());
        if state.iter().all(|x| x.is_finite()) && (is_there || is_all_given(&prior, &form)) {
            return Ok(Some(Start { told: prior.told(&form.names, &none, &y), state }));
        }
    }
    match failure {
        Some(Missed::Positions(reason)) => Err(Error::NoStart { model: model.name.clone(), reason }),
        Some(Missed::Constraint) | None => Ok(None),
    }
}

/// Whether the model gives every component, so that another attempt is the same.
fn is_all_given(prior: &Prior, form: &Form) -> bool {
    form.names.iter().all(|name| prior.initial().contains_key(name))
}

/// The components that a state is chosen in: velocities in the place of the momenta and of the velocities along levels
/// that the scene carries, but for those that the model gives.
struct Form {
    names: Vec<String>,
    /// Places of what the scene carries in the place of velocities, and whether the model gives it.
    carried: Vec<(usize, bool)>,
}

/// Most steps of Newton's method for velocities with given momenta, and the error that is rounding. Momenta are mostly
/// affine in velocities, so that one step is enough.
const MAX_STEPS: usize = 20;
const ROUNDING: f64 = 1e-14;

impl Form {
    fn of(scene: &BuiltScene, prior: &Prior) -> Form {
        let (legendre, mut names) = (scene.legendre(), scene.state_names());
        let mut carried = Vec::new();
        for ((momentum, _), (velocity, _)) in legendre.momenta.iter().zip(&legendre.velocities) {
            let Some(at) = names.iter().position(|name| name == momentum) else { continue };
            let is_given = prior.initial().contains_key(momentum);
            if !is_given {
                names[at].clone_from(velocity);
            }
            carried.push((at, is_given));
        }
        Form { names, carried }
    }

    /// The state of the scene; none where its momenta do not follow from velocities.
    fn own_state(&self, scene: &Interpreter<'_>, y: &[f64]) -> Option<Vec<f64>> {
        let mut state = y.to_vec();
        if self.carried.iter().all(|(_, is_given)| *is_given) {
            return Some(state);
        }
        // Momenta that are given are those of velocities that have to be found.
        let open: Vec<usize> = (0..self.carried.len()).filter(|k| self.carried[*k].1).collect();
        let mut velocities: Vec<f64> =
            self.carried.iter().map(|(k, is_given)| if *is_given { 0.0 } else { y[*k] }).collect();
        let mut momenta = scene.legendre(0.0, y, &velocities)?;
        for _ in 0..MAX_STEPS {
            let missing: Vec<f64> = open.iter().map(|k| momenta[*k] - y[self.carried[*k].0]).collect();
            let is_met = |(k, left): (&usize, &f64)| left.abs() <= ROUNDING * momenta[*k].abs().max(1.0);
            if open.iter().zip(&missing).all(is_met) {
                break;
            }
            let mut slopes = vec![vec![0.0; open.len()]; open.len()];
            for (column, k) in open.iter().enumerate() {
                let mut moved = velocities.clone();
                moved[*k] += 1.0;
                let moved = scene.legendre(0.0, y, &moved)?;
                open.iter().zip(&mut slopes).for_each(|(k, row)| row[column] = moved[*k] - momenta[*k]);
            }
            let change = least_change(&slopes, &missing, None)?;
            open.iter().zip(change).for_each(|(k, change)| velocities[*k] += change);
            momenta = scene.legendre(0.0, y, &velocities)?;
        }
        for ((at, is_given), momentum) in self.carried.iter().zip(momenta) {
            state[*at] = if *is_given { y[*at] } else { momentum };
        }
        Some(state)
    }
}

/// What a state misses.
enum Missed {
    /// An equation between coordinates, and by how much.
    Positions(String),
    /// A constraint.
    Constraint,
}

/// What the state of a scene has to satisfy.
struct OfScene<'a> {
    scene: &'a Interpreter<'a>,
    model: &'a str,
    positions: Option<Closed<'a>>,
    /// With the places of the residuals among the outputs.
    constraint: Option<(Interpreter<'a>, Range<usize>)>,
    velocities: Vec<usize>,
    form: &'a Form,
}

impl Conditions for OfScene<'_> {
    type Error = Missed;

    fn in_positions(&self) -> Option<InPositions> {
        let closed = self.positions.as_ref()?;
        Some(InPositions { determined: closed.layout.moved.clone(), all: closed.all.clone() })
    }

    fn meet_positions(&mut self, y: &mut Vec<f64>, free: &[usize]) -> Result<(), Missed> {
        let Some(closed) = &self.positions else { return Ok(()) };
        if closed.names.len() > MAX_FUNCTIONS {
            let reason =
                format!("{} has more than {MAX_FUNCTIONS} equations between coordinates", self.model);
            return Err(Missed::Positions(reason));
        }
        let mut state = Numbers(std::mem::take(y));
        let met = consistent_by::<f64, MAX_FUNCTIONS, _>(closed, 0.0, &mut state, free);
        *y = state.0;
        let name = |index: usize| closed.names.get(index).map_or("an equation", String::as_str);
        met.map_err(|error| {
            Missed::Positions(match error {
                hamel_runtime::Error::PositionMissed { index, residual, .. } => {
                    format!("{} is {residual:e} at the nearest coordinates", name(index))
                }
                hamel_runtime::Error::PositionSingular { index, residual, .. } => format!(
                    "{} is {residual:e} at a dead centre, where the coordinates do not change it",
                    name(index)
                ),
                other => other.to_string(),
            })
        })
    }

    fn meet_constraint(&mut self, y: &mut Vec<f64>, free: &[usize]) -> Result<(), Missed> {
        let Some((interpreter, constraint)) = &self.constraint else { return Ok(()) };
        let places =
            Places { constraint: constraint.clone(), velocities: self.velocities.clone(), momenta: None };
        let mut outputs = |states: Vec<Vec<f64>>| -> Result<Vec<Vec<f64>>, Missed> {
            let own = |y: &Vec<f64>| self.form.own_state(self.scene, y).ok_or(Missed::Constraint);
            states.iter().map(|y| Ok(interpreter.outputs(0.0, &own(y)?))).collect()
        };
        match project(&mut outputs, &places, y, free)? {
            Outcome::Met => Ok(()),
            Outcome::Missed { .. } => Err(Missed::Constraint),
        }
    }
}

/// Places of an output of a program among all of them.
fn range_of(program: &Program, want: Want) -> Option<Range<usize>> {
    let mut from = 0;
    for function in &program.functions {
        let Role::Output(name) = &function.role else { continue };
        let to = from + function.results.len();
        if name == want.name() {
            return Some(from..to);
        }
        from = to;
    }
    None
}

/// The equations between coordinates with prepared parameters.
fn closed<'a>(executable: Option<&'a Executable>, params: &[f64]) -> Option<Closed<'a>> {
    let executable = executable?;
    Some(Closed {
        interpreter: executable.prepare(params).ok()?,
        layout: executable.positions.as_ref()?,
        all: executable.components_in_positions(),
        names: executable.position_names(),
    })
}

/// As many numbers as the scene carries.
#[derive(Clone, Debug)]
struct Numbers(Vec<f64>);

impl StateVector<f64> for Numbers {
    fn as_slice(&self) -> &[f64] {
        &self.0
    }

    fn as_mut_slice(&mut self) -> &mut [f64] {
        &mut self.0
    }
}

/// A scene that has its equations between coordinates.
struct Closed<'a> {
    interpreter: Interpreter<'a>,
    layout: &'a PositionLayout,
    /// The components in the equations.
    all: Vec<usize>,
    names: Vec<String>,
}

impl System<f64> for Closed<'_> {
    type State = Numbers;

    fn rhs(&self, t: f64, y: &Numbers, dy: &mut Numbers) {
        self.interpreter.rhs(t, &y.0, &mut dy.0);
    }
}

/// Functions beyond their number are zero wherever the state goes.
impl Positions<f64, MAX_FUNCTIONS> for Closed<'_> {
    fn n_equations(&self) -> usize {
        self.layout.n_equations
    }

    fn moved(&self) -> &[usize] {
        &self.layout.moved
    }

    fn residuals(&self, t: f64, y: &Numbers) -> [f64; MAX_FUNCTIONS] {
        let values = self.interpreter.positions(t, &y.0).unwrap_or_default();
        std::array::from_fn(|k| values.get(k).copied().unwrap_or(0.0))
    }

    fn residual_gradients(&self, t: f64, y: &Numbers, gradients: &mut [Numbers; MAX_FUNCTIONS]) {
        gradients.iter_mut().for_each(|gradient| gradient.0.fill(0.0));
        let rows = self.interpreter.position_gradients(t, &y.0).unwrap_or_default();
        gradients.iter_mut().zip(rows).for_each(|(gradient, row)| gradient.0 = row);
    }
}
