//! Statistics of an ensemble, gathered while trajectories come and go: CSV, NPZ, and a figure of fans.
//!
//! Does not know: how trajectories were computed, how statistics are gathered.

use std::fmt::Write as _;
use std::path::Path;

use super::chunk::{Chunk, Heading, Sink};
use super::gathered::{Gathered, Pile, Statistic, Table, Wanted, quantities};
use super::npz::Archive;
use super::target::{Format, Target};
use crate::output::opened::Opened;
use crate::output::plot::{Band, Figure, Panel, svg};
use hamel_run::error::Error;
use hamel_run::model::blocks::Block;
use hamel_run::statistics::Distribution;

/// Statistics of each component of the state, and of the energy, at each time; a trajectory counts as far as it came.
pub(crate) struct Summary<'a> {
    heading: Heading<'a>,
    files: Vec<(Format, Opened)>,
    wanted: Wanted,
    /// Title of the model, and groups of state variables.
    title: String,
    blocks: Vec<Block>,
    pile: Pile,
}

impl<'a> Summary<'a> {
    /// No trajectories yet, and files that are open.
    ///
    /// # Errors
    /// As [`Opened::new`].
    pub(crate) fn new(
        targets: &[Target],
        heading: &Heading<'a>,
        wanted: Wanted,
        title: String,
        blocks: Vec<Block>,
    ) -> Result<Summary<'a>, Error> {
        // A store has statistics of its own.
        let files = targets.iter().filter(|target| target.format() != Format::Zarr);
        let files = files.map(|target| Ok((target.format(), Opened::new(target.path())?)));
        let files = files.collect::<Result<_, Error>>()?;
        Ok(Summary { heading: heading.clone(), files, wanted, title, blocks, pile: Pile::default() })
    }

    /// A line for each time and quantity; what has no value is empty.
    fn csv(&self, gathered: &Gathered) -> String {
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
        let quantities = quantities(&self.heading);
        for (t, of_time) in self.heading.times.iter().zip(gathered.at_times()) {
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
    fn npz(&self, path: &Path, gathered: &Gathered) -> std::io::Result<()> {
        let quantities = quantities(&self.heading);
        let (n_t, n_q) = (self.heading.times.len(), quantities.len());
        let mut archive = Archive::new(path)?;
        archive.numbers("t", &self.heading.times)?;
        archive.texts("quantity_names", &quantities)?;
        for table in self.wanted.tables() {
            if table == Table::Quantiles {
                archive.numbers("quantile_levels", &self.wanted.levels)?;
            }
            let mut shape = vec![n_t, n_q];
            shape.extend(table.axis(&self.wanted).map(|(_, n)| n));
            archive.array(table.name(), &shape, &gathered.table(table, &self.wanted))?;
        }
        archive.finish()
    }

    /// A panel for each quantity: bands between quantiles that lie opposite each other, or of one standard deviation,
    /// and a line in the middle.
    fn figure(&self, gathered: &Gathered) -> Figure {
        let info = self.heading.info;
        let mut panels = Vec::new();
        for (at, name) in quantities(&self.heading).into_iter().enumerate() {
            let over_time = |of: &dyn Fn(&Distribution) -> Option<f64>| -> Vec<f64> {
                gathered.at_times().iter().map(|d| of(&d[at]).unwrap_or(f64::NAN)).collect()
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

    fn write(&self, format: Format, file: Opened, gathered: &Gathered) -> Result<(), Error> {
        let path = file.path().display().to_string();
        match format {
            Format::Csv => file.write(self.csv(gathered).as_bytes()),
            Format::Npz => {
                self.npz(file.temporary(), gathered).map_err(|e| Error::io(path, e))?;
                file.place()
            }
            Format::Figure(picture) => picture.write(file, svg(&self.figure(gathered))),
            Format::Zarr => Ok(()),
        }
    }
}

impl Sink for Summary<'_> {
    fn add(&mut self, chunk: &Chunk) -> Result<(), Error> {
        self.pile.add(Gathered::of(chunk, &self.heading));
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<(), Error> {
        let gathered = std::mem::take(&mut self.pile).all().unwrap_or_else(|| Gathered::none(&self.heading));
        let files = std::mem::take(&mut self.files);
        files.into_iter().try_for_each(|(format, file)| self.write(format, file, &gathered))
    }
}
