//! Places and attitudes by frames in frames before, as expressions.
//!
//! Deliberately does not know: links, joints.

use crate::number::{Number, ZERO, vector};
use crate::robot::Pose;
use crate::rotation::Rotation;

/// A point of a frame, by its terms there, in the frame before.
pub(crate) fn placed(pose: &Pose, mut terms: Vec<String>) -> Vec<String> {
    let known = |v: &[Number; 3]| (!v.iter().all(Number::is_zero)).then(|| vector(v));
    terms.splice(0..0, known(&pose.anchor));
    if let Some(turn) = pose.turn.text() {
        terms = turned(&turn, terms);
    }
    terms.splice(0..0, known(&pose.place));
    terms
}

/// The origin of a frame in the frame before.
pub(crate) fn origin(pose: &Pose) -> Vec<String> {
    placed(pose, Vec::new())
}

/// The origin of the last of some frames, each in the one before it, in the frame before the first.
pub(crate) fn origin_of(frames: &[Pose]) -> Vec<String> {
    frames.iter().rev().fold(Vec::new(), |terms, pose| placed(pose, terms))
}

/// The rotation of the last of some frames, as [`origin_of`]; nothing where that is one.
pub(crate) fn turn_of(frames: &[Pose]) -> Option<String> {
    let factors: Vec<String> = frames.iter().filter_map(|pose| pose.turn.text()).collect();
    (!factors.is_empty()).then(|| factors.join("*"))
}

pub(crate) fn sum(terms: &[String]) -> String {
    if terms.is_empty() { ZERO.to_owned() } else { terms.join(" + ") }
}

/// A sum in parentheses.
pub(crate) fn in_product(text: &str) -> String {
    match text.contains(" + ") || text.contains("- ") {
        true => format!("({text})"),
        false => text.to_owned(),
    }
}

/// A rotated sum; zero stays.
pub(crate) fn turned(rotation: &str, terms: Vec<String>) -> Vec<String> {
    if terms.is_empty() {
        return terms;
    }
    vec![format!("{rotation}*{}", in_product(&sum(&terms)))]
}

/// The quaternion of a product of rotations, of length one; nothing where that is one.
pub(crate) fn quaternion<'a>(factors: impl Iterator<Item = &'a Rotation> + Clone) -> Option<String> {
    let is_unit = factors.clone().all(|factor| matches!(factor, Rotation::About(..)));
    let product = factors.map(Rotation::quaternion).reduce(|p, q| times(&p, &q))?;
    let entries = product.map(|entry| entry.unwrap_or_else(|| "0".to_owned())).join(", ");
    Some(if is_unit { format!("[{entries}]") } else { format!("unit([{entries}])") })
}

/// Entries of a quaternion `w, x, y, z`; nothing for zero.
type Entries = [Option<String>; 4];

/// `p q = [p0 q0 - p.q, p0 q + q0 p + p x q]` with vectors `p`, `q` behind the first entries.
fn times(p: &Entries, q: &Entries) -> Entries {
    // By entry the factors of its four terms, and whether they are taken off.
    const TERMS: [[(usize, usize, bool); 4]; 4] = [
        [(0, 0, false), (1, 1, true), (2, 2, true), (3, 3, true)],
        [(0, 1, false), (1, 0, false), (2, 3, false), (3, 2, true)],
        [(0, 2, false), (2, 0, false), (3, 1, false), (1, 3, true)],
        [(0, 3, false), (3, 0, false), (1, 2, false), (2, 1, true)],
    ];
    TERMS.map(|terms| {
        let mut total = String::new();
        for (i, j, is_taken_off) in terms {
            let (Some(a), Some(b)) = (&p[i], &q[j]) else { continue };
            total.push_str(match (total.is_empty(), is_taken_off) {
                (true, false) => "",
                (true, true) => "-",
                (false, false) => " + ",
                (false, true) => " - ",
            });
            total.push_str(&format!("{}*{}", factor(a), factor(b)));
        }
        (!total.is_empty()).then_some(total)
    })
}

fn factor(text: &str) -> String {
    if text.starts_with('-') { format!("({text})") } else { in_product(text) }
}
