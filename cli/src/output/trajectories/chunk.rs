//! Trajectories of an ensemble in the pieces in which they are integrated and written.
//!
//! Does not know: how they were computed, formats.

use hamel_run::error::Error;
use hamel_run::info::Info;
use hamel_run::members::{Member, Members};

/// What is known of an ensemble before anything is integrated.
#[derive(Clone, Debug)]
pub(crate) struct Heading<'a> {
    pub(crate) info: &'a Info,
    /// Names of what varies.
    pub(crate) input_names: Vec<String>,
    /// Times of samples.
    pub(crate) times: Vec<f64>,
    /// Number of trajectories.
    pub(crate) n: usize,
    /// Number of trajectories of a chunk; the last one may have fewer.
    pub(crate) n_chunk: usize,
}

impl Heading<'_> {
    /// Number of chunks.
    pub(crate) fn n_chunks(&self) -> usize {
        self.n.div_ceil(self.n_chunk)
    }

    /// The trajectories of a chunk.
    pub(crate) fn range(&self, chunk: usize) -> std::ops::Range<usize> {
        let first = chunk * self.n_chunk;
        first..(first + self.n_chunk).min(self.n)
    }
}

/// Some trajectories in a row: a function of the request and of their numbers alone.
#[derive(Clone, Debug)]
pub(crate) struct Chunk {
    /// Number of the chunk.
    pub(crate) at: usize,
    /// Number of its first trajectory.
    pub(crate) first: usize,
    /// What varies, a line for each trajectory; NaN for what was not drawn because nothing could be drawn around.
    pub(crate) inputs: Vec<f64>,
    /// What became of each.
    pub(crate) results: Members,
}

impl Chunk {
    /// What varies, and what became of it, of each trajectory.
    pub(crate) fn rows(&self) -> impl Iterator<Item = (&[f64], Member<'_>)> {
        let n = self.inputs.len() / self.results.len().max(1);
        self.results.iter().enumerate().map(move |(k, result)| (&self.inputs[k * n..(k + 1) * n], result))
    }
}

/// Something that takes chunks and makes a file of them.
pub(crate) trait Sink: Send {
    /// Takes a chunk.
    ///
    /// # Errors
    /// [`Error::Io`].
    fn add(&mut self, chunk: &Chunk) -> Result<(), Error>;

    /// Puts the file into its place, after the last chunk.
    ///
    /// # Errors
    /// [`Error::Io`].
    fn finish(self: Box<Self>) -> Result<(), Error>;
}

/// How many trajectories there are, and what became of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Tally {
    pub(crate) n: usize,
    pub(crate) n_stopped: usize,
    pub(crate) steps: u64,
    /// The first that stopped, and why.
    pub(crate) first_stopped: Option<(usize, String)>,
}

impl Tally {
    /// Counts the trajectories of a chunk; chunks come in their order.
    pub(crate) fn add(&mut self, chunk: &Chunk) {
        self.n += chunk.results.len();
        for (k, result) in chunk.results.iter().enumerate() {
            self.steps += result.steps();
            if let Some(error) = result.error() {
                self.n_stopped += 1;
                self.first_stopped.get_or_insert_with(|| (chunk.first + k, error.to_owned()));
            }
        }
    }
}
