//! Arguments of `ensemble`.
//!
//! Does not know: what is done with them.

use std::path::PathBuf;

use clap::Args;

use crate::commands::options::{EndOptions, MotionOptions, NoiseOptions, SceneOptions};
use crate::output::trajectories::Statistic;
use hamel_run::ensemble::Width;
use hamel_run::request::share::Share;
use hamel_run::request::variation::{Spread, Sweep};

/// Integrate a model many times, with parameters, initial states and held inputs that vary; write a table or a store
///
/// What varies takes every value of a grid (--sweep), is drawn at random (--spread), or is read from a table (--table).
/// Several of these are combined: every line of the table, with every point of the grid, --count times. What is drawn
/// depends on the seed, the name and the number of the trajectory alone. What varies are parameters, components of the
/// initial state, and inputs, which are held. The rest of a state is chosen as by simulate,
/// for each trajectory anew, so that constraints hold.
///
/// Eight trajectories are integrated side by side in the registers of a core (each alone through events, in closed
/// loops and with multipliers), and the cores share the work; results depend on neither the number of threads nor
/// --via. A trajectory that stops keeps its last state, the reason is in the column `error`, and the others go on; when
/// none reaches the end, the exit status is 1. Integration starts at t = 0.
///
/// Files are written while trajectories are integrated, so that memory does not depend on their number. A store (.zarr)
/// may be made by several processes, now or later: each takes chunks of trajectories that no other has. The bytes are
/// those of one process that is never interrupted.
#[derive(Clone, Debug, Args)]
#[command(
    arg_required_else_help = true,
    after_help = "\
Examples:
  hamel ensemble heavy_top --sweep Omega3=0..20:101 --t-final 5 -o tops.csv
  hamel ensemble heavy_top --spread m=0.05 Omega1=-0.1..0.1 --count 1000 --seed 7 --samples 101 -o tops.npz
  hamel ensemble heavy_top --sweep m=log:0.1..10:5 l=0.1..1:5 --method tsit5 --rtol 1e-6 --atol 1e-8 -o grid.csv
  hamel ensemble euler_disk --table starts.csv --set m=2 -o disks.csv
  hamel ensemble heavy_top --spread m=0.05 --count 10000000 -o tops.zarr --resume
  hamel ensemble heavy_top --spread m=0.05 --count 10000 --samples 101 --statistics mean,quantiles -o fan.svg"
)]
pub struct Arguments {
    /// Which scene, and who evaluates it.
    #[command(flatten)]
    pub scene: SceneOptions,
    /// Parameter or component of the initial state that takes N values from A to B, or with equal ratios from log:A to
    /// B
    #[arg(long, value_name = "NAME=[log:]A..B:N", num_args = 1.., value_parser = Sweep::parse)]
    pub sweep: Vec<Sweep>,
    /// Parameter or component to draw: normally distributed around its value with standard deviation SIGMA, or
    /// uniformly from A..B, or with a uniform logarithm from log:A..B
    #[arg(long, value_name = "NAME=SIGMA|[log:]A..B", num_args = 1.., requires = "count", value_parser = Spread::parse)]
    pub spread: Vec<Spread>,
    /// Number of draws, and of paths of noises, for each line of the table and point of the grid
    #[arg(long, value_name = "N")]
    pub count: Option<usize>,
    /// Seed of what is drawn
    #[arg(long, default_value_t = 0, requires = "spread")]
    pub seed: u64,
    /// File (CSV) of parameters, components of initial states and inputs: a line of names, then a line for each
    /// trajectory
    #[arg(long, value_name = "FILE")]
    pub table: Option<PathBuf>,
    /// From where, and how.
    #[command(flatten)]
    pub motion: MotionOptions,
    /// Which paths.
    #[command(flatten)]
    pub noise: NoiseOptions,
    /// To where.
    #[command(flatten)]
    pub end: EndOptions,
    /// Number of samples of each trajectory at equal distances, both ends included; a single one is the end
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub samples: usize,
    /// Trajectories side by side in a core, with common steps; explicit methods only, the others take one at a time
    #[arg(long, value_enum, default_value_t)]
    pub lanes: Width,
    /// Number of threads, at most 1024; results do not depend on it [default: that of the cores]
    #[arg(long, value_name = "N")]
    pub threads: Option<usize>,
    /// Go on with a store, beside other processes that write it; the store is made when there is none
    #[arg(long)]
    pub resume: bool,
    /// Integrate one of N shares of the ensemble, into a store that the other shares have, too; implies --resume
    #[arg(long, value_name = "I/N", value_parser = Share::parse)]
    pub part: Option<Share>,
    /// Statistics of all trajectories at each sample instead of the trajectories, gathered while they are integrated;
    /// in a store, too
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    pub statistics: Vec<Statistic>,
    /// Levels of --statistics quantiles
    #[arg(long, value_name = "LEVELS", value_delimiter = ',', requires = "statistics", value_parser = level)]
    #[arg(default_value = "0.05,0.25,0.5,0.75,0.95")]
    pub quantiles: Vec<f64>,
    /// Number of bins of --statistics histogram, between the extremes
    #[arg(long, value_name = "N", requires = "statistics", default_value_t = 50)]
    #[arg(value_parser = clap::value_parser!(u16).range(1..))]
    pub bins: u16,
    /// File to write: .zarr, a store, or .csv, .npz or, for statistics, .svg, which may be repeated
    #[arg(short, long = "output", value_name = "FILE", required = true)]
    pub output: Vec<PathBuf>,
}

/// A level of a quantile.
fn level(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if (0.0..=1.0).contains(&x) => Ok(x),
        _ => Err(format!("{text:?} is no level: give a number from 0 to 1")),
    }
}
