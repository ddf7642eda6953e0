//! Distributions of many numbers in little memory: moments, extremes, and a sketch for quantiles.
//!
//! Does not know: what the numbers are.

use tdigest::{Centroid, TDigest};

/// Most centroids of a sketch.
const MAX_CENTROIDS: usize = 200;

/// What is kept of numbers that come in groups: `n`, mean, `m2 = sum (x - mean)^2`, extremes, and a t-digest.
///
/// The bits depend on the numbers of each group and on the order of the groups, not on the order within a group.
///
/// # Error
/// Moments are those of the numbers up to rounding. A quantile at level `q` is one of the level `q ± d`, where `d` is
/// about `sqrt(q (1 - q))/100`: 0.5 % in the middle, less towards both ends, where the extremes are exact. With fewer
/// than a few hundred numbers quantiles are interpolated between the numbers themselves.
///
/// # Source
/// Chan, Golub and LeVeque, Updating formulae and a pairwise algorithm for computing sample variances (1979); Dunning
/// and Ertl, Computing extremely accurate quantiles using t-digests (2019).
#[derive(Clone, Debug)]
pub struct Distribution {
    n: u64,
    mean: f64,
    m2: f64,
    sketch: TDigest,
}

impl Distribution {
    /// Of one group; numbers that are not finite do not count.
    pub fn of(values: impl Iterator<Item = f64>) -> Distribution {
        let mut values: Vec<f64> = values.filter(|x| x.is_finite()).collect();
        values.sort_unstable_by(f64::total_cmp);
        let n = values.len() as f64;
        // Differences from the median are small where the numbers are alike, and so are their rounding errors.
        let median = values.get(values.len() / 2).copied().unwrap_or_default();
        let mean = median + values.iter().map(|x| (x - median) / n.max(1.0)).sum::<f64>();
        let m2 = values.iter().map(|x| (x - mean).powi(2)).sum();
        let sketch = TDigest::new_with_size(MAX_CENTROIDS);
        Distribution { n: values.len() as u64, mean, m2, sketch: sketch.merge_sorted(values) }
    }

    /// Takes the numbers of another one in.
    pub fn merge(&mut self, other: Distribution) {
        if other.n == 0 {
            return;
        }
        if self.n == 0 {
            *self = other;
            return;
        }
        let (a, b) = (self.n as f64, other.n as f64);
        let difference = other.mean - self.mean;
        self.n += other.n;
        self.mean += difference * (b / (a + b));
        self.m2 += other.m2 + difference * difference * (a * (b / (a + b)));
        let mine = std::mem::replace(&mut self.sketch, TDigest::new_with_size(1));
        self.sketch = TDigest::merge_digests(vec![mine, other.sketch]);
    }

    /// Writes everything that is kept, with every bit of it.
    pub fn write(&self, bytes: &mut Vec<u8>) {
        let Distribution { n, mean, m2, sketch } = self;
        let centroids = sketch.centroids();
        bytes.extend(n.to_le_bytes());
        bytes.extend((centroids.len() as u64).to_le_bytes());
        let extremes = [sketch.min(), sketch.max()].map(|x| x.unwrap_or(f64::NAN));
        let numbers = [*mean, *m2, sketch.sum()].into_iter().chain(extremes);
        let numbers = numbers.chain(centroids.iter().flat_map(|c| [c.mean(), c.weight()]));
        bytes.extend(numbers.flat_map(f64::to_le_bytes));
    }

    /// Reads what was written, from the front of the bytes; none when they are nothing of the kind.
    pub fn read(bytes: &mut &[u8]) -> Option<Distribution> {
        let mut next = || -> Option<[u8; 8]> {
            let (first, rest) = bytes.split_first_chunk::<8>()?;
            *bytes = rest;
            Some(*first)
        };
        let (n, n_centroids) = (u64::from_le_bytes(next()?), u64::from_le_bytes(next()?));
        if n_centroids > MAX_CENTROIDS as u64 {
            return None;
        }
        let mut number = || next().map(f64::from_le_bytes);
        let (mean, m2, sum, min, max) = (number()?, number()?, number()?, number()?, number()?);
        let mut centroid = || Some(Centroid::new(number()?, number()?));
        let centroids: Vec<Centroid> = (0..n_centroids).map(|_| centroid()).collect::<Option<_>>()?;
        let known = |x: f64| (n > 0).then_some(x);
        let is_whole =
            if n > 0 { min.is_finite() && max.is_finite() && n_centroids > 0 } else { n_centroids == 0 };
        let sketch = || TDigest::new(centroids, sum, n as f64, known(max), known(min), MAX_CENTROIDS);
        is_whole.then(|| Distribution { n, mean, m2, sketch: sketch() })
    }

    /// How many numbers.
    pub fn n(&self) -> u64 {
        self.n
    }

    /// The mean; none of no numbers.
    pub fn mean(&self) -> Option<f64> {
        (self.n > 0).then_some(self.mean)
    }

    /// The variance without bias, `m2/(n - 1)`; none of fewer than two numbers.
    pub fn variance(&self) -> Option<f64> {
        (self.n > 1).then(|| self.m2 / (self.n - 1) as f64)
    }

    /// The smallest and the largest number; none of no numbers.
    pub fn extremes(&self) -> Option<[f64; 2]> {
        Some([self.sketch.min()?, self.sketch.max()?])
    }

    /// The number below which a share `level` of all is.
    pub fn quantile(&self, level: f64) -> Option<f64> {
        self.sketch.estimate_quantile(level)
    }

    /// Edges of `bins` intervals of equal length between the extremes, and the share of all numbers in each; none of no
    /// numbers. The shares have the error of the quantiles.
    pub fn histogram(&self, bins: usize) -> Option<(Vec<f64>, Vec<f64>)> {
        let [min, max] = self.extremes()?;
        let edge = |k: usize| if k == bins { max } else { min + (max - min) * (k as f64 / bins as f64) };
        let edges: Vec<f64> = (0..=bins).map(edge).collect();
        let below = |k: usize| match k {
            0 => 0.0,
            k if k == bins => 1.0,
            k => self.sketch.estimate_rank(edges[k]).unwrap_or(0.0),
        };
        let shares = (0..bins).map(|k| (below(k + 1) - below(k)).max(0.0)).collect();
        Some((edges, shares))
    }
}

#[cfg(test)]
mod tests {
    use super::Distribution;

    /// Numbers with a known distribution: the exponential one, at equal distances of its level, in mixed order.
    fn exponential(n: usize) -> Vec<f64> {
        (0..n).map(|k| -(1.0 - ((k * 7919) % n) as f64 / n as f64 - 0.5 / n as f64).ln()).collect()
    }

    fn merged(values: &[f64], group: usize) -> Distribution {
        let mut all = Distribution::of(std::iter::empty());
        values.chunks(group).for_each(|group| all.merge(Distribution::of(group.iter().copied())));
        all
    }

    #[test]
    fn moments_are_those_of_all_numbers() {
        // Far from zero, where a sum of squares would lose all digits of the variance.
        let values: Vec<f64> = exponential(10_000).iter().map(|x| x + 1e6).collect();
        let all = merged(&values, 321);
        let mean = values.iter().map(|x| x - 1e6).sum::<f64>() / 1e4;
        let variance = values.iter().map(|x| (x - 1e6 - mean).powi(2)).sum::<f64>() / 9999.0;
        assert_eq!(all.n(), 10_000);
        assert!((all.mean().unwrap() - 1e6 - mean).abs() < 1e-8);
        assert!((all.variance().unwrap() / variance - 1.0).abs() < 1e-9);
        let [min, max] = all.extremes().unwrap();
        assert_eq!(min, values.iter().copied().fold(f64::INFINITY, f64::min));
        assert_eq!(max, values.iter().copied().fold(f64::NEG_INFINITY, f64::max));
    }

    /// The level of what is told differs from the level asked for by no more than is documented.
    #[test]
    fn quantiles_keep_their_error() {
        for (n, group) in [(100_000, 8192), (100_000, 512)] {
            let all = merged(&exponential(n), group);
            for level in [0.001, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 0.999_f64] {
                let is = 1.0 - (-all.quantile(level).unwrap()).exp();
                let allowed = 2.0 * (level * (1.0 - level)).sqrt() / 200.0;
                assert!((is - level).abs() < allowed, "{n} {group} {level}: {is}");
            }
        }
    }

    #[test]
    fn groups_have_no_order_within() {
        let values = exponential(1000);
        let mut sorted = values.clone();
        sorted.sort_by(f64::total_cmp);
        let [a, b] = [&values, &sorted].map(|v| Distribution::of(v.iter().copied()));
        assert_eq!(a.mean().map(f64::to_bits), b.mean().map(f64::to_bits));
        assert_eq!(a.variance().map(f64::to_bits), b.variance().map(f64::to_bits));
        assert_eq!(a.quantile(0.3).map(f64::to_bits), b.quantile(0.3).map(f64::to_bits));
    }

    #[test]
    fn histograms_have_all_numbers() {
        let (edges, shares) = merged(&exponential(20_000), 1000).histogram(40).unwrap();
        assert_eq!((edges.len(), shares.len()), (41, 40));
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        for (edge, share) in edges.windows(2).zip(&shares) {
            let exact = (-edge[0]).exp() - (-edge[1]).exp();
            assert!((share - exact).abs() < 0.01, "{edge:?} {share} {exact}");
        }
    }

    /// What was written and read merges to the same bits, and what is cut off is nothing.
    #[test]
    fn bytes_keep_every_bit() {
        let values = exponential(5000);
        let halves = || [&values[..2000], &values[2000..]].map(|v| Distribution::of(v.iter().copied()));
        let [mut kept, other] = halves();
        let mut bytes = Vec::new();
        halves().iter().for_each(|half| half.write(&mut bytes));
        let mut rest = bytes.as_slice();
        let mut read = Distribution::read(&mut rest).unwrap();
        let behind = Distribution::read(&mut rest).unwrap();
        assert!(rest.is_empty());
        kept.merge(other);
        read.merge(behind);
        let (mut first, mut second) = (Vec::new(), Vec::new());
        kept.write(&mut first);
        read.write(&mut second);
        assert_eq!(first, second);
        assert!(Distribution::read(&mut &first[..first.len() - 1]).is_none());
        let mut none = Vec::new();
        Distribution::of(std::iter::empty()).write(&mut none);
        assert_eq!(Distribution::read(&mut none.as_slice()).unwrap().n(), 0);
    }

    #[test]
    fn of_no_numbers_nothing_is_known() {
        let none = merged(&[f64::NAN, f64::INFINITY], 1);
        assert_eq!((none.n(), none.mean(), none.variance(), none.extremes()), (0, None, None, None));
        assert!(none.quantile(0.5).is_none() && none.histogram(4).is_none());
        let one = merged(&[2.5], 1);
        assert_eq!((one.mean(), one.variance(), one.quantile(0.5)), (Some(2.5), None, Some(2.5)));
        // All of one value: bins of no length, and nothing lost.
        let (_, shares) = merged(&[2.5, 2.5], 2).histogram(4).unwrap();
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}
