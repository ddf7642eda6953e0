//! Sums over the stages of a step on four lanes, in registers of four numbers where the processor has them.
//!
//! A program for any processor of its kind has registers of two numbers. Whether this one has wider ones is asked for
//! once, when it runs; every lane has the bits of the same operations of the runtime.
//!
//! One of two files with unsafe code: functions for AVX are called, which is sound because [`WideSums`] is made by
//! [`WideSums::of_host`] alone, after it has asked the processor; they read and write slices whose lengths have been
//! compared.
//!
//! Deliberately does not know: methods, how steps are chosen.

use hamel_runtime::{Constant, F64x4, StateVector};

/// The derivatives of a step by index: at its start, at the stages between, and at its end.
#[derive(Clone, Copy, Debug)]
pub struct Slopes<'a, V> {
    /// Number of stages, which is the index of the last.
    pub n_stages: usize,
    /// At the start.
    pub first: &'a V,
    /// At the stages but the first.
    pub stored: &'a [V],
    /// At the end, where it is known.
    pub last: &'a V,
}

impl<'a, V: StateVector<F64x4>> Slopes<'a, V> {
    #[inline(always)]
    fn get(&self, index: usize) -> &'a [F64x4] {
        let found = match index {
            0 => self.first,
            index if index == self.n_stages => self.last,
            index => &self.stored[index - 1],
        };
        found.as_slice()
    }
}

/// Weights of derivatives, as [`hamel_runtime::Row`].
type Row<'a> = &'a [(usize, Constant)];

/// Says that the processor has registers of four numbers, and that the runtime does not fuse operations: where it does,
/// the program was compiled for this processor anyway.
#[derive(Clone, Copy, Debug)]
pub struct WideSums(());

impl WideSums {
    /// None where the runtime's own sums are as wide.
    #[must_use]
    pub fn of_host() -> Option<WideSums> {
        #[cfg(target_arch = "x86_64")]
        if !hamel_runtime::math::FUSED && std::is_x86_feature_detected!("avx") {
            return Some(WideSums(()));
        }
        None
    }

    /// `out = y + h sum_j weight_j k_j`, the first term first.
    ///
    /// # Panics
    /// When the numbers of components differ.
    #[inline]
    pub fn stage<V: StateVector<F64x4>>(
        self,
        (row, k): (Row<'_>, &Slopes<'_, V>),
        h: F64x4,
        y: &[F64x4],
        out: &mut [F64x4],
    ) {
        assert_eq!(y.len(), out.len(), "components");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: there is AVX, as `self` says, and these slices have the same length.
        #[allow(unsafe_code)]
        unsafe {
            avx::stage((row, k), h, y, out);
        }
    }

    /// `to + its residue = from + its residue + h sum_j weight_j k_j`, of pairs of states and residues.
    ///
    /// # Panics
    /// When the numbers of components differ.
    pub fn advance<V: StateVector<F64x4>>(
        self,
        (row, k): (Row<'_>, &Slopes<'_, V>),
        h: F64x4,
        (y, residue): (&[F64x4], &[F64x4]),
        (to, to_residue): (&mut [F64x4], &mut [F64x4]),
    ) {
        let n = y.len();
        assert!(residue.len() == n && to.len() == n && to_residue.len() == n, "components");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as in `stage`.
        #[allow(unsafe_code)]
        unsafe {
            avx::advance((row, k), h, (y, residue), (to, to_residue));
        }
    }

    /// The end of an extrapolated step, and what its error is divided by the step:
    ///
    /// ```text
    /// to + its residue = from + its residue + sum_j weights_j0 d_j,    error = per_h sum_j weights_j1 d_j
    /// ```
    ///
    /// of pairs of states and residues, with the increments `d_j` at the start of the rows.
    ///
    /// # Panics
    /// When the numbers of components differ, or a row has fewer.
    pub fn extrapolate(
        self,
        (weights, rows): (&[[f64; 2]], &[Vec<F64x4>]),
        per_h: F64x4,
        (y, residue): (&[F64x4], &[F64x4]),
        (to, to_residue): (&mut [F64x4], &mut [F64x4]),
        error: &mut [F64x4],
    ) {
        let n = y.len();
        assert!(
            residue.len() == n && to.len() == n && to_residue.len() == n && error.len() == n,
            "components"
        );
        assert!(rows.iter().all(|row| row.len() >= n), "components");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as in `stage`; every row has these components.
        #[allow(unsafe_code)]
        unsafe {
            avx::extrapolate((weights, rows), per_h, (y, residue), (to, to_residue), error);
        }
    }

    /// The mean squares of two sums in units of the tolerances `atol + rtol max(|a|, |b|)`, each component on the lane
    /// where it is largest; NaN where one of them is.
    ///
    /// # Panics
    /// When the numbers of components differ.
    #[must_use]
    pub fn mean_squares<V: StateVector<F64x4>>(
        self,
        (rows, k): ([Row<'_>; 2], &Slopes<'_, V>),
        [rtol, atol]: [&[F64x4]; 2],
        [a, b]: [&[F64x4]; 2],
    ) -> [f64; 2] {
        let n = a.len();
        assert!(rtol.len() == n && atol.len() == n && b.len() == n, "components");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: as in `stage`.
        #[allow(unsafe_code)]
        unsafe {
            avx::mean_squares((rows, k), [rtol, atol], [a, b])
        }
        #[cfg(not(target_arch = "x86_64"))]
        [f64::NAN; 2]
    }
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use std::arch::x86_64::{
        __m128d, __m256d, _CMP_UNORD_Q, _mm_add_pd, _mm_cvtsd_f64, _mm_max_pd, _mm_mul_pd, _mm_setzero_pd,
        _mm_unpackhi_pd, _mm_unpacklo_pd, _mm256_add_pd, _mm256_andnot_pd, _mm256_castpd256_pd128,
        _mm256_cmp_pd, _mm256_div_pd, _mm256_extractf128_pd, _mm256_loadu_pd, _mm256_movemask_pd,
        _mm256_mul_pd, _mm256_or_pd, _mm256_set1_pd, _mm256_setzero_pd, _mm256_storeu_pd, _mm256_sub_pd,
    };

    use hamel_runtime::{F64x4, StateVector};

    use super::{Row, Slopes};

    const _: () = assert!(size_of::<F64x4>() == size_of::<__m256d>() && F64x4::LANES == 4);

    /// Components of a block: their sums, a weight and a product are in the sixteen registers.
    const BLOCK: usize = 8;

    /// The component at a place.
    ///
    /// # Safety
    /// There is AVX, and `at < x.len()`.
    #[inline]
    #[target_feature(enable = "avx")]
    #[allow(unsafe_code)]
    unsafe fn load(x: &[F64x4], at: usize) -> __m256d {
        // SAFETY: the place is inside, and four lanes are four numbers without padding.
        unsafe { _mm256_loadu_pd(x.as_ptr().add(at).cast()) }
    }

    /// Writes a component.
    ///
    /// # Safety
    /// As for [`load`].
    #[inline]
    #[target_feature(enable = "avx")]
    #[allow(unsafe_code)]
    unsafe fn store(x: &mut [F64x4], at: usize, value: __m256d) {
        // SAFETY: as in `load`.
        unsafe { _mm256_storeu_pd(x.as_mut_ptr().add(at).cast(), value) }
    }

    /// `sum_j weight_j k_j` for `N` components from a place on: a macro, as a function would return them in memory.
    macro_rules! sums {
        ($n:ident, $row:expr, $k:expr, $at:expr) => {{
            let mut sums = [_mm256_setzero_pd(); $n];
            if let Some(((index, weight), others)) = $row.split_first() {
                let weight = _mm256_set1_pd(weight.get());
                let k = &$k.get(*index)[$at..$at + $n];
                for (c, sum) in sums.iter_mut().enumerate() {
                    // SAFETY: the slice has `N` components.
                    #[allow(unsafe_code)]
                    let k = unsafe { load(k, c) };
                    *sum = _mm256_mul_pd(weight, k);
                }
                for (index, weight) in others {
                    let weight = _mm256_set1_pd(weight.get());
                    let k = &$k.get(*index)[$at..$at + $n];
                    for (c, sum) in sums.iter_mut().enumerate() {
                        // SAFETY: as above.
                        #[allow(unsafe_code)]
                        let k = unsafe { load(k, c) };
                        *sum = _mm256_add_pd(_mm256_mul_pd(weight, k), *sum);
                    }
                }
            }
            sums
        }};
    }

    /// Calls a function for blocks of [`BLOCK`] components and for the rest, whose number is a constant there.
    macro_rules! in_blocks {
        ($n:expr, $function:ident($($argument:expr),*)) => {{
            let mut at = 0;
            while at + BLOCK <= $n {
                $function::<BLOCK, _>(at, $($argument),*);
                at += BLOCK;
            }
            match $n - at {
                1 => $function::<1, _>(at, $($argument),*),
                2 => $function::<2, _>(at, $($argument),*),
                3 => $function::<3, _>(at, $($argument),*),
                4 => $function::<4, _>(at, $($argument),*),
                5 => $function::<5, _>(at, $($argument),*),
                6 => $function::<6, _>(at, $($argument),*),
                7 => $function::<7, _>(at, $($argument),*),
                _ => {}
            }
        }};
    }

    /// # Safety
    /// There is AVX, and all slices have the same length.
    #[target_feature(enable = "avx")]
    #[allow(unsafe_code)]
    pub(super) unsafe fn stage<V: StateVector<F64x4>>(
        terms: (Row<'_>, &Slopes<'_, V>),
        h: F64x4,
        y: &[F64x4],
        out: &mut [F64x4],
    ) {
        #[inline]
        #[target_feature(enable = "avx")]
        unsafe fn block<const N: usize, V: StateVector<F64x4>>(
            at: usize,
            (row, k): (Row<'_>, &Slopes<'_, V>),
            h: __m256d,
            y: &[F64x4],
            out: &mut [F64x4],
        ) {
            let sums = sums!(N, row, k, at);
            // SAFETY: the block is inside of all slices.
            unsafe {
                for (c, sum) in sums.into_iter().enumerate() {
                    store(out, at + c, _mm256_add_pd(_mm256_mul_pd(h, sum), load(y, at + c)));
                }
            }
        }
        // SAFETY: blocks end where the slices do.
        unsafe {
            let h = load(&[h], 0);
            in_blocks!(y.len(), block(terms, h, y, out));
        }
    }

    /// # Safety
    /// As for [`stage`].
    #[target_feature(enable = "avx")]
    #[allow(unsafe_code)]
    pub(super) unsafe fn advance<V: StateVector<F64x4>>(
        terms: (Row<'_>, &Slopes<'_, V>),
        h: F64x4,
        from: (&[F64x4], &[F64x4]),
        to: (&mut [F64x4], &mut [F64x4]),
    ) {
        #[inline]
        #[target_feature(enable = "avx")]
        unsafe fn block<const N: usize, V: StateVector<F64x4>>(
            at: usize,
            (row, k): (Row<'_>, &Slopes<'_, V>),
            h: __m256d,
            (y, residue): (&[F64x4], &[F64x4]),
            (to, to_residue): (&mut [F64x4], &mut [F64x4]),
        ) {
            let sums = sums!(N, row, k, at);
            // SAFETY: the block is inside of all slices.
            unsafe {
                for (c, slope) in sums.into_iter().enumerate() {
                    let b = _mm256_add_pd(_mm256_mul_pd(h, slope), load(residue, at + c));
                    advanced(at + c, (load(y, at + c), b), (&mut *to, &mut *to_residue));
                }
            }
        }
        // SAFETY: blocks end where the slices do.
        unsafe {
            let h = load(&[h], 0);
            in_blocks!(from.0.len(), block(terms, h, from, (&mut *to.0, &mut *to.1)));
        }
    }

    /// # Safety
    /// There is AVX, all slices have the same length, and no row is shorter.
    #[target_feature(enable = "avx")]
    #[allow(unsafe_code)]
    pub(super) unsafe fn extrapolate(
        (weights, rows): (&[[f64; 2]], &[Vec<F64x4>]),
        per_h: F64x4,
        (y, residue): (&[F64x4], &[F64x4]),
        (to, to_residue): (&mut [F64x4], &mut [F64x4]),
        estimate: &mut [F64x4],
    ) {
        // SAFETY: the places are inside of all slices.
        unsafe {
            let per_h = load(&[per_h], 0);
            for c in 0..y.len() {
                let (mut sum, mut error) = (_mm256_setzero_pd(), _mm256_setzero_pd());
                for ([weight, excess], row) in weights.iter().zip(rows) {
                    let increment = load(row, c);
                    sum = _mm256_add_pd(_mm256_mul_pd(_mm256_set1_pd(*weight), increment), sum);
                    error = _mm256_add_pd(_mm256_mul_pd(_mm256_set1_pd(*excess), increment), error);
                }
                advanced(c, (load(y, c), _mm256_add_pd(sum, load(residue, c))), (to, to_residue));
                store(estimate, c, _mm256_mul_pd(error, per_h));
            }
        }
    }

    /// Writes a rounded sum and its rounding error.
    ///
    /// # Safety
    /// As for [`load`], of both slices.
    #[inline]
    #[target_feature(enable = "avx")]
    #[allow(unsafe_code)]
    unsafe fn advanced(
        at: usize,
        (a, b): (__m256d, __m256d),
        (to, to_residue): (&mut [F64x4], &mut [F64x4]),
    ) {
        let sum = _mm256_add_pd(a, b);
        let part = _mm256_sub_pd(sum, a);
        let left = _mm256_sub_pd(a, _mm256_sub_pd(sum, part));
        // SAFETY: as the caller says.
        unsafe {
            store(to, at, sum);
            store(to_residue, at, _mm256_add_pd(left, _mm256_sub_pd(b, part)));
        }
    }

    /// Squares of the components of two errors, summed over even and over odd places, in the order of the runtime.
    #[derive(Clone, Copy)]
    struct Squares {
        sums: [__m128d; 2],
        /// That of the last component where it has none beside it.
        last: [__m128d; 2],
        /// Lanes where something was NaN.
        lost: __m256d,
    }

    /// # Safety
    /// As for [`stage`].
    #[target_feature(enable = "avx")]
    #[allow(unsafe_code)]
    pub(super) unsafe fn mean_squares<V: StateVector<F64x4>>(
        terms: ([Row<'_>; 2], &Slopes<'_, V>),
        tolerances: [&[F64x4]; 2],
        ends: [&[F64x4]; 2],
    ) -> [f64; 2] {
        #[inline]
        #[target_feature(enable = "avx")]
        unsafe fn block<const N: usize, V: StateVector<F64x4>>(
            at: usize,
            (rows, k): ([Row<'_>; 2], &Slopes<'_, V>),
            [rtol, atol]: [&[F64x4]; 2],
            [a, b]: [&[F64x4]; 2],
            squares: &mut Squares,
        ) {
            let [sign, half, one] = [-0.0, 0.5, 1.0].map(|x| _mm256_set1_pd(x));
            let mut scales = [one; N];
            for (c, scale) in scales.iter_mut().enumerate() {
                // SAFETY: the block is inside of all slices.
                let [a, b, rtol, atol] = unsafe { [a, b, rtol, atol].map(|x| load(x, at + c)) };
                let (a, b) = (_mm256_andnot_pd(sign, a), _mm256_andnot_pd(sign, b));
                let sum = _mm256_add_pd(_mm256_mul_pd(half, a), _mm256_mul_pd(half, b));
                let apart = _mm256_andnot_pd(sign, _mm256_sub_pd(a, b));
                let larger = _mm256_add_pd(sum, _mm256_mul_pd(half, apart));
                *scale = _mm256_div_pd(one, _mm256_add_pd(_mm256_mul_pd(rtol, larger), atol));
            }
            for (row, (total, last)) in rows.into_iter().zip(squares.sums.iter_mut().zip(&mut squares.last)) {
                if row.is_empty() {
                    continue;
                }
                let mut errors = sums!(N, row, k, at);
                for (error, scale) in errors.iter_mut().zip(scales) {
                    *error = _mm256_andnot_pd(sign, _mm256_mul_pd(*error, scale));
                    squares.lost = _mm256_or_pd(squares.lost, _mm256_cmp_pd::<_CMP_UNORD_Q>(*error, *error));
                }
                // The largest of the lanes, of two components at once.
                let mut pairs = errors.chunks_exact(2);
                for pair in &mut pairs {
                    *total = _mm_add_pd(*total, squared(pair[0], pair[1]));
                }
                if let [error] = pairs.remainder() {
                    *last = squared(*error, _mm256_setzero_pd());
                }
            }
        }
        let n = ends[0].len();
        let none = [_mm_setzero_pd(); 2];
        let mut squares = Squares { sums: none, last: none, lost: _mm256_setzero_pd() };
        // SAFETY: blocks end where the slices do.
        unsafe {
            in_blocks!(n, block(terms, tolerances, ends, &mut squares));
        }
        if _mm256_movemask_pd(squares.lost) != 0 {
            return [f64::NAN; 2];
        }
        [0, 1].map(|row| {
            let (sum, last) = (squares.sums[row], _mm_cvtsd_f64(squares.last[row]));
            (_mm_cvtsd_f64(sum) + _mm_cvtsd_f64(_mm_unpackhi_pd(sum, sum)) + last) / n.max(1) as f64
        })
    }

    /// The squares of the largest lanes of two components without signs.
    #[inline]
    #[target_feature(enable = "avx")]
    fn squared(first: __m256d, second: __m256d) -> __m128d {
        let [first, second] =
            [first, second].map(|x| _mm_max_pd(_mm256_castpd256_pd128(x), _mm256_extractf128_pd::<1>(x)));
        let largest = _mm_max_pd(_mm_unpacklo_pd(first, second), _mm_unpackhi_pd(first, second));
        _mm_mul_pd(largest, largest)
    }
}
