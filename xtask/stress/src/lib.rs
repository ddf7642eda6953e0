//! How far the models are from exact: rounding errors of every generated function, extreme parameters, ways
//! towards singularities, and drifts of long runs.
//!
//! Deliberately does not know: the models; those are named in the tables of [`sweeps`], [`bounds`] and [`run`].

pub mod accuracy;
pub mod bounds;
pub mod motion;
pub mod report;
pub mod request;
pub mod run;
pub mod sample;
pub mod subject;
pub mod sweeps;
