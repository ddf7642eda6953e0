//! Numbers as bytes, the lowest first: for every trajectory of a store.
//!
//! Does not know: files, what the numbers are.

/// The bytes of numbers, filled up to `n` of them.
///
/// # Panics
/// When there are more than `n`.
pub fn of_floats(values: &[f64], filling: f64, n: usize) -> Vec<u8> {
    filled(values, filling, n, f64::to_le_bytes)
}

/// The same of counts.
///
/// # Panics
/// As [`of_floats`].
pub fn of_counts(values: &[u64], filling: u64, n: usize) -> Vec<u8> {
    filled(values, filling, n, u64::to_le_bytes)
}

fn filled<T: Copy>(values: &[T], filling: T, n: usize, bytes: impl Fn(T) -> [u8; 8]) -> Vec<u8> {
    assert!(values.len() <= n, "more numbers than there is room for");
    // Room for a checksum behind them.
    let mut all = Vec::with_capacity(8 * n + 8);
    all.extend(values.iter().flat_map(|x| bytes(*x)));
    all.extend((values.len()..n).flat_map(|_| bytes(filling)));
    all
}

#[cfg(test)]
mod tests {
    use super::{of_counts, of_floats};

    #[test]
    fn bytes_are_those_of_each_number() {
        let found = of_floats(&[1.5, -0.0], f64::NAN, 3);
        let expected = [1.5, -0.0, f64::NAN].map(f64::to_le_bytes);
        assert_eq!(found, expected.concat());
        assert_eq!(of_counts(&[7], 0, 2), [7_u64, 0].map(u64::to_le_bytes).concat());
        assert!(of_counts(&[], 0, 0).is_empty());
    }
}
