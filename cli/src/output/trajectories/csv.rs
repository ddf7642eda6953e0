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
                add_number(text, x);
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

/// Adds a finite number as `{x:?}` writes it.
fn add_number(text: &mut String, x: f64) {
    // Two shortest numbers may be as near. Below 2^40 they have at least four digits behind the point, and the number
    // itself one more, the last of them 5, so that at least seven of its 53 bits are zeros at the end.
    let is_between_two = x.to_bits().trailing_zeros() > 5;
    // Without an exponent, as most are.
    if (1e-4..1e12).contains(&x.abs()) && !is_between_two {
        text.push_str(zmij::Buffer::new().format_finite(x));
    } else {
        let _ = write!(text, "{x:?}");
    }
}

#[cfg(test)]
mod tests {
    use super::add_number;

    #[test]
    fn numbers_are_those_of_the_standard_library() {
        let mut bits = 1;
        let random = (0..300_000).map(|k| {
            let x = f64::from_bits(hamel_expr::split_mix(&mut bits));
            // Of the usual sizes, with all digits, with few, whole, and with few bits.
            let scaled = (x.to_bits() >> 12) as f64 * 10.0_f64.powi(k % 40 - 35);
            let short = f64::from_bits(scaled.to_bits() & (u64::MAX << (k % 48)));
            [x, scaled, (scaled * 1e3).round() / 1e3, scaled.round(), -scaled, short]
        });
        let edges = [
            0.0,
            -0.0,
            1e-4,
            1e-5,
            9.999999999999999e-5,
            1e15,
            1e16,
            9_999_999_999_999_998.0,
            5e-324,
            f64::MAX,
        ];
        for x in random.flatten().chain(edges).filter(|x| x.is_finite()) {
            let mut text = String::new();
            add_number(&mut text, x);
            assert_eq!(text, format!("{x:?}"));
        }
    }
}
