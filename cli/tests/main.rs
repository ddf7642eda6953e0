//! Tests of the command line, and of the library behind it.

mod accelerations;
mod common;

mod book;
mod cache;
mod check_and_fmt;
mod closed_loops;
mod discrete;
#[cfg(feature = "lsp")]
mod editor;
mod ensemble;
mod event_cases;
mod events;
mod fit;
mod fmus;
mod folds;
mod forms;
mod inputs;
mod listed;
mod matrices;
mod noise;
mod outputs;
mod outside;
mod pairs;
mod program;
mod protocol;
mod reference;
mod report;
mod sensitivity;
mod signs;
mod singular;
mod sizes;
mod starts;
mod store;
mod trim;
