//! Trajectories of an ensemble as an archive of arrays for NumPy.
//!
//! An archive has one array after the other, and trajectories come one after the other: each array grows in a file of
//! its own, and the files become entries at the end. Memory does not depend on the number of trajectories.
//!
//! Does not know: how they were computed.

use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::chunk::{Chunk, Heading, Sink};
use hamel_run::error::Error;
use hamel_run::members::Member;
use hamel_run::temporary::Temporary;

/// Arrays by name: see `docs/command-line.md`, which promises them. NaN stands where a trajectory has no value, and
/// `error` says why.
pub(super) struct Npz<'a> {
    path: PathBuf,
    heading: Heading<'a>,
    folder: Temporary,
    inputs: Grown,
    state: Grown,
    energy: Option<Grown>,
    last_t: Grown,
    last_state: Grown,
    error: Texts,
}

impl<'a> Npz<'a> {
    /// Begins the arrays in a folder beside the archive.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(super) fn new(path: &Path, heading: &Heading<'a>) -> Result<Npz<'a>, Error> {
        let fail = |e| Error::io(path.display().to_string(), e);
        let folder = Temporary::once_beside(path).map_err(fail)?;
        std::fs::create_dir_all(folder.path()).map_err(fail)?;
        let begin = |name: &str| Grown::new(folder.path(), name).map_err(fail);
        Ok(Npz {
            path: path.to_owned(),
            heading: heading.clone(),
            inputs: begin("inputs")?,
            state: begin("state")?,
            energy: heading.info.has_energy.then(|| begin("energy")).transpose()?,
            last_t: begin("last_t")?,
            last_state: begin("last_state")?,
            error: Texts { longest: 0, file: begin("error")? },
            folder,
        })
    }

    fn append(&mut self, inputs: &[f64], member: Member<'_>) -> io::Result<()> {
        let heading = &self.heading;
        let n_state = heading.info.state.len();
        self.inputs.append(inputs.iter().copied())?;
        let absent = || std::iter::repeat_n(f64::NAN, n_state);
        for at in 0..heading.times.len() {
            let sample = member.sample(at);
            match sample {
                Some(sample) => self.state.append(sample.state.iter().copied())?,
                None => self.state.append(absent())?,
            }
            if let Some(energy) = &mut self.energy {
                energy.append([sample.and_then(|s| s.energy).unwrap_or(f64::NAN)].into_iter())?;
            }
        }
        match member.last() {
            Some(last) => {
                self.last_t.append([last.t].into_iter())?;
                self.last_state.append(last.state.iter().copied())?;
            }
            None => {
                self.last_t.append([f64::NAN].into_iter())?;
                self.last_state.append(absent())?;
            }
        }
        self.error.append(member.error().unwrap_or_default())
    }

    fn pack(self) -> io::Result<()> {
        let Npz { path, heading, folder, inputs, state, energy, last_t, last_state, error } = self;
        let (n, n_inputs, n_state) = (heading.n, heading.input_names.len(), heading.info.state.len());
        let n_samples = heading.times.len();
        let temporary = Temporary::at(folder.path().join("archive"));
        let mut archive = Archive::new(temporary.path())?;
        archive.texts("input_names", &heading.input_names)?;
        archive.grown("inputs", &[n, n_inputs], inputs)?;
        archive.texts("state_names", &heading.info.state)?;
        archive.numbers("t", &heading.times)?;
        archive.grown("state", &[n, n_samples, n_state], state)?;
        if let Some(energy) = energy {
            archive.grown("energy", &[n, n_samples], energy)?;
        }
        archive.grown("last_t", &[n], last_t)?;
        archive.grown("last_state", &[n, n_state], last_state)?;
        archive.grown_texts("error", n, error)?;
        archive.finish()?;
        temporary.rename_to(&path)
    }
}

impl Sink for Npz<'_> {
    fn add(&mut self, chunk: &Chunk) -> Result<(), Error> {
        let added = chunk.rows().try_for_each(|(inputs, member)| self.append(inputs, member));
        added.map_err(|e| Error::io(self.path.display().to_string(), e))
    }

    fn finish(self: Box<Self>) -> Result<(), Error> {
        let path = self.path.display().to_string();
        self.pack().map_err(|e| Error::io(path, e))
    }
}

/// Numbers of one array, in a file that grows.
struct Grown {
    path: PathBuf,
    out: BufWriter<File>,
}

impl Grown {
    fn new(folder: &Path, name: &str) -> io::Result<Grown> {
        let path = folder.join(name);
        Ok(Grown { out: BufWriter::new(File::create(&path)?), path })
    }

    fn append(&mut self, mut values: impl Iterator<Item = f64>) -> io::Result<()> {
        values.try_for_each(|x| self.out.write_all(&x.to_le_bytes()))
    }

    /// What was written, to be read once.
    fn into_reader(mut self) -> io::Result<BufReader<File>> {
        self.out.flush()?;
        let file = File::open(&self.path)?;
        // Where a file without a name can be read, its bytes are gone with the reader, before the next entry is made.
        let _ = std::fs::remove_file(&self.path);
        Ok(BufReader::new(file))
    }
}

/// Texts, each with its length before it.
struct Texts {
    /// Number of characters of the longest.
    longest: usize,
    file: Grown,
}

impl Texts {
    fn append(&mut self, text: &str) -> io::Result<()> {
        self.longest = self.longest.max(text.chars().count());
        self.file.out.write_all(&(text.len() as u64).to_le_bytes())?;
        self.file.out.write_all(text.as_bytes())
    }
}

/// An archive of arrays; its entries have no dates, so that equal results are equal files.
pub(crate) struct Archive(ZipWriter<BufWriter<File>>);

impl Archive {
    /// Begins a file.
    pub(crate) fn new(path: &Path) -> io::Result<Archive> {
        Ok(Archive(ZipWriter::new(BufWriter::new(File::create(path)?))))
    }

    /// One axis of numbers.
    pub(crate) fn numbers(&mut self, name: &str, values: &[f64]) -> io::Result<()> {
        self.array(name, &[values.len()], values)
    }

    /// Numbers in the order of the last index first.
    pub(crate) fn array(&mut self, name: &str, shape: &[usize], values: &[f64]) -> io::Result<()> {
        self.entry(name, "f8", shape, |out| values.iter().try_for_each(|x| out.write_all(&x.to_le_bytes())))
    }

    fn grown(&mut self, name: &str, shape: &[usize], grown: Grown) -> io::Result<()> {
        let mut from = grown.into_reader()?;
        self.entry(name, "f8", shape, |out| io::copy(&mut from, out).map(|_| ()))
    }

    /// Strings, each filled up with zeros to the length of the longest.
    pub(crate) fn texts(&mut self, name: &str, texts: &[String]) -> io::Result<()> {
        let longest = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
        let kind = format!("U{longest}");
        self.entry(name, &kind, &[texts.len()], |out| texts.iter().try_for_each(|t| padded(out, t, longest)))
    }

    fn grown_texts(&mut self, name: &str, n: usize, texts: Texts) -> io::Result<()> {
        // NumPy has no strings of no characters.
        let longest = texts.longest.max(1);
        let mut from = texts.file.into_reader()?;
        self.entry(name, &format!("U{longest}"), &[n], |out| {
            let mut bytes = Vec::new();
            for _ in 0..n {
                let mut length = [0; 8];
                from.read_exact(&mut length)?;
                bytes.resize(u64::from_le_bytes(length) as usize, 0);
                from.read_exact(&mut bytes)?;
                padded(out, &String::from_utf8_lossy(&bytes), longest)?;
            }
            Ok(())
        })
    }

    /// One array: `kind` is NumPy's name of the type, `fill` writes values in the order of the last index first.
    ///
    /// # Source
    /// NumPy Enhancement Proposal 1, A simple file format for NumPy arrays, version 1.0.
    fn entry(
        &mut self,
        name: &str,
        kind: &str,
        shape: &[usize],
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> io::Result<()> {
        let stored =
            SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored).large_file(true);
        self.0.start_file(format!("{name}.npy"), stored).map_err(io::Error::from)?;
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
        fill(&mut out)?;
        out.flush()
    }

    /// Ends the file.
    pub(crate) fn finish(self) -> io::Result<()> {
        self.0.finish().map_err(io::Error::from)?.flush()
    }
}

/// A text as NumPy has it: four bytes for each of `longest` characters.
fn padded(out: &mut dyn Write, text: &str, longest: usize) -> io::Result<()> {
    let mut codes = text.chars().map(u32::from).chain(std::iter::repeat(0)).take(longest);
    codes.try_for_each(|code| out.write_all(&code.to_le_bytes()))
}
