//! Steps of fluids as tables, a CSV file and a figure.
//!
//! No dates and no paths are written: the command, the processor and the compiler say where numbers come from.
//!
//! Does not know: how anything was measured.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use hamel::output::plot::loglog::{self, Curve, LogLog};
use hamel_run::Error;

use super::source::Source;
use super::table::{Table, cells, number, write_files};

/// What was measured of one size.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    /// `sphere` or `torus`.
    pub(crate) surface: String,
    /// Size of the matrices.
    pub(crate) n: usize,
    /// By what.
    pub(crate) by: String,
    /// Microseconds of a step.
    pub(crate) us: f64,
    /// Iterations of a step; NaN where they are not counted.
    pub(crate) iterations: f64,
    /// Distance from the reference after 16 steps, relative.
    pub(crate) error: f64,
    /// Largest drift of a Casimir.
    pub(crate) drift: f64,
}

impl Row {
    /// The row of a line `<surface>;<n>;<by>;<ns>;<iterations>;<error>;<drift>`.
    pub(super) fn parse(line: &str) -> Option<Row> {
        let fields: Vec<&str> = line.split(';').collect();
        let [surface, n, by, ns, iterations, error, drift] = fields[..] else { return None };
        Some(Row {
            surface: surface.to_owned(),
            n: n.parse().ok()?,
            by: by.to_owned(),
            us: 1e-3 * ns.parse::<f64>().ok()?,
            iterations: iterations.parse().ok()?,
            error: error.parse().ok()?,
            drift: drift.parse().ok()?,
        })
    }
}

/// A long run on the torus with `N = 7`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Long {
    /// Steps.
    pub(crate) steps: u32,
    /// Their size.
    pub(crate) h: f64,
    /// Largest drift of a Casimir.
    pub(crate) drift: f64,
}

impl Long {
    /// The run of a line `<steps>;<step>;<drift>`.
    pub(super) fn parse(line: &str) -> Option<Long> {
        let fields: Vec<&str> = line.split(';').collect();
        let [steps, h, drift] = fields[..] else { return None };
        Some(Long { steps: steps.parse().ok()?, h: h.parse().ok()?, drift: drift.parse().ok()? })
    }
}

/// All that was measured, and on what.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Where it comes from.
    pub(crate) source: Source,
    /// The measurements, those of each program from small to large.
    pub(crate) rows: Vec<Row>,
    /// The long runs.
    pub(crate) long: Vec<Long>,
    /// Packages of other programs, with versions.
    pub(crate) using: Vec<String>,
    /// What could not be measured, and why.
    pub(crate) notes: Vec<String>,
}

impl Report {
    /// The report for a terminal.
    pub(crate) fn text(&self) -> String {
        let mut text = self.source.text();
        for surface in ["sphere", "torus"] {
            let _ = write!(text, "\n{surface}\n\n{}", self.steps(surface).text());
        }
        let _ = write!(text, "\nlong runs\n\n{}", self.runs().text());
        for note in &self.notes {
            let _ = write!(text, "\nnote: {note}\n");
        }
        text
    }

    /// Writes `fluids.md`, `fluids.csv` and `fluids.svg`; the files written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let chart = loglog::svg(&self.chart());
        let chart = chart.map_err(|e| Error::io("the chart", std::io::Error::other(e)))?;
        let files = [("fluids.md", self.markdown()), ("fluids.csv", self.csv()), ("fluids.svg", chart)];
        write_files(folder, files.map(|(name, text)| (name.to_owned(), text)))
    }

    /// The names of the programs on a surface, in the order of measurement.
    fn programs(&self, surface: &str) -> Vec<&str> {
        let mut programs: Vec<&str> = Vec::new();
        for row in self.rows.iter().filter(|r| r.surface == surface) {
            if !programs.contains(&row.by.as_str()) {
                programs.push(&row.by);
            }
        }
        programs
    }

    /// All programs at each size, the slowest of them in units of each.
    fn steps(&self, surface: &str) -> Table {
        let head = ["N", "by", "us a step", "iterations", "error", "Casimirs", "slowest/this"];
        let mut lines = vec![cells(head)];
        let rows: Vec<&Row> = self.rows.iter().filter(|r| r.surface == surface).collect();
        let mut sizes: Vec<usize> = rows.iter().map(|r| r.n).collect();
        sizes.sort_unstable();
        sizes.dedup();
        for n in sizes {
            let of_size: Vec<&&Row> = rows.iter().filter(|r| r.n == n).collect();
            let slowest = of_size.iter().map(|r| r.us).fold(0.0, f64::max);
            for row in of_size {
                lines.push(vec![
                    n.to_string(),
                    row.by.clone(),
                    number(Some(row.us), if row.us < 100.0 { 2 } else { 0 }),
                    number(Some(row.iterations), 1),
                    format!("{:.1e}", row.error),
                    format!("{:.0e}", row.drift),
                    number(Some(slowest / row.us), 1),
                ]);
            }
        }
        Table { lines, n_words: 2 }
    }

    fn runs(&self) -> Table {
        let mut lines = vec![cells(["steps", "step", "Casimirs"])];
        for Long { steps, h, drift } in &self.long {
            lines.push(vec![steps.to_string(), format!("{h:.3}"), format!("{drift:.0e}")]);
        }
        Table { lines, n_words: 0 }
    }

    fn markdown(&self) -> String {
        let mut text = format!(
            "# Fluids as matrices\n\n{INTRODUCTION}\n\n{}{}.\n\n\
             ![Time of a step against N](fluids.svg)\n\n## Sphere\n\n{}\n## Torus\n\n{}\n{LONG}\n\n{}",
            self.source.markdown(),
            self.using.iter().map(|u| format!(", {u}")).collect::<String>(),
            self.steps("sphere").markdown(),
            self.steps("torus").markdown(),
            self.runs().markdown()
        );
        for note in &self.notes {
            let _ = write!(text, "\nNote: {note}.\n");
        }
        text
    }

    fn csv(&self) -> String {
        let mut text = self.source.csv() + "surface,n,by,us,iterations,error,drift\n";
        for Row { surface, n, by, us, iterations, error, drift } in &self.rows {
            let iterations = number(Some(*iterations), 2);
            let _ = writeln!(text, "{surface},{n},\"{by}\",{us:.3},{iterations},{error:.3e},{drift:.1e}");
        }
        text
    }

    fn chart(&self) -> LogLog {
        let mut curves = Vec::new();
        for surface in ["sphere", "torus"] {
            for by in self.programs(surface) {
                let rows = self.rows.iter().filter(|r| r.surface == surface && r.by == by);
                // A comma ends what there is room for in the legend.
                let short = by.split(',').next().unwrap_or(by);
                curves.push(Curve {
                    name: format!("{surface}, {short}"),
                    broken: !by.starts_with("hamel"),
                    points: rows.map(|r| [r.n as f64, r.us]).collect(),
                });
            }
        }
        LogLog {
            title: "Time of a step against the size of the matrices".into(),
            subtitle: self.source.machine(),
            labels: ["N".into(), "microseconds".into()],
            curves,
        }
    }
}

const INTRODUCTION: &str = "\
Steps of the isospectral midpoint rule on one core: `IsospectralMidpoint` of `hamel-runtime`, iterated to round-off
(`hamel`) and until the vorticity changes by less than a part of it (`hamel to 1e-8`, `hamel to 1e-7`). A flow has random
spherical harmonics up to the degree 10, or waves up to the length 10, and a step of a tenth of pi over the norm of the
stream matrix, which is what quflow's `estimate_stepsize` gives; time is the mean of 16 steps or more in the fastest
round, iterations those of all rounds. The error is the distance after 16 steps from the same method with steps of a
sixteenth, relative: that of the method, the same for all. Casimirs: the largest change of `tr W^k/N`, `k = 2, .., 5`, in
units of `(tr W^2/N)^(k/2)`, after 1000 steps (100 for `N > 64`).

* **numpy, the method of quflow's isomp_fixedpoint** (with `--peers`): written anew in Python with numpy's BLAS and numba,
  with quflow's start, tolerance (`sqrt(eps) dt/hbar |W|`, of the order of 1e-8) and limit of ten iterations; one thread.
* **quflow** (with `--peers`, where it is installed): its own `isomp_fixedpoint`, without further options; one thread.";

const LONG: &str = "\
Drift of the Casimirs on the torus with `N = 7`, iterated to round-off:";

#[cfg(test)]
mod tests {
    use super::{Long, Report, Row};
    use crate::bench::source::Source;

    #[test]
    fn lines_become_tables_and_curves() {
        let rows = [
            "sphere;5;hamel;2000;9.5;1e-4;1e-16",
            "sphere;7;hamel;4000;9.5;1e-4;1e-16",
            "torus;7;hamel;4000;9.5;1e-4;1e-16",
            "sphere;5;numpy, a method;40000;NaN;1e-4;1e-9",
        ];
        let report = Report {
            source: Source::of_test("bench fluids"),
            rows: rows.map(|line| Row::parse(line).unwrap_or_else(|| panic!("{line}"))).to_vec(),
            long: vec![Long::parse("1000000;0.05;1e-14").expect("a run")],
            using: Vec::new(),
            notes: Vec::new(),
        };
        let text = report.text();
        assert!(
            text.lines()
                .any(|l| l.split_whitespace().eq(["5", "hamel", "2.00", "9.5", "1.0e-4", "1e-16", "20.0"]))
        );
        assert!(text.contains("1000000  0.050     1e-14"), "{text}");
        let names: Vec<String> = report.chart().curves.into_iter().map(|c| c.name).collect();
        assert_eq!(names, ["sphere, hamel", "sphere, numpy", "torus, hamel"]);
        assert_eq!(Row::parse("sphere;5;hamel"), None);
    }
}
