//! Results of a simulation as files: CSV, JSON, arrays for NumPy, figures.
//!
//! Does not know: how they were computed.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::columns::{self, Chosen};
use super::opened::Opened;
use super::picture::{ENDINGS, Picture};
use super::plot::field::Field;
use super::plot::{self, Figure, MAX_LINES, Panel, svg};
use super::trajectories::Archive;
use hamel_run::error::Error;
use hamel_run::info::Info;
use hamel_run::model::blocks::Block;
use hamel_run::model::spelling::lower_first;
use hamel_run::simulation::{Sample, SimulateRequest, SimulateResponse};

/// A file to write and its format, which its extension says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    path: PathBuf,
    format: Format,
}

/// A file that is open, and its format.
#[derive(Debug)]
pub struct OpenTarget {
    file: Opened,
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    Csv,
    Json,
    Npz,
    Figure(Picture),
}

/// A relative drift of the energy beyond this is taken for a property of the motion.
const CONSERVED: f64 = 1e-6;

/// What the results are results of.
#[derive(Clone, Copy, Debug)]
pub struct Run<'a> {
    /// Names and meanings of the scene.
    pub info: &'a Info,
    /// Title of the model.
    pub title: &'a str,
    /// Groups of state variables.
    pub blocks: &'a [Block],
    /// What was asked.
    pub request: &'a SimulateRequest,
    /// What came out, with outputs in its samples.
    pub response: &'a SimulateResponse,
    /// Functions on a surface that the model shows.
    pub fields: &'a [Field],
    /// What figures show in the place of everything.
    pub chosen: &'a Chosen,
}

impl Target {
    /// The file at a path.
    ///
    /// # Errors
    /// [`Error::Request`] for an extension that says no format.
    pub fn new(path: &Path) -> Result<Target, Error> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        let format = match extension.as_str() {
            "csv" => Format::Csv,
            "json" => Format::Json,
            "npz" => Format::Npz,
            _ => match Picture::of(path) {
                Some(picture) => Format::Figure(picture),
                None => {
                    let reason =
                        format!("has no known format: let the name end in .csv, .json, .npz, {ENDINGS}");
                    return Err(Error::unusable(path.display().to_string(), reason));
                }
            },
        };
        Ok(Target { path: path.to_owned(), format })
    }

    /// Where it is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether the file is a figure.
    pub fn is_figure(&self) -> bool {
        matches!(self.format, Format::Figure(_))
    }

    /// Opens the file, before anything is integrated.
    ///
    /// # Errors
    /// What keeps it from being written.
    pub fn open(&self) -> Result<OpenTarget, Error> {
        Ok(OpenTarget { file: Opened::new(&self.path)?, format: self.format })
    }
}

impl OpenTarget {
    /// Writes the results.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn write(self, run: &Run<'_>) -> Result<(), Error> {
        let fail = |file: &Opened, e| Error::io(file.path().display().to_string(), e);
        match self.format {
            Format::Csv => self.file.write(csv(run).as_bytes()),
            Format::Json => {
                let text = format!("{}\n", run.response.to_json(run.info, run.request.n_group));
                self.file.write(text.as_bytes())
            }
            Format::Npz => {
                npz(self.file.temporary(), run).map_err(|e| fail(&self.file, e))?;
                self.file.place()
            }
            Format::Figure(picture) => picture.write(self.file, svg(&figure(run)?)),
        }
    }
}

/// Time, state, energy, outputs (as `group.component`) and derivatives, one sample a line, every number in shortest
/// round-trip form.
pub fn csv(run: &Run<'_>) -> String {
    let mut text = String::from("t");
    columns(run).iter().for_each(|name| {
        let _ = write!(text, ",{name}");
    });
    text.push('\n');
    for sample in &run.response.samples {
        let _ = write!(text, "{:?}", sample.t);
        for x in columns::values(sample) {
            let _ = write!(text, ",{x:?}");
        }
        text.push('\n');
    }
    text
}

/// Names of the columns behind the time.
fn columns(run: &Run<'_>) -> Vec<String> {
    let with_outputs = run.response.samples.iter().any(|s| !s.outputs.is_empty());
    columns::names(run.info, with_outputs, run.response.along.iter().map(|(by, _)| by))
}

/// The same columns as arrays for NumPy, by the same names.
fn npz(path: &Path, run: &Run<'_>) -> std::io::Result<()> {
    let samples = &run.response.samples;
    let mut archive = Archive::new(path)?;
    archive.numbers("t", &samples.iter().map(|s| s.t).collect::<Vec<f64>>())?;
    for (k, name) in columns(run).iter().enumerate() {
        let values = samples.iter().map(|sample| columns::values(sample).nth(k).unwrap_or(f64::NAN));
        archive.numbers(name, &values.collect::<Vec<f64>>())?;
    }
    archive.finish()
}

/// The columns that were chosen, or the states over time, a panel for each group, and the drift of the energy.
///
/// # Errors
/// [`Error::Request`] for a logarithmic axis of a column that has values without logarithm.
pub fn figure(run: &Run<'_>) -> Result<Figure, Error> {
    let Run { info, title, request, response, fields, chosen, .. } = *run;
    let is_all = chosen.is_all();
    let panels = if is_all { panels(run) } else { chosen.drawn(run.blocks, &response.samples)? };
    let scene = if info.scene == hamel_run::model::DEFAULT_SCENE {
        String::new()
    } else {
        format!(", scene {}", info.scene)
    };
    let steps = request.steps.describe();
    Ok(Figure {
        title: if title.is_empty() { info.model.clone() } else { title.to_owned() },
        subtitle: format!(
            "{}{scene} · {}, {steps} · {} steps, {} evaluations",
            info.model,
            request.method.name(),
            response.steps,
            response.rhs_evals
        ),
        x_label: "t [s]".into(),
        times: response.samples.iter().map(|s| s.t).collect(),
        panels,
        path: if is_all { path(run) } else { None },
        fields: if is_all { fields.to_vec() } else { Vec::new() },
    })
}

/// A panel for each group of the state, and the drift of the energy.
fn panels(run: &Run<'_>) -> Vec<Panel> {
    let Run { info, blocks, response, .. } = *run;
    let column = |at: usize| response.samples.iter().map(|s| s.state[at]).collect::<Vec<f64>>();
    let mut panels = Vec::new();
    let mut shown = vec![false; info.state.len()];
    for block in blocks {
        let mut lines = Vec::new();
        for (name, spelled) in &block.members {
            if let Some(at) = info.state.iter().position(|s| s == name) {
                shown[at] = true;
                lines.push((spelled.clone(), column(at)));
            }
        }
        for (k, chunk) in lines.chunks(MAX_LINES).enumerate() {
            let heading = heading(block, chunk.iter().map(|(name, _)| name.as_str()).collect(), k);
            panels.push(Panel { title: heading, lines: chunk.to_vec(), ..Panel::default() });
        }
    }
    let rest: Vec<usize> = (0..shown.len()).filter(|&k| !shown[k]).collect();
    for chunk in rest.chunks(MAX_LINES) {
        let lines = chunk.iter().map(|&k| (info.state[k].clone(), column(k))).collect();
        panels.push(Panel { title: "State".into(), lines, ..Panel::default() });
    }
    for (k, (by, _)) in response.along.iter().enumerate() {
        let column = |at: usize| {
            let derivative = |s: &Sample| s.along[k * info.state.len() + at];
            (info.state[at].clone(), response.samples.iter().map(derivative).collect())
        };
        let all: Vec<usize> = (0..info.state.len()).collect();
        for chunk in all.chunks(MAX_LINES) {
            let lines = chunk.iter().map(|at| column(*at)).collect();
            panels.push(Panel { title: format!("Derivative by {by}"), lines, ..Panel::default() });
        }
    }
    if let Some(initial) = response.initial_energy {
        let relative = |energy: f64| (energy - initial) / response.energy_scale;
        let of = if response.energy_scale == initial.abs() { "|E(0)|" } else { "the size of its terms" };
        // A change of the energy that belongs to the motion is shown at the samples. Otherwise the steps are shown:
        // samples between them carry the error of the dense output besides that of the integration.
        let (times, values): (Vec<f64>, Vec<f64>) = if response.energy_drift.is_some_and(|d| d > CONSERVED) {
            response.samples.iter().map(|s| (s.t, s.energy.map_or(0.0, relative))).unzip()
        } else {
            response.energy_at_steps.iter().map(|(t, energy)| (*t, relative(*energy))).unzip()
        };
        panels.push(Panel {
            title: format!(
                "Energy {}, relative to {of}",
                if info.conserves_energy { "drift" } else { "change" }
            ),
            lines: vec![(String::new(), values)],
            times: Some(times),
            ..Panel::default()
        });
    }
    panels
}

/// Names of coordinates that are positions in a plane when they are lengths.
const PLANE: [[&str; 2]; 2] = [["x", "y"], ["x1", "x2"]];

/// The path of the first position in a plane that the state has, in metres.
fn path(run: &Run<'_>) -> Option<plot::Path> {
    let at = |name: &str| run.info.state.iter().position(|s| s == name);
    let of_block = |block: &Block| {
        let member = |name: &str| {
            let (_, spelled) = block.members.iter().find(|(member, _)| member == name)?;
            Some((at(name)?, format!("{spelled} [{}]", block.unit)))
        };
        let [(x, x_label), (y, y_label)] = PLANE.iter().find_map(|[x, y]| Some([member(x)?, member(y)?]))?;
        Some(plot::Path {
            title: match cut(&block.doc, 84) {
                doc if doc.is_empty() => "Path".to_owned(),
                doc => format!("Path: {}", lower_first(&doc)),
            },
            labels: [x_label, y_label],
            points: run.response.samples.iter().map(|s| [s.state[x], s.state[y]]).collect(),
        })
    };
    run.blocks.iter().filter(|b| b.unit == "m").find_map(of_block)
}

fn heading(block: &Block, members: Vec<&str>, chunk: usize) -> String {
    let mut text = if !block.symbol.is_empty() && (members.len() > 1 || block.symbol != members[0]) {
        block.symbol.clone()
    } else {
        String::new()
    };
    let doc = cut(&block.doc, 84);
    if !doc.is_empty() {
        text = if text.is_empty() { doc } else { format!("{text}: {}", lower_first(&doc)) };
    }
    if text.is_empty() {
        text = members.join(", ");
    }
    if chunk > 0 {
        text.push_str(", continued");
    }
    if block.unit.is_empty() { text } else { format!("{text} [{}]", block.unit) }
}

fn cut(text: &str, limit: usize) -> String {
    if text.chars().count() <= limit {
        return text.to_owned();
    }
    let head: String = text.chars().take(limit).collect();
    format!(
        "{}…",
        head.rsplit_once(' ').map_or(head.as_str(), |(head, _)| head).trim_end_matches([',', ':', ';'])
    )
}
