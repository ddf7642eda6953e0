//! Sums over the stages of a step on lanes, in registers of four or eight numbers where the processor has them.
//!
//! A program for any processor of its kind has registers of two numbers. Whether this one has wider ones is asked for
//! once, when it runs; every lane has the bits of the same operations of the runtime.
//!
//! One of four files with unsafe code: functions for AVX and AVX-512 are called, which is sound because [`WideSums`] is
//! made by [`WideSums::up_to`] alone, after it has asked the processor; they read and write slices whose lengths have
//! been compared.
//!
//! Deliberately does not know: methods, how steps are chosen.

use hamel_runtime::{Constant, StateVector};

use crate::lanes::{Registers, Wide};

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

impl<'a, V> Slopes<'a, V> {
    #[inline(always)]
    fn get<L: Wide>(&self, index: usize) -> &'a [L]
    where
        V: StateVector<L>,
    {
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

/// Says that the processor has wider registers than this program was compiled for, and which.
#[derive(Clone, Copy, Debug)]
pub struct WideSums(
    #[cfg_attr(not(target_arch = "x86_64"), expect(dead_code, reason = "there are none"))] Registers,
);

/// Calls a function of the module for the lanes of `L` and the registers there are.
macro_rules! in_registers {
    ($own:ident, $lanes:ident, $function:ident($($argument:expr),*)) => {{
        #[cfg(target_arch = "x86_64")]
        // SAFETY: there are such registers, as `own` says, the lanes are as many, and the lengths have been compared.
        #[allow(unsafe_code)]
        unsafe {
            match ($lanes::WIDTH, $own.0) {
                (8, Registers::Avx512) => x86::eight::$function($($argument),*),
                (8, _) => x86::pairs::$function($($argument),*),
                _ => x86::four::$function($($argument),*),
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        unreachable!("registers that no other processor has")
    }};
}

impl WideSums {
    /// None where the runtime's own sums are as wide.
    #[must_use]
    pub fn of_host() -> Option<WideSums> {
        WideSums::up_to(Registers::Avx512)
    }

    /// The same in these registers at most: with the same bits, to compare.
    #[must_use]
    pub fn up_to(most: Registers) -> Option<WideSums> {
        let registers = Registers::of_host().min(most);
        (registers >= Registers::Avx).then_some(WideSums(registers))
    }

    /// The registers.
    #[cfg(target_arch = "x86_64")]
    pub(crate) fn registers(self) -> Registers {
        self.0
    }

    /// `out = y + h sum_j weight_j k_j`, the first term first.
    ///
    /// # Panics
    /// When the numbers of components differ.
    #[inline]
    pub fn stage<L: Wide, V: StateVector<L>>(
        self,
        (row, k): (Row<'_>, &Slopes<'_, V>),
        h: L,
        y: &[L],
        out: &mut [L],
    ) {
        assert_eq!(y.len(), out.len(), "components");
        in_registers!(self, L, stage((row, k), h, y, out))
    }

    /// `to + its residue = from + its residue + h sum_j weight_j k_j`, of pairs of states and residues.
    ///
    /// # Panics
    /// When the numbers of components differ.
    pub fn advance<L: Wide, V: StateVector<L>>(
        self,
        (row, k): (Row<'_>, &Slopes<'_, V>),
        h: L,
        (y, residue): (&[L], &[L]),
        (to, to_residue): (&mut [L], &mut [L]),
    ) {
        let n = y.len();
        assert!(residue.len() == n && to.len() == n && to_residue.len() == n, "components");
        in_registers!(self, L, advance((row, k), h, (y, residue), (to, to_residue)))
    }

    /// The end of an extrapolated step, and what its error is divided by the step:
    ///
    /// ```text
    /// to + its residue = from + its residue + sum_j weights_j0 d_j,    error = per_h sum_j weights_j1 d_j
    /// ```
    ///
    /// of pairs of states and residues, with the increments `d_j` at the start of rows of twice as many numbers, the
    /// last row first.
    ///
    /// # Panics
    /// When the numbers of components differ, or a row has fewer.
    pub fn extrapolate<L: Wide>(
        self,
        (weights, rows): (&[[f64; 2]], &[L]),
        per_h: L,
        (y, residue): (&[L], &[L]),
        (to, to_residue): (&mut [L], &mut [L]),
        error: &mut [L],
    ) {
        let n = y.len();
        assert!(
            residue.len() == n && to.len() == n && to_residue.len() == n && error.len() == n,
            "components"
        );
        assert!(rows.len() == weights.len() * 2 * n, "components");
        in_registers!(self, L, extrapolate((weights, rows), per_h, (y, residue), (to, to_residue), error))
    }

    /// The mean squares of two sums in units of the tolerances `atol + rtol max(|a|, |b|)`, each component on the lane
    /// where it is largest; NaN where one of them is.
    ///
    /// # Panics
    /// When the numbers of components differ.
    #[must_use]
    pub fn mean_squares<L: Wide, V: StateVector<L>>(
        self,
        (rows, k): ([Row<'_>; 2], &Slopes<'_, V>),
        [rtol, atol]: [&[L]; 2],
        [a, b]: [&[L]; 2],
    ) -> [f64; 2] {
        let n = a.len();
        assert!(rtol.len() == n && atol.len() == n && b.len() == n, "components");
        in_registers!(self, L, mean_squares((rows, k), [rtol, atol], [a, b]))
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    /// Calls a function for blocks of `BLOCK` components and for the rest, whose number is a constant there.
    macro_rules! in_blocks {
        ($n:expr, $function:ident($($argument:expr),*)) => {{
            let mut at = 0;
            while at + BLOCK <= $n {
                $function::<BLOCK, _, _>(at, $($argument),*);
                at += BLOCK;
            }
            match $n - at {
                1 => $function::<1, _, _>(at, $($argument),*),
                2 => $function::<2, _, _>(at, $($argument),*),
                3 => $function::<3, _, _>(at, $($argument),*),
                4 => $function::<4, _, _>(at, $($argument),*),
                5 => $function::<5, _, _>(at, $($argument),*),
                6 => $function::<6, _, _>(at, $($argument),*),
                7 => $function::<7, _, _>(at, $($argument),*),
                _ => {}
            }
        }};
    }

    /// `sum_j weight_j k_j` for `N` components from a place on: a macro, as a function would return them in memory.
    macro_rules! sums {
        ($n:ident, $row:expr, $k:expr, $at:expr) => {{
            let mut sums = [zero(); $n];
            if let Some(((index, weight), others)) = $row.split_first() {
                let weight = splat(weight.get());
                let k = &$k.get::<L>(*index)[$at..$at + $n];
                for (c, sum) in sums.iter_mut().enumerate() {
                    // SAFETY: the slice has `N` components.
                    #[allow(unsafe_code)]
                    let k = unsafe { load(k, c) };
                    *sum = mul(weight, k);
                }
                for (index, weight) in others {
                    let weight = splat(weight.get());
                    let k = &$k.get::<L>(*index)[$at..$at + $n];
                    for (c, sum) in sums.iter_mut().enumerate() {
                        // SAFETY: as above.
                        #[allow(unsafe_code)]
                        let k = unsafe { load(k, c) };
                        *sum = add(mul(weight, k), *sum);
                    }
                }
            }
            sums
        }};
    }

    /// Operations on a register.
    macro_rules! operations {
        ($feature:tt; $($name:ident($($argument:ident: $type:ty),*) -> $result:ty $body:block)*) => {$(
            #[inline]
            #[target_feature(enable = $feature)]
            pub(super) fn $name($($argument: $type),*) -> $result $body
        )*};
    }

    /// The functions of a module with operations on its registers.
    macro_rules! functions {
        ($feature:tt) => {
            /// The component at a place.
            ///
            /// # Safety
            /// There are these registers, `L` has as many lanes, and `at < x.len()`.
            #[inline]
            #[target_feature(enable = $feature)]
            #[allow(unsafe_code)]
            unsafe fn load<L: Wide>(x: &[L], at: usize) -> Register {
                // SAFETY: the place is inside, and lanes are numbers without padding.
                unsafe { read(x.as_ptr().add(at).cast()) }
            }

            /// Writes a component.
            ///
            /// # Safety
            /// As for [`load`].
            #[inline]
            #[target_feature(enable = $feature)]
            #[allow(unsafe_code)]
            unsafe fn store<L: Wide>(x: &mut [L], at: usize, value: Register) {
                // SAFETY: as in `load`.
                unsafe { write(x.as_mut_ptr().add(at).cast(), value) }
            }

            /// # Safety
            /// There are these registers, `L` has as many lanes, and all slices have the same length.
            #[target_feature(enable = $feature)]
            #[allow(unsafe_code)]
            pub(in super::super) unsafe fn stage<L: Wide, V: StateVector<L>>(
                terms: (Row<'_>, &Slopes<'_, V>),
                h: L,
                y: &[L],
                out: &mut [L],
            ) {
                #[inline]
                #[target_feature(enable = $feature)]
                unsafe fn block<const N: usize, L: Wide, V: StateVector<L>>(
                    at: usize,
                    (row, k): (Row<'_>, &Slopes<'_, V>),
                    h: Register,
                    y: &[L],
                    out: &mut [L],
                ) {
                    let sums = sums!(N, row, k, at);
                    // SAFETY: the block is inside of all slices.
                    unsafe {
                        for (c, sum) in sums.into_iter().enumerate() {
                            store(out, at + c, add(mul(h, sum), load(y, at + c)));
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
            #[target_feature(enable = $feature)]
            #[allow(unsafe_code)]
            pub(in super::super) unsafe fn advance<L: Wide, V: StateVector<L>>(
                terms: (Row<'_>, &Slopes<'_, V>),
                h: L,
                from: (&[L], &[L]),
                to: (&mut [L], &mut [L]),
            ) {
                #[inline]
                #[target_feature(enable = $feature)]
                unsafe fn block<const N: usize, L: Wide, V: StateVector<L>>(
                    at: usize,
                    (row, k): (Row<'_>, &Slopes<'_, V>),
                    h: Register,
                    (y, residue): (&[L], &[L]),
                    (to, to_residue): (&mut [L], &mut [L]),
                ) {
                    let sums = sums!(N, row, k, at);
                    // SAFETY: the block is inside of all slices.
                    unsafe {
                        for (c, slope) in sums.into_iter().enumerate() {
                            let b = add(mul(h, slope), load(residue, at + c));
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
            /// There are these registers, `L` has as many lanes, all slices have the same length, and each row twice
            /// as much.
            #[target_feature(enable = $feature)]
            #[allow(unsafe_code)]
            pub(in super::super) unsafe fn extrapolate<L: Wide>(
                (weights, rows): (&[[f64; 2]], &[L]),
                per_h: L,
                (y, residue): (&[L], &[L]),
                (to, to_residue): (&mut [L], &mut [L]),
                estimate: &mut [L],
            ) {
                // SAFETY: the places are inside of all slices.
                unsafe {
                    let per_h = load(&[per_h], 0);
                    for c in 0..y.len() {
                        let (mut sum, mut error) = (zero(), zero());
                        for ([weight, excess], row) in weights.iter().zip((0..weights.len()).rev()) {
                            let increment = load(rows, 2 * row * y.len() + c);
                            sum = add(mul(splat(*weight), increment), sum);
                            error = add(mul(splat(*excess), increment), error);
                        }
                        advanced(c, (load(y, c), add(sum, load(residue, c))), (to, to_residue));
                        store(estimate, c, mul(error, per_h));
                    }
                }
            }

            /// Writes a rounded sum and its rounding error.
            ///
            /// # Safety
            /// As for [`load`], of both slices.
            #[inline]
            #[target_feature(enable = $feature)]
            #[allow(unsafe_code)]
            unsafe fn advanced<L: Wide>(
                at: usize,
                (a, b): (Register, Register),
                (to, to_residue): (&mut [L], &mut [L]),
            ) {
                let sum = add(a, b);
                let part = sub(sum, a);
                let left = sub(a, sub(sum, part));
                // SAFETY: as the caller says.
                unsafe {
                    store(to, at, sum);
                    store(to_residue, at, add(left, sub(b, part)));
                }
            }

            /// Squares of the components of two errors, summed over even and over odd places, in the order of the
            /// runtime.
            #[derive(Clone, Copy)]
            struct Squares {
                sums: [__m128d; 2],
                /// That of the last component where it has none beside it.
                last: [__m128d; 2],
                /// Where something was NaN.
                lost: Lost,
            }

            /// # Safety
            /// As for [`stage`].
            #[target_feature(enable = $feature)]
            #[allow(unsafe_code)]
            pub(in super::super) unsafe fn mean_squares<L: Wide, V: StateVector<L>>(
                terms: ([Row<'_>; 2], &Slopes<'_, V>),
                tolerances: [&[L]; 2],
                ends: [&[L]; 2],
            ) -> [f64; 2] {
                #[inline]
                #[target_feature(enable = $feature)]
                unsafe fn block<const N: usize, L: Wide, V: StateVector<L>>(
                    at: usize,
                    (rows, k): ([Row<'_>; 2], &Slopes<'_, V>),
                    [rtol, atol]: [&[L]; 2],
                    [a, b]: [&[L]; 2],
                    squares: &mut Squares,
                ) {
                    let [half, one] = [0.5, 1.0].map(|x| splat(x));
                    let mut scales = [one; N];
                    for (c, scale) in scales.iter_mut().enumerate() {
                        // SAFETY: the block is inside of all slices.
                        let [a, b, rtol, atol] = unsafe { [a, b, rtol, atol].map(|x| load(x, at + c)) };
                        let (a, b) = (magnitude(a), magnitude(b));
                        let sum = add(mul(half, a), mul(half, b));
                        let larger = add(sum, mul(half, magnitude(sub(a, b))));
                        *scale = div(one, add(mul(rtol, larger), atol));
                    }
                    let sums = squares.sums.iter_mut().zip(&mut squares.last);
                    for (row, (total, last)) in rows.into_iter().zip(sums) {
                        if row.is_empty() {
                            continue;
                        }
                        let mut errors = sums!(N, row, k, at);
                        for (error, scale) in errors.iter_mut().zip(scales) {
                            *error = magnitude(mul(*error, scale));
                            squares.lost = lost(squares.lost, *error);
                        }
                        // The largest of the lanes, of two components at once.
                        let mut pairs = errors.chunks_exact(2);
                        for pair in &mut pairs {
                            *total = _mm_add_pd(*total, squared(of_four(pair[0]), of_four(pair[1])));
                        }
                        if let [error] = pairs.remainder() {
                            *last = squared(of_four(*error), _mm256_setzero_pd());
                        }
                    }
                }
                let n = ends[0].len();
                let none = [_mm_setzero_pd(); 2];
                let mut squares = Squares { sums: none, last: none, lost: nothing_lost() };
                // SAFETY: blocks end where the slices do.
                unsafe {
                    in_blocks!(n, block(terms, tolerances, ends, &mut squares));
                }
                if is_lost(squares.lost) {
                    return [f64::NAN; 2];
                }
                [0, 1].map(|row| {
                    let (sum, last) = (squares.sums[row], _mm_cvtsd_f64(squares.last[row]));
                    (_mm_cvtsd_f64(sum) + _mm_cvtsd_f64(_mm_unpackhi_pd(sum, sum)) + last) / n.max(1) as f64
                })
            }
        };
    }

    use std::arch::x86_64::{
        __m128d, __m256d, _mm_max_pd, _mm_mul_pd, _mm_unpackhi_pd, _mm_unpacklo_pd, _mm256_castpd256_pd128,
        _mm256_extractf128_pd,
    };

    /// The squares of the largest of four numbers without signs, of two components.
    #[inline]
    #[target_feature(enable = "avx")]
    fn squared(first: __m256d, second: __m256d) -> __m128d {
        let [first, second] =
            [first, second].map(|x| _mm_max_pd(_mm256_castpd256_pd128(x), _mm256_extractf128_pd::<1>(x)));
        let largest = _mm_max_pd(_mm_unpacklo_pd(first, second), _mm_unpackhi_pd(first, second));
        _mm_mul_pd(largest, largest)
    }

    /// Four lanes, in a register of AVX.
    pub(super) mod four {
        use std::arch::x86_64::{
            __m128d, __m256d, _CMP_UNORD_Q, _mm_add_pd, _mm_cvtsd_f64, _mm_setzero_pd, _mm_unpackhi_pd,
            _mm256_add_pd, _mm256_andnot_pd, _mm256_cmp_pd, _mm256_div_pd, _mm256_loadu_pd,
            _mm256_movemask_pd, _mm256_mul_pd, _mm256_or_pd, _mm256_set1_pd, _mm256_setzero_pd,
            _mm256_storeu_pd, _mm256_sub_pd,
        };

        use hamel_runtime::StateVector;

        use super::super::{Row, Slopes};
        use super::squared;
        use crate::lanes::Wide;

        pub(super) type Register = __m256d;
        pub(super) type Lost = __m256d;

        /// Components of a block: their sums, a weight and a product are in the sixteen registers.
        const BLOCK: usize = 8;

        operations! { "avx";
            zero() -> Register { _mm256_setzero_pd() }
            splat(x: f64) -> Register { _mm256_set1_pd(x) }
            add(a: Register, b: Register) -> Register { _mm256_add_pd(a, b) }
            sub(a: Register, b: Register) -> Register { _mm256_sub_pd(a, b) }
            mul(a: Register, b: Register) -> Register { _mm256_mul_pd(a, b) }
            div(a: Register, b: Register) -> Register { _mm256_div_pd(a, b) }
            magnitude(a: Register) -> Register { _mm256_andnot_pd(_mm256_set1_pd(-0.0), a) }
            nothing_lost() -> Lost { _mm256_setzero_pd() }
            lost(before: Lost, a: Register) -> Lost {
                _mm256_or_pd(before, _mm256_cmp_pd::<_CMP_UNORD_Q>(a, a))
            }
            is_lost(lost: Lost) -> bool { _mm256_movemask_pd(lost) != 0 }
            of_four(a: Register) -> __m256d { a }
        }

        /// # Safety
        /// There are four numbers at this place.
        #[inline]
        #[target_feature(enable = "avx")]
        #[allow(unsafe_code)]
        pub(super) unsafe fn read(place: *const f64) -> Register {
            // SAFETY: as the caller says.
            unsafe { _mm256_loadu_pd(place) }
        }

        /// # Safety
        /// As for [`read`].
        #[inline]
        #[target_feature(enable = "avx")]
        #[allow(unsafe_code)]
        pub(super) unsafe fn write(place: *mut f64, value: Register) {
            // SAFETY: as the caller says.
            unsafe { _mm256_storeu_pd(place, value) }
        }

        functions! { "avx" }
    }

    /// Eight lanes, in two registers of AVX.
    pub(super) mod pairs {
        use std::arch::x86_64::{
            __m128d, __m256d, _mm_add_pd, _mm_cvtsd_f64, _mm_setzero_pd, _mm_unpackhi_pd, _mm256_max_pd,
            _mm256_setzero_pd,
        };

        use hamel_runtime::StateVector;

        use super::super::{Row, Slopes};
        use super::{four, squared};
        use crate::lanes::Wide;

        pub(super) type Register = [four::Register; 2];
        pub(super) type Lost = four::Lost;

        /// Components of a block, as in the module of four lanes.
        const BLOCK: usize = 4;

        operations! { "avx";
            zero() -> Register { [four::zero(); 2] }
            splat(x: f64) -> Register { [four::splat(x); 2] }
            add(a: Register, b: Register) -> Register { [four::add(a[0], b[0]), four::add(a[1], b[1])] }
            sub(a: Register, b: Register) -> Register { [four::sub(a[0], b[0]), four::sub(a[1], b[1])] }
            mul(a: Register, b: Register) -> Register { [four::mul(a[0], b[0]), four::mul(a[1], b[1])] }
            div(a: Register, b: Register) -> Register { [four::div(a[0], b[0]), four::div(a[1], b[1])] }
            magnitude(a: Register) -> Register { [four::magnitude(a[0]), four::magnitude(a[1])] }
            nothing_lost() -> Lost { four::nothing_lost() }
            lost(before: Lost, a: Register) -> Lost { four::lost(four::lost(before, a[0]), a[1]) }
            is_lost(lost: Lost) -> bool { four::is_lost(lost) }
            of_four(a: Register) -> __m256d { _mm256_max_pd(a[0], a[1]) }
        }

        /// # Safety
        /// There are eight numbers at this place.
        #[inline]
        #[target_feature(enable = "avx")]
        #[allow(unsafe_code)]
        pub(super) unsafe fn read(place: *const f64) -> Register {
            // SAFETY: as the caller says.
            unsafe { [four::read(place), four::read(place.add(4))] }
        }

        /// # Safety
        /// As for [`read`].
        #[inline]
        #[target_feature(enable = "avx")]
        #[allow(unsafe_code)]
        pub(super) unsafe fn write(place: *mut f64, value: Register) {
            // SAFETY: as the caller says.
            unsafe {
                four::write(place, value[0]);
                four::write(place.add(4), value[1]);
            }
        }

        functions! { "avx" }
    }

    /// Eight lanes, in a register of AVX-512.
    pub(super) mod eight {
        use std::arch::x86_64::{
            __m128d, __m256d, __m512d, __mmask8, _CMP_UNORD_Q, _mm_add_pd, _mm_cvtsd_f64, _mm_setzero_pd,
            _mm_unpackhi_pd, _mm256_max_pd, _mm256_setzero_pd, _mm512_abs_pd, _mm512_add_pd,
            _mm512_castpd512_pd256, _mm512_cmp_pd_mask, _mm512_div_pd, _mm512_extractf64x4_pd,
            _mm512_loadu_pd, _mm512_mul_pd, _mm512_set1_pd, _mm512_setzero_pd, _mm512_storeu_pd,
            _mm512_sub_pd,
        };

        use hamel_runtime::StateVector;

        use super::super::{Row, Slopes};
        use super::squared;
        use crate::lanes::Wide;

        pub(super) type Register = __m512d;
        pub(super) type Lost = __mmask8;

        /// Components of a block, as in the module of four lanes.
        const BLOCK: usize = 8;

        operations! { "avx512f";
            zero() -> Register { _mm512_setzero_pd() }
            splat(x: f64) -> Register { _mm512_set1_pd(x) }
            add(a: Register, b: Register) -> Register { _mm512_add_pd(a, b) }
            sub(a: Register, b: Register) -> Register { _mm512_sub_pd(a, b) }
            mul(a: Register, b: Register) -> Register { _mm512_mul_pd(a, b) }
            div(a: Register, b: Register) -> Register { _mm512_div_pd(a, b) }
            magnitude(a: Register) -> Register { _mm512_abs_pd(a) }
            nothing_lost() -> Lost { 0 }
            lost(before: Lost, a: Register) -> Lost { before | _mm512_cmp_pd_mask::<_CMP_UNORD_Q>(a, a) }
            is_lost(lost: Lost) -> bool { lost != 0 }
            of_four(a: Register) -> __m256d {
                _mm256_max_pd(_mm512_castpd512_pd256(a), _mm512_extractf64x4_pd::<1>(a))
            }
        }

        /// # Safety
        /// There are eight numbers at this place.
        #[inline]
        #[target_feature(enable = "avx512f")]
        #[allow(unsafe_code)]
        pub(super) unsafe fn read(place: *const f64) -> Register {
            // SAFETY: as the caller says.
            unsafe { _mm512_loadu_pd(place) }
        }

        /// # Safety
        /// As for [`read`].
        #[inline]
        #[target_feature(enable = "avx512f")]
        #[allow(unsafe_code)]
        pub(super) unsafe fn write(place: *mut f64, value: Register) {
            // SAFETY: as the caller says.
            unsafe { _mm512_storeu_pd(place, value) }
        }

        functions! { "avx512f" }
    }
}
