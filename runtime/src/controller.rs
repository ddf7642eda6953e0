//! Choice of the next step size from the error of the last.
//!
//! The module deliberately does not know states or methods: it sees sizes and squares of norms. Powers are
//! approximate, without functions of a library: every step waits for them, and sequences of steps are the same on
//! every platform.

/// Proportional-integral control of the step size.
///
/// ```text
/// h_new = h * clamp(safety err_previous^beta / err^(1/q - 0.75 beta))
/// ```
///
/// # Source
///
/// Hairer and Wanner, Solving Ordinary Differential Equations II (1996), section IV.2; beta = 0.2/q,
/// which is the 0.04 of their code DOPRI5 with q = 5.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Controller {
    exponent: f64,
    beta: f64,
    /// `log2 err_previous`.
    previous_log: f64,
    after_rejection: bool,
    /// Whether the exponents are so small that logarithms need one place only.
    is_flat: bool,
}

impl Controller {
    const SAFETY: f64 = 0.9;
    const SHRINK: f64 = 0.2;
    const GROW: f64 = 10.0;
    /// Logarithm of `1e-4`: a smaller error of the step before is luck, and not to be built upon.
    const LEAST_LOG: f64 = -4.0 * core::f64::consts::LOG2_10;

    /// Order of estimates from which on a factor hardly depends on its error: a tenth of its logarithm is one half of
    /// a per cent of the step.
    const FLAT: u32 = 12;

    /// A controller for an error estimate which is `O(h^order)`.
    pub(crate) fn new(order: u32) -> Self {
        let is_flat = order >= Self::FLAT;
        let order = f64::from(order);
        let beta = 0.2 / order;
        Self {
            exponent: 1.0 / order - 0.75 * beta,
            beta,
            previous_log: Self::LEAST_LOG,
            after_rejection: false,
            is_flat,
        }
    }

    /// The step to take after a step `h` whose error has a square of at most one.
    #[inline]
    pub(crate) fn accept(&mut self, h: f64, square: f64) -> f64 {
        let (next, log) = self.after(h, square);
        self.previous_log = log;
        self.after_rejection = false;
        next
    }

    /// What [`accept`](Self::accept) says, of a step that was cut to land on an end: nothing is remembered.
    pub(crate) fn accept_cut(&self, h: f64, square: f64) -> f64 {
        self.after(h, square).0
    }

    /// The step to take, and the logarithm of the error to remember.
    #[inline(always)]
    fn after(&self, h: f64, square: f64) -> (f64, f64) {
        let log = 0.5 * if self.is_flat { chord_log2(square) } else { log2(square) };
        let power = self.beta * self.previous_log - self.exponent * log;
        let factor = Self::SAFETY * if self.is_flat { small_exp2(power) } else { exp2(power) };
        let next = h * factor.clamp(Self::SHRINK, Self::GROW);
        (if self.after_rejection { next.min(h) } else { next }, log.max(Self::LEAST_LOG))
    }

    /// The step to try after a step `h` whose error has a square above one, infinite included.
    pub(crate) fn reject(&mut self, h: f64, square: f64) -> f64 {
        self.after_rejection = true;
        h * (Self::SAFETY * exp2(-self.exponent * 0.5 * log2(square))).max(Self::SHRINK)
    }

    /// The step to try after a step `h` which left the domain of the equations.
    pub(crate) fn reject_non_finite(&mut self, h: f64) -> f64 {
        self.after_rejection = true;
        h * Self::SHRINK
    }
}

/// Logarithm to base two of a non-negative number within 4e-4; at least that of a tiny number, and 1024 of infinity.
#[inline]
pub(crate) fn log2(x: f64) -> f64 {
    let bits = x.to_bits();
    let exponent = (bits >> 52) as i32 - 1023;
    // In [0, 1). The polynomial vanishes at both ends, so that the function is continuous.
    let f = f64::from_bits((bits & ((1 << 52) - 1)) | 1.0_f64.to_bits()) - 1.0;
    let bend = 0.440_780_8 + f * (-0.242_669_5 + f * 0.081_615_7);
    f64::from(exponent) + f + f * (1.0 - f) * bend
}

/// Logarithm to base two within 0.09, by chords between powers of two: known in half the time of [`log2`].
#[inline]
fn chord_log2(x: f64) -> f64 {
    (x.to_bits() as i64 - 1.0_f64.to_bits() as i64) as f64 * (1.0 / (1_u64 << 52) as f64)
}

/// Power of two within a relative 2e-4, for exponents between -100 and 100; of others that of the nearer end. Known in
/// half the time of [`exp2`].
#[inline]
fn small_exp2(x: f64) -> f64 {
    // Added, it rounds to a whole number, which stands in the last bits of the sum.
    const TO_WHOLE: f64 = 1.5 * (1_u64 << 52) as f64;
    let x = x.clamp(-100.0, 100.0);
    let sum = x + TO_WHOLE;
    let f = x - (sum - TO_WHOLE);
    let whole = f64::from_bits((sum.to_bits() << 52).wrapping_add(1.0_f64.to_bits()));
    whole * (1.0 + f * (core::f64::consts::LN_2 + f * (0.242_6 + f * 0.055_8)))
}

/// Power of two within a relative 5e-4, for exponents between -1000 and 1000; of others that of the nearer end.
#[inline]
pub(crate) fn exp2(x: f64) -> f64 {
    let x = x.clamp(-1000.0, 1000.0) + 1023.0;
    // Positive, so that the conversion rounds down.
    let whole = x as u64;
    let f = x - whole as f64;
    f64::from_bits(whole << 52) * (1.0 + f + f * (1.0 - f) * (-0.305_254_2 - f * 0.079_204_1))
}

#[cfg(test)]
mod tests {
    use super::{Controller, chord_log2, exp2, log2, small_exp2};

    #[test]
    fn steps_follow_errors() {
        let mut controller = Controller::new(5);
        assert!(controller.reject(1.0, 32.0 * 32.0) < 0.9);
        assert_eq!(controller.reject(1.0, f64::INFINITY), Controller::SHRINK);
        // After a rejection the step does not grow at once, though the error would allow it.
        assert_eq!(controller.accept(1.0, 1e-18), 1.0);
        assert_eq!(controller.accept(1.0, 0.0), Controller::GROW);
        assert!(controller.accept(1.0, 1.0) < 1.0);
    }

    #[test]
    fn flat_factors_are_those_of_close_powers() {
        for i in -300..0 {
            let square = (f64::from(i) * 0.2).exp2();
            let (mut flat, mut close) = (Controller::new(13), Controller::new(13));
            close.is_flat = false;
            let (flat, close) = (flat.accept(1.0, square), close.accept(1.0, square));
            assert!((flat / close - 1.0).abs() < 5e-3, "{square:e}: {flat} {close}");
        }
        assert_eq!(Controller::new(13).accept(1.0, 0.0), Controller::GROW);
        assert!(!Controller::new(9).is_flat);
    }

    #[test]
    fn approximate_powers_are_close() {
        for i in -2000..2000 {
            let x = f64::from(i) * 0.37;
            assert!((exp2(x) / x.exp2() - 1.0).abs() < 5e-4, "{x}");
            assert!((log2(x.exp2()) - x).abs() < 4e-4, "{x}");
            assert!((chord_log2(x.exp2()) - x).abs() < 0.09, "{x}");
            let small = 0.1 * x;
            assert!((small_exp2(small) / small.exp2() - 1.0).abs() < 2e-4, "{small}");
        }
        assert_eq!((small_exp2(0.0), small_exp2(-1e3)), (1.0, (-100.0_f64).exp2()));
        assert_eq!((log2(1.0), log2(f64::INFINITY), exp2(0.0)), (0.0, 1024.0, 1.0));
        assert!(log2(0.0) <= -1022.0 && exp2(f64::INFINITY) > 1e300 && exp2(f64::NEG_INFINITY) > 0.0);
    }
}
