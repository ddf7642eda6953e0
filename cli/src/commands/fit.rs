//! `fit`: parameters and initial values from a table of measured motions.
//!
//! Does not know: how a fit is done, how files are written.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use hamel_codegen::spec::Unit;
use serde_json::{Map, Value};

use super::options::{MotionOptions, SceneOptions, assignment, assignments, finite};
use crate::output::fitted::{Fitted, Target};
use crate::output::terminal::bold;
use hamel_run::bars::fit_with_bar;
use hamel_run::direction::Direction;
use hamel_run::dynamics::Factory as _;
use hamel_run::error::{Error, Problem};
use hamel_run::fit::{Column, FitRequest, FitResponse, Follows, Known, Prior, Quantity};
use hamel_run::follow::Follower;
use hamel_run::forms::Forms;
use hamel_run::info::Info;
use hamel_run::integrate::has_state;
use hamel_run::interpreted;
use hamel_run::model::{self, Checked, blocks, units};
use hamel_run::request::json::{by_name, number};
use hamel_run::request::table::Table;
use hamel_run::session::Session;
use hamel_run::start::Starts;

/// Fit parameters and initial values of a model to a table of measured values
///
/// The table has a line of names, then a line for each time; cells may be empty. Commas, semicolons, tabs or blanks
/// separate cells; lines before the names and comments are passed over. A unit behind a name, `x [mm]`, or below it is
/// converted to that of the model. Columns are components of the state, `energy` and outputs, by the names that files
/// of `simulate` have. The motion nearest to them in the sense
/// of least squares is found by the method of Levenberg and Marquardt with exact derivatives, from the start that
/// --set, --initial and the model's defaults give: over a tenth of the time, then over a third, then over all of it.
/// Steps of the search out of what the model allows are shortened. A minimum that explains the data badly is an error.
///
/// Standard errors and correlations are those of the linearised problem at the minimum. With --sigma they follow from
/// the given errors of the data, otherwise from what is left of the data; columns of different units then count by
/// their numbers, so that --sigma is better for them.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel fit heavy_top --data top.csv --free l,Omega3
  hamel fit heavy_top --data top.csv --free I1,l --set m=1.2 --initial Omega3=5 --sigma Omega1=0.01 Gamma3=0.002 \\
    -o top.svg
  hamel fit heavy_top --data top.csv --free l,Omega3 --bounds l=0.1..1 --restarts 10
  hamel fit ./my_model.hamel --data log.csv --time seconds --t0 2.5 --columns x=position,x_dot --free k,x --json"
)]
pub struct Arguments {
    /// Which scene, and who evaluates it.
    #[command(flatten)]
    pub scene: SceneOptions,
    /// File (CSV) with the measured values: a line of names, then a line for each time
    #[arg(long, value_name = "FILE")]
    pub data: PathBuf,
    /// Parameters and components of the initial state to be found
    #[arg(long, value_name = "NAME", num_args = 1.., value_delimiter = ',', required = true)]
    pub free: Vec<String>,
    /// What to compare, each with the header of its column where that is another one [default: all columns but the
    /// time]
    #[arg(long, value_name = "NAME[=HEADER]", num_args = 1.., value_delimiter = ',')]
    pub columns: Vec<String>,
    /// Header of the column with the times
    #[arg(long, value_name = "HEADER", default_value = "t")]
    pub time: String,
    /// Time of the table at which the motion starts from its initial state; no value may be earlier
    #[arg(long, value_name = "T", default_value_t = 0.0, allow_negative_numbers = true, value_parser = finite)]
    pub t0: f64,
    /// Standard deviations of the errors of all columns, in the units of the model
    #[arg(long, value_name = "NAME=VALUE", num_args = 1.., value_parser = assignment)]
    pub sigma: Vec<(String, f64)>,
    /// Intervals that unknowns are kept in; either end may be left out
    #[arg(long, value_name = "NAME=FROM..TO", num_args = 1.., value_parser = interval)]
    pub bounds: Vec<(String, [f64; 2])>,
    /// Values of unknowns that are known beforehand, with standard deviations; needs --sigma
    #[arg(long, value_name = "NAME=VALUE+-ERROR", num_args = 1.., value_parser = prior)]
    pub prior: Vec<(String, Prior)>,
    /// Further points to start from, always the same: within --bounds and --prior, else within a factor of three
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub restarts: usize,
    /// Cut the motion into pieces that start on their own at first (multiple shooting), for long or chaotic ones
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub segments: u32,
    /// From where, and how.
    #[command(flatten)]
    pub motion: MotionOptions,
    /// Figure (.svg, .png or .pdf) with the values and the fitted motion
    #[arg(short, long = "output", value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// Print the answer as JSON
    #[arg(long)]
    pub json: bool,
}

/// Points of the curves in figures: smooth curves, small files.
const CURVE: usize = 1001;

/// Fits; a summary for people, or JSON.
///
/// # Errors
/// Everything that can be wrong with names, the table, the motion and the fit.
pub fn run(session: &Session, arguments: &Arguments) -> Result<String, Error> {
    let target = arguments.output.as_deref().map(Target::new).transpose()?;
    let opened = target.as_ref().map(Target::open).transpose()?;
    let file = arguments.scene.find(session)?;
    let choice = arguments.scene.choice_of(&file)?;
    let model = file.model()?;
    let motion = &arguments.motion;
    let steps = motion.steps()?;
    // Has the events and residuals of the scene, whoever evaluates it.
    let built = interpreted::build(model, &choice.scene)?;
    if built.watched().is_some_and(|watched| watched.acts()) {
        let reason = "has events that change the state or end the motion, through which derivatives are not carried: \
                      choose a scene without `events`";
        return Err(Error::unusable("--scene", reason));
    }
    let scene = choice.open(&file)?;
    let info = scene.info().clone();
    has_state(&info)?;
    let mut problems = Vec::new();
    let forms = Forms::of(model, &info)?;
    let [set, given] = motion.given(&info, &forms, &mut problems);
    let free = free(model, &info, &arguments.free).unwrap_or_else(|found| {
        problems.extend(found);
        Vec::new()
    });
    if !problems.is_empty() {
        return Err(Error::Request { problems });
    }
    let data = Data::read(model, &info, arguments, free.len())?;
    let starts = Starts::new(model, &info, forms)?;
    let (params, initial) = starts.choose(&scene, &set, &given)?;
    let known = known(&info, arguments, &free, (&params, &initial))?;
    let request = FitRequest {
        params,
        initial,
        free,
        known,
        restarts: arguments.restarts,
        segments: arguments.segments as usize,
        columns: data.columns,
        times: data.times,
        values: data.values,
        method: motion.method.unwrap_or_default(),
        steps,
        max_steps: motion.max_steps.unwrap_or(steps.max_steps()),
        n_curve: if target.is_some() { CURVE } else { 0 },
    };
    let own = interpreted::build(model, &info.scene)?;
    let forms = Forms::of(model, &info)?;
    let follower = Follower::new(model, (&own, forms), [&set, &given])?
        .from(request.params.clone(), request.initial.clone());
    let follower = follower.is_restricted().then_some(&follower as &dyn Follows);
    let response = fit_with_bar(&scene, &request, follower)?;
    let title = model::title(model);
    if let (Some(target), Some(file)) = (&target, opened) {
        let (info, title, blocks) = (&info, &title, &blocks::blocks(model));
        target.write(file, &Fitted { info, title, blocks, request: &request, response: &response })?;
    }
    if arguments.json {
        return Ok(json(&info, &request, &response).to_string());
    }
    let mut text = summary(&info, &title, (arguments, &data.converted), &request, &response);
    if let Some(target) = &target {
        let _ = write!(text, "\nwrote {}", target.path().display());
    }
    Ok(text)
}

/// What is to be found, by name.
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

/// An interval of a name, `l=0.1..1`, `l=0..` or `l=..1`.
fn interval(text: &str) -> Result<(String, [f64; 2]), String> {
    let example = "write it as name=from..to, such as l=0.1..1";
    let (name, values) = text.split_once('=').ok_or(example)?;
    let (from, to) = values.split_once("..").ok_or(example)?;
    let end = |text: &str, open: f64| if text.trim().is_empty() { Ok(open) } else { finite(text) };
    let ends = [end(from, f64::NEG_INFINITY)?, end(to, f64::INFINITY)?];
    if ends[0] >= ends[1] {
        return Err(format!("the interval {values} is empty: give the smaller number first"));
    }
    Ok((name.trim().to_owned(), ends))
}

/// A value of a name with its standard deviation, `l=0.4+-0.05`.
fn prior(text: &str) -> Result<(String, Prior), String> {
    let example = "write it as name=value+-error, such as l=0.4+-0.05";
    let (name, values) = text.split_once('=').ok_or(example)?;
    let (mean, deviation) = values.split_once("+-").or_else(|| values.split_once('\u{b1}')).ok_or(example)?;
    let prior = Prior { mean: finite(mean)?, deviation: finite(deviation)? };
    if prior.deviation <= 0.0 {
        return Err(format!("the standard deviation {:?} is not positive", prior.deviation));
    }
    Ok((name.trim().to_owned(), prior))
}

/// What --bounds and --prior say of each unknown, which start at `params` and `initial`.
fn known(
    info: &Info,
    arguments: &Arguments,
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
    fn read(model: &Checked, info: &Info, arguments: &Arguments, n_free: usize) -> Result<Data, Error> {
        let table = Table::read(&arguments.data)?;
        let file = arguments.data.display().to_string();
        let mut problems = Vec::new();
        let time = place(&table, &arguments.time, "--time", &mut problems);
        let (mut columns, places) = columns(&table, info, arguments, &mut problems);
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
    arguments: &Arguments,
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
fn chosen<'a>(table: &'a Table, arguments: &'a Arguments) -> Vec<(&'a str, &'a str)> {
    if arguments.columns.is_empty() {
        let others = table.names.iter().filter(|name| **name != arguments.time);
        return others.map(|name| (name.as_str(), name.as_str())).collect();
    }
    let split = |text: &'a String| match text.split_once('=') {
        Some((name, header)) => (name.trim(), header.trim()),
        None => (text.trim(), text.trim()),
    };
    arguments.columns.iter().map(split).collect()
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

/// `{"params", "initial", "estimates", "correlation", "columns", "sum_of_squares", "degrees_of_freedom", "evaluations",
/// "explained", "fits", "starts"}`; the first two are those of a request to simulate. With the standard deviations of
/// all columns also `"chi_square": {"per_freedom", "probability"}`.
fn json(info: &Info, request: &FitRequest, response: &FitResponse) -> Value {
    let names = || response.estimates.iter().map(|estimate| estimate.name.as_str());
    let object = |entries: &[(&str, Value)]| -> Value {
        entries.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect::<Map<_, _>>().into()
    };
    let estimates = response.estimates.iter().map(|estimate| {
        let error = estimate.deviation.map_or(Value::Null, number);
        (estimate.name.clone(), object(&[("value", number(estimate.value)), ("error", error)]))
    });
    let correlation =
        names().zip(&response.correlation).map(|(name, row)| (name.to_owned(), by_name(names(), row)));
    let columns =
        request.columns.iter().zip(response.rms.iter().zip(&response.n_values)).map(|(column, (rms, n))| {
            (column.name.clone(), object(&[("values", (*n).into()), ("rms", number(*rms))]))
        });
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

fn summary(
    info: &Info,
    title: &str,
    (arguments, converted): (&Arguments, &[String]),
    request: &FitRequest,
    response: &FitResponse,
) -> String {
    let mut text = format!("{}  {title}", bold(&info.model));
    if info.scene != model::DEFAULT_SCENE {
        let _ = write!(text, ", scene {}", info.scene);
    }
    let n_values: usize = response.n_values.iter().sum();
    let _ = write!(
        text,
        "\n  {n_values} values of {}, {} unknowns, {} motions",
        arguments.data.display(),
        response.estimates.len(),
        response.n_evaluations
    );
    converted.iter().for_each(|told| {
        let _ = write!(text, "\n  {told}");
    });
    if let [_, _, ..] = response.starts.as_slice() {
        let n_same = response.starts.iter().filter(|start| start.is_same).count();
        let n_none = response.starts.iter().filter(|start| start.sum_of_squares.is_none()).count();
        let n = response.starts.len();
        let _ = write!(text, "\n  of {n} starts {n_same} end at this minimum, {n_none} at none");
    }
    let of_estimates = response.estimates.iter().map(|estimate| &estimate.name);
    let of_columns = request.columns.iter().map(|column| &column.name);
    let width = of_estimates.chain(of_columns).map(|name| name.chars().count()).max().unwrap_or(0).max(6);
    let _ = write!(text, "\n\n  {:width$}  {:>24}  {:>14}", "", "value", "standard error");
    for estimate in &response.estimates {
        let deviation = estimate.deviation.map_or("at its bound".to_owned(), |error| format!("{error:.2e}"));
        let value = format!("{:?}", estimate.value);
        let _ = write!(text, "\n  {:width$}  {value:>24}  {deviation:>14}", estimate.name);
    }
    if response.estimates.len() > 1 {
        text.push_str("\n\n  correlations");
        for (k, (estimate, row)) in response.estimates.iter().zip(&response.correlation).enumerate() {
            let _ = write!(text, "\n  {:width$}", estimate.name);
            row[..=k].iter().for_each(|x| {
                let _ = write!(text, "  {x:>6.3}");
            });
        }
    }
    let _ = write!(text, "\n\n  {:width$}  {:>24}  {:>14}", "", "values", "rms left");
    for (column, (rms, n)) in request.columns.iter().zip(response.rms.iter().zip(&response.n_values)) {
        let _ = write!(text, "\n  {:width$}  {n:>24}  {:>14}", column.name, format!("{rms:.3e}"));
    }
    let n_free = response.degrees_of_freedom();
    if let Some(found) = response.verdict.chi_square {
        let _ = write!(
            text,
            "\n  sum of squares over {n_free} degrees of freedom: {:.3}, which is about 1 where model and --sigma are \
             right",
            found.per_freedom
        );
    }
    let _ = write!(text, "\n  {}", response.verdict.text());
    let by_name = |is_wanted: fn(&Direction) -> bool, option: &str| {
        let both = request.free.iter().zip(&response.estimates).filter(|(direction, _)| is_wanted(direction));
        let each: Vec<String> = both.map(|(_, e)| format!(" {}={:?}", e.name, e.value)).collect();
        if each.is_empty() { String::new() } else { format!(" {option}{}", each.concat()) }
    };
    let params = by_name(|direction| matches!(direction, Direction::Param(_)), "--set");
    let initial = by_name(|direction| matches!(direction, Direction::Initial(_)), "--initial");
    let _ = write!(text, "\n\n  for simulate:{params}{initial}");
    text
}
