//! Functions on `[-1, 1]` as series of Legendre polynomials, and Gauss' nodes.
//!
//! Does not know: what the functions are.

use std::f64::consts::PI;

/// Gauss' nodes and weights for the integral over `[-1, 1]`, exact for polynomials of degree `2 n - 1`; an even number
/// of them has none in the middle.
///
/// # Source
/// Abramowitz and Stegun 1964, Handbook of mathematical functions, 25.4.29.
pub(super) struct Nodes {
    pub(super) places: Vec<f64>,
    weights: Vec<f64>,
}

impl Nodes {
    /// So many nodes, in ascending order.
    pub(super) fn new(n: usize) -> Nodes {
        let node = |k: usize| {
            let mut x = -((k as f64 + 0.75) / (n as f64 + 0.5) * PI).cos();
            let mut slope = 1.0;
            for _ in 0..50 {
                let values = polynomials(x, n + 1);
                slope = n as f64 * (values[n - 1] - x * values[n]) / (1.0 - x * x);
                let change = values[n] / slope;
                x -= change;
                if change.abs() <= f64::EPSILON {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        };
        let (places, weights) = (0..n).map(node).unzip();
        Nodes { places, weights }
    }

    /// The polynomial of degree `n - 1` with these values at the nodes, one row of values for each node.
    pub(super) fn interpolated(&self, values: &[Vec<f64>]) -> Series {
        let n = self.places.len();
        let mut coefficients = vec![vec![0.0; values.first().map_or(0, Vec::len)]; n];
        for ((x, weight), row) in self.places.iter().zip(&self.weights).zip(values) {
            for (k, (value, sums)) in polynomials(*x, n).into_iter().zip(&mut coefficients).enumerate() {
                let factor = (k as f64 + 0.5) * weight * value;
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += factor * value);
            }
        }
        Series(coefficients)
    }
}

/// `P_0(x), .., P_{n-1}(x)`.
fn polynomials(x: f64, n: usize) -> Vec<f64> {
    let mut values = vec![1.0, x];
    for k in 1..n.saturating_sub(1) {
        let k_real = k as f64;
        values.push(((2.0 * k_real + 1.0) * x * values[k] - k_real * values[k - 1]) / (k_real + 1.0));
    }
    values.truncate(n);
    values
}

/// Coefficients of Legendre polynomials, for each of them one row with a column for each function.
#[derive(Clone, Debug)]
pub(super) struct Series(Vec<Vec<f64>>);

impl Series {
    pub(super) fn at(&self, x: f64) -> Vec<f64> {
        let mut values = vec![0.0; self.0.first().map_or(0, Vec::len)];
        for (polynomial, row) in polynomials(x, self.0.len()).into_iter().zip(&self.0) {
            values.iter_mut().zip(row).for_each(|(value, c)| *value += polynomial * c);
        }
        values
    }

    /// The integral from `-1` on, times a factor, and a start.
    pub(super) fn integral(&self, factor: f64, start: &[f64]) -> Series {
        let n = self.0.len();
        let mut sums = vec![vec![0.0; start.len()]; n + 1];
        for (k, row) in self.0.iter().enumerate() {
            for (j, c) in row.iter().enumerate() {
                let part = factor * c / (2.0 * k as f64 + 1.0);
                sums[k + 1][j] += part;
                match k {
                    0 => sums[0][j] += part,
                    _ => sums[k - 1][j] -= part,
                }
            }
        }
        sums[0].iter_mut().zip(start).for_each(|(sum, start)| *sum += start);
        Series(sums)
    }

    /// The largest of the last two coefficients of each function, beside the size of the function or one.
    pub(super) fn tail(&self) -> f64 {
        let n = self.0.len();
        let columns = self.0.first().map_or(0, Vec::len);
        let of = |j: usize| {
            let largest = |rows: &[Vec<f64>]| rows.iter().fold(0.0_f64, |max, row| max.max(row[j].abs()));
            largest(&self.0[n.saturating_sub(2)..]) / largest(&self.0).max(1.0)
        };
        (0..columns).map(of).fold(0.0, |max: f64, x| if x.is_nan() { f64::INFINITY } else { max.max(x) })
    }
}

#[cfg(test)]
mod tests {
    use super::Nodes;

    #[test]
    fn a_function_and_its_integral_by_their_values_at_nodes() {
        let nodes = Nodes::new(14);
        let middle: Vec<f64> = nodes.places.iter().map(|x| x.abs()).collect();
        assert!(middle.iter().all(|x| *x > 0.1), "{middle:?}");
        let rows: Vec<Vec<f64>> = nodes.places.iter().map(|x| vec![x.exp(), (2.0 * x).cos()]).collect();
        let series = nodes.interpolated(&rows);
        let integral = series.integral(0.5, &[3.0, 0.0]);
        for k in 0..=20 {
            let x = f64::from(k) / 10.0 - 1.0;
            let (at, sum) = (series.at(x), integral.at(x));
            assert!((at[0] - x.exp()).abs() < 1e-14 && (at[1] - (2.0 * x).cos()).abs() < 1e-9, "{x}");
            assert!((sum[0] - 3.0 - 0.5 * (x.exp() - (-1.0_f64).exp())).abs() < 1e-14, "{x}");
            let wanted = 0.25 * ((2.0 * x).sin() + 2.0_f64.sin());
            assert!((sum[1] - wanted).abs() < 1e-10, "{x}");
        }
        assert!(series.tail() < 1e-7 && series.tail() > 1e-12);
    }
}
