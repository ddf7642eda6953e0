//! Machine code of programs made in memory, where there is memory that a processor runs.
//!
//! Deliberately does not know: scenes, who evaluates them.

#[cfg(all(feature = "jit", not(target_family = "wasm")))]
pub(super) use hamel_jit::Compiled;

/// Whether programs can be compiled in memory: WebAssembly runs nothing that was not there from the beginning.
pub(super) const IS_THERE: bool = cfg!(all(feature = "jit", not(target_family = "wasm")));

#[cfg(not(all(feature = "jit", not(target_family = "wasm"))))]
pub(super) use nothing::Compiled;

#[cfg(not(all(feature = "jit", not(target_family = "wasm"))))]
mod nothing {
    use hamel_program::program::{Point, Program, Run};

    /// A compiled program, of which there is none.
    #[derive(Debug)]
    pub(in super::super) enum Compiled {}

    impl Compiled {
        /// The reason why a program is not compiled.
        pub(in super::super) fn new(_: &Program) -> Result<Compiled, &'static str> {
            Err("machine code cannot be made in memory here")
        }
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
