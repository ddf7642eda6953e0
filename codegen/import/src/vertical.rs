//! The direction and the acceleration of gravity.
//!
//! Deliberately does not know: links, XML.

use crate::number::{Number, vector};
use crate::rotation::Axis;

/// Gravity as the model has it.
#[derive(Clone, Debug)]
pub(crate) struct Vertical {
    /// The direction against gravity, of length one.
    pub(crate) up: String,
    /// The item that declares `g`.
    pub(crate) gravity: String,
}

impl Vertical {
    /// Nothing without gravity.
    pub(crate) fn new(acceleration: &[Number; 3]) -> Option<Vertical> {
        let against = acceleration.each_ref().map(Number::negative);
        let axis = Axis::new(&against)?;
        let doc = "/// Acceleration of gravity in m/s^2.";
        let gravity = match axis.along {
            Some((k, is_against)) => {
                let value = if is_against { acceleration[k].clone() } else { against[k].clone() };
                format!("{doc}\nparam g = {};\n", value.text)
            }
            None => format!("{doc}\nlet g = norm({});\n", vector(&against)),
        };
        Some(Vertical { up: axis.vector, gravity })
    }
}
