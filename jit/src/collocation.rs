//! The loops of collocation over the components of a state, in registers of four numbers where the processor has them.
//!
//! One of four files with unsafe code: functions for AVX and AVX-512 are called, which is sound because [`WideSums`]
//! is made by [`WideSums::up_to`] alone, after it has asked the processor; they read and write slices whose lengths
//! have been compared.
//!
//! Deliberately does not know: coefficients, when an iteration ends.

use hamel_runtime::{F64x4, Moved, StageLoops, StageRow};

#[cfg(target_arch = "x86_64")]
use crate::lanes::Registers;
use crate::sums::WideSums;

/// Calls a function for the registers there are.
macro_rules! in_registers {
    ($own:ident, $function:ident($($argument:expr),*)) => {{
        #[cfg(target_arch = "x86_64")]
        // SAFETY: there are such registers, as `own` says, and the lengths have been compared.
        #[allow(unsafe_code)]
        unsafe {
            match $own.registers() {
                Registers::Avx512 => x86::avx512::$function($($argument),*),
                _ => x86::avx::$function($($argument),*),
            }
        }
        #[cfg(not(target_arch = "x86_64"))]
        unreachable!("registers that no other processor has")
    }};
}

/// With the bits of [`hamel_runtime::OwnLoops`]: each operation is that of a lane, in the same order.
///
/// # Panics
/// Every function, when the numbers of components differ.
impl StageLoops for WideSums {
    fn points(
        self,
        row: &StageRow,
        (y, residue): (&[f64], &[f64]),
        [low, high]: [&[F64x4]; 2],
        points: &mut [F64x4],
        changes: &mut [F64x4],
    ) -> Moved {
        let n = points.len();
        assert!(y.len() == n && residue.len() == n && changes.len() == n, "components");
        assert!(low.len() == n && high.len() == n, "components");
        in_registers!(self, points(row, (y, residue), [low, high], points, changes))
    }

    fn weigh(self, weight: F64x4, slopes: &[F64x4], increments: &mut [F64x4]) {
        assert_eq!(slopes.len(), increments.len(), "components");
        in_registers!(self, weigh(weight, slopes, increments))
    }

    fn extrapolate(
        self,
        rows: &[StageRow; 2],
        ends: &[[F64x4; 2]; 2],
        slopes: [&[f64]; 2],
        [low, high]: [&mut [F64x4]; 2],
    ) {
        let n = low.len();
        assert!(high.len() == n && slopes.iter().all(|slope| slope.len() == n), "components");
        in_registers!(self, extrapolate(rows, ends, slopes, [low, high]))
    }

    fn progress(self, changes: &[F64x4], least: &mut [f64]) -> bool {
        assert_eq!(changes.len(), least.len(), "components");
        in_registers!(self, progress(changes, least))
    }
}

#[cfg(target_arch = "x86_64")]
mod x86 {
    /// The loops for a processor with certain registers.
    macro_rules! functions {
        ($($feature:tt),*) => {
            use std::arch::x86_64::{
                __m256d, _CMP_GT_OQ, _CMP_LT_OQ, _CMP_NEQ_UQ, _CMP_NLT_UQ, _mm256_add_pd, _mm256_and_pd,
                _mm256_andnot_pd, _mm256_blendv_pd, _mm256_broadcast_sd, _mm256_cmp_pd, _mm256_loadu_pd,
                _mm256_max_pd, _mm256_movemask_pd, _mm256_mul_pd, _mm256_or_pd, _mm256_permute2f128_pd,
                _mm256_set1_pd, _mm256_setzero_pd, _mm256_storeu_pd, _mm256_sub_pd, _mm256_unpackhi_pd,
                _mm256_unpacklo_pd,
            };

            use hamel_runtime::{F64x4, Moved, StageRow};

            /// The weights of a row.
            $(#[target_feature(enable = $feature)])*
            #[inline]
            #[allow(unsafe_code)]
            fn registers(row: &StageRow) -> [__m256d; 8] {
                let mut weights = [_mm256_setzero_pd(); 8];
                for (register, weight) in weights.iter_mut().zip(row) {
                    // SAFETY: lanes are four numbers without padding.
                    *register = unsafe { load(weight) };
                }
                weights
            }

            /// # Safety
            /// There are four numbers at this place.
            $(#[target_feature(enable = $feature)])*
            #[inline]
            #[allow(unsafe_code)]
            unsafe fn load(place: *const F64x4) -> __m256d {
                // SAFETY: as the caller says.
                unsafe { _mm256_loadu_pd(place.cast()) }
            }

            /// # Safety
            /// As for [`load`].
            $(#[target_feature(enable = $feature)])*
            #[inline]
            #[allow(unsafe_code)]
            unsafe fn store(place: *mut F64x4, value: __m256d) {
                // SAFETY: as the caller says.
                unsafe { _mm256_storeu_pd(place.cast(), value) }
            }

            /// `start + sum_j row_j x_j`, in the order of the runtime.
            ///
            /// # Safety
            /// There are four numbers at each place.
            $(#[target_feature(enable = $feature)])*
            #[inline]
            #[allow(unsafe_code)]
            unsafe fn sum_of(start: __m256d, row: &[__m256d; 8], halves: [*const f64; 2]) -> __m256d {
                // SAFETY: as the caller says.
                let term = |j: usize| unsafe {
                    _mm256_mul_pd(row[j], _mm256_broadcast_sd(&*halves[j / 4].add(j % 4)))
                };
                let (mut first, mut second) = (start, term(4));
                for j in 0..4 {
                    first = _mm256_add_pd(term(j), first);
                }
                for j in 5..8 {
                    second = _mm256_add_pd(term(j), second);
                }
                _mm256_add_pd(first, second)
            }

            /// # Safety
            /// There are these registers, and all slices have the same length.
            $(#[target_feature(enable = $feature)])*
            #[allow(unsafe_code)]
            pub(in super::super) unsafe fn points(
                row: &StageRow,
                (y, residue): (&[f64], &[f64]),
                increments: [&[F64x4]; 2],
                points: &mut [F64x4],
                changes: &mut [F64x4],
            ) -> Moved {
                let row = registers(row);
                let (mut moved, mut lost) = (_mm256_setzero_pd(), _mm256_setzero_pd());
                let increments = increments.map(<[F64x4]>::as_ptr);
                for c in 0..points.len() {
                    // SAFETY: the component is inside of all slices.
                    unsafe {
                        let (point, largest) = (points.as_mut_ptr().add(c), changes.as_mut_ptr().add(c));
                        let of_all = increments.map(|half| half.add(c).cast::<f64>());
                        let start = _mm256_set1_pd(*residue.as_ptr().add(c));
                        let y = _mm256_set1_pd(*y.as_ptr().add(c));
                        let (before, new) = (load(point), _mm256_add_pd(y, sum_of(start, &row, of_all)));
                        let change = _mm256_andnot_pd(_mm256_set1_pd(-0.0), _mm256_sub_pd(new, before));
                        let none = _mm256_setzero_pd();
                        moved = _mm256_or_pd(moved, _mm256_cmp_pd::<_CMP_NEQ_UQ>(change, none));
                        let too_large = _mm256_set1_pd(f64::INFINITY);
                        lost = _mm256_or_pd(lost, _mm256_cmp_pd::<_CMP_NLT_UQ>(change, too_large));
                        store(point, new);
                        store(largest, _mm256_max_pd(load(largest), change));
                    }
                }
                Moved { has_moved: _mm256_movemask_pd(moved) != 0, is_finite: _mm256_movemask_pd(lost) == 0 }
            }

            /// # Safety
            /// As for [`points`].
            $(#[target_feature(enable = $feature)])*
            #[allow(unsafe_code)]
            pub(in super::super) unsafe fn weigh(weight: F64x4, slopes: &[F64x4], increments: &mut [F64x4]) {
                // SAFETY: the component is inside of both slices.
                unsafe {
                    let weight = load(&weight);
                    for c in 0..slopes.len() {
                        store(
                            increments.as_mut_ptr().add(c),
                            _mm256_mul_pd(weight, load(slopes.as_ptr().add(c))),
                        );
                    }
                }
            }

            /// # Safety
            /// As for [`points`].
            $(#[target_feature(enable = $feature)])*
            #[allow(unsafe_code)]
            pub(in super::super) unsafe fn extrapolate(
                rows: &[StageRow; 2],
                ends: &[[F64x4; 2]; 2],
                slopes: [&[f64]; 2],
                [low, high]: [&mut [F64x4]; 2],
            ) {
                let rows = [registers(&rows[0]), registers(&rows[1])];
                // SAFETY: lanes are four numbers, and the component is inside of all slices.
                unsafe {
                    let [first, last] = [0, 1].map(|end| [&ends[0][end], &ends[1][end]]);
                    let first = [load(first[0]), load(first[1])];
                    let last = [load(last[0]), load(last[1])];
                    for c in 0..low.len() {
                        let places = [low.as_mut_ptr().add(c), high.as_mut_ptr().add(c)];
                        let known = places.map(|place| place.cast_const().cast::<f64>());
                        let start = _mm256_set1_pd(*slopes[0].as_ptr().add(c));
                        let end = _mm256_set1_pd(*slopes[1].as_ptr().add(c));
                        let mut sums = [start; 2];
                        for (half, sum) in sums.iter_mut().enumerate() {
                            let from_start = _mm256_mul_pd(first[half], start);
                            let from_ends = _mm256_add_pd(from_start, _mm256_mul_pd(last[half], end));
                            *sum = sum_of(from_ends, &rows[half], known);
                        }
                        store(places[0], sums[0]);
                        store(places[1], sums[1]);
                    }
                }
            }

            /// The largest of the lanes of four components.
            $(#[target_feature(enable = $feature)])*
            #[inline]
            fn largest([a, b, c, d]: [__m256d; 4]) -> __m256d {
                let of_two =
                    |a, b| _mm256_max_pd(_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
                let (first, second) = (of_two(a, b), of_two(c, d));
                _mm256_max_pd(
                    _mm256_permute2f128_pd::<0x20>(first, second),
                    _mm256_permute2f128_pd::<0x31>(first, second),
                )
            }

            /// # Safety
            /// As for [`points`].
            $(#[target_feature(enable = $feature)])*
            #[allow(unsafe_code)]
            pub(in super::super) unsafe fn progress(changes: &[F64x4], least: &mut [f64]) -> bool {
                let mut found = _mm256_setzero_pd();
                let (changes, last) = changes.as_chunks::<4>();
                let (blocks, rest) = least.as_chunks_mut::<4>();
                for (changes, least) in changes.iter().zip(blocks) {
                    // SAFETY: there are four numbers at each place.
                    unsafe {
                        let [a, b, c, d] = changes;
                        let change = largest([load(a), load(b), load(c), load(d)]);
                        let before = _mm256_loadu_pd(least.as_ptr());
                        let is_less = _mm256_and_pd(
                            _mm256_cmp_pd::<_CMP_LT_OQ>(change, before),
                            _mm256_cmp_pd::<_CMP_GT_OQ>(change, _mm256_setzero_pd()),
                        );
                        _mm256_storeu_pd(least.as_mut_ptr(), _mm256_blendv_pd(before, change, is_less));
                        found = _mm256_or_pd(found, is_less);
                    }
                }
                hamel_runtime::OwnLoops.progress(last, rest) | (_mm256_movemask_pd(found) != 0)
            }
        };
    }

    /// In sixteen registers.
    pub(super) mod avx {
        use hamel_runtime::StageLoops as _;

        functions! { "avx" }
    }

    /// In thirty-two registers, where products read a number from memory for all lanes.
    pub(super) mod avx512 {
        use hamel_runtime::StageLoops as _;

        functions! { "avx512f", "avx512vl" }
    }
}

#[cfg(test)]
mod tests {
    use hamel_runtime::{F64x4, Moved, OwnLoops, StageLoops, StageRow};

    use crate::{Registers, WideSums};

    const SPECIAL: [f64; 6] = [f64::NAN, f64::INFINITY, -0.0, 0.0, 1e300, -2.5e-310];

    /// Numbers of many sizes, the special ones among them where they are asked for.
    fn numbers(n: usize, seed: usize, has_special: bool) -> Vec<f64> {
        let of = |k: usize| {
            let k = k + 31 * seed;
            if has_special && k % 7 == 3 {
                SPECIAL[k % 6]
            } else {
                (k as f64 * 0.37).sin() * 2.0_f64.powi(k as i32 % 40)
            }
        };
        (0..n).map(of).collect()
    }

    fn lanes(n: usize, seed: usize, has_special: bool) -> Vec<F64x4> {
        numbers(4 * n, seed, has_special).as_chunks::<4>().0.iter().map(|x| F64x4::new(*x)).collect()
    }

    fn row(seed: usize) -> StageRow {
        std::array::from_fn(|j| lanes(1, seed + j, false)[0])
    }

    fn bits(x: &[F64x4]) -> Vec<u64> {
        let numbers = x.iter().flat_map(|x| x.to_array());
        numbers.map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() }).collect()
    }

    /// Everything that the loops write, for states of so many components.
    fn written(
        loops: impl StageLoops,
        n: usize,
        has_special: bool,
    ) -> (Vec<Moved>, Vec<Vec<u64>>, Vec<bool>) {
        let of = |seed| lanes(n, seed, has_special);
        let (y, residue) = (numbers(n, 1, has_special), numbers(n, 2, has_special));
        let [mut low, mut high, mut points, mut changes] = [3, 4, 5, 6].map(of);
        changes.iter_mut().for_each(|change| *change = F64x4::splat(0.0));
        let sweep = |points: &mut [F64x4], changes: &mut [F64x4]| {
            loops.points(&row(8), (&y, &residue), [&low, &high], points, changes)
        };
        let first = sweep(&mut points, &mut changes);
        let all = bits(&points);
        // Of no account where one is not finite.
        let of_changes = if first.is_finite { bits(&changes) } else { Vec::new() };
        let mut moved = vec![first, sweep(&mut points, &mut changes)];
        // A point that moves alone.
        if let Some(last) = points.last_mut() {
            *last += F64x4::new([0.0, 0.0, 1.0, 0.0]);
        }
        moved.push(sweep(&mut points, &mut changes));
        let mut least = numbers(n, 9, false).into_iter().map(f64::abs).collect::<Vec<f64>>();
        let sizes: Vec<F64x4> = lanes(n, 10, false).iter().map(|x| hamel_runtime::Real::abs(*x)).collect();
        let progress = [sizes.clone(), sizes, vec![F64x4::splat(0.0); n]]
            .map(|sizes| loops.progress(&sizes, &mut least));
        let least: Vec<u64> = least.into_iter().map(f64::to_bits).collect();
        let mut weighed = vec![F64x4::splat(0.0); n];
        loops.weigh(row(11)[0], &points, &mut weighed);
        let ends = [row(12), row(13)].map(|row| [row[0], row[1]]);
        loops.extrapolate(&[row(14), row(15)], &ends, [&y, &residue], [&mut low, &mut high]);
        let vectors = vec![all, of_changes, least, bits(&weighed), bits(&low), bits(&high)];
        (moved, vectors, progress.to_vec())
    }

    #[test]
    fn loops_have_the_bits_of_the_runtime_in_all_registers() {
        for loops in [Registers::Avx, Registers::Avx512].into_iter().filter_map(WideSums::up_to) {
            for n in 0..=13 {
                for has_special in [false, true] {
                    let (own, found) = (written(OwnLoops, n, has_special), written(loops, n, has_special));
                    assert_eq!(own, found, "{n} components, special numbers {has_special}");
                }
            }
        }
    }

    /// Sums that begin with the stages of the second half.
    #[derive(Clone, Copy)]
    struct Turned;

    impl StageLoops for Turned {
        fn points(
            self,
            row: &StageRow,
            from: (&[f64], &[f64]),
            [low, high]: [&[F64x4]; 2],
            points: &mut [F64x4],
            changes: &mut [F64x4],
        ) -> Moved {
            let mut row = *row;
            row.rotate_left(4);
            OwnLoops.points(&row, from, [high, low], points, changes)
        }

        fn weigh(self, weight: F64x4, slopes: &[F64x4], increments: &mut [F64x4]) {
            OwnLoops.weigh(weight, slopes, increments);
        }

        fn extrapolate(
            self,
            rows: &[StageRow; 2],
            ends: &[[F64x4; 2]; 2],
            slopes: [&[f64]; 2],
            increments: [&mut [F64x4]; 2],
        ) {
            OwnLoops.extrapolate(rows, ends, slopes, increments);
        }

        fn progress(self, changes: &[F64x4], least: &mut [f64]) -> bool {
            OwnLoops.progress(changes, least)
        }
    }

    #[test]
    fn another_order_of_the_sums_is_found() {
        assert_ne!(written(OwnLoops, 5, false), written(Turned, 5, false));
    }
}
