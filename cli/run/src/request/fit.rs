//! A fit as it is asked for, by names and a table, and its answer as JSON.
//!
//! Options of the command line and arguments of a function come here; messages have the words of the former.
//!
//! Does not know: how unknowns are searched, how a table is read.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use hamel_codegen::spec::Unit;
use serde_json::{Map, Value};

use super::json::{by_name, number};
use super::table::Table;
use crate::asked::{self, Words, assignments};
use crate::direction::Direction;
use crate::dynamics::Factory as _;
use crate::error::{Error, Problem};
use crate::fit::{self, Column, FitRequest, FitResponse, Follows, Known, Prior, Quantity, Watch};
use crate::follow::Follower;
use crate::forms::Forms;
use crate::info::Info;
use crate::integrate::has_state;
use crate::interpreted::{self, Built};
use crate::method::{MethodName, Steps};
use crate::model::{Checked, units};
use crate::start::Starts;

/// Points of the curves in figures: smooth curves, small files.
pub const CURVE: usize = 1001;

/// Where measured values are.
#[derive(Clone, Debug)]
pub enum Source {
    /// In a file.
    File(PathBuf),
    /// In memory.
    Table(Table),
}

/// A fit as it is asked for.
#[derive(Clone, Debug)]
pub struct Asked {
    /// The measured values.
    pub data: Source,
    /// Parameters and components of the initial state to be found.
    pub free: Vec<String>,
    /// Compared quantities, each with the header of its column; all columns but the time where there is none.
    pub columns: Vec<(String, String)>,
    /// Header of the column with the times.
    pub time: String,
    /// Time of the table at which the motion starts.
    pub t0: f64,
    /// Standard deviations of the errors of all columns, in the units of the model.
    pub sigma: Vec<(String, f64)>,
    /// Intervals that unknowns are kept in, by [`ends`].
    pub bounds: Vec<(String, [f64; 2])>,
    /// Values of unknowns that are known beforehand, by [`normal`].
    pub prior: Vec<(String, Prior)>,
    /// Further points from which the search starts.
    pub restarts: usize,
    /// Pieces of the motion that start on their own at first.
    pub segments: usize,
    /// Parameters that differ from the scene's.
    pub set: Vec<(String, f64)>,
    /// Components of the initial state, in any of its forms; the rest is chosen.
    pub initial: Vec<(String, f64)>,
    /// The method of integration.
    pub method: MethodName,
    /// How it chooses steps.
    pub steps: Steps,
    /// Largest number of steps of one motion, unless it is that of the steps.
    pub max_steps: Option<u64>,
    /// Number of points of the fitted curves.
    pub n_curve: usize,
}

/// What a fit has found.
#[derive(Clone, Debug)]
pub struct Found {
    /// The question.
    pub request: FitRequest,
    /// The answer.
    pub response: FitResponse,
    /// Columns that were in another unit, for people.
    pub converted: Vec<String>,
}

/// The ends of an interval.
///
/// # Errors
/// Its mistake, as the end of a sentence that begins with its name.
pub fn ends(given: [f64; 2]) -> Result<[f64; 2], String> {
    let is_interval = given[0] < given[1];
    if is_interval { Ok(given) } else { Err("is empty: give the smaller number first".into()) }
}

/// A value that is known beforehand.
///
/// # Errors
/// A standard deviation that is not above zero.
pub fn normal(mean: f64, deviation: f64) -> Result<Prior, String> {
    let is_positive = deviation > 0.0;
    let refused = || format!("the standard deviation {deviation:?} is not positive");
    if is_positive { Ok(Prior { mean, deviation }) } else { Err(refused()) }
}

impl Asked {
    /// Fits a scene of a model.
    ///
    /// # Errors
    /// Everything that can be wrong with names and the table, and as [`fit::fit`].
    pub fn fit(&self, model: &Arc<Checked>, scene: &Built, progress: &mut Watch<'_>) -> Result<Found, Error> {
        if scene.watched().is_some_and(|watched| watched.acts()) {
            let reason = "has events that change the state or end the motion, through which derivatives are not \
                          carried: choose a scene without `events`";
            return Err(Error::unusable("--scene", reason));
        }
        let info = scene.info();
        has_state(info)?;
        let mut problems = Vec::new();
        let forms = Forms::of(model, info)?;
        let given = [self.set.as_slice(), self.initial.as_slice()];
        let [set, given] = asked::given(given, &Words::OPTIONS, info, &forms, &mut problems);
        let free = free(model, info, &self.free).unwrap_or_else(|found| {
            problems.extend(found);
            Vec::new()
        });
        if !problems.is_empty() {
            return Err(Error::Request { problems });
        }
        let data = Data::read(model, info, self, free.len())?;
        let starts = Starts::new(model, info, forms)?;
        let (params, initial) = starts.choose(scene, &set, &given)?;
        let known = known(info, self, &free, (&params, &initial))?;
        let request = FitRequest {
            params,
            initial,
            free,
            known,
            restarts: self.restarts,
            segments: self.segments,
            columns: data.columns,
            times: data.times,
            values: data.values,
            method: self.method,
            steps: self.steps,
            max_steps: self.max_steps.unwrap_or(self.steps.max_steps()),
            n_curve: self.n_curve,
        };
        let own = interpreted::build(model, &info.scene)?;
        let forms = Forms::of(model, info)?;
        let follower = Follower::new(model, (&own, forms), [&set, &given])?
            .from(request.params.clone(), request.initial.clone());
        let follower = follower.is_restricted().then_some(&follower as &dyn Follows);
        let response = fit::fit(scene, &request, follower, progress)?;
        Ok(Found { request, response, converted: data.converted })
    }
}

impl Found {
    /// `{"params", "initial", "estimates", "correlation", "columns", "sum_of_squares", "degrees_of_freedom",
    /// "evaluations", "explained", "fits", "starts"}`; the first two are those of a request to simulate. With the
    /// standard deviations of all columns also `"chi_square": {"per_freedom", "probability"}`.
    pub fn to_json(&self, info: &Info) -> Value {
        let Found { request, response, .. } = self;
        let names = || response.estimates.iter().map(|estimate| estimate.name.as_str());
        let object = |entries: &[(&str, Value)]| -> Value {
            entries
                .iter()
                .map(|(name, value)| ((*name).to_owned(), value.clone()))
                .collect::<Map<_, _>>()
                .into()
        };
        let estimates = response.estimates.iter().map(|estimate| {
            let error = estimate.deviation.map_or(Value::Null, number);
            (estimate.name.clone(), object(&[("value", number(estimate.value)), ("error", error)]))
        });
        let correlation =
            names().zip(&response.correlation).map(|(name, row)| (name.to_owned(), by_name(names(), row)));
        let columns = request.columns.iter().zip(response.rms.iter().zip(&response.n_values)).map(
            |(column, (rms, n))| {
                (column.name.clone(), object(&[("values", (*n).into()), ("rms", number(*rms))]))
            },
        );
        let starts = response.starts.iter().map(|start| {
            let sum = start.sum_of_squares.map_or(Value::Null, number);
            object(&[("from", by_name(names(), &start.from)), ("sum_of_squares", sum)])
        });
        let starts: Vec<Value> = starts.collect();
        let chi_square = response.verdict.chi_square.map_or(Value::Null, |found| {
            object(&[("per_freedom", number(found.per_freedom)), ("probability", number(found.probability))])
        });
        object(&[
            ("params", by_name(info.param_names(), &response.params)),
            ("initial", by_name(info.state_names(), &response.initial)),
            ("estimates", Value::Object(estimates.collect())),
            ("correlation", Value::Object(correlation.collect())),
            ("columns", Value::Object(columns.collect())),
            ("sum_of_squares", number(response.sum_of_squares)),
            ("degrees_of_freedom", response.degrees_of_freedom().into()),
            ("evaluations", response.n_evaluations.into()),
            ("explained", number(response.verdict.explained)),
            ("fits", response.verdict.fits().into()),
            ("chi_square", chi_square),
            ("starts", starts.into()),
        ])
    }
}

/// The unknowns by name.
fn free(model: &Checked, info: &Info, names: &[String]) -> Result<Vec<Direction>, Vec<Problem>> {
    let scene = model.scenes.iter().find(|own| own.name == info.scene);
    let fixed: BTreeSet<&str> =
        scene.into_iter().flat_map(|s| &s.fixed).map(|(name, _)| name.as_str()).collect();
    let (fixed, others): (Vec<&String>, Vec<&String>) =
        names.iter().partition(|name| fixed.contains(name.as_str()));
    let told = fixed.into_iter().map(|name| Problem::Unusable {
        path: "--free".into(),
        reason: format!(
            "has {name}, which scene {} fixes: choose another scene, or leave it out",
            info.scene
        ),
    });
    let mut problems: Vec<Problem> = told.collect();
    let others: Vec<String> = others.into_iter().cloned().collect();
    match Direction::named(info, &others, "--free") {
        Ok(directions) if problems.is_empty() => Ok(directions),
        Ok(_) => Err(problems),
        Err(found) => {
            problems.extend(found);
            Err(problems)
        }
    }
}

/// What --bounds and --prior say of each unknown, which start at `params` and `initial`.
fn known(
    info: &Info,
    arguments: &Asked,
    free: &[Direction],
    (params, initial): (&[f64], &[f64]),
) -> Result<Vec<Known>, Error> {
    let names: Vec<&str> = free.iter().map(|direction| direction.name(info)).collect();
    let mut problems = Vec::new();
    let mut all = vec![Known::default(); free.len()];
    let mut place = |path: &str, name: &str, seen: &mut Vec<usize>| {
        let Some(k) = names.iter().position(|own| *own == name) else {
            problems.push(Problem::UnknownName {
                path: path.into(),
                kind: "free name",
                name: name.to_owned(),
                known: names.iter().map(|name| (*name).to_owned()).collect(),
            });
            return None;
        };
        if seen.contains(&k) {
            problems.push(Problem::Repeated { path: path.into(), name: name.to_owned() });
        }
        seen.push(k);
        Some(k)
    };
    let (mut bounded, mut measured) = (Vec::new(), Vec::new());
    for (name, ends) in &arguments.bounds {
        if let Some(k) = place("--bounds", name, &mut bounded) {
            [all[k].least, all[k].most] = *ends;
        }
    }
    for (name, prior) in &arguments.prior {
        if let Some(k) = place("--prior", name, &mut measured) {
            all[k].prior = Some(*prior);
        }
    }
    for (k, (direction, known)) in free.iter().zip(&all).enumerate() {
        let (value, option) = match direction {
            Direction::Param(k) => (params[*k], "--set"),
            Direction::Initial(k) => (initial[*k], "--initial"),
        };
        if !(known.least..=known.most).contains(&value) {
            let name = names[k];
            let reason = format!(
                "keeps {name} within {:?}..{:?}, and the search starts at {name} = {value:?}: give another start with \
                 {option}",
                known.least, known.most
            );
            problems.push(Problem::Unusable { path: "--bounds".into(), reason });
        }
    }
    if problems.is_empty() { Ok(all) } else { Err(Error::Request { problems }) }
}

/// Measured values, in the units of the model.
struct Data {
    columns: Vec<Column>,
    times: Vec<f64>,
    values: Vec<Vec<Option<f64>>>,
    /// Columns that were in another unit, for people.
    converted: Vec<String>,
}

/// The unit of a quantity, where it is known.
fn unit_of<'m>(model: &'m Checked, info: &Info, quantity: Quantity) -> Option<&'m Unit> {
    match quantity {
        Quantity::State(k) => model.units.of(&info.state[k]),
        Quantity::Energy => model.units.energy(),
        Quantity::Output(k) => {
            let mut at = k;
            let group = info.outputs.iter().find(|group| {
                let is_own = at < group.components.len();
                at -= if is_own { 0 } else { group.components.len() };
                is_own
            })?;
            model.units.of_output(&group.name, at)
        }
    }
}

impl Data {
    fn read(model: &Checked, info: &Info, arguments: &Asked, n_free: usize) -> Result<Data, Error> {
        let table = match &arguments.data {
            Source::File(path) => &Table::read(path)?,
            Source::Table(table) => table,
        };
        let file = table.source();
        let mut problems = Vec::new();
        let time = place(table, &arguments.time, "--time", &mut problems);
        let (mut columns, places) = columns(table, info, arguments, &mut problems);
        let Some(time) = time.filter(|_| problems.is_empty()) else {
            return Err(Error::Request { problems });
        };
        sigmas(&mut columns, &arguments.sigma, &mut problems);
        let units = columns.iter().map(|column| unit_of(model, info, column.quantity));
        let quantities =
            columns.iter().map(|column| column.name.as_str()).zip(units).zip(places.iter().copied());
        let with_time = [((arguments.time.as_str(), units::of_time(model)), time)];
        let mut converted = Vec::new();
        let mut factors = Vec::new();
        for ((name, unit), place) in with_time.into_iter().chain(quantities) {
            let factor = table.factor(place, name, unit).unwrap_or_else(|problem| {
                problems.push(problem);
                None
            });
            if let Some((factor, text)) = factor.filter(|(factor, _)| *factor != 1.0) {
                converted.push(format!("{name} is in {text} and was multiplied by {factor:?}"));
            }
            factors.push(factor.map_or(1.0, |(factor, _)| factor));
        }
        let (to_seconds, factors) = (factors[0], &factors[1..]);
        let mut data = Data { columns, times: Vec::new(), values: Vec::new(), converted };
        let mut last = None;
        for (row, cells) in table.rows().enumerate() {
            let mut complain = |reason| problems.push(table.problem_in_row(row, reason));
            let Some(t) = cells[time] else {
                complain(format!("has no time: fill in its column {}", arguments.time));
                continue;
            };
            if t < arguments.t0 {
                complain(format!(
                    "is at {t:?}, before the motion starts at {:?}: give an earlier --t0",
                    arguments.t0
                ));
            } else if last.is_some_and(|last| t <= last) {
                complain(format!(
                    "is at {t:?}, but the line before is not earlier: sort the lines by their times"
                ));
            }
            last = Some(t);
            let values = places.iter().zip(factors).map(|(place, factor)| Some(cells[*place]? * factor));
            let values: Vec<Option<f64>> = values.collect();
            if values.iter().any(Option::is_some) {
                data.times.push((t - arguments.t0) * to_seconds);
                data.values.push(values);
            }
        }
        for (at, column) in data.columns.iter().enumerate() {
            if data.values.iter().all(|row| row[at].is_none()) {
                let reason = format!("has no value of {}: leave it out with --columns", column.name);
                problems.push(Problem::Unusable { path: file.clone(), reason });
            }
        }
        let n = data.values.iter().flatten().flatten().count();
        if n + arguments.prior.len() <= n_free && problems.is_empty() {
            let reason = format!(
                "has {n} values of the chosen columns for {n_free} unknowns: give more values than unknowns, or fit less"
            );
            problems.push(Problem::Unusable { path: file, reason });
        }
        const MAX_PROBLEMS: usize = 20;
        problems.truncate(MAX_PROBLEMS);
        if problems.is_empty() { Ok(data) } else { Err(Error::Request { problems }) }
    }
}

/// The columns that are compared, and their places in the table.
fn columns(
    table: &Table,
    info: &Info,
    arguments: &Asked,
    problems: &mut Vec<Problem>,
) -> (Vec<Column>, Vec<usize>) {
    let (mut columns, mut places) = (Vec::new(), Vec::new());
    for (name, header) in chosen(table, arguments) {
        let quantity = Quantity::named(info, name);
        if quantity.is_none() {
            problems.push(Problem::UnknownName {
                path: format!("scene {} of {}", info.scene, info.model),
                kind: "variable",
                name: name.to_owned(),
                known: Quantity::all(info).into_iter().map(|(name, _)| name).collect(),
            });
        }
        if columns.iter().any(|column: &Column| column.name == name) {
            problems.push(Problem::Repeated { path: "--columns".into(), name: name.to_owned() });
        }
        let place = place(table, header, "--columns", problems);
        if let (Some(quantity), Some(place)) = (quantity, place) {
            columns.push(Column { name: name.to_owned(), quantity, sigma: None });
            places.push(place);
        }
    }
    if arguments.columns.is_empty() && !problems.is_empty() {
        let reason = "leaves out what is no variable of the scene, and says which header stands for which: \
                      --columns NAME=HEADER,..";
        problems.push(Problem::Unusable { path: "--columns".into(), reason: reason.into() });
    }
    (columns, places)
}

/// Names of what is compared, and the headers of their columns.
fn chosen<'a>(table: &'a Table, arguments: &'a Asked) -> Vec<(&'a str, &'a str)> {
    if arguments.columns.is_empty() {
        let others = table.names.iter().filter(|name| **name != arguments.time);
        return others.map(|name| (name.as_str(), name.as_str())).collect();
    }
    arguments.columns.iter().map(|(name, header)| (name.as_str(), header.as_str())).collect()
}

/// The column of a header, which has to be there once.
fn place(table: &Table, header: &str, path: &str, problems: &mut Vec<Problem>) -> Option<usize> {
    match table.places(header).as_slice() {
        [place] => return Some(*place),
        [] => problems.push(Problem::UnknownName {
            path: "the table".into(),
            kind: "column",
            name: header.to_owned(),
            known: table.names.clone(),
        }),
        _ => {
            let reason =
                format!("asks for the column {header}, of which the table has several: rename all but one");
            problems.push(Problem::Unusable { path: path.into(), reason });
        }
    }
    None
}

/// Gives each column its standard deviation: all of them, or none.
fn sigmas(columns: &mut [Column], given: &[(String, f64)], problems: &mut Vec<Problem>) {
    let names: Vec<String> = columns.iter().map(|column| column.name.clone()).collect();
    let known: Vec<&str> = names.iter().map(String::as_str).collect();
    let values = assignments(given, "--sigma", "column", &known, problems);
    for (name, value) in values.iter().filter(|(_, value)| **value <= 0.0) {
        let reason = format!("gives {name} the standard deviation {value:?}: give a positive one");
        problems.push(Problem::Unusable { path: "--sigma".into(), reason });
    }
    let absent: Vec<String> = names.iter().filter(|name| !values.contains_key(*name)).cloned().collect();
    if !given.is_empty() && !absent.is_empty() {
        problems.push(Problem::MissingNames { path: "--sigma".into(), absent, known: names });
        return;
    }
    columns.iter_mut().for_each(|column| column.sigma = values.get(&column.name).copied());
}
