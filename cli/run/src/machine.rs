//! Machine code of programs made in memory, where there is memory that a processor runs.
//!
//! Deliberately does not know: scenes, who evaluates them.

#[cfg(all(feature = "jit", not(target_family = "wasm")))]
pub(super) use hamel_jit::{Compiled, Slopes, WideSums};

/// Whether programs can be compiled in memory: WebAssembly runs nothing that was not there from the beginning.
pub(super) const IS_THERE: bool = cfg!(all(feature = "jit", not(target_family = "wasm")));

#[cfg(not(all(feature = "jit", not(target_family = "wasm"))))]
pub(super) use nothing::{Compiled, Slopes, WideSums};

#[cfg(not(all(feature = "jit", not(target_family = "wasm"))))]
mod nothing {
    use hamel_program::program::{Point, Program, Run};
    use hamel_runtime::{F64x4, Row};

    /// A compiled program, of which there is none.
    #[derive(Debug)]
    pub(in super::super) enum Compiled {}

    impl Compiled {
        /// The reason why a program is not compiled.
        pub(in super::super) fn new(_: &Program) -> Result<Compiled, &'static str> {
            Err("machine code cannot be made in memory here")
        }

        pub(in super::super) fn run_row(
            &self,
            _: usize,
            _: (&[F64x4], &[F64x4]),
            _: (F64x4, F64x4),
            _: usize,
            _: &[F64x4],
            _: &mut [F64x4],
        ) -> bool {
            match *self {}
        }
    }

    /// Sums in registers that are asked for at run time, of which there are none.
    #[derive(Clone, Copy, Debug)]
    pub(in super::super) enum WideSums {}

    impl WideSums {
        pub(in super::super) fn of_host() -> Option<WideSums> {
            None
        }

        pub(in super::super) fn stage<V>(
            self,
            _: (Row, &Slopes<'_, V>),
            _: F64x4,
            _: &[F64x4],
            _: &mut [F64x4],
        ) {
            match self {}
        }

        pub(in super::super) fn advance<V>(
            self,
            _: (Row, &Slopes<'_, V>),
            _: F64x4,
            _: (&[F64x4], &[F64x4]),
            _: (&mut [F64x4], &mut [F64x4]),
        ) {
            match self {}
        }

        pub(in super::super) fn extrapolate(
            self,
            _: (&[[f64; 2]], &[Vec<F64x4>]),
            _: F64x4,
            _: (&[F64x4], &[F64x4]),
            _: (&mut [F64x4], &mut [F64x4]),
            _: &mut [F64x4],
        ) {
            match self {}
        }

        pub(in super::super) fn mean_squares<V>(
            self,
            _: ([Row; 2], &Slopes<'_, V>),
            _: [&[F64x4]; 2],
            _: [&[F64x4]; 2],
        ) -> [f64; 2] {
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
