//! A fit as a figure: measured values and the fitted motion, a panel for each column.
//!
//! Does not know: how the fit was done.

use std::path::{Path, PathBuf};

use super::opened::Opened;
use super::picture::Picture;
use super::plot::{Figure, Panel, svg};
use hamel_run::error::Error;
use hamel_run::fit::{Column, FitRequest, FitResponse, Quantity};
use hamel_run::info::Info;
use hamel_run::model::blocks::Block;

/// Everything that is shown of a fit.
#[derive(Clone, Copy, Debug)]
pub struct Fitted<'a> {
    /// Names and meanings of the scene.
    pub info: &'a Info,
    /// Title of the model.
    pub title: &'a str,
    /// Groups of state variables, which have their units.
    pub blocks: &'a [Block],
    /// What was asked.
    pub request: &'a FitRequest,
    /// What came out, with curves.
    pub response: &'a FitResponse,
}

/// A figure to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    path: PathBuf,
    picture: Picture,
}

impl Target {
    /// The file at a path.
    ///
    /// # Errors
    /// [`Error::Request`] for an extension that is none of a figure.
    pub fn new(path: &Path) -> Result<Target, Error> {
        Ok(Target { path: path.to_owned(), picture: Picture::only(path)? })
    }

    /// Where it is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Opens the file, before anything is fitted.
    ///
    /// # Errors
    /// What keeps it from being written.
    pub(crate) fn open(&self) -> Result<Opened, Error> {
        Opened::new(&self.path)
    }

    /// Writes the figure.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(&self, file: Opened, fitted: &Fitted<'_>) -> Result<(), Error> {
        self.picture.write(file, svg(&figure(fitted)))
    }
}

/// The figure: a panel for each column.
pub fn figure(fitted: &Fitted<'_>) -> Figure {
    let Fitted { info, title, request, response, .. } = *fitted;
    let panel = |(at, (column, curve)): (usize, (&Column, &Vec<f64>))| {
        let values = request.times.iter().zip(&request.values);
        let points = values.filter_map(|(t, row)| Some([*t, row[at]?])).collect();
        Panel {
            title: heading(fitted, column),
            lines: vec![("fitted".to_owned(), curve.clone())],
            points: vec![points],
            points_name: "measured".to_owned(),
            ..Panel::default()
        }
    };
    let told = response.estimates.iter().map(|e| match e.deviation {
        Some(deviation) => format!("{} = {:.6} ± {deviation:.1e}", e.name, e.value),
        None => format!("{} = {:.6}, its bound", e.name, e.value),
    });
    Figure {
        title: if title.is_empty() { info.model.clone() } else { title.to_owned() },
        subtitle: told.collect::<Vec<String>>().join(", "),
        x_label: "t [s]".into(),
        times: response.curve_times.clone(),
        panels: request.columns.iter().zip(&response.curves).enumerate().map(panel).collect(),
        ..Figure::default()
    }
}

/// Name and unit of a column.
fn heading(fitted: &Fitted<'_>, column: &Column) -> String {
    let Quantity::State(at) = column.quantity else { return column.name.clone() };
    let name = &fitted.info.state[at];
    let members =
        fitted.blocks.iter().flat_map(|block| block.members.iter().map(move |member| (block, member)));
    match members.into_iter().find(|(_, (own, _))| own == name) {
        Some((block, (_, spelled))) if !block.unit.is_empty() => format!("{spelled} [{}]", block.unit),
        Some((_, (_, spelled))) => spelled.clone(),
        None => name.clone(),
    }
}
