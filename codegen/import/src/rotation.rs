//! Constant rotations: quarter turns, and angles as written.
//!
//! Deliberately does not know: XML, robots.

use std::f64::consts::FRAC_PI_2;

use crate::number::Number;

/// Digits behind the point from which on an angle is a rounded quarter turn: 1.57 may be an angle of its own.
const MIN_DECIMALS: i32 = 4;
/// A change that doubles do not have is not told.
const TOLD: f64 = 1e-14;

/// Rotation about the axes of the frame before by the angles roll, pitch and yaw.
#[derive(Clone, Debug)]
pub(crate) struct Turn {
    /// In radians: zeros, quarter turns as multiples of pi, others as written.
    pub(crate) angles: [Number; 3],
    /// Angles as written, and the quarter turns in their place.
    pub(crate) moved: Vec<(String, String)>,
}

impl Turn {
    pub(crate) fn none() -> Turn {
        Turn { angles: std::array::from_fn(|_| Number::zero()), moved: Vec::new() }
    }

    /// `rot(e3, yaw)*rot(e2, pitch)*rot(e1, roll)` without rotations by zero; nothing where all are.
    pub(crate) fn text(&self) -> Option<String> {
        let factors: Vec<String> = (0..3)
            .rev()
            .filter(|k| !self.angles[*k].is_zero())
            .map(|k| format!("rot(e{}, {})", k + 1, self.angles[k].text))
            .collect();
        (!factors.is_empty()).then(|| factors.join("*"))
    }
}

/// The number of quarter turns that an angle stands for.
fn quarters(angle: &Number) -> Option<i64> {
    if angle.is_zero() {
        return Some(0);
    }
    let turns = (angle.value / FRAC_PI_2).round();
    let tolerance = 10f64.powi(-angle.n_decimals().min(300)).max(4.0 * f64::EPSILON);
    let is_near = (angle.value - turns * FRAC_PI_2).abs() <= tolerance;
    (turns != 0.0 && turns.abs() <= 8.0 && is_near && angle.n_decimals() >= MIN_DECIMALS)
        .then_some(turns as i64)
}

fn quarter_text(turns: i64) -> String {
    match turns {
        1 => "pi/2".into(),
        -1 => "-pi/2".into(),
        n if n % 2 == 0 => match n / 2 {
            1 => "pi".into(),
            -1 => "-pi".into(),
            m => format!("{m}*pi"),
        },
        n => format!("{n}*pi/2"),
    }
}

/// The rotation by angles as they are written, with quarter turns where digits are rounded ones.
pub(crate) fn roll_pitch_yaw(angles: &[Number; 3]) -> Turn {
    let mut turn = Turn { angles: angles.clone(), moved: Vec::new() };
    for angle in &mut turn.angles {
        let Some(turns) = quarters(angle).filter(|turns| *turns != 0) else { continue };
        let text = quarter_text(turns);
        if (angle.value - turns as f64 * FRAC_PI_2).abs() > TOLD {
            turn.moved.push((angle.text.clone(), text.clone()));
        }
        angle.text = text;
        angle.is_quarter = true;
    }
    turn
}

/// An axis: its direction as an expression of length one.
#[derive(Clone, Debug)]
pub(crate) struct Axis {
    /// The vector.
    pub(crate) vector: String,
    /// The first argument of `rot`, and the sign of its angle.
    pub(crate) of_rotation: (String, bool),
    /// The number of the coordinate axis along which it is, and whether it is against it.
    pub(crate) along: Option<(usize, bool)>,
}

impl Axis {
    /// Nothing for an axis of length zero.
    pub(crate) fn new(entries: &[Number; 3]) -> Option<Axis> {
        let others: Vec<usize> = (0..3).filter(|k| !entries[*k].is_zero()).collect();
        match others[..] {
            [] => None,
            [k] => {
                let is_against = entries[k].value < 0.0;
                let mut unit = ["0", "0", "0"];
                unit[k] = if is_against { "-1" } else { "1" };
                Some(Axis {
                    vector: format!("[{}]", unit.join(", ")),
                    of_rotation: (format!("e{}", k + 1), is_against),
                    along: Some((k, is_against)),
                })
            }
            _ => {
                let vector = format!("unit({})", crate::number::vector(entries));
                Some(Axis { vector: vector.clone(), of_rotation: (vector, false), along: None })
            }
        }
    }

    /// The rotation by an angle, an expression of one word.
    pub(crate) fn rotation(&self, angle: &str) -> String {
        let (axis, is_against) = &self.of_rotation;
        let sign = if *is_against { "-" } else { "" };
        format!("rot({axis}, {sign}{angle})")
    }
}

#[cfg(test)]
mod tests {
    use super::{Number, roll_pitch_yaw};

    fn turn(written: [&str; 3]) -> super::Turn {
        roll_pitch_yaw(&written.map(|w| Number::decimal(w).unwrap()))
    }

    #[test]
    fn quarter_turns_are_found_by_the_digits_that_are_written() {
        let exact = turn(["1.5707963267948966", "0", "-3.141592653589793"]);
        assert_eq!(exact.text().unwrap(), "rot(e3, -pi)*rot(e1, pi/2)");
        assert!(exact.moved.is_empty());
        let rounded = turn(["0", "-1.5708", "0"]);
        assert_eq!(rounded.text().unwrap(), "rot(e2, -pi/2)");
        assert_eq!(rounded.moved, [("-1.5708".to_owned(), "-pi/2".to_owned())]);
        assert_eq!(turn(["0", "1.57", "0"]).text().unwrap(), "rot(e2, 1.57)");
        assert_eq!(turn(["0", "1.5709", "0"]).text().unwrap(), "rot(e2, 1.5709)");
        assert!(turn(["0", "0.0", "-0"]).text().is_none());
    }
}
