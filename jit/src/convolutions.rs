//! The convolutions of a Taylor recurrence in the registers of the processor.
//!
//! One of four files with unsafe code: functions for AVX and AVX-512 are called, for registers that the processor has
//! been asked for. They are the runtime's own function, compiled again: no operation is fused, as a program that fuses
//! has no wider registers.
//!
//! Deliberately does not know: whose series are convolved.

use hamel_runtime::convolve as own;

use crate::lanes::Registers;

/// [`hamel_runtime::convolve`], in these registers, which this processor has.
#[cfg(target_arch = "x86_64")]
pub(crate) fn convolve(registers: Registers, rows: [&[f64]; 2], sums: &mut [f64]) {
    #[target_feature(enable = "avx")]
    fn avx(rows: [&[f64]; 2], sums: &mut [f64]) {
        own(rows, sums);
    }

    #[target_feature(enable = "avx512f", enable = "avx512vl")]
    fn avx512(rows: [&[f64]; 2], sums: &mut [f64]) {
        own(rows, sums);
    }

    // SAFETY: there are these registers.
    #[allow(unsafe_code)]
    unsafe {
        match registers {
            Registers::OfProgram => own(rows, sums),
            Registers::Avx | Registers::Avx2 => avx(rows, sums),
            Registers::Avx512 => avx512(rows, sums),
        }
    }
}

/// [`hamel_runtime::convolve`].
#[cfg(not(target_arch = "x86_64"))]
pub(crate) fn convolve(_: Registers, rows: [&[f64]; 2], sums: &mut [f64]) {
    own(rows, sums);
}
