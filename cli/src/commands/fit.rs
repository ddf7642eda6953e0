//! `fit`: parameters and initial values from a table of measured motions.
//!
//! Does not know: how a fit is done, how files are written.

use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;

use super::options::{MotionOptions, SceneOptions, assignment, finite};
use crate::output::fitted::{Fitted, Target};
use crate::output::terminal::bold;
use hamel_run::bars::with_fit_bar;
use hamel_run::direction::Direction;
use hamel_run::dynamics::Factory as _;
use hamel_run::error::Error;
use hamel_run::fit::Prior;
use hamel_run::info::Info;
use hamel_run::model::{self, blocks};
use hamel_run::request::fit::{Asked, CURVE, Found, Source, ends, normal};
use hamel_run::session::Session;

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
    let asked = arguments.asked(target.is_some())?;
    let scene = choice.open(&file)?;
    let found = with_fit_bar(|progress| asked.fit(model, &scene, progress))?;
    let (info, title) = (scene.info(), model::title(model));
    if let (Some(target), Some(file)) = (&target, opened) {
        let (title, blocks) = (&title, &blocks::blocks(model));
        let Found { request, response, .. } = &found;
        target.write(file, &Fitted { info, title, blocks, request, response })?;
    }
    if arguments.json {
        return Ok(found.to_json(info).to_string());
    }
    let mut text = summary(info, &title, &arguments.data.display().to_string(), &found);
    if let Some(target) = &target {
        let _ = write!(text, "\nwrote {}", target.path().display());
    }
    Ok(text)
}

impl Arguments {
    /// The fit that is asked for.
    fn asked(&self, has_figure: bool) -> Result<Asked, Error> {
        let split = |text: &String| match text.split_once('=') {
            Some((name, header)) => (name.trim().to_owned(), header.trim().to_owned()),
            None => (text.trim().to_owned(), text.trim().to_owned()),
        };
        let motion = &self.motion;
        Ok(Asked {
            data: Source::File(self.data.clone()),
            free: self.free.clone(),
            columns: self.columns.iter().map(split).collect(),
            time: self.time.clone(),
            t0: self.t0,
            sigma: self.sigma.clone(),
            bounds: self.bounds.clone(),
            prior: self.prior.clone(),
            restarts: self.restarts,
            segments: self.segments as usize,
            set: motion.set.clone(),
            initial: motion.initial.clone(),
            method: motion.method.unwrap_or_default(),
            steps: motion.steps()?,
            max_steps: motion.max_steps,
            n_curve: if has_figure { CURVE } else { 0 },
        })
    }
}

/// An interval of a name, `l=0.1..1`, `l=0..` or `l=..1`.
fn interval(text: &str) -> Result<(String, [f64; 2]), String> {
    let example = "write it as name=from..to, such as l=0.1..1";
    let (name, values) = text.split_once('=').ok_or(example)?;
    let (from, to) = values.split_once("..").ok_or(example)?;
    let end = |text: &str, open: f64| if text.trim().is_empty() { Ok(open) } else { finite(text) };
    let given = [end(from, f64::NEG_INFINITY)?, end(to, f64::INFINITY)?];
    Ok((name.trim().to_owned(), ends(given).map_err(|why| format!("the interval {values} {why}"))?))
}

/// A value of a name with its standard deviation, `l=0.4+-0.05`.
fn prior(text: &str) -> Result<(String, Prior), String> {
    let example = "write it as name=value+-error, such as l=0.4+-0.05";
    let (name, values) = text.split_once('=').ok_or(example)?;
    let (mean, deviation) = values.split_once("+-").or_else(|| values.split_once('\u{b1}')).ok_or(example)?;
    Ok((name.trim().to_owned(), normal(finite(mean)?, finite(deviation)?)?))
}

fn summary(info: &Info, title: &str, data: &str, Found { request, response, converted }: &Found) -> String {
    let mut text = format!("{}  {title}", bold(&info.model));
    if info.scene != model::DEFAULT_SCENE {
        let _ = write!(text, ", scene {}", info.scene);
    }
    let n_values: usize = response.n_values.iter().sum();
    let _ = write!(
        text,
        "\n  {n_values} values of {data}, {} unknowns, {} motions",
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
