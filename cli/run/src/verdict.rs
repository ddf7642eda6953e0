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

/// Whether what is left of the data can be errors of measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    /// The part of the squares of the spreads of all columns, each about its mean, that the motion explains: at most 1.
    pub explained: f64,
    /// Whether what is left is a large part of the spread and no error of measurement.
    pub is_poor: bool,
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
        Verdict { explained: if n_all > 0.0 { 1.0 - left / n_all } else { 1.0 }, is_poor }
    }

    /// A line for people.
    pub fn text(&self) -> String {
        format!("the motion explains {:.4} % of the spread of the data", 100.0 * self.explained)
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
    use super::Verdict;

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

    #[test]
    fn errors_of_measurements_are_none_of_the_fit() {
        // Signs without order.
        let noise = |k: usize| if k * k % 7 < 3 { 0.5 } else { -0.5 };
        assert!(!of(noise, None).is_poor);
        assert!(!of(|k| 0.5 * (0.13 * k as f64).sin(), Some(0.4)).is_poor);
    }
}
