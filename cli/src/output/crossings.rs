//! The events of a motion as files: a table, or a picture of a plane with a point for each.
//!
//! Does not know: how events are found.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use super::opened::Opened;
use super::picture::{ENDINGS, Picture};
use super::plot::points::{self, Points};
use hamel_run::error::Error;
use hamel_run::info::Info;
use hamel_run::watched::EventRecord;

/// The events of a motion, and the plane in which they are drawn.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossings<'a> {
    pub(crate) info: &'a Info,
    /// Title of the model.
    pub(crate) title: &'a str,
    /// Positions in the state of what is drawn to the right and up.
    pub(crate) plane: [usize; 2],
    pub(crate) events: &'a [EventRecord],
}

/// A file to write and its format, which its extension says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct EventTarget {
    path: PathBuf,
    /// None for a table.
    picture: Option<Picture>,
}

/// A file that is open, and its format.
#[derive(Debug)]
pub(crate) struct OpenEventTarget {
    file: Opened,
    picture: Option<Picture>,
}

impl EventTarget {
    /// The file at a path.
    ///
    /// # Errors
    /// [`Error::Request`] for an extension that says no format.
    pub(crate) fn new(path: &Path) -> Result<EventTarget, Error> {
        let is_table = path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("csv"));
        let picture = Picture::of(path);
        if !is_table && picture.is_none() {
            let reason = format!("has no known format for events: let the name end in .csv, {ENDINGS}");
            return Err(Error::unusable(path.display().to_string(), reason));
        }
        Ok(EventTarget { path: path.to_owned(), picture })
    }

    /// Where it is written.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Opens the file, before anything is integrated.
    ///
    /// # Errors
    /// What keeps it from being written.
    pub(crate) fn open(&self) -> Result<OpenEventTarget, Error> {
        Ok(OpenEventTarget { file: Opened::new(&self.path)?, picture: self.picture })
    }
}

impl OpenEventTarget {
    /// Writes the events.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn write(self, crossings: &Crossings<'_>) -> Result<(), Error> {
        match self.picture {
            None => self.file.write(csv(crossings).as_bytes()),
            Some(picture) => picture.write(self.file, points::svg(&figure(crossings))),
        }
    }
}

/// Name, time and state of each event, one a line, every number in shortest round-trip form.
fn csv(crossings: &Crossings<'_>) -> String {
    let mut text = String::from("event,t");
    for name in &crossings.info.state {
        let _ = write!(text, ",{name}");
    }
    for EventRecord { name, t, state } in crossings.events {
        let _ = write!(text, "\n{name},{t:?}");
        state.iter().for_each(|x| _ = write!(text, ",{x:?}"));
    }
    text.push('\n');
    text
}

/// A cloud of points for each event, in the order of the first of each.
fn figure(crossings: &Crossings<'_>) -> Points {
    let Crossings { info, title, plane: [x, y], events } = *crossings;
    let mut clouds: Vec<(String, Vec<[f64; 2]>)> = Vec::new();
    for EventRecord { name, state, .. } in events {
        let point = [state[x], state[y]];
        match clouds.iter_mut().find(|(known, _)| known == name) {
            Some((_, cloud)) => cloud.push(point),
            None => clouds.push((name.clone(), vec![point])),
        }
    }
    Points {
        title: if title.is_empty() { info.model.clone() } else { title.to_owned() },
        subtitle: format!("{}: states at events", info.model),
        labels: [info.state[x].clone(), info.state[y].clone()],
        clouds,
    }
}

#[cfg(test)]
mod tests {
    use super::{Crossings, csv, figure};
    use hamel_run::info::Info;
    use hamel_run::watched::EventRecord;

    #[test]
    fn events_are_lines_of_a_table_and_points_of_a_plane() {
        let info = Info {
            model: "m".into(),
            scene: "default".into(),
            state: vec!["x".into(), "v".into()],
            momenta: Vec::new(),
            params: Vec::new(),
            inputs: Vec::new(),
            noises: Vec::new(),
            velocities: Vec::new(),
            frames: Vec::new(),
            outputs: Vec::new(),
            has_energy: false,
            conserves_energy: false,
        };
        let event =
            |name: &str, t, state: [f64; 2]| EventRecord { name: name.into(), t, state: state.into() };
        let events =
            [event("a", 0.5, [1.0, -2.0]), event("b", 1.0, [0.0, 0.25]), event("a", 2.0, [3.0, 4.0])];
        let crossings = Crossings { info: &info, title: "", plane: [1, 0], events: &events };
        assert_eq!(csv(&crossings), "event,t,x,v\na,0.5,1.0,-2.0\nb,1.0,0.0,0.25\na,2.0,3.0,4.0\n");
        let figure = figure(&crossings);
        assert_eq!(figure.labels, ["v", "x"]);
        assert_eq!(
            figure.clouds,
            [("a".to_owned(), vec![[-2.0, 1.0], [4.0, 3.0]]), ("b".to_owned(), vec![[0.25, 0.0]])]
        );
        let svg = super::points::svg(&figure).unwrap();
        assert_eq!(svg.matches("<circle").count(), 3 + 2, "the points and those of the legend");
    }
}
