//! Generation, compilation and evaluation against the size of systems: a table, a CSV file and a figure.
//!
//! No dates and no paths are written: the command, the processor and the compiler say where numbers come from.
//!
//! Does not know: how anything was measured.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use hamel::output::plot::loglog::{self, Curve, LogLog};
use hamel_run::Error;

use super::chains::Chains;
use super::family::{Family, Row};
use super::source::Source;
use super::table::{Table, cells, exponent, number, write_files};

/// All that was measured, and on what.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Where it comes from.
    pub(crate) source: Source,
    /// The measurements, each family from small to large.
    pub(crate) rows: Vec<Row>,
    /// The chains of bodies.
    pub(crate) chains: Chains,
}

impl Report {
    /// The report for a terminal.
    pub(crate) fn text(&self) -> String {
        let (measured, growth) = (self.measured().text(), self.growth().text());
        let chains = self.chains.text();
        format!("{}\n{measured}\n{GROWTH}:\n\n{growth}\n{chains}\n", self.source.text())
    }

    /// Writes `scaling.md`, `scaling.csv` and `scaling.svg`, and the latter two of the chains; the files written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let drawn =
            |chart: &LogLog| loglog::svg(chart).map_err(|e| Error::io("the chart", std::io::Error::other(e)));
        let files = [
            ("scaling.md", self.markdown()),
            ("scaling.csv", self.csv()),
            ("scaling.svg", drawn(&self.chart())?),
            ("scaling_chains.csv", self.chains.csv(&self.source)),
            ("scaling_chains.svg", drawn(&self.chains.chart(&self.source))?),
        ];
        write_files(folder, files.map(|(name, text)| (name.to_owned(), text)))
    }

    fn of(&self, family: Family) -> Vec<&Row> {
        self.rows.iter().filter(|r| r.family == family).collect()
    }

    fn measured(&self) -> Table {
        let mut lines = vec![cells([
            "system",
            "dim",
            "operations of rhs",
            "all operations",
            "generation ms",
            "lines",
            "rustc ms",
            "ns a call",
        ])];
        for row in &self.rows {
            lines.push(vec![
                row.family.name().to_owned(),
                row.dim.to_string(),
                row.operations.to_string(),
                row.all_operations.to_string(),
                number(Some(milliseconds(row.generation)), 0),
                row.lines.to_string(),
                number(Some(milliseconds(row.rustc)), 0),
                number(Some(row.ns), 1),
            ]);
        }
        Table { lines, n_words: 1 }
    }

    fn growth(&self) -> Table {
        let mut lines = vec![cells(["system", "generation", "rustc", "ns a call"])];
        for family in Family::ALL {
            let rows = self.of(family);
            let of = |value: &dyn Fn(&Row) -> f64| {
                number(exponent(rows.iter().map(|r| [r.all_operations as f64, value(r)])), 2)
            };
            let ns = number(exponent(rows.iter().map(|r| [r.operations as f64, r.ns])), 2);
            lines.push(vec![
                family.name().to_owned(),
                of(&|r| r.generation.as_secs_f64()),
                of(&|r| r.rustc.as_secs_f64()),
                ns,
            ]);
        }
        Table { lines, n_words: 1 }
    }

    fn markdown(&self) -> String {
        format!(
            "# Scaling\n\n{INTRODUCTION}\n\n{}.\n\n![Time against operations](scaling.svg)\n\n{}\n\
             {GROWTH}:\n\n{}\n{}",
            self.source.markdown(),
            self.measured().markdown(),
            self.growth().markdown(),
            self.chains.markdown()
        )
    }

    fn csv(&self) -> String {
        let mut text = format!(
            "{}system,dim,operations,all_operations,generation_ms,lines,rustc_ms,ns\n",
            self.source.csv()
        );
        for r in &self.rows {
            let (generation, rustc) = (milliseconds(r.generation), milliseconds(r.rustc));
            let _ = writeln!(
                text,
                "\"{}\",{},{},{},{generation:.1},{},{rustc:.1},{:.2}",
                r.family.name(),
                r.dim,
                r.operations,
                r.all_operations,
                r.lines,
                r.ns
            );
        }
        text
    }

    fn chart(&self) -> LogLog {
        let curve = |family: Family, what: &str, broken: bool, time: fn(&Row) -> Duration| Curve {
            name: format!("{}, {what}", family.name()),
            broken,
            points: self
                .of(family)
                .iter()
                .map(|r| [r.all_operations as f64, milliseconds(time(r))])
                .collect(),
        };
        let generation = Family::ALL.into_iter().map(|f| curve(f, "generation", false, |r| r.generation));
        let rustc = Family::ALL.into_iter().map(|f| curve(f, "rustc", true, |r| r.rustc));
        LogLog {
            title: "Time against the size of the program".into(),
            subtitle: self.source.machine(),
            labels: ["operations of all functions".into(), "milliseconds".into()],
            curves: generation.chain(rustc).collect(),
        }
    }
}

fn milliseconds(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

const GROWTH: &str = "\
Exponents p of time = c operations^p over the larger half of each family (generation and rustc: operations of all functions)";

const INTRODUCTION: &str = "\
Synthetic systems of growing dimension: free motions with metrics that depend on parameters. `so(n)` and `su(n)` have a
diagonal metric, `nilpotent` are strictly upper triangular matrices, `by stages` along their lower central series, and the
dense metric couples all velocities. Generation goes from the text of the model to the text of the module, with energy and
momenta. rustc compiles the module and a small program around it with `opt-level=3`, linking included. All times are those
of the fastest of some rounds; a call is one right-hand side.";

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Report, exponent};
    use crate::bench::chains::Chains;
    use crate::bench::family::{Family, Row};
    use crate::bench::source::Source;

    fn report() -> Report {
        let row = |dim: usize| Row {
            family: Family::Chain,
            dim,
            operations: 2 * dim,
            all_operations: 3 * dim,
            generation: Duration::from_millis((dim * dim) as u64),
            lines: 10 * dim,
            rustc: Duration::from_millis(4 * dim as u64),
            ns: dim as f64,
        };
        let rows = [8, 16, 32].map(row).to_vec();
        Report { source: Source::of_test("bench scaling"), rows, chains: Chains::default() }
    }

    #[test]
    fn powers_are_found() {
        let p = exponent([[1.0, 5.0], [2.0, 12.0], [4.0, 48.0]].into_iter());
        assert!((p.unwrap() - 2.0).abs() < 1e-12, "{p:?}");
        assert_eq!(exponent([[1.0, 5.0]].into_iter()), None);
        let line = report().growth().text().lines().find(|l| l.contains("stages")).unwrap().to_owned();
        let cells: Vec<&str> = line.split_whitespace().collect();
        assert_eq!(cells.last_chunk(), Some(&["2.00", "1.00", "1.00"]), "{line}");
    }

    #[test]
    fn every_csv_line_has_all_columns_outside_quotes() {
        let text = report().csv();
        let lines: Vec<&str> = text.lines().filter(|l| !l.starts_with('#')).collect();
        assert_eq!(lines.len(), 4);
        assert!(lines.iter().all(|l| l.split(',').count() == 8), "{text}");
    }

    #[test]
    fn both_times_of_every_family_are_curves() {
        let chart = report().chart();
        assert_eq!(chart.curves.len(), 2 * Family::ALL.len());
        assert_eq!(chart.curves.iter().map(|c| c.points.len()).sum::<usize>(), 6);
    }
}
