//! Rotations as products of factors, quarter turns by rounded digits, and axes.
//!
//! Deliberately does not know: XML, robots.

use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2};

use crate::number::{Form, Number, vector};

/// Digits behind the point from which on an angle is a rounded quarter turn: 1.57 may be an angle of its own.
const MIN_DECIMALS: i32 = 4;
/// A smaller part of one, of a radian or of a direction, is what rounding left of zero: programs that turn frames write
/// `6.12323e-17`, the cosine of their `pi/2`.
pub(crate) const NOISE: f64 = 1e-12;
/// A change that doubles do not have is not told.
const TOLD: f64 = 1e-14;

/// A rotation by the numbers of a file.
#[derive(Clone, Debug)]
pub(crate) enum Rotation {
    /// By an angle about an axis, the first argument of `rot`.
    About(String, Number),
    /// By a quaternion `w, x, y, z` of any length.
    Quaternion([Number; 4]),
    /// The first axis along a vector, the second in its plane with another one.
    Axes([Number; 3], [Number; 3]),
}

impl Rotation {
    fn text(&self) -> String {
        match self {
            Rotation::About(axis, angle) => format!("rot({axis}, {})", angle.in_radians()),
            // R = 1 + 2 (w hat(v) + hat(v)^2)/(w^2 + v.v)
            Rotation::Quaternion([w, rest @ ..]) => {
                let v = vector(rest);
                let turned = match w.is_zero() {
                    true => format!("hat({v})*hat({v})"),
                    false => format!("({}*hat({v}) + hat({v})*hat({v}))", w.factor()),
                };
                let square = match w.is_zero() {
                    true => format!("dot({v}, {v})"),
                    false => format!("({}^2 + dot({v}, {v}))", w.factor()),
                };
                format!("(identity(3) + 2/{square}*{turned})")
            }
            Rotation::Axes(x, y) => {
                let (x, y) = (vector(x), vector(y));
                let z = format!("unit(cross({x}, {y}))");
                format!("transpose([unit({x}), cross({z}, unit({x})), {z}])")
            }
        }
    }

    /// Entries `w, x, y, z` of a quaternion of any length; nothing for zero.
    pub(crate) fn quaternion(&self) -> [Option<String>; 4] {
        let known = |number: &Number| (!number.is_zero()).then(|| number.in_radians());
        match self {
            Rotation::About(axis, angle) => {
                let half = format!("({})/2", angle.in_radians());
                let of = |k: usize| match axis.strip_prefix('e').and_then(|own| own.parse::<usize>().ok()) {
                    Some(own) => (own == k).then(|| format!("sin({half})")),
                    None => Some(format!("sin({half})*{axis}[{k}]")),
                };
                [Some(format!("cos({half})")), of(1), of(2), of(3)]
            }
            Rotation::Quaternion(entries) => entries.each_ref().map(known),
            Rotation::Axes(x, y) => {
                let matrix = self.text();
                let at = |i: usize, j: usize| format!("{matrix}[{i}, {j}]");
                // A row of the matrix `4 q q^T`, that of the largest entry of q.
                let trace = |signs: [&str; 3]| {
                    let terms = (1..=3).zip(signs).map(|(k, sign)| format!(" {sign} {}", at(k, k)));
                    Some(format!("1{}", terms.collect::<String>()))
                };
                let pair = |i: usize, sign: &str, j: usize| Some(format!("{} {sign} {}", at(i, j), at(j, i)));
                match largest_entry(x, y) {
                    0 => [trace(["+", "+", "+"]), pair(3, "-", 2), pair(1, "-", 3), pair(2, "-", 1)],
                    1 => [pair(3, "-", 2), trace(["+", "-", "-"]), pair(1, "+", 2), pair(1, "+", 3)],
                    2 => [pair(1, "-", 3), pair(1, "+", 2), trace(["-", "+", "-"]), pair(2, "+", 3)],
                    _ => [pair(2, "-", 1), pair(1, "+", 3), pair(2, "+", 3), trace(["-", "-", "+"])],
                }
            }
        }
    }
}

/// The number of the largest entry of the quaternion of the axes along `x` and near `y`, as [`Rotation::Axes`].
fn largest_entry(x: &[Number; 3], y: &[Number; 3]) -> usize {
    let [a, b] = [x, y].map(|v| [v[0].value, v[1].value, v[2].value]);
    let cross = |a: [f64; 3], b: [f64; 3]| -> [f64; 3] {
        std::array::from_fn(|k| a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3])
    };
    let unit = |v: [f64; 3]| {
        let length = v.iter().map(|x| x * x).sum::<f64>().sqrt();
        v.map(|x| x / length)
    };
    let (first, third) = (unit(a), unit(cross(a, b)));
    let [r, s, t] = [first[0], cross(third, first)[1], third[2]];
    let squares = [1.0 + r + s + t, 1.0 + r - s - t, 1.0 - r + s - t, 1.0 - r - s + t];
    (0..4).max_by(|i, j| squares[*i].total_cmp(&squares[*j])).unwrap_or(0)
}

/// A rotation that takes components in a frame to those in the frame before.
#[derive(Clone, Debug, Default)]
pub(crate) struct Turn {
    /// From left to right, each other than one.
    pub(crate) factors: Vec<Rotation>,
    /// Numbers as written, and the quarter turns in their place.
    pub(crate) moved: Vec<(String, String)>,
}

impl Turn {
    pub(crate) fn none() -> Turn {
        Turn::default()
    }

    /// The product; nothing where that has no factors.
    pub(crate) fn text(&self) -> Option<String> {
        let factors: Vec<String> = self.factors.iter().map(Rotation::text).collect();
        (!factors.is_empty()).then(|| factors.join("*"))
    }

    pub(crate) fn is_none(&self) -> bool {
        self.factors.is_empty()
    }

    /// Turns by an angle about an axis after the factors before.
    pub(crate) fn push(&mut self, axis: String, mut angle: Number) {
        if angle.is_zero() {
            return;
        }
        if angle.form == Form::Decimal && angle.value.abs() < NOISE {
            self.moved.push((angle.text, "0".into()));
            return;
        }
        if let Some(turns) = quarters(&angle) {
            let text = quarter_text(turns);
            let is_told = (angle.value - turns as f64 * FRAC_PI_2).abs() > TOLD;
            if is_told && angle.form == Form::Decimal {
                self.moved.push((angle.text.clone(), text.clone()));
            }
            angle = Number::expression(text, angle.value);
        }
        self.factors.push(Rotation::About(axis, angle));
    }

    /// The first axis along a direction and the second near another one. Nothing where they have no plane.
    pub(crate) fn axes(x: [Number; 3], y: [Number; 3]) -> Option<Turn> {
        let [a, b] = [&x, &y].map(|v| [v[0].value, v[1].value, v[2].value]);
        let square = |v: [f64; 3]| v.iter().map(|x| x * x).sum::<f64>();
        let across = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        if square(across) <= 1e-20 * square(a) * square(b) {
            return None;
        }
        Some(Turn { factors: vec![Rotation::Axes(x, y)], moved: Vec::new() })
    }

    /// The shortest rotation that puts the third axis along a direction. Nothing for zero.
    pub(crate) fn onto(z: [Number; 3]) -> Option<Turn> {
        let mut turn = Turn::none();
        let quarter = |sign: &str| Number::expression(format!("{sign}pi/2"), 0.0);
        match Axis::new(&z)?.along {
            Some((2, false)) => {}
            Some((2, true)) => {
                turn.factors.push(Rotation::About("e1".into(), Number::expression("pi", 0.0)));
            }
            Some((k, is_against)) => {
                let axis = if k == 0 { "e2" } else { "e1" };
                let sign = if is_against == (k == 0) { "-" } else { "" };
                turn.factors.push(Rotation::About(axis.into(), quarter(sign)));
            }
            // The quaternion `n + z3, -z2, z1, 0` with the length n; near the opposite direction that sum would lose
            // its digits. It is one number of the file in several places, and no parameters.
            None => {
                let [x, y, _] = &z;
                let [w, against] = [&z[2], &z[2].negative()].map(|number| number.factor());
                let (n, value) = (format!("norm({})", vector(&z)), 1.0);
                let first = match z[2].value < 0.0 {
                    true => format!("({}^2 + {}^2)/({n} + {against})", x.factor(), y.factor()),
                    false => format!("{n} + {w}"),
                };
                let entry = |n: Number| match n.is_zero() {
                    true => n,
                    false => Number::expression(n.text, n.value),
                };
                let entries =
                    [Number::expression(first, value), entry(y.negative()), entry(x.clone()), Number::zero()];
                turn.factors.push(Rotation::Quaternion(entries));
            }
        }
        Some(turn)
    }
}

/// The number of quarter turns that an angle stands for.
fn quarters(angle: &Number) -> Option<i64> {
    let turns = (angle.value / FRAC_PI_2).round();
    let difference = (angle.value - turns * FRAC_PI_2).abs();
    let is_near = match angle.form {
        Form::Expression => false,
        Form::Degrees => Number::decimal(&(90.0 * turns).to_string())
            .is_some_and(|quarters| quarters.equals(&Number { form: Form::Decimal, ..angle.clone() })),
        Form::Decimal => {
            let tolerance = 10f64.powi(-angle.n_decimals().min(300)).max(4.0 * f64::EPSILON);
            difference <= tolerance && angle.n_decimals() >= MIN_DECIMALS
        }
    };
    (turns != 0.0 && turns.abs() <= 8.0 && is_near).then_some(turns as i64)
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

/// Rotation about the axes of the frame before by the angles roll, pitch and yaw, with quarter turns where digits are
/// rounded ones.
pub(crate) fn roll_pitch_yaw(angles: &[Number; 3]) -> Turn {
    let mut turn = Turn::none();
    for k in (0..3).rev() {
        turn.push(format!("e{}", k + 1), angles[k].clone());
    }
    turn.moved.reverse();
    turn
}

/// Rotation by a quaternion of any length; nothing for zero.
pub(crate) fn quaternion(entries: &[Number; 4]) -> Option<Turn> {
    let others: Vec<usize> = (0..4).filter(|k| !entries[*k].is_zero()).collect();
    let mut turn = Turn::none();
    let about = |k: usize, text: &str| Rotation::About(format!("e{k}"), Number::expression(text, 0.0));
    match others[..] {
        [] => return None,
        [0] => {}
        [k] => turn.factors.push(about(k, "pi")),
        [0, k] if is_quarter(&entries[0], &entries[k]) => {
            let is_negative = (entries[0].value < 0.0) != (entries[k].value < 0.0);
            let text = if is_negative { "-pi/2" } else { "pi/2" };
            turn.factors.push(about(k, text));
            if (entries[0].value.abs() - entries[k].value.abs()).abs() > TOLD {
                let written = [&entries[0], &entries[k]].map(|n| n.text.clone()).join(", ");
                turn.moved.push((written, text.to_owned()));
            }
        }
        _ => turn.factors.push(Rotation::Quaternion(entries.clone())),
    }
    Some(turn)
}

/// Whether both entries of a quaternion are equal, or rounded roots of one half.
fn is_quarter(a: &Number, b: &Number) -> bool {
    let is_rounded = |n: &Number| {
        let tolerance = 10f64.powi(-n.n_decimals().min(300)).max(4.0 * f64::EPSILON);
        n.n_decimals() >= MIN_DECIMALS && (n.value.abs() - FRAC_1_SQRT_2).abs() <= tolerance
    };
    a.equals(b) || a.equals(&b.negative()) || (is_rounded(a) && is_rounded(b))
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
    /// The rotation `R` with `vector = R of_rotation`.
    turned: Option<String>,
    /// Its largest component before that rotation.
    pub(crate) largest: usize,
}

impl Axis {
    /// The axis by its components in another frame, `turn` times its own.
    pub(crate) fn turned(self, turn: &str) -> Axis {
        let vector = format!("({turn}*{})", self.vector);
        Axis { vector, along: None, turned: Some(turn.to_owned()), ..self }
    }

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
                    turned: None,
                    largest: k,
                })
            }
            _ => {
                let size = |k: &usize| entries[*k].value.abs();
                let largest = others.into_iter().max_by(|a, b| size(a).total_cmp(&size(b)))?;
                let vector = format!("unit({})", vector(entries));
                let of_rotation = (vector.clone(), false);
                Some(Axis { vector, of_rotation, along: None, turned: None, largest })
            }
        }
    }

    /// The rotation from the frame in which it was written, where there is one.
    pub(crate) fn frame(&self) -> Option<&String> {
        self.turned.as_ref()
    }

    /// Its vector there, where that is along no coordinate axis.
    pub(crate) fn oblique(&self) -> Option<&String> {
        let (vector, _) = &self.of_rotation;
        vector.starts_with("unit").then_some(vector)
    }

    /// The rotation by an angle, an expression of one word.
    pub(crate) fn rotation(&self, angle: &str) -> String {
        let (axis, is_against) = &self.of_rotation;
        let sign = if *is_against { "-" } else { "" };
        let about = format!("rot({axis}, {sign}{angle})");
        // A rotation about R a is R rot(a) R^T.
        match &self.turned {
            Some(turn) => format!("{turn}*{about}*transpose({turn})"),
            None => about,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{Number, quaternion, roll_pitch_yaw};

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
        let degrees = roll_pitch_yaw(&["-90", "30", "0"].map(|w| Number::decimal(w).unwrap().in_degrees()));
        assert_eq!(degrees.text().unwrap(), "rot(e2, 30*pi/180)*rot(e1, -pi/2)");
    }

    #[test]
    fn quaternions_of_quarter_turns_are_found() {
        let of = |written: [&str; 4]| quaternion(&written.map(|w| Number::decimal(w).unwrap()));
        assert!(of(["0", "0", "0", "0"]).is_none());
        assert!(of(["-2", "0", "0", "0"]).unwrap().is_none());
        assert_eq!(of(["0", "0", "-1", "0"]).unwrap().text().unwrap(), "rot(e2, pi)");
        assert_eq!(of([".7", "0", "0", "-0.70"]).unwrap().text().unwrap(), "rot(e3, -pi/2)");
        let rounded = of(["0.7071", "0.70711", "0", "0"]).unwrap();
        assert_eq!(rounded.text().unwrap(), "rot(e1, pi/2)");
        assert_eq!(rounded.moved.len(), 1);
        let other = of(["1", "0", "2", "0"]).unwrap().text().unwrap();
        assert!(other.starts_with("(identity(3) + 2/(1^2 + dot([0, 2, 0], [0, 2, 0]))*"), "{other}");
    }
}
