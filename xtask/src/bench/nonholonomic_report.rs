//! Errors of nonholonomic integration as tables, a CSV file and a figure for each case.
//!
//! No dates and no paths are written: the command, the processor and the compiler say where numbers come from.
//!
//! Does not know: how anything was measured.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use hamel::output::plot::loglog::{self, Curve, LogLog};
use hamel_run::Error;

use super::source::Source;
use super::table::{Table, cells, write_files};

/// What was measured of a method with one size of steps, or tolerance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    /// Name of the method.
    pub(crate) method: String,
    /// `step` or `tolerance`.
    pub(crate) knob: String,
    /// Its value.
    pub(crate) value: f64,
    /// Error of the state at the end of the short motion.
    pub(crate) error: f64,
    /// Evaluations in a unit of time.
    pub(crate) evals: f64,
    /// Microseconds of a unit of time.
    pub(crate) us: f64,
    /// The long run; nothing where it did not reach its end.
    pub(crate) run: Option<Run>,
}

/// Errors along a long run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Run {
    /// Its length.
    pub(crate) t: f64,
    /// Largest relative error of the energy.
    pub(crate) energy: f64,
    /// What the fitted line rises by over the run.
    pub(crate) trend: f64,
    /// Largest residual of the constraint, where it can be violated.
    pub(crate) constraint: Option<f64>,
}

impl Row {
    /// The row of a line
    /// `<method>;<knob>;<value>;<error>;<evals>;<ns>;<t>;<energy>;<trend>;<constraint>`.
    pub(super) fn parse(line: &str) -> Option<Row> {
        let fields: Vec<&str> = line.split(';').collect();
        let [method, knob, value, error, evals, ns, t, energy, trend, constraint] = fields[..] else {
            return None;
        };
        let run = if t == "-" {
            None
        } else {
            let constraint = if constraint == "-" { None } else { Some(constraint.parse().ok()?) };
            Some(Run {
                t: t.parse().ok()?,
                energy: energy.parse().ok()?,
                trend: trend.parse().ok()?,
                constraint,
            })
        };
        Some(Row {
            method: method.to_owned(),
            knob: knob.to_owned(),
            value: value.parse().ok()?,
            error: error.parse().ok()?,
            evals: evals.parse().ok()?,
            us: 1e-3 * ns.parse::<f64>().ok()?,
            run,
        })
    }
}

/// A model with values of its parameters.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Case {
    /// Name of the model, and of the scene of its file.
    pub(crate) name: String,
    /// Title of the model.
    pub(crate) doc: String,
    /// The measurements.
    pub(crate) rows: Vec<Row>,
}

/// All that was measured, and on what.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Where it comes from.
    pub(crate) source: Source,
    /// Steps of each run.
    pub(crate) steps: u64,
    /// The cases.
    pub(crate) cases: Vec<Case>,
}

/// Errors of the energy to which costs are told.
const ENERGIES: [f64; 3] = [1e-4, 1e-8, 1e-12];
/// The step, and the tolerance, at which errors are told.
const STEP: f64 = 0.0625;
const TOLERANCE: f64 = 1e-8;

/// Runs of rows of one method.
fn by_method(rows: &[Row]) -> Vec<&[Row]> {
    rows.chunk_by(|a, b| a.method == b.method).collect()
}

/// The least number of evaluations in a unit of time with which the error of the energy stays within a bound.
fn least(rows: &[Row], bound: f64) -> Option<f64> {
    let within = rows.iter().filter(|r| r.run.is_some_and(|run| run.energy <= bound)).map(|r| r.evals);
    within.reduce(f64::min)
}

fn small(x: Option<f64>) -> String {
    x.map_or_else(|| "-".to_owned(), |x| format!("{x:.1e}"))
}

impl Case {
    fn table(&self) -> Table {
        let mut head = cells(["method"]);
        head.extend(ENERGIES.map(|energy| format!("{energy:e}")));
        head.extend(cells(["at 8", "energy", "trend", "constraint"]));
        let mut lines = vec![head];
        for rows in by_method(&self.rows) {
            let mut line = vec![rows[0].method.clone()];
            let told_evals = |evals: f64| format!("{evals:.0}");
            line.extend(ENERGIES.map(|e| least(rows, e).map_or_else(|| "-".to_owned(), told_evals)));
            let told = rows.iter().find(|r| r.value == if r.knob == "step" { STEP } else { TOLERANCE });
            let run = told.and_then(|row| row.run);
            line.push(small(told.map(|row| row.error)));
            line.push(small(run.map(|run| run.energy)));
            line.push(small(run.map(|run| run.trend)));
            line.push(small(run.and_then(|run| run.constraint)));
            lines.push(line);
        }
        Table { lines, n_words: 1 }
    }

    /// A curve for each method: the error of the energy against evaluations.
    fn chart(&self, steps: u64) -> LogLog {
        let curve = |rows: &[Row]| {
            let points = rows.iter().filter_map(|r| Some([r.evals, r.run?.energy]));
            let broken = rows[0].method.contains("all velocities");
            Curve { name: rows[0].method.clone(), broken, points: points.collect() }
        };
        LogLog {
            title: format!("{}: error of the energy over {steps:e} steps", self.name.replace('_', " ")),
            subtitle: "largest relative error of each run; sizes of steps, or tolerances, along a curve"
                .into(),
            labels: ["evaluations in a unit of time".into(), "error".into()],
            curves: by_method(&self.rows).into_iter().map(curve).collect(),
        }
    }
}

impl Report {
    /// The report for a terminal.
    pub(crate) fn text(&self) -> String {
        let mut text = self.source.text();
        for case in &self.cases {
            let _ = write!(text, "\n{}\n\n{}", case.name, case.table().text());
        }
        text
    }

    /// Writes `nonholonomic.md`, `nonholonomic.csv` and `nonholonomic_<case>.svg`; the files written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let mut files = vec![
            ("nonholonomic.md".to_owned(), self.markdown()),
            ("nonholonomic.csv".to_owned(), self.csv()),
        ];
        for case in &self.cases {
            let chart = loglog::svg(&case.chart(self.steps));
            let chart = chart.map_err(|e| Error::io("the chart", std::io::Error::other(e)))?;
            files.push((format!("nonholonomic_{}.svg", case.name), chart));
        }
        write_files(folder, files)
    }

    fn markdown(&self) -> String {
        let mut text = format!("{INTRODUCTION}\n## Tables\n\n{}.\n", self.source.markdown());
        for case in &self.cases {
            let _ = write!(
                text,
                "\n### {}\n\n{}.\n\n![Error of the energy against cost](nonholonomic_{}.svg)\n\n{}",
                case.name.replace('_', " "),
                case.doc,
                case.name,
                case.table().markdown()
            );
        }
        text
    }

    fn csv(&self) -> String {
        let mut text = self.source.csv();
        text += "case,method,knob,value,error_at_8,evals_per_time,us_per_time,t,energy,trend,constraint\n";
        for case in &self.cases {
            for Row { method, knob, value, error, evals, us, run } in &case.rows {
                let _ = write!(
                    text,
                    "{},\"{method}\",{knob},{value:e},{error:.3e},{evals:.3},{us:.3}",
                    case.name
                );
                let _ = match run {
                    Some(Run { t, energy, trend, constraint }) => {
                        let constraint = constraint.map_or_else(String::new, |c| format!("{c:.3e}"));
                        writeln!(text, ",{t:.3},{energy:.3e},{trend:.3e},{constraint}")
                    }
                    None => writeln!(text, ",,,,"),
                };
            }
        }
        text
    }
}

const INTRODUCTION: &str = include_str!("nonholonomic_introduction.md");

#[cfg(test)]
mod tests {
    use super::{Case, Report, Row};
    use crate::bench::source::Source;

    #[test]
    fn lines_become_a_table_and_curves() {
        let lines = [
            "dla;step;0.25;1e-3;80;4000;25000;2e-3;1e-5;1e-15",
            "dla;step;0.0625;1e-4;320;16000;6250;5e-5;1e-7;2e-15",
            "gauss16;step;0.0625;1e-14;900;90000;6250;1e-15;1e-17;-",
            "rk4;step;0.0625;1e-5;64;1000;-;-;-;-",
        ];
        let rows = lines.map(|line| Row::parse(line).unwrap_or_else(|| panic!("{line}"))).to_vec();
        let case = Case { name: "knife_edge".into(), doc: "Knife edge".into(), rows };
        let report =
            Report { source: Source::of_test("bench nonholonomic"), steps: 100_000, cases: vec![case] };
        let text = report.text();
        let has = |words: &[&str]| text.lines().any(|l| l.split_whitespace().eq(words.iter().copied()));
        assert!(has(&["dla", "320", "-", "-", "1.0e-4", "5.0e-5", "1.0e-7", "2.0e-15"]), "{text}");
        assert!(has(&["gauss16", "900", "900", "900", "1.0e-14", "1.0e-15", "1.0e-17", "-"]), "{text}");
        assert!(has(&["rk4", "-", "-", "-", "1.0e-5", "-", "-", "-"]), "{text}");
        let chart = report.cases[0].chart(report.steps);
        assert_eq!(chart.curves.iter().map(|c| c.points.len()).collect::<Vec<_>>(), [2, 1, 0]);
        assert!(
            report.csv().ends_with("knife_edge,\"rk4\",step,6.25e-2,1.000e-5,64.000,1.000,,,,\n"),
            "{}",
            report.csv()
        );
        assert_eq!(Row::parse("dla;step;0.25"), None);
    }
}
