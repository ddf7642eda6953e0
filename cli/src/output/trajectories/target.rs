//! The files of an ensemble that are written from its first to its last trajectory.
//!
//! Does not know: how trajectories were computed, stores.

use std::path::{Path, PathBuf};

use super::chunk::{Heading, Sink};
use super::csv::Csv;
use super::npz::Npz;
use super::store::finished_chunks;
use crate::output::picture::{ENDINGS, Picture};
use hamel_run::error::Error;

/// A file or store to write and its format, which its extension says.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Target {
    path: PathBuf,
    format: Format,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Csv,
    Npz,
    Figure(Picture),
    Zarr,
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
            "npz" => Format::Npz,
            "zarr" => Format::Zarr,
            _ => match Picture::of(path) {
                Some(picture) => Format::Figure(picture),
                None => {
                    let reason = format!(
                        "has no known format: let the name end in .zarr, .csv or .npz, or, with --statistics, in \
                         {ENDINGS}"
                    );
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

    /// Whether several processes can write it, and one can go on with it.
    pub fn is_store(&self) -> bool {
        self.format == Format::Zarr
    }

    /// Whether the file is a figure.
    pub fn is_figure(&self) -> bool {
        matches!(self.format, Format::Figure(_))
    }

    pub(super) fn format(&self) -> Format {
        self.format
    }

    /// Bytes that a trajectory takes at least: every number as it is stored, and in a table a digit with a comma.
    pub(crate) fn n_bytes(&self, heading: &Heading<'_>) -> u128 {
        let of_sample = heading.info.state.len() + usize::from(heading.info.has_energy);
        let (n_samples, n_inputs) = (heading.times.len() as u128, heading.input_names.len() as u128);
        let numbers = n_samples * of_sample as u128 + n_inputs;
        match self.format {
            Format::Csv => 2 * (n_samples * (of_sample as u128 + n_inputs + 2)),
            Format::Npz => 8 * (numbers + 1 + heading.info.state.len() as u128) + 4,
            Format::Zarr => 8 * (numbers + 1) + 1,
            Format::Figure(_) => 0,
        }
    }

    /// Trajectories that are there already, in a store.
    pub(crate) fn n_finished(&self, heading: &Heading<'_>) -> usize {
        if !self.is_store() {
            return 0;
        }
        let chunks = std::fs::read_dir(finished_chunks(&self.path)).map_or(0, Iterator::count);
        chunks.saturating_mul(heading.n_chunk)
    }

    /// Begins the file; none for a store, which is [opened](super::store::Store), and for a figure, which has no
    /// trajectories.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub(crate) fn sink<'a>(&self, heading: &Heading<'a>) -> Result<Option<Box<dyn Sink + 'a>>, Error> {
        Ok(match self.format {
            Format::Csv => Some(Box::new(Csv::new(&self.path, heading)?)),
            Format::Npz => Some(Box::new(Npz::new(&self.path, heading)?)),
            Format::Figure(_) | Format::Zarr => None,
        })
    }
}
