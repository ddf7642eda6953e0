//! Errors of the energy over many steps as a table, a CSV file and a figure.
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

/// Errors of a method on a model after some steps.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Row {
    /// Name of the model.
    pub(crate) model: String,
    /// Name of the method.
    pub(crate) method: String,
    /// Size of the steps.
    pub(crate) h: f64,
    /// Microseconds of a unit of time.
    pub(crate) us: f64,
    /// Steps.
    pub(crate) steps: f64,
    /// Root of the mean square of the relative errors.
    pub(crate) rms: f64,
    /// Their mean.
    pub(crate) mean: f64,
    /// The largest change of another invariant; none where the scene has none.
    pub(crate) invariants: Option<f64>,
}

impl Row {
    /// The row of a line `<method>;<step>;<ns>;<steps>;<rms>;<mean>;<invariants>` about a model.
    pub(super) fn parse(model: &str, line: &str) -> Option<Row> {
        let fields: Vec<&str> = line.split(';').collect();
        let [method, h, ns, steps, rms, mean, invariants] = fields[..] else { return None };
        Some(Row {
            model: model.to_owned(),
            method: method.to_owned(),
            h: h.parse().ok()?,
            us: 1e-3 * ns.parse::<f64>().ok()?,
            steps: steps.parse().ok()?,
            rms: rms.parse().ok()?,
            mean: mean.parse().ok()?,
            invariants: if invariants == "-" { None } else { Some(invariants.parse().ok()?) },
        })
    }
}

/// Steps from which on growth is fitted: fewer leave errors at the spacing of numbers.
const FITTED_FROM: f64 = 1e4;

/// The exponent of the power of the number of steps that errors follow, by least squares of logarithms; none for fewer
/// than two errors.
fn exponent(rows: &[&Row]) -> Option<f64> {
    let points: Vec<[f64; 2]> = rows
        .iter()
        .filter(|r| r.steps >= FITTED_FROM && r.rms > 0.0)
        .map(|r| [r.steps.ln(), r.rms.ln()])
        .collect();
    let n = points.len() as f64;
    let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / n;
    let [x, y] = [mean(0), mean(1)];
    let (mut products, mut squares) = (0.0, 0.0);
    for point in &points {
        products += (point[0] - x) * (point[1] - y);
        squares += (point[0] - x) * (point[0] - x);
    }
    (points.len() > 1).then_some(products / squares)
}

/// All that was measured, and on what.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Where it comes from.
    pub(crate) source: Source,
    /// The measurements, by model, method and steps.
    pub(crate) rows: Vec<Row>,
    /// Other programs, with their versions.
    pub(crate) using: Vec<String>,
    /// What was not measured, and why.
    pub(crate) notes: Vec<String>,
}

impl Report {
    /// The report for a terminal.
    pub(crate) fn text(&self) -> String {
        format!("{}\n{}{}", self.source.text(), self.table().text(), self.others("\n"))
    }

    /// Writes `drift.md`, `drift.csv` and `drift.svg`; the files written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let chart = loglog::svg(&self.chart());
        let chart = chart.map_err(|e| Error::io("the chart", std::io::Error::other(e)))?;
        let files = [("drift.md", self.markdown()), ("drift.csv", self.csv()), ("drift.svg", chart)];
        write_files(folder, files.map(|(name, text)| (name.to_owned(), text)))
    }

    /// What the other programs are, and what was not measured, a line each after some text.
    fn others(&self, before: &str) -> String {
        let using = self.using.iter().map(|package| format!("Beside it: {package}."));
        let notes = self.notes.iter().map(|note| format!("{note}."));
        using.chain(notes).map(|line| format!("{before}{line}\n")).collect()
    }

    /// Values of a part of the rows in the order of measurement, each once.
    fn names<'a>(&'a self, of: impl Fn(&'a Row) -> Option<&'a str>) -> Vec<&'a str> {
        let mut names = Vec::new();
        for name in self.rows.iter().filter_map(of) {
            if !names.contains(&name) {
                names.push(name);
            }
        }
        names
    }

    /// The numbers of steps, ascending.
    fn steps(&self) -> Vec<f64> {
        let mut steps: Vec<f64> = self.rows.iter().map(|r| r.steps).collect();
        steps.sort_by(f64::total_cmp);
        steps.dedup();
        steps
    }

    fn table(&self) -> Table {
        let steps = self.steps();
        let mut head = cells(["model", "method", "step", "us a unit of time"]);
        head.extend(steps.iter().map(|steps| format!("{steps:.0e}")));
        head.extend(cells(["exponent", "invariants"]));
        let mut lines = vec![head];
        for model in self.names(|r| Some(&r.model)) {
            for method in self.names(|r| (r.model == model).then_some(r.method.as_str())) {
                let rows: Vec<&Row> =
                    self.rows.iter().filter(|r| r.model == model && r.method == method).collect();
                let mut line = vec![model.to_owned(), method.to_owned()];
                line.push(number(Some(rows[0].h), 4));
                line.push(number(Some(rows[0].us), 1));
                let at = |steps: &f64| rows.iter().find(|r| r.steps == *steps);
                line.extend(
                    steps.iter().map(|s| at(s).map_or_else(String::new, |r| format!("{:.1e}", r.rms))),
                );
                line.push(number(exponent(&rows), 2));
                let changed = rows.iter().filter_map(|r| r.invariants).reduce(f64::max);
                line.push(changed.map_or_else(String::new, |change| format!("{change:.1e}")));
                lines.push(line);
            }
        }
        Table { lines, n_words: 2 }
    }

    fn markdown(&self) -> String {
        format!(
            "# Energy over long runs\n\n{INTRODUCTION}\n\n{}.\n\n\
             ![Error of the energy against steps](drift.svg)\n\n{}{}",
            self.source.markdown(),
            self.table().markdown(),
            self.others("\n")
        )
    }

    fn csv(&self) -> String {
        let mut text = self.source.csv() + "model,method,step,us,steps,rms,mean,invariants\n";
        for Row { model, method, h, us, steps, rms, mean, invariants } in &self.rows {
            let changed = invariants.map_or_else(String::new, |change| format!("{change:.3e}"));
            let _ = writeln!(text, "{model},\"{method}\",{h},{us:.3},{steps},{rms:.3e},{mean:.3e},{changed}");
        }
        text
    }

    /// A curve for each method: the geometric mean over the models that have as many steps.
    fn chart(&self) -> LogLog {
        let curve = |method: &str| {
            let mean = |steps: f64| {
                let rows = self.rows.iter().filter(|r| r.method == method && r.steps == steps && r.rms > 0.0);
                let logarithms: Vec<f64> = rows.map(|r| r.rms.ln()).collect();
                [steps, (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp()]
            };
            let points = self.steps().into_iter().map(mean).filter(|point| point[1].is_finite());
            Curve { name: method.to_owned(), broken: false, points: points.collect() }
        };
        LogLog {
            title: "Relative error of the energy".into(),
            subtitle: "root mean square of the runs, geometric mean of the models".into(),
            labels: ["steps".into(), "error".into()],
            curves: self.names(|r| Some(&r.method)).into_iter().map(curve).collect(),
        }
    }
}

const INTRODUCTION: &str = "\
Relative errors of the energy after many steps: root of the mean square over four runs, which start at four points of
the first motion of the reference files. The energy is that of the state as it is stored, computed with 31 digits. Every
method takes half the longest power of two with which it meets the end of that motion to 3e-14, `gauss16, short steps` an
eighth; `taylor` chooses steps for an absolute tolerance of 2^-52, and its column has their mean. Times are those of one core that
other work shares; a scene that is projected carries the attitude as well where the others do not. `gauss16, short steps`
and the methods at the end of a Lie-Poisson system make the number of steps that the command says, the others a tenth.

Compositions of exact flows (`splitting4`, `splitting6`) move free_rigid_body, heavy_top and kirchhoff_body in momenta,
from other points, with steps of 1/16, and so does `gauss16, momenta`. `projected` puts `splitting6` onto the Casimirs
after every step, and not onto the energy, of which such steps conserve a nearby one. The last column is the largest
change of another invariant over all of the run (Casimirs, momenta in space, lengths of carried vectors), relative to one
and its value, for scenes that have such. `heyoka` chooses its steps at the default tolerance and was given the
equations by hand; its times are of calls from Python, a step each. IAS15 of rebound integrates accelerations of
particles and cannot be given these systems.

Round-off that adds up as a random walk has the exponent 1/2 (Brouwer's law), a drift has 1, errors that are kept small
have 0. The exponent is fitted from 1e4 steps on; four runs leave it uncertain by about 0.2. The first five models are
Hamiltonian, where symplectic methods keep a nearby energy; the others have nonholonomic constraints, where none is
promised, and their motions are reversible.";

#[cfg(test)]
mod tests {
    use super::{Report, Row};
    use crate::bench::source::Source;

    #[test]
    fn lines_become_a_table_and_curves() {
        let lines = [
            ("top", "gauss16;0.125;4000;1000;1e-16;1e-17;-"),
            ("top", "gauss16;0.125;4000;10000;2e-16;1e-17;3e-15"),
            ("top", "gauss16;0.125;4000;1000000;2e-15;1e-17;2e-15"),
            ("top", "vern9, projected;0.0625;8000;1000;1e-16;1e-17;-"),
            ("disk", "gauss16;0.25;2000;1000;4e-16;1e-17;-"),
        ];
        let rows = lines.map(|(model, line)| Row::parse(model, line).unwrap_or_else(|| panic!("{line}")));
        let report = Report {
            source: Source::of_test("bench drift"),
            rows: rows.to_vec(),
            using: vec!["other 1.0".into()],
            notes: vec![],
        };
        let text = report.text();
        let line = ["top", "gauss16", "0.1250", "4.0", "1.0e-16", "2.0e-16", "2.0e-15", "0.50", "3.0e-15"];
        assert!(text.lines().any(|l| l.split_whitespace().eq(line)), "{text}");
        assert!(text.ends_with("\nBeside it: other 1.0.\n"), "{text}");
        let chart = report.chart();
        let names: Vec<&str> = chart.curves.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["gauss16", "vern9, projected"]);
        assert!((chart.curves[0].points[0][1] - 2e-16).abs() < 1e-20, "{:?}", chart.curves[0].points);
        assert_eq!(Row::parse("top", "gauss16;0.125"), None);
    }
}
