//! Statistics of each quantity at each time, of some chunks in a row or of all of them, and the tables that they make.
//!
//! Sums of floating point numbers depend on the order of the summands, and sketches on the order in which they are
//! merged. Chunks are merged along the binary tree over their numbers: two neighbours, then two pairs, and so on. Who
//! merges them, and when, does not matter then.
//!
//! Does not know: files, who gathers which chunk.

use clap::ValueEnum;

use super::chunk::{Chunk, Heading};
use hamel_run::members::Member;
use hamel_run::statistics::Distribution;

/// What is told of the values at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Statistic {
    /// The mean
    Mean,
    /// The variance without bias
    Variance,
    /// Quantiles at the levels of --quantiles
    Quantiles,
    /// Shares of the trajectories in --bins intervals between the extremes
    Histogram,
}

impl Statistic {
    /// Those that have names.
    ///
    /// # Errors
    /// What is wrong with a name.
    pub fn named(names: &[String]) -> Result<Vec<Statistic>, String> {
        let of_one = |name: &String| {
            <Statistic as ValueEnum>::from_str(name, false)
                .map_err(|_| format!("has {name:?}, but knows mean, variance, quantiles and histogram"))
        };
        names.iter().map(of_one).collect()
    }
}

/// Which statistics are told.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Wanted {
    pub(crate) statistics: Vec<Statistic>,
    /// Levels of quantiles.
    pub(crate) levels: Vec<f64>,
    /// Number of bins of histograms.
    pub(crate) bins: usize,
}

/// Numbers that are told of each quantity at each time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Table {
    Number,
    Min,
    Max,
    Mean,
    Variance,
    Quantiles,
    Edges,
    Shares,
}

impl Wanted {
    pub(crate) fn has(&self, statistic: Statistic) -> bool {
        self.statistics.contains(&statistic)
    }

    /// The tables in the order in which they are told.
    pub(crate) fn tables(&self) -> Vec<Table> {
        let mut tables = vec![Table::Number, Table::Min, Table::Max];
        let asked: [(Statistic, &[Table]); 4] = [
            (Statistic::Mean, &[Table::Mean]),
            (Statistic::Variance, &[Table::Variance]),
            (Statistic::Quantiles, &[Table::Quantiles]),
            (Statistic::Histogram, &[Table::Edges, Table::Shares]),
        ];
        asked.iter().filter(|(statistic, _)| self.has(*statistic)).for_each(|(_, more)| tables.extend(*more));
        tables
    }
}

impl Table {
    /// The name of its array in files.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Table::Number => "n",
            Table::Min => "min",
            Table::Max => "max",
            Table::Mean => "mean",
            Table::Variance => "variance",
            Table::Quantiles => "quantiles",
            Table::Edges => "histogram_edges",
            Table::Shares => "histogram",
        }
    }

    /// What it has.
    pub(crate) fn doc(self) -> &'static str {
        match self {
            Table::Number => "trajectories that came as far",
            Table::Min => "smallest value",
            Table::Max => "largest value",
            Table::Mean => "mean",
            Table::Variance => "variance without bias",
            Table::Quantiles => "values below which the share `level` of the trajectories is",
            Table::Edges => "edges of the bins of the histogram",
            Table::Shares => "share of the trajectories in each bin",
        }
    }

    /// Name and length of the axis behind those of time and quantity; none for one number.
    pub(crate) fn axis(self, wanted: &Wanted) -> Option<(&'static str, usize)> {
        match self {
            Table::Number | Table::Min | Table::Max | Table::Mean | Table::Variance => None,
            Table::Quantiles => Some(("level", wanted.levels.len())),
            Table::Edges => Some(("edge", wanted.bins + 1)),
            Table::Shares => Some(("bin", wanted.bins)),
        }
    }

    /// Its numbers for one quantity at one time; NaN for what has no value.
    fn of(self, distribution: &Distribution, wanted: &Wanted) -> Vec<f64> {
        let one = |x: Option<f64>| vec![x.unwrap_or(f64::NAN)];
        let none = |n: usize| vec![f64::NAN; n];
        let bins = wanted.bins;
        match self {
            Table::Number => one(Some(distribution.n() as f64)),
            Table::Min => one(distribution.extremes().map(|[min, _]| min)),
            Table::Max => one(distribution.extremes().map(|[_, max]| max)),
            Table::Mean => one(distribution.mean()),
            Table::Variance => one(distribution.variance()),
            Table::Quantiles => {
                wanted.levels.iter().map(|q| distribution.quantile(*q).unwrap_or(f64::NAN)).collect()
            }
            Table::Edges => distribution.histogram(bins).map_or_else(|| none(bins + 1), |(edges, _)| edges),
            Table::Shares => distribution.histogram(bins).map_or_else(|| none(bins), |(_, shares)| shares),
        }
    }
}

/// Names of the quantities of an ensemble: the components of the state, then the energy where there is one.
pub(crate) fn quantities(heading: &Heading<'_>) -> Vec<String> {
    let info = heading.info;
    info.state.iter().cloned().chain(info.has_energy.then(|| "energy".to_owned())).collect()
}

/// The values of some chunks in a row: at each time, those of each quantity.
#[derive(Clone, Debug)]
pub(crate) struct Gathered(Vec<Vec<Distribution>>);

impl Gathered {
    /// Of no trajectories.
    pub(crate) fn none(heading: &Heading<'_>) -> Gathered {
        let none = vec![Distribution::of(std::iter::empty()); quantities(heading).len()];
        Gathered(vec![none; heading.times.len()])
    }

    /// Of one chunk; a trajectory counts as far as it came.
    pub(crate) fn of(chunk: &Chunk, heading: &Heading<'_>) -> Gathered {
        let n_state = heading.info.state.len();
        let of = |at: usize, quantity: usize| {
            let value = |member: Member<'_>| {
                let sample = member.sample(at)?;
                if quantity < n_state { Some(sample.state[quantity]) } else { sample.energy }
            };
            Distribution::of(chunk.results.iter().filter_map(value))
        };
        let n = quantities(heading).len();
        let of_time = |at| (0..n).map(|quantity| of(at, quantity)).collect();
        Gathered((0..heading.times.len()).map(of_time).collect())
    }

    /// Takes those of the chunks behind in.
    pub(crate) fn merge(&mut self, behind: Gathered) {
        let pairs = self.0.iter_mut().flatten().zip(behind.0.into_iter().flatten());
        pairs.for_each(|(mine, other)| mine.merge(other));
    }

    /// At each time, those of each quantity.
    pub(crate) fn at_times(&self) -> &[Vec<Distribution>] {
        &self.0
    }

    /// The numbers of a table, time by time and quantity by quantity.
    pub(crate) fn table(&self, table: Table, wanted: &Wanted) -> Vec<f64> {
        self.0.iter().flatten().flat_map(|distribution| table.of(distribution, wanted)).collect()
    }

    /// All that there is to know, with every bit of it.
    pub(crate) fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.0.iter().flatten().for_each(|distribution| distribution.write(&mut bytes));
        bytes
    }

    /// The same again; none when the bytes are not those of an ensemble with this heading.
    pub(crate) fn from_bytes(heading: &Heading<'_>, mut bytes: &[u8]) -> Option<Gathered> {
        let mut gathered = Gathered::none(heading);
        for distribution in gathered.0.iter_mut().flatten() {
            *distribution = Distribution::read(&mut bytes)?;
        }
        bytes.is_empty().then_some(gathered)
    }
}

/// Chunks that come one after the other, merged along the tree over their numbers.
#[derive(Debug, Default)]
pub(crate) struct Pile {
    /// At place `k` those of `2^k` chunks, or none; what is at a higher place came before.
    of_powers: Vec<Option<Gathered>>,
}

impl Pile {
    /// Takes the next chunk in.
    pub(crate) fn add(&mut self, mut next: Gathered) {
        for place in &mut self.of_powers {
            match place.take() {
                Some(mut before) => {
                    before.merge(next);
                    next = before;
                }
                None => {
                    *place = Some(next);
                    return;
                }
            }
        }
        self.of_powers.push(Some(next));
    }

    /// All chunks together; none where there were none.
    pub(crate) fn all(self) -> Option<Gathered> {
        self.of_powers.into_iter().flatten().reduce(|behind, mut before| {
            before.merge(behind);
            before
        })
    }
}
