//! Trajectories of an ensemble as CSV, written while they come.
//!
//! Does not know: how they were computed.

use std::fmt::Write as _;
use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

use super::chunk::{Chunk, Heading, Sink};
use hamel_run::error::Error;
use hamel_run::temporary::Temporary;

/// A line for each sample: number of the trajectory, what varies, time, state, energy, and on its last line what went
/// wrong.
///
/// Numbers are in shortest round-trip form, and what has no value is empty; a trajectory that never started has one
/// line, without time and state.
pub(super) struct Csv {
    path: PathBuf,
    temporary: Temporary,
    out: BufWriter<File>,
    /// Cells between what varies and the reason.
    n_cells: usize,
}

impl Csv {
    /// Begins the file beside its place.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn new(path: &Path, heading: &Heading<'_>) -> Result<Csv, Error> {
        let info = heading.info;
        let fail = |e| Error::io(path.display().to_string(), e);
        let temporary = Temporary::once_beside(path).map_err(fail)?;
        let mut out = BufWriter::new(File::create(temporary.path()).map_err(fail)?);
        let mut text = String::from("trajectory");
        for name in &heading.input_names {
            // A component of the initial state that varies has a name that the state has, too.
            let suffix = if info.state.contains(name) { "(0)" } else { "" };
            let _ = write!(text, ",{name}{suffix}");
        }
        text.push_str(",t");
        for name in &info.state {
            let _ = write!(text, ",{name}");
        }
        text.push_str(if info.has_energy { ",energy,error\n" } else { ",error\n" });
        out.write_all(text.as_bytes()).map_err(fail)?;
        let n_cells = 1 + info.state.len() + usize::from(info.has_energy);
        Ok(Csv { path: path.to_owned(), temporary, out, n_cells })
    }
}

impl Sink for Csv {
    fn add(&mut self, chunk: &Chunk) -> Result<(), Error> {
        let cell = |text: &mut String, x: Option<f64>| {
            text.push(',');
            if let Some(x) = x.filter(|x| x.is_finite()) {
                let _ = write!(text, "{x:?}");
            }
        };
        let mut text = String::new();
        for (k, (inputs, result)) in chunk.rows().enumerate() {
            let error = result.error().map(|e| format!("\"{}\"", e.replace('"', "\"\"").replace('\n', " ")));
            let mut line = |cells: &mut dyn Iterator<Item = f64>, error: Option<&String>| {
                let _ = write!(text, "{}", chunk.first + k);
                inputs.iter().for_each(|x| cell(&mut text, Some(*x)));
                (0..self.n_cells).for_each(|_| cell(&mut text, cells.next()));
                let _ = writeln!(text, ",{}", error.map_or("", String::as_str));
            };
            let mut samples = result.samples().peekable();
            if samples.peek().is_none() {
                line(&mut std::iter::empty(), error.as_ref());
            }
            while let Some(sample) = samples.next() {
                let mut cells =
                    [sample.t].into_iter().chain(sample.state.iter().copied()).chain(sample.energy);
                line(&mut cells, error.as_ref().filter(|_| samples.peek().is_none()));
            }
        }
        self.out.write_all(text.as_bytes()).map_err(|e| Error::io(self.path.display().to_string(), e))
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        let Csv { path, temporary, mut out, .. } = *self;
        let moved = out.flush().and_then(|()| temporary.rename_to(&path));
        moved.map_err(|e| Error::io(path.display().to_string(), e))
    }
}
