//! Tests of programs compiled in memory.

mod every_operation;
mod four_lanes;
mod inputs;
mod rows;
