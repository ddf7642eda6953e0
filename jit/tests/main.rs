//! Tests of programs compiled in memory.

mod every_operation;
mod inputs;
mod lanes;
mod rows;
mod series;

use hamel_jit::{Registers, Wide};
use hamel_runtime::{F64x4, F64x8};

/// Lanes that are made and read in tests.
trait Lanes: Wide {
    fn of(lane: impl FnMut(usize) -> f64) -> Self;
    fn lane(self, k: usize) -> f64;
}

macro_rules! lanes {
    ($($name:ident)*) => {$(
        impl Lanes for $name {
            fn of(lane: impl FnMut(usize) -> f64) -> $name {
                $name::new(std::array::from_fn(lane))
            }
            fn lane(self, k: usize) -> f64 {
                $name::lane(self, k)
            }
        }
    )*};
}

lanes! { F64x4 F64x8 }

/// The same number on every lane.
fn splat<L: Wide>(values: &[f64]) -> Vec<L> {
    values.iter().copied().map(L::from_f64).collect()
}

/// The kinds of registers that code is made for, as far as this processor has them.
fn registers() -> impl Iterator<Item = Registers> {
    let host = Registers::of_host();
    [Registers::OfProgram, Registers::Avx2, Registers::Avx512].into_iter().filter(move |own| *own <= host)
}
