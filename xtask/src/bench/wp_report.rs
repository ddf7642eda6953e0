//! Work and precision as tables, a CSV file and a figure for each model, and one page with all of them.
//!
//! No dates and no paths are written: the command, the processor and the compiler say where numbers come from.
//!
//! Does not know: how anything was measured.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use hamel::Error;
use hamel::output::plot::loglog::{self, Curve, LogLog};

use super::point::{Point, fastest};
use super::source::Source;
use super::table::{Table, cells, number, write_files};

/// All that was measured, and on what.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Report {
    /// Where it comes from.
    pub(crate) source: Source,
    /// Models with their measurements.
    pub(crate) models: Vec<(String, Vec<Point>)>,
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
        let mut text = format!("{}\n{}", self.source.text(), self.best().text());
        for (model, points) in &self.models {
            let _ =
                write!(text, "\n{model}: microseconds to an error of at most\n\n{}", times(points).text());
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
        for (model, points) in &self.models {
            let chart = loglog::svg(&self.chart(model, points));
            let chart = chart.map_err(|e| Error::io("the chart", std::io::Error::other(e)))?;
            files.push((format!("wp_{model}.csv"), self.csv(points)));
            files.push((format!("wp_{model}.svg"), chart.clone()));
            charts.push(chart);
        }
        files.push(("wp.html".to_owned(), self.html(&charts)));
        write_files(folder, files)
    }

    /// The best method at each error and its ratio to the best opponent; one trajectory at a time.
    fn best(&self) -> Table {
        let head = ["model", "error", "best method", "best opponent", "us", "us", "opponent/hamel"];
        let mut lines = vec![cells(head)];
        for (model, points) in &self.models {
            for bound in ERRORS {
                let of =
                    |own: bool| fastest(points.iter().filter(|p| p.is_own() == own && !p.is_lane()), bound);
                let (own, other) = (of(true), of(false));
                let name = |p: Option<&Point>| p.map_or_else(|| "-".into(), Point::name);
                let ratio = own.zip(other).map(|(own, other)| other.us / own.us);
                lines.push(vec![
                    model.clone(),
                    format!("{bound:e}"),
                    own.map_or_else(|| "-".into(), |p| p.method.clone()),
                    name(other),
                    number(own.map(|p| p.us), 2),
                    number(other.map(|p| p.us), 2),
                    number(ratio, 2),
                ]);
            }
        }
        Table { lines, n_words: 4 }
    }

    fn markdown(&self) -> String {
        let mut text = format!(
            "# Work and precision\n\n{INTRODUCTION}\n\n{}.\n\n## The best\n\n{}",
            self.source.markdown(),
            self.best().markdown()
        );
        for (model, points) in &self.models {
            let _ = write!(
                text,
                "\n## {model}\n\n![Time against error](wp_{model}.svg)\n\nMicroseconds to an error of at most:\n\n{}",
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
        for ((model, points), chart) in self.models.iter().zip(charts) {
            let _ = write!(body, "<h2>{}</h2>\n{chart}\n{}", escaped(model), times(points).html());
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

    fn chart(&self, model: &str, points: &[Point]) -> LogLog {
        let curve = |points: &[Point]| {
            let name = if points[0].is_own() { points[0].method.clone() } else { points[0].name() };
            let points_on = points.iter().map(|p| [p.error, p.us]);
            Curve { name, broken: !points[0].is_own(), points: points_on.collect() }
        };
        LogLog {
            title: format!("{model}: time against error"),
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
The first trajectory of each file of `tests/reference`, integrated with `rtol = atol` from 1e-3 to 1e-15 by decades (methods
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

#[cfg(test)]
mod tests {
    use super::{Point, Report};
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
        let models = vec![("heavy_top".to_owned(), points)];
        Report { source: Source::of_test("bench wp"), models, notes: Vec::new() }
    }

    #[test]
    fn the_best_method_is_named_with_its_ratio() {
        let text = report().best().text();
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(
            lines[1],
            ["heavy_top", "1e-6", "dop853", "other", "&", "co", "dop853", "8.00", "20.00", "2.50"]
        );
        assert_eq!(
            lines[2],
            ["heavy_top", "1e-9", "taylor", "other", "&", "co", "dop853", "10.00", "20.00", "2.00"]
        );
        assert_eq!(lines[3], ["heavy_top", "1e-12", "taylor", "-", "10.00"]);
    }

    #[test]
    fn a_lane_is_shown_but_is_nobodys_opponent() {
        let mut report = report();
        report.models[0].1.push(point("heyoka 1", "taylor in 8 lanes", 1e-14, 0.5));
        assert!(!report.best().text().contains("heyoka"));
        assert!(report.text().contains("taylor in 8 lanes"));
    }

    #[test]
    fn every_solver_is_a_curve_and_a_page_is_whole() {
        let report = report();
        let chart = report.chart("heavy_top", &report.models[0].1);
        let names: Vec<&str> = chart.curves.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["dop853", "taylor", "other & co dop853"]);
        assert_eq!(chart.curves.iter().map(|c| c.points.len()).collect::<Vec<_>>(), [2, 1, 1]);
        let page = report.html(&["<svg></svg>".into()]);
        assert!(
            page.contains("other &amp; co") && page.contains("<svg></svg>") && page.ends_with("</html>\n")
        );
    }
}
