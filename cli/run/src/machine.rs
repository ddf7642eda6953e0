//! Machine code of programs made in memory, where there is memory that a processor runs.
//!
//! Deliberately does not know: scenes, who evaluates them.

#[cfg(all(feature = "jit", not(target_family = "wasm")))]
pub(super) use hamel_jit::Wide;
#[cfg(all(feature = "jit", not(target_family = "wasm")))]
pub(super) use hamel_jit::{Compiled, Registers, Slopes, WideSums};

/// Whether programs can be compiled in memory: WebAssembly runs nothing that was not there from the beginning.
pub(super) const IS_THERE: bool = cfg!(all(feature = "jit", not(target_family = "wasm")));

#[cfg(not(all(feature = "jit", not(target_family = "wasm"))))]
pub(super) use nothing::Wide;
#[cfg(not(all(feature = "jit", not(target_family = "wasm"))))]
pub(super) use nothing::{Compiled, Registers, Slopes, WideSums};

#[cfg(not(all(feature = "jit", not(target_family = "wasm"))))]
mod nothing {
    use hamel_program::program::{Point, Program, Run};
    use hamel_runtime::{F64x4, F64x8, Moved, Real, Row, StageLoops, StageRow};

    /// A scalar of several lanes.
    pub trait Wide: Real {
        /// How many.
        const WIDTH: usize;
    }

    impl Wide for F64x4 {
        const WIDTH: usize = F64x4::LANES;
    }

    impl Wide for F64x8 {
        const WIDTH: usize = F64x8::LANES;
    }

    /// The widest registers for which code is made.
    #[derive(Clone, Copy, Debug)]
    #[expect(dead_code, reason = "no code is made")]
    pub(in super::super) enum Registers {
        OfProgram,
        Avx,
        Avx2,
        Avx512,
    }

    /// A compiled program, of which there is none.
    #[derive(Debug)]
    pub(in super::super) enum Compiled {}

    impl Compiled {
        /// The reason why a program is not compiled.
        pub(in super::super) fn new(_: &Program) -> Result<Compiled, &'static str> {
            Err("machine code cannot be made in memory here")
        }

        #[cfg(test)]
        pub(in super::super) fn with_registers_up_to(self, _: Registers) -> Compiled {
            self
        }

        pub(in super::super) fn run_rows<L>(
            &self,
            _: usize,
            _: (&[L], &[L]),
            _: (L, L),
            _: (&[L], &[L]),
            _: &mut [L],
        ) -> bool {
            match *self {}
        }
    }

    /// Sums in registers that are asked for at run time, of which there are none.
    #[derive(Clone, Copy, Debug)]
    pub(in super::super) enum WideSums {}

    impl WideSums {
        pub(in super::super) fn up_to(_: Registers) -> Option<WideSums> {
            None
        }

        pub(in super::super) fn stage<L, V>(self, _: (Row, &Slopes<'_, V>), _: L, _: &[L], _: &mut [L]) {
            match self {}
        }

        pub(in super::super) fn advance<L, V>(
            self,
            _: (Row, &Slopes<'_, V>),
            _: L,
            _: (&[L], &[L]),
            _: (&mut [L], &mut [L]),
        ) {
            match self {}
        }

        pub(in super::super) fn extrapolate<L>(
            self,
            _: (&[[f64; 2]], &[L]),
            _: L,
            _: (&[L], &[L]),
            _: (&mut [L], &mut [L]),
            _: &mut [L],
        ) {
            match self {}
        }

        pub(in super::super) fn mean_squares<L, V>(
            self,
            _: ([Row; 2], &Slopes<'_, V>),
            _: [&[L]; 2],
            _: [&[L]; 2],
        ) -> [f64; 2] {
            match self {}
        }
    }

    impl StageLoops for WideSums {
        fn points(
            self,
            _: &StageRow,
            _: (&[f64], &[f64]),
            _: [&[F64x4]; 2],
            _: &mut [F64x4],
            _: &mut [F64x4],
        ) -> Moved {
            match self {}
        }

        fn weigh(self, _: F64x4, _: &[F64x4], _: &mut [F64x4]) {
            match self {}
        }

        fn extrapolate(self, _: &[StageRow; 2], _: &[[F64x4; 2]; 2], _: [&[f64]; 2], _: [&mut [F64x4]; 2]) {
            match self {}
        }

        fn progress(self, _: &[F64x4], _: &mut [f64]) -> bool {
            match self {}
        }
    }

    /// The derivatives that sums are of.
    #[expect(dead_code, reason = "nobody sums without compiled code")]
    pub(in super::super) struct Slopes<'a, V> {
        pub(in super::super) n_stages: usize,
        pub(in super::super) first: &'a V,
        pub(in super::super) stored: &'a [V],
        pub(in super::super) last: &'a V,
    }

    impl<R> Run<R> for Compiled {
        fn program(&self) -> &Program {
            match *self {}
        }

        fn run_at(&self, _: usize, _: &[R], _: &[R], _: Point<'_, R>, _: &mut [R]) {
            match *self {}
        }
    }
}
