//! `bench wp`: time of whole integrations against the error at their end, for the methods of the runtime and integrators of
//! other crates, on the first trajectory of the reference files.
//!
//! Deliberately does not know: how anything is integrated, how a table is drawn ([`super::wp_report`]).

use std::collections::BTreeMap;
use std::process::Command;

use serde_json::Value;

use super::wp_report::Report;
use super::{PACKAGE, TargetCpu, build, converse, cpu, failed, progress, rustc};
use crate::error::Error;
use crate::workspace::Workspace;

/// The models that are measured when none is named.
pub const MODELS: [&str; 5] =
    ["heavy_top", "euler_disk", "chaplygin_ball", "two_arm_satellite", "snakeboard"];

/// What to measure, and how.
#[derive(Clone, Debug)]
pub struct Options {
    /// Names of models; [`MODELS`] when empty.
    pub models: Vec<String>,
    /// Rounds; the fastest solution counts.
    pub rounds: u32,
    /// The instruction set.
    pub target_cpu: TargetCpu,
    /// Whether integrators in Python are measured, too.
    pub peers: bool,
}

impl Options {
    /// The command that repeats the measurement.
    fn command(&self) -> String {
        let mut words = vec!["cargo xtask bench wp".to_owned()];
        words.extend(self.models.iter().cloned());
        words.push(format!("--rounds {} --target-cpu {}", self.rounds, self.target_cpu.name()));
        words.extend(self.peers.then(|| "--peers".to_owned()));
        words.join(" ")
    }
}

/// A solution that was timed.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// By what: `hamel`, or who else.
    pub by: String,
    /// Name of the method.
    pub method: String,
    /// `rtol = atol`, or the number of steps of a method without error estimate.
    pub knob: f64,
    /// `max_i |dy_i| / (1 + |y_i|)` at the end.
    pub error: f64,
    /// Evaluations of the right-hand side, or expansions of the solution; zero where they are not counted.
    pub evals: u64,
    /// Steps, rejected ones included.
    pub steps: u64,
    /// Microseconds of the fastest solution.
    pub us: f64,
}

impl Point {
    /// The point of a line `<by>;<method>;<knob>;<error>;<evals>;<steps>;<ns>`.
    fn parse(line: &str) -> Option<Point> {
        let fields: Vec<&str> = line.split(';').collect();
        let [by, method, knob, error, evals, steps, ns] = fields[..] else { return None };
        Some(Point {
            by: by.to_owned(),
            method: method.to_owned(),
            knob: knob.parse().ok()?,
            error: error.parse().ok()?,
            evals: evals.parse().ok()?,
            steps: steps.parse().ok()?,
            us: 1e-3 * ns.parse::<f64>().ok()?,
        })
    }

    /// Whether a method of the runtime computed it.
    pub fn is_own(&self) -> bool {
        self.by == "hamel"
    }

    /// Whether it is one of several solutions side by side, whose time no single one has.
    pub fn is_lane(&self) -> bool {
        self.method.ends_with(" lanes")
    }

    /// Who and how in one line.
    pub fn name(&self) -> String {
        format!("{} {}", self.by, self.method)
    }
}

/// The fastest of points whose error is at most `bound`.
pub fn fastest<'a>(points: impl IntoIterator<Item = &'a Point>, bound: f64) -> Option<&'a Point> {
    points.into_iter().filter(|p| p.error <= bound).min_by(|a, b| a.us.total_cmp(&b.us))
}

/// The first trajectory of a model's reference file, as arguments of the measuring program.
fn problem(workspace: &Workspace, model: &str) -> Result<[String; 4], Error> {
    let path = workspace.root().join(format!("tests/reference/{model}.json"));
    let text = std::fs::read_to_string(&path).map_err(|e| Error::io(workspace.shown(&path), e))?;
    let of = |reason: String| failed(format!("tests/reference/{model}.json: {reason}"));
    let file: Value = serde_json::from_str(&text).map_err(|e| of(e.to_string()))?;
    let trajectory = &file["trajectories"][0];
    let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let numbers = |name: &str| {
        let object =
            trajectory[name].as_object().ok_or_else(|| of(format!("the first trajectory has no {name}")))?;
        let pairs = object.iter().map(|(name, value)| format!("{name}={}", text(value)));
        Ok::<_, Error>(pairs.collect::<Vec<_>>().join(","))
    };
    Ok([text(&trajectory["t_final"]), numbers("params")?, numbers("initial")?, numbers("final")?])
}

/// Measures, writes `docs/benchmarks/wp*` when all models were measured, and returns the tables.
///
/// # Errors
/// [`Error::Failed`] when the measuring program does not build, run or know a model, [`Error::Io`].
pub fn wp(workspace: &Workspace, options: &Options) -> Result<String, Error> {
    let models: Vec<String> =
        if options.models.is_empty() { MODELS.map(str::to_owned).to_vec() } else { options.models.clone() };
    let program =
        build(workspace, options.target_cpu, &["--no-default-features", "--features", "integrators"])?;
    let bar = progress(u64::from(options.rounds) * models.len() as u64);
    let mut points = BTreeMap::new();
    let mut notes = Vec::new();
    for model in &models {
        bar.set_message(model.clone());
        let mut command = Command::new(&program);
        command.args(["solve", &options.rounds.to_string(), model]).args(problem(workspace, model)?);
        let mut found = Vec::new();
        converse(command, PACKAGE, &bar, |line| {
            found.push(Point::parse(line)?);
            Some(())
        })?;
        points.insert(model.clone(), found);
    }
    bar.finish_and_clear();
    if options.peers {
        match peers(workspace, &models, &mut points) {
            Ok(said) => notes.extend(said),
            Err(note) => notes.push(note),
        }
    }
    let points = models.iter().map(|m| (m.clone(), points.remove(m).unwrap_or_default())).collect();
    let report = Report { command: options.command(), cpu: cpu(), rustc: rustc(), models: points, notes };
    let mut text = report.text();
    if options.models.is_empty() {
        for path in report.write(&workspace.root().join("docs/benchmarks"))? {
            text.push_str(&format!("wrote {}\n", workspace.shown(&path)));
        }
    } else {
        text.push_str("docs/benchmarks is written when no models are named\n");
    }
    Ok(text)
}

/// Runs the script of the integrators in Python, whose lines are those of the measuring program after the model's name, and
/// adds their solutions; the notes.
fn peers(
    workspace: &Workspace,
    models: &[String],
    points: &mut BTreeMap<String, Vec<Point>>,
) -> Result<Vec<String>, String> {
    let mut command = super::peers::script(workspace, "wp.py");
    command.args(models);
    let said = super::peers::listen(command, "integrators in Python", |line| {
        let (model, point) = line.split_once(';')?;
        points.entry(model.to_owned()).or_default().push(Point::parse(point)?);
        Some(())
    })?;
    Ok(said.notes)
}

#[cfg(test)]
mod tests {
    use super::{Point, fastest};

    #[test]
    fn points_are_read_and_the_fastest_within_the_error_is_found() {
        let lines = [
            "hamel;vern9;1e-9;2e-10;100;6;5000",
            "hamel;vern9;1e-8;2e-9;80;5;4000",
            "x y;dop;1e-9;1e-11;3;2;4500",
        ];
        let points: Vec<Point> = lines.iter().filter_map(|line| Point::parse(line)).collect();
        assert_eq!(points.len(), 3);
        assert_eq!(fastest(&points, 1e-9).map(Point::name).as_deref(), Some("x y dop"));
        assert_eq!(fastest(&points, 1e-8).map(|p| p.us), Some(4.0));
        assert_eq!(fastest(&points, 1e-12), None);
        assert_eq!(Point::parse("hamel;vern9;1e-9"), None);
    }
}
