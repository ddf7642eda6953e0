//! Tests of single modules of the generator, by what they offer to each other.
//!
//! Beside the library, not in it: it is compiled once. What a module keeps to itself is tested in its own file.

mod config;
mod dirac;
mod emit;
mod groups;
mod lower;
mod origin;
mod scene;
mod spec;
