//! Work and precision as tables, a CSV file and a figure for each model, and one page with all of them.
//!
//! No dates and no paths are written: the command, the processor and the compiler say where numbers come from.
//!
//! Does not know: how anything was measured.

use std::collections::BTreeSet;
use std::fmt::{self, Write as _};
use std::path::{Path, PathBuf};

use hamel::output::plot::loglog::{self, Curve, LogLog};
use hamel_run::Error;

use super::point::{Point, fastest};
use super::source::Source;
use super::table::{Table, cells, number, write_files};

/// A trajectory of a model.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Run {
    /// Name of the model.
    pub(crate) model: String,
    /// Number of the trajectory in the reference file, from one on.
    pub(crate) k: usize,
}

impl Run {
    /// The name of its files.
    fn file(&self) -> String {
        if self.k == 1 { format!("wp_{}", self.model) } else { format!("wp_{}_{}", self.model, self.k) }
    }
}

impl fmt::Display for Run {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}, trajectory {}", self.model, self.k)
    }
}

/// All that was measured, and on what.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Where it comes from.
    pub(crate) source: Source,
    /// Trajectories with their measurements.
    pub(crate) runs: Vec<(Run, Vec<Point>)>,
    /// What could not be measured, and why.
    pub(crate) notes: Vec<String>,
}

/// The errors at which methods are compared.
const ERRORS: [f64; 3] = [1e-6, 1e-9, 1e-12];

/// Runs of points of the same solver, in the order of measurement.
fn by_solver(points: &[Point]) -> Vec<&[Point]> {
    points.chunk_by(|a, b| a.by == b.by && a.method == b.method).collect()
}

impl Report {
    /// The report for a terminal.
    pub(crate) fn text(&self) -> String {
        let mut text =
            format!("{}\n{}\n{}", self.source.text(), self.best().text(), self.side_by_side().text());
        for (run, points) in &self.runs {
            let _ = write!(text, "\n{run}: microseconds to an error of at most\n\n{}", times(points).text());
        }
        for note in &self.notes {
            let _ = write!(text, "\nnote: {note}\n");
        }
        text
    }

    /// Writes `wp.md`, `wp.html`, and `wp_<model>.csv` and `wp_<model>.svg` for each model; the files written.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, folder: &Path) -> Result<Vec<PathBuf>, Error> {
        let mut files = vec![("wp.md".to_owned(), self.markdown())];
        let mut charts = Vec::new();
        for (run, points) in &self.runs {
            let chart = loglog::svg(&self.chart(run, points));
            let chart = chart.map_err(|e| Error::io("the chart", std::io::Error::other(e)))?;
            files.push((format!("{}.csv", run.file()), self.csv(points)));
            files.push((format!("{}.svg", run.file()), chart.clone()));
            charts.push(chart);
        }
        files.push(("wp.html".to_owned(), self.html(&charts)));
        write_files(folder, files)
    }

    /// The best method at each error and its ratio to the best opponent; one trajectory at a time.
    fn best(&self) -> Table {
        let head =
            ["model", "trajectory", "error", "best method", "best opponent", "us", "us", "opponent/hamel"];
        let mut lines = vec![cells(head)];
        for (run, points) in &self.runs {
            for bound in ERRORS {
                let of =
                    |own: bool| fastest(points.iter().filter(|p| p.is_own() == own && !p.is_lane()), bound);
                let (own, other) = (of(true), of(false));
                let name = |p: Option<&Point>| p.map_or_else(|| "-".into(), Point::name);
                let ratio = own.zip(other).map(|(own, other)| other.us / own.us);
                lines.push(vec![
                    run.model.clone(),
                    run.k.to_string(),
                    format!("{bound:e}"),
                    own.map_or_else(|| "-".into(), |p| p.method.clone()),
                    name(other),
                    number(own.map(|p| p.us), 2),
                    number(other.map(|p| p.us), 2),
                    number(ratio, 2),
                ]);
            }
        }
        Table { lines, n_words: 5 }
    }

    /// The best method in lanes at each error, for each instruction set, and what part it takes of the best opponent's
    /// time in lanes.
    fn side_by_side(&self) -> Table {
        let sets: BTreeSet<Option<&str>> =
            self.runs.iter().flat_map(|(_, points)| points).filter(|p| p.is_own()).map(Point::set).collect();
        let mut head = cells(["model", "trajectory", "error", "best opponent", "us"]);
        for set in &sets {
            let set = set.map_or_else(String::new, |set| format!(", {set}"));
            head.extend([format!("best method{set}"), "us".into(), "hamel/opponent".into()]);
        }
        let mut lines = vec![head];
        for (run, points) in &self.runs {
            for bound in ERRORS {
                let in_lanes = || points.iter().filter(|p| p.is_lane());
                let other = fastest(in_lanes().filter(|p| !p.is_own()), bound);
                let mut line = vec![run.model.clone(), run.k.to_string(), format!("{bound:e}")];
                line.extend([other.map_or_else(|| "-".into(), Point::name), number(other.map(|p| p.us), 2)]);
                for set in &sets {
                    let own = fastest(in_lanes().filter(|p| p.is_own() && p.set() == *set), bound);
                    let ratio = own.zip(other).map(|(own, other)| own.us / other.us);
                    line.extend([
                        own.map_or_else(|| "-".into(), |p| p.method.clone()),
                        number(own.map(|p| p.us), 2),
                        number(ratio, 2),
                    ]);
                }
                lines.push(line);
            }
        }
        Table { lines, n_words: 4 }
    }

    fn markdown(&self) -> String {
        let mut text = format!(
            "# Work and precision\n\n{INTRODUCTION}\n\n{}.\n\n## The best\n\n{}\n## Side by side\n\n{SIDE_BY_SIDE}\n\n{}",
            self.source.markdown(),
            self.best().markdown(),
            self.side_by_side().markdown()
        );
        for (run, points) in &self.runs {
            let _ = write!(
                text,
                "\n## {run}\n\n![Time against error]({}.svg)\n\nMicroseconds to an error of at most:\n\n{}",
                run.file(),
                times(points).markdown()
            );
        }
        for note in &self.notes {
            let _ = write!(text, "\nNote: {note}.\n");
        }
        text
    }

    /// One page that needs no other file.
    fn html(&self, charts: &[String]) -> String {
        let mut body = format!(
            "<h1>Work and precision</h1>\n<p>Written by <code>{}</code> on {} with {}. Times are in microseconds.</p>\n{}",
            escaped(&self.source.command),
            escaped(&self.source.cpu),
            escaped(&self.source.rustc),
            self.best().html()
        );
        let _ = write!(body, "<h2>Side by side</h2>\n{}", self.side_by_side().html());
        for ((run, points), chart) in self.runs.iter().zip(charts) {
            let _ = write!(body, "<h2>{}</h2>\n{chart}\n{}", escaped(&run.to_string()), times(points).html());
        }
        for note in &self.notes {
            let _ = writeln!(body, "<p>Note: {}.</p>", escaped(note));
        }
        format!(
            "<!doctype html>\n<html lang=\"en\">\n<meta charset=\"utf-8\">\n<title>Work and precision</title>\n<style>{STYLE}\
             </style>\n{body}</html>\n"
        )
    }

    fn csv(&self, points: &[Point]) -> String {
        let mut text = self.source.csv() + "by,method,tolerance_or_steps,error,evaluations,steps,us\n";
        for Point { by, method, knob, error, evals, steps, us } in points {
            let _ = writeln!(text, "\"{by}\",{method},{knob:e},{error:.3e},{evals},{steps},{us:.3}");
        }
        text
    }

    fn chart(&self, run: &Run, points: &[Point]) -> LogLog {
        let curve = |points: &[Point]| {
            let name = match (points[0].is_own(), points[0].set()) {
                (true, None) => points[0].method.clone(),
                (true, Some(set)) => format!("{}, {set}", points[0].method),
                (false, _) => points[0].name(),
            };
            let points_on = points.iter().map(|p| [p.error, p.us]);
            Curve { name, broken: !points[0].is_own(), points: points_on.collect() }
        };
        LogLog {
            title: format!("{run}: time against error"),
            subtitle: self.source.machine(),
            labels: ["error at the end, max |dy| / (1 + |y|)".into(), "microseconds".into()],
            curves: by_solver(points).into_iter().map(curve).collect(),
        }
    }
}

/// Microseconds of every solver at each error.
fn times(points: &[Point]) -> Table {
    let mut lines = vec![cells(["by", "method", "1e-6", "1e-9", "1e-12"])];
    for solver in by_solver(points) {
        let times = ERRORS.map(|bound| number(fastest(solver, bound).map(|p| p.us), 2));
        lines.push([solver[0].by.clone(), solver[0].method.clone()].into_iter().chain(times).collect());
    }
    Table { lines, n_words: 2 }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

impl Table {
    fn html(&self) -> String {
        let row = |line: &Vec<String>, tag: &str| {
            let cell = |text: &String| format!("<{tag}>{}</{tag}>", escaped(text));
            format!("<tr>{}</tr>\n", line.iter().map(cell).collect::<String>())
        };
        let rows = self.lines.iter().enumerate().map(|(k, line)| row(line, if k == 0 { "th" } else { "td" }));
        format!("<table>\n{}</table>\n", rows.collect::<String>())
    }
}

const STYLE: &str = "body{font:15px/1.5 sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#222}\
table{border-collapse:collapse;font-size:14px}th,td{padding:.15rem .7rem;border-bottom:1px solid #ddd;text-align:left}\
td{font-variant-numeric:tabular-nums}svg{max-width:100%;height:auto}";

const INTRODUCTION: &str = "\
The trajectories of files of `tests/reference`, integrated with `rtol = atol` from 1e-3 to 1e-15 by decades (methods
with fixed steps: 8 to 16384 steps). The error is `max_i |dy_i| / (1 + |y_i|)` at the end; a time is the fastest of all
rounds, and of all tolerances whose error is at most the one that the column says. Solvers take turns in every round. Trust
ratios of one run.

* **hamel**: the methods of `hamel-runtime`; `taylor` integrates the scene with Taylor series.
* **ode_solvers** 0.6, **differential-equations** 0.7: they integrate the same generated right-hand side, so that only the
  integrator differs; `vector algebra` is the right-hand side by nalgebra instead. In `dop853` of ode_solvers 0.6.2 the nodes
  `c_12` and `c_13` are 0 instead of 1: its times hold for systems without explicit time, as all of these, and it is no method
  for others.
* **heyoka**, **scipy** (with `--peers`): called from Python, with the equations in their best form by hand; heyoka compiles its
  steps for this machine.

`.. in 8 lanes` is an eighth of the time of eight equal trajectories side by side on one core; it has no part in \"The best\", where everything
integrates one.";

const SIDE_BY_SIDE: &str = "\
An eighth of the time of eight equal trajectories side by side on one core, to an error of at most. Compiled for x86-64-v4 as
well where the machine has it: eight lanes are one register of AVX-512 then, and two of AVX2 otherwise. heyoka compiles its
batches of eight for this machine.";

#[cfg(test)]
mod tests {
    use super::{Point, Report, Run};
    use crate::bench::source::Source;

    fn point(by: &str, method: &str, error: f64, us: f64) -> Point {
        Point { by: by.into(), method: method.into(), knob: 1e-9, error, evals: 10, steps: 2, us }
    }

    fn report() -> Report {
        let points = vec![
            point("hamel", "dop853", 1e-7, 8.0),
            point("hamel", "dop853", 1e-10, 16.0),
            point("hamel", "taylor", 1e-13, 10.0),
            point("other & co", "dop853", 1e-10, 20.0),
        ];
        let runs = vec![(Run { model: "heavy_top".into(), k: 2 }, points)];
        Report { source: Source::of_test("bench wp"), runs, notes: Vec::new() }
    }

    #[test]
    fn the_best_method_is_named_with_its_ratio() {
        let text = report().best().text();
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(
            lines[1],
            ["heavy_top", "2", "1e-6", "dop853", "other", "&", "co", "dop853", "8.00", "20.00", "2.50"]
        );
        assert_eq!(
            lines[2],
            ["heavy_top", "2", "1e-9", "taylor", "other", "&", "co", "dop853", "10.00", "20.00", "2.00"]
        );
        assert_eq!(lines[3], ["heavy_top", "2", "1e-12", "taylor", "-", "10.00"]);
    }

    #[test]
    fn a_lane_is_compared_with_lanes_alone() {
        let mut report = report();
        report.runs[0].1.extend([
            point("heyoka 1", "taylor in 8 lanes", 1e-14, 0.5),
            point("hamel", "vern9 in 8 lanes", 1e-10, 0.4),
            point("hamel, x86-64-v4", "gbs14 in 8 lanes", 1e-8, 0.1),
        ]);
        let best = report.best().text();
        assert!(!best.contains("heyoka") && !best.contains("lanes"));
        assert!(report.text().contains("taylor in 8 lanes"));
        let text = report.side_by_side().text();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].contains("best method, x86-64-v4"), "{text}");
        assert!(lines[1].contains("vern9 in 8 lanes  0.40            0.80"), "{text}");
        assert!(lines[1].ends_with("gbs14 in 8 lanes  0.10            0.20"), "{text}");
        assert!(lines[2].contains("0.80") && lines[2].ends_with('-'), "{text}");
    }

    #[test]
    fn every_solver_is_a_curve_and_a_page_is_whole() {
        let report = report();
        let chart = report.chart(&report.runs[0].0, &report.runs[0].1);
        let names: Vec<&str> = chart.curves.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["dop853", "taylor", "other & co dop853"]);
        assert_eq!(chart.curves.iter().map(|c| c.points.len()).collect::<Vec<_>>(), [2, 1, 1]);
        let page = report.html(&["<svg></svg>".into()]);
        assert!(
            page.contains("other &amp; co") && page.contains("<svg></svg>") && page.ends_with("</html>\n")
        );
    }
}
