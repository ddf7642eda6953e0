//! Random numbers for points: the same sequence everywhere.
//!
//! Does not know: what is drawn.

use hamel_expr::uniform;

use super::wide::Wide;

/// A sequence of random numbers.
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Random {
        Random(seed)
    }

    /// Between `-1` and `1`.
    pub(super) fn symmetric(&mut self) -> f64 {
        2.0 * uniform(&mut self.0) - 1.0
    }

    pub(super) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * uniform(&mut self.0)
    }

    /// Of a size near one, with any sign.
    pub(super) fn signed(&mut self) -> f64 {
        let size = self.between(0.3, 1.3);
        if self.symmetric() < 0.0 { -size } else { size }
    }

    pub(super) fn vector(&mut self, n: usize) -> Vec<Wide> {
        (0..n).map(|_| Wide::exact(self.signed())).collect()
    }
}
