//! Trajectories of an ensemble as files, written while they are integrated: CSV for everybody, NPZ for NumPy, a Zarr
//! store for ensembles that several processes make, or one that is interrupted.
//!
//! Does not know: how they were computed.

pub(crate) mod chunk;
mod csv;
pub(crate) mod gathered;
pub(crate) mod npz;
pub(crate) mod store;
pub(crate) mod summary;
mod target;
mod tree;
pub(crate) mod zarr;

pub use gathered::Statistic;
pub(super) use npz::Archive;
pub use target::Target;
