//! What equilibria are told by, at any scalar: the rates of a scene, and what its motions keep.
//!
//! Does not know: which of these have to vanish, how they are solved.

use hamel_codegen::scene::{Executable, Interpreter};
use hamel_codegen::spec::Want;
use hamel_program::program::{Program, Role};
use hamel_runtime::{Dual, Real};
use nalgebra::DMatrix;

use crate::dynamics::Factory as _;
use crate::interpreted::Built;

/// The part of an energy that rounding may change.
const KEPT: f64 = 1e-9;
/// The name of the energy among invariants.
pub(super) const ENERGY: &str = "energy";
/// The name of the energy in a frame that moves with an affine constraint.
pub(super) const MOVING_ENERGY: &str = "moving_energy";

/// A state, with the values of inputs and parameters.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Point<R = f64> {
    pub(super) y: Vec<R>,
    pub(super) inputs: Vec<R>,
    pub(super) params: Vec<R>,
}

impl Point {
    /// The same point over another scalar: `new` makes a number of a value and its place among all.
    fn over<R: Real>(&self, new: impl Fn(f64, usize) -> R) -> Point<R> {
        let (n, m) = (self.y.len(), self.y.len() + self.inputs.len());
        let list = |values: &[f64], first: usize| {
            values.iter().enumerate().map(|(k, x)| new(*x, first + k)).collect::<Vec<R>>()
        };
        Point { y: list(&self.y, 0), inputs: list(&self.inputs, n), params: list(&self.params, m) }
    }
}

/// A number that may be an unknown: a component of the state, an input, or a parameter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Variable {
    State(usize),
    Input(usize),
    Param(usize),
}

impl Point {
    pub(super) fn get(&self, variable: Variable) -> f64 {
        match variable {
            Variable::State(k) => self.y[k],
            Variable::Input(k) => self.inputs[k],
            Variable::Param(k) => self.params[k],
        }
    }

    pub(super) fn set(&mut self, variable: Variable, value: f64) {
        match variable {
            Variable::State(k) => self.y[k] = value,
            Variable::Input(k) => self.inputs[k] = value,
            Variable::Param(k) => self.params[k] = value,
        }
    }

    /// Its place among all numbers one after the other.
    fn place(&self, variable: Variable) -> usize {
        match variable {
            Variable::State(k) => k,
            Variable::Input(k) => self.y.len() + k,
            Variable::Param(k) => self.y.len() + self.inputs.len() + k,
        }
    }
}

/// What a component of the state is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Part {
    Coordinate,
    /// A velocity or a momentum.
    Velocity,
    /// A component of a vector whose norm is kept: advected parameters, points of circles, quaternions.
    Advected,
    /// One while a mode is on, and zero otherwise.
    Mode,
}

/// The functions of a field, one kind after the other.
#[derive(Clone, Debug)]
pub(super) struct Values<R> {
    pub(super) rates: Vec<R>,
    /// The energy, where it is constant along every motion that keeps the constraints.
    pub(super) energy: Vec<R>,
    /// Functions that are constant along every motion.
    pub(super) invariants: Vec<R>,
    /// Equations between coordinates, and behind them what coordinates keep.
    pub(super) positions: Vec<R>,
    /// Constraints that a state can violate.
    pub(super) residuals: Vec<R>,
    pub(super) outputs: Vec<R>,
    /// The functions of [`Field::acting`], and behind them what each of these events sets.
    pub(super) events: Vec<R>,
}

/// An event that changes the state or ends the motion.
#[derive(Clone, Debug)]
pub(super) struct Acting {
    /// Its function, by its place among [`Values::events`].
    pub(super) function: usize,
    /// What it sets: the places in the state, and that of the first value among [`Values::events`].
    pub(super) sets: (Vec<usize>, usize),
    /// Its place among the events of the scene, and the output with what it sets.
    place: usize,
    after: String,
}

impl<R: Real> Values<R> {
    pub(super) fn map<S>(&self, f: impl Fn(R) -> S + Copy) -> Values<S> {
        let list = |values: &[R]| values.iter().map(|x| f(*x)).collect();
        Values {
            rates: list(&self.rates),
            energy: list(&self.energy),
            invariants: list(&self.invariants),
            positions: list(&self.positions),
            residuals: list(&self.residuals),
            outputs: list(&self.outputs),
            events: list(&self.events),
        }
    }

    /// Everything that is kept: energy, invariants, equations between coordinates, constraints.
    pub(super) fn kept(&self) -> impl Iterator<Item = &R> {
        self.energy.iter().chain(&self.invariants).chain(&self.positions).chain(&self.residuals)
    }
}

impl Values<f64> {
    pub(super) fn are_finite(&self) -> bool {
        self.rates.iter().chain(self.kept()).chain(&self.events).all(|x| x.is_finite())
    }
}

/// A scene at one time.
#[derive(Debug)]
pub(super) struct Field<'a> {
    t: f64,
    scene: &'a Executable,
    invariants: Option<&'a Executable>,
    positions: Option<&'a Executable>,
    residuals: Option<&'a Executable>,
    /// Of the scene's outputs: its constraints.
    own_residuals: std::ops::Range<usize>,
    energy: Energy,
    energy_among_invariants: Option<usize>,
    acting: Vec<Acting>,
}

/// Where the energy is that is constant along every motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Energy {
    /// The scene's own.
    Own,
    /// Among the invariants: the scene wants none itself.
    Invariant(usize),
    Nowhere,
}

impl<'a> Field<'a> {
    pub(super) fn new(built: &'a Built, residuals: Option<&'a Built>, t: f64) -> Field<'a> {
        let own = built.info().output_range(Want::Constraint.name());
        let invariants = built.invariants_of_motion();
        let names = invariants.map_or_else(Vec::new, |scene| names(&scene.program, Want::Invariants));
        let among = |wanted: &str| names.iter().position(|name| name == wanted);
        let energy_among_invariants = among(ENERGY).or_else(|| among(MOVING_ENERGY));
        let energy = match (built.info().conserves_energy, energy_among_invariants) {
            (true, _) => Energy::Own,
            (false, Some(k)) => Energy::Invariant(k),
            (false, None) => Energy::Nowhere,
        };
        Field {
            t,
            scene: built.executable(),
            invariants,
            positions: built.equations_between_coordinates(),
            residuals: residuals.map(Built::executable),
            own_residuals: own.unwrap_or(0..0),
            energy,
            energy_among_invariants,
            acting: Vec::new(),
        }
    }

    /// The same with the events that act along its motions.
    #[must_use]
    pub(super) fn with_events(mut self) -> Field<'a> {
        let events = self.scene.events.iter().enumerate();
        let acting: Vec<_> = events.filter(|(_, event)| event.stops || !event.sets.is_empty()).collect();
        let mut first = acting.len();
        for (function, (place, event)) in acting.into_iter().enumerate() {
            let sets = (event.sets.clone(), first);
            first += event.sets.len();
            self.acting.push(Acting { function, sets, place, after: event.after() });
        }
        self
    }

    /// The events that act along its motions.
    pub(super) fn acting(&self) -> &[Acting] {
        &self.acting
    }

    /// Whether events that act at a state leave the energy as it is.
    pub(super) fn energy_is_kept_by_events(&self, at: &Point, values: &Values<f64>) -> bool {
        self.acting.iter().all(|event| {
            let (places, first) = &event.sets;
            let mut after = at.clone();
            places.iter().enumerate().for_each(|(k, place)| after.y[*place] = values.events[first + k]);
            let Some(after) = self.values(&after) else { return false };
            let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= KEPT * (1.0 + a.abs());
            values.energy.iter().zip(&after.energy).all(is_near)
        })
    }

    /// Names of the invariants.
    pub(super) fn invariant_names(&self) -> Vec<String> {
        self.invariants.map_or_else(Vec::new, |scene| names(&scene.program, Want::Invariants))
    }

    /// The place among invariants of the same energy.
    pub(super) fn energy_among_invariants(&self) -> Option<usize> {
        self.energy_among_invariants
    }

    /// Number of the positions that have to vanish.
    pub(super) fn n_equations(&self) -> usize {
        self.positions.and_then(|scene| scene.positions.as_ref()).map_or(0, |layout| layout.n_equations)
    }

    /// All functions at a point; nothing where parameters are not allowed.
    pub(super) fn values<R: Real>(&self, at: &Point<R>) -> Option<Values<R>> {
        let t = R::from_f64(self.t);
        let scene = prepared(self.scene, at)?;
        let mut rates = vec![R::ZERO; at.y.len()];
        scene.rhs(t, &at.y, &mut rates);
        let outputs = scene.outputs(t, &at.y);
        let group = |executable: Option<&'a Executable>, want: Want| match executable {
            Some(executable) => prepared(executable, at)?.output(want.name(), t, &at.y),
            None => Some(Vec::new()),
        };
        let residuals = match self.residuals {
            Some(_) => group(self.residuals, Want::Constraint)?,
            None => outputs[self.own_residuals.clone()].to_vec(),
        };
        let invariants = group(self.invariants, Want::Invariants)?;
        let energy = match self.energy {
            Energy::Own => scene.energy(t, &at.y),
            Energy::Invariant(k) => Some(invariants[k]),
            Energy::Nowhere => None,
        };
        let mut events = Vec::new();
        if !self.acting.is_empty() {
            let functions = scene.events(t, &at.y)?;
            events.extend(self.acting.iter().map(|event| functions[event.place]));
            for event in self.acting.iter().filter(|event| !event.sets.0.is_empty()) {
                events.extend(scene.output(&event.after, t, &at.y)?);
            }
        }
        Some(Values {
            rates,
            energy: energy.into_iter().collect(),
            invariants,
            positions: group(self.positions, Want::Positions)?,
            residuals,
            outputs,
            events,
        })
    }

    /// Their derivatives by some variables, one after the other.
    pub(super) fn derivatives(&self, at: &Point, by: &[Variable]) -> Option<Vec<Values<f64>>> {
        let along = |variable: &Variable| {
            let place = at.place(*variable);
            let moved = at.over(|x, k| if k == place { Dual::variable(x) } else { Dual::constant(x) });
            Some(self.values(&moved)?.map(|x| x.derivative))
        };
        by.iter().map(along).collect()
    }

    /// The matrix of the second derivatives by the state of the sum of all that is kept, with weights.
    pub(super) fn hessian(&self, at: &Point, weights: &[f64]) -> Option<DMatrix<f64>> {
        let n = at.y.len();
        let mut hessian = DMatrix::zeros(n, n);
        for i in 0..n {
            for j in i..n {
                let moved = at.over(|x, k| {
                    let inner = if k == i { Dual::variable(x) } else { Dual::constant(x) };
                    Dual::new(inner, Dual::constant(f64::from(k == j)))
                });
                let found = self.values(&moved)?;
                let terms = found.kept().zip(weights).map(|(x, w)| w * x.derivative.derivative);
                hessian[(i, j)] = terms.sum();
                hessian[(j, i)] = hessian[(i, j)];
            }
        }
        Some(hessian)
    }

    /// Whether the rates read the time, or the events do that act.
    pub(super) fn reads_time(&self) -> bool {
        let program = &self.scene.program;
        let reads = |role: &Role, result: Option<usize>| {
            let Some(function) = program.function(role) else { return false };
            match result {
                Some(k) => function.reads_time(k),
                None => (0..function.results.len()).any(|k| function.reads_time(k)),
            }
        };
        let output = |name: &str| Role::Output(name.to_owned());
        let event = |event: &Acting| {
            reads(&output(Want::Events.name()), Some(event.place)) || reads(&output(&event.after), None)
        };
        reads(&Role::Rate, None) || self.acting.iter().any(event)
    }

    /// Why the rates cannot be believed at a point.
    pub(super) fn check(&self, at: &Point) -> Result<(), String> {
        let Ok(mut scene) = self.scene.prepare(&at.params) else {
            return Err("parameters are not allowed".to_owned());
        };
        if scene.n_inputs() > 0 {
            scene.set_inputs(&at.inputs);
        }
        scene.check(self.t, &at.y).map_err(|pivot| format!("{pivot} vanishes"))?;
        scene.domain(self.t, &at.y).map_err(|condition| format!("{condition} does not hold"))
    }
}

fn prepared<'e, R: Real>(scene: &'e Executable, at: &Point<R>) -> Option<Interpreter<'e, R>> {
    let mut prepared = scene.prepare_over(&at.params).ok()?;
    if prepared.n_inputs() > 0 {
        prepared.set_inputs(&at.inputs);
    }
    Some(prepared)
}

/// Names of the components of an output.
fn names(program: &Program, want: Want) -> Vec<String> {
    let function = program.function(&Role::Output(want.name().to_owned()));
    function.map_or_else(Vec::new, |f| f.results.iter().map(|(name, _)| name.clone()).collect())
}
