//! The intermediate form: a flat, verified [`Program`] in static single assignment, apart from the passes that make it.
//!
//! `ir` is the data, `table` that of sums over tables of products, `role` says what a function is for, `report` what
//! became of the search for its form, `counts` and `cost` say what it costs, `verify` checks the rules, `edit` is what
//! every pass that rewrites a program needs, `interpret` runs a program with the very operations that emitted code
//! performs, `rounding` bounds their errors, `round_trip` turns it back into expressions, `series` turns a right-hand
//! side into the recurrence of the Taylor coefficients of its solutions, `circles` into one that takes sines and
//! cosines from the state. Does not know: mechanics, how expressions become programs, Rust.

mod circles;
pub mod cost;
mod counts;
pub mod edit;
mod interpret;
mod ir;
mod listing;
mod report;
mod role;
mod round_trip;
mod rounding;
mod series;
mod table;
#[cfg(feature = "serde")]
mod text;
mod verify;

pub use circles::Circles;
pub use counts::Counts;
pub use hamel_expr::Relation;
pub use interpret::{Point, Run, ViolatedCondition};
pub use ir::{
    Condition, Constant, Function, Instruction, Literal, Op, Operand, Prepare, Program, Signs, Slot,
    completes_pair, place_of_two,
};
pub use report::{FallBack, Limit, Loss, Report, Search};
pub use role::Role;
pub use round_trip::Symbols;
pub use rounding::Bounded;
pub use series::{Jet, ProductKind, SeriesRoom};
pub use table::Place;
pub use table::{Contraction, Factors, Products, Table};
pub use verify::{verify, verify_rules};
