//! Scenes of the models that the program comes with, which it knows by heart: nothing is derived to list them.
//!
//! `scenes.json` is made by `UPDATE_EXPECT=1 cargo test -p hamel --test main -- listed:: --include-ignored`, which the
//! same test compares with scenes that are derived. A text that is another one by a letter is not known.
//!
//! Does not know: how a scene is derived.

use std::sync::OnceLock;

use serde::{Deserialize, Serialize};

pub use super::scene::Scene;

/// A model that is known by heart.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Known {
    /// Its name.
    pub model: String,
    /// The [fingerprint] of its text.
    pub text: String,
    /// Its scenes in order.
    pub scenes: Vec<Scene>,
}

/// Every model that is known by heart.
pub fn known() -> &'static [Known] {
    static KNOWN: OnceLock<Vec<Known>> = OnceLock::new();
    // A table that cannot be read is one that knows nothing; the tests read it.
    KNOWN.get_or_init(|| serde_json::from_str(include_str!("scenes.json")).unwrap_or_default())
}

/// The scenes of a model with this text, if they are known by heart.
pub(super) fn scenes(model: &str, text: &str) -> Option<Vec<Scene>> {
    let found = known().iter().find(|known| known.model == model)?;
    (found.text == fingerprint(text)).then(|| found.scenes.clone())
}

/// Tells texts apart, on every machine and by every version: the hash FNV-1a of 64 bits (Fowler, Noll, Vo).
pub fn fingerprint(text: &str) -> String {
    let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3)
    });
    format!("{hash:016x}")
}
