//! What makes the stream function of a vorticity.
//!
//! Does not know: matrices.

use super::Error;

/// The stream function `P = scale (shift - Delta)^-1 W` of a vorticity.
///
/// With `scale = 1` and `shift = 0` the fluid is an ideal one. A `shift` is that of quasi-geostrophic motion, the
/// square of the inverse radius of deformation (Rossby radius): `W` is the potential vorticity then.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Stream {
    /// Factor, not zero.
    pub scale: f64,
    /// Summand of the eigenvalues of minus the Laplacian, not negative.
    pub shift: f64,
}

impl Stream {
    /// The stream function of an ideal fluid.
    #[must_use]
    pub const fn ideal() -> Self {
        Self { scale: 1.0, shift: 0.0 }
    }

    /// Sets the factor.
    #[must_use]
    pub const fn with_scale(mut self, scale: f64) -> Self {
        self.scale = scale;
        self
    }

    /// Sets the square of the inverse radius of deformation.
    #[must_use]
    pub const fn with_shift(mut self, shift: f64) -> Self {
        self.shift = shift;
        self
    }

    /// Checks both numbers.
    ///
    /// # Errors
    ///
    /// [`Error::Number`].
    pub fn validate(&self) -> Result<(), Error> {
        if self.scale == 0.0 || !self.scale.is_finite() {
            let needs = "factor of a stream function: that is finite and not zero";
            return Err(Error::Number { value: self.scale, needs });
        }
        if !(self.shift >= 0.0 && self.shift.is_finite()) {
            let needs = "shift of the Laplacian: that is finite and not negative";
            return Err(Error::Number { value: self.shift, needs });
        }
        Ok(())
    }
}

impl Default for Stream {
    fn default() -> Self {
        Self::ideal()
    }
}
