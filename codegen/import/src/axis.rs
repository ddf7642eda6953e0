//! The axis of a joint by the numbers of a file.
//!
//! Does not know: formats, what a joint does.

use std::ops::Range;

use crate::number::{Number, vector};
use crate::rotation::{Axis, NOISE};
use crate::xml::Reader;

/// The axis of a joint, with a note where rounding had left something of components that are zero; an error for zero.
pub(crate) fn axis_of_joint(
    reader: &Reader<'_>,
    place: &Range<usize>,
    name: &str,
    entries: &[Number; 3],
) -> Option<Axis> {
    let largest = entries.iter().fold(0.0_f64, |max, entry| max.max(entry.value.abs()));
    let taken =
        entries.clone().map(|entry| if entry.value.abs() < NOISE * largest { Number::zero() } else { entry });
    let is_moved = taken.iter().zip(entries).any(|(taken, written)| taken.is_zero() && !written.is_zero());
    if is_moved {
        let message =
            format!("the axis {} of joint `{name}` is taken as {}", vector(entries), vector(&taken));
        reader.note_with_help(
            place,
            message,
            "turn the joint by its frame if it is meant to lean by so little",
        );
    }
    let axis = Axis::new(&taken);
    if axis.is_none() {
        let message = format!("the axis of joint `{name}` is zero");
        reader.error(place, message, "write a direction such as `0 0 1`");
    }
    axis
}
