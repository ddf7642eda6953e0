//! What it takes to run a scene, and its program with prepared parameters: run operation by operation, or by another
//! [`Run`].
//!
//! Does not know: how the program was made, which other ways there are to run one.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::ops::ControlFlow;

use hamel_runtime::{Dual, Real};

use hamel_expr::error::Error;
use hamel_lang::spec::{EventDirection, Want};
use hamel_program::program::{Circles, Jet, Point, Program, Role, Run, ViolatedCondition, verify_rules};

use super::bracket::REMAINDER;
use super::built::BuiltScene;
use super::derivatives::{Derivative, Matrix};
use super::discrete::{self, DiscreteLayout};
use super::events::SceneEvent;
use super::implicit;
use super::invariants::GRADIENTS;
use super::places::{Places, with_space};
use super::plan::INVARIANTS;
use super::positions::{self, PositionLayout};

mod series;
mod vectors;

/// Most entries of a matrix that is read back: a gigabyte of numbers.
const MAX_ENTRIES: usize = 1 << 27;

/// What it takes to run a scene: a plain value without equations, which the feature `serde` stores and reads back.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Executable {
    /// What is run.
    pub program: Program,
    /// The events, whose functions are the output `events`.
    pub events: Vec<SceneEvent>,
    /// Positions in the state of modes, which are zero or one.
    pub modes: Vec<usize>,
    /// How the equations between coordinates are solved, where the scene wants them.
    pub positions: Option<PositionLayout>,
    /// Unknowns of the discrete equations, where the scene has these.
    pub discrete: Option<DiscreteLayout>,
    patterns: Vec<Pattern>,
}

/// Where the entries of an output that is a matrix are: rows and columns in the order of its results.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Pattern {
    name: String,
    shape: (usize, usize),
    places: Vec<(usize, usize)>,
    is_antisymmetric: bool,
}

impl Pattern {
    fn of(matrix: &Matrix) -> Pattern {
        let (places, is_antisymmetric) = (matrix.pattern.clone(), matrix.is_antisymmetric);
        Pattern { name: matrix.name.to_owned(), shape: matrix.shape, places, is_antisymmetric }
    }

    /// The matrix with these entries, row by row.
    fn filled(&self, entries: &[f64]) -> Vec<Vec<f64>> {
        let (n_rows, n_columns) = self.shape;
        let mut rows = vec![vec![0.0; n_columns]; n_rows];
        for ((i, j), entry) in self.places.iter().zip(entries) {
            rows[*i][*j] = *entry;
            if self.is_antisymmetric {
                rows[*j][*i] = -*entry;
            }
        }
        rows
    }
}

impl Executable {
    /// Checks parameters and prepares an interpreter for them.
    ///
    /// # Errors
    /// The condition that the parameters violate.
    ///
    /// # Panics
    /// When the number of parameters is wrong.
    pub fn prepare(&self, params: &[f64]) -> Result<Interpreter<'_>, ViolatedCondition> {
        self.prepare_over(params)
    }

    /// The same over any scalar: with dual numbers for the parameters, everything has its derivatives along them.
    ///
    /// # Errors
    /// The condition that the parameters violate.
    ///
    /// # Panics
    /// When the number of parameters is wrong.
    pub fn prepare_over<R: Real>(&self, params: &[R]) -> Result<Interpreter<'_, R>, ViolatedCondition> {
        self.prepare_on(&self.program, params)
    }

    /// Checks parameters and prepares them for another way to run the program.
    ///
    /// # Errors
    /// The condition that the parameters violate.
    ///
    /// # Panics
    /// When the number of parameters is wrong, or `run` runs another program.
    pub fn prepare_on<'a, R: Real>(
        &'a self,
        run: &'a dyn Run<R>,
        params: &[R],
    ) -> Result<Interpreter<'a, R>, ViolatedCondition> {
        assert_eq!(run.program().functions.len(), self.program.functions.len(), "number of functions");
        Interpreter::new(run, Cow::Borrowed(&self.patterns), params)
    }

    /// Rows and columns of a derivative that is a matrix, when the scene wants it.
    pub fn matrix_size(&self, derivative: Derivative) -> Option<(usize, usize)> {
        self.patterns.iter().find(|pattern| pattern.name == derivative.name()).map(|pattern| pattern.shape)
    }

    /// Checks the rules of the program, and that every part has the size with which it is read: what holds for a value
    /// that was built, and has to be asked of one that was stored.
    ///
    /// # Errors
    /// [`Error::Program`] with the first rule that is broken; [`Error::OutOfRange`].
    pub fn verify(&self) -> Result<(), Error> {
        verify_rules(&self.program)?;
        let fail = |reason: String| Err(Error::Program { reason });
        let (program, n) = (&self.program, self.program.state.len());
        for (k, function) in program.functions.iter().enumerate() {
            let (n_results, n_argument) = (function.results.len(), function.argument.len());
            let fits = match &function.role {
                Role::Rate => n_results == n && n_argument == 0,
                Role::Energy | Role::Signature => n_results == 1 && n_argument == 0,
                Role::Pivots => n_results.is_multiple_of(2) && n_argument == 0,
                Role::Domain | Role::Output(_) => n_argument == 0,
                Role::Flow(_) => n_results == n && n_argument == 1,
                Role::Product(_) | Role::OfVariables(_) => true,
                // Functions of programs that are made from this one.
                Role::Points | Role::SeriesStart | Role::SeriesStep => false,
            };
            if !fits || program.functions[..k].iter().any(|other| other.role == function.role) {
                return fail(format!("{} is no such function of a scene", function.role));
            }
        }
        let n_of = |role: &Role| program.function(role).map(|f| f.results.len());
        for Pattern { name, shape: (n_rows, n_columns), places, is_antisymmetric } in &self.patterns {
            let is_inside = |(i, j): &(usize, usize)| i < n_rows && j < n_columns;
            let n_entries =
                [Role::Output(name.clone()), Role::OfVariables(name.clone())].iter().find_map(n_of);
            let fits = n_rows.checked_mul(*n_columns).is_some_and(|size| size <= MAX_ENTRIES)
                && places.iter().all(is_inside)
                && (!is_antisymmetric || n_rows == n_columns)
                && n_entries.unwrap_or(0) == places.len();
            if !fits {
                return fail(format!("the pattern of {name} is no such matrix"));
            }
        }
        let are_gradients = |name: &str, n_functions: usize| {
            let pattern = self.patterns.iter().find(|pattern| pattern.name == name);
            pattern.map_or(n_functions == 0, |pattern| pattern.shape == (n_functions, n))
        };
        let n_positions = n_of(&Role::Output(Want::Positions.name().to_owned())).unwrap_or(0);
        if !are_gradients(GRADIENTS, self.n_invariants()) || !are_gradients(positions::GRADIENTS, n_positions)
        {
            return fail("gradients of another number of functions or components".into());
        }
        if let Some(PositionLayout { n_equations, moved }) = &self.positions
            && (*n_equations > n_positions || moved.iter().any(|place| *place >= n))
        {
            return fail("equations between coordinates that the scene does not have".into());
        }
        if let Some(layout) = &self.discrete
            && !layout.fits(discrete::roles().map(|role| program.function(&role)), n)
        {
            return fail("discrete equations that the scene does not have".into());
        }
        let n_events = n_of(&Role::Output(Want::Events.name().to_owned())).unwrap_or(0);
        let sets = |event: &SceneEvent| {
            let n_set = n_of(&Role::Output(event.after())).unwrap_or(0);
            n_set == event.sets.len() && event.sets.iter().all(|place| *place < n)
        };
        if n_events != self.events.len() || !self.events.iter().all(sets) {
            return fail("events that the scene does not have".into());
        }
        Ok(())
    }

    /// The recurrence of the Taylor coefficients of solutions.
    ///
    /// # Errors
    /// As [`BuiltScene::jet`].
    pub fn jet(&self) -> Result<Jet, Error> {
        jet_of(&self.program)
    }

    /// Number of exact flows; zero if the scene does not want them.
    pub fn n_flows(&self) -> usize {
        self.program.functions.iter().filter(|f| matches!(f.role, Role::Flow(_))).count()
    }

    /// The right-hand side with angles as points of circles, where it costs less.
    pub fn circles(&self) -> Option<Circles> {
        Circles::of(&self.program)
    }

    /// Number of invariants of the motion; zero if the scene does not want them.
    pub fn n_invariants(&self) -> usize {
        self.program.function(&Role::Output(INVARIANTS.to_owned())).map_or(0, |f| f.results.len())
    }

    /// The components of the state that the equations between coordinates contain; empty if the scene does not want
    /// them.
    pub fn components_in_positions(&self) -> Vec<usize> {
        let pattern = self.patterns.iter().find(|pattern| pattern.name == positions::GRADIENTS);
        let columns: BTreeSet<usize> = pattern.iter().flat_map(|p| &p.places).map(|(_, j)| *j).collect();
        columns.into_iter().collect()
    }

    /// Names of the residuals of the equations between coordinates, and of what coordinates keep beside them; empty if
    /// the scene does not want them.
    pub fn position_names(&self) -> Vec<String> {
        let function = self.program.function(&Role::Output(Want::Positions.name().to_owned()));
        function.map_or_else(Vec::new, |f| f.results.iter().map(|(name, _)| name.clone()).collect())
    }
}

/// The recurrence of the Taylor coefficients of the solutions of a program's right-hand side.
pub(super) fn jet_of(program: &Program) -> Result<Jet, Error> {
    let known = || program.functions.iter().map(|f| f.role.name().to_owned()).collect();
    let rhs = program.function_idx(&Role::Rate).ok_or_else(|| Error::UnknownName {
        name: Role::Rate.name().to_owned(),
        kind: "function of the program",
        known: known(),
    })?;
    Jet::new(program, rhs)
}

impl BuiltScene {
    /// What it takes to run the scene.
    pub fn executable(&self) -> Executable {
        let (program, events) = (self.program.clone(), self.events().to_vec());
        let system = &self.equations.system;
        let modes =
            system.own_rates.iter().filter(|own| own.is_mode).map(|own| system.graph.name(own.symbol));
        let modes = modes.filter_map(|name| program.state.iter().position(|own| own == name)).collect();
        let (positions, patterns) = (self.positions().cloned(), self.patterns());
        let discrete = self.discrete().map(|found| DiscreteLayout {
            n_unknowns: found.unknowns.len(),
            pattern: found.pattern.clone(),
            state: found.state.clone(),
        });
        Executable { program, events, modes, positions, discrete, patterns }
    }

    fn patterns(&self) -> Vec<Pattern> {
        let implicit = self.implicit().map(|found| Pattern {
            name: implicit::JACOBIAN.to_owned(),
            shape: (found.variables.len(), found.variables.len()),
            places: found.pattern.clone(),
            is_antisymmetric: false,
        });
        self.matrices().iter().map(Pattern::of).chain(implicit).collect()
    }

    /// Checks parameters and prepares an interpreter for them.
    ///
    /// # Errors
    /// The condition that the parameters violate.
    ///
    /// # Panics
    /// When the number of parameters is wrong.
    pub fn prepare(&self, params: &[f64]) -> Result<Interpreter<'_>, ViolatedCondition> {
        Interpreter::new(&self.program, Cow::Owned(self.patterns()), params)
    }
}

/// A scene's program with prepared parameters, run operation by operation unless another way was asked for.
#[derive(Clone, Debug)]
pub struct Interpreter<'a, R = f64> {
    run: &'a dyn Run<R>,
    program: &'a Program,
    patterns: Cow<'a, [Pattern]>,
    params: Vec<R>,
    prepared: Vec<R>,
    places: Places,
}

impl<'a, R: Real> Interpreter<'a, R> {
    fn new(
        run: &'a dyn Run<R>,
        patterns: Cow<'a, [Pattern]>,
        params: &[R],
    ) -> Result<Interpreter<'a, R>, ViolatedCondition> {
        let program = run.program();
        let prepared = run.prepare(params)?;
        let places = Places::of(program);
        Ok(Interpreter { run, program, patterns, params: params.to_vec(), prepared, places })
    }

    /// The same for other parameters, with inputs at their defaults; allocates nothing where the program is compiled.
    ///
    /// # Errors
    /// The condition that the parameters violate; the interpreter is then to be prepared again before it is used.
    ///
    /// # Panics
    /// When the number of parameters is wrong.
    pub fn prepare_again(&mut self, params: &[R]) -> Result<(), ViolatedCondition> {
        self.run.prepare_into(params, &mut self.prepared)?;
        self.params.copy_from_slice(params);
        Ok(())
    }

    /// Number of the parameters.
    pub fn n_params(&self) -> usize {
        self.params.len()
    }

    /// The parameters, and the prepared numbers with the inputs behind them, as functions of the program take both.
    pub fn values_of_functions(&self) -> (&[R], &[R]) {
        (&self.params, &self.prepared)
    }

    /// Number of the inputs that the scene takes.
    pub fn n_inputs(&self) -> usize {
        self.program.inputs.len()
    }

    /// The values that the inputs are held at: their defaults, unless others were set.
    pub fn inputs(&self) -> &[R] {
        &self.prepared[self.program.prepare.slots.len()..]
    }

    /// Holds the inputs at other values, from here on and in every function.
    ///
    /// # Shapes
    /// values: \[n_inputs\].
    ///
    /// # Panics
    /// When the size is wrong.
    pub fn set_inputs(&mut self, values: &[R]) {
        self.prepared[self.program.prepare.slots.len()..].copy_from_slice(values);
    }

    /// Time derivative of the state at values of the inputs, whatever they are held at.
    ///
    /// # Shapes
    /// inputs: \[n_inputs\].
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs_with(&self, t: R, y: &[R], inputs: &[R], dy: &mut [R]) {
        let Some(k) = self.places.rate else { return };
        let mut prepared = self.prepared.clone();
        prepared[self.program.prepare.slots.len()..].copy_from_slice(inputs);
        self.run.run_at(k, &self.params, &prepared, Point { t, state: y, argument: &[] }, dy);
    }

    /// Calls a function of the program at a state.
    fn run(&self, function_idx: usize, t: R, state: &[R], out: &mut [R]) {
        self.run_at(function_idx, Point { t, state, argument: &[] }, out);
    }

    fn run_at(&self, function_idx: usize, point: Point<'_, R>, out: &mut [R]) {
        self.run.run_at(function_idx, &self.params, &self.prepared, point, out);
    }

    /// The values of a function; none if the program does not have it.
    fn values(&self, role: &Role, t: R, y: &[R]) -> Option<Vec<R>> {
        let k = self.program.function_idx(role)?;
        let mut out = vec![R::ZERO; self.program.functions[k].results.len()];
        self.run(k, t, y, &mut out);
        Some(out)
    }

    /// Time derivative of the state.
    ///
    /// # Panics
    /// When a size is wrong.
    #[inline]
    pub fn rhs(&self, t: R, y: &[R], dy: &mut [R]) {
        if let Some(k) = self.places.rate {
            self.run(k, t, y, dy);
        }
    }

    /// Energy, when the scene wants it.
    pub fn energy(&self, t: R, y: &[R]) -> Option<R> {
        let mut out = [R::ZERO];
        self.run(self.places.energy?, t, y, &mut out);
        Some(out[0])
    }

    /// All outputs, concatenated.
    pub fn outputs(&self, t: R, y: &[R]) -> Vec<R> {
        let mut all = Vec::new();
        self.write_outputs(t, y, &mut all);
        all
    }

    /// [`outputs`](Self::outputs) in the place of what a vector has.
    pub fn write_outputs(&self, t: R, y: &[R], all: &mut Vec<R>) {
        all.clear();
        for (k, function) in self.program.functions.iter().enumerate() {
            if let Role::Output(_) = function.role {
                let start = all.len();
                all.resize(start + function.results.len(), R::ZERO);
                self.run(k, t, y, &mut all[start..]);
            }
        }
    }

    /// The components of one output, if the scene has it.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn output(&self, name: &str, t: R, y: &[R]) -> Option<Vec<R>> {
        self.values(&Role::Output(name.to_owned()), t, y)
    }

    /// The functions whose changes of sign are the events of the scene, when it wants them.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn events(&self, t: R, y: &[R]) -> Option<Vec<R>> {
        self.values(&Role::Output(Want::Events.name().to_owned()), t, y)
    }

    /// Carries out an event of a scene, by its position among `events`, and behind it every condition that the one
    /// before has made true, each once: puts the values that they set into a state. Gives their positions in their
    /// order.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn apply(&self, events: &[SceneEvent], index: usize, t: R, y: &mut [R]) -> Vec<usize> {
        let is_condition = |event: &SceneEvent| event.direction == EventDirection::Below;
        let conditions: Vec<usize> = (0..events.len()).filter(|k| is_condition(&events[*k])).collect();
        let mut done = Vec::new();
        let mut next = Some(index);
        while let Some(event) = next {
            done.push(event);
            let before = if conditions.is_empty() { None } else { self.events(t, y) };
            self.set(&events[event], t, y);
            next = before.zip(self.events(t, y).filter(|_| !conditions.is_empty())).and_then(
                |(before, after)| {
                    let begins = |k: &&usize| before[**k].all_ge(R::ZERO) && R::ZERO.all_gt(after[**k]);
                    conditions.iter().filter(|k| !done.contains(k)).find(begins).copied()
                },
            );
        }
        done
    }

    fn set(&self, event: &SceneEvent, t: R, y: &mut [R]) {
        let Some(after) = self.values(&Role::Output(event.after()), t, y) else { return };
        event.sets.iter().zip(after).for_each(|(place, value)| y[*place] = value);
    }

    /// Residuals of the equations between coordinates, and behind them what coordinates keep, when the scene wants
    /// them.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn positions(&self, t: R, y: &[R]) -> Option<Vec<R>> {
        self.values(&Role::Output(Want::Positions.name().to_owned()), t, y)
    }

    /// All of what [`visit_pivots`](Self::visit_pivots) tells.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn pivots(&self, t: R, y: &[R]) -> Vec<(&'a str, R, R)> {
        let mut all = Vec::new();
        let _ = self.visit_pivots(t, y, |pivot| {
            all.push(pivot);
            ControlFlow::<()>::Continue(())
        });
        all
    }

    /// Tells everything that the right-hand side divides by and that may vanish or overflow: names, values, and scales
    /// of their rounding errors, as [`hamel_runtime::Pivot`] has them; stops at what `visit` breaks with.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn visit_pivots<B>(
        &self,
        t: R,
        y: &[R],
        mut visit: impl FnMut((&'a str, R, R)) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let program = self.program;
        let Some(k) = self.places.pivots else { return ControlFlow::Continue(()) };
        let results = &program.functions[k].results;
        with_space(results.len(), |out: &mut [R]| {
            self.run(k, t, y, out);
            let (values, scales) = out.split_at(out.len() / 2);
            let names = results.iter().map(|(name, _)| name.as_str());
            let mut pivots = names.zip(values).zip(scales);
            pivots.try_for_each(|((name, value), scale)| visit((name, *value, *scale)))
        })
    }

    /// Why the right-hand side cannot be evaluated here.
    ///
    /// # Errors
    /// The name of the pivot that is not finite, that vanishes, or that rounding errors of its terms could hide.
    pub fn check(&self, t: R, y: &[R]) -> Result<(), String> {
        let found = self.visit_pivots(t, y, |(name, value, scale)| {
            match (hamel_runtime::Pivot { name: "", value, scale }).verify(t) {
                Ok(()) => ControlFlow::Continue(()),
                Err(_) => ControlFlow::Break(name.to_owned()),
            }
        });
        found.break_value().map_or(Ok(()), Err)
    }

    /// The number that stays the same along a motion while no matrix becomes singular; zero if none can.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn signature(&self, t: R, y: &[R]) -> R {
        let mut out = [R::ZERO];
        if let Some(k) = self.places.signature {
            self.run(k, t, y, &mut out);
        }
        out[0]
    }

    /// Whether the coordinates lie in their domain.
    ///
    /// # Errors
    /// The first condition that does not hold, such as `theta > 0`.
    pub fn domain(&self, t: R, y: &[R]) -> Result<(), String> {
        let Some(k) = self.places.domain else { return Ok(()) };
        let results = &self.program.functions[k].results;
        with_space(results.len(), |out: &mut [R]| {
            self.run(k, t, y, out);
            let outside = out.iter().position(|value| !value.all_gt(R::ZERO));
            outside.map_or(Ok(()), |k| Err(results[k].0.clone()))
        })
    }
}

impl<R: Real> Interpreter<'_, R> {
    /// Derivative of a state with cosines and sines of the angles of [`Executable::circles`] behind it, where `run`
    /// runs the program of the circles.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs_on_circles_by(&self, run: &dyn Run<R>, t: R, z: &[R], dz: &mut [R]) {
        let point = Point { t, state: z, argument: &[] };
        run.run_at(Circles::RATE, &self.params, &self.prepared, point, dz);
    }
}

impl Interpreter<'_> {
    /// Derivatives of [`rhs`](Interpreter::rhs) by the components of the state: row `i` has those of component `i`.
    ///
    /// By dual numbers, so that the scene need not want the Jacobian.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs_jacobian(&self, t: f64, y: &[f64], rows: &mut [&mut [f64]]) {
        let Some(k) = self.places.rate else { return };
        let constants = |values: &[f64]| values.iter().copied().map(Dual::constant).collect::<Vec<Dual>>();
        let (params, prepared) = (constants(&self.params), constants(&self.prepared));
        let (mut state, mut out) = (constants(y), constants(y));
        for column in 0..y.len() {
            state[column] = Dual::variable(y[column]);
            self.program.run(k, &params, &prepared, Dual::constant(t), &state, &mut out);
            state[column] = Dual::constant(y[column]);
            rows.iter_mut().zip(&out).for_each(|(row, value)| row[column] = value.derivative);
        }
    }

    /// The state with cosines and sines of the angles of [`Executable::circles`] behind it.
    ///
    /// # Shapes
    /// y: \[n_state\], z: \[n_state + 2 n_angles\].
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn on_circles(&self, circles: &Circles, y: &[f64], z: &mut [f64]) {
        self.on_circles_by(&circles.program, circles, y, z);
    }

    /// The same, where `run` runs the program of the circles.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn on_circles_by(&self, run: &dyn Run<f64>, circles: &Circles, y: &[f64], z: &mut [f64]) {
        let n = circles.n_state;
        z[..n].copy_from_slice(y);
        let mut points = vec![0.0; 2 * circles.n_angles];
        let point = Point { t: 0.0, state: z, argument: &[] };
        run.run_at(Circles::POINTS, &self.params, &self.prepared, point, &mut points);
        z[n..].copy_from_slice(&points);
    }

    /// Derivative of such a state.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs_on_circles(&self, circles: &Circles, t: f64, z: &[f64], dz: &mut [f64]) {
        self.rhs_on_circles_by(&circles.program, t, z, dz);
    }

    /// A derivative that is a matrix, row by row, when the scene wants it.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn matrix(&self, derivative: Derivative, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(derivative.name(), t, y)
    }

    /// Invariants of the motion, when the scene wants them, in the order of its output `invariants`.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn invariants(&self, t: f64, y: &[f64]) -> Option<Vec<f64>> {
        self.values(&Role::Output(INVARIANTS.to_owned()), t, y)
    }

    /// Their gradients, a row for each.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn invariant_gradients(&self, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(GRADIENTS, t, y)
    }

    /// Their gradients, a row for each.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn position_gradients(&self, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(positions::GRADIENTS, t, y)
    }

    /// The matrix `Pi` of the nonholonomic bracket, `y' = Pi dE + R`, when the scene wants it.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn bracket(&self, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(Want::Bracket.name(), t, y)
    }

    /// The vector `R` of `y' = Pi dE + R`, when the scene wants its bracket; none where it vanishes.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn bracket_remainder(&self, t: f64, y: &[f64]) -> Option<Vec<f64>> {
        self.values(&Role::Output(REMAINDER.to_owned()), t, y)
    }

    /// A matrix that scenes want, such as the mass matrix or the Jacobians of frames, row by row, when this one does.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn matrix_of(&self, want: Want, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        self.matrix_named(want.name(), t, y)
    }

    fn matrix_named(&self, name: &str, t: f64, y: &[f64]) -> Option<Vec<Vec<f64>>> {
        let pattern = self.patterns.iter().find(|pattern| pattern.name == name)?;
        // Every matrix is an output, and one without entries has no function.
        let entries = self.values(&Role::Output(name.to_owned()), t, y).unwrap_or_default();
        Some(pattern.filled(&entries))
    }

    /// A derivative that is a product with `vector`, when the scene wants it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn product(&self, derivative: Derivative, t: f64, y: &[f64], vector: &[f64]) -> Option<Vec<f64>> {
        let k = self.program.function_idx(&derivative.role())?;
        let mut out = vec![0.0; self.program.functions[k].results.len()];
        let point = Point { t, state: y, argument: vector };
        self.run_at(k, point, &mut out);
        Some(out)
    }
}
