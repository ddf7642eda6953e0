//! Tests of programs compiled in memory.

mod every_operation;
mod inputs;
