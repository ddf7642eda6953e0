//! Families of equilibria as a table or a figure.
//!
//! Does not know: how they were found.

use std::path::{Path, PathBuf};

use super::opened::Opened;
use super::picture::{ENDINGS, Picture};
use super::plot::{Figure, MAX_LINES, Panel, svg};
use hamel_run::equilibria::Answer;
use hamel_run::error::Error;

/// A file to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Target {
    path: PathBuf,
    /// None for a table.
    picture: Option<Picture>,
}

/// The same, open.
#[derive(Debug)]
pub(crate) struct OpenTarget {
    file: Opened,
    picture: Option<Picture>,
}

impl Target {
    /// The file at a path.
    ///
    /// # Errors
    /// [`Error::Request`] for an extension that is none of a table or a figure.
    pub(crate) fn new(path: &Path) -> Result<Target, Error> {
        let is_table = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
        let picture = Picture::of(path);
        if !is_table && picture.is_none() {
            let reason = format!("is no table and no figure: let the name end in .csv, {ENDINGS}");
            return Err(Error::unusable(path.display().to_string(), reason));
        }
        Ok(Target { path: path.to_owned(), picture })
    }

    /// Where it is written.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Opens the file, before anything is sought.
    ///
    /// # Errors
    /// What keeps it from being written.
    pub(crate) fn open(&self) -> Result<OpenTarget, Error> {
        Ok(OpenTarget { file: Opened::new(&self.path)?, picture: self.picture })
    }
}

/// Writes a family along `name`.
///
/// # Errors
/// [`Error::Io`].
pub(crate) fn write(target: OpenTarget, title: &str, answer: &Answer, name: &str) -> Result<(), Error> {
    let OpenTarget { file, picture } = target;
    match picture {
        None => file.write(csv(answer, name).as_bytes()),
        Some(picture) => picture.write(file, svg(&figure(title, answer, name))),
    }
}

fn csv(answer: &Answer, name: &str) -> String {
    let (names, rows) = answer.table(name);
    let line = |row: &Vec<f64>| row.iter().map(f64::to_string).collect::<Vec<String>>().join(",");
    let lines: Vec<String> = [names.join(",")].into_iter().chain(rows.iter().map(line)).collect();
    lines.join("\n") + "\n"
}

/// Panels of the state and the drifts, and the largest real part of an eigenvalue with the changes on it.
fn figure(title: &str, answer: &Answer, name: &str) -> Figure {
    let (names, rows) = answer.table(name);
    let column = |k: usize| rows.iter().map(|row| row[k]).collect::<Vec<f64>>();
    let last = names.len() - 1;
    let lines: Vec<(String, Vec<f64>)> = (1..last).map(|k| (names[k].clone(), column(k))).collect();
    let mut panels: Vec<Panel> = lines
        .chunks(MAX_LINES)
        .map(|lines| Panel { title: "state and drifts".into(), lines: lines.to_vec(), ..Panel::default() })
        .collect();
    let marked = |(_, _, at): &(usize, _, hamel_run::equilibria::Equilibrium)| {
        Some([at.along?, at.stability.eigenvalues.first()?[0]])
    };
    let is_orbit = answer.equilibria.first().is_some_and(|first| first.period.is_some());
    let growing = if is_orbit { "an exponent of Floquet" } else { "an eigenvalue" };
    panels.push(Panel {
        title: format!("largest real part of {growing} [1/s]"),
        lines: vec![("growth".to_owned(), column(last))],
        points: vec![answer.changes.iter().filter_map(marked).collect()],
        ..Panel::default()
    });
    let told = answer
        .changes
        .iter()
        .map(|(_, change, at)| format!("{} at {name} = {:.6}", change.name(), at.along.unwrap_or(f64::NAN)));
    Figure {
        title: if title.is_empty() { answer.info.model.clone() } else { title.to_owned() },
        subtitle: told.collect::<Vec<String>>().join(", "),
        x_label: name.to_owned(),
        times: column(0),
        panels,
        ..Figure::default()
    }
}
