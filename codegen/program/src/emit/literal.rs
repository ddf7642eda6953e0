//! Numbers as text.
//!
//! Deliberately does not know: what the numbers are of.

/// A number as target languages read it back, bit for bit.
pub(super) fn number(x: f64) -> String {
    // A minus sign is an operator there.
    if x.is_sign_negative() { format!("({x:?})") } else { format!("{x:?}") }
}
