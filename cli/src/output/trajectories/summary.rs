//! Statistics of an ensemble, gathered while trajectories come and go: CSV, NPZ, and a figure of fans.
//!
//! Does not know: how trajectories were computed, how statistics are gathered.

use std::fmt::Write as _;
use std::path::Path;

use clap::ValueEnum;
use hamel_codegen::config::write_atomically;

use super::chunk::{Chunk, Heading, Sink};
use super::npz::Archive;
use super::target::{Format, Target};
use super::temporary::Temporary;
use crate::error::Error;
use crate::model::blocks::Block;
use crate::output::plot::{Band, Figure, Panel, svg};
use crate::run::ensemble::Member;
use crate::run::statistics::Distribution;

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

/// Which statistics are told.
#[derive(Clone, Debug)]
pub(crate) struct Wanted {
    pub(crate) statistics: Vec<Statistic>,
    /// Levels of quantiles.
    pub(crate) levels: Vec<f64>,
    /// Number of bins of histograms.
    pub(crate) bins: usize,
}

impl Wanted {
    fn has(&self, statistic: Statistic) -> bool {
        self.statistics.contains(&statistic)
    }
}

/// Statistics of each component of the state, and of the energy, at each time; a trajectory counts as far as it came.
pub(crate) struct Summary<'a> {
    heading: Heading<'a>,
    targets: Vec<Target>,
    wanted: Wanted,
    /// Title of the model, and groups of state variables.
    title: String,
    blocks: Vec<Block>,
    /// At each time, those of each quantity.
    gathered: Vec<Vec<Distribution>>,
}

impl<'a> Summary<'a> {
    /// No trajectories yet.
    pub(crate) fn new(
        targets: Vec<Target>,
        heading: &Heading<'a>,
        wanted: Wanted,
        title: String,
        blocks: Vec<Block>,
    ) -> Summary<'a> {
        let n_quantities = heading.info.state.len() + usize::from(heading.info.has_energy);
        let none = vec![Distribution::of(std::iter::empty()); n_quantities];
        let gathered = vec![none; heading.times.len()];
        Summary { heading: heading.clone(), targets, wanted, title, blocks, gathered }
    }

    fn quantities(&self) -> Vec<String> {
        let info = self.heading.info;
        info.state.iter().cloned().chain(info.has_energy.then(|| "energy".to_owned())).collect()
    }

    /// A number for each time and quantity.
    fn each(&self, of: impl Fn(&Distribution) -> Option<f64>) -> Vec<f64> {
        self.gathered.iter().flatten().map(|d| of(d).unwrap_or(f64::NAN)).collect()
    }

    /// A line for each time and quantity; what has no value is empty.
    fn csv(&self) -> String {
        let Wanted { levels, bins, .. } = &self.wanted;
        let mut text = String::from("t,quantity,n,min,max");
        for (statistic, name) in [(Statistic::Mean, ",mean"), (Statistic::Variance, ",variance")] {
            text.push_str(if self.wanted.has(statistic) { name } else { "" });
        }
        if self.wanted.has(Statistic::Quantiles) {
            levels.iter().for_each(|level| text.push_str(&format!(",q{level:?}")));
        }
        if self.wanted.has(Statistic::Histogram) {
            (1..=*bins).for_each(|k| text.push_str(&format!(",h{k}")));
        }
        text.push('\n');
        let quantities = self.quantities();
        for (t, of_time) in self.heading.times.iter().zip(&self.gathered) {
            for (quantity, values) in quantities.iter().zip(of_time) {
                let mut cells: Vec<Option<f64>> = Vec::new();
                let extremes = values.extremes();
                cells.extend([extremes.map(|[min, _]| min), extremes.map(|[_, max]| max)]);
                if self.wanted.has(Statistic::Mean) {
                    cells.push(values.mean());
                }
                if self.wanted.has(Statistic::Variance) {
                    cells.push(values.variance());
                }
                if self.wanted.has(Statistic::Quantiles) {
                    cells.extend(levels.iter().map(|level| values.quantile(*level)));
                }
                if self.wanted.has(Statistic::Histogram) {
                    let shares = values.histogram(*bins).map(|(_, shares)| shares);
                    cells.extend((0..*bins).map(|k| shares.as_ref().map(|s| s[k])));
                }
                let _ = write!(text, "{t:?},{quantity},{}", values.n());
                for cell in cells {
                    text.push(',');
                    let _ = cell.map_or(Ok(()), |x| write!(text, "{x:?}"));
                }
                text.push('\n');
            }
        }
        text
    }

    /// Arrays by name: see `docs/ensembles.md`, which promises them. NaN stands for what has no value.
    fn npz(&self, path: &Path) -> std::io::Result<()> {
        let Wanted { levels, bins, .. } = &self.wanted;
        let quantities = self.quantities();
        let (n_t, n_q) = (self.heading.times.len(), quantities.len());
        let temporary = Temporary::beside(path);
        let mut archive = Archive::new(temporary.path())?;
        archive.numbers("t", &self.heading.times)?;
        archive.texts("quantity_names", &quantities)?;
        let shape = [n_t, n_q];
        archive.array("n", &shape, &self.each(|d| Some(d.n() as f64)))?;
        archive.array("min", &shape, &self.each(|d| d.extremes().map(|[min, _]| min)))?;
        archive.array("max", &shape, &self.each(|d| d.extremes().map(|[_, max]| max)))?;
        if self.wanted.has(Statistic::Mean) {
            archive.array("mean", &shape, &self.each(Distribution::mean))?;
        }
        if self.wanted.has(Statistic::Variance) {
            archive.array("variance", &shape, &self.each(Distribution::variance))?;
        }
        let all = || self.gathered.iter().flatten();
        if self.wanted.has(Statistic::Quantiles) {
            archive.numbers("quantile_levels", levels)?;
            let of = |d: &Distribution| -> Vec<f64> {
                levels.iter().map(|level| d.quantile(*level).unwrap_or(f64::NAN)).collect()
            };
            archive.array(
                "quantiles",
                &[n_t, n_q, levels.len()],
                &all().flat_map(of).collect::<Vec<f64>>(),
            )?;
        }
        if self.wanted.has(Statistic::Histogram) {
            let of = |d: &Distribution| {
                d.histogram(*bins).unwrap_or_else(|| (vec![f64::NAN; bins + 1], vec![f64::NAN; *bins]))
            };
            let (edges, shares): (Vec<Vec<f64>>, Vec<Vec<f64>>) = all().map(of).unzip();
            archive.array("histogram_edges", &[n_t, n_q, bins + 1], &edges.concat())?;
            archive.array("histogram", &[n_t, n_q, *bins], &shares.concat())?;
        }
        archive.finish()?;
        temporary.rename_to(path)
    }

    /// A panel for each quantity: bands between quantiles that lie opposite each other, or of one standard deviation,
    /// and a line in the middle.
    fn figure(&self) -> Figure {
        let info = self.heading.info;
        let mut panels = Vec::new();
        for (at, name) in self.quantities().into_iter().enumerate() {
            let over_time = |of: &dyn Fn(&Distribution) -> Option<f64>| -> Vec<f64> {
                self.gathered.iter().map(|d| of(&d[at]).unwrap_or(f64::NAN)).collect()
            };
            let (mut lines, mut bands) = (Vec::new(), Vec::new());
            if self.wanted.has(Statistic::Quantiles) {
                let mut levels = self.wanted.levels.clone();
                levels.sort_by(f64::total_cmp);
                for (low, high) in levels.iter().zip(levels.iter().rev()).take(levels.len() / 2) {
                    bands.push(Band {
                        low: over_time(&|d| d.quantile(*low)),
                        high: over_time(&|d| d.quantile(*high)),
                    });
                }
                if levels.len() % 2 == 1 {
                    let middle = levels[levels.len() / 2];
                    lines.push((format!("q{middle:?}"), over_time(&|d| d.quantile(middle))));
                }
            } else if self.wanted.has(Statistic::Variance) {
                let away =
                    |sign: f64| over_time(&|d: &Distribution| Some(d.mean()? + sign * d.variance()?.sqrt()));
                bands.push(Band { low: away(-1.0), high: away(1.0) });
            }
            if self.wanted.has(Statistic::Mean) || lines.is_empty() {
                lines.push(("mean".to_owned(), over_time(&Distribution::mean)));
            }
            let of_name = |block: &&Block| block.members.iter().any(|(member, _)| *member == name);
            let (spelled, unit) = match self.blocks.iter().find(of_name) {
                Some(block) => {
                    let member = block.members.iter().find(|(member, _)| *member == name);
                    (member.map_or(name.clone(), |(_, spelled)| spelled.clone()), block.unit.clone())
                }
                None => (name.clone(), String::new()),
            };
            let title = if unit.is_empty() { spelled } else { format!("{spelled} [{unit}]") };
            panels.push(Panel { title, lines, bands, ..Panel::default() });
        }
        let told = if self.wanted.has(Statistic::Quantiles) {
            let levels: Vec<String> = self.wanted.levels.iter().map(|level| format!("{level:?}")).collect();
            format!("bands between the quantiles {}", levels.join(", "))
        } else {
            "bands of one standard deviation".to_owned()
        };
        Figure {
            title: if self.title.is_empty() { info.model.clone() } else { self.title.clone() },
            subtitle: format!("{} · {} trajectories, {told}", info.model, self.heading.n),
            x_label: "t [s]".into(),
            times: self.heading.times.clone(),
            panels,
            ..Figure::default()
        }
    }

    fn write(&self, target: &Target) -> std::io::Result<()> {
        let path = target.path();
        match target.format() {
            Format::Csv => write_atomically(path, self.csv().as_bytes()),
            Format::Npz => self.npz(path),
            Format::Svg => {
                let text = svg(&self.figure()).map_err(|e| std::io::Error::other(e.to_string()))?;
                write_atomically(path, text.as_bytes())
            }
            // Refused with the arguments.
            Format::Zarr => Ok(()),
        }
    }
}

impl Sink for Summary<'_> {
    fn add(&mut self, chunk: &Chunk) -> Result<(), Error> {
        let (heading, n_state) = (&self.heading, self.heading.info.state.len());
        for (at, of_time) in self.gathered.iter_mut().enumerate() {
            for (quantity, gathered) in of_time.iter_mut().enumerate() {
                let value = |member: &Member| {
                    let sample = heading.sample(member, at)?;
                    if quantity < n_state { Some(sample.state[quantity]) } else { sample.energy }
                };
                gathered.merge(Distribution::of(chunk.results.iter().filter_map(value)));
            }
        }
        Ok(())
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        let fail = |target: &Target, e| Error::io(target.path().display().to_string(), e);
        self.targets.iter().try_for_each(|target| self.write(target).map_err(|e| fail(target, e)))
    }
}
