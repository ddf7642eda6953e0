//! Exact rationals as text, for programs that are stored: `3/4`.
//!
//! Does not know: programs.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serializer};

use hamel_expr::Rational;

pub(super) fn serialize<S: Serializer>(value: &Rational, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_str(value)
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Rational, D::Error> {
    let text = String::deserialize(deserializer)?;
    text.parse().map_err(|_| D::Error::custom(format!("{text:?} is no rational number")))
}
