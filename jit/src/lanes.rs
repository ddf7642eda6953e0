//! Numbers of several lanes, and the registers that a processor has for them.
//!
//! Deliberately does not know: programs, instructions.

use hamel_runtime::{F64x4, F64x8, Real};

/// A scalar of several lanes: [`F64x4`], [`F64x8`].
pub trait Wide: Real + sealed::Sealed {
    /// How many.
    const WIDTH: usize;
}

impl Wide for F64x4 {
    const WIDTH: usize = F64x4::LANES;
}

impl Wide for F64x8 {
    const WIDTH: usize = F64x8::LANES;
}

/// The numbers of lanes, in the order of code.
pub(crate) const LANES: [usize; 2] = [F64x4::LANES, F64x8::LANES];

/// Where the code for so many lanes is.
pub(crate) const fn place_of(lanes: usize) -> usize {
    (lanes == F64x8::LANES) as usize
}

mod sealed {
    pub trait Sealed {}
    impl Sealed for hamel_runtime::F64x4 {}
    impl Sealed for hamel_runtime::F64x8 {}
}

const _: () = assert!(size_of::<F64x4>() == 32 && size_of::<F64x8>() == 64, "lanes without padding");

/// The widest registers for which code is made; results have the same bits with any.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Registers {
    /// Those for which this program was compiled.
    OfProgram,
    /// Sixteen of four numbers, for sums.
    Avx,
    /// The same, for programs too: bits are moved.
    Avx2,
    /// Thirty-two of eight numbers.
    Avx512,
}

impl Registers {
    /// Those of this processor. Where the runtime fuses operations, the program was compiled for this processor anyway,
    /// and other registers would round in another way.
    #[must_use]
    pub fn of_host() -> Registers {
        #[cfg(target_arch = "x86_64")]
        if !hamel_runtime::math::FUSED {
            let has_avx2 = std::is_x86_feature_detected!("avx2");
            let has_masks =
                std::is_x86_feature_detected!("avx512dq") && std::is_x86_feature_detected!("avx512vl");
            if has_avx2 && has_masks && std::is_x86_feature_detected!("avx512f") {
                return Registers::Avx512;
            }
            if has_avx2 {
                return Registers::Avx2;
            }
            if std::is_x86_feature_detected!("avx") {
                return Registers::Avx;
            }
        }
        Registers::OfProgram
    }
}

/// How code lies in registers: so many numbers in each, of vectors of so many lanes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Form {
    pub(crate) encoding: Encoding,
    /// Lanes of a number of a vector.
    pub(crate) lanes: usize,
}

/// How instructions are written, which decides on the registers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Encoding {
    /// Sixteen registers of four numbers.
    Vex,
    /// Thirty-two registers of four numbers.
    EvexOfFour,
    /// Thirty-two registers of eight numbers.
    EvexOfEight,
}

impl Form {
    /// That of vectors of so many lanes on registers, if there is code for them.
    pub(crate) fn of(lanes: usize, registers: Registers) -> Option<Form> {
        let encoding = match registers {
            Registers::Avx512 if lanes == F64x8::LANES => Encoding::EvexOfEight,
            Registers::Avx512 => Encoding::EvexOfFour,
            Registers::Avx2 => Encoding::Vex,
            Registers::Avx | Registers::OfProgram => return None,
        };
        // The calling convention is that of x86-64 but on Windows.
        cfg!(all(target_arch = "x86_64", not(windows))).then_some(Form { encoding, lanes })
    }

    /// Bytes from a number of a vector to the next.
    pub(crate) fn stride(self) -> usize {
        self.lanes * size_of::<f64>()
    }

    /// The first lane of each run of the code: a register after the other.
    pub(crate) fn starts(self) -> impl Iterator<Item = usize> {
        (0..self.lanes).step_by(self.encoding.n_numbers())
    }
}

impl Encoding {
    /// Numbers in a register.
    pub(crate) fn n_numbers(self) -> usize {
        match self {
            Encoding::Vex | Encoding::EvexOfFour => 4,
            Encoding::EvexOfEight => 8,
        }
    }

    /// Bytes of a register.
    pub(crate) fn n_bytes(self) -> usize {
        self.n_numbers() * size_of::<f64>()
    }

    /// Number of registers.
    pub(crate) fn n_registers(self) -> usize {
        match self {
            Encoding::Vex => 16,
            Encoding::EvexOfFour | Encoding::EvexOfEight => 32,
        }
    }
}
