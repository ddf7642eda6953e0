//! What the residuals of a fit say about it.
//!
//! Deliberately does not know: how residuals come about, what was fitted.

use serde::{Deserialize, Serialize};

/// Part of the spread of the data, root of the mean square, that residuals may be without suspicion.
const SUSPICIOUS: f64 = 0.3;
/// Residuals in units of the given standard deviations beyond which these do not explain them.
const BEYOND_ERRORS: f64 = 3.0;
/// Correlation of residuals with those of the next row beyond which they are no errors of measurements.
const SMOOTH: f64 = 0.5;
/// Part of the size of values that is an error of the integration: a column that varies less, such as an energy that is
/// kept, has this spread.
const ROUNDING: f64 = 1e-8;

/// Whether what is left of the data can be errors of measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The part of the squares of the spreads of all columns, each about its mean, that the motion explains: at most 1.
    pub explained: f64,
    /// Whether what is left is a large part of the spread and no error of measurement.
    pub is_poor: bool,
    /// The sum of squares against the given errors, where all are given.
    pub chi_square: Option<ChiSquare>,
}

/// Probability of a sum of squares below which errors of the given size do not explain it.
const IMPROBABLE: f64 = 1e-3;

/// A sum of squares in units of the standard deviations of errors.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ChiSquare {
    /// For each degree of freedom: about one where model and errors are right.
    pub per_freedom: f64,
    /// The probability that independent normal errors alone leave at least as much.
    pub probability: f64,
}

impl ChiSquare {
    /// Of a sum over degrees of freedom.
    ///
    /// # Source
    /// Wilson and Hilferty, The distribution of chi-square (1931): its cube root is nearly normal.
    pub(super) fn of(sum: f64, freedom: usize) -> ChiSquare {
        let n = freedom.max(1) as f64;
        let (per_freedom, variance) = (sum / n, 2.0 / (9.0 * n));
        let z = (per_freedom.cbrt() - (1.0 - variance)) / variance.sqrt();
        ChiSquare { per_freedom, probability: libm::erfc(z / std::f64::consts::SQRT_2) / 2.0 }
    }

    /// Whether errors of the given size may leave as much.
    pub fn is_explained(&self) -> bool {
        self.probability >= IMPROBABLE
    }
}

/// A column of a table.
pub(super) struct Judged {
    /// Values and residuals, row by row.
    pub(super) cells: Vec<(f64, f64)>,
    /// The standard deviation of their errors, where it is given.
    pub(super) sigma: Option<f64>,
}

impl Verdict {
    /// Of values and residuals of each column, row by row, with the standard deviation of their errors where it is
    /// given.
    ///
    /// A column is explained badly where its residuals are more than three tenths of its spread, and are errors neither
    /// by their given size nor, where none is given, by being independent from row to row: those of a wrong minimum are
    /// the difference of two smooth motions. Few rows say nothing about the second.
    pub(super) fn of(columns: &[Judged]) -> Verdict {
        let (mut left, mut n_all, mut is_poor) = (0.0, 0.0, false);
        for Judged { cells, sigma } in columns {
            let n = cells.len() as f64;
            if cells.is_empty() {
                continue;
            }
            let mean = cells.iter().map(|(value, _)| value).sum::<f64>() / n;
            let spread = (cells.iter().map(|(value, _)| (value - mean).powi(2)).sum::<f64>() / n).sqrt();
            let size = (cells.iter().map(|(value, _)| value * value).sum::<f64>() / n).sqrt();
            let spread = spread.max(ROUNDING * size);
            let rms = (cells.iter().map(|(_, r)| r * r).sum::<f64>() / n).sqrt();
            let ratio = if rms == 0.0 { 0.0 } else { rms / spread };
            left += n * ratio.min(1.0).powi(2);
            n_all += n;
            let are_errors = match sigma {
                Some(sigma) => rms <= BEYOND_ERRORS * sigma,
                None => {
                    let next: f64 = cells.windows(2).map(|pair| pair[0].1 * pair[1].1).sum();
                    let own: f64 = cells.iter().map(|(_, r)| r * r).sum();
                    // By chance the correlation of n independent numbers is up to three roots of 1/n.
                    next <= own * SMOOTH.max(3.0 / n.sqrt())
                }
            };
            is_poor |= ratio > SUSPICIOUS && !are_errors;
        }
        Verdict { explained: if n_all > 0.0 { 1.0 - left / n_all } else { 1.0 }, is_poor, chi_square: None }
    }

    /// Whether the residuals may be errors of the measurements.
    pub fn fits(&self) -> bool {
        !self.is_poor && self.chi_square.is_none_or(|chi_square| chi_square.is_explained())
    }

    /// Lines for people.
    pub fn text(&self) -> String {
        let explained =
            format!("the motion explains {:.4} % of the spread of the data", 100.0 * self.explained);
        let Some(ChiSquare { per_freedom, probability }) = self.chi_square.filter(|c| !c.is_explained())
        else {
            return explained;
        };
        format!(
            "{explained}\n  the residuals are larger than --sigma says (probability {probability:.0e}): the model lacks \
             something, or\n  errors are larger; standard errors are about {:.1} times too small",
            per_freedom.sqrt()
        )
    }

    /// Why a fit is none.
    pub(super) fn reason(&self, end: f64) -> String {
        format!(
            "the best motion found explains {:.1} % of the spread of the data up to t = {end:?}, and what is left is \
             no error of measurement: it is another minimum, or the model is another one; start nearer with --set and \
             --initial, fit fewer rows first, or free what else is unknown",
            100.0 * self.explained
        )
    }
}

#[cfg(test)]
mod tests {
    use super::{ChiSquare, Verdict};

    fn of(residual: impl Fn(usize) -> f64, sigma: Option<f64>) -> Verdict {
        let cells = (0..200).map(|k| ((0.1 * k as f64).sin(), residual(k))).collect();
        Verdict::of(&[super::Judged { cells, sigma }])
    }

    #[test]
    fn smooth_residuals_of_the_size_of_the_data_are_no_fit() {
        assert!(of(|k| (0.13 * k as f64).sin(), None).is_poor);
        assert!(of(|k| (0.13 * k as f64).sin(), Some(0.01)).is_poor);
        // Small ones are a model that is nearly right.
        let near = of(|k| 0.01 * (0.13 * k as f64).sin(), None);
        assert!(!near.is_poor && near.explained > 0.999, "{near:?}");
    }

    /// An energy that is kept: residuals of the integration are no bad fit, and a wrong level is.
    #[test]
    fn columns_that_do_not_vary_are_judged_by_their_size() {
        let of = |residual: f64| {
            let cells = (0..200).map(|k| (0.7, residual * (0.13 * k as f64).sin())).collect();
            Verdict::of(&[super::Judged { cells, sigma: None }])
        };
        assert!(!of(1e-11).is_poor && of(1e-11).explained > 0.999, "{:?}", of(1e-11));
        assert!(of(1e-3).is_poor && of(1e-3).explained < 0.5, "{:?}", of(1e-3));
    }

    #[test]
    fn errors_of_measurements_are_none_of_the_fit() {
        // Signs without order.
        let noise = |k: usize| if k * k % 7 < 3 { 0.5 } else { -0.5 };
        assert!(!of(noise, None).is_poor);
        assert!(!of(|k| 0.5 * (0.13 * k as f64).sin(), Some(0.4)).is_poor);
    }

    /// Quantiles of chi-square from tables: 95 % and 99.9 % of 10 and 100 degrees of freedom.
    #[test]
    fn probabilities_are_those_of_tables() {
        for (freedom, at_95, at_999) in [(10, 18.307, 29.588), (100, 124.342, 149.449)] {
            let upper = ChiSquare::of(at_95, freedom).probability;
            assert!((upper - 0.05).abs() < 2e-3, "{freedom}: {upper}");
            let upper = ChiSquare::of(at_999, freedom).probability;
            assert!((upper - 1e-3).abs() < 2e-4, "{freedom}: {upper}");
        }
        assert!(ChiSquare::of(100.0, 100).is_explained() && !ChiSquare::of(200.0, 100).is_explained());
    }
}
