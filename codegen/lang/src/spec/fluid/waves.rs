//! Coefficients of functions on the torus and on the sphere, and their names.
//!
//! Does not know: models.

/// Where a fluid flows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FluidSurface {
    /// The torus, `zeitlin(N)`.
    Torus,
    /// The sphere, `zeitlin_sphere(N)`.
    Sphere,
}

/// One real coefficient of a function.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct FluidWave {
    /// The wave vector `(m1, m2)` of the half set, or degree and order `(l, m)`.
    pub wave: (i64, i64),
    /// Whether it is the imaginary part, or the coefficient of the sine.
    pub is_second: bool,
}

impl FluidSurface {
    /// The coefficient that a label of the algebra names, such as `re_1_m2` or `c_2_1`, if matrices of the size `n`
    /// have it.
    pub(super) fn wave(self, n: usize, label: &str) -> Option<FluidWave> {
        let n = i64::try_from(n).ok()?;
        let mut parts = label.split('_');
        let (part, a, b) = (parts.next()?, parts.next()?, parts.next()?);
        // Numbers as they are written by the algebra, so that each mode has one name.
        let number = |text: &str| {
            let (sign, digits) = text.strip_prefix('m').map_or((1, text), |rest| (-1, rest));
            let number = sign * i64::from(digits.parse::<u32>().ok()?);
            (digits == number.abs().to_string() && (sign > 0 || number != 0)).then_some(number)
        };
        let wave = (number(a)?, number(b)?);
        if parts.next().is_some() {
            return None;
        }
        let (is_second, is_mode) = match (self, part) {
            (FluidSurface::Torus, "re" | "im") => {
                let is_small = wave.0.max(wave.1.abs()) <= n / 2;
                (part == "im", wave > (0, 0) && wave.0 >= 0 && is_small)
            }
            (FluidSurface::Sphere, "c") => {
                (false, (0..=wave.0).contains(&wave.1) && (1..n).contains(&wave.0))
            }
            (FluidSurface::Sphere, "s") => (true, (1..=wave.0).contains(&wave.1) && (1..n).contains(&wave.0)),
            _ => return None,
        };
        is_mode.then_some(FluidWave { wave, is_second })
    }

    /// All coefficients, in the order of the algebra.
    pub fn waves(self, n: usize) -> Vec<FluidWave> {
        let n = n as i64;
        let both = |wave| [false, true].map(|is_second| FluidWave { wave, is_second });
        match self {
            FluidSurface::Torus => {
                let largest = n / 2;
                let of_first =
                    |m1: i64| (if m1 == 0 { 1 } else { -largest }..=largest).map(move |m2| (m1, m2));
                (0..=largest).flat_map(of_first).flat_map(both).collect()
            }
            FluidSurface::Sphere => {
                let all = (1..n).flat_map(|l| (0..=l).map(move |m| (l, m))).flat_map(both);
                all.filter(|w| w.wave.1 > 0 || !w.is_second).collect()
            }
        }
    }

    /// Minus the eigenvalue of the Laplacian.
    pub fn eigenvalue(self, wave: FluidWave) -> i64 {
        let (a, b) = wave.wave;
        match self {
            FluidSurface::Torus => a * a + b * b,
            FluidSurface::Sphere => a * (a + 1),
        }
    }

    /// The least size of matrices that have a coefficient.
    pub fn least_n(self, wave: FluidWave) -> usize {
        let (a, b) = wave.wave;
        let least = match self {
            FluidSurface::Torus => 2 * a.max(b.abs()) + 1,
            FluidSurface::Sphere => a + 1,
        };
        usize::try_from(least).expect("waves are not negative")
    }

    /// The derivative of the energy by a coefficient of the vorticity, in coefficients of the stream function: on the
    /// torus a coefficient stands for two waves.
    pub fn pairing(self) -> i64 {
        match self {
            FluidSurface::Torus => 2,
            FluidSurface::Sphere => 1,
        }
    }
}
