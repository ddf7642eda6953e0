//! The files of an ensemble that are written from its first to its last trajectory.
//!
//! Does not know: how trajectories were computed, stores.

use std::path::{Path, PathBuf};

use super::chunk::{Heading, Sink};
use super::csv::Csv;
use super::npz::Npz;
use crate::error::Error;

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
    Svg,
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
            "svg" => Format::Svg,
            "zarr" => Format::Zarr,
            _ => {
                let reason = "has no known format: let the name end in .zarr, .csv or .npz, or, with --statistics, \
                              in .svg";
                return Err(Error::unusable(path.display().to_string(), reason));
            }
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
        self.format == Format::Svg
    }

    pub(super) fn format(&self) -> Format {
        self.format
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
            Format::Svg | Format::Zarr => None,
        })
    }
}
