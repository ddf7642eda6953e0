//! Results of an ensemble as files: CSV for everybody, NPZ for NumPy.
//!
//! Does not know: how they were computed.

use std::fmt::Write as _;
use std::io::{BufWriter, Cursor, Write as _};
use std::path::{Path, PathBuf};

use hamel_codegen::config::write_atomically;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use crate::error::Error;
use crate::run::ensemble::Member;
use crate::run::info::Info;

/// Everything that is written about an ensemble.
pub(crate) struct Table<'a> {
    pub(crate) info: &'a Info,
    /// Names of what varies.
    pub(crate) input_names: Vec<String>,
    /// Its values, a line for each trajectory; NaN for what was not drawn because nothing could be drawn around.
    pub(crate) inputs: Vec<Vec<f64>>,
    /// Times of samples.
    pub(crate) times: Vec<f64>,
    pub(crate) results: Vec<Member>,
}

/// A file to write and its format, which its extension says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    path: PathBuf,
    is_npz: bool,
}

impl Target {
    /// The file at a path.
    ///
    /// # Errors
    /// [`Error::Request`] for an extension that says no format.
    pub fn new(path: &Path) -> Result<Target, Error> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_lowercase();
        let is_npz = match extension.as_str() {
            "csv" => false,
            "npz" => true,
            _ => {
                let reason = "has no known format: let the name end in .csv or .npz";
                return Err(Error::unusable(path.display().to_string(), reason));
            }
        };
        Ok(Target { path: path.to_owned(), is_npz })
    }

    /// Where it is written.
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn write(&self, table: &Table<'_>) -> Result<(), Error> {
        let bytes = if self.is_npz { npz(table) } else { Ok(csv(table).into_bytes()) };
        bytes
            .and_then(|bytes| write_atomically(&self.path, &bytes))
            .map_err(|e| Error::io(self.path.display().to_string(), e))
    }
}

/// A line for each sample: number of the trajectory, what varies, time, state, energy, and on its last line what went
/// wrong.
///
/// Numbers are in shortest round-trip form, and what has no value is empty; a trajectory that never started has one
/// line, without time and state.
fn csv(table: &Table<'_>) -> String {
    let Table { info, input_names, inputs, results, .. } = table;
    let mut text = String::from("trajectory");
    for name in input_names {
        // A component of the initial state that varies has a name that the state has, too.
        let suffix = if info.state.contains(name) { "(0)" } else { "" };
        let _ = write!(text, ",{name}{suffix}");
    }
    text.push_str(",t");
    for name in &info.state {
        let _ = write!(text, ",{name}");
    }
    text.push_str(if info.has_energy { ",energy,error\n" } else { ",error\n" });
    let n_cells = 1 + info.state.len() + usize::from(info.has_energy);
    let cell = |text: &mut String, x: Option<f64>| {
        text.push(',');
        if let Some(x) = x.filter(|x| x.is_finite()) {
            let _ = write!(text, "{x:?}");
        }
    };
    for (k, (inputs, result)) in inputs.iter().zip(results).enumerate() {
        let error =
            result.error.as_ref().map(|e| format!("\"{}\"", e.replace('"', "\"\"").replace('\n', " ")));
        let mut line = |cells: &mut dyn Iterator<Item = f64>, error: Option<&String>| {
            let _ = write!(text, "{k}");
            inputs.iter().for_each(|x| cell(&mut text, Some(*x)));
            (0..n_cells).for_each(|_| cell(&mut text, cells.next()));
            let _ = writeln!(text, ",{}", error.map_or("", String::as_str));
        };
        for (at, sample) in result.samples.iter().enumerate() {
            let mut cells = [sample.t].into_iter().chain(sample.state.iter().copied()).chain(sample.energy);
            line(&mut cells, error.as_ref().filter(|_| at + 1 == result.samples.len()));
        }
        if result.samples.is_empty() {
            line(&mut std::iter::empty(), error.as_ref());
        }
    }
    text
}

/// Arrays by name: see `docs/command-line.md`, which promises them. NaN stands where a trajectory has no value, and
/// `error` says why.
fn npz(table: &Table<'_>) -> std::io::Result<Vec<u8>> {
    let Table { info, input_names, inputs, times, results } = table;
    let (n, n_state, n_samples) = (results.len(), info.state.len(), times.len());
    let mut archive = Archive(ZipWriter::new(Cursor::new(Vec::new())));
    archive.texts("input_names", input_names.iter().map(String::as_str))?;
    archive.numbers("inputs", &[n, input_names.len()], inputs.iter().flatten().copied())?;
    archive.texts("state_names", info.state.iter().map(String::as_str))?;
    archive.numbers("t", &[n_samples], times.iter().copied())?;
    // Samples come in the order of the times, and the last state of one that stopped is between two of them.
    let sample = |k: usize, at: usize| results[k].samples.get(at).filter(|s| s.t == times[at]);
    let each = || (0..n).flat_map(|k| (0..n_samples).map(move |at| (k, at)));
    let state =
        |(k, at): (usize, usize)| (0..n_state).map(move |c| sample(k, at).map_or(f64::NAN, |s| s.state[c]));
    archive.numbers("state", &[n, n_samples, n_state], each().flat_map(state))?;
    if info.has_energy {
        let energy = |(k, at): (usize, usize)| sample(k, at).and_then(|s| s.energy).unwrap_or(f64::NAN);
        archive.numbers("energy", &[n, n_samples], each().map(energy))?;
    }
    let last = |k: usize| results[k].samples.last();
    archive.numbers("last_t", &[n], (0..n).map(|k| last(k).map_or(f64::NAN, |s| s.t)))?;
    let state = |k: usize| (0..n_state).map(move |c| last(k).map_or(f64::NAN, |s| s.state[c]));
    archive.numbers("last_state", &[n, n_state], (0..n).flat_map(state))?;
    archive.texts("error", results.iter().map(|r| r.error.as_deref().unwrap_or_default()))?;
    archive.0.finish().map(Cursor::into_inner).map_err(std::io::Error::from)
}

/// An archive of arrays; its entries have no dates, so that equal results are equal files.
struct Archive(ZipWriter<Cursor<Vec<u8>>>);

impl Archive {
    fn numbers(
        &mut self,
        name: &str,
        shape: &[usize],
        values: impl Iterator<Item = f64>,
    ) -> std::io::Result<()> {
        self.entry(name, "f8", shape, values.map(f64::to_le_bytes))
    }

    /// Strings, each filled up with zeros to the length of the longest.
    fn texts<'t>(&mut self, name: &str, texts: impl Iterator<Item = &'t str> + Clone) -> std::io::Result<()> {
        // NumPy has no strings of no characters.
        let longest = texts.clone().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        let codes = |text: &'t str| text.chars().map(u32::from).chain(std::iter::repeat(0)).take(longest);
        let shape = [texts.clone().count()];
        self.entry(name, &format!("U{longest}"), &shape, texts.flat_map(codes).map(u32::to_le_bytes))
    }

    /// One array: `kind` is NumPy's name of the type, `values` are in the order of the last index first.
    ///
    /// # Source
    /// NumPy Enhancement Proposal 1, A simple file format for NumPy arrays, version 1.0.
    fn entry<const SIZE: usize>(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        values: impl Iterator<Item = [u8; SIZE]>,
    ) -> std::io::Result<()> {
        let stored =
            SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored).large_file(true);
        self.0.start_file(format!("{name}.npy"), stored).map_err(std::io::Error::from)?;
        let shape: String = shape.iter().map(|n| format!("{n}, ")).collect();
        let mut header =
            format!("{{'descr': '<{kind}', 'fortran_order': False, 'shape': ({}), }}", shape.trim_end());
        // Ten bytes stand before the header, which ends with a line feed at a multiple of 64.
        let length = (header.len() + 11).next_multiple_of(64) - 10;
        header.push_str(&" ".repeat(length - 1 - header.len()));
        header.push('\n');
        let mut out = BufWriter::new(&mut self.0);
        out.write_all(b"\x93NUMPY\x01\x00")?;
        // The names above and at most three numbers: far less than 65536.
        out.write_all(&(length as u16).to_le_bytes())?;
        out.write_all(header.as_bytes())?;
        for value in values {
            out.write_all(&value)?;
        }
        out.flush()
    }
}
