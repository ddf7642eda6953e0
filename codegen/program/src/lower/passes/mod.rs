//! Passes from a program to a program, each of which leaves every value of every function as it is, up to rounding.
//!
//! The order in which they run stands in [`PASSES`]; none calls another. Does not know: expressions, mechanics.

mod copies;
mod factors;
mod fuse;
mod pair;
mod receivers;
mod signs;
mod slots;

use crate::program::Program;

/// A pass and what it is called in messages.
pub(super) type Pass = (&'static str, fn(&mut Program));

/// All passes in order.
pub(super) const PASSES: [Pass; 9] = [
    ("fused sums", fuse::fuse),
    ("signs of functions", signs::absorb_in_functions),
    ("signs of prepared numbers", signs::negate_slots),
    ("signs of the prepare part", signs::absorb_in_prepare),
    ("order of factors", factors::order_factors),
    ("order of slots", slots::order_slots),
    ("copies of prepared numbers", copies::copy_slots),
    ("pairs of sines and cosines", pair::pair),
    ("variables before numbers", receivers::order_receivers),
];
