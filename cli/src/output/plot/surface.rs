//! Values of functions on the torus and on the sphere, from their coefficients, at the points of a picture.
//!
//! Does not know: colours, where pictures are.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, SQRT_2};

/// What functions are on, and which coefficients they have.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Surface {
    /// The torus `[0, 2 pi)^2`: `f(x) = 2 sum (re_m cos(m.x) - im_m sin(m.x))`, coefficients `re_m`, `im_m` of each
    /// wave.
    Torus {
        /// The waves `m`.
        waves: Vec<(i64, i64)>,
    },
    /// The sphere: real harmonics of the degrees `1, .., N - 1` whose square has the mean one, without the sign of
    /// Condon and Shortley, degree by degree, the cosine of an order before its sine.
    Sphere {
        /// `N`.
        n: usize,
    },
}

/// Values at the points of a picture, row by row from the top; none outside the surface.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grid {
    /// Points of a row.
    pub(super) width: usize,
    /// The values.
    pub(super) values: Vec<Option<f64>>,
}

impl Surface {
    /// Width by height of a picture.
    pub(super) fn ratio(&self) -> f64 {
        match self {
            Surface::Torus { .. } => 1.0,
            Surface::Sphere { .. } => 2.0,
        }
    }

    /// Values at the points of a picture that shows the shortest wave.
    pub(super) fn grid(&self, coefficients: &[f64]) -> Grid {
        match self {
            Surface::Torus { waves } => {
                let largest = waves.iter().map(|(a, b)| a.unsigned_abs().max(b.unsigned_abs())).max();
                let width = (6 * largest.unwrap_or(0) as usize).clamp(144, 384);
                Grid { width, values: on_torus(waves, coefficients, width).into_iter().map(Some).collect() }
            }
            Surface::Sphere { n } => {
                let width = (6 * n).clamp(368, 720) / 2 * 2;
                Grid { width, values: on_sphere(*n, coefficients, width) }
            }
        }
    }
}

/// Values at the centres of `n` by `n` cells, the second coordinate upwards.
fn on_torus(waves: &[(i64, i64)], coefficients: &[f64], n: usize) -> Vec<f64> {
    // exp(i pi k/n): the angles of centres are odd multiples of pi/n.
    let turns: Vec<(f64, f64)> = (0..2 * n).map(|k| (PI * k as f64 / n as f64).sin_cos()).collect();
    let turn = |m: i64, cell: usize| {
        let k = (m * (2 * cell as i64 + 1)).rem_euclid(2 * n as i64) as usize;
        let (sin, cos) = turns[k];
        [cos, sin]
    };
    let mut by_first: BTreeMap<i64, Vec<(i64, [f64; 2])>> = BTreeMap::new();
    for ((m1, m2), part) in waves.iter().zip(coefficients.as_chunks::<2>().0) {
        by_first.entry(*m1).or_default().push((*m2, *part));
    }
    let mut values = vec![0.0; n * n];
    for (j, row) in values.chunks_exact_mut(n).rev().enumerate() {
        for (m1, list) in &by_first {
            // The sum over the waves of one m1, at this second coordinate.
            let [mut re, mut im] = [0.0; 2];
            for (m2, [a, b]) in list {
                let [cos, sin] = turn(*m2, j);
                re += a * cos - b * sin;
                im += a * sin + b * cos;
            }
            for (i, value) in row.iter_mut().enumerate() {
                let [cos, sin] = turn(*m1, i);
                *value += 2.0 * (re * cos - im * sin);
            }
        }
    }
    values
}

/// Values on a map of the sphere by Mollweide's projection, which keeps areas, twice as wide as high; north is up, the
/// meridian zero in the middle.
fn on_sphere(n: usize, coefficients: &[f64], width: usize) -> Vec<Option<f64>> {
    let height = width / 2;
    let mut values = Vec::with_capacity(width * height);
    for j in 0..height {
        let y = 1.0 - (2 * j + 1) as f64 / height as f64;
        let circles = circles(n, coefficients, latitude(y).sin());
        for i in 0..width {
            let x = (2 * i + 1) as f64 / width as f64 - 1.0;
            values.push(longitude([x, y]).map(|longitude| {
                let (sin, cos) = longitude.sin_cos();
                let ([mut c, mut s], mut value) = ([1.0, 0.0], 0.0);
                for [a, b] in &circles {
                    value += a * c + b * s;
                    [c, s] = [c * cos - s * sin, s * cos + c * sin];
                }
                value
            }));
        }
    }
    values
}

/// The latitude of a height of Mollweide's map, from -1 to 1.
fn latitude(y: f64) -> f64 {
    let angle = y.clamp(-1.0, 1.0).asin();
    ((2.0 * angle + (2.0 * angle).sin()) / PI).clamp(-1.0, 1.0).asin()
}

/// The longitude of a point of Mollweide's map, whose halves are from -1 to 1; none outside.
fn longitude([x, y]: [f64; 2]) -> Option<f64> {
    let half = (1.0 - y * y).max(0.0).sqrt();
    (x.abs() <= half && half > 0.0).then(|| PI * x / half)
}

/// The point of Mollweide's map of a longitude and a latitude.
pub(super) fn mollweide(longitude: f64, latitude: f64) -> [f64; 2] {
    // 2 a + sin(2 a) = pi sin(latitude), by bisection: Newton's steps stall at the poles.
    let (mut low, mut high) = (-FRAC_PI_2, FRAC_PI_2);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if 2.0 * middle + (2.0 * middle).sin() < PI * latitude.sin() { low = middle } else { high = middle }
    }
    let angle = 0.5 * (low + high);
    [longitude / PI * angle.cos(), angle.sin()]
}

/// The coefficients of `cos(m phi)` and `sin(m phi)` on the circle of a height `z`, by orders.
///
/// Holmes and Featherstone 2002, A unified approach to the Clenshaw summation and the recursive computation of very
/// high degree and order normalised associated Legendre functions: the recurrence along columns.
fn circles(n: usize, coefficients: &[f64], z: f64) -> Vec<[f64; 2]> {
    let s = (1.0 - z * z).max(0.0).sqrt();
    let mut circles = vec![[0.0; 2]; n];
    // P_mm, of which the first of an order above zero has the factor of two of its cosine.
    let mut sectoral = 1.0;
    for (m, circle) in circles.iter_mut().enumerate() {
        match m {
            0 => {}
            1 => sectoral *= 1.5_f64.sqrt() * SQRT_2 * s,
            _ => sectoral *= ((2 * m + 1) as f64 / (2 * m) as f64).sqrt() * s,
        }
        let (mut before, mut value) = (0.0, sectoral);
        for l in m..n {
            if l > m {
                let (square, below) = ((l * l - m * m) as f64, ((l - 1) * (l - 1) - m * m) as f64);
                let four = |l: usize| (4 * l * l - 1) as f64;
                let past = if l > m + 1 { (below / four(l - 1)).sqrt() * before } else { 0.0 };
                (before, value) = (value, (four(l) / square).sqrt() * (z * value - past));
            }
            if l > 0 {
                let at = l * l - 1 + (2 * m).saturating_sub(1);
                let sine = if m > 0 { coefficients[at + 1] } else { 0.0 };
                *circle = [circle[0] + coefficients[at] * value, circle[1] + sine * value];
            }
        }
    }
    circles
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::{Surface, circles, latitude, longitude, mollweide, on_torus};

    #[test]
    fn waves_on_the_torus_are_cosines_and_sines() {
        let waves = [(1, -2), (0, 3)];
        let n = 8;
        let values = on_torus(&waves, &[0.5, -0.25, 0.1, 0.7], n);
        for (at, value) in values.iter().enumerate() {
            let cell = |k: usize| TAU * (k as f64 + 0.5) / n as f64;
            let (x, y) = (cell(at % n), cell(n - 1 - at / n));
            let (first, second) = (x - 2.0 * y, 3.0 * y);
            let expected =
                2.0 * (0.5 * first.cos() + 0.25 * first.sin() + 0.1 * second.cos() - 0.7 * second.sin());
            assert!((value - expected).abs() < 1e-13, "{at}: {value} {expected}");
        }
    }

    /// Against closed forms: `c_1_0 = sqrt(3) z`, `c_1_1 = sqrt(3) x`, `s_2_2 = sqrt(15) x y`,
    /// `c_2_1 = sqrt(15) x z`, `c_2_0 = sqrt(5)/2 (3 z^2 - 1)`, `c_3_0 = sqrt(7)/2 (5 z^3 - 3 z)`.
    #[test]
    fn harmonics_are_those_of_the_model_language() {
        let n = 4;
        type Harmonic = fn([f64; 3]) -> f64;
        let functions: [(usize, Harmonic); 6] = [
            (0, |[_, _, z]| 3.0_f64.sqrt() * z),
            (1, |[x, _, _]| 3.0_f64.sqrt() * x),
            (7, |[x, y, _]| 15.0_f64.sqrt() * x * y),
            (4, |[x, _, z]| 15.0_f64.sqrt() * x * z),
            (3, |[_, _, z]| 5.0_f64.sqrt() / 2.0 * (3.0 * z * z - 1.0)),
            (8, |[_, _, z]| 7.0_f64.sqrt() / 2.0 * (5.0 * z * z * z - 3.0 * z)),
        ];
        for (at, function) in functions {
            let mut coefficients = vec![0.0; n * n - 1];
            coefficients[at] = 1.0;
            for (z, phi) in [(0.3_f64, 0.4_f64), (-0.8, 2.0), (0.999, -3.0), (1.0, 1.0)] {
                let s = (1.0 - z * z).sqrt();
                let expected = function([s * phi.cos(), s * phi.sin(), z]);
                let circles = circles(n, &coefficients, z);
                let terms = circles.iter().enumerate().map(|(m, [a, b])| {
                    let (sin, cos) = (m as f64 * phi).sin_cos();
                    a * cos + b * sin
                });
                let value: f64 = terms.sum();
                assert!((value - expected).abs() < 1e-14, "{at} at {z}: {value} {expected}");
            }
        }
    }

    /// Every harmonic has the mean square one, also those of high degree, by circles of latitude.
    #[test]
    fn high_harmonics_have_the_mean_square_one() {
        let n = 60;
        for (l, m) in [(59, 0), (59, 45), (59, 59), (40, 20)] {
            let mut coefficients = vec![0.0; n * n - 1];
            coefficients[l * l - 1 + if m > 0 { 2 * m - 1 } else { 0 }] = 1.0;
            // The midpoint rule, whose error is of second order in a step.
            let steps = 2000;
            let mean = (0..steps).map(|k| {
                let angle = PI * (k as f64 + 0.5) / f64::from(steps);
                let [a, _] = circles(n, &coefficients, angle.cos())[m];
                a * a * if m > 0 { 0.5 } else { 1.0 } * angle.sin()
            });
            let mean = mean.sum::<f64>() * PI / f64::from(steps) / 2.0;
            assert!((mean - 1.0).abs() < 1e-4, "{l} {m}: {mean}");
        }
    }

    #[test]
    fn maps_go_there_and_back() {
        for (x, y) in [(0.0, 0.0), (0.3, 0.8), (-0.7, -0.6), (0.0, 1.0)] {
            let Some(east) = longitude([x, y]) else {
                assert_eq!(y, 1.0);
                continue;
            };
            let [x_back, y_back] = mollweide(east, latitude(y));
            assert!((x - x_back).abs() < 1e-9 && (y - y_back).abs() < 1e-9, "{x} {y}: {x_back} {y_back}");
        }
        assert_eq!(longitude([0.9, 0.9]), None);
        let grid = Surface::Sphere { n: 2 }.grid(&[1.0, 0.0, 0.0]);
        assert_eq!((grid.width, grid.values.len()), (368, 368 * 184));
        assert!(grid.values[0].is_none() && grid.values[184].is_some_and(|north| north > 1.5));
        // An ellipse fills pi/4 of its rectangle.
        let inside = grid.values.iter().flatten().count() as f64 / grid.values.len() as f64;
        assert!((inside - PI / 4.0).abs() < 0.01, "{inside}");
    }
}
