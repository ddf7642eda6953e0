//! What it takes to run a scene, and its program with prepared parameters: run operation by operation, or by another
//! [`Run`].
//!
//! Does not know: how the program was made, which other ways there are to run one.

use std::borrow::Cow;

use hamel_runtime::{Dual, Real};

use crate::error::Error;
use crate::program::{Jet, Point, Program, Role, Run, ViolatedCondition};
use crate::spec::Want;

use super::bracket::REMAINDER;
use super::built::{BuiltScene, legendre_role};
use super::derivatives::{Derivative, Matrix};
use super::events::SceneEvent;
use super::implicit;
use super::invariants::GRADIENTS;
use super::plan::INVARIANTS;

/// What it takes to run a scene: a plain value without equations, which the feature `serde` stores and reads back.
#[derive(Clone, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Executable {
    /// What is run.
    pub program: Program,
    /// The events, whose functions are the output `events`.
    pub events: Vec<SceneEvent>,
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
        self.prepare_on(&self.program, params)
    }

    /// Checks parameters and prepares them for another way to run the program.
    ///
    /// # Errors
    /// The condition that the parameters violate.
    ///
    /// # Panics
    /// When the number of parameters is wrong, or `run` runs another program.
    pub fn prepare_on<'a>(
        &'a self,
        run: &'a dyn Run,
        params: &[f64],
    ) -> Result<Interpreter<'a>, ViolatedCondition> {
        assert_eq!(run.program().functions.len(), self.program.functions.len(), "number of functions");
        Interpreter::new(run, Cow::Borrowed(&self.patterns), params)
    }

    /// Prepares the right-hand side alone, over any scalar.
    ///
    /// # Errors
    /// The condition that the parameters violate.
    ///
    /// # Panics
    /// When the number of parameters is wrong.
    pub fn prepare_rates<R: Real>(&self, params: &[R]) -> Result<Rates<'_, R>, ViolatedCondition> {
        let prepared = self.program.prepare(params)?;
        let function = self.program.function_idx(&Role::Rate);
        Ok(Rates { program: &self.program, function, params: params.to_vec(), prepared })
    }

    /// The recurrence of the Taylor coefficients of solutions.
    ///
    /// # Errors
    /// As [`BuiltScene::jet`].
    pub fn jet(&self) -> Result<Jet, Error> {
        jet_of(&self.program)
    }

    /// Number of invariants of the motion; zero if the scene does not want them.
    pub fn n_invariants(&self) -> usize {
        self.program.function(&Role::Output(INVARIANTS.to_owned())).map_or(0, |f| f.results.len())
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
        Executable { program, events, patterns: self.patterns() }
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

/// The right-hand side of a program with prepared parameters over some scalar.
#[derive(Clone, Debug)]
pub struct Rates<'a, R> {
    program: &'a Program,
    /// None where the scene has no state.
    function: Option<usize>,
    params: Vec<R>,
    prepared: Vec<R>,
}

impl<R: Real> Rates<'_, R> {
    /// Writes the derivative `f(t, y)` to `dy`.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs(&self, t: R, y: &[R], dy: &mut [R]) {
        if let Some(k) = self.function {
            self.program.run(k, &self.params, &self.prepared, t, y, dy);
        }
    }
}

/// A scene's program with prepared parameters, run operation by operation unless another way was asked for.
#[derive(Clone, Debug)]
pub struct Interpreter<'a> {
    run: &'a dyn Run,
    program: &'a Program,
    patterns: Cow<'a, [Pattern]>,
    params: Vec<f64>,
    prepared: Vec<f64>,
}

impl<'a> Interpreter<'a> {
    fn new(
        run: &'a dyn Run,
        patterns: Cow<'a, [Pattern]>,
        params: &[f64],
    ) -> Result<Interpreter<'a>, ViolatedCondition> {
        let program = run.program();
        let prepared = program.prepare(params)?;
        Ok(Interpreter { run, program, patterns, params: params.to_vec(), prepared })
    }

    /// Calls a function of the program at a state.
    fn run(&self, function_idx: usize, t: f64, state: &[f64], out: &mut [f64]) {
        self.run_at(function_idx, Point { t, state, argument: &[] }, out);
    }

    fn run_at(&self, function_idx: usize, point: Point<'_, f64>, out: &mut [f64]) {
        self.run.run_at(function_idx, &self.params, &self.prepared, point, out);
    }

    /// What the parameters were prepared to.
    pub fn prepared(&self) -> &[f64] {
        &self.prepared
    }

    /// The values of a function; none if the program does not have it.
    fn values(&self, role: &Role, t: f64, y: &[f64]) -> Option<Vec<f64>> {
        let k = self.program.function_idx(role)?;
        let mut out = vec![0.0; self.program.functions[k].results.len()];
        self.run(k, t, y, &mut out);
        Some(out)
    }

    fn call(&self, role: &Role, t: f64, y: &[f64], out: &mut [f64]) -> bool {
        let Some(k) = self.program.function_idx(role) else { return false };
        self.run(k, t, y, out);
        true
    }

    /// Time derivative of the state.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs(&self, t: f64, y: &[f64], dy: &mut [f64]) {
        self.call(&Role::Rate, t, y, dy);
    }

    /// Derivatives of [`rhs`](Interpreter::rhs) by the components of the state: row `i` has those of component `i`.
    ///
    /// By dual numbers, so that the scene need not want the Jacobian.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn rhs_jacobian(&self, t: f64, y: &[f64], rows: &mut [&mut [f64]]) {
        let Some(k) = self.program.function_idx(&Role::Rate) else { return };
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

    /// Taylor coefficients of the solution through a state, by the recurrence of [`BuiltScene::jet`].
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn series(&self, jet: &Jet, t: f64, y: &[f64], out: &mut [&mut [f64]]) {
        jet.series(&self.params, &self.prepared, t, y, out);
    }

    /// Energy, when the scene wants it.
    pub fn energy(&self, t: f64, y: &[f64]) -> Option<f64> {
        let values = self.values(&Role::Energy, t, y)?;
        values.first().copied()
    }

    /// All outputs, concatenated.
    pub fn outputs(&self, t: f64, y: &[f64]) -> Vec<f64> {
        let mut all = Vec::new();
        for (k, function) in self.program.functions.iter().enumerate() {
            if let Role::Output(_) = function.role {
                let start = all.len();
                all.resize(start + function.results.len(), 0.0);
                self.run(k, t, y, &mut all[start..]);
            }
        }
        all
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

    /// The functions whose changes of sign are the events of the scene, when it wants them.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn events(&self, t: f64, y: &[f64]) -> Option<Vec<f64>> {
        self.values(&Role::Output(Want::Events.name().to_owned()), t, y)
    }

    /// Changes a state as an event of the scene does: everything that it sets takes its value at the state before.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn apply(&self, event: &SceneEvent, t: f64, y: &mut [f64]) {
        let Some(after) = self.values(&Role::Output(event.after()), t, y) else { return };
        event.sets.iter().zip(after).for_each(|(place, value)| y[*place] = value);
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

    /// The right-hand side `f(t, z)` of the implicit form, when the scene wants it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn implicit(&self, t: f64, z: &[f64]) -> Option<Vec<f64>> {
        self.of_variables(&implicit::right_side(), t, z)
    }

    /// The derivatives `df/dz` of the implicit form, row by row, when the scene wants it.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn implicit_jacobian(&self, t: f64, z: &[f64]) -> Option<Vec<Vec<f64>>> {
        let pattern = self.patterns.iter().find(|pattern| pattern.name == implicit::JACOBIAN)?;
        Some(pattern.filled(&self.of_variables(&implicit::jacobian(), t, z)?))
    }

    /// The values of a function that takes variables in the place of the state.
    fn of_variables(&self, role: &Role, t: f64, z: &[f64]) -> Option<Vec<f64>> {
        let k = self.program.function_idx(role)?;
        let mut out = vec![0.0; self.program.functions[k].results.len()];
        // Such a function reads no state.
        let state = vec![0.0; self.program.state.len()];
        let point = Point { t, state: &state, argument: z };
        self.run_at(k, point, &mut out);
        Some(out)
    }

    /// The momenta that the state carries by the velocities that they stand for, both in the order of
    /// [`BuiltScene::legendre`]; none where it carries none. The momenta in `y` mean nothing.
    ///
    /// # Panics
    /// When a size is wrong.
    pub fn legendre(&self, t: f64, y: &[f64], velocities: &[f64]) -> Option<Vec<f64>> {
        let k = self.program.function_idx(&legendre_role())?;
        let mut out = vec![0.0; self.program.functions[k].results.len()];
        let point = Point { t, state: y, argument: velocities };
        self.run_at(k, point, &mut out);
        Some(out)
    }

    /// Everything that the right-hand side divides by and that may vanish or overflow: names, values, and scales of
    /// their rounding errors, as [`hamel_runtime::Pivot`] has them.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn pivots(&self, t: f64, y: &[f64]) -> Vec<(&str, f64, f64)> {
        let program = self.program;
        let Some(k) = program.function_idx(&Role::Pivots) else { return Vec::new() };
        let results = &program.functions[k].results;
        let mut out = vec![0.0; results.len()];
        self.run(k, t, y, &mut out);
        let (values, scales) = out.split_at(out.len() / 2);
        let names = results.iter().map(|(name, _)| name.as_str());
        names.zip(values).zip(scales).map(|((name, value), scale)| (name, *value, *scale)).collect()
    }

    /// Why the right-hand side cannot be evaluated here.
    ///
    /// # Errors
    /// The name of the pivot that is not finite, that vanishes, or that rounding errors of its terms could hide.
    pub fn check(&self, t: f64, y: &[f64]) -> Result<(), String> {
        let lost = |(_, value, scale): &(&str, f64, f64)| {
            hamel_runtime::Pivot { name: "", value: *value, scale: *scale }.verify(t).is_err()
        };
        self.pivots(t, y).into_iter().find(lost).map_or(Ok(()), |(name, ..)| Err(name.to_owned()))
    }

    /// The number that stays the same along a motion while no matrix becomes singular; zero if none can.
    ///
    /// # Panics
    /// When the size of `y` is wrong.
    pub fn signature(&self, t: f64, y: &[f64]) -> f64 {
        let mut out = [0.0];
        self.call(&Role::Signature, t, y, &mut out);
        out[0]
    }

    /// Whether the coordinates lie in their domain.
    ///
    /// # Errors
    /// The first condition that does not hold, such as `theta > 0`.
    pub fn domain(&self, t: f64, y: &[f64]) -> Result<(), String> {
        let is_inside = |value: &f64| *value > 0.0;
        self.guard(&Role::Domain, t, y, |out| out.iter().position(|value| !is_inside(value)))
    }

    /// The name of the result of a function that does not hold.
    fn guard(
        &self,
        role: &Role,
        t: f64,
        y: &[f64],
        broken: impl Fn(&[f64]) -> Option<usize>,
    ) -> Result<(), String> {
        let Some(k) = self.program.function_idx(role) else { return Ok(()) };
        let results = &self.program.functions[k].results;
        let mut out = vec![0.0; results.len()];
        self.run(k, t, y, &mut out);
        broken(&out).map_or(Ok(()), |k| Err(results[k].0.clone()))
    }
}
